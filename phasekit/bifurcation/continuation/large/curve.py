"""A curve of equilibria of many states: Newton's method by block elimination, and how it is walked.

Lengths are means over the states, of each block in units of its own size, so that more cells of the
same field make no shorter steps. A step takes one factorisation, at the predicted point; what
follows is refined with it.
"""

from __future__ import annotations

import functools
from dataclasses import dataclass, field, replace
from typing import Any, ClassVar

import numpy as np

from phasekit.arrays import Array
from phasekit.bifurcation.continuation import walk
from phasekit.bifurcation.continuation.curve import Curve
from phasekit.bifurcation.continuation.kernels import newton, trace
from phasekit.bifurcation.continuation.kernels.step import CROSSES, TURNS
from phasekit.bifurcation.continuation.large.field import OMEGA, SparseField
from phasekit.bifurcation.continuation.walk import Stop, place_of, stuck, track_stop
from phasekit.numerics.factors import Bordered, Factors, inner, is_symmetric
from phasekit.numerics.interrupts import may_end
from phasekit.numerics.memory import HALTS, why_halted
from phasekit.numerics.waits import stage

SLOW = 0.2  # ratio of steps from which on a matrix is factored anew
# Where branches cross, factors know a tangent to rounding over the square of such a step.
CAREFUL = 1e-4
LOOSE = "; up to here f along one direction, as that of a shift, was within rounding"
FAR = 0.25  # of a step, by which a point may be off where it was expected
SMALL = 1e-9  # steps that may be rounding
EPSILON = 2.0**-52
ROUNDING = 64.0 * EPSILON  # of terms that cancel
REFINED = 8  # refinements of a tangent
CLOSE = 1e-13
PASSES = 3  # of inverse iteration to a null vector, from one by chance
TRIES, UNSEEN = 6, 1e-3  # passes in which a vector by chance is to vanish, and its size then


@dataclass(frozen=True)
class Corrected:
    """What Newton's method makes of a point: the point, its derivatives, and factors next to it."""

    u: Array
    matrix: Any  # f_x at the point
    slope: Array  # f by the parameter
    tangent: Array  # of unit length
    bordered: Any  # None where they are not kept
    steps: int
    residual: float  # |f| beside its terms

    @property
    def factors(self) -> Factors:
        """Those of f_x."""
        found: Factors = self.bordered.matrix
        return found


@dataclass(frozen=True)
class Held:
    """A direction along which rounding moves a point, as that of a shift which hardly matters.

    Steps have no part of it, where what they leave of f along ``left`` is rounding.
    """

    left: Array  # the left null vector of the bordered matrix
    row: Array  # lengths along the right one are products with it

    def without(self, bordered: Bordered, step: Array) -> Array:
        """The rest of a solution of the bordered matrix, which solves it but for ``left``."""
        right = bordered.solve_again(self.left)
        return np.asarray(step - inner(self.row, step) / inner(self.row, right) * right)

    def leaves_rounding(self, value: Array, terms: Array) -> bool:
        """Whether what is left of equations is rounding of their terms."""
        return is_rounding(self.left[: len(value)], value, terms)


def is_rounding(left: Array, value: Array, terms: Array) -> bool:
    """Whether a product with values is rounding of their terms."""
    return bool(abs(inner(left, value)) <= ROUNDING * inner(np.abs(left), terms))


@dataclass(frozen=True)
class State:
    """All that a walk needs to go on as if it had never stopped."""

    u: Array
    tangent: Array
    before: Array
    scale: Array
    start: Array
    start_tangent: Array
    step: float
    last: float = 0.0
    length: float = 0.0
    done: int = 0
    side: float = 0.0
    held: float = 0.0  # whether a direction was held at the last step

    def __getitem__(self, places: Any) -> Any:
        """Unknowns of its point."""
        return self.u[places]


