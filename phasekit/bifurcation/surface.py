"""The surface of equilibria V'(phi) = 0 over a plane of two parameters, as triangles.

Marching tetrahedra: each cell of a grid is cut into six tetrahedra, in each of which V' is taken as
linear. Triangles are cut once more where V'' changes sign, so that each has one kind.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable

import numpy as np

from phasekit.arrays import Array

#: V' and V'', in any unit, at parameters with an axis of their own behind, and at coordinates.
Force = Callable[[Array, Array, Array], tuple[Array, Array]]


def equilibrium_surface(force: Force, x: Array, y: Array, phi: Array) -> tuple[Array, Array]:
    """Triangles of centers and of saddles, each of shape (n, 3, 6).

    The last axis holds a corner (x, y, phi) and the gradient of V' there, which is normal to the
    surface, the latter in units of the grid's extent.

    Parameters
    ----------
    force : callable
        V' and V'' over the grid.
    x, y, phi : ndarray
        Axes of the grid.
    """
    across, along = (p[..., None] for p in np.meshgrid(x, y, indexing="ij"))
    slope, bend = force(across, along, phi)
    # A zero on a corner would belong to no edge, or to many.
    slope = np.where(slope == 0.0, 1e-14, slope)
    nodes = np.stack(np.meshgrid(x, y, phi, indexing="ij"), axis=-1)
    axes = [(axis - axis[0]) / (axis[-1] - axis[0]) for axis in (x, y, phi)]
    normal = np.gradient(slope, *axes)
    fields = np.concatenate([nodes, np.stack([*normal, bend, slope], axis=-1)], axis=-1)
    triangles = np.concatenate(list(_tetrahedra(fields)))
    # Of the pieces on either side of V'' = 0.
    return _clip(triangles, 1.0), _clip(triangles, -1.0)


def _tetrahedra(fields: Array) -> list[Array]:
    """Cut every tetrahedron of the grid at V' = 0; fields end with V'', V'."""
    n = fields.shape[:3]
    corner = {
        bits: fields[tuple(slice(b, size - 1 + b) for b, size in zip(bits, n, strict=True))]
        for bits in itertools.product((0, 1), repeat=3)
    }
    found = []
    for order in itertools.permutations(range(3)):  # along the edges from 000 to 111
        path = [(0, 0, 0)]
        for axis in order:
            x, y, z = path[-1]
            path.append((x + (axis == 0), y + (axis == 1), z + (axis == 2)))
        four = np.stack([corner[bits].reshape(-1, 8) for bits in path], axis=1)
        above = (four[..., -1] > 0.0).sum(axis=1)
        cut = four[(above > 0) & (above < 4)]
        # Sorted by V': one below, two and two, or one above.
        ranks = np.argsort(cut[..., -1], axis=1)
        cut = np.take_along_axis(cut, ranks[..., None], axis=1)
        number = (cut[..., -1] > 0.0).sum(axis=1)
        for count, edges in _EDGES.items():
            some = cut[number == count]
            points = [_between(some[:, i], some[:, j]) for i, j in edges]
            found += [np.stack([points[0], points[1], points[2]], axis=1)]
            if count == 2:
                found += [np.stack([points[1], points[2], points[3]], axis=1)]
    return found


# Edges with a crossing by the number of corners above, corners sorted from below.
_EDGES = {
    1: ((0, 3), (1, 3), (2, 3)),
    2: ((0, 2), (0, 3), (1, 2), (1, 3)),
    3: ((0, 1), (0, 2), (0, 3)),
}


def _between(one: Array, other: Array) -> Array:
    share = (one[:, -1] / (one[:, -1] - other[:, -1]))[:, None]
    return np.asarray((one + share * (other - one))[:, :-1])


def _clip(triangles: Array, side: float) -> Array:
    """The parts of triangles where V'' has the sign of `side`, without V''."""
    bend = side * triangles[..., -1]
    ranks = np.argsort(bend, axis=1)
    low, middle, high = np.moveaxis(np.take_along_axis(triangles, ranks[..., None], axis=1), 1, 0)
    inside = (bend > 0.0).sum(axis=1)

    def mix(one: Array, other: Array) -> Array:
        gap = one[:, -1] - other[:, -1]
        share = np.divide(one[:, -1], gap, out=np.zeros_like(gap), where=gap != 0.0)
        return np.asarray(one + share[:, None] * (other - one))

    whole = triangles[inside == 3]
    a, b, c = (p[inside == 1] for p in (low, middle, high))
    tip = np.stack([mix(a, c), mix(b, c), c], axis=1)
    a, b, c = (p[inside == 2] for p in (low, middle, high))
    p, q = mix(a, b), mix(a, c)
    rest = [np.stack([p, b, c], axis=1), np.stack([p, c, q], axis=1)]
    return np.concatenate([whole, tip, *rest])[..., :-1]
