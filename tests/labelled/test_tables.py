"""Results as tables for reading."""

import numpy as np
import pytest

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
