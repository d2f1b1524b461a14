"""Motions with noise: against exact distributions, and the same bits wherever they are followed."""

import numpy as np
import pytest
from scipy.integrate import quad

import phasekit as pk
from phasekit.motion.kernels.noise import passage

WALK = pk.Problem("m", "x", {"m": 1.0}, noise={"x": 0.8})
DECAY = pk.Problem("-a*x", "x", {"a": 1.0, "s": 1.0}, noise={"x": "s"})
EIGHT = pk.Coefficients(1.0, 0.35, 0.0)


def test_the_same_bits_in_every_part_and_order():
    whole = pk.flow(DECAY.replace(a=[1.0, 2.0]), x=[0.0, 1.0, 2.0], t=[5.0, 1.0], paths=3, seed=7)
    assert whole.motion_x.dims == ("a", "point", "time", "path")
    alone = pk.flow(DECAY.replace(a=2.0), x=1.0, t=[1.0, 5.0], paths=2, seed=7)
    part = whole.motion_x.isel(a=1, point=1, path=slice(2))
    np.testing.assert_array_equal(part.sortby("time"), alone.motion_x)
    assert len(np.unique(whole.motion_x)) == whole.motion_x.size  # no two paths are alike
    other = pk.flow(DECAY.replace(a=2.0), x=1.0, t=[1.0, 5.0], paths=2, seed=8)
    assert not np.intersect1d(other.motion_x, alone.motion_x).size
    drawn = pk.flow(DECAY, x=0.0, t=1.0, paths=1)
    again = pk.flow(DECAY, x=0.0, t=1.0, paths=1, seed=int(drawn.attrs["seed"]))
    assert drawn.motion_x.item() == again.motion_x.item()


def test_functions_take_the_same_paths_as_formulas():
    code = pk.Problem(lambda x, a, s: [-a * x[0]], "x", {"a": 1.0, "s": 1.0}, noise={"x": "s"})
    given = {"x": 0.5, "t": [0.5, 1.0], "paths": 3, "seed": 1, "step": 0.1}
    np.testing.assert_allclose(
        pk.flow(code, **given).motion_x, pk.flow(DECAY, **given).motion_x, rtol=1e-13
    )
    given = {"x": 0.5, "target": "x - 1", "duration": 3.0, "paths": 5, "seed": 1, "step": 0.1}
    found = pk.first_passage(code, **given).passage_time
    assert np.isinf(found).any()
    np.testing.assert_allclose(found, pk.first_passage(DECAY, **given).passage_time, rtol=1e-12)


@pytest.mark.slow
def test_a_linear_system_has_the_variance_of_its_steps():
    """Heun's map of x' = -a x is x (1 - a h + a^2 h^2/2), its kick s (1 - a h/2) dW."""
    h, n = 0.5, 20_000
    ds = pk.flow(DECAY, x=0.0, t=[1.0, 8.0], paths=n, seed=1, step=h)
    keep = (1 - h + h * h / 2) ** 2
    kicked = h * (1 - h / 2) ** 2
    expected = kicked * np.array([1 - keep**2, 1 - keep**16]) / (1 - keep)
    np.testing.assert_allclose(ds.motion_x.var("path"), expected, rtol=4 * np.sqrt(2 / n))
    fine = pk.flow(DECAY.replace(s=2.0), x=0.0, t=8.0, paths=n, seed=1)
    assert fine.noise_step == 0.05
    assert abs(fine.motion_x.var().item() / 2.0 - 1.0) < 4 * np.sqrt(2 / n)


@pytest.mark.slow
def test_times_to_a_level_are_exact_for_any_step():
    """Of a walk with drift m: mean a/m, variance a s^2/m^3."""
    for step in (None, 0.5):
        ds = pk.first_passage(
            WALK, x=0.0, target="x - 2", duration=200.0, paths=5000, seed=3, step=step
        )
        assert ds.n_passed == 5000
        assert abs(ds.mean_passage_time - 2.0) < 4.0 * ds.mean_passage_time_error
        np.testing.assert_allclose(ds.passage_time.var(), 2.0 * 0.64, rtol=0.15)
        np.testing.assert_allclose(ds.passage_rate * ds.mean_passage_time, 1.0, rtol=1e-12)
    late = pk.first_passage(WALK, x=0.0, target="x - 2", duration=[1.0, 2.0], paths=500, seed=3)
    assert late.passage_time.dims == ("time", "path")
    assert np.isnan(late.mean_passage_time).all()
    assert (late.n_passed == np.isfinite(late.passage_time).sum("path")).all()


