"""The energy under a constant torque N, ``h = phi'^2/2 + V(phi) - N phi``, at unwrapped angles."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

from phasekit.laws.perturbed import PerturbedTrigonometric
from phasekit.phase.exact import potential as closed

Array = npt.NDArray[np.float64]


def potential(law: PerturbedTrigonometric, *inputs: npt.ArrayLike) -> Array:
    """V - N phi at phi, the last of the inputs."""
    A, B, C, N = tilt(law, *inputs[:-1])
    phi = np.asarray(inputs[-1], float)
    return np.asarray(height(phi, A, B, C, N))


def gradient(law: PerturbedTrigonometric, *inputs: npt.ArrayLike) -> Array:
    """V' - N at phi, the last of the inputs."""
    A, B, C, N = tilt(law, *inputs[:-1])
    return np.asarray(closed.gradient(A, B, C, inputs[-1]) - N)


def curvature(law: PerturbedTrigonometric, *inputs: npt.ArrayLike) -> Array:
    """V'' at phi, the last of the inputs: the torque does not change it."""
    A, B, C, N = tilt(law, *inputs[:-1])
    return np.asarray(np.where(np.isnan(N), np.nan, closed.curvature(A, B, C, inputs[-1])))


def energy(law: PerturbedTrigonometric, *inputs: npt.ArrayLike) -> Array:
    """Energy of states (phi, dphi), the last of the inputs."""
    speed = np.asarray(inputs[-1], float)
    return np.asarray(0.5 * speed * speed + potential(law, *inputs[:-1]))


def phase_velocity(law: PerturbedTrigonometric, *inputs: npt.ArrayLike) -> Array:
    """Speed at phi on the level of an energy, the last of the inputs; NaN where out of reach."""
    kinetic = np.asarray(inputs[-1], float) - potential(law, *inputs[:-1])
    return np.sqrt(2.0 * np.where(kinetic >= 0.0, kinetic, np.nan))


def tilt(law: PerturbedTrigonometric, *parameters: npt.ArrayLike) -> tuple[Any, Any, Any, Any]:
    """A, B, C and the torque."""
    values = law.values(*parameters)
    return (*law.coefficients(values), values["torque"])


def height(phi: Any, A: Any, B: Any, C: Any, N: Any) -> Any:
    """V - N phi."""
    return closed.potential(A, B, C, phi) - N * phi
