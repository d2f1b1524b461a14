"""Potentials as they are without a torque, and their equilibria under one.

Of any formula by numbers, from left to right; of coefficients (A, B, C) in closed form, by names.
"""

from __future__ import annotations

import functools
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from phasekit.arrays import Array, Ints
from phasekit.laws.trigonometric import Trigonometric
from phasekit.phase.exact import action_angle, flow
from phasekit.phase.exact import orbits as closed
from phasekit.phase.exact import phase_space as loops
from phasekit.phase.exact import potential as heights
from phasekit.phase.exact.under_torque import equilibria_under, saddle_at
from phasekit.phase.numerical import functions
from phasekit.phase.numerical.angles import AnglesWithErrors
from phasekit.phase.numerical.constants import constant, reduced
from phasekit.phase.numerical.equilibria import Equilibria
from phasekit.phase.numerical.equilibria import equilibria as find_equilibria
from phasekit.phase.numerical.families import StateWithErrors
from phasekit.phase.numerical.formula import Formula, Shape
from phasekit.phase.numerical.motion import MotionWithErrors
from phasekit.phase.numerical.orbits import Orbits
from phasekit.phase.numerical.separatrices import Separatrices
from phasekit.phase.numerical.systems import Systems
from phasekit.phase.numerical.turns import Turns, torqued

_EPS = float(np.finfo(float).eps)
#: The potential of (A, B, C); no string of it is ever read.
TRIGONOMETRIC = Formula(
    text=Trigonometric.text,
    coordinate="phi",
    names=("A", "B", "C"),
    period=Trigonometric.period,
    interval=None,
    shape=Shape.FOURIER,
    expression=None,
    values=lambda x, A, B, C: heights.potential(A, B, C, x),
    slopes=lambda x, A, B, C: heights.gradient(A, B, C, x),
    bends=lambda x, A, B, C: heights.curvature(A, B, C, x),
    coefficients=None,
)


@dataclass(frozen=True)
class Unpushed:
    """A formula of any potential."""

    formula: Formula

    def level(self, name: str, own: list[Array], *states: Array, **options: Any) -> Any:
        """What a function of `phasekit.phase.numerical.functions` says of systems in a row."""
        return getattr(functions, name)(self.formula, *own, *states, **options)

    def constant(self, own: list[Array], torque: Array) -> Array:
        """What belongs to the energies but not to the motion."""
        return np.asarray(constant(self.formula, own) + 0.0 * torque)

    def points(self, own: list[Array], torque: Array) -> Any:
        """Equilibria under torques, without what belongs to their energies alone."""
        return _equilibria(reduced(self.formula), own, torque)

    def equilibria(self, points: Any, own: list[Array], torque: Array) -> Any:
        """These with their whole energies."""
        energy, level = points.energy.copy(), torque == 0.0
        for rows, formula, used in (
            (level, self.formula, own),
            (~level, torqued(self.formula), [*own, torque]),
        ):
            inputs = [column[rows] for column in used]
            energy[rows] = functions.energies(formula, inputs, points.phi[rows], energy[rows])
        return points._replace(energy=energy)

    def turns(self, points: Any, own: list[Array], torque: Array) -> Turns:
        """Systems under torques on the line, of which these are found."""
        return Turns.from_formula(reduced(self.formula), own, torque, points)


class Named(Unpushed):
    """The potential of (A, B, C), whose equilibria have names."""

    def level(self, name: str, own: list[Array], *states: Array, **options: Any) -> Any:
        """The same in closed form."""
        return CLOSED[name](*own, *states, *options.values())

    def constant(self, own: list[Array], torque: Array) -> Array:
        """Nothing."""
        return np.zeros(torque.shape)

    def points(self, own: list[Array], torque: Array) -> Any:
        """Equilibria under torques, labelled as those that they are without."""
        A, B, C = own
        return equilibria_under(A, B, C, torque)

    def equilibria(self, points: Any, own: list[Array], torque: Array) -> Any:
        """These, whose energies are whole."""
        return points

    def turns(self, points: Any, own: list[Array], torque: Array) -> Turns:
        """Systems under torques on the line, of which these are found."""
        count, none = points.n_equilibria, np.zeros(len(torque), np.int64)
        gaps = np.full((len(torque), 2), np.nan)
        size = np.sum(np.abs([*own, torque]), axis=0)
        with np.errstate(all="ignore"):
            error = _EPS * size[:, None] / np.abs(points.curvature)
        proofs = [count.astype(np.int16), count >= 0, gaps, none, error]
        few = Equilibria._make([*points[:6], *proofs])
        return Turns.from_formula(
            self.formula, own, torque, few, _rises(own, torque, few), named=True
        )


@functools.singledispatch
def unpushed(law: Any, values: Mapping[str, Any]) -> tuple[Unpushed, list[Any]]:
    """A law without its torque, and the parameters of its formula."""
    raise TypeError(law)


@unpushed.register
def _(law: Formula, values: Mapping[str, Any]) -> tuple[Unpushed, list[Any]]:
    return Unpushed(law), [values[name] for name in law.names]


@unpushed.register
def _(law: Trigonometric, values: Mapping[str, Any]) -> tuple[Unpushed, list[Any]]:
    own = {name: values[name] for name in law.parameters}
    return Named(TRIGONOMETRIC), list(law.coefficients(own))


