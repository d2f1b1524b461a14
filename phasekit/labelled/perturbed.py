"""Perturbed systems, labelled: Melnikov's function, capture, escape, torques, resonances."""

from __future__ import annotations

import functools
import itertools
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
import xarray as xr

from phasekit.cells.evaluate import evaluate
from phasekit.cells.numbered import with_errors
from phasekit.cells.request import passes_of
from phasekit.cells.states import option_of
from phasekit.errors import warn
from phasekit.labelled.orbits import family_code, wants_family, with_notes
from phasekit.labels.arguments import bad, call_checked, one_of, whole
from phasekit.labels.coordinates import LABELS
from phasekit.systems.system import as_system
from phasekit.table.quantities import returns, select
from phasekit.table.row import Quantity

#: The family that is meant where none is named, of numbered centers and of those with names.
LOWEST = ("the well of the lowest center", "lower_well")


@call_checked
@returns("melnikov")
def melnikov(system: Any) -> xr.Dataset:
    """Melnikov's function on the separatrices: thresholds of irregular motion.

    Parameters
    ----------
    system : Perturbed
        A system with damping and drive.

    Returns
    -------
    xarray.Dataset
        The threshold is that of the given damping: NaN without damping, infinite where the loop
        does not respond. Where ``threshold_validity`` is not HOLDS, the results are NaN and the
        code is the reason. Only where it is STRONG_DRIVE they are given: there the drive at the
        threshold, with what a torque changes, is so strong that the threshold is likely to be off
        by more than a quarter.
        ``chaos_threshold_error`` estimates by how much; it is meant for small errors.

        With several frequencies the amplitude is the largest deviation from the mean over all
        times, and the phase is NaN. The threshold is that of the first harmonic of the forcing,
        with the others in proportion. Frequencies without a common period have no turnstile area:
        it is NaN. Without forcing the threshold is that of the first modulated parameter.

    Raises
    ------
    ParameterError
        If the system is not perturbed, or omega1 is a function of time.

    Notes
    -----
    Of a `FreeGyroRotor` energies are in J and the turnstile in kg m^2/s.

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
    return _of_system("melnikov", system)


@call_checked
@returns("quiet_frequencies")
def quiet_frequencies(system: Any, *, n: int = 8) -> xr.Dataset:
    """Frequencies of a torque to which the lobes of a figure-eight do not respond.

    Parameters
    ----------
    system : Perturbed
        A system in a potential, perturbed.
    n : int, default 8
        How many of them.

    Returns
    -------
    xarray.Dataset
        The zeros of Melnikov's function of a torque ``cos(nu t)``, multiples of the first; NaN for
        loops that wind. Those of a `Potential` have ``quiet_frequency_error``; they are the least
        ones, and NaN from where the response, which falls exponentially, is lost in rounding.

    Raises
    ------
    ParameterError
        If the system is not perturbed, n is not a whole number >= 1, or omega1 is a function of
        time.

    Notes
    -----
    Along a loop that returns to its saddle on the same side, in (A, B, C), the amplitude of a
    torque's Melnikov function has the factor ``sin(nu x/k)``, where
    ``cosh(x + i y) = (-S + i k^2)/sqrt D``,
    ``S = (A/2) sin 2 phi_s``, ``D = S^2 + (B cos phi_s + C sin phi_s) k^2``, and k is the saddle's
    exponent: the two poles of the separatrix next to real time give a residue each
    ([Melnikov1963]; [GuckenheimerHolmes1983] section 4.5). It vanishes at ``nu = order pi k/x``.
    In any potential these are the zeros of ``int phi' sin(nu t) dt``, by the trapezoidal rule.

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
    system = as_system(system)
    labels = {**LABELS, "order": (range(1, number + 1), "number of the quiet frequency")}
    rows = select("quiet_frequencies")
    if not system.standing.rung.labels_fixed:
        rows = tuple(with_errors(system, rows))
    rows = tuple(replace(row, labels=labels) for row in rows)
    return _of_system("quiet_frequencies", system, rows, number=number)


