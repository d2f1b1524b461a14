"""First periodic orbits: from samples, from a Hopf point."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import numpy.typing as npt

from phasekit.arrays import Array
from phasekit.cycles import collocation, wide
from phasekit.cycles.adapt import LEAST, LOOSE, SPARE, count_for, fitted, passages
from phasekit.cycles.cycles import Cycles, Orbit, Solution
from phasekit.cycles.extended import DOUBLING, FOLD, Extended
from phasekit.cycles.linear import Linear, wave
from phasekit.cycles.point import Point

FIRST = 40  # intervals of a first mesh
CLOSER = 3  # Newton steps from one mesh to a finer one
SETTLED = 1e-7  # the last of them, on scaled axes
SMALL = 0.1  # part of the first step that is the amplitude of orbits near a Hopf point


def settled(
    cycles: Cycles, guess: Orbit, *, held: int | Array | None = None, iterations: int = 40
) -> Solution:
    """The orbit that a guess leads to at fixed parameters, on a mesh that suits it.

    Of several parameters only one is held, by its place in y, or a sum, by its factors; the last
    by default.
    """
    held = len(cycles.active) if held is None else held
    factors = held if isinstance(held, np.ndarray) else np.eye(cycles.q)[held]
    for _ in range(8):
        rows, rows_y, target = cycles.rows(guess, np.zeros_like(guess.x), np.zeros(cycles.q))
        rows_y[-1], target[-1] = factors, factors @ guess.y
        found = cycles.correct(guess, rows, rows_y, target, iterations=iterations, damped=True)
        if not found.converged:
            return found
        mesh = finer(cycles, found.orbit)
        if mesh is None:
            mesh = fitted(cycles, found.orbit)
            if len(mesh) >= len(found.orbit.mesh):
                return found
        guess, _ = cycles.on(mesh, found.orbit)
    return found


def kept(cycles: Cycles, guess: Orbit, through: Array | None = None) -> Solution:
    """The orbit of a conservative family near a guess, the parameter free, which stays.

    It keeps its part along the shape of the guess or, where a state is given that it goes
    ``through``, that state as far as two equations can hold it.
    """
    nothing = np.zeros(cycles.q)
    for _ in range(8):
        flat = guess.x - np.outer(collocation.times(guess.mesh, cycles.m), cycles.turns)
        shape = flat - collocation.mean(guess.mesh, flat, cycles.m)
        rows, rows_y, target = cycles.rows(guess, shape, nothing)
        if through is not None:
            places = np.tile(through, (len(guess.x), 1))
            jets = cycles.jets(guess.mesh, places, guess.y, cycles.m, cycles.sizes)
            slope = jets[0, : cycles.n] / cycles.scale**2
            across = np.array([-slope[1], slope[0]]) if cycles.n == 2 else shape[0]
            rows[:] = 0.0
            rows[0, 0], rows[-1, 0] = slope, across
            target = rows[:, 0] @ through
        found = cycles.correct(guess, rows, rows_y, target, iterations=40, damped=True)
        mesh = finer(cycles, found.orbit) if found.converged else None
        if mesh is None:
            break
        guess, _ = cycles.on(mesh, found.orbit)
    return found


def finer(cycles: Cycles, orbit: Orbit) -> Array | None:
    """A mesh that meets the tolerance, or has the number asked for, where the orbit's does not."""
    fixed = cycles.options.intervals
    if fixed is not None:
        return None if orbit.intervals == fixed else fitted(cycles, orbit)
    wanted = count_for(cycles, orbit)
    rests = cycles.forced and wanted > 2 * orbit.intervals
    if cycles.mesh_error(orbit) <= cycles.options.mesh_tolerance and not rests:
        return None if cycles.closes else passages(cycles, orbit, LOOSE)
    count = max(wanted, int(1.1 * orbit.intervals) + 1)
    if count > cycles.options.max_intervals:
        if orbit.intervals >= cycles.options.max_intervals:
            return None
        count = cycles.options.max_intervals
    return collocation.even(
        orbit.mesh, orbit.x, cycles.m, cycles.amplitudes(orbit), count, cycles.closure
    )


def from_hopf(
    cycles: Cycles, x: Array, p: float, omega: float, vector: npt.NDArray[np.complex128],
    bend: tuple[float, float] = (0.0, 0.0),
) -> Solution:  # fmt: skip
    """A small orbit near a Hopf point, in the plane of its critical eigenvector.

    ``bend`` is by what p and omega change with the square of half the amplitude along it. With
    several pairs Newton's method needs it: at the point itself the equations are singular.
    """
    m = cycles.m
    mesh = np.linspace(0.0, 1.0, (cycles.options.intervals or 2 * LEAST) + 1)
    angle = 2.0 * np.pi * collocation.times(mesh, m)
    wave = np.real(np.exp(1j * angle)[:, None] * vector)
    middle = Orbit(mesh, np.tile(x, (len(wave), 1)), np.array([2.0 * np.pi / omega, p]))
    s, sigma = bend
    dy = 0.25 * np.array([-2.0 * np.pi / omega**2 * sigma, s])
    return off(cycles, middle, wave, SMALL * cycles.options.initial_step, dy)


