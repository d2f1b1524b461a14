"""Elimination on pieces of a flat array, interpreted and compiled, against NumPy."""

import numpy as np
import pytest

from phasekit.bifurcation.continuation.kernels import newton
from phasekit.numerics import native
from phasekit.numerics.compile import kernel


@kernel
def compiled(w, a, b, n):
    return native.solve(w, a, b, n)


@pytest.mark.parametrize("n", [2, 5, 7, 40, 100])
@pytest.mark.parametrize("solve", [native.solve, compiled])
def test_elimination_gives_both_solutions_and_the_sign_of_the_determinant(solve, n):
    rng = np.random.default_rng(n)
    seen = set()
    for _ in range(8):
        matrix, right = rng.normal(size=(n, n)), rng.normal(size=(n, 2))
        w = np.concatenate([[7.0], matrix.ravel(), right.ravel(), [9.0]])
        sign = solve(w, 1, 1 + n * n, n)
        np.testing.assert_allclose(
            w[1 + n * n : -1].reshape(n, 2), np.linalg.solve(matrix, right), rtol=1e-9
        )
        assert sign == np.linalg.slogdet(matrix)[0]
        assert (w[0], w[-1]) == (7.0, 9.0)
        seen.add(sign)
    assert seen == {1.0, -1.0}
    w = np.concatenate([np.ones(n * n), np.ones(2 * n)])
    assert solve(w, 0, n * n, n) == 0.0


@pytest.mark.parametrize("n", [2, newton.FEW, newton.FEW + 1])
def test_a_newton_step_is_the_same_for_few_and_many_unknowns(n):
    rng = np.random.default_rng(n)
    slopes, scale, row = rng.normal(size=(n - 1, n)), rng.uniform(0.1, 10.0, n), rng.normal(size=n)
    value, rest = rng.normal(size=n - 1), 0.3
    parts = [value, slopes.ravel(), scale, row, np.zeros(n * n), np.zeros(2 * n)]
    g, jac, at_scale, at_row, a, b = np.cumsum([0, *(part.size for part in parts)])[:6].tolist()
    w = np.concatenate(parts)
    sign = newton.solved(w, g, jac, n - 1, n, at_scale, at_row, rest, a, b)
    whole = np.vstack([slopes, row])
    step, tangent = w[b:].reshape(n, 2).T * scale
    np.testing.assert_allclose(whole @ step, -np.append(value, rest), rtol=1e-10, atol=1e-10)
    direction = whole @ tangent
    np.testing.assert_allclose(direction[:-1], 0.0, atol=1e-10)
    assert direction[-1] > 0.0
    assert sign == np.linalg.slogdet(whole)[0]
