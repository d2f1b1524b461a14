"""The table of quantities is what every labelled result follows."""

import numpy as np
import pytest

import phasekit as pk
from phasekit.labels.coordinates import LABELS, STATES
from phasekit.laws.ladder import Standing
from phasekit.laws.trigonometric import Trigonometric
from phasekit.phase.exact.phase_space import Equilibria, Separatrices
from phasekit.table import loads, motion, orbits, perturbed, phase_space, steady
from phasekit.table.quantities import ROWS, TABLE, select
from phasekit.table.row import Pass, Quantity

SUBJECTS = (loads, motion, orbits, perturbed, phase_space, steady)
C = pk.Coefficients(4.3, 1.2, 0.7)
DISK = pk.GyroRotorDisk(beta=0.3, e=0.0115, a=0.02, r=0.21, omega1=2.5)
RESULTS = {
    "equilibria": pk.equilibria(C),
    "separatrices": pk.separatrices(C),
    "sweep": pk.sweep(C, A=[1.0, 2.0], B=[3.0, 4.0]),
    "potential": pk.potential(C, [0.1, 0.2]),
    "gradient": pk.gradient(C, 0.1),
    "curvature": pk.curvature(C, 0.1),
    "energy": pk.energy(C, 0.1, 0.2),
    "phase_velocity": pk.phase_velocity(C, 0.1, [0.2, 9.0]),
}
VARIABLES = [(name, variable) for name, ds in RESULTS.items() for variable in ds.data_vars]


def same_attrs(left, right):
    assert left.keys() == right.keys()
    for key, value in left.items():
        np.testing.assert_array_equal(value, right[key])
        assert getattr(value, "dtype", None) == getattr(right[key], "dtype", None)


@pytest.mark.parametrize(("name", "variable"), VARIABLES)
def test_variables_follow_from_their_rows(name, variable):
    result, row = RESULTS[name][variable], ROWS[variable]
    assert result.dtype == np.dtype(row.dtype)
    assert result.dims[result.ndim - len(row.dims) :] == row.dims
    assert not set(result.dims[: result.ndim - len(row.dims)]) & set(LABELS)
    same_attrs(result.attrs, row.attrs)
    assert "_FillValue" not in result.attrs
    assert "_FillValue" not in result.encoding


@pytest.mark.parametrize("row", ROWS.values(), ids=lambda row: row.name)
def test_rows_are_complete(row):
    assert row.units
    assert row.long_name
    assert row.equation
    assert "[" in row.source
    assert row.units == "1" or row.dtype == "float64"
    if row.flags is not None:
        assert row.attrs["flag_values"].dtype == np.int8
        meanings = row.attrs["flag_meanings"].split()
        for value, meaning in zip(row.attrs["flag_values"], meanings, strict=True):
            assert row.flags(value).name.lower() == meaning


def test_names_are_unique_and_distinct_from_dims_and_parameters():
    rows = [row.name for subject in SUBJECTS for row in subject.QUANTITIES]
    assert len(rows) > 80
    assert sorted(rows) == sorted(ROWS)  # none twice, which one dict would hide
    from phasekit.systems.registry import models

    parameters = {p.name for model in models().values() for p in model.declared}
    # Lyapunov exponents are counted on a dim of this name; a saddle's stands in other results.
    dims = set(LABELS) - {"exponent"}
    assert not set(ROWS) & (dims | parameters | set(STATES))


def test_rows_and_fields_of_the_floor_below_are_the_same():
    assert {r.name for r in select("equilibria")} == set(Equilibria._fields)
    rows = (r for r in select("separatrices") if Standing(Trigonometric).is_within(r.of))
    assert {r.name for r in rows} == set(Separatrices._fields)


def test_groups_share_one_pass():
    assert [p.groups for p in TABLE.plan(select(("equilibria", "separatrices")))] == [
        ("equilibria", "separatrices")
    ]
    assert [p.groups for p in TABLE.plan(select(("phi", "topology")))] == [
        ("equilibria", "separatrices")
    ]
    assert [p.groups for p in TABLE.plan(select("phi"))] == [("equilibria",)]


def test_quantities_reads_as_a_table_and_a_mapping():
    offered = pk.quantities()
    tilted = {"energy_per_turn", "lobe_area_error"}  # of systems under a torque
    assert set(offered.groups["separatrices"]) == set(Separatrices._fields) | tilted
    assert offered["winding_area"].units == "s-1"
    assert len(offered) == len(list(offered))
    assert "critical_fold" not in offered  # it needs the parameter to solve for
    lines = repr(offered).splitlines()
    assert len(lines) == len(offered) + 1
    assert lines[0].split() == ["quantity", "group", "dims", "units", "meaning"]
    assert [line.split()[0] for line in lines[1:]] == list(offered)
    column = lines[0].index("group")
    assert [line[column:].split()[0] for line in lines[1:]] == [r.group for r in offered.values()]


def test_a_new_row_needs_nothing_but_a_row_and_a_pass(monkeypatch):
    """Quantities of quantities, as forces at equilibria will be: parameters, states, results."""

    def heights(phi, e, beta):
        return -(e * np.sin(beta))[..., None] * np.cos(phi)

    row = Quantity(
        "height",
        "heights",
        ("equilibrium",),
        "float64",
        "m",
        "height",
        "-e sin(beta) cos(phi)",
        "-",
    )
    one = Pass(heights, ("phi", "e", "beta"), ("heights",))
    monkeypatch.setitem(ROWS, "height", row)
    monkeypatch.setattr(TABLE, "passes", (*TABLE.passes, one))
    ds = pk.sweep(DISK, beta=[0.1, 0.2], a=[0.0, 0.01], of=("heights", "phi", "energy"))
    expected = -DISK.e * np.sin(ds.beta) * np.cos(ds.phi)
    np.testing.assert_allclose(ds.height, expected, rtol=1e-15)
    assert ds.height.dims == ("beta", "a", "equilibrium")
    alone = pk.sweep(DISK, beta=[0.1, 0.2], a=[0.0, 0.01], of="height")
    assert set(alone.data_vars) == {"height"}
    np.testing.assert_array_equal(alone.height, ds.height)


def test_states_may_be_swept():
    ds = pk.sweep(DISK, beta=[0.1, 0.2], state_phi=[0.0, 1.0, 2.0], of=("potential", "phi"))
    assert ds.potential.dims == ("beta", "state_phi")
    assert ds.phi.dims == ("beta", "equilibrium")  # what does not depend on the state
    alone = pk.potential(DISK.replace(beta=0.2), 1.0)
    assert ds.potential.sel(beta=0.2, state_phi=1.0).item() == alone.potential.item()


def test_results_say_who_made_them_and_nothing_of_when():
    for ds in RESULTS.values():
        assert ds.attrs["phasekit_model"] == "Coefficients"
        assert ds.attrs["phasekit_schema"] == "1"
        assert ds.attrs["phasekit_version"] == pk.__version__
        assert set(ds.attrs) == {
            "phasekit_model",
            "phasekit_schema",
            "phasekit_version",
            "numpy_version",
            "llvmlite_version",
            "xarray_version",
        }
        assert all(type(value) is str for value in ds.attrs.values())
