"""The complete atlas of equilibria along one parameter, as smooth curves.

Arcs between the events of a path are sampled and joined into curves, which go on through folds,
where the parameter turns back, and through pitchforks, where they cross.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from phasekit.bifurcation.exact.line import Path
from phasekit.bifurcation.exact.meetings import (
    CENTERS,
    LOWER_SADDLE,
    SADDLES,
    End,
    Interval,
    Joints,
    Meeting,
    join_all,
    survey,
)
from phasekit.errors import EquilibriumKind
from phasekit.phase.exact.equilibria import Equilibria, equilibria
from phasekit.phase.exact.potential import potential

Array = npt.NDArray[np.float64]
Coefficients = Callable[[Array], tuple[Array, Array, Array]]

# Vertices lie this near to the chords of their neighbors, in units of the span and of a turn.
SMOOTH = 5e-4
LONGEST = 0.25  # from vertex to vertex, rad
FIRST_SAMPLES, MOST_SAMPLES = 32, 4000


class Vertices(NamedTuple):
    """Points along an arc or a curve; phi is continuous."""

    at: Array
    phi: Array
    label: npt.NDArray[np.int8]
    kind: npt.NDArray[np.int8]
    energy: Array
    curvature: Array

    def pick(self, which: Any) -> Vertices:
        """Return some of the vertices."""
        columns: list[Any] = [column[which] for column in self]
        return Vertices(*columns)


@dataclass(frozen=True)
class Curve:
    """One connected curve of equilibria and the special points on it."""

    vertices: Vertices
    meetings: tuple[int, ...]
    closed: bool = False


def atlas(path: Path, coefficients: Coefficients) -> tuple[list[Curve], list[Meeting]]:
    """All curves of equilibria over the span of a path, and the special points on them.

    Parameters
    ----------
    path : Path
        The law, the other parameters, and the span.
    coefficients : callable
        A, B, C at an array of values of the parameter.

    Returns
    -------
    curves, meetings : list
        Curves that run through the span from its left end first; the meetings on a curve are
        places in the second list.
    """
    events, intervals = survey(path)
    joints = join_all(path, events, intervals)
    ends = [path.span[0], *(event.at for event in events), path.span[1]]
    arcs: dict[tuple[int, int], Vertices] = {}
    for k, interval in enumerate(intervals):
        arcs.update(_arcs(coefficients, path.span, ends[k : k + 2], k, interval, joints))
    return _walk(arcs, joints, coefficients), joints.meetings


# ------------------------------------------------------------------------------ arcs


def _arcs(
    coefficients: Coefficients,
    span: tuple[float, float],
    limits: list[float],
    k: int,
    interval: Interval,
    joints: Joints,
) -> dict[tuple[int, int], Vertices]:
    """Sample the arcs of an interval so densely that they are smooth."""
    tau = np.arange(1, FIRST_SAMPLES) / FIRST_SAMPLES
    at, points = _solve(coefficients, limits, tau)
    ends = [equilibria(*coefficients(np.array([x]))) for x in limits]
    width = span[1] - span[0]
    while True:
        arcs = {
            (k, label): _arc(coefficients, at, points, ends, limits, End(k, label, 0), joints)
            for label in interval.labels
        }
        if tau.size > MOST_SAMPLES:
            return {key: _present(arc) for key, arc in arcs.items()}
        rough = np.zeros(tau.size + 1, bool)  # the chords
        for arc in arcs.values():
            bent = _off_the_chord(arc.at / width, arc.phi / (2.0 * np.pi)) > SMOOTH
            rough[:-1] |= bent
            rough[1:] |= bent
            rough |= np.abs(np.diff(arc.phi)) > LONGEST
        if not rough.any():
            return {key: _present(arc) for key, arc in arcs.items()}
        cut = np.flatnonzero(rough)
        grid = np.concatenate([[0.0], tau, [1.0]])
        fine = 0.5 * (grid[cut] + grid[cut + 1])
        more_at, more = _solve(coefficients, limits, fine)
        # Between neighboring doubles there is nothing to see.
        ends_at = np.concatenate([limits[:1], at, limits[1:]])
        new = (more_at != ends_at[cut]) & (more_at != ends_at[cut + 1])
        if not new.any():
            return {key: _present(arc) for key, arc in arcs.items()}
        fine, more_at = fine[new], more_at[new]
        more = Equilibria(*(column[new] for column in more))
        order = np.argsort(np.concatenate([tau, fine]))
        tau, at = (np.concatenate(pair)[order] for pair in ((tau, fine), (at, more_at)))
        both: Any = zip(points, more, strict=True)
        points = Equilibria(*(np.concatenate(pair)[order] for pair in both))


def _solve(coefficients: Coefficients, limits: list[float], tau: Array) -> tuple[Array, Equilibria]:
    """Equilibria between two events, the closer together the nearer to these."""
    low, high = limits
    left, right = np.sin(0.5 * np.pi * tau) ** 2, np.cos(0.5 * np.pi * tau) ** 2
    at = np.where(tau < 0.5, low + (high - low) * left, high - (high - low) * right)
    return at, equilibria(*coefficients(at))


def _arc(
    coefficients: Coefficients,
    at: Array,
    points: Equilibria,
    ends: list[Equilibria],
    limits: list[float],
    near: End,
    joints: Joints,
) -> Vertices:
    """One label's vertices from end to end."""
    columns: list[Array] = [np.asarray(x[:, near.label], float) for x in points[:4]]
    first, last = (
        _end_vertex(coefficients, ends[end.side], limits[end.side], columns[0], end, joints)
        for end in (near, near.far)
    )
    phi, kind, energy, curvature = (
        np.concatenate([[a], column, [b]])
        for a, column, b in zip(first, columns, last, strict=True)
    )
    at = np.concatenate([limits[:1], at, limits[1:]])
    label = np.full(at.size, near.label, np.int8)
    present = np.isfinite(phi)
    phi[present] = np.unwrap(phi[present])
    return Vertices(at, phi, label, kind.astype(np.int8), energy, curvature)


