"""Lyapunov exponents of motions and of iterates of maps."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from phasekit.arrays import Array, Index
from phasekit.laws.equations import Equations
from phasekit.laws.ladder import Map
from phasekit.laws.perturbed import PerturbedLaw
from phasekit.motion.equation_rates import code_of, pointwise, slopes_at, table_for
from phasekit.motion.flow import ATOL, RTOL
from phasekit.motion.flows import one_by_one
from phasekit.motion.lost import ARRIVED, EXHAUSTED, FAILED, MOST, judged, stuck, tell
from phasekit.motion.method import cells_of, kinds, limits_of, run, single
from phasekit.motion.rates import order_of
from phasekit.motion.steps import InitialValue, end_of

#: Parts of the time, and how many at first are not counted.
PARTS, SKIPPED = 20, 2
#: Steps of a Python function's motion between which tangent vectors are made orthonormal, in parts
#: of the time.
FINE = 50


class Exponents(NamedTuple):
    """The group "lyapunov", exponents on a last axis."""

    lyapunov_exponent: Array
    lyapunov_error: Array
    lyapunov_sum: Array
    lyapunov_dimension: Array


def lyapunov(law: PerturbedLaw, *arrays: npt.ArrayLike, **how: Any) -> Exponents:
    """Both exponents of motions of a coordinate, which `exponents` gives."""
    found = exponents(law, *arrays, count=2, **how)
    return Exponents(*(found[name] for name in Exponents._fields))


def exponents(
    law: PerturbedLaw | Equations,
    *arrays: npt.ArrayLike,
    count: int,
    rtol: float = RTOL,
    atol: float = ATOL,
    threads: int | None = None,
    method: str | None = None,
) -> dict[str, Array]:
    """The greatest exponents of motions, their errors, sum and dimension; NaN without an end.

    Arrays are parameters, states at t = 0, and times, or counts of steps of a map; they broadcast.
    Tangent vectors move along by the variational equation, and are made orthonormal whenever they
    are no longer nearly so. The first tenth of the time is not counted. The error is that of the
    mean over the parts of the time, or the trend in them.
    """
    given = [np.asarray(array, dtype=float) for array in arrays]
    shape = np.broadcast_shapes(*(array.shape for array in given))
    flat = [x.reshape(()) if x.size == 1 else np.broadcast_to(x, shape).ravel() for x in given]
    values: Mapping[str, Array]
    if isinstance(law, Equations):
        values = dict(zip(law.names, flat, strict=False))
    else:
        values = law.values(*flat[: len(law.names)])
    cells = int(np.prod(shape, dtype=int))
    columns = [np.broadcast_to(x, (cells,)) for x in flat[len(law.names) :]]
    times, states = columns[-1], np.stack(columns[:-1], axis=-1)
    states = np.where((np.isfinite(times) & (times > 0.0))[:, None], states, np.nan)
    legs = np.where(np.isfinite(times) & (times > 0.0), times, 1.0) / PARTS
    if isinstance(law, Equations) and isinstance(law, Map):
        legs = np.maximum(np.floor(legs), 1.0) * law.times
    raised = set[str]()
    if isinstance(law, Equations) and law.kind == "python":
        grown, status = _one_by_one(law, values, states, legs, count, rtol, atol, raised)
    else:
        table = table_for(law, np.where(np.isfinite(times) & (times > 0.0), times, 0.0))
        grown, status = np.empty((cells, PARTS, count)), np.empty(cells, np.int64)
        for kind in kinds(law, values, cells):
            part = cells_of(values, kind), states[kind], legs[kind]
            grown[kind], status[kind] = _growth(
                law, *part, table, count, rtol, atol, threads, method
            )  # fmt: skip
    tell("lyapunov_exponent", status, states, raised)
    ended = np.isneginf(grown[:, -1])  # where the derivative of a map vanishes
    with np.errstate(invalid="ignore"):
        means = np.diff(grown[:, SKIPPED - 1 :], axis=1) / legs[:, None, None]
    means = np.where(ended[:, None], 0.0, means) * getattr(law, "times", 1)
    found = means.mean(axis=1)
    number = PARTS - SKIPPED
    spread = means.std(axis=1, ddof=1) / np.sqrt(number)
    trend = np.abs(means[:, number // 2 :].mean(axis=1) - found)
    found = np.where(ended, -np.inf, found)
    order = np.argsort(-found, axis=1)
    error = np.take_along_axis(np.maximum(spread, trend), order, axis=1)
    found = np.take_along_axis(found, order, axis=1)
    whole = np.full(len(found), np.nan)
    total = found.sum(axis=1) if count == states.shape[1] else whole
    dimension = _dimension(found, whole_space=count == states.shape[1])

    def back(x: Array) -> Array:
        return np.asarray(x.reshape(shape + x.shape[1:]))

    return {
        "lyapunov_exponent": back(found), "lyapunov_error": back(error),
        "lyapunov_sum": back(total), "lyapunov_dimension": back(dimension),
    }  # fmt: skip


def _dimension(found: Array, whole_space: bool) -> Array:
    """Kaplan and Yorke's dimension; NaN where the exponents do not add up to less than 0."""
    sums = np.cumsum(found, axis=1)
    k = np.sum(sums >= 0.0, axis=1)
    rows, n = np.arange(len(found)), found.shape[1]
    inside = (k > 0) & (k < n)
    last, next_ = np.clip(k - 1, 0, n - 1), np.clip(k, 0, n - 1)
    with np.errstate(all="ignore"):
        part = sums[rows, last] / np.abs(found[rows, next_])
    full = np.where((k == n) & whole_space, float(n), np.nan)
    full = np.where(np.isnan(found).any(axis=1), np.nan, full)
    return np.where(inside, k + part, np.where((k == 0) & np.isfinite(found[:, 0]), 0.0, full))


