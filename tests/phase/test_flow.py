"""Motions against Taylor series with thirty digits, closed forms and another integrator.

The bound on an error is a few roundings of the largest angle and speed of the motion, and what one
rounding of the state and the time becomes on the way: the variation is taken from the oracle.
"""

from __future__ import annotations

import numpy as np
import pytest
from mpmath import mp, mpf
from properties.strategies import FAMILIES
from scipy.integrate import solve_ivp
from witnesses import oracle
from witnesses.orbit_oracle import flow as taylor
from witnesses.orbit_oracle import flow_at, orbit
from witnesses.variants import some

from phasekit.errors import OrbitKind, ParameterError
from phasekit.phase.exact.flow import flow
from phasekit.phase.exact.orbits import orbits

UNIT = 2.0**-53
RECORDED = oracle.cases("flow")
SYSTEMS = [
    (1.3, 0.2, 0.15),
    (1.3, -0.2, 0.4),
    (-1.3, 0.2, 0.15),
    (2.0, 1.0, 0.0),
    (2.0, 0.0, 1.1),
    (-2.0, 1.0, 0.0),
    (0.4, 1.1, -0.3),
    (0.0, -0.6, 0.8),
    (-1.0, 3.0, 0.0),
]


def sensitivity(A, B, C, phi0, v0, t):
    """What half a unit of the angle, of the speed and of the time changes: angle, speed."""
    step = mpf(10) ** -8
    speed = mp.sqrt(max(abs(A), abs(B), abs(C), mpf(v0) ** 2))
    sides = []
    for sign in (1, -1):
        # All at once: neighbors on a line through the state that no motion is parallel to.
        moved = (phi0 + sign * step * max(1, abs(phi0)), v0 + sign * step * speed * mpf("0.7"))
        sides.append(taylor(A, B, C, *moved, t, dps=16))
    moves = [abs(x - y) / (2 * step) for x, y in zip(*sides, strict=True)]
    return UNIT * (moves[0] + abs(t) * speed), UNIT * (moves[1] + abs(t) * speed**2)


def check(A, B, C, phi0, v0, t, factor=4, roundings=256, want=None):
    """Compare one motion with the oracle, or with what it said before."""
    want = want or taylor(A, B, C, phi0, v0, t, dps=22)
    got = flow(A, B, C, phi0, v0, t)
    moved = sensitivity(A, B, C, phi0, v0, t)
    speed = mp.sqrt(max(abs(A), abs(B), abs(C), mpf(v0) ** 2))
    sizes = (max(1, abs(want[0])), speed)
    for x, exact, size, move in zip(got, want, sizes, moved, strict=True):
        off = abs(mpf(float(x)) - exact)
        within = roundings * UNIT * size + factor * move
        assert off <= within, (A, B, C, phi0, v0, t, float(off), float(within))
    return got


@pytest.mark.slow
@pytest.mark.parametrize("case", some(RECORDED, 2), ids=lambda case: case["id"])
def test_recorded_values(case):
    args = [float(case["in"][name]) for name in ("A", "B", "C", "phi0", "v0", "t")]
    recorded = [mpf(case["out"][name]) for name in ("phi", "v")]
    want = taylor(*args)
    for x, exact in zip(want, recorded, strict=True):
        assert abs(x - exact) <= mpf(10) ** -22 * max(1, abs(exact))
    for x, exact in zip(flow(*args), recorded, strict=True):
        assert abs(mpf(float(x)) - exact) <= 1e-14 * max(1, abs(exact))
    check(*args, want=want)


@pytest.mark.slow
@pytest.mark.parametrize("family", some([*FAMILIES][1:], 2))
def test_random_motions(family):
    rng = np.random.default_rng(65)
    for A, B, C in np.array(FAMILIES[family](rng, 2)).T.tolist():
        size = max(abs(A), abs(B), abs(C)) ** 0.5
        for speed in (0.0, 10 ** rng.uniform(-9, -1), rng.uniform(0.3, 3)):
            v0 = float(rng.choice([-1, 1]) * speed * size)
            t = float(rng.uniform(-6, 6) / max(size, abs(v0)))
            check(A, B, C, float(rng.uniform(-4, 4)), v0, t)


