"""One-dimensional invariant manifolds of fixed points of maps, and of flows seen once a period.

A half is the image of a short piece of it next to the fixed point, from a place to the image of
that, under all iterates. Each point of a later piece belongs to a place on the first, and comes
from there by iterates: a point that is put in between two others is as exact as they are.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Protocol

import numpy as np
import numpy.typing as npt

from phasekit.arrays import Array
from phasekit.laws.equations import Equations
from phasekit.motion.equation_rates import rates_on, slopes_on
from phasekit.motion.flow import motions
from phasekit.motion.flows import one_by_one
from phasekit.motion.manifold import CLOSE, REACHED, Strand, everywhere
from phasekit.motion.method import whole_turns

#: Where the first piece begins, in widths: its parabola leaves the manifold by the cube of that.
NEAR = {"map": 1e-5, "flow": 1e-4}
#: Where it ends at most: there the same has grown, if the multiplier is large.
FAR = 1e-3
#: Half of the distance of the states that tell how a manifold bends at the fixed point, when it has
#: grown, in widths.
ASIDE = 1e-3
#: The same of those whose images are differenced, where f is code.
DIFFERENCE = 2e-5
#: Turn of a curve at a point, beyond which points are put in unless they are as close as that.
TURN, FINE = 0.2, CLOSE / 20.0
#: Places of the first piece to begin with, and least distance between two.
PLACES, LEAST = 5, 1e-14
#: How far from 0 the place is at most whose image is 1.
BEGIN = 1e-3
#: Points, and iterates, at most.
MOST, LONGEST = 30_000, 20_000
#: Steps of Newton's method, the last in widths, and by how much of the step that was foreseen a
#: preimage may lie elsewhere.
NEWTON, LAST, ASTRAY = 30, 1e-13, 0.5
#: Last step of Newton's method for a fixed point, in widths, and the shortest part of a step.
CONVERGED, SHORTEST = 1e-10, 1.0 / 64.0
#: Tolerances of motions for a period.
RTOL, ATOL = 1e-12, 1e-13


class Leg(Protocol):
    """What is done again and again: so many steps of a map, or a motion for a time."""

    @property
    def near(self) -> float:
        """Where the first piece begins, in widths."""

    def ahead(self, x: Array) -> Array:
        """Images of states, the rows."""

    def slopes(self, x: Array) -> Array:
        """Derivatives of the images by the states."""

    def back(self, x: Array, near: Array) -> Array:
        """Preimages of states, next to others; NaN where none is found."""


@dataclass(frozen=True)
class Iterates:
    """So many steps of a map, which end some whole turns further back."""

    law: Equations
    values: Mapping[str, float]
    count: int
    widths: Array
    turned: Array
    near: float = NEAR["map"]

    def ahead(self, x: Array) -> Array:
        """Images."""
        with np.errstate(all="ignore"):
            for _ in range(self.count):
                x = rates_on(self.law, self.values, x)
        return x - self.turned

    def slopes(self, x: Array) -> Array:
        """Derivatives of the images."""
        found = np.broadcast_to(np.eye(x.shape[1]), (*x.shape, x.shape[1]))
        with np.errstate(all="ignore"):
            for _ in range(self.count):
                found = slopes_on(self.law, self.values, x) @ found
                x = rates_on(self.law, self.values, x)
        return found

    def back(self, x: Array, near: Array) -> Array:
        """Preimages, by Newton's method."""
        found = near.copy()
        open_ = np.asarray(np.isfinite(np.hstack([near, x])).all(axis=1))
        found[~open_] = np.nan
        for _ in range(NEWTON):
            if not (left := np.flatnonzero(open_)).size:
                break
            with np.errstate(all="ignore"):
                step = solved(self.slopes(found[left]), self.ahead(found[left]) - x[left])
                found[left] -= step
                size = np.linalg.norm(step / self.widths, axis=1)
                far = np.linalg.norm(found[left] / self.widths, axis=1)
            open_[left[~(size > LAST * np.maximum(far, 1.0))]] = False
        found[open_] = np.nan
        return found


