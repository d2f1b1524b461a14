"""Guesses of connecting orbits: samples of one, or motions along an invariant manifold."""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np
import xarray as xr

from phasekit.arrays import Array
from phasekit.cycles import collocation, starts
from phasekit.cycles.bounded import Bounded
from phasekit.cycles.connections import Rest, linear_reach, rest_near, slopes_at
from phasekit.cycles.cycles import Orbit
from phasekit.cycles.subspaces import subspace
from phasekit.errors import ConvergenceError
from phasekit.labelled.continuation.periodic_orbit import Simulation
from phasekit.labels.arguments import bad, list_names, reals
from phasekit.motion.method import few
from phasekit.numerics.balance import balanced
from phasekit.systems.problem import Problem

AWAY = 1e-2  # distance at which a motion along a manifold begins, beside that where f is linear
SIZE, BOUND = 10.0, 1e4  # of a loop beside that distance, and where a motion ends beside its size
MOST = 30_000  # values of f along a motion: one that ends in a fast cycle would take many more
AIMED, NEAR = 20, 1e-4  # shots at a target, and how near one is good enough
AIMS, WORSE = (1e-3, 1e-5), 1.5  # first changes of the parameter, and by what a shot may be worse
SOME = 8  # states at which slopes tell the sizes of states
WIDTHS = 20.0  # by what the span of a free parameter is wider than its size
TRIES = 24  # directions in which a manifold of more than one dimension is left
PASSED, LOOP = 0.05, 16  # of a passage of an equilibrium, beside an orbit; least samples of a loop
WEAK = 10.0  # times the rate of arrival, from where on leaving is fast
ASIDE, BACK = 0.1, 0.1  # how far off its equilibrium a state tells a side, and a motion is back
SAME = 1e-9  # of the equilibrium and of how far the guesses are apart: two ends are one
PASSES = 15.0  # times the slowest time of both ends, over which an orbit is looked for


class Guess(NamedTuple):
    """A guess of an orbit."""

    orbit: Orbit
    same: bool  # whether it comes back to its equilibrium
    places: tuple[Array, Array]  # near which its ends are
    beside: str = ""  # words for another orbit that may be there


def guesses(problem: Problem, trial: Bounded, given: Any, y: Array) -> Iterable[Guess]:
    """Guesses of the orbit."""
    states = given_states(problem, given)
    if isinstance(given, xr.Dataset):
        return _of_dataset(problem, trial, given, states, y)
    rests: list[Any] = [rest_near(trial, x, y) for x in states]
    for rest, x in zip(rests, states, strict=True):
        if rest is None:
            raise bad("orbit", x.tolist(), "states near equilibria")
    first, last = rests
    apart = float(np.max(np.abs((states[0] - states[1]) / trial.scale)))
    same = _are_one(trial, first, last, apart)
    return _along_manifold(problem, trial, (first, last), list(states), y, same)


def given_states(problem: Problem, given: Any) -> Array:
    """States, in rows, of an orbit or a pair that is given."""
    if isinstance(given, xr.Dataset):
        missing = [name for name in problem.state if name not in given]
        if missing or "time" not in given.coords or given.sizes.get("time", 0) < 8:
            raise bad("orbit", list(map(str, given.data_vars)), "all states on 'time'")
        return np.stack([np.asarray(given[name].values, float) for name in problem.state], axis=1)
    if not isinstance(given, (list, tuple)) or len(given) != 2:
        raise bad("orbit", given, "a Dataset of an orbit, or a pair of states (from_, to)")
    return np.array([_state(problem, one) for one in given])


def sizes_near(problem: Problem, trial: Bounded, states: Array, y: Array) -> Array:
    """Sizes of the states of an orbit, powers of 2: how large they are, or f is linear about 0."""
    some = few(states, SOME)
    slopes = np.abs(
        [slopes_at(trial, x, y)[1][:, : trial.n] for x in (*some, np.mean(some, axis=0))]
    )
    units = balanced(np.mean(slopes[np.isfinite(slopes).all(axis=(1, 2))], axis=0)[None])[1][0]
    size = float(np.max(np.abs(states / units)))
    here = replace(trial, scale=units)
    A = slopes_at(here, states[0], y)[1][:, : trial.n] * units / units[:, None]
    ways = np.cos(np.arange(1.0, trial.n**2 + 1.0)).reshape(trial.n, trial.n)  # of all states
    reach = linear_reach(here, Rest(states[0], A, np.zeros((trial.n, 0))), y, ways)
    size = max(size, reach) if reach < np.inf else size
    exponent = np.log2(size) if 0.0 < size < np.inf else 0.0
    return np.asarray(units * 2.0 ** np.round(exponent))


