"""Results as tables for reading."""

import pickle

import numpy as np
import pytest
import xarray as xr

import phasekit as pk

SYSTEM = pk.Coefficients(2.0, 1.0, 0.0)


def test_equilibria_with_the_names_of_their_kinds():
    ds = pk.equilibria(SYSTEM)
    table = ds.phasekit.table(phi="deg")
    assert list(table.index) == ["lower_center", "lower_saddle", "upper_center", "upper_saddle"]
    assert list(table["kind"]) == ["center", "saddle", "center", "saddle"]
    np.testing.assert_allclose(table["phi (deg)"], [60.0, 0.0, -60.0, 180.0], atol=1e-13)
    np.testing.assert_array_equal(table["energy (s-2)"], ds.energy)
    assert "n_equilibria" not in table


def test_what_is_absent_has_no_row():
    table = pk.equilibria(pk.Pendulum(length=1.0)).phasekit.table()
    assert list(table.index) == ["lower_center", "upper_saddle"]
    wells = pk.equilibria(pk.Potential("x^4/4 - mu*x^2/2", "x", {"mu": [-1.0, 1.0]}))
    table = wells.phasekit.table()
    assert table.index.names == ["mu", "equilibrium"]
    assert [tuple(row) for row in table.index] == [(-1.0, 0), (1.0, 0), (1.0, 1), (1.0, 2)]
    assert list(table["kind"]) == ["center", "center", "saddle", "center"]


def test_states_stand_beside_what_was_computed(tmp_path):
    ds = pk.orbits(SYSTEM, [0.1, 0.2, 9.0], [0.0, 0.1, np.nan])
    table = ds.phasekit.table()
    assert list(table["state_phi (rad)"]) == [0.1, 0.2]
    assert list(table["orbit_kind"]) == ["libration", "libration"]
    np.testing.assert_array_equal(table["period (s)"], ds.period[:2])
    table.to_csv(tmp_path / "orbits.csv")
    head, *rows = (tmp_path / "orbits.csv").read_text().splitlines()
    assert head.startswith("point,state_phi (rad),state_dphi (s-1),orbit_kind")
    assert len(rows) == 2


def test_scalars_are_one_row_and_other_datasets_are_taken():
    table = pk.orbits(SYSTEM, 0.1, 0.0).phasekit.table(period="ms")
    assert len(table) == 1
    assert table["period (ms)"].item() == pytest.approx(
        1e3 * pk.orbits(SYSTEM, 0.1, 0.0).period.item()
    )
    assert len(pk.equilibria(SYSTEM)[[]].phasekit.table()) == 0
    with pytest.raises(pk.ParameterError, match="did you mean 'phi'"):
        pk.equilibria(SYSTEM).phasekit.table(phy="deg")


def test_states_of_equilibria_have_columns_by_their_names():
    prey = pk.Problem(
        {"n": "n*(n - A)*(1 - n) - n*p", "p": "p*(n - m)"},
        parameters={"m": [0.5, 0.6], "A": 0.1},
        window={"n": (-0.05, 1.1), "p": (-0.05, 0.4)},
    )
    table = pk.equilibria(prey).phasekit.table()
    assert table.index.names == ["m", "equilibrium"]
    for m in (0.5, 0.6):  # n = 0, A, 1 without the predator, and n = m with it
        n, p = table.loc[m][["n", "p"]].to_numpy().T
        np.testing.assert_allclose(n, [0.0, 0.1, m, 1.0], atol=1e-12)
        np.testing.assert_allclose(p, [0.0, 0.0, (m - 0.1) * (1 - m), 0.0], atol=1e-12)


def test_eigenvalues_and_the_period_of_small_oscillations_have_columns():
    lorenz = pk.Problem(
        {"x": "s*(y - x)", "y": "r*x - y - x*z", "z": "x*y - b*z"},
        parameters={"s": 10.0, "r": [10.0, 28.0], "b": 8 / 3},
        window={"x": (-25, 25), "y": (-30, 30), "z": (-1, 50)},
    )
    for ds in (pk.equilibria(lorenz), pk.sweep(lorenz, r=[10.0, 28.0], of="equilibria")):
        table = ds.phasekit.table()
        assert len(table) == 6
        for (r, _), row in table.iterrows():
            x, y, z = row[["x", "y", "z"]]
            jacobian = np.array([[-10, 10, 0], [r - z, -1, -x], [y, x, -8 / 3]])
            wanted = np.linalg.eigvals(jacobian)
            got = row[[f"eigenvalue {i}" for i in (1, 2, 3)]].to_numpy(complex)
            assert np.allclose(np.sort_complex(got), np.sort_complex(wanted), atol=1e-9)
            turning = wanted[wanted.imag > 0]
            assert np.allclose(row["small_period"], 2 * np.pi / turning.imag, rtol=1e-9)
            assert np.isnan(row["small_period"]) == (turning.size == 0)
    rotor = pk.equilibria(SYSTEM).phasekit.table()
    at_rest = pk.orbits(SYSTEM, rotor["phi (rad)"].to_numpy(), 0.0).period
    centers = (rotor["kind"] == "center").to_numpy()
    np.testing.assert_allclose(rotor["small_period (s)"][centers], at_rest[centers], rtol=1e-12)
    assert rotor["small_period (s)"][~centers].isna().all()


