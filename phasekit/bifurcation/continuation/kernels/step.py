"""One step along a curve G(u) = 0: prediction, correction, and whether it stands.

Lengths and angles are measured with weights, one an unknown: the inverse squares of the scales of
states and parameters, zero for what a defining system adds to them. Predictor: the parabola through
the last two tangents. Corrector: Newton with the hyperplane across the tangent. Matrices are scaled
by columns and rows, so that units do not matter.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from phasekit.arrays import Array
from phasekit.bifurcation.continuation.kernels.defining import (
    DONE,
    LAST,
    LENGTH,
    NEXT,
    SIDE,
    SIGN,
    evaluate,
    places,
)
from phasekit.bifurcation.continuation.kernels.newton import correct
from phasekit.numerics.compile import routine
from phasekit.numerics.native import copy, divide, dot, inner, twin

# Settings, by place; then come period, lower and upper bound of each unknown.
LONGEST, SHORTEST, TOLERANCE, ITERATIONS, TURN, LARGEST_TURN, SETTINGS = range(7)
# Where the sign of the determinant changes, branches cross, or pass each other closely: only a step
# as short as this tells one from the other, where a longer one might jump.
CAREFUL = 1e-6
# Whether a step stands, or why it is refused, beside what Newton's method says: the curve turns, or
# branches cross.
STANDS, TURNS, CROSSES = range(3)
# The six vectors: new point, row, prediction, chord, new tangent, the start beside this step.
ROW, GUESS, CHORD, NEW, BESIDE = range(1, 6)


@routine
def attempt(
    first: Any, second: Any, mode: int, kind: int, n: int, par: Array, active: Any, fixed: Array,
    w: Array, h: float,
) -> tuple[int, int, float, float, bool]:  # fmt: skip
    """Make a step of length h: its point, tangent and chord.

    Returns why it is refused, or STANDS; Newton's steps, the angle by which the tangent turned, the
    sign of the determinant, and whether the curve is smooth there.
    """
    size, _, _, v, _, b, _, _, _, _, _, _, _ = places(kind, n, active.size)
    t, old, scale, weight, number = size, 2 * size, 3 * size, 4 * size, 7 * size
    row, guess = v + ROW * size, v + GUESS * size
    chord, new = v + CHORD * size, v + NEW * size
    predict(w, 0, t, old, weight, h, w[number + LAST], v, row, guess, size)
    steps = correct(
        first, second, mode, kind, n, par, active, w, v, row, dot(w, row, v, size),
        fixed[TOLERANCE], int(fixed[ITERATIONS]),
    )  # fmt: skip
    if steps < 0:
        return steps, 0, 0.0, 0.0, False
    gather(w, scale, b, new, 0, v, chord, guess, size)
    divide(w, new, np.sqrt(inner(w, weight, new, new, size)), size)
    angle = math.acos(min(1.0, max(-1.0, inner(w, weight, new, t, size))))
    drift = np.sqrt(inner(w, weight, guess, guess, size)) / h
    smooth = angle <= fixed[LARGEST_TURN] and drift <= 0.25
    # A bend that is shorter than any step is passed: the point is next to the last one.
    sharp = not smooth and 0.5 * h < fixed[SHORTEST] and drift <= 2.0
    if not (smooth or sharp):
        return TURNS, steps, angle, 0.0, smooth
    side = w[number + SIGN]
    if sharp and side * w[number + SIDE] < 0.0:
        return TURNS, steps, angle, side, smooth
    if side * w[number + SIDE] < 0.0 and h > max(CAREFUL, 4.0 * fixed[SHORTEST]):
        return CROSSES, steps, angle, side, smooth
    return STANDS, steps, angle, side, smooth


@routine
def land(
    first: Any, second: Any, mode: int, kind: int, n: int, par: Array, active: Any, fixed: Array,
    w: Array, which: int, fraction: float, h: float,
) -> tuple[bool, int]:  # fmt: skip
    """Move the point of a step onto the bound that it passes or, where there is none, the start.

    Returns whether it comes there, and the steps of Newton's method or why it fails. Where the
    start is missed the point stays as it was, with its derivatives.
    """
    size, _, _, v, _, b, _, _, _, _, _, _, _ = places(kind, n, active.size)
    t, scale, weight, start_tangent = size, 3 * size, 4 * size, 6 * size
    low, high = SETTINGS + size, SETTINGS + 2 * size
    row, guess, chord = v + ROW * size, v + GUESS * size, v + CHORD * size
    new, beside = v + NEW * size, v + BESIDE * size
    target = 0.0
    for j in range(size):
        w[guess + j] = w[v + j]  # to come back to
        if which >= 0:
            w[v + j] = w[j] + fraction * w[chord + j]
            w[row + j] = 0.0
        else:
            w[v + j] = w[beside + j]
            w[row + j] = w[weight + j] * w[start_tangent + j]
            target += w[row + j] * w[beside + j]
        w[chord + j] = w[v + j]
    if which >= 0:
        above = w[guess + which] > fixed[high + which]
        target = fixed[high + which] if above else fixed[low + which]
        w[row + which] = 1.0
    steps = correct(
        first, second, mode, kind, n, par, active, w, v, row, target,
        fixed[TOLERANCE], 2 * int(fixed[ITERATIONS]),
    )  # fmt: skip
    far = 0.0
    for j in range(n + active.size):
        far = max(far, abs(w[v + j] - w[chord + j]) / w[scale + j])
    there = bool(steps > 0 and far <= (h if which >= 0 else 1e-6))
    if there:
        if which >= 0:
            w[v + which] = target
        for j in range(size):
            w[new + j] = w[scale + j] * w[b + 2 * j + 1]
        length = np.sqrt(inner(w, weight, new, new, size))
        divide(w, new, -length if inner(w, weight, new, t, size) < 0.0 else length, size)
    elif which < 0:
        copy(w, guess, v, size)
        evaluate(first, second, mode, kind, n, par, active, w, v)
    gather(w, scale, b, -1, 0, v, chord, -1, size)
    return there, steps


@routine
def take(
    w: Array, size: int, n: int, v: int, fixed: Array, h: float, steps: int, angle: float,
    side: float, smooth: bool, last: bool,
) -> float:  # fmt: skip
    """Go to the point of a step, and choose the length of the next one; the length of the chord."""
    number, chord = 7 * size, v + CHORD * size
    length = np.sqrt(inner(w, 4 * size, chord, chord, size))
    w[number + LENGTH] += length
    w[number + LAST] = 0.0 if not smooth else (length if last else h)
    w[number + DONE] += 1.0
    w[number + SIDE] = side
    copy(w, size, 2 * size, size)
    copy(w, v, 0, size)
    copy(w, v + NEW * size, size, size)
    # The next step: after Newton's work and after how far the tangent turned.
    factor = 2.0 if steps <= 3 else (1.2 if steps == 4 else (0.8 if steps == 5 else 0.5))
    if angle > 0.0 and smooth:
        factor = min(factor, max(fixed[TURN] / angle, 0.5))
    w[number + NEXT] = min(h * factor, fixed[LONGEST])
    grow(w, n, size, fixed, SETTINGS)
    return float(length)


def _predict(
    w: Array, u: int, t: int, old: int, weight: int, h: float, last: float, v: int, row: int,
    guess: int, size: int,
) -> None:  # fmt: skip
    bend = 0.5 * h * h / last if last > 0.0 else 0.0
    for j in range(size):
        value = w[u + j] + h * w[t + j] + bend * (w[t + j] - w[old + j])
        w[v + j] = value
        w[guess + j] = value
        w[row + j] = w[weight + j] * w[t + j]


@twin(_predict)
def predict(
    w: Array, u: int, t: int, old: int, weight: int, h: float, last: float, v: int, row: int,
    guess: int, size: int,
) -> None:  # fmt: skip
    """The next point, on the parabola through the last two tangents, and the row of its plane."""
    bend = 0.5 * h * h / last if last > 0.0 else 0.0
    tangent = w[t : t + size]
    value = w[u : u + size] + h * tangent + bend * (tangent - w[old : old + size])
    w[v : v + size] = w[guess : guess + size] = value
    w[row : row + size] = w[weight : weight + size] * tangent


def _gather(
    w: Array, scale: int, b: int, new: int, u: int, v: int, chord: int, guess: int, size: int
) -> None:
    for j in range(size):
        w[chord + j] = w[v + j] - w[u + j]
        if new >= 0:
            w[new + j] = w[scale + j] * w[b + 2 * j + 1]
            w[guess + j] -= w[v + j]


@twin(_gather)
def gather(
    w: Array, scale: int, b: int, new: int, u: int, v: int, chord: int, guess: int, size: int
) -> None:
    """The chord from u to v and, unless their places are -1, the new tangent and the drift."""
    w[chord : chord + size] = w[v : v + size] - w[u : u + size]
    if new >= 0:
        w[new : new + size] = w[scale : scale + size] * w[b + 1 : b + 2 * size : 2]
        w[guess : guess + size] -= w[v : v + size]


@routine
def comes_back(w: Array, size: int, fixed: Array, v: int) -> bool:
    """Whether the start lies beside this step; the last vector becomes the start on this turn.

    Angles count modulo their period.
    """
    t, weight, start, start_tangent = size, 4 * size, 5 * size, 6 * size
    chord, beside = v + CHORD * size, v + BESIDE * size
    square = 0.0
    product = 0.0
    for j in range(size):
        w[beside + j] = w[start + j]
        period = fixed[SETTINGS + j]
        if period > 0.0:
            middle = w[j] + 0.5 * w[chord + j]
            w[beside + j] -= period * np.round((w[start + j] - middle) / period)
        square += w[weight + j] * w[chord + j] * w[chord + j]
        product += w[weight + j] * w[chord + j] * (w[beside + j] - w[j])
    part = product / square
    if not 0.0 < part <= 1.0:
        return False
    across = 0.0
    for j in range(size):
        gap = w[beside + j] - w[j] - part * w[chord + j]
        across += w[weight + j] * gap * gap
    if across > 0.01 * square:
        return False
    ahead = inner(w, weight, start_tangent, t, size)
    return ahead > 0.8 * np.sqrt(inner(w, weight, start_tangent, start_tangent, size))


def _passed(w: Array, fixed: Array, v: int, chord: int, size: int) -> tuple[float, int]:
    low, high = SETTINGS + size, SETTINGS + 2 * size
    fraction = 1.0
    which = -1
    for j in range(size):
        over = max(w[v + j] - fixed[high + j], fixed[low + j] - w[v + j])
        if over > 0.0:
            part = max(0.0, 1.0 - over / abs(w[chord + j])) if w[chord + j] != 0.0 else 0.0
            if part < fraction or which < 0:
                fraction = part
                which = j
    return fraction, which


@twin(_passed)
def passed(w: Array, fixed: Array, v: int, chord: int, size: int) -> tuple[float, int]:
    """The smallest fraction of the chord at which a bound is met, and which one; -1: none."""
    low, high = SETTINGS + size, SETTINGS + 2 * size
    value = w[v : v + size]
    inside = (value <= fixed[high : high + size]) & (value >= fixed[low : low + size])
    return (1.0, -1) if inside.all() else _passed(w, fixed, v, chord, size)


def _grow(w: Array, n: int, size: int, fixed: Array, period: int) -> None:
    scale, weight, start = 3 * size, 4 * size, 5 * size
    grown = False
    for j in range(n):
        far = abs(w[j] - w[start + j])
        if fixed[period + j] == 0.0 and far > 2.0 * w[scale + j]:
            w[weight + j] *= (w[scale + j] / far) ** 2
            w[scale + j] = far
            grown = True
    if grown:
        length = np.sqrt(inner(w, weight, size, size, size))
        for j in range(size):
            w[size + j] /= length
        w[7 * size + LAST] = 0.0


@twin(_grow)
def grow(w: Array, n: int, size: int, fixed: Array, period: int) -> None:
    """Let the scales of states that are no angles follow how far the states have come.

    Lengths are measured anew.
    """
    far = np.abs(w[:n] - w[5 * size : 5 * size + n])
    if (far > 2.0 * w[3 * size : 3 * size + n]).any():
        _grow(w, n, size, fixed, period)
