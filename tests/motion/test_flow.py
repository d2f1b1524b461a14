"""Damped and driven motions against SciPy's integrator and what is known exactly."""

import functools

import numpy as np
import pytest
import xarray as xr
from scipy.integrate import solve_ivp

import phasekit as pk
from phasekit.motion import flow, stiff

DISK = pk.GyroRotorDisk(beta=1.0, e=0.1, a=0.05, r=0.1, omega1=6.0)
EIGHT = pk.Coefficients(1.0, 0.35, 0.12)


def slope(system, phi):
    A, B, C = system.coefficients()
    return (B - A * np.cos(phi)) * np.sin(phi) - C * np.cos(phi)


def scipy_flow(rates, start, times, **options):
    found = solve_ivp(
        rates, (0.0, times[-1]), start, "DOP853", times, rtol=1e-13, atol=1e-14, **options
    )
    return found.y


@pytest.mark.slow
def test_a_damped_disk_moves_as_scipy_says():
    damped = pk.Perturbed(DISK, damping=0.3)
    t = np.linspace(0.0, 8.0, 41)
    ds = pk.flow(damped, 0.3, 20.0, t)
    assert ds.motion_phi.dims == ("time",)
    assert ds.motion_phi.units == "rad"
    assert ds.attrs["phasekit_model"] == "Perturbed"
    expected = scipy_flow(lambda t, x: [x[1], -slope(DISK, x[0]) - 0.3 * x[1]], [0.3, 20.0], t)
    assert np.abs(ds.motion_phi - expected[0]).max() < 1e-8
    assert np.abs(ds.motion_dphi - expected[1]).max() < 1e-7
    assert abs(ds.motion_phi).max() > np.pi  # unwrapped


@pytest.mark.slow
@pytest.mark.parametrize("backwards", [False, True])
def test_all_terms_at_once(backwards):
    drive = [pk.Harmonic(0.3, 1.1, 0.4), pk.Harmonic(0.2, 0.37, -1.0)]
    system = pk.Perturbed(
        EIGHT,
        damping=0.1,
        torque=0.05,
        forcing=drive,
        modulation={"B": pk.Harmonic(0.1, 0.9, 0.2)},
        drift={"A": 0.01},
    )

    def rates(t, x):
        moved = pk.Coefficients(1.0 + 0.01 * t, 0.35 + 0.1 * np.cos(0.9 * t + 0.2), 0.12)
        force = 0.05 + 0.3 * np.cos(1.1 * t + 0.4) + 0.2 * np.cos(0.37 * t - 1.0)
        return [x[1], -slope(moved, x[0]) - 0.1 * x[1] + force]

    t = np.linspace(0.0, -15.0 if backwards else 15.0, 16)
    ds = pk.flow(system, 0.4, 0.3, t)
    expected = scipy_flow(rates, [0.4, 0.3], t)
    assert np.abs(ds.motion_phi - expected[0]).max() < 3e-8
    assert np.abs(ds.motion_dphi - expected[1]).max() < 3e-8


@pytest.mark.slow
def test_a_varying_support_pushes_the_disk_by_its_acceleration():
    disk = pk.GyroRotorDisk(beta=0.8, e=0.1, a=0.05, r=0.15, omega1=5.0)
    system = pk.Perturbed(disk, damping=0.2, modulation={"omega1": pk.Harmonic(1.0, 2.0, 0.3)})
    s, c = np.sin(0.8), np.cos(0.8)
    kappa = (0.15**2 + 4 * 0.1**2) * s * c / (4 * 0.1**2 * s**2 + 0.15**2 * (1 + s**2))

    def rates(t, x):
        now = disk.replace(omega1=5.0 + np.cos(2.0 * t + 0.3))
        change = -2.0 * np.sin(2.0 * t + 0.3)
        return [x[1], -slope(now, x[0]) - 0.2 * x[1] - kappa * change * np.cos(x[0])]

    t = np.linspace(0.0, 5.0, 6)
    expected = scipy_flow(rates, [0.3, 0.0], t)
    ds = pk.flow(system, 0.3, 0.0, t)
    assert np.abs(ds.motion_phi - expected[0]).max() < 1e-8
    as_function = pk.Perturbed(disk, damping=0.2, omega1=lambda t: 5.0 + np.cos(2.0 * t + 0.3))
    assert np.abs(pk.flow(as_function, 0.3, 0.0, t).motion_phi - expected[0]).max() < 1e-8


