"""Extremes of V' of any potential: the torques beyond which no equilibrium exists.

They are at zeros of V'', which is the slope of V' as a potential, or at the ends of an interval. On
a line without ends a polynomial V' is unbounded on one side at least.
"""

from __future__ import annotations

import functools
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from phasekit.arrays import Array
from phasekit.laws.derivatives import derivative
from phasekit.laws.formulas import symbols_of
from phasekit.phase.numerical.differences import survey
from phasekit.phase.numerical.formula import Formula, Shape, make_formula
from phasekit.phase.numerical.series import degrees
from phasekit.phase.numerical.systems import Systems, make_systems

_EPS = float(np.finfo(float).eps)


class CriticalTorque(NamedTuple):
    """Least and greatest V'; the last axis is the direction (minus, plus)."""

    critical_torque: Array
    critical_phi: Array
    critical_torque_error: Array
    """Estimated error of the torque."""
    critical_phi_error: Array
    """Bound of the error of the place."""
    critical_complete: npt.NDArray[np.bool_]
    """Whether all zeros of V'' are proved to be known."""


@functools.lru_cache(maxsize=128)
def slope_formula(formula: Formula) -> Formula:
    """V' as a potential of its own."""
    x = symbols_of((formula.coordinate,))[formula.coordinate]
    slope = derivative(formula.expression, x)
    return make_formula(slope, formula.coordinate, formula.names, formula.period, formula.interval)


def critical_torque(formula: Formula, *parameters: npt.ArrayLike) -> CriticalTorque:
    """Smallest and largest constant torque for which an equilibrium exists.

    On an interval that is one inside it; infinite where V' is unbounded.
    """
    formula.check_searchable()
    systems, shape = make_systems(slope_formula(formula), parameters)
    ground = survey(systems)
    points, blur = ground.points, ground.blur + _EPS * np.abs(ground.points.energy)
    ends = np.zeros(1) if formula.interval is None else np.array(formula.interval)
    at = np.broadcast_to(ends, (systems.size, ends.size))
    edge = formula.slopes(at, *systems.beside(at))
    if formula.interval is None:  # where V' is constant it has no place
        edge = np.where(points.n_equilibria[:, None] == 0, edge, np.nan)
        at = np.full(at.shape, np.nan)
    columns = [
        np.concatenate(pair, axis=1)
        for pair in (
            (points.energy, edge),
            (points.phi, at),
            (blur, 4.0 * _EPS * np.abs(edge)),
            (points.phi_error, 0.0 * at),
        )
    ]
    found = []
    for sign, limit in zip((-1.0, 1.0), _limits(formula, systems), strict=True):
        height = np.where(np.isfinite(columns[0]), sign * columns[0], -np.inf)
        # Of those that are equal within rounding the first.
        level = height.max(axis=1, keepdims=True) - np.nan_to_num(columns[2])
        first = np.argmax(height >= level, axis=1)[:, None]
        chosen = [np.take_along_axis(x, first, axis=1)[:, 0] for x in columns]
        free = np.isinf(limit)
        beyond: tuple[Any, ...] = (limit, np.nan, 0.0, np.nan)
        found.append([np.where(free, y, x) for x, y in zip(chosen, beyond, strict=True)])
    usable = systems.finite
    fields = [
        np.where(usable[:, None], np.stack(x, axis=-1), np.nan) for x in zip(*found, strict=True)
    ]
    complete = np.asarray(points.complete) & usable
    sides = [x.reshape((*shape, 2)) for x in fields]
    return CriticalTorque._make([*sides, complete.reshape(shape)])


def _limits(formula: Formula, systems: Systems) -> tuple[Array, Array]:
    """The least and the greatest limit of V' far out, where these are infinite; else 0."""
    low, high = np.zeros((2, systems.size))
    if formula.shape is Shape.POLYNOMIAL and not formula.bounded:
        powers = Systems(formula, systems.parameters, systems.size).coefficients()
        degree = degrees(powers)
        lead = powers[np.arange(systems.size), degree]
        odd, there = degree % 2 == 1, degree > 0
        low = np.where(there & (odd | (lead < 0.0)), -np.inf, low)
        high = np.where(there & (odd | (lead > 0.0)), np.inf, high)
    return low, high
