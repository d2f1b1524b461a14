"""Fields on grids by formulas, against SymPy, dense differences and manufactured solutions."""

from __future__ import annotations

import json
import pickle

import numpy as np
import pytest
import sympy as sp

import phasekit as pk
from phasekit.numerics.pointwise import pointwise

VALUES = {"D": 0.7, "A": 2.0, "B": 5.0}
BRUSSELATOR = {"u": "D*lap(u) + u^2*v - (B + 1)*u + A", "v": "D/2*lap(v) + B*u - u^2*v"}


def dense(axis, order):
    """The derivative of an axis as a matrix of all places and both ends, from a stencil's words."""
    n, h = axis.n, axis.step
    weights = {1: [-1 / (2 * h), 0, 1 / (2 * h)], 2: [1 / h**2, -2 / h**2, 1 / h**2]}[order]
    matrix = np.zeros((n, n + 2))
    for i in range(n):
        for k, weight in zip((i - 1, i, i + 1), weights, strict=True):
            if axis.periodic:
                matrix[i, k % n] += weight
            elif 0 <= k < n:
                matrix[i, k] += weight
            else:
                side = 0 if k < 0 else 1
                if axis.boundary[side] == "dirichlet":
                    matrix[i, n + side] += weight
                else:
                    matrix[i, i] += weight
                    matrix[i, n + side] += weight * (h if side else -h)
    return matrix


@pytest.mark.parametrize("more", [{}, {"boundary": "periodic"}, {"values": {"u": (0.5, "a")}}])
def test_an_axis_is_written_as_the_call_that_makes_it(more):
    axis = pk.grid("x", -1.0, 2.5, 5, **more)
    assert eval(repr(axis), {"grid": pk.grid}) == axis


KINDS = ["dirichlet", "neumann", "periodic", ("dirichlet", "neumann"), ("neumann", "dirichlet")]


@pytest.mark.parametrize("boundary", KINDS, ids=str)
def test_derivatives_of_an_axis(boundary):
    """Derivatives with values at the ends are those of a dense matrix."""
    ends = {} if boundary == "periodic" else {"values": {"u": ("a", -0.4)}}
    axis = pk.grid("x", -1.0, 2.0, 7, boundary=boundary, **ends)
    problem = pk.Problem(
        {"u": "lap(u) + b*dx(u) + x*u"}, parameters={"a": 1.5, "b": 2.0}, grid=axis
    )
    x = np.random.default_rng(1).uniform(size=7)
    whole = np.concatenate([x, [1.5, -0.4]])
    wanted = dense(axis, 2) @ whole + 2.0 * dense(axis, 1) @ whole + axis.coordinates * x
    value, slopes = problem.derivatives(x)
    np.testing.assert_allclose(value, wanted, rtol=1e-13, atol=1e-13)
    matrix = (dense(axis, 2) + 2.0 * dense(axis, 1))[:, :7] + np.diag(axis.coordinates)
    np.testing.assert_allclose(slopes, matrix, rtol=1e-13, atol=1e-13)


def test_derivatives_are_those_of_sympy():
    """Rates and slopes of two fields, cell by cell in SymPy."""
    n, h = 5, 1.0 / 6.0
    axis = pk.grid("x", 0.0, 1.0, n, values={"u": "A", "v": "B/A"})
    problem = pk.Problem(BRUSSELATOR, parameters=VALUES, grid=axis)
    u, v = sp.symbols(f"u0:{n}"), sp.symbols(f"v0:{n}")
    D, A, B = (sp.Float(VALUES[name]) for name in "DAB")
    rates = []
    for own, (low, high), part, sign in (
        (u, (A, A), D, 1), (v, (B / A, B / A), D / 2, -1),
    ):  # fmt: skip
        wide = [low, *own, high]
        for i in range(n):
            lap = (wide[i] - 2 * wide[i + 1] + wide[i + 2]) / h**2
            source = A - (B + 1) * u[i] if sign == 1 else B * u[i]
            rates.append(part * lap + sign * u[i] ** 2 * v[i] + source)
    x = np.random.default_rng(2).uniform(0.5, 2.0, 2 * n)
    at = dict(zip([*u, *v], x, strict=True))
    value, slopes = problem.derivatives(x)
    np.testing.assert_allclose(value, [float(one.subs(at)) for one in rates], rtol=1e-12)
    matrix = sp.Matrix(rates).jacobian(sp.Matrix([*u, *v])).subs(at)
    np.testing.assert_allclose(slopes, np.array(matrix, float), rtol=1e-12, atol=1e-12)


