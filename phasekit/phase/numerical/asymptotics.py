"""Small oscillations about the centers of any potential, to first order in the energy."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from phasekit.arrays import Array
from phasekit.errors import EquilibriumKind
from phasekit.phase.exact.asymptotics import NearCenter
from phasekit.phase.numerical.formula import Formula
from phasekit.phase.numerical.functions import equilibria


def near_center(formula: Formula, *inputs: npt.ArrayLike) -> NearCenter:
    """Period and frequency at an energy above each center, the last of the inputs.

    ``w - eps (5 V'''^2/(24 w^5) - V''''/(8 w^3))`` with ``w^2 = V''``, [LandauLifshitz1976]
    section 28; in quotients of like sizes, so that nothing overflows.
    """
    *parameters, energy = np.broadcast_arrays(*(np.asarray(x, float) for x in inputs))
    points = equilibria(formula, *parameters)
    beside = [value[..., None] for value in parameters]
    w2 = np.where(points.kind == EquilibriumKind.CENTER, points.curvature, np.nan)
    third, fourth = (formula.derivative(order)(points.phi, *beside) for order in (3, 4))
    return oscillations(w2, third, fourth, energy[..., None])


def oscillations(w2: Array, third: Array, fourth: Array, energy: Array) -> NearCenter:
    """Small oscillations at energies, by the second to fourth derivatives of V at the centers."""
    with np.errstate(all="ignore"):
        bend = (5.0 / 24.0) * (third / w2) ** 2 - fourth / (8.0 * w2)
        shift = energy / w2 * bend
        omega = np.sqrt(w2)
        return NearCenter(2.0 * np.pi / omega * (1.0 + shift), omega * (1.0 - shift))
