"""The accessor: rebuilding systems from maps, and asking for pictures."""

import sys
import types

import numpy as np
import pytest
import xarray as xr

import phasekit as pk

DISK = pk.GyroRotorDisk(beta=0.3, e=0.0115, a=0.02, r=0.21, omega1=2.5, half_span=0.2)
MAP = pk.sweep(DISK, beta=np.linspace(0.1, 1.5, 5), a=[0.0, 0.01, 0.02])


def test_system_of_a_cell():
    cell = MAP.sel(beta=0.4, a=0.012, method="nearest")
    system = cell.phasekit.system()
    assert system == DISK.replace(beta=MAP.beta.values[1], a=0.01)
    assert pk.GyroRotorDisk.from_dataset(cell) == system
    xr.testing.assert_identical(pk.equilibria(system).phi, cell.phi)


def test_system_of_a_selection_keeps_its_axes():
    part = MAP.isel(beta=slice(1, 3), a=0)
    system = part.phasekit.system()
    assert system == DISK.replace(beta=MAP.beta.values[1:3], a=0.0)
    xr.testing.assert_identical(pk.equilibria(system).phi, part.phi)


def test_system_of_stacked_and_pointwise_selections():
    points = MAP.sel(
        beta=xr.DataArray([0.1, 1.5], dims="run"), a=xr.DataArray([0.0, 0.02], dims="run")
    )
    system = points.phasekit.system()
    np.testing.assert_array_equal(pk.equilibria(system).phi, points.phi)
    assert pk.equilibria(system).phi.dims == ("run", "equilibrium")


def test_accessor_is_stateless():
    accessor = MAP.phasekit
    assert accessor.system() == accessor.system()
    assert MAP.isel(beta=0).phasekit.system() != MAP.phasekit.system()
    assert list(vars(accessor)) == ["_ds"]


def test_it_says_what_a_map_holds_and_how_complete_it_is():
    lines = repr(MAP.phasekit.to(beta="deg").phasekit).splitlines()
    assert lines[0] == "map of GyroRotorDisk"
    assert lines[-1] == "all cells are computed"
    beta = np.degrees(MAP.beta.values)
    assert f"axis beta: {beta.size} values, {beta[0]:.6g} to {beta[-1]:.6g} deg" in lines
    shown = {line.split()[0] for line in lines[lines.index("quantities:") + 1 : -1]}
    assert shown == set(MAP.data_vars)
    part = pk.sweep(pk.Reduced(0.1, 0.2), psi=[0.1, 0.2, 0.3])
    part = part.assign(computed=("psi", [True, False, False]))
    assert repr(part.phasekit).endswith("1 of 3 cells are computed: 'computed' says which")
    text = repr(pk.equilibria(pk.Potential("m*x**2/2 - x**4", "x", {"m": [1.0, 2.0]})).phasekit)
    assert "axis m: 2 values, 1 to 2" in text
    assert "not a map that phasekit made" in repr(xr.Dataset().phasekit)


def test_datasets_of_others_are_refused_when_asked():
    other = xr.Dataset({"x": ("t", [1.0, 2.0])})
    with pytest.raises(pk.ParameterError, match="without the attribute 'phasekit_model'"):
        other.phasekit.system()
    with pytest.raises(pk.ParameterError, match="no coordinate 'e', which the model needs"):
        MAP.drop_vars("e").phasekit.system()
    with pytest.raises(pk.ParameterError, match="no coordinate 'beta'"):
        MAP.isel(beta=0, drop=True).phasekit.system()
    with pytest.raises(pk.ParameterError, match=r"got a map of GyroRotorDisk, wants one of Redu"):
        pk.Reduced.from_dataset(MAP)
    with pytest.raises(pk.ParameterError, match="a map of the model 'Rocket'"):
        MAP.assign_attrs(phasekit_model="Rocket").phasekit.system()
    with pytest.raises(pk.ParameterError, match="schema '7'"):
        MAP.assign_attrs(phasekit_schema="7").phasekit.system()
    with pytest.raises(pk.ParameterError, match="ds: got a DataArray"):
        pk.GyroRotorDisk.from_dataset(MAP.phi)


def test_an_invalid_cell_has_no_system():
    ds = pk.sweep(DISK, beta=[0.1, 4.0])
    with pytest.raises(pk.ParameterError, match="beta: got 4.0, wants a number from 0") as error:
        ds.isel(beta=1).phasekit.system()
    assert "\n" not in str(error.value)


@pytest.fixture
def drawn(monkeypatch):
    calls = []
    module = types.ModuleType("phasekit.plot")
    names = ("phase_portrait", "potential_well", "period_energy", "frequency_action")
    for name in (*names, "bifurcation_diagram", "parameter_map"):
        setattr(module, name, lambda *a, _name=name, **k: calls.append((_name, a, k)) or _name)
    monkeypatch.setitem(sys.modules, "phasekit.plot", module)
    return calls


def test_plots_are_asked_of_the_floor_above(drawn):
    cell = MAP.isel(beta=1, a=1)
    assert cell.phasekit.plot.phase_portrait(angles="deg") == "phase_portrait"
    assert drawn[-1] == ("phase_portrait", (cell.phasekit.system(),), {"angles": "deg"})
    assert cell.phasekit.plot.potential_well() == "potential_well"
    assert cell.phasekit.plot.period_energy() == "period_energy"
    assert cell.phasekit.plot.frequency_action() == "frequency_action"
    MAP.phasekit.plot.parameter_map("topology", x="a")
    assert drawn[-1][0] == "parameter_map"
    assert drawn[-1][1][0] is MAP
    assert drawn[-1][1][1:] == ("topology",)
    assert drawn[-1][2] == {"x": "a"}
    MAP.isel(a=0).phasekit.plot.bifurcation_diagram(x="beta")
    assert drawn[-1][0] == "bifurcation_diagram"


def test_a_portrait_is_of_one_cell(drawn):
    with pytest.raises(pk.ParameterError, match=r"several cells along beta, a.*ds\.sel\(beta="):
        MAP.phasekit.plot.phase_portrait()
    assert not drawn
