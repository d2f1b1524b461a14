"""Separatrices under a constant torque N, where the energy is ``phi'^2/2 + V(phi) - N phi``.

Each turn forward gains 2 pi N, so that no loop winds: on the side where the potential rises the
separatrix of each saddle turns back, on the other it may run away. Seen from the saddle, at
theta = phi - phi_s, the height left to its energy is

``[k^2 - (A/2) (c cos 2 phi_s + sin theta sin 2 phi_s)] c + N (theta - sin theta)``,
``c = 1 - cos theta``,

which cancels neither next to the saddle nor next to a fold.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from phasekit.errors import EquilibriumKind, Loop, Topology
from phasekit.laws.perturbed import PerturbedTrigonometric
from phasekit.perturbation.torque import equilibria_under, torqued_equilibria
from phasekit.phase.exact.equilibria import Equilibria
from phasekit.phase.exact.orbits import energy_rises
from phasekit.phase.exact.potential import gradient
from phasekit.phase.exact.separatrices import separatrices

Array = npt.NDArray[np.float64]

TURN = 2.0 * np.pi
HALVINGS = 64
#: Gauss's rules whose difference is the error, and panels that are finer towards a saddle.
RULES = tuple(np.polynomial.legendre.leggauss(n) for n in (12, 16))
EDGES = np.append(0.0, 0.5 ** np.arange(14, -1, -1))
#: Taylor's coefficients of (sin x - x)/x^3 by x^2.
EXCESS = [(-1.0) ** (n + 1) / math.factorial(2 * n + 3) for n in range(9)]
#: Cells at a time, for memory.
CELLS = 1024


class Tilted(NamedTuple):
    """Separatrices under a torque; the last axes are saddle (lower, upper) and side."""

    topology: npt.NDArray[np.int8]
    figure_eight: npt.NDArray[np.bool_]
    saddle_phi: Array
    saddle_energy: Array
    saddle_exponent: Array
    loop: npt.NDArray[np.int8]
    winding_area: Array
    turning_offset: Array
    turning_phi: Array
    lobe_area: Array
    winding_area_error: Array
    lobe_area_error: Array
    energy_per_turn: Array


class Saddle(NamedTuple):
    """A saddle, and the potential as it is seen from there; fields broadcast."""

    phi: Array
    square: Array
    """k^2."""
    level: Array
    """(A/2) cos 2 phi_s."""
    slope: Array
    """(A/2) sin 2 phi_s."""
    torque: Array

    def spread(self) -> Saddle:
        """With one more axis at the end."""
        return Saddle._make(x[..., None] for x in self)

    def depth(self, theta: Any) -> Array:
        """Energy of the saddle less the potential at an angle from it."""
        c = 2.0 * np.sin(0.5 * theta) ** 2
        bend = self.square - self.level * c - self.slope * np.sin(theta)
        return np.asarray(bend * c - self.torque * sine_excess(theta))


def saddle_at(A: Any, phi: Any, k: Any, torque: Any) -> Saddle:
    """The saddle of an angle and an exponent."""
    level, slope = (0.5 * A * f(2.0 * phi) for f in (np.cos, np.sin))
    return Saddle(*np.broadcast_arrays(phi, k * k, level, slope, torque))


def sine_excess(x: Any) -> Array:
    """Sin x - x, by its series where that cancels.

    >>> abs(float(sine_excess(1e-5)) / (-1e-15 / 6 + 1e-25 / 120) - 1.0) < 1e-15
    True
    """
    x = np.asarray(x, float)
    small = np.abs(x) < 1.0
    square = np.where(small, x * x, 0.0)
    total = np.full(x.shape, EXCESS[-1])
    for coefficient in EXCESS[-2::-1]:
        total *= square
        total += coefficient
    total *= square * x
    return np.asarray(np.where(small, total, np.sin(x) - x))


def tilted_separatrices(law: PerturbedTrigonometric, *parameters: npt.ArrayLike) -> Tilted:
    """Separatrices of the potential that a constant torque tilts."""
    return tilted(law, *parameters)[1]


def tilted_phase_space(
    law: PerturbedTrigonometric, *parameters: npt.ArrayLike
) -> tuple[Equilibria, Tilted]:
    """Equilibria and separatrices under a torque."""
    return tilted(law, *parameters)


def tilted_cells(A: Array, B: Array, C: Array, N: Array) -> tuple[Equilibria, Tilted]:
    """Equilibria and separatrices of cells in a row, each under a torque."""
    points = equilibria_under(A, B, C, N)
    found = [
        _of_cells(A[i], B[i], C[i], N[i], Equilibria._make(x[i] for x in points))
        for i in (slice(j, j + CELLS) for j in range(0, len(A), CELLS))
    ]
    return points, Tilted._make(np.concatenate(parts) for parts in zip(*found, strict=True))


def tilted(law: PerturbedTrigonometric, *parameters: npt.ArrayLike) -> tuple[Equilibria, Tilted]:
    """Equilibria and separatrices under a torque; without one as in closed form."""
    points = torqued_equilibria(law, *parameters)
    values = law.values(*parameters)
    shape = points.n_equilibria.shape
    coefficients = law.coefficients(values)
    A, B, C, N = (
        np.array(np.broadcast_to(x, shape), float).reshape(-1)
        for x in (*coefficients, values["torque"])
    )
    level = separatrices(A, B, C)
    nothing = np.zeros_like(level.lobe_area)
    error = np.where(np.isnan(level.lobe_area), np.nan, nothing)
    winding = np.where(np.isnan(level.winding_area), np.nan, 0.0)
    fields: list[Any] = [np.array(x) for x in (*level, winding, error, TURN * N)]
    cells = np.flatnonzero((N != 0.0) | np.isnan(N))
    if cells.size:
        found = tilted_cells(A[cells], B[cells], C[cells], N[cells])[1]
        for field, one in zip(fields, found, strict=True):
            field[cells] = one
    return points, Tilted._make(x.reshape(shape + x.shape[1:]) for x in fields)


def _of_cells(A: Array, B: Array, C: Array, N: Array, points: Equilibria) -> tuple[Any, ...]:
    """The fields of cells in a row, each under a torque."""
    there = points.kind[:, 1::2] == EquilibriumKind.SADDLE
    phi, energy, k = (
        np.where(there, x[:, 1::2], np.nan) for x in (points.phi, points.energy, points.exponent)
    )
    saddle = saddle_at(A[:, None], phi, k, N[:, None])
    offset = np.full((*phi.shape, 2), np.nan)
    area, error, joins = offset.copy(), offset.copy(), np.zeros(offset.shape, bool)
    for side, way in enumerate((-1.0, 1.0)):
        marks = marks_of(points.phi, phi, way)
        fall = falls(saddle, (A, B, C, N), marks, way)
        offset[..., side], joins[..., side] = turning(saddle, (A, B, C, N), marks, fall, way)
        area[..., side], error[..., side] = lobe(saddle, marks, offset[..., side], way)
    closed = np.isfinite(offset)
    loop = np.select(
        [~there, joins.any(-1), closed.all(-1), closed.any(-1)],
        [Loop.ABSENT, Loop.HETEROCLINIC, Loop.LOBES, Loop.LOBE],
        Loop.UNBOUNDED,
    ).astype(np.int8)  # fmt: skip
    eight = (loop == Loop.LOBES).any(-1)
    topology = np.select(
        [points.n_equilibria < 0, joins.any((-1, -2)), eight, there.any(-1)],
        [Topology.NOT_COMPUTED, Topology.HETEROCLINIC, Topology.FIGURE_EIGHT, Topology.HOMOCLINIC],
        Topology.NONE,
    ).astype(np.int8)
    away = there[..., None] & ~closed
    offset = np.where(away, np.array([-np.inf, np.inf]), offset)
    at = phi[..., None] + np.where(away, np.nan, offset)
    at = np.pi - np.mod(np.pi - at, TURN)
    lost = np.full(phi.shape, np.nan)
    return (
        topology, eight, phi, energy, k, loop, lost, offset, np.where(away, offset, at),
        np.where(away, np.inf, area), lost, np.where(away, np.nan, error), TURN * N,
    )  # fmt: skip


def marks_of(phi: Array, saddle: Array, way: float) -> Array:
    """Distances from the saddles to the equilibria on one side: center, saddle, center, saddle.

    The last one is the next of the same saddle; infinite where there are no others.
    """
    own = np.arange(4) == np.array([[1], [3]])
    far = np.mod(way * (phi[:, None, :] - saddle[..., None]), TURN)
    far = np.where(own, TURN, np.where(np.isnan(far), np.inf, far))
    return np.sort(far, axis=-1)


def falls(
    saddle: Saddle, system: tuple[Array, ...], marks: Array, way: float
) -> tuple[Array, Array]:
    """Energy of each saddle less that of the other one next on a side; and what rounding hides.

    Under next to no torque the difference is that of no torque, which is known to its last digits,
    and what the torque N makes of it, ``d(h_i - h_j)/dN = phi_j - phi_i``.
    """
    A, B, C, N = (x[:, None] for x in system)
    two = np.isfinite(marks[..., 3])  # else it is the saddle's own next
    first = np.where(two, marks[..., 1], TURN)
    direct = saddle.depth(way * first)
    size = np.abs(A) + np.abs(B) + np.abs(C) + TURN * np.abs(N)
    hidden = 16.0 * 2.0**-52 * size
    level = separatrices(*system[:3])
    step = energy_rises(*system[:3])[:, 2, None] * np.array([-1.0, 1.0])  # of lower less upper
    apart = np.mod(way * (level.saddle_phi[:, ::-1] - level.saddle_phi), TURN)
    slope = 0.5 * (first + apart)
    near = step + way * N * slope
    with np.errstate(all="ignore"):
        least = np.min(np.minimum(saddle.square, level.saddle_exponent**2), axis=1, keepdims=True)
        bend = (N / least) ** 2
    terms = np.abs(step) + np.abs(N) * slope
    lost = terms * (16.0 * 2.0**-52 + bend) + np.abs(N) * np.abs(first - apart)
    good = two & (lost < hidden)
    return np.where(good, near, direct), np.where(good, lost, hidden)


def turning(
    saddle: Saddle, system: tuple[Array, ...], marks: Array, fall: tuple[Array, Array], way: float
) -> tuple[Array, Any]:
    """Signed angle to the turning point on one side, NaN where the separatrix runs away.

    Besides whether it is the other saddle, as high within rounding.
    """
    A, B, C, N = (x[:, None] for x in system)
    two = np.isfinite(marks[..., 3])  # else the second one is the saddle's next
    first = np.where(two, marks[..., 1], TURN)
    joins = two & (np.abs(fall[0]) <= fall[1])
    turns = fall[0] <= 0.0
    begin = np.where(turns, marks[..., 0], marks[..., 2])
    end = np.where(turns, first, TURN)
    found = (two & turns) | (way * N < 0.0)
    found &= np.isfinite(saddle.phi)
    low, high = np.where(found, begin, np.nan), np.where(found, end, np.nan)
    x = 0.5 * (low + high)
    for _ in range(HALVINGS):
        depth = saddle.depth(way * x)
        low, high = np.where(depth > 0.0, x, low), np.where(depth > 0.0, high, x)
        with np.errstate(all="ignore"):
            step = x + depth / (way * (gradient(A, B, C, saddle.phi + way * x) - N))
        before, x = x, np.where((step > low) & (step < high), step, 0.5 * (low + high))
        if not (np.abs(x - before) > 2.0**-52 * np.abs(x)).any():
            break
    return np.asarray(way * np.where(joins, first, x)), joins


def lobe(saddle: Saddle, marks: Array, offset: Array, way: float) -> tuple[Array, Array]:
    """Area of the loop on one side, and the error of its quadrature."""
    end = np.abs(offset)
    inner = end > marks[..., 1]  # the loop leads over a lower saddle
    legs = [
        (np.zeros(end.shape), marks[..., 0]),
        (np.where(inner, marks[..., 1], end), marks[..., 0]),
        (np.where(inner, marks[..., 1], np.nan), marks[..., 2]),
        (np.where(inner, end, np.nan), marks[..., 2]),
    ]
    whole = np.broadcast_arrays(*saddle, end)[:-1]
    sums = [np.where(np.isfinite(end), 0.0, np.nan) for _ in RULES]
    for start, stop in legs:
        there = np.isfinite(start + stop) & np.isfinite(end)
        seen = Saddle._make(x[there] for x in whole).spread()
        first, length = start[there][:, None], (stop - start)[there][:, None]
        for total, (nodes, weights) in zip(sums, RULES, strict=True):
            half = 0.5 * np.diff(EDGES)[:, None]
            x = (0.5 * (EDGES[1:] + EDGES[:-1])[:, None] + half * nodes).reshape(-1)
            w = (half * weights).reshape(-1) * 2.0 * x
            speed = np.sqrt(np.maximum(2.0 * seen.depth(way * (first + length * x * x)), 0.0))
            total[there] += 2.0 * np.abs(length[:, 0]) * (speed @ w)
    area = sums[1]
    return area, np.abs(area - sums[0]) + 8.0 * 2.0**-52 * area
