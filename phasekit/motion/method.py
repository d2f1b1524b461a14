"""Runs of the kernels over cells, by Taylor series or by the Runge-Kutta method DOP853.

Series are several times as fast, and need a law that is analytic. They resolve all of it, even
turns so fast that they matter to no digit: motions of which that would take too many steps are
left to Runge-Kutta.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np
import numpy.typing as npt

from phasekit.arrays import Array
from phasekit.laws.equations import Equations
from phasekit.laws.perturbed import PerturbedLaw
from phasekit.motion.lost import EXHAUSTED, MOST, MOST_JUMPING
from phasekit.motion.rates import Rates

#: Work of a motion, in the cells by which `launch` counts.
WEIGHT = 5_000


def run(
    kernel: Callable[..., None],
    code: Rates,
    shared: tuple[Any, ...],
    cells: tuple[npt.NDArray[Any], ...],
    parameters: Array,
    groups: Any,
    status: npt.NDArray[np.int64],
    threads: int | None,
    *,
    again: bool = True,
) -> None:
    """Run a kernel over cells.

    After the machine code the kernel takes what is shared by all cells, then arrays with the cells
    on their first axis, or one row for all, then parameters, of shape (parameters, cells). It fills
    the groups, the status among them. Where series take too many steps, Runge-Kutta is tried
    `again`.
    """
    from phasekit.numerics.launch import launch

    count = len(status)
    launch(kernel, (*code.steps, *shared, *cells, parameters), count, groups, threads, WEIGHT)
    lost = np.flatnonzero(status == EXHAUSTED)
    if not (again and code.series and lost.size):
        return
    own = tuple(array[lost] if len(array) == count else array for array in cells)
    arguments = (0, 0, code.address, *shared, *own, np.array(parameters[:, lost]))
    parts = tuple(group[lost] for group in groups)
    launch(kernel, arguments, lost.size, parts, threads, WEIGHT)
    for group, part in zip(groups, parts, strict=True):
        group[lost] = part


def both_ways(
    times: Array, count: int, width: int, integrate: Callable[[Array, tuple[Any, ...]], None]
) -> tuple[Array, npt.NDArray[np.int64], npt.NDArray[np.int64]]:
    """States of so many entries, status and steps of motions, ahead of t = 0 and before it.

    `integrate` takes times of one sense in order, and fills states, status and steps.
    """
    result = np.full((count, times.shape[1], width), np.nan)
    status, steps = np.zeros(count, np.int64), np.zeros(count, np.int64)
    for sense in (1.0, -1.0):
        ahead = sense * times > 0.0
        if sense < 0.0 and not ahead.any():
            continue
        later = np.where(ahead, times, 0.0)
        order = np.argsort(sense * later, axis=1)
        rising = np.array(np.take_along_axis(later, order, axis=1))
        out = np.empty(result.shape)
        reached, taken = np.zeros(count, np.int64), np.zeros(count, np.int64)
        if count and times.shape[1]:
            integrate(rising, (out, reached, taken))
        back = np.argsort(order, axis=1)[..., None]
        out = np.take_along_axis(out, np.broadcast_to(back, (count, *back.shape[1:])), axis=1)
        wanted = (ahead | (sense > 0.0) & (times == 0.0))[..., None]
        result = np.where(wanted, out, result)
        status, steps = np.maximum(status, reached), steps + taken
    return result, status, steps


def entries_of(array: Array, which: Any) -> Array:
    """Entries of cells, of what may be the same in all."""
    return array[which] if array.ndim and len(array) > 1 else array


def cells_of(values: Mapping[str, Array], which: Any) -> dict[str, Array]:
    """Values of parameters in some cells."""
    return {name: entries_of(np.asarray(value), which) for name, value in values.items()}


def single(values: Mapping[str, Any]) -> dict[str, float]:
    """Parameters of one cell as numbers."""
    return {name: float(np.reshape(x, ())) for name, x in values.items()}


def few(array: npt.ArrayLike, number: int) -> Array:
    """So many rows at most, evenly among all."""
    rows = np.asarray(array, float)
    some = np.linspace(0, len(rows) - 1, min(len(rows), number)).round().astype(int)
    return np.asarray(rows[some])


def whole_turns(off: Array, turns: Array) -> Array:
    """Whole turns in differences of states that are angles: what is left is less than half of one.

    `turns` are the periods, 0 of other states.
    """
    turning = turns > 0.0
    if not turning.any():
        return np.zeros(turns.shape)
    return np.where(turning, turns * np.round(off / np.where(turning, turns, 1.0)), 0.0)


def kinds(
    law: PerturbedLaw | Equations, values: Mapping[str, Array], count: int
) -> list[npt.NDArray[np.bool_]]:
    """Which of so many cells have one machine code: those of quadratic damping, and the others."""
    if isinstance(law, Equations):
        return [np.ones(count, bool)]
    kinked = np.broadcast_to(np.asarray(values["quadratic"]) != 0.0, (count,))
    return [kind for kind in (~kinked, kinked) if kind.any()]


def limits_of(
    law: PerturbedLaw | Equations,
    rtol: float,
    atol: float,
    most: int = MOST,
    *,
    alone: bool = False,
    keep: bool = False,
    beside: float = 1.0,
    scales: Array | None = None,
) -> Array:
    """What bounds the steps of the kernels, in all lanes; whether to take and keep each alone.

    Errors of tangent vectors may be `beside` times as great. Of equations a unit and a scale of
    each state follow: of its window, else one of `scales`, else 0, for what a motion comes to.
    """
    from phasekit.numerics.lanes import LANES

    if isinstance(law, Equations) and law.jumps:
        most = min(most, MOST_JUMPING)
    unit = np.inf if isinstance(law, Equations) else unit_of(law)
    rows = [rtol, atol, unit, float(most), float(alone), float(keep), beside]
    if isinstance(law, Equations):
        for i, name in enumerate(law.states):
            low, high = law.window.get(name, (0.0, 0.0 if scales is None else scales[i]))
            # Without a window an angle is measured by radians.
            unit = law.periods.get(name, np.inf) / (2.0 * np.pi)
            rows += [unit, min(high - low, unit)]
    return np.repeat(np.reshape(rows, (-1, 1)), LANES, axis=1)


def turns_of(law: PerturbedLaw | Equations) -> Array:
    """Periods of the states that are angles, 0 of others."""
    if isinstance(law, Equations):
        return np.array([law.periods.get(name, 0.0) for name in law.states])
    return np.array([circle(law), 0.0])


def circle(law: PerturbedLaw) -> float:
    """Period of the coordinate; 0 on a line."""
    return 0.0 if law.base.period is None else float(law.base.period)


def unit_of(law: PerturbedLaw) -> float:
    """Value from which on a coordinate is held as closely as there: a radian; none on a line."""
    return circle(law) / (2.0 * np.pi) if law.base.period is not None else np.inf
