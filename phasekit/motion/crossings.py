"""Crossings of many motions: where functions of state and time vanish along them."""

from __future__ import annotations

import functools
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np

from phasekit.arrays import Array, Index
from phasekit.errors import ConvergenceError
from phasekit.laws.equations import Equations
from phasekit.motion.equation_rates import pointwise, rates_of
from phasekit.motion.events import Event, Watch
from phasekit.motion.flow import ATOL, RTOL
from phasekit.motion.lost import ARRIVED, CROWDED, EXHAUSTED, FAILED, LEFT, MOST, RESTING, judged
from phasekit.motion.method import WEIGHT, cells_of, limits_of, single
from phasekit.motion.steps import InitialValue, Step, steps
from phasekit.numerics.slopes import jacobian

#: The sense of functions that are no more than gates.
NEVER = 2
#: Crossings for which there is room at first.
ROOM = 64
#: Crossings of a motion after which it is given up.
MOST_CROSSINGS = 1_000_000


@dataclass(frozen=True)
class Rate:
    """The rate of a formula along motions of a law that is no formula itself."""

    slopes: tuple[Any, ...]
    """The derivatives of the formula by each state."""


@dataclass(frozen=True)
class Crossing:
    """What counts as a crossing of a function."""

    function: Any
    """A formula of the states, the parameters, further parameters and the time; or a `Rate`."""
    sense: int = 0
    """Only where the function rises (1) or falls (-1) along the motion; 0: both; `NEVER`: it is no
    more than the gate of others."""
    last: int = 0
    """At which crossing the motion ends; 0: at none."""
    gate: int = -1
    """Place of the function that has to be above zero there; -1: of none."""
    net: bool = False
    """Whether falls are taken from rises; the motion then ends `last` turns from where it began."""
    touches: bool = False
    """Whether it crosses zero where it comes to it and turns back."""


class Crossings(NamedTuple):
    """Crossings in the order in which motions came to them, filled up with NaN and -1."""

    time: Array
    """Of shape (cells, crossings)."""
    state: Array
    """Of shape (cells, crossings, states)."""
    which: Index
    """Place of the function."""
    status: Index
    """How each motion ended."""
    steps: Index


class Edges(NamedTuple):
    """Where motions end."""

    box: Array
    """Least and greatest states, of shape (2, states), outside of which they end; or (2, 0)."""
    rests: Array
    """Rows: points, and last how near to them motions end."""

    @classmethod
    def none(cls, n: int) -> Edges:
        """Nowhere, of so many states."""
        return cls(np.empty((2, 0)), np.zeros((1, n)))

    @classmethod
    def around(cls, rests: Array, near: Array, box: tuple[Array, Array] | None = None) -> Edges:
        """Near points, and outside of a box."""
        ends = np.empty((2, 0)) if box is None else np.array(box, float)
        return cls(ends, np.vstack([rests, near]))


def crossings(
    law: Equations,
    values: Mapping[str, Array],
    states: Array,
    times: Array,
    watched: Sequence[Crossing],
    *,
    more: Mapping[str, Array] | None = None,
    on: Index | None = None,
    edges: Edges | None = None,
    kept: bool = True,
    rtol: float = RTOL,
    atol: float = ATOL,
    most: int = MOST,
) -> Crossings:
    """Follow motions and find where functions vanish along them.

    States are of shape (cells, states), times from and to (cells, 2), either way. On the zero of
    function `on` a motion starts, which is no crossing there; -1: on none; -2: zeros at the start
    are crossings. Of crossings that are not `kept` those alone that end motions are told.
    """
    count, n = states.shape
    further = {} if more is None else {name: np.asarray(x, float) for name, x in more.items()}
    on = np.full(count, -1, np.int64) if on is None else on
    edges = Edges.none(n) if edges is None else edges
    job = _Job(law, dict(values), further, tuple(watched), edges, kept, rtol, atol, most)
    alone = law.kind == "python" or any(isinstance(one.function, Rate) for one in watched)
    follow: Callable[..., Crossings] = _one_by_one if alone else _in_lanes
    room = ROOM if kept else 1
    already = np.zeros((count, len(watched)), np.int64)
    parts = [follow(job, np.array(states), np.array(times, float), np.array(on), already, room)]
    while (full := np.flatnonzero(parts[-1].status == CROWDED)).size:
        last = parts[-1]
        room = min(4 * room, MOST_CROSSINGS)
        if sum(part.time.shape[1] for part in parts) + room > MOST_CROSSINGS:
            last.status[full] = EXHAUSTED
            break
        begin = np.stack([last.time[full, -1], times[full, 1]], axis=-1)
        before = np.concatenate([part.which[full] for part in parts], axis=1)
        counts = [(before == i).sum(axis=1) for i in range(len(watched))]
        already, rest = np.stack(counts, axis=-1), last.which[full, -1]
        then = follow(job.part(full), last.state[full, -1], begin, rest, already, room)
        parts.append(_spread(then, full, count))
    return _joined(parts)


