"""Datasets in other units, and what phasekit makes of them when it gets them back."""

import matplotlib
import matplotlib.pyplot as plt
import numpy as np
import pytest
import xarray as xr

import phasekit as pk

matplotlib.use("Agg")
DISK = pk.GyroRotorDisk(
    beta=0.7, e=0.05, a=0.024, r=0.2, omega1=300 * pk.rpm, m=2.0, half_span=0.15
)
BETA = np.linspace(0.0, 90.0, 10)
MAP = pk.sweep(DISK, beta=BETA * pk.deg, a=[0.0, 0.012, 0.024])
SHOWN = MAP.phasekit.to(beta="deg", omega1="rpm", a="mm", phi="deg")


def test_values_and_attributes_change_together():
    np.testing.assert_allclose(SHOWN.beta, BETA, rtol=4e-16)
    np.testing.assert_allclose(SHOWN.indexes["beta"], BETA, rtol=4e-16)
    assert SHOWN.a.values.tolist() == [0.0, 12.0, 24.0]
    assert SHOWN.omega1.item() == pytest.approx(300.0, rel=1e-15)
    np.testing.assert_allclose(SHOWN.phi, np.degrees(MAP.phi), rtol=4e-16)
    assert SHOWN.phi.dims == MAP.phi.dims
    units = {name: SHOWN[name].attrs["units"] for name in ("beta", "omega1", "a", "phi", "e")}
    assert units == {"beta": "deg", "omega1": "rpm", "a": "mm", "phi": "deg", "e": "m"}
    assert SHOWN.beta.attrs["long_name"] == MAP.beta.attrs["long_name"]
    assert list(SHOWN.data_vars) == list(MAP.data_vars)
    assert list(SHOWN.phi.coords) == list(MAP.phi.coords)
    assert MAP.beta.attrs["units"] == "rad"  # the first is as it was


def test_twice_is_once_and_back_is_back():
    names = {"beta": "deg", "omega1": "rpm", "a": "mm", "phi": "deg"}
    xr.testing.assert_identical(SHOWN.phasekit.to(names), SHOWN)
    xr.testing.assert_identical(SHOWN.phasekit.to(beta="degrees"), SHOWN)
    back = SHOWN.phasekit.to({"beta": "rad", "omega1": "s-1"}, a="m", phi="rad")
    for name in {*MAP.variables} - {*MAP.dims} | {"beta", "a"}:  # labels are texts
        np.testing.assert_allclose(back[name], MAP[name], rtol=4e-16)
    assert {name: back[name].attrs for name in names} == {name: MAP[name].attrs for name in names}
    sidewards = SHOWN.phasekit.to(omega1="deg/s").omega1
    assert sidewards.item() == pytest.approx(1800.0, rel=4e-16)
    xr.testing.assert_identical(MAP.phasekit.to(), MAP)


@pytest.mark.parametrize("select", [{"beta": 4, "a": 2}, {"a": 1}, {"beta": slice(2, 4)}, {}])
def test_systems_are_the_same_in_all_units(select):
    system, same = (ds.isel(select).phasekit.system() for ds in (MAP, SHOWN))
    for name, value in system.parameters.items():
        np.testing.assert_allclose(same.parameters[name], value, rtol=4e-16)
    given = pk.GyroRotorDisk.from_dataset(SHOWN.isel(select))
    assert given == same
    assert pk.equilibria(same).beta.attrs["units"] == "rad"


def test_points_of_a_map_are_the_same_system():
    along = {"beta": xr.DataArray([1, 4], dims="run"), "a": xr.DataArray([0, 2], dims="run")}
    system, same = (ds.isel(along).phasekit.system() for ds in (MAP, SHOWN))
    np.testing.assert_allclose(same.beta, system.beta, rtol=4e-16)
    np.testing.assert_allclose(same.a, system.a, rtol=4e-16)


def test_stacked_axes():
    stacked = SHOWN.isel(beta=[1, 4], a=[0, 2]).stack(run=("beta", "a"))
    wanted = MAP.isel(beta=[1, 4], a=[0, 2]).stack(run=("beta", "a")).phasekit.system()
    np.testing.assert_allclose(stacked.phasekit.system().beta, wanted.beta, rtol=4e-16)
    np.testing.assert_allclose(stacked.phasekit.to(beta="rad").beta, wanted.beta, rtol=4e-16)
    assert set(stacked.phasekit.to(phi="rad").xindexes) == set(stacked.xindexes)


def test_what_lies_along_an_axis_in_degrees_lies_along_it_in_radians():
    phi = SHOWN.isel(a=2).phi.sel(equilibrium="lower_center", drop=True)
    found = pk.potential(MAP.isel(a=2).phasekit.system(), phi)
    np.testing.assert_allclose(found.potential, MAP.isel(a=2).energy[:, 0], rtol=1e-12, atol=1e-9)
    assert found.beta.attrs["units"] == "rad"
    np.testing.assert_allclose(found.beta, MAP.beta, rtol=4e-16)
    alone = pk.potential(DISK, phi.rename(beta="run").assign_coords(run=phi.beta.values))
    assert "units" not in alone.run.attrs


@pytest.mark.parametrize("on", ["equilibria", "separatrix"])
def test_loads_are_the_same_in_all_units(on):
    name = "force_magnitude" if on == "equilibria" else "peak_force"
    wanted, found = (ds.phasekit.bearing_forces(on=on) for ds in (MAP, SHOWN))
    np.testing.assert_allclose(found[name], wanted[name], rtol=1e-10)
    assert np.isfinite(found[name]).any()
    assert found.beta.attrs["units"] == "rad"
    np.testing.assert_allclose(found.beta, MAP.beta, rtol=4e-16)


