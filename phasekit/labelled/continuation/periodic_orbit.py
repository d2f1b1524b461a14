"""`periodic_orbit`: from a guess, a simulation or samples to a periodic orbit."""

from __future__ import annotations

import warnings
from collections.abc import Callable, Iterable, Iterator, Mapping
from typing import Any

import numpy as np
import xarray as xr

from phasekit.arrays import Array
from phasekit.bifurcation.continuation.code_fields import PythonField
from phasekit.bifurcation.continuation.large.field import SparseField
from phasekit.bifurcation.continuation.options import ContinuationOptions
from phasekit.cells.schema import dataset_attrs
from phasekit.cycles import along, collocation, starts
from phasekit.cycles.cycles import Orbit
from phasekit.cycles.multipliers import MANY
from phasekit.errors import ConvergenceError, ParameterError, warn
from phasekit.inputs import call_checked
from phasekit.labelled.continuation.checks import check_options, check_record
from phasekit.labelled.continuation.orbit_guess import (
    given_orbit,
    orbit_of,
    sampled,
    scale_of,
    units_of,
)
from phasekit.labelled.continuation.unfolding import NO_PARAMETER, UNFOLDING, unfolded
from phasekit.labels.arguments import bad, list_names, number, reals
from phasekit.motion.flows import ANOTHER, MOMENT, MOMENTS, Sticking, mismatch
from phasekit.numerics.waits import notice
from phasekit.systems.cycle_families import cycles_of
from phasekit.systems.field_arrays import by_state
from phasekit.systems.problem import Problem, as_problem
from phasekit.systems.problem_parts import refuse_aperiodic
from phasekit.systems.smooth import jumping, refuse_jump_along, refuse_jumps

#: The family of an orbit, its problem, the orbit, and where it was found.
Located = tuple[Any, Problem, Any, str]

UNCONSERVED = 1e-8  # damping over a period with which an orbit of a conservative system closes
SAMPLES = 2001
MOST = 3e6  # values of f that a search for a return takes at once
#: Times the first return, after which an orbit is looked for, each with the values of f that this
#: may take: few as long as the motion may settle elsewhere, and all of them in the end.
TURNS = ((0.0, 1e5), (3.0, MOST), (10.0, MOST), (40.0, MOST), (0.0, MOST))
STILL = 1e-5  # part of the largest range that is the error of a simulation
PRIMES = (2, 3, 5, 7, 11, 13, 17, 19, 23, 29, 31)  # numbers of times an orbit may be run through
SURE = 30.0  # times the mesh error by which parts of an orbit that are the same may differ
ROUNDING = 1e-10  # and the error of an orbit on any mesh
ALIKE = 1e-3  # part by which the period of an orbit differs from that of its guess
REPEATS = 1e-9  # of what it varies by in time, by which f that repeats itself may differ
PARTS = 4  # of each step of a simulation, between which an orbit is interpolated


