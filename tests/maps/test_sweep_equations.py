"""Maps of flows and maps with states of their own."""

import warnings

import numpy as np
import pytest
import xarray as xr
from scipy.integrate import solve_ivp

import phasekit as pk

NEURON = pk.Problem(
    {"v": "v - v**3/3 - w + I", "w": "eps*(v + a - b*w)"},
    parameters={"I": 0.5, "eps": 0.08, "a": 0.7, "b": 0.8},
    window={"v": (-2.5, 2.5), "w": (-1.0, 2.0)},
    observables={"speed": "eps*(v + a - b*w)"},
)
HENON = pk.Problem(
    {"x": "1 - a*x^2 + y", "y": "b*x"},
    parameters={"a": 1.4, "b": 0.3},
    map=True,
    window={"x": (-2, 2), "y": (-2, 2)},
)
LOGISTIC = pk.Problem("r*x*(1 - x)", "x", {"r": 3.2}, map=True, window={"x": (0, 1)})
WELL = pk.Problem(
    {"x": "y", "y": "-d*y + x - x^3 + F*cos(w*t)"},
    parameters={"d": 0.25, "F": 0.1, "w": 1.0},
    window={"x": (-2, 2), "y": (-2, 2)},
    time="t",
    period="2*pi/w",
)


def oscillation(current):
    """Period and extremes of the neuron by SciPy: zeros of v' upwards, and v there."""

    def rates(t, x):
        v, w = x
        return [v - v**3 / 3 - w + current, 0.08 * (v + 0.7 - 0.8 * w)]

    turn = lambda t, x: rates(t, x)[0]  # noqa: E731
    found = solve_ivp(rates, (0, 900), [1, 0], "DOP853", events=turn, rtol=1e-11, atol=1e-12)
    times, v = found.t_events[0][-6:], found.y_events[0][-6:, 0]
    return times[4] - times[2], v.min(), v.max()


def test_equilibria_are_those_of_each_cell():
    values = [0.0, 0.2, 0.5, 1.0]
    ds = pk.sweep(NEURON, I=values)
    one = pk.equilibria(NEURON.replace(I=values))
    for name in ("x", "eigenvalue", "kind", "n_unstable", "n_equilibria", "complete"):
        np.testing.assert_array_equal(ds[name], one[name])
    assert ds.n_stable.values.tolist() == [1, 1, 0, 0]
    again = ds.isel(I=2).phasekit.system()
    assert again == NEURON.replace(I=0.5)


def test_numbers_of_equilibria_differ_from_cell_to_cell():
    pitchfork = pk.Problem("r*x - x^3", "x", {"r": 1.0}, window={"x": (-3, 3)})
    ds = pk.sweep(pitchfork, r=[-1.0, 1.0, 4.0, np.nan])
    assert ds.n_equilibria.values.tolist() == [1, 3, 3, -1]
    np.testing.assert_allclose(ds.x.values[2, :, 0], [-2.0, 0.0, 2.0], atol=1e-12)
    assert np.isnan(ds.x.values[0, 1:]).all()
    assert np.isnan(ds.eigenvalue.values[0, 1:]).all()


def test_period_and_extremes_are_those_of_scipy():
    ds = pk.sweep(NEURON, I=[0.0, 0.5, 1.0], of=["period", "extrema"])
    assert ds.period.values[0] == 0.0
    assert ds.min_v.values[0] == ds.max_v.values[0]
    for current, k in ((0.5, 1), (1.0, 2)):
        period, low, high = oscillation(current)
        assert ds.period.values[k] == pytest.approx(period, rel=1e-8)
        assert ds.min_v.values[k] == pytest.approx(low, rel=1e-7)
        assert ds.max_v.values[k] == pytest.approx(high, rel=1e-7)
    np.testing.assert_allclose(ds.mean_speed, 0.0, atol=1e-9)  # of a rate along a cycle


def test_exponents_of_maps_obey_their_identities():
    ds = pk.sweep(HENON, a=[0.3, 1.4], of="lyapunov", x=0.1, y=0.1, n=20_000)
    np.testing.assert_allclose(ds.lyapunov_sum, np.log(0.3), atol=1e-9)
    largest = ds.lyapunov_exponent.sel(exponent=1, a=1.4).item()
    assert largest == pytest.approx(0.4192, abs=4 * ds.lyapunov_error.values[1, 0])
    ds = pk.sweep(LOGISTIC, r=[3.2, 3.5, 4.0], of=["lyapunov", "period"], x=0.3, n=20_000)
    assert ds.lyapunov_exponent.values[2, 0] == pytest.approx(np.log(2.0), abs=2e-3)
    # On the cycle of two the product of the slopes is 4 + 2 r - r^2.
    assert ds.lyapunov_exponent.values[0, 0] == pytest.approx(np.log(0.16) / 2, abs=1e-8)
    assert ds.period.values.tolist() == [2.0, 4.0, 0.0]


def test_exponents_of_a_flow_sum_to_its_divergence():
    lorenz = pk.Problem(
        {"x": "s*(y - x)", "y": "x*(r - z) - y", "z": "x*y - b*z"},
        parameters={"s": 10.0, "r": 28.0, "b": 8 / 3},
    )
    ds = pk.sweep(lorenz, r=[10.0, 28.0], of="lyapunov", x=1.0, y=1.0, z=1.0, duration=200.0)
    np.testing.assert_allclose(ds.lyapunov_sum, -41 / 3, atol=1e-10)
    assert ds.lyapunov_exponent.values[0, 0] < 0.0 < ds.lyapunov_exponent.values[1, 0]


