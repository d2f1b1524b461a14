"""Attractors of driven systems: strong damping in any unit, and kinds, by other integrators."""

import warnings

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import phasekit as pk
from phasekit.motion.strobed import StrobedSearch

PENDULUM = pk.Coefficients(0.0, 1.0, 0.0)
WELL = pk.Potential("x^4/4 - x^2/2", "x")
KIND = pk.AttractorKind


def quietly(system, phi, dphi, **how):
    with warnings.catch_warnings():
        warnings.filterwarnings("ignore", "basin: .* too coarse", RuntimeWarning)
        return pk.basins(system, phi=phi, dphi=dphi, **how)


def after(force, damping, state, time, start=0.0):
    """Where a motion of x'' = force(t, x) - damping x' is, by SciPy."""

    def rates(t, x):
        return [x[1], force(t, x[0]) - damping * x[1]]

    how = {"method": "DOP853", "rtol": 1e-11, "atol": 1e-12}
    return solve_ivp(rates, (start, start + time), state, **how).y[:, -1]


@pytest.mark.slow
@pytest.mark.parametrize(("damping", "torque", "drive"), [(80.0, 0.1, 10.0), (150.0, -0.2, 30.0)])
def test_orbits_of_strongly_damped_systems_close_as_another_integrator_says(damping, torque, drive):
    frequency = 1.1
    leg = 2.0 * np.pi / frequency
    for base, slope in ((WELL, lambda x: x**3 - x), (PENDULUM, np.sin)):
        system = pk.Perturbed(
            base, damping=damping, torque=torque, forcing=pk.Harmonic(drive, frequency)
        )
        ds = pk.attractors(system, phi=[-1.5, 1.5], dphi=[0.0, 0.1 * damping])
        assert ds.attractor_kind.values.tolist() == [KIND.CYCLE] * (2 if base is WELL else 1)

        def force(t, x, slope=slope):
            return torque + drive * np.cos(frequency * t) - slope(x)

        for row in range(ds.sizes["attractor"]):
            start = np.array([ds.attractor_phi.values[row, 0], ds.attractor_dphi.values[row, 0]])
            end = after(force, damping, start, leg)
            assert np.abs(end - start).max() < 1e-9
            beside = after(force, damping, start + [1e-4, 0.0], leg) - end
            grown = np.log(beside[0] / 1e-4) / leg
            assert ds.attractor_exponent.values[row] == pytest.approx(grown, rel=1e-2)


@pytest.mark.parametrize("unit", [1e-9, 1.0, 1e9])
@pytest.mark.parametrize("damping", [1e3, 1e5, 1e6, 1e9])
def test_strong_damping_decides_where_a_drive_shakes_but_does_not_carry(damping, unit):
    well = pk.Potential("k*(x^4/4 - x^2/2)", "x", {"k": unit**2})
    system = pk.Perturbed(well, damping=damping * unit, forcing=pk.Harmonic(0.2 * unit**2, unit))
    # A motion slides by dphi/damping before it creeps.
    slides = damping * unit * np.array([-0.5, 0.0, 0.5])
    ds = quietly(system, [-1.0, -0.3, 0.3, 1.0], slides)
    assert ds.attractor_kind.values.tolist() == [KIND.CYCLE] * 2
    assert ds.attractor_phi.values[:, 0] == pytest.approx([-1.0, 1.0], abs=1e-6)
    assert ds.attractor_exponent.values == pytest.approx([-2.0 * unit / damping] * 2, rel=1e-3)
    assert ds.basin.values.tolist() == [[0, 0, 0], [0, 0, 1], [0, 1, 1], [1, 1, 1]]
    assert ds.basin_decided.values.all()


