"""Maps: quantities over a grid of parameters as one labelled Dataset, in memory or stored."""

from __future__ import annotations

import inspect
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from os import PathLike
from typing import Any

import numpy as np
import xarray as xr

from phasekit.cells.evaluate import compute
from phasekit.cells.request import Request, ask, needs_of, passes_of
from phasekit.errors import BranchStatus, ParameterError, warn
from phasekit.inputs import call_checked
from phasekit.labels.arguments import Value, bad, flag, numeric, unknown
from phasekit.labels.coordinates import STATES
from phasekit.labels.grid import refuse_too_large
from phasekit.laws.ladder import Map
from phasekit.maps.job import Job, plan_job
from phasekit.maps.options import StoreOptions, check_dtypes, without_store
from phasekit.maps.whole import WholeTarget, open_map, target_of
from phasekit.spellings import ARGUMENTS
from phasekit.systems.parameter import warn_of_invalid
from phasekit.systems.system import System, as_system
from phasekit.table.quantities import TABLE, select
from phasekit.table.row import Quantity, Table

#: What is computed where nothing is said, as far as the system's law offers it.
OFFERED = ("equilibria", "separatrices")


@call_checked
def sweep(
    system: Any,
    axes: Mapping[str, Any] | None = None,
    *,
    of: str | Iterable[str] = OFFERED,
    along: tuple[str, Sequence[float]] | None = None,
    store: str | PathLike[str] | Any | None = None,
    chunks: int | Mapping[str, int] | None = None,
    workers: int | None = None,
    client: Any = None,
    progress: bool | None = None,
    overwrite: bool = False,
    force: bool = False,
    dtype: str | Mapping[str, str] | None = None,
    **axes_by_name: Any,
) -> xr.Dataset:
    """Map quantities over one or more parameters of a system.

    Parameters
    ----------
    system : system
        A `GyroRotorDisk`, `Reduced`, `Coefficients`, `Problem` or any other system.
    axes : mapping of str to array_like, optional
        Values of the swept parameters: 1-D lists, arrays or ranges, each a dim of the map, in
        the order given; or DataArrays, which broadcast by the names of their dims. Likewise the
        states that the quantities need (``state_phi``, ``state_dphi``, ``time``, ..., or ``phi``,
        ``dphi``, ``t`` as the labelled functions call them), which may be single numbers as well.
    of : str or iterable of str, default ("equilibria", "separatrices")
        Quantities, or groups of them; `quantities` lists them. Of a system with states of its own,
        such as a `Problem`: ``equilibria`` in its window with ``n_equilibria`` and ``n_stable``,
        ``attractors`` and ``basin_fractions`` of motions from its window; and of the motion from
        one state, by default next to the middle of the window (where symmetric laws have motions
        of their own), ``lyapunov`` after a ``duration`` (a map: ``n`` iterations), and the
        ``period`` and ``extrema`` of the attractor to which it comes: ``min_``, ``max_`` and
        ``mean_`` of each state and observable, ``_error`` beside the first two, or of a formula
        of the states, ``"max(x*y)"``. So it is of systems with terms, for what no other line of
        the table bears.
    along : (str, (float, float)), optional
        A parameter and its span: in each cell all branches of equilibria (of a map: of fixed
        points) along it are followed, from all equilibria in the window at both ends of the span
        and through branch points. Then ``of`` takes ``special_points`` (kind, parameter, states,
        coefficient of the normal form and status on the dim ``special_point``, and numbers of
        each kind: ``n_fold``, ``n_hopf``, ...), ``n_stable`` (how many stable equilibria there are
        at one value, at most) and ``hysteresis`` (the intervals with two of them or more).
        ``branch_status`` says of each cell whether these are all; see `BranchStatus`.
    store : path, URL or zarr store, optional
        Put the map there: a name that ends in ``.zarr``, a URL that fsspec knows, or a store of
        zarr (Zarr v3), tile by tile, so that it need not fit into memory; or a name that ends in
        ``.nc`` (netCDF), in one go. A Zarr store that the same call began is continued, and one
        that has fewer quantities or shorter axes is extended; what it holds is not computed anew.
    chunks : int or mapping of str to int, optional
        Cells of a tile along each dim of the map, or along those named; -1: all. The tiles are
        the chunks of the store. Default: about a million cells, or 128 MB.
    workers : int, optional
        Number of processes; 1: this one. Default: as many as there are cores, this one for maps
        that take seconds.
    client : dask.distributed.Client or str, optional
        Compute on the workers of a dask cluster, given by its client or its scheduler's address;
        all of them must reach the store by the same name.
    progress : bool, optional
        Show a progress bar. Default: if it takes longer than a second, in a terminal.
    overwrite : bool, default False
        Replace a map that is already at `store`.
    force : bool, default False
        Begin also if the map will not fit on the disk.
    dtype : str or mapping of str to str, optional
        ``"float32"`` to store numbers in single precision, or the dtypes of quantities by name.
        They are computed in double precision.
    **axes_by_name
        Axes by keyword in place of `axes`; and ``starts=``, the states from which attractors and
        their basins are looked for: how many of the window (256), or values of states at equal
        distances, ``{"x": np.linspace(-2, 2, 100), "y": 0.0}``, as the grid of `basins`. The
        result has their number and ends as coordinates ``starts_x``, ``first_x``, ``last_x``.

    Returns
    -------
    xarray.Dataset
        The quantities with units, equations and sources. Swept parameters are dimension
        coordinates, fixed ones scalar coordinates; ``ds.phasekit.system()`` rebuilds the system
        of any selection. Cells whose parameters are not valid hold NaN, and -1 in n_equilibria.
        With a Zarr store it is opened from there, as `open_map` does. An `InvalidCellsWarning` says
        how many cells are empty because their parameters are not legal, if a tenth of them is.

    Raises
    ------
    ParameterError
        If an axis or a quantity is unknown or unusable, or the map would not fit into memory.
    StoreError
        If `store` holds something else and overwrite is not set, it cannot be written, the disk
        is too small, or a tile fails. Tiles that are done are kept: the same call resumes the map.

    Warns
    -----
    RuntimeWarning
        If it is not proved of some systems that there are no more equilibria.

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
    >>> henon = pk.Problem(
    ...     {"x": "1 - a*x^2 + y", "y": "b*x"}, parameters={"a": 1.4, "b": 0.3}, map=True
    ... )
    >>> ds = pk.sweep(henon, b=[0.1, 0.3], of="lyapunov", x=0.1, y=0.1, n=1000)
    >>> ds.lyapunov_sum.values.round(9).tolist()  # ln b
    [-2.302585093, -1.203972804]
    """
    flag("overwrite", overwrite)
    flag("force", force)
    if progress is not None:
        flag("progress", progress)
    place = None if store is None else target_of(store)
    system = as_system(system)
    given, ends = {**_plain(axes), **axes_by_name}, dict[str, float]()
    if along is None:
        table, rows = _selected(system, of, starts="starts" in given)
    else:
        table, rows, ends = _branches(system, of, along, given)
    if place is not None:
        _refuse_formulas(rows)
    if place is not None and not place.is_netcdf:
        from phasekit.maps.run import sweep_into  # here: it loads multiprocessing

        request = _asked(system, axes, axes_by_name, rows, table, ends, loaded=True)
        options = StoreOptions.from_request(
            request, chunks, dtype, workers, client, overwrite=overwrite, force=force
        )
        warn_of_invalid(request.system.declared, request.system.parameters)
        sweep_into(place, request, options, progress)
        ds = open_map(store)
        _warn_of_incomplete(system, ds)
        if along is not None:
            _warn_of_branches(ds)
        return ds
    for name, value in {
        "chunks": chunks, "workers": workers, "client": client, "force": force or None
    }.items():  # fmt: skip
        if value is not None:
            raise without_store(name, value)
    target = None if place is None else WholeTarget(place, overwrite=overwrite)
    if dtype is not None:
        dtypes = check_dtypes(dtype, rows)
        rows = tuple(replace(row, dtype=dtypes.get(row.name, row.dtype)) for row in rows)
    request = _asked(system, axes, axes_by_name, rows, table, ends)
    warn_of_invalid(request.system.declared, request.system.parameters)
    try:
        ds = compute(request, progress)
    except MemoryError as error:  # others may have taken some meanwhile
        raise ParameterError(
            "axes: got more than the memory that is left, wants fewer cells; take coarser axes, "
            "name fewer quantities in of=, or put a sweep into a store (store='map.zarr')"
        ) from error
    _warn_of_incomplete(system, ds)
    if along is not None:
        _warn_of_branches(ds)
    if target is not None:
        target.write(ds)
    return ds


