"""The level curves of one system in a potential, and the window that shows them."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from phasekit.phase.answers import answers
from phasekit.phase.level_curves import LevelCurves
from phasekit.systems.problem import Problem
from phasekit.systems.system import single


def curves_of(system: Any) -> LevelCurves:
    """Return the level curves of one system."""
    return LevelCurves.from_answers(answers(*single(system)))


def window_of_damped(system: Any, problem: Problem, window: Any) -> Any:
    """A window of a system with damping, where none is said: past its separatrices.

    Under a torque it reaches past the speed at which damping holds that.
    """
    if window is not None and not isinstance(window, Mapping):
        return window
    land = curves_of(system.system)
    x, v = problem.state[:2]
    reach = 1.42 * land.fastest(land.summit) or 1.0
    damping, torque = (abs(float(problem.parameters.get(n, 0.0))) for n in ("damping", "torque"))
    if damping > 0.0:
        reach = max(reach, 1.25 * torque / damping)
    known = {} if x in problem.periods else {x: land.window}
    return {**known, v: (-reach, reach), **(window or {})}
