"""What holds of every branch of equilibria, whatever the system.

`tests/conftest.py` holds every branch that any test computes in its own process against this.
"""

from __future__ import annotations

from typing import Any

import numpy as np

NOISE = 1e-8  # real parts that are smaller, relative to the largest eigenvalue, have no sign
ROUNDING = 1e-13  # of the terms of f
SAME = 1e-6  # distance on scaled axes
OWN = 1e-9  # of points that were refined each in a bracket of its own


def check(curve: Any, path: Any, placed: Any, eigenvalues: Any, conservative: bool) -> None:
    """Hold the special points of a path of equilibria against the eigenvalues at its points."""
    specials = [one.special for one in placed]
    if curve.keeps:
        _every_point_is_one(curve, path)
    for special in specials:
        assert special.status in ("converged", "guess")
        assert special.status == "converged" or special.message, special
        if special.kind == "hopf":
            assert special.normal_form["omega"] > 0.0, special
            values = np.linalg.eigvals(curve.evaluate(special.u)[1][:, : curve.n])
            assert np.any(values.imag != 0.0), (special, values)
        branching = special.kind in ("branch_point", "pitchfork", "transcritical")
        if branching and special.status == "converged":
            assert special.corank >= 1, special
    _no_twins(curve, path, placed)
    if not conservative:
        _every_crossing_is_said(curve, path, placed, eigenvalues)


def _every_point_is_one(curve: Any, path: Any) -> None:
    """At every point f is rounding of its terms, and of unknowns in units of their scales."""
    m = curve.m
    assert len(path.residual) == path.count
    for i in np.flatnonzero(~(path.residual <= ROUNDING)):
        u = path.u[i, :m]
        value, slopes = curve.evaluate(u)
        terms = np.abs(slopes) @ np.maximum(np.abs(u), curve.scale[:m])
        known = np.all(np.abs(value) <= ROUNDING * terms)
        assert known or path.messages, (u, value, terms, path.residual[i])


def _no_twins(curve: Any, path: Any, placed: Any) -> None:
    m = curve.m
    for i, one in enumerate(placed):
        for other in placed[i + 1 :]:
            gap = (one.special.u[:m] - other.special.u[:m]) / curve.scale[:m]
            alike = one.special.kind == other.special.kind and other.index - one.index <= 1
            apart = OWN if one.own and other.own else SAME
            assert not (alike and np.max(np.abs(gap)) < apart), (one, other)


def _every_crossing_is_said(curve: Any, path: Any, placed: Any, eigenvalues: Any) -> None:
    size = np.max(np.abs(eigenvalues), axis=1)
    # Of a map multipliers cross the unit circle.
    growth = np.abs(eigenvalues) - 1.0 if curve.discrete else eigenvalues.real
    clear = np.min(np.abs(growth), axis=1) > NOISE * size
    unstable = np.sum(growth > 0.0, axis=1)
    points = np.flatnonzero(clear)
    for i, j in zip(points[:-1], points[1:], strict=True):
        if unstable[i] == unstable[j]:
            continue
        between = [one.special for one in placed if i - 1 <= one.index <= j]
        most = sum(_crossing(one) for one in between)
        said = any(one.message for one in between)
        change = abs(int(unstable[j]) - int(unstable[i]))
        assert most >= change or said, (
            f"{change} eigenvalues cross between {path.u[i]} and {path.u[j]}, but there is only "
            f"{[one.kind for one in between]}"
        )


def _crossing(special: Any) -> int:
    """How many eigenvalues cross at a special point, at most."""
    known = {"hopf": 2, "torus": 2, "period_doubling": 1}
    return known.get(special.kind, special.corank)
