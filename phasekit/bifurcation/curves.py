"""Curves of equilibria along one parameter: arcs between events, sampled, and joined into curves.

Between two events each equilibrium is one smooth arc. Curves go on through folds, where the
parameter turns back, and through pitchforks, where they cross.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any, NamedTuple, Protocol

import numpy as np
import numpy.typing as npt

from phasekit.arrays import Array

# Vertices lie this near to the chords of their neighbors, in units of the span and of a turn.
SMOOTH = 5e-4
LONGEST = 0.25 / (2.0 * np.pi)  # from vertex to vertex, in turns
#: Label of a pair that exists at one value alone: that of the lower saddle.
LONE = 1
FIRST_SAMPLES, MOST_SAMPLES = 32, 4000


class NormalForm(NamedTuple):
    """Coefficients of the normal form; 0 or NaN where a term does not belong to it."""

    unfolding: float
    quadratic: float
    cubic: float


class End(NamedTuple):
    """One end of an arc: interval, label, and side 0 (left) or 1 (right)."""

    interval: int
    label: int
    side: int

    @property
    def far(self) -> End:
        """The other end."""
        return self._replace(side=1 - self.side)


class Meeting(NamedTuple):
    """A special point: where arcs meet, begin or end."""

    at: float
    phi: float
    kind: str
    normal_form: NormalForm = NormalForm(np.nan, np.nan, np.nan)


@dataclass
class Joints:
    """How the ends of arcs are linked, and where."""

    partner: dict[End, End] = field(default_factory=dict)
    place: dict[End, int] = field(default_factory=dict)
    meetings: list[Meeting] = field(default_factory=list)

    def link(self, one: End, other: End, place: int | None = None) -> None:
        """Make two ends one curve, at a special point if `place` is given."""
        self.partner[one], self.partner[other] = other, one
        if place is not None:
            self.place[one] = self.place[other] = place

    def note(self, meeting: Meeting) -> int:
        """Add a special point."""
        self.meetings.append(meeting)
        return len(self.meetings) - 1


class Vertices(NamedTuple):
    """Points along an arc or a curve; phi is continuous."""

    at: Array
    phi: Array
    label: npt.NDArray[np.integer[Any]]
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


@dataclass(frozen=True)
class Locus:
    """A curve in a plane of two parameters: both of them, the merged coordinate, and its type."""

    kind: str
    x: Array
    y: Array
    phi: Array
    closed: bool
    #: Of a fold the coefficient of its normal form.
    quadratic: Array
    #: Which equilibria merge, and on which side of A = 0 it lies, where there is an A.
    merging: str = ""
    sign_of_A: int = 0


@dataclass(frozen=True)
class Cusp:
    """A point where three equilibria merge; `like` is what they become."""

    x: float
    y: float
    phi: float
    like: str
    cubic: float = np.nan


class Columns(NamedTuple):
    """Equilibria at values of the parameter, a row each; arcs are columns."""

    phi: Array
    kind: Any
    energy: Array
    curvature: Array
    label: Any
    """Labels in the results of `equilibria`."""


class Sheets(Protocol):
    """All equilibria over a span of one parameter."""

    @property
    def span(self) -> tuple[float, float]:
        """First and last value."""

    @property
    def size(self) -> float:
        """What coordinates are measured in: a turn, or how far equilibria lie apart."""

    @property
    def circle(self) -> float | None:
        """Length of the circle; None on a line."""

    def solve(self, at: Array) -> Any:
        """Equilibria at values of the parameter: a NamedTuple of arrays, a row each."""

    def columns(self, interval: int, at: Array, points: Any) -> Columns:
        """Solved equilibria at rising values inside an interval, by the labels of its arcs."""

    def end(self, at: float, near: float, kind: int, label: int) -> Sequence[float]:
        """Phi, kind, energy and curvature where an arc ends that comes near to an angle."""

    def special(self, meeting: Meeting, kind: int) -> Sequence[float]:
        """The same where it ends in a special point."""


def curves(
    sheets: Sheets, limits: Sequence[float], labels: Sequence[Sequence[int]], joints: Joints
) -> list[Curve]:
    """All curves of equilibria, those that begin at the left end of the span first.

    Parameters
    ----------
    sheets : Sheets
    limits : sequence of float
        Ends of the span, and the events between them.
    labels : sequence of sequences of int
        Of the arcs in each interval.
    joints : Joints
        How arcs go on at the events; gets the ends of curves.
    """
    arcs: dict[tuple[int, int], Vertices] = {}
    for k, own in enumerate(labels):
        arcs.update(_arcs(sheets, (limits[k], limits[k + 1]), k, own, joints))
    return _walk(arcs, joints, sheets)


# ------------------------------------------------------------------------------ arcs


def places(limits: tuple[float, float], tau: Array) -> Array:
    """Values of the parameter between two events, the closer together the nearer to these."""
    low, high = limits
    left, right = np.sin(0.5 * np.pi * tau) ** 2, np.cos(0.5 * np.pi * tau) ** 2
    return np.where(tau < 0.5, low + (high - low) * left, high - (high - low) * right)


def _arcs(
    sheets: Sheets, limits: tuple[float, float], k: int, labels: Sequence[int], joints: Joints
) -> dict[tuple[int, int], Vertices]:
    """Sample the arcs of an interval so densely that they are smooth."""
    tau = np.arange(1, FIRST_SAMPLES) / FIRST_SAMPLES
    at = places(limits, tau)
    points = sheets.solve(at)
    width = sheets.span[1] - sheets.span[0]
    while True:
        columns = sheets.columns(k, at, points)
        arcs = {
            (k, label): _arc(sheets, at, columns, limits, End(k, label, 0), joints)
            for label in labels
        }
        if tau.size > MOST_SAMPLES:
            return {key: _present(arc) for key, arc in arcs.items()}
        rough = np.zeros(tau.size + 1, bool)  # the chords
        for arc in arcs.values():
            phi = arc.phi / sheets.size
            if sheets.circle is None:  # what goes to infinity is not followed further
                phi = np.clip(phi, -1.0, 1.0)
            bent = _off_the_chord(arc.at / width, phi) > SMOOTH
            rough[:-1] |= bent
            rough[1:] |= bent
            rough |= np.abs(np.diff(phi)) > LONGEST
        cut = np.flatnonzero(rough)
        grid = np.concatenate([[0.0], tau, [1.0]])
        fine = 0.5 * (grid[cut] + grid[cut + 1])
        # Between neighboring doubles there is nothing to see.
        ends_at, more_at = np.concatenate([limits[:1], at, limits[1:]]), places(limits, fine)
        new = (more_at != ends_at[cut]) & (more_at != ends_at[cut + 1])
        if not new.any():
            return {key: _present(arc) for key, arc in arcs.items()}
        fine, more_at = fine[new], more_at[new]
        more = sheets.solve(more_at)
        order = np.argsort(np.concatenate([tau, fine]))
        tau, at = (np.concatenate(pair)[order] for pair in ((tau, fine), (at, more_at)))
        points = joined(points, more, order)


def joined(points: Any, more: Any, order: Any) -> Any:
    """Rows of two NamedTuples of arrays as those of one; the wider one sets how many columns."""
    fields = []
    for one, other in zip(points, more, strict=True):
        both = [one, other]
        if one.ndim > 1 and one.shape[1] != other.shape[1]:
            widest = max(one.shape[1], other.shape[1])
            empty = np.nan if one.dtype.kind == "f" else 0
            both = [
                np.pad(x, [(0, 0), (0, widest - x.shape[1])], constant_values=empty) for x in both
            ]
        fields.append(np.concatenate(both)[order])
    return type(points)._make(fields)


def _arc(
    sheets: Sheets,
    at: Array,
    columns: Columns,
    limits: tuple[float, float],
    near: End,
    joints: Joints,
) -> Vertices:
    """One label's vertices from end to end."""
    own: list[Array] = [np.asarray(x[:, near.label], float) for x in columns]
    there = np.flatnonzero(np.isfinite(own[0]))
    ends = []
    for end in (near, near.far):
        inner = there[0 if end.side == 0 else -1] if there.size else None
        phi, kind = (own[i][inner] if inner is not None else 0.0 for i in (0, 1))
        if end in joints.place:
            vertex = sheets.special(joints.meetings[joints.place[end]], int(kind))
        else:
            vertex = sheets.end(limits[end.side], float(phi), int(kind), near.label)
        number = own[4][inner] if inner is not None else near.label
        ends.append((*vertex, float(number)))
    phi, kinds, energy, curvature, label = (
        np.concatenate([[a], column, [b]])
        for a, column, b in zip(ends[0], own, ends[1], strict=True)
    )
    whole = np.concatenate([limits[:1], at, limits[1:]])
    present = np.isfinite(phi)
    phi[present] = _unwrapped(phi[present], sheets.circle)
    return Vertices(whole, phi, label.astype(np.int16), kinds.astype(np.int8), energy, curvature)


