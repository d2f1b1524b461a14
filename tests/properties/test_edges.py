"""Orbits where equilibria merge, almost merge, or are level: accurate for the very doubles.

The bounds are roundings of the result, and what one rounding of the state changes, where that is
more. A larger sample: set PHASEKIT_EDGES to the number of states of each kind.
"""

from __future__ import annotations

import os

import numpy as np
import pytest
from mpmath import mp, mpf
from properties import edge_oracle
from witnesses.orbit_oracle import flow as taylor

from phasekit.errors import OrbitKind
from phasekit.phase.exact.action_angle import action_angle, state_of
from phasekit.phase.exact.flow import flow
from phasekit.phase.exact.orbits import energy_rises, orbits
from phasekit.phase.exact.phase_space import equilibria
from phasekit.phase.families import families

UNIT = 2.0**-53
STATES = int(os.environ.get("PHASEKIT_EDGES", "4"))
QUARTERS = {0: 0.0, 1: np.pi / 2, 2: np.pi, 3: -np.pi / 2}
#: A and the coefficient along the axis of the cusp, for each quarter turn: a center, then a saddle.
CUSPS = {
    "center": {0: (1, 1, 0), 2: (1, -1, 0), 1: (-1, 0, 1), 3: (-1, 0, -1)},
    "saddle": {0: (-1, -1, 0), 2: (-1, 1, 0), 1: (1, 0, -1), 3: (1, 0, 1)},
}
UP, DOWN = 1 + 2 * UNIT, 1 - UNIT


def relative(got, want) -> float:
    return float(abs(mpf(float(got)) - want) / abs(want))


def digits(distance: float) -> int:
    """How many digits an energy takes next to a cusp at this distance."""
    return 60 + int(8 * -np.log10(distance))


@pytest.mark.parametrize("quarter", QUARTERS)
@pytest.mark.parametrize("kind", CUSPS)
@pytest.mark.parametrize("factor", [1.0, UP, DOWN])
def test_next_to_cusps_and_almost_cusps(kind, quarter, factor):
    """From rest at any distance that doubles carry, on both sides, of the merged equilibria."""
    A, B, C = CUSPS[kind][quarter]
    system = (A, B * factor, C * factor)
    rng = np.random.default_rng(5)
    least = -14 if quarter or kind == "saddle" or factor == DOWN else -70
    tried = 0
    for _ in range(STATES):
        distance = 10.0 ** rng.uniform(least, -1) * rng.choice([-1, 1])
        state = (*system, QUARTERS[quarter] + distance, 0.0)
        got = orbits(*state)
        assert got.orbit_kind == OrbitKind.LIBRATION, state
        want = edge_oracle.period(state, digits(abs(distance)))
        assert relative(got.period, want) <= 2e-14, (state, float(got.period), float(want))
        ends = [float(end) for end in (got.phi_min, got.phi_max)]
        assert min(abs(end - state[3]) for end in ends) <= 8 * UNIT * max(map(abs, ends)), state
        end = max(ends, key=lambda end: abs(end - state[3]))
        if abs(end) < 3:  # a turn away from zero the other digits are lost
            exact = edge_oracle.turning_point(state, end, digits(abs(distance)))
            assert abs(mpf(end) - exact) <= 8e-15 * abs(end), (state, end)
        tried += 1
    assert tried == STATES


@pytest.mark.parametrize("system", [(2.0, 1.0, 0.0), (-2.0, -3.0, 0.0), (0.3, -1.0, 0.0)])
def test_next_to_a_saddle_at_zero(system):
    """A double next to zero keeps its digits, and with them the gap to the separatrix."""
    for distance in (1e-3, -1e-6, 1e-9, -1e-12, 1e-14):
        state = (*system, distance, 0.0)
        got = orbits(*state)
        assert got.orbit_kind == OrbitKind.LIBRATION
        want = edge_oracle.period(state, 60 + int(-5 * np.log10(abs(distance))))
        assert relative(got.period, want) <= 4e-15, (state, float(got.period), float(want))


