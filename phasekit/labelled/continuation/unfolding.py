"""Conservative problems with the parameter that makes their families of orbits regular."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from phasekit.arrays import Array
from phasekit.bifurcation.continuation.options import ContinuationOptions
from phasekit.labelled.continuation.checks import check_parameter, check_span
from phasekit.labels.arguments import bad
from phasekit.laws.formulas import symbols_of
from phasekit.systems.problem import Problem

#: The parameter that unfolds conservative families, and stays zero; that of a law without any.
UNFOLDING, NO_PARAMETER = "unfolding", "no_parameter"


def by_period(parameter: Any, span: Any, options: ContinuationOptions) -> ContinuationOptions:
    """Options that bound the period of a conservative family, which is what varies."""
    if parameter != "period":
        raise bad(
            "parameter", parameter, "'period' of a conservative problem, with the span of it",
            "its orbits form families at fixed parameters; fix='period' follows one of them",
        )  # fmt: skip
    return replace(options, bounds={**options.bounds, "period": check_span(span)})


def beside_unfolding(problem: Problem, parameter: Any) -> list[str]:
    """A parameter of a conservative problem with which a family of one period moves."""
    if not isinstance(parameter, str) or parameter == UNFOLDING:
        raise bad("parameter", parameter, "one parameter of a conservative problem, by name")
    return [check_parameter(problem, parameter), UNFOLDING]


def unfolded(problem: Problem, name: str = UNFOLDING) -> Problem:
    """A problem with a term that takes energy, times a parameter that stays zero.

    The term is that of a damping: each velocity, in its own equation.
    """
    n = len(problem.state)
    x = np.random.default_rng(3).uniform(0.3, 0.9, n)
    f = problem(x)
    velocity = [int(np.argmin(np.abs(x - v))) for v in f]
    moving = sorted({j for j, v in zip(velocity, f, strict=True) if x[j] == v}) or list(range(n))
    mask = np.zeros(n)
    mask[moving] = 1.0
    values = {**problem.parameters, name: 0.0}
    kept = {"periods": dict(problem.periods), "time": problem.time, "period": problem.period}
    if problem.kind == "symbolic":
        symbols = symbols_of([*problem.state, name])
        formulas = [
            e + symbols[name] * symbols[state] if mask[i] else e
            for i, (e, state) in enumerate(zip(problem.f, problem.state, strict=True))
        ]
        return Problem(formulas, problem.state, values, **kept).described(problem.words)

    def with_damping(x: Array, **parameters: float) -> Array:
        part = parameters.pop(name)
        return np.asarray(problem.f(x, **parameters), dtype=float) + part * (mask * x.T).T

    return Problem(with_damping, problem.state, values, **kept).described(problem.words)
