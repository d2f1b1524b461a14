"""Curves of bifurcations over two parameters, which a page shows as a map."""

from __future__ import annotations

import warnings
from collections.abc import Mapping
from typing import Any

import numpy as np
import numpy.typing as npt

from phasekit.errors import PhasekitError
from phasekit.labelled.continuation.branch import Branch
from phasekit.labelled.continuation.diagram import diagram
from phasekit.systems.problem import Problem

#: Special points of branches that go on as curves, in the order in which they are drawn.
POINTS = ("LP", "BP", "PD", "NS", "H")
#: How near a curve comes to a point that lies on it, in widths of the ranges and of the states.
SAME = 1e-3
#: Kinds of pairs, along a Hopf curve, that are no Hopf points.
NEUTRAL = ("neutral_saddle",)


def bifurcation_curves(
    problem: Problem,
    pair: tuple[str, str],
    ranges: Mapping[str, tuple[float, float]],
    rests: npt.NDArray[np.float64],
) -> dict[str, Any]:
    """Follow the branches of equilibria in the first parameter, and their special points in both.

    Branches start from the equilibria ``rests``, shape (count, states). JSON can hold the result:
    ``curves`` (kind and points), ``points`` of codimension two, and in words what is ``missing``.

    >>> import phasekit as pk
    >>> import numpy as np
    >>> cusp = pk.Problem("m + l*x - x^3", "x", {"m": 0.0, "l": 1.0})
    >>> found = bifurcation_curves(cusp, ("m", "l"), {"m": (-1, 1), "l": (-1, 2)}, np.zeros((1, 1)))
    >>> [curve["kind"] for curve in found["curves"]], [one["kind"] for one in found["points"]]
    (['fold'], ['cusp'])
    """
    first, second = pair
    curves: list[Branch] = []
    missing: list[str] = []
    with warnings.catch_warnings(record=True) as caught, np.errstate(all="ignore"):
        warnings.simplefilter("always")
        try:
            span = ranges[first]
            branches = (
                diagram(problem, first, x0=rests, span=span, cycles=False) if len(rests) else ()
            )
        except PhasekitError as error:
            branches = ()
            missing.append(f"no branch of equilibria was followed: {error}")
        for label in POINTS:
            for point in (one for branch in branches for one in _special(branch, label)):
                if any(_passes(one, point, ranges, problem.state) for one in curves):
                    continue
                try:
                    curves.append(point.curve(second, ranges[second]))
                except PhasekitError as error:
                    missing.append(f"the curve from {first} = {point[first]:.6g}: {error}")
    missing += [str(one.message) for one in caught if issubclass(one.category, RuntimeWarning)]
    if not len(rests):
        missing.append("no equilibrium was found at the first values, so that no branch starts")
    return {
        "x": first,
        "y": second,
        "curves": [drawn for one in curves for drawn in _drawn(one, first, second)],
        "points": [drawn for one in curves for drawn in _marked(one, first, second)],
        "missing": list(dict.fromkeys(" ".join(text.split()) for text in missing)),
    }


def _special(branch: Branch, label: str) -> tuple[Any, ...]:
    try:
        return branch.special(label)
    except PhasekitError:  # a label that these branches have not
        return ()


def _passes(
    curve: Branch, point: Any, ranges: Mapping[str, tuple[float, float]], states: tuple[str, ...]
) -> bool:
    """Whether a curve was drawn through a special point before; else it is drawn twice."""
    if curve.kind != point.kind:
        return False
    rows = []
    for name in (*ranges, *states):
        values = curve.points[name].values
        low, high = ranges.get(name, (values.min(), values.max()))
        rows.append((values - point[name]) / (high - low or 1.0))
    gap = np.array(rows).T
    chord = np.diff(gap, axis=0)
    square = np.maximum(np.sum(chord**2, axis=1), 1e-300)
    along = np.clip(-np.sum(chord * gap[:-1], axis=1) / square, 0.0, 1.0)
    return bool(np.min(np.linalg.norm(gap[:-1] + along[:, None] * chord, axis=1)) < SAME)


def _drawn(curve: Branch, first: str, second: str) -> list[dict[str, Any]]:
    """A curve in pieces of one kind."""
    points = curve.points
    steps = np.column_stack([points[first].values, points[second].values])
    kind = str(curve.kind)
    kinds = np.array([kind] * len(steps), dtype=object)
    if "kind_of_pair" in points:
        kinds = np.array([str(name) or kind for name in points.kind_of_pair.values], dtype=object)
    found, start = [], 0
    for stop in range(1, len(steps) + 1):
        if stop == len(steps) or kinds[stop] != kinds[start]:
            if kinds[start] not in NEUTRAL:
                piece = steps[max(start - 1, 0) : stop + 1]
                found.append({"kind": kinds[start], "points": piece.tolist()})
            start = stop
    return found


def _marked(curve: Branch, first: str, second: str) -> list[dict[str, Any]]:
    return [
        {"kind": str(point.kind), "x": float(point[first]), "y": float(point[second])}
        for point in curve.special_points
        if point.kind not in ("end", "neutral_saddle")
    ]
