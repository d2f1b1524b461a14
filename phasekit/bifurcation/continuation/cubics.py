"""A path as cubics through its points, with their tangents: where functions are looked at first.

Beside each cubic stands by how much the curve itself lies off its middle.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from phasekit.bifurcation.continuation.curve import Curve
from phasekit.bifurcation.continuation.path import Path, Sample, between

Array = npt.NDArray[np.float64]


@dataclass(frozen=True)
class Parts:
    """Parts of the steps of a path, in order: which step, from where to where in it."""

    step: npt.NDArray[np.int64]
    low: Array
    high: Array

    def take(self, places: Any) -> Parts:
        """Some of them."""
        return Parts(self.step[places], self.low[places], self.high[places])

    def halved(self) -> Parts:
        """Both halves of each."""
        middle = 0.5 * (self.low + self.high)
        return Parts(
            np.repeat(self.step, 2), np.stack([self.low, middle], 1).ravel(),
            np.stack([middle, self.high], 1).ravel(),
        )  # fmt: skip


class Cubics:
    """The steps of a path as functions of s in [0, 1]."""

    def __init__(self, curve: Curve, path: Path) -> None:
        self.curve, self.path, m = curve, path, curve.m
        lengths = np.sqrt(np.sum(path.tangent**2 * curve.weight, axis=1))
        self.u, self.t = path.u[:, :m], path.tangent[:, :m] / lengths[:, None]
        self.length = np.sqrt(np.sum(np.diff(path.u, axis=0) ** 2 * curve.weight, axis=1))
        self.off = _off(curve, path)

    def turns(self, u: Array) -> Array:
        """What brings angles to the turn in which they are shown."""
        period = self.curve.period[: self.curve.m]
        with np.errstate(all="ignore"):
            turns = np.where(period > 0.0, np.ceil(u / period - 0.5), 0.0)
        return np.asarray(turns)

    def turned(self, u: Array, turns: Array) -> Array:
        """Points with their angles brought by so many turns."""
        return np.asarray(u - self.curve.period[: self.curve.m] * turns)

    def points(self, i: npt.NDArray[np.int64], s: Array) -> tuple[Array, Array]:
        """Points on the cubics of steps, and their derivatives by length."""
        h, s = self.length[i][:, None], s[:, None]
        a, b, ta, tb = self.u[i], self.u[i + 1], h * self.t[i], h * self.t[i + 1]
        u = a + s * s * (3.0 - 2.0 * s) * (b - a) + s * (1.0 - s) * ((1.0 - s) * ta - s * tb)
        rate = 6.0 * s * (1.0 - s) * (b - a) + (1.0 - s) * (1.0 - 3.0 * s) * ta
        rate = rate + s * (3.0 * s - 2.0) * tb
        u = u + 16.0 * (s * (1.0 - s)) ** 2 * self.off[i]
        rate = rate + 32.0 * s * (1.0 - s) * (1.0 - 2.0 * s) * self.off[i]
        with np.errstate(all="ignore"):
            rate = np.where(h > 0.0, rate / h, 0.0)
        ends = (s == 0.0, s == 1.0)  # to the last bit
        u = np.where(ends[0], a, np.where(ends[1], b, u))
        return np.asarray(u), np.asarray(rate)

    def hull(self, parts: Parts, turns: Array) -> tuple[Array, Array]:
        """Boxes around parts of the cubics: around the control points of Bezier's form."""
        width = (parts.high - parts.low)[:, None] * self.length[parts.step][:, None]
        (a, ta), (b, tb) = (self.points(parts.step, s) for s in (parts.low, parts.high))
        corners = np.stack([a, a + width * ta / 3.0, b - width * tb / 3.0, b])
        around = np.abs(self.off[parts.step])  # of what is no cubic
        shift = self.curve.period[: self.curve.m] * turns[parts.step]
        low, high = np.min(corners, axis=0), np.max(corners, axis=0)
        return low - shift - around, high - shift + around


def _off(curve: Curve, path: Path) -> Array:
    """By how much the middle of each step lies off the cubic through its ends."""
    found = np.zeros((max(path.count - 1, 0), curve.m))
    for i in range(path.count - 1):
        a, b = (Sample(path.u[k], path.tangent[k], path.slopes[k]) for k in (i, i + 1))
        middle = between(curve, a, b, 0.5)
        if middle is not None:
            chord = b.u - a.u
            ta, tb = (s.tangent / curve.length(s.tangent) for s in (a, b))
            cubic = a.u + 0.5 * chord + 0.125 * curve.length(chord) * (ta - tb)
            found[i] = (middle.u - cubic)[: curve.m]
    return found


def cubic(s: Any, ends: Array, rates: Array, width: Array) -> Array:
    """Values at s in [0, 1] of the cubics with given values and rates at both ends."""
    a, b = ends[:, 0], ends[:, 1]
    ta, tb = width * rates[:, 0], width * rates[:, 1]
    return np.asarray(
        a + s * s * (3.0 - 2.0 * s) * (b - a) + s * (1.0 - s) * ((1.0 - s) * ta - s * tb)
    )
