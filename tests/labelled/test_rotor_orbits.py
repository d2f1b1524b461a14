"""Periodic orbits of systems that conserve energy: a rotor on a free support, potentials."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.integrate import quad
from scipy.optimize import brentq

import phasekit as pk

DISK = pk.GyroRotorDisk(beta=1.0, e=0.1, a=0.05, r=0.1, omega1=6.0, m=2.0)
MACHINE = pk.FreeGyroRotor(DISK, 0.02)
MOMENTUM = float(MACHINE.angular_momentum(0.0, 0.0))


def period_of(amended, phi_max, inside):
    """The time of a swing between turning points, by quadrature of the energy integral."""
    top = amended.potential(phi_max)
    down = inside - np.linspace(0.0, 2 * np.pi, 2000)
    beyond = down[np.flatnonzero(amended.potential(down) > top)[0]]
    phi_min = brentq(lambda x: amended.potential(x) - top, beyond, inside, xtol=1e-15)
    middle, half = 0.5 * (phi_max + phi_min), 0.5 * (phi_max - phi_min)

    def part(angle):
        # phi = middle + half sin: the ends lose their singularities.
        phi = middle + half * np.sin(angle)
        gap = max(top - amended.potential(phi), 1e-300)
        speed = np.sqrt(2.0 * gap / amended.effective_inertia(phi))
        return half * np.cos(angle) / speed

    inner = np.pi / 2 - 1e-6
    value, _ = quad(part, -inner, inner, epsabs=0.0, epsrel=1e-12, limit=200)
    edges = 1e-6 * (part(inner) + part(-inner))
    return 2.0 * (value + edges)


@pytest.mark.parametrize(
    ("x0", "turns"), [([0.5, 0.0], 0), ([-1.0, 0.3], 0), ([0.0, 22.0], 1), ([0.0, -22.0], -1)]
)
def test_orbits_of_the_rotor_are_those_of_its_simulation(x0, turns):
    orbit = pk.periodic_orbit(MACHINE, x0)
    assert int(orbit.winding) == turns
    assert float(orbit.momentum) == MOMENTUM
    omega1 = MACHINE.amended(MOMENTUM).omega1(*x0)
    motion = MACHINE.simulate(*x0, [0.0, float(orbit.period)], omega1=omega1)
    end = motion.isel(time=-1)
    assert float(end.motion_phi) == pytest.approx(x0[0] + 2 * np.pi * turns, abs=1e-9)
    assert float(end.motion_dphi) == pytest.approx(x0[1], abs=1e-8)
    # No shorter time will do.
    half = MACHINE.simulate(*x0, [0.0, 0.5 * float(orbit.period)], omega1=omega1).isel(time=-1)
    apart = abs(float(half.motion_phi) - x0[0]) + abs(float(half.motion_dphi) - x0[1])
    assert apart > 0.1
    assert abs(float(orbit.unfolding)) < 1e-10


def test_swings_of_the_rotor_beside_quadratures():
    orbit = pk.periodic_orbit(MACHINE, [0.5, 0.0])
    options = pk.ContinuationOptions(max_step=0.2)
    family = pk.continuation(MACHINE, "period", orbit=orbit, span=(0.1, 1.2), options=options)
    assert [stop.reason for stop in family.stops] == ["hopf", "bound"]
    points, amended = family.points, MACHINE.amended(MOMENTUM)
    steady = amended.equilibria()
    center = int(np.flatnonzero(steady.steady_kind.values == pk.EquilibriumKind.CENTER)[0])
    rest = float(steady.steady_phi[center])
    small = 2 * np.pi / float(steady.steady_frequency[center])
    assert float(points.period[0]) == pytest.approx(small, rel=1e-5)
    assert points.sizes["point"] > 8
    assert np.max(np.abs(points.unfolding)) < 1e-9
    for point in (3, points.sizes["point"] // 2, -1):
        exact = period_of(amended, float(points.phi_max[point]), rest)
        assert float(points.period[point]) == pytest.approx(exact, rel=1e-8)
    assert points.phi_max.attrs["units"] == "rad"


def test_swings_of_one_period_over_the_momentum(tmp_path):
    orbit = pk.periodic_orbit(MACHINE, [0.5, 0.0])
    family = pk.continuation(MACHINE, "momentum", orbit=orbit, span=(0.2, 0.4), fix="period")
    assert [stop.reason for stop in family.stops] == ["bound", "bound"]
    points = family.points
    assert np.allclose(points.period, orbit.period, rtol=1e-12)
    assert np.ptp(points.momentum.values) == pytest.approx(0.2)
    assert np.max(np.abs(points.unfolding)) < 1e-9
    for point in (0, -1):
        amended = MACHINE.amended(float(points.momentum[point]))
        steady = amended.equilibria()
        center = steady.steady_kind.values == pk.EquilibriumKind.CENTER
        inside = steady.steady_phi.values[center]
        low, high = float(points.phi_min[point]), float(points.phi_max[point])
        (rest,) = inside[(inside > low) & (inside < high)]
        exact = period_of(amended, high, rest)
        assert float(points.period[point]) == pytest.approx(exact, rel=1e-8)
    family.save(tmp_path / "family.nc")
    assert pk.Branch.load(tmp_path / "family.nc").points.identical(points)


def test_steady_rotations_of_the_rotor_over_the_momentum():
    branch = pk.continuation(MACHINE, "momentum", x0=[0.2, 0.0], span=(0.0, 1.5))
    points = branch.points
    assert points.sizes["point"] > 10
    for i in range(0, points.sizes["point"], 5):
        steady = MACHINE.amended(float(points.momentum[i])).equilibria().steady_phi.values
        gaps = np.abs(np.angle(np.exp(1j * (steady - float(points.phi[i])))))
        assert np.min(gaps) < 1e-9
        assert abs(float(points.dphi[i])) < 1e-12


def test_orbits_in_a_potential():
    pendulum = pk.Pendulum(length=0.7)
    for x0, turns in (([1.0, 0.0], 0), ([0.0, 9.0], 1)):
        orbit = pk.periodic_orbit(pendulum, x0)
        assert float(orbit.period) == pytest.approx(pk.orbits(pendulum, *x0).period.item(), 1e-10)
        assert int(orbit.winding) == turns
    disk = pk.GyroRotorDisk(beta=1.0, e=0.1, a=0.05, r=0.1, omega1=9.0, m=2.0)
    orbit = pk.periodic_orbit(disk, [2.0, 0.0])
    assert float(orbit.period) == pytest.approx(pk.orbits(disk, 2.0, 0.0).period.item(), 1e-10)


@pytest.mark.parametrize(
    ("parameter", "arguments", "word"),
    [
        ("momentum", {}, "'period'"),
        ("omega1", {"fix": "period"}, "omega1"),
        (("momentum", "beta"), {"fix": "period"}, "one parameter"),
        ("unfolding", {"fix": "period"}, "one parameter"),
    ],
)
def test_bad_families_of_the_rotor(parameter, arguments, word):
    orbit = pk.periodic_orbit(MACHINE, [0.5, 0.0])
    with pytest.raises(pk.ParameterError, match=word):
        pk.continuation(MACHINE, parameter, orbit=orbit, span=(0.1, 0.4), **arguments)


def test_many_rotors_are_not_one():
    with pytest.raises(pk.ParameterError, match="momentum"):
        pk.periodic_orbit(MACHINE.replace(momentum=[0.1, 0.2]), [0.5, 0.0])
