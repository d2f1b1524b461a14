"""Bifurcation sets of a potential in a plane of two parameters, as ordered curves.

Fold curves are traced in the space of both parameters and the coordinate, where they are smooth,
through their cusps. Where an equilibrium rests in the whole plane, others cross it on curves
V'' = 0. Curves of equal energies are those of two saddles, or two centers, next to each other.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable, Iterator
from typing import Any

import numpy as np

from phasekit.arrays import Array, Ints
from phasekit.bifurcation.curves import Cusp, Locus
from phasekit.bifurcation.numerical.plane import Plane
from phasekit.bifurcation.regions import components, depths
from phasekit.errors import EquilibriumKind
from phasekit.numerics.tracing import LONGEST, Trace, new_curve, solve

#: Nodes of the grid a side on which energies are compared, and cells of that which tells regions.
NODES, CELLS = 25, 160


def loci(plane: Plane) -> tuple[list[Locus], list[Cusp], str]:
    """All curves of a plane, the cusps of its fold curves, and why there may be others."""
    cusps, first = plane.triple((3, 0, 0))
    turns, second = plane.triple((1, 0, 1))
    missing = [*(why for _, _, why in plane.found_on_edges if why), first, second, plane.hidden]
    pieces = _folds(plane, cusps, turns)
    for point in plane.resting:
        kind = "pitchfork" if point.even else "transcritical"
        found, complete = _crossings(plane, point.x, point.middle, 2, kind)
        pieces += found
        missing += [] if complete else [f"points where curves of {kind}s meet are not decided"]
    for end in plane.formula.interval or ():
        found, complete = _crossings(plane, end, end, 1, "window_exit")
        pieces += found
        missing += [] if complete else ["points where equilibria leave are not decided"]
    pieces += _levels(plane, cusps)
    return pieces, [_cusp(plane, z) for z in cusps], next(filter(None, missing), "")


# ------------------------------------------------------------------------- folds


def _folds(plane: Plane, cusps: list[Array], turns: list[Array]) -> list[Locus]:
    corners = np.sort([z[2] + turn for z in cusps for turn in range(-4, 5)])
    circle = plane.formula.period is not None
    curves: list[Trace] = []
    starts: list[tuple[Array, tuple[int, float] | None]] = [(z, None) for z in [*turns, *cusps]]
    for where, found, _ in plane.found_on_edges:
        starts += [(_on_edge(plane, where, m.at, m.x), where) for m in found if m.kind == "fold"]

    def apart(z: Array) -> bool:
        """Whether a point is off all equilibria that rest: there another curve begins."""
        width = 1e-6 * plane.size
        for point in plane.resting:
            way = abs(plane.size * z[2] - point.middle)
            way = abs(way - plane.size * round(way / plane.size)) if circle else way
            if way < width:
                return False
        return True

    for z, edge in starts:
        start = z if edge is None else solve(plane.fold, z, *edge)
        if start is not None and apart(start):
            new_curve(curves, plane.fold, start, z, corners, apart)
    pieces = []
    for curve in curves:
        x, y = plane.parameters(curve.vertices).T
        phi = plane.size * curve.vertices[:, 2]
        quadratic = np.array([
            -0.5 * plane.jet(z, at)[3, 0, 0] for z, at in zip(curve.vertices, phi, strict=True)
        ])  # fmt: skip
        quadratic[np.isin(curve.vertices[:, 2], corners)] = 0.0
        pieces.append(Locus("fold", x, y, phi, curve.closed, quadratic, "center saddle"))
    return pieces


def _on_edge(plane: Plane, where: tuple[int, float], value: float, x: float) -> Array:
    """A point of an edge in units of the plane."""
    z = np.empty(3)
    z[where[0]], z[1 - where[0]] = where[1], plane.unit(value, 1 - where[0])
    z[2] = x / plane.size
    return z


def _cusp(plane: Plane, z: Array) -> Cusp:
    x, y = plane.parameters(z)
    phi = plane.size * z[2]
    cubic = -plane.jet(z, phi)[4, 0, 0] / 6.0
    if plane.formula.period is not None:
        phi = 0.5 * plane.size - (0.5 * plane.size - phi) % plane.size
    return Cusp(float(x), float(y), float(phi), "center" if cubic < 0.0 else "saddle", cubic)


# ------------------------------------------------------------------------- at one coordinate


def _crossings(plane: Plane, x: Any, phi: float, order: int, kind: str) -> tuple[list[Locus], bool]:
    """Curves on which V' or V'' vanishes at a coordinate, and whether these are all."""
    equation, curves = plane.vanishing(phi, order), list[Trace]()
    starts, complete = plane.extremes(x, order)
    name = "exit" if order == 1 else kind
    for (i, u), found, _ in plane.found_on_edges:
        for m in found:
            if m.kind == name and abs(m.x - phi) <= 1e-9 * plane.size:
                point = solve(equation, _on_edge(plane, (i, u), m.at, m.x)[:2], i, u)
                starts += [] if point is None else [point]
    pieces = []
    for start in starts:
        new_curve(curves, equation, start, start)
    for curve in curves:
        px, py = plane.parameters(curve.vertices).T
        nothing, at = np.full(px.shape, np.nan), np.full(px.shape, phi)
        pieces.append(Locus(kind, px, py, at, curve.closed, nothing))
    return pieces, complete


