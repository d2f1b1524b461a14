"""All equilibria of x'' = -V'(x), with their types."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from phasekit.errors import EquilibriumKind
from phasekit.phase.numerical.candidates import partition
from phasekit.phase.numerical.formula import Shape
from phasekit.phase.numerical.systems import Systems

Array = npt.NDArray[np.float64]
CENTER, SADDLE = EquilibriumKind.CENTER.value, EquilibriumKind.SADDLE.value
DEGENERATE, ABSENT = EquilibriumKind.DEGENERATE.value, EquilibriumKind.ABSENT.value


class Equilibria(NamedTuple):
    """Equilibria of each system from left to right, on the last axis; absent ones are NaN."""

    phi: Array
    """Coordinate; on a circle in (-period/2, period/2]."""
    kind: npt.NDArray[np.int8]
    """`EquilibriumKind`."""
    energy: Array
    """V."""
    curvature: Array
    """V''; exactly 0 where degenerate."""
    natural_frequency: Array
    """sqrt(V'') of centers."""
    exponent: Array
    """sqrt(-V'') of saddles."""
    n_equilibria: npt.NDArray[np.int16]
    """Number of distinct equilibria; 0 where V is constant, -1 where a parameter is not finite."""


def equilibria(systems: Systems) -> Equilibria:
    """All equilibria of each system.

    Between neighboring zeros of V'' the slope V' is monotone, so it has one zero if its sign
    changes and none otherwise. Where V' at such a point is 0 within its rounding, equilibria have
    merged: they are one, degenerate.

    Raises
    ------
    ConvergenceError
        If the potential is neither a polynomial nor a Fourier sum, and is not smooth on its
        interval.

    Notes
    -----
    Complete for polynomials and Fourier sums. Any other potential is interpolated in Chebyshev
    polynomials of degree 24 on pieces, halved until the series has converged; equilibria are
    complete as far as the interpolant is V.
    """
    points, noise = partition(systems)
    period = systems.formula.period
    with np.errstate(all="ignore"):
        points = _polish(systems, points)
        slope = systems.slope(points)
        sign = np.where(np.abs(slope) <= noise, 0.0, np.sign(slope))
        if systems.formula.shape is Shape.POLYNOMIAL and systems.formula.interval is None:
            # Far out only the leading power counts, which no rounding hides.
            sign = np.where(sign == 0.0, _outer_signs(points, slope), sign)
        found, degenerate = _roots(systems, points, sign, noise)
    if period is not None:
        found = 0.5 * period - (0.5 * period - found) % period
    return _collect(systems, found, degenerate)


def _polish(systems: Systems, points: Array) -> Array:
    """Move points to the zeros of V'' next to them; only steps that make V'' smaller are taken."""
    low, high = systems.formula.ends
    step = 1e-4 * (1.0 if not np.isfinite(low) else high - low)
    inside = (points > low) & (points < high)
    bend = systems.bend(points)
    for _ in range(3):
        width = 1e-6 * step
        rate = (systems.bend(points + width) - systems.bend(points - width)) / (2.0 * width)
        moved = points - np.clip(bend / rate, -step, step)
        there = systems.bend(moved)
        better = inside & (np.abs(there) < np.abs(bend)) & (moved > low) & (moved < high)
        points, bend = np.where(better, moved, points), np.where(better, there, bend)
    order = np.argsort(points, axis=1)
    return np.take_along_axis(points, order, axis=1)


def _outer_signs(points: Array, slope: Array) -> Array:
    count = np.sum(np.isfinite(points), axis=1)
    last = np.arange(points.shape[1]) == (count - 1)[:, None]
    first = np.arange(points.shape[1]) == 0
    return np.where(first | last, np.sign(slope), 0.0)


def _roots(
    systems: Systems, points: Array, sign: Array, noise: Array
) -> tuple[Array, npt.NDArray[np.bool_]]:
    """Zeros of V' between points where its sign changes, and where it touches 0."""
    period = systems.formula.period
    size, columns = points.shape
    rows = np.arange(size)
    low: list[Array] = []
    high: list[Array] = []
    touch: list[Array] = []
    # What lies before the first point: on a circle what lies before the cut.
    before, behind = np.full(size, np.nan), np.zeros(size)
    flat = np.full(size, np.nan)  # a point without slope since then
    passes = (False, True) if period is not None else (True,)
    for recording in passes:
        for j in range(columns):
            x, s = points[:, j], sign[:, j]
            there = np.isfinite(x)
            crossed = there & (s * behind < 0.0)
            touched = there & (s * behind > 0.0) & np.isfinite(flat)
            if recording:
                low.append(np.where(crossed, before, np.nan))
                high.append(np.where(crossed, x, np.nan))
                touch.append(np.where(touched, flat, np.nan))
            steep = there & (s != 0.0)
            before, behind = np.where(steep, x, before), np.where(steep, s, behind)
            flat = np.where(steep, np.nan, np.where(there & np.isnan(flat), x, flat))
        if not recording and period is not None:
            before, flat = before - period, flat - period
    found = np.full((size, 2 * columns), np.nan)
    degenerate = np.zeros(found.shape, dtype=bool)
    if not columns:
        return found, degenerate
    left, right = np.stack(low, axis=1), np.stack(high, axis=1)
    cell, slot = np.nonzero(np.isfinite(left))
    few = systems.take(rows[cell])
    root = bracketed(few, left[cell, slot], right[cell, slot])
    found[cell, slot] = root
    degenerate[cell, slot] = _merged(few, root, noise[cell, slot])
    touched_at = np.stack(touch, axis=1)
    found[:, columns:] = touched_at
    degenerate[:, columns:] = np.isfinite(touched_at)
    return found, degenerate


