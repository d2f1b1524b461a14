"""Motions with extreme but valid input, and what is said where a motion has no end."""

from __future__ import annotations

import functools

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import phasekit as pk
from phasekit.motion import method
from phasekit.motion.basins import _covers_turn

EIGHT = pk.Coefficients(1.0, 0.35, 0.12)
WELL = pk.Potential("x^4/4 - x^2/2", "x")
RUNAWAY = pk.Potential("-x^4/4", "x")
DRIVE = pk.Harmonic(0.3, 1.0)
GRID = {"phi": np.linspace(-2.0, 2.0, 5), "dphi": [-0.8, 0.3]}


def disk(omega1):
    return pk.GyroRotorDisk(beta=1.0, e=0.1, a=0.05, r=0.1, omega1=omega1)


@pytest.mark.parametrize("omega1", [1e-3, 1e4])
@pytest.mark.parametrize("damping", [-0.3, 1e-12, 1e3])
def test_a_disk_at_any_speed_moves_as_scipy_says(omega1, damping):
    system = disk(omega1)
    A, B, C = system.coefficients()
    unit = max(abs(A), abs(B), abs(C)) ** 0.5

    def rates(t, x):
        slope = (B - A * np.cos(x[0])) * np.sin(x[0]) - C * np.cos(x[0])
        return [x[1], -slope - damping * x[1]]

    times = np.linspace(0.0, 5.0 / unit, 4)
    expected = solve_ivp(
        rates, (0.0, times[-1]), [0.3, 0.1 * unit], "DOP853", times, rtol=1e-12, atol=1e-13 * unit
    ).y
    ds = pk.flow(pk.Perturbed(system, damping=damping), 0.3, 0.1 * unit, times)
    assert np.abs(ds.motion_phi.values - expected[0]).max() < 2e-10
    assert np.abs(ds.motion_dphi.values - expected[1]).max() < 2e-10 * unit


@pytest.mark.parametrize(("length", "time"), [(1e-15, 1.0), (1e-9, 1e-3), (1e12, 1e6)])
def test_any_unit_of_length_and_of_time(length, time):
    """A motion and the same in other units; by SciPy in units of its own."""

    def rates(t, x):
        return [x[1], x[0] - x[0] ** 3 - 0.1 * x[1] + 0.3 * np.cos(1.1 * t + 0.2)]

    t = np.array([1.0, 7.0, 12.0])
    passes = solve_ivp(rates, (0.0, 12.0), [0.3, 0.1], "DOP853", t, rtol=1e-12, atol=1e-14,
                       events=lambda t, x: x[0] - 0.5)  # fmt: skip
    law = pk.Potential("x^4/(4*l^2*u^2) - x^2/(2*u^2)", "x", {"l": length, "u": time})
    drive = pk.Harmonic(0.3 * length / time**2, 1.1 / time, 0.2)
    system = pk.Perturbed(law, damping=0.1 / time, forcing=drive)
    start, speed = (0.3 * length, 0.1 * length / time), length / time
    for one in (system, system.replace(quadratic=1e-30 / length)):
        ds = pk.flow(one, *start, t * time)
        assert np.abs(ds.motion_phi.values / length - passes.y[0]).max() < 1e-7
        assert np.abs(ds.motion_dphi.values / speed - passes.y[1]).max() < 1e-7
    ds = pk.flow(system, *start, 12.0 * time, events=lambda t, x, v: x / length - 0.5)
    assert ds.event_time.values / time == pytest.approx(passes.t_events[0], abs=1e-8)
    ds = pk.poincare_section(
        system, *start, duration=12.0 * time, section=0.5 * length, direction=0
    )
    assert ds.section_time.values / time == pytest.approx(passes.t_events[0], abs=1e-8)
    plain = pk.Perturbed(
        pk.Potential("x^4/4 - x^2/2", "x"), damping=0.1, forcing=pk.Harmonic(0.3, 1.1, 0.2)
    )
    grid = np.linspace(-2.0, 2.0, 7), np.linspace(-1.0, 1.0, 5)
    want = pk.attractors(plain, phi=grid[0], dphi=grid[1])
    ds = pk.attractors(system, phi=grid[0] * length, dphi=grid[1] * speed)
    assert want.attractor_period.values.tolist() == ds.attractor_period.values.tolist() == [1, 3]
    for name, scale in (("phi", length), ("dphi", speed), ("multiplier", 1.0)):
        found, wanted = (x[f"attractor_{name}"].values for x in (ds, want))
        assert found / scale == pytest.approx(wanted, rel=1e-6, nan_ok=True)


