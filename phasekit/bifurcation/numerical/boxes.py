"""Points of a line of parameters that are found in boxes: zeros of V' and of its derivatives."""

from __future__ import annotations

import functools
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from phasekit.arrays import Array
from phasekit.bifurcation.numerical.line import Line, terms_of
from phasekit.numerics.intervals.bounds import Bounds
from phasekit.numerics.intervals.zeros import Zeros, zeros_in_box
from phasekit.phase.numerical.formula import Formula

#: Corners (x, place) of boxes, one a row.
Boxes = tuple[Array, Array]


@dataclass(frozen=True)
class Merger:
    """A point of a line where equilibria merge, cross or leave.

    Attributes
    ----------
    at, x : float
        Place on the line, and coordinate.
    kind : str
        fold, pitchfork or transcritical; branch_point where it is not decided; exit, at an end of
        the interval or, with an infinite x, of the line.
    error : float
        Bound of the error of the place: half of the width of what is not decided; an estimate where
        nothing is proved.
    reach : float
        Half of the width in x of what is not decided.
    """

    at: float
    x: float
    kind: str
    error: float
    reach: float = 0.0


def folds(line: Line, box: Zeros) -> list[Merger]:
    """Zeros of V' and V'' as folds, with what rounding may have moved them by."""
    error = np.maximum(box.zeros - box.boxes[0], box.boxes[1] - box.zeros)
    return [
        Merger(float(s), float(x), "fold", float(off))
        for (x, s), off in zip(box.zeros, error[:, 1], strict=True)
    ]


def zeros_along(line: Line, f: Any, x: float) -> tuple[list[tuple[float, float]], list[Boxes]]:
    """Zeros along a line of a formula without x, with errors; what is undecided as boxes at x."""
    terms, (low, high) = line.terms, line.span
    if not f.has(terms.s):
        return [], []
    box = zeros_in_box([f], [terms.s], line.numbers, [low], [high])
    lost = [np.column_stack([np.full(len(ends), x), ends]) for ends in box.undecided]
    error = np.maximum(box.zeros - box.boxes[0], box.boxes[1] - box.zeros)
    found = list(zip(box.zeros[:, 0].tolist(), error[:, 0].tolist(), strict=True))
    return found, [] if box.complete else [(lost[0], lost[1])]


def exact(value: float) -> Any:
    """A double as the fraction that it is."""
    import sympy as sp

    return sp.Rational(*value.as_integer_ratio())


@functools.lru_cache(maxsize=256)
def bounds_of(
    formula: Formula, moving: tuple[str, ...], orders: tuple[tuple[int, int], ...]
) -> Bounds:
    """Bounds of derivatives of V, so often by x and by the place on a line."""
    terms = terms_of(formula, moving)
    return Bounds(
        [terms.derivative(*order) for order in orders], [terms.x, terms.s, *terms.parameters]
    )


def enclosed(bounds: Any, columns: Sequence[Any], numbers: Mapping[Any, float]) -> Any:
    """Bounds of formulas over boxes, by their columns of ends."""
    return bounds(*columns, *((value, value) for value in numbers.values()))
