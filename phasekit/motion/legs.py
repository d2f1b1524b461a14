"""Motions leg by leg, held against attractors: by implicit steps, or of plain Python functions.

What the kernel `strobe` does of machine code. The number of implicit steps does not grow with the
rate at which fast states follow slow ones.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any, TypeAlias

import numpy as np

from phasekit.arrays import Array, Index
from phasekit.errors import ConvergenceError
from phasekit.laws.equations import Equations
from phasekit.laws.ladder import Map
from phasekit.motion import flows
from phasekit.motion.equation_rates import Called, derivatives_of
from phasekit.motion.lost import ARRIVED, EXHAUSTED, FAILED, UNDEFINED
from phasekit.motion.method import cells_of, entries_of, single, turns_of, whole_turns
from phasekit.motion.steps import InitialValue, steps
from phasekit.motion.together import FEW, MOST, Together, stepped

#: Takes the number of a leg, cells, and states of these; gives the states after it, how that ended,
#: the last states of those that failed, and what was raised.
Leg: TypeAlias = Callable[[int, Index, Array], tuple[Array, Index, Array, list[str]]]

#: Parts of a leg in which fast states may decay.
LAYERS = (1e-10, 1e-7, 1e-4)
#: Distance of the neighbour by which it is measured how errors grow, in units of the states.
BESIDE = 1e-7


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


def implicit(
    law: Equations, values: Mapping[str, Array], legs: Array, units: Array, rtol: float,
    atol: float, threads: int | None,
) -> Leg:  # fmt: skip
    """A leg by implicit steps."""

    def leg(_: int, cells: Index, x: Array) -> tuple[Array, Index, Array, list[str]]:
        ends = np.full(x.shape, np.nan)
        own, times, scales = cells_of(values, cells), legs[cells][:, None], np.minimum(units, 1.0)
        found, how = moved(law, own, x, times, rtol, atol, threads, scales, ends)
        return found[:, 0], how, ends, [""] * len(x)

    return leg


def called(
    law: Equations, values: Mapping[str, Any], legs: Array, reach: Array, rtol: float, atol: float
) -> Leg:
    """A leg, or an iteration of a map, of a plain Python function.

    Of all motions at once if it takes arrays, else of one motion after another; also from where it
    is seen to mix them.
    """
    from phasekit.numerics.waits import stage

    alike = bool((legs > 0.0).all()) and (not isinstance(law, Map) or np.ptp(legs) == 0.0)
    together: list[Together | None] = [] if alike else [None]  # it is known at the first states
    functions = [Called(law, single(cells_of(values, cell))) for cell in range(len(legs))]

    def leg(number: int, cells: Index, x: Array) -> tuple[Array, Index, Array, list[str]]:
        stage(f"{len(cells):,} of {len(legs):,} motions after {number:,} legs")
        found, how, raised = np.empty(x.shape), np.full(len(x), ARRIVED), []
        if not together:
            together.append(Together.if_it_takes_arrays(law, values, len(legs), cells, x))
        if (whole := together[0]) is not None:
            whole.forget()
            begin = number * legs[cells]
            found = stepped(whole, cells, x, begin, begin + legs[cells], rtol, atol, reach)
            if whole.mixes:
                together[0] = whole = None
        if whole is not None:
            lost = ~np.isfinite(found).all(axis=1)
            texts = [whole.raised.get(cell, "") for cell in cells.tolist()]
            said = np.array([bool(one) and not one.startswith("OverflowError") for one in texts])
            how[lost] = np.where(whole.undefined[cells] | said, UNDEFINED, FAILED)[lost]
            raised = [one if how[row] == UNDEFINED else "" for row, one in enumerate(texts)]
            return found, how, np.full(x.shape, np.nan), raised
        found = np.empty(x.shape)
        for row, (cell, state) in enumerate(zip(cells.tolist(), x, strict=True)):
            f = functions[cell]
            f.raised, f.undefined = "", False
            found[row] = _applied(law, f, number, float(legs[cell]), state, rtol, atol, reach)
            if not np.isfinite(found[row]).all():
                spoke = bool(f.raised) and not f.raised.startswith("OverflowError")
                how[row] = UNDEFINED if f.undefined or spoke else FAILED
            raised.append(f.raised if how[row] == UNDEFINED else "")
            stage(f"{row + 1:,} of {len(cells):,} motions in leg {number + 1:,}")
        return found, how, np.full(x.shape, np.nan), raised

    return leg


def _applied(
    law: Equations, f: Called, number: int, leg: float, x: Array, rtol: float, atol: float,
    reach: Array,
) -> Array:  # fmt: skip
    """The state after a leg by a function.

    NaN where a flow fails, or after many steps is out of reach: nothing was raised there then.
    """
    if isinstance(law, Map):
        for i in range(int(leg)):
            x = f(number * leg + i, x)
        return x
    start, state = number * leg, np.full(x.size, np.nan)
    problem = InitialValue(
        f, list(x), start=start, rtol=max(rtol, 1e-13), atol=atol, unit=np.inf, most=MOST
    )
    try:
        for taken, one in enumerate(steps(problem, start + leg)):
            state = one.after
            if taken >= FEW and not ((reach[0] <= state) & (state <= reach[1])).all():
                f.raised, f.undefined = "", False
                return np.full(x.size, np.nan)
    except (ConvergenceError, ValueError):
        return np.full(x.size, np.nan)
    return state


def strobe_by(
    leg: Leg, law: Equations, states: Array, skip: int, many: int, targets: Any, enough: float,
    groups: tuple[Any, ...],
) -> tuple[Array, str]:  # fmt: skip
    """Fill states, attractors, legs, growth of errors and status, as `kernels.strobe` does.

    Return the last states of the motions that failed on their way, NaN of others, and what a
    function raised where one ended.
    """
    out, code, taken, growth, status = groups
    n, turns, units = len(law.states), turns_of(law), targets.units
    x, error = np.array(states[:, :n]), np.array(states[:, n:])
    measured, raised = error.shape[1] > 0, ""
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
        both, cells = x[on], on
        if measured:
            aside = _directions(error[on], units)
            both, cells = np.concatenate([x[on], x[on] + BESIDE * aside]), np.tile(on, 2)
        found, how, reached, said = leg(done - 1, cells, both)
        x[on], how = found[: on.size], how[: on.size]
        raised = raised or next(filter(None, said[: on.size]), "")
        if measured:
            error[on] = (found[on.size :] - x[on]) / BESIDE
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
    return ends, raised


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
    from phasekit.motion.kernels.strobe import cell_of
    from phasekit.numerics.lanes import LANES

    found = np.full(len(x), -1, np.int64)
    if targets.keys.size:
        grid = targets.grid, targets.side, targets.keys, targets.codes
        lanes = np.zeros(turns.size * LANES)
        for row in np.flatnonzero(np.isfinite(x).all(axis=1)):
            lanes[::LANES] = x[row]
            found[row] = cell_of(0, lanes, turns, *grid)
    return found


def _directions(error: Array, units: Array) -> Array:
    size = np.linalg.norm(error / units, axis=1, keepdims=True)
    return np.where(size > 0.0, error / np.where(size > 0.0, size, 1.0), error)


def _with_errors(x: Array, error: Array, now: Array, on: Index, units: Array) -> Array:
    """States with their tangent vectors as long as the error."""
    return np.hstack([x[on], now[on, None] * _directions(error[on], units)])
