"""`pk.Potential` goes through the labelled functions as every other system does."""

import pickle

import numpy as np
import pytest
import sympy as sp
import xarray as xr

import phasekit as pk
from phasekit.systems.potential import Potential

ABC = {"A": 2.1, "B": 0.9, "C": 0.35}
TEXT = "-B*cos(phi) + A/2*cos(phi)^2 - C*sin(phi)"
ROTOR = Potential(TEXT, "phi", ABC, period=2 * np.pi)
CLOSED = pk.Coefficients(**ABC)
WELL = Potential("x^4/4 - mu*x^2/2", "x", {"mu": 1.0})


def by_phi(ds):
    """The branches of a closed-form result from left to right, without labels."""
    order = np.argsort(ds.phi.values)
    return ds.isel(equilibrium=order[: int(ds.n_equilibria)])


def test_equilibria_are_those_of_the_closed_form():
    got, want = pk.equilibria(ROTOR), by_phi(pk.equilibria(CLOSED))
    assert got.n_equilibria.item() == 4
    assert got.equilibrium.values.tolist() == [0, 1, 2, 3]
    assert "fold_margin" not in got
    for name in ("phi", "energy", "curvature", "natural_frequency", "exponent"):
        np.testing.assert_allclose(got[name], want[name], rtol=1e-14, atol=1e-15)
        assert got[name].attrs["units"] == want[name].attrs["units"]
    np.testing.assert_array_equal(got.kind, want.kind)
    assert got.kind.attrs["flag_meanings"] == want.kind.attrs["flag_meanings"]


def test_separatrices_are_those_of_the_closed_form():
    got, want = pk.separatrices(ROTOR), pk.separatrices(CLOSED)
    want = want.isel(saddle=np.argsort(want.saddle_phi.values))
    assert got.figure_eight
    assert got.topology == want.topology
    assert list(got.side.values) == ["left", "right"]
    for name in want.data_vars:
        np.testing.assert_allclose(got[name], want[name], rtol=1e-13, atol=1e-15, err_msg=name)


STATES = {"phi0": [0.7, 2.8, -1.9, 0.2], "dphi0": [0.1, 0.0, 3.0, -2.2]}


def test_orbits_and_flow_are_those_of_the_closed_form():
    got, want = pk.orbits(ROTOR, **STATES), pk.orbits(CLOSED, **STATES)
    for name in want.data_vars:
        np.testing.assert_allclose(got[name], want[name], rtol=1e-13, err_msg=name)
    t = np.linspace(-30.0, 40.0, 14)
    got, want = pk.flow(ROTOR, **STATES, t=t), pk.flow(CLOSED, **STATES, t=t)
    assert got.motion_phi.dims == want.motion_phi.dims == ("point", "time")
    for name in want.data_vars:
        np.testing.assert_allclose(got[name], want[name], rtol=1e-11, atol=1e-12)


def test_orbits_of_given_energy_or_gap():
    energy = [-0.3, 0.0, 3.0]
    want = pk.orbits(CLOSED, energy=energy)
    np.testing.assert_allclose(pk.orbits(ROTOR, energy=energy).period, want.period, rtol=1e-13)
    points, labels = pk.equilibria(ROTOR), by_phi(pk.equilibria(CLOSED)).equilibrium.values
    for number in np.flatnonzero(points.kind == pk.EquilibriumKind.CENTER):
        bottom = points.energy.values[number] + 1e-3
        want = pk.orbits(CLOSED, energy=bottom, center=str(labels[number]))
        got = pk.orbits(ROTOR, energy=bottom, center=int(number))
        np.testing.assert_allclose(got.phi_min, want.phi_min, rtol=1e-12)
        np.testing.assert_allclose(got.action, want.action, rtol=1e-11)
        assert got.period.attrs["center"] == str(number)
    gap = [-1e-3, -1e-12, 1e-12]
    for side in ("left", "right"):
        want = pk.orbits(CLOSED, gap=gap, side=side)
        got = pk.orbits(ROTOR, gap=gap, side=side)
        np.testing.assert_allclose(got.period, want.period, rtol=1e-12)
        np.testing.assert_allclose(got.action, want.action, rtol=1e-12)
        np.testing.assert_array_equal(got.orbit_kind, want.orbit_kind)


