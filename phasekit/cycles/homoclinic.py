"""Where families of periodic orbits come near a homoclinic orbit, and whether they end there."""

from __future__ import annotations

import numpy as np

from phasekit.arrays import Array
from phasekit.bifurcation.continuation.curve import Stop
from phasekit.bifurcation.special_points import KINDS
from phasekit.cycles import collocation
from phasekit.cycles.cycles import Cycles, Orbit
from phasekit.cycles.point import Point, State

STILL = 1e-10  # how far a parameter moves, in units of its span, while the period grows e-fold
SLOW = 1e-4  # the same, where no step succeeds
GROWS = 0.02  # part of its range by which no state grows beside a homoclinic orbit, a time e-fold
REACH = 1e-3  # length along the family, on scaled axes, over which ranges are compared
STEADY = 1e-6  # range, beside its scale, of a state that rests
FAR = 30.0  # times the period of the start, where the parameter stands still throughout
LONG = 3.0  # times the period of the start, from where on it can be that of a homoclinic orbit
LONGER = tuple(2.0**k for k in range(21))  # times the period, up to which events are awaited


def near(cycles: Cycles, made: Point, start: Point) -> bool:
    """Whether the period grows and the parameter stands still."""
    if cycles.forced or len(cycles.active) > 1:
        return False
    rate = made.dy[0] / made.orbit.y[0]
    if not rate > 0.0:
        return False
    still = abs(made.dy[1]) / cycles.width[0] / rate
    if cycles.vertical(start.dy) and cycles.vertical(made.dy):
        # A conservative family: the parameter always stands still.
        long = made.orbit.y[0] > FAR * start.orbit.y[0]
    else:
        long = still < STILL and made.orbit.y[0] > LONG * start.orbit.y[0]
    if not long:
        return False
    return _rests(cycles, made.orbit, made.dx, rate)


def _rests(cycles: Cycles, orbit: Orbit, dx: Array, rate: float) -> bool:
    """Whether the ranges of the states stand still while the period grows.

    Where cycles explode along canards the parameter stands still as well, but their ranges grow.
    """
    step = REACH / float(np.max(np.abs(dx) / cycles.scale))
    flat = orbit.x - np.outer(collocation.times(orbit.mesh, cycles.m), cycles.turns)
    before, after = (
        np.ptp(collocation.extremes(flat + s * step * dx, cycles.m), axis=0) for s in (-1.0, 1.0)
    )
    sizes = np.maximum(before + after, STEADY * cycles.scale)
    growth = np.abs(after - before) / sizes / (step * rate)
    return bool(np.max(growth[: cycles.own]) < GROWS)


def awaited(cycles: Cycles, orbit: Orbit) -> bool:
    """Whether the family was told to end at a longer period, by a bound or at an event.

    At an event, if it would be passed as the period grows and all else stands still. The family
    can be followed there: by its arclength it is as regular as elsewhere.
    """
    period = float(orbit.y[0])
    if period < cycles.options.bounds.get("period", (0.0, np.inf))[1] < np.inf:
        return True
    for event in cycles.events:
        if not {event.name, event.kind, KINDS[event.kind].label} & set(cycles.ends):
            continue
        longer = (Orbit(orbit.mesh, orbit.x, np.append(k * period, orbit.y[1:])) for k in LONGER)
        if len({event.value(cycles, one) >= 0.0 for one in longer}) > 1:
            return True
    return False


def stop(cycles: Cycles, orbit: Orbit, why: str = "") -> Stop:
    """The end of a family at an orbit."""
    name = cycles.field.parameters[cycles.active[0]]
    return Stop(
        "homoclinic",
        f"the period grows beyond {orbit.y[0]:.6g} while {name} = {orbit.y[1]:.12g} stands still: "
        "an orbit that takes infinite time is near; bounds={'period': (low, high)} among the "
        f"options lead on to a longer period{why}",
    )


def when_stuck(cycles: Cycles, state: State, start: Point, stuck: Stop) -> Stop:
    """Why no step succeeds: a homoclinic orbit, where the period has grown and grows on."""
    orbit, rate = state.orbit, state.dy[0] / state.orbit.y[0]
    if cycles.forced or len(cycles.active) > 1 or not rate > 0.0:
        return stuck
    still = abs(state.dy[1]) / cycles.width[0] / rate
    if still > SLOW or orbit.y[0] < LONG * start.orbit.y[0]:
        return stuck
    if not _rests(cycles, orbit, state.dx, rate):
        return stuck
    return stop(cycles, orbit, f"; {stuck.message}")
