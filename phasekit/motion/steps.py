"""One step after another along the motion of a law x' = f(t, x), and a bound on their number."""

from __future__ import annotations

import contextlib
import functools
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, TypeAlias

import numpy as np

from phasekit.arrays import Array
from phasekit.errors import ConvergenceError
from phasekit.inputs import bad

if TYPE_CHECKING:
    from scipy.integrate import DenseOutput, OdeSolver

#: A function of (t, x): the rates x' of a law, or one value.
Rates: TypeAlias = Callable[[float, Any], Any]

#: Steps after which the pace of a motion tells: the first step may be shorter by any factor.
TRIAL = 1000
#: Steps of Radau's method in which what is fast decays by 30 e-folds, times rtol^(1/4), since its
#: error is estimated in order 3: later steps are longer by any factor.
LAYER = 10.0
#: First steps, and how often as great as in them a motion is that is under way to infinity.
EARLY, BEYOND = 16, 1e6


@dataclass(frozen=True)
class InitialValue:
    """An initial-value problem x' = f(t, x), x(start) = state, and how closely it is solved."""

    rates: Rates
    """Takes (t, x) with x of shape (n,), returns n rates."""
    state: Sequence[float]
    """State at the start."""
    start: float = 0.0
    """Time of that state."""
    rtol: float = 1e-11
    """Error of a step, relative to the state, that is allowed."""
    atol: float = 1e-12
    """The same, absolute."""
    unit: float | Array = 1.0
    """What the absolute error is of, where that is below 1, or of each state; infinite: the
    greatest component so far, of states that may be lengths in any unit."""
    max_step: float = np.inf
    """Longest step."""
    most: int = 1_000_000
    """Steps that a motion may take."""
    causes: str = "Rates without bound"
    """What a message supposes where steps become too short to go on."""
    method: type[OdeSolver] | None = None
    """One of SciPy's with an error of its own; None for DOP853."""


@dataclass
class Pace:
    """Counts what a motion needs most of: steps, or passages of a section."""

    most: int
    stop: float
    trial: float = TRIAL
    """Number of them after which they tell of later ones."""
    taken: int = 0
    longest: float = 0.0
    """Time between two of them."""
    first: float = 0.0
    """Greatest size of the state in the first of them."""

    def is_too_slow(self, start: float, t: float, size: float = 0.0) -> bool:
        """Count the one from `start` to `t`; whether the motion is to be given up.

        That is where it needs too many, or will: the rest takes too many even of the longest so
        far, where the more were counted, the sooner that is believed; or of the last, far from
        where the motion began, as on the way to infinity in finite time.
        """
        self.taken += 1
        self.longest = max(self.longest, abs(t - start))
        if self.taken <= EARLY:
            self.first = max(self.first, size)
        rest = abs(self.stop - t)
        foreseen = self.taken >= self.trial and rest < np.inf
        if foreseen and not size > BEYOND * self.first:
            foreseen = self.taken * rest > self.longest * self.most**2
        elif foreseen:
            foreseen = rest > abs(t - start) * self.most
        return rest > 0.0 and (self.taken >= self.most or foreseen)


@dataclass(frozen=True)
class Step:
    """One step of a motion: times, states and rates at its ends."""

    start: float
    stop: float
    before: Array
    after: Array
    rates_before: Array
    rates_after: Array
    _solver: OdeSolver

    @functools.cached_property
    def dense(self) -> DenseOutput:
        """State as a function of time in the step; to be asked for before the next step."""
        return self._solver.dense_output()