def parameter_sizes(trial: Bounded, states: Array, y: Array) -> Array:
    """Sizes of the free parameters: their own, or what moves f next to states as these do."""
    n, found = trial.n, np.full(len(y) - 1, np.inf)
    for way in np.vstack([np.eye(n), -np.eye(n)]):
        slopes = slopes_at(trial, states[0] + way * trial.scale, y)[1]
        with np.errstate(all="ignore"):
            moved = np.max(np.abs(slopes[:, :n]) * trial.scale, axis=1)[:, None]
            needed = np.nanmin(
                np.where(slopes[:, n:] != 0.0, moved / np.abs(slopes[:, n:]), np.inf), axis=0
            )
        found = np.where((needed > 0.0) & (needed < found), needed, found)
    return np.maximum(np.abs(y[1:]), np.where(found < np.inf, found, np.where(y[1:], 0.0, 1.0)))


def _are_one(trial: Bounded, first: Rest, last: Rest, apart: float) -> bool:
    """Whether two equilibria are one, beside their size and how far guesses are apart."""
    size = float(np.max(np.abs(first.x / trial.scale))) + apart
    return float(np.max(np.abs((first.x - last.x) / trial.scale))) <= SAME * size


def _state(problem: Problem, given: Any) -> Array:
    names = list_names(problem.state)
    if isinstance(given, Mapping):
        if set(given) != set(problem.state):
            raise bad("orbit", list(given), f"a value for each of {names}")
        given = [given[name] for name in problem.state]
    wants = f"states of {len(problem.state)} numbers: {names}"
    x = np.atleast_1d(reals("orbit", given, wants))
    if x.shape != (len(problem.state),) or not np.isfinite(x).all():
        raise bad("orbit", given, wants)
    return x


def _of_dataset(
    problem: Problem, trial: Bounded, ds: xr.Dataset, x: Array, y: Array
) -> Iterator[Guess]:
    time = np.asarray(ds["time"].values, dtype=float)
    back = "period" in ds
    if not back:
        first, last = (rest_near(trial, one, y) for one in (x[0], x[-1]))
        same = False
        if first is not None and last is not None:
            apart = float(np.max(np.ptp(x, axis=0) / trial.scale))
            same = _are_one(trial, first, last, apart)
    else:
        f = np.array([problem.derivatives(one)[0] for one in x[:-1]])
        size = np.ptp(x, axis=0)
        size = np.where(size > 0.0, size, 1.0)
        slow = int(np.argmin(np.linalg.norm(f / size, axis=1)))
        turn = x[-1] - x[0]
        same = bool(np.max(np.abs(turn) / size) < 1e-6)
        x = np.concatenate([x[slow:], x[1 : slow + 1] + turn])
        time = np.concatenate([time[slow:], time[1 : slow + 1] + time[-1] - time[0]])
    ends = (x[0], x[0] if same else x[-1])
    yield Guess(_through(trial, time - time[0], x, y), same, ends)
    if back and same:
        parts = _loops(trial, x, y)
        for k, part in enumerate(parts):
            others = (
                f"the orbit given passes its equilibrium {len(parts)} times: this is its loop "
                f"{k + 1}; others are found from states to their sides"
            )
            yield Guess(_through(trial, time[part] - time[part][0], x[part], y), same, ends, others)


def _loops(trial: Bounded, x: Array, y: Array) -> list[slice]:
    """The parts of a periodic orbit between passages of the equilibrium where it begins."""
    rest = rest_near(trial, x[0], y)
    if rest is None:
        return []
    far = np.linalg.norm((x - rest.x) / trial.scale, axis=1)
    far /= np.max(np.ptp(x / trial.scale, axis=0))
    lows = [k for k in range(1, len(x) - 1) if far[k] < PASSED and far[k] == np.min(
        far[max(0, k - LOOP) : k + LOOP + 1])]  # fmt: skip
    places = [0, *lows, len(x) - 1]
    whole = [slice(a, b + 1) for a, b in itertools.pairwise(places) if b - a >= LOOP]
    return whole if len(whole) > 1 else []


