"""Any potential under a constant torque N: the formula V - N x, and its equilibria.

On a circle V' - N repeats where V - N x does not: equilibria are those of the circle, and energies
those at their coordinates there.
"""

from __future__ import annotations

import functools
from typing import Any

import numpy as np
import numpy.typing as npt

from phasekit.errors import EquilibriumKind
from phasekit.laws.formulas import symbols_of
from phasekit.laws.perturbed import PerturbedConservative
from phasekit.phase.numerical import functions
from phasekit.phase.numerical.constants import reduced
from phasekit.phase.numerical.equilibria import Equilibria
from phasekit.phase.numerical.equilibria import equilibria as find_equilibria
from phasekit.phase.numerical.formula import Formula, make_formula
from phasekit.phase.numerical.systems import Systems

Array = npt.NDArray[np.float64]

#: Fields with an entry for each equilibrium.
LISTED = ("phi", "kind", "energy", "curvature", "natural_frequency", "exponent", "phi_error")


@functools.lru_cache(maxsize=32)
def tilted(formula: Formula) -> Formula:
    """A potential less torque times coordinate, with the torque as its last parameter."""
    name = "torque"
    while name == formula.coordinate:
        name += "_"
    symbols = symbols_of((formula.coordinate, name))
    tilt = formula.expression - symbols[name] * symbols[formula.coordinate]
    names = (*formula.names, name)
    return make_formula(tilt, formula.coordinate, names, formula.period, formula.interval)


def equilibria(law: PerturbedConservative, *parameters: npt.ArrayLike) -> Equilibria:
    """All equilibria under a constant torque; without one those of the potential, bit for bit."""
    values = law.values(*parameters)
    formula: Any = law.base
    shape = np.broadcast_shapes(*(np.shape(x) for x in values.values()))
    names = (*formula.names, "torque")
    columns = np.stack([np.broadcast_to(values[n], shape).reshape(-1) for n in names]) + 0.0
    # Cells that differ in damping and drive alone have the same equilibria.
    cells, which = np.unique(columns, axis=1, return_inverse=True)
    own = list(cells[:-1])
    found = equilibria_of_cells(reduced(formula), own, cells[-1])
    energy, still = found.energy.copy(), cells[-1] == 0.0
    for rows, one, used in ((still, formula, own), (~still, tilted(formula), cells)):
        inputs = [column[rows] for column in used]
        energy[rows] = functions.energies(one, inputs, found.phi[rows], energy[rows])
    found = found._replace(energy=energy)
    return Equilibria._make(x[which.reshape(-1)].reshape(shape + x.shape[1:]) for x in found)


def equilibria_of_cells(formula: Formula, own: list[Array], torque: Array) -> Equilibria:
    """Equilibria of cells in a row, each with its parameters and torque."""
    still = torque == 0.0
    sorts = [(still, formula, own)]
    if not still.all():
        sorts.append((~still, tilted(formula), [*own, torque]))
    parts = []
    for mask, one, parameters in sorts:
        rows = np.flatnonzero(mask)
        systems = Systems(one, tuple(p[rows] for p in parameters), rows.size)
        parts.append((rows, find_equilibria(systems)))
    width = max(part.phi.shape[1] for _, part in parts)
    fields = []
    for name in Equilibria._fields:
        first = getattr(parts[0][1], name)
        listed = name in LISTED
        empty = EquilibriumKind.ABSENT.value if name == "kind" else np.nan if listed else 0
        shape = (torque.size, width) if listed else (torque.size, *first.shape[1:])
        field = np.full(shape, empty, first.dtype)
        for rows, part in parts:
            values = getattr(part, name)
            if listed:
                field[rows, : values.shape[1]] = values
            else:
                field[rows] = values
        fields.append(field)
    return Equilibria._make(fields)


def most(law: PerturbedConservative, *parameters: npt.ArrayLike) -> tuple[int, int, Array]:
    """Greatest number of equilibria under the torque, and of saddles of the potential alone.

    Melnikov's function belongs to these, to which the torque is a perturbation. Besides what is not
    proved, as of a potential.
    """
    values = law.values(*parameters)
    formula: Any = law.base
    number, saddles, open_ = functions.most(formula, *(values[name] for name in formula.names))
    if not np.any(values["torque"] != 0.0):
        return number, saddles, open_
    points = equilibria(law, *parameters)
    width = points.phi.shape[-1]
    gaps, count = points.gaps.reshape(-1, 2), points.n_gaps.reshape(-1).astype(float)
    open_ = np.column_stack([gaps, count])[count > 0]
    return int(width), saddles, open_


def potential(law: PerturbedConservative, *inputs: npt.ArrayLike) -> Array:
    """V - N x at x, the last of the inputs."""
    formula, own, torque, x = _at(law, inputs)
    return np.asarray(formula.values(x, *own) - torque * x)


def gradient(law: PerturbedConservative, *inputs: npt.ArrayLike) -> Array:
    """V' - N at x, the last of the inputs."""
    formula, own, torque, x = _at(law, inputs)
    return np.asarray(formula.slopes(x, *own) - torque)


def curvature(law: PerturbedConservative, *inputs: npt.ArrayLike) -> Array:
    """V'' at x, the last of the inputs: the torque does not change it."""
    formula, own, torque, x = _at(law, inputs)
    return np.asarray(np.where(np.isnan(torque), np.nan, formula.bends(x, *own)))


def energy(law: PerturbedConservative, *inputs: npt.ArrayLike) -> Array:
    """Energy of states (x, x'), the last of the inputs."""
    speed = np.asarray(inputs[-1], float)
    return np.asarray(0.5 * speed * speed + potential(law, *inputs[:-1]))


def phase_velocity(law: PerturbedConservative, *inputs: npt.ArrayLike) -> Array:
    """Speed at x on the level of an energy, the last of the inputs; NaN where out of reach."""
    kinetic = np.asarray(inputs[-1], float) - potential(law, *inputs[:-1])
    return np.sqrt(2.0 * np.where(kinetic >= 0.0, kinetic, np.nan))


def _at(
    law: PerturbedConservative, inputs: tuple[npt.ArrayLike, ...]
) -> tuple[Formula, list[Any], Any, Array]:
    values = law.values(*inputs[:-1])
    formula: Any = law.base
    return (
        formula,
        [values[n] for n in formula.names],
        values["torque"],
        np.asarray(inputs[-1], float),
    )
