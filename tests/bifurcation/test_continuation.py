"""The continuation engine on arrays: machine code, derivatives, stepping, normal forms."""

import ctypes
import itertools
import math

import numpy as np
import pytest
import sympy

import phasekit as pk
from phasekit.bifurcation.continuation import normal_form as forms
from phasekit.bifurcation.continuation.code_fields import CompiledField, PythonField
from phasekit.bifurcation.continuation.curve import Curve
from phasekit.bifurcation.continuation.fields import SymbolicField
from phasekit.bifurcation.continuation.kernels import defining
from phasekit.bifurcation.continuation.kernels.defining import (
    BRANCH,
    EQUILIBRIUM,
    FLIP,
    FOLD,
    HOPF,
    TORUS,
)
from phasekit.bifurcation.continuation.kernels.newton import refine
from phasekit.bifurcation.continuation.options import ContinuationOptions
from phasekit.bifurcation.continuation.path import Sample, between
from phasekit.bifurcation.continuation.points import branch_point, fold, pair
from phasekit.bifurcation.continuation.spectrum import (
    eigenvalues_of,
    orientation,
    pair_function,
)
from phasekit.errors import ParameterError
from phasekit.labelled.continuation.atlas_curves import path_of
from phasekit.laws.formulas import read_formula as parse
from phasekit.laws.formulas import symbols_of
from phasekit.numerics.machine_code import compile_expressions

FORMULAS = [
    "x + 2*y - 3",
    "x*y/(1 + x**2)",
    "-x**3 + x**-2 - y**2.5",
    "sqrt(x)*x**1.5 + (x + y)**(1/3)",
    "exp(-x)*sin(y) + cos(x*y)*tan(x/3)",
    "log(1 + exp(2*x)) - asin(x/5) + acos(y/7) + atan(x) + atan2(y, x)",
    "sinh(x) - cosh(y)*tanh(x) + asinh(y) + acosh(1 + x) + atanh(x/9)",
    "abs(x - 1) + sign(y - 2) + max(x, y) - min(x, 1.5, y) + Heaviside(x - y)",
    "erf(x) + erfc(y) + gamma(x) + loggamma(y) + pi",
]


@pytest.mark.parametrize("text", FORMULAS)
def test_machine_code_gives_what_sympy_gives(text):
    names = symbols_of(("x", "y"))
    expression = parse(text, names)
    address = compile_expressions([expression], {names["x"]: (0, 0), names["y"]: (1, 0)})
    pointer = ctypes.POINTER(ctypes.c_double)
    function = ctypes.CFUNCTYPE(None, pointer, pointer, pointer, pointer)(address)
    for x, y in ((0.7, 1.9), (1.3, 0.4), (1.0, 2.0)):
        arrays = [(ctypes.c_double * 1)(value) for value in (x, y, 0.0, 0.0)]
        function(*arrays)
        wanted = float(expression.subs({names["x"]: x, names["y"]: y}).evalf(30))
        assert arrays[3][0] == pytest.approx(wanted, rel=4e-15, abs=1e-15)


def test_piecewise_machine_code():
    x = sympy.Symbol("x", real=True)
    expression = sympy.Piecewise((x, x < 0), (x**2, sympy.And(x >= 0, x < 2)), (4, True))
    address = compile_expressions([expression], {x: (0, 0)})
    pointer = ctypes.POINTER(ctypes.c_double)
    function = ctypes.CFUNCTYPE(None, pointer, pointer, pointer, pointer)(address)
    for value, wanted in ((-1.5, -1.5), (0.0, 0.0), (1.5, 2.25), (2.0, 4.0), (9.0, 4.0)):
        arrays = [(ctypes.c_double * 1)(v) for v in (value, 0.0, 0.0, 0.0)]
        function(*arrays)
        assert arrays[3][0] == wanted


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("x +", "wants a formula"),
        ("x*q", "the name 'q'"),
        ("__import__('os')", "__import__"),
        ("x.real", "x.real"),
        ("[x]", "wants"),
        ("x if x else 1", "wants"),
        ("foo(x)", "foo(x)"),
        ("'x'", "wants"),
        ("True*x", "wants"),
    ],
)
def test_formulas_that_are_refused(text, message):
    with pytest.raises(ParameterError, match=message.replace("(", r"\(").replace(")", r"\)")):
        parse(text, symbols_of(("x",)))


