"""A traced curve as one path from its backward to its forward end, and points between points.

Newton's method judges a point by the steps that led to it, and unknowns that vanish by their
scales; on a path f itself is held against its terms. What is larger than rounding of these is
brought down, where it can be, or said.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from typing import Any, ClassVar

import numpy as np
import numpy.typing as npt

from phasekit.arrays import Array
from phasekit.bifurcation.continuation import walk
from phasekit.bifurcation.continuation.curve import MOST, TIGHT, Curve, Stop, Track
from phasekit.bifurcation.continuation.derivatives import Derivatives
from phasekit.bifurcation.continuation.kernels import trace
from phasekit.bifurcation.continuation.kernels.defining import (
    EQUILIBRIUM,
    EVENT,
    HOPF,
    REGULAR,
    TORUS,
)
from phasekit.bifurcation.continuation.kernels.newton import RAISED, ROUNDING
from phasekit.bifurcation.continuation.kernels.trace import BOUND
from phasekit.bifurcation.continuation.spectrum import across, eigenvalues_of, largest

EPSILON = 2.0**-52
INSIDE = 1e-12  # of a function, whose inner terms are not seen
BESIDE = 1e-6  # farthest, on scaled axes, that a bound lies from a last point
NEAR = 1e-8  # farthest, on scaled axes, that a point is moved
GROWN = 1e-9  # off the length 1: no rounding
VAIN = 3  # points in a row that cannot be brought nearer: f is no better known
DOUBTFUL = 1e-6  # real parts that are smaller, relative to the largest eigenvalue of the path


@dataclass(frozen=True)
class Path(walk.Path):
    """Points in order: unknowns, unit tangents along the path, derivatives of f, step data.

    ``slopes`` is an array or, of many states, takes the derivatives again wherever it is indexed.
    """

    u: Array
    tangent: Array
    slopes: Array | Slopes
    info: Array
    start: int
    stops: tuple[Stop, Stop]
    residual: Array  # |f| beside its terms
    eigenvalues: npt.NDArray[np.complex128] | None = None  # of f_x, where slopes are kept
    messages: tuple[str, ...] = ()  # what is not certain about them
    ends: tuple[Any, Any] = (None, None)  # special points beyond its first and last point
    outside: tuple[Any, ...] = ()  # special points beyond its bounds, between points inside

    rows: ClassVar[tuple[str, ...]] = ("u", "tangent", "info", "residual")

    def part(self, first: int, last: int, ends: tuple[Any, Any]) -> Any:
        """Points of it, between the special points at which it ends."""
        kept, slopes = super().part(first, last, ends), self.slopes
        return replace(
            kept,
            slopes=slopes[first:last] if isinstance(slopes, np.ndarray)
            else replace(slopes, u=kept.u),
            eigenvalues=None if self.eigenvalues is None else self.eigenvalues[first:last],
            outside=tuple(
                replace(one, index=one.index - first)
                for one in self.outside if first <= one.index < last - 1
            ),
        )  # fmt: skip


@dataclass(frozen=True)
class Sample:
    """One point of a path, with what test functions need."""

    u: Array
    tangent: Array
    slopes: Array


def turned(curve: Curve, gap: Array) -> Array:
    """Differences of unknowns, angles modulo their periods."""
    gap = np.array(gap)
    for j in range(curve.m):
        if curve.period[j] > 0.0:
            gap[..., j] -= curve.period[j] * np.round(gap[..., j] / curve.period[j])
    return gap


def join(curve: Curve, start: Sample, backward: Track | None, forward: Track | None) -> Path:
    """One path of two tracks from the same start; the start stands once between them."""
    size, n, m = curve.size, curve.n, curve.m
    middle = np.zeros((1, 2 * size + trace.RECORDED))
    middle[0, :size], middle[0, size : 2 * size] = start.u, start.tangent
    nothing = np.empty((0, middle.shape[1]))
    # A copy: the record belongs to the track.
    behind = np.array(backward.record[::-1]) if backward is not None else nothing
    behind[:, size : 2 * size] *= -1.0
    behind[:, -trace.RECORDED + trace.ARCLENGTH] *= -1.0
    ahead = forward.record if forward is not None else nothing
    table = np.concatenate([behind, middle, ahead])
    stops = walk.stops_of((backward, forward))
    u, tangent = table[:, :size], table[:, size : 2 * size]
    # On the way scales grow, and tangents are of length 1 in those of their point.
    length = np.sqrt(tangent**2 @ curve.weight)
    grown = (length > 0.0) & (np.abs(length - 1.0) > GROWN)
    tangent[grown] /= length[grown, None]
    slopes: Array | Slopes = Slopes(curve, u)
    if curve.keeps:
        kept = [start.slopes.reshape(1, -1)]
        if backward is not None:
            kept.insert(0, backward.slopes[::-1])
        if forward is not None:
            kept.append(forward.slopes)
        slopes = np.concatenate(kept).reshape(-1, n, m)
    # Sizes of terms need few digits.
    residual = curve.residuals(u, slopes if curve.keeps else Slopes(curve, u, sharp=False))
    fixed = _fixed(curve, u, len(behind), stops)
    better, left, message = accepted(curve, u, tangent, residual, fixed)
    for i, found in better.items():
        u[i] = found
        where = curve.evaluate(found)[1]
        known = curve.field.exact  # sharp derivatives are the same
        residual[i] = left[i] if known else curve.residuals(found[None], where[None])[0]
        if isinstance(slopes, np.ndarray):
            slopes[i] = where
    values = None
    if isinstance(slopes, np.ndarray):
        slopes, values = sharpened(curve, u, slopes)
    return Path(
        u, tangent, slopes, table[:, -trace.RECORDED :], len(behind), stops, residual, values,
        (message,) if message else (),
    )  # fmt: skip


def _fixed(curve: Curve, u: Array, start: int, stops: tuple[Stop, Stop]) -> dict[int, int]:
    """Points that keep an unknown to the last bit: the start its parameter, ends their bound."""
    fixed = {start: curve.n}
    for i, stop in zip((0, len(u) - 1), stops, strict=True):
        met = np.flatnonzero((u[i] == curve.low) | (u[i] == curve.high))
        if stop.reason == "bound" and len(met):
            fixed[i] = int(met[0])
    return fixed


@dataclass(frozen=True)
class Slopes:
    """Derivatives of f at points, taken where they are asked for."""

    curve: Curve
    u: Array
    sharp: bool = True

    def __getitem__(self, places: Any) -> Array:
        """Those at one point, or at several."""
        if np.ndim(self.u[places]) == 1:
            return self.curve.evaluate(self.u[places], sharp=self.sharp)[1]
        return np.array([self.curve.evaluate(u, sharp=self.sharp)[1] for u in self.u[places]])

    def chunks(self) -> Iterator[slice]:
        """The points, so many at a time that their derivatives take little memory."""
        step = max(1, MOST // (self.curve.n * self.curve.m))
        for first in range(0, len(self.u), step):
            yield slice(first, min(first + step, len(self.u)))


def sharpened(curve: Curve, u: Array, slopes: Array) -> tuple[Array, npt.NDArray[np.complex128]]:
    """Derivatives at the points themselves, where the sign of an eigenvalue could hang on it.

    And the eigenvalues.

    A trace leaves those of the point before the last Newton step. On curves of special points an
    eigenvalue is zero everywhere, and its sign says nothing.
    """
    accuracy = curve.field.accuracy
    values = eigenvalues_of(curve.linear(slopes), accuracy=accuracy)
    if curve.kind not in REGULAR:
        return slopes, values
    size = largest(values)
    if curve.kind == EVENT and curve.n == 1:  # f_x alone is no scale of itself
        size = largest(slopes[:, 0] * (curve.scale[: curve.m] / curve.scale[0]))
    with np.errstate(all="ignore"):
        least = across(np.minimum, np.abs(curve.growth(values)))
        doubtful = least < DOUBTFUL * np.nanmax(size)
    if doubtful.any():
        for i in np.flatnonzero(doubtful):
            slopes[i] = curve.evaluate(u[i])[1]
        values[doubtful] = eigenvalues_of(curve.linear(slopes[doubtful]), accuracy=accuracy)
    return slopes, values


def between(curve: Curve, a: Sample, b: Sample, fraction: float) -> Sample | None:
    """The point of the curve at a fraction of the chord from a to b; None if it is not found."""
    chord = b.u - a.u
    row = curve.weight * chord
    h = curve.length(chord)
    if not h > 0.0:
        return None
    s = fraction
    # The cubic with the tangents of both ends.
    guess = (
        a.u
        + (3.0 - 2.0 * s) * s * s * chord
        + h * s * (1.0 - s) * ((1.0 - s) * a.tangent - s * b.tangent)
    )
    guess += (s - np.dot(row, guess - a.u) / np.dot(row, chord)) * chord
    if curve.kind in (HOPF, TORUS):
        curve, guess = in_phase(curve, a if s < 0.5 else b, guess)
    point = curve.refine(guess, row)
    if not point.converged or curve.length(point.u - guess) > 0.5 * h:
        return None
    sign = 1.0 if np.dot(row, point.tangent) >= 0.0 else -1.0
    return Sample(point.u, sign * point.tangent, point.slopes)


def in_phase(curve: Curve, near: Sample, guess: Array) -> tuple[Curve, Array]:
    """A curve of pairs whose phase condition is that of a point of it, and v as it is there.

    A trace turns v in its plane from time to time.
    """
    n, m = curve.n, curve.m
    sizes = curve.scale[m : m + n]
    v = near.u[m : m + n] / sizes
    y = near.slopes[:, :n] @ (v * sizes) / sizes
    y = y - np.dot(v, y) / np.dot(v, v) * v
    length = float(np.linalg.norm(y))
    if not length > 0.0:
        return curve, guess
    guess = guess.copy()
    guess[m : m + n] = near.u[m : m + n]
    return curve.replace(aux=y / length / sizes), guess


def bracket_root(
    curve: Curve,
    a: Sample,
    b: Sample,
    test: Callable[[Sample], float],
    *,
    steps: int,
    width: float,
    near: float = 0.0,
) -> tuple[Sample, Sample, Sample]:
    """Narrow a change of sign of a test function: the best sample, and the two around it.

    Bisection and regula falsi by turns (Illinois), on the chord between two points; to a width, or
    until the value is ``near`` times those at the ends, from where Newton's method goes on.
    """
    left, right = a, b
    low, high = 0.0, 1.0
    at_low, at_high = test(a), test(b)
    best = a if abs(at_low) < abs(at_high) else b
    least = min(abs(at_low), abs(at_high))
    enough = near * least
    side = 0
    for step in range(steps):
        s = 0.5 * (low + high)
        if step % 3 < 2 and np.isfinite(at_low) and np.isfinite(at_high) and at_low != at_high:
            s = (low * at_high - high * at_low) / (at_high - at_low)
            s = min(max(s, low + 0.02 * (high - low)), high - 0.02 * (high - low))
        sample = between(curve, a, b, s)
        if sample is None:
            sample = between(curve, a, b, 0.5 * (low + high) + 0.1234 * (high - low))
            s = 0.5 * (low + high) + 0.1234 * (high - low)
            if sample is None:
                break
        value = test(sample)
        if abs(value) < least or not np.isfinite(least):
            best, least = sample, abs(value)
        if value == 0.0 or abs(value) <= enough:
            break
        if (value > 0.0) == (at_high > 0.0):
            high, at_high, right = s, value, sample
            at_low *= 0.5 if side == 1 else 1.0
            side = 1
        else:
            low, at_low, left = s, value, sample
            at_high *= 0.5 if side == -1 else 1.0
            side = -1
        if high - low < width:
            break
    return best, left, right


SAME = 1e-7  # distance on scaled axes


def lies_on(curve: Curve, path: Path, u: Array) -> bool:
    """Whether the curve of a path goes through a point of the same problem, given as far as m."""
    m = curve.m
    weight = 1.0 / curve.scale[:m] ** 2
    if not path.count:
        return False
    gap = turned(curve, u[:m] - path.u[:, :m])
    distance = np.sqrt(np.sum(weight * gap**2, axis=1))
    if np.min(distance) < SAME:
        return True
    chord = np.diff(path.u[:, :m], axis=0)
    square = np.sum(weight * chord**2, axis=1)
    along = np.sum(weight * chord * gap[:-1], axis=1) / np.where(square > 0.0, square, 1.0)
    across = np.sqrt(
        np.sum(weight * (gap[:-1] - np.clip(along, 0.0, 1.0)[:, None] * chord) ** 2, axis=1)
    )
    length = np.sqrt(square)
    near = np.flatnonzero((across < 0.3 * length + SAME) & (along > -0.05) & (along < 1.05))
    for i in near:
        row = np.zeros(curve.size)
        row[:m] = weight * chord[i]
        s = along[i]
        target = path.u[i, :m] + gap[i]
        step = path.u[i + 1] - path.u[i]
        guess = (
            path.u[i]
            + (3.0 - 2.0 * s) * s * s * step
            + curve.length(step) * s * (1.0 - s)
            * ((1.0 - s) * path.tangent[i] - s * path.tangent[i + 1])
        )  # fmt: skip
        here = curve
        if curve.kind in (HOPF, TORUS):
            k = int(i) + int(s > 0.5)
            sample = Sample(path.u[k], path.tangent[k], path.slopes[k])
            here, guess = in_phase(curve, sample, guess)
        point = here.refine(guess, row, float(np.dot(row[:m], target)))
        if point.converged:
            off = turned(curve, point.u[:m] - target)
            if np.sqrt(np.sum(weight * off**2)) < SAME:
                return True
    return False


def accepted(
    curve: Curve, u: Array, tangent: Array, residual: Array, fixed: dict[int, int]
) -> tuple[dict[int, Array], Array, str]:
    """Points of a path that are better than those it has, by their places, and what is left.

    Of f beside its terms at all points, and in words.

    residual: |f| beside its terms at each point; fixed: the unknown that keeps its value, of
    points where one does: at the start and at bounds.
    """
    bound = ROUNDING if curve.field.exact else INSIDE
    better: dict[int, Array] = {}
    left = np.array(residual)
    vain = 0
    poor = np.flatnonzero(~(residual <= bound))
    if curve.options.tolerance < RAISED:
        for i in (k for k in fixed if 0.0 < residual[k] <= bound):  # ends are special points
            found, value = nearer(curve, u[i], tangent[i], float(residual[i]), fixed[i])
            if value < residual[i]:
                better[i], left[i] = found, value
        for i in poor.tolist():
            found, value = nearer(curve, u[i], tangent[i], float(residual[i]), fixed.get(i))
            if value < residual[i]:
                better[i], left[i] = found, value
            vain = 0 if value <= bound or value < 0.5 * residual[i] else vain + 1
            if vain >= VAIN:
                break
    poor = np.flatnonzero(~(left <= bound))
    if not len(poor):
        return better, left, ""
    return better, left, _residual_words(curve, [better.get(i, u[i]) for i in poor.tolist()], bound)


def on_bound(curve: Curve, track: Track) -> Track:
    """A track that is stuck next to a branch point on a bound, brought there.

    Newton's method has nothing to hold on to where f_x is singular.
    """
    if track.stop.reason != "stuck" or curve.kind != EQUILIBRIUM or not len(track.record):
        return track
    m = curve.m
    u, t = track.record[-1, :m], track.record[-1, m : 2 * m]
    with np.errstate(all="ignore"):
        bound = np.where(t > 0.0, curve.high, curve.low)
        length = np.where(t != 0.0, (bound - u) / t, np.inf)
    j = int(np.argmin(length))
    if not 0.0 <= length[j] <= BESIDE:
        return track
    u = u + length[j] * t
    u[j] = bound[j]
    value, slopes = curve.evaluate(u)
    if not np.all(np.abs(value) <= ROUNDING * (np.abs(slopes) @ np.abs(u))):
        return track
    record, state = track.record.copy(), track.state.copy()
    record[-1, :m] = state[:m] = u
    return replace(track, record=record, state=state, stop=curve.stop_of(BOUND, j, state))


def nearer(
    curve: Curve, u: Array, tangent: Array, residual: float, fixed: int | None
) -> tuple[Array, float]:
    """The best of a point, of what Newton's method makes of it, and of their rounded zeros."""
    row = curve.weight * tangent
    if fixed is not None:
        row = np.zeros(curve.size)
        row[fixed] = 1.0
    point = curve.refine(u, row, tolerance=TIGHT)
    tried = [u]
    if point.converged and curve.length(point.u - u) <= NEAR:
        again = np.array(point.u)
        if fixed is not None:
            again[fixed] = u[fixed]
        tried.append(again)
    tried += [without_rounding(curve, one) for one in tried]
    best, least = u, residual
    for i, one in enumerate(tried):
        if not any(np.array_equal(one, other) for other in (u, *tried[:i])):
            value = residual_at(curve, one)
            if value < least:
                best, least = one, value
    return best, least


