"""Rotators and bearing forces, labelled: at states, along motions, and on what a map holds.

The kinetic pressures of the papers are the kinetic parts of the reactions here, reversed: each
force is the one that the bearing exerts on the rotor.
"""

from __future__ import annotations

import functools
from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np
import xarray as xr

from phasekit.cells.request import passes_of
from phasekit.cells.states import at_states
from phasekit.errors import ParameterError
from phasekit.labels.arguments import NumberLike, bad, numeric, one_of, state_arguments
from phasekit.labels.conversion import in_si
from phasekit.systems.disk import GyroRotorDisk
from phasekit.systems.system import System, as_system
from phasekit.table.loads import DISK
from phasekit.table.quantities import returns, select
from phasekit.table.row import Quantity

FRAMES = ("disk", "carrier")
CURVES = ("equilibria", "separatrix", "orbit")
#: Dims of a map that a selection may have lost.
SELECTED = ("equilibrium", "saddle", "side")


@state_arguments
@returns("rotators")
def rotators(
    disk: GyroRotorDisk,
    phi: NumberLike | xr.Dataset,
    dphi: NumberLike | None = None,
    *,
    ddphi: NumberLike | None = None,
    domega1: NumberLike = 0.0,
) -> xr.Dataset:
    """Vector rotators of the disk: the kinematic vectors by which its momenta change.

    Parameters
    ----------
    disk : GyroRotorDisk
        The disk; its mass does not matter.
    phi, dphi : float, 1-D array_like or xarray.DataArray
        States: angles in rad, angular velocities in s^-1. Or, in place of both, a motion: a Dataset
        with ``motion_phi`` and ``motion_dphi`` as `flow`, `separatrix_motion` and
        `FreeGyroRotor.simulate` give it; one of the latter has its own omega1, domega1 and ddphi.
    ddphi : float, 1-D array_like or xarray.DataArray, optional
        Angular accelerations in s^-2, where a motor turns the disk; by default those of the
        equation of motion.
    domega1 : float, 1-D array_like or xarray.DataArray, default 0
        Angular acceleration of the support in s^-2.

    Returns
    -------
    xarray.Dataset
        Names of rotators: R01 with the base vector [n1, r0], R011 with S_n1, R022 with S_n2, R1
        with D_n1, R2 with D_n2; the coupling rotators R012 along [n1, S_n2], R12 along [n1, J_n2],
        and R12c along the vector that enters the rate of angular momentum. ``gamma2_rate`` holds of
        free motions, for constant domega1; it is NaN otherwise and at equilibria. A rotator whose
        base vector is zero is undefined: NaN.

    Notes
    -----
    [HedrihVeljovic2011] (4.1)-(4.11), (5.1), (6.6)-(6.12), corrected; the carrier's axes are
    u01 = n2, v01 = [n1, n2] and n1, which points up.

    Examples
    --------
    >>> import phasekit as pk
    >>> disk = pk.GyroRotorDisk(beta=0.3, e=0.1, a=0.05, r=0.1, omega1=10.0)
    >>> ds = pk.rotators(disk, phi=0.5, dphi=2.0)
    >>> ds.rotator.sel(rotator_name="R01").values.round(6)
    array([   0., -100.,    0.])
    """
    system, states = _states(disk, phi, dphi, ddphi, domega1)
    return _loads(system, select("rotators"), states)


@state_arguments
@returns("bearing_forces")
def bearing_forces(
    disk: GyroRotorDisk,
    phi: NumberLike | xr.Dataset,
    dphi: NumberLike | None = None,
    *,
    ddphi: NumberLike | None = None,
    domega1: NumberLike = 0.0,
    frame: str = "disk",
) -> xr.Dataset:
    """Forces of the self-rotation shaft's bearings on the rotor: kinetic and weight parts.

    The bearing A2 at O2 + half_span n2 is spherical and takes the axial force, B2 at
    O2 - half_span n2 is cylindrical. The papers' kinetic pressures on the bearings are
    ``force_kinetic`` reversed.

    Parameters
    ----------
    disk : GyroRotorDisk
        The disk, with ``m`` and ``half_span``.
    phi, dphi, ddphi, domega1
        States, or a motion, as in `rotators`.
    frame : {"disk", "carrier"}
        Axes of the components: ``disk_axis`` u2 (tangential), v2 (radial, inward) and n2, which
        turn with the disk; or ``carrier_axis`` u01 (along n2), v01 (outward for a > 0) and n1 (up).

    Returns
    -------
    xarray.Dataset
        Components: along the papers' w1 = n1, w2 = sin(phi) u2 - cos(phi) v2 and w3 = -v01, and
        along the rotator R022 (F_24 times the rotator's intensity). The drive torque moves a
        massless support as it moves.

    Raises
    ------
    ParameterError
        If the disk lacks a mass or half_span, or an argument is unusable.

    Notes
    -----
    [HedrihVeljovic2013] (19)-(28) and the components F_21 to F_24, corrected. Without ``ddphi``
    the shaft turns freely in its bearings. Forces at the equilibria of a disk, and their peaks over
    its separatrices and orbits: ``pk.separatrices(disk).phasekit.bearing_forces(on=...)``.

    Examples
    --------
    >>> import phasekit as pk
    >>> disk = pk.GyroRotorDisk(
    ...     beta=1.0, e=0.01, a=0.1, r=0.1, omega1=30.0, m=2.0, half_span=0.1
    ... )
    >>> ds = pk.bearing_forces(disk, phi=0.5, dphi=2.0)
    >>> ds.force_magnitude.sel(bearing="A2").item().__round__(3)
    98.007
    >>> bool(abs(ds.force - ds.force_kinetic - ds.force_weight).max() < 1e-12)
    True
    """
    carrier = one_of("frame", frame, FRAMES) == 1
    system, states = _states(disk, phi, dphi, ddphi, domega1)
    rows = select("bearing_forces")
    if carrier:
        rows = tuple(_in_carrier(row) for row in rows)
    return _loads(system, rows, states, carrier=carrier)


