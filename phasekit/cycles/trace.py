"""A family of periodic orbits followed in one direction, until something ends it."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np

from phasekit.arrays import Array
from phasekit.bifurcation.continuation import walk
from phasekit.bifurcation.continuation.curve import Stop
from phasekit.cycles import collocation, ends, moving
from phasekit.cycles.adapt import LOOSE, REACH, count_for, fitted, passages
from phasekit.cycles.cycles import Cycles, Orbit, Solution, where
from phasekit.cycles.point import Point, State, point_of
from phasekit.numerics.interrupts import may_end
from phasekit.numerics.memory import HALTS, why_halted
from phasekit.numerics.waits import stage

REMESH = 3  # points after which the mesh follows the orbit
WORSE = 10.0  # times the mesh error, which a new mesh that does not fit exceeds
SAME = 0.1  # mesh tolerances by which y changes at most where passages do not matter


@dataclass(frozen=True, eq=False)
class Track(walk.Track):
    """Points in one direction from a start, and the state to go on from."""

    points: tuple[Point, ...]
    state: State
    stop: Stop
    rows: ClassVar[tuple[str, ...]] = ("points",)


def begin(cycles: Cycles, start: Point) -> State:
    """The state of a trace that begins at a point, in the direction of its tangent."""
    dx, dy = start.dx, start.dy
    if cycles.slides:
        length = _length(cycles, start.orbit, dx, dy)
        dx, dy = dx / length, dy / length
    return State(start.orbit, dx, dy, cycles.options.initial_step, 0.0, 0)


def follow(cycles: Cycles, state: State, points: int, start: Point) -> Track:
    """Follow a family from a state for at most so many points."""
    found: list[Point] = []
    while len(found) < points:
        try:
            with may_end():
                made, state_or_stop = advance(cycles, state)
                if made is None:
                    assert isinstance(state_or_stop, Stop)
                    return Track(
                        tuple(found), state, ends.when_stuck(cycles, state, start, state_or_stop)
                    )
                assert isinstance(state_or_stop, State)
                end = ends.end_of(cycles, state, made, start)
        except HALTS as halt:
            why = f"{why_halted(halt)} behind {where(cycles, state.orbit)}"
            return Track(tuple(found), state, Stop("interrupted", why))
        if end is not None:
            last, stop = end
            if last is not None:
                found.append(last)
            return Track(tuple(found), state_or_stop, stop)
        found.append(made)
        state = state_or_stop
        stage(f"{len(found):,} points")
    why = f"max_points = {points} were computed, the last at {where(cycles, state.orbit)}"
    return Track(tuple(found), state, Stop("max_points", why))


def advance(cycles: Cycles, state: State) -> tuple[Point | None, State | Stop]:
    """The next point, and the state from which to go on."""
    o = cycles.options
    local = cycles.sized(state.orbit)
    here, unit = _measured(cycles, local, state)
    step = min(here.step, o.max_step)
    reason = "the branch turns ever more, or Newton's method takes ever more iterations"
    while step >= o.min_step:
        made = attempt(local, here, step)
        if isinstance(made, str):
            reason = made
            step *= 0.5
            continue
        solution, cosine = made
        solution, own = _unscaled(cycles, local, solution)
        angle = math.acos(min(cosine, 1.0))
        if angle > o.max_turn:
            reason = f"the branch turns by more than max_turn = {o.max_turn:g}"
            step *= 0.5
            continue
        point = point_of(cycles, solution, state.arclength + step * unit, step * unit)
        grow = min(max(o.turn / max(angle, 1e-3), 0.5), 2.0)
        if solution.steps > 5:
            grow = min(grow, 0.7)
        after = State(
            solution.orbit, solution.dx, solution.dy, min(step * grow, o.max_step) * own,
            state.arclength + step * unit, state.since + 1, state.since_start + 1,
            (state.orbit, state.dx, state.dy),
        )  # fmt: skip
        return point, _meshed(cycles, after)
    there = where(cycles, state.orbit)
    return None, Stop(
        "stuck", f"no step longer than min_step = {o.min_step:g} succeeded at {there}: {reason}"
    )


def _measured(cycles: Cycles, local: Cycles, state: State) -> tuple[State, float]:
    """A state on the scales of its own orbit, and how long a unit of these is on the first ones."""
    if local is cycles and not cycles.slides:
        return state, 1.0
    length = _length(local, state.orbit, state.dx, state.dy)
    s = state
    dx, dy, step = s.dx / length, s.dy / length, s.step * length
    made = State(s.orbit, dx, dy, step, s.arclength, s.since, s.since_start, s.behind)
    return made, 1.0 / length


def _unscaled(cycles: Cycles, local: Cycles, found: Solution) -> tuple[Solution, float]:
    """A solution with a tangent of unit length on the scales of the start, and its length there."""
    if local is cycles and not cycles.slides:
        return found, 1.0
    length = _length(cycles, found.orbit, found.dx, found.dy)
    f = found
    made = Solution(
        f.orbit, f.dx / length, f.dy / length, f.steps, f.residual, f.sign, f.divergence, f.W,
        f.message, f.length,
    )  # fmt: skip
    if cycles.slides:  # Newton's method gives tangents the length 1 at fixed times
        length /= _length(local, f.orbit, f.dx, f.dy)
    return made, length


def _length(cycles: Cycles, orbit: Orbit, dx: Array, dy: Array) -> float:
    """Length of a tangent, in the frame in which orbits are followed."""
    if cycles.slides:
        return moving.length(cycles, orbit, dx, dy)
    return cycles.length(orbit.mesh, dx, dy)


def attempt(cycles: Cycles, state: State, step: float) -> tuple[Solution, float] | str:
    """Newton's method a step ahead, and the cosine of the turn; or why there is no point."""
    orbit, dx, dy, far = state.orbit, state.dx, state.dy, step
    if cycles.slides:
        guess, dx = moving.ahead(cycles, state, step)
        if moving.folds(orbit, guess.mesh):
            return "parts of the orbit move past each other in time"
        orbit, far = guess, 0.0
    else:
        guess = state.ahead(cycles, step)
    if not guess.y[0] > 0.0:
        return "the period vanished"
    for _ in range(4):
        rows, rows_y, target = cycles.rows(orbit, dx, dy)
        target[-1] += far
        found = cycles.correct(guess, rows, rows_y, target)
        if not found.converged:
            return found.message
        if cycles.options.intervals is not None:
            return found, _cosine(cycles, found, dx, dy)
        error = cycles.mesh_error(found.orbit)
        if error <= cycles.options.mesh_tolerance:
            return _through(cycles, dy, far, (orbit, dx), found)
        count = max(count_for(cycles, found.orbit), int(1.1 * found.orbit.intervals) + 1)
        if count > cycles.options.max_intervals:
            return (
                f"the mesh error {error:.2g} asks for {count} intervals, more than max_intervals = "
                f"{cycles.options.max_intervals}"
            )
        mesh = collocation.even(
            found.orbit.mesh,
            found.orbit.x,
            cycles.m,
            cycles.amplitudes(found.orbit),
            count,
            cycles.closure,
        )
        orbit, (dx,) = cycles.on(mesh, orbit, dx)
        guess, _ = cycles.on(mesh, found.orbit)
    return f"no mesh brings the mesh error {error:.2g} under its tolerance"


