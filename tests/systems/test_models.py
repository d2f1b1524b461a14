"""Systems: validation, copies, equality, and the coefficients that they reduce to."""

import copy
import pickle
from fractions import Fraction

import numpy as np
import pytest
import xarray as xr

import phasekit as pk
from phasekit.labels.arguments import numeric
from phasekit.mechanics.disk import disk_coefficients, disk_inertia
from phasekit.systems.registry import models

DISK = {"beta": 0.3, "e": 0.0115, "a": 0.02, "r": 0.21, "omega1": 2.5}

SYSTEMS = [
    pk.Coefficients(4.3, -1.2, 0.7),
    pk.GyroRotorDisk(**DISK),
    pk.GyroRotorDisk(**DISK, m=2.5, half_span=0.3, g=9.81),
    pk.Reduced(0.4, -0.3, 2.2),
    pk.ParticleOnCircle(radius=0.4, omega=3.1, tilt=0.2, offset=0.11, normal_offset=-0.07),
    pk.Pendulum(length=0.7),
    pk.StonerWohlfarth(K=1.7, h_x=0.4, h_y=-0.6),
]
ARRAYS = [
    pk.Coefficients([4.3, np.nan], -1.2, [0.7, 0.8, 0.9]),
    pk.GyroRotorDisk(**{**DISK, "beta": np.linspace(0.1, 1.5, 7)}),
    pk.Reduced(xr.DataArray([[0.1, 0.2]], dims=("x", "y")), 0.3),
]


@pytest.mark.parametrize("system", [*SYSTEMS, *ARRAYS], ids=repr)
def test_copies_are_equal_and_changes_are_not(system):
    assert pickle.loads(pickle.dumps(system)) == system
    assert copy.deepcopy(system) == system
    assert system.replace() == system
    name = next(iter(system.parameters))
    other = system.replace(**{name: 0.4321})
    assert other != system
    assert not other == system  # noqa: SIM201
    assert system.parameters[name] is not other.parameters[name]


@pytest.mark.parametrize("system", SYSTEMS, ids=repr)
def test_scalar_system_hashes_and_its_representation_evaluates_to_it(system):
    assert hash(system) == hash(system.replace())
    assert eval(repr(system), dict(models())) == system


def test_coefficients_are_a_tuple():
    c = pk.Coefficients(1, 2.5, Fraction(1, 2))
    assert c == (1.0, 2.5, 0.5)
    assert hash(c) == hash((1.0, 2.5, 0.5))
    A, B, C = c
    assert (A, B, C) == c
    assert c.coefficients() is c


def test_long_arrays_are_written_by_their_ends():
    assert "beta=<7 values, 0.1 to 1.5>" in repr(ARRAYS[1])
    assert repr(pk.Reduced([0.1, 0.2], 0.3)) == "Reduced(lam=[0.1, 0.2], psi=0.3, Omega_sq=1.0)"


def test_systems_are_frozen():
    disk = pk.GyroRotorDisk(**DISK)
    with pytest.raises(AttributeError):
        disk.beta = 0.2
    values = np.array([0.1, 0.2])
    swept = disk.replace(beta=values)
    values[0] = 3.0
    assert swept.beta[0] == 0.1
    with pytest.raises(ValueError, match="read-only"):
        swept.beta[0] = 3.0


def test_disk_coefficients_are_those_of_the_floor_below():
    disk = pk.GyroRotorDisk(**DISK, g=9.81)
    assert disk.coefficients() == tuple(float(x) for x in disk_coefficients(**DISK, g=9.81))
    inertia = disk.replace(m=2.5).inertia()
    assert inertia == tuple(float(x) for x in disk_inertia(2.5, 0.21, 0.0115, 0.3))
    assert inertia._fields == ("Ju", "Jv", "Jn", "Jvn")
    assert disk.eccentricity == pytest.approx(0.0115 * np.sin(0.3), rel=1e-15)
    assert disk.skew == pytest.approx(np.pi / 2 - 0.3, rel=1e-15)


