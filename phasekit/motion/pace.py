"""How fast a flow goes: by which its states are measured, and times between looks at motions."""

from __future__ import annotations

import warnings
from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from phasekit.arrays import Array
from phasekit.laws.equations import Equations
from phasekit.laws.ladder import Map
from phasekit.motion import flows
from phasekit.motion.equation_rates import rates_on, slopes_at
from phasekit.motion.flow import motions
from phasekit.motion.method import few, single
from phasekit.motion.strobe import Steps, common_period, strobe

#: Part of a quarter of a turn in which a motion hardly turns.
FINE = 0.25
#: Part of the fastest turn that a leg lasts, and part of the box that motions go in one at least.
QUARTER, WAY = 0.25, 0.05
#: Legs at most in which the part of the box is gone.
LONGER = 100.0
#: States at which rates are asked for, and legs for which motions from them are followed.
SOME, FIRST = 32, 20
#: Steps at most of these motions, and of those of Python functions.
MOST, MOST_CALLED = 100_000, 1_000
#: Part of the greatest speed that counts as rest.
SLOW = 1e-3
#: How often as fast as all else what decays is where a flow is stiff, part of the states at which
#: it must be, and rates that are rounding.
SPLIT, MOSTLY, ROUNDED = 1e3, 0.9, 1e-13
#: Rate times leg from which on explicit steps are more than implicit ones.
STEPS = 3e3
#: Calls of f in an explicit step, its length times the rate of what decays, and rate times leg from
#: which on that makes steps short.
CALLS, LENGTH, SHORT = 12.0, 3.0, 200.0
#: Part of a leg between looks at a stiff motion that may come back.
SHARE = 1e-4


class Pace(NamedTuple):
    """Times of a flow."""

    leg: float
    """Between looks: a quarter of the fastest turn, or in which motions go a part of the box."""
    fine: float
    """Between which a motion hardly turns."""
    stiff: bool = False
    """Whether motions creep behind states that decay much faster."""


def pace_of(law: Equations, values: Mapping[str, Any], states: Array, units: Array) -> Pace:
    """How fast motions from some states go.

    States, of shape (n, states), are where motions start, and are measured by units.
    """
    starts = few(states, SOME)
    one = single(values)
    fast, speed = _stiffness(law, one, starts, units), _speeds(law, one, starts, units)
    leg = 2.0 * np.pi * QUARTER / fast if fast > 0.0 else 1.0
    if not fast > 0.0 and speed.size:
        leg = WAY / float(np.median(speed))
    times = np.broadcast_to(leg * np.arange(1.0, FIRST + 1.0), (len(starts), FIRST))
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", RuntimeWarning)
        if law.kind == "python":
            found, _ = flows.one_by_one(
                law, values, few(starts, 4), times[:4], None,
                {"rtol": 1e-6, "atol": 1e-8, "most": MOST_CALLED},
            )  # fmt: skip
        else:
            found = motions(law, values, starts, times, 1e-8, 1e-10, most=MOST).states
    seen = found.reshape(-1, len(units))
    seen = few(seen[np.isfinite(seen).all(axis=1)], 2 * SOME)
    if not len(seen):
        return Pace(leg, leg * FINE)
    fast, speed = _stiffness(law, one, seen, units), _speeds(law, one, seen, units)
    if fast > 0.0:
        leg = 2.0 * np.pi * QUARTER / fast
    fine, slow = leg * FINE, _slow(law, one, seen)
    if slow > 0.0:
        leg *= fast / slow
        fine = max(fine, SHARE * leg)
    moving = speed[speed > SLOW * speed.max()] if speed.size else speed
    if moving.size:
        leg = max(leg, min(WAY / float(np.median(moving)), LONGER * leg))
    return Pace(leg, fine, slow > 0.0)


