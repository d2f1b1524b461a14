"""All special points of a path, in order and once each."""

from __future__ import annotations

from dataclasses import replace
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from phasekit.bifurcation.continuation.acceptance import rounded
from phasekit.bifurcation.continuation.curve import Curve
from phasekit.bifurcation.continuation.events import Bracket, brackets
from phasekit.bifurcation.continuation.kernels.defining import EQUILIBRIUM
from phasekit.bifurcation.continuation.locate import locate
from phasekit.bifurcation.continuation.path import Path
from phasekit.bifurcation.continuation.placed import SAME, Placed, _distance, inside, unique
from phasekit.bifurcation.continuation.points.event import events_of
from phasekit.bifurcation.continuation.points.special import Special
from phasekit.bifurcation.continuation.two_parameters import find_on
from phasekit.bifurcation.special_points import KINDS

Array = npt.NDArray[np.float64]


class Specials(NamedTuple):
    """Special points of a path in order, the eigenvalues of f_x at its points, and doubts."""

    placed: list[Placed]
    eigenvalues: npt.NDArray[np.complex128]
    messages: tuple[str, ...]


def find(curve: Curve, path: Path) -> Specials:
    """Special points of a path, those that the curve is asked for."""
    with np.errstate(all="ignore"):
        placed, eigenvalues = _find(curve, path)
        events, messages = events_of(curve, path) if curve.events else ([], ())
    every = sorted([*placed, *events], key=lambda one: (one.index, one.along))
    return Specials(every, eigenvalues, messages)


def _find(curve: Curve, path: Path) -> tuple[list[Placed], npt.NDArray[np.complex128]]:
    if curve.kind != EQUILIBRIUM:
        assert path.eigenvalues is not None
        return find_on(curve, path), path.eigenvalues
    detect = curve.options.detect
    if not detect:
        if path.eigenvalues is None:  # nothing is asked for that takes long
            return [], np.full((path.count, curve.n), np.nan, dtype=complex)
        return [], path.eigenvalues
    found, eigenvalues = brackets(curve, path, detect, curve.conservative)
    placed: list[Placed] = []
    for bracket in found:
        for special in locate(curve, bracket):
            if not wanted(special, detect):
                continue
            placed.append(place(curve, path, bracket, _rounded(curve, special)))
    placed = unique(curve, path, placed)
    # The start of a closed curve is its end as well.
    if path.closed and len(placed) > 1:
        first, last = placed[0], placed[-1]
        if first.special.kind == last.special.kind and _distance(curve, first, last) < SAME:
            placed = placed[:-1]
    return placed, eigenvalues


def _rounded(curve: Curve, special: Special) -> Special:
    """A special point with zeros for unknowns that are but rounding, where f is no larger there."""
    return replace(special, u=rounded(curve, special.u))


def wanted(special: Special, detect: tuple[str, ...]) -> bool:
    """Whether a kind was asked for."""
    return KINDS[special.kind].detected in (None, *detect)


def place(curve: Curve, path: Path, bracket: Bracket, special: Special) -> Placed:
    """Where on the path a special point stands."""
    first = None
    # A bracket may hold points that lie too near to a branch point to say anything.
    for i in range(bracket.index, min(bracket.index + 8, path.count - 1)):
        chord = path.u[i + 1] - path.u[i]
        gap = np.zeros(curve.size)
        gap[: curve.m] = special.u[: curve.m] - path.u[i, : curve.m]
        square = float(np.dot(curve.weight * chord, chord))
        along = float(np.dot(curve.weight * chord, gap)) / square if square else 0.0
        one = Placed(i, along, special)
        first = one if first is None else first
        if inside(one):
            return one
    assert first is not None
    return first
