"""The action of an orbit: the area inside it, over 2 pi.

It is the mean of phi'^2 over time, divided by the frequency. Over the phase the trapezoidal rule
converges exponentially, and as all its terms are positive it keeps the relative accuracy of small
oscillations. Where the motion lingers for very long, next to saddles that are nearly degenerate,
the area is integrated over the angle instead.
"""

from __future__ import annotations

import math

import numpy as np

from phasekit.arrays import Array
from phasekit.numerics.agm import STEPS
from phasekit.numerics.compile import inline, routine
from phasekit.numerics.double_double import TWO_PI
from phasekit.phase.exact.kernels.levels import GAP, MODE, SWING, TURN
from phasekit.phase.exact.kernels.shape import (
    HIGH,
    LEVELS,
    LOW,
    MEANS,
    NODES,
    PHI_S,
    RATIO,
    SKEW,
    SLOPE,
    U,
)
from phasekit.phase.exact.kernels.system import PHI, A

# Nodes of the trapezoidal rule: the fewest, the most, and how many are done at a time.
FEWEST, MOST, CHUNK = 32, 1024, 32
# Below this frequency rounding puts all nodes next to the saddle.
LINGERS = 1e-9
SINE = NODES
COSINE = SINE + CHUNK
DELTA = COSINE + CHUNK
SIZE = DELTA + CHUNK


def _nodes() -> Array:
    """Phases of the first nodes, then those half-way, and so on to the most."""
    steps = [np.arange(FEWEST) / FEWEST]
    nodes = FEWEST
    while nodes < MOST:
        steps.append((np.arange(nodes) + 0.5) / nodes)
        nodes *= 2
    return 2.0 * np.pi * np.concatenate(steps)


SINES = np.sin(_nodes())
COSINES = np.cos(_nodes())

# Double exponential quadrature over a length of 1: distances of the nodes from the ends, their
# weights, and the weight of the middle.
STEP = 1.0 / 64.0
STEPS_OUT = STEP * np.arange(1, 212)
ENDS = 1.0 / (1.0 + np.exp(np.pi * np.sinh(STEPS_OUT)))
WEIGHTS = STEP * np.pi * np.cosh(STEPS_OUT) * ENDS * (1.0 - ENDS)
WEIGHT_MIDDLE = 0.25 * STEP * np.pi


@inline
def square_speeds(first: int, count: int, w: Array) -> tuple[float, float, float]:
    """Sums of phi'^2 over nodes from ``first`` on: all, every other, and every fourth one.

    One Gauss step at a time for all nodes, in loops that vectorise; see `locate`.
    """
    levels = int(w[LEVELS])
    mean = w[MEANS + levels]
    for i in range(count):
        w[SINE + i] = SINES[first + i]
        w[COSINE + i] = COSINES[first + i]
        w[DELTA + i] = mean
    for level in range(levels - 1, -1, -1):
        a = w[MEANS + level]
        b = w[MEANS + STEPS + level]
        mean = w[MEANS + level + 1]
        for i in range(count):
            sine = w[SINE + i]
            cosine = w[COSINE + i]
            square = sine * sine
            rest = cosine * cosine
            inverse = 1.0 / (rest * mean + square * a)
            w[COSINE + i] = cosine * w[DELTA + i] * inverse
            w[DELTA + i] = a * (rest * mean + square * b) * inverse
            w[SINE + i] = sine * a * inverse
    u = w[U]
    ratio = w[RATIO]
    skew = w[SKEW]
    scale = 2.0 * u * ratio
    if w[MODE] == SWING:
        for i in range(count):
            sn = w[SINE + i]
            cn = w[COSINE + i]
            big = 0.5 * (1.0 + abs(cn))
            small = 0.25 * sn * sn / big
            near = big if cn > 0.0 else small
            far = small if cn > 0.0 else big
            top = u * (cn + skew * far if skew < 0.5 else near - ratio * far)
            bottom = near + ratio * far
            rate = scale * sn * w[DELTA + i] / (bottom * bottom + top * top)
            w[DELTA + i] = rate * rate
    else:
        for i in range(count):
            sn = w[SINE + i]
            cn = w[COSINE + i]
            big = np.sqrt(0.5 * (1.0 + abs(cn)))
            small = 0.5 * abs(sn) / big
            near = big if cn >= 0.0 else small
            far = small if cn >= 0.0 else big
            both = near + far
            rest = cn / both
            top = u * (skew * near + (rest if sn >= 0.0 else both))
            bottom = skew * near + (both if sn >= 0.0 else rest)
            rate = scale * w[DELTA + i] / (bottom * bottom + top * top)
            w[DELTA + i] = rate * rate
    fourth = 0.0
    second = 0.0
    odd = 0.0
    for i in range(0, count, 4):
        fourth += w[DELTA + i]
        second += w[DELTA + i + 2]
        odd += w[DELTA + i + 1] + w[DELTA + i + 3]
    return fourth + second + odd, fourth + second, fourth


