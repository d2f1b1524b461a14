"""What is said of motions that did not come to their ends."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from typing import Any

import numpy as np
import numpy.typing as npt

from phasekit.errors import warn
from phasekit.laws.smoothness import SMOOTH

#: Steps that a motion may take.
MOST = 10_000_000
#: Of a law that jumps.
MOST_JUMPING = 200_000
#: States of a motion: none yet, under way, at its end; and of those that do not come to it: too
#: many steps, steps too short, a parameter that has no value.
IDLE, RUNNING, ARRIVED, EXHAUSTED, FAILED, INVALID = range(6)
#: And of those whose crossings are looked for: no more room, outside of a box, at a point of rest,
#: of which there may be several, numbered on from here.
CROWDED, LEFT, RESTING = 6, 7, 8
#: Of one that ends where the law has no value.
UNDEFINED = -1
#: Of one that meets a jump of the law, and may stick to it.
STUCK = -2
#: Of one that ends at a jump of the law in time.
LEAPT = -3

REASONS = {
    EXHAUSTED: f"they take more than {MOST} steps: try a shorter time or a larger rtol; strong "
    "damping makes steps short",
    FAILED: "their steps become too short: they run to infinity, or the law has no value there",
    UNDEFINED: "the law has no value where they end",
    STUCK: "they take too many steps where the law jumps: dry friction holds a motion so, of which "
    f"steps see no more; smooth it: {SMOOTH}",
    LEAPT: "the law jumps in time where they end, by more than the shortest step can take; smooth "
    f"it: {SMOOTH}",
    INVALID: "their parameters are invalid",
}


def judged(status: npt.NDArray[np.int64], parameters: npt.NDArray[np.float64]) -> None:
    """Mark the motions that failed for want of a parameter, of shape (parameters, cells)."""
    status[(status == FAILED) & ~np.isfinite(parameters).all(axis=0)] = INVALID


def stuck(law: Any, status: npt.NDArray[np.int64]) -> None:
    """Mark the motions of a law that jumps which took too many steps."""
    if getattr(law, "jumps", False):
        status[status == EXHAUSTED] = STUCK


def tell(
    quantity: str,
    status: npt.NDArray[np.int64],
    states: npt.NDArray[np.float64],
    raised: Collection[str] = (),
) -> None:
    """Say how many motions did not come to their ends, and why; invalid starts are no motions."""
    valid = np.isfinite(states).all(axis=1)
    for code, reason in REASONS.items():
        lost = valid & (status == code)
        if code in (FAILED, UNDEFINED) and raised:
            reason = f"{REASONS[UNDEFINED]}: f raised {min(raised)[:200]}"
        if lost.any():
            warn(
                f"{quantity}: {lost.sum()} of {lost.size} motions end before their last time, "
                f"because {reason}",
                RuntimeWarning,
            )


def tell_open(quantity: str, numbers: Mapping[str, int]) -> None:
    """Say of how many motions, by the reason, it was not seen where they end."""
    for reason, number in numbers.items():
        if number:
            warn(
                f"{quantity}: {number} of the motions that were followed {reason}: there may be "
                "attractors that are not found, and states are undecided",
                RuntimeWarning,
            )
