"""Test functions along a path of equilibria, for many points at once ([Kuznetsov2004] 10.2)."""

from __future__ import annotations

import functools
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from phasekit.arrays import Array
from phasekit.bifurcation.continuation.curve import Curve
from phasekit.bifurcation.continuation.kernels import scan

EPSILON = 2.0**-52
SURE = 10.0  # times an error that tells
OPPOSITE = 1e-6  # part of a matrix from which on the sign of an entry is no rounding
ROUNDED = 1e-13  # by how much more than 1 the size of a multiplier is but rounding
KEPT = 1e-7  # the same where areas are kept: multipliers that meet part with the root of rounding
SAME = 1e-10  # part of the largest eigenvalue by which two others are told apart
NEAR = 1e-5  # a spectrum with a pair that sums to more, relative, is not that of such a system
FEW = 32  # eigenvalues up to which all twos are looked at
NEUTRAL = 1e-9  # a spectrum whose pairs sum to less, relative, is that of a conservative system


# Reductions of many short rows: NumPy's own run along the rows, these across them.


def across(ufunc: np.ufunc, values: Any, **more: Any) -> Any:
    """``ufunc.reduce`` over the last axis."""
    return ufunc.reduce(np.ascontiguousarray(values.T), **more).T


def largest(values: Any) -> Any:
    """Largest sizes over the last axis."""
    return across(np.maximum, np.abs(values))


def largest_entry(matrices: Any) -> Any:
    """Largest sizes over the last two axes."""
    return largest(matrices.reshape(*matrices.shape[:-2], -1))


def count(true: Any) -> Any:
    """How many are true, over the last axis."""
    return across(np.add, true, dtype=np.int64)


@dataclass(frozen=True)
class Tests:
    """Test functions of points: each changes its sign where something happens."""

    fold: Array  # component of the unit tangent along the parameter
    branch: Array  # sign of the determinant of f_u with the tangent as last row
    #: Logarithm of the size of that determinant on scaled axes. Only differences of it count: the
    #: number itself has no scale, and of many states it is beyond the range of numbers.
    volume: Array
    #: Sum of two real or two conjugate eigenvalues, the smallest in size, with the sign of the
    #: product of all: zero at Hopf points and neutral saddles.
    pair: Array
    below: npt.NDArray[np.int64]  # number of such sums that are negative; -1 where rounding tells
    #: Number of real eigenvalues: where it changes, so do the sums that count.
    real: npt.NDArray[np.int64]
    flip: Array  # of maps: 1 + mu of the multiplier next to -1, with the sign of the product of all
    #: Number of eigenvalues with a positive real part, of multipliers outside the unit circle.
    unstable: npt.NDArray[np.int64]
    eigenvalues: npt.NDArray[np.complex128]  # eigenvalues of f_x


def eigenvalues_of(slopes: Array, *, accuracy: float = 1e-13) -> npt.NDArray[np.complex128]:
    """Eigenvalues of f_x of many points.

    Those of matrices that a change of units makes symmetric, within the accuracy of their entries,
    are real, as those of gradient systems: rounding does not make pairs of them.
    """
    n = slopes.shape[-2]
    if n == 1:
        return slopes[..., :, 0].astype(complex)
    matrices = slopes[..., :n]
    if n == 2:
        values = _eigenvalues_of_two(matrices)
        # Units leave a, d and b c as they are: only next to double ones rounding makes pairs.
        near = np.abs(values.imag) <= OPPOSITE * np.abs(values.real)
        if (near & (values.imag != 0.0)).any():
            real = _symmetric(_in_even_units(matrices), accuracy)
            values.imag[real] = 0.0
        return values
    finite = np.isfinite(slopes)
    if finite.all():
        return _eigenvalues_of_finite(matrices, accuracy)
    result = np.full(slopes.shape[:-2] + (n,), np.nan, dtype=complex)
    whole = finite.all(axis=(-2, -1))
    result[whole] = _eigenvalues_of_finite(matrices[whole], accuracy)
    return result


