"""One curve of equilibria, folds, Hopf or branch points: its points, and how it is followed."""

from __future__ import annotations

import functools
import math
import time
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any, ClassVar, Self

import numpy as np
import numpy.typing as npt

from phasekit.arrays import Array
from phasekit.bifurcation.continuation import walk
from phasekit.bifurcation.continuation.fields import Field
from phasekit.bifurcation.continuation.functions import Event, Formula
from phasekit.bifurcation.continuation.kernels import defining, newton, trace
from phasekit.bifurcation.continuation.kernels.defining import (
    BEFORE,
    EQUILIBRIUM,
    EVENT,
    NEXT,
    NUMBERS,
    POINT,
    SCALE,
    START,
    START_TANGENT,
    TANGENT,
    VECTORS,
    WEIGHT,
)
from phasekit.bifurcation.continuation.options import ContinuationOptions
from phasekit.bifurcation.continuation.walk import Stop as Stop
from phasekit.bifurcation.continuation.walk import track_stop
from phasekit.numerics import differences
from phasekit.numerics.interrupts import may_end
from phasekit.numerics.waits import stage

CHUNK = 256
QUICK = 0.05  # seconds within which a chunk is made before the next is longer
MOST = 1 << 20  # derivatives at a time, where they are not kept
KEPT = 16  # states up to which derivatives are kept at each point
NEUTRAL = 10  # states up to which neutral saddles are looked for unasked
LAST = 16  # points whose derivatives are remembered
TIGHT = 1e-13
EPSILON = 2.0**-52
APART = 7.7e-13  # neighbours that show rounding; no power of two, which would hide it
STEPS = np.arange(-8.0, 9.0)  # of neighbours


@dataclass(frozen=True)
class Point:
    """A point of a curve: unknowns, unit tangent, residual G and the derivatives of f."""

    u: Array
    tangent: Array
    residual: Array
    slopes: Array
    converged: bool  # whether Newton's method came to an end


@dataclass(frozen=True)
class Track(walk.Track):
    """Points of a curve in one direction from a start, and the state to go on from.

    Of many states the derivatives of f are not kept (no columns): they would be most of it all.
    """

    record: Array
    slopes: Array
    state: Array
    stop: Stop
    rows: ClassVar[tuple[str, ...]] = ("record", "slopes")


class Derived:
    """What follows from the fields of a curve."""

    n: int  # number of states
    m: int  # of states and free parameters
    size: int  # of unknowns
    rows: int  # of equations
    keeps: bool  # whether the derivatives of f are kept at each point
    #: What is looked for: neutral saddles of few states come with Hopf points.
    detect: tuple[str, ...]
    compiled: bool  # whether all that is followed has machine code
    _places: npt.NDArray[np.int64]  # of the free parameters, for kernels
    #: What was last asked for of derivatives: special points ask for the same many times.
    _memory: dict[tuple[Any, ...], Any]


