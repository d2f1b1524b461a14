"""Maps of flows and maps with states of their own."""

import warnings

import numpy as np
import pytest
import xarray as xr
from scipy.integrate import solve_ivp

import phasekit as pk
from phasekit.extend import Flow, Map, Pass, Quantity, add_quantity
from phasekit.table.quantities import TABLE

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


def test_a_formula_of_states_is_a_quantity():
    asked = ["max(v*w - I)", "mean(v - w)", "max_v", "max(v)", "max(v*w - I)_error"]
    ds = pk.sweep(NEURON, I=[0.5], of=asked)
    period = oscillation(0.5)[0]
    motion = pk.flow(
        NEURON.replace(I=0.5), {"v": 1.0, "w": 0.5}, 400.0 + np.linspace(0, period, 4001)
    )
    product, apart = (motion.motion_v * motion.motion_w - 0.5), (motion.motion_v - motion.motion_w)
    assert ds["max(v*w - I)"].item() == pytest.approx(product.max().item(), rel=1e-6)
    assert ds["mean(v - w)"].item() == pytest.approx(apart[:-1].mean().item(), rel=1e-6)
    assert ds["max(v)"].item() == ds.max_v.item()
    assert 0.0 < ds["max(v*w - I)_error"].item() < 1e-6
    assert (
        ds["max(v*w - I)"].attrs["long_name"]
        == "greatest v*w - I along the attractor of the motion"
    )
    cycle = pk.sweep(LOGISTIC, r=[3.2], of="mean(x^2)")["mean(x^2)"].item()
    x = (4.2 + np.array([1, -1]) * np.sqrt(4.2 * 0.2)) / 6.4
    assert cycle == pytest.approx(np.mean(x**2), rel=1e-12)


@pytest.mark.parametrize(
    ("of", "store", "message"),
    [
        ("max(v*u)", None, "of: got the unknown symbol u"),
        ("max(v, w)", None, "of: the quantity 'max.v, w.' is unknown"),
        ("max(v) + max(w)", None, "is unknown"),
        ("max(v/w)", "a.nc", "of: got 'max.v/w.', wants quantities with names for a store; obs"),
        ("max(v*w)", "a.zarr", "wants quantities with names"),
    ],
)
def test_a_formula_that_is_no_quantity_is_refused(of, store, message, tmp_path):
    place = None if store is None else tmp_path / store
    with pytest.raises(pk.ParameterError, match=message):
        pk.sweep(NEURON, I=[0.5], of=of, store=place)


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
    ("problem", "axes", "of", "workers"),
    [
        (NEURON, {"I": np.linspace(0.0, 1.0, 3)}, ("equilibria", "attractors", "extrema"), 2),
        (HENON, {"a": np.linspace(0.1, 1.4, 3), "n": 100}, ("equilibria", "lyapunov", "period"), 1),
    ],
    ids=["flow", "map"],
)
def test_stored_tiles_are_what_is_computed_at_once(problem, axes, of, workers, tmp_path):
    whole = pk.sweep(problem, axes, of=of)
    name = tmp_path / "map.zarr"
    few = {**axes, **{k: v[:1] for k, v in axes.items() if np.ndim(v)}}
    pk.sweep(problem, few, of=of, store=name, chunks=2, workers=1)
    longer = pk.sweep(problem, axes, of=of, store=name, workers=workers)
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
    for of in ("equilibria", ["period", "n_stable"]):
        with pytest.raises(pk.ParameterError, match="no equilibria; of='attractors'"):
            pk.sweep(WELL, F=[0.1], of=of)
    with pytest.raises(pk.ParameterError, match="did you mean 'period'"):
        pk.sweep(WELL, F=[0.1], of="perod")
    free = pk.Problem("r*x - x^3", "x", {"r": 1.0})
    with pytest.raises(pk.ParameterError, match="'x'"):
        pk.sweep(free, r=[1.0], of="equilibria")


def cubic(x, mu):
    return np.array([mu * x[0] - x[0] ** 3])


def test_where_there_may_be_more_equilibria_is_counted(tmp_path):
    code = pk.Problem(cubic, "x", {"mu": 1.0}, window={"x": (-2.0, 2.0)})
    said = r"not proved that there are no others in 2 of 3 systems"
    with pytest.warns(RuntimeWarning, match=said):  # what is asked for is not `complete`
        pk.sweep(code, mu=[-1.0, np.nan, 1.0], of="n_equilibria")
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


