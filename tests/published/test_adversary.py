"""Cases made to break a continuation: domains, shapes, scales, degenerate starts, large systems."""

from __future__ import annotations

import math

import numba
import numpy as np
import pytest
from published import bratu, compare
from published.compare import kind_of, state_of

import phasekit as pk


def specials(branch, kind=None):
    found = [one for one in branch.special_points if kind_of(one) != "end"]
    return [one for one in found if kind is None or kind_of(one) == kind]


def values(branch, parameter, kind):
    return sorted(float(one.parameters[parameter]) for one in specials(branch, kind))


def same(found, wanted, **tolerances):
    """Whether as many were found, with these values."""
    return len(found) == len(wanted) and np.allclose(found, wanted, **tolerances)


def one_state(f, parameters, **kwargs):
    return pk.Problem(f, state=("x",), parameters=parameters, **kwargs)


# --- what f returns, and what parameters are -------------------------------------------------


@pytest.mark.parametrize(
    "wrap",
    [
        lambda x, y: [x, y],
        lambda x, y: (x, y),
        lambda x, y: np.array([x, y]),
        lambda x, y: np.array([[x], [y]]),
        lambda x, y: [np.float32(0) + x, np.float64(y)],
    ],
    ids=["list", "tuple", "array", "column", "scalars"],
)
def test_what_f_may_return(wrap):
    def f(state, mu, w):
        x, y = state
        return wrap(mu - x**2, w * x - 5 * y)

    problem = pk.Problem(f, state=("x", "y"), parameters={"mu": 1, "w": 2})
    branch = pk.continuation(problem, "mu", x0=(1, 1), span=(-1, 2))
    (fold,) = specials(branch)
    assert kind_of(fold) == "fold"
    assert abs(fold.parameters["mu"]) < 1e-8
    assert np.abs(state_of(fold)).max() < 1e-8


def test_one_state_may_be_a_number():
    branch = pk.continuation(
        one_state(lambda x, mu: mu - x[0] ** 2, {"mu": 1}), "mu", x0=1, span=(-1, 2)
    )
    assert same(values(branch, "mu", "fold"), [0.0], atol=1e-8)


def test_f_may_write_into_its_argument():
    """A right-hand side that spoils the array it got does not spoil the branch."""

    def f(x, mu):
        x **= 2
        return mu - x

    branch = pk.continuation(one_state(f, {"mu": 1.0}), "mu", x0=[1.0], span=(-1, 2))
    assert same(values(branch, "mu", "fold"), [0.0], atol=1e-8)


def test_f_may_return_the_same_array_each_time():
    out = np.empty(2)

    def f(state, mu):
        out[0] = mu - state[0] ** 2
        out[1] = state[0] - 5 * state[1]
        return out

    problem = pk.Problem(f, state=("x", "y"), parameters={"mu": 1.0})
    branch = pk.continuation(problem, "mu", x0=[1.0, 0.2], span=(-1, 2))
    assert same(values(branch, "mu", "fold"), [0.0], atol=1e-8)


@pytest.mark.parametrize("result", [[1.0], [1.0, 2.0, 3.0], np.ones((2, 2)), None, "text"])
def test_a_wrong_shape_is_named(result):
    def run():
        problem = pk.Problem(lambda state, mu: result, state=("x", "y"), parameters={"mu": 1.0})
        pk.continuation(problem, "mu", x0=[1.0, 1.0], span=(-1, 2))

    with pytest.raises(pk.ParameterError, match=r"\bf\b"):
        run()


def test_an_error_in_f_is_not_swallowed():
    def f(state, mu):
        return [undefined_name * mu]  # noqa: F821

    with pytest.raises((NameError, pk.ParameterError), match="undefined_name"):
        pk.continuation(one_state(f, {"mu": 1.0}), "mu", x0=[1.0], span=(-1, 2))


# --- domains ---------------------------------------------------------------------------------


