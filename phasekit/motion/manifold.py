"""One-dimensional invariant manifolds of equilibria of flows, followed by arclength."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np

from phasekit.arrays import Array
from phasekit.laws.equations import Equations
from phasekit.motion.crossings import Edges
from phasekit.motion.equation_rates import rates_on
from phasekit.motion.lost import ARRIVED, CROWDED, LEFT, RESTING
from phasekit.motion.paths import Path, distances, paths

#: Distance from the equilibrium at which a manifold begins, over the size of the window: the
#: straight line leaves it by the square of that.
NEAR = 1e-6
#: Distance from another equilibrium at which it is reached, over the size of the window.
REACHED = 1e-5
#: Greatest distance between points, over the size of the window.
CLOSE = 1.0 / 200.0
#: Distance from a cycle at which a motion has come to it, over the size of the window, and how many
#: of its periods a motion is followed further before that is asked.
ON_CYCLE, PERIODS = 1e-3, 30


class Start(NamedTuple):
    """Where half of a manifold begins."""

    rest: int
    """Number of the equilibrium."""
    direction: Array
    """An eigenvector, in widths of the window."""
    sense: float
    """1.0: forward in time (unstable manifold), -1.0: backward."""


class Strand(NamedTuple):
    """One half of a manifold."""

    x: Array
    """States, of shape (points, states); the equilibrium first."""
    arclength: Array
    """Length from the equilibrium, in widths of the window."""
    end: str
    """Why it ends: window, equilibrium, length or lost."""
    reached: int
    """Number of the equilibrium that it comes to; -1: of none."""


def strands(
    law: Equations,
    values: Mapping[str, float],
    starts: Sequence[Start],
    window: tuple[Array, Array],
    turns: Array,
    rests: Array,
    length: float,
    rtol: float,
) -> list[Strand]:
    """Follow halves of manifolds.

    A manifold ends where it leaves the window, of least and greatest states, at one of the rests,
    of shape (n, states), or at a length in widths of the window.
    """
    if not starts:
        return []
    low, high = window
    widths = np.where(turns > 0.0, turns, high - low)
    room = np.where(turns > 0.0, np.inf, 0.02 * widths)
    around, numbers = everywhere(rests, turns, length)
    begin, times = [], []
    for one in starts:
        unit = one.direction / np.linalg.norm(one.direction)
        begin.append(rests[one.rest] + NEAR * unit * widths)
        times.append([0.0, one.sense * np.inf])
    found = paths(
        law, values, np.array(begin), np.array(times), widths=widths, close=CLOSE, longest=length,
        edges=Edges.around(around, REACHED * widths, (low - room, high + room)), rtol=rtol,
        atol=1e-3 * rtol,
    )  # fmt: skip
    return [
        _strand(law, values, rests[one.rest], path, widths, numbers)
        for one, path in zip(starts, found, strict=True)
    ]


def everywhere(rests: Array, turns: Array, length: float) -> tuple[Array, list[int]]:
    """Equilibria, also whole turns further on, and their numbers."""
    found, numbers = rests.reshape(-1, len(turns)), list(range(len(rests)))
    for i in np.flatnonzero(turns > 0.0):
        step = np.where(np.arange(len(turns)) == i, turns, 0.0)
        most = int(min(np.ceil(length) + 1, 50))
        shifts = range(-most, most + 1)
        found = np.concatenate([found + k * step for k in shifts])
        numbers = numbers * len(shifts)
    return found, numbers


def _strand(
    law: Equations, values: Mapping[str, float], rest: Array, path: Path, widths: Array,
    numbers: Sequence[int],
) -> Strand:  # fmt: skip
    end, reached = "lost", -1
    if path.status >= RESTING:
        end, reached = "equilibrium", numbers[path.status - RESTING]
    elif path.status == LEFT:
        end = "window"
    elif path.status in (ARRIVED, CROWDED):
        end = "length"
    lengths = _arclength(law, values, path, widths)
    x = np.vstack([rest, path.state])
    return Strand(x, np.concatenate([[0.0], NEAR + lengths]), end, reached)


def _arclength(law: Equations, values: Mapping[str, float], path: Path, widths: Array) -> Array:
    """Length along a path, of cubics through its states with the rates there."""
    x, t = path.state / widths, path.time
    v = rates_on(law, values, path.state) / widths
    step = np.diff(t)[:, None]
    change = np.diff(x, axis=0)
    total = np.zeros(len(step))
    at, weights = np.polynomial.legendre.leggauss(4)
    for s, weight in zip(0.5 * (at + 1.0), 0.5 * weights, strict=True):
        slope = 6.0 * s * (1.0 - s) * change
        slope = slope + step * ((1.0 - s) * (1.0 - 3.0 * s) * v[:-1] + s * (3.0 * s - 2.0) * v[1:])
        total += weight * np.linalg.norm(slope, axis=1)
    return np.concatenate([[0.0], np.cumsum(total)])


class Goal(NamedTuple):
    """Where a motion comes in the end: the number of an equilibrium or of a cycle, or -1."""

    rest: int
    cycle: int


def goals(
    law: Equations,
    values: Mapping[str, float],
    ends: Sequence[tuple[Array, float]],
    turns: Array,
    widths: Array,
    rests: Array,
    cycles: Sequence[tuple[Array, float]],
    rtol: float,
) -> list[Goal]:
    """Where motions come from states, forward (1.0) or backward in time (-1.0).

    Cycles are given by states close together and their periods. Motions are followed for some of
    the longest of these, or until they come to rest.
    """
    if not ends:
        return []
    around, numbers = everywhere(rests, turns, 2.0)
    span = PERIODS * max((period for _, period in cycles), default=np.inf)
    states = np.array([state for state, _ in ends])
    times = np.array([[0.0, sense * span] for _, sense in ends])
    found = paths(
        law, values, states, times, widths=widths, close=np.inf,
        edges=Edges.around(around, REACHED * widths), rtol=rtol, atol=1e-3 * rtol,
    )  # fmt: skip
    result = []
    for path in found:
        rest, cycle = -1, -1
        if path.status >= RESTING:
            rest = numbers[path.status - RESTING]
        elif path.status == ARRIVED and np.isfinite(path.state[-1]).all():
            last = path.state[-1:]
            away = [float(distances(last, curve, widths, turns)[0]) for curve, _ in cycles]
            if away and min(away) < ON_CYCLE:
                cycle = int(np.argmin(away))
        result.append(Goal(rest, cycle))
    return result
