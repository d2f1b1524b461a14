"""Bearing forces and rotators along equilibria, separatrices and orbits of the disk, arrays only.

`Loads` are the greatest value along a curve of the phase space, where it lies, mean and rms.
"""

from __future__ import annotations

import functools
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from phasekit.arrays import Array
from phasekit.errors import OrbitKind
from phasekit.loads import peaks as kernels
from phasekit.mechanics import disk_states
from phasekit.mechanics.bearings import BearingForces, bearing_forces
from phasekit.mechanics.disk_table import machine_table
from phasekit.mechanics.rotators import ROTATORS, rotators
from phasekit.numerics.launch import launch
from phasekit.phase.exact.flow import flow
from phasekit.phase.exact.orbits import Orbits, orbits

#: Parts of a period, and how often each is halved at most.
PARTS, HALVINGS = 64, 30
#: Agreement of a part with its halves, and of all of them, in units of the whole.
CLOSE, TRUSTED = 1e-11, 1e-8
NODE, SHARE = np.polynomial.legendre.leggauss(8)


def measured_at(
    table: Array, start: Array, of_rotators: bool, threads: int | None, t: Array
) -> tuple[Array, Array, Array]:
    """The two measures after times, and the states; axes (orbits, times)."""
    table = np.ascontiguousarray(table)
    a, b, c = table[[disk_states.A, disk_states.B, disk_states.C]][..., None]
    phi0, dphi0 = start[..., None]
    phi, dphi = flow(a, b, c, phi0, dphi0, t, threads=threads)
    index = np.repeat(np.arange(table.shape[1]), t.shape[1])
    out = np.empty((index.size, 2))
    flat = (table, index, np.ravel(phi), np.ravel(dphi), of_rotators)
    launch(kernels.at_states, flat, index.size, ((out,),), threads)
    return out.reshape(*t.shape, 2), phi, dphi


def halved(
    table: Array, start: Array, period: float, of_rotators: bool, threads: int | None
) -> tuple[Array, Array]:
    """Mean and rms over one orbit by parts of its period; NaN where halving them changes it."""
    at = functools.partial(measured_at, table[:, None], start[:, None], of_rotators, threads)

    def over(low: Array, high: Array) -> Array:
        middle, half = 0.5 * (low + high)[:, None], 0.5 * (high - low)[:, None]
        values = at((middle + half * NODE).reshape(1, -1))[0].reshape(low.size, -1, 2)
        both = np.stack([values, values * values], axis=-1)
        return np.asarray(np.einsum("pt,ptkm->pkm", half * SHARE, both))

    edges = np.linspace(0.0, period, PARTS + 1)
    low, high = edges[:-1], edges[1:]
    rough = over(low, high)
    scale = rough.sum(axis=0)
    total, off = np.zeros((2, 2)), np.zeros((2, 2))
    for left in reversed(range(HALVINGS)):
        middle = 0.5 * (low + high)
        halves = over(low, middle), over(middle, high)
        fine = halves[0] + halves[1]
        change = np.abs(fine - rough)
        done = (change <= CLOSE * scale).all(axis=(1, 2)) | (left == 0)
        total += fine[done].sum(axis=0)
        off += change[done].sum(axis=0)
        low, high = (
            np.concatenate(ends)[np.tile(~done, 2)] for ends in ((low, middle), (middle, high))
        )
        rough = np.concatenate(halves)[np.tile(~done, 2)]
        if not low.size:
            break
    total[~(off <= TRUSTED * total)] = np.nan
    return total[:, 0] / period, np.sqrt(total[:, 1] / period)


#: Work of a cell of the loops' kernel, compared with that of a state.
LOOP_WEIGHT = 400
#: Samples of an orbit: for each turn at its system's rate; as powers of two, at least and at most.
SAMPLES_PER_TURN, LEAST, MOST = 48, 7, 16
TOLERANCE = 1e-8  # of a mean; where half the samples give another, four times as many are taken,
ENOUGH = 13  # up to this power of two
CANDIDATES = 3  # highest samples that are refined to peaks
AT_A_TIME = 1 << 20  # samples, so that memory stays bounded
GOLDEN = 0.5 * (5.0**0.5 - 1.0)
SQUEEZES = 38  # of the bracket of a peak, each by the golden ratio


