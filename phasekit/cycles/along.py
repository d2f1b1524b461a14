"""Compiled sums, products and values along an orbit and its mesh."""

from __future__ import annotations

from typing import Any

import numpy as np

from phasekit.arrays import Array
from phasekit.numerics.compile import kernel
from phasekit.numerics.differences import jet, spare_size
from phasekit.numerics.native import call

STILL = 1e-3  # part of the largest amplitude that others count as at least


@kernel
def borders(
    mesh: Array, weights: Array, value: Array, slope: Array, reference: Array, tangent: Array,
    scale: Array, forced: bool, rows: Array, at: Array,
) -> None:  # fmt: skip
    """Fill the row of the phase condition (the first) and that of the arclength (the last).

    They are the integrals of x . x_ref' and of x . tangent, on scaled axes; ``at`` is what they are
    for the reference.
    """
    m, n = weights.size, scale.size
    end = rows.shape[0] - 1
    rows[:] = 0.0
    at[:] = 0.0
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
    for i in range(reference.shape[0]):
        for c in range(n):
            at[0] += rows[0, i, c] * reference[i, c]
            at[end] += rows[end, i, c] * reference[i, c]


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
def product(
    mesh: Array, weights: Array, value: Array, scale: Array, width: Array, a: Array, b: Array,
    dy_a: Array, dy_b: Array,
) -> float:  # fmt: skip
    """Inner product of two directions: `inner` of the states, and the free parameters."""
    total = 0.0
    for k in range(width.size):
        total += dy_a[1 + k] * dy_b[1 + k] / width[k] ** 2
    return inner(mesh, weights, value, a, b, scale) + total


@kernel
def plane(
    mesh: Array, rule: Any, x: Array, y: Array, dx: Array, dy: Array, scale: Array, width: Array,
    forced: bool, rows: Array, rows_y: Array, target: Array,
) -> None:  # fmt: skip
    """Fill `borders` with the parts of the period and the parameters, and both at the orbit."""
    weights, value, slope = rule
    borders(mesh, weights, value, slope, x, dx, scale, forced, rows, target)
    rows_y[:] = 0.0
    last = target.size - 1
    for k in range(width.size):
        rows_y[last, 1 + k] = dy[1 + k] / width[k] ** 2
        target[last] += rows_y[last, 1 + k] * y[1 + k]


@kernel
def ahead(
    mesh: Array, rule: Any, scale: Array, width: Array, moving: int, step: float, here: Any,
    behind: Any, x: Array, y: Array,
) -> None:  # fmt: skip
    """Fill where the family is expected a step along the tangent.

    On the cubic through the last two points, ``here`` and ``behind``, with their tangents: in the
    plane that the step leads to, as the tangent's part is that of the curve itself. On the tangent
    where these do not go the same way.
    """
    weights, value = rule
    x_0, y_0, dx, dy = here
    last, last_y, ex, ey = behind
    gap, gap_y = np.empty_like(x), np.empty_like(y)
    for i in range(x.shape[0]):
        for c in range(x.shape[1]):
            gap[i, c] = last[i, c] - x_0[i, c]
    for k in range(y.size):
        gap_y[k] = last_y[k] - y_0[k]
    back = product(mesh, weights, value, scale, width, gap, dx, gap_y, dy)
    along = product(mesh, weights, value, scale, width, ex, dx, ey, dy)
    g, t, u = 0.0, 0.0, step
    if back < 0.0 < along:
        r = step / back
        # By the gap, the last tangent and this one.
        g, t, u = r * r * (3.0 - 2.0 * r), step * r * (r - 1.0) / along, step * (1.0 - r) ** 2
    for i in range(x.shape[0]):
        for c in range(x.shape[1]):
            far = g * gap[i, c] if c < moving else 0.0
            x[i, c] = x_0[i, c] + (far + t * ex[i, c] + u * dx[i, c])
    for k in range(y.size):
        y[k] = y_0[k] + (g * gap_y[k] + t * ey[k] + u * dy[k])


@kernel
def largest(x: Array, scale: Array, counts: Any) -> float:
    """Largest size of the states that count, on scaled axes; NaN where one is."""
    most = 0.0
    for c in range(scale.size):
        if counts[c]:
            for i in range(x.shape[0]):
                size = abs(x[i, c]) / scale[c]
                if np.isnan(size):
                    return np.nan
                most = max(most, size)
    return most


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
def amplitudes(mesh: Array, x: Array, turns: Array, scale: Array, m: int, half: Array) -> None:
    """Half the range of each state, less its turns; where it hardly moves, a part of all."""
    most = 0.0
    for c in range(x.shape[1]):
        low, high = np.inf, -np.inf
        for j in range(mesh.size - 1):
            h = (mesh[j + 1] - mesh[j]) / m
            for k in range(m + 1):
                value = x[j * m + k, c] - turns[c] * (mesh[j] + k * h)
                low, high = min(low, value), max(high, value)
        half[c] = 0.5 * (high - low)
        most = max(most, half[c] / scale[c])
    for c in range(x.shape[1]):
        half[c] = max(half[c], STILL * most * scale[c])


