"""All equilibria of x'' = -V'(x), with their types."""

from __future__ import annotations

from fractions import Fraction
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from phasekit.arrays import Array, Flags
from phasekit.arrays import Ints as Index
from phasekit.errors import EquilibriumKind
from phasekit.phase.numerical.digits import doubled
from phasekit.phase.numerical.formula import Shape
from phasekit.phase.numerical.formula_bounds import slope_bounds
from phasekit.phase.numerical.isolation import bracketed, isolate
from phasekit.phase.numerical.partition import noise_at, partition
from phasekit.phase.numerical.places import Places, located
from phasekit.phase.numerical.series import (
    Roots,
    exact_base,
    exact_heights,
    of_fourier_sums,
    of_polynomials,
)
from phasekit.phase.numerical.systems import Systems

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
    complete: Flags
    """Whether it is proved that there are these and no others."""
    gaps: npt.NDArray[np.float64]
    """Ends (low, high) of the widest stretch that could not be excluded, nor stands for an
    equilibrium; else NaN."""
    n_gaps: npt.NDArray[np.int64]
    """Number of such stretches."""
    phi_error: Array
    """Bound of the error of `phi`; NaN where there is none."""


class Zeros(NamedTuple):
    """Zeros of V', rising, NaN beyond those that there are; the sign of V'' there, 0 if merged."""

    phi: Array
    sign: Array
    complete: Flags
    gaps: Array
    n_gaps: npt.NDArray[np.int64]


def equilibria(systems: Systems, *, counted: bool = False) -> Equilibria:
    """All equilibria of each system; if they are only counted, without what places lack.

    Polynomials and Fourier sums: `phasekit.phase.numerical.series`. Anything else on a stretch, and
    what that leaves open on a circle: `phasekit.phase.numerical.isolation`. Neither needs a
    tolerance. What is left, V' and V'' vanish at within rounding, is one equilibrium, degenerate,
    and the system's equilibria are not complete: there may be several, or none. Nor are those of
    functions of which no bounds are known; they are found as far as Chebyshev polynomials of degree
    24 on pieces represent V.
    """
    shape = systems.formula.shape
    exact: dict[int, list[Fraction]] = {}
    if shape is Shape.GENERAL:
        proved = slope_bounds(systems.formula) is not None
        zeros = _isolated(systems) if proved else _sampled(systems)
    else:
        polynomial = shape is Shape.POLYNOMIAL
        roots = of_polynomials(systems) if polynomial else of_fourier_sums(systems)
        exact = roots.exact
        with np.errstate(all="ignore"):
            zeros = _of_roots(systems, roots)
        rest = np.flatnonzero(~roots.clear & systems.finite)
        if rest.size:
            few = systems.take(rest)
            proved = not polynomial and slope_bounds(systems.formula) is not None
            zeros = _replaced(zeros, rest, _isolated(few) if proved else _sampled(few))
    if counted:
        return _collect(systems, zeros, np.full(zeros.phi.shape, np.nan))
    found = _collect(systems, *_placed(systems, zeros, exact))
    return _sharp(systems, found, exact)


def _placed(
    systems: Systems, zeros: Zeros, exact: dict[int, list[Fraction]]
) -> tuple[Zeros, Array]:
    """Zeros with all digits that V' has, and their errors; exact ones are the nearest doubles."""
    phi = zeros.phi.copy()
    error = np.maximum(0.5 * np.spacing(np.abs(phi)), np.nextafter(0.0, 1.0))
    inexact = np.ones(systems.size, dtype=bool)
    inexact[list(exact)] = False
    cell, slot = np.nonzero(np.isfinite(phi) & inexact[:, None])
    found, sign = zeros.phi[cell, slot], zeros.sign[cell, slot]
    places = Places(systems.take(cell), found, sign, cell, zeros.phi)
    phi[cell, slot], error[cell, slot] = located(places)
    return zeros._replace(phi=phi), error


