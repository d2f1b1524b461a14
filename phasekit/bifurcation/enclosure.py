"""All zeros of f in a box, proved: interval arithmetic excludes what holds none.

A box is dropped where a component of f cannot vanish in it. On the others Krawczyk's operator
K(X) = m - Y f(m) + (I - Y f'(X)) (X - m), Y close to the inverse of f'(m), decides: a zero in X
lies in K(X) as well, and where K(X) lies inside X there is exactly one [MooreKearfottCloud2009].
What is undecided is bisected, all boxes of a generation at once.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from phasekit.phase.numerical.intervals import Bounds
from phasekit.phase.numerical.rounding import Interval

Array = npt.NDArray[np.float64]
Flags = npt.NDArray[np.bool_]

#: Boxes of a generation beyond which the search stops, and says so.
MOST_BOXES = 1 << 16
#: Relative width at which a box that nothing decides is given up: a multiple zero, or a pole.
NARROW = 1e-9
#: Half the spacing of doubles next to one.
UNIT = 2.0**-53
#: A box is tested a little larger than it is, so that zeros on its faces lie inside.
INFLATED = 0.05


class Enclosed(NamedTuple):
    """Zeros, one a row; and the boxes (low, high) of which nothing is known."""

    zeros: Array
    undecided: tuple[Array, Array]

    @property
    def complete(self) -> bool:
        """Whether these are all, and each is one."""
        return not len(self.undecided[0])


class _System:
    """Bounds of f and its derivatives over boxes of the states, parameters being numbers."""

    def __init__(
        self, f: Sequence[Any], states: Sequence[Any], values: Mapping[Any, float]
    ) -> None:
        slopes = [row.diff(x) for row in f for x in states]
        self.n = len(states)
        self.bounds = Bounds([*f, *slopes], [*states, *values])
        self.parameters: list[Interval] = [(float(v), float(v)) for v in values.values()]

    def __call__(self, low: Array, high: Array) -> tuple[Interval, Interval, Flags]:
        """Bounds of f, of its derivatives, and where either may be undefined."""
        columns = [(low[:, i], high[:, i]) for i in range(self.n)]
        found, undefined = self.bounds(*columns, *self.parameters)
        ends = [np.stack([one[i] for one in found], axis=1) for i in (0, 1)]
        f = (ends[0][:, : self.n], ends[1][:, : self.n])
        shape = (-1, self.n, self.n)
        return (
            f,
            (ends[0][:, self.n :].reshape(shape), ends[1][:, self.n :].reshape(shape)),
            undefined,
        )


def zeros_in_box(
    f: Sequence[Any],
    states: Sequence[Any],
    values: Mapping[Any, float],
    low: npt.ArrayLike,
    high: npt.ArrayLike,
) -> Enclosed:
    """Return all zeros of f in a closed box.

    Parameters
    ----------
    f, states : sequence of sympy expressions and symbols
    values : mapping of symbol to float
        The parameters.
    low, high : array_like, shape (n,)
        Corners of the box.

    Raises
    ------
    phasekit.phase.numerical.intervals.NoRule
        If f holds a function of which no bounds are known.

    Examples
    --------
    >>> import sympy as sp
    >>> x, y = sp.symbols("x y")
    >>> found = zeros_in_box([x**2 + y**2 - 1, x - y], [x, y], {}, [-2, -2], [2, 2])
    >>> found.zeros.round(12).tolist(), found.complete
    ([[-0.707106781187, -0.707106781187], [0.707106781187, 0.707106781187]], True)
    """
    system = _System(f, states, values)
    whole = np.asarray(low, dtype=float), np.asarray(high, dtype=float)
    width = whole[1] - whole[0]
    # Nothing is cut that is only a few doubles wide.
    narrowest = np.maximum(NARROW * width, 8.0 * UNIT * np.max(np.abs(whole), axis=0))
    lows, highs = whole[0][None, :], whole[1][None, :]
    sure: list[tuple[Array, Array, Array]] = []
    lost: list[tuple[Array, Array]] = []
    while len(lows):
        if len(lows) > MOST_BOXES:
            lost.append((lows, highs))
            break
        keep, one, centers, lows, highs = _judge(system, lows, highs, width)
        sure += [(c, a, b) for c, a, b in zip(centers[one], lows[one], highs[one], strict=True)]
        keep &= ~one
        narrow = np.all(highs - lows <= narrowest, axis=1) & keep
        if narrow.any():
            lost.append((lows[narrow], highs[narrow]))
        lows, highs = _halved(lows[keep & ~narrow], highs[keep & ~narrow], width)
    zeros = _once(system, sure, whole)
    empty = np.empty((0, system.n))
    rest = [np.concatenate([part[i] for part in lost]) if lost else empty for i in (0, 1)]
    return Enclosed(zeros, (rest[0], rest[1]))


def _judge(
    system: _System, low: Array, high: Array, width: Array
) -> tuple[Flags, Flags, Array, Array, Array]:
    """Which boxes may hold a zero, which hold exactly one, its place, and the boxes, contracted."""
    around = INFLATED * (high - low) + 1e-15 * width
    wide_low, wide_high = low - around, high + around
    f, slopes, undefined = system(low, high)
    possible = np.all((f[0] <= 0.0) & (f[1] >= 0.0), axis=1) | undefined
    middle = 0.5 * (low + high)
    at, _, away = system(middle, middle)
    _, slopes, beyond = system(wide_low, wide_high)
    usable = possible & ~undefined & ~away & ~beyond
    usable &= np.all(np.isfinite(slopes[0]) & np.isfinite(slopes[1]), axis=(1, 2))
    center = 0.5 * (slopes[0] + slopes[1])
    usable &= np.abs(np.linalg.det(np.where(usable[:, None, None], center, 0.0))) > 0.0
    inverse = np.zeros_like(center)
    inverse[usable] = np.linalg.inv(center[usable])
    usable &= np.all(np.isfinite(inverse), axis=(1, 2))
    inverse[~usable] = 0.0
    # Radii: |Y f(m)| and |I - Y f'(X)| |X - m|, with room for rounding.
    with np.errstate(all="ignore"):
        value = 0.5 * (at[0] + at[1])
        blur = 0.5 * (at[1] - at[0])
        # A sum of n products is off by n rounded units at most, of the products' sizes.
        rounding = UNIT * (2 * system.n + 6)
        step = np.einsum("kij,kj->ki", inverse, value)
        size = np.abs(inverse)
        error = np.einsum("kij,kj->ki", size, blur + rounding * np.abs(value))
        spread = 0.5 * (slopes[1] - slopes[0]) + rounding * np.abs(center)
        eye = np.eye(system.n)
        off = np.abs(eye - np.einsum("kij,kjl->kil", inverse, center))
        off += np.einsum("kij,kjl->kil", size, spread)
        off += rounding * eye
        reach = np.maximum(wide_high - middle, middle - wide_low)
        radius = (error + np.einsum("kij,kj->ki", off, reach)) * (1.0 + 2.0 * rounding)
    radius += 4.0 * UNIT * (np.abs(middle) + np.abs(step))
    k_low, k_high = middle - step - radius, middle - step + radius
    one = usable & np.all((k_low > wide_low) & (k_high < wide_high), axis=1)
    apart = usable & np.any((k_low > high) | (k_high < low), axis=1)
    keep = possible & ~apart
    one &= keep
    tight = usable & ~one
    new_low = np.where(tight[:, None], np.maximum(low, k_low), low)
    new_high = np.where(tight[:, None], np.minimum(high, k_high), high)
    out_low = np.where(one[:, None], wide_low, new_low)
    out_high = np.where(one[:, None], wide_high, new_high)
    return keep, one, middle - step, out_low, out_high


def _halved(low: Array, high: Array, width: Array) -> tuple[Array, Array]:
    """Boxes cut across their longest side, in units of the whole box."""
    if not len(low):
        return low, high
    side = np.argmax((high - low) / width, axis=1)
    rows = np.arange(len(low))
    cut = 0.5 * (low[rows, side] + high[rows, side])
    left, right = high.copy(), low.copy()
    left[rows, side] = right[rows, side] = cut
    return np.concatenate([low, right]), np.concatenate([left, high])


def _once(
    system: _System, sure: list[tuple[Array, Array, Array]], whole: tuple[Array, Array]
) -> Array:
    """Each zero once, to rounding, and inside the whole box."""
    kept: list[tuple[Array, Array, Array]] = []
    for start, low, high in sure:
        x = _refined(system, start, low, high)
        # A box in which a zero is the only one tells whether another's is the same.
        if any(np.all((x >= a) & (x <= b)) or np.all((y >= low) & (y <= high)) for y, a, b in kept):
            continue
        kept.append((x, low, high))
    slack = 4e-16 * np.maximum(np.abs(whole[0]), np.abs(whole[1]))
    inside = [
        np.clip(x, *whole)
        for x, _, _ in kept
        if np.all((x >= whole[0] - slack) & (x <= whole[1] + slack))
    ]
    return np.array(sorted(inside, key=tuple)).reshape(-1, system.n)


def _refined(system: _System, x: Array, low: Array, high: Array) -> Array:
    """Newton's method inside the box in which the zero is the only one."""
    best, least = x, np.inf
    for _ in range(60):
        f, slopes, _ = system(x[None, :], x[None, :])
        value, slope = 0.5 * (f[0] + f[1])[0], 0.5 * (slopes[0] + slopes[1])[0]
        step = np.linalg.solve(slope, value)
        size = float(np.max(np.abs(step) / (high - low)))
        if not size < least:
            break
        best, least = x, size
        x = np.clip(x - step, low, high)
    return best
