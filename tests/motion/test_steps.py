"""One motion of any law: closed forms, events, and the bound on the number of steps."""

from __future__ import annotations

from itertools import islice

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import phasekit as pk
from phasekit.errors import ConvergenceError
from phasekit.motion.events import Event
from phasekit.motion.integrate import integrate
from phasekit.motion.steps import InitialValue, Step, steps


def oscillator(t, x):
    return x[1], -x[0]


def pendulum(t, x):
    return x[1], -np.sin(x[0])


START = InitialValue(oscillator, (1.0, 0.0))


@pytest.mark.parametrize("stop", [20.0, -20.0])
def test_oscillator_is_a_cosine(stop):
    found = integrate(START, stop)
    assert (found.times[0], found.times[-1]) == (0.0, stop)
    times = np.linspace(0.0, stop, 101)
    want = np.array([np.cos(times), -np.sin(times)])
    assert np.abs(found.state(times) - want).max() < 1e-9


@pytest.mark.parametrize("start", [(0.5, 0.0), (3.1, 0.0), (0.0, 2.5)])
def test_pendulum_moves_as_in_closed_form(start):
    times = np.linspace(0.0, 15.0, 31)
    want = pk.flow(pk.Coefficients(0.0, 1.0, 0.0), *start, times)
    phi, dphi = integrate(InitialValue(pendulum, start), 15.0).state(times)
    assert np.abs(phi - want.motion_phi.values).max() < 1e-8
    assert np.abs(dphi - want.motion_dphi.values).max() < 1e-8


def test_steps_are_those_of_scipy():
    events = {"low": Event(lambda t, x: x[0] + 0.5), "still": Event(lambda t, x: x[1])}
    found = integrate(InitialValue(pendulum, (0.7, 0.1)), 12.0, events)
    options = {"method": "DOP853", "rtol": 1e-11, "atol": 1e-12, "dense_output": True}
    functions = [event.function for event in events.values()]
    want = solve_ivp(pendulum, (0.0, 12.0), (0.7, 0.1), events=functions, **options)
    assert np.array_equal(found.times, want.t)
    assert np.array_equal(found.state(found.times), want.sol(want.t))
    for name, times in zip(events, want.t_events, strict=True):
        mine = found.events.time[np.array(found.events.name) == name]
        assert mine.size == times.size > 3
        assert np.allclose(mine, times, rtol=0, atol=1e-14)


@pytest.mark.parametrize(("direction", "first"), [(0, 0.5), (1, 1.5), (-1, 0.5)])
@pytest.mark.parametrize("sense", [1, -1])
def test_events_of_the_cosine(direction, first, sense):
    """In either sense of time, as the cosine is even."""
    event = Event(lambda t, x: x[0], direction=direction)
    found = integrate(START, sense * 10.0, {"zero": event}).events
    want = np.pi * np.arange(first, 10.0 / np.pi, 1 if direction == 0 else 2)
    assert found.name == ["zero"] * want.size
    assert np.allclose(found.time, sense * want, rtol=0, atol=1e-10)
    assert np.abs(found.state[0]).max() < 1e-13


def test_a_motion_ends_at_a_terminal_event():
    events = {"turn": Event(lambda t, x: x[1]), "end": Event(lambda t, x: x[0], terminal=2)}
    found = integrate(START, 10.0, events)
    assert found.events.name == ["turn", "end", "turn", "end"]
    assert np.allclose(found.events.time / np.pi, [0.0, 0.5, 1.0, 1.5], rtol=0, atol=1e-10)
    assert found.times[-1] == found.events.time[-1]
    at_once = integrate(START, 10.0, {"end": Event(lambda t, x: x[1], terminal=1)})
    assert at_once.times.tolist() == [0.0, 0.0]
    assert at_once.state(0.0).tolist() == [1.0, 0.0]


def test_a_zero_where_steps_meet_is_found_once():
    """The end of one step is the start of the next."""
    line = InitialValue(lambda t, x: (1.0,), (0.0,), max_step=0.25)
    meeting = [step.stop for step in steps(line, 4.0)][5]
    for terminal in (0, 1, 2):
        event = Event(lambda t, x: t - meeting, terminal)
        found = integrate(line, 4.0, {"meet": event})
        assert found.events.time.tolist() == [meeting]
        assert found.times[-1] == (meeting if terminal == 1 else 4.0)
    touching = Event(lambda t, x: abs(t - meeting), 1, direction=1)
    found = integrate(line, 4.0, {"touch": touching})
    assert found.times[-1] == meeting
    assert found.state(meeting) == pytest.approx([meeting])


