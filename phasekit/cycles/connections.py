"""Orbits that connect equilibria, in infinite time: what holds at their ends, and their checks.

Over a long time an orbit begins in the plane that the unstable manifold of the first equilibrium
touches there, and ends in that of the stable manifold of the last one, both at a given distance
([Beyn1990]; [Kuznetsov2004] 6.4): ``L (x - e) = 0`` with the rows of L orthogonal to the invariant
subspace, of an ordered real Schur form. The manifold itself lies off that plane by the square of
the distance, ``L (x - e) = h(x - e)``; what this moves the parameters by is the error of
truncation.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import numpy as np

from phasekit.arrays import Array, Complex
from phasekit.cycles import along, collocation, wide
from phasekit.cycles.bounded import Bounded, of_ends
from phasekit.cycles.cycles import Orbit, where
from phasekit.cycles.functionals import Rows
from phasekit.cycles.subspaces import Subspace, subspace

SOURCE, TARGET = 0, 1  # the ends
MOST = 40  # steps of Newton's method to an equilibrium
SETTLED = 1e-13  # the last of them, on scaled axes
FLAT = 1e-9  # a step that no longer shrinks counts below this, where terms of f cancel
BESIDE = 4  # units of rounding to both sides, where f is looked at to see its rounding
GRAINS = 16.0  # units of rounding of f that are rounding
STEP = 2.0**-8  # of second differences, on scaled axes
TURN = 2.0**-20  # of parameters, to see how planes turn with them
HUGE, HALVES = 2.0**200, 400  # first distance from an equilibrium, and how often it is halved
BENT = 0.1  # by what f is off its slopes where it is not linear
NEAR = 0.1  # what the conditions are off by where that counts
MET = 1.01  # times the distance at which an orbit is to end, up to which Newton's method leads it


@dataclass(frozen=True, eq=False)
class Rest:
    """An equilibrium at an end of an orbit, on scaled axes."""

    x: Array  # the state itself
    A: Array  # derivatives of f by the states, on scaled axes
    moves: Array  # shape (n, parameters): by what it moves with the free parameters, on scaled axes

    def eigenvalues(self) -> Complex:
        """Eigenvalues, the largest real part first."""
        values = np.linalg.eigvals(self.A).astype(complex)
        return values[np.lexsort((values.imag, -values.real))]

    def unstable(self) -> int:
        """Number of eigenvalues with a positive real part."""
        return int(np.sum(self.eigenvalues().real > 0.0))


def slopes_at(bounded: Any, x: Array, y: Array) -> tuple[Array, Array]:
    """F at a state, and its derivatives by states and free parameters, without scales."""
    n = bounded.n
    places = np.stack([x, x])
    found = bounded.jets(np.array([0.0, 1.0]), places, y, 1, bounded.sizes)[0]
    return found[:n], found[n:].reshape(n, -1)


def rest_near(bounded: Any, x: Array, y: Array) -> Rest | None:
    """The equilibrium that Newton's method finds from a state; None if there is none."""
    return _rest_near(bounded, x.tobytes(), y.tobytes())


@lru_cache(maxsize=8)  # what holds at the ends is asked for several times of an orbit
def _rest_near(bounded: Any, state: bytes, given: bytes) -> Rest | None:
    x, y = np.frombuffer(state).copy(), np.frombuffer(given).copy()
    n, scale = bounded.n, bounded.scale
    before = math.inf
    for _ in range(MOST):
        f, slopes = slopes_at(bounded, x, y)
        if not (np.isfinite(f).all() and np.isfinite(slopes).all()):
            return None
        try:
            step = np.linalg.solve(slopes[:, :n], f)
        except np.linalg.LinAlgError:
            return None
        x = x - step
        size = float(np.max(np.abs(step) / scale))
        if size <= SETTLED:
            break
        if size >= 0.5 * before and (
            size < FLAT or np.all(np.abs(step) <= GRAINS * _grain(slopes[:, :n], x))
        ):
            break
        before = size
    else:
        return None
    A = slopes[:, :n] * scale / scale[:, None]  # the last step moves them below rounding
    moves = -np.linalg.solve(slopes[:, :n], slopes[:, n:]) / scale[:, None]
    return Rest(x, A, moves)


def _grain(A: Array, x: Array) -> Array:
    """By what an equilibrium is off as the terms of f, as large as |A| |x|, are rounded."""
    found = np.abs(np.linalg.inv(A)) @ (np.abs(A) @ np.abs(x))
    return np.asarray(np.finfo(float).eps * found)


