"""One family of periodic orbits: its equations, and Newton's method for them."""

from __future__ import annotations

import functools
import math
from dataclasses import dataclass, fields, replace
from functools import cached_property
from typing import Any

import numpy as np
import numpy.typing as npt

from phasekit.arrays import Array, Complex
from phasekit.bifurcation.continuation.fields import Field
from phasekit.bifurcation.continuation.options import ContinuationOptions
from phasekit.cycles import along, collocation, newton, wide
from phasekit.cycles.jets import Jets
from phasekit.cycles.leading import (
    Carried,
    carried_multipliers,
    fast_ones_decay,
    some_grow,
    through,
)
from phasekit.cycles.multipliers import across, known_multipliers, off_one
from phasekit.cycles.sparse import FORMED, Condensed

LARGE = 3.0  # size of an orbit, beside its scale, from which on it has a scale of its own
MARGIN = 6.0  # that scale beside the orbit, where it is much larger
REST = 1e-12  # amplitude, beside the size of a state, that is rounding
STEPPED = 0.03  # times the error allowed, the residual that a step on a finer mesh may leave
MOST = 20_000  # intervals of a mesh that resolves them


#: What is kept of a family and knows its scales.
SCALED = ("sizes", "tolerance", "folds")


def _size(one: complex) -> float:
    """Size of a multiplier by which it is sorted; what is not known comes last."""
    size = abs(one)
    return -1.0 if math.isnan(size) else size


@dataclass(eq=False)  # not frozen, which takes longer to make than a step's linear algebra
class Orbit:
    """A closed curve: values at all places of a mesh, and y = (period, free parameters)."""

    mesh: Array
    x: Array
    y: Array

    @property
    def intervals(self) -> int:
        """Number of intervals."""
        return len(self.mesh) - 1


@dataclass(eq=False)
class Solution:
    """What Newton's method left: the orbit, the direction in which it goes on, and checks."""

    orbit: Orbit
    dx: Array  # the unit tangent
    dy: Array
    steps: int  # Newton steps; 0 if it did not converge
    residual: float  # largest |x' - T f| beside the largest |T f|, both on scaled axes
    sign: float  # sign of the determinant of the equations with the tangent as last row
    divergence: float  # integral of the trace of f_x over the period
    W: Any  # the condensed equations (see `kernels.condense`)
    message: str = ""
    length: float = 1.0  # of the tangent whose part along the direction of the plane is 1

    @property
    def converged(self) -> bool:
        """Whether Newton's method came to an end."""
        return self.steps > 0