def test_the_share_of_henons_basin_is_that_of_a_grid_by_hand():
    axis = np.linspace(-2.0, 2.0, 41)
    ds = pk.sweep(HENON, a=[1.4], of="basin_fractions", starts={"x": axis, "y": axis})
    x, y = (part.ravel() for part in np.meshgrid(axis, axis))
    with np.errstate(all="ignore"):
        for _ in range(400):
            x, y = 1.0 - 1.4 * x**2 + y, 0.3 * x
    stays = np.isfinite(x).mean()
    assert ds.basin_fraction[0, 0].item() == pytest.approx(stays, abs=1e-12)
    assert ds.escaped_fraction.item() == pytest.approx(1.0 - stays, abs=1e-12)
    share = np.sqrt(stays * (1.0 - stays) / x.size)
    assert ds.basin_fraction_error[0, 0].item() == pytest.approx(share, rel=0.01)
    assert ds.starts_x.item() == 41
    assert (ds.first_x.item(), ds.last_y.item()) == (-2.0, 2.0)
    few = pk.sweep(HENON, a=[1.4], of="basin_fractions", starts=100)
    assert few.starts_y.item() == 10
    assert few.first_x.item() == pytest.approx(-1.8)
    line = pk.sweep(HENON, a=[1.4], of="attractors", starts={"x": axis, "y": 0.1})
    assert (line.starts_y.item(), line.n_attractors.item()) == (1, 1)


def test_stored_maps_know_their_starts(tmp_path):
    how = {"of": "basin_fractions", "a": [1.3, 1.4]}
    axes = {"x": np.linspace(-2, 2, 6), "y": np.linspace(-1, 1, 5)}
    ds = pk.sweep(HENON, **how, starts=axes, store=tmp_path / "map.zarr", workers=1)
    again = pk.sweep(HENON, **how, starts=axes)
    xr.testing.assert_equal(ds.load(), again)
    with pytest.raises(pk.StoreError, match="first_x|starts_x"):
        pk.sweep(HENON, **how, starts=64, store=tmp_path / "map.zarr", workers=1)


@pytest.mark.parametrize(
    ("starts", "message"),
    [
        ({"z": [0.0, 1.0]}, "starts: state 'z' is unknown"),
        ({"x": [0.0, 1.0, 3.0]}, r"starts\['x'\]: got .* at equal distances"),
        ({"x": [1.0, 0.0]}, r"starts\['x'\]"),
        (0, "starts: got 0"),
        ("many", "starts: got 'many'"),
    ],
)
def test_starts_have_to_be_a_number_or_a_grid(starts, message):
    with pytest.raises(pk.ParameterError, match=message):
        pk.sweep(HENON, a=[1.4], of="attractors", starts=starts)
    with pytest.raises(pk.ParameterError, match="starts: .* nothing for these quantities"):
        pk.sweep(HENON, a=[1.4], of="equilibria", starts=64)
    with pytest.raises(pk.ParameterError, match="starts: .* nothing for these quantities"):
        pk.sweep(pk.Reduced(0.1, 0.2), lam=[0.1, 0.2], starts=64)


FRICTION = pk.Perturbed(
    pk.Potential("x^4/4 - x^2/2", "x", interval=(-3, 3)), damping=0.2,
    terms=pk.Term("-mu*dphi^3", {"mu": 0.3}),
)  # fmt: skip


def test_a_system_with_a_term_is_mapped_as_its_equations():
    same = pk.Problem(
        {"phi": "dphi", "dphi": "phi - phi^3 - d*dphi - mu*dphi^3"},
        parameters={"d": 0.2, "mu": 0.3}, window={"phi": (-2, 2), "dphi": (-2, 2)},
    )  # fmt: skip
    axes = {"phi": np.linspace(-2, 2, 8), "dphi": np.linspace(-2, 2, 8)}
    mine = {f"{'d' * (name == 'dphi')}x": axis for name, axis in axes.items()}
    of = ["equilibria", "attractors", "basin_fractions"]
    ds = pk.sweep(FRICTION, mu=[0.1, 0.3], of=of, starts=mine)
    other = pk.sweep(same, mu=[0.1, 0.3], of=of, starts=axes)
    assert ds.n_equilibria.values.tolist() == [3, 3]
    np.testing.assert_allclose(ds.x, other.x, atol=1e-12)
    np.testing.assert_allclose(np.sort_complex(ds.eigenvalue), np.sort_complex(other.eigenvalue))
    for name in ("attractor_phi", "attractor_exponent", "basin_fraction", "n_attractors"):
        np.testing.assert_allclose(ds[name], other[name], atol=1e-9)
    assert ds.isel(mu=0).phasekit.system() == FRICTION.replace(mu=0.1)
    long = pk.sweep(FRICTION, mu=[0.1, 0.3], of="lyapunov", x=1.2, dx=0.1, duration=200.0)
    np.testing.assert_allclose(long.lyapunov_exponent[:, 0], -0.1, atol=1e-2)


