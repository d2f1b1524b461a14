"""One-dimensional invariant manifolds of equilibria of flows, followed by arclength."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from phasekit.errors import ConvergenceError
from phasekit.motion.steps import InitialValue, steps

Array = npt.NDArray[np.float64]

#: Distance from the equilibrium at which a manifold begins, over the size of the window: the
#: straight line leaves it by the square of that.
NEAR = 1e-6
#: Distance from another equilibrium at which it is reached, over the size of the window.
REACHED = 1e-5
#: Greatest distance between points, over the size of the window.
CLOSE = 1.0 / 200.0
#: Steps of the integrator.
MOST = 100_000


class Strand(NamedTuple):
    """One half of a manifold."""

    x: Array
    """States, of shape (points, states); the equilibrium first."""
    arclength: Array
    """Length from the equilibrium, in widths of the window."""
    end: str
    """Why it ends: window, equilibrium, length or lost."""
    reached: int
    """Number of the equilibrium that it comes to; -1: of none."""


def strand(
    rates: Callable[[float, Any], Array],
    start: Array,
    direction: Array,
    sense: float,
    window: tuple[Array, Array],
    rests: Array,
    length: float,
    rtol: float = 1e-9,
) -> Strand:
    """Follow the half of a manifold that begins in a direction.

    Parameters
    ----------
    rates : callable
        Of time and state.
    start, direction : array
        The equilibrium, and an eigenvector, in widths of the window.
    sense : {1.0, -1.0}
        Forward in time (unstable manifold) or backward.
    window : (array, array)
        Least and greatest states; where it leaves them, the manifold ends.
    rests : array, shape (n, states)
        Equilibria, at which it may end.
    length : float
        Greatest length, in widths of the window.
    """
    low, high = window
    width = high - low
    room = 0.02 * width

    def scaled(t: float, y: Array) -> Array:
        return sense * rates(t, low + y * width) / width

    first = (start - low) / width + NEAR * direction / np.linalg.norm(direction)
    others = (rests - low) / width
    points, total = [(start - low) / width, first], NEAR
    end, reached = "length", -1
    problem = InitialValue(
        scaled, list(first), rtol=rtol, atol=1e-12, unit=np.inf, most=MOST, max_step=np.inf
    )
    try:
        # The end is never reached: something else ends it before.
        for step in steps(problem, 1e300):
            chord = float(np.linalg.norm(step.after - step.before))
            many = int(min(max(np.ceil(chord / CLOSE), 1.0), 1_000.0))
            times = np.linspace(step.start, step.stop, many + 1)[1:]
            inner = step.dense(times).T if many > 1 else step.after[None]
            lengths = np.linalg.norm(np.diff(np.vstack([points[-1], inner]), axis=0), axis=1)
            for y, piece in zip(inner, lengths, strict=True):
                points.append(y)
                total += float(piece)
                at = low + y * width
                if np.any(at < low - room) or np.any(at > high + room):
                    end = "window"
                elif len(others):
                    away = np.linalg.norm(others - y, axis=1)
                    if away.min() < REACHED and total > 10.0 * REACHED:
                        end, reached = "equilibrium", int(np.argmin(away))
                if end != "length" or total >= length:
                    break
            if end != "length" or total >= length:
                break
    except (ConvergenceError, ValueError):
        end = "lost"
    found = np.array(points)
    pieces = np.linalg.norm(np.diff(found, axis=0), axis=1)
    arclength = np.concatenate([[0.0], np.cumsum(pieces)])
    return Strand(low + found * width, arclength, end, reached)
