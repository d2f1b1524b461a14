"""A potential as a formula: read, differentiated and made into array functions; its shape.

The shape decides how equilibria are found: a polynomial and a Fourier sum have all of theirs in
the eigenvalues of a companion matrix, anything else is interpolated on an interval.
"""

from __future__ import annotations

import functools
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from enum import Enum
from typing import Any

import numpy as np
import numpy.typing as npt

from phasekit.errors import ParameterError

Array = npt.NDArray[np.float64]
Values = Sequence[npt.ArrayLike]

#: Points at which a formula is tried: no special angles or integers among them.
_TRIALS = np.array([-0.4871, -0.2713, 0.0931, 0.3197, 0.4439])
#: Harmonics up to which a Fourier sum is treated as one.
_MOST_HARMONICS = 128


class Shape(Enum):
    """What is known of a potential beyond its values."""

    POLYNOMIAL = "polynomial"
    FOURIER = "Fourier sum"
    GENERAL = "general"


@dataclass(frozen=True, eq=False)
class Formula:
    """A potential of one coordinate and named parameters, on a line or a circle.

    `values`, `slopes` and `bends` are V, V' and V''; each takes x and the parameters in the order
    of `names`, as arrays that broadcast.
    """

    text: str
    coordinate: str
    names: tuple[str, ...]
    period: float | None
    interval: tuple[float, float] | None
    shape: Shape
    expression: Any
    values: Callable[..., Array]
    slopes: Callable[..., Array]
    bends: Callable[..., Array]
    _coefficients: Callable[..., Any] | None

    @property
    def bounded(self) -> bool:
        """Whether equilibria are looked for on a finite stretch: a circle or an interval."""
        return self.period is not None or self.interval is not None

    @property
    def ends(self) -> tuple[float, float]:
        """Where the coordinate lies: the circle cut at half a period, the interval, the line."""
        if self.period is not None:
            return -0.5 * self.period, 0.5 * self.period
        return self.interval if self.interval is not None else (-np.inf, np.inf)

    def slope_coefficients(self, parameters: Values) -> npt.NDArray[Any]:
        """Coefficients of V', lowest first, on the last axis.

        Of a polynomial those of its powers; of a Fourier sum the complex c_0 to c_n of
        ``V' = sum of c_k exp(2 pi i k x/period)`` over positive and negative k.
        """
        if self._coefficients is None:
            raise ParameterError(f"expression: got {self.text}, wants a polynomial or Fourier sum")
        with np.errstate(all="ignore"):
            found = self._coefficients(*(np.asarray(value, float) for value in parameters))
        return np.stack(np.broadcast_arrays(*found), axis=-1)


@functools.lru_cache(maxsize=128)
def make_formula(
    expression: Any,
    coordinate: str,
    names: tuple[str, ...],
    period: float | None,
    interval: tuple[float, float] | None,
) -> Formula:
    """Return the formula of a potential.

    Parameters
    ----------
    expression : str or sympy expression
        The potential. Both ``^`` and ``**`` raise to a power in a string.
    coordinate : str
        Name of the coordinate in it.
    names : tuple of str
        Names of the parameters in it; every other symbol is refused.
    period : float or None
        Length of the circle, None for a line.
    interval : (float, float) or None
        The part of the line that is looked at.

    Raises
    ------
    ParameterError
        If the expression cannot be read, has an unknown symbol, or is not smooth and real.
    """
    import sympy as sp

    symbols = {name: sp.Symbol(name, real=True) for name in (coordinate, *names)}
    x = symbols[coordinate]
    potential = _read(expression, symbols)
    unknown = sorted(map(str, potential.free_symbols - set(symbols.values())))
    if unknown:
        raise ParameterError(
            f"expression: got {potential} with the unknown symbol {', '.join(unknown)}, wants the "
            f"coordinate {coordinate} and parameters that have values"
            + (f" ({', '.join(names)})" if names else "")
            + f"; give parameters={{{unknown[0]!r}: ...}}"
        )
    slope = sp.diff(potential, x)
    bend = sp.diff(slope, x)
    for order in (potential, slope, bend):
        if order.has(sp.I, sp.Derivative, sp.Subs, sp.DiracDelta, sp.zoo, sp.nan, sp.oo):
            raise ParameterError(
                f"expression: got {potential}, wants a real function of {coordinate} that sympy "
                "can differentiate twice"
            )
    arguments = [x, *(symbols[name] for name in names)]
    shape, coefficients = _shape(slope, x, period)
    lambdify = functools.partial(sp.lambdify, modules="numpy", printer=_numpy_printer())
    values, slopes, bends = (
        _array_function(lambdify(arguments, f, cse=_shared)) for f in (potential, slope, bend)
    )
    series = None if coefficients is None else lambdify(arguments[1:], coefficients, cse=True)
    return Formula(
        _text(potential),
        coordinate,
        names,
        period,
        interval,
        shape,
        potential,
        values,
        slopes,
        bends,
        series,
    )


def _read(expression: Any, symbols: dict[str, Any]) -> Any:
    import sympy as sp
    from sympy.parsing.sympy_parser import convert_xor, parse_expr, standard_transformations

    if isinstance(expression, str):
        try:
            potential = parse_expr(
                expression,
                local_dict=dict(symbols),
                transformations=(*standard_transformations, convert_xor),
            )
        except Exception as error:  # whatever Python and sympy make of the text
            raise ParameterError(
                f"expression: got {expression!r}, wants a formula that sympy reads, such as "
                f"'x^4/4 - x^2/2' ({type(error).__name__}: {error})"
            ) from None
        if not isinstance(potential, sp.Expr):
            raise ParameterError(f"expression: got {expression!r}, wants a formula of one value")
        return potential
    # Symbols of the caller may have other assumptions; the name is what counts.
    return expression.xreplace(
        {s: symbols[s.name] for s in expression.free_symbols if s.name in symbols}
    )


