"""Arguments that all of continuation takes: options, a parameter, its span, what is recorded."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from phasekit.bifurcation.continuation.fourfold import Circle
from phasekit.bifurcation.continuation.options import DEFAULTS, ContinuationOptions
from phasekit.bifurcation.special_points import KINDS
from phasekit.errors import ConvergenceError, ParameterError
from phasekit.labelled.continuation.recording import RecordedFormula, at_rest, offered
from phasekit.labels.arguments import bad, check_names, columns, pair, unknown
from phasekit.systems.problem import Problem


def check_options(options: Any, own: ContinuationOptions = DEFAULTS) -> ContinuationOptions:
    """Options, by default those of what goes on, or all defaults."""
    if options is None:
        return own
    if not isinstance(options, ContinuationOptions):
        hint = "pk.ContinuationOptions(**options) makes them" if isinstance(options, dict) else ""
        raise bad("options", options, "pk.ContinuationOptions(...)", hint)
    return options


def check_parameter(problem: Problem, parameter: Any, argument: str = "parameter") -> str:
    """A parameter of the problem by its name."""
    if not isinstance(parameter, str) or parameter not in problem.parameters:
        error = unknown(f"{argument} of the problem", parameter, problem.parameters)
        is_state = isinstance(parameter, str) and parameter in problem.state
        raise ParameterError(f"{error}; {parameter} is a state") if is_state else error
    return parameter


def check_span(span: Any, units: str | None = None, argument: str = "span") -> tuple[float, float]:
    """Two numbers, the lower one first."""
    wants = "two numbers (low, high), finite, with low < high"
    low, high = pair(argument, span, wants, units)
    if not low < high:
        raise bad(argument, span, wants)
    return low, high


def first_span(curve: Any, options: ContinuationOptions, place: int = 0) -> tuple[float, float]:
    """Where the first parameter is free along a curve: ten times its span, unless it is bounded."""
    low, high = float(curve.low[place]), float(curve.high[place])
    reach = 10.0 * (high - low)
    name = curve.field.parameters[curve.active[0]]
    low, high = options.bounds.get(name, (low - reach, high + reach))
    return float(low), float(high)


def check_bounds(bounds: Any) -> Mapping[str, Any]:
    """Bounds by name; none of None."""
    if bounds is None:
        return {}
    if not isinstance(bounds, Mapping):
        raise bad("bounds", bounds, "a mapping from names to (low, high)")
    return bounds


def check_record(problem: Problem, record: Any) -> Mapping[str, Any]:
    """Names -> functions or formulas, or names of quantities -> None."""
    if record is None:
        return {}
    if isinstance(record, str):
        record = [record]
    if isinstance(record, Sequence) and all(
        isinstance(name, str) and name in problem.observables for name in record
    ):
        record = {name: name for name in record}
    if isinstance(record, Mapping):
        own = {*problem.state, *problem.parameters}
        taken = own | columns(own)
        taken_as: dict[str, Any] = {}
        for name, given in record.items():
            if not isinstance(name, str) or not name.isidentifier() or name in taken:
                raise bad("record", name, "names that are identifiers and not taken")
            taken_as[name] = take_recorded(problem, f"record[{name!r}]", given)
        return taken_as
    if not isinstance(record, Sequence):
        raise bad("record", record, "a mapping from names to formulas, or names of quantities")
    if problem.system is None:
        raise bad(
            "record", list(record), "a mapping from names to formulas or functions",
            "names alone are observables, and quantities of systems such as the disk",
        )  # fmt: skip
    for name in record:
        if name not in offered():
            raise unknown("record: quantity", name, offered())
        at_rest(problem.system, name, 0.0)  # what is missing is said before any work
    return dict.fromkeys(record)


def take_recorded(problem: Problem, argument: str, given: Any) -> Any:
    """A function, or a formula that is read as one of the problem."""
    if isinstance(given, str) or hasattr(given, "free_symbols"):
        given = RecordedFormula(given)
    if isinstance(given, RecordedFormula):
        return given.within(problem, argument)
    if not callable(given):
        raise bad(argument, given, "a formula, or a function q(x, **parameters)")
    return given


def check_more(
    point: Any, parameter: Any, span: Any
) -> tuple[list[str], list[tuple[float, float]]]:
    """The parameters that a curve frees beside that of the branch, one or two, and their spans."""
    problem = point.branch.problem
    several = isinstance(parameter, (list, tuple))
    crosses = KINDS[point.kind].curve in ("branch_point", "cycle_branch_point")
    if several and (not crosses or len(parameter) != 2):
        raise bad("parameter", parameter, "one name, or of a branch point two")
    more = [check_parameter(problem, name) for name in (parameter if several else [parameter])]
    if several and not (isinstance(span, (list, tuple, np.ndarray)) and len(span) == 2):
        raise bad("span", span, "two spans (low, high), one for each parameter")
    spans = [check_span(one) for one in (span if several else [span])]
    free = point.branch.free
    if set(free) & set(more) or len(set(more)) < len(more):
        raise bad("parameter", parameter, "another one than that of the branch")
    check_names((*problem.state, *free, *more))
    for name, (low, high) in zip(more, spans, strict=True):
        value = problem.parameters[name]
        if not low <= value <= high:
            raise bad("span", (low, high), f"a span that holds {name} = {value:.9g}")
    return more, spans


def refuse_held(point: Any) -> None:
    """Refuse a point of a curve on which something is held beside the equilibrium: a mere place."""
    if point.branch.kind == "event":
        raise bad(
            "point", point.kind,
            "a point of a branch of equilibria",
            "along fix=, constraints= or an event, special points are places only: "
            "pk.continuation(branch.problem.replace(**point.parameters), parameter, x0=point.x, "
            "span=...) without them goes through it",
        )  # fmt: skip


def folding(point: Any, found: tuple[Circle, float] | None) -> tuple[Circle, float]:
    """The circle of fourfold orbits at a resonance 1:4 from which half-lines of folds begin."""
    if found is None:
        raise ConvergenceError(
            f"switch: beside {point!r} orbits of four times the period were not found, or do not "
            "tell whether they fold: |a + i b| of the normal form is next to 1"
        )
    if found[0].size < 1.0:
        raise bad(
            "point", point.kind, "a point at which another curve begins",
            f"orbits of four times the period, saddles, surround it on all sides and do not fold: "
            f"|a + i b| = {found[0].size:.4g} of the normal form is less than 1",
        )  # fmt: skip
    return found


def refuse_guess(point: Any) -> None:
    """Refuse a point that was not refined."""
    if point.status != "converged":
        raise bad("point", point.status, "a point that has converged", point.message)


def refuse_kind(point: str, kind: Any) -> None:
    """Refuse a kind of curve where one branch begins, which needs no name."""
    if kind is not None:
        raise bad("kind", kind, f"None at a {point} point: there is nothing to choose")
