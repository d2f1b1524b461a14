"""Derivatives of formulas, written so that they keep their digits."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from phasekit.numerics.later import later

if TYPE_CHECKING:
    import sympy as sp
else:
    sp = later("sympy")


def derivative(expression: Any, x: Any, order: int = 1) -> Any:
    """Differentiate, at most twice; the slope of tanh(u) is 1/cosh(u)^2.

    sympy's 1 - tanh(u)^2 has no digits left beside a step; and cosh(u)^-n is differentiated to
    tanh(u) cosh(u)^-n, as sinh(u) cosh(u)^-(n+1) overflows there. The slopes of Si and LambertW
    are finite at 0, where sympy's are 0/0.

    >>> from sympy.abc import x
    >>> derivative(sp.tanh(x), x, 2)
    -2*tanh(x)/cosh(x)**2
    """
    from phasekit.laws.derived import INSTEAD

    for function, own in INSTEAD:
        expression = expression.replace(function, own)
    found = sp.diff(expression, x, order)
    for function, own in INSTEAD:
        found = found.replace(own, function)
    return found
