"""Sums of a few harmonics: their greatest value, and how much area they leave above zero."""

from __future__ import annotations

from fractions import Fraction
from typing import Any

import numpy as np

from phasekit.arrays import Array, Complex
from phasekit.numerics.contract import contract

#: Frequencies count as commensurate if their ratios are those of whole numbers up to this.
WHOLE = 48
#: Samples for each turn of the fastest harmonic.
SAMPLES = 64


def reach(Z: Complex, frequency: Array, sign: Array) -> tuple[Array, Array]:
    """Greatest value of ``sign Re sum Z_j e^{i nu_j t}``, and the area above zero in one period.

    Amplitudes Z and frequencies have the harmonics on the last axis; sign is 1 or -1. Over all
    times, and NaN in place of the area, where the frequencies have no common period.
    """
    total = Z.sum(axis=-1)
    same = (frequency == frequency[..., :1]).all(axis=-1)
    greatest = np.where(same, np.abs(total), np.nan)
    area = 2.0 * greatest / frequency[..., 0]
    rows = np.argwhere(~same & np.isfinite(total) & np.isfinite(frequency).all(axis=-1))
    if rows.size:
        index = tuple(rows.T)
        kinds, which = np.unique(frequency[index], axis=0, return_inverse=True)
        which = which.reshape(-1)
        for kind, nu in enumerate(kinds):
            cells = tuple(axis[which == kind] for axis in index)
            greatest[cells], area[cells] = _of_kind(Z[cells], nu, sign[cells])
    return greatest, area


def _of_kind(Z: Complex, nu: Array, sign: Array) -> tuple[Array, Array]:
    """The same for cells of the same frequencies."""
    numbers = _whole(nu)
    if numbers is None:
        kinds = np.unique(nu)
        merged = [np.abs(Z[:, nu == one].sum(axis=-1)) for one in kinds]
        return np.sum(merged, axis=0), np.full(len(Z), np.nan)
    base = nu[0] / numbers[0]
    count = SAMPLES * int(numbers.max())
    t = 2.0 * np.pi * np.arange(count + 1) / count
    turns = np.exp(1j * np.outer(numbers, t))
    values = sign[:, None] * contract(Z, turns.T).real
    primitive = sign[:, None] * contract(Z / numbers, turns.T).imag
    return _peak(Z * sign[:, None], numbers, t, values), _above(
        values, primitive, Z, numbers, t, sign
    ) / base


def _whole(nu: Array) -> Any:
    """Whole numbers in the ratios of the frequencies, or None."""
    ratios = [Fraction(float(x / nu[0])).limit_denominator(WHOLE) for x in nu]
    if any(abs(float(r) * nu[0] - x) > 1e-12 * x for r, x in zip(ratios, nu, strict=True)):
        return None
    below = int(np.lcm.reduce([r.denominator for r in ratios]))
    numbers = np.array([int(r * below) for r in ratios])
    return numbers if numbers.max() <= WHOLE**2 and numbers.min() > 0 else None


def _peak(Z: Complex, numbers: Any, t: Array, values: Array) -> Array:
    """Greatest value, by Newton's method from the greatest sample."""
    at = t[np.argmax(values, axis=1)]
    best = np.max(values, axis=1)
    for _ in range(4):
        turn = Z * np.exp(1j * at[:, None] * numbers)
        slope, bend = -(turn * numbers).imag.sum(-1), -(turn * numbers**2).real.sum(-1)
        at = at - np.where(bend < 0.0, slope / np.where(bend < 0.0, bend, 1.0), 0.0)
        best = np.maximum(best, (Z * np.exp(1j * at[:, None] * numbers)).real.sum(-1))
    return np.asarray(best)


def _above(
    values: Array, primitive: Array, Z: Complex, numbers: Any, t: Array, sign: Array
) -> Array:
    """Area above zero, which is half of that on both sides: the mean is zero."""
    step = np.diff(primitive, axis=1)
    here, there = values[:, :-1], values[:, 1:]
    crosses = here * there < 0.0
    ratio = np.where(crosses, here / np.where(crosses, here - there, 1.0), 0.0)
    at = t[:-1] + ratio * (t[1] - t[0])
    middle = np.zeros(values[:, :-1].shape)
    for j, number in enumerate(numbers):
        middle += (Z[:, j, None] / number * np.exp(1j * number * at)).imag
    middle *= sign[:, None]
    parts = np.abs(middle - primitive[:, :-1]) + np.abs(primitive[:, 1:] - middle)
    return np.asarray(0.5 * np.where(crosses, parts, np.abs(step)).sum(axis=1))