@pytest.mark.parametrize(("damping", "unit"), [(1e3, 1.0), (1e4, 1e-6), (1e7, 1e6)])
@pytest.mark.parametrize("drive", ["cos(w*t)", "exp(sin(w*t)) - 1.2660658777520084"])
def test_strong_damping_of_equations_with_a_drive(drive, damping, unit):
    problem = pk.Problem(
        {"y": "u", "u": f"-d*u + w^2*(y - y^3/L^2 + L*0.2*({drive}))"},
        parameters={"d": damping * unit, "w": unit, "L": 1e-3},
        time="t", period="2*pi/w",
    )  # fmt: skip
    slides = damping * unit * 1e-3 * np.array([-0.5, 0.0, 0.5])
    ds = pk.basins(problem, {"y": 1e-3 * np.array([-1.0, -0.3, 0.3, 1.0]), "u": slides})
    assert ds.attractor_kind.values.tolist() == [KIND.CYCLE] * 2
    assert 1e3 * ds.attractor_y.values[:, 0] == pytest.approx([-1.0, 1.0], abs=1e-3)
    assert ds.attractor_exponent.values == pytest.approx([-2.0 * unit / damping] * 2, rel=1e-3)
    assert ds.basin.values.tolist() == [[0, 0, 0], [0, 0, 1], [0, 1, 1], [1, 1, 1]]
    assert ds.basin_decided.values.all()
    if damping < 1e4:  # their orbits close as Radau's method says
        pushed = (lambda t: np.exp(np.sin(t)) - 1.2660658777520084) if "exp" in drive else np.cos
        start = np.array([ds[f"attractor_{name}"].values[0, 0] * 1e3 for name in "yu"]) / [1, unit]

        def rates(t, x):
            return [x[1], x[0] - x[0] ** 3 + 0.2 * pushed(t) - damping * x[1]]

        how = {"method": "Radau", "rtol": 1e-10, "atol": 1e-13}
        end = solve_ivp(rates, (0.0, 2.0 * np.pi), start, **how).y[:, -1]
        assert end == pytest.approx(start, rel=1e-7)


@pytest.mark.parametrize("names", ["yu", "uy"])
@pytest.mark.parametrize("factor", ["1", "3", "-1/m"])
def test_a_rate_stands_before_its_coordinate_or_is_a_momentum(names, factor):
    rates = {"y": f"({factor})*u", "u": "-d*u + (y - y^3 + 0.2*cos(t))/(" + factor + ")"}
    problem = pk.Problem(
        {name: rates[name] for name in names}, parameters={"d": 1e4, "m": 2.0},
        time="t", period="2*pi",
    )  # fmt: skip
    turned = {"1": 1.0, "3": 1.0 / 3.0, "-1/m": -2.0}[factor]
    box = {"y": [-1.0, -0.3, 0.3, 1.0], "u": 1e4 * abs(turned) * np.array([-0.5, 0.0, 0.5])}
    ds = pk.basins(problem, {name: box[name] for name in names})
    assert np.sort(ds.attractor_y.values[:, 0]) == pytest.approx([-1.0, 1.0], abs=1e-5)
    assert ds.attractor_exponent.values == pytest.approx([-2e-4] * 2, rel=1e-3)
    # A motion slides by its rate over the damping before all else: y' = y - y^3 from there.
    right = ds.basin.transpose("state_y", "state_u") == int(np.argmax(ds.attractor_y.values[:, 0]))
    right = right[:, :: int(np.sign(turned))]
    assert right.values.tolist() == [[0, 0, 0], [0, 0, 1], [0, 1, 1], [1, 1, 1]]


def test_a_driven_pendulum_of_equations_that_damping_rules():
    problem = pk.Problem(
        {"a": "v", "v": "1.5 - sin(a) - d*v + 0.3*cos(t)"}, parameters={"d": 1e4},
        time="t", period="2*pi", periods={"a": 2.0 * np.pi},
    )  # fmt: skip
    ds = pk.basins(problem, {"a": np.linspace(-3.0, 3.0, 5), "v": [-1.0, 1.0]})
    assert ds.attractor_kind.values.tolist() == [KIND.TORUS]
    assert ds.attractor_rotation.item() == pytest.approx(1.25**0.5 / 1e4, rel=3e-3)


@pytest.mark.parametrize("damping", [1e2, 1e4])
def test_an_overdamped_driven_rotation_by_its_closed_form(damping):
    system = pk.Perturbed(PENDULUM, damping=damping, torque=1.5, forcing=pk.Harmonic(0.3, 1.0))
    ds = quietly(system, np.linspace(-3.0, 3.0, 5), [-1.0, 1.0])
    assert ds.attractor_kind.values.tolist() == [KIND.TORUS]
    assert ds.basin_fraction.values.tolist() == [1.0]
    # phi' = (N - sin phi)/d: mean speed sqrt(N^2 - 1)/d; a turn in one over that.
    want = 1.25**0.5 / damping
    assert ds.attractor_rotation.item() == pytest.approx(want, rel=3e-3)


