"""Critical parameter values in closed form: folds and the change of sign of A.

A fold lies on the astroid |B|^(2/3) + |C|^(2/3) = |A|^(2/3). Each function returns the value on
the side A < 0, the one on the side A > 0, and the value where A = 0; NaN where there is none.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from phasekit.arrays import Array
from phasekit.errors import ParameterError

Critical = tuple[Array, Array, Array]


def critical_disk(
    parameter: str,
    *,
    beta: npt.ArrayLike = np.nan,
    e: npt.ArrayLike = np.nan,
    a: npt.ArrayLike = np.nan,
    r: npt.ArrayLike,
    omega1: npt.ArrayLike = np.nan,
    g: npt.ArrayLike = 9.80665,
) -> Critical:
    """Positive values of one parameter of the disk at which equilibria merge, or A = 0.

    With s = sin beta, c = cos beta and the length L = [(|g|/omega1^2)^(2/3) + |a|^(2/3)]^(3/2) the
    fold condition is 4 e s L = |4 e^2 s^2 - r^2 c^2|, from the coefficients of [Veljovic2015] (13).
    The fold with A < 0, that with A > 0, and the value with A = 0, which the parameter's own
    argument tells nothing of but the sign of A; beta in [0, pi/2]. Where the sign of A does not
    depend on it (a, omega1) the fold of that sign alone is given.
    """
    if parameter not in ("beta", "e", "a", "omega1"):
        raise ParameterError(f"parameter: got {parameter!r}, wants beta, e, a or omega1")
    beta_, e_, a_, r_, omega1_, g_ = _floats(beta, e, a, r, omega1, g)
    a_, g_ = np.abs(a_), np.abs(g_)
    with np.errstate(all="ignore"):
        weight = g_ / (omega1_ * omega1_)
        given = {"beta": beta_, "e": e_, "a": a_, "omega1": omega1_, "r": r_, "g": g_}
        legal = (r_ >= 0.0) & ((e_ >= 0.0) | (parameter == "e"))
        for name, values in given.items():
            legal &= np.isfinite(values) | (name == parameter)
        legal &= np.isfinite(weight) | (parameter == "omega1")
        r_ = np.where(legal, r_, np.nan)
        if parameter == "beta":
            return _critical_beta(e_, r_, _length(weight, a_))
        s = np.where((beta_ >= 0.0) & (beta_ <= np.pi), np.sin(beta_), np.nan)
        reach = r_ * np.abs(np.cos(beta_))
        if parameter == "e":
            length = _length(weight, a_)
            root = length + np.hypot(length, reach)
            minus, plus = reach * reach / (2.0 * s * root), root / (2.0 * s)
            return _positive(minus), _positive(plus), _positive(reach / (2.0 * s))
        span = (2.0 * e_ * s - reach) * (2.0 * e_ * s + reach)
        length = np.abs(span) / (4.0 * e_ * s)
        if parameter == "a":
            return _by_sign(span, _positive(_remainder(length, weight)))
        speed = np.sqrt(np.where(g_ > 0.0, g_, np.nan) / _remainder(length, a_))
        return _by_sign(span, _positive(speed))


def critical_reduced(
    parameter: str, A: npt.ArrayLike, B: npt.ArrayLike, C: npt.ArrayLike
) -> Critical:
    """Positive lambda = B/A (or psi = C/A) on the fold at the given psi (or lambda).

    The fold is the astroid lambda^(2/3) + psi^(2/3) = 1 of the papers' parameters ([Veljovic2015]
    (12)). The fold stands on the side of A's own sign; the last result, a change of sign, is NaN.
    """
    if parameter not in ("lam", "psi"):
        raise ParameterError(f"parameter: got {parameter!r}, wants 'lam' or 'psi'")
    a, b, c = _floats(A, B, C)
    with np.errstate(all="ignore"):
        other = np.abs((c if parameter == "lam" else b) / a)
        return _by_sign(a, _positive(_remainder(np.ones_like(other), other)))


def _floats(*values: npt.ArrayLike) -> tuple[Array, ...]:
    return tuple(np.broadcast_arrays(*(np.asarray(value, dtype=float) for value in values)))


def _length(first: Array, second: Array) -> Array:
    """(first^(2/3) + second^(2/3))^(3/2)."""
    both = (np.cbrt(first) ** 2 + np.cbrt(second) ** 2) ** 1.5
    # Exact where one is 0, so that a cusp (length = e) is met exactly.
    return np.where(first == 0.0, second, np.where(second == 0.0, first, both))


def _remainder(whole: Array, part: Array) -> Array:
    """(whole^(2/3) - part^(2/3))^(3/2) without cancellation; NaN where part > whole."""
    x, y = np.cbrt(whole) ** 2, np.cbrt(part) ** 2
    power = (whole - part) * (whole + part) / (x * x + x * y + y * y)
    return np.asarray(np.where(power >= 0.0, power, np.nan) ** 1.5)


def _critical_beta(e: Array, r: Array, length: Array) -> Critical:
    moment = 4.0 * e * e + r * r
    lever = 2.0 * e * length
    root = np.sqrt(lever * lever + moment * r * r)
    # The angle from its sine and 1 - sine, both without cancellation, so that it keeps its digits
    # next to pi/2 as well.
    minus = r * r / (lever + root)
    minus_rest = (lever + 4.0 * e * e * (length * length + r * r) / (root + r * r)) / (lever + root)
    plus = (lever + root) / moment
    plus_rest = 4.0 * e * (e - length) / (moment - lever + root)
    return (
        np.where(r > 0.0, _angle(minus, minus_rest), np.nan),
        np.where(e >= length, _angle(plus, plus_rest), np.nan),
        np.where(r > 0.0, np.arctan2(r, 2.0 * e), np.nan),
    )


def _angle(sine: Array, rest: Array) -> Array:
    """The angle in [0, pi/2] with this sine and 1 - sine = rest."""
    return np.arctan2(sine, np.sqrt(rest * (1.0 + sine)))


def _positive(value: Array) -> Array:
    return np.where((value >= 0.0) & np.isfinite(value), value, np.nan)


def _by_sign(sign: Array, value: Array) -> Critical:
    return (
        np.where(sign < 0.0, value, np.nan),
        np.where(sign > 0.0, value, np.nan),
        np.full(np.shape(value), np.nan),
    )