def test_separatrix_motion_is_that_of_the_closed_form():
    t = np.linspace(-20.0, 30.0, 9)
    for side in ("left", "right"):
        want = pk.separatrix_motion(CLOSED, t, side=side)
        got = pk.separatrix_motion(ROTOR, t, side=side)
        for name in want.data_vars:
            np.testing.assert_allclose(got[name], want[name], rtol=1e-12, atol=1e-14)


@pytest.mark.parametrize("name", ["potential", "gradient", "curvature"])
def test_values_are_those_of_the_closed_form(name):
    phi = xr.DataArray([0.3, -2.0], dims="angle")
    got, want = (getattr(pk, name)(system, phi) for system in (ROTOR, CLOSED))
    (variable,) = want.data_vars
    np.testing.assert_allclose(got[variable], want[variable], rtol=1e-14)
    np.testing.assert_allclose(getattr(ROTOR, name)(phi.values), want[variable], rtol=1e-14)
    assert "cos(phi)" in got[variable].attrs["source"]


def test_energy_and_velocity_are_those_of_the_closed_form():
    for system in (ROTOR, CLOSED):
        assert pk.energy(system, 0.4, 1.1).energy_integral.item() == pytest.approx(
            0.605 - 0.9 * np.cos(0.4) + 1.05 * np.cos(0.4) ** 2 - 0.35 * np.sin(0.4), rel=1e-14
        )
    speed = pk.phase_velocity(ROTOR, 0.4, [2.0, -5.0]).phase_velocity
    assert speed[0] == pytest.approx(
        pk.phase_velocity(CLOSED, 0.4, 2.0).phase_velocity.item(), rel=1e-14
    )
    assert np.isnan(speed[1])


# --------------------------------------------------------------------- maps


def test_sweep_through_a_pitchfork():
    mu = np.array([-1.0, 0.0, 0.25, 4.0, np.nan])
    ds = pk.sweep(WELL, mu=mu)
    assert ds.n_equilibria.values.tolist() == [1, 1, 3, 3, -1]
    assert dict(ds.sizes) == {"mu": 5, "equilibrium": 3, "saddle": 1, "side": 2}
    np.testing.assert_allclose(ds.phi[2:4], [[-0.5, 0, 0.5], [-2, 0, 2]], rtol=1e-15)
    assert ds.kind.values[:2].tolist() == [[1, 0, 0], [3, 0, 0]]
    assert ds.topology.values.tolist() == [0, 0, 2, 2, -1]
    np.testing.assert_allclose(ds.lobe_area[2:4, 0, 0], 4 / 3 * mu[2:4] ** 1.5, rtol=1e-14)
    assert ds.isel(mu=3).phasekit.system() == WELL.replace(mu=4.0)
    np.testing.assert_array_equal(ds.phasekit.system().mu, mu)


def test_sweep_of_orbits_over_two_parameters():
    system = Potential("k*x^2/2 + b*x^4", "x", {"k": 1.0, "b": 0.0})
    ds = pk.sweep(system, k=[1.0, 4.0], b=[0.0, 1e-300], of="period", state_phi=0.3, state_dphi=0.0)
    assert ds.period.dims == ("k", "b")
    np.testing.assert_allclose(ds.period, [[2 * np.pi] * 2, [np.pi] * 2], rtol=1e-14)


@pytest.mark.slow
def test_maps_are_stored_and_read_as_they_were(tmp_path):
    ds = pk.sweep(WELL, mu=[-0.5, 1.5])
    pk.sweep(WELL, mu=[-0.5, 1.5], store=tmp_path / "map.zarr")
    again = pk.open_map(tmp_path / "map.zarr")
    xr.testing.assert_identical(again.load(), ds)
    assert again.phasekit.system().replace(mu=1.0) == WELL


