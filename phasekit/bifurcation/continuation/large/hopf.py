"""Hopf points of many states: a pair of eigenvalues on the imaginary axis, by sparse solves."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np
import numpy.typing as npt
from scipy.optimize import brentq, linear_sum_assignment
from scipy.sparse import csc_array, eye_array
from scipy.sparse.linalg import splu

from phasekit.bifurcation.continuation.large.curve import LargeCurve
from phasekit.bifurcation.continuation.large.forms import Forms
from phasekit.bifurcation.continuation.large.path import Between
from phasekit.bifurcation.continuation.large.singular import interval_of
from phasekit.bifurcation.continuation.points.special import CONVERGED, GUESS, Special
from phasekit.numerics.factors import Factors
from phasekit.numerics.rightmost import Spectrum, pairs_near, spectrum_at

Array = npt.NDArray[np.float64]
Complex = npt.NDArray[np.complex128]

DEPTH = 12  # halvings of a step with several pairs
BESIDE = 1e-4  # of the frequency: a center that is no eigenvalue itself
REAL = 1e-9  # real part of a pair on the axis, beside its frequency
ROUNDED = 1e-13  # the same, that is rounding


def hopf_points(
    curve: LargeCurve, a: Array, b: Array, ends: tuple[Spectrum, Spectrum]
) -> tuple[list[Special], int]:
    """The Hopf points between two points, and how many more pairs grow at the second one."""
    chord = Between(curve, a, b)
    found, more = [], 0
    for low, high, one, two in _single(curve, chord, (0.0, 1.0), ends, DEPTH):
        if one.pairs != two.pairs and one.positive != two.positive:  # no pair that becomes real
            more += two.pairs - one.pairs
            found.append(_located(curve, chord, (low, high), (one, two)))
    return found, more


def _single(
    curve: LargeCurve, chord: Between, span: tuple[float, float],
    ends: tuple[Spectrum, Spectrum], depth: int,
) -> Iterator[tuple[float, float, Spectrum, Spectrum]]:  # fmt: skip
    """Parts of a chord in which one pair, or real eigenvalue, crosses the axis."""
    (low, high), (one, two) = span, ends
    pairs, real = abs(one.pairs - two.pairs), abs(one.real - two.real)
    if not pairs + real and not are_others(one, two):
        return
    middle = 0.5 * (low + high)
    point = chord.point(middle) if pairs + real != 1 and depth else None
    if point is None:
        yield low, high, one, two
        return
    inside = spectrum_at(point.matrix, curve.scale[: curve.n])
    yield from _single(curve, chord, (low, middle), (one, inside), depth - 1)
    yield from _single(curve, chord, (middle, high), (inside, two), depth - 1)


def are_others(one: Spectrum, two: Spectrum) -> bool:
    """Whether as many pairs that grow may be others: one came while another went.

    So it may be where one at the right is nearer to one at the left of the other spectrum than to
    its own partner.
    """
    if not (one.complete and two.complete and one.pairs):
        return False
    right, left = zip(*(_sides(each.values) for each in (one, two)), strict=True)
    gaps = np.abs(right[0][:, None] - right[1])
    i, j = linear_sum_assignment(gaps)
    for side, own, other in ((0, i, left[1]), (1, j, left[0])):
        nearest = np.abs(right[side][own][:, None] - other).min(axis=1, initial=np.inf)
        if np.any(nearest < gaps[i, j]):
            return True
    return False


def _sides(values: Complex) -> tuple[Complex, Complex]:
    above = values[values.imag > 0.0]
    return above[above.real > 0.0], above[above.real <= 0.0]


def _crossing(one: Spectrum, two: Spectrum) -> tuple[complex, complex]:
    """The pair at both ends whose real part changes its sign: of those, the nearest to the axis."""
    more, less = (one, two) if one.pairs > two.pairs else (two, one)
    right = more.values[(more.values.imag > 0.0) & (more.values.real > 0.0)]
    left = less.values[(less.values.imag > 0.0) & (less.values.real <= 0.0)]
    if not len(left):
        left = less.values[less.values.imag > 0.0]
    if not len(left):
        left = right
    gaps = np.abs(right[:, None] - left)
    # One of the right has no partner on the right: the best partner on the left.
    i, j = np.unravel_index(np.argmin(gaps), gaps.shape)
    pair = complex(right[i]), complex(left[j])
    return pair if one.pairs > two.pairs else (pair[1], pair[0])


def _located(
    curve: LargeCurve, chord: Between, span: tuple[float, float], ends: tuple[Spectrum, Spectrum]
) -> Special:
    """The Hopf point in a part of a chord."""
    n, (low, high) = curve.n, span
    first, last = _crossing(*ends)

    def value_at(s: float) -> complex:
        """The eigenvalue that follows from those at both ends."""
        point = chord.point(s)
        if point is None:
            return complex(np.nan, np.nan)
        part = (s - low) / (high - low)
        expected = first + part * (last - first)
        near = pairs_near(point.matrix, 1j * expected.imag * (1.0 + BESIDE), 2)
        if near is None:
            return complex(np.nan, np.nan)
        values = near[0]
        return complex(values[np.argmin(np.abs(values - expected))])

    interval = interval_of(curve, chord.a, chord.a + chord.chord)
    several = abs(ends[0].pairs - ends[1].pairs)

    def real_part(s: float) -> float:
        """That of the pair, but for rounding: in it, roots are looked for without end."""
        value = value_at(s)
        return 0.0 if abs(value.real) <= ROUNDED * abs(value) else value.real

    try:
        s = brentq(real_part, low, high, xtol=1e-13, rtol=8.9e-16, maxiter=120)
    except (ValueError, RuntimeError):
        u = chord.a + 0.5 * (low + high) * chord.chord
        message = f"{several} pairs cross here, not refined"
        residual = float(np.max(np.abs(curve.value(u))))
        return Special("hopf", u, interval, residual, GUESS, message, _unknown(first.imag))
    point = chord.point(float(s))
    assert point is not None
    omega = value_at(float(s)).imag
    u = point.u
    residual = float(np.max(np.abs(curve.value(u))))
    if several > 1:
        message = f"{several} pairs of eigenvalues cross together"
        form = _unknown(omega)
        return Special(
            "hopf", u, interval, residual, CONVERGED, message, form, tangent=point.tangent
        )
    form, q = normal_form(curve, u, omega)
    sure = abs(value_at(float(s)).real) <= REAL * max(omega, 1e-300)
    note = "" if np.isfinite(form["l1"]) else "l1 is not known: the left vector was not found"
    return Special(
        "hopf", u, interval, residual, CONVERGED if sure else GUESS, note, form,
        tangent=point.tangent, extra=None if q is None else np.append(q.real[:n], omega**2),
    )  # fmt: skip


def _unknown(omega: float) -> dict[str, float]:
    return {"l1": np.nan, "omega": float(abs(omega)), "d": np.nan}


def normal_form(
    curve: LargeCurve, u: Array, omega: float
) -> tuple[dict[str, float], Complex | None]:
    """First Lyapunov coefficient, frequency and speed of the real part; and the right vector.

    The formula of `points.pair.normal_form`, with its inverses as sparse solutions.
    """
    n, forms = curve.n, Forms(curve, u)
    matrix = forms.matrix
    beside = 1j * omega * (1.0 + BESIDE)
    right, left = (pairs_near(matrix, beside, 2, left=one) for one in (False, True))
    if right is None or left is None:
        return _unknown(omega), None
    q = _vector(right, omega)
    p = np.conj(_vector(left, omega))
    p = p / np.conj(np.vdot(p, q))
    bar = np.conj(q)
    still, double = forms.second(q, bar), forms.second(q, q)
    rest = Factors(matrix).solve(np.ascontiguousarray(still.real))
    shifted = csc_array(2j * omega * eye_array(n, format="csc") - matrix, dtype=complex)
    turning = splu(shifted).solve(double)
    x, y = np.ascontiguousarray(q.real), np.ascontiguousarray(q.imag)
    mixed = 0.25 * (forms.third(x + y, bar) - forms.third(x - y, bar))
    cubic = forms.third(x, bar) - forms.third(y, bar) + 2j * mixed
    total = np.vdot(p, cubic) - 2.0 * np.vdot(p, forms.second(q, rest))
    total += np.vdot(p, forms.second(bar, turning))
    motion = np.append(-Factors(matrix).solve(forms.slope), 1.0)
    speed = np.vdot(p, forms.second(motion, q))
    return {
        "l1": float(total.real / (2.0 * omega)), "omega": float(omega), "d": float(speed.real),
    }, q  # fmt: skip


def _vector(found: tuple[Complex, Complex], omega: float) -> Any:
    values, vectors = found
    v = vectors[:, np.argmin(np.abs(values - 1j * omega))]
    return v / np.linalg.norm(v)
