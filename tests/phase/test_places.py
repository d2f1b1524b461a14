"""Equilibria of potentials are where they are said to be, within the error that is said."""

import os
import warnings
from fractions import Fraction

import mpmath
import numpy as np
import pytest
import sympy as sp
from hypothesis import given, settings
from hypothesis import strategies as st

import phasekit as pk
from phasekit.errors import EquilibriumKind
from phasekit.phase.numerical import functions
from phasekit.phase.numerical.digits import doubled, values
from phasekit.phase.numerical.formula import make_formula
from phasekit.phase.numerical.formula_bounds import slope_bounds
from phasekit.phase.numerical.systems import make_systems

EXAMPLES = int(os.environ.get("PHASEKIT_POTENTIALS", "30"))
CENTER, SADDLE = EquilibriumKind.CENTER, EquilibriumKind.SADDLE
X = sp.Symbol("x", real=True)


def expanded(*roots, doubles=True):
    """V with V' = (x - r1)(x - r2)..., multiplied out, its coefficients rounded to doubles."""
    slope = sp.prod([X - sp.Rational(r) for r in roots])
    terms = sp.Poly(sp.integrate(sp.expand(slope), X), X).terms()
    number = (lambda c: sp.Float(float(c))) if doubles else (lambda c: c)
    return sum(number(c) * X ** m[0] for m, c in terms)


def slope_of(expression):
    """V' of the doubles that stand in a formula, for 80 digits."""
    floats = expression.atoms(sp.Float)
    exact = expression.xreplace({f: sp.Rational(*float(f).as_integer_ratio()) for f in floats})
    known = {"airyaiprime": lambda z: mpmath.airyai(z, derivative=1)}
    return sp.lambdify(X, sp.diff(exact, X), [known, "mpmath"])


def true_error(slope, place, error):
    """How far the zero of V' that lies within an error of a place is from it, or None."""
    with mpmath.workdps(80):
        at, off = mpmath.mpf(float(place)), mpmath.mpf(float(error))
        low, high = at - off, at + off
        if slope(low) * slope(high) > 0:
            return None
        rising = slope(high) > 0
        for _ in range(40):  # 12 digits of the error
            middle = (low + high) / 2
            above = (slope(middle) > 0) == rising
            low, high = (low, middle) if above else (middle, high)
        return float(abs(low - at))


POLYNOMIALS = {
    "one well, far": expanded("1000"),
    "two": expanded("1/10", "3/10"),
    "four": expanded("1/10", "1", "7", "100"),
    "seven": expanded(*range(1, 8)),
    "nine": expanded("1/10", "1/2", 1, 2, 3, 5, 8, 13, 21),
    "far": sp.expand((X - 300) ** 2 * ((X - 300) ** 2 - 1)),
    "far, rounded": expanded(999, 1000, "10011/10"),
    "far, five": expanded(1000, 1001, 1002, 1003, 1004, doubles=False),
    "tiny unit": expanded("1/1000000000000", "3/1000000000000", "5/1000000000000"),
    "tiny unit, far": expanded("1001/10^14".replace("10^14", "1" + 14 * "0"), "1002/1" + 14 * "0"),
    "large unit": expanded(10**12, 3 * 10**12, 5 * 10**12),
    "high": 1e12 * expanded("1/10", 1, 7),
    "irrational": sp.expand(sp.sqrt(2) * (X - 300) ** 4 - sp.sqrt(3) * (X - 300) ** 2),
    **{f"pair 1e-{n}": expanded(1, f"1{'0' * (n - 1)}1/1{'0' * n}", 3) for n in range(3, 10)},
}
CIRCLE = {"period": 2.0 * np.pi}


def fold(off):
    """A Fourier sum with a pair of equilibria that merges at off = 0, and one at 0."""
    return sp.cos(2 * X) / 2 - sp.Float(2.0 * (1.0 - off)) * sp.cos(X)


def skew_fold(off):
    b = 0.5 ** (2.0 / 3.0)
    c = (1.0 - b) ** 1.5 * (1.0 - off)
    return sp.cos(X) ** 2 / 2 - sp.Float(0.5) * sp.cos(X) - sp.Float(c) * sp.sin(X)


def flat(off):
    """A center next to which V''' alone keeps V' from 0."""
    return sp.exp(X) - X - X**2 / 2 - X**3 / 6 + sp.Float(off) * X


