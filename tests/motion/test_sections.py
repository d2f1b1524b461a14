"""Sections of motions: strobes and passages, against closed forms."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.special import ellipk

import phasekit as pk
from phasekit.motion.sections import passages, strobe
from phasekit.motion.steps import InitialValue


def pendulum(t, x):
    return x[1], -np.sin(x[0])


def oscillator(t, x):
    return x[1], -x[0]


def damped_and_driven(t, x):
    return x[1], np.cos(2.0 * t) - 0.4 * x[1] - x[0]


def test_strobe_of_a_driven_oscillator():
    """The transient decays; every period of the drive has the steady state of the closed form."""
    times = np.pi * np.arange(41)
    found = strobe(InitialValue(damped_and_driven, (2.0, -1.0)), times)
    assert np.array_equal(found.time, times)
    assert found.state[:, 0].tolist() == [2.0, -1.0]
    amplitude = 1.0 / (1.0 - 4.0 + 0.8j)  # x = Re(amplitude exp(2 i t))
    steady = np.array([amplitude.real, (2j * amplitude).real])
    w, left = np.sqrt(1.0 - 0.04), np.array([2.0, -1.0]) - steady
    decay, cos, sin = np.exp(-0.2 * times), np.cos(w * times), np.sin(w * times)
    x = decay * (left[0] * cos + (left[1] + 0.2 * left[0]) / w * sin)
    v = decay * (left[1] * cos - (left[0] + 0.2 * left[1]) / w * sin)
    assert np.abs(found.state - (steady[:, None] + [x, v])).max() < 1e-9


def test_strobe_backwards_from_a_later_start():
    begin = InitialValue(oscillator, (np.cos(1.0), -np.sin(1.0)), start=1.0)
    for times in ([0.5, -3.0, -3.5], [1.0, 0.0], [1.0], [2.0], []):
        found = strobe(begin, times)
        assert found.state.shape == (2, len(times))
        assert np.allclose(found.state, [np.cos(times), -np.sin(times)], rtol=0, atol=1e-10)
    for times in ([0.0, 2.0], [2.0, 2.0], [2.0, np.nan], [[2.0]], [2.0, 1.5], "x"):
        with pytest.raises(pk.ParameterError, match=r"^times: got .*, wants times from the start"):
            strobe(begin, times)


@pytest.mark.parametrize("level", [0.3, -0.999, 0.9999999])
@pytest.mark.parametrize("direction", [0, 1, -1])
@pytest.mark.parametrize("sense", [1, -1])
def test_passages_of_the_cosine(level, direction, sense):
    """Both of those that lie beside a turning point, within one step."""
    found = passages(
        InitialValue(oscillator, (1.0, 0.0)), sense * 20.0, 0, level, direction=direction
    )
    turns = 2.0 * np.pi * np.arange(5)
    angle = np.arccos(level)
    falls, rises = turns + angle, turns[1:] - angle
    want = {0: np.concatenate([falls, rises]), -1: falls, 1: rises}[direction]
    want = np.sort(want[want < 20.0])
    assert found.time.size == want.size > 2
    assert np.abs(found.time - sense * want).max() < 1e-6 * np.sqrt(1e-7 / (1 - abs(level)))
    assert np.abs(found.state[0] - level).max() < 1e-14


def test_passages_of_a_turning_pendulum():
    """One each turn, whose time is a complete elliptic integral."""
    speed = 3.0
    period = 2.0 * (2.0 / speed) * ellipk((2.0 / speed) ** 2)
    problem = InitialValue(pendulum, (0.5, np.sqrt(speed**2 - 4 * np.sin(0.25) ** 2)))
    for level in (1.0, 1.0 + 6 * np.pi, 1.0 - 40 * np.pi):
        found = passages(problem, 30.0, 0, level, period=2 * np.pi)
        turns = (found.state[0] - 1.0) / (2 * np.pi)
        assert np.allclose(turns, np.arange(found.time.size), rtol=0, atol=1e-12)
        assert found.time.size == 1 + np.floor((30.0 - found.time[0]) / period)
        assert np.allclose(np.diff(found.time), period, rtol=0, atol=1e-9)
    assert passages(problem, 30.0, 0, 1.0).time.size == 1
    assert passages(problem, 30.0, 0, 1.0, period=2 * np.pi, direction=-1).time.size == 0
    assert passages(problem, 30.0, 0, 0.5).time.size == 0  # the start is none


def test_many_passages_in_one_step_are_foreseen():
    line = InitialValue(lambda t, x: (1e12,), (0.0,))
    with pytest.raises(pk.ConvergenceError, match="more than 1000000 times"):
        passages(line, 1.0, 0, 0.5, period=1.0)
    few = InitialValue(lambda t, x: (1.0,), (0.0,), most=51)
    assert np.allclose(passages(few, 50.0, 0, 0.5, period=1.0).time, np.arange(50) + 0.5)
    with pytest.raises(pk.ConvergenceError, match="more than 51 times"):
        passages(few, 52.0, 0, 0.5, period=1.0)


@pytest.mark.parametrize("section", [np.pi, -np.pi, 3 * np.pi])
@pytest.mark.parametrize("speed", [3.0, -3.0])
def test_a_section_at_the_cut_stands_at_one_side_of_it(section, speed):
    spinning = pk.Perturbed(pk.Pendulum(length=1.0, g=1.0), damping=0.01)
    ds = pk.poincare_section(spinning, 0.0, speed, duration=20.0, section=section, direction=0)
    assert ds.section_phi.values.tolist() == [np.pi] * 7
    assert (np.sign(ds.section_dphi) == np.sign(speed)).all()