def test_events_in_a_very_fast_motion():
    """Times are found to a part of the step, however short it is."""
    fast = InitialValue(lambda t, x: (1e16 * x[1], -1e16 * x[0]), (1.0, 0.0))
    found = integrate(fast, 1e-15, {"zero": Event(lambda t, x: x[0])}).events
    assert np.allclose(found.time * 1e16 / np.pi, [0.5, 1.5, 2.5], rtol=1e-9)


# The bound


def test_more_steps_than_allowed():
    few = InitialValue(oscillator, (1.0, 0.0), most=20)
    for call in (lambda: list(steps(few, 1e3)), lambda: integrate(few, -1e3)):
        with pytest.raises(pk.ConvergenceError, match=r" in 20 steps, .* more than 20 in all; try"):
            call()
    enough = sum(1 for _ in steps(few, 1.0))
    assert 5 < enough < 20
    exact = InitialValue(oscillator, (1.0, 0.0), most=enough)
    assert sum(1 for _ in steps(exact, 1.0)) == enough


def test_hopeless_motions_are_given_up_early():
    with pytest.raises(pk.ConvergenceError, match=r" in 1000 steps, .* more than 1000000 in all"):
        integrate(START, 1e16)


def test_a_fast_start_is_no_reason_to_give_up():
    """Its first steps would need 10^11 of their length."""
    slowing = InitialValue(lambda t, x: (x[1], -1e6 * x[1] - x[0]), (1.0, 1e12), max_step=0.5)
    damped = InitialValue(lambda t, x: (-1e3 * x[0] ** 3,), (1e9,))
    found = integrate(damped, 1.0)
    assert found.state(1.0)[0] == pytest.approx(1 / np.sqrt(2e3 + 1e-18), rel=1e-7)
    first = next(iter(steps(slowing, 1e-3)))
    assert first.stop < 1e-6
    assert integrate(slowing, 1e-3).times[-1] == 1e-3


@pytest.mark.slow
def test_steps_of_a_layer_say_nothing_of_later_implicit_ones():
    """More than 1000 steps follow the fast decay; all the rest takes some hundred."""
    from scipy.integrate import Radau

    d, time = 1e4, 3e4
    unit = np.array([1.0, 1e-4])
    law = InitialValue(
        lambda t, x: (x[1], -d * x[1] - x[0]), (1.0, 0.5), rtol=1e-10, unit=unit, most=30_000,
        method=Radau,
    )  # fmt: skip
    found = list(steps(law, time))
    assert sum(step.stop < 100.0 / d for step in found) > 1000
    slow = -2.0 / (d + np.sqrt(d**2 - 4.0))
    exact = (0.5 + d + slow) / (d + 2.0 * slow) * np.exp(slow * time)
    assert found[-1].after == pytest.approx([exact, slow * exact], rel=1e-6)


@pytest.mark.parametrize("state", [(1.0, 0.0), (0.0, 1.0), (0.0, 0.0)])
def test_without_an_absolute_error(state):
    """A component may be zero, at the start or for ever."""
    found = integrate(InitialValue(oscillator, state, atol=0.0), 3.0)
    cos, sin = np.cos(found.times), np.sin(found.times)
    want = state[0] * cos + state[1] * sin, state[1] * cos - state[0] * sin
    assert np.abs(found.state(found.times) - want).max() < 1e-9


def test_a_motion_that_cannot_start_or_go_on():
    with pytest.raises(pk.ParameterError, match=r"^state: got \(0\.0,\), wants one with finite"):
        integrate(InitialValue(lambda t, x: (np.nan,), (0.0,)), 1.0)
    with pytest.raises(pk.ConvergenceError, match=r"stopped at t = 1\.0\d* s of 2\.0 s: "):
        integrate(InitialValue(lambda t, x: (x[0] ** 2,), (1.0,)), 2.0)


def test_a_motion_that_no_step_changes_beside_the_end_of_its_law_is_given_up():
    """X = sin(t + pi/6) comes to x = 1, behind which there is no rate, and would stay beside it."""
    problem = InitialValue(lambda t, x: np.sqrt(1.0 - x * x) if x[0] < 1.0 else x * np.nan, [0.5])
    seen: list[Step] = []
    with pytest.raises(ConvergenceError):
        seen.extend(islice(steps(problem, 2.0), 5000))
    for step in seen:
        want = min(np.sin(step.stop + np.pi / 6.0), 1.0) if step.stop < np.pi / 3.0 else 1.0
        assert step.after[0] == pytest.approx(want, abs=1e-9)