def _isolated(systems: Systems) -> Zeros:
    found = isolate(systems)
    gaps = np.full((systems.size, 2), np.nan)
    for i, stretches in enumerate(found.unproved):
        if stretches:
            gaps[i] = max(stretches, key=lambda stretch: stretch[1] - stretch[0])
    count = np.array([len(stretches) for stretches in found.unproved], np.int64)
    return Zeros(_wrapped(systems, found.phi), found.sign, found.complete, gaps, count)


def _of_roots(systems: Systems, roots: Roots) -> Zeros:
    """Zeros in the interval, to the last digit where V' has opposite signs about them."""
    phi, sign = roots.phi.copy(), roots.sign.copy()
    reach = np.maximum(roots.radius, 4.0 * np.spacing(np.abs(phi)))
    reach[list(roots.exact)] = np.nan
    low, high = phi - reach, phi + reach
    found = systems.slope(low) * systems.slope(high) < 0.0
    cell, slot = np.nonzero(found)
    few = systems.take(cell)
    phi[cell, slot] = bracketed(few, low[cell, slot], high[cell, slot])
    if systems.formula.interval is not None:
        # The ends belong to it, and what lies within rounding of them.
        first, last = systems.formula.ends
        outside = (phi < first - np.spacing(abs(first))) | (phi > last + np.spacing(abs(last)))
        phi, sign = (
            np.where(outside, np.nan, values) for values in (np.clip(phi, first, last), sign)
        )
    gaps = np.full((systems.size, 2), np.nan)
    none = np.zeros(systems.size, np.int64)
    return Zeros(_wrapped(systems, phi), sign, roots.clear, gaps, none)


def _replaced(zeros: Zeros, rows: Index, others: Zeros) -> Zeros:
    width = max(zeros.phi.shape[1], others.phi.shape[1])
    fields = []
    for one, other in ((zeros.phi, others.phi), (zeros.sign, others.sign)):
        field = np.full((len(one), width), np.nan)
        field[:, : one.shape[1]] = one
        field[rows] = np.nan
        field[rows, : other.shape[1]] = other
        fields.append(field)
    complete, gaps, n_gaps = zeros.complete.copy(), zeros.gaps.copy(), zeros.n_gaps.copy()
    complete[rows], gaps[rows], n_gaps[rows] = others.complete, others.gaps, others.n_gaps
    return Zeros(fields[0], fields[1], complete, gaps, n_gaps)


def _wrapped(systems: Systems, x: Array) -> Array:
    period = systems.formula.period
    return x if period is None else 0.5 * period - (0.5 * period - x) % period


def _sampled(systems: Systems) -> Zeros:
    """Zeros of V' between neighboring zeros of V'', where it is monotone.

    Where V' at such a point is 0 within its rounding, equilibria have merged: they are one,
    degenerate.
    """
    points, noise = partition(systems)
    with np.errstate(all="ignore"):
        points = _polish(systems, points)
        slope = systems.slope(points)
        points = np.where(np.isnan(slope), np.nan, points)  # which would hide what lies beside
        sign = np.where(np.abs(slope) <= noise, 0.0, np.sign(slope))
        if systems.formula.shape is Shape.POLYNOMIAL and systems.formula.interval is None:
            # Far out only the leading power counts, which no rounding hides.
            sign = np.where(sign == 0.0, _outer_signs(points, slope), sign)
        found, degenerate = _roots(systems, points, sign, noise)
        bend = np.sign(systems.bend(found))
    unsure = np.zeros(systems.size, dtype=bool)
    gaps = np.full((systems.size, 2), np.nan)
    if systems.formula.shape is Shape.GENERAL:
        gaps[:] = systems.formula.ends
    count = np.isfinite(gaps[:, 0]).astype(np.int64)
    signs = np.where(degenerate, 0.0, bend)
    return Zeros(_wrapped(systems, found), signs, unsure, gaps, count)


