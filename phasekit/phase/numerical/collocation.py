"""Initial value problems by Gauss collocation, each with steps of its own, all at once.

Eight stages: order 16, symmetric and symplectic [HairerLubichWanner2006]. The stages are found by
fixed-point iteration, and the decay of their Legendre series tells how long a step may be.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from phasekit.arrays import Array, Ints

#: y' for some of the problems: rows, and y of shape (problems, stages, components).
Rate = Callable[[Ints, Array], Array]
#: Whether steps may be trusted: rows, and states of shape (problems, stages, components).
Trust = Callable[[Ints, Array], npt.NDArray[np.bool_]]
#: What goes along with motions, after a step: rows, states at its stages and at its two ends, its
#: length, and what went along before.
Carry = Callable[[Ints, Array, tuple[Array, Array], Array, Array], Array]

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


class Steps(NamedTuple):
    """Steps that some problems try: which, and what they know when they do."""

    rows: Ints
    gone: Array
    """The time before."""
    y: Array
    lost: Array
    """What rounding has taken from y."""
    length: Array
    refused: Array
    """Tail of the step that was last refused."""
    reach: Array
    """How far any step so far would have gone."""
    carried: Array
    """What goes along with the motion."""


def integrate(
    rate: Rate,
    start: Array,
    time: Array,
    step: Array,
    trusted: Trust | None = None,
    trail: list[Steps] | None = None,
    begun: Steps | None = None,
    carry: Carry | None = None,
    carried: Array | None = None,
) -> tuple[Array, Array]:
    """Solve y' = rate(y) from `start` over `time`, which may be negative.

    Starts are of shape (problems, components), times and first steps, > 0, of shape (problems,).
    Steps that are not trusted, by rows and states at their stages, are halved; the trail gets the
    steps that are tried; `begun` is where to go on instead; `carry` takes what goes along, from
    `carried`, over steps. NaN where the solution grows without bound before the time is over, or
    takes more than 20,000 steps.
    """
    whole, sign = np.abs(time), np.sign(time)
    if begun is None:
        begun = first_steps(start, step, carried)
    y, lost, gone = (np.array(x, dtype=float) for x in (begun.y, begun.lost, begun.gone))
    step, refused, reach = (np.array(x) for x in (begun.length, begun.refused, begun.reach))
    along = np.array(begun.carried)
    rows = np.flatnonzero((whole > gone) & np.isfinite(y).all(axis=1))
    y[~(np.isfinite(time) & np.isfinite(y).all(axis=1))] = np.nan
    for _ in range(_MOST_STEPS):
        if not rows.size:
            return y, along
        if trail is not None:
            reach[rows] = np.maximum(reach[rows], gone[rows] + step[rows])
            now = (gone, y, lost, step, refused, reach, along)
            trail.append(Steps(rows, *(x[rows] for x in now)))
        left = whole[rows] - gone[rows]
        h = np.minimum(step[rows], left)
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
        some = np.flatnonzero(good)
        if some.size and not (trusted is None and carry is None):
            few = rows[some]
            inner = np.einsum("st,ptc->psc", MATRIX, f[some])
            stages = y[few, None] + length[some, None] * inner
            if trusted is not None:
                seen = trusted(few, stages) | (h[some] <= 1e-12 * whole[few])
                good[some[~seen]] = False
                settled[some[~seen]] = False
                some, few, stages = some[seen], few[seen], stages[seen]
        refused[rows] = np.where(good | ~settled, np.inf, tail)
        with np.errstate(all="ignore"):
            factor = 0.9 * (_TAIL / tail) ** (1.0 / STAGES)
        factor = np.where(settled & ~noisy, np.where(np.isnan(factor), 0.5, factor), 0.5)
        factor = np.where(good & noisy, 2.0, factor)
        done = rows[good]
        gain = length[good] * np.einsum("s,psc->pc", WEIGHTS, f[good]) + lost[done]
        y[done], before = y[done] + gain, y[done]
        lost[done] = gain - (y[done] - before)
        if carry is not None and done.size:
            along[done] = carry(done, stages, (before, y[done]), length[good, 0], along[done])
        gone[done] = np.where(h[good] >= left[good], whole[done], gone[done] + h[good])
        step[rows] = h * np.clip(factor, 0.2, 3.0)
        stuck = step[rows] <= 1e-13 * whole[rows]
        y[rows[stuck & ~good]] = np.nan
        rows = rows[(whole[rows] > gone[rows]) & np.isfinite(y[rows]).all(axis=1)]
    y[rows] = np.nan
    return y, along


def first_steps(start: Array, step: Array, carried: Array | None = None) -> Steps:
    """The first steps of problems."""
    rows, zero = np.arange(step.size), np.zeros(step.shape)
    y = np.array(start, dtype=float)
    length = np.array(step, dtype=float)
    along = np.zeros((rows.size, 0)) if carried is None else carried
    return Steps(rows, zero.copy(), y, np.zeros(y.shape), length, zero + np.inf, zero, along)


def follow(
    rate: Rate,
    start: Array,
    owner: Ints,
    time: Array,
    step: Array,
    trusted: Trust | None = None,
    carry: Carry | None = None,
    carried: Array | None = None,
) -> tuple[Array, Array]:
    """`integrate` to many times of few motions; times of one owner have one start.

    Each motion is integrated once, as far as it is asked for. Then each time goes on from the first
    step that would have passed it: as it would have by itself, to the last bit.
    """
    groups, first, which = np.unique(
        2 * owner + (time < 0.0), return_index=True, return_inverse=True
    )
    how: dict[str, Any] = {"trusted": trusted, "carry": carry, "carried": carried}
    if 4 * len(groups) > len(time):  # steps of many at once cost less than those of a few
        return integrate(rate, start, time, step, **how)
    size = np.abs(time)
    far = np.zeros(len(groups))
    np.maximum.at(far, which, np.where(np.isfinite(time), size, 0.0))
    sign = np.where(time[first] < 0.0, -1.0, 1.0)
    trail: list[Steps] = []
    integrate(
        lambda few, y: rate(first[few], y), start[first], sign * far, step[first],
        None if trusted is None else lambda few, stages: trusted(first[few], stages), trail,
        carry=None if carry is None else lambda few, *rest: carry(first[few], *rest),
        carried=None if carried is None else carried[first],
    )  # fmt: skip
    if not trail:
        return integrate(rate, start, time, step, **how)
    steps = Steps._make(np.concatenate(parts) for parts in zip(*trail, strict=True))
    found, known = _steps_past(steps, which, size)
    begun = first_steps(start, step, carried)
    begun = begun._replace(carried=np.array(begun.carried))
    for own, tried in zip(begun[1:], steps[1:], strict=True):
        own[known] = tried[found[known]]
    return integrate(rate, start, time, step, trusted, begun=begun, carry=carry)


def _steps_past(steps: Steps, which: Ints, size: Array) -> tuple[Ints, npt.NDArray[np.bool_]]:
    """For each time the first step of its motion that reaches it, else the last; whether any."""
    count = steps.rows.size
    reach = steps.reach * (1.0 + 4.0 * _EPS)  # rather one step early than late
    order = np.lexsort((
        np.repeat([1, 0], [count, size.size]), np.concatenate([reach, size]),
        np.concatenate([steps.rows, which]),
    ))  # fmt: skip
    place, own = np.arange(order.size), order < count
    before = np.maximum.accumulate(np.where(own, place, -1))
    after = np.minimum.accumulate(np.where(own, place, order.size)[::-1])[::-1]
    asked = np.flatnonzero(~own)
    number = order[asked] - count
    found, known = np.zeros(size.size, np.intp), np.zeros(size.size, dtype=bool)
    for nearest in (before, after):
        step = order[np.clip(nearest[asked], 0, order.size - 1)]
        there = step < count
        there[there] = steps.rows[step[there]] == which[number[there]]
        found[number[there]], known[number[there]] = step[there], True
    return found, known


def _stages(rate: Rate, rows: Ints, y: Array, length: Array) -> tuple[Array, npt.NDArray[np.bool_]]:
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