class Loads(NamedTuple):
    """Greatest value along a curve, its angle and angular velocity, mean and rms."""

    peak: Array
    mean: Array
    rms: Array
    peak_phi: Array
    peak_dphi: Array


def equilibrium_forces(*disk_and_phi: npt.ArrayLike) -> tuple[Array, ...]:
    """Bearing forces at equilibria, whose axis is the last of ``phi`` and first of the results'.

    Takes the parameters of `bearing_forces`, then phi; returns the fields up to deviation_couple.
    """
    *disk, phi = (np.asarray(value, dtype=float) for value in disk_and_phi)
    rest = np.where(np.isnan(phi), np.nan, 0.0)
    states: list[Any] = [*(value[..., None] for value in disk), phi, rest, rest]
    found = bearing_forces(*states)
    return found[: BearingForces._fields.index("deviation_couple") + 1]


def equilibrium_rotators(*disk_and_phi: npt.ArrayLike) -> tuple[Array, Array]:
    """Rotators and their intensities at equilibria: those of the support's rotation alone."""
    *disk, phi = (np.asarray(value, dtype=float) for value in disk_and_phi)
    rest = np.where(np.isnan(phi), np.nan, 0.0)
    states: list[Any] = [*(value[..., None] for value in disk), phi, rest, rest]
    found = rotators(*states)
    return found.rotator, found.rotator_intensity


def separatrix_forces(
    beta: npt.ArrayLike,
    e: npt.ArrayLike,
    a: npt.ArrayLike,
    r: npt.ArrayLike,
    omega1: npt.ArrayLike,
    m: npt.ArrayLike,
    g: npt.ArrayLike,
    half_span: npt.ArrayLike,
    saddle_phi: npt.ArrayLike,
    saddle_exponent: npt.ArrayLike,
    turning_offset: npt.ArrayLike,
    loop: npt.ArrayLike,
    *,
    threads: int | None = None,
) -> Loads:
    """Bearing forces over the loops of separatrices, axes (..., 2 saddles, 2 sides, 2 bearings).

    Mean and rms are over the angle: over time both are the saddle's, where the motion rests for
    ever. A lobe counts there and back, as does an arc between two saddles; of a winding
    separatrix the side is the direction. Mean and rms are NaN where their quadrature does not
    converge.

    The highest of 137 samples of an arc are refined. Two maxima of almost the same height within a
    tenth of a radian may be taken for one: in 10^4 random disks the peak was then too low by up to
    10^-5.

    >>> from phasekit.phase.exact.phase_space import separatrices
    >>> from phasekit.mechanics.disk import disk_coefficients
    >>> disk = (0.7, 0.05, 0.024, 0.2, 31.4)
    >>> loops = separatrices(*disk_coefficients(*disk))
    >>> where = loops.saddle_phi, loops.saddle_exponent, loops.turning_offset, loops.loop
    >>> separatrix_forces(*disk, 2.0, 9.81, 0.2, *where).peak[0].round(1).tolist()
    [[150.0, 69.3], [146.3, 52.5]]
    """
    body = machine_table(beta, e, a, r, omega1, g, m, half_span)
    return _over_loops(body, (saddle_phi, saddle_exponent, turning_offset, loop), False, threads)


