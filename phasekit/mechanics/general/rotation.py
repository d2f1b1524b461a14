"""A rigid body that turns about an axis which is itself carried round another one."""

from __future__ import annotations

from dataclasses import KW_ONLY, dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from phasekit.errors import ParameterError
from phasekit.inputs import bad, call_checked
from phasekit.mechanics.general.body import RigidBody
from phasekit.mechanics.general.state import CoupledRotationState
from phasekit.mechanics.vectors import (
    ROUNDING,
    Frozen,
    apply,
    common_shape,
    cross,
    directions,
    numbers,
    quiet,
    read_only,
    rotation,
    times,
    unit,
)


@dataclass(frozen=True, eq=False, repr=False)
class CoupledRotation(Frozen):
    """Rigid body with two coupled rotations about axes that do not intersect.

    The carrier turns by phi1 about n1 through the fixed point O1. It holds the shaft n2 through
    O2, about which the body turns by phi2. O1 and O2 are the feet of the common perpendicular of
    the axes, ``O1O2 = r0 = a [n1, n2]/|[n1, n2]|``. Both rotations are right-handed.

    Parameters
    ----------
    body : RigidBody
        The body at ``phi1 = phi2 = 0``, in the fixed frame, with O2 as its pole.
    n1, n2 : array_like
        Directions of the axes at ``phi1 = phi2 = 0``, of any length, shape (..., 3); not parallel.
    a : float or array_like
        Distance between the axes in m, of either sign, shape (...).

    Raises
    ------
    ParameterError
        If a single value is unusable, or the axes of a single one are parallel. In a batch such
        members become NaN.

    Notes
    -----
    [HedrihVeljovic2011] section 3 and Figure 1; r0 is (3.1). Body, axes and distances broadcast.

    Examples
    --------
    A disk that turns freely on its shaft; the bearings stand 0.2 m from O2 on both sides:

    >>> from phasekit import RigidBody
    >>> from phasekit import CoupledRotation
    >>> disk = RigidBody.disk(m=2.0, r=0.1, e=0.02, beta=0.3)
    >>> machine = CoupledRotation(disk, n1=(0, 0, 1), n2=(1, 0, 0), a=0.05)
    >>> weight = (0.0, 0.0, -2.0 * 9.80665)
    >>> motion = {"omega1": 10.0, "phi2": 0.5, "omega2": 3.0}
    >>> domega2 = machine.at(**motion).free_acceleration(weight)
    >>> state = machine.at(**motion, domega2=domega2)
    >>> bearings = state.self_bearings(weight, 0.2, -0.2)
    >>> (bearings.F_A2 + bearings.F_B2 - state.linear_momentum_rate + weight).round(12).tolist()
    [0.0, 0.0, 0.0]
    """

    body: RigidBody
    _: KW_ONLY
    n1: Any
    n2: Any
    a: Any

    def __post_init__(self) -> None:
        """Check the values and keep them, the directions as unit vectors."""
        if not isinstance(self.body, RigidBody):
            raise ParameterError(
                f"body: got an object of type {type(self.body).__name__}, wants a RigidBody"
            )
        n1, n2 = directions("n1", self.n1), directions("n2", self.n2)
        a = numbers("a", self.a, "a finite number in m, or an array of them")
        common_shape(body=self.body.shape, n1=n1.shape[:-1], n2=n2.shape[:-1], a=a.shape)
        apart = np.isfinite(unit(cross(n1, n2), ROUNDING)).all(axis=-1)
        if apart.ndim == 0 and not apart:
            raise bad("n2", self.n2, f"a direction that is not parallel to n1 = {n1.tolist()}")
        for name, value in (("n1", n1), ("n2", n2), ("a", a)):
            object.__setattr__(self, name, read_only(value) if value.ndim else float(value))

    @property
    def shape(self) -> tuple[int, ...]:
        """Shape of the batch of bodies, axes and distances; () for a single machine."""
        shapes = self.body.shape, self.n1.shape[:-1], self.n2.shape[:-1], np.shape(self.a)
        return np.broadcast_shapes(*shapes)

    @quiet
    def at(
        self,
        phi1: npt.ArrayLike = 0.0,
        omega1: npt.ArrayLike = 0.0,
        domega1: npt.ArrayLike = 0.0,
        phi2: npt.ArrayLike = 0.0,
        omega2: npt.ArrayLike = 0.0,
        domega2: npt.ArrayLike = 0.0,
    ) -> CoupledRotationState:
        """Return the mechanics at one state of motion, or at a batch of them.

        Parameters
        ----------
        phi1, phi2 : float or array_like
            Angles in rad.
        omega1, omega2 : float or array_like
            Angular velocities in rad/s, the rates of phi1 and phi2.
        domega1, domega2 : float or array_like
            Angular accelerations in rad/s^2. That of a body which turns freely about its shaft:
            `CoupledRotationState.free_acceleration`.

        Returns
        -------
        CoupledRotationState
            Of the shape of states and machines together.

        Raises
        ------
        ParameterError
            If a scalar is not a finite number, or the shapes do not broadcast, with each other and
            with the batch of machines.

        Examples
        --------
        >>> body = RigidBody.from_points([2.0], [[0.0, 0.0, -0.1]])
        >>> machine = CoupledRotation(body, n1=(0, 0, 1), n2=(1, 0, 0), a=0.5)
        >>> machine.at(omega1=3.0).linear_momentum.tolist()
        [-3.0, 0.0, 0.0]
        """
        given = {
            "phi1": phi1,
            "omega1": omega1,
            "domega1": domega1,
            "phi2": phi2,
            "omega2": omega2,
            "domega2": domega2,
        }
        kept = {name: numbers(name, value) for name, value in given.items()}
        shape = common_shape(machine=self.shape, **{name: x.shape for name, x in kept.items()})
        motion = {name: np.broadcast_to(x, shape)[()] for name, x in kept.items()}
        n1, n2 = (np.broadcast_to(n, (*shape, 3)) for n in (self.n1, self.n2))
        carrier = rotation(n1, motion["phi1"])
        arm = times(self.a, unit(cross(n1, n2), ROUNDING))
        return CoupledRotationState(
            body=self.body.rotated(carrier @ rotation(n2, motion["phi2"])),
            n1=n1,
            n2=read_only(apply(carrier, n2)),
            r0=read_only(apply(carrier, arm)),
            **{name: x for name, x in motion.items() if name not in ("phi1", "phi2")},
        )

    def __repr__(self) -> str:
        """Write the axes of a single machine, the shape of a batch."""
        if self.shape:
            return f"CoupledRotation({self.body!r}, <batch of shape {self.shape}>)"
        n1, n2 = ("[" + ", ".join(f"{x + 0.0:.6g}" for x in n) + "]" for n in (self.n1, self.n2))
        return f"CoupledRotation({self.body!r}, n1={n1}, n2={n2}, a={self.a:.6g})"


_init = CoupledRotation.__init__
CoupledRotation.__init__ = call_checked(_init, "CoupledRotation")  # type: ignore[method-assign]