def is_stiff(
    law: Equations, values: Mapping[str, Any], leg: float, states: Array, units: Array
) -> bool:
    """Whether motions creep behind states that decay so fast that explicit steps are too many."""
    starts = few(states, SOME)
    one = single(values)
    many = law.kind != "python" and _stiffness(law, one, starts, units) * leg > STEPS
    return many and _slow(law, one, starts) > 0.0


def calls_of(
    law: Equations, values: Mapping[str, Any], leg: float, states: Array, units: Array
) -> float:
    """How often a Python function is called in a leg, where its rates alone make steps short."""
    if law.kind != "python" or law.time is None or isinstance(law, Map):
        return 0.0
    one = single(values)
    rates = _stiffness(law, one, few(states, SOME), units) * leg
    return CALLS * rates / LENGTH if rates > SHORT else 0.0


def _slow(law: Equations, one: Mapping[str, float], x: Array) -> float:
    """Median of the rates that are left where others decay much faster; 0 of a law without such."""
    slopes = [slopes_at(law, one, state) for state in x]
    found = [_split(np.linalg.eigvals(jac)) for jac in slopes if np.isfinite(jac).all()]
    split = [rate for rate in found if rate > 0.0]
    return float(np.median(split)) if len(split) >= MOSTLY * len(x) else 0.0


def _split(eigenvalues: npt.NDArray[Any]) -> float:
    """Greatest rate but for those that decay much faster than it; 0 where none do."""
    order = np.argsort(-np.abs(eigenvalues))
    sizes, decays = np.abs(eigenvalues[order]), -eigenvalues[order].real
    for i in range(1, len(sizes)):
        if decays[i - 1] < 0.5 * sizes[i - 1] or sizes[i] < ROUNDED * sizes[0]:
            break
        if sizes[i - 1] > SPLIT * sizes[i]:
            return float(sizes[i])
    return 0.0


def _stiffness(law: Equations, one: Mapping[str, float], x: Array, units: Array) -> float:
    """Median of the size of derivatives at states; 0 where there are none."""
    slopes = np.array([slopes_at(law, one, state) for state in x]) * units / units[:, None]
    sizes = np.linalg.norm(slopes, axis=(1, 2))
    sizes = sizes[np.isfinite(sizes)]
    return float(np.median(sizes)) if sizes.size else 0.0


def _speeds(law: Equations, one: Mapping[str, float], x: Array, units: Array) -> Array:
    """Speeds at states where there is motion."""
    found = np.asarray(np.linalg.norm(rates_on(law, one, x) / units, axis=1))
    return np.asarray(found[np.isfinite(found) & (found > 0.0)])


def units_of(law: Equations, values: Mapping[str, Any], states: Array, widths: Array) -> Array:
    """By what states are measured: widths, of angles a radian, or what motions come to.

    Motions start at states, of shape (n, states), in ranges of such widths; 0 where unknown.
    """
    units = np.array(widths, float)
    unknown = ~(units > 0.0)
    for i, name in enumerate(law.states):
        if name in law.periods:
            units[i], unknown[i] = law.periods[name] / (2.0 * np.pi), False
    if not unknown.any():
        return units
    starts = few(states, SOME)
    rough = np.maximum(np.abs(starts).max(axis=0), 1.0)
    period, stiff = common_period(law, values), False
    leg = 1.0 if period is None else float(period) / 8.0
    if period is None and not isinstance(law, Map):
        leg, _, stiff = pace_of(law, values, starts, np.where(unknown, rough, units))
    found = strobe(law, values, starts, leg, 65, steps=Steps(stiff=stiff)).states
    seen = found.reshape(-1, units.size)
    seen = seen[np.isfinite(seen).all(axis=1) & (np.abs(seen) < 1e6 * rough).all(axis=1)]
    if not np.isfinite(found[:, 1:]).all(axis=2).any():  # states alone are no motions
        return np.where(unknown, rough, units)
    ranges = np.maximum(np.ptp(seen, axis=0), 1e-3 * np.abs(seen).max(axis=0))
    return np.where(unknown, np.where(ranges > 0.0, ranges, rough), units)
