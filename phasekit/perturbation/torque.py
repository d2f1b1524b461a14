"""Constant torques: the greatest that an equilibrium can hold, the least that turns."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from phasekit.arrays import Array
from phasekit.errors import Loop, Validity
from phasekit.inputs import bad
from phasekit.laws.perturbed import PerturbedLaw
from phasekit.perturbation import quadrature
from phasekit.perturbation.capture import energy_size, total, turning_arcs
from phasekit.perturbation.melnikov import cubes, refuse_prescribed, side_areas
from phasekit.perturbation.validity import validity
from phasekit.phase.exact.inflections import CriticalTorque, critical_torque
from phasekit.phase.exact.phase_space import separatrices
from phasekit.phase.numerical import functions, inflections


def critical_of_perturbed(law: PerturbedLaw, *parameters: npt.ArrayLike) -> CriticalTorque:
    """The same for a perturbed system, whose own torque does not count."""
    return critical_torque(*law.coefficients(law.values(*parameters)))


def critical_of_formula(
    law: PerturbedLaw, *parameters: npt.ArrayLike
) -> inflections.CriticalTorque:
    """The same in any potential."""
    formula: Any = law.base
    values = law.values(*parameters)
    return inflections.critical_torque(formula, *(values[name] for name in formula.names))


class Retrapping(NamedTuple):
    """Torques that keep a rotation going; the last axis is the direction (minus, plus)."""

    retrapping_torque: Array
    retrapping_validity: npt.NDArray[np.int8]


def retrapping_torque(law: PerturbedLaw, *parameters: npt.ArrayLike) -> Retrapping:
    """Least torque that keeps a rotation going, at small damping; directions minus and plus."""
    refuse_prescribed(law, "retrapping_torque")
    values = law.values(*parameters)
    A, B, C = law.coefficients(values)
    loops = separatrices(A, B, C)
    exponent = np.asarray(loops.saddle_exponent)[..., 1]
    area, cube = side_areas(loops)[..., 1, :], cubes(A, loops)[..., 1, :]
    arcs = loops.loop[..., 1, None] == Loop.HETEROCLINIC  # both of them make the turn
    area, cube = (np.where(arcs, x.sum(-1, keepdims=True), x) for x in (area, cube))
    damping, quadratic = (values[name][..., None] for name in ("damping", "quadratic"))
    loss = damping * area + quadratic * cube
    ends = critical_torque(A, B, C).critical_torque
    return _retrapping(law, values, loss, 2.0 * np.pi, ends, exponent)


def retrapping_of_formula(law: PerturbedLaw, *parameters: npt.ArrayLike) -> Retrapping:
    """The same in any potential on a circle."""
    refuse_prescribed(law, "retrapping_torque")
    formula: Any = law.base
    if formula.period is None:
        wants = "a coordinate with a period, for on a line nothing rotates"
        raise bad("system", formula.text, wants)
    values = law.values(*parameters)
    # Of damping alone.
    still = {
        name: 0.0 * x if name == "torque" or name.startswith("drift_") else x
        for name, x in values.items()
    }
    loss = -quadrature.melnikov(law, *still.values()).melnikov_mean
    own = [values[name] for name in formula.names]
    points, loops = functions.phase_space(formula, *own)
    if not loss.shape[-2]:
        nothing = np.full((*loss.shape[:-2], 2), np.nan)
        return _retrapping(law, values, nothing, formula.period, nothing, nothing[..., 0])
    arcs = turning_arcs(loops, energy_size(points), loss.shape[:-1])
    whole = np.where(arcs.any(axis=-1, keepdims=True), total(loss, arcs), np.nan)
    steep = np.broadcast_to(loops.saddle_exponent, arcs.shape)
    exponent = np.where(arcs, steep, -np.inf).max(axis=-1)
    exponent = np.where(np.isfinite(exponent), exponent, np.nan)
    ends = inflections.critical_torque(formula, *own).critical_torque
    return _retrapping(law, values, whole, formula.period, ends, exponent)


def _retrapping(
    law: PerturbedLaw, values: dict[str, Any], loss: Array, period: float, ends: Array,
    exponent: Array,
) -> Retrapping:  # fmt: skip
    """Torques that give in a turn what is lost in it; the last axis is the direction."""
    torque = np.asarray(np.array([-1.0, 1.0]) * loss / period)
    each = {name: np.asarray(x)[..., None] for name, x in values.items()}
    # Where equilibria are gone at less, rotations do not end at a separatrix.
    held = np.abs(torque) < np.abs(ends)
    rate = np.where(np.isnan(torque), np.nan, 0.0)
    held |= torque == 0.0
    code = validity(law, each, rate, held, exponent=exponent[..., None], forced=True, noisy=True)
    return Retrapping(np.where(code == Validity.HOLDS, torque, np.nan), code)
