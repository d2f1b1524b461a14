"""Bounds of formulas over boxes of their symbols, arrays of boxes at once.

Elementary functions by the compiled `kernel`, special functions by `special`. A first pass over
boxes takes these, as balls would take ten times as long; what it leaves open, `balls` decides.
"""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from copy import copy
from typing import Any, TypeAlias

import numpy as np

from phasekit.arrays import Array, Codes, Flags
from phasekit.numerics.intervals import special
from phasekit.numerics.intervals.balls import constant, ends
from phasekit.numerics.intervals.kernel import OPERATIONS, evaluate
from phasekit.numerics.intervals.program import ELEMENTARY, NoRule, Program, real_program
from phasekit.numerics.launch import launch

#: Lower and upper bounds, arrays of one shape.
Interval: TypeAlias = tuple[Any, Any]

#: Units in the last place by which functions of the C library may be off.
ULPS = 4.0
#: Boxes whose entries are held at once.
_AT_ONCE = 1024
#: Operations that take the time of a cell of other kernels.
_OF_A_CELL = 12
FUNCTIONS = frozenset({*ELEMENTARY, *special.RULES, *special.OF_AN_ORDER})


class Evaluator:
    """Bounds of the entries of a program over boxes of its inputs."""

    def __init__(self, program: Program, ulps: float = ULPS, special_ulps: float = 0.0) -> None:
        self.program, self.ulps, self.special_ulps = program, ulps, special_ulps
        numbers: list[tuple[float, float]] = []
        rows = []
        self._special: list[tuple[int, special.Rule]] = []
        for k, (name, places, own) in enumerate(program.operations):
            own_number = own if name == "power" else 0
            if name in ("number", "root"):
                own_number = len(numbers)
                numbers.append(constant_bounds(own))
            elif name not in OPERATIONS:
                rule = special.RULES.get(name) or special.OF_AN_ORDER[name](own)
                self._special.append((k, rule))
            first, second = (*places, 0, 0)[:2]
            rows.append((OPERATIONS.get(name, -1), first, second, own_number))
        self._code = np.array(rows, dtype=np.int64).reshape(-1, 4)
        self._numbers = np.array(numbers, dtype=float).reshape(-1, 2)

    def __call__(self, inputs: Sequence[Interval]) -> tuple[list[Interval], Codes]:
        """Bounds of the outputs, and where an entry may be, or is, undefined or has a pole.

        That is coded by `kernel.DEFINED`, `DOUBTFUL` and `NOWHERE`.
        """
        shape = np.broadcast_shapes(*(np.shape(end) for pair in inputs for end in pair))
        size = int(np.prod(shape, dtype=int))
        flat = [[_flat(end, shape, size) for end in pair] for pair in inputs]
        undefined = np.zeros(size, dtype=np.int8)
        out = np.empty((2, len(self.program.outputs), size))
        for start in range(0, size, _AT_ONCE):
            rows = slice(start, min(start + _AT_ONCE, size))
            low, high = self._entries([(a[rows], b[rows]) for a, b in flat], undefined[rows])
            out[0, :, rows] = low[:, self.program.outputs].T
            out[1, :, rows] = high[:, self.program.outputs].T
        found = [(low.reshape(shape), high.reshape(shape)) for low, high in zip(*out, strict=True)]
        return found, undefined.reshape(shape)

    @property
    def arrays(self) -> tuple[Any, ...] | None:
        """The program as kernels take it; none where it has special functions."""
        outputs = np.array(self.program.outputs, dtype=np.int64)
        return None if self._special else (self._code, self._numbers, self.ulps, outputs)

    def _entries(
        self, inputs: Sequence[tuple[Array, Array]], undefined: Codes
    ) -> tuple[Array, Array]:
        size, steps = undefined.size, len(self._code)
        weight = 1 + steps // _OF_A_CELL
        low, high = np.empty((2, size, len(inputs) + steps))
        for i, (a, b) in enumerate(inputs):
            low[:, i], high[:, i] = a, b
        with np.errstate(all="ignore"):
            edges = [-1, *(k for k, _ in self._special), steps]
            for i, (before, after) in enumerate(itertools.pairwise(edges)):
                arrays = (self._code, self._numbers, self.ulps, before + 1, after)
                launch(evaluate, arrays, size, [(low, high, undefined)], None, weight)
                if after < steps:
                    place, to = self._code[after, 1], len(inputs) + after
                    least, most = self._spread(low[:, place], high[:, place])
                    least, most, bad = self._special[i][1](least, most)
                    low[:, to], high[:, to] = self._spread(least, most)
                    np.maximum(undefined, bad, out=undefined)
        return low, high

    def _spread(self, low: Array, high: Array) -> tuple[Array, Array]:
        """What special functions are computed of, or give, where they are not balls."""
        part = self.special_ulps * 2.0**-52
        return low - part * np.abs(low), high + part * np.abs(high)


def _flat(end: Any, shape: tuple[int, ...], size: int) -> Array:
    """Ends of all boxes in one row; single numbers need no laying out."""
    array = np.asarray(end, dtype=float)
    if array.size == 1:
        return np.full(size, array.item()) if size > 1 else array.reshape(1)
    return np.broadcast_to(array, shape).reshape(-1)


class Bounds:
    """Bounds of some expressions over boxes of their symbols.

    Elementary functions may be off by `ulps` units in the last place, special functions, which
    balls bound without any, and what these are taken of, by `special_ulps`. NoRule is raised of a
    function that has no rule here.
    """

    def __init__(
        self,
        expressions: Sequence[Any],
        symbols: Sequence[Any],
        ulps: float = ULPS,
        special_ulps: float = 0.0,
    ) -> None:
        program = real_program(expressions, symbols, FUNCTIONS)
        self._evaluate = Evaluator(program, ulps, special_ulps)

    def first(self, count: int) -> Bounds:
        """The bounds of the first expressions alone, which take less time."""
        few, own = copy(self), self._evaluate
        few._evaluate = Evaluator(own.program.first(count), own.ulps, own.special_ulps)
        return few

    @property
    def arrays(self) -> tuple[Any, ...] | None:
        """What kernels take: operations, numbers, units and outputs; none of special functions."""
        return self._evaluate.arrays

    def __call__(self, *inputs: Interval) -> tuple[list[Interval], Flags]:
        """Return the bounds of each expression, and where one may be undefined or have a pole.

        Bounds of infinite size stand for any value.
        """
        found, undefined = self.coded(*inputs)
        return found, undefined > 0

    def coded(self, *inputs: Interval) -> tuple[list[Interval], Codes]:
        """The same with codes of where they are defined: all over, at places, or nowhere."""
        return self._evaluate(inputs)


def missing_rule(expressions: Sequence[Any], symbols: Sequence[Any]) -> str | None:
    """The name of a function in expressions of which no bounds are known."""
    try:
        real_program(expressions, symbols, FUNCTIONS)
    except NoRule as missing:
        return str(missing)
    return None


def constant_bounds(value: Any) -> tuple[float, float]:
    """Doubles that hold an expression without symbols, or these as they are.

    NoRule is raised of what is no finite real number.
    """
    if isinstance(value, tuple):
        return value
    if value.is_Integer and abs(value) <= 2**53:
        return float(value), float(value)
    low, high = ends([constant(value)])
    return float(low[0]), float(high[0])