def _unwrapped(phi: Array, circle: float | None) -> Array:
    return phi if circle is None else np.unwrap(phi, period=circle)


def _off_the_chord(x: Array, y: Array) -> Array:
    """Distance of each inner vertex from the chord of its neighbors."""
    dx, dy, ex, ey = x[2:] - x[:-2], y[2:] - y[:-2], x[1:-1] - x[:-2], y[1:-1] - y[:-2]
    with np.errstate(invalid="ignore", divide="ignore"):
        return np.nan_to_num(np.abs(dx * ey - dy * ex) / np.hypot(dx, dy))


def _present(arc: Vertices) -> Vertices:
    """Leave out vertices so close to an event that rounding has it on their other side."""
    return arc.pick(np.isfinite(arc.phi))


# ------------------------------------------------------------------------------ curves


def _walk(arcs: dict[tuple[int, int], Vertices], joints: Joints, sheets: Sheets) -> list[Curve]:
    """Follow links from arc to arc until each arc lies on one curve."""
    every = [End(*key, side) for side in (0, 1) for key in arcs]
    open_ends = [end for end in every if end not in joints.partner]
    left = set(arcs)
    found = []
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
        vertices = _in_one(pieces, sheets.circle)
        if end is None:  # the curve ends where the span does, unless something ends it before
            for i, last in ((0, start), (-1, _last(start, joints))):
                if last not in joints.place:
                    phi = wrapped(float(vertices.phi[i]), sheets.circle)
                    place = joints.note(Meeting(float(vertices.at[i]), phi, "end"))
                    meetings.insert(0 if i == 0 else len(meetings), place)
        found.append(Curve(vertices, tuple(dict.fromkeys(meetings)), closed=end is not None))
    seen = {place for curve in found for place in curve.meetings}
    for place, meeting in enumerate(joints.meetings):
        if place not in seen:  # a pair that exists at one value only
            phi, kind, energy, curvature = sheets.special(meeting, 0)
            columns = [[meeting.at], [phi], [LONE], [kind], [energy], [curvature]]
            found.append(Curve(Vertices(*map(np.array, columns)), (place,)))
    return found


def _last(start: End, joints: Joints) -> End:
    """The last end of the open curve that begins at `start`."""
    end = start.far
    while end in joints.partner:
        end = joints.partner[end].far
    return end


def _directed(arc: Vertices, side: int) -> Vertices:
    return arc if side == 0 else arc.pick(slice(None, None, -1))


def _in_one(pieces: list[Vertices], circle: float | None) -> Vertices:
    """Join arcs that share their end points; phi runs on."""
    whole = [pieces[0]]
    for piece in pieces[1:]:
        shared = piece.at[0] == whole[-1].at[-1]
        whole.append(piece.pick(slice(int(shared), None)))
    columns = [np.concatenate(parts) for parts in zip(*whole, strict=True)]
    columns[1] = _unwrapped(columns[1], circle)
    return Vertices(*columns)


def wrapped(phi: float, circle: float | None) -> float:
    """A coordinate in its turn, half of which lies to either side of 0."""
    return phi if circle is None else float(0.5 * circle - (0.5 * circle - phi) % circle)
