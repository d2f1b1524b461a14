"""Points that are given solve f = 0: in any units, far from the origin, however f is given."""

from __future__ import annotations

import copy
import pickle

import mpmath
import numpy as np
import pytest
import sympy

import phasekit as pk

FOLD = 2.0 / (3.0 * np.sqrt(3.0))


def follow(f, state, parameters, parameter, x0, span, **options):
    problem = pk.Problem(f, state, parameters)
    return pk.continuation(
        problem, parameter, x0=x0, span=span, options=pk.ContinuationOptions(**options)
    )


def kinds(branch):
    return [one.kind for one in branch.special_points]


@pytest.mark.slow
@pytest.mark.parametrize("unit", [1e-12, 3e-11, 1e-3, 1e6, 1e12])
def test_units_of_the_state(unit):
    """The cusp and the pitchfork in any unit of x: the same points, and residuals at rounding."""
    cubic = f"mu + x/{unit!r} - (x/{unit!r})**3"
    branch = follow([cubic], "x", {"mu": -1.0}, "mu", [-1.3 * unit], (-1.5, 1.5))
    assert kinds(branch) == ["end", "fold", "fold", "end"]
    assert np.allclose([s["mu"] for s in branch.special("fold")], [FOLD, -FOLD], atol=1e-13)
    x, mu = branch.points.x.values / unit, branch.points.mu.values
    terms = np.abs(mu) + np.abs(x) + np.abs(x**3)
    assert np.max(np.abs(mu + x - x**3) / terms) < 1e-14
    assert branch.points.residual.max() < 1e-14

    fork = follow([f"mu*x/{unit!r} - (x/{unit!r})**3"], "x", {"mu": -1.0}, "mu", [0.0], (-1.5, 1.5))
    (point,) = fork.special("BP")
    side = point.switch()
    assert np.max(np.abs(side.points.x)) == pytest.approx(np.sqrt(1.5) * unit, rel=1e-12)


@pytest.mark.parametrize(
    ("form", "offset"),
    [("formula", 1e3), ("formula", 1e6), ("formula", 1e8), ("function", 1e3)],
)
def test_far_from_the_origin(form, offset):
    """A cusp of size 1 far from 0: rounding of x is all that is lost."""
    f = {
        "formula": [f"mu + (x-{offset!r}) - (x-{offset!r})**3"],
        "function": lambda x, mu: [mu + (x[0] - offset) - (x[0] - offset) ** 3],
    }[form]
    branch = follow(f, "x", {"mu": -1.0}, "mu", [offset - 1.3], (-1.5, 1.5))
    assert kinds(branch) == ["end", "fold", "fold", "end"]
    x, mu = branch.points.x.values - offset, branch.points.mu.values
    slope = np.abs(1.0 - 3.0 * x**2) + 1e-3
    assert np.max(np.abs(mu + x - x**3) / (slope * offset + 1.0)) < 2e-15


def test_a_tail_has_no_false_end():
    """However small p = 3 u (1 - u)/(1 - exp(-5 u)) is, it never meets its bound 0."""
    f = ["b*u*(1-u) - u*v - p*(1-exp(-5*u))", "-v + d*u*v"]
    branch = follow(f, ("u", "v"), {"p": 0.5, "b": 3.0, "d": 3.0}, "p", [0.8, 0.0], (0.0, 2.0))
    u, p = branch.points.u.values, branch.points.p.values
    away = np.abs(u) > 1e-9
    exact = 3.0 * u[away] * (1.0 - u[away]) / -np.expm1(-5.0 * u[away])
    assert away.sum() > 10
    # Where p is 1 - u, at the other end, it does meet the bound.
    assert np.all(np.abs(p[away] - exact) <= 1e-9 * exact + 1e-15)
    assert u.min() < -100.0
    assert branch.stops[1].reason != "bound"
    assert len(branch.special("LP")) == 1
    assert len(branch.special_points) >= 2
    assert all(one.status == "converged" for one in branch.special_points)