def _numpy_printer() -> Any:
    """Return sympy's printer of NumPy code, but with all digits of numbers, where it keeps 15."""
    from sympy.printing.numpy import NumPyPrinter

    class Exact(NumPyPrinter):  # type: ignore[misc]
        def _print_Float(self, number: Any) -> str:
            return repr(float(number))

    return Exact(
        {"fully_qualified_modules": False, "inline": True, "allow_unknown_functions": True}
    )


def _text(expression: Any) -> str:
    """Write an expression so that reading it gives the same numbers."""
    from sympy.printing.str import StrPrinter

    class Exact(StrPrinter):  # type: ignore[misc]
        def _print_Float(self, number: Any) -> str:
            return repr(float(number))

    return str(Exact().doprint(expression))


def _shared(expression: Any) -> tuple[list[tuple[Any, Any]], Any]:
    """Take out what occurs twice, and write small powers as products, which numpy does faster.

    In this order: sympy miscounts factors that it has been told not to collect.
    """
    import sympy as sp
    from sympy.codegen.rewriting import create_expand_pow_optimization

    products = create_expand_pow_optimization(12)
    parts, (rest,) = sp.cse([expression])
    return [(symbol, products(part)) for symbol, part in parts], products(rest)


def _array_function(function: Callable[..., Any]) -> Callable[..., Array]:
    @functools.wraps(function)
    def called(x: npt.ArrayLike, *parameters: npt.ArrayLike) -> Array:
        x = np.asarray(x, dtype=float)
        with np.errstate(all="ignore"):
            result = np.asarray(function(x, *parameters))
        shape = np.broadcast_shapes(x.shape, *(np.shape(value) for value in parameters))
        if result.dtype.kind == "c":
            result = np.where(result.imag == 0.0, result.real, np.nan)
        return np.array(np.broadcast_to(result, shape), dtype=float)

    return called


def _shape(slope: Any, x: Any, period: float | None) -> tuple[Shape, list[Any] | None]:
    """Tell what V' is, with its coefficients if it has such."""
    import sympy as sp

    if slope.is_polynomial(x):
        return Shape.POLYNOMIAL, sp.Poly(sp.expand(slope), x).all_coeffs()[::-1]
    harmonics = None if period is None else _harmonics(slope, x, period)
    if harmonics is not None:
        return Shape.FOURIER, harmonics
    return Shape.GENERAL, None


def _harmonics(slope: Any, x: Any, period: float) -> list[Any] | None:
    """Coefficients c_0 to c_n of a finite Fourier sum; None for any other function."""
    import sympy as sp

    z = sp.Symbol("z", positive=True)
    terms = sp.expand(sp.expand(slope.rewrite(sp.exp)), power_exp=True)
    unit = 2.0 * np.pi / period

    def as_power(exponential: Any) -> Any:
        exponent = sp.expand(exponential.args[0])
        if not exponent.has(x):
            return exponential
        rate = exponent.coeff(x, 1)
        ratio = sp.N(rate / (sp.I * unit))
        rest = exponent - rate * x
        if (
            rest.has(x)
            or not ratio.is_real
            or abs(ratio - round(ratio)) > 1e-12 * max(1, abs(ratio))
        ):
            return exponential
        return z ** int(round(ratio)) * sp.exp(rest)

    terms = sp.expand(terms.replace(lambda part: isinstance(part, sp.exp), as_power))
    if terms.has(x):
        return None
    powers = sp.collect(terms, z, evaluate=False)
    found: dict[int, Any] = {}
    for power, coefficient in powers.items():
        exponent = power.as_base_exp()[1] if power != 1 else sp.Integer(0)
        if coefficient.has(z) or not exponent.is_Integer:
            return None
        found[int(exponent)] = coefficient
    highest = max(map(abs, found), default=0)
    if highest > _MOST_HARMONICS:
        return None  # the companion matrix would outgrow what isolation on the circle takes
    return [found.get(k, sp.Integer(0)) for k in range(highest + 1)]


def check_period(formula: Formula, parameters: Values) -> None:
    """Refuse a potential that does not close on its circle.

    Raises
    ------
    ParameterError
    """
    if formula.period is None:
        return
    x = _TRIALS * formula.period
    columns = [np.ravel(np.asarray(value, float))[:, None] for value in parameters]
    columns = [column[np.isfinite(column[:, 0])][:1] for column in columns]
    if any(not column.size for column in columns):
        return
    here, there = (formula.values(y, *columns) for y in (x, x + formula.period))
    size = np.abs(here).max() + np.abs(formula.slopes(x, *columns)).max() * formula.period
    # Over a very long period rounding hides whether V repeats at all.
    hidden = 1e-12 * size > max(1e-3 * np.ptp(here), 1e-9 * np.abs(here).max())
    if hidden or not np.all(np.abs(here - there) <= 1e-12 * size):
        raise ParameterError(
            f"period: got {formula.period!r}, over which {formula.text} does not repeat, wants a "
            "period of the potential, or None for a line"
        )
