"""Against MuJoCo: accelerations, bearing reactions, wrenches and drive torque in random states.

MuJoCo gets bodies and hinges only (`mujoco_mechanism`), so nothing is shared but the geometry.
"""

from __future__ import annotations

import numpy as np
import pytest
from witnesses.mujoco_mechanism import Mechanism  # skips this module where MuJoCo is missing

import phasekit as pk
from phasekit.mechanics import two_degrees as machines
from phasekit.mechanics.general.body import RigidBody
from phasekit.mechanics.general.rotation import CoupledRotation
from phasekit.mechanics.two_degrees import mass_matrix, two_degrees

PRECISION = 1e-12
STATES = 40


def mechanisms(seed: int):
    """Draw disks of all skew angles, with both signs of a, and states of motion."""
    rng = np.random.default_rng(seed)
    special = [0.0, np.pi / 4, np.pi / 2, np.pi]
    for beta in [*special, *rng.uniform(0, np.pi, STATES - len(special))]:
        e, r = 10 ** rng.uniform(-2, 0, 2)
        disk = pk.GyroRotorDisk(
            beta=beta,
            e=e * rng.choice([0, 1, 1, 1]),
            a=rng.normal() * rng.choice([0, 1, 1]),
            r=r,
            omega1=rng.normal() * 10,
            m=rng.uniform(0.5, 5),
            g=rng.choice([9.80665, 1.6, -9.80665, 0.0]),
            half_span=10 ** rng.uniform(-1, 0),
        )
        inertia = 10 ** rng.uniform(-3, 1)
        parts = {name: getattr(disk, name) for name in ("beta", "e", "a", "r", "m", "g")}
        state = rng.normal(size=4) * [2, 2, 8, 20]  # phi1, phi, dphi, domega1
        yield Mechanism(**parts, carrier_inertia=inertia), disk, inertia, *map(float, state)


def test_free_machine():
    rng = np.random.default_rng(1)
    for mechanism, disk, inertia, phi1, phi, dphi, _ in mechanisms(2):
        rotor = pk.FreeGyroRotor(disk, inertia)
        mass = rotor.mass_matrix(phi)
        assert np.abs(mass - mechanism.mass_matrix(phi)).max() <= PRECISION * mass.max()
        for torque1, torque2 in ((0.0, 0.0), rng.normal(size=2) * 10):
            want = mechanism.accelerations(phi1, phi, disk.omega1, dphi, torque1, torque2)
            got = rotor.accelerations(phi, dphi, torque1=torque1, torque2=torque2)
            # as torques: differences of these terms
            terms = mass.max() * (disk.omega1**2 + dphi**2) + disk.m * abs(disk.g) * disk.e
            terms += abs(torque1) + abs(torque2)
            assert np.abs(mass @ (np.array(got) - want)).max() <= PRECISION * terms, disk


def test_a_motion_of_the_free_machine():
    """Energy and momentum of a simulated motion, its accelerations again in MuJoCo."""
    mechanism, disk, inertia, phi1, phi, dphi, _ = list(mechanisms(5))[20]
    motion = pk.FreeGyroRotor(disk, inertia).simulate(
        phi, dphi, np.linspace(0, 2, 21), phi1=phi1, torque1=0.3, torque2=-0.1
    )
    for _, at in motion.groupby("time"):
        state = [at[f"motion_{name}"].item() for name in ("phi1", "phi", "omega1", "dphi")]
        want = mechanism.accelerations(*state, 0.3, -0.1)
        got = at.domega1.item(), at.ddphi.item()
        assert np.allclose(got, want, rtol=0, atol=1e-11 * np.abs(want).max())


def driven_cases(seed: int):
    """Yield driven machines with constant and with varying omega1, the disk turning freely."""
    for mechanism, disk, inertia, phi1, phi, dphi, domega1 in mechanisms(seed):
        body = two_degrees(disk.beta, disk.e, disk.a, disk.r, disk.m, inertia, disk.g)
        mass = mass_matrix(body, phi)
        for rate in (0.0, domega1):
            # phi'' of the free shaft: its equation in MuJoCo, solved for phi''
            at_rest = mechanism.driven(phi1, phi, disk.omega1, dphi, rate, 0.0).shaft_torque
            ddphi = -at_rest / mass[1, 1]
            want = mechanism.driven(phi1, phi, disk.omega1, dphi, rate, ddphi)
            yield disk, phi1, phi, dphi, rate, ddphi, want


def bearings(want, disk):
    """Split the wrench at O2 into forces at O2 +- half_span n2; B2 takes no axial force."""
    force, moment = want.on_disk
    n2 = want.disk[2]
    axial = n2 * (n2 @ force)
    couple = np.cross(moment, n2) / (2 * disk.half_span)
    return np.array([axial + (force - axial) / 2 + couple, (force - axial) / 2 - couple])


def sizes(want, disk):
    """Size of the forces and of the moments, of which others are differences."""
    force = np.abs(want.on_disk[0]).max() + disk.m * abs(disk.g)
    force += np.abs(want.on_disk[1]).max() / disk.half_span
    moment = np.abs(want.on_support[1]).max() + np.abs(want.on_disk[1]).max()
    return force, moment + abs(disk.a) * force