def test_derived_values_of_arrays_are_labelled():
    disk = pk.GyroRotorDisk(**{**DISK, "beta": [0.1, 0.2], "e": [0.01, 0.02, 0.03], "m": 2.0})
    assert disk.eccentricity.dims == ("beta", "e")
    assert disk.eccentricity.name == "eccentricity"
    assert disk.skew.dims == ("beta",)
    assert disk.inertia().Jvn.dims == ("beta", "e")
    A, B, C = disk.coefficients()
    assert A.dims == B.dims == C.dims == ("beta", "e")
    one = disk.replace(beta=0.2, e=0.03).coefficients()
    assert tuple(x.sel(beta=0.2, e=0.03).item() for x in (A, B, C)) == one


def test_reduced_and_back():
    disk = pk.GyroRotorDisk(**DISK)
    A, B, C = disk.coefficients()
    assert disk.reduced() == pk.Reduced(B / A, C / A, A)
    assert disk.reduced().coefficients() == pytest.approx((A, B, C), rel=1e-15)
    swept = disk.replace(beta=[0.1, 0.2], omega1=[0.0, 1.5])
    assert np.isnan(swept.reduced().lam.sel(omega1=0.0)).all()
    assert np.isfinite(swept.reduced().lam.sel(omega1=1.5)).all()
    with pytest.raises(pk.ParameterError, match=r"A: got 0\.0.*\.coefficients\(\)"):
        pk.Pendulum(length=1.3).reduced()


def test_guises_are_the_same_equation():
    particle = pk.ParticleOnCircle(radius=0.4, omega=3.1, offset=0.11)
    disk = pk.GyroRotorDisk(beta=np.pi / 2, e=0.4, a=0.11, r=0.0, omega1=3.1)
    assert particle.coefficients() == pytest.approx(disk.coefficients(), rel=1e-14)
    tilted = pk.ParticleOnCircle(
        radius=0.4, omega=3.1, tilt=0.3, offset=0.11, normal_offset=0.07, g=9.81
    )
    A, B, C = tilted.coefficients()
    assert pytest.approx((3.1 * np.cos(0.3)) ** 2) == A
    assert pytest.approx(9.81 / 0.4 * np.cos(0.3) + 3.1**2 * 0.07 * np.sin(0.3) / 0.4) == B
    assert pytest.approx(3.1**2 * 0.11 / 0.4) == C
    assert pk.Pendulum(length=0.5, g=9.0).coefficients() == (0.0, 18.0, 0.0)
    magnet = pk.StonerWohlfarth(K=1.7, h_x=0.4, h_y=-0.6)
    phi = np.array([0.3, 1.9, -2.2])
    stored = 1.7 * np.sin(phi) ** 2 - 0.4 * np.cos(phi) + 0.6 * np.sin(phi)
    np.testing.assert_allclose(pk.potential(magnet, phi).potential + 1.7, stored, rtol=1e-14)


WRONG = [True, np.bool_(True), "three", b"0.3", None, 1j, np.nan, np.inf, -np.inf, 10**400]
WRONG += [[], np.array([]), [[1.0, 2.0]], np.ones((2, 2)), [1.0, None], [True, False], ["a"]]
WRONG += [np.array([1j]), {"a": 1}, object(), float, np.array(True), np.datetime64("2020-01-01")]
WRONG += [xr.DataArray([True]), xr.DataArray(["a"]), xr.DataArray(np.nan), xr.DataArray([1j])]

MEMBERS = [(s, n) for s in SYSTEMS[:1] + SYSTEMS[2:] for n in s.parameters]


@pytest.mark.slow
@pytest.mark.parametrize("wrong", WRONG, ids=[str(i) for i in range(len(WRONG))])
@pytest.mark.parametrize(("system", "name"), MEMBERS, ids=lambda x: x if x is str else str(x)[:12])
def test_every_wrong_value_of_every_parameter_is_named(system, name, wrong):
    if wrong is None and name in ("m", "half_span"):
        assert system.replace(**{name: None}).parameters.get(name) is None
        return
    with pytest.raises(pk.ParameterError, match=rf"^{name}: got .*, wants "):
        system.replace(**{name: wrong})


OUTSIDE = [
    (1, "beta", -0.1),
    (1, "beta", 3.2),
    (1, "e", -1e-9),
    (1, "r", -0.2),
    (1, "m", 0.0),
    (1, "m", -1.0),
    (1, "half_span", 0.0),
    (4, "radius", 0.0),
    (4, "radius", -0.4),
    (4, "tilt", 1.6),
    (4, "tilt", -1.6),
    (5, "length", 0.0),
]


