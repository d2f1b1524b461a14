"""Points on curves of events: where the equilibrium that the event holds at is a special point."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

from phasekit.arrays import Array
from phasekit.bifurcation.continuation.curve import Curve
from phasekit.bifurcation.continuation.derivatives import Derivatives
from phasekit.bifurcation.continuation.kernels.defining import EVENT
from phasekit.bifurcation.continuation.path import Sample
from phasekit.bifurcation.continuation.points.curve_test import CurveTest
from phasekit.bifurcation.continuation.spectrum import (
    FEW,
    SURE,
    eigenvalues_of,
    flip_function,
    is_neutral,
    largest,
    largest_entry,
    orientation,
    pair_function,
    product_function,
)

RANK = 1e-6  # of a matrix, beside its size
MAPS = (True,)
_LEAST = "an eigenvalue of f_x"
_ALL = "the determinant of f and what is held"
_PAIR = "the product of two multipliers less 1"


def _values(curve: Curve, slopes: Array) -> npt.NDArray[np.complex128]:
    return eigenvalues_of(curve.linear(slopes), accuracy=curve.field.accuracy)


def _unless_zero(curve: Curve, u: Array, slopes: Array, values: Array) -> Array:
    """Values along a path; zeros if most are no more than their errors, as of f_x where it is 0."""
    if len(u) < FEW:
        return values
    n, scale = curve.n, curve.scale[: curve.n]
    size = largest_entry(curve.linear(slopes) * scale / scale[:, None])
    if n == 1:  # terms may cancel in f_x itself
        moved = np.maximum(np.abs(u[:, : curve.m]), curve.scale[: curve.m])
        bent = curve.bend_all(u, np.pad(np.ones((len(u), 1)), ((0, 0), (0, curve.m - 1))))
        size = np.maximum(size, np.sum(np.abs(bent[:, 0]) * moved, axis=1))
    zero = np.abs(values) <= SURE * curve.field.accuracy * size
    return np.where(np.mean(zero) > 0.5, 0.0, values)


def singular(curve: Curve, u: Array, slopes: Array) -> Array:
    """The least eigenvalue of f_x in size, with the sign of the determinant."""
    values = flip_function(eigenvalues_of(slopes, accuracy=curve.field.accuracy) - 1.0)
    return _unless_zero(curve, u, slopes, values)


def flip(curve: Curve, u: Array, slopes: Array) -> Array:
    """1 + mu of the multiplier next to -1, with the sign of the product of all."""
    return _unless_zero(curve, u, slopes, flip_function(_values(curve, slopes)))


def pair(curve: Curve, u: Array, slopes: Array) -> Array:
    """The pair function of a flow, or of a map; one where each spectrum is its mirror image."""
    values = _values(curve, slopes)
    if curve.conservative or (len(values) >= FEW and is_neutral(curve, values)):
        return np.ones(len(values))
    sums = product_function(values) if curve.discrete else pair_function(values)
    return _unless_zero(curve, u, slopes, sums)


def complex_pair(curve: Curve, s: Sample) -> bool:
    """Whether the pair that crosses is none of real eigenvalues."""
    values = _values(curve, s.slopes[None])[0]
    above = values[values.imag > 0.0]
    if curve.discrete:
        off = np.abs(np.abs(above) ** 2 - 1.0)
        least = product_function(values)
    else:
        off, least = np.abs(2.0 * above.real), pair_function(values)
    return bool(np.min(off, initial=np.inf) <= abs(float(least)) * (1.0 + 1e-9))


def held(curve: Curve, u: Array, slopes: Array, tangent: Array) -> Array:
    """The least singular value of f_u and g_u, with the sign of the determinant with the tangent.

    It changes where curves of the event cross each other; zeros where it is but rounding.
    """
    G = np.array([curve.equations_at(point)[1] for point in u])
    finite = np.isfinite(G).all(axis=(1, 2))
    G[~finite] = 0.0
    top = G * curve.scale[: curve.m]
    rows = largest(top)[..., None]
    least = np.linalg.svd(top / np.where(rows > 0.0, rows, 1.0), compute_uv=False)[:, -1]
    least[least <= SURE * curve.field.accuracy] = 0.0
    return np.where(finite, orientation(curve, tangent, G)[0] * least, np.nan)


def _words(d: Derivatives) -> tuple[dict[str, float], str]:
    """No normal form, and what crosses."""
    only = f"curves with {getattr(d.curve.held, 'name', '')} cross here, the equilibria around them"
    return {}, "" if _crosses(d.curve, Sample(d.u, d.u, d.slopes)) else f"{only} do not"


def _crosses(curve: Curve, s: Sample) -> bool:
    """Whether other branches cross here: neither parameter moves the equilibrium off f_x v = 0."""
    scaled = s.slopes * curve.scale[: curve.m]
    rows = np.max(np.abs(scaled), axis=1, keepdims=True)
    sizes = np.linalg.svd(scaled / np.where(rows > 0.0, rows, 1.0), compute_uv=False)
    return bool(sizes[-1] <= RANK * sizes[0])


def _turns(*at: Any) -> bool:
    return not _crosses(*at)


BOTH: Any = {"along": EVENT, "of": (False, True)}
TESTS = (
    CurveTest("fold", values=singular, holds=_turns, coefficient=_LEAST, **BOTH),
    CurveTest("branch_point", values=held, form=_words, oriented=True, coefficient=_ALL, **BOTH),
    CurveTest("hopf", EVENT, pair, 2, complex_pair, coefficient="a sum of two eigenvalues"),
    CurveTest("period_doubling", EVENT, flip, of=MAPS, coefficient="1 + mu of a multiplier mu"),
    CurveTest("torus", EVENT, pair, 2, complex_pair, of=MAPS, coefficient=_PAIR),
)