@call_checked
def periodic_orbit(
    problem: Any,
    x0: Any,
    period: float | None = None,
    *,
    settle: float | None = None,
    record: Any = None,
    options: ContinuationOptions | None = None,
) -> xr.Dataset:
    """Find a periodic orbit near a state, a simulation or samples.

    Parameters
    ----------
    problem : Problem or system
        The system, at the parameters of the orbit; of a `FreeGyroRotor` the disk at its momentum.
    x0 : array_like, mapping or xarray.Dataset
        A state, from which the system is simulated; or one period of samples: an array of shape
        (samples, states), even in time, or a Dataset of the states on ``time``.
    period : float, optional
        About how long the orbit takes. Of a forced system by default the period of the forcing;
        otherwise of a simulation the time until it returns.
    settle : float, optional
        Time that is simulated first, so that transients decay. By default none with a period given,
        and otherwise as much as it takes.
    record : mapping of str to str, sympy.Expr or callable, or sequence of str, optional
        Formulas or functions ``q(x, **parameters)``, whose least, largest and mean value over the
        orbit are scalars ``q_min``, ``q_max`` and ``q_mean``, and harmonics (`fourier`), of which
        amplitude and phase are.
    options : ContinuationOptions, optional
        ``degree``, ``intervals``, ``mesh_tolerance``, ``scales``.

    Returns
    -------
    xarray.Dataset
        The states on ``time``, from 0 to the period, and as scalars ``period``, ``n_unstable``, the
        checks and extremes that points of a branch have; ``multiplier``. `continuation` takes it
        as ``orbit=``.

    Raises
    ------
    ParameterError
        If an argument is unusable.
    ConvergenceError
        If no periodic orbit is found, or a search for a return takes more than 3e6 values of f.

    Notes
    -----
    States may differ in their units: they are measured in those in which the slopes of f balance.

    The orbit solves ``dx/ds = T f(x)`` with ``x(1) = x(0)`` (for angles up to whole turns) and a
    phase condition, by collocation at Gauss points on a mesh that adapts itself
    ([AscherMattheijRussell1995] chapter 5, [Doedel1991]); of a forced system T is given. Floquet
    multipliers come from the matrices of the intervals, never multiplied out ([Lust2001]).

    Examples
    --------
    >>> import phasekit as pk
    >>> oscillator = pk.Problem(["y", "mu*(1 - x**2)*y - x"], ("x", "y"), {"mu": 1.0})
    >>> orbit = pk.periodic_orbit(oscillator, [2.0, 0.0])
    >>> round(float(orbit.period), 9), int(orbit.n_unstable)
    (6.663286859, 0)
    >>> first = pk.periodic_orbit(oscillator, [2.0, 0.0], record={"x1": pk.fourier("x", 1)})
    >>> round(float(first.x1_amplitude), 6)
    2.014906
    >>> branch = pk.continuation(oscillator, "mu", orbit=orbit, span=(0.5, 2.0))
    >>> round(float(branch.points.period[-1]), 9)
    7.62987448
    """
    problem = as_problem(problem, moving=True)
    refuse_aperiodic(problem)
    refuse_jumps(problem)
    if problem.map:
        raise bad(
            "problem", problem, "a flow x' = f(x)",
            "orbits of a map are fixed points of problem.iterated(times)",
        )  # fmt: skip
    options = check_options(options)
    record = check_record(problem, record)
    if period is not None:
        period = number("period", period, "a number > 0", problem.unit_of("time"))
        if not period > 0.0:
            raise bad("period", period, "a number > 0")
    if settle is not None:
        settle = number("settle", settle, "a number >= 0", problem.unit_of("time"))
        if settle < 0.0:
            raise bad("settle", settle, "a number >= 0")
    if problem.conservative and len(problem.state) > 1:
        problem = unfolded(problem)
    elif not problem.parameters:
        found = _located(unfolded(problem, NO_PARAMETER), x0, period, settle, options)
        ds = orbit_of(*found, record).drop_vars(NO_PARAMETER)
        return ds.assign_attrs(dataset_attrs(problem))
    return orbit_of(*_located(problem, x0, period, settle, options), record)


