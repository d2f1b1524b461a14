"""Events of the user's: what `continuation` takes for ``events`` and ``stop``, checked."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from typing import Any

import numpy as np
import numpy.typing as npt

from phasekit.bifurcation.continuation.fields import refuse_uncompiled
from phasekit.bifurcation.continuation.functions import Code, Event, Formula
from phasekit.bifurcation.continuation.kernels.defining import EQUILIBRIUM
from phasekit.bifurcation.special_points import KINDS, looked_for
from phasekit.errors import ParameterError
from phasekit.labels.arguments import bad, unknown, whole
from phasekit.laws.formulas import NAME, symbols_of, take_formula, write_formula
from phasekit.systems.problem import Problem
from phasekit.systems.problem_parts import check_call

#: Why branches end by themselves: no names for events.
REASONS = (
    "bound", "closed", "max_points", "interrupted", "stuck", "not_finite", "start", "hopf",
    "homoclinic", "unbounded", "lost", "non_central_saddle_node", "shilnikov_hopf",
)  # fmt: skip
#: Where a branch may be told to end: of both, of flows, of maps.
BOTH = ("event", "fold", "branch_point", "pitchfork", "transcritical")
FLOW = ("hopf", "neutral_saddle", "bogdanov_takens")
MAP = ("period_doubling", "torus")


def is_taken(name: str) -> bool:
    """Whether a name is that of a kind or label of special points, or of an end."""
    return name in {*KINDS, *(kind.label for kind in KINDS.values()), *REASONS}


def events_of(
    problem: Problem, events: Any, x: npt.NDArray[np.float64] | None = None
) -> tuple[Event, ...]:
    """Events of formulas and functions by name."""
    found = []
    for name, given in named(events):
        event = event_of(problem, name, given, f"events[{name!r}]", x)
        if event.condition:
            raise bad(
                f"events[{name!r}]", given, "a function whose zero is the event",
                "it says yes or no: give a difference that changes its sign, such as x[0] - 1",
            )  # fmt: skip
        found.append(event)
    return tuple(found)


def named(events: Any) -> Iterator[tuple[str, Any]]:
    """What is asked for by name, where the names are good."""
    if events is None:
        return
    if not isinstance(events, Mapping):
        raise bad("events", events, "a mapping from names to formulas or functions")
    for name, given in events.items():
        if not isinstance(name, str) or not name.strip() or len(name) > NAME:
            raise bad("events", name, f"names: text of 1 to {NAME} letters")
        if is_taken(name):
            raise bad("events", name, "a name that is no kind or label of special points")
        yield name, given


def stop_of(
    problem: Problem, stop: Any, events: tuple[Event, ...], detect: Sequence[str],
    x: npt.NDArray[np.float64],
) -> tuple[tuple[Event, ...], tuple[str, ...]]:  # fmt: skip
    """All events, those with which a branch ends as well, and the names at which it ends."""
    if stop is None:
        return events, ()
    kinds = (*BOTH, *(MAP if problem.map else FLOW), *looked_for(EQUILIBRIUM))

    def event_at_end(name: str, given: Any) -> Event:
        return event_of(problem, name, given, "stop", x)

    return ending(stop, events, event_at_end, kinds, detect)


def ending(
    stop: Any, events: tuple[Any, ...], make: Callable[[str, Any], Any], kinds: Sequence[str],
    detect: Sequence[str] | None = None,
) -> tuple[tuple[Any, ...], tuple[str, ...]]:  # fmt: skip
    """All events, also those that it is to `make` of functions, and the names at which it ends.

    ``kinds`` of special points are there to end at, where ``detect`` looks for them.
    """
    wants = (
        "the name of an event, a kind or label of special points, or a function; or a pair of it "
        "and how many of them, such as ('hopf', 3)"
    )
    given = stop if isinstance(stop, (list, tuple)) else [stop]
    if _is_counted(stop):
        given = [stop]
    if not given:
        raise bad("stop", stop, wants)
    names: list[str] = []
    for one in given:
        count = 1
        if _is_counted(one):
            one, count = one
            count = whole("stop", count, "a whole number >= 1")
        if callable(one):
            name = getattr(one, "__name__", "stop")
            name = name if name.isidentifier() and not is_taken(name) else "stop"
            taken = [event.name for event in events]
            while name in taken:
                name += "_"
            events = (*events, make(name, one))
            names += [name] * count  # the last of so many ends it
            continue
        if not isinstance(one, str):
            raise bad("stop", one, wants)
        _check_name(one, events, kinds, detect)
        names += [one] * count
    return events, tuple(names)


def _is_counted(given: Any) -> bool:
    """Whether it is what to stop at with how many of it."""
    return (
        isinstance(given, (list, tuple))
        and len(given) == 2
        and not isinstance(given[0], (list, tuple))
        and not (isinstance(given[1], (str, list, tuple)) or callable(given[1]))
    )


def _check_name(
    name: str, events: tuple[Any, ...], known: Sequence[str], detect: Sequence[str] | None
) -> None:
    if name in [event.name for event in events]:
        return
    kinds = [KINDS[kind] for kind in known]
    named = [kind for kind in kinds if name in (kind.name, kind.label)]
    if not named:
        valid = [*(event.name for event in events), *(kind.name for kind in kinds)]
        raise unknown("stop: event or special point", name, valid)
    if detect is not None and not any(kind.detected in (None, *detect) for kind in named):
        raise bad(
            "stop", name, f"what is looked for: {', '.join(detect) or 'nothing'}",
            f"detect={named[0].detected!r} looks for it",
        )  # fmt: skip


def event_of(
    problem: Problem, name: str, given: Any, argument: str, x: npt.NDArray[np.float64] | None
) -> Event:
    """A formula, or a function q(x, **parameters), by name."""
    states, parameters = problem.field.states, problem.field.parameters
    if callable(given) and not hasattr(given, "free_symbols"):
        check_call(argument, given, parameters)
        condition = False if x is None else _is_condition(problem, given, argument, x)
        return Event(name, Code(given, states, parameters), condition)
    if not isinstance(given, str) and not hasattr(given, "free_symbols"):
        raise bad(argument, given, "a formula, or a function q(x, **parameters)")
    symbols = symbols_of([*states, *parameters])
    formula = take_formula(given, symbols, argument, "wants states and parameters of the problem")
    refuse_uncompiled(formula, set(symbols.values()), argument)
    if not formula.free_symbols:
        raise bad(argument, given, "a formula that depends on the states or parameters")
    return Event(name, Formula(formula, states, parameters))


def _is_condition(
    problem: Problem, function: Any, argument: str, x: npt.NDArray[np.float64]
) -> bool:
    """Whether a function says yes or no; what it returns is checked before any work."""
    try:
        with np.errstate(all="ignore"):
            value = function(x.copy(), **problem.parameters)
    except (ArithmeticError, ValueError):
        return False  # not defined there
    except Exception as error:
        raise ParameterError(
            f"{argument}: raised {type(error).__name__} at x0: {error}; wants a function "
            "q(x, **parameters) of one number"
        ) from error
    found = np.asarray(value)
    if found.dtype.kind not in "biuf" or found.size != 1 or found.ndim:
        raise bad(argument, value, "one real number to be returned")
    return found.dtype.kind == "b"


def written(events: Iterable[Any]) -> dict[str, str | None]:
    """Events as they are stored: formulas as text, None for code."""
    return {
        one.name: write_formula(one.function.expression)
        if isinstance(one.function, Formula)
        else None
        for one in events
    }
