"""The papers' reduced form of coefficients: lambda and psi."""

from __future__ import annotations

from typing import Any

import numpy as np

from phasekit.errors import ParameterError
from phasekit.labels.arguments import FloatArray
from phasekit.labels.grid import combine


def reduced_form(A: Any, B: Any, C: Any, attrs: Any) -> tuple[Any, ...]:
    """Return lambda, psi and Omega^2 ([Veljovic2015] (12)); `System.reduced` has the words."""
    if isinstance(A, float) and A == 0.0:
        raise ParameterError(
            "A: got 0.0, wants A != 0, because lambda = B/A and psi = C/A; "
            "use .coefficients(), which has no such limit"
        )

    def divide(A: FloatArray, B: FloatArray, C: FloatArray) -> tuple[FloatArray, ...]:
        with np.errstate(all="ignore"):
            lam, psi = (np.where(A == 0, np.nan, x / A) for x in (B, C))
            return lam, psi, A + 0 * (B + C)

    values = combine(divide, {"A": A, "B": B, "C": C}, ("lam", "psi", "Omega_sq"), attrs)
    if not all(np.isfinite(value) for value in values if isinstance(value, float)):
        raise ParameterError(
            f"A: got {A!r} with B = {B!r} and C = {C!r}, wants a size for which "
            "lambda = B/A and psi = C/A are finite; use .coefficients(), which has no such "
            "limit"
        )
    return tuple(values)