def _refuse_formulas(rows: Sequence[Quantity]) -> None:
    """Refuse quantities that are called by a formula, which is no name of an array in a store."""
    if formulas := [row.name for row in rows if not row.name.isidentifier()]:
        hint = "observables={'q': ...} of a pk.Problem gives a formula a name: of='max_q'"
        raise bad("of", formulas[0], "quantities with names for a store", hint)


def _warn_of_incomplete(system: System, ds: xr.Dataset) -> None:
    """Say in how many systems that state their rates or step there may be more equilibria."""
    if system.own_equations is None or "complete" not in ds:
        return
    open_ = ~ds["complete"]
    if "n_equilibria" in ds:  # cells that are not valid were not searched
        open_ &= ds["n_equilibria"] >= 0
    if number := int(open_.sum()):
        warn(
            f"equilibria: it is not proved that there are no others in {number} of {open_.size} "
            "systems; there `complete` is False",
            RuntimeWarning,
        )


def _warn_of_branches(ds: xr.Dataset) -> None:
    """Say in how many cells a map may lack branches or special points, and why."""
    if ds["branch_status"].chunks is not None:
        return
    words = {
        BranchStatus.UNPROVED: "it is not proved that all equilibria at the ends of the span are "
        "there",
        BranchStatus.CUT: "a branch or a family of periodic orbits ends within the span",
        BranchStatus.MISSED: "special points that all neighbours have are on no branch",
        BranchStatus.FAILED: "nothing could be followed",
    }
    status = ds["branch_status"].values
    numbers = {why: int(np.sum(status == code)) for code, why in words.items()}
    found = [f"in {number} {why}" for why, number in numbers.items() if number]
    if found:
        warn(
            f"branches of {status.size} cells: {'; '.join(found)}; branch_status says where",
            RuntimeWarning,
        )