def test_numbers_in_the_formula_keep_their_digits_in_maps():
    system = Potential(0.1 * sp.Symbol("y") ** 2 + sp.Float(1 / 3) * sp.Symbol("y"), sp.Symbol("y"))
    again = pk.equilibria(system).phasekit.system()
    assert again.potential(1.7) == system.potential(1.7)
    assert again.coordinate == "y"


def test_arrays_of_parameters_broadcast_against_states():
    system = WELL.replace(mu=xr.DataArray([1.0, 4.0], dims="case"))
    ds = pk.orbits(system, [0.5, 3.0], 0.0)
    assert ds.period.dims == ("case", "point")
    one = pk.orbits(WELL.replace(mu=4.0), [0.5, 3.0], 0.0)
    np.testing.assert_allclose(ds.period[1], one.period, rtol=1e-15)


def test_units_of_a_line_are_not_angles():
    assert pk.equilibria(WELL).phi.attrs["units"] == "1"
    assert pk.equilibria(ROTOR).phi.attrs["units"] == "rad"
    assert "angle" not in pk.separatrices(WELL).turning_offset.attrs["long_name"]


# --------------------------------------------------------------------- the object


def test_a_potential_is_a_value():
    same = Potential("x**4/4 - x**2*mu/2", sp.Symbol("x"), {"mu": 1})
    assert same == WELL
    assert hash(same) == hash(WELL)
    assert pickle.loads(pickle.dumps(WELL)) == WELL
    assert repr(WELL) == "Potential('-mu*x**2/2 + x**4/4', 'x', {'mu': 1.0})"
    assert eval(repr(ROTOR), {"Potential": Potential}) == ROTOR
    assert WELL.replace(mu=2.0) != WELL
    assert WELL.replace(interval=(-1, 1)).interval == (-1.0, 1.0)
    assert WELL.mu == 1.0
    with pytest.raises(AttributeError, match="is frozen"):
        WELL.mu = 2.0
    with pytest.raises(AttributeError, match="no attribute 'nu'"):
        WELL.nu  # noqa: B018


def test_names_that_sympy_takes_for_functions_are_parameters():
    system = Potential("beta*x^2/2 + E*S*x", "x", {"beta": 2.0, "E": 1.0, "S": 3.0})
    assert pk.equilibria(system).phi.values.tolist() == [-1.5]


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: Potential("k*x^2", "x"), "unknown symbol k"),
        (lambda: Potential("x^2", "x", period=3.0), "period: got 3.0, over which x"),
        (lambda: Potential("x*cos(x)", "x", period=6.283185307179586), "does not repeat"),
        (lambda: Potential("x^2", "x", {"time": 1.0}), "wants another name"),
        (lambda: Potential("x^2", "x", {"x": 1.0}), "other than the coordinate's"),
        (lambda: Potential("x^2", "lambda"), "lambda is a keyword of Python: use lam"),
        (lambda: Potential("x^2", "x", {"k": "one"}), "^k: got 'one'"),
        (lambda: Potential("x^2", "x", [1.0]), "^parameters: got"),
        (lambda: Potential("x^2", "x", interval=(1.0, 1.0)), "low < high"),
        (lambda: Potential("cos(x)", "x", period=7.0, interval=(0, 1)), "None on a circle"),
        (lambda: Potential("x^2", "x", period=-1.0), "^period: got -1.0"),
        (lambda: Potential(None, "x"), "^expression: got None"),
        (lambda: Potential("sqrt(-1)*x", "x"), "a real function"),
        (lambda: WELL.replace(nu=1.0), "parameter of Potential 'nu' is unknown"),
        (lambda: WELL.replace(mu=[1.0, 2.0]).potential(0.0), "wants a scalar"),
        (lambda: pk.equilibria(Potential("cos(x)", "x")), "^interval: got None"),
        (lambda: pk.orbits(WELL, energy=1.0, center="lower_center"), "^center: got 'lower_center'"),
        (lambda: pk.orbits(WELL, gap=1.0, saddle=-1), "^saddle: got -1"),
        (lambda: pk.separatrix_motion(WELL, 0.0, side="up"), "^side: got 'up'"),
        (lambda: pk.critical(WELL, "lam"), "parameter of critical for Potential 'lam' is unknown"),
        (lambda: pk.critical(WELL, "mu"), "^span: got None"),
        (lambda: pk.quasi_static(ROTOR, c=[0.1, 0.2]), "parameter of Potential .c. is unknown"),
        (lambda: pk.state_of(ROTOR, 0.1, 0.2, "outer"), "^family: got .outer., wants one of"),
        (lambda: ROTOR.reduced(), "a system with coefficients"),
        (
            lambda: pk.sweep(WELL, mu=[1.0, 2.0], of="fold_margin"),
            "quantities that a Potential has",
        ),
        (lambda: pk.sweep(WELL, nu=[1.0]), "'nu' is unknown"),
    ],
)
def test_what_cannot_be_is_refused(make, message):
    with pytest.raises(pk.ParameterError, match=message):
        make()


