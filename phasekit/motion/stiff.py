"""Motions whose damping is much faster than what they follow: by an implicit method.

An explicit method takes steps of the order of the time in which damping acts, however slowly the
motion goes on. Where these would be too many, Radau's method of order 5 takes its place, motion by
motion ([HairerWanner1996] IV.8; the implementation is SciPy's).
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

from phasekit.arrays import Array
from phasekit.laws.perturbed import PerturbedLaw
from phasekit.motion.steps import InitialValue, followed

#: Damping times duration from which on a motion is stiff: DOP853 would take about the most steps
#: that a motion may take.
STIFF = 6e7
#: Steps after which one is given up: of some ten rates each, or seconds in all.
MOST_STEPS = 30_000
#: Least relative tolerance that SciPy takes.
LEAST = 1e-13


def stiff_cells(law: PerturbedLaw, values: Mapping[str, Array], times: Array, count: int) -> Any:
    """Which of so many cells are stiff at times > 0; none of those whose law has a kink."""
    reach = np.max(times, axis=1, initial=0.0, where=np.isfinite(times))
    with np.errstate(all="ignore"):
        stiff = values["damping"] * reach > STIFF
    smooth = (np.asarray(values["quadratic"]) == 0.0) & (law.prescribed is None)
    return np.broadcast_to(stiff & smooth, (count,))


def follow(
    rates: Callable[[float, Any], Any], state: Array, times: Array, **tolerances: Any
) -> Array:
    """States of one motion at times, of shape (times, 2): NaN before 0, and once it is given up.

    Tolerances are those of an `InitialValue`.
    """
    from scipy.integrate import Radau

    tolerances |= {"rtol": max(tolerances["rtol"], LEAST), "most": MOST_STEPS, "method": Radau}
    problem = InitialValue(rates, list(state), **tolerances)
    return followed(problem, np.where(times >= 0.0, times, np.nan))[0]