def test_a_caret_is_a_power():
    x = symbols_of(("x",))
    assert parse("2*x^2 + 1", x) == 2 * x["x"] ** 2 + 1


# ------------------------------------------------------------------------------ derivatives

TEXTS = ("mu*x - y + x**2*y*exp(-x) + sin(y)*k", "x + mu*y**3 - k*x*y + cos(x + y)")


def reference(x, mu, k):
    x, y = x
    return [
        mu * x - y + x**2 * y * np.exp(-x) + np.sin(y) * k,
        x + mu * y**3 - k * x * y + np.cos(x + y),
    ]


def make(field, kind=EQUILIBRIUM, active=(0,)):
    size = defining.unknowns(kind, 2, len(active))
    infinite = np.full(size, np.inf)
    return Curve(
        field, kind, np.array([0.3, 0.8]), active, np.ones(size), np.zeros(size), -infinite,
        infinite, ContinuationOptions(), np.array([0.6, -0.8]) if kind in (HOPF, TORUS) else None,
    )  # fmt: skip


def fields():
    import numba

    names = symbols_of(("x", "y", "mu", "k"))

    def compiled(x, k, mu):  # not in the order of the parameters
        y = x[1]
        x = x[0]
        return (
            mu * x - y + x**2 * y * np.exp(-x) + np.sin(y) * k,
            x + mu * y**3 - k * x * y + np.cos(x + y),
        )

    states, parameters = ("x", "y"), ("mu", "k")
    return {
        "symbolic": SymbolicField([parse(t, names) for t in TEXTS], states, parameters),
        "compiled": CompiledField(numba.njit(compiled), ("k", "mu"), states, parameters),
        "python": PythonField(reference, None, states, parameters),
    }


FIELDS = fields()
EXACT = {"symbolic": 1e-14, "compiled": 1e-9, "python": 1e-9}


@pytest.mark.slow
@pytest.mark.parametrize("form", FIELDS)
def test_derivatives_of_every_form(form):
    symbols = sympy.symbols("x y mu k", real=True)
    x, y, mu, k = symbols
    f = sympy.Matrix(
        [
            mu * x - y + x**2 * y * sympy.exp(-x) + sympy.sin(y) * k,
            x + mu * y**3 - k * x * y + sympy.cos(x + y),
        ]
    )
    curve = make(FIELDS[form], active=(0, 1))
    u = np.array([0.7, -0.4, 0.35, 0.9])
    at = dict(zip(symbols, u, strict=True))
    first = f.jacobian(symbols)
    value, slopes = curve.evaluate(u)
    np.testing.assert_allclose(value, np.array(f.subs(at).tolist(), float).ravel(), rtol=1e-14)
    wanted = np.array(first.subs(at).tolist(), float)
    np.testing.assert_allclose(slopes, wanted, rtol=1e-11, atol=1e-11)
    z = np.array([0.3, -0.8, 0.5, 0.2])
    bent = (first * sympy.Matrix(z)).jacobian(symbols)
    wanted = np.array(bent.subs(at).tolist(), float)
    error = max(EXACT[form], 1e-14) * 1e2
    np.testing.assert_allclose(curve.bend(u, z), wanted, rtol=error * 10, atol=error * 10)
    d = forms.Derivatives(curve, u)
    a, b, c = np.array([0.6, 0.2]), np.array([-0.3, 0.9]), np.array([0.5, 0.5])
    plain = f.jacobian([x, y])
    second = (plain * sympy.Matrix(a)).jacobian([x, y])
    wanted = np.array((second * sympy.Matrix(b)).subs(at).tolist(), float).ravel()
    np.testing.assert_allclose(d.second(a, b).value, wanted, rtol=1e-10, atol=1e-10)
    third = (second * sympy.Matrix(b)).jacobian([x, y]) * sympy.Matrix(c)
    wanted = np.array(third.subs(at).tolist(), float).ravel()
    error = 1e-13 if form == "symbolic" else 1e-7
    np.testing.assert_allclose(d.third(a, b, c).value, wanted, rtol=error, atol=error)