@pytest.mark.parametrize(
    ("formulas", "axes"),
    [
        ({"u": "A*u - u - 2*lap(u) - lap(lap(u)) + 2*u^2 - u^3"}, {"boundary": "neumann"}),
        ({"u": "lap(u^2) + dx(u*v)", "v": "-u*dx(v) + D*dxx(v) + lap(lap(u)*v)"}, {}),
        ({"u": "dx(D*dx(u)*exp(u)) + x"}, {"boundary": "neumann"}),
        ({"u": "dxx(u*dx(v)) + dx(u)^2", "v": "dx(dx(dx(v))*u)"}, {"boundary": "neumann"}),
    ],
    ids=["inner", "products", "nonlinear diffusion", "odd"],
)
def test_slopes_of_derivatives_of_formulas(formulas, axes):
    """Slopes of derivatives of formulas and of derivatives are those of the rates' differences."""
    problem = pk.Problem(formulas, parameters=VALUES, grid=pk.grid("x", 0.0, 3.0, 8, **axes))
    x = np.random.default_rng(3).uniform(0.5, 1.0, len(problem.state))
    _, slopes = problem.derivatives(x)
    h = 1e-5
    ahead, behind = (np.array([problem(x + k * one) for one in np.eye(len(x))]).T for k in (h, -h))
    np.testing.assert_allclose(
        slopes, (ahead - behind) / (2 * h), atol=1e-8 * np.max(np.abs(slopes))
    )


def error(n, kind, at):
    """Of -u'' = g with a known u: the largest error of the discrete solution."""
    u, slope = sp.sin(2 * at) + sp.cos(3 * at) / 2, None
    if kind == "periodic":
        u = sp.sin(2 * sp.pi * at) + sp.cos(4 * sp.pi * at) / 2
    low, high = 0, 1
    slope = sp.diff(u, at)
    pair = ("neumann", "dirichlet") if kind == "mixed" else (kind, kind)
    ends = tuple(
        float((slope if one == "neumann" else u).subs(at, end))
        for one, end in zip(pair, (low, high), strict=True)
    )
    more = {} if kind == "periodic" else {"values": {"u": ends}}
    axis = pk.grid("x", low, high, n, boundary=pair, **more)
    right = str(sp.expand(u - sp.diff(u, at, 2) + sp.diff(u, at)))
    problem = pk.Problem({"u": f"lap(u) - dx(u) - u + {right}"}, parameters={}, grid=axis)
    value, slopes = problem.derivatives(np.zeros(n))
    solution = np.linalg.solve(slopes, -value)
    return np.max(np.abs(solution - sp.lambdify(at, u)(axis.coordinates)))


@pytest.mark.parametrize("kind", ["dirichlet", "neumann", "periodic", "mixed"])
def test_errors_go_with_the_square_of_the_step(kind):
    """Twice as many places: a quarter of the error."""
    at = sp.Symbol("x")
    coarse, fine = error(40, kind, at), error(80, kind, at)
    assert fine < 2e-3
    assert 3.7 < coarse / fine < 4.2


@pytest.mark.slow
@pytest.mark.parametrize(
    "formula",
    [
        "dx(dx(u))", "dx(D*dx(u))", "dx(exp(u)*dx(u))", "dxx(dx(u))", "lap(dx(u)^2)", "dx(u*v)",
        "dx(dx(dx(u)))", "lap(lap(u))", "dx(sin(dx(u)))",
    ],
)  # fmt: skip
@pytest.mark.parametrize("boundary", ["neumann", "periodic"])
def test_derivatives_of_formulas_at_ends(formula, boundary):
    """Also next to ends, twice as many places make a quarter of the error."""
    at, D = sp.Symbol("x"), 0.7
    wave = 2 * sp.pi if boundary == "periodic" else sp.pi
    u, v = sp.cos(wave * at) / 3, 1 + sp.cos(2 * wave * at) / 5
    words = {
        "dx": lambda f: sp.diff(f, at), "dxx": lambda f: sp.diff(f, at, 2),
        "lap": lambda f: sp.diff(f, at, 2), "u": u, "v": v, "D": D, "x": at,
    }  # fmt: skip
    exact = sp.lambdify(at, eval(formula.replace("^", "**"), vars(sp) | words))
    errors = []
    for n in (64, 128):
        axis = pk.grid("x", 0.0, 1.0, n, boundary=boundary)
        problem = pk.Problem({"u": formula, "v": "0"}, parameters={"D": D}, grid=axis)
        x = np.concatenate([sp.lambdify(at, one)(axis.coordinates) for one in (u, v)])
        errors.append(np.max(np.abs(problem(x)[:n] - exact(axis.coordinates))))
    assert 3.6 < errors[0] / errors[1] < 4.4


