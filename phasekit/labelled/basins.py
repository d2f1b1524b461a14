"""Attractors of damped and driven systems, and their basins, labelled."""

from __future__ import annotations

import warnings
from collections.abc import Mapping
from typing import Any

import numpy as np
import xarray as xr

from phasekit.cells.schema import dataset_attrs, input_attrs
from phasekit.labelled.driven import perturbed_of
from phasekit.labelled.motion import checked_tolerances
from phasekit.labels.arguments import (
    FloatArray,
    NumberLike,
    bad,
    number,
    numeric,
    state_arguments,
    whole,
)
from phasekit.labels.coordinates import LABELS
from phasekit.labels.grid import variable
from phasekit.motion import attractors as search
from phasekit.motion import basins as shares
from phasekit.motion.flow import RTOL
from phasekit.motion.lost import tell_open
from phasekit.motion.shares import damping_time
from phasekit.motion.strobe import check_period, common_period
from phasekit.numerics.waits import said
from phasekit.systems.perturbed import Perturbed
from phasekit.systems.system import single
from phasekit.table.quantities import ROWS
from phasekit.table.row import Quantity

#: Start states of a search along each axis, where none are given.
STARTS = 16


@state_arguments
def attractors(
    perturbed: Any,
    *,
    phi: NumberLike,
    dphi: NumberLike,
    period: float | None = None,
    rtol: float | None = None,
) -> xr.Dataset:
    """Attractors of the motions from a grid of states.

    Parameters
    ----------
    perturbed : Perturbed
        One system with damping.
    phi, dphi : 1-D array_like or xarray.DataArray
        Angles in rad and angular velocities in s^-1 of the grid; of a large one a part is used.
    period : float, optional
        Time from state to state in s; default: the common period of all that varies, of a system
        without such a quarter of the period of small oscillations, without these 1/damping.
    rtol : float, optional
        Error of a step that is allowed, relative to the state; default 1e-10.

    Returns
    -------
    xarray.Dataset
        On (``attractor``, ``crossing``): ``attractor_phi``, ``attractor_dphi``, the states of a
        periodic orbit, or the first of a motion that does not repeat itself; on ``attractor``:
        ``attractor_kind`` (`AttractorKind`), ``attractor_period``, after so many periods it repeats
        itself (0: it does not),
        ``attractor_multiplier``, <= 1, ``attractor_exponent`` in s^-1 with
        ``attractor_exponent_error``, and ``attractor_rotation``, the turns in a period.

    Raises
    ------
    ParameterError
        If an argument is unusable, or the system has no damping and so no attractors.

    Warns
    -----
    RuntimeWarning
        If damping is too weak to see where motions end, or they take too many steps.

    Notes
    -----
    Of a driven system motions are followed until they repeat themselves; Newton's method then
    finds the fixed point of the q-th power of the Poincare map, and its multipliers, all of a
    modulus below 1, whether it attracts ([GuckenheimerHolmes1983] section 1.5). What has come to
    none after 4,300 periods, or more where damping is weak, is chaotic where its largest exponent
    is positive by three times its error, and a torus where that is zero within it and its states
    fill a closed curve; otherwise it is unknown, which a warning says.

    Of a system that does not vary the attractors are the rests of the wells, however slowly motions
    come to them, and at most one rotation: the fixed point of the map from a speed at an angle to
    that one turn later. An attractor to which none of the states comes is not found.

    Examples
    --------
    >>> import numpy as np
    >>> import phasekit as pk
    >>> well = pk.Potential("x^4/4 - x^2/2", "x")
    >>> driven = pk.Perturbed(well, damping=0.15, forcing=pk.Harmonic(0.2, 1.0))
    >>> ds = pk.attractors(driven, phi=np.linspace(-2, 2, 5), dphi=[-1.0, 1.0])
    >>> ds.attractor_phi.values.round(6).ravel().tolist()
    [-0.779055, 1.210091]
    """
    system, found, _ = _searched(perturbed, phi, dphi, period, rtol)
    tell_open("attractor_phi", found.open)
    return _dataset(system, _attractor_rows(found.result()), {"period": found.leg})


