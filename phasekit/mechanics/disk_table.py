"""The disk as the kernels of rotators and bearing forces take it: a table, one column a body."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np
import numpy.typing as npt

from phasekit.arrays import Array
from phasekit.mechanics import disk_states as kernels
from phasekit.mechanics.disk import disk_coefficients, disk_inertia, disk_mixing
from phasekit.mechanics.vectors import broadcast, common_shape, floats
from phasekit.numerics.launch import Arrays, launch


def machine_table(
    beta: npt.ArrayLike,
    e: npt.ArrayLike,
    a: npt.ArrayLike,
    r: npt.ArrayLike,
    omega1: npt.ArrayLike,
    g: npt.ArrayLike,
    m: npt.ArrayLike = 1.0,
    half_span: npt.ArrayLike = 1.0,
) -> tuple[Array, tuple[int, ...]]:
    """What the kernels need of bodies, one a column, and the shape that the bodies have.

    Columns of what is not a body are NaN.
    """
    arrays = broadcast(beta=beta, e=e, a=a, r=r, omega1=omega1, g=g, m=m, half_span=half_span)
    shape = arrays[0].shape
    beta, e, a, r, omega1, g, m, half_span = (array.reshape(-1) for array in arrays)
    with np.errstate(all="ignore"):
        # Exactly 0 at the doubles nearest to pi and pi/2: a shaft in the plane, or square to it.
        s = np.where(beta == np.pi, 0.0, np.sin(beta))
        c = np.where(beta == np.pi / 2, 0.0, np.cos(beta))
        ju, jv, jn, _ = disk_inertia(m, r, e, beta)
        table = np.empty((kernels.SIZE, beta.size))
        table[kernels.A], table[kernels.B], table[kernels.C] = disk_coefficients(
            beta, e, a, r, omega1, g
        )
        table[kernels.MIXING] = disk_mixing(r, e, beta)
        table[kernels.OMEGA], table[kernels.ARM] = omega1, a
        table[kernels.ACROSS], table[kernels.ALONG] = e * s, e * c
        table[kernels.JU], table[kernels.JV], table[kernels.JN] = ju, jv, jn
        table[kernels.JVN] = ju * s * c
        table[kernels.MASS], table[kernels.WEIGHT] = m, m * g
        table[kernels.SPAN] = half_span
        body = np.isfinite(table[kernels.A]) & (m > 0.0) & (half_span > 0.0)
        table[:, ~(body & np.isfinite(m) & np.isfinite(half_span))] = np.nan
    return table, shape


def at_states(
    kernel: Callable[..., None],
    body: tuple[Array, tuple[int, ...]],
    states: Mapping[str, npt.ArrayLike],
    flags: tuple[bool, ...],
    tails: tuple[tuple[int, ...], ...],
    threads: int | None,
) -> Arrays:
    """Run a kernel over states that broadcast against bodies; ``tails`` are the outputs' axes.

    All results are NaN in a state of which any number is not finite.
    """
    table, own = body
    arrays = floats(**states)
    arrays = [np.where(np.isfinite(array), array, np.nan) for array in arrays]
    shapes = {name: array.shape for name, array in zip(states, arrays, strict=True)}
    shape = common_shape(disk=own, **shapes)
    index = np.broadcast_to(np.arange(table.shape[1]).reshape(own), shape)
    # Copies: numba compiles a kernel anew for arrays that are read-only or not contiguous.
    flat = [np.array(np.broadcast_to(array, shape)).reshape(-1) for array in (index, *arrays)]
    out = tuple(np.empty((flat[0].size, *tail)) for tail in tails)
    inputs: tuple[Any, ...] = (table, *flat, *flags)
    launch(kernel, inputs, flat[0].size, (out,), threads)
    unknown = np.any([np.isnan(state) for state in flat[1:]], axis=0)
    if unknown.any():
        for array in out:
            array[unknown] = np.nan
    return tuple(array.reshape(shape + tail) for array, tail in zip(out, tails, strict=True))