def with_quadratic_damping(q, system, state, times):
    """SciPy's motion in pieces from turn to turn, on each of which the law is smooth."""

    def turn(t, x):
        return x[1]

    turn.terminal = True
    now, out = 0.0, []
    state = np.array(state)
    while len(out) < len(times):
        sign = np.sign(state[1]) if state[1] != 0.0 else -np.sign(slope(system, state[0]))

        def rates(t, x, sign=sign):
            return [x[1], -slope(system, x[0]) - q * sign * x[1] ** 2]

        nudged = solve_ivp(rates, (now, now + 1e-3), state, "DOP853", rtol=1e-13, atol=1e-15)
        piece = solve_ivp(rates, (now + 1e-3, times[-1]), nudged.y[:, -1], "DOP853", events=turn,
                          rtol=1e-13, atol=1e-15, dense_output=True)  # fmt: skip
        for t in times[len(out) :]:
            if t <= piece.t[-1]:
                out.append(nudged.y[:, 0] if t <= now else piece.sol(t))
        now, state = piece.t[-1], piece.y[:, -1]
        state[1] = 0.0
    return np.array(out).T


def test_quadratic_damping_between_the_steps_before_a_turn():
    """Many times within the steps that end on a turn, where the sign changes."""
    system = pk.Perturbed(
        pk.Pendulum(length=1.0, g=80.0), quadratic=0.2, forcing=pk.Harmonic(4.0, 3.0)
    )
    times = np.linspace(0.0, 4.0, 401)

    def f(t, x):
        v = x[1]
        return [v, -80.0 * np.sin(x[0]) - 0.2 * abs(v) * v + 4.0 * np.cos(3.0 * t)]

    found = pk.flow(system, 0.3, -4.0, times)
    wanted = solve_ivp(
        f, (0.0, 4.0), [0.3, -4.0], "DOP853", times, rtol=1e-11, atol=1e-11, max_step=0.02
    ).y
    turns = np.count_nonzero(np.diff(np.sign(wanted[1])))
    assert turns > 8
    np.testing.assert_allclose(found.motion_phi.values.ravel(), wanted[0], atol=1e-8)
    np.testing.assert_allclose(found.motion_dphi.values.ravel(), wanted[1], atol=1e-7)


def test_quadratic_damping_turns_without_a_kink():
    times = np.linspace(0.0, 25.0, 26)
    expected = with_quadratic_damping(0.4, EIGHT, [2.0, 1.3], times)
    system = pk.Perturbed(EIGHT, quadratic=0.4)
    found = pk.flow(system, 2.0, 1.3, times, rtol=1e-12, atol=1e-13)
    assert np.abs(found.motion_phi[1:] - expected[0, 1:]).max() < 2e-9
    back = pk.flow(system, found.motion_phi[-1].item(), found.motion_dphi[-1].item(), -25.0,
                   rtol=1e-13, atol=1e-14)  # fmt: skip
    assert abs(back.motion_phi.item() - 2.0) < 1e-6


def test_energy_falls_by_what_damping_takes():
    damping = 0.07
    system = pk.Perturbed(EIGHT, damping=damping)
    edges = np.linspace(0.0, 40.0, 81)
    nodes, weights = np.polynomial.legendre.leggauss(16)
    t = (edges[:-1, None] + 0.25 * (nodes + 1.0)).ravel()
    motion = pk.flow(system, 0.2, 1.8, np.concatenate([t, [40.0]]), rtol=1e-13, atol=1e-14)
    taken = damping * 0.25 * np.sum(np.tile(weights, 80) * motion.motion_dphi.values[:-1] ** 2)
    h = pk.energy(EIGHT, motion.motion_phi, motion.motion_dphi).energy_integral.values
    first = pk.energy(EIGHT, 0.2, 1.8).energy_integral.item()
    assert first - h[-1] == pytest.approx(taken, abs=1e-11)
    assert np.all(np.diff(h) <= 1e-13)


