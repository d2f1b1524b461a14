"""Problems, branches and diagrams, as users see them."""

import dataclasses
import math
import re

import matplotlib
import numba
import numpy as np
import pytest
import sympy
import xarray as xr

import phasekit as pk
from phasekit.bifurcation.continuation.options import ContinuationOptions
from phasekit.labelled.continuation.branch import Branch
from phasekit.labelled.continuation.continuation import continuation
from phasekit.labelled.continuation.diagram import diagram
from phasekit.labelled.figure_eights import figure_eights
from phasekit.systems.problem import Problem

matplotlib.use("Agg")

BRUSSELATOR = Problem(["1 - (b + 1)*x + x**2*y", "b*x - x**2*y"], ("x", "y"), {"b": 1.5})
CUSP = Problem("mu + l*x - x**3", state="x", parameters={"mu": -1.0, "l": 1.0})
FOLD = 2.0 / (3.0 * math.sqrt(3.0))
REACTION = Problem(
    {"u1": "-u1 + p1*(1 - u1)*exp(u2)", "u2": "-u2 + p1*p2*(1 - u1)*exp(u2) - p3*u2"},
    state=("u1", "u2"),
    parameters={"p1": 0.0, "p2": 14.0, "p3": 2.0},
)
PITCHFORK = Problem("k + x*(l - x**2)", state="x", parameters={"k": 0.0, "l": -1.0})
DISK = pk.GyroRotorDisk(beta=0.3, e=0.1, a=0.03, r=0.05, omega1=20.0)


def cusp_function(x, mu, l):  # noqa: E741
    return mu + l * x[0] - x[0] ** 3


def values(branch, label, name):
    return [point[name] for point in branch.special(label)]


# ------------------------------------------------------------------------------ problems


def forms():
    x, mu, l = sympy.symbols("x mu l")  # noqa: E741
    compiled = numba.njit(lambda x, mu, l: (mu + l * x[0] - x[0] ** 3,))  # noqa: E741
    scalar = numba.njit(lambda x, l, mu: mu + l * x[0] - x[0] ** 3)  # noqa: E741
    jac = lambda x, mu, l: [[l - 3 * x[0] ** 2]]  # noqa: E731, E741
    return {
        "string": ("mu + l*x - x^3", None),
        "list": (["mu + l*x - x^3"], None),
        "mapping": ({"x": "mu + l*x - x**3"}, None),
        "sympy": (mu + l * x - x**3, None),
        "matrix": (sympy.Matrix([mu + l * x - x**3]), None),
        "compiled": (compiled, None),
        "compiled, a number, other order": (scalar, None),
        "python, a number": (cusp_function, None),
        "python, a list": (lambda x, **p: [cusp_function(x, **p)], None),
        "python, an array, jac": (lambda x, **p: np.array([cusp_function(x, **p)]), jac),
    }


FORMS = forms()


@pytest.mark.slow
@pytest.mark.parametrize("form", FORMS)
def test_every_form_of_f_gives_the_same_branch(form):
    f, jac = FORMS[form]
    problem = Problem(f, "x", {"mu": -1, "l": 1}, jac)
    branch = continuation(problem, "mu", x0=[-1.3], span=(-1.0, 1.0))
    np.testing.assert_allclose(values(branch, "LP", "mu"), [FOLD, -FOLD], rtol=1e-12)
    assert [stop.reason for stop in branch.stops] == ["bound", "bound"]
    for point in branch.special("LP"):
        assert point.status == "converged"
        assert point.residual < 1e-12
        assert point.normal_form["a"] == pytest.approx(-3.0 * point["x"], rel=1e-7)
        assert point.normal_form["b"] == pytest.approx(1.0, rel=1e-7)
    x, mu = branch.points.x.values, branch.points.mu.values
    np.testing.assert_allclose(mu + x - x**3, 0.0, atol=6e-15)


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: Problem("x", "lambda", {}), "keywords"),
        (lambda: Problem("x", ("x", "x"), {}), "differ"),
        (lambda: Problem("x", "x", {"x": 1.0}), "no states"),
        (lambda: Problem("x + q", "x", {}), "the name 'q'"),
        (lambda: Problem(sympy.Symbol("q"), "x", {}), "the symbol q"),
        (lambda: Problem(["x"], ("x", "y"), {}), "2 formulas"),
        (lambda: Problem({"x": "x", "z": "1"}, ("x", "y"), {}), "'z' is unknown"),
        (lambda: Problem(3.0, "x", {}), "a function"),
        (lambda: Problem("x", "x", {"a": math.nan}), "finite"),
        (lambda: Problem("x", "x", {"a": "one"}), "a real number"),
        (lambda: Problem("x", "x", {}, periods={"y": 1.0}), "'y' is unknown"),
        (lambda: Problem("x", "x", {}, periods={"x": -1.0}), "> 0"),
        (lambda: Problem("x", "x", {}, lambda x: x), "derivatives are exact"),
        (lambda: Problem(lambda x, a: x, "x", {"b": 1.0}), "to be called"),
        (lambda: Problem(numba.njit(lambda x, a: x), "x", {"b": 1.0}), "arguments of f"),
        (lambda: Problem("x", "x", {}, conservative=1), "True or False"),
        (lambda: CUSP.replace(m=1.0), "'m' is unknown"),
        (lambda: CUSP([1.0, 2.0]), "1 numbers"),
    ],
)
def test_problems_that_are_refused(make, message):
    with pytest.raises(pk.ParameterError, match=message):
        make()


def test_a_problem_is_frozen_and_says_what_it_is():
    with pytest.raises(AttributeError, match="frozen"):
        CUSP.state = ("y",)
    assert "mu=-1.0" in repr(CUSP)
    assert "- x**3" in repr(CUSP)
    assert "phi" in repr(Problem.from_system(DISK))
    assert CUSP([2.0], mu=0.0).tolist() == [-6.0]


