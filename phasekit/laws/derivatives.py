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


class _Si(sp.Function):  # type: ignore[misc]
    def fdiff(self, argindex: int = 1) -> Any:
        return SphericalJ0(self.args[0])


class _LambertW(sp.Function):  # type: ignore[misc]
    def fdiff(self, argindex: int = 1) -> Any:
        return sp.exp(-self) / (1 + self)


class SphericalJ0(sp.Function):  # type: ignore[misc]
    """sin(x)/x, 1 at x = 0: the slope of Si."""

    def fdiff(self, argindex: int = 1) -> Any:
        """Return its derivative."""
        return -SphericalJ1(self.args[0])


class SphericalJ1(sp.Function):  # type: ignore[misc]
    """sin(x)/x^2 - cos(x)/x, 0 at x = 0."""


#: What derivatives may hold beside the functions of formulas.
DERIVED = frozenset({SphericalJ0, SphericalJ1})
_INSTEAD = ((sp.tanh, _Tanh), (sp.cosh, _Cosh), (sp.Si, _Si), (sp.LambertW, _LambertW))


def derivative(expression: Any, x: Any, order: int = 1) -> Any:
    """Differentiate, at most twice; the slope of tanh(u) is 1/cosh(u)^2.

    sympy's 1 - tanh(u)^2 has no digits left beside a step; and cosh(u)^-n is differentiated to
    tanh(u) cosh(u)^-n, as sinh(u) cosh(u)^-(n+1) overflows there. The slopes of Si and LambertW
    are finite at 0, where sympy's are 0/0.

    Examples
    --------
    >>> from sympy.abc import x
    >>> derivative(sp.tanh(x), x, 2)
    -2*tanh(x)/cosh(x)**2
    """
    for function, own in _INSTEAD:
        expression = expression.replace(function, own)
    found = sp.diff(expression, x, order)
    for function, own in _INSTEAD:
        found = found.replace(own, function)
    return found
