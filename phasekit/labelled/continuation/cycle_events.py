"""Events of the user's along families of periodic orbits, checked."""

from __future__ import annotations

import inspect
from typing import Any

import numpy as np

from phasekit.bifurcation.continuation.fields import refuse_uncompiled
from phasekit.bifurcation.continuation.functions import Formula
from phasekit.bifurcation.special_points import looked_for
from phasekit.cycles.cycles import Cycles, Orbit
from phasekit.cycles.functionals import Functional, OfNumbers, OfOrbit, number_names
from phasekit.cycles.on_curves import CYCLE
from phasekit.errors import ParameterError
from phasekit.labels.arguments import bad
from phasekit.laws.formulas import read_formula, symbols_of, take_formula, write_formula
from phasekit.laws.grammar import Quoting
from phasekit.systems.problem import Problem
from phasekit.systems.problem_parts import check_call
from phasekit.systems.user_events import ending, named

#: Special points along one parameter.
CRITICAL = ("fold_of_cycles", "period_doubling", "torus", "cycle_branch_point")


def orbit_events_of(problem: Problem, events: Any) -> tuple[Functional, ...]:
    """Events of formulas and functions by name."""
    return tuple(
        Functional(name, function_of(problem, given, f"events[{name!r}]"))
        for name, given in named(events)
    )


def orbit_stop_of(
    problem: Problem, stop: Any, events: tuple[Functional, ...], *, critical: bool
) -> tuple[tuple[Functional, ...], tuple[str, ...]]:
    """All events, those with which a family ends as well, and the names at which it ends.

    Kinds of special points are among them where multipliers are ``critical``: along one parameter.
    """
    if stop is None:
        return events, ()

    def functional_of(name: str, given: Any) -> Functional:
        return Functional(name, function_of(problem, given, "stop"))

    kinds = (*CRITICAL, *looked_for(CYCLE)) if critical else ()
    if problem.bounded:
        kinds = ("fold", "branch_point")
    return ending(stop, events, functional_of, ("event", *kinds))


def function_of(problem: Problem, given: Any, argument: str) -> OfNumbers | OfOrbit:
    """A number of an orbit: a formula of parameters and numbers, or a function of its states."""
    parameters = tuple(problem.parameters)
    if callable(given) and not hasattr(given, "free_symbols"):
        # Besides parameters it may take the period and, of a forced system, time.
        more = [name for name in ("period", problem.time) if name and name in _arguments(given)]
        check_call(argument, given, (*parameters, *more))
        return OfOrbit(given, parameters)
    if not isinstance(given, str) and not hasattr(given, "free_symbols"):
        raise bad(argument, given, "a formula, or a function q(x, **parameters) of the orbit")
    numbers = number_names(tuple(problem.state), parameters)
    symbols = symbols_of([*numbers, *parameters])
    words = f"wants parameters of the problem, {', '.join(numbers)}, and mean(formula of states)"
    means: dict[str, Formula] = {}
    if isinstance(given, str) and "mean" not in symbols:

        def mean_of(text: str) -> Any:
            mean = _mean(problem, text, argument)
            if {*map(str, mean.expression.free_symbols)} <= {*parameters}:
                return mean.expression
            name = f"mean({write_formula(mean.expression)})"
            means[name] = mean
            return symbols.setdefault(name, symbols_of([name])[name])

        def read(text: str, build: Any) -> Any:
            return Quoting(text, build, "mean", mean_of).whole()

        formula = read_formula(given, symbols, argument, words, read=read)
    else:
        formula = take_formula(given, symbols, argument, words)
    refuse_uncompiled(formula, set(symbols.values()), argument)
    if not formula.free_symbols:
        raise bad(argument, given, "a formula that depends on the orbit or the parameters")
    known = tuple(sorted(means.items()))
    return OfNumbers(formula, (*numbers, *(name for name, _ in known)), parameters, known)


def _mean(problem: Problem, text: str, argument: str) -> Formula:
    """A formula of states, parameters and, of a forced system, time, whose mean is a number."""
    names = (*problem.parameters, *([problem.time] if problem.time else []))
    symbols = symbols_of([*problem.state, *names])
    formula = read_formula(text, symbols, argument, f"a mean wants {', '.join(symbols)}")
    refuse_uncompiled(formula, set(symbols.values()), argument)
    return Formula(formula, tuple(problem.state), names)


def _arguments(function: Any) -> tuple[str, ...]:
    try:
        return tuple(inspect.signature(function).parameters)
    except (TypeError, ValueError):
        return ()


def try_events(cycles: Cycles, orbit: Orbit) -> None:
    """Call the functions once, so that what they return is known to be a number."""
    for event in cycles.events:
        if not isinstance(event.function, OfOrbit):
            continue
        argument = "stop" if event.name in cycles.ends else f"events[{event.name!r}]"
        try:
            found = event.function.returned(cycles, orbit)
            event.value(cycles, orbit)
        except Exception as error:
            raise ParameterError(
                f"{argument}: failed at the first orbit: {type(error).__name__}: {error}; wants a "
                "function q(x, **parameters) of one number, with x the states of a whole orbit, "
                f"of shape {np.shape(orbit.x[:, : cycles.own].T)}"
            ) from error
        if isinstance(found, (bool, np.bool_)) and event.name not in cycles.ends:
            raise bad(
                argument, found, "a function whose zero is the event",
                "it says yes or no: give a difference that changes its sign",
            )  # fmt: skip
