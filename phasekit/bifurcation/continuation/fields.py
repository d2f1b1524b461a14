"""Right-hand sides in the form that the stepping code calls.

A `Field` is f(x, p) with all its parameters. `first(active)` and `second(active)` are what the
kernels of a trace take: functions of the unknowns u = (x, free parameters) that write f with its
derivatives by u, row by row; the second goes on with the derivatives of f_u z.
"""

from __future__ import annotations

import functools
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from phasekit.arrays import Array
from phasekit.errors import ParameterError
from phasekit.laws.kept_formulas import KeptFormulas, read
from phasekit.numerics import differences
from phasekit.numerics.differences import DERIVED
from phasekit.numerics.long_formulas import LongFormulas, long_formulas
from phasekit.numerics.slopes import slope

Formulas = tuple[Any, ...]
Names = tuple[str, ...]
Places = tuple[int, ...]

KINKED = {"Abs", "sign", "Heaviside", "Max", "Min", "Piecewise"}


class Field:
    """A right-hand side with states and parameters by name."""

    mode = DERIVED
    compiled = True
    accuracy = 1e-13  # of its first derivatives, relative
    exact = False  # whether all its derivatives are those of formulas
    steps = 1  # of a map: how often it is applied

    def __init__(self, states: Sequence[str], parameters: Sequence[str]) -> None:
        self.states, self.parameters = tuple(states), tuple(parameters)
        self.failure: Exception | None = None  # what f raised last, instead of a value

    @property
    def raised(self) -> str:
        """What f raised last instead of a value, in words; nothing if it never did."""
        failure = self.failure
        return "" if failure is None else f": it raised {type(failure).__name__}: {failure}"

    def first(self, active: tuple[int, ...], *, sharp: bool = False) -> Any:
        """F and its derivatives, or f alone where the mode is PLAIN.

        ``sharp`` asks for derivatives of points that are refined, where they may take longer.
        """
        raise NotImplementedError

    def second(self, active: tuple[int, ...]) -> Any:
        """Function that writes f, its derivatives and those of f_u z."""
        raise NotImplementedError

    def third(self, active: tuple[int, ...]) -> Any:
        """Third derivative along the three directions that z holds, of a symbolic field."""
        raise NotImplementedError

    def derivative(self, active: tuple[int, ...], order: int) -> Any:
        """The derivative along so many directions, which z holds, of a symbolic field."""
        raise NotImplementedError

    def values(self, u: Array, par: Array, active: tuple[int, ...]) -> Array:
        """F at many points, the rows of u; NaN where it has no value."""
        raise NotImplementedError

    def values_of_cells(self, u: Array, pars: Array, active: tuple[int, ...]) -> Array:
        """F at points u[k] with the parameters pars[k] each, shape (cells, points, states)."""
        both = zip(u, pars, strict=True)
        return np.array([self.values(points, par.copy(), active) for points, par in both])

    def with_terms(self, u: Array, par: Array, active: tuple[int, ...]) -> tuple[Array, Array]:
        """F at many points, and the sums of the sizes of its terms, of a symbolic field."""
        raise NotImplementedError

    def slopes_along(
        self, par: Array, active: tuple[int, ...], u: Array, z: Array
    ) -> Callable[[Array], Array] | None:
        """f_u z at a point, as a function of the point, if it is known without differences of f."""
        return None

    def prepare(self, scale: Array) -> None:
        """Take the scales of the states, for differences."""


