"""Special points on curves of connecting orbits ([ChampneysKuznetsovSandstede1996]).

Each is where a number of the eigenvalues at the ends vanishes, or the part of the orbit's end along
the leading eigenvector, or that of the normal of its manifolds.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np

from phasekit.arrays import Array
from phasekit.bifurcation.special_points import look_for
from phasekit.cycles.adjoint import normal
from phasekit.cycles.connections import SOURCE, TARGET, ends_of, spectra
from phasekit.cycles.on_curves import OrbitTest
from phasekit.cycles.point import Point

CONNECTION = "connection"
ROUNDING = 1e-13  # of a normal, beside its size
REAL = 1e-9  # imaginary part, beside the size, of an eigenvalue that is real


def _leading(cycles: Any, point: Point) -> tuple[tuple[Any, Any], float] | None:
    """Eigenvalues by which it leaves and arrives, the leading ones first, and their size."""
    found = spectra(cycles, point.orbit)
    if found is None or not len(found.out) or not len(found.into):
        return None
    size = float(abs(found.out[0]) + abs(found.into[0]))
    return (found.out, found.into), size


def _complex(value: complex) -> bool:
    return abs(value.imag) > REAL * abs(value)


def _saddle(focus: bool) -> Callable[[Any, Point], float]:
    """The sum of the leading real parts, where none or one of them is of a pair."""

    def value(cycles: Any, point: Point) -> float:
        leading = _leading(cycles, point)
        if leading is None:
            return math.nan
        (out, into), size = leading
        if (_complex(out[0]) or _complex(into[0])) != focus:
            return math.nan
        return float(out[0].real + into[0].real) / size

    return value


def _double(side: int) -> Callable[[Any, Point], float]:
    """The square of the difference of the two leading eigenvalues, negative of a pair."""

    def value(cycles: Any, point: Point) -> float:
        leading = _leading(cycles, point)
        if leading is None or len(leading[0][side]) < 2:
            return math.nan
        gap = (leading[0][side][0] - leading[0][side][1]) / leading[1]
        return float((gap * gap).real)

    return value


def _divergent(side: int) -> Callable[[Any, Point], float]:
    """A pair's real parts and that of the other leading one, summed."""

    def value(cycles: Any, point: Point) -> float:
        leading = _leading(cycles, point)
        if leading is None:
            return math.nan
        own, others = leading[0][side], leading[0][1 - side]
        if len(own) < 2 or not _complex(own[0]):
            return math.nan
        return float(2.0 * own[0].real + others[0].real) / leading[1]

    return value


def _flip(side: int) -> Callable[[Any, Point], float]:
    """The part of the orbit's end along the leading eigenvector, where that is real."""

    def value(cycles: Any, point: Point) -> float:
        leading = _leading(cycles, point)
        ends, orbit = ends_of(cycles), point.orbit
        rests = ends.rests(cycles, orbit)
        if leading is None or rests is None:
            return math.nan
        own = leading[0][side]
        if len(own) < 2 or _complex(own[0]):
            return math.nan
        plane = ends.subspaces(rests)[side].plane
        values, vectors = np.linalg.eig(plane.T @ rests[side].A @ plane)
        k = int(np.argmin(np.abs(values.real)))
        sign = _sign(plane @ vectors[:, k].real)
        x = orbit.x[0] if side == SOURCE else orbit.x[-1]
        z = plane.T @ ((x - rests[side].x) / cycles.scale)
        parts = np.linalg.solve(vectors, z.astype(complex)).real
        return float(sign * parts[k] / np.linalg.norm(parts))

    return value


def _sign(way: Array) -> float:
    """A sign for an eigenvector that changes nowhere as it turns a little.

    Parts are often equal, or multiples of roots: weights are neither.
    """
    return float(np.sign(way @ np.exp(-np.arange(len(way)) / 3.0)))


def _decay(side: int) -> Callable[[Any, Point], float]:
    """By what the normal of the manifolds decays up to its end; nan where it has no leading part.

    It does so at the rate of the leading other eigenvalue, where that is real and there is another.
    """

    def value(cycles: Any, point: Point) -> float:
        found, ends = spectra(cycles, point.orbit), ends_of(cycles)
        if found is None or ends.unstable + ends.stable != cycles.n or cycles.q != 3:
            return math.nan
        others, own = found.others[side], (found.out if side == SOURCE else found.into)
        if len(others) < 2 or _complex(others[0]) or own[0].real == 0.0:
            return math.nan
        return float(ends.distances[side] ** abs(others[0].real / own[0].real))

    return value


def _lost(side: int) -> Callable[[Any, Point], str]:
    """Where nothing but rounding is left of the normal's end."""
    decay, where = _decay(side), "source" if side == SOURCE else "target"

    def words(cycles: Any, point: Point) -> str:
        if not decay(cycles, point) < ROUNDING:
            return ""
        return (
            f"where the normal of the manifolds decays below rounding towards the {where}: a "
            "larger distance of the ends (ends=) leaves more of it"
        )

    return words


def _inclination(side: int) -> Callable[[Any, Point], float]:
    """The part of the normal's end along the leading other eigenvector.

    At the source that is stable: without a part of the normal along it, the stable manifold comes
    there along it. At the target likewise.
    """
    decay = _decay(side)

    def value(cycles: Any, point: Point) -> float:
        size = decay(cycles, point)
        if not size >= ROUNDING:
            return math.nan
        rests = ends_of(cycles).rests(cycles, point.orbit)
        found, z = spectra(cycles, point.orbit), normal(cycles, point.orbit, point.dy)
        if rests is None or found is None or z is None:
            return math.nan
        values, vectors = np.linalg.eig(rests[side].A)
        k = int(np.argmin(np.abs(values - found.others[side][0])))
        way = vectors[:, k].real
        return float(_sign(way) * (way @ z[0 if side == SOURCE else -1])) / size

    return value


for _test in (
    OrbitTest("neutral_saddle_loop", CONNECTION, _saddle(False)),
    OrbitTest("neutral_saddle_focus_loop", CONNECTION, _saddle(True)),
    OrbitTest("double_leading_unstable", CONNECTION, _double(SOURCE)),
    OrbitTest("double_leading_stable", CONNECTION, _double(TARGET)),
    OrbitTest("neutrally_divergent_unstable", CONNECTION, _divergent(SOURCE)),
    OrbitTest("neutrally_divergent_stable", CONNECTION, _divergent(TARGET)),
    OrbitTest("orbit_flip_unstable", CONNECTION, _flip(SOURCE)),
    OrbitTest("orbit_flip_stable", CONNECTION, _flip(TARGET)),
    OrbitTest("inclination_flip_stable", CONNECTION, _inclination(SOURCE), lost=_lost(SOURCE)),
    OrbitTest("inclination_flip_unstable", CONNECTION, _inclination(TARGET), lost=_lost(TARGET)),
):
    look_for(_test)
