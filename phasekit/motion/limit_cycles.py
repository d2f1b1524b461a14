"""Limit cycles of planar flows, by the return maps of sections that they all meet.

A closed orbit in the plane encloses an equilibrium that is no saddle, so it meets every ray from
there; one that goes round a cylinder meets every line across. Both senses of time are tried: a
cycle that repels strongly attracts backward in time.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from phasekit.arrays import Array
from phasekit.laws.equations import Equations
from phasekit.motion import flows
from phasekit.motion.displacements import EPS, FINE, ROUGH, Met, Sampled
from phasekit.motion.equation_rates import rates_on, slopes_at
from phasekit.motion.flow import motions
from phasekit.motion.lost import ARRIVED
from phasekit.motion.method import whole_turns
from phasekit.motion.paths import ROOM, Path, distances, paths
from phasekit.motion.returns import ATOL, Line, Plane, Ray, Section, first_returns

#: Directions of rays, and places of lines, among which one is chosen.
CHOICES = 16
#: Distance between states of a cycle, in widths of the window.
CLOSE = 1.0 / 200.0
#: Difference of periods and extents, in parts and in widths, of what is one cycle.
SAME = 1e-6
#: Steps of a motion once round a cycle that was found.
MOST = 10_000_000
#: States of its way where it has too many for the usual room.
CROWD = 3_000_000
#: Part of a place by which it is moved to see how its return changes.
ASIDE = 1e-5
#: How far the multiplier may be from the slope of the return map, in its logarithm.
CHECKED = 1e-4
#: Periods of a cycle after which a motion has come to it, and how near it is then, in widths.
PERIODS, ON_CYCLE = 30, 1e-2
#: Turns of angles within which motions are followed.
TURNS = 2.5
_Q = "_divergence"


class Cycle(NamedTuple):
    """One limit cycle, forward in time."""

    time: Array
    state: Array
    """States close together, of shape (points, 2); the last is the first again."""
    period: float
    period_error: float
    growth: float
    """The logarithm of its multiplier: the divergence, integrated over the period."""
    growth_error: float
    low: Array
    high: Array
    """Least and greatest states."""
    turns: npt.NDArray[np.int64]
    """Periods of each state, if it is an angle, by which it goes on."""
    is_single: bool
    """Whether it is seen to be one cycle: not two, or none."""


class Cycles(NamedTuple):
    """What was found in a window."""

    cycles: list[Cycle]
    doubts: list[str]
    """Why there may be others."""
    lost: list[str]
    """What is known of those that were met, and could not be followed."""


class Window(NamedTuple):
    """Where cycles are looked for."""

    low: Array
    high: Array
    turns: Array
    """Periods of states that are angles all round; 0 of others."""

    @property
    def widths(self) -> Array:
        """Widths of both states."""
        return np.where(self.turns > 0.0, self.turns, self.high - self.low)


def limit_cycles(
    law: Equations,
    values: Mapping[str, float],
    window: Window,
    rests: Array,
    slopes: Array,
) -> Cycles:
    """Find the limit cycles of a planar flow that lie in a window.

    The law does not depend on the time; rests, of shape (n, 2), are the equilibria in the window,
    slopes the derivatives there.
    """
    ranges = zip(law.states, zip(window.low, window.high, strict=True), strict=True)
    law = replace(law, window={name: (float(a), float(b)) for name, (a, b) in ranges})
    found: list[Cycle] = []
    doubts: list[str] = []
    lost: list[str] = []
    late: list[tuple[Section, float, Array]] = []
    for section, plane, growth in _sections(law, values, window, rests, slopes):
        met = [Sampled(law, values, section, plane, sense, growth).met() for sense in (1.0, -1.0)]
        doubts += _doubts(law, section, met)
        late += [(section, way, one.late) for one, way in zip(met, (1.0, -1.0), strict=True)]
        for place, sense, single in _places(section, met):
            cycle = _measured(law, values, section, window, plane, place, sense, single)
            if isinstance(cycle, str):
                lost.append(f"a cycle {_called(law, section)} {cycle}")
                continue
            if not _lies_in(cycle, window):
                continue
            if not any(_is_same(cycle, other, window) for other in found):
                found.append(cycle)
    found.sort(key=lambda cycle: float(np.prod((cycle.high - cycle.low) / window.widths)))
    doubts += [
        "two cycles, one or none are where the return map touches the identity within errors"
        for cycle in found if not cycle.is_single
    ][:1]  # fmt: skip
    doubts += _never_back(law, values, window, late, found)
    return Cycles(found, list(dict.fromkeys(doubts)), list(dict.fromkeys(lost)))


def _sections(
    law: Equations, values: Mapping[str, float], window: Window, rests: Array, slopes: Array
) -> list[tuple[Section, Plane, float]]:
    """Sections that all cycles meet, with what is known of the first one's beginning."""
    around = _everywhere(rests, window)
    seen = window.turns > 0.0
    sections: list[tuple[Section, Plane, float]] = []
    settles = around
    for rest, slope in zip(rests, slopes, strict=True):
        size = float(np.linalg.norm(slope))
        if np.linalg.det(slope) < -1e-12 * size**2:
            continue  # a saddle
        low, high = window.low.copy(), window.high.copy()
        low[seen] = (rest - TURNS * window.turns)[seen]
        high[seen] = (rest + TURNS * window.turns)[seen]
        plane = Plane(low, high, window.widths, settles)
        ray = _ray(law, values, window, rest, around, low, high)
        trace, det = float(np.trace(slope)), float(np.linalg.det(slope))
        turning = det - 0.25 * trace**2
        growth = np.nan
        if turning > 1e-12 * size**2:
            growth = np.pi * trace / np.sqrt(turning)
        sections.append((ray, plane, growth))
    for angle in np.flatnonzero(seen):
        line = _line(law, values, window, int(angle), around)
        low, high = window.low.copy(), window.high.copy()
        centers = np.where(np.arange(2) == angle, line.value, 0.5 * (low + high))
        low[seen] = (centers - TURNS * window.turns)[seen]
        high[seen] = (centers + TURNS * window.turns)[seen]
        sections.append((line, Plane(low, high, window.widths, settles), np.nan))
    return sections


