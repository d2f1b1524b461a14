"""What users pass for numbers: units, masks, foreign types; understood, or refused by name."""

from decimal import Decimal
from fractions import Fraction

import numpy as np
import pandas as pd
import pytest
import xarray as xr

import phasekit as pk
from phasekit.labels.arguments import number, numeric, pair, whole
from phasekit.mechanics.bearings import bearing_forces
from phasekit.mechanics.disk import disk_coefficients
from phasekit.mechanics.rotators import rotators

C = pk.Coefficients(4.3, 1.2, 0.7)
DISK = {"beta": 0.3, "e": 0.1, "a": 0.05, "r": 0.1, "omega1": 10.0}
DECLARED = {p.name: p.units for p in pk.GyroRotorDisk.declared}


def da(values, units, **coords):
    dims = list(coords) or ([] if np.ndim(values) == 0 else ["x"])
    return xr.DataArray(values, coords, dims, attrs={"units": units})


# ------------------------------------------------------------------------------ units


@pytest.mark.parametrize(
    ("name", "value", "units", "si"),
    [
        ("beta", 18.0, "deg", 18.0 * pk.deg),
        ("beta", 18.0, "degrees", 18.0 * pk.deg),
        ("beta", 0.3, "radian", 0.3),
        ("omega1", 24.0, "rpm", 24.0 * pk.rpm),
        ("omega1", 90.0, "deg/s", 90.0 * pk.deg),
        ("omega1", 2.5, "rad/s", 2.5),
        ("e", 1.153, "mm", 0.001153),
        ("r", 20.0, "cm", 0.2),
        ("m", 250.0, "g", 0.25),
        ("g", 9.81, "m/s^2", 9.81),
    ],
)
def test_units_of_parameters_are_honoured(name, value, units, si):
    assert getattr(pk.GyroRotorDisk(**{**DISK, name: da(value, units)}), name) == si
    several = getattr(pk.GyroRotorDisk(**{**DISK, name: da([value, value], units)}), name)
    assert several.values.tolist() == [si, si]
    assert several.attrs["units"] == DECLARED[name]


def test_units_of_an_axis_and_its_coordinate():
    degrees = da([10.0, 20.0], "deg", beta=[10.0, 20.0])
    for ds in (
        pk.equilibria(pk.GyroRotorDisk(**{**DISK, "beta": degrees})),
        pk.sweep(pk.GyroRotorDisk(**DISK), beta=degrees),
    ):
        assert ds.beta.values.tolist() == [10.0 * pk.deg, 20.0 * pk.deg]
        assert ds.beta.attrs["units"] == "rad"


def test_units_of_states_and_times():
    ds = pk.flow(C, da([30.0, 60.0], "deg"), da(3.0, "rpm"), da([0.0, 500.0], "ms").rename(x="s"))
    want = pk.flow(C, np.array([30.0, 60.0]) * pk.deg, 3.0 * pk.rpm, [0.0, 0.5])
    assert np.array_equal(ds.motion_phi.values, want.motion_phi.values)
    assert ds.state_phi.attrs["units"] == "rad"
    listed = pk.energy(C, [da(30.0, "deg"), da(0.5, "rad")], 0.0)
    assert listed.state_phi.values.tolist() == [30.0 * pk.deg, 0.5]


def test_units_of_two_degrees_of_freedom():
    rotor = pk.FreeGyroRotor(pk.GyroRotorDisk(**DISK, m=2.0), 0.1)
    assert rotor.energy(da(30.0, "deg"), 0.0) == rotor.energy(30.0 * pk.deg, 0.0)
    with pytest.raises(pk.ParameterError, match=r"^phi: got the attribute units='kg', wants"):
        rotor.energy(da(30.0, "kg"), 0.0)


@pytest.mark.parametrize("units", ["kg", "furlong", "s", "Hz", "deg/s"])
def test_units_that_do_not_fit_are_refused(units):
    match = rf"^phi: got the attribute units='{units}', wants units rad or deg"
    with pytest.raises(pk.ParameterError, match=match):
        pk.potential(C, da([0.1, 0.2], units))
    with pytest.raises(pk.ParameterError, match=rf"^beta: got the attribute units='{units}'"):
        pk.GyroRotorDisk(**{**DISK, "beta": da(0.1, units)})
    with pytest.raises(pk.ParameterError, match=rf"^beta: got the attribute units='{units}'"):
        pk.sweep(pk.GyroRotorDisk(**DISK), beta=da([0.1], units, beta=[0.1]))


