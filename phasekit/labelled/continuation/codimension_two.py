"""What begins at points of codimension two of equilibria: other curves, and curves of cycles.

Curves of folds and Hopf points pass through such a point as regular solutions of their own
equations, so they start from it. Curves of cycles begin there with amplitude zero, where their
equations are singular: the family of a Hopf point beside it is followed to its first fold or torus,
and the curve of these from there to both sides.
"""

from __future__ import annotations

import contextlib
from collections.abc import Iterator
from dataclasses import replace
from typing import Any

import numpy as np

from phasekit.arrays import Array
from phasekit.bifurcation.continuation.curve import Curve, Stop, Track
from phasekit.bifurcation.continuation.curve_walk import CurveWalk
from phasekit.bifurcation.continuation.derivatives import Derivatives
from phasekit.bifurcation.continuation.fourfold import FourfoldPoints, circle_beside
from phasekit.bifurcation.continuation.kernels.defining import EQUILIBRIUM, FOLD, HOPF
from phasekit.bifurcation.continuation.options import ContinuationOptions
from phasekit.bifurcation.continuation.points.bogdanov_takens import chain
from phasekit.bifurcation.continuation.points.pair import normal_form, plane_of
from phasekit.bifurcation.continuation.points.special import Special
from phasekit.bifurcation.continuation.reduction import simple
from phasekit.bifurcation.continuation.two_parameters import two_parameter_curve
from phasekit.bifurcation.continuation.walk import run
from phasekit.bifurcation.special_points import KINDS
from phasekit.cycles import starts
from phasekit.cycles.cycle_walk import CycleWalk
from phasekit.cycles.small_loops import SmallLoops
from phasekit.errors import ConvergenceError, ParameterError
from phasekit.inputs import is_whole
from phasekit.labelled.continuation.branch import Branch, branch_of
from phasekit.labelled.continuation.checks import check_options, folding, refuse_guess
from phasekit.labelled.continuation.connection import small_loops
from phasekit.labelled.continuation.cycle_branch import CycleBranch
from phasekit.labelled.continuation.cycle_onward import point_curve
from phasekit.labelled.continuation.cycle_points import CyclePoint, refined_points
from phasekit.labelled.continuation.cycle_start import continue_orbit
from phasekit.labelled.continuation.special_point import SpecialPoint
from phasekit.labels.arguments import bad
from phasekit.systems.cycle_families import cycles_of, first_point
from phasekit.systems.problem import Problem

#: The curves that begin at points of a kind, or pass through them.
BEGINS = {
    "bogdanov_takens": ("hopf", "fold", "homoclinic"),
    "generalized_hopf": ("fold_of_cycles",),
    "zero_hopf": ("hopf", "fold", "torus"),
    "hopf_hopf": ("hopf", "torus"),
    "resonance_4": ("fold",),
}
#: What begins where nothing is followed.
NONE = {
    "cusp": "the two folds that meet there are the curve itself",
    "resonance_1": "a curve of homoclinic tangles and a closed curve, no fixed points: closed "
    "curves are not followed",
    "resonance_3": "a saddle of period 3 that shrinks to the point on both sides, no curve; and "
    "homoclinic tangles, which are not followed",
    "chenciner": "a curve on which two closed curves merge: closed curves are not followed",
    **dict.fromkeys(
        ("generalized_flip", "resonance_2", "fold_flip"),
        "curves of orbits of period 2, as fixed points of problem.iterated(2): follow those",
    ),
}

SIZES = (0.1, 0.03, 0.3)  # of cycles that fold beside the point, in scales of the states
MOST, FEW = 200, 40  # points of a family within which a fold or a torus is looked for
BESIDE = (0.01, -0.01, 0.03, -0.03, 0.003, -0.003)  # on scaled axes: Hopf points beside the point
FARTHEST = 0.2  # of them
SHRUNK = 1e-4  # size of orbits, on scaled axes, that shrink to a point
NEAR = 1e-3  # step by which l1 is differentiated


