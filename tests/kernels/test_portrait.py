"""The compiled kernels of orbits and the same code interpreted give the same bits."""

from __future__ import annotations

import numpy as np
import pytest
from properties.strategies import systems

from phasekit.phase import solve
from phasekit.phase.action_angle import orbits_with_angles
from phasekit.phase.flow import flow
from phasekit.phase.orbits import orbits, orbits_at_energy, orbits_at_gap


@pytest.fixture(scope="module")
def states():
    """Systems, states and times, with special values among them."""
    rng = np.random.default_rng(71)
    n = 600
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
    found = []
    for most in (10**9, 0):
        monkeypatch.setattr(solve, "INTERPRETED_AT_MOST", most)
        monkeypatch.setattr(solve, "_interpreted", {})
        with np.errstate(all="ignore"):
            found.append(
                (
                    *orbits(A, B, C, phi0, v0),
                    *flow(A, B, C, phi0, v0, t),
                    *orbits_with_angles(A, B, C, phi0, v0)[1],
                    *orbits_at_energy(A, B, C, v0, 0),
                    *orbits_at_gap(A, B, C, v0, 1, 0),
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