@dataclass(frozen=True)
class Track(walk.Track):
    """Points in one direction from a start, with what changes its sign at special points.

    ``tests`` are the tangent's part along the parameter, on scaled axes, the sign of the bordered
    determinant, and how many eigenvalues are positive (-1: not known).
    """

    u: Array
    info: Array
    tests: Array
    residual: Array
    state: State
    stop: Stop
    rows: ClassVar[tuple[str, ...]] = ("u", "info", "tests", "residual")


@dataclass(frozen=True, eq=False)
class LargeCurve(Curve):
    """Equilibria of many states over one parameter.

    Attributes
    ----------
    blocks : tuple of (str, int)
        Names of fields of states and how many states each has, in order.
    symmetric : bool
        Whether f_x is symmetric at the start: pivots count its eigenvalues as long as it stays so.
    """

    blocks: tuple[tuple[str, int], ...] = field(default=())
    symmetric: bool = False

    @functools.cached_property
    def sparse(self) -> SparseField:
        """The right-hand side."""
        assert isinstance(self.field, SparseField)
        return self.field

    @functools.cached_property
    def free(self) -> str:
        """The free parameter."""
        return self.field.parameters[self.active[0]]

    @property
    def places(self) -> dict[str, slice]:
        """The states of each block."""
        ends = np.cumsum([0, *(count for _, count in self.blocks)]).tolist()
        return {name: slice(ends[k], ends[k + 1]) for k, (name, _) in enumerate(self.blocks)}

    @property
    def beside(self) -> dict[str, int]:
        """Unknowns beside the fields and the free parameter that belong to a point: none."""
        found: dict[str, int] = self.sparse.beside
        return found

    def parameters_at(self, u: Array) -> dict[str, float]:
        """All parameters at a point."""
        p = dict(zip(self.field.parameters, self.par.tolist(), strict=True))
        p[self.free] = float(u[self.n])
        return p

    def value(self, u: Array) -> Array:
        """F at a point."""
        return self.sparse.value(u[: self.n].copy(), self.parameters_at(u))

    def values(self, u: Array) -> Array:
        """F at many points, the rows of u."""
        with np.errstate(all="ignore"):
            return np.array([self.value(point) for point in u])

    def derivatives(self, u: Array, *, rough: bool = False) -> tuple[Any, Array]:
        """F_x by columns, and the derivative of f by the parameter; a rough one serves factors."""
        self.sparse.prepare(self.scale)
        p = self.parameters_at(u)
        x = u[: self.n]
        return self.sparse.matrix(x, p), self.sparse.slope(
            x, p, self.free, max(abs(float(u[self.n])), float(self.scale[self.n])), rough=rough
        )

    def weight_of(self, scale: Array) -> Array:
        """Weights of lengths: of the mean square of states, and of the parameter."""
        weight = 1.0 / scale**2
        weight[: self.n] /= self.n
        return np.asarray(weight)

    def terms(self, matrix: Any, slope: Array, u: Array) -> Array:
        """What the derivatives make of the unknowns: the sizes of terms that cancel in f."""
        n = self.n
        sizes = np.maximum(np.abs(u[:n]), 1e-3 * self.scale[:n])
        found = abs(matrix) @ sizes + np.abs(slope) * max(abs(u[n]), 1e-3 * self.scale[n])
        return np.asarray(found)

    def residuals(self, u: Array, slopes: Any) -> Array:
        """Largest size of an entry of f beside its terms, at many points, the rows of u."""
        found = []
        for point in u:
            size = np.abs(self.value(point))
            ratio = np.zeros(self.n)
            np.divide(size, self.terms(*self.derivatives(point), point), ratio, where=size > 0.0)
            found.append(np.max(ratio))
        return np.array(found)

    def correct(
        self, u: Array, row: Array, target: float, scale: Array, iterations: int,
        held: Held | None = None,
    ) -> Corrected | int:  # fmt: skip
        """Newton's method from u in the plane row.u = target; why it fails, if it does."""
        weight = self.weight_of(scale)
        u = np.array(u)
        bordered: Bordered | None = None
        before, fresh = np.inf, False
        for i in range(iterations):
            value = self.value(u)
            if not np.isfinite(value).all():
                return newton.NO_NUMBER
            if bordered is None or fresh:
                matrix, slope = self.derivatives(u, rough=not self.beside)
                if not (np.isfinite(matrix.data).all() and np.isfinite(slope).all()):
                    return newton.NO_NUMBER
                bordered = self.bordered(matrix, slope, row)
                terms = self.terms(matrix, slope, u)
            step = bordered.solve_again(np.append(-value, target - inner(row, u)))
            step = step if held is None else held.without(bordered, step)
            size = float(np.sqrt(inner(weight, step**2)))
            if not np.isfinite(size) or size > 1e3:
                return newton.DIVERGED
            small = bool(np.all(np.abs(value) <= ROUNDING * terms))
            u = u + step
            ratio = size / before if i else 1.0
            if size == 0.0 or (small and (ratio >= 0.25 or size <= CLOSE)):
                return self._corrected(u, bordered, row, weight, i + 1, held)
            if i and ratio < 1.0 and size * ratio / (1.0 - ratio) <= 1e-3 * self.options.tolerance:
                return self._corrected(u, bordered, row, weight, i + 1, held)
            if i and size <= SMALL and ratio >= 0.25:
                return self._corrected(u, bordered, row, weight, i + 1, held)
            if i > 1 and size > 2.0 * before:
                return newton.DIVERGED
            fresh, before = bool(i and ratio > SLOW), size
        return newton.DIVERGED

    def bordered(self, matrix: Any, slope: Array, row: Array) -> Bordered:
        """The factors of f_u with one more row."""
        n = self.n
        inner = Factors(matrix, symmetric=self.symmetric)
        return Bordered(inner, slope, row[:n], float(row[n]))

    def unknown(self, u: Array, row: Array, weight: Array) -> Held | None:
        """The direction along which rounding of f moves points by more than a step may."""
        if self.beside:
            return None
        matrix, slope = self.derivatives(u)
        if not (np.isfinite(matrix.data).all() and np.isfinite(slope).all()):
            return None
        both = self.unknown_of(self.bordered(matrix, slope, row), matrix, slope, u)
        return None if both is None else Held(both[0], weight * both[1])

    def unknown_of(
        self, system: Any, matrix: Any, slope: Array, u: Array
    ) -> tuple[Array, Array] | None:
        """Null vectors, left and right, of equations around f if rounding of f moves along them."""
        n, found = self.n, _by_chance(system.size)
        for _ in range(PASSES):
            for solve in (system.solve, system.solve_transposed):
                found = solve(found)
                found = found / np.sqrt(inner(found, found))
        right = system.solve(found)
        length = float(np.sqrt(inner(self.weight[:n], right[:n] ** 2)))
        moved = length * inner(np.abs(found[:n]), EPSILON * self.terms(matrix, slope, u))
        return (found, right / length) if moved > SMALL else None

    def _corrected(
        self, u: Array, bordered: Bordered, row: Array, weight: Array, steps: int,
        held: Held | None,
    ) -> Corrected | int:  # fmt: skip
        n = self.n
        matrix, slope = self.derivatives(u)
        side = np.zeros(n + 1)
        side[n] = 1.0
        t = bordered.solve_again(side)
        last = np.inf
        for _ in range(REFINED):
            rest = np.append(matrix @ t[:n] + slope * t[n], inner(row, t))
            change = bordered.solve_again(side - rest)
            size = float(np.sqrt(inner(weight, change**2)) / np.sqrt(inner(weight, t**2)))
            if not size < 0.5 * last:
                break
            rate = size / last if np.isfinite(last) else 1.0
            t, last = t + change, size
            if size <= CLOSE or size * rate <= 0.5 * CLOSE:  # of what is left
                break
        if not last <= 1e-6:  # the matrix there is another one
            bordered = self.bordered(matrix, slope, row)
            t = bordered.solve(side)
        elif not _has_sign(bordered, matrix, slope, row):
            bordered = self.bordered(matrix, slope, row)
        value, terms = self.value(u), self.terms(matrix, slope, u)
        if held is not None:
            t = held.without(bordered, t)
            rest = matrix @ t[:n] + slope * t[n]
            sizes = abs(matrix) @ np.abs(t[:n]) + np.abs(slope * t[n])
            if not (held.leaves_rounding(value, terms) and held.leaves_rounding(rest, sizes)):
                return newton.DIVERGED
        t = t / np.sqrt(inner(weight, t**2))
        value = np.abs(value)
        ratio = np.zeros(n)
        np.divide(value, terms, ratio, where=value > 0.0)
        return Corrected(u, matrix, slope, t, bordered, steps, float(np.max(ratio)))

    def positive(self, point: Corrected) -> int:
        """How many eigenvalues are positive at a corrected point; -1 if pivots do not tell.

        The factors are those of a point next to it: if their parity is another one, those of the
        point itself are taken.
        """
        count = point.factors.positive
        if count is None or not is_symmetric(point.matrix, self.sparse.differenced):
            return -1
        here = np.sign(point.tangent[self.n]) * point.bordered.sign
        if here and here != (-1.0) ** (self.n - count):
            count = Factors(point.matrix, symmetric=True).positive
        return -1 if count is None else count

    def start_state(self, u: Array, tangent: Array) -> Any:
        """The state of a walk that begins at a point, in the direction of its tangent."""
        t = tangent / self.length(tangent)
        return State(u, t, t, np.array(self.scale), u, t, self.options.initial_step)

    def follow(self, state: Any, points: int) -> Any:
        """Follow the curve from a state for at most so many points."""
        found: list[tuple[Array, list[float], list[float], float]] = []
        reason, which, halt = trace.FULL, 0, None
        begun = state
        try:
            while len(found) < points and reason == trace.FULL:
                with np.errstate(all="ignore"), may_end():
                    after, row, reason, which = self._step(state)
                state = after
                if row is not None:
                    found.append(row)
                stage(f"{len(found):,} points")
        except HALTS as error:
            reason, halt = trace.INTERRUPTED, error
        n = self.n
        track = Track(
            np.array([one[0] for one in found]).reshape(-1, n + 1),
            np.array([one[1] for one in found]).reshape(-1, trace.RECORDED),
            np.array([one[2] for one in found]).reshape(-1, 3),
            np.array([one[3] for one in found]),
            state if found else begun, self.ended(reason, which, state, halt),
        )  # fmt: skip
        return track

    def _step(self, s: State) -> tuple[State, Any, int, int]:
        """The next point of a state: the state there, its record, why it ends and on what bound."""
        n, o = self.n, self.options
        weight = self.weight_of(s.scale)
        row, h, why = weight * s.tangent, s.step, newton.DIVERGED
        held, looked, again = None, False, bool(s.held)
        while True:
            if h < o.min_step:
                end = trace.NOT_FINITE if why == newton.NO_NUMBER else trace.STUCK
                return replace(s, step=h), None, end, why
            guess = s.u + h * s.tangent
            if s.last > 0.0:
                guess = guess + 0.5 * h * h / s.last * (s.tangent - s.before)
            if again and not looked:
                held, looked = self.unknown(guess, row, weight), True
            point = self.correct(
                guess, row, float(inner(row, guess)), s.scale, 2 * o.max_iterations, held
            )
            if isinstance(point, int):
                if held is not None:
                    held = None  # f tells where to go along that direction
                elif not looked and point == newton.DIVERGED:
                    again = True
                else:
                    why, h = point, 0.25 * h
                continue
            if not s.done:  # next to a branch point signs are those of the point itself alone
                own = self.bordered(point.matrix, point.slope, row)
                point = replace(point, bordered=own)
            angle = float(np.arccos(np.clip(inner(weight, point.tangent * s.tangent), -1.0, 1.0)))
            drift = float(np.sqrt(inner(weight, (point.u - guess) ** 2))) / h
            if (angle > o.turn or drift > FAR) and not looked:
                held, looked = self.unknown(guess, row, weight), True
                if held is not None:
                    continue
            smooth = angle <= o.max_turn and drift <= FAR
            sharp = not smooth and 0.5 * h < o.min_step and drift <= 2.0
            side = point.bordered.sign
            if not (smooth or sharp):
                why, h = TURNS, 0.5 * h
                continue
            if side * s.side < 0.0 and h > max(CAREFUL, 4.0 * o.min_step):
                why, h = CROSSES, 0.25 * h
                continue
            chord = point.u - s.u
            reason, which = trace.FULL, 0
            over = np.maximum(point.u - self.high, self.low - point.u)
            if (over > 0.0).any():
                with np.errstate(all="ignore"):
                    part = np.where(over > 0.0, 1.0 - over / np.abs(chord), np.inf)
                which = int(np.argmin(part))
                fraction = max(0.0, float(part[which]))
                if fraction <= 1e-12:
                    return replace(s, step=h), None, trace.BOUND, which
                edge = np.zeros(n + 1)
                edge[which] = 1.0
                bound = self.high if point.u[which] > self.high[which] else self.low
                landed = self.correct(
                    s.u + fraction * chord, edge, float(bound[which]), s.scale, 16
                )
                far = 2.0 * h
                if isinstance(landed, int) or self._far(s, landed.u, s.u + fraction * chord) > far:
                    landed = self._between(s, point, row, which, float(bound[which]))
                if isinstance(landed, int):
                    why, h = TURNS, 0.5 * h
                    continue
                landed.u[which] = bound[which]
                sign = 1.0 if inner(row, landed.tangent) >= 0.0 else -1.0
                side = side if s.side == 0.0 else s.side
                point, reason = replace(landed, tangent=sign * landed.tangent), trace.BOUND
            elif s.done >= 2 and self._comes_back(s, point.u):
                row = weight * s.start_tangent
                landed = self.correct(s.start, row, float(inner(row, s.start)), s.scale, 16)
                if not isinstance(landed, int) and self._far(s, landed.u, s.start) <= 1e-6:
                    point, reason = landed, trace.CLOSED
            return *self._taken(s, point, h, angle, side, smooth, reason, held), reason, which

    def _between(
        self, s: State, point: Corrected, row: Array, which: int, bound: float
    ) -> Corrected | int:  # fmt: skip
        """Where an unknown meets its bound between two points, on the cubic with their tangents.

        So it is where another curve crosses this one on the bound: factors there are singular.
        Where the cubic is no solution, why it fails.
        """
        a, chord = s.u, point.u - s.u
        length = float(inner(row, chord))
        bends = [t * length / inner(row, t) - chord for t in (s.tangent, point.tangent)]

        def off(part: float) -> Array:
            bend = (1.0 - part) * bends[0] - part * bends[1]
            return np.asarray(part * (1.0 - part) * bend)

        part = (bound - a[which]) / chord[which]
        for _ in range(8):
            part = (bound - a[which] - off(part)[which]) / chord[which]
        u = a + part * chord + off(part)
        matrix, slope = self.derivatives(u)
        value = np.abs(self.value(u))
        ratio = np.zeros(self.n)
        np.divide(value, self.terms(matrix, slope, u), ratio, where=value > 0.0)
        rest = float(np.max(ratio))
        if not (0.0 <= part <= 1.0 and rest <= self.options.tolerance):
            return newton.DIVERGED
        return replace(point, u=u, matrix=matrix, slope=slope, residual=rest)

    def _far(self, s: State, a: Array, b: Array) -> float:
        return float(np.sqrt(inner(self.weight_of(s.scale), (a - b) ** 2)))

    def _comes_back(self, s: State, u: Array) -> bool:
        """Whether the start lies beside the chord to a point."""
        weight = self.weight_of(s.scale)
        chord, gap = u - s.u, s.start - s.u
        square = float(inner(weight, chord**2))
        part = float(inner(weight, chord * gap)) / square
        if not 0.0 < part <= 1.0 or inner(weight, (gap - part * chord) ** 2) > 0.01 * square:
            return False
        ahead = float(inner(weight, s.start_tangent * s.tangent))
        return ahead > 0.8 * float(np.sqrt(inner(weight, s.start_tangent**2)))

    def _taken(
        self, s: State, point: Corrected, h: float, angle: float, side: float, smooth: bool,
        reason: int, held: Held | None,
    ) -> tuple[State, Any]:  # fmt: skip
        """The state at a point, with the length of the next step, and the point's record."""
        n, o = self.n, self.options
        length = self._far(s, point.u, s.u)
        steps = point.steps
        factor = 2.0 if steps <= 4 else (1.2 if steps <= 6 else (0.8 if steps <= 8 else 0.5))
        if angle > 0.0 and smooth:
            factor = min(factor, max(o.turn / angle, 0.5))
        t = point.tangent
        last = 0.0 if not smooth else (length if reason != trace.FULL else h)
        scale, before = s.scale, s.tangent
        grown = self.grown(scale, point.u - s.start)
        if grown is not None:
            scale, last = grown, 0.0
            t = t / np.sqrt(inner(self.weight_of(scale), t**2))
        made = replace(
            s, u=point.u, tangent=t, before=before, scale=scale,
            step=min(h * factor, o.max_step), last=last, length=s.length + length,
            done=s.done + 1, side=side, held=float(held is not None),
        )  # fmt: skip
        info = [length, float(steps), angle, made.length]
        along = float(point.tangent[n] / s.scale[n])
        return made, (point.u, info, [along, side, float(self.positive(point))], point.residual)

    def grown(self, scale: Array, moved: Array) -> Array | None:
        """Sizes of blocks that came farther than twice their sizes; None if none did."""
        found = None
        for place in self.places.values():
            far = float(np.sqrt(np.mean(moved[place] ** 2)))
            if far > 2.0 * scale[place.start]:
                found = np.array(scale) if found is None else found
                found[place] = far
        return found

    def ended(
        self, reason: int, which: int, state: State, halt: BaseException | None = None
    ) -> Stop:
        """Say why a track ends in a state."""
        w = np.concatenate([state.u, state.tangent])
        if reason == trace.STUCK:
            end = stuck(self, which, place_of(self, w))
            return replace(end, message=end.message + LOOSE) if state.held else end
        if halt is not None:
            return Stop("interrupted", f"{why_halted(halt)} behind {place_of(self, w)}")
        bounds = [self.places[name] for name in self.places if name in self.options.bounds]
        if reason == trace.BOUND and self.field.states[which : which + 1] == (OMEGA,):
            return Stop("bound", "omega met 0, where a pair of eigenvalues is 0: Bogdanov-Takens")
        if reason == trace.BOUND and any(one.start <= which < one.stop for one in bounds):
            above = state.tangent[which] > 0.0
            side, bound = ("upper", self.high) if above else ("lower", self.low)
            name = self.field.states[which]
            return Stop("bound", f"{name} met its {side} bound {bound[which]:.9g}")
        return track_stop(self, reason, which, w)


def _has_sign(near: Bordered, matrix: Any, slope: Array, row: Array) -> bool:
    """Whether factors of a point nearby certainly have the sign of the bordered matrix itself.

    That is so where 1 - near^-1 (matrix) has no eigenvalue of size 1: where it takes all of a
    vector by chance, the part of one direction too.
    """
    n = len(slope)
    v = _by_chance(n + 1)
    for _ in range(TRIES):
        image = np.append(matrix @ v[:n] + slope * v[n], inner(row, v))
        v = v - near.solve_again(image)
        if float(np.sqrt(inner(v, v))) <= UNSEEN:
            return True
    return False


@functools.lru_cache(maxsize=2)
def _by_chance(n: int) -> Array:
    """A vector whose part of a direction is about 1."""
    return np.random.default_rng(5).normal(size=n)
