"""Equations of any number of states as JavaScript, and what their page is told of them."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import numpy as np

from phasekit.arrays import Array
from phasekit.explorer import javascript
from phasekit.explorer.facts import parameter_facts
from phasekit.labels.arguments import bad
from phasekit.laws.derivatives import derivative
from phasekit.laws.ladder import is_turn
from phasekit.systems.problem import Problem
from phasekit.systems.problem_parts import refuse_aperiodic

#: Most states of a page.
MOST = 24


def check_equations(problem: Problem) -> None:
    """Refuse equations that no page can show."""
    if problem.kind != "symbolic":
        hint = (
            'a page computes in the browser: write pk.Problem({"x": "..."}); pk.flow and '
            "pk.plot.phase_portrait take functions"
        )
        raise bad("system", problem, "equations that are formulas, for the explorer", hint)
    if len(problem.state) > MOST:
        raise bad("system", problem, f"at most {MOST} states, for the explorer")
    refuse_aperiodic(problem)


def equations_as_script(problem: Problem) -> str:
    r"""Write equations as a JavaScript object: rates or step, their derivatives, the period.

    States, parameters and time are written as places in arrays, never by their names.

    >>> import phasekit as pk
    >>> spring = pk.Problem({"x": "v", "v": "-k*x"}, parameters={"k": 2.0})
    >>> print(equations_as_script(spring))  # doctest: +NORMALIZE_WHITESPACE
    {n: 2, discrete: false, times: 1,
    rates: (x, p, t, out) => { out[0] = x[1]; out[1] = -p[0]*x[0]; },
    slopes: (x, p, t, out) => { out[0] = 0; out[1] = 1; out[2] = -p[0]; out[3] = 0; },
    parts: (x, p, out) => { out[0] = x[1]; out[1] = x[0]; }, part_of: [0, 1],
    period: null}
    """
    from phasekit.laws.formulas import symbols_of

    symbols = symbols_of(
        [*problem.state, *problem.parameters, *([] if problem.time is None else [problem.time])]
    )
    states = [symbols[name] for name in problem.state]
    names = {symbol: f"x[{i}]" for i, symbol in enumerate(states)}
    names |= {symbols[name]: f"p[{i}]" for i, name in enumerate(problem.parameters)}
    if problem.time is not None:
        names[symbols[problem.time]] = "t"
    slopes = [derivative(f, x) for f in problem.f for x in states]
    turning = _turning(problem, states)
    period = "null"
    if problem.period is not None:
        period = javascript.function([problem.period], names, "p")
    parts = (
        f"n: {len(states)}, discrete: {str(problem.map).lower()}, times: {problem.times}",
        f"rates: {javascript.function(problem.f, names, 'x, p, t, out', 'out')}",
        f"slopes: {javascript.function(slopes, names, 'x, p, t, out', 'out')}",
        f"parts: {javascript.function([part for _, part in turning], names, 'x, p, out', 'out')}, "
        f"part_of: {[place for place, _ in turning]}",
        f"period: {period}",
    )
    return "{" + ",\n".join(parts) + "}"


def _turning(problem: Problem, states: list[Any]) -> list[tuple[int, Any]]:
    """Factors of both rates of a planar flow that may change sign, each with the rate's place."""
    if len(states) != 2 or problem.map or problem.time is not None:
        return []
    found = []
    for place, f in enumerate(problem.f):
        for factor in f.args if f.is_Mul else (f,):
            base = factor.base if factor.is_Pow and factor.exp.is_positive else factor
            pole = factor.is_Pow and factor.exp.is_negative
            if not pole and base.free_symbols & set(states):
                found.append((place, base))
    return found


