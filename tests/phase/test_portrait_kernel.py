"""The compiled kernels of orbits and the same code interpreted give the same bits."""

from __future__ import annotations

import numpy as np
import pytest
from properties.strategies import systems

from phasekit.numerics import launch
from phasekit.phase.exact.action_angle import action_angle, orbits_with_angles, state_of
from phasekit.phase.exact.flow import flow, separatrix_motion
from phasekit.phase.exact.orbits import orbits, orbits_at_energy, orbits_at_gap


@pytest.fixture(scope="module")
def states():
    """Systems, states and times, with special values among them."""
    rng = np.random.default_rng(71)
    n = 240
    A, B, C = systems(n)
    size = np.sqrt(np.max(np.abs([A, B, C]), axis=0))
    phi0, t = rng.uniform(-4, 4, n), rng.uniform(-9, 9, n) / size
    v0 = size * rng.choice([-1, 1], n) * 10.0 ** rng.uniform(-8, 2, n)
    v0[::5] = 0.0
    special = [0.0, -0.0, 1.0, 1e300, 5e-324, np.nan, np.inf, -np.inf]
    for array in (A, B, C, phi0, v0, t):
        array[rng.integers(0, n, 30)] = rng.choice(special, 30)
    return A, B, C, phi0, v0, t


def test_compiled_and_interpreted_agree_to_the_last_bit(states, monkeypatch):
    A, B, C, phi0, v0, t = states
    there = action_angle(A, B, C, phi0, v0)
    found = []
    for most in (10**9, 0):
        monkeypatch.setattr(launch, "INTERPRETED_AT_MOST", most)
        monkeypatch.setattr(launch, "INTERPRETED_SECONDS", np.inf)
        monkeypatch.setattr(launch, "_interpreted", {})
        with np.errstate(all="ignore"):
            found.append(
                (
                    *orbits(A, B, C, phi0, v0),
                    *flow(A, B, C, phi0, v0, t),
                    *orbits_with_angles(A, B, C, phi0, v0)[1],
                    *orbits_at_energy(A, B, C, v0, 0),
                    *orbits_at_gap(A, B, C, v0, 1, 0),
                    *state_of(A, B, C, there.action, there.angle, there.orbit_family),
                    *separatrix_motion(A, B, C, t),
                )
            )
    for one, other in zip(*found, strict=True):
        assert np.array_equal(one, other, equal_nan=one.dtype.kind == "f")


def test_a_cell_does_not_depend_on_its_neighbors(states):
    A, B, C, phi0, v0, t = states
    with np.errstate(all="ignore"):
        whole = (*orbits(A, B, C, phi0, v0), *flow(A, B, C, phi0, v0, t))
        for i in range(0, A.size, 37):
            cell = tuple(x[i] for x in states[:5])
            alone = (*orbits(*cell), *flow(*cell, t[i]))
            for one, other in zip(whole, alone, strict=True):
                assert np.array_equal(one[i], other, equal_nan=one.dtype.kind == "f"), cell


def test_nothing_is_left_of_the_system_before():
    """Without force a state at rest stays, whatever system its neighbor in the array has."""
    A, B, C = np.array([[1.0, 0.0, -2.0, 0.0], [1.0, 0.0, 0.0, 0.0], [0.3, 0.0, 0.5, 0.0]])
    got = orbits(A, B, C, 0.3, 0.0)
    assert np.isinf(got.period[[1, 3]]).all()
    assert (got.frequency[[1, 3]] == 0).all()
    moved = flow(A, B, C, 0.3, 0.0, 2.0)
    assert (moved.motion_phi[[1, 3]] == 0.3).all()


def test_rotations_without_force_have_an_action_and_an_angle():
    """The speed is the action, and the angle is phi."""
    there = action_angle(0.0, 0.0, 0.0, [0.3, 0.3], [2.0, -2.0])
    assert there.action == pytest.approx(2.0)
    assert there.angle == pytest.approx([0.3, 2 * np.pi - 0.3])
    back = state_of(0.0, 0.0, 0.0, there.action, there.angle, there.orbit_family)
    assert back.phi == pytest.approx(0.3)
    assert back.dphi == pytest.approx([2.0, -2.0])