def bracketed(systems: Systems, low: Array, high: Array) -> Array:
    """Zeros of V' between points where it has opposite signs: Newton's method, safeguarded."""
    rising = systems.slope(high) > 0.0
    x = 0.5 * (low + high)
    for _ in range(200):
        slope = systems.slope(x)
        under = (slope < 0.0) == rising
        low, high = np.where(under, x, low), np.where(under, high, x)
        step = x - slope / systems.bend(x)
        middle = 0.5 * (low + high)
        inside = (step > low) & (step < high)
        fresh = np.where(slope == 0.0, x, np.where(inside, step, middle))
        # Newton's method may creep from one side; then the bracket is halved.
        slow = np.abs(fresh - x) > 0.5 * (high - low)
        fresh = np.where(slow, middle, fresh)
        still = (fresh == x) | (high - low <= np.spacing(np.abs(x)))
        if np.all(still | np.isnan(x)):
            return fresh
        x = fresh
    return x


def _merged(systems: Systems, root: Array, noise: Array) -> npt.NDArray[np.bool_]:
    """Whether V'' changes over the stretch on which rounding hides V': not a simple zero."""
    bend = systems.bend(root)
    reach = np.where(bend == 0.0, 0.0, noise / np.abs(bend))
    changed = [np.abs(systems.bend(root + s * reach) - bend) for s in (1.0, -1.0)]
    return np.asarray((bend == 0.0) | ~(np.maximum(*changed) < 0.5 * np.abs(bend)))


def _collect(systems: Systems, found: Array, degenerate: npt.NDArray[np.bool_]) -> Equilibria:
    order = np.argsort(found, axis=1)  # NaN last
    found = np.take_along_axis(found, order, axis=1)
    degenerate = np.take_along_axis(degenerate, order, axis=1)
    there = np.isfinite(found)
    count = there.sum(axis=1)
    most = int(count.max(initial=0))
    found, degenerate, there = found[:, :most], degenerate[:, :most], there[:, :most]
    curvature = np.where(degenerate, 0.0, systems.bend(found))
    with np.errstate(invalid="ignore"):
        kind = np.where(degenerate, DEGENERATE, np.where(curvature > 0.0, CENTER, SADDLE))
        kind = np.where(there, kind, ABSENT).astype(np.int8)
        center = np.where(kind == CENTER, np.sqrt(np.abs(curvature)), np.nan)
        saddle = np.where(kind == SADDLE, np.sqrt(np.abs(curvature)), np.nan)
    valid = np.all([np.isfinite(p) for p in systems.parameters], axis=0)
    number = np.where(valid, count, -1).astype(np.int16)
    found = found + 0.0  # no -0.0
    energy = systems.potential(found) + 0.0
    curvature = np.where(there, curvature, np.nan)
    return Equilibria(found, kind, energy, curvature, center, saddle, number)