@dataclass(frozen=True)
class Motions:
    """Motions for a time from t = 0, which end some whole turns further back."""

    law: Equations
    values: Mapping[str, float]
    time: float
    widths: Array
    turned: Array
    near: float = NEAR["flow"]

    def _moved(self, x: Array, time: float) -> Array:
        n = len(self.law.states)
        values = {name: np.array(value) for name, value in self.values.items()}
        times = np.full((len(x), 1), time)
        if self.law.kind == "python":
            how = {"rtol": RTOL, "atol": ATOL}
            return np.asarray(one_by_one(self.law, values, x, times, None, how)[0][:, 0])
        tangents = x.shape[1] // n - 1
        cell = self.law, values, x, times, RTOL, ATOL
        return motions(*cell, method="dop853", tangents=tangents).states[:, 0]

    def ahead(self, x: Array) -> Array:
        """States after the time."""
        return self._moved(x, self.time) - self.turned

    def slopes(self, x: Array) -> Array:
        """Derivatives of the states after the time."""
        count, n = x.shape
        if self.law.kind == "python":
            aside = DIFFERENCE * self.widths
            sides = [self.ahead(x + h) - self.ahead(x - h) for h in np.diag(aside)]
            return np.asarray(np.stack(sides, axis=-1) / (2.0 * aside))
        whole = np.hstack([x, np.tile(np.eye(n).ravel(), (count, 1))])
        return self._moved(whole, self.time)[:, n:].reshape(count, n, n).swapaxes(1, 2)

    def back(self, x: Array, near: Array) -> Array:  # noqa: ARG002 (motions need no start)
        """States before the time."""
        return self._moved(x + self.turned, -self.time)


def solved(matrix: Array, right: Array) -> Array:
    """Solutions of many systems; NaN where one is singular."""
    try:
        return np.asarray(np.linalg.solve(matrix, right[..., None])[..., 0], float)
    except np.linalg.LinAlgError:
        with np.errstate(all="ignore"):
            fine = np.abs(np.linalg.det(matrix)) > 0.0
        found = np.full(right.shape, np.nan)
        found[fine] = np.linalg.solve(matrix[fine], right[fine][..., None])[..., 0]
        return found


