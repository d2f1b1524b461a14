"""Periods, actions and turning points against adaptive quadrature with twenty digits.

The bound on a relative error is a few roundings, and where the state itself decides no more, what
its rounding changes: next to a separatrix the period answers an energy dh with

    dT = n dh/(k |h - h_s|),

and the action with dJ = T dh/2 pi. Here dh is `slack`, the rounding of this very state, not of
energies of the size of the coefficients.
"""

from __future__ import annotations

import functools

import numpy as np
import pytest
from mpmath import mp, mpf
from properties.strategies import FAMILIES
from scipy.special import ellipe, ellipk, ellipkm1
from witnesses import oracle
from witnesses.orbit_oracle import orbit
from witnesses.variants import some

from phasekit.errors import OrbitKind, ParameterError
from phasekit.phase.exact.orbits import orbits, orbits_at_energy, orbits_at_gap

UNIT = 2.0**-53
RELATIVE = 2e-14
RANDOM = 5e-14
RECORDED = oracle.cases("orbit")
KINDS = {"libration": OrbitKind.LIBRATION, "rotation": OrbitKind.ROTATION}
FLOATS = ("orbit_energy", "period", "frequency", "action", "phi_min", "phi_max")
WELLS = [
    (1.3, 0.2, 0.15),
    (1.3, -0.2, 0.4),
    (-1.3, 0.2, 0.15),
    (-0.7, 0.3, -0.05),
    (2.0, 1.0, 0.0),
    (2.0, 0.0, 1.1),
    (-2.0, 1.0, 0.0),
    (-2.0, 0.0, -0.3),
]
SINGLE = [(0.4, 1.1, -0.3), (-0.4, 1.1, -0.3), (0.0, -0.6, 0.8), (1.0, 0.2, 1.7), (-1.0, 3.0, 0.0)]


@functools.cache
def points(A, B, C):
    """Equilibria by label, and their energies, with 80 digits at least."""
    found = oracle.labelled(A, B, C)
    return found, {label: p.energy for label, p in found.items()}


def slack(A, B, C, phi0, v0) -> mpf:
    """What half a unit in the last place of the state, and of an equilibrium, changes in h."""
    steep = abs(oracle.gradient(A, B, C, phi0))
    sizes = abs(mpf(A)) + abs(mpf(B)) + abs(mpf(C))
    return UNIT * (mpf(v0) ** 2 + steep * max(1, abs(phi0))) + sizes * (4 * UNIT) ** 2


def bounds(A, B, C, phi0, v0, want, relative=RELATIVE):
    """Absolute bounds on period and action."""
    found, energies = points(A, B, C)
    dh = 2 * slack(A, B, C, phi0, v0)
    change = mpf(0)
    for label, p in found.items():
        apart = abs(want.energy - energies[label])
        k = mp.sqrt(abs(p.curvature))
        # Two passages, or the algebraic change of T at a fold, a cusp or a center.
        change += dh / apart * min(2 / k if k else mp.inf, want.period)
    return relative * want.period + change, relative * want.action + dh * want.period / 6


def check(A, B, C, phi0, v0, relative=RELATIVE, want=None):
    """Compare one orbit with the oracle; return it."""
    want = want or orbit(A, B, C, phi0, v0, dps=20)
    got = orbits(A, B, C, phi0, v0)
    context = (A, B, C, phi0, v0)
    assert got.orbit_kind == KINDS[want.kind], context
    period, action = bounds(*context, want, relative)
    off = abs(mpf(float(got.period)) - want.period)
    assert off <= period, (*context, "period", float(got.period), float(off / want.period))
    off = abs(mpf(float(got.action)) - want.action)
    assert off <= action, (*context, "action", float(got.action), float(off / want.action))
    assert got.frequency == pytest.approx(2 * np.pi / got.period, rel=4 * UNIT)
    scale = max(abs(x) for x in (A, B, C, v0 * v0))
    assert abs(mpf(float(got.orbit_energy)) - want.energy) <= 4 * UNIT * scale, context
    if want.lo is None:
        assert np.isnan(got.phi_min), context
        assert np.isnan(got.phi_max), context
        return got
    for x, exact in ((got.phi_min, want.lo), (got.phi_max, want.hi)):
        # A turning point answers dh with dh/|V'|; where V' vanishes, V itself has to agree.
        end = mpf(float(x))
        close = abs(end - exact) <= 16 * UNIT * max(1, abs(exact))
        level = abs(oracle.potential(A, B, C, end) - want.energy)
        steep = abs(oracle.gradient(A, B, C, end))
        good = level <= 64 * slack(*context) + 16 * UNIT * max(1, abs(exact)) * steep
        assert close or good, (*context, "turning", float(x), float(exact))
    return got


# --- recorded --------------------------------------------------------------------------------