def test_passage_of_a_bridge():
    """The distribution of the first zero of a Brownian bridge, by sampling its midpoint."""
    rng = np.random.default_rng(1)
    for a, b in ((0.6, 0.5), (0.3, -0.9)):

        def density(x, a=a, b=b):
            """Of the state at 1/2, and that the path has passed by then."""
            middle = np.exp(-2.0 * (x - 0.5 * (a + b)) ** 2) / np.sqrt(0.5 * np.pi)
            return middle * (np.exp(-4.0 * a * x) if x > 0 else 1.0)

        draws = rng.uniform(size=(20_000, 2)), rng.standard_normal(20_000)
        found = np.array(
            [passage(a, b, 1.0, 1.0, u, z, v) for (u, v), z in zip(*draws, strict=True)]
        )
        half = quad(density, -6.0, 6.0, points=[0.0])[0]
        share = np.mean(found <= 0.5)
        assert abs(share - half) < 4.0 * np.sqrt(half * (1 - half) / len(found))
        hit = 1.0 if b < 0 else np.exp(-2.0 * a * b)
        assert abs(np.mean(found <= 1.0) - hit) < 4.0 * np.sqrt(0.25 / len(found))


@pytest.mark.slow
def test_kramers_time_of_an_overdamped_well():
    """From -1 to 0 in x' = x - x^3: the integral of exp(U/D) times that of exp(-U/D), over D."""
    D = 0.15
    well = pk.Problem("x - x^3", "x", {"D": D}, noise={"x": "sqrt(2*D)"}, start={"x": -1.0})
    u = lambda x: (x**4 / 4 - x**2 / 2) / D  # noqa: E731
    mean = quad(lambda y: np.exp(u(y)) * quad(lambda x: np.exp(-u(x)), -4, y)[0], -1, 0)[0] / D
    ds = pk.first_passage(well, target="x", duration=2000.0, paths=1500, seed=2)
    assert ds.n_passed == 1500
    assert abs(ds.mean_passage_time - mean) < 4.0 * ds.mean_passage_time_error


@pytest.mark.slow
def test_a_bath_gives_each_velocity_its_temperature():
    bath = pk.Perturbed(EIGHT, damping=[0.3, 1.0], kT=0.04)
    ds = pk.flow(bath, 1.2, 0.0, np.arange(40.0, 400.0, 8.0), paths=150, seed=1)
    assert ds.motion_dphi.dims == ("damping", "time", "path")
    assert ds.motion_dphi.units == "s-1"
    count = ds.sizes["time"] * ds.sizes["path"]
    found = (ds.motion_dphi**2).mean(["time", "path"]) / 0.04
    np.testing.assert_allclose(found, 1.0, atol=5 * np.sqrt(2 / count))


@pytest.mark.slow
def test_means_fall_with_the_square_of_the_step():
    """<x^2> of x' = -x - x^3 with noise 1, whose density is exp(-x^2 - x^4/2)."""
    anharmonic = pk.Problem("-x - x^3", "x", noise={"x": 1.0}, start={"x": 0.0})
    weight = lambda x: np.exp(-(x**2) - x**4 / 2)  # noqa: E731
    exact = quad(lambda x: x**2 * weight(x), -6, 6)[0] / quad(weight, -6, 6)[0]
    errors = []
    for step in (0.25, 0.125):
        t = np.arange(4.0, 504.0, 2.0)
        ds = pk.flow(anharmonic, t=t, paths=2500, seed=1, step=step)
        errors.append((ds.motion_x**2).mean().item() - exact)
    assert abs(errors[0]) > 0.01
    assert 3.0 < errors[0] / errors[1] < 5.5


@pytest.mark.slow
def test_escape_from_a_well_has_the_rate_of_the_theory():
    """From core to core: 5.34e-4 by [MelnikovMeshkov1986], 5.32(14)e-4 by 1,500 Langevin paths."""
    bath = pk.Perturbed(EIGHT, damping=0.5, kT=0.04)
    points = pk.equilibria(EIGHT)
    start, energy = (points[n].sel(equilibrium="upper_center").item() for n in ("phi", "energy"))
    sign = np.sign(start)
    below = f"{energy + 0.04} - (dphi^2/2 - 0.35*cos(phi) + cos(phi)^2/2)"
    target = f"Min({-sign}*phi, {below})"
    ds = pk.first_passage(bath, start, 0.0, target=target, duration=4000.0, paths=1000, seed=5)
    theory = (
        pk.escape_rate(bath, center="upper_center").escape_rate.sel(saddle="lower").sum().item()
    )
    assert theory == pytest.approx(5.34e-4, rel=0.01)
    assert abs(ds.passage_rate - theory) < 3.0 * ds.passage_rate_error
    assert ds.passage_rate_error < 0.05 * theory


