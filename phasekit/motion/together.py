"""Many motions of one Python function that takes arrays: by DOP853, each with steps of its own."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Self

import numpy as np

from phasekit.arrays import Array, Index
from phasekit.errors import ParameterError
from phasekit.laws.equations import Equations
from phasekit.laws.ladder import Map
from phasekit.motion.equation_rates import Called, parameters_of
from phasekit.motion.kernels import coefficients
from phasekit.motion.steps import BEYOND, EARLY, TRIAL

#: Steps of a leg, and of one of a motion that is gone.
MOST, FEW = 100_000, 100
#: Difference of values of all states at once from those of one.
SAME = 1e-11
STAGES = 12
SUMS = np.array([[one.get(place, 0.0) for place in range(16)] for one in coefficients.SUMS])
END, THIRD, FIFTH = SUMS[11, :STAGES], SUMS[15, :STAGES], SUMS[16, :STAGES]
#: Least and greatest change of a step, and what of the step that just fits is taken.
SHORTEST, LONGEST, SAFETY = 0.2, 10.0, 0.9
#: A size or a change in a leg, beside the errors allowed, that says nothing of the first step; that
#: step, of the leg; a slope that is none; and what a number is divided by at least.
FAINT, TINY, FLAT, LEAST = 1e-5, 1e-6, 1e-15, 1e-300


class Together:
    """A Python function at the states of many motions, all in one call."""

    def __init__(self, law: Equations, values: Mapping[str, Any], count: int) -> None:
        self.law = law
        # Without parameters there is a row of none.
        self.rows = dict(zip(law.names, parameters_of(law, values, count), strict=False))
        self.fixed = {name: float(row[0]) for name, row in self.rows.items() if not np.ptp(row)}
        self.undefined = np.zeros(count, bool)
        """Whether it returned NaN at a state that is finite."""
        self.raised: dict[int, str] = {}
        """What it raised, by motion."""
        self.mixes = False
        """Whether a value of one motion was seen to depend on others."""

    @classmethod
    def if_it_takes_arrays(
        cls, law: Equations, values: Mapping[str, Any], count: int, cells: Index, x: Array
    ) -> Self | None:
        """Of a function that gives the same of many states as of each; None of another one."""
        f = cls(law, values, count)
        finite = np.isfinite(x).all(axis=1)
        x, good = x[finite], cells[finite]
        t = np.linspace(0.0, 1.0, good.size)
        if good.size < 2:
            return None
        try:
            found = f.whole(t, x, good)
        except Exception:  # noqa: BLE001 - a function of one state
            return None
        alone = f.one_by_one(t, x, good)
        size = np.abs(alone).max(axis=1, initial=0.0, keepdims=True)
        with np.errstate(invalid="ignore"):
            alike = (np.abs(found - alone) <= SAME * size) | (np.isnan(found) & np.isnan(alone))
        return f if bool(alike.all()) and not f.raised else None

    def forget(self) -> None:
        """Forget what was raised and undefined."""
        self.undefined[:] = False
        self.raised.clear()

    def whole(self, t: Array, x: Array, cells: Index) -> Array:
        """Values at times and states, the rows of x, in one call.

        Raises
        ------
        ValueError
            If it returns no value for each.
        """
        given = {n: self.fixed.get(n, row[cells]) for n, row in self.rows.items()}
        more = {} if self.law.time is None else {self.law.time: t.copy()}
        found = self.law.f(x.T.copy(), **given, **more)
        count, n = x.shape
        if len(found) != n:
            raise ValueError(f"{len(found)} values, wants {n}")
        return np.stack([np.broadcast_to(np.asarray(one, float), count) for one in found], axis=1)

    def one_by_one(self, t: Array, x: Array, cells: Index) -> Array:
        """Values at times and states, in one call for each."""
        found = np.empty(x.shape)
        for i, cell in enumerate(cells.tolist()):
            one = Called(self.law, {name: float(row[cell]) for name, row in self.rows.items()})
            found[i] = one(float(t[i]), x[i])
            self.undefined[cell] |= one.undefined
            if one.raised:
                self.raised[cell] = one.raised
        return found

    def __call__(self, t: Array, x: Array, cells: Index) -> Array:
        """Values at times and states; NaN where there is none."""
        try:
            found = self.whole(t, x, cells)
        except ParameterError:
            raise
        except Exception:  # noqa: BLE001 - where it raises is seen state by state
            return self.one_by_one(t, x, cells)
        wrong: Any = np.isnan(found).any(axis=1)
        if wrong.any():
            finite = np.isfinite(x).all(axis=1)
            if finite.any() and wrong[finite].all():  # one may have spoiled all
                return self.one_by_one(t, x, cells)
            self.undefined[cells[wrong & finite]] = True
        return found

    def compare(
        self, t: Array, x: Array, cells: Index, found: Array, h: Array, allowed: Array
    ) -> None:
        """See whether a value is that of its motion alone; `mixes` where a step h is off by more.

        A function may give all of them another value where one is far out, as where
        ``np.any(abs(x) > 1e3)``: one of middle size is not that one.
        """
        size = np.abs(x).max(axis=1)
        finite = np.flatnonzero(np.isfinite(size))
        if finite.size < 2:
            return
        middle = (finite.size - 1) // 2
        row = finite[np.argpartition(size[finite], middle)[middle]]
        one = slice(row, row + 1)
        value, alone = found[row], self.one_by_one(t[one], x[one], cells[one])[0]
        most = SAME * max(float(size[row]), float(h[row] * np.abs(alone).max()))
        alike = np.abs(value - alone) * h[row] <= np.maximum(most, allowed[row])
        alike |= (value == alone) | (np.isnan(value) & np.isnan(alone))
        self.mixes = self.mixes or not bool(alike.all())


def stepped(
    f: Together, cells: Index, x: Array, begin: Array, end: Array, rtol: float, atol: float,
    reach: Array,
) -> Array:  # fmt: skip
    """States at the ends of a leg, or after so many iterations; NaN where motions fail.

    They fail, too, where after many steps they are out of reach: nothing was raised there then.
    Where the function is seen to mix motions, nothing is known of any.
    """
    with np.errstate(all="ignore"):
        if isinstance(f.law, Map):
            exact, whole = np.zeros(x.shape), np.ones(len(x))
            for i in range(int(end[0] - begin[0])):
                before, x = x, f(begin + i, x, cells)
                f.compare(begin + i, before, cells, x, whole, exact)
                if f.mixes:
                    break
            return x
        return _integrated(f, cells, x, begin, end, max(rtol, 1e-13), atol, reach)


def _integrated(
    f: Together, cells: Index, x: Array, begin: Array, end: Array, rtol: float, atol: float,
    reach: Array,
) -> Array:  # fmt: skip
    found = np.full(x.shape, np.nan)
    n = x.shape[1]
    on = np.arange(len(x))
    t, slope = begin.copy(), f(begin, x, cells)
    size = np.abs(x).max(axis=1)
    first, longest = np.zeros(len(x)), np.zeros(len(x))
    taken, kept_back = np.zeros(len(x), np.int64), np.zeros(len(x), bool)
    h = _first_step(f, cells, t, x, slope, end - begin, rtol, atol)
    k = np.empty((STAGES, *x.shape))
    while on.size:
        rest = end - t
        h = np.minimum(h, rest)
        k[0] = slope
        for s in range(1, STAGES):
            ahead = np.tensordot(SUMS[s - 1, :s], k[:s], 1)
            k[s] = f(t + coefficients.TIMES[s] * h, x + h[:, None] * ahead, cells)
        after = x + h[:, None] * np.tensordot(END, k, 1)
        slope_after = f(t + h, after, cells)
        scale = _allowed(atol, size) + rtol * np.maximum(np.abs(x), np.abs(after))
        f.compare(t + h, after, cells, slope_after, h, scale)
        if f.mixes:
            return found
        third, fifth = ((np.tensordot(e, k, 1) / scale) ** 2 for e in (THIRD, FIFTH))
        third, fifth = third.sum(axis=1), fifth.sum(axis=1)
        root = np.sqrt(np.maximum((fifth + 0.01 * third) * n, np.finfo(float).tiny))
        error = np.where(fifth > 0.0, h * fifth / root, 0.0)
        error = np.where(np.isfinite(slope_after).all(axis=1), error, np.nan)
        good = error < 1.0  # not of NaN
        factor = np.clip(SAFETY * np.maximum(error, 1e-12) ** -0.125, SHORTEST, LONGEST)
        factor = np.where(kept_back & good, np.minimum(factor, 1.0), factor)
        factor = np.where(np.isnan(factor), SHORTEST, factor)
        x, slope = np.where(good[:, None], after, x), np.where(good[:, None], slope_after, slope)
        arrived = good & (h >= rest)
        t = np.where(arrived, end, np.where(good, t + h, t))
        taken = taken + good
        longest = np.where(good, np.maximum(longest, h), longest)
        now = np.abs(x).max(axis=1)
        size = np.maximum(size, now)
        first = np.where(taken <= EARLY, np.maximum(first, now), first)
        rest, kept_back = end - t, ~good
        far = now > BEYOND * first
        slow = np.where(far, rest > h * MOST, taken * rest > longest * MOST**2) & (taken >= TRIAL)
        h = h * factor
        out = (taken > FEW) & ~((reach[0] <= x) & (x <= reach[1])).all(axis=1) & ~arrived
        f.undefined[cells[out]] = False
        for cell in cells[out & np.isin(cells, list(f.raised))]:
            del f.raised[int(cell)]
        lost = ~arrived & (out | slow | (taken >= MOST) | (h < 10.0 * np.spacing(np.abs(t))))
        found[on[arrived]] = x[arrived]
        stays = ~(arrived | lost)
        if not stays.all():
            on, cells, x, slope, t = on[stays], cells[stays], x[stays], slope[stays], t[stays]
            end, size, first, longest = end[stays], size[stays], first[stays], longest[stays]
            taken, kept_back, h, k = taken[stays], kept_back[stays], h[stays], k[:, stays]
    return found


def _allowed(atol: float, size: Array) -> Array:
    """Absolute errors that are allowed to motions that were as great."""
    return np.maximum(atol * np.minimum(size, 1.0), np.finfo(float).tiny)[:, None]


def _first_step(
    f: Together, cells: Index, t: Array, x: Array, slope: Array, leg: Array, rtol: float,
    atol: float,
) -> Array:  # fmt: skip
    """First steps, by [HairerNorsettWanner1993] section II.4, with the leg as the unit of time."""
    scale = _allowed(atol, np.abs(x).max(axis=1)) + rtol * np.abs(x)

    def rms(v: Array) -> Array:
        return np.asarray(np.sqrt(np.mean((v / scale) ** 2, axis=1)))

    d0, d1 = rms(x), rms(slope)
    little = TINY * leg  # where a state or its rate says nothing of times
    h = np.where((d0 < FAINT) | (d1 * leg < FAINT), little, 0.01 * d0 / np.maximum(d1, LEAST))
    h = np.minimum(h, leg)
    d2 = rms(f(t + h, x + h[:, None] * slope, cells) - slope) * leg / h
    steep = np.maximum(d1, d2) * leg
    fit = leg * (0.01 / np.maximum(steep, LEAST)) ** 0.125
    after = np.where(steep <= FLAT, np.maximum(little, 1e-3 * h), fit)
    h = np.minimum(np.minimum(100.0 * h, after), leg)
    ulp = np.finfo(float).eps * np.maximum(np.abs(t), np.abs(t + leg))
    return np.asarray(np.where(np.isfinite(h), np.maximum(h, 10.0 * ulp), leg))
