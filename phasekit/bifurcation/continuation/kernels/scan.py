"""Test functions at the points of a branch of a flow, and the steps in which one changes its sign.

The same as `spectrum.test_functions` and the first look of `events`, in one compiled call. Of each
point a row holds what `Tests` names, in its order; of each step what it is marked by.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from phasekit.arrays import Array
from phasekit.numerics.compile import kernel, routine

#: Columns of the table of points.
FOLD, BRANCH, VOLUME, PAIR, BELOW, REAL, UNSTABLE, COLUMNS = range(8)
#: Columns of the table of steps: whether it is looked at, what changes its sign (the sum of
#: their `BITS`), by how much the number of unstable eigenvalues changes, whether
#: these account for it, and whether more may cross the axis, or return to it, unseen.
MARKED, CHANGES, JUMP, SIMPLE, CROWDED, STEPS = range(6)
#: What is added to the changes of a step for each column.
BITS = (1, 2, 4, 8)
SAME = 1e-10  # part of the largest eigenvalue by which two others are told apart
DIP = 0.3  # part of its value to which a parabola falls that may touch zero
LOW = 0.6  # part of its neighbours' values that a point has next to one
LEFT_OUT = -16.118095650958319  # log(1e-7): a determinant beside its neighbours' on a branch point
ON_END = -11.512925464970229  # log(1e-5): a test function at an end beside a little before
AWAY = 1e-3  # distance, in scales, that is a little before


@routine
def determinant(matrix: Array, m: int) -> tuple[float, float]:
    """Sign of the determinant of a matrix, which is used up, and the logarithm of its size."""
    sign = 1.0
    total = 0.0
    for j in range(m):
        pivot = j
        for i in range(j + 1, m):
            if abs(matrix[i, j]) > abs(matrix[pivot, j]):
                pivot = i
        size = matrix[pivot, j]
        if size == 0.0:
            return 0.0, -np.inf
        if pivot != j:
            sign = -sign
            for k in range(j, m):
                one = matrix[j, k]
                matrix[j, k] = matrix[pivot, k]
                matrix[pivot, k] = one
        if size < 0.0:
            sign = -sign
        total += math.log(abs(size))
        for i in range(j + 1, m):
            factor = matrix[i, j] / size
            for k in range(j + 1, m):
                matrix[i, k] -= factor * matrix[j, k]
    return sign, total


@routine
def sums(real: Array, imag: Array, k: int, n: int, table: Array) -> None:
    """The least sum of two eigenvalues with the sign of the product of all, and how many grow."""
    least = np.inf
    largest = 0.0
    negative = 0
    unstable = 0
    plain = 0
    for i in range(n):
        largest = max(largest, np.sqrt(real[k, i] * real[k, i] + imag[k, i] * imag[k, i]))
        unstable += 1 if real[k, i] > 0.0 else 0
        plain += 1 if imag[k, i] == 0.0 else 0
        for j in range(i + 1, n):
            both = imag[k, i] == -imag[k, j]
            if both and (imag[k, i] == 0.0 or real[k, i] == real[k, j]):
                total = real[k, i] + real[k, j]
                negative += 1 if total < 0.0 else 0
                least = min(least, abs(total))
    if not np.isfinite(least):
        least = 1.0
    table[k, PAIR] = -least if negative % 2 == 1 else least
    table[k, BELOW] = -1.0 if least <= SAME * largest else float(negative)
    table[k, REAL] = float(plain)
    table[k, UNSTABLE] = float(unstable)


@routine
def sign(x: float) -> float:
    """1, -1 or 0."""
    return 1.0 if x > 0.0 else (-1.0 if x < 0.0 else 0.0)


@routine
def dips(table: Array, i: int, column: int) -> bool:
    """Whether a test function almost changes its sign next to the second of three points."""
    if sign(table[i, column]) != sign(table[i + 2, column]):
        return False
    if column == BRANCH:
        a, b, c = table[i, VOLUME], table[i + 1, VOLUME], table[i + 2, VOLUME]
        if not (b <= a and b <= c):
            return False
        unit = max(a, c)
        a, b, c = math.exp(a - unit), math.exp(b - unit), math.exp(c - unit)
    else:
        a, b, c = abs(table[i, column]), abs(table[i + 1, column]), abs(table[i + 2, column])
        if not (b <= a and b <= c):
            return False
    return falls(a, b, c)


@routine
def falls(a: float, b: float, c: float) -> bool:
    """Whether a function may touch zero next to the second of three points in a row, the least."""
    bend = a - 2.0 * b + c
    lowest = b - (c - a) * (c - a) / (8.0 * bend) if bend != 0.0 else b
    return lowest < DIP * b or b < LOW * min(a, c)


@routine
def crowd(slopes: Array, scale: Array, real: Array, imag: Array, steps: Any) -> None:
    """Mark steps in which more may cross the axis, or return to it, than signs tell.

    Nothing crosses that is farther from the axis than f_x moves in a step, or in one beside it: by
    no more than the root of all squares, nor than the geometric mean of the largest sums of a row
    and of a column, which does not grow with the number of states.
    """
    count, n = real.shape
    m = scale.size
    move, parts = np.zeros(count + 1), np.zeros((count, n))  # of the step before each point
    columns = np.zeros(n)
    for k in range(count):
        for i in range(n):  # in order
            j = i
            while j > 0 and parts[k, j - 1] > real[k, i]:
                parts[k, j] = parts[k, j - 1]
                j -= 1
            parts[k, j] = real[k, i]
        if k > 0:
            widest, tallest = 0.0, 0.0
            for j in range(n):
                columns[j] = 0.0
            for i in range(n):
                row = 0.0
                for j in range(n):
                    change = (slopes[k, i * m + j] - slopes[k - 1, i * m + j]) * scale[j] / scale[i]
                    move[k] += change * change
                    row += abs(change)
                    columns[j] += abs(change)
                widest = max(widest, row)
            for j in range(n):
                tallest = max(tallest, columns[j])
            move[k] = math.sqrt(min(move[k], widest * tallest))
    for k in range(count - 1):
        most = max(move[k + 1], max(move[k], move[k + 2]))
        fewest = n
        for end in (k, k + 1):
            near = 0
            for i in range(n):
                near += 1 if imag[end, i] >= 0.0 and abs(real[end, i]) <= most else 0
            fewest = min(fewest, near)
        steps[k, CROWDED] = 1 if fewest > 1 else 0
    for k in range(count - 2):
        # The moves that count are those of both steps and of those beside them.
        most = max(max(move[k], move[k + 1]), max(move[k + 2], move[k + 3]))
        near = 0  # where others are near, too, they may have changed places
        for i in range(n):
            near += 1 if imag[k + 1, i] >= 0.0 and abs(real[k + 1, i]) <= most else 0
        for i in range(n):
            a, b, c = parts[k, i], parts[k + 1, i], parts[k + 2, i]
            same = sign(a) == sign(b) and sign(b) == sign(c)
            a, b, c = abs(a), abs(b), abs(c)
            if same and b <= min(most, min(a, c)) and (falls(a, b, c) or near > 1):
                # Where a side branch of a pitchfork turns, one touches zero.
                for step in (k, k + 1):
                    if steps[step, CHANGES] != BITS[FOLD] + BITS[BRANCH]:
                        steps[step, CROWDED] = 1


@routine
def turns_complex(table: Array, real: Array, imag: Array, k: int, n: int) -> bool:
    """Whether the pair with the least sum is conjugate."""
    least = np.inf
    for i in range(n):
        if imag[k, i] > 0.0:
            least = min(least, 2.0 * abs(real[k, i]))
    return least <= abs(table[k, PAIR]) * (1.0 + 1e-9)


@routine
def mark(table: Array, steps: Any, real: Array, imag: Array, i: int, n: int, last: int) -> None:
    """What changes between two points, and whether that is all there is to it."""
    bits = 0
    number = 0
    simple = 0
    for column in range(last + 1):
        if column != VOLUME and sign(table[i, column]) != sign(table[i + 1, column]):
            bits += BITS[column]
            number += 1
            simple += 1 if column <= BRANCH else 0
    jump = abs(int(table[i + 1, UNSTABLE] - table[i, UNSTABLE]))
    several = False
    explained = simple
    if last == PAIR:
        if bits >= BITS[PAIR]:
            crosses = turns_complex(table, real, imag, i, n)
            crosses = crosses or turns_complex(table, real, imag, i + 1, n)
            explained += 2 if crosses else 0
        if table[i, BELOW] >= 0.0 and table[i + 1, BELOW] >= 0.0:
            change = abs(table[i + 1, BELOW] - table[i, BELOW])
            several = change > 1.0
            steps[i, MARKED] = 1 if change > 0.0 else steps[i, MARKED]
    both = bits == BITS[FOLD] + BITS[BRANCH] and (jump == 0 or jump == 2)
    several = several or jump > explained or (number > 1 and not both)
    several = several or ((jump - simple) % 2 != 0 and n > 1)
    if bits > 0 or (jump > 0 and n > 1):
        steps[i, MARKED] = 1
    steps[i, CHANGES], steps[i, JUMP] = bits, jump
    steps[i, SIMPLE] = 1 if not several and (bits > 0 or jump > 0) else 0


@routine
def ends_on(table: Array, u: Array, scale: Array, end: int, last: int, m: int) -> bool:
    """Whether a test function of an end is next to nothing beside what it is a little before."""
    count = u.shape[0]
    by = 1 if end == 0 else -1
    k = end
    while 0 <= k < count:
        far = 0.0
        for j in range(m):
            far = max(far, abs(u[k, j] - u[end, j]) / scale[j])
        if far > AWAY:
            break
        k += by
    if not 0 <= k < count:
        return False
    if table[end, VOLUME] < table[k, VOLUME] + ON_END:
        return True
    small = math.exp(ON_END)
    if abs(table[end, FOLD]) < small * abs(table[k, FOLD]):
        return True
    return last == PAIR and abs(table[end, PAIR]) < small * abs(table[k, PAIR])


@kernel
def crowds(slopes: Array, scale: Array, growth: Array, imag: Array, steps: Any) -> None:
    """The same for what is known of points alone: growth is what is positive of unstable ones."""
    crowd(slopes, scale, growth, imag, steps)


@kernel
def eigenvalues_of_two(matrices: Array, values: Array) -> None:
    """Eigenvalues of 2 x 2 matrices, rows a, b, c, d; real and imaginary parts by turns."""
    for k in range(matrices.shape[0]):
        a, b, c, d = matrices[k, 0], matrices[k, 1], matrices[k, 2], matrices[k, 3]
        mean, half = 0.5 * (a + d), 0.5 * (a - d)
        root = half * half + b * c
        width = np.sqrt(abs(root))
        if root >= 0.0:
            far = mean + width if mean >= 0.0 else mean - width
            # The product is the determinant, which is exact next to zero where mean -+ width is
            # not. Where all cancels, as of two that are 0, its rounding over that of the mean says
            # nothing.
            near = (a * d - b * c) / far if far != 0.0 else 0.0
            if abs(near) > 2.0 * abs(far):
                near = 2.0 * mean - far
            values[k, 0], values[k, 2] = far, near
            values[k, 1] = values[k, 3] = 0.0
        else:
            values[k, 0] = values[k, 2] = mean
            values[k, 1], values[k, 3] = width, -width


@kernel
def scan(
    u: Array, tangent: Array, slopes: Array, real: Array, imag: Array, scale: Array, pairs: int,
    table: Array, steps: Any,
) -> int:  # fmt: skip
    """Fill both tables; 1 if the ends, 2 if points between look like special points themselves."""
    count, n = real.shape
    m = scale.size
    last = PAIR if pairs == 1 else BRANCH
    matrix = np.zeros((m, m))
    for k in range(count):
        log = 0.0
        for i in range(n):
            largest = 0.0
            for j in range(m):
                matrix[i, j] = slopes[k, i * m + j] * scale[j]
                largest = max(largest, abs(matrix[i, j]))
            largest = largest if largest > 0.0 else 1.0
            log += math.log(largest)
            for j in range(m):
                matrix[i, j] /= largest
        for j in range(m):
            matrix[n, j] = tangent[k, j] / scale[j]
        side, volume = determinant(matrix, m)
        table[k, FOLD] = tangent[k, n] / scale[n]
        table[k, BRANCH] = side
        table[k, VOLUME] = volume + log
        sums(real, imag, k, n, table)
        if pairs == 0:
            table[k, PAIR], table[k, BELOW] = 1.0, -1.0
    found = 0
    for k in range(count - 1):
        steps[k, MARKED] = 0
    for k in range(count - 1):
        mark(table, steps, real, imag, k, n, last)
        if k + 2 < count:
            around = max(table[k, VOLUME], table[k + 2, VOLUME])
            if not table[k + 1, VOLUME] > around + LEFT_OUT:
                found = 2
            for column in range(last + 1):
                if column != VOLUME and dips(table, k, column):
                    steps[k, MARKED] = 1
                    steps[k + 1, MARKED] = 1
    if n > 1:
        crowd(slopes, scale, real, imag, steps)
    if found == 0 and count > 1:
        first = ends_on(table, u, scale, 0, last, m)
        if first or ends_on(table, u, scale, count - 1, last, m):
            found = 1
    return found
