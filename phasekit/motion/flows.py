"""Motions of any number of states: of flows x' = f(t, x; p) in lanes, of maps step by step."""

from __future__ import annotations

import functools
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np
import numpy.typing as npt

from phasekit.arrays import Array, Index
from phasekit.errors import warn
from phasekit.inputs import bad
from phasekit.laws.equations import Equations
from phasekit.laws.ladder import Map
from phasekit.laws.smoothness import NEAR, jump_beside, jumps, jumps_in_time
from phasekit.motion.equation_rates import (
    LONG,
    MANY,
    Called,
    derivatives_of,
    parameters_of,
    pointwise,
    rates_of,
    series_of,
    slopes_at,
)
from phasekit.motion.flow import ATOL, RTOL, Laid, motions
from phasekit.motion.lost import (
    ARRIVED,
    EXHAUSTED,
    FAILED,
    LEAPT,
    MOST,
    STUCK,
    UNDEFINED,
    judged,
    stuck,
    tell,
)
from phasekit.motion.method import WEIGHT, both_ways, cells_of, entries_of, limits_of, single
from phasekit.motion.rates import order_of
from phasekit.motion.steps import InitialValue, Step, followed
from phasekit.numerics.differences import EPSILON

#: Steps of the explicit method, after which an implicit one is tried, and how many that may take.
FEW, TRIED = 5_000, 100_000
FEW_IMPLICIT, TRIED_IMPLICIT = 50_000, 200_000
#: Steps one after another next to a jump, by which a motion is seen to stick to it, and steps after
#: which it is looked at anew.
STICKS, LOOK = 50, 1_000
#: Rate times step up to which DOP853 lets decays decay, and steps from which that takes too long.
BOUNDED, STEEP = 6.0, 20_000
#: Steps of the implicit method in Python.
MOST_IMPLICIT = 30_000
#: Part of what f varies by in time from which on it differs after a period that is none: some have
#: seven digits.
ANOTHER = 1e-6
#: Times the rounding that is seen by which f may differ after a period.
ROUNDED = 16.0
#: Moments at which this is looked at, past equal parts of the period, so that few see the jumps of
#: an f, and cells.
MOMENTS, MOMENT, LOOKED_AT = 16, 0.381966, 8


def flow(
    law: Equations,
    *arrays: npt.ArrayLike,
    rtol: float = RTOL,
    atol: float = ATOL,
    threads: int | None = None,
    method: str | None = None,
    taken: dict[str, int] | None = None,
) -> tuple[Array, ...]:
    """States after times from t = 0, or after so many steps of a map.

    Arrays are as of `phasekit.motion.flow.flow`. The method is taylor, dop853, rosenbrock or radau;
    by default an implicit one where the motion is stiff, else series where formulas are short.
    `taken` is told how many motions each method followed.
    """
    laid = Laid.out(len(law.names), arrays)
    values = dict(zip(law.names, laid.values, strict=True))
    raised = set[str]()
    if isinstance(law, Map):
        found, status = iterates(law, values, laid.states, laid.times * law.times, raised)
    else:
        how = {"rtol": rtol, "atol": atol}
        taken = {} if taken is None else taken
        found, status = _flows(
            law, values, laid.states, laid.times, method, threads, how, taken, raised
        )
        stuck(law, status)
        _leapt(law, values, laid.states, laid.times, status, how)
    tell(f"motion of {', '.join(law.states)}", status, laid.states, raised)
    return tuple(laid.back(found))