def test_extremes_of_cycles_are_within_their_errors():
    hopf = pk.Problem(
        {"x": "m*x - 2*y - x*(x^2 + y^2)", "y": "2*x + m*y - y*(x^2 + y^2)"},
        parameters={"m": 1.0}, window={"x": (-3, 3), "y": (-3, 3)},
        observables={"sum": "3*x + 4*y"},
    )  # fmt: skip
    m = np.array([-0.5, 0.25, 1.0, 4.0])
    ds = pk.sweep(hopf, m=m, of=["period", "extrema"], x=0.3, y=0.1)
    radius = np.sqrt(np.maximum(m, 0.0))
    np.testing.assert_allclose(ds.period, [0.0, np.pi, np.pi, np.pi], rtol=1e-9)
    for name, size in (("x", 1.0), ("y", 1.0), ("sum", 5.0)):
        assert (ds[f"max_{name}_error"].values < 1e-6).all()
        for end, sign in (("max", 1.0), ("min", -1.0)):
            off = np.abs(ds[f"{end}_{name}"].values - sign * size * radius)
            assert (off <= ds[f"{end}_{name}_error"].values).all()
        np.testing.assert_allclose(ds[f"mean_{name}"], 0.0, atol=1e-9)
    wide = pk.sweep(LOGISTIC, r=[3.7, 4.0], of="extrema", x=0.3)
    assert (wide.max_x.values <= 1.0).all()
    assert (wide.max_x_error.values > 0.0).all()


def test_where_a_multiplier_is_one_the_period_is_still_told():
    ds = pk.sweep(LOGISTIC, r=[2.9, 3.0, 3.1], of=["period", "extrema"], x=0.3)
    assert ds.period.values.tolist() == [1.0, 1.0, 2.0]
    assert ds.max_x.values[1] == pytest.approx(2 / 3, abs=1e-9)


def test_the_rows_of_a_system_are_listed():
    rows = pk.quantities(NEURON)
    assert {"max_speed", "min_v_error", "lyapunov_exponent"} <= set(rows)
    assert rows["max_v"].long_name.startswith("greatest v")
    assert "equilibria" not in pk.quantities(WELL).groups
    assert "topology" in pk.quantities(pk.Reduced(0.1, 0.2))
    assert "topology" not in rows
    assert {"kramers", "attractors"} & set(pk.quantities(FRICTION).groups)
    with pytest.raises(pk.ParameterError, match="system: got 3"):
        pk.quantities(3)


def test_states_of_several_units_have_no_unit_together():
    fall = pk.Problem(["v", "-g - v"], ["z", "v"], {"g": 1.0})
    both = fall.described({"z": {"units": "m"}, "v": {"units": "m s-1"}})
    row = pk.quantities(both)["x"]
    assert row.units == ""
    assert row.long_name.endswith("z (m), v (m s-1)")
    same = fall.described({"z": {"units": "m"}, "v": {"units": "m"}})
    assert [pk.quantities(one)["x"].units for one in (same, fall)] == ["m", "1"]


@pytest.fixture
def open_table():
    """The table as it was, after rows were added to it."""
    rows, passes, own = dict(TABLE.rows), TABLE.passes, set(TABLE.own)
    yield
    TABLE.rows.clear()
    TABLE.rows.update(rows)
    TABLE.passes, TABLE.own = passes, own


@pytest.mark.usefixtures("open_table")
def test_a_row_of_ones_own_starts_from_parameters_and_from_other_rows():
    def spread(exponents, b):
        return exponents.max(axis=-1) - exponents.min(axis=-1) + 0.0 * b

    words = {"dtype": "float64", "units": "1", "long_name": "spread", "equation": "l1 - l2"}
    row = Quantity("spread", "spread", (), source="[Ott2002]", of=Map, **words)
    add_quantity(row, Pass(spread, ("lyapunov_exponent", "b"), ("spread",), of=Map))
    assert "spread" in pk.quantities(HENON)
    assert "spread" not in pk.quantities(NEURON)
    how = {"a": [1.0, 1.2], "x": 0.1, "y": 0.1, "n": 100}
    alone = pk.sweep(HENON, **how, of="spread")
    beside = pk.sweep(HENON, **how, of=["spread", "lyapunov"])
    exponents = beside.lyapunov_exponent
    np.testing.assert_array_equal(alone.spread, exponents[:, 0] - exponents[:, 1])
    np.testing.assert_array_equal(alone.spread, beside.spread)


def failing(given):
    raise KeyError("no such metal")