@state_arguments
@returns("fixed_bearing_forces")
def fixed_bearing_forces(
    disk: GyroRotorDisk,
    phi: NumberLike | xr.Dataset,
    dphi: NumberLike | None = None,
    *,
    rho_b1: NumberLike,
    ddphi: NumberLike | None = None,
    domega1: NumberLike = 0.0,
) -> xr.Dataset:
    """Forces of the fixed shaft's bearings on the rotor: kinetic and weight parts.

    The rotor is disk and carrier here; the carrier itself has no mass. The bearing A1 at O1 is
    spherical, B1 at O1 + rho_b1 n1 cylindrical. The papers' kinetic pressures on the bearings are
    ``fixed_force_kinetic`` reversed.

    Parameters
    ----------
    disk : GyroRotorDisk
        The disk, with ``m``.
    phi, dphi, ddphi, domega1
        States, or a motion, as in `rotators`.
    rho_b1 : float, 1-D array_like or xarray.DataArray
        Place of B1 above O1 in m, negative below; not zero.

    Raises
    ------
    ParameterError
        If the disk lacks a mass, rho_b1 is zero, or an argument is unusable.

    Notes
    -----
    [HedrihVeljovic2013] (8), (9), corrected.

    Examples
    --------
    >>> import phasekit as pk
    >>> disk = pk.GyroRotorDisk(beta=1.0, e=0.01, a=0.1, r=0.1, omega1=30.0, m=2.0)
    >>> ds = pk.fixed_bearing_forces(disk, phi=0.5, dphi=2.0, rho_b1=0.4)
    >>> ds.fixed_force_weight.sel(carrier_axis="n1").values.round(4).tolist()
    [19.6133, 0.0]
    """
    place = numeric("rho_b1", rho_b1)
    if isinstance(place, float) and place == 0.0:
        raise bad("rho_b1", rho_b1, "a distance between the bearings that is not zero")
    system, states = _states(disk, phi, dphi, ddphi, domega1)
    states["rho_b1"] = ("rho_b1", rho_b1)
    return _loads(system, select("fixed_bearing_forces"), states)


# ------------------------------------------------------------------------------ at states


def _states(
    disk: Any, phi: Any, dphi: Any, ddphi: Any, domega1: Any
) -> tuple[System, dict[str, tuple[str, Any]]]:
    """The disk, and its states by argument; a motion also tells how the support moves."""
    system = as_system(disk)
    if not is_disk(system):
        raise bad("disk", disk, "a GyroRotorDisk")
    if isinstance(phi, xr.Dataset):
        motion = in_si(phi)
        if dphi is not None:
            raise bad("dphi", dphi, "nothing beside a motion, which has its own")
        for name in ("motion_phi", "motion_dphi"):
            if name not in motion:
                raise ParameterError(
                    f"phi: got a Dataset without {name!r}, wants a motion, as pk.flow makes it"
                )
        phi, dphi = motion.motion_phi, motion.motion_dphi
        if "motion_omega1" in motion:  # the support is not driven evenly
            if ddphi is not None or not _is_zero(domega1):
                name, value = ("domega1", domega1) if ddphi is None else ("ddphi", ddphi)
                raise bad(name, value, "nothing beside a motion that has its own")
            system = system.replace(omega1=motion.motion_omega1)
            domega1, ddphi = motion.domega1, motion.ddphi
    elif dphi is None:
        raise bad("dphi", None, "the angular velocities of the states, or a motion in place of phi")
    states = {"phi": ("state_phi", phi), "dphi": ("state_dphi", dphi)}
    if ddphi is not None:
        states["ddphi"] = ("state_ddphi", ddphi)
    if not _is_zero(domega1):
        states["domega1"] = ("domega1", domega1)
    return system, states