@pytest.mark.parametrize("kind", [FOLD, HOPF, BRANCH, FLIP, TORUS])
@pytest.mark.parametrize("active", [(0,), (1, 0)])
def test_jacobians_of_defining_systems(kind, active):
    """Against differences of G itself, which the kernel returns interpreted and compiled."""
    curve = make(FIELDS["symbolic"], kind, active)
    size, rows = curve.size, curve.rows
    assert rows == (size if len(active) == 1 else size - 1)
    rng = np.random.default_rng(kind)
    u = rng.uniform(0.3, 0.9, size)

    def evaluate(u, compiled):
        w = np.zeros(defining.work_size(kind, 2, len(active)))
        w[3 * size : 4 * size] = 1.0
        places = defining.places(kind, 2, len(active))
        w[places[2] : places[2] + 2] = curve.aux if kind in (HOPF, TORUS) else 0.0
        w[places[3] : places[3] + size] = u
        first, second = curve.field.first(active), curve.field.second(active)
        kernel = refine
        if not compiled:
            kernel, first, second = refine.py_func, as_python(first), as_python(second)
        indices = np.array(active, dtype=np.int64)
        kernel(first, second, 0, kind, 2, curve.par.copy(), indices, w, 0.0, 1e-11, 0)
        g, jac = places[7], places[8]
        return w[g : g + rows].copy(), w[jac : jac + rows * size].reshape(rows, size).copy()

    g, jacobian = evaluate(u, True)
    again = evaluate(u, False)
    np.testing.assert_allclose(g, again[0], rtol=1e-13, atol=1e-14)
    np.testing.assert_allclose(jacobian, again[1], rtol=1e-13, atol=1e-14)
    h = 1e-5
    for j in range(size):
        step = h * np.eye(size)[j]
        slope = (evaluate(u + step, True)[0] - evaluate(u - step, True)[0]) / (2 * h)
        np.testing.assert_allclose(jacobian[:, j], slope, rtol=1e-8, atol=1e-8)


def as_python(address):
    pointer = ctypes.POINTER(ctypes.c_double)
    native = ctypes.CFUNCTYPE(None, pointer, pointer, pointer, pointer)(address)

    def call(*arrays):
        native(*(array.ctypes.data_as(pointer) for array in arrays))

    return call


# ------------------------------------------------------------------------------ spectra


def test_eigenvalues_and_determinants_of_small_matrices():
    rng = np.random.default_rng(1)
    matrices = rng.normal(size=(300, 2, 2))
    wanted = np.sort_complex(np.linalg.eigvals(matrices))
    np.testing.assert_allclose(np.sort_complex(eigenvalues_of(matrices)), wanted, atol=1e-14)
    # A determinant of 1e-20 is lost in the sum of squares, not in the product of the eigenvalues.
    nearly = np.array([[[1.0, 1.0], [1e-20, 2e-20]]])
    assert abs(np.min(np.abs(eigenvalues_of(nearly))) - 1e-20) < 1e-35
    curve = make(FIELDS["symbolic"])
    for _ in range(50):
        matrix = rng.normal(size=(3, 3))
        sign, log = orientation(curve, matrix[2], matrix[:2])
        np.testing.assert_allclose(sign * np.exp(log), np.linalg.det(matrix), rtol=1e-10)


def test_the_pair_function_changes_its_sign_where_two_eigenvalues_cancel():
    rng = np.random.default_rng(2)
    for _ in range(200):
        n = int(rng.integers(2, 6))
        matrix = rng.normal(size=(n, n))
        values = np.linalg.eigvals(matrix)
        i, j = np.triu_indices(n, 1)
        product = np.prod(values[i] + values[j])
        assert abs(product.imag) < 1e-9 * max(1.0, abs(product))
        assert np.sign(pair_function(values[None])[0]) == np.sign(product.real)


# ------------------------------------------------------------------------------ normal forms


def derivatives(texts, parameter, u):
    names = symbols_of((*("x", "y", "z")[: len(texts)], parameter))
    field = SymbolicField(
        [parse(t, names) for t in texts], ("x", "y", "z")[: len(texts)], (parameter,)
    )
    n = len(texts)
    infinite = np.full(n + 1, np.inf)
    curve = Curve(
        field, EQUILIBRIUM, np.zeros(1), (0,), np.ones(n + 1), np.zeros(n + 1), -infinite, infinite,
        ContinuationOptions(),
    )  # fmt: skip
    return forms.Derivatives(curve, np.array(u, float))