def _located(
    problem: Problem, x0: Any, period: float | None, settle: float | None, options: Any
) -> Located:
    """The orbit near a state, a simulation or samples."""
    n = len(problem.state)
    value = problem.parameters.get(UNFOLDING, next(iter(problem.parameters.values())))
    if isinstance(x0, xr.Dataset) and "time" in x0.dims:
        if settle is not None:
            raise bad("settle", settle, "None with samples")
        ds = x0
        if "period" not in ds:
            ds = _with_period(ds, period)
        guesses = [given_orbit(problem, ds, value, options.degree)]
        return _found(problem, guesses, options, "from the samples")
    x0 = by_state(problem, x0)
    if isinstance(x0, Mapping):
        missing = [name for name in problem.state if name not in x0]
        if missing or len(x0) != n:
            raise bad("x0", list(x0), f"a value for each of {list_names(problem.state)}")
        x0 = [x0[name] for name in problem.state]
    wants = f"{n} numbers ({list_names(problem.state)}), or samples of shape (samples, {n})"
    x = np.atleast_1d(reals("x0", x0, wants))
    if not np.isfinite(x).all() or x.shape[-1] != n or x.ndim > 2:
        raise bad("x0", x0, wants)
    if problem.time is not None and period is None:
        period = problem.forcing_period
    if x.ndim == 2 and len(x) > 1:
        if period is None:
            raise bad("period", None, "a number > 0, with samples")
        if settle is not None:
            raise bad("settle", settle, "None with samples")
        closed = np.max(np.abs(x[-1] - x[0])) < 1e-6 * np.max(np.abs(x - x.mean(axis=0)))
        at = np.linspace(0.0, 1.0, len(x), endpoint=bool(closed))
        guesses = [sampled(problem, at, x, period, value, options.degree)]
        return _found(problem, guesses, options, "from the samples")
    x = x.reshape(n)
    run = Simulation(problem, units_of(problem, x))
    if period is not None:
        with notice("looking for a periodic orbit"):
            start = x if not settle else run(x, 0.0, _whole(problem, settle, period))[1][-1]
            turns = _turns(problem, run, start, period, value, options)
            where = f"from x0 = {x.tolist()} with period {period:.6g}"
            return _found(problem, turns, options, where)
    with notice("looking for a periodic orbit"):
        return _searched(problem, x, settle, run, value, options)


def _whole(problem: Problem, settle: float, period: float) -> float:
    """A time to settle that is whole periods of the forcing."""
    if problem.time is None:
        return settle
    return float(np.ceil(settle / period - 1e-9)) * period


def _with_period(ds: xr.Dataset, period: float | None) -> xr.Dataset:
    if "time" not in ds.dims or "time" not in ds.coords:
        raise bad("x0", list(map(str, ds.dims)), "states on the dim and coordinate 'time'")
    time = np.asarray(ds["time"].values, dtype=float)
    if period is None:
        period = float(time[-1] - time[0])
    inside = time - time[0] <= period * (1.0 + 1e-12)
    return ds.isel(time=inside).assign(period=period)


def _turns(
    problem: Problem, run: Simulation, x: Array, period: float, value: float, options: Any
) -> Iterator[Any]:
    """Guesses from one turn: even in time, then denser where the motion is fast."""
    for samples in (SAMPLES, 0):
        at, states = run(x, 0.0, period, samples)
        yield sampled(problem, at / period, states, period, value, options.degree)