@pytest.mark.parametrize("system", [(1.3, 0.2, 0.15), (-1.3, 0.2, 0.15), (1.0, 0.9999, 1e-9)])
def test_next_to_any_equilibrium(system):
    """The state is the double that was given, and the equilibrium is not."""
    points = equilibria(*system)
    tried = 0
    for phi in points.phi[~np.isnan(points.phi)]:
        for ulps in (10**3, -(10**6), 10**9):
            state = (*system, float(phi + ulps * np.spacing(phi)), 0.0)
            got = orbits(*state)
            if got.orbit_kind == OrbitKind.LIBRATION:
                want = edge_oracle.period(state, 120)
                assert relative(got.period, want) <= 2e-14, (state, float(got.period))
                tried += 1
    assert tried >= 9


@pytest.mark.parametrize("quarter", QUARTERS)
def test_motion_next_to_a_cusp(quarter):
    """A quarter of a period from rest is the cusp; states and speeds on the way have the digits."""
    system = CUSPS["center"][quarter]
    for distance in (1e-3, -1e-6, 1e-9):
        state = (*system, QUARTERS[quarter] + distance, 0.0)
        period = edge_oracle.period(state, 120)
        times = [float(period) * part for part in (0.05, 0.2, 0.45, 0.8)]
        for t in times:
            got = flow(*state, t)
            phi, v = taylor(*state, t, dps=30)
            scale = abs(distance)
            assert abs(mpf(float(got.motion_phi)) - phi) <= 1e-14 * scale + 4e-16 * abs(phi)
            assert abs(mpf(float(got.motion_dphi)) - v) <= 2e-14 * scale**2


def test_action_and_angle_next_to_a_cusp():
    """J grows with the cube of the amplitude, J = 0.2781... a^3, and leads back."""
    amplitudes = np.array([1e-3, 1e-6, 1e-12, 1e-20, 1e-40])
    there = action_angle(1.0, 1.0, 0.0, amplitudes, 0.0)
    with mp.workdps(30):
        # x'^2 = (a^4 - x^4)/4
        want = 2 * mp.quad(lambda x: mp.sqrt(1 - x**4) / 2, [0, 1]) / mp.pi
    assert np.allclose(there.action[1:] / amplitudes[1:] ** 3, float(want), rtol=1e-11)
    back = state_of(1.0, 1.0, 0.0, there.action, there.angle, there.orbit_family)
    assert np.allclose(back.phi, amplitudes, rtol=1e-9, atol=0.0)


# --- level saddles ---------------------------------------------------------------------------


@pytest.mark.parametrize("exponent", [-8, -16, -150])
@pytest.mark.parametrize("part", [1e-3, 0.999])
def test_round_both_wells_between_almost_level_saddles(exponent, part):
    """From the lower saddle at zero, with a part of the energy to the upper one at pi."""
    A, B = 1.7, 10.0**exponent
    v = -float(np.sqrt(2.0 * part * 2.0 * B))
    state = (A, B, 0.0, 0.0, v)
    got = orbits(*state)
    assert got.orbit_kind == OrbitKind.LIBRATION
    want = edge_oracle.period(state, 60 - 4 * exponent)
    assert relative(got.period, want) <= 1e-14
    for end in (got.phi_min, got.phi_max):
        exact = edge_oracle.turning_point(state, end, 60 - 4 * exponent)
        assert abs(mpf(float(end)) - exact) <= 4e-15
    if exponent >= -17:
        for share in (0.1,):
            t = float(want) * share
            moved = flow(*state, t)
            phi, speed = taylor(*state, t, dps=30)
            later = taylor(A, B, 0.0, 0.0, v * (1 + mpf(2) ** -48), t, dps=30)
            near = 4e-15 + abs(later[0] - phi) + abs(later[1] - speed)
            assert abs(mpf(float(moved.motion_phi)) - phi) <= near, share
            assert abs(mpf(float(moved.motion_dphi)) - speed) <= near, share


@pytest.mark.parametrize("B", [0.0, 5e-324, 1e-300, 1e-100, 1e-20, 1e-10])
def test_almost_level_saddles_of_any_system(B):
    """Every reflection and turn of a system, from a state that is the same in all."""
    A, C, phi, v = 1.0, 0.25, 0.5, 0.6
    want = orbits(A, B, C, phi, v)
    half = np.pi / 2
    for other in (
        orbits(A, -B, C, np.pi - phi, -v),
        orbits(A, B, -C, -phi, -v),
        orbits(A, -B, -C, phi - np.pi, v),
        orbits(-A, C, B, half - phi, -v),
        orbits(-A, C, -B, phi - half, v),
    ):
        assert other.orbit_kind == want.orbit_kind
        assert relative(other.period, mpf(float(want.period))) <= 1e-14
        assert relative(other.action, mpf(float(want.action))) <= 1e-14


