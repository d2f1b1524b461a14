"""Samples of motions after transients: where functions vanish along them, or where they rest."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from phasekit.arrays import Array
from phasekit.laws.equations import Equations
from phasekit.motion.crossings import Crossing, Rate, crossings, symbols_here
from phasekit.motion.equation_rates import rates_on
from phasekit.motion.method import cells_of

#: Legs of the first part of a motion, and of the longest; and of all, at most, per sample.
FIRST, LONGEST, EACH, LEAST = 64, 8192, 64, 20_000
#: Part of its size that a state goes in a leg where it counts as resting.
STILL = 1e-8
#: Times as many crossings of the one as of another that is waited for.
PATIENCE = 8
STOP = "stop_of_the_motion"


class Samples(NamedTuple):
    """What was seen of motions, in the order in which they came to it."""

    states: Array
    """Of shape (cells, samples, states); NaN where there are no more."""
    ends: Array
    """Last states, of shape (cells, states); NaN where a motion was lost."""
    resting: npt.NDArray[np.bool_]
    """Whether the motion came to rest."""


def samples(
    law: Equations,
    values: Mapping[str, Array],
    states: Array,
    watched: Sequence[Crossing],
    picks: Sequence[int],
    *,
    n: int,
    skip: int,
    leg: float,
    units: Array,
) -> Samples:
    """States of motions where functions vanish, but for the first ones.

    Of each state that is kept which is seen at crossings of the function `picks`, n of them after
    `skip`. A leg is a part of a turn of the fastest motion, or the period of the law.
    """
    count = len(states)
    found, number = np.full((count, n, len(law.states)), np.nan), np.zeros((count, len(watched)))
    x, t, on = np.array(states), 0.0, np.arange(count)
    ends, resting = np.full(states.shape, np.nan), np.zeros(count, bool)
    symbols, clock = symbols_here(law.states, (*law.names, STOP), law.time)
    whole = [*watched, Crossing(clock - symbols[STOP], 1, 1)]
    heard = sorted(set(picks))
    legs, most = FIRST, max(EACH * (n + skip), LEAST)
    done = 0
    while on.size and done < most:
        part, stop = cells_of(values, on), t + legs * leg
        times = np.tile([t, stop + legs * leg], (on.size, 1))
        seen = crossings(law, part, x[on], times, whole, more={STOP: np.full(on.size, stop)})
        clocked = seen.which == len(watched)
        place = clocked.argmax(axis=1)
        arrived = clocked.any(axis=1)
        x[on] = np.where(arrived[:, None], seen.state[np.arange(on.size), place], np.nan)
        for function in heard:
            mine = seen.which == function
            rank = (number[on, function][:, None] + np.cumsum(mine, axis=1) - 1 - skip).astype(int)
            row, column = np.nonzero(mine & (rank >= 0) & (rank < n))
            for state in np.flatnonzero(np.array(picks) == function):
                found[on[row], rank[row, column], state] = seen.state[row, column, state]
            number[on, function] += mine.sum(axis=1)
        slopes = _slopes(law, part, x[on], stop)
        size = np.maximum(units, np.abs(x[on]))
        still = arrived & (np.abs(slopes) * leg <= STILL * size).all(axis=1)
        resting[on[still]] = True
        ends[on] = x[on]
        share = number[on][:, heard] / (n + skip)
        full = (share >= 1.0).all(axis=1) | (share >= PATIENCE).any(axis=1)
        goes_on = arrived & ~still & ~full
        t, done = stop, done + legs
        longer, slowest = 2 * legs, share[goes_on].min(initial=1.0)
        if slowest > 0.0:  # as long as the slowest is believed to need
            longer = min(longer, int(1.1 * done * (1.0 / slowest - 1.0)) + FIRST // 4)
        on, legs = on[goes_on], min(longer, LONGEST)
    return Samples(found, ends, resting)


def _slopes(law: Equations, values: Mapping[str, Array], states: Array, t: float) -> Array:
    """Rates in cells; infinite of what varies with time, which does not rest."""
    if law.time is not None:
        return np.full(states.shape, np.inf)
    if law.kind != "python":
        return rates_on(law, values, states)
    wide = {name: np.broadcast_to(v, len(states)) for name, v in values.items()}
    rows = [
        rates_on(law, {name: float(v[k]) for name, v in wide.items()}, state[None])
        for k, state in enumerate(states)
    ]
    return np.concatenate(rows) if rows else np.empty(states.shape)


def maxima(law: Equations) -> list[Crossing]:
    """What vanishes where each state of a law has its maxima."""
    symbols = symbols_here(law.states, law.names, law.time)[0]
    return [Crossing(rate_along(law, symbols[name]), -1) for name in law.states]


def rate_along(law: Equations, formula: Any) -> Any:
    """The rate of a formula of the states along motions: a formula where the law is one."""
    import sympy as sp

    symbols = symbols_here(law.states, law.names, law.time)[0]
    slopes = tuple(formula.diff(symbols[name]) for name in law.states)
    if law.kind != "symbolic":
        return Rate(slopes)
    return sp.Add(*(slope * rate for slope, rate in zip(slopes, law.f, strict=True)))