def test_the_inverse_dynamics_of_mujoco_agree_with_its_forward_dynamics():
    for mechanism, disk, _, phi1, phi, dphi, _ in mechanisms(3):
        omega1 = disk.omega1
        domega1, ddphi = mechanism.accelerations(phi1, phi, omega1, dphi)
        free = mechanism.driven(phi1, phi, omega1, dphi, float(domega1), float(ddphi))
        size = sizes(free, disk)[1] + mechanism.carrier_inertia * abs(domega1)
        assert abs(free.drive_torque + mechanism.carrier_inertia * domega1) <= PRECISION * size
        assert abs(free.shaft_torque) <= PRECISION * size
        # axes: n1 up, (n2, v01, n1) and (u2, v2, n2) right-handed, phi from the lowest place
        for axes in (free.carrier, free.disk):
            assert np.allclose(np.cross(axes[0], axes[1]), axes[2], atol=1e-14)
        assert np.allclose(free.carrier[2], [0, 0, 1])
        down = -free.disk[1] @ free.carrier.T  # radial, to the center
        assert np.allclose(down, [0, np.sin(phi), -np.cos(phi)], atol=1e-14)


def test_free_acceleration_on_a_driven_support():
    for disk, _, phi, _, rate, ddphi, _ in driven_cases(4):
        machine = two_degrees(disk.beta, disk.e, disk.a, disk.r, disk.m, 1.0, disk.g)
        _, m12, _, m22 = mass_matrix(machine, phi).ravel()
        slope = machines.support_inertia(machine, phi)[1]
        terms = m22 * disk.omega1**2 + abs(m12 * rate) + disk.m * abs(disk.g) * disk.e
        terms += disk.m * abs(disk.a) * disk.e * disk.omega1**2
        # the equation of phi alone, omega1' being given
        right = slope * disk.omega1**2 / 2 - machine.weight * np.sin(phi) - m12 * rate
        assert abs(m22 * ddphi - right) <= PRECISION * terms
        if rate == 0.0:
            gradient = pk.gradient(disk, phi).potential_gradient.item()
            assert abs(m22 * (ddphi + gradient)) <= PRECISION * terms


@pytest.mark.slow
def test_coupled_rotation():
    """The general body with general axes, in the world's frame."""
    for disk, phi1, phi, dphi, rate, ddphi, want in driven_cases(6):
        body = RigidBody.disk(m=disk.m, r=disk.r, e=disk.e, beta=disk.beta)
        machine = CoupledRotation(body, n1=(0, 0, 1), n2=(1, 0, 0), a=disk.a)
        weight = (0.0, 0.0, -disk.m * disk.g)
        motion = {"phi1": phi1, "omega1": disk.omega1, "domega1": rate, "phi2": phi}
        state = machine.at(**motion, omega2=dphi, domega2=ddphi)
        force, moment = sizes(want, disk)
        got = state.self_bearings(weight, disk.half_span, -disk.half_span)
        assert np.abs(np.array(got) - bearings(want, disk)).max() <= PRECISION * force
        assert abs(state.drive_torque(weight) - want.drive_torque) <= PRECISION * moment
        assert abs(state.self_torque(weight)) <= PRECISION * moment
        ground = state.linear_momentum_rate - weight
        assert np.abs(ground - want.on_support[0]).max() <= PRECISION * force
        arm = state.r0 + state.rho_C
        about_O1 = state.angular_momentum_rate - np.cross(arm, weight)
        assert np.abs(about_O1 - want.on_support[1]).max() <= PRECISION * moment
        free = state.free_acceleration(weight)
        assert abs(free - ddphi) * disk.inertia().Jn <= PRECISION * moment


@pytest.mark.slow
def test_bearing_forces_of_the_disk():
    for disk, _, phi, dphi, rate, ddphi, want in driven_cases(7):
        force, moment = sizes(want, disk)
        for given in (ddphi, None):
            acceleration = {} if given is None else {"ddphi": given}
            options = {**acceleration, "domega1": rate}
            got = pk.bearing_forces(disk, phi, dphi, **options)
            for frame, axes in (("disk", want.disk), ("carrier", want.carrier)):
                framed = pk.bearing_forces(disk, phi, dphi, **options, frame=frame).force.values
                error = np.abs(framed - bearings(want, disk) @ axes.T).max()
                assert error <= PRECISION * force, (frame, disk)
            assert abs(got.drive_torque.item() - want.drive_torque) <= PRECISION * moment
            assert abs(got.force_axial.item() - bearings(want, disk)[0] @ want.disk[2]) <= (
                PRECISION * force
            )


@pytest.mark.slow
def test_fixed_bearing_forces_of_the_disk():
    """A1 at O1 takes the axial force, B1 at rho_b1 n1 none; the drive the moment about n1."""
    for disk, _, phi, dphi, rate, ddphi, want in driven_cases(8):
        rho_b1 = -0.3
        ground, about_O1 = want.on_support
        at_B1 = np.cross(about_O1, want.carrier[2]) / rho_b1
        forces = np.array([ground - at_B1, at_B1]) @ want.carrier.T
        size = sum(sizes(want, disk)) / abs(rho_b1)
        got = pk.fixed_bearing_forces(disk, phi, dphi, rho_b1=rho_b1, ddphi=ddphi, domega1=rate)
        assert np.abs(got.fixed_force.values - forces).max() <= PRECISION * size