@dataclass(frozen=True, eq=False)
class Curve(Derived):
    """What defines a curve: the field, its free parameters, and how lengths are measured."""

    field: Field  # the right-hand side
    kind: int  # EQUILIBRIUM, FOLD, HOPF, BRANCH or EVENT; of maps FLIP or TORUS, too
    par: Array  # all parameters; those that are free are not used
    active: tuple[int, ...]  # places of the free parameters
    scale: Array  # sizes of the unknowns (states, free parameters and the rest)
    period: Array  # periods of angles among the unknowns, 0 for others
    low: Array  # bounds of the unknowns
    high: Array
    options: ContinuationOptions
    aux: Array | None = None  # the vector l of a Hopf curve
    conservative: bool = False  # whether energy is conserved
    events: tuple[Event, ...] = ()  # functions whose zeros are looked for
    #: Names of events, kinds and labels of special points at which the curve ends.
    ends: tuple[str, ...] = ()
    discrete: bool = False  # whether the field is f(x) - x of a map f
    held: Event | None = None  # the function that is zero all along a curve of events

    def __post_init__(self) -> None:
        """Keep what follows from the fields."""
        n, free, asked = len(self.field.states), len(self.active), self.options.detect
        if "hopf" in asked and n <= NEUTRAL and "neutral_saddle" not in asked:
            asked = (*asked, "neutral_saddle")
        held = None if self.held is None else self.held.function
        vars(self).update(
            n=n,
            m=n + free,
            size=defining.unknowns(self.kind, n, free),
            rows=defining.equations(self.kind, n, free),
            keeps=self.kind != EQUILIBRIUM or n <= KEPT,
            detect=asked,
            compiled=self.field.compiled and (self.kind != EVENT or isinstance(held, Formula)),
            _places=np.array(self.active, dtype=np.int64),
            _memory={},
        )

    @property
    def knows_slopes(self) -> bool:
        """Whether derivatives by the states are given, and no differences."""
        return self.field.exact or bool(getattr(self.field, "jacobian", None))

    @functools.cached_property
    def weight(self) -> Array:
        """Weights of lengths: of the mean square of states, and of free parameters."""
        weight = np.zeros(self.size)
        weight[: self.m] = 1.0 / self.scale[: self.m] ** 2
        weight[: self.n] /= self.n
        weight.flags.writeable = False
        return weight

    def length(self, difference: Array) -> float:
        """Length of a difference of unknowns."""
        return math.sqrt(np.add.reduce(self.weight * difference**2))

    @property
    def _held(self) -> Any:
        assert self.held is not None
        return self.held.function

    def _kernel(self, kernel: Any, compiled: bool | None = None) -> Any:
        compiled = self.field.compiled if compiled is None else compiled
        return kernel if compiled else kernel.py_func

    def _first(self, sharp: bool) -> tuple[Any, int]:
        self.field.prepare(self.scale[: self.m])
        differs = sharp and self.field.mode == differences.PLAIN
        mode = differences.SHARP if differs else self.field.mode
        return self.field.first(self.active, sharp=sharp), mode

    def _functions(self, *, sharp: bool = False) -> tuple[Any, Any, int]:
        first, mode = self._first(sharp)
        if self.kind == EQUILIBRIUM:
            return first, first, mode
        if self.kind != EVENT:
            return first, self.field.second(self.active), mode
        held = self._held
        if self.compiled:
            return first, held.code(self.active), mode
        if self.field.compiled:  # where kernels are interpreted

            def first(u: Array, par: Array, z: Array, out: Array) -> None:
                out[: self.n * (1 + self.m)] = np.append(*self.evaluate(u, sharp=sharp))

            mode = differences.DERIVED

        def event(u: Array, par: Array, z: Array, out: Array) -> None:
            out[: 1 + self.m] = held.slopes(self, u)

        return first, event, mode

    def refine(
        self,
        u: Array,
        row: Array | None = None,
        target: float | None = None,
        *,
        tolerance: float | None = None,
        iterations: int = 20,
    ) -> Point:
        """Newton's method from u, in the plane row.u = target (default: through u)."""
        size, rows, n, m = self.size, self.rows, self.n, self.m
        w = self._work(u)
        place = VECTORS * size + NUMBERS + n
        row = np.zeros(size) if row is None else row
        w[place + size : place + 2 * size] = row
        aim = float(np.dot(row, u)) if target is None else target
        kernel = self._kernel(newton.refine, self.compiled)
        with np.errstate(all="ignore"):
            steps = kernel(
                *self._functions(sharp=True), self.kind, n, self.par.copy(),
                self._places, w, aim,
                self.options.tolerance if tolerance is None else tolerance, iterations,
            )  # fmt: skip
        places = defining.places(self.kind, n, len(self.active))
        base, g = places[6], places[7]
        point = w[place : place + size].copy()
        tangent = w[place + 2 * size : place + 3 * size].copy()
        length = self.length(tangent)
        if length > 0.0:
            tangent /= length
        if not np.isfinite(point).all():
            steps = -1
        return Point(
            point, tangent, w[g : g + rows].copy(), w[base + n : base + n + n * m].reshape(n, m),
            bool(steps > 0),
        )  # fmt: skip

    def equations_at(self, u: Array) -> tuple[Array, Array]:
        """The defining system at its unknowns: G and its Jacobian."""
        size, rows, n, free = self.size, self.rows, self.n, len(self.active)
        w = self._work(u)
        with np.errstate(all="ignore"):
            self._kernel(newton.refine, self.compiled)(
                *self._functions(sharp=True), self.kind, n, self.par.copy(), self._places, w, 0.0,
                TIGHT, 0,
            )  # fmt: skip
        g, jacobian = defining.places(self.kind, n, free)[7:9]
        return w[g : g + rows], w[jacobian : jacobian + rows * size].reshape(rows, size)

    def _work(self, u: Array) -> Array:
        """The work array with scales, l and unknowns in their places."""
        size, n = self.size, self.n
        w = np.zeros(defining.work_size(self.kind, n, len(self.active)))
        w[3 * size : 4 * size] = self.scale
        head = VECTORS * size + NUMBERS
        if self.aux is not None:
            w[head : head + n] = self.aux
        w[head + n : head + n + size] = u
        return w

    def _once(self, make: Callable[..., Any], *given: Any) -> Any:
        key = (make.__name__, *(z.tobytes() if isinstance(z, np.ndarray) else z for z in given))
        found = self._memory.get(key)
        if found is None:
            if len(self._memory) >= min(LAST, MOST // (self.n * self.m)):
                self._memory.clear()
            found = self._memory[key] = make(*given)
        return found

    def evaluate(self, u: Array, *, sharp: bool = True) -> tuple[Array, Array]:
        """F and its derivatives by states and free parameters, to a few digits unless sharp."""
        value, slopes = self._once(self._evaluate, np.asarray(u[: self.m], dtype=float), sharp)
        return value.copy(), slopes.copy()

    def _evaluate(self, u: Array, sharp: bool) -> tuple[Array, Array]:
        n, m = self.n, self.m
        out = 2 * m
        spare = out + n + n * m
        w = np.zeros(spare + differences.spare_size(n, m) + n + n * m + 4 * m)
        w[:m], w[m:out] = u, self.scale[:m]
        first, mode = self._first(sharp)
        kernel = self._kernel(defining.first_derivatives)
        with np.errstate(all="ignore"):
            kernel(first, mode, n, w, 0, self.par.copy(), self._places, m, out, spare)
        return w[out : out + n], w[out + n : spare].reshape(n, m)

    def values(self, u: Array) -> Array:
        """F at many points, the rows of u."""
        u = np.ascontiguousarray(u[:, : self.m], dtype=float)
        with np.errstate(all="ignore"):
            return np.asarray(self.field.values(u, self.par.copy(), self.active))

    def residuals(self, u: Array, slopes: Any) -> Array:
        """Largest size of an entry of f beside its terms, at many points, the rows of u.

        The terms of a formula are those of its sums; of a function, what its derivatives (indexed
        by points) make of the unknowns, in units of their scales at least.
        """
        n, m = self.n, self.m
        points = np.ascontiguousarray(u[:, :m], dtype=float)
        with np.errstate(all="ignore"):
            if self.field.exact:
                value, terms = self.field.with_terms(points, self.par.copy(), self.active)
                value = np.abs(value)
            else:
                value = np.abs(self.values(points))
                terms = np.empty_like(value)
                sizes = np.maximum(np.abs(points), self.scale[:m])
                chunk = max(1, MOST // (n * m))
                for k in range(0, len(points), chunk):
                    some = slice(k, k + chunk)
                    terms[some] = np.einsum("kij,kj->ki", np.abs(slopes[some]), sizes[some])
                if self.field.steps > 1:  # f^n(x) and x themselves, whose slopes may cancel
                    terms += sizes[:, :n]
            if isinstance(slopes, np.ndarray):  # what Newton's method takes for zero
                nothing = newton.NOTHING * (np.abs(slopes) @ self.scale[:m])
                few = np.flatnonzero(np.any((value > 0.0) & (value <= nothing), axis=1))
                if len(few):
                    least = newton.NOTHING * self.scale[:m]
                    zeroed = np.where(np.abs(points[few]) <= least, 0.0, points[few])
                    sizes = np.einsum("kij,kj->ki", np.abs(slopes[few]), np.abs(zeroed))
                    zero = np.abs(self.values(zeroed)) <= newton.ROUNDING * sizes
                    value[few] = np.where(zero & (value <= nothing)[few], 0.0, value[few])
            ratio = np.where(value > 0.0, value / terms, 0.0)
            return np.asarray(np.maximum.reduce(np.ascontiguousarray(ratio.T)))

    def linear(self, slopes: Array) -> Array:
        """The matrix whose eigenvalues decide: f_x, of a map that of the map itself."""
        matrix = slopes[..., : self.n]
        return matrix + np.eye(self.n) if self.discrete else matrix

    def growth(self, values: npt.NDArray[np.complex128]) -> Array:
        """What is positive of unstable eigenvalues: the real part, of a map the size less 1."""
        return np.abs(values) - 1.0 if self.discrete else values.real

    def bend(self, u: Array, z: Array) -> Array:
        """The derivatives of f_u z by states and free parameters, shape (n, m)."""
        full = np.zeros(self.m)
        full[: z.size] = z
        bent: Array = self._once(self._bend, np.asarray(u[: self.m], dtype=float), full)
        return bent.copy()

    def _bend(self, u: Array, z: Array) -> Array:
        jet = self.n * (1 + self.m)
        out = self._derive(self.field.second(self.active), u, z, jet + self.n * self.m)
        return out[jet:].reshape(self.n, self.m)

    def bend_all(self, u: Array, z: Array) -> Array:
        """`bend` at many points (rows of u), each with its own direction, shape (count, n, m)."""
        n, m = self.n, self.m
        out = np.empty((len(u), n * m))
        first, second = self.field.first(self.active), self.field.second(self.active)
        self.field.prepare(self.scale[:m])
        with np.errstate(all="ignore"):
            self._kernel(defining.bend_all)(
                first, second, self.field.mode, n, self.par.copy(),
                self._places, self.scale[:m].copy(),
                np.ascontiguousarray(u[:, :m]), np.ascontiguousarray(z), out,
            )  # fmt: skip
        return out.reshape(-1, n, m)

    def twist(self, u: Array, a: Array, b: Array, c: Array) -> Array:
        """The third derivative of f along three directions, of a symbolic field."""
        third = self.field.third(self.active)
        return self._derive(third, u, np.concatenate([a, b, c]), self.n)

    def derivative(self, u: Array, *z: Array) -> Array:
        """The derivative of f along as many directions as are given, of a symbolic field."""
        function = self.field.derivative(self.active, len(z))
        return self._derive(function, u, np.concatenate(z), self.n)

    def _derive(self, function: Any, u: Array, z: Array, count: int) -> Array:
        n, m = self.n, self.m
        place = 2 * m
        out = place + z.size
        w = np.zeros(out + count + differences.spare_size(n, m))
        w[:m], w[m:place], w[place:out] = u[:m], self.scale[:m], z
        self.field.prepare(self.scale[:m])
        kernel = self._kernel(defining.second_derivatives)
        with np.errstate(all="ignore"):
            kernel(
                self.field.first(self.active), function, self.field.mode, n, w, 0, self.par.copy(),
                self._places, m, place, out, out + count,
            )  # fmt: skip
        return w[out : out + count].copy()

    def start_state(self, u: Array, tangent: Array) -> Array:
        """The state of a trace that begins at a point, in the direction of its tangent."""
        size, n = self.size, self.n
        w = np.zeros(VECTORS * size + NUMBERS + n)
        vectors = w[: VECTORS * size].reshape(VECTORS, size)
        vectors[POINT] = vectors[START] = u
        vectors[SCALE], vectors[WEIGHT] = self.scale, self.weight
        vectors[[TANGENT, BEFORE, START_TANGENT]] = tangent / self.length(tangent)
        w[VECTORS * size + NEXT] = self.options.initial_step
        if self.aux is not None:
            w[VECTORS * size + NUMBERS :] = self.aux
        return w

    def follow(self, state: Array, points: int) -> Track:
        """Follow the curve from a state for at most so many points."""
        size, n, free = self.size, self.n, len(self.active)
        o = self.options
        settings = [o.max_step, o.min_step, o.tolerance, o.max_iterations, o.turn, o.max_turn]
        fixed = np.concatenate([settings, self.period, self.low, self.high])
        w = np.zeros(defining.work_size(self.kind, n, free))
        w[: state.size] = state
        kernel = self._kernel(trace.trace, self.compiled)
        functions = self._functions()
        columns = 2 * size + trace.RECORDED
        most = CHUNK if self.keeps else max(1, min(CHUNK, MOST // (n * self.m)))
        chunk = most if self.compiled else 1  # points that an interruption may cost
        found = [(np.empty((0, columns)), np.empty((0, n * self.m if self.keeps else 0)))]
        reason, which, left = trace.FULL, 0, points
        with np.errstate(all="ignore"):
            while reason == trace.FULL and left > 0:
                record = np.empty((min(left, chunk), columns))
                slopes = np.empty((len(record), n * self.m))
                before, began = w[: state.size].copy(), time.monotonic()
                try:
                    with may_end():
                        count, reason, which = kernel(
                            *functions, self.kind, n, self.par.copy(), self._places, fixed, w,
                            record, slopes,
                        )  # fmt: skip
                except KeyboardInterrupt:
                    w[: state.size] = before
                    reason = trace.INTERRUPTED
                    break
                found.append((record[:count], slopes[:count] if self.keeps else slopes[:count, :0]))
                left -= count
                if time.monotonic() - began < QUICK:
                    chunk = min(2 * chunk, most)
                stage(f"{points - left:,} points")
        record, slopes = (np.concatenate(parts) for parts in zip(*found, strict=True))
        last = record[-1:, : self.m]
        if reason in (trace.NOT_FINITE, trace.STUCK) and not np.isfinite(self.values(last)).all():
            # Newton's last step led out of the domain of f.
            record, slopes = record[:-1], slopes[:-1]
        return Track(record, slopes, w[: state.size].copy(), self.stop_of(reason, which, w))

    def stop_of(self, reason: int, which: int, w: Array) -> Stop:
        """Say why a track ends in the state w."""
        if reason == trace.NOT_FINITE and self.field.failure is not None:
            self._fail_beyond(w)
        return track_stop(self, reason, which, w)

    def _fail_beyond(self, w: Array) -> None:
        """Let the field tell of what f raises next on the way, not of what it raised elsewhere."""
        known, self.field.failure = self.field.failure, None
        u, tangent = (w[k * self.size :][: self.m] for k in (POINT, TANGENT))
        step = self.options.min_step
        while step <= self.options.max_step:
            value, slopes = self._evaluate(u + step * tangent, False)
            if not (np.isfinite(value).all() and np.isfinite(slopes).all()):
                return
            step *= 2.0
        self.field.failure = known

    def replace(self, **changes: Any) -> Self:
        """A copy with changes."""
        return replace(self, **changes)


def neighbours(points: Array) -> Array:
    """Points in a row around each of several, along the last axis but one, that show rounding."""
    near = points[..., None, :] + STEPS[:, None] * (APART * np.abs(points))[..., None, :]
    return near.reshape(*points.shape[:-2], -1, points.shape[-1])


def rounding_shown(found: Array) -> Array:
    """What differences of neighbours in a row, along the last axis but one, show of rounding."""
    noise = EPSILON * np.abs(found).max(axis=-2, initial=0.0)
    for order in range(1, 6):
        found = found[..., 1:, :] - found[..., :-1, :]
        if order >= 4:
            size = math.factorial(2 * order) / math.factorial(order) ** 2
            level = np.sqrt((found**2).mean(axis=-2) / size)
            noise = np.maximum(noise, np.where(np.isfinite(level), level, 0.0))
    return np.asarray(noise)