@pytest.mark.slow
@pytest.mark.parametrize("case", RECORDED, ids=lambda case: case["id"])
def test_recorded_values(case):
    """Period, action, frequency to 2e-14, so to 1e-12 by far; the oracle agrees to 22 digits."""
    args = [float(case["in"][name]) for name in ("A", "B", "C", "phi0", "v0")]
    out = case["out"]
    want = orbit(*args, dps=30)
    assert want.kind == out["kind"]
    for mine, name in zip(want[1:], ("h", "T", "J", "lo", "hi"), strict=True):
        if out[name] is None:
            assert mine is None
        else:
            recorded = mpf(out[name])
            assert abs(mine - recorded) <= mpf(10) ** -22 * max(abs(recorded), name[0] in "hl")
    got = check(*args, want=want)
    # No condition number for these, except for the small oscillation.
    loose = 1e-10 if "small_amplitude" in case["tags"] else RELATIVE
    for name, x in (("T", got.period), ("omega", got.frequency), ("J", got.action)):
        recorded = mpf(out[name])
        within = loose if name == "J" else RELATIVE
        assert abs(mpf(float(x)) - recorded) <= within * recorded, name
    assert abs(mpf(float(got.orbit_energy)) - mpf(out["h"])) <= 1e-15 * max(1, abs(mpf(out["h"])))


# --- random ----------------------------------------------------------------------------------


def lobe_states(rng, A, B, C):
    """States in each well and outside it, from the smallest to the closest to a separatrix."""
    found, energies = points(A, B, C)
    saddle = "lower_saddle" if "upper_center" in found else "upper_saddle"
    for center in ("lower_center", "upper_center"):
        if center not in found or found[center].kind != "center":
            continue
        top = float(mp.sqrt(2 * (energies[saddle] - energies[center])))
        part = [
            10 ** rng.uniform(-8, -2),
            rng.uniform(0.05, 0.95),
            1 - 10 ** rng.uniform(-12, -2),
            1 + 10 ** rng.uniform(-12, -2),
        ][rng.integers(4)]
        yield float(found[center].phi), float(rng.choice([-1, 1])) * top * part
    size = max(abs(A), abs(B), abs(C)) ** 0.5
    yield float(found["upper_saddle"].phi), size * 10 ** rng.uniform(-10, 3)
    yield float(rng.uniform(-4, 4)), float(-size * 10 ** rng.uniform(-2, 1))
    yield float(rng.uniform(-4, 4)), 0.0


@pytest.mark.slow
@pytest.mark.parametrize("family", some(FAMILIES, 2))
def test_random_orbits(family):
    rng = np.random.default_rng(64)
    tried = 0
    for A, B, C in np.array(FAMILIES[family](rng, 300)).T:
        # What is smaller is tried below: so many digits do not see it.
        if min(abs(x) for x in (A, B, C) if x) > 1e-25 * max(abs(A), abs(B), abs(C)):
            for phi0, v0 in lobe_states(rng, float(A), float(B), float(C)):
                check(float(A), float(B), float(C), phi0, v0, RANDOM)
            tried += 1
        if tried == 2:
            return
    raise AssertionError("too few systems")


@pytest.mark.slow
@pytest.mark.parametrize("system", some(WELLS + SINGLE, 3))
def test_amplitudes_from_small_to_the_separatrix(system):
    """Parts 1e-8 to 1 - 1e-12 of the lobe, in every well; at rest and in the middle."""
    found, energies = points(*system)
    saddle = "lower_saddle" if "upper_center" in found else "upper_saddle"
    for center in ("lower_center", "upper_center"):
        if center not in found:
            continue
        phi = float(found[center].phi)
        top = float(mp.sqrt(2 * (energies[saddle] - energies[center])))
        for part in (1e-8, 0.5, 1 - 1e-6, 1 - 1e-12):
            got = check(*system, phi, top * part)
            if 1e-5 < part < 0.9999:
                for end in (got.phi_min, got.phi_max):
                    check(*system, float(end), 0.0)


@pytest.mark.slow
@pytest.mark.parametrize("system", some(WELLS + SINGLE, 4))
def test_rotations_from_the_separatrix_to_the_fastest(system):
    """Up to a million times the energy of the separatrix."""
    found, _ = points(*system)
    phi = float(found["upper_saddle"].phi)
    size = max(abs(x) for x in system) ** 0.5
    for speed in (1e-10, 1e-5, 1.0, 1e3):
        check(*system, phi, -speed * size)


@pytest.mark.parametrize("speed", [1e4, 1e6, 3e8, 1e9, 1e12, 1e100])
def test_fast_rotations_are_free(speed):
    """T = 2 pi/v and J = v, with the mean of V taken off: v^2/2 + V(phi0) is the energy."""
    for A, B, C in (*WELLS, *SINGLE, (1e-300, 0.3, 0.0), (0.0, 0.0, 1e-12)):
        for v in (speed, -speed):
            got = orbits(A, B, C, 1.234, v)
            with mp.workdps(60):
                # The mean of V over the angle is A/4; the next order is 1/v^4.
                mean = mp.sqrt(mpf(v) ** 2 + 2 * (oracle.potential(A, B, C, 1.234) - mpf(A) / 4))
                assert got.orbit_kind == OrbitKind.ROTATION
                assert abs(mpf(float(got.period)) * mean / (2 * mp.pi) - 1) <= 8 * UNIT + speed**-4
                assert abs(mpf(float(got.action)) / mean - 1) <= 8 * UNIT + speed**-4


