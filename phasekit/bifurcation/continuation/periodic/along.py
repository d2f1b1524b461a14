"""Compiled sums, products and values along an orbit and its mesh."""

from __future__ import annotations

from typing import Any

import numpy as np

from phasekit.numerics.compile import Array, kernel
from phasekit.numerics.native import call


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
                    step[i, k] *= np.exp(log[k] - log[i]) / step[i, i]
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
                log[i] += np.log(step[i, i])
    for i in range(n):
        for k in range(n):
            turn_[i, k] = 0.0
            for d in range(n):
                turn_[i, k] += start[d, i] * Q[d, k]


@kernel
def borders(
    mesh: Array, weights: Array, value: Array, slope: Array, reference: Array, tangent: Array,
    scale: Array, forced: bool, rows: Array,
) -> None:  # fmt: skip
    """Fill the row of the phase condition (the first) and that of the arclength (the last).

    They are the integrals of x . x_ref' and of x . tangent, on scaled axes.
    """
    m, n = weights.size, scale.size
    end = rows.shape[0] - 1
    rows[:] = 0.0
    for j in range(mesh.size - 1):
        h = mesh[j + 1] - mesh[j]
        for i in range(m):
            for c in range(n):
                along, across = 0.0, 0.0
                for k in range(m + 1):
                    along += slope[i, k] * reference[j * m + k, c]
                    across += value[i, k] * tangent[j * m + k, c]
                part = weights[i] / scale[c] ** 2
                for k in range(m + 1):
                    if not forced:
                        rows[0, j * m + k, c] += part * along * value[i, k]
                    rows[end, j * m + k, c] += h * part / n * across * value[i, k]


@kernel
def inner(mesh: Array, weights: Array, value: Array, a: Array, b: Array, scale: Array) -> float:
    """Integral of the mean over states of a . b, on scaled axes."""
    m, n = weights.size, scale.size
    total = 0.0
    for j in range(mesh.size - 1):
        h = mesh[j + 1] - mesh[j]
        for i in range(m):
            for c in range(n):
                left, right = 0.0, 0.0
                for k in range(m + 1):
                    left += value[i, k] * a[j * m + k, c]
                    right += value[i, k] * b[j * m + k, c]
                total += h * weights[i] * left * right / scale[c] ** 2
    return total / n


@kernel
def interpolate(mesh: Array, x: Array, places: Array, at: Array, out: Array) -> None:
    """Values of a piecewise polynomial at times in ascending order.

    ``places`` are those of an interval's values, on [0, 1].
    """
    m, n = places.size - 1, x.shape[1]
    weight = np.empty(m + 1)
    basis = np.empty(m + 1)
    for k in range(m + 1):
        weight[k] = 1.0
        for i in range(m + 1):
            if i != k:
                weight[k] /= places[k] - places[i]
    j = 0
    for row in range(at.size):
        while j < mesh.size - 2 and at[row] >= mesh[j + 1]:
            j += 1
        s = (at[row] - mesh[j]) / (mesh[j + 1] - mesh[j])
        for k in range(m + 1):
            basis[k] = weight[k]
            for i in range(m + 1):
                if i != k:
                    basis[k] *= s - places[i]
        for c in range(n):
            total = 0.0
            for k in range(m + 1):
                total += basis[k] * x[j * m + k, c]
            out[row, c] = total


@kernel
def ranges(mesh: Array, x: Array, turns: Array, m: int, half: Array) -> None:
    """Half the range of each state, less its turns, over all places."""
    for c in range(x.shape[1]):
        low, high = np.inf, -np.inf
        for j in range(mesh.size - 1):
            h = (mesh[j + 1] - mesh[j]) / m
            for k in range(m + 1):
                value = x[j * m + k, c] - turns[c] * (mesh[j] + k * h)
                low, high = min(low, value), max(high, value)
        half[c] = 0.5 * (high - low)


@kernel
def highest(
    mesh: Array, x: Array, coefficients: Array, scale: Array, closure: Array, out: Array
) -> None:
    """Size of the derivative of order m + 1 on each interval (see `collocation.highest`)."""
    m, n, count = coefficients.size - 1, x.shape[1], mesh.size - 1
    constant = np.zeros((count, n))
    jump = np.zeros((count, n))
    for j in range(count):
        h = (mesh[j + 1] - mesh[j]) ** m
        for c in range(n):
            for k in range(m + 1):
                constant[j, c] += coefficients[k] * x[j * m + k, c] / h
    for j in range(count):
        before = j - 1 if j > 0 else count - 1
        gap = 0.5 * (mesh[j + 1] - mesh[j] + mesh[before + 1] - mesh[before])
        for c in range(n):
            value = constant[before, c] * (closure[c] if j == 0 else 1.0)
            jump[j, c] = abs(constant[j, c] - value) / gap / scale[c]
    for j in range(count):
        after = j + 1 if j < count - 1 else 0
        out[j] = 0.0
        for c in range(n):
            out[j] = max(out[j], 0.5 * (jump[j, c] + jump[after, c]))


@kernel
def evaluate(function: Any, par: Array, w: Array, out: int) -> None:
    """Call a native function of the numbers at the head of w, which fills w from a place on."""
    call(function, w, 0, par, 0, out)
