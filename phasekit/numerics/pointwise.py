"""Formulas at many points, with their slopes that do not vanish: compiled once for all of them."""

from __future__ import annotations

import functools
from collections.abc import Sequence
from typing import Any

import numpy as np

from phasekit.arrays import Array
from phasekit.numerics import differences
from phasekit.numerics.tape import Tape
from phasekit.numerics.tape_code import compile_tape
from phasekit.numerics.tape_formulas import write


class Pointwise:
    """Machine code of formulas of values at a point and of parameters.

    Attributes
    ----------
    rows, columns : ndarray of int, shape (slopes,)
        Of each slope the formula, and by which value, or, after these, parameter it is taken.
    """

    def __init__(
        self, expressions: Sequence[Any], values: Sequence[Any], parameters: Sequence[Any]
    ) -> None:
        """Take formulas, and the symbols of the values and parameters."""
        places = {symbol: (0, i) for i, symbol in enumerate(values)}
        places |= {symbol: (1, i) for i, symbol in enumerate(parameters)}
        tape = Tape(places)
        nodes = write(tape, expressions)
        self.count, self.width = len(nodes), len(values)
        arguments = [tape.argument(0, i) for i in range(len(values))]
        arguments += [tape.argument(1, i) for i in range(len(parameters))]
        found = [
            (i, j, d) for i, k in enumerate(nodes) for j, d in tape.gradient(k, arguments).items()
        ]
        self.rows = np.array([i for i, _, _ in found], dtype=np.int64)
        self.columns = np.array([j for _, j, _ in found], dtype=np.int64)
        self._plain = compile_tape(tape, dict(enumerate(nodes)), self.count)
        entries = {i: d for i, (_, _, d) in enumerate(found)}
        self._slopes = compile_tape(tape, entries, len(found))

    def __call__(self, points: Array, parameters: Array) -> Array:
        """The formulas at points, the rows of an array: shape (points, formulas)."""
        return self._evaluated(self._plain, self.count, points, parameters)

    def slopes(self, points: Array, parameters: Array) -> Array:
        """Their slopes at points: shape (points, slopes)."""
        return self._evaluated(self._slopes, len(self.rows), points, parameters)

    def _evaluated(self, code: int, count: int, points: Array, parameters: Array) -> Array:
        out = np.zeros((len(points), count))
        if count:
            width = max(count, self.width)  # of the working array
            wide = out if width == count else np.zeros((len(points), width))
            nothing = np.zeros(0, dtype=np.int64)
            par = np.array(parameters, float)
            differences.values(code, width, par[None], nothing, np.ascontiguousarray(points), wide)
            out = wide[:, :count]
        return np.asarray(out)


@functools.lru_cache(maxsize=64)
def pointwise(
    expressions: tuple[Any, ...], values: tuple[str, ...], parameters: tuple[str, ...]
) -> Pointwise:
    """Formulas of real symbols by their names, compiled once."""
    import sympy

    names = ([sympy.Symbol(name, real=True) for name in given] for given in (values, parameters))
    return Pointwise(expressions, *names)