def blur(bounded: Any, rest: Rest, y: Array) -> float:
    """The same on scaled axes, and at least as far as steps from its neighbours end apart.

    Terms of f that cancel may be far larger than its slopes tell.
    """
    scale, found = bounded.scale, _grain(rest.A, rest.x / bounded.scale)
    for k in range(-BESIDE, BESIDE + 1):
        x = rest.x * (1.0 + k * np.finfo(float).eps)
        step = np.linalg.solve(rest.A, slopes_at(bounded, x, y)[0] / scale)
        found = np.maximum(found, np.abs((x - rest.x) / scale - step))
    return float(np.max(found))


@lru_cache(maxsize=8)  # both ends are often the same
def _turning(bounded: Any, rest: Rest, given: bytes) -> Array:
    """By what the slopes at an equilibrium change with the parameters, as that moves with them."""
    n, scale, y = bounded.n, bounded.scale, np.frombuffer(given)
    found = np.empty((bounded.q - 1, n, n))
    sizes = bounded.sizes[n:]  # next to a fold the equilibrium goes far with a small part of them
    for i, size in enumerate(TURN * sizes / np.maximum(1.0, np.abs(rest.moves).max(0) * sizes)):
        beside = y.copy()
        beside[1 + i] += size
        slopes = slopes_at(bounded, rest.x + rest.moves[:, i] * size * scale, beside)[1][:, :n]
        found[i] = (slopes * scale / scale[:, None] - rest.A) / size
    return found


def linear_reach(bounded: Any, rest: Rest, y: Array, plane: Array) -> float:
    """The least distance in a plane at which f is not linear any more; inf if it is all over."""
    ways = np.vstack([plane.T, -plane.T]) * bounded.scale
    pushed = ways @ slopes_at(bounded, rest.x, y)[1][:, : bounded.n].T
    sizes = np.linalg.norm(pushed / bounded.scale, axis=1)
    distance, found = HUGE * max(1.0, float(np.max(np.abs(rest.x) / bounded.scale))), math.inf
    for _ in range(HALVES):
        with np.errstate(all="ignore"):
            f = np.array([slopes_at(bounded, rest.x + distance * way, y)[0] for way in ways])
            off = np.linalg.norm((f / distance - pushed) / bounded.scale, axis=1)
        if np.all(off <= BENT * sizes):
            return found
        found, distance = distance, 0.5 * distance
    return found