@routine
def action(w: Array) -> float:
    """Action of a libration or rotation.

    A libration passes each speed twice and is at rest at the ends, so half of the nodes do.
    """
    wide = w[MODE] == TURN or w[HIGH] - w[LOW] > 1.0
    if wide and w[MEANS + int(w[LEVELS])] < LINGERS:
        return area(w) / TWO_PI
    both = 2 if w[MODE] == SWING else 1
    total, even, fourth = square_speeds(0, FEWEST // both, w)
    mean = total
    last = 2.0 * even
    change = abs(last - 4.0 * fourth)
    nodes = FEWEST
    while True:
        # Errors c r^n: twice the nodes square r^n, which is the ratio of two changes.
        before = change
        change = abs(mean - last)
        ratio = change / before if change < before else 1.0
        if change <= 1e-11 * mean or change * ratio <= 1e-17 * mean:
            return mean * both / FEWEST / w[MEANS + int(w[LEVELS])]
        if nodes >= MOST:
            return area(w) / TWO_PI
        last = mean
        count = nodes // both
        for first in range(0, count, CHUNK):
            part, _, _ = square_speeds(nodes + first, min(CHUNK, count - first), w)
            total += part
        nodes *= 2
        mean = total * (FEWEST / nodes)


@inline
def area(w: Array) -> float:
    """Area under one round of the orbit, by double exponential quadrature between equilibria."""
    phi_s = w[PHI_S]
    if w[MODE] == SWING:
        first = w[LOW] - phi_s
        last = w[HIGH] - phi_s
    else:
        first = 0.0
        last = TWO_PI
    total = 0.0
    start = first
    while start < last:
        # The next equilibrium on the way, the reference exactly at a multiple of 2 pi.
        stop = last
        for j in range(4):
            other = w[PHI + j] - phi_s
            for turn_ in range(-2, 3):
                place = other + turn_ * TWO_PI if other != 0.0 else turn_ * TWO_PI
                if start < place < stop:
                    stop = place
        shift = TWO_PI * np.rint(start / TWO_PI if start % TWO_PI == 0.0 else stop / TWO_PI)
        total += integrate(start - shift, stop - shift, w)
        start = stop
    return 2.0 * total if w[MODE] == SWING else total


@inline
def integrate(start: float, stop: float, w: Array) -> float:
    """Integral of |phi'| between two angles from the reference, either of which may be it."""
    length = stop - start
    total = 0.0
    for i in range(ENDS.size):
        reach = length * ENDS[i]
        total += WEIGHTS[i] * (speed(start + reach, w) + speed(stop - reach, w))
    return length * (total + WEIGHT_MIDDLE * speed(0.5 * (start + stop), w))


@inline
def speed(o: float, w: Array) -> float:
    """|phi'| at an angle from the reference, without cancellation next to it."""
    sine = math.sin(0.5 * o)
    bend = w[SLOPE] + w[A] * math.sin(0.5 * o + 2.0 * w[PHI_S]) * sine
    return np.sqrt(2.0 * max(w[GAP] - 2.0 * sine * sine * bend, 0.0))
