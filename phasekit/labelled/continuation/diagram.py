"""`diagram`: all branches that hang together, by switching at every branch point."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from phasekit.arrays import Array
from phasekit.bifurcation.continuation.connected import led, seen
from phasekit.bifurcation.continuation.curve import Curve
from phasekit.bifurcation.continuation.options import ContinuationOptions
from phasekit.bifurcation.continuation.path import Path, join, lies_on
from phasekit.cycles.functionals import numbers_of_orbit
from phasekit.errors import ConvergenceError, ParameterError, warn
from phasekit.inputs import call_checked
from phasekit.labelled.continuation.branch import Branch
from phasekit.labelled.continuation.branch_points import announced, interrupted
from phasekit.labelled.continuation.checks import check_parameter, check_span
from phasekit.labelled.continuation.continuation import continuation
from phasekit.labelled.continuation.cycle_branch import HomoclinicEnd
from phasekit.labelled.continuation.point_curves import switch
from phasekit.labelled.continuation.special_point import SpecialPoint
from phasekit.labels.arguments import bad, reals, whole
from phasekit.numerics.interrupts import act, hold, keeps
from phasekit.systems.problem import Problem, as_problem, system_of
from phasekit.systems.smooth import refuse_jumps


@call_checked
@keeps
def diagram(
    problem: Any,
    parameter: str,
    *,
    x0: Any = None,
    span: Sequence[float],
    depth: int = 3,
    cycles: bool = True,
    record: Any = None,
    options: ContinuationOptions | None = None,
    certify: bool = False,
) -> tuple[Branch, ...]:
    """Follow all connected branches of equilibria and periodic orbits, each once.

    Parameters
    ----------
    problem : Problem or system
        The system, at the parameters of the start.
    parameter : str
        The parameter that varies.
    x0 : array_like, optional
        A state to start from, or several (rows; with one state, the entries). Without it the
        equilibria are looked for: all of a system, of one formula that is a polynomial or a Fourier
        sum of its state, and of a `Problem` with a window, also on isolated branches (see Notes).
    span : (float, float)
        Lowest and highest value of the parameter.
    depth : int, default 3
        How many times branches are switched in a row: 0 follows the starts only. So many times
        cycles, and fixed points of maps, are doubled.
    cycles : bool, default True
        Whether periodic orbits, of maps too, are followed as well: from all Hopf points, through
        branch points and period doublings, up to the homoclinic orbits at their ends. They come
        behind the branches of equilibria, as `CycleBranch` and `ConnectionBranch`. False:
        equilibria alone.
    record : mapping or sequence of str, optional
        As in `continuation`.
    options : ContinuationOptions, optional
        As in `continuation`.
    certify : bool, default False
        Whether each branch is proved, as in `continuation`.

    Returns
    -------
    tuple of Branch
        Without duplicates: a branch that was reached before is recognised by its curve.

    Raises
    ------
    ParameterError
        If an argument is unusable.
    ConvergenceError
        If no equilibrium is found from any x0.

    Notes
    -----
    The equilibria of a system with coefficients (A, B, C) are computed in closed form between all
    values of the parameter at which any of them meet (see `branches`), so that no branch is missed.
    Those of other systems, of polynomials and of Fourier sums, and those in the window of a
    `Problem`, are computed at 33 values spread over the span (5 where f is a function): an isolated
    branch is missed only if it lies between two of these. Formulas without a window are looked at
    at their own value alone, by Newton's method from 97 states about the start, within 100 of it;
    functions from the start: give a window, or x0, where there may be more.

    Families of periodic orbits that begin at no Hopf point are not looked for. Warnings say what
    could not be followed, and which branch ended for its number of points and where, so that what
    lies beyond was not seen.

    Examples
    --------
    >>> from phasekit.systems.problem import Problem
    >>> pitchfork = Problem("l*x - x**3", state="x", parameters={"l": -1.0})
    >>> [len(branch.special("BP")) for branch in diagram(pitchfork, "l", span=(-1.0, 1.0))]
    [1, 1]
    """
    given, problem = problem, as_problem(problem)
    check_parameter(problem, parameter)
    refuse_jumps(problem, (parameter,))
    system = problem.system
    low, high = check_span(span, None if system is None else system.unit_of(parameter))
    if not isinstance(cycles, (bool, np.bool_)):
        raise bad("cycles", cycles, "True or False")
    depth = whole("depth", depth, "a whole number >= 0", 0)
    branches: list[Branch] = []
    failures: list[ConvergenceError] = []
    try:
        starts = _starts(problem, parameter, x0, (low, high), given)
        hold()
        for start, guess in starts:
            act()
            if branches and _is_on_branches(branches, start, guess, parameter):
                continue
            try:
                branch = continuation(
                    start, parameter, x0=guess, span=(low, high), record=record, options=options,
                    certify=certify,
                )  # fmt: skip
            except ConvergenceError as error:
                failures.append(error)
                continue
            if interrupted(branch) or not _repeats(branches, branch):
                branches.append(branch)
                if not interrupted(branch):
                    _grow(branches, len(branches) - 1, depth)
            if any(interrupted(one) for one in branches):
                break  # what is there is kept
        act()
    except KeyboardInterrupt:  # between two branches
        if not branches:
            raise
        warn(
            f"the diagram in {parameter} was interrupted behind {len(branches)} "
            f"branch{'es'[: 2 * (len(branches) != 1)]}: others are missing; point.switch() of its "
            "branch points follows more, diagram() again follows all",
            RuntimeWarning,
        )
    if not branches:
        if failures:
            raise failures[0]
        raise ConvergenceError("x0: the system has no equilibrium in the span")
    if x0 is not None:  # the others are candidates, of which some are no equilibria
        for failure in failures:
            warn(f"a start leads to no branch: {failure}", RuntimeWarning)
    if cycles and not any(interrupted(one) for one in branches):
        found: list[Branch] = []
        try:
            families(branches, depth, found)
        except KeyboardInterrupt:  # where none is being followed
            warn(
                f"the diagram in {parameter} was interrupted behind {len(branches)} branches and "
                f"{len(found)} families: others are missing; point.switch() of its Hopf points "
                "follows more, diagram() again follows all",
                RuntimeWarning,
            )
        return (*branches, *found)
    return tuple(branches)


def _grow(branches: list[Branch], first: int, depth: int) -> None:
    """Switch at every branch point of the branches from `first` on, to a depth."""
    queue = [(branches[first], 0)]
    passed: list[tuple[Curve, Array]] = []
    while queue:
        act()
        branch, level = queue.pop(0)
        if level >= depth:
            continue
        for point in branch.special("BP"):
            curve, u = branch.curve, point.special.u
            if seen(passed, u):
                continue
            passed.append((curve, u))
            for i, tangent in enumerate(point.special.others):
                if led(map(path_of, branches), curve, u, tangent):
                    continue
                other = announced(switch(point, direction=i))
                branches.append(other)
                if interrupted(other):
                    return
                queue.append((other, level + 1))


def path_of(branch: Branch) -> tuple[Curve, Path]:
    """The traced path of a branch."""
    curve = branch.curve
    return curve, join(curve, branch.start, *branch.tracks)


def _repeats(branches: list[Branch], fresh: Branch) -> bool:
    """Whether a branch is one of those known: its start and its middle lie on one of them."""
    _, path = path_of(fresh)
    u = path.u[path.count // 2]
    return any(lies_on(*path_of(branch), u) for branch in branches)


def _is_on_branches(branches: list[Branch], start: Problem, guess: Any, parameter: str) -> bool:
    curve = branches[0].curve
    row = np.zeros(curve.size)
    row[curve.n] = 1.0
    u = np.append(np.atleast_1d(guess), start.parameters[parameter])
    point = curve.refine(u, row)
    if not point.converged:
        return False
    return any(lies_on(*path_of(branch), point.u) for branch in branches)


def _starts(
    problem: Problem, parameter: str, x0: Any, span: tuple[float, float], given: Any
) -> list[tuple[Problem, Array]]:
    """Problems at a value of the parameter, and guesses there."""
    n = len(problem.state)
    own = problem.parameters[parameter]
    if x0 is not None:
        wants = f"one state of {n} finite numbers, or several as rows"
        rows = np.atleast_1d(reals("x0", getattr(x0, "values", x0), wants))
        rows = rows.reshape(-1, 1) if n == 1 else np.atleast_2d(rows)
        if rows.ndim != 2 or rows.shape[1] != n or not rows.size or not np.isfinite(rows).all():
            raise bad("x0", x0, wants)
        return [(problem, row) for row in rows]
    from phasekit.labelled.continuation.all_equilibria import (
        equilibria_at,
        equilibria_near,
        values_between,
    )

    system = system_of(given, problem) if problem.time is None else problem.system
    values = values_between(problem, parameter, span, system)
    if values is None:
        guess = np.array([problem.start.get(name, 0.0) for name in problem.state])
        more = problem.kind == "symbolic" and problem.time is None and not problem.blocks
        others = equilibria_near(problem, parameter, span) if more else []
        return [(problem, x) for x in (guess, *others)]
    inside = span[0] <= own <= span[1]
    values = np.concatenate([[own] if inside else [], values])
    return [
        (problem.replace(**{parameter: at}), x)
        for at, x in equilibria_at(problem, parameter, values, system)
    ]


#: At which a family ends that has come to another point, and what begins there.
BEGIN = ("hopf", "period_doubling", "cycle_branch_point")
CLOSE = 1e-2  # of the span and of the sizes of states: how far an end is from the point it is at
SAME = 1e-6


def families(
    branches: Sequence[Branch], depth: int, found: list[Branch] | None = None
) -> list[Branch]:
    """The families from all Hopf points, their doubled ones to a depth, and homoclinic ends.

    They are put into `found` one by one, where they are there after an interrupt.
    """
    found = [] if found is None else found
    begun: list[SpecialPoint[Any]] = []
    known = [point for branch in branches for point in branch.special_points if point.kind in BEGIN]
    queue = [(point, 0) for point in known]
    while queue:
        act()
        point, level = queue.pop(0)
        if point.status != "converged" or any(_same(point, other) for other in begun):
            continue
        begun.append(point)
        if any(_ends_at(family, point, known) for family in found):
            continue
        family = _switched(point)
        if family is None:
            continue
        found.append(family)
        if interrupted(family):
            break
        if level < depth:
            more = [one for one in family.special_points if one.kind in BEGIN[1:]]
            known += more
            queue += [(one, level + 1) for one in more]
    for family in list(found):
        act()
        found += _connections(family)
    return found


def _switched(point: SpecialPoint[Any]) -> Branch | None:
    """What begins at a point; None, with a warning, if it cannot be followed."""
    try:
        family: Branch = point.switch()
    except (ConvergenceError, ParameterError) as error:
        _warn(f"what begins at {point!r} is not followed: {error}")
        return None
    return family


def _connections(family: Branch) -> list[Branch]:
    """The homoclinic orbits at the ends of a family, each once."""
    found: list[Branch] = []
    for stop in family.stops:
        if not isinstance(stop, HomoclinicEnd):
            continue
        try:
            found.append(stop.connection())
        except (ConvergenceError, ParameterError) as error:
            value = float(family.points[family.parameter][stop.side])
            _warn(
                f"the homoclinic orbit at the end of the family from {family.special_points[0]!r} "
                f"at {family.parameter} = {value:.9g} is not followed: {error}"
            )
    return found


def _warn(message: str) -> None:
    warn(message, RuntimeWarning)


def _numbers(point: SpecialPoint[Any]) -> tuple[float, np.ndarray[Any, Any], np.ndarray[Any, Any]]:
    """The parameter at a point, and the least and the largest value of each state."""
    value = float(point.parameters[point.branch.parameter])
    if point.way != "orbit":
        return value, point.x, point.x
    numbers = numbers_of_orbit(point.branch.curve, point.special.point.orbit)
    states = point.branch.curve.field.states
    low, high = (np.array([numbers[f"{x}_{part}"] for x in states]) for part in ("min", "max"))
    return value, low, high


def _apart(point: SpecialPoint[Any], other: SpecialPoint[Any]) -> float:
    """Distance of two points on scaled axes, by their parameters and extremes of states."""
    (p, low, high), (q, lower, higher) = _numbers(point), _numbers(other)
    if other.way != "orbit":  # about which an orbit beside it turns
        low = high = 0.5 * (low + high)
    curve = other.branch.curve
    width = curve.width[0] if other.way == "orbit" else curve.scale[curve.n]
    scale, turn = curve.scale[: len(low)], curve.period[: len(low)]
    # Angles may be told whole turns apart.
    whole = np.where(turn > 0.0, turn * np.rint((low - lower) / np.where(turn > 0.0, turn, 1.0)), 0)
    gaps = [np.max(np.abs(one - whole) / scale) for one in (low - lower, high - higher)]
    return float(max(abs(p - q) / width, *gaps))


def _same(point: SpecialPoint[Any], other: SpecialPoint[Any]) -> bool:
    """Whether two points of two branches are one."""
    return point.kind == other.kind and _apart(point, other) < SAME


def _ends_at(family: Branch, point: SpecialPoint[Any], known: list[SpecialPoint[Any]]) -> bool:
    """Whether a family has come to a point from its other end: of all such points the nearest."""
    ends = [one for one in family.special_points if one.kind == "end"]
    for stop, end in zip(family.stops, (ends[0], ends[-1]) if ends else (), strict=False):
        if stop.reason != point.kind or not (gap := _apart(end, point)) < CLOSE:
            continue
        rivals = [one for one in known if one.kind == point.kind]
        if not any(_apart(end, one) < gap and not _same(one, point) for one in rivals):
            return True
    return False