def plane(n):
    """The largest error of a Poisson equation of the plane with a known solution."""
    axes = [
        pk.grid("x", 0.0, 1.0, n, values={"u": (1.0, float(np.e))}),
        pk.grid("y", 0.0, 1.0, 2 * n, boundary="periodic"),
    ]
    # u = exp(x) + x (1 - x) sin(2 pi y)
    wave = "sin(2*pi*y)"
    right = f"exp(x) - 2*{wave} - 4*pi^2*x*(1 - x)*{wave} + x*(1 - x)*2*pi*cos(2*pi*y)"
    problem = pk.Problem({"u": f"lap(u) + dy(u) - ({right})"}, parameters={}, grid=axes)
    value, slopes = problem.derivatives(np.zeros(2 * n * n))
    x, y = np.meshgrid(axes[0].coordinates, axes[1].coordinates, indexing="ij")
    wanted = np.exp(x) + x * (1 - x) * np.sin(2 * np.pi * y)
    return np.max(np.abs(np.linalg.solve(slopes, -value).reshape(n, 2 * n) - wanted))


def test_the_plane():
    """The same in the plane, with other ends along each axis."""
    coarse, fine = plane(8), plane(16)
    assert fine < 5e-3
    assert 3.4 < coarse / fine < 4.3


def test_formulas_are_compiled_once_for_all_places():
    """A finer grid compiles nothing anew."""
    one = pk.Problem(BRUSSELATOR, parameters=VALUES, grid=pk.grid("x", 0.0, 1.0, 10))
    one([1.0] * 20)
    compiled = pointwise.cache_info().misses
    other = pk.Problem(BRUSSELATOR, parameters=VALUES, grid=pk.grid("x", 0.0, 1.0, 500))
    other([1.0] * 1000)
    assert pointwise.cache_info().misses == compiled


def test_copies():
    """A copy is the same problem."""
    axis = pk.grid("x", 0.0, 1.0, 6, values={"u": "A", "v": ("B/A", 1)})
    problem = pk.Problem(BRUSSELATOR, parameters=VALUES, grid=axis)
    copy = pickle.loads(pickle.dumps(problem))
    assert copy == problem
    assert copy.replace(A=1.0) != problem
    a, b = sp.symbols("a b")
    ends = pk.grid("x", 0.0, 1.0, 3, values={"u": (a / 7 + sp.sin(b), sp.Rational(1, 3))})
    other = pk.Problem({"u": "lap(u)"}, parameters={"a": 1.0, "b": 2.0}, grid=ends)
    for one in (problem, other):
        assert pk.Problem.from_specification(json.loads(json.dumps(one.specification()))) == one
    x = np.linspace(0.5, 2.0, 12)
    np.testing.assert_array_equal(copy(x), problem(x))


def test_many_states_at_once():
    """Columns are states, with parameters of their own where these are arrays."""
    axis = pk.grid("x", 0.0, 1.0, 5, values={"u": "A"})
    problem = pk.Problem({"u": "lap(u^2) - D*u"}, parameters={"D": 1.0, "A": 2.0}, grid=axis)
    x = np.random.default_rng(4).uniform(size=(5, 3))
    given = {"D": np.array([1.0, 2.0, 3.0]), "A": 0.5}
    wanted = [problem.f(one, D=d, A=0.5) for one, d in zip(x.T, given["D"], strict=True)]
    np.testing.assert_array_equal(problem.f(x, **given), np.stack(wanted, axis=1))
    same = [problem.f(one, D=1.0, A=0.5) for one in x.T]
    np.testing.assert_array_equal(problem.f(x, D=1.0, A=0.5), np.stack(same, axis=1))


def test_definitions_and_functions():
    """Names of formulas, and functions, stand in formulas of fields."""
    axis = pk.grid("x", 0.0, 1.0, 6)
    short = pk.Problem(
        {"u": "lap(u) + f(u)*c"}, parameters={"r": 0.5}, grid=axis,
        functions={"f(s)": "exp(s)"}, definitions={"c": "r + x"},
    )  # fmt: skip
    long = pk.Problem({"u": "lap(u) + exp(u)*(r + x)"}, parameters={"r": 0.5}, grid=axis)
    np.testing.assert_allclose(short([0.3] * 6), long([0.3] * 6), rtol=1e-14)


@pytest.mark.slow
def test_bratu():
    """The fold of u'' + r exp(u) = 0 in the square law of 3.513830719125."""
    folds = []
    for n in (15, 31):
        bratu = pk.Problem(
            {"u": "lap(u) + r*exp(u)"}, parameters={"r": 0.1}, grid=pk.grid("x", 0.0, 1.0, n)
        )
        branch = pk.continuation(bratu, "r", x0=np.zeros(n), span=(0.0, 4.0))
        folds.append(float(branch.special("fold")[0]["r"]))
    errors = np.array(folds) - 3.513830719125
    assert 3.9 < errors[0] / errors[1] < 4.1
    extrapolated = (4 * folds[1] - folds[0]) / 3
    assert abs(extrapolated - 3.513830719125) < 1e-4


