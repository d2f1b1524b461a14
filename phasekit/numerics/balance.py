"""Units in which the rows of a matrix are as large as its columns ([ParlettReinsch1969])."""

from __future__ import annotations

import math

import numpy as np

from phasekit.arrays import Array
from phasekit.numerics.compile import kernel
from phasekit.numerics.launch import launch

#: A change of units pays where it makes the norms of row and column this part of what they were.
PAYS = 0.95
#: Bounds of units, and of what is left of numbers, in doubles.
_SMALL = 2.0 * float(np.finfo(float).tiny / np.finfo(float).eps)
_LARGE = 1.0 / _SMALL


def balanced(matrices: Array) -> tuple[Array, Array]:
    """Matrices in balanced units, which are powers of 2, so that nothing is rounded; these units.

    As LAPACK's dgebal, without permutations and the import of it.

    >>> balanced(np.array([[[1.0, 1024.0], [1.0, 2.0]]]))
    (array([[[ 1., 32.],
            [32.,  2.]]]), array([[32.,  1.]]))
    """
    found = np.array(matrices, float)
    count, n = found.shape[:2]
    units = np.ones((count, n))
    launch(_balance, (found, units), count, (), 1, weight=max(1, n**2 // 4))
    return found, units


@kernel
def _balance(matrices: Array, units: Array, first: int, stop: int) -> None:
    """Balance matrices in place; units begin as 1."""
    n = matrices.shape[1]
    for k in range(first, stop):
        going = True
        while going:
            going = False
            for i in range(n):
                f, ca, ra = 1.0, 0.0, 0.0
                for j in range(n):
                    ca, ra = max(ca, abs(matrices[k, j, i])), max(ra, abs(matrices[k, i, j]))
                if ca == 0.0 or ra == 0.0:
                    continue
                c, r = 0.0, 0.0
                for j in range(n):
                    c, r = c + (matrices[k, j, i] / ca) ** 2, r + (matrices[k, i, j] / ra) ** 2
                c, r = ca * math.sqrt(c), ra * math.sqrt(r)
                size = c + r
                while c < 0.5 * r and max(f, c, ca) < _LARGE and min(r, 0.5 * r, ra) > _SMALL:
                    f, c, ca, r, ra = 2.0 * f, 2.0 * c, 2.0 * ca, 0.5 * r, 0.5 * ra
                while 0.5 * c >= r and max(r, ra) < _LARGE and min(f, 0.5 * c, ca) > _SMALL:
                    f, c, ca, r, ra = 0.5 * f, 0.5 * c, 0.5 * ca, 2.0 * r, 2.0 * ra
                if not c + r < PAYS * size:  # or something is no number
                    continue
                if not 0.5 * _SMALL < f * units[k, i] < 2.0 * _LARGE:
                    continue
                going = True
                units[k, i] *= f
                for j in range(n):
                    matrices[k, i, j] /= f
                for j in range(n):
                    matrices[k, j, i] *= f
