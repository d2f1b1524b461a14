"""Damped and driven motions, labelled: once a period, and how fast neighbours part."""

from __future__ import annotations

import functools
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import xarray as xr

from phasekit.cells.request import equations_for
from phasekit.cells.states import at_states
from phasekit.inputs import refuse_call
from phasekit.labelled.motion import checked_tolerances, refuse_noise
from phasekit.labels.arguments import bad, number, numeric, state_arguments, whole
from phasekit.labels.coordinates import LABELS
from phasekit.laws.perturbed import OWN
from phasekit.numerics.waits import notice
from phasekit.systems.perturbed import Perturbed
from phasekit.systems.system import System, as_system
from phasekit.table.quantities import ROWS, returns, select
from phasekit.table.row import STATE, Pass


def perturbed_of(system: Any) -> Perturbed:
    """Return a perturbed system without noise."""
    found: Any = as_system(system)
    if found.standing.traits is None:
        raise bad("perturbed", found, "a pk.Perturbed(system, damping=..., forcing=...)")
    refuse_noise(found)
    perturbed: Perturbed = found
    return perturbed


def following(system: System, function: Callable[..., Any]) -> Callable[..., Any]:
    """A function of a law with terms, of parameters and of states, for a system with or without.

    The terms of a system without have the value zero.
    """
    if system.standing.traits is not None:
        refuse_noise(system)
        return functools.partial(function, system.law)
    law, count = Perturbed(system).law, len(system.parameters)

    def alone(*arrays: Any) -> Any:
        return function(law, *arrays[:count], *np.zeros(len(OWN)), *arrays[count:])

    return alone