def steps(problem: InitialValue, stop: float) -> Iterator[Step]:
    """Step along a motion from its start to another time, before or after it.

    A time to go to is infinite where something else ends the motion. The method is the explicit
    Runge-Kutta method DOP853 of order 8, unless the problem has another. It is an error if steps
    become too short, or more are needed than the problem allows, which may be foreseen (`Pace`).
    """
    from scipy.integrate import DOP853

    with np.errstate(all="ignore"):
        first = np.asarray(problem.rates(problem.start, np.array(problem.state, dtype=float)))
    if not np.isfinite(first).all():  # the integrator would not come back from NaN
        raise bad("state", tuple(problem.state), f"one with finite rates, not {first.tolist()}")
    size = float(np.abs(problem.state).max(initial=0.0))
    atol = _absolute(problem, size)
    options = {"rtol": problem.rtol, "atol": atol, "max_step": problem.max_step}
    start = problem.start, np.array(problem.state)
    with np.errstate(all="ignore"):
        solver = (problem.method or DOP853)(problem.rates, *start, stop, **options)
    pace = Pace(problem.most, stop)
    if hasattr(solver, "solve_lu"):  # of an implicit method
        if isinstance(solver.J, np.ndarray):  # whose matrices are small
            solver.solve_lu = _solved
        pace.trial = max(TRIAL, LAYER * problem.rtol**-0.25)
    # Beside a component that is zero, the first step that is proposed may be next to nothing.
    ulp = np.finfo(float).eps * max(abs(stop) if np.isfinite(stop) else 0.0, abs(problem.start))
    solver.h_abs = max(solver.h_abs, ulp)
    still, since = 0, problem.start
    while solver.status == "running":
        before, rates_before = solver.y, solver.f
        size = max(size, float(np.abs(before).max()))
        solver.atol = _absolute(problem, size)
        with np.errstate(all="ignore"):
            message = solver.step()
        if solver.status == "failed":
            raise _stopped(problem, solver.t, stop, message)
        yield Step(solver.t_old, solver.t, before, solver.y, rates_before, solver.f, solver)
        # Beside states where the law has no value steps are refused that would change anything.
        still, since = (still + 1, since) if (solver.y == before).all() else (0, solver.t)
        rest = abs(stop - solver.t) if still >= TRIAL and np.isfinite(stop) else 0.0
        creeps = rest * still > abs(solver.t - since) * pace.most
        if creeps or pace.is_too_slow(solver.t_old, solver.t, float(np.abs(solver.y).max())):
            raise _too_long(problem, solver.t, pace)


def states_at(problem: InitialValue, times: Array, out: Array) -> Iterator[Step]:
    """Step along a motion to the last of times in order; fill the states at them, rows of `out`."""
    sense, done = np.sign(times[-1] - problem.start), 0
    for step in steps(problem, float(times[-1])):
        upto = int(np.searchsorted(sense * times, sense * step.stop, side="right"))
        if upto > done:
            out[done:upto] = step.dense(times[done:upto]).T
            done = upto
        yield step


def followed(
    problem: InitialValue, times: Array, ends: Callable[[Step], bool] | None = None
) -> tuple[Array, Array]:
    """States of a motion from t = 0 at times of either sign, and its last.

    Rows are NaN where it is not asked for, given up, or after a step that ends it.
    """
    found = np.full((times.size, len(problem.state)), np.nan)
    last = np.array(problem.state, float)
    found[times == 0.0] = last
    for sense in (1.0, -1.0):
        ahead = np.flatnonzero((sense * times > 0.0) & np.isfinite(times))
        if not ahead.size:
            continue
        ahead = ahead[np.argsort(sense * times[ahead])]
        out = np.full((ahead.size, last.size), np.nan)
        # A ValueError: of rates that are not finite.
        with contextlib.suppress(ConvergenceError, ValueError):
            for step in states_at(problem, times[ahead], out):
                last = step.after
                if ends is not None and ends(step):
                    break
        found[ahead] = out
    return found, last


def end_of(problem: InitialValue, stop: float) -> Array:
    """State of a motion at a time; NaN where it does not come to it."""
    state = np.array(problem.state, float)
    try:
        for step in steps(problem, stop):
            state = step.after
    except (ConvergenceError, ValueError):
        return np.full(state.shape, np.nan)
    return state


def _solved(factors: tuple[Array, Array], b: Array) -> Array:
    """Solution of A x = b of a factorised A, by what `scipy.linalg.lu_solve` calls as well.

    Of a few states that takes most of the time of a step to ask which routine to call.
    """
    from scipy.linalg import lapack

    if not np.isfinite(b).all():
        raise ValueError("array must not contain infs or NaNs")
    routine = lapack.zgetrs if factors[0].dtype.kind == "c" else lapack.dgetrs
    return np.asarray(routine(*factors, b)[0])


def _absolute(problem: InitialValue, size: float) -> float | Array:
    """Absolute error that is allowed to a motion that was as great."""
    if isinstance(problem.unit, np.ndarray):
        return np.maximum(problem.atol * np.minimum(problem.unit, 1.0), np.finfo(float).tiny)
    unit = problem.unit if np.isfinite(problem.unit) else size
    # Where a component is zero, no relative error of it can be allowed.
    return max(problem.atol * min(unit, 1.0), float(np.finfo(float).tiny))


def _stopped(problem: InitialValue, t: float, stop: float, message: str) -> ConvergenceError:
    return ConvergenceError(
        f"the integrator stopped at t = {float(t)!r} s of {float(stop)!r} s: {message} "
        f"{problem.causes} may be why; otherwise try a larger rtol"
    )


def _too_long(problem: InitialValue, t: float, pace: Pace) -> ConvergenceError:
    return ConvergenceError(
        f"the integrator came to t = {float(t)!r} s of {float(pace.stop)!r} s in {pace.taken} "
        f"steps, the longest of {pace.longest:.3g} s, and would need more than {problem.most} in "
        "all; try a shorter time, a slower motion, or a larger rtol, atol or max_step"
    )
