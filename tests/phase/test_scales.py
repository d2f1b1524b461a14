"""Potentials in any units of length and energy, and far from 0: the same answers in those units."""

import mpmath
import numpy as np
import pytest
from witnesses.variants import some

import phasekit as pk
from phasekit.errors import EquilibriumKind, OrbitKind, ParameterError
from phasekit.laws.formulas import read_formula, symbols_of
from phasekit.phase.numerical import functions
from phasekit.phase.numerical.formula import make_formula

CENTER, SADDLE = EquilibriumKind.CENTER, EquilibriumKind.SADDLE


def line(text, unit=1.0, level=1.0, origin=0.0, interval=None):
    place = f"((x - ({origin!r}))/{unit!r})" if origin else f"(x/{unit!r})"
    ends = None if interval is None else tuple(origin + unit * end for end in interval)
    return make_formula(f"{level!r}*({text.replace('u', place)})", "x", (), None, ends)


def quartic_period(power, start):
    """Period of x'' = -V' for V = x^power from rest at `start`."""
    with mpmath.workdps(30):
        quarter = mpmath.beta(mpmath.mpf(1) / power, mpmath.mpf(1) / 2) / power
        rate = mpmath.sqrt(2 * mpmath.mpf(start) ** power) / start
        return float(4 * quarter / rate)


@pytest.mark.slow
@pytest.mark.parametrize("power", [4, 6, 20])
@pytest.mark.parametrize("unit", [1e-30, 1e-9, 1.0, 1e9, 1e30])
def test_wells_without_a_bend_of_any_size(power, unit):
    if power * abs(np.log10(unit)) > 300:
        with pytest.raises(ParameterError, match="which is outside the range of doubles"):
            line(f"u^{power}", unit)
        return
    formula = line(f"u^{power}", unit)
    start = np.array([0.5, 1.2, 3.0])
    got = functions.orbits(formula, unit * start, 0.0)
    want = [quartic_period(power, a) for a in start]
    assert (got.orbit_kind == OrbitKind.LIBRATION).all()
    np.testing.assert_allclose(got.period / unit, want, rtol=1e-12)
    np.testing.assert_allclose(got.phi_min / unit, -start, rtol=1e-14)


START, SPEED = np.array([0.5, 1.2, 1.5]), np.array([0.1, 0.2, -0.3])


@pytest.fixture(scope="module")
def whole():
    """Orbits and angles of the double well in the units 1 and 1."""
    formula = line("u^4/4 - u^2/2")
    angle = functions.angles(formula, START, SPEED).angle
    assert np.isfinite(angle).all()
    return functions.orbits(formula, START, 0.0), angle


@pytest.mark.slow
@pytest.mark.parametrize(
    ("unit", "level"),
    some([(1e30, 1.0), (1e-30, 1.0), (1.0, 1e-200), (1.0, 1e200), (1e9, 1e-100)], 2),
)
def test_a_double_well_in_any_units(unit, level, whole):
    formula = line("u^4/4 - u^2/2", unit, level)
    rate = np.sqrt(level) / unit
    loops = functions.separatrices(formula)
    np.testing.assert_allclose(loops.lobe_area, [[4 / 3 * unit**2 * rate] * 2], rtol=1e-13)
    orbits, want = whole
    here = functions.orbits(formula, unit * START, 0.0)
    np.testing.assert_allclose(here.period * rate, orbits.period, rtol=1e-12)
    np.testing.assert_allclose(here.phi_min / unit, orbits.phi_min, rtol=1e-12)
    angle = functions.angles(formula, unit * START, unit * rate * SPEED).angle
    np.testing.assert_allclose(angle, want, rtol=1e-12)


@pytest.mark.parametrize(("unit", "origin"), [(1.0, 1e3), (1.0, 1e6), (1e-6, 1.0)])
def test_a_double_well_far_from_0(unit, origin):
    formula = line("u^4/4 - u^2/2", unit, 1.0, origin)
    got = functions.equilibria(formula)
    off = 4.0 * np.spacing(origin) / unit
    np.testing.assert_allclose((got.phi - origin) / unit, [-1.0, 0.0, 1.0], atol=off)
    np.testing.assert_allclose(got.energy, [-0.25, 0.0, -0.25], atol=off)
    loops = functions.separatrices(formula)
    np.testing.assert_allclose(loops.lobe_area / unit, [[4 / 3, 4 / 3]], rtol=1e3 * off)
    orbit = functions.orbits(formula, origin + 1.5 * unit, 0.0)
    np.testing.assert_allclose((orbit.phi_min - origin) / unit, -1.5, rtol=10.0 * off)


def test_the_energy_of_expanded_polynomials_is_rounded_once():
    """V(0) = 1e24/4 - 1e12/2 beside differences of 1/4: exactly what the doubles say."""
    got = functions.equilibria(line("(u - 1)^2*(u + 1)^2/4 - 1/4 + pi*0", 1.0, 1.0, 1e6))
    np.testing.assert_allclose(got.energy, [-0.25, 0.0, -0.25], atol=1e-9)


@pytest.mark.parametrize("origin", [300.0, 1000.0, 1e6])
def test_exponentials_far_from_0(origin):
    """SymPy would make exp(-(x - 1000.0)) a number that no double holds times exp(-x)."""
    formula = line("(1 - exp(-u))^2", 1.0, 1.0, origin, (-2.0, 30.0))
    got = functions.equilibria(formula)
    np.testing.assert_allclose(got.phi, [origin])
    assert got.kind.tolist() == [CENTER]
    with mpmath.workdps(30):
        want = float((1 - mpmath.exp(-20)) ** 2)
    assert formula.values(origin + 20.0) == pytest.approx(want, rel=1e-15)
    orbit = functions.orbits(formula, origin + 1.0, 0.0)
    depth = 1.0 - (1.0 - np.exp(-1.0)) ** 2
    assert orbit.period == pytest.approx(2.0 * np.pi / np.sqrt(2.0 * depth), rel=1e-9)