@pytest.mark.parametrize(
    "system",
    [
        DISK,
        pk.Reduced(0.3, 0.2, -1.5),
        pk.Coefficients(2.0, 0.3, -0.4),
        pk.Pendulum(length=0.5),
        pk.ParticleOnCircle(radius=0.5, omega=2.0, tilt=0.3, offset=0.1, normal_offset=0.2),
        pk.StonerWohlfarth(K=1.0, h_x=0.3, h_y=-0.2),
    ],
)
def test_systems_are_problems_of_their_force(system):
    problem = Problem.from_system(system)
    phi = np.linspace(-3.0, 3.0, 7)
    wanted = -pk.gradient(system, phi).potential_gradient.values
    np.testing.assert_allclose([problem([x])[0] for x in phi], wanted, rtol=1e-13, atol=1e-13)


# ------------------------------------------------------------------------------ arguments


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"parameter": "m"}, "'m' is unknown; did you mean 'mu'"),
        ({"span": (0.0, 1.0)}, "holds the problem's own mu"),
        ({"span": (1.0, -1.0)}, "low < high"),
        ({"span": 3.0}, "two numbers"),
        ({"x0": [1.0, 2.0]}, "1 finite numbers"),
        ({"x0": "lower_center"}, "1 numbers"),
        ({"x0": {"y": 1.0}}, "each of x"),
        ({"options": {"max_step": 1.0}}, "ContinuationOptions"),
        ({"record": {"q": 3.0}}, "a function"),
        ({"record": {"x": abs}}, "not taken"),
        ({"record": ["energy"]}, "a mapping"),
        ({"problem": cusp_function}, "pk.Problem"),
        ({"options": ContinuationOptions(bounds={"y": (0, 1)})}, "'y' is unknown"),
        ({"options": ContinuationOptions(bounds={"x": (0, 1)})}, "within its bounds"),
    ],
)
def test_arguments_that_are_refused(change, message):
    arguments = {"problem": CUSP, "parameter": "mu", "x0": [-1.3], "span": (-1.0, 1.0)}
    arguments |= change
    problem, parameter = arguments.pop("problem"), arguments.pop("parameter")
    with pytest.raises(pk.ParameterError, match=message):
        continuation(problem, parameter, **arguments)


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"max_step": 0.0}, "max_step: got 0.0"),
        ({"max_step": "1"}, "max_step"),
        ({"min_step": 1.0}, "min_step"),
        ({"max_points": 0}, "max_points"),
        ({"max_points": True}, "max_points"),
        ({"tolerance": 1.0}, "at most"),
        ({"turn": 0.6}, "max_turn"),
        ({"directions": "up"}, "both, forward, backward"),
        ({"detect": ("folds",)}, "'folds'"),
        ({"bounds": {"x": (1.0, 0.0)}}, "low < high"),
        ({"bounds": {"x": 1.0}}, "a pair"),
        ({"scales": {"x": 0.0}}, "> 0"),
        ({"scales": [1.0]}, "a mapping"),
    ],
)
def test_options_that_are_refused(options, message):
    with pytest.raises(pk.ParameterError, match=message):
        ContinuationOptions(**options)


def test_options_are_frozen_and_comparable():
    options = ContinuationOptions(bounds={"x": (0, 1)})
    with pytest.raises(dataclasses.FrozenInstanceError):
        options.max_step = 1.0
    assert options == ContinuationOptions(bounds={"x": (0, 1)})
    assert hash(options) == hash(ContinuationOptions(bounds={"x": (0, 1)}))


# ------------------------------------------------------------------------------ starts and ends


def test_a_start_is_corrected_and_a_hopeless_one_refused():
    branch = continuation(CUSP, "mu", x0=[-5.0], span=(-1.0, 1.0))
    assert branch.points.x.values[0] == pytest.approx(-1.3247179572447460, abs=1e-15)
    nowhere = Problem("x**2 + 1 + m", "x", {"m": 0.0})
    with pytest.raises(pk.ConvergenceError, match="Newton.*Levenberg"):
        continuation(nowhere, "m", x0=[0.3], span=(-1.0, 1.0))
    undefined = Problem("log(x) + m", "x", {"m": 0.0})
    with pytest.raises(pk.ConvergenceError, match="not finite"):
        continuation(undefined, "m", x0=[-1.0], span=(-1.0, 1.0))


def test_a_start_on_a_fold_and_on_a_branch_point():
    parabola = Problem("m - x**2", "x", {"m": 0.0})
    branch = continuation(parabola, "m", x0=[0.0], span=(-1.0, 1.0))
    assert values(branch, "LP", "m") == pytest.approx([0.0], abs=1e-15)
    assert sorted(branch.points.x.values[[0, -1]]) == pytest.approx([-1.0, 1.0])
    branch = continuation(PITCHFORK.replace(l=0.0), "l", x0=[0.0], span=(-1.0, 1.0))
    assert np.abs(branch.points.x).max() < 1e-12
    assert values(branch, "BP", "l") == pytest.approx([0.0], abs=1e-15)


@pytest.mark.parametrize("directions", ["forward", "backward"])
def test_one_direction(directions):
    options = ContinuationOptions(directions=directions)
    branch = continuation(CUSP.replace(mu=-0.9), "mu", x0=[-1.3], span=(-1, 1), options=options)
    ends = branch.points.mu.values[[0, -1]]
    wanted = [-0.9, 1.0] if directions == "forward" else [-1.0, -0.9]
    np.testing.assert_array_equal(ends, wanted)
    assert {stop.reason for stop in branch.stops} == {"start", "bound"}


def test_ends_lie_exactly_on_bounds():
    options = ContinuationOptions(bounds={"x": (-2.0, 0.25)})
    branch = continuation(CUSP, "mu", x0=[-1.3], span=(-1.0, 1.0), options=options)
    assert branch.points.x.values[-1] == 0.25
    assert branch.points.mu.values[0] == -1.0
    assert "x met its upper bound 0.25" in branch.stops[1].message
    assert branch.special_points[-1].label == "EP"
    assert branch.special_points[-1].message == branch.stops[1].message


