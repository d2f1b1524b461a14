"""Motion, labelled: states after any time, and motion on a separatrix.

Array parameters of the system and of the states span the result's dims, times the dim `time`.
"""

from __future__ import annotations

import functools
from dataclasses import replace
from typing import Any

import numpy as np
import xarray as xr

from phasekit.cells.request import equations_for, passes_of
from phasekit.cells.states import at_states, pass_from
from phasekit.inputs import refuse_call
from phasekit.labelled.orbits import with_notes
from phasekit.labels.arguments import NumberLike, bad, call_checked, number, state_arguments
from phasekit.laws.ladder import Conservative
from phasekit.numerics.waits import notice
from phasekit.systems.perturbed import Perturbed
from phasekit.systems.system import System, as_system
from phasekit.table.quantities import returns, select


@state_arguments
@returns("motion")
def flow(
    system: Any,
    phi0: Any = None,
    dphi0: Any = None,
    t: Any = None,
    *,
    x0: Any = None,
    rtol: float | None = None,
    atol: float | None = None,
    events: Any = None,
    method: str | None = None,
    paths: int | None = None,
    seed: int | None = None,
    step: float | None = None,
    **states: Any,
) -> xr.Dataset:
    """Motion from a state: exact for any time, integrated with damping and drive.

    Parameters
    ----------
    system : system
        Any system. In a potential without damping and drive there is no integration, so no error
        that grows with steps. A `FreeGyroRotor` moves at its momentum.
    t : float, 1-D array_like or xarray.DataArray
        Times in s, of either sign and in any order. A bare array makes the dim ``time``. Of a map
        counts of iterations.
    x0 : mapping, sequence or xarray.DataArray, optional
        States at t = 0 of a `Problem`, or of a system that states rates or a step: by name, or in
        their order; ``flow(problem, x0, t)`` does as well. Each may be an array, as `phi0` may.
    rtol, atol : float, optional
        Of a motion that is integrated: the error of a step that is allowed, relative (default
        1e-10) and absolute (1e-12, in rad and in s^-1). Of a coordinate beyond one radian it is
        relative to one radian. On a line, of motions whose states are below 1 as yet, the absolute
        error is that part of the greatest: lengths may be in any unit.
    events : str, callable, Event, or mapping of str to such, optional
        Of motions that are integrated: formulas of states, parameters and time ``t``, or functions
        of (t, phi, dphi), of a `Problem` of (t, x), whose zeros are looked for between t = 0 and
        the times. Functions may have attributes as in SciPy: ``terminal``, True or at which of its
        zeros the motion ends, and ``direction``, > 0 or < 0; `Event` gives both to formulas. What
        comes to 1e-8 of its values around and turns back touches zero and counts, unless it has a
        direction; zeros that lie closer together than a quarter of a step may be missed. A
        stretch on which one vanishes counts once, of a function with a RuntimeWarning. Formulas
        are watched in compiled code, functions motion by motion.
    method : {"taylor", "dop853", "rosenbrock", "radau"}, optional
        Of a `Problem`; ``attrs["method"]`` says which was taken. By default an implicit one where
        the motion is stiff, else Taylor series where the
        formulas are short (up to 48 operations, shared parts counted once), else DOP853.
    paths : int, optional
        Of a `Problem` with noise, or a `Perturbed` system with kT: how many paths to follow from
        each state. Without it a `Problem` is followed without noise.
    seed : int, optional
        Of the random numbers of paths. A path has the same bits for the same seed, number,
        parameters and state, whatever is followed beside it (with the same version of NumPy). By
        default one that ``attrs["seed"]`` names.
    step : float, optional
        Longest time step of paths, in s. By default 1/20 of the fastest time in which motions
        without noise change, and less where such steps would feed a weakly damped oscillation.
        Errors of means fall with its square: another step shows them.
    **states
        The states of a `Problem` by name, one argument each, in place of `x0`.

    Returns
    -------
    xarray.Dataset
        A rotation runs past pi. NaN where a motion with damping and drive could not be followed to
        a time, which a RuntimeWarning says. With events also ``event_name``, ``event_time``,
        ``event_phi`` and ``event_dphi`` on the dim ``event``; after one that ends the motion it is
        NaN. Where there are several motions, ``n_events`` says how many each has, and the others
        are NaN. Of a `Problem` ``motion_`` and ``event_`` and the name of each state. With paths
        they have the dim ``path``, and ``noise_step`` is the longest step.

    Raises
    ------
    ConvergenceError
        If events are looked for on a motion that takes too many steps, or steps too short.

    Notes
    -----
    Solves [Veljovic2015] (12) in elliptic functions, on a separatrix in elementary ones. Damped
    and driven motions are integrated in compiled code, eight at a time, on all cores: by their
    Taylor series, of an order from 6 to 20 by rtol [JorbaZou2005], where the law is made of sums,
    products, powers, sin, cos, exp, log, sinh, cosh and tanh. Otherwise, with quadratic
    damping, and where series would take too many steps, the Runge-Kutta method DOP853 of order 8
    is used ([HairerNorsettWanner1993] II.5), whose steps are interpolated to the seventh order.
    Quadratic damping is not smooth where the motion turns: steps end there. Motions that linear
    damping holds back for more than 6e7 of its own times are followed by Radau's implicit method
    of order 5 ([HairerWanner1996] IV.8), with an rtol of at least 1e-13, and by DOP853 where that
    gives up. A motion ends after 10,000,000 steps. Events are looked for along steps of DOP853, of
    which there may be 1,000,000. Where damping, torque and drive are all zero, the motion in the
    potential of (A, B, C) is the exact one.

    Examples
    --------
    >>> import numpy as np
    >>> import phasekit as pk
    >>> disk = pk.GyroRotorDisk(beta=18 * pk.deg, e=0.001153, a=0.002, r=0.2, omega1=24 * pk.rpm)
    >>> pk.flow(disk, [0.1, 0.2, 0.3], 0.0, np.linspace(0.0, 60.0, 601)).motion_phi.dims
    ('point', 'time')

    Equations of one's own, for three values of a parameter:

    >>> brusselator = pk.Problem(
    ...     {"x": "a + x^2*y - (b + 1)*x", "y": "b*x - x^2*y"}, parameters={"a": 1, "b": [1, 2, 3]}
    ... )
    >>> pk.flow(brusselator, [1.0, 1.0], np.linspace(0.0, 20.0, 201)).motion_x.dims
    ('b', 'time')
    """
    system = as_system(system)
    law = equations_for(system, "motion")
    if paths is None:
        for name, value in {"seed": seed, "step": step}.items():
            if value is not None:
                raise bad(name, value, "nothing without paths")
    else:
        for name, value in {"events": events, "method": method, "rtol": rtol, "atol": atol}.items():
            if value is not None:
                raise bad(name, value, "nothing beside paths, which are taken by Heun's steps")
        from phasekit.labelled.noise import checked, paths_of

        options = checked(paths, seed, step)
        if law is None or system.standing.traits is not None:
            return paths_of(system, None, states, (phi0, dphi0), t, options)
        given = [phi0, dphi0] if t is not None and dphi0 is not None else phi0
        x0, t = (given if x0 is None else x0), (dphi0 if t is None else t)
        return paths_of(system, x0, states, (), t, options)
    if law is not None:
        from phasekit.labelled.events import events_of_equations, watched_of
        from phasekit.labelled.flows import motions_of, refuse_keywords, starts_of
        from phasekit.systems.field_arrays import by_state, gathered

        if t is None:
            t, dphi0 = dphi0, None
        if any(block.name in states for block in getattr(system, "blocks", ())):
            states = by_state(system, states, "flow")
        refuse_keywords(flow, law, states)
        start, named = starts_of(system, x0, states, phi0, dphi0)
        start = by_state(system, start)
        tolerances = checked_tolerances(rtol, atol)
        watched = None if events is None else watched_of(law, events)
        ds = motions_of(system, law, start, named, t, tolerances=tolerances, method=method)
        if watched is not None:
            ds = events_of_equations(ds, law, system, start, named, watched, tolerances)
        return gathered(system, ds)
    for name, value in {"x0": x0, "method": method}.items():
        if value is not None:
            raise bad(name, value, "nothing for a system whose state is phi0, dphi0")
    needed = {"phi0": phi0, "dphi0": dphi0, "t": t}
    refuse_call(flow, states, [name for name, value in needed.items() if value is None])
    given = {"phi0": ("state_phi", phi0), "dphi0": ("state_dphi", dphi0), "t": ("time", t)}
    if issubclass(system.rung, Conservative):
        for name, value in (("rtol", rtol), ("atol", atol), ("events", events)):
            if value is not None:
                hint = "pk.Perturbed(system) takes them"
                raise bad(name, value, "nothing, because this system's motion is exact", hint)
    else:
        if system.standing.traits is not None:
            refuse_noise(system)
        tolerances = checked_tolerances(rtol, atol)
        (one,) = passes_of(system, select("motion"))
        one = replace(one, function=functools.partial(one.resolved, **tolerances))
        with notice("following damped and driven motions"):
            ds = at_states(system, select("motion"), given, (one,))
        if events is None:
            return ds
        from phasekit.labelled.events import with_events

        moved = Perturbed(system) if system.standing.traits is None else system
        return with_events(ds, moved, events, tolerances)
    return at_states(system, select("motion"), given)


