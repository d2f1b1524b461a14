"""Critical values of one parameter, labelled: where equilibria merge, and the sign change of A."""

from __future__ import annotations

import functools
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import xarray as xr

from phasekit.bifurcation.along import Points, mergers_along
from phasekit.bifurcation.exact.critical import critical_reduced
from phasekit.bifurcation.exact.fold_values import fold_values
from phasekit.cells.evaluate import evaluate
from phasekit.cells.request import with_words
from phasekit.cells.schema import dataset_attrs, input_attrs, own_names
from phasekit.errors import MergerKind
from phasekit.labelled.atlas import limits, resting, tell_missing
from phasekit.labels.arguments import FloatArray, bad, call_checked, unknown
from phasekit.labels.grid import loaded_grid, variable
from phasekit.laws.trigonometric import Trigonometric
from phasekit.systems.system import System, as_system
from phasekit.table.quantities import ROWS
from phasekit.table.row import Pass

_CRITICAL = ("critical_fold", "critical_sign_change")


@call_checked
def critical(system: Any, parameter: str, span: Any = None) -> xr.Dataset:
    """Values of one parameter at which equilibria merge, or A changes sign.

    Parameters
    ----------
    system : system
        Any system in a potential; its own value of the parameter is not used. Of a `Perturbed`
        system the constant torque counts, and nothing else.
    parameter : str
        Any parameter on which the equilibria depend: beta, e, a, omega1, r or g of a
        `GyroRotorDisk`, h_x of a `StonerWohlfarth`, one of a `Potential`, torque of a `Perturbed`
        system, ...; lam and psi for every system with coefficients (A, B, C).
    span : (float, float), optional
        Where all values are looked for, in the parameter's unit. Without it a system with
        coefficients (A, B, C) has its positive solutions; of any other it is the domain of the
        parameter that its class declares, where that is finite.

    Returns
    -------
    xarray.Dataset
        In a span: ``critical_fold``, all values at which equilibria merge or cross, from the least
        to the greatest on the numbered dim ``fold``, NaN beyond those that a cell has;
        ``critical_fold_phi``, where; ``critical_fold_kind``, a code of `MergerKind`;
        ``critical_fold_error``, a bound of the error of the value; and ``complete``: whether it is
        proved that there are no others, else a RuntimeWarning says why.

        Without a span: ``critical_fold`` on the dim ``fold`` (minus: the one with A < 0, plus:
        A > 0) and ``critical_sign_change``: the positive solution (angles in [0, pi/2]), the least
        where there are several, NaN where there is none. In the units of the parameter, which the
        attribute ``parameter`` names.

    Raises
    ------
    ParameterError
        If the system is unusable, has no such parameter, or needs a span.

    Notes
    -----
    The fold, where ``V' = V'' = 0`` ([Kuznetsov2004] section 3.3) for the V of [Veljovic2015] (15),
    is ``|B|^(2/3) + |C|^(2/3) = |A|^(2/3)``, the sign change ``A = 0``. They are solved
    in closed form for beta, e, a and omega1 of a disk and for lam and psi, and by exact isolation
    of the roots of a polynomial for all other parameters (some milliseconds a cell), and in spans.
    In any other potential, and under a torque, they are proved by interval arithmetic, as in
    `branches` (some hundredths of a second a cell).

    Examples
    --------
    >>> import phasekit as pk
    >>> tilted = pk.Potential("x^4/4 - m*x^2/2 + h*x", "x", {"m": 0.0, "h": [0.1, 0.2]})
    >>> found = pk.critical(tilted, "m", (-1.0, 2.0))  # 3 (h/2)^(2/3)
    >>> found.critical_fold.values[:, 0].round(9).tolist(), found.complete.all().item()
    ([0.407162642, 0.646330407], True)
    >>> disk = pk.GyroRotorDisk(beta=18 * pk.deg, e=0.001153, a=0.002, r=0.2, omega1=2.518)
    >>> pk.critical(disk, "beta").critical_fold.dims
    ('fold',)
    """
    system = as_system(system)
    if span is not None or not system.standing.is_within(Trigonometric):
        return _in_span(system, parameter, span)
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
        function = functools.partial(_by_name, solve or _fold_values(system, parameter), inputs)
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