def merged(parts: list[tuple[Ints, Any]], size: int) -> list[Any]:
    """Results of some rows each as those of all; nothing where the others have more columns."""
    out = []
    for fields in zip(*(found for _, found in parts), strict=True):
        tails = [field.shape[1:] for field in fields]
        tail = tuple(map(max, zip(*tails, strict=True)))
        empty = np.nan if fields[0].dtype.kind == "f" else 0
        whole = np.full((size, *tail), empty, fields[0].dtype)
        for (rows, _), field in zip(parts, fields, strict=True):
            own: Any = (rows, *map(slice, field.shape[1:]))
            whole[own] = field
        out.append(whole)
    return out


# ------------------------------------------------------------------------- parts


def _equilibria(formula: Formula, own: list[Array], torque: Array) -> Equilibria:
    """Equilibria of any potential under torques, each on the circle of its force."""
    level = torque == 0.0
    parts = []
    for rows, one, used in (
        (np.flatnonzero(level), formula, own),
        (np.flatnonzero(~level), torqued(formula), [*own, torque]),
    ):
        if rows.size or not torque.size:
            few = Systems(one, tuple(p[rows] for p in used), rows.size)
            parts.append((rows, find_equilibria(few)))
    return Equilibria._make(merged(parts, torque.size))


def _rises(own: list[Array], torque: Array, points: Equilibria) -> tuple[Array, Array]:
    """Energies of equilibria above each other, and what rounding hides of them.

    Next to a fold they are known from the saddle. Under next to no torque the difference of two
    saddles is that of no torque, which is known to its last digits, and what the torque N makes of
    it, ``d(h_i - h_j)/dN = phi_j - phi_i``.
    """
    A, B, C = own
    rise = points.energy[:, :, None] - points.energy[:, None, :]
    size = np.abs(A) + np.abs(B) + np.abs(C) + 2.0 * np.pi * np.abs(torque)
    hidden = np.zeros(rise.shape)
    level = loops.separatrices(A, B, C)
    step = closed.energy_rises(A, B, C)[:, 2]
    with np.errstate(all="ignore"):
        for i in (1, 3):
            k = points.exponent[:, i, None]
            saddle = saddle_at(A[:, None], points.phi[:, i, None], k, torque[:, None])
            depth = saddle.depth(points.phi - points.phi[:, i, None])
            there = np.isfinite(depth)
            rise[:, i] = np.where(there, depth, rise[:, i])
            rise[:, :, i] = np.where(there, -depth, rise[:, :, i])
        gap = points.phi[:, 1] - points.phi[:, 3]
        moved = level.saddle_phi[:, 0] - level.saddle_phi[:, 1] - gap
        still = gap + moved - 2.0 * np.pi * np.round(moved / (2.0 * np.pi))
        near = -step - torque * 0.5 * (gap + still)
        squares = np.concatenate([points.exponent[:, 1::2], level.saddle_exponent], axis=1) ** 2
        bend = (torque / np.min(squares, axis=1)) ** 2
        lost = (np.abs(step) + np.abs(torque * 0.5 * (gap + still))) * (16.0 * _EPS + bend)
        lost += np.abs(torque) * np.abs(gap - still)
        rough = 16.0 * _EPS * size
        good = lost < rough
    for i, j, sign in ((1, 3, 1.0), (3, 1, -1.0)):
        rise[:, i, j] = np.where(good, sign * near, rise[:, i, j])
        hidden[:, i, j] = np.where(good, lost, rough)
    return rise, hidden


def _with_errors(found: closed.Orbits) -> Orbits:
    """Orbits in closed form, whose errors are nothing; those of turning points are not known."""
    errors = (np.where(np.isnan(x), np.nan, 0.0) for x in (found.period, found.action))
    unknown = np.full(found.period.shape, np.nan)
    return Orbits._make([*found, *errors, unknown, unknown])


def _separatrices(A: Any, B: Any, C: Any) -> Separatrices:
    found = loops.separatrices(A, B, C)
    areas = (found.winding_area, found.lobe_area)
    return Separatrices(*found, *(np.where(np.isnan(x), np.nan, 0.0) for x in areas))


def _angles(A: Any, B: Any, C: Any, *states: Any) -> AnglesWithErrors:
    found = action_angle.orbits_with_angles(A, B, C, *states)[1]
    return AnglesWithErrors(*found, np.where(np.isnan(found.angle), np.nan, 0.0))


def _motion(A: Any, B: Any, C: Any, *inputs: Any) -> MotionWithErrors:
    moved = flow.separatrix_motion(A, B, C, *inputs)
    return MotionWithErrors(*moved, *(np.where(np.isnan(x), np.nan, 0.0) for x in moved))


def _states(A: Any, B: Any, C: Any, *inputs: Any) -> StateWithErrors:
    found = action_angle.state_of_numbers(A, B, C, *inputs)
    return StateWithErrors(*found, *(np.where(np.isnan(x), np.nan, 0.0) for x in found))


#: Namesakes of the functions of a formula.
CLOSED: Mapping[str, Callable[..., Any]] = {
    "separatrices": _separatrices,
    "angles": _angles,
    "orbits": lambda *inputs: _with_errors(closed.orbits(*inputs)),
    "orbits_at_energy": lambda *inputs: _with_errors(closed.orbits_at_energy(*inputs)),
    "orbits_at_gap": lambda *inputs: _with_errors(closed.orbits_at_gap(*inputs)),
    "separatrix_motion_with_errors": _motion,
    "state_of": _states,
}