@pytest.mark.parametrize("quadratic", [0.0, 0.2])
@pytest.mark.parametrize("time", [1e-9, 1e3, 1e12])
def test_any_unit_of_time_is_as_good(quadratic, time):
    def moved(unit):
        law = pk.Coefficients(*(x / unit**2 for x in (1.0, 0.35, 0.12)))
        drive = pk.Harmonic(0.3 / unit**2, 1.1 / unit, 0.2)
        system = pk.Perturbed(law, damping=0.1 / unit, quadratic=quadratic, forcing=drive)
        ds = pk.flow(system, 0.3, 0.1 / unit, np.array([1.0, 7.0, 20.0]) * unit)
        return ds.motion_phi.values, ds.motion_dphi.values * unit

    assert np.abs(np.subtract(moved(time), moved(1.0))).max() < 1e-10


@pytest.mark.parametrize("time", [1e-9, 1.0, 1e6])
def test_attractors_of_few_states_in_any_unit_of_time(time):
    system = pk.Perturbed(pk.Coefficients(*(x / time**2 for x in (1.0, 0.35, 0.12))),
                          damping=0.1 / time)  # fmt: skip
    for phi in ([-1.0, 1.0], [1.0]):
        ds = pk.attractors(system, phi=phi, dphi=[0.0])
        assert ds.attractor_period.values.tolist() == [1] * len(phi)
        assert ds.attractor_phi.values[:, 0] == pytest.approx(rests()[-len(phi) :], abs=1e-9)


def test_a_rotor_that_nothing_holds_is_seen_in_the_time_of_its_damping():
    for time in (1.0, 1e-6):
        rotor = pk.Perturbed(
            pk.Coefficients(0.0, 0.0, 0.0), damping=0.1 / time, torque=0.3 / time**2
        )
        ds = pk.attractors(rotor, phi=[-1.0, 1.0], dphi=[0.0, 1.0 / time])
        assert float(ds.attrs["period"]) == pytest.approx(10.0 * time)
        assert ds.attractor_rotation.values == pytest.approx([30.0 / (2.0 * np.pi)], rel=1e-6)


@pytest.mark.parametrize("period", [2e-9 * np.pi, 2.0 * np.pi, 360.0])
def test_a_grid_closes_a_circle_of_any_length_or_not(period):
    assert _covers_turn(period * (np.arange(8) / 8.0 - 0.5), period)
    assert not _covers_turn(period * np.arange(8) / 16.0, period)
    assert not _covers_turn(period * np.linspace(-0.5, 0.5, 8), period)


def test_a_problem_in_any_unit():
    oscillator = pk.Problem(["y", "-x/u"], ("x", "y"), {"u": 1.0})
    found = pk.poincare_section(oscillator, [1e-13, 0.0], duration=20.0, section=("x", 0.0))
    assert found.section_time.values == pytest.approx(np.pi * np.array([1.5, 3.5, 5.5]))
    assert found.section_y.values == pytest.approx([1e-13] * 3, rel=1e-7)


@pytest.mark.parametrize("frequency", [1e-3, 1e3])
def test_a_drive_of_any_frequency(frequency):
    system = pk.Perturbed(EIGHT, damping=0.1, forcing=pk.Harmonic(0.3, frequency, 0.2))

    def rates(t, x):
        slope = (0.35 - np.cos(x[0])) * np.sin(x[0]) - 0.12 * np.cos(x[0])
        return [x[1], -slope - 0.1 * x[1] + 0.3 * np.cos(frequency * t + 0.2)]

    expected = solve_ivp(rates, (0.0, 2.0), [0.3, 0.1], "DOP853", rtol=1e-12, atol=1e-13,
                         max_step=0.3 / max(frequency, 1.0)).y[:, -1]  # fmt: skip
    ds = pk.flow(system, 0.3, 0.1, 2.0)
    assert abs(ds.motion_phi.item() - expected[0]) < 1e-9
    assert abs(ds.motion_dphi.item() - expected[1]) < 1e-9


