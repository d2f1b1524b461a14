"""Where families of periodic orbits end: at bounds, Hopf points, homoclinic orbits, their start."""

from __future__ import annotations

import functools
from dataclasses import replace
from typing import Any

import numpy as np

from phasekit.arrays import Array
from phasekit.bifurcation.continuation.curve import Stop
from phasekit.cycles import along, collocation, connection_ends, homoclinic, starts
from phasekit.cycles.between import Stretch, root
from phasekit.cycles.connection_ends import passed, passing
from phasekit.cycles.cycles import Cycles, Orbit, where
from phasekit.cycles.extended import TORUS, Extended
from phasekit.cycles.point import Point, State, point_of

MEETING = 1e-5  # half turns between multipliers that are said to meet, and where they do
SHRUNK = 0.01  # size of orbits, beside their scale and the first one, that shrink to a point
FEW = 5  # points before which a family is not asked whether it closes
NEAR = 0.2  # how near its start it has to come by, beside its step
SAME = 1e-6
UNBOUNDED = 1e6  # size of a state, beside its first scale, of orbits that are said to grow for ever
OVERFLOW = 1e100  # the same, whatever the parameter does
ALONG = np.arange(128) / 128.0  # times at which parts of an orbit are compared
STILL = 1e-6  # how far a parameter moves, in units of its span, while such orbits grow e-fold


def end_of(
    cycles: Cycles, before: State, made: Point, start: Point
) -> tuple[Point | None, Stop] | None:
    """The last point and the reason, if the family ends between two points."""
    sizes = (cycles.amplitudes(made.orbit) / cycles.scale)[: cycles.own].tolist()
    small = sum(sizes) < 4.0 * made.step * len(sizes)
    if (
        small
        and cycles.closes
        and not cycles.forced
        and _through_hopf(cycles, before.orbit, made.orbit)
    ):
        return _at_hopf(cycles, before, made)
    if _near_doubling(cycles, made) and _through_doubling(cycles, before.orbit, made.orbit, small):
        name = cycles.field.parameters[cycles.active[0]]
        near = f"near {name} = {made.orbit.y[1]:.9g}"
        if isinstance(cycles, Extended) and _quartered(cycles, made.orbit):
            same = f"all quarters of the orbit become the same at a resonance 1:4 {near}"
            return None, Stop("resonance_4", same)
        same = f"both halves of the orbit become the same at a period doubling {near}"
        return None, Stop("period_doubling", same)
    if isinstance(cycles, Extended) and cycles.kind == TORUS:
        met = _resonance(cycles, before, made)
        if met is not None:
            return met
    for k, place in enumerate(cycles.active):
        p = made.orbit.y[1 + k]
        if cycles.low[k] < p < cycles.high[k]:
            continue
        upper = p >= cycles.high[k]
        bound = float(cycles.high[k] if upper else cycles.low[k])
        name, side = cycles.field.parameters[place], "upper" if upper else "lower"
        return _at_bound(cycles, before, made, k, bound, f"{name} met its {side}")
    for value, side, out in _period_bounds(cycles, made.orbit.y[0]):
        if out:
            return _at_bound(cycles, before, made, -1, value, f"period met its {side}")
    if getattr(cycles, "kind", "") == "connection":
        held: Any = cycles
        if passing(held, made.orbit) <= 0.0:
            return _at_passing(held, before, made)
        reached = connection_ends.reached(held, before, made, start)
        if reached is not None:
            return None, reached
    if homoclinic.near(cycles, made, start) and not homoclinic.awaited(cycles, made.orbit):
        return made, homoclinic.stop(cycles, made.orbit)
    grown = _without_bound(cycles, made)
    if grown is not None:
        return made, grown
    if _closes(cycles, before, made, start):
        last = replace(start, arclength=made.arclength, step=made.step)
        return last, Stop("closed", "the family closed on its start")
    return None


