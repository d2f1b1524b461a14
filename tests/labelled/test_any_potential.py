"""Action, angle and families of orbits in any potential, against the closed forms."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import phasekit as pk

TEXT = "-B*cos(q) + A/2*cos(q)**2 - C*sin(q)"
WELL = pk.Potential("x^4/4 - x^2/2 + h*x", "x", {"h": 0.1})


def as_potential(A, B, C):
    return pk.Potential(TEXT, "q", {"A": A, "B": B, "C": C}, period=2 * np.pi)


@pytest.mark.slow
@pytest.mark.parametrize("system", [(2.0, 1.0, 0.3), (-1.5, 0.4, 0.2)])
def test_action_and_angle_are_those_of_the_closed_form(system):
    rng = np.random.default_rng(3)
    phi, dphi = rng.uniform(-3.0, 3.0, 12), 1.5 * rng.standard_normal(12)
    wanted = pk.action_angle(pk.Coefficients(*system), phi, dphi)
    found = pk.action_angle(as_potential(*system), phi, dphi)
    assert len(np.unique(wanted.orbit_family)) > 2
    off = np.angle(np.exp(1j * (found.angle - wanted.angle).values))
    np.testing.assert_allclose(off, 0.0, atol=1e-12)
    assert (np.abs(off) <= found.angle_error + 1e-14).all()
    np.testing.assert_allclose(found.action, wanted.action, rtol=1e-13)
    np.testing.assert_allclose(found.frequency, wanted.frequency, rtol=1e-13)
    assert "twist" not in found
    both = set(zip(wanted.orbit_family.values, found.orbit_family.values, strict=True))
    assert len(both) == len(np.unique(wanted.orbit_family)) == len(np.unique(found.orbit_family))


@pytest.mark.slow
def test_the_angle_grows_evenly():
    """The angle of where an integrator goes, after a time."""
    start = pk.action_angle(WELL, 0.9, [0.4, -1.2])
    for k, dx in enumerate((0.4, -1.2)):
        end = solve_ivp(
            lambda t, y: (y[1], y[0] - y[0] ** 3 - 0.1), (0, 2.0), [0.9, dx], rtol=1e-11, atol=1e-12
        ).y[:, -1]
        later = pk.action_angle(WELL, *end)
        grown = start.angle[k] + 2.0 * start.frequency[k] - later.angle
        assert abs(np.angle(np.exp(1j * grown.item()))) < 1e-8


@pytest.mark.slow
def test_angles_at_the_ends():
    right = pk.orbits(WELL, 0.9, 0.4).phi_max.item()
    left = pk.orbits(WELL, 0.9, 0.4).phi_min.item()
    centers = pk.equilibria(WELL).phi.values
    found = pk.action_angle(WELL, [right, left, centers[0], centers[1]], 0.0)
    assert abs(np.sin(found.angle.values[0])) < 1e-7
    assert found.angle.values[1] == pytest.approx(np.pi, abs=1e-7)
    assert found.angle.values[2] == 0.0
    assert found.action.values[2] == 0.0
    assert np.isnan(found.angle.values[3])


def test_families_are_those_of_the_closed_form():
    system = (2.0, 1.0, 0.3)
    found = pk.orbit_families(as_potential(*system), 11)
    wanted = pk.orbit_families(pk.Coefficients(*system), 11)
    assert found.family.values.tolist() == ["well_3", "well_1", "wells_1_3", "rotation"]
    np.testing.assert_allclose(found.energy_level, wanted.energy_level, rtol=1e-12)
    np.testing.assert_allclose(found.period, wanted.period, rtol=1e-9)
    np.testing.assert_allclose(found.action, wanted.action, rtol=1e-12)
    assert found.period.dims == wanted.period.dims
    assert (found.period_error < 1e-6).all()


@pytest.mark.slow
def test_families_of_a_double_well():
    ds = pk.orbit_families(WELL, 9)
    assert ds.family.values.tolist() == ["well_0", "well_2", "wells_0_2"]
    energy = pk.equilibria(WELL).energy.values
    limits = {"well_0": (0, 1), "well_2": (2, 1)}
    for family, (low, high) in limits.items():
        levels = ds.energy_level.sel(family=family)
        assert energy[low] < levels.min() < levels.max() < energy[high]
    outer = ds.sel(family="wells_0_2")
    assert outer.energy_level.min() > energy[1]
    # d(energy)/d(action) = frequency, which no orbit is computed from.
    fine = pk.orbit_families(WELL, 400)
    for family in fine.family.values:
        one = fine.sel(family=family).isel(level=slice(40, 360))
        slope = np.gradient(one.energy_level.values, one.action.values)[5:-5]
        np.testing.assert_allclose(slope, one.frequency.values[5:-5], rtol=2e-3)


@pytest.mark.parametrize(
    ("text", "keywords", "families"),
    [
        ("x^2", {"energy_max": 3.0}, ["well_0"]),
        ("x^2/2 - x^3/3", {}, ["well_0"]),
        ("x^6/6 - 5*x^4/4 + 2*x^2", {}, ["well_2", "well_0", "well_4", "wells_0_2_4"]),
        ("x^6/6 - 5*x^4/4 + 2*x^2 + x/9", {}, ["well_0", "well_2", "well_4"]),
    ],
)
def test_which_families_there_are(text, keywords, families):
    found = pk.orbit_families(pk.Potential(text, "x"), 5, **keywords)
    assert set(families) <= set(found.family.values.tolist())
    assert np.isfinite(found.period).all()


def test_families_that_cannot_be():
    with pytest.raises(pk.ParameterError, match="energy_max: .* wants the largest energy"):
        pk.orbit_families(pk.Potential("x^2", "x"))
    with pytest.raises(pk.ParameterError, match="wants a system with a center"):
        pk.orbit_families(pk.Potential("-x^2", "x"))
    with pytest.raises(pk.ParameterError, match="wants a single system"):
        pk.orbit_families(pk.Potential("a*x^2", "x", {"a": [1.0, 2.0]}))
    with pytest.raises(pk.ParameterError, match=r"energy_max: got 4.9, wants an energy below"):
        pk.orbit_families(pk.Potential("x^2 + 5", "x"), energy_max=4.9)


def test_results_have_the_coordinate_by_its_own_name():
    eq = pk.equilibria(WELL)
    np.testing.assert_array_equal(eq.x, eq.phi)
    assert eq.x.dims == ("equilibrium",)
    assert eq.sel(equilibrium=0).x.item() == eq.phi.values[0]
    orbit = pk.orbits(WELL, x=[0.9, 1.0], dx=0.1)
    for name in ("phi_min", "phi_max", "state_phi", "state_dphi"):
        np.testing.assert_array_equal(orbit[name.replace("phi", "x")], orbit[name])
    motion = pk.flow(WELL, 0.9, 0.1, [0.0, 1.0])
    np.testing.assert_array_equal(motion.motion_dx, motion.motion_dphi)
    np.testing.assert_array_equal(pk.separatrices(WELL).saddle_x, [eq.phi.values[1]])
    ds = pk.sweep(WELL, h=[0.0, 0.1])
    np.testing.assert_array_equal(ds.x, ds.phi)
    assert ds.isel(h=1).phasekit.system() == WELL
    named = pk.equilibria(pk.Potential("phi^4/4 - phi^2/2", "phi"))
    assert set(named.coords) == {"equilibrium"}
