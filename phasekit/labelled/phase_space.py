"""Equilibria and separatrices, labelled: a system goes in, a Dataset comes out.

Array parameters of the system span the result's dims.
"""

from __future__ import annotations

from typing import Any

import xarray as xr

from phasekit.cells.dispatch import passes_of
from phasekit.cells.evaluate import evaluate
from phasekit.cells.invalid import warn_of_invalid
from phasekit.systems.as_system import as_system
from phasekit.table.quantities import select


def equilibria(system: Any) -> xr.Dataset:
    """All equilibria, their kinds, energies and frequencies, as branches.

    Parameters
    ----------
    system : system
        Any system.

    Returns
    -------
    xarray.Dataset
        On the dim ``equilibrium`` (lower_center, lower_saddle, upper_center, upper_saddle):
        ``phi``, ``kind`` (`EquilibriumKind`), ``energy``, ``curvature``, ``natural_frequency``
        (centers) and ``exponent`` (saddles); besides ``n_equilibria`` (distinct ones; -1 in
        invalid cells) and ``fold_margin`` (> 0 where four exist, 0 on the fold). Absent ones
        are NaN, their kind is absent.

    Raises
    ------
    ParameterError
        If the system is unusable.

    Notes
    -----
    The labels are the brackets of the location theorem, so each is a branch that does not jump
    when parameters change. The pair that merges on a fold stands once, as lower_saddle, with the
    kind degenerate. Angles are wrapped to (-pi, pi].

    Those of a `Potential` are numbered from left to right instead, 0 to one less than the most
    that a cell has; there is no ``fold_margin``, which belongs to the coefficients (A, B, C), but
    ``complete``: whether it is proved that there are no others.

    Examples
    --------
    >>> import phasekit as pk
    >>> eq = pk.equilibria(pk.Coefficients(4.0, 1.0, 0.5))
    >>> eq.n_equilibria.item()
    4
    >>> pk.EquilibriumKind(eq.kind.sel(equilibrium="lower_saddle").item()).name
    'SADDLE'
    """
    return _of_system("equilibria", system)


def separatrices(system: Any) -> xr.Dataset:
    """Separatrices: their topology, turning points and areas; whether there is a figure-eight.

    Parameters
    ----------
    system : system
        Any system.

    Returns
    -------
    xarray.Dataset
        ``topology`` (`Topology`) and ``figure_eight``: whether a separatrix has the shape of an
        eight round two centers, the "trigger of coupled singularities" center, saddle, center of
        the papers. On the dim ``saddle`` (lower, upper; a single one is upper): ``saddle_phi``,
        ``saddle_energy``, ``saddle_exponent``, ``loop`` (`Loop`) and ``winding_area``. On
        (``saddle``, ``side``): ``turning_offset``, ``turning_phi`` and ``lobe_area``.

    Raises
    ------
    ParameterError
        If the system is unusable.

    Notes
    -----
    From the energy integral [Veljovic2015] (14) at the saddles' energies, in closed form. The
    saddles of a `Potential` are numbered from left to right; a separatrix that goes to infinity,
    or out of the interval, has an infinite turning point and area; its areas have estimates of
    their errors, ``lobe_area_error`` and ``winding_area_error``.

    Examples
    --------
    >>> import phasekit as pk
    >>> sep = pk.separatrices(pk.Coefficients(4.0, 1.0, 0.5))
    >>> bool(sep.figure_eight), pk.Topology(sep.topology.item()).name
    (True, 'FIGURE_EIGHT')
    """
    return _of_system("separatrices", system)


def _of_system(group: str, system: Any) -> xr.Dataset:
    system, rows = as_system(system), select(group)
    warn_of_invalid(system, stacklevel=3)
    return evaluate(system, rows, passes_of(system, rows))
