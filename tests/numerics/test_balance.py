"""Balanced units, against LAPACK's."""

import numpy as np
import pytest
from scipy.linalg import matrix_balance

from phasekit.numerics.balance import balanced


@pytest.mark.parametrize("n", [1, 2, 3, 6])
def test_units_are_those_of_lapack(n):
    rng = np.random.default_rng(n)
    sizes = 10.0 ** rng.uniform(-9.0, 9.0, (2, 40, n))
    matrices = rng.standard_normal((40, n, n)) * sizes[0, :, :, None] * sizes[1, :, None]
    matrices[rng.random(matrices.shape) < 0.2] = 0.0
    matrices[:4] = rng.integers(-3, 4, (4, n, n))
    found, units = balanced(matrices)
    wanted = [matrix_balance(one, permute=False, separate=True) for one in matrices]
    assert (units != 1.0).any() == (n > 1)
    np.testing.assert_array_equal(found, [one for one, _ in wanted])
    np.testing.assert_array_equal(units, [scale for _, (scale, _) in wanted])


@pytest.mark.parametrize("size", [1e-300, 1e300])
def test_numbers_at_the_ends_of_doubles(size):
    matrix = size * np.array([[1.0, 1e6], [1e-2, 2.0]])
    found, units = balanced(matrix[None])
    wanted, (scale, _) = matrix_balance(matrix, permute=False, separate=True)
    assert np.array_equal(found[0], wanted)
    assert np.array_equal(units[0], scale)


def test_what_is_no_number_has_an_end():
    rng = np.random.default_rng(0)
    matrices = 10.0 ** rng.uniform(-300.0, 300.0, (400, 4, 4))
    values = [0.0, np.inf, -np.inf, np.nan, 5e-324, 1.7e308]
    hit = rng.random(matrices.shape) < 0.3
    matrices[hit] = rng.choice(values, hit.sum())
    with np.errstate(all="ignore"):
        _, units = balanced(matrices)
    assert np.isfinite(units).all()
    assert (units > 0.0).all()
    assert (np.frexp(units)[0] == 0.5).all()