def _end_vertex(
    coefficients: Coefficients,
    points: Equilibria,
    at: float,
    phi: Array,
    end: End,
    joints: Joints,
) -> tuple[float, float, float, float]:
    """Phi, kind, energy and curvature where an arc ends."""
    if end in joints.place:
        return _degenerate(coefficients, at, joints.meetings[joints.place[end]].phi)
    # Two labels may tie here, so that the nearest point of the kind counts.
    inner = phi[np.isfinite(phi)][0 if end.side == 0 else -1] if np.isfinite(phi).any() else 0.0
    slots = CENTERS if end.label in CENTERS else SADDLES
    away = [abs(_turned(float(points.phi[0, slot]) - inner)) for slot in slots]
    slot = slots[int(np.nanargmin(away))] if np.isfinite(away).any() else end.label
    phi_, kind, energy, curvature = (float(x[0, slot]) for x in points[:4])
    return phi_, kind, energy, curvature


def _degenerate(
    coefficients: Coefficients, at: float, phi: float
) -> tuple[float, float, float, float]:
    abc = coefficients(np.array([at]))
    return phi, EquilibriumKind.DEGENERATE, float(potential(*abc, phi)[0]), 0.0


def _turned(angle: float) -> float:
    return (angle + np.pi) % (2.0 * np.pi) - np.pi


def _off_the_chord(x: Array, y: Array) -> Array:
    """Distance of each inner vertex from the chord of its neighbors."""
    dx, dy, ex, ey = x[2:] - x[:-2], y[2:] - y[:-2], x[1:-1] - x[:-2], y[1:-1] - y[:-2]
    with np.errstate(invalid="ignore", divide="ignore"):
        return np.nan_to_num(np.abs(dx * ey - dy * ex) / np.hypot(dx, dy))


def _present(arc: Vertices) -> Vertices:
    """Leave out vertices so close to an event that rounding has it on their other side."""
    return arc.pick(np.isfinite(arc.phi))


# ------------------------------------------------------------------------------ curves


def _walk(
    arcs: dict[tuple[int, int], Vertices], joints: Joints, coefficients: Coefficients
) -> list[Curve]:
    """Follow links from arc to arc until each arc lies on one curve."""
    every = [End(*key, side) for side in (0, 1) for key in arcs]
    open_ends = [end for end in every if end not in joints.partner]
    left = set(arcs)
    curves = []
    for start in [*open_ends, *every]:
        if start[:2] not in left:
            continue
        pieces: list[Vertices] = []
        meetings = [joints.place[start]] if start in joints.place else []
        end: End | None = start
        while end is not None and end[:2] in left:
            left.discard(end[:2])
            pieces.append(_directed(arcs[end[:2]], end.side))
            if end.far in joints.place:
                meetings.append(joints.place[end.far])
            end = joints.partner.get(end.far)
        vertices = _in_one(pieces)
        if end is None:  # the curve ends where the span does, unless something ends it before
            for i, last in ((0, start), (-1, _last(start, joints))):
                if last not in joints.place:
                    phi = float(vertices.phi[i])
                    place = joints.note(Meeting(float(vertices.at[i]), _wrapped(phi), "end"))
                    meetings.insert(0 if i == 0 else len(meetings), place)
        curves.append(Curve(vertices, tuple(dict.fromkeys(meetings)), closed=end is not None))
    seen = {place for curve in curves for place in curve.meetings}
    for place, meeting in enumerate(joints.meetings):
        if place not in seen:  # a pair that exists at one value only
            point = (meeting.phi, *_degenerate(coefficients, meeting.at, meeting.phi)[1:])
            columns = [[meeting.at], point[:1], [LOWER_SADDLE], *([x] for x in point[1:])]
            curves.append(Curve(Vertices(*map(np.array, columns)), (place,)))
    return curves


def _last(start: End, joints: Joints) -> End:
    """The last end of the open curve that begins at `start`."""
    end = start.far
    while end in joints.partner:
        end = joints.partner[end].far
    return end


def _directed(arc: Vertices, side: int) -> Vertices:
    return arc if side == 0 else arc.pick(slice(None, None, -1))


def _in_one(pieces: list[Vertices]) -> Vertices:
    """Join arcs that share their end points; phi runs on."""
    whole = [pieces[0]]
    for piece in pieces[1:]:
        shared = piece.at[0] == whole[-1].at[-1]
        whole.append(piece.pick(slice(int(shared), None)))
    columns = [np.concatenate(parts) for parts in zip(*whole, strict=True)]
    columns[1] = np.unwrap(columns[1])
    return Vertices(*columns)


def _wrapped(phi: float) -> float:
    """The angle in (-pi, pi]."""
    return float(np.pi - (np.pi - phi) % (2.0 * np.pi))
