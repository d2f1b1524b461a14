"""Families of periodic orbits from the Hopf points of one cell: where they are, and how long."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from phasekit.bifurcation.continuation.curve import Curve
from phasekit.bifurcation.continuation.options import ContinuationOptions
from phasekit.bifurcation.continuation.points.hopf_families import Family
from phasekit.bifurcation.continuation.points.special import CONVERGED, Special
from phasekit.bifurcation.continuation.walk import Stop, run, search
from phasekit.cycles import collocation
from phasekit.cycles.cycle_walk import CycleWalk
from phasekit.cycles.cycles import Cycles, Orbit
from phasekit.cycles.stable_spans import stable_cycles
from phasekit.errors import ConvergenceError
from phasekit.systems.cycle_families import hopf_families, hopf_family
from phasekit.systems.problem import Problem

Array = npt.NDArray[np.float64]

#: How near a Hopf point a family ends that shrinks to it, on scaled axes and in the period.
NEAR = 1e-2
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
) -> tuple[list[CycleFamily], bool]:
    """The families that begin at Hopf points, each once, and whether any could not be followed.

    A family may end at another of the Hopf points, and does not begin there again.
    """
    hopf = [(curve, one) for curve, one in points if one.kind == "hopf"]
    found: list[CycleFamily] = []
    ended: set[int] = set()
    cut = any(special.status != CONVERGED for _, special in hopf)
    for k, (curve, special) in enumerate(hopf):
        if special.status != CONVERGED or k in ended:
            continue
        for family in hopf_families(curve, special.u[: curve.m])[0]:
            try:
                one, end = _followed(problem, hopf, k, family, options)
            except (ConvergenceError, np.linalg.LinAlgError):
                cut = True
                continue
            found.append(one)
            ended.add(end)
    return found, cut


def _followed(
    problem: Problem, hopf: Sequence[tuple[Curve, Special]], begins: int, family: Family,
    options: ContinuationOptions,
) -> tuple[CycleFamily, int]:  # fmt: skip
    """One family, and the place of the Hopf point at which it ends; -1: at none of these."""
    curve, special = hopf[begins]
    n = curve.n
    cycles, start = hopf_family(problem, curve, special, family, options)
    walker = CycleWalk(cycles)
    tracks = run(walker, start, "forward")
    path, specials, _ = search(walker, start, tracks, Stop("hopf", ""))
    orbits = [one.orbit for one in path.points]
    last, stop = orbits[path.count - 1], path.stops[1]
    orbits += [one.point.orbit for one in specials if one.kind != "end"]
    extremes = np.array([collocation.extremes(one.x, cycles.m) for one in orbits])
    end = _ends_at(cycles, last, hopf, begins) if stop.reason == "hopf" else -1
    ends = [float(hopf[k][1].u[n]) for k in (begins, end) if k >= 0]
    values = np.array([*ends, *(one.y[1] for one in orbits)])
    periods = np.array([2.0 * np.pi / family.omega, *(one.y[0] for one in orbits)])
    states = np.column_stack([extremes[:, 0].min(axis=0), extremes[:, 1].max(axis=0)])
    found = CycleFamily(
        np.array([values.min(), values.max()]), np.array([periods.min(), periods.max()]),
        states, stable_cycles(cycles, path, specials, *ends), stop.reason not in UNFINISHED,
    )  # fmt: skip
    return found, end


def _ends_at(
    cycles: Cycles, last: Orbit, hopf: Sequence[tuple[Curve, Special]], begins: int
) -> int:
    """The place of the Hopf point that the last orbit of a family surrounds; -1: none of these.

    The nearest one, no farther than the orbit is large: it stands next to the point, not on it.
    """
    curve = hopf[begins][0]
    n = curve.n
    scale = np.append(curve.scale[:n], curve.high[n] - curve.low[n])
    low, high = collocation.extremes(last.x, cycles.m)
    reach = max(NEAR, float(np.max((high - low) / scale[:n])))
    middle = np.append(collocation.mean(last.mesh, last.x, cycles.m), last.y[1])
    gaps = [
        np.inf
        if k == begins
        else max(
            float(np.max(np.abs(one.u[: n + 1] - middle) / scale)),
            abs(float(last.y[0]) * one.normal_form["omega"] / (2.0 * np.pi) - 1.0),
        )
        for k, (_, one) in enumerate(hopf)
    ]
    nearest = int(np.argmin(gaps))
    return nearest if gaps[nearest] <= reach else -1
