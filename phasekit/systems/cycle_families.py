"""Families of periodic orbits of a problem, and those that begin at its Hopf points."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from phasekit.arrays import Array
from phasekit.bifurcation.continuation.curve import Curve
from phasekit.bifurcation.continuation.fields import SymbolicField
from phasekit.bifurcation.continuation.large.field import SparseField
from phasekit.bifurcation.continuation.options import ContinuationOptions
from phasekit.bifurcation.continuation.points.hopf_families import Family, critical_pairs, families
from phasekit.bifurcation.continuation.points.special import Special
from phasekit.cycles import adapt, starts
from phasekit.cycles.cycles import Cycles, Solution
from phasekit.cycles.point import Point, point_of
from phasekit.cycles.sparse import FORMED, SPARSE
from phasekit.errors import ConvergenceError
from phasekit.labels.arguments import bad
from phasekit.numerics.factors import NUMBER, entries_of
from phasekit.numerics.memory import ALWAYS, human, room_short_of
from phasekit.systems.problem import Problem

FIRST = 2 * adapt.LEAST  # intervals of the coarsest first mesh
PRODUCTS = 5  # matrices an interval of the elimination and of the products of multipliers


def cycles_of(
    problem: Problem,
    free: Sequence[str],
    spans: Sequence[tuple[float, float]],
    scale: Array,
    turns: Array,
    options: ContinuationOptions,
    multiple: int = 1,
    holds: tuple[Any, ...] = (),
) -> Cycles:
    """The periodic orbits of a problem over some of its parameters."""
    refuse_states(problem, options)
    names = list(problem.parameters)
    active = tuple(names.index(name) for name in free)
    par = np.array(list(problem.parameters.values()))
    forced = problem.time is not None
    period = np.array([problem.periods.get(name, 0.0) for name in problem.state])
    scale = np.where(period > 0.0, period / (2.0 * np.pi), scale)
    for i, name in enumerate(problem.state):
        scale[i] = options.scales.get(name, scale[i])
    low, high = np.array(spans, dtype=float).T
    return Cycles(
        problem.field, np.append(par, 0.0) if forced else par, active, forced,
        clock_code(problem, active), multiple, turns, scale, high - low, low, high, period,
        options, holds,
    )  # fmt: skip


def refuse_states(problem: Problem, options: ContinuationOptions) -> None:
    """Refuse orbits whose equations on a first mesh no memory would hold, before any work."""
    n, m = len(problem.state), options.degree
    count = options.intervals or FIRST
    # Matrices of n x n an interval: derivatives, condensed equations, their elimination, products.
    needed = 8 * n * n * count * (2 * m + PRODUCTS)
    if needed <= ALWAYS:
        return
    field = problem.field
    if n > FORMED and isinstance(field, SparseField):
        start = np.array([problem.start.get(name, 0.0) for name in problem.state])
        matrix = field.matrix(start, problem.parameters)
        if matrix.nnz < SPARSE * n * n:
            needed = NUMBER * m * m * entries_of(matrix) * count
    room = room_short_of(needed)
    if room is not None:
        most = int(n * math.sqrt(room / needed))
        raise bad(
            "state", n, f"at most {most:,} states for periodic orbits on {count} intervals",
            f"equations of one would take {human(needed)}, {human(room)} are "
            "free; ContinuationOptions(intervals=..., degree=...) of fewer take less",
        )  # fmt: skip


def clock_code(problem: Problem, active: tuple[int, ...]) -> int:
    """Machine code of the period of the forcing, with its derivatives; 0 without forcing."""
    if problem.time is None:
        return 0
    field = SymbolicField((problem.period,), (), (*problem.parameters, problem.time))
    return field.first(active)


def first_point(cycles: Cycles, found: Solution, where: str) -> Point:
    """The point at which a family begins."""
    if not found.converged:
        what = "periodic orbit" if cycles.closes else "solution"
        raise ConvergenceError(f"no {what} was found {where}: {found.message}")
    return point_of(cycles, found, 0.0, 0.0)


def grown(scale: Array, q: Array, form: Mapping[str, float], width: float) -> Array:
    """Sizes of the states at rest or, where they are larger, of the orbits from a Hopf point.

    A state may rest next to zero and swing all the more. By the normal form the amplitudes are
    ``2 |q| sqrt(d width/(omega |l1|))``. They are less where l1 is small, so that this only brings
    the sizes in line with each other: it ends where no state would swing by less than its size.
    """
    with np.errstate(all="ignore"):
        swing = 2.0 * np.sqrt(np.abs(np.divide(form["d"] * width, form["omega"] * form["l1"])))
        most = np.max(scale / q)
    swing = np.fmin(swing, most)
    return np.maximum(scale, swing * q) if np.isfinite(swing) else scale.copy()


def hopf_families(curve: Curve, u: Array) -> tuple[list[Family], list[str]]:
    """The families at a Hopf point, and of several what is to be said."""
    values, vectors = np.linalg.eig(curve.evaluate(u)[1][:, : curve.n])
    pairs = np.flatnonzero(values.imag > 0.0)
    if not len(pairs):
        raise bad("point", "no pair of complex eigenvalues", "a Hopf point that has converged")
    critical = len(critical_pairs(values))
    if critical < 2:
        k = pairs[np.argmin(np.abs(values.real[pairs]))]
        return [Family(float(values.imag[k]), vectors[:, k], (0.0, 0.0))], []
    found, said = families(curve, u)
    together = f"{critical} pairs of eigenvalues are on the imaginary axis"
    if len(found) > 1:
        together += f", and direction=0 to {len(found) - 1} follow {len(found)} families"
    return found, [together, *said]


def hopf_family(
    problem: Problem, curve: Curve, special: Special, family: Family, options: ContinuationOptions
) -> tuple[Cycles, Point]:
    """The orbits that begin at a Hopf point of a curve of equilibria, and the first of them."""
    n = curve.n
    name = curve.field.parameters[curve.active[0]]
    low, high, p = float(curve.low[n]), float(curve.high[n]), float(special.u[n])
    scale = grown(curve.scale[:n], np.abs(family.vector), special.normal_form, high - low)
    cycles = cycles_of(problem, [name], [(low, high)], scale, np.zeros(n), options)
    found = starts.from_hopf(cycles, special.u[:n], p, family.omega, family.vector, family.bend)
    return cycles, first_point(cycles, found, f"near the Hopf point at {name} = {p:.9g}")
