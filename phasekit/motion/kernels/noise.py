"""Heun's steps of motions with additive white noise, eight paths at once."""

from __future__ import annotations

import math

import numpy as np

from phasekit.arrays import Array, Index
from phasekit.numerics.compile import inline, kernel, routine
from phasekit.numerics.lanes import LANES, invoke


@inline
def evaluate(address: int, x: Array, p: Array, z: Array, y: Array) -> None:
    """Y = f(x) of all lanes at the times z."""
    invoke(address, x, p, z, y)


@inline
def passage(
    a: float, b: float, rate: float, h: float, uniform: float, normal: float, other: float
) -> float:
    """Part of a step after which a function first vanishes, from a to b; 2 where it does not.

    The path between the ends is a Brownian bridge, which spreads at a rate. It vanishes between
    ends of one sign with the probability exp(-2 a b/(rate h)); then, and between ends of two signs,
    s/(1 - s) has an inverse Gaussian distribution [MichaelSchucanyHaas1976].
    """
    same = a > 0.0 and b > 0.0 or a < 0.0 and b < 0.0
    if same and not (rate > 0.0 and uniform < math.exp(-2.0 * a * b / (rate * h))):
        return 2.0
    if a == 0.0:
        return 0.0
    if b == 0.0:
        return 1.0
    if not rate > 0.0:
        return a / (a - b)
    mean, shape = abs(a / b), a * a / (rate * h)
    w = 0.5 * mean * normal * normal / shape
    odds = mean / (1.0 + w + math.sqrt(w * (2.0 + w)))
    if other > mean / (mean + odds):
        odds = mean * mean / odds
    return odds / (1.0 + odds)


@routine
def enter(begun: int, states: Array, parameters: Array, x: Array, p: Array) -> int:
    """Put the next paths into the lanes, the last into those that are left; return how many."""
    own = min(LANES, states.shape[0] - begun)
    for lane in range(LANES):
        path = begun + min(lane, own - 1)
        for c in range(states.shape[1]):
            x[c * LANES + lane] = states[path, c]
        for c in range(parameters.shape[0]):
            p[c * LANES + lane] = parameters[c, path]
    return own


@routine
def kick(
    begun: int, step: int, noisy: Index, steps: Array, amplitudes: Array, normals: Array,
    moving: Index, x: Array,
) -> None:  # fmt: skip
    """Add the noise of a step."""
    for lane in range(LANES):
        if moving[lane]:
            root = math.sqrt(abs(steps[begun + lane]))
            for i in range(noisy.size):
                sized = amplitudes[begun + lane, i] * root
                x[noisy[i] * LANES + lane] += sized * normals[begun + lane, step, i]


@routine
def advance(
    address: int, begun: int, step: int, noisy: Index, begins: Array, steps: Array,
    amplitudes: Array, normals: Array, moving: Index, x: Array, p: Array, z: Array, work: Array,
) -> None:  # fmt: skip
    """Take a step of the lanes that move; z are the times at its end."""
    y, k, q = work[0], work[1], work[2]
    for lane in range(LANES):
        path = begun + lane if moving[lane] else begun
        z[lane] = begins[path] + step * steps[path]
    evaluate(address, x, p, z, k)
    for m in range(x.size):
        lane = m % LANES
        y[m] = x[m] + (steps[begun + lane] * k[m] if moving[lane] else 0.0)
    kick(begun, step, noisy, steps, amplitudes, normals, moving, y)
    for lane in range(LANES):
        z[lane] += steps[begun + lane] if moving[lane] else 0.0
    evaluate(address, y, p, z, q)
    for m in range(x.size):
        lane = m % LANES
        if moving[lane]:
            x[m] += 0.5 * steps[begun + lane] * (k[m] + q[m])
    kick(begun, step, noisy, steps, amplitudes, normals, moving, x)


