"""From a guess to a curve: sizes of its states, the first equilibrium and its tangent.

A state counts by its size at the start, or by how far it moves while the parameter does its span;
one that is zero and stays so by where f ceases to be linear in it. No unit is better than another.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from phasekit.arrays import Array, Flags
from phasekit.bifurcation.continuation.curve import Curve, neighbours, rounding_shown
from phasekit.bifurcation.continuation.derivatives import Derivatives
from phasekit.bifurcation.continuation.path import Sample, rounded
from phasekit.bifurcation.continuation.points.branch_point import directions_at
from phasekit.bifurcation.continuation.units import nullspace
from phasekit.errors import ConvergenceError

STEP = 2.0**-20  # of an unknown, within which f may have no value


Begun = tuple[Curve, Sample]


def begun(curve: Curve, guess: Array, given: dict[int, float], where: str) -> Begun:
    """The curve with its scales, and its first point, from a guess of an equilibrium."""
    (found,) = begun_cells([curve], [guess], given, where)
    if isinstance(found, Exception):
        raise found
    return found


def begun_cells(
    curves: Sequence[Curve], guesses: Sequence[Array], given: dict[int, float], where: str
) -> list[Begun | Exception]:
    """The same of curves that differ in their parameters and bounds, or why there is none."""
    found: list[tuple[Curve, Array] | Exception] = []
    for curve, guess in zip(curves, guesses, strict=True):
        try:
            found.append(_at_rest(curve, guess, given, where))
        except (ConvergenceError, np.linalg.LinAlgError) as error:
            found.append(error)
    made = iter(_started([one for one in found if not isinstance(one, Exception)], given))
    return [one if isinstance(one, Exception) else next(made) for one in found]


def _at_rest(
    curve: Curve, guess: Array, given: dict[int, float], where: str
) -> tuple[Curve, Array]:
    """The curve with the scales of a guess, and the equilibrium that this leads to."""
    curve = guessed(curve, guess, given)
    u = _equilibrium(curve, guess, where)
    if not np.isfinite(curve.evaluate(u)[1]).all():
        raise ConvergenceError(
            f"x0: the derivatives of f are not finite at the equilibrium x = "
            f"{u[: curve.n].tolist()} that {where} leads to{_edges(curve, u)}; give "
            "another x0, or start beside"
        )
    return curve, u


def _started(
    found: Sequence[tuple[Curve, Array]], given: dict[int, float]
) -> list[Begun | Exception]:
    """Curves with their scales and first points; one by one where not all go alike."""
    if not found:
        return []
    curves, u = [curve for curve, _ in found], np.array([u for _, u in found])
    try:
        curves = scaled(curves, u, given)
        tangents = _tangents(curves, u)
    except (ConvergenceError, np.linalg.LinAlgError) as error:
        if len(found) == 1:
            return [error]
        return [_started([one], given)[0] for one in found]
    return [
        (curve, Sample(point, tangent, curve.evaluate(point)[1]))
        for curve, point, tangent in zip(curves, u, tangents, strict=True)
    ]


def _edges(curve: Curve, u: Array) -> str:
    """Where f has no value right beside a point, in words; nothing if it has one all around."""
    names = [*curve.field.states, *(curve.field.parameters[i] for i in curve.active)]
    steps = STEP * np.maximum(np.abs(u[: curve.m]), curve.scale[: curve.m])
    found = [
        f"{name} {side} {u[j]:.9g}"
        for side, sign in (("below", -1.0), ("above", 1.0))
        for j, name in enumerate(names)
        if not np.isfinite(curve.values(u[None] + sign * steps[j] * np.eye(curve.size)[j])).all()
    ]
    return f": f has no value for {' and '.join(found)}" if found else ""


def _equilibrium(curve: Curve, u: Array, names: str) -> Array:
    """The equilibrium that a guess leads to, its parameters the same to the last bit."""
    n = curve.n
    curve.field.failure = None
    value, _ = curve.evaluate(u)
    if not np.isfinite(value).all():
        failure = curve.field.failure
        said = "" if failure is None else f" (it raised {type(failure).__name__}: {failure})"
        raise ConvergenceError(
            f"x0: f is not finite there{said}: f = {value.tolist()} at {names}; give another x0"
        ) from failure
    row = np.zeros(curve.size)
    row[n] = 1.0
    point = curve.refine(u, row, iterations=30)
    if point.converged and np.isfinite(point.residual).all():
        return rounded(curve, np.append(point.u[:n], u[n:]))

    def vanishes(u: Array) -> bool:
        """Whether f does: beside its terms, and what it was where the search began."""
        found, slopes = curve.evaluate(u)
        size = np.abs(slopes) @ np.abs(u[: curve.m]) + np.abs(value)
        return bool(np.all(np.abs(found) <= 1e-12 * size))

    if not np.any(value):
        return u  # an equilibrium, but one where f_x is singular
    if np.isfinite(point.u).all() and vanishes(point.u):
        return np.append(point.u[:n], u[n:])

    from scipy.optimize import root

    tried = np.array(u)

    def f(x: Array) -> Array:
        tried[:n] = x
        return np.asarray(curve.values(tried[None])[0])

    def jacobian(x: Array) -> Array:
        tried[:n] = x
        return curve.evaluate(tried)[1][:, :n]

    for method in ("hybr", "lm"):
        try:
            with np.errstate(all="ignore"):
                found = root(f, u[:n], jac=jacobian, method=method, tol=1e-12)
        except (ValueError, ArithmeticError):
            continue
        guess = np.append(found.x, u[n:])
        point = curve.refine(guess, row, iterations=30)
        close = np.max(np.abs(point.u - guess) / np.maximum(curve.scale, np.abs(guess))) < 1e-3
        if point.converged and close:
            return np.append(point.u[:n], u[n:])
        if vanishes(guess):
            return guess
    raised = curve.field.raised.replace(":", "; on the way", 1)
    raise ConvergenceError(
        f"x0: no equilibrium was found from {names} (|f| = {np.max(np.abs(value)):.3g} there) by "
        f"Newton's method, Powell's hybrid method or Levenberg-Marquardt{raised}"
        f"{_edges(curve, u)}; give an x0 that is closer"
    ) from curve.field.failure


def _tangents(curves: Sequence[Curve], u: Array) -> Array:
    """The unit tangents of curves towards a larger parameter, at a point of each.

    At a branch point that of the steepest.
    """
    n = curves[0].n
    slopes = np.array([curve.evaluate(one)[1] for curve, one in zip(curves, u, strict=True)])
    scale, weight = (np.array([getattr(c, x) for c in curves]) for x in ("scale", "weight"))
    t, regular = _regular_tangents(curves[0], scale[:, : curves[0].m], slopes)
    for k in np.flatnonzero(~regular).tolist():
        t[k] = _steepest(curves[k], u[k], slopes[k])
    t = t / np.sqrt(np.add.reduce(weight * t**2, axis=1))[:, None]
    largest = t[np.arange(len(t)), np.abs(t[:, :n]).argmax(axis=1)]
    lead = np.where(np.abs(t[:, n]) > 1e-9 * scale[:, n], t[:, n], largest)
    return np.asarray(np.where(lead[:, None] < 0.0, -t, t))


def _steepest(curve: Curve, u: Array, slopes: Array) -> Array:
    """The tangent by singular values; of several that of the steepest branch."""
    directions = nullspace(slopes, curve.scale[: curve.m])
    if len(directions) > 1:
        return max(directions_at(curve, u), key=lambda t: abs(t[curve.n]), default=directions[0])
    t: Array = directions[0]
    with np.errstate(all="ignore"):
        # Elimination leaves zero what is zero, where rounding would lead away from it.
        row = t / curve.scale[: curve.m] ** 2
        try:
            exact = np.linalg.solve(np.vstack([slopes, row]), np.eye(curve.m)[-1])
        except np.linalg.LinAlgError:
            return t
    return exact if curve.length(exact - t) < 1e-6 * curve.length(t) else t


#: Largest entries of the inverse of f_x, in units of its rows and of the states, of regular points.
STIFF = 1e3


def _regular_tangents(curve: Curve, scale: Array, slopes: Array) -> tuple[Array, Flags]:
    """Tangents of branches where f_x is far from singular; what is zero stays it."""
    n, found = curve.n, np.zeros((len(slopes), curve.m))
    if curve.m != n + 1:
        return found, np.zeros(len(slopes), dtype=bool)
    scaled = slopes * scale[:, None]
    rows = np.abs(scaled).max(axis=2, keepdims=True)
    regular = np.all(rows > 0.0, axis=(1, 2))
    with np.errstate(all="ignore"):
        left, right = scaled[..., :n] / rows, -scaled[..., n:] / rows
    sides = np.zeros((len(slopes), n, n + 1))
    sides[..., :1], sides[..., 1:] = right, np.eye(n)
    for k in np.flatnonzero(~regular).tolist():
        left[k], sides[k] = np.eye(n), 0.0
    solved = _solved(left, sides)
    with np.errstate(all="ignore"):
        regular &= np.max(np.abs(solved), axis=(1, 2)) < STIFF
    found[:, :n], found[:, n] = solved[..., 0], 1.0
    return found * scale, regular


def _solved(matrices: Array, sides: Array, rcond: float | None = None) -> Array:
    """Solutions of many systems; of singular ones NaN, or the shortest."""
    try:
        return np.asarray(np.linalg.solve(matrices, sides))
    except np.linalg.LinAlgError:
        if len(matrices) > 1:
            both = zip(matrices, sides, strict=True)
            return np.concatenate([_solved(a[None], b[None], rcond) for a, b in both])
    if rcond is None:
        return np.full_like(sides, np.nan)
    return np.asarray(np.linalg.lstsq(matrices[0], sides[0], rcond=rcond)[0][None])


EPSILON = 2.0**-52
FAR = 10.0  # a state that moves by less than this part of its size counts by its motion
MANY = 20  # states that are looked at by themselves; others follow from them
LARGE = 1e8  # a state that grows so many times beyond its scale leaves the picture
SMALL = 1e-3  # guesses below tell little of the size of a state
WIDEST = -59  # so many times may a step be doubled where no size is known
APART = 0.7 * 64.0 ** np.arange(-10.0, 4.0)  # distances of neighbours that may show rounding
PART = 0.1  # of f, by which a state that was guessed as zero changes it
AWAY = SMALL * 4.0 ** np.arange(40.0)  # distances at which it is tried
QUARTERS = 4.0 ** -np.arange(40.0)  # parts of a motion that are tried


def guessed(curve: Curve, u: Array, given: dict[int, float]) -> Curve:
    """The curve with scales of its states from a guess, to be used until it is an equilibrium."""
    n = curve.n
    scale = curve.scale.copy()
    scale[:n] = np.maximum(np.abs(u[:n]), SMALL)
    for i in range(n):
        scale[i] = given.get(i, scale[i])
    angle = curve.period[:n] > 0.0
    scale[:n][angle] = curve.period[:n][angle] / (2.0 * np.pi)
    curve = curve.replace(scale=scale)
    small = [i for i in range(n) if abs(u[i]) < SMALL and i not in given and not angle[i]]
    if small and not curve.knows_slopes:  # differences need steps that suit a state
        natural = _natural(curve, u, small)
        for i in small:
            size = natural[i] if i in natural else max(_felt(curve, u, i), scale[i])
            scale[i] = max(size, abs(u[i]))
    return curve


def _felt(curve: Curve, u: Array, place: int) -> float:
    """How far a state moves before f changes by a good part of what it is; 0 if it never does.

    Differences over much less are lost in rounding of f.
    """
    near = np.repeat(u[None], len(AWAY), axis=0)
    near[:, place] += AWAY
    here = np.abs(curve.values(u[None])[0])
    with np.errstate(all="ignore"):
        change = np.abs(curve.values(near) - curve.values(u[None]))
        felt = np.any((change >= PART * here) & (here > 0.0) & np.isfinite(change), axis=1)
    return float(AWAY[np.argmax(felt)]) if felt.any() else 0.0


def scaled(curves: Sequence[Curve], u: Array, given: dict[int, float]) -> list[Curve]:
    """Curves with scales of their states: given, of angles, or from the start and its slope."""
    n, period = curves[0].n, curves[0].period
    free = np.array([i not in given and period[i] == 0.0 for i in range(n)])
    motion, unknown = _motions(curves, u)
    at = np.abs(u[:, :n])
    size = np.maximum(at, motion)
    # What it does is small beside where it is.
    still = (unknown < motion) & (motion < at / FAR)
    size = np.where(still, np.maximum(FAR * motion, 1e-6 * at), size)
    scale = np.array([curve.scale for curve in curves])
    for i, number in given.items():
        scale[:, i] = number
    known = ~free | (size > unknown)
    scale[:, :n] = np.where(free & known, size, scale[:, :n])
    for k in np.flatnonzero(~known.all(axis=1)).tolist():
        scale[k] = _completed(curves[k], u[k], scale[k], np.flatnonzero(~known[k]))
    low, high = (np.array([getattr(curve, x) for curve in curves]) for x in ("low", "high"))
    endless = np.isinf(low[:, :n]) & np.isinf(high[:, :n]) & (period[:n] == 0.0)
    reach = LARGE * np.maximum(np.maximum(scale[:, :n], at), 1.0)
    low[:, :n] = np.where(endless, u[:, :n] - reach, low[:, :n])
    high[:, :n] = np.where(endless, u[:, :n] + reach, high[:, :n])
    rows = zip(curves, scale, low, high, strict=True)
    return [curve.replace(scale=one, low=a, high=b) for curve, one, a, b in rows]


def _completed(curve: Curve, u: Array, scale: Array, zero: npt.NDArray[np.intp]) -> Array:
    """Scales with those of states of which neither place nor motion tells any."""
    n, scale = curve.n, scale.copy()
    natural = _natural(curve, u, zero.tolist())
    scale[zero] = [natural.get(i, np.nan) for i in zero.tolist()]
    middle = np.nanmedian(scale[zero]) if natural else 1.0
    there = curve.replace(scale=np.where(np.isnan(scale), middle, scale))
    scale[:n] = _balanced(there.evaluate(u)[1][:, :n], scale[:n])
    return scale


def _motions(curves: Sequence[Curve], u: Array) -> tuple[Array, Array]:
    """By how much states move along the span, and by how much they are known, of many curves.

    They move until f changes as much as it does at the ends of the span, by f_x, and no farther
    than f is still like that.
    """
    n, m = curves[0].n, curves[0].m
    jets = [curve.evaluate(one) for curve, one in zip(curves, u, strict=True)]
    value, slopes = (np.array([jet[i] for jet in jets]) for i in (0, 1))
    ends = np.repeat(u[:, None, :m], 2, axis=1)
    ends[..., n] = [(curve.low[n], curve.high[n]) for curve in curves]
    with np.errstate(all="ignore"):
        forces = _values(curves, ends) - value[:, None]
    bad = ~np.isfinite(forces).all(axis=2)
    if bad.any() and len(curves) > 1:  # nothing more is asked of f where it has no value
        one_by_one = [_motions([one], x[None]) for one, x in zip(curves, u, strict=True)]
        motion, unknown = (np.concatenate(part) for part in zip(*one_by_one, strict=True))
        return motion, unknown
    forces[bad] = np.repeat([slopes[0, :, n] * curves[0].scale[n]], np.sum(bad), axis=0)
    rounding = EPSILON * (np.abs(slopes) @ np.abs(u[:, :m, None]))[..., 0]
    told = np.concatenate([u[:, None, :m], ends[:, ~bad[0]]], axis=1)
    shown = rounding_shown(_values(curves, neighbours(told)).reshape(*told.shape[:2], -1, n))
    rounding = np.maximum(rounding, shown.max(axis=1))
    signs = np.where(np.arange(n) % 2, -1.0, 1.0)
    sides = np.stack([-forces[:, 0], -forces[:, 1], rounding, signs * rounding], axis=2)
    with np.errstate(all="ignore"):  # elimination leaves zero what is zero
        found = _solved(slopes[..., :n], sides, rcond=1e-10).swapaxes(1, 2)
    both = found[:, :2]
    both = np.where(np.isfinite(both).all(axis=2, keepdims=True), both, 0.0)
    motion = _within(curves, u, both, value, slopes, rounding).max(axis=1)
    return motion, 100.0 * np.max(np.abs(found[:, 2:]), axis=1)


def _values(curves: Sequence[Curve], points: Array) -> Array:
    """F at points of many curves, shape (curves, points, states)."""
    pars = np.array([curve.par for curve in curves])
    with np.errstate(all="ignore"):
        found = curves[0].field.values_of_cells(points, pars, curves[0].active)
    return np.asarray(found)


def _within(
    curves: Sequence[Curve], u: Array, motions: Array, value: Array, slopes: Array, rounding: Array
) -> Array:
    """The parts of motions along which f changes no more than twice what its slopes say."""
    n, m = curves[0].n, curves[0].m
    trials = np.empty((*motions.shape[:2], len(QUARTERS), m))
    trials[:] = u[:, None, None, :m]
    trials[..., :n] += QUARTERS[:, None] * motions[:, :, None]
    terms = (np.abs(slopes[..., :n]) @ np.abs(motions).swapaxes(1, 2)).swapaxes(1, 2)
    with np.errstate(all="ignore"):
        found = _values(curves, trials.reshape(len(u), -1, m)) - value[:, None]
        change = np.abs(found).reshape(*trials.shape[:3], n)
        limit = 2.0 * terms[:, :, None] + 10.0 * rounding[:, None, None]
        fine = np.all(change <= limit, axis=-1)
    part = np.where(fine.any(axis=2), QUARTERS[np.argmax(fine, axis=2)], 0.0)
    return np.asarray(part[..., None] * np.abs(motions))


def _natural(curve: Curve, u: Array, places: list[int]) -> dict[int, float]:
    """The sizes at which f ceases to be linear in states, of some of many, where there are such."""
    chosen = sorted({places[k] for k in np.linspace(0, len(places) - 1, MANY).round().astype(int)})
    d = Derivatives(curve, u)
    # Of many states formulas have long third derivatives.
    d.exact &= curve.n <= MANY
    d.widest = WIDEST
    d.doubt(_hidden(curve, u, chosen))
    sizes = {}
    for i in chosen:
        e = np.zeros(curve.n)
        e[i] = 1.0
        slope = np.abs(d.first(e).value)
        found: list[float] = []
        for order, form in ((1, d.second(e, e)), (2, d.third(e, e, e))):
            known = (np.abs(form.value) > 10.0 * form.error) & (slope > 0.0)
            ratio = slope[known] / np.abs(form.value[known])
            found.extend((ratio ** (1.0 / order)).tolist())
        if found:
            sizes[i] = min(found)
    return sizes


def _hidden(curve: Curve, u: Array, places: list[int]) -> Array:
    """Rounding errors that f makes inside, seen between neighbours as far apart as shows them.

    Nearer ones differ by nothing, farther ones by what f is.
    """
    noise = np.zeros(curve.n)
    shown = np.zeros(curve.n)
    steps = np.arange(-3.0, 6.0)
    for apart in APART:
        near = np.repeat(u[None], len(steps), axis=0)
        near[:, places] += apart * steps[:, None]
        with np.errstate(all="ignore"):
            level = np.sqrt(np.mean(np.diff(curve.values(near), n=4, axis=0) ** 2, axis=0) / 70.0)
        level = np.where(np.isfinite(level) & (shown < 3), level, 0.0)
        noise, shown = np.maximum(noise, level), shown + (level > 0.0)
    return noise


def _balanced(slopes: Array, sizes: Array) -> Array:
    """Sizes of the other states (NaN): those with which their terms are as large as known ones."""
    slopes, sizes = np.abs(slopes), sizes.copy()
    while True:
        known = np.isfinite(sizes)
        terms = np.max(slopes[:, known] * sizes[known], axis=1, initial=0.0)
        found = {}
        for j in np.flatnonzero(~known).tolist():
            parts = slopes[terms > 0.0, j] / terms[terms > 0.0]
            parts = parts[parts > 1e-6 * np.max(parts, initial=0.0)]
            if len(parts):
                found[j] = 1.0 / np.sqrt(np.max(parts) * np.min(parts))
        if not found:
            return np.where(known, sizes, 1.0)
        sizes[list(found)] = list(found.values())