@pytest.mark.parametrize(
    ("f", "more", "message"),
    [
        ({"u": "lap(w)"}, {}, r"f\['u'\]: .*unknown symbol w"),
        ({"u": "lap(u, u)"}, {}, "lap with 2 arguments"),
        ({"u": "dy(u)"}, {}, r"unknown function dy"),
        ({"u": "floor(u)"}, {}, r"f\['u'\]: .*unknown function floor"),
        ("lap(u)", {}, "f: .*mapping from fields"),
        ({"lap": "0"}, {}, "f: .*other names than the derivatives"),
        ({"x": "0"}, {}, "grid: .*neither fields nor parameters"),
        ({"u": "lap(u)"}, {"state": ("u",)}, "state: .*None with a grid"),
        ({"u": "lap(u)"}, {"grid": 3}, "grid: .*pk.grid"),
        ({"u": "lap(u)"}, {"grid": []}, "grid: .*pk.grid"),
        ({"u": "lap(u)"}, {"grid": [pk.grid("x", 0, 1, 3)] * 2}, "grid: .*names that differ"),
        (
            {"u": "lap(u)"}, {"grid": pk.grid("x", 0, 1, 3, values={"w": 1})},
            "values of the axis x: field 'w' is unknown",
        ),
        (
            {"u": "lap(u)"}, {"grid": pk.grid("x", 0, 1, 3, values={"u": "q"})},
            "unknown symbol q",
        ),
        (
            {"u": "lap(u^2)"},
            {"grid": pk.grid("x", 0, 1, 3, boundary="neumann", values={"u": 1})},
            "no value beyond the neumann end of x",
        ),
        *(
            ({"u": formula}, {"grid": pk.grid("x", 0, 1, 3, boundary=kind)}, f"the {end} end of x")
            for kind, end, formula in (
                ("neumann", "neumann", "dx(x*u)"),
                ("neumann", "neumann", "lap(u + dx(u))"),
                ("neumann", "neumann", "dx(x)"),
                ("dirichlet", "dirichlet", "dx(dx(u))"),
                ("dirichlet", "dirichlet", "lap(u*dx(u)^2)"),
                (("neumann", "dirichlet"), "dirichlet", "dx(D*dx(u))"),
                (("dirichlet", "neumann"), "neumann", "dxx(x*u)"),
            )
        ),
        (
            {"u": "dx(dx(u))"},
            {"grid": pk.grid("x", 0, 1, 3, boundary="neumann", values={"u": "D"})},
            "the neumann end of x",
        ),
    ],
)  # fmt: skip
def test_unusable_formulas(f, more, message):
    """What cannot be taken is named."""
    given = {"parameters": {"D": 1.0}, "grid": pk.grid("x", 0.0, 1.0, 5)} | more
    with pytest.raises(pk.ParameterError, match=message):
        pk.Problem(f, **given)([0.0] * 3)


@pytest.mark.parametrize(
    ("given", "more", "message"),
    [
        (("lambda", 0, 1, 5), {}, "name: .*identifier"),
        (("x", 1, 0, 5), {}, "high: .*> low"),
        (("x", 0, 1, 2), {}, "n: .*>= 3"),
        (("x", 0, 1, 5), {"boundary": "robin"}, "boundary"),
        (("x", 0, 1, 5), {"boundary": ("periodic", "neumann")}, "boundary: .*both ends"),
        (("x", 0, 1, 5), {"boundary": 3}, "boundary: .*pair"),
        (("x", 0, 1, 5), {"values": 3}, "values: .*mapping"),
        (("x", 0, 1, 5), {"values": {"u": (1, 2, 3)}}, r"values\['u'\]: .*pair"),
        (("x", 0, 1, 5), {"boundary": "periodic", "values": {"u": 1}}, "values: .*periodic"),
    ],
)
def test_unusable_axes(given, more, message):
    """What is no axis is named."""
    with pytest.raises(pk.ParameterError, match=message):
        pk.grid(*given, **more)


@pytest.mark.parametrize(
    "formula",
    ["dx(abs(dx(u)))", "lap(sqrt(dx(u)^2))", "dx(u*(dx(u)^2)^(3/2))", "dx(log(dx(u)^2))"],
)
def test_kinks_at_ends_are_refused(formula):
    with pytest.raises(pk.ParameterError, match="or a kink there"):
        pk.Problem({"u": formula}, grid=pk.grid("x", 0.0, 1.0, 8, boundary="neumann"))


@pytest.mark.parametrize("formula", ["dx(sqrt(1 + dx(u)^2))", "dx(abs(u)*dx(u))", "lap(1/u)"])
def test_formulas_that_are_smooth_at_ends_are_taken(formula):
    pk.Problem({"u": formula}, grid=pk.grid("x", 0.0, 1.0, 8, boundary="neumann"))