@state_arguments
def basins(
    perturbed: Any,
    *,
    phi: NumberLike,
    dphi: NumberLike,
    period: float | None = None,
    periods: int = shares.LEGS,
    rtol: float | None = None,
) -> xr.Dataset:
    """Basins of the attractors over a grid of states, and their shares.

    Parameters
    ----------
    perturbed : Perturbed
        One system with damping.
    phi, dphi : 1-D array_like or xarray.DataArray
        Angles in rad and angular velocities in s^-1 of the grid at t = 0.
    period : float, optional
        As in `attractors`.
    periods : int, default 10000
        Periods after which a motion that came to no attractor is undecided.
    rtol : float, optional
        As in `attractors`.

    Returns
    -------
    xarray.Dataset
        ``basin`` on (``state_phi``, ``state_dphi``): the number of the attractor, -1 where a
        motion is undecided, -2 where it runs to infinity; ``basin_decided``, whether the errors of
        the steps stayed smaller than a cell until the motion was caught: elsewhere it is that of a
        state next to the one given; ``basin_time`` in s until the motion is caught;
        on ``attractor``: ``basin_fraction`` and ``basin_fraction_error``;
        ``boundary_fraction``, the share of the cells beside another basin; and what `attractors`
        gives.

    Raises
    ------
    ParameterError
        As `attractors`.

    Warns
    -----
    RuntimeWarning
        If it is not seen where some motions end, as of `attractors`; and if more than half of the
        cells lie beside another basin: the grid is too coarse to show the basins.

    Notes
    -----
    A motion belongs to an attractor when it comes as near as states on a ring around it were seen
    to be caught; of a system that does not vary, when its energy is below the barriers of the well,
    or its speed above that of a turn that ends faster than it began; or, of an
    attractor that does not repeat itself, when it has been in forty of its
    boxes in succession [DatserisWagemakers2022]. The error of a share p of n states is that of a
    sample, ``sqrt(p (1 - p)/n)``, and the share of the undecided on top; it is NaN of an attractor
    of unknown kind, which may be a part of another.

    Examples
    --------
    >>> import numpy as np
    >>> import phasekit as pk
    >>> damped = pk.Perturbed(pk.Coefficients(1.0, 0.35, 0.12), damping=0.2)
    >>> ds = pk.basins(damped, phi=np.linspace(-3.0, 3.0, 31), dphi=np.linspace(-1.0, 1.0, 21))
    >>> ds.attractor_phi.values.round(3).ravel().tolist(), float(ds.basin_fraction.sum())
    ([-1.156, 1.255], 1.0)
    """
    periods = whole("periods", periods, "a number of periods, >= 1", 1)
    system, found, grid = _searched(perturbed, phi, dphi, period, rtol)
    with said(f"following {grid[0].size * grid[1].size:,} motions to their attractors"):
        result = shares.basins(found, *grid, legs=periods)
    tell_open("attractor_phi", found.open)
    data = _attractor_rows(found.result())
    dims = ("state_phi", "state_dphi")
    for name, values in result._asdict().items():
        own = dims if np.ndim(values) == 2 else ROWS[name].dims
        data[name] = (own, values)
    coords = dict(zip(dims, grid, strict=True))
    ds = _dataset(system, data, {"period": found.leg}, coords)
    if result.boundary_fraction > shares.COARSE:
        sure = not any(found.open.values()) and np.isfinite(result.basin_fraction_error).all()
        held = "; their fractions hold as those of a sample" if sure else ""
        warnings.warn(
            f"basin: {result.boundary_fraction:.0%} of the cells lie beside another basin: a grid "
            f"of {len(grid[0])} x {len(grid[1])} states is too coarse to show the basins"
            f"{held}",
            RuntimeWarning,
            stacklevel=4,
        )
    return ds