def _flows(
    law: Equations, values: Mapping[str, Array], states: Array, times: Array,
    method: str | None, threads: int | None, how: dict[str, float], taken: dict[str, int],
    raised: set[str],
) -> tuple[Array, Index]:  # fmt: skip
    order = order_of(how["rtol"])
    if method == "taylor" and not series_of(law, order, longest=np.inf):
        why = "f has functions whose series are not known, or is no formula"
        raise bad("method", method, "dop853 or radau", why)
    count = len(states)
    implicit = derivatives_of(law) if method in (None, "rosenbrock") else 0
    if method == "rosenbrock" and not implicit:
        why = f"f is no formula, or has more than {MANY} states; radau takes any"
        raise bad("method", method, "another method", why)
    if law.kind == "python" or method == "radau":
        if method is None and law.slopes is not None and is_steep(law, values, states, times):
            found, status = one_by_one(law, values, states, times, "radau", how)
            lost = np.flatnonzero(status != ARRIVED)
            taken["radau"] = taken.get("radau", 0) + count - lost.size
            if lost.size:  # Radau's method may take fewer steps
                cells = cells_of(values, lost), states[lost], entries_of(times, lost)
                found[lost], status[lost] = one_by_one(law, *cells, None, how, raised=raised)
                taken["dop853"] = taken.get("dop853", 0) + lost.size
            return found, status
        name = "radau" if method == "radau" else "dop853"
        taken[name] = taken.get(name, 0) + count
        return one_by_one(law, values, states, times, method, how, raised=raised)
    if method == "rosenbrock":
        taken["rosenbrock"] = taken.get("rosenbrock", 0) + count
        return stiff(law, values, states, times, how["rtol"], how["atol"], threads)

    def move(cells: tuple[Any, Array, Array], most: int, again: bool = True) -> tuple[Array, Index]:
        more: Any = {**how, "threads": threads, "most": most, "method": method}
        return motions(law, *cells, **more, again=again)[:2]

    def part(cells: Any) -> tuple[dict[str, Array], Array, Array]:
        return cells_of(values, cells), states[cells], entries_of(times, cells)

    explicit = "taylor" if method != "dop853" and series_of(
        law, order, longest=LONG if method is None else np.inf
    ) else "dop853"  # fmt: skip
    taken[explicit] = taken.get(explicit, 0) + count
    if method is not None:
        return move((values, states, times), MOST)
    # Explicit steps before, implicit ones, and explicit ones of what these do not bring to its end.
    budgets = [(TRIED, 0, MOST)]
    if implicit:
        budgets = [(FEW, FEW_IMPLICIT, TRIED), (TRIED, TRIED_IMPLICIT, MOST)]
    found, status = move((values, states, times), budgets[0][0], not implicit)
    lost = np.flatnonzero(status == EXHAUSTED)
    for _, budget, more in budgets:
        if not lost.size:
            break
        name = "rosenbrock" if implicit else "radau"
        if implicit:
            tried, ended = stiff(law, *part(lost), how["rtol"], how["atol"], threads, budget)
        else:  # the first tells whether it is worth its time
            tried, ended = one_by_one(law, *part(lost[:1]), "radau", how)
            if ended[0] == ARRIVED:
                tried, ended = one_by_one(law, *part(lost), "radau", how)
            else:
                ended = np.full(lost.size, EXHAUSTED)
        well = ended == ARRIVED
        found[lost[well]], status[lost[well]] = tried[well], ARRIVED
        taken[name] = taken.get(name, 0) + int(well.sum())
        taken[explicit] -= int(well.sum())
        lost = lost[~well]
        if lost.size:
            found[lost], status[lost] = move(part(lost), more, more == MOST or not implicit)
            lost = lost[status[lost] == EXHAUSTED]
    return found, status


def is_steep(
    law: Equations, values: Mapping[str, Array], states: Array, times: Array
) -> bool:  # fmt: skip
    """Whether a motion takes very many steps of DOP853, by how its states decay by themselves.

    These are so short that what decays fastest stays bounded; steps of Radau's method need not be.
    """
    reach = np.abs(np.broadcast_to(times, (len(states), times.shape[1])))
    reach = np.where(np.isfinite(reach), reach, 0.0).max(axis=1, initial=0.0)
    for cell in np.flatnonzero(np.isfinite(states).all(axis=1)):
        slopes = law.slopes(states[cell], single(cells_of(values, cell)))
        rate = 2.0 * float(np.max(-slopes.diagonal(), initial=0.0))  # as of diffusion; 0 of waves
        if rate * reach[cell] > BOUNDED * STEEP:
            return True
    return False


