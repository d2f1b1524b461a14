"""From a guess of many states to the start of a curve: its size, its symmetry, its tangent."""

from __future__ import annotations

from typing import Any

import numpy as np
import scipy.sparse as sp

from phasekit.arrays import Array
from phasekit.bifurcation.continuation.large.curve import ROUNDING, Corrected, LargeCurve
from phasekit.bifurcation.continuation.large.field import STEP
from phasekit.bifurcation.continuation.large.singular import Border, border_at
from phasekit.bifurcation.continuation.start import LARGE
from phasekit.errors import ConvergenceError, ParameterError
from phasekit.numerics.factors import Bordered, Factors, inner, is_symmetric, refuse_fill
from phasekit.numerics.waits import stage

STEPS = 60
SHORTEST = 2.0**-20  # part of a Newton step
WRONG = (
    1e-3  # part by which derivatives differ from differences of f, which says that they are wrong
)
PROBES = 2
BESIDE = (1e-2, 1e-3, 1e-4)  # of the span
EPSILON = 2.0**-52  # of terms that cancel in an eigenvalue, up to which it is zero
DIFFERENCED = 1e-11  # the same of derivatives by differences
LOOSE = 16.0  # times as much, where another equilibrium says the same
NOTHING = 1e-12  # of the size before, up to which a field is zero but for rounding
# Of STEP: finer ones where f bends over one, coarser ones where rounding hides what f does.
PARTS = (1.0, 2.0**-6, 2.0**-12, 2.0**-18, 2.0**12, 2.0**24, 2.0**36)
RELAXED = 300  # steps of a relaxation
FALLEN = 1e-9  # of the terms of f, from where on Newton's method goes on


def settle(curve: LargeCurve, u: Array, given: dict[str, float]) -> tuple[LargeCurve, Array]:
    """The curve with sizes of its fields, and the equilibrium that a guess leads to.

    Raises
    ------
    ParameterError
        If ``jac`` is not what differences of f say.
    ConvergenceError
        If f is not finite there, or Newton's method finds no equilibrium.
    """
    curve = sized(curve, u, given)
    guess = curve.scale
    value = curve.value(u)
    if not np.isfinite(value).all():
        raise ConvergenceError(
            f"x0: f is not finite there{curve.sparse.raised}; give another x0"
        ) from curve.sparse.failure
    matrix, slope = curve.derivatives(u)
    check_derivatives(curve, u, matrix)
    refuse_fill(matrix)
    found = _newton(curve, u)
    if found is None:
        relaxed = _relaxed(curve, u)
        found = _newton(curve, relaxed)
    if found is None:  # where f_x is singular, rounding decides how far along its kernel steps go
        border = _border_of(curve, curve.derivatives(relaxed)[0])
        held = _newton(curve, relaxed, border)
        found = held if held is not None and _rests(curve, held, border) else None
    if found is None:
        raise ConvergenceError(
            f"x0: no equilibrium was found from there (|f| = {float(np.max(np.abs(value))):.3g}) "
            "by Newton's method, nor by following x' = f(x) to its end; give an x0 that is closer; "
            "or, of fields far from 1 in size that begin at 0, these sizes as options.scales"
        )
    curve = sized(curve, found, given, guess=guess)  # a guess of zeros says nothing of sizes
    again = _newton(curve, found)
    u = found if again is None else again
    matrix, slope = curve.derivatives(u)
    if not (np.isfinite(matrix.data).all() and np.isfinite(slope).all()):
        raise ConvergenceError(
            f"x0: the derivatives of f are not finite at the equilibrium that it leads to"
            f"{curve.sparse.raised}; give another x0, or start beside"
        )
    _refuse_singular(curve, u, matrix)
    curve = curve.replace(symmetric=is_symmetric(matrix, curve.sparse.differenced))
    motion = Factors(matrix).solve(-slope) * (curve.high[curve.n] - curve.low[curve.n])
    return sized(curve, u, given, motion, guess), u