def test_other_reasons_to_stop():
    short = ContinuationOptions(max_points=5)
    branch = continuation(CUSP, "mu", x0=[-1.3], span=(-1.0, 1.0), options=short)
    assert branch.stops[1].reason == "max_points"
    root = Problem(lambda x, m: [m - math.sqrt(x[0])], "x", {"m": 1.0})
    branch = continuation(root, "m", x0=[1.0], span=(-1.0, 2.0))
    assert branch.stops[0].reason in ("not_finite", "stuck")
    assert abs(branch.points.m.values[0]) < 0.02


@pytest.mark.parametrize("start", [(1.0, 0.0), (0.0, 1.0), (-0.6, 0.8)])
def test_a_closed_branch_closes(start):
    x, m = start
    circle = Problem("x**2 + m**2 - 1", "x", {"m": m})
    branch = continuation(circle, "m", x0=[x], span=(-2.0, 2.0))
    assert branch.closed
    assert sorted(values(branch, "LP", "m")) == pytest.approx([-1.0, 1.0], abs=1e-14)
    assert not branch.special("EP")
    first, last = branch.points.isel(point=0), branch.points.isel(point=-1)
    assert abs(first.x - last.x) < 1e-12
    length = np.sqrt(np.diff(branch.points.x) ** 2 + np.diff(branch.points.m) ** 2).sum()
    assert length == pytest.approx(2 * np.pi, rel=1e-3)


def test_angles_are_points_of_a_circle():
    turns = Problem("m - sin(3*x)", "x", {"m": 0.0}, periods={"x": 2 * np.pi})
    branch = continuation(turns, "m", x0=[0.0], span=(-2.0, 2.0))
    assert branch.closed  # after one turn, with six folds
    assert len(branch.special("LP")) == 6
    assert np.abs(branch.points.x).max() <= np.pi
    tilted = Problem("m - x/10 - sin(x)", "x", {"m": 0.0})
    line = continuation(tilted, "m", x0=[0.0], span=(-1.0, 1.0))
    assert not line.closed


def test_scales_do_not_matter():
    """States of 1e-7 and 1e5 and a parameter of 1e9: the same special points."""
    units = {"u1": 1e-7, "u2": 1e5, "p1": 1e9}
    scaled = Problem(
        [
            "(-(u1/1e-7) + (p1/1e9)*(1 - u1/1e-7)*exp(u2/1e5))*1e-7",
            "(-(u2/1e5) + (p1/1e9)*14*(1 - u1/1e-7)*exp(u2/1e5) - 2*u2/1e5)*1e5",
        ],
        ("u1", "u2"),
        {"p1": 0.0},
    )
    one = continuation(REACTION, "p1", x0=[0.0, 0.0], span=(0.0, 0.2))
    other = continuation(scaled, "p1", x0=[0.0, 0.0], span=(0.0, 0.2e9))
    assert [p.kind for p in one.special_points] == [p.kind for p in other.special_points]
    for a, b in zip(one.special_points, other.special_points, strict=True):
        assert b.status == "converged"
        for name, unit in units.items():
            assert b[name] / unit == pytest.approx(a[name], rel=1e-10, abs=1e-12)


# ------------------------------------------------------------------------------ special points


def test_the_reaction():
    branch = continuation(REACTION, "p1", x0=[0.0, 0.0], span=(0.0, 0.2))
    kinds = [point.kind for point in branch.special_points]
    assert kinds == ["end", "fold", "neutral_saddle", "fold", "hopf", "end"]
    p1 = values(branch, "LP", "p1") + values(branch, "H", "p1")
    np.testing.assert_allclose(p1, [0.1057389783, 0.0889318462, 0.1309000448], rtol=0, atol=6e-11)
    hopf = branch.special("hopf")[0]
    eigenvalues = hopf.eigenvalues
    assert np.abs(eigenvalues.real).max() < 1e-12
    assert np.abs(eigenvalues.imag).max() == pytest.approx(hopf.normal_form["omega"], rel=1e-12)
    saddle = branch.special("NS")[0]
    assert saddle.eigenvalues.sum() == pytest.approx(0.0, abs=1e-12)
    assert np.abs(saddle.eigenvalues.imag).max() == 0.0
    for point in branch.special_points:
        assert point.interval[0] - 1e-3 <= point["p1"] <= point.interval[1] + 1e-3
        ds = branch.points.isel(point=point.index)
        assert float(ds.p1) == point["p1"]
        assert str(ds.special.values) == point.label
    # Unstable on one side only of each.
    n = branch.points.n_unstable.values
    i = [point.index for point in branch.special("LP")]
    assert [n[i[0] - 2], n[i[0] + 1], n[-1]] == [0, 1, 0]


def test_switching_at_a_pitchfork_and_seeing_it_from_its_side():
    trivial = continuation(PITCHFORK, "l", span=(-1.0, 1.0))
    (point,) = trivial.special("BP")
    assert point.kind == "pitchfork"
    assert point.normal_form["c"] == pytest.approx(-1.0)
    side = point.switch()
    np.testing.assert_allclose(side.points.l, side.points.x**2, atol=1e-14)
    assert sorted(side.points.x.values[[0, -1]]) == pytest.approx([-1.0, 1.0])
    from_side = continuation(PITCHFORK.replace(l=1.0), "l", x0=[1.0], span=(-1.0, 1.0))
    assert [p.kind for p in from_side.special_points] == ["end", "pitchfork", "end"]
    assert from_side.special("BP")[0].status == "converged"
    with pytest.raises(pk.ParameterError, match="a branch point"):
        trivial.special_points[0].switch()


def test_a_transcritical_point():
    problem = Problem("m*x - x**2 + x**3*k", "x", {"m": -1.0, "k": 0.3})
    branch = continuation(problem, "m", span=(-1.0, 1.0))
    (point,) = branch.special("BP")
    assert point.kind == "transcritical"
    assert point.normal_form == pytest.approx({"a": -1.0, "d": 1.0})
    other = point.switch()
    x, m = other.points.x.values, other.points.m.values
    np.testing.assert_allclose(m - x + 0.3 * x**2, 0.0, atol=1e-14)


