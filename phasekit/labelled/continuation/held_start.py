"""Where branches begin along which quantities keep their values, or formulas hold."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np

from phasekit.arrays import Array
from phasekit.bifurcation.continuation.curve import Curve
from phasekit.bifurcation.continuation.curve_walk import CurveWalk
from phasekit.bifurcation.continuation.functions import Event, Formula
from phasekit.bifurcation.continuation.kernels.defining import EVENT
from phasekit.bifurcation.continuation.path import Sample
from phasekit.bifurcation.continuation.points.special import CONVERGED, Special
from phasekit.bifurcation.continuation.two_parameters import two_parameter_curve
from phasekit.cycles.cycles import Cycles, Orbit
from phasekit.cycles.functionals import Functional, OfOrbit
from phasekit.errors import ConvergenceError
from phasekit.labelled.continuation.branch import Branch, branch_of
from phasekit.labelled.continuation.checks import check_parameter, check_span
from phasekit.labelled.continuation.cycle_events import function_of
from phasekit.labelled.continuation.unfolding import UNFOLDING
from phasekit.labels.arguments import bad
from phasekit.laws.formulas import NAME, write_formula
from phasekit.systems.problem import Problem
from phasekit.systems.user_events import event_of


class Asked(NamedTuple):
    """A quantity that is held: as it was given, and whether it keeps its first value, or is 0."""

    given: Any
    argument: str
    keeps: bool


def asked_of(fix: Any, constraints: Any) -> list[Asked]:
    """What is held, in order."""
    found = []
    for argument, given, keeps in (("fix", fix, True), ("constraints", constraints, False)):
        several = isinstance(given, (list, tuple))
        for one in given if several else [] if given is None else [given]:
            found.append(Asked(one, argument, keeps))
        if several and not given:
            raise bad(argument, given, "None, a formula, or several")
    return found


def free_of(problem: Problem, parameter: Any, count: int) -> list[str]:
    """Names of the free parameters: one, and as many more as quantities are held."""
    given = [parameter] if isinstance(parameter, str) else parameter
    if not isinstance(given, (list, tuple)):
        raise bad("parameter", parameter, "a name, or names")
    names = [check_parameter(problem, name) for name in given]
    if len(set(names)) != len(names) or len(names) != 1 + count:
        held = "what is held frees" if count == 1 else f"{count} quantities that are held free"
        raise bad(
            "parameter", parameter, f"{1 + count} different parameters",
            f"the first one is followed, {held} {count} more",
        )  # fmt: skip
    return names


def spans_of(problem: Problem, free: list[str], span: Any) -> list[tuple[float, float]]:
    """The span of each free parameter; of others than the first ten times as wide by default."""
    several = isinstance(span, (list, tuple, np.ndarray)) and any(map(_has_length, span))
    if several and len(span) > len(free):
        most = f"at most {len(free)} spans (low, high), of {', '.join(free)}"
        raise bad("span", span, most if len(free) > 1 else f"(low, high) of {free[0]}")
    spans = [check_span(one) for one in (span if several else [span])]
    for name, (low, high) in zip(free, spans, strict=False):
        value = problem.parameters[name]
        if not low <= value <= high:
            raise bad(
                "span", (low, high), f"a span that holds the problem's own {name} = {value:.9g}"
            )
    for name in free[len(spans) :]:
        if name == UNFOLDING:
            spans.append((-np.inf, np.inf))  # it stays zero: steps are not measured by it
            continue
        value = problem.parameters[name]
        reach = 10.0 * max(abs(value), spans[0][1] - spans[0][0])
        spans.append((value - reach, value + reach))
    return spans


def _has_length(value: Any) -> bool:
    """Whether it is a pair, or another sequence, in place of a number."""
    return isinstance(value, (list, tuple)) or np.ndim(value) > 0


def held_on(
    problem: Problem, parameter: Any, span: Any, fix: Any, constraints: Any
) -> tuple[Asked, list[str], list[tuple[float, float]]]:
    """What is held on a branch of equilibria, its free parameters and their spans."""
    asked = asked_of(fix, constraints)
    if len(asked) > 1:
        raise bad("fix, constraints", len(asked), "one of them of equilibria")
    if problem.blocks:
        raise bad(asked[0].argument, asked[0].given, "None of fields of states")
    free = free_of(problem, parameter, 1)
    return asked[0], free, spans_of(problem, free, span)


def name_of(text: str, value: float, place: int = 0) -> str:
    """What a quantity that has a value is called, by its formula, in no more letters than names."""
    said = f" = {value:.9g}"
    most = NAME - len(said)
    if len(text) > most:
        end = f"... ({place + 1})"
        text = text[: most - len(end)] + end
    return text + said


def kept(event: Event, value: float) -> Event:
    """What vanishes where a quantity has a value."""
    function = event.function
    if isinstance(function, Formula):
        made = replace(function, expression=function.expression - value)
        return Event(name_of(event.name, value), made)
    inner = function.function

    def off(x: Array, **parameters: float) -> Any:
        return inner(x, **parameters) - value

    return Event(name_of(event.name, value), replace(function, function=off))


def held_of(
    problem: Problem, asked: Sequence[Asked], cycles: Cycles, orbit: Orbit
) -> tuple[Functional, ...]:
    """Numbers of orbits that vanish along a family: what is asked for, as an orbit has it."""
    found = []
    for place, one in enumerate(asked):
        function = function_of(problem, one.given, one.argument)
        if isinstance(function, OfOrbit):
            raise bad(one.argument, one.given, "a formula of numbers of the orbit")
        timed = "that of the forcing" if cycles.forced else "" if cycles.closes else "1 throughout"
        if timed and "period" in map(str, function.expression.free_symbols):
            raise bad(one.argument, one.given, f"none of the period, which is {timed}")
        value = Functional("", function).value(cycles, orbit) if one.keeps else 0.0
        if not np.isfinite(value):
            raise bad(one.argument, one.given, "a quantity that has a value at the start")
        text = write_formula(function.expression)
        made = replace(function, expression=function.expression - value)
        found.append(Functional(name_of(text, value, place), made))
    return tuple(found)


def period_is(problem: Problem, value: float) -> Functional:
    """What vanishes where the period has a value."""
    function = function_of(problem, "period", "fix")
    assert isinstance(function, Formula)
    made = replace(function, expression=function.expression - value)
    return Functional(f"period = {value:.9g}", made)


def continue_held(
    problem: Problem, curve: Curve, start: Sample, free: Sequence[str],
    spans: Sequence[tuple[float, float]], one: Asked, record: Any,
) -> Branch:  # fmt: skip
    """Follow equilibria along which a quantity keeps its value or vanishes, from one near it."""
    n = curve.n
    names, widths = list(problem.parameters), [high - low for low, high in spans]
    given = event_of(problem, "held", one.given, one.argument, start.u[:n])
    if given.condition:
        raise bad(one.argument, one.given, "a function of one number", "it says yes or no")
    text = write_formula(given.function.expression) if isinstance(given.function, Formula) else ""
    event = replace(given, name=text or getattr(one.given, "__name__", "function"))
    value = float(event.function.values(curve, start.u[None])[0])
    if not np.isfinite(value):
        wants = "a quantity that has a value at the start"
        raise bad(one.argument, one.given, wants, _raised(problem, one.given, start.u[:n]))
    event = kept(event, value if one.keeps else 0.0)
    made = curve.replace(
        active=tuple(names.index(name) for name in free), held=event,
        scale=np.append(curve.scale[: n + 1], widths[1:]),
        period=np.append(curve.period[: n + 1], np.zeros(len(free) - 1)),
        low=np.concatenate([curve.low[:n], [low for low, _ in spans]]),
        high=np.concatenate([curve.high[:n], [high for _, high in spans]]),
    )  # fmt: skip
    u = np.concatenate([start.u[: n + 1], [problem.parameters[name] for name in free[1:]]])
    met = _met(made.replace(kind=EVENT), u)
    if met is None:
        raise ConvergenceError(
            f"no equilibrium with {event.name} was found from that at {free[0]} = "
            f"{start.u[n]:.9g}; start nearer to one, and not where such branches cross"
        )
    par = made.par.copy()
    par[list(made.active)] = met[n:]
    at = Special("event", met, (0.0, 0.0), 0.0, CONVERGED)
    found = two_parameter_curve(made.replace(par=par), at, EVENT)
    if found is None:
        raise ConvergenceError(f"{event.name} does not hold along a curve through the start")
    made, first = found
    if first.tangent[n] < 0.0:
        first = Sample(first.u, -first.tangent, first.slopes)
    return branch_of(Branch, problem, CurveWalk(made), first, record)


def _raised(problem: Problem, given: Any, x: Array) -> str:
    """What a function raises at a state, in words; empty where it is none, or raises nothing."""
    if not callable(given) or hasattr(given, "free_symbols"):
        return ""
    try:
        given(x.copy(), **problem.parameters)
    except Exception as error:  # noqa: BLE001 - whatever a user's function raises
        return f"it raised {type(error).__name__}: {error}"
    return ""


def _met(curve: Curve, u: Array) -> Array | None:
    """Where a quantity vanishes: at the first parameter's value if it can; None if nowhere."""
    for i in (curve.n, *range(curve.n + 1, curve.m), *range(curve.n)):
        row = np.zeros(curve.size)
        row[i] = 1.0
        point = curve.refine(u, row)
        inside = np.all((point.u >= curve.low) & (point.u <= curve.high))
        if point.converged and inside:
            return point.u
    return None
