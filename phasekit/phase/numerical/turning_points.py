"""The arc of the coordinate over which an orbit runs: its turning points."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from phasekit.arrays import Array, Flags
from phasekit.arrays import Ints as Index
from phasekit.phase.numerical.differences import Anchor, Ground

#: Doublings of a first step, as many as there are between doubles.
_EXPANSIONS = 2200
#: Doublings after which V that falls is taken to fall for ever, though it is not proved.
_ENOUGH = 80


@dataclass(frozen=True, eq=False)
class End:
    """One end of the arc of each orbit.

    `offset` is the distance from the start, NaN where it is not known, infinite where there is no
    end; there `turned` tells a
    full turn of the circle from the way to infinity or out of the interval. The turning point lies
    at ``anchor.at + u``, and `excess` is the energy above the anchor.
    """

    offset: Array
    turned: Flags
    anchor: Anchor
    u: Array
    excess: Array

    def take(self, rows: Index) -> End:
        """The ends of some orbits."""
        return End(
            self.offset[rows],
            self.turned[rows],
            self.anchor.take(rows),
            self.u[rows],
            self.excess[rows],
        )


def distances(ground: Ground, x: Array, side: float | Array) -> Array:
    """How far each equilibrium lies from x on one side; on a circle in (0, period]."""
    way = side * (ground.points.phi - x[:, None])
    period = ground.systems.formula.period
    if period is not None:
        way = way % period
        way = np.where(way == 0.0, period, way)
    return way


def find_end(ground: Ground, x: Array, kinetic: Array, excess: Array, side: float) -> End:
    """Follow orbits to one side until they turn.

    Ground has one row for each orbit at x, with ``v^2/2`` there, and its excess of energy above
    each equilibrium; side is 1 for the right, -1 for the left.
    """
    systems, points = ground.systems, ground.points
    period = systems.formula.period
    rows = np.arange(systems.size)
    way = distances(ground, x, side)
    if not way.shape[1]:
        way = np.full((systems.size, 1), np.nan)
        at, near, excess = way, way, way
    else:
        at, near = points.phi, ground.near
    ahead = np.where((excess < 0.0) & (way > 0.0), way, np.inf)
    wall = np.argmin(ahead, axis=1)
    stop = ahead[rows, wall]
    before = np.where(np.isfinite(way) & (way < stop[:, None]), way, -np.inf)
    if period is not None:
        before = np.maximum(before, np.where(np.isfinite(way), way - period, -np.inf))
    base = np.argmax(before, axis=1)
    start = before[rows, base]
    blocked, based = np.isfinite(stop), np.isfinite(start)
    turned = ~blocked & (period is not None)

    # From the start itself where there is no equilibrium, else from the nearer in energy.
    to_wall = blocked & (~based | (np.abs(excess[rows, wall]) < np.abs(excess[rows, base])))
    chosen = np.where(to_wall, wall, base)
    lone = ~blocked & ~based
    anchor = Anchor(
        systems,
        np.where(lone, x, at[rows, chosen]),
        np.where(lone, 0.0, near[rows, chosen]),
    )
    above = np.where(lone, kinetic, excess[rows, chosen])
    place = np.where(lone, 0.0, np.where(to_wall, stop, start))  # of the anchor, from x
    low = np.where(based, np.maximum(start, 0.0), 0.0) - place
    high = stop - place
    reaching = ~blocked & ~turned
    if reaching.any():
        high = np.where(reaching, _beyond(anchor, above, side, low, x, place), high)
    high = np.where(turned, np.nan, high)
    u = _solve(anchor, above, side, low, high)
    # At rest where V rises ahead: the start is the turning point.
    resting = (kinetic == 0.0) & (side * systems.slope(x) >= 0.0) & ~turned
    offset = np.where(resting, 0.0, np.maximum(place + u, 0.0))
    u = np.where(resting, -place, u)
    # An end that there is but was not found is not known; without one the way has no end.
    offset = np.where(np.isnan(high) & np.isnan(offset) & np.isfinite(x), np.inf, offset)
    return End(offset, turned, anchor, side * u, above)


def _beyond(anchor: Anchor, above: Array, side: float, low: Array, x: Array, place: Array) -> Array:
    """Where V has risen above the energy beyond the last equilibrium; NaN if it does not."""
    ends = anchor.systems.formula.ends
    limit = side * (ends[1] if side > 0.0 else ends[0]) - side * x - place
    high = np.full(low.shape, np.nan)
    # The size of the orbit: how far it is from the anchor, or would be in a parabola.
    swing = np.sqrt(2.0 * np.abs(above) / np.abs(anchor.systems.bend(anchor.at)))
    step = np.select(
        [place != 0.0, np.isfinite(swing) & (swing > 0.0)],
        [np.abs(place), swing],
        0.125 * (1.0 + np.abs(low)),
    )
    going = np.ones(low.shape, dtype=bool)
    for number in range(_EXPANSIONS):
        there = np.minimum(low + step, limit)
        rise = anchor.rise(side * there)
        high = np.where(going & (rise > above), there, high)
        going &= np.isnan(high) & (there < limit) & np.isfinite(rise)
        if number >= _ENOUGH:
            going &= side * anchor.slope(side * there) > 0.0
        if not going.any():
            break
        step = 2.0 * step
    return high


def _solve(anchor: Anchor, above: Array, side: float, low: Array, high: Array) -> Array:
    """Solve rise(side u) = above for u between low (inside) and high (beyond).

    NaN where it is not found.
    """
    bend = np.abs(anchor.systems.bend(anchor.at))
    guess = np.sqrt(2.0 * np.abs(above) / bend)
    guess = np.where(high <= 0.0, -guess, guess)
    u = np.where((guess > low) & (guess < high), guess, 0.5 * (low + high))
    found = np.full(u.shape, np.nan)
    rows = np.arange(u.size)
    for _ in range(_EXPANSIONS):
        over = anchor.rise(side * u) - above
        outside = over > 0.0
        low, high = np.where(outside, low, u), np.where(outside, u, high)
        step = u - over / (side * anchor.slope(side * u))
        middle = 0.5 * (low + high)
        good = (step >= low) & (step <= high) & (np.abs(step - u) <= 0.5 * (high - low))
        small = np.abs(step - u) <= 2.0 * np.spacing(np.abs(u))
        fresh = np.where(over == 0.0, u, np.where(good | small, step, middle))
        # Rounding may turn steps of two units to and fro, as often as others still move.
        still = small | (np.abs(fresh - u) <= np.spacing(np.abs(u))) | np.isnan(fresh)
        found[rows[still]] = fresh[still]
        going = np.flatnonzero(~still)
        if not going.size:
            break
        rows, anchor, u = rows[going], anchor.take(going), fresh[going]
        low, high, above = low[going], high[going], above[going]
    return found
