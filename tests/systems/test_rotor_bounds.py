"""Motions of the rotor that no integrator can follow end soon; what they need is counted."""

from __future__ import annotations

import pickle

import numpy as np
import pytest

import phasekit as pk

DISK = pk.GyroRotorDisk(beta=1.0, e=0.1, a=0.05, r=0.1, omega1=6.0, m=2.0)
ROTOR = pk.FreeGyroRotor(DISK, 0.02)
SOON = r"in 1\d{3} steps, the longest of .*, and would need more than 1000000 in all; try"


@pytest.mark.slow
@pytest.mark.parametrize(
    "start",
    [
        lambda: ROTOR.simulate(0.5, 1e16, (0.0, 1.0)),
        lambda: ROTOR.simulate(0.5, 0.0, (0.0, 1.0), torque2=-1e16),
        lambda: ROTOR.poincare(0.5, 0.0, 1.0, section=0.0, torque1=1e16),
        lambda: ROTOR.poincare(0.5, 0.0, 1e16, period=1e16),
        lambda: ROTOR.simulate(0.5, 0.0, (0.0, -1.0), max_step=1e-300),
    ],
    ids=["speed", "torque", "section", "time", "max_step"],
)
def test_endless_motions_end_soon(start):
    with pytest.raises(pk.ConvergenceError, match=SOON):
        start()


@pytest.mark.parametrize("speed", [{"dphi0": 1e200}, {"dphi0": 0.0, "omega1": -1e300}])
def test_speeds_whose_squares_overflow(speed):
    with pytest.raises(pk.ParameterError, match=r"^phi0, dphi0, omega1: got 0\.5, "):
        ROTOR.simulate(0.5, t=(0.0, 1.0), **speed)
    with pytest.raises(pk.ParameterError, match=r"^torque2 at t = 0\.0: got inf, wants"):
        ROTOR.simulate(0.5, 1e200, (0.0, 1.0), torque2=lambda *x: x[4] ** 2)


@pytest.mark.parametrize("start", [(0.5, 0.0), (0.0, 3.0), (0.0, 0.0)])
def test_without_an_absolute_error_the_motion_is_the_same(start):
    times = np.linspace(0.0, 1.0, 5)
    got = ROTOR.simulate(*start, times, atol=0.0, omega1=2.0)
    want = ROTOR.simulate(*start, times, omega1=2.0)
    for name in ("phi1", "phi", "omega1", "dphi"):
        assert np.allclose(got[f"motion_{name}"], want[f"motion_{name}"], rtol=0, atol=1e-9), name


def test_a_wheel_that_passes_a_section_too_often():
    """It turns evenly, so that one step may hold any number of turns."""
    wheel = pk.FreeGyroRotor(DISK.replace(beta=np.pi / 2, e=0.0, a=0.3), 0.1)
    with pytest.raises(pk.ConvergenceError, match="more than 1000000 times"):
        wheel.poincare(0.1, 1e9, 1e6, section=1.0)


def event(t, phi1, phi, omega1, dphi):
    return dphi


def test_events_have_their_attributes_checked(monkeypatch):
    for name, value in (("terminal", -1), ("terminal", 0.5), ("direction", "up")):
        with monkeypatch.context() as patch:
            patch.setattr(event, name, value, raising=False)
            with pytest.raises(pk.ParameterError, match=rf"^events: got .*{name} = {value!r}"):
                ROTOR.trajectory(0.5, 0.0, (0.0, 1.0), events=event)
    monkeypatch.setattr(event, "terminal", 3, raising=False)
    found = ROTOR.trajectory(0.5, 0.0, (0.0, 9.0), events=event)
    assert found.events.sizes["event"] == 3
    again = pickle.loads(pickle.dumps(found))
    assert again(found.stop).identical(found(found.stop))