@pytest.mark.parametrize("log", [math.log, np.log], ids=["raises", "returns NaN"])
def test_f_that_is_not_defined_everywhere(log):
    """Log x = mu x has its fold at (e, 1/e); Newton must not leave x > 0."""
    branch = pk.continuation(
        one_state(lambda x, mu: [log(x[0]) - mu * x[0]], {"mu": 0.1}),
        "mu",
        x0=[1.1],
        span=(-5.0, 1.0),
        options=pk.ContinuationOptions(bounds={"x": (0.0, 30.0)}),
    )
    assert same(values(branch, "mu", "fold"), [math.exp(-1)], atol=1e-9)
    assert branch.points.mu.min() == -5.0
    assert np.abs(np.log(branch.points.x) - branch.points.mu * branch.points.x).max() < 1e-9


@pytest.mark.parametrize("sqrt", [math.sqrt, np.sqrt], ids=["raises", "returns NaN"])
def test_a_branch_that_ends_where_f_does(sqrt):
    """Mu = sqrt(x) ends at the origin."""
    branch = pk.continuation(
        one_state(lambda x, mu: [mu - sqrt(x[0])], {"mu": 1.0}), "mu", x0=[1.0], span=(-1, 2)
    )
    assert 0.0 <= branch.points.mu.min() < 0.05
    assert branch.points.mu.max() == 2.0
    assert not specials(branch)


def test_a_pole():
    """1/x = mu passes the pole of neither side: it goes to the bound."""
    branch = pk.continuation(
        one_state(["1/x - mu"], {"mu": 1.0}),
        "mu",
        x0=[1.0],
        span=(-1, 2),
        options=pk.ContinuationOptions(bounds={"x": (-50.0, 50.0)}),
    )
    assert branch.points.x.min() > 0.0
    assert branch.points.x.max() == 50.0
    assert not specials(branch)


# --- circles and turns -----------------------------------------------------------------------


def pendulum(periods):
    return pk.Problem(["mu - sin(phi)"], state=("phi",), parameters={"mu": 0.0}, **periods)


def test_a_closed_branch_on_the_circle():
    """Mu = sin phi closes after one turn: two folds, each once."""
    branch = pk.continuation(
        pendulum({"periods": {"phi": 2 * math.pi}}), "mu", x0=[0.0], span=(-2.0, 2.0)
    )
    assert same(values(branch, "mu", "fold"), [-1.0, 1.0], atol=1e-12)
    assert len(specials(branch)) == 2
    assert np.ptp(branch.points.phi.values) > 6.0


def test_the_same_on_the_line_has_a_fold_every_half_turn():
    branch = pk.continuation(
        pendulum({}),
        "mu",
        x0=[0.0],
        span=(-2.0, 2.0),
        options=pk.ContinuationOptions(bounds={"phi": (-20.0, 20.0)}),
    )
    turns = np.pi / 2 + np.pi * np.arange(-7, 7)
    turns = turns[np.abs(turns) < 20.0]
    found = sorted(float(state_of(one)[0]) for one in specials(branch, "fold"))
    assert same(found, turns, atol=1e-10)
    assert abs(branch.points.phi.min() + 20.0) < 1e-12


def test_an_angle_that_winds_many_times():
    problem = pk.Problem(
        ["sin(mu - phi)"], state=("phi",), parameters={"mu": 0.0}, periods={"phi": 2 * math.pi}
    )
    branch = pk.continuation(problem, "mu", x0=[0.0], span=(0.0, 40.0))
    assert not specials(branch)
    off = np.sin(0.5 * (branch.points.phi - branch.points.mu))
    assert np.abs(off).max() < 1e-12
    assert branch.points.mu.max() == 40.0


def test_a_figure_of_eight_closes_once():
    """Branches cross at the origin of mu^2 = x^2 - x^4: a closed curve through a branch point."""
    branch = pk.continuation(
        one_state(["mu**2 - x**2 + x**4"], {"mu": 0.0}), "mu", x0=[1.0], span=(-1.0, 1.0)
    )
    assert same(values(branch, "mu", "fold"), [-0.5] * 2 + [0.5] * 2, atol=1e-10)
    assert 1 <= len(values(branch, "mu", "branch_point")) <= 2
    assert len(branch.points.x) < 2000


