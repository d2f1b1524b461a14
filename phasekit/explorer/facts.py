"""What the page is told of a system: its parameters, their ranges, and the Python that makes it."""

from __future__ import annotations

import math
from typing import Any

from phasekit.explorer.law import is_machine
from phasekit.labels.units import grammar
from phasekit.laws.ladder import is_turn
from phasekit.systems.parameter import Parameter
from phasekit.systems.system import System

#: How far a slider goes beyond the value that it starts at, as a multiple of it.
FACTOR = 2.5


def facts_of(system: System, values: dict[str, float]) -> dict[str, Any]:
    """Return the facts as what JSON can hold.

    >>> import phasekit as pk
    >>> facts = facts_of(pk.Pendulum(length=2.0, g=10.0), {"length": 2.0, "g": 10.0})
    >>> facts["parameters"][0]["low"], facts["parameters"][0]["high"], facts["python"]["start"]
    (0.04, 5.0, 'pk.Pendulum(')
    """
    law: Any = system.law
    return {
        "model": type(system).__name__,
        "law": f"V = {law.text}",
        "coordinate": law.coordinate,
        "angle": is_turn(law.period),
        "parameters": [_parameter(p, values, system) for p in system.declared],
        "used": list(system.formula_inputs()),
        "machine": is_machine(system),
        "written": grammar(),
        "python": _python(system),
    }


def _parameter(parameter: Parameter, values: dict[str, float], system: System) -> dict[str, Any]:
    value = values.get(parameter.name)
    like = [
        abs(values[p.name]) for p in system.declared
        if p.units == parameter.units and values.get(p.name)
    ]  # fmt: skip
    return parameter_facts(parameter, value, slider(parameter, value, max(like, default=1.0)))


def parameter_facts(
    parameter: Parameter, value: float | None, ends: tuple[float, float]
) -> dict[str, Any]:
    """Return what a slider needs: name, unit, meaning, value, the ends of its range, the domain."""
    return {
        "name": parameter.name,
        "units": "" if parameter.units == "1" else parameter.units,
        "meaning": parameter.long_name,
        "value": value,
        "low": ends[0],
        "high": ends[1],
        "least": parameter.low if math.isfinite(parameter.low) else None,
        "most": parameter.high if math.isfinite(parameter.high) else None,
        "positive": parameter.positive,
        "wants": parameter.wants,
    }


def slider(parameter: Parameter, value: float | None, size: float) -> tuple[float, float]:
    """Return the range of a slider: the domain if it is finite, else some way round the value.

    >>> slider(Parameter(name="a", units="m", long_name="distance"), 2.0, 1.0)
    (-5.0, 5.0)
    """
    reach = FACTOR * (abs(value) if value else size)
    reach = min(max(reach, 1e-150), 1e150)
    low = parameter.low if math.isfinite(parameter.low) else -reach
    high = parameter.high if math.isfinite(parameter.high) else reach
    if parameter.positive:
        low = 0.008 * reach
    return float(min(low, value if value is not None else low)), float(max(high, value or low))


def _python(system: System) -> dict[str, Any]:
    """Return what stands before and after the parameters where Python makes the system."""
    kind = type(system)
    public = kind.__module__.startswith("phasekit.")
    start, end = f"{'pk.' if public else ''}{kind.__name__}(", ")"
    own = system.arguments
    mapping = "parameters" in own
    if mapping:  # what comes before them has its place, what comes after its keyword
        names = list(own)
        place = names.index("parameters")
        start += "".join(f"{own[name]!r}, " for name in names[:place]) + "{"
        after = [name for name in names[place + 1 :] if own[name] is not None]
        end = "}" + "".join(f", {name}={own[name]!r}" for name in after) + end
    return {
        "imports": "" if public else f"from {kind.__module__} import {kind.__name__}",
        "start": start,
        "end": end,
        "mapping": mapping,
    }