def _through(trial: Bounded, time: Array, x: Array, y: Array) -> Orbit:
    """An orbit through samples."""
    from scipy.interpolate import PchipInterpolator

    m, length = trial.m, float(time[-1])
    apart = np.append(True, np.diff(time / length) > 0.0)  # steps may be below rounding of time
    time, x = time[apart], x[apart]
    count = int(np.clip(len(time) // m, starts.FIRST, 400))
    rows = np.linspace(0.0, len(time) - 1.0, count + 1)
    mesh = np.interp(rows, np.arange(len(time)), time / length)
    mesh[0], mesh[-1] = 0.0, 1.0
    at = PchipInterpolator(time / length, x, axis=0)(collocation.times(mesh, m))
    return Orbit(mesh, np.ascontiguousarray(at), np.array([length, *y[1:]]))


def _along_manifold(
    problem: Problem, trial: Bounded, rests: tuple[Any, Any], states: Sequence[Array], y: Array,
    same: bool,
) -> Iterator[Guess]:  # fmt: skip
    """Motions along the unstable manifold that come near the target, the nearest first.

    Or backwards along the stable manifold of the target, where that has fewer dimensions. Those of
    one parameter are shot at it. Of a manifold of one dimension those come first that go to the
    side on which the state lies that was given for its equilibrium.
    """
    first, last = rests
    n = trial.n
    unstable, stable = first.unstable(), n - last.unstable()
    if not (unstable and stable):
        end = "source has no unstable" if not unstable else "target has no stable"
        raise bad(
            "orbit", [first.x.tolist(), last.x.tolist()], f"other states: the {end} direction"
        )
    places = (first.x, last.x)
    shots = [(way, _shot(problem, trial, rests, y, way)) for way in _ways(min(unstable, stable))]
    begun = _begun(trial, rests, y)
    sides = {id(way): _side(trial, begun, states, way) for way, _ in shots}
    near = sorted(
        ((w, s) for w, s in shots if s is not None),
        key=lambda one: (-sides[id(one[0])], float(one[1][0])),
    )
    for way, shot in near[:3]:
        words = _beside(trial, begun, near, way) if min(unstable, stable) == 1 else ""
        yield Guess(_through(trial, shot[2], shot[3], y), same, places, words)
    if min(unstable, stable) == 1 and len(y) == 2 and unstable + stable == n:
        for way, shot in near:
            for step in AIMS:
                aimed = _aimed(problem, trial, rests, y, way, shot, step)
                if not aimed:
                    continue
                one = min(aimed, key=lambda one: float(one[0]))
                words = _beside(trial, begun, near, way)
                yield Guess(_through(trial, one[1][0], one[1][1], one[2]), same, places, words)


class Begun(NamedTuple):
    """Where motions along a manifold begin, and where they go."""

    forward: bool
    begin: Rest
    end: Rest
    plane: Array  # a basis of the manifold's plane
    across: Array  # what is orthogonal to the manifold that they are to arrive in
    reach: float  # up to where f is linear, or the size of the orbit


def _begun(trial: Bounded, rests: tuple[Rest, Rest], y: Array) -> Begun:
    """Along the manifold that has fewer dimensions, or over less time."""
    first, last = rests
    unstable, stable = first.unstable(), trial.n - last.unstable()
    forward = unstable < stable or (unstable == stable and not _slower_to_arrive(first, last))
    begin, end = (first, last) if forward else (last, first)
    plane = subspace(begin.A, unstable if forward else stable, stable=not forward).plane
    across = subspace(end.A, stable if forward else unstable, stable=forward).across
    most = max(1.0, float(np.linalg.norm(first.x / trial.scale)))
    reach = min(linear_reach(trial, begin, y, plane), most)
    return Begun(forward, begin, end, _turned(plane), _turned(across), reach)


def _turned(basis: Array) -> Array:
    """A basis whose largest parts are positive."""
    return basis * np.sign(basis[np.argmax(np.abs(basis), axis=0), range(basis.shape[1])])


def _side(trial: Bounded, begun: Begun, states: Sequence[Array], way: Array) -> float:
    """1 or -1 where the state given for the equilibrium lies off it to a side; else 0."""
    given = states[0 if begun.forward else 1]
    off = float((begun.plane @ way) @ ((given - begun.begin.x) / trial.scale))
    return float(np.sign(off)) if len(way) == 1 and abs(off) > ASIDE * begun.reach else 0.0


def _beside(trial: Bounded, begun: Begun, near: list[Any], way: Array) -> str:
    """Words for the orbit on the other side, if the motion there comes back nearly as well."""
    own = next(float(shot[0]) for one, shot in near if one is way)
    rest = begun.begin
    for other, shot in near:
        if other is way or float(shot[0]) > max(BACK, own):
            continue
        state = rest.x + 3.0 * ASIDE * begun.reach * trial.scale * (begun.plane @ other)
        end = "leaves it" if begun.forward else "arrives there"
        place = "first" if begun.forward else "second"
        numbers = ", ".join(f"{x:.12g}" for x in state)
        return (
            f"a motion that {end} on the other side comes near, too, and may be another orbit: "
            f"[{numbers}] as the {place} state looks for that"
        )
    return ""


def _shot(problem: Problem, trial: Bounded, rests: tuple[Any, Any], y: Array, way: Array) -> Any:
    """A motion along a manifold up to where it comes near the other end.

    Its distance from that, by how much it passes on one side, beside its size, times and states;
    None if it never comes near.
    """
    first, last = rests
    forward, begin, end, plane, across, reach = _begun(trial, rests, y)
    scale = trial.scale
    gap = float(np.linalg.norm((last.x - first.x) / scale))
    size = gap or SIZE * reach
    names = [problem.field.parameters[i] for i in trial.active]
    here = problem.replace(**dict(zip(names, y[1:].tolist(), strict=True)))
    run = Simulation(here, scale, 1.0 if forward else -1.0)
    slow = [np.min(np.abs(rest.eigenvalues().real)) for rest in rests]
    longest = PASSES * sum(1.0 / one for one in slow)
    try:
        away = AWAY * min(reach, size)
        start = begin.x + away * scale * (plane @ way)
        at, x = run(start, 0.0, longest, 0, most=MOST, bound=BOUND * size)
    except ConvergenceError:
        return None
    far, gone = (np.linalg.norm((x - rest.x) / scale, axis=1) for rest in (end, begin))
    k = _first_low(far / np.maximum.accumulate(gone))  # beside how far it has been away
    if k < 8:
        return None
    top = float(np.max(gone[: k + 1]))
    passes = float((across.T @ ((x[k] - end.x) / scale))[0]) / top if across.shape[1] else 0.0
    orbit = (at[: k + 1], x[: k + 1]) if forward else (at[k] - at[k::-1], x[k::-1])
    return float(far[k]) / top, passes, *orbit


def _slower_to_arrive(first: Any, last: Any) -> bool:
    """Whether orbits arrive far more slowly than they leave, so that steps back take less time."""
    out, into = first.eigenvalues().real, -last.eigenvalues().real
    return bool(np.min(out[out > 0.0]) > WEAK * np.min(into[into > 0.0]))


def _aimed(
    problem: Problem, trial: Bounded, rests: tuple[Any, Any], y: Array, way: Array,
    shot: Any, step: float,
) -> list[Any]:  # fmt: skip
    """Motions at other values of the one free parameter, which pass the target by less."""
    made = []
    p, best = float(y[1]), shot
    unit = float(trial.width[0]) / WIDTHS
    size = max(abs(p), 1e-2 * unit)
    step *= size
    for _ in range(AIMED):
        if best[0] < NEAR or not abs(step) > 1e-12 * size:
            break
        at = np.array([y[0], p + step])
        moved = tuple(rest_near(trial, rest.x, at) for rest in rests)
        if any(
            now is None or now.unstable() != was.unstable()
            for now, was in zip(moved, rests, strict=True)
        ):
            step *= 0.5  # beyond a fold or a Hopf point
            continue
        other = _shot(problem, trial, (moved[0], moved[1]), at, way)
        if other is None or other[0] > WORSE * best[0]:
            step *= -0.5  # it passes on the other side, or goes elsewhere
            continue
        made.append((other[0], other[2:], at))
        rate = (other[1] - best[1]) / step
        p, best = p + step, other
        most = 0.3 * max(abs(p), 0.1 * unit)
        step = float(np.clip(-best[1] / rate, -most, most)) if rate else 0.0
    return made


def _first_low(far: Array) -> int:
    """The first minimum of a distance that is not much larger than the least."""
    lows = np.flatnonzero((far[1:-1] < far[:-2]) & (far[1:-1] <= far[2:])) + 1
    if not len(lows):
        return int(np.argmin(far))
    good = lows[far[lows] <= 2.0 * np.min(far[lows])]
    return int(good[0])


def _ways(count: int) -> list[Array]:
    """Directions of a plane of one, two or more dimensions."""
    if count == 1:
        return [np.ones(1), -np.ones(1)]
    if count == 2:
        angle = 2.0 * math.pi * np.arange(TRIES) / TRIES
        return list(np.stack([np.cos(angle), np.sin(angle)], axis=1))
    random = np.random.default_rng(7).standard_normal((2 * TRIES, count))
    return list(random / np.linalg.norm(random, axis=1, keepdims=True))