def stiff(
    law: Equations,
    values: Mapping[str, Array],
    states: Array,
    times: Array,
    rtol: float = RTOL,
    atol: float = ATOL,
    threads: int | None = None,
    most: int = MOST,
    scales: Array | None = None,
    ends: Array | None = None,
) -> tuple[Array, Index]:
    """Integrate stiff motions of formulas from t = 0; states, and how it ended.

    The last states of those that failed are written to ``ends``.
    """
    from phasekit.motion.kernels.rosenbrock import rosenbrock as kernel
    from phasekit.numerics.launch import launch

    count, n = states.shape
    address, slopes = rates_of(law).address, derivatives_of(law)
    parameters = parameters_of(law, values, count)
    limits = limits_of(law, rtol, atol, most, scales=scales)

    def integrate(rising: Array, groups: tuple[Any, ...]) -> None:
        given = address, slopes, limits, 0.0, rising, np.array(states), parameters
        into: Any = groups
        launch(kernel, given, count, into, threads, WEIGHT)
        out, how = groups[0], groups[1]
        failed = how == FAILED
        if ends is not None:
            ends[failed] = out[failed, -1]
        out[failed, -1] = np.nan

    result, status, _ = both_ways(times, count, n, integrate)
    judged(status, parameters)
    return result, status


def sections(
    law: Equations, *arrays: npt.ArrayLike, n: int, skip: int, period: float | None, **how: Any
) -> dict[str, Array]:
    """States once a period of the forcing, or after equal times, on a last axis."""
    given = [np.asarray(array, dtype=float) for array in arrays]
    legs = np.asarray(period_of(law, given[: len(law.names)]) if period is None else period)
    wide = [array[..., None] for array in given]
    times = legs[..., None] * (skip + np.arange(n))
    found = flow(law, *wide, times, **how)
    shape = np.broadcast_shapes(*(array.shape for array in wide), times.shape)
    names = [f"section_{name}" for name in law.states]
    result = dict(zip(names, found, strict=True))
    for name, state in zip(names, law.states, strict=True):
        if state in law.periods:
            turn = law.periods[state]
            result[name] = 0.5 * turn - np.mod(0.5 * turn - result[name], turn)
    return {"section_time": np.array(np.broadcast_to(times, shape)), **result}


def period_of(law: Equations, values: Sequence[Array]) -> Array:
    """The period of the forcing at values of the parameters."""
    import sympy as sp

    from phasekit.laws.formulas import symbols_of

    symbols = symbols_of(law.names)
    function = sp.lambdify([symbols[name] for name in law.names], law.period, "numpy")
    shape = np.broadcast_shapes(*(value.shape for value in values))
    periods = np.array(np.broadcast_to(function(*values), shape), float)
    cells = np.stack([np.broadcast_to(one, shape).ravel() for one in (*values, periods)], axis=-1)
    for i in np.unique(np.linspace(0, len(cells) - 1, LOOKED_AT).astype(int)) if len(cells) else ():
        *given, period = cells[i].tolist()
        if not (np.isfinite(cells[i]).all() and period > 0.0):
            continue
        if (gap := _difference_after(law, tuple(given), period)) > ANOTHER:
            hint = f"after it f differs by {gap:.2g} of what it varies by in time"
            raise bad("period", period, "a period of f in time", hint)
    return periods


@functools.lru_cache(maxsize=256)
def _difference_after(law: Equations, given: tuple[float, ...], period: float) -> float:
    """How far f is from repeating itself after a time, at states in the window."""
    f = pointwise(law, {name: np.array(x) for name, x in zip(law.names, given, strict=True)})
    ends = [law.window.get(name, (-1.0, 1.0)) for name in law.states]
    middle, half = (np.array([0.5 * (b + by * a) for a, b in ends]) for by in (1.0, -1.0))
    aside = np.cos(np.arange(MOMENTS * len(ends)).reshape(MOMENTS, -1))
    return mismatch(f, middle + half * aside, period, period)


