"""Initial value problems by Gauss collocation, each with steps of its own, all at once.

Eight stages: order 16, symmetric and symplectic [HairerLubichWanner2006]. The stages are found by
fixed-point iteration, and the decay of their Legendre series tells how long a step may be.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]
Index = npt.NDArray[np.intp]
#: y' for some of the problems: rows, and y of shape (problems, stages, components).
Rate = Callable[[Index, Array], Array]
#: Whether steps may be trusted: rows, and states of shape (problems, stages, components).
Trust = Callable[[Index, Array], npt.NDArray[np.bool_]]

STAGES = 8
_TAIL = 3e-9  # of the stages' series; the end of a step is known to the square of it
_NOISE = 1e-4
_ITERATIONS = 40
_MOST_STEPS = 20_000
_EPS = float(np.finfo(float).eps)


def _tables() -> tuple[Array, Array, Array]:
    legendre: Any = np.polynomial.legendre
    nodes, weights = legendre.leggauss(STAGES)
    basis = legendre.legvander(nodes, STAGES - 1)
    to_series = (basis * weights[:, None]).T * (np.arange(STAGES)[:, None] + 0.5)
    integrals = np.stack(
        [legendre.legval(nodes, legendre.legint(row, lbnd=-1)) for row in np.eye(STAGES)], axis=1
    )
    return np.asarray(0.5 * integrals @ to_series), 0.5 * weights, np.asarray(to_series[-2:])


MATRIX, WEIGHTS, TO_TAIL = _tables()


class Step(NamedTuple):
    """Steps of some problems: which, the time before, y before, and how long they are."""

    rows: Index
    gone: Array
    y: Array
    length: Array


def integrate(
    rate: Rate,
    start: Array,
    time: Array,
    step: Array,
    trusted: Trust | None = None,
    trail: list[Step] | None = None,
) -> Array:
    """Solve y' = rate(y) from `start` over `time`, which may be negative.

    Parameters
    ----------
    rate : callable
        Right-hand side.
    start : array of shape (problems, components)
    time : array of shape (problems,)
    step : array of shape (problems,)
        Lengths of the first steps, > 0.
    trusted : callable, optional
        Whether steps saw all of the rate, for rows and the states at their stages; others are
        halved.
    trail : list, optional
        Gets the steps that are taken.

    Returns
    -------
    array of shape (problems, components)
        NaN where the solution grows without bound before the time is over, or takes more than
        20,000 steps.
    """
    y = np.array(start, dtype=float)
    lost = np.zeros(y.shape)  # what rounding has taken from y
    left = np.abs(time)
    sign = np.sign(time)
    step = np.array(step, dtype=float)
    refused = np.full(left.shape, np.inf)  # tail of the step that was last refused
    rows = np.flatnonzero((left > 0.0) & np.isfinite(y).all(axis=1))
    y[~(np.isfinite(time) & np.isfinite(y).all(axis=1))] = np.nan
    for _ in range(_MOST_STEPS):
        if not rows.size:
            return y
        h = np.minimum(step[rows], left[rows])
        length = (sign[rows] * h)[:, None]
        f, settled = _stages(rate, rows, y[rows], length)
        size = np.max(np.abs(f), axis=1)
        # What rounds away beside y is no error: a rate that vanishes on the way is all noise.
        with np.errstate(all="ignore"):
            nothing = _EPS * np.abs(y[rows]) / (np.abs(length) * _TAIL)
        size = np.maximum(size, np.where(np.isfinite(nothing), nothing, 0.0))
        tail = np.max(np.abs(np.einsum("ts,psc->ptc", TO_TAIL, f)), axis=1)
        tail = np.max(tail / np.where(size > 0.0, size, 1.0), axis=1)
        # A tail that shorter steps do not shrink is noise of the rate.
        noisy = (tail <= _NOISE) & (tail >= 0.2 * refused[rows])
        good = settled & ((tail <= _TAIL) | noisy)
        if trusted is not None and good.any():
            some = np.flatnonzero(good)
            few = rows[some]
            inner = np.einsum("st,ptc->psc", MATRIX, f[some])
            stages = y[few, None] + length[some, None] * inner
            seen = trusted(few, stages) | (h[some] <= 1e-12 * np.abs(time[few]))
            good[some[~seen]] = False
            settled[some[~seen]] = False
        refused[rows] = np.where(good | ~settled, np.inf, tail)
        with np.errstate(all="ignore"):
            factor = 0.9 * (_TAIL / tail) ** (1.0 / STAGES)
        factor = np.where(settled & ~noisy, np.where(np.isnan(factor), 0.5, factor), 0.5)
        factor = np.where(good & noisy, 2.0, factor)
        done = rows[good]
        if trail is not None:
            trail.append(Step(done, np.abs(time[done]) - left[done], y[done], h[good]))
        gain = length[good] * np.einsum("s,psc->pc", WEIGHTS, f[good]) + lost[done]
        y[done], before = y[done] + gain, y[done]
        lost[done] = gain - (y[done] - before)
        left[done] = np.where(h[good] >= left[done], 0.0, left[done] - h[good])
        step[rows] = h * np.clip(factor, 0.2, 3.0)
        stuck = step[rows] <= 1e-13 * np.abs(time[rows])
        y[rows[stuck & ~good]] = np.nan
        rows = rows[(left[rows] > 0.0) & np.isfinite(y[rows]).all(axis=1)]
    y[rows] = np.nan
    return y


def follow(
    rate: Rate,
    start: Array,
    owner: Index,
    time: Array,
    step: Array,
    trusted: Trust | None = None,
) -> Array:
    """`integrate` to many times of few motions; times of one owner have one start.

    Each motion is integrated once, as far as it is asked for. Then each time is reached in one
    step from the last that it has before: the stages between are not as accurate as the ends.
    """
    groups, first, which = np.unique(
        2 * owner + (time < 0.0), return_index=True, return_inverse=True
    )
    if 4 * len(groups) > len(time):  # steps of many at once cost less than those of a few
        return integrate(rate, start, time, step, trusted)
    size = np.abs(time)
    far = np.zeros(len(groups))
    np.maximum.at(far, which, np.where(np.isfinite(time), size, 0.0))
    sign = np.where(time[first] < 0.0, -1.0, 1.0)
    trail: list[Step] = []
    end = integrate(
        lambda few, y: rate(first[few], y), start[first], sign * far, step[first],
        None if trusted is None else lambda few, stages: trusted(first[few], stages), trail,
    )  # fmt: skip
    if not trail:
        return integrate(rate, start, time, step, trusted)
    steps = Step._make(np.concatenate(parts) for parts in zip(*trail, strict=True))
    # The last step of the same motion that begins before each time.
    count = len(steps.rows)
    order = np.lexsort((
        np.repeat([0, 1], [count, len(time)]), np.concatenate([steps.gone, size]),
        np.concatenate([steps.rows, which]),
    ))  # fmt: skip
    place = np.arange(len(order))
    last = order[np.maximum.accumulate(np.where(order < count, place, 0))]
    found = np.empty(len(time), dtype=np.intp)
    asked = order >= count
    found[order[asked] - count] = last[asked]
    begun = (found < count) & (steps.rows[np.minimum(found, count - 1)] == which)
    found = np.where(begun, found, 0)
    gone = np.where(begun, steps.gone[found], 0.0)
    before = np.where(begun[:, None], steps.y[found], start)
    # Nothing comes after the last step of a motion that does not last.
    ended = np.isnan(end[which]).any(axis=1) & begun
    before[ended & (size - gone > steps.length[found])] = np.nan
    return integrate(
        rate,
        before,
        np.where(time < 0.0, gone - size, size - gone),
        np.where(begun, steps.length[found], step),
        trusted,
    )


def _stages(
    rate: Rate, rows: Index, y: Array, length: Array
) -> tuple[Array, npt.NDArray[np.bool_]]:
    """Rates at the stages of a step, and whether their iteration has settled."""
    f = np.repeat(rate(rows, y[:, None, :]), STAGES, axis=1)
    settled = np.zeros(rows.size, dtype=bool)
    last = np.full(rows.size, np.inf)
    going = np.arange(rows.size)
    for _ in range(_ITERATIONS):
        inner = y[going, None] + length[going, None] * np.einsum("st,ptc->psc", MATRIX, f[going])
        fresh = rate(rows[going], inner)
        size = np.max(np.abs(fresh), axis=1, keepdims=True)
        size = np.where(size > 0.0, size, 1.0)
        change = np.max(np.abs(fresh - f[going]) / size, axis=(1, 2))
        f[going] = fresh
        # It shrinks until rounding stops it.
        over = (change <= 4e-16) | ((change <= 1e-9) & (change >= 0.5 * last[going]))
        settled[going[over]] = True
        last[going] = change
        going = going[~over & np.isfinite(change) & (change < 1e3)]
        if not going.size:
            break
    return f, settled
