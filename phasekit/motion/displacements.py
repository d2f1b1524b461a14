"""Displacements of returns to a section of a planar flow, and their zeros: closed orbits.

A section is sampled more closely until what is between two samples is foreseen by those around, so
that pairs of cycles are seen as well as single ones.
"""

from __future__ import annotations

import itertools
from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from phasekit.arrays import Array
from phasekit.laws.equations import Equations
from phasekit.motion.lost import EXHAUSTED
from phasekit.motion.returns import ATOL, Plane, Ray, Returned, Section, first_returns

#: Samples of a section at first.
SAMPLES = 48
#: How often intervals between samples are halved, and to what part of the section.
ROUNDS, FINEST = 24, 1e-7
#: Relative error of a step while cycles are looked for, and when they are found.
ROUGH, FINE = 1e-10, 1e-13
#: Relative error of a return, over that of a step: displacements below it are none.
NOISE = 100.0
#: Steps of a motion on its way round at first, and over those that others took.
STEPS, TIMES = 4_000, 20
#: The same of the few that are tried where all take more.
MANY, FEW = 3_000_000, 16
#: Samples of a section in all.
MOST_SAMPLES = 4_000
#: A displacement that stays above this on both sides of its zero jumps.
JUMP = 1e-6
#: Part of a section over which motions return to where they began, if that is no single place.
FAMILY = 0.02
#: Where an interval may be divided.
PARTS = np.arange(1, 32) / 32.0
EPS = float(np.finfo(float).eps)
#: Error of a prediction of a displacement, over the displacement, with which it is foreseen.
FORESEEN = 0.2


class Met(NamedTuple):
    """What a section meets in one sense of time."""

    places: Array
    """Of cycles."""
    levels: Array
    """Displacements of them: of a torus periods of the other angle, else 0."""
    attracts: npt.NDArray[np.bool_]
    """Whether it is seen that they attract in this sense of time."""
    touching: Array
    """Places at which a motion returns to where it began within errors, while those before and
    behind are displaced one way: two cycles, one, or none."""
    families: Array
    """Places between which motions return to where they began, a row each."""
    late: Array
    """Places from which motions had not returned when they were given up."""


