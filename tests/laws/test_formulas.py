"""Formulas are read without evaluating anything, in bounded time, and written so as to be read."""

import os
import sys

import mpmath
import numpy as np
import pytest
import sympy as sp
from hypothesis import given, settings
from hypothesis import strategies as st

from phasekit.errors import ParameterError
from phasekit.laws.formulas import is_name, read_formula, symbols_of, take_formula, write_formula
from phasekit.laws.nodes import FUNCTIONS

EXAMPLES = int(os.environ.get("PHASEKIT_FORMULAS", "60"))
SYMBOLS = symbols_of(("x", "y", "mu", "k"))
x, y, mu, k = SYMBOLS.values()


def read(text, symbols=SYMBOLS):
    return read_formula(text, symbols, "potential")


# --------------------------------------------------------------------- what is refused

CODE = "__import__('os').system('touch sentinel')"
ATTACKS = [
    CODE,
    f"mu*x**2/2 + 0*{CODE}",
    f"0*{CODE}",
    "x.__class__",
    "x.__class__.__mro__[1].__subclasses__()",
    "().__class__",
    "sin.__globals__",
    "x.subs(x, 1)",
    "mu.real",
    "(1).real",
    "1.real",
    "__builtins__",
    "__name__",
    "eval('1')",
    "exec('1')",
    "open('sentinel', 'w')",
    "compile(x)",
    "getattr(x, y)",
    "globals()",
    "print(x)",
    "Symbol('q')",
    "Function('f')(x)",
    "sympify('1')",
    "S('1')",
    "lambda: x",
    "lambda x: x",
    "(lambda: 0)()",
    "(y := 1)",
    "y := 1",
    "x = 1",
    "x == y",
    "[x for x in (1, 2)]",
    "{x: y}",
    "{x}",
    "[x]",
    "x[0]",
    "(x, y)",
    "()",
    "x if y else mu",
    "x and y",
    "not x",
    "x in y",
    "x is y",
    "await x",
    "yield x",
    "*x",
    "sin(*x)",
    "sin(x=1)",
    "sin(**x)",
    "f'{x}'",
    "'x'",
    '"x"',
    "b'x'",
    "`x`",
    "x; y",
    "x\nimport os",
    "x\rimport os",
    "x\\\n+ y",
    "x # comment",
    "x\x00",
    "\x00",
    "x\x0c;y",
    "ｘ",  # fullwidth, which Python's parser would take for x
    "ｓin(x)",
    "𝐱",
    "х",  # Cyrillic
    "x²",
    "x\u200b",
    "١",  # an Arabic one
    "1_000*x",
    "1j*x",
    "2J",
    "0x10",
    "0b1",
    "1e",
    "1e400",
    "1e-400*x",
    "x!",
    "x'",
    "@x",
    "x @ y",
    "x // y",
    "x % y",
    "x << 2",
    "x -> y",
    "...",
    "x..y",
    "None",
    "nan",
    "inf",
    "oo",
    "zoo",
    "I*x",
    "sqrt(-1)*x",
    "(-8)**(1/3)*x",
    "log(-2)*x",
    "True",
    "x < 1",
    "x & y",
    "x | y",
    "~x",
    "(x < 1) + 1",
    "(x < 1) & y",
    "",
    "   ",
    "x +",
    "+",
    "x y",
    "2x",
    "x(1)",
    "k(x + 1)",
    "sin",
    "sin()",
    "sin(x, y)",
    "sin(x",
    "x)",
    "sin(,)",
    "Piecewise()",
    "Piecewise(x)",
    "Piecewise((x, x))",
    "Piecewise((x < 1, x))",
    "Heaviside(x, y)",
    "Rational(x, 2)",
    "Max()",
    # What would take forever, or all memory.
    "9**9**9*x",
    "x**(10**9)",
    "((x**99)**99)**99",
    "x**99**99",
    "x**1001",
    "x**(exp(20))",
    "((2*x)**999)**999",
    "2**(2**(2**(2**(2**2))))*x",
    "exp(exp(exp(exp(3.1))))*x",
    "10**308*10**308*x",
    "1e308*1e308*x",
    "gamma(10**9)*x",
    "gamma(1e9)*x",
    "loggamma(10**9)*x",
    "polygamma(10**6, 2)*x",
    "polygamma(x, 10**9)",
    "besselj(10**6, 10**6)*x",
    "factorial(10**9)",
    "binomial(10**9, 10**8)",
    "1/0",
    "x/0",
    "0/0*x",
    "0*(1/0)",
    "x/(y - y)",
    "log(0)",
    "tan(pi/2)",
    "gamma(0)",
    "(" * 100_000 + "x" + ")" * 100_000,
    "(" * 1000 + "x" + ")" * 1000,
    "sin(" * 1000 + "x" + ")" * 1000,
    "x**" * 1000 + "x",
    "~" * 1000 + "x",
    "-" * 60_000 + "x",
    "9" * 100_000,
    "9" * 1000,
    "0." + "9" * 60_000,
    "x" * 200,
    "Abs(" * 60 + "x" + ")" * 60,
    "Max(" * 60 + "x, y" + ")" * 60,
    "Max(" + ", ".join(f"x*{i}" for i in range(1000)) + ")",
    "*".join(["2**1000"] * 5000),
    "+".join(f"1/{i}" for i in range(10_001, 14_000)),
    "Piecewise(" * 60 + "(x, x < 1)" + ")" * 60,
]


