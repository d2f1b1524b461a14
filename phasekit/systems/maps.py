"""Maps that are applied several times: formulas put into one another, and code."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np
import numpy.typing as npt

from phasekit.bifurcation.continuation.code_fields import numbers_of
from phasekit.labels.arguments import bad

FloatArray = npt.NDArray[np.float64]

MOST = 1000  # times that a map is applied
LONGEST = 5000  # operations of formulas that are put into one another


def iterated(
    f: Any, jac: Any, symbols: Mapping[str, Any] | None, times: int
) -> tuple[Any, Callable[..., FloatArray] | None]:
    """A map applied so many times, and its derivatives: formulas of symbols, or code.

    Raises
    ------
    ParameterError
        If formulas grow too long.
    """
    if times > MOST:
        raise bad("times", times, f"a whole number from 1 to {MOST}")
    if symbols is None:
        return Iterate(f, times), None if jac is None else IterateSlopes(f, jac, times)
    found = tuple(f)
    for _ in range(times - 1):
        if sum(one.count_ops() for one in found) > LONGEST:
            raise bad("times", times, "fewer times: the formulas grow too long")
        at = dict(zip(symbols.values(), found, strict=True))
        found = tuple(one.xreplace(at) for one in f)
    return found, None


class Iterate:
    """f(f(... f(x))), so many times."""

    def __init__(self, f: Callable[..., Any], times: int) -> None:
        self.f, self.times = f, times
        self.__name__ = f"{getattr(f, '__name__', 'f')}_{times}_times"

    def __call__(self, x: FloatArray, **parameters: float) -> FloatArray:
        """The state after all steps."""
        x = np.array(x, dtype=float)
        for _ in range(self.times):
            x = numbers_of("f", self.f(x.copy(), **parameters), x.shape)
        return x


class IterateSlopes:
    """The derivatives of an iterate, by the chain rule."""

    def __init__(self, f: Callable[..., Any], jac: Callable[..., Any], times: int) -> None:
        self.f, self.jac, self.times = f, jac, times

    def __call__(self, x: FloatArray, **parameters: float) -> FloatArray:
        """The product of the matrices along the orbit."""
        x = np.array(x, dtype=float)
        matrix = np.eye(x.size)
        for _ in range(self.times):
            matrix = numbers_of("jac", self.jac(x.copy(), **parameters), matrix.shape) @ matrix
            x = numbers_of("f", self.f(x.copy(), **parameters), x.shape)
        return matrix
