"""Periodic orbits on N intervals against 2N, and their multipliers against Liouville's formula."""

from __future__ import annotations

import functools
import os

import numpy as np
import pytest
import sympy
from published.test_cycles import lorenz, reaction, roessler, van_der_pol
from scipy.integrate import solve_ivp

import phasekit as pk

ALL = os.environ.get("PHASEKIT_PUBLISHED") == "all"


def lure():
    return pk.Problem(["y", "z", "-al*z - y - x + x**2"], ("x", "y", "z"), {"al": 1.2})


def duffing():
    return pk.Problem(
        ["v", "F*cos(w*t) - d*v - x - x**3"], ("x", "v"), {"d": 0.04, "F": 0.015, "w": 0.9},
        time="t", period="2*pi/w",
    )  # fmt: skip


def integrated(branch):
    """The integral of the trace along each orbit, by simulation."""
    problem, states = branch.problem, branch.problem.state
    names = {str(s): s for one in problem.f for s in one.free_symbols}
    symbols = [names.get(s, sympy.Symbol(s)) for s in (*states, *problem.parameters)]
    trace = sum(sympy.diff(one, x) for one, x in zip(problem.f, symbols, strict=False))
    both = sympy.lambdify(symbols, [*problem.f, trace])
    found = []
    for i, value in enumerate(branch.points[branch.parameter].values):
        orbit = branch.orbit(i)
        par = {**problem.parameters, branch.parameter: value}.values()
        start = [*(float(orbit[name][0]) for name in states), 0.0]
        motion = solve_ivp(
            lambda t, x, p=par: both(*x[:-1], *p), (0.0, float(orbit.period)), start, "DOP853",
            rtol=1e-11, atol=1e-12,
        )  # fmt: skip
        found.append(motion.y[-1, -1])
    return np.array(found)


# The problem, its parameter, intervals, the integral of the trace over a period; guess, span.
BRANCHES = {
    "lure": (
        lure(), "al", 40, lambda b: -b.points.al.values * b.points.period.values,
        [0.0, 0.0, 0.0], (0.55, 1.5),
    ),
    "reaction": (
        reaction(0.1, 14.0, 3.0), "p1", 40, integrated, [0.1, 0.7], (0.0, 0.5),
    ),
    "lorenz": (
        lorenz(23.0), "rho", 80, lambda b: -(11.0 + 8 / 3) * b.points.period.values,
        [7.7, 7.7, 22.0], (10.0, 30.0),
    ),
    "roessler": (
        roessler(2.0), "c", 40,
        lambda b: (0.2 + b.points.x_mean - b.points.c).values * b.points.period.values,
        [2.0, 2.0, 0.03], (1.9, 6.0),
    ),
    "van_der_pol": (
        van_der_pol(1.0), "mu", 80, integrated, [2.0, 0.0], (0.5, 10.0),
    ),
    "duffing": (
        duffing(), "w", 40, lambda b: -0.04 * b.points.period.values, [0.0, 0.0], (0.85, 1.2),
    ),
}  # fmt: skip
SYSTEMS = list(BRANCHES) if ALL else ["lure", "lorenz"]


@functools.cache
def followed(name, intervals):
    problem, parameter, _, _, x0, span = BRANCHES[name]
    options = pk.ContinuationOptions(intervals=intervals)
    if name in ("lure", "reaction", "lorenz"):
        rest = pk.continuation(problem, parameter, x0=x0, span=span)
        return rest.special("H")[0].switch(options=options)
    orbit = pk.periodic_orbit(problem, x0, settle=100.0 if name == "roessler" else None)
    return pk.continuation(problem, parameter, orbit=orbit, span=span, options=options)


@pytest.mark.parametrize("name", SYSTEMS)
def test_twice_as_many_intervals(name):
    problem, parameter, count, _, _, (low, high) = BRANCHES[name]
    coarse, fine = followed(name, count), followed(name, 2 * count)
    points = coarse.points
    assert (points.n_intervals == count).all()
    assert (fine.points.n_intervals == 2 * count).all()
    assert [stop.reason for stop in coarse.stops] == [stop.reason for stop in fine.stops]
    kinds = [one.kind for one in coarse.special_points]
    assert kinds == [one.kind for one in fine.special_points]
    worst = float(points.mesh_error.max())
    assert float(fine.points.mesh_error.max()) < 0.2 * worst
    for one, two in zip(coarse.special_points, fine.special_points, strict=True):
        assert abs(one[parameter] - two[parameter]) <= worst * (high - low)
        if one.kind != "end" or "homoclinic" not in one.message:
            assert np.isclose(one["period"], two["period"], rtol=worst, atol=0.0)
    # At the same parameters. Where these hardly change along the branch, errors grow.
    speed = np.abs(np.gradient(points[parameter].values / (high - low), points.arclength.values))
    known = np.flatnonzero((speed > 1e-3) & (points.n_unstable.values >= 0))
    compared = 0
    for i in known[np.unique(np.linspace(1, len(known) - 2, 8).astype(int))]:
        at = problem.replace(**{parameter: float(points[parameter][i])})
        options = pk.ContinuationOptions(intervals=2 * count)
        orbit = pk.periodic_orbit(at, coarse.orbit(int(i)), options=options)
        assert int(orbit.n_intervals) == 2 * count
        error = float(points.mesh_error[i]) / speed[i] + 1e-12
        assert np.isclose(orbit.period, points.period[i], rtol=error, atol=0.0)
        gaps = np.abs(orbit.multiplier.values - points.multiplier.values[i])
        assert np.all(gaps <= error * np.maximum(1.0, np.abs(orbit.multiplier.values)))
        assert int(orbit.n_unstable) == int(points.n_unstable[i])
        compared += 1
    assert compared >= 6


@pytest.mark.parametrize("intervals", [None, 1, 2])
@pytest.mark.parametrize("name", SYSTEMS)
def test_products_of_multipliers(name, intervals):
    """Those of strong decay, too: down to 1e-130 they have the digits that the mesh claims."""
    count, integral = BRANCHES[name][2:4]
    branch = followed(name, None if intervals is None else intervals * count)
    points = branch.points
    known = points.n_unstable.values >= 0
    assert known.all() if intervals is None else known.sum() > 10
    exact = integral(branch)[known]
    product = np.sum(np.log(np.abs(points.multiplier.values[known])), axis=1)
    claimed = 5.0 * np.maximum(points.mesh_error.values[known], 1e-8)
    assert np.all(np.abs(product - exact) <= claimed * (1.0 + np.abs(exact)))


@pytest.mark.parametrize("count", [12, 60])
def test_an_orbit_has_as_many_intervals_as_asked_for(count):
    options = pk.ContinuationOptions(intervals=count)
    orbit = pk.periodic_orbit(van_der_pol(1.0), [2.0, 0.0], options=options)
    assert int(orbit.n_intervals) == count
    branch = pk.continuation(van_der_pol(1.0), "mu", orbit=orbit, span=(0.9, 1.1), options=options)
    assert (branch.points.n_intervals == count).all()
