"""The curve of equilibria of a problem in one of its parameters."""

from __future__ import annotations

import numpy as np

from phasekit.bifurcation.continuation.curve import Curve
from phasekit.bifurcation.continuation.kernels.defining import EQUILIBRIUM
from phasekit.bifurcation.continuation.options import ContinuationOptions
from phasekit.labels.arguments import bad, check_names, unknown
from phasekit.systems.problem import Problem


def equilibrium_curve(
    problem: Problem, parameter: str, span: tuple[float, float], options: ContinuationOptions
) -> Curve:
    """The curve of equilibria in one parameter, its states not yet scaled."""
    if problem.time is not None:
        raise bad(
            "problem", problem, "one whose f does not depend on time, for equilibria",
            "follow periodic orbits: pk.continuation(..., orbit=pk.periodic_orbit(problem, x0))",
        )  # fmt: skip
    n = len(problem.state)
    check_names((*problem.state, parameter))
    names = list(problem.parameters)
    for name in (*options.bounds, *options.scales):
        if name not in problem.state and name not in names:
            raise unknown("bounds and scales: state", name, [*problem.state, *names])
    bounds = [options.bounds.get(name, (-np.inf, np.inf)) for name in problem.state]
    low, high = span
    return Curve(
        field=problem.field,
        kind=EQUILIBRIUM,
        par=np.array(list(problem.parameters.values())),
        active=(names.index(parameter),),
        scale=np.append(np.ones(n), high - low),
        period=np.array([*(problem.periods.get(name, 0.0) for name in problem.state), 0.0]),
        low=np.array([*(pair[0] for pair in bounds), low]),
        high=np.array([*(pair[1] for pair in bounds), high]),
        options=options,
        conservative=problem.conservative,
        discrete=problem.map,
    )
