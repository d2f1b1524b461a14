"""States as one argument, edge states and windows of systems with a coordinate and damping."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import phasekit as pk
from phasekit.systems.rests import natural_window

EIGHT = pk.Coefficients(1.0, 0.35, 0.12)
WELL = pk.Potential("x^4/4 - x^2/2", "x", interval=(-2.0, 2.0))
DAMPED = pk.Perturbed(WELL, damping=0.2)
DRIVEN = pk.Perturbed(WELL, damping=0.2, forcing=pk.Harmonic(0.1, 1.0))
RUBBED = pk.Perturbed(WELL, damping=0.2, terms=pk.Term("-mu*dphi^3", {"mu": 0.1}))
T = [0.0, 0.7]


@pytest.mark.slow
@pytest.mark.parametrize(
    "call",
    [
        lambda s: pk.flow(s, {"x": -1.2, "dx": 0.3}, T),
        lambda s: pk.flow(s, {"phi": -1.2, "dphi": 0.3}, t=T),
        lambda s: pk.flow(s, x0={"dx": 0.3, "x": -1.2}, t=T),
        lambda s: pk.flow(s, x0=[-1.2, 0.3], t=T),
    ],
)
@pytest.mark.parametrize("system", [WELL, DAMPED, DRIVEN, RUBBED])
def test_a_state_may_be_one_argument(system, call):
    want = pk.flow(system, -1.2, 0.3, T)
    np.testing.assert_array_equal(call(system).motion_phi, want.motion_phi)


def test_others_take_it_as_well():
    start = {"x": -1.2, "dx": 0.3}
    for call in (
        lambda *a, **k: pk.lyapunov(DAMPED, *a, duration=5.0, **k).lyapunov_exponent,
        lambda *a, **k: pk.stroboscopic(DRIVEN, *a, n=2, **k).section_phi,
        lambda *a, **k: pk.poincare_section(DAMPED, *a, section=-1.0, n=1, **k).section_dphi,
    ):
        want = call(-1.2, 0.3).values
        np.testing.assert_array_equal(call(start), want)
        np.testing.assert_array_equal(call(x0=start), want)
    memory = pk.Term("u", {"k": 0.5}, states={"u": "-k*u - phi/10"}, start={"u": 0.1})
    third = pk.Perturbed(WELL, damping=0.2, terms=memory)
    whole = pk.flow(third, {"x": -1.2, "dx": 0.3, "u": 0.4}, T)
    np.testing.assert_array_equal(whole.motion_phi, pk.flow(third, [-1.2, 0.3, 0.4], T).motion_phi)
    part = pk.flow(third, start, T)
    np.testing.assert_array_equal(part.motion_phi, pk.flow(third, [-1.2, 0.3, 0.1], T).motion_phi)


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: pk.flow(DAMPED, {"x": 1.0}, T), "dphi0"),
        (lambda: pk.flow(DAMPED, {"x": 1.0, "dx": 0.0, "y": 1.0}, T), "x0"),
        (lambda: pk.flow(DAMPED, x0={"x": 1.0, "dx": 0.0}, t=T, dphi0=0.1), "wants it once"),
        (lambda: pk.edge_state(DAMPED, {"x": 1.0}, {"x": 1.0, "dx": 0.0}), "a: .*dphi"),
        (lambda: pk.edge_state(WELL, [1.0, 0.0], [-1.0, 0.0]), "or with damping"),
    ],
)
def test_what_is_wrong_is_said(call, message):
    with pytest.raises(pk.ParameterError, match=message):
        call()


@pytest.mark.slow
def test_edge_states_of_damped_systems_are_saddles():
    for system in (DAMPED, RUBBED):
        ds = pk.edge_state(system, {"x": -1.0, "dx": 0.0}, {"x": 1.0, "dx": 0.1})
        np.testing.assert_allclose([ds.edge_phi.item(), ds.edge_dphi.item()], 0.0, atol=1e-9)
        assert ds.n_unstable.item() == 1
    disk = pk.Perturbed(EIGHT, damping=0.2)
    ds = pk.edge_state(disk, [-1.0, 0.0], [1.2, 0.0])
    saddles = pk.equilibria(EIGHT).phi.sel(equilibrium=["lower_saddle", "upper_saddle"])
    assert np.abs(np.sin(ds.edge_phi.item() - saddles.values)).min() < 1e-9
    slopes = pk.equilibria(EIGHT).curvature.sel(equilibrium="lower_saddle").item()
    growth = -0.1 + np.sqrt(0.01 - slopes)
    assert ds.edge_exponent.item() == pytest.approx(growth, rel=1e-9)


@pytest.mark.slow
def test_the_edge_of_a_driven_well_is_an_unstable_orbit_of_scipys():
    ds = pk.edge_state(DRIVEN, [-1.0, 0.0], [1.0, 0.1])
    assert pk.AttractorKind(ds.edge_kind.item()) is pk.AttractorKind.CYCLE

    def rates(t, x):
        return [x[1], x[0] - x[0] ** 3 - 0.2 * x[1] + 0.1 * np.cos(t)]

    start = [ds.edge_phi.values[0], ds.edge_dphi.values[0]]
    found = solve_ivp(rates, (0, 2 * np.pi), start, "DOP853", rtol=1e-12, atol=1e-13)
    np.testing.assert_allclose(found.y[:, -1], start, atol=1e-7)  # times a multiplier of 280
    assert ds.edge_multiplier.item() > 100.0
    assert ds.n_unstable.item() == 1


def test_windows_follow_from_barriers():
    low, high = (pk.Coefficients(0.0, 4.0, 0.0), pk.Coefficients(0.0, 9.0, 0.0))
    for system, speed in ((low, 4.0), (high, 6.0)):  # of a pendulum over the top, 2 sqrt(B)
        assert natural_window(system)["dphi"] == pytest.approx(
            (-1.5 * speed, 1.5 * speed), rel=1e-4
        )
    many = pk.Perturbed(pk.Coefficients(0.0, [4.0, 9.0], 0.0), damping=0.1)
    assert natural_window(many)["dphi"] == pytest.approx((-9.0, 9.0), rel=1e-4)
    assert natural_window(DAMPED)["x"] == (-2.0, 2.0)
    assert natural_window(pk.Potential("x^4/4 - x^2/2", "x")) is None
    assert natural_window(pk.Problem("x - x^3", "x")) is None


@pytest.mark.slow
def test_manifolds_and_cycles_of_a_pendulum_need_no_window():
    # Torque over damping is the rate of a rotation: 0.6/0.2, and it comes to rest as well.
    pendulum = pk.Perturbed(pk.Coefficients(0.0, 1.0, 0.0), damping=0.2, torque=0.6)
    window = natural_window(pendulum)
    assert window["dphi"][1] == pytest.approx(1.5 * (2.0 + 3.0), rel=1e-4)
    found = pk.periodic_orbits(pendulum)
    same = pk.periodic_orbits(pendulum, window)
    assert found.n_cycles.item() == same.n_cycles.item() == 1
    t, x = found.period.item(), [0.0, found.dphi_max.item()]
    orbit = solve_ivp(
        lambda t, x: [x[1], -np.sin(x[0]) - 0.2 * x[1] + 0.6], (0, 200), [0.0, 3.0], "DOP853",
        rtol=1e-11, atol=1e-12, events=lambda t, x: np.sin(x[0] / 2.0),
    )  # fmt: skip
    assert np.diff(orbit.t_events[0])[-1] == pytest.approx(t, rel=1e-8)
    assert x[1] < window["dphi"][1]
    lines = pk.manifolds(pendulum)
    assert lines.sizes["manifold"] == 4
    assert set(pk.nullclines(pendulum).nullcline_of.values) == {"phi", "dphi"}
