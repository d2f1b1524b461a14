"""Attractors and basins of any flow or map: closed forms, published values, another path."""

from __future__ import annotations

import warnings

import numba
import numpy as np
import pytest
from scipy.integrate import quad, solve_ivp
from witnesses.variants import some

import phasekit as pk

KIND = pk.AttractorKind
HENON = {"x": "1 - a*x^2 + y", "y": "b*x"}


def quietly(*args, **how):
    with warnings.catch_warnings():
        warnings.filterwarnings("ignore", "basin: .* too coarse", RuntimeWarning)
        return pk.basins(*args, **how)


def test_henons_attractor_and_infinity():
    henon = pk.Problem(HENON, parameters={"a": 1.4, "b": 0.3}, map=True)
    axis = np.linspace(-2.0, 2.0, 100)
    ds = pk.basins(henon, {"x": axis, "y": axis})
    assert ds.basin.dims == ("state_x", "state_y")
    assert ds.attractor_kind.values.tolist() == [KIND.CHAOTIC]
    assert ds.basin_fraction.item() == pytest.approx(0.426, abs=0.002)
    assert (ds.basin == -2).mean().item() == pytest.approx(0.574, abs=0.002)
    assert abs(ds.attractor_exponent.item() - 0.4192) < 3.0 * ds.attractor_exponent_error.item()
    # The same cells go to infinity when iterated here.
    x, y = np.meshgrid(axis, axis, indexing="ij")
    with np.errstate(all="ignore"):
        for _ in range(500):
            x, y = 1.0 - 1.4 * x**2 + y, 0.3 * x
    np.testing.assert_array_equal(ds.basin == -2, ~np.isfinite(x))
    x, y = ds.attractor_x.values[0], ds.attractor_y.values[0]
    np.testing.assert_allclose(x[1:], 1.0 - 1.4 * x[:-1] ** 2 + y[:-1], rtol=1e-12)


@numba.njit
def njit_cubic(x, mu):
    return np.array([mu * x[0] - x[0] ** 3])


def plain_cubic(x, mu):
    return [mu * x[0] - x[0] ** 3]


@pytest.mark.parametrize("f", some(["mu*x - x^3", njit_cubic, plain_cubic], 2))
def test_two_fixed_points_of_a_map_and_their_basins(f):
    cubic = pk.Problem(f, "x", {"mu": 1.5}, map=True, window={"x": (-1.2, 1.2)})
    ds = pk.basins(cubic, {"x": np.linspace(-1.2, 1.2, 7)})
    root = np.sqrt(0.5)
    np.testing.assert_allclose(ds.attractor_x.values, [[-root], [root]], rtol=1e-9)
    assert ds.attractor_period.values.tolist() == [1, 1]
    assert ds.attractor_kind.values.tolist() == [KIND.EQUILIBRIUM] * 2
    # By symmetry, and as f keeps signs within (-sqrt 1.5, sqrt 1.5); 0 is the repelling one.
    assert ds.basin.values.tolist() == [0, 0, 0, -1, 1, 1, 1]
    multiplier = abs(1.5 - 3.0 * 0.5)
    np.testing.assert_allclose(ds.attractor_multiplier, multiplier, atol=1e-6)


def test_cycles_of_a_flow_in_closed_form():
    """R' = r (1 - r^2)(4 - r^2)(9 - r^2)/100, turning with w: 1 and 3 attract, 0 and 2 repel."""
    radial = "(1 - r2)*(4 - r2)*(9 - r2)/100"
    flow = pk.Problem(
        {"x": f"x*({radial}) - w*y", "y": f"y*({radial}) + w*x"}, parameters={"w": 2.0},
        definitions={"r2": "x^2 + y^2"}, window={"x": (-4, 4), "y": (-4, 4)},
    )  # fmt: skip
    axis = np.linspace(-4.0, 4.0, 41)
    ds = pk.basins(flow, {"x": axis, "y": axis})
    radii = np.hypot(ds.attractor_x, ds.attractor_y).values
    assert ds.attractor_kind.values.tolist() == [KIND.CYCLE] * 2
    order = np.argsort(radii[:, 0])
    np.testing.assert_allclose(radii[order], [[1.0], [3.0]] * np.ones(radii.shape[1]), rtol=1e-9)
    np.testing.assert_allclose(ds.attractor_period, np.pi, rtol=1e-9)
    # d/dr of the radial rate at 1 and 3 is -2 (3)(8)/100 and -2 9 (8)(5)/100.
    want = np.exp(np.pi * np.array([-0.48, -7.2]))
    np.testing.assert_allclose(ds.attractor_multiplier.values[order], want, rtol=1e-6)
    r = np.hypot(*np.meshgrid(axis, axis, indexing="ij"))
    inner = (r > 1e-9) & (r < 1.99)
    np.testing.assert_array_equal(ds.basin.values[inner], order[0])
    np.testing.assert_array_equal(ds.basin.values[r > 2.01], order[1])


