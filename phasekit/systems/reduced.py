"""The papers' reduced form, in lambda and psi."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from phasekit.errors import ParameterError
from phasekit.labels.arguments import FloatArray, NumberLike
from phasekit.labels.grid import combine
from phasekit.laws.trigonometric import Values
from phasekit.systems.parameter import Parameter, attrs_of
from phasekit.systems.system import Model, model


@model
@dataclass(frozen=True, eq=False, repr=False)
class Reduced(Model):
    """The papers' reduced form, in lambda and psi.

    ``phi'' + Omega^2 (lam - cos phi) sin phi - Omega^2 psi cos phi = 0``.

    Parameters
    ----------
    lam, psi : float, 1-D array_like or xarray.DataArray
        Gravity and eccentric centrifugal force against the coupling term, of any sign.
    Omega_sq : float or array_like, default 1.0
        Omega^2 in s^-2; negative for a disk that is nearly in line with its shaft.

    Raises
    ------
    ParameterError
        If a value is not a real, finite number or an array of numbers.

    Notes
    -----
    [Veljovic2015] (12): ``A = Omega^2``, ``B = lam Omega^2``, ``C = psi Omega^2``.

    Examples
    --------
    >>> import phasekit as pk
    >>> pk.Reduced(0.25, 0.125, 4.0).coefficients()
    Coefficients(A=4.0, B=1.0, C=0.5)
    """

    lam: NumberLike
    psi: NumberLike
    Omega_sq: NumberLike = 1.0

    declared: ClassVar[tuple[Parameter, ...]] = (
        Parameter(name="lam", units="1", long_name="lambda = B/A"),
        Parameter(name="psi", units="1", long_name="psi = C/A"),
        Parameter(name="Omega_sq", units="s-2", long_name="Omega^2 = A"),
    )

    @staticmethod
    def products(v: Values) -> tuple[Any, Any, Any, Any]:
        """[Veljovic2015] (12)."""
        return v["Omega_sq"], v["lam"] * v["Omega_sq"], v["psi"] * v["Omega_sq"], 1


def reduced_of(system: Model) -> Reduced:
    """The papers' form of a system; `Model.reduced` has the words."""
    A, B, C = system.coefficients()
    if isinstance(A, float) and A == 0.0:
        raise ParameterError(
            "A: got 0.0, wants A != 0, because lambda = B/A and psi = C/A; "
            "use .coefficients(), which has no such limit"
        )

    def divide(A: FloatArray, B: FloatArray, C: FloatArray) -> tuple[FloatArray, ...]:
        with np.errstate(all="ignore"):
            lam, psi = (np.where(A == 0, np.nan, x / A) for x in (B, C))
            return lam, psi, A + 0 * (B + C)

    attrs = attrs_of(*system.declared, *Reduced.declared)
    values = combine(divide, {"A": A, "B": B, "C": C}, ("lam", "psi", "Omega_sq"), attrs)
    if not all(np.isfinite(value) for value in values if isinstance(value, float)):
        raise ParameterError(
            f"A: got {A!r} with B = {B!r} and C = {C!r}, wants a size for which "
            "lambda = B/A and psi = C/A are finite; use .coefficients(), which has no such "
            "limit"
        )
    return Reduced(*values)