def test_terms_that_no_double_holds_are_refused():
    """They would be gone, or have few digits."""
    for text in ("(x/1e-30)^-12 - (x/1e-30)^-6", "(x/1e30)^20", "1e-200*(1e-115*x^2)"):
        with pytest.raises(ParameterError, match="which is outside the range of doubles"):
            pk.Potential(text, "x")
    pk.Potential("5e-324*x^2", "x")  # as it is given


@pytest.mark.parametrize("power", [20, 31])
@pytest.mark.parametrize("above", [1.0, 0.7, 7.3])
@pytest.mark.parametrize("below", [0.3, 5.1, 1.1e-2])
def test_powers_of_quotients_of_doubles(above, below, power):
    """Their fractions are longer than any double, but not larger."""
    formula = make_formula(f"1.0*(({above!r}*x/{below!r})^{power})", "x", (), None, None)
    with mpmath.workdps(50):
        want = float(power * (mpmath.mpf(above) / mpmath.mpf(below)) ** power)
        written = read_formula(formula.text, symbols_of(["x"]), exact=True)
    assert written == formula.expression
    np.testing.assert_allclose(formula.slopes(1.0), want, rtol=1e-14)


@pytest.mark.slow
def test_families_below_any_energy():
    """Neither the greatest energy that is asked for nor an offset of V merges wells."""
    well = pk.Potential("x^4/4 - x^2/2 + h*x", "x", {"h": 0.1})
    found = pk.orbit_families(well, 3, energy_max=1e15)
    assert found.family.values.tolist() == ["well_0", "well_2", "wells_0_2"]
    shallow = pk.Potential("1 + 1e-13*(x^4/4 - x^2/2 + 0.1*x)", "x")
    same, whole = pk.orbit_families(shallow, 3), pk.orbit_families(well, 3)
    assert same.family.values.tolist() == ["well_0", "well_2", "wells_0_2"]
    np.testing.assert_allclose(same.period * 1e-13**0.5, whole.period, rtol=1e-12)
    # An offset that is no term of its own takes the digits with it.
    hidden = pk.Potential("(1 + 1e-13*(x^4/4 - x^2/2 + 0.1*x))^2/2", "x", interval=(-3.0, 3.0))
    with pytest.warns(RuntimeWarning, match="period of .* values are NaN"):
        names = pk.orbit_families(hidden, 3).family.values.tolist()
    assert names == ["well_0", "well_2", "wells_0_2"]


@pytest.mark.parametrize("gap", [-1e-100, -1e-200, -1e-300, -1e-307])
def test_gaps_as_small_as_doubles(gap):
    """T = 2 K(m)/(a/sqrt 2) with 1 - m = b^2/a^2 and turning points b < a."""
    got = functions.orbits_at_gap(line("u^4/4 - u^2/2"), gap, saddle=0)
    with mpmath.workdps(330):
        root = mpmath.sqrt(1 + 4 * mpmath.mpf(gap))
        outer, inner = 1 + root, -4 * mpmath.mpf(gap) / (1 + root)
        want = float(2 * mpmath.ellipk(1 - inner / outer) / mpmath.sqrt(outer / 2))
    np.testing.assert_allclose(got.period, want, rtol=2e-14)


def test_gaps_without_digits_are_told():
    for system in (pk.Potential("x^4/4 - x^2/2", "x"), pk.Coefficients(-1.0, -1.0, 0.0)):
        with pytest.warns(RuntimeWarning, match="that doubles lose their digits"):
            found = pk.orbits(system, gap=[-5e-324, -1e-3])
        assert np.isnan(found.period.values).tolist() == [True, False]


def test_areas_that_are_not_known_are_told(monkeypatch):
    from phasekit.phase.numerical import separatrices

    defaults = {**separatrices.separatrices.__kwdefaults__, "worst": 0.0}
    monkeypatch.setattr(separatrices.separatrices, "__kwdefaults__", defaults)
    functions._surveyed.cache_clear()
    with pytest.warns(RuntimeWarning, match="lobe_area of Potential.*2 of 2 values are NaN"):
        found = pk.separatrices(pk.Potential("x^4/4 - x^2/2 + x^3/7", "x"))
    assert np.isnan(found.lobe_area.values).all()


def test_all_that_was_not_excluded_is_told():
    well = pk.Potential("-exp(-((x - 3.3)/0.05)^2)", "x", interval=(-10.0, 10.0))
    with pytest.warns(RuntimeWarning, match="between -10 and 1.93604, the widest of 2 such"):
        assert not pk.equilibria(well).complete
    odd = pk.Potential("Piecewise((cos(x), x < 20), (1, True))", "x", interval=(1.0, 9.0))
    with pytest.warns(RuntimeWarning, match="because no bounds of Piecewise are known"):
        np.testing.assert_allclose(pk.equilibria(odd).phi, [np.pi, 2.0 * np.pi])


def test_functions_that_return_none_are_named():
    def nothing(x, mu):
        mu - x[0]

    def one(x, mu):
        return [mu - x[0]]

    for f, jac, name in ((nothing, None, "f"), (one, nothing, "jac")):
        problem = pk.Problem(f, ["x"], {"mu": 1.0}, jac=jac)
        with pytest.raises(ParameterError, match=f"^{name}: returned None at x0, wants numbers"):
            pk.continuation(problem, "mu", x0=[1.0], span=(-1.0, 1.0))
    with pytest.raises(ParameterError, match="of type function, wants .* take pk.Problem"):
        pk.Potential(one, "x")