@dataclass
class Half:
    """One half of a manifold of a fixed point, piece by piece.

    Attributes
    ----------
    leg : Leg
        Of which the fixed point has a positive multiplier in this direction.
    x : array
        The fixed point.
    direction : array
        In widths, of length 1.
    growth : float
        How much longer a piece next to the fixed point is than the one before: above 1.
    stable : bool
        Whether pieces are preimages.
    places : array
        Places of the points on the first piece, from about 0 to 1.
    pieces : list of array
        The same points on all pieces so far.
    """

    leg: Leg
    x: Array
    direction: Array
    growth: float
    stable: bool
    widths: Array
    box: tuple[Array, Array]
    places: Array = field(init=False)
    pieces: list[Array] = field(init=False)

    def __post_init__(self) -> None:
        """The first piece."""
        self._bend = self._bent()
        self.places = np.linspace(self._begin(), 1.0, PLACES)
        self.pieces = [self._first(self.places)]

    def _bent(self) -> Array:
        """The quadratic coefficient of the manifold at the fixed point, in widths.

        It is that of what makes the pieces longer: the other way along it would be lost.
        """
        h, n = ASIDE / self.growth, len(self.x)
        away = h * np.array([[1.0], [-1.0]]) * self.direction * self.widths
        images = (self._next(self.x + away, self.x + self.growth * away) - self.x) / self.widths
        second = images.sum(axis=0) / h**2
        matrix = self.leg.slopes(self.x[None])[0] * self.widths / self.widths[:, None]
        squared, right = self.growth**2 * np.eye(n), 0.5 * second
        if self.stable:  # of the inverse
            matrix, squared, right = np.eye(n), squared @ matrix, matrix @ right
        found = solved((squared - matrix)[None], right[None])[0]
        return np.asarray(np.where(np.isfinite(found), found, 0.0))

    @property
    def near(self) -> float:
        """Where the first piece begins, in widths."""
        return min(self.leg.near, FAR / self.growth)

    def _begin(self) -> float:
        """The place, about 0, whose image is the end of the first piece: there the next begins."""
        place, end = 0.0, self._first(np.array([1.0]))
        slope = self.near * self.growth * float(np.log(self.growth))
        for _ in range(2):
            image = self._next(self._first(np.array([place])), end)
            off = float(((image - end)[0] / self.widths) @ self.direction)
            place -= off / slope if abs(off) < BEGIN * slope else 0.0  # NaN: not at all
        return place

    def _first(self, places: Array) -> Array:
        s = self.near * self.growth ** places[:, None]
        return np.asarray(self.x + (s * self.direction + s**2 * self._bend) * self.widths)

    def _next(self, x: Array, near: Array) -> Array:
        return self.leg.back(x, near) if self.stable else self.leg.ahead(x)

    def put_in(self, after: npt.NDArray[np.intp]) -> None:
        """Put in a point after each of some."""
        places = 0.5 * (self.places[after] + self.places[after + 1])
        x = self._first(places)
        for k, piece in enumerate(self.pieces):
            if k:
                x = self._next(x, 0.5 * (piece[after] + piece[after + 1]))
            self.pieces[k] = np.insert(piece, after + 1, x, axis=0)
        self.places = np.insert(self.places, after + 1, places)

    def go_on(self) -> None:
        """The next piece, NaN from where it cannot be followed."""
        last = self.pieces[-1]
        if not self.stable or isinstance(self.leg, Motions):
            self.pieces.append(self._next(last, last))
            return
        # Of several preimages the one next to that of the point before, along the curve.
        k, found = 0, [last[-1]]
        least, most = self.box
        while k + 1 < len(self.places):
            if np.any((found[-1] < least) | (found[-1] > most)):  # the others are not asked for
                found += [found[-1]] * (len(self.places) - len(found))
                break
            before, last = found[-1], self.pieces[-1]
            slopes = self.leg.slopes(before[None])
            way = solved(slopes, (last[k + 1] - last[k])[None])[0]
            x = self.leg.back(last[k + 1 : k + 2], (before + way)[None])[0]
            off, size = (np.linalg.norm(d / self.widths) for d in (x - before - way, way))
            if off <= ASTRAY * size + LAST:
                found.append(x)
                k += 1
            elif self.places[k + 1] - self.places[k] > LEAST and len(self.places) < MOST:
                self.put_in(np.array([k]))
            else:
                break
        whole = np.full(self.pieces[-1].shape, np.nan)
        whole[: len(found)] = found
        self.pieces.append(whole)


def turns_between(x: Array) -> Array:
    """Angles by which a polygon turns at its points, 0 at both ends."""
    way = np.diff(x, axis=0)
    size = np.linalg.norm(way, axis=1)
    with np.errstate(all="ignore"):
        way = way / size[:, None]
        half = 0.5 * np.linalg.norm(np.diff(way, axis=0), axis=1)
    return np.concatenate([[0.0], 2.0 * np.arcsin(np.clip(np.nan_to_num(half), 0.0, 1.0)), [0.0]])


def strand_of(half: Half, turns: Array, rests: Array, length: float) -> Strand:
    """Follow a half of a manifold until something ends it.

    It may end at one of the rests, of shape (n, states), or at a length in widths.
    """
    widths = half.widths
    around, numbers = everywhere(rests, turns, length)
    states, lengths = [half.x[None]], [np.zeros(1)]
    total, end, reached = 0.0, "length", -1
    for _ in range(LONGEST):
        tail = states[-1][-1]
        piece, along, why = _settled(half, tail, length - total)
        if len(half.pieces) > 1 and np.linalg.norm((half.pieces[-1][0] - tail) / widths) > CLOSE:
            break  # the errors of the first piece are seen
        states.append(piece)
        lengths.append(total + along)
        total = float(lengths[-1][-1]) if len(along) else total
        if why:
            end = why
            break
        if sum(map(len, states)) > MOST:
            break
        off = np.abs(piece[None] - around[:, None]) / widths
        here = np.flatnonzero((off < REACHED).all(axis=(1, 2)))
        apart = total > 2.0 * REACHED + 2.0 * half.near * half.growth
        if here.size and apart:
            end, reached = "equilibrium", numbers[here[0]]
            break
        half.go_on()
    return Strand(np.vstack(states), np.concatenate(lengths), end, reached)