def _eigenvalues_of_finite(matrices: Array, accuracy: float) -> npt.NDArray[np.complex128]:
    even = _in_even_units(matrices)
    real = _symmetric(even, accuracy)
    if not real.any():
        return np.linalg.eigvals(matrices).astype(complex, copy=False)
    values = np.empty(matrices.shape[:-1], dtype=complex)
    values[~real] = np.linalg.eigvals(matrices[~real])
    # The lower triangle alone counts for LAPACK; the mean of both is the better one.
    values[real] = np.linalg.eigvalsh(0.5 * (even + np.swapaxes(even, -1, -2))[real])
    return values


def surely_complex(
    matrix: Array, values: npt.NDArray[np.complex128], accuracy: float
) -> npt.NDArray[np.bool_]:
    """Which eigenvalues of a matrix, on scaled axes, are no real ones, as far as entries tell.

    Errors of the entries part a double real one into a pair at the root of their size.
    """
    error = SURE * accuracy * np.linalg.norm(matrix, 2)
    return np.asarray(values.imag**2 > error * np.abs(values))


def _symmetric(matrices: Array, accuracy: float) -> npt.NDArray[np.bool_]:
    gap = largest_entry(matrices - matrices.swapaxes(-1, -2))
    return np.asarray(gap <= 4.0 * accuracy * largest_entry(matrices))


def _in_even_units(matrices: Array) -> Array:
    """D^-1 A D of matrices A, the same diagonal D for all: symmetric if any such are.

    Along the edges of a spanning forest of the entries, (d_j/d_i)^2 = |A_ji/A_ij|.
    """
    transposed = matrices.swapaxes(-1, -2)
    if (matrices == transposed).all():
        return matrices
    # No units change the sign of A_ij A_ji.
    products = (matrices * transposed).reshape(*matrices.shape[:-2], -1)
    least = -((OPPOSITE * largest_entry(matrices)) ** 2)
    if (across(np.minimum, products) < least).all():
        return matrices
    sizes = np.abs(matrices).reshape(-1, *matrices.shape[-2:]).sum(axis=0)
    both = np.sqrt(sizes * sizes.T)
    most = both.max()
    if most == 0.0:
        return matrices
    with np.errstate(all="ignore"):
        # Zeros by differences are zeros but for rounding.
        log = _along_a_forest(both > 1e-12 * most, sizes)
        unit = np.exp(log - log.mean())
        even = matrices * unit / unit[:, None]
    return even if np.isfinite(even).all() else matrices


def _along_a_forest(joined: npt.NDArray[np.bool_], sizes: Array) -> Array:
    """Logarithms of units d with d_j/d_i = (|A_ji/A_ij|)^(1/2) along the edges of a forest."""
    starts, ends = np.nonzero(joined)
    half = 0.5 * (np.log(sizes[ends, starts]) - np.log(sizes[starts, ends]))
    first = np.searchsorted(starts, np.arange(len(sizes) + 1)).tolist()
    to, by = ends.tolist(), half.tolist()
    left = dict.fromkeys(range(len(sizes)))  # in order
    found = [0.0] * len(sizes)
    while left:
        reached = [next(iter(left))]
        del left[reached[0]]
        for i in reached:
            if not left:
                break
            for edge in range(first[i], first[i + 1]):
                j = to[edge]
                if j in left:
                    found[j] = found[i] + by[edge]
                    del left[j]
                    reached.append(j)
    return np.array(found)


def _eigenvalues_of_two(matrices: Array) -> npt.NDArray[np.complex128]:
    """Eigenvalues of 2 x 2 matrices in closed form, without cancellation where they are real."""
    result = np.empty((*matrices.shape[:-2], 2), dtype=complex)
    parts = result.reshape(-1, 2).view(float)  # real and imaginary parts by turns
    scan.eigenvalues_of_two(np.ascontiguousarray(matrices).reshape(-1, 4), parts)
    return result


