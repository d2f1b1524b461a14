"""A potential as a formula: read, differentiated and made into array functions; its shape.

The shape decides how equilibria are found: a polynomial and a Fourier sum have all of theirs in
the eigenvalues of a companion matrix, anything else is interpolated on an interval.
"""

from __future__ import annotations

import functools
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from enum import Enum
from typing import Any

import numpy as np
import numpy.typing as npt

from phasekit.arrays import Array
from phasekit.errors import ParameterError
from phasekit.inputs import reals
from phasekit.laws.formulas import short_formula, symbols_of, take_formula, write_formula
from phasekit.laws.grammar import FormulaError
from phasekit.laws.ladder import Conservative, is_turn
from phasekit.laws.size import derived_nodes, expanded_terms
from phasekit.phase.numerical.code import Literals, array_code

Values = Sequence[npt.ArrayLike]

#: Points at which a formula is tried: no special angles or integers among them.
_TRIALS = np.array([-0.4871, -0.2713, 0.0931, 0.3197, 0.4439])
#: Harmonics up to which a Fourier sum is treated as one.
_MOST_HARMONICS = 128

#: Most terms that a formula is multiplied out to, and most nodes of its second derivative.
_TERMS, _NODES = 5000, 50_000


class Shape(Enum):
    """What is known of a potential beyond its values."""

    POLYNOMIAL = "polynomial"
    FOURIER = "Fourier sum"
    GENERAL = "general"


@dataclass(frozen=True, eq=False)
class Formula(Conservative):
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
    coefficients: Callable[..., Any] | None

    def __reduce__(self) -> tuple[Any, ...]:
        """Travel as text; the functions are made anew."""
        own = (self.text, self.coordinate, self.names, self.period, self.interval)
        return make_formula, own

    def derivative(self, order: int) -> Callable[..., Array]:
        """A derivative of V of any order, as an array function like `values`."""
        return _higher(self, order)

    def gradient_formula(self, symbols: Mapping[str, Any]) -> Any:
        """V' as a sympy expression of real symbols."""
        own = {symbol: symbols[str(symbol)] for symbol in self.expression.free_symbols}
        return self.expression.xreplace(own).diff(symbols[self.coordinate])

    @property
    def may_be_incomplete(self) -> bool:
        """Whether equilibria may be missed: those of polynomials and Fourier sums are not."""
        return self.shape is Shape.GENERAL

    def expressions(self, *orders: int) -> tuple[list[Any], list[Any]]:
        """V or derivatives of it, of the orders 0 to 2, and the symbols of (x, parameters)."""
        from phasekit.laws.derivatives import derivative

        x, *others = symbols_of((self.coordinate, *self.names)).values()
        found = [derivative(self.expression, x, n) if n else self.expression for n in orders]
        return found, [x, *others]

    @property
    def unbounded_function(self) -> str | None:
        """Name of a function in it of which no bounds are known, so that nothing is proved."""
        return _unbounded_function(self) if self.shape is Shape.GENERAL else None

    def check_searchable(self) -> None:
        """Refuse to look for the equilibria of a function on the whole line."""
        if self.shape is Shape.GENERAL and not self.bounded:
            raise ParameterError(
                f"interval: got None, wants (low, high), the stretch of the line on which the "
                f"equilibria of {self.text} are looked for, because it is not a polynomial; or "
                "give its period, if it has one"
            )

    def words(self, name: str, units: str, long_name: str) -> dict[str, str]:
        """The formula as the source, and a coordinate that need not be an angle."""
        words = {"source": f"V = {self.text}"}
        if name == "potential":
            words["equation"] = f"V = {self.text}"
        if units == "rad" and not is_turn(self.period):
            distance = long_name.replace("signed angle", "signed distance")
            words |= {"units": "1", "long_name": distance.replace("angle", "coordinate")}
        return words

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
        if self.coefficients is None:
            raise ParameterError(f"expression: got {self.text}, wants a polynomial or Fourier sum")
        with np.errstate(all="ignore"):
            found = self.coefficients(*(np.asarray(value, float) for value in parameters))
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

    Both ``^`` and ``**`` raise to a power in a string; symbols other than the coordinate and the
    names are refused. The period is None for a line, of which an interval may be searched.
    """
    symbols = symbols_of((coordinate, *names))
    x = symbols[coordinate]
    declare = "a parameter needs a value: parameters={'name': ...}"
    potential = take_formula(expression, symbols, "expression", declare, exact=True)
    arguments = [x, *(symbols[name] for name in names)]
    numbers = Literals()
    written = numbers.instead(potential)
    slope, bend = _derivatives(written, x, {**symbols, **numbers.symbols})
    shape, coefficients = shape_of(numbers.back(slope), x, period)
    values, slopes, bends = (
        array_function(array_code(arguments, f, shared)) for f in (written, slope, bend)
    )
    series = None if coefficients is None else array_code(arguments[1:], coefficients)
    return Formula(
        write_formula(potential, exact=True),
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


@functools.lru_cache(maxsize=128)
def _higher(formula: Formula, order: int) -> Callable[..., Array]:
    """The array function of a higher derivative of V."""
    from phasekit.laws.derivatives import derivative
    from phasekit.laws.derived import DERIVED
    from phasekit.laws.nodes import foreign

    symbols = symbols_of((formula.coordinate, *formula.names))
    arguments = [symbols[name] for name in (formula.coordinate, *formula.names)]
    numbers = Literals()
    found = derivative(numbers.instead(formula.expression), arguments[0], order)
    strange = foreign(found, [*arguments, *numbers.symbols.values()], DERIVED)
    if strange is not None:
        raise ParameterError(
            f"system: got V = {formula.text}, wants a potential of which phasekit can compute the "
            f"derivative of order {order}; it holds {type(strange).__name__}"
        )
    return array_function(array_code(arguments, found, shared))


@functools.lru_cache(maxsize=128)
def _unbounded_function(formula: Formula) -> str | None:
    from phasekit.numerics.intervals.bounds import missing_rule

    return missing_rule(*formula.expressions(1, 2))


def _derivatives(potential: Any, x: Any, symbols: Mapping[str, Any]) -> tuple[Any, Any]:
    """V' and V'', if they are functions that can be computed."""
    import sympy as sp

    from phasekit.laws.derivatives import derivative
    from phasekit.laws.derived import DERIVED
    from phasekit.laws.nodes import foreign

    try:
        if derived_nodes(potential, x) > _NODES:
            raise FormulaError
        slope, bend = derivative(potential, x), derivative(potential, x, 2)
        strange = next(
            filter(None, (foreign(o, symbols.values(), DERIVED) for o in (slope, bend))), None
        )
    except (RecursionError, FormulaError):
        raise ParameterError(
            "expression: got a formula that is nested too deeply, or too long, to differentiate"
        ) from None
    if strange is not None or any(o.has(sp.I, sp.zoo, sp.nan, sp.oo) for o in (slope, bend)):
        held = f"; its derivatives hold {type(strange).__name__}" if strange is not None else ""
        raise ParameterError(
            f"expression: got {short_formula(potential)}, wants a real function of {x} that sympy "
            f"can differentiate twice{held}"
        )
    return slope, bend


