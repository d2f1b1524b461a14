"""Formulas whose signs tell stable equilibria, against eigenvalues."""

import numpy as np
import pytest
import sympy as sp

from phasekit.numerics.intervals.stability import stability_signs


@pytest.mark.parametrize("n", [1, 2, 3, 4])
def test_all_are_positive_where_all_eigenvalues_have_negative_real_parts(n):
    states, entries = sp.symbols(f"x0:{n}", real=True), sp.symbols(f"p0:{n * n}", real=True)
    f = [sum(entries[i * n + j] * states[j] for j in range(n)) for i in range(n)]
    matrices = np.random.default_rng(n).normal(size=(90, n, n)) - 0.8 * np.eye(n)
    signs = sp.lambdify(entries, stability_signs(tuple(f), states))
    got = np.stack(np.broadcast_arrays(*signs(*matrices.reshape(90, -1).T)))
    stable = (np.linalg.eigvals(matrices).real < 0.0).all(axis=1)
    assert 10 < stable.sum() < 80
    np.testing.assert_array_equal((got > 0.0).all(axis=0), stable)
    # The number of equilibria changes with the first.
    np.testing.assert_allclose(got[0], np.linalg.det(-matrices), rtol=1e-9)
