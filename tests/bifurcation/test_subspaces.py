"""Invariant subspaces and how they turn, beside SciPy's Schur forms and differences of them."""

import numpy as np
import pytest
from scipy.linalg import expm, schur

from phasekit.cycles.subspaces import subspace

SIZES = [(n, count) for n in (2, 3, 5) for count in range(n + 1)]


def matrix(n, unstable, seed):
    """A matrix with so many unstable eigenvalues, of random eigenvectors and pairs."""
    random = np.random.default_rng(seed)
    upper = np.triu(random.standard_normal((n, n)), 1)
    upper += np.diag(
        np.append(random.uniform(0.3, 2, unstable), random.uniform(-2, -0.3, n - unstable))
    )
    for k in (0, unstable):  # complex pairs, where two are on one side
        if k + 1 < (unstable if k == 0 else n):
            upper[k + 1, k + 1], upper[k, k + 1], upper[k + 1, k] = upper[k, k], 1.5, -0.7
    turn = np.linalg.qr(random.standard_normal((n, n)))[0]
    return turn @ upper @ turn.T


def expected(A, count, stable):
    """Projection across the subspace, and the form as an integral of the flow in it."""
    n = len(A)
    if count in (0, n):
        U, V = np.eye(n)[:, :count], np.eye(n)[:, count:]
    else:
        sort = "lhp" if stable else "rhp"
        Q = schur(A, sort=sort)[1]
        U, V = Q[:, :count], Q[:, count:]
    if count < 2:
        return V @ V.T, np.eye(n)
    B = U.T @ A @ U * (1.0 if stable else -1.0)
    h = 0.02
    weights = np.ones(1501)
    weights[1:-1:2], weights[2:-1:2] = 4.0, 2.0
    step, flow, M = expm(h * B), np.eye(count), np.zeros((count, count))
    for weight in weights:
        M += weight * h / 3.0 * flow.T @ flow
        flow = flow @ step
    return V @ V.T, U @ M @ U.T * (count / np.trace(M)) + V @ V.T


@pytest.mark.parametrize("stable", [False, True])
@pytest.mark.parametrize(("n", "count"), SIZES)
def test_subspaces_turn_as_differences_say(n, count, stable):
    A = matrix(n, n - count if stable else count, 7 * n + count)
    random = np.random.default_rng(n)
    dA, z = random.standard_normal((n, n)), random.standard_normal(n)
    found = subspace(A, count, stable)
    across, form = expected(A, count, stable)
    np.testing.assert_allclose(found.across @ found.across.T, across, atol=1e-12)
    np.testing.assert_allclose(found.measure, form, atol=1e-5)
    h = 1e-5
    sides = [expected(A + k * h * dA, count, stable) for k in (1, -1)]
    change, square = found.turned(dA, z)
    by_projection = found.across.T @ (sides[0][0] - sides[1][0]) @ z / (2.0 * h)
    np.testing.assert_allclose(change, by_projection, atol=1e-6, rtol=1e-6)
    by_form = z @ (sides[0][1] - sides[1][1]) @ z / (2.0 * h)
    np.testing.assert_allclose(square, by_form, atol=1e-4, rtol=1e-4)


def test_a_count_that_parts_a_pair_is_refused():
    pair = np.array([[0.1, 1.0, 0.0], [-1.0, 0.1, 0.0], [0.0, 0.0, -1.0]])
    with pytest.raises(np.linalg.LinAlgError, match="pair"):
        subspace(pair, 1, stable=False)
    with pytest.raises(np.linalg.LinAlgError, match="finite"):
        subspace(np.full((2, 2), np.nan), 1, stable=False)


@pytest.mark.parametrize("count", [0, 1, 2])
@pytest.mark.parametrize("value", [np.nan, np.inf])
def test_slopes_that_are_not_finite_do_not_turn_a_subspace(count, value):
    dA = np.zeros((2, 2))
    dA[1, 0] = value
    with pytest.raises(np.linalg.LinAlgError, match="slopes are not finite"):
        subspace(np.diag([-1.0, -2.0]), count, stable=True).turned(dA, np.ones(2))
