"""Orbits, labelled: periods, actions and turning points; action and angle, and back to states.

Array parameters of the system span the result's dims. States and levels are scalars, arrays of
equal shape, which pair on the dim `point`, or DataArrays, which broadcast by the names of their
dims; they come back as coordinates (state_phi, state_dphi, ...).
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from typing import Any

import numpy as np
import xarray as xr

from phasekit.cells.request import passes_of
from phasekit.cells.states import SIDES, at_states, pass_from
from phasekit.errors import OrbitFamily, ParameterError, warn
from phasekit.labels.arguments import (
    NumberLike,
    bad,
    call_checked,
    describe,
    numeric,
    one_of,
    state_arguments,
)
from phasekit.phase.numerical.families import BACKWARD, FORWARD, MOST
from phasekit.systems.system import System, as_system
from phasekit.table.quantities import returns, select

#: Families that have orbits of given action; of any potential rotations, and wells by number.
FAMILIES = {family.name.lower(): family.value for family in OrbitFamily if family > 0}
ROTATIONS = {"forward": FORWARD, "backward": BACKWARD}
_WELLS = re.compile(r"wells?_(\d+(?:_\d+)*)", re.ASCII)

#: Gaps of which some numbers on the way are no doubles any more, in some system.
_LEAST = 1e-290


@state_arguments
@returns("orbits")
def orbits(
    system: Any,
    phi0: NumberLike | None = None,
    dphi0: NumberLike | None = None,
    *,
    energy: NumberLike | None = None,
    center: str | int | None = None,
    gap: NumberLike | None = None,
    saddle: str | int | None = None,
    side: str = "right",
) -> xr.Dataset:
    """Period, action and turning points of orbits: through states, or of given energy.

    Parameters
    ----------
    phi0, dphi0 : float, 1-D array_like or xarray.DataArray
        States on the orbits: angles in rad, angular velocities in s^-1.
    energy : float, 1-D array_like or xarray.DataArray
        In place of states: energies in s^-2, as `energy` gives them.
    center : {"lower_center", "upper_center"}, or int for a `Potential`
        With `energy`: the center round which the orbit goes, by default the lower one. It matters
        below the energy of the lower saddle, where each center has a well of its own.
    gap : float, 1-D array_like or xarray.DataArray
        In place of states: energies above that of a saddle in s^-2, negative below it. Next to a
        separatrix the gap keeps the digits that the energy has lost.
    saddle : {"lower", "upper"}, or int for a `Potential`
        With `gap`: the saddle; by default the lower one where there are two (that of a
        figure-eight), else the only one (upper).
    side : {"right", "left"}
        With `gap`: the side of the saddle on which the orbit lies; it matters where the orbit
        stays on one of them.

    Returns
    -------
    xarray.Dataset
        The period is that of small oscillations at a center, the action NaN on a separatrix; angles
        are unwrapped. Cells without an orbit, below the center or at an absent saddle, are
        not_computed and NaN. A state is an equilibrium if it is at rest and V' = 0 there in
        floating point, and asymptotic if its energy is a saddle's within the rounding of the state;
        so the double next to a center is a libration of almost no action. An orbit of a `Potential`
        that leaves the line, or its interval, is unbounded; its period is infinite. Results of a
        `Potential` have estimates of their errors, ``period_error`` and ``action_error``, and
        bounds of those of the turning points, ``phi_min_error`` and ``phi_max_error``: infinite
        where rounding hides where, or whether, the orbit turns. Closed forms have none: their
        turning points are right to a few units in the last place, next to separatrices as well.
        States whose energies no doubles hold are not_computed.

        Under a constant torque, ``pk.Perturbed(system, torque=...)``, the energy is
        ``phi'^2/2 + V - torque phi`` of the unwrapped angle. Librations are quadratures, with
        errors as of a `Potential`; an orbit that is running turned back once, at its only turning
        point, and gains ``gain_per_turn`` from each turn to the next: it has no period and no
        action, both are NaN, and its other end is infinite. A `Potential` on a circle has such
        orbits as well; on a line the torque is a part of the potential, and what runs is unbounded.

    Raises
    ------
    ParameterError
        If an argument is unusable, none or several of state, energy and gap are given, or bare
        arrays differ in length.

    Notes
    -----
    From the energy integral [Veljovic2015] (14), in closed form. The action is the area inside
    the orbit over 2 pi, of a rotation that under one turn ([LandauLifshitz1976] section 50);
    ``d(orbit_energy)/d(action) = frequency``.

    Examples
    --------
    >>> import phasekit as pk
    >>> orbit = pk.orbits(pk.Pendulum(length=0.5, g=10.0), 0.5, 0.0)
    >>> pk.OrbitKind(orbit.orbit_kind.item()).name, round(orbit.period.item(), 6)
    ('LIBRATION', 1.427235)
    >>> near = pk.orbits(pk.Coefficients(2.0, 1.0, 0.0), gap=[-1e-20, -1e-40])
    >>> near.period.values.round(3).tolist()
    [49.517, 95.569]
    """
    _refuse_mixed(
        {"phi0": phi0, "dphi0": dphi0, "energy": energy, "gap": gap},
        center=center,
        saddle=saddle,
        side=side,
    )
    system = as_system(system)
    rows = select("orbits")
    if energy is not None:
        one, notes = pass_from(system, "orbits", "state_energy", center=center)
        ds = at_states(system, rows, {"energy": ("state_energy", energy)}, (one,))
        return with_notes(ds, **notes)
    if gap is not None:
        one, notes = pass_from(system, "orbits", "state_gap", saddle=saddle, side=side)
        ds = at_states(system, rows, {"gap": ("state_gap", gap)}, (one,))
        _tell_nearest(ds)
        return with_notes(ds, **notes)
    states = {"phi0": ("state_phi", phi0), "dphi0": ("state_dphi", dphi0)}
    return at_states(system, rows, states)


def _refuse_mixed(
    forms: dict[str, Any], *, center: str | int | None, saddle: str | int | None, side: str
) -> None:
    """Refuse calls that give no orbit, several, or arguments that belong to another form."""
    given = [name for name, value in forms.items() if value is not None]
    if not given:
        raise ParameterError(
            "phi0: got nothing, wants a state, as in pk.orbits(system, phi0, dphi0), or in its "
            "place energy= or gap="
        )
    if len(given) > 1 and given[-1] in ("energy", "gap"):
        raise ParameterError(
            f"{given[-1]}: got it besides {' and '.join(given[:-1])}, wants one of state (phi0, "
            "dphi0), energy and gap"
        )
    belongs: dict[str, tuple[Any, str]] = {"center": (center, "energy"), "saddle": (saddle, "gap")}
    if one_of("side", side, SIDES) != SIDES.index("right"):
        belongs["side"] = (side, "gap")
    for name, (value, form) in belongs.items():
        if value is not None and form not in given:
            raise bad(name, value, f"it with {form}= alone", f"leave it out, or give {form}=")


def _tell_nearest(ds: xr.Dataset) -> None:
    """Say which gaps are so small that doubles have too few digits for them."""
    size = abs(ds.state_gap)
    lost = ds.period.isnull() & (size > 0.0) & (size < _LEAST)
    if lost.any():
        warn(
            f"gap: {int(lost.sum())} of {lost.size} periods are NaN, because energies are so near "
            f"to that of the saddle, by {float(size.where(lost).max()):.1e} or less, that doubles "
            "lose their digits",
            RuntimeWarning,
        )


def with_notes(ds: xr.Dataset, **attrs: str) -> xr.Dataset:
    """Write down, on each variable, the arguments that are neither parameters nor states."""
    for variable in ds.data_vars.values():
        variable.attrs.update(attrs)
    return ds


@state_arguments
@returns("orbit_family", "action", "angle", "frequency", "twist", "angle_error")
def action_angle(system: Any, phi: NumberLike, dphi: NumberLike) -> xr.Dataset:
    """Action and angle variable of states, and how the frequency changes with the action.

    Parameters
    ----------
    phi, dphi : float, 1-D array_like or xarray.DataArray
        States: angles in rad, angular velocities in s^-1.

    Returns
    -------
    xarray.Dataset
        The angle grows evenly in time, at ``frequency``. Those of a `Potential` have estimates of
        their errors, and no twist; an angle whose error may exceed 1e-7 is NaN. The code of a
        family is there the sum of 2^k over the numbers k of the centers that the orbit goes round,
        -1 of a rotation forward and -2 backward, 0 of an orbit in no family.

    Notes
    -----
    The canonical variables of [LandauLifshitz1976] section 50 for [Veljovic2015] (14). `state_of`
    leads back.

    Examples
    --------
    >>> import phasekit as pk
    >>> system = pk.Coefficients(2.0, 1.0, 0.3)
    >>> state = pk.action_angle(system, 0.5, 0.1)
    >>> pk.OrbitFamily(state.orbit_family.item()).name
    'LOWER_WELL'
    >>> back = pk.state_of(system, state.action, state.angle, state.orbit_family)
    >>> round(back.phi_of_angle.item(), 12), round(back.dphi_of_angle.item(), 12)
    (0.5, 0.1)
    """
    rows = select(["orbit_family", "action", "angle", "frequency", "twist", "angle_error"])
    return at_states(system, rows, {"phi": ("state_phi", phi), "dphi": ("state_dphi", dphi)})


@call_checked
@returns("state_of")
def state_of(
    system: Any,
    action: NumberLike,
    angle: NumberLike,
    family: str | NumberLike | Sequence[str],
) -> xr.Dataset:
    """States of given action and angle variable.

    Parameters
    ----------
    action : float, 1-D array_like or xarray.DataArray
        Actions in s^-1.
    angle : float, 1-D array_like or xarray.DataArray
        Angle variables in rad.
    family : str, OrbitFamily, or array_like or xarray.DataArray of either
        The family of the orbit, by name ("lower_well", "upper_well", "outer", "forward",
        "backward") or code: actions repeat from family to family. Those of a `Potential` are
        "forward", "backward", and "well_0", "wells_0_2", ... by the numbers of the centers that
        the orbit goes round, or the codes of `action_angle`.

    Returns
    -------
    xarray.Dataset
        NaN where the family has no orbit of that action. Those of a `Potential` have estimates of
        their errors, and are NaN where these exceed 1e-7 of the orbit's size.

    Notes
    -----
    The inverse of `action_angle`, in the variables of [LandauLifshitz1976] section 50: the energy
    is found from the action by Newton's method, ``dh/dJ = frequency``, and the state from the time
    ``angle/frequency`` after angle 0.

    Examples
    --------
    >>> import phasekit as pk
    >>> state = pk.state_of(pk.Coefficients(2.0, 1.0, 0.0), 0.1, [0.0, 3.0], "lower_well")
    >>> state.phi_of_angle.dims
    ('point',)
    """
    system, rows = as_system(system), select("state_of")
    passes_of(system, rows)  # before any name of a family is read
    states = {
        "action": ("state_action", action),
        "angle": ("state_angle", angle),
        "family": ("state_family", _codes(system, family)),
    }
    return at_states(system, rows, states)


def family_code(system: System, name: Any) -> int | None:
    """The code of a family of orbits by its name; None where a system has no such name."""
    if system.standing.rung.labels_fixed:
        return FAMILIES.get(name)
    if name in ROTATIONS:
        return ROTATIONS[name]
    found = _WELLS.fullmatch(name)
    if found is None:
        return None
    numbers = {int(number) for number in found.group(1).split("_")}
    return sum(1 << k for k in numbers) if max(numbers) <= MOST else None


def wants_family(system: System) -> str:
    """What names of families a system has, for messages."""
    if system.standing.rung.labels_fixed:
        return f"one of {', '.join(FAMILIES)}"
    centers = "well_0, wells_0_2, ... by the numbers of the centers"
    return f"one of {', '.join(ROTATIONS)}, or {centers}"


def _codes(system: System, family: Any) -> Any:
    """Return families as codes, whether they came as names or as codes."""
    wants = wants_family(system)
    data = (
        family.values if isinstance(family, xr.DataArray) and family.dtype.kind in "OTU" else family
    )
    several = isinstance(data, (list, tuple)) and all(isinstance(name, str) for name in data)
    if several or isinstance(data, (str, np.ndarray)):
        array = np.asarray(data, dtype=object)
        if array.size and all(isinstance(name, str) for name in array.flat):
            codes = np.array([family_code(system, name) for name in array.flat], dtype=object)
            wrong = [name for name, code in zip(array.flat, codes, strict=True) if code is None]
            if wrong:
                raise bad("family", wrong[0], wants)
            codes = codes.astype(float).reshape(array.shape)
            return family.copy(data=codes) if isinstance(family, xr.DataArray) else codes
    kept = numeric("family", family)
    known = FAMILIES.values() if system.standing.rung.labels_fixed else ()
    if isinstance(kept, float) and (
        kept not in known if known else not kept.is_integer() or kept == 0.0 or kept < BACKWARD
    ):
        raise ParameterError(f"family: got {describe(family)}, wants {wants}, or its code")
    return kept