# --- theorems --------------------------------------------------------------------------------


@pytest.mark.parametrize("system", WELLS + SINGLE)
def test_derivative_of_the_action_is_the_period(system):
    """dJ/dh = T/2 pi, by differences of fourth order."""
    _, energies = points(*system)
    bottom, top = (float(energies[x]) for x in ("lower_center", "upper_saddle"))
    levels = [bottom + part * (top - bottom) for part in (0.02, 0.35, 0.8, 0.97, 1.05, 1.4, 8.0)]
    for h in levels:
        if min(abs(h - float(e)) for e in energies.values()) < 0.02 * (top - bottom):
            continue
        step = 1e-4 * (top - bottom)
        J = orbits_at_energy(*system, h + step * np.array([-2, -1, 1, 2]), 0).action
        slope = (8 * (J[2] - J[1]) - (J[3] - J[0])) / (12 * step)
        assert slope == pytest.approx(
            orbits_at_energy(*system, h, 0).period / (2 * np.pi), rel=1e-8
        )


@pytest.mark.parametrize("system", WELLS + SINGLE)
def test_small_oscillations(system):
    """T tends to 2 pi/sqrt(V''); at the center itself it is that."""
    found, energies = points(*system)
    for i, center in enumerate(("lower_center", "upper_center")):
        if center not in found:
            continue
        exact = 2 * mp.pi / mp.sqrt(found[center].curvature)
        rest = orbits_at_energy(*system, float(energies[center]) * (1 + 1e-17), i)
        assert rest.orbit_kind == OrbitKind.EQUILIBRIUM
        assert rest.action == 0
        for v in (1e-6, 1e-8, 1e-12, 1e-14, 1e-150):
            got = orbits(*system, float(found[center].phi), v)
            assert abs(mpf(float(got.period)) / exact - 1) <= 4 * UNIT + 10 * v * v
        assert abs(mpf(float(rest.period)) / exact - 1) <= 4 * UNIT


@pytest.mark.parametrize("phi0", [1e-8, 1e-14, 1e-100, 1e-150])
@pytest.mark.parametrize("system", [(0.0, 1.7, 0.0), (-0.6, 1.7, 0.0), (0.4, 1.7, 0.0)])
def test_tiny_amplitudes(system, phi0):
    """Round the center 0: T = 2 pi/sqrt(B - A), J = sqrt(B - A) phi0^2/2 to all digits."""
    got = orbits(*system, phi0, 0.0)
    k = np.sqrt(system[1] - system[0])
    assert got.orbit_kind == OrbitKind.LIBRATION
    assert got.period == pytest.approx(2 * np.pi / k, rel=8 * UNIT + phi0**2)
    assert got.action == pytest.approx(k * phi0 * phi0 / 2, rel=16 * UNIT + phi0**2)
    assert got.phi_max == pytest.approx(phi0, rel=8 * UNIT)
    assert got.phi_min == pytest.approx(-phi0, rel=8 * UNIT)


@pytest.mark.parametrize("system", [s for s in WELLS if s[1] * s[2]])
def test_wells_have_the_same_period(system):
    """At the same energy both wells have the same period, but not the same action."""
    _, energies = points(*system)
    bottom, top = float(energies["upper_center"]), float(energies["lower_saddle"])
    parts = np.array([0.01, 0.2, 0.5, 0.9, 0.999, 1 - 1e-6, 1 - 1e-12])
    h = bottom + parts * (top - bottom)
    left, right = (orbits_at_energy(*system, h, center) for center in (0, 1))
    assert np.all(left.orbit_kind == OrbitKind.LIBRATION)
    assert np.all(right.orbit_kind == OrbitKind.LIBRATION)
    # What h itself decides next to the saddle, and at the bottom of the upper well.
    loss = 8 * UNIT * (1 + max(abs(top), abs(bottom)) / np.minimum(top - h, 1e99))
    assert np.all(np.abs(left.period / right.period - 1) <= loss)
    assert np.all(np.abs(left.period[:5] / right.period[:5] - 1) <= 4 * UNIT + loss[:5])
    assert np.all(np.abs(left.action / right.action - 1) > 1e-3)
    gaps = -(top - bottom) * np.array([0.5, 0.1, 1e-3, 1e-9, 1e-20, 1e-100, 1e-280])
    left, right = (orbits_at_gap(*system, gaps, 0, side) for side in (0, 1))
    assert np.all(np.abs(left.period / right.period - 1) <= 8 * UNIT)
    # One well ends at the saddle where the other one begins.
    assert np.all((right.phi_min - left.phi_max) % (2 * np.pi) < 2)


@pytest.mark.parametrize("system", [s for s in WELLS if not s[1] * s[2]])
def test_mirrored_wells_are_the_same(system):
    for gap in (-0.1, -1e-6, -1e-40):
        left, right = (orbits_at_gap(*system, gap, 0, side) for side in (0, 1))
        assert left.orbit_kind == right.orbit_kind == OrbitKind.LIBRATION
        assert left.period == pytest.approx(float(right.period), rel=8 * UNIT)
        if system[1] * system[0] > 0 or system[2] * system[0] < 0:  # not heteroclinic
            assert left.action == pytest.approx(float(right.action), rel=8 * UNIT)