def plan_sweep(
    system: Any,
    axes: Mapping[str, Any] | None,
    *,
    of: Any,
    store: Any,
    chunks: Any = None,
    dtype: Any = None,
    overwrite: bool = False,
) -> Job:
    """Return what `sweep` with a Zarr store would have to do; nothing is computed or written."""
    system = as_system(system)
    table, rows = _selected(system, of, starts="starts" in _plain(axes))
    request = _asked(system, axes, {}, rows, table, loaded=True)
    options = StoreOptions.from_request(request, chunks, dtype, overwrite=overwrite)
    return plan_job(target_of(store), request, options)


def _plain(axes: Any) -> Mapping[str, Any]:
    return axes if isinstance(axes, Mapping) else {}


def _selected(
    system: System, of: Any, *, starts: bool = False
) -> tuple[Table, tuple[Quantity, ...]]:
    """Return the table that a system has, and the rows of it that are named, or offered.

    Where it is said which states motions ``starts`` from, those of its equations.
    """
    if (law := system.own_equations) is None:
        own = None if of is OFFERED else _own_table(system, of, starts)
        if own is None:
            return TABLE, select(of, system.standing if of is OFFERED else None)
        return own, own.select(of)
    from phasekit.cells.equations import table_of  # here: it loads sympy

    table = table_of(system, law, () if of is OFFERED else of)
    if of is OFFERED:
        of = ("equilibria",) if law.time is None else ("attractors",)
    if law.time is not None:
        _refuse_rests(law, table, of)
    rows = table.select(of)
    # How sure they are goes along.
    asked = any(row.group == "equilibria" for row in rows)
    sure = [row for row in table.offered.values() if asked and row.name == "complete"]
    return table, tuple(dict.fromkeys([*rows, *sure]))


