"""The mechanism in MuJoCo: two hinges and a thin disk, built from a description in MJCF.

MuJoCo knows bodies, joints and spatial algebra, and none of the formulas of this project. The
support stands at O1 with its hinge along z (n1); the disk hangs on it at O2 by a hinge along x
(n2) at the distance a along y (v01 = [n1, n2]), with the inertia tensor at its own mass center.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np
import pytest

mujoco = pytest.importorskip("mujoco", reason="MuJoCo is an extra: pip install phasekit[mujoco]")

MJCF = """
<mujoco>
  <compiler angle="radian"/>
  <option gravity="0 0 {gravity!r}"><flag contact="disable" constraint="disable"/></option>
  <worldbody>
    <body name="support">
      <joint name="n1" type="hinge" axis="0 0 1"/>
      <inertial pos="0 0 0" mass="{support_mass!r}" diaginertia="{Jc!r} {Jc!r} {Jc!r}"/>
      <body name="disk" pos="0 {a!r} 0">
        <joint name="n2" type="hinge" axis="1 0 0"/>
        <inertial pos="{center}" mass="{m!r}" axisangle="0 1 0 {beta!r}"
          diaginertia="{J!r} {J!r} {J!r}"/>
      </body>
    </body>
  </worldbody>
</mujoco>
"""

SUPPORT_MASS = 1e-3


@dataclass
class Driven:
    """Reactions on a machine that is driven, in the world's frame; wrenches as (force, moment)."""

    on_disk: tuple[np.ndarray, np.ndarray]  # by the support, at O2
    on_support: tuple[np.ndarray, np.ndarray]  # by the ground, at O1, of the disk alone
    drive_torque: float  # about n1, of the disk alone
    shaft_torque: float  # about n2
    carrier: np.ndarray  # rows u01 = n2, v01, n1
    disk: np.ndarray  # rows u2, v2, n2


@dataclass
class Mechanism:
    """One machine; angles in rad, everything else in SI units."""

    beta: float
    e: float
    a: float
    r: float
    m: float
    g: float
    carrier_inertia: float
    model: Any = field(init=False, repr=False)

    def __post_init__(self) -> None:  # noqa: D105
        # At phi = 0 the diameter through the center points along n2 and down, and the normal of the
        # disk is z turned about y by beta.
        center = self.e * np.array([np.cos(self.beta), 0.0, -np.sin(self.beta)])
        J = self.m * self.r**2 / 4
        text = MJCF.format(
            gravity=-float(self.g),
            support_mass=SUPPORT_MASS,
            Jc=float(self.carrier_inertia),
            a=float(self.a),
            center=" ".join(repr(float(x)) for x in center),
            m=float(self.m),
            beta=float(self.beta),
            J=float(J),
        )
        self.model = mujoco.MjModel.from_xml_string(text)
        # The compiler refuses the inertia of a lamina, whose largest moment is the sum of the
        # others, for its rounding; the model takes it.
        self.model.body_inertia[self.model.body("disk").id] = J, J, 2 * J

    def at(self, phi1, phi, omega1, dphi) -> Any:
        data = mujoco.MjData(self.model)
        data.qpos[:] = phi1, phi
        data.qvel[:] = omega1, dphi
        return data

    def accelerations(self, phi1, phi, omega1, dphi, torque1=0.0, torque2=0.0) -> np.ndarray:
        """Return omega1' and phi'' under torques."""
        data = self.at(phi1, phi, omega1, dphi)
        data.qfrc_applied[:] = torque1, torque2
        mujoco.mj_forward(self.model, data)
        return data.qacc.copy()

    def mass_matrix(self, phi) -> np.ndarray:
        data = self.at(0.0, phi, 0.0, 0.0)
        mujoco.mj_forward(self.model, data)
        columns = np.empty((2, 2))
        for column, unit in zip(columns, np.eye(2), strict=True):
            mujoco.mj_mulM(self.model, data, column, unit)
        return columns.T

    def driven(self, phi1, phi, omega1, dphi, domega1, ddphi) -> Driven:
        """Return what acts on the machine in a motion, by inverse dynamics."""
        data = self.at(phi1, phi, omega1, dphi)
        data.qacc[:] = domega1, ddphi
        mujoco.mj_inverse(self.model, data)
        mujoco.mj_rnePostConstraint(self.model, data)
        support, disk = (self.model.body(name).id for name in ("support", "disk"))
        origin = data.xpos[support]  # O1
        hanging = np.array([0.0, 0.0, SUPPORT_MASS * self.g])  # what carries the support itself
        turning = np.array([0.0, 0.0, self.carrier_inertia * domega1])  # what turns it
        force, moment = self._wrench(data, support, origin)
        to_world = data.xmat[support].reshape(3, 3)  # columns are the support's axes
        n2, v01, n1 = to_world.T
        own = data.xmat[disk].reshape(3, 3)
        u2 = own[:, 1]  # along y at phi = 0, where v02 is
        return Driven(
            on_disk=self._wrench(data, disk, data.xpos[disk]),
            on_support=(force - hanging, moment - turning),
            drive_torque=float(data.qfrc_inverse[0] - turning[2]),
            shaft_torque=float(data.qfrc_inverse[1]),
            carrier=np.array([n2, v01, n1]),
            disk=np.array([u2, np.cross(n2, u2), n2]),
        )

    def _wrench(self, data, body, point) -> tuple[np.ndarray, np.ndarray]:
        """Force and moment about a point that the parent exerts on a body."""
        moment, force = data.cfrc_int[body, :3].copy(), data.cfrc_int[body, 3:].copy()
        pole = data.subtree_com[self.model.body_rootid[body]]
        return force, moment + np.cross(pole - point, force)
