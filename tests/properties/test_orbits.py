"""Properties of orbits and motions that hold for every system and every state."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st
from properties.strategies import FAMILIES, number_of_systems, systems

from phasekit.errors import OrbitFamily, OrbitKind
from phasekit.phase.exact.action_angle import action_angle, state_of
from phasekit.phase.exact.flow import flow
from phasekit.phase.exact.orbits import orbits
from phasekit.phase.exact.phase_space import equilibria

UNIT = 2.0**-53
EXAMPLES = settings(max_examples=100)

finite = st.floats(allow_nan=False, allow_infinity=False)
special = st.sampled_from(
    [0.0, -0.0, 5e-324, -5e-324, 2.0**-1022, 1e-160, -1e160, 1.7976931348623157e308, 1.0, -1.0, 8.0]
)
coefficient = finite | st.floats(-1e3, 1e3) | special
adversarial = st.builds(
    lambda name, seed: tuple(float(x[0]) for x in FAMILIES[name](np.random.default_rng(seed), 1)),
    st.sampled_from(sorted(FAMILIES)),
    st.integers(0, 10**6),
)
whole_circle = st.floats(-math.pi, math.pi)
# Parts of the speed that the coefficients set.
parts = st.sampled_from([0.0, 1e-12, 1e-6, 0.1]) | st.floats(-4, 4) | st.floats(-1e3, 1e3)
spans = st.floats(-3, 3)


def size_of(A, B, C):
    """Speed that the coefficients set, without overflow."""
    return math.sqrt(max(abs(A), abs(B), abs(C)))


def energy_of(A, B, C, phi, v):
    c, s = np.cos(phi), np.sin(phi)
    return v * v / 2 - B * c + A / 2 * c * c - C * s


def check_orbit(A, B, C, phi0, v0):
    """Nothing is NaN but what has to be, and all is consistent."""
    got = orbits(A, B, C, phi0, v0)
    assert got.orbit_kind != OrbitKind.NOT_COMPUTED
    assert not np.isnan(got.orbit_energy)
    assert got.period > 0
    assert got.frequency >= 0
    if np.isfinite(got.period) and 1e-300 < got.period < 1e300:
        assert got.frequency == pytest.approx(2 * np.pi / got.period, rel=4 * UNIT)
    asymptotic = got.orbit_kind == OrbitKind.ASYMPTOTIC
    assert np.isnan(got.action) == asymptotic
    if not asymptotic:
        assert got.action >= 0
        assert np.isfinite(got.action)
    if got.orbit_kind in (OrbitKind.LIBRATION, OrbitKind.ROTATION):
        assert got.period < np.inf or got.frequency < 1e-307
    if got.orbit_kind == OrbitKind.EQUILIBRIUM:
        assert got.action == 0
    rotation = got.orbit_kind == OrbitKind.ROTATION
    assert np.isnan(got.phi_min) == np.isnan(got.phi_max) == rotation
    if not rotation:
        loss = 1e-14 + 4 * UNIT * abs(phi0)
        assert got.phi_min - loss <= phi0 <= got.phi_max + loss
        assert got.phi_max - got.phi_min <= 2 * np.pi + 2 * loss


@EXAMPLES
@given(coefficient, coefficient, coefficient, finite | whole_circle | special, finite | parts)
@example(0.0, 0.0, 0.0, 0.0, 5e-324)
@example(5e-324, 0.0, 0.0, 1.0, 0.0)
@example(0.0, 5e-324, 5e-324, 1.0, 1e-162)
@example(1.0, 0.0, 5e-324, 0.5, 0.0)
@example(1.0, 1.0, 5e-324, 0.0, 0.0)
@example(1.7976931348623157e308, 1.7976931348623157e308, -1.7976931348623157e308, 1.0, 0.0)
@example(1.0, 0.5, 0.5, 1.7976931348623157e308, 1.0)
@example(1.0, 0.5, 0.5, 1.0, 1.7976931348623157e308)
def test_any_doubles(A, B, C, phi0, v0):
    with np.errstate(over="ignore"):  # h itself may be beyond the range
        check_orbit(A, B, C, phi0, v0)
        for t in (0.0, 1.0, -1e-200, 1e200, 1.7976931348623157e308):
            moved = flow(A, B, C, phi0, v0, t)
            assert not np.isnan(moved.motion_phi)
            assert not np.isnan(moved.motion_dphi)


@EXAMPLES
@given(adversarial, whole_circle, parts, spans)
def test_adversarial_systems(system, phi0, part, span):
    size = size_of(*system)
    v0 = part * size
    check_orbit(*system, phi0, v0)
    moved = flow(*system, phi0, v0, span / size)
    h, scale = energy_of(*system, phi0, v0), size * size + v0 * v0
    assert abs(energy_of(*system, *moved) - h) <= 4e-14 * scale


@EXAMPLES
@given(adversarial, st.integers(0, 3), st.sampled_from([0, 1, -1]), parts)
def test_states_at_equilibria(system, j, ulps, part):
    """On an equilibrium, one unit beside it, at rest and slowly moving."""
    phi0 = equilibria(*system).phi[j]
    if np.isnan(phi0):
        return
    phi0 = float(np.nextafter(phi0, phi0 + ulps))
    for speed in (0.0, 1e-160, 1e-30, 1e-15, 1e-9, part):
        v0 = speed * size_of(*system)
        check_orbit(*system, phi0, v0)
        moved = flow(*system, phi0, v0, part / size_of(*system))
        scale = size_of(*system) ** 2 + v0 * v0
        h = energy_of(*system, phi0, v0)
        digits = 1e-13 * (1 + abs(moved.motion_phi))
        assert abs(energy_of(*system, *moved) - h) <= digits * scale


@EXAMPLES
@given(adversarial, whole_circle, st.floats(-4, 4), spans, spans)
def test_motions_are_a_group(system, phi0, part, s, t):
    """Going s and then t is going s + t; a rounding on the way grows by exp(k t) at most."""
    size = size_of(*system)
    v0 = part * size
    first = flow(*system, phi0, v0, s / size)
    second = flow(*system, *first, t / size)
    once = flow(*system, phi0, v0, (s + t) / size)
    grown = 1e-14 * np.exp(2 * (abs(s) + abs(t)))
    assert second.motion_phi == pytest.approx(float(once.motion_phi), abs=grown)
    assert second.motion_dphi / size == pytest.approx(float(once.motion_dphi / size), abs=grown)


@EXAMPLES
@given(adversarial, whole_circle, st.floats(-4, 4), spans)
def test_motions_are_reversible(system, phi0, part, t):
    """Backwards in time is the mirror image; and the way back ends at the start."""
    size = size_of(*system)
    v0, time = part * size, t / size
    there, mirror = flow(*system, phi0, v0, time), flow(*system, phi0, -v0, -time)
    assert mirror.motion_phi == pytest.approx(float(there.motion_phi), abs=1e-14)
    assert mirror.motion_dphi / size == pytest.approx(-float(there.motion_dphi) / size, abs=4e-14)
    back = flow(*system, *there, -time)
    grown = 1e-14 * np.exp(2 * abs(t))
    assert back.motion_phi == pytest.approx(phi0, abs=grown)
    assert back.motion_dphi / size == pytest.approx(part, abs=grown)


@EXAMPLES
@given(adversarial, whole_circle, st.floats(-4, 4), spans)
def test_symmetries(system, phi0, part, t):
    """The mirror, the half turn and the quarter turn that swaps B and C."""
    A, B, C = system
    size = size_of(*system)
    v0, time = part * size, t / size
    want, orbit = flow(*system, phi0, v0, time), orbits(*system, phi0, v0)
    grown = 1e-14 * np.exp(2 * abs(t))
    half, quarter = np.pi, np.pi / 2
    for image, shift, sense in (
        ((A, B, -C), 0.0, -1),
        ((A, -B, -C), half, 1),
        ((A, -B, C), half, -1),
        ((-A, C, B), quarter, -1),
    ):
        got = flow(*image, shift + sense * phi0, sense * v0, time)
        assert sense * (got.motion_phi - shift) == pytest.approx(float(want.motion_phi), abs=grown)
        assert sense * got.motion_dphi / size == pytest.approx(
            float(want.motion_dphi / size), abs=grown
        )
        if shift == 0.0:
            assert orbits(*image, -phi0, -v0).orbit_kind == orbit.orbit_kind


# --- action and angle ------------------------------------------------------------------------


@EXAMPLES
@given(adversarial, whole_circle, st.floats(-4, 4), spans)
def test_action_and_angle_are_coordinates(system, phi0, part, t):
    """They name the state, the action stays and the angle grows in proportion to time."""
    size = size_of(*system)
    v0, time = part * size, t / size
    there = action_angle(*system, phi0, v0)
    orbit = orbits(*system, phi0, v0)
    plain = orbit.orbit_kind in (OrbitKind.LIBRATION, OrbitKind.ROTATION)
    assert (there.orbit_family > OrbitFamily.NONE) == plain
    if not plain:
        assert np.isnan(there.angle)
        return
    assert there.action == pytest.approx(float(orbit.action), rel=4e-14)
    assert there.frequency == pytest.approx(float(orbit.frequency), rel=4e-14)
    assert 0 <= there.angle < 2 * np.pi
    # A rounding of action and angle, on an orbit that shears by the twist.
    moved = action_angle(*system, *flow(*system, phi0, v0, time))
    assert moved.orbit_family == there.orbit_family
    slow = orbit.frequency / size  # next to a separatrix and to nothing at all
    if slow < 0.05 or orbit.action < 1e-4 * size:
        return
    assert moved.action == pytest.approx(float(there.action), rel=1e-11)
    turned = there.angle + there.frequency * time - moved.angle
    assert abs(math.remainder(turned, 2 * math.pi)) <= 1e-8
    back = state_of(*system, there.action, there.angle, there.orbit_family)
    # Next to an equilibrium the energy says less of the angle.
    scale = size * size + v0 * v0
    assert abs(energy_of(*system, *back) - energy_of(*system, phi0, v0)) <= 1e-11 * scale
    again = action_angle(*system, *back)
    assert again.action == pytest.approx(float(there.action), rel=1e-11)
    assert abs(math.remainder(again.angle - there.angle, 2 * math.pi)) <= 1e-7


# --- many at once ----------------------------------------------------------------------------


@pytest.fixture(scope="module")
def many():
    """States of many systems: random ones, and slow ones at every equilibrium."""
    rng = np.random.default_rng(70)
    n = number_of_systems()
    A, B, C = systems(n)
    size = np.sqrt(np.max(np.abs([A, B, C]), axis=0))
    phi = equilibria(A, B, C).phi[np.arange(n), rng.integers(0, 4, n)]
    phi0 = np.where(np.isnan(phi) | (rng.random(n) < 0.5), rng.uniform(-np.pi, np.pi, n), phi)
    v0 = size * rng.choice([-1, 1], n) * 10.0 ** rng.uniform(-16, 2, n)
    v0[rng.random(n) < 0.2] = 0.0
    return A, B, C, phi0, v0, size


def shown(many, bad):
    """Show the first cells that fail, exactly, and how many do."""
    where = np.flatnonzero(bad)
    first = [tuple(float(x[i]) for x in many[:5]) for i in where[:5]]
    return f"{where.size} orbits fail, first (A, B, C, phi0, v0): {first}"


def test_many_orbits(many):
    A, B, C, phi0, v0, size = many
    got = orbits(A, B, C, phi0, v0)
    kinds = got.orbit_kind
    moving = (kinds == OrbitKind.LIBRATION) | (kinds == OrbitKind.ROTATION)
    for kind in OrbitKind:
        assert np.any(kinds == kind) == (OrbitKind.EQUILIBRIUM <= kind <= OrbitKind.ASYMPTOTIC)
    for bad in (
        ~(got.period > 0),
        moving & ~(np.isfinite(got.period) & (got.action >= 0)),
        np.isnan(got.action) != (kinds == OrbitKind.ASYMPTOTIC),
        np.isnan(got.phi_min) != (kinds == OrbitKind.ROTATION),
        got.phi_min > phi0 + 1e-14,
        got.phi_max < phi0 - 1e-14,
        got.phi_max - got.phi_min > 2 * np.pi + 4e-14,
        np.abs(got.orbit_energy - energy_of(A, B, C, phi0, v0)) > 1e-15 * (size**2 + v0**2),
    ):
        assert not bad.any(), shown(many, bad)


def test_turning_points_are_at_the_energy(many):
    """Both ends are where V = h."""
    A, B, C, phi0, v0, size = many
    got = orbits(A, B, C, phi0, v0)
    for end in (got.phi_min, got.phi_max):
        off = np.abs(energy_of(A, B, C, end, 0.0) - got.orbit_energy)
        # A state counts as on a separatrix within its rounding, so the ends are the saddle's.
        moving = got.orbit_kind == OrbitKind.LIBRATION
        bad = moving & ~(off <= 1e-14 * size**2)
        assert not bad.any(), shown(many, bad)


def test_period_of_the_far_end(many):
    """The orbit through a turning point is the same orbit."""
    A, B, C, phi0, v0, size = many
    got = orbits(A, B, C, phi0, v0)
    # What a rounding changes there is negligible well inside only.
    width = got.phi_max - got.phi_min
    well = (got.orbit_kind == OrbitKind.LIBRATION) & (width > 0.1) & (got.period * size < 20)
    cells = np.flatnonzero(well)
    period, action = got.period[cells], got.action[cells]
    for end in (got.phi_min, got.phi_max):
        other = orbits(A[cells], B[cells], C[cells], end[cells], 0.0)
        bad = np.zeros(well.shape, dtype=bool)
        bad[cells] = ~(np.abs(other.period - period) < 1e-11 * period)
        bad[cells] |= ~(np.abs(other.action - action) < 1e-11 * action)
        assert not bad.any(), shown(many, bad)


def test_many_motions(many):
    """Energy is kept for short and long times; nothing is NaN."""
    A, B, C, phi0, v0, size = many
    h = energy_of(A, B, C, phi0, v0)
    # Between two saddles whose energies nearly agree two scales compete.
    levels = equilibria(A, B, C).energy
    apart = np.abs(levels[:, 3] - levels[:, 1])
    within = np.where((apart > 0) & (apart < 1e-14 * size**2), 1e-11, 4e-14)
    for span in (0.0, 1.0, -30.0, 1e4):
        moved = flow(A, B, C, phi0, v0, span / size)
        turned = 4 * UNIT * np.abs(moved.motion_phi)
        off = np.abs(energy_of(A, B, C, *moved) - h)
        bad = ~(off <= (within + turned) * (size**2 + v0**2))
        assert not bad.any(), f"{span}: {shown(many, bad)}"
