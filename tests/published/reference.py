"""Special points of `published.systems` in 60 digits, without continuation.

The equilibria are explicit functions of one variable t. Along them the determinant of the
Jacobian and the product of the sums of pairs of its eigenvalues (Orlando's formula: a Hurwitz
determinant) are functions of one variable; all their zeros in the range are bracketed on a fine
grid and refined in mpmath. With ' = d/dt the determinant of the system bordered by the curve's
tangent is det(J) (p'^2 + |x'|^2)/p': where det(J)/p' changes sign another branch crosses, also
where the curve turns at the crossing; where p' alone changes sign there is a fold.
"""

from __future__ import annotations

import functools
import itertools
import json
import sys
from collections.abc import Callable, Iterable, Mapping
from pathlib import Path
from typing import Any, NamedTuple

import mpmath as mp
import numpy as np
import sympy as sp
from published.systems import BRANCH, FOLD, HOPF, NEUTRAL, SYSTEMS, Curve, System

DPS = 60
SMALL = mp.mpf(10) ** -20


class Special(NamedTuple):
    """One special point: its kind, the variable t of the curve, parameter, state, frequency."""

    kind: str
    t: mp.mpf
    parameter: mp.mpf
    state: tuple[mp.mpf, ...]
    omega: mp.mpf | None


def parse(text: str) -> sp.Expr:
    """Sympy expression; decimals are exact."""
    names = {"I": sp.Symbol("I"), "beta": sp.Symbol("beta"), "E": sp.Symbol("E")}
    return sp.sympify(text, locals=names, rational=True)


def solved(curve: Curve, text: str) -> sp.Expr:
    """Put the inner quantities of a curve in."""
    found = parse(text)
    while hits := found.free_symbols & {sp.Symbol(name) for name in curve.inner}:
        found = found.subs({s: parse(curve.inner[s.name]) for s in hits})
    return found


@functools.cache
def symbolic(name: str) -> tuple[sp.Matrix, sp.Matrix, list[sp.Symbol], sp.Symbol]:
    """Right-hand side, Jacobian, symbols of state and parameter."""
    system = SYSTEMS[name]
    state = [sp.Symbol(n) for n in system.state]
    f = sp.Matrix([parse(text) for text in system.equations])
    return f, f.jacobian(state), state, sp.Symbol(system.parameter)


class OnCurve:
    """State, parameter and Jacobian of a system along one curve, for mpmath and for numpy."""

    def __init__(self, system: System, curve: Curve, **changes: float):
        f, jacobian, state, parameter = symbolic(system.name)
        t = sp.Symbol("t")
        fixed = {k: v for k, v in system.parameters.items() if k != system.parameter} | changes
        others = [sp.Symbol(k) for k in fixed]
        p = solved(curve, curve.parameter)
        along = [*(solved(curve, text) for text in curve.state), p, p.diff(t), p.diff(t, 2)]
        self.names, self.fixed, self.n = list(fixed), list(fixed.values()), len(state)
        self.low, self.high = curve.low, curve.high
        matrix = sp.Matrix.hstack(jacobian, f)
        self._along, self._matrix = {}, {}
        for module in ("mpmath", "numpy"):
            self._along[module] = sp.lambdify([t, *others], along, module)
            self._matrix[module] = sp.lambdify([*state, parameter, *others], matrix, module)

    def along(self, t: Any, **changes: Any) -> list[Any]:
        """State, parameter, and the parameter's derivatives by t."""
        values = self._values(changes)
        try:
            found: list[Any] = self._along["mpmath"](mp.mpf(t), *values)
        except ZeroDivisionError:  # 0/0: the limit
            found = self._along["mpmath"](mp.mpf(t) + SMALL, *values)
        return found

    def jacobian(self, t: Any, **changes: Any) -> mp.matrix:
        point = self.along(t, **changes)[: self.n + 1]
        found = mp.matrix(self._matrix["mpmath"](*point, *self._values(changes)))
        # The curve is one of equilibria.
        assert mp.norm(found[:, self.n]) < mp.mpf(10) ** (25 - mp.mp.dps) * (1 + mp.norm(found))
        return found[:, : self.n]

    def crossing(self, t: Any, **changes: Any) -> mp.mpf:
        slope = self.along(t, **changes)[self.n + 1]
        if slope == 0:
            return self.crossing(t + SMALL, **changes)
        return coefficients(self.jacobian(t, **changes))[-1] / slope

    def turning(self, t: Any, **changes: Any) -> mp.mpf:
        return self.along(t, **changes)[self.n + 1]

    def sums(self, t: Any, **changes: Any) -> mp.mpf:
        return hurwitz(coefficients(self.jacobian(t, **changes)))

    def _values(self, changes: Mapping[str, Any]) -> list[mp.mpf]:
        values = zip(self.names, self.fixed, strict=True)
        return [mp.mpf(changes.get(name, value)) for name, value in values]

    def in_doubles(self, t: np.ndarray) -> list[np.ndarray]:
        """State, parameter, p' and p'' on an array of t."""
        raw = self._along["numpy"](t, *self.fixed)
        return [np.broadcast_to(np.asarray(x, float), t.shape) for x in raw]

    def in_doubles_at(self, x: list[float], p: float, fixed: list[float]) -> np.ndarray:
        """Jacobian at a state."""
        return np.array(self._matrix["numpy"](*x, p, *fixed), float)[:, : self.n]

    def surface(self, second: str, value: float, points: int) -> tuple[np.ndarray, ...]:
        """t, p', p'' and the product of the sums of pairs, at one value of a second parameter."""
        fixed, self.fixed = (
            self.fixed,
            [
                value if name == second else x
                for name, x in zip(self.names, self.fixed, strict=True)
            ],
        )
        try:
            t, turning, _, sums = self.grid(points)
            with np.errstate(all="ignore"):
                return t, turning, self.in_doubles(t)[self.n + 2], sums
        finally:
            self.fixed = fixed

    def grid(self, points: int) -> tuple[np.ndarray, ...]:
        """t, p', det(J)/p', and the product of the sums of pairs on an uneven grid, in doubles."""
        t = np.linspace(self.low, self.high, points)
        # No zero that is a simple number lies on the grid.
        t[1:-1] += np.random.default_rng(7).uniform(-0.3, 0.3, points - 2) * (t[1] - t[0])
        with np.errstate(all="ignore"):
            along = self.in_doubles(t)
            columns = zip(*along[: self.n + 1], strict=True)
            matrix = np.array([self._matrix["numpy"](*x, *self.fixed) for x in columns], float)
            matrix = matrix[:, :, : self.n]
            good = np.isfinite(matrix).all(axis=(1, 2))
            matrix[~good] = 0.0
            eigenvalues = np.linalg.eigvals(matrix)
            sums = np.ones(t.size, complex)
            for i, j in itertools.combinations(range(self.n), 2):
                sums *= eigenvalues[:, i] + eigenvalues[:, j]
            crossing = np.linalg.det(matrix) / along[self.n + 1]
        wanted = (along[self.n + 1], crossing, sums.real)
        return t, *(np.where(good, x, np.nan) for x in wanted)


