"""Derivatives of formulas, written so that they keep their digits."""

from __future__ import annotations

from typing import Any

import sympy as sp


class _Tanh(sp.Function):  # type: ignore[misc]
    def fdiff(self, argindex: int = 1) -> Any:
        return _Cosh(self.args[0]) ** -2


class _Cosh(sp.Function):  # type: ignore[misc]
    def fdiff(self, argindex: int = 1) -> Any:
        return _Tanh(self.args[0]) * self


def derivative(expression: Any, x: Any, order: int = 1) -> Any:
    """Differentiate; the slope of tanh(u) is 1/cosh(u)^2.

    sympy's 1 - tanh(u)^2 has no digits left beside a step; and cosh(u)^-n is differentiated to
    tanh(u) cosh(u)^-n, as sinh(u) cosh(u)^-(n+1) overflows there.

    Examples
    --------
    >>> from sympy.abc import x
    >>> derivative(sp.tanh(x), x, 2)
    -2*tanh(x)/cosh(x)**2
    """
    found = expression.replace(sp.tanh, _Tanh).replace(sp.cosh, _Cosh)
    found = sp.diff(found, x, order)
    return found.replace(_Tanh, sp.tanh).replace(_Cosh, sp.cosh)
