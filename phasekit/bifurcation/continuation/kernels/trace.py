"""Pseudo-arclength continuation of a curve G(u) = 0 ([AllgowerGeorg1990] chapters 2 to 6).

Lengths and angles are measured with weights, one an unknown: the inverse squares of the scales of
states and parameters, zero for what a defining system adds to them. Predictor: the parabola through
the last two tangents. Corrector: Newton with the hyperplane across the tangent. Matrices are scaled
by columns and rows, so that units do not matter.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from phasekit.bifurcation.continuation.kernels.defining import HOPF, TORUS, evaluate, places
from phasekit.bifurcation.continuation.kernels.newton import DIVERGED, NO_NUMBER, correct
from phasekit.bifurcation.continuation.kernels.state import (
    DONE,
    LAST,
    LENGTH,
    NEXT,
    SCALE,
    SIDE,
    SIGN,
)
from phasekit.numerics.compile import Array, kernel, routine
from phasekit.numerics.native import copy, dot, inner, orientation, twin

# Settings, by place; then come period, lower and upper bound of each unknown.
LONGEST, SHORTEST, TOLERANCE, ITERATIONS, TURN, LARGEST_TURN, SETTINGS = range(7)
# Where the sign of the determinant changes, branches cross, or pass each other closely: only a step
# as short as this tells one from the other, where a longer one might jump.
CAREFUL = 1e-6
# Reasons to stop.
FULL, BOUND, CLOSED, STUCK, NOT_FINITE = range(5)
# Why steps are refused, beside what Newton's method says: the curve turns, or branches cross.
TURNS, CROSSES = 1, 2
# What is recorded of a step, after unknowns and tangent.
STEP_LENGTH, NEWTON_STEPS, ANGLE, ARCLENGTH, RECORDED = range(5)


@kernel
def trace(
    first: Any, second: Any, mode: int, kind: int, n: int, par: Array, active: Any, fixed: Array,
    w: Array, record: Array, slopes: Array,
) -> tuple[int, int, int]:  # fmt: skip
    """Follow a curve until the record is full, or something ends it.

    The derivatives of f at each point are left in ``slopes``.

    The state at the head of ``w`` says where it stands, and is left so after the last point.
    Returns the number of points, the reason to stop, and which unknown met its bound, or why the
    last step was refused.
    """
    size, _, aux, v, a, b, base, _, _, _, _, _, spare = places(kind, n, active.size)
    m = n + active.size
    u, t, old, scale, weight = 0, size, 2 * size, 3 * size, 4 * size
    start_tangent, number = 6 * size, 7 * size
    # The six vectors: new point, row, prediction, chord, new tangent, the start beside this step.
    row, guess, chord, new, beside = (
        v + size,
        v + 2 * size,
        v + 3 * size,
        v + 4 * size,
        v + 5 * size,
    )
    period, low, high = SETTINGS, SETTINGS + size, SETTINGS + 2 * size
    tolerance = fixed[TOLERANCE]
    limit = int(fixed[ITERATIONS])
    for k in range(record.shape[0]):
        h = 0.0
        angle = 0.0
        steps = 0
        side = 0.0
        moved = False
        smooth = True
        which = -1
        reason = -1
        why = DIVERGED
        while True:  # until a step stands
            h = w[number + NEXT]
            if h < fixed[SHORTEST]:
                return k, (NOT_FINITE if why == NO_NUMBER else STUCK), why
            predict(w, u, t, old, weight, h, w[number + LAST], v, row, guess, size)
            target = dot(w, row, v, size)
            steps = correct(
                first, second, mode, kind, n, par, active, w, v, row, target, tolerance, limit
            )
            if steps < 0:
                why = steps
                w[number + NEXT] = 0.25 * h
                continue
            gather(w, scale, b, new, u, v, chord, guess, size)
            length = np.sqrt(inner(w, weight, new, new, size))
            w[new : new + size] /= length
            angle = np.arccos(min(1.0, max(-1.0, inner(w, weight, new, t, size))))
            drift = np.sqrt(inner(w, weight, guess, guess, size)) / h
            smooth = angle <= fixed[LARGEST_TURN] and drift <= 0.25
            # A bend that is shorter than any step is passed: the point is next to the last one.
            sharp = not smooth and 0.5 * h < fixed[SHORTEST] and drift <= 2.0
            if smooth or sharp:
                side = orientation(w, a, size, w[number + SIGN])
            if not smooth and not (sharp and side * w[number + SIDE] >= 0.0):
                why = TURNS
                w[number + NEXT] = 0.5 * h
                continue
            if side * w[number + SIDE] < 0.0 and h > max(CAREFUL, 4.0 * fixed[SHORTEST]):
                why = CROSSES
                w[number + NEXT] = 0.25 * h
                continue

            # A bound that is passed ends the curve on it, at the smallest fraction of the chord.
            fraction, which = passed(w, fixed, v, chord, low, high, size)
            if which >= 0 and fraction <= 1e-12:
                return k, BOUND, which
            if which < 0 and not (
                w[number + DONE] >= 2.0 and comes_back(w, size, m, fixed, u, v, chord, beside)
            ):
                break
            if which < 0 and inner(w, weight, chord, chord, size) <= (10.0 * CAREFUL) ** 2:
                # The start is a branch point, where Newton's method has nothing to hold on to.
                copy(w, beside, v, size)
                evaluate(first, second, mode, kind, n, par, active, w, v)
                reason = CLOSED
                break
            moved = True
            for j in range(size):
                w[guess + j] = w[v + j]  # to come back to
                if which >= 0:
                    w[v + j] = w[u + j] + fraction * w[chord + j]
                    w[row + j] = 0.0
                else:
                    w[v + j] = w[beside + j]
                    w[row + j] = w[weight + j] * w[start_tangent + j]
            if which >= 0:
                target = (
                    fixed[high + which]
                    if w[guess + which] > fixed[high + which]
                    else (fixed[low + which])
                )
                w[row + which] = 1.0
            else:
                target = 0.0
                for j in range(size):
                    target += w[row + j] * w[beside + j]
            for j in range(size):
                w[chord + j] = w[v + j]
            final = correct(
                first, second, mode, kind, n, par, active, w, v, row, target, tolerance, 2 * limit
            )
            far = 0.0
            for j in range(m):
                far = max(far, abs(w[v + j] - w[chord + j]) / w[scale + j])
            if final > 0 and which >= 0 and far <= h:
                reason = BOUND
                w[v + which] = target
            elif final > 0 and which < 0 and far <= 1e-6:
                reason = CLOSED
            elif which >= 0:
                why = final if final < 0 else TURNS
                w[number + NEXT] = 0.5 * h
                continue
            if reason < 0:  # a near miss: the step stands, and its derivatives are restored
                copy(w, guess, v, size)
                evaluate(first, second, mode, kind, n, par, active, w, v)
            else:
                steps = final
                for j in range(size):
                    w[new + j] = w[scale + j] * w[b + 2 * j + 1]
                length = np.sqrt(inner(w, weight, new, new, size))
                if inner(w, weight, new, t, size) < 0.0:
                    length = -length
                w[new : new + size] /= length
            break

        if moved:
            gather(w, scale, b, -1, u, v, chord, -1, size)
        length = np.sqrt(inner(w, weight, chord, chord, size))
        w[number + LENGTH] += length
        w[number + LAST] = 0.0 if not smooth else (h if reason < 0 else length)
        w[number + DONE] += 1.0
        w[number + SIDE] = side
        copy(w, t, old, size)
        copy(w, v, u, size)
        copy(w, new, t, size)
        # The next step: after Newton's work and after how far the tangent turned.
        factor = 2.0 if steps <= 3 else (1.2 if steps == 4 else (0.8 if steps == 5 else 0.5))
        if angle > 0.0 and smooth:
            factor = min(factor, max(fixed[TURN] / angle, 0.5))
        w[number + NEXT] = min(h * factor, fixed[LONGEST])
        grow(w, n, size, fixed, period)
        record[k, :size] = w[u : u + size]
        record[k, size : 2 * size] = w[t : t + size]
        slopes[k] = w[base + n : base + n + n * m]
        j = 2 * size
        record[k, j + STEP_LENGTH] = length
        record[k, j + NEWTON_STEPS] = steps
        record[k, j + ANGLE] = angle
        record[k, j + ARCLENGTH] = w[number + LENGTH]
        if kind == HOPF or kind == TORUS:
            turn_phase(kind, w, n, m, size, aux, base + n, spare)
        if reason >= 0:
            return k + 1, reason, which
    return record.shape[0], FULL, 0


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
def comes_back(
    w: Array, size: int, m: int, fixed: Array, u: int, v: int, chord: int, beside: int
) -> bool:
    """Whether the start lies beside this step; `beside` becomes the start on this turn.

    Angles count modulo their period.
    """
    t, weight, start, start_tangent = size, 4 * size, 5 * size, 6 * size
    square = 0.0
    product = 0.0
    for j in range(size):
        w[beside + j] = w[start + j]
        period = fixed[SETTINGS + j]
        if period > 0.0:
            middle = w[u + j] + 0.5 * w[chord + j]
            w[beside + j] -= period * np.round((w[start + j] - middle) / period)
        square += w[weight + j] * w[chord + j] * w[chord + j]
        product += w[weight + j] * w[chord + j] * (w[beside + j] - w[u + j])
    part = product / square
    if not 0.0 < part <= 1.0:
        return False
    across = 0.0
    for j in range(size):
        gap = w[beside + j] - w[u + j] - part * w[chord + j]
        across += w[weight + j] * gap * gap
    if across > 0.01 * square:
        return False
    ahead = inner(w, weight, start_tangent, t, size)
    return ahead > 0.8 * np.sqrt(inner(w, weight, start_tangent, start_tangent, size))


def _passed(
    w: Array, fixed: Array, v: int, chord: int, low: int, high: int, size: int
) -> tuple[float, int]:
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
def passed(
    w: Array, fixed: Array, v: int, chord: int, low: int, high: int, size: int
) -> tuple[float, int]:
    """The smallest fraction of the chord at which a bound is met, and which one; -1: none."""
    value = w[v : v + size]
    inside = (value <= fixed[high : high + size]) & (value >= fixed[low : low + size])
    return (1.0, -1) if inside.all() else _passed(w, fixed, v, chord, low, high, size)


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


@routine
def turn_phase(kind: int, w: Array, n: int, m: int, size: int, aux: int, base: int, y: int) -> None:
    """Keep v of a curve of pairs off eigenvectors, and the phase l.v = 0 one that decides.

    Where v is an eigenvector, as it may become on neutral saddles, the curve meets one on which
    only one eigenvalue counts. In the invariant plane, v is turned to where f_x turns it most.
    """
    scale = SCALE * size + m  # of v
    along = 0.0
    large = 0.0
    for i in range(n):
        w[y + i] = 0.0
        for j in range(n):
            w[y + i] += w[base + i * m + j] * w[m + j] / w[scale + i]
            large = max(large, abs(w[base + i * m + j]) * w[scale + j] / w[scale + i])
        along += w[y + i] * w[m + i] / w[scale + i]
    square = 0.0
    product = 0.0
    for i in range(n):
        w[y + i] -= along * w[m + i] / w[scale + i]
        square += w[y + i] * w[y + i]
        product += w[aux + i] * w[scale + i] * w[y + i]
    root = np.sqrt(square)
    if not root > 1e-6 * large:
        return
    # f_x on the plane, by v and what is across it: trace zero, determinant k; of a map (whose
    # trace is -k) once half the trace is taken off.
    pair = w[m + n]
    if kind == TORUS:
        along += 0.5 * pair
        pair -= 0.25 * pair * pair
    back = -(pair + along * along) / root
    even, odd = 0.5 * (root - back), 0.5 * (root + back)
    amplitude = np.sqrt(odd * odd + along * along)
    sign = 1.0 if even >= 0.0 else -1.0
    turned = root < 0.5 * (abs(even) + amplitude)
    if not turned and abs(product) >= 0.5 * root:
        return
    angle = 0.5 * np.arctan2(-sign * along, sign * odd) if turned else 0.0
    c, s = np.cos(angle), np.sin(angle)
    for i in range(n):
        v, across = w[m + i] / w[scale + i], w[y + i] / root
        w[m + i] = (c * v + s * across) * w[scale + i]
        w[aux + i] = (c * across - s * v) / w[scale + i]
        if turned:  # it is predicted to stay
            w[size + m + i] = 0.0
            w[2 * size + m + i] = 0.0
    w[7 * size + SIDE] = 0.0  # the determinant is another one
