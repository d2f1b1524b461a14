"""Resonances of the motions with a drive: where they lie, how wide they are, whether they overlap.

Next to ``n Omega(J) = m nu`` the drive moves the action by ``V sin psi``, slowly: a pendulum of
half-width ``2 sqrt(V/|dOmega/dJ|)``. V is a Fourier coefficient of ``f(phi) dphi/dtheta`` over the
angle variable, divided by n.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from phasekit.arrays import Array
from phasekit.laws.perturbed import PerturbedLaw, modulation_names
from phasekit.numerics.contract import contract
from phasekit.perturbation.ladders import ClosedLadder, Ladder, NumericalLadder
from phasekit.perturbation.melnikov import refuse_prescribed
from phasekit.perturbation.quadrature import derivative
from phasekit.phase.numerical import torqued
from phasekit.phase.numerical.formula import Formula

Values = dict[str, Array]

SECANTS = 56
SAMPLES = 512
#: Step of the logarithm of the gap, for the twist.
STEP = 2e-3
#: Gaps over the height below which motions from states have lost the orbit.
LEAST = 1e-12
ROUNDING = 1e-14
#: Cells at a time, for memory.
CELLS = 64


class Resonances(NamedTuple):
    """Resonances; the last axis is the order."""

    resonance_action: Array
    resonance_width: Array
    resonance_overlap: Array


def resonances(
    law: PerturbedLaw, *parameters: npt.ArrayLike,
    orders: tuple[int, ...] = (1,), m: int = 1, family: int = 0,
) -> Resonances:  # fmt: skip
    """Resonances ``n Omega = m nu`` of a family, nu the frequency of the first harmonic.

    The family is a code; 0 is the well of the lowest center.
    """
    refuse_prescribed(law, "resonances")
    values = law.values(*parameters)
    shape = np.broadcast_shapes(*map(np.shape, values.values()))
    flat = {n: np.array(np.broadcast_to(x, shape), float).reshape(-1) for n, x in values.items()}
    wanted = sorted({*orders, *(n + 1 for n in orders)})
    found = np.full((2, len(wanted), flat["torque"].size), np.nan)
    for part, ladder in _ladders(law, flat, family):
        some = {name: x[part] for name, x in flat.items()}
        drive = [*law.forcing(some)]
        drive += [law.harmonic(some, modulation_names(p)) for p in law.modulated]
        if drive:
            found[:, :, part] = _resonant(law, some, ladder, drive, wanted, m)
    at, after = (np.searchsorted(wanted, np.array(orders) + k) for k in (0, 1))
    actions, widths = (np.moveaxis(x[at], 0, -1) for x in found)
    next_action, next_width = (np.moveaxis(x[after], 0, -1) for x in found)
    with np.errstate(all="ignore"):
        overlap = (widths + next_width) / np.abs(next_action - actions)
    size = (*shape, len(orders))
    return Resonances(*(x.reshape(size) for x in (actions, widths, overlap)))


def _ladders(law: PerturbedLaw, values: Values, family: int) -> list[tuple[Any, Ladder]]:
    """The orbits of a family, some cells at a time: in closed form where a law has one."""
    found: list[tuple[Any, Ladder]] = []
    if not isinstance(law.base, Formula):
        level = np.flatnonzero(values["torque"] == 0.0)
        own = law.coefficients({name: x[level] for name, x in values.items()})
        A, B, C = map(np.asarray, own)
        if level.size:
            found.append((level, ClosedLadder.from_coefficients(A, B, C, family or 1)))
        family = torqued.code_of_numbers(family)
    for ground, part in torqued.grounds(law, [values[name] for name in law.names], CELLS):
        if ground.points.phi.shape[1]:
            found.append((part, NumericalLadder.from_ground(ground, np.full(len(part), family))))
    return found


def _resonant(
    law: PerturbedLaw, values: Values, ladder: Ladder, drive: Sequence[Any],
    orders: Sequence[int], m: int,
) -> Array:  # fmt: skip
    """Actions and half-widths of resonances by order; of several, of the one of least action."""
    nu = drive[0][1]
    frequency = np.concatenate([m * nu / n for n in orders])
    cell = np.tile(np.arange(len(nu)), len(orders))
    scanned = ladder.levels(ladder.rungs)[1].frequency[cell]
    above, known = scanned > frequency[:, None], np.isfinite(scanned)
    changes = (above[:, 1:] != above[:, :-1]) & known[:, 1:] & known[:, :-1]
    found = np.full((2, len(cell)), np.nan)
    row = np.flatnonzero(changes.any(axis=1))
    if row.size:
        few = ladder.take(cell[row])
        first, own = changes[row].argmax(axis=1), np.arange(row.size)
        ends = few.rungs[own, first], few.rungs[own, first + 1]
        at = _met(few, ends, frequency[row])
        some = {name: x[cell[row]] for name, x in values.items()}
        waves = [tuple(x[cell[row]] for x in wave) for wave in drive]
        number = np.repeat(orders, len(nu))[row]
        found[:, row] = _widths(law, some, few, waves, at, frequency[row], number, m)
    return found.reshape(2, len(orders), len(nu))


def _met(ladder: Ladder, ends: tuple[Array, Array], frequency: Array) -> Array:
    """Where frequencies are met between two rungs, by secants: the Illinois method.

    One that keeps its other end twice counts half of what is off there, so that both come near.
    """
    low, high = ends
    off_low, off_high = (ladder.levels(np.stack(ends, axis=1))[1].frequency - frequency[:, None]).T
    start, least = off_low > 0.0, 2.0 * np.finfo(float).eps * (1.0 + np.abs(low))
    at, kept = low, np.zeros(len(low))
    for k in range(SECANTS):
        with np.errstate(all="ignore"):
            there = high - off_high * ((high - low) / (off_high - off_low))
        between = np.abs(there - low) + np.abs(high - there) <= np.abs(high - low) + least
        there = np.where(between, there, 0.5 * (low + high))
        settled = (np.abs(there - at) <= least) & (k > 0) | (np.abs(high - low) <= least)
        at = there
        if settled.all():
            break
        off = ladder.levels(at[:, None])[1].frequency[:, 0] - frequency
        same = (off > 0.0) == start
        off_high = np.where(same, np.where(kept == 1.0, 0.5, 1.0) * off_high, off)
        off_low = np.where(same, off, np.where(kept == -1.0, 0.5, 1.0) * off_low)
        low, high = np.where(same, at, low), np.where(same, high, at)
        kept = np.where(same, 1.0, -1.0)
    return at


def _widths(
    law: PerturbedLaw, values: Values, ladder: Ladder, drive: Sequence[Any], at: Array,
    frequency: Array, n: Any, m: int,
) -> tuple[Array, Array]:  # fmt: skip
    """Actions and half-widths of resonances of known rungs."""
    steps = at[:, None] + STEP * np.array([-2.0, -1.0, 0.0, 1.0, 2.0])
    gap, orbit = ladder.levels(steps)
    # dOmega/du over dh/du = gap, times Omega = dh/dJ
    slope = contract(orbit.frequency, np.array([1.0, -8.0, 0.0, 8.0, -1.0]) / (12.0 * STEP))
    twist = slope / gap[:, 2] * frequency
    one = type(orbit)._make(x[:, 2] for x in orbit)
    force = _coefficient(law, values, ladder, gap[:, 2], one, drive, m)
    with np.errstate(all="ignore"):
        width = 2.0 * np.sqrt(force / (n * np.abs(twist)))
    lost = ladder.separates & (np.abs(gap[:, 2]) < LEAST * ladder.height)
    return one.action, np.where(lost, np.nan, width)


def _coefficient(
    law: PerturbedLaw, values: Values, ladder: Ladder, gap: Array, orbit: Any,
    drive: Sequence[Any], m: int,
) -> Array:  # fmt: skip
    """Fourier coefficient of the torques at m nu, along the orbit, over its angle variable."""
    part = (np.arange(SAMPLES) + 0.5) / SAMPLES - 0.5
    t = orbit.period[:, None] * part
    path, speed = ladder.motion(gap, orbit, t)
    nu = drive[0][1]
    total = np.zeros(len(gap), complex)
    at = np.exp(1j * m * nu[:, None] * t) * speed
    push = _push_of_formula if isinstance(law.base, Formula) else _push
    for i, (amplitude, frequency, phase) in enumerate(drive):
        torque = 1.0 if i < law.harmonics else push(law, values, path, frequency, i)
        one = (torque * at).mean(axis=1)
        # What symmetry cancels is 0, and not rounding, whose root would be a width.
        one = np.where(np.abs(one) <= ROUNDING * np.abs(torque * at).mean(axis=1), 0.0, one)
        one = one * orbit.period / (2.0 * np.pi)
        meets = np.abs(frequency - m * nu) <= 1e-12 * m * nu
        total = total + np.where(meets, amplitude * np.exp(1j * phase) * one, 0.0)
    return np.asarray(np.abs(total))


def _push(law: PerturbedLaw, values: Values, phi: Array, nu: Array, number: int) -> Any:
    """Torque of a modulation per unit of its amplitude, along motions."""
    parameter = law.modulated[number - law.harmonics]
    dA, dB, dC = (np.asarray(x)[:, None] for x in law.derivatives(values, parameter))
    sine, cosine = np.sin(phi), np.cos(phi)
    torque = -dB * sine + dA * sine * cosine + dC * cosine
    if law.rate is not None and law.rate.parameter == parameter:
        E0, Es, Ec = (np.reshape(x, (-1, 1)) for x in law.euler(values))
        torque = torque + 1j * nu[:, None] * (E0 + Es * sine + Ec * cosine)
    return torque


def _push_of_formula(law: PerturbedLaw, values: Values, phi: Array, nu: Array, number: int) -> Any:
    """The same in any potential."""
    formula: Any = law.base
    slope = derivative(formula, law.modulated[number - law.harmonics])
    return -slope.slopes(phi, *(values[name][:, None] for name in formula.names))