def begun(
    point: SpecialPoint[Branch], kind: str | None, direction: int,
    options: ContinuationOptions | None,
) -> Branch | CycleBranch:  # fmt: skip
    """A curve in two parameters that begins at a point of codimension two."""
    if point.kind in NONE:
        raise bad("point", point.kind, "a point at which another curve begins", NONE[point.kind])
    ways = BEGINS.get(point.kind)
    if ways is None:
        raise bad("point", point.kind, f"one of {', '.join(BEGINS)}")
    if kind is None:
        kind = next(one for one in ways if one != point.branch.kind or point.kind == "hopf_hopf")
    if not isinstance(kind, str) or kind not in ways:
        raise bad("kind", kind, " or ".join(map(repr, ways)), f"at a {point.kind} point")
    refuse_guess(point)
    several = (kind == "torus" and point.kind == "hopf_hopf") or point.kind == "resonance_4"
    if not is_whole(direction) or not 0 <= direction <= several:
        raise bad("direction", direction, "0 or 1" if several else "0: there is one such curve")
    curve, problem = point.branch.curve, point.branch.problem
    if options is not None:
        options = check_options(options)
        low, high = curve.low.copy(), curve.high.copy()
        for i, name in enumerate(point.branch.free, curve.n):
            low[i], high[i] = options.bounds.get(name, (low[i], high[i]))
        curve = curve.replace(options=options, low=low, high=high)
    if point.kind == "resonance_4":
        return _of_fourfold(point, curve, problem, direction)
    if kind == "homoclinic":
        return _of_loops(point, curve, problem)
    if kind in ("fold", "hopf"):
        return _of_equilibria(point, kind, curve, problem)
    return _of_cycles(point, kind, curve, problem, direction)


def _alone(curve: Curve, u: Array) -> Curve:
    """The equilibria of a curve over both parameters, these at their values of a point."""
    n, m = curve.n, curve.m
    par = curve.par.copy()
    par[list(curve.active)] = u[n:m]
    return curve.replace(
        kind=EQUILIBRIUM, par=par, scale=curve.scale[:m], period=curve.period[:m],
        low=curve.low[:m], high=curve.high[:m], aux=None,
    )  # fmt: skip


def _of_equilibria(
    point: SpecialPoint[Branch], kind: str, curve: Curve, problem: Problem
) -> Branch:
    """The curve of folds or Hopf points through a point."""
    u = point.special.u
    alone = _alone(curve, u)
    other = kind == "hopf" and point.kind == "hopf_hopf"
    omega = _own_frequency(curve, point) if other else None
    extra = _added(alone, u, kind, point.kind, omega)
    special = replace(point.special, kind=kind, extra=extra)
    found = two_parameter_curve(alone, special, FOLD if kind == "fold" else HOPF)
    if found is None:
        raise ConvergenceError(f"switch: Newton's method found no {kind} curve through {point!r}")
    made, start = found
    return branch_of(Branch, problem, CurveWalk(made), start, {})


def _of_fourfold(
    point: SpecialPoint[Branch], curve: Curve, problem: Problem, direction: int
) -> Branch:
    """The curve of folds of orbits of period 4 that begins at a resonance 1:4 of a map."""
    n, four = curve.n, problem.iterated(4)
    orbits = FourfoldPoints(_alone(curve, point.special.u), point.special.u)
    circle, size = folding(point, circle_beside(orbits.parameters_at))
    found = orbits.orbit(size, 0.25 * circle.folds[direction])
    assert found is not None
    u = np.append(found[:n], found[-2:])
    alone = _alone(curve.replace(field=four.field), u)
    scale = curve.scale[:n]
    rows = alone.evaluate(u)[1][:, :n] * scale / scale[:, None]
    v = np.linalg.svd(rows)[2][-1]
    special = replace(point.special, kind="fold", u=u, extra=v * scale)
    begun = two_parameter_curve(alone, special, FOLD)
    if begun is None:
        raise ConvergenceError(f"switch: beside {point!r} no fold of orbits of period 4 was found")
    made, start = begun
    walker = CurveWalk(made)
    tracks = run(walker, start, curve.options.directions)
    names = point.branch.free
    where = ", ".join(f"{name} = {point.parameters[name]:.9g}" for name in names)
    ends = [
        track and _ending_in(made, point.special.u, f"the resonance 1:4 at {where}", track)
        for track in tracks
    ]
    return branch_of(Branch, four, walker, start, {}, (ends[0], ends[1]))


def _ending_in(curve: Curve, u: Array, where: str, track: Track) -> Track:
    """A track of orbits of period 4 that shrink to a fixed point, with that as its end."""
    gap = (track.record[-1, : curve.m] - u) / curve.scale[: curve.m]
    if track.stop.reason != "stuck" or np.max(np.abs(gap)) > SHRUNK:
        return track
    return replace(track, stop=Stop("resonance_4", f"the orbits shrink to a point at {where}"))


