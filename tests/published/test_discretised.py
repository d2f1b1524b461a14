"""Branch points of discretised equations: all of them, of 8 to 200 states."""

from __future__ import annotations

import os

import numpy as np
import pytest
from published import discretised as pde

import phasekit as pk

FULL = os.environ.get("PHASEKIT_PUBLISHED") == "all"
SIZES = (8, 25, 60, 200) if FULL else (16,)


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


EVERY = {"detect": ("fold", "branch_point", "hopf", "neutral_saddle")}


def crossings(places, n, seed):
    """X' = A(p) x with pairs that cross at known places, and others that meet on the real axis."""
    rng = np.random.default_rng(seed)
    frame = rng.normal(size=(n, n))
    back = np.linalg.inv(frame)
    fixed = -rng.uniform(0.5, 3.0, n)
    speeds = rng.uniform(0.5, 3.0, len(places))
    meet = 2 * len(places)

    def jac(x, p):
        A = np.diag(fixed)
        for k, (place, w) in enumerate(zip(places, speeds, strict=True)):
            A[2 * k : 2 * k + 2, 2 * k : 2 * k + 2] = [[p - place, w], [-w, p - place]]
        for i, a in ((meet, 0.7), (meet + 2, -0.7)):  # complex below p = 0.2, real above
            A[i : i + 2, i : i + 2] = [[a, 1.0], [0.3 * (p - 0.2), a]]
        return frame @ A @ back

    states = [f"x{i}" for i in range(n)]
    return pk.Problem(lambda x, p: jac(x, p) @ x - x**3, states, {"p": -1.0}, jac=lambda x, p: (
        jac(x, p) - np.diag(3.0 * x**2)
    ))  # fmt: skip


@pytest.mark.parametrize("seed", range(3))
def test_hopf_points_of_many_states_are_all_found_without_neutral_saddles(seed):
    rng = np.random.default_rng(100 + seed)
    places = np.sort(rng.uniform(-0.9, 0.9, 4))
    places[1] = places[0] + 10.0 ** -rng.integers(1, 5)
    problem = crossings(places, 14, seed)
    branch = pk.continuation(problem, "p", x0=np.zeros(14), span=(-1.0, 1.0))
    np.testing.assert_allclose(found(branch, "H", "p"), np.sort(places), rtol=0, atol=1e-9)
    assert branch.special("NS") == ()
    assert "neutral_saddle" in "".join(branch.messages)
    assert np.max(branch.points.n_unstable) >= 6


def test_neutral_saddles_of_many_states_are_found_when_they_are_asked_for():
    hopf, branch_points = pde.brusselator_points(8, 2.3, 4.0)
    plain, every = (
        pde.trivial(pde.brusselator, 16, "B", (2.3, 4.0), **options) for options in ({}, EVERY)
    )
    for branch in (plain, every):
        np.testing.assert_allclose(found(branch, "H", "B"), hopf, rtol=1e-9)
        np.testing.assert_allclose(found(branch, "BP", "B"), branch_points, rtol=1e-10)
    assert plain.special("NS") == ()
    assert len(every.special("NS")) > 0
    assert every.messages == ()
