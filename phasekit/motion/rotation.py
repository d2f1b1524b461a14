"""The rotation of a damped law that does not vary: its speed at an angle is that a turn later."""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np

from phasekit.arrays import Array
from phasekit.laws.perturbed import PerturbedConservative
from phasekit.motion.equation_rates import pointwise
from phasekit.motion.flow import accelerations, motions
from phasekit.motion.method import circle, unit_of
from phasekit.motion.stiff import follow

#: Steps of time along a turn.
DENSE = 4096
#: Damping times duration from which on a motion is followed by the implicit method.
STIFF = 1e6
RTOL, ATOL, COARSE = 1e-12, 1e-13, 1e-9
#: Steps of Newton's method, and the change of the speed at which it ends.
STEPS, ENOUGH = 60, 1e-11
#: A multiplier below which a turn makes the start forgotten, and the change that then may be left.
FORGETS = 1e-6
#: Part of its greatest speed at which a motion has come to rest.
STILL = 1e-9
#: Parts of the speed of the rotation at which lesser turns are tried to begin.
PARTS = (0.001, 0.01, 0.03, 0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9, 0.95, 0.99, 0.999)


class Turn(NamedTuple):
    """A motion through one turn, or a little more."""

    t: Array
    phi: Array
    dphi: Array
    bend: Array
    """Rates of the rate."""
    time: float
    """Of the turn."""
    last: float
    """Rate at its end."""
    multiplier: float
    """Derivative of the rate at the end by that at the start."""

    def states(self, times: Array) -> Array:
        """States at times within the turn."""
        from scipy.interpolate import CubicHermiteSpline

        phi = CubicHermiteSpline(self.t, self.phi, self.dphi)(times)
        return np.stack([phi, CubicHermiteSpline(self.t, self.dphi, self.bend)(times)], axis=-1)

    def rates(self, count: int) -> Array:
        """Speeds at equal distances along the turn, in the order of the coordinate."""
        from scipy.interpolate import CubicHermiteSpline

        sense = np.sign(self.dphi[0])
        way, speed = sense * (self.phi - self.phi[0]), np.abs(self.dphi)
        slope = sense * self.bend / speed
        inside = np.linspace(0.0, np.abs(self.turn), count)
        found = CubicHermiteSpline(way, speed, slope)(inside)
        return np.asarray(found if sense > 0.0 else found[::-1])

    @property
    def turn(self) -> float:
        """What the coordinate grew by in the time of the turn."""
        return float(self.states(np.array([self.time]))[0, 0] - self.phi[0])


def through(
    law: PerturbedConservative,
    values: Mapping[str, Array],
    phi: float,
    dphi: float,
    guess: float = np.inf,
) -> Turn | None:
    """Follow a motion through one turn, of some duration; None where it turns back before."""
    turn, sense = circle(law), np.sign(dphi)
    span = 1.25 * min(turn / abs(dphi), guess)
    for _ in range(60):
        t = np.linspace(0.0, span, DENSE + 1)
        states = _states(law, values, np.array([phi, dphi]), t)
        ahead = sense * states[:, 1] > 0.0
        done = np.flatnonzero(sense * (states[:, 0] - phi) >= turn)
        upto = int(done[0]) if done.size else DENSE
        fast = np.abs(states[:, 1])
        if not ahead[: upto + 1].all() or not done.size and fast[-1] < STILL * fast.max():
            return None
        if done.size and upto >= DENSE // 8:
            break
        span = t[upto] * 1.25 if done.size else 2.0 * span
    else:
        return None
    phis, rates = states[: upto + 1].T
    bends = accelerations(law, values, 0.0, phis, rates)
    end = _arrival(t[upto - 1 : upto + 1], phis[-2:], rates[-2:], phi + sense * turn)
    found = Turn(t[: upto + 1], phis, rates, bends, end, 0.0, 0.0)
    last = float(found.states(np.array([end]))[0, 1])
    speed = 1e-3 * np.abs(rates)
    less = accelerations(law, values, 0.0, phis, rates - speed)
    more = accelerations(law, values, 0.0, phis, rates + speed)
    fade = _integral(found.t, (more - less) / (2.0 * speed), end)
    return found._replace(last=last, multiplier=float(np.exp(fade) * dphi / last))


def _integral(t: Array, values: Array, end: float) -> float:
    """Integral of a smooth function from the first time to another."""
    from scipy.interpolate import CubicSpline

    return float(CubicSpline(t, values).integrate(t[0], end))


def _states(
    law: PerturbedConservative, values: Mapping[str, Array], state: Array, t: Array
) -> Array:
    """States of one motion at times from 0 on; NaN where it does not come to them."""
    if float(values["damping"]) * t[-1] > STIFF and float(values["quadratic"]) == 0.0:
        how = {"rtol": COARSE, "atol": ATOL, "unit": unit_of(law)}
        found = follow(pointwise(law, values, t), state, t, **how)
        if np.isfinite(found).all():
            return found
    cell = law, values, state[None], t[None]
    return np.asarray(motions(*cell, RTOL, ATOL, method="dop853").states[0])


def _arrival(t: Array, phi: Array, dphi: Array, level: float) -> float:
    """Time at which a cubic with these ends and slopes comes to a level."""
    from scipy.interpolate import CubicHermiteSpline

    curve = CubicHermiteSpline(t, phi, dphi)
    low, high = float(t[0]), float(t[1])
    sense = np.sign(dphi[0])
    for _ in range(80):
        middle = 0.5 * (low + high)
        if sense * (curve(middle) - level) >= 0.0:
            high = middle
        else:
            low = middle
    return 0.5 * (low + high)


def rotation(law: PerturbedConservative, values: Mapping[str, Array], state: Array) -> Turn | None:
    """The rotation to which a motion may come, by Newton's method; None where it comes to none."""
    phi, dphi = map(float, state)
    now = through(law, values, phi, dphi)
    for _ in range(STEPS):
        if now is None:
            return None
        off = now.last - now.dphi[0]
        slack = 1.0 - now.multiplier if now.multiplier < 1.0 else 1.0
        step = off / slack
        enough = ENOUGH + RTOL / slack if now.multiplier > FORGETS else FORGETS
        if abs(step) <= enough * abs(now.dphi[0]):
            break
        now = _stepped(law, values, now, step)
    else:
        return None
    if not now.multiplier < 1.0:
        return None
    slow = int(np.argmin(np.abs(now.dphi)))
    from_there = through(law, values, float(now.phi[slow]), float(now.dphi[slow]))
    return from_there


def _stepped(
    law: PerturbedConservative, values: Mapping[str, Array], now: Turn, step: float
) -> Turn | None:
    """The turn from a speed that is so much greater, or by a part where that is none."""
    for part in range(40):
        speed = float(now.dphi[0]) + 0.5**part * step
        if speed * now.dphi[0] > 0.0:
            found = through(law, values, float(now.phi[0]), speed)
            if found is not None:
                return found
    return None


def slowest(law: PerturbedConservative, values: Mapping[str, Array], spun: Turn) -> Turn:
    """A turn from the slowest of some starts from which one is completed."""
    phi, top = float(spun.phi[0]), float(spun.dphi[0])
    for part in PARTS:
        found = through(law, values, phi, part * top, spun.time)
        if found is not None and abs(found.last) >= part * abs(top):
            return found
    return spun
