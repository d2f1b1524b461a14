"""Means over orbits of the bearing forces, or of the rotators, that have almost a kink.

The mean of a smooth periodic function over even samples converges exponentially; where a force
almost vanishes its size is no such function.
"""

from __future__ import annotations

import functools

import numpy as np
import numpy.typing as npt

from phasekit.loads import peaks as kernels
from phasekit.mechanics import disk_states
from phasekit.numerics.launch import launch
from phasekit.phase.exact.flow import flow

Array = npt.NDArray[np.float64]

#: Parts of a period, and how often each is halved at most.
PARTS, HALVINGS = 64, 30
#: Agreement of a part with its halves, and of all of them, in units of the whole.
CLOSE, ENOUGH = 1e-11, 1e-8
NODE, SHARE = np.polynomial.legendre.leggauss(8)


def measured(
    table: Array, start: Array, of_rotators: bool, threads: int | None, t: Array
) -> tuple[Array, Array, Array]:
    """The two measures after times, and the states; axes (orbits, times)."""
    table = np.ascontiguousarray(table)
    a, b, c = table[[disk_states.A, disk_states.B, disk_states.C]][..., None]
    phi0, dphi0 = start[..., None]
    phi, dphi = flow(a, b, c, phi0, dphi0, t, threads=threads)
    index = np.repeat(np.arange(table.shape[1]), t.shape[1])
    out = np.empty((index.size, 2))
    flat = (table, index, np.ravel(phi), np.ravel(dphi), of_rotators)
    launch(kernels.at_states, flat, index.size, ((out,),), threads)
    return out.reshape(*t.shape, 2), phi, dphi


def halved(
    table: Array, start: Array, period: float, of_rotators: bool, threads: int | None
) -> tuple[Array, Array]:
    """Mean and rms over one orbit by parts of its period; NaN where halving them changes it."""
    at = functools.partial(measured, table[:, None], start[:, None], of_rotators, threads)

    def over(low: Array, high: Array) -> Array:
        middle, half = 0.5 * (low + high)[:, None], 0.5 * (high - low)[:, None]
        values = at((middle + half * NODE).reshape(1, -1))[0].reshape(low.size, -1, 2)
        both = np.stack([values, values * values], axis=-1)
        return np.asarray(np.einsum("pt,ptkm->pkm", half * SHARE, both))

    edges = np.linspace(0.0, period, PARTS + 1)
    low, high = edges[:-1], edges[1:]
    rough = over(low, high)
    scale = rough.sum(axis=0)
    total, off = np.zeros((2, 2)), np.zeros((2, 2))
    for left in reversed(range(HALVINGS)):
        middle = 0.5 * (low + high)
        halves = over(low, middle), over(middle, high)
        fine = halves[0] + halves[1]
        change = np.abs(fine - rough)
        done = (change <= CLOSE * scale).all(axis=(1, 2)) | (left == 0)
        total += fine[done].sum(axis=0)
        off += change[done].sum(axis=0)
        low, high = (
            np.concatenate(ends)[np.tile(~done, 2)] for ends in ((low, middle), (middle, high))
        )
        rough = np.concatenate(halves)[np.tile(~done, 2)]
        if not low.size:
            break
    total[~(off <= ENOUGH * total)] = np.nan
    return total[:, 0] / period, np.sqrt(total[:, 1] / period)
