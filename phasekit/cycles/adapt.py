"""How many mesh intervals an orbit needs, and where they should lie."""

from __future__ import annotations

import numpy as np

from phasekit.arrays import Array
from phasekit.cycles import along, collocation
from phasekit.cycles.cycles import MOST, Cycles, Orbit
from phasekit.cycles.sparse import Slopes

SPARE = 0.3  # part of the mesh tolerance that a new mesh aims at
LEAST = 8
FLAT, STILL = 1e-3, 60  # amplitude beside the scale of what is at rest, and its intervals
FAINT = 1e4  # mesh tolerances of its amplitude at which a state has passages of its own
LOOSE, REACH = 0.8, 0.5  # rate times length of an interval there, at most, and that aimed at
OWN = 0.1  # part of f, beside what is linear in that state, at most
LOST = 2.4  # the same, from which on an orbit was left without them


def count_for(cycles: Cycles, orbit: Orbit) -> int:
    """Number of intervals with which the mesh error is a part of its tolerance."""
    m = cycles.m
    sizes = collocation.highest(orbit.mesh, orbit.x, m, cycles.amplitudes(orbit), cycles.closure)
    whole = 1.2 * float(np.sum(sizes ** (1.0 / (m + 1)) * np.diff(orbit.mesh)))
    aim = SPARE * cycles.options.mesh_tolerance / collocation.factor(m)
    if cycles.forced and np.all(cycles.amplitudes(orbit) < FLAT * cycles.scale):
        return max(LEAST, STILL)  # the multipliers of a state at rest still have a mesh to resolve
    count = whole / aim ** (1.0 / (m + 1))
    return max(LEAST, 4 * int(np.ceil(min(count, 1e6) / 4.0)))


def fitted(cycles: Cycles, orbit: Orbit) -> Array:
    """A mesh over which the error is even, with as many intervals as the orbit needs."""
    fixed = cycles.options.intervals
    count = orbit.intervals if fixed is None else fixed
    if fixed is None:
        wanted = min(count_for(cycles, orbit), cycles.options.max_intervals)
        if wanted > count or wanted < 0.75 * count:
            count = wanted
    mesh = collocation.even(
        orbit.mesh, orbit.x, cycles.m, cycles.amplitudes(orbit), count, cycles.closure
    )
    if fixed is None and (not cycles.closes or passages(cycles, orbit, LOST) is None):
        finer = passages(cycles, cycles.on(mesh, orbit)[0], LOOSE, REACH)
        if finer is not None:  # else from one that loses them Newton's method does not come back
            return finer if len(finer) - 1 <= cycles.options.max_intervals else orbit.mesh
    return mesh


def passages(
    cycles: Cycles, orbit: Orbit, reach: float, aim: float = REACH, most: int | None = None
) -> Array | None:
    """A mesh that resolves how what is small decays and grows again; None if the orbit's does.

    Where a state is next to nothing beside its amplitude the mesh error sees nothing of it. Yet
    where f vanishes with it, by how much it decays may decide how long the orbit takes. Intervals
    over which rate times length exceeds ``reach`` are divided until it is at most ``aim``, or into
    ``most`` parts; the mesh has about `MOST` intervals at the most.
    """
    rate = _fading(cycles, orbit) if cycles.closes else _resting(cycles, orbit)
    if rate is None or not np.any(rate > reach):
        return None
    counts = np.ceil(np.minimum(rate / aim, MOST))
    if most is None and np.sum(counts) > MOST:  # as fine as so many intervals resolve them
        most = max(1, MOST // int(np.count_nonzero(counts > 1.0)))
    if most is not None:
        counts = np.minimum(counts, most)
    counts = np.maximum(counts, 1.0).astype(np.int64)
    mesh = np.empty(int(np.sum(counts)) + 1)
    along.divided(orbit.mesh, counts, mesh)
    return mesh


def _fading(cycles: Cycles, orbit: Orbit) -> Array | None:
    """Rate times length of intervals over which a state is next to nothing; None if none is."""
    if cycles.own != cycles.n:
        return None
    m, n = cycles.m, cycles.n
    half = cycles.amplitudes(orbit)
    size = np.abs(orbit.x)
    largest = np.maximum(size[:-1].reshape(-1, m, n).max(axis=1), size[m::m])
    faint = largest < FAINT * cycles.options.mesh_tolerance * half
    faint &= half > FLAT * cycles.scale
    if not faint.any():
        return None
    found = cycles.slopes(orbit)
    if isinstance(found, Slopes):
        f, own = found.f, found.diagonals
        sizes = found.absolute(np.broadcast_to(cycles.scale, f.shape))
    else:
        f, slopes = found[:, :n], found[:, n:].reshape(len(found), n, -1)[..., :n]
        own = np.diagonal(slopes, axis1=1, axis2=2)
        sizes = np.abs(slopes * cycles.scale).sum(axis=2)
    # Where f does not vanish with it, rounding of its terms is larger than what it decays to.
    inside = collocation.at_gauss(orbit.x, m).reshape(orbit.intervals, m, n)
    linear = own.reshape(inside.shape) * inside
    rest = np.abs(f.reshape(inside.shape) - linear).sum(axis=1)
    faint &= rest <= OWN * np.abs(linear).sum(axis=1)
    sizes = (sizes / cycles.scale).reshape(inside.shape).max(axis=1)
    rate = np.where(faint, sizes, 0.0).max(axis=1)
    return np.asarray(rate * np.diff(orbit.mesh) * float(orbit.y[0]))


def _resting(cycles: Cycles, orbit: Orbit) -> Array:
    """Rate times length of intervals beside equilibria, so near that few digits say how near.

    How long an orbit takes from there follows from these, and whether it leaves at all: over long
    intervals what grows by a large factor would pass for anything.
    """
    m, n = cycles.m, cycles.n
    jets = cycles.jets(orbit.mesh, orbit.x, orbit.y, m, cycles.sizes)
    f = jets[:, :n] / cycles.scale
    slopes = jets[:, n:].reshape(len(f), n, -1)[..., :n] * cycles.scale / cycles.scale[:, None]
    speed = np.linalg.norm(f, axis=1)
    turning = np.linalg.norm(np.einsum("gij,gj->gi", slopes, f), axis=1)
    rate = np.divide(turning, speed, out=np.zeros(len(f)), where=speed > 0.0).reshape(-1, m)
    slow = speed < FAINT * cycles.options.mesh_tolerance * np.max(speed)
    rate *= slow.reshape(-1, m)
    return np.asarray(rate.max(axis=1) * np.diff(orbit.mesh) * float(orbit.y[0]))