OTHERS = {
    "Fourier sum": (-sp.cos(X) + 0.3 * sp.cos(2 * X) + 0.1 * sp.sin(X), CIRCLE),
    "high harmonics": (-sp.cos(X) + 0.8 * sp.cos(4 * X) + 0.1 * sp.sin(3 * X), CIRCLE),
    **{f"fold {d}": (fold(d), CIRCLE) for d in (1e-3, 1e-6, 1e-9, 1e-12, 1e-14)},
    **{f"skew fold {d}": (skew_fold(d), CIRCLE) for d in (1e-3, 1e-6, 1e-9, 1e-12, 1e-14)},
    **{f"flat {d}": (flat(d), {"interval": (-2.0, 2.0)}) for d in (1e-3, 1e-5, 1e-7, 1e-9)},
    "Morse": ((1 - sp.exp(1.3 - X)) ** 2, {"interval": (-1.0, 10.0)}),
    "walls": (
        sp.exp(20 * (X - 1)) + sp.exp(-20 * X) + 0.3 * sp.cos(7 * X),
        {"interval": (-0.5, 1.5)},
    ),
    "12-6": (4 * (X**-12 - X**-6), {"interval": (0.8, 3.0)}),
    "cancels": (
        1e8 * (sp.cos(X) - 1) + 5e7 * X**2 + X**2 / 2 - 0.3 * X,
        {"interval": (-1.0, 1.0)},
    ),
    "logarithm": (sp.log(sp.cosh(X - 5)) - 0.3 * X, {"interval": (0.0, 10.0)}),
    "far wells": (-sp.exp(-((X - 50) ** 2)) - 0.5 * sp.exp(-((X - 52) ** 2)),
                  {"interval": (45.0, 57.0)}),
    "far out": (sp.cos(X), {"interval": (1e6, 1e6 + 10.0)}),
    "special": (sp.besselj(0, X), {"interval": (0.5, 12.0)}),
    "slope without a double": (0.1 * X**3 - 0.7 * X, {}),
}  # fmt: skip
COUNTS = {"Fourier sum": 2, "high harmonics": 8, "Morse": 1, "walls": 1, "12-6": 1, "cancels": 1,
          "logarithm": 1, "far wells": 3, "far out": 4, "special": 3,
          "slope without a double": 2}  # fmt: skip


@pytest.mark.slow
@pytest.mark.parametrize("name", POLYNOMIALS)
def test_places_of_expanded_polynomials_have_all_digits(name):
    expression = POLYNOMIALS[name]
    points = pk.equilibria(pk.Potential(expression, X))
    slope = slope_of(expression)
    assert points.phi.size >= 1
    for place, error in zip(points.phi.values, points.phi_error.values, strict=True):
        off = true_error(slope, place, error)
        assert off is not None
        ulp = np.spacing(abs(place))
        assert 0.5 * ulp <= error <= 17.0 * ulp
        assert off <= max(ulp, np.nextafter(0.0, 1.0))


@pytest.mark.slow
def test_no_place_is_further_off_than_is_said_and_few_are_much_nearer():
    ratios = []
    for name, (expression, where) in OTHERS.items():
        points = pk.equilibria(pk.Potential(expression, X, **where))
        kinds = points.kind.values
        expected = COUNTS.get(name, 1 if name.startswith("flat") else 4)
        assert (points.phi.size, points.complete.item()) == (expected, True), name
        slope = slope_of(expression)
        for place, error, kind in zip(
            points.phi.values, points.phi_error.values, kinds, strict=True
        ):
            assert kind in (CENTER, SADDLE)
            assert error >= 0.5 * np.spacing(abs(place))
            off = true_error(slope, place, error)
            # Of a pair whose halves V' does not tell apart, both lie within it.
            assert off is not None or name.endswith("1e-14"), name
            if off is not None:
                ratios.append(error / max(off, 0.5 * np.spacing(abs(place)), 5e-324))
    assert len(ratios) > 50
    assert min(ratios) >= 1.0
    assert np.median(ratios) < 1e3