def test_without_damping_and_drive_the_motion_is_the_exact_one():
    t = np.linspace(-30.0, 30.0, 13)
    states = [0.1, 2.0, -1.0], [0.0, 2.5, 0.4]
    still = pk.flow(pk.Perturbed(EIGHT, forcing=pk.Harmonic(0.0, 1.0)), *states, t)
    exact = pk.flow(EIGHT, *states, t)
    assert np.array_equal(still.motion_phi, exact.motion_phi)
    nearly = pk.flow(pk.Perturbed(EIGHT, damping=1e-12), *states, t, rtol=1e-13, atol=1e-14)
    assert np.abs(nearly.motion_phi - exact.motion_phi).max() < 5e-9
    swept = pk.flow(pk.Perturbed(EIGHT, damping=[0.0, 0.1]), *states, t)
    assert np.array_equal(swept.motion_phi.isel(damping=0), exact.motion_phi)
    assert np.abs(swept.motion_phi.isel(damping=1) - exact.motion_phi).max() > 0.1


@pytest.mark.slow
def test_the_error_follows_the_tolerance():
    system = pk.Perturbed(EIGHT, damping=0.2, forcing=pk.Harmonic(0.3, 1.0))
    t = np.linspace(0.0, 20.0, 97)
    best = pk.flow(system, 1.0, 0.5, t, rtol=1e-13, atol=1e-14).motion_phi
    errors = []
    for rtol in (1e-5, 1e-7, 1e-9, 1e-11):
        found = pk.flow(system, 1.0, 0.5, t, rtol=rtol, atol=0.1 * rtol).motion_phi
        errors.append(float(np.abs(found - best).max()))
        assert errors[-1] < 100.0 * rtol
    assert errors[0] > 100.0 * errors[2]


def test_many_motions_are_those_of_each_alone():
    rng = np.random.default_rng(4)
    phi, dphi = rng.uniform(-3, 3, 21), rng.uniform(-2, 2, 21)
    system = pk.Perturbed(EIGHT, damping=0.1, quadratic=0.2, forcing=pk.Harmonic(0.2, 1.3))
    times = np.array([3.0, -2.0, 0.0, 7.5, 3.0])
    together = pk.flow(system, phi, dphi, times)
    assert together.motion_phi.dims == ("point", "time")
    assert np.array_equal(together.motion_phi[:, 2], phi)
    assert np.array_equal(together.motion_phi[:, 0], together.motion_phi[:, 4])
    for i in range(21):
        alone = pk.flow(system, phi[i], dphi[i], times)
        assert np.array_equal(alone.motion_phi, together.motion_phi[i])
    pairs = xr.DataArray(rng.uniform(0, 5, 21), dims="point")
    paired = pk.flow(system, phi, dphi, pairs)
    assert paired.motion_phi.dims == ("point",)
    alone = pk.flow(system, phi[5], dphi[5], pairs[5].item())
    assert paired.motion_phi[5].item() == alone.motion_phi.item()


@pytest.mark.parametrize("method", ["dop853", "rosenbrock", None])
def test_a_pulse_is_met_after_rates_that_are_hardly_there(method):
    pulse = pk.Problem({"x": "exp(-((t - 2)/0.3)^2)"}, time="t")
    x = pk.flow(pulse, [1.0], t=[0.0, 4.0, 100.0], method=method).motion_x.values
    np.testing.assert_allclose(x[1:], 1.0 + 0.3 * np.sqrt(np.pi), rtol=1e-8)


def test_a_motion_to_infinity_is_announced():
    system = pk.Perturbed(pk.Potential("-x^4/4", "x"), damping=0.01)
    with pytest.warns(RuntimeWarning, match="1 of 2 motions end before their last time"):
        ds = pk.flow(system, [1.0, 0.0], 0.0, [0.5, 5.0])
    assert np.isfinite(ds.motion_phi.values[0, 0])
    assert np.isnan(ds.motion_phi.values[0, 1])
    assert np.array_equal(ds.motion_phi.values[1], [0.0, 0.0])


def test_invalid_cells_are_nan():
    system = pk.Perturbed(EIGHT.replace(B=[0.35, np.nan]), damping=[0.1])
    with pytest.warns(RuntimeWarning, match="1 of 2 motions"):
        ds = pk.flow(system, 0.1, 0.0, 1.0)
    assert np.isnan(ds.motion_phi.values).ravel().tolist() == [False, True]


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"rtol": 0.0}, "rtol: got 0.0, wants a number from 1e-14 to 0.1"),
        ({"atol": np.nan}, "atol: got nan"),
        ({"rtol": "x"}, "rtol: got 'x'"),
    ],
)
def test_unusable_tolerances(arguments, message):
    with pytest.raises(pk.ParameterError, match=message):
        pk.flow(pk.Perturbed(EIGHT, damping=0.1), 0.1, 0.0, 1.0, **arguments)


