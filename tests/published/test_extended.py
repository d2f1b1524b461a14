"""`converged` means that Newton's method in 50 digits agrees with the digits that are given.

The defining systems are written down here once more, for the formulas of published systems, with
nothing of the engine in them. All systems are tried by ``PHASEKIT_PUBLISHED=all``.
"""

from __future__ import annotations

import os

import mpmath
import numpy as np
import pytest
import sympy
from published import compare
from published.compare import kind_of, state_of
from published.systems import BRANCH, FOLD, HOPF, NEUTRAL, SYSTEMS

ALL = os.environ.get("PHASEKIT_PUBLISHED") == "all"
NAMES = list(SYSTEMS) if ALL else ["cusp", "A -> B reaction", "transcritical", "Selkov", "Bazykin"]
DIGITS = 50
AGREE = 3e-12  # of the scales; 1.4e-12 where two eigenvalues nearly vanish together


def of_formulas(system):
    """The right-hand side and its derivatives by (x, p), in mpmath's numbers, of lists (x, p)."""
    known = {k: sympy.Float(v, 60) for k, v in system.parameters.items() if k != system.parameter}
    u = [sympy.Symbol(name) for name in (*system.state, system.parameter)]
    names = known | {symbol.name: symbol for symbol in u}
    f = sympy.Matrix([sympy.sympify(text, locals=names) for text in system.equations])
    value, slopes = (sympy.lambdify([u], m, "mpmath") for m in (f, f.jacobian(u)))
    return value, slopes


def defining(kind, value, slopes, n, fixed):
    """Equations of (x, p, what the kind adds) that are regular at the point."""

    def g(*unknowns):
        u = list(unknowns[: n + 1])
        v = mpmath.matrix(unknowns[n + 1 : 2 * n + 1])
        f, A = value(u), slopes(u)
        fx = A[:, :n]
        equations = list(f)
        if kind == FOLD:
            equations += [*(fx * v), sum(a * b for a, b in zip(fixed[0], v, strict=True)) - 1]
        elif kind in (HOPF, NEUTRAL):
            k = unknowns[-1]
            equations += list(fx * (fx * v) + k * v)
            equations += [
                sum(a * b for a, b in zip(row, v, strict=True)) - c
                for row, c in zip(fixed, (1, 0), strict=True)
            ]
        else:  # f + b w = 0, w f_u = 0 along x and p
            b = unknowns[-1]
            equations = [a + b * c for a, c in zip(f, v, strict=True)]
            equations += list(A.T * v) + [sum(a * c for a, c in zip(fixed[0], v, strict=True)) - 1]
        return equations

    return g


def start_of(kind, slopes, u):
    """Vectors near the null vectors, in doubles, and what holds them fixed."""
    n = len(u) - 1
    A = np.array(slopes(list(u)).tolist(), dtype=float)
    if kind == FOLD:
        v = np.linalg.svd(A[:, :n])[2][-1]
        return [*v], [v / (v @ v)]
    if kind in (HOPF, NEUTRAL):
        values, vectors = np.linalg.eig(A[:, :n])
        sums = np.abs(values[:, None] + values) + 1e9 * np.eye(n)
        i, j = np.unravel_index(np.argmin(sums), sums.shape)
        v = np.real(vectors[:, i]) + (np.real(vectors[:, j]) if kind == NEUTRAL else 0.0)
        w = A[:, :n] @ v
        w = w - (w @ v) / (v @ v) * v
        return [*v, float(np.real(values[i] * values[j]))], [v / (v @ v), w / np.linalg.norm(w)]
    w = np.linalg.svd(A)[0][:, -1]
    return [*w, 0.0], [w]


@pytest.mark.parametrize("name", NAMES)
def test_newton_in_fifty_digits_agrees(name):
    system = SYSTEMS[name]
    value, slopes = of_formulas(system)
    branch = compare.follow(system)
    scale = np.abs(branch.curve.scale[: len(system.state) + 1])
    assert branch.messages == ()
    tried = 0
    for point in branch.special_points:
        kind = kind_of(point)
        if kind not in (FOLD, HOPF, NEUTRAL, BRANCH) or point.status != "converged":
            continue
        u = [*state_of(point).tolist(), float(point.parameters[system.parameter])]
        extra, fixed = start_of(kind, slopes, u)
        with mpmath.workdps(DIGITS):
            g = defining(kind, value, slopes, len(system.state), fixed)
            found = mpmath.findroot(g, [mpmath.mpf(a) for a in (*u, *extra)], tol=1e-60,
                                    maxsteps=12, verify=False)  # fmt: skip
            left = max(abs(e) for e in g(*found))
            off = [abs(a - mpmath.mpf(b)) for a, b in zip(found, u, strict=False)]
        assert left < mpmath.mpf(10) ** -35, (point, left)
        sizes = np.maximum(scale, np.abs(u))
        assert len(off) == len(sizes)
        assert np.max(np.array(off, dtype=float) / sizes) < AGREE, (point, off)
        tried += 1
    assert tried == sum(one.status == "converged" and kind_of(one) != "end"
                        for one in branch.special_points)  # fmt: skip
    assert tried >= 1 or name == "hysteresis without a fold"
