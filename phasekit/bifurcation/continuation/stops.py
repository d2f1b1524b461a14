"""Why tracks end, in words."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from phasekit.bifurcation.continuation.conserved import not_isolated
from phasekit.bifurcation.continuation.kernels import newton, trace
from phasekit.bifurcation.continuation.kernels.step import CROSSES, TURNS
from phasekit.numerics import differences

Array = npt.NDArray[np.float64]


HARDLY = 1e-3  # part of the span of a parameter
#: Ends that say nothing of the curve, which goes on from there.
UNFINISHED = ("max_points", "interrupted")


@dataclass(frozen=True)
class Stop:
    """Why a curve ends, such as bound, closed, stuck or not_finite; and what says so in words."""

    reason: str
    message: str


def place_of(curve: Any, w: Array) -> str:
    """A point of a curve in words."""
    names = [*curve.field.states, *(curve.field.parameters[i] for i in curve.active)]
    where = ", ".join(f"{name} = {w[i]:.9g}" for i, name in enumerate(names[:4]))
    return where + (", ..." if len(names) > 4 else "")


def track_stop(curve: Any, reason: int, which: int, w: Array) -> Stop:
    """Say why a track of a `Curve` ends in the state w."""
    names = [*curve.field.states, *(curve.field.parameters[i] for i in curve.active)]
    where = place_of(curve, w)
    if reason == trace.BOUND and which >= curve.m:
        return Stop("bound", f"branches no longer meet on the curve beyond {where}")
    if reason == trace.BOUND:
        over = w[which] - curve.low[which] > 0.5 * (curve.high[which] - curve.low[which])
        if not np.isfinite(curve.low[which]) or not np.isfinite(curve.high[which]):
            over = bool(np.isfinite(curve.high[which])) or w[which] > 0.0
        side, bound = ("upper", curve.high) if over else ("lower", curve.low)
        if which < curve.n and names[which] not in curve.options.bounds:  # nobody gave it
            passed = f"passed {bound[which]:.3g}, far beyond its size at the start"
            if _ends_nowhere(curve, w, which):
                passed = f"grows without end: it {passed}"
            return Stop(
                "bound",
                f"{names[which]} {passed}; ContinuationOptions(bounds={{{names[which]!r}: "
                "(low, high)}) sets another limit",
            )
        return Stop("bound", f"{names[which]} met its {side} bound {bound[which]:.9g}")
    if reason == trace.CLOSED:
        return Stop("closed", f"the curve closed on its start at {where}")
    if reason == trace.STUCK:
        why = not_isolated(curve, w[: curve.m], where)
        return Stop("stuck", why) if why else stuck(curve, which, where)
    if reason == trace.NOT_FINITE:
        return Stop("not_finite", f"f is not finite beyond {where}{curve.field.raised}")
    if reason == trace.INTERRUPTED:
        return Stop("interrupted", f"it was interrupted behind {where}")
    return Stop("max_points", f"max_points were computed, the last at {where}")


def stuck(curve: Any, which: int, where: str) -> Stop:
    """The end of a curve where no step stands, and why the last one was refused."""
    step = f"min_step = {curve.options.min_step:g}"
    words = {
        newton.DIVERGED: f"Newton's method converged for no step longer than {step}",
        newton.SINGULAR: f"the derivatives of f are singular beyond, for every step "
        f"longer than {step}",
        TURNS: f"the curve turns by more than max_turn = {curve.options.max_turn:g} within {step}",
        CROSSES: f"branches cross or pass each other within {step}",
    }
    return Stop("stuck", f"{words[which]} at {where}{_differences(curve)}")


def _ends_nowhere(curve: Any, w: Array, which: int) -> bool:
    """Whether the parameters hardly move while an unknown grows, as next to a pole."""
    free = slice(curve.n, curve.m)
    moved = np.abs(w[curve.size :][free] * w[which])
    room = np.where(np.isfinite(curve.high - curve.low), curve.high - curve.low, np.inf)[free]
    grown = abs(w[curve.size + which])
    return bool(np.all(moved <= HARDLY * room * grown))


def wished(stop: Stop, ends: tuple[str, ...]) -> bool:
    """Whether a user's ``stop=`` ended it, not the doubling that an orbit of period two ends at."""
    return stop.reason in ends and stop.message.startswith("stop = ")


#: Where a branch begins that was followed to one side.
NO_START = Stop("start", "the start; this direction was not requested")
#: Where special points were not yet looked for.
SEARCHED = Stop("interrupted", "it was interrupted while special points were looked for")
#: Where there was no time for a first point.
NOT_BEGUN = Stop("interrupted", "it was interrupted before its first point")


def _differences(curve: Any) -> str:
    """What else may end a curve whose derivatives are differences, in words."""
    if curve.knows_slopes:
        return ""
    width = 2.0 * differences.COARSE
    return (
        f"; derivatives are differences over {width:.0e} of an unknown and miss what f does "
        "within less: a formula or jac knows them"
    )