# --- degenerate places -----------------------------------------------------------------------


def test_a_tangency_of_branches_is_passed():
    """X (x - mu^2) = 0: the branches touch; each is followed, and nothing is called a fold."""
    for start, curve in ((0.0, lambda mu: 0.0 * mu), (1.0, lambda mu: mu**2)):
        branch = pk.continuation(
            one_state(["x*(x - mu**2)"], {"mu": -1.0}), "mu", x0=[start], span=(-1.0, 1.0)
        )
        assert not specials(branch, "fold")
        assert not specials(branch, "hopf")
        if branch.points.mu.max() == 1.0:
            assert np.abs(branch.points.x - curve(branch.points.mu)).max() < 1e-6


def test_an_isolated_point_does_not_hang():
    """x^2 + mu^2 = 0 is one point; there is no branch to follow."""
    try:
        branch = pk.continuation(
            one_state(["x**2 + mu**2"], {"mu": 0.0}), "mu", x0=[0.0], span=(-1.0, 1.0)
        )
    except pk.ConvergenceError:
        return
    assert np.abs(branch.points.x).max() < 1e-4


@pytest.mark.parametrize(
    ("equation", "start", "kinds"),
    [
        ("mu - x**2", 0.0, ["fold"]),
        ("mu*x - x**3", 0.0, ["branch_point"]),
        ("mu*x - x**2", 0.0, ["branch_point"]),
        ("x**2 + mu**2 - 1", 0.0, ["fold", "fold"]),
    ],
)
def test_a_start_on_a_special_point(equation, start, kinds):
    mu = 1.0 if len(kinds) == 2 else 0.0
    branch = pk.continuation(one_state([equation], {"mu": mu}), "mu", x0=[start], span=(-2.0, 2.0))
    assert sorted(kind_of(one) for one in specials(branch)) == kinds
    assert len(branch.points.x) > 10


def test_a_start_at_the_end_of_the_span():
    for mu in (0.25, 4.0):
        branch = pk.continuation(
            one_state(["mu - x**2"], {"mu": mu}), "mu", x0=[math.sqrt(mu)], span=(0.25, 4.0)
        )
        assert (branch.points.mu.min(), branch.points.mu.max()) == (0.25, 4.0)
        assert not specials(branch)


@pytest.mark.parametrize("high", [0.0, 0.5])
@pytest.mark.parametrize("form", ["formula", "function"])
def test_a_branch_point_on_the_end_of_the_span(form, high):
    """f_x is singular there, and the branch ends on it all the same."""
    f = {"formula": ["(p - h)*x - x**3"], "function": lambda x, p, h: [(p - h) * x[0] - x[0] ** 3]}
    problem = one_state(f[form], {"p": -1.0, "h": high})
    branch = pk.continuation(problem, "p", x0=[0.0], span=(-1.0, high))
    assert [stop.reason for stop in branch.stops] == ["bound", "bound"]
    assert branch.points.p.max() == high
    assert abs(*values(branch, "p", "branch_point") - np.array(high)) < 1e-12


def test_a_start_where_f_has_no_derivatives_is_refused():
    problem = one_state(lambda x, p: [math.log(x[0] + 1) - p + math.sqrt(x[0])], {"p": 0.0})
    with pytest.raises(pk.ConvergenceError, match=r"x0: the derivatives of f are not finite"):
        pk.continuation(problem, "p", x0=[0.0], span=(0.0, 2.0))


def test_a_start_on_the_edge_of_a_domain_is_followed_inside():
    problem = one_state(lambda x, p: [math.log(x[0] + 1) - p + 0 * math.sqrt(x[0])], {"p": 0.0})
    branch = pk.continuation(problem, "p", x0=[0.0], span=(0.0, 2.0))
    np.testing.assert_allclose(branch.points.x, np.expm1(branch.points.p), rtol=1e-12)
    assert branch.stops[1].reason == "bound"