class SymbolicField(Field):
    """A right-hand side of sympy expressions; its derivatives are exact."""

    exact = True

    def __init__(
        self,
        formulas: Sequence[Any] | KeptFormulas,
        states: Sequence[str],
        parameters: Sequence[str],
    ) -> None:
        super().__init__(states, parameters)
        self.formulas = formulas if isinstance(formulas, KeptFormulas) else tuple(formulas)

    @property
    def expressions(self) -> Formulas:
        """The expressions."""
        found: Formulas = read(self.formulas)
        return found

    def _code(self, compiled: Callable[..., int], active: Places, *more: int) -> int:
        """Address of machine code, which a function makes of the expressions, or which is kept."""

        def find() -> int:
            return compiled(self.expressions, self.states, self.parameters, active, *more)

        if not isinstance(self.formulas, KeptFormulas):
            return find()
        question = (compiled.__name__, self.states, self.parameters, active, *more)
        return self.formulas.answer(question, lambda: (None, (find(),)))[1][0]

    def first(self, active: tuple[int, ...], *, sharp: bool = False) -> int:
        """Machine code for f and its derivatives."""
        return self._code(first_of, active)

    def second(self, active: tuple[int, ...]) -> int:
        """Machine code for f, its derivatives and those of f_u z."""
        return self._code(_second, active)

    def with_terms(self, u: Array, par: Array, active: tuple[int, ...]) -> tuple[Array, Array]:
        """F at many points, the rows of u, and the sums of the sizes of its terms there."""
        n, out = len(self.states), self._both(u, par[None], active)
        return out[:, :n], np.abs(out[:, n:])

    def values(self, u: Array, par: Array, active: tuple[int, ...]) -> Array:
        """F at many points, the rows of u."""
        return self._both(u, par[None], active)[:, : len(self.states)]

    def values_of_cells(self, u: Array, pars: Array, active: tuple[int, ...]) -> Array:
        """F at points of many cells, by one call."""
        found = self._both(u.reshape(-1, u.shape[-1]), pars, active)
        return found.reshape(*u.shape[:2], -1)[..., : len(self.states)]

    def _both(self, u: Array, pars: Array, active: tuple[int, ...]) -> Array:
        n = len(self.states)
        out = np.empty((len(u), 2 * n))
        function = self._code(_terms, active)
        places = np.array(active, dtype=np.int64)
        differences.values(function, 2 * n, pars, places, u, out)
        return out

    def third(self, active: tuple[int, ...]) -> int:
        """Machine code for the third derivative along three directions."""
        return self._code(_third, active)

    def derivative(self, active: tuple[int, ...], order: int) -> int:
        """Machine code for the derivative of an order along as many directions."""
        return self._code(_derivative, active, order)


def refuse_uncompiled(expression: Any, states: set[Any], argument: str) -> None:
    """Refuse functions that have no machine code, or whose derivatives by the states have none."""
    import sympy

    from phasekit.numerics.machine_code import COMPILED, DIFFERENTIABLE

    for part in expression.atoms(sympy.Function):
        name = type(part).__name__
        fixed = not part.free_symbols & states
        if part.free_symbols and name not in (COMPILED if fixed else DIFFERENTIABLE):
            what = "itself" if name not in COMPILED else "its derivative"
            raise ParameterError(
                f"{argument}: got the function {name}, which has no machine code {what}, wants "
                f"one of {', '.join(sorted(DIFFERENTIABLE))} of the states; a Python or "
                "numba-compiled f may hold any"
            )


def unknowns_of(
    states: tuple[str, ...], parameters: tuple[str, ...], active: tuple[int, ...]
) -> tuple[list[Any], dict[Any, tuple[int, int]]]:
    """Symbols of the unknowns, and the places of all symbols for machine code."""
    import sympy

    names = [*states, *(parameters[i] for i in active)]
    u = [sympy.Symbol(name, real=True) for name in names]
    places = {sympy.Symbol(name, real=True): (1, i) for i, name in enumerate(parameters)}
    places.update({symbol: (0, i) for i, symbol in enumerate(u)})
    return u, places


def slopes_of(expressions: Sequence[Any], u: Sequence[Any]) -> list[dict[int, Any]]:
    """Derivatives that do not vanish, by the places of their symbols, of each expression."""
    place = {symbol: j for j, symbol in enumerate(u)}
    found: dict[Any, dict[Any, Any]] = {symbol: {} for symbol in u}
    return [
        {
            place[s]: slope(e, s, found[s])
            for s in sorted(e.free_symbols & place.keys(), key=place.__getitem__)
        }
        for e in expressions
    ]


def _jet(expressions: Sequence[Any], u: Sequence[Any]) -> tuple[dict[int, Any], int]:
    """F and its derivatives, row by row, those that do not vanish by their places; how many."""
    n, m = len(expressions), len(u)
    entries = dict(enumerate(expressions))
    for i, row in enumerate(slopes_of(expressions, u)):
        entries.update({n + i * m + j: one for j, one in row.items()})
    return entries, n + n * m