def test_a_bend_that_no_step_sees_is_passed():
    """A stirred reactor whose derivative by lam changes within 1e-13 of the start."""
    f = "-0.9-(1+lam)*x+lam*10/(1+lam*10*exp(-3*x/(1+x)))"
    branch = follow([f], "x", {"lam": 0.0}, "lam", [-0.9], (0.0, 2.0))
    assert branch.points.lam.max() == 2.0
    assert [round(s["lam"], 9) for s in branch.special("fold")] == [1.250669355, 0.377651258]


def test_the_same_verdict_in_random_units():
    """Random units of state, parameter and function, and random origins."""
    rng = np.random.default_rng(7)
    for _ in range(6):
        s, q, g = (10.0 ** rng.uniform(-9, 9) for _ in range(3))
        a = float(rng.uniform(-5, 5))
        y = f"(x/{s!r} - {a!r})"
        f = f"{g!r}*(mu/{q!r} + {y} - {y}**3)"
        branch = follow([f], "x", {"mu": -q}, "mu", [(a - 1.3) * s], (-1.5 * q, 1.5 * q))
        assert kinds(branch) == ["end", "fold", "fold", "end"]
        found = np.array([point["mu"] for point in branch.special("fold")]) / q
        assert np.allclose(found, [FOLD, -FOLD], atol=1e-12)
        assert branch.points.residual.max() < 1e-13


def test_what_f_raises_is_said():
    def f(x, mu):
        if x[0] < 0.2:
            raise ZeroDivisionError("my own words")
        return [mu - x[0]]

    branch = follow(f, "x", {"mu": 1.0}, "mu", [1.0], (-1.0, 2.0))
    assert branch.stops[0].reason == "not_finite"
    assert "my own words" in branch.stops[0].message

    def never(x, mu):
        raise ValueError("nothing here")

    with pytest.raises(pk.ConvergenceError, match="nothing here") as info:
        follow(never, "x", {"mu": 1.0}, "mu", [1.0], (-1.0, 2.0))
    assert isinstance(info.value.__cause__, ValueError)


def test_complex_values_are_refused():
    with pytest.raises(pk.ParameterError, match=r"\bf\b.*real"):
        follow(lambda x, mu: [mu - x[0] + 0j], "x", {"mu": 1.0}, "mu", [1.0], (-1.0, 2.0))

    def later(x, mu):
        root = (x[0] - 0.5 + 0j) ** 0.5
        return np.array([mu - (root if x[0] < 0.5 else root.real)])

    with pytest.raises(pk.ParameterError, match="complex"):
        follow(later, "x", {"mu": 1.0}, "mu", [1.5], (-1.0, 2.0))


@pytest.mark.slow
def test_a_kink_is_no_converged_fold():
    branch = follow(lambda x, mu: [mu - abs(x[0])], "x", {"mu": 1.0}, "mu", [1.0], (-1.0, 2.0))
    (kink,) = branch.special("LP")
    assert kink.status == "guess"
    assert kink.message


def test_many_states_keep_no_matrices():
    """Memory of a branch of 60 states grows with the states of a point, not with their square."""
    n = 60
    names = [f"u{i}" for i in range(n)]

    def f(u, c):
        out = -2.0 * u + c * np.exp(u) / (n + 1) ** 2
        out[1:] += u[:-1]
        out[:-1] += u[1:]
        return out

    def jac(u, c):
        slopes = np.diag(-2.0 + c * np.exp(u) / (n + 1) ** 2)
        return slopes + np.eye(n, k=1) + np.eye(n, k=-1)

    problem = pk.Problem(f, names, {"c": 0.0}, jac=jac)
    few = pk.ContinuationOptions(max_points=12, detect=())
    branch = pk.continuation(problem, "c", x0=np.zeros(n), span=(0.0, 3.0), options=few)
    kept = sum(t.record.nbytes + t.slopes.nbytes for t in branch.tracks if t is not None)
    assert kept <= 12 * 8 * (3 * n + 20)
    assert branch.points.sizes["point"] > 1
    assert np.all(branch.points.n_unstable == -1)
    assert branch.points.residual.max() < 1e-13
    full = pk.continuation(
        problem, "c", x0=np.zeros(n), span=(0.0, 3.0), options=pk.ContinuationOptions(max_points=12)
    )
    assert full.points.sizes["point"] > 1
    assert np.all(full.points.n_unstable == 0)
    np.testing.assert_array_equal(full.points.c, branch.points.c)
    longer = branch.extend(5)
    whole = pk.continuation(
        problem, "c", x0=np.zeros(n), span=(0.0, 3.0),
        options=pk.ContinuationOptions(max_points=17, detect=()),
    )  # fmt: skip
    np.testing.assert_array_equal(longer.points.u7, whole.points.u7)


