"""Floquet multipliers of a periodic orbit, without forming the product that they belong to."""

from __future__ import annotations

import functools
import math

import numpy as np
import numpy.typing as npt

from phasekit.arrays import Array, Complex
from phasekit.cycles.leading import INSIDE, leading, through
from phasekit.numerics.compile import kernel

APART = 1e-14  # entries below the diagonal blocks that are rounding
ROUNDED = 1e-11  # the same between multipliers of unlike size, whose relative error they are
PASSES = 12
WIDE = 24  # states from which LAPACK is faster
MANY = 100  # states from which only those near and outside the unit circle are found
LARGEST = 709.0  # logarithm of the largest numbers
ALIKE = 0.7  # difference of logarithms of multipliers that orthogonal iteration need not part
LOST = 0.1  # relative change of a multiplier by errors of its matrices, from which it is not known
LEAST = 1e-14  # relative error of a matrix
ROUNDING = 1e-15  # the same of a product by rounding alone
FAR = 600.0  # logarithm of a product that numbers hold with room


@kernel
def triangular(G: Array, passes: int, Q: Array, R: Array, log: Array, turn_: Array) -> None:
    """Periodic QR: G_N ... G_1 Q = Q' R after some passes, without ever forming the product.

    The triangle is diag(exp(log)) R. Q is any orthogonal matrix and becomes Q'; with the turn
    Q^T Q' the product is similar to the turn times the triangle ([Lust2001]).
    """
    count, n = G.shape[0], G.shape[1]
    Z = np.empty((n, n))
    start = np.empty((n, n))
    step = np.empty((n, n))
    for turn in range(passes):
        for i in range(n):
            log[i] = 0.0
            for k in range(n):
                R[i, k] = 1.0 if i == k else 0.0
                start[i, k] = Q[i, k]
        for j in range(count):
            for i in range(n):
                for k in range(n):
                    total = 0.0
                    for d in range(n):
                        total += G[j, i, d] * Q[d, k]
                    Z[i, k] = total
            # Gram-Schmidt, twice, which is as good as reflections.
            for k in range(n):
                for d in range(n):
                    step[d, k] = 0.0
                for _ in range(2):
                    for d in range(k):
                        total = 0.0
                        for i in range(n):
                            total += Z[i, d] * Z[i, k]
                        step[d, k] += total
                        for i in range(n):
                            Z[i, k] -= total * Z[i, d]
                size = 0.0
                for i in range(n):
                    size += Z[i, k] * Z[i, k]
                size = np.sqrt(size)
                step[k, k] = size
                for i in range(n):
                    Z[i, k] /= size
            for i in range(n):
                for k in range(n):
                    Q[i, k] = Z[i, k]
            if turn < passes - 1:
                continue
            # D_new U_new D U = (D_new D) (D^-1 U_new D) U with unit triangles U.
            for i in range(n):
                for k in range(i + 1, n):
                    step[i, k] *= math.exp(log[k] - log[i]) / step[i, i]
            for i in range(n):
                for k in range(i + 1, n):
                    total = R[i, k] + step[i, k]
                    for d in range(i + 1, k):
                        total += step[i, d] * R[d, k]
                    # Upwards from row i: entries of rows below are not needed again.
                    Z[i, k] = total
            for i in range(n):
                for k in range(i + 1, n):
                    R[i, k] = Z[i, k]
                log[i] += math.log(step[i, i])
    for i in range(n):
        for k in range(n):
            turn_[i, k] = 0.0
            for d in range(n):
                turn_[i, k] += start[d, i] * Q[d, k]


