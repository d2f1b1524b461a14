"""Events on a motion: zeros of functions of time and state."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from phasekit.inputs import call_checked
from phasekit.motion.steps import Step
from phasekit.pickles import Stamped

#: Ends of the pieces in which a step is looked at.
PIECES = (0.0, 0.25, 0.5, 0.75, 1.0)
#: A function that comes so near to zero, as part of its values around, touches it.
TOUCH = 1e-8


@dataclass(frozen=True)
class Event(Stamped):
    """A formula or function whose zeros are looked for along a motion.

    Parameters
    ----------
    function : str, sympy.Expr or callable
        A formula of states, parameters and time; or a function of (t, x), of systems of one
        coordinate of (t, phi, dphi).
    terminal : int, default 0
        At which of its zeros the motion ends; 0: at none.
    direction : {0, 1, -1}
        Only where the function rises (1) or falls (-1) along the motion; 0: both.

    Notes
    -----
    A step is looked at in quarters, and where the function turns towards zero between them. Zeros
    that lie more closely, several in a quarter, may be missed.

    Examples
    --------
    >>> import phasekit as pk
    >>> ball = pk.Problem({"h": "v", "v": "-g"}, parameters={"g": [9.81, 1.62]})
    >>> down = pk.Event("h", terminal=1, direction=-1)
    >>> pk.flow(ball, [1.0, 0.0], [0.0, 9.0], events={"ground": down}).event_time.values.round(3)
    array([[0.452],
           [1.111]])
    """

    function: Any
    terminal: int = 0
    direction: float = 0


Event.__init__ = call_checked(Event.__init__, "Event")  # type: ignore[method-assign]


def passes(event: Event, before: float, after: float) -> bool:
    """Whether the values at the ends of a step have a zero between them, passed as is wanted."""
    rises, falls = before <= 0.0 <= after, before >= 0.0 >= after
    return (rises and event.direction >= 0) or (falls and event.direction <= 0)


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
    """From where on it first vanished over a whole piece of a step."""
    resting: float | None = None
    """Up to where it did last."""
    behind: tuple[float, float, Any] | None = None
    """Time and value a piece before the end of the last step, and the motion there."""

    def look(self, step: Step) -> list[float]:
        """Times of zeros in the next step; where it vanishes from the start on, the start."""
        function, dense = self.event.function, step.dense
        times = [step.start + part * (step.stop - step.start) for part in PIECES]
        values = [self.value, *(function(t, dense(t)) for t in times[1:-1])]
        values.append(function(step.stop, step.after))
        self.value = values[-1]
        found = []
        for k in range(len(times) - 1):
            found += self._between(times[k : k + 2], values[k : k + 2], dense)
        if self.behind is not None:  # a turn may lie where two steps meet
            t, value, before = self.behind
            times, values = [t, *times], [value, *values]
        else:
            before = dense

        def value_at(t: float) -> float:
            own = before if abs(t - times[0]) < abs(step.start - times[0]) else dense
            return float(function(t, own(t)))

        for k in range(1, len(times) - 1):
            found += self._touches(times[k - 1 : k + 2], values[k - 1 : k + 2], value_at)
        self.behind = (times[-2], values[-2], dense)
        self.looked = True
        kept = []
        for when in sorted(found, key=lambda t: abs(t - times[0])):
            if not self.ends and not (self.times and self.times[-1] == when):
                self.times.append(when)
                kept.append(when)
        return kept

    def _between(self, times: list[float], values: list[float], dense: Any) -> list[float]:
        """The zero in a piece at whose ends the signs differ, or vanish."""
        (start, stop), (before, after) = times, values
        first = not self.looked and self.behind is None and self.rest is None
        if not passes(self.event, before, after):
            return []
        if before == 0.0:
            middle = 0.5 * (start + stop)
            if after == 0.0 and self.event.function(middle, dense(middle)) == 0.0:
                self.rest = start if self.rest is None else self.rest
                self.resting = stop
                return [start] if first else []
            if self.resting == start and after != 0.0:
                return []
        return [instant(lambda t: self.event.function(t, dense(t)), start, stop)]

    def _touches(
        self, times: list[float], values: list[float], function: Callable[[float], float]
    ) -> list[float]:
        """Zeros next to a turn of the function between values of one sign: two, one or none.

        Where it comes to zero within what the motion itself may be wrong by, it touches.
        """
        from scipy.optimize import minimize_scalar

        sign = 1.0 if values[1] > 0.0 else -1.0
        left, middle, right = (sign * value for value in values)
        if not (0.0 < middle <= min(left, right)) or middle == max(left, right):
            return []
        low, high = sorted((times[0], times[2]))
        turn, least, part = times[1], middle, high - low
        for _ in range(2):  # then nearby, where a corner shows
            ends = max(low, turn - part) - turn, min(high, turn + part) - turn
            near = minimize_scalar(
                lambda s, turn=turn: sign * function(turn + s), bounds=ends, method="bounded",
                options={"xatol": 1e-9 * part},
            )  # fmt: skip
            if near.fun < least:
                turn, least = turn + float(near.x), near.fun
            part *= 1e-6
        if least < 0.0:
            rises = ((times[0], turn, values[0]), (turn, times[2], -values[0]))
            return [instant(function, a, b) for a, b, at in rises if passes(self.event, at, -at)]
        touches = least <= TOUCH * max(left, right) and self.event.direction == 0
        return [turn] if touches else []

    @property
    def ends(self) -> bool:
        """Whether the last zero is the one at which the motion ends."""
        return len(self.times) == self.event.terminal > 0


def instant(function: Callable[[float], float], start: float, stop: float) -> float:
    """Time of a zero between two times at which the signs of a function differ.

    One of them, if rounding leaves the zero just outside.
    """
    from scipy.optimize import brentq

    left, right = function(start), function(stop)
    if not min(left, right) < 0.0 < max(left, right):
        return start if abs(left) < abs(right) else stop
    eps = float(np.finfo(float).eps)
    nearest = max(4 * eps * abs(stop - start), float(np.finfo(float).smallest_subnormal))
    when: float = brentq(function, start, stop, xtol=nearest, rtol=4 * eps, maxiter=1000)
    return when
