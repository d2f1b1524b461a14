"""What happens along one parameter: all events, and how arcs of equilibria are joined at each.

`Path` knows by exact arithmetic every value at which equilibria merge or change labels. Between two
such events each label is one smooth arc, by the location theorem; `join_all` says which ends of
arcs are one curve: the pair lower saddle and upper center closes at a fold, a trio meets at a
pitchfork, a change of sign of B or C hands labels over.
"""

from __future__ import annotations

from fractions import Fraction
from typing import NamedTuple

import numpy as np

from phasekit.bifurcation.curves import End, Joints, Meeting
from phasekit.bifurcation.exact.line import Path
from phasekit.bifurcation.exact.normal_forms import fold_angle, normal_form
from phasekit.numerics.real_roots import unit_roots
from phasekit.phase.exact.phase_space import equilibria

LOWER_CENTER, LOWER_SADDLE, UPPER_CENTER, UPPER_SADDLE = range(4)
CENTERS, SADDLES = (LOWER_CENTER, UPPER_CENTER), (LOWER_SADDLE, UPPER_SADDLE)

# Roots that lie closer together, relative to the span, are one event.
SAME = Fraction(1, 2**50)


class Event(NamedTuple):
    """A value of the parameter where equilibria merge, change labels, or all points are one."""

    x: Fraction
    at: float
    sign_of_A: int
    degenerate: bool  # Delta vanishes
    forceless: bool
    B_vanishes: bool
    C_vanishes: bool


class Interval(NamedTuple):
    """What holds between two events: signs of B, C and of the force, number of equilibria."""

    B: int
    C: int
    force: int
    number: int

    @property
    def labels(self) -> tuple[int, ...]:
        """Labels that exist; a pair that is merged all along stands as lower saddle."""
        return {4: (0, 1, 2, 3), 3: (0, 1, 3), 2: (0, 3), 0: ()}[self.number]


def survey(path: Path) -> tuple[list[Event], list[Interval]]:
    """Events inside the span, in order, and what holds between them; complete by exact roots."""
    A, B, C = path.products
    found: list[tuple[Fraction, int]] = []
    for kind, polynomial in enumerate((path.discriminant, path.common, B, C)):
        found += [(x, kind) for x in unit_roots(polynomial) if SAME < x < 1 - SAME]
    groups: list[list[tuple[Fraction, int]]] = []
    for root in sorted(found):
        if groups and root[0] - groups[-1][-1][0] <= SAME:
            groups[-1].append(root)
        else:
            groups.append([root])
    events = []
    for group in groups:
        kinds = {kind for _, kind in group}
        x = group[0][0]
        sign = path.sign(path.common, x) * path.sign(A, x)
        events.append(Event(x, path.along(x), sign, *(kind in kinds for kind in range(4))))
    lefts = [Fraction(0), *(group[-1][0] for group in groups)]
    rights = [*(group[0][0] for group in groups), Fraction(1)]
    intervals = []
    for left, right in zip(lefts, rights, strict=True):
        x = (left + right) / 2
        force, delta = path.sign(path.common, x), path.sign(path.discriminant, x)
        b, c = (force * path.sign(p, x) for p in (B, C))
        number = 4 if delta < 0 else (3 if delta == 0 and b and c else 2)
        intervals.append(Interval(b, c, force, number if any((*A, *B, *C)) else 0))
    return events, intervals


def join_all(path: Path, events: list[Event], intervals: list[Interval]) -> Joints:
    """Link the ends of all arcs at all events."""
    joints = Joints()
    for k, event in enumerate(events):
        _join(path, event, k, intervals[k], intervals[k + 1], joints)
    return joints


def _join(
    path: Path, event: Event, k: int, left: Interval, right: Interval, joints: Joints
) -> None:
    """Link the ends of arcs at one event; interval k lies to its left."""
    if event.forceless:
        _end_without_force(path, event, k, left, right, joints)
    elif event.degenerate:
        phi, gone = _merged_angle(path, event, left)
        if gone is None:
            _join_pair(path, event, k, left, right, joints, phi)
        else:
            _join_trio(path, event, k, left, right, joints, phi, C_is_zero=gone == "C")
    else:
        handed = _handed_over(event, left, right)
        for label in left.labels:
            joints.link(End(k, label, 1), End(k + 1, handed[label], 0))