def test_what_has_no_place_is_refused():
    with pytest.raises(pk.ParameterError, match="kT: got 0.1, wants 0 for a motion"):
        pk.flow(pk.Perturbed(EIGHT, damping=0.1, kT=0.1), 0.1, 0.0, 1.0)
    with pytest.raises(pk.ParameterError, match="rtol: got 1e-09, wants nothing"):
        pk.flow(EIGHT, 0.1, 0.0, 1.0, rtol=1e-9)
    late = pk.Perturbed(DISK, omega1=([0.0, 1.0, 2.0], [1.0, 2.0, 3.0]))
    with pytest.raises(pk.ParameterError, match="omega1: got a table from 0 s to 2 s"):
        pk.flow(late, 0.1, 0.0, 3.0)
    both = pk.Perturbed(
        DISK, modulation={"omega1": pk.Harmonic(0.1, 1.0), "beta": pk.Harmonic(0.1, 1.0)}
    )
    with pytest.raises(pk.ParameterError, match="modulation, drift: got beta beside omega1"):
        pk.flow(both, 0.1, 0.0, 3.0)


def test_any_potential_moves():
    system = pk.Perturbed(
        pk.Potential("exp(-x^2)*a + x^2/2", "x", {"a": 2.0}), damping=0.1,
        forcing=pk.Harmonic(0.2, 1.0),
    )  # fmt: skip
    t = np.linspace(0.0, 10.0, 11)
    ds = pk.flow(system, 0.3, 0.1, t)
    assert ds.motion_phi.units == "1"

    def rates(t, x):
        force = 4.0 * x[0] * np.exp(-(x[0] ** 2)) - x[0] - 0.1 * x[1] + 0.2 * np.cos(t)
        return [x[1], force]

    assert np.abs(ds.motion_phi - scipy_flow(rates, [0.3, 0.1], t)[0]).max() < 1e-8


@pytest.mark.slow
def test_a_rate_of_the_support_with_a_kink_is_followed():
    ramp = pk.Perturbed(DISK, damping=0.5, omega1=lambda t: 6.0 + min(t, 1.3))
    s, c = np.sin(1.0), np.cos(1.0)
    kappa = (0.1**2 + 4 * 0.1**2) * s * c / (4 * 0.1**2 * s**2 + 0.1**2 * (1 + s**2))

    def rates(t, x):
        now = DISK.replace(omega1=6.0 + min(t, 1.3))
        return [x[1], -slope(now, x[0]) - 0.5 * x[1] - kappa * (t < 1.3) * np.cos(x[0])]

    first = solve_ivp(rates, (0, 1.3), [0.2, 0.0], "DOP853", rtol=1e-12, atol=1e-13)
    last = solve_ivp(rates, (1.3 + 1e-12, 3.0), first.y[:, -1], "DOP853", rtol=1e-12, atol=1e-13)
    assert pk.flow(ramp, 0.2, 0.0, 3.0).motion_phi.item() == pytest.approx(last.y[0, -1], abs=1e-8)


@pytest.mark.slow
@pytest.mark.parametrize("damping", [1e4, 1e6])
def test_a_stiff_motion_creeps_to_rest(damping):
    """By the law of the slow motion, phi' = -V'/damping, to first order in 1/damping^2."""
    pendulum = pk.Coefficients(0.0, 1.0, 0.0)
    times = damping * np.array([0.0, 5.0, 0.7])
    ds = pk.flow(
        pk.Perturbed(pendulum, damping=damping), 2.5, 0.0, np.append(times, 600.0 * damping)
    )
    want = 2.0 * np.arctan(np.tan(1.25) * np.exp(-times / damping))
    assert ds.motion_phi.values[:3] == pytest.approx(want, abs=3.0 / damping**2 + 1e-8)
    assert ds.motion_dphi.values[1:3] == pytest.approx(-np.sin(want[1:]) / damping, rel=1e-6)
    assert abs(ds.motion_phi.values[3]) < 1e-9