def _logistic(x, r):
    return [r * x[0] * (1.0 - x[0]) - 0.1]


@pytest.mark.parametrize("f", [["r*x - x**3"], _logistic])
def test_problems_travel(f):
    """Copies and pickles of a problem give the same branch, to the last bit."""
    problem = pk.Problem(f, "x", {"r": 1.0})
    branch = pk.continuation(problem, "r", x0=[0.9], span=(0.7, 2.0))
    for other in (copy.copy(problem), copy.deepcopy(problem), pickle.loads(pickle.dumps(problem))):
        again = pk.continuation(other, "r", x0=[0.9], span=(0.7, 2.0))
        np.testing.assert_array_equal(again.points.x, branch.points.x)


@pytest.mark.parametrize("f", [["r*x - x**3"], _logistic])
def test_branches_and_special_points_travel(f):
    """Copies and pickles of a branch hold the same points, and go on as it does."""
    options = pk.ContinuationOptions(max_points=40, bounds={"x": (-3.0, 3.0)}, scales={"x": 2.0})
    branch = pk.continuation(
        pk.Problem(f, "x", {"r": 1.0}), "r", x0=[0.9], span=(-1.0, 2.0), options=options
    )
    number = next(i for i, s in enumerate(branch.special_points) if s.kind != "end")
    special = branch.special_points[number]
    for travel in (copy.copy, copy.deepcopy, lambda x: pickle.loads(pickle.dumps(x))):
        again = travel(branch)
        assert again.to_dataset().identical(branch.to_dataset())
        assert repr(again) == repr(branch)
        assert again.curve.options == options
        point = travel(special)
        assert point is point.branch.special_points[number]
        assert repr(point) == repr(special)
        np.testing.assert_array_equal(point.directions, special.directions)


LORENZ = ["sigma*(y - x)", "r*x - y - x*z", "x*y - b*z"]
PREY = ["b*u*(1-u) - u*v - p*(1-exp(-5*u))", "-v + d*u*v"]


@pytest.mark.parametrize(
    ("f", "state", "parameters", "parameter", "x0", "span"),
    [
        (LORENZ, "xyz", {"r": 0.5, "sigma": 10.0, "b": 2.0}, "r", [0, 0, 0], (0.5, 3.0)),
        (PREY, "uv", {"p": 0.5, "b": 3.0, "d": 3.0}, "p", [0.8, 0.0], (0.0, 2.0)),
        (["p*x - x**2"], "x", {"p": 1.0}, "p", [1.0], (-1.0, 1.0)),
        (["exp(30*(1 - 1/x)) - p"], "x", {"p": 1.0}, "p", [1.1], (0.5, 20.0)),
        (lambda x, p: [p * x[0] - x[0] ** 2], "x", {"p": 1.0}, "p", [1.0], (-1.0, 1.0)),
    ],
)  # fmt: skip
def test_f_is_rounding_of_its_terms_at_every_point(f, state, parameters, parameter, x0, span):
    """Also where branches cross at zero, and on the branches that leave from there."""
    branch = follow(f, tuple(state), parameters, parameter, x0, span)
    branches = [branch, *(point.switch() for point in branch.special("BP"))]
    assert len(branches) == 1 + len(branch.special("BP"))
    for one in branches:
        assert one.points.sizes["point"] > 3
        assert one.points.residual.max() < 1e-13
        assert one.messages == ()


