"""Bifurcation sets in a plane of two parameters, as complete, ordered curves.

The fold set is traced in the space of both parameters and the angle phi of the merged pair, where
it is smooth, through its cusps: V'(phi) = V''(phi) = 0. Where B or C vanishes in the whole plane it
is a set of pitchforks, |A| = |B| or |A| = |C|. The other sets are those of factors of A, B and C.
Curves are found from all their crossings with a net of lines in the plane, each line solved for all
of its crossings by exact arithmetic.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Any

import numpy as np

from phasekit.arrays import Array
from phasekit.bifurcation.curves import Cusp, Locus
from phasekit.bifurcation.exact.line import Path
from phasekit.bifurcation.exact.normal_forms import (
    cubic_coefficient,
    fold_angle,
    quadratic_coefficient,
)
from phasekit.bifurcation.exact.plane import TURN, Plane
from phasekit.laws.trigonometric import Factor
from phasekit.numerics.tracing import EDGE, Equations, Trace, extends, last_point, new_curve, solve

LOST = 1e-12


def loci(plane: Plane) -> tuple[list[Locus], list[Cusp]]:
    """All curves of a plane, and the cusps of its fold set."""
    A_flat, B_flat, C_flat = plane.flat
    pieces: list[Locus] = []
    cusps: list[Cusp] = []
    if not A_flat:
        if B_flat and C_flat:
            pass  # equilibria merge only where there is no force
        elif B_flat or C_flat:
            pieces += _pitchforks(plane, "C" if B_flat else "B")
        else:
            pieces += _folds(plane, cusps)
        for factor in plane.law.sign_changes:
            for curve in _zero_curves(plane, factor):
                if _A_turns(plane, curve):
                    piece = _piece(plane, "sign_change", curve.vertices, curve.closed, sign=0)
                    pieces.append(piece)
        pieces += _equal_energies(plane)
    return pieces, cusps


# ------------------------------------------------------------------------------ folds


def _folds(plane: Plane, cusps: list[Cusp]) -> list[Locus]:
    corners = np.arange(-40, 41) / 4.0
    pieces: list[Locus] = []
    curves: list[Trace] = []
    for fixed, u, point in plane.crossings(lambda path: path.discriminant):
        A, B, C, _ = plane.law(plane.values_at(point))
        if A == 0.0:
            continue
        guess = np.append(point, fold_angle(A, B, C) / TURN)
        curve = new_curve(curves, plane.fold, solve(plane.fold, guess, fixed, u), guess, corners)
        if curve is None:
            continue
        for cut, sign, whole in _by_sign(plane, plane.fold, curve):
            part = _off_corners(plane, cut)
            if sign and extends(part):
                phi = TURN * part[:, 2]
                pieces.append(_piece(plane, "fold", part, whole, sign=sign, phi=phi))
        at = curve.vertices[np.isin(curve.vertices[:, 2], corners)]
        for row in at[:-1] if curve.closed and np.array_equal(at[:1], at[-1:]) else at:
            cusps.append(_cusp(plane, row))
    return pieces


def _off_corners(plane: Plane, vertices: Array) -> Array:
    """Leave out ends in a corner of the plane where no force is left, and so no direction."""

    def lost(z: Array) -> bool:
        A, B, C, _ = plane.law(plane.values_at(z))
        return bool(np.abs(z[:2] - np.round(z[:2])).max() < EDGE and np.hypot(A, B) + abs(C) < LOST)

    while len(vertices) and lost(vertices[0]):
        vertices = vertices[1:]
    while len(vertices) and lost(vertices[-1]):
        vertices = vertices[:-1]
    return vertices


def _by_sign(plane: Plane, equations: Equations, curve: Trace) -> Iterator[tuple[Array, int, bool]]:
    """Cut a curve where there is no force: parts, the sign of A on each, whether it is closed."""

    def sign(z: Array) -> int:
        return int(np.sign(plane.law(plane.values_at(z))[0]))

    signs = [sign(z) for z in curve.vertices]
    part: list[Array] = []
    whole = curve.closed and len(set(signs)) == 1
    before = signs[0]

    def unchanged(z: Array) -> bool:
        return sign(z) == before

    for k, (z, s) in enumerate(zip(curve.vertices, signs, strict=True)):
        if s != before:
            cut = last_point(equations, curve.vertices[k - 1], z, unchanged)
            yield np.array([*part, cut]), before, False
            part, before = [cut], s
        part.append(z)
    yield np.array(part), signs[-1], whole


def _cusp(plane: Plane, row: Array) -> Cusp:
    x, y = plane.parameters(row[None])[0]
    A = float(plane.law(plane.values_at(row))[0])
    phi = float(np.pi - (np.pi - TURN * row[2]) % TURN)
    along_B = abs(np.cos(phi)) > 0.5
    like = "center" if along_B == (A > 0.0) else "saddle"
    cubic = cubic_coefficient(plane.A(np.array([x]), np.array([y])), phi)
    return Cusp(float(x), float(y), phi, like, float(cubic[0]))


def _piece(
    plane: Plane, kind: str, vertices: Array, closed: bool, *, sign: int, phi: Array | None = None
) -> Locus:
    x, y = plane.parameters(vertices).T
    angles = quadratic = np.full(x.size, np.nan)
    merging = ""
    if phi is not None:
        angles, merging = phi, "lower_saddle upper_center"
    if kind == "fold":
        quadratic = quadratic_coefficient(plane.A(x, y), angles)
    elif kind == "pitchfork":
        along_B = abs(np.cos(angles[0])) > 0.5
        merging = "lower_saddle upper_center upper_saddle"
        if along_B == (sign > 0):
            merging = "lower_center lower_saddle upper_center"
    return Locus(kind, x, y, angles, closed, quadratic, merging, sign)


# ------------------------------------------------------------------------------ zeros


def _zero_curves(plane: Plane, factor: Factor) -> list[Trace]:
    """All curves on which a factor vanishes."""
    equation = plane.zero(factor)
    return _curves(plane, equation, lambda path: path.polynomial(factor))


def _A_turns(plane: Plane, curve: Trace) -> bool:
    """Whether A has different signs on both sides: it has not where two factors are the same."""
    k = len(curve.vertices) // 2
    (dx, dy), middle = np.diff(curve.vertices[k - 1 : k + 1], axis=0)[0], curve.vertices[k]
    across = 1e-5 * np.array([-dy, dx]) / np.hypot(dx, dy)
    left, right = (plane.law(plane.values_at(middle + z))[0] for z in (across, -across))
    return bool(left * right < 0.0)


def _curves(plane: Plane, equation: Equations, polynomial: Callable[[Path], Any]) -> list[Trace]:
    curves: list[Trace] = []
    for fixed, u, point in plane.crossings(polynomial):
        new_curve(curves, equation, solve(equation, point, fixed, u), point)
    return curves


def _pitchforks(plane: Plane, name: str) -> list[Locus]:
    """Pitchforks of a plane in which B or C vanishes: the other one, `name`, is A or -A."""
    place = "ABC".index(name)
    pieces = []
    for sign in (1, -1):

        def difference(v: Any, sign: int = sign) -> Any:
            products = plane.law.products(v)
            return products[place] - sign * products[0]

        def along(path: Path, sign: int = sign) -> Any:
            return path.products[place] - sign * path.products[0]

        def relative(z: Array, sign: int = sign) -> tuple[Array, Array]:
            abc, dx, dy = plane._derivatives(lambda v: plane.law(v)[:3], z)
            f, fx, fy = (part[place] - sign * part[0] for part in (abc, dx, dy))
            size = float(np.hypot(fx, fy)) or 1.0
            return np.array([f / size]), np.array([[fx, fy]]) / size

        for curve in _curves(plane, relative, along):
            # Where B = sign A the merged angle is 0 or pi, where C = sign A it is -+pi/2.
            angle = (0.0 if sign > 0 else np.pi) if name == "B" else -sign * np.pi / 2
            for part, s, whole in _by_sign(plane, relative, curve):
                if s and extends(part):
                    phi = np.full(len(part), angle)
                    pieces.append(_piece(plane, "pitchfork", part, whole, sign=s, phi=phi))
    return pieces


# ------------------------------------------------------------------------------ equal energies


def _equal_energies(plane: Plane) -> list[Locus]:
    """Curves where both saddles, or both centers, have the same energy.

    They are the parts inside the fold set of the curves on which B or C vanishes.
    """
    pieces = []
    for zero in plane.law.zeros:
        sample = zero.factor(plane.law.turned(plane.values_at(np.array([0.37, 0.41]))))
        if sample == 0.0:
            continue  # it vanishes in the whole plane
        for curve in _zero_curves(plane, zero.factor):
            of_B, of_C = zero.of_B or plane.flat[1], zero.of_C or plane.flat[2]
            pieces += _inside(plane, zero.factor, curve.vertices, of_B, of_C)
    return pieces


def _inside(plane: Plane, factor: Factor, vertices: Array, of_B: bool, of_C: bool) -> list[Locus]:
    def measured(z: Array) -> tuple[int, float]:
        """Sign of A, and how far inside the fold set: (|A| - |B + C|)/sum, as one of them is 0."""
        A, B, C, _ = plane.law(plane.values_at(z))
        rest = (0.0 if of_B else abs(B)) + (0.0 if of_C else abs(C))
        total = abs(A) + rest
        return int(np.sign(A)), (abs(A) - rest) / total if total > 0.0 else 0.0

    equation = plane.zero(factor)
    codes = [measured(z) for z in vertices]
    pieces: list[Locus] = []
    run: list[Array] = []
    run_sign = 0

    def finish() -> None:
        if len(run) > 1:
            saddles = (of_C and run_sign < 0) or (of_B and run_sign > 0)
            kind = "equal_saddles" if saddles else "equal_centers"
            pieces.append(_piece(plane, kind, np.array(run), False, sign=run_sign))
        run.clear()

    def end(inner: Array, outer: Array) -> Array:
        def holds(z: Array) -> bool:
            sign, gap = measured(z)
            return gap > 0.0 and sign == run_sign

        return last_point(equation, inner, outer, holds)

    for k, (z, (sign, gap)) in enumerate(zip(vertices, codes, strict=True)):
        inside = gap > 1e-13
        if k and run and not (inside and sign == run_sign):
            run.append(end(vertices[k - 1], z))
            finish()
        if inside and not run:
            run_sign = sign
            if k:
                run.append(end(z, vertices[k - 1]))
        if inside:
            run.append(z)
    finish()
    return pieces
