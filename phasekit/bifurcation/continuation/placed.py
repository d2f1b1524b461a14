"""Where special points stand on a path: in order, once each."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from phasekit.bifurcation.continuation.curve import Curve
from phasekit.bifurcation.continuation.path import Path, turned
from phasekit.bifurcation.continuation.points.special import CONVERGED, Special

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
    placed = sorted(placed, key=lambda one: (one.index, one.along))
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
