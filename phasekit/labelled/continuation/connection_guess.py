"""Guesses of connecting orbits: samples of one, or motions along an invariant manifold."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import replace
from typing import Any

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
WEAK = 10.0  # times the rate of arrival, from where on leaving is fast
SAME = 1e-9  # of the equilibrium and of how far the guesses are apart: two ends are one
PASSES = 15.0  # times the slowest time of both ends, over which an orbit is looked for


def guesses(problem: Problem, trial: Bounded, given: Any, y: Array) -> Any:
    """Guesses of the orbit, whether it comes back to its equilibrium, and where its ends are."""
    states = given_states(problem, given)
    if isinstance(given, xr.Dataset):
        return [_of_dataset(problem, trial, given, states, y)]
    rests: list[Any] = [rest_near(trial, x, y) for x in states]
    for rest, x in zip(rests, states, strict=True):
        if rest is None:
            raise bad("orbit", x.tolist(), "states near equilibria")
    first, last = rests
    apart = float(np.max(np.abs((states[0] - states[1]) / trial.scale)))
    return _along_manifold(problem, trial, (first, last), y, _are_one(trial, first, last, apart))


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
    if size == 0.0:
        here = replace(trial, scale=units)
        A = slopes_at(here, states[0], y)[1][:, : trial.n] * units / units[:, None]
        ways = np.cos(np.arange(1.0, trial.n**2 + 1.0)).reshape(trial.n, trial.n)  # of all states
        size = linear_reach(here, Rest(states[0], A, np.zeros((trial.n, 0))), y, ways)
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
) -> tuple[Orbit, bool, tuple[Array, Array]]:
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
    return _through(trial, time - time[0], x, y), same, ends


def _through(trial: Bounded, time: Array, x: Array, y: Array) -> Orbit:
    """An orbit through samples."""
    from scipy.interpolate import PchipInterpolator

    m, length = trial.m, float(time[-1])
    count = int(np.clip(len(time) // m, starts.FIRST, 400))
    rows = np.linspace(0.0, len(time) - 1.0, count + 1)
    mesh = np.interp(rows, np.arange(len(time)), time / length)
    mesh[0], mesh[-1] = 0.0, 1.0
    at = PchipInterpolator(time / length, x, axis=0)(collocation.times(mesh, m))
    return Orbit(mesh, np.ascontiguousarray(at), np.array([length, *y[1:]]))


def _along_manifold(
    problem: Problem, trial: Bounded, rests: tuple[Any, Any], y: Array, same: bool
) -> Iterator[tuple[Orbit, bool, tuple[Array, Array]]]:
    """Motions along the unstable manifold that come near the target, the nearest first.

    Or backwards along the stable manifold of the target, where that has fewer dimensions. Those of
    one parameter are shot at it.
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
    near = sorted(((w, s) for w, s in shots if s is not None), key=lambda one: float(one[1][0]))
    for _, shot in near[:3]:
        yield _through(trial, shot[2], shot[3], y), same, places
    if min(unstable, stable) == 1 and len(y) == 2 and unstable + stable == n:
        for way, shot in near:
            for step in AIMS:
                aimed = _aimed(problem, trial, rests, y, way, shot, step)
                if not aimed:
                    continue
                one = min(aimed, key=lambda one: float(one[0]))
                yield _through(trial, one[1][0], one[1][1], one[2]), same, places


def _shot(problem: Problem, trial: Bounded, rests: tuple[Any, Any], y: Array, way: Array) -> Any:
    """A motion along a manifold up to where it comes near the other end.

    Its distance from that, by how much it passes on one side, beside its size, times and states;
    None if it never comes near.
    """
    first, last = rests
    unstable, stable = first.unstable(), trial.n - last.unstable()
    forward = unstable < stable or (unstable == stable and not _slower_to_arrive(first, last))
    begin, end, sign = (first, last, 1.0) if forward else (last, first, -1.0)
    plane = subspace(begin.A, unstable if forward else stable, stable=not forward).plane
    across = subspace(end.A, stable if forward else unstable, stable=forward).across
    scale = trial.scale
    gap = float(np.linalg.norm((last.x - first.x) / scale))
    most = max(1.0, float(np.linalg.norm(first.x / scale)))
    reach = min(linear_reach(trial, begin, y, plane), most)
    size = gap or SIZE * reach
    names = [problem.field.parameters[i] for i in trial.active]
    here = problem.replace(**dict(zip(names, y[1:].tolist(), strict=True)))
    run = Simulation(here, scale, sign)
    slow = [np.min(np.abs(rest.eigenvalues().real)) for rest in rests]
    longest = PASSES * sum(1.0 / one for one in slow)
    turned = plane * np.sign(plane[np.argmax(np.abs(plane), axis=0), range(plane.shape[1])])
    try:
        away = AWAY * min(reach, size)
        start = begin.x + away * scale * (turned @ way)
        at, x = run(start, 0.0, longest, 0, most=MOST, bound=BOUND * size)
    except ConvergenceError:
        return None
    far, gone = (np.linalg.norm((x - rest.x) / scale, axis=1) for rest in (end, begin))
    k = _first_low(far / np.maximum.accumulate(gone))  # beside how far it has been away
    if k < 8:
        return None
    top = float(np.max(gone[: k + 1]))
    sideways = across * np.sign(across[np.argmax(np.abs(across), axis=0), range(across.shape[1])])
    passes = float((sideways.T @ ((x[k] - end.x) / scale))[0]) / top if across.shape[1] else 0.0
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