def separatrix_rotators(
    beta: npt.ArrayLike,
    e: npt.ArrayLike,
    a: npt.ArrayLike,
    r: npt.ArrayLike,
    omega1: npt.ArrayLike,
    g: npt.ArrayLike,
    saddle_phi: npt.ArrayLike,
    saddle_exponent: npt.ArrayLike,
    turning_offset: npt.ArrayLike,
    loop: npt.ArrayLike,
    *,
    threads: int | None = None,
) -> Loads:
    """Intensities of the rotators over loops, axes (..., 2 saddles, 2 sides, 8 rotators).

    As `separatrix_forces`; those of the support's rotation are constant, and have no place of
    their peak.
    """
    body = machine_table(beta, e, a, r, omega1, g)
    two = _over_loops(body, (saddle_phi, saddle_exponent, turning_offset, loop), True, threads)
    return _all_rotators(two, _each(*body, two.peak.shape[:-3])[..., None, None])


def _over_loops(
    body: tuple[Array, tuple[int, ...]],
    loops: tuple[npt.ArrayLike, npt.ArrayLike, npt.ArrayLike, npt.ArrayLike],
    of_rotators: bool,
    threads: int | None,
) -> Loads:
    table, own = body
    saddle_phi, exponent, turning_offset, loop = (np.asarray(value) for value in loops)
    shape = np.broadcast_shapes(own, loop.shape[:-1])
    index = np.array(np.broadcast_to(np.arange(table.shape[1]).reshape(own), shape)).reshape(-1)
    arrays = (
        table,
        index,
        np.array(np.broadcast_to(saddle_phi, (*shape, 2))).reshape(-1, 2),
        np.array(np.broadcast_to(exponent, (*shape, 2))).reshape(-1, 2),
        np.array(np.broadcast_to(turning_offset, (*shape, 2, 2))).reshape(-1, 2, 2),
        np.array(np.broadcast_to(loop, (*shape, 2)), dtype=np.int8).reshape(-1, 2),
        kernels.DISTANCE,
        kernels.WEIGHTS,
        of_rotators,
    )
    out = tuple(np.empty((index.size, 2, 2, 2)) for _ in Loads._fields)
    launch(kernels.separatrices, arrays, index.size, (out,), threads, LOOP_WEIGHT)
    return Loads(*(array.reshape(*shape, 2, 2, 2) for array in out))


def orbit_forces(
    beta: npt.ArrayLike,
    e: npt.ArrayLike,
    a: npt.ArrayLike,
    r: npt.ArrayLike,
    omega1: npt.ArrayLike,
    m: npt.ArrayLike,
    g: npt.ArrayLike,
    half_span: npt.ArrayLike,
    phi0: npt.ArrayLike,
    dphi0: npt.ArrayLike,
    *,
    threads: int | None = None,
) -> Loads:
    """Bearing forces over one round of the orbits through states, axes (..., 2 bearings).

    Mean and rms are over time; NaN where their quadrature does not converge. On a separatrix,
    where a round takes for ever, all are NaN.

    >>> disk = (0.7, 0.05, 0.024, 0.2, 31.4, 2.0, 9.81, 0.2)
    >>> over = orbit_forces(*disk, 0.5, 1.0)
    >>> bool((over.peak > over.rms).all() and (over.rms > over.mean).all())
    True
    """
    body = machine_table(beta, e, a, r, omega1, g, m, half_span)
    return _over_orbits(body, phi0, dphi0, False, threads)


def orbit_rotators(
    beta: npt.ArrayLike,
    e: npt.ArrayLike,
    a: npt.ArrayLike,
    r: npt.ArrayLike,
    omega1: npt.ArrayLike,
    g: npt.ArrayLike,
    phi0: npt.ArrayLike,
    dphi0: npt.ArrayLike,
    *,
    threads: int | None = None,
) -> Loads:
    """Intensities of the rotators over orbits, axes (..., 8 rotators); as `orbit_forces`."""
    body = machine_table(beta, e, a, r, omega1, g)
    two = _over_orbits(body, phi0, dphi0, True, threads)
    return _all_rotators(two, _each(*body, two.peak.shape[:-1]))