# ------------------------------------------------------------------------- equal energies


def _levels(plane: Plane, cusps: list[Array]) -> list[Locus]:
    """Curves on which two saddles, or two centers, that are next to each other have one energy.

    They end where both merge, in cusps, next to which they are not to be traced.
    """
    pieces: list[Locus] = []
    for kind, name in (
        (EquilibriumKind.SADDLE, "equal_saddles"), (EquilibriumKind.CENTER, "equal_centers"),
    ):  # fmt: skip
        curves: list[Trace] = []
        inside = _both(plane, 1.0 if kind == EquilibriumKind.CENTER else -1.0)
        for z, i, u in _level_starts(plane, kind):
            start = solve(plane.level, z, i, u)
            if start is not None and inside(start) and np.abs(start - z).max() < 0.1:
                new_curve(curves, plane.level, start, start, None, inside)
        shown: list[Trace] = []
        for curve in curves:  # by symmetry several may be one in the plane
            flat = Trace(_to_cusps(curve.vertices[:, :2], cusps), curve.closed)
            if not any(_same(flat, other) for other in shown):
                shown.append(flat)
                x, y = plane.parameters(flat.vertices).T
                nothing = np.full(x.shape, np.nan)
                pieces.append(Locus(name, x, y, nothing, curve.closed, nothing))
    return pieces


def _to_cusps(points: Array, cusps: list[Array]) -> Array:
    """A curve up to the cusps next to its ends."""
    ends = []
    for end in (points[0], points[-1]):
        near = [z[:2] for z in cusps if np.abs(z[:2] - end).max() < LONGEST]
        ends.append(np.array(near[:1]).reshape(-1, 2))
    return np.concatenate([ends[0], points, ends[1]])


def _same(one: Trace, other: Trace) -> bool:
    """Whether all of a curve lies next to another one."""
    away = np.abs(one.vertices[:, None] - other.vertices).max(axis=2)
    return bool(away.min(axis=1).max() < LONGEST)


def _both(plane: Plane, sign: float) -> Callable[[Array], bool]:
    """Whether both equilibria of a point are of a kind, and apart, in their order."""

    def inside(z: Array) -> bool:
        bends = [sign * plane.jet(z, plane.size * w)[2, 0, 0] for w in z[2:]]
        return min(bends) > 0.0 and bool(1e-6 < z[3] - z[2] < 1.0 - 1e-6)

    return inside