def _refuse_singular(curve: LargeCurve, u: Array, matrix: Any) -> None:
    """Refuse an equilibrium with f_x singular there, unless it is where branches cross.

    Raises
    ------
    ConvergenceError
        If it is a fold, if f_x is singular next to it, too, or if that is not known.
    """
    border = _border_of(curve, matrix)
    if not _is_singular(curve, matrix, border):
        return
    n, found = curve.n, None
    side = 1.0 if u[n] <= 0.5 * (curve.low[n] + curve.high[n]) else -1.0
    for part in BESIDE:
        near = np.array(u)
        near[n] += part * side * (curve.high[n] - curve.low[n])
        found = _newton(curve, near, border)  # without its border, f_x may be singular there, too
        if found is not None:
            break
    else:
        raise ConvergenceError(
            "x0: f_x is singular at the equilibrium that it leads to, and it is not known whether "
            f"it is beside, too: Newton's method found no equilibrium at {curve.free} = "
            f"{near[n]:.9g}; give an x0 that leads to another equilibrium, or start at another "
            f"value of {curve.free}"
        )
    if not _rests(curve, found, border):
        raise ConvergenceError(
            "x0: f_x is singular at the equilibrium that it leads to, and none is next to it at "
            f"{curve.free} = {found[n]:.9g}: it is on a fold, where the branch has no direction "
            f"along {curve.free}; start at another value of {curve.free}"
        )
    matrix = curve.derivatives(found)[0]
    if _is_singular(curve, matrix, _border_of(curve, matrix), LOOSE):
        raise ConvergenceError(
            "x0: f_x is singular at the equilibrium that it leads to, and at the next one, but for "
            "rounding: so it is where a field may be shifted along a periodic axis, or where f "
            "conserves a sum, and equilibria are not isolated; hold the field in place, such as on "
            "half the axis with slopes of 0 at its ends, or write the equation that follows from "
            "the others as sum - total, with a parameter total"
        )


def _rests(curve: LargeCurve, u: Array, border: Border) -> bool:
    """Whether f has no part along the left vector of a border, but for rounding."""
    left = border.left / curve.scale[: curve.n]
    rounding = float(np.abs(left) @ (ROUNDING * curve.terms(*curve.derivatives(u), u)))
    return bool(abs(left @ curve.value(u)) <= rounding)


def _even(curve: LargeCurve, matrix: Any) -> Any:
    """F_x in units of the fields' sizes."""
    scale = curve.scale[: curve.n]
    return sp.csc_array(sp.diags_array(1.0 / scale) @ matrix @ sp.diags_array(scale))


def _border_of(curve: LargeCurve, matrix: Any) -> Border:
    """The border of f_x in units of the fields' sizes."""
    return border_at(_even(curve, matrix))


def _is_singular(curve: LargeCurve, matrix: Any, border: Border, times: float = 1.0) -> bool:
    """Whether f_x has an eigenvalue that is zero but for rounding of its entries.

    The defect is what is left of left.(f_x right), entry by entry.
    """
    size = np.abs(border.left) @ (abs(_even(curve, matrix)) @ np.abs(border.right))
    most = DIFFERENCED if curve.sparse.differenced else EPSILON
    return bool(abs(border.defect) <= times * most * size)


def _newton(curve: LargeCurve, u: Array, border: Border | None = None) -> Array | None:
    """The equilibrium at a fixed parameter, by Newton's method with shorter steps where it must.

    With a border x keeps its part along the right vector, and f may have one along the left.
    """
    n, u = curve.n, np.array(u)
    scale = curve.scale[:n]
    left = None if border is None else border.left / np.linalg.norm(border.left)

    def rest(u: Array) -> Array:
        value = curve.value(u)
        return value if left is None else value - scale * left * inner(left, value / scale)

    value = rest(u)
    size, before = np.inf, np.inf
    for _ in range(STEPS):
        matrix, slope = curve.derivatives(u)
        if not np.isfinite(matrix.data).all():
            break
        small = np.all(np.abs(value) <= ROUNDING * curve.terms(matrix, slope, u))
        if (small and size >= 0.25 * before) or not np.any(value):
            return u
        factors = Factors(matrix)
        if border is None or left is None:
            step = factors.solve(-value)
        else:
            bordered = Bordered(factors, scale * left, border.right / scale)
            step = bordered.solve(np.append(-value, 0.0))[:n]
        before, size = size, float(np.sqrt(np.mean((step / scale) ** 2)))
        norm, part = float(np.max(np.abs(value))), 1.0
        while part >= SHORTEST:
            trial = u.copy()
            trial[:n] += part * step
            found = rest(trial)
            if np.isfinite(found).all() and (
                np.max(np.abs(found)) <= (1.0 - 0.1 * part) * norm or (part == 1.0 and size < 1e-6)
            ):
                break
            part *= 0.5
        else:
            break
        u, value = trial, found
        # Of the scales; or no longer shrinking.
        if part == 1.0 and (size <= 1e-14 or (size <= 1e-9 and size >= 0.25 * before)):
            return u
    return None


