"""Events on a motion: zeros of functions of time and state."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np
from scipy.optimize import brentq

from phasekit.motion.steps import Rates, Step


@dataclass(frozen=True)
class Event:
    """A function of (t, x) whose zeros are looked for along a motion.

    A pair of zeros within one step is not seen.
    """

    function: Rates
    terminal: int = 0
    """At which of its zeros the motion ends; 0: at none."""
    direction: float = 0
    """Only where the function rises (> 0) or falls (< 0) along the motion; 0: both."""

    def passes(self, before: float, after: float) -> bool:
        """Whether the values at the ends of a step have a zero between them."""
        rises, falls = before <= 0.0 <= after, before >= 0.0 >= after
        return (rises and self.direction >= 0) or (falls and self.direction <= 0)


@dataclass
class Watch:
    """Looks for an event, step by step."""

    event: Event
    value: float
    """That of its function at the end of the last step."""
    times: list[float] = field(default_factory=list)
    """Its zeros so far."""

    looked: bool = False
    rest: float | None = None
    """From where on it first vanished over a whole step."""
    resting: float | None = None
    """Up to where it did last."""

    def look(self, step: Step) -> float | None:
        """Time of a zero in the next step; where it vanishes from the start on, the start."""
        before, self.value = self.value, self.event.function(step.stop, step.after)
        first, self.looked = not self.looked, True
        if not self.event.passes(before, self.value):
            return None
        if before == 0.0:
            middle = 0.5 * (step.start + step.stop)
            if self.value == 0.0 and self.event.function(middle, step.dense(middle)) == 0.0:
                self.rest = step.start if self.rest is None else self.rest
                self.resting = step.stop
                if first:
                    self.times.append(step.start)
                return step.start if first else None
            if self.resting == step.start and self.value != 0.0:
                return None
        when = instant(lambda t: self.event.function(t, step.dense(t)), step.start, step.stop)
        if self.times and self.times[-1] == when:  # the end of the step before
            return None
        self.times.append(when)
        return when

    @property
    def ends(self) -> bool:
        """Whether the last zero is the one at which the motion ends."""
        return len(self.times) == self.event.terminal


def instant(function: Callable[[float], float], start: float, stop: float) -> float:
    """Time of a zero between two times at which the signs of a function differ.

    One of them, if rounding leaves the zero just outside.
    """
    left, right = function(start), function(stop)
    if not left * right < 0.0:
        return start if abs(left) < abs(right) else stop
    eps = float(np.finfo(float).eps)
    nearest = max(4 * eps * abs(stop - start), float(np.finfo(float).smallest_subnormal))
    when: float = brentq(function, start, stop, xtol=nearest, rtol=4 * eps, maxiter=1000)
    return when
