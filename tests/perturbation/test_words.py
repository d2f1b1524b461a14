"""What results under a torque say of themselves, and what is refused, and why."""

import numpy as np
import pytest

import phasekit as pk

DISK = pk.GyroRotorDisk(beta=1.0, e=0.1, a=0.01, r=0.1, omega1=15.0, m=2.0)
ROTOR = pk.FreeGyroRotor(DISK, carrier_inertia=0.02)
SYSTEMS = {
    "coefficients": pk.Coefficients(1.0, 0.35, 0.12),
    "circle": pk.Potential("cos(x)", "x", period="2*pi"),
    "line": pk.Potential("x^4/4 - x^2/2", "x"),
    "rotor": ROTOR,
}


def equation(ds, name):
    return ds[name].attrs["equation"]


@pytest.mark.parametrize("name", SYSTEMS)
@pytest.mark.parametrize("damping", [0.0, 0.1])
def test_equilibria_and_energies_name_the_torque(name, damping):
    perturbed = pk.Perturbed(SYSTEMS[name], damping=damping, torque=0.1)
    standing = pk.equilibria(perturbed)
    for quantity in ("phi", "energy", "n_equilibria"):
        assert "torque" in equation(standing, quantity)
    if damping == 0.0:
        assert "torque" in equation(pk.potential(perturbed, 0.3), "potential")
        assert "torque" in equation(pk.energy(perturbed, 0.3, 1.0), "energy_integral")
        gradient = pk.sweep(perturbed, phi=[0.3], of="potential_gradient")
        assert "torque" in equation(gradient, "potential_gradient")
        speed = pk.sweep(perturbed, phi=[0.3], energy=[9.0], of="phase_velocity")
        assert "torque" in equation(speed, "phase_velocity")


def test_the_equation_of_a_rotor_is_that_of_its_energy():
    torque, phi, dphi = 0.7, 0.4, 2.0
    tilted = pk.Perturbed(ROTOR, torque=torque)
    turned = pk.energy(tilted, phi, dphi).energy_integral
    still = pk.energy(ROTOR, phi, dphi).energy_integral
    m22 = ROTOR.mass_matrix(phi)[1, 1]
    assert turned.item() == pytest.approx(still.item() - m22 * torque * phi)
    assert turned.attrs["equation"].endswith("- M22 torque phi")


@pytest.mark.parametrize("name", ["coefficients", "circle", "line"])
def test_separatrices_and_orbits_name_the_torque(name):
    perturbed = pk.Perturbed(SYSTEMS[name], torque=0.1)
    loops = pk.separatrices(perturbed)
    for quantity in ("saddle_phi", "saddle_energy", "loop", "turning_phi", "energy_per_turn"):
        text = equation(loops, quantity)
        assert ("torque" in text) != (name == "line" and quantity == "energy_per_turn")
    orbits = pk.orbits(perturbed, 0.2, 0.1)
    for quantity in ("orbit_kind", "orbit_energy", "phi_min", "phi_max"):
        assert "torque" in equation(orbits, quantity)
        assert "Delta" not in equation(orbits, quantity)


def test_what_a_turn_gains_is_told_by_its_length():
    four = pk.Perturbed(pk.Potential("cos(pi*x/2)", "x", period=4), torque=[0.0, 0.1, -0.2])
    loops, orbits = pk.separatrices(four), pk.orbits(four, 0.0, 9.0)
    assert loops.energy_per_turn.values == pytest.approx([0.0, 0.4, -0.8])
    assert orbits.gain_per_turn.values == pytest.approx([0.0, 0.4, 0.8])
    assert equation(loops, "energy_per_turn") == "4 torque"
    assert equation(orbits, "gain_per_turn") == "4 |torque|"
    line = pk.Perturbed(SYSTEMS["line"], torque=[0.0, 0.1])
    assert np.isnan(pk.separatrices(line).energy_per_turn.values).tolist() == [True, True]
    assert pk.orbits(line, 0.9, 0.0).gain_per_turn.values.tolist() == [0.0, 0.0]


@pytest.mark.parametrize("what", [pk.separatrices, lambda one: pk.orbits(one, 0.1, 0.0)])
def test_a_refusal_does_not_tell_of_closed_forms_where_there_is_more(what):
    for one in (pk.Perturbed(ROTOR, torque=0.1), pk.Perturbed(ROTOR, damping=0.1)):
        with pytest.raises(pk.ParameterError, match="wants a system without damping") as error:
            what(one)
        assert "closed form" not in str(error.value)
    with pytest.raises(pk.ParameterError, match="wants a perturbed system, pk.Perturbed"):
        pk.melnikov(SYSTEMS["line"])
    with pytest.raises(pk.ParameterError, match="wants a coordinate with a period"):
        pk.retrapping_torque(pk.Perturbed(SYSTEMS["line"], damping=0.1))


def test_states_of_a_rotor_have_its_unit_of_energy():
    for one in (ROTOR, pk.Perturbed(ROTOR, torque=0.1)):
        assert one.unit_of("state_energy") == "J"
        assert one.unit_of("time") == "s"
    assert pk.Pendulum(length=1.0).unit_of("state_energy") == "s-2"