def _refuse_rests(law: Any, table: Table, of: Any) -> None:
    """Say why a forced flow has none of the quantities of equilibria."""
    from phasekit.table.equations import rows_of

    rows = rows_of(replace(law, time=None)).values()
    theirs = {"equilibria", *(row.name for row in rows if row.group == "equilibria")}
    names = (of,) if isinstance(of, str) else of if isinstance(of, (list, tuple, set)) else ()
    theirs -= table.offered.keys()
    for name in names:
        if isinstance(name, str) and (name in theirs or not theirs.isdisjoint(_own_inputs(name))):
            wants = "quantities that a flow with forcing has, which has no equilibria"
            hint = "of='attractors', or pk.periodic_orbit, finds its periodic motions"
            raise bad("of", name, wants, hint)


def _own_inputs(name: str) -> set[str]:
    """What a quantity of the user's is made of."""
    groups = {TABLE.rows[name].group} & TABLE.own if name in TABLE.rows else set()
    return {x for one in TABLE.passes if groups.intersection(one.groups) for x in one.inputs}


def _branches(
    system: System, of: Any, along: Any, given: Mapping[str, Any]
) -> tuple[Table, tuple[Quantity, ...], dict[str, float]]:
    """Return the table of branches, the rows of it that are named, and the ends of their span.

    How sure they are goes along.
    """
    from phasekit.cells.along import check_along, table_along

    parameter, ends = check_along(system, along, given)
    of = ("special_points", "n_stable") if of is OFFERED else of
    names = (of,) if isinstance(of, str) else of if isinstance(of, (list, tuple, set)) else ()
    table = table_along(system, parameter, map(str, names))
    chosen = table.select(of)
    whole = {row.group for row in chosen if row.name == row.group}
    rows = tuple(row for row in table.rows.values() if row in chosen or row.group in whole)
    sure = [row for row in table.select("branch_status") if row not in rows]
    return table, (*sure, *rows), ends


def _own_table(system: System, of: Any, starts: bool) -> Table | None:
    """The rows of the first-order equations of a system with terms, where these alone answer."""
    names = (of,) if isinstance(of, str) else tuple(of) if isinstance(of, Iterable) else ()
    if system.standing.traits is None or not all(isinstance(name, str) for name in names):
        return None
    groups = {name: TABLE.rows[name].group if name in TABLE.rows else name for name in names}
    offered = all(TABLE.offers(system.standing, group) for group in groups.values())
    law, own = None, {x for name in names for x in _own_inputs(name)}
    if own:  # which may be made of what the equations alone answer
        from phasekit.table.equations import rows_of

        law = system.equations()
        alone = rows_of(replace(law, time=None)).keys() - TABLE.rows.keys()
        starts = starts or not own.isdisjoint(alone)
    if offered and not starts:
        return None
    from phasekit.cells.equations import table_of

    law = law or system.equations()
    table = table_of(system, law, names)
    if law.time is not None:
        _refuse_rests(law, table, names)
    known = {*table.offered, *(row.group for row in table.offered.values())}
    return table if known.issuperset(names) else None


def _law(system: System, table: Table) -> Any:
    """The equations whose rows a table has; None for the table of all."""
    if (law := system.own_equations) is None and table is not TABLE:
        return system.equations()
    return law


def _asked(
    system: System,
    axes: Mapping[str, Any] | None,
    by_name: Mapping[str, Any],
    rows: tuple[Quantity, ...],
    table: Table = TABLE,
    ends: Mapping[str, float] | None = None,
    *,
    loaded: bool = False,
) -> Request:
    """Return what is computed along axes, whose dims come first; chunked axes `loaded` if so.

    With the ``ends`` of the span of branches, where these are followed.
    """
    swept, states, called = _swept(system, axes, by_name, rows, table)
    states = {**states, **(ends or {})}
    if loaded:
        swept, states = swept.replace(**_loaded(swept.parameters)), _loaded(states)
    kept = {**swept.parameters, **states}
    order = {
        str(dim): None
        for name in called
        for value in [kept[name]]
        if not isinstance(value, float)
        for dim in (value.dims if isinstance(value, xr.DataArray) else (name,))
    }
    return ask(swept, rows, states=states, order=tuple(order), table=table)