def mismatch(
    f: Callable[[float, Array], Array], states: Array, period: float, after: float
) -> float:
    """How far f is from repeating itself after a time, at `MOMENTS` states.

    It is measured beside what f varies by in time where the state stays: beside the size of f a
    small forcing of any period would pass. What rounding may do, as far as moments next to each
    other show it, is left out.
    """
    times = (np.arange(MOMENTS) + MOMENT) / MOMENTS * period
    apart = np.array([MOMENT, 1.0 - 0.5 * MOMENT]) * period
    ulps = np.array([-4.0, -1.0, 1.0, 4.0]) * EPSILON
    values = np.array(
        [
            [f(at, x) for at in (t, t + after, *(t + apart), *(t + ulps * (t + after)))]
            for t, x in zip(times, states, strict=True)
        ]
    )
    with np.errstate(all="ignore"):
        known = np.isfinite(values).all(axis=(1, 2))
        off = np.abs(values - values[:, :1])[known].max(axis=0, initial=0.0)
        size = EPSILON * np.abs(values[known]).max(axis=(0, 1), initial=0.0)
    noise = ROUNDED * np.maximum(off[2 + apart.size :].max(axis=0), size)
    varies = off[1 : 2 + apart.size].max(axis=0)
    beyond = np.maximum(off[1] - noise, 0.0)
    return float(np.max(beyond / np.where(varies > 0.0, varies, 1.0), initial=0.0))


def one_by_one(
    law: Equations, values: Mapping[str, Array], states: Array, times: Array,
    method: str | None, how: dict[str, float], scales: Array | None = None,
    raised: set[str] | None = None, ends: Array | None = None,
) -> tuple[Array, Index]:  # fmt: skip
    """Motions one after the other: of Python functions, and stiff ones.

    To ``raised`` is added what functions raised where motions ended; to ``ends`` the last states of
    all are written.
    """
    from phasekit.numerics.waits import stage

    times = np.broadcast_to(times, (len(states), times.shape[1]))
    found = np.empty((*times.shape, states.shape[1]))
    status = np.full(len(states), ARRIVED)
    for cell, own in enumerate(times):
        one = single(cells_of(values, cell))
        rates = pointwise(law, one)
        found[cell], last, why = _followed(law, one, rates, states[cell], own, method, how, scales)
        if ends is not None:
            ends[cell] = last
        lost = np.isnan(found[cell]).any(axis=1) & np.isfinite(own)
        if lost.any():
            _note(rates, raised)
            status[cell] = why if np.isfinite(states[cell]).all() else EXHAUSTED
        stage(f"{cell + 1:,} of {len(states):,} motions")
    return found, status


def _note(rates: Any, raised: set[str] | None) -> None:
    """Add what a function raised."""
    if raised is not None and isinstance(rates, Called) and rates.raised:
        raised.add(rates.raised)


def _followed(
    law: Equations, values: Mapping[str, float], rates: Any, state: Array, times: Array,
    method: str | None, how: dict[str, float], scales: Array | None,
) -> tuple[Array, Array, int]:  # fmt: skip
    """States of one motion at times, its last, and why it ends there if it is not followed on."""
    from scipy.integrate import DOP853, Radau

    if not np.isfinite(state).all():
        found = np.full((times.size, state.size), np.nan)
        found[times == 0.0] = state
        return found, state, EXHAUSTED
    rates(0.0, state)  # which says what is wrong with a function that returns no rates
    kind: Any = DOP853
    if method == "radau":
        given = law.slopes
        kind = functools.partial(
            Radau, jac=lambda t, x: given(x, values) if given else slopes_at(law, values, x, t)
        )
    most = MOST_IMPLICIT if method == "radau" else 1_000_000
    problem = InitialValue(
        rates, list(state), rtol=max(how["rtol"], 1e-13), atol=how["atol"],
        unit=np.inf if scales is None else scales, most=int(how.get("most", most)), method=kind,
    )  # fmt: skip
    sticking, last = None if law.kind == "symbolic" else Sticking(rates), 0.0

    def ends(step: Step) -> bool:
        nonlocal last
        last = step.stop
        met = sticking.meets(last, step.before, step.after) if sticking else None
        return met is not None

    found, x = followed(problem, times, ends)
    if sticking and sticking.steps >= STICKS:
        return found, x, STUCK
    wanted = np.isfinite(times)
    if np.isfinite(found[wanted]).all():
        return found, x, FAILED
    return found, x, _why(law, rates, last, x, float(np.max(np.abs(times[wanted]))))


