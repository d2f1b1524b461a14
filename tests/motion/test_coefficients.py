"""The coefficients of DOP853 are SciPy's, and obey the conditions of their orders."""

import numpy as np
import pytest
from scipy.integrate import DOP853

from phasekit.motion.kernels import coefficients, dop853


def full(sums, width=16):
    return np.array([[one.get(place, 0.0) for place in range(width)] for one in sums])


def test_they_are_those_of_scipy():
    rows = full(coefficients.SUMS)
    assert np.array_equal(rows[:11, :12], DOP853.A[1:])
    assert np.array_equal(rows[11, :12], DOP853.B)
    assert np.array_equal(rows[12:15], DOP853.A_EXTRA)
    assert np.array_equal(rows[15:, :13], [DOP853.E3, DOP853.E5])
    assert np.array_equal(dop853.D, DOP853.D)
    assert np.array_equal(dop853.C, DOP853.C)
    assert np.array_equal(dop853.C_MORE, DOP853.C_EXTRA)


@pytest.mark.parametrize("order", range(1, 9))
def test_weights_integrate_powers(order):
    b = full(coefficients.SUMS)[11, :12]
    assert b @ dop853.C ** (order - 1) == pytest.approx(1.0 / order, rel=1e-14)


def test_stages_stand_at_their_times():
    rows = full(coefficients.SUMS)
    assert rows[:11].sum(axis=1) == pytest.approx(dop853.C[1:], abs=1e-14)
    assert rows[12:15].sum(axis=1) == pytest.approx(dop853.C_MORE, abs=1e-13)


def test_errors_are_differences_of_weights():
    assert full(coefficients.SUMS)[15:].sum(axis=1) == pytest.approx(0.0, abs=1e-14)