@kernel
def extremes(x: Array, fine: Array, m: int, low: Array, high: Array) -> None:
    """Least and largest values of each column, with ``fine`` from places to those of a fine grid.

    The three intervals with the highest places are looked at.
    """
    count, grid = (x.shape[0] - 1) // m, fine.shape[0]
    values = np.empty(grid)
    tops = np.empty(count)
    for c in range(x.shape[1]):
        for sign in (1.0, -1.0):
            best = -np.inf
            for j in range(count):
                tops[j] = -np.inf
                for k in range(m + 1):
                    tops[j] = max(tops[j], sign * x[j * m + k, c])
            for _ in range(min(3, count)):
                j = 0
                for i in range(count):
                    if tops[i] > tops[j]:
                        j = i
                best = max(best, tops[j])
                tops[j] = -np.inf
                at = 0
                for i in range(grid):
                    total = 0.0
                    for k in range(m + 1):
                        total += fine[i, k] * x[j * m + k, c]
                    values[i] = sign * total
                    if values[i] > values[at]:
                        at = i
                # A parabola through three values, whose top may lie between the last two.
                k = min(max(at, 1), grid - 2)
                rise = 0.5 * (values[k + 1] - values[k - 1])
                bend = values[k - 1] - 2.0 * values[k] + values[k + 1]
                if bend < 0.0 and abs(rise) <= -bend:
                    best = max(best, values[k] - 0.5 * rise * rise / bend)
                best = max(best, values[at])
            if sign > 0.0:
                high[c] = best
            else:
                low[c] = -best


@kernel
def mean(mesh: Array, x: Array, weights: Array, value: Array, out: Array) -> None:
    """Integral over a period of each column."""
    m = weights.size
    out[:] = 0.0
    for j in range(mesh.size - 1):
        h = mesh[j + 1] - mesh[j]
        for i in range(m):
            for k in range(m + 1):
                part = h * weights[i] * value[i, k]
                for c in range(x.shape[1]):
                    out[c] += part * x[j * m + k, c]


@kernel
def fill_ranges(
    mesh: Array, x: Array, fine: Array, weights: Array, value: Array, out: Array
) -> None:
    """Fill the least, the largest and the mean value of each column, rows of ``out``."""
    extremes(x, fine, weights.size, out[0], out[1])
    mean(mesh, x, weights, value, out[2])


@kernel
def fill_numbers(
    mesh: Array, x: Array, y: Array, turns: Array, scale: Array, width: Array, own: int,
    weights: Array, value: Array, out: Array,
) -> None:  # fmt: skip
    """Fill the parameters, the period, and of each state, less its turns, mean and deviation."""
    m, n, a = weights.size, x.shape[1], width.size
    flat, at = np.empty_like(x), np.empty(x.shape[0])
    middle, square = np.empty(n), np.empty(n)
    times(mesh, m, at)
    for i in range(x.shape[0]):
        for c in range(n):
            flat[i, c] = x[i, c] - at[i] * turns[c]
    mean(mesh, flat, weights, value, middle)
    for i in range(x.shape[0]):
        for c in range(n):
            flat[i, c] = (flat[i, c] - middle[c]) ** 2
    mean(mesh, flat, weights, value, square)
    for k in range(a):
        out[k] = y[1 + k] / width[k]
    out[a] = np.log(y[0])
    for c in range(own):
        out[a + 1 + c] = middle[c] / scale[c]
        out[a + 1 + own + c] = np.sqrt(abs(square[c])) / scale[c]


@kernel
def highest(
    mesh: Array, x: Array, coefficients: Array, scale: Array, closure: Array, out: Array
) -> None:
    """Size of the derivative of order m + 1 on each interval (see `collocation.highest`).

    A state with closure 0 does not come back: its first and last intervals have one neighbour.
    """
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
    for c in range(n):
        if closure[c] == 0.0 and count > 1:
            jump[0, c] = jump[1, c]
    for j in range(count):
        after = j + 1 if j < count - 1 else 0
        out[j] = 0.0
        for c in range(n):
            there = after if after > 0 or closure[c] != 0.0 else j
            out[j] = max(out[j], 0.5 * (jump[j, c] + jump[there, c]))


