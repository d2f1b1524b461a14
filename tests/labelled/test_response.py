"""Damped and driven systems, continued: response curves, rotations, and what is refused."""

from __future__ import annotations

import warnings
from fractions import Fraction

import numpy as np
import pytest
import xarray as xr
from scipy.integrate import solve_ivp
from scipy.special import ellipk

import phasekit as pk
from phasekit.systems.as_equations import ratios_of
from phasekit.systems.problem import as_problem

DUFFING = pk.Perturbed(
    pk.Potential("x**2/2 + x**4/4", "x"), damping=0.04, forcing=pk.Harmonic(0.015, 0.9)
)
PENDULUM = pk.Pendulum(length=1.0, g=1.0)


@pytest.fixture(scope="module")
def response():
    orbit = pk.periodic_orbit(DUFFING, [0.0, 0.0])
    return pk.continuation(DUFFING, "forcing_frequency", orbit=orbit, span=(0.8, 1.3))


def test_response_of_the_duffing_oscillator_folds_where_its_equation_says(response):
    folds = [point["forcing_frequency"] for point in response.special("LPC")]
    assert len(folds) == 2
    np.testing.assert_allclose(folds, [1.049262399236, 1.043913708797], rtol=0, atol=1e-8)
    by_hand = pk.Problem(
        ["v", "F*cos(w*t) - d*v - x - x**3"], ("x", "v"), {"d": 0.04, "F": 0.015, "w": 0.9},
        time="t", period="2*pi/w",
    )  # fmt: skip
    orbit = pk.periodic_orbit(by_hand, [0.0, 0.0])
    same = pk.continuation(by_hand, "w", orbit=orbit, span=(0.8, 1.3))
    wanted = [point["w"] for point in same.special("LPC")]
    np.testing.assert_allclose(folds, wanted, rtol=0, atol=1e-9)
    assert [stop.reason for stop in response.stops] == ["bound", "bound"]


def test_a_response_is_kept_and_read_again(response, tmp_path):
    response.save(tmp_path / "response.nc")
    again = pk.Branch.load(tmp_path / "response.nc")
    assert again.problem is not None
    assert [p.label for p in again.special_points] == [p.label for p in response.special_points]


def test_right_hand_side_is_that_of_the_equation():
    disk = pk.GyroRotorDisk(beta=1.0, e=0.01, a=0.1, r=0.1, omega1=9.0, m=2.0, half_span=0.1)
    system = pk.Perturbed(
        disk, damping=0.3, quadratic=0.2, torque=5.0,
        forcing=[pk.Harmonic(4.0, 3.0, 0.4), pk.Harmonic(2.0, 4.5, -0.7)],
    )  # fmt: skip
    problem = as_problem(system)
    assert problem.state == ("phi", "dphi")
    assert problem.forcing_period == pytest.approx(4.0 * np.pi / 3.0, rel=1e-15)
    assert dict(problem.periods) == {"phi": 2.0 * np.pi}
    A, B, C = disk.coefficients()
    for phi, v, t in ((0.3, -4.0, 0.0), (2.0, 3.0, 0.7), (-1.0, 0.0, 9.0)):
        force = A * np.sin(phi) * np.cos(phi) - B * np.sin(phi) + C * np.cos(phi)
        force += 5.0 + 4.0 * np.cos(3.0 * t + 0.4) + 2.0 * np.cos(4.5 * t - 0.7)
        force -= 0.3 * v + 0.2 * abs(v) * v
        np.testing.assert_allclose(problem([phi, v], t=t), [v, force], rtol=1e-12)


def test_quadratic_damping_has_the_orbit_that_is_integrated():
    """One period, by another integrator, comes back."""
    system = pk.Perturbed(PENDULUM, damping=0.1, quadratic=0.2, forcing=pk.Harmonic(0.5, 0.7))
    orbit = pk.periodic_orbit(system, [0.0, 0.0], settle=100.0)

    def f(t, x):
        v = x[1]
        return [v, -np.sin(x[0]) - 0.1 * v - 0.2 * abs(v) * v + 0.5 * np.cos(0.7 * t)]

    start = [orbit.phi.values[0], orbit.dphi.values[0]]
    end = solve_ivp(f, (0.0, 2.0 * np.pi / 0.7), start, "DOP853", rtol=1e-11, atol=1e-11).y[:, -1]
    np.testing.assert_allclose(end, start, atol=1e-6)
    assert np.ptp(orbit.phi.values) > 0.5


