"""Where one motion comes to after a time, and the derivative of that by the state at the start."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np

from phasekit.arrays import Array
from phasekit.laws.equations import Equations
from phasekit.laws.ladder import Map
from phasekit.laws.perturbed import PerturbedConservative
from phasekit.motion.equation_rates import pointwise, slopes_at
from phasekit.motion.flow import motions
from phasekit.motion.method import cells_of, single, turns_of, whole_turns
from phasekit.motion.steps import InitialValue, end_of

RTOL, ATOL = 1e-12, 1e-13
#: Steps of Newton's method, and the last, in units of the states.
NEWTON, LAST = 12, 1e-12
#: A step that rounding alone may make where a multiplier is near 1: it shrinks no more.
ROUNDED, SHRINKS = 1e-8, 0.3
#: Times the reach at which Newton's method is given up.
ASTRAY = 4.0
#: Tolerances of implicit steps, the last step of Newton's method then, and differences, in units.
STIFF, LAST_STIFF, BESIDE = (1e-11, 1e-13), 1e-6, 1e-4
#: Steps of a Python function's motion.
MOST = 100_000


def carried(
    law: PerturbedConservative | Equations, values: Mapping[str, Array], state: Array, time: float
) -> tuple[Array, Array]:
    """State after a time, or steps of a map, and its derivative; NaN where there is none."""
    n = len(state)
    if isinstance(law, Equations) and law.kind == "python":
        one = single(values)
        kind = _iterated if isinstance(law, Map) else _integrated
        found = kind(law, one, state, time)
    else:
        start, times = np.concatenate([state, np.eye(n).ravel()])[None], np.array([[time]])
        # So few motions do not pay for the machine code of series.
        how: Any = {"method": "dop853", "tangents": n}
        found = motions(law, values, start, times, RTOL, ATOL, **how).states[0, 0]
    return found[:n], found[n:].reshape(n, n).T


def carried_stiffly(
    law: Equations, values: Mapping[str, Array], state: Array, time: float, units: Array
) -> tuple[Array, Array]:
    """What `carried` gives, by implicit steps from states on both sides."""
    from phasekit.motion.legs import moved

    aside = BESIDE * np.diag(units)
    states = np.concatenate([state[None], state + aside, state - aside])
    cells = cells_of(values, np.zeros(len(states), int))
    ends = moved(law, cells, states, np.full((len(states), 1), time), *STIFF)[0][:, 0]
    sides = ends[1:].reshape(2, len(state), -1)
    return ends[0], ((sides[0] - sides[1]) / (2.0 * BESIDE * units[:, None])).T


class Return(NamedTuple):
    """A state to which a motion returns after a time."""

    x: Array
    slope: Array
    """Derivative of the state after it."""
    turned: Array
    """What angles have grown by."""


def returned(
    law: PerturbedConservative | Equations,
    values: Mapping[str, Array],
    state: Array,
    time: float,
    units: Array,
    reach: float,
    stiff: bool = False,
) -> Return | None:
    """The state near another to which a motion returns; None where Newton's method finds none.

    States are measured by units, and lie within reach; implicit steps have fewer digits.
    """
    x, turns = state, turns_of(law)
    before = np.inf
    last = LAST_STIFF if stiff else LAST
    for _ in range(NEWTON):
        if stiff:
            assert isinstance(law, Equations)
            image, slope = carried_stiffly(law, values, x, time, units)
        else:
            image, slope = carried(law, values, x, time)
        off = image - x
        turned = whole_turns(off, turns)
        try:
            step = np.linalg.solve(np.eye(len(x)) - slope, off - turned)
        except np.linalg.LinAlgError:
            return None
        if not np.isfinite(step).all():
            return None
        x, size = x + step, float(np.linalg.norm(step / units))
        gone = x - state
        away = float(np.linalg.norm((gone - whole_turns(gone, turns)) / units))
        if size < last or is_rounding(size, before):
            return Return(x, slope, turned) if away <= reach else None
        if away > ASTRAY * reach:
            return None
        before = size
    return None


def is_rounding(size: float, before: float) -> bool:
    """Whether a step of Newton's method, after another, is no more than rounding."""
    return ROUNDED > size > SHRINKS * before


def _iterated(law: Equations, values: Mapping[str, float], x: Array, count: float) -> Array:
    f, slope = pointwise(law, values), np.eye(len(x))
    for i in range(int(count)):
        slope, x = slopes_at(law, values, x, float(i)) @ slope, f(float(i), x)
    return np.concatenate([x, slope.T.ravel()])


def _integrated(law: Equations, values: Mapping[str, float], x: Array, time: float) -> Array:
    n, f = len(x), pointwise(law, values)

    def rates(t: float, y: Array) -> Array:
        moved = slopes_at(law, values, y[:n], t) @ y[n:].reshape(n, n).T
        return np.concatenate([f(t, y[:n]), moved.T.ravel()])

    start = [*x, *np.eye(n).ravel()]
    problem = InitialValue(rates, start, rtol=RTOL, atol=ATOL, unit=np.inf, most=MOST)
    return end_of(problem, time)