def test_attractors_and_shares_are_those_of_each_cell():
    ds = pk.sweep(WELL, F=[0.0, 0.1], of=["attractors", "basin_fractions"])
    for k, push in enumerate((0.0, 0.1)):
        one = pk.attractors(WELL.replace(F=push))
        n = one.sizes["attractor"]
        assert ds.n_attractors.values[k] == n
        np.testing.assert_allclose(ds.attractor_x[k, :n], one.attractor_x[:, 0], atol=1e-9)
        assert ds.attractor_kind.values[k, :n].tolist() == one.attractor_kind.values.tolist()
    # Without drive the window is symmetric, and so are the shares.
    np.testing.assert_allclose(ds.basin_fraction.values[0, :2], 0.5)
    shares = pk.sweep(HENON, a=[1.4], of="basin_fractions")
    assert shares.escaped_fraction.item() + shares.basin_fraction.sum() == 1.0


@pytest.mark.parametrize(
    ("problem", "axes", "of"),
    [
        (NEURON, {"I": np.linspace(0.0, 1.0, 7)}, ("equilibria", "attractors", "extrema")),
        (HENON, {"a": np.linspace(0.1, 1.4, 7), "n": 500}, ("equilibria", "lyapunov", "period")),
    ],
    ids=["flow", "map"],
)
def test_stored_tiles_are_what_is_computed_at_once(problem, axes, of, tmp_path):
    whole = pk.sweep(problem, axes, of=of)
    name = tmp_path / "map.zarr"
    few = {**axes, **{k: v[:4] for k, v in axes.items() if np.ndim(v)}}
    pk.sweep(problem, few, of=of, store=name, chunks=2, workers=1)
    longer = pk.sweep(problem, axes, of=of, store=name, workers=2)
    assert longer.identical(whole)
    assert pk.open_map(name, verify=True).identical(whole)


def test_more_quantities_and_other_systems(tmp_path):
    name = tmp_path / "map.zarr"
    pk.sweep(HENON, a=[0.1, 0.3], of="lyapunov", n=200, store=name)
    both = pk.sweep(HENON, a=[0.1, 0.3], of=["lyapunov", "equilibria"], n=200, store=name)
    assert {"x", "lyapunov_sum"} <= set(both.data_vars)
    other = pk.Problem(
        {"x": "1 - a*x^2 + y", "y": "-b*x"}, parameters={"a": 1.4, "b": 0.3}, map=True,
        window=dict(HENON.window),
    )  # fmt: skip
    with pytest.raises(pk.StoreError, match="phasekit_problem"):
        pk.sweep(other, a=[0.1, 0.3], of="lyapunov", n=200, store=name)


def test_damage_is_seen(tmp_path):
    name = tmp_path / "map.zarr"
    ds = pk.sweep(HENON, a=[0.1, 0.3], store=name)
    chunk = next(path for path in (name / "x").rglob("*") if path.name != "zarr.json")
    data = bytearray(chunk.read_bytes())
    data[len(data) // 2] ^= 1
    chunk.write_bytes(bytes(data))
    with pytest.raises(pk.StoreError, match="x"):
        pk.open_map(name, verify=True)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        assert pk.sweep(HENON, a=[0.1, 0.3], store=name).identical(ds)


def test_lazy_parameters_give_the_same():
    lazy = xr.DataArray(np.linspace(0.0, 1.0, 4), dims="cell").chunk(cell=2)
    of = ["equilibria", "period"]
    got = pk.sweep(NEURON, {"I": lazy}, of=of)
    assert got.x.chunks is not None
    want = pk.sweep(NEURON, {"I": lazy.compute()}, of=of)
    for name in want.data_vars:
        np.testing.assert_array_equal(got[name], want[name])


@pytest.mark.parametrize(
    ("axes", "of", "word"),
    [
        ({"J": [1.0]}, "equilibria", "'J'"),
        ({"I": [1.0]}, "separatrices", "separatrices"),
        ({"I": [1.0]}, "lyapunov", "duration"),
        ({"I": [1.0], "v": 0.0}, "equilibria", "'v'"),
        ({}, "equilibria", "axes"),
    ],
)
def test_what_is_refused(axes, of, word):
    with pytest.raises(pk.ParameterError, match=word):
        pk.sweep(NEURON, axes, of=of)


def test_a_forced_flow_has_no_equilibria():
    with pytest.raises(pk.ParameterError, match="equilibria"):
        pk.sweep(WELL, F=[0.1], of="equilibria")
    free = pk.Problem("r*x - x^3", "x", {"r": 1.0})
    with pytest.raises(pk.ParameterError, match="'x'"):
        pk.sweep(free, r=[1.0], of="equilibria")


def cubic(x, mu):
    return np.array([mu * x[0] - x[0] ** 3])


def test_where_there_may_be_more_equilibria_is_counted(tmp_path):
    code = pk.Problem(cubic, "x", {"mu": 1.0}, window={"x": (-2.0, 2.0)})
    said = r"not proved that there are no others in 2 of 3 systems"
    for more in ({}, {"store": tmp_path / "map.zarr"}):
        with pytest.warns(RuntimeWarning, match=said) as caught:
            ds = pk.sweep(code, mu=[0.5, np.nan, 1.0], of="equilibria", **more)
        assert [w.category for w in caught].count(RuntimeWarning) == 1
        assert ds.n_equilibria.values.tolist() == [3, -1, 3]
        assert not ds.complete.values.any()
    formula = pk.Problem("mu*x - x^3", "x", {"mu": 1.0}, window={"x": (-2.0, 2.0)})
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert pk.sweep(formula, mu=[0.5, 1.0], of="equilibria").complete.values.all()