def residual_at(curve: Curve, u: Array) -> float:
    """|f| beside its terms at one point, whose sizes need few digits."""
    return float(curve.residuals(u[None], curve.evaluate(u, sharp=False)[1][None])[0])


def without_rounding(curve: Curve, u: Array) -> Array:
    """A point of a branch of equilibria whose unknowns are zero where they are but rounding."""
    u = np.array(u)
    if curve.kind == EQUILIBRIUM:
        u[: curve.m][np.abs(u[: curve.m]) <= EPSILON * curve.scale[: curve.m]] = 0.0
    return u


def rounded(curve: Curve, u: Array) -> Array:
    """`without_rounding`, where f is no larger there."""
    zeros = without_rounding(curve, u)
    if np.array_equal(zeros, u) or residual_at(curve, zeros) > residual_at(curve, u):
        return u
    return zeros


def _residual_words(curve: Curve, points: list[Array], bound: float) -> str:
    """What is left of f, in words; nothing if unknowns of their scales would leave as much."""
    sizes = []
    for u in points:
        value, slopes = curve.evaluate(u)
        terms = np.abs(slopes) @ np.maximum(np.abs(u[: curve.m]), curve.scale[: curve.m])
        with np.errstate(all="ignore"):
            sizes.append(np.max(np.where(value == 0.0, 0.0, np.abs(value) / terms)))
    many = int(np.sum(~(np.array(sizes) <= bound)))
    if not many:
        return ""
    u = points[int(np.argmax(np.nan_to_num(sizes, nan=np.inf)))]
    names = [*curve.field.states, *(curve.field.parameters[i] for i in curve.active)]
    where = [f"{name} = {number:.6g}" for name, number in zip(names, u, strict=False)]
    where = where if len(where) <= 4 else [*where[:3], "..."]
    noise = np.all(np.abs(curve.evaluate(u)[0]) <= 10.0 * Derivatives(curve, u).noise())
    return (
        f"{many} points solve f = 0 to {max(sizes):.1e} of its terms, which exceeds rounding"
        f"{' of numbers: f itself is not known better' if noise else ''}; the worst at "
        f"{', '.join(where)}"
    )
