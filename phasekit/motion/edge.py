"""States on the boundary between two basins: bisection along the flow.

A pair of states on both sides of a boundary is brought together by bisection, followed until it
has come apart a little, and brought together again: so it stays on the boundary and comes to what
attracts there [SkufcaYorkeEckhardt2006].
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from phasekit.arrays import Array, Index
from phasekit.errors import AttractorKind
from phasekit.laws.equations import Equations
from phasekit.laws.ladder import Map
from phasekit.motion.attractor import Search
from phasekit.motion.lost import FAILED
from phasekit.motion.newton import SAME, Neighbourhood
from phasekit.motion.strobe import common_period, strobe
from phasekit.motion.variational import carried, returned

#: States between two that are tried at once, distance of a pair, and at which it is bisected anew.
PARTS, CLOSE, APART = 16, 1e-10, 1e-6
#: Legs for which a state is followed, and for which a pair is at once.
LEGS, TOGETHER = 20_000, 400
#: Bisections, and those after which what repeats itself is looked for.
ROUNDS, EARLY = 400, 2
#: Distance within which a pair has come to a rest or cycle on the boundary, or back to itself.
NEAR, BACK = 1e-2, 2e-2
#: Legs after which, and again, a motion is seen to draw near to an attractor, what part of its
#: distance is then left at most, and how near it has come.
SOON, DRAWN, ARRIVED = (60, 240, 1000, 4000), 0.1, 1e-6
#: Returns through which periodic orbits are tried.
TRIES = 8
#: Points along a cycle.
POINTS = 256
#: Code of motions that run to infinity.
ESCAPED = -2


class Edge(NamedTuple):
    """What attracts on a boundary."""

    kind: AttractorKind
    """EQUILIBRIUM, CYCLE, ROTATION, or UNKNOWN: neither was found."""
    points: Array
    """Of shape (points, states)."""
    period: float
    """Legs, or the time, after which it repeats itself; 0: it does not."""
    multipliers: npt.NDArray[np.complex128]
    """Eigenvalues of a rest of a flow; else multipliers over the period."""
    track: Array
    """States of the pair, of shape (legs, states)."""
    leg: float


@dataclass
class Boundary:
    """The boundary of the basin to which the first of two states belongs."""

    search: Search
    own: int
    """Its attractor."""
    track: list[Array] = field(default_factory=list)

    @property
    def near(self) -> Neighbourhood:
        """Motions next to states."""
        law = self.search.law
        assert isinstance(law, Equations)
        return Neighbourhood(law, self.search.values, self.search.units)

    def squeezed(self, a: Array, b: Array) -> tuple[Array, Array]:
        """A pair on both sides of the boundary, close together."""
        units = self.search.units
        while True:
            distance = float(np.linalg.norm((b - a) / units))
            ulp = np.finfo(float).eps * float(
                np.linalg.norm(np.maximum(np.abs(a), np.abs(b)) / units)
            )
            if distance <= max(CLOSE, 8.0 * ulp):
                return a, b
            parts = np.arange(1, PARTS) / PARTS
            states = a + parts[:, None] * (b - a)
            codes = fates(self.search, states)
            other = np.flatnonzero(codes != self.own)
            last = int(other[0]) if other.size else PARTS - 1
            a, b = (states[last - 1] if last else a), (states[last] if last < PARTS - 1 else b)

    def apart(self, a: Array, b: Array) -> tuple[Array, Array, Array]:
        """Follow a pair until it comes apart; the states of its middle on the way."""
        found = self.search.run(np.stack([a, b]), TOGETHER, 0).states
        off = np.linalg.norm((found[1] - found[0]) / self.search.units, axis=-1)
        beyond = np.flatnonzero(~(off <= APART))
        last = max(int(beyond[0]) if beyond.size else TOGETHER - 1, 1)
        last = last if np.isfinite(off[last]) else last - 1
        middle = 0.5 * (found[0, : last + 1] + found[1, : last + 1])
        return found[0, last], found[1, last], middle


def draws_near(search: Search, state: Array) -> int:
    """The attractor that a motion is seen to draw near to; -1: it is not seen soon.

    It comes close and, in as many legs again, much closer, so that no others have to be tried
    around the attractor.
    """
    for legs in SOON:
        seen = search.run(state[None], legs + 1, legs).states[0, [0, -1]]
        if not np.isfinite(seen).all():
            return -1
        for code, one in enumerate(search.found):
            if one.is_periodic:
                before, after = search.distance(one, seen)
                here = ARRIVED + 2.0 * search.blur(one)
                drawn = after < DRAWN * before or before < here
                if before < NEAR and after < here and drawn:
                    return code
    return -1


def fates(search: Search, states: Array) -> Index:
    """Attractors to which motions come; -1: to none that is known, -2: to infinity."""
    found = strobe(
        search.law, search.values, states, search.leg, 1, LEGS, targets=search.targets(),
        most_legs=LEGS, steps=search.steps,
    )  # fmt: skip
    return np.where((found.code < 0) & (found.status == FAILED), ESCAPED, found.code)


def edge_between(search: Search, a: Array, b: Array, own: int) -> Edge:
    """What attracts on the boundary between two states, the first of which comes to `own`."""
    boundary = Boundary(search, own)
    for number in range(ROUNDS):
        a, b = boundary.squeezed(a, b)
        a, b, way = boundary.apart(a, b)
        boundary.track += list(way[:-1] if len(way) > 1 else way)
        found = _rest_or_cycle(boundary, number)
        if found is not None:
            return found
    track = np.array(boundary.track)
    return Edge(
        AttractorKind.UNKNOWN, track[-POINTS:], 0.0, np.zeros(0, complex), track, search.leg
    )


def _rest_or_cycle(boundary: Boundary, number: int) -> Edge | None:
    """The equilibrium or cycle to which a pair has come; None where it is under way."""
    search, track = boundary.search, np.array(boundary.track)
    law = search.law
    assert isinstance(law, Equations)
    strobed = isinstance(law, Map) or common_period(law, search.values) is not None
    state, near = track[-1], boundary.near
    if not strobed:
        # The pair parts where it has come closest to what attracts on the boundary.
        slowest = _slowest(near, track[-TOGETHER:])
        rest = near.rest(slowest, NEAR)
        if rest is not None and (rest.eigenvalues.real > rest.flat).any():
            return Edge(
                AttractorKind.EQUILIBRIUM, rest.x[None], 0.0, rest.eigenvalues, track, search.leg
            )
    if number < EARLY:
        return None
    off = search.apart(track[:-1], state)
    if strobed:
        ends = np.flatnonzero(off < BACK)
        for i in ends[::-1][:TRIES]:
            legs = len(track) - 1 - int(i)
            how = legs * search.leg, search.units, 5.0 * BACK
            point = returned(law, search.values, state, *how)
            if point is not None:
                return _least(search, point.x, legs, track)
        return None
    # Looks are some way apart: a motion that comes back passes a state between two of them.
    steps = search.apart(track[1:], track[:-1])
    close = max(BACK, 0.75 * float(np.max(steps[-TOGETHER:])))
    far = np.flatnonzero(off > 2.0 * close)
    back = np.flatnonzero(off[: far[-1]] < close) if far.size else np.zeros(0, int)
    for i in back[::-1][:TRIES]:
        cycle = near.cycle(state, (len(track) - 1 - int(i)) * search.leg)
        if cycle is not None:
            points = near.along(cycle.x, cycle.period * np.arange(POINTS + 1) / POINTS)
            turned = np.abs(points[-1] - cycle.x) > 0.5 * search.turns
            runs = bool(np.any(turned & (search.turns > 0.0)))
            kind = AttractorKind.ROTATION if runs else AttractorKind.CYCLE
            return Edge(kind, points[:-1], cycle.period, cycle.multipliers, track, search.leg)
    return None


def _least(search: Search, x: Array, legs: int, track: Array) -> Edge:
    """A periodic orbit of a map, or of a forced flow, run through once."""
    points = search.run(x[None], legs, 0).states[0]
    again = np.flatnonzero(search.apart(points[1:], x) < SAME)
    legs = int(again[0]) + 1 if again.size else legs
    slope = carried(search.law, search.values, x, legs * search.leg)[1]
    rests = isinstance(search.law, Map) and legs == 1
    kind = AttractorKind.EQUILIBRIUM if rests else AttractorKind.CYCLE
    values = np.linalg.eigvals(slope).astype(complex)
    return Edge(kind, points[:legs], float(legs), values, track, search.leg)


def _slowest(near: Neighbourhood, track: Array) -> Array:
    """The state of some in which a motion is slowest."""
    from phasekit.motion.equation_rates import rates_on

    speeds = np.linalg.norm(rates_on(near.law, near.single, track) / near.units, axis=1)
    return np.asarray(track[int(np.nanargmin(speeds))])