def test_results_pass_back_in():
    ds = pk.equilibria(pk.Coefficients([4.3, 5.0], 1.2, 0.7))
    phi = ds.phi.sel(equilibrium="lower_center", drop=True)
    back = pk.orbits(C.replace(A=ds.A), phi, 0.1)
    assert np.isfinite(back.period).all()
    assert pk.orbits(C, energy=back.orbit_energy.rename(A="x")).period.shape == (2,)
    rows = pk.state_of(C, back.action.rename(A="x"), 0.3, "lower_well")
    assert np.isfinite(rows.phi_of_angle).all()


def test_a_potential_takes_any_known_unit_in_si():
    well = pk.Potential("k*x**2/2", "x", {"k": da(20.0, "mm")})
    assert well.k == 0.02
    assert pk.potential(well, da(5.0, "cm")).state_phi.item() == 0.05


def test_spans_have_units_too():
    disk = pk.GyroRotorDisk(**DISK)
    ds = pk.branches(disk, "beta", da([10.0, 80.0], "deg"))
    assert ds.beta.min() >= 10.0 * pk.deg
    assert ds.beta.max() <= 80.0 * pk.deg


# ------------------------------------------------------------------------------ masks


MASKED = np.ma.array([0.1, 0.2], mask=[False, True])


def test_masked_parameters_and_states_are_invalid_cells():
    ds = pk.equilibria(pk.GyroRotorDisk(**{**DISK, "a": MASKED}))
    assert ds.n_equilibria.values[1] == -1
    assert ds.n_equilibria.values[0] > 0
    assert np.isnan(pk.potential(C, MASKED).potential.values).tolist() == [False, True]
    assert np.isnan(pk.potential(C, [0.1, np.ma.masked]).potential.values).tolist() == [False, True]
    assert np.isnan(pk.flow(C, 0.1, 0.1, MASKED).motion_phi.values).tolist() == [False, True]
    assert np.isnan(pk.sweep(C, A=MASKED).energy.values).all(axis=1).tolist() == [False, True]


def test_a_masked_scalar_is_refused():
    with pytest.raises(pk.ParameterError, match=r"^phi: got a masked value, wants a finite number"):
        pk.potential(C, np.ma.masked)
    with pytest.raises(pk.ParameterError, match=r"^phi: got a masked value, wants a finite number"):
        pk.potential(C, np.ma.array(0.2, mask=True))


def test_masks_on_the_mechanics_floor():
    body = pk.RigidBody(MASKED, [0.0, 0.0, 0.0], np.eye(3))
    assert np.isnan(body.mass).tolist() == [False, True]
    center = np.ma.array(np.zeros((2, 3)), mask=[[0, 0, 0], [0, 1, 0]])
    assert np.isnan(pk.RigidBody(1.0, center, np.eye(3)).mass).tolist() == [False, True]
    machine = pk.CoupledRotation(body, n1=(0, 0, 1), n2=(1, 0, 0), a=1.0)
    state = machine.at(omega1=MASKED)
    assert np.isnan(state.linear_momentum).all(axis=-1).tolist() == [False, True]
    for value in (
        rotators(0.3, 0.1, 0.05, 0.1, 10.0, 9.81, MASKED, 2.0).hodograph_u,
        bearing_forces(0.3, 0.1, 0.1, 0.1, 9.0, 2.0, 9.81, 0.2, 0.1, MASKED).force_axial,
        disk_coefficients(MASKED, 0.1, 0.05, 0.1, 10.0)[0],
        rotators(0.3, 0.1, MASKED, 0.1, 10.0, 9.81, 0.5, 2.0).hodograph_u,
    ):
        assert np.isnan(value).tolist() == [False, True]


def test_named_dims_are_refused_where_axes_pair_by_place():
    x = xr.DataArray([1.0, 2.0], dims="x")
    machine = pk.CoupledRotation(
        pk.RigidBody(1.0, [0, 0, 0], np.eye(3)), n1=(0, 0, 1), n2=(1, 0, 0), a=1.0
    )
    for argument, call in {
        "mass": lambda: pk.RigidBody(x, [0, 0, 0], np.eye(3)),
        "omega1": lambda: machine.at(omega1=x),
        "phi": lambda: rotators(0.3, 0.1, 0.05, 0.1, 10.0, 9.81, x, 2.0),
        "beta": lambda: disk_coefficients(x, 0.1, 0.05, 0.1, 10.0),
    }.items():
        match = rf"^{argument}: got a DataArray .* pk\.rotators"
        with pytest.raises(pk.ParameterError, match=match):
            call()