def _over_orbits(
    body: tuple[Array, tuple[int, ...]],
    phi0: npt.ArrayLike,
    dphi0: npt.ArrayLike,
    of_rotators: bool,
    threads: int | None,
) -> Loads:
    table, own = body
    shape = np.broadcast_shapes(own, np.shape(phi0), np.shape(dphi0))
    columns = _each(table, own, shape).reshape(disk_states.SIZE, -1)
    abc = columns[[disk_states.A, disk_states.B, disk_states.C]]
    start = np.array([np.broadcast_to(x, shape).reshape(-1) for x in (phi0, dphi0)], dtype=float)
    orbit = orbits(*abc, *start, threads=threads)
    out = Loads(*np.full((5, columns.shape[1], 2), np.nan))
    resting = orbit.orbit_kind == OrbitKind.EQUILIBRIUM
    period = np.where(resting, 0.0, orbit.period)
    waiting = np.flatnonzero(np.isfinite(period) & (orbit.orbit_kind >= 0))
    turns = period[waiting] * np.sqrt(np.abs(abc[:, waiting]).max(axis=0)) / (2.0 * np.pi)
    least = np.log2(np.maximum(SAMPLES_PER_TURN * turns, 1.0))
    power = np.clip(np.ceil(least), LEAST, MOST).astype(int)
    while waiting.size:
        one = power.min()
        here = np.flatnonzero(power == one)[: max(1, AT_A_TIME >> one)]
        cells = waiting[here]
        loads, settled = _sampled(
            columns[:, cells], start[:, cells], period[cells], 1 << one, of_rotators, threads
        )
        for array, values in zip(out, loads, strict=True):
            array[cells] = values
        power[here] += 2
        for cell in cells[~settled & (power[here] > ENOUGH)]:
            means = halved(columns[:, cell], start[:, cell], period[cell], of_rotators, threads)
            out.mean[cell], out.rms[cell] = means
        done = here[settled | (power[here] > ENOUGH)]
        waiting, power = np.delete(waiting, done), np.delete(power, done)
    if of_rotators:
        out.mean[:, 1], out.rms[:, 1] = _coupling(columns[disk_states.OMEGA], orbit, period)
    return Loads(*(array.reshape(*shape, 2) for array in out))


def _sampled(
    table: Array, start: Array, period: Array, count: int, of_rotators: bool, threads: int | None
) -> tuple[Loads, npt.NDArray[np.bool_]]:
    """Loads over orbits by samples even in time, and whether they are as many as it takes.

    The mean of a smooth periodic function converges exponentially; that of a force that almost
    vanishes somewhere is less smooth.
    """
    measured = functools.partial(measured_at, table, start, of_rotators, threads)
    step = period[:, None] / count
    values = measured(step * np.arange(count))[0]
    mean = values.mean(axis=1)
    # Of rotators, the mean of the second, |phi'| but for a factor, has a closed form.
    with np.errstate(invalid="ignore"):  # of infinite forces
        change = np.abs(values[:, ::2].mean(axis=1) - mean)[:, : 1 if of_rotators else 2]
    settled = (change <= TOLERANCE * mean[:, : change.shape[1]]).all(axis=1)
    settled |= ~np.isfinite(mean).all(axis=1)  # nor would more samples be
    top = _highest(values)  # (orbits, measures, candidates)
    measure = np.repeat(np.arange(2), CANDIDATES)

    def of_each(t: Array) -> Array:
        return measured(t)[0][:, np.arange(measure.size), measure]

    middle = top.reshape(top.shape[0], -1)
    left, right = step * (middle - 1.0), step * (middle + 1.0)
    low, high = right - GOLDEN * (right - left), left + GOLDEN * (right - left)
    at_low, at_high = of_each(low), of_each(high)
    for _ in range(SQUEEZES):
        keep_left = at_low > at_high
        left, right = np.where(keep_left, left, low), np.where(keep_left, high, right)
        new = np.where(keep_left, right - GOLDEN * (right - left), left + GOLDEN * (right - left))
        at_new = of_each(new)
        low, high = np.where(keep_left, new, high), np.where(keep_left, low, new)
        at_low, at_high = np.where(keep_left, at_new, at_high), np.where(keep_left, at_low, at_new)
    best = np.where(at_low > at_high, low, high)
    refined = np.maximum(at_low, at_high).reshape(top.shape)
    winner = refined.argmax(axis=2)[..., None]
    t = np.take_along_axis(best.reshape(top.shape), winner, axis=2)[..., 0]
    # Where the bracket holds two maxima, the sample may be higher than what was refined.
    lower = np.take_along_axis(refined, winner, axis=2)[..., 0] < values.max(axis=1)
    t = np.where(lower, step * values.argmax(axis=1), t)
    highest, phi, dphi = measured(t)
    peak = np.stack([highest[:, j, j] for j in range(2)], axis=-1)
    phi = phi - 2.0 * np.pi * np.ceil((phi - np.pi) / (2.0 * np.pi))
    rms = np.sqrt((values * values).mean(axis=1))
    return Loads(peak, mean, rms, phi, dphi), settled


