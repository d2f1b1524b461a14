"""Where curves of connecting orbits end: at Bogdanov-Takens points, and as equilibria soften."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from phasekit.arrays import Array
from phasekit.bifurcation.continuation.curve import Stop
from phasekit.cycles.connections import ends_of, spectra
from phasekit.cycles.cycles import Orbit, where
from phasekit.cycles.double_zero import double_zero_near
from phasekit.cycles.point import Point, State

# Real part of an eigenvalue, beside the largest size, at which an end is not hyperbolic.
LOST = 1e-6
SLOWER = 1e-2  # beside the largest, below which an eigenvalue ends a curve known to get slower
SHRUNK = 1e-2  # extent, beside that of the start, of an orbit that shrinks to its equilibrium
SMALL = 0.1  # extent of an orbit, on scaled axes, that can be beside a Bogdanov-Takens point
BESIDE, AFAR = 2e-4, 1e-2  # how near that is, on scaled axes, at the end; if steps are short there
SHORT, FIRST = 0.03, 8  # parts of that distance that are short steps; those from a start may be
# Parts of their spans by which parameters move while the time grows e-fold there, and where no step
# succeeds.
NEARLY, STUCK = 2e-4, 3e-3
BACK, PART = 1e-3, 0.3  # logarithm of a time, and the part of it by which eigenvalues change


def slowing(bounded: Any, orbit: Orbit, dx: Array, dy: Array, within: float = NEARLY) -> bool:
    """Whether the time of orbits grows next to where they are, as an eigenvalue comes to zero.

    It does if parameters move within so much of their spans while it grows e-fold.
    It grows also where they pass another equilibrium, but eigenvalues stay then.
    """
    rate = float(dy[0] / orbit.y[0])
    if not rate > 0.0 or float(np.max(np.abs(dy[1:]) / bounded.width)) > within * rate:
        return False
    step = BACK / rate
    before = Orbit(orbit.mesh, orbit.x - step * dx, orbit.y - step * dy)
    slowest = []
    for one in (before, orbit):
        found = spectra(bounded, one)
        if found is None or not (len(found.out) and len(found.into)):
            return False
        slowest.append(min(abs(found.out[0].real), abs(found.into[0].real)))
    return bool(min(slowest) > 0.0 and math.log(slowest[0] / slowest[1]) > PART * BACK)


def passing(bounded: Any, orbit: Orbit) -> float:
    """How far from zero the other eigenvalues are, by which the orbit neither leaves nor arrives.

    It is positive while the ends have the dimensions that they are counted by.
    """
    found = spectra(bounded, orbit)
    if found is None or ends_of(bounded).same:  # by all of its eigenvalues it leaves or arrives
        return math.nan
    away, back = found.others
    return float(np.min(np.concatenate([-away.real, back.real, [math.inf]])))


def passed(bounded: Any, orbit: Orbit) -> tuple[str, str]:
    """The end of a curve of connections where such an eigenvalue vanishes."""
    found = spectra(bounded, orbit)
    assert found is not None
    pairs = zip(found.others, ("source", "target"), strict=True)
    _, value, end = min((abs(float(one.real)), one, end) for values, end in pairs for one in values)
    kind = "shilnikov_hopf" if value.imag else "non_central_saddle_node"
    which = "a pair of eigenvalues" if value.imag else "an eigenvalue"
    return kind, (
        f"{which} of the {end} by which the orbit does not go comes to zero: beyond, such orbits "
        "come in families, and that of the fastest directions is not followed"
    )


def shrinking(bounded: Any, made: Orbit, dy: Array, step: float = 0.0) -> str:
    """Words for the Bogdanov-Takens point that a curve of small loops comes to; "" if to none.

    It does if that is ahead, and near on scaled axes: beside a step, or anyway. Next to it Newton's
    method has an ever smaller basin: b1 of the normal form goes with the square of the size of the
    loops, their tangent with the size, so that steps go with its power 3/2.
    """
    rests = ends_of(bounded).rests(bounded, made) if ends_of(bounded).same else None
    if rests is None or bounded.q != 3:
        return ""
    size = float(np.max(np.ptp(made.x, axis=0) / bounded.scale))
    if size > SMALL:
        return ""
    found = double_zero_near(bounded, rests[0], made.y)
    if found is None:
        return ""
    x, p = found
    gap = float(np.max(np.abs(np.concatenate([
        (x - rests[0].x) / bounded.scale, (p - made.y[1:]) / bounded.width,
    ]))))  # fmt: skip
    ahead = float(((p - made.y[1:]) / bounded.width) @ (dy[1:] / bounded.width))
    if gap > (BESIDE if step > SHORT * gap else AFAR) or not ahead > 0.0:
        return ""
    names = [bounded.field.parameters[i] for i in bounded.active]
    there = ", ".join(f"{name} = {v:.12g}" for name, v in zip(names, p.tolist(), strict=True))
    return f"the orbit shrinks to the Bogdanov-Takens point at {there}"


def ending(bounded: Any, made: Orbit, start: Orbit, slower: bool = False) -> tuple[str, str] | None:
    """Why a curve of connections ends at a point: a kind of point and words, or None.

    Where it is known to get ever slower, its end is nearly so however long it began.
    """
    found = spectra(bounded, made)
    if found is None:
        return "lost", "there is no equilibrium any more at an end of the orbit"
    extents = [float(np.max(np.ptp(one.x, axis=0) / bounded.scale)) for one in (made, start)]
    if ends_of(bounded).same and extents[0] < SHRUNK * extents[1]:
        return "bogdanov_takens", "the orbit shrinks to a Bogdanov-Takens point"
    leading = []
    for values, end in ((found.out, "source"), (found.into, "target")):
        if len(values):
            leading.append((abs(float(values[0].real)), values[0], end))
    size = float(max(np.max(np.abs(values)) for values in (found.out, found.into) if len(values)))
    wrong = bool(np.any(found.out.real <= 0.0) or np.any(found.into.real >= 0.0))
    least, value, end = min(leading, key=lambda one: one[0])
    if not (wrong or least < LOST * size or (slower and least < SLOWER * size)):
        return None
    slow = all(one[0] < 3e-2 * size for one in leading) and len(leading) == 2
    both = slow and least > 0.1 * max(one[0] for one in leading)  # they vanish together
    if both:
        return "bogdanov_takens", "two eigenvalues come to zero: a Bogdanov-Takens point is near"
    if value.imag:
        return "shilnikov_hopf", (
            f"a pair of eigenvalues of the {end} comes to the imaginary axis: a Shil'nikov-Hopf "
            "point is near"
        )
    return "non_central_saddle_node", (
        f"an eigenvalue of the {end} comes to zero: the orbit goes on as one to a saddle-node, "
        "which is not followed"
    )


def reached(bounded: Any, before: State, made: Point, start: Point) -> Stop | None:
    """The end of a curve of connections behind the point before, if a point comes to it."""
    held = made.step >= bounded.options.max_step  # by whom asks, not by Newton's method
    step = made.step if before.since_start >= FIRST and not held else math.inf
    said = shrinking(bounded, made.orbit, made.dy, step)
    if said:
        return Stop("bogdanov_takens", f"{said}; the last at {where(bounded, before.orbit)}")
    slower = slowing(bounded, made.orbit, made.dx, made.dy)
    why = ending(bounded, made.orbit, start.orbit, slower)
    if why is None:
        return None
    if why[0] == "bogdanov_takens":
        why = why[0], shrinking(bounded, made.orbit, made.dy) or why[1]
    return Stop(why[0], f"{why[1]}; the last at {where(bounded, before.orbit)}")


def when_stuck(bounded: Any, state: State, start: Point, stuck: Stop) -> Stop:
    """Why no step succeeds along a curve of connections."""
    said = shrinking(bounded, state.orbit, state.dy)
    if said:
        return Stop("bogdanov_takens", f"{said}; {stuck.message}")
    if slowing(bounded, state.orbit, state.dx, state.dy, STUCK):
        why = ending(bounded, state.orbit, start.orbit, slower=True)
        return Stop(why[0], f"{why[1]}; {stuck.message}") if why is not None else stuck
    return stuck
