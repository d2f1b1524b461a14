"""Motions whose damping is much faster than what they follow: by an implicit method.

An explicit method takes steps of the order of the time in which damping acts, however slowly the
motion goes on. Where these would be too many, Radau's method of order 5 takes its place, motion by
motion ([HairerNorsettWanner1993]; the implementation is SciPy's).
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np
import numpy.typing as npt

from phasekit.laws.perturbed import PerturbedConservative
from phasekit.motion.lost import ARRIVED, EXHAUSTED, FAILED

Array = npt.NDArray[np.float64]

#: Damping times duration from which on a motion is stiff: DOP853 would take a sixth as many steps.
STIFF = 6e6
#: Motions that are followed so at once: each takes seconds.
MOST_MOTIONS = 16
#: Evaluations of the law after which one is given up.
MOST_RATES = 300_000
#: Least relative tolerance that SciPy takes.
LEAST = 1e-13


class TooMany(Exception):
    """The law was evaluated too often."""


def stiff_cells(
    law: PerturbedConservative, values: Mapping[str, Array], times: Array, count: int
) -> Any:
    """Which of so many cells are stiff; none if they are too many, or the law has a kink."""
    reach = np.max(times, axis=1, initial=0.0)
    with np.errstate(all="ignore"):
        stiff = np.broadcast_to(values["damping"] * reach > STIFF, (count,))
    few = 0 < np.count_nonzero(stiff) <= MOST_MOTIONS
    smooth = not np.any(np.asarray(values["quadratic"]) != 0.0) and law.prescribed is None
    forward = not np.any(times < 0.0)
    return stiff if few and smooth and forward else np.zeros(count, bool)


def follow(
    rates: Callable[[float, Any], Any], state: Array, times: Array, rtol: float, atol: float
) -> tuple[Array, int]:
    """States of one motion at times >= 0, of shape (times, 2), and whether it came to its end."""
    from scipy.integrate import solve_ivp

    order = np.argsort(times)
    rising = times[order]
    asked = 0

    def counted(t: float, x: Any) -> Array:
        nonlocal asked
        asked += 1
        if asked > MOST_RATES:
            raise TooMany
        return np.asarray(rates(t, x))

    found = np.full((times.size, 2), np.nan)
    if not np.isfinite(state).all():
        return found, ARRIVED
    try:
        run = solve_ivp(
            counted, (0.0, rising[-1]), state, "Radau", rising, rtol=max(rtol, LEAST), atol=atol
        )
    except TooMany:
        return found, EXHAUSTED
    except ValueError:  # rates that are not finite
        return found, FAILED
    if not run.success:
        return found, FAILED
    found[order] = run.y.T
    return found, ARRIVED