@pytest.mark.parametrize("k", [1e-3, 1e-6, 1e-9, 1e-12])
def test_an_imperfect_pitchfork_is_none(k):
    """The path keeps to its branch however narrow the gap is."""
    branch = continuation(PITCHFORK.replace(k=k, l=-1.0), "l", x0=[0.0], span=(-1.0, 1.0))
    assert not branch.special("BP")
    assert branch.points.x.values[-1] == pytest.approx(1.0, abs=2 * k + 1e-9)
    low = continuation(PITCHFORK.replace(k=k, l=1.0), "l", x0=[-1.0], span=(-1.0, 1.0))
    (fold,) = low.special("LP")
    assert fold["l"] == pytest.approx(3.0 * (k / 2.0) ** (2 / 3), rel=1e-7)
    assert not low.special("BP")


def test_two_folds_in_one_step():
    near = CUSP.replace(l=1e-3)
    for step in (0.01, 0.1, 0.4):
        options = ContinuationOptions(max_step=step)
        branch = continuation(near, "mu", x0=[-1.0], span=(-1.0, 1.0), options=options)
        folds = values(branch, "LP", "mu")
        np.testing.assert_allclose(folds, np.array([1, -1]) * FOLD * 1e-3**1.5, rtol=1e-7)


def test_two_hopf_points_in_one_step():
    """A pair that crosses and comes back: real part a^2 - (m - 0.3)^2."""
    problem = Problem(
        ["(4e-6 - (m - 0.3)**2)*x - y", "x + (4e-6 - (m - 0.3)**2)*y"], ("x", "y"), {"m": -1.0}
    )
    branch = continuation(problem, "m", span=(-1.0, 1.0))
    assert values(branch, "H", "m") == pytest.approx([0.298, 0.302], abs=1e-12)


def test_what_to_detect():
    options = ContinuationOptions(detect=("fold",))
    branch = continuation(REACTION, "p1", x0=[0, 0], span=(0.0, 0.2), options=options)
    assert {point.kind for point in branch.special_points} == {"fold", "end"}
    with pytest.raises(pk.ParameterError, match="LP"):
        branch.special("folds")


# ------------------------------------------------------------------------------ two parameters


def test_the_fold_curve_of_the_reaction():
    branch = continuation(REACTION, "p1", x0=[0.0, 0.0], span=(0.0, 0.2))
    curve = branch.special("LP")[0].curve("p3", (0.5, 4.0))
    assert curve.kind == "fold"
    (cusp,) = curve.special("CP")
    assert cusp["p1"] == pytest.approx(math.exp(-2.0), rel=1e-13)
    assert cusp["p3"] == pytest.approx(2.5, rel=1e-13)
    (takens,) = curve.special("BT")
    assert np.abs(takens.eigenvalues).max() < 1e-5
    for i in range(0, curve.points.sizes["point"], 7):
        at = curve.points.isel(point=i)
        problem = REACTION.replace(p1=float(at.p1), p3=float(at.p3))
        value, slopes = problem.derivatives(np.array([float(at.u1), float(at.u2)]))
        assert np.abs(value).max() < 1e-12
        assert abs(np.linalg.det(slopes)) < 1e-10
    saddles = branch.special("NS")[0].curve("p3", (0.5, 4.0))
    (again,) = saddles.special("BT")
    assert again["p3"] == pytest.approx(takens["p3"], rel=1e-10)
    kinds = set(saddles.points.kind_of_pair.values.tolist())
    assert kinds >= {"hopf", "neutral_saddle"}
    assert repr(saddles).startswith("<Branch of hopf points and neutral_saddle points: ")


def test_the_cusp_curve_in_every_form():
    branch = continuation(
        Problem(cusp_function, "x", {"mu": -1.0, "l": 1.0}), "mu", x0=[-1.3], span=(-1.0, 1.0)
    )
    curve = branch.special("LP")[0].curve("l", (-1.0, 2.0))
    l, mu = curve.points.l.values, curve.points.mu.values  # noqa: E741
    np.testing.assert_allclose(27 * mu**2, 4 * l**3, atol=1e-9)
    assert values(curve, "CP", "l") == pytest.approx([0.0], abs=1e-9)
    ends = curve.special("EP")
    assert [point["l"] for point in ends] == [2.0, 2.0]


def test_curves_of_branch_points():
    problem = Problem("x*(l - b - x**2)", "x", {"l": -1.0, "b": 0.2})
    branch = continuation(problem, "l", span=(-1.0, 1.0))
    curve = branch.special("BP")[0].curve("b", (-0.5, 0.5))
    np.testing.assert_allclose(curve.points.l, curve.points.b, atol=1e-14)
    broken = continuation(PITCHFORK, "l", span=(-1.0, 1.0)).special("BP")[0]
    with pytest.raises(pk.ConvergenceError, match="no curve"):
        broken.curve("k", (-0.5, 0.5))
    late = Problem("x*(l - x**2) + max(0, b)**3", "x", {"l": -1.0, "b": -0.3})
    curve = continuation(late, "l", span=(-1, 1)).special("BP")[0].curve("b", (-0.5, 0.5))
    assert "no longer meet" in curve.stops[1].message
    assert 0.0 < float(curve.points.b[-1]) < 0.05


def test_points_that_have_no_curve():
    branch = continuation(CUSP, "mu", x0=[-1.3], span=(-1.0, 1.0))
    fold = branch.special("LP")[0]
    with pytest.raises(pk.ParameterError, match="another one"):
        fold.curve("mu", (-1.0, 1.0))
    with pytest.raises(pk.ParameterError, match="holds l"):
        fold.curve("l", (2.0, 3.0))
    with pytest.raises(pk.ParameterError, match="one of fold"):
        branch.special_points[0].curve("l", (0.0, 2.0))


# ------------------------------------------------------------------------------ systems