@functools.lru_cache(maxsize=256)
def first_of(expressions: Formulas, states: Names, parameters: Names, active: Places) -> int:
    """Address of machine code for expressions and their derivatives by the unknowns."""
    from phasekit.numerics.machine_code import compile_expressions

    u, places = unknowns_of(states, parameters, active)
    if long := long_formulas(expressions, places, u):
        return long.first()
    entries, count = _jet(expressions, u)
    return compile_expressions(entries, places, count)


@functools.lru_cache(maxsize=256)
def _second(expressions: Formulas, states: Names, parameters: Names, active: Places) -> int:
    import sympy

    from phasekit.numerics.machine_code import compile_expressions

    u, places = unknowns_of(states, parameters, active)
    if long := long_formulas(expressions, places, u):
        return long.second()
    z = [sympy.Dummy(f"z{i}", real=True) for i in range(len(u))]
    entries, count = _jet(expressions, u)
    along = [
        sympy.Add(*(one * z[j] for j, one in row.items())) for row in slopes_of(expressions, u)
    ]
    for i, row in enumerate(slopes_of(along, u)):
        entries.update({count + i * len(u) + j: one for j, one in row.items()})
    places.update({symbol: (2, i) for i, symbol in enumerate(z)})
    return compile_expressions(entries, places, count + len(expressions) * len(u))


@functools.lru_cache(maxsize=256)
def _terms(expressions: Formulas, states: Names, parameters: Names, active: Places) -> int:
    from phasekit.numerics.machine_code import compile_expressions

    u, places = unknowns_of(states, parameters, active)
    if long := long_formulas(expressions, places, u):
        return long.terms()
    return compile_expressions([*expressions, *map(magnitude, expressions)], places)


def magnitude(e: Any) -> Any:
    """An expression with the sizes of all terms of its sums added up, those inside functions too.

    Rounding of this, to first order, bounds the error with which the expression is computed.
    """
    import sympy

    from phasekit.numerics.machine_code import DIFFERENTIABLE

    if e.is_Add:
        return sympy.Add(*map(magnitude, e.args))
    if e.is_Mul:
        return sympy.Mul(*map(magnitude, e.args))
    if e.is_Pow and e.exp.is_Integer and e.exp.is_positive:
        return magnitude(e.base) ** e.exp
    smooth = e.is_Pow or type(e).__name__ in DIFFERENTIABLE - KINKED
    if not smooth or not e.free_symbols:
        return abs(e)
    places = [sympy.Dummy(real=True) for _ in e.args]
    terms = [abs(e)]
    for place, argument in zip(places, e.args, strict=True):
        if argument.is_Add or argument.is_Mul or not argument.is_Atom:
            outer = slope(e.func(*places), place).subs(dict(zip(places, e.args, strict=True)))
            terms.append(abs(outer) * magnitude(argument))
    return sympy.Add(*terms)


@functools.lru_cache(maxsize=256)
def _third(expressions: Formulas, states: Names, parameters: Names, active: Places) -> int:
    import sympy

    from phasekit.numerics.machine_code import compile_expressions

    u, places = unknowns_of(states, parameters, active)
    if long := long_formulas(expressions, places, u):
        return long.third()
    z = [sympy.Dummy(f"z{i}", real=True) for i in range(3 * len(u))]
    along = list(expressions)
    for k in range(3):
        directions = z[k * len(u) : (k + 1) * len(u)]
        along = [
            sympy.Add(*(one * directions[j] for j, one in row.items()))
            for row in slopes_of(along, u)
        ]
    places.update({symbol: (2, i) for i, symbol in enumerate(z)})
    return compile_expressions(along, places)


@functools.lru_cache(maxsize=64)
def _derivative(
    expressions: Formulas, states: Names, parameters: Names, active: Places, order: int
) -> int:
    u, places = unknowns_of(states, parameters, active)
    return LongFormulas(expressions, places, len(u)).derivative(order)