# --- textbook --------------------------------------------------------------------------------


@pytest.mark.parametrize("B", [1.0, 0.3, 7e5])
def test_pendulum(B):
    """T = 4 K/sqrt(B), J = (8/pi) sqrt(B) (E - (1 - m) K); m = sin(phi0/2)^2."""
    phi0 = np.array([1e-3, 0.1, 0.5, 1.0, 2.0, 3.0, 3.1, 3.14])
    periods, actions = [], []
    with mp.workdps(40):
        for x in phi0:
            m = mp.sin(mpf(x) / 2) ** 2
            K, E = mp.ellipk(m), mp.ellipe(m)
            periods.append(float(4 * K / mp.sqrt(B)))
            actions.append(float(8 / mp.pi * mp.sqrt(B) * (E - (1 - m) * K)))
    for zero in (0.0, -0.0):
        got = orbits(zero, B, zero, phi0, 0.0)
        assert np.all(got.orbit_kind == OrbitKind.LIBRATION)
        assert np.allclose(got.period, periods, rtol=2e-15, atol=0)
        assert np.allclose(got.action, actions, rtol=4e-15, atol=0)
        assert np.allclose(got.phi_max, phi0, rtol=4e-16, atol=1e-15)
        assert np.allclose(got.phi_min, -phi0, rtol=4e-16, atol=1e-15)
    m = np.sin(phi0[2:] / 2) ** 2  # SciPy's own functions
    K = ellipkm1(np.cos(phi0[2:] / 2) ** 2)
    assert np.allclose(got.period[2:], 4 * K / np.sqrt(B), rtol=2e-15, atol=0)
    want = 8 / np.pi * np.sqrt(B) * (ellipe(m) - (1 - m) * K)
    assert np.allclose(got.action[2:], want, rtol=1e-14, atol=0)


@pytest.mark.parametrize("B", [1.0, 0.3, 7e5])
def test_turning_pendulum(B):
    """T = 4 K/v, J = 2 v E/pi; v the speed at the bottom, m = 4 B/v^2."""
    v = np.sqrt(B) * np.array([2.0001, 2.1, 3.0, 10.0, 1e3, 1e6, 1e8])
    m = 4 * B / v**2
    got = orbits(0.0, B, 0.0, 0.0, np.concatenate([v, -v]))
    assert np.all(got.orbit_kind == OrbitKind.ROTATION)
    assert np.allclose(got.period, np.tile(4 * ellipk(m) / v, 2), rtol=1e-12, atol=0)
    assert np.allclose(got.period[2:7], (4 * ellipk(m) / v)[2:], rtol=2e-15, atol=0)
    assert np.allclose(got.action, np.tile(2 / np.pi * v * ellipe(m), 2), rtol=2e-15, atol=0)


@pytest.mark.parametrize(("A", "B"), [(2.0, 0.8), (1.0, -0.3), (5.0, 1e-9), (3.0, 2.9)])
def test_side_wells_of_a_symmetric_system(A, B):
    """C = 0, A > 0: T = 4 K(m)/sqrt(A (1 - c1) (1 + c2)) round cos(phi) = B/A = lambda.

    m = 2 (c2 - c1)/((1 - c1) (1 + c2)), c1 and c2 = lambda -+ sqrt(2 h/A + lambda^2).
    """
    ratio = mpf(B) / A
    reach = min(1 - ratio, 1 + ratio)
    for part in (1e-4, 0.1, 0.5, 0.9, 0.999, 1 - 1e-7):
        phi0 = float(mp.acos(ratio + part * reach))
        c2 = mp.cos(mpf(phi0))
        c1 = 2 * ratio - c2
        m = 2 * (c2 - c1) / ((1 - c1) * (1 + c2))
        want = 4 * mp.ellipk(m) / mp.sqrt(A * (1 - c1) * (1 + c2))
        # dT/dh dh of the rounding of phi0.
        room = float(min(1 - c2, 1 + c1) * A)
        dh = 2 * slack(A, B, 0.0, phi0, 0.0)
        for sense in (1, -1):
            got = orbits(A, B, 0.0, sense * phi0, 0.0)
            off = abs(mpf(float(got.period)) / want - 1)
            assert off <= 4e-15 + dh / room, (part, float(off))
            ends = sorted((sense * phi0, float(sense * mp.acos(c1))))
            assert got.phi_min == pytest.approx(ends[0], abs=2e-15 + 1e-15 / part)
            assert got.phi_max == pytest.approx(ends[1], abs=2e-15 + 1e-15 / part)


# --- special systems -------------------------------------------------------------------------