@pytest.mark.parametrize(("power", "damping"), [(4, 1e3), (6, 1e3), (4, 1e6)])
def test_a_degenerate_rest_attracts_under_a_drive(power, damping):
    well = pk.Potential(f"x^{power}/{power}", "x")
    system = pk.Perturbed(well, damping=damping, forcing=pk.Harmonic(0.3, 1.0))
    ds = pk.basins(system, phi=np.linspace(-1.0, 1.0, 4), dphi=[-1.0, 1.0])
    assert ds.attractor_kind.values.tolist() == [KIND.CYCLE]
    assert ds.basin_fraction.values.tolist() == [1.0]
    # Rounding of the force hides a flatter bottom.
    assert abs(ds.attractor_phi.values.item()) < 1e-14 ** (1.0 / (power - 1))


DUFFING = pk.Perturbed(WELL, damping=0.15, forcing=pk.Harmonic(0.2, 1.0))
CHAOTIC = pk.Perturbed(WELL, damping=0.25, forcing=pk.Harmonic(0.4, 1.0))
ROTOR = pk.Perturbed(PENDULUM, damping=0.1, torque=1.5, forcing=pk.Harmonic(0.2, 0.61803))


def duffing(drive):
    return lambda t, x: x - x**3 + drive * np.cos(t)


@pytest.mark.slow
def test_a_periodic_motion_by_scipy():
    ds = pk.attractors(DUFFING, phi=np.linspace(-2.0, 2.0, 4), dphi=[-1.0, 1.0])
    assert ds.attractor_kind.values.tolist() == [KIND.CYCLE] * 2
    for row in range(2):
        state = np.array([ds.attractor_phi.values[row, 0], ds.attractor_dphi.values[row, 0]])
        flow = [
            after(duffing(0.2), 0.15, state + off, 2.0 * np.pi)
            for off in ([0.0, 0.0], [1e-5, 0.0], [-1e-5, 0.0], [0.0, 1e-5], [0.0, -1e-5])
        ]
        assert np.abs(flow[0] - state).max() < 1e-9
        slope = np.stack([flow[1] - flow[2], flow[3] - flow[4]], -1) / 2e-5
        multiplier = np.abs(np.linalg.eigvals(slope)).max()
        assert ds.attractor_multiplier.values[row] == pytest.approx(multiplier, rel=1e-6)
        exponent = np.log(multiplier) / (2.0 * np.pi)
        assert ds.attractor_exponent.values[row] == pytest.approx(exponent, rel=1e-6)


@pytest.mark.slow
def test_a_chaotic_motion_by_scipy():
    ds = pk.attractors(CHAOTIC, phi=np.linspace(-1.0, 1.0, 3), dphi=[-0.5, 0.5])
    assert ds.attractor_kind.values.tolist() == [KIND.CHAOTIC]
    exponent, error = ds.attractor_exponent.item(), ds.attractor_exponent_error.item()
    assert exponent > 3.0 * error > 0.0

    def rates(t, x):
        return [x[1], x[0] - x[0] ** 3 - 0.25 * x[1] + 0.4 * np.cos(t),
                x[3], (1.0 - 3.0 * x[0] ** 2) * x[2] - 0.25 * x[3]]  # fmt: skip

    state, total = np.array([0.1, 0.1, 1.0, 0.0]), 0.0
    for leg in range(260):
        state = solve_ivp(
            rates, (0.0, 2.0 * np.pi), state, "DOP853", rtol=1e-7, atol=1e-8
        ).y[:, -1]  # fmt: skip
        size = np.hypot(*state[2:])
        state[2:] /= size
        total += np.log(size) if leg >= 20 else 0.0
    assert exponent == pytest.approx(total / (240 * 2.0 * np.pi), rel=0.25)


