"""Action-angle coordinates both ways. Arrays in, arrays out."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from phasekit.arrays import Array
from phasekit.errors import OrbitFamily, ParameterError, Topology
from phasekit.numerics.launch import Arrays, launch
from phasekit.phase.exact.kernels import portrait as kernels
from phasekit.phase.exact.orbits import Orbits, allocate
from phasekit.phase.exact.phase_space import separatrices
from phasekit.phase.exact.states import Systems, flat, systems

TWO_PI = 2.0 * np.pi
ROUNDINGS = 8.0 * 2.0**-52


class Angles(NamedTuple):
    """Where a state stands on its orbit, besides what `Orbits` says."""

    orbit_family: npt.NDArray[np.int8]
    """`OrbitFamily`."""
    angle: Array
    """Angle variable in [0, 2 pi), rad: 0 at the greatest phi of a libration and at the lower
    center for a rotation; it grows at the orbit's frequency. NaN where the motion has no period."""
    twist: Array
    """d(frequency)/d(action), 1: how fast neighboring orbits drift apart."""


class ActionAngle(NamedTuple):
    """Action-angle coordinates of states."""

    orbit_family: npt.NDArray[np.int8]
    """`OrbitFamily`."""
    action: Array
    """Action J, rad^2/s."""
    angle: Array
    """Angle variable in [0, 2 pi), rad."""
    frequency: Array
    """d(angle)/dt = dh/dJ, rad/s."""
    twist: Array
    """d(frequency)/dJ, 1."""


class State(NamedTuple):
    """States on the cylinder."""

    phi: Array
    """Angle in [-pi, pi], rad."""
    dphi: Array
    """Angular velocity, 1/s."""


class NumberedState(NamedTuple):
    """States by action and angle, named as the quantities are."""

    phi_of_angle: Array
    dphi_of_angle: Array


def orbits_with_angles(
    A: npt.ArrayLike,
    B: npt.ArrayLike,
    C: npt.ArrayLike,
    phi: npt.ArrayLike,
    dphi: npt.ArrayLike,
    *,
    threads: int | None = None,
) -> tuple[Orbits, Angles]:
    """Orbits through states, and where on them the states stand, in one pass."""
    cells = systems(A, B, C, threads)
    shape = np.broadcast_shapes(cells.shape, np.shape(phi), np.shape(dphi))
    arrays = (cells.rows, cells.numbers(shape), flat(phi, shape), flat(dphi, shape))
    out = allocate(shape)
    size = out[0].size
    angles: Arrays = (np.empty(size, np.int8), np.empty(size), np.empty(size))
    launch(kernels.action_angle, arrays, size, (out, angles), threads)
    return (
        Orbits.from_kernel(out, shape),
        Angles(*(array.reshape(shape) for array in angles)),
    )


def action_angle(
    A: npt.ArrayLike,
    B: npt.ArrayLike,
    C: npt.ArrayLike,
    phi: npt.ArrayLike,
    dphi: npt.ArrayLike,
    *,
    threads: int | None = None,
) -> ActionAngle:
    """Action-angle coordinates of states: in them every motion is uniform.

    Equilibria and separatrices are of the family none and have no angle.
    """
    orbits, angles = orbits_with_angles(A, B, C, phi, dphi, threads=threads)
    return ActionAngle(
        angles.orbit_family, orbits.action, angles.angle, orbits.frequency, angles.twist
    )


def state_of(
    A: npt.ArrayLike,
    B: npt.ArrayLike,
    C: npt.ArrayLike,
    action: npt.ArrayLike,
    angle: npt.ArrayLike,
    family: npt.ArrayLike,
    *,
    threads: int | None = None,
) -> State:
    """States that have given action-angle coordinates: the inverse of `action_angle`.

    The family is an `OrbitFamily`; NaN where it has no orbit of that action.
    """
    codes = [member.value for member in OrbitFamily]
    if not np.isin(family, codes).all():
        raise ParameterError(f"family: got {family!r}, wants values of OrbitFamily")
    cells = systems(A, B, C, threads)
    shape = np.broadcast_shapes(cells.shape, *(np.shape(x) for x in (action, angle, family)))
    index = cells.numbers(shape)
    member = flat(family, shape)
    value = flat(action, shape)
    least, most = (limit[index, member.astype(int) + 1] for limit in _limits(cells))
    # Actions next to a separatrix are those on it within rounding.
    member[~((value >= least * (1.0 - ROUNDINGS)) & (value <= most * (1.0 + ROUNDINGS)))] = np.nan
    value = np.clip(value, least, most)
    arrays = (cells.rows, index, member, value, flat(angle, shape))
    out = (np.empty(value.size), np.empty(value.size))
    launch(kernels.state_of, arrays, value.size, (out,), threads)
    return State(*(array.reshape(shape) for array in out))


def _limits(cells: Systems) -> tuple[Array, Array]:
    """Limits of each family with a row for each system, in the order of `OrbitFamily` from -1."""
    loops = separatrices(cells.A, cells.B, cells.C)
    phi = cells.points.phi
    n = cells.A.size
    least = np.full((n, 7), np.nan)
    most = np.full((n, 7), np.nan)
    moving = cells.points.n_equilibria >= 0
    lobes = loops.lobe_area / TWO_PI
    winding = loops.winding_area / TWO_PI
    # The lobe on the right holds the lower center if that comes before the upper saddle.
    first = np.mod(phi[:, 0] - phi[:, 1], TWO_PI) < np.mod(phi[:, 3] - phi[:, 1], TWO_PI)
    eight = loops.topology == Topology.FIGURE_EIGHT
    cycle = loops.topology == Topology.HETEROCLINIC
    single = loops.topology == Topology.WINDING
    wells = np.where(first[:, None], lobes[:, 0, ::-1], lobes[:, 0])
    outer = 2.0 * winding[:, 1]
    pairs = eight | cycle
    most[pairs, 2:4] = wells[pairs]
    least[pairs, 2:4] = 0.0
    most[single, 2] = outer[single]
    least[single, 2] = 0.0
    least[eight, 4] = wells[eight].sum(axis=1)
    most[eight, 4] = outer[eight]
    top = np.where(cycle, 0.5 * wells.sum(axis=1), winding[:, 1])
    top = np.where(cells.points.n_equilibria == 0, 0.0, top)
    least[moving, 5:] = top[moving, None]
    most[moving, 5:] = np.inf
    return least, most


def state_of_numbers(
    A: npt.ArrayLike,
    B: npt.ArrayLike,
    C: npt.ArrayLike,
    action: npt.ArrayLike,
    angle: npt.ArrayLike,
    family: npt.ArrayLike,
) -> NumberedState:
    """`state_of` for families that are kept as floats; what is no code of one gives NaN."""
    known = [family.value for family in OrbitFamily if family > 0]
    codes = np.where(np.isin(family, known), family, OrbitFamily.NONE)
    return NumberedState(*state_of(A, B, C, action, angle, codes.astype(np.int8)))