@state_arguments
def stroboscopic(
    system: Any,
    phi0: Any = None,
    dphi0: Any = None,
    *,
    n: int,
    x0: Any = None,
    skip: int = 0,
    period: float | None = None,
    rtol: float | None = None,
    atol: float | None = None,
    **states: Any,
) -> xr.Dataset:
    """States of motions once a period of the drive.

    Parameters
    ----------
    system : Perturbed, or forced Problem
        A system with damping and drive, or any flow with a period.
    n : int
        States to keep.
    skip : int, default 0
        Periods before the first of them; 0: the first is the state at t = 0.
    period : float, optional
        Time from state to state in s; default: the common period of all that varies.
    x0 : mapping, sequence or xarray.DataArray, optional
        States at t = 0 of a `Problem`, as in `flow`.

    Returns
    -------
    xarray.Dataset
        On the dim ``crossing``: ``section_time`` in s, ``section_phi`` in rad in (-pi, pi], and
        ``section_dphi`` in s^-1; ``rotation_number``, the turns in a period (NaN on a line). Of a
        `Problem` ``section_`` and the name of each state.

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
    n = whole("n", n, "a number of states, >= 1", 1)
    skip = whole("skip", skip, "a number of periods, >= 0", 0)
    if period is not None:
        wants = "a time in s, > 0"
        period = number("period", period, wants, "s")
        if not period > 0.0:
            raise bad("period", period, wants)
    found = as_system(system)
    if (law := equations_for(found, "motion")) is not None:
        from phasekit.labelled.flows import refuse_keywords, sections_of, starts_of

        refuse_keywords(stroboscopic, law, states)
        start, named = starts_of(found, x0, states, phi0, dphi0)
        tolerances = checked_tolerances(rtol, atol)
        return sections_of(found, law, start, named, n, skip, period, tolerances)
    needed = {"phi0": phi0, "dphi0": dphi0}
    refuse_call(stroboscopic, states, [name for name, value in needed.items() if value is None])
    if x0 is not None:
        raise bad("x0", x0, "nothing for a system whose state is phi0, dphi0")
    options = {"n": n, "skip": skip, "period": period, **checked_tolerances(rtol, atol)}
    names = ("section_time", "section_phi", "section_dphi", "rotation_number")
    labels = {**LABELS, "crossing": (range(skip, skip + n), "number of the period")}
    rows = [replace(ROWS[name], labels=labels) for name in names]
    function = following(found, functools.partial(_sections, **options))
    one = Pass(function, (*found.parameters, *STATE), ("stroboscopic",), found.standing)
    at = {"phi0": ("state_phi", phi0), "dphi0": ("state_dphi", dphi0)}
    with notice(f"following motions for {skip + n:,} periods"):
        return at_states(found, rows, at, (one,))


def _sections(*arrays: Any, **options: Any) -> Any:
    from phasekit.motion.strobe import sections

    return sections(*arrays, **options)


def _exponents(*arrays: Any, **options: Any) -> Any:
    from phasekit.motion.exponents import lyapunov

    return lyapunov(*arrays, **options)


@state_arguments
@returns("lyapunov")
def lyapunov(
    system: Any,
    phi0: Any = None,
    dphi0: Any = None,
    *,
    x0: Any = None,
    duration: Any = None,
    n: Any = None,
    count: int | None = None,
    rtol: float | None = None,
    atol: float | None = None,
    **states: Any,
) -> xr.Dataset:
    """Lyapunov exponents of motions: rates at which neighbouring motions separate.

    Parameters
    ----------
    system : Perturbed, Problem, or system that states rates or a step
        A system with damping and drive, any flow, or a map.
    x0 : mapping, sequence or xarray.DataArray, optional
        States at t = 0 of a `Problem`, as in `flow`; ``lyapunov(problem, x0)`` does as well.
    duration : float, 1-D array_like or xarray.DataArray
        Time over which tangent vectors grow, in s, > 0; its first tenth is not counted. A bare
        array makes the dim ``time``, on which the convergence shows.
    n : int, 1-D array_like or xarray.DataArray
        Of a map the number of iterations in place of a duration, at least 100.
    count : int, optional
        Of a `Problem` how many exponents, the largest first; by default all.

    Returns
    -------
    xarray.Dataset
        The sum is -damping where there is no quadratic damping, as a check (of a `FreeGyroRotor`
        the mean of -damping M22/M, M the inertia at the momentum). Of a `Problem` it is the mean
        of the divergence of f, and NaN unless all exponents are computed. ``lyapunov_dimension`` is
        that of the states; a forced motion has one more, its time.

    Notes
    -----
    Tangent vectors move by the variational equation along with the motion, made orthonormal again
    and again [BenettinGalganiGiorgilliStrelcyn1980]. The error is estimated from the spread and
    the trend of the growth over parts of the time; it falls as the time grows. The dimension is
    ``k + (l_1 + ... + l_k)/|l_(k+1)|`` of the exponents l, with the greatest k whose sum is not
    negative.

    Examples
    --------
    >>> import phasekit as pk
    >>> well = pk.Potential("x^4/4 - x^2/2", "x")
    >>> driven = pk.Perturbed(well, damping=0.25, forcing=pk.Harmonic(0.4, 1.0))
    >>> ds = pk.lyapunov(driven, 0.1, 0.0, duration=2000.0)
    >>> bool(ds.lyapunov_exponent[0] > 0.1), abs(ds.lyapunov_sum.item() + 0.25) < 1e-8
    (True, True)
    >>> henon = pk.Problem(
    ...     {"x": "1 - a*x^2 + y", "y": "b*x"}, parameters={"a": 1.4, "b": 0.3}, map=True
    ... )
    >>> round(pk.lyapunov(henon, [0.1, 0.1], n=100_000).lyapunov_sum.item(), 9)  # ln 0.3
    -1.203972804
    """
    found = as_system(system)
    law = equations_for(found, "lyapunov")
    if law is not None:
        from phasekit.labelled.flows import exponents_of, refuse_keywords, starts_of

        refuse_keywords(lyapunov, law, states)
        start, named = starts_of(found, x0, states, phi0, dphi0)
        tolerances = checked_tolerances(rtol, atol)
        return exponents_of(found, law, start, named, ("duration", duration), n, count, tolerances)
    needed = {"phi0": phi0, "dphi0": dphi0, "duration": duration}
    refuse_call(lyapunov, states, [name for name, value in needed.items() if value is None])
    for name, value in {"x0": x0, "n": n, "count": count}.items():
        if value is not None:
            raise bad(name, value, "nothing for a system whose state is phi0, dphi0")
    wants = "times in s, > 0"
    if np.any(np.asarray(numeric("duration", duration, "s", wants)) <= 0.0):
        raise bad("duration", duration, wants)
    rows = select("lyapunov")
    function = following(found, functools.partial(_exponents, **checked_tolerances(rtol, atol)))
    one = Pass(function, (*found.parameters, *STATE, "time"), ("lyapunov",), found.standing)
    at = {
        "phi0": ("state_phi", phi0), "dphi0": ("state_dphi", dphi0), "duration": ("time", duration)
    }  # fmt: skip
    with notice("following motions and their tangent vectors"):
        return at_states(found, rows, at, (one,))