def _swept(
    system: System,
    axes: Mapping[str, Any] | None,
    by_name: Mapping[str, Any],
    rows: tuple[Quantity, ...],
    table: Table,
) -> tuple[System, dict[str, Value], dict[str, str]]:
    """Return the system along its axes, the states, and what the call calls each of them."""
    if axes is not None and not isinstance(axes, Mapping):
        raise bad("axes", axes, "a mapping of parameter names to values, {'beta': [...], ...}")
    given = dict(axes or {})
    for name in by_name:
        if name in given:
            raise ParameterError(f"{name}: got it in axes and as a keyword, wants it once")
    given.update(by_name)
    declared = [parameter.name for parameter in system.declared]
    starts = given.pop("starts", None) if "starts" not in declared else None
    law = _law(system, table)
    follows = "branch_status" in table.rows  # branches, which start from no state
    known = () if follows else _states_of(law)
    called: dict[str, str] = {}
    for key in given:
        name = key if key in declared or key in known else _state_called(key, system, law)
        if name not in declared and name not in known:
            raise _unknown_axis(system, key, rows, table)
        if name in called or (name != key and name in given):
            raise ParameterError(f"{key}: got it besides {name}, wants it once")
        called[name] = key
    if not called and all(isinstance(v, float) for v in system.parameters.values()):
        valid, more = _valid(system, rows, table), ""
        try:
            _middles(system, rows, table, {}, starts) if known and table is not TABLE else None
        except ParameterError as error:  # all that is missing is said at once
            more = f"; and {error}"
        raise ParameterError(
            f"axes: got none, wants at least one of {', '.join(valid)}, "
            f"as in pk.sweep(system, {valid[0]}=[...]){more}"
        )
    if any(name in known for name in called):
        valid = _valid(system, rows, table)
        for name, key in called.items():
            if name not in valid:
                raise _unknown_axis(system, key, rows, table)
    swept = system.replace(**{name: given[name] for name in called if name in declared})
    states: dict[str, Value] = {}
    for name, key in called.items():
        if name not in declared:
            states[name] = numeric(key, given[key], system.unit_of(name))
        elif isinstance(swept.parameters.get(name, 0.0), float):
            raise bad(
                name,
                given[key],
                "a 1-D list, array or range of values to sweep over",
                f"to change a fixed parameter use system.replace({name}=...)",
            )
    if table is not TABLE and not follows:
        states |= _middles(system, rows, table, states, starts)
    elif starts is not None:
        raise bad("starts", starts, "nothing for these quantities: no motions start from a grid")
    return swept, states, called


def _state_called(key: Any, system: System, law: Any) -> str:
    """Return the state that an argument of the labelled functions is, which may have its name."""
    coordinate = system.coordinate
    if law is not None:
        if system.standing.traits is not None:
            stem = str(key).removesuffix("0")
            key = {coordinate: "phi", f"d{coordinate}": "dphi"}.get(stem, stem)
        clock = "n" if isinstance(law, Map) else "duration"
        own = str(key).removesuffix("0")
        return "time" if key in ("t", clock) else f"state_{own if own in law.states else key}"
    stem = str(key).rstrip("0")
    if isinstance(coordinate, str) and stem in (coordinate, f"d{coordinate}"):
        stem = "phi" if stem == coordinate else "dphi"
    return "time" if stem in ("t", "duration") else f"state_{stem}"


def _states_of(law: Any) -> tuple[str, ...]:
    """The states that a sweep may be told, by the names of the table."""
    return tuple(STATES) if law is None else (*(f"state_{x}" for x in law.states), "time")