@pytest.mark.parametrize(
    ("f", "state", "x0", "exact"),
    [
        (["z + 10 - p*exp(x^2)", "x^2 - z"], "xz", [1, 1], lambda x: np.log(x * x + 10) - x * x),
        (["x^2 - z", "z + 10 - p*exp(z)"], "xz", [1, 1], lambda x: np.log(x * x + 10) - x * x),
        (["z + 10 - p*exp(x^3)", "x - z"], "xz", [1, 1], lambda x: np.log(x + 10) - x**3),
    ],
)
def test_a_parameter_far_below_its_scale_times_what_is_as_large(f, state, x0, exact):
    """Such a p = g(x) exp(-x^k) is found as well as its logarithm, down to 1e-300."""
    start = float(np.exp(exact(1.0)))
    branch = follow(f, tuple(state), {"p": start}, "p", x0, (0.0, 2.0 * start))
    x, p = branch.points.x.values, branch.points.p.values
    assert p.min() < 1e-280
    np.testing.assert_allclose(np.log(p), exact(x), atol=1e-9)
    assert branch.points.residual.max() < 1e-12


def test_sizes_of_terms_bound_the_rounding_of_a_formula():
    """|computed - exact| of each formula against what its terms allow, exact in 60 digits."""
    texts = ["1 - exp(-5*x)", "exp(40*(x - y)) - p", "(x - y)**3/(p - y)", "sqrt(x - y*p) + x**p"]
    rng = np.random.default_rng(3)
    problem = pk.Problem(texts, tuple("xyzw"), {"p": 1.0})
    field = problem.field
    exact = sympy.lambdify(sympy.symbols("x y p"), [sympy.sympify(t) for t in texts], "mpmath")
    u = rng.uniform(0.9, 1.1, (40, 5))
    u[:, 1] *= 0.3
    values, terms = field.with_terms(u, np.array([1.0]), (0,))
    with mpmath.workdps(60):
        wanted = [exact(*map(mpmath.mpf, row[[0, 1, 4]].tolist())) for row in u]
        off = [[abs(mpmath.mpf(a) - b) for a, b in zip(*two, strict=True)]
               for two in zip(values.tolist(), wanted, strict=True)]  # fmt: skip
    ratio = np.array(off, dtype=float) / (2.0**-52 * terms)
    assert ratio.shape == (40, 4)
    assert ratio.max() < 4.0
    assert ratio.max(axis=0).min() > 1e-3  # and not by far too much


def test_a_noisy_function_says_so():
    """Where f is known to 1e-9 only, points are no better, and the branch says it."""

    def f(x, p):
        return [p - x[0] + 1e-9 * np.sin(1e13 * x[0] * x[0])]

    noisy = pk.ContinuationOptions(tolerance=1e-7)
    branch = pk.continuation(
        pk.Problem(f, "x", {"p": 0.0}), "p", x0=[0.0], span=(-1.0, 1.0), options=noisy
    )
    assert branch.points.residual.max() > 1e-11
    assert len(branch.messages) == 1
    assert "points solve f = 0" in branch.messages[0]
    assert branch.messages[0] in repr(branch)


@pytest.mark.parametrize(("height", "width"), [(1e-2, 1e-4), (2e-4, 1e-5), (2e-5, 1e-6)])
def test_a_bend_that_is_narrower_than_steps_is_said(height, width):
    """Two folds within a width that no point of the path falls into."""

    def f(x, p):
        return [p - (x[0] - height * np.tanh((x[0] - 0.3) / width))]

    branch = follow(f, "x", {"p": 0.0}, "p", [0.0], (-1.0, 1.0))
    (message,) = branch.messages
    assert "special points there may be missed" in message
    low, high = (float(word.strip(",:")) for word in message.split() if word[0] == "0")
    assert low < 0.3 - height < 0.3 + height < high
    smooth = follow(["p - x + x**3/3"], "x", {"p": 0.0}, "p", [0.0], (-1.0, 1.0))
    assert smooth.messages == ()