@pytest.mark.slow
def test_a_motion_is_not_called_stiff_too_soon():
    """Damping has acted six million times, but the drive makes short steps anyhow."""
    system = pk.Perturbed(pk.Coefficients(0.0, 1.0, 0.0), damping=10.0, forcing=pk.Harmonic(0.3, 1))

    def rates(t, x):
        return [x[1], -np.sin(x[0]) - 10.0 * x[1] + 0.3 * np.cos(t)]

    end = 6.5e5  # what was before the last 300 s is forgotten
    late = solve_ivp(rates, (end - 300.0, end), [0.0, 0.0], "DOP853", rtol=1e-12, atol=1e-13)
    soon = solve_ivp(rates, (0.0, 1.0), [0.3, 0.1], "DOP853", rtol=1e-12, atol=1e-13)
    found = pk.flow(system, 0.3, 0.1, [1.0, end])
    for i, want in enumerate((soon, late)):
        assert found.motion_phi.values[i] == pytest.approx(want.y[0, -1], abs=1e-9)
        assert found.motion_dphi.values[i] == pytest.approx(want.y[1, -1], abs=1e-9)


@pytest.mark.slow
def test_what_the_implicit_method_gives_up_is_left_to_the_explicit_one(monkeypatch):
    system = pk.Perturbed(EIGHT, damping=20.0, forcing=pk.Harmonic(0.3, 5.0))
    times = np.array([300.0, np.nan, 0.0, 1.0, -0.2, 1.0])
    want = pk.flow(system, 0.4, 0.5, times)
    assert np.isnan(want.motion_phi.values).tolist() == [False, True] + [False] * 4
    monkeypatch.setattr(stiff, "STIFF", 1e3)
    followed = pk.flow(system, 0.4, 0.5, times[3:])
    monkeypatch.setattr(stiff, "MOST_STEPS", 1000)
    found = pk.flow(system, 0.4, 0.5, times)
    for name in ("motion_phi", "motion_dphi"):
        assert found[name].values == pytest.approx(want[name].values, abs=1e-8, nan_ok=True)
    assert followed.motion_phi.values == pytest.approx(want.motion_phi.values[3:], abs=1e-8)


@pytest.mark.slow
def test_stiff_motions_end_with_a_reason_where_they_are_too_fast(monkeypatch):
    monkeypatch.setattr(stiff, "MOST_STEPS", 200)
    monkeypatch.setattr(flow, "motions", functools.partial(flow.motions, most=300_000))
    driven = pk.Perturbed(EIGHT, damping=1e4, forcing=pk.Harmonic(1.0, 50.0))
    with pytest.warns(RuntimeWarning, match="1 of 1 motions end .* strong damping"):
        found = pk.flow(driven, 0.4, 0.5, [1e-3, 1e4]).motion_phi
    assert np.isnan(found).values.tolist() == [False, True]  # what it came to, it keeps
    both = pk.Perturbed(EIGHT, damping=[1e4, 1.0])
    found = pk.flow(both, 0.4, 0.5, 100.0).motion_phi  # a shorter time is no trouble
    assert found.values[1] == pytest.approx(pk.equilibria(EIGHT).phi.values[0], abs=1e-6)
    assert np.isfinite(found).all()


@pytest.mark.slow
def test_other_motions_do_not_change_a_bit():
    """Whether they are stiff, have a kink, are at rest, go backwards, are lost, or are many."""
    count = 30
    damping, quadratic = np.full(count, 0.1), np.zeros(count)
    damping[1:20], damping[20:23], quadratic[23:26] = 1e8, 0.0, 0.3
    phi, dphi = np.linspace(0.3, 1.2, count), np.linspace(0.1, 0.4, count)
    phi[29] = np.nan
    times = np.array([1.0, 7.0, 30.0])

    def system(which):
        names = {"damping": damping, "quadratic": quadratic}
        return pk.Perturbed(EIGHT, **{name: xr.DataArray(x[which], dims="point")
                                      for name, x in names.items()})  # fmt: skip

    every = pk.flow(system(slice(None)), phi, dphi, times, rtol=1e-5)
    back = np.tile(times, (count, 1))
    back[[2, 3, 24], 0] = -1e-9
    back = xr.DataArray(back, dims=("point", "moment"))
    mixed = pk.flow(system(slice(None)), phi, dphi, back, rtol=1e-5)
    assert np.isnan(every.motion_phi.values).any(axis=1).tolist() == [False] * 29 + [True]
    for i in (0, 1, 2, 19, 21, 24, 28):
        alone = pk.flow(system([i]), phi[[i]], dphi[[i]], times, rtol=1e-5)
        for name in ("motion_phi", "motion_dphi"):
            assert np.array_equal(alone[name].values[0], every[name].values[i])
            assert np.array_equal(mixed[name].values[i, 1:], alone[name].values[0, 1:])