def _middles(
    system: System, rows: tuple[Quantity, ...], table: Table, given: Mapping[str, Value],
    starts: Any,
) -> dict[str, Value]:  # fmt: skip
    """States at the start that are needed and not given, and starts of motions to attractors."""
    from phasekit.cells.equations import chosen_starts, start_of, starts_of
    from phasekit.systems.rests import natural_window

    law = _law(system, table)
    needs = needs_of(system, passes_of(system, rows, table=table))
    names = dict.fromkeys(name for one in needs.values() for name in one)
    clock = "n" if isinstance(law, Map) else "duration"
    missing = [clock] * ("time" in names and "time" not in given)
    found: dict[str, Value] = {}
    for key, name in {f"state_{name}": name for name in law.states}.items():
        if key in names and key not in given:
            if name in law.start or name in law.window:
                found[key] = start_of(law, name)
            else:
                missing.append(name)
    if missing:
        words = {"n": "iterations", "duration": "a time"}
        asked = [f"{words[name]}, {name}=" for name in missing[:1] if name in words]
        if unset := [f"{name}=" for name in missing if name not in words]:
            asked.append(
                f"{'states' if len(unset) > 1 else 'a state'} at the start, {', '.join(unset)}"
            )
        hint = "states may have a window instead" if missing != [clock] else ""
        lacking = {"time", *(f"state_{name}" for name in missing)}
        groups = {g for one, need in needs.items() if not lacking.isdisjoint(need)
                  for g in one.groups}  # fmt: skip
        asking = [row.group if row.name.isidentifier() else row.name for row in rows
                  if row.group in groups]  # fmt: skip
        of = ", ".join(dict.fromkeys(asking))
        raise bad(", ".join(missing), None, f"{'; '.join(asked)}, for {of}", hint)
    if names.keys().isdisjoint(starts_of(law)):
        if starts is not None:
            wants = "nothing for these quantities: no motions start from a grid"
            raise bad("starts", starts, wants)
        return found
    coordinate = system.coordinate or "phi"
    own = {coordinate: "phi", f"d{coordinate}": "dphi"} if system.standing.traits else {}
    natural = {own.get(name, name): ends for name, ends in (natural_window(system) or {}).items()}
    if isinstance(starts, Mapping):
        starts = {own.get(name, name): values for name, values in starts.items()}
    return found | chosen_starts(law, starts, {**natural, **law.window})


def _valid(system: System, rows: tuple[Quantity, ...], table: Table) -> list[str]:
    """The parameters and states along which rows can be swept."""
    needs = needs_of(system, passes_of(system, rows, table=table))
    needed = {name for names in needs.values() for name in names}
    declared = [parameter.name for parameter in system.declared]
    return declared + [name for name in _states_of(_law(system, table)) if name in needed]


def _unknown_axis(
    system: System, name: Any, rows: tuple[Quantity, ...], table: Table
) -> ParameterError:
    valid = _valid(system, rows, table)
    if name in ("lam", "psi", "A", "B", "C"):
        other = "system.reduced()" if name in ("lam", "psi") else "system.coefficients()"
        return ParameterError(
            f"axis {name!r} is not a parameter of {type(system).__name__}; sweep {other}, "
            f"or one of {', '.join(valid)}"
        )
    arguments = inspect.signature(sweep).parameters
    if meant := next((one for one in arguments if name in ARGUMENTS.get(one, ())), ""):
        return ParameterError(f"{name}: is no axis; did you mean {meant!r}?")
    return unknown(f"axis of {type(system).__name__}:", name, valid)


def _loaded(values: Mapping[str, Value]) -> dict[str, Value]:
    """Read chunked axes into memory: a stored map needs them whole, however it is cut."""
    lazy = {
        name: value
        for name, value in values.items()
        if isinstance(value, xr.DataArray) and value.chunks is not None
    }
    for name, value in lazy.items():
        refuse_too_large({name: value.nbytes}, {str(dim): n for dim, n in value.sizes.items()})
    return {**values, **{name: numeric(name, value.load()) for name, value in lazy.items()}}