def test_a_damped_pendulum_is_that_of_its_own_path():
    """Rest and rotation of phi'' + d phi' + sin phi = N, by two searches that share no code."""
    own = pk.Perturbed(pk.Coefficients(0.0, 1.0, 0.0), damping=0.2, torque=0.5)
    free = pk.Problem(
        {"phi": "v", "v": "N - d*v - sin(phi)"}, parameters={"d": 0.2, "N": 0.5},
        periods={"phi": 2.0 * np.pi}, window={"v": (-4.0, 4.0)},
    )  # fmt: skip
    phi, dphi = np.linspace(-3.0, 3.0, 20), np.linspace(-3.5, 3.4, 20)
    one = quietly(own, phi=phi, dphi=dphi)
    other = quietly(free, {"phi": phi, "v": dphi})
    assert other.attractor_kind.values.tolist() == [KIND.EQUILIBRIUM, KIND.ROTATION]
    np.testing.assert_array_equal(one.basin, other.basin)
    np.testing.assert_allclose(other.attractor_phi[0, 0], np.arcsin(0.5), atol=1e-10)
    turns = one.attractor_rotation.values[1] / float(one.attrs["period"])
    assert other.attractor_rotation.values[1] == pytest.approx(turns, rel=1e-8)
    assert other.attractor_period.values[1] == pytest.approx(1.0 / turns, rel=1e-8)
    assert other.attractor_multiplier.values[1] == pytest.approx(
        one.attractor_multiplier.values[1], rel=1e-6
    )


def test_a_forced_oscillator_is_that_of_its_own_path():
    """Duffing's: the attractors to 1e-10, and halves of the states by symmetry."""
    own = pk.Perturbed(
        pk.Potential("x^4/4 - x^2/2", "x"), damping=0.15, forcing=pk.Harmonic(0.2, 1.0)
    )
    forced = pk.Problem(
        {"x": "v", "v": "x - x^3 - d*v + F*cos(t)"}, parameters={"d": 0.15, "F": 0.2},
        time="t", period="2*pi", window={"x": (-2.2, 2.2), "v": (-2.2, 2.2)},
    )  # fmt: skip
    axis = -2.2 + 4.4 * (np.arange(40) + 0.5) / 40
    one, other = quietly(own, phi=axis, dphi=axis), quietly(forced, {"x": axis, "v": axis})
    for name, its in (("phi", "x"), ("dphi", "v")):
        np.testing.assert_allclose(other[f"attractor_{its}"], one[f"attractor_{name}"], atol=1e-10)
    np.testing.assert_allclose(other.attractor_multiplier, one.attractor_multiplier, rtol=1e-8)
    both = (one.basin_decided & other.basin_decided.values).values
    assert both.mean() > 0.6
    np.testing.assert_array_equal(one.basin.values[both], other.basin.values[both])
    assert (abs(other.basin_fraction - 0.5) < 3.0 * other.basin_fraction_error).all()