def off(
    cycles: Cycles, middle: Orbit, direction: Array, size: float, bend: Array | None = None
) -> Solution:
    """An orbit at a distance from another one, in a direction in which the states leave it.

    The distance is held and the parameter free: at a fixed parameter Newton's method finds the
    family that is left. With the square of the part of the direction y changes by ``bend``.
    """
    nothing = np.zeros(cycles.q)
    length = np.sqrt(cycles.inner(middle.mesh, direction, direction, nothing, nothing))
    dx = direction / length
    bend = nothing if bend is None else bend / length**2
    found = _held(cycles, middle, dx, size, bend)
    for _ in range(8):
        if found.converged:
            break
        size *= 0.3
        found = _held(cycles, middle, dx, size, bend)
    for _ in range(6):
        mesh = finer(cycles, found.orbit) if found.converged else None
        if mesh is None:
            break
        middle, (dx, x) = cycles.on(mesh, middle, dx, found.orbit.x)
        found = _held(cycles, middle, dx, size, bend, Orbit(mesh, x, found.orbit.y))
    side = (
        np.sign(cycles.inner(middle.mesh, dx, found.dx, nothing, nothing))
        if found.converged
        else 1.0
    )
    if side < 0.0:
        found = replace(found, dx=-found.dx, dy=-found.dy, sign=-found.sign)
    return found


def _held(
    cycles: Cycles, middle: Orbit, dx: Array, size: float, bend: Array, guess: Orbit | None = None
) -> Solution:
    """The orbit whose part along a direction is given, near a guess."""
    nothing = np.zeros(cycles.q)
    away = Orbit(middle.mesh, middle.x + size * dx, middle.y + size**2 * bend)
    # The phase is that of the guess: the orbit that is left may have none.
    rows, rows_y, target = cycles.rows(away if guess is None else guess, dx, nothing)
    target[-1] = np.sum(rows[-1] * away.x)
    return cycles.correct(away if guess is None else guess, rows, rows_y, target, iterations=15)


def with_function(made: Extended, cycles: Cycles, point: Point, value: float) -> Orbit:
    """A special orbit with its critical function beside it, for a curve in two parameters."""
    orbit = point.orbit
    looked = cycles.looked_at(orbit, point.dx, point.dy)
    W = looked.W
    y = np.append(orbit.y, value)
    if made.kind == DOUBLING:
        v = null_vector(cycles, orbit, W, -1.0)
    elif made.kind == FOLD:
        v = point.dx
        if made.q == 4:
            y = np.append(y, point.dy[0] / orbit.y[0])
    else:
        mu = cycles.multipliers(W, orbit, cycles.divergence(looked.divergence))[0]
        mu = mu[mu.imag > 0.0]
        angle = float(np.angle(mu[np.argmin(np.abs(np.abs(mu) - 1.0))]))
        omega = angle / orbit.y[0]
        v = wave(Linear(cycles, orbit), omega)
        # As large as the states, in whatever units those are.
        n, nothing = cycles.n, np.zeros(cycles.q)
        parts = (np.ascontiguousarray(part) for part in (v[:, :n], v[:, n:]))
        square = sum(cycles.inner(orbit.mesh, one, one, nothing, nothing) for one in parts)
        v = v / np.sqrt(square)
        y = np.append(y, omega)
    return Orbit(orbit.mesh, np.hstack([orbit.x, v]), y)


def doubled(cycles: Cycles, orbit: Orbit, W: Array) -> tuple[Cycles, Orbit, Array]:
    """The orbit run through twice, and the direction in which doubled orbits leave it."""
    v = null_vector(cycles, orbit, W, -1.0)
    mesh = np.concatenate([0.5 * orbit.mesh, 0.5 + 0.5 * orbit.mesh[1:]])
    x = np.concatenate([orbit.x, orbit.x[1:] + cycles.turns])
    y = orbit.y.copy()
    y[0] *= 2.0
    made = cycles.replace(multiple=2 * cycles.multiple, turns=2.0 * cycles.turns)
    return made, Orbit(mesh, x, y), np.concatenate([v, -v[1:]])


def null_vector(cycles: Cycles, orbit: Orbit, W: Array, sigma: float) -> Array:
    """The solution of the variational equations that closes with sigma, of length 1."""
    return _null_vector(cycles, orbit, W, sigma, None)[0]


def resolved(cycles: Cycles, mesh: Array, direction: Array) -> Array | None:
    """The parts of a mesh that resolve a direction of another family, too; None if it does."""
    orbit = Orbit(mesh, direction, np.ones(cycles.q))
    error = cycles.mesh_error(orbit)
    if error <= cycles.options.mesh_tolerance or cycles.options.intervals is not None:
        return None
    parts = math.ceil((error / (SPARE * cycles.options.mesh_tolerance)) ** (1.0 / (cycles.m + 1)))
    count = (len(mesh) - 1) * parts
    if count > cycles.options.max_intervals:
        return None
    return np.asarray(np.interp(np.arange(count + 1) / parts, np.arange(len(mesh)), mesh))