@pytest.mark.parametrize(
    ("function", "message"),
    [
        (failing, "the function of 'own' raised KeyError: 'no such metal'"),
        (lambda given: None, "the function of 'own' gave None, wants an array of float64"),
        (lambda given: given + 1j, "'own' gave complex128 values, wants an array of float64"),
        (lambda given: [[1.0], [1.0, 2.0]], "'own' gave .* wants an array of float64"),
        (lambda given: "high", "'own' gave <U4 values"),
        (lambda given: np.zeros(7), r"'own' gave an array of shape \(7,\), wants .* to \(2,\)"),
        (lambda given: np.zeros((3, 2)), r"'own' gave an array of shape \(3, 2\)"),
    ],
)
@pytest.mark.parametrize("stored", [False, True])
@pytest.mark.usefixtures("open_table")
def test_functions_of_rows_of_ones_own_that_fail_are_named(tmp_path, function, message, stored):
    words = {"dtype": "float64", "units": "1", "long_name": "own", "equation": "-", "source": "-"}
    add_quantity(
        Quantity("own", "own", (), **words, of=Flow), Pass(function, ("mu",), ("own",), of=Flow)
    )
    flow = pk.Problem({"x": "mu - x"}, parameters={"mu": 1.0}, window={"x": (-3, 3)})
    where = {"store": tmp_path / "map.zarr", "workers": 1} if stored else {}
    with pytest.raises(pk.StoreError if stored else pk.ParameterError, match=message):
        pk.sweep(flow, mu=[0.3, 0.4], of="own", **where)


@pytest.mark.usefixtures("open_table")
def test_rows_of_ones_own_that_start_from_eigenvalues():
    """A pendulum with damping has them by its equations, and one with a drive has none."""
    words = {"dtype": "float64", "units": "1", "long_name": "own", "equation": "-", "source": "-"}
    add_quantity(
        Quantity("fastest", "fastest", (), **words, of=Flow),
        Pass(lambda s: np.nanmax(s.real, axis=(-1, -2)), ("eigenvalue",), ("fastest",), of=Flow),
    )
    damped = pk.Perturbed(pk.Pendulum(length=1.0, g=2.0), damping=0.1)
    d = np.array([0.3, 0.4])
    found = pk.sweep(damped, damping=d, of="fastest").fastest
    np.testing.assert_allclose(found, np.sqrt(d**2 / 4 + 2.0) - d / 2, rtol=1e-12)
    driven = pk.Perturbed(pk.Pendulum(length=1.0), damping=0.1, forcing=pk.Harmonic(0.1, 1.0))
    for system, given in ((driven, {"damping": d}), (WELL, {"d": d})):
        with pytest.raises(pk.ParameterError, match="'fastest', wants .* has no equilibria"):
            pk.sweep(system, **given, of="fastest")


def test_motions_start_off_the_symmetries_of_a_window():
    """In the middle of these windows a motion stays on an axis, or comes to a point of rest."""
    window = {"x": (-25, 25), "y": (-25, 25), "z": (0, 50)}
    lorenz = pk.Problem(
        {"x": "10*(y - x)", "y": "x*(r - z) - y", "z": "x*y - 8/3*z"}, parameters={"r": 28.0},
        window=window,
    )  # fmt: skip
    ds = pk.sweep(lorenz, r=[28.0], of="lyapunov", duration=300.0)
    value, error = ds.lyapunov_exponent[0, 0].item(), ds.lyapunov_error[0, 0].item()
    assert value == pytest.approx(0.9056, abs=4.0 * error)
    assert error < 0.1
    logistic = pk.Problem({"x": "4*x*(1 - x)"}, map=True, window={"x": (0, 1)}, parameters={"q": 1})
    ds = pk.sweep(logistic, q=[1.0], of="lyapunov", n=4000)
    assert ds.lyapunov_exponent.item() == pytest.approx(np.log(2.0), abs=0.02)


def test_formulas_that_outlast_the_forcing_have_no_extremes():
    """Along an orbit of period pi, cos(t) was 1.27 at most."""
    problem = pk.Problem(
        ["v", "a*cos(t)**2 - x - v/3"], ["x", "v"], {"a": 1.0}, time="t", period="2*pi",
        observables={"c": "cos(t)"}, window={"x": (-2, 2), "v": (-2, 2)},
    )  # fmt: skip
    for formula in ("cos(t)", "x + sin(sqrt(2)*t)", "t", "c"):
        with pytest.raises(pk.ParameterError, match="wants a formula that repeats itself"):
            pk.sweep(problem, a=[1.0], of=f"max({formula})")
    for name in ("max_c", "mean_c"):
        with pytest.raises(pk.ParameterError, match="unknown"):
            pk.sweep(problem, a=[1.0], of=name)
    assert pk.sweep(problem, a=[1.0], of="max(cos(2*t))")["max(cos(2*t))"].max() <= 1.0 + 1e-9
