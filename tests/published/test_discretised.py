"""Branch points of discretised equations: all of them, of 8 to 200 states."""

from __future__ import annotations

import os

import numpy as np
import pytest
from published import discretised as pde

FULL = os.environ.get("PHASEKIT_PUBLISHED") == "all"
SIZES = (8, 25, 60, 200) if FULL else (25,)


def found(branch, label, parameter):
    points = branch.special(label)
    assert all(point.status == "converged" for point in points)
    return np.array([point[parameter] for point in points])


@pytest.mark.parametrize("n", SIZES)
def test_allen_cahn(n):
    wanted = pde.allen_cahn_points(n)
    span = pde.span_of(wanted, 4)
    branch = pde.trivial(pde.allen_cahn, n, "r", span)
    np.testing.assert_allclose(found(branch, "BP", "r"), wanted[:4], rtol=1e-10)
    assert {point.kind for point in branch.special("BP")} == {"pitchfork"}
    assert not branch.special("H")
    assert branch.points.n_unstable.values[-1] == 4


@pytest.mark.parametrize("n", SIZES)
def test_swift_hohenberg(n):
    """The mode next to the wave number one first; modes with nearly the same growth follow."""
    wanted = pde.swift_hohenberg_points(n)
    count = min(n, 8)
    span = pde.span_of(wanted, count)
    branch = pde.trivial(pde.swift_hohenberg, n, "r", span)
    np.testing.assert_allclose(found(branch, "BP", "r"), wanted[:count], rtol=1e-9, atol=1e-10)
    assert branch.points.n_unstable.values[-1] == count
    assert not branch.special("H")


@pytest.mark.parametrize("n", (8, 25, 60) if FULL else (8,))
def test_brusselator(n):
    span = (2.3, 6.0)
    hopf, branch_points = pde.brusselator_points(n, *span)
    branch = pde.trivial(pde.brusselator, 2 * n, "B", span)
    np.testing.assert_allclose(found(branch, "H", "B"), hopf, rtol=1e-9)
    np.testing.assert_allclose(found(branch, "BP", "B"), branch_points, rtol=1e-10)
    assert len(hopf) == 2
    assert len(branch_points) >= 6
