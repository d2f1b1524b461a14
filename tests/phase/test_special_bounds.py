"""Bounds of special functions and equilibria of potentials made of them, against mpmath."""

import mpmath
import numpy as np
import pytest
import sympy as sp

from phasekit.errors import ConvergenceError, EquilibriumKind
from phasekit.laws.derived import SphericalJ0, SphericalJ1
from phasekit.numerics.intervals.bounds import Bounds
from phasekit.phase.numerical import functions
from phasekit.phase.numerical.code import array_code
from phasekit.phase.numerical.formula import make_formula

CENTER, SADDLE = EquilibriumKind.CENTER, EquilibriumKind.SADDLE
X = sp.Symbol("x", real=True)


def loggamma(x):
    return mpmath.log(abs(mpmath.gamma(x)))


#: What is bounded, its value by mpmath, and where.
FUNCTIONS = [
    *[(sp.besselj(n, X), lambda x, n=n: mpmath.besselj(n, x), -30, 30) for n in (0, 1, 5)],
    *[(sp.bessely(n, X), lambda x, n=n: mpmath.bessely(n, x), 0.1, 30) for n in (0, 1, 3)],
    *[(sp.besseli(n, X), lambda x, n=n: mpmath.besseli(n, x), -5, 5) for n in (0, 1, 4)],
    *[(sp.besselk(n, X), lambda x, n=n: mpmath.besselk(n, x), 0.05, 9) for n in (0, 2)],
    *[(sp.polygamma(n, X), lambda x, n=n: mpmath.polygamma(n, x), 0.05, 9) for n in (0, 1, 2, 3)],
    *[(sp.polygamma(n, X), lambda x, n=n: mpmath.polygamma(n, x), -5, 1) for n in (0, 1)],
    (sp.gamma(X), mpmath.gamma, -4, 6),
    (sp.loggamma(X), loggamma, -4, 6),
    (sp.Si(X), mpmath.si, -30, 30),
    (sp.Ci(X), mpmath.ci, 0.05, 30),
    (sp.Ei(X), mpmath.ei, -4, 5),
    (sp.fresnels(X), mpmath.fresnels, -4, 4),
    (sp.fresnelc(X), mpmath.fresnelc, -4, 4),
    (sp.airyai(X), mpmath.airyai, -15, 6),
    (sp.airybi(X), mpmath.airybi, -15, 6),
    (sp.airyaiprime(X), lambda x: mpmath.airyai(x, derivative=1), -15, 6),
    (sp.airybiprime(X), lambda x: mpmath.airybi(x, derivative=1), -15, 6),
    (sp.erfi(X), mpmath.erfi, -3, 3),
    (sp.erfinv(X), mpmath.erfinv, -0.99, 0.99),
    (sp.LambertW(X), lambda x: mpmath.re(mpmath.lambertw(x)), -0.36, 9),
    (SphericalJ0(X), mpmath.sinc, -30, 30),
    (SphericalJ1(X), lambda x: -mpmath.diff(mpmath.sinc, x), -30, 30),
]


@pytest.mark.slow
@pytest.mark.parametrize(
    ("formula", "exact", "start", "stop"), FUNCTIONS, ids=lambda value: str(value)[:20]
)
def test_bounds_of_special_functions_hold(formula, exact, start, stop):
    rng = np.random.default_rng(1)
    low = np.append(rng.uniform(start, stop, 40), [0.0] * (start < 0.0))
    high = np.minimum(low + 10.0 ** rng.uniform(-7, 0.5, low.size), stop)
    ((least, most),), undefined = Bounds((formula,), (X,))((low, high))
    usable = np.flatnonzero(~undefined)
    assert usable.size > 15
    assert np.all(np.isfinite(most[usable] - least[usable]) | (high - low > 1e-3)[usable])
    with mpmath.workdps(25):
        for i in usable:
            for part in (0.0, 0.3, 0.5, 0.9, 1.0):
                x = low[i] + mpmath.mpf(part) * (mpmath.mpf(high[i]) - low[i])
                assert mpmath.mpf(least[i]) <= exact(x) <= mpmath.mpf(most[i])
    narrow = usable[(high - low)[usable] < 1e-5]
    assert narrow.size > 3
    # They close in on the value.
    slope = np.abs([float(mpmath.diff(exact, low[i])) for i in narrow])
    width = (most - least)[narrow]
    assert np.all(width <= 20.0 * (slope + 2.0 + np.abs(least[narrow])) * 1e-5)


