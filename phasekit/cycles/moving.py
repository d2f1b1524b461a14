"""Curves of connecting orbits, in a frame that moves with the fast parts of orbits.

As an eigenvalue at an end goes to zero, the orbit's pulse moves along the mesh by many times its
own width, while it hardly changes. So mesh points move with it, by a shift w with which
``dx + w x'`` is small where the orbit is fast, and which changes little along a fast part: it
minimises the integral of ``|dx + w x'|^2 + (STIFF size w')^2``. How far apart two orbits are is
measured across them, whatever they do along themselves.
"""

from __future__ import annotations

from functools import lru_cache
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from phasekit.arrays import Array
from phasekit.cycles import collocation
from phasekit.cycles.cycles import Orbit
from phasekit.numerics.later import later

if TYPE_CHECKING:
    from scipy.linalg import lapack
else:
    lapack = later("scipy.linalg.lapack")

STIFF = 0.3  # length, beside the orbit's size, over which all of it moves by the same time
THIN = 0.2  # part of its length to which an interval may shrink in a step


class Tangent(NamedTuple):
    """A direction in the frame that moves."""

    shift: Array  # by which mesh points move
    dx: Array  # by which values at the places that move with them change
    across: Array  # the part of that across the orbit
    dy: Array


@lru_cache(maxsize=4)  # of the last orbits, which are asked for again
def _speed(cycles: Any, orbit: Orbit) -> tuple[Array, Array]:
    """Derivatives by s at all places, on scaled axes, and the squares of their sizes."""
    free = np.broadcast_to(orbit.y[1:], (len(orbit.x), len(orbit.y) - 1))
    f = cycles.jets.values(np.concatenate([orbit.x, free], axis=1))
    found = f * (orbit.y[0] / cycles.scale)
    return found, np.einsum("ki,ki->k", found, found)


def _parts(cycles: Any, orbit: Orbit, dx: Array) -> tuple[Array, Array]:
    """The part of a direction across the orbit, and by how much time the other one moves it."""
    speed, square = _speed(cycles, orbit)
    along = np.einsum("ki,ki->k", speed, dx / cycles.scale)
    along = np.divide(along, square, out=np.zeros_like(along), where=square > 0.0)
    return dx - along[:, None] * speed * cycles.scale, along


def tangent(cycles: Any, orbit: Orbit, dx: Array, dy: Array) -> Tangent:
    """A direction that is given at fixed times."""
    mesh, m = orbit.mesh, cycles.m
    (speed, square), (across, along) = _speed(cycles, orbit), _parts(cycles, orbit, dx)
    h, inner = np.diff(mesh), slice(m, -m, m)
    size = (orbit.x.max(axis=0) - orbit.x.min(axis=0)) / cycles.scale
    stiff = float(size @ size) * STIFF**2 / h
    fast = 0.5 * (h[1:] + h[:-1]) * square[inner]
    *_, inside, _ = lapack.dptsv(
        fast + stiff[1:] + stiff[:-1], -stiff[1:-1], -fast * along[inner]
    )  # fmt: skip
    shift = np.concatenate([[0.0], inside, [0.0]])
    moved = np.interp(collocation.times(mesh, m), mesh, shift)[:, None] * speed * cycles.scale
    return Tangent(shift, dx + moved, across, dy)


def length(cycles: Any, orbit: Orbit, dx: Array, dy: Array) -> float:
    """Length of a direction, without what only moves in time."""
    return float(cycles.length(orbit.mesh, _parts(cycles, orbit, dx)[0], dy))


def cosine(cycles: Any, found: Any, across: Array, dy: Array) -> float:
    """That of the turn from a direction, given across an orbit on the same mesh, to a tangent."""
    mesh, now = found.orbit.mesh, _parts(cycles, found.orbit, found.dx)[0]
    part = cycles.inner(mesh, now, across, found.dy, dy)
    sizes = cycles.length(mesh, now, found.dy) * cycles.length(mesh, across, dy)
    return float(part / sizes)