def test_four_branches_whose_point_is_known_to_few_digits_say_so():
    problem = one_state(lambda x, p: [x[0] * (x[0] - p) * (x[0] + p) * (x[0] - 2 * p)], {"p": -1.0})
    (point,) = specials(pk.continuation(problem, "p", x0=[0.0], span=(-1.0, 1.0)))
    assert kind_of(point) == "branch_point"
    assert abs(point.parameters["p"]) < 1e-6
    assert point.status == "guess"
    assert "4 branches meet" in point.message


def test_a_start_that_is_far_is_corrected_and_a_hopeless_one_refused():
    branch = pk.continuation(
        one_state(["mu - x**3 - x"], {"mu": 2.0}), "mu", x0=[40.0], span=(0.0, 3.0)
    )
    assert np.isclose(branch.points.x.sel(point=branch.points.mu == 2.0), 1.0).all()
    with pytest.raises(pk.ConvergenceError, match="x0|start"):
        pk.continuation(one_state(["x**2 + 1 + mu"], {"mu": 1.0}), "mu", x0=[1.0], span=(0.0, 2.0))


# --- sizes -----------------------------------------------------------------------------------


@pytest.mark.parametrize("scale", [1e-9, 1e-3, 1e3, 1e9])
def test_units_do_not_matter(scale):
    """The cusp in other units of the state and of the parameter."""
    s = repr(scale)
    branch = pk.continuation(
        pk.Problem(
            [f"mu/{s} + l*x/{s} - (x/{s})**3"],
            state=("x",),
            parameters={"mu": -scale, "l": 1.0},
        ),
        "mu",
        x0=[-1.3 * scale],
        span=(-1.5 * scale, 1.5 * scale),
    )
    fold = 2 / (3 * math.sqrt(3))
    assert same(np.array(values(branch, "mu", "fold")) / scale, [-fold, fold], atol=1e-11)


