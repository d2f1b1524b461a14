"""The wells and barriers of a law that does not vary, and which states lie below the barriers.

Damping only takes energy, so that a motion with less of it than either barrier beside its well
never leaves the well, and comes to rest there. That needs no linear stability: the bottom of x^4
attracts as well, if slowly; and no time scale: a motion that creeps is caught as soon as its speed
is spent.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from phasekit.arrays import Array
from phasekit.laws.perturbed import PerturbedConservative
from phasekit.motion.equation_rates import rates_along
from phasekit.motion.flow import accelerations
from phasekit.motion.method import circle

#: Points along a turn, or along the range of a line, at which equilibria are looked for.
POINTS = 2048
#: Points of the border of a well.
BORDER = 2049
#: Parts of the speed at the border, and of the greatest there, by which a state must lie inside:
#: more than the error of a border between its points.
INSIDE, OFF = 1e-4, 1e-6
#: Part of the greatest force that counts as none.
NO_WORK = 1e-10


@dataclass(frozen=True)
class Well:
    """A well: where a motion rests, and the barriers or ends of the range beside it."""

    rest: float
    left: float
    right: float


@dataclass(frozen=True)
class Landscape:
    """One law that does not vary, with damping that is nowhere negative."""

    law: PerturbedConservative
    values: Mapping[str, Array]

    @property
    def period(self) -> float:
        """Of the coordinate, 0 on a line."""
        return circle(self.law)

    def forces(self, phi: Array, speed: float = 0.0) -> Array:
        """Accelerations without damping."""
        calm = {**self.values, "damping": np.array(0.0), "quadratic": np.array(0.0)}
        return accelerations(self.law, calm, 0.0, phi, speed)

    def drag(self, phi: Array, speed: float) -> float:
        """Greatest rate at which damping takes speed."""
        damped = accelerations(self.law, self.values, 0.0, phi, speed)
        rate = (self.forces(phi, speed) - damped) / speed
        return float(np.max(rate, where=np.isfinite(rate), initial=0.0))

    def wells(self, low: float, high: float) -> list[Well]:
        """Wells whose rest lies between two values: of a circle all, once, from the first on."""
        turn = self.period
        far = turn if turn else 0.0
        count = POINTS * (3 if turn else 1)
        # No point of the grid is where symmetry puts an equilibrium.
        phi = np.linspace(low - far, high + far, count + 1)
        phi[1:-1] += 0.2360679775 * (phi[1] - phi[0])
        phi, force = self._with_close_pairs(phi, self.forces(phi))
        found, ends = [], self._roots(phi, force)
        for i, (at, kind) in enumerate(ends):
            if kind == "rest" and low <= at < high + (0.0 if turn else np.inf):
                found.append(Well(at, ends[i - 1][0], ends[i + 1][0]))
        return found

    def _with_close_pairs(self, phi: Array, force: Array) -> tuple[Array, Array]:
        """A grid with points between equilibria that are closer than its own."""
        with np.errstate(invalid="ignore"):
            size = np.abs(force)
            least = (size[1:-1] <= size[:-2]) & (size[1:-1] <= size[2:])
            same = (np.sign(force[1:-1]) == np.sign(force[:-2])) & (
                np.sign(force[1:-1]) == np.sign(force[2:])
            )
        i = np.flatnonzero(least & same) + 1
        at, own = self._least(phi[i - 1], phi[i + 1], np.sign(force[i]))
        if not (own < 0.0).any():
            return phi, force
        phi = np.unique(np.concatenate([phi, at[own < 0.0]]))
        return phi, self.forces(phi)

    def _least(self, left: Array, right: Array, sign: Array) -> tuple[Array, Array]:
        """Where forces are least of their sign, or where they have the other, and how great."""
        at, least, open_ = left.copy(), np.full(left.shape, np.inf), np.arange(left.size)
        for _ in range(8):
            if open_.size == 0:
                break
            fine = np.linspace(left, right, 17, axis=-1)
            own = sign[open_, None] * self.forces(fine)
            j, rows = np.argmin(own, axis=1), np.arange(open_.size)
            at[open_], least[open_] = fine[rows, j], own[rows, j]
            more = ~(own[rows, j] < 0.0)
            left, right = (
                fine[rows, np.maximum(j - 1, 0)][more],
                fine[rows, np.minimum(j + 1, 16)][more],
            )
            open_ = open_[more]
        return at, least

    def work(self) -> float:
        """Energy that torque brings in a turn forwards."""
        phi = np.linspace(0.0, self.period, 2 * BORDER - 1)
        force = self.forces(phi)
        work = _integral(phi, force * self._weight(phi, force))[-1]
        unit = self.period * np.abs(force).max()
        return float(work) if abs(work) > NO_WORK * unit else 0.0

    def has_rest(self) -> bool:
        """Whether there are equilibria on a circle, or the force is next to nothing somewhere."""
        phi = np.linspace(0.0, self.period, POINTS + 1)
        force = self.forces(phi)
        sign, i = np.sign(force[0]), int(np.argmin(np.abs(force)))
        if not (force * sign > 0.0).all():
            return True
        step, here = phi[1], phi[i : i + 1]
        _, own = self._least(here - step, here + step, sign[None])
        return bool(own[0] <= NO_WORK * np.abs(force).max())

    def _weight(self, phi: Array, force: Array) -> Array:
        """The inertia, up to a factor: one where it does not vary."""
        finite = np.abs(force[np.isfinite(force)])
        width = phi[-1] - phi[0]
        speed = float(np.sqrt(max(finite.max(initial=0.0) * width, np.finfo(float).tiny)))
        bend = (self.forces(phi, speed) - force) / speed**2
        weight = np.exp(-2.0 * _integral(phi, bend))
        return np.interp(phi, phi[::2], weight)

    def _roots(self, phi: Array, force: Array) -> list[tuple[float, str]]:
        """Equilibria in order, with the ends of the range, and of parts where there is no law."""
        known = np.isfinite(force)
        kept = np.flatnonzero(~known | (force != 0.0))
        phi, force, known = phi[kept], force[kept], known[kept]
        if not phi.size:  # no force anywhere
            return []
        change = known[:-1] & known[1:] & (np.sign(force[:-1]) != np.sign(force[1:]))
        at = np.flatnonzero(change)
        low, high, sign = phi[at].copy(), phi[at + 1].copy(), np.sign(force[at])
        for _ in range(60):
            middle = 0.5 * (low + high)
            left = np.sign(self.forces(middle)) == sign
            low, high = np.where(left, middle, low), np.where(left, high, middle)
        root = 0.5 * (low + high)
        beside = np.maximum(np.abs(force[at]), np.abs(force[at + 1]))
        with np.errstate(invalid="ignore"):
            pole = ~(np.abs(self.forces(root)) <= beside)
        rows = [(float(phi[0]), "end"), (float(phi[-1]), "end")]
        for x, down, bad in zip(root, sign > 0.0, pole, strict=True):
            rows.append((float(x), "end" if bad else "rest" if down else "top"))
        edges = np.flatnonzero(known[:-1] != known[1:])
        rows += [(float(phi[i] if known[i] else phi[i + 1]), "end") for i in edges]
        return sorted(rows)

    def border(self, well: Well) -> Array:
        """Rows (coordinate, least rate, greatest rate) of states below both barriers."""
        phi = np.linspace(well.left, well.right, 2 * BORDER - 1)
        force = self.forces(phi)
        full = self._weight(phi, force)
        weight = full[::2]
        level = -_integral(phi, full * force)
        rest = int(np.argmin(np.abs(phi[::2] - well.rest)))
        low = self._below(min(level[0], level[-1]) - level, weight, rest)
        falls = [low.copy(), low.copy()]
        speed = 0.5 * low[rest]
        for side, own, sense in ((slice(None, rest + 1), 0, 1), (slice(rest, None), -1, -1)):
            # Where such a speed towards the rest only shrinks, all that slide down are slow.
            push = accelerations(self.law, self.values, 0.0, phi[::2][side], sense * speed)
            if speed > 0.0 and (sense * push < 0.0).all():
                ahead, back = (1, 0) if sense > 0 else (0, 1)
                high = self._below(level[own] - level, weight, rest)[side]
                inside = high > 0.0
                falls[ahead][side] = np.where(inside, np.maximum(low[side], speed), low[side])
                falls[back][side] = np.maximum(low[side], high)
        return np.stack([phi[::2], -falls[0], falls[1]], axis=-1)

    def _below(self, height: Array, weight: Array, rest: int) -> Array:
        """Greatest speeds below a barrier, a little within, where the level stays below it."""
        inside = height > 0.0
        for side in (slice(rest, None), slice(rest, None, -1)):
            inside[side] = np.logical_and.accumulate(inside[side])
        with np.errstate(invalid="ignore"):
            rate = np.where(inside, np.sqrt(np.maximum(2.0 * height / weight, 0.0)), 0.0)
        return np.asarray((1.0 - INSIDE) * rate - OFF * np.nanmax(rate, initial=0.0))

    def exponent(self, rest: float) -> float:
        """Rate at which motions come to a rest; 0 where that is slower than exponential."""
        state = np.array([[rest, 0.0, 1.0, 0.0, 0.0, 1.0]])
        out = rates_along(self.law, self.values, 0.0, state, 2)
        slope, damping = out[0, 3], out[0, 5]
        fast = 0.5 * damping - np.emath.sqrt(0.25 * damping**2 + slope)
        slow = -slope / fast if fast != 0.0 else 0.0
        return float(max(np.real(fast), np.real(slow)))


def _integral(phi: Array, values: Array) -> Array:
    """Integrals to every other point, by Simpson's rule."""
    step = (phi[2::2] - phi[:-2:2]) / 6.0
    parts = step * (values[:-2:2] + 4.0 * values[1::2] + values[2::2])
    return np.concatenate([[0.0], np.cumsum(parts)])
