"""Periods next to centers and separatrices, to leading order. Arrays in, arrays out.

The exact ones are those of `phasekit.phase.exact.orbits`; these say how they behave.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from phasekit.arrays import Array
from phasekit.errors import EquilibriumKind, Topology
from phasekit.phase.exact.phase_space import Equilibria, phase_space


class NearCenter(NamedTuple):
    """Small oscillations; the last axis is the equilibrium, NaN but for centers."""

    near_center_period: Array
    """Period to first order in the energy, s."""
    near_center_frequency: Array
    """Frequency to first order in the energy, rad/s."""


class NearSeparatrix(NamedTuple):
    """Orbits next to a separatrix; the last axis is the saddle (lower, upper)."""

    near_separatrix_period: Array
    """Period but for terms that vanish with the gap, s."""


def near_center(
    A: npt.ArrayLike, B: npt.ArrayLike, C: npt.ArrayLike, energy: npt.ArrayLike
) -> NearCenter:
    """Small oscillations: T = (2 pi/w0) [1 + E (15 S2^2/(8 w0^6) - (4 C2 - P)/(8 w0^4))].

    Here w0^2 = V'', S2 = (A/2) sin 2 phi, C2 = A cos 2 phi, P = B cos phi + C sin phi. The energy
    is that above the center, in 1/s^2.
    """
    A, B, C, energy = np.broadcast_arrays(*(np.asarray(x, float) for x in (A, B, C, energy)))
    points, _ = phase_space(A, B, C)
    center = points.kind == EquilibriumKind.CENTER
    with np.errstate(all="ignore"):
        s2, c2, p = _bends(A, B, C, points)
        w2 = np.where(center, points.curvature, np.nan)
        bend = 1.875 * (s2 / w2) ** 2 - (4.0 * c2 - p) / (8.0 * w2)
        shift = energy[..., None] / w2 * bend
        omega = np.sqrt(w2)
        return NearCenter(2.0 * np.pi / omega * (1.0 + shift), omega * (1.0 - shift))


def near_separatrix(
    A: npt.ArrayLike, B: npt.ArrayLike, C: npt.ArrayLike, gap: npt.ArrayLike
) -> NearSeparatrix:
    """Periods next to a separatrix: T ~ (n/k) ln(32 k^6/(|gap| |D|)).

    n = 1 inside a lobe and for rotations above a winding loop, n = 2 outside a figure-eight and
    below a winding loop; between equal saddles, T ~ (2/k) ln(8 k^4/(|gap| |A|)). The gap is the
    energy minus that of the saddle, 1/s^2, of either sign; infinite at 0.
    """
    A, B, C, gap = np.broadcast_arrays(*(np.asarray(x, float) for x in (A, B, C, gap)))
    points, loops = phase_space(A, B, C)
    pick = [1, 3]  # lower and upper saddle among the equilibria
    with np.errstate(all="ignore"):
        s2, _, p = (value[..., pick] for value in _bends(A, B, C, points))
        k = loops.saddle_exponent
        gap = gap[..., None]
        d = (s2 / k**2) ** 2 + p / k**2
        inside = gap < 0.0
        lobes = np.stack([np.ones(A.shape, bool), np.zeros(A.shape, bool)], axis=-1)
        passes = np.where(inside == lobes, 1.0, 2.0)
        k2 = k * k
        # Quotients of like sizes, so that nothing overflows.
        size = np.log(k2 / np.abs(gap))
        period = passes / k * (np.log(32.0 / np.abs(d)) + size)
        cycle = (loops.topology == Topology.HETEROCLINIC)[..., None]
        equal = 2.0 / k * (np.log(8.0 * k2 / np.abs(A[..., None])) + size)
        return NearSeparatrix(np.where(cycle, equal, period))


def _bends(A: Array, B: Array, C: Array, points: Equilibria) -> tuple[Array, Array, Array]:
    """S2 = (A/2) sin 2 phi, C2 = A cos 2 phi, P = B cos phi + C sin phi at the equilibria."""
    a, b, c = (value[..., None] for value in (A, B, C))
    x = np.cos(points.phi)
    y = np.sin(points.phi)
    return a * x * y, a * (x - y) * (x + y), b * x + c * y