def coefficients(matrix: mp.matrix) -> list[mp.mpf]:
    """Characteristic polynomial by Faddeev and LeVerrier, highest power first."""
    n = matrix.rows
    found, work = [mp.mpf(1)], mp.zeros(n)
    for k in range(1, n + 1):
        work = matrix * work + found[-1] * mp.eye(n)
        product = matrix * work
        found.append(-sum(product[i, i] for i in range(n)) / k)
    return found


def hurwitz(found: list[mp.mpf]) -> mp.mpf:
    """Hurwitz determinant of order n - 1: up to its sign the product of the sums of pairs."""
    n = len(found) - 1
    if n == 1:
        return mp.mpf(1)
    entry = mp.matrix(n - 1, n - 1)
    for i in range(n - 1):
        for j in range(n - 1):
            k = 2 * (j + 1) - (i + 1)
            entry[i, j] = found[k] if 0 <= k <= n else 0
    return mp.det(entry)


def zeros(f: Callable[[Any], mp.mpf], t: np.ndarray, values: np.ndarray) -> list[mp.mpf]:
    """Zeros of f where its values on the grid change sign; poles are none."""
    found = []
    for i in np.flatnonzero(np.sign(values[:-1]) * np.sign(values[1:]) < 0):
        ends = mp.mpf(t[i]), mp.mpf(t[i + 1])
        root = mp.findroot(f, ends, solver="anderson", tol=1e-60, verify=False)
        around = [abs(f(x)) for x in (root, *ends)]
        if around[0] < 1e-15 * max(around[1:]):
            found.append(root)
    return found


def specials(system: System, points: int = 2001, **changes: float) -> list[Special]:
    """All folds, branch points, Hopf points and neutral saddles on the curves, within the span."""
    found = []
    with mp.workdps(DPS):
        for curve in system.curves:
            on = OnCurve(system, curve, **changes)
            t, turning, crossing, sums = on.grid(points)
            roots = [(BRANCH, root) for root in zeros(on.crossing, t, crossing)]
            for root in zeros(on.turning, t, turning):
                if all(abs(root - other) > 1e-15 for _, other in roots):
                    roots.append((FOLD, root))
            for root in zeros(on.sums, t, sums) if on.n > 1 else ():
                kind = HOPF if pair(on.jacobian(root)) > 0 else NEUTRAL
                roots.append((kind, root))
            for kind, root in roots:
                point = on.along(root)[: on.n + 1]
                omega = mp.sqrt(pair(on.jacobian(root))) if kind == HOPF else None
                found.append(Special(kind, root, point[-1], tuple(point[:-1]), omega))
    low, high = system.span
    return sorted((s for s in found if low < s.parameter < high), key=lambda s: s.t)


