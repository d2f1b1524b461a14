"""Motion in time: states after any time, and motion on separatrices.

Bounded orbits are integrated over half a period at most. On a separatrix a variable w takes the
place of the coordinate in which the motion is slow at no end: with u the distance from the saddle
and L that of the turning point, u = L sech(w)^2; between two saddles u = L/(1 + exp(-w)). Then
w' is smooth, tends to a constant, and errors do not grow as the saddle is approached.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from phasekit.arrays import Array, Ints
from phasekit.errors import EquilibriumKind, OrbitKind
from phasekit.phase.numerical.collocation import follow
from phasekit.phase.numerical.differences import Ground
from phasekit.phase.numerical.formula_bounds import bend_noise, noise, smooth
from phasekit.phase.numerical.orbits import Orbits, States, orbits_of, resting_ends, states_of
from phasekit.phase.numerical.quadrature import speeds
from phasekit.phase.numerical.separatrices import Branch, branch_of
from phasekit.phase.numerical.spread import spreading, widths
from phasekit.phase.numerical.systems import Systems

_EPS = float(np.finfo(float).eps)


class MotionWithErrors(NamedTuple):
    """States along a motion, as of `phasekit.phase.exact.flow`, with estimates of their errors.

    Errors are infinite where a bounded motion took too many steps, NaN where there is no state.
    """

    motion_phi: Array
    motion_dphi: Array
    motion_phi_error: Array
    motion_dphi_error: Array


def flow(ground: Ground, x: Array, v: Array, owner: Ints, time: Array) -> MotionWithErrors:
    """States after times.

    Ground has one row for each start; each time, of shape (times,), counts from its owner.
    """
    states = states_of(ground, x, v)
    orbit = orbits_of(ground, states, v)
    kind, period = orbit.orbit_kind[owner], orbit.period[owner]
    turning = np.isfinite(period) & (period > 0.0) & (kind != OrbitKind.EQUILIBRIUM)
    with np.errstate(all="ignore"):
        rounds = np.where(turning, np.round(time / period), 0.0)
    rest = np.where(turning, time - rounds * np.where(turning, period, 0.0), time)
    out_x, out_v = states.x[owner], v[owner].astype(float)
    out_x[kind == OrbitKind.NOT_COMPUTED] = np.nan
    out_v[kind == OrbitKind.NOT_COMPUTED] = np.nan
    factor = np.zeros((time.size, 3))
    rows = np.flatnonzero((kind != OrbitKind.EQUILIBRIUM) & (kind != OrbitKind.NOT_COMPUTED))
    if rows.size:
        own = owner[rows]
        start = _start_factors(ground, states, v, orbit)[own]
        (out_x[rows], out_v[rows]), factor[rows] = _integrated(
            ground.systems.take(own), states.x[own], v[own], own, rest[rows], period[rows], start
        )
    asymptotic = np.flatnonzero(kind == OrbitKind.ASYMPTOTIC)
    if asymptotic.size:
        cells = owner[asymptotic], time[asymptotic]
        found_x, found_v, known = _asymptotic(ground, states.x, v, *cells)
        asymptotic = asymptotic[known]
        out_x[asymptotic], out_v[asymptotic] = found_x[known], found_v[known]
    out_x, out_v = (np.where(np.isfinite(time), out, np.nan) for out in (out_x, out_v))
    round_error = orbit.period_error[owner] + 2.0 * _EPS * np.where(turning, period, 0.0)
    late = np.abs(rounds) * np.where(turning, round_error, 0.0) + 2.0 * _EPS * np.abs(rest)
    most = _most(states, orbit, owner)
    errors = _errors(ground.systems.take(owner), out_x, out_v, late, widths(factor), most)
    lost = np.isnan(out_x) & np.isfinite(time) & (kind != OrbitKind.NOT_COMPUTED)
    lost &= kind != OrbitKind.UNBOUNDED
    phi_error, dphi_error = (np.where(lost, np.inf, error) for error in errors)
    turn = ground.systems.formula.period or 0.0
    rotating = kind == OrbitKind.ROTATION
    shift = states.turns[owner] + np.where(rotating, rounds * turn * np.sign(v[owner]), 0.0)
    return MotionWithErrors(out_x + shift, out_v, phi_error + _EPS * np.abs(shift), dphi_error)


def _integrated(
    systems: Systems, x: Array, v: Array, owner: Ints, time: Array, period: Array, factor: Array
) -> tuple[tuple[Array, Array], Array]:
    """States after times, and factors of the covariances of what rounding does to them."""

    def rate(few: Ints, y: Array) -> Array:
        return np.stack([y[..., 1], -systems.take(few).slope(y[..., 0])], axis=-1)

    def trusted(few: Ints, stages: Array) -> npt.NDArray[np.bool_]:
        x = stages[..., 0]
        size = np.max(np.abs(systems.take(few).slope(x)), axis=1)
        return smooth(systems, few, np.min(x, axis=1), np.max(x, axis=1), size)

    regular = np.isfinite(period) & (period > 0.0)
    pace = np.sqrt(np.abs(systems.bend(x))) + 1.0 / np.where(regular, period, 1e3)
    start = np.stack([x, v], axis=-1)
    carry = spreading(systems)
    with np.errstate(all="ignore"):
        end, factor = follow(rate, start, owner, time, 0.5 / pace, trusted, carry, factor)
    return (end[:, 0], end[:, 1]), factor


def _start_factors(ground: Ground, states: States, v: Array, orbit: Orbits) -> Array:
    """How far starts may be off: by wrapping, and where a motion stands for those next to it."""
    x, points = states.x, ground.points
    off = np.where(states.turns == 0.0, 0.0, _EPS * np.abs(x))
    saddle = points.kind != EquilibriumKind.CENTER
    near = np.where(saddle, np.abs(states.excess) + states.blur + states.error, np.inf)
    with np.errstate(all="ignore"):
        energy = np.fmin.reduce(near, axis=1, initial=np.inf)
        energy = np.where(orbit.orbit_kind == OrbitKind.ASYMPTOTIC, energy, 0.0)
        slope = np.abs(ground.systems.slope(x))
        beat = np.sqrt(np.abs(ground.systems.bend(x)))
        fast = np.abs(v) * beat > slope
        place = np.where(fast | (energy == 0.0), 0.0, energy / slope)
        speed = np.where(fast & (energy > 0.0), energy / np.abs(v), 0.0)
    return np.stack([np.hypot(off, place), np.zeros(x.shape), speed], axis=-1)


def _most(states: States, orbit: Orbits, owner: Ints) -> tuple[Array, Array]:
    """By how much states on an orbit differ at most in coordinate, NaN if unbounded, and speed."""
    speed = np.sqrt(2.0 * np.fmax.reduce(states.excess, axis=1, initial=0.0))
    speed = np.where(orbit.orbit_kind == OrbitKind.UNBOUNDED, np.nan, speed)
    libration = orbit.orbit_kind == OrbitKind.LIBRATION
    return np.where(libration, 2.0 * orbit.amplitude, np.nan)[owner], 2.0 * speed[owner]


def _errors(
    systems: Systems,
    x: Array,
    v: Array,
    late: Array,
    spread: tuple[Array, Array],
    most: tuple[Array, Array],
) -> tuple[Array, Array]:
    """Estimated errors of states that are late by so much, with what rounding does to them."""
    with np.errstate(all="ignore"):
        speed, slope = np.abs(v), np.abs(systems.slope(x))
        beat = np.sqrt(np.abs(systems.bend(x)))
        turn = beat * late
        sinh = np.where(turn > 0.0, np.sinh(turn) / turn, 1.0)
        phi = late * (speed * sinh + 0.5 * slope * late * np.cosh(turn))
        dphi = late * (slope * sinh + beat * beat * speed * late * np.cosh(turn))
        phi = np.fmin(phi, 0.5 * late * most[1])
        phi, dphi = phi + spread[0] + 2.0 * _EPS * np.abs(x), dphi + spread[1] + 4.0 * _EPS * speed
    phi, dphi = np.fmin(phi, most[0]), np.fmin(dphi, most[1])
    return np.where(np.isnan(x), np.nan, phi), np.where(np.isnan(x), np.nan, dphi)


def separatrix_motion(branch: Branch, owner: Ints, time: Array) -> MotionWithErrors:
    """Motion along branches of separatrices.

    Time 0 is at the turning point of a lobe, and half-way to the partner saddle, or to the same
    saddle a turn later. NaN for branches that end nowhere.
    """
    x, v = _along(branch, owner, np.zeros(time.shape), time)
    part, beat, end = (of_branch[owner] for of_branch in _branch_errors(branch))
    late, off = (np.abs(time) + 1.0 / beat) * (part + 2.0 * _EPS), branch.place_error[owner]
    with np.errstate(invalid="ignore"):
        end = end * np.abs(x - branch.saddle[owner]) / branch.length[owner]
    off, nothing = off + end, np.full(time.shape, np.nan)
    systems = branch.ground.systems.take(owner)
    spread = off, off * beat + 8.0 * _EPS * np.abs(v)
    errors = _errors(systems, x, v, late, spread, (nothing, nothing))
    lost = np.isnan(x) & np.isfinite(time) & np.isfinite(branch.length[owner])
    return MotionWithErrors(x, v, *(np.where(lost, np.inf, error) for error in errors))


def _branch_errors(branch: Branch) -> tuple[Array, Array, Array]:
    """Errors of paces along branches as parts of them, paces next to saddles, errors of lengths."""
    systems, side = branch.ground.systems, branch.side
    with np.errstate(all="ignore"):
        bend = np.abs(systems.bend(branch.saddle))
        part = 0.5 * bend_noise(systems, branch.saddle, bend) / bend
        # Where Gauss' rule does not hold all along, V is taken from V.
        half = 0.5 * branch.length
        long = half > np.minimum(branch.near.anchor.near, branch.far.anchor.near)
        middle = branch.saddle + side * half
        depth = np.abs(systems.potential(middle) - systems.potential(branch.saddle))
        rough = sum(noise(systems, x, systems.potential(x)) for x in (branch.saddle, middle))
        part = part + np.where(long, rough / depth, 0.0)
        end = systems.slope(branch.saddle + side * branch.length)
        off = np.where(branch.joins, 0.0, part * depth / np.abs(end))
    return part, np.sqrt(bend), off


def _along(branch: Branch, owner: Ints, start: Array, time: Array) -> tuple[Array, Array]:
    """Motion along branches from the values `start` of w."""
    finite = np.isfinite(branch.length[owner]) & np.isfinite(time)
    x, v = np.full(time.shape, np.nan), np.full(time.shape, np.nan)
    rows = np.flatnonzero(finite)
    if not rows.size:
        return x, v
    own = owner[rows]

    def rate(few: Ints, y: Array) -> Array:
        return _pace(branch, own[few], y[..., 0])[..., None]

    exponent = branch.ground.systems.take(own).bend(branch.saddle[own])
    step = 0.25 / (np.sqrt(np.abs(exponent)) + 1e-3)

    def trusted(few: Ints, stages: Array) -> npt.NDArray[np.bool_]:
        near, _, _ = _distances(branch, own[few], stages[..., 0])
        x = branch.saddle[own[few], None] + branch.side * near
        systems = branch.ground.systems
        size = np.max(np.abs(systems.take(own[few]).slope(x)), axis=1)
        return smooth(systems, own[few], np.min(x, axis=1), np.max(x, axis=1), size)

    w = follow(rate, start[rows, None], own, time[rows], step, trusted)[0][:, 0]
    near, far, slope = _distances(branch, own, w[:, None])
    pace = _pace(branch, own, w[:, None])
    u, d = near[:, 0], far[:, 0]
    length = branch.length[own]
    end = branch.saddle[own] + branch.side * length
    x[rows] = np.where(u <= d, branch.saddle[own] + branch.side * u, end - branch.side * d)
    v[rows] = branch.side * (slope * pace)[:, 0]
    return x, v


def _distances(branch: Branch, own: Ints, w: Array) -> tuple[Array, Array, Array]:
    """Distances from the saddle and from the far end at w, and du/dw."""
    length = branch.length[own, None]
    with np.errstate(over="ignore"):
        half = np.exp(-np.abs(w))
        square = half * half
        # lobe: u = L sech(w)^2; else: u = L/(1 + exp(-w))
        sech = 4.0 * square / (1.0 + square) ** 2
        tanh = (1.0 - square) / (1.0 + square)
        small, large = half / (1.0 + half), 1.0 / (1.0 + half)
    joins = branch.joins[own, None]
    near = length * np.where(joins, np.where(w < 0.0, small, large), sech)
    far = length * np.where(joins, np.where(w < 0.0, large, small), tanh * tanh)
    slope = np.where(joins, length * small * large, -2.0 * length * sech * np.sign(w) * tanh)
    return near, far, slope


def _pace(branch: Branch, own: Ints, w: Array) -> Array:
    """Rate of w: speed/(du/dw), which is smooth through the ends."""
    # Beyond this the distances are lost beside the ends, and w' is constant to rounding.
    held = np.clip(w, -300.0, 300.0)
    # The turning point itself has neither speed nor slope.
    held = np.where((held == 0.0) & ~branch.joins[own, None], 1e-8, held)
    near, far, slope = _distances(branch, own, held)
    result = np.empty(w.shape)
    low = near <= far
    for end, distance, sign, part in (
        (branch.near, near, branch.side, low),
        (branch.far, far, -branch.side, ~low),
    ):
        rows, columns = np.nonzero(part)
        few = end.take(own[rows])
        d = sign * distance[rows, columns][:, None]
        result[rows, columns] = speeds(few.anchor, few.u, few.excess, d)[:, 0]
    return result / np.abs(slope)


def _asymptotic(
    ground: Ground, x: Array, v: Array, owner: Ints, time: Array
) -> tuple[Array, Array, npt.NDArray[np.bool_]]:
    """Motion from states on separatrices; which of them lie on one that ends somewhere."""
    starts, inverse = np.unique(owner, return_inverse=True)
    few = ground.take(starts)
    ends = resting_ends(few, states_of(few, x[starts], v[starts]))
    out = np.full((2, time.size), np.nan)
    known = np.zeros(time.size, dtype=bool)
    done = np.zeros(starts.size, dtype=bool)
    for side, (column, distance) in zip((1.0, -1.0), ends, strict=True):
        # A saddle behind, as seen from this side: the branch leaves it towards the state.
        rows = np.flatnonzero((column >= 0) & ~done)
        if not rows.size:
            continue
        branch = branch_of(few.take(rows), column[rows], side)
        u, length = distance[rows], branch.length
        good = np.isfinite(length) & (u > 0.0) & (u < length * (1.0 + 1e-9))
        with np.errstate(all="ignore"):
            d = np.maximum(length - u, 0.0)
            lobe = np.arctanh(np.sqrt(d / length)) * np.sign(-side * v[starts[rows]])
            w = np.where(branch.joins, np.log(u / d), lobe)
        good &= np.isfinite(w)
        done[rows[good]] = True
        place = np.full(starts.size, -1)
        place[rows[good]] = np.flatnonzero(good)
        cells = np.flatnonzero(place[inverse] >= 0)
        own = place[inverse[cells]]
        # Between saddles w grows away from the one behind; the state may move back to it.
        forward = np.where(branch.joins, np.sign(side * v[starts[rows]]), 1.0)[own]
        moved, speed = _along(branch, own, w[own], forward * time[cells])
        start = branch.saddle[own] + side * u[own]
        out[0, cells] = moved + (x[owner[cells]] - start)
        out[1, cells] = forward * speed
        known[cells] = True
    rest = ~known
    out[0, rest], out[1, rest] = x[owner[rest]], v[owner[rest]]
    return out[0], out[1], known
