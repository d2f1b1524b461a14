"""Families of orbits, labelled: energies from one separatrix to the next, with their periods."""

from __future__ import annotations

import functools
from dataclasses import replace
from typing import Any

import numpy as np
import xarray as xr

from phasekit.cells.states import at_states
from phasekit.errors import ParameterError
from phasekit.labelled.numerical_families import families_of_any
from phasekit.labels.arguments import call_checked, number, whole
from phasekit.laws.ladder import Conservative, Standing, Trait
from phasekit.laws.trigonometric import Trigonometric
from phasekit.phase.families import Families, TorquedFamilies, families, families_under_torque
from phasekit.systems.system import System, as_system
from phasekit.table.quantities import ROWS
from phasekit.table.row import Pass


@call_checked
def orbit_families(system: Any, n: int = 200, *, energy_max: float | None = None) -> xr.Dataset:
    """Periods, frequencies and actions of all orbits, family by family.

    Parameters
    ----------
    n : int, default 200
        Number of orbits in each family.
    energy_max : float, optional
        Energy in s^-2 up to which rotations are taken; by default as far above the highest saddle
        as the lowest center lies below it.

    Returns
    -------
    xarray.Dataset
        On the dims ``family`` (lower_well, upper_well: librations round one center; outer:
        librations round both; rotation) and ``level``: ``energy_level`` in s^-2, ``period`` in s,
        ``frequency`` and ``action`` in s^-1. Levels run from 0 to 1, without these ends, with the
        energy; energies are close to each other next to separatrices. NaN where a family is
        absent.

    Notes
    -----
    From the energy integral [Veljovic2015] (14); `orbits` explains the quantities.

    The families of a `Potential` of scalar parameters are found from its equilibria: ``well_0``,
    ``well_2``, ... by the number of the center; ``wells_0_2``, round several; ``rotation``. Where
    no saddle is above them, orbits have no end, so that `energy_max` has to be given.

    Under a constant torque alone, ``pk.Perturbed(system, torque=...)``, the energy is less torque
    times the angle, at the center of the well in the turn where `equilibria` has it; of orbits
    round several wells at the saddle between them, of a `Potential` at the center of the least
    number. They are quadratures, with ``period_error`` and ``action_error``. What rotates gains
    energy each turn: "rotation" is empty, or left out.

    Examples
    --------
    >>> import phasekit as pk
    >>> ds = pk.orbit_families(pk.Coefficients(4.0, 1.0, 0.5), 50)
    >>> ds.period.dims
    ('family', 'level')
    >>> ds.energy_level.sel(family="outer").diff("level").min().item() > 0
    True
    """
    system = with_families(system, "orbit_families")
    tilted = system.standing.is_within(Standing(Trigonometric, Trait.TORQUED))
    n = whole("n", n, "a number of orbits >= 1")
    wants = "one number, finite, in s^-2"
    top = None if energy_max is None else number("energy_max", energy_max, wants, "s-2")
    if not tilted and not issubclass(system.rung, Trigonometric):
        return families_of_any(system, n, top)
    for name, value in system.parameters.items():
        if isinstance(value, xr.DataArray) and "level" in value.dims:
            raise ParameterError(
                f"{name}: got the dim 'level', which the result has; rename it with "
                ".rename(level=...)"
            )
    names = TorquedFamilies._fields if tilted else Families._fields
    rows = [replace(ROWS[name], group="orbit_families", dims=("family",)) for name in names]
    one = Pass(functools.partial(families, top), ("A", "B", "C", "level"), ("orbit_families",))
    if tilted:
        function = functools.partial(families_under_torque, top, system.law)
        inputs = (*system.parameters, "level")
        one = Pass(function, inputs, ("orbit_families",), Standing(Trigonometric, Trait.TORQUED))
    levels = (np.arange(n) + 0.5) / n
    ds = at_states(system, rows, {"n": ("level", levels)}, (one,))
    return ds.transpose(..., "family", "level")


def with_families(system: Any, what: str) -> System:
    """Return a system whose orbits are in families from one separatrix to the next."""
    found = as_system(system)
    if found.standing.is_within(Standing(Conservative, Trait.TORQUED)):
        return found
    return as_system(found, rung=Conservative, what=what)
