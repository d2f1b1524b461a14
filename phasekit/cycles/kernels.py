"""Compiled linear algebra of collocation: condensation, and elimination of what it leaves.

The unknowns are the values x at all places of the mesh and y = (T, free parameters). The places
inside an interval are eliminated first (condensation): x_jk = W_jk x_j + V_jk y + v_jk. What is
left, x_(j+1) = G_j x_j + ..., is a chain that is closed by x_N = sigma x_0 + gap and bordered by
one row for each of y; or that is not closed, with as many rows more as there are states. It is
eliminated with pivoting over two blocks at a time: a recursion forwards would be single shooting,
which overflows where orbits are unstable.
"""

from __future__ import annotations

import numpy as np

from phasekit.arrays import Array
from phasekit.numerics.compile import inline, kernel, lanes, routine

LANES = 4  # intervals that are condensed side by side
REST = 1e-12  # |T f| beside the states' sizes that is rounding: the orbit is an equilibrium


@routine
def bring_up(a: Array, j: int, first: int, free: int, width: int) -> float:
    """Swap the largest entry of a column up to its diagonal; the sign of what that makes of it.

    Rows are swapped from the column ``first`` on. 0 if none is a number but zero.
    """
    pivot, size, sign = j, abs(a[j, j]), 1.0
    for i in range(j + 1, free):
        if abs(a[i, j]) > size:
            pivot, size = i, abs(a[i, j])
    if not size > 0.0 or not np.isfinite(size):
        return 0.0
    if pivot != j:
        sign = -sign
        for k in range(first, width):
            value = a[j, k]
            a[j, k] = a[pivot, k]
            a[pivot, k] = value
    return -sign if a[j, j] < 0.0 else sign