@pytest.mark.parametrize("family", ["generic", "inside", "zeros", "near_folds", "exact_cusps"])
def test_random_motions_from_equilibria(family):
    """Small oscillations, and slow departures from saddles."""
    rng = np.random.default_rng(66)
    for A, B, C in np.array(FAMILIES[family](rng, 2)).T.tolist():
        size = max(abs(A), abs(B), abs(C)) ** 0.5
        for point in oracle.equilibria(A, B, C):
            v0 = float(rng.choice([-1, 1]) * 10 ** rng.uniform(-12, -2) * size)
            # A saddle is where it is to a rounding, which grows as the motion leaves it.
            check(A, B, C, float(point.phi), v0, float(rng.uniform(-6, 6) / size), 4, 1024)


@pytest.mark.slow
@pytest.mark.parametrize("system", [SYSTEMS[0], SYSTEMS[2], SYSTEMS[6]])
def test_another_integrator(system):
    """SciPy's DOP853, whose error is some 1e-12 here."""
    A, B, C = system
    t = np.linspace(0, 30, 61)
    for phi0, v0 in ((0.4, 0.1), (-2.0, 0.9), (1.0, 2.5), (0.5, -3.0)):
        done = solve_ivp(
            lambda _, y: (y[1], (A * np.cos(y[0]) - B) * np.sin(y[0]) + C * np.cos(y[0])),
            (0, 30),
            (phi0, v0),
            "DOP853",
            t,
            rtol=1e-13,
            atol=1e-14,
        )
        got = flow(A, B, C, phi0, v0, t)
        assert np.allclose(got.motion_phi, done.y[0], rtol=0, atol=1e-9)
        assert np.allclose(got.motion_dphi, done.y[1], rtol=0, atol=1e-9)


# --- long times ------------------------------------------------------------------------------


def carlson(A, B, C, phi0, v0):
    """Period of a libration from the cubic resolvent and R_F."""
    A, B, C, v0 = (mpf(x) for x in (A, B, C, v0))
    s = (A / 4 - v0**2 / 2 - oracle.potential(A, B, C, phi0)) / 3
    g2 = A**2 / 16 - (B**2 + C**2) / 4 + 3 * s**2
    g3 = s * (A**2 + 2 * (B**2 + C**2)) / 16 - A * (B**2 - C**2) / 32 - s**3
    roots = mp.polyroots([4, 0, -g2, -g3], maxsteps=400, extraprec=4 * mp.prec)
    roots.sort(key=lambda x: (abs(mp.im(x)) > mpf(10) ** -45, -mp.re(x)))
    first = mp.re(roots[0])
    return 2 * mp.re(mp.elliprf(0, first - roots[1], first - roots[2]))


def after_periods(system, phi0, v0, n, parts):
    """Doubles near the n-th period and parts of one, with the exact states there."""
    with mp.workdps(70):
        period = carlson(*system, phi0, v0)
        times = [float((n + mpf(part)) * period) for part in parts]
        rest = [mpf(t) - n * period for t in times]
    return times, flow_at(*system, phi0, v0, rest, dps=50)


@pytest.mark.slow
@pytest.mark.parametrize("system", some(SYSTEMS, 3))
@pytest.mark.parametrize("n", [1000, -1000])
def test_a_thousand_periods(system, n):
    """In the middle of a well: 2e-14, all phases of the period."""
    found = oracle.labelled(*system)
    saddle = found.get("lower_saddle", found["upper_saddle"])
    center = found["lower_center"]
    v0 = float(mp.sqrt(saddle.energy - center.energy))  # half of the energy
    phi0 = float(center.phi)
    parts = (0.0, 0.125, 0.25, 0.37, 0.5, 0.61, 0.75, 0.9)
    times, want = after_periods(system, phi0, v0, n, parts)
    got = flow(*system, phi0, v0, times)
    for i, (phi, v) in enumerate(want):
        assert abs(mpf(float(got.motion_phi[i])) - phi) <= 2e-14, parts[i]
        assert abs(mpf(float(got.motion_dphi[i])) - v) <= 2e-14, parts[i]