def _at_passing(cycles: Any, before: State, made: Point) -> tuple[Point | None, Stop]:
    """The connection at whose end an eigenvalue vanishes by which it does not go."""
    last = None
    if passing(cycles, before.orbit) > 0.0:
        last = root(Stretch(cycles, before, made), lambda p, _: passing(cycles, p.orbit))
    orbit = made.orbit if last is None else last.orbit
    kind, said = passed(cycles, orbit)
    at = "at" if last is not None else "not located, it is between the last point and"
    return last, Stop(kind, f"{said}; {at} {where(cycles, orbit)}")


def _at_bound(
    cycles: Cycles, before: State, made: Point, k: int, bound: float, said: str
) -> tuple[Point | None, Stop]:
    """The point at a bound that was passed, if it is found, and what is said of it."""
    said = f"{said} bound {bound:.9g}"
    if before.orbit.y[1 + k] == bound:
        return None, Stop("bound", said)
    last = at_value(cycles, before, made, k, bound)
    if last is None:
        said += f"; no orbit was found there, the last one is at {where(cycles, before.orbit)}"
    return last, Stop("bound", said)


def when_stuck(cycles: Cycles, state: State, start: Point, stuck: Stop) -> Stop:
    """Why no step succeeds: orbits that have shrunk, or a homoclinic orbit that is near.

    Of connections it is an end at which they take ever longer. Folds meet Hopf points of equilibria
    where the multiplier no longer tells small orbits apart.
    """
    if getattr(cycles, "kind", "") == "connection":
        return connection_ends.when_stuck(cycles, state, start, stuck)
    if not cycles.closes:
        return stuck
    if len(cycles.active) < 2 or cycles.forced:
        return homoclinic.when_stuck(cycles, state, start, stuck)
    own, scale = slice(cycles.own), cycles.scale[: cycles.own]
    size, first = (
        float(np.max(np.ptp(orbit.x[:, own] - np.outer(
            collocation.times(orbit.mesh, cycles.m), cycles.turns[own]), axis=0) / scale))
        for orbit in (state.orbit, start.orbit)
    )  # fmt: skip
    if not size < SHRUNK * min(first, 1.0):
        return stuck
    name = cycles.field.parameters[cycles.active[0]]
    return Stop(
        "hopf",
        f"the orbits shrink to an equilibrium, a Hopf point near {name} = "
        f"{state.orbit.y[1]:.9g}; {stuck.message}",
    )


def _resonance(cycles: Cycles, before: State, made: Point) -> tuple[Point | None, Stop] | None:
    """The end of a curve of tori where their multipliers meet and it goes back on itself.

    There its equations are singular, and parameters have their extremes: the end is next to it.
    """
    if before.dy[1:3] / cycles.width[:2] ** 2 @ made.dy[1:3] >= 0.0:
        return None  # by a symmetry they pass each other
    turns = [float(o.y[-1] * o.y[0]) / np.pi for o in (before.orbit, made.orbit)]
    low, high = sorted(turns)
    half = np.floor(high)
    if half == turns[0] or not (low < half or half == turns[1]):
        return None
    kind, value = ("resonance_1", 1) if half % 2 == 0 else ("resonance_2", -1)
    near = half + np.sign(turns[0] - half) * MEETING
    last: Point | None = made
    period = made.orbit.y[0]
    for _ in range(20):
        last = at_value(cycles, before, made, cycles.q - 2, near * np.pi / period)
        if last is None or abs(last.orbit.y[0] - period) <= 1e-14 * period:
            break
        period = last.orbit.y[0]
    return last, Stop(kind, f"the multipliers of the tori meet at {value}")


