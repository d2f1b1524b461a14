"""Eigenvalues next to the axis, against closed forms: slow turns beside fast states, doubles."""

import numpy as np
import pytest
import scipy.sparse as sp

from phasekit.numerics.rightmost import spectrum_at


@pytest.mark.parametrize("fast", [1e3, 1e12, 1e14])
def test_a_slow_pair_beside_a_fast_state_is_no_pair_of_real_eigenvalues(fast):
    pair = np.array([[1e-3, -1.0], [1.0, 1e-3]])
    matrix = sp.csc_array(sp.block_diag([sp.coo_array(pair), [[-fast]], [[-2.0]]]))
    values = spectrum_at(matrix, np.ones(4)).values
    np.testing.assert_allclose(np.sort_complex(values), [-fast, -2.0, 1e-3 + 1.0j], rtol=1e-12)


def test_double_eigenvalues_of_a_ring_are_real():
    """Eigenvalues are 2 cos(2 pi k/n) - 1.9, but for k = 0 and n/2 double."""
    n = 40
    ring = np.roll(np.eye(n), 1, 0) + np.roll(np.eye(n), -1, 0) - 1.9 * np.eye(n)
    units = 1.0 + 0.3 * np.cos(1.7 * np.arange(n))
    values = spectrum_at(sp.csc_array(ring * units / units[:, None]), np.ones(n)).values
    assert not values.imag.any()
    wanted = 2.0 * np.cos(2.0 * np.pi * np.arange(n) / n) - 1.9
    np.testing.assert_allclose(np.sort(values.real), np.sort(wanted), atol=1e-12)