def _everywhere(rests: Array, window: Window) -> Array:
    """Equilibria, and the same a few turns further on."""
    found = rests.reshape(-1, 2)
    for i in np.flatnonzero(window.turns > 0.0):
        step = np.where(np.arange(2) == i, window.turns, 0.0)
        found = np.concatenate([found + k * step for k in range(-3, 4)])
    return found


def _ray(
    law: Equations, values: Mapping[str, float], window: Window, rest: Array, around: Array,
    low: Array, high: Array,
) -> Ray:  # fmt: skip
    """A ray from a point to the edge of the window, crossed in one sense as far as can be."""
    widths = window.widths
    others = (around - rest) / widths
    others = others[np.linalg.norm(others, axis=1) > 1e-9]
    best, found = None, None
    for k in range(CHOICES):
        angle = 2.0 * np.pi * (k + 0.37) / CHOICES
        direction = np.array([np.cos(angle), np.sin(angle)])
        with np.errstate(all="ignore"):
            ends = np.where(direction > 0.0, high - rest, low - rest) / (direction * widths)
        ray = Ray(rest, direction, widths, float(np.min(ends[ends > 0.0], initial=np.inf)))
        if not np.isfinite(ray.longest):
            continue
        states = ray.states(ray.longest * (np.arange(64) + 0.5) / 64)
        rates = rates_on(law, values, states) / widths
        across = direction[0] * rates[:, 1] - direction[1] * rates[:, 0]
        changes = int((np.diff(np.sign(across[np.isfinite(across)])) != 0).sum())
        along = others @ direction
        beside = np.abs(others @ np.array([-direction[1], direction[0]]))
        room = float(np.min(beside[(along > 0.0) & (along < ray.longest)], initial=0.2))
        score = changes, -min(room, 0.05), -ray.longest
        if best is None or score < best:
            best, found = score, ray
    assert found is not None
    return found