def test_motions_are_the_same_in_all_units():
    motion = pk.flow(DISK, 1.0, 0.2, np.linspace(0.0, 0.3, 7))
    shown = motion.phasekit.to(motion_phi="deg", motion_dphi="rpm", time="ms")
    assert shown.time.values[-1] == pytest.approx(300.0)
    wanted, found = (pk.bearing_forces(DISK, m) for m in (motion, shown))
    np.testing.assert_allclose(found.force, wanted.force, rtol=1e-12)
    assert found.time.attrs["units"] == "s"
    np.testing.assert_allclose(found.time, motion.time, rtol=4e-16)
    along = pk.rotators(DISK, shown.motion_phi, shown.motion_dphi)
    np.testing.assert_allclose(along.time, motion.time, rtol=4e-16)


PICTURES = {
    "parameter_map": lambda ds, **o: ds.phasekit.plot.parameter_map("fold_margin", **o),
    "bearing_load_map": lambda ds, **o: ds.phasekit.plot.bearing_load_map(**o),
    "bifurcation_diagram": lambda ds, **o: ds.isel(a=1).phasekit.plot.bifurcation_diagram(**o),
}


@pytest.mark.slow
@pytest.mark.parametrize("name", PICTURES)
def test_pictures_show_what_a_dataset_holds(name):
    """Degrees are never drawn under the name of radians."""
    asked = PICTURES[name](MAP, units={"beta": "deg", "a": "mm", "phi": "deg", "omega1": "rpm"})
    held = PICTURES[name](SHOWN)
    assert held.get_xlabel() == asked.get_xlabel()
    assert "(°)" in held.get_xlabel()
    np.testing.assert_allclose(held.get_xlim(), asked.get_xlim())
    np.testing.assert_allclose(held.get_ylim(), asked.get_ylim())
    plt.close("all")


def test_critical_values_in_degrees():
    folds = pk.critical(DISK.replace(beta=0.3), "beta").phasekit.to(critical_fold="deg")
    assert folds.critical_fold.attrs["units"] == "deg"
    np.testing.assert_allclose(folds.critical_fold, [53.7, 82.9], atol=0.05)


def test_results_that_are_lazy_stay_so():
    pytest.importorskip("dask")
    lazy = MAP.chunk({"beta": 5}).phasekit.to(phi="deg", beta="deg")
    assert lazy.phi.chunks is not None
    xr.testing.assert_identical(lazy.compute().phi, SHOWN.phi.assign_coords(lazy.phi.coords))


@pytest.mark.parametrize(
    ("units", "message"),
    [
        ({"bta": "deg"}, "variable or coordinate 'bta' is unknown; did you mean 'beta'"),
        ({"beta": "dge"}, "unit of beta: got 'dge', wants 'rad' or 'deg'.*did you mean 'deg'"),
        ({"omega1": "rmp"}, "unit of omega1: got 'rmp'.*did you mean 'rpm'"),
        ({"beta": "mm"}, "unit of beta: got 'mm'.*beta is in rad, which 'mm' does not measure"),
        ({"beta": "1"}, "unit of beta: got '1', wants 'rad'"),
        ({"beta": ""}, "unit of beta: got ''"),
        ({"beta": None}, "beta: got None, wants the name of a unit"),
        ({"beta": 57.3}, "beta: got 57.3, wants the name of a unit"),
        ({3: "deg"}, "variable or coordinate 3 is unknown"),
        ({"equilibrium": "deg"}, "equilibrium: got 'deg', wants a variable whose unit is known"),
        ({"kind": "deg"}, "unit of kind: got 'deg'"),
        (["beta"], "units: got .*, wants a mapping of names to units"),
    ],
)
def test_what_cannot_be_converted_is_refused(units, message):
    with pytest.raises(pk.ParameterError, match=message):
        MAP.phasekit.to(units)
    with pytest.raises(pk.ParameterError, match="beta: got it in units and as a keyword"):
        MAP.phasekit.to({"beta": "deg"}, beta="rad")


def test_variables_of_others():
    other = xr.Dataset({"x": ("t", [1.0]), "y": ("t", ["a"], {"units": "m"})})
    with pytest.raises(pk.ParameterError, match=r"it has no attribute units: ds\['x'\]"):
        other.phasekit.to(x="m")
    with pytest.raises(pk.ParameterError, match="wants a variable of numbers"):
        other.phasekit.to(y="mm")
    odd = xr.Dataset({"x": ("t", [1.0], {"units": "parsec"})})
    xr.testing.assert_identical(odd.phasekit.to(x="parsec"), odd)
    with pytest.raises(pk.ParameterError, match="unit of x: got 'm', wants 'parsec'"):
        odd.phasekit.to(x="m")


@pytest.mark.parametrize(("text", "parts"), [("0.5pi", 0.5), ("12pi/24", 0.5), ("1.5*pi/2", 0.75)])
def test_multiples_of_pi_of_several_digits(text, parts):
    disk = pk.GyroRotorDisk(beta=text, e=0.1, a=0.05, r=0.1, omega1=10.0)
    assert disk.beta == pytest.approx(parts * np.pi, rel=1e-15)
