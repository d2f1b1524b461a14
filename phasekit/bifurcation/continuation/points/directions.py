"""Directions of the branches that meet where f_u loses rank: the reduced equations, solved.

On the null spaces of `Singular`, with y the coordinates on the k + 1 right null vectors, f = 0 is
reduced (Liapunov-Schmidt, [AllgowerGeorg1990] 8.3) to k equations

    q(y, y) + c(y, y, y) + ... = 0.

Tangents of branches are the rays with q(y, y) = 0. Where a symmetry leaves nothing of q on the null
space of f_x, they have 2 q(xi, e) s + c(xi, xi, xi) = 0, with e the other null vector: the branch
along it, and branches on which the parameter turns.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from itertools import combinations_with_replacement as tuples

import numpy as np

from phasekit.arrays import Array
from phasekit.bifurcation.continuation import normal_form as forms
from phasekit.bifurcation.continuation.curve import Curve
from phasekit.bifurcation.continuation.points.singular import Singular

ZERO = 1e-6  # coefficients that are smaller than others of unit vectors, relative, are none
MOST = 64  # directions that are looked for at one point


@dataclass(frozen=True)
class Directions:
    """Unit tangents of branches through a point, and what may be missing."""

    tangents: list[Array]
    symmetric: bool  # q vanishes on the null space of f_x
    message: str = ""


def directions(curve: Curve, point: Singular) -> Directions:
    """All branches through a point where f_u loses rank."""
    n, m, k = curve.n, curve.m, point.corank
    scale = curve.scale[:m]
    d = forms.Derivatives(curve, point.u)
    w = point.left.T / point.rows
    # The last null vector alone moves the parameter, if any does.
    basis = point.right / scale[:, None]
    along = basis[n]
    turn = np.linalg.qr(np.column_stack([along, np.eye(k + 1)]))[0][:, : k + 1]
    moves = float(np.max(np.abs(along))) > 1e-9
    if moves:
        basis = basis @ np.roll(turn, -1, axis=1)
    vectors = (basis * scale[:, None]).T
    q = np.zeros((k, k + 1, k + 1))
    for i, j in tuples(range(k + 1), 2):
        q[:, i, j] = q[:, j, i] = 0.5 * (w @ d.second(vectors[i], vectors[j]).value)
    cubic = _cubic(curve, d, point, w, vectors[:k])
    rays, symmetric, message = reduced_rays(q, cubic, moves)
    if k == 1 and len(rays) != 2:
        return _counted(curve, point)
    tangents = [vectors.T @ y for y in rays]
    return Directions([t / curve.length(t) for t in tangents], symmetric, message)


def reduced_rays(q: Array, cubic: Array, moves: bool) -> tuple[list[Array], bool, str]:
    """Rays of the reduced equations, whether they are those of a symmetry, and what is unclear.

    The last null vector alone moves the parameter, if any does (``moves``).
    """
    k, size = len(q), float(np.max(np.abs(q)))
    most = max(size, float(np.max(np.abs(cubic))))
    if not most > 0.0 or size <= ZERO * most:
        return [], False, "second derivatives vanish on the null space"
    symmetric = moves and float(np.max(np.abs(q[:, :k, :k]))) <= ZERO * most
    rays, message = _turning(q, cubic) if symmetric else _straight(q)
    return rays, symmetric, message


def _counted(curve: Curve, point: Singular) -> Directions:
    rays = rays_around(curve, point)
    message = f"{len(rays)} branches meet" if rays else "branches touch here, or none meet"
    return Directions(rays, False, message)


def _straight(q: Array) -> tuple[list[Array], str]:
    """All real rays with q(y, y) = 0, k quadratic forms in k + 1 variables."""
    k = len(q)
    if k == 1:
        (a, b), (_, c) = q[0]
        root = b * b - a * c
        if root <= 1e-10 * np.max(np.abs(q)) ** 2:
            return [], ""
        # a x^2 + 2 b x y + c y^2 = 0, its roots without cancellation.
        far = -(b + np.copysign(np.sqrt(root), b))
        return [_unit(np.array(pair)) for pair in ((far, a), (c, far))], ""
    q = q / np.max(np.abs(q))

    def equations(y: Array) -> tuple[Array, Array]:
        half = np.einsum("iab,sb->sia", q, y)
        return np.einsum("sia,sa->si", half, y), 2.0 * half

    return _rays(equations, k + 1, 2**k)


def _turning(q: Array, cubic: Array) -> tuple[list[Array], str]:
    """The branch along which the parameter moves, and those on which it turns."""
    k = len(q)
    slope = 2.0 * q[:, :k, k]
    # Along (eta, 1) the k forms vanish: 2 q(eta, e) + q(e, e) = 0.
    eta = np.linalg.lstsq(slope, -q[:, k, k], rcond=None)[0]
    own = _unit(np.append(eta, 1.0))
    if k == 1:
        return [own, np.array([1.0, 0.0])], ""
    slope = slope / np.max(np.abs(slope))
    size = np.max(np.abs(cubic))
    if not size > 0.0:
        return [own], "third derivatives vanish on the null space"
    cubic = cubic / size

    def equations(z: Array) -> tuple[Array, Array]:
        xi, s = z[:, :k], z[:, k:]
        along = np.einsum("iabc,sb,sc->sia", cubic, xi, xi)
        linear = xi @ slope.T
        value = np.einsum("sia,sa->si", along, xi) + s * linear
        jacobian = np.concatenate([3.0 * along + s[:, :, None] * slope, linear[:, :, None]], 2)
        return value, jacobian

    rays, message = _rays(equations, k + 1, (3**k - 1) // 2, free=1)
    return [own, *(_unit(np.append(z[:k], 0.0)) for z in rays)], message


def _rays(
    equations: Callable[[Array], tuple[Array, Array]], size: int, most: int, free: int = 0
) -> tuple[list[Array], str]:
    """Solutions of homogeneous equations, found by Newton's method from many directions.

    The last ``free`` unknowns have no part in the length, which is one.
    """
    k = size - free
    z = np.pad(_starts(k, most), ((0, 0), (0, free)))
    length = np.ones(size)
    length[k:] = 0.0
    if free:  # the best multiplier of each start
        value, jacobian = equations(z)
        linear = jacobian[:, :, k]
        z[:, k] = -np.sum(value * linear, axis=1) / np.maximum(np.sum(linear**2, axis=1), 1e-30)

    def system(z: Array) -> tuple[Array, Array]:
        value, jacobian = equations(z)
        norm = 0.5 * (np.sum(length * z * z, axis=1, keepdims=True) - 1.0)
        matrix = np.concatenate([jacobian, (length * z)[:, None, :]], axis=1)
        return np.append(value, norm, 1), matrix

    large = np.full(len(z), np.inf)
    for _ in range(50):
        active = np.flatnonzero(large > 1e-14)
        if not len(active):
            break
        step = _newton(*system(z[active]))
        large[active] = np.linalg.norm(step, axis=1)
        z[active] -= step * np.minimum(1.0, 0.5 / np.maximum(large[active, None], 1e-300))
    value, matrix = system(z)
    solved = (np.max(np.abs(value), axis=1) < 1e-11) & (large < 1e-7)
    z, matrix = z[solved], matrix[solved]
    regular = np.linalg.svd(matrix, compute_uv=False)[:, -1] > 1e-5
    found: list[Array] = []
    loose = 0
    left = np.ones(len(z), dtype=bool)
    while left.any() and len(found) <= MOST:
        i = int(np.argmax(left))
        one = z[i]
        left &= np.abs(np.abs(z[:, :k] @ one[:k]) - 1.0) >= 1e-8
        loose += not regular[i]
        if regular[i] or loose == 1:
            found.append(one)
    message = ""
    if loose:
        message = "the reduced equations have solutions that are not isolated"
    elif len(found) > MOST or most > 200:
        message = f"{min(len(found), MOST)} directions are given; there may be more"
    return found[:MOST], message


def _starts(k: int, most: int) -> Array:
    """Directions to start from: along the axes and between them, and many at random."""
    generator = np.random.default_rng(0)
    axes = min(k, 5)
    grid = np.array(np.meshgrid(*[[-1.0, 0.0, 1.0]] * axes, indexing="ij")).reshape(axes, -1).T
    grid = np.pad(grid[np.any(grid != 0.0, axis=1)], ((0, 0), (0, k - axes)))
    z = np.concatenate([grid, generator.normal(size=(min(1500, 40 * most), k))])
    return np.asarray(z / np.linalg.norm(z, axis=1, keepdims=True))


def _newton(value: Array, matrix: Array) -> Array:
    """Newton steps of many systems; of singular ones the shortest."""
    try:
        step = np.linalg.solve(matrix, value[:, :, None])[:, :, 0]
    except np.linalg.LinAlgError:
        step = np.full(value.shape, np.nan)
    bad = ~np.isfinite(step).all(axis=1)
    if bad.any():
        step[bad] = (np.linalg.pinv(matrix[bad]) @ value[bad][:, :, None])[:, :, 0]
    return np.asarray(step)


def _cubic(curve: Curve, d: forms.Derivatives, point: Singular, w: Array, v: Array) -> Array:
    """c(a, b, c) on the first k null vectors: third derivatives, and what is slaved to them."""
    m, k = curve.m, point.corank
    scale = curve.scale[:m]
    slopes = d.slopes * scale / point.rows[:, None]
    inverse = np.linalg.pinv(slopes, rcond=1e-9)
    slaved = {}
    for a, b in tuples(range(k), 2):
        force = d.second(v[a], v[b]).value / point.rows
        force = force - point.left @ (point.left.T @ force)
        slaved[a, b] = -(inverse @ force) * scale
    result = np.zeros((k, k, k, k))
    for a, b, c in tuples(range(k), 3):
        total = d.third(v[a], v[b], v[c]).value
        for one, pair in ((a, (b, c)), (b, (a, c)), (c, (a, b))):
            total = total + d.second(v[one], slaved[pair]).value
        value = w @ total / 6.0
        for i, j, l in {(a, b, c), (a, c, b), (b, a, c), (b, c, a), (c, a, b), (c, b, a)}:  # noqa: E741
            result[:, i, j, l] = value
    return result


def _unit(y: Array) -> Array:
    return np.asarray(y / np.linalg.norm(y))


RADII = (8e-3, 4e-3)  # on scaled axes
ANGLES = 360
CHORDS = 10


def rays_around(curve: Curve, point: Singular) -> list[Array]:
    """Unit tangents of the lines along which branches leave a point of corank one.

    The reduced equation f + w b = 0 is solved for b on circles around the point, in the plane of
    the null vectors; branches cross the circle where b changes its sign. Empty unless two circles
    agree and each ray has its opposite.
    """
    angles = [_crossings(curve, point, radius) for radius in RADII]
    if len(angles[0]) != len(angles[1]) or not len(angles[0]) or len(angles[0]) % 2:
        return []
    # What is left of the bend of the branches after one extrapolation.
    turn = angles[1] - angles[0]
    turn -= 2.0 * np.pi * np.round(turn / (2.0 * np.pi))
    rays = angles[1] + turn
    half = len(rays) // 2
    gap = rays[half:] - rays[:half] - np.pi
    gap -= 2.0 * np.pi * np.round(gap / (2.0 * np.pi))
    if np.max(np.abs(turn)) > 0.2 or np.max(np.abs(gap)) > 0.05:
        return []
    lines = rays[:half] + 0.5 * gap
    found = [point.right @ np.array([np.cos(a), np.sin(a)]) for a in lines]
    return [t / curve.length(t) for t in found]


def _crossings(curve: Curve, point: Singular, radius: float) -> Array:
    """Angles at which the reduced function changes its sign, in order."""
    grid = 2.0 * np.pi * (np.arange(ANGLES) + 0.5) / ANGLES
    back = _inverse(curve, point)
    values = np.array([_reduced(curve, point, radius, a, back) for a in grid])
    if not np.isfinite(values).all():
        return np.empty(0)
    found = []
    for i in np.flatnonzero(np.sign(values) != np.sign(np.roll(values, -1))):
        low, high, at_low = grid[i], grid[i] + 2.0 * np.pi / ANGLES, values[i]
        for _ in range(30):
            middle = 0.5 * (low + high)
            value = _reduced(curve, point, radius, middle, back)
            if (value > 0.0) == (at_low > 0.0):
                low = middle
            else:
                high = middle
        found.append(0.5 * (low + high))
    return np.array(found)


def _inverse(curve: Curve, point: Singular) -> Array:
    """From what is left of f, less its part along the left null vector, to a step across."""
    m = curve.m
    scale = curve.scale[:m]
    basis = point.right / scale[:, None]
    scaled = curve.evaluate(point.u)[1] * scale / point.rows[:, None]
    scaled = scaled - point.left @ (point.left.T @ scaled)
    across = np.eye(m) - basis @ basis.T  # of the plane of the circle
    return np.asarray(scale[:, None] * np.linalg.pinv(scaled @ across, rcond=1e-9))


def _reduced(curve: Curve, point: Singular, radius: float, angle: float, back: Array) -> float:
    """What is left of f along the left null vector where all else of it is zero."""
    w = point.left[:, 0]
    u = point.u + radius * (point.right @ np.array([np.cos(angle), np.sin(angle)]))
    value = np.inf
    for _ in range(CHORDS):  # each with an error smaller by the radius
        f = curve.values(u[None])[0] / point.rows
        value = float(w @ f)
        rest = f - w * value
        if not np.max(np.abs(rest)) > 1e-15 * radius:
            break
        u = u - back @ rest
    return value
