"""What the page of equations begins with: windows, ranges, times, curves over two parameters."""

from __future__ import annotations

import warnings
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from phasekit.arrays import Array
from phasekit.explorer.curves import bifurcation_curves
from phasekit.explorer.equations import check_equations, facts_of_equations, time_shown
from phasekit.labelled.motion import flow
from phasekit.labels.arguments import bad, number, reals, unknown
from phasekit.labels.units import grammar
from phasekit.motion.kernels import rosenbrock
from phasekit.systems.parameter import Parameter
from phasekit.systems.problem import Problem
from phasekit.systems.rests import corners, equilibria_of
from phasekit.systems.system import System

#: How far sliders of equations go, in values at the start: below and above.
BELOW, ABOVE = 1.0, 4.0
#: How far beside a start at rest a motion begins that shows where others go.
BESIDE = 1e-2
#: Most states of which equilibria are looked for when the page is built.
SEARCHED = 6


def explored_facts(
    system: System,
    problem: Problem,
    *,
    over: Any,
    ranges: Mapping[str, Sequence[float]] | None,
    window: Mapping[str, Sequence[float]] | None,
    plane: Sequence[str] | None,
    duration: float | None,
) -> dict[str, Any]:
    """Check what the page of equations is asked for, and compute what stands in it."""
    check_equations(problem)
    sliders = _ranges(problem, ranges)
    pairs = _pairs(problem, over)
    if duration is not None:
        number("duration", duration, "a number > 0")
        if not duration > 0.0:
            raise bad("duration", duration, "a number > 0")
        if problem.map and not (duration <= 1e5 and duration == int(duration)):
            raise bad("duration", duration, "a whole number from 1 to 100000 for a map")
    shown = _plane(problem, plane)
    box = _box(system, problem, window, duration)
    rests = np.empty((0, len(problem.state)))
    if problem.time is None and len(problem.state) <= SEARCHED:
        rests = equilibria_of(problem, *box).x
    facts = facts_of_equations(problem, box, sliders)
    if system is not problem:
        facts["model"] = type(system).__name__
    facts["plane"] = list(shown)
    facts["duration"] = float(time_shown(problem, box, rests) if duration is None else duration)
    facts["maps"] = [
        bifurcation_curves(problem, pair, {name: sliders[name] for name in pair}, rests)
        for pair in pairs
    ]
    facts["written"] = grammar()
    if not problem.map:
        facts["rodas"] = {
            "gamma": rosenbrock.GAMMA,
            "a": rosenbrock.A.tolist(),
            "c": rosenbrock.C.tolist(),
            "times": rosenbrock.TIMES.tolist(),
            "rates": rosenbrock.RATES.tolist(),
        }
    return facts


def _ranges(
    problem: Problem, given: Mapping[str, Sequence[float]] | None
) -> dict[str, tuple[float, float]]:
    """The ranges of all sliders."""
    if given is not None and not isinstance(given, Mapping):
        raise bad("ranges", given, "a mapping from parameters to (low, high)")
    given = given or {}
    for name in given:
        if name not in problem.parameters:
            raise unknown("ranges: parameter", name, problem.parameters)
    found = {}
    for one in problem.declared:
        value = problem.parameters[one.name]
        if one.name not in given:
            like = [
                abs(problem.parameters[p.name]) for p in problem.declared if p.units == one.units
            ]
            found[one.name] = default_range(one, value, max(like) or 1.0)
            continue
        wants = f"two finite numbers, low < high, round the value {value:.6g}"
        pair = reals(f"ranges[{one.name!r}]", given[one.name], wants)
        whole = pair.shape == (2,) and np.isfinite(pair).all()
        if not whole or not pair[0] < pair[1] or not pair[0] <= value <= pair[1]:
            raise bad(f"ranges[{one.name!r}]", given[one.name], wants)
        found[one.name] = float(pair[0]), float(pair[1])
    return found


def default_range(parameter: Parameter, value: float, size: float) -> tuple[float, float]:
    """A range round a value, of a parameter whose like are of a size; its domain where finite.

    >>> default_range(Parameter(units="m", long_name="height"), 2.0, 1.0)
    (-2.0, 8.0)
    >>> default_range(Parameter(units="m", long_name="height", low=0.0), -0.0, 1.0)
    (0.0, 1.0)
    """
    reach = min(max(abs(value) or size, 1e-150), 1e150)
    ends = (-size, size) if value == 0.0 else (-BELOW * reach, ABOVE * reach)
    if value < 0.0:
        ends = -ends[1], -ends[0]
    low = max(ends[0], parameter.low)
    if parameter.positive and low <= 0.0:
        low = 0.01 * reach
    return float(min(low, value) + 0.0), float(max(min(ends[1], parameter.high), value))


