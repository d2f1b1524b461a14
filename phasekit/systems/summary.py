"""What a system is, in words: its parameters in everyday units, its equilibria, its folds."""

from __future__ import annotations

import html
import math
import re
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np

from phasekit.errors import EquilibriumKind, ParameterError, Topology
from phasekit.inputs import SHOWN
from phasekit.labels.arguments import Value, brief
from phasekit.labels.units import converted
from phasekit.laws.trigonometric import Trigonometric

#: Units in which people think of a quantity, by the SI unit.
EVERYDAY = {"rad": "deg", "m": "mm", "s-1": "rpm"}

#: What a phase portrait with these separatrices is called.
REGIMES = {
    Topology.NONE: "no separatrices",
    Topology.WINDING: "one separatrix, which winds round the cylinder",
    Topology.FIGURE_EIGHT: "figure-eight",
    Topology.HETEROCLINIC: "heteroclinic: two saddles of one energy",
}

_RAISED = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")


@dataclass(frozen=True)
class Summary:
    """A system in words; `str` of it is text, and `html` a table."""

    name: str
    #: Name, value with unit, and meaning of each parameter.
    parameters: tuple[tuple[str, str, str], ...]
    facts: tuple[str, ...]

    def __str__(self) -> str:
        """Write it in lines."""
        values = ", ".join(f"{name} = {value}" for name, value, _ in self.parameters)
        return "\n".join([f"{self.name}: {values}" if values else self.name, *self.facts])

    @property
    def html(self) -> str:
        """Write it for a notebook."""
        rows = "".join(
            f"<tr><th>{html.escape(name)}</th>"
            f"<td style='padding-right: 1em; white-space: nowrap'>{html.escape(value)}</td>"
            f"<td style='text-align: left'>{html.escape(meaning)}</td></tr>"
            for name, value, meaning in self.parameters
        )
        facts = "".join(f"<div>{html.escape(fact)}</div>" for fact in self.facts)
        return f"<div><b>{html.escape(self.name)}</b><table>{rows}</table>{facts}</div>"


def summary(system: Any) -> Summary:
    """Say what a system is."""
    if not issubclass(system.rung, Trigonometric):  # its formula says it
        return Summary(repr(system), (), ())
    declared = {parameter.name: parameter for parameter in system.declared}
    parameters = tuple(
        (name, shown(value, declared[name].units), declared[name].long_name)
        for name, value in system.parameters.items()
    )
    try:
        facts = tuple(_facts(system))
    except ParameterError:  # coefficients beyond the largest double
        facts = ()
    return Summary(type(system).__name__, parameters, facts)


def shown(value: Value, units: str) -> str:
    """Write a value that is in SI units or radians in the unit that people use.

    >>> shown(0.024, "m"), shown(9.80665, "m s-2"), shown(np.array([0.0, np.pi]), "rad")
    ('24 mm', '9.80665 m s⁻²', '[0, 180]°')
    """
    unit = EVERYDAY.get(units, units)
    if unit == "mm" and isinstance(value, float) and abs(value) >= 1.0:
        unit = "m"
    value = converted("units", value, units, unit) if unit != units else value
    text = f"{value:.6g}" if isinstance(value, float) else brief(value)
    if isinstance(value, np.ndarray) and value.size <= SHOWN:
        text = f"[{', '.join(f'{x:.6g}' for x in value)}]"
    if unit in ("", "1"):
        return text
    if unit == "deg":
        return f"{text}°"
    raised = re.sub(r"(?<=[a-z])-?\d+", lambda power: power[0].translate(_RAISED), unit)
    return f"{text} {raised}"


def _facts(system: Any) -> Iterator[str]:
    arrays = {name: x for name, x in system.parameters.items() if not isinstance(x, float)}
    if arrays:
        yield f"a system for each cell along {', '.join(arrays)}"
        return
    from phasekit.phase.exact.phase_space import phase_space  # loads the kernels

    points, loops = phase_space(*system.coefficients())
    count = int(points.n_equilibria)
    if count == 0:
        yield "no force: every angle is an equilibrium"
        return
    places = []
    for kind, word in (
        (EquilibriumKind.CENTER, "center"),
        (EquilibriumKind.SADDLE, "saddle"),
        (EquilibriumKind.DEGENERATE, "degenerate equilibrium"),
    ):
        angles = [shown(float(phi), "rad") for phi in points.phi[points.kind == kind]]
        words = word if len(angles) == 1 else f"{word}s"
        places += [f"{words} at {' and '.join(angles)}"] if angles else []
    yield f"{REGIMES[Topology(int(loops.topology))]}; {', '.join(places)}"
    margin = float(points.fold_margin)
    folds = [f"{name} = {value}" for name, value in _folds(system)]
    near = f"; folds at {', '.join(folds)}" if folds else ""
    yield f"{count} equilibria, fold margin {margin:.3g} (0 on a fold){near}"


def _folds(system: Any) -> Iterator[tuple[str, str]]:
    """The fold nearest in each parameter for which it is known in closed form."""
    declared = {parameter.name: parameter for parameter in system.declared}
    inputs = {name: system.parameters[name] for name in system.formula_inputs()}
    for name, solve in system.critical_values.items():
        now = inputs[name]
        # Solutions are those >= 0, of angles those up to a right angle.
        obtuse = declared[name].units == "rad" and now > 0.5 * math.pi
        found = [float(value) for value in solve(**inputs)[:2] if np.isfinite(value)]
        found = [math.pi - x if obtuse else math.copysign(x, now) for x in found]
        if found:
            nearest = min(found, key=lambda value: abs(value - now))
            yield name, shown(nearest, declared[name].units)