@pytest.mark.slow
def test_a_coordinate_of_its_own_name_is_not_called_phi():
    well = pk.Potential("x^4/4 - k*x^2/2 + h*x", "x", {"k": 1.0, "h": 0.0})
    results = [
        pk.equilibria(well),
        pk.separatrices(well),
        pk.orbits(well, [0.1, 0.2], 0.0),
        pk.flow(well, 0.1, 0.0, [0.0, 1.0]),
        pk.branches(well, "k", (-1.0, 1.0)),
        pk.critical(well, "k", span=(-1.0, 1.0)),
        pk.quasi_static(well, k=[1.0, 0.5]),
        pk.bifurcation_set(well, "h", "k", xlim=(-1, 1), ylim=(-1, 1)),
    ]
    for ds in results:
        table = ds.phasekit.table()
        assert len(table), ds
        assert not [name for name in table if "phi" in name]
        for name in map(str, ds.data_vars):
            if "phi" in name and not name.endswith(("_error", "_kind")):
                twin = ds[name.replace("phi", "x")]
                np.testing.assert_array_equal(twin, ds[name])
    assert {"x", "x_error"} <= set(results[0].phasekit.table())
    assert "critical_fold_x" in results[5].phasekit.table()
    assert "units" not in results[2].state_x.attrs


def test_points_of_branches_have_one_row_each():
    hopf = pk.Problem(
        {"x": "m*x - y - x*(x^2 + y^2)", "y": "x + m*y - y*(x^2 + y^2)"}, parameters={"m": -0.5}
    )
    branch = pk.continuation(hopf, "m", x0=[0.0, 0.0], span=(-1.0, 1.0))
    cycles = branch.special("H")[0].switch()
    for one in (branch, cycles):
        table = one.points.phasekit.table()
        assert len(table) == one.points.sizes["point"]
        np.testing.assert_array_equal(table["m"], one.points.m)
    np.testing.assert_array_equal(table["multiplier 2"], cycles.points.multiplier[:, 1])
    for one in (branch.points, cycles.points, cycles.points[["m", "period", "multiplier"]]):
        frame = one.to_dataframe()
        assert len(frame) == one.sizes["point"]
        assert "m" in frame
        assert {*frame.columns}.issuperset(n for n in one.data_vars if one[n].dims == ("point",))
    np.testing.assert_array_equal(frame["multiplier 2"], cycles.points.multiplier[:, 1])
    tangent = branch.points.to_dataframe()["tangent m"]
    np.testing.assert_array_equal(tangent, branch.points.tangent.sel(unknown="m"))
    kept = pickle.loads(pickle.dumps(cycles.points))
    assert kept.identical(cycles.points)
    assert len(kept.to_dataframe()) == len(table)
    assert len(branch.points.stack(entry=["point", "unknown"]).to_dataframe()) == 3 * tangent.size
    assert len(branch.to_dataset().phasekit.table()) == len(branch.special_points)
    for one in (branch, cycles):  # what is done to what was handed out stays there
        handed, before = one.points, one.points.copy(deep=True)
        handed["m"].attrs["units"], handed.attrs["title"], handed["new"] = "s", "new", 1.0
        assert type(one.points) is type(handed) is not xr.Dataset
        assert one.points.identical(before)
        with pytest.raises(ValueError, match="read-only"):
            handed["m"].values[0] = 1.0
        assert type(one.to_dataset()) is xr.Dataset


def test_dims_without_rows_come_last():
    """No jump happens: the steps are shown."""
    table = pk.quasi_static(pk.Coefficients(2.0, 1.0, 0.0), B=[1.0, 0.9]).phasekit.table()
    assert table.index.name == "step"
    assert len(table) == 2
