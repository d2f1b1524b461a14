"""A traced curve of many states as one path, and points of it between its points."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any, ClassVar

import numpy as np

from phasekit.arrays import Array
from phasekit.bifurcation.continuation.kernels import trace
from phasekit.bifurcation.continuation.large.curve import Corrected, Held, LargeCurve, Track
from phasekit.bifurcation.continuation.walk import Path, Stop, stops_of
from phasekit.numerics.factors import inner


@dataclass(frozen=True)
class LargePath(Path):
    """Points in order, with step data and what changes its sign at special points."""

    u: Array
    info: Array
    tests: Array
    residual: Array
    start: int
    stops: tuple[Stop, Stop]
    ends: tuple[Any, Any] = (None, None)
    rows: ClassVar[tuple[str, ...]] = ("u", "info", "tests", "residual")


def join(start: Corrected, own: Array, backward: Track | None, forward: Track | None) -> LargePath:
    """One path of two tracks from a start, whose own tests are given; it stands between them."""
    parts: list[tuple[Array, Array, Array, Array]] = []
    if backward is not None:
        info, tests = backward.info[::-1].copy(), backward.tests[::-1].copy()
        info[:, trace.ARCLENGTH] *= -1.0
        tests[:, :2] *= -1.0  # the tangent points the other way
        parts.append((backward.u[::-1], info, tests, backward.residual[::-1]))
    behind = 0 if backward is None else backward.count
    parts.append((
        start.u[None], np.zeros((1, trace.RECORDED)), own[None], np.array([start.residual])
    ))  # fmt: skip
    if forward is not None:
        parts.append((forward.u, forward.info, forward.tests, forward.residual))
    u, info, tests, residual = (np.concatenate(one) for one in zip(*parts, strict=True))
    return LargePath(u, info, tests, residual, behind, stops_of((backward, forward)))


class Between:
    """Points of a curve between two of its points, by how far along the chord they are."""

    def __init__(self, curve: LargeCurve, a: Array, b: Array) -> None:
        self.curve, self.a, self.chord = curve, a, b - a
        self.row = curve.weight * self.chord
        self.length = curve.length(self.chord)
        self._ends: tuple[Array, Array] | None = None
        self._seen: dict[float, Corrected | None] = {}

    def point(self, s: float) -> Corrected | None:
        """The point at a fraction of the chord, its tangent along it; None if it is not found."""
        if s not in self._seen:
            self._seen[s] = self._found(s)
        return self._seen[s]

    def _found(self, s: float) -> Corrected | None:
        guess = self.a + s * self.chord
        if 0.0 < s < 1.0:
            one, two = self.point(0.0), self.point(1.0)
            if one is not None and two is not None:  # the cubic with the tangents of both ends
                a, b = one.tangent, two.tangent
                bend = (1.0 - s) * (a - self.part(a) * self.chord)
                bend = bend - s * (b - self.part(b) * self.chord)
                guess = guess + self.length * s * (1.0 - s) * bend
        target = float(inner(self.row, self.a)) + s * float(inner(self.row, self.chord))
        point = self._corrected(guess, target, None)
        if point is None:
            held = self.curve.unknown(guess, self.row, self.curve.weight)
            point = None if held is None else self._corrected(guess, target, held)
        if point is None:
            return None
        return replace(point, bordered=None)  # factors of many points would fill the memory

    def _corrected(self, guess: Array, target: float, held: Held | None) -> Corrected | None:
        """The point next to a guess; None if there is none."""
        point = self.curve.correct(guess, self.row, target, self.curve.scale, 20, held)
        far = isinstance(point, int) or self.curve.length(point.u - guess) > self.length
        return None if far else point  # type: ignore[return-value]

    def part(self, t: Array) -> float:
        """The part of a vector along the chord, in units of it."""
        return float(inner(self.row, t)) / float(inner(self.row, self.chord))
