"""One attractor that is followed while parameters change slowly, and what becomes of it.

As long as it attracts, an equilibrium or a periodic orbit is found from the one before by Newton's
method, in steps as short as it takes. Where it is lost, the motion from there shows where it goes.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np

from phasekit.arrays import Array, Complex
from phasekit.errors import AttractorKind
from phasekit.laws.equations import Equations
from phasekit.laws.ladder import Map
from phasekit.motion.attractor import Search
from phasekit.motion.attractors import find_of
from phasekit.motion.edge import ESCAPED, draws_near, fates
from phasekit.motion.equation_rates import slopes_at
from phasekit.motion.method import single, turns_of
from phasekit.motion.newton import Neighbourhood
from phasekit.motion.strobe import common_period
from phasekit.motion.variational import carried, returned
from phasekit.motion.way import Way

#: Distance that an attractor moves in a step, and the shortest step, in steps of the path.
REACH, SHORTEST = 0.05, 1e-11
#: Shortest step with one that is not periodic: close to where it is lost motions stay for long.
COARSE = 1e-3
#: Distance from a critical attractor at which the motion away from it starts, and how far beyond
#: the loss, in steps of the path, where nothing comes after sooner.
ASIDE, BEYOND = 1e-3, (1e-4, 1e-3, 1e-2, 0.1, 0.4)
#: Parts of the way beyond at which what came after is held against it, and the part of its
#: distance to which it shrinks if it grows out of it.
PARTS, SHRINKS = tuple(0.75**k for k in range(1, 7)), 0.6
#: Points along a cycle for its extremes.
DENSE = 512


class Kept(NamedTuple):
    """An attractor at one place of the path."""

    kind: AttractorKind
    points: Array
    """Of shape (points, states); of a periodic orbit one of them, of another a run."""
    period: float
    """Legs, or the time, after which it repeats itself; 0: it does not, or rests."""
    values: Complex
    """Eigenvalues of a rest of a flow; else multipliers; none of what is not periodic."""

    @property
    def is_rest_of_flow(self) -> bool:
        """Whether eigenvalues decide about it."""
        return self.kind == AttractorKind.EQUILIBRIUM and self.period == 0.0


class Loss(NamedTuple):
    """Where an attractor is lost, and what comes after; None: nothing that is found."""

    place: float
    why: str
    before: Kept
    after: Kept | None
    soft: bool
    """Whether what comes after grows out of it."""


@dataclass
class SlowPath:
    """A path of parameters, whose steps are at the places 0, 1, ..."""

    law: Equations
    at: Callable[[float], Mapping[str, Array]]
    units: Array
    rtol: float
    losses: list[Loss] = field(default_factory=list)
    escaped: bool = False

    @property
    def strobed(self) -> bool:
        """Whether it is seen once an iteration, or once a period of the forcing."""
        return isinstance(self.law, Map) or self.law.time is not None

    def near(self, place: float) -> Neighbourhood:
        """Motions next to states, at a place of the path."""
        return Neighbourhood(self.law, self.at(place), self.units, self.rtol)

    def leg(self, place: float) -> float:
        """Time of a leg, or steps of a map."""
        period = common_period(self.law, self.at(place))
        return float(self.law.times if period is None else period)

    def settled(self, states: Array, place: float) -> Kept | None:
        """The attractor to which the first of some states comes; None where that is not seen."""
        search = find_of(self.law, self.at(place), states, self.units, self.rtol)
        code = draws_near(search, states[0])
        if code < 0:
            code = int(fates(search, states[:1])[0])
        self.escaped = code == ESCAPED
        if code < 0:
            return None
        return self._kept(search, code, place)

    def _kept(self, search: Search, code: int, place: float) -> Kept:
        one = search.found[code]
        rest = Kept(one.kind, one.points, 0.0, np.zeros(0, complex))
        if not one.is_periodic:
            return rest
        known = rest._replace(points=one.points[:1], period=one.period)
        return self.carried(known, place) or known

    def carried(self, kept: Kept, place: float) -> Kept | None:
        """The same attractor at another place near by; None where it is not, or attracts no more.

        What is not periodic is followed by its motion alone.
        """
        state = kept.points[0]
        found: Kept | None = None
        if self.strobed and kept.period:
            values, leg = self.at(place), kept.period * self.leg(place)
            point = returned(self.law, values, state, leg, self.units, REACH)
            if point is not None:
                multipliers = np.linalg.eigvals(point.slope).astype(complex)
                found = kept._replace(points=point.x[None], values=multipliers)
        elif kept.is_rest_of_flow:
            rest = self.near(place).rest(state, REACH)
            if rest is not None:
                found = kept._replace(points=rest.x[None], values=rest.eigenvalues)
        elif kept.period:
            cycle = self.near(place).cycle(state, kept.period, REACH)
            if cycle is not None and abs(cycle.period / kept.period - 1.0) < REACH:
                found = kept._replace(
                    points=cycle.x[None], period=cycle.period, values=cycle.multipliers
                )
        else:
            after = self.settled(kept.points[-1:], place)
            if after is None or not (after.period or after.is_rest_of_flow):
                return after
            # A cycle of a window lies among the states that were there.
            return after if self.distance(kept.points, after, place) < REACH else None
        return found if found is not None and growth(found) < 0.0 else None

    def advance(self, kept: Kept, start: float, stop: float) -> tuple[float, Kept]:
        """Follow an attractor as far as it attracts, up to a place."""
        place, step = start, stop - start
        is_periodic = kept.period or kept.is_rest_of_flow
        shortest = min(SHORTEST if is_periodic else COARSE, 0.5 * step)  # what is left is tried
        while place < stop and step > shortest:
            ahead = min(place + step, stop)
            found = self.carried(kept, ahead)
            if found is None:
                step *= 0.5
            else:
                place, kept = ahead, found
                step *= 2.0
        return (stop if stop - place <= SHORTEST else place), kept

    def follow(self, kept: Kept, count: int) -> list[Kept | None]:
        """The attractor at each of so many places; None once it is lost for good."""
        found: list[Kept | None] = [kept]
        now: Kept | None = kept
        place = 0.0
        for k in range(1, count):
            while now is not None and place < k:
                place, now = self.advance(now, place, float(k))
                if place < k:
                    place, now = self._lost(now, place, float(count - 1))
            if now is None:
                return found + [None] * (count - len(found))
            # Beyond a step what came after is followed back, or is not there yet.
            at_step = self.carried(now, float(k)) if place > k else now
            found.append(self.losses[-1].before if at_step is None else at_step)
        return found

    def _lost(self, kept: Kept, place: float, end: float) -> tuple[float, Kept | None]:
        """What comes after an attractor that is lost at a place, and where that is found."""
        side = ASIDE * self.direction(kept, place) * self.units
        states = kept.points[-1] + np.stack([side, -side])
        after, beyond = None, place
        for part in BEYOND:
            beyond = min(place + part, end)
            after = self.settled(states, beyond)
            if after is not None or self.escaped or beyond == end:
                break
        soft = after is not None and self._grows_out(kept, after, place, beyond)
        self.losses.append(Loss(place, reason(kept), kept, after, soft))
        return max(beyond, place + SHORTEST), after

    def _grows_out(self, before: Kept, after: Kept, place: float, beyond: float) -> bool:
        """Whether what comes after comes the nearer to what was before, the nearer the place."""
        way, at = self.way(before, place), beyond
        first = self.distance(way, after, beyond)
        for part in PARTS:
            nearer = self.carried(after, place + part * (beyond - place))
            if nearer is None:
                break
            after, at = nearer, place + part * (beyond - place)
        return self.distance(way, after, at) < SHRINKS * first

    def distance(self, way: Array, other: Kept, place: float) -> float:
        """Greatest distance of states along an attractor from a way."""
        points = Way(way, turns_of(self.law), self.units)
        return float(points.nearest(self.way(other, place)).max())

    def direction(self, kept: Kept, place: float) -> Array:
        """In which an attractor loses its hold, in units: of its first state upwards."""
        state, n = kept.points[-1], self.units.size
        if not kept.values.size:
            return np.zeros(n)
        values = self.at(place)
        if kept.is_rest_of_flow:
            one = single(values)
            slope = slopes_at(self.law, one, state)
        else:
            time = kept.period * (self.leg(place) if self.strobed else 1.0)
            slope = carried(self.law, values, state, time)[1]
        found, vectors = np.linalg.eig(slope * self.units / self.units[:, None])
        order = list(np.argsort(-(found.real if kept.is_rest_of_flow else np.abs(found))))
        if not (self.strobed or kept.is_rest_of_flow) and n > 1:
            # The multiplier along a cycle decides nothing.
            order.remove(int(np.argmin(np.abs(found - 1.0))))
        vector = np.real(vectors[:, order[0]])
        vector = vector / max(float(np.linalg.norm(vector)), np.finfo(float).tiny)
        first = vector[np.flatnonzero(np.abs(vector) > 1e-9)[:1]]
        return np.asarray(vector * (np.sign(first[0]) if first.size else 1.0))

    def way(self, kept: Kept, place: float, count: int = DENSE) -> Array:
        """States along an attractor."""
        if kept.is_rest_of_flow or not kept.period:
            return kept.points
        near, state = self.near(place), kept.points[0]
        if isinstance(self.law, Map):
            times = np.arange(round(kept.period), dtype=float) * self.law.times
            return near.along(state, times) if len(times) > 1 else kept.points[:1]
        time = kept.period * (self.leg(place) if self.strobed else 1.0)
        return near.along(state, time * np.arange(count) / count)


def growth(kept: Kept) -> float:
    """Greatest real part of the eigenvalues, or log of the moduli of multipliers over a period."""
    if kept.is_rest_of_flow:
        return float(kept.values.real.max())
    with np.errstate(divide="ignore"):
        return float(np.log(np.abs(kept.values).max(initial=0.0)))


def reason(kept: Kept) -> str:
    """What ends an attractor: the kind of its critical eigenvalue or multiplier."""
    if not kept.values.size:
        return "crisis"
    if kept.is_rest_of_flow:
        critical = kept.values[int(np.argmax(kept.values.real))]
        scale = max(float(np.abs(kept.values).max()), np.finfo(float).tiny)
        return "hopf" if abs(critical.imag) > 1e-6 * scale else "fold"
    critical = kept.values[int(np.argmax(np.abs(kept.values)))]
    if abs(critical.imag) > 1e-4 * abs(critical):
        return "torus"
    return "period_doubling" if critical.real < 0.0 else "fold"