def test_no_force():
    got = orbits(0.0, 0.0, 0.0, [0.3, 0.3, 1e9, 0.3], [2.0, -4.0, 1e-200, 0.0])
    rotation, rest = OrbitKind.ROTATION, OrbitKind.EQUILIBRIUM
    assert list(got.orbit_kind) == [rotation, rotation, rotation, rest]
    assert np.allclose(got.period[:3], [np.pi, np.pi / 2, 2e200 * np.pi], rtol=4e-16)
    assert got.period[3] == np.inf
    assert list(got.action) == [2.0, 4.0, 1e-200, 0.0]
    assert list(got.orbit_energy) == [2.0, 8.0, 0.0, 0.0]
    assert list(got.frequency) == [2.0, 4.0, 1e-200, 0.0]
    assert np.all(np.isnan(got.phi_min[:3]))
    assert got.phi_min[3] == got.phi_max[3] == 0.3


@pytest.mark.parametrize("A", [1.44, -1.44])
def test_pendulum_of_the_double_angle(A):
    """B = C = 0: 2 phi moves like a pendulum."""
    center = np.pi / 2 if A > 0 else 0.0
    for amplitude in (0.01, 0.4, 1.2, 1.56):
        phi0 = center + amplitude
        with mp.workdps(40):
            exact = abs(mpf(phi0) - (mp.pi / 2 if A > 0 else 0))
            want = 4 * mp.ellipk(mp.sin(exact) ** 2) / mp.sqrt(abs(A))
        for turn in (0.0, -np.pi):
            got = orbits(A, 0.0, 0.0, phi0 + turn, 0.0)
            assert got.orbit_kind == OrbitKind.LIBRATION
            assert got.period == pytest.approx(float(want), rel=2e-14 if turn or A > 0 else 4e-15)
            # J of the pendulum is four times as large: d(2 phi)/dt d(2 phi).
            other = orbits(0.0, abs(A), 0.0, 2 * amplitude, 0.0)
            assert got.action == pytest.approx(other.action / 4, rel=1e-13)
    for v in (1.21, 3.0, 1e3):  # over the saddle: v^2 > |A|
        got = orbits(A, 0.0, 0.0, center, v)
        m = abs(A) / v**2
        assert got.orbit_kind == OrbitKind.ROTATION
        assert got.period == pytest.approx(4 * ellipk(m) / v, rel=1e-14)
        assert got.action == pytest.approx(2 * v * ellipe(m) / np.pi, rel=1e-14)


def test_tilted_pendulum():
    """A = 0: round atan2(C, B), of strength sqrt(B^2 + C^2)."""
    B, C = 0.6, -0.8
    tilt = np.arctan2(C, B)
    upright = orbits(0.0, 1.0, 0.0, [0.5, 2.5, 0.0], [0.0, 0.0, 2.5])
    got = orbits(0.0, B, C, tilt + np.array([0.5, 2.5, 0.0]), [0.0, 0.0, 2.5])
    assert np.allclose(got.period, upright.period, rtol=4e-15)
    assert np.allclose(got.action, upright.action, rtol=4e-15)
    assert np.allclose(got.phi_max[:2], tilt + upright.phi_max[:2], rtol=2e-15)
    for phi0, v0 in ((tilt + 0.5, 0.0), (tilt, 1.999), (tilt, 2.001)):
        check(0.0, B, C, float(phi0), v0)


@pytest.mark.slow
@pytest.mark.parametrize("system", [(3.0, 0.0, 1.2), (3.0, 0.0, -2.9), (-3.0, 1.5, 0.0)])
def test_heteroclinic_systems(system):
    """Both saddles have the same energy: their gaps name the same orbits."""
    found, energies = points(*system)
    center = float(found["lower_center"].phi)
    for part in (0.5, 1 - 1e-11, 1 + 1e-6):
        for label in ("lower_center", "upper_center"):
            top = float(mp.sqrt(2 * (energies["upper_saddle"] - energies[label])))
            check(*system, float(found[label].phi), part * top)
    k = float(mp.sqrt(-found["upper_saddle"].curvature))
    for gap in (-1e-9, -1e-100, 1e-9, 1e-100):
        for side in (0, 1):
            low, high = (orbits_at_gap(*system, gap, saddle, side) for saddle in (0, 1))
            assert low.orbit_kind == high.orbit_kind
            closer = orbits_at_gap(*system, gap / 1e50, 1, side)
            # Two passages a turn, at half the distance each.
            assert closer.period - high.period == pytest.approx(2 / k * 50 * np.log(10), rel=1e-7)
    assert orbits(*system, center, 0.1).orbit_kind == OrbitKind.LIBRATION


@pytest.mark.slow
@pytest.mark.parametrize("factor", [1, -1])
@pytest.mark.parametrize(
    ("A", "B", "C"),
    [
        (125.0, 27.0, 64.0),
        (-125.0, 64.0, -27.0),
        (4.0, 4.0, 0.0),
        (-4.0, 4.0, 0.0),
        (4.0, 0.0, 4.0),
    ],
)
def test_exact_folds_and_cusps(A, B, C, factor):
    B, C = factor * B, factor * C
    found, energies = points(A, B, C)
    label = next(x for x in found if found[x].kind not in ("center", "saddle"))
    flat, level = found[label], energies[label]
    for v0 in (1e-3, 0.1, 1.0, 20.0):
        check(A, B, C, float(flat.phi), v0)
    for offset in (-1.0, -0.05, 0.05, 1.0):
        check(A, B, C, float(flat.phi) + offset, 0.0)
    bottom = found["lower_center"]
    if bottom is not flat:
        top = mp.sqrt(2 * (level - energies["lower_center"]))
        for part in (1e-6, 0.5, 0.999, 1.001):
            check(A, B, C, float(bottom.phi), float(top * part))


