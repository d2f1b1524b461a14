"""State of a body with two coupled rotations: rotators, bearing reactions and torques."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, NamedTuple, TypeAlias

import numpy as np
import numpy.typing as npt

from phasekit.arrays import Array
from phasekit.docstrings import explained
from phasekit.inputs import bad
from phasekit.mechanics.general.momentum import CoupledMomentum
from phasekit.mechanics.vectors import (
    ROUNDING,
    Numbers,
    apply,
    common_shape,
    cross,
    dot,
    numbers,
    quiet,
    times,
    unit,
    vectors,
)

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

    >>> float(lead_rate(2.0, 4.0, 0.0))
    2.0
    """
    size = domega * domega + omega**4
    size = np.where(size > 0.0, size, np.nan)
    return np.asarray(omega * (2.0 * domega * domega - omega * ddomega) / size)[()]


class SelfBearings(NamedTuple):
    """Forces of the bearings of the shaft n2 on the body, in N, fixed frame, (..., 3)."""

    F_A2: Array
    F_B2: Array


class FixedBearings(NamedTuple):
    """Forces of the bearings of the shaft n1 on the carrier, in N, fixed frame, (..., 3)."""

    F_A1: Array
    F_B1: Array


@explained({"G": "G : array_like\n    Weight vector in N, fixed frame, (..., 3)."})
@dataclass(frozen=True, eq=False, repr=False, kw_only=True)
class CoupledRotationState(CoupledMomentum):
    """State of motion of a `CoupledRotation`, made by `CoupledRotation.at`.

    All vectors are in the fixed frame, (..., 3). Moments of mass are about O2, the angular
    momentum and its rate about O1. The carrier is massless.

    Attributes
    ----------
    body : RigidBody
        The body where it is now, with O2 as its pole.
    n1, n2, r0 : ndarray
        Axes and the vector O1O2 in m.
    omega1, domega1, omega2, domega2 : float or ndarray
        Angular velocities and accelerations.

    Examples
    --------
    A particle of 2 kg, 0.1 m below the shaft, carried round at 3 rad/s:

    >>> from phasekit import CoupledRotation
    >>> from phasekit import RigidBody
    >>> body = RigidBody.from_points([2.0], [[0.0, 0.0, -0.1]])
    >>> machine = CoupledRotation(body, n1=(0, 0, 1), n2=(1, 0, 0), a=0.5)
    >>> state = machine.at(omega1=3.0)
    >>> state.linear_momentum_rate.tolist()
    [0.0, -9.0, 0.0]
    >>> bearings = state.self_bearings((0, 0, -20), 0.2, -0.2)
    >>> bearings.F_A2.tolist(), round(float(state.self_torque((0, 0, -20))), 12)
    ([0.0, -4.5, 10.0], -0.9)
    >>> round(float(state.free_acceleration((0, 0, -20))), 12)  # a omega1^2/0.1 m
    45.0
    >>> state.fixed_bearings((0, 0, -20), 0.25).F_B1.round(12).tolist()
    [0.0, -36.4, 0.0]
    >>> machine.at(domega1=2.0).drive_torque((0, 0, -20)).item(), state.power((0, 0, -20)).item()
    (1.0, 0.0)
    >>> state.rotators["R01"].tolist(), state.angular_velocities()["R01"].item()
    ([0.0, -9.0, 0.0], 3.0)
    """

    @property
    @quiet
    def rotators(self) -> dict[str, Array]:
        """Rotators by their names R01 R011 R022 R012 R1 R2 R12 R12c, in s^-2.

        For a base vector b across the axis n: ``R = domega u + omega^2 [n, u]``, ``u = b/|b|``,
        with ``b = [n1, r0]`` (R01), S_n1 (R011), D_n1 (R1), all about n1, and S_n2 (R022), D_n2
        (R2), about n2. The coupled ones are ``2 omega1 omega2 u`` with ``b = [n1, S_n2]`` (R012),
        ``[n1, J_n2]`` (R12) and the coupling vector (R12c), the one that the rate of angular
        momentum holds. [HedrihVeljovic2011] (4.1), (4.5), (4.6), (4.10).

        A rotator is NaN where its base vector is zero. As zero counts also a base vector that
        is not longer than 32 roundings (7e-15) of the body's size: of ``trace(I)`` for those of
        second order, of ``sqrt(M trace(I))`` for those of S; of ``[n1, r0]`` only an exact zero.
        """
        spin, found = 2.0 * self.omega1 * self.omega2, {}
        for name, (base, floor) in rotator_bases(self).items():
            u, axis = unit(base, floor), AXES.get(name)
            found[name] = times(spin, u) if axis is None else self._rotated(axis, u)
        return found

    @property
    @quiet
    def intensities(self) -> dict[str, Array]:
        """Lengths of the rotators in s^-2, NaN where they are undefined.

        ``sqrt(domega^2 + omega^4)`` or ``2 |omega1 omega2|``; [HedrihVeljovic2011] (4.2), (4.7).
        """
        size = {
            1: np.hypot(self.domega1, self.omega1**2),
            2: np.hypot(self.domega2, self.omega2**2),
            None: 2.0 * np.abs(self.omega1 * self.omega2),
        }
        found = {}
        for name, (base, floor) in rotator_bases(self).items():
            defined = np.isfinite(unit(base, floor)).all(axis=-1)
            found[name] = np.where(defined, size[AXES.get(name)], np.nan)[()]
        return found

    @quiet
    def angular_velocities(
        self, ddomega1: npt.ArrayLike = 0.0, ddomega2: npt.ArrayLike = 0.0
    ) -> dict[str, Array]:
        """Angular velocities of the rotators by their names, in rad/s.

        Those of R01, R011, R1, R012 and R12, which lie across n1, are about n1 and absolute.
        Those of R022, R2 and R12c, which lie across n2, are about n2 and relative to the carrier.
        Each is that of the base vector and, if it is not a coupled one, the rate of the angle
        ``gamma = atan2(omega^2, domega)`` from the base vector to the rotator,
        ``omega (2 domega^2 - omega ddomega)/(domega^2 + omega^4)``
        ([HedrihVeljovic2011] (4.3), (4.8), (4.9)). NaN where a rotator is undefined or zero.

        Parameters
        ----------
        ddomega1, ddomega2 : float or array_like
            Rates of change of domega1 and domega2 in rad/s^3.

        Returns
        -------
        dict of str to ndarray
            By the names of `rotators`, shape (...).
        """
        jerks = {1: numbers("ddomega1", ddomega1), 2: numbers("ddomega2", ddomega2)}
        common_shape(state=self.shape, ddomega1=jerks[1].shape, ddomega2=jerks[2].shape)
        lead = {axis: lead_rate(*self._motion(axis), jerk) for axis, jerk in jerks.items()}
        coupled = np.where(self.omega1 * self.omega2 == 0.0, np.nan, 0.0)
        rates, found = base_rates(self), {}
        for name, (base, floor) in rotator_bases(self).items():
            axis = self.n2 if name in ("R022", "R2", "R12c") else self.n1
            u = unit(base, floor)
            own = dot(axis, cross(u, rates[name])) / dot(u, base)
            found[name] = np.asarray(own + (lead[AXES[name]] if name in AXES else coupled))[()]
        return found

    @quiet
    def self_bearings(
        self, G: npt.ArrayLike, s_A: npt.ArrayLike, s_B: npt.ArrayLike
    ) -> SelfBearings:
        """Forces of the bearings of the shaft n2 on the body, in N.

        The bearing A2, at ``s_A n2`` from O2, is spherical; B2, at ``s_B n2``, holds no force
        along n2. A body that turns freely about n2 has the acceleration `free_acceleration`; with
        any other a couple `self_torque` acts as well. With ``G = (0, 0, 0)``: the kinetic parts.

        Parameters
        ----------
        s_A, s_B : float or array_like
            Positions on the shaft in m, of either sign.

        Returns
        -------
        SelfBearings
            F_A2 and F_B2, each (..., 3).

        Raises
        ------
        ParameterError
            If a single value is unusable or the two positions are equal. In arrays: NaN.

        Notes
        -----
        ``F = dK/dt - G``, ``M = M_O2 - [rho_C, G]``; the bearings hold F and the part of M across
        n2 ([HedrihVeljovic2013] (19)-(21)).
        """
        s_A, s_B = numbers("s_A", s_A), numbers("s_B", s_B)
        force, moment = self._loads(G, s_A=s_A.shape, s_B=s_B.shape)
        if s_A.ndim == s_B.ndim == 0 and s_A == s_B:
            raise bad("s_B", s_B, f"a position that differs from s_A = {s_A}")
        across = cross(self.n2, cross(force, self.n2))
        span = np.where(s_A == s_B, np.nan, s_A - s_B)
        at_B = times(s_A / span, across) - times(1.0 / span, cross(moment, self.n2))
        return SelfBearings(force - at_B, at_B)

    @quiet
    def fixed_bearings(self, G: npt.ArrayLike, rho_B1: npt.ArrayLike) -> FixedBearings:
        """Forces of the bearings of the shaft n1 on the carrier, in N.

        The bearing A1, at O1, is spherical; B1, at ``rho_B1 n1`` from it, holds no force along
        n1. The drive gives the couple `drive_torque`.

        Parameters
        ----------
        rho_B1 : float or array_like
            Position of B1 in m, of either sign, not zero.

        Returns
        -------
        FixedBearings
            F_A1 and F_B1, each (..., 3).

        Raises
        ------
        ParameterError
            If a single value is unusable or a single rho_B1 zero. In arrays: NaN.

        Notes
        -----
        ``F_B1 = [W, n1]/rho_B1`` with ``W = dL_O1/dt - [r_C, G]``, ``F_A1 = dK/dt - G - F_B1``
        ([HedrihVeljovic2013] (8), (9)).
        """
        position = numbers("rho_B1", rho_B1)
        if position.ndim == 0 and position == 0.0:
            raise bad("rho_B1", rho_B1, "a number that is not zero, in m")
        force, moment = self._loads(G, rho_B1=position.shape)
        about_O1 = cross(self.r0, force) + moment
        at_B = times(1.0 / np.where(position == 0.0, np.nan, position), cross(about_O1, self.n1))
        return FixedBearings(force - at_B, at_B)

    @quiet
    def drive_torque(self, G: npt.ArrayLike) -> Numbers:
        """Couple about n1 with which the drive keeps the motion of phi1, in N m.

        ``(n1, dL_O1/dt - [r_C, G])``.
        """
        force, moment = self._loads(G)
        return dot(self.n1, cross(self.r0, force) + moment)

    @quiet
    def power(self, G: npt.ArrayLike) -> Numbers:
        """Power ``omega1 (n1, W)`` of the drive, in W.

        Where the body turns freely about n2, the rate of kinetic and potential energy together.
        """
        return np.asarray(self.omega1 * self.drive_torque(G))[()]

    @quiet
    def self_torque(self, G: npt.ArrayLike) -> Numbers:
        """Couple ``Q2 = (n2, M_O2 - [rho_C, G])`` from the carrier on the body about n2, in N m.

        What keeps the motion of phi2; zero in free motion.
        """
        return dot(self.n2, self._loads(G)[1])

    @quiet
    def free_acceleration(self, G: npt.ArrayLike, torque: npt.ArrayLike = 0.0) -> Numbers:
        """Acceleration domega2 of a body that turns freely about n2, in rad/s^2.

        From ``(n2, M_O2 - [rho_C, G]) = torque``, whatever domega2 of the state is. NaN where the
        body has no moment of inertia about n2, up to 32 roundings of its size.

        Parameters
        ----------
        torque : float or array_like
            Couple about n2 from the carrier on the body in N m, a motor's or a brake's.
        """
        torque = numbers("torque", torque)
        moment = self._loads(G, torque=torque.shape)[1] - times(self.domega2, self.inertia_moment_2)
        axial = self.body.axial_moment(self.n2)
        floor = 2.0 * ROUNDING * self.body.polar_moment()
        return (torque - dot(self.n2, moment)) / np.where(axial > floor, axial, np.nan)[()]

    def __repr__(self) -> str:
        """Write the motion of a single state, the shape of a batch."""
        if self.shape:
            return f"CoupledRotationState(<batch of shape {self.shape}>)"
        names = ("omega1", "domega1", "omega2", "domega2")
        motion = ", ".join(f"{name}={getattr(self, name):.6g}" for name in names)
        return f"CoupledRotationState({motion})"

    def _loads(self, G: npt.ArrayLike, **shapes: tuple[int, ...]) -> tuple[Array, Array]:
        """Force and moment about O2 that the supports give."""
        weight = vectors("G", G, "a weight vector of three finite numbers in N, (..., 3)")
        common_shape(state=self.shape, G=weight.shape[:-1], **shapes)
        moment = self.moment_about_O2 - cross(self.rho_C, weight)
        return self.linear_momentum_rate - weight, moment