def _through(
    cycles: Cycles, dy: Array, step: float, last: tuple[Orbit, Array], found: Solution
) -> tuple[Solution, float] | str:
    """What Newton's method found, on a mesh that resolves passages where these change it."""
    for most in (2, None):
        mesh = passages(cycles, found.orbit, LOOSE, REACH, most)
        if mesh is None:
            break
        orbit, (dx,) = cycles.on(mesh, *last)
        rows, rows_y, target = cycles.rows(orbit, dx, dy)
        target[-1] += step
        finer = cycles.correct(cycles.on(mesh, found.orbit)[0], rows, rows_y, target)
        if not finer.converged:
            return finer.message
        moved = np.abs(finer.orbit.y - found.orbit.y) / np.append(found.orbit.y[0], cycles.width)
        if most is not None and np.max(moved) <= SAME * cycles.options.mesh_tolerance:
            break
        if len(mesh) - 1 > cycles.options.max_intervals:
            return (
                f"a state that passes far below its amplitude asks for {len(mesh) - 1} intervals, "
                f"more than max_intervals = {cycles.options.max_intervals}"
            )
        found, last = finer, (orbit, dx)
    return found, _cosine(cycles, found, last[1], dy)


def _cosine(cycles: Cycles, found: Solution, dx: Array, dy: Array) -> float:
    """That of the turn from the last tangent."""
    if cycles.slides:
        return moving.cosine(cycles, found, dx, dy)
    # The tangent's part along the last one is its whole length but for the turn.
    return 1.0 / found.length


def _meshed(cycles: Cycles, state: State) -> State:
    """The state with a mesh that follows the orbit, every few points."""
    if state.since < REMESH:
        return _moved(cycles, state, state.orbit.mesh)
    moved = _moved(cycles, state, fitted(cycles, state.orbit))
    before = max(cycles.mesh_error(state.orbit), cycles.options.mesh_tolerance)
    if not cycles.mesh_error(moved.orbit) <= WORSE * before:
        return replace(_moved(cycles, state, state.orbit.mesh), since=0)
    dx, dy = moved.dx, moved.dy
    length = _length(cycles, moved.orbit, dx, dy)
    return replace(moved, dx=dx / length, dy=dy / length, since=0)


def _moved(cycles: Cycles, state: State, mesh: Array) -> State:
    """The state on a mesh, with the point behind it."""
    orbit, dx, behind = state.orbit, state.dx, state.behind
    if orbit.mesh is mesh and (cycles.slides or behind is None or behind[0].mesh is mesh):
        return state
    if orbit.mesh is not mesh:
        orbit, (dx,) = cycles.on(mesh, orbit, dx)
    if behind is not None and behind[0].mesh is not mesh and not cycles.slides:
        last, (ex,) = cycles.on(mesh, *behind[:2])
        behind = last, ex, behind[2]
    return replace(state, orbit=orbit, dx=dx, behind=behind)