def _growth(
    law: PerturbedLaw | Equations, values: Mapping[str, Array], states: Array, legs: Array,
    table: Array, count: int, rtol: float, atol: float, threads: int | None, method: str | None,
) -> tuple[Array, Index]:  # fmt: skip
    """Logs of the growth of tangent vectors after each part of the time, added up."""
    from phasekit.motion.kernels.tangents import growth

    cells, n = states.shape
    order = 0 if method == "dop853" else order_of(rtol)
    code, parameters = code_of(law, values, cells, count, order)
    first = np.concatenate([states, np.tile(np.eye(n)[:count].ravel(), (cells, 1))], axis=1)
    out, status = np.full((cells, PARTS, count), np.nan), np.zeros(cells, np.int64)
    # A motion with no part of its time behind it after such a part of the steps is too slow.
    rows = np.arange(cells)
    for most in (MOST // PARTS, MOST):
        shared = table, limits_of(law, rtol, atol, most, alone=True), code.kink
        own = np.array(legs[rows], float), first[rows]
        groups: Any = (np.full((rows.size, PARTS, count), np.nan), np.zeros(rows.size, np.int64))
        run(growth, code, shared, own, np.array(parameters[:, rows]), groups, groups[1], threads)
        out[rows], status[rows] = groups
        rows = np.flatnonzero((status == EXHAUSTED) & ~np.isnan(out[:, 0]).any(axis=1))
        if not rows.size:
            break
    if isinstance(law, Equations):
        status[(status == ARRIVED) & np.isnan(out[:, -1]).any(axis=1)] = FAILED
    judged(status, parameters)
    stuck(law, status)
    return out, status


def _one_by_one(
    law: Equations, values: Mapping[str, Array], states: Array, legs: Array, count: int,
    rtol: float, atol: float, raised: set[str],
) -> tuple[Array, Index]:  # fmt: skip
    """The same of Python functions, one motion after the other; adds what they raised."""
    from phasekit.numerics.waits import stage

    cells, n = states.shape
    out, status = np.full((cells, PARTS, count), np.nan), np.full(cells, ARRIVED)
    grow = _of_map if isinstance(law, Map) else _of_flow
    for cell in range(cells):
        one = single(cells_of(values, cell))
        x, vectors = states[cell], np.eye(n)[:, :count]
        total, at = np.zeros(count), 0.0
        for part in range(PARTS if np.isfinite(x).all() else 0):
            for _ in range(1 if isinstance(law, Map) else FINE):
                leg = legs[cell] if isinstance(law, Map) else legs[cell] / FINE
                x, vectors, logs = grow(law, one, x, vectors, at, leg, rtol, atol)
                total, at = total + logs, at + leg
            out[cell, part] = total
            stage(f"{cell + 1:,} of {cells:,} motions")
        if np.isnan(out[cell]).any():
            out[cell], status[cell] = np.nan, FAILED
            if np.isfinite(x0 := states[cell : cell + 1]).all() and not isinstance(law, Map):
                # The motion alone says why, where it ends as well.
                end, own = PARTS * legs[cell : cell + 1, None], cells_of(values, [cell])
                how = {"rtol": rtol, "atol": atol}
                why = one_by_one(law, own, x0, end, None, how, raised=raised)[1][0]
                status[cell] = FAILED if why == ARRIVED else why
    return out, status


def _of_flow(
    law: Equations, values: Mapping[str, float], x: Array, vectors: Array, start: float,
    leg: float, rtol: float, atol: float,
) -> tuple[Array, Array, Array]:  # fmt: skip
    n, f = len(x), pointwise(law, values)

    def rates(t: float, y: Array) -> Array:
        tangents = y[n:].reshape(n, -1)
        return np.concatenate([f(t, y[:n]), (slopes_at(law, values, y[:n], t) @ tangents).ravel()])

    problem = InitialValue(
        rates, [*x, *vectors.ravel()], start=start, rtol=rtol, atol=atol, unit=np.inf, most=100_000
    )
    state = end_of(problem, start + leg)
    return _orthonormal(state[:n], state[n:].reshape(n, -1))


def _of_map(
    law: Equations, values: Mapping[str, float], x: Array, vectors: Array, start: float,
    leg: float, *_: float,
) -> tuple[Array, Array, Array]:  # fmt: skip
    f, total = pointwise(law, values), np.zeros(vectors.shape[1])
    for i in range(int(leg)):
        moved = slopes_at(law, values, x, start + i) @ vectors
        x, vectors, logs = _orthonormal(f(start + i, x), moved)
        total = total + logs
    return x, vectors, total


def _orthonormal(x: Array, vectors: Array) -> tuple[Array, Array, Array]:
    if not (np.isfinite(vectors).all() and np.isfinite(x).all()):
        return x * np.nan, vectors * np.nan, np.full(vectors.shape[1], np.nan)
    q, r = np.linalg.qr(vectors)
    with np.errstate(divide="ignore"):
        return x, q, np.log(np.abs(np.diag(r)))