def is_disk(system: System) -> bool:
    """Whether a system has all that a machine with a disk has."""
    return set(DISK) <= {parameter.name for parameter in system.declared}


def _is_zero(value: Any) -> bool:
    return isinstance(value, (int, float)) and not isinstance(value, bool) and value == 0


def _loads(
    system: System,
    rows: tuple[Quantity, ...],
    states: Mapping[str, tuple[str, Any]],
    **keywords: Any,
) -> xr.Dataset:
    """Evaluate at states, with the accelerations that are given."""
    (one,) = passes_of(system, rows, given=[state for state, _ in states.values()])
    if keywords:
        one = replace(one, function=functools.partial(one.resolved, **keywords))
    return at_states(system, rows, states, (one,))


def _in_carrier(row: Quantity) -> Quantity:
    dims = tuple("carrier_axis" if dim == "disk_axis" else dim for dim in row.dims)
    return replace(row, dims=dims)


# ------------------------------------------------------------------------------ on a map


def on_map(
    ds: xr.Dataset,
    system: System,
    what: str,
    on: str,
    phi0: NumberLike | None,
    dphi0: NumberLike | None,
) -> xr.Dataset:
    """Rotators ("rotators") or bearing forces ("forces") on what a map holds.

    Selected equilibria, saddles and sides stay selected; chunks of the map stay chunks.
    """
    curve = CURVES[one_of("on", on, CURVES)]
    if curve == "orbit" and (phi0 is None or dphi0 is None):
        name = "phi0" if phi0 is None else "dphi0"
        raise bad(name, None, "the state through which the orbit goes, with on='orbit'")
    if curve != "orbit" and not (phi0 is None and dphi0 is None):
        name = "phi0" if phi0 is not None else "dphi0"
        raise bad(name, phi0 if phi0 is not None else dphi0, "nothing, except with on='orbit'")
    if not is_disk(system):
        raise bad("ds", f"a map of {type(system).__name__}", "a map of GyroRotorDisk")
    for name in ("m", "half_span") if what == "forces" else ():
        if name not in system.parameters:
            raise bad(name, None, f"a value, which the map lacks: bearing_forces(..., {name}=...)")
    group = f"{'equilibrium' if curve == 'equilibria' else curve}_{what}"
    rows = select(group)
    states = {}
    if curve == "orbit":
        states = {"phi0": ("state_phi", phi0), "dphi0": ("state_dphi", dphi0)}
    found = at_states(chunked_as(system, ds), rows, states)
    prefix = {"equilibria": "equilibrium_", "orbit": "orbit_", "separatrix": ""}[curve]
    found = found.rename({row.name: row.name.removeprefix(prefix) for row in rows})
    kept = {dim: str(ds[dim].values) for dim in SELECTED if dim in ds.coords and not ds[dim].ndim}
    kept = {dim: label for dim, label in kept.items() if dim in found.dims}
    found = _with_labels(found, ds, {"phi0": phi0, "dphi0": dphi0}).sel(kept)
    return found.sel({dim: ds[dim].values for dim in SELECTED if dim in found.dims and dim in ds})


def _with_labels(found: xr.Dataset, ds: xr.Dataset, given: Mapping[str, Any]) -> xr.Dataset:
    """Return loads with the labels of a map on dims that its states share.

    States that have none there follow the order of the map's, if they are as many.
    """
    for dim in SELECTED:
        if dim not in found.dims or dim not in ds.coords:
            continue
        labels = np.atleast_1d(ds[dim].values)
        if dim not in found.coords and ds[dim].ndim and labels.size == found.sizes[dim]:
            found = found.assign_coords({dim: ds[dim]})
        elif dim not in found.coords or not set(labels) <= set(found[dim].values):
            name = next(name for name, value in given.items() if dim in getattr(value, "dims", ()))
            listed = ", ".join(map(str, labels))
            raise bad(
                name, given[name], f"the map's labels along {dim}, {listed}",
                f"give them by .assign_coords({dim}=[...]), or call the dim otherwise",
            )  # fmt: skip
    return found


def chunked_as(system: System, ds: xr.Dataset) -> System:
    """The system with its arrays chunked as the variables of a Dataset are, if they are."""
    chunks = ds.chunksizes
    lazy = {}
    for name, value in system.parameters.items():
        if chunks and not isinstance(value, float):
            array = value if isinstance(value, xr.DataArray) else xr.DataArray(value, dims=name)
            lazy[name] = array.chunk({d: c for d, c in chunks.items() if d in array.dims})
    return system.replace(**lazy) if lazy else system
