"""Mass moments, momentum and energy of a body with two coupled rotations, and their rates."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from phasekit.arrays import Array
from phasekit.mechanics.general.body import RigidBody
from phasekit.mechanics.vectors import Frozen, apply, cross, dot, quiet, times


@dataclass(frozen=True, eq=False, repr=False, kw_only=True)
class CoupledMomentum(Frozen):
    """Momentum of a body with its pole O2, by its axes and their angular velocities."""

    body: RigidBody
    n1: Any
    n2: Any
    r0: Any
    omega1: Any
    domega1: Any
    omega2: Any
    domega2: Any

    @property
    def shape(self) -> tuple[int, ...]:
        """Shape of the batch; () for a single state."""
        return np.shape(self.omega1)

    @property
    @quiet
    def rho_C(self) -> Array:
        """Vector from O2 to the mass center, in m."""
        return np.asarray(self.body.center)

    @property
    @quiet
    def angular_velocity(self) -> Array:
        """Angular velocity ``omega1 n1 + omega2 n2`` of the body, in rad/s."""
        return times(self.omega1, self.n1) + times(self.omega2, self.n2)

    @property
    @quiet
    def linear_moment_1(self) -> Array:
        """Linear mass moment vector S_n1 in kg m."""
        return self.body.linear_moment(self.n1)

    @property
    @quiet
    def linear_moment_2(self) -> Array:
        """Linear mass moment vector S_n2 in kg m."""
        return self.body.linear_moment(self.n2)

    @property
    @quiet
    def inertia_moment_1(self) -> Array:
        """Mass inertia moment vector J_n1 in kg m^2."""
        return self.body.inertia_moment(self.n1)

    @property
    @quiet
    def inertia_moment_2(self) -> Array:
        """Mass inertia moment vector J_n2 in kg m^2."""
        return self.body.inertia_moment(self.n2)

    @property
    @quiet
    def deviation_moment_1(self) -> Array:
        """Deviation moment vector D_n1 in kg m^2."""
        return self.body.deviation_moment(self.n1)

    @property
    @quiet
    def deviation_moment_2(self) -> Array:
        """Deviation moment vector D_n2 in kg m^2."""
        return self.body.deviation_moment(self.n2)

    @property
    @quiet
    def coupling_vector(self) -> Array:
        """Coupling vector ``C12 = [n1, J_n2] + [n2, J_n1] + I [n1, n2]`` in kg m^2.

        ``omega1 omega2 C12`` is the coupled part of the rate of angular momentum
        ([Veljovic2015] (5), where N12 = C12/2). It is perpendicular to n2.
        """
        mixed = apply(self.body.inertia, cross(self.n1, self.n2))
        first, second = self.inertia_moment_1, self.inertia_moment_2
        return cross(self.n1, second) + cross(self.n2, first) + mixed

    @property
    @quiet
    def linear_momentum(self) -> Array:
        """Linear momentum ``K = omega1 [n1, r0] M + omega1 S_n1 + omega2 S_n2`` in kg m/s.

        [HedrihVeljovic2011] (3.2).
        """
        swept = cross(self.angular_velocity, self.rho_C)
        return times(self.body.mass, self._pole_velocity + swept)

    @property
    @quiet
    def angular_momentum(self) -> Array:
        """Angular momentum about O1 in kg m^2/s.

        ``[r0, K] + omega1 M [rho_C, [n1, r0]] + omega1 J_n1 + omega2 J_n2``, which is
        [HedrihVeljovic2011] (3.3).
        """
        own = times(self.body.mass, cross(self.rho_C, self._pole_velocity))
        turning = apply(self.body.inertia, self.angular_velocity)
        return cross(self.r0, self.linear_momentum) + own + turning

    @property
    @quiet
    def linear_momentum_rate(self) -> Array:
        """Rate of change dK/dt of the linear momentum in N.

        ``M |r0| R01 + |S_n1| R011 + |S_n2| R022 + |[n1, S_n2]| R012``
        ([HedrihVeljovic2011] (3.4), (3.5), with the rotators of section 4).
        """
        first, second = self.linear_moment_1, self.linear_moment_2
        return (
            times(self.body.mass, self._pole_acceleration)
            + self._rotated(1, first)
            + self._rotated(2, second)
            + times(2.0 * self.omega1 * self.omega2, cross(self.n1, second))
        )

    @property
    @quiet
    def angular_momentum_rate(self) -> Array:
        """Rate of change ``dL_O1/dt = [r0, dK/dt] + M_O2`` of the angular momentum in N m.

        [Veljovic2015] (5) gives it with rotators.
        """
        return cross(self.r0, self.linear_momentum_rate) + self.moment_about_O2

    @property
    @quiet
    def moment_about_O2(self) -> Array:
        """Moment ``M_O2 = sum [rho, m d^2r/dt^2]`` of the inertial accelerations, in N m.

        ``M |r0| [rho_C, R01] + domega1 J_n1 + omega1^2 [n1, J_n1] + domega2 J_n2 +
        omega2^2 [n2, J_n2] + omega1 omega2 C12``.
        """
        return (
            times(self.body.mass, cross(self.rho_C, self._pole_acceleration))
            + self._rotated(1, self.inertia_moment_1)
            + self._rotated(2, self.inertia_moment_2)
            + times(self.omega1 * self.omega2, self.coupling_vector)
        )

    @property
    @quiet
    def kinetic_energy(self) -> Array:
        """Kinetic energy of the body in J."""
        omega, velocity = self.angular_velocity, self._pole_velocity
        coupled = dot(velocity, 0.5 * velocity + cross(omega, self.rho_C))
        turning = dot(omega, apply(self.body.inertia, omega))
        return np.asarray(self.body.mass * coupled + 0.5 * turning)[()]

    @property
    @quiet
    def kinetic_energy_rate(self) -> Array:
        """Rate of change of the kinetic energy in W, ``(v_O2, dK/dt) + (omega, M_O2)``."""
        through_pole = dot(self._pole_velocity, self.linear_momentum_rate)
        return through_pole + dot(self.angular_velocity, self.moment_about_O2)

    @property
    def _pole_velocity(self) -> Array:
        return times(self.omega1, cross(self.n1, self.r0))

    @property
    def _pole_acceleration(self) -> Array:
        return self._rotated(1, cross(self.n1, self.r0))

    def _motion(self, axis: int) -> tuple[Any, Any]:
        """Angular velocity and acceleration about an axis."""
        return (self.omega1, self.domega1) if axis == 1 else (self.omega2, self.domega2)

    def _rotated(self, axis: int, x: Array) -> Array:
        """``domega x + omega^2 [n, x]`` about an axis."""
        omega, domega = self._motion(axis)
        n = self.n1 if axis == 1 else self.n2
        return times(domega, x) + times(omega * omega, cross(n, x))