@pytest.mark.parametrize("damping", [-0.05, 1e-12, 50.0, 1e3])
def test_exponents_add_up_however_strong_the_damping(damping):
    system = pk.Perturbed(EIGHT, damping=damping, forcing=DRIVE)
    ds = pk.lyapunov(system, [0.1, 1.0], 0.0, duration=2.0)
    total = ds.lyapunov_exponent.sum("exponent").values
    assert total.shape == (2,)
    assert np.abs(total + damping).max() < 1e-10
    assert np.abs(ds.lyapunov_sum.values + damping).max() < 1e-10


def test_exponents_of_a_fast_disk_add_up():
    ds = pk.lyapunov(pk.Perturbed(disk(1e4), damping=0.3), 0.1, 0.0, duration=0.2)
    assert abs(ds.lyapunov_sum.item() + 0.3) < 1e-9


def test_a_time_without_value_has_no_exponent():
    system = pk.Perturbed(EIGHT, damping=0.1, forcing=DRIVE)
    ds = pk.lyapunov(system, 0.1, 0.0, duration=[10.0, np.nan, 20.0])
    assert np.isnan(ds.lyapunov_sum.values).tolist() == [False, True, False]
    alone = pk.lyapunov(system, 0.1, 0.0, duration=20.0)
    assert ds.lyapunov_sum.values[2] == pytest.approx(alone.lyapunov_sum.item(), rel=1e-12)


def test_sections_and_exponents_say_which_motions_have_no_end():
    system = pk.Perturbed(RUNAWAY, damping=0.1, forcing=pk.Harmonic(0.0, 1.0))
    with pytest.warns(RuntimeWarning, match="section_phi: 1 of 2 motions end .* run to infinity"):
        ds = pk.stroboscopic(system, [1.0, 0.0], 0.0, n=2)
    assert np.isnan(ds.section_phi.values).tolist() == [[False, True], [False, False]]
    with pytest.warns(RuntimeWarning, match="lyapunov_exponent: 1 of 2 motions end before"):
        ds = pk.lyapunov(system, [1.0, 0.0], 0.0, duration=20.0)
    assert np.isnan(ds.lyapunov_sum.values).tolist() == [True, False]


def test_invalid_parameters_are_named_as_the_cause():
    system = pk.Perturbed(EIGHT, damping=[0.1, np.nan])
    with pytest.warns(RuntimeWarning, match="1 of 2 motions .* because their parameters are inv"):
        ds = pk.flow(system, 0.1, 0.0, 1.0)
    assert np.isnan(ds.motion_phi.values).tolist() == [False, True]


def test_a_frequency_without_value_leaves_the_other_sections_alone():
    driven = pk.Perturbed(WELL, damping=0.15, forcing=pk.Harmonic(0.2, [1.0, np.nan, 2.0]))
    with pytest.warns(RuntimeWarning, match="1 of 3 motions have no sections"):
        ds = pk.stroboscopic(driven, 0.1, 0.0, n=2, skip=20)
    assert np.isnan(ds.section_phi.values[1]).all()
    for i, frequency in ((0, 1.0), (2, 2.0)):
        alone = pk.stroboscopic(driven.replace(forcing_frequency=frequency), 0.1, 0.0, n=2, skip=20)
        assert np.array_equal(ds.section_phi.values[i], alone.section_phi.values)


@pytest.mark.parametrize("neighbour", [np.nan, 1e7, 1e300])
def test_what_stands_beside_a_motion_does_not_change_it(neighbour):
    system = pk.Perturbed(EIGHT, damping=0.1, forcing=DRIVE)
    pair = pk.flow(system, [0.3, neighbour], [0.1, 0.0], [5.0, 40.0])
    alone = pk.flow(system, 0.3, 0.1, [5.0, 40.0])
    assert np.array_equal(pair.motion_phi.values[0], alone.motion_phi.values)