def test_equations_are_captured_with_the_odds_of_their_own_path():
    """Motions of a plain Problem from outside a figure-eight, against Neishtadt's ratio."""
    law = pk.Coefficients(1.0, 0.35, 0.12)
    odds = pk.capture(pk.Perturbed(law, damping=0.01))
    equations = pk.Problem(
        {"x": "v", "v": "sin(x)*cos(x) - 0.35*sin(x) + 0.12*cos(x) - d*v"}, parameters={"d": 0.01}
    )
    lower, upper = pk.separatrices(law).saddle_energy.values
    x, v = np.random.default_rng(1).uniform(-np.pi, np.pi, (2, 40_000))
    level = (pk.energy(law, x, v).energy_integral.values - lower) / (upper - lower)
    outside = np.flatnonzero((level > 0.15) & (level < 0.8))[:1500]
    start = {"x": x[outside], "v": v[outside]}
    end = pk.flow(equations, start, [0.0, 1500.0]).isel(time=-1)
    x, v = end.motion_x.values, end.motion_v.values
    assert np.all(pk.energy(law, x, v).energy_integral < lower)
    beyond = x - pk.separatrices(law).saddle_phi.sel(saddle="lower").item()
    right = float((np.sin(beyond) > 0.0).mean())
    want = odds.capture_probability.sel(region="right").item()
    spread = np.sqrt(want * (1.0 - want) / outside.size)
    assert outside.size == 1500
    assert abs(right - want) < odds.capture_error + 3.0 * spread


def test_a_flat_rest_attracts_and_a_motion_leaves_for_infinity():
    flat = pk.Problem({"x": "-x^3", "y": "-y*(1 - y)"}, window={"x": (-1, 1), "y": (-0.5, 2)})
    ds = pk.basins(flat, {"x": np.linspace(-1, 1, 5), "y": np.linspace(-0.4, 2.0, 6)})
    assert ds.attractor_kind.values.tolist() == [KIND.EQUILIBRIUM]
    assert ds.attractor_exponent.item() == 0.0
    assert ds.basin.values.tolist() == [[0, 0, 0, -2, -2, -2]] * 5


def test_others_are_fixed_by_numbers_and_formulas():
    flow = pk.Problem(
        {"x": "x - x^3 + c*z", "y": "-y", "z": "-z"}, parameters={"c": 2.0},
        window={"x": (-2, 2), "y": (-1, 3), "z": (-1, 1)},
    )  # fmt: skip
    axis = np.linspace(-2.0, 2.0, 8)
    ds = pk.basins(flow, {"x": axis}, fixed={"z": "-x/c*3"})
    assert ds.basin.attrs["state_z"] == "-3*x/c"
    assert ds.state_y.item() == 1.0  # the middle of the window
    # x + 2 z crosses 0 at once: from the right motions come to the left.
    start = [[x, 0.0, -1.5 * x] for x in axis]
    end = [pk.flow(flow, s, 60.0).motion_x.item() for s in start]
    places = ds.attractor_x.values[:, 0]
    assert [places[i] for i in ds.basin.values] == pytest.approx(end, abs=1e-6)


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda p: pk.basins(p, {"q": [0.0, 1.0]}), "grid: state 'q' is unknown"),
        (lambda p: pk.basins(p, [0.0, 1.0]), "grid: got .* a mapping"),
        (lambda p: pk.basins(p, {"x": [1.0, 0.0]}), r"grid\['x'\]: .* increasing"),
        (lambda p: pk.basins(p, {"x": [0.0, 1.0]}), "fixed: .* a formula for v"),
        (lambda p: pk.basins(p, {"x": [0.0]}, fixed={"x": 1.0}), "not on the grid"),
        (lambda p: pk.basins(p, {"x": [0.0, 1.0]}, fixed={"v": "q"}), r"fixed\['v'\]"),
        (lambda p: pk.attractors(p), "values of x, where the system has no window"),
        (lambda p: pk.attractors(p, phi=[0.0], dphi=[0.0]), "phi: .* a mapping"),
        (lambda p: pk.attractors(p.replace(d=[0.1, 0.2])), "got array parameters"),
        (
            lambda p: pk.attractors(pk.Problem("-x", "x", conservative=True, window={"x": (0, 1)})),
            "a force alone|conserves",
        ),
        (lambda p: pk.attractors(pk.Pendulum(length=1.0)), "phi: got"),
    ],
)
def test_what_is_wrong_is_said(call, message):
    problem = pk.Problem({"x": "v", "v": "-x - d*v"}, parameters={"d": 0.1})
    with pytest.raises(pk.ParameterError, match=message):
        call(problem)