def _settled(half: Half, tail: Array, length: float) -> tuple[Array, Array, str]:
    """The last piece with points close together up to where it ends, its length, and why."""
    least, most = half.box
    while True:
        x = half.pieces[-1]
        inside = np.all((x >= least) & (x <= most), axis=1)
        out = int(np.argmin(inside)) if not inside.all() else len(x)
        with np.errstate(all="ignore"):
            scaled = np.vstack([tail, x]) / half.widths
            steps = np.linalg.norm(np.diff(scaled, axis=0), axis=1)[1:]
            turn = turns_between(scaled)[1:]
        # Of an arc that turns so much; the turns at its ends are each half of others'.
        arcs = steps * (1.0 + (0.5 * (turn[:-1] + turn[1:])) ** 2 / 24.0)
        first = np.linalg.norm(scaled[1] - scaled[0])
        along = first + np.concatenate([[0.0], np.cumsum(np.nan_to_num(arcs, nan=np.inf))])
        over = int(np.argmax(along >= length)) if (along >= length).any() else len(x)
        stop = min(out, over)
        bends = np.maximum(turn[:-1], turn[1:]) > TURN
        poor = ~(steps <= CLOSE) | (bends & (steps > FINE))
        poor[stop:] = False
        gaps = np.diff(half.places) > LEAST
        if (poor & gaps).any() and len(x) < MOST:
            half.put_in(np.flatnonzero(poor & gaps))
            continue
        if (torn := poor & ~(steps <= CLOSE))[: max(stop - 1, 0)].any():
            cut = int(np.argmax(torn)) + 1  # a jump, or points that rounding cannot part further
            return x[:cut], along[:cut], "lost" if len(x) < MOST else "length"
        if over < out:
            return x[: over + 1], along[: over + 1], "length"
        if out < len(x):
            leaves = np.isfinite(x[out]).all() and not (out and torn[out - 1])
            return x[:out], along[:out], "window" if leaves else "lost"
        return x, along, ""


def fixed_points(
    leg: Leg, starts: Array, widths: Array, turns: Array
) -> tuple[Array, Sequence[Array]]:
    """Fixed points to which Newton's method comes from starts, once each, and their derivatives."""
    n = starts.shape[1]

    def off(x: Array) -> Array:
        found = leg.ahead(x) - x
        return found - whole_turns(found, turns)

    x = starts[np.isfinite(off(starts)).all(axis=1)]
    left, size = off(x), np.full(len(x), np.inf)
    for _ in range(NEWTON):
        step = solved(np.eye(n) - leg.slopes(x), left)
        size = np.linalg.norm(step / widths, axis=1)
        fine = np.isfinite(size)
        x, left, step, size = x[fine], left[fine], step[fine], size[fine]
        if not len(x) or size.max() < CONVERGED:
            x = x + step
            break
        open_, part = size >= CONVERGED, 1.0
        while open_.any() and part > SHORTEST:  # shorter steps where a whole one leads away
            tried = x[open_] + part * step[open_]
            there = off(tried)
            now, before = (np.linalg.norm(one / widths, axis=1) for one in (there, left[open_]))
            better = np.flatnonzero(open_)[now < before]
            x[better], left[better] = tried[now < before], there[now < before]
            open_[better] = False
            part *= 0.5
        if open_.any():
            x, left, size = x[~open_], left[~open_], size[~open_]
    kept: list[Array] = []
    x = x[size < CONVERGED]
    for _ in range(2 if len(x) else 0):  # to rounding: manifolds part from there
        x = x + np.nan_to_num(solved(np.eye(n) - leg.slopes(x), off(x)))
    for one in x:
        apart = [one - other for other in kept]
        apart = [d - whole_turns(d, turns) for d in apart]
        if not any(np.linalg.norm(d / widths) < 1e-7 for d in apart):
            kept.append(one)
    found = np.array(sorted(kept, key=tuple)).reshape(-1, n)
    return found, list(leg.slopes(found)) if len(found) else []
