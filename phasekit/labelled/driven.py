"""Damped and driven motions, labelled: once a period, and how fast neighbours part."""

from __future__ import annotations

import functools
from dataclasses import replace
from typing import Any

import numpy as np
import xarray as xr

from phasekit.cells.request import passes_of
from phasekit.cells.states import at_states
from phasekit.labelled.motion import checked_tolerances, refuse_noise
from phasekit.labels.arguments import (
    NumberLike,
    bad,
    number,
    numeric,
    state_arguments,
    whole,
)
from phasekit.labels.coordinates import LABELS
from phasekit.laws.perturbed import PerturbedConservative
from phasekit.numerics.waits import said
from phasekit.systems.perturbed import Perturbed
from phasekit.systems.system import as_system
from phasekit.table.quantities import ROWS, select
from phasekit.table.row import STATE, Pass


def perturbed_of(system: Any) -> Perturbed:
    """Return a perturbed system without noise.

    Raises
    ------
    ParameterError
        If it is another one.
    """
    found: Any = as_system(system)
    if not issubclass(found.rung, PerturbedConservative):
        raise bad("perturbed", found, "a pk.Perturbed(system, damping=..., forcing=...)")
    refuse_noise(found)
    perturbed: Perturbed = found
    return perturbed


@state_arguments
def stroboscopic(
    perturbed: Any,
    phi0: NumberLike,
    dphi0: NumberLike,
    *,
    n: int,
    skip: int = 0,
    period: float | None = None,
    rtol: float | None = None,
    atol: float | None = None,
) -> xr.Dataset:
    """States of motions once a period of the drive.

    Parameters
    ----------
    perturbed : Perturbed
        A system with damping and drive.
    phi0, dphi0 : float, 1-D array_like or xarray.DataArray
        States at t = 0: angles in rad, angular velocities in s^-1.
    n : int
        States to keep.
    skip : int, default 0
        Periods before the first of them; 0: the first is the state at t = 0.
    period : float, optional
        Time from state to state in s; default: the common period of all that varies.
    rtol, atol : float, optional
        As in `flow`.

    Returns
    -------
    xarray.Dataset
        On the dim ``crossing``: ``section_time`` in s, ``section_phi`` in rad in (-pi, pi], and
        ``section_dphi`` in s^-1; ``rotation_number``, the turns in a period (NaN on a line).

    Raises
    ------
    ParameterError
        If an argument is unusable, or nothing varies with a period of its own and none is given.

    Notes
    -----
    The orbit of the Poincare map of a forced system, ``(phi, phi')(k T), k = skip, skip + 1, ...``
    ([GuckenheimerHolmes1983] section 1.5), by the integration of `flow`. Frequencies whose ratio is
    a fraction of whole numbers up to 64 have a common period T. ``rotation_number`` is
    ``(phi(k_last T) - phi(k_first T))/(2 pi (k_last - k_first))``, NaN for n = 1.

    Examples
    --------
    >>> import phasekit as pk
    >>> well = pk.Potential("x^4/4 - x^2/2", "x")
    >>> driven = pk.Perturbed(well, damping=0.15, forcing=pk.Harmonic(0.2, 1.0))
    >>> pk.stroboscopic(driven, 1.0, 0.0, n=2, skip=200).section_phi.values.round(8)
    array([1.21009082, 1.21009082])
    """
    system = perturbed_of(perturbed)
    n = whole("n", n, "a number of states, >= 1", 1)
    skip = whole("skip", skip, "a number of periods, >= 0", 0)
    if period is not None:
        wants = "a time in s, > 0"
        period = number("period", period, wants, "s")
        if not period > 0.0:
            raise bad("period", period, wants)
    options = {"n": n, "skip": skip, "period": period, **checked_tolerances(rtol, atol)}
    names = ("section_time", "section_phi", "section_dphi", "rotation_number")
    labels = {**LABELS, "crossing": (range(skip, skip + n), "number of the period")}
    rows = [replace(ROWS[name], labels=labels) for name in names]
    function = functools.partial(_sections, system.law, **options)
    one = Pass(function, (*system.parameters, *STATE), ("stroboscopic",), PerturbedConservative)
    states = {"phi0": ("state_phi", phi0), "dphi0": ("state_dphi", dphi0)}
    with said(f"following motions for {skip + n:,} periods"):
        return at_states(system, rows, states, (one,))


def _sections(law: PerturbedConservative, *arrays: Any, **options: Any) -> Any:
    from phasekit.motion.strobe import sections

    return sections(law, *arrays, **options)


@state_arguments
def lyapunov(
    perturbed: Any,
    phi0: NumberLike,
    dphi0: NumberLike,
    *,
    time: NumberLike,
    rtol: float | None = None,
    atol: float | None = None,
) -> xr.Dataset:
    """Lyapunov exponents of motions: how fast neighbours part, or come together.

    Parameters
    ----------
    perturbed : Perturbed
        A system with damping and drive.
    phi0, dphi0 : float, 1-D array_like or xarray.DataArray
        States at t = 0: angles in rad, angular velocities in s^-1.
    time : float, 1-D array_like or xarray.DataArray
        Time over which tangent vectors grow, in s, > 0; its first tenth is not counted. A bare
        array makes the dim ``time``, on which the convergence shows.
    rtol, atol : float, optional
        As in `flow`.

    Returns
    -------
    xarray.Dataset
        On ``exponent``: ``lyapunov_exponent`` in s^-1, the largest first, and its
        ``lyapunov_error``. ``lyapunov_sum``, which is -damping where there is no quadratic
        damping, as a check (of a `FreeGyroRotor` the mean of -damping M22/M, M the inertia at the
        momentum).

    Raises
    ------
    ParameterError
        If an argument is unusable.

    Notes
    -----
    Tangent vectors move by the variational equation along with the motion, made orthonormal again
    and again [BenettinGalganiGiorgilliStrelcyn1980]. The error is estimated from the spread and
    the trend of the growth over parts of the time; it falls as the time grows.

    Examples
    --------
    >>> import phasekit as pk
    >>> well = pk.Potential("x^4/4 - x^2/2", "x")
    >>> driven = pk.Perturbed(well, damping=0.25, forcing=pk.Harmonic(0.4, 1.0))
    >>> ds = pk.lyapunov(driven, 0.1, 0.0, time=2000.0)
    >>> bool(ds.lyapunov_exponent[0] > 0.1), abs(ds.lyapunov_sum.item() + 0.25) < 1e-8
    (True, True)
    """
    system = perturbed_of(perturbed)
    wants = "times in s, > 0"
    if np.any(np.asarray(numeric("time", time, "s", wants)) <= 0.0):
        raise bad("time", time, wants)
    rows = select("lyapunov")
    (one,) = passes_of(system, rows)
    tolerances = checked_tolerances(rtol, atol)
    one = replace(one, function=functools.partial(one.resolved, **tolerances))
    states = {
        "phi0": ("state_phi", phi0), "dphi0": ("state_dphi", dphi0), "time": ("time", time)
    }  # fmt: skip
    with said("following motions and what lies beside them"):
        return at_states(system, rows, states, (one,))