def orientation(curve: Curve, tangent: Array, slopes: Array) -> tuple[Array, Array]:
    """Sign, and logarithm of the size, of the determinant of f_u with the tangent as last row.

    On scaled axes; rows are brought to a length of one for it, so that units do not matter.
    """
    m = curve.m
    scale = curve.scale[:m]
    top = slopes * scale
    rows = largest(top)[..., None]
    rows[~(rows > 0.0)] = 1.0
    bottom = tangent[..., :m] / scale
    matrix = np.concatenate([top / rows, bottom[..., None, :]], axis=-2)
    sign, log = np.linalg.slogdet(matrix)
    return np.asarray(sign), np.asarray(log + np.log(rows[..., 0]).sum(axis=-1))


def test_functions(
    curve: Curve,
    tangent: Array,
    slopes: Array,
    values: npt.NDArray[np.complex128] | None,
    *,
    pairs: bool,
    neutral: bool,
    saddles: bool,
) -> Tests:
    """The test functions of points with their tangents, derivatives of f and eigenvalues.

    Without ``saddles`` the pair function is that of conjugate pairs alone.
    """
    n = curve.n
    sign, log = orientation(curve, tangent, slopes)
    if values is None:
        values = eigenvalues_of(curve.linear(slopes), accuracy=curve.field.accuracy)
    nothing = np.ones(slopes.shape[:-2])
    pair, below = nothing, np.full(nothing.shape, -1)
    if pairs and n > 1:
        if curve.discrete:
            pair = product_function(values)
        elif saddles:
            pair, below = pair_sums(values)
        else:
            pair = conjugate_function(values)
    return Tests(
        tangent[..., n] / curve.scale[n],
        sign,
        log,
        pair,
        below,
        np.asarray(count(values.imag == 0.0)),
        flip_function(values) if curve.discrete else nothing,
        unstable_of(curve, values, neutral=neutral),
        values,
    )


def unstable_of(
    curve: Curve, values: npt.NDArray[np.complex128], *, neutral: bool, blur: Any = 0.0
) -> npt.NDArray[np.int64]:
    """Number of unstable eigenvalues; ``blur`` is the part of the largest that tells no sign.

    The size of a multiplier is a rounded number, and may be exactly 1. Where the spectrum is
    ``neutral`` pairs that are on the axis but for their errors do not count.
    """
    least = (KEPT if neutral else ROUNDED) if curve.discrete else 0.0
    floor = np.maximum(least, blur) * largest(values)
    grows = curve.growth(values) > floor[..., None]
    if neutral:
        grows &= ~on_axis(curve, values)
    return np.asarray(count(grows))


def _error(values: npt.NDArray[np.complex128]) -> Array:
    """What real parts on the axis may be: rounding of the matrix, and a part of their own sizes."""
    return np.asarray(NEUTRAL * np.abs(values) + SURE * EPSILON * largest(values)[..., None])


def on_axis(curve: Curve, values: npt.NDArray[np.complex128]) -> npt.NDArray[np.bool_]:
    """Which eigenvalues are of conjugate pairs on the axis, within their errors."""
    off = np.abs(curve.growth(values))
    return np.asarray((values.imag != 0.0) & (off <= _error(values)))


def twos_on_axis(curve: Curve, values: npt.NDArray[np.complex128]) -> npt.NDArray[np.bool_]:
    """At which points a pair is on the axis, or two real eigenvalues sum to zero.

    Of a map, two real multipliers whose product is 1.
    """
    found = on_axis(curve, values).any(axis=-1)
    if values.shape[-1] <= FEW:
        i, j = _twos(values.shape[-1])
        a, b, error = values[..., i], values[..., j], _error(values)
        real = (a.imag == 0.0) & (b.imag == 0.0)
        off = np.abs(a.real * b.real - 1.0) if curve.discrete else np.abs(a.real + b.real)
        found |= np.any(real & (off <= error[..., i] + error[..., j]), axis=-1)
    return np.asarray(found)