def test_rotations_under_a_torque_have_the_multiplier_of_their_damping():
    system = pk.Perturbed(PENDULUM, damping=0.1, torque=0.5)
    orbit = pk.periodic_orbit(system, [0.0, 5.0])
    family = pk.continuation(system, "torque", orbit=orbit, span=(0.2, 1.0))
    points = family.points
    assert points.sizes["point"] > 5
    assert (points.winding == 1).all()
    np.testing.assert_allclose(
        points["multiplier"].values[:, 1], np.exp(-0.1 * points.period.values), rtol=1e-9
    )


def test_without_forcing_equilibria_are_continued_to_their_fold():
    system = pk.Perturbed(PENDULUM, damping=0.1)
    branch = pk.continuation(system, "torque", x0=[0.0, 0.0], span=(0.0, 1.5))
    (fold,) = branch.special("LP")
    assert fold["torque"] == pytest.approx(1.0, abs=1e-10)
    with pytest.raises(pk.ParameterError, match="does not depend on time"):
        pk.continuation(DUFFING, "damping", span=(0.0, 1.0))


def test_harmonics_keep_their_ratio():
    assert ratios_of([0.7, 3 * 0.7, 0.35]) == [1, 3, Fraction(1, 2)]
    two = [pk.Harmonic(0.1, 0.7), pk.Harmonic(0.1, 0.7 * 2.0**0.5)]
    with pytest.raises(pk.ParameterError, match="^forcing2_frequency: got 0.98.*commensurable"):
        as_problem(pk.Perturbed(PENDULUM, forcing=two))
    with pytest.raises(pk.ParameterError, match="^forcing: got .*common period"):
        ratios_of([1.0, 1.0 / 97.0, 1.0 / 89.0])
    with pytest.raises(pk.ParameterError, match="commensurable"):
        ratios_of([1e-300, 1e300])
    with pytest.raises(pk.ParameterError, match="commensurable"):
        ratios_of([1e300, 1e-300])


@pytest.mark.parametrize(
    ("added", "message"),
    [
        ({"modulation": {"g": pk.Harmonic([0.1, 0.2], 1.0)}}, "^modulation_g_amplitude: got"),
        ({"drift": {"g": 0.1}}, "^drift: got .*wants none"),
        ({"kT": 0.1}, "^kT: got 0.1, wants 0.0"),
        ({"damping": [0.1, 0.2]}, "^damping: got .*a single number"),
        ({"forcing": pk.Harmonic(0.1, [1.0, 2.0])}, "^forcing_frequency: got .*a single number"),
    ],
)
def test_what_has_no_periodic_orbits_is_refused(added, message):
    with pytest.raises(pk.ParameterError, match=message):
        pk.periodic_orbit(pk.Perturbed(PENDULUM, **added), [0.0, 1.0])


def test_a_prescribed_speed_is_refused():
    disk = pk.GyroRotorDisk(beta=1.0, e=0.01, a=0.1, r=0.1, omega1=9.0, m=2.0, half_span=0.1)
    with pytest.raises(pk.ParameterError, match="^omega1: got"):
        pk.periodic_orbit(pk.Perturbed(disk, omega1=lambda t: 9.0 + t), [0.0, 1.0])


def resonator(Q, force, cubic):
    return pk.Problem(
        ["v", "F*cos(w*t) - x - d*v - k*x**3"], ("x", "v"),
        {"d": 1.0 / Q, "F": force, "w": 0.5, "k": cubic}, time="t", period="2*pi/w",
    )  # fmt: skip


def through(problem, low=0.5, high=3.0, **options):
    orbit = pk.periodic_orbit(problem, [0.0, 0.0])
    made = pk.ContinuationOptions(**options)
    return pk.continuation(problem, "w", orbit=orbit, span=(low, high), options=made)