@call_checked
@returns("capture")
def capture(system: Any, *, start: str = "outside") -> xr.Dataset:
    """Probability of capture in each well, for a motion that slowly reaches a separatrix.

    Parameters
    ----------
    system : Perturbed
        A system with damping, and parameters that drift or a constant torque.
    start : {"outside", "rotation"}
        Where the motion comes from: round both wells, from outside the figure-eight of the lower
        saddle; or from rotation beyond the winding separatrix, in the sense that the torque brakes
        (forward where there is none), or the inertial torque of a frame that drifts. Round two
        wells between saddles of one energy nothing is outside but rotation: both are the same.

    Returns
    -------
    xarray.Dataset
        The dim ``region`` is left, right, none; over it the probability sums to 1. Left and right
        are the lobes of the lower saddle; in a system with one well the side from which the
        rotation came stays empty, and so it does over three or more wells between saddles of one
        energy, where the other side is all of them. "none": the motion is not captured, never
        reaches the separatrix, or stays round both wells because they shrink too fast. NaN where
        there is no such separatrix, and from rotation over three or more wells with saddles of
        several energies.
        Where ``capture_validity`` is not HOLDS, the results are NaN and the code is the reason.

    Raises
    ------
    ParameterError
        If the system is not perturbed, start is unknown, or omega1 is a function of time.

    Notes
    -----
    A region of area S gains phase space at the rate ``damping S + dS/dt``. The probability is the
    ratio of these fluxes if both are positive ([Neishtadt1975]). From rotation it is the flux into
    the cell over the flux that the rotation loses: with the area S of the cell and its width
    w = 2 pi, ``2/(1 + 2 |torque| w/(damping S + dS/dt))`` ([GoldreichPeale1966], with drift). It
    is 1 where this exceeds 1, and 0 where the cell shrinks faster than damping fills it. The lobes
    share it by their own fluxes. A drifting parameter has its present value when the motion
    reaches the separatrix. The results are of first order in damping and drift, for motions whose
    actions are spread; the error is of the order rate log(rate).

    Examples
    --------
    >>> import phasekit as pk
    >>> damped = pk.Perturbed(pk.Coefficients(1.0, 0.35, 0.12), damping=0.003)
    >>> pk.capture(damped).capture_probability.values.round(6).tolist()
    [0.28055, 0.71945, 0.0]
    """
    rotation = bool(one_of("start", start, ("outside", "rotation")))
    return with_notes(_of_system("capture", system, rotation=rotation), start=start)


@call_checked
@returns("escape")
def escape_rate(system: Any, *, center: str | int | None = None) -> xr.Dataset:
    """Rates of thermal escape from a well, over each saddle at its ends.

    Parameters
    ----------
    system : Perturbed
        A system in a potential, with damping and a thermal energy kT; with a constant torque, and
        no other drive.
    center : {"lower_center", "upper_center"} or int, optional
        The center of the well: a label, or of a `Potential` its number among the equilibria; by
        default the lower, or the lowest.

    Returns
    -------
    xarray.Dataset
        The side is that of the saddle on which the well lies. Over the lower saddle it leads into
        the other well; over the upper one, which winds, out of both wells together, on either side.
        Under a torque both ends of a well differ; the rate is that of the end which is reached
        first, over the higher one at low damping next to nothing. In a row of wells, over the lower
        end of the well, then over that of the wells on both sides of it together, and so on. Absent
        ones, barriers below 2 kT, rates that are not known within their own size and systems with a
        drive are NaN.

    Raises
    ------
    ParameterError
        If the system is not perturbed, or the center unknown.

    Notes
    -----
    Kramers' rate with the integral over the well, times the factors for recrossing and for
    low damping ([MelnikovMeshkov1986], [HanggiTalknerBorkovec1990]). These factors hold for high
    barriers. In the limits of low and of strong damping the mean first passage of the energy, by
    its exact actions, and that of the angle correct them; in between the corrections enter as far
    as the rate follows the damping. The error is the distance to the farther one of the rates with
    all of the corrections and with none, which simulated paths have in between. Over both ends of
    a tilted well the equations of the swings are solved as a pair.

    Examples
    --------
    >>> import phasekit as pk
    >>> warm = pk.Perturbed(pk.Coefficients(1.0, 0.35, 0.0), damping=0.5, kT=0.04)
    >>> rate = pk.escape_rate(warm).escape_rate.sel(saddle="lower", side="right").item()
    >>> round(rate, 5)
    0.00053
    """
    system = as_system(system)
    number = option_of(system, "center", center)
    meant = system.standing.rung.default["center"] if center is None else center
    return with_notes(_of_system("escape", system, center=number), center=str(meant))


@call_checked
@returns("critical_torques")
def critical_torque(system: Any) -> xr.Dataset:
    """Smallest and largest constant torque for which an equilibrium exists.

    Parameters
    ----------
    system : system
        A system in a potential, perturbed or not; a torque of its own does not count.

    Returns
    -------
    xarray.Dataset
        On ``direction`` (minus, plus). Those of a `Potential` have ``critical_torque_error``, an
        estimate, ``critical_phi_error``, a bound, and ``critical_complete``: whether they are
        proved to be the extremes. On an interval equilibria may leave at an end of it instead; on a
        line without ends the torque is infinite where V' has no bound, and has no place.

    Notes
    -----
    The extremes of V', which are equilibria of V' as a potential [MooreKearfottCloud2009]. Those of
    (A, B, C) are exact: V'' = 0 is the equation of equilibria of another system,
    ``V''(phi; A, B, C) = V'(phi - pi/4; -2 A, (C - B)/sqrt 2, -(B + C)/sqrt 2)``, V being that of
    [Veljovic2015] (15). The critical current of a Josephson junction ([Stewart1968],
    [McCumber1968]) is that of ``A = C = 0``.

    Examples
    --------
    >>> import phasekit as pk
    >>> pk.critical_torque(pk.Pendulum(length=1.0, g=9.81)).critical_torque.values.round(9).tolist()
    [-9.81, 9.81]
    """
    ds = _of_system("critical_torques", system)
    proved = ds.get("critical_complete")
    if proved is not None and proved.chunks is None:
        open_ = int((~proved & ds.critical_torque.notnull().any("direction")).sum())
        if open_:
            warn(
                f"critical_torque: in {open_} of {proved.size} systems it is not proved that these "
                "are the extremes; there `critical_complete` is False",
                RuntimeWarning,
            )
    return ds


