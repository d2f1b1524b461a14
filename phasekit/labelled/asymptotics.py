"""Limits of the period, labelled: small oscillations about centers, and next to separatrices."""

from __future__ import annotations

from typing import Any

import xarray as xr

from phasekit.cells.states import at_states
from phasekit.labels.arguments import NumberLike, call_checked
from phasekit.table.quantities import returns, select


@call_checked
@returns("near_center")
def near_center(system: Any, energy: NumberLike) -> xr.Dataset:
    """Period and frequency of small oscillations about the centers, to first order in energy.

    Parameters
    ----------
    energy : float, 1-D array_like or xarray.DataArray
        Energies above that of the center, in s^-2; in J for a `FreeGyroRotor`.

    Returns
    -------
    xarray.Dataset
        NaN but for centers.

    Notes
    -----
    ``w - eps (5 V'''^2/(24 w^5) - V''''/(8 w^3))`` with ``w = sqrt(V'')`` and eps the energy: the
    expansion of [LandauLifshitz1976] section 28, for [Veljovic2015] (12) and any `Potential`. With
    an inertia M that changes with the coordinate x the derivatives are those by s, ds = sqrt(M) dx.
    `orbits` gives the period without approximation.

    Examples
    --------
    The pendulum's period grows by 1/16 of the squared amplitude, so by energy/8:

    >>> import phasekit as pk
    >>> ds = pk.near_center(pk.Coefficients(0.0, 1.0, 0.0), 0.01)
    >>> round(ds.near_center_period.sel(equilibrium="lower_center").item() / 6.283185307, 6)
    1.00125
    """
    return at_states(system, select("near_center"), {"energy": ("state_excess", energy)})


@call_checked
@returns("near_separatrix")
def near_separatrix(system: Any, gap: NumberLike) -> xr.Dataset:
    """Period next to the separatrices, to leading order in the energy from the saddle.

    Parameters
    ----------
    gap : float, 1-D array_like or xarray.DataArray
        Energies above that of the saddle, in s^-2; negative below it.

    Returns
    -------
    xarray.Dataset
        NaN where the saddle is absent.

    Notes
    -----
    ``(n/k) ln(32 k^6/(|gap| |D|))``, n passages of the saddle in one round, with k and D of
    `separatrices`; between two saddles of equal energy ``(2/k) ln(8 k^4/(|gap| |A|))``. The
    leading term of the period that follows from [Veljovic2015] (14); `orbits` gives it without
    approximation.

    Examples
    --------
    >>> import phasekit as pk
    >>> system = pk.Coefficients(2.0, 1.0, 0.0)
    >>> near = pk.near_separatrix(system, -1e-9).near_separatrix_period.sel(saddle="lower")
    >>> abs(near.item() / pk.orbits(system, gap=-1e-9).period.item() - 1) < 1e-9
    True
    """
    return at_states(system, select("near_separatrix"), {"gap": ("state_gap", gap)})
