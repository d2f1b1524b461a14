"""Curves of equilibria along one parameter: columns of a map joined into strands, folds located.

Arrays only. The columns hold the four slots lower_center, lower_saddle, upper_center, upper_saddle.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from phasekit.arrays import Array
from phasekit.errors import EquilibriumKind

CENTERS, SADDLES = (0, 2), (1, 3)
# A jump by more than this from one column to the next (rad) is not one equilibrium that moved.
LONGEST_STEP = 1.2
# Three merge at once only where the outer two lie symmetrically about the middle one, which holds
# to rounding or not at all.
SYMMETRIC = 1e-9
TIP_SAMPLES = 24


@dataclass
class Strand:
    """One equilibrium followed along the parameter; `phi` is continuous, not wrapped."""

    kind: EquilibriumKind
    x: list[float] = field(default_factory=list)
    phi: list[float] = field(default_factory=list)
    y: list[float] = field(default_factory=list)

    def append(self, x: float, phi: float, y: float) -> None:
        """Add a point, with the turn of phi that lies nearest to the point before."""
        if self.phi:
            phi = self.phi[-1] + circle_gap(phi, self.phi[-1])
        self.x.append(x)
        self.phi.append(phi)
        self.y.append(y)


@dataclass(frozen=True)
class Merger:
    """A point where equilibria meet: two at a fold, three at a pitchfork."""

    x: float
    phi: float
    y: float
    name: str


@dataclass(frozen=True)
class Columns:
    """What is known at each value of the parameter."""

    #: Parameter, monotone, shape (n,).
    x: Array
    #: Angle (rad), kind, and the quantity to draw, shape (n, 4).
    phi: Array
    kind: NDArray[np.int8]
    y: Array
    #: fold_margin, shape (n,); NaN where it is not known.
    margin: Array
    #: Whether `y` is a root of the curvature, which exists for one kind and is 0 at a merger.
    vanishing: bool = False

    def merged(self, i: int) -> bool:
        """Whether column `i` lies on a fold."""
        return bool(self.kind[i, 1] == EquilibriumKind.DEGENERATE)

    def slots(self, i: int) -> list[int]:
        """Return the slots that hold an equilibrium of one branch; a merged pair is none."""
        return [
            s for s in range(4) if np.isfinite(self.phi[i, s]) and not (s == 1 and self.merged(i))
        ]

    def zero(self, full: int, bare: int) -> float | None:
        """Return the parameter between two columns at which the fold margin vanishes."""
        if self.merged(bare):
            return float(self.x[bare])
        inside, outside = relative_gap(self.margin[[full, bare]])
        if not inside > 0.0 >= outside:
            return None
        share = inside / (inside - outside)
        return float(self.x[full] + (self.x[bare] - self.x[full]) * share)

    def middle(self, i: int, one: int, other: int) -> tuple[float, float]:
        """Return phi and y half-way between two slots."""
        half = 0.5 * circle_gap(self.phi[i, one], self.phi[i, other])
        return float(self.phi[i, other]) + half, 0.5 * float(self.y[i, one] + self.y[i, other])

    def axis_of_symmetry(self, i: int, center: int, saddle: int) -> int | None:
        """Return which of the two lies half-way between the two of the other type, if one does."""
        for inner, outer in ((saddle, CENTERS), (center, SADDLES)):
            left, right = (circle_gap(self.phi[i, s], self.phi[i, inner]) for s in outer)
            if abs(left + right) <= SYMMETRIC * abs(left - right):
                return inner
        return None


def trace(columns: Columns) -> tuple[list[Strand], list[Merger]]:
    """Join columns of equilibria into strands, and find where strands end in each other."""
    strands: list[Strand] = []
    mergers: list[Merger] = []
    running: dict[int, Strand] = {}
    for i in range(columns.x.size):
        source = {new: old for old, new in _links(columns, i).items()} if i else {}
        following: dict[int, Strand] = {}
        for slot in columns.slots(i):
            if source.get(slot) in running:
                following[slot] = running[source[slot]]
            else:
                following[slot] = Strand(_kind_of(slot))
                strands.append(following[slot])
        if i:
            mergers += _merge(columns, i, running, following)
        for slot, strand in following.items():
            strand.append(columns.x[i], columns.phi[i, slot], columns.y[i, slot])
        running = following
    return strands, mergers


def relative_gap(margin: Array) -> Array:
    """Turn fold_margin = 1 - L/|A| into |A|/L - 1, which has the same zero and no pole at A = 0."""
    with np.errstate(all="ignore"):
        # Rounding may carry the margin past 1.
        gap = 1.0 / np.maximum(1.0 - margin, 0.0) - 1.0
    return np.clip(gap, -1.0, 1.0)


def circle_gap(a: float, b: float) -> float:
    """Return a - b on the circle, in [-pi, pi)."""
    return float((a - b + np.pi) % (2.0 * np.pi) - np.pi)


def _kind_of(slot: int) -> EquilibriumKind:
    return EquilibriumKind.CENTER if slot in CENTERS else EquilibriumKind.SADDLE


def _links(columns: Columns, i: int) -> dict[int, int]:
    """Match slots of columns i - 1 and i: by label, unless another match is clearly nearer.

    A label leaves its branch where B or C changes sign between the columns.
    """
    was, there = columns.slots(i - 1), columns.slots(i)

    def step(old: int, new: int) -> float:
        return abs(circle_gap(columns.phi[i, new], columns.phi[i - 1, old]))

    links: dict[int, int] = {}
    for pair in (CENTERS, SADDLES):
        straight = [(s, s) for s in pair if s in was and s in there]
        crossed = [(a, b) for a, b in (pair, pair[::-1]) if a in was and b in there]
        choice = straight
        if len(crossed) >= len(straight):
            lengths = [sum(step(*link) for link in links_) for links_ in (straight, crossed)]
            if not straight or lengths[1] < 0.5 * lengths[0]:
                choice = crossed
        links |= {old: new for old, new in choice if step(old, new) < LONGEST_STEP}
    return links


def _merge(
    columns: Columns, i: int, running: dict[int, Strand], following: dict[int, Strand]
) -> list[Merger]:
    """Close the pair that ends or begins between columns i - 1 and i; extend its strands."""
    ending = len(running) > len(following)
    full, bare = (i - 1, i) if ending else (i, i - 1)
    strands, others = (running, following) if ending else (following, running)
    lone = [s for s, strand in strands.items() if all(strand is not o for o in others.values())]
    if (len(strands), len(others), len(lone)) != (4, 2, 2) or sum(lone) % 2 == 0:
        return []
    where = columns.zero(full, bare)
    if where is None:
        return []
    center, saddle = sorted(lone, key=lambda slot: slot % 2)
    inner = columns.axis_of_symmetry(full, center, saddle)
    if inner is None:
        name = "fold"
        family: tuple[int, ...] = (center, saddle)
        middle = columns.middle(full, center, saddle)
        phi, y = _fold_point(columns, full, bare, where, center, saddle)
    else:
        name = "pitchfork"
        family = (inner, *(CENTERS if inner in SADDLES else SADDLES))
        middle = phi, y = float(columns.phi[full, inner]), float(columns.y[full, inner])
    for slot in family:
        points = []
        # Equilibria meet on a parabola: their distance shrinks like the root of that of x.
        for s in np.linspace(1.0, 0.0, TIP_SAMPLES + 1)[1:]:
            apart = circle_gap(columns.phi[full, slot], middle[0])
            at = where + s * s * (columns.x[full] - where)
            angle = phi + s * s * circle_gap(middle[0], phi) + s * apart
            if columns.vanishing:
                height = np.sqrt(s) * columns.y[full, slot]
            else:
                height = y + s * s * (middle[1] - y) + s * (columns.y[full, slot] - middle[1])
            points.append((float(at), float(angle), float(height)))
        for point in points if ending else points[::-1]:
            strands[slot].append(*point)
    if columns.vanishing:
        y = 0.0
    wrapped = float(np.pi - (np.pi - phi) % (2.0 * np.pi))
    return [Merger(where, wrapped, y, name)]


def _fold_point(
    columns: Columns, full: int, bare: int, where: float, center: int, saddle: int
) -> tuple[float, float]:
    """Return phi and y at a fold: as given if a column lies on it, else by extrapolation."""
    if columns.merged(bare):
        return float(columns.phi[bare, 1]), float(columns.y[bare, 1])
    phi, y = columns.middle(full, center, saddle)
    before = 2 * full - bare
    if 0 <= before < columns.x.size and {center, saddle} <= set(columns.slots(before)):
        # The middle of the pair moves linearly as the two approach each other.
        last = columns.middle(before, center, saddle)
        reach = float((where - columns.x[full]) / (columns.x[full] - columns.x[before]))
        phi, y = phi + reach * circle_gap(phi, last[0]), y + reach * (y - last[1])
    return phi, y