def _of_loops(point: SpecialPoint[Branch], curve: Curve, problem: Problem) -> CycleBranch:
    """The curve of homoclinic orbits that begins at a Bogdanov-Takens point."""
    form = point.normal_form
    if not all(np.isfinite(form[name]) and form[name] for name in ("a", "b")):
        raise bad(
            "kind", "homoclinic", "'fold' or 'hopf'",
            f"a = {form['a']:.6g}, b = {form['b']:.6g} of the normal form have to be known and not "
            "zero",
        )  # fmt: skip
    try:
        loops = SmallLoops(curve, point.special.u)
    except np.linalg.LinAlgError as error:
        raise ConvergenceError(f"switch: {error}: no homoclinic orbits begin there") from error
    free, n, m = point.branch.free, curve.n, curve.m
    spans = list(zip(curve.low[n:m].tolist(), curve.high[n:m].tolist(), strict=True))
    return small_loops(problem, free, spans, loops, curve.options)


def _own_frequency(curve: Curve, point: SpecialPoint[Branch]) -> float:
    """The frequency of the pair that a Hopf curve follows."""
    assert point.special.extra is not None
    return float(np.sqrt(point.special.extra[curve.n]))


def _added(curve: Curve, u: Array, kind: str, at: str, omega: float | None) -> Array:
    """The unknowns that the equations of a fold or of a Hopf point add, and what holds them."""
    n, scale = curve.n, curve.scale[: curve.n]
    d = Derivatives(curve, u)
    A = d.slopes[:, :n]
    if at == "bogdanov_takens":
        q0, q1, _, _ = chain(d, A)
        v, kappa = (q0, 0.0) if kind == "fold" else (q1, 0.0)
    elif kind == "fold":
        v, kappa = np.real(simple(d, 0.0)[0]), 0.0
    else:
        values, vectors = np.linalg.eig(A * scale / scale[:, None])
        above = np.flatnonzero(values.imag > 0.0)
        above = above[np.argsort(np.abs(values.real[above]))][: 1 if omega is None else 2]
        if omega is not None:  # the pair that is not followed yet
            above = above[np.argsort(-np.abs(values.imag[above] - omega))]
        k = above[0]
        v, kappa = vectors[:, k].real * scale, float(values.imag[k] ** 2)
    v = v / scale / np.linalg.norm(v / scale)
    if kind == "fold":
        return np.asarray(v * scale)
    return np.concatenate(plane_of(A, scale, v, kappa))


def _of_cycles(
    point: SpecialPoint[Branch], kind: str, curve: Curve, problem: Problem, direction: int
) -> CycleBranch:
    """The curve of folds or tori of cycles that begins at a point."""
    _refuse_by_signs(point, kind)
    hopf, special = curve, point.special
    if curve.kind != HOPF or (point.kind == "hopf_hopf" and direction == 1):
        # The family is that of the other Hopf curve.
        omega = _own_frequency(curve, point) if curve.kind == HOPF else None
        alone = _alone(curve, special.u)
        extra = _added(alone, special.u, "hopf", point.kind, omega)
        found = two_parameter_curve(alone, replace(special, extra=extra), HOPF)
        if found is None:
            raise ConvergenceError(f"switch: no Hopf curve was found through {point!r}")
        hopf, start = found
        m = curve.m
        special = replace(special, u=start.u[:m], extra=start.u[m:], tangent=start.tangent)
    n, label = curve.n, KINDS[kind].label
    spans = {
        name: (float(curve.low[n + i]), float(curve.high[n + i]))
        for i, name in enumerate(point.branch.free)
    }
    for u in _beside(hopf, special):
        values = dict(zip(spans, (float(v) for v in u[n : n + 2]), strict=True))
        there = problem.replace(**values)
        for name in _by_rate(hopf, u, list(spans)):
            found_there = _first(hopf, there, name, u, label, spans)
            if found_there is not None:
                first = found_there.branch.parameter
                (second,) = set(spans) - {first}
                options = replace(curve.options, bounds={**curve.options.bounds, **spans})
                return point_curve(found_there, second, spans[second], options)
    raise ConvergenceError(
        f"switch: beside {point!r} no {label} point was found on the families of Hopf points"
    )