def _in_span(system: System, parameter: str, span: Any) -> xr.Dataset:
    """All values in a span, cell by cell."""
    declared = {p.name: p for p in system.declared}
    if isinstance(parameter, str) and parameter in declared:
        own = declared[parameter]
        # Neither its own value nor its axis counts.
        system = system.replace(**{parameter: own.example})
        if span is None and np.isfinite([own.least, own.high]).all():
            span = (own.least, own.high)
    inputs = {name: value for name, value in system.parameters.items() if name != parameter}
    grid = loaded_grid(inputs)
    dims, shape = tuple(grid.sizes), tuple(grid.sizes.values())
    arrays = {name: np.broadcast_to(grid.aligned(name, dims), shape) for name in grid.inputs}
    found: list[Points] = []
    for cell in np.ndindex(shape):
        values = {name: float(array[cell]) for name, array in arrays.items()}
        valid = all(bool(declared[name].valid(x)) for name, x in values.items())
        if not valid and shape:
            found.append(Points([], "a parameter is not valid"))
            continue
        one, law, numbers = resting(system.replace(**values), parameter, what="critical")
        if span is None:
            wants = f"(low, high), the values of {parameter} among which critical ones are sought"
            raise bad("span", None, wants)
        units = next(p.units for p in one.declared if p.name == parameter)
        found.append(mergers_along(law, numbers, parameter, limits(one, parameter, "span", span)))
    missing = [points.missing for points in found if points.missing]
    if missing:
        of = f" in {len(missing)} of {len(found)} systems" if shape else ""
        tell_missing("critical", parameter, missing[0], of)
    most = max((len(points.found) for points in found), default=0)
    table = np.full((len(found), most), np.nan), np.full((len(found), most), np.nan)
    kinds, errors = np.zeros((len(found), most), np.int8), np.full((len(found), most), np.nan)
    for k, points in enumerate(found):
        for j, (at, phi, kind, error) in enumerate(points.found):
            table[0][k, j], table[1][k, j], errors[k, j] = at, phi, error
            kinds[k, j] = MergerKind[kind.upper()]
    angle, value = with_words(system, [ROWS["phi"], ROWS["critical_fold"]])
    on = (*dims, "fold")
    about: dict[str, tuple[Any, dict[str, Any]]] = {
        "critical_fold": (table[0], {**value.attrs, "units": units, "equation": "V' = V'' = 0"}),
        "critical_fold_phi": (
            table[1], {"long_name": "where equilibria merge", "units": angle.units}
        ),
        "critical_fold_kind": (kinds, {"long_name": "how equilibria merge", **_FLAGS}),
        "critical_fold_error": (
            errors, {"long_name": "bound of the error of the value", "units": units}
        ),
    }  # fmt: skip
    data = {
        name: variable(on, values.reshape((*shape, most)), {**attrs, "parameter": parameter})
        for name, (values, attrs) in about.items()
    }
    proved = np.array([not points.missing for points in found]).reshape(shape)
    data["complete"] = variable(
        dims, proved, {"long_name": "whether these are proved to be all in the span"}
    )
    coords = {**grid.coords, "fold": variable(("fold",), np.arange(most), {"long_name": _NUMBER})}
    for name, given in grid.inputs.items():
        if name not in coords:
            coords[name] = variable(map(str, given.dims), given.data, input_attrs(system, name))
    coords |= own_names(system.coordinate or "phi", {**data, **coords})
    return xr.Dataset(data, coords, dataset_attrs(system))


_NUMBER = "critical value, by its number"
_FLAGS = {
    "flag_values": np.array([kind.value for kind in MergerKind], np.int8),
    "flag_meanings": " ".join(kind.name.lower() for kind in MergerKind),
}


def _fold_values(system: System, parameter: str) -> Callable[..., Any]:
    law = system.trigonometric()
    return lambda **values: fold_values(law, parameter, values)


def _by_name(function: Callable[..., Any], names: tuple[str, ...], *arrays: FloatArray) -> Any:
    return function(**dict(zip(names, arrays, strict=True)))


def _critical_fields(function: Callable[..., Any], *arrays: FloatArray) -> tuple[Any, Any]:
    minus, plus, sign_change = function(*arrays)
    return np.stack(np.broadcast_arrays(minus, plus), axis=-1), sign_change
