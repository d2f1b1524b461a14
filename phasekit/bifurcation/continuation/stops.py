"""Why tracks end, in words."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from phasekit.bifurcation.continuation.kernels import newton, trace
from phasekit.bifurcation.continuation.kernels.step import CROSSES, TURNS
from phasekit.numerics import differences

Array = npt.NDArray[np.float64]


@dataclass(frozen=True)
class Stop:
    """Why a curve ends: full, bound, closed, stuck or not_finite; and what says so in words."""

    reason: str
    message: str


def said(curve: Any, reason: int, which: int, w: Array) -> Stop:
    """Say why a track ends in the state w."""
    names = [*curve.field.states, *(curve.field.parameters[i] for i in curve.active)]
    where = ", ".join(f"{name} = {w[i]:.9g}" for i, name in enumerate(names[:4]))
    where += ", ..." if len(names) > 4 else ""
    if reason == trace.BOUND and which >= curve.m:
        return Stop("bound", f"branches no longer meet on the curve beyond {where}")
    if reason == trace.BOUND:
        over = w[which] - curve.low[which] > 0.5 * (curve.high[which] - curve.low[which])
        if not np.isfinite(curve.low[which]) or not np.isfinite(curve.high[which]):
            over = bool(np.isfinite(curve.high[which])) or w[which] > 0.0
        side, bound = ("upper", curve.high) if over else ("lower", curve.low)
        return Stop("bound", f"{names[which]} met its {side} bound {bound[which]:.9g}")
    if reason == trace.CLOSED:
        return Stop("closed", f"the curve closed on its start at {where}")
    if reason == trace.STUCK:
        step = f"min_step = {curve.options.min_step:g}"
        words = {
            newton.DIVERGED: f"Newton's method converged for no step longer than {step}",
            newton.SINGULAR: f"the derivatives of f are singular beyond, for every step "
            f"longer than {step}",
            TURNS: f"the curve turns by more than max_turn = {curve.options.max_turn:g} "
            f"within {step}",
            CROSSES: f"branches cross or pass each other within {step}",
        }
        return Stop("stuck", f"{words[which]} at {where}{_differences(curve)}")
    if reason == trace.NOT_FINITE:
        failure = curve.field.failure
        said = "" if failure is None else f": it raised {type(failure).__name__}: {failure}"
        return Stop("not_finite", f"f is not finite beyond {where}{said}")
    return Stop("max_points", f"max_points were computed, the last at {where}; extend() goes on")


def _differences(curve: Any) -> str:
    """What else may end a curve whose derivatives are differences, in words."""
    if curve.knows_slopes:
        return ""
    width = 2.0 * differences.COARSE
    return (
        f"; derivatives are differences over {width:.0e} of an unknown and miss what f does "
        "within less: a formula or jac knows them"
    )
