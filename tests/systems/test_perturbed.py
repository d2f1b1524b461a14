"""Perturbed systems: arguments, copies, maps and back, and the torque of a varying omega1."""

import copy
import pickle

import numpy as np
import pytest
import sympy as sp

import phasekit as pk
from phasekit.laws.terms import Rate
from phasekit.maps import files
from phasekit.systems.system import MODELS

DISK = pk.GyroRotorDisk(beta=0.7, e=0.05, a=0.024, r=0.2, omega1=30.0)
FULL = pk.Perturbed(
    DISK,
    damping=-0.1,
    quadratic=0.2,
    forcing=[pk.Harmonic(0.5, 2.0), pk.Harmonic([0.1, 0.2], 3.0, 0.5)],
    modulation={"omega1": pk.Harmonic(0.1, 2.0)},
    drift={"beta": 0.01},
    kT=0.1,
)


def test_all_values_are_parameters():
    names = list(FULL.parameters)
    assert names[:6] == list(DISK.parameters)
    assert names[6:10] == ["damping", "quadratic", "torque", "kT"]
    assert names[13:16] == ["forcing2_amplitude", "forcing2_frequency", "forcing2_phase"]
    assert names[-2:] == ["modulation_omega1_phase", "drift_beta"]
    units = {p.name: p.units for p in FULL.declared}
    assert units["forcing_amplitude"] == "s-2"
    assert units["modulation_omega1_amplitude"] == "s-1"
    assert units["drift_beta"] == "s-1"
    named = {p.name: p.long_name for p in FULL.declared}
    assert "driving" in named["damping"]
    assert "driving" not in named["quadratic"]
    assert "damping=-0.1 (driving)" in repr(FULL)


def test_copies():
    assert pickle.loads(pickle.dumps(FULL)) == FULL
    assert hash(pickle.loads(pickle.dumps(FULL))) == hash(FULL)
    other = FULL.replace(omega1=[1.0, 2.0], forcing2_phase=0.1, drift_beta=0.5, torque=3.0)
    assert other.system.omega1.tolist() == [1.0, 2.0]
    assert other.omega1 is None
    assert other.forcing[1].phase == 0.1
    assert (other.drift, other.torque) == ({"beta": 0.5}, 3.0)
    assert other != FULL
    assert FULL.replace(forcing=None).forcing == ()
    with pytest.raises(AttributeError):
        FULL.damping = 1.0


class Swing(pk.System):
    """A pendulum on a carousel, whose torque is a lambda in the class."""

    omega = pk.parameter("s-1", "angular velocity", default=3.0)
    frame_rate = Rate("omega", lambda v: (0.0, 0.0, -2.0 * v["omega"]))

    @staticmethod
    def products(v):
        return v["omega"] * v["omega"], 9.81, 0 * v["omega"], 1


del MODELS["Swing"]  # other tests count the systems


def test_laws_travel_to_worker_processes():
    for base in (DISK, Swing()):
        law = pk.Perturbed(base, damping=0.1, forcing=pk.Harmonic(0.5, 2.0)).law
        again = pickle.loads(pickle.dumps(law))
        assert again == law
        assert again.rate is type(base).frame_rate
        assert copy.deepcopy(law) == law
    alone = Rate("omega", abs)
    assert pickle.loads(pickle.dumps(alone)) == alone


@pytest.mark.slow
@pytest.mark.parametrize("of", ["melnikov", "equilibria"])
def test_maps_and_back(of, tmp_path):
    ds = pk.sweep(FULL, damping=[0.1, 0.2], of=of)
    assert ds.isel(damping=1).phasekit.system() == FULL.replace(damping=0.2)
    files.with_texts(ds).to_netcdf(tmp_path / "map.nc", engine="h5netcdf")
    assert pk.open_map(tmp_path / "map.nc").phasekit.system() == FULL.replace(damping=[0.1, 0.2])


