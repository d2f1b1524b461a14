"""Equilibria of potentials that sampling misses, held against exact root isolation."""

import os

import mpmath
import numpy as np
import pytest
import sympy as sp
from hypothesis import given, settings
from hypothesis import strategies as st

from phasekit.errors import ConvergenceError, EquilibriumKind, OrbitKind, ParameterError
from phasekit.numerics.intervals.bounds import Bounds
from phasekit.numerics.intervals.plane import Regions
from phasekit.phase.numerical import functions
from phasekit.phase.numerical.formula import check_period, make_formula

CENTER, SADDLE, DEGENERATE = (
    EquilibriumKind.CENTER,
    EquilibriumKind.SADDLE,
    EquilibriumKind.DEGENERATE,
)
EXAMPLES = int(os.environ.get("PHASEKIT_POTENTIALS", "16"))
X = sp.Symbol("x", real=True)


def found(expression, interval=None, period=None, names=(), values=()):
    return functions.equilibria(make_formula(expression, "x", names, period, interval), *values)


# --------------------------------------------------------------------- bounds of rounding


@pytest.mark.parametrize(
    ("text", "interval", "kinds"),
    [
        ("4*(x^-12 - x^-6)", (0.05, 10.0), [CENTER]),
        ("cosh(x) - x^2", (-34.0, 34.0), [CENTER, SADDLE, CENTER]),
        ("x^4/4 - x^2/2", (-1e5, 1e5), [CENTER, SADDLE, CENTER]),
        ("x^2/2 - 5*exp(-((x - 3.3)/0.05)^2)", (-10.0, 10.0), [CENTER, SADDLE, CENTER]),
        ("x^2/2 + 1/x^2", (1e-3, 3000.0), [CENTER]),
        ("(x^2 + 1e-30)^(3/4)", (-1.0, 2.0), [CENTER]),
    ],
)
def test_a_large_slope_elsewhere_and_narrow_wells_hide_nothing(text, interval, kinds):
    got = found(text, interval)
    assert got.kind.tolist() == kinds
    assert got.complete


def test_wilkinsons_polynomial():
    slope = sp.expand(sp.prod([X - k for k in range(1, 21)]))
    got = found(sp.integrate(slope, X))
    assert got.phi.tolist() == list(range(1, 21))
    assert got.kind.tolist() == [SADDLE, CENTER] * 10
    assert got.complete


def test_extrema_of_a_chebyshev_polynomial():
    got = found(sp.chebyshevt(51, X))
    want = np.sort(np.cos(np.pi * np.arange(1, 51) / 51))
    np.testing.assert_allclose(got.phi, want, atol=3e-16)
    np.testing.assert_allclose(got.energy, np.where(got.kind == CENTER, -1.0, 1.0), rtol=1e-13)
    assert got.kind.tolist() == [SADDLE, CENTER] * 25
    assert got.complete


NAMES = tuple(f"c{k}" for k in range(14))
POLYNOMIAL = " + ".join(f"{name}*x^{k + 1}/{k + 1}" for k, name in enumerate(NAMES))


def padded(coefficients):
    return [*coefficients, *[0.0] * (len(NAMES) - len(coefficients))]


@settings(max_examples=EXAMPLES)
@given(
    st.lists(st.integers(-20, 20), min_size=1, max_size=8, unique=True),
    st.sampled_from([1, 2]),
    st.integers(0, 2),
)
def test_polynomials_have_the_roots_that_they_are_made_of(roots, power, pairs):
    places = sorted(roots)
    slope = np.polynomial.Polynomial.fromroots([*places, *[places[0]] * (power - 1)])
    for _ in range(pairs):
        slope *= np.polynomial.Polynomial([4.0, -2.0, 1.0])
    assert np.all(np.abs(slope.coef) < 2.0**53)  # so they are whole numbers exactly
    got = found(POLYNOMIAL, names=NAMES, values=padded(slope.coef))
    kinds = [CENTER if (len(places) - i) % 2 else SADDLE for i in range(len(places))]
    kinds[0] = DEGENERATE if power > 1 else kinds[0]
    assert got.kind.tolist() == kinds
    np.testing.assert_allclose(got.phi, places, atol=1e-2)
    assert got.complete