def test_sections_and_exponents_are_the_same_alone_and_among_others():
    """Among motions with quadratic damping, or of another period."""
    system = pk.Perturbed(EIGHT, damping=0.1, quadratic=[0.2, 0.0], forcing=DRIVE)
    others = pk.Perturbed(EIGHT, damping=0.1, forcing=pk.Harmonic(0.3, [2.0, 1.0]))
    alone = pk.Perturbed(EIGHT, damping=0.1, forcing=DRIVE)
    want = pk.stroboscopic(alone, 0.3, 0.1, n=20, period=2.0 * np.pi).section_phi.values
    for several in (system, others):
        found = pk.stroboscopic(several, 0.3, 0.1, n=20, period=2.0 * np.pi).section_phi.values
        assert np.array_equal(found[1], want)
        grown = pk.lyapunov(several, 0.3, 0.1, duration=10.0).lyapunov_exponent.values
        assert np.array_equal(
            grown[1], pk.lyapunov(alone, 0.3, 0.1, duration=10.0).lyapunov_exponent.values
        )


def test_a_run_up_to_a_time_without_value():
    for omega1 in (lambda t: 5.0 * t, ([0.0, 1.0, 2.0], [0.0, 5.0, 10.0])):
        ds = pk.run_up(disk(1.0), omega1=omega1, phi0=0.1, dphi0=0.0, t=[np.nan, 1.0], damping=1.0)
        for name in ("motion_phi", "motion_omega1", "ddphi"):
            assert np.isnan(ds[name].values).tolist() == [True, False]
        assert ds.motion_omega1.values[1] == pytest.approx(5.0)


def test_rest_has_the_period_of_one_leg():
    soft = pk.Perturbed(pk.Potential("x^2/2 - x^4/4", "x"), damping=0.1)
    with pytest.warns(RuntimeWarning, match="too coarse"):
        ds = pk.basins(soft, phi=[-1.5, 0.1, 0.4], dphi=[0.0, 0.1])
    assert ds.attractor_period.values.tolist() == [1]
    assert ds.attractor_multiplier.values == pytest.approx([np.exp(-0.05 * np.pi / 2)], rel=1e-6)
    assert ds.basin.values.tolist() == [[-2, -2], [0, 0], [0, 0]]


def rests():
    found = pk.equilibria(EIGHT).phi
    return sorted(found.sel(equilibrium=["lower_center", "upper_center"]).values)


@pytest.mark.parametrize("damping", [{"damping": 4e-3}, {"quadratic": 0.5}])
def test_slow_spirals_end_at_rest(damping):
    ds = pk.attractors(pk.Perturbed(EIGHT, **damping), **GRID)
    assert ds.attractor_period.values.tolist() == [1, 1]
    assert sorted(ds.attractor_phi.values[:, 0]) == pytest.approx(rests(), abs=1e-9)
    assert (ds.attractor_multiplier <= 1.0 + 1e-9).all()


def test_damping_too_weak_to_settle_is_announced():
    with pytest.warns(RuntimeWarning, match="damped so weakly that they did not settle"):
        ds = pk.attractors(pk.Perturbed(EIGHT, damping=1e-7), phi=[0.5, 1.0], dphi=[3.0])
    assert (ds.attractor_period > 0).all()
    trapped = pk.attractors(pk.Perturbed(EIGHT, damping=1e-7), phi=[0.5, 1.0], dphi=[0.4])
    assert trapped.sizes["attractor"] == 1  # below both barriers, however weak damping is


def test_attractors_to_which_motions_are_too_slow_are_not_passed_over(monkeypatch):
    few = functools.partial(method.limits_of, most=2000)
    monkeypatch.setattr("phasekit.motion.strobe.limits_of", few)
    strong = pk.Perturbed(EIGHT, damping=1e3, quadratic=0.1, forcing=DRIVE)
    said = "attractor_phi: .* take more than 10000000 steps: there may be attractors .* not found"
    with pytest.warns(RuntimeWarning, match=said):
        assert pk.attractors(strong, phi=[0.5, 1.0], dphi=[0.4]).sizes["attractor"] == 0
    with pytest.warns(RuntimeWarning, match=said):
        assert (pk.basins(strong, phi=[0.5, 1.0], dphi=[0.4]).basin == -1).all()
