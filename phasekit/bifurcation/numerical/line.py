"""A potential along a straight line of parameters, and what bounds are computed of there.

The place on a line is the parameter itself where one moves alone, else it runs from 0 to 1.
"""

from __future__ import annotations

import functools
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np

from phasekit.arrays import Array
from phasekit.laws.derivatives import derivative
from phasekit.laws.formulas import symbols_of
from phasekit.phase.numerical import functions
from phasekit.phase.numerical.equilibria import Equilibria
from phasekit.phase.numerical.formula import Formula

#: Names that no parameter has.
PLACE, START, RISE = "_s", "_from_{}", "_rise_{}"


class Terms(NamedTuple):
    """The slope of a potential along a line as a formula, and the symbols in it."""

    slope: Any
    x: Any
    s: Any
    parameters: tuple[Any, ...]

    def derivative(self, order: int, along: int = 0) -> Any:
        """A derivative of V, so often by x and by the place on the line."""
        return _derived(self.slope, self.x, self.s, order, along)


@functools.lru_cache(maxsize=256)
def _derived(slope: Any, x: Any, s: Any, order: int, along: int) -> Any:
    found = derivative(slope, x, order - 1) if order > 1 else slope
    return derivative(found, s, along) if along else found


@functools.lru_cache(maxsize=64)
def terms_of(formula: Formula, moving: tuple[str, ...]) -> Terms:
    """V' where some parameters move along a line; the other symbols are numbers of the line."""
    symbols = symbols_of((formula.coordinate, *formula.names))
    x = symbols[formula.coordinate]
    slope = derivative(formula.expression, x)
    still = [symbols[name] for name in formula.names if name not in moving]
    if len(moving) == 1:
        return Terms(slope, x, symbols[moving[0]], tuple(still))
    extra = symbols_of(
        [PLACE, *(START.format(n) for n in moving), *(RISE.format(n) for n in moving)]
    )
    s, starts, rises = (
        extra[PLACE],
        [extra[START.format(n)] for n in moving],
        [extra[RISE.format(n)] for n in moving],
    )
    ways = {symbols[n]: a + s * b for n, a, b in zip(moving, starts, rises, strict=True)}
    return Terms(slope.subs(ways, simultaneous=True), x, s, (*still, *starts, *rises))


@dataclass(frozen=True, eq=False)
class Line:
    """A straight line in the parameters of a potential.

    Attributes
    ----------
    formula : Formula
        The potential.
    still : mapping of str to float
        Parameters that stand still.
    moving : mapping of str to (float, float)
        First and last values of the others.
    """

    formula: Formula
    still: Mapping[str, float]
    moving: Mapping[str, tuple[float, float]]

    @property
    def span(self) -> tuple[float, float]:
        """Where the line begins and ends."""
        if len(self.moving) > 1:
            return 0.0, 1.0
        (ends,) = self.moving.values()
        return min(ends), max(ends)

    @cached_property
    def terms(self) -> Terms:
        """V' as a formula of x and the place."""
        return terms_of(self.formula, tuple(self.moving))

    @cached_property
    def numbers(self) -> dict[Any, float]:
        """Values of the symbols of `terms`."""
        values = [self.still[name] for name in self.formula.names if name not in self.moving]
        if len(self.moving) > 1:
            values += [first for first, _ in self.moving.values()]
            values += [last - first for first, last in self.moving.values()]
        return dict(zip(self.terms.parameters, values, strict=True))

    def parameters(self, s: Array) -> list[Array]:
        """Parameters of the formula at places."""
        found = {name: np.full(np.shape(s), value) for name, value in self.still.items()}
        for name, (first, last) in self.moving.items():
            alone = len(self.moving) == 1
            found[name] = np.asarray(s, float) if alone else first + s * (last - first)
        return [found[name] for name in self.formula.names]

    def equilibria(self, s: Array) -> Equilibria:
        """All equilibria at places, one row each."""
        return functions.equilibria(self.formula, *self.parameters(s))

    def height(self, s: float, x: float) -> float:
        """V at a place."""
        return float(self.formula.values(x, *self.parameters(np.asarray(s))))

    def derivative(self, order: int, along: int, s: float, x: float) -> float:
        """A derivative of V at a place: so often by x and by the place."""
        rate = rate_of(self.formula, tuple(self.moving), order, along)
        with np.errstate(all="ignore"):
            return float(rate(x, s, *self.numbers.values()))

    @property
    def circle(self) -> float | None:
        """Length of the circle of the coordinate, None on a line."""
        return self.formula.period


@functools.lru_cache(maxsize=256)
def rate_of(formula: Formula, moving: tuple[str, ...], order: int, along: int) -> Any:
    """A derivative of V along lines as a function of x, the place, and the numbers of a line."""
    from phasekit.phase.numerical.code import array_code
    from phasekit.phase.numerical.formula import array_function, shared

    terms = terms_of(formula, moving)
    arguments = [terms.x, terms.s, *terms.parameters]
    return array_function(array_code(arguments, terms.derivative(order, along), shared))