@pytest.mark.parametrize(("index", "name", "value"), OUTSIDE)
def test_values_outside_the_domain_are_named(index, name, value):
    with pytest.raises(pk.ParameterError, match=rf"^{name}: got {value}, wants a number "):
        SYSTEMS[index].replace(**{name: value})


@pytest.mark.parametrize("degrees", [30, 30.0, 90, 180])
def test_degrees_are_recognised(degrees):
    with pytest.raises(pk.ParameterError, match=rf"beta: got {degrees}, .* radians.*\* pk\.deg"):
        pk.GyroRotorDisk(**{**DISK, "beta": degrees})
    assert pk.GyroRotorDisk(**{**DISK, "beta": degrees * pk.deg}).beta <= np.pi


@pytest.mark.parametrize(
    "zero", [{"e": 0.0, "r": 0.0}, {"beta": 0.0, "r": 0.0}, {"beta": np.pi, "r": 0.0}]
)
def test_disk_without_inertia_is_refused(zero):
    with pytest.raises(pk.ParameterError, match=r"^r: got 0\.0 together with"):
        pk.GyroRotorDisk(**{**DISK, **zero})
    swept = pk.GyroRotorDisk(**{**DISK, **zero, "r": [0.0, 0.1]})
    assert pk.equilibria(swept).n_equilibria.values.tolist()[0] == -1


def test_names_of_arguments_are_checked():
    with pytest.raises(pk.ParameterError, match="'betta' is unknown; did you mean 'beta'"):
        pk.GyroRotorDisk(betta=0.3, e=0.1, a=0.0, r=0.1, omega1=1.0)
    with pytest.raises(pk.ParameterError, match="missing a required.*'omega1'"):
        pk.GyroRotorDisk(beta=0.3, e=0.1, a=0.0, r=0.1)
    with pytest.raises(pk.ParameterError, match="too many positional"):
        pk.GyroRotorDisk(0.3, 0.1, 0.0, 0.1, 1.0)
    with pytest.raises(pk.ParameterError, match="'D' is unknown"):
        pk.Coefficients(1.0, 2.0, D=3.0)
    with pytest.raises(pk.ParameterError, match="missing a required.*'C'"):
        pk.Coefficients(1.0, 2.0)
    with pytest.raises(pk.ParameterError, match=r"'omega' is unknown; did you mean 'omega1'"):
        pk.GyroRotorDisk(**DISK).replace(omega=2.0)


def test_mass_is_needed_for_inertia():
    with pytest.raises(pk.ParameterError, match=r"^m: got None.*replace\(m="):
        pk.GyroRotorDisk(**DISK).inertia()


@pytest.mark.parametrize(
    "value", [3, 3.0, np.float32(3), np.int8(3), np.array(3), Fraction(3), xr.DataArray(3)]
)
def test_kinds_of_scalars(value):
    assert numeric("x", value) == 3.0
    assert type(numeric("x", value)) is float


@pytest.mark.parametrize("value", [[3, 4], (3, 4), range(3, 5), np.array([3, 4], dtype="f4")])
def test_kinds_of_arrays(value):
    kept = numeric("x", value)
    assert kept.dtype == np.float64
    assert kept.tolist() == [3.0, 4.0]


def test_masked_cells_become_invalid():
    kept = numeric("x", np.ma.array([1, 2], mask=[False, True]))
    np.testing.assert_array_equal(kept, [1.0, np.nan])


def test_dataarray_on_the_own_dim_is_an_axis():
    beta = xr.DataArray([0.1, 0.2], dims="beta")
    assert pk.GyroRotorDisk(**{**DISK, "beta": beta}) == pk.GyroRotorDisk(
        **{**DISK, "beta": [0.1, 0.2]}
    )
    degrees = beta.assign_coords(beta=[10.0, 20.0])
    with pytest.raises(pk.ParameterError, match=r"beta: .*coordinate 'beta' that equals"):
        pk.GyroRotorDisk(**{**DISK, "beta": degrees})
    with pytest.raises(pk.ParameterError, match="beta: .*the one dim"):
        pk.GyroRotorDisk(**{**DISK, "beta": xr.DataArray(np.ones((2, 2)), dims=("beta", "x"))})