@kernel
def error(
    mesh: Array, x: Array, turns: Array, scale: Array, coefficients: Array, closure: Array,
    rest: float,
) -> float:  # fmt: skip
    """Largest part of the derivative of order m + 1 that an interval sees, beside amplitudes.

    0 where all of them are rest.
    """
    half = np.empty(scale.size)
    amplitudes(mesh, x, turns, scale, coefficients.size - 1, half)
    still = True
    for c in range(scale.size):
        still = still and half[c] <= rest * scale[c]
    if still:
        return 0.0
    sizes = np.empty(mesh.size - 1)
    highest(mesh, x, coefficients, half, closure, sizes)
    worst = 0.0
    for j in range(sizes.size):
        size = sizes[j] * (mesh[j + 1] - mesh[j]) ** coefficients.size
        worst = size if not size <= worst else worst
    return worst


@kernel
def even(
    mesh: Array, x: Array, coefficients: Array, scale: Array, closure: Array, new: Array
) -> None:
    """Fill a mesh over whose intervals the error is spread evenly (see `collocation.even`)."""
    count, last = mesh.size - 1, new.size - 1
    density = np.empty(count)
    highest(mesh, x, coefficients, scale, closure, density)
    whole = 0.0
    for j in range(count):
        density[j] **= 1.0 / coefficients.size
        whole += density[j] * (mesh[j + 1] - mesh[j])
    for k in range(last + 1):
        new[k] = k / last
    if not whole > 0.0 or not np.isfinite(whole):
        return
    # A part of it everywhere, so that no interval grows where nothing seems to happen.
    reached, j, step = 0.0, 0, 1.2 * whole / last
    part = (density[0] + 0.2 * whole) * (mesh[1] - mesh[0])
    for k in range(1, last):
        while j < count - 1 and reached + part < k * step:
            reached += part
            j += 1
            part = (density[j] + 0.2 * whole) * (mesh[j + 1] - mesh[j])
        new[k] = mesh[j] + (mesh[j + 1] - mesh[j]) * min((k * step - reached) / part, 1.0)


@kernel
def reaches(
    mesh: Array, jet_: Array, scale: Array, period: float, m: int, reach: Array
) -> None:  # fmt: skip
    """Fill rate times length of each interval; NaN where a rate is not finite."""
    n = scale.size
    wide = jet_.shape[1] // n - 1
    for j in range(mesh.size - 1):
        rate = 0.0
        for i in range(m):
            for c in range(n):
                size = 0.0
                for d in range(n):
                    size += abs(jet_[j * m + i, n + c * wide + d] * scale[d] / scale[c])
                if not np.isfinite(size):
                    rate = np.nan
                elif not np.isnan(rate):
                    rate = max(rate, size)
        reach[j] = (mesh[j + 1] - mesh[j]) * period * rate


@kernel
def divided(mesh: Array, counts: Any, new: Array) -> None:
    """Fill a mesh whose intervals are parts of those of another one."""
    place = 0
    for j in range(counts.size):
        for k in range(counts[j]):
            new[place] = mesh[j] + (mesh[j + 1] - mesh[j]) * (k / counts[j])
            place += 1
    new[place] = 1.0


@kernel
def times(mesh: Array, m: int, out: Array) -> None:
    """The times of all places of a mesh."""
    for j in range(mesh.size - 1):
        for k in range(m):
            out[j * m + k] = mesh[j] + (mesh[j + 1] - mesh[j]) * (k / m)
    out[out.size - 1] = mesh[mesh.size - 1]


@kernel
def jets(
    first: Any, mode: int, par: Array, active: Any, forced: bool, mesh: Array, nodes: Array,
    value: Array, x: Array, y: Array, scale: Array, out: Array,
) -> None:  # fmt: skip
    """F and its derivatives by states and active parameters at all Gauss points."""
    m, n = nodes.size, x.shape[1]
    a = active.size
    count = n + n * (n + a)
    u, sizes, value_at = 0, n + a, 2 * (n + a)
    spare = value_at + count
    w = np.zeros(spare + spare_size(n, n + a))
    for i in range(n + a):
        w[sizes + i] = scale[i]
    if forced:
        w[sizes + n] = y[0]
    t = 1 if forced else 0
    for i in range(t, a):
        w[u + n + i] = y[1 + i - t]
    for j in range(mesh.size - 1):
        h = mesh[j + 1] - mesh[j]
        for i in range(m):
            for c in range(n):
                total = 0.0
                for k in range(m + 1):
                    total += value[i, k] * x[j * m + k, c]
                w[u + c] = total
            if forced:
                w[u + n] = y[0] * (mesh[j] + h * nodes[i])
            jet(first, mode, n, w, u, par, active, sizes, value_at, spare)
            for k in range(count):
                out[j * m + i, k] = w[value_at + k]


@kernel
def evaluate(function: Any, par: Array, w: Array, out: int) -> None:
    """Call a native function of the numbers at the head of w, which fills w from a place on."""
    call(function, w, 0, par, 0, out)
