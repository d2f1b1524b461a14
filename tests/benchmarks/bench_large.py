"""Branches of many states beside bare loops of NumPy and of scipy.sparse, in one run.

Run with ``OPENBLAS_NUM_THREADS=1 pytest tests/benchmarks/bench_large.py``; the table is printed. A
bare loop takes steps of the same kind along the same branch, as many as phasekit has points,
and looks for no special points: a tangent, and chord steps in the plane across it. CPU times.
"""

from __future__ import annotations

import time
import warnings
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
import scipy.sparse as sp
from scipy.linalg import lu_factor, lu_solve
from scipy.sparse.linalg import splu

import phasekit as pk


def cpu(run: Callable[[], Any]) -> tuple[float, Any]:
    """CPU time of a run, and its result."""
    start = time.process_time()
    result = run()
    return time.process_time() - start, result


def laplacian(n: int) -> Any:
    """Second differences between ends of value 0."""
    return (
        sp.diags_array(
            [np.ones(n - 1), -2.0 * np.ones(n), np.ones(n - 1)], offsets=[-1, 0, 1], format="csr"
        )
        * (n + 1.0) ** 2
    )


def bare_loop(f: Any, jac: Any, slope: Any, x: Any, p: float, points: int, step: float) -> float:
    """Steps of pseudo-arclength with one Jacobian and one factorisation each."""
    n = len(x)
    scale = np.sqrt(n)

    def solver(x: Any, p: float) -> Callable[[Any], Any]:
        matrix = jac(x, p)
        if sp.issparse(matrix):
            return splu(sp.csc_array(matrix)).solve
        factors = lu_factor(matrix)
        return lambda right: lu_solve(factors, right)

    for _ in range(6):
        x = x - solver(x, p)(f(x, p))
    dx, dp = np.zeros(n), 1.0
    solve = solver(x, p)
    for _ in range(points):
        down = solve(-slope(x, p))
        length = np.sqrt(np.sum((down / scale) ** 2) + 1.0)
        forward = np.sign(np.sum(dx * down) / scale**2 + dp) or 1.0
        dx, dp = forward * down / length, forward / length
        y, q = x + step * dx, p + step * dp
        solve = solver(y, q)
        for _ in range(20):
            a, b = solve(np.column_stack([f(y, q), slope(y, q)])).T
            off = np.sum(dx * (y - x)) / scale**2 + dp * (q - p) - step
            move = (np.sum(dx * a) / scale**2 - off) / (dp - np.sum(dx * b) / scale**2)
            y, q = y - a - b * move, q + move
            if np.max(np.abs(a + b * move)) < 1e-9:
                break
        x, p = y, q
    return p


def bratu(n: int, named: bool) -> tuple[Any, Any, Any, Any]:
    """The problem, and what a bare loop takes."""
    L = laplacian(n)
    dense = L.toarray() if named else None

    def f(u: Any, lam: float) -> Any:
        return (dense if named else L) @ u + lam * np.exp(u)

    def jac(u: Any, lam: float) -> Any:
        if named:  # differences, as phasekit takes them of a function
            steps = 1e-6 * np.eye(n)
            return np.array([(f(u + e, lam) - f(u - e, lam)) / 2e-6 for e in steps]).T
        return L + sp.diags_array(lam * np.exp(u))

    state: Any = [f"u_{i}" for i in range(n)] if named else [("u", n)]
    given = {} if named else {"jac": jac}
    return pk.Problem(f, state, {"lam": 0.1}, **given), f, jac, lambda u, lam: np.exp(u)


def brusselator(m: int) -> tuple[Any, Any, Any, Any]:
    """Two fields in one dimension at rest, along the length."""
    A, B, first, second = 2.0, 5.45, 0.008, 0.004
    L, ends = laplacian(m), np.zeros(m)
    ends[[0, -1]] = (m + 1.0) ** 2

    def spread(x: Any) -> Any:
        return np.append(first * (L @ x[:m] + ends * A), second * (L @ x[m:] + ends * B / A))

    def f(x: Any, length: float) -> Any:
        u, v = x[:m], x[m:]
        here = np.append(u * u * v - (B + 1.0) * u + A, B * u - u * u * v)
        return spread(x) / length**2 + here

    def jac(x: Any, length: float) -> Any:
        u, v, d = x[:m], x[m:], sp.diags_array
        upper = [first / length**2 * L + d(2.0 * u * v - B - 1.0), d(u * u)]
        lower = [d(B - 2.0 * u * v), second / length**2 * L - d(u * u)]
        return sp.block_array([upper, lower], format="csc")

    problem = pk.Problem(f, [("u", m), ("v", m)], {"length": 0.3}, jac=jac)
    return problem, f, jac, lambda x, length: -2.0 * spread(x) / length**3


NAMED, FIELDS = (20, 50, 100, 200, 850), (1_000, 10_000, 100_000)
CASES: dict[str, tuple[Any, str, Any, tuple[float, float], str, int]] = {
    **{
        f"Bratu, {n} named states": (bratu(n, True), "lam", np.zeros(n), (0.1, 4.0), "fold", 1)
        for n in NAMED
    },
    **{
        f"Bratu, a field of {n:,}": (bratu(n, False), "lam", np.zeros(n), (0.1, 4.0), "fold", 1)
        for n in FIELDS
    },
    "Brusselator, two fields of 1,000": (
        brusselator(1000), "length", np.repeat([2.0, 2.725], 1000), (0.3, 5.3), "hopf", 10
    ),
}  # fmt: skip


def test_branches(capsys: pytest.CaptureFixture[str]) -> None:
    """Whole branches with their special points; the start is a branch of one point."""
    with capsys.disabled():
        print(f"\n\n{'':34}{'points':>8}{'start, s':>10}{'ms/point':>10}{'loop':>8}{'ratio':>8}")
    for name, ((problem, f, jac, slope), free, x0, span, kind, count) in CASES.items():

        def run(points: int, given: Any = (problem, free, x0, span)) -> Any:
            options = pk.ContinuationOptions(directions="forward", max_points=points)
            with warnings.catch_warnings():
                warnings.simplefilter("ignore", RuntimeWarning)  # of one point it is not complete
                return pk.continuation(*given[:2], x0=given[2], span=given[3], options=options)

        run(1)
        begin, small = cpu(lambda run=run: run(1))
        whole, branch = cpu(lambda run=run: run(400))
        assert len(branch.special(kind)) == count
        points = branch.points.sizes["point"] - small.points.sizes["point"]
        bare_given = f, jac, slope, x0, span[0], points, (span[1] - span[0]) / points
        alone, end = cpu(lambda given=bare_given: bare_loop(*given))
        assert np.isfinite(end)
        each, bare = (whole - begin) / points, alone / points
        with capsys.disabled():
            print(
                f"{name:34}{points:8d}{begin:10.2f}{each * 1e3:10.1f}{bare * 1e3:8.1f}"
                f"{each / bare:8.1f}"
            )