@pytest.mark.slow
@pytest.mark.parametrize("system", some([*SYSTEMS[:2], SYSTEMS[3], *SYSTEMS[6:]], 3))
def test_a_thousand_periods_next_to_the_separatrix(system):
    """At 1e-6 of the energy from it: 1e-12 away from the passages, half-way between them.

    The period answers a rounding of the energy a million times as much.
    """
    found = oracle.labelled(*system)
    saddle = found.get("lower_saddle", found["upper_saddle"])
    center = found["lower_center"]
    v0 = float(mp.sqrt(2 * (saddle.energy - center.energy) * (1 - mpf("1e-6"))))
    phi0 = float(center.phi)
    parts = (0.13, 0.2, 0.3, 0.36, 0.64, 0.7, 0.8, 0.87)
    times, want = after_periods(system, phi0, v0, 1000, parts)
    got = flow(*system, phi0, v0, times)
    for i, (phi, v) in enumerate(want):
        assert abs(mpf(float(got.motion_phi[i])) - phi) <= 1e-12, parts[i]
        assert abs(mpf(float(got.motion_dphi[i])) - v) <= 1e-12, parts[i]


def test_a_million_periods():
    """Energy, and the way back to the state, are kept after 1e6 periods."""
    rng = np.random.default_rng(67)
    A, B, C = rng.normal(size=(3, 100))
    phi0, v0 = rng.uniform(-3, 3, 100), rng.normal(size=100) * 1.5
    orbit_ = orbits(A, B, C, phi0, v0)
    t = 1e6 * orbit_.period * rng.uniform(0.9, 1.1, 100)
    there = flow(A, B, C, phi0, v0, t)
    c, s = np.cos(there.motion_phi), np.sin(there.motion_phi)
    energy = there.motion_dphi**2 / 2 - B * c + A / 2 * c * c - C * s
    # The angle of a rotation has a million turns before the point.
    digits = 1e-14 + 4 * UNIT * np.abs(there.motion_phi)
    force = np.abs((B - A * c) * s - C * c)
    size = np.abs(A) + np.abs(B) + np.abs(C) + v0**2
    assert np.all(np.abs(energy - orbit_.orbit_energy) <= 1e-14 * size + force * digits)
    back = flow(A, B, C, *there, -t)
    # One rounding of the state on the way is a million periods of another length; of a rotation,
    # one of a million turns.
    well = (np.abs(there.motion_phi) < 10) & (orbit_.period < 2 * np.median(orbit_.period))
    assert well.sum() > 40
    assert np.allclose(back.motion_phi[well], phi0[well], rtol=0, atol=1e-7)


# --- separatrices ----------------------------------------------------------------------------


def test_pendulum_on_its_separatrix():
    """The closed form is phi = 4 atan(e^t) - pi, phi' = 2/cosh(t)."""
    t = np.array([-700.0, -40.0, -12.0, -3.0, -0.5, 0.0, 1e-8, 0.7, 2.0, 9.0, 36.0, 500.0, 1e5])
    with mp.workdps(40):
        phi = [float(4 * mp.atan(mp.exp(mpf(x))) - mp.pi) for x in t]
        v = [float(2 / mp.cosh(mpf(x))) for x in t]
    for sense in (1, -1):
        got = flow(0.0, 1.0, 0.0, 0.0, 2.0 * sense, t)
        assert np.allclose(got.motion_phi, sense * np.array(phi), rtol=4e-16, atol=4e-16)
        shown = np.abs(t) < 300
        assert np.allclose(got.motion_dphi[shown], (sense * np.array(v))[shown], rtol=1e-14, atol=0)
    # Whole turns of the state are kept, and the unit of time.
    got = flow(0.0, 4.0, 0.0, 6 * np.pi, 4.0, t / 2)
    assert np.allclose(got.motion_phi, 6 * np.pi + np.array(phi), rtol=2e-15)


@pytest.mark.slow
@pytest.mark.parametrize("system", some(SYSTEMS, 3))
@pytest.mark.parametrize("name", ["lower_saddle", "upper_saddle"])
def test_states_on_separatrices(system, name):
    """Before it comes so close to the saddle that a rounding decides what follows."""
    found = oracle.labelled(*system)
    if name not in found:
        return
    saddle = found[name]
    k = float(mp.sqrt(-saddle.curvature))
    for offset in (-0.4, 0.9):
        phi0 = float(saddle.phi) + offset
        kinetic = saddle.energy - oracle.potential(*system, phi0)
        if kinetic <= 0:
            continue
        for sense in (1,) if offset > 0 else (-1,):
            v0 = float(sense * mp.sqrt(2 * kinetic))
            assert orbits(*system, phi0, v0).orbit_kind == OrbitKind.ASYMPTOTIC
            for t in (-4 / k, 0.3 / k, 5 / k):
                check(*system, phi0, v0, t, factor=16)
            # It ends at a saddle, and stays there.
            ends = flow(*system, phi0, v0, [-1e3 / k, 1e3 / k, 1e9])
            for end in ends.motion_phi:
                level = oracle.potential(*system, float(end))
                assert abs(level - saddle.energy) < 1e-14
            assert np.allclose(ends.motion_dphi, 0, atol=1e-100)


