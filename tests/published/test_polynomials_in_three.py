"""Branches of random quadratic systems in three unknowns against exact elimination.

``PHASEKIT_PATHS3=200`` follows so many; few are followed in every run.
"""

from __future__ import annotations

import os

import numpy as np
import pytest
import sympy as sp
from published.compare import state_of
from published.elimination import common_zeros

import phasekit as pk

PATHS = int(os.environ.get("PHASEKIT_PATHS3", "4"))
x, y, z, p = sp.symbols("x y z p", real=True)
SIMPLE = 1e-2  # points that are crossed more slowly lie next to others
BOX = 25.0
CROSSINGS = ("fold", "branch_point", "transcritical", "pitchfork")
PAIRS = ("hopf", "neutral_saddle")


def quadratic(rng, *monomials):
    """A random sum of monomials with small whole coefficients."""
    return sum(
        int(c) * q for c, q in zip(rng.integers(-2, 3, len(monomials)), monomials, strict=True)
    )


def drawn(rng):
    """Three quadratic equations in (x, y, z, p), and the y and z of their solutions."""
    of_y = quadratic(rng, 1, x, p, x**2, x * p)
    of_z = quadratic(rng, 1, x, p, y, x * p, x**2) + int(rng.choice([-1, 1])) * x * y
    law = quadratic(rng, 1, x, y, p, x**2, x * y, x * p, y * p) + int(rng.choice([-1, 1])) * z
    parts = sp.Matrix([law + p / 7, of_y - y, of_z - z])
    while True:
        mixed = sp.Matrix(rng.integers(-2, 3, (3, 3)).tolist())
        if mixed.det():
            break
    equations = [sp.expand(e) for e in mixed * parts]
    assert all(sp.Poly(e, x, y, z, p).total_degree() <= 2 for e in equations)
    return equations, of_y, sp.expand(of_z.subs(y, of_y)), law + p / 7


def system(seed):
    """The first drawn that has an equilibrium at one of some p, and the equilibrium."""
    rng = np.random.default_rng(seed)
    while True:
        equations, of_y, of_z, law = drawn(rng)
        reduced = sp.expand(law.subs({z: of_z, y: of_y}))
        for at in rng.uniform(-1.0, 1.0, 8).tolist():
            of_x = sp.Poly(reduced.subs(p, at), x).all_coeffs()
            roots = np.roots([float(c) for c in of_x])
            real = roots.real[(abs(roots.imag) < 1e-9) & (abs(roots.real) < BOX)]
            if real.size:
                u = float(real[0])
                start = [u, float(of_y.subs({x: u, p: at})), float(of_z.subs({x: u, p: at}))]
                return equations, (of_y, of_z, reduced), at, start


def passed(path, u, v):
    """How far the path stays from a point; two special points of it may be one."""
    path = path[np.append(True, np.any(np.diff(path, axis=0) != 0.0, axis=1))]
    a, chord = path[:-1], np.diff(path, axis=0)
    here = np.array([u, v])
    along = np.sum((here - a) * chord, axis=1) / np.sum(chord**2, axis=1)
    gap = here - a - np.clip(along, 0.0, 1.0)[:, None] * chord
    return np.min(np.hypot(*gap.T))


@pytest.mark.parametrize("seed", range(PATHS))
def test_points_are_those_of_exact_elimination(seed):
    equations, (of_y, of_z, reduced), at, start = system(seed)
    jacobian = sp.Matrix(equations).jacobian([x, y, z])
    trace = jacobian.trace()
    minors = sum(jacobian.minor(i, i) for i in range(3))
    # Two eigenvalues of opposite sign: of a pair on the imaginary axis if the minors are positive.
    opposite = sp.expand((trace * minors - jacobian.det()).subs({z: of_z, y: of_y}))
    minors = sp.expand(minors.subs({z: of_z, y: of_y}))
    folds = common_zeros(reduced, reduced.diff(x), x, p, BOX)
    pairs = common_zeros(reduced, opposite, x, p, BOX)
    problem = pk.Problem([str(e) for e in equations], state=["x", "y", "z"], parameters={"p": at})
    options = pk.ContinuationOptions(bounds={"x": (-BOX, BOX)}, max_points=1000)
    branch = pk.continuation(problem, "p", x0=start, span=(-2.0, 2.0), options=options)
    assert branch.points.sizes["point"] > 1
    path = np.column_stack([branch.points.x.values, branch.points.p.values])
    slope = [sp.lambdify((x, p), reduced.diff(q)) for q in (x, p)]
    bend = sp.lambdify((x, p), reduced.diff(x, 2))
    across = sp.lambdify(
        (x, p), opposite.diff(x) * reduced.diff(p) - opposite.diff(p) * reduced.diff(x)
    )
    second = sp.lambdify((x, p), minors)
    for wanted, kinds in ((folds, CROSSINGS), (pairs, PAIRS)):
        if wanted is None:  # an identity, everywhere on the branch
            continue
        found = [one for one in branch.special_points if one.kind in kinds]
        for one in found:  # nothing that is none
            here = np.array([state_of(one)[0], one.parameters["p"]])
            off = min((float(np.max(abs(here - w))) for w in wanted), default=np.inf)
            assert off < (1e-8 if one.status == "converged" else 1e-4), (one, wanted)
            if kinds is PAIRS:
                assert (second(*here) > 0.0) == (one.kind == "hopf")
        for u, v in wanted:  # nothing lost
            size = np.hypot(slope[0](u, v), slope[1](u, v))
            clear = (
                min(abs(bend(u, v)), abs(slope[1](u, v))) > SIMPLE
                if kinds is CROSSINGS
                else abs(across(u, v)) > SIMPLE * size and abs(second(u, v)) > SIMPLE
            )
            if clear and abs(v) < 1.999 and abs(u) < 0.99 * BOX and passed(path, u, v) < 1e-4:
                near = [one for one in found if abs(one.parameters["p"] - v) < 1e-7]
                assert near, ((u, v), kinds, branch.special_points)