def refuse_noise(system: System) -> None:
    """Refuse a system with noise, which is not integrated."""
    kT = system.parameters["kT"]
    if np.any(np.asarray(kT) > 0.0):
        hint = ".replace(kT=0) has none, pk.flow(..., paths=...) follows paths with it"
        raise bad("kT", kT, "0 for a motion without noise", hint)


def checked_tolerances(rtol: float | None, atol: float | None) -> dict[str, float]:
    """Tolerances of an integration by name, the defaults where nothing is said."""
    from phasekit.motion.flow import ATOL, RTOL

    found = {}
    for name, value, default in (("rtol", rtol, RTOL), ("atol", atol, ATOL)):
        wants = "a number from 1e-14 to 0.1"
        found[name] = default if value is None else number(name, value, wants)
        if not 1e-14 <= found[name] <= 0.1:
            raise bad(name, value, wants)
    return found


@call_checked
@returns("motion")
def separatrix_motion(
    system: Any, t: NumberLike, *, saddle: str | int | None = None, side: str = "right"
) -> xr.Dataset:
    """Motion on the separatrix of a saddle, in elementary functions.

    Parameters
    ----------
    t : float, 1-D array_like or xarray.DataArray
        Times in s: 0 at the turning point of a lobe, where a winding separatrix is opposite to
        the saddle, and half-way to the partner between two saddles of equal energy. A bare array
        makes the dim ``time``.
    saddle : {"lower", "upper"}, or int for a `Potential`, optional
        The saddle; by default the lower one where there are two (that of a figure-eight), else
        the only one (upper).
    side : {"right", "left"}, default "right"
        The side of the saddle to which the motion leaves it.

    Returns
    -------
    xarray.Dataset
        Continuous from the saddle's angle; NaN where the saddle is absent, and on a side to which
        its separatrix runs away.

    Notes
    -----
    The homoclinic orbits of [Veljovic2015], section 4. `separatrices` gives the turning points.

    Examples
    --------
    >>> import phasekit as pk
    >>> ds = pk.separatrix_motion(pk.Coefficients(2.0, 1.0, 0.0), [-40.0, 0.0, 40.0])
    >>> abs(ds.motion_dphi.values.round(9)).tolist()
    [0.0, 0.0, 0.0]
    """
    system = as_system(system)
    one, notes = pass_from(system, "motion", "time", saddle=saddle, side=side)
    ds = at_states(system, select("motion"), {"t": ("time", t)}, (one,))
    return with_notes(ds, **notes)