def test_an_error_of_what_has_merged_holds_all_that_may_be_there():
    """The true pair lies 1e-8 to either side of the one that is found."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", RuntimeWarning)
        points = pk.equilibria(pk.Potential(skew_fold(2e-16), X, **CIRCLE))
    assert not points.complete
    merged = points.kind.values == EquilibriumKind.DEGENERATE
    assert merged.sum() == 1
    place, error = points.phi.values[merged][0], points.phi_error.values[merged][0]
    slope = slope_of(skew_fold(2e-16))
    with mpmath.workdps(60):
        start = [mpmath.mpf(float(place)) + s * mpmath.mpf("1e-8") for s in (-1, 1)]
        pair = [mpmath.findroot(slope, (x, x * (1 + mpmath.mpf("1e-10")))) for x in start]
    assert pair[0] != pair[1]
    assert all(abs(float(root - mpmath.mpf(float(place)))) <= error for root in pair)
    assert error < 1e-6


@pytest.mark.slow
@settings(max_examples=EXAMPLES)
@given(
    st.lists(st.integers(-40, 40), min_size=1, max_size=6, unique=True),
    st.integers(-2000, 2000),
    st.integers(-30, 30),
)
def test_polynomials_change_the_sign_of_their_slope_within_the_error(roots, shift, unit):
    """In exact arithmetic, at both ends of what is said."""
    scale = Fraction(10) ** unit
    slope = [Fraction(1)]
    for root in roots:
        at = (Fraction(root) + Fraction(shift, 7)) * scale
        slope = [b - at * a for b, a in zip([*slope, 0], [0, *slope], strict=True)]
    slope = slope[::-1]  # lowest first
    height = [float(c / (k + 1)) for k, c in enumerate(slope)]
    text = " + ".join(f"({c!r})*x^{k + 1}" for k, c in enumerate(height) if c)
    points = pk.equilibria(pk.Potential(text, "x"))
    assert points.complete
    exact = [Fraction(c) * (k + 1) for k, c in enumerate(height)]
    assert points.phi.size >= len(roots) % 2

    def sign(x):
        return np.sign(sum(c * x**k for k, c in enumerate(exact)))

    simple = points.kind.values != EquilibriumKind.DEGENERATE
    up = np.where(points.kind.values == CENTER, 1, -1)
    for x, error, side in zip(
        points.phi.values[simple], points.phi_error.values[simple], up[simple], strict=True
    ):
        at, off = Fraction(float(x)), Fraction(float(error))
        assert error <= max(17.0 * np.spacing(abs(x)), 1e-300)
        assert sign(at - off) in (-side, 0)
        assert sign(at + off) in (side, 0)


@pytest.mark.parametrize("shift", [-1.9, 1.0])
def test_parameters_that_cancel_decide_no_kind(shift):
    """The sum of a, b, c, d as rounded, 0.1 or 3, is not what it is: -0.4 or 2.5."""
    own = {"a": 1e16, "b": 1.5, "c": -1e16, "d": shift}
    true = 1.5 + shift
    points = pk.equilibria(pk.Potential("x^4/4 + (a + b + c + d)*x^2/2", "x", own))
    assert points.complete
    want = [-np.sqrt(-true), 0.0, np.sqrt(-true)] if true < 0.0 else [0.0]
    np.testing.assert_allclose(points.phi.values, want, rtol=1e-15)
    np.testing.assert_allclose(points.curvature.values[len(want) // 2], true, rtol=1e-14)


def test_where_parameters_cancel_on_a_circle_nothing_is_proved():
    """-0.4 as above: at 0 there is a saddle, where doubles see a center."""
    own = {"a": 1e16, "b": 1.5, "c": -1e16, "d": -1.9}
    circle = pk.Potential("-(a + b + c + d)*cos(x)", "x", own, period="2*pi")
    with pytest.warns(RuntimeWarning, match="not proved"):
        points = pk.equilibria(circle)
    assert not points.complete
    assert not np.isin(points.kind.values, [CENTER, SADDLE]).any()
    assert pk.equilibria(circle.replace(d=1.0)).kind.values.tolist() == [CENTER, SADDLE]


def test_a_leading_coefficient_that_cancels_leaves_the_degree_open():
    """1e16 - 1 as a product of doubles, less 1e16, is 0 as rounded and -1 in truth."""
    own = {"a": 1e8 + 1.0, "b": 1e8 - 1.0, "c": 1e8}
    points = pk.equilibria(pk.Potential("(a*b - c^2)*x^4/4 + x^2/2", "x", own))
    np.testing.assert_array_equal(points.phi.values, [-1.0, 0.0, 1.0])
    assert points.kind.values.tolist() == [SADDLE, CENTER, SADDLE]


def test_slopes_are_bounded_with_the_digits_of_the_formula():
    """3 times the double 0.1 is no double."""
    found = slope_bounds(make_formula(sp.Float(0.1) * X**3, "x", (), None, None))
    ((low, high), _), _ = found((np.ones(1), np.ones(1)))
    assert Fraction(low[0]) <= 3 * Fraction(0.1) <= Fraction(high[0])
    assert 3.0 * 0.1 != float(low[0])


def test_values_in_double_double_arithmetic_have_30_digits():
    formula = make_formula("(x - 1/3)^7/(a + x^2) - 2*a*x", "x", ("a",), None, (0.0, 1.0))
    a, x = sp.Symbol("a", real=True), sp.Symbol("x", real=True)
    place, own = np.array([0.3333, -7.25, 812.5]), np.array([0.1, 3.7, 1e-8])
    systems, _ = make_systems(formula, (own,))
    found = doubled(systems, place, 0, 1, 2)
    for order, (high, low, _) in enumerate(found):
        true = formula.expression.diff(x, order)
        for i in range(3):
            numbers = {x: sp.Rational(place[i]), a: sp.Rational(own[i])}
            want = true.xreplace(numbers)
            off = sp.Rational(high[i]) + sp.Rational(low[i]) - want
            assert abs(off / want) < 1e-28


def test_values_of_other_formulas_have_30_digits_and_say_how_many():
    formula = make_formula("exp(-x^2)*besselj(0, a*x) - cos(x)^3", "x", ("a",), None, (0.0, 1.0))
    place, own = np.array([1e-9, 0.7, 5.25, np.nan]), np.array([3.7, 0.1, 1e-8, 1.0])
    systems, _ = make_systems(formula, (own,))
    assert doubled(systems, place, 0) is None
    found = values(systems, place, 0, 1)
    x, a = sp.symbols("x a", real=True)
    for order, (high, low, off) in enumerate(found):
        exact = sp.lambdify((x, a), formula.expression.diff(x, order), "mpmath")
        assert np.isnan(high[3])
        with mpmath.workdps(60):
            for i in range(3):
                want = exact(mpmath.mpf(place[i]), mpmath.mpf(own[i]))
                error = abs(mpmath.mpf(high[i]) + mpmath.mpf(low[i]) - want)
                assert error <= off[i] <= 1e-30 * abs(want) + 1e-60


def test_many_systems_have_the_places_of_each_alone():
    formula = make_formula("(x - c)^4/4 - (x - c)^2/2 - h*x", "x", ("c", "h"), None, None)
    c, h = np.linspace(0.0, 900.0, 300), np.linspace(-0.5, 0.5, 300)
    many = functions.equilibria(formula, c, h)
    assert many.phi.shape == (300, 3)
    for i in range(0, 300, 60):
        one = functions.equilibria(formula, c[i], h[i])
        count = one.phi.size
        for name in ("phi", "phi_error", "kind"):
            got = getattr(many, name)[i]
            np.testing.assert_array_equal(got[:count], getattr(one, name))
        assert np.isnan(many.phi_error[i, count:]).all()
    there = np.isfinite(many.phi)
    assert there.any(axis=1).all()
    assert not there.all()
    np.testing.assert_array_equal(np.isfinite(many.phi_error), there)


def test_systems_under_a_torque_and_maps_say_it_too():
    well = pk.Potential("x^4/4 - mu*x^2/2", "x", {"mu": 1.0})
    tilted = pk.equilibria(pk.Perturbed(well, torque=[0.0, 0.1, 10.0]))
    count = np.isfinite(tilted.phi_error).sum("equilibrium")
    assert count.values.tolist() == [3, 3, 1]
    np.testing.assert_array_equal(np.isfinite(tilted.phi_error), np.isfinite(tilted.phi))
    slope = slope_of(X**4 / 4 - X**2 / 2 - sp.Float(0.1) * X)
    for place, error in zip(tilted.phi.values[1], tilted.phi_error.values[1], strict=True):
        assert true_error(slope, place, error) <= np.spacing(abs(place))
    ds = pk.sweep(well, mu=[-1.0, 1.0, 2.0])
    assert ds.phi_error.dims == ("mu", "equilibrium")
    assert ds.phi_error.notnull().sum().item() == 7
    assert ds.phi_error.attrs["units"] == "1"
    angle = pk.equilibria(pk.Potential("-cos(q)", "q", period="2*pi"))
    assert angle.phi_error.attrs["units"] == "rad"


def test_maps_stored_without_errors_of_places_are_opened(tmp_path):
    pytest.importorskip("zarr")
    well = pk.Potential("x^4/4 - mu*x^2/2", "x", {"mu": 1.0})
    old = pk.sweep(well, mu=[-1.0, 1.0]).drop_vars("phi_error")
    old.to_zarr(tmp_path / "old.zarr", zarr_format=3, consolidated=False)
    with pk.open_map(tmp_path / "old.zarr") as back:
        assert "phi_error" not in back
        assert back.identical(old)
        assert back.phasekit.system() == well.replace(mu=[-1.0, 1.0])


@pytest.mark.slow
def test_energies_and_curvatures_of_expanded_polynomials_have_all_digits():
    """The constant of 8.1e9 is taken out of V, and cancels in what is said of it."""
    far = sp.expand((X - 300) ** 2 * ((X - 300) ** 2 - 1) + sp.Rational(7, 2))
    for expression in (far, POLYNOMIALS["far, rounded"] + sp.Float(1e-3), POLYNOMIALS["nine"]):
        system = pk.Potential(expression, X)
        points = pk.equilibria(system)
        assert points.phi.size >= 3
        for order, name in ((0, "energy"), (2, "curvature")):
            for place, value in zip(points.phi.values, points[name].values, strict=True):
                at = {X: sp.Rational(float(place))}
                floats = {f: sp.Rational(float(f)) for f in expression.atoms(sp.Float)}
                true = sp.diff(expression.xreplace(floats), X, order).xreplace(at)
                assert abs(sp.Rational(value) - true) <= abs(true) * sp.Rational(2) ** -52
        saddles = points.kind.values == SADDLE
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", RuntimeWarning)  # areas are not known so well
            heights = pk.separatrices(system).saddle_energy.values
        np.testing.assert_array_equal(heights, points.energy.values[saddles])
        tilted = pk.equilibria(pk.Perturbed(system, torque=[0.0, 1e-9]))
        np.testing.assert_array_equal(tilted.energy.values[0], points.energy.values)


def test_energies_that_no_double_holds_are_infinite():
    points = pk.equilibria(pk.Potential("x^4/4 - m*x^2/2", "x", {"m": 1e300}))
    np.testing.assert_allclose(points.phi.values, [-1e150, 0.0, 1e150], rtol=1e-15)
    np.testing.assert_array_equal(points.energy.values, [-np.inf, 0.0, -np.inf])
    np.testing.assert_array_equal(points.kind.values, [CENTER, SADDLE, CENTER])


def test_where_a_function_has_no_bounds_its_scatter_is_taken():
    """The Bessel function of order 1/2 is sqrt(2/(pi x)) sin(x), extreme where tan(x) = 2 x."""
    with pytest.warns(RuntimeWarning, match="no bounds of besselj"):
        points = pk.equilibria(pk.Potential("besselj(0.5, x)", "x", interval=(0.3, 8.0)))
    assert points.phi.size == 3
    assert not points.complete
    with mpmath.workdps(40):
        for place, error in zip(points.phi.values, points.phi_error.values, strict=True):
            slope = lambda x: mpmath.sin(x) - 2 * x * mpmath.cos(x)  # noqa: E731
            true = mpmath.findroot(slope, mpmath.mpf(float(place)))
            assert abs(float(true - mpmath.mpf(float(place)))) <= error < 1e-12


def test_an_end_of_the_interval_and_a_constant_have_their_errors():
    points = pk.equilibria(pk.Potential("(x - 1)^2/2", "x", interval=(0.0, 1.0)))
    assert points.phi.values.tolist() == [1.0]
    assert 2.0**-53 <= points.phi_error.item() <= 2.0**-52
    cells = pk.equilibria(pk.Potential("k*x^2", "x", {"k": [0.0, 1.0, np.nan]}))
    assert np.isnan(cells.phi_error.values[[0, 2]]).all()
    assert 0.0 < cells.phi_error.values[1, 0] < 1e-300
