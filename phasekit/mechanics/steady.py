"""Steady rotations of the freely carried disk, for many machines: equilibria at fixed momentum."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from phasekit.errors import EquilibriumKind
from phasekit.inputs import FloatArray
from phasekit.mechanics.two_degrees import (
    TwoDegrees,
    effective_inertia,
    relative_equilibria,
    support_inertia,
    two_degrees,
)

#: A trigonometric polynomial of degree five has at most so many zeros.
MOST = 10


class Steady(NamedTuple):
    """Equilibria of the amended potential on the last axis, by angle; NaN beyond the last."""

    phi: FloatArray
    kind: npt.NDArray[np.int8]
    energy: FloatArray
    curvature: FloatArray
    natural_frequency: FloatArray
    exponent: FloatArray
    n_equilibria: npt.NDArray[np.int8]


def steady_at(machines: TwoDegrees, p: npt.ArrayLike, torque: npt.ArrayLike = 0.0) -> Steady:
    """Equilibria of V_p = V + p^2/(2 M11) at momenta p, under torques on the shaft in N m.

    All broadcast; energies and curvatures are in J. What is not finite has n_equilibria -1.

    Examples
    --------
    >>> machine = two_degrees(1.0, 0.1, 0.0, 0.1, 2.0, 0.02)
    >>> [int(steady_at(machine, 0.5, torque).n_equilibria) for torque in (0.0, 5.0)]
    [4, 0]
    """
    arrays = np.broadcast_arrays(*machines, p, torque)
    shape = arrays[0].shape
    *fields, momenta, torques = (np.asarray(x, float).reshape(-1) for x in arrays)
    with np.errstate(all="ignore"):
        usable = np.isfinite(momenta * momenta) & np.isfinite(sum(fields)) & np.isfinite(torques)
    size = momenta.size
    columns = np.full((5, size, MOST), np.nan)
    kind = np.full((size, MOST), EquilibriumKind.NOT_COMPUTED, np.int8)
    count = np.full(size, -1, np.int8)
    for i in np.flatnonzero(usable):
        one = TwoDegrees(*(float(x[i]) for x in fields))
        with np.errstate(all="ignore"):
            one_has = relative_equilibria(one, float(momenta[i]), float(torques[i]))
            n = count[i] = one_has.phi.size
            kind[i, :n], kind[i, n:] = one_has.kind, EquilibriumKind.ABSENT
            saddle = one_has.kind == EquilibriumKind.SADDLE
            fall = np.where(saddle, -one_has.curvature, np.nan)
            exponent = np.sqrt(fall / effective_inertia(one, one_has.phi))
            rows = (*one_has[:1], *one_has[2:5], exponent)
            columns[:, i, :n] = rows
    n = max(int(count.max(initial=0)), 0)
    found = columns[:, :, :n].reshape(5, *shape, n)
    phi, energy, curvature, frequency, exponents = found
    kinds, counts = kind[:, :n].reshape(*shape, n), count.reshape(shape)
    return Steady(phi, kinds, energy, curvature, frequency, exponents, counts)


def support_speed(
    beta: npt.ArrayLike,
    e: npt.ArrayLike,
    a: npt.ArrayLike,
    r: npt.ArrayLike,
    m: npt.ArrayLike,
    g: npt.ArrayLike,
    carrier_inertia: npt.ArrayLike,
    omega1: npt.ArrayLike,
    phi: npt.ArrayLike,
    *,
    momentum: npt.ArrayLike | None = None,
) -> FloatArray:
    """Angular velocity p/M11 of the support in steady rotations at phi, on the last axis, s^-1.

    Examples
    --------
    >>> support_speed(1.0, 0.1, 0.0, 0.1, 2.0, 9.81, 0.02, 15.0, [0.0]).round(9)
    array([15.])
    """
    with np.errstate(all="ignore"):
        machine = two_degrees(beta, e, a, r, m, carrier_inertia, g)
        lever = np.asarray(support_inertia(machine, 0.0)[0])
        p = np.asarray(omega1 * lever if momentum is None else momentum)
        spread = TwoDegrees(*(np.asarray(x)[..., None] for x in machine))
        return np.asarray(p[..., None] / support_inertia(spread, np.asarray(phi))[0])
