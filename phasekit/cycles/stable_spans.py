"""Where along its parameter curves of equilibria are stable, and where several are at once."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from itertools import pairwise

import numpy as np
import numpy.typing as npt

from phasekit.arrays import Array
from phasekit.bifurcation.continuation.connected import Traced
from phasekit.cycles.cycles import Cycles
from phasekit.cycles.family import Found
from phasekit.cycles.family import Path as CyclePath
from phasekit.cycles.point import critical_count


def stable_spans(one: Traced) -> Array:
    """Spans of the parameter over which a curve is stable, rows (low, high).

    Between special points stability does not change, and the parameter does not turn back.
    """
    curve, path, n = one.curve, one.path, one.curve.n
    every = sorted((*one.placed, *path.outside), key=lambda placed: (placed.index, placed.along))
    breaks = [placed for placed in every if placed.kind != "neutral_saddle"]
    values = path.eigenvalues
    assert values is not None
    growth = curve.growth(values)
    worst = np.max(growth, axis=1)
    places = [-1, *(placed.index for placed in breaks), path.count - 1]
    ends = [path.u[0], *(placed.special.u for placed in breaks), path.u[-1]]

    def stable(inside: npt.NDArray[np.int64], p: Array, q: Array) -> bool:
        if not len(inside):
            return _middle(one, p[: curve.m], q[: curve.m]) < 0.0
        # Where the least eigenvalue is farthest from zero, the sign is sure.
        sure = inside[np.argmax(np.min(np.abs(growth[inside]), axis=1))]
        return bool(worst[sure] < 0.0)

    return _joined(places, [(float(u[n]), u) for u in ends], stable)


def stable_cycles(
    cycles: Cycles, path: CyclePath, specials: Sequence[Found], first: float,
    end: float | None = None,
) -> Array:  # fmt: skip
    """Spans of the parameter over which a family of periodic orbits is stable, from its first.

    To its last orbit or, where the orbits shrink to a point, to the value at its ``end``.
    """
    breaks = [found for found in specials if found.kind not in ("end", "event")]
    places = [-1, *(found.index for found in breaks), path.count - 1]
    last = float(path.points[-1].orbit.y[1]) if end is None else end
    ends = [first, *(float(found.point.orbit.y[1]) for found in breaks), last]

    def stable(inside: npt.NDArray[np.int64], p: Array, q: Array) -> bool:
        known = [critical_count(path.points[i], cycles.forced) for i in inside]
        known = [number for number in known if number >= 0]
        return bool(known) and known[len(known) // 2] == 0

    return _joined(places, [(p, np.empty(0)) for p in ends], stable)


def _joined(
    places: Sequence[int], ends: Sequence[tuple[float, Array]],
    stable: Callable[[npt.NDArray[np.int64], Array, Array], bool],
) -> Array:  # fmt: skip
    """Spans between neighbouring special points, with the points inside, that are stable."""
    found = []
    for (a, b), ((low, p), (high, q)) in zip(pairwise(places), pairwise(ends), strict=True):
        if stable(np.arange(a + 1, b + 1), p, q):
            found.append([min(low, high), max(low, high)])
    return np.array(found).reshape(-1, 2)


def _middle(one: Traced, p: Array, q: Array) -> float:
    """The largest growth halfway between two special points; NaN where it is not found."""
    curve = one.curve
    point = curve.refine(0.5 * (p + q), curve.weight[: curve.m] * (q - p))
    if not point.converged:
        return np.nan
    return float(
        np.max(curve.growth(np.linalg.eigvals(curve.linear(point.slopes)).astype(complex)))
    )


def overlaps(spans: Array, least: int) -> Array:
    """Where at least so many of several spans (rows) hold at once, merged where they touch."""
    found: list[list[float]] = []
    for a, b, count in _counted(spans):
        if count >= least:
            if found and found[-1][1] == a:
                found[-1][1] = b
            else:
                found.append([a, b])
    return np.array(found).reshape(-1, 2)


def most(spans: Array) -> int:
    """How many spans hold at one value, at most."""
    return max((count for *_, count in _counted(spans)), default=0)


def _counted(spans: Array) -> list[tuple[float, float, int]]:
    """Between neighbouring ends of spans, how many hold."""
    rows = [(low, high) for low, high in spans.tolist() if low < high]
    marks = sorted({end for row in rows for end in row})
    return [(a, b, sum(low <= a and b <= high for low, high in rows)) for a, b in pairwise(marks)]