@pytest.mark.slow
def test_a_quasi_periodic_motion_by_scipy():
    ds = pk.attractors(ROTOR, phi=[0.0, 1.0], dphi=[15.0])
    assert ds.attractor_kind.values.tolist() == [KIND.TORUS]
    assert abs(ds.attractor_exponent.item()) < 1e-3
    leg = 2.0 * np.pi / 0.61803
    state = np.array([ds.attractor_phi.values[0, 0], ds.attractor_dphi.values[0, 0]])

    def force(t, x):
        return 1.5 + 0.2 * np.cos(0.61803 * t) - np.sin(x)

    end = after(force, 0.1, state, 60.0 * leg)
    turns = (end[0] - state[0]) / (2.0 * np.pi * 60.0)
    assert ds.attractor_rotation.item() == pytest.approx(turns, abs=0.5 / 60.0)
    # No state of the motion comes back to itself soon: it fills a curve.
    again = [after(force, 0.1, state, n * leg)[0] - state[0] for n in (1, 2, 3, 5, 8)]
    assert np.abs(np.sin(0.5 * np.array(again))).min() > 1e-4


def test_what_is_not_sure_is_unknown_and_has_no_error_of_its_share(monkeypatch):
    monkeypatch.setattr(StrobedSearch, "_exponent", lambda self, state: (0.01, 0.01))
    monkeypatch.setattr(StrobedSearch, "_is_closed", lambda self, found, turns: False)
    with pytest.warns(RuntimeWarning, match="nor have an exponent that is surely positive"):
        ds = quietly(CHAOTIC, np.linspace(-1.0, 1.0, 3), [-0.5, 0.5])
    assert ds.attractor_kind.values.tolist() == [KIND.UNKNOWN]
    assert ds.basin_fraction.values.tolist() == [1.0]
    assert np.isnan(ds.basin_fraction_error.values).tolist() == [True]


BOX = {"x": [-1.3, 1.2], "v": [-1.0, 1.0]}


def shaken(waves, drive, damping):
    return pk.Problem(
        {"x": "v", "v": f"-d*v + x - x^3 + 0.1*cos(t) + A*cos({waves}*t)"},
        parameters={"d": damping, "A": drive}, time="t", period="2*pi",
    )  # fmt: skip


@pytest.mark.parametrize(("waves", "drive"), [(500, 1e2), (512, 1e2), (512, 1e-3), (765, 1e2)])
def test_waves_as_fast_as_a_grid_are_not_taken_for_slow_ones(waves, drive):
    """As many waves as a grid has times would look like a constant."""
    with pytest.warns(RuntimeWarning, match="too fast in a period"):
        ds = pk.attractors(shaken(waves, drive, 1e5), BOX)
    assert ds.sizes["attractor"] == 0


@pytest.mark.parametrize("waves", [500, 513])
def test_fast_harmonics_of_a_force_are_not_taken_for_slow_ones(waves):
    force = [pk.Harmonic(0.1, 1.0), pk.Harmonic(1.0, float(waves))]
    system = pk.Perturbed(WELL, damping=1e4, forcing=force)
    with pytest.warns(RuntimeWarning, match="too fast in a period"):
        ds = pk.attractors(system, phi=BOX["x"], dphi=BOX["v"])
    assert ds.sizes["attractor"] == 0


@pytest.mark.parametrize("waves", [130, 193])
def test_waves_faster_than_the_first_series_are_followed_or_refused(waves):
    """A linear law has its orbit and its exponent in closed form."""
    d, drive = 1e5, {1: 1.0, waves: 1e2}
    problem = pk.Problem(
        {"x": "v", "v": f"-d*v - x + cos(t) + 100*cos({waves}*t)"},
        parameters={"d": d}, time="t", period="2*pi",
    )  # fmt: skip
    if waves == 193:
        with pytest.warns(RuntimeWarning, match="too fast in a period"):
            assert pk.attractors(problem, BOX).sizes["attractor"] == 0
        return
    ds = pk.attractors(problem, BOX)
    assert ds.sizes["attractor"] == 1
    parts = {k: a / (1.0 - k**2 + 1j * d * k) for k, a in drive.items()}
    x, v = (sum(((1j * k) ** i * part).real for k, part in parts.items()) for i in (0, 1))
    assert ds.attractor_x.values.item() == pytest.approx(x, abs=1e-7 * abs(parts[waves]))
    assert ds.attractor_v.values.item() == pytest.approx(v, rel=1e-7)
    exact = -2.0 / (d * (1.0 + np.sqrt(1.0 - 4.0 / d**2)))
    assert ds.attractor_exponent.values.item() == pytest.approx(exact, rel=1e-7)