def test_shapes_that_do_not_go_together_are_named():
    with pytest.raises(pk.ParameterError, match="phi.*dphi.*broadcast"):
        rotators(0.3, 0.1, 0.05, 0.1, 10.0, 9.81, [0.1, 0.2], [0.1, 0.2, 0.3])


# ------------------------------------------------------------------------------ other types


@pytest.mark.parametrize(
    "value",
    [
        [Fraction(1, 4), Decimal("0.5")],
        np.array([0.25, 0.5], np.float16),
        np.array([0.25, 0.5], np.longdouble),
        np.array([0.25, 0.5], ">f4"),
        np.array([0.5, 0.0, 0.25])[::-2],
        pd.Series([0.25, 0.5], index=["a", "b"]),
        pd.Index([0.25, 0.5]),
        np.array([0.25, 0.5], object),
    ],
    ids=lambda v: type(v).__name__,
)
def test_real_numbers_of_any_type(value):
    assert numeric("x", value).tolist() == [0.25, 0.5]
    assert numeric("x", value).dtype == np.dtype("f8")


def test_numbers_beyond_doubles():
    assert np.isinf(numeric("x", [1.0, 10**400])).tolist() == [False, True]
    with pytest.raises(pk.ParameterError, match=r"^x: got a whole number of 1329 bits, wants"):
        numeric("x", 10**400)
    with pytest.raises(pk.ParameterError, match=r"^x: got a whole number of 16610 bits"):
        whole("x", 10**5000, "a number")


@pytest.mark.parametrize(
    "value",
    [
        np.datetime64("2020-01-01"),
        np.timedelta64(1, "s"),
        np.array([1, 2], "timedelta64[s]"),
        {0.1, 0.2},
        (x for x in [0.1]),
        [0.1, True],
        [[0.1], [True]],
        [np.array(True), 0.1],
        np.zeros(2, "f8,f8"),
        xr.Variable("x", [0.1]),
        b"1",
        [0.1, [0.2]],
        np.array([1j]),
    ],
    ids=lambda v: type(v).__name__,
)
def test_what_is_no_real_number_is_refused(value):
    for call in (numeric, number):
        with pytest.raises(pk.ParameterError, match=r"^x: got .*, wants "):
            call("x", value)
    with pytest.raises(pk.ParameterError, match=r"^x0: got .*, wants "):
        pk.continuation(C, "A", x0=value, span=(1.0, 5.0))


def test_pairs_and_counts():
    assert pair("span", np.array([0, 1]), "two") == (0.0, 1.0)
    for wrong in ([1], [1, 2, 3], "ab", 1.0, [True, 2], None, {1, 2}, [[1, 2]]):
        with pytest.raises(pk.ParameterError, match="^span: got .*, wants two"):
            pair("span", wrong, "two")
    with pytest.raises(pk.ParameterError, match="^span: got nan, wants a finite number"):
        pair("span", [1, np.nan], "two")
    for wrong in (2.5, -1, 0, True, "3", np.float64(3), np.timedelta64(3, "s"), None, [3]):
        with pytest.raises(pk.ParameterError, match="^n: got .*, wants one"):
            whole("n", wrong, "one")


def test_selections_of_pictures_are_checked():
    problem = pk.Problem("r + x**2", ("x",), {"r": -0.5})
    few = pk.ContinuationOptions(max_points=5)
    branch = pk.continuation(problem, "r", x0=[0.7], span=(-1.0, 0.5), options=few)
    with pytest.raises(pk.ParameterError, match=r"^sel: got 'abc', wants a mapping"):
        pk.plot.branch(branch, sel="abc")


def test_a_thousand_states_are_named_by_their_ends():
    """Messages and representations say how many there are, and do not list them all."""
    field = pk.Problem(lambda x, a: -a * x, [("u", 500), ("v", 500)], {"a": 1.0})
    assert repr(field).startswith("Problem((u: 500, v: 500)' = <lambda>(")
    for call in (
        lambda: pk.flow(field, x0=[1.0, 2.0], t=[0.0, 1.0]),
        lambda: pk.periodic_orbit(field, [1.0, 2.0]),
    ):
        with pytest.raises(pk.ParameterError, match="u_0, u_1, u_2, ..., v_499") as raised:
            call()
        assert len(str(raised.value)) < 200
