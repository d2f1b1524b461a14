"""Shares of the basins of attractors, cell by cell of a map."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from phasekit.arrays import Array
from phasekit.laws.perturbed import PerturbedConservative
from phasekit.motion.attractors import find
from phasekit.motion.basins import basins
from phasekit.motion.flow import accelerations
from phasekit.motion.lost import tell_open
from phasekit.motion.strobe import common_period

#: Attractors that have a place of their own in a map, and states along each side of the box.
SLOTS, SIDE = 8, 32
#: Every so many states of a side begin the search for attractors.
EVERY = 2


class Fractions(NamedTuple):
    """The group "basin_fractions", with the attractors on the last axis of the first three."""

    basin_fraction: Array
    basin_fraction_error: Array
    attractor_angle: Array
    remaining_fraction: Array
    n_attractors: npt.NDArray[np.int64]


def fractions(law: PerturbedConservative, *arrays: npt.ArrayLike) -> Fractions:
    """Shares of the basins in a box of states around rest at 0.

    Arrays are parameters, then halves of the box's sides. NaN, and -1 attractors, where there is no
    damping, no common period, or an invalid value.
    """
    given = np.broadcast_arrays(*(np.asarray(array, dtype=float) for array in arrays))
    shape = given[0].shape
    cells = np.stack([array.reshape(-1) for array in given], axis=-1)
    slots = [np.full((len(cells), SLOTS), np.nan) for _ in range(3)]
    remaining, number = np.full(len(cells), np.nan), np.full(len(cells), -1, np.int64)
    unseen: Counter[str] = Counter()
    for row, cell in enumerate(cells):
        values = law.values(*cell[:-2])
        leg = leg_of(law, values, cell[-2])
        damped = values["damping"] > 0.0 or values["quadratic"] > 0.0
        if not (np.isfinite(cell).all() and (cell[-2:] > 0.0).all() and damped and leg > 0.0):
            continue
        middle = (2.0 * np.arange(SIDE) + 1.0) / SIDE - 1.0
        phi, dphi = cell[-2] * middle, cell[-1] * middle
        some = np.stack(np.meshgrid(phi[::EVERY], dphi[::EVERY], indexing="ij"), axis=-1)
        search = find(law, values, leg, some.reshape(-1, 2))
        found = basins(search, {0: phi, 1: dphi})
        places = search.result().state[:, 0, 0]
        unseen += search.open
        columns = found.basin_fraction, found.basin_fraction_error, places
        for slot, column in zip(slots, columns, strict=True):
            slot[row, : len(column)] = column[:SLOTS]
        number[row] = len(places)
        remaining[row] = 1.0 - found.basin_fraction[:SLOTS].sum()
    tell_open("n_attractors", unseen)
    share, error, angle = (slot.reshape(*shape, SLOTS) for slot in slots)
    return Fractions(share, error, angle, remaining.reshape(shape), number.reshape(shape))


def leg_of(law: PerturbedConservative, values: Mapping[str, Array], reach: float) -> float:
    """Time from state to state: the period of what varies, else of the order of an oscillation.

    NaN without a common period. Where nothing oscillates, the time in which damping acts.
    """
    period = common_period(law, values)
    if period is not None:
        return float(period)
    phi = np.linspace(-reach, reach, 129)
    change = np.gradient(accelerations(law, values, 0.0, phi, 0.0), phi)
    stiffest = float(np.max(np.abs(change)))
    return float(0.5 * np.pi / np.sqrt(stiffest)) if stiffest > 0.0 else damping_time(values)


def damping_time(values: Mapping[str, Array]) -> float:
    """Time in which linear damping acts; 1 s without."""
    return float(1.0 / values["damping"]) if values["damping"] > 0.0 else 1.0