def singularity(cycles: Cycles, point: Point) -> float:
    """A smooth number of a point whose zeros are where its equations are singular.

    That is the factor of the column by which they are bordered ([Govaerts2000] chapter 3), with the
    sign of their determinant.
    """
    W = cycles.looked_at(point.orbit, point.dx, point.dy).W
    factor = _null_vector(cycles, point.orbit, W, 1.0, (point.dx, point.dy))[2]
    return math.copysign(factor, point.sign)


def other_tangent(
    cycles: Cycles, orbit: Orbit, W: Array, tangent: tuple[Array, Array]
) -> tuple[Array, Array]:
    """Where two families cross, the solution of their equations orthogonal to a tangent of one."""
    return _null_vector(cycles, orbit, W, 1.0, tangent)[:2]


def crossing(cycles: Cycles, orbit: Orbit, own: tuple[Array, Array]) -> Solution | None:
    """An orbit at which two families cross, on its mesh, with a tangent of one of them.

    The equations are singular along the other one: that part stays, and an arbitrary column takes
    up what is left of them then.
    """
    n, q, more = cycles.n, cycles.q, cycles.bordering
    found = cycles.looked_at(orbit, *own)
    ex, ey = other_tangent(cycles, orbit, found.W, own)
    size = orbit.intervals, cycles.m * n
    column = np.random.default_rng(7).standard_normal(size) / orbit.intervals
    rows, rows_y = np.zeros((more + 1, *orbit.x.shape)), np.zeros((more + 1, q + 1))
    target = np.zeros(more + 1)
    rows[:more], rows_y[:more, :q], target[:more] = cycles.rows(orbit, *own)
    others, others_y, at = cycles.rows(orbit, ex, ey)
    rows[-1], rows_y[-1, :q], target[-1] = others[-1], others_y[-1], at[-1]
    dx, dy = np.empty((2, *orbit.x.shape)), np.empty((2, q + 1))
    for _ in range(CLOSER):
        x, y = orbit.x, orbit.y
        V = wide.bordered(found.W, n, q, column, still=False)
        border = rows_y.copy()
        right = target - np.einsum("rkn,kn->r", rows, x) - rows_y[:, :q] @ y
        if cycles.forced:
            period, slope = cycles.own_period(y)
            border[0, 0], border[0, 1:q], right[0] = 1.0, -slope, period - y[0]
        gap = cycles.closure * x[0] + cycles.turns - x[-1]
        if wide.solve(V, rows, border, right, gap, cycles.closure, cycles.m, dx, dy) == 0.0:
            return None
        orbit = Orbit(orbit.mesh, x + dx[0], y + dy[0, :q])
        found = cycles.looked_at(orbit, *own)
    return found if np.max(np.abs(dx[0]) / cycles.scale) < SETTLED else None


def _null_vector(
    cycles: Cycles, orbit: Orbit, W: Array, sigma: float, tangent: tuple[Array, Array] | None
) -> tuple[Array, Array, float]:
    """A solution of singular equations with states of length 1; with a tangent, of its equations.

    They are bordered by an arbitrary column and row; the column's factor, the last of what is
    returned, vanishes.
    """
    count, size, n = orbit.intervals, cycles.m * cycles.n, cycles.n
    q = 0 if tangent is None else cycles.q
    more = 0 if tangent is None else cycles.bordering
    random = np.random.default_rng(7)
    V = wide.bordered(W, n, q, random.standard_normal((count, size)) / count, still=True)
    rows = np.zeros((more + 1, *orbit.x.shape))
    rows_y = np.zeros((more + 1, q + 1))
    if tangent is not None:
        rows[:more], rows_y[:more, :q], _ = cycles.rows(orbit, *tangent)
        if cycles.forced:
            rows_y[0, 0], rows_y[0, 1:q] = 1.0, -cycles.own_period(orbit.y)[1]
    row = random.standard_normal(orbit.x.shape)
    nothing = np.zeros(cycles.q)
    dx, dy = np.empty((2, *orbit.x.shape)), np.empty((2, q + 1))
    v = row
    for _ in range(3):
        c = collocation.scheme(cycles.m)
        rows[-1] = (
            collocation.functional(orbit.mesh, collocation.at_gauss(v, c.m) / cycles.scale**2, c.m)
            if v is not row
            else row / len(row)
        )
        wide.solve(
            V, rows, rows_y, np.zeros(more + 1), np.zeros(n), np.full(n, sigma), cycles.m, dx, dy
        )
        length = np.sqrt(cycles.inner(orbit.mesh, dx[1], dx[1], nothing, nothing))
        v = dx[1] / length
    return np.asarray(v), dy[1, :q] / length, float(dy[1, q] / length)
