"""Bearing forces of the disk: reactions of the bearings on the rotor, opposite to the pressures.

The papers call kinetic pressure what the inertia of the rotor loads a bearing with. Here a force is
the one that the bearing exerts on the rotor; the pressure on the bearing is the opposite. The
kinetic part is that of the actual motion without the weight, the weight part that of the rotor at
rest.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from phasekit.arrays import Array
from phasekit.mechanics import disk_states as kernels
from phasekit.mechanics.disk_table import at_states, machine_table
from phasekit.mechanics.vectors import floats


class BearingForces(NamedTuple):
    """Forces on the rotor at the bearings A2, B2 of the shaft of self-rotation."""

    force: Array
    force_kinetic: Array
    force_weight: Array
    force_magnitude: Array
    force_axial: Array
    deviation_couple: Array
    drive_torque: Array
    force_component: Array


class FixedBearingForces(NamedTuple):
    """Forces on the rotor at the bearings A1, B1 of the fixed shaft."""

    fixed_force: Array
    fixed_force_kinetic: Array
    fixed_force_weight: Array


def bearing_forces(
    beta: npt.ArrayLike,
    e: npt.ArrayLike,
    a: npt.ArrayLike,
    r: npt.ArrayLike,
    omega1: npt.ArrayLike,
    m: npt.ArrayLike,
    g: npt.ArrayLike,
    half_span: npt.ArrayLike,
    phi: npt.ArrayLike,
    dphi: npt.ArrayLike,
    ddphi: npt.ArrayLike | None = None,
    domega1: npt.ArrayLike = 0.0,
    *,
    carrier: bool = False,
    threads: int | None = None,
) -> BearingForces:
    """Reactions of the bearings of the self-rotation shaft on the rotor, N.

    The bearing A2 at O2 + half_span n2 is spherical and takes the axial force, B2 at
    O2 - half_span n2 is cylindrical. Along (u2, v2, n2), which turns with the disk: u2 is
    tangential, v2 points from the disk's center to the shaft.

    ``ddphi`` is that of the free motion if left out; ``carrier`` gives components along the
    carrier's axes (u01, v01, n1) instead.

    Returns
    -------
    BearingForces
        ``force`` = ``force_kinetic`` + ``force_weight`` with the axes (..., 2, 3) for A2 and B2;
        ``force_magnitude`` (..., 2); ``force_axial``; ``deviation_couple``, the size of
        half_span [n2, F_A2 - F_B2] of the kinetic parts, N m; ``drive_torque`` about n1, N m;
        ``force_component`` (..., 2, 4), the papers' components of the kinetic part for constant
        omega1: along w1 = n1, w2 = sin(phi) u2 - cos(phi) v2, w3 = -v01, and the rotator R022.

    Notes
    -----
    [HedrihVeljovic2013] (22)-(28) and the components F_21 to F_24, corrected; F_24 times the
    intensity of R022 is a force.

    Examples
    --------
    At rest the bearings share the weight, 2 kg here:

    >>> rest = bearing_forces(0.3, 0.0, 0.0, 0.1, 0.0, 2.0, 9.81, 0.2, 0.0, 0.0)
    >>> rest.force.round(6).tolist()
    [[0.0, 9.81, 0.0], [0.0, 9.81, 0.0]]
    """
    free = ddphi is None
    body = machine_table(beta, e, a, r, omega1, g, m, half_span)
    given = 0.0 if ddphi is None else ddphi
    states = {"phi": phi, "dphi": dphi, "ddphi": given, "domega1": domega1}
    tails = ((2, 3), (2, 3), (2, 3), (2,), (), (), (), (2, 4))
    flags = (free, carrier)
    return BearingForces(*at_states(kernels.bearings, body, states, flags, tails, threads))


def fixed_bearing_forces(
    beta: npt.ArrayLike,
    e: npt.ArrayLike,
    a: npt.ArrayLike,
    r: npt.ArrayLike,
    omega1: npt.ArrayLike,
    m: npt.ArrayLike,
    g: npt.ArrayLike,
    rho_b1: npt.ArrayLike,
    phi: npt.ArrayLike,
    dphi: npt.ArrayLike,
    ddphi: npt.ArrayLike | None = None,
    domega1: npt.ArrayLike = 0.0,
    *,
    threads: int | None = None,
) -> FixedBearingForces:
    """Reactions of the bearings of the fixed shaft on the rotor, N, along (u01, v01, n1).

    The bearing A1 at O1 is spherical, B1 at O1 + rho_b1 n1 cylindrical. The carrier has no mass.

    A given ddphi takes a motor between carrier and disk. Forces have the axes (..., 2, 3) for A1
    and B1.

    [HedrihVeljovic2013] (8), (9), corrected.

    >>> rest = fixed_bearing_forces(0.3, 0.0, 0.0, 0.1, 0.0, 2.0, 9.81, 0.5, 0.0, 0.0)
    >>> rest.fixed_force[0].round(6).tolist()
    [0.0, 0.0, 19.62]
    """
    free = ddphi is None
    body = machine_table(beta, e, a, r, omega1, g, m)
    (place,) = floats(rho_b1=rho_b1)
    span = np.where(place == 0.0, np.nan, place)
    given = 0.0 if ddphi is None else ddphi
    states = {"phi": phi, "dphi": dphi, "ddphi": given, "domega1": domega1, "rho_b1": span}
    tails = ((2, 3), (2, 3), (2, 3))
    flags = (free,)
    return FixedBearingForces(
        *at_states(kernels.fixed_bearings, body, states, flags, tails, threads)
    )