#: Where SciPy leaves few digits: next to poles and branch points, under- and overflow, exp(x^2).
HARD = [
    (sp.erfi(X), mpmath.erfi, [-26.148781397254947, -19.586119426811667, 14.77424291637037]),
    (sp.erfc(X), mpmath.erfc, [19.78872820160791, 21.746641520010392, 26.9, 27.177982085386006]),
    (sp.polygamma(0, X), mpmath.digamma, [-21.998814910768793, -333.999999, -1000.0000001, -7.3]),
    (sp.LambertW(X), FUNCTIONS[-3][1], [-0.36787944117144, -0.367879441171, -0.3678794, -0.36]),
    (sp.besseli(1, X), lambda x: mpmath.besseli(1, x), [2.66e-172, 5e-200, -9.1e-301]),
    (sp.besseli(4, X), lambda x: mpmath.besseli(4, x), [3.307132250910179e-68, 1e-9]),
    (sp.besselj(1, X), lambda x: mpmath.besselj(1, x), [3.517512617068197e-263, 5.9e-242]),
    (sp.besselk(0, X), lambda x: mpmath.besselk(0, x), [800.0, 3403.909085206491]),
    (sp.Ei(X), mpmath.ei, [-8254.131918441177, -800.0, 0.37250741078136663]),
    (SphericalJ1(X), lambda x: x / 3, [-3.954805517150386e-114, 4.0104824036799614e-122]),
]


@pytest.mark.parametrize(("formula", "exact", "places"), HARD, ids=lambda value: str(value)[:20])
def test_bounds_hold_where_digits_are_lost(formula, exact, places):
    x = np.array(places)
    ((least, most),), undefined = Bounds((formula,), (X,))((x, x))
    assert not undefined.any()
    with mpmath.workdps(60):
        for low, high, place in zip(least, most, x, strict=True):
            value = exact(mpmath.mpf(place))
            assert mpmath.mpf(low) <= value <= mpmath.mpf(high)
            assert high - low <= 1e-5 * abs(value) + 1e-12


def test_the_slope_of_a_sine_integral_has_no_gap_at_0():
    x = np.array([-700.0, -3.0, -1e-9, 0.0, 1e-300, 1e-4, 0.5, 12.0, 3e5])
    for formula, exact in ((SphericalJ0(X), mpmath.sinc), (SphericalJ1(X), lambda u: (
        mpmath.sin(u) / u**2 - mpmath.cos(u) / u if u else mpmath.mpf(0)
    ))):  # fmt: skip
        with mpmath.workdps(700):
            want = [float(exact(mpmath.mpf(u))) for u in x]
        np.testing.assert_allclose(array_code([X], formula)(x), want, rtol=1e-13, atol=1e-17)
    formula = make_formula("Si(x) + LambertW(x)", "x", (), None, (-0.3, 2.0))
    np.testing.assert_allclose(formula.slopes(0.0), 2.0)
    np.testing.assert_allclose(formula.bends(0.0), -2.0)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("text", "interval", "at"),
    [
        ("erf(x)^2 + besselj(0,x) + loggamma(x+6)/9 + Si(x)/5", (-4, 4),
         [-3.88253057, -0.94058669, -0.20044481, 1.52511825, 3.26841146]),
        ("besselj(0, x)", (0.5, 20.0), [3.83170597, 7.01558667, 10.17346814, 13.32369194,
                                        16.47063005, 19.61585851]),
        ("gamma(x)", (0.2, 4.0), [1.46163214]),
        ("loggamma(x)", (-1.9, -1.1), [-1.57349847]),
        ("Ci(x)", (0.5, 11.0), [1.57079633, 4.71238898, 7.85398163, 10.99557429]),
        ("Si(x)", (-7.0, 4.0), [-6.28318531, -3.14159265, 3.14159265]),
        ("airyai(x)", (-6.0, 3.0), [-4.82009921, -3.24819758, -1.01879297]),
        ("Ei(x) - 5*x", (0.1, 4.0), [0.25917110, 2.54264136]),
        ("besselk(0, x) + x", (0.1, 9.0), [0.724085302]),
        ("bessely(1, x)", (0.5, 9.0), [3.68302286, 6.94149995]),
    ],
)  # fmt: skip
def test_equilibria_of_special_functions_are_proved(text, interval, at):
    got = functions.equilibria(make_formula(text, "x", (), None, interval))
    np.testing.assert_allclose(got.phi, at, atol=2e-8)
    assert got.complete
    assert len(got.kind) == len(at)
    assert set(got.kind) <= {EquilibriumKind.CENTER, EquilibriumKind.SADDLE}
    assert np.all(np.diff(got.kind) != 0)  # they take turns


def test_poles_of_special_functions_are_refused():
    with pytest.raises(ConvergenceError, match="not smooth"):
        functions.equilibria(make_formula("loggamma(x)", "x", (), None, (-1.5, 2.0)))
