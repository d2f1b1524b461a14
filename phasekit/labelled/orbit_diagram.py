"""Orbit diagrams: where maps and forced flows end up, value by value of a parameter."""

from __future__ import annotations

import warnings
from typing import Any

import numpy as np
import xarray as xr

from phasekit.cells.schema import dataset_attrs, input_attrs
from phasekit.labelled.flows import states_of
from phasekit.labels.arguments import bad, call_checked, flag, number, numeric, unknown, whole
from phasekit.labels.grid import variable
from phasekit.laws.equations import Equations, equations_of
from phasekit.laws.ladder import Map
from phasekit.motion import flows
from phasekit.motion.flow import ATOL, RTOL
from phasekit.numerics.waits import notice, stage
from phasekit.systems.problem import as_problem
from phasekit.systems.system import as_system


@call_checked
def orbit_diagram(
    system: Any,
    parameter: str,
    values: Any,
    x0: Any = None,
    *,
    n: int = 200,
    skip: int = 1000,
    from_last: bool = True,
) -> xr.Dataset:
    """States of a map, or of a forced flow once a period, after transients: for many values.

    Parameters
    ----------
    system : Problem, or system that states rates or a step
        A map, or a flow with a period; one system.
    parameter : str
        The parameter that changes.
    values : 1-D array_like
        Its values, in the order in which they are taken: up, down, or both.
    x0 : mapping or sequence, optional
        State at the first value; by default the middle of the window.
    n : int, default 200
        States to keep at each value.
    skip : int, default 1000
        Iterations, or periods, before them.
    from_last : bool, default True
        Whether each value begins where the one before it ended, so that a branch is followed and
        hysteresis shows; else all begin at `x0`.

    Returns
    -------
    xarray.Dataset
        ``sample_`` and the name of each state on (parameter, ``sample``). NaN where a motion left
        for infinity, which a RuntimeWarning says; the next value then begins at `x0` again.

    Raises
    ------
    ParameterError
        If the system is neither, or an argument is unusable.

    Notes
    -----
    The bifurcation diagram of [GuckenheimerHolmes1983] section 6.3 shows attractors; it does not
    find unstable orbits, which `continuation` follows.

    Examples
    --------
    >>> import numpy as np
    >>> import phasekit as pk
    >>> logistic = pk.Problem("r*x*(1 - x)", "x", {"r": 3.0}, map=True, window={"x": (0, 1)})
    >>> ds = pk.orbit_diagram(logistic, "r", [2.8, 3.2, 3.5], n=64)
    >>> [len(np.unique(row.round(9))) for row in ds.sample_x.values]
    [1, 2, 4]
    """
    found = as_system(system)
    found = found if found.standing.traits is None else as_problem(found)
    law = equations_of(found)
    if law is None or not (isinstance(law, Map) or law.period is not None):
        hint = "for other flows use pk.poincare_section, or follow equilibria by pk.diagram"
        raise bad("system", found, "a map, or a flow with a period", hint)
    problem = as_problem(found)
    if not isinstance(parameter, str) or parameter not in law.names:
        raise unknown("parameter of the problem", parameter, law.names)
    array = np.atleast_1d(np.asarray(numeric("values", values, None)))
    if not np.isfinite(array).all():
        raise bad("values", values, "finite numbers")
    n = whole("n", n, "a number of states >= 1")
    skip = whole("skip", skip, "a number of iterations or periods >= 0", 0)
    flag("from_last", from_last)
    start = _start(law, x0)
    fixed = {name: float(problem.parameters[name]) for name in law.names}
    with notice(f"following {array.size:,} values of {parameter}"):
        samples = _samples(law, fixed, parameter, array, start, n, skip, from_last)
    lost = int(np.isnan(samples).any(axis=(1, 2)).sum())
    if lost:
        warnings.warn(
            f"orbit_diagram: at {lost} of {array.size} values motions run to infinity",
            RuntimeWarning,
            stacklevel=2,
        )
    data = {
        f"sample_{name}": variable(
            (parameter, "sample"), samples[..., i],
            {"long_name": f"{name} after transients", "units": law.units.get(name, "1")},
        )
        for i, name in enumerate(law.states)
    }  # fmt: skip
    what = "iteration" if isinstance(law, Map) else "period"
    coords = {
        parameter: variable((parameter,), array, input_attrs(found, parameter)),
        "sample": variable(
            ("sample",), np.arange(skip, skip + n), {"long_name": f"number of the {what}"}
        ),
        **{
            name: variable((), value, input_attrs(found, name))
            for name, value in fixed.items()
            if name != parameter
        },
    }
    return xr.Dataset(data, coords, dataset_attrs(found))


def _start(law: Equations, x0: Any) -> Any:
    if x0 is None:
        missing = [name for name in law.states if name not in law.window]
        if missing:
            raise bad("x0", None, f"a state, or a window of {', '.join(missing)}")
        return np.array([0.5 * sum(law.window[name]) for name in law.states])
    given = [value for _, value in states_of(law, x0, {}).values()]
    return np.array([number("x0", value) for value in given])


def _samples(
    law: Equations, fixed: dict[str, float], parameter: str, values: Any, start: Any,
    n: int, skip: int, from_last: bool,
) -> Any:  # fmt: skip
    """States of shape (values, samples, states)."""
    if not from_last:
        return _of(law, fixed, parameter, values, np.tile(start, (len(values), 1)), n, skip)
    found, x = np.empty((len(values), n, len(start))), start
    for k in range(len(values)):
        found[k] = _of(law, fixed, parameter, values[k : k + 1], x[None], n, skip)[0]
        x = found[k, -1] if np.isfinite(found[k, -1]).all() else start
        stage(f"{k + 1:,} of {len(values):,} values")
    return found


def _of(
    law: Equations, fixed: dict[str, float], parameter: str, values: Any, x: Any, n: int, skip: int
) -> Any:
    count = len(values)
    own = {name: np.full(count, value) for name, value in fixed.items()} | {parameter: values}
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # how many are lost is said once
        if isinstance(law, Map):
            times = np.broadcast_to(np.arange(skip, skip + n) * float(law.times), (count, n))
            return flows.iterates(law, own, x, times)[0]
        given = [own[name] for name in law.names]
        parts = flows.sections(law, *given, *x.T, n=n, skip=skip, period=None, rtol=RTOL, atol=ATOL)
    return np.stack([parts[f"section_{name}"] for name in law.states], axis=-1)
