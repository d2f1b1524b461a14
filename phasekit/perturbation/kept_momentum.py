"""A rotor on a free support, damped and driven about its shaft: at the momentum that it keeps.

Torques on the shaft react on the support, so that they leave the momentum about the vertical as it
is: what holds at a momentum holds for the whole machine. By arc length, ``ds = sqrt(M) dphi``, the
undisturbed motion is that in a potential; separatrices are followed there, in the time of the
machine.
"""

from __future__ import annotations

import functools
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from phasekit.arrays import Array
from phasekit.errors import Validity
from phasekit.laws.ladder import Routhian, Routhians
from phasekit.laws.perturbed import PerturbedLaw
from phasekit.perturbation.capture import Capture, energy_size, of_loops, weak
from phasekit.perturbation.melnikov import Melnikov, refuse_prescribed
from phasekit.perturbation.quadrature import CELLS, POINTS, Paths, along, closed, times_of
from phasekit.perturbation.validity import greatest, saddles_held, tilts
from phasekit.phase.numerical import motion
from phasekit.phase.numerical.machines import NOTHING, Along, followed, widened
from phasekit.phase.numerical.separatrices import SIDES, Separatrices, branch_of


class Loops(NamedTuple):
    """Separatrices of machines in a row; the last axis is the saddle, by its angle."""

    saddle_energy: Array
    saddle_exponent: Array
    loop: npt.NDArray[np.int8]
    turning_offset: Array
    lobe_area: Array
    winding_area: Array


def equilibria(law: PerturbedLaw, *parameters: npt.ArrayLike) -> Any:
    """All steady rotations under a constant torque on the shaft."""
    values = law.values(*parameters)
    return _machines(law).resting(values, values["torque"])


def melnikov(law: PerturbedLaw, *parameters: npt.ArrayLike) -> Melnikov:
    """Melnikov's function along the separatrices of the amended potential, in J."""
    return _along_separatrices(law, parameters)[2]


def capture(law: PerturbedLaw, *parameters: npt.ArrayLike, rotation: bool = False) -> Capture:
    """Capture into the lobes of the lowest saddle that has two, or from rotation."""
    loops, size, found = _along_separatrices(law, parameters)
    values = law.values(*parameters)
    flux, share, turns = of_loops(loops, -found.melnikov_mean, size, values["torque"], rotation)
    exponent = greatest(loops.saddle_exponent, -1)
    with np.errstate(all="ignore"):
        rate = np.abs(values["damping"]) / exponent
    strong = (found.threshold_validity == Validity.NOT_WEAK).any(axis=(-2, -1))
    rate = np.where(strong, np.inf, rate)
    base = _machines(law)
    push = values["torque"] * base.with_values(values).own_inertia
    tilt = tilts(push, loops, base.period)
    counts = _counts(law, values)
    return weak((flux, share), law, values, rate, counts, loops.saddle_exponent, tilt, turns)


def _counts(law: PerturbedLaw, values: dict[str, Any]) -> tuple[Array, Array]:
    """Numbers of equilibria under torques and without them; one everywhere if all is level."""
    cells = dict(zip(values, np.broadcast_arrays(*values.values()), strict=True))
    found, still = (np.ones(cells["torque"].shape, int) for _ in range(2))
    turned = cells["torque"] != 0.0
    if np.any(turned):
        own = {name: x[turned] for name, x in cells.items()}
        for count, torque in ((found, own["torque"]), (still, None)):
            count[turned] = _machines(law).resting(own, torque).n_equilibria
    return found, still


# ------------------------------------------------------------------------- energies


def potential(law: Routhians | PerturbedLaw, *inputs: npt.ArrayLike) -> Array:
    """Amended potential less torque times phi at phi, the last of the inputs, in J."""
    one, torque = _machines_of(law, inputs[:-1])
    phi = np.asarray(inputs[-1], float)
    return np.asarray(one.potential(phi)[0] - torque * phi)


def gradient(law: Routhians | PerturbedLaw, *inputs: npt.ArrayLike) -> Array:
    """Its first derivative at phi, the last of the inputs."""
    one, torque = _machines_of(law, inputs[:-1])
    return np.asarray(one.potential(np.asarray(inputs[-1], float))[1] - torque)


def curvature(law: Routhians | PerturbedLaw, *inputs: npt.ArrayLike) -> Array:
    """Its second derivative at phi, the last of the inputs."""
    one, torque = _machines_of(law, inputs[:-1])
    return np.asarray(one.potential(np.asarray(inputs[-1], float))[2] + 0.0 * torque)


def energy(law: Routhians | PerturbedLaw, *inputs: npt.ArrayLike) -> Array:
    """Energy of states (phi, dphi), the last of the inputs."""
    one, _ = _machines_of(law, inputs[:-2])
    phi, speed = (np.asarray(x, float) for x in inputs[-2:])
    return np.asarray(0.5 * one.inertia(phi)[0] * speed * speed + potential(law, *inputs[:-1]))


def phase_velocity(law: Routhians | PerturbedLaw, *inputs: npt.ArrayLike) -> Array:
    """Speed at phi on the level of an energy, the last of the inputs; NaN where out of reach."""
    one, _ = _machines_of(law, inputs[:-2])
    kinetic = np.asarray(inputs[-1], float) - potential(law, *inputs[:-1])
    inertia = one.inertia(np.asarray(inputs[-2], float))[0]
    return np.asarray(np.sqrt(2.0 * np.where(kinetic >= 0.0, kinetic, np.nan) / inertia))