def facts_of_equations(
    problem: Problem, box: tuple[Array, Array], ranges: Mapping[str, tuple[float, float]]
) -> dict[str, Any]:
    """Return what JSON can hold of equations in a box of states, with ranges of their parameters.

    >>> import phasekit as pk
    >>> spring = pk.Problem({"x": "v", "v": "-k*x"}, parameters={"k": 2.0})
    >>> facts = facts_of_equations(spring, (-np.ones(2), np.ones(2)), {"k": (0.0, 5.0)})
    >>> facts["law"], facts["states"][0]["low"], facts["parameters"][0]["high"]
    (["x' = v", "v' = -k*x"], -1.0, 5.0)
    """
    low, high = box
    arrow = " → " if problem.map else "' = "
    return {
        "model": "Map" if problem.map else "Equations",
        "law": [
            f"{name}{arrow}{formula}".replace("**", "^")
            for name, formula in zip(problem.state, problem.f, strict=True)
        ],
        "states": _states(problem, *box),
        "time": problem.time,
        "parameters": [
            parameter_facts(one, problem.parameters[one.name], ranges[one.name])
            for one in problem.declared
        ],
        "conservative": problem.conservative,
        "missing": [
            name
            for i, name in enumerate(problem.state)
            if problem.window.get(name) != (low[i], high[i]) and not _is_turn(problem, name, box, i)
        ],
        "python": _python(problem),
    }


def _is_turn(problem: Problem, name: str, box: tuple[Array, Array], i: int) -> bool:
    """Whether the range of an angle is what it is where none is said."""
    half = 0.5 * problem.periods.get(name, 0.0)
    return half > 0.0 and name not in problem.window and (-half, half) == (box[0][i], box[1][i])


def _states(problem: Problem, low: Array, high: Array) -> list[dict[str, Any]]:
    # Not in the middle, which is an equilibrium, or on a line of symmetry, of many systems.
    starts = low + (high - low) * (0.62 - 0.11 * (np.arange(len(low)) % 4))
    return [
        {
            "name": name,
            "units": _shown_unit(problem.unit_of(name)),
            "meaning": problem.words.get(name, {}).get("long_name", ""),
            "low": float(low[i]),
            "high": float(high[i]),
            "period": problem.periods.get(name),
            "angle": is_turn(problem.periods.get(name)),
            "start": float(problem.start.get(name, starts[i])),
        }
        for i, name in enumerate(problem.state)
    ]


def _shown_unit(unit: str | None) -> str:
    return "" if unit in (None, "1") else str(unit)


def _python(problem: Problem) -> dict[str, str]:
    """Return what stands before and after the parameters where Python makes the system."""
    spec = problem.specification()
    equations = dict(zip(spec.pop("state"), spec.pop("f"), strict=True))
    times, words = spec.pop("times", 1), spec.pop("words", {})
    del spec["parameters"]
    given = {name: value for name, value in spec.items() if value not in (None, False, {})}
    after = "".join(f"    {name}={value!r},\n" for name, value in given.items())
    return {
        "start": f"pk.Problem(\n    {equations!r},\n    parameters={{",
        "end": f"}},\n{after})" + f".iterated({times})" * (times > 1)
        + (f".described({words!r})" if words else ""),
    }  # fmt: skip


def time_shown(problem: Problem, box: tuple[Array, Array], rests: Array) -> float:
    """For how long motions are shown: of a map iterations; else turns of the slowest eigenvalue.

    Of a forced flow periods of the force; without an equilibrium, times that it takes to cross the
    box.
    """
    if problem.map:
        return 200.0 if len(problem.state) == 1 else 2000.0
    if problem.time is not None:
        return 40.0 * problem.forcing_period
    low, high = box
    rates = [
        np.abs(np.linalg.eigvals(slopes))
        for x in rests
        if np.isfinite(slopes := problem.derivatives(x)[1]).all()
    ]
    found = [float(size[size > 1e-6 * size.max()].min()) for size in rates if size.max() > 0.0]
    if found:
        return _rounded(12.0 * 2.0 * math.pi / min(found))
    starts = low + (high - low) * np.random.default_rng(0).random((200, len(low)))
    speeds = np.array([np.abs(problem.derivatives(x)[0]) for x in starts])
    with np.errstate(all="ignore"):
        crossing = np.nanmedian(np.nanmin((high - low) / speeds, axis=1))
    return _rounded(20.0 * float(crossing)) if np.isfinite(crossing) else 1.0


def _rounded(value: float) -> float:
    """A time to one digit."""
    return float(f"{min(max(value, 1e-12), 1e12):.0e}")
