"""Stiff motions after equal times, all at once, held against attractors.

What the kernel `strobe` does, by implicit steps: their number does not grow with the rate at which
fast states follow slow ones.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
import numpy.typing as npt

from phasekit.laws.equations import Equations
from phasekit.motion import flows
from phasekit.motion.called import BESIDE
from phasekit.motion.equation_rates import derivatives_of
from phasekit.motion.lost import ARRIVED, EXHAUSTED, FAILED
from phasekit.motion.method import cells_of, entries_of, turns_of, whole_turns

Array = npt.NDArray[np.float64]
Index = npt.NDArray[np.int64]

#: Parts of a leg in which fast states may decay.
LAYERS = (1e-10, 1e-7, 1e-4)


def moved(
    law: Equations, values: Mapping[str, Array], states: Array, times: Array,
    rtol: float, atol: float, threads: int | None = None, scales: Array | None = None,
    ends: Array | None = None,
) -> tuple[Array, Index]:  # fmt: skip
    """States of motions at times by implicit steps, and how they end.

    The last states of those that failed are written to ``ends``.
    """
    if not derivatives_of(law):
        how = {"rtol": rtol, "atol": atol}
        return flows.one_by_one(law, values, states, times, "radau", how, scales, ends=ends)
    own: Any = {"rtol": rtol, "atol": atol, "threads": threads, "scales": scales}
    found, status = flows.stiff(law, values, states, times, **own, ends=ends)
    lost = np.flatnonzero(status == EXHAUSTED)
    if not lost.size or times.shape[1] > 1:
        return found, status
    # What decays in so small a part of the time is taken for all of its pace.
    part, x, done = cells_of(values, lost), states[lost], 0.0
    last, fresh = np.full(x.shape, np.nan), np.full(x.shape, np.nan)
    for until in (*LAYERS, 1.0):
        legs = (until - done) * entries_of(times, lost)
        reached, ended = flows.stiff(law, part, x, legs, **own, ends=fresh)
        last = np.where(np.isfinite(x), fresh, last)  # of the first leg that failed
        x, done = reached[:, 0], until
    if ends is not None:
        ends[lost] = last
    found[lost], status[lost] = reached, ended
    return found, status


def strobe_stiff(
    law: Equations, values: Mapping[str, Array], states: Array, legs: Array, skip: int, many: int,
    targets: Any, enough: float, groups: tuple[Any, ...], rtol: float, atol: float,
    threads: int | None,
) -> Array:  # fmt: skip
    """Fill states, attractors, legs, growth of errors and status, as `kernels.strobe` does.

    Return the last states of the motions that failed on their way, NaN of others.
    """
    out, code, taken, growth, status = groups
    n, turns, units = len(law.states), turns_of(law), targets.units
    x, error = np.array(states[:, :n]), np.array(states[:, n:])
    measured = error.shape[1] > 0
    now, most = np.ones(len(x)), np.zeros(len(x))
    if measured:
        now = now * np.linalg.norm(error / units, axis=1) + 1.0
        most = now.copy()
    last, same = np.zeros(len(x), np.int64), np.zeros(len(x), np.int64)
    good = np.isfinite(x).all(axis=1)
    status[:] = np.where(good, ARRIVED, FAILED)
    on = np.flatnonzero(good)
    out[~good] = np.nan
    ends = np.full(x.shape, np.nan)
    for done in range(1, many + 1):
        if not on.size:
            break
        if measured:
            aside = _directions(error[on], units)
            both, cells = np.concatenate([x[on], x[on] + BESIDE * aside]), np.tile(on, 2)
        else:
            both, cells = x[on], on
        reached = np.full(both.shape, np.nan)
        found, how = moved(
            law, cells_of(values, cells), both, legs[cells][:, None], rtol, atol, threads,
            np.minimum(units, 1.0), reached,
        )  # fmt: skip
        x[on], how = found[: on.size, 0], how[: on.size]
        if measured:
            error[on] = (found[on.size :, 0] - x[on]) / BESIDE
            now[on] = now[on] * np.linalg.norm(error[on] / units, axis=1) + 1.0
            most[on] = np.fmax(most[on], now[on])
        taken[on] = done
        lost = ~np.isfinite(x[on]).all(axis=1)
        status[on] = np.where(lost & (how == ARRIVED), FAILED, how)
        ends[on[lost]] = reached[: on.size][lost]
        whole = _with_errors(x, error, now, on, units) if measured else x[on]
        if skip <= done < skip + out.shape[1]:
            out[on, done - skip] = whole
        inside = _cells(x[on], turns, targets)
        same[on] = np.where((inside >= 0) & (inside == last[on]), same[on] + 1, 1)
        last[on] = inside
        near = _nearest(x[on], turns, targets)
        code[on] = np.where((near < 0) & (inside >= 0) & (same[on] >= targets.visits), inside, near)
        entered = (same[on] == 1) | ((code[on] >= 0) & (code[on] != inside))
        growth[on] = np.where(entered, most[on], growth[on])
        with np.errstate(invalid="ignore"):
            within = ((targets.reach[0] <= x[on]) & (x[on] <= targets.reach[1])).all(axis=1)
        status[on[~lost & ~within & (code[on] < 0)]] = FAILED
        grown = (status[on] == ARRIVED) & (code[on] < 0) & (growth[on] > enough)
        if grown.any():
            out[on[grown], 0], out[on[grown], 1:] = whole[grown], np.nan
        failed = on[status[on] != ARRIVED]
        out[failed, max(done - skip, 0) :] = np.nan
        on = on[(status[on] == ARRIVED) & (code[on] < 0) & ~grown]
    return ends


def _nearest(x: Array, turns: Array, targets: Any) -> Index:
    """Attractors near a point of which states are; -1: near none."""
    found = np.full(len(x), -1, np.int64)
    for row in targets.points[::-1]:
        off = x - row[: turns.size]
        close = np.linalg.norm((off - whole_turns(off, turns)) / targets.units, axis=1) <= row[-2]
        found[close] = int(row[-1])
    return found


def _cells(x: Array, turns: Array, targets: Any) -> Index:
    """Attractors in whose cells states are; -1: in none."""
    from phasekit.motion.called import held

    if not targets.keys.size:
        return np.full(len(x), -1, np.int64)
    return np.array([held(one, turns, targets)[0] for one in x], np.int64)


def _directions(error: Array, units: Array) -> Array:
    size = np.linalg.norm(error / units, axis=1, keepdims=True)
    return np.where(size > 0.0, error / np.where(size > 0.0, size, 1.0), error)


def _with_errors(x: Array, error: Array, now: Array, on: Index, units: Array) -> Array:
    """States with their tangent vectors as long as the error."""
    return np.hstack([x[on], now[on, None] * _directions(error[on], units)])