@settings(max_examples=EXAMPLES)
@given(st.lists(st.integers(-(2**12), 2**12), min_size=3, max_size=8), st.integers(1, 60))
def test_polynomials_have_the_roots_that_exact_isolation_finds(coefficients, reach):
    slope = sp.Poly(coefficients[::-1], X, domain="ZZ")
    values = padded([float(c) for c in coefficients])
    got = found(POLYNOMIAL, (-reach / 2, reach / 2), names=NAMES, values=values)
    edge = sp.Rational(reach, 2)
    want = slope.intervals(inf=-edge, sup=edge) if slope.degree() > 0 else []
    assert got.n_equilibria == len(want)
    assert got.complete
    for phi, kind, ((low, high), times) in zip(got.phi, got.kind, want, strict=True):
        assert float(low) - 1e-12 * abs(phi) <= phi <= float(high) + 1e-12 * abs(phi)
        assert (kind == DEGENERATE) == (times > 1)


@settings(max_examples=EXAMPLES // 2)
@given(st.lists(st.tuples(st.floats(-1.0, 1.0), st.floats(-1.0, 1.0)), min_size=1, max_size=7))
def test_fourier_sums_have_as_many_equilibria_as_their_polynomial(terms):
    """In t = tan(x/2) V' is a polynomial over (1 + t^2)^n, which sympy isolates."""
    terms = [(round(a * 64) / 64, round(b * 64) / 64) for a, b in terms]
    n = len(terms)
    t = sp.Symbol("t")
    numerator = sp.Integer(0)
    slope_at_pi = sp.Integer(0)
    for k, (a, b) in enumerate(terms, start=1):
        z = sp.Poly(sp.expand((1 + sp.I * t) ** (2 * k)), t)  # e^{ikx} (1 + t^2)^k
        cos, sin = (sp.Poly([part(c) for c in z.all_coeffs()], t) for part in (sp.re, sp.im))
        a, b = sp.Rational(a), sp.Rational(b)
        numerator += (-k * a * sin.as_expr() + k * b * cos.as_expr()) * (1 + t**2) ** (n - k)
        slope_at_pi += k * b * (-1) ** k
    poly = sp.Poly(sp.expand(numerator), t)
    if poly.is_zero:
        return
    roots = poly.clear_denoms()[1].intervals() if poly.degree() > 0 else []
    text = "+".join(f"{a!r}*cos({k}*x)+{b!r}*sin({k}*x)" for k, (a, b) in enumerate(terms, 1))
    got = found(text, period=2.0 * np.pi)
    want = len(roots) + (slope_at_pi == 0)
    if got.complete:
        assert got.n_equilibria == want
        assert np.sum(got.kind == CENTER) == np.sum(got.kind == SADDLE)
    else:  # two that lie closer together than rounding, or have merged
        assert np.any(got.kind == DEGENERATE)


SHAPES = {
    "gaussian": ("exp(-(({x})/{w})^2)", lambda u: mpmath.exp(-u * u)),
    "lorentzian": ("1/(1 + (({x})/{w})^2)", lambda u: 1 / (1 + u * u)),
    "step": ("tanh(({x})/{w})", mpmath.tanh),
}


@settings(max_examples=EXAMPLES // 2)
@given(
    st.lists(
        st.tuples(
            st.sampled_from(["gaussian", "lorentzian", "step"]),
            st.floats(-4.0, 0.0),
            st.floats(0.2, 3.0),
            st.booleans(),
        ),
        min_size=1,
        max_size=3,
    )
)
def test_narrow_features_are_all_found(features):
    """Features far apart in a bowl: each adds the zeros that it has by itself, on fine grids."""
    centers = [-6.1, 0.7, 5.3]
    terms, grid = [], [np.linspace(-10.0, 10.0, 4001)]
    for center, (shape, decade, depth, up) in zip(centers, features, strict=False):
        width = 2.0 * 10.0**decade / 4.0
        text = SHAPES[shape][0].format(x=f"x - ({center!r})", w=repr(width))
        terms.append(f"({(1 if up else -1) * depth!r})*{text}")
        steps = width * np.sinh(np.linspace(-12.0, 12.0, 6001)) / 40.0
        grid.append(center + steps)
    formula = make_formula("x^2/50 + " + " + ".join(terms), "x", (), None, (-10.0, 10.0))
    x = np.unique(np.concatenate(grid))
    x = x[(x >= -10.0) & (x <= 10.0)]
    slope = formula.slopes(x)
    cells = np.flatnonzero(slope[:-1] * slope[1:] < 0.0)
    got = functions.equilibria(formula)
    assert got.complete
    assert got.n_equilibria >= cells.size  # the grid may miss what is proved, not the other way
    for a, b in zip(x[cells], x[cells + 1], strict=True):
        assert np.any((got.phi >= a) & (got.phi <= b))
    assert np.all(np.diff(got.kind) != 0)
    with mpmath.workdps(40):
        # In fractions: 1 - tanh^2 times a rounded number has no digits left.
        floats = formula.expression.atoms(sp.Float)
        fractions = {f: sp.Rational(*float(f).as_integer_ratio()) for f in floats}
        exact = sp.lambdify(X, sp.diff(formula.expression.xreplace(fractions), X), "mpmath")
        for phi in got.phi:
            step = 1e-13 * (1.0 + abs(phi))
            assert exact(mpmath.mpf(phi - step)) * exact(mpmath.mpf(phi + step)) < 0


# --------------------------------------------------------------------- what is not proved


def test_merged_equilibria_of_a_general_formula_are_not_proved():
    got = found("exp(-x^4)", (-3.0, 2.5))
    assert got.kind.tolist() == [DEGENERATE]
    assert not got.complete


def test_what_rounding_hides_is_named():
    got = found("-exp(-((x - 3.3)/0.05)^2)", (-10.0, 10.0))
    np.testing.assert_allclose(got.phi, [3.3])
    assert not got.complete
    assert got.gaps[0] == -10.0
    assert 1.5 < got.gaps[1] < 3.3


def test_functions_without_bounds_are_found_but_not_proved():
    got = found(sp.Piecewise((sp.cos(X), X < 20), (1, True)), (1.0, 9.0))
    np.testing.assert_allclose(got.phi, [np.pi, 2.0 * np.pi], rtol=1e-15)
    assert not got.complete
    assert got.gaps.tolist() == [1.0, 9.0]


def test_essential_singularities_are_refused():
    with pytest.raises(ConvergenceError, match="not smooth"):
        found("sin(1/x)", (-1.0, 1.0))


@pytest.mark.parametrize(
    ("text", "interval", "phi"),
    [
        ("cos(x)", (0.0, np.pi), [0.0, np.pi]),
        ("x^2", (0.0, 1.0), [0.0]),
        ("x^4/4 - x^2/2", (-1.0, 1.0), [-1.0, 0.0, 1.0]),
        ("exp(x) - x", (-2.0, 0.0), [0.0]),
        ("x*log(x)", (0.0, 3.0), [np.exp(-1.0)]),
        ("x + 1/x", (0.0, 3.0), [1.0]),
    ],
)
def test_the_ends_belong_to_the_interval(text, interval, phi):
    got = found(text, interval)
    np.testing.assert_allclose(got.phi, phi, rtol=2e-16)
    assert got.complete


def test_long_periods_take_bounded_work():
    got = found("cos(x)", period=2000.0 * np.pi)
    assert got.n_equilibria == 2000
    assert got.complete
    formula = make_formula("cos(x)", "x", (), 1e300, None)  # no list of 10^299 harmonics
    with pytest.raises(ParameterError, match="does not repeat"):
        check_period(formula, ())


# --------------------------------------------------------------------- bounds


FORMULAS = [
    sp.exp(-(X**2)), sp.sin(X) * sp.cosh(X), sp.cos(X / 2) + sp.sinh(X), sp.tanh(3 * X),
    sp.tan(X / 3), sp.asinh(X), sp.asin(X / 9), sp.acos(X / 9), sp.atan(X / 9), sp.atanh(X / 9),
    sp.log(5 + X), sp.sqrt(4 + X), X**-3, X**5 - X**2 / 3, sp.erf(X), sp.erfc(X), sp.acosh(X + 9),
    (5 + X) ** sp.Rational(7, 3), 2**X, (5 + X) ** X, sp.sech(X) + sp.cot(X + 6) / 3,
    sp.tanh(X) / sp.cosh(X) ** 2,
]  # fmt: skip


@pytest.mark.parametrize("formula", FORMULAS, ids=str)
def test_bounds_hold_on_the_line_and_in_the_plane(formula):
    rng = np.random.default_rng(3)
    low = rng.uniform(-2.0, 2.0, 12)
    width, height = rng.uniform(1e-3, 0.6, 12), rng.uniform(1e-3, 0.5, 12)
    ((least, most),), undefined = Bounds((formula,), (X,))((low, low + width))
    largest = Regions(formula, X).largest((low, low + width), (-height, height))
    exact = sp.lambdify(X, formula, "mpmath")
    assert np.isfinite(largest).sum() >= 5
    with mpmath.workdps(30):
        for i in range(12):
            for part in (0.0, 0.31, 0.77, 1.0):
                x = mpmath.mpf(float(low[i])) + part * mpmath.mpf(float(width[i]))
                if not undefined[i]:
                    assert mpmath.mpf(least[i]) <= exact(x) <= mpmath.mpf(most[i])
                for turn in (-1.0, 0.4, 1.0):
                    if np.isfinite(largest[i]):
                        z = mpmath.mpc(x, turn * height[i])
                        assert abs(exact(z)) <= mpmath.mpf(largest[i])


# --------------------------------------------------------------------- periods


def test_an_isochronous_well_with_a_sharp_wall():
    formula = make_formula("x^2/2 + 1/x^2", "x", (), None, (1e-3, 3000.0))
    start = np.array([1.2, 2.0, 10.0, 100.0, 300.0, 1000.0])
    got = functions.orbits(formula, start, 0.0)
    np.testing.assert_allclose(got.period, np.pi, rtol=1e-13)
    assert np.all(np.abs(got.period - np.pi) <= got.period_error + 2e-15)
    assert np.all(got.period_error < 1e-12)
    energy = 0.5 * start**2 + 1.0 / start**2
    np.testing.assert_allclose(got.action, (energy - 2**0.5) / 2, rtol=1e-12)


def test_a_long_arc_with_a_sharp_bottom():
    formula = make_formula("sqrt(1 + x^2)", "x", (), None, (-2e3, 2e3))
    got = functions.orbits(formula, 1e3, 0.0)
    with mpmath.workdps(30):
        a = mpmath.mpf(1000)
        top = mpmath.sqrt(1 + a * a)

        def slowness(angle):
            rise = top + mpmath.sqrt(1 + (a * mpmath.sin(angle)) ** 2)
            return mpmath.sqrt(rise / 2)  # h - V = a^2 cos^2/(h + V)

        want = 4 * mpmath.quad(slowness, [0, 1e-3, 1e-2, 0.1, 0.5, mpmath.pi / 2])
    assert abs(got.period / float(want) - 1.0) < 1e-14
    assert got.period_error < 1e-11 * float(want)


@pytest.mark.parametrize("width", [0.05, 1e-2, 1e-3, 1e-4])
def test_a_narrow_well_on_the_way_is_not_stepped_over(width):
    formula = make_formula(f"x^2/2 - exp(-((x - 3.3)/{width})^2)/2", "x", (), None, (-10.0, 10.0))
    got = functions.orbits(formula, 8.0, 0.0)
    with mpmath.workdps(30):
        w, at = mpmath.mpf(width), mpmath.mpf(3.3)
        middle = mpmath.asin(at / 8)

        def slowness(angle):
            x = 8 * mpmath.sin(angle)
            dip = mpmath.exp(-(((x - at) / w) ** 2)) if abs(x - at) < 12 * w else 0
            return 1 / mpmath.sqrt(1 + dip / (64 * mpmath.cos(angle) ** 2))

        marks = [middle + k * w / 8 for k in (-16, -8, -4, -2, -1, 0, 1, 2, 4, 8, 16)]
        want = 2 * mpmath.quad(slowness, [-mpmath.pi / 2, *marks, mpmath.pi / 2])
    assert abs(got.period / float(want) - 1.0) < 1e-14
    x, v = functions.flow(formula, 8.0, 0.0, np.array([0.5, 1.0, 7.5]) * float(want))
    np.testing.assert_allclose(x, [-8.0, 8.0, -8.0], rtol=1e-14)
    # Two units in the last place of the period, 7.5 times, in which v gains 8 times as much.
    late = 7.5 * float(want) * 2 * np.finfo(float).eps
    np.testing.assert_allclose(v, 0.0, atol=8.0 * late)


def test_errors_bound_what_is_wrong_of_lennard_jones():
    """The action of E < 0, and the period as its derivative, by mpmath."""
    formula = make_formula("4*(x^-12 - x^-6)", "x", (), None, (0.05, 1e4))
    level = np.array([-0.9, -0.1, -1e-3, -1e-6])
    got = functions.orbits_at_energy(formula, level)
    assert (got.orbit_kind == OrbitKind.LIBRATION).all()
    with mpmath.workdps(30):
        for energy, period, error in zip(level, got.period, got.period_error, strict=True):
            e = mpmath.mpf(float(energy))
            # x^6 = s between the roots of e s^2 + 4 s - 4; s = m + d sin(angle).
            m, d = -2 / e, mpmath.sqrt(4 + 4 * e) / -e

            def slowness(angle, e=e, m=m, d=d):
                s = m + d * mpmath.sin(angle)
                return s ** (mpmath.mpf(1) / 6) / mpmath.sqrt(-2 * e) / 6

            marks = [mpmath.pi * (mpmath.mpf(4) ** -k - 0.5) for k in range(12, -1, -1)]
            want = 2 * mpmath.quad(slowness, [-mpmath.pi / 2, *marks])
            assert abs(period - float(want)) <= error + 1e-15 * period
            assert error < 1e-12 * period / min(1.0, -energy)


# --------------------------------------------------------------------- steps


def test_the_slope_of_a_step_keeps_its_digits_far_from_it():
    formula = make_formula("tanh(x) - c*x", "x", ("c",), None, (0.0, 900.0))
    x = np.array([1.0, 5.0, 15.0, 20.0, 300.0, 900.0])
    with mpmath.workdps(900):
        sech = [1 / mpmath.cosh(mpmath.mpf(u)) for u in x]
        slopes = [float(s**2) for s in sech]
        bends = [
            float(-2 * s**2 * mpmath.tanh(mpmath.mpf(u))) for s, u in zip(sech, x, strict=True)
        ]
    np.testing.assert_allclose(formula.slopes(x, 0.0), slopes, rtol=1e-14)
    np.testing.assert_allclose(formula.bends(x, 0.0), bends, rtol=1e-14)
    for c in (1e-3, 1e-12, 1e-30, 1e-250):
        got = functions.equilibria(formula, c)
        np.testing.assert_allclose(got.phi, [np.arccosh(c**-0.5)], rtol=1e-15)
        assert got.kind.tolist() == [SADDLE]
        assert got.complete


def test_high_powers_of_a_sine_are_not_multiplied_out():
    formula = make_formula("sin(x)^500", "x", (), 2.0 * np.pi, None)
    assert formula.may_be_incomplete
    assert make_formula("sin(x)^100", "x", (), 2.0 * np.pi, None).may_be_incomplete is False
