"""Critical values of one parameter, labelled: folds of equilibria and the sign change of A."""

from __future__ import annotations

import functools
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import xarray as xr

from phasekit.bifurcation.exact.critical import critical_reduced
from phasekit.bifurcation.exact.fold_values import fold_values
from phasekit.cells.evaluate import evaluate
from phasekit.labels.arguments import (
    FloatArray,
    call_checked,
    unknown,
)
from phasekit.laws.trigonometric import Trigonometric
from phasekit.systems.system import System, as_system
from phasekit.table.quantities import ROWS
from phasekit.table.row import Pass

_CRITICAL = ("critical_fold", "critical_sign_change")


@call_checked
def critical(system: Any, parameter: str) -> xr.Dataset:
    """Values of one parameter at which equilibria merge, or A changes sign.

    Parameters
    ----------
    system : system
        Any system; its own value of the parameter is not used.
    parameter : str
        Any parameter on which the system's coefficients depend: beta, e, a, omega1, r or g of a
        `GyroRotorDisk`, h_x of a `StonerWohlfarth`, ...; lam and psi for every system.

    Returns
    -------
    xarray.Dataset
        ``critical_fold`` on the dim ``fold`` (minus: the one with A < 0, plus: A > 0) and
        ``critical_sign_change``: the positive solution (angles in [0, pi/2]), the least where
        there are several (`branches` has them all), NaN where there is none. In the units of the
        parameter, which the attribute ``parameter`` names.

    Raises
    ------
    ParameterError
        If the system is unusable, or has no such parameter.

    Notes
    -----
    The fold, where ``V' = V'' = 0`` ([Kuznetsov2004] section 3.3) for the V of [Veljovic2015] (15),
    is ``|B|^(2/3) + |C|^(2/3) = |A|^(2/3)``, the sign change ``A = 0``. They are solved
    in closed form for beta, e, a and omega1 of a disk and for lam and psi, and by exact isolation
    of the roots of a polynomial for all other parameters (some milliseconds a cell).

    Examples
    --------
    >>> import phasekit as pk
    >>> disk = pk.GyroRotorDisk(beta=18 * pk.deg, e=0.001153, a=0.002, r=0.2, omega1=2.518)
    >>> pk.critical(disk, "beta").critical_fold.dims
    ('fold',)
    """
    system = as_system(system, rung=Trigonometric, what="critical")
    units = {"lam": "1", "psi": "1"}
    units |= {p.name: p.units for p in system.declared if p.name in system.formula_inputs()}
    if not isinstance(parameter, str) or parameter not in units:
        raise unknown(f"parameter of critical for {type(system).__name__}", parameter, units)
    function: Callable[..., Any]
    if parameter in ("lam", "psi"):
        inputs: tuple[str, ...] = ("A", "B", "C")
        function = functools.partial(critical_reduced, parameter)
    else:
        inputs = system.formula_inputs()
        solve = system.critical_values.get(parameter)
        function = functools.partial(_by_name, solve or _of(system, parameter), inputs)
    for declared in system.declared:
        if declared.name == parameter:  # not an input: neither its value nor its axis counts
            system = system.replace(**{parameter: declared.example})
    one = Pass(functools.partial(_critical_fields, function), inputs, ("critical",))
    rows = [replace(ROWS[n], units=units[parameter]) for n in _CRITICAL]
    ds = evaluate(system, rows, (one,))
    ds = ds.drop_vars(parameter, errors="ignore")
    for name in _CRITICAL:
        ds[name].attrs["parameter"] = parameter
    return ds


def _of(system: System, parameter: str) -> Callable[..., Any]:
    law = system.trigonometric()
    return lambda **values: fold_values(law, parameter, values)


def _by_name(function: Callable[..., Any], names: tuple[str, ...], *arrays: FloatArray) -> Any:
    return function(**dict(zip(names, arrays, strict=True)))


def _critical_fields(function: Callable[..., Any], *arrays: FloatArray) -> tuple[Any, Any]:
    minus, plus, sign_change = function(*arrays)
    return np.stack(np.broadcast_arrays(minus, plus), axis=-1), sign_change
