"""Branches that the engine follows, held against the reference."""

from __future__ import annotations

from typing import Any

import numpy as np
from published import reference
from published.systems import BRANCH, FOLD, HOPF, NEUTRAL, System

import phasekit as pk

FORMS = ("symbolic", "compiled", "python")
#: What the engine may call a crossing of branches.
CROSSINGS = (BRANCH, "pitchfork", "transcritical")
LABELS = {FOLD: "LP", HOPF: "H", NEUTRAL: "NS", BRANCH: "BP"}
TOLERANCE = 1e-8  # of the values; the engine is far better, and the tests below say how much


def problem(system: System, form: str, **changes: Any) -> Any:
    """The system as a Problem, in one of the forms."""
    f = {
        "symbolic": lambda: list(system.equations),
        "compiled": system.compiled,
        "python": system.python,
    }[form]()
    return pk.Problem(f, state=system.state, parameters={**system.parameters, **changes})


def follow(system: System, form: str = "symbolic", **options: Any) -> Any:
    """The branch of the system through its start, over its span."""
    return pk.continuation(
        problem(system, form),
        system.parameter,
        x0=list(system.x0),
        span=system.span,
        options=pk.ContinuationOptions(bounds=dict(system.bounds), **options),
    )


def state_of(special: Any) -> np.ndarray:
    """The state of a special point as an array."""
    x = special.x
    return np.array(list(x.values()) if hasattr(x, "values") else x, float)


def kind_of(special: Any) -> str:
    """Its kind, with all crossings of branches under one name."""
    kind = str(getattr(special.kind, "value", special.kind))
    return BRANCH if kind in CROSSINGS else kind


def compare(
    found: Any, wanted: list[reference.Special], parameter: str, tolerance: float = TOLERANCE
) -> None:
    """Each special point is found once, with its kind, parameter and state; and no others are."""
    found = [one for one in found if kind_of(one) != "end"]
    text = "\n".join(f"{kind_of(one)} {one.parameters[parameter]!r} {one.status}" for one in found)
    expected = "\n".join(f"{one.kind} {float(one.parameter)!r}" for one in wanted)
    assert len(found) == len(wanted), f"found:\n{text}\nwanted:\n{expected}"
    left = list(found)
    for one in wanted:
        x, p = np.array(one.state, float), float(one.parameter)
        scale = np.abs(x).max(initial=1e-30) if np.abs(x).max(initial=0.0) > 1e3 else 1.0

        def distance(other: Any, x: np.ndarray = x, p: float = p, scale: float = scale) -> float:
            off = abs(float(other.parameters[parameter]) - p) / max(1.0, abs(p))
            return float(off + np.abs(state_of(other) - x).max() / scale)

        alike = [other for other in left if kind_of(other) == one.kind]
        assert alike, f"no {one.kind} at {p!r}; found:\n{text}\nwanted:\n{expected}"
        nearest = min(alike, key=distance)
        assert nearest.status == "converged", (one.kind, p, nearest)
        assert nearest.label == LABELS[one.kind]
        off = abs(float(nearest.parameters[parameter]) - p)
        assert off <= tolerance * max(1.0, abs(p)), (one.kind, p, off)
        assert distance(nearest) <= 100 * tolerance, (one.kind, x, state_of(nearest))
        left.remove(nearest)