def _refuse_by_signs(point: SpecialPoint[Branch], kind: str) -> None:
    """Say where a normal form has no torus."""
    form = point.normal_form
    if point.kind == "zero_hopf" and kind == "torus" and form["c"] * form["d"] > 0.0:
        raise bad(
            "kind", kind, "'hopf' or 'fold'",
            f"no torus begins here: c d = {form['c'] * form['d']:.6g} of the normal form is "
            "positive, so that its cycles are saddles",
        )  # fmt: skip


def _beside(curve: Curve, special: Special) -> Iterator[Array]:
    """Hopf points of a curve on both sides of a point, where cycles may have folds or tori."""
    n, m = curve.n, curve.m
    assert special.extra is not None
    assert special.tangent is not None
    u = np.concatenate([special.u, special.extra[: n + 1]])
    t = special.tangent / curve.length(special.tangent)

    def moved(shift: float) -> Array | None:
        found = curve.refine(u + shift * t, curve.weight * t)
        return found.u if found.converged and found.u[m + n] > 0.0 else None

    shifts = _to_folds(curve, special, u, moved) if special.kind == "generalized_hopf" else BESIDE
    for shift in shifts:
        found = moved(shift)
        if found is not None:
            yield found


def _to_folds(curve: Curve, special: Special, u: Array, moved: Any) -> Iterator[float]:
    """How far Hopf points are from a generalized one whose cycles fold at some sizes."""
    n, m = curve.n, curve.m
    step = NEAR
    ends = [moved(step), moved(-step)]
    while any(one is None for one in ends) and step > 1e-3 * NEAR:
        step *= 0.1
        ends = [moved(step), moved(-step)]
    if any(one is None for one in ends):
        return
    l1 = [normal_form(Derivatives(curve, v), float(np.sqrt(v[m + n])))["l1"] for v in ends]
    q, _ = simple(Derivatives(curve, u), 1j * float(np.sqrt(u[m + n])))
    unit = float(np.max(2.0 * np.abs(q) / curve.scale[:n]))
    for size in SIZES:  # r^2 = -l1/(2 l2) at the fold
        square = (size / unit) ** 2
        shift = -4.0 * step * special.normal_form["l2"] * square / (l1[0] - l1[1])
        if np.isfinite(shift):
            yield float(np.clip(shift, -FARTHEST, FARTHEST))


def _by_rate(curve: Curve, u: Array, names: list[str]) -> list[str]:
    """Both parameters, first the one that moves the pair faster over its span."""
    n, m = curve.n, curve.m
    d = Derivatives(curve, u)
    q, p = simple(d, 1j * float(np.sqrt(u[m + n])))
    rates = []
    for j in (n, n + 1):
        motion = np.zeros(m)
        motion[:n] = -np.linalg.solve(d.slopes[:, :n], d.slopes[:, j])
        motion[j] = 1.0
        rates.append(abs(np.real(d.second(q, motion).dot(p).value)) * curve.scale[j])
    return names if rates[0] >= rates[1] else names[::-1]


def _first(
    curve: Curve, problem: Problem, name: str, u: Array, label: str, spans: dict[str, Any]
) -> CyclePoint[CycleBranch] | None:
    """The first special point of a kind on the family of a Hopf point.

    If there is none, on the family that leaves it over the other parameter.
    """
    n, m = curve.n, curve.m
    omega = float(np.sqrt(u[m + n]))
    q, _ = simple(Derivatives(curve, u), 1j * omega)
    options = ContinuationOptions(
        max_points=MOST if label == "LPC" else FEW, intervals=curve.options.intervals,
        degree=curve.options.degree,
    )  # fmt: skip
    cycles = cycles_of(problem, [name], [spans[name]], curve.scale[:n], np.zeros(n), options)
    cycles = cycles.replace(ends=(label,))
    p = problem.parameters[name]
    found = starts.from_hopf(cycles, u[:n], p, omega, q)
    if not found.converged:
        return None
    where = f"near the Hopf point at {name} = {p:.9g}"
    start, walker = first_point(cycles, found, where), CycleWalk(cycles)
    tracks = run(walker, start, "forward")
    origin = Stop("hopf", where)
    family = branch_of(CycleBranch, problem, walker, start, {}, tracks, origin)
    points = refined_points(family, label)
    if points or label == "LPC":
        return points[0] if points else None
    (other,) = set(spans) - {name}
    orbit = family.orbit(-1)
    there = problem.replace(**{name: float(orbit[name])})
    with contextlib.suppress(ConvergenceError, ParameterError):
        family = continue_orbit(there, other, orbit, spans[other], {}, options, stop=[label])
        points = refined_points(family, label)
    return points[0] if points else None