def _handed_over(event: Event, left: Interval, right: Interval) -> dict[int, int]:
    """Which label on the right continues each label of the left."""
    handed = {label: label for label in range(4)}
    if left.number == right.number == 4:
        equal_with = {"B": SADDLES, "C": CENTERS}
        if event.sign_of_A < 0:
            equal_with = {"B": CENTERS, "C": SADDLES}
        for name, (one, other) in equal_with.items():
            if getattr(left, name) * getattr(right, name) < 0:
                handed[one], handed[other] = other, one
    return handed


def _merged_angle(path: Path, event: Event, left: Interval) -> tuple[float, str | None]:
    """Angle at which equilibria merge, and which of B and C is zero there."""
    A, B, C, _ = path.law({**path.values, path.parameter: event.at})
    if event.C_vanishes or left.C == 0:
        return float(fold_angle(A, B, 0.0)), "C"
    if event.B_vanishes or left.B == 0:
        return float(fold_angle(A, 0.0, C)), "B"
    return float(fold_angle(A, B, C)), None


def _special(path: Path, event: Event, phi: float, kind: str) -> Meeting:
    values = {**path.values, path.parameter: event.at}
    return Meeting(event.at, phi, kind, normal_form(path.law, values, path.parameter, phi, kind))


def _join_pair(
    path: Path,
    event: Event,
    k: int,
    left: Interval,
    right: Interval,
    joints: Joints,
    phi: float,
) -> None:
    """Link arcs at a fold, where lower saddle and upper center meet."""
    crossing = left.number == right.number == 4
    place = joints.note(_special(path, event, phi, "transcritical" if crossing else "fold"))
    for label in (LOWER_CENTER, UPPER_SADDLE):
        joints.link(End(k, label, 1), End(k + 1, label, 0))
    if crossing:  # two folds touch: the branches run through each other
        joints.link(End(k, LOWER_SADDLE, 1), End(k + 1, UPPER_CENTER, 0), place)
        joints.link(End(k, UPPER_CENTER, 1), End(k + 1, LOWER_SADDLE, 0), place)
        return
    for j, side, interval in ((k, 1, left), (k + 1, 0, right)):
        if interval.number == 4:
            joints.link(End(j, LOWER_SADDLE, side), End(j, UPPER_CENTER, side), place)


def _join_trio(
    path: Path,
    event: Event,
    k: int,
    left: Interval,
    right: Interval,
    joints: Joints,
    phi: float,
    *,
    C_is_zero: bool,
) -> None:
    """Link arcs where three equilibria meet, or a path runs through a cusp."""
    if C_is_zero == (event.sign_of_A > 0):
        outer, middle, lone, other = CENTERS, LOWER_SADDLE, LOWER_CENTER, UPPER_SADDLE
    else:
        outer, middle, lone, other = SADDLES, UPPER_CENTER, UPPER_SADDLE, LOWER_CENTER
    joints.link(End(k, other, 1), End(k + 1, other, 0))
    if left.number == right.number:
        crossing = left.number == 4
        place = joints.note(_special(path, event, phi, "branch_point" if crossing else "cusp"))
        if crossing:
            joints.link(End(k, middle, 1), End(k + 1, middle, 0), place)
            joints.link(End(k, outer[0], 1), End(k + 1, outer[1], 0), place)
            joints.link(End(k, outer[1], 1), End(k + 1, outer[0], 0), place)
        else:
            joints.link(End(k, lone, 1), End(k + 1, lone, 0), place)
        return
    place = joints.note(_special(path, event, phi, "pitchfork"))
    full, bare, side = (k, k + 1, 1) if left.number == 4 else (k + 1, k, 0)
    joints.link(End(full, outer[0], side), End(full, outer[1], side), place)
    joints.link(End(full, middle, side), End(bare, lone, 1 - side), place)


def _end_without_force(
    path: Path, event: Event, k: int, left: Interval, right: Interval, joints: Joints
) -> None:
    """End all arcs where A = B = C = 0, at the limits of their angles."""
    values = [float(path.value(p, event.x)) for p in path.products]
    for j, side, interval in ((k, 1, left), (k + 1, 0, right)):
        limit = equilibria(*(np.array([interval.force * x]) for x in values)).phi[0]
        for label in interval.labels:
            joints.place[End(j, label, side)] = joints.note(
                Meeting(event.at, float(limit[label]), "no_force")
            )