def _without_bound(cycles: Cycles, made: Point) -> Stop | None:
    """The end of a family of ever larger orbits, as round a linear center, if it comes to it.

    Where it was told to end by the period or at a special point, it goes on as far as numbers do.
    """
    own, orbit = cycles.own, made.orbit
    size = along.largest(orbit.x, cycles.scale, cycles.on_lines)
    if not size > UNBOUNDED or not np.sum((orbit.x * made.dx / cycles.scale**2)[:, :own]) > 0.0:
        return None
    told = "period" in cycles.options.bounds or cycles.ends
    moves = np.max(np.abs(made.dy[1:] / cycles.width)) * size > STILL
    if (told or moves) and not size > OVERFLOW:
        return None
    name = cycles.field.parameters[cycles.active[0]]
    return Stop(
        "unbounded",
        f"the orbits grow beyond {size:.2g} times the scales of the first ones while {name} = "
        f"{orbit.y[1]:.9g} stands still: larger scales among the options lead on",
    )


def _period_bounds(cycles: Cycles, period: float) -> list[tuple[float, str, bool]]:
    """Bounds of the period: their values, their sides, and whether it is out of them."""
    low, high = cycles.options.bounds.get("period", (-np.inf, np.inf))
    return [(low, "lower", period <= low), (high, "upper", period >= high)]


def shape(cycles: Cycles, orbit: Orbit) -> Array:
    """The orbit less its mean and turns, on scaled axes."""
    flat = orbit.x - np.outer(collocation.times(orbit.mesh, cycles.m), cycles.turns)
    return np.asarray((flat - collocation.mean(orbit.mesh, flat, cycles.m)) / cycles.scale)


def _through_hopf(cycles: Cycles, a: Orbit, b: Orbit) -> bool:
    """Whether the orbit turned inside out between two points, as it does through a Hopf point."""
    if np.any(cycles.turns):
        return False
    n = cycles.own
    a, _ = cycles.on(b.mesh, a)
    one, two = (shape(cycles, orbit) * cycles.scale for orbit in (a, b))
    nothing = np.zeros(cycles.q)
    one[:, n:] = 0.0
    return cycles.inner(b.mesh, one, two, nothing, nothing) < 0.0


def _at_hopf(cycles: Cycles, before: State, made: Point) -> tuple[Point | None, Stop]:
    """A last small orbit, and the Hopf point that it surrounds."""
    a = before.orbit
    name = cycles.field.parameters[cycles.active[0]]
    middle = collocation.mean(a.mesh, a.x, cycles.m)
    said = "the orbits shrink to an equilibrium, a Hopf point"
    near = Stop("hopf", f"{said} near {name} = {made.orbit.y[1]:.9g}")
    if len(cycles.active) > 1:
        return None, near
    found = hopf_near(cycles, middle, a.y)
    if found is None:
        return None, near
    x, y = found
    wave = shape(cycles, a) * cycles.scale
    rest = Orbit(a.mesh, np.tile(x, (len(a.x), 1)), y)
    last = starts.off(cycles, rest, wave, starts.SMALL * cycles.options.initial_step)
    stop = Stop("hopf", f"{said} at {name} = {y[1]:.12g}")
    if not last.converged or abs(last.orbit.y[0] / y[0] - 1.0) > 0.01:
        return None, stop
    # `off` leaves it outwards; the family comes inwards.
    point = point_of(cycles, last, before.arclength + 0.5 * made.step, 0.5 * made.step)
    return replace(point, dx=-point.dx, dy=-point.dy, sign=-point.sign), stop