def _found(problem: Problem, guesses: Iterable[Any], options: Any, where: str) -> Located:
    """The orbit that the first of some guesses leads to, over its least period."""
    said = ""
    for guess in guesses:
        cycles, found, said = _solved(problem, guess, options)
        if said:
            continue
        _check_repeats(problem, cycles, found.orbit)
        while (part := _part(problem, cycles, found.orbit)) is not None:
            shorter, once, failed = _solved(problem, part, options)
            if failed or abs(once.orbit.y[0] / part[0].y[0] - 1.0) > ALIKE:
                break
            cycles, found = shorter, once
        orbit = found.orbit
        refuse_jump_along(
            problem, Simulation(problem, np.ones(len(problem.state))).f,
            float(orbit.y[0]) * orbit.mesh, orbit.x[:: (len(orbit.x) - 1) // (len(orbit.mesh) - 1)],
        )  # fmt: skip
        return cycles, problem, found, where
    raise ConvergenceError(
        f"x0: no periodic orbit was found {where}: {said}; give another x0 or period, or settle="
    )


def _solved(problem: Problem, given: Any, options: Any) -> tuple[Any, Any, str]:
    """The orbit that a guess leads to, and its family; or why there is none."""
    guess, turns, multiple = given
    free = UNFOLDING in problem.parameters
    name = UNFOLDING if free else next(iter(problem.parameters))
    value = problem.parameters[name]
    # What unfolds a conservative family is a rate.
    width = 1.0 / float(guess.y[0]) if free else abs(value) or 1.0
    cycles = cycles_of(
        problem, [name], [(value - width, value + width)],
        scale_of(guess.x, units_of(problem, guess.x[0])), turns, options, multiple,
    )  # fmt: skip
    if free:
        found = starts.kept(cycles, guess, guess.x[0].copy())
    else:
        found = starts.settled(cycles, guess)
    if not found.converged:
        return cycles, found, found.message
    size = float(np.max(np.ptp(found.orbit.x, axis=0) / cycles.scale))
    if size < 1e-6 and not cycles.forced:
        led = "it led to an equilibrium"
        if not problem.conservative:
            led += " (orbits in families of one energy each want Problem(..., conservative=True))"
        return cycles, found, led
    if not free:
        found.orbit.y[1] = value
    elif abs(found.orbit.y[1]) * found.orbit.y[0] > UNCONSERVED:
        return cycles, found, (
            f"energy is not conserved along it: it needs a damping of {found.orbit.y[1]:.2g}"
        )  # fmt: skip
    return cycles, found, ""


def _part(problem: Problem, cycles: Any, orbit: Any) -> Any:
    """A guess of the orbit through which another one runs several times; None if it runs once.

    Parts are the same if they differ by no more than the errors of the mesh.
    """
    angle = np.array([problem.periods.get(name, 0.0) for name in problem.state])
    with np.errstate(all="ignore"):
        whole = np.where(angle > 0.0, np.round(cycles.turns / angle), 0.0)
    error = SURE * (cycles.mesh_error(orbit) + ROUNDING)
    # With a forcing of amplitude 0 f repeats itself after any part, which says nothing of others.
    steady = cycles.forced and _mismatch(problem, cycles, orbit, MOMENT) <= REPEATS
    for k in PRIMES:
        if np.any(whole % k):
            continue
        parted = cycles.forced and cycles.multiple % k > 0  # the period of the forcing, too
        if parted and (steady or not _mismatch(problem, cycles, orbit, 1.0 / k) <= REPEATS):
            continue
        at = np.linspace(0.0, 1.0 - 1.0 / k, 64 * k)
        one, next_ = (
            collocation.interpolate(orbit.mesh, orbit.x, cycles.m, shifted)
            for shifted in (at, np.minimum(at + 1.0 / k, 1.0))
        )
        gap = np.max(np.abs(next_ - cycles.turns / k - one), axis=0)
        if not np.all(gap <= error * cycles.amplitudes(orbit)):  # of a state at rest both are 0
            continue
        if parted:
            warn(
                f"problem: f repeats itself after 1/{k} of {orbit.y[0]:.6g}, to {REPEATS:g} of "
                "what it varies by in time, and so does this orbit: pk.Problem(..., period=...) "
                "of that leads to the least period"
            )
            continue
        mesh = np.append(orbit.mesh[orbit.mesh < 1.0 / k], 1.0 / k)
        count = max(len(mesh) - 1, starts.FIRST)
        mesh = np.interp(np.linspace(0.0, 1.0, count + 1), np.linspace(0.0, 1.0, len(mesh)), mesh)
        x = collocation.interpolate(
            orbit.mesh, orbit.x, cycles.m, collocation.times(mesh, cycles.m)
        )
        y = orbit.y.copy()
        y[0] /= k
        x[-1] = x[0] + cycles.turns / k
        multiple = cycles.multiple // k if cycles.forced else 1
        return Orbit(mesh * k, x, y[:2]), cycles.turns / k, multiple
    return None


def _mismatch(problem: Problem, cycles: Any, orbit: Orbit, part: float) -> float:
    """How far f is from repeating itself after a part of an orbit's period.

    It is looked at along the orbit and beside it.
    """
    states = orbit.x[np.linspace(0, len(orbit.x) - 1, MOMENTS).astype(int)]
    size = np.ptp(states, axis=0)
    size = np.where(size > 0.0, size, cycles.scale)
    aside = np.cos(np.arange(states.size).reshape(states.shape))
    f = Simulation(problem, np.ones(states.shape[1])).f
    period = float(orbit.y[0])
    return mismatch(f, states + aside * size, period, part * period)


def _check_repeats(problem: Problem, cycles: Any, orbit: Orbit) -> None:
    """Refuse a period of the forcing after which f is another one."""
    if cycles.forced and (gap := _mismatch(problem, cycles, orbit, 1.0)) > ANOTHER:
        raise bad(
            "period", orbit.y[0] / cycles.multiple, "a period of f in time",
            f"after it f differs by {gap:.2g} of what it varies by in time",
        )  # fmt: skip


class _TooManyValues(ConvergenceError):
    """A motion was left before its end."""


class Simulation:
    """The motion of a problem from a state."""

    def __init__(self, problem: Problem, units: Array, sign: float = 1.0) -> None:
        self.problem, self.units, n = problem, units, len(problem.state)
        self.sign = sign  # -1: backwards in time
        par = np.array([*problem.parameters.values(), *([0.0] if problem.time else [])])
        field: Any = problem.field

        if isinstance(field, PythonField):

            def f(t: float, x: Array) -> Array:
                time = {} if problem.time is None else {problem.time: t}
                return field.value(x.copy(), {**problem.parameters, **time})
        else:
            address = field.first(())
            w = np.zeros(n + n * (n + 1))

            def f(t: float, x: Array) -> Array:
                w[:n] = x
                if problem.time is not None:
                    par[-1] = t
                along.evaluate(address, par, w, n)
                return w[n : 2 * n].copy()

        self.f: Callable[[float, Array], Array] = f
        self.method: dict[str, Any] = {"method": "LSODA"}
        if isinstance(field, SparseField) and n >= MANY:  # where full matrices take all the time

            def slopes(t: float, x: Array) -> Any:
                return self.sign * field.matrix(x.copy(), problem.parameters)

            self.method = {"method": "BDF", "jac": slopes}

    def __call__(
        self, x: Array, begin: float, length: float, samples: int = 2, most: float = np.inf,
        bound: float = np.inf,
    ) -> tuple[Array, Array]:  # fmt: skip
        """Times and states of the motion over some time; without samples, its own steps in parts.

        So they are dense where the motion is fast. It ends where a state is larger than a bound; at
        most so many values of f are taken, after which it ends, too, or fails without a bound.
        """
        from scipy.integrate import solve_ivp

        taken, before = [0], [x]
        sticking = Sticking(self.f)
        last = [-np.inf, np.inf]  # the time of the last step, and at which it ends

        def f(t: float, x: Array) -> Array:
            taken[0] += 1
            if taken[0] > most and not bounded:
                raise _TooManyValues(
                    f"x0: {most:g} values of f do not lead from {start.tolist()} over the time "
                    f"{length:.4g}; give a period"
                )
            if self.problem.kind != "symbolic":
                if (held := sticking.meets(t, before[0], x)) is not None:
                    raise jumping(self.problem, held, x)
                before[0] = x.copy()
            return self.sign * self.f(t, x)

        def within(t: float, x: Array) -> float:
            if t == last[0]:
                return 0.0  # steps came to nothing where it is infinite in finite time
            if taken[0] > most and not np.isfinite(last[1]):
                last[1] = 0.5 * (last[0] + t)
            last[0] = t
            return min(bound - float(np.max(np.abs(x / self.units))), last[1] - t)

        within.terminal = True  # type: ignore[attr-defined]
        bounded = np.isfinite(bound)

        start = x
        at = np.linspace(begin, begin + length, samples) if samples else None
        with np.errstate(all="ignore"), warnings.catch_warnings():
            warnings.simplefilter("ignore")  # what LSODA says is said by its status, too
            try:
                solution = solve_ivp(
                    f, (begin, begin + length), x, t_eval=at, rtol=1e-8, **self.method,
                    dense_output=not samples, events=within if bounded else None,
                    atol=1e-10 * (float(np.max(np.abs(x) / self.units)) or 1e-6) * self.units,
                )  # fmt: skip
            except (ValueError, ArithmeticError) as error:
                if isinstance(error, ParameterError):
                    raise
                raise ConvergenceError(
                    f"x0: the simulation from {x.tolist()} failed: {error}"
                ) from error
        states = np.asarray(solution.y)  # an empty list where f has no value at the start
        short = states.shape[-1] < (2 if bounded else samples)
        if not (solution.success or bounded) or not np.isfinite(states).all() or short:
            raised = self.problem.field.raised.removeprefix(": ")
            raise ConvergenceError(
                f"x0: the simulation from {x.tolist()} did not reach the time {length:.6g}: "
                f"{raised or solution.message}"
            )
        if at is None:
            steps = np.arange(PARTS * (len(solution.t) - 1) + 1.0) / PARTS
            at = np.interp(steps, np.arange(len(solution.t)), solution.t)
            return at - begin, solution.sol(at).T
        return solution.t - begin, solution.y.T


def _searched(
    problem: Problem, x: Array, settle: float | None, run: Simulation, value: float,
    options: Any,
) -> Located:  # fmt: skip
    """The orbit near a state from which a simulation returns, after ever longer transients."""
    if not np.isfinite(run.f(0.0, x)).all():
        raise ConvergenceError(f"x0: f has no value at {x.tolist()}{problem.field.raised}")
    if settle:
        x = run(x, 0.0, settle)[1][-1]
    said: ConvergenceError | None = None
    start, waited, unit = x, 0.0, 0.0
    for times, most in TURNS if settle is None else TURNS[-1:]:
        cut = isinstance(said, _TooManyValues) and not times
        if said is not None and not (times or cut):
            break  # all of the first motion has been looked at
        try:
            x = run(x, 0.0, (times - waited) * unit, most=MOST)[1][-1] if times else start
            waited = times
            unit = unit or _pace(run, x)
            period = _return(problem, x, run, most)
            unit = period if waited == 0.0 else unit
            guesses = _turns(problem, run, x, period, value, options)
            return _found(problem, guesses, options, f"after a return in {period:.6g}")
        except ConvergenceError as error:
            said = error if cut else said or error
    raise ConvergenceError(f"x0: no periodic orbit was found; at first: {said}") from said


def _pace(run: Simulation, x: Array) -> float:
    """A time in which the state moves by about its own size."""
    speed, size = (float(np.linalg.norm(one / run.units)) for one in (run.f(0.0, x), x))
    return 10.0 * (size or 1e-3) / speed if speed > 0.0 else 0.0


def _return(problem: Problem, x: Array, run: Simulation, most: float) -> float:
    """Time until the motion crosses the plane across its start again, where it started."""
    pace = _pace(run, x)
    if not pace > 0.0:
        raise ConvergenceError("x0: it is an equilibrium; give a state off it")
    angles = np.array([problem.periods.get(name, 0.0) for name in problem.state])
    length = 2.0 * pace
    for _ in range(8):
        at, states = run(x, 0.0, length, SAMPLES, most)
        gaps = states - x
        for i in np.flatnonzero(angles > 0.0):
            gaps[:, i] -= angles[i] * np.round(gaps[:, i] / angles[i])
        sizes = np.ptp(states, axis=0)
        # What a state at rest moves by is the error of the simulation, which does not return.
        largest = np.max(sizes / run.units, where=angles == 0.0, initial=0.0)
        sizes = np.maximum(sizes, STILL * largest * run.units)
        sizes = np.where(angles > 0.0, np.where(angles > 0.0, angles, 1.0), sizes)
        sizes = np.where(sizes > 0.0, sizes, 1.0)
        normal = run.f(0.0, x) / sizes**2
        side = gaps @ normal
        crossing = np.flatnonzero((side[:-1] < 0.0) & (side[1:] >= 0.0))
        crossing = crossing[crossing > 0]
        # In the plane, not beside it by a part of a step.
        part = side[crossing] / (side[crossing] - side[crossing + 1])
        there = gaps[crossing] + part[:, None] * (gaps[crossing + 1] - gaps[crossing])
        close = np.sqrt(np.mean((there / sizes) ** 2, axis=1))
        if np.any(close < 0.25):
            # The first return that is about as near as any.
            k = np.flatnonzero(close <= 2.0 * np.min(close) + 0.01)[0]
            step = at[crossing[k] + 1] - at[crossing[k]]
            return float(at[crossing[k]] + part[k] * step)
        length *= 3.0
    raise ConvergenceError(
        f"x0: the motion from {x.tolist()} does not return within {length / 3.0:.4g}; give a period"
    )
