"""Derivatives of a right-hand side that is given alone, by differences, and its values.

A step that suits the size of an unknown may be far too wide for f: each derivative is taken over
one and over two steps, and again over shorter ones until what they leave out is rounding.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from phasekit.arrays import Array
from phasekit.numerics.compile import inline, kernel, routine
from phasekit.numerics.native import call, twin

# How the right-hand side comes: with its derivatives, or alone, to be differenced.
DERIVED, PLAIN, SHARP = range(3)

COARSE = 2.0**-20  # of central differences, while stepping
STEP = 2.0**-10  # of fourth-order differences: their error is STEP^4 and rounding/STEP
FINE = 2.0**-22  # of those that show whether STEP is too wide to see what f does
SHORTER = 0.125
TRIES = 8
BENT = 2.0**-8  # of the bend of f over a step beside its rise, from where shorter ones are tried
NEAR = 16.0  # steps within which an edge of the domain is near
CLOSE = 1e-4  # of slopes over two steps that are the same
EDGES = 12  # times that steps are made shorter next to an edge of the domain
EPSILON = 2.0**-52
KNOWN = 1e-10  # relative error that rounding alone does not exceed
MIXED = 2.0**-12  # of mixed second differences


@inline
def spare_size(n: int, m: int) -> int:
    """Length of what `jet` and `bend` need for themselves."""
    return m + 11 * n


@routine
def plain(function: Any, n: int, w: Array, x: int, par: Array, active: Any, out: int) -> None:
    """Call a right-hand side that takes the state and all parameters."""
    for i in range(n):
        w[out + i] = np.nan
    for j in range(active.size):
        par[active[j]] = w[x + n + j]
    call(function, w, x, par, x, out)


@routine
def coarse(x: float, scale: float) -> float:
    """What steps of an unknown are measured by: its scale, a little more where it is far from 0.

    The square of a step is left out, and rounding of x over the step: least where the third power
    of the step is that of both together. A power of two.
    """
    return float(2.0 ** np.floor(np.log2(scale * max(1.0, abs(x) / scale) ** (1.0 / 3.0))))


@routine
def across(
    function: Any, n: int, w: Array, x: int, j: int, step: float, par: Array, active: Any,
    value: int, slope: int, bend_: int, both: int,
) -> None:  # fmt: skip
    """The central difference over a step along an unknown; the sum of both sides is added on.

    Where f has no value on one side, next to the edge of its domain, steps are shorter.
    """
    middle = w[x + j]
    left = EDGES
    while True:
        finite = True
        for side in range(2):
            k = 1.0 - 2.0 * side
            w[x + j] = middle + k * step
            plain(function, n, w, x, par, active, value)
            for i in range(n):
                w[slope + i] = k * w[value + i] + (w[slope + i] if side == 1 else 0.0)
                w[both + i] = w[value + i] + (w[both + i] if side == 1 else 0.0)
                finite = finite and np.isfinite(w[value + i])
        if finite and (left == EDGES or left == 0):
            break
        # Once there are values, the edge shall be far beside the step.
        left = min(left - 1, 1) if finite else left - 1
        shorter = step / (64.0 if finite else 16.0)
        if left < 0 or shorter <= 4.0 * EPSILON * abs(middle):
            break
        step = shorter
    for i in range(n):
        w[slope + i] /= 2.0 * step
        w[bend_ + i] += w[both + i]
    w[x + j] = middle


@routine
def ends(
    function: Any, n: int, w: Array, x: int, j: int, reach: float, par: Array, active: Any,
    value: int,
) -> bool:  # fmt: skip
    """Whether f has no value within a reach along an unknown."""
    middle = w[x + j]
    finite = True
    for side in range(2):
        w[x + j] = middle + (1.0 - 2.0 * side) * reach
        plain(function, n, w, x, par, active, value)
        for i in range(n):
            finite = finite and np.isfinite(w[value + i])
    w[x + j] = middle
    return not finite


@routine
def shorter(
    function: Any, n: int, w: Array, x: int, j: int, step: float, par: Array, active: Any,
    value: int, slope: int, bend_: int, both: int, fine: int, out: int,
) -> None:  # fmt: skip
    """The slope of a function that bends within a step, over one that is short enough."""
    last = np.inf
    for _ in range(EDGES):
        if step / 16.0 <= 4.0 * EPSILON * abs(w[x + j]):
            return
        gap = 0.0
        for i in range(n):
            w[both + i] = abs(w[slope + i]) + abs(w[bend_ + i]) / step
        size = w[both : both + n].copy()
        step /= 16.0
        for i in range(n):
            w[bend_ + i] = -2.0 * w[out + i]
        across(function, n, w, x, j, step, par, active, value, fine, bend_, both)
        for i in range(n):
            off = abs(w[fine + i] - w[slope + i])
            gap = max(gap, off / size[i] if size[i] > 0.0 else off)
        if not (CLOSE < gap < 0.5 * last):
            return  # it is the same, or but rounding
        last = gap
        for i in range(n):
            w[slope + i] = w[fine + i]


def _jet(
    first: Any, mode: int, n: int, w: Array, u: int, par: Array, active: Any, scale: int, out: int,
    spare: int,
) -> None:  # fmt: skip
    if mode == DERIVED:
        call(first, w, u, par, u, out)
        return
    m = n + active.size
    x, value = spare, spare + m
    near, far, fine, wide = value + n, value + 2 * n, value + 3 * n, value + 4 * n
    bend_, least = value + 5 * n, value + 6 * n
    noise, largest, terms, both = value + 7 * n, value + 8 * n, value + 9 * n, value + 10 * n
    for i in range(m):
        w[x + i] = w[u + i]
    plain(first, n, w, x, par, active, out)
    # What rounding does to f over the shortest steps: as it shows along the unknown where it does
    # second most (where it does most, f itself may change within less), and that of its terms.
    for i in range(n):
        w[noise + i] = w[largest + i] = w[terms + i] = 0.0
    for j in range(m if mode == SHARP else 0):
        size = 2.0 ** np.floor(np.log2(max(abs(w[u + j]), w[scale + j])))
        across(first, n, w, x, j, FINE * size, par, active, value, fine, bend_, both)
        across(first, n, w, x, j, 2.0 * FINE * size, par, active, value, wide, bend_, both)
        for i in range(n):
            gap = FINE * size * abs(w[fine + i] - w[wide + i])
            w[noise + i] = max(w[noise + i], min(gap, w[largest + i]))
            w[largest + i] = max(w[largest + i], gap)
            w[terms + i] += EPSILON * size * abs(w[fine + i])
    for j in range(m):
        # Powers of two, so that what is added to a number of its size is exact.
        size = 2.0 ** np.floor(np.log2(max(abs(w[u + j]), w[scale + j])))
        place = out + n + j
        if mode == PLAIN:
            step = COARSE * coarse(w[u + j], w[scale + j])
            for i in range(n):
                w[bend_ + i] = -2.0 * w[out + i]
            across(first, n, w, x, j, step, par, active, value, near, bend_, both)
            bent = False
            for i in range(n):
                bent = bent or abs(w[bend_ + i]) > BENT * abs(2.0 * step * w[near + i])
            # Next to an edge of the domain, not where f itself turns within a step.
            if bent and ends(first, n, w, x, j, NEAR * step, par, active, value):
                shorter(first, n, w, x, j, step, par, active, value, near, bend_, both, fine, out)
            for i in range(n):
                w[place + i * m] = w[near + i]
            continue
        across(first, n, w, x, j, FINE * size, par, active, value, fine, bend_, both)
        across(first, n, w, x, j, 2.0 * FINE * size, par, active, value, wide, bend_, both)
        for i in range(n):
            w[least + i] = np.inf
            w[place + i * m] = w[fine + i]
        step = STEP * size
        for _ in range(TRIES):
            across(first, n, w, x, j, 2.0 * step, par, active, value, far, bend_, both)
            for i in range(n):
                w[bend_ + i] = -2.0 * w[out + i]
            across(first, n, w, x, j, step, par, active, value, near, bend_, both)
            done = True
            for i in range(n):
                gap = abs(w[near + i] - w[far + i])
                best = w[near + i] + (w[near + i] - w[far + i]) / 3.0
                slope, curved = abs(w[near + i]), abs(w[bend_ + i]) / step
                # The square of the step over the width of f, by its first or second derivative.
                width = (gap / curved) ** 2 if curved > 0.0 else np.inf
                width = min(width, gap / slope) if slope > 0.0 else width
                left = gap * width if gap > 0.0 else 0.0
                # What rounding does to the shortest differences, here in proportion.
                rounding = FINE * size / step * abs(w[fine + i] - w[wide + i])
                rounding = min(rounding, KNOWN * (slope + 100.0 * curved))
                rounding += w[terms + i] / step
                seen = max(w[noise + i], w[terms + i]) / (FINE * size)
                seen = max(seen, abs(w[fine + i] - w[wide + i]))
                off = max(0.0, abs(best - w[fine + i]) - 4.0 * seen)
                off = 0.0 if off <= 1e-9 * (slope + curved) else off
                if left + off + rounding < w[least + i]:
                    w[place + i * m] = best
                    w[least + i] = left + off + rounding
                done = done and left <= rounding and off == 0.0
            if done:
                break
            step *= SHORTER


@twin(_jet)
def jet(
    first: Any, mode: int, n: int, w: Array, u: int, par: Array, active: Any, scale: int, out: int,
    spare: int,
) -> None:  # fmt: skip
    """F and its derivatives by state and free parameters, row by row."""
    call(first, w, u, par, u, out)


def _bend(
    first: Any, second: Any, mode: int, n: int, w: Array, u: int, par: Array, active: Any,
    scale: int, z: int, out: int, spare: int,
) -> None:  # fmt: skip
    if mode == DERIVED:
        call(second, w, u, par, z, out)
        return
    m = n + active.size
    out += n + n * m
    x = spare
    value = spare + m
    length = 0.0
    for i in range(m):
        length = max(length, abs(w[z + i]) / max(abs(w[u + i]), w[scale + i]))
    for i in range(n * m):
        w[out + i] = 0.0
    if length == 0.0:
        return
    along = MIXED / length
    for j in range(m):
        step = MIXED * max(abs(w[u + j]), w[scale + j])
        for side in range(4):
            k = (1.0, 1.0, -1.0, -1.0)[side]
            l = (1.0, -1.0, 1.0, -1.0)[side]  # noqa: E741
            for i in range(m):
                w[x + i] = w[u + i] + l * along * w[z + i]
            w[x + j] += k * step
            plain(first, n, w, x, par, active, value)
            weight = k * l / (4.0 * step * along)
            for i in range(n):
                w[out + i * m + j] += weight * w[value + i]


@twin(_bend)
def bend(
    first: Any, second: Any, mode: int, n: int, w: Array, u: int, par: Array, active: Any,
    scale: int, z: int, out: int, spare: int,
) -> None:  # fmt: skip
    """The derivatives of f_u z by state and free parameters, row by row.

    They come after f and its derivatives, which begin at out and are filled as well where the mode
    is DERIVED: what they share is computed once.
    """
    call(second, w, u, par, z, out)


@kernel
def values(first: Any, n: int, pars: Array, active: Any, points: Array, out: Array) -> None:
    """A right-hand side that is given alone, at many points: as many for each row of parameters."""
    m = n + active.size
    w = np.zeros(m + n)
    each = points.shape[0] // pars.shape[0]
    for k in range(points.shape[0]):
        par = pars[k // each]
        for j in range(points.shape[1]):  # which may be fewer, where more values come than states
            w[j] = points[k, j]
        plain(first, n, w, 0, par, active, m)
        for i in range(n):
            out[k, i] = w[m + i]
