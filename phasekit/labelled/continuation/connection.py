"""`connection`: orbits that lead from one equilibrium to another one, or back to it."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from phasekit.arrays import Array
from phasekit.bifurcation.continuation.curve import Stop
from phasekit.bifurcation.continuation.options import ContinuationOptions
from phasekit.cycles import starts
from phasekit.cycles.bounded import Bounded
from phasekit.cycles.connections import Ends, Rest, blur, ends_of, extended, lost, rest_near
from phasekit.cycles.cycle_walk import CycleWalk
from phasekit.cycles.cycles import Orbit, Solution
from phasekit.cycles.small_loops import SmallLoops
from phasekit.errors import ConvergenceError
from phasekit.inputs import call_checked
from phasekit.labelled.continuation.bounded_start import bounded_of
from phasekit.labelled.continuation.branch import branch_of
from phasekit.labelled.continuation.checks import check_options, check_parameter, check_span
from phasekit.labelled.continuation.connection_guess import (
    WIDTHS,
    given_states,
    guesses,
    parameter_sizes,
    sizes_near,
)
from phasekit.labelled.continuation.cycle_branch import ConnectionBranch
from phasekit.labelled.continuation.orbit_guess import scale_of, units_of
from phasekit.labelled.continuation.unfolding import UNFOLDING, unfolded
from phasekit.labels.arguments import bad, number
from phasekit.numerics.interrupts import keeps
from phasekit.numerics.waits import notice
from phasekit.systems.cycle_families import first_point
from phasekit.systems.problem import Problem, as_problem
from phasekit.systems.smooth import refuse_jumps

MESH = 1e-10  # mesh tolerance, unless options say otherwise
HYPERBOLIC = 1e-8  # least real part of an eigenvalue, beside the largest size
CURVES = 1e-6  # distance of ends along curves: nearer ones say less of the time between them
ROUNDS, LOOSE = 4, 3.0  # times that an end is led on, and how far from where it is to be
FAR = 0.5  # how far an equilibrium moves, beside the size of the orbit, as parameters do
SIZES = (0.1, 0.03, 0.01, 0.003, 0.001, 3e-4, 1e-4, 1e-5)  # of orbits beside a point
BEGUN = 1e-2  # distance of their ends at first: a shorter orbit asks less of a guess
ONE = 1e-2  # of that distance, within which two ways to an equilibrium lead to one
SHARP = 1e8  # times rounding of an equilibrium, from where on distances from it have digits
ROUNDING = 1e-12  # of an equilibrium, beside its states and their scales
ASTRAY = 100.0  # the same, from where on it is no connection
SMALL = 100.0  # times the distance of the ends, below which an orbit is its equilibrium


@call_checked
@keeps
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
        is looked for: first on the side on which ``from_`` lies, if it is clearly off its saddle.
        If the other side may have an orbit, too, the message of ``stops[0]`` says so.
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
    refuse_jumps(problem)
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
    if not all(isinstance(name, str) for name in given):
        hint = "a pair of equilibria is one argument: ([0, 0], [1, 1])"
        raise bad("free", free, "one or more names of parameters", hint)
    names = [check_parameter(problem, name, "free: parameter") for name in given]
    if len(set(names)) != len(names):
        raise bad("free", free, "different parameters")
    return names


def _found(
    problem: Problem, given: Any, names: list[str], ends: float, options: ContinuationOptions
) -> ConnectionBranch:
    n = len(problem.state)
    values = [float(problem.parameters[name]) for name in names]
    y, states = np.array([1.0, *values]), given_states(problem, given)
    trial = _trial(problem, names, values, np.ones(n), options)
    trial = _trial(problem, names, values, sizes_near(problem, trial, states, y), options)
    trial = _trial(
        problem, names, values, trial.scale, options, parameter_sizes(trial, states, y).tolist()
    )
    said = "no motion along the unstable manifold comes near the target"
    for guess, same, places, beside in guesses(problem, trial, given, y):
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
        there = ", ".join(map(_equation, names, solution.orbit.y[1:].tolist()))
        asked = ", ".join(map(_equation, names, values))
        origin = Stop(
            "start",
            f"one orbit at {there}, looked for from {asked}; .curve(parameter) follows it along "
            f"one parameter more{beside and '; '}{beside}",
        )
        walker = CycleWalk(bounded)
        return branch_of(ConnectionBranch, problem, walker, start, {}, (None, None), origin)
    raise ConvergenceError(
        f"connection: no orbit was found near {', '.join(map(_equation, names, values))}: {said}; "
        "give other parameters, or an orbit"
    )


def _equation(name: str, value: float) -> str:
    return f"{name} = {value:.9g}"


def _trial(
    problem: Problem, names: list[str], values: list[float], scale: Any,
    options: ContinuationOptions, sizes: Sequence[float] | None = None,
) -> Bounded:  # fmt: skip
    """Connections on scales, over parameters of sizes."""
    sizes = [abs(value) or 1.0 for value in values] if sizes is None else sizes
    spans = list(map(_around, values, sizes))
    return bounded_of(problem, names, spans, scale, options, (), kind="connection", duration=None)


def _around(value: float, size: float) -> tuple[float, float]:
    reach = 0.5 * WIDTHS * size
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
    for trusted in (BEGUN, *[0.0] * (ROUNDS - 1)):
        led = extended(guess, bounded, near, own.distances, trusted)
        found = starts.settled(bounded, led, held=0)
        if not found.converged:
            return None, lost(bounded, found.orbit) or found.message
        there = own.rests(bounded, found.orbit)
        if there is None:
            return None, "the equilibria were lost"
        begun = [rest_near(bounded, one.x, found.orbit.y) for one in near]
        if None in begun:
            return None, "the equilibria were lost"
        if not all(
            _is_the_same(bounded, was, one, now, ends)
            for was, one, now in zip(near, begun, there, strict=True) if one is not None
        ):  # fmt: skip
            return None, "another equilibrium is nearer to an end of the orbit than its end is"
        guess, near = found.orbit, there
        off = [(guess.x[k] - there[k].x) / bounded.scale for k in (0, -1)]
        if (away := max(np.linalg.norm(one) for one in off)) <= LOOSE * ends:
            break
    else:
        if away > ASTRAY * ends:
            return None, "the ends of the orbit that was found stay off the equilibria"
    size = float(np.max(np.abs((found.orbit.x - found.orbit.x[0]) / bounded.scale)))
    if size < SMALL * ends:
        return None, "it led to the equilibrium itself"
    if float(np.max(np.abs(near[1].x - last.x) / bounded.scale)) > FAR:
        return None, "it led to another equilibrium"
    return (bounded, found), ""


def _is_the_same(bounded: Bounded, was: Rest, found: Rest, now: Rest, ends: float) -> bool:
    """Whether the equilibrium at an end is the one that was there before parameters moved.

    It is the one that Newton's method finds from that, up to rounding of its states; or one that is
    nearer to that, where Newton's method went astray.
    """
    rounding = ROUNDING * (1.0 + float(np.max(np.abs(now.x) / bounded.scale)))
    apart, away, gone = (
        float(np.max(np.abs(a.x - b.x) / bounded.scale))
        for a, b in ((found, now), (was, now), (was, found))
    )
    return apart <= max(ONE * ends, rounding) or away < gone


def _check_hyperbolic(problem: Problem, first: Rest, last: Rest) -> None:
    for rest, where in ((first, "source"), (last, "target")):
        values = rest.eigenvalues()
        least = float(np.min(np.abs(values.real)))
        if least <= HYPERBOLIC * float(np.max(np.abs(values))):
            raise bad(
                "orbit", rest.x.tolist(), "hyperbolic equilibria",
                f"the {where} has an eigenvalue with the real part {least:.3g}",
            )  # fmt: skip


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
    options = check_options(options, bounded.options)
    value = float(problem.parameters[parameter])
    names = [*branch.free, parameter]
    here = branch.path[0].orbit
    y = np.append(here.y, value)
    trial = _trial(problem, names, y[1:].tolist(), bounded.scale, options)
    around = list(map(_around, y[1:].tolist(), parameter_sizes(trial, here.x, y).tolist()))
    low, high = around[-1] if span is None else check_span(span)
    if not low <= value <= high:
        raise bad("span", (low, high), f"a span that holds {parameter} = {value:.9g}")
    spans = [options.bounds.get(name, own) for name, own in zip(names, around[:-1], strict=False)]
    ends = own.rests(bounded, here)
    assert ends is not None
    near = max(own.distances[0], CURVES, _sharp(bounded, ends, here.y))
    own = replace(own, distances=(near, near), both=True)
    made = bounded_of(
        problem, names, [*spans, (low, high)], bounded.scale, options, (own,), kind="connection",
        duration=None,
    )  # fmt: skip
    return _followed(problem, made, Orbit(here.mesh, here.x, y), branch.record)


def _sharp(bounded: Bounded, rests: Iterable[Rest], y: Array) -> float:
    """The least distance of ends from equilibria that has digits."""
    return SHARP * max(blur(bounded, rest, y) for rest in rests)


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
    return branch_of(ConnectionBranch, problem, CycleWalk(made), start, record)


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
            failure = lost(made, solution.orbit) or solution.message
            continue
        scale = np.maximum(own, loops.scale)
        made = replace(made, scale=scale)
        rest = rest_near(made, rest.x, found.y) or rest
        sharp = _sharp(made, [rest], found.y)  # next to the point it is not so
        ends = replace(ends, distances=(max(CURVES, sharp),) * 2)
        before, after = (np.max(np.ptp(one.x, axis=0) / own) for one in (orbit, found))
        if not 0.5 * before < after < 2.0 * before:
            failure = "an orbit of another size was found"
            continue
        made = replace(made, conditions=(ends,))
        return _followed(here, made, found, {})
    raise ConvergenceError(
        f"switch: no homoclinic orbit was found beside the Bogdanov-Takens point: {failure}"
    )
