"""`continuation`: from a problem and a parameter to a branch of equilibria."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from phasekit.arrays import Array
from phasekit.bifurcation.continuation.curve import Curve
from phasekit.bifurcation.continuation.curve_walk import CurveWalk
from phasekit.bifurcation.continuation.options import ContinuationOptions
from phasekit.bifurcation.continuation.start import begun
from phasekit.errors import ParameterError, warn
from phasekit.inputs import call_checked
from phasekit.labelled.continuation.branch import Branch, branch_of
from phasekit.labelled.continuation.branch_points import announced
from phasekit.labelled.continuation.certified import check_certify, refuse_certify
from phasekit.labelled.continuation.checks import (
    check_options,
    check_parameter,
    check_record,
    check_span,
)
from phasekit.labels.arguments import bad, flag, list_names, numeric, unknown
from phasekit.numerics.interrupts import keeps, may_end
from phasekit.numerics.waits import notice
from phasekit.systems.problem import Problem, as_problem, system_of
from phasekit.systems.problem_parts import equilibrium_curve, refuse_aperiodic
from phasekit.systems.smooth import refuse_jump_at, refuse_jumps
from phasekit.systems.system import System
from phasekit.systems.user_events import events_of, stop_of

TURNED = 1e-3  # what is left of f(x) - x next to a point that f takes to itself on another turn


@call_checked
@keeps
def continuation(
    problem: Any,
    parameter: str,
    *,
    x0: Any = None,
    span: Sequence[float],
    orbit: Any = None,
    fix: Any = None,
    constraints: Any = None,
    record: Mapping[str, Any] | Sequence[str] | None = None,
    events: Mapping[str, Any] | None = None,
    stop: Any = None,
    options: ContinuationOptions | None = None,
    certify: bool = False,
) -> Branch:
    """Follow equilibria, fixed points of a map, periodic orbits or solutions along a parameter.

    Parameters
    ----------
    problem : Problem or system
        The system, at the parameters of the start. A system of phasekit (a disk, coefficients, ...)
        with scalar parameters is ``phi' = -V'(phi)`` on the circle; with an orbit, and a
        `FreeGyroRotor` always, it has the states phi and dphi.
    parameter : str
        The parameter that varies. It starts at the problem's own value. Of a `BoundaryProblem` that
        frees several a sequence of names: the first one that the branch is followed along, and
        those that follow from it.
    x0 : array_like or str, optional
        The state to start from, which is corrected to an equilibrium first; default the problem's
        own `start`, else zeros. Fixed
        points of a map of angles are those of f itself, without whole turns added. Of a
        system also one of its labels: lower_center (the default), lower_saddle, upper_center,
        upper_saddle, or, where equilibria are numbered, "0" (the default), "1", ... Of a
        `BoundaryProblem` a guess of a solution: a constant one, samples even in time of shape
        (samples, states), a function of the time s in [0, 1], or what ``branch.orbit(i)`` returns.
    span : (float, float)
        Lowest and highest value of the parameter; it holds the problem's own.
    orbit : xarray.Dataset, optional
        A periodic orbit, of `periodic_orbit` or ``branch.orbit(i)``, in place of x0: the branch is
        one of periodic orbits then (`CycleBranch`).
    fix : str, or sequence of str, optional
        Quantities that keep their first values, by name or as formulas: of equilibria of states and
        parameters, such as ``"x"`` or ``"x*y"``; of periodic orbits of their numbers, as in events:
        ``"period"``, ``"x_max"``, ``"mean(x^2*y)/period"``. For each of them one more is free:
        give ``parameter=(first, second)`` and the span of the first, or of each. Long orbits that
        keep their period follow a homoclinic orbit; of a conservative problem one parameter is
        enough then.
    constraints : str, sympy.Expr, callable, or sequence of them, optional
        Formulas of the same that vanish all along the branch, each of which frees a parameter as
        `fix` does; of equilibria one can be held in all, also a function ``q(x, **parameters)``.
        Special points of such equilibria, crossings of their branches among them, are places only:
        a branch from ``x0=point.x`` at ``point.parameters`` without it leads on.
    record : mapping of str to str, sympy.Expr or callable, or sequence of str, optional
        Quantities to record at each point: formulas, functions ``q(x, **parameters)``, or names of
        `observables`, or of quantities of a system. Of periodic orbits the least, largest and mean
        value over the orbit are recorded, as ``q_min``, ``q_max`` and ``q_mean``, or the amplitude
        and phase of a harmonic (`fourier`).
    events : mapping of str to str, sympy.Expr or callable, optional
        Functions of the states and parameters whose zeros are special points (``event``, UZ), by
        name: formulas, or functions ``q(x, **parameters)`` of one number. An angle counts as it is
        shown, in one turn. They hold on branches that are switched to, and on curves in two
        parameters. Of periodic orbits they are formulas of the parameters, ``period``, for each
        state x ``x_min``, ``x_max`` and ``x_mean``, and means over the orbit of formulas of states,
        parameters and time, ``mean(x^2*y)``; or functions ``q(x, **parameters)`` of the
        states of a whole orbit, of shape (state, time), which may take ``period`` as well.
    stop : str, callable, or sequence of them, optional
        Where the branch ends before: at the first event of a name, special point of a kind or
        label, zero of a function ``q(x, **parameters)`` or change of one that says yes or no. The
        start itself does not count. Of periodic orbits x is a whole orbit, as for events.
    options : ContinuationOptions, optional
        Steps, tolerances, bounds, directions.
    certify : bool, default False
        Whether the branch is proved in interval arithmetic, of equilibria and fixed points of
        formulas: that there is one branch from each point to the next and no other close by, and
        that folds, Hopf points, neutral saddles, period doublings and torus points are there, one
        each, within bounds. What is proved is said of points (``certified``, ``certified_onward``,
        see `Branch`) and of special points (``certified``, ``enclosure``).

    Returns
    -------
    Branch
        The points on both sides of the start, up to the ends of the span or whatever stops the
        branch before, and the special points on them.

    Raises
    ------
    ParameterError
        If an argument is unusable.
    ConvergenceError
        If no equilibrium is found from x0.

    Notes
    -----
    Pseudo-arclength continuation with an adaptive step and Newton's method on the bordered system
    ([AllgowerGeorg1990] chapters 2 to 6). Special points are bracketed by changes of sign of test
    functions, also of several in one step, and refined on the systems that define them
    ([Govaerts2000], [Kuznetsov2004] chapter 10). Whatever stops it is said in ``stops``.

    Proofs take parameters and numbers in f for exactly the doubles that they are, and bound each
    rounding. About the chord between neighbouring points, or halves of it, a tube holds exactly one
    curve by Krawczyk's operator ([MooreKearfottCloud2009] 8.2), and special points are boxes with
    exactly one solution of their equations.

    Examples
    --------
    >>> from phasekit.systems.problem import Problem
    >>> cusp = Problem("mu + l*x - x**3", state="x", parameters={"mu": -1.0, "l": 1.0})
    >>> branch = continuation(cusp, "mu", x0=[-1.3], span=(-1.0, 1.0))
    >>> [round(point.parameters["mu"], 10) for point in branch.special("fold")]
    [0.3849001795, -0.3849001795]
    >>> branch = continuation(
    ...     cusp, "mu", x0=[-1.3], span=(-1.0, 1.0), events={"half": "x + 1/2"}, stop="half"
    ... )
    >>> (point,) = branch.special("half")
    >>> point.label, point.x.item(), round(point["mu"], 12), branch.stops[1].reason
    ('UZ', -0.5, 0.375, 'half')
    >>> branch = continuation(cusp, "mu", x0=[-1.3], span=(-1.0, 1.0), certify=True)
    >>> low, high = branch.special("fold")[0].enclosure["mu"]
    >>> branch.certified, low < 2 / 27**0.5 < high, high - low < 1e-14
    (True, True, True)
    """
    given, problem = problem, as_problem(problem, moving=orbit is not None)
    options = check_options(options)
    flag("certify", certify)
    if certify:
        options = replace(options, certify=True)
    if problem.bounded:
        from phasekit.labelled.continuation.bounded_start import continue_solution
        from phasekit.labelled.continuation.held_start import asked_of

        if orbit is not None:
            raise bad("orbit", orbit, "None of a BoundaryProblem", "x0= takes a solution")
        refuse_certify(options.certify, "solutions of a BoundaryProblem")
        with notice(f"following solutions along {parameter}"):
            return announced(continue_solution(
                problem, parameter, x0, span, check_record(problem, record), options, events, stop,
                asked_of(fix, constraints),
            ))  # fmt: skip
    if orbit is not None:
        from phasekit.labelled.continuation.cycle_start import continue_orbit

        if x0 is not None:
            raise bad("x0", x0, "None with an orbit")
        refuse_certify(options.certify, "periodic orbits")
        refuse_aperiodic(problem)
        refuse_jumps(problem, problem.parameters)
        if problem.map:
            raise bad(
                "orbit", orbit, "None of a map",
                "orbits of a map are fixed points of problem.iterated(times)",
            )  # fmt: skip
        with notice(f"following periodic orbits along {parameter}"):
            return announced(continue_orbit(
                problem, parameter, orbit, span, check_record(problem, record), options, fix,
                events, stop, constraints,
            ))  # fmt: skip
    held = fix is not None or constraints is not None
    if held:
        from phasekit.labelled.continuation.held_start import held_on

        refuse_certify(options.certify, "branches with constraints")
        one, free, spans = held_on(problem, parameter, span, fix, constraints)
        parameter, span = free[0], spans[0]
    low, high = _span(problem, parameter, span)
    if options.certify:
        check_certify(problem, parameter)
    if problem.blocks:
        from phasekit.labelled.continuation.large_start import continue_fields

        if events is not None:
            raise bad("events", events, "None of fields of states", "record= takes functions")
        if callable(stop):
            raise bad("stop", stop, "a kind of special points, of fields of states")
        _, ends = stop_of(problem, stop, (), options.detect, np.empty(0))
        return announced(continue_fields(
            problem, parameter, x0, (low, high), check_record(problem, record), options, ends
        ))  # fmt: skip
    guess = _start(problem, x0, given)
    curve = equilibrium_curve(problem, parameter, (low, high), options)
    if events is not None or stop is not None:
        asked = events_of(problem, events, guess)
        asked, ends = stop_of(problem, stop, asked, curve.detect, guess)
        curve = curve.replace(events=asked, ends=ends)
    u = np.append(guess, problem.parameters[parameter])
    if problem.kind == "python":
        _check_values(problem, guess)
    if curve.discrete and curve.period.any():
        _refuse_turns(curve, u)
    where = ", ".join(
        f"{name} = {value:.6g}" for name, value in zip([*problem.state, parameter], u, strict=True)
    )
    for i, name in enumerate(problem.state):
        if not curve.low[i] <= guess[i] <= curve.high[i]:
            raise bad("x0", guess, f"{name} within its bounds {options.bounds[name]}")
    given = {i: options.scales[s] for i, s in enumerate(problem.state) if s in options.scales}
    curve, start = begun(curve, u, given, where)
    refuse_jump_at(problem.replace(**{parameter: float(start.u[-1])}), start.u[:-1])
    with notice(f"following equilibria along {parameter}"):
        if held:
            from phasekit.labelled.continuation.held_start import continue_held

            return announced(continue_held(
                problem, curve, start, free, spans, one, check_record(problem, record)
            ))  # fmt: skip
        branch = branch_of(
            Branch, problem, CurveWalk(curve), start, check_record(problem, record)
        )  # fmt: skip
    if options.certify:
        try:
            with notice(f"proving the branch along {parameter}"), may_end():
                _ = branch.points
        except KeyboardInterrupt:
            warn("the proof was interrupted: branch.points begins it anew", RuntimeWarning)
    return announced(branch)


def _span(problem: Problem, parameter: Any, span: Any) -> tuple[float, float]:
    check_parameter(problem, parameter)
    system = problem.system
    low, high = check_span(span, None if system is None else system.unit_of(parameter))
    for declared in () if system is None else system.declared:
        if declared.name == parameter and not (declared.valid(low) and declared.valid(high)):
            raise bad("span", (low, high), f"values of {parameter}, each {declared.wants}")
    value = problem.parameters[parameter]
    if not low <= value <= high:
        raise bad(
            "span", (low, high), f"a span that holds the problem's own {parameter} = {value:.9g}",
            f"start elsewhere with problem.replace({parameter}=...)",
        )  # fmt: skip
    return low, high


def _start(problem: Problem, x0: Any, given: Any) -> Array:
    n = len(problem.state)
    system = system_of(given, problem)
    if system is not None and problem.time is None and (x0 is None or isinstance(x0, str)):
        return np.append(_labelled_start(system, x0), np.zeros(n - 1))  # at rest
    if x0 is None:
        return np.array([problem.start.get(name, 0.0) for name in problem.state])
    if isinstance(x0, Mapping):
        missing = [name for name in problem.state if name not in x0]
        extra = [name for name in x0 if name not in problem.state]
        if missing or extra:
            raise bad("x0", list(x0), f"a value for each of {list_names(problem.state)}")
        x0 = [x0[name] for name in problem.state]
    names = list_names(problem.state)
    guess = np.atleast_1d(numeric("x0", x0, None, f"{n} numbers: {names}"))
    if guess.shape != (n,) or not np.isfinite(guess).all():
        raise bad("x0", x0, f"{n} finite numbers: {names}")
    return guess


def _labelled_start(system: System, x0: str | None) -> float:
    """An equilibrium of a system by its label; the first that exists if there is none."""
    from phasekit.cells.evaluate import evaluate
    from phasekit.table.quantities import ROWS

    ds = evaluate(system, [ROWS["phi"]])
    labels = [str(label) for label in ds.equilibrium.values]
    there = [name for name, phi in zip(labels, ds.phi.values, strict=True) if np.isfinite(phi)]
    if x0 is None and there:
        x0 = there[0]
    if x0 is not None and x0 not in labels:
        raise unknown("x0: equilibrium", x0, labels)
    if x0 not in there:
        raise bad("x0", x0, f"an equilibrium that exists here: {', '.join(there) or 'none'}")
    return float(ds.phi.values[labels.index(x0)])


def _refuse_turns(curve: Curve, u: Array) -> None:
    """Refuse what a map takes to itself but for whole turns of an angle.

    Newton's method would lead to a fixed point elsewhere.
    """
    n = curve.n
    gap = curve.evaluate(u)[0]
    if not np.isfinite(gap).all():
        return
    period = curve.period[:n]
    turns = np.round(np.divide(gap, period, out=np.zeros(n), where=period > 0.0))
    left = np.abs(gap - turns * period)
    if turns.any() and np.all(left <= TURNED * np.maximum(np.abs(u[:n]), 1.0)):
        name, k = curve.field.states[np.flatnonzero(turns)[0]], int(turns[turns != 0.0][0])
        raise bad(
            "x0", u[:n], "a fixed point of f itself",
            f"f adds {k} turn{'s'[: abs(k) != 1]} to {name} there: take them off in f, whose fixed "
            "points are then those up to so many turns",
        )  # fmt: skip


def _check_values(problem: Problem, guess: Array) -> None:
    """What a Python function returns, before any work."""
    n = len(problem.state)
    for argument, function, shape in (("f", problem.f, (n,)), ("jac", problem.jac, (n, n))):
        if function is None:
            continue
        try:
            value = function(guess.copy(), **problem.parameters)
        except (ArithmeticError, ValueError):
            continue  # not defined there: the start will say so
        except Exception as error:
            raise ParameterError(
                f"{argument}: raised {type(error).__name__} at x0: {error}; wants a function "
                f"{argument}(x, **parameters) of numbers of shape {shape}"
            ) from error
        value = value.toarray() if hasattr(value, "toarray") else value
        found = np.asarray(value)
        if found.dtype.kind not in "biuf" and found.dtype != object:
            raise bad(argument, value, f"real numbers of shape {shape} to be returned")
        if found.dtype == object and any(number is None for number in found.flat):
            held = "None" if value is None else f"{value!r:.80}, with None in it"
            raise ParameterError(
                f"{argument}: returned {held} at x0, wants numbers of shape {shape}; a function "
                "without a return statement returns None"
            )
        try:
            found = np.asarray(value, dtype=float)
        except (TypeError, ValueError):
            raise bad(argument, value, f"numbers of shape {shape} to be returned") from None
        if found.size != n ** len(shape) or (found.ndim > 1 and found.shape not in (shape, (n, 1))):
            raise ParameterError(
                f"{argument}: returned numbers of shape {found.shape} at x0, wants {shape}"
            )