def _line(
    law: Equations, values: Mapping[str, float], window: Window, angle: int, around: Array
) -> Line:
    """A line across the cylinder, crossed in one sense as far as can be."""
    other, turn = 1 - angle, float(window.turns[angle])
    low, width = float(window.low[other]), float(window.widths[other])
    best, found = None, None
    for k in range(CHOICES):
        line = Line(
            angle, float(window.low[angle]) + turn * (k + 0.37) / CHOICES, turn, low, width,
            float(window.turns[other] > 0.0),
        )  # fmt: skip
        rates = rates_on(law, values, line.states((np.arange(64) + 0.5) / 64))[:, angle]
        changes = int((np.diff(np.sign(rates[np.isfinite(rates)])) != 0).sum())
        away = np.abs(around[:, angle] - line.value) / turn
        score = changes, -min(float(np.min(away, initial=0.2)), 0.05)
        if best is None or score < best:
            best, found = score, line
    assert found is not None
    return found


def _doubts(law: Equations, section: Section, met: Sequence[Met]) -> list[str]:
    found, where = [], _called(law, section)
    if any(len(one.families) for one in met):
        found.append(f"closed orbits fill a part of the window {where}; they are no limit cycles")
    if section.period:
        found.append("cycles that go round both angles several times are not looked for")
    return found


def _called(law: Equations, section: Section) -> str:
    """What messages call a section."""
    if isinstance(section, Line):
        return f"round the cylinder in {law.states[section.angle]}"
    ends = zip(law.states, section.start, strict=True)
    return "round " + ", ".join(f"{name} = {x:.6g}" for name, x in ends)


def _never_back(
    law: Equations, values: Mapping[str, float], window: Window,
    late: Sequence[tuple[Section, float, Array]], cycles: Sequence[Cycle],
) -> list[str]:  # fmt: skip
    """What is said of motions that did not return, and do not come to another cycle."""
    found = []
    for section, sense, places in late:
        if not len(places):
            continue
        own = [one for one in cycles if sense * one.growth < 0.0]
        span = PERIODS * max((one.period for one in own), default=0.0)
        left = len(places)
        if own:
            states = section.states(places)
            times = np.tile([0.0, sense * span], (len(places), 1))
            ways = paths(
                law, values, states, times, widths=window.widths, close=np.inf, rtol=ROUGH,
                atol=ROUGH * ATOL,
            )  # fmt: skip
            ends = np.array([way.state[-1] for way in ways])
            away = [distances(ends, one.state, window.widths, window.turns) for one in own]
            left = int((np.min(away, axis=0) > ON_CYCLE).sum())
        if left:
            found.append(f"{left} motions {_called(law, section)} took too many steps to return")
    return found


def _places(section: Section, met: Sequence[Met]) -> list[tuple[float, float, bool]]:
    """Where cycles meet a section, the sense of time in which each attracts, and if it is one."""
    forward, backward = met
    found = [
        (float(place), sense, True)
        for one, sense in ((forward, 1.0), (backward, -1.0))
        for place in one.places[one.attracts]
    ]
    near = SAME * section.longest

    def is_new(place: float) -> bool:
        return all(abs(place - other) > near for other, *_ in found)

    for one, sense in ((forward, -1.0), (backward, 1.0)):
        # Seen to repel in one sense of time, and not seen to attract in the other.
        found += [(float(x), sense, True) for x in one.places[~one.attracts] if is_new(float(x))]
    for one in met:
        inside = [any(a <= x <= b for f in met for a, b in f.families) for x in one.touching]
        found += [
            (float(x), 1.0, False)
            for x, within in zip(one.touching, inside, strict=True)
            if not within and all(abs(x - other) > 1e-3 * section.longest for other, *_ in found)
        ]
    return found