@pytest.mark.parametrize("parameter", ["beta", "e"])
def test_folds_of_the_disk_agree_with_the_closed_form(parameter):
    fold = float(pk.critical(DISK, parameter).critical_fold.sel(fold="minus"))
    span = (0.2 * fold, 2.0 * fold)
    disk = DISK.replace(**{parameter: 0.5 * fold})
    branch = continuation(disk, parameter, x0="lower_saddle", span=span)
    (point,) = branch.special("LP")
    assert point[parameter] == pytest.approx(fold, rel=1e-12)
    kinds = branch.points.kind.values
    assert set(kinds[: point.index]) | set(kinds[point.index + 1 :]) == {
        pk.EquilibriumKind.CENTER,
        pk.EquilibriumKind.SADDLE,
    }
    assert kinds[point.index] == pk.EquilibriumKind.DEGENERATE
    with pytest.raises(pk.ParameterError, match="did you mean"):
        continuation(disk, parameter, x0="lower_sadle", span=span)


def test_a_diagram_of_the_disk_is_complete():
    span = (0.01, 1.5)
    branches = diagram(DISK, "beta", span=span)
    for beta in np.linspace(0.011, 1.499, 9):
        phi = pk.equilibria(DISK.replace(beta=float(beta))).phi.values
        crossings = []
        for branch in branches:
            x = branch.points.beta.values
            crossings.append(np.sum((x[1:] - beta) * (x[:-1] - beta) < 0))
        assert sum(crossings) == np.sum(np.isfinite(phi))


def test_a_diagram_switches_once_everywhere():
    bratu = Problem(["-2*x + y + a*exp(x)", "x - 2*y + a*exp(y)"], ("x", "y"), {"a": 0.0})
    options = ContinuationOptions(bounds={"x": (-1, 6), "y": (-1, 6)})
    branches = diagram(bratu, "a", x0=[0.0, 0.0], span=(0.0, 1.0), options=options)
    assert len(branches) == 2
    assert all(len(branch.special("pitchfork")) == 1 for branch in branches)
    assert len(diagram(bratu, "a", x0=[0, 0], span=(0, 1), depth=0, options=options)) == 1
    loop = Problem("x*(1 - m**2 - x**2)", "x", {"m": 0.0})
    branches = diagram(loop, "m", x0=[0.0], span=(-2.0, 2.0))
    assert [branch.closed for branch in branches] == [False, True]
    with pytest.raises(pk.ParameterError, match="depth"):
        diagram(loop, "m", span=(-2.0, 2.0), depth=-1)


def test_isolated_branches_of_polynomials_and_fourier_sums():
    islands = Problem("(x**2 + m**2 - 1)*(x - 3)", "x", {"m": 0.0})
    branches = diagram(islands, "m", span=(-2.0, 2.0))
    assert sorted(branch.closed for branch in branches) == [False, True]
    trigonometric = Problem("sin(x)*(cos(x) - 0.5) + m", "x", {"m": 0.0}, periods={"x": 2 * np.pi})
    branches = diagram(trigonometric, "m", span=(-0.2, 0.2))
    for m in (-0.15, 0.01, 0.12):
        fine = np.linspace(-np.pi, np.pi, 20001)
        f = np.sin(fine) * (np.cos(fine) - 0.5) + m
        wanted = np.sum(f[1:] * f[:-1] < 0)
        found = sum(np.sum((b.points.m.values[1:] - m) * (b.points.m.values[:-1] - m) < 0)
                    for b in branches)  # fmt: skip
        assert found == wanted


def test_conservative_problems_have_centers_and_saddles():
    well = Problem.from_potential("x**4/4 - m*x**2/2 + k*x", "x", {"m": 1.0, "k": 0.0})
    branch = continuation(well, "k", x0=[1.0, 0.0], span=(-1.0, 1.0))
    assert values(branch, "LP", "k") == pytest.approx([FOLD, -FOLD], abs=1e-12)
    kinds = branch.points.kind.values
    fold = [point.index for point in branch.special("LP")]
    assert set(kinds[: fold[0]]) == {pk.EquilibriumKind.CENTER}
    assert set(kinds[fold[0] + 1 : fold[1]]) == {pk.EquilibriumKind.SADDLE}
    assert not branch.special("H")
    assert not branch.special("NS")
    undeclared = Problem(["y", "x - x**3 - k"], ("x", "y"), {"k": 0.0})
    assert not continuation(undeclared, "k", x0=[1, 0], span=(-1, 1)).special("H")


# ------------------------------------------------------------------------------ results


def names_of(branch):
    """Everything that a branch shows, and all that it holds."""
    return [*(name for name in dir(branch) if not name.startswith("__")), "note"]


@pytest.mark.parametrize("of_cycles", [False, True], ids=["equilibria", "cycles"])
def test_a_branch_is_frozen(of_cycles):
    branch = continuation(CUSP, "mu", x0=[-1.3], span=(-1.0, 1.0), events={"half": "x - 1/2"})
    if of_cycles:
        rest = continuation(BRUSSELATOR, "b", x0=[1.0, 1.5], span=(1.5, 2.2))
        branch = rest.special("H")[0].switch()
    assert "special_points" not in vars(branch)  # made when they are asked for, and kept
    assert branch.special_points is branch.special_points
    for thing in (branch, branch.special_points[0]):
        for name in names_of(thing):
            with pytest.raises(AttributeError):
                setattr(thing, name, None)
    for point in branch.special_points:
        for array in (point.x, point.eigenvalues):
            with pytest.raises(ValueError, match="read-only"):
                array[...] = 0.0
        with pytest.raises(TypeError):
            point.parameters["mu"] = 0.0
    with pytest.raises(TypeError):
        branch.record["square"] = None


def test_a_branch_is_read_in_a_notebook_as_in_text():
    branch = continuation(CUSP, "mu", x0=[-1.3], span=(-1.0, 1.0), events={"<half>": "x - 1/2"})
    table = branch.table()
    assert table.kind.tolist() == [point.kind for point in branch.special_points]
    for point, row in zip(branch.special_points, table.itertuples(), strict=True):
        assert (row.mu, row.x, row.label) == (point["mu"], point["x"], point.label)
        assert point.status == "converged"
    assert not {"residual", "status"} & {*table}  # nothing is to be said of them
    page = branch._repr_html_()
    assert f"{branch.points.sizes['point']} points" in page
    assert page.count("<tr") == 1 + len(branch.special("fold")) + len(branch.special("<half>"))
    assert "&lt;half&gt;" in page
    assert "<half>" not in page
    assert "mu met its lower bound -1" in page


