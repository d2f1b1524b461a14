"""Resonances of the motions with a drive: where they lie, how wide they are, whether they overlap.

Next to ``n Omega(J) = m nu`` the drive moves the action by ``V sin psi``, slowly: a pendulum of
half-width ``2 sqrt(V/|dOmega/dJ|)``. V is a Fourier coefficient of ``f(phi) dphi/dtheta`` over the
exact angle variable, divided by n.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from phasekit.errors import Loop, OrbitFamily
from phasekit.laws.perturbed import PerturbedTrigonometric, modulation_names
from phasekit.numerics.contract import contract
from phasekit.perturbation.melnikov import refuse_prescribed
from phasekit.phase.exact.flow import flow
from phasekit.phase.exact.orbits import Orbits, energy_rises, orbits_at_gap
from phasekit.phase.exact.potential import potential
from phasekit.phase.exact.separatrices import phase_space

Array = npt.NDArray[np.float64]

#: Gaps to the separatrix that are searched, as logarithms over the height of the well.
NEAREST, FARTHEST = -60.0, 30.0
SCAN = 181
HALVINGS = 56
SAMPLES = 512
#: Step of the logarithm of the gap, for the twist.
STEP = 2e-3
#: Gaps over the height below which motions from states have lost the orbit.
LEAST = 1e-12
ROUNDING = 1e-14


class Resonances(NamedTuple):
    """Resonances; the last axis is the order."""

    resonance_action: Array
    resonance_width: Array
    resonance_overlap: Array


class Ladder(NamedTuple):
    """The orbits of one family in each cell: by the logarithm of their gap to a separatrix."""

    A: Array
    B: Array
    C: Array
    height: Array
    saddle: Any
    side: Any
    sign: float
    low: float
    high: float

    def at(self, u: Array) -> tuple[Array, Orbits]:
        """Gap, signed, and orbit."""
        gap = self.sign * self.height[:, None] * np.exp(u)
        a, b, c = (x[:, None] for x in (self.A, self.B, self.C))
        return gap, orbits_at_gap(a, b, c, gap, self.saddle[:, None], self.side[:, None])


def resonances(
    law: PerturbedTrigonometric, *parameters: npt.ArrayLike,
    orders: tuple[int, ...] = (1,), m: int = 1, family: int = 1,
) -> Resonances:  # fmt: skip
    """Resonances ``n Omega = m nu`` of a family, nu the frequency of the first harmonic."""
    refuse_prescribed(law, "resonances")
    values = law.values(*parameters)
    shape = np.broadcast_shapes(*map(np.shape, values.values()))
    flat = {n: np.array(np.broadcast_to(x, shape), float).reshape(-1) for n, x in values.items()}
    A, B, C = (np.asarray(x) for x in law.coefficients(flat))
    ladder = _ladder(A, B, C, family)
    drive = [*law.forcing(flat)]
    drive += [law.harmonic(flat, modulation_names(p)) for p in law.modulated]
    wanted = sorted({*orders, *(n + 1 for n in orders)})
    found = {}
    for n in wanted:
        nothing = np.full(len(A), np.nan)
        found[n] = (nothing, nothing)
        if drive:
            found[n] = _one(law, flat, ladder, drive, n, m, family)
    actions = np.stack([found[n][0] for n in orders], axis=-1)
    widths = np.stack([found[n][1] for n in orders], axis=-1)
    following = [np.stack([found[n + 1][i] for n in orders], axis=-1) for i in (0, 1)]
    with np.errstate(all="ignore"):
        overlap = (widths + following[1]) / np.abs(following[0] - actions)
    size = (*shape, len(orders))
    return Resonances(*(x.reshape(size) for x in (actions, widths, overlap)))


def _ladder(A: Array, B: Array, C: Array, family: int) -> Ladder:
    points, loops = phase_space(A, B, C)
    rises = energy_rises(A, B, C)
    four = np.isfinite(loops.saddle_phi[:, 0])
    number = 1 if family == OrbitFamily.UPPER_WELL else 0
    lower, upper = loops.saddle_phi[:, 0], loops.saddle_phi[:, 1]
    turn = 2.0 * np.pi
    own = points.phi[:, 2 * number]
    right = np.mod(own - lower, turn) < np.mod(upper - lower, turn)
    side = np.where(four & ~right, 0, 1)
    if family in (OrbitFamily.LOWER_WELL, OrbitFamily.UPPER_WELL):
        saddle = np.where(four, 0, 1)
        return Ladder(A, B, C, rises[:, number], saddle, side, -1.0, NEAREST, -1e-9)
    if family == OrbitFamily.OUTER:
        height = np.where(four & (loops.loop[:, 0] == Loop.LOBES), rises[:, 2], np.nan)
        return Ladder(A, B, C, height, np.zeros(len(A), int), side, 1.0, NEAREST, -1e-9)
    return Ladder(A, B, C, rises[:, 3], np.ones(len(A), int), side, 1.0, NEAREST, FARTHEST)


def _one(
    law: PerturbedTrigonometric, values: dict[str, Array], ladder: Ladder, drive: Any, n: int,
    m: int, family: int,
) -> tuple[Array, Array]:  # fmt: skip
    """Action and half-width of the resonance of one order; of several, the one of least action."""
    nu = drive[0][1]
    frequency = m * nu / n
    u = np.linspace(ladder.low, ladder.high, SCAN)
    if ladder.sign < 0.0:
        u = u[::-1]  # librations begin at the center
    scan = np.broadcast_to(u, (len(nu), SCAN))
    above = ladder.at(scan)[1].frequency > frequency[:, None]
    changes = above[:, 1:] != above[:, :-1]
    known = np.isfinite(ladder.at(scan)[1].frequency)
    changes &= known[:, 1:] & known[:, :-1]
    first = changes.argmax(axis=1)
    there = changes.any(axis=1)
    low, high = u[first], u[first + 1]
    start = above[np.arange(len(nu)), first]
    for _ in range(HALVINGS):
        middle = 0.5 * (low + high)
        same = (ladder.at(middle[:, None])[1].frequency[:, 0] > frequency) == start
        low, high = np.where(same, middle, low), np.where(same, high, middle)
    at = np.where(there, 0.5 * (low + high), np.nan)
    steps = at[:, None] + STEP * np.array([-2.0, -1.0, 0.0, 1.0, 2.0])
    gap, orbit = ladder.at(steps)
    # dOmega/du over dh/du = gap, times Omega = dh/dJ
    slope = contract(orbit.frequency, np.array([1.0, -8.0, 0.0, 8.0, -1.0]) / (12.0 * STEP))
    twist = slope / gap[:, 2] * frequency
    force = _coefficient(law, values, ladder, gap[:, 2], orbit, drive, n, m, family)
    with np.errstate(all="ignore"):
        width = 2.0 * np.sqrt(force / (n * np.abs(twist)))
    lost = np.abs(gap[:, 2]) < LEAST * ladder.height
    return orbit.action[:, 2], np.where(lost, np.nan, width)


def _coefficient(
    law: PerturbedTrigonometric, values: dict[str, Array], ladder: Ladder, gap: Array,
    orbit: Orbits, drive: Any, n: int, m: int, family: int,
) -> Array:  # fmt: skip
    """Fourier coefficient of the torques at m nu, along the orbit, over its angle variable."""
    A, B, C = ladder.A, ladder.B, ladder.C
    period = orbit.period[:, 2]
    points, loops = phase_space(A, B, C)
    if family in (OrbitFamily.LOWER_WELL, OrbitFamily.UPPER_WELL, OrbitFamily.OUTER):
        # From the turning point that lies farther from the saddle, which fewer digits decide.
        far = np.where(ladder.side == 1, orbit.phi_max[:, 2], orbit.phi_min[:, 2])
        phi, dphi = far, np.zeros(len(A))
    else:
        phi = points.phi[:, 0]
        level = loops.saddle_energy[:, 1] + gap - potential(A, B, C, phi)
        dphi = np.sqrt(2.0 * level) * (1.0 if family == OrbitFamily.FORWARD else -1.0)
    part = (np.arange(SAMPLES) + 0.5) / SAMPLES - 0.5
    t = period[:, None] * part
    a, b, c, x, v = (one[:, None] for one in (A, B, C, phi, dphi))
    motion = flow(a, b, c, x, v, t)
    path, speed = motion[0], motion[1]
    nu = drive[0][1]
    total = np.zeros(len(A), complex)
    at = np.exp(1j * m * nu[:, None] * t) * speed
    for i, (amplitude, frequency, phase) in enumerate(drive):
        torque = _torque(law, values, path, frequency, i)
        one = (torque * at).mean(axis=1)
        # What symmetry cancels is 0, and not rounding, whose root would be a width.
        one = np.where(np.abs(one) <= ROUNDING * np.abs(torque * at).mean(axis=1), 0.0, one)
        one = one * period / (2.0 * np.pi)
        meets = np.abs(frequency - m * nu) <= 1e-12 * m * nu
        total = total + np.where(meets, amplitude * np.exp(1j * phase) * one, 0.0)
    return np.asarray(np.abs(total))


def _torque(
    law: PerturbedTrigonometric, values: dict[str, Array], phi: Array, nu: Array, number: int
) -> Any:
    """Torque of a harmonic per unit of its amplitude, along motions."""
    if number < law.harmonics:
        return 1.0
    parameter = law.modulated[number - law.harmonics]
    dA, dB, dC = (np.asarray(x)[:, None] for x in law.derivatives(values, parameter))
    sine, cosine = np.sin(phi), np.cos(phi)
    torque = -dB * sine + dA * sine * cosine + dC * cosine
    if law.rate is not None and law.rate.parameter == parameter:
        E0, Es, Ec = (np.reshape(x, (-1, 1)) for x in law.euler(values))
        torque = torque + 1j * nu[:, None] * (E0 + Es * sine + Ec * cosine)
    return torque