@dataclass(frozen=True, eq=False)
class Ends:
    """What holds at both ends of a connecting orbit."""

    unstable: int  # dimension of the unstable manifold that the orbit leaves in
    stable: int  # dimension of the stable manifold that it arrives in
    distances: tuple[float, float]  # from the equilibria, on scaled axes (see `measure`)
    same: bool  # whether it leaves and arrives at the same equilibrium
    n: int  # number of states
    both: bool = True  # whether both distances are held; else the first, and time is held or free

    @property
    def count(self) -> int:
        """How many."""
        return 2 * self.n - self.unstable - self.stable + 1 + self.both

    def rests(self, bounded: Any, orbit: Orbit) -> tuple[Rest, Rest] | None:
        """The equilibria at both ends."""
        first = rest_near(bounded, orbit.x[0], orbit.y)
        if first is None:
            return None
        last = first if self.same else rest_near(bounded, orbit.x[-1], orbit.y)
        return None if last is None else (first, last)

    def subspaces(self, rests: tuple[Rest, Rest]) -> tuple[Subspace, Subspace]:
        """The invariant subspaces that the orbit leaves in, and arrives in."""
        return (
            subspace(rests[SOURCE].A, self.unstable, stable=False),
            subspace(rests[TARGET].A, self.stable, stable=True),
        )

    def linear(self, bounded: Any, orbit: Orbit) -> Rows:
        """Derivatives of what vanishes, and its values.

        How the subspaces turn with the parameters counts once it is near: without that, Newton's
        method converges linearly, by a thirtieth a step.
        """
        n, scale, k = bounded.n, bounded.scale, bounded.q - 1
        values = np.full(self.count, np.nan)
        slopes = np.zeros((self.count, 2 * n + k))
        rests = self.rests(bounded, orbit)
        if rests is None:
            return of_ends(orbit, slopes, values)
        try:
            spaces = self.subspaces(rests)
        except np.linalg.LinAlgError:
            return of_ends(orbit, slopes, values)
        row = 0
        for side, x in ((SOURCE, orbit.x[0]), (TARGET, orbit.x[-1])):
            rest, L = rests[side], spaces[side].across.T
            z = (x - rest.x) / scale
            weighed = spaces[side].measure @ z
            far = math.sqrt(max(float(z @ weighed), 0.0)) or 1e-300
            rows = np.vstack([L, weighed[None] / (far * self.distances[side])]) if self.both else L
            here = slice(row, row + len(rows))
            columns = slice(side * n, (side + 1) * n)
            gap = [far / self.distances[side] - 1.0] if self.both else []
            values[here] = np.append(L @ z, gap)
            slopes[here, columns] = rows / scale
            slopes[here, 2 * n :] = -rows @ rest.moves
            row = here.stop
        if not self.both:
            values[row] = 0.0
        if np.max(np.abs(values)) < NEAR:
            slopes[:, 2 * n :] += self._turned(bounded, orbit, rests, spaces)
        found = of_ends(orbit, slopes, values)
        if not self.both:
            c, at = collocation.scheme(bounded.m), np.zeros(1)
            along_itself = np.zeros((1, *orbit.x.shape))
            along.borders(
                orbit.mesh, c.weights, c.value, c.slope, orbit.x, np.zeros_like(orbit.x),
                bounded.scale, False, along_itself, at,
            )  # fmt: skip
            found[0][row] = along_itself[0]
        return found

    def _turned(
        self, bounded: Any, orbit: Orbit, rests: tuple[Rest, Rest],
        spaces: tuple[Subspace, Subspace],
    ) -> Array:  # fmt: skip
        """How what vanishes changes as the subspaces and measures turn with the parameters."""
        slopes, row = np.zeros((self.count, bounded.q - 1)), 0
        for side, x in ((SOURCE, orbit.x[0]), (TARGET, orbit.x[-1])):
            space, z = spaces[side], (x - rests[side].x) / bounded.scale
            far = math.sqrt(max(float(z @ space.measure @ z), 0.0)) or 1e-300
            here = slice(row, row + space.across.shape[1] + self.both)
            try:
                for i, dA in enumerate(_turning(bounded, rests[side], orbit.y.tobytes())):
                    change, square = space.turned(dA, z)
                    if self.both:
                        change = np.append(change, square / (2.0 * far * self.distances[side]))
                    slopes[here, i] = change
            except np.linalg.LinAlgError:  # not finite, or the count parts a pair
                return np.zeros(slopes.shape)
            row = here.stop
        return slopes


def ends_of(bounded: Bounded) -> Ends:
    """The conditions of a connecting orbit."""
    (ends,) = bounded.conditions
    assert isinstance(ends, Ends)
    return ends


def lost(bounded: Bounded, orbit: Orbit) -> str:
    """Words where Newton's method for an orbit lost the equilibria of its ends; "" where not."""
    if ends_of(bounded).rests(bounded, orbit) is not None:
        return ""
    return f"it led to {where(bounded, orbit)}, where no equilibrium is near an end of the orbit"


def truncation(bounded: Bounded, orbit: Orbit) -> Array:
    """By what the free parameters are off, since manifolds are no planes, to first order."""
    ends = ends_of(bounded)
    rests = ends.rests(bounded, orbit)
    if rests is None:
        return np.full(bounded.q - 1, np.nan)
    spaces = ends.subspaces(rests)
    right, row = np.zeros(bounded.bordering), bounded.bordering - 1 - ends.count
    for side, x in ((SOURCE, orbit.x[0]), (TARGET, orbit.x[-1])):
        L = spaces[side].across
        z = (x - rests[side].x) / bounded.scale
        right[row : row + L.shape[1]] = bend(bounded, rests[side], orbit.y, z, spaces[side])
        row += L.shape[1] + ends.both
    nothing = np.zeros_like(orbit.x)
    rows, rows_y, _ = bounded.rows(orbit, nothing, np.zeros(bounded.q))
    rows_y[-1, -1 if ends.both else 0] = 1.0  # the last parameter stays, or time
    return solved(bounded, orbit, rows, rows_y, right)[1][1:]


def solved(
    bounded: Bounded, orbit: Orbit, rows: Array, rows_y: Array, right: Array
) -> tuple[Array, Array]:
    """What the linear equations of an orbit say of right sides of its bordering rows."""
    W = bounded.looked_at(orbit, np.zeros_like(orbit.x), np.zeros(bounded.q)).W
    W[:, :, -1] = 0.0
    dx, dy = np.empty((2, *orbit.x.shape)), np.empty((2, bounded.q))
    none = np.zeros(bounded.n)
    if wide.solve(W, rows, rows_y, right, none, none, bounded.m, dx, dy) == 0.0:
        dx[:], dy[:] = np.nan, np.nan
    return dx[0], dy[0]


