"""`diagram`: all branches that hang together, by switching at every branch point."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import numpy.typing as npt

from phasekit.bifurcation.continuation.connected import led, seen
from phasekit.bifurcation.continuation.curve import Curve
from phasekit.bifurcation.continuation.options import ContinuationOptions
from phasekit.bifurcation.continuation.path import Path, join
from phasekit.bifurcation.continuation.same_path import lies_on
from phasekit.errors import ConvergenceError, warn
from phasekit.inputs import call_checked
from phasekit.labelled.continuation.branch import Branch
from phasekit.labelled.continuation.checks import check_parameter, check_span
from phasekit.labelled.continuation.continuation import continuation
from phasekit.labelled.continuation.diagram_cycles import families
from phasekit.labelled.continuation.point_curves import switch
from phasekit.labelled.continuation.unfinished import announced, interrupted
from phasekit.labels.arguments import bad, reals, whole
from phasekit.systems.problem import Problem, as_problem, system_of

FloatArray = npt.NDArray[np.float64]


@call_checked
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
    system = problem.system
    low, high = check_span(span, None if system is None else system.unit_of(parameter))
    if not isinstance(cycles, (bool, np.bool_)):
        raise bad("cycles", cycles, "True or False")
    depth = whole("depth", depth, "a whole number >= 0", 0)
    branches: list[Branch] = []
    failures: list[ConvergenceError] = []
    try:
        for start, guess in _starts(problem, parameter, x0, (low, high), given):
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
        return (*branches, *families(branches, depth))
    return tuple(branches)


def _grow(branches: list[Branch], first: int, depth: int) -> None:
    """Switch at every branch point of the branches from `first` on, to a depth."""
    queue = [(branches[first], 0)]
    passed: list[tuple[Curve, FloatArray]] = []
    while queue:
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
) -> list[tuple[Problem, FloatArray]]:
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