class Sampled:
    """Displacements of returns on a section, sampled until they are foreseen."""

    def __init__(
        self, law: Equations, values: Mapping[str, float], section: Section, plane: Plane,
        sense: float, growth: float = np.nan,
    ) -> None:  # fmt: skip
        self.law, self.values, self.section, self.plane = law, values, section, plane
        self.sense, self.steps, self.late = sense, STEPS, list[float]()
        parts = np.arange(1, SAMPLES + 1) / SAMPLES
        # On a ray the more closely the nearer to its point.
        places = section.longest * (parts**2 if isinstance(section, Ray) else parts - 0.5 / SAMPLES)
        self.s, self.d = places, self.displacements(places)
        for most, each in ((TIMES * STEPS, 1), (MANY, SAMPLES // FEW)):
            if self.late and not np.isfinite(self.d).any():
                self.steps, self.late = most, []
                self.s = places[::each]
                self.d = self.displacements(self.s)
        if np.isfinite(growth):  # at the point itself it is known
            self.s, self.d = np.append(0.0, self.s), np.append(sense * growth, self.d)
        self.refine()

    def displacements(self, places: Array, rtol: float = ROUGH) -> Array:
        """How far motions return from where they began.

        Of a ray the logarithm of how many times as far from its point, which is smooth down to it.
        """
        found = self._returned(places, rtol)
        returned = np.isfinite(found.place)
        most = TIMES * int(found.steps[returned].max(initial=0))
        late = found.status == EXHAUSTED
        if late.any() and most > self.steps:
            self.steps = most
            again = self._returned(places[late], rtol)
            found.place[late], found.status[late] = again.place, again.status
        if rtol >= ROUGH:
            self.late += places[found.status == EXHAUSTED].tolist()
        with np.errstate(all="ignore"):
            if isinstance(self.section, Ray):
                return np.asarray(np.log(found.place / places))
            return np.asarray(found.place - places)

    def _returned(self, places: Array, rtol: float) -> Returned:
        return first_returns(
            self.law, self.values, self.section, places, self.plane, sense=self.sense, rtol=rtol,
            most=self.steps * (5 if rtol < ROUGH else 1),  # as many more as errors are smaller
        )  # fmt: skip

    def refine(self) -> None:
        """Divide intervals until what is between their ends is foreseen."""
        intervals = list(zip(self.s[:-1], self.s[1:], strict=True))
        for _ in range(ROUNDS):
            table = [self._foreseen(a, b) for a, b in intervals]
            middles, foreseen = np.array(table).T
            new = self.displacements(middles)
            before = dict(zip(self.s.tolist(), self.d.tolist(), strict=True))
            s, d = np.append(self.s, middles), np.append(self.d, new)
            order = np.argsort(s)
            self.s, self.d = s[order], d[order]
            left = []
            for (a, b), middle, value, guess in zip(intervals, middles, new, foreseen, strict=True):
                if b - a <= FINEST * self.section.longest:
                    continue
                clear = self._is_clear((a, b), before[a], before[b], value, guess)
                halves = (a, middle), (middle, b)
                left += [half for half in halves if not clear or self._dip(*half) is not None]
            intervals = left
            if not intervals or len(self.s) > MOST_SAMPLES:
                break

    def _foreseen(self, a: float, b: float) -> tuple[float, float]:
        """Where to divide an interval, and the displacement there by a polynomial.

        It goes through the samples around. Where it comes nearer to zero, or where its course from
        both sides does, the interval is divided there, else in the middle.
        """
        k = int(np.searchsorted(self.s, a))
        near = [i for i in range(max(k - 1, 0), min(k + 3, len(self.s))) if np.isfinite(self.d[i])]
        if k not in near or k + 1 not in near:
            return 0.5 * (a + b), np.nan
        at = a + PARTS * (b - a)
        values = _through(self.s[near], self.d[near], at)
        ends = self._above_level(self.d[k : k + 2])
        sign = np.sign(ends[np.argmax(np.abs(ends))])
        best = int(np.argmin(sign * self._above_level(values)))
        differ = np.any(sign * ends < -self._noise(np.array([a, b])))
        if differ or sign * values[best] > 0.5 * np.min(np.abs(ends)):
            best = len(PARTS) // 2
        if (dip := self._dip(a, b)) is not None:
            best = dip
        return float(at[best]), float(values[best])

    def _dip(self, a: float, b: float) -> int | None:
        """Where between two samples displacements come near to zero if they bend there at once.

        They go on as on both sides, and are where these courses meet: a return map has such bends
        where motions pass a saddle. None where they come no nearer than at the ends.
        """
        k = int(np.searchsorted(self.s, a))
        ends = self._above_level(self.d[k : k + 2])
        sign = np.sign(ends[0])
        if not np.all(sign * ends > self._noise(self.s[k : k + 2])):
            return None
        at, courses = a + PARTS * (b - a), []
        for side in (range(k, max(k - 3, -1), -1), range(k + 1, min(k + 4, len(self.s)))):
            seen = list(itertools.takewhile(lambda i: np.isfinite(self.d[i]), side))
            courses.append(_through(self.s[seen], self.d[seen], at) - self.d[seen[0]])
        course = np.max(sign * np.array(courses) + np.abs(ends)[:, None], axis=0)
        best = int(np.argmin(course))
        return best if course[best] < (1.0 - FORESEEN) * np.min(np.abs(ends)) else None

    def _above_level(self, d: Array) -> Array:
        """How far above the nearest level, at which cycles are, displacements are."""
        period = self.section.period
        return d - period * np.rint(d / period) if period else d

    def _is_clear(
        self, at: tuple[float, float], a: float, b: float, middle: float, foreseen: float
    ) -> bool:
        """Whether there is nothing else between the ends of an interval than what they show."""
        values = np.array([a, middle, b])
        defined = np.isfinite(values)
        if not defined.any():
            return True
        if not defined.all():
            return False
        away, noise = (
            np.abs(self._above_level(values)),
            self._noise(np.array([0.5 * (at[0] + at[1])])),
        )
        if np.all(away < noise):
            return True
        return bool(abs(foreseen - middle) <= FORESEEN * away[away >= noise].min())

    def _noise(self, places: Array) -> Array:
        """Displacements that errors of steps and rounding make of none."""
        sizes = np.max(np.abs(self.section.states(places)) / self.plane.widths, axis=1) + ATOL
        if not isinstance(self.section, Ray):
            return np.asarray(NOISE * ROUGH * (1.0 + sizes))
        # A part of the distance from the point, at which it is known.
        with np.errstate(divide="ignore"):
            error = NOISE * ROUGH * (1.0 + sizes / places)
        return np.where(places > 0.0, error, EPS)

    def met(self) -> Met:
        """Cycles, and what else is seen."""
        period = self.section.period
        places, levels, attracts = [], [], []
        still = np.abs(self._above_level(self.d)) < self._noise(self.s)
        touching, families = self._stills(still)
        brackets = []
        s, d = self.s[~still], self.d[~still]
        for k in np.flatnonzero(np.isfinite(d[:-1]) & np.isfinite(d[1:])):
            low, high = sorted(d[k : k + 2])
            targets = np.zeros(int(low < 0.0 < high))
            if period:
                targets = period * np.arange(np.ceil(low / period), np.floor(high / period) + 1)
            if not any(s[k] < a and b < s[k + 1] for a, b in families):
                brackets += [(s[k], s[k + 1], d[k] - x, d[k + 1] - x, x) for x in targets]
        for a, b, da, db, target in self._zeros(brackets):
            if min(abs(da), abs(db)) > JUMP:
                continue  # returns jump there, where one touches the section
            places.append(a if abs(da) < abs(db) else b)
            levels.append(target)
            attracts.append(da > db)
        return Met(
            np.array(places), np.array(levels), np.array(attracts, bool), np.array(touching),
            np.reshape(families, (-1, 2)), np.array(self.late),
        )  # fmt: skip

    def _stills(
        self, still: npt.NDArray[np.bool_]
    ) -> tuple[list[float], list[tuple[float, float]]]:
        """Places of single returns within errors, and ends of whole families of them."""
        touching, families = [], []
        runs = np.flatnonzero(np.diff(np.concatenate([[0], still, [0]]).astype(int)))
        for begin, end in zip(runs[::2], runs[1::2], strict=True):
            low, high = self.s[begin], self.s[end - 1]
            if high - low > FAMILY * self.section.longest:
                families.append((low, high))
            elif begin and end < len(self.s):
                before, after = self._above_level(self.d[[begin - 1, end]])
                if before * after > 0.0:
                    touching.append(
                        float(self.s[begin + int(np.argmin(np.abs(self.d[begin:end])))])
                    )
        return touching, families

    def _zeros(self, brackets: Sequence[tuple[float, ...]]) -> list[tuple[float, ...]]:
        """Close in on zeros between places whose displacements differ in sign, all at once."""
        table = np.array(brackets, float).reshape(-1, 5)
        a, b, da, db, target = table.T.copy()
        side = np.zeros(len(table))
        size = EPS * self.section.longest
        fa, fb = da.copy(), db.copy()  # halved where one end stays
        active = np.arange(len(table))
        for step in range(80):
            open_ = (np.abs(b - a) > 4.0 * size) & (da != 0.0) & (db != 0.0)
            active = np.flatnonzero(open_)
            if not active.size:
                break
            x, y, fx, fy = a[active], b[active], fa[active], fb[active]
            with np.errstate(all="ignore"):
                s = x - fx * (y - x) / (fy - fx)
            # Now and then the middle, so that it closes in on steep ones.
            outside = ~((s > np.minimum(x, y)) & (s < np.maximum(x, y))) | (step % 4 == 3)
            s = np.where(outside, 0.5 * (x + y), s)
            d = self.displacements(s, FINE) - target[active]
            # Where there is no return, there is none at the end that is further out.
            d = np.where(np.isfinite(d), d, np.where(np.abs(fx) > np.abs(fy), fx, fy))
            same = (d > 0.0) == (da[active] > 0.0)
            at = active[same]
            a[at], da[at], fa[at] = s[same], d[same], d[same]
            fb[at] = np.where(side[at] == 1, 0.5 * fb[at], db[at])
            side[at] = 1
            at = active[~same]
            b[at], db[at], fb[at] = s[~same], d[~same], d[~same]
            fa[at] = np.where(side[at] == -1, 0.5 * fa[at], da[at])
            side[at] = -1
        return list(zip(a, b, da, db, target, strict=True))


def _through(x: Array, y: Array, at: Array) -> Array:
    """The polynomial through few points, at places."""
    values = np.zeros(len(at))
    for i, own in enumerate(y):
        others = np.delete(x, i)
        values += own * np.prod((at[:, None] - others) / (x[i] - others), axis=1)
    return values
