"""Folds, Hopf points and neutral saddles of formulas: many in one call, with their normal forms.

Each lies between two points of a branch f(x, p) = 0, from which Newton's method begins: on f = 0,
f_x v = 0, v.v = 1 for a fold, on f = 0, (f_x^2 + k) v = 0, v.v = 1, l.v = 0 for two eigenvalues
+-sqrt(-k) ([Govaerts2000] chapters 4 and 6). A point counts as placed if it is regular by a good
margin: no other eigenvalue vanishes, branches do not cross, no coefficient of the normal form is
next to zero, and it lies between both points. All others are left to whoever looks closer.

Vectors and matrices are pieces of one flat array, by the places where they begin: unknowns, their
scales, three directions, f with its derivatives twice, a matrix with two right sides, and vectors.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from phasekit.arrays import Array
from phasekit.numerics.compile import kernel, routine
from phasekit.numerics.differences import DERIVED as DERIVED
from phasekit.numerics.native import call, solve

STEPS = 20
#: Coefficients and products beside what they could be, and eigenvalues beside the largest one.
REGULAR, APART = 1e-4, 1e-6
#: Largest entries of the inverse of f_x, in units of f and of the states.
STIFF = 1e3
#: Part of the sum of its terms from which on a coefficient has a sign.
SIGNED = 1e-9
#: What is returned of each point: whether it is placed, the largest equation, three coefficients;
#: then unknowns and tangent, and from `VECTOR` on, after 2 (n + 1) numbers, v, l and k.
PLACED, RESIDUAL, FIRST, SECOND, THIRD, VECTOR = range(6)


@routine
def places(n: int) -> tuple[int, ...]:
    """Where the pieces of the work array begin, and its length."""
    m, size = n + 1, 2 * n + 2
    scale = size
    z = scale + size
    out = z + 3 * m
    more = out + n + 2 * n * m
    a = more + n + 2 * n * m
    b = a + size * size
    spare = b + 2 * size
    return scale, z, out, more, a, b, spare, spare + 8 * size


@routine
def solve_scaled(w: Array, a: int, b: int, size: int, scale: int) -> float:
    """Solve for two right sides in their place, rows brought to one size and columns to scales."""
    for i in range(size):
        largest = 0.0
        for j in range(size):
            w[a + i * size + j] *= w[scale + j]
            largest = max(largest, abs(w[a + i * size + j]))
        inverse = 1.0 / largest if largest > 0.0 else 1.0
        for j in range(size):
            w[a + i * size + j] *= inverse
        w[b + 2 * i] *= inverse
        w[b + 2 * i + 1] *= inverse
    return solve(w, a, b, size)


@routine
def newton(w: Array, a: int, b: int, size: int, scale: int, before: float) -> float:
    """A step of Newton's method on what stands as matrix and right side; its size, or -1.

    The first unknowns of the work array are moved. -2: it no longer shrinks, the point is there.
    """
    for i in range(size):
        w[b + 2 * i + 1] = 0.0
    if solve_scaled(w, a, b, size, scale) == 0.0:
        return -1.0
    step = 0.0
    for j in range(size):
        moved = abs(w[b + 2 * j])
        if not moved <= step:  # NaN stays
            step = moved
    if not step < 1e3:
        return -1.0
    for j in range(size):
        w[j] += w[scale + j] * w[b + 2 * j]
    # In parts of the scales.
    if step <= 1e-15 or (step <= 1e-9 and step >= 0.5 * before):
        return -2.0
    return step


@routine
def begin(w: Array, n: int, scale: int, ends: Array, k: int, weight: Array, s: float) -> None:
    """The cubic through both points, with their tangents, at a part s of the way; its scales."""
    m = n + 1
    square = 0.0
    for j in range(m):
        chord = ends[k, 2 * m + j] - ends[k, j]
        square += weight[k, j] * chord * chord
    h = np.sqrt(square)
    for j in range(m):
        chord = ends[k, 2 * m + j] - ends[k, j]
        bent = (1.0 - s) * ends[k, m + j] - s * ends[k, 3 * m + j]
        w[j] = ends[k, j] + (3.0 - 2.0 * s) * s * s * chord + h * s * (1.0 - s) * bent
    for j in range(n):
        w[scale + m + j] = w[scale + j]


@routine
def is_between(w: Array, m: int, ends: Array, k: int, weight: Array) -> bool:
    """Whether the point lies between both, and no farther from the chord than half its length."""
    square = 0.0
    product = 0.0
    for j in range(m):
        chord = ends[k, 2 * m + j] - ends[k, j]
        square += weight[k, j] * chord * chord
        product += weight[k, j] * chord * (w[j] - ends[k, j])
    part = product / square
    if not (-1e-6 <= part <= 1.0 + 1e-6):
        return False
    across = 0.0
    for j in range(m):
        gap = w[j] - ends[k, j] - part * (ends[k, 2 * m + j] - ends[k, j])
        across += weight[k, j] * gap * gap
    return across <= 0.25 * square


@routine
def keep_tangent(
    w: Array, m: int, t: int, ends: Array, k: int, weight: Array, found: Array
) -> None:
    """The tangent at place t, of length one and in the direction of the branch."""
    square = 0.0
    ahead = 0.0
    for j in range(m):
        square += weight[k, j] * w[t + j] * w[t + j]
        ahead += weight[k, j] * w[t + j] * (ends[k, m + j] + ends[k, 3 * m + j])
    by = -np.sqrt(square) if ahead < 0.0 else np.sqrt(square)
    for j in range(m):
        found[k, VECTOR + j] = w[j]
        found[k, VECTOR + m + j] = w[t + j] / by


@routine
def sizes(second: Any, w: Array, n: int, par: Array, z: int, more: int, at: int) -> None:
    """Sizes of the entries of f: of its first and second derivatives by scaled states.

    The span of a parameter says nothing of where f turns steep in it.
    """
    m, scale = n + 1, 2 * n + 2
    for j in range(m):
        w[z + j] = w[scale + j] if j < n else 0.0
    call(second, w, 0, par, z, more)
    for i in range(n):
        one = 0.0
        two = 0.0
        for j in range(n):
            one = max(one, abs(w[more + n + i * m + j] * w[scale + j]))
            two = max(two, abs(w[more + n + n * m + i * m + j] * w[scale + j]))
        w[at + i] = one + two if one + two > 0.0 else 1.0


@kernel
def folds(
    second: Any, n: int, pars: Array, scales: Array, weight: Array, ends: Array, found: Array
) -> None:
    """Place folds between two points of a branch each, and find a and b of their normal forms.

    ``ends`` holds in each row the first point and its tangent, then the other and its own.
    """
    m, size = n + 1, 2 * n + 1
    scale, z, out, more, a, b, spare, length = places(n)
    jac, bent = out + n, out + n + n * m
    left, rows = spare, spare + size
    w = np.zeros(length)
    for k in range(ends.shape[0]):
        par = pars[k]
        for j in range(m):
            w[scale + j] = scales[k, j]
        one, two = ends[k, m + n], ends[k, 3 * m + n]
        s = one / (one - two)
        begin(w, n, scale, ends, k, weight, s)
        square = 0.0
        for j in range(n):
            w[m + j] = (1.0 - s) * ends[k, m + j] + s * ends[k, 3 * m + j]
            part = w[m + j] / w[scale + j]
            square += part * part
        for j in range(n):
            w[m + j] /= np.sqrt(square)
        before = np.inf
        for turn in range(STEPS):
            for j in range(m):
                w[z + j] = w[m + j] if j < n else 0.0
            call(second, w, 0, par, z, out)
            residual = 0.0
            for i in range(size * size):
                w[a + i] = 0.0
            norm = -1.0
            for i in range(n):
                turned = 0.0
                for j in range(n):
                    turned += w[jac + i * m + j] * w[m + j]
                    w[a + (n + i) * size + m + j] = w[jac + i * m + j]
                for j in range(m):
                    w[a + i * size + j] = w[jac + i * m + j]
                    w[a + (n + i) * size + j] = w[bent + i * m + j]
                part = w[m + i] / w[scale + i]
                norm += part * part
                w[a + 2 * n * size + m + i] = 2.0 * part / w[scale + i]
                w[b + 2 * i] = -w[out + i]
                w[b + 2 * (n + i)] = -turned
                residual = max(residual, max(abs(w[out + i]), abs(turned)))
            w[b + 4 * n] = -norm
            if before == -2.0 or turn == STEPS - 1:
                break
            before = newton(w, a, b, size, scale, before)
            if before == -1.0:
                break
        if before != -2.0 or not is_between(w, m, ends, k, weight):
            continue
        found[k, RESIDUAL] = max(residual, abs(norm))
        sizes(second, w, n, par, z, more, rows)
        # The left null vector, bordered by f_p, with which its product is one.
        for i in range(m):
            for j in range(m):
                if j == n:
                    value = w[m + i] / w[scale + i] if i < n else 0.0
                else:
                    value = w[jac + j * m + i] * w[scale + i] / w[rows + j]
                w[a + i * m + j] = value
            w[b + 2 * i] = w[b + 2 * i + 1] = 1.0 if i == n else 0.0
        for i in range(m):
            w[left + i] = 1.0
        if solve_scaled(w, a, b, m, left) == 0.0:
            continue
        unit = 0.0
        product = 0.0
        terms = 0.0
        curved = 0.0
        slope = 0.0
        square = 0.0
        largest = 0.0
        sign = 1.0
        for i in range(n):
            p = w[b + 2 * i] / w[rows + i]
            w[left + i] = p
            unit += abs(p) * w[rows + i]
            product += p * w[m + i]
            terms += abs(p * w[m + i])
            slope += p * w[jac + i * m + n]
            for j in range(n):
                curved += p * w[bent + i * m + j] * w[m + j]
            square += w[m + i] * w[m + i]
            if abs(w[m + i]) > largest:
                largest = abs(w[m + i])
                sign = 1.0 if w[m + i] > 0.0 else -1.0
        regular = abs(slope) * w[scale + n] > REGULAR * unit and abs(curved) > REGULAR * unit
        if not (regular and abs(product) > REGULAR * terms):
            continue
        norm = np.sqrt(square)
        found[k, FIRST] = 0.5 * sign * curved / (product * norm)
        found[k, SECOND] = slope * norm * sign / product
        for j in range(n):
            w[spare + j] = w[m + j]
            found[k, VECTOR + 2 * m + j] = w[m + j]
        w[spare + n] = 0.0
        keep_tangent(w, m, spare, ends, k, weight, found)
        found[k, PLACED] = 1.0


@routine
def choose(w: Array, jac: int, scale: int) -> None:
    """Of two states: the vector that f_x turns most, of four, and the determinant for k."""
    m = 3
    most = -1.0
    best = 0
    half = np.sqrt(0.5)
    for way in range(4):
        one = (1.0, 0.0, half, half)[way]
        two = (0.0, 1.0, half, -half)[way]
        x = w[jac] * one + w[jac + 1] * two * w[scale + 1] / w[scale]
        y = w[jac + m] * one * w[scale] / w[scale + 1] + w[jac + m + 1] * two
        off = abs(one * y - two * x)
        if off > most:
            most = off
            best = way
    w[m] = (1.0, 0.0, half, half)[best] * w[scale]
    w[m + 1] = (0.0, 1.0, half, -half)[best] * w[scale + 1]
    w[m + 2] = w[jac] * w[jac + m + 1] - w[jac + 1] * w[jac + m]


@kernel
def pairs(
    second: Any, third: Any, n: int, pars: Array, scales: Array, weight: Array, ends: Array,
    starts: Array, found: Array,
) -> None:  # fmt: skip
    """Place Hopf points and neutral saddles, and find l1, omega and d of the former.

    ``starts`` holds in each row the part of the way at which the point is looked for and, of more
    than two states, v and k.
    """
    m, size = n + 1, 2 * n + 2
    scale, z, out, more, a, b, spare, length = places(n)
    jac = out + n
    y, l, rows = spare, spare + size, spare + 2 * size  # noqa: E741
    w = np.zeros(length)
    for k in range(ends.shape[0]):
        par = pars[k]
        for j in range(m):
            w[scale + j] = scales[k, j]
        begin(w, n, scale, ends, k, weight, starts[k, 0])
        for j in range(n + 1):
            w[m + j] = starts[k, 1 + j]
        for j in range(m):
            w[z + j] = w[m + j] if j < n else 0.0
        call(second, w, 0, par, z, out)
        if n == 2:
            choose(w, jac, scale)
        w[scale + size - 1] = abs(w[size - 1])
        square = 0.0
        along = 0.0
        for i in range(n):
            w[y + i] = 0.0
            for j in range(n):
                w[y + i] += w[jac + i * m + j] * w[m + j]
            w[y + i] /= w[scale + i]
            along += w[y + i] * w[m + i] / w[scale + i]
        for i in range(n):
            w[l + i] = w[y + i] - along * w[m + i] / w[scale + i]
            square += w[l + i] * w[l + i]
        if not (square > 0.0 and abs(w[size - 1]) > 0.0):
            continue
        for i in range(n):
            w[l + i] /= np.sqrt(square) * w[scale + i]
        before = np.inf
        for turn in range(STEPS):
            residual = pair_equations(second, w, n, par, l, y)
            if before == -2.0 or turn == STEPS - 1:
                break
            before = newton(w, a, b, size, scale, before)
            if before == -1.0:
                break
        kappa = w[size - 1]
        largest = 0.0
        for i in range(n):
            for j in range(n):
                entry = w[jac + i * m + j] * w[scale + j] / w[scale + i]
                largest = max(largest, abs(entry))
        there = before == -2.0 and is_between(w, m, ends, k, weight)
        # An eigenvector of one real eigenvalue solves the equations as well: f_x v is along v.
        along = 0.0
        square = 0.0
        for i in range(n):
            along += w[y + i] * w[m + i] / (w[scale + i] * w[scale + i])
            square += w[y + i] * w[y + i] / (w[scale + i] * w[scale + i])
        two = square - along * along > REGULAR * square
        if not (there and two and abs(kappa) > APART * largest * largest):
            continue
        sizes(second, w, n, par, z, more, rows)
        t = spare + 3 * size
        if not motion(w, n, jac, rows, t):
            continue
        if kappa > 0.0 and not hopf_form(second, third, w, n, par, y, t, found, k):
            continue
        found[k, RESIDUAL] = residual
        for j in range(n):
            found[k, VECTOR + 2 * m + j] = w[m + j]
            found[k, VECTOR + 2 * m + n + j] = w[l + j]
        found[k, VECTOR + 2 * m + 2 * n] = kappa
        keep_tangent(w, m, t, ends, k, weight, found)
        found[k, PLACED] = 1.0


@routine
def pair_equations(second: Any, w: Array, n: int, par: Array, l: int, y: int) -> float:  # noqa: E741
    """The matrix and the right side of Newton's method for two eigenvalues; the largest equation.

    The derivatives along v and along y = f_x v are left beside f and f_x.
    """
    m, size = n + 1, 2 * n + 2
    scale, z, out, more, a, b, _, _ = places(n)
    jac, bent, twice = out + n, out + n + n * m, more + n + n * m
    kappa = w[size - 1]
    for j in range(m):
        w[z + j] = w[m + j] if j < n else 0.0
    call(second, w, 0, par, z, out)
    for i in range(n):
        w[y + i] = 0.0
        for j in range(n):
            w[y + i] += w[jac + i * m + j] * w[m + j]
        w[z + i] = w[y + i]
    call(second, w, 0, par, z, more)
    for i in range(size * size):
        w[a + i] = 0.0
    residual = 0.0
    norm = -1.0
    phase = 0.0
    for i in range(n):
        row = a + (n + i) * size
        value = kappa * w[m + i]
        for j in range(m):
            w[a + i * size + j] = w[jac + i * m + j]
            w[row + j] = w[twice + i * m + j]
        for q in range(n):
            slope = w[jac + i * m + q]
            value += slope * w[y + q]
            for j in range(m):
                w[row + j] += slope * w[bent + q * m + j]
            for j in range(n):
                w[row + m + j] += slope * w[jac + q * m + j]
        w[row + m + i] += kappa
        w[row + size - 1] = w[m + i]
        part = w[m + i] / w[scale + i]
        norm += part * part
        phase += w[l + i] * w[m + i]
        w[a + 2 * n * size + m + i] = w[l + i]
        w[a + (2 * n + 1) * size + m + i] = 2.0 * part / w[scale + i]
        w[b + 2 * i] = -w[out + i]
        w[b + 2 * (n + i)] = -value
        residual = max(residual, max(abs(w[out + i]), abs(value)))
    w[b + 4 * n] = -phase
    w[b + 4 * n + 2] = -norm
    return max(residual, max(abs(phase), abs(norm)))


@routine
def motion(w: Array, n: int, jac: int, rows: int, t: int) -> bool:
    """(dx/dp, 1) along the branch, and whether f_x is far from singular."""
    m = n + 1
    scale, _, _, _, a, b, _, _ = places(n)
    fine = True
    for column in range(n + 1):
        for i in range(n):
            for j in range(n):
                w[a + i * n + j] = w[jac + i * m + j] * w[scale + j] / w[rows + i]
            if column < n:
                w[b + 2 * i] = 1.0 if i == column else 0.0
            else:
                w[b + 2 * i] = -w[jac + i * m + n] / w[rows + i]
            w[b + 2 * i + 1] = 0.0
        if solve(w, a, b, n) == 0.0:
            return False
        for i in range(n):
            fine = fine and (column == n or abs(w[b + 2 * i]) < STIFF)
    for i in range(n):
        w[t + i] = w[b + 2 * i] * w[scale + i]
    w[t + n] = 1.0
    return fine


@routine
def hopf_form(
    second: Any, third: Any, w: Array, n: int, par: Array, y: int, t: int, found: Array, k: int
) -> bool:
    """l1, omega and d of a Hopf point ([Kuznetsov2004] (5.62)), in real numbers; not if in doubt.

    With q = r + i s of length one, f_x q = i omega q, and second and third derivatives B and C.
    """
    m, size = n + 1, 2 * n + 2
    scale, z, out, more, a, b, spare, _ = places(n)
    jac, curved = out + n, n + n * m
    omega = np.sqrt(w[size - 1])
    r, s = spare + 4 * size, spare + 5 * size
    p, h = spare + 6 * size, spare + 7 * size  # both halves of each: real and imaginary
    square = 0.0
    for j in range(n):
        w[r + j] = w[m + j]
        w[s + j] = -w[y + j] / omega
        square += w[r + j] * w[r + j] + w[s + j] * w[s + j]
    for j in range(n):
        w[r + j] /= np.sqrt(square)
        w[s + j] /= np.sqrt(square)
    # s, the left one: f_x^T s = i omega s with s.q = 1, bordered by the conjugate of q.
    for i in range(size * size):
        w[a + i] = 0.0
    half = n + 1
    for i in range(n):
        for j in range(n):
            entry = w[jac + j * m + i] * w[scale + i] / w[scale + j]
            w[a + i * size + j] = entry
            w[a + (half + i) * size + half + j] = entry
        w[a + i * size + half + i] += omega
        w[a + (half + i) * size + i] -= omega
        one, two = w[r + i] / w[scale + i], w[s + i] / w[scale + i]
        w[a + i * size + n] = one  # times mu: the conjugate of q
        w[a + i * size + half + n] = two
        w[a + (half + i) * size + n] = -two
        w[a + (half + i) * size + half + n] = one
        w[a + n * size + i] = one
        w[a + n * size + half + i] = -two
        w[a + (half + n) * size + i] = two
        w[a + (half + n) * size + half + i] = one
    for i in range(size):
        w[b + 2 * i] = 1.0 if i == n else 0.0
        w[b + 2 * i + 1] = 0.0
        w[h + i] = 1.0
    if solve_scaled(w, a, b, size, h) == 0.0:
        return False
    for i in range(n):  # in units of the states: dot products with f itself
        w[p + i] = w[b + 2 * i] / w[scale + i]
        w[p + half + i] = w[b + 2 * (half + i)] / w[scale + i]
    # B along r and along s.
    for j in range(m):
        w[z + j] = w[r + j] if j < n else 0.0
    call(second, w, 0, par, z, out)
    for j in range(n):
        w[z + j] = w[s + j]
    call(second, w, 0, par, z, more)
    along_r, along_s = out + curved, more + curved
    rest = np.zeros((6, n))  # B(q, q*), B(q, q) in two parts, C(q, q, q*) in two parts
    d = 0.0
    d_terms = 0.0
    for i in range(n):
        for j in range(n):
            br, bs = w[along_r + i * m + j], w[along_s + i * m + j]
            rest[0, i] += br * w[r + j] + bs * w[s + j]
            rest[1, i] += br * w[r + j] - bs * w[s + j]
            rest[2, i] += br * w[s + j] + bs * w[r + j]
        for j in range(m):
            one = w[p + i] * w[along_r + i * m + j] - w[p + half + i] * w[along_s + i * m + j]
            d += one * w[t + j]
            d_terms += abs(w[p + i] * w[along_r + i * m + j] * w[t + j])
            d_terms += abs(w[p + half + i] * w[along_s + i * m + j] * w[t + j])
    for way in range(4):  # C(r, r, r) + C(r, s, s), C(r, r, s) + C(s, s, s)
        for j in range(m):
            w[z + j] = (w[r + j] if way < 3 else w[s + j]) if j < n else 0.0
            w[z + m + j] = (w[s + j] if way % 2 == 1 else w[r + j]) if j < n else 0.0
            w[z + 2 * m + j] = (w[r + j] if way == 0 else w[s + j]) if j < n else 0.0
        call(third, w, 0, par, z, h)
        for i in range(n):
            rest[3 if way < 2 else 4, i] += w[h + i]
    # f_x^-1 B(q, q*), and (2 i omega - f_x)^-1 B(q, q).
    for i in range(n):
        for j in range(n):
            w[a + i * n + j] = w[jac + i * m + j] * w[scale + j] / w[scale + i]
        w[b + 2 * i] = rest[0, i] / w[scale + i]
        w[b + 2 * i + 1] = 0.0
    for i in range(size):
        w[h + i] = 1.0
    if solve_scaled(w, a, b, n, h) == 0.0:
        return False
    still = np.zeros(n)
    for i in range(n):
        still[i] = w[b + 2 * i] * w[scale + i]
    whole = 2 * n
    for i in range(n):
        for j in range(n):
            entry = -w[jac + i * m + j] * w[scale + j] / w[scale + i]
            w[a + i * whole + j] = entry
            w[a + i * whole + n + j] = -2.0 * omega if i == j else 0.0
            w[a + (n + i) * whole + j] = 2.0 * omega if i == j else 0.0
            w[a + (n + i) * whole + n + j] = entry
        w[b + 2 * i] = rest[1, i] / w[scale + i]
        w[b + 2 * (n + i)] = rest[2, i] / w[scale + i]
        w[b + 2 * i + 1] = 0.0
        w[b + 2 * (n + i) + 1] = 0.0
    if solve_scaled(w, a, b, whole, h) == 0.0:
        return False
    total = 0.0
    terms = 0.0
    for i in range(n):
        one = rest[3, i]
        two = rest[4, i]
        for j in range(n):
            br, bs = w[along_r + i * m + j], w[along_s + i * m + j]
            re, im = w[b + 2 * j] * w[scale + j], w[b + 2 * (n + j)] * w[scale + j]
            one += -2.0 * br * still[j] + br * re + bs * im
            two += -2.0 * bs * still[j] + br * im - bs * re
            large = abs(2.0 * still[j]) + abs(re) + abs(im)
            terms += (abs(w[p + i]) + abs(w[p + half + i])) * (abs(br) + abs(bs)) * large
        total += w[p + i] * one - w[p + half + i] * two
        terms += (abs(w[p + i]) + abs(w[p + half + i])) * (abs(rest[3, i]) + abs(rest[4, i]))
    found[k, FIRST] = 0.5 * total / omega
    found[k, SECOND] = omega
    found[k, THIRD] = d
    return abs(total) > SIGNED * terms and abs(d) > SIGNED * d_terms
