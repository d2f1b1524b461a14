"""Escape out of wells by thermal noise, at any damping.

Transition-state theory with the exact integral over the well in place of its harmonic value, times
Kramers' factor for recrossing at the saddle, times the factor of Mel'nikov and Meshkov for what is
short of energy at low damping; how both are corrected is said in `rates`.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from phasekit.arrays import Array
from phasekit.errors import EscapeRegime, Loop
from phasekit.laws.perturbed import PerturbedLaw
from phasekit.perturbation.depopulation import depopulation
from phasekit.perturbation.diffusion import (
    TURN,
    configuration,
    marks_of,
    passage,
    spatial_exponent,
    transition,
)
from phasekit.perturbation.rates import (
    Escape,
    Exit,
    Heat,
    combined,
    empty,
    masked,
    returning,
    scatter,
)
from phasekit.perturbation.wells import escape_from_wells
from phasekit.phase.exact.orbits import energy_rises, orbits_at_energy
from phasekit.phase.exact.phase_space import phase_space
from phasekit.phase.exact.potential import potential
from phasekit.phase.exact.under_torque import saddle_at
from phasekit.phase.numerical import torqued
from phasekit.phase.numerical.formula import Formula
from phasekit.phase.numerical.unpushed import merged

#: Cells at a time, for memory.
CELLS = 1024


@dataclass(frozen=True)
class Cells(Heat):
    """Wells of (A, B, C) in a row."""

    A: Array
    B: Array
    C: Array


def escape_rate(law: PerturbedLaw, *parameters: npt.ArrayLike, center: int | None = None) -> Escape:
    """Rates of escape from the well of a center: its number (0 lower, 1 upper), or the lowest."""
    values = law.values(*parameters)
    shape = np.broadcast_shapes(*map(np.shape, values.values()))
    flat = {n: np.array(np.broadcast_to(x, shape), float).reshape(-1) for n, x in values.items()}
    damping, kT = flat["damping"], flat["kT"]
    # Without noise or friction nothing is thermal.
    usable = (damping > 0.0) & (kT > 0.0) & (driven(values, shape) == 0.0)
    heat = Heat(damping, np.where(usable, kT, np.nan))
    found: list[tuple[Any, Escape]] = []
    if not isinstance(law.base, Formula):
        level = np.flatnonzero(flat["torque"] == 0.0)
        own = law.coefficients({name: x[level] for name, x in flat.items()})
        few = Cells(*vars(heat.take(level)).values(), *map(np.asarray, own))
        found.append((level, level_escape(few, center or 0)))
    lines = torqued.grounds(law, [flat[name] for name in law.names], CELLS, lined=True)
    for turns, part in lines:
        found.append((part, escape_from_wells(turns, heat.take(part), center)))
    fields = merged(found, damping.size)
    return Escape._make(x.reshape(shape + x.shape[1:]) for x in fields)


def driven(values: dict[str, Any], shape: tuple[int, ...]) -> Array:
    """What else moves the particle, for which the rates do not hold."""
    drive = [abs(x) for n, x in values.items() if n.endswith("_amplitude") or n == "quadratic"]
    drive += [abs(x) for n, x in values.items() if n.startswith("drift_")]
    return np.array(np.broadcast_to(sum(drive), shape), float).reshape(-1)


def level_escape(cells: Cells, number: int) -> Escape:
    """Escape without a torque, by actions in closed form."""
    A, B, C, kT, damping = cells.A, cells.B, cells.C, cells.kT, cells.damping
    points, loops = phase_space(A, B, C)
    rises = energy_rises(A, B, C)
    lower, upper = loops.saddle_phi[:, 0], loops.saddle_phi[:, 1]
    row = np.arange(len(A))
    arcs = loops.loop[:, 0] == Loop.HETEROCLINIC
    k = loops.saddle_exponent
    saddles = saddle_at(A[:, None], loops.saddle_phi, k, np.zeros((len(A), 1))).spread()
    left, right = (marks_of(points.phi, loops.saddle_phi, w)[..., 0] for w in (-1.0, 1.0))
    spatial = spatial_exponent(saddles.depth, left, right, np.stack([kT, kT], -1))

    def lobe(i: int) -> tuple[Any, Array, Array, Array]:
        """Side of the lower saddle, rate, loss and its correction of a well that ends there."""
        own = points.phi[:, 2 * i]
        right = np.mod(own - lower, TURN) < np.mod(upper - lower, TURN)
        start = np.where(right, lower, upper)
        end = start + np.mod(np.where(right, upper, lower) - start, TURN)
        rate = _rate(cells, rises[:, i], start + np.mod(own - start, TURN), start, end)
        loss = damping * loops.lobe_area[row, 0, right.astype(int)] / kT
        return right.astype(int), rate, loss, _correction(cells, rises[:, i], rate * loss, i)

    # Over the lower saddle into the other lobe, out of which it may come back at once.
    side, rate, loss, ratio = lobe(number)
    _, _, beyond, back = lobe(1 - number)
    # An arc to a saddle as high has half the area, and nothing comes back from it.
    once, beyond = np.where(arcs, 0.5 * loss, loss), np.where(arcs, np.inf, beyond)
    height = np.where(np.isnan(lower), np.nan, rises[:, number])
    way = Exit(
        lambda scale, power: returning(scale * once * ratio**power, scale * beyond * back**power),
        np.isfinite(ratio * back), height, loss,
        loops.saddle_exponent[:, 0], spatial[:, 0],
    )  # fmt: skip
    out = empty(len(A), 2)
    scatter(out, combined(cells, rate, way), row, 0, side)
    mirror = arcs & np.isfinite(out.escape_rate[row, 0, side])
    # Over the winding saddle: out of one well, or out of both together.
    height = rises[:, 3]  # from the lower center, in which a cold particle is
    base = upper + np.mod(points.phi[:, 0] - upper, TURN)
    whole = _rate(cells, height, base, upper, upper + TURN)
    winding = damping * loops.winding_area[:, 1] / kT
    single = np.isnan(lower)
    turn = np.where(single, _correction(cells, height, 2.0 * winding * whole, 0), np.nan)
    way = Exit(
        lambda scale, power: depopulation(scale * winding * turn**power),
        single & np.isfinite(turn), height, 2.0 * winding,
        loops.saddle_exponent[:, 1], spatial[:, 1],
    )  # fmt: skip
    found = combined(cells, whole, way)
    for which in (0, 1):
        scatter(out, found, row, 1, which)
    for field in out:  # two saddles of one energy, one at each end
        field[mirror, 1] = np.nan if field.dtype.kind == "f" else EscapeRegime.ABSENT
        field[row[mirror], 1, 1 - side[mirror]] = field[row[mirror], 0, side[mirror]]
    return masked(out, np.isnan(points.phi[:, 2 * number]), points.n_equilibria < 0)


def _rate(cells: Cells, height: Array, at: Array, start: Array, end: Array) -> Array:
    """Rate of transition-state theory out of a well, times exp(height/kT)."""
    a, b, c = (x[:, None] for x in (cells.A, cells.B, cells.C))
    top = potential(cells.A, cells.B, cells.C, at) + height

    def depth(phi: Array) -> Array:
        return np.asarray(top[:, None] - potential(a, b, c, phi))

    return transition(
        cells.kT, configuration(depth, height, at, start, end, cells.kT)
    )  # fmt: skip


def _correction(cells: Cells, height: Array, high: Array, center: int) -> Array:
    """Rate at which the diffusing energy comes to the saddle, over that of a high barrier."""
    center_phi = phase_space(cells.A, cells.B, cells.C)[0].phi[:, 2 * center]
    bottom = potential(cells.A, cells.B, cells.C, center_phi)

    def action(part: Any, x: Array) -> Array:
        level = bottom[part, None] + height[part, None] * x
        a, b, c = (v[part, None] for v in (cells.A, cells.B, cells.C))
        return TURN * orbits_at_energy(a, b, c, level, center).action

    with np.errstate(all="ignore"):
        return np.asarray(1.0 / (passage(action, height, cells.damping, cells.kT) * high))
