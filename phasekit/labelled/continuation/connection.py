"""`connection`: orbits that lead from one equilibrium to another one, or back to it."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
import numpy.typing as npt
import xarray as xr

from phasekit.bifurcation.continuation.curve import Stop
from phasekit.bifurcation.continuation.options import ContinuationOptions
from phasekit.bifurcation.continuation.walk import run
from phasekit.cycles import collocation, starts
from phasekit.cycles.bounded import Bounded
from phasekit.cycles.connections import (
    Ends,
    Rest,
    ends_of,
    extended,
    planes,
    rest_near,
)
from phasekit.cycles.cycle_walk import CycleWalk
from phasekit.cycles.cycles import Orbit, Solution
from phasekit.cycles.small_loops import SmallLoops
from phasekit.errors import ConvergenceError
from phasekit.inputs import call_checked
from phasekit.labelled.continuation.bounded_start import bounded_of
from phasekit.labelled.continuation.branch import branch_of
from phasekit.labelled.continuation.checks import check_options, check_parameter, check_span
from phasekit.labelled.continuation.cycle_branch import ConnectionBranch
from phasekit.labelled.continuation.orbit_guess import scale_of, units_of
from phasekit.labelled.continuation.periodic_orbit import Simulation
from phasekit.labelled.continuation.unfolding import UNFOLDING, unfolded
from phasekit.labels.arguments import bad, list_names, number, reals
from phasekit.numerics.waits import notice
from phasekit.systems.cycle_families import first_point
from phasekit.systems.problem import Problem, as_problem

FloatArray = npt.NDArray[np.float64]

MESH = 1e-10  # mesh tolerance, unless options say otherwise
HYPERBOLIC = 1e-9  # least real part of an eigenvalue, beside the largest size
AWAY = 1e-3  # distance from an equilibrium at which a motion along its manifold begins
AIMED, NEAR = 20, 1e-4  # shots at a target, and how near one is good enough
AIMS, WORSE = (1e-3, 1e-5), 1.5  # first changes of the parameter, and by what a shot may be worse
TRIES = 24  # directions in which a manifold of more than one dimension is left
PASSES = 12.0  # times the slowest time of both ends, over which an orbit is looked for
CURVES = 1e-6  # distance of ends along curves: nearer ones say less of the time between them
ROUNDS, LOOSE = 4, 3.0  # times that an end is led on, and how far from where it is to be
FAR = 0.5  # how far an equilibrium moves, beside the size of the orbit, as parameters do
SIZES = (0.1, 0.03, 0.01, 0.003, 0.001, 3e-4, 1e-4, 1e-5)  # of orbits beside a point
BEGUN = 1e-2  # distance of their ends at first: a shorter orbit asks less of a guess
SMALL = 100.0  # times the distance of the ends, below which an orbit is its equilibrium


@call_checked
def connection(
    problem: Any,
    orbit: Any,
    free: str | Sequence[str] | None = None,
    *,
    ends: float = 1e-7,
    options: ContinuationOptions | None = None,
) -> ConnectionBranch:
    """Find an orbit that connects equilibria, and the parameters at which it does.

    Parameters
    ----------
    problem : Problem or system
        The system, near parameters of the orbit. Of a conservative one a damping is freed, which is
        zero then.
    orbit : xarray.Dataset, or a pair of states
        A guess: a periodic orbit of a long period (`periodic_orbit`, ``branch.orbit(i)``), cut
        where it is slowest; the states on ``time``, from one equilibrium to the other; or the
        states ``(from_, to)`` of both equilibria, between which a motion along an unstable manifold
        is looked for.
    free : str or sequence of str, optional
        The parameters that follow: one for an orbit from a saddle to itself; ``n + 1 - u - s`` of n
        states, u unstable directions at the source and s stable ones at the target.
    ends : float, default 1e-7
        Distance of the ends of the orbit from the equilibria, beside its size.
    options : ContinuationOptions, optional
        Mesh, tolerances, scales; the mesh tolerance is 1e-10 by default.

    Returns
    -------
    ConnectionBranch
        A branch of one point; ``.curve(parameter, span)`` follows it along one parameter more.

    Raises
    ------
    ParameterError
        If an argument is unusable, an end is no hyperbolic equilibrium, or the number of free
        parameters does not fit. A forced problem is refused: what it connects are cycles.
    ConvergenceError
        If no orbit is found.

    Notes
    -----
    Solved by collocation over a finite time, with the ends in the planes of the invariant manifolds
    ([Beyn1990]). What that is off by goes with the square of their distance; ``truncation_error``
    is that, to first order, from how the manifolds bend.

    Examples
    --------
    >>> import phasekit as pk
    >>> nagumo = pk.Problem(
    ...     {"u": "v", "v": "c*v - u*(1 - u)*(u - a)"}, parameters={"c": 0.3, "a": 0.3}
    ... )
    >>> front = pk.connection(nagumo, ([0, 0], [1, 0]), free="c")
    >>> round(float(front.points.c[0]), 9)  # sqrt(2) (1/2 - a)
    0.282842712
    >>> curve = front.curve("a", (0.2, 0.4))
    >>> curve.stops[1].reason
    'bound'
    """
    problem = as_problem(problem, moving=True)
    if problem.map:
        raise bad("problem", problem, "a flow x' = f(x)")
    if problem.time is not None:
        raise bad(
            "problem", problem, "one whose f does not depend on time",
            "a forced problem has cycles for equilibria, and connections to cycles are not "
            "followed; of a ramp make the ramped parameter a state",
        )  # fmt: skip
    ends = number("ends", ends, "a number > 0, at most 0.1", None)
    if not 0.0 < ends <= 0.1:
        raise bad("ends", ends, "a number > 0, at most 0.1")
    if options is None:
        options = ContinuationOptions(mesh_tolerance=MESH)
    options = check_options(options)
    if problem.conservative and len(problem.state) > 1:
        problem = unfolded(problem)
        free = UNFOLDING if free is None else free
    names = _free(problem, free)
    with notice("looking for a connection"):
        return _found(problem, orbit, names, ends, options)


def _free(problem: Problem, free: Any) -> list[str]:
    given = [free] if isinstance(free, str) else free
    if not isinstance(given, (list, tuple)) or not given:
        raise bad("free", free, "one or more names of parameters")
    names = [check_parameter(problem, name) for name in given]
    if len(set(names)) != len(names):
        raise bad("free", free, "different parameters")
    return names


def _found(
    problem: Problem, given: Any, names: list[str], ends: float, options: ContinuationOptions
) -> ConnectionBranch:
    n = len(problem.state)
    values = [float(problem.parameters[name]) for name in names]
    spans = [_around(value) for value in values]
    trial = bounded_of(
        problem, names, spans, np.ones(n), options, (), kind="connection", duration=None
    )
    y = np.array([1.0, *values])
    guesses = _guesses(problem, trial, given, y)
    said = "no motion along the unstable manifold comes near the target"
    for guess, same, places in guesses:
        scale = scale_of(guess.x - guess.x[0], units_of(problem, guess.x[0]))
        scale = np.array(
            [options.scales.get(s, one) for s, one in zip(problem.state, scale, strict=True)]
        )
        made = replace(trial, scale=scale)
        found, why = _settled(problem, made, guess, (same, *places), names, ends)
        if found is None:
            said = why
            continue
        bounded, solution = found
        start = first_point(bounded, solution, "")
        origin = Stop("start", "one orbit; .curve(parameter) follows it along one parameter more")
        walker = CycleWalk(bounded)
        return branch_of(ConnectionBranch, problem, walker, start, (None, None), {}, origin)
    raise ConvergenceError(
        f"connection: no orbit was found near {', '.join(map(_equation, names, values))}: {said}; "
        "give other parameters, or an orbit"
    )


def _equation(name: str, value: float) -> str:
    return f"{name} = {value:.9g}"


def _around(value: float) -> tuple[float, float]:
    reach = 10.0 * max(abs(value), 1.0)
    return value - reach, value + reach


def _settled(
    problem: Problem, made: Bounded, guess: Orbit, places: tuple[bool, Any, Any],
    names: list[str], ends: float,
) -> tuple[tuple[Bounded, Solution] | None, str]:  # fmt: skip
    """The connection that a guess leads to; or why there is none."""
    n, same = made.n, places[0]
    rests = [rest_near(made, x, guess.y) for x in places[1:]]
    for rest, where in zip(rests, ("first", "last"), strict=True):
        if rest is None:
            return None, f"there is no equilibrium near the {where} state"
    first, last = rests
    assert first is not None
    assert last is not None
    _check_hyperbolic(problem, first, last)
    unstable, stable = first.unstable(), n - last.unstable()
    wanted = n + 1 - unstable - stable
    if len(names) != wanted:
        count = f"{wanted} free parameter{'s' if wanted != 1 else ''}"
        if wanted < 1:
            count = "none: such orbits come in families at every parameter, which are not followed"
        raise bad(
            "free", names, count,
            f"the source has {unstable} unstable directions, the target {stable} stable ones, of "
            f"{n} states",
        )  # fmt: skip
    own = Ends(unstable, stable, (ends, ends), same, n, both=False)
    bounded = replace(made, conditions=(own,))
    near: tuple[Rest, Rest] = (first, last)
    for _ in range(ROUNDS):
        led = extended(guess, bounded, near, own.distances)
        found = starts.settled(bounded, led, held=0)
        if not found.converged:
            return None, found.message
        there = own.rests(bounded, found.orbit)
        if there is None:
            return None, "the equilibria were lost"
        guess, near = found.orbit, there
        end = (guess.x[-1] - there[1].x) / bounded.scale
        if np.linalg.norm(end) <= LOOSE * ends:
            break
    size = float(np.max(np.abs((found.orbit.x - found.orbit.x[0]) / bounded.scale)))
    if size < SMALL * ends:
        return None, "it led to the equilibrium itself"
    if float(np.max(np.abs(near[1].x - last.x) / bounded.scale)) > FAR:
        return None, "it led to another equilibrium"
    return (bounded, found), ""


def _check_hyperbolic(problem: Problem, first: Rest, last: Rest) -> None:
    for rest, where in ((first, "source"), (last, "target")):
        values = rest.eigenvalues()
        least = float(np.min(np.abs(values.real)))
        if least <= HYPERBOLIC * float(np.max(np.abs(values))):
            raise bad(
                "orbit", rest.x.tolist(), "hyperbolic equilibria",
                f"the {where} has an eigenvalue with the real part {least:.3g}",
            )  # fmt: skip


# ------------------------------------------------------------------------------ guesses


def _guesses(problem: Problem, trial: Bounded, given: Any, y: FloatArray) -> Any:
    """Guesses of the orbit, whether it comes back to its equilibrium, and where its ends are."""
    if isinstance(given, xr.Dataset):
        return [_of_dataset(problem, trial, given, y)]
    if not isinstance(given, (list, tuple)) or len(given) != 2:
        raise bad("orbit", given, "a Dataset of an orbit, or a pair of states (from_, to)")
    states = [_state(problem, one) for one in given]
    rests = [rest_near(trial, x, y) for x in states]
    for rest, x in zip(rests, states, strict=True):
        if rest is None:
            raise bad("orbit", x.tolist(), "states near equilibria")
    return _along_manifold(problem, trial, (rests[0], rests[1]), y)


def _state(problem: Problem, given: Any) -> FloatArray:
    names = list_names(problem.state)
    if isinstance(given, Mapping):
        if set(given) != set(problem.state):
            raise bad("orbit", list(given), f"a value for each of {names}")
        given = [given[name] for name in problem.state]
    wants = f"states of {len(problem.state)} numbers: {names}"
    x = np.atleast_1d(reals("orbit", given, wants))
    if x.shape != (len(problem.state),) or not np.isfinite(x).all():
        raise bad("orbit", given, wants)
    return x


def _of_dataset(
    problem: Problem, trial: Bounded, ds: xr.Dataset, y: FloatArray
) -> tuple[Orbit, bool, tuple[FloatArray, FloatArray]]:
    missing = [name for name in problem.state if name not in ds]
    if missing or "time" not in ds.coords or ds.sizes.get("time", 0) < 8:
        raise bad("orbit", list(map(str, ds.data_vars)), "all states on 'time'")
    time = np.asarray(ds["time"].values, dtype=float)
    x = np.stack([np.asarray(ds[name].values, dtype=float) for name in problem.state], axis=1)
    back = "period" in ds
    same = back
    if back:
        f = np.array([problem.derivatives(one)[0] for one in x[:-1]])
        size = np.ptp(x, axis=0)
        size = np.where(size > 0.0, size, 1.0)
        slow = int(np.argmin(np.linalg.norm(f / size, axis=1)))
        turn = x[-1] - x[0]
        same = bool(np.max(np.abs(turn) / size) < 1e-6)
        x = np.concatenate([x[slow:], x[1 : slow + 1] + turn])
        time = np.concatenate([time[slow:], time[1 : slow + 1] + time[-1] - time[0]])
    ends = (x[0], x[0] if same else x[-1])
    return _through(trial, time - time[0], x, y), same, ends


def _through(trial: Bounded, time: FloatArray, x: FloatArray, y: FloatArray) -> Orbit:
    """An orbit through samples."""
    from scipy.interpolate import PchipInterpolator

    m, length = trial.m, float(time[-1])
    count = int(np.clip(len(time) // m, starts.FIRST, 400))
    rows = np.linspace(0.0, len(time) - 1.0, count + 1)
    mesh = np.interp(rows, np.arange(len(time)), time / length)
    mesh[0], mesh[-1] = 0.0, 1.0
    at = PchipInterpolator(time / length, x, axis=0)(collocation.times(mesh, m))
    return Orbit(mesh, np.ascontiguousarray(at), np.array([length, *y[1:]]))


def _along_manifold(
    problem: Problem, trial: Bounded, rests: tuple[Any, Any], y: FloatArray
) -> Iterator[tuple[Orbit, bool, tuple[FloatArray, FloatArray]]]:
    """Motions along the unstable manifold that come near the target, the nearest first.

    Or backwards along the stable manifold of the target, where that has fewer dimensions. Those of
    one parameter are shot at it.
    """
    first, last = rests
    n = trial.n
    unstable, stable = first.unstable(), n - last.unstable()
    if not (unstable and stable):
        end = "source has no unstable" if not unstable else "target has no stable"
        raise bad(
            "orbit", [first.x.tolist(), last.x.tolist()], f"other states: the {end} direction"
        )
    same = bool(np.max(np.abs(first.x - last.x)) <= 1e-9 * (1.0 + np.max(np.abs(first.x))))
    places = (first.x, last.x)
    shots = [(way, _shot(problem, trial, rests, y, way)) for way in _ways(min(unstable, stable))]
    near = sorted(((w, s) for w, s in shots if s is not None), key=lambda one: float(one[1][0]))
    for _, shot in near[:3]:
        yield _through(trial, shot[2], shot[3], y), same, places
    if min(unstable, stable) == 1 and len(y) == 2 and unstable + stable == n:
        for way, shot in near:
            for step in AIMS:
                aimed = _aimed(problem, trial, rests, y, way, shot, step)
                if not aimed:
                    continue
                one = min(aimed, key=lambda one: float(one[0]))
                yield _through(trial, one[1][0], one[1][1], one[2]), same, places


def _shot(
    problem: Problem, trial: Bounded, rests: tuple[Any, Any], y: FloatArray, way: FloatArray
) -> Any:
    """A motion along a manifold up to where it comes near the other end.

    Its distance from that, by how much it passes on one side, beside its size, times and states;
    None if it never comes near.
    """
    first, last = rests
    unstable, stable = first.unstable(), trial.n - last.unstable()
    forward = unstable <= stable
    begin, end, sign = (first, last, 1.0) if forward else (last, first, -1.0)
    plane, _ = planes(begin.A, unstable if forward else stable, stable=not forward)
    across = planes(end.A, stable if forward else unstable, stable=forward)[1]
    gap = float(np.linalg.norm(last.x - first.x))
    size = gap or max(1.0, float(np.linalg.norm(first.x)))
    names = [problem.field.parameters[i] for i in trial.active]
    here = problem.replace(**dict(zip(names, y[1:].tolist(), strict=True)))
    run = Simulation(here, units_of(problem, first.x + 1e-3 * size), sign)
    slow = [np.min(np.abs(rest.eigenvalues().real)) for rest in rests]
    longest = PASSES * sum(1.0 / one for one in slow)
    turned = plane * np.sign(plane[np.argmax(np.abs(plane), axis=0), range(plane.shape[1])])
    try:
        at, x = run(begin.x + AWAY * size * (turned @ way), 0.0, longest, 4001, bound=1e3 * size)
    except ConvergenceError:
        return None
    far, gone = (np.linalg.norm(x - rest.x, axis=1) for rest in (end, begin))
    # Nearest after it has been away.
    left = np.flatnonzero(gone > 0.2 * (gap or float(np.max(gone))))
    if not len(left):
        return None
    k = left[0] + _first_low(far[left[0] :])
    if k < 8:
        return None
    top = float(np.max(gone[: k + 1]))
    sideways = across * np.sign(across[np.argmax(np.abs(across), axis=0), range(across.shape[1])])
    passes = float((sideways.T @ (x[k] - end.x))[0]) / top if across.shape[1] else 0.0
    orbit = (at[: k + 1], x[: k + 1]) if forward else (at[k] - at[k::-1], x[k::-1])
    return float(far[k]) / top, passes, *orbit


def _aimed(
    problem: Problem, trial: Bounded, rests: tuple[Any, Any], y: FloatArray, way: FloatArray,
    shot: Any, step: float,
) -> list[Any]:  # fmt: skip
    """Motions at other values of the one free parameter, which pass the target by less."""
    made = []
    p, best = float(y[1]), shot
    size = max(abs(p), 1e-2)
    step *= size
    for _ in range(AIMED):
        if best[0] < NEAR or not abs(step) > 1e-12 * size:
            break
        at = np.array([y[0], p + step])
        moved = tuple(rest_near(trial, rest.x, at) for rest in rests)
        other = None
        if not any(
            now is None or now.unstable() != was.unstable()
            for now, was in zip(moved, rests, strict=True)
        ):
            other = _shot(problem, trial, (moved[0], moved[1]), at, way)
        if other is None or other[0] > WORSE * best[0]:
            step *= -0.5  # it passes on the other side, or goes elsewhere
            continue
        made.append((other[0], other[2:], at))
        rate = (other[1] - best[1]) / step
        p, best = p + step, other
        most = 0.3 * max(abs(p), 0.1)
        step = float(np.clip(-best[1] / rate, -most, most)) if rate else 0.0
    return made


def _first_low(far: FloatArray) -> int:
    """The first minimum of a distance that is not much larger than the least."""
    lows = np.flatnonzero((far[1:-1] <= far[:-2]) & (far[1:-1] <= far[2:])) + 1
    if not len(lows):
        return int(np.argmin(far))
    good = lows[far[lows] <= 2.0 * np.min(far[lows])]
    return int(good[0])


def _ways(count: int) -> list[FloatArray]:
    """Directions of a plane of one, two or more dimensions."""
    if count == 1:
        return [np.ones(1), -np.ones(1)]
    if count == 2:
        angle = 2.0 * math.pi * np.arange(TRIES) / TRIES
        return list(np.stack([np.cos(angle), np.sin(angle)], axis=1))
    random = np.random.default_rng(7).standard_normal((2 * TRIES, count))
    return list(random / np.linalg.norm(random, axis=1, keepdims=True))


# ------------------------------------------------------------------------------ curves


def curve(branch: ConnectionBranch, parameter: str, span: Any, options: Any) -> ConnectionBranch:
    """The curve of connections along one parameter more."""
    bounded, problem = branch.walker.curve, branch.problem
    assert isinstance(bounded, Bounded)
    check_parameter(problem, parameter)
    if parameter in branch.free:
        raise bad("parameter", parameter, f"another one than {', '.join(branch.free)}")
    own = ends_of(bounded)
    if own.both:
        raise bad("branch", branch, "a single connection, which a curve begins at")
    options = bounded.options if options is None else check_options(options)
    value = float(problem.parameters[parameter])
    low, high = _around(value) if span is None else check_span(span)
    if not low <= value <= high:
        raise bad("span", (low, high), f"a span that holds {parameter} = {value:.9g}")
    names = [*branch.free, parameter]
    here = branch.path[0].orbit
    spans = [options.bounds.get(name, _around(float(here.y[1 + k])))
             for k, name in enumerate(branch.free)]  # fmt: skip
    near = max(own.distances[0], CURVES)
    own = replace(own, distances=(near, near), both=True)
    made = bounded_of(
        problem, names, [*spans, (low, high)], bounded.scale, options, (own,), kind="connection",
        duration=None,
    )  # fmt: skip
    here = Orbit(here.mesh, here.x, np.append(here.y, value))
    return _followed(problem, made, here, branch.record)


def _followed(problem: Problem, made: Bounded, guess: Orbit, record: Any) -> ConnectionBranch:
    """The curve through an orbit near a guess."""
    ends = ends_of(made)
    rests = ends.rests(made, guess)
    assert rests is not None
    here = extended(guess, made, rests, ends.distances)
    width = made.width.copy()
    width[:-1] = np.minimum(width[:-1], np.maximum(np.abs(here.y[1:-1]), 0.1 * width[-1]))
    made = replace(made, width=width)
    name = problem.field.parameters[made.active[-1]]
    start = first_point(made, starts.settled(made, here), f"at {name} = {here.y[-1]:.9g}")
    if start.dy[-1] < 0.0:
        start = start.flipped()
    walker = CycleWalk(made)
    tracks = run(walker, start, made.options.directions)
    return branch_of(ConnectionBranch, problem, walker, start, tracks, record)


def small_loops(
    problem: Problem, free: Sequence[str], spans: Sequence[tuple[float, float]],
    loops: SmallLoops, options: ContinuationOptions,
) -> ConnectionBranch:  # fmt: skip
    """The curve of homoclinic orbits that begins at a Bogdanov-Takens point."""
    n, failure = len(problem.state), ""
    for size in SIZES:
        orbit, saddle, held = loops.of_size(size, options.degree)
        here = problem.replace(**dict(zip(free, orbit.y[1:].tolist(), strict=True)))
        # On scales of its own, on which Newton's steps are short; the curve on those of the states.
        own = scale_of(orbit.x - saddle, units_of(here, saddle))
        made = bounded_of(
            here, free, spans, own, options, (), kind="connection", duration=None
        )  # fmt: skip
        rest = rest_near(made, saddle, orbit.y)
        if rest is None or np.max(np.abs(rest.x - saddle) / own) > FAR:
            failure = "no saddle was found beside it"
            continue
        found = replace(orbit, x=orbit.x + (rest.x - saddle))
        last = CURVES * max(1.0, float(np.max(loops.scale / own)))  # on the scales of the states
        for near in (BEGUN, min(last, BEGUN)):
            ends = Ends(rest.unstable(), n - rest.unstable(), (near, near), True, n)
            made = replace(made, conditions=(ends,))
            guess = extended(found, made, (rest, rest), ends.distances)
            solution = starts.settled(made, guess, held=held)
            found, rest = solution.orbit, rest_near(made, rest.x, solution.orbit.y)
            if not solution.converged or rest is None:
                break
        if not solution.converged or rest is None:
            failure = solution.message
            continue
        ends = replace(ends, distances=(CURVES, CURVES))
        before, after = (np.max(np.ptp(one.x, axis=0) / own) for one in (orbit, found))
        if not 0.5 * before < after < 2.0 * before:
            failure = "an orbit of another size was found"
            continue
        made = replace(made, conditions=(ends,), scale=np.maximum(own, loops.scale))
        return _followed(here, made, found, {})
    raise ConvergenceError(
        f"switch: no homoclinic orbit was found beside the Bogdanov-Takens point: {failure}"
    )
