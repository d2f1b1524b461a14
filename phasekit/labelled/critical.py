"""Critical values of one parameter, labelled: folds of equilibria and the sign change of A."""

from __future__ import annotations

import functools
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import xarray as xr

from phasekit.bifurcation.critical import critical_disk, critical_reduced
from phasekit.labelled.arguments import FloatArray, unknown
from phasekit.labelled.evaluate import evaluate
from phasekit.labelled.models import GyroRotorDisk
from phasekit.labelled.quantities import ROWS, Pass
from phasekit.labelled.system import as_system

_CRITICAL = ("critical_fold", "critical_sign_change")

#: A legal value in place of the parameter that is solved for.
_NEUTRAL = {"beta": np.pi / 2, "e": 1.0, "a": 0.0, "omega1": 1.0, "lam": 1.0, "psi": 1.0}


def critical(system: Any, parameter: str) -> xr.Dataset:
    """Values of one parameter at which equilibria merge, or A changes sign.

    Parameters
    ----------
    system : system
        Any system; its own value of the parameter is not used.
    parameter : {"beta", "e", "a", "omega1", "lam", "psi"}
        beta, e, a and omega1 for a `GyroRotorDisk`; lam and psi for every system.

    Returns
    -------
    xarray.Dataset
        ``critical_fold`` on the dim ``fold`` (minus: the one with A < 0, plus: A > 0) and
        ``critical_sign_change``: the positive solution (beta in [0, pi/2]), NaN where there is
        none. In the units of the parameter, which the attribute ``parameter`` names.

    Raises
    ------
    ParameterError
        If the system is unusable, or has no such parameter.

    Notes
    -----
    The fold is ``|B|^(2/3) + |C|^(2/3) = |A|^(2/3)``, the sign change ``A = 0``, solved for the
    parameter in closed form.

    Examples
    --------
    >>> import phasekit as pk
    >>> disk = pk.GyroRotorDisk(beta=18 * pk.deg, e=0.001153, a=0.002, r=0.2, omega1=2.518)
    >>> pk.critical(disk, "beta").critical_fold.dims
    ('fold',)
    """
    system = as_system(system, closed_form="critical")
    names: dict[str, str] = {}
    if isinstance(system, GyroRotorDisk):
        names.update({p.name: p.units for p in system.declared if p.name in _NEUTRAL})
    names.update({"lam": "1", "psi": "1"})
    if not isinstance(parameter, str) or parameter not in names:
        raise unknown(f"parameter of critical for {type(system).__name__}", parameter, names)
    function: Callable[..., Any]
    if parameter in ("lam", "psi"):
        inputs: tuple[str, ...] = ("A", "B", "C")
        function = functools.partial(critical_reduced, parameter)
    else:
        inputs = GyroRotorDisk.formula_inputs()
        function = functools.partial(_by_name, functools.partial(critical_disk, parameter), inputs)
    if parameter in system.parameters:  # not an input: neither its value nor its axis counts
        system = system.replace(**{parameter: _NEUTRAL[parameter]})
    one = Pass(functools.partial(_critical_fields, function), inputs, ("critical",))
    rows = [replace(ROWS[n], units=names[parameter]) for n in _CRITICAL]
    ds = evaluate(system, rows, (one,))
    ds = ds.drop_vars(parameter, errors="ignore")
    for name in _CRITICAL:
        ds[name].attrs["parameter"] = parameter
    return ds


def _by_name(function: Callable[..., Any], names: tuple[str, ...], *arrays: FloatArray) -> Any:
    return function(**dict(zip(names, arrays, strict=True)))


def _critical_fields(function: Callable[..., Any], *arrays: FloatArray) -> tuple[Any, Any]:
    minus, plus, sign_change = function(*arrays)
    return np.stack(np.broadcast_arrays(minus, plus), axis=-1), sign_change