@dataclass(frozen=True, eq=False)
class Cycles:
    """Periodic orbits of a field over its free parameters."""

    field: Field  # the right-hand side; of a forced system time is the last of its parameters
    par: Array  # all parameters; those that are free are not used
    active: tuple[int, ...]  # places of the free parameters
    forced: bool  # whether f depends on time
    #: Of a forced system, machine code of its period and the derivatives by free parameters.
    clock: int
    multiple: int  # how many periods of the forcing the orbit takes
    turns: Array  # by how much each state grows over a period: angles only
    scale: Array  # sizes of the states and of the free parameters
    width: Array
    low: Array  # bounds of the free parameters
    high: Array
    period: Array  # periods of the states that are angles, else 0
    options: ContinuationOptions
    #: Numbers of orbits that vanish, for each of which one more parameter is free.
    holds: tuple[Any, ...] = ()
    events: tuple[Any, ...] = ()  # numbers of orbits whose zeros are looked for
    #: Names of events, kinds and labels of special points at which the family ends.
    ends: tuple[str, ...] = ()

    @cached_property
    def n(self) -> int:
        """Number of states."""
        return len(self.scale)

    @cached_property
    def m(self) -> int:
        """Degree of the polynomials."""
        return self.options.degree

    @cached_property
    def q(self) -> int:
        """Number of free parameters and the period."""
        return 1 + len(self.active)

    @property
    def bordering(self) -> int:
        """Number of bordering rows."""
        return self.q

    @cached_property
    def closes(self) -> bool:
        """Whether orbits come back: else as many rows as states say what holds at their ends."""
        return self.bordering == self.q

    @property
    def critical(self) -> bool:
        """Whether folds and branch points are looked for."""
        return len(self.active) == 1

    @property
    def moving(self) -> int:
        """Number of states with a part in tangents; those behind follow from them."""
        return self.n

    @cached_property
    def closure(self) -> Array:
        """By what each state is multiplied after a period."""
        return np.ones(self.n)

    @cached_property
    def jets(self) -> Jets:
        """The right-hand side with its derivatives."""
        time = (len(self.par) - 1,) if self.forced else ()
        return Jets(self.field, self.par, (*time, *self.active), self.forced)

    def slopes(self, orbit: Orbit, sizes: Array | None = None) -> Any:
        """F and its derivatives at all Gauss points: rows or, of very many states, `Slopes`."""
        sizes = self.sizes if sizes is None else sizes
        given = orbit.mesh, orbit.x, orbit.y, self.m, sizes
        may_be = self.n > FORMED and not self.forced and isinstance(self.jets, Jets)
        found = self.jets.sparse(*given) if may_be else None
        return self.jets(*given) if found is None else found

    @cached_property
    def sizes(self) -> Array:
        """Sizes of states and active parameters, for differences; that of time is the period."""
        return np.concatenate([self.scale, self._other_sizes])

    @cached_property
    def _other_sizes(self) -> Array:
        """Those of time and parameters, which no orbit changes."""
        time = np.ones(1) if self.forced else np.ones(0)
        # F is linear in what has no span: any size will do.
        return np.concatenate([time, np.where(np.isfinite(self.width), self.width, 1.0)])

    def replace(self, **changes: Any) -> Cycles:
        """A copy with some attributes changed."""
        return replace(self, **changes)

    @cached_property
    def tolerance(self) -> float:
        """Size of the last of Newton's steps, on these scales."""
        return self.options.tolerance

    @cached_property
    def on_lines(self) -> npt.NDArray[np.bool_]:
        """States of the orbit itself that are no angles."""
        free: npt.NDArray[np.bool_] = self.period == 0.0
        free[self.own :] = False
        return free

    @cached_property
    def _growing(self) -> npt.NDArray[np.bool_]:
        """States whose scale grows with the orbit."""
        free = self.on_lines.copy()
        for i, name in enumerate(self.field.states[: self.own]):
            free[i] &= name not in self.options.scales
        return free

    def sized(self, orbit: Orbit) -> Cycles:
        """These orbits on the scales of one of them, where it is much larger than the first.

        The scales depend on that orbit alone, so that a family goes on as if it had never stopped.
        They are so much larger than it that its amplitude changes by half of itself in the longest
        of steps. Angles, and states whose scales the user has set, keep theirs.
        """
        ratio = along.largest(orbit.x, self.scale, self._growing)
        if not LARGE < ratio < math.inf:
            return self
        grown = 1.0 + MARGIN * (ratio - LARGE)  # from 1 on, so that steps do not jump
        made = object.__new__(type(self))
        own = made.__dict__
        own |= self.__dict__
        for name in SCALED:
            own.pop(name, None)
        own["scale"] = np.where(self._growing, grown * self.scale, self.scale)
        own["tolerance"] = self.options.tolerance / MARGIN  # beside the orbit itself
        return made

    @property
    def slides(self) -> bool:
        """Whether orbits are followed in a frame that moves along them."""
        return False

    def length(self, mesh: Array, dx: Array, dy: Array) -> float:
        """Length of a direction."""
        return math.sqrt(self.inner(mesh, dx, dx, dy, dy))

    def own_period(self, y: Array) -> tuple[float, Array]:
        """The period of the forcing, times the multiple, and its derivatives."""
        k = len(self.active)
        w = np.zeros(2 * k + 1)
        w[:k] = y[1:]
        par = self.par.copy()
        along.evaluate(self.clock, par, w, k)
        return self.multiple * float(w[k]), self.multiple * w[k + 1 :]

    def vertical(self, dy: Array) -> bool:
        """Whether a tangent has no part along the parameter, as in conservative families."""
        pairs = zip(dy[1:].tolist(), self.width.tolist(), strict=False)
        return all(abs(one) <= 1e-9 * width for one, width in pairs)

    def inner(self, mesh: Array, a: Array, b: Array, dy_a: Array, dy_b: Array) -> float:
        """Inner product of two directions: the mean over states and time, and the parameters."""
        c = collocation.scheme(self.m)
        return along.product(mesh, c.weights, c.value, self.scale, self.width, a, b, dy_a, dy_b)

    def rows(self, orbit: Orbit, dx: Array, dy: Array) -> tuple[Array, Array, Array]:
        """Bordering rows, phase or period first, direction last; with their values at the orbit."""
        c, q = collocation.scheme(self.m), self.q
        rows, rows_y, target = np.empty((q, *orbit.x.shape)), np.empty((q, q)), np.empty(q)
        along.plane(
            orbit.mesh, (c.weights, c.value, c.slope), orbit.x, orbit.y, dx, dy, self.scale,
            self.width, self.forced, rows, rows_y, target,
        )  # fmt: skip
        return self._holding(orbit, rows, rows_y, target, 1)

    @cached_property
    def _bends(self) -> bool:
        """Whether a number that is held has derivatives that are not the same everywhere."""
        return not all(one.constant for one in self.holds)

    def rows_beside(self, orbit: Orbit, rows: Array, rows_y: Array, target: Array) -> Any:
        """The bordering rows beside an orbit, if they are not the same everywhere; else None."""
        if not self._bends:
            return None
        return self._holding(orbit, rows.copy(), rows_y.copy(), target.copy(), 1)

    def _holding(
        self, orbit: Orbit, rows: Array, rows_y: Array, target: Array, place: int
    ) -> tuple[Array, Array, Array]:
        """The bordering rows, at a place those of what is held, linear beside an orbit."""
        for k, one in enumerate(self.holds, place):
            rows[k], rows_y[k], value = one.linear(self, orbit)
            target[k] = np.sum(rows[k] * orbit.x) + rows_y[k] @ orbit.y - value
        return rows, rows_y, target

    def correct(
        self,
        guess: Orbit,
        rows: Array,
        rows_y: Array,
        target: Array,
        *,
        iterations: int | None = None,
        damped: bool = False,
    ) -> Solution:
        """Newton's method in the plane rows . x + rows_y . y = target."""
        c = collocation.scheme(self.m)
        mesh, x, y = guess.mesh, guess.x.copy(), guess.y.copy()
        n, q, jets = self.n, self.q, self.jets
        local = self.sized(guess)
        if x.shape != ((len(mesh) - 1) * self.m + 1, n) or y.shape != (q,):
            raise ValueError(f"an orbit of shape {x.shape} with {y.shape} on {len(mesh)} points")
        W: Any = None
        dx, dy = np.empty((2, *x.shape)), np.empty((2, q))
        most = iterations or self.options.max_iterations
        sign, divergence = 0.0, np.nan
        self.field.failure = None
        values: Any = np.empty((0, 0))
        size, step = np.inf, 0
        if not jets.given:
            values = np.empty(((len(mesh) - 1) * self.m, n * (1 + n + len(jets.active))))
        one = jets.given or not self.closes or self._bends  # step at a time
        while True:
            if jets.given:
                values = self.slopes(Orbit(mesh, x, y), local.sizes)
            if W is None:
                W = wide.space(values, len(mesh) - 1, self.m * n, n + q + 1)
            beside = one and self.rows_beside(Orbit(mesh, x, y), rows, rows_y, target)
            if beside:
                rows, rows_y, target = beside
            end, steps, side, residual, trace, size, length = wide.follow(
                n,
                jets.given, jets.first, jets.mode, jets.par, jets.places, self.forced, self.clock,
                self.multiple, mesh, c.nodes, c.weights, c.value, c.slope, c.side, local.scale,
                local.sizes, self.width, self.closure, self.turns, rows, rows_y, target, x, y, W,
                dx, dy, values, local.tolerance, 1 if one else most, damped, size,
            )  # fmt: skip
            step += steps
            if steps:  # else the last ones stand
                sign, divergence = side, trace
            if end != newton.ON_ITS_WAY or step >= most:
                break
        orbit = Orbit(mesh, x, y)
        if end in (newton.FOUND, newton.CHECKED):
            found = (step, residual, sign, divergence, W)
            if local is self:
                return Solution(orbit, dx[1], dy[1], *found, length=length)
            part = self.length(mesh, dx[1], dy[1])
            return Solution(orbit, dx[1] / part, dy[1] / part, *found, length=length * part)
        message = {
            newton.NOT_FINITE: f"f or its derivatives are not finite{self.field.raised}",
            newton.SINGULAR: "the equations are singular",
        }.get(end, "Newton's method did not converge")
        return Solution(orbit, dx[1], dy[1], 0, residual, sign, divergence, W, message)

    def looked_at(self, orbit: Orbit, dx: Array, dy: Array) -> Solution:
        """An orbit that was found otherwise, with its residual and condensed equations."""
        c = collocation.scheme(self.m)
        jets = self.slopes(orbit)
        W = wide.space(jets, orbit.intervals, self.m * self.n, self.n + self.q + 1)
        _, residual, _, divergence = wide.condense(
            jets, self.forced, orbit.mesh, c.nodes, c.weights, c.value, c.slope, c.side,
            self.scale, orbit.x, orbit.y, W,
        )  # fmt: skip
        length = float(np.sqrt(self.inner(orbit.mesh, dx, dx, dy, dy))) or 1.0
        return Solution(orbit, dx / length, dy / length, 1, residual, 0.0, divergence, W)

    def multipliers(
        self, W: Any, orbit: Orbit, divergence: float = math.nan
    ) -> tuple[Complex, float, float]:
        """Floquet multipliers, by how much the logarithm of their product is off, the trivial one.

        Those that errors hide are NaN, where the ``divergence`` tells what errors are. Of the
        trivial one its error is given.

        Of an autonomous system one belongs to f along the orbit. The others are those across it,
        which stay accurate where the orbit comes near an equilibrium; it is itself a check.
        """
        n, applied = self.n, isinstance(W, Condensed)
        G = W if applied else np.ascontiguousarray(W[:, (self.m - 1) * n :, :n])
        may_lead = isinstance(self.jets, Jets) and n >= wide.WIDE
        if applied or (may_lead and self.stiff(orbit, divergence)):
            return self._leading(orbit, W.carried if applied else functools.partial(through, G))
        values, off, trivial = self._multipliers(G, orbit, divergence)
        if may_lead and np.isnan(values).any():  # errors of some decays hide others
            few, _, error = self._leading(orbit, functools.partial(through, G))
            if not np.isnan(few).any():
                return few, math.nan, error
        return values, off, trivial

    def _multipliers(
        self, G: Array, orbit: Orbit, divergence: float
    ) -> tuple[Complex, float, float]:
        """All multipliers by the matrices of all intervals."""
        n, divergence = self.n, self.resolved(G, orbit, divergence)
        if not self.forced and n > 1:
            f = self.jets.at_mesh(orbit.mesh, orbit.x, orbit.y, self.m, self.sizes)
            A = np.empty((len(f), n - 1, n - 1))
            trivial, off = across(G, f, self.scale, A)
            if not math.isnan(trivial):
                others, log = known_multipliers(A, divergence)
                whole = sorted([complex(trivial), *others.tolist()], key=_size, reverse=True)
                log += math.log(abs(trivial)) if trivial != 0.0 else -math.inf
                return np.array(whole), abs(log - divergence), abs(trivial - 1.0) + off
        units = 2.0 ** np.rint(np.log2(self.scale[:n]))  # in which nothing is rounded
        values, log = known_multipliers(
            np.ascontiguousarray(G * units / units[:, None]), divergence
        )
        return values, abs(log - divergence), 0.0 if self.forced else off_one(values)

    def stiff(self, orbit: Orbit, divergence: float) -> bool:
        """Whether decays of many states are far faster than intervals, and nobody needs them."""
        n = self.own
        return n >= wide.WIDE and abs(divergence) > wide.STIFF * n * orbit.intervals

    def resolved(self, G: Array, orbit: Orbit, divergence: float) -> float:
        """The divergence, or that of the discrete equations, where nobody needs its digits."""
        stiff = self.stiff(orbit, divergence)
        return float(np.sum(np.linalg.slogdet(G)[1])) if stiff else divergence

    def _leading(self, orbit: Orbit, own: Any) -> tuple[Complex, float, float]:
        """Multipliers of a size to speak of, by a scheme too in which fast decays are such."""
        c, damped = collocation.damped(self.m), Condensed()
        slopes = self.jets.matrices(orbit.mesh, orbit.x, orbit.y, self.m, self.sizes, c)
        damped.fill(slopes, orbit.mesh, c, self.scale, orbit.y)
        if not damped.factors:  # its equations are singular
            return np.full(self.n, np.nan, dtype=complex), math.nan, math.nan
        flow = None
        if not self.forced:
            flow = self.jets.values(np.concatenate([orbit.x[0], orbit.y[1:]])[None])[0]
        lengths = orbit.y[0] * np.diff(orbit.mesh)
        rates = slopes.matrices[:: self.m], lengths
        calm = functools.partial(fast_ones_decay, *rates, self.scale)
        grows = functools.partial(some_grow, *rates)
        ways = Carried(damped.carried, damped.carried_back, own, calm, grows)
        values, trivial = carried_multipliers(ways, flow, self.n)
        return values, math.nan, trivial  # the product of all of them is not formed

    def reaches(self, orbit: Orbit) -> Array | None:
        """Rate times length of each interval; None of an orbit that has no other mesh."""
        found = self.jets(orbit.mesh, orbit.x, orbit.y, self.m, self.sizes)
        out = np.empty(orbit.intervals)
        along.reaches(orbit.mesh, found, self.scale, float(orbit.y[0]), self.m, out)
        return out

    def on_finer(self, orbit: Orbit, dx: Array, dy: Array, allowed: float) -> Solution:
        """An orbit that was brought to a finer mesh for the sake of its multipliers.

        One of Newton's steps is enough as a rule, after which the orbit is looked at.
        """
        plane = self.rows(orbit, dx, dy)
        found = self.correct(orbit, *plane, iterations=1)
        if found.converged or not math.isfinite(found.residual):
            return found
        looked = self.looked_at(found.orbit, found.dx, found.dy)
        if looked.residual <= STEPPED * allowed:
            return looked
        return self.correct(found.orbit, *plane)

    def divergence(self, found: float) -> float:
        """Integral of the trace of f_x over a period, of what `kernels.condense` found."""
        return found

    @property
    def own(self) -> int:
        """Number of states of the orbit itself."""
        return self.n

    def amplitudes(self, orbit: Orbit) -> Array:
        """Half the range of each state, without its turns; where it hardly moves, a part of all."""
        half = np.empty(self.n)
        along.amplitudes(orbit.mesh, orbit.x, self.turns, self.scale, self.m, half)
        return half

    @functools.lru_cache(maxsize=4)  # noqa: B019 - of the last orbits, which are asked for again
    def mesh_error(self, orbit: Orbit) -> float:
        """Largest estimated error of a state, beside its amplitude; of what is at rest none."""
        high = collocation.scheme(self.m).high
        found = along.error(orbit.mesh, orbit.x, self.turns, self.scale, high, self.closure, REST)
        return float(found) * collocation.factor(self.m)

    def on(self, mesh: Array, orbit: Orbit, *more: Array) -> tuple[Orbit, tuple[Array, ...]]:
        """The orbit, and directions, on another mesh."""
        at = collocation.times(mesh, self.m)
        moved = [collocation.interpolate(orbit.mesh, one, self.m, at) for one in (orbit.x, *more)]
        return Orbit(mesh, moved[0], orbit.y.copy()), tuple(moved[1:])


def where(cycles: Cycles, orbit: Orbit) -> str:
    """The period, if it is one, and the free parameters, in words."""
    names = ["period", *(cycles.field.parameters[i] for i in cycles.active)]
    # On curves of folds and tori kappa or omega follows.
    values = list(zip(names, orbit.y.tolist(), strict=False))[0 if cycles.closes else 1 :]
    return ", ".join(f"{name} = {value:.9g}" for name, value in values)


def fields_alone(curve: Cycles, form: type[Cycles], states: int, free: int) -> dict[str, Any]:
    """Fields of a form of what is followed, over the first states and free parameters alone."""
    kept = {f.name: getattr(curve, f.name) for f in fields(form)}
    kept |= {name: kept[name][:states] for name in ("turns", "period", "scale")}
    return kept | {name: kept[name][:free] for name in ("width", "low", "high")}
