"""Motions of plain Python functions after equal times, one after another, held against attractors.

What the kernel `strobe` does of machine code.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
import numpy.typing as npt

from phasekit.errors import ConvergenceError
from phasekit.laws.equations import Equations
from phasekit.laws.ladder import Map
from phasekit.motion.equation_rates import Called
from phasekit.motion.lost import ARRIVED, FAILED, UNDEFINED
from phasekit.motion.method import cells_of, single, turns_of
from phasekit.motion.steps import InitialValue, steps

Array = npt.NDArray[np.float64]

#: Distance of the neighbour by which it is measured how errors grow, in units of the states.
BESIDE = 1e-7
#: Steps of a leg, and of one of a motion that is gone.
MOST, FEW = 100_000, 100


def strobe_called(
    law: Equations, values: Mapping[str, Any], states: Array, legs: Array, skip: int, many: int,
    targets: Any, enough: float, groups: tuple[Any, ...], rtol: float, atol: float,
) -> str:  # fmt: skip
    """Fill states, attractors, legs, growth of errors and status, as `kernels.strobe` does.

    Return what f raised where a motion ended.
    """
    from phasekit.numerics.waits import stage

    out, code, taken, growth, status = groups
    n, turns = len(law.states), turns_of(law)
    measured, raised = states.shape[1] > n, ""
    for cell, start in enumerate(states):
        one = single(cells_of(values, cell))
        f = Called(law, one)
        step = _step(law, f, float(legs[cell]), rtol, atol, targets.reach)
        x, error = start[:n], start[n:]
        sizes = _grown(1.0, 0.0, error, targets.units) if measured else (0.0, 0.0)
        at_entry, last, same, done = 0.0, 0, 0, 0
        status[cell] = ARRIVED if np.isfinite(x).all() else FAILED
        while status[cell] == ARRIVED and done < many:
            if measured:
                aside = _direction(error, targets.units)
                beside = step(done, x + BESIDE * aside)
            f.raised, f.undefined = "", False
            x = step(done, x)
            done += 1
            if not np.isfinite(x).all():
                if f.undefined or (f.raised and not f.raised.startswith("OverflowError")):
                    status[cell], raised = UNDEFINED, raised or f.raised
                else:
                    status[cell] = FAILED
                break
            if measured:
                error = (beside - x) / BESIDE
                sizes = _grown(*sizes, error, targets.units)
            if skip <= done < skip + out.shape[1]:
                more = sizes[0] * _direction(error, targets.units) if measured else error
                out[cell, done - skip] = np.concatenate([x, more])
            inside, code[cell] = held(x, turns, targets)
            same = same + 1 if inside >= 0 and inside == last else 1
            last = inside
            if inside >= 0 and same >= targets.visits and code[cell] < 0:
                code[cell] = inside
            if same == 1 or 0 <= code[cell] != inside:
                at_entry = sizes[1]
            if code[cell] >= 0:
                break
            if not ((targets.reach[0] <= x) & (x <= targets.reach[1])).all():
                status[cell] = FAILED
            elif at_entry > enough:
                out[cell, 0] = np.concatenate([x, sizes[0] * _direction(error, targets.units)])
                out[cell, 1:] = np.nan
                break
        if status[cell] != ARRIVED:
            out[cell, max(done - skip, 0) :] = np.nan
        taken[cell], growth[cell] = done, at_entry
        stage(f"{cell + 1:,} of {len(states):,} motions")
    return raised


def _step(law: Equations, f: Called, leg: float, rtol: float, atol: float, reach: Array) -> Any:
    """The state after a leg, or after a step of a map, as a function of its number and a state.

    NaN where a flow fails, or after many steps is out of reach: nothing was raised there then.
    """
    if isinstance(law, Map):

        def applied(number: int, x: Array) -> Array:
            for i in range(int(leg)):
                x = f(number * leg + i, x)
            return x

        return applied

    def moved(number: int, x: Array) -> Array:
        start = number * leg
        problem = InitialValue(
            f, list(x), start=start, rtol=max(rtol, 1e-13), atol=atol, unit=np.inf, most=MOST
        )
        state = np.full(x.size, np.nan)
        try:
            for taken, one in enumerate(steps(problem, start + leg)):
                state = one.after
                if taken >= FEW and not ((reach[0] <= state) & (state <= reach[1])).all():
                    f.raised, f.undefined = "", False
                    return np.full(x.size, np.nan)
        except (ConvergenceError, ValueError):
            return np.full(x.size, np.nan)
        return state

    return moved


def held(x: Array, turns: Array, targets: Any) -> tuple[int, int]:
    """The attractor in whose cells a state lies, and the one near a point of which it is."""
    from phasekit.motion.kernels.strobe import cell_of, nearest_of
    from phasekit.numerics.lanes import LANES

    lanes = np.zeros(x.size * LANES)
    lanes[::LANES] = x
    grid = targets.grid, targets.side, targets.keys, targets.codes
    inside = cell_of(0, lanes, turns, *grid)
    return inside, nearest_of(0, lanes, targets.points, turns, targets.units)


def _direction(error: Array, units: Array) -> Array:
    size = float(np.linalg.norm(error / units))
    return error / size if size > 0.0 else error


def _grown(now: float, most: float, error: Array, units: Array) -> tuple[float, float]:
    """The error after a leg that adds one unit, and the greatest so far."""
    now = now * float(np.linalg.norm(error / units)) + 1.0
    return now, max(most, now)