@pytest.mark.parametrize("exponent", [-498, -300, -20, 1, 77, 300, 505])
def test_scaling_by_powers_of_four_is_exact(exponent):
    """T(c^2 A, c^2 B, c^2 C, phi, c v) = T/c and J = c J, to the last bit."""
    rng = np.random.default_rng(4)
    A, B, C = rng.uniform(-1, 1, (3, 50))
    phi0 = rng.uniform(-3, 3, 50)
    v0 = rng.uniform(-2, 2, 50) * (rng.random(50) < 0.7)
    c = 2.0**exponent
    got, other = orbits(A, B, C, phi0, v0), orbits(c * c * A, c * c * B, c * c * C, phi0, c * v0)
    assert np.array_equal(got.orbit_kind, other.orbit_kind)
    assert np.array_equal(got.period / c, other.period)
    assert np.array_equal(got.action * c, other.action)
    assert np.array_equal(got.phi_min, other.phi_min, equal_nan=True)
    assert np.array_equal(got.phi_max, other.phi_max, equal_nan=True)


@pytest.mark.slow
@pytest.mark.parametrize("scale", [1e-300, 1e-250, 1e-100, 1e100, 1e300])
def test_extreme_scales(scale):
    for system in (WELLS[0], WELLS[3], SINGLE[2]):
        scaled = tuple(x * scale for x in system)
        for phi0, v in ((0.4, 0.0), (1.0, 0.7), (2.0, -3.0)):
            check(*scaled, phi0, v * scale**0.5)


@pytest.mark.parametrize("tiny", [1e-30, 1e-100, 1e-300, 5e-324])
def test_vanishing_coefficients(tiny):
    """A coefficient that no digit of the result depends on is as good as zero."""
    states = [(0.4, 0.0), (-2.0, 0.3), (1.0, 2.2), (2.9, -0.01)]
    for system in ((1.0, 0.4, 0.0), (-1.0, 0.4, 0.0), (0.0, 0.4, 0.3), (1.0, 0.0, 0.4)):
        small = tuple(x or tiny for x in system)
        for phi0, v0 in states:
            got, want = orbits(*small, phi0, v0), orbits(*system, phi0, v0)
            assert got.orbit_kind == want.orbit_kind
            assert got.period == pytest.approx(float(want.period), rel=2e-14)
            assert got.action == pytest.approx(float(want.action), rel=2e-14)


@pytest.mark.slow
@pytest.mark.parametrize("phi0", [1e2, -1e4, 123456.789, 1e8, -3.3e12])
def test_many_turns_away(phi0):
    """The angle is taken as it is; turning points are unwrapped round it."""
    for system in (WELLS[0], WELLS[2], SINGLE[1]):
        for v0 in (0.0, 0.2, 5.0):
            got = check(*system, phi0, v0)
            if got.orbit_kind == OrbitKind.LIBRATION:
                assert got.phi_min - 1e-14 * abs(phi0) <= phi0 <= got.phi_max + 1e-14 * abs(phi0)


def test_equilibria():
    """At rest where V' = 0 in floating point."""
    got = orbits([0.0, 0.0, -1.0, 0.5], [2.25, -2.25, 1.25, -1.0], 0.0, [0.0, 0.0, 0.0, 0.0], 0.0)
    assert np.all(got.orbit_kind == OrbitKind.EQUILIBRIUM)
    assert np.allclose(got.period, [2 * np.pi / 1.5, np.inf, 2 * np.pi / 1.5, np.inf], rtol=4e-16)
    assert np.allclose(got.frequency, [1.5, 0.0, 1.5, 0.0], rtol=4e-16)
    assert np.all(got.action == 0)
    assert np.all(got.phi_min == 0)
    assert np.all(got.phi_max == 0)
    for zero in (0.0, -0.0):
        assert orbits(0.0, 1.0, 0.0, zero, -0.0).orbit_kind == OrbitKind.EQUILIBRIUM


@pytest.mark.parametrize("system", some(WELLS + SINGLE, 3))
def test_saddles_at_rest(system):
    """The double next to a saddle is on its separatrix within rounding."""
    found, _ = points(*system)
    for label in ("lower_saddle", "upper_saddle"):
        if label in found:
            got = orbits(*system, float(found[label].phi), 0.0)
            assert got.orbit_kind in (OrbitKind.EQUILIBRIUM, OrbitKind.ASYMPTOTIC)
            assert got.period == np.inf
            assert got.frequency == 0