def test_points_are_labelled_when_asked_for():
    """Short branches are followed by the thousand; what the user records is called at once."""
    calls = []

    def square(x, **p):
        calls.append(p["mu"])
        return x[0] ** 2

    branch = continuation(CUSP, "mu", x0=[-1.3], span=(-1.0, 1.0))
    assert "_points" not in vars(branch)
    assert branch.points.sizes["point"] > 20
    assert branch.points.identical(vars(branch)["_points"])
    assert not branch.points.mu.values.flags.writeable
    again = continuation(CUSP, "mu", x0=[-1.3], span=(-1.0, 1.0))
    assert again == branch
    assert hash(again) == hash(branch)
    other = continuation(CUSP, "mu", x0=[-1.3], span=(-1.0, 1.0), record={"square": square})
    count = len(calls)
    assert count > 0
    assert other != branch
    np.testing.assert_allclose(other.points.square, other.points.x**2, rtol=1e-14)
    assert len(calls) == count


def test_recorded_quantities():
    branch = continuation(
        REACTION, "p1", x0=[0, 0], span=(0.0, 0.2),
        record={
            "total": lambda x, p1, p2, p3: x[0] + x[1] + p1 * p2,
            "both": lambda x, **p: [x[0], p["p1"]],
            "scalar": lambda x, **p: math.sin(x[0]),
        },
    )  # fmt: skip
    points = branch.points
    np.testing.assert_array_equal(points.total, points.u1 + points.u2 + points.p1 * 14.0)
    np.testing.assert_array_equal(points.both, np.stack([points.u1, points.p1], axis=1))
    np.testing.assert_allclose(points.scalar, np.sin(points.u1), rtol=1e-15)
    branch = continuation(DISK, "beta", span=(0.1, 1.5), record=["potential"])
    p = branch.points
    wanted = pk.potential(DISK.replace(beta=p.beta.values[3]), p.phi.values[3])
    assert p.potential.values[3] == pytest.approx(float(wanted.potential), rel=1e-14)


def test_bearing_forces_along_a_branch():
    disk = DISK.replace(m=2.0, half_span=0.1)
    branch = continuation(disk, "beta", span=(0.1, 1.5), record=["force_magnitude"])
    at = branch.points.isel(point=4)
    wanted = pk.bearing_forces(disk.replace(beta=float(at.beta)), float(at.phi), 0.0)
    np.testing.assert_allclose(at.force_magnitude, wanted.force_magnitude, rtol=1e-13)
    assert at.force_magnitude.dims == ("bearing",)
    with pytest.raises(pk.ParameterError, match="m, half_span: got"):
        continuation(DISK, "beta", span=(0.1, 1.5), record=["force_magnitude"])


def test_a_branch_is_immutable():
    branch = continuation(CUSP, "mu", x0=[-1.3], span=(-1.0, 1.0))
    with pytest.raises(dataclasses.FrozenInstanceError):
        branch.points = None
    with pytest.raises(ValueError, match="read-only"):
        branch.points.x.values[0] = 1.0
    with pytest.raises(ValueError, match="read-only"):
        branch.special_points[0].x[0] = 1.0


def test_a_branch_as_a_dataset():
    branch = continuation(REACTION, "p1", x0=[0, 0], span=(0.0, 0.2))
    ds = branch.to_dataset()
    assert isinstance(ds, xr.Dataset)
    assert ds.special_label.values.tolist() == [p.label for p in branch.special_points]
    np.testing.assert_array_equal(ds.special_p1, [p["p1"] for p in branch.special_points])
    assert ds.special_interval.shape == (6, 2)
    text = repr(branch)
    assert "LP fold at p1=0.1057389783" in text
    assert "p1 met its upper bound" in text


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "problem"), [("branch.zarr", REACTION), ("branch.nc", DISK)], ids=["formulas", "disk"]
)
def test_a_branch_resumes_exactly(tmp_path, name, problem):
    parameter, start, span = ("p1", [0, 0], (0.0, 0.2)) if problem is REACTION else (
        "beta", None, (0.1, 1.5))  # fmt: skip
    options = ContinuationOptions(max_points=12, max_step=0.03)
    part = continuation(problem, parameter, x0=start, span=span, options=options)
    part.save(tmp_path / name)
    loaded = Branch.load(tmp_path / name)
    assert loaded.points.identical(part.points)
    assert [repr(p) for p in loaded.special_points] == [repr(p) for p in part.special_points]
    whole = continuation(
        problem, parameter, x0=start, span=span,
        options=dataclasses.replace(options, max_points=500),
    )  # fmt: skip
    resumed = loaded.extend(7).extend(500)
    assert resumed.points.identical(whole.points)
    assert [repr(p) for p in resumed.special_points] == [repr(p) for p in whole.special_points]
    with pytest.raises(pk.ParameterError, match="other reasons"):
        resumed.extend()
    with pytest.raises(pk.StoreError, match="exists"):
        part.save(tmp_path / name)
    part.save(tmp_path / name, overwrite=True)


@pytest.mark.slow
def test_a_curve_resumes_exactly(tmp_path):
    branch = continuation(REACTION, "p1", x0=[0.0, 0.0], span=(0.0, 0.2))
    for label in ("LP", "H"):
        options = ContinuationOptions(max_points=9)
        part = branch.special(label)[0].curve("p3", (0.5, 4.0), options=options)
        part.save(tmp_path / f"{label}.zarr")
        resumed = Branch.load(tmp_path / f"{label}.zarr").extend(1000)
        whole = branch.special(label)[0].curve("p3", (0.5, 4.0))
        assert resumed.points.identical(whole.points)


