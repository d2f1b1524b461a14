"""Mass moment vectors of a rigid body for an axis through its pole, and their rates of change."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

from phasekit.arrays import Array
from phasekit.docstrings import explained
from phasekit.mechanics.vectors import (
    Frozen,
    Numbers,
    Vectors,
    apply,
    common_shape,
    cross,
    directions,
    dot,
    quiet,
    times,
    vectors,
)

#: What the arguments of all methods are.
WORDS = {
    "n": "n : array_like\n    Direction of the axis, of any length, shape (..., 3).",
    "angular_velocity, axis_velocity": """angular_velocity, axis_velocity : array_like
    Angular velocities of the body and of the axis, vectors (..., 3) in rad/s; by default the axis
    keeps its direction.""",
}


@explained(WORDS)
class MassMoments(Frozen):
    """Mass moments of what has a mass, a center and an inertia at a pole."""

    mass: Any
    center: Any
    inertia: Any

    @property
    def shape(self) -> tuple[int, ...]:
        """Shape of the batch; () for a single body."""
        return np.shape(self.mass)

    @quiet
    def linear_moment(self, n: npt.ArrayLike) -> Vectors:
        """Linear mass moment vector ``S_n = M [n, rho_C]`` in kg m.

        [HedrihVeljovic2011] (2.1); perpendicular to n and to the vector to the center.

        Examples
        --------
        >>> import phasekit as pk
        >>> pk.RigidBody.from_points([2.0], [[3.0, 0.0, 0.0]]).linear_moment([0, 0, 1]).tolist()
        [0.0, 6.0, 0.0]
        """
        return times(self.mass, cross(self._axis(n), self.center))

    @quiet
    def inertia_moment(self, n: npt.ArrayLike) -> Vectors:
        """Mass inertia moment vector ``J_n = sum m [rho, [n, rho]]`` in kg m^2.

        The inertia tensor applied to n; [HedrihVeljovic2011] (2.2).

        Examples
        --------
        >>> import phasekit as pk
        >>> pk.RigidBody.from_points([2.0], [[3.0, 0.0, 1.0]]).inertia_moment([0, 0, 1]).tolist()
        [-6.0, 0.0, 18.0]
        """
        return apply(self.inertia, self._axis(n))

    @quiet
    def deviation_moment(self, n: npt.ArrayLike) -> Vectors:
        """Deviation moment vector ``D_n = [n, [J_n, n]]``, the part of J_n across n, in kg m^2.

        [HedrihVeljovic2011] (2.5), (2.6); it is zero for principal axes.

        Examples
        --------
        >>> import phasekit as pk
        >>> pk.RigidBody.from_points([2.0], [[3.0, 0.0, 1.0]]).deviation_moment([0, 0, 1]).tolist()
        [-6.0, 0.0, 0.0]
        """
        n = self._axis(n)
        return cross(n, cross(apply(self.inertia, n), n))

    @quiet
    def axial_moment(self, n: npt.ArrayLike) -> Numbers:
        """Moment of inertia ``(n, J_n)`` about the axis, in kg m^2.

        Examples
        --------
        >>> import phasekit as pk
        >>> float(pk.RigidBody.from_points([2.0], [[3.0, 0.0, 1.0]]).axial_moment([0, 0, 1]))
        18.0
        """
        n = self._axis(n)
        return dot(n, apply(self.inertia, n))

    @quiet
    def polar_moment(self) -> Numbers:
        """Polar moment ``J_O = sum m rho^2`` of the pole, half the trace of the tensor, in kg m^2.

        Examples
        --------
        >>> import phasekit as pk
        >>> float(pk.RigidBody.from_points([2.0], [[3.0, 0.0, 1.0]]).polar_moment())
        20.0
        """
        return np.asarray(0.5 * np.trace(self.inertia, axis1=-2, axis2=-1))[()]

    @quiet
    def spherical_moment(self, n: npt.ArrayLike) -> Vectors:
        """Spherical part ``(2/3) J_O n`` of the inertia moment vector, in kg m^2.

        Examples
        --------
        >>> import phasekit as pk
        >>> pk.RigidBody.from_points([3.0], [[2.0, 0.0, 0.0]]).spherical_moment([0, 0, 1]).tolist()
        [0.0, 0.0, 8.0]
        """
        return times(self.polar_moment() / 1.5, self._axis(n))

    @quiet
    def deviatoric_moment(self, n: npt.ArrayLike) -> Vectors:
        """Deviatoric part ``J_n - (2/3) J_O n`` of the inertia moment vector, in kg m^2.

        Examples
        --------
        >>> import phasekit as pk
        >>> pk.RigidBody.from_points([3.0], [[2.0, 0.0, 0.0]]).deviatoric_moment([0, 0, 1]).tolist()
        [0.0, 0.0, 4.0]
        """
        return self.inertia_moment(n) - self.spherical_moment(n)

    @quiet
    def linear_moment_rate(
        self,
        n: npt.ArrayLike,
        angular_velocity: npt.ArrayLike,
        axis_velocity: npt.ArrayLike = (0.0, 0.0, 0.0),
    ) -> Vectors:
        """Rate of change of S_n while the body turns about the pole, in kg m/s.

        ``dS_n/dt = [omega, S_n] + M [[Omega - omega, n], rho_C]``, with ``omega`` of the body and
        ``Omega`` of the axis ([HedrihVeljovic2011] section 3, where ``Omega = omega1 n1``).

        Examples
        --------
        >>> import phasekit as pk
        >>> body = pk.RigidBody.from_points([2.0], [[3.0, 0.0, 0.0]])
        >>> body.linear_moment_rate([0, 0, 1], [0, 0, 5]).tolist()
        [-30.0, 0.0, 0.0]
        """
        n, turning, slip = self._turning(n, angular_velocity, axis_velocity)
        first = cross(turning, cross(n, self.center)) + cross(slip, self.center)
        return times(self.mass, first)

    @quiet
    def inertia_moment_rate(
        self,
        n: npt.ArrayLike,
        angular_velocity: npt.ArrayLike,
        axis_velocity: npt.ArrayLike = (0.0, 0.0, 0.0),
    ) -> Vectors:
        """Rate of change of J_n while the body turns about the pole, in kg m^2/s.

        ``dJ_n/dt = [omega, J_n] + I [Omega - omega, n]``, I being the inertia tensor.

        Examples
        --------
        >>> import phasekit as pk
        >>> body = pk.RigidBody.from_points([2.0], [[3.0, 0.0, 1.0]])
        >>> body.inertia_moment_rate([0, 0, 1], [0, 0, 5]).tolist()
        [0.0, -30.0, 0.0]
        """
        n, turning, slip = self._turning(n, angular_velocity, axis_velocity)
        return cross(turning, apply(self.inertia, n)) + apply(self.inertia, slip)

    @quiet
    def deviation_moment_rate(
        self,
        n: npt.ArrayLike,
        angular_velocity: npt.ArrayLike,
        axis_velocity: npt.ArrayLike = (0.0, 0.0, 0.0),
    ) -> Vectors:
        """Rate of change of D_n while the body turns about the pole, in kg m^2/s.

        That of ``D_n = J_n - n (n, J_n)``.

        Examples
        --------
        >>> import phasekit as pk
        >>> body = pk.RigidBody.from_points([2.0], [[3.0, 0.0, 1.0]])
        >>> body.deviation_moment_rate([0, 0, 1], [0, 0, 5]).tolist()
        [0.0, -30.0, 0.0]
        """
        rate = self.inertia_moment_rate(n, angular_velocity, axis_velocity)
        axis, moment = self._axis(n), self.inertia_moment(n)
        turning = cross(vectors("axis_velocity", axis_velocity), axis)
        along = dot(turning, moment) + dot(axis, rate)
        return rate - times(dot(axis, moment), turning) - times(along, axis)

    def _axis(self, n: npt.ArrayLike) -> Array:
        """Unit vectors along n, of a batch that goes with the body's."""
        along = directions("n", n)
        common_shape(body=self.shape, n=along.shape[:-1])
        return along

    def _turning(
        self, n: npt.ArrayLike, angular_velocity: npt.ArrayLike, axis_velocity: npt.ArrayLike
    ) -> tuple[Array, Array, Array]:
        """Direction of an axis, angular velocity, and the axis's velocity relative to the body."""
        n = self._axis(n)
        omega = vectors("angular_velocity", angular_velocity)
        axis = vectors("axis_velocity", axis_velocity)
        common_shape(
            body=self.shape,
            n=n.shape[:-1],
            angular_velocity=omega.shape[:-1],
            axis_velocity=axis.shape[:-1],
        )
        return n, omega, cross(axis - omega, n)