def fold_curve_points(
    system: System, second: str, span: tuple[float, float], points: int = 400
) -> list[tuple[str, mp.mpf, mp.mpf]]:
    """Cusps, Bogdanov-Takens and zero-Hopf points in the plane of two parameters: kind and place.

    On the surface of equilibria over (t, second): p' = p'' = 0 at a cusp; at the others p' = 0
    and the sum of two eigenvalues vanishes. Cells of a grid on which both quantities change sign
    give the starts.
    """
    found: list[tuple[str, mp.mpf, mp.mpf]] = []
    with mp.workdps(DPS):
        for curve in system.curves:
            on = OnCurve(system, curve)
            values = np.linspace(*span, points + 1) + 1e-7
            t, turning, bending, sums = (
                np.array(x)
                for x in zip(*(on.surface(second, v, points) for v in values), strict=True)
            )
            for kind, other in (("cusp", bending), ("sum", sums)):
                if kind == "sum" and on.n == 1:
                    continue
                for i, j in np.argwhere(_changes(turning) & _changes(other)):
                    found += _refined(on, kind, second, t[i, j : j + 2], values[i : i + 2])
    unique: list[tuple[str, mp.mpf, mp.mpf]] = []
    for one in found:
        near = (abs(one[1] - two[1]) + abs(one[2] - two[2]) for two in unique if two[0] == one[0])
        inside = span[0] <= one[2] <= span[1] and system.span[0] <= one[1] <= system.span[1]
        if inside and all(distance > 1e-12 for distance in near):
            unique.append(one)
    return unique


def _changes(values: np.ndarray) -> np.ndarray:
    """Whether the values at the corners of each cell differ in sign."""
    signs = np.sign(values)
    corners = np.array([signs[:-1, :-1], signs[1:, :-1], signs[:-1, 1:], signs[1:, 1:]])
    return (corners.min(axis=0) < 0) & (corners.max(axis=0) > 0)


def _refined(
    on: OnCurve, kind: str, second: str, t: np.ndarray, values: np.ndarray
) -> list[tuple[str, mp.mpf, mp.mpf]]:
    """Newton from the middle of a cell, if it ends close by."""

    def both(x: Any, v: Any) -> tuple[mp.mpf, mp.mpf]:
        change = {second: v}
        other = on.along(x, **change)[on.n + 2] if kind == "cusp" else on.sums(x, **change)
        return on.turning(x, **change), other

    start = (mp.mpf(t.mean()), mp.mpf(values.mean()))
    which = kind
    try:
        x, v = mp.findroot(both, start, tol=1e-50, maxsteps=30, verify=False)
    except (ZeroDivisionError, ValueError):
        return []
    if not (abs(x - start[0]) < 3 * np.ptp(t) and abs(v - start[1]) < 3 * np.ptp(values)):
        return []
    if mp.norm(both(x, v)) > 1e-25 * mp.norm(both(*start)):
        return []
    if kind == "sum":
        found = coefficients(on.jacobian(x, **{second: v}))
        if abs(found[-2]) < 1e-20 * max(map(abs, found)):
            which = "bogdanov_takens"
        elif pair(on.jacobian(x, **{second: v})) > 0:
            which = "zero_hopf"
        else:
            return []
    return [(which, on.along(x, **{second: v})[on.n], v)]


def pair(matrix: mp.matrix) -> mp.mpf:
    """Product of the two eigenvalues whose sum vanishes: omega^2, or negative at a saddle."""
    eigenvalues = mp.eig(matrix, left=False, right=False)
    pairs = itertools.combinations(eigenvalues, 2)
    one, other = min(pairs, key=lambda both: abs(both[0] + both[1]))
    return mp.re(one * other)


def parameters_of(found: list[Special], kind: str) -> list[float]:
    """Parameters of the points of one kind, in order."""
    return sorted(float(s.parameter) for s in found if s.kind == kind)


def _eigenvectors(matrix: mp.matrix, omega: mp.mpf) -> tuple[list[mp.mpc], list[mp.mpc]]:
    """Vectors q and p with J q = i omega q, J^T p = -i omega p, q q* = 1 and p* q = 1."""
    values, left, right = mp.eig(matrix, left=True, right=True)
    k = min(range(len(values)), key=lambda k: abs(values[k] - 1j * omega))
    q = [right[i, k] for i in range(matrix.rows)]
    norm = mp.norm(q)
    q = [x / norm for x in q]
    w = [left[k, i] for i in range(matrix.rows)]
    product = sum(a * b for a, b in zip(w, q, strict=True))
    return q, [mp.conj(a / product) for a in w]