@pytest.mark.slow
def test_branches_of_python_code_need_it_again(tmp_path):
    problem = Problem(cusp_function, "x", {"mu": -1.0, "l": 1.0})
    record = {"square": lambda x, **p: x[0] ** 2}
    options = ContinuationOptions(max_points=5)
    branch = continuation(
        problem, "mu", x0=[-1.3], span=(-1.0, 1.0), record=record, options=options
    )
    path = tmp_path / "branch.zarr"
    branch.save(path)
    with pytest.raises(pk.ParameterError, match="Python or compiled"):
        Branch.load(path)
    with pytest.raises(pk.ParameterError, match="records square"):
        Branch.load(path, problem=problem)
    with pytest.raises(pk.ParameterError, match="the problem of the branch"):
        Branch.load(path, problem=problem.replace(l=2.0), record=record)
    loaded = Branch.load(path, problem=problem, record=record)
    assert loaded.extend(5).points.sizes["point"] == branch.points.sizes["point"] + 5
    with pytest.raises(pk.StoreError, match="does not exist"):
        Branch.load(tmp_path / "none.zarr")


def test_pictures():
    branch = continuation(REACTION, "p1", x0=[0.0, 0.0], span=(0.0, 0.2))
    ax = branch.plot()
    assert ax.get_xlabel() == "p1"
    assert ax.get_ylabel() == "u1"
    texts = sorted(text.get_text() for text in ax.texts)
    assert texts == ["H", "LP", "LP, NS"]  # fold and neutral saddle touch on the page
    styles = {line.get_linestyle() for line in ax.lines}
    assert {"-", "--"} <= styles
    curve = branch.special("LP")[0].curve("p3", (0.5, 4.0))
    ax = curve.plot()
    assert ax.get_ylabel() == "p3"
    assert "CP" in [text.get_text() for text in ax.texts]
    with pytest.raises(pk.ParameterError, match="'u3' is unknown"):
        branch.plot(y="u3")


def test_pictures_of_a_disk_have_its_words_units_and_recorded_forces():
    disk = pk.GyroRotorDisk(beta=0.7, e=0.05, a=0.024, r=0.2, omega1=30.0, m=2.0, half_span=0.1)
    branch = continuation(disk, "beta", x0="lower_saddle", span=(0.1, 1.5), record=["force"])
    ax = pk.plot.bifurcation_diagram([branch], angles="deg")
    assert ax.get_ylabel() == "$\\varphi$, angle of the equilibrium (°)"
    assert [text.get_text() for text in ax.texts] == ["LP"]
    drawn = np.concatenate([np.asarray(line.get_ydata()) for line in ax.lines])
    assert drawn.max() == pytest.approx(np.rad2deg(branch.points.phi.values.max()), abs=1e-12)
    component = {"bearing": "B2", "disk_axis": "v2"}
    ax = branch.plot(y="force", sel=component)
    drawn = np.concatenate([np.asarray(line.get_ydata()) for line in ax.lines])
    assert set(drawn) == set(branch.points.force.sel(component).values)
    with pytest.raises(pk.ParameterError, match="sel: got None, wants one of bearing"):
        branch.plot(y="force")
    with pytest.raises(pk.ParameterError, match="'C2' is unknown"):
        branch.plot(y="force", sel={**component, "bearing": "C2"})


@pytest.mark.slow
def test_a_branch_of_a_potential_is_saved_with_its_potential(tmp_path):
    well = pk.Potential("x**4/4 - mu*x**2/2 - h*x", "x", {"mu": 1.0, "h": 0.0}, interval=(-3, 3))
    options = pk.ContinuationOptions(max_points=10)
    arguments = {"x0": 1.0, "span": (-1.0, 1.0), "record": ["potential"]}
    short = continuation(well, "h", **arguments, options=options)
    short.save(tmp_path / "well.nc")
    loaded = Branch.load(tmp_path / "well.nc")
    assert loaded.problem.system == well
    assert loaded.points.identical(short.points)
    assert loaded.extend(1000).points.identical(continuation(well, "h", **arguments).points)


@pytest.mark.parametrize("jac", [None, lambda x, l: [[-1.0 / l]]])  # noqa: E741
def test_derivatives_where_a_newton_step_led_nowhere_are_nan(jac):
    field = Problem(lambda x, l: -x.item() / l, "x", {"l": 1.0}, jac=jac).field  # noqa: E741
    for u in (np.array([np.nan, 1.0]), np.array([np.inf, 1.0]), np.array([1.0, 0.0])):
        out = np.zeros(5)
        field.second((0,))(u, np.array([1.0]), np.array([1.0, 0.0]), out)
        assert np.isnan(out[1 if u[1] else 0])


def test_a_span_or_path_that_a_system_cannot_have_is_refused():
    disk = pk.GyroRotorDisk(beta=0.7, e=0.05, a=0.024, r=0.2, omega1=30.0)
    for follow in (continuation, pk.diagram):
        with pytest.raises(pk.ParameterError, match="span: got .* wants values of beta"):
            follow(disk, "beta", span=(-1.0, 4.0))
    with pytest.raises(pk.ParameterError, match="path: got beta = .*, wants values"):
        pk.figure_eights(disk, {"beta": (0.0, 4.0)})


def test_a_branch_does_not_change():
    branch = continuation(Problem("mu - x", "x", {"mu": 0.0}), "mu", span=(-1.0, 1.0))
    branch.points["x"] = 1.0
    assert branch.points.x.dims == ("point",)
    for name in ("x", "special", "tangent"):
        with pytest.raises(ValueError, match="read-only"):
            branch.points[name].values[0] = branch.points[name].values[1]
    for what, name in ((branch, "kind"), (branch, "points"), (branch.special_points[0], "kind")):
        with pytest.raises(AttributeError):
            setattr(what, name, None)


# ------------------------------------------------------------------------------ figure-eights