@call_checked
@returns("retrapping")
def retrapping_torque(system: Any) -> xr.Dataset:
    """Smallest constant torque that sustains a rotation, at small damping.

    Parameters
    ----------
    system : Perturbed
        A system in a potential on a circle, and damping; a torque of its own does not count.

    Returns
    -------
    xarray.Dataset
        On ``direction`` (minus, plus). Where ``retrapping_validity`` is not HOLDS, the torque is
        NaN and the code is the reason.

    Raises
    ------
    ParameterError
        If the system is not perturbed or on a line, or omega1 is a function of time.

    Notes
    -----
    Over one turn of the winding separatrix the torque gives what damping takes,
    ``2 pi torque = damping S + quadratic int |phi'|^3 dt``, S being its ``winding_area``: first
    order in the damping. Of a Josephson junction it is the current at which the voltage is lost
    ([Stewart1968], [McCumber1968]).

    Examples
    --------
    >>> import phasekit as pk
    >>> damped = pk.Perturbed(pk.Pendulum(length=1.0, g=1.0), damping=0.1)
    >>> pk.retrapping_torque(damped).retrapping_torque.values.round(6).tolist()  # 0.4/pi
    [-0.127324, 0.127324]
    """
    return _of_system("retrapping", system)


@call_checked
@returns("resonances")
def resonances(
    system: Any, *, n: int | Sequence[int], m: int = 1, family: str | None = None
) -> xr.Dataset:
    """Resonances between orbits and drive: their actions, widths and overlap.

    Parameters
    ----------
    system : Perturbed
        A system in a potential, and a drive; a constant torque is part of the potential.
    n : int or sequence of int
        Orders of the resonances: all from 1 to n, or those given.
    m : int, default 1
        Multiple of the drive's frequency.
    family : {"lower_well", "upper_well", "outer", "forward", "backward"}, optional
        The family of orbits; of a `Potential` "forward", "backward", and "well_0", "wells_0_2", ...
        by the numbers of the centers. By default the well of the lower, or lowest, center.

    Returns
    -------
    xarray.Dataset
        At a resonance ``n Omega(J) = m nu``, nu the frequency of the first harmonic of the forcing,
        or else of the modulation; with an overlap near 1 motion between neighbours becomes
        irregular. NaN where the family has no such orbit; of several, that of least action, in
        "outer" and rotations that next to the separatrix. The width is 0 where no harmonic has the
        frequency m nu, and NaN closer to the separatrix than 1e-12 of its height. Under a torque
        nothing rotates: NaN.

    Notes
    -----
    The pendulum approximation, first order in the drive ([Chirikov1979]); Fourier coefficients over
    the angle variable, exact in (A, B, C), and of a `Potential` or under a torque by quadrature.

    Examples
    --------
    >>> import phasekit as pk
    >>> driven = pk.Perturbed(pk.Pendulum(length=1.0, g=1.0), forcing=pk.Harmonic(0.01, 0.8))
    >>> ds = pk.resonances(driven, n=3)
    >>> ds.resonance_action.dims, bool(ds.resonance_width.sel(order=1) > 0)
    (('order',), True)
    """
    orders = _orders(n)
    order = whole("m", m, "a whole number >= 1")
    system = as_system(system)
    code = 0
    if family is not None:
        found = family_code(system, family) if isinstance(family, str) else None
        if found is None:
            raise bad("family", family, wants_family(system))
        code = found
    labels = {**LABELS, "order": (orders, "order of the resonance")}
    rows = tuple(replace(row, labels=labels) for row in select("resonances"))
    options = {"orders": orders, "m": order, "family": code}
    ds = _of_system("resonances", system, rows, **options)
    meant = LOWEST[system.standing.rung.labels_fixed] if family is None else family
    return with_notes(ds, family=meant, m=str(order))


def _orders(n: Any) -> tuple[int, ...]:
    wants = "a whole number >= 1, or a list of them that rises"
    if isinstance(n, (list, tuple, range, np.ndarray)):
        orders = tuple(whole("n", one, wants) for one in n)
        if not orders or any(a >= b for a, b in itertools.pairwise(orders)):
            raise bad("n", n, wants)
        return orders
    return tuple(range(1, whole("n", n, wants) + 1))


def _of_system(
    group: str, system: Any, rows: Sequence[Quantity] | None = None, **options: Any
) -> xr.Dataset:
    system, rows = as_system(system), rows or select(group)
    passes = passes_of(system, rows)
    if options:
        passes = tuple(
            replace(one, function=functools.partial(one.resolved, **options)) for one in passes
        )
    return evaluate(system, rows, passes)