@pytest.mark.slow
@pytest.mark.parametrize(("A", "B", "C"), [(-4.0, 4.0, 0.0), (4.0, 0.0, 4.0), (-1.0, -1.0, 0.0)])
def test_algebraic_approach_to_a_cusp(A, B, C):
    """Where the saddle has no exponent; for A = -1, B = 1 it is phi' = 1 + cos(phi)."""
    found = oracle.labelled(A, B, C)
    saddle = found["upper_saddle"]
    for offset in (1.0, 3.0, -2.0):
        phi0 = float(saddle.phi) + offset
        v0 = float(mp.sqrt(2 * (saddle.energy - oracle.potential(A, B, C, phi0))))
        # One rounding makes a rotation or a libration of it, after a long time only.
        for t in (-3.0, 0.2, 2.0):
            check(A, B, C, phi0, v0, t, factor=16)
    got = flow(-1.0, 1.0, 0.0, 0.0, 2.0, [-3.0, 0.5, 40.0, 1e8])
    t = np.array([-3.0, 0.5, 40.0, 1e8])
    assert np.allclose(got.motion_phi, 2 * np.arctan(t), rtol=2e-15)
    assert np.allclose(got.motion_dphi, 2 / (1 + t * t), rtol=1e-13)


# --- special motions -------------------------------------------------------------------------


def test_free_motion():
    t = np.array([0.0, 1.0, -2.5, 1e10])
    got = flow(0.0, 0.0, 0.0, 0.3, -2.0, t)
    assert np.allclose(got.motion_phi, 0.3 - 2 * t, rtol=1e-16)
    assert np.all(got.motion_dphi == -2)
    rest = flow(0.0, 0.0, 0.0, 0.3, 0.0, t)
    assert np.all(rest.motion_phi == 0.3)
    assert np.all(rest.motion_dphi == 0)


def test_equilibria_stay():
    for A, B, C in ((0.4, 1.5, 0.0), (0.4, -1.5, 0.0), (2.0, 0.3, 0.0)):
        got = flow(A, B, C, 0.0, 0.0, [1.0, -30.0, 1e9])
        assert np.all(got.motion_phi == 0)
        assert np.all(got.motion_dphi == 0)


@pytest.mark.parametrize("size", [1e-8, 1e-12, 1e-100, 1e-160])
def test_harmonic_motion(size):
    """Small oscillations at sqrt(B - A); below 1e-15 they are round the center itself."""
    t = np.array([0.3, 2.0, -17.0, 1e3])
    got = flow(0.5, 2.75, 0.0, size, -2 * size, t)
    with mp.workdps(40):
        phi = [float(size * (mp.cos(1.5 * mpf(x)) - mpf(4) / 3 * mp.sin(1.5 * mpf(x)))) for x in t]
    phi = np.array(phi)
    atol = 1e-13 + 10 * size * size + (1e-15 / size if size > 1e-15 else 0)
    assert np.allclose(got.motion_phi / size, phi / size, rtol=0, atol=atol)


def test_start():
    """At t = 0 it gives the state, within rounding; so do whole periods."""
    rng = np.random.default_rng(68)
    A, B, C = rng.normal(size=(3, 200))
    phi0, v0 = rng.uniform(-9, 9, 200), rng.normal(size=200) * 2
    got = flow(A, B, C, phi0, v0, 0.0)
    assert np.allclose(got.motion_phi, phi0, rtol=0, atol=2e-14)
    assert np.allclose(got.motion_dphi, v0, rtol=0, atol=2e-14)
    found = orbits(A, B, C, phi0, v0)
    once = flow(A, B, C, phi0, v0, found.period)
    turns = np.where(found.orbit_kind == OrbitKind.ROTATION, 2 * np.pi * np.sign(v0), 0)
    well = found.period < 5 * np.median(found.period)
    assert np.allclose((once.motion_phi - turns)[well], phi0[well], rtol=0, atol=5e-13)


