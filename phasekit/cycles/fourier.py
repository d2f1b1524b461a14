"""Fourier coefficients of periodic orbits: of the piecewise polynomials that they are."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from phasekit.arrays import Array
from phasekit.cycles.collocation import basis, pieces

#: Gauss points of an interval, beside those of the polynomial, for so much phase in it.
PER_RADIAN = 2.0


def coefficients(mesh: Array, x: Array, m: int, most: int) -> npt.NDArray[np.complex128]:
    """Complex amplitudes of the harmonics 0 to `most`: the mean, then 2 int x exp(-2 pi i k s) ds.

    Parameters
    ----------
    mesh : array, shape (intervals + 1,)
        Ends of the intervals, from 0 to 1.
    x : array, shape (intervals*m + 1,)
        Values at the places of the mesh.
    m : int
        Degree of the polynomials.
    most : int
        The highest harmonic.

    Examples
    --------
    >>> s = np.linspace(0.0, 1.0, 41)
    >>> coefficients(s[::4], 3.0 + np.cos(2 * np.pi * s + 0.5), 4, 1).round(6)
    array([3.      +0.j      , 0.877583+0.479426j])
    """
    turn = 2.0 * np.pi * most * float(np.diff(mesh).max())
    nodes, weights = np.polynomial.legendre.leggauss(m + 3 + int(np.ceil(PER_RADIAN * turn)))
    at = 0.5 * (nodes + 1.0)
    values = np.einsum("ij,kj->ki", basis(m, at)[0], pieces(x, m))
    lengths = np.diff(mesh)[:, None]
    s = mesh[:-1, None] + lengths * at
    weighted = 0.5 * lengths * weights * values
    waves = np.exp(-2j * np.pi * np.arange(most + 1)[:, None, None] * s)
    found = (waves * weighted).sum(axis=(1, 2))
    found[1:] *= 2.0
    return np.asarray(found)