def bend(bounded: Bounded, rest: Rest, y: Array, z: Array, space: Subspace) -> Array:
    """By what an invariant manifold leaves the plane that it touches, at a point z of that.

    ``L^T z = h`` with ``D h A_u z = L^T A L h + L^T B(z, z)/2``, solved in eigenvectors of the
    plane ([Kuznetsov2004] 8.7).
    """
    L, plane, count = space.across, space.plane, space.count
    if L.shape[1] == 0 or count == 0:
        return np.zeros(L.shape[1])
    values, vectors = np.linalg.eig(plane.T @ rest.A @ plane)
    modes = plane @ vectors  # in columns
    parts = np.linalg.solve(vectors, plane.T @ z)
    across = L.T @ rest.A @ L
    found = np.zeros(L.shape[1], complex)
    second = {}
    for i in range(count):
        for j in range(i, count):
            second[i, j] = L.T @ quadratic(bounded, rest, y, modes[:, i], modes[:, j])
    for i in range(count):
        for j in range(count):
            rate = (values[i] + values[j]) * np.eye(L.shape[1]) - across
            found += parts[i] * parts[j] * np.linalg.solve(rate, 0.5 * second[min(i, j), max(i, j)])
    return np.asarray(found.real)


def quadratic(bounded: Bounded, rest: Rest, y: Array, a: Complex, b: Complex) -> Complex:
    """B(a, b) at an equilibrium, of complex directions on scaled axes, by differences of slopes."""

    def along(u: Array, v: Array) -> Array:
        size = float(np.max(np.abs(u)))
        if size == 0.0:
            return np.zeros(len(u))
        h = STEP / size

        def slopes(k: float) -> Array:
            found = slopes_at(bounded, rest.x + k * u * bounded.scale, y)[1][:, : bounded.n]
            return np.asarray((found * bounded.scale / bounded.scale[:, None]) @ v)

        near, wide = ((slopes(k) - slopes(-k)) / (2.0 * k) for k in (h, 2.0 * h))
        return np.asarray((4.0 * near - wide) / 3.0)

    real = along(a.real, b.real) - along(a.imag, b.imag)
    return np.asarray(real + 1j * (along(a.real, b.imag) + along(a.imag, b.real)))


# ------------------------------------------------------------------------------ along curves


@dataclass(frozen=True)
class Spectra:
    """Eigenvalues at the ends of a connecting orbit, the leading ones first.

    ``out`` are those of the manifold that it leaves in, ``into`` of that which it arrives in;
    ``others`` are the stable ones at the source and the unstable ones at the target.
    """

    out: Complex
    into: Complex
    others: tuple[Complex, Complex]


@lru_cache(maxsize=8)
def spectra(bounded: Bounded, orbit: Orbit) -> Spectra | None:
    """Eigenvalues at both ends; None where there is no equilibrium."""
    ends = ends_of(bounded)
    rests = ends.rests(bounded, orbit)
    if rests is None:
        return None
    first, last = (rest.eigenvalues() for rest in rests)
    out, rest_of_first = first[: ends.unstable][::-1], first[ends.unstable :]
    into, rest_of_last = last[len(last) - ends.stable :], last[: len(last) - ends.stable][::-1]
    return Spectra(out, into, (rest_of_first, rest_of_last))