def _why(law: Equations, rates: Any, t: float, x: Array, span: float) -> int:
    """Why a motion goes no further: what the law does next to the place where it ends."""
    if law.time is not None and jumps_in_time(rates, t, x, span):
        return LEAPT
    with np.errstate(all="ignore"):
        for step in (NEAR * max(abs(t), 1e-3 * span), -NEAR * max(abs(t), 1e-3 * span)):
            ahead = x + step * rates(t, x)
            if np.isfinite(ahead).all() and np.isnan(rates(t + step, ahead)).any():
                return UNDEFINED
    return FAILED


def _leapt(
    law: Equations, values: Mapping[str, Array], states: Array, times: Array, status: Index,
    how: dict[str, float],
) -> None:  # fmt: skip
    """Mark the motions of formulas that end where these jump in time."""
    from phasekit.laws.formulas import symbols_of

    if law.kind != "symbolic" or law.time is None:
        return
    lost = np.flatnonzero((status == FAILED) & np.isfinite(states).all(axis=1))
    if lost.size and any(jumps(f, tuple(symbols_of([law.time]).values())) for f in law.f):
        cells = cells_of(values, lost), states[lost], entries_of(times, lost)
        why = one_by_one(law, *cells, None, how)[1]
        status[lost[why == LEAPT]] = LEAPT


class Sticking:
    """Motions that meet a jump of a function in many steps one after another."""

    def __init__(self, rates: Callable[[float, Array], Array]) -> None:
        self.rates, self.taken, self.steps, self.look = rates, 0, 0, LOOK

    def meets(self, t: float, before: Array, x: Array) -> int | None:
        """The state along whose jump a motion is held after a step, where that is looked at."""
        self.taken += 1
        if self.taken < self.look or len(x) > MANY:
            return None
        near = 4.0 * np.abs(x - before)
        found = jump_beside(functools.partial(self.rates, t), x, near)
        if found is None:
            self.steps, self.look = 0, self.taken + LOOK
        else:
            self.steps += 1
        return found if self.steps >= STICKS else None


def iterates(
    law: Equations, values: Mapping[str, Array], states: Array, times: Array,
    raised: set[str] | None = None,
) -> tuple[Array, Index]:  # fmt: skip
    """States after so many steps of a map; NaN where the number is none."""
    count, n = states.shape
    times = np.broadcast_to(times, (count, times.shape[1]))
    wrong = np.isfinite(times) & ((times < 0.0) | (times != np.rint(times)))
    if wrong.any():
        warn(
            f"t: {wrong.sum()} of {wrong.size} values are no whole numbers >= 0, as counts of "
            "iterations of a map are; there results are NaN",
            RuntimeWarning,
        )
    wanted = np.where(wrong, np.nan, times)
    if law.kind != "python":
        found, status, _ = motions(law, values, states, wanted)
    else:
        found, status = np.full((count, times.shape[1], n), np.nan), np.full(count, ARRIVED)
        for cell, order in enumerate(np.argsort(wanted, axis=1)):
            one = single(cells_of(values, cell))
            step, x, done = pointwise(law, one), states[cell], 0
            for i in order[np.isfinite(wanted[cell, order])]:
                while done < wanted[cell, i]:
                    x, done = step(float(done), x), done + 1
                found[cell, i] = x
            _note(step, raised)
    lost = ~np.isfinite(found).all(axis=2) & np.isfinite(wanted)
    status[lost.any(axis=1)] = FAILED
    return np.where(lost[..., None], np.nan, found), status
