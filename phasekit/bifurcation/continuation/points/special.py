"""What is known of a special point, whatever its kind."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np
import numpy.typing as npt

from phasekit.bifurcation.continuation.curve import TIGHT, Curve
from phasekit.bifurcation.continuation.events import Bracket
from phasekit.bifurcation.continuation.kernels.defining import BRANCH, HOPF
from phasekit.bifurcation.continuation.units import force_sizes, nullspace, row_sizes
from phasekit.bifurcation.special_points import KINDS

Array = npt.NDArray[np.float64]

CONVERGED, GUESS = "converged", "guess"
STEPS = 25  # of Newton's method
BESIDE = 1e-6  # part of a chord by which a point between its ends may lie beside them


@dataclass(frozen=True)
class Special:
    """A special point: unknowns (x, free parameters), and how well it is known."""

    kind: str
    u: Array
    interval: tuple[float, float]
    residual: float
    status: str
    message: str = ""
    normal_form: dict[str, float] = field(default_factory=dict)
    tangent: Array | None = None  # of the path
    others: tuple[Array, ...] = ()  # tangents of the other branches, at a branch point
    extra: Array | None = None  # the unknowns that its defining system adds
    corank: int = 0  # of f_x
    name: str = ""  # of an event

    def __post_init__(self) -> None:
        """Refuse a kind that nobody knows."""
        if self.kind not in KINDS:
            raise ValueError(f"no special point is a {self.kind!r}")


def interval_of(curve: Curve, bracket: Bracket) -> tuple[float, float]:
    """The values of the parameter at the ends of a bracket."""
    ends = bracket.a.u[curve.n], bracket.b.u[curve.n]
    return float(min(ends)), float(max(ends))


def reach_of(curve: Curve, bracket: Bracket) -> float:
    """How far a refined point may lie from where it was bracketed."""
    return curve.length(bracket.b.u - bracket.a.u) + 1e-7


def is_between(curve: Curve, bracket: Bracket, u: Array) -> bool:
    """Whether a point stands between the ends of a bracket, by its place along their chord."""
    m = curve.m
    chord = bracket.b.u - bracket.a.u
    gap = np.zeros(len(chord))
    gap[:m] = u[:m] - bracket.a.u[:m]
    square, along = (float(np.dot(curve.weight * chord, one)) for one in (chord, gap))
    return -BESIDE * square <= along <= (1.0 + BESIDE) * square


def extended(curve: Curve, kind: int, u: Array, extra: Array, aux: Array | None = None) -> Curve:
    """The curve's own unknowns with those of a defining system, whose sizes are those of extra.

    A right vector v counts in units of the states, a left one in units of 1/f.
    """
    more, n, m = len(extra), curve.n, curve.m
    sizes = np.ones(more)
    sizes[:n] = curve.scale[:n]
    if kind == HOPF:
        sizes[-1] = max(abs(float(extra[-1])), 1e-300) if extra[-1] else 1.0
    if kind == BRANCH:
        sizes[:n] = 1.0 / force_sizes(curve, u)
    return curve.replace(
        kind=kind,
        scale=np.concatenate([curve.scale[:m], sizes]),
        period=np.concatenate([curve.period[:m], np.zeros(more)]),
        low=np.concatenate([curve.low[:m], np.full(more, -np.inf)]),
        high=np.concatenate([curve.high[:m], np.full(more, np.inf)]),
        aux=aux,
    )


def polish(
    curve: Curve, kind: int, start: Array, extra: Array, reach: float, aux: Array | None = None
) -> tuple[Array, Array, float, str]:
    """Newton's method on a square defining system: unknowns, extra ones, residual, message."""
    system = extended(curve, kind, start, extra, aux)
    whole = np.concatenate([start[: curve.m], extra])
    point = system.refine(whole, tolerance=max(TIGHT, curve.field.accuracy * 0.1))
    residual = float(np.max(np.abs(point.residual)))
    if not point.converged or not np.isfinite(residual):
        return start, extra, residual, "Newton's method on the defining system did not converge"
    moved = curve.length(point.u[: curve.m] - start[: curve.m])
    if moved > reach:
        return start, extra, residual, "the defining system led away from the bracket"
    return point.u[: curve.m], point.u[curve.m :], residual, ""


def solved(
    curve: Curve,
    system: Callable[[Array], tuple[Array, Array]],
    start: Array,
    sizes: Array,
    reach: float,
) -> tuple[Array, float, str]:
    """Newton's method on a square system of few unknowns: them, the residual, a message."""
    z, before, m = np.array(start), np.inf, curve.m
    for _ in range(STEPS):
        value, matrix = system(z)
        matrix = matrix * sizes
        rows = row_sizes(matrix)
        if not (np.isfinite(matrix).all() and np.isfinite(value).all()):
            break
        try:
            step = np.linalg.solve(matrix / rows[:, None], -value / rows)
        except np.linalg.LinAlgError:
            break
        size = float(np.max(np.abs(step)))
        if not size < 1e3:
            break
        z = z + step * sizes
        # In units of the unknowns' scales; from the root of rounding on, until it stops to shrink.
        if size <= 1e-15 or (size <= 1e-9 and size >= 0.5 * before):
            if curve.length(z[:m] - start[:m]) > reach:
                return start, np.inf, "the defining system led away from the bracket"
            return z, float(np.max(np.abs(system(z)[0]))), ""
        before = size
    return start, np.inf, "Newton's method on the defining system did not converge"


def tangent_at(curve: Curve, u: Array, near: Array) -> Array:
    """The unit tangent of the branch at a point, in the direction of another one."""
    _, slopes = curve.evaluate(u)
    directions = nullspace(slopes, curve.scale[: curve.m])
    if len(directions) != 1:
        return near
    t = directions[0] / curve.length(directions[0])
    return np.asarray(t if np.dot(curve.weight * t, near) >= 0.0 else -t)
