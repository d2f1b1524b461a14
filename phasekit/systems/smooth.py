"""Right-hand sides that jump: they have no equilibria, branches and cycles that can be followed."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from typing import Any

import numpy as np

from phasekit.arrays import Array
from phasekit.errors import ParameterError
from phasekit.laws.formulas import short_formula, symbols_of
from phasekit.laws.smoothness import SMOOTH, any_jumps, is_jump, jump_beside, jumps

#: Differences along an orbit, as a part of the greatest, that may be jumps; and of the values.
PART, SLIGHT = 0.25, 1e-3
ROUNDED = 4.0  # units in the last place
#: Parts of what is nearby over which a function is looked at, and that as a part of what is far.
SHORTER, NEARBY = 0.125 ** np.arange(6), 1e-4
#: Change beside that of the derivatives that tells of others, and beside the values that is none.
STEEPER, NO_CHANGE = 4.0, 1e-7


def refuse_jumps(problem: Any, free: Iterable[str] = ()) -> None:
    """Refuse formulas that jump as states change, at the parameters, those that change aside."""
    if found := jumping_formula(problem, free):
        raise ParameterError(
            f"f: got {found}, wants one without jumps as states change; smooth it: {SMOOTH}"
        )


def jumping_formula(problem: Any, free: Iterable[str] = ()) -> str:
    """The first formula of a problem that jumps as states change; empty where none is seen."""
    if problem.kind != "symbolic" or not any_jumps(problem.own_field.formulas, problem.state):
        return ""
    free = set(free)
    fixed = {n: x for n, x in problem.parameters.items() if n not in free and isinstance(x, float)}
    moving = tuple(symbols_of(problem.state).values())
    rough = [formula for formula in problem.f if jumps(formula, moving)]
    if rough and fixed:  # which may join two branches, or leave out what jumps
        symbols = symbols_of(fixed)
        values = {symbols[name]: value for name, value in fixed.items()}
        rough = [formula for formula in rough if jumps(formula.subs(values), moving)]
    return short_formula(rough[0]) if rough else ""


def refuse_jump_at(problem: Any, x: Array) -> None:
    """Refuse a function that jumps at a state, of which Newton's method makes an equilibrium."""
    if problem.kind == "symbolic" or problem.blocks or problem.time is not None:
        return
    found = jump_beside(problem, x)
    if found is not None:
        raise jumping(problem, found, x)


def refuse_steep_at(problem: Any, x: Array, slopes: Array, near: Array) -> None:
    """Refuse a function that changes nearby by more than its derivatives by differences say."""
    if problem.kind == "symbolic" or problem.blocks or problem.jac is not None:
        return
    for j, step in enumerate(np.diag(near)):
        with np.errstate(all="ignore"):
            far = np.abs(problem(x + step / NEARBY))
            for part in SHORTER:
                ends = problem(x - part * step), problem(x + part * step)
                known = STEEPER * 2.0 * np.abs(slopes[:, j]) * part * near[j]
                known += NO_CHANGE * (far + np.abs(problem(x)))
                for k in np.flatnonzero(np.abs(ends[1] - ends[0]) > known).tolist():

                    def along(s: float, k: int = k, way: Array = part * step) -> float:
                        return float(problem(x + s * way)[k])

                    wants = "its derivatives, jac=..., a formula, or a wider change"
                    pair = float(ends[0][k]), float(ends[1][k])
                    if is_jump(along, -1.0, 1.0, *pair):
                        raise stepping(problem, j, x, abs(pair[1] - pair[0]), wants)
                    raise ParameterError(
                        f"f: got a function that changes within {part * near[j]:.1g} of "
                        f"{problem.state[j]} = {x[j]:.6g} more than its differences see, wants "
                        f"{wants}"
                    )


def refuse_jump_along(problem: Any, f: Callable[[float, Array], Array], t: Array, x: Array) -> None:
    """Refuse a function that jumps between states next to one another, rows of an orbit."""
    if problem.kind == "symbolic" or problem.blocks or len(x) < 2:
        return
    values = np.array([f(float(time), one) for time, one in zip(t, x, strict=True)])
    gaps = np.abs(np.diff(values, axis=0))
    for i, k in np.argwhere(gaps > PART * gaps.max(axis=0)):

        def along(s: float, i: int = i, k: int = k) -> float:
            return float(f(float(t[i]), x[i] + s * (x[i + 1] - x[i]))[k])

        # Where states all but cancel, what a few units in their last places do is no jump.
        ends = ((float(t[m]), x[m]) for m in (i, i + 1))
        last = max(
            abs(float((f(time, one + step) - f(time, one))[k]))
            for time, one in ends
            for step in np.diag(ROUNDED * np.spacing(np.abs(one)))
        )
        least = max(SLIGHT * float(np.ptp(values[:, k])), ROUNDED * last)
        if is_jump(along, 0.0, 1.0, along(0.0), along(1.0), least):
            j = int(np.argmax(np.abs(x[i + 1] - x[i])))
            raise jumping(problem, j, x[i])


def jumping(problem: Any, state: int, x: Array) -> ParameterError:
    """What is said of a function that jumps at a place, along a state."""
    return ParameterError(
        f"f: got a function that jumps where {problem.state[state]} = {x[state]:.6g}, wants one "
        f"without jumps at equilibria and along cycles; smooth it: {SMOOTH}"
    )


def stepping(problem: Any, state: int, x: Array, step: float, wants: str) -> ParameterError:
    """What is said of a function that changes in steps at a place, along a state."""
    return ParameterError(
        f"f: got a function whose values go in steps of about {step:.1g} where "
        f"{problem.state[state]} = {x[state]:.6g}, as rounding leaves them (of terms that cancel, "
        f"of numbers too small), wants {wants}"
    )