def extended(
    orbit: Orbit, bounded: Bounded, rests: tuple[Rest, Rest], distances: tuple[float, float],
    trusted: float = 0.0,
) -> Orbit:  # fmt: skip
    """An orbit whose ends are led to given distances, along the linear flow, or cut there.

    What lies nearer to the equilibria than is trusted is not kept.
    """
    ends = ends_of(bounded)
    m, scale = bounded.m, bounded.scale
    cut = (max(distances[0], trusted), max(distances[1], trusted))
    spaces = ends.subspaces(rests)
    orbit = _cut(_trimmed(orbit, rests, m, scale, cut), rests, spaces, m, scale, distances)
    mesh, x, length = orbit.mesh * orbit.y[0], orbit.x, float(orbit.y[0])
    pieces = [x]
    for side, space in enumerate(spaces):
        rest, plane = rests[side], space.plane
        z = plane.T @ (((x[0] if side == SOURCE else x[-1]) - rest.x) / scale)
        values, vectors = np.linalg.eig(plane.T @ rest.A @ plane)
        parts = np.linalg.solve(vectors, z.astype(complex))
        sign = -1.0 if side == SOURCE else 1.0
        slowest = float(np.min(np.abs(values.real)))
        form = plane.T @ space.measure @ plane
        far = float(np.sqrt(z @ form @ z))
        if not far > MET * distances[side] or slowest == 0.0:
            continue  # intervals as short as what is missing would have no digits

        def state(t: float, parts: Complex = parts, values: Complex = values,
                  vectors: Complex = vectors, sign: float = sign) -> Array:  # fmt: skip
            return np.asarray((vectors @ (np.exp(sign * values * t) * parts)).real)

        high = math.log(far / distances[side]) / slowest + 1.0 / slowest
        low = 0.0
        for _ in range(60):
            middle = 0.5 * (low + high)
            if np.sqrt(state(middle) @ form @ state(middle)) > distances[side]:
                low = middle
            else:
                high = middle
        reach = high
        fast = float(np.max(np.abs(values)))
        steps = int(np.clip(4.0 * reach * fast, 12, 400))
        knots = np.linspace(0.0, reach, steps + 1)
        grid = collocation.times(knots, m)
        more = np.array([rest.x + scale * (plane @ state(t)) for t in grid])
        if side == SOURCE:
            pieces.insert(0, more[:0:-1])
            mesh = np.concatenate([-knots[:0:-1], mesh])
        else:
            pieces.append(more[1:])
            mesh = np.concatenate([mesh, length + knots[1:]])
    mesh, y = mesh - mesh[0], orbit.y.copy()
    y[0] = mesh[-1]
    return Orbit(mesh / mesh[-1], np.ascontiguousarray(np.concatenate(pieces)), y)


def _trimmed(
    orbit: Orbit, rests: tuple[Rest, Rest], m: int, scale: Array, distances: tuple[float, float]
) -> Orbit:
    """An orbit without the mesh intervals that lie nearer to its equilibria than it is to end."""
    far = [
        np.linalg.norm((orbit.x[::m] - rest.x) / scale, axis=1) > distance
        for rest, distance in zip(rests, distances, strict=True)
    ]
    if not (np.any(far[0]) and np.any(far[1])):
        return orbit
    first = max(int(np.argmax(far[0])) - 1, 0)
    last = min(len(far[1]) - int(np.argmax(far[1][::-1])), len(far[1]) - 1)
    if last - first < 4 or (first == 0 and last == len(far[1]) - 1):
        return orbit
    return _between(orbit.mesh[first : last + 1], orbit.x[first * m : last * m + 1], orbit.y)


def _between(mesh: Array, x: Array, y: Array) -> Orbit:
    """A part of an orbit."""
    length = mesh[-1] - mesh[0]
    return Orbit((mesh - mesh[0]) / length, x.copy(), np.append(y[0] * length, y[1:]))


def _cut(
    orbit: Orbit, rests: tuple[Rest, Rest], spaces: tuple[Subspace, Subspace], m: int, scale: Array,
    distances: tuple[float, float],
) -> Orbit:  # fmt: skip
    """An orbit without what is measured nearer to its equilibria than it is to end.

    Where it ended next to that, Newton's method would stretch all of it in time.
    """

    def beyond(side: int, x: Array) -> Array:
        z = (x - rests[side].x) / scale
        square = np.einsum("ki,ij,kj->k", z, spaces[side].measure, z)
        return np.asarray(square - distances[side] ** 2)

    mesh = orbit.mesh
    far = [beyond(side, orbit.x[::m]) > 0.0 for side in (SOURCE, TARGET)]
    first, last = int(np.argmax(far[SOURCE])), len(mesh) - 1 - int(np.argmax(far[TARGET][::-1]))
    if (first, last) == (0, len(mesh) - 1) or not all(map(np.any, far)) or last - first < 4:
        return orbit
    kept = mesh[first : last + 1]
    for side, inner, outer in ((SOURCE, first, first - 1), (TARGET, last, last + 1)):
        if inner in (0, len(mesh) - 1):
            continue
        low, high = mesh[outer], mesh[inner]
        for _ in range(50):
            middle = 0.5 * (low + high)
            x = collocation.interpolate(mesh, orbit.x, m, np.array([middle]))
            low, high = (low, middle) if beyond(side, x)[0] > 0.0 else (middle, high)
        kept = np.append(high, kept) if side == SOURCE else np.append(kept, high)
    kept = kept[np.append(True, np.diff(kept) > 0.0)]
    x = collocation.interpolate(mesh, orbit.x, m, collocation.times(kept, m))
    return _between(kept, x, orbit.y)