def _measured(
    law: Equations, values: Mapping[str, float], section: Section, window: Window, plane: Plane,
    place: float, sense: float, single: bool,
) -> Cycle | str:  # fmt: skip
    """The cycle through a place of a section; why not, where its motion cannot be followed."""
    aside = ASIDE * (place if isinstance(section, Ray) else 1.0)
    places = np.array([place, place - aside, place + aside])
    back = [
        first_returns(
            law, values, section, places, plane, sense=sense, rtol=rtol, most=MOST
        )
        for rtol in (FINE, 10.0 * FINE)
    ]  # fmt: skip
    if not np.isfinite(back[0].place[0]):
        return "was met, and its motion did not come back by finer steps"
    start = section.states(places[:1])[0]
    period = abs(float(back[0].time[0]))
    with np.errstate(all="ignore"):
        slope = (back[0].place[2] - back[0].place[1]) / (2.0 * aside)
        # By how much the place moves with the errors of steps, and the period with it.
        drift = abs(back[1].place[0] - back[0].place[0]) + abs(back[0].place[0] - place)
        moved = drift / max(abs(1.0 - slope), 1e-12)
        change = abs(back[0].time[2] - back[0].time[1]) / (2.0 * aside)
        period_error = float(abs(back[1].time[0] - back[0].time[0]) + change * moved)
    path = _path(law, values, plane, start, sense * period)
    if path.status != ARRIVED:
        return f"of the period {period:.6g} takes too many steps to be followed all along"
    growths = [_growth(law, values, plane, start, sense * period, rtol) for rtol in (FINE, 1e-12)]
    growth, growth_error = growths[0], abs(growths[1] - growths[0]) + EPS * abs(growths[0])
    with np.errstate(all="ignore"):
        seen = float(np.log(slope)) * sense
    if single and 1e-3 < slope < 1e3 and abs(seen - growth) > CHECKED * (1.0 + abs(growth)):
        growth_error = abs(seen - growth)
    time, state = _thinned(path, plane.widths)
    if sense < 0.0:
        time, state = (time - time[-1])[::-1], state[::-1]
    turns = np.zeros(2, np.int64)
    on = window.turns > 0.0
    turns[on] = np.rint((state[-1] - state[0])[on] / window.turns[on]).astype(np.int64)
    low, high = _extent(law, values, start, path)
    for i in np.flatnonzero(turns):
        low[i], high[i] = window.low[i], window.low[i] + window.turns[i]
    for i in np.flatnonzero(on & (turns == 0)):  # where it would be drawn
        middle = 0.5 * (low[i] + high[i])
        back_by = window.turns[i] * np.floor((middle - window.low[i]) / window.turns[i])
        state[:, i] -= back_by
        low[i], high[i] = low[i] - back_by, high[i] - back_by
    return Cycle(
        time, state, period, period_error, growth, growth_error, low, high, turns, single
    )  # fmt: skip


def _path(
    law: Equations, values: Mapping[str, float], plane: Plane, start: Array, time: float
) -> Path:
    """The way once round; of many steps where a fast state follows a slow one."""
    for room in (ROOM, CROWD):
        path = paths(
            law, values, start[None], np.array([[0.0, time]]), widths=plane.widths,
            close=CLOSE, rtol=FINE, atol=FINE * ATOL, room=room,
        )[0]  # fmt: skip
        if path.status == ARRIVED or law.kind == "python":
            break
    return path


def _thinned(path: Path, widths: Array) -> tuple[Array, Array]:
    """Times and states of a path: of a crowded one the first in each part of its length."""
    if len(path.time) <= ROOM:
        return path.time.copy(), path.state.copy()
    steps = np.linalg.norm(np.diff(path.state, axis=0) / widths, axis=1)
    parts = np.append(0.0, np.cumsum(steps)) // CLOSE
    kept = np.append(True, np.diff(parts) > 0.0)
    kept[-1] = True
    return path.time[kept], path.state[kept]