@pytest.mark.parametrize("system", some(WELLS + SINGLE, 3))
def test_states_on_a_separatrix(system):
    found, energies = points(*system)
    for label in ("lower_saddle", "upper_saddle"):
        if label not in found:
            continue
        for offset in (-0.3, 0.2, 0.5):
            phi0 = float(found[label].phi) + offset
            kinetic = energies[label] - oracle.potential(*system, phi0)
            if kinetic <= 0:
                continue
            for sense in (1, -1):
                v0 = float(sense * mp.sqrt(2 * kinetic))
                got = orbits(*system, phi0, v0)
                assert got.orbit_kind == OrbitKind.ASYMPTOTIC
                assert got.period == np.inf
                assert got.frequency == 0
                assert np.isnan(got.action)
                assert got.phi_min <= phi0 <= got.phi_max
                # Both ends are at the level of the saddle.
                for end in (got.phi_min, got.phi_max):
                    level = oracle.potential(*system, float(end))
                    assert abs(level - energies[label]) < 1e-13


def test_pendulum_on_the_separatrix():
    got = orbits(0.0, 1.0, 0.0, [0.0, 0.0, np.pi / 2], [2.0, -2.0, np.sqrt(2)])
    assert np.all(got.orbit_kind == OrbitKind.ASYMPTOTIC)
    assert np.allclose(got.phi_min, -np.pi, rtol=4e-16)
    assert np.allclose(got.phi_max, np.pi, rtol=4e-16)
    for v, kind in ((2 - 1e-12, OrbitKind.LIBRATION), (2 + 1e-12, OrbitKind.ROTATION)):
        assert orbits(0.0, 1.0, 0.0, 0.0, v).orbit_kind == kind


# --- energies and gaps -----------------------------------------------------------------------


def at_gap(A, B, C, gap, saddle, side, dps=30):
    """Exact orbit: from the center next to the saddle, with this energy above the saddle's."""
    with mp.workdps(3 * dps):
        found, _ = points(A, B, C)
        s = found["upper_saddle" if saddle else "lower_saddle"]
        turn = 2 * mp.pi
        centers = [p for p in found.values() if p.kind == "center"]
        sense = 1 if side else -1
        near = min(centers, key=lambda p: (sense * (p.phi - s.phi)) % turn)
        level = oracle.potential(A, B, C, s.phi) + mpf(gap)
        v0 = mp.sqrt(2 * (level - oracle.potential(A, B, C, near.phi)))
        return orbit(A, B, C, near.phi, v0, dps=dps), mp.sqrt(-s.curvature)


@pytest.mark.slow
@pytest.mark.parametrize("system", some([WELLS[4], WELLS[0], SINGLE[0]], 2))
@pytest.mark.parametrize("saddle", [0, 1])
@pytest.mark.parametrize("sense", [-1, 1])
def test_gaps(system, saddle, sense):
    """Against the oracle down to 1e-30; from there T grows by (n/k) ln, J has its limit."""
    if saddle == 0 and system in SINGLE:
        return
    for side in (0, 1) if saddle == 0 and sense < 0 else (1,):
        for gap in (1e-2, 1e-10, 1e-30):
            want, k = at_gap(*system, sense * gap, saddle, side)
            got = orbits_at_gap(*system, sense * gap, saddle, side)
            assert got.orbit_kind == KINDS[want.kind]
            assert abs(mpf(float(got.period)) / want.period - 1) <= 4e-15, (gap, side)
            assert abs(mpf(float(got.action)) / want.action - 1) <= 4e-15, (gap, side)
            if want.lo is not None:
                shift = 2 * np.pi * np.rint((float(want.lo) - got.phi_min) / (2 * np.pi))
                assert got.phi_min + shift == pytest.approx(float(want.lo), abs=4e-15)
                assert got.phi_max + shift == pytest.approx(float(want.hi), abs=4e-15)
        # In a lobe and in rotation once a round, else twice.
        n = 2 if (sense > 0) == (saddle == 0) else 1
        for gap in (1e-60, 1e-150, 1e-280):
            longer = want.period + n / k * mp.log(mpf("1e-30") / mpf(gap))
            got = orbits_at_gap(*system, sense * gap, saddle, side)
            assert abs(mpf(float(got.period)) / longer - 1) <= 4e-15, (gap, side)
            assert abs(mpf(float(got.action)) / want.action - 1) <= 4e-15, (gap, side)


@pytest.mark.slow
@pytest.mark.parametrize("system", some(WELLS + SINGLE, 4))
def test_energies_are_those_of_states(system):
    """`orbits_at_energy` is the orbit through the center with that energy."""
    found, energies = points(*system)
    top = float(energies["upper_saddle"])
    for i, center in enumerate(("lower_center", "upper_center")):
        if center not in found:
            got = orbits_at_energy(*system, top + 1, i)
            assert got.orbit_kind == OrbitKind.NOT_COMPUTED
            assert all(np.isnan(getattr(got, name)) for name in FLOATS if name != "orbit_energy")
            continue
        bottom = float(energies[center])
        for h in bottom + (top - bottom) * np.array([0.03, 0.3, 0.77, 1.2, 30.0]):
            with mp.workdps(60):
                v0 = mp.sqrt(2 * (mpf(float(h)) - energies[center]))
                want = orbit(*system, found[center].phi, v0, dps=30)
            got = orbits_at_energy(*system, h, i)
            assert got.orbit_kind == KINDS[want.kind]
            assert got.orbit_energy == pytest.approx(float(h), abs=2 * UNIT * max(1, abs(h)))
            apart = min(abs(float(e) - h) for e in energies.values())
            loss = 8 * UNIT * (abs(h) + abs(top) + abs(bottom)) / apart
            assert got.period == pytest.approx(float(want.period), rel=4e-15 + loss)
            assert got.action == pytest.approx(float(want.action), rel=4e-15 + 2 * loss)
        below = orbits_at_energy(*system, bottom - 0.1, i)
        assert below.orbit_kind == OrbitKind.NOT_COMPUTED
        assert np.isnan(below.period)


