"""What is proved of a branch, by the names of its unknowns."""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType
from typing import Any

import numpy as np
import xarray as xr

from phasekit.bifurcation.continuation.certificates import Certificate, certificate, missing_rule
from phasekit.bifurcation.continuation.enclosed_points import Equations, Mark
from phasekit.bifurcation.continuation.kernels.defining import EQUILIBRIUM
from phasekit.labels.arguments import bad
from phasekit.labels.grid import LABEL_DTYPE
from phasekit.laws.formulas import symbols_of
from phasekit.systems.problem import Problem

#: What is enclosed beside states and parameter, by the kind of point.
_MORE = {"hopf": ("omega",), "neutral_saddle": ("sigma",), "torus": ("sine", "cosine")}


def check_certify(problem: Problem, parameter: str) -> None:
    """Refuse what no proof can be about, by name."""
    if problem.kind != "symbolic":
        kind = "a Python function" if problem.kind == "python" else "a compiled function"
        raise bad(
            "certify", True, f"False: f is {kind}, of which nothing is proved",
            "give f as formulas",
        )  # fmt: skip
    if problem.times != 1:
        raise bad("certify", True, "False: a map that is applied several times is not proved")
    missing = missing_rule(_equations(problem, parameter))
    if missing is not None:
        raise bad("certify", True, f"False: f holds {missing}, of which no bounds are known")


def refuse_certify(certify: bool, what: str) -> None:
    """Refuse branches of which nothing is proved."""
    if certify:
        raise bad("certify", certify, f"False: {what} are not proved, equilibria of formulas are")


def _equations(problem: Problem, parameter: str) -> Equations:
    symbols = symbols_of([*problem.state, *problem.parameters])
    values = {symbols[name]: float(value) for name, value in problem.parameters.items()}
    states = tuple(symbols[name] for name in problem.state)
    return Equations(tuple(problem.f), states, symbols[parameter], values, problem.map)


def is_provable(branch: Any) -> bool:
    """Whether proofs were asked for, and it is a branch that they are about."""
    curve = branch.walker.curve
    problem = branch.problem
    return bool(
        curve.options.certify
        and getattr(curve, "kind", None) == EQUILIBRIUM
        and branch.kind == "equilibrium"
        and problem.kind == "symbolic"
        and problem.times == 1
    )


def certificate_of(branch: Any, points: xr.Dataset) -> Certificate:
    """What is proved of a branch of equilibria, given its points."""
    curve = branch.walker.curve
    names = (*branch.problem_state, branch.parameter)
    columns = []
    for name, period in zip(names, curve.period, strict=False):
        column = points[name].values
        columns.append(np.unwrap(column, period=period) if period > 0.0 else column)
    u = np.column_stack(columns)
    marks = [Mark(found.special.kind, u[index], index) for found, index, _ in branch._places]
    equations = _equations(branch.problem, branch.parameter)
    return certificate(equations, u, curve.scale[: u.shape[1]], marks)


def columns_of(found: Certificate) -> dict[str, Any]:
    """What is proved of points, and of the stretches from each to the next."""
    known = np.isfinite(found.errors).all(axis=1)
    nowhere = np.full((1, found.errors.shape[1]), np.nan)
    both = ("point", "unknown")
    reasons = np.array([*found.reasons, ""], dtype=LABEL_DTYPE)
    return {
        "certified": (
            "point", known, {"long_name": "whether the point is proved to lie next to the branch"},
        ),
        "certified_error": (
            both, found.errors, {"long_name": "bound of its distance from the branch"},
        ),
        "certified_onward": (
            "point", np.append(found.stretches, False),
            {"long_name": "whether one branch is proved to go from here to the next point"},
        ),
        "certified_radius": (
            both, np.concatenate([found.radius, nowhere]),
            {"long_name": "bound of the branch's distance from the chord to the next point"},
        ),
        "certified_doubt": (
            "point", reasons, {"long_name": "why the stretch to the next point is not proved"},
        ),
    }  # fmt: skip


def enclosure_of(branch: Any, place: int) -> Mapping[str, tuple[float, float]]:
    """Bounds of a special point by name; empty where nothing is proved."""
    found = branch._certificate.specials[place]
    if not found.certified:
        return MappingProxyType({})
    point = branch.special_points[place]
    curve = branch.walker.curve
    n = len(branch.problem_state)
    low, high = found.low.copy(), found.high.copy()
    for i, period in enumerate(curve.period[:n]):
        if period > 0.0:  # on the turn that the point is shown on
            turns = np.round((point.x[i] - 0.5 * (low[i] + high[i])) / period)
            if turns:
                blur = 1e-15 * (abs(turns) * period + abs(low[i]) + abs(high[i]))
                low[i], high[i] = low[i] + turns * period - blur, high[i] + turns * period + blur
    names = (*branch.problem_state, branch.parameter, *_MORE.get(point.kind, ()))
    return MappingProxyType(
        {name: (float(a), float(b)) for name, a, b in zip(names, low, high, strict=True)}
    )


def note(branch: Any) -> str:
    """How much of a branch is proved, in words."""
    found = branch._certificate
    inner = [
        proof for proof, point in zip(found.specials, branch.special_points, strict=True)
        if point.kind != "end"
    ]  # fmt: skip
    count = sum(proof.certified for proof in inner)
    stretches = int(found.stretches.sum())
    text = f"proved: {stretches} of {len(found.stretches)} stretches"
    return f"{text}, {count} of {len(inner)} special points" if inner else text