def hopf_near(cycles: Cycles, x: Array, y: Array) -> tuple[Array, Array] | None:
    """The Hopf point near an equilibrium: the state, and y = (period, parameter)."""
    mesh, n = np.array([0.0, 1.0]), cycles.n
    omega = 2.0 * np.pi / y[0]
    x, p = x.copy(), float(y[1])

    def growth(p: float) -> tuple[float, float] | None:
        for step in range(30):
            at = np.tile(x, (cycles.m + 1, 1))
            jets = cycles.jets(mesh, at, np.array([y[0], p]), cycles.m, cycles.sizes)[0]
            slopes = jets[n:].reshape(n, -1)[:, :n]
            if not np.isfinite(jets).all():
                return None
            try:
                dx = np.linalg.solve(slopes, -jets[:n])
            except np.linalg.LinAlgError:
                return None
            x[:] += dx
            if step and np.max(np.abs(dx) / cycles.scale) < 1e-14:
                break
        values = np.linalg.eigvals(slopes)
        values = values[values.imag > 0.0]
        if not len(values):
            return None
        one = values[np.argmin(np.abs(values - 1j * omega))]
        return float(one.real), float(one.imag)

    before = growth(p)
    step = 1e-4 * cycles.width[0]
    for _ in range(30):
        after = growth(p + step)
        if before is None or after is None:
            return None
        p += step
        if after[0] == before[0] or abs(step) < 1e-15 * cycles.width[0]:
            break
        step = -after[0] * step / (after[0] - before[0])
        before = after
    assert after is not None
    if abs(after[0]) > 1e-9 * after[1] or abs(after[1] / omega - 1.0) > 0.2:
        return None
    return x, np.array([2.0 * np.pi / after[1], p])


def _near_doubling(cycles: Cycles, made: Point) -> bool:
    """Whether the orbit can be a doubled one near its birth, with a multiplier near 1."""
    if cycles.forced and cycles.multiple % 2:
        return False
    near = sum(abs(mu - 1.0) < 0.7 for mu in made.multipliers.tolist())
    return bool(near > (0 if cycles.forced else 1))


def _through_doubling(cycles: Cycles, a: Orbit, b: Orbit, shrunk: bool) -> bool:
    """Whether both halves of the orbit changed places, as they do where they become the same.

    Those of one that has ``shrunk`` may do so where the orbit that is doubled rests.
    """
    if len(cycles.active) > 1 and not isinstance(cycles, Extended):
        return False
    n = cycles.own
    one, two = _apart(cycles, a), _apart(cycles, b)
    if float(np.vdot(one, two)) >= 0.0:
        return False
    if not np.sum((one - two) ** 2) < 9.0 * max(np.sum(one**2), np.sum(two**2)):
        return False
    # Orbits with the symmetry x(s + 1/2) = -x(s) keep halves that are far apart.
    size = float(np.mean((cycles.amplitudes(b) / cycles.scale)[:n]))
    close: Any = min(np.sqrt(np.mean(one**2)), np.sqrt(np.mean(two**2))) < 0.2 * size
    return bool(close or (shrunk and isinstance(cycles, Extended)))


@functools.lru_cache(maxsize=4)
def _apart(cycles: Cycles, orbit: Orbit, parts: int = 2) -> Array:
    """All of an orbit but its first part less what is a part of its period before."""
    n, gap = cycles.own, len(ALONG) // parts
    x = collocation.interpolate(orbit.mesh, orbit.x, cycles.m, ALONG)
    return np.asarray((x[gap:] - x[:-gap] - cycles.turns / parts)[:, :n] / cycles.scale[:n])


def _quartered(cycles: Cycles, orbit: Orbit) -> bool:
    """Whether quarters of an orbit are as much the same as its halves.

    All parts of one at rest are; of a forced system it tells how many periods of that it takes.
    """
    if cycles.forced and cycles.multiple % 4:
        return False
    two, four = (np.sqrt(np.mean(_apart(cycles, orbit, parts) ** 2)) for parts in (2, 4))
    return bool(four < 2.0 * two)


def at_value(cycles: Cycles, before: State, made: Point, k: int, value: float) -> Point | None:
    """The point between two others where a free parameter has a value."""
    a, b = before.orbit, made.orbit
    mesh = b.mesh
    a, (dx,) = cycles.on(mesh, a, before.dx)
    part = (value - a.y[1 + k]) / (b.y[1 + k] - a.y[1 + k])
    guess = Orbit(mesh, a.x + part * (b.x - a.x), a.y + part * (b.y - a.y))
    if cycles.slides:
        stretch = Stretch(cycles, before, made)
        guess, dx = stretch.guess(part * stretch.length), stretch.tangents[0][0]
    point = _from(cycles, before, made, guess, dx, part, k, value)
    if point is None:
        # Next to a fold, or a long way off: along the family, which is no function of the value.
        near = root(Stretch(cycles, before, made), lambda p, _: float(p.orbit.y[1 + k] - value))
        if near is not None:
            guess, (dx,) = cycles.on(near.orbit.mesh, near.orbit, near.dx)
            part = (near.arclength - before.arclength) / made.step
            point = _from(cycles, before, made, guess, dx, part, k, value)
    return point


