"""One coordinate with an inertia M(x), stated by a class of one's own."""

import pickle

import numpy as np
import pytest
import xarray as xr
from scipy.integrate import solve_ivp

import phasekit as pk
from phasekit.systems.system import MODELS


class Slider(pk.System):
    """A pendulum whose pivot slides along a rail, at rest as a whole."""

    g = pk.parameter("s-2", "gravity over length", positive=True)
    share = pk.parameter("1", "mass of the bob over both masses", low=0.0, high=0.9)
    coordinate = pk.angle("theta")
    potential = "-g*cos(theta)"
    inertia = "1 - share*cos(theta)^2"


class Carried(pk.System):
    """The disk on a free support, at its momentum."""

    p = pk.parameter("kg m2 s-1", "momentum about the vertical")
    rest = pk.parameter("kg m2", "part of M11 that does not move")
    tilt = pk.parameter("kg m2", "part of M11 that goes with the square of the cosine")
    m = pk.parameter("kg", "mass")
    a = pk.parameter("m", "distance of the shaft")
    offset = pk.parameter("m", "distance of the center of mass from the shaft")
    Jn = pk.parameter("kg m2", "inertia about the shaft")
    Jvn = pk.parameter("kg m2", "deviation")
    weight = pk.parameter("J", "weight times offset")
    coordinate = pk.angle("phi")
    potential = "-weight*cos(phi) + p^2/2/(rest + tilt*cos(phi)^2 + m*(a + offset*sin(phi))^2)"
    inertia = "Jn - (Jvn*cos(phi))^2/(rest + tilt*cos(phi)^2 + m*(a + offset*sin(phi))^2)"


OWN = [MODELS.pop(kind.__name__) for kind in (Slider, Carried)]
SLIDER = Slider(g=9.0, share=0.6)


@pytest.fixture(autouse=True)
def registered(monkeypatch):
    """The classes are known by their names here, and not to other tests."""
    for kind in OWN:
        monkeypatch.setitem(MODELS, kind.__name__, kind)


def followed(t, state, damping=0.0, torque=0.0, **keywords):
    """The motion by SciPy, of Lagrange's equation."""

    def rates(t, y):
        x, v = y
        push = torque - damping * v - 9.0 * np.sin(x) - 0.3 * np.sin(2.0 * x) * v**2
        return [v, push / (1.0 - 0.6 * np.cos(x) ** 2)]

    return solve_ivp(
        rates, (0.0, t[-1]), state, method="DOP853", rtol=1e-13, atol=1e-13, t_eval=t, **keywords
    )


def test_motions_are_those_of_lagranges_equation():
    times = [0.0, 0.4, 1.1, 3.0]
    found = pk.flow(SLIDER, 1.0, 0.5, times)
    wanted = followed(times, [1.0, 0.5])
    np.testing.assert_allclose(found.motion_phi, wanted.y[0], atol=1e-9)
    np.testing.assert_allclose(found.motion_dphi, wanted.y[1], atol=1e-9)
    pushed = pk.Perturbed(SLIDER, damping=0.2, torque=1.5)
    found = pk.flow(pushed, 1.0, 0.5, times)
    wanted = followed(times, [1.0, 0.5], damping=0.2, torque=1.5)
    np.testing.assert_allclose(found.motion_phi, wanted.y[0], atol=1e-9)


def test_periods_and_actions_are_those_of_an_integration():
    orbit = pk.orbits(SLIDER, 1.0, 0.5)
    turning = followed(
        np.linspace(0.0, 6.0, 2001), [1.0, 0.5], events=lambda t, y: y[1], dense_output=True
    )
    first, _, third = turning.t_events[0][:3]
    assert orbit.period.item() == pytest.approx(third - first, rel=1e-12)
    t, step = np.linspace(first, third, 4001, retstep=True)
    x, v = turning.sol(t)
    momentum = (1.0 - 0.6 * np.cos(x) ** 2) * v
    action = np.sum((momentum * v)[:-1]) * step / (2.0 * np.pi)
    assert orbit.action.item() == pytest.approx(action, rel=1e-10)
    assert float(abs(orbit.action_error)) < 1e-12


def test_equilibria_are_those_of_the_potential_and_rates_those_with_the_inertia():
    ds = pk.equilibria(SLIDER)
    np.testing.assert_allclose(ds.phi, [0.0, np.pi], atol=1e-15)
    assert ds.natural_frequency[0].item() == pytest.approx(np.sqrt(9.0 / 0.4), rel=1e-14)
    assert ds.exponent[1].item() == pytest.approx(np.sqrt(9.0 / 0.4), rel=1e-14)
    assert ds.natural_frequency.attrs["equation"] == "sqrt(V''/M)"
    assert "M = " in ds.phi.attrs["source"]
    pushed = pk.equilibria(pk.Perturbed(SLIDER, damping=0.1, torque=3.0))
    np.testing.assert_allclose(pushed.phi, [np.arcsin(1 / 3), np.pi - np.arcsin(1 / 3)], rtol=1e-14)
    branch = pk.branches(SLIDER, "share", (0.1, 0.8))
    assert branch.sizes["branch"] == 2

    class Bent(pk.System):
        b = pk.parameter("s-2", "second harmonic")
        coordinate = pk.angle("q")
        potential = "-cos(q) + b*cos(2*q)"
        inertia = "1 + cos(q)^2/2"

    MODELS.pop("Bent")
    places = pk.critical(Bent(b=1.0), "b", (0.1, 1.0)).critical_fold.values
    np.testing.assert_allclose(places, [0.25], rtol=1e-9)  # V'' = 1 - 4 b at q = 0


