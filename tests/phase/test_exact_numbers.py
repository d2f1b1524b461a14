"""Verdicts next to merging pairs, by the doubles of a formula taken as fractions."""

import pickle
from fractions import Fraction

import mpmath
import numpy as np
import pytest
import sympy as sp
from witnesses.variants import some

from phasekit import Potential
from phasekit.errors import EquilibriumKind
from phasekit.phase.numerical import functions
from phasekit.phase.numerical.formula import make_formula

CENTER, SADDLE = EquilibriumKind.CENTER, EquilibriumKind.SADDLE
DEGENERATE = EquilibriumKind.DEGENERATE


def sign(value):
    return int(value > 0) - int(value < 0)


def pair(rng):
    """Half the linear and the constant coefficient of x^2 - 2 b x + c, next to a double root."""
    b = float(rng.uniform(0.5, 3.0))
    c = b * b
    for _ in range(rng.integers(0, 4)):
        c = float(np.nextafter(c, rng.choice([-np.inf, np.inf])))
    return b, c


#: Formulas whose V' is a (x^2 - 2 b x + c) times what has no zero; last what b is divided by.
WRITTEN = {
    "as it is": "{a!r}*(x^3/3 - {b!r}*x^2 + {c!r}*x)",
    "products of literals": "{a!r}*0.1*x^3/3 - {a!r}*0.1*{b!r}*x^2 + 0.1*{a!r}*{c!r}*x",
    "nested": "0.3*({a!r}*(x^3/3 - ({b!r}*(x^2 + 7.1) - {c!r}*x)) + 0.7*(0.2 - 0.3*(1.1)))",
    "quotients": "x^3/3/{a!r} - {b!r}*x^2/{a!r} + {c!r}*x/{a!r}",
    "quartic": "-{a!r}*(x^5/5 - {b!r}*x^4/2 + ({c!r} + 1.3)*x^3/3 - 1.3*{b!r}*x^2 + 1.3*{c!r}*x)",
    "powers": "{a!r}*((x - {b!r})^3/3 + ({c!r} - {b!r}^2)*x)",
    "parameters": "a*(x^3/3 - b*x^2 + c*x)",
}


@pytest.mark.parametrize("kind", some(WRITTEN, 2))
def test_pairs_that_all_but_merge_are_told_apart(kind):
    rng = np.random.default_rng(len(kind))
    seen = []
    for _ in range(12):
        a = float(rng.uniform(0.1, 9.0))
        b, c = pair(rng)
        if kind == "parameters":
            got = functions.equilibria(
                make_formula(WRITTEN[kind], "x", ("a", "b", "c"), None, None), a, b, c
            )
        else:
            text = WRITTEN[kind].format(a=a, b=b, c=c)
            got = functions.equilibria(make_formula(text, "x", (), None, None))
        verdict = sign(Fraction(b) ** 2 - Fraction(c))
        seen.append(verdict)
        assert got.complete
        assert got.n_equilibria == 1 + verdict
        if verdict >= 0:
            assert np.all(np.abs(got.phi - b) <= got.phi_error + 1e-7)
        first = CENTER if kind == "quartic" else SADDLE
        if verdict > 0:
            assert got.kind.tolist() == [first, CENTER + SADDLE - first]
            spread = float(Fraction(b) ** 2 - Fraction(c)) ** 0.5
            near = 2.0 * np.spacing(b)
            assert np.all(np.abs(got.phi - [b - spread, b + spread]) <= near)
    assert min(seen.count(1), seen.count(-1)) >= 2


FOURIER = {
    "products": "-{a!r}*{f!r}*cos(x) + {b!r}*{g!r}*cos(2*x)",
    "nested": "{g!r}*(-{q!r}*{a!r}*(cos(x) - 0.1) + 0.1*{b!r}*10*(cos(2*x) + 0.3))",
}


@pytest.mark.parametrize("kind", FOURIER)
def test_fourier_sums_next_to_a_pitchfork_say_no_wrong_number(kind):
    """V' is sin(x) times a positive number and A - 4 B cos(x), A all but 4 B."""
    rng = np.random.default_rng(8)
    known = []
    for step in range(14):
        b, g, f = map(float, rng.uniform(0.2, 2.0, 3))
        near = 10.0 ** rng.uniform(-17, -3) * rng.choice([-1.0, 1.0])
        a = float(4.0 * b * g / f * (1.0 + near))
        q = f / g
        text = FOURIER[kind].format(a=a, b=b, f=f, g=g, q=q)
        got = functions.equilibria(make_formula(text, "x", (), 2.0 * np.pi, None))
        A, B = Fraction(a) * Fraction(f), Fraction(b) * Fraction(g)
        if kind == "nested":
            A, B = Fraction(a) * Fraction(q), Fraction(b) * 10 * Fraction(0.1)
        if got.complete:
            assert got.n_equilibria == (4 if A < 4 * B else 2), step
            known.append(sign(A - 4 * B))
        else:
            assert np.any(got.kind == DEGENERATE)
    assert min(known.count(1), known.count(-1)) >= 2


@pytest.mark.parametrize(
    "text",
    [
        "4.991383820290229*(x^3/3-1.6726349282588393*x^2+2.7977076032314523*x)",
        "0.1*0.3*x^2 - (x - 3.3)^4/0.0001", "(0.1*x)^12 + x^2", "x/3/0.7 - 0.1*x^2/7", "1e300*x^2",
        "0.3^x + x^0.3 - x^-0.3", "gamma(2.3)*x^2 + besselj(1, 0.1*x)", "-0.5*cos(0.1*x)/1e-30",
        "Piecewise((0.1*x^2, x < 0.3), (-x*0.7/3, True))",
    ],
)  # fmt: skip
def test_formulas_are_read_as_they_are_written(text):
    V = Potential(text, "x")
    again = Potential(V.formula.text, "x")
    assert again == V
    assert again.expression == V.expression
    assert not V.expression.atoms(sp.Float)
    assert V.replace(interval=(1.0, 2.0)).expression == V.expression
    assert pickle.loads(pickle.dumps(V)) == V
    read = sp.lambdify(sp.Symbol("x", real=True), V.expression, "mpmath")
    with mpmath.workdps(40):
        assert float(read(mpmath.mpf(1.25))) == pytest.approx(float(V.potential(1.25)), rel=1e-14)


def test_numbers_are_not_multiplied_into_sums():
    """Next to 3.3, (x - 3.3)/w has digits that x/w - 3.3/w has not."""
    V = Potential("((x - 3.3)/0.00123)^2", "x")
    assert V.formula.text.count("(x - 3.3)**2") == 1
    x = np.nextafter(3.3, 4.0)
    step = Fraction(x) - Fraction(3.3)
    assert V.potential(x) == pytest.approx(float(step**2 / Fraction(0.00123) ** 2), rel=1e-15)
    assert V.gradient(x) == pytest.approx(float(2 * step / Fraction(0.00123) ** 2), rel=1e-15)