@pytest.mark.parametrize(("form", "n"), [("compiled", 50), ("python", 10), ("python with jac", 50)])
def test_bratu(form, n):
    f = numba.njit(bratu.bratu) if form == "compiled" else bratu.bratu
    jac = bratu.bratu_jacobian if form == "python with jac" else None
    names = tuple(f"u{i}" for i in range(n))
    branch = pk.continuation(
        pk.Problem(f, state=names, parameters={"c": 0.0}, jac=jac),
        "c",
        x0=np.zeros(n),
        span=(0.0, 4.0),
        options=pk.ContinuationOptions(bounds={f"u{n // 2}": (-1.0, 6.0)}),
    )
    c, top = bratu.fold(n)
    (fold,) = specials(branch, "fold")
    assert abs(fold.parameters["c"] - c) < 1e-8
    assert abs(state_of(fold)[n // 2 - 1] - top) < 1e-6
    # Symmetric Jacobian: no Hopf points. Sums of eigenvalues vanish at neutral saddles.
    assert not specials(branch, "hopf")
    assert not specials(branch, "branch_point")


# --- options ---------------------------------------------------------------------------------


@pytest.mark.parametrize("max_step", [0.005, 0.2])
@pytest.mark.parametrize("name", ["CO oxidation, k = 0.4", "two folds a hair apart"])
def test_special_points_do_not_depend_on_the_step(name, max_step):
    from published import reference
    from published.systems import SYSTEMS

    system = SYSTEMS[name]
    branch = compare.follow(system, max_step=max_step, max_points=20_000)
    compare.compare(branch.special_points, reference.specials(system), system.parameter)


def test_the_last_point_says_why_it_is_the_last():
    problem = one_state(["mu - x**2"], {"mu": 1.0})
    branch = pk.continuation(
        problem, "mu", x0=[1.0], span=(-1, 2), options=pk.ContinuationOptions(max_points=5)
    )
    assert "max_points" in repr(branch) or "max_points" in str(branch.to_dataset().attrs)


# --- diagrams --------------------------------------------------------------------------------


def crossings(branches, parameter, value):
    """How often branches pass a value of the parameter."""
    columns = [branch.points[parameter].values for branch in branches]
    return sum(int(np.sum((p[1:] > value) != (p[:-1] > value))) for p in columns)


def test_a_closed_side_branch_between_two_pitchforks():
    """A circle on a line: each is found once."""
    found = pk.diagram(
        one_state(["x*(1 - mu**2 - x**2)"], {"mu": -1.5}), "mu", x0=[[0.0]], span=(-2.0, 2.0)
    )
    assert len(found) == 2
    assert (crossings(found, "mu", 0.3), crossings(found, "mu", 1.5)) == (3, 1)
    assert all(kind_of(one) != "fold" for branch in found for one in branch.special_points)


def test_isolated_branches_of_a_polynomial():
    """Two closed loops that no branch point joins to the rest, without a start."""
    f = "(x - 3)*((x**2 + (mu - 1)**2 - 1/4))*((x + 3)**2 + (mu + 1)**2 - 1/9)"
    found = pk.diagram(one_state([f], {"mu": 0.0}), "mu", span=(-2.0, 2.0))
    assert len(found) == 3
    assert [crossings(found, "mu", value) for value in (-1.1, 0.0, 1.1)] == [3, 1, 3]


def test_switching_to_a_depth():
    """Four lines with six crossings, all reached."""
    f = "x*(x - mu)*(x + mu - 1)*(x - 2*mu + 3)"
    problem = one_state([f], {"mu": -1.0})
    found = pk.diagram(problem, "mu", x0=[[0.0]], span=(-2.0, 4.0), depth=4)
    assert len(found) == 4
    points = {
        (round(one.parameters["mu"], 6), round(float(state_of(one)[0]), 6))
        for branch in found
        for one in specials(branch)
    }
    assert points == {
        (0, 0),
        (1, 0),
        (1.5, 0),
        (0.5, 0.5),
        (3, 3),
        (round(4 / 3, 6), round(-1 / 3, 6)),
    }
    assert len(pk.diagram(problem, "mu", x0=[[0.0]], span=(-2.0, 4.0), depth=0)) == 1


def test_coupled_cells_by_switching():
    """From rest to the unequal cells of Bratu, and no branch twice."""
    problem = pk.Problem(
        ["-2*x + y + a*exp(x)", "x - 2*y + a*exp(y)"], state=("x", "y"), parameters={"a": 0.0}
    )
    found = pk.diagram(
        problem,
        "a",
        x0=[[0.0, 0.0]],
        span=(0.0, 1.0),
        options=pk.ContinuationOptions(bounds={"x": (-1.0, 9.0), "y": (-1.0, 9.0)}),
    )
    assert len(found) == 2
    unequal = found[1].points
    assert np.abs(unequal.x - unequal.y).max() > 1.0
    (point,) = [one for one in specials(found[1]) if kind_of(one) == "branch_point"]
    assert abs(point.parameters["a"] - 3 * math.exp(-3)) < 1e-12


def test_two_brusselators_part():
    """The branch point at B = 2.1 by symmetry; the side branch leaves with x + u changing."""
    from published.systems import SYSTEMS

    branch = compare.follow(SYSTEMS["two Brusselators"])
    (point,) = specials(branch, "branch_point")
    assert point.kind == "pitchfork"
    side = point.switch()
    assert np.abs(side.points.x - side.points.u).max() > 0.1
    f = SYSTEMS["two Brusselators"].python()
    for i in range(0, side.points.sizes["point"], 10):
        x = [float(side.points[name][i]) for name in ("x", "y", "u", "v")]
        value = f(x, B=float(side.points.B[i]), A=1.0, d=0.2, D=1.0)
        assert np.abs(value).max() < 1e-10


def test_a_branch_that_ends_in_what_differences_miss_says_so():
    def f(x, p):
        return [p - x[0] + 1e-6 * np.sin(x[0] / 1e-7)]

    problem = pk.Problem(f, state="x", parameters={"p": 0.5})
    branch = pk.continuation(problem, "p", x0=[0.5], span=(0.4, 1.5))
    assert [stop.reason for stop in branch.stops] == ["stuck", "stuck"]
    assert all("derivatives are differences" in stop.message for stop in branch.stops)
