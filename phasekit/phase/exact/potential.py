"""The energy integral of phi'' = -V'(phi), V = -B cos phi + (A/2) cos^2 phi - C sin phi.

Arrays in, arrays out, broadcast as in NumPy. Energies are per unit of generalised inertia, in
1/s^2. The equation is [Veljovic2015] (12), its integral (14) and (15), with A = Omega^2,
B = lambda Omega^2 and C = psi Omega^2, which stay finite where Omega^2 = 0.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from phasekit.arrays import Array


def potential(A: npt.ArrayLike, B: npt.ArrayLike, C: npt.ArrayLike, phi: npt.ArrayLike) -> Array:
    """Potential V(phi), 1/s^2: [Veljovic2015] (15) plus A/2."""
    A, B, C, cos, sin = _arrays(A, B, C, phi)
    with np.errstate(invalid="ignore"):
        return np.asarray((0.5 * A * cos - B) * cos - C * sin)


def gradient(A: npt.ArrayLike, B: npt.ArrayLike, C: npt.ArrayLike, phi: npt.ArrayLike) -> Array:
    """V'(phi) = B sin phi - A sin phi cos phi - C cos phi, 1/s^2: minus the acceleration."""
    A, B, C, cos, sin = _arrays(A, B, C, phi)
    with np.errstate(invalid="ignore"):
        return np.asarray((B - A * cos) * sin - C * cos)


def curvature(A: npt.ArrayLike, B: npt.ArrayLike, C: npt.ArrayLike, phi: npt.ArrayLike) -> Array:
    """V''(phi) = B cos phi - A cos 2 phi + C sin phi, 1/s^2."""
    A, B, C, cos, sin = _arrays(A, B, C, phi)
    with np.errstate(invalid="ignore"):
        return np.asarray(B * cos - A * (cos - sin) * (cos + sin) + C * sin)


def energy(
    A: npt.ArrayLike, B: npt.ArrayLike, C: npt.ArrayLike, phi: npt.ArrayLike, dphi: npt.ArrayLike
) -> Array:
    """Energy integral h = dphi^2/2 + V(phi), 1/s^2: [Veljovic2015] (14).

    For the rotor it is the Jacobi integral of the relative motion, not its total energy.
    """
    dphi = np.asarray(dphi, dtype=float)
    return np.asarray(0.5 * dphi * dphi + potential(A, B, C, phi))


def phase_velocity(
    A: npt.ArrayLike, B: npt.ArrayLike, C: npt.ArrayLike, phi: npt.ArrayLike, energy: npt.ArrayLike
) -> Array:
    """Speed |phi'| >= 0 at phi on a level of the energy, 1/s; NaN where it does not reach."""
    kinetic = np.asarray(energy, dtype=float) - potential(A, B, C, phi)
    return np.sqrt(2.0 * np.where(kinetic >= 0.0, kinetic, np.nan))


def _arrays(*values: npt.ArrayLike) -> tuple[Array, ...]:
    """Coefficients as arrays, and cosine and sine of the angle, NaN where it is infinite."""
    *coefficients, phi = (np.asarray(value, dtype=float) for value in values)
    with np.errstate(invalid="ignore"):
        return *coefficients, np.cos(phi), np.sin(phi)