def flip_function(values: npt.NDArray[np.complex128]) -> Array:
    """The least 1 + mu in size, with the sign of the product of all."""
    size = np.min(np.abs(1.0 + values), axis=-1)
    negative = np.sum((values.imag == 0.0) & (values.real < -1.0), axis=-1)
    return np.asarray(np.where(negative % 2 == 1, -size, size))


def product_function(values: npt.NDArray[np.complex128]) -> Array:
    """The least mu_i mu_j - 1 of real and conjugate pairs, with the sign of the product of all."""
    i, j = _twos(values.shape[-1])
    a, b = values[..., i], values[..., j]
    real = ((a.imag == 0.0) & (b.imag == 0.0)) | (a == np.conj(b))
    excess = (a * b).real - 1.0
    negative = np.sum(real & (excess < 0.0), axis=-1)
    least = np.min(np.where(real, np.abs(excess), np.inf), axis=-1, initial=np.inf)
    least = np.where(np.isfinite(least), least, 1.0)
    return np.asarray(np.where(negative % 2 == 1, -least, least))


@functools.cache
def _twos(n: int) -> tuple[npt.NDArray[np.intp], npt.NDArray[np.intp]]:
    """Places of all twos of n numbers."""
    i, j = np.triu_indices(n, 1)
    i.flags.writeable = j.flags.writeable = False
    return i, j


def nearest_pair(values: npt.NDArray[np.complex128], *, saddles: bool) -> tuple[int, int]:
    """The two eigenvalues, both real or conjugate, whose sum is least in size.

    Without ``saddles`` conjugate ones, if there are any.
    """
    sums = np.abs(values[:, None] + values)
    real = values.imag == 0.0
    if not (saddles or real.all()):
        sums[real] = np.inf
    alike = (real[:, None] & real) | (values[:, None] == np.conj(values))
    sums[~alike | np.eye(len(values), dtype=bool)] = np.inf
    i, j = np.unravel_index(np.argmin(sums), sums.shape)
    return int(min(i, j)), int(max(i, j))


def pair_function(values: npt.NDArray[np.complex128]) -> Array:
    """Smallest real sum of two eigenvalues with the sign of the product of all such sums."""
    return pair_sums(values)[0]