@pytest.mark.slow
def test_turning_points_are_reached():
    """Half a period after one end, the other end; against the oracle's own ends."""
    for system in SYSTEMS:
        center = oracle.labelled(*system)["lower_center"]
        want = orbit(*system, float(center.phi), 0.3)
        if want.lo is None:
            continue
        start = float(want.hi)
        exact = orbit(*system, start, 0.0)
        got = flow(*system, start, 0.0, float(exact.period / 2))
        assert got.motion_phi == pytest.approx(float(exact.lo), abs=4e-15)
        assert got.motion_dphi == pytest.approx(0.0, abs=4e-15)


@pytest.mark.parametrize("exponent", [-300, -20, 1, 77, 300])
def test_scaling_by_powers_of_four_is_exact(exponent):
    rng = np.random.default_rng(69)
    A, B, C, t = rng.normal(size=(4, 50))
    phi0, v0 = rng.uniform(-3, 3, 50), rng.normal(size=50) * (rng.random(50) < 0.7)
    c = 2.0**exponent
    got = flow(A, B, C, phi0, v0, t)
    other = flow(c * c * A, c * c * B, c * c * C, phi0, c * v0, t / c)
    assert np.array_equal(got.motion_phi, other.motion_phi)
    assert np.array_equal(got.motion_dphi * c, other.motion_dphi)


# --- the interface ---------------------------------------------------------------------------


def test_shapes():
    """A time of its own axis, in any place, gives the same as one cell at a time."""
    A = np.array([[1.3], [-0.7]])
    phi0 = np.array([0.3, 1.0, 2.0])
    t = np.linspace(-2, 5, 4)
    last = flow(A[..., None], 0.4, 0.2, phi0[:, None], 0.5, t)
    assert last.motion_phi.shape == last.motion_dphi.shape == (2, 3, 4)
    first = flow(A, 0.4, 0.2, phi0, 0.5, t[:, None, None])
    assert first.motion_phi.shape == (4, 2, 3)
    assert np.array_equal(first.motion_phi, np.moveaxis(last.motion_phi, -1, 0))
    middle = flow(A[..., None], 0.4, 0.2, phi0, 0.5, t[:, None])
    assert np.array_equal(middle.motion_dphi, np.moveaxis(last.motion_dphi, -1, 1))
    for i, j, n in ((0, 0, 0), (1, 2, 3), (0, 1, 2)):
        alone = flow(A[i, 0], 0.4, 0.2, phi0[j], 0.5, t[n])
        assert alone.motion_phi == last.motion_phi[i, j, n]
        assert alone.motion_dphi == last.motion_dphi[i, j, n]
    assert flow(1.0, 0.0, 0.0, 0.1, 0.0, []).motion_phi.shape == (0,)
    assert flow(1.0, 0.0, 0.0, 0.1, 0.0, 1.0).motion_phi.shape == ()


def test_invalid_cells():
    for bad in (np.nan, np.inf, -np.inf):
        for place in range(6):
            args = [1.3, 0.4, 0.2, 0.3, 0.5, 2.0]
            args[place] = bad
            got = flow(*args)
            assert np.isnan(got.motion_phi), (bad, place)
            assert np.isnan(got.motion_dphi), (bad, place)


@pytest.mark.parametrize("threads", [0, -1, 1.5, "2"])
def test_bad_threads(threads):
    with pytest.raises(ParameterError, match="threads"):
        flow(1.0, 1.0, 1.0, 0.0, 0.0, 0.0, threads=threads)


@pytest.mark.slow
def test_at_time_zero_every_state_is_where_it_was():
    """States next to equilibria at 0, at the top and a quarter turn away, on either side."""
    rng = np.random.default_rng(1)
    n = 20_000

    def coefficient():
        return rng.normal(size=n) * rng.choice([0.0, 1.0, 1e-9], n)

    A, B, C = coefficient(), coefficient(), coefficient()
    phi = rng.choice([0.0, np.pi, -np.pi, 0.5 * np.pi], n)
    phi += rng.normal(size=n) * 10.0 ** rng.integers(-8, 1, n)
    dphi = rng.normal(size=n) * 10.0 ** rng.integers(-6, 1, n)
    motion = flow(A, B, C, phi, dphi, np.zeros(n))
    assert np.max(np.abs(motion.motion_phi - phi)) < 2e-14
    assert np.max(np.abs(motion.motion_dphi - dphi)) < 2e-14
