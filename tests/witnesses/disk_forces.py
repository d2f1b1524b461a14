"""Bearing forces of the disk by Newton and Euler for its four particles, in plain NumPy.

Axes of vectors: the carrier's u01 = n2, v01 = [n1, n2], n1. The disk stands as four particles of a
quarter of its mass at r/sqrt(2) from its center, on the diameter through O2 and on the one across.
Everything is a sum over particles; no formula of phasekit or of the papers takes part. All
arguments broadcast.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

NAMES = ("beta", "e", "a", "r", "omega1", "m", "g", "half_span")
N2, V01, N1 = np.eye(3)


@dataclass(frozen=True)
class Motion:
    """State of motion: angular velocities and accelerations about the shaft and of the support."""

    phi: Any
    dphi: Any
    ddphi: Any
    domega1: Any = 0.0


@dataclass(frozen=True)
class Disk:
    """A disk, or a batch of them whose shape broadcasts with that of the states."""

    beta: Any
    e: Any
    a: Any
    r: Any
    omega1: Any
    m: Any = 1.0
    g: Any = 9.81
    half_span: Any = 1.0

    def replace(self, **changes: Any) -> Disk:
        return Disk(**{name: changes.get(name, getattr(self, name)) for name in NAMES})

    def points(self, phi: Any) -> np.ndarray:
        """Particles from O2, on the axis before the last."""
        along, radial, reach = np.cos(self.beta), np.sin(self.beta), self.r / np.sqrt(2.0)
        outward = vector(0.0, np.sin(phi), -np.cos(phi))
        tangent = vector(0.0, np.cos(phi), np.sin(phi))
        diameter = scaled(along, N2) + scaled(radial, outward)
        center = scaled(self.e, diameter)
        ways = (diameter, -diameter, tangent, -tangent)
        return np.stack(np.broadcast_arrays(*(center + scaled(reach, x) for x in ways)), axis=-2)

    def rates(self, motion: Motion) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Rate of momentum, rate of angular momentum about O2 carried along, mass center."""
        rho = self.points(motion.phi)
        carried = rho + scaled(self.a, V01)[..., None, :]
        w1, w2 = (np.asarray(x)[..., None] for x in (self.omega1, motion.dphi))
        d1, d2 = (np.asarray(x)[..., None] for x in (motion.domega1, motion.ddphi))
        relative = scaled(w2, about_n2(rho))
        acceleration = (
            scaled(d1, about_n1(carried))
            + scaled(w1 * w1, about_n1(about_n1(carried)))
            + 2.0 * scaled(w1, about_n1(relative))
            + scaled(d2, about_n2(rho))
            + scaled(w2, about_n2(relative))
        )
        quarter = np.asarray(self.m)[..., None] / 4.0
        dK = scaled(quarter, acceleration).sum(axis=-2)
        M = scaled(quarter, cross(rho, acceleration)).sum(axis=-2)
        return dK, M, rho.mean(axis=-2)

    @property
    def G(self) -> np.ndarray:
        return scaled(-np.asarray(self.m) * self.g, N1)

    def free(self, phi: Any, dphi: Any, domega1: Any = 0.0) -> np.ndarray:
        """Acceleration for which there is no couple about the shaft."""
        _, M, center = self.rates(Motion(phi, dphi, 0.0, domega1))
        inertia = np.asarray(self.m) / 4.0 * (self.points(phi)[..., 1:] ** 2).sum(axis=(-2, -1))
        return -(M - cross(center, self.G))[..., 0] / inertia

    def energy(self, phi: Any, dphi: Any) -> np.ndarray:
        """Kinetic and potential energy."""
        rho = self.points(phi)
        v = scaled(np.asarray(self.omega1)[..., None], about_n1(rho + scaled(self.a, V01)))
        v = v + scaled(np.asarray(dphi)[..., None], about_n2(rho))
        quarter = np.asarray(self.m) / 4.0
        kinetic = 0.5 * quarter * (v * v).sum(axis=(-2, -1))
        return np.asarray(kinetic + self.m * self.g * rho.mean(axis=-2)[..., 2])

    def bearings(self, motion: Motion, weight: bool = True) -> np.ndarray:
        """Forces on the disk at A2 and B2, (..., 2, 3)."""
        dK, M, center = self.rates(motion)
        G = self.G if weight else 0.0 * self.G
        force, moment = dK - G, M - cross(center, G)
        along = scaled(force[..., 0], N2)
        half = 0.5 * (force - along)
        lever = scaled(0.5 / np.asarray(self.half_span), -about_n2(moment))
        return np.stack([along + half + lever, half - lever], axis=-2)

    def fixed_bearings(self, motion: Motion, rho_b1: Any, weight: bool = True) -> np.ndarray:
        """Forces on the rotor at A1 and B1, (..., 2, 3)."""
        dK, M, center = self.rates(motion)
        G = self.G if weight else 0.0 * self.G
        force, moment = dK - G, M - cross(center, G)
        about = moment + cross(scaled(self.a, V01), force)
        at_B = scaled(1.0 / np.asarray(rho_b1), -about_n1(about))
        return np.stack([force - at_B, at_B], axis=-2)

    def drive_torque(self, motion: Motion) -> np.ndarray:
        dK, M, _ = self.rates(motion)
        return (M + cross(scaled(self.a, V01), dK))[..., 2]

    def sizes(self, phi: Any, dphi: Any) -> np.ndarray:
        """Sizes of the forces in free motion, (..., 2)."""
        force = self.bearings(Motion(phi, dphi, self.free(phi, dphi)))
        return np.sqrt((force * force).sum(axis=-1))

    def intensities(self, phi: Any, dphi: Any) -> np.ndarray:
        """Intensities of R022 and R012 in free motion, (..., 2)."""
        ddphi = self.free(phi, dphi)
        return np.stack(
            np.broadcast_arrays(np.hypot(ddphi, dphi**2), 2.0 * np.abs(self.omega1 * dphi)), -1
        )


def about_n1(v: np.ndarray) -> np.ndarray:
    """Vector product [n1, v]."""
    return vector(-v[..., 1], v[..., 0], 0.0)


def about_n2(v: np.ndarray) -> np.ndarray:
    """Vector product [n2, v]."""
    return vector(0.0, -v[..., 2], v[..., 1])


def cross(x: np.ndarray, y: np.ndarray) -> np.ndarray:
    return vector(
        x[..., 1] * y[..., 2] - x[..., 2] * y[..., 1],
        x[..., 2] * y[..., 0] - x[..., 0] * y[..., 2],
        x[..., 0] * y[..., 1] - x[..., 1] * y[..., 0],
    )


def vector(x: Any, y: Any, z: Any) -> np.ndarray:
    return np.stack(np.broadcast_arrays(x, y, z), axis=-1)


def scaled(number: Any, x: np.ndarray) -> np.ndarray:
    """Numbers times vectors."""
    return np.asarray(number)[..., None] * x
