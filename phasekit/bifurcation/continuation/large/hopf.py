"""Hopf points of many states: a pair of eigenvalues on the imaginary axis, by sparse solves."""

from __future__ import annotations

import functools
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.optimize import brentq
from scipy.sparse import csc_array, eye_array

from phasekit.arrays import Array, Complex
from phasekit.bifurcation.continuation.large.curve import LargeCurve
from phasekit.bifurcation.continuation.large.forms import Forms
from phasekit.bifurcation.continuation.large.path import Between
from phasekit.bifurcation.continuation.large.singular import interval_of
from phasekit.bifurcation.continuation.points.special import CONVERGED, GUESS, Special
from phasekit.numerics.crossings import Crossings, crossing_pair, crossings
from phasekit.numerics.factors import Factors
from phasekit.numerics.rightmost import Spectrum, pairs_near, spectrum_at

DEPTH = 12  # halvings of a step in which several cross
BESIDE = 1e-4  # of the frequency: a center that is no eigenvalue itself
REAL = 1e-9  # real part of a pair on the axis, beside its frequency
ROUNDED = 1e-13  # the same, that is rounding


@dataclass(frozen=True)
class Part:
    """A part of a chord, its spectra at both ends, and what crosses the axis in it."""

    low: float
    high: float
    ends: tuple[Spectrum, Spectrum]
    crossing: Crossings


def parts_of(
    curve: LargeCurve, chord: Between, ends: tuple[Spectrum, Spectrum],
    span: tuple[float, float] = (0.0, 1.0), depth: int = DEPTH,
    spectrum: Callable[[Any], Spectrum] | None = None,
) -> Iterator[Part]:  # fmt: skip
    """Parts of a chord in which one pair, or real eigenvalue, crosses the axis, if they part.

    ``spectrum`` gives the eigenvalues of a matrix that may; all that may grow if it is left out.
    """
    spectrum = spectrum or functools.partial(spectrum_at, scale=curve.scale[: curve.n])
    (low, high), (one, two), crossing = span, ends, crossings(*ends)
    if crossing.single and not crossing.pairs + crossing.real:
        return
    middle = 0.5 * (low + high)
    point = None if crossing.single or not depth else chord.point(middle)
    if point is None:
        yield Part(low, high, ends, crossing)
        return
    inside = spectrum(point.matrix)
    yield from parts_of(curve, chord, (one, inside), (low, middle), depth - 1, spectrum)
    yield from parts_of(curve, chord, (inside, two), (middle, high), depth - 1, spectrum)


def hopf_point(curve: LargeCurve, chord: Between, part: Part) -> Special:
    """The Hopf point in a part of a chord."""
    n, low, high, several = curve.n, part.low, part.high, part.crossing.pairs
    first, last = crossing_pair(*part.ends)
    crosses = first.real * last.real < 0.0

    @functools.cache
    def value_at(s: float) -> complex:
        """The eigenvalue that follows from those at both ends."""
        if crosses and s in (low, high):
            return first if s == low else last
        point = chord.point(s)
        if point is None:
            return complex(np.nan, np.nan)
        expected = first + (s - low) / (high - low) * (last - first)
        near = pairs_near(point.matrix, 1j * expected.imag * (1.0 + BESIDE), 2)
        if near is None:
            return complex(np.nan, np.nan)
        values = near[0]
        return complex(values[np.argmin(np.abs(values - expected))])

    interval = interval_of(curve, chord.a, chord.a + chord.chord)

    def real_part(s: float) -> float:
        """That of the pair, but for rounding: in it, roots are looked for without end."""
        value = value_at(s)
        return 0.0 if abs(value.real) <= ROUNDED * abs(value) else value.real

    try:
        if several != abs(part.ends[0].pairs - part.ends[1].pairs):
            raise ValueError("one comes while another goes")
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
    factors = Factors(matrix)
    rest = factors.solve(np.ascontiguousarray(still.real))
    shifted = csc_array(2j * omega * eye_array(n, format="csc") - matrix, dtype=complex)
    turning = Factors(shifted).solve(double)
    total = -2.0 * np.vdot(p, forms.second(q, rest))
    x, y = np.ascontiguousarray(q.real), np.ascontiguousarray(q.imag)
    total += np.vdot(p, forms.second(x, turning) - 1j * forms.second(y, turning))
    cubic = forms.third(x, bar) - forms.third(y, bar)
    mixed = 0.25 * (forms.third(x + y, bar) - forms.third(x - y, bar))
    total += np.vdot(p, cubic + 2j * mixed)
    motion = np.append(-factors.solve(forms.slope), 1.0)
    speed = np.vdot(p, forms.second(motion, q))
    return {
        "l1": float(total.real / (2.0 * omega)), "omega": float(omega), "d": float(speed.real),
    }, q  # fmt: skip


def _vector(found: tuple[Complex, Complex], omega: float) -> Any:
    values, vectors = found
    v = vectors[:, np.argmin(np.abs(values - 1j * omega))]
    return v / np.linalg.norm(v)