def ahead(cycles: Any, state: Any, step: float) -> tuple[Orbit, Array]:
    """Where the curve is expected a step along the tangent, and the normal of its plane there.

    On the cubic through the last two points, as families of cycles are.
    """
    orbit = state.orbit
    here = tangent(cycles, orbit, state.dx, state.dy)
    if state.behind is None:
        mesh = orbit.mesh + step * here.shift
        return Orbit(mesh, orbit.x + step * here.dx, orbit.y + step * here.dy), here.across
    one = state.behind[0]
    last = _unit(cycles, one, tangent(cycles, *state.behind))
    gap = _distance(cycles, one.y, last.dy, orbit.y, here.dy)
    # Not by what the mesh has moved before, whose errors would grow.
    mesh = _met(orbit.mesh, here.shift, one.mesh, last.shift, -gap)
    one, last = _on(cycles, mesh, one, last)
    off, off_y = one.x - orbit.x, one.y - orbit.y
    back = cycles.inner(orbit.mesh, off, here.across, off_y, here.dy)
    along = cycles.inner(orbit.mesh, last.dx, here.across, last.dy, here.dy)
    g, t, u = 0.0, 0.0, step
    if back < 0.0 < along:  # by the gap, the last tangent and this one
        r = step / back
        g, t, u = r * r * (3.0 - 2.0 * r), step * r * (r - 1.0) / along, step * (1.0 - r) ** 2
    made = Orbit(
        orbit.mesh + g * (mesh - orbit.mesh) + t * last.shift + u * here.shift,
        orbit.x + g * off + t * last.dx + u * here.dx,
        orbit.y + g * off_y + t * last.dy + u * here.dy,
    )
    return made, here.across


def _distance(cycles: Any, y: Array, dy: Array, other: Array, slope: Array) -> float:
    """How far two points are apart, by the mean of their tangents."""
    sizes = np.append(other[0], cycles.width)
    way, gap = 0.5 * (dy + slope) / sizes, (other - y) / sizes
    square = float(way @ way)
    return float(gap @ way) / square if square > 0.0 else 0.0


def folds(orbit: Orbit, mesh: Array) -> bool:
    """Whether a mesh that moved from that of an orbit is none any more, or hardly."""
    return bool(np.any(np.diff(mesh) < THIN * np.diff(orbit.mesh)))


def matched(cycles: Any, a: Any, b: Any) -> tuple[tuple[Orbit, Tangent], tuple[Orbit, Tangent]]:
    """Two points of a curve, and their tangents, on meshes one of which moves to the other."""
    gap = b.arclength - a.arclength
    one, other = (_unit(cycles, p.orbit, tangent(cycles, p.orbit, p.dx, p.dy)) for p in (a, b))
    first, last = a.orbit.mesh, b.orbit.mesh
    # By the mean of both shifts.
    if len(first) > len(last):
        mesh_a, mesh_b = first, _met(first, one.shift, last, other.shift, gap)
    else:
        mesh_a, mesh_b = _met(last, other.shift, first, one.shift, -gap), last
    return _on(cycles, mesh_a, a.orbit, one), _on(cycles, mesh_b, b.orbit, other)


def _unit(cycles: Any, orbit: Orbit, found: Tangent) -> Tangent:
    size = cycles.length(orbit.mesh, found.across, found.dy)
    return Tangent(*(one / size for one in found))


def _met(mesh: Array, shift: Array, other: Array, there: Array, gap: float) -> Array:
    """Where the points of a mesh come to on another one, a gap on."""
    found = mesh
    for _ in range(4):
        found = mesh + 0.5 * gap * (shift + np.interp(found, other, there))
    found = np.clip(found, 0.0, 1.0)
    return mesh if np.any(np.diff(found) < THIN * np.diff(mesh)) else found


def _on(cycles: Any, mesh: Array, orbit: Orbit, found: Tangent) -> tuple[Orbit, Tangent]:
    there, (dx, across) = cycles.on(mesh, orbit, found.dx, found.across)
    return there, Tangent(np.interp(mesh, orbit.mesh, found.shift), dx, across, found.dy)
