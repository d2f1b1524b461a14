"""What sparse factors take, known before they are made."""

from __future__ import annotations

import numpy as np
import pytest
import scipy.sparse as sp
from scipy.sparse.linalg import splu

from phasekit.numerics.factors import entries_of


@pytest.mark.parametrize("shape", [(40,), (25, 30), (9, 10, 11)])
def test_entries_of_factors_are_those_that_superlu_makes(shape):
    """Of differences along up to three axes, in a shuffled order."""
    matrix = sp.csc_array((1, 1))
    for n in shape:
        along = sp.diags_array([np.ones(n - 1), -2.0 * np.ones(n), np.ones(n - 1)],
                               offsets=[-1, 0, 1])  # fmt: skip
        matrix = sp.kron(matrix, sp.eye_array(n)) + sp.kron(sp.eye_array(matrix.shape[0]), along)
    order = np.random.default_rng(1).permutation(matrix.shape[0])
    matrix = sp.csc_array(sp.csr_array(matrix)[order][:, order])
    made = splu(matrix, permc_spec="MMD_AT_PLUS_A", diag_pivot_thresh=0.0,
                options={"SymmetricMode": True})  # fmt: skip
    assert 0.99 * made.nnz <= entries_of(matrix) <= made.nnz  # which fills up dense blocks