def _real_part(matrix: mp.matrix, omega: mp.mpf) -> mp.mpf:
    """Real part of the eigenvalue next to i omega."""
    values = mp.eig(matrix, left=False, right=False)
    return mp.re(min(values, key=lambda value: abs(value - 1j * omega)))


def growth(system: System, hopf: Special) -> mp.mpf:
    """Re c of ``z' = (alpha + i omega) z + c z |z|^2`` at a Hopf point, eigenvector of norm 1.

    Not by the projection formula: the small periodic orbit itself is found by harmonic balance.
    At the size |z| = 1e-10 its parameter is off the Hopf point by d, and Re c = -alpha' d/|z|^2.
    """
    with mp.workdps(DPS):
        (curve,) = system.curves
        on = OnCurve(system, curve)
        n, size = on.n, mp.mpf(10) ** -10
        matrix = on.jacobian(hopf.t)
        q, p = _eigenvectors(matrix, hopf.omega)
        slope = mp.diff(
            lambda t: _real_part(on.jacobian(t), hopf.omega), hopf.t, h=mp.mpf(10) ** -20
        )
        slope /= on.turning(hopf.t)
        f, _, state, parameter = symbolic(system.name)
        names = [*state, parameter, *(sp.Symbol(k) for k in on.names)]
        rate = sp.lambdify(names, list(f), "mpmath")
        points = 8
        nodes = [2 * mp.pi * k / points for k in range(points)]

        def residual(*unknown: Any) -> list[mp.mpf]:
            omega, value = unknown[:2]
            x = [[unknown[2 + n * k + i] for i in range(n)] for k in range(points)]
            spectrum = [
                [
                    sum(x[k][i] * mp.expj(-m * nodes[k]) for k in range(points)) / points
                    for i in range(n)
                ]
                for m in range(points // 2)
            ]
            out = []
            for k in range(points):
                f_k = rate(*x[k], value, *map(mp.mpf, on.fixed))
                for i in range(n):
                    speed = sum(
                        2 * mp.re(1j * m * spectrum[m][i] * mp.expj(m * nodes[k]))
                        for m in range(1, points // 2)
                    )
                    out.append(omega * speed - f_k[i])
            first = sum(mp.conj(p[i]) * spectrum[1][i] for i in range(n))
            return [mp.re(first) - size, mp.im(first), *out]

        start = [hopf.omega, hopf.parameter]
        for node in nodes:
            start += [hopf.state[i] + 2 * size * mp.re(q[i] * mp.expj(node)) for i in range(n)]
        found = mp.findroot(residual, start, tol=1e-70, maxsteps=6, verify=False)
        return -slope * (found[1] - hopf.parameter) / size**2


#: Fold curves in a second parameter: its name and range.
FOLD_CURVES = {
    "A -> B reaction": ("p3", (0.5, 4.0)),
    "CO oxidation, k = 0.4": ("k", (0.1, 2.0)),
    "Bazykin": ("al", (0.05, 0.98)),
    "Lorenz-84": ("G", (0.1, 3.0)),
    "stirred tank": ("b", (0.5, 6.0)),
    "Bogdanov-Takens, focus side": ("b2", (-1.5, 1.5)),
    "neural mass": ("J", (1.0, 4.0)),
    "cusp": ("l", (-1.0, 2.0)),
}


def stored(table: str) -> dict[str, list[Any]]:
    """A table of tests/data: hopf_points or fold_curves, by the systems' names."""
    path = Path(__file__).parent.parent / "data" / f"{table}.json"
    found: dict[str, list[Any]] = json.loads(path.read_text())
    return found


def hopf_points() -> dict[str, list[list[float]]]:
    """Parameter, frequency and Re c at the Hopf points of each system."""
    table: dict[str, list[list[float]]] = {}
    for system in SYSTEMS.values():
        hopf = [one for one in specials(system) if one.kind == HOPF]
        for one in sorted(hopf, key=lambda one: one.parameter):
            numbers = (one.parameter, one.omega, growth(system, one))
            row = [0.0 if abs(x) < 1e-40 else float(x) for x in numbers]
            table.setdefault(system.name, []).append(row)
    return table


def fold_curves(names: Iterable[str] = FOLD_CURVES) -> dict[str, list[list[Any]]]:
    """Kind and both parameters of the points on fold curves."""
    return {
        name: [
            [kind, *(0.0 if abs(x) < 1e-40 else float(x) for x in place)]
            for kind, *place in fold_curve_points(SYSTEMS[name], *FOLD_CURVES[name], 150)
        ]
        for name in names
    }


if __name__ == "__main__":
    print(
        json.dumps(
            {"hopf_points": hopf_points, "fold_curves": fold_curves}[sys.argv[1]](), indent=1
        )
    )
