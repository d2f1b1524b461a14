"""Starts at zero beside large and small states, and at edges of the domain of a function."""

import math

import numpy as np
import pytest

import phasekit as pk


def traced(f, states, x0, span=(-0.9, 0.9), p=0.0):
    return pk.continuation(pk.Problem(f, list(states), {"p": p}), "p", x0=x0, span=span)


def ends(branch):
    return [stop.reason for stop in branch.stops]


@pytest.mark.slow
@pytest.mark.parametrize("steep", [1e-9, 1.0, 1e9])
@pytest.mark.parametrize("size", [1e-9, 1e9, 1e15])
def test_states_that_are_guessed_as_zero_are_found_at_any_size(size, steep):
    def f(x, p):
        return [p - math.tanh(steep * x[0]), size * (1.0 + p) - x[1]]

    branch = traced(f, "xy", [0.0, 0.0])
    assert ends(branch) == ["bound", "bound"]
    p = branch.points.p.values
    np.testing.assert_allclose(branch.points.x, np.arctanh(p) / steep, rtol=1e-9, atol=1e-9 / steep)
    np.testing.assert_allclose(branch.points.y, size * (1.0 + p), rtol=1e-12)


def test_a_large_state_beside_a_small_one_that_it_multiplies():
    def f(x, p):
        return [p - x[0], 1e9 * (1.0 + p) - x[1], x[0] * x[1] / 1e9 - x[2]]

    branch = traced(f, "xyz", [0.0, 0.0, 0.0])
    assert ends(branch) == ["bound", "bound"]
    p = branch.points.p.values
    np.testing.assert_allclose(branch.points.z, p * (1.0 + p), rtol=1e-12, atol=1e-15)
    assert [s.kind for s in branch.special_points] == ["end", "end"]


@pytest.mark.slow
@pytest.mark.parametrize("f", [lambda x, p: [math.log(x[0]) - p], "log(x) - p"])
def test_growth_is_no_pole(f):
    branch = traced(f, "x", [1.0], span=(-30.0, 30.0))
    np.testing.assert_allclose(branch.points.x, np.exp(branch.points.p), rtol=1e-11)
    message = branch.stops[1].message
    assert "far beyond its size at the start" in message
    assert "without end" not in message
    assert "bound 3" not in message
    longer = branch.extend(bounds={"x": (0.0, 1e15)})
    assert longer.stops[1].message == "p met its upper bound 30"
    pole = traced("p*x - 1", "x", [1.0], span=(-1.0, 2.0), p=1.0)
    assert "x grows without end: it passed" in pole.stops[0].message


@pytest.mark.parametrize(
    ("f", "exact"),
    [
        (lambda x, p: [math.sqrt(x[0]) - p], lambda p: p**2),
        (lambda x, p: [p - math.sqrt(1e9 - x[0])], lambda p: 1e9 - p**2),
        (lambda x, p: [math.acos(x[0] / 1e-9) - p], lambda p: 1e-9 * np.cos(p)),
    ],
)
def test_a_branch_ends_on_the_edge_of_a_domain(f, exact):
    x0 = exact(0.5)
    branch = traced(f, "x", [x0], span=(-1.0, 1.0), p=0.5)
    assert ends(branch) == ["not_finite", "bound"]
    p = branch.points.p.values
    np.testing.assert_allclose(branch.points.x, exact(p), rtol=1e-9)
    assert abs(p[0]) < 1e-2  # of 1e9 - x little is known there
    assert branch.stops[0].message.partition("it raised ")[2].startswith("ValueError: ")


def guarded(x, p):
    if x[1] < 0.0:
        raise ValueError("a negative population")
    return [p - x[0] - x[0] ** 2, x[1] * (x[0] - 1.0) - x[1] ** 2]


def test_a_start_on_the_edge_has_slopes_from_inside():
    branch = traced(guarded, "xy", [0.6, 0.0], span=(0.0, 5.0), p=1.0)
    assert ends(branch) == ["bound", "bound"]
    x, p = branch.points.x.values, branch.points.p.values
    np.testing.assert_allclose(x, (np.sqrt(1.0 + 4.0 * p) - 1.0) / 2.0, atol=1e-12)
    assert not np.any(branch.points.y)
    unstable = branch.points.n_unstable.values
    away = np.abs(x - 1.0) > 1e-6
    np.testing.assert_array_equal(unstable[away], (x > 1.0)[away])


def test_an_edge_without_slopes_is_named():
    with pytest.raises(pk.ConvergenceError, match=r"f has no value for x below 0; give"):
        traced(lambda x, p: [math.sqrt(x[0]) + x[0] - p], "x", [0.0], span=(0.0, 1.0))