class Watch:
    """Audit events that only running text or another program could raise."""

    forbidden = ("os.system", "subprocess.Popen", "os.exec", "os.posix_spawn", "pickle.find_class")

    def __init__(self):
        self.on, self.seen, self.text = False, [], None

    def __call__(self, event, args):
        if not self.on:
            return
        if event in self.forbidden:
            self.seen.append((event, args))
        elif event in ("compile", "exec") and self.text is not None:
            self.seen.append((event, args))


WATCH = Watch()
sys.addaudithook(WATCH)


@pytest.mark.slow
@pytest.mark.parametrize("text", ATTACKS, ids=lambda text: ascii(text[:30]))
def test_what_is_no_formula_is_refused_and_never_run(text, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    WATCH.on, WATCH.text = True, text
    try:
        with pytest.raises(ParameterError, match=r"^potential: got ") as caught:
            read(text)
    finally:
        WATCH.on, WATCH.text = False, None
    assert WATCH.seen == []
    assert not list(tmp_path.iterdir())
    assert len(str(caught.value)) < 1500


def test_there_are_many_attacks():
    assert len(ATTACKS) > 120
    assert len(set(ATTACKS)) == len(ATTACKS)


@pytest.mark.parametrize(
    ("text", "part"),
    [
        ("muu*x + q", "did you mean 'mu'"),
        ("sine(x)", "did you mean 'sin'"),
        ("Sin(x)", "did you mean 'sin'"),
        ("heaviside(x)", "did you mean 'Heaviside'"),
        ("q*x", "unknown symbol q"),
        ("х*2", r"\\u0445"),
        ("k(x + 1)", r"write k\*"),
        ("x + * y", "character 5"),
        ("(x < 1) & y", "joins conditions"),
    ],
)
def test_messages_help(text, part):
    with pytest.raises(ParameterError, match=part):
        read(text)


def test_unknown_names_say_where_to_declare_them():
    with pytest.raises(ParameterError, match="declare it"):
        read_formula("q*x", SYMBOLS, "f", "declare it")


ALPHABET = "xyk019.eE+-*/^()<>=&|~, \n_'\"\\[]{}:;@#!%pisncoabMmgPw\x00ａ١"
PIECES = st.sampled_from(
    [*FUNCTIONS, "x", "y", "pi", "E", "(", "(", ")", ")", ",", "**", "^", "*", "/", "+", "-", "~",
     "&", "|", "<", ">=", "==", "9", "1/3", "0", "0.5", "1e9", "99", "10", "True", ".", "__"]
)  # fmt: skip


@settings(max_examples=EXAMPLES)
@given(st.one_of(st.text(ALPHABET, max_size=60), st.lists(PIECES, max_size=25).map("".join)))
def test_any_text_is_a_formula_or_an_error(text):
    try:
        found = read(text)
    except ParameterError:
        return
    assert isinstance(found, sp.Expr)
    assert read(write_formula(found)) == found


# --------------------------------------------------------------------- what is read


@pytest.mark.parametrize(
    ("text", "wanted"),
    [
        ("x^4/4 - mu*x^2/2", x**4 / 4 - mu * x**2 / 2),
        ("-x**2", -(x**2)),
        ("2**-x", 2 ** (-x)),
        ("x**y**2", x ** (y**2)),
        ("x - y - k", x - y - k),
        ("x/y/k", x / (y * k)),
        ("x/y*k", x * k / y),
        ("- - x", x),
        ("x*-y", -x * y),
        ("1/3*x", x / 3),
        (".5*x + 1.*y", sp.Float(0.5) * x + sp.Float(1.0) * y),
        ("1e-3", sp.Float(0.001)),
        ("pi*E*x", sp.pi * sp.E * x),
        ("exp(1)", sp.E),
        ("\n x\t+ 1 ", x + 1),
        ("ln(x) + log(x, 2)", sp.log(x) + sp.log(x) / sp.log(2)),
        ("abs(x) + Abs(y)", sp.Abs(x) + sp.Abs(y)),
        ("max(x, y) - Min(x, 1)", sp.Max(x, y) - sp.Min(x, 1)),
        ("arctan2(y, x) + arcsin(x)", sp.atan2(y, x) + sp.asin(x)),
        ("cot(x)*sec(y)", 1 / (sp.tan(x) * sp.cos(y))),
        ("cbrt(x)", sp.sign(x) * sp.Abs(x) ** sp.Rational(1, 3)),
        ("Rational(1, 3)*x", x / 3),
        ("digamma(x)", sp.polygamma(0, x)),
        ("besselj(0, x) + erf(y)", sp.besselj(0, x) + sp.erf(y)),
        ("Piecewise((x, x < 1), (y, True))", sp.Piecewise((x, x < 1), (y, True))),
        (
            "Piecewise((x, (x < 1) & (y > 2) | ~(k <= 0)), (1, x == 3), (0, 0 < x < 9))",
            sp.Piecewise(
                (x, sp.Or(sp.And(x < 1, y > 2), k > 0)),
                (1, sp.Eq(x, 3)),
                (0, sp.And(x > 0, x < 9)),
            ),
        ),
        ("Piecewise((x, Ne(x, 0)), (1, True))", sp.Piecewise((x, sp.Ne(x, 0)), (1, True))),
    ],
)  # fmt: skip
def test_formulas_mean_what_sympy_means_by_them(text, wanted):
    assert read(text) == wanted


def test_declared_names_hide_constants():
    names = symbols_of(("E", "pi", "beta", "S"))
    assert read("E*pi + beta*S", names) == names["E"] * names["pi"] + names["beta"] * names["S"]


def test_a_name_is_a_symbol_or_a_function_but_not_both():
    names = symbols_of(("x", "gamma"))
    assert read("gamma*x", names) == names["gamma"] * names["x"]
    with pytest.raises(ParameterError, match="gamma is a symbol"):
        read("gamma*(x + gamma(x))", names)
    with pytest.raises(ParameterError, match="another name"):
        take_formula(sp.gamma(names["x"]) * names["gamma"], names)


def test_decimal_numbers_are_the_doubles_that_python_reads():
    for number in (0.1, 1 / 3, 1e-300, 1.7976931348623157e308, 5e-324, 123456789.123456789):
        assert float(read(repr(number))) == number
    assert read("10**300").is_Integer


LEAVES = st.one_of(
    st.sampled_from([x, y, mu, k, sp.pi, sp.E]),
    st.integers(-30, 30).map(sp.Integer),
    st.fractions(-5, 5, max_denominator=9).map(lambda q: sp.Rational(q.numerator, q.denominator)),
    st.floats(-1e3, 1e3).filter(lambda v: v == 0 or abs(v) > 1e-3).map(sp.Float),
)
ONE = [sp.sin, sp.cos, sp.tanh, sp.atan, sp.exp, sp.erf, sp.asinh, sp.Abs, sp.sign, sp.airyai]


def grown(children):
    pairs = st.tuples(children, children)
    return st.one_of(
        pairs.map(lambda p: p[0] + p[1]),
        pairs.map(lambda p: p[0] - p[1]),
        pairs.map(lambda p: p[0] * p[1]),
        st.tuples(children, st.integers(-3, 4)).map(lambda p: (p[0] ** 2 + 1) ** p[1]),
        children.map(lambda e: sp.sqrt(e**2 + 1)),
        st.tuples(st.sampled_from(ONE), children).map(lambda p: p[0](p[1])),
        pairs.map(lambda p: sp.Piecewise((p[0], x < y), (p[1], sp.And(x > 0, y >= 2)), (k, True))),
        children.map(lambda e: sp.besselj(1, e)),
    )


def usable(expression):
    return not expression.has(sp.zoo, sp.nan, sp.oo, sp.I, sp.re, sp.im, sp.AccumBounds)


@pytest.mark.slow
@settings(max_examples=EXAMPLES)
@given(st.recursive(LEAVES, grown, max_leaves=8).filter(usable))
def test_what_sympy_writes_is_read_as_it_was(expression):
    """The expressions are made by sympy, without text."""
    try:
        taken = take_formula(expression, SYMBOLS)
    except ParameterError:  # larger than formulas may be
        return
    assert read(write_formula(taken)) == taken


def test_expressions_are_taken_by_the_names_of_their_symbols():
    assert take_formula(sp.Symbol("x", positive=True) * sp.Symbol("mu"), SYMBOLS) == x * mu
    assert take_formula(3, SYMBOLS) == 3
    assert take_formula(np.float64(0.25), SYMBOLS) == sp.Float(0.25)


HOSTILE = sp.Function("__import__('os').system('touch sentinel') or sin")


@pytest.mark.parametrize(
    "expression",
    [
        HOSTILE(x),
        sp.Symbol("x); import os; (x"),
        sp.Symbol("x") * sp.Symbol("lambda"),
        sp.Integral(x, (x, 0, y)),
        sp.Derivative(HOSTILE(x), x),
        sp.Matrix([x]),
        sp.MatrixSymbol("M", 2, 2),
        sp.IndexedBase("A")[x],
        sp.Tuple(x, y),
        x < 1,
        sp.true,
        sp.oo + x,
        sp.nan * x,
        sp.I * x,
        sp.Heaviside(x, 0),
        sp.zeta(x),
        float("nan"),
        float("inf"),
        10**400,
        True,
        1j,
        None,
        b"x",
        ["x"],
    ],
    ids=lambda e: type(e).__name__,
)
def test_other_objects_are_refused(expression):
    with pytest.raises(ParameterError, match="^f: got"):
        take_formula(expression, SYMBOLS)


@pytest.mark.parametrize(
    "name",
    ["", "1x", "x y", "x;y", "lambda", "None", "__class__", "x.y", "ｘ", "ﬁ", "x\n", "x" * 200,
     "x)", "sin(x)", 3, None, b"x", "a-b"],
)  # fmt: skip
def test_names_that_are_none(name):
    assert not is_name(name)


def test_names():
    assert all(map(is_name, ("x", "omega_1", "φ", "Ω0", "x" * 100, "_c0", "E", "gamma")))


SPECIAL = {
    "erf(x)": mpmath.erf,
    "erfc(x)": mpmath.erfc,
    "erfi(x)": mpmath.erfi,
    "erfinv(x)": mpmath.erfinv,
    "gamma(x)": mpmath.gamma,
    "loggamma(x)": mpmath.loggamma,
    "digamma(x)": mpmath.digamma,
    "polygamma(1, x)": lambda t: mpmath.psi(1, t),
    "besselj(0, x)": lambda t: mpmath.besselj(0, t),
    "besselj(1/2, x)": lambda t: mpmath.besselj(0.5, t),
    "bessely(1, x)": lambda t: mpmath.bessely(1, t),
    "besseli(2, x)": lambda t: mpmath.besseli(2, t),
    "besselk(1, x)": lambda t: mpmath.besselk(1, t),
    "airyai(x)": mpmath.airyai,
    "airyaiprime(x)": lambda t: mpmath.airyai(t, derivative=1),
    "airybi(x)": mpmath.airybi,
    "airybiprime(x)": lambda t: mpmath.airybi(t, derivative=1),
    "LambertW(x)": mpmath.lambertw,
    "Si(x)": mpmath.si,
    "Ci(x)": mpmath.ci,
    "Ei(x)": mpmath.ei,
    "fresnels(x)": mpmath.fresnels,
    "fresnelc(x)": mpmath.fresnelc,
    "elliptic_k(x)": mpmath.ellipk,
    "elliptic_e(x)": mpmath.ellipe,
    "cot(x)": mpmath.cot,
    "sech(x)": mpmath.sech,
    "cbrt(x)": mpmath.cbrt,
}


@pytest.mark.slow
@pytest.mark.parametrize("text", [t for t in SPECIAL if t != "cbrt(x)"])
def test_special_functions_work_with_their_derivatives(text):
    """V, V' and V'' as arrays against mpmath's function and its numerical derivatives."""
    import phasekit as pk

    V = pk.Potential(text, "x", interval=(0.1, 0.9))
    points = np.array([0.25, 0.75])
    with mpmath.workdps(40):
        wanted = [
            [float(mpmath.re(mpmath.diff(SPECIAL[text], mpmath.mpf(t), n))) for t in points]
            for n in range(3)
        ]
    got = [V.potential(points), V.gradient(points), V.curvature(points)]
    np.testing.assert_allclose(got, wanted, rtol=3e-14)
