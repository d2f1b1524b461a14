"""What a potential may be made of: checks of the arguments of `Potential`, and of its maps."""

from __future__ import annotations

from typing import Any

import numpy as np

from phasekit.errors import ParameterError
from phasekit.inputs import is_whole
from phasekit.labels.arguments import bad, brief, number, pair
from phasekit.laws.formulas import NAME, is_name, keyword_hint, read_formula
from phasekit.systems.identity import model_name, parameter_values
from phasekit.systems.parameter import Parameter


def attribute(ds: Any, name: str) -> str:
    """Return an attribute of a Dataset in which a part of a potential is stored."""
    value = ds.attrs.get(f"phasekit_{name}")
    if not isinstance(value, str):
        raise bad(
            f"ds: attribute phasekit_{name}", value, "the string that phasekit stored there",
            "the Dataset is damaged: make the map again",
        )  # fmt: skip
    return value


def expression(expression: Any) -> Any:
    """Return an expression as text, or as the sympy expression that it is."""
    if isinstance(expression, str):
        return expression
    import sympy as sp

    if isinstance(expression, sp.Expr):
        return expression
    # Numbers as text, for the formula of 1.0 is not that of 1.
    if isinstance(expression, (float, np.floating)):
        return repr(float(expression))
    if is_whole(expression) and abs(expression) < 1e308:
        return repr(int(expression))
    hint = "for a Python function of the state take pk.Problem" if callable(expression) else ""
    raise bad("expression", expression, "a string or a sympy expression", hint)


def name(argument: str, name: Any) -> str:
    """Return a name that a coordinate or a parameter can have."""
    text = str(name) if type(name).__module__.startswith("sympy") else name
    if not isinstance(text, str) or not is_name(text):
        wants = f"a name, such as 'x', of at most {NAME} letters and digits"
        raise bad(argument, name, wants, keyword_hint(text))
    return text


def period(period: Any) -> float | None:
    """Return the length of a circle, None of a line."""
    if period is None:
        return None
    wants = "a number > 0, the length of the circle, or None for a line"
    if isinstance(period, str):
        period = read_formula(period, {}, "period")
    if getattr(period, "is_number", False) and period.is_real:  # a sympy number
        period = float(period)
    value = number("period", period, wants)
    if not value > 0.0:
        raise bad("period", period, wants)
    return value


def interval(interval: Any, period: Any) -> tuple[float, float] | None:
    """Return the ends between which a line is looked at."""
    if interval is None:
        return None
    if period is not None:
        raise bad("interval", interval, "None on a circle, which is looked at as a whole")
    wants = "two finite numbers (low, high), low < high"
    low, high = pair("interval", interval, wants)
    if not low < high:
        raise bad("interval", interval, wants)
    return low, high


def of_dataset(cls: Any, ds: Any) -> Any:
    """The potential of a map, whose attributes hold its formula."""
    if model_name(ds) != cls.__name__:
        raise ParameterError(
            f"ds: got a map of {model_name(ds)}, wants one of {cls.__name__}; "
            "use ds.phasekit.system()"
        )
    expression, coordinate, names, period, ends = (
        attribute(ds, name)
        for name in ("expression", "coordinate", "parameters", "period", "interval")
    )
    declared = [Parameter(name=name, units="1", long_name=name) for name in names.split()]
    try:
        return cls(
            expression,
            coordinate,
            parameter_values(ds, declared),
            None if period == "None" else period,
            interval=[float(end) for end in ends.split()] or None,
        )
    except ValueError as error:  # as ParameterError is
        raise ParameterError(
            f"ds: got a map whose potential cannot be made again: {error}; its attributes "
            "phasekit_* or its coordinates were changed: make the map again"
        ) from error


def written(potential: Any) -> str:
    """A potential as the call that makes it, long arrays by their ends."""
    words = [repr(potential.formula.text), repr(potential.coordinate)]
    if potential.parameters:
        shown = ", ".join(f"{k!r}: {brief(value)}" for k, value in potential.parameters.items())
        words.append(f"{{{shown}}}")
    if potential.period is not None:
        words.append(f"period={potential.period!r}")
    if potential.interval is not None:
        words.append(f"interval={potential.interval!r}")
    return f"Potential({', '.join(words)})"