def test_derived_values_are_invalid_where_the_disk_is():
    disk = pk.GyroRotorDisk(beta=[0.3, 5.0], e=0.01, a=0.0, r=0.2, omega1=1.0, m=2.0)
    for value in (*disk.inertia()[1:], disk.eccentricity, disk.skew, *disk.coefficients()):
        assert np.isnan(value.sel(beta=5.0))
        assert np.isfinite(value.sel(beta=0.3))
    heavy = disk.replace(beta=0.3, m=[1.0, -1.0]).inertia().Jn
    assert np.isnan(heavy).values.tolist() == [False, True]


def test_a_shaft_in_the_plane_of_the_disk_has_no_eccentricity():
    disk = pk.GyroRotorDisk(beta=np.pi, e=0.01, a=0.0, r=0.2, omega1=1.0, m=2.0)
    assert disk.eccentricity == 0.0
    assert disk.inertia().Jvn == 0.0


def test_what_a_system_derives_carries_units():
    disk = pk.GyroRotorDisk(beta=[0.3, 0.4], e=0.01, a=0.0, r=0.2, omega1=1.0, m=2.0)
    assert disk.coefficients().A.attrs["units"] == "s-2"
    assert disk.coefficients().A.beta.attrs["units"] == "rad"
    assert disk.inertia().Jn.attrs["units"] == "kg m2"
    assert disk.eccentricity.attrs["units"] == "m"
    assert disk.skew.attrs["units"] == "rad"
    assert disk.reduced().lam.attrs["units"] == "1"


@pytest.mark.parametrize(
    "system",
    [
        pk.GyroRotorDisk(beta=0.3, e=0.1, a=0.0, r=0.1, omega1=1e200),
        pk.Reduced(1e200, 1.0, 1e200),
        pk.Pendulum(length=1e-320),
        pk.StonerWohlfarth(K=1.2e308, h_x=1.0, h_y=0.0),
    ],
    ids=lambda system: type(system).__name__,
)
def test_scalars_whose_coefficients_overflow_are_refused(system):
    name = type(system).__name__
    for use in (type(system).coefficients, pk.equilibria, pk.separatrices):
        with pytest.raises(pk.ParameterError, match=f"{name}: got .* wants parameters of a size"):
            use(system)


def test_infinite_ratios_are_refused():
    with pytest.raises(pk.ParameterError, match="A: got 1e-310"):
        pk.Coefficients(1e-310, 1.0, 1.0).reduced()


def test_coefficients_stay_checked_when_they_are_made_as_tuples():
    with pytest.raises(pk.ParameterError, match="A: got nan"):
        pk.Coefficients(1, 2, 3)._replace(A=float("nan"))
    with pytest.raises(pk.ParameterError, match="A: got 'x'"):
        pk.Coefficients._make(["x", 2, 3])
    arrays = pk.Coefficients([1.0, 2.0], 1, 1)
    assert arrays != (1, 2, 3)
    assert hash(arrays) == hash(pk.Coefficients([1.0, 2.0], 1, 1))
    assert pk.Coefficients(1, 2, 3) == (1.0, 2.0, 3.0)


def test_pickled_systems_stay_frozen():
    again = pickle.loads(pickle.dumps(pk.Reduced([0.1, 0.2], 0.3)))
    with pytest.raises(ValueError, match="read-only"):
        again.lam[0] = 9.0


def test_equal_systems_have_equal_hashes():
    assert pk.Reduced([0.0], 1.0) == pk.Reduced([-0.0], 1.0)
    assert hash(pk.Reduced([0.0], 1.0)) == hash(pk.Reduced([-0.0], 1.0))


@pytest.mark.parametrize("beta", [30, 30.0, np.array(30.0), xr.DataArray(30.0), np.float32(30)])
def test_wrong_scalars_of_any_kind_are_shown_as_numbers(beta):
    with pytest.raises(pk.ParameterError, match=r"beta: got 30(\.0)?, .*: 30 \* pk\.deg$"):
        pk.GyroRotorDisk(beta=beta, e=0.1, a=0.0, r=0.1, omega1=1.0)


def test_no_hint_at_degrees_where_these_would_be_refused_too():
    with pytest.raises(pk.ParameterError, match="in radians$"):
        pk.GyroRotorDisk(beta=-0.1, e=0.1, a=0.0, r=0.1, omega1=1.0)