@dataclass(frozen=True)
class _Job:
    """What motions are followed by."""

    law: Equations
    values: Mapping[str, Array]
    more: Mapping[str, Array]
    watched: tuple[Crossing, ...]
    edges: Edges
    kept: bool
    rtol: float
    atol: float
    most: int

    def part(self, cells: Index) -> _Job:
        """The same for some cells."""
        values, more = cells_of(self.values, cells), cells_of(self.more, cells)
        return replace(self, values=values, more=more)


def _spread(part: Crossings, cells: Index, count: int) -> Crossings:
    """Crossings of some cells among all."""
    found = Crossings(
        np.full((count, part.time.shape[1]), np.nan),
        np.full((count, *part.state.shape[1:]), np.nan),
        np.full((count, part.time.shape[1]), -1), np.full(count, -1), np.zeros(count, np.int64),
    )  # fmt: skip
    for whole, own in zip(found, part, strict=True):
        whole[cells] = own
    return found


def _joined(parts: list[Crossings]) -> Crossings:
    """Crossings one part after the other, without columns in which there are none."""
    time, state, which = (np.concatenate([part[i] for part in parts], axis=1) for i in range(3))
    status, steps_ = parts[0].status.copy(), np.sum([part.steps for part in parts], axis=0)
    for part in parts[1:]:
        status = np.where(part.status >= 0, part.status, status)
    used = int((which >= 0).sum(axis=1).max(initial=0))
    return Crossings(time[:, :used], state[:, :used], which[:, :used], status, steps_)


def _in_lanes(
    job: _Job, states: Array, times: Array, on: Index, already: Index, room: int
) -> Crossings:
    from phasekit.motion.kernels.crossings import crossings as kernel
    from phasekit.numerics.launch import launch

    law, (count, n) = job.law, states.shape
    code = rates_of(law)
    names = (*law.names, *job.more)
    functions = tuple(one.function for one in job.watched)
    watch = _watch(law.states, names, law.time, functions)
    rules = np.array(
        [[one.sense, one.last, one.gate, one.net, one.touches] for one in job.watched], np.int64
    )
    values = {**job.values, **job.more}
    columns = [np.broadcast_to(values[name], (count,)) for name in names]
    parameters = np.array(columns or np.zeros((1, count)), float)
    limits = limits_of(law, job.rtol, job.atol, job.most, alone=True)
    shared = np.zeros((0, 3)), limits, watch, rules, *job.edges, job.kept
    time, which = np.full((count, room), np.nan), np.full((count, room), -1)
    state, number = np.full((count, room, n), np.nan), np.zeros(count, np.int64)
    status, steps = np.zeros(count, np.int64), np.zeros(count, np.int64)
    groups: Any = (time, state, which, number, status, steps)
    cells = times, states, on, already, parameters
    launch(kernel, (code.address, *shared, *cells), count, groups, None, WEIGHT)
    judged(status, parameters)
    return Crossings(time, state, which, status, steps)


@functools.lru_cache(maxsize=256)
def _watch(
    states: tuple[str, ...], names: tuple[str, ...], time: str | None, functions: tuple[Any, ...]
) -> int:
    """Machine code of functions, and of their rates behind them, by state, time and rates."""
    import sympy as sp

    from phasekit.numerics.lanes import compile_lanes

    symbols, clock = symbols_here(states, names, time)
    places = {symbols[name]: (0, i) for i, name in enumerate(states)}
    places |= {symbols[name]: (1, i) for i, name in enumerate(names)}
    places[clock] = (2, 0)
    rates = [sp.Dummy(f"r{i}", real=True) for i in range(len(states))]
    places |= {rate: (2, 1 + i) for i, rate in enumerate(rates)}
    slopes = [
        sp.Add(*(one * rate for one, rate in zip(row, (*rates, 1), strict=True)))
        for row in jacobian(functions, [*(symbols[x] for x in states), clock])
    ]
    return compile_lanes([*functions, *slopes], places)


def symbols_here(
    states: Sequence[str], names: Sequence[str], time: str | None
) -> tuple[dict[str, Any], Any]:
    """Symbols of states and parameters, and of the time, which is t where nothing else is."""
    from phasekit.laws.formulas import symbols_of

    clock = time or "t"
    symbols = symbols_of([*states, *names])
    # Where t is a state or a parameter, no function can depend on the time.
    return symbols, symbols_of([clock if clock not in symbols else f"_{clock}"]).popitem()[1]