@pytest.mark.slow
def test_events_are_zeros_on_the_motion():
    system = pk.Perturbed(EIGHT, damping=0.1, forcing=pk.Harmonic(0.2, 1.0))

    def turns(t, phi, dphi):
        return dphi

    def second_passage(t, phi, dphi):
        return phi - 1.3

    second_passage.terminal = 2
    times = np.linspace(0.0, 40.0, 401)
    fine = {"rtol": 1e-12, "atol": 1e-13}
    plain = pk.flow(system, 0.4, 0.5, times, **fine)
    ds = pk.flow(system, 0.4, 0.5, times, events={"turns": turns}, **fine)
    assert ds.motion_phi.equals(plain.motion_phi)
    changes = int(np.sum(np.diff(np.sign(plain.motion_dphi.values)) != 0))
    assert changes > 5
    assert ds.sizes["event"] == changes
    there = pk.flow(system, 0.4, 0.5, ds.event_time.values, **fine)
    assert np.abs(there.motion_dphi).max() < 1e-8
    assert np.abs(there.motion_phi.values - ds.event_phi.values).max() < 1e-8
    ended = pk.flow(system, 0.4, 0.5, times, events=second_passage)
    assert ended.event_name.values.tolist() == ["event", "event"]
    last = ended.event_time.values[-1]
    assert np.array_equal(np.isnan(ended.motion_phi), times > last)
    back = pk.flow(system, 0.4, 0.5, [-5.0, 5.0], events=turns)
    assert (np.diff(back.event_time) > 0).all()
    assert back.event_time.values[0] < 0.0 < back.event_time.values[-1]


@pytest.mark.slow
def test_events_that_touch_zero_and_turn_back():
    system = pk.Perturbed(EIGHT, damping=0.1, forcing=pk.Harmonic(0.2, 1.0))
    fine = {"rtol": 1e-12, "atol": 1e-13}
    turns = pk.flow(system, 0.4, 0.5, [40.0, -4.0], events=lambda t, x, v: v, **fine)
    times, places = turns.event_time.values, turns.event_phi.values
    assert times.size > 8
    ds = pk.flow(system, 0.4, 0.5, [40.0, -4.0], events=lambda t, x, v: v * v, **fine)
    assert ds.event_time.values == pytest.approx(times, abs=1e-6)

    def rising(t, x, v):
        return v * v

    rising.direction = 1  # what turns back neither rises nor falls through zero
    assert pk.flow(system, 0.4, 0.5, [40.0], events=rising, **fine).sizes["event"] == 0

    def third(t, x, v):
        return -v * v

    third.terminal = 3
    ended = pk.flow(system, 0.4, 0.5, [40.0], events=third, **fine)
    assert ended.event_time.values == pytest.approx(times[times > 0.0][:3], abs=1e-6)
    assert np.isnan(ended.motion_phi).all()
    # a pair of zeros on both sides of a turn, much closer than a step
    number = int(np.argmax(places))
    near = places[number] - 1e-9
    pair = pk.flow(system, 0.4, 0.5, [40.0, -4.0], events=lambda t, x, v: x - near, **fine)
    close = pair.event_time.values[abs(pair.event_time.values - times[number]) < 1e-3]
    assert close.size == 2
    assert close.mean() == pytest.approx(times[number], abs=1e-6)
    missed = pk.flow(
        system, 0.4, 0.5, [40.0, -4.0], events=lambda t, x, v: x - places.max() - 1e-5, **fine
    )
    assert missed.sizes["event"] == 0


