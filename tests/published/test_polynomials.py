"""Branches of random polynomial systems against exact elimination.

``PHASEKIT_PATHS=1000`` follows so many; few are followed in every run.
"""

from __future__ import annotations

import os

import numpy as np
import pytest
import sympy as sp
from published.compare import state_of
from published.elimination import common_zeros

import phasekit as pk

PATHS = int(os.environ.get("PHASEKIT_PATHS", "8"))
x, y, p = sp.symbols("x y p", real=True)
SIMPLE = 1e-3  # critical points whose second derivatives are smaller lie next to others
BOX = 25.0  # beyond all roots


def polynomial(rng, degree, *symbols):
    """A random polynomial with small whole coefficients."""
    monomials = sorted(sp.itermonomials(symbols, degree), key=str)
    return sum(int(c) * q for c, q in zip(rng.integers(-3, 4, len(monomials)), monomials))  # noqa: B905


def systems(seed):
    """A reduced equation f(x, p) = 0, and equations in x and maybe y with the same branches."""
    rng = np.random.default_rng(seed)
    # Of odd degree in x: there is an equilibrium for every p.
    f = polynomial(rng, 2, x, p) + int(rng.choice([-1, 1])) * x**3
    f += int(rng.integers(-3, 4)) * p * x**2 + p / 7
    if seed % 2 == 0:
        return f, [f], ["x"], rng, None
    q = polynomial(rng, 2, x, p)
    lift = y - q
    # Equivalent equations: f plus a multiple of y - q(x, p), mixed with it.
    first = sp.expand(f + polynomial(rng, 1, x, y) * lift)
    return f, [sp.expand(first + 2 * lift), sp.expand(first + 3 * lift)], ["x", "y"], rng, q


@pytest.mark.parametrize("seed", range(PATHS))
def test_folds_are_those_of_exact_elimination(seed):
    f, equations, states, rng, q = systems(seed)
    at = float(rng.uniform(-1, 1))
    roots = np.roots([float(c) for c in sp.Poly(f.subs(p, at), x).all_coeffs()])
    real = roots.real[(abs(roots.imag) < 1e-9) & (abs(roots.real) < BOX)]
    start = [float(real[0])] + ([] if q is None else [float(q.subs({x: real[0], p: at}))])
    problem = pk.Problem([str(e) for e in equations], state=states, parameters={"p": at})
    options = pk.ContinuationOptions(bounds={"x": (-BOX, BOX)}, max_points=1000)
    branch = pk.continuation(problem, "p", x0=start, span=(-2.0, 2.0), options=options)
    zeros = common_zeros(f, f.diff(x), x, p, BOX)
    assert zeros is not None
    wanted = [
        (a, b, float(f.diff(x, 2).subs({x: a, p: b})), float(f.diff(p).subs({x: a, p: b})))
        for a, b in zeros
    ]
    assert branch.points.sizes["point"] > 1
    kinds = ("fold", "branch_point", "transcritical", "pitchfork")
    found = [one for one in branch.special_points if one.kind in kinds]
    for one in found:  # nothing that is none
        here = np.array([state_of(one)[0], one.parameters["p"]])
        off = min((float(np.max(abs(here - w[:2]))) for w in wanted), default=np.inf)
        assert off < (1e-9 if one.status == "converged" else 1e-4), (one, wanted)
    path = np.column_stack([branch.points.x.values, branch.points.p.values])
    a, chord = path[:-1], np.diff(path, axis=0)
    for u, v, bend, slope in wanted:  # nothing lost
        if min(abs(bend), abs(slope)) < SIMPLE or abs(v) > 2.0 or abs(u) > BOX:
            continue
        here = np.array([u, v])
        along = np.sum((here - a) * chord, axis=1) / np.sum(chord**2, axis=1)
        gap = here - a - np.clip(along, 0.0, 1.0)[:, None] * chord
        if np.min(np.hypot(*gap.T)) < 1e-4:
            near = [one for one in found if abs(one.parameters["p"] - v) < 1e-8]
            assert near, ((u, v), branch.special_points)