def _machines_of(law: Routhians | PerturbedLaw, parameters: Any) -> tuple[Routhian, Any]:
    """The machines, and the torques on their shafts in N m."""
    if isinstance(law, Routhians):
        return law.with_values(law.values(*parameters)), 0.0
    values = law.values(*parameters)
    one = _machines(law).with_values(values)
    return one, values["torque"] * one.own_inertia


def _machines(law: PerturbedLaw) -> Routhians:
    base = law.base
    assert isinstance(base, Routhians)
    return base


# ------------------------------------------------------------------------- separatrices


def _along_separatrices(law: PerturbedLaw, parameters: Any) -> tuple[Loops, Array, Melnikov]:
    """Separatrices of the cells, the size of their energies, and Melnikov's function."""
    refuse_prescribed(law, "melnikov")
    values = law.values(*parameters)
    shape = np.broadcast_shapes(*(np.shape(x) for x in values.values()))
    flat = {n: np.array(np.broadcast_to(x, shape), float).reshape(-1) for n, x in values.items()}
    base = _machines(law)
    constants, own_inertia = base.constants_of(flat), base.with_values(flat).own_inertia
    weights = np.broadcast_to(np.asarray(own_inertia), flat["torque"].shape)
    columns = np.stack(
        [np.broadcast_to(constants[n], flat["torque"].shape) for n in base.constants]
        or [np.zeros(flat["torque"].shape)]
    )
    counts = _counts(law, flat)
    # Cells of one machine and momentum, under many drives, have the same motions.
    cells, which = np.unique(columns, axis=1, return_inverse=True)
    order = np.argsort(which.reshape(-1), kind="stable")
    parts: list[tuple[Loops, Array, Melnikov]] = []
    for start in range(0, order.size, CELLS):
        rows = order[start : start + CELLS]
        machines, own = np.unique(which.reshape(-1)[rows], return_inverse=True)
        known = [followed(base, cells[:, i], cells.shape[1] == 1) for i in machines]
        own_values = {name: x[rows] for name, x in flat.items()}
        weight = weights.reshape(-1)[rows, None, None]
        both = (counts[0][rows], counts[1][rows])
        parts.append(_part(law, known, own.reshape(-1), own_values, weight, both))
    width = max((part[0].loop.shape[1] for part in parts), default=0)
    fields = zip(*((*loops, size, *found) for loops, size, found in parts), strict=True)
    back = np.argsort(order)
    whole = [np.concatenate([_across(x, width) for x in field])[back] for field in fields]
    shaped = [x.reshape(shape + x.shape[1:]) for x in whole]
    number = len(Loops._fields)
    return Loops(*shaped[:number]), shaped[number], Melnikov(*shaped[number + 1 :])


def _part(
    law: PerturbedLaw, known: Sequence[Along | None], which: Any, values: dict[str, Array],
    weight: Array, counts: tuple[Array, Array],
) -> tuple[Loops, Array, Melnikov]:  # fmt: skip
    """The same of some cells in a row, each the machine of a number."""
    width = max((len(_loops(one).loop) for one in known), default=0)
    loops = Loops(
        *(np.stack([widened(name, getattr(_loops(one), name), width) for one in known])[which]
          for name in Loops._fields)
    )  # fmt: skip
    sizes = [np.nan if one is None else float(energy_size(one.ground.points)[0]) for one in known]
    size = np.array(sizes)[which]
    held = saddles_held(loops.loop, *counts)
    found: Melnikov | None = None
    for points in POINTS:
        moved = [motions_of(one, points) for one in known]
        time, phi, dphi, inertia = (
            np.stack([widened("", part, width) for part in parts])[which]
            for parts in zip(*moved, strict=True)
        )
        with np.errstate(all="ignore"):
            mobility = weight / inertia
        better, lost = along(law, Paths(time, phi, dphi, []), values, weight, held, mobility)
        if found is None:
            found, rows = better, np.flatnonzero(lost)
        else:
            fields: tuple[Any, ...] = found
            more: tuple[Any, ...] = better
            for field, values_ in zip(fields, more, strict=True):
                field[rows] = values_[rows]
        if not rows.size:
            break
    assert found is not None
    return loops, size, found


def _across(values: Any, width: int) -> Any:
    """Values of the saddles, on the second axis, of cells, and nothing where others have more."""
    if values.ndim < 2:
        return values
    return np.moveaxis(widened("", np.moveaxis(values, 1, 0), width), 0, 1)


def _loops(one: Along | None) -> Separatrices:
    return NOTHING if one is None else one.separatrices


@functools.lru_cache(maxsize=64)
def motions_of(one: Along | None, points: int) -> tuple[Array, Array, Array, Array]:
    """Times, angles and angular velocities along each separatrix, and the least inertia there."""
    k = _loops(one).saddle_exponent
    time = times_of(k, points)
    phi, dphi = np.full((2, len(k), 2, points + 1), np.nan)
    least = np.full((len(k), 2), np.nan)
    rows = np.flatnonzero(k > 0.0)
    if one is None or not rows.size:
        return time, phi, dphi, least
    ground = one.ground.take(np.zeros(rows.size, np.intp))
    owner = np.repeat(np.arange(rows.size), points + 1)
    for side, way in enumerate(SIDES):
        branch = branch_of(ground, one.saddles[rows], way)
        found = motion.separatrix_motion(branch, owner, time[rows].reshape(-1))
        s, speed = (x.reshape(rows.size, -1) for x in found[:2])
        angle = one.path.place(s)
        inertia = one.path.law.inertia(angle)[0]
        phi[rows, side], dphi[rows, side] = closed(angle, speed / np.sqrt(inertia))
        least[rows, side] = inertia.min(axis=-1)
    return time, phi, dphi, least