@pytest.mark.parametrize("l1", [-2.0, 0.7])
@pytest.mark.parametrize("omega", [1.0, 3.0])
def test_lyapunov_coefficient_of_the_hopf_normal_form(l1, omega):
    """Z' = (mu + i omega) z + c z |z|^2 with z = sqrt(2) w for a unit q: l1 = 2 c/omega."""
    cubic = f"{l1}*(x**2 + y**2)/2*{omega}"
    d = derivatives(
        [f"mu*x - {omega}*y + x*{cubic}", f"{omega}*x + mu*y + y*{cubic}"], "mu", [0, 0, 0]
    )
    form = pair.normal_form(d, omega)
    assert form["l1"] == pytest.approx(l1, rel=1e-13)
    assert form["d"] == pytest.approx(1.0, rel=1e-13)


def test_lyapunov_coefficient_with_quadratic_terms():
    """The adaptive control system at al = be = 1: -0.3 for the unit eigenvector."""
    d = derivatives(["y", "z", "-al*z - y - x + x**2"], "al", [0, 0, 0, 1.0])
    assert pair.normal_form(d, 1.0)["l1"] == pytest.approx(-0.3, rel=1e-13)


def test_normal_forms_on_a_slow_manifold():
    """Y = x^2 + k x^3: the reduced cubic is -1 + what y feeds back."""
    d = derivatives(["mu*x + x*y - x**3", "-2*y + x**2"], "mu", [0, 0, 0])
    form = branch_point.normal_form(d, np.array([0.0, 0.0, 1.0]), pitchfork=True)
    # y = x^2/2 + ..., so x' = mu x + (1/2 - 1) x^3.
    assert form["c"] == pytest.approx(-0.5, rel=1e-13)
    assert form["d"] == pytest.approx(1.0, rel=1e-13)
    d = derivatives(["mu + 3*x**2 - x*y", "-y + 5*x"], "mu", [0, 0, 0])
    form = fold.normal_form(d)
    # On y = 5 x + ...: mu - 2 x^2 in x, and xi = |(1, 5)| x for the unit eigenvector.
    size = math.sqrt(26.0)
    assert abs(form["a"]) == pytest.approx(2.0 / size, rel=1e-13)
    assert form["a"] * form["b"] == pytest.approx(-2.0, rel=1e-13)


def test_null_vectors_do_not_mind_units():
    scale = np.array([1e-6, 1e6, 1.0])
    rng = np.random.default_rng(3)
    left, values, right = np.linalg.svd(rng.normal(size=(3, 3)))
    matrix = left @ np.diag([values[0], values[1], 0.0]) @ right
    q, p = forms.null_vectors(matrix / scale, scale, np.ones(3))
    assert np.abs((matrix / scale) @ q).max() < 1e-9
    assert np.abs(p @ (matrix / scale) * scale).max() < 1e-14 * np.abs(p).max()
    assert p @ q == pytest.approx(1.0)


def test_tangents_are_of_length_one_though_scales_grow_along_the_path():
    """Along x = p, w = exp(6 p) from p = -3 on."""
    law = pk.Problem({"x": "p - x", "w": "exp(6*x) - w"}, parameters={"p": -3.0})
    curve, path = path_of(pk.continuation(law, "p", x0=[-3.0, 0.0], span=(-3.0, 3.0)))
    assert np.ptp(path.u[:, 1]) > 1e6 * curve.scale[1]
    np.testing.assert_allclose([curve.length(t) for t in path.tangent], 1.0, rtol=1e-9)
    samples = [Sample(*row) for row in zip(path.u, path.tangent, path.slopes, strict=True)]
    for a, b in itertools.pairwise(samples):
        x, w, p = between(curve, a, b, 0.5).u
        assert (x, w) == pytest.approx((p, np.exp(6.0 * p)), rel=1e-9)


def test_points_of_many_states_take_few_calls_of_f():
    """Sizes of terms need few digits: derivatives by differences are not refined for them."""
    n, calls = 20, [0]

    def f(x, p):
        calls[0] += 1
        return p * np.exp(-x) - x

    def count(points):
        options = pk.ContinuationOptions(
            max_step=1e-3, max_points=points, directions="forward", detect=()
        )
        problem = pk.Problem(
            f, [f"x{i}" for i in range(n)], {"p": 0.5},
            jac=lambda x, p: np.diag(-p * np.exp(-x) - 1.0),
        )  # fmt: skip
        calls[0] = 0
        branch = pk.continuation(
            problem, "p", x0=np.full(n, 0.35), span=(0.0, 2.0), options=options
        )
        assert branch.points.sizes["point"] == points + 1
        return calls[0]

    assert count(60) - count(20) <= 40 * 10