def test_twins_are_level_to_the_last_bit():
    rng = np.random.default_rng(3)
    A, part = rng.uniform(0.1, 3, 500), rng.uniform(-1, 1, 500)
    for system, twins in (
        ((A, 0.0, part * A), (1, 3)),
        ((-A, part * A, 0.0), (1, 3)),
        ((A, part * A, 0.0), (0, 2)),
        ((-A, 0.0, part * A), (0, 2)),
    ):
        points = equilibria(*system)
        assert not np.isnan(points.energy).any()
        assert np.array_equal(points.energy[:, twins[0]], points.energy[:, twins[1]])
        a, b, c = (np.broadcast_to(x, A.shape) for x in system)
        x, y = np.cos(points.phi), np.sin(points.phi)
        direct = (0.5 * a[:, None] * x - b[:, None]) * x - c[:, None] * y
        assert np.allclose(points.energy, direct, rtol=0, atol=4e-16 * 3)


def test_families_are_those_of_the_topology():
    """No outer family between level saddles; one as soon as they are not level."""
    rng = np.random.default_rng(4)
    A, part = rng.uniform(0.1, 3, (40, 1)), rng.uniform(-0.99, 0.99, (40, 1))
    levels = np.array([0.2, 0.6])
    for system in ((-A, part * A, 0.0 * A), (A, 0.0 * A, part * A)):
        period = families(None, *system, levels).period
        assert np.isnan(period[..., 2]).all()
        assert not np.isnan(period[..., [0, 1, 3]]).any()
    for tiny in (1e-12, 1e-17, 1e-30):
        for system in ((-A, part * A, tiny * A), (A, tiny * A, part * A)):
            period = families(None, *system, levels).period
            assert not np.isnan(period).any()


@pytest.mark.parametrize("system", [(1.3, 0.2, 0.15), (-1.3, 1e-9, 0.4), (2.0, 1e-30, -1.1)])
def test_rises(system):
    """Heights of wells and from saddle to saddle, each with its own digits."""
    with mp.workdps(120):
        A, B, C = map(mpf, system)
        heights = []
        for phi in equilibria(*system).phi:
            x = mpf(float(phi))
            for _ in range(6):
                cos, sin = mp.cos_sin(x)
                slope = B * sin - A * sin * cos - C * cos
                x -= slope / (B * cos - A * (cos * cos - sin * sin) + C * sin)
            heights.append(edge_oracle.potential(A, B, C, x))
        lower, low, upper, high = heights
        want = (low - lower, low - upper, high - low, high - lower)
        for mine, exact in zip(energy_rises(*system), want, strict=True):
            assert relative(mine, exact) <= 4e-15


# --- scale -----------------------------------------------------------------------------------


def test_scaling_of_time_is_exact():
    """(A, B, C) 4^k and dphi 2^k: periods, times and speeds change by 2^k, to the last bit."""
    systems = [(1, 1, 0), (1, UP, 1e-30), (1.7, 1e-17, 0.3), (1, 1e-200, 0.2), (-1, 0.3, 1e-13)]
    states = [(1e-9, 0.0), (0.4, 0.0), (-2.0, 0.3), (1.0, 1e-12), (3.0, 1e8), (0.1, 1e150)]
    for k in (-160, -3, 7, 150):
        for A, B, C in systems:
            c, c2 = 2.0**k, 4.0**k
            for phi, v in states:
                got = orbits(A, B, C, phi, v)
                other = orbits(A * c2, B * c2, C * c2, phi, v * c)
                assert got.orbit_kind == other.orbit_kind
                assert other.period == got.period / c
                assert np.array_equal(other.action, got.action * c, equal_nan=True)
                assert np.array_equal(other.phi_max, got.phi_max, equal_nan=True)
                here = flow(A, B, C, phi, v, 0.7)
                there = flow(A * c2, B * c2, C * c2, phi, v * c, 0.7 / c)
                assert here.motion_phi == there.motion_phi
                assert here.motion_dphi * c == there.motion_dphi
