"""Cycles of four times the period beside a resonance 1:4 of cycles."""

from __future__ import annotations

from dataclasses import fields

import numpy as np

from phasekit.arrays import Array
from phasekit.cycles import collocation
from phasekit.cycles.cycles import Cycles, Orbit, Solution
from phasekit.cycles.extended import Extended


class FourfoldCycles:
    """Those that leave an orbit, run through four times, along its critical function.

    Both parameters are free; what is held are the parts along that function, whose other harmonics
    leave them alone.
    """

    def __init__(self, tori: Extended, orbit: Orbit) -> None:
        n, m = tori.own, tori.m
        kept = {f.name: getattr(tori, f.name) for f in fields(Cycles)}
        for name in ("turns", "period", "scale"):
            kept[name] = kept[name][:n]
        for name in ("width", "low", "high"):
            kept[name] = kept[name][:2]
        kept |= {"multiple": 4 * tori.multiple, "turns": 4.0 * kept["turns"], "events": ()}
        self.cycles = made = Cycles(**kept)
        mesh = np.concatenate([0.25 * orbit.mesh[1:] + 0.25 * k for k in range(4)])
        mesh = np.append(0.0, mesh)
        parts = [orbit.x[1:] + k * tori.turns for k in range(4)]
        x = np.concatenate([orbit.x[:1], *parts])
        angle = 2.0 * np.pi * collocation.times(mesh, m)
        wave = np.exp(1j * angle)[:, None] * (x[:, n : 2 * n] + 1j * x[:, 2 * n :])
        y = np.array([4.0 * orbit.y[0], *orbit.y[1:3]])
        self.middle = Orbit(mesh, np.ascontiguousarray(x[:, :n]), y)
        nothing = np.zeros(3)
        both = (np.ascontiguousarray(part) for part in (wave.real, wave.imag))
        self.wave = wave / np.sqrt(
            sum(made.inner(mesh, one, one, nothing, nothing) for one in both)
        )
        rows, rows_y, _ = made.rows(self.middle, np.zeros_like(self.middle.x), nothing)
        for k, part in enumerate((self.wave.real, self.wave.imag), 1):
            at = collocation.at_gauss(part / made.scale**2, m)
            rows[k], rows_y[k] = collocation.functional(mesh, at, m), 0.0
        self.rows = rows, rows_y

    def orbit(self, size: float, phase: float) -> Solution:
        """The cycle of an amplitude and a phase, if Newton's method finds it."""
        rows, rows_y = self.rows
        middle = self.middle
        x = middle.x + size * np.real(np.exp(1j * phase) * self.wave)
        target = np.einsum("rkn,kn->r", rows, x) + rows_y @ middle.y
        target[0] = np.sum(rows[0] * middle.x) + rows_y[0] @ middle.y
        guess = Orbit(middle.mesh, x, middle.y.copy())
        return self.cycles.correct(guess, rows, rows_y, target, iterations=20)

    def parameters_at(self, size: float, phase: float) -> Array | None:
        """Where it is, less the parameters of the resonance, in parts of their spans."""
        found = self.orbit(size, phase)
        if not found.converged:
            return None
        return np.asarray((found.orbit.y[1:] - self.middle.y[1:]) / self.cycles.width)
