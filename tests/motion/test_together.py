"""Many motions of one Python function at once: against closed forms, and functions of one state."""

import numpy as np
import pytest

import phasekit as pk
from phasekit.motion.legs import called
from phasekit.motion.lost import ARRIVED
from phasekit.motion.together import Together, stepped

EVERYWHERE = np.repeat([[-np.inf], [np.inf]], 2, axis=1)


def together(f, states, **parameters):
    problem = pk.Problem(f, ("x", "y"), dict.fromkeys(parameters, 1.0), time="t", period=2 * np.pi)
    values = {name: np.asarray(value, float) for name, value in parameters.items()}
    x, law = np.asarray(states, float), problem.own_equations
    return Together.if_it_takes_arrays(law, values, len(x), np.arange(len(x)), x)


def test_motions_are_those_of_closed_forms():
    """Of x' = -a x + cos t and y' = a y^2, which ends at 1/(a y), rates differing by motion."""
    a = np.array([0.1, 1.0, 30.0, 1.0])
    states = np.array([[1.0, 0.1], [0.0, 0.2], [-2.0, -0.1], [3.0, 0.5]])
    f = together(lambda x, t, a: [-a * x[0] + np.cos(t), a * x[1] ** 2], states, a=a)
    begin, end = np.array([0.0, 1.0, 2.0, 0.0]), np.array([5.0, 3.0, 2.5, 4.0])
    found = stepped(f, np.arange(4), states, begin, end, 1e-11, 1e-12, EVERYWHERE)
    decay = np.exp(-a * (end - begin))
    forced = [(a * np.cos(t) + np.sin(t)) / (1 + a**2) for t in (begin, end)]
    x = forced[1] + (states[:, 0] - forced[0]) * decay
    y = states[:, 1] / (1 - a * states[:, 1] * (end - begin))
    np.testing.assert_allclose(found[:3, 0], x[:3], rtol=1e-9)
    np.testing.assert_allclose(found[:3, 1], y[:3], rtol=1e-9)
    assert np.isnan(found[3]).all()  # past its end
    assert not f.raised
    assert not f.undefined.any()


@pytest.mark.parametrize(
    "f",
    [
        lambda x, t: [x[1], -x[0] if x[0] > 0 else x[0]],
        lambda x, t: [x[1], -x.sum()],
        lambda x, t: [x[1], -float(x[0])],
        lambda x, t: [x[1], -np.max(x)],
        lambda x, t: x[::-1].sum() * np.ones(2),
    ],
)
def test_functions_of_one_state_are_told(f):
    assert together(f, np.random.default_rng(1).normal(size=(5, 2))) is None


def test_where_a_function_raises_or_has_no_value_is_seen_of_each_motion():
    def f(x, t):
        if np.any(x[0] > 2.0):
            raise ValueError("too far")
        return [1.0 + 0.0 * x[0], -np.sqrt(x[1] - x[0])]

    states = np.array([[0.0, 9.0], [1.9, 9.0], [0.0, 0.5]])
    many = together(f, states)
    with np.errstate(invalid="ignore"):
        found = stepped(
            many, np.arange(3), states, np.zeros(3), np.full(3, 1.0), 1e-8, 1e-8, EVERYWHERE
        )
    assert found[0, 0] == pytest.approx(1.0)
    assert np.isnan(found[1:]).all()
    assert "too far" in many.raised[1]
    assert many.undefined.tolist() == [False, False, True]


def test_steps_are_free_of_the_unit_of_time():
    """Of an oscillator, at rest, next to it and far off: the same calls and bits in any unit."""
    states = np.array([[0.0, 0.0], [1e-30, 0.0], [0.0, 1.0], [1e6, 1e6]])
    calls, counts, ends = [], [], []

    def turning(x, t, s):
        calls.append(t)
        return [s * x[1], -s * x[0]]

    for unit in (1.0, 2.0**-40, 2.0**40):
        f = together(turning, states, s=4 * [unit])
        calls.clear()
        end = np.full(4, 1.0 / unit)
        ends.append(stepped(f, np.arange(4), states, 0 * end, end, 1e-9, 1e-9, EVERYWHERE))
        counts.append(len(calls))
    assert counts[0] == counts[1] == counts[2] > 0
    np.testing.assert_array_equal(ends[1], ends[0])
    np.testing.assert_array_equal(ends[2], ends[0])
    turned = states @ [[np.cos(1.0), -np.sin(1.0)], [np.sin(1.0), np.cos(1.0)]]
    np.testing.assert_allclose(ends[0], turned, rtol=1e-7, atol=1e-9)


def test_basins_are_those_of_the_formula():
    def step(x, a):
        return [1 - a * x[0] ** 2 + x[1], 0.3 * x[0]]

    window = {"x": (-2, 2), "y": (-2, 2)}
    formula = {"x": "1 - a*x^2 + y", "y": "0.3*x"}
    axis = np.linspace(-2, 2, 15)
    shares = [
        pk.basins(pk.Problem(f, ("x", "y"), {"a": 0.8}, map=True, window=window), grid=grid)
        for f, grid in ((step, {"x": axis, "y": axis}), (formula, {"x": axis, "y": axis}))
    ]
    np.testing.assert_array_equal(shares[0].basin, shares[1].basin)


@pytest.mark.parametrize("value", [0.0, np.nan])
@pytest.mark.parametrize("discrete", [False, True])
def test_one_motion_far_out_does_not_change_others(value, discrete):
    """Of x' = -x or x -> x/2, with y' = y^2 or y -> 2 y, guarded where any state is large."""

    def f(x):
        if np.any(np.abs(x) > 10.0):
            return [value * x[0], value * x[1]]
        return [0.5 * x[0], 2.0 * x[1]] if discrete else [-x[0], x[1] ** 2]

    states = np.array([[1.0, 0.0], [2.0, 0.01], [3.0, 0.5], [4.0, 0.02]])
    law = pk.Problem(f, ("x", "y"), {}, map=discrete).own_equations
    legs = np.full(4, 3.0)
    leg = called(law, {}, legs, EVERYWHERE, 1e-9, 1e-9)
    found, status, _, _ = leg(0, np.arange(4), states)
    found, status, _, _ = leg(1, np.arange(4), found)
    part = 0.5**6 if discrete else np.exp(-6.0)
    others = [0, 1, 3]
    np.testing.assert_allclose(found[others, 0], part * states[others, 0], rtol=1e-6)
    assert (status[others] == ARRIVED).all()
