"""Maps: quantities over a grid of parameters, in memory, as one labelled Dataset."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from os import PathLike
from typing import Any

import numpy as np
import xarray as xr

from phasekit.errors import ParameterError
from phasekit.labelled.arguments import Value, bad, flag, numeric, unknown
from phasekit.labelled.evaluate import evaluate, leaves
from phasekit.labelled.quantities import STATES, select
from phasekit.labelled.store import StoreTarget
from phasekit.labelled.system import Model, as_system


def sweep(
    system: Any,
    axes: Mapping[str, Any] | None = None,
    *,
    of: str | Iterable[str] = ("equilibria", "separatrices"),
    store: str | PathLike[str] | None = None,
    progress: bool | None = None,
    overwrite: bool = False,
    **axes_by_name: Any,
) -> xr.Dataset:
    """Map quantities over one or more parameters of a system.

    Parameters
    ----------
    system : system
        A `GyroRotorDisk`, `Reduced`, `Coefficients` or any other system.
    axes : mapping of str to array_like, optional
        Values of the swept parameters: 1-D lists, arrays or ranges, each a dim of the map, in
        the order given; or DataArrays, which broadcast by the names of their dims. Likewise the
        states that the quantities need (``state_phi``, ``state_dphi``, ``time``, ...), which may
        be single numbers as well.
    of : str or iterable of str, default ("equilibria", "separatrices")
        Quantities, or groups of them; `quantities` lists them.
    store : path, optional
        Write the map there as well: a name that ends in ``.zarr`` (Zarr v3) or ``.nc`` (netCDF).
    progress : bool, optional
        Show a progress bar. Default: if it takes longer than a second, in a terminal.
    overwrite : bool, default False
        Replace a map that is already at `store`.
    **axes_by_name
        Axes by keyword in place of `axes`.

    Returns
    -------
    xarray.Dataset
        The quantities with units, equations and sources. Swept parameters are dimension
        coordinates, fixed ones scalar coordinates; ``ds.phasekit.system()`` rebuilds the system
        of any selection. Cells whose parameters are not valid hold NaN, and -1 in n_equilibria.

    Raises
    ------
    ParameterError
        If an axis or a quantity is unknown or unusable, or the map would not fit into memory.
    StoreError
        If `store` exists and overwrite is not set, or cannot be written.

    Examples
    --------
    >>> import numpy as np
    >>> import phasekit as pk
    >>> disk = pk.GyroRotorDisk(beta=0.3, e=0.001153, a=0.002, r=0.2, omega1=2.518)
    >>> ds = pk.sweep(disk, beta=np.linspace(0.01, 1.5, 4), a=[0.0, 0.01, 0.02])
    >>> dict(ds.n_equilibria.sizes)
    {'beta': 4, 'a': 3}
    >>> ds.sel(beta=0.5, a=0.01, method="nearest").phasekit.system().a
    0.01
    """
    flag("overwrite", overwrite)
    if progress is not None:
        flag("progress", progress)
    system = as_system(system)
    rows = select(of)
    passes = system.methods.passes(rows)
    needed = {name for one in passes for name in leaves(system, one.inputs, passes)}
    states = [name for name in STATES if name in needed]
    kept = _axes(system, axes, axes_by_name, states)
    target = StoreTarget(store, overwrite=overwrite) if store is not None else None
    parameters = {name: value for name, value in kept.items() if name not in STATES}
    order = list(dict.fromkeys(dim for name, value in kept.items() for dim in _dims(name, value)))
    ds = evaluate(
        system.replace(**parameters),
        rows,
        passes,
        states={name: value for name, value in kept.items() if name in STATES},
        order=order,
        progress=progress,
    )
    if target is not None:
        target.write(ds)
    return ds


def _axes(
    system: Model, axes: Mapping[str, Any] | None, by_name: Mapping[str, Any], states: list[str]
) -> dict[str, Value]:
    if axes is not None and not isinstance(axes, Mapping):
        raise bad("axes", axes, "a mapping of parameter names to values, {'beta': [...], ...}")
    given = dict(axes or {})
    for name in by_name:
        if name in given:
            raise ParameterError(f"{name}: got it in axes and as a keyword, wants it once")
    given.update(by_name)
    valid = [parameter.name for parameter in system.declared] + states
    kept: dict[str, Value] = {}
    for name, value in given.items():
        if name not in valid:
            raise _unknown_axis(system, name, valid)
        kept[name] = numeric(name, value)
        if isinstance(kept[name], float) and name not in states:
            raise bad(
                name,
                value,
                "a 1-D list, array or range of values to sweep over",
                f"to change a fixed parameter use system.replace({name}=...)",
            )
    if not kept and all(isinstance(v, float) for v in system.parameters.values()):
        raise ParameterError(
            f"axes: got none, wants at least one of {', '.join(valid)}, "
            f"as in pk.sweep(system, {valid[0]}=[...])"
        )
    return kept


def _unknown_axis(system: Model, name: Any, valid: list[str]) -> ParameterError:
    if name in ("lam", "psi", "A", "B", "C"):
        other = "system.reduced()" if name in ("lam", "psi") else "system.coefficients()"
        return ParameterError(
            f"axis {name!r} is not a parameter of {type(system).__name__}; sweep {other}, "
            f"or one of {', '.join(valid)}"
        )
    return unknown(f"axis of {type(system).__name__}:", name, valid)


def _dims(name: str, value: Value) -> tuple[str, ...]:
    if isinstance(value, xr.DataArray):
        return tuple(map(str, value.dims))
    return (name,) if isinstance(value, np.ndarray) else ()