@pytest.mark.slow
def test_events_of_any_size_at_any_time():
    system = pk.Perturbed(pk.Coefficients(0.0, 1.0, 0.0), forcing=pk.Harmonic(1e-3, 1.0))
    for factor in (1e-200, 1e200):
        for power in (1, 2, 3):

            def event(t, x, v, factor=factor, power=power):
                return factor * (t - 7.3) ** power

            found = pk.flow(system, 0.3, 0.1, [20.0], events=event).event_time.values
            assert found == pytest.approx([7.3], abs=1e-4 if power == 3 else 1e-8)
    late = pk.flow(system, 0.3, 0.1, [0.0, 400.0], events={
        "corner": lambda t, x, v: abs(t - 399.7), "touch": lambda t, x, v: (t - 399.6) ** 2,
    })  # fmt: skip
    assert late.event_name.values.tolist() == ["touch", "corner"]
    assert late.event_time.values == pytest.approx([399.6, 399.7], abs=1e-7)
    # a time without value is none at which a motion could end
    found = pk.flow(system, 0.3, 0.1, [np.nan, 8.0], events=lambda t, x, v: t - 7.3)
    assert found.event_time.values == pytest.approx([7.3])
    assert np.isnan(found.motion_phi.values).tolist() == [True, False]


def test_events_of_many_motions_are_those_of_each():
    system = pk.Perturbed(EIGHT, damping=[0.1, 0.3])

    def turns(t, phi, dphi):
        return dphi

    turns.terminal = 2
    for event in (turns, pk.Event("dphi", terminal=2)):
        ds = pk.flow(system, [0.1, 0.7], 0.0, [0.0, 3.0, 30.0], events={"turn": event})
        assert ds.event_time.dims == ("damping", "point", "event")
        assert ds.n_events.values.tolist() == [[2, 2], [2, 2]]
        assert np.isnan(ds.motion_phi.isel(time=-1)).all()
        one = pk.flow(system.replace(damping=0.3), 0.7, 0.0, [30.0], events=turns)
        own = ds.isel(damping=1, point=1)
        assert own.event_time.values == pytest.approx(one.event_time.values, rel=1e-8)
        assert own.event_phi.values == pytest.approx(one.event_phi.values, rel=1e-8)


def test_events_of_what_has_none_are_refused():
    system = pk.Perturbed(EIGHT, damping=0.1)
    with pytest.raises(pk.ParameterError, match=r"a function of \(t, phi, dphi\)"):
        pk.flow(system, 0.1, 0.0, 1.0, events=lambda t: t)
    with pytest.raises(pk.ParameterError, match="events: got"):
        pk.flow(EIGHT, 0.1, 0.0, 1.0, events=lambda t, phi, dphi: dphi)


@pytest.mark.parametrize(
    ("event", "message"),
    [
        (lambda t, phi, dphi: np.nan, r"events: 'event' at t = 0\.0: got nan, wants .* finite"),
        (lambda t, phi, dphi: phi if t < 1.0 else np.nan, "events: 'event' at t = .* got nan"),
        (lambda t, phi, dphi: np.array([phi]), "a function that returns one finite number"),
        (lambda t, phi, dphi: None, "a function that returns one finite number"),
        (lambda t, phi, dphi: 1j * phi, "a function that returns one finite number"),
        (lambda t, phi, dphi: phi > 0.2, "it says yes or no"),
    ],
)
def test_events_that_give_no_number_are_refused(event, message):
    system = pk.Perturbed(EIGHT, damping=0.1)
    with pytest.raises(pk.ParameterError, match=message):
        pk.flow(system, 0.1, 0.0, 5.0, events=event)


def test_an_event_that_vanishes_on_a_stretch_counts_once_and_is_announced():
    system = pk.Perturbed(EIGHT, forcing=pk.Harmonic(0.2, 1.0))
    times = [-8.0, 20.0]
    with pytest.warns(RuntimeWarning, match="'event' vanishes on a stretch of time, from t = 0 on"):
        ds = pk.flow(system, 0.4, 0.5, times, events=lambda t, phi, dphi: 0.0)
    assert ds.event_time.values.tolist() == [0.0]

    def after(t, phi, dphi):
        return min(max(t - 12.0, 0.0), 1.0) if t > 6.0 else t - 6.0

    with pytest.warns(RuntimeWarning, match="'after' vanishes on a stretch"):
        ds = pk.flow(system, 0.4, 0.5, [20.0], events={"after": after, "turn": lambda t, x, v: v})
    own = ds.event_time.values[ds.event_name.values == "after"]
    assert own.size == 1
    assert 6.0 <= own.item() < 12.0
    alone = pk.flow(system, 0.4, 0.5, [20.0], events={"turn": lambda t, x, v: v})
    turns = ds.event_time.values[ds.event_name.values == "turn"]
    assert turns.tolist() == alone.event_time.values.tolist()
    assert turns.size > 2