def _polish(systems: Systems, points: Array) -> Array:
    """Move points to the zeros of V'' next to them; only steps that make V'' smaller are taken."""
    low, high = systems.formula.ends
    spread = np.nanmax(points, axis=1, keepdims=True) - np.nanmin(points, axis=1, keepdims=True)
    step = 1e-4 * (spread if not np.isfinite(low) else high - low)
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
    before_noise = noise[cell, np.maximum(slot - 1, 0)]
    degenerate[cell, slot] = _merged(
        few, root, noise_at(few, root, before_noise, noise[cell, slot])
    )
    touched_at = np.stack(touch, axis=1)
    found[:, columns:] = touched_at
    degenerate[:, columns:] = np.isfinite(touched_at)
    return found, degenerate


def _merged(systems: Systems, root: Array, noise: Array) -> npt.NDArray[np.bool_]:
    """Whether V'' changes over the stretch on which rounding hides V': not a simple zero."""
    bend = systems.bend(root)
    reach = np.where(bend == 0.0, 0.0, noise / np.abs(bend))
    changed = [np.abs(systems.bend(root + s * reach) - bend) for s in (1.0, -1.0)]
    return np.asarray((bend == 0.0) | ~(np.maximum(*changed) < 0.5 * np.abs(bend)))


def _collect(systems: Systems, zeros: Zeros, error: Array) -> Equilibria:
    order = np.argsort(zeros.phi, axis=1)  # NaN last
    found = np.take_along_axis(zeros.phi, order, axis=1) + 0.0  # no -0.0
    sign, error = (np.take_along_axis(field, order, axis=1) for field in (zeros.sign, error))
    count = np.isfinite(found).sum(axis=1)
    most = int(count.max(initial=0))
    found, sign, error = (field[:, :most] for field in (found, sign, error))
    there = np.isfinite(found)
    with np.errstate(invalid="ignore"):
        kind = np.where(sign == 0.0, DEGENERATE, np.where(sign > 0.0, CENTER, SADDLE))
    kind = np.where(there, kind, ABSENT).astype(np.int8)
    heights = systems.potential(found), systems.bend(found)
    valid = systems.finite
    number = np.where(valid, count, -1).astype(np.int16)
    complete = zeros.complete & valid
    scales = _scales(kind, *heights)
    return Equilibria(found, kind, *scales, number, complete, zeros.gaps, zeros.n_gaps, error)


def _scales(kind: Any, energy: Array, curvature: Array) -> tuple[Array, Array, Array, Array]:
    """Energies, curvatures, frequencies and exponents, by kinds that are proved."""
    # Rounding may have turned the sign of a value next to 0.
    size = np.where(kind == ABSENT, np.nan, np.where(kind == DEGENERATE, 0.0, np.abs(curvature)))
    center, saddle = (np.where(kind == one, np.sqrt(size), np.nan) for one in (CENTER, SADDLE))
    return energy + 0.0, np.where(kind == SADDLE, -size, size), center, saddle


def _sharp(systems: Systems, found: Equilibria, exact: dict[int, list[Fraction]]) -> Equilibria:
    """Equilibria with all digits of V and V'' that the formula allows."""
    energy, curvature = found.energy.copy(), found.curvature.copy()
    cell, slot = np.nonzero(np.isfinite(found.phi))
    fine = doubled(systems.take(cell), found.phi[cell, slot], 0, 2)
    if fine is None and not exact:
        return found
    for field, (value, rest, _) in zip((energy, curvature), fine or (), strict=False):
        usable = np.isfinite(value) & np.isfinite(rest)
        field[cell[usable], slot[usable]] = value[usable]
    for row, coefficients in exact.items():
        at = found.phi[row, np.isfinite(found.phi[row])]
        base = exact_base(systems.formula, tuple(float(p[row]) for p in systems.parameters))
        energy[row, : at.size], curvature[row, : at.size] = exact_heights(base, coefficients, at)
    one, two, three, four = _scales(found.kind, energy, curvature)
    return found._replace(energy=one, curvature=two, natural_frequency=three, exponent=four)
