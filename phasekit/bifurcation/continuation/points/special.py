"""What is known of a special point, whatever its kind, and where it stands on a path."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np

from phasekit.arrays import Array
from phasekit.bifurcation.continuation.curve import TIGHT, Curve
from phasekit.bifurcation.continuation.events import Bracket
from phasekit.bifurcation.continuation.kernels.defining import BRANCH, HOPF
from phasekit.bifurcation.continuation.path import Path, turned
from phasekit.bifurcation.continuation.units import force_sizes, nullspace, row_sizes
from phasekit.bifurcation.continuation.walk import in_order
from phasekit.bifurcation.special_points import KINDS

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


SAME = 1e-6  # points of one kind that are closer, on scaled axes, are one
#: The same of points that Newton's method found each where its own test function changes its sign.
OWN = 1e-9
STAYS = 1e-3  # distance within which a path that passes a special point has not left it
TURNS = 1e-4  # part of a unit tangent along the parameter, on scaled axes


@dataclass(frozen=True)
class Placed:
    """A special point and where it stands: after which point of the path, how far along."""

    index: int
    along: float
    special: Special
    own: bool = False  # whether it was refined within its own bracket

    @property
    def kind(self) -> str:
        """Of the registry of special points."""
        return self.special.kind

    @property
    def name(self) -> str:
        """Of an event, else empty."""
        return self.special.name

    @property
    def position(self) -> Special:
        """Where it stands."""
        return self.special


def unique(curve: Curve, path: Path, placed: list[Placed]) -> list[Placed]:
    """In order along the path, each once: next to some, all test functions change their signs."""
    placed = in_order(placed)
    kept: list[Placed] = []
    for one in placed:
        twin = None
        for i in range(len(kept) - 1, max(-1, len(kept) - 4), -1):
            other = kept[i]
            apart = OWN if one.own and other.own else SAME
            alike = other.special.kind == one.special.kind and _distance(curve, one, other) < apart
            if alike and _stays(curve, path, other, one):
                twin = i
        if twin is None:
            kept.append(one)
        elif kept[twin].special.status != "converged" and one.special.status == "converged":
            kept[twin] = one
        elif not inside(kept[twin]) and inside(one):
            kept[twin] = one
    return [one for one in kept if not _echo(curve, one, kept)]


def inside(one: Placed) -> bool:
    """Whether a point stands between the two points of the path that it is placed at."""
    return -1e-6 <= one.along <= 1.0 + 1e-6


def _stays(curve: Curve, path: Path, one: Placed, other: Placed) -> bool:
    """Whether the path stays next to a special point up to where it is seen again."""
    if other.index - one.index <= 2:
        return True
    m = curve.m
    gap = turned(curve, path.u[one.index + 1 : other.index, :m] - one.special.u[:m])
    return bool(np.max(np.abs(gap / curve.scale[:m])) < STAYS)


def _distance(curve: Curve, one: Placed, other: Placed) -> float:
    """Distance on scaled axes, angles modulo their periods."""
    m = curve.m
    gap = turned(curve, one.special.u[:m] - other.special.u[:m])
    return float(np.sqrt(np.sum((gap / curve.scale[:m]) ** 2)))


def _echo(curve: Curve, one: Placed, all_: list[Placed]) -> bool:
    """Whether a fold is but the turn of a pitchfork's side branch at the pitchfork itself."""
    if one.special.status != CONVERGED and one.special.extra is None:  # a multiple point
        for other in all_:
            many = other.special.corank > 1 or len(other.special.others) > 1
            rounding = OWN if curve.field.exact else SAME
            near = _distance(curve, one, other) < (1e-4 if many else rounding)
            if near and other.special.status == CONVERGED:
                return True
    if one.special.kind == "neutral_saddle" and one.special.status != CONVERGED:
        # Next to a multiple branch point sums of eigenvalues are those of rounding errors.
        if any(o.special.corank > 1 and _distance(curve, one, o) < STAYS for o in all_):
            return True
    if one.special.kind != "fold":
        return False
    for other in all_:
        t = other.special.tangent
        if other.special.kind in ("pitchfork", "branch_point") and t is not None:
            flat = abs(t[curve.n]) / curve.scale[curve.n] < TURNS
            if flat and _distance(curve, one, other) < 1e2 * SAME:
                return True
    return False