def test_a_fast_wave_that_a_series_holds_closes_as_another_integrator_says():
    ds = pk.attractors(shaken(12, 1e2, 1e3), BOX)
    assert ds.sizes["attractor"] == 2
    for row in range(2):
        start = np.array([ds.attractor_x.values[row, 0], ds.attractor_v.values[row, 0]])
        end = after(
            lambda t, x: x - x**3 + 0.1 * np.cos(t) + 1e2 * np.cos(12 * t), 1e3, start, 2.0 * np.pi
        )
        assert end == pytest.approx(start, rel=1e-7)


@pytest.mark.parametrize("waves", [1, 16])
def test_a_force_that_pulls_at_times_only(waves):
    """Of v' = -d v - k (1 - cos) x the slow law is x' = -(k/d) (1 - cos) x: its mean decides."""
    problem = pk.Problem(
        {"x": "v", "v": f"-d*v - k*((1-cos({waves}*t))*x - 0.5)"}, parameters={"d": 1e5, "k": 1e6},
        time="t", period="2*pi",
    )  # fmt: skip
    ds = pk.attractors(problem, BOX)
    assert ds.attractor_kind.values.tolist() == [KIND.CYCLE]
    assert ds.attractor_exponent.values == pytest.approx([-10.0], rel=1e-2)


def test_a_force_that_is_singular_outside_the_box():
    problem = pk.Problem(
        {"x": "v", "v": "-d*v + 1/x^3 - x + 0.1*cos(t)"}, parameters={"d": 1e4},
        time="t", period="2*pi",
    )  # fmt: skip
    ds = pk.attractors(problem, {"x": [0.2, 2.0], "v": [-1.0, 1.0]})
    assert ds.attractor_x.values[:, 0] == pytest.approx([1.0], abs=1e-4)
    assert ds.attractor_exponent.values == pytest.approx([-4e-4], rel=1e-3)


@pytest.mark.slow
def test_two_damped_coordinates_that_are_driven():
    """Slow motions go down a potential: its minima attract, at the rates of its slopes there."""
    damping = 1e4
    pull = "-d*{v} - {x}**3 + {x} + ({y} - {x})/10"
    problem = pk.Problem(
        ["u", pull.format(x="x", v="u", y="y") + " + 3*cos(t)/10",
         "v", pull.format(x="y", v="v", y="x")],
        ("x", "u", "y", "v"), {"d": damping}, time="t", period=2.0 * np.pi,
    )  # fmt: skip
    sides = np.array([-1.5, 1.5])
    ds = pk.attractors(problem, grid={"x": sides, "y": sides}, fixed={"u": 0.0, "v": 0.0})
    alike, unlike = 1.0, np.sqrt(0.8)  # x^2 where x = y, where x = -y
    places = [(-alike, -alike), (-unlike, unlike), (unlike, -unlike), (alike, alike)]
    found = np.stack([ds.attractor_x[:, 0], ds.attractor_y[:, 0]], axis=-1)
    assert np.allclose(sorted(found.tolist()), places, atol=1e-5)
    rates = np.where(np.abs(found[:, 0]) > 0.95, 2.0, 1.4)
    assert np.allclose(-np.log(ds.attractor_multiplier) * damping / (2 * np.pi), rates, rtol=1e-3)


def test_a_stiff_driven_function_is_not_called_for_ever():
    calls = 0

    def f(x, d, t):
        nonlocal calls
        calls += 1
        return [x[1], -d * x[1] - x[0] ** 3 + x[0] + 0.3 * np.cos(t)]

    problem = pk.Problem(f, ("x", "u"), {"d": 1e4}, time="t", period=2.0 * np.pi)
    grid = {"x": np.linspace(-2.0, 2.0, 4), "u": np.array([-1.0, 1.0])}
    with pytest.warns(RuntimeWarning, match="Python function that is called about 2.*e.05 times"):
        ds = pk.basins(problem, grid=grid)
    assert ds.sizes["attractor"] == 0
    assert (ds.basin == -1).all()
    assert calls < 20_000