@pytest.mark.slow
def test_small_oscillations_do_not_ask_in_which_coordinate_they_are_written():
    class Written(pk.System):
        g = pk.parameter("s-2", "gravity over length")
        coordinate = pk.angle("q")
        potential = "-g*cos(q + sin(q)/2 + sin(2*q + 1)/8)"
        inertia = "(1 + cos(q)/2 + cos(2*q + 1)/4)^2"

    MODELS.pop("Written")
    g, excess = np.array([9.0, np.nan]), np.array([0.0, 1e-3, 0.4])
    found = pk.near_center(Written(g=g), xr.DataArray(excess, dims="excess"))
    wanted = 2.0 * np.pi / np.sqrt(g) * (1.0 + excess[:, None] / (8.0 * g))  # the pendulum's
    assert found.near_center_period.dims == ("g", "excess", "equilibrium")
    kinds = pk.equilibria(Written(g=g)).kind.isel(g=0)
    (center,) = np.flatnonzero(kinds == pk.EquilibriumKind.CENTER)
    period = found.near_center_period.isel(equilibrium=center).transpose("excess", "g")
    np.testing.assert_allclose(period, wanted, rtol=1e-12)
    assert kinds.size == 2
    assert found.near_center_frequency.isel(equilibrium=1 - center).isnull().all()


def test_melnikovs_mean_is_the_work_of_damping_along_the_separatrix():
    found = pk.melnikov(pk.Perturbed(SLIDER, damping=0.01)).melnikov_mean.values.ravel()
    x = np.linspace(-np.pi, np.pi, 200_001)
    speed = np.sqrt(2.0 * 9.0 * (1.0 + np.cos(x)) / (1.0 - 0.6 * np.cos(x) ** 2))
    work = 0.01 * np.sum(0.5 * (speed[1:] + speed[:-1])) * (x[1] - x[0])
    np.testing.assert_allclose(np.abs(found), work, rtol=1e-8)


def test_the_rotor_at_its_momentum_is_such_a_system():
    disk = pk.GyroRotorDisk(beta=1.0, e=0.1, a=0.01, r=0.1, omega1=15.0, m=2.0)
    rotor = pk.FreeGyroRotor(disk, 0.02)
    law = rotor.amended(rotor.angular_momentum(0.0, 0.0)).law
    own = Carried(p=law.p, **{name: float(x) for name, x in law.machine._asdict().items()})
    for function, names in (
        (pk.equilibria, ("phi", "kind", "energy", "curvature", "natural_frequency", "exponent")),
        (pk.separatrices, ("saddle_exponent", "winding_area", "lobe_area", "turning_phi", "loop")),
    ):
        found, wanted = function(own), function(rotor)
        for name in names:
            np.testing.assert_allclose(found[name], wanted[name], rtol=1e-11, atol=1e-14)
    found, wanted = (pk.orbits(system, 1.0, [2.0, 3.0, 30.0]) for system in (own, rotor))
    for name in ("period", "action", "orbit_energy", "orbit_kind"):
        np.testing.assert_allclose(found[name], wanted[name], rtol=1e-12)
    found, wanted = (pk.near_center(system, 0.1) for system in (own, rotor))
    np.testing.assert_allclose(found.near_center_period, wanted.near_center_period, rtol=1e-11)
    assert wanted.state_excess.attrs["units"] == "J"
    found, wanted = (pk.action_angle(system, 1.0, 3.0) for system in (own, rotor))
    np.testing.assert_allclose(found.angle, wanted.angle, rtol=1e-11)


def test_it_goes_where_systems_go():
    many = SLIDER.replace(share=[0.1, 0.6])
    ds = pk.sweep(many, of=("equilibria", "separatrices"))
    one = pk.separatrices(SLIDER)
    assert ds.winding_area.values[1].item() == one.winding_area.item()
    assert ds.isel(share=1).phasekit.system() == SLIDER
    assert pickle.loads(pickle.dumps(SLIDER)) == SLIDER
    section = pk.poincare_section(SLIDER, 1.0, 0.5, section="dtheta", n=2)
    assert section.sizes["crossing"] == 2
    assert pk.plot.phase_portrait(SLIDER).lines
    with pytest.raises(pk.ParameterError, match="wants values for steady_rotations of Slider"):
        pk.sweep(many, of="support_speed")


def test_an_inertia_is_positive_everywhere():
    class Loose(pk.System):
        k = pk.parameter("1", "depth")
        coordinate = pk.angle("q")
        potential = "-cos(q)"
        inertia = "1 - k*cos(q)^2"

    MODELS.pop("Loose")
    with pytest.raises(pk.ParameterError, match=r"inertia: got .* = -1 at q = 0, wants one > 0"):
        Loose(k=2.0)
    periods = pk.orbits(Loose(k=[0.5, 2.0]), 1.0, 0.0).period.values
    assert np.isfinite(periods).tolist() == [True, False]
    found = pk.equilibria(Loose(k=[0.5, 2.0]))
    assert found.n_equilibria.values.tolist() == [2, -1]
    assert np.isnan(found.phi.values[1]).all()
