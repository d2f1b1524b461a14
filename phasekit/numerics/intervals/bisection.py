"""Boxes of formulas that hold a zero, cell by cell in one compiled call: bisected, one by one.

What drops a box or makes one of it is Krawczyk's operator, as in `.zeros`; here a cell's boxes wait
on a stack of its own.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from phasekit.arrays import Array
from phasekit.numerics.compile import kernel, routine
from phasekit.numerics.intervals.kernel import DEFINED, NOWHERE, operate
from phasekit.numerics.intervals.krawczyk import UNIT

#: A box is tested a little larger than it is, so that zeros on its faces lie inside.
INFLATED = 0.05
#: Boxes of a cell that wait, and that are looked at; unknowns.
DEEP, MOST, FEW = 512, 20_000, 8
#: What is counted of a cell: boxes with one zero, undecided ones, all; whether it was left.
ONES, LOST, VISITED, LEFT = range(4)


@routine
def invert(matrix: Array, inverse: Array, n: int) -> bool:
    """The inverse of a matrix, which is used up; whether it has one."""
    for i in range(n):
        for j in range(n):
            inverse[i, j] = 1.0 if i == j else 0.0
    for j in range(n):
        pivot = j
        for i in range(j + 1, n):
            if abs(matrix[i, j]) > abs(matrix[pivot, j]):
                pivot = i
        if not abs(matrix[pivot, j]) > 0.0:
            return False
        for k in range(n):
            one, two = matrix[j, k], inverse[j, k]
            matrix[j, k], inverse[j, k] = matrix[pivot, k], inverse[pivot, k]
            matrix[pivot, k], inverse[pivot, k] = one, two
        by = 1.0 / matrix[j, j]
        for k in range(n):
            matrix[j, k] *= by
            inverse[j, k] *= by
        for i in range(n):
            factor = matrix[i, j]
            if i != j and factor != 0.0:
                for k in range(n):
                    matrix[i, k] -= factor * matrix[j, k]
                    inverse[i, k] -= factor * inverse[j, k]
    for i in range(n):
        for j in range(n):
            if not np.isfinite(inverse[i, j]):
                return False
    return True


@routine
def excludes(low: Array, high: Array, outputs: npt.NDArray[np.int64], n: int) -> bool:
    """Whether a component of f has one sign all over a box."""
    for i in range(n):
        if low[0, outputs[i]] > 0.0 or high[0, outputs[i]] < 0.0:
            return True
    return False


@routine
def image_of(
    low: Array, high: Array, outputs: npt.NDArray[np.int64], box: Array, inverse: Array,
    square: Array, n: int,
) -> bool:  # fmt: skip
    """Krawczyk's image of a box, its ends in the last two rows of it; whether it is usable.

    Bounds of f in the middle stand in row 0, those of its derivatives over the box in row 1.
    """
    rounding = UNIT * (2 * n + 6)
    for i in range(n):
        for j in range(n):
            place = outputs[n + i * n + j]
            square[i, j] = 0.5 * low[1, place] + 0.5 * high[1, place]
            if not np.isfinite(square[i, j]):
                return False
    if not invert(square, inverse, n):
        return False
    for i in range(n):
        step = 0.0
        radius = 0.0
        for k in range(n):
            a, b = low[0, outputs[k]], high[0, outputs[k]]
            value = 0.5 * (a + b)
            step += inverse[i, k] * value
            radius += abs(inverse[i, k]) * (0.5 * (b - a) + rounding * abs(value))
        for j in range(n):
            same = 1.0 if i == j else 0.0
            product = 0.0
            spread = 0.0
            for k in range(n):
                place = outputs[n + k * n + j]
                a, b = low[1, place], high[1, place]
                center = 0.5 * a + 0.5 * b
                product += inverse[i, k] * center
                spread += abs(inverse[i, k]) * (0.5 * (b - a) + rounding * abs(center))
            off = abs(same - product) + spread + rounding * same
            radius += off * max(box[3, j] - box[4, j], box[4, j] - box[2, j])
        radius *= 1.0 + 2.0 * rounding
        radius += 4.0 * UNIT * (abs(box[4, i]) + abs(step))
        if not (np.isfinite(radius) and np.isfinite(step)):
            return False
        box[5, i] = box[4, i] - step - radius
        box[6, i] = box[4, i] - step + radius
        box[7, i] = box[4, i] - step
    return True


@kernel
def bisect(
    code: npt.NDArray[np.int64], numbers: Array, ulps: float, outputs: npt.NDArray[np.int64],
    values: Array, whole: Array, narrowest: Array, ones: Array, lost: Array,
    counts: npt.NDArray[np.int64],
) -> None:  # fmt: skip
    """Boxes of each cell that hold one zero, with a point next to it, and undecided ones.

    ``values`` are the numbers of the cells; rows of a cell's ``ones`` are the point and the ends.
    """
    n, steps = whole.shape[1], code.shape[0]
    few = 0  # operations that f takes, its derivatives come after it
    for i in range(n):
        few = max(few, outputs[i] - n - values.shape[1] + 1)
    low = np.zeros((2, n + values.shape[1] + steps))
    high = np.zeros((2, n + values.shape[1] + steps))
    # Ends of a box, of a larger one, its middle, ends of the image and its middle.
    box, inverse, square = np.zeros((8, n)), np.zeros((n, n)), np.zeros((n, n))
    stack = np.zeros((DEEP, 2 * n))
    for cell in range(values.shape[0]):
        for row in range(2):
            for j in range(values.shape[1]):
                low[row, n + j] = high[row, n + j] = values[cell, j]
        for i in range(n):
            stack[0, i] = whole[0, i]
            stack[0, n + i] = whole[1, i]
        top, visited, found, undecided = 1, 0, 0, 0
        while top > 0:
            if (
                visited >= MOST or top + 1 >= DEEP or found >= ones.shape[1]
                or undecided >= lost.shape[1]
            ):  # fmt: skip
                counts[cell, LEFT] = 1
                break
            top -= 1
            visited += 1
            for i in range(n):
                a, b = stack[top, i], stack[top, n + i]
                around = INFLATED * (b - a) + 1e-15 * (whole[1, i] - whole[0, i])
                low[0, i], high[0, i] = a, b
                low[1, i], high[1, i] = a - around, b + around
                box[0, i], box[1, i] = a, b
                box[2, i], box[3, i], box[4, i] = a - around, b + around, 0.5 * (a + b)
            worst = operate(code, numbers, ulps, 0, few, low, high, 0)
            # Bounds are those of all values that f has in a box, if it has any.
            if worst == NOWHERE or excludes(low, high, outputs, n):
                continue
            defined = worst == DEFINED
            if defined:
                for i in range(n):
                    low[0, i] = high[0, i] = box[4, i]
                defined = operate(code, numbers, ulps, 0, few, low, high, 0) == DEFINED
            if defined:
                defined = operate(code, numbers, ulps, 0, steps, low, high, 1) == DEFINED
            narrow = True
            if defined and image_of(low, high, outputs, box, inverse, square, n):
                inside = True
                apart = False
                for i in range(n):
                    inside = inside and box[5, i] > box[2, i] and box[6, i] < box[3, i]
                    apart = apart or box[5, i] > box[1, i] or box[6, i] < box[0, i]
                if apart:
                    continue
                if inside:
                    for i in range(n):
                        ones[cell, found, i] = box[7, i]
                        ones[cell, found, n + i] = box[2, i]
                        ones[cell, found, 2 * n + i] = box[3, i]
                    found += 1
                    continue
                for i in range(n):
                    box[0, i] = max(box[0, i], box[5, i])
                    box[1, i] = min(box[1, i], box[6, i])
            side = 0
            widest = -1.0
            for i in range(n):
                width = box[1, i] - box[0, i]
                narrow = narrow and width <= narrowest[i]
                part = width / (whole[1, i] - whole[0, i])
                if part > widest:
                    widest = part
                    side = i
            if narrow:
                for i in range(n):
                    lost[cell, undecided, i] = box[0, i]
                    lost[cell, undecided, n + i] = box[1, i]
                undecided += 1
                continue
            cut = 0.5 * (box[0, side] + box[1, side])
            for i in range(n):
                stack[top, i] = stack[top + 1, i] = box[0, i]
                stack[top, n + i] = stack[top + 1, n + i] = box[1, i]
            stack[top, n + side] = cut
            stack[top + 1, side] = cut
            top += 2
        counts[cell, ONES], counts[cell, LOST] = found, undecided
        counts[cell, VISITED] = visited