@pytest.mark.parametrize(
    ("call", "said"),
    [
        (lambda: pk.Problem("-x", "x", noise={"y": 1.0}), "noise: state 'y' is unknown"),
        (lambda: pk.Problem("-x", "x", noise={"x": "x"}), "noise is additive"),
        (lambda: pk.Problem("-x", "x", noise=1.0), "noise: got 1.0, wants a mapping"),
        (lambda: pk.Problem("-x", "x", map=True, noise={"x": 1.0}), "noise: got"),
        (lambda: pk.flow(pk.Problem("-x", "x"), 0.0, [1.0], paths=2), "a system with noise"),
        (lambda: pk.flow(DECAY, 0.0, [1.0], paths=0), "paths: got 0"),
        (lambda: pk.flow(DECAY, 0.0, [1.0], paths=2, seed=-1), "seed: got -1"),
        (lambda: pk.flow(DECAY, 0.0, [1.0], paths=2, step=0.0), "step: got 0.0"),
        (lambda: pk.flow(DECAY, 0.0, [-1.0], paths=2), "t: got"),
        (lambda: pk.flow(DECAY, 0.0, [1.0], paths=2, method="radau"), "method: got 'radau'"),
        (lambda: pk.flow(DECAY, 0.0, [1.0], seed=2), "seed: got 2, wants nothing without paths"),
        (lambda: pk.flow(EIGHT, 0.0, 0.0, [1.0], paths=2), "a Perturbed with kT"),
        (lambda: pk.flow(pk.Perturbed(EIGHT), 0.0, 0.0, [1.0], paths=2), "a temperature > 0"),
        (
            lambda: pk.flow(pk.Perturbed(EIGHT, quadratic=1.0, kT=1.0), 0.0, 0.0, [1.0], paths=2),
            "quadratic: got 1.0, wants 0 with kT",
        ),
        (lambda: pk.first_passage(DECAY, x=0.0, target="1", duration=1.0), "target: got '1'"),
        (lambda: pk.first_passage(DECAY, x=0.0, target="y", duration=1.0), "unknown symbol y"),
        (lambda: pk.first_passage(DECAY, x=0.0, target="x-1", duration=0.0), "duration: got 0.0"),
        (lambda: pk.first_passage(DECAY, target="x-1", duration=1.0), "a value for x as well"),
    ],
)
def test_what_is_wrong_is_said(call, said):
    with pytest.raises(pk.ParameterError) as error:
        call()
    assert said in str(error.value)


def test_paths_that_end_are_counted():
    away = pk.Problem("x^3", "x", noise={"x": 0.1}, start={"x": 1.0})
    with pytest.warns(RuntimeWarning, match="2 states of paths are NaN"):
        ds = pk.flow(away, t=[0.1, 100.0], paths=2, seed=1, step=0.01)
    assert np.isfinite(ds.motion_x[0]).all()
    with pytest.warns(RuntimeWarning, match="3 of 3 paths have no value"):
        ds = pk.first_passage(away, target="x + 5", duration=100.0, paths=3, seed=1, step=0.01)
    assert np.isnan(ds.passage_time).all()


def test_noise_of_xppaut(tmp_path):
    file = tmp_path / "noisy.ode"
    file.write_text("wiener n,m\nv'=-v+sig*n\nw'=v-w-m/2\nx'=v\npar sig=.3\naux e=v*w\ndone\n")
    problem = pk.Problem.from_ode(file)
    assert {name: str(size) for name, size in problem.noise.items()} == {"v": "sig", "w": "-1/2"}
    assert str(problem.f[0]) == "-v"
    assert pk.flow(problem, t=[1.0], paths=4, seed=1).motion_e.shape == (1, 4)
    for text, said in (
        ("wiener n\nx'=n*x", "line 1: got n times x"),
        ("wiener n\nx'=n\ny'=n", "line 1: got n in the rates of x, y"),
        ("wiener n,m\nx'=n+m", "line 1: got m in the rate of x"),
        ("x(t+1)=x+n\nwiener n", "line 2: got n, noise in a map"),
    ):
        file.write_text(text)
        with pytest.raises(pk.ParameterError) as error:
            pk.Problem.from_ode(file)
        assert said in str(error.value)