def shared(expression: Any) -> tuple[list[tuple[Any, Any]], Any]:
    """Take out what occurs twice, and write small powers as products, which numpy does faster.

    In this order: sympy miscounts factors that it has been told not to collect.
    """
    import sympy as sp
    from sympy.codegen.rewriting import create_expand_pow_optimization

    products = create_expand_pow_optimization(12)
    parts, (rest,) = sp.cse([expression])
    return [(symbol, products(part)) for symbol, part in parts], products(rest)


def _fits(shape: tuple[int, ...], other: tuple[int, ...]) -> bool:
    """Whether an array of a shape broadcasts to another: found sooner than by NumPy."""
    if len(shape) > len(other):
        return False
    return all(a in (1, b) for a, b in zip(shape[::-1], other[::-1], strict=False))


def array_function(function: Callable[..., Any]) -> Callable[..., Array]:
    """Code as a function of reals that broadcast; NaN where its values are not real."""

    @functools.wraps(function)
    def called(x: npt.ArrayLike, *parameters: npt.ArrayLike) -> Array:
        if type(x) is not np.ndarray or x.dtype != np.float64:
            x = reals("x", x, "real numbers, array_like")
        with np.errstate(all="ignore"):
            result = np.asarray(function(x, *parameters))
        if result.dtype.kind == "c":
            result = np.where(result.imag == 0.0, result.real, np.nan)
        if result.shape == x.shape and all(_fits(np.shape(one), x.shape) for one in parameters):
            return np.array(result, dtype=float)
        shape = np.broadcast_shapes(x.shape, *(np.shape(value) for value in parameters))
        return np.array(np.broadcast_to(result, shape), dtype=float)

    return called


def shape_of(slope: Any, x: Any, period: float | None) -> tuple[Shape, list[Any] | None]:
    """Tell what V' is, with its coefficients if it has such."""
    import sympy as sp

    if expanded_terms(slope) > _TERMS:
        return Shape.GENERAL, None
    if slope.is_polynomial(x):
        return Shape.POLYNOMIAL, sp.Poly(sp.expand(slope), x).all_coeffs()[::-1]
    harmonics = None if period is None else _harmonics(slope, x, period)
    if harmonics is not None:
        return Shape.FOURIER, harmonics
    return Shape.GENERAL, None


def _harmonics(slope: Any, x: Any, period: float) -> list[Any] | None:
    """Coefficients c_0 to c_n of a finite Fourier sum; None for any other function."""
    import sympy as sp

    if any(p.exp.is_Integer and p.exp > _MOST_HARMONICS and p.has(x) for p in slope.atoms(sp.Pow)):
        return None  # which takes long to multiply out
    below = (p.base for p in slope.atoms(sp.Pow) if p.exp.is_negative and p.base.has(x))
    if any(sp.expand(sp.expand(one.rewrite(sp.exp))).has(x) for one in below):
        return None  # a quotient, whose numerator alone takes long to multiply out
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
            or not ratio.is_number  # of a parameter
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
    """Refuse a potential that does not close on its circle."""
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