# --- symmetries ------------------------------------------------------------------------------


def test_symmetries():
    """Mirrors, the half turn, the quarter turn that swaps B and C, and time running back."""
    rng = np.random.default_rng(8)
    A, B, C = rng.normal(size=(3, 300))
    phi0, v0 = rng.uniform(-3, 3, 300), rng.normal(size=300) * 1.5
    want = orbits(A, B, C, phi0, v0)
    half, quarter = np.pi, np.pi / 2
    images = {
        "time": (orbits(A, B, C, phi0, -v0), 1, 0.0),
        "mirror": (orbits(A, B, -C, -phi0, -v0), -1, 0.0),
        "half turn": (orbits(A, -B, -C, phi0 + half, v0), 1, -half),
        "upside down": (orbits(A, -B, C, half - phi0, -v0), -1, half),
        "quarter": (orbits(-A, C, B, quarter - phi0, -v0), -1, quarter),
        "turns": (orbits(A, B, C, phi0 + 6 * np.pi, v0), 1, -6 * np.pi),
    }
    # The rounding of an angle, as an energy, next to a separatrix.
    for name, (got, sense, shift) in images.items():
        assert np.array_equal(got.orbit_kind, want.orbit_kind), name
        rounding = 4e-15 if not shift else 1e-13
        well = np.abs(want.period / np.median(want.period)) < 5
        assert np.allclose(got.period[well], want.period[well], rtol=rounding, atol=0), name
        assert np.allclose(got.action[well], want.action[well], rtol=10 * rounding, atol=0), name
        ends = (got.phi_min, got.phi_max) if sense > 0 else (got.phi_max, got.phi_min)
        for end, exact in zip(ends, (want.phi_min, want.phi_max), strict=True):
            back = sense * end + shift
            assert np.allclose(back[well], exact[well], rtol=0, atol=1e-12, equal_nan=True), name


# --- the interface ---------------------------------------------------------------------------


def test_shapes_dtypes_and_invalid_cells():
    A = np.array([[2.0], [np.nan], [0.5]])
    got = orbits(A, [0.3, 0.1, np.inf, 1.0], 0.25, 0.4, 0.1)
    assert all(getattr(got, name).shape == (3, 4) for name in got._fields)
    assert got.orbit_kind.dtype == np.int8
    bad = np.array([[False, False, True, False], [True] * 4, [False, False, True, False]])
    assert np.array_equal(got.orbit_kind == OrbitKind.NOT_COMPUTED, bad)
    for name in FLOATS[1:]:
        assert np.array_equal(np.isnan(getattr(got, name)), bad), name
    alone = orbits(2.0, 0.1, 0.25, 0.4, 0.1)
    assert all(getattr(got, name)[0, 1] == getattr(alone, name) for name in got._fields)
    for state in ((np.nan, 0.0), (0.0, np.inf), (-np.inf, 1.0)):
        got = orbits(2.0, 1.0, 0.3, *state)
        assert got.orbit_kind == OrbitKind.NOT_COMPUTED
        assert np.isnan(got.period)
    assert orbits(np.empty((2, 0)), 1.0, 0.0, 0.1, 0.1).period.shape == (2, 0)
    for found in (
        orbits_at_energy(np.nan, 1.0, 0.0, 0.1, 0),
        orbits_at_gap(2.0, 1, 0, np.nan, 0, 0),
    ):
        assert found.orbit_kind == OrbitKind.NOT_COMPUTED
        assert np.isnan(found.period)


@pytest.mark.parametrize("threads", [0, -1, 1.5, "2"])
def test_bad_threads(threads):
    with pytest.raises(ParameterError, match="threads"):
        orbits(1.0, 1.0, 1.0, 0.0, 0.0, threads=threads)


def test_bad_labels():
    with pytest.raises(ParameterError, match="center"):
        orbits_at_energy(1.0, 1.0, 1.0, 0.0, 2)
    with pytest.raises(ParameterError, match="saddle"):
        orbits_at_gap(1.0, 1.0, 1.0, 0.0, -1, 0)
    with pytest.raises(ParameterError, match="side"):
        orbits_at_gap(1.0, 1.0, 1.0, 0.0, 1, 0.5)
    with pytest.raises(ValueError, match="broadcast"):
        orbits([1.0, 2.0], [1.0, 2.0, 3.0], 0.0, 0.0, 0.0)