def _relaxed(curve: LargeCurve, u: Array) -> Array:
    """Where x' = f(x) leads to, by implicit Euler steps that grow as f falls.

    Pseudo-transient continuation (C. Kelley, D. Keyes, SIAM J. Numer. Anal. 35 (1998) 508).
    """
    n, u = curve.n, np.array(u)
    value = curve.value(u)
    unit = sp.eye_array(n, format="csc")
    size = float(np.sqrt(np.mean(value**2)))
    step = 0.1 * float(np.sqrt(np.mean(curve.scale[:n] ** 2))) / size if size else 1.0
    for _ in range(RELAXED):
        stage(f"no equilibrium by Newton's method: following x' = f(x), |f| = {size:.1e}")
        matrix, _ = curve.derivatives(u)
        trial = u.copy()
        trial[:n] += Factors(sp.csc_array(unit / step - matrix)).solve(value)
        found = curve.value(trial)
        after = float(np.sqrt(np.mean(found**2)))
        if not np.isfinite(after) or after > 3.0 * size:
            step *= 0.25
            continue
        step *= min(max(size / after, 0.5), 4.0) * 1.2 if after else 1.0
        u, value, size = trial, found, after
        if not size > FALLEN * float(np.max(abs(matrix) @ np.abs(u[:n]))):
            break
    return u


def sized(
    curve: LargeCurve, u: Array, given: dict[str, float], motion: Array | None = None,
    guess: Array | None = None,
) -> LargeCurve:  # fmt: skip
    """The curve with sizes of its fields: given, their mean at the start, or of their motion.

    A field that is nothing beside its size at the guess has none: 1.
    """
    scale = curve.scale.copy()
    for name, place in curve.places.items():
        size = float(np.sqrt(np.mean(u[place] ** 2)))
        if motion is not None and np.isfinite(motion).all():
            size = max(size, float(np.sqrt(np.mean(motion[place] ** 2))))
        nothing = 0.0 if guess is None else NOTHING * float(guess[place.start])
        scale[place] = given.get(name, size if size > nothing else 1.0)
    low, high = curve.low.copy(), curve.high.copy()
    for place in curve.places.values():
        if motion is not None and not np.isfinite([*low[place], *high[place]]).any():
            reach = LARGE * max(float(scale[place.start]), float(np.max(np.abs(u[place]))))
            low[place], high[place] = u[place] - reach, u[place] + reach
    return curve.replace(scale=scale, low=low, high=high)


def check_derivatives(curve: LargeCurve, u: Array, matrix: Any) -> None:
    """Refuse derivatives that are not those of f, along a few directions at random.

    Raises
    ------
    ParameterError
    """
    n, generator = curve.n, np.random.default_rng(0)
    sizes = np.maximum(np.abs(u[:n]), curve.scale[:n])
    terms = abs(matrix) @ sizes
    for _ in range(PROBES):
        z = np.append(generator.choice([-1.0, 1.0], n) * sizes, 0.0)
        said = matrix @ z[:n]
        wrong: list[tuple[int, float]] = []  # row, and what differences say, by step
        for part in PARTS:
            step = part * STEP
            ahead, behind = curve.value(u + step * z), curve.value(u - step * z)
            found = (ahead - behind) / (2.0 * step)
            if not np.isfinite(found).all():
                if part == 1.0:
                    return
                continue
            noise = ROUNDING * np.maximum(np.abs(ahead), terms) / step
            gap = np.abs(found - said) - WRONG * np.maximum(np.abs(found), terms) - noise
            row = wrong[0][0] if wrong else int(np.argmax(gap))
            if not gap.max() > 0.0:
                break
            wrong.append((row, float(found[row])))
        else:
            first, last = wrong[0][1], wrong[min(3, len(wrong) - 1)][1]
            bends = abs(last - first) > WRONG * max(abs(first), abs(last))
            name = curve.field.states[row]
            raise ParameterError(
                f"jac: its row of {name} times a direction is {said[row]:.6g}, wants "
                f"{last:.6g}, which differences of f say: an entry is wrong, or missing "
                "in the pattern" + (
                    f"; or f bends over a step of {STEP * sizes[row]:.2g}: give the size of its "
                    "field as options.scales" if bends else ""
                )
            )  # fmt: skip


def start_at(curve: LargeCurve, u: Array) -> Corrected:
    """The start with its unit tangent towards a larger parameter."""
    row = np.zeros(curve.n + 1)
    row[curve.n] = 1.0
    matrix, slope = curve.derivatives(u)
    return start_along(curve, u, curve.bordered(matrix, slope, row).solve(row))


def start_along(curve: LargeCurve, u: Array, tangent: Array) -> Corrected:
    """A start in the direction of a tangent."""
    return corrected_at(curve, u, tangent / curve.length(tangent))


def corrected_at(curve: LargeCurve, u: Array, t: Array) -> Corrected:
    """A point of a curve with its unit tangent."""
    matrix, slope = curve.derivatives(u)
    bordered = curve.bordered(matrix, slope, curve.weight * t)
    value = np.abs(curve.value(u))
    ratio = np.zeros(curve.n)
    np.divide(value, curve.terms(matrix, slope, u), ratio, where=value > 0.0)
    return Corrected(u, matrix, slope, t, bordered, 0, float(np.max(ratio)))