@routine
def eliminate(a: Array, free: int, rows: int, pivots: int, width: int) -> float:
    """Gaussian elimination of the first columns with partial pivoting; the determinant's sign.

    Pivots are taken from the first ``free`` rows. 0 if it is singular. Two columns at a time, as
    half as much goes to memory and back.
    """
    sign = 1.0
    for pair in range((pivots + 1) // 2):
        j = 2 * pair
        sign *= bring_up(a, j, j, free, width)
        if sign == 0.0:
            return 0.0
        inverse, last = 1.0 / a[j, j], j + 1 == pivots
        for i in range(j + 1, rows):
            a[i, j] *= inverse
            if not last:
                a[i, j + 1] -= a[i, j] * a[j, j + 1]
        if last:
            for i in range(j + 1, rows):
                part = a[i, j]
                if part != 0.0:
                    for k in range(j + 1, width):
                        a[i, k] -= part * a[j, k]
                    a[i, j] = 0.0
            return sign
        sign *= bring_up(a, j + 1, j, free, width)
        if sign == 0.0:
            return 0.0
        part = a[j + 1, j]
        for k in range(j + 2, width):
            a[j + 1, k] -= part * a[j, k]
        a[j + 1, j] = 0.0
        inverse = 1.0 / a[j + 1, j + 1]
        for i in range(j + 2, rows):
            one, two = a[i, j], a[i, j + 1] * inverse
            if one != 0.0 or two != 0.0:
                for k in range(j + 2, width):
                    a[i, k] = a[i, k] - one * a[j, k] - two * a[j + 1, k]
                a[i, j] = 0.0
                a[i, j + 1] = 0.0
    return sign


@routine
def substitute(a: Array, n: int, first: int, last: int) -> None:
    """Solve the triangle that `eliminate` left, in the place of the columns first to last."""
    for pair in range(n // 2):
        j = n - 1 - 2 * pair
        below, inverse, part = 1.0 / a[j, j], 1.0 / a[j - 1, j - 1], a[j - 1, j]
        for k in range(first, last):
            a[j, k] *= below
            a[j - 1, k] = (a[j - 1, k] - part * a[j, k]) * inverse
        for i in range(j - 1):
            one, two = a[i, j], a[i, j - 1]
            for k in range(first, last):
                a[i, k] = a[i, k] - one * a[j, k] - two * a[j - 1, k]
    if n % 2:
        inverse = 1.0 / a[0, 0]
        for k in range(first, last):
            a[0, k] *= inverse


@inline
def bring_up_lanes(
    a: Array, j: int, first: int, rows: int, width: int, best: Array, pivot: Array, signs: Array,
    one: Array, two: Array,
) -> None:  # fmt: skip
    """What `bring_up` does in all lanes.

    The rows of ``signs`` take signs, least pivots and their sums: 0 or no number where it fails.
    """
    for s in lanes(LANES):
        pivot[s], best[s] = 1.0 * j, abs(a[j, j, s])
    for i in range(j + 1, rows):
        for s in lanes(LANES):
            size = abs(a[i, j, s])
            pivot[s] = 1.0 * i if size > best[s] else pivot[s]
            best[s] = size if size > best[s] else best[s]
    for s in lanes(LANES):
        signs[0, s] = -signs[0, s] if pivot[s] != j else signs[0, s]
    for s in lanes(LANES):
        signs[1, s] = best[s] if best[s] < signs[1, s] else signs[1, s]
    for s in lanes(LANES):
        signs[2, s] += best[s]
    if pivot[0] == pivot[1] == pivot[2] == pivot[3]:
        i = int(pivot[0])
        if i != j:
            for k in range(first, width):
                for s in lanes(LANES):
                    one[k, s] = a[j, k, s]
                for s in lanes(LANES):
                    two[k, s] = a[i, k, s]
                for s in lanes(LANES):
                    a[j, k, s] = two[k, s]
                for s in lanes(LANES):
                    a[i, k, s] = one[k, s]
    else:
        for s in range(LANES):
            i = int(pivot[s])
            for k in range(first, width):
                value = a[j, k, s]
                a[j, k, s] = a[i, k, s]
                a[i, k, s] = value
    for s in lanes(LANES):
        signs[0, s] = -signs[0, s] if a[j, j, s] < 0.0 else signs[0, s]


@inline
def eliminate_lanes(
    a: Array, n: int, width: int, best: Array, pivot: Array, signs: Array, one: Array, two: Array
) -> bool:
    """What `eliminate` does of n rows in all lanes, with the same bits. False if one is singular.

    ``one`` and ``two`` take the rows that are subtracted, ``best`` and ``pivot`` their factors:
    what a loop over lanes writes must be no other place of what it reads.
    """
    for s in range(LANES):
        signs[0, s], signs[1, s], signs[2, s] = 1.0, np.inf, 0.0
    for pair in range((n + 1) // 2):
        j = 2 * pair
        bring_up_lanes(a, j, j, n, width, best, pivot, signs, one, two)
        if j + 1 == n:
            break
        for s in lanes(LANES):
            best[s] = 1.0 / a[j, j, s]
        for s in lanes(LANES):
            pivot[s] = a[j, j + 1, s]
        for i in range(j + 1, n):
            for s in lanes(LANES):
                one[0, s] = a[i, j, s] * best[s]
            for s in lanes(LANES):
                a[i, j, s] = one[0, s]
            for s in lanes(LANES):
                a[i, j + 1, s] -= one[0, s] * pivot[s]
        bring_up_lanes(a, j + 1, j, n, width, best, pivot, signs, one, two)
        for s in lanes(LANES):
            best[s] = a[j + 1, j, s]
        for k in range(j + 2, width):
            for s in lanes(LANES):
                one[k, s] = a[j, k, s]
            for s in lanes(LANES):
                two[k, s] = a[j + 1, k, s] - best[s] * one[k, s]
            for s in lanes(LANES):
                a[j + 1, k, s] = two[k, s]
        for s in lanes(LANES):
            one[0, s] = 1.0 / a[j + 1, j + 1, s]
        for i in range(j + 2, n):
            for s in lanes(LANES):
                best[s] = a[i, j, s]
            for s in lanes(LANES):
                pivot[s] = a[i, j + 1, s] * one[0, s]
            for k in range(j + 2, width):
                for s in lanes(LANES):
                    a[i, k, s] = a[i, k, s] - best[s] * one[k, s] - pivot[s] * two[k, s]
    for s in range(LANES):
        if not signs[1, s] > 0.0 or not np.isfinite(signs[2, s]):
            return False
    return True


@inline
def substitute_lanes(
    a: Array, n: int, last: int, best: Array, pivot: Array, one: Array, two: Array
) -> None:
    """What `substitute` does of the columns n to last in all lanes, with the same bits."""
    for pair in range(n // 2):
        j = n - 1 - 2 * pair
        for s in lanes(LANES):
            one[0, s] = 1.0 / a[j, j, s]
        for s in lanes(LANES):
            two[0, s] = 1.0 / a[j - 1, j - 1, s]
        for s in lanes(LANES):
            best[s] = a[j - 1, j, s]
        for k in range(n, last):
            for s in lanes(LANES):
                one[k, s] = a[j, k, s] * one[0, s]
            for s in lanes(LANES):
                two[k, s] = (a[j - 1, k, s] - best[s] * one[k, s]) * two[0, s]
            for s in lanes(LANES):
                a[j, k, s] = one[k, s]
            for s in lanes(LANES):
                a[j - 1, k, s] = two[k, s]
        for i in range(j - 1):
            for s in lanes(LANES):
                best[s] = a[i, j, s]
            for s in lanes(LANES):
                pivot[s] = a[i, j - 1, s]
            for k in range(n, last):
                for s in lanes(LANES):
                    a[i, k, s] = a[i, k, s] - best[s] * one[k, s] - pivot[s] * two[k, s]
    if n % 2:
        for s in lanes(LANES):
            best[s] = 1.0 / a[0, 0, s]
        for k in range(n, last):
            for s in lanes(LANES):
                a[0, k, s] *= best[s]


@kernel
def condense(
    jet_: Array, forced: bool, mesh: Array, nodes: Array, weights: Array, value: Array,
    slope: Array, side: float, scale: Array, x: Array, y: Array, W: Array,
) -> tuple[float, float, float, float]:  # fmt: skip
    """Fill W, shape (intervals, m n, n + y + 1): places inside intervals by their first one.

    Returns the sign of the determinants, the largest residual beside the largest |T f| or, at rest,
    beside the states, the largest |T f|, both on scaled axes, and the integral of the trace of T
    f_x.
    """
    m, n = nodes.size, x.shape[1]
    q, count = y.size, mesh.size - 1
    size = m * n
    width = size + n + q + 1
    M = np.zeros((size, width, LANES))
    one, two = np.empty((width, LANES)), np.empty((width, LANES))
    best, pivot, signs = np.empty(LANES), np.empty(LANES), np.empty((3, LANES))
    most = np.zeros((3, n))
    speed, worst, sign = 0.0, 0.0, 1.0
    for group in range((count + LANES - 1) // LANES):
        fill_lanes(jet_, mesh, value, slope, y, LANES * group, M, best, one)
        for s in range(LANES):
            # Lanes that are left over in the last group take its last interval.
            j = min(LANES * group + s, count - 1)
            before = most[2, 0]
            if not fill_sides(jet_, forced, mesh, nodes, weights, slope, x, y, j, M, s, most):
                return 0.0, np.inf, 0.0, np.nan
            if j < LANES * group + s:
                most[2, 0] = before
            for c in range(n):
                speed = max(speed, most[0, c] / scale[c])
                worst = max(worst, most[1, c] / (mesh[j + 1] - mesh[j]) / scale[c])
        if not eliminate_lanes(M, size, width, best, pivot, signs, one, two):
            return 0.0, np.inf, 0.0, np.nan
        substitute_lanes(M, size, width, best, pivot, one, two)
        for s in range(min(LANES, count - LANES * group)):
            sign *= signs[0, s]
            for _ in range(n):
                sign *= side
            for r in range(size):
                for k in range(n + q + 1):
                    W[LANES * group + s, r, k] = M[r, size + k, s]
    residual = worst / speed if speed > REST else worst
    return sign, residual, speed, most[2, 0]


@inline
def fill_lanes(
    jet_: Array, mesh: Array, value: Array, slope: Array, y: Array, first: int, M: Array,
    entry: Array, part: Array,
) -> None:  # fmt: skip
    """Write the matrices of some intervals, from the first on, each into a lane."""
    m, last = slope.shape[0], mesh.size - 2
    n = M.shape[0] // m
    size, wide = m * n, jet_.shape[1] // n - 1
    for i in range(m):
        for s in range(LANES):
            j = min(first + s, last)
            for k in range(m + 1):
                size_of_it = (mesh[j + 1] - mesh[j]) * y[0] * value[i, k]
                part[k, s] = -size_of_it if k > 0 else size_of_it
        for c in range(n):
            for d in range(n):
                for s in range(LANES):
                    entry[s] = jet_[min(first + s, last) * m + i, n + c * wide + d]
                # Columns of the places 1 to m, then that of the first one, on the right side.
                for k in range(1, m + 1):
                    for s in lanes(LANES):
                        M[i * n + c, (k - 1) * n + d, s] = part[k, s] * entry[s]
                for s in lanes(LANES):
                    M[i * n + c, size + d, s] = part[0, s] * entry[s]
            for k in range(1, m + 1):
                for s in lanes(LANES):
                    M[i * n + c, (k - 1) * n + c, s] += slope[i, k]
            for s in lanes(LANES):
                M[i * n + c, size + c, s] -= slope[i, 0]


@inline
def fill_sides(
    jet_: Array, forced: bool, mesh: Array, nodes: Array, weights: Array, slope: Array, x: Array,
    y: Array, j: int, M: Array, s: int, most: Array,
) -> bool:  # fmt: skip
    """Write the right sides of an interval into a lane; whether they are finite.

    The rows of ``most`` take its largest |T f| and residual; to the first entry of the third one
    the integral of the trace of T f_x is added.
    """
    m, n, q = nodes.size, x.shape[1], y.size
    size, a = m * n, (jet_.shape[1] - n) // n - n
    t = 1 if forced else 0
    h = mesh[j + 1] - mesh[j]
    for c in range(n):
        most[0, c], most[1, c] = 0.0, 0.0
    for i in range(m):
        at, row = j * m + i, i * n
        now = mesh[j] + h * nodes[i]
        weight = h * weights[i] * y[0]
        for c in range(n):
            f = jet_[at, c]
            base = n + c * (n + a)
            total = -h * y[0] * f
            for k in range(m + 1):
                total += slope[i, k] * x[j * m + k, c]
            if not np.isfinite(total):
                return False
            by_period = f
            if forced:
                by_period += y[0] * now * jet_[at, base + n]
            M[row + c, size + n, s] = h * by_period
            for k in range(1, q):
                M[row + c, size + n + k, s] = h * y[0] * jet_[at, base + n + t + k - 1]
            M[row + c, size + n + q, s] = -total
            most[0, c] = max(most[0, c], abs(y[0] * f))
            most[1, c] = max(most[1, c], abs(total))
            most[2, 0] += weight * jet_[at, base + c]
    return True


@kernel
def solve(
    W: Array, rows: Array, rows_y: Array, right: Array, gap: Array, sigma: Array, m: int,
    dx: Array, dy: Array,
) -> float:  # fmt: skip
    """Solve the condensed system; the sign of its determinant, 0 if it is singular.

    rows, rows_y, right: the bordering rows, shape (rows, places, n) and (rows, y), and their
    right sides: as many as y, or n more where they close the chain; gap, sigma: x_N = sigma x_0
    + gap closes the chain, sigma a sign for each state, if no rows do; dx, dy: the solution,
    shape (2, places, n) and (2, y): that of the right sides given, and the one of a 1 in the
    last row alone.
    """
    count, n, q, border = W.shape[0], sigma.size, dy.shape[1], right.size
    # Columns: x_j, x_0, x_(j+1), y, right side. Rows: what is known of x_j and x_0, at first that
    # both are one; the next interval; the border.
    block = np.zeros((2 * n + border, 3 * n + q + 1))
    store = np.empty((count, n, block.shape[1]))
    for c in range(n):
        block[c, c], block[c, n + c] = 1.0, -1.0
    for r in range(border):
        for c in range(n):
            block[2 * n + r, c] = rows[r, 0, c]
        for k in range(q):
            block[2 * n + r, 3 * n + k] = rows_y[r, k]
        block[2 * n + r, 3 * n + q] = right[r]
    sign = 1.0
    for j in range(count):
        append(W, rows, j, m, n, block)
        found = eliminate(block, 2 * n, 2 * n + border, n, block.shape[1])
        if found == 0.0:
            return 0.0
        sign *= found
        step_on(block, n, store[j])
    end = n + border
    D = np.zeros((end, end + 2))
    sign *= close(block, gap, sigma, D)
    if sign != 0.0:
        last = np.empty(n)
        for which in range(2):
            for c in range(n):
                if border > q:
                    last[c] = D[n + c, end + which]
                else:
                    last[c] = sigma[c] * D[c, end + which] + (1.0 if which == 0 else 0.0) * gap[c]
            carry_back(store, W, D[:, end + which], last, m, which == 0, dx[which], dy[which])
    return sign


@inline
def append(W: Array, rows: Array, j: int, m: int, n: int, block: Array) -> None:
    """Write an interval into the block: its equation, and the border's part of its places."""
    top, y, q = (m - 1) * n, 3 * n, block.shape[1] - 3 * n - 1
    for i in range(n):
        for k in range(n):
            block[n + i, k] = -W[j, top + i, k]
            block[n + i, n + k] = 0.0
            block[n + i, 2 * n + k] = 1.0 if i == k else 0.0
        for k in range(q):
            block[n + i, y + k] = -W[j, top + i, n + k]
        block[n + i, y + q] = W[j, top + i, n + q]
    for r in range(rows.shape[0]):
        row = 2 * n + r
        for c in range(n):
            block[row, 2 * n + c] = rows[r, (j + 1) * m, c]
        for place in range(m - 1):
            for c in range(n):
                part, at = rows[r, j * m + 1 + place, c], place * n + c
                if part != 0.0:
                    for d in range(n):
                        block[row, d] += part * W[j, at, d]
                    for d in range(q):
                        block[row, y + d] += part * W[j, at, n + d]
                    block[row, y + q] -= part * W[j, at, n + q]


@inline
def step_on(block: Array, n: int, store: Array) -> None:
    """Keep the rows that x_j was eliminated with; x_(j+1) takes its place in the others."""
    width = block.shape[1]
    for i in range(n):
        for k in range(width):
            store[i, k] = block[i, k]
    for i in range(n, block.shape[0]):
        to = i - n if i < 2 * n else i
        for k in range(n):
            block[to, k] = block[i, 2 * n + k]
            block[to, 2 * n + k] = 0.0
        for k in range(n, 2 * n):
            block[to, k] = block[i, k]
        for k in range(3 * n, width):
            block[to, k] = block[i, k]


@inline
def close(block: Array, gap: Array, sigma: Array, D: Array) -> float:
    """Solve for x_0 and y with x_N = sigma x_0 + gap; the sign of the determinant, or 0.

    With rows that close the chain for x_0, x_N and y. The last columns of D become the solution,
    and that of a 1 in the last row alone.
    """
    n, end = gap.size, D.shape[0]
    open_ = end > block.shape[1] - 1 - 2 * n
    for i in range(end):
        row = i if i < n else n + i
        total = block[row, block.shape[1] - 1]
        size = 0.0
        for k in range(n):
            if open_:
                D[i, k] = block[row, n + k]
                D[i, n + k] = block[row, k]
                size = max(size, abs(D[i, n + k]))
            else:
                D[i, k] = sigma[k] * block[row, k] + block[row, n + k]
                total -= block[row, k] * gap[k]
            size = max(size, abs(D[i, k]))
        before = n if open_ else 2 * n  # columns of x_(j+1), which is no unknown any more
        for k in range(2 * n if open_ else n, end):
            D[i, k] = block[row, before + k]
            size = max(size, abs(D[i, k]))
        D[i, end] = total
        D[i, end + 1] = 1.0 if i == end - 1 else 0.0
        if not size > 0.0 or not np.isfinite(size):
            return 0.0
        for k in range(end + 2):
            D[i, k] /= size
    found = eliminate(D, end, end, end, end + 2)
    if found != 0.0:
        substitute(D, end, end, end + 2)
    return found


@inline
def carry_back(
    store: Array, W: Array, ends: Array, last: Array, m: int, whole: bool, dx: Array, dy: Array
) -> None:  # fmt: skip
    """Fill dx and dy from x_0, x_N and y; without right sides but the last unless whole."""
    count, n, q = W.shape[0], last.size, dy.size
    constant = 1.0 if whole else 0.0
    for k in range(q):
        dy[k] = ends[ends.size - q + k]
    for c in range(n):
        dx[0, c] = ends[c]
        dx[count * m, c] = last[c]
    for j in range(count - 1, 0, -1):
        for i in range(n - 1, -1, -1):
            total = constant * store[j, i, 3 * n + q]
            for k in range(i + 1, n):
                total -= store[j, i, k] * dx[j * m, k]
            for k in range(n):
                total -= store[j, i, n + k] * dx[0, k]
                total -= store[j, i, 2 * n + k] * dx[(j + 1) * m, k]
            for k in range(q):
                total -= store[j, i, 3 * n + k] * dy[k]
            dx[j * m, i] = total / store[j, i, i]
    for j in range(count):
        for place in range(m - 1):
            for c in range(n):
                at = place * n + c
                total = constant * W[j, at, n + q]
                for d in range(n):
                    total += W[j, at, d] * dx[j * m, d]
                for d in range(q):
                    total += W[j, at, n + d] * dy[d]
                dx[j * m + 1 + place, c] = total