def _growth(
    law: Equations, values: Mapping[str, float], plane: Plane, start: Array, time: float,
    rtol: float,
) -> float:  # fmt: skip
    """The divergence along a motion, integrated forward in time."""
    if law.kind == "symbolic":
        import sympy as sp

        from phasekit.laws.formulas import symbols_of

        symbols = symbols_of(law.states)
        divergence = sp.Add(
            *(f.diff(symbols[name]) for f, name in zip(law.f, law.states, strict=True))
        )
        both = replace(law, states=(*law.states, _Q), f=(*law.f, divergence))
        arrays = {name: np.array(value) for name, value in values.items()}
        found = motions(
            both, arrays, np.append(start, 0.0)[None], np.array([[time]]), rtol, rtol * ATOL,
            method="dop853",
        )  # fmt: skip
        return float(found.states[0, 0, 2]) * float(np.sign(time))
    # Gauss points between the states that its path has.
    path = paths(
        law, values, start[None], np.array([[0.0, time]]), widths=plane.widths, close=CLOSE,
        rtol=rtol, atol=rtol * ATOL,
    )[0]  # fmt: skip
    at, weights = np.polynomial.legendre.leggauss(4)
    steps = np.diff(path.time)
    times = (path.time[:-1, None] + 0.5 * (1.0 + at) * steps[:, None]).ravel()
    given = [values[name] for name in law.names]
    states = np.stack(flows.flow(law, *given, *start, times, rtol=rtol, atol=rtol * ATOL), axis=-1)
    traces = np.array([np.trace(slopes_at(law, values, x)) for x in states])
    total = float(np.sum(traces.reshape(-1, 4) * (0.5 * weights) * steps[:, None]))
    return total * float(np.sign(time))


def _extent(
    law: Equations, values: Mapping[str, float], start: Array, path: Path
) -> tuple[Array, Array]:
    """Least and greatest states along a path."""
    rates = rates_on(law, values, path.state)
    turning = []
    for i in range(2):
        # Where a cubic with these rates at its ends turns.
        for k in np.flatnonzero(rates[:-1, i] * rates[1:, i] < 0.0):
            a, b = rates[k, i], rates[k + 1, i]
            step = path.time[k + 1] - path.time[k]
            mean = (path.state[k + 1, i] - path.state[k, i]) / step
            c = 6.0 * mean - 4.0 * a - 2.0 * b
            d = 3.0 * (a + b) - 6.0 * mean
            parts = np.roots([d, c, a])
            parts = parts[np.isreal(parts)].real
            turning += [path.time[k] + s * step for s in parts[(parts > 0.0) & (parts < 1.0)]]
    points = [path.state]
    if turning:
        given = [values[name] for name in law.names]
        # To these few times, by steps as those of the path: it takes longer to compile series.
        found = flows.flow(
            law, *given, *start, np.array(turning), rtol=FINE, atol=FINE * ATOL, method="dop853"
        )
        points.append(np.stack(found, axis=-1))
    together = np.concatenate(points)
    return np.min(together, axis=0), np.max(together, axis=0)


def _lies_in(cycle: Cycle, window: Window) -> bool:
    """Whether a cycle is inside of the window; of angles all round it always is."""
    room = SAME * window.widths
    inside = (cycle.low >= window.low - room) & (cycle.high <= window.high + room)
    return bool(np.all(inside | (window.turns > 0.0)))


def _is_same(one: Cycle, other: Cycle, window: Window) -> bool:
    if abs(one.period - other.period) > SAME * other.period:
        return False
    apart = np.array([one.low - other.low, one.high - other.high])
    apart -= whole_turns(apart, window.turns)
    goes_on = (one.turns != 0) & (one.turns == other.turns)
    return bool(np.all((np.abs(apart) <= SAME * window.widths) | goes_on))
