"""Functions that stand in the derivatives of formulas beside those of the formulas themselves."""

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
#: Functions of sympy, and those that are differentiated in their place.
INSTEAD = ((sp.tanh, _Tanh), (sp.cosh, _Cosh), (sp.Si, _Si), (sp.LambertW, _LambertW))