def _level_starts(plane: Plane, kind: int) -> Iterator[tuple[Array, int, float]]:
    """Points near such curves on edges of a grid, where a difference of energies changes sign."""
    inner = np.arange(NODES - 2)
    # Not at places that symmetry prefers.
    ticks = np.concatenate([[0.0], (inner + 0.5 + 0.1 * np.sin(inner)) / inner.size, [1.0]])
    grid = np.stack(np.meshgrid(ticks, ticks, indexing="ij"), axis=-1)
    points = plane.equilibria(grid.reshape(-1, 2))
    shape, width = (NODES, NODES), points.phi.shape[1]
    least = 4 if plane.formula.period is not None else 3
    if width < least:
        return
    fields = [f.reshape((*shape, width)) for f in (points.phi, points.kind, points.energy)]
    number = points.n_equilibria.reshape(shape)
    for axis in (0, 1):
        firsts = itertools.product(*(range(NODES - (axis == i)) for i in (0, 1)))
        for node in firsts:
            other = (node[0] + (axis == 0), node[1] + (axis == 1))
            n = int(number[node])
            if n < least or number[other] != n:
                continue
            here, there = ([f[at][:n] for f in fields] for at in (node, other))
            turned = _turned(plane, here[0], there[0])
            there = [f[turned] for f in there]
            reach = n if plane.formula.period is not None else n - 2
            for j in range(reach):
                k = (j + 2) % n
                if here[1][j] != kind or here[1][k] != kind or there[1][j] != kind or j == k:
                    continue
                rise = [f[2][k] - f[2][j] for f in (here, there)]
                size = 1e-12 * (np.abs(here[2]).max() + np.abs(there[2]).max())
                if rise[0] * rise[1] < 0.0 and min(map(abs, rise)) > size:
                    part = rise[0] / (rise[0] - rise[1])
                    z = np.empty(4)
                    z[:2] = grid[node] + part * (grid[other] - grid[node])
                    phi = here[0] + part * (_near(plane, there[0], here[0]) - here[0])
                    z[2:] = phi[[j, k]] / plane.size
                    z[3] += z[3] < z[2]  # on a circle the first one comes after the last one
                    yield z, 1 - axis, float(z[1 - axis])


def _near(plane: Plane, x: Array, to: Array) -> Array:
    period = plane.formula.period
    return x if period is None else x - period * np.round((x - to) / period)


def _turned(plane: Plane, here: Array, there: Array) -> Ints:
    """The order in which equilibria at one node are those at the next one."""
    n = here.size
    if plane.formula.period is None:
        return np.arange(n)
    orders = (np.arange(n)[:, None] + np.arange(n)) % n
    away = [np.abs(_near(plane, there[order], here) - here).sum() for order in orders]
    return np.asarray(orders[int(np.argmin(away))])


# ------------------------------------------------------------------------- regions


def regions(plane: Plane, pieces: list[Locus]) -> list[tuple[float, float, int, float]]:
    """A point well inside each region between the curves at which the number changes.

    Rows are x, y, number and the distance from the border in units of the plane; regions that are
    thinner than a cell of the grid on which they are told apart may be missing.
    """
    borders = ("fold", "pitchfork", "window_exit")
    crossed = np.zeros((CELLS, CELLS), bool)
    for piece in pieces:
        if piece.kind in borders:
            points = np.stack([
                np.array([plane.unit(v, i) for v in values])
                for i, values in enumerate((piece.x, piece.y))
            ], axis=1)  # fmt: skip
            for a, b in itertools.pairwise(points):
                many = int(np.ceil(4.0 * CELLS * np.abs(b - a).max())) + 1
                cells = np.floor(CELLS * (a + np.linspace(0.0, 1.0, many)[:, None] * (b - a)))
                i, j = np.clip(cells.astype(int), 0, CELLS - 1).T
                crossed[i, j] = True
    codes = np.where(crossed, np.arange(1, CELLS * CELLS + 1).reshape(CELLS, CELLS), 0)
    labels = components(codes)
    depth = depths(labels, ~crossed)
    inside = np.unique(labels[~crossed & (depth > 0)])
    best = np.array([int(np.where(labels == label, depth, -1).argmax()) for label in inside], int)
    at = (np.stack(np.unravel_index(best, labels.shape), axis=1) + 0.5) / CELLS
    number = plane.equilibria(at).n_equilibria if best.size else np.empty(0, int)
    x, y = plane.parameters(at).T if best.size else np.empty((2, 0))
    reach = depth.flat[best] / CELLS
    return list(zip(x.tolist(), y.tolist(), map(int, number), reach.tolist(), strict=True))