def _from(
    cycles: Cycles, before: State, made: Point, guess: Orbit, dx: Array, part: float, k: int,
    value: float,
) -> Point | None:  # fmt: skip
    """The point where a free parameter has a value, by Newton's method from a guess."""
    for _ in range(4):
        rows, rows_y, target = cycles.rows(guess, np.zeros_like(guess.x), np.zeros(cycles.q))
        rows_y[-1, 1 + k], target[-1] = 1.0, value
        found = cycles.correct(guess, rows, rows_y, target, iterations=12)
        if not found.converged:
            return None
        finer = starts.finer(cycles, found.orbit)
        if finer is None:
            break
        # The mesh of the other orbit, on which one between them need not be as good.
        guess, (dx,) = cycles.on(finer, found.orbit, dx)
    found.orbit.y[1 + k] = value
    side = np.sign(cycles.inner(found.orbit.mesh, dx, found.dx, before.dy, found.dy)) or 1.0
    point = point_of(cycles, found, before.arclength + part * made.step, part * made.step)
    # Its determinant has the parameter's row, which goes the way of the tangent that it gave.
    return replace(point, dx=side * found.dx, dy=side * found.dy, sign=side * found.sign)


@functools.lru_cache(maxsize=8)
def fingerprint(cycles: Cycles, orbit: Orbit) -> list[float]:
    """Numbers that tell orbits apart, whatever their phase."""
    own, c = cycles.own, collocation.scheme(cycles.m)
    width = cycles.width[: len(cycles.active)]
    out = np.empty(len(width) + 1 + 2 * own)
    along.fill_numbers(
        orbit.mesh, orbit.x, orbit.y, cycles.turns, cycles.scale, width, own, c.weights, c.value,
        out,
    )  # fmt: skip
    numbers: list[float] = out.tolist()
    return numbers


def _closes(cycles: Cycles, before: State, made: Point, start: Point) -> bool:
    """Whether the family comes by its start again, between two points."""
    p = start.orbit.y[1]
    a, b = before.orbit.y[1], made.orbit.y[1]
    near = abs(b - a) + made.step * cycles.width[0]
    if before.since_start < FEW or not min(a, b) - near <= p <= max(a, b) + near:
        return False
    prints = [fingerprint(cycles, o) for o in (start.orbit, before.orbit, made.orbit)]
    one = [b - a for a, b in zip(prints[0], prints[1], strict=True)]
    along = [b - a for a, b in zip(prints[1], prints[2], strict=True)]
    length = sum(a * a for a in along)
    if not length > 0.0:
        return False
    part = -sum(a * b for a, b in zip(one, along, strict=True)) / length
    gap = sum((a + part * b) ** 2 for a, b in zip(one, along, strict=True))
    if not 0.0 <= part <= 1.0 or gap > NEAR**2 * length:
        return False
    # It comes by: whether it meets it, the orbit in the plane of the start says.
    k = 0 if len(cycles.active) == 1 else int(np.argmax(np.abs(start.dy[1:3] / cycles.width[:2])))
    if abs(b - a) if k == 0 else abs(made.orbit.y[2] - before.orbit.y[2]):
        met = at_value(cycles, before, made, k, float(start.orbit.y[1 + k]))
        if met is not None:
            pairs = zip(fingerprint(cycles, met.orbit), prints[0], strict=True)
            return all(abs(a - b) < SAME for a, b in pairs)
    return False