@pytest.mark.parametrize("Q", [10.0, 100.0, 1e4])
def test_a_sharp_resonance_is_passed_in_few_points(Q):
    """The amplitude grows by a factor of 0.75 Q over that of the start, and comes down again."""
    branch = through(resonator(Q, 0.01, 0.0))
    w, x = branch.points.w.values, branch.points.x_max.values
    assert 30 < len(w) <= 150
    assert [stop.reason for stop in branch.stops] == ["bound", "bound"]
    np.testing.assert_allclose(x, 0.01 / np.hypot(1.0 - w**2, w / Q), rtol=2e-6)
    assert np.max(x) > 0.9 * 0.01 * Q
    assert np.all(np.diff(w) > 0.0)


@pytest.mark.parametrize("Q", [100.0, 1e4])
def test_a_response_that_leans_over_is_followed_round_both_folds(Q):
    branch = through(resonator(Q, 1.0 / Q, 1.0))
    assert branch.points.sizes["point"] <= 150
    assert [stop.reason for stop in branch.stops] == ["bound", "bound"]
    found = branch.special("LPC")
    assert len(found) == 2
    assert all(point.status == "converged" for point in found)
    if Q == 100.0:
        folds = [point["w"] for point in found]
        np.testing.assert_allclose(folds, [1.22644946, 1.03860429], rtol=0, atol=1e-8)
        assert branch.points.x_max.values.max() == pytest.approx(0.82564, abs=1e-4)
    for point in found:
        w, d = point["w"], 1.0 / Q

        def rates(t, y, w=w, d=d):
            slopes = np.array([[0.0, 1.0], [-1.0 - 3.0 * y[0] ** 2, -d]])
            force = d * np.cos(w * t) - d * y[1] - y[0] - y[0] ** 3
            return [y[1], force, *(slopes @ y[2:].reshape(2, 2)).ravel()]

        start = np.append(point.x, [1.0, 0.0, 0.0, 1.0])
        T = 2.0 * np.pi / w
        end = solve_ivp(rates, (0.0, T), start, method="DOP853", rtol=1e-12, atol=1e-13).y[:, -1]
        np.testing.assert_allclose(end[:2], point.x, rtol=0, atol=1e-9)
        # One multiplier is 1, the product of both exp(-d T).
        assert end[2] + end[5] == pytest.approx(1.0 + np.exp(-d * T), abs=1e-7)


def test_a_bound_next_to_a_fold_is_met_exactly():
    branch = through(resonator(1e3, 0.01, 1.0))  # it folds at 3.0388
    assert branch.stops[1].reason == "bound"
    assert branch.points.w.values[-1] == 3.0
    assert np.all(branch.points.n_unstable == 0)


def test_a_family_that_grows_a_thousand_times_has_the_periods_of_its_amplitudes():
    oscillator = pk.Problem(["v", "-x - k*x**3"], ("x", "v"), {"k": 1.0}, conservative=True)
    first = pk.periodic_orbit(oscillator, [1e-2, 0.0], 6.283)
    family = pk.continuation(oscillator, "period", orbit=first, span=(0.5, 6.3))
    a, T = family.points.x_max.values, family.points.period.values
    assert 40 < len(a) <= 150
    assert a.max() / a.min() > 500.0
    wanted = 4.0 * ellipk(a**2 / (2.0 * (1.0 + a**2))) / np.sqrt(1.0 + a**2)
    np.testing.assert_allclose(T, wanted, rtol=1e-7)


def test_a_family_whose_scales_grow_goes_on_as_if_it_had_never_stopped():
    problem = resonator(100.0, 0.01, 1.0)
    whole = through(problem, directions="forward")
    with pytest.warns(RuntimeWarning, match=r"not complete, last point: max_points = 40 .* w = "):
        part = through(problem, directions="forward", max_points=40)
    longer = part.extend(2000)
    xr.testing.assert_identical(longer.points, whole.points)


def test_a_branch_that_ends_for_its_number_of_points_is_announced():
    problem = pk.Problem("mu - x**2", "x", {"mu": 1.0})
    few = pk.ContinuationOptions(max_points=3)
    match = r"the branch in mu is not complete, first point: .*; last point: .* extend\(\)"
    with pytest.warns(RuntimeWarning, match=match):
        branch = pk.continuation(problem, "mu", x0=[1.0], span=(0.0, 2.0), options=few)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        pk.continuation(problem, "mu", x0=[1.0], span=(0.0, 2.0))
    assert branch.points.sizes["point"] == 7
