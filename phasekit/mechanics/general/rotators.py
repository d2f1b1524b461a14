"""Base vectors of the rotators of a body with two coupled rotations, and how they turn."""

from __future__ import annotations

from typing import Any, TypeAlias

import numpy as np

from phasekit.mechanics.vectors import ROUNDING, Array, apply, cross, times

#: The rotation that a rotator belongs to; the coupled ones (R012, R12, R12c) belong to both.
AXES = {"R01": 1, "R011": 1, "R022": 2, "R1": 1, "R2": 2}


#: A body in coupled rotation, `phasekit.mechanics.general.state.CoupledRotationState`, which
#: stands above.
State: TypeAlias = Any


def rotator_bases(state: State) -> dict[str, tuple[Array, Array]]:
    """Base vectors by the rotators' names, and the lengths up to which they count as zero."""
    trace = 2.0 * state.body.polar_moment()
    second = ROUNDING * trace
    first = ROUNDING * np.sqrt(np.maximum(state.body.mass * trace, 0.0))
    n1, S_2 = state.n1, state.linear_moment_2
    return {
        "R01": (cross(n1, state.r0), np.zeros(state.shape)),
        "R011": (state.linear_moment_1, first),
        "R022": (S_2, first),
        "R012": (cross(n1, S_2), first),
        "R1": (state.deviation_moment_1, second),
        "R2": (state.deviation_moment_2, second),
        "R12": (cross(n1, state.inertia_moment_2), second),
        "R12c": (state.coupling_vector, second),
    }


def base_rates(state: State) -> dict[str, Array]:
    """Rates of change of the base vectors; of R022, R2 and R12c relative to the carrier.

    The parts along the axis that a rotator is perpendicular to are of no account.
    """
    body, n1, n2, omega = state.body, state.n1, state.n2, state.angular_velocity
    spin = times(state.omega2, n2)  # of the body relative to the carrier
    mixed = cross(n1, n2)
    first, second = body.inertia_moment_rate(n1, spin), body.inertia_moment_rate(n2, spin)
    third = cross(spin, apply(body.inertia, mixed)) - apply(body.inertia, cross(spin, mixed))
    return {
        "R01": times(state.omega1, cross(n1, cross(n1, state.r0))),
        "R011": body.linear_moment_rate(n1, omega),
        "R022": cross(spin, state.linear_moment_2),
        "R012": cross(n1, cross(omega, state.linear_moment_2)),
        "R1": body.inertia_moment_rate(n1, omega),
        "R2": cross(spin, state.deviation_moment_2),
        "R12": cross(n1, cross(omega, state.inertia_moment_2)),
        "R12c": cross(n1, second) + cross(n2, first) + third,
    }


def lead_rate(omega: Array, domega: Array, ddomega: Array) -> Array:
    """Rate of the angle atan2(omega^2, domega) between base vector and rotator; NaN at rest.

    [HedrihVeljovic2011] (4.9).

    Examples
    --------
    >>> float(lead_rate(2.0, 4.0, 0.0))
    2.0
    """
    size = domega * domega + omega**4
    size = np.where(size > 0.0, size, np.nan)
    return np.asarray(omega * (2.0 * domega * domega - omega * ddomega) / size)[()]
