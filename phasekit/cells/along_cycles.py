"""Families of periodic orbits from the Hopf points of one cell: where they are, and how long."""

from __future__ import annotations

from collections.abc import Iterable
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from phasekit.bifurcation.continuation.curve import Curve
from phasekit.bifurcation.continuation.options import ContinuationOptions
from phasekit.bifurcation.continuation.points.special import CONVERGED, Special
from phasekit.bifurcation.continuation.stops import Stop
from phasekit.bifurcation.continuation.walk import run, search
from phasekit.cycles import collocation
from phasekit.cycles.cycle_walk import CycleWalk
from phasekit.cycles.stable_spans import stable_cycles
from phasekit.systems.cycle_families import hopf_families, hopf_family
from phasekit.systems.problem import Problem

Array = npt.NDArray[np.float64]

SAME = 1e-4  # part of a span within which a family ends at a Hopf point
UNFINISHED = ("max_points", "stuck", "not_finite")


class CycleFamily(NamedTuple):
    """A family of periodic orbits: rows (least, greatest), and the spans where it is stable."""

    extent: Array
    period: Array
    states: Array  # a row each
    stable: Array
    finished: bool


def families_of(
    problem: Problem, points: Iterable[tuple[Curve, Special]], options: ContinuationOptions
) -> list[CycleFamily]:
    """The families that begin at Hopf points, each once, though it may end at another of them.

    Raises
    ------
    ConvergenceError
        If no orbit is found next to a Hopf point.
    """
    found: list[CycleFamily] = []
    ended: list[tuple[float, Array]] = []
    for curve, special in points:
        if special.kind != "hopf" or special.status != CONVERGED:
            continue
        n, m = curve.n, curve.m
        p, width = float(special.u[n]), float(curve.high[n] - curve.low[n])
        gaps = (
            max(abs(at - p) / width, float(np.max(np.abs(x - special.u[:n]) / curve.scale[:n])))
            for at, x in ended
        )
        if any(gap < SAME for gap in gaps):
            continue
        for family in hopf_families(curve, special.u[:m])[0]:
            cycles, start = hopf_family(problem, curve, special, family, options)
            walker = CycleWalk(cycles)
            tracks = (None, run(walker, start, "forward")[1])
            path, specials, _ = search(walker, start, tracks, Stop("hopf", ""))
            orbits = [one.orbit for one in path.points]
            orbits += [one.point.orbit for one in specials if one.kind != "end"]
            extremes = np.array([collocation.extremes(one.x, cycles.m) for one in orbits])
            stop = path.stops[1]
            if stop.reason == "hopf":
                last = orbits[path.count - 1]
                ended.append((float(last.y[1]), collocation.mean(last.mesh, last.x, cycles.m)))
            values = np.array([p, *(one.y[1] for one in orbits)])
            periods = np.array([2.0 * np.pi / family.omega, *(one.y[0] for one in orbits)])
            states = np.column_stack([extremes[:, 0].min(axis=0), extremes[:, 1].max(axis=0)])
            found.append(CycleFamily(
                np.array([values.min(), values.max()]), np.array([periods.min(), periods.max()]),
                states, stable_cycles(cycles, path, specials, p), stop.reason not in UNFINISHED,
            ))  # fmt: skip
    return found