def _searched(
    perturbed: Any, phi: NumberLike, dphi: NumberLike, period: float | None, rtol: float | None
) -> tuple[Perturbed, search.Search, tuple[FloatArray, FloatArray]]:
    """The attractors of one system, and the grid."""
    system = perturbed_of(perturbed)
    grid = (
        _axis("phi", phi, system.unit_of("state_phi")),
        _axis("dphi", dphi, system.unit_of("state_dphi")),
    )
    _, parameters = single(system)
    law = system.law
    rtol = checked_tolerances(rtol, None).get("rtol", RTOL)
    if not (parameters["damping"] > 0.0 or parameters["quadratic"] > 0.0):
        raise bad(
            "damping", parameters["damping"], "a system with damping > 0 or quadratic > 0",
            "without damping there are no attractors",
        )  # fmt: skip
    values = law.values(*parameters.values())
    own = common_period(law, values)
    if period is not None:
        leg = number("period", period, "a time in s, > 0", "s")
        if not leg > 0.0:
            raise bad("period", period, "a time in s, > 0")
    elif own is None:
        leg = _quarter(system, values)
    else:
        leg = float(check_period("period", own))
    every = [axis[np.linspace(0, len(axis) - 1, min(len(axis), STARTS)).round().astype(int)]
             for axis in grid]  # fmt: skip
    states = np.stack(np.meshgrid(*every, indexing="ij"), axis=-1).reshape(-1, 2)
    with said(f"looking for attractors from {len(states)} states"):
        found = search.find(law, values, leg, states, rtol)
    return system, found, grid


def _quarter(system: Perturbed, values: Mapping[str, Any]) -> float:
    """A quarter of the period of small oscillations about the center of greatest curvature.

    Without one the time in which damping acts.
    """
    from phasekit.labelled.phase_space import equilibria

    frequency = equilibria(system.system).natural_frequency.values
    if not np.isfinite(frequency).any():
        return damping_time(values)
    return float(0.5 * np.pi / np.nanmax(frequency))


def _axis(name: str, values: NumberLike, units: str | None) -> FloatArray:
    wants = "a 1-D array of finite, increasing values"
    kept = numeric(name, values, units, wants)
    axis = np.atleast_1d(np.asarray(kept, dtype=float))
    if axis.ndim != 1 or not np.isfinite(axis).all() or not (np.diff(axis) > 0.0).all():
        raise bad(name, values, wants)
    return axis


def _attractor_rows(found: search.Attractors) -> dict[str, tuple[tuple[str, ...], Any]]:
    fields = found._asdict()
    fields["attractor_rotation"] = fields.pop("rotation_number")
    return {name: (ROWS[name].dims, values) for name, values in fields.items()}


def _dataset(
    system: Perturbed,
    data: Mapping[str, tuple[tuple[str, ...], Any]],
    more: Mapping[str, float],
    coords: Mapping[str, FloatArray] | None = None,
) -> xr.Dataset:
    """Rows of one system with their attributes, and its parameters as coordinates."""
    variables: dict[str, xr.Variable] = {}
    named: dict[str, xr.Variable] = {}
    for name, (dims, values) in data.items():
        row: Quantity = ROWS[name]
        words = {**row.attrs, **system.law.words(name, row.units, row.long_name)}
        variables[name] = variable(dims, np.asarray(values, row.dtype), words)
        for dim, size in zip(dims, np.shape(values), strict=True):
            if dim in LABELS and dim not in named:
                named[dim] = variable((dim,), np.arange(size), {"long_name": LABELS[dim][1]})
    for name, axis in (coords or {}).items():
        named[name] = variable((name,), axis, input_attrs(system, name))
    for name, value in system.parameters.items():
        named[name] = variable((), value, input_attrs(system, name))
    attrs: dict[str, Any] = {**dataset_attrs(system), "period": repr(more["period"])}
    return xr.Dataset(variables, named, attrs)
