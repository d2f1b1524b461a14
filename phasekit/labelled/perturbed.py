"""Perturbed systems, labelled: Melnikov's function, capture, escape, torques, resonances."""

from __future__ import annotations

from typing import Any

import numpy as np
import xarray as xr

from phasekit.cells.dispatch import passes_of
from phasekit.cells.evaluate import evaluate
from phasekit.labels.arguments import whole
from phasekit.systems.as_system import as_system
from phasekit.table.quantities import select


def melnikov(perturbed: Any) -> xr.Dataset:
    """Melnikov's function on the separatrices: when damping and drive make motion irregular.

    Parameters
    ----------
    perturbed : Perturbed
        A system with damping and drive.

    Returns
    -------
    xarray.Dataset
        On (``saddle``, ``side``): ``melnikov_mean`` in s^-2, the energy that the loop gains on
        average; ``melnikov_amplitude`` in s^-2 and ``melnikov_phase`` in rad of
        ``M(t0) = mean + amplitude cos(nu t0 + phase)``; ``chaos_threshold``, the amplitude of the
        forcing from which on stable and unstable manifold intersect transversally, at the given
        damping (NaN without, infinite where the loop does not respond); ``turnstile_area`` in
        s^-1, what crosses in one period to first order without damping.

        With several harmonics of different frequencies the amplitude is the greatest value over
        all times against the mean, the phase NaN, and the threshold that of the first harmonic of
        the forcing, the others growing in proportion; of frequencies without a common period the
        turnstile is NaN. Without forcing the threshold is that of the first modulated parameter.

    Raises
    ------
    ParameterError
        If the system is not perturbed, or omega1 is a function of time.

    Notes
    -----
    First order in damping and drive ([GuckenheimerHolmes1983] section 4.5). The integrals along
    the separatrices of (A, B, C) are sums of residues; those of a `Potential` are quadratures,
    NaN where they would lose more than six digits. Time is that of `separatrix_motion`. Of a
    modulated omega1 the torque of omega1' counts as well.

    Examples
    --------
    >>> import phasekit as pk
    >>> eight = pk.Coefficients(1.0, 0.35, 0.12)
    >>> driven = pk.Perturbed(eight, damping=1.0, forcing=pk.Harmonic(1.0, frequency=1.0))
    >>> pk.melnikov(driven).chaos_threshold.sel(saddle="lower").values.round(9).tolist()
    [0.814751185, 1.119291703]
    """
    return _of_system("melnikov", perturbed)


def quiet_frequencies(perturbed: Any, *, n: int = 8) -> xr.Dataset:
    """Frequencies of a torque to which the lobes of a figure-eight do not respond.

    Parameters
    ----------
    perturbed : Perturbed
        A system with coefficients (A, B, C), perturbed.
    n : int, default 8
        How many of them.

    Returns
    -------
    xarray.Dataset
        ``quiet_frequency`` in s^-1 on (``saddle``, ``side``, ``order``): the zeros of Melnikov's
        function of a torque ``cos(nu t)``, multiples of the first; NaN for loops that wind.

    Raises
    ------
    ParameterError
        If the system is not perturbed, or n is not a whole number >= 1.

    Examples
    --------
    >>> import phasekit as pk
    >>> driven = pk.Perturbed(pk.Coefficients(1.0, 0.35, 0.12), forcing=pk.Harmonic(1.0, 1.0))
    >>> quiet = pk.quiet_frequencies(driven, n=2).quiet_frequency.sel(saddle="lower")
    >>> nu = quiet.sel(side="left", order=2).item()
    >>> at = pk.melnikov(driven.replace(forcing_frequency=nu))
    >>> bool(abs(at.melnikov_amplitude.sel(saddle="lower", side="left")) < 1e-12)
    True
    """
    number = whole("n", n, "a whole number >= 1")
    ds = _of_system("quiet_frequencies", perturbed)
    attrs = {"long_name": "number of the quiet frequency"}
    order = xr.DataArray(np.arange(1, number + 1), dims="order", attrs=attrs)
    first = ds.quiet_frequency
    listed = first * order
    listed.attrs = {**first.attrs, "long_name": "frequency to which the lobe does not respond"}
    return ds.assign(quiet_frequency=listed).assign_coords(order=order)


def _of_system(group: str, system: Any) -> xr.Dataset:
    system, rows = as_system(system), select(group)
    return evaluate(system, rows, passes_of(system, rows))
