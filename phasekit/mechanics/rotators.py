"""Vector rotators of the disk: the kinematic vectors by which its momenta change."""

from __future__ import annotations

from typing import NamedTuple

import numpy.typing as npt

from phasekit.arrays import Array
from phasekit.mechanics import disk_states as kernels
from phasekit.mechanics.disk_table import at_states, machine_table

#: Rotators in the order of the last axis but one.
ROTATORS = ("R01", "R011", "R022", "R012", "R1", "R2", "R12", "R12c")


class Rotators(NamedTuple):
    """Rotators at states."""

    rotator: Array
    rotator_intensity: Array
    gamma2: Array
    gamma2_rate: Array
    hodograph_u: Array
    hodograph_v: Array


def rotators(
    beta: npt.ArrayLike,
    e: npt.ArrayLike,
    a: npt.ArrayLike,
    r: npt.ArrayLike,
    omega1: npt.ArrayLike,
    g: npt.ArrayLike,
    phi: npt.ArrayLike,
    dphi: npt.ArrayLike,
    ddphi: npt.ArrayLike | None = None,
    domega1: npt.ArrayLike = 0.0,
    *,
    threads: int | None = None,
) -> Rotators:
    """Vector rotators of the disk at states, in the carrier frame (u01, v01, n1), 1/s^2.

    For a base vector b square to an axis n, u = b/|b| and v = [n, u], the rotator is
    R = omega' u + omega^2 v; the coupling rotators are 2 omega1 omega2 b/|b|.

    ``ddphi`` is that of the free motion if left out; ``gamma2_rate`` takes domega1 as constant.

    Returns
    -------
    Rotators
        ``rotator`` with the axes (..., 8, 3): R01 ([n1, r0]), R011 (S_n1), R022 (S_n2), R012
        ([n1, S_n2]), R1 (D_n1), R2 (D_n2), R12 ([n1, J_n2]) and R12c (the coupling vector that
        enters the rate of angular momentum); ``rotator_intensity`` (..., 8). NaN where the base
        vector is zero. ``gamma2``, the angle of R022 from its base vector, its rate (NaN where
        ddphi is given, and at rest in an equilibrium), and the hodograph (phi'', phi'^2).

    Notes
    -----
    [HedrihVeljovic2011] (4.1), (4.6)-(4.11), (5.1), (6.8)-(6.12), corrected.

    Examples
    --------
    >>> result = rotators(0.3, 0.1, 0.05, 0.1, 10.0, 9.81, 0.5, 2.0)
    >>> [round(float(x), 9) for x in result.rotator_intensity[:3]]
    [100.0, 100.0, 19.50616379]
    """
    free = ddphi is None
    body = machine_table(beta, e, a, r, omega1, g)
    given = 0.0 if ddphi is None else ddphi
    states = {"phi": phi, "dphi": dphi, "ddphi": given, "domega1": domega1}
    tails = ((len(ROTATORS), 3), (len(ROTATORS),), (), (), (), ())
    return Rotators(*at_states(kernels.rotators, body, states, (free,), tails, threads))
