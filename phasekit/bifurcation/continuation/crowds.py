"""Steps in which several eigenvalues cross the axis, or one crosses it and returns.

Test functions change their signs for an odd number of them alone. With the projectors P and Q on
what grows at both ends, trace(P (1 - Q)) is how many stop to grow, trace(Q (1 - P)) how many begin.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from phasekit.arrays import Array, Complex, Flags
from phasekit.bifurcation.continuation.curve import Curve
from phasekit.bifurcation.continuation.kernels import scan

WHOLE = 0.25  # distance of a trace from the whole number that it stands for
DIP = 0.3  # part of its values to which a parabola or cubic falls that may touch zero
LOW = 0.6  # part of its neighbours' values that a point has next to one
BESIDE = 1e-11  # of the largest entry, by which matrices are moved for vectors


def falls(left: Array, middle: Array, right: Array) -> Flags:
    """Whether a function may touch zero next to the second of three points in a row, the least."""
    bend = left - 2.0 * middle + right
    with np.errstate(all="ignore"):  # the parabola through three points, at its lowest
        lowest = middle - (right - left) ** 2 / (8.0 * bend)
    low = (lowest < DIP * middle) | (middle < LOW * np.minimum(left, right))
    return np.asarray((middle <= left) & (middle <= right) & low)


def crowded(curve: Curve, slopes: Array, values: Complex) -> Flags:
    """Between which points in a row more may cross the axis, or return to it, than signs tell."""
    count = len(values)
    marks = np.zeros((max(count - 1, 0), scan.STEPS), np.int64)
    if count > 1 and curve.n > 1:
        n = curve.n
        flat = np.ascontiguousarray(slopes[..., :n]).reshape(count, n * n)
        growth = np.ascontiguousarray(curve.growth(values))
        scan.crowds(flat, curve.scale[:n].copy(), growth, values.imag.copy(), marks)
    return np.asarray(marks[:, scan.CROWDED] > 0)


def paces_of(curve: Curve, u: Array, slopes: Array) -> Array:
    """How fast f_x moves along a path at points in a row, by parabolas through three of them."""
    chords = np.diff(u, axis=0)
    length = np.sqrt(np.sum(curve.weight * chords * chords, axis=1))[:, None, None]
    with np.errstate(all="ignore"):  # points that are the same
        rates = np.diff(slopes, axis=0) / length
        one, two = length[:-1], length[1:]
        middle = (two * rates[:-1] + one * rates[1:]) / (one + two)
    if not len(middle):
        return np.concatenate([rates, rates])
    return np.concatenate([2.0 * rates[:1] - middle[:1], middle, 2.0 * rates[-1:] - middle[-1:]])


class Steps(NamedTuple):
    """Steps of a curve, by what is known at both ends: the first axis of each."""

    curve: Curve
    u: Array  # shape (2, steps, unknowns)
    tangent: Array
    slopes: Array  # shape (2, steps, n, unknowns)
    paces: Array | None = None  # how fast these move along the path, if that is known


def doubtful(steps: Steps) -> tuple[Flags, Array]:
    """Whether more may cross than signs tell, in each of several steps, and how many both ways."""
    return doubtful_of_all([steps])[0]


def doubtful_of_all(parts: Sequence[Steps]) -> list[tuple[Flags, Array]]:
    """The same of curves that differ in their parameters and scales; one by one if not at once."""
    if not parts:
        return []
    try:
        doubt, both = _doubtful(parts)
    except np.linalg.LinAlgError:
        if len(parts) > 1:
            return [doubtful(one) for one in parts]
        count = parts[0].u.shape[1]
        return [(np.ones(count, dtype=bool), np.zeros(count))]
    if len(parts) == 1:
        return [(doubt, both)]
    ends = np.cumsum([one.u.shape[1] for one in parts])[:-1]
    return list(zip(np.split(doubt, ends), np.split(both, ends), strict=True))


def _doubtful(parts: Sequence[Steps]) -> tuple[Flags, Array]:
    """The same in one row."""
    curve = parts[0].curve
    scale = np.concatenate(
        [np.tile(one.curve.scale[: curve.n], (one.u.shape[1], 1)) for one in parts]
    )
    slopes = np.concatenate([one.slopes for one in parts], axis=1)
    matrices = _scaled(scale, curve.linear(slopes))
    values, vectors, inverse = _modes(matrices, beside=len(parts) == 1)
    growth = curve.growth(values)
    grows = (growth > 0.0).astype(float)
    shared = (inverse[0] @ vectors[1]) * (inverse[1] @ vectors[0]).swapaxes(-1, -2)
    one, two = grows[0][:, :, None], grows[1][:, None, :]
    stops, begins = one * (1.0 - two) * shared.real, (1.0 - one) * two * shared.real
    stop, begin = stops.sum(axis=(-1, -2)), begins.sum(axis=(-1, -2))
    turns = (values[0].imag != 0.0)[:, :, None] & (values[1].imag != 0.0)[:, None, :]
    pairs = ((stops + begins) * turns).sum(axis=(-1, -2))
    both = np.minimum(stop, begin)
    unclear = np.maximum(np.abs(stop - np.rint(stop)), np.abs(begin - np.rint(begin))) > WHOLE
    whole = stop + begin
    single = (whole <= 1.0 + WHOLE) | ((whole <= 2.0 + WHOLE) & (pairs >= 2.0 - WHOLE))
    doubt = ~(both <= WHOLE) | ~single | unclear
    if not curve.discrete:
        bent = _scaled(scale, np.concatenate([_bent(one) for one in parts], axis=1))
        speeds = ((inverse @ bent) * vectors.swapaxes(-1, -2)).sum(axis=-1).real
        doubt |= _come_back(growth, speeds, np.argmax(np.abs(shared), axis=-1))
    return doubt, np.where(unclear | ~np.isfinite(both), 0.0, np.rint(both))


def places(curve: Curve, slopes: Array) -> Array:
    """Where on a step eigenvalues cross the axis, in order: by lines through their real parts.

    slopes shape (2, n, unknowns).
    """
    try:
        values, vectors, inverse = _modes(_scaled(curve.scale[: curve.n], slopes))
    except np.linalg.LinAlgError:
        return np.zeros(0)
    growth = curve.growth(values)
    shared = np.abs((inverse[0] @ vectors[1]) * (inverse[1] @ vectors[0]).T)
    order = np.argmax(shared, axis=-1)
    if len(set(order.tolist())) < len(order):
        growth, order = np.sort(growth, axis=-1), np.arange(len(order))
    one, two = growth[0], growth[1][order]
    cross = (one > 0.0) != (two > 0.0)
    return np.asarray(np.sort(one[cross] / (one[cross] - two[cross])))


def _scaled(scale: Array, slopes: Array) -> Array:
    """f_x in units of the scales of states, which each matrix may have its own of."""
    sizes = scale[..., None, :]
    return np.asarray(slopes[..., : scale.shape[-1]] * sizes / sizes.swapaxes(-1, -2))


def _modes(matrices: Array, *, beside: bool = True) -> tuple[Complex, Complex, Complex]:
    """Eigenvalues, vectors and their inverses; of double ones those of matrices beside, or none."""
    values, vectors = np.linalg.eig(matrices)
    try:
        inverse = np.linalg.inv(vectors)
    except np.linalg.LinAlgError:
        if not beside:
            raise
        n = matrices.shape[-1]
        size = np.max(np.abs(matrices), axis=(-1, -2), keepdims=True)
        values, vectors = np.linalg.eig(
            matrices + BESIDE * size * np.cos(np.arange(n * n) ** 2.0).reshape(n, n)
        )
        inverse = np.linalg.inv(vectors)
    return tuple(one.astype(complex) for one in (values, vectors, inverse))  # type: ignore[return-value]


def _bent(steps: Steps) -> Array:
    """How far f_u would move from each end at the pace that it has there."""
    curve, u, tangent, _, paces = steps
    if paces is None:
        m = curve.m
        bent = curve.bend_all(u.reshape(-1, u.shape[-1]), tangent.reshape(-1, u.shape[-1])[:, :m])
        paces = bent.reshape(*u.shape[:2], curve.n, m)
    chord = u[1] - u[0]
    length = np.sqrt(np.sum(curve.weight * chord * chord, axis=-1))
    return np.asarray(paces * length[:, None, None])


def _come_back(parts: Array, speeds: Array, order: npt.NDArray[np.intp]) -> Flags:
    """Whether an eigenvalue may cross the axis and return, by cubics of their real parts."""
    side = np.sign(parts[0])
    low, high = side * parts[0], side * np.take_along_axis(parts[1], order, axis=-1)
    down, up = side * speeds[0], side * np.take_along_axis(speeds[1], order, axis=-1)
    falls_first = (high > 0.0) & (down < 0.0) & (up > 0.0)
    if not falls_first.any():
        return np.asarray(falls_first.any(axis=-1))
    square, cube = 3.0 * (high - low) - 2.0 * down - up, 2.0 * (low - high) + down + up
    with np.errstate(all="ignore"):  # where it does not fall first
        s = -down / (square + np.sqrt(square * square - 3.0 * cube * down))
    lowest = low + s * (down + s * (square + s * cube))
    near = lowest < DIP * np.minimum(low, high)
    return np.asarray(np.any(near & falls_first, axis=-1))