def _one_by_one(
    job: _Job, states: Array, times: Array, on: Index, already: Index, room: int
) -> Crossings:
    """The same of Python functions, motion by motion, however many crossings there are."""
    from phasekit.numerics.waits import stage

    count, n = states.shape
    rows: list[list[tuple[float, Array, int]]] = []
    status, steps_ = np.full(count, ARRIVED), np.zeros(count, np.int64)
    for cell in range(count):
        values = cells_of({**job.values, **job.more}, np.array([cell]))
        own = single(values)
        found, status[cell], steps_[cell] = _followed(job, own, states[cell], times[cell], on[cell])
        rows.append(found)
        stage(f"{cell + 1:,} of {count:,} motions")
    most = max(map(len, rows), default=0)
    time, which = np.full((count, most), np.nan), np.full((count, most), -1)
    state = np.full((count, most, n), np.nan)
    for cell, found in enumerate(rows):
        for i, (t, x, function) in enumerate(found):
            time[cell, i], state[cell, i], which[cell, i] = t, x, function
    return Crossings(time, state, which, status, steps_)


def _followed(
    job: _Job, values: Mapping[str, float], state: Array, times: Array, on: int
) -> tuple[list[tuple[float, Array, int]], int, int]:
    """Crossings of one motion, how it ended, and its steps."""
    law = job.law
    rates = pointwise(law, {name: values[name] for name in law.names})
    names = (*law.names, *job.more)
    given = [values[name] for name in names]
    functions = [
        _bound(law.states, names, law.time, one.function, given, rates) for one in job.watched
    ]

    start, stop = float(times[0]), float(times[1])
    watches = []
    for i in range(len(job.watched)):
        value = 0.0 if i == on else functions[i](start, state)
        watches.append(Watch(Event(functions[i]), value))
    total, found, number = [0] * len(watches), list[tuple[float, Array, int]](), 0
    problem = InitialValue(
        rates, list(state), start, rtol=job.rtol, atol=job.atol, unit=np.inf,
        most=min(job.most, 1_000_000),
    )  # fmt: skip
    try:
        for step in steps(problem, stop):
            number += 1
            if number == 1:
                soon = step.start + 0.01 * (step.stop - step.start)
                signs = [functions[i](soon, step.dense(soon)) < 0.0 for i in range(len(total))]
                total = [-int(one.net and s) for one, s in zip(job.watched, signs, strict=True)]
            seen = sorted(
                (abs(t - start), t, i)
                for i, watch in enumerate(watches)
                if job.watched[i].sense != NEVER
                for t in watch.look(step)
            )
            for _, t, i in seen:
                x, one = np.asarray(step.dense(t)), job.watched[i]
                small = 1e-9 * abs(step.stop - start)
                if number == 1 and abs(t - start) <= small and on != -2:
                    continue
                sense = _sense(functions[i], rates, t, x, step)
                if (one.sense and one.sense != sense) or not (sense or one.touches):
                    continue
                if one.gate >= 0 and not functions[one.gate](t, x) > 0.0:
                    continue
                total[i] += sense if one.net else 1
                ends = 0 < one.last == total[i] or (one.net and total[i] == -1 - one.last)
                if job.kept or ends:
                    found.append((t, x, i))
                if ends:
                    return found, ARRIVED, number
            box = job.edges.box
            if box.size and not np.all((step.after >= box[0]) & (step.after <= box[1])):
                return found, LEFT, number
            for row, rest in enumerate(job.edges.rests[:-1]):
                if np.all(np.abs(step.after - rest) <= job.edges.rests[-1]):
                    return found, RESTING + row, number
    except (ConvergenceError, ValueError):
        return found, FAILED, number
    return found, ARRIVED, number


def _sense(
    function: Callable[[float, Any], float], rates: Callable[[float, Any], Array], t: float,
    x: Array, step: Step,
) -> int:  # fmt: skip
    """Whether a function rises (1) or falls (-1) along the motion where it vanishes, or touches."""
    part = 1e-4 * (step.stop - step.start)
    change = np.asarray(rates(t, x), float) * part
    before, after = function(t - part, x - change), function(t + part, x + change)
    return int(np.sign(after)) if before * after < 0.0 else 0


def _bound(
    states: tuple[str, ...], names: tuple[str, ...], time: str | None, function: Any,
    given: Sequence[float], rates: Callable[[float, Any], Array],
) -> Callable[[float, Any], float]:  # fmt: skip
    """A function of time and state, with its parameters in it."""
    if isinstance(function, Rate):
        slopes = _function(states, names, time, function.slopes)
        return lambda t, x: float(np.dot(slopes(t, x, given), rates(t, x)))
    value = _function(states, names, time, function)
    return lambda t, x: float(value(t, x, given))


@functools.lru_cache(maxsize=256)
def _function(
    states: tuple[str, ...], names: tuple[str, ...], time: str | None, function: Any
) -> Callable[[float, Any, Any], Any]:
    """A formula as a function of time, state and parameters."""
    import sympy as sp

    symbols, clock = symbols_here(states, names, time)
    x, p = [symbols[name] for name in states], [symbols[name] for name in names]
    found: Callable[[float, Any, Any], Any] = sp.lambdify([clock, x, p], function, "numpy")
    return found
