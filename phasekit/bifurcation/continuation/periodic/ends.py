"""Where a family of periodic orbits ends: at a bound, a Hopf point, a homoclinic orbit, its start."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from phasekit.bifurcation.continuation.curve import Stop
from phasekit.bifurcation.continuation.periodic import collocation
from phasekit.bifurcation.continuation.periodic.cycles import Cycles, Orbit

if TYPE_CHECKING:
    from phasekit.bifurcation.continuation.periodic.trace import Point, State

Array = npt.NDArray[np.float64]

STILL = 1e-10  # how far a parameter moves, in units of its span, while the period grows e-fold
LONG = 3.0  # times the period of the start, from where on it can be that of a homoclinic orbit


def end_of(
    cycles: Cycles, before: State, made: Point, start: Point
) -> tuple[Point | None, Stop] | None:
    """The last point and the reason, if the family ends between two points."""
    if not cycles.forced and _through_hopf(cycles, before.orbit, made.orbit):
        name = cycles.field.parameters[cycles.active[0]]
        return None, Stop(
            "hopf",
            f"the orbits shrink to an equilibrium, a Hopf point near {name} = {made.orbit.y[1]:.9g}",
        )
    if _through_doubling(cycles, before.orbit, made.orbit):
        name = cycles.field.parameters[cycles.active[0]]
        return None, Stop(
            "period_doubling",
            f"both halves of the orbit become the same at a period doubling near {name} = "
            f"{made.orbit.y[1]:.9g}",
        )
    for k, place in enumerate(cycles.active):
        p = made.orbit.y[1 + k]
        if cycles.low[k] < p < cycles.high[k]:
            continue
        upper = p >= cycles.high[k]
        bound = float(cycles.high[k] if upper else cycles.low[k])
        name, side = cycles.field.parameters[place], "upper" if upper else "lower"
        last = at_value(cycles, before, made, k, bound)
        return last, Stop("bound", f"{name} met its {side} bound {bound:.9g}")
    if not cycles.forced and len(cycles.active) == 1 and _homoclinic(cycles, made, start):
        name = cycles.field.parameters[cycles.active[0]]
        return made, Stop(
            "homoclinic",
            f"the period grows beyond {made.orbit.y[0]:.6g} while {name} = {made.orbit.y[1]:.12g} "
            "stands still: an orbit that takes infinite time is near",
        )
    if _closes(cycles, before, made, start):
        return start, Stop("closed", "the family closed on its start")
    return None


def _homoclinic(cycles: Cycles, made: Point, start: Point) -> bool:
    rate = made.dy[0] / made.orbit.y[0]
    still = abs(made.dy[1]) / cycles.width[0] < STILL * abs(rate)
    return bool(rate > 0.0 and still and made.orbit.y[0] > LONG * start.orbit.y[0])


def shape(cycles: Cycles, orbit: Orbit) -> Array:
    """The orbit less its mean and turns, on scaled axes."""
    flat = orbit.x - np.outer(collocation.times(orbit.mesh, cycles.m), cycles.turns)
    return np.asarray((flat - collocation.mean(orbit.mesh, flat, cycles.m)) / cycles.scale)


def _through_hopf(cycles: Cycles, a: Orbit, b: Orbit) -> bool:
    """Whether the orbit turned inside out between two points, which it does through a Hopf point."""
    if np.any(cycles.turns):
        return False
    if a.intervals != b.intervals or not np.array_equal(a.mesh, b.mesh):
        a, _ = cycles.on(b.mesh, a)
    one, two = shape(cycles, a), shape(cycles, b)
    weight = cycles.scale * 0.0 + 1.0
    c = collocation.scheme(cycles.m)
    from phasekit.bifurcation.continuation.periodic import kernels

    return kernels.inner(b.mesh, c.weights, c.value, one, two, weight) < 0.0


def _through_doubling(cycles: Cycles, a: Orbit, b: Orbit) -> bool:
    """Whether both halves of the orbit changed places, as they do where they become the same."""
    if cycles.forced and cycles.multiple % 2:
        return False
    at = np.linspace(0.0, 0.5, 65)[:-1]

    def halves(orbit: Orbit) -> Array:
        one, two = (
            collocation.interpolate(orbit.mesh, orbit.x, cycles.m, at + shift)
            for shift in (0.0, 0.5)
        )
        return np.asarray((two - one - 0.5 * cycles.turns) / cycles.scale)

    one, two = halves(a), halves(b)
    small = np.sum((one - two) ** 2) < 9.0 * max(np.sum(one**2), np.sum(two**2))
    if float(np.sum(one * two)) >= 0.0 or not small:
        return False
    # Orbits with the symmetry x(s + 1/2) = -x(s) keep halves that are far apart.
    size = float(np.mean(cycles.amplitudes(b) / cycles.scale))
    return bool(min(np.sqrt(np.mean(one**2)), np.sqrt(np.mean(two**2))) < 0.2 * size)


def at_value(cycles: Cycles, before: State, made: Point, k: int, value: float) -> Point | None:
    """The point between two others where a free parameter has a value."""
    from phasekit.bifurcation.continuation.periodic.trace import point_of

    a, b = before.orbit, made.orbit
    mesh = b.mesh
    a, (dx,) = cycles.on(mesh, a, before.dx)
    part = (value - a.y[1 + k]) / (b.y[1 + k] - a.y[1 + k])
    guess = Orbit(mesh, a.x + part * (b.x - a.x), a.y + part * (b.y - a.y))
    rows, rows_y, target = cycles.rows(guess, np.zeros_like(dx), np.zeros(cycles.q))
    rows_y[-1, 1 + k], target[-1] = 1.0, value
    found = cycles.correct(guess, rows, rows_y, target, iterations=12)
    if not found.converged:
        return None
    found.orbit.y[1 + k] = value
    side = np.sign(cycles.inner(mesh, dx, found.dx, before.dy, found.dy)) or 1.0
    point = point_of(cycles, found, before.arclength + part * made.step, part * made.step)
    from dataclasses import replace

    # Its determinant has the parameter's row, which goes the way of the tangent that it gave.
    return replace(point, dx=side * found.dx, dy=side * found.dy, sign=side * found.sign)


def _closes(cycles: Cycles, before: State, made: Point, start: Point) -> bool:
    return False
