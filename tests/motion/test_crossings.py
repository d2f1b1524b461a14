"""Crossings of many motions at once, against closed forms."""

from __future__ import annotations

import numpy as np
import pytest
import sympy as sp

import phasekit as pk
from phasekit.laws.formulas import symbols_of
from phasekit.motion.crossings import NEVER, Crossing, Edges, crossings
from phasekit.motion.lost import ARRIVED, LEFT, RESTING
from phasekit.motion.paths import paths

x, y = symbols_of("xy").values()
t = sp.Symbol("t", real=True)
CIRCLE = {"x": "y", "y": "-x"}


def plain(state):
    return [state[1], -state[0]]


SYSTEMS = [pk.Problem(CIRCLE), pk.Problem(plain, ("x", "y"))]


@pytest.mark.parametrize(
    ("system", "level", "way"),
    [(SYSTEMS[0], level, way) for level in (0.3, -0.999, 0.9999999) for way in (1, -1)]
    + [(SYSTEMS[1], 0.9999999, -1)],
)
def test_crossings_of_the_cosine(system, level, way):
    """Both of those that lie beside a turning point, within one step."""
    starts = np.array([[1.0, 0.0], [2.0, 0.0], [0.1, 0.0]])
    times = np.tile([0.0, way * 20.0], (3, 1))
    for sense in (0, 1, -1):
        found = crossings(system.law, {}, starts, times, [Crossing(x - level, sense)], rtol=1e-12)
        assert (found.status == ARRIVED).all()
        for k, radius in enumerate((1.0, 2.0, 0.1)):
            if abs(level) > radius:
                assert np.isnan(found.time[k]).all()
                continue
            turns, angle = 2.0 * np.pi * np.arange(5), np.arccos(level / radius)
            falls, rises = turns + angle, turns[1:] - angle
            want = np.sort({0: np.concatenate([falls, rises]), -1: falls, 1: rises}[sense])
            want = want[want < 20.0]
            got = found.time[k][np.isfinite(found.time[k])]
            assert got.size == want.size > 2
            steep = np.sqrt(1.0 - (level / radius) ** 2)
            assert np.abs(got - way * want).max() < 1e-10 / steep**2
            assert np.abs(found.state[k, : got.size, 0] - level).max() < 1e-14


@pytest.mark.parametrize("system", SYSTEMS, ids=["formulas", "function"])
def test_gates_ends_and_functions_of_time(system):
    starts, times = np.array([[1.0, 0.0]]), np.array([[0.0, 100.0]])
    watched = [Crossing(x, last=3, gate=1), Crossing(y, sense=NEVER), Crossing(sp.sin(t) - 0.5)]
    found = crossings(system.law, {}, starts, times, watched)
    own = found.time[0][found.which[0] == 0]
    # x = cos t vanishes with y = -sin t > 0 at 3 pi/2 alone.
    np.testing.assert_allclose(own, (1.5 + 2.0 * np.arange(3)) * np.pi, rtol=1e-10)
    clock = found.time[0][found.which[0] == 2]
    assert (np.diff(found.time[0]) > 0.0).all()
    np.testing.assert_allclose(np.sin(clock), 0.5, atol=1e-12)
    assert len(clock) == 6
    alone = crossings(system.law, {}, starts, times, watched, kept=False)
    assert alone.time.shape == (1, 1)
    assert alone.time[0, 0] == own[-1]


def test_many_crossings_take_more_room_and_are_counted_on():
    starts, times = np.array([[1.0, 0.0], [0.2, 0.0]]), np.array([[0.0, 700.0]] * 2)
    found = crossings(SYSTEMS[0].law, {}, starts, times, [Crossing(x - 0.5, last=150)])
    assert np.isfinite(found.time).sum(axis=1).tolist() == [150, 0]
    want = (1.0 + 2.0 * np.arange(75))[:, None] * np.pi + [[-2.0 * np.pi / 3.0, 2.0 * np.pi / 3.0]]
    np.testing.assert_allclose(found.time[0], want.ravel(), rtol=1e-8)


@pytest.mark.parametrize("system", SYSTEMS, ids=["formulas", "function"])
def test_a_start_on_the_zero_counts_where_that_is_asked_for(system):
    starts, times = np.array([[0.0, 1.0]]), np.array([[0.0, 4.0]])
    for on, first in ((0, np.pi), (-1, np.pi), (-2, 0.0)):
        found = crossings(system.law, {}, starts, times, [Crossing(x)], on=np.array([on]))
        np.testing.assert_allclose(found.time[0, 0], first, atol=1e-9)


@pytest.mark.parametrize("system", SYSTEMS, ids=["formulas", "function"])
def test_what_touches_counts_where_that_is_asked_for(system):
    starts, times = np.array([[1.0, 0.0]]), np.array([[1.0, 7.0]])
    starts = np.array([[np.cos(1.0), -np.sin(1.0)]])
    for touches in (True, False):
        found = crossings(
            system.law, {}, starts, times, [Crossing((x - 1) ** 2, touches=touches)], rtol=1e-13
        )
        got = found.time[0][np.isfinite(found.time[0])]
        assert len(got) == touches
        np.testing.assert_allclose(got, 2.0 * np.pi, atol=1e-5)


DAMPED = [
    pk.Problem({"x": "y", "y": "-x - y/5"}),
    pk.Problem(lambda s: [s[1], -s[0] - s[1] / 5], ("x", "y")),
]


@pytest.mark.parametrize("damped", DAMPED, ids=["formulas", "function"])
def test_motions_end_at_rest_and_outside(damped):
    starts, times = np.array([[1.0, 0.0], [1.0, 5.0]]), np.array([[0.0, np.inf]] * 2)
    box = np.array([-2.0, -9.0]), np.array([2.0, 9.0])
    how = {"edges": Edges.around(np.zeros((1, 2)), np.full(2, 1e-4), box)}
    found = crossings(damped.law, {}, starts, times, [Crossing(x)], **how)
    assert found.status.tolist() == [RESTING, LEFT]
    rate = np.sqrt(1.0 - 0.01)
    np.testing.assert_allclose(np.diff(found.time[0])[:5], np.pi / rate, rtol=1e-8)
    ways = paths(damped.law, {}, starts, times, widths=np.ones(2), close=0.01, rtol=1e-9,
                 atol=1e-12, **how)  # fmt: skip
    assert [one.status for one in ways] == [RESTING, LEFT]
    far = np.linalg.norm(np.diff(ways[0].state, axis=0), axis=1)
    assert far.max() < 0.02
    s = ways[0].time
    np.testing.assert_allclose(
        ways[0].state[:, 0],
        np.exp(-0.1 * s) * (np.cos(rate * s) + 0.1 / rate * np.sin(rate * s)), atol=1e-7,
    )  # fmt: skip
    (short,) = paths(damped.law, {}, starts[:1], times[:1], widths=np.ones(2), close=0.01,
                     longest=0.5, rtol=1e-9, atol=1e-12)  # fmt: skip
    length = np.linalg.norm(np.diff(short.state, axis=0), axis=1).sum()
    assert 0.5 <= length < 0.51