@kernel
def iterate(G: Array, Q: Array, R: Array, log: Array, turn: Array, cut: Array) -> None:
    """Orthogonal iteration until blocks of unlike multipliers part: where they do, ``cut`` is 1.

    Leaves R, log and turn as `triangular` does; log is NaN if G is not finite.
    """
    n = G.shape[1]
    for i in range(n):
        log[i], cut[i] = np.nan, 1.0
        for k in range(n):
            Q[i, k] = 1.0 if i == k else 0.0
    for j in range(G.shape[0]):
        for i in range(n):
            for k in range(n):
                if not np.isfinite(G[j, i, k]):
                    return
    for _ in range(PASSES // 2):
        triangular(G, 2, Q, R, log, turn)
        settled, finite = True, np.isfinite(log[n - 1])
        for i in range(n - 1):
            below = 0.0
            for k in range(i + 1, n):
                for d in range(i + 1):
                    below = max(below, abs(turn[k, d]))
            apart = log[i] - log[i + 1]
            cut[i] = 1.0 if below <= (ROUNDED if apart > ALIKE else APART) else 0.0
            settled = settled and (cut[i] == 1.0 or abs(apart) <= ALIKE)
            finite = finite and np.isfinite(log[i])
        if settled or not finite:
            break


def iterate_wide(G: Array, Q: Array, R: Array, log: Array, turn: Array, cut: Array) -> None:
    """What `iterate` does, of many states, by LAPACK."""
    log[:], cut[:], Q[:] = np.nan, 1.0, np.eye(len(Q))
    if not np.isfinite(G).all():
        return
    for _ in range(PASSES // 2):
        with np.errstate(all="ignore"):
            _triangular_wide(G, 2, Q, R, log, turn)
            apart = log[:-1] - log[1:]
        size = np.maximum.accumulate(np.abs(turn), axis=1)
        below = np.diagonal(np.maximum.accumulate(size[::-1])[::-1], -1)
        cut[:-1] = below <= np.where(apart > ALIKE, ROUNDED, APART)
        if not np.isfinite(log).all() or np.all((cut[:-1] == 1.0) | (np.abs(apart) <= ALIKE)):
            break


def _triangular_wide(G: Array, passes: int, Q: Array, R: Array, log: Array, turn: Array) -> None:
    """What `triangular` does, of many states, by LAPACK."""
    from scipy.linalg import qr

    start = Q.copy()
    for number in range(passes):
        log[:], start[:] = 0.0, Q
        last = number == passes - 1
        R[:] = np.eye(len(Q))
        for one in G:
            found, step = qr(one @ Q, mode="economic", check_finite=False)
            size = np.diagonal(step).copy()
            side = np.where(size < 0.0, -1.0, 1.0)
            Q[:] = found * side
            if last:
                unit = np.triu(step / size[:, None] * np.exp(log - log[:, None]), 1)
                R += unit @ R
            log += np.log(np.abs(size))
    turn[:] = start.T @ Q


def multipliers(G: Array) -> tuple[Complex, float]:
    """Eigenvalues of G_N ... G_1, largest first, and the logarithm of the size of their product.

    The product is brought to block triangular form by orthogonal iteration, each of whose blocks
    holds multipliers of like size: so small ones are as accurate, relative to themselves, as
    large ones. Of very many states only the largest are found so, and the rest are 0 (`leading`).
    """
    n = G.shape[-1]
    if n >= MANY and np.isfinite(G).all():
        whole = float(np.sum(np.linalg.slogdet(G)[1]))
        few = leading(functools.partial(through, G), n) if math.isfinite(whole) else None
        if few is not None:
            return few, whole
    Q, R, turn = np.empty((3, n, n))
    log, cut = np.empty((2, n))
    (iterate if n < WIDE else iterate_wide)(np.ascontiguousarray(G), Q, R, log, turn, cut)
    values, logs, first = [], 0.0, 0
    for last, parted in enumerate(cut.tolist(), 1):
        if not parted:
            continue
        here = slice(first, last)
        if last == first + 1:
            top, found = float(log[first]), [float(turn[first, first] * R[first, first])]
            known = math.isfinite(found[0]) and not math.isnan(top)
        else:
            top = float(np.max(log[here]))
            with np.errstate(all="ignore"):
                block = turn[here, here] @ (np.exp(log[here] - top)[:, None] * R[here, here])
            known = bool(np.isfinite(block).all())
            found = np.linalg.eigvals(block).tolist() if known else []
        if not known:
            return np.full(len(cut), np.nan, dtype=complex), np.nan
        size = math.exp(top) if top < LARGEST else math.inf
        # Of the values found: the triangle's own would be right even where they are not.
        logs += sum(math.log(abs(one)) if one != 0.0 else -math.inf for one in found)
        logs += (last - first) * top
        values += [complex(one) * size for one in found]
        first = last
    return np.array(sorted(values, key=abs, reverse=True)), logs


@kernel
def few(G: Array, divergence: float, out: Array) -> bool:
    """Multipliers of one or two states by trace and determinant of the product.

    Fills real and imaginary parts of two, the largest first, and the logarithm of the size of their
    product. False where rounding or errors of the matrices, of which the divergence tells, may make
    others of them: what any error of so much can do is bounded.
    """
    count, n = G.shape[0], G.shape[1]
    log, sign, bend = 0.0, 1.0, 0.0
    behind = np.empty((count + 1, n, n))  # products of what follows
    for i in range(n):
        for k in range(n):
            behind[count, i, k] = 1.0 if i == k else 0.0
    for j in range(count - 1, -1, -1):
        most, square = 0.0, 0.0
        for i in range(n):
            for k in range(n):
                most, square = max(most, abs(G[j, i, k])), square + G[j, i, k] ** 2
                total = 0.0
                for d in range(n):
                    total += behind[j + 1, i, d] * G[j, d, k]
                behind[j, i, k] = total
        det = G[j, 0, 0] if n == 1 else G[j, 0, 0] * G[j, 1, 1] - G[j, 0, 1] * G[j, 1, 0]
        if not np.isfinite(square) or det == 0.0:
            return False
        log += math.log(abs(det))
        sign = sign if det > 0.0 else -sign
        bend += 1.0 if n == 1 else 2.0 * most * math.sqrt(square) / abs(det)
    if not abs(log) < FAR:
        return False
    det = sign * math.exp(log)
    out[0], out[1], out[2], out[3], out[4] = det, 0.0, 0.0, 0.0, log
    known = not np.isnan(divergence)
    part = max(abs(log - divergence) / count, LEAST) if known else 0.0
    if n == 1:
        return part * bend <= 0.5 * LOST
    # By how much the product changes with its matrices, at most.
    moves = 0.0
    ahead, step = np.zeros((2, 2)), np.empty((2, 2))
    ahead[0, 0], ahead[1, 1] = 1.0, 1.0
    for j in range(count):
        most, left, right = 0.0, 0.0, 0.0
        for i in range(2):
            for k in range(2):
                most = max(most, abs(G[j, i, k]))
                left += behind[j + 1, i, k] ** 2
                right += ahead[i, k] ** 2
                step[i, k] = G[j, i, 0] * ahead[0, k] + G[j, i, 1] * ahead[1, k]
        moves += 2.0 * most * math.sqrt(left) * math.sqrt(right)
        for i in range(2):
            for k in range(2):
                ahead[i, k] = step[i, k]
    half = 0.5 * (behind[0, 0, 0] + behind[0, 1, 1])
    square = half * half - det
    root = math.sqrt(abs(square))
    if square >= 0.0:
        out[0] = half + root if half >= 0.0 else half - root
        out[2] = det / out[0] if out[0] != 0.0 else 0.0
    else:
        out[0], out[1], out[2], out[3] = half, root, half, -root
    largest = math.sqrt(out[0] * out[0] + out[1] * out[1])
    if not ROUNDING * moves <= ROUNDED * largest or part * bend > 0.5 * LOST:
        return False
    for k in range(0, 4, 2):
        size = math.sqrt(out[k] * out[k] + out[k + 1] * out[k + 1])
        # Changes of trace and determinant make this of z^2 - trace z + det where it was zero.
        rest = size * math.sqrt(2.0) * part * moves + part * bend * abs(det)
        off = math.sqrt(rest)
        if off < 0.5 * root:
            off = rest / root
        if not (off <= 0.5 * LOST * size or size + off < INSIDE):
            return False
    return True


def known_multipliers(G: Array, divergence: float) -> tuple[Complex, float]:
    """What `multipliers` finds; NaN for those that errors hide, of which the divergence tells."""
    n = G.shape[-1]
    out = np.empty(5)
    if n <= 2 and few(G, divergence, out):
        one, two, log = complex(out[0], out[1]), complex(out[2], out[3]), float(out[4])
        return np.array([one, two][:n]), log
    values, log = multipliers(G)
    values[hidden(G, values, abs(log - divergence))] = math.nan
    return values, log


def hidden(G: Array, values: Complex, error: float) -> npt.NDArray[np.bool_]:
    """Which multipliers an error of the logarithm of their product hides.

    Where directions grow and decay by much more along an orbit than over its period, left and right
    vectors of a multiplier are all but orthogonal somewhere: small errors of the matrices make any
    other one of it, though not of the product. So such errors are put into them. What stays far
    inside the unit circle is not hidden.
    """
    if len(values) < 2 or not math.isfinite(error):
        return np.zeros(len(values), bool)
    part = max(error / len(G), LEAST)
    moved_by = part * np.abs(G).max(axis=(1, 2), keepdims=True) * _sides(G.shape)
    others = multipliers(G + moved_by)[0]
    with np.errstate(all="ignore"):
        moved = np.abs(others[:, None] / values - 1.0).min(axis=0)
        outside = np.maximum(np.abs(values), np.abs(others)) >= INSIDE
    return np.asarray(~(moved <= LOST) & outside)


def off_one(values: Complex) -> float:
    """How far the nearest multiplier that is known is from 1."""
    apart = np.abs(values - 1.0)
    return float(np.min(apart, initial=math.inf, where=~np.isnan(apart)))


@functools.lru_cache(maxsize=16)
def _sides(shape: tuple[int, ...]) -> Array:
    """A sign for each entry, by chance."""
    return np.random.default_rng(11).choice([-1.0, 1.0], shape)


@kernel
def across(G: Array, f: Array, scale: Array, A: Array) -> tuple[float, float]:
    """Part the flow from what is across it: fill A, on scaled axes.

    Returns the multiplier that belongs to f along the orbit, and how far f is carried off itself;
    NaN if f vanishes or is not finite.
    Each matrix takes f to f at the next interval, so it is a product of numbers that are near 1:
    as accurate as the orbit, where that of the whole product drowns in the rounding of others. A is
    what is left across f, in frames that reflections of the first axis into f give.
    """
    count, n = f.shape
    v, length = np.empty((count, n)), np.empty(count)
    for j in range(count):
        length[j] = 0.0
        for c in range(n):
            v[j, c] = f[j, c] / scale[c]
            if not np.isfinite(v[j, c]):
                return np.nan, np.nan
            length[j] = max(length[j], abs(v[j, c]))
        if length[j] == 0.0:
            return np.nan, np.nan
        total = 0.0
        for c in range(n):
            v[j, c] /= length[j]
            total += v[j, c] ** 2
        total = np.sqrt(total)
        length[j] *= total
        # The reflection 1 - v v^T that takes f to the first axis.
        first = v[j, 0] / total
        part = 1.0 / np.sqrt(1.0 + abs(first))
        for c in range(n):
            v[j, c] *= part / total
        v[j, 0] += part if first >= 0.0 else -part
    trivial, off = 1.0, 0.0
    B = np.empty((n, n))
    for j in range(count):
        after = j + 1 if j < count - 1 else 0
        for i in range(n):
            total = 0.0
            for k in range(n):
                B[i, k] = G[j, i, k] * scale[k] / scale[i]
                total += B[i, k] * v[j, k]
            for k in range(n):
                B[i, k] -= total * v[j, k]
        for k in range(n):
            total = 0.0
            for i in range(n):
                total += v[after, i] * B[i, k]
            for i in range(n):
                B[i, k] -= v[after, i] * total
        # Reflections take f to minus its sign along the first axis.
        side = 1.0 if v[j, 0] * v[after, 0] > 0.0 else -1.0
        ratio = side * length[j] / length[after]
        trivial *= ratio * B[0, 0]
        aside = 0.0
        for i in range(1, n):
            aside += (ratio * B[i, 0]) ** 2
            for k in range(1, n):
                A[j, i - 1, k - 1] = B[i, k]
        off = max(off, np.sqrt(aside))
    return trivial, off
