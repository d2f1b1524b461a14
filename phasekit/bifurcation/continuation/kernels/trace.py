"""Pseudo-arclength continuation of a curve G(u) = 0 ([AllgowerGeorg1990] chapters 2 to 6)."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from phasekit.arrays import Array
from phasekit.bifurcation.continuation.kernels.defining import (
    DONE,
    HOPF,
    LENGTH,
    NEXT,
    SCALE,
    SIDE,
    TORUS,
    evaluate,
    places,
)
from phasekit.bifurcation.continuation.kernels.newton import DIVERGED, NO_NUMBER
from phasekit.bifurcation.continuation.kernels.step import (
    BESIDE,
    CAREFUL,
    CHORD,
    SHORTEST,
    STANDS,
    TURNS,
    attempt,
    comes_back,
    land,
    passed,
    take,
)
from phasekit.numerics.compile import kernel, routine
from phasekit.numerics.native import copy, inner, keep

# Reasons to stop, beside those of a step.
FULL, BOUND, CLOSED, STUCK, NOT_FINITE, INTERRUPTED = range(6)
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
    size, _, aux, v, _, _, base, _, _, _, _, _, spare = places(kind, n, active.size)
    m = n + active.size
    number, chord, beside = 7 * size, v + CHORD * size, v + BESIDE * size
    for k in range(record.shape[0]):
        why = DIVERGED
        reason = -1
        while True:  # until a step stands
            h = w[number + NEXT]
            if h < fixed[SHORTEST]:
                return k, (NOT_FINITE if why == NO_NUMBER else STUCK), why
            why, steps, angle, side, smooth = attempt(
                first, second, mode, kind, n, par, active, fixed, w, h
            )
            if why != STANDS:
                w[number + NEXT] = (0.5 if why == TURNS else 0.25) * h
                continue
            # A bound that is passed ends the curve on it, at the smallest fraction of the chord.
            fraction, which = passed(w, fixed, v, chord, size)
            if which >= 0 and fraction <= 1e-12:
                return k, BOUND, which
            if which < 0 and not (w[number + DONE] >= 2.0 and comes_back(w, size, fixed, v)):
                break
            if which < 0 and inner(w, 4 * size, chord, chord, size) <= (10.0 * CAREFUL) ** 2:
                # The start is a branch point, where Newton's method has nothing to hold on to.
                copy(w, beside, v, size)
                evaluate(first, second, mode, kind, n, par, active, w, v)
                reason = CLOSED
                break
            there, final = land(
                first, second, mode, kind, n, par, active, fixed, w, which, fraction, h
            )
            if there:
                reason, steps = (BOUND if which >= 0 else CLOSED), final
            elif which >= 0:
                why = final if final < 0 else TURNS
                w[number + NEXT] = 0.5 * h
                continue
            break
        length = take(w, size, n, v, fixed, h, steps, angle, side, smooth, reason >= 0)
        keep(record[k], w, 0, 2 * size)
        keep(slopes[k], w, base + n, n * m)
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
    angle = 0.5 * math.atan2(-sign * along, sign * odd) if turned else 0.0
    c, s = math.cos(angle), math.sin(angle)
    for i in range(n):
        v, across = w[m + i] / w[scale + i], w[y + i] / root
        w[m + i] = (c * v + s * across) * w[scale + i]
        w[aux + i] = (c * across - s * v) / w[scale + i]
        if turned:  # it is predicted to stay
            w[size + m + i] = 0.0
            w[2 * size + m + i] = 0.0
    w[7 * size + SIDE] = 0.0  # the determinant is another one