@kernel
def heun(
    address: int,
    noisy: Index,
    begins: Array,
    steps: Array,
    counts: Index,
    amplitudes: Array,
    parameters: Array,
    normals: Array,
    first: int,
    stop: int,
    states: Array,
) -> None:
    """Move paths by so many equal steps, in place.

    `begins`, `steps` and `counts` are the time at the start, the step and the number of steps of
    each path; `noisy` has the places of the states with noise, `amplitudes` of shape (paths, noisy)
    theirs, and `normals` of shape (paths, steps, noisy) the random numbers. `parameters` has shape
    (parameters, paths), `states` (paths, n).
    """
    size = states.shape[1] * LANES
    x, work = np.zeros(size), np.zeros((3, size))
    p, z = np.zeros(max(parameters.shape[0], 1) * LANES), np.zeros(3 * LANES)
    moving = np.zeros(LANES, np.int64)
    for begun in range(first, stop, LANES):
        own = min(enter(begun, states, parameters, x, p), stop - begun)
        last = 0
        for lane in range(own):
            last = max(last, counts[begun + lane])
        for step in range(last):
            for lane in range(LANES):
                moving[lane] = lane < own and step < counts[begun + min(lane, own - 1)]
            advance(
                address, begun, step, noisy, begins, steps, amplitudes, normals, moving, x, p, z,
                work,
            )  # fmt: skip
        for lane in range(own):
            for c in range(states.shape[1]):
                states[begun + lane, c] = x[c * LANES + lane]


@kernel
def heun_until(
    address: int,
    watch: int,
    noisy: Index,
    begins: Array,
    steps: Array,
    counts: Index,
    amplitudes: Array,
    parameters: Array,
    normals: Array,
    uniforms: Array,
    ends: Array,
    first: int,
    stop: int,
    states: Array,
    passed: Array,
) -> None:
    """The same until a function has left the sign that it has; `passed` becomes the time then.

    The code at `watch` gives the function, and the rate at which its square spreads by noise.
    Within a step the path is a Brownian bridge, for which there are `uniforms` of shape (paths,
    steps), and for the last step `ends` of shape (paths, 2): a normal and a uniform number.
    `passed` is infinite of paths that have not passed, NaN of those that have no value any more.
    """
    size = states.shape[1] * LANES
    x, work = np.zeros(size), np.zeros((3, size))
    p, z = np.zeros(max(parameters.shape[0], 1) * LANES), np.zeros(3 * LANES)
    found, before = np.zeros(2 * LANES), np.zeros(2 * LANES)
    moving = np.zeros(LANES, np.int64)
    for begun in range(first, stop, LANES):
        own = min(enter(begun, states, parameters, x, p), stop - begun)
        for lane in range(LANES):
            z[lane] = begins[begun + min(lane, own - 1)]
        evaluate(watch, x, p, z, before)
        step = 0
        while True:
            going = False
            for lane in range(LANES):
                path = begun + min(lane, own - 1)
                moves = lane < own and step < counts[path] and passed[path] == np.inf
                moving[lane] = moves
                going = going or moves
            if not going:
                break
            advance(
                address, begun, step, noisy, begins, steps, amplitudes, normals, moving, x, p, z,
                work,
            )  # fmt: skip
            evaluate(watch, x, p, z, found)
            for lane in range(own):
                if not moving[lane]:
                    continue
                path, a, b = begun + lane, before[lane], found[lane]
                h, rate = steps[path], 0.5 * (before[LANES + lane] + found[LANES + lane])
                if math.isnan(a) or math.isnan(b):
                    passed[path] = np.nan
                else:
                    part = passage(
                        a, b, rate, h, uniforms[path, step], ends[path, 0], ends[path, 1]
                    )
                    if part <= 1.0:
                        passed[path] = z[lane] - h + h * part
            for m in range(2 * LANES):
                before[m] = found[m]
            step += 1
        for lane in range(own):
            for c in range(states.shape[1]):
                states[begun + lane, c] = x[c * LANES + lane]
