"""The part of a potential that does not depend on the coordinate, kept out of all differences.

Motion knows nothing of it, but beside a large constant V would lose the digits by which energies
differ. So a formula is reduced by it, and it is added back where energies are told.
"""

from __future__ import annotations

import functools
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np

from phasekit.arrays import Array
from phasekit.laws.formulas import symbols_of
from phasekit.phase.numerical.code import array_code
from phasekit.phase.numerical.formula import Formula, Values, array_function, shared


def reduced(formula: Formula) -> Formula:
    """V without its constant part: a formula of the same parameters."""
    return _split(formula)[0]


def constant(formula: Formula, parameters: Values) -> Array | float:
    """The constant part of V, in the shape of the parameters."""
    function = _split(formula)[1]
    if function is None:
        return 0.0
    with np.errstate(all="ignore"):
        return np.asarray(function(*(np.asarray(p, float) for p in parameters)), float)


@functools.lru_cache(maxsize=128)
def _split(formula: Formula) -> tuple[Formula, Callable[..., Any] | None]:
    symbols = symbols_of((formula.coordinate, *formula.names))
    x, *parameters = symbols.values()
    still, moving = _parts(formula.expression, x)
    if still == 0:
        return formula, None
    values = array_function(array_code([x, *parameters], moving, shared))
    return replace(formula, expression=moving, values=values), array_code(parameters, still)


def _parts(expression: Any, x: Any) -> tuple[Any, Any]:
    """An expression as the sum of a part without x and one with it."""
    if not expression.has(x):
        return expression, expression * 0
    if expression.is_Add:
        parts = [_parts(term, x) for term in expression.args]
        still, moving = (expression.func(*some) for some in zip(*parts, strict=True))
        return still, moving
    factor, rest = expression.as_independent(x, as_Add=False)
    if expression.is_Mul and rest.is_Add:
        still, moving = _parts(rest, x)
        return factor * still, factor * moving
    return expression * 0, expression