def conjugate_function(values: npt.NDArray[np.complex128]) -> Array:
    """The least sum of two conjugate eigenvalues, with a sign that changes at Hopf points.

    Pairs with a positive real part are counted with half the number of positive eigenvalues, so
    that a pair that becomes real, or did, counts as before.
    """
    unstable = count(values.real > 0.0)
    sums = np.where(values.imag > 0.0, 2.0 * np.abs(values.real), np.inf)
    least = across(np.minimum, sums, initial=np.inf)
    least = np.where(np.isfinite(least), least, largest(values))
    return np.asarray(np.where(unstable // 2 % 2 == 1, -least, least))


def pair_sums(values: npt.NDArray[np.complex128]) -> tuple[Array, npt.NDArray[np.int64]]:
    """The pair function, and how many sums are negative, -1 where rounding tells.

    Sums of two real and of two conjugate eigenvalues count.
    """
    n = values.shape[-1]
    if n > 8:  # all pairs of many eigenvalues would cost more than the eigenvalues
        rows = np.array([_least_sum(row) for row in values.reshape(-1, n)])
        least = rows[:, 0].reshape(values.shape[:-1])
        negative = rows[:, 1].astype(int).reshape(values.shape[:-1])
    else:
        i, j = _twos(n)
        a, b = values[..., i], values[..., j]
        sums = a.real + b.real
        real = a.imag == -b.imag
        real &= (a.imag == 0.0) | (a.real == b.real)
        negative = count(real & (sums < 0.0))
        least = across(np.minimum, np.where(real, np.abs(sums), np.inf), initial=np.inf)
        least = np.where(np.isfinite(least), least, 1.0)
    tiny = least <= SAME * largest(values)
    return np.asarray(np.where(negative % 2 == 1, -least, least)), np.where(tiny, -1, negative)


def _least_sum(values: npt.NDArray[np.complex128]) -> tuple[float, int]:
    """The least sum of one point, in size, and how many are negative, by sorting.

    Of real eigenvalues neighbours of -r count.
    """
    real = np.sort(values.real[values.imag == 0.0])
    above = values.real[values.imag > 0.0]  # one of each conjugate pair
    sums = [2.0 * above]
    negative = int(np.sum(above < 0.0))
    count = len(real)
    if count > 1:
        # How many of the others are less than -r.
        place = np.searchsorted(real, -real, side="left")
        both = int(np.sum(place)) - int(np.sum(real < -real))
        negative += both // 2
        own = np.arange(count)
        for shift in (-2, -1, 0, 1):
            other = place + shift
            there = (other >= 0) & (other < count) & (other != own)
            sums.append(real[there] + real[other[there]])
    sizes = np.abs(np.concatenate(sums))
    least = float(np.min(sizes)) if len(sizes) and np.isfinite(sizes).all() else 1.0
    return least, negative


def is_conservative(values: npt.NDArray[np.complex128], *, discrete: bool = False) -> bool:
    """Whether the spectrum of every point is its own mirror image: no damping anywhere.

    Of a map, whether multipliers come in pairs mu and 1/mu: it keeps areas.
    """
    n = values.shape[-1]
    if n < 2 or n % 2 or not len(values):
        return False
    if discrete:
        if not np.isfinite(values).all():
            return False
        rows = np.array([np.poly(row).real for row in values])
        gap = np.max(np.abs(rows - rows[:, ::-1]), axis=-1) / np.max(np.abs(rows), axis=-1)
    else:
        gap = _off_mirror(values[:1])
        if gap[0] < NEAR:
            gap = _off_mirror(values)
    # Beside the size of the spectrum; at points where pairs meet it is the root of rounding.
    return bool(np.max(gap) < NEAR and np.median(gap) <= NEUTRAL)


def _off_mirror(values: npt.NDArray[np.complex128]) -> Array:
    """By how much spectra are not their mirror images, beside their sizes."""
    size = np.max(np.abs(values), axis=-1, initial=1e-300)
    gap = np.abs(np.sort_complex(values) - np.sort_complex(-values)).max(axis=-1)
    return np.asarray(gap / np.where(size > 0.0, size, 1.0))


LEAST = 3  # points from which on it is a path
MOST = 0.9  # part of its points; next to double eigenvalues errors are larger


def is_neutral(curve: Curve, values: npt.NDArray[np.complex128]) -> bool:
    """Whether the spectrum keeps a pair on the axis along a path, or is always its mirror image.

    Then the sum of two eigenvalues, of a map the product less 1, is zero everywhere, and tells of
    no Hopf point.
    """
    if is_conservative(values, discrete=curve.discrete):
        return True
    if values.shape[-1] < 2 or len(values) < LEAST:
        return False
    if not twos_on_axis(curve, values[:: max(1, len(values) // LEAST)]).any():
        return False
    return bool(np.mean(twos_on_axis(curve, values)) >= MOST)


def said_of(curve: Curve, values: npt.NDArray[np.complex128]) -> tuple[str, ...]:
    """What is said of a path whose spectrum `is_neutral`, where nothing is known of energy."""
    turning = on_axis(curve, values).any(axis=-1)
    if len(values) < LEAST or not turning.any() or not np.any(largest(values) > 0.0):
        return ()
    if curve.discrete:
        where, kind, more = "unit circle", "torus", "multipliers"
    else:
        where, kind, more = "imaginary axis", "Hopf", "eigenvalues"
    return (
        f"a pair of {more} stays on the {where} along the branch, within its error, as where f "
        f"conserves something or is reversible: no {kind} points are told of it, and it does not "
        "decide stability",
    )