def test_van_der_pols_multiplier_is_the_mean_divergence():
    oscillator = pk.Problem(
        {"x": "y", "y": "mu*(1 - x^2)*y - x"}, parameters={"mu": 1.0},
        window={"x": (-3, 3), "y": (-4, 4)},
    )  # fmt: skip
    ds = pk.attractors(oscillator)
    period = ds.attractor_period.item()
    assert period == pytest.approx(6.6632868593, abs=1e-9)
    start = [ds.attractor_x.values[0, 0], ds.attractor_y.values[0, 0]]
    t = np.linspace(0.0, period, 401)
    x = pk.flow(oscillator, start, t).motion_x.values
    total, _ = quad(lambda s: 1.0 - np.interp(s, t, x) ** 2, 0.0, period, limit=400, epsrel=1e-5)
    assert ds.attractor_multiplier.item() == pytest.approx(np.exp(total), rel=1e-3)


def prey(x, m, A):
    n, p = x
    return np.array([n * (n - A) * (1.0 - n) - n * p, p * (n - m)])


PREY = {"n": "n*(n - A)*(1 - n) - n*p", "p": "p*(n - m)"}


@pytest.mark.parametrize(
    ("f", "number"), [(PREY, 7), pytest.param(prey, 4, marks=pytest.mark.slow)]
)
def test_stiff_motions_to_infinity_in_finite_time(f, number):
    # With p < 0 < n - m: n follows sqrt(-p) at the rate -p, and p' is about -(-p)^1.5.
    law = pk.Problem(
        f, ("n", "p"), {"m": 0.6, "A": 0.1}, window={"n": (-0.1, 1.1), "p": (-0.1, 0.4)}
    )
    axes = {"n": np.linspace(-0.1, 1.1, number), "p": np.linspace(-0.1, 0.4, number)}
    found = quietly(law, axes)
    want = np.zeros((number, number), int)

    def far(t, x):
        return 1e5 - np.abs(x).max()

    far.terminal = True
    for i, j in np.ndindex(want.shape):
        start = axes["n"][i], axes["p"][j]
        how = {"method": "LSODA", "rtol": 1e-8, "atol": 1e-30, "events": far}
        way = solve_ivp(lambda t, x: prey(x, 0.6, 0.1), (0.0, 400.0), start, **how)
        ends = 0 if np.hypot(*way.y[:, -1]) < 1e-2 else 1
        want[i, j] = ends if way.status == 0 else -2
    assert (want == -2).any()
    np.testing.assert_array_equal(found.basin, want)


@pytest.mark.parametrize(
    "f", [["x^2 - x^3*y", "-y"], lambda x: [x[0] ** 2 - x[0] ** 3 * x[1], -x[1]]]
)
def test_motions_to_infinity_at_a_time_in_closed_form(f):
    # On y = 0, which stays, x = 1/(1/x0 - t); for x0 < 0 all come to 0.
    law = pk.Problem(f, ("x", "y"), window={"x": (-1.0, 1.0), "y": (-1.0, 1.0)})
    times = np.array([1.0, 1.999, 2.0, 2.001])
    with pytest.warns(RuntimeWarning, match="run to infinity"):
        ds = pk.flow(law, {"x": 0.5, "y": 0.0}, t=times)
    np.testing.assert_allclose(ds.motion_x[:2], 1.0 / (2.0 - times[:2]), rtol=1e-7)
    assert np.isnan(ds.motion_x[3])


def test_chaos_that_fills_space_is_one_attractor_and_two_are_two():
    """States of a run are further from each other there than those on a curve or a sheet."""
    window = {"x": (-1.5, 1.5), "y": (0, 1), "z": (0, 1)}
    law = {"x": "a*x - x^3", "y": "3.9*y*(1 - y)", "z": "3.9*z*(1 - z)"}
    system = pk.Problem(law, parameters={"a": 2.5}, map=True, window=window)
    starts = {"x": [-0.7, 0.8], "y": [0.23, 0.59], "z": [0.31]}
    ds = pk.attractors(system, starts)
    assert ds.attractor_kind.values.tolist() == [KIND.CHAOTIC] * 2
    signs = np.sign(ds.attractor_x.values)  # each on its own side of the plane x = 0
    assert (signs == signs[:, :1]).all()
    assert sorted(signs[:, 0].tolist()) == [-1.0, 1.0]