def test_the_problem_of_a_potential_is_its_equation_of_motion():
    problem = WELL.problem()
    assert problem.parameters == {"mu": 1.0}
    np.testing.assert_allclose(problem(np.array([0.7, 0.2])), [0.2, 0.7 - 0.7**3], rtol=1e-15)
    with pytest.raises(pk.ParameterError, match="wants a scalar"):
        WELL.replace(mu=[1.0, 2.0]).problem()


# --------------------------------------------------------------------- formulas and names


@pytest.mark.slow
@pytest.mark.parametrize("name", ["x0", "x1", "sin", "select", "array", "pi", "_p0", "float", "z"])
def test_names_that_generated_code_uses_are_parameters(name):
    """Common parts of code are called x0, x1, ...; functions by their names."""
    plain = "cos(x)*exp(k + cos(x)) + k*cos(x)^2"
    other = plain.replace("k", name)
    want = Potential(plain, "x", {"k": 0.7}, interval=(-1, 1))
    for system in (
        Potential(other, "x", {name: 0.7}, interval=(-1, 1)),
        Potential(other.replace("x", "#").replace("e#p", "exp").replace("#", "y"), "y",
                  {name.replace("x", "y"): 0.7}, interval=(-1, 1)),
    ):  # fmt: skip
        for function in ("potential", "gradient", "curvature"):
            got = getattr(system, function)([0.3, -0.8])
            np.testing.assert_allclose(got, getattr(want, function)([0.3, -0.8]), rtol=1e-14)


def test_a_coordinate_that_generated_code_uses():
    system = Potential("cos(x0)*exp(cos(x0)) + cos(x0)^2", "x0", period=2 * np.pi)
    x = 0.3
    want = np.cos(x) * np.exp(np.cos(x)) + np.cos(x) ** 2
    assert system.potential(x) == pytest.approx(want, rel=1e-15)


def test_whole_numbers_beyond_int64_are_numbers():
    system = Potential("cos(10**30)*x^2 + 10**25*x/10**26 + x*123456789012345678901/3", "x")
    want = np.cos(1e30) * 4 + 0.2 + 2 * 123456789012345678901 / 3
    assert system.potential(2.0) == pytest.approx(want, rel=1e-14)


@pytest.mark.parametrize("period", ["2*pi", "6.283185307179586", sp.pi * 2, 2 * np.pi])
def test_periods_as_formulas(period):
    assert Potential("-cos(q)", "q", period=period).period == 2 * np.pi


@pytest.mark.parametrize(
    "period",
    ["x", "2*tau", "0", "-pi", "1/0", "", "9**9**9", "__import__('os')", 0, -1.0, np.nan, np.inf,
     10**400, True, [1.0], np.array([1.0]), 1j, {}],
)  # fmt: skip
def test_periods_that_are_none(period):
    with pytest.raises(pk.ParameterError, match="^period: got"):
        Potential("x^2", "x", period=period)


