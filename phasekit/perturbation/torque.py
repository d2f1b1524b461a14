"""Constant torques: the greatest that an equilibrium can hold, the least that turns."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from phasekit.errors import Loop, Validity
from phasekit.laws.perturbed import PerturbedTrigonometric
from phasekit.perturbation.melnikov import cubes, refuse_prescribed, side_areas
from phasekit.perturbation.validity import validity
from phasekit.phase.exact.inflections import CriticalTorque, critical_torque
from phasekit.phase.exact.separatrices import separatrices

Array = npt.NDArray[np.float64]


def critical_of_perturbed(
    law: PerturbedTrigonometric, *parameters: npt.ArrayLike
) -> CriticalTorque:
    """The same for a perturbed system, whose own torque does not count."""
    return critical_torque(*law.coefficients(law.values(*parameters)))


class Retrapping(NamedTuple):
    """Torques that keep a rotation going; the last axis is the direction (minus, plus)."""

    retrapping_torque: Array
    retrapping_validity: npt.NDArray[np.int8]


def retrapping_torque(law: PerturbedTrigonometric, *parameters: npt.ArrayLike) -> Retrapping:
    """Least torque that keeps a rotation going, at small damping; directions minus and plus."""
    refuse_prescribed(law, "retrapping_torque")
    values = law.values(*parameters)
    A, B, C = law.coefficients(values)
    loops = separatrices(A, B, C)
    area, cube = side_areas(loops)[..., 1, :], cubes(A, loops)[..., 1, :]
    arcs = loops.loop[..., 1, None] == Loop.HETEROCLINIC  # both of them make the turn
    area, cube = (np.where(arcs, x.sum(-1, keepdims=True), x) for x in (area, cube))
    damping, quadratic = (values[name][..., None] for name in ("damping", "quadratic"))
    loss = damping * area + quadratic * cube
    torque = np.asarray(np.array([-1.0, 1.0]) * loss / (2.0 * np.pi))
    ends = critical_torque(A, B, C).critical_torque
    each = {name: np.asarray(x)[..., None] for name, x in values.items()}
    # Where equilibria are gone at less, rotations do not end at a separatrix.
    held = np.abs(torque) < np.abs(ends)
    rate = np.where(np.isnan(torque), np.nan, 0.0)
    exponent = np.asarray(loops.saddle_exponent)[..., 1, None]
    code = validity(law, each, rate, held | (torque == 0.0), exponent=exponent)
    return Retrapping(np.where(code == Validity.HOLDS, torque, np.nan), code)
