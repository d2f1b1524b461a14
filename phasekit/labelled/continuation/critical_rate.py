"""`critical_rate`: how fast a parameter may drift before a system leaves its attractor."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from phasekit.bifurcation.continuation.options import ContinuationOptions
from phasekit.inputs import call_checked
from phasekit.labelled.continuation.connection import connection
from phasekit.labelled.continuation.cycle_branch import ConnectionBranch
from phasekit.labels.arguments import bad, list_names, number, unknown
from phasekit.systems.problem import Problem, as_problem

SAME = 1e-9  # distance from the end of the ramp, beside the larger of both ends


@call_checked
def critical_rate(
    problem: Any,
    ramp: Mapping[str, str],
    attractor: Mapping[str, float],
    edge: Mapping[str, float],
    *,
    rate: str,
    parameters: Mapping[str, float],
    ends: float = 1e-7,
    options: ContinuationOptions | None = None,
) -> ConnectionBranch:
    """Find the rate of a ramp at which a system tips: its attractor then leads to an edge state.

    Parameters
    ----------
    problem : Problem
        The system at rest, as formulas, with the parameter that drifts among its parameters.
    ramp : mapping of str to str
        The name of that parameter, and a formula of how fast it changes: of itself and of
        parameters, ``{"p": "r*p*(1 - p)"}``. It vanishes at both ends of the ramp.
    attractor : mapping of str to float
        The equilibrium that the ramp begins at: states near it by name, and the parameter.
    edge : mapping of str to float
        The same of the equilibrium behind which the system tips, at the end of the ramp. It has one
        unstable direction.
    rate : str
        The parameter of the ramp that is looked for.
    parameters : mapping of str to float
        Parameters of the ramp that the problem has not, with a first value of the rate.
    ends : float, default 1e-7
        Distance of the ends of the orbit from the equilibria, beside its size.
    options : ContinuationOptions, optional
        Mesh, tolerances, scales.

    Returns
    -------
    ConnectionBranch
        The orbit at the critical rate, the value of which is ``points[rate]``;
        ``.curve(parameter, span)`` follows it.

    Raises
    ------
    ParameterError
        If an argument is unusable, or an equilibrium is not what it is to be.
    ConvergenceError
        If no such orbit is found near the first value of the rate.

    Notes
    -----
    The ramped parameter becomes a state, and the critical orbit one that connects two equilibria
    ([WieczorekXieJones2021]).

    Examples
    --------
    >>> import phasekit as pk
    >>> fold = pk.Problem({"x": "(x + p)^2 - mu"}, parameters={"p": 0.0, "mu": 0.25})
    >>> tipping = pk.critical_rate(
    ...     fold, {"p": "r*p*(L - p)"}, {"x": -0.5, "p": 0.0}, {"x": -2.5, "p": 3.0},
    ...     rate="r", parameters={"r": 0.2, "L": 3.0},
    ... )
    >>> round(float(tipping.points.r[0]), 10)  # 4 mu/(L (L - 2 sqrt(mu)))
    0.1666666667
    """
    problem = as_problem(problem)
    if problem.kind != "symbolic" or problem.map or problem.time is not None:
        raise bad("problem", problem, "a flow of formulas that do not depend on time")
    if not isinstance(ramp, Mapping) or len(ramp) != 1:
        raise bad("ramp", ramp, "one parameter and a formula, such as {'p': 'r*p*(1 - p)'}")
    ((name, formula),) = ramp.items()
    if name not in problem.parameters:
        raise unknown("ramp: parameter of the problem", name, problem.parameters)
    if not isinstance(parameters, Mapping):
        raise bad("parameters", parameters, "a mapping from names to numbers")
    values = {k: v for k, v in problem.parameters.items() if k != name}
    for key, value in parameters.items():
        values[key] = number(f"parameters[{key!r}]", value, "a number", None)
    if not isinstance(rate, str) or rate not in values:
        raise unknown("rate: parameter of the ramp", rate, values)
    states = (*problem.state, name)
    moving = Problem([*problem.f, formula], states, values, periods=dict(problem.periods))
    places = []
    for argument, given in (("attractor", attractor), ("edge", edge)):
        if not isinstance(given, Mapping) or set(given) != set(states):
            raise bad(argument, given, f"values of {list_names(states)}")
        places.append([number(f"{argument}[{s!r}]", given[s], "a number", None) for s in states])
    size = max(abs(place[-1]) for place in places)
    for argument, place, wanted in (("attractor", places[0], 0), ("edge", places[1], 1)):
        value, slopes = problem.replace(**{name: place[-1]}).derivatives(place[:-1])
        found = int(np.sum(np.linalg.eigvals(slopes).real > 0.0))
        if not np.isfinite(value).all() or found != wanted:
            what = "no unstable direction" if wanted == 0 else "one unstable direction"
            raise bad(argument, dict(zip(states, place, strict=True)), what, f"it has {found}")
        f, slopes = moving.derivatives(place)
        drift = float(f[-1])
        if not abs(drift) <= SAME * abs(slopes[-1, -1]) * size:  # the ramp's end is not near
            raise bad(argument, place[-1], f"{name} at an end of the ramp", f"it drifts by {drift}")
    return connection(moving, (places[0], places[1]), rate, ends=ends, options=options)