@pytest.mark.parametrize(
    "name", ["", "x y", "__x", "ｘ", "x" * 200, "x;y", None, 3, b"x", "lambda"]
)
def test_names_that_are_none(name):
    with pytest.raises(pk.ParameterError, match="^coordinate: got"):
        Potential("1", name)
    with pytest.raises(pk.ParameterError, match="^parameters: got"):
        Potential("x^2", "x", {name: 1.0})


@pytest.mark.slow
@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("__import__('os').system('true')*x", "^expression: got"),
        ("9**9**9*x", "exponent"),
        ("mo*x", "did you mean 'mu'"),
        ("zeta(x)", "unknown function zeta"),
        ("besselj(x, 2)", "real function of x that sympy can differentiate"),
        ("Abs(x)", "real function of x that sympy can differentiate"),
        ("*".join(f"(x + {i})" for i in range(300)), "too long, to differentiate"),
        ("sin(" * 63 + "x" + ")" * 63, "to differentiate"),
        ("1/(1 + " * 60 + "x" + ")" * 60, "to differentiate"),
    ],
)
def test_formulas_that_are_refused(text, message):
    with pytest.raises(pk.ParameterError, match=message):
        Potential(text, "x", {"muu": 1.0, "mu": 2.0})


def test_sums_that_multiplying_out_would_blow_up_are_not_multiplied_out():
    system = Potential("(a + b + c + d + x)^99", "x", dict.fromkeys("abcd", 0.2), interval=(-1, 1))
    assert system.gradient(0.2) == pytest.approx(99.0, rel=1e-13)
    with pytest.raises(pk.ParameterError, match="^interval: got None"):
        pk.equilibria(Potential("(a + b + c + d + x)^99", "x", dict.fromkeys("abcd", 0.2)))


def test_special_functions_go_through_the_labelled_functions():
    """V = -J_0, whose slope J_1 has its zeros where scipy has them."""
    from scipy.special import jn_zeros

    points = pk.equilibria(Potential("-besselj(0, x)", "x", interval=(-5.0, 9.0)))
    assert points.complete
    first = jn_zeros(1, 2)
    np.testing.assert_allclose(points.phi, [-first[0], 0.0, *first], atol=1e-13)


# --------------------------------------------------------------------- what is not proved


def test_results_say_how_sure_they_are():
    well = Potential("x^2/2 + 1/x^2", "x", interval=(1e-3, 3000.0))
    points = pk.equilibria(well)
    assert points.complete.item()
    assert points.complete.attrs["long_name"]
    orbit = pk.orbits(well, 300.0, 0.0)
    assert abs(orbit.period.item() - np.pi) <= orbit.period_error.item() + 1e-15
    assert orbit.period_error.attrs["units"] == "s"
    assert 0.0 < orbit.action_error < 1e-12 * orbit.action
    motion = pk.flow(well, 300.0, 0.0, [0.5 * np.pi, 10.0 * np.pi])
    late = np.abs(motion.motion_phi - [np.sqrt(2.0) / 300.0, 300.0])
    assert np.all(late <= motion.motion_phi_error + 1e-12)
    loops = pk.separatrices(WELL)
    assert np.all(np.abs(loops.lobe_area - 4 / 3) <= loops.lobe_area_error + 1e-15)


def test_what_is_not_proved_is_said():
    hidden = Potential("-exp(-((x - 3.3)/0.05)^2)", "x", interval=(-10.0, 10.0))
    with pytest.warns(RuntimeWarning, match="not proved that there are no others between -10 and"):
        points = pk.equilibria(hidden)
    assert not points.complete
    merged = pk.equilibria(Potential("exp(-x^4)", "x", interval=(-3.0, 2.5)))
    assert merged.kind.values.tolist() == [pk.EquilibriumKind.DEGENERATE]
    assert not merged.complete


def test_a_period_over_which_rounding_hides_everything_is_refused():
    with pytest.raises(pk.ParameterError, match="period: got 1e\\+300"):
        Potential("cos(x)", "x", period=1e300)


def test_names_of_error_estimates_are_taken():
    with pytest.raises(pk.ParameterError, match="results have 'complete'"):
        Potential("complete*x^2", "x", {"complete": 1.0})