def _pairs(problem: Problem, over: Any) -> list[tuple[str, str]]:
    """The pairs of parameters over which curves are computed."""
    names = list(problem.parameters)
    if over is None:
        few = problem.time is not None or len(names) < 2 or len(problem.state) > SEARCHED
        return [] if few else [(names[0], names[1])]
    wants = f"a pair of the parameters {', '.join(names)}, or several"
    if isinstance(over, str) or not isinstance(over, Sequence):
        raise bad("over", over, wants)
    single_pair = len(over) > 0 and all(isinstance(one, str) for one in over)
    pairs = [tuple(over)] if single_pair else [tuple(one) for one in over if _listed(one)]
    if not single_pair and len(pairs) != len(over):
        raise bad("over", over, wants)
    for pair in pairs:
        if len(pair) != 2 or pair[0] == pair[1]:
            raise bad("over", over, wants)
        for name in pair:
            if name not in problem.parameters:
                raise unknown("over: parameter", name, problem.parameters)
    if pairs and problem.time is not None:
        raise bad("over", over, "nothing for a forced system, which has no equilibria")
    return [(str(a), str(b)) for a, b in pairs]


def _listed(given: Any) -> bool:
    return isinstance(given, Sequence) and not isinstance(given, str)


def _plane(problem: Problem, plane: Sequence[str] | None) -> tuple[str, str]:
    """Two states; the only one twice."""
    names = problem.state
    if plane is None:
        return names[0], names[min(1, len(names) - 1)]
    if not _listed(plane) or len(plane) != 2 or plane[0] == plane[1]:
        raise bad("plane", plane, f"two of the states {', '.join(names)}")
    for name in plane:
        if name not in names:
            raise unknown("plane: state", name, names)
    return plane[0], plane[1]


def _box(
    system: System, problem: Problem, window: Any, duration: float | None
) -> tuple[Array, Array]:
    """The window; of states without one, where the motion from the start goes."""
    if window is not None and not isinstance(window, Mapping):
        raise bad("window", window, "a mapping from states to (low, high)")
    known = {**problem.window, **(window or {})}
    for name in known:
        if name not in problem.state:
            raise unknown("window: state", name, problem.state)
    missing = [n for n in problem.state if n not in known and n not in problem.periods]
    if missing and system.standing.traits is not None:
        from phasekit.systems.levels import window_of_damped

        return corners(problem, window_of_damped(system, problem, window), "window")
    if not missing:
        turns = {n: (-0.5 * p, 0.5 * p) for n, p in problem.periods.items()}
        return corners(problem, {**turns, **known}, "window")
    if set(problem.start) != set(problem.state):
        hint = f"window={{{missing[0]!r}: (low, high)}}; start= of all states would do as well"
        raise bad("window", known or None, f"a range of {', '.join(missing)}", hint)
    return corners(problem, {**known, **ranges_from_start(problem, missing, duration)}, "window")


def ranges_from_start(
    problem: Problem, names: Sequence[str], duration: float | None
) -> dict[str, tuple[float, float]]:
    """Where the motion from the start goes, of some states; of one at rest, a motion beside it."""
    start = np.array([problem.start[name] for name in problem.state])
    time = duration or time_shown(problem, (start - 1.0, start + 1.0), start[None])
    times = np.arange(int(time) + 1.0) if problem.map else np.linspace(0.0, time, 2001)
    for aside in (0.0, BESIDE):
        from_ = start + aside * np.maximum(np.abs(start), 1.0)
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", RuntimeWarning)
            motion = flow(problem, dict(zip(problem.state, from_, strict=True)), times)
        values = {name: motion[f"motion_{name}"].values for name in problem.state}
        if any(np.ptp(one) > 0.0 for one in values.values()):
            break
    ends = dict[str, tuple[float, float]]()
    for name in names:
        if not np.isfinite(values[name]).all():
            raise bad("window", None, f"a range of {name}, whose motion from the start has no end")
        low, high = float(values[name].min()), float(values[name].max())
        margin = 0.2 * (high - low) or 0.2 * max(abs(low), 1.0)
        ends[name] = low - margin, high + margin
    return ends