@pytest.mark.slow
def test_the_figure_eight_is_born_and_dies_at_folds():
    disk = pk.GyroRotorDisk(beta=0.1, e=0.0115, a=0.02, r=0.21, omega1=2.5)
    for a in (0.02, -0.01):
        ds = figure_eights(disk.replace(a=a), {"beta": (0.02, 1.5)}, n=60)
        fold = float(pk.critical(disk.replace(a=a), "beta").critical_fold.sel(fold="minus"))
        assert ds.event_kind.values.tolist() == ["fold"]
        assert ds.event_change.values.tolist() == ["death"]
        assert ds.event_beta.values == pytest.approx([fold], rel=1e-13)
    # Through a = 0 at small beta: both saddles have the same energy there.
    ds = figure_eights(disk.replace(beta=0.3), {"a": (-0.02, 0.015)}, n=60)
    assert ds.event_kind.values.tolist() == ["heteroclinic"]
    assert ds.event_change.values.tolist() == ["exchange"]
    assert abs(float(ds.event_a[0])) < 1e-16
    assert ds.figure_eight.values.all()


@pytest.mark.slow
def test_the_figure_eight_along_a_bent_path():
    disk = pk.GyroRotorDisk(beta=0.1, e=0.0115, a=0.02, r=0.21, omega1=2.5)
    ds = figure_eights(
        disk,
        {"beta": (0.05, 1.2), "e": (0.01, 0.02), "a": lambda s: 0.02 * np.cos(7.0 * s)},
        n=100,
    )
    assert ds.event_change.values.tolist() == ["exchange", "death"]
    assert float(ds.event_path[0]) == pytest.approx(np.pi / 14.0, rel=1e-12)
    at = {name: float(ds[f"event_{name}"][1]) for name in ("beta", "e", "a")}
    assert abs(float(pk.equilibria(disk.replace(**at)).fold_margin)) < 1e-12
    for change, message in (
        ({"bita": (0, 1)}, "'bita' is unknown"),
        ({"beta": 3.0}, "two numbers"),
        ({}, "a mapping"),
    ):
        with pytest.raises(pk.ParameterError, match=message):
            figure_eights(disk, change)


@pytest.mark.parametrize(
    ("f", "message"),
    [
        ("besselj(0, x) - m", "besselj, which has no machine code itself"),
        ("airyai(m) - x", "airyai, which has no machine code itself"),
        ("gamma(x) - m", "gamma, which has no machine code its derivative"),
        (["x - m*__import__('os').getpid()"], "^f: got"),
        ("9**9**9*x", "exponent"),
        ("1/0 + x", "division by zero"),
    ],
)
def test_formulas_that_cannot_be_continued_are_refused_at_once(f, message):
    with pytest.raises(pk.ParameterError, match=message):
        Problem(f, "x", {"m": 0.0})


@pytest.mark.parametrize("name", ["__x", "ｘ", "x" * 200, "x.y", "x)", 3])
def test_names_of_states_and_parameters(name):
    with pytest.raises(pk.ParameterError, match="^state: got"):
        Problem("1", [name], {})
    with pytest.raises(pk.ParameterError, match="^parameters: got"):
        Problem("x", "x", {name: 1.0})


def test_functions_of_fixed_parameters_need_no_derivative():
    problem = Problem("gamma(k)*x - m + besselj(0, 2)", "x", {"m": 0.0, "k": 4.0})
    assert problem([1.0])[0] == pytest.approx(6.0 + 0.22389077914123566805, rel=1e-15)


@pytest.mark.parametrize("value", [10**400, [[1.0]], np.zeros((1, 1))])
def test_parameters_that_are_no_numbers(value):
    with pytest.raises(pk.ParameterError, match=r"^parameters\['m'\]: got"):
        Problem("x - m", "x", {"m": value})


def test_the_problem_of_a_potential_of_special_functions_has_their_derivatives():
    """Si' is sin(x)/x, which has machine code though Si has none."""
    problem = pk.Potential("Si(x)", "x", interval=(0.1, 3.0)).problem()
    assert problem([1.5, 0.25]) == pytest.approx([0.25, -np.sin(1.5) / 1.5], rel=1e-15)


def test_values_of_a_function_with_its_derivatives():
    """Of no free parameter there is nothing left to difference."""
    problem = Problem(
        lambda x, a: a * x**2, "x", {"a": 3.0}, lambda x, a: np.array([[2.0 * a * x[0]]])
    )
    value, slope = problem.derivatives([2.0])
    assert (value.item(), slope.item()) == (12.0, 12.0)


@pytest.mark.parametrize("side", [-1, 1])
@pytest.mark.parametrize("gap", [s * 10.0**-k for k in (3, 6, 9, 12) for s in (1, -1)])
def test_folds_next_to_the_end_of_a_span_count_inside_it_alone(side, gap):
    """Folds of mu + x - x^3 lie at -+ 2/3^1.5: that on one side stands gap outside the span."""
    fold = 2 / 3**1.5
    law = Problem("mu + x - x^3", "x", {"mu": 0.0})
    end = side * (fold - gap)
    span = (end, 1.0) if side < 0 else (-1.0, end)
    roots = np.roots([-1.0, 0.0, 1.0, end])
    for x0 in roots[np.abs(roots.imag) < 1e-12].real:
        branch = continuation(law.replace(mu=end), "mu", x0=[x0], span=span)
        at = np.array([s["mu"] for s in branch.special("LP")])
        want = [-fold, fold] if gap < 0 else [-side * fold]
        if gap == 1e-3 and -side * x0 > 3**-0.5:  # far enough that the branch ends there
            want = []
        np.testing.assert_allclose(np.sort(at), want, rtol=1e-14)
        mu = branch.points.mu.values
        assert span[0] <= mu.min() <= mu.max() <= span[1]
        ends = [s.message for s in branch.special_points if s.kind == "end"]
        assert len(ends) == 2
        assert all(re.match("mu met its (lower|upper) bound", words) for words in ends)
        both = np.ptp(np.sign(branch.points.x.values[[0, -1]])) > 0  # stable sheets were reached
        passed = [words for words in branch.messages if "leaves its bounds" in words]
        assert len(passed) == (both and 0 < gap < 1e-3)
        assert all(f"a fold at mu = {side * fold:.9g}, and goes on" in words for words in passed)