def _highest(values: Array) -> npt.NDArray[np.intp]:
    """Places of the highest local maxima of periodic samples, (orbits, measures, candidates)."""
    local = (values >= np.roll(values, 1, axis=1)) & (values >= np.roll(values, -1, axis=1))
    ranked = np.where(local, -values, np.inf)
    return np.swapaxes(np.argsort(ranked, axis=1)[:, :CANDIDATES], 1, 2)


def _coupling(omega1: Array, orbit: Orbits, period: Array) -> tuple[Array, Array]:
    """Mean and rms of |R012| over orbits: of 2 |omega1 phi'|, by way and action."""
    turning = orbit.orbit_kind == OrbitKind.ROTATION
    way = np.where(turning, 2.0 * np.pi, 2.0 * (orbit.phi_max - orbit.phi_min))
    with np.errstate(all="ignore"):
        mean, square = way / period, 2.0 * np.pi * orbit.action / period
    resting = orbit.orbit_kind == OrbitKind.EQUILIBRIUM
    mean, square = (np.where(resting, 0.0, x) for x in (mean, square))
    known = np.isfinite(period)
    factor = np.where(known, 2.0 * np.abs(omega1), np.nan)
    return factor * mean, factor * np.sqrt(square)


def _each(table: Array, own: tuple[int, ...], shape: tuple[int, ...]) -> Array:
    """The table with a column for each cell of a shape."""
    return np.broadcast_to(
        table.reshape(-1, *(1,) * (len(shape) - len(own)), *own), (table.shape[0], *shape)
    )


def _all_rotators(two: Loads, columns: Array) -> Loads:
    """Loads of all rotators from those of R022 and R012.

    The others have the one or the other's intensity, or the constant omega1^2; they are undefined
    where their base vector is zero.
    """
    constant = columns[disk_states.OMEGA] ** 2 + 0.0 * two.peak[..., 0]
    exists = {
        "R01": columns[disk_states.ARM] != 0.0,
        "R011": (columns[disk_states.ACROSS] != 0.0) | (columns[disk_states.ALONG] != 0.0),
        "R022": columns[disk_states.ACROSS] != 0.0,
        "R012": columns[disk_states.ACROSS] != 0.0,
        "R1": (columns[disk_states.JVN] != 0.0)
        | (columns[disk_states.JU] != columns[disk_states.JV]),
        "R2": columns[disk_states.JVN] != 0.0,
    }
    out = []
    for field, array in zip(Loads._fields, two, strict=True):
        fixed = constant if field in ("peak", "mean", "rms") else np.full_like(constant, np.nan)
        own = {"R022": array[..., 0], "R2": array[..., 0]}
        own |= {name: array[..., 1] for name in ("R012", "R12", "R12c")}
        full = [np.where(exists.get(n, True), own.get(n, fixed), np.nan) for n in ROTATORS]
        out.append(np.stack(full, axis=-1))
    return Loads(*out)
