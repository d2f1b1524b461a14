"""First periodic orbits: from samples, from a Hopf point."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from phasekit.bifurcation.continuation.periodic import collocation
from phasekit.bifurcation.continuation.periodic.adapt import LEAST, count_for
from phasekit.bifurcation.continuation.periodic.cycles import Cycles, Orbit, Solution

Array = npt.NDArray[np.float64]

FIRST = 40  # intervals of a first mesh


def settled(cycles: Cycles, guess: Orbit, *, iterations: int = 40) -> Solution:
    """The orbit that a guess leads to at fixed parameters, on a mesh that suits it."""
    for _ in range(8):
        rows, rows_y, target = cycles.rows(guess, np.zeros_like(guess.x), np.zeros(cycles.q))
        rows_y[-1, -1], target[-1] = 1.0, guess.y[-1]
        found = cycles.correct(guess, rows, rows_y, target, iterations=iterations, damped=True)
        if not found.converged:
            return found
        mesh = finer(cycles, found.orbit)
        if mesh is None:
            return found
        guess, _ = cycles.on(mesh, found.orbit)
    return found


def finer(cycles: Cycles, orbit: Orbit) -> Array | None:
    """A mesh that meets the tolerance where that of the orbit does not."""
    if cycles.options.intervals is not None:
        return None
    if cycles.mesh_error(orbit) <= cycles.options.mesh_tolerance:
        return None
    count = max(count_for(cycles, orbit), int(1.1 * orbit.intervals) + 1)
    if count > cycles.options.max_intervals:
        if orbit.intervals >= cycles.options.max_intervals:
            return None
        count = cycles.options.max_intervals
    return collocation.even(orbit.mesh, orbit.x, cycles.m, cycles.amplitudes(orbit), count)


def from_hopf(
    cycles: Cycles,
    x: Array,
    p: float,
    omega: float,
    vector: npt.NDArray[np.complex128],
    size: float,
) -> Solution:
    """A small orbit of a given amplitude, at whatever parameter it has it, near a Hopf point.

    The amplitude is held and the parameter free: at a fixed parameter Newton's method finds the
    equilibrium.
    """
    m = cycles.m
    count = cycles.options.intervals or max(LEAST, 20)
    mesh = np.linspace(0.0, 1.0, count + 1)
    angle = 2.0 * np.pi * collocation.times(mesh, m)
    wave = np.real(np.exp(1j * angle)[:, None] * vector)
    y = np.array([2.0 * np.pi / omega, p])
    dx = wave / np.sqrt(cycles.inner(mesh, wave, wave, 0.0 * y, 0.0 * y))
    middle = Orbit(mesh, np.tile(x, (len(wave), 1)), y)
    for _ in range(6):
        guess = Orbit(mesh, middle.x + size * dx, y.copy())
        rows, rows_y, _ = cycles.rows(guess, dx, 0.0 * y)
        target = np.einsum("rkn,kn->r", rows, guess.x) + rows_y @ guess.y
        found = cycles.correct(guess, rows, rows_y, target, iterations=15)
        if found.converged:
            break
        size *= 0.3
    if not found.converged:
        return found
    outwards = np.sign(cycles.inner(mesh, dx, found.dx, 0.0 * y, found.dy)) or 1.0
    finished = found
    for _ in range(4):
        mesh = finer(cycles, finished.orbit)  # type: ignore[assignment]
        if mesh is None:
            break
        orbit, (row,) = cycles.on(mesh, finished.orbit, dx if finished is found else row)
        rows, rows_y, target = cycles.rows(orbit, row, 0.0 * y)
        finished = cycles.correct(orbit, rows, rows_y, target, iterations=15)
        if not finished.converged:
            return finished
    return Solution(
        finished.orbit, outwards * finished.dx, outwards * finished.dy, finished.steps,
        finished.residual, finished.sign * outwards, finished.divergence, finished.W,
    )  # fmt: skip