def test_a_map_of_any_potential_and_back():
    well = pk.Perturbed(pk.Potential("m*x^4/4 - x^2/2", "x", {"m": 1.0}), damping=0.1)
    back = pk.sweep(well, m=[1.0, 2.0], of="capture").isel(m=0).phasekit.system()
    assert back == well


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"system": FULL}, "perturbed already"),
        ({"system": 3.0}, "system: got 3.0"),
        ({"damping": "much"}, "damping: got 'much'"),
        ({"damping": np.nan}, "damping: got nan"),
        ({"kT": -1.0}, "kT: got -1.0, wants a number >= 0"),
        ({"forcing": 0.3}, "forcing: got 0.3, wants a pk.Harmonic"),
        ({"modulation": {"m": pk.Harmonic(1.0, 1.0)}}, "'m' is unknown"),
        ({"modulation": {"beta": 0.1}}, "modulation: beta: got 0.1"),
        ({"drift": 0.1}, "drift: got 0.1, wants a mapping"),
        ({"omega1": 3.0}, "omega1: got 3.0, wants a function of time"),
        ({"omega1": ([1.0, 0.0], [1.0, 2.0])}, "times that increase"),
        ({"omega1": np.sin, "drift": {"omega1": 0.1}}, "one law"),
        ({"dampin": 0.1}, "did you mean 'damping'"),
        ({"system": pk.Potential("torque*x^2", "x", {"torque": 1.0})}, "another name"),
        (
            {
                "system": pk.FreeGyroRotor(DISK.replace(m=1.0), 0.1),
                "modulation": {"omega1": pk.Harmonic(1.0, 1.0)},
            },
            "wants nothing, of a FreeGyroRotor",
        ),
    ],
)
def test_bad_arguments(arguments, message):
    with pytest.raises(pk.ParameterError, match=message):
        pk.Perturbed(**{"system": DISK, **arguments})


def test_a_table_of_time():
    table = pk.Perturbed(DISK, omega1=([0.0, 1.0], [1.0, 2.0]))
    assert [column.tolist() for column in table.omega1] == [[0.0, 1.0], [1.0, 2.0]]
    assert pickle.loads(pickle.dumps(table)) == table
    ds = pk.sweep(table, damping=[0.1], of="equilibria")
    with pytest.raises(pk.ParameterError, match="is not stored"):
        ds.phasekit.system()


def test_the_euler_force_of_a_particle():
    """Lagrange's equation of a particle on a tilted circle with a varying omega."""
    t, R, tilt, d, n, g = sp.symbols("t R tilt d n g", positive=True)
    phi, turned = sp.Function("phi")(t), sp.Function("turned")(t)
    # along the plane's horizontal, along its horizontal normal, upwards
    along, square = d + R * sp.sin(phi), n + R * sp.cos(phi) * sp.sin(tilt)
    up = -R * sp.cos(phi) * sp.cos(tilt)
    x = along * sp.cos(turned) - square * sp.sin(turned)
    y = along * sp.sin(turned) + square * sp.cos(turned)
    L = sum(q.diff(t) ** 2 for q in (x, y, up)) / 2 - g * up
    equation = (L.diff(phi.diff(t)).diff(t) - L.diff(phi)) / R**2
    at = {"radius": 0.5, "omega": 2.0, "tilt": 0.4, "offset": 0.2, "normal_offset": 0.1, "g": 9.0}
    numbers = dict(zip((R, tilt, d, n, g), (0.5, 0.4, 0.2, 0.1, 9.0), strict=True))
    A, B, C = pk.ParticleOnCircle(**at).coefficients()
    E0, Es, Ec = pk.ParticleOnCircle.frame_rate.euler(at)
    for angle in (0.3, 2.0, -1.2):
        state = {phi.diff(t, 2): 0, turned.diff(t, 2): 0.7, turned.diff(t): 2.0, phi.diff(t): 0}
        value = equation.doit().subs(state).subs({phi: angle, turned: 0.0, **numbers})
        slope = B * np.sin(angle) - A * np.sin(angle) * np.cos(angle) - C * np.cos(angle)
        euler = 0.7 * (E0 + Es * np.sin(angle) + Ec * np.cos(angle))
        assert float(value) == pytest.approx(slope - euler, abs=1e-12)
