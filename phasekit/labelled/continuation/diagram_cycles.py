"""Families of periodic orbits that hang together with branches of equilibria, each once."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from phasekit.cycles.functionals import numbers_of_orbit
from phasekit.errors import ConvergenceError, ParameterError, warn
from phasekit.labelled.continuation.branch import Branch
from phasekit.labelled.continuation.cycle_branch import HomoclinicEnd
from phasekit.labelled.continuation.special_point import SpecialPoint
from phasekit.labelled.continuation.unfinished import interrupted

#: At which a family ends that has come to another point, and what begins there.
BEGIN = ("hopf", "period_doubling", "cycle_branch_point")
CLOSE = 1e-2  # of the span and of the sizes of states: how far an end is from the point it is at
SAME = 1e-6


def families(branches: Sequence[Branch], depth: int) -> list[Branch]:
    """The families from all Hopf points, their doubled ones to a depth, and homoclinic ends."""
    found: list[Branch] = []
    begun: list[SpecialPoint[Any]] = []
    known = [point for branch in branches for point in branch.special_points if point.kind in BEGIN]
    queue = [(point, 0) for point in known]
    while queue:
        point, level = queue.pop(0)
        if point.status != "converged" or any(_same(point, other) for other in begun):
            continue
        begun.append(point)
        if any(_ends_at(family, point, known) for family in found):
            continue
        family = _switched(point)
        if family is None:
            continue
        found.append(family)
        if interrupted(family):
            break
        if level < depth:
            more = [one for one in family.special_points if one.kind in BEGIN[1:]]
            known += more
            queue += [(one, level + 1) for one in more]
    for family in list(found):
        found += _connections(family)
    return found


def _switched(point: SpecialPoint[Any]) -> Branch | None:
    """What begins at a point; None, with a warning, if it cannot be followed."""
    try:
        family: Branch = point.switch()
    except (ConvergenceError, ParameterError) as error:
        _warn(f"what begins at {point!r} is not followed: {error}")
        return None
    return family


def _connections(family: Branch) -> list[Branch]:
    """The homoclinic orbits at the ends of a family, each once."""
    found: list[Branch] = []
    for stop in family.stops:
        if not isinstance(stop, HomoclinicEnd):
            continue
        try:
            found.append(stop.connection())
        except (ConvergenceError, ParameterError) as error:
            value = float(family.points[family.parameter][stop.side])
            _warn(
                f"the homoclinic orbit at the end of the family from {family.special_points[0]!r} "
                f"at {family.parameter} = {value:.9g} is not followed: {error}"
            )
    return found


def _warn(message: str) -> None:
    warn(message, RuntimeWarning)


def _numbers(point: SpecialPoint[Any]) -> tuple[float, np.ndarray[Any, Any], np.ndarray[Any, Any]]:
    """The parameter at a point, and the least and the largest value of each state."""
    value = float(point.parameters[point.branch.parameter])
    if point.way != "orbit":
        return value, point.x, point.x
    numbers = numbers_of_orbit(point.branch.curve, point.special.point.orbit)
    states = point.branch.curve.field.states
    low, high = (np.array([numbers[f"{x}_{part}"] for x in states]) for part in ("min", "max"))
    return value, low, high


def _apart(point: SpecialPoint[Any], other: SpecialPoint[Any]) -> float:
    """Distance of two points on scaled axes, by their parameters and extremes of states."""
    (p, low, high), (q, lower, higher) = _numbers(point), _numbers(other)
    if other.way != "orbit":  # about which an orbit beside it turns
        low = high = 0.5 * (low + high)
    curve = other.branch.curve
    width = curve.width[0] if other.way == "orbit" else curve.scale[curve.n]
    scale, turn = curve.scale[: len(low)], curve.period[: len(low)]
    # Angles may be told whole turns apart.
    whole = np.where(turn > 0.0, turn * np.rint((low - lower) / np.where(turn > 0.0, turn, 1.0)), 0)
    gaps = [np.max(np.abs(one - whole) / scale) for one in (low - lower, high - higher)]
    return float(max(abs(p - q) / width, *gaps))


def _same(point: SpecialPoint[Any], other: SpecialPoint[Any]) -> bool:
    """Whether two points of two branches are one."""
    return point.kind == other.kind and _apart(point, other) < SAME


def _ends_at(family: Branch, point: SpecialPoint[Any], known: list[SpecialPoint[Any]]) -> bool:
    """Whether a family has come to a point from its other end: of all such points the nearest."""
    ends = [one for one in family.special_points if one.kind == "end"]
    for stop, end in zip(family.stops, (ends[0], ends[-1]) if ends else (), strict=False):
        if stop.reason != point.kind or not (gap := _apart(end, point)) < CLOSE:
            continue
        rivals = [one for one in known if one.kind == point.kind]
        if not any(_apart(end, one) < gap and not _same(one, point) for one in rivals):
            return True
    return False
