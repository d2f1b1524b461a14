"""Curves of folds, period doublings and torus points of maps, against closed forms."""

import matplotlib.pyplot as plt
import numba
import numpy as np
import pytest

import phasekit as pk


def henon(form):
    def f(x, a, b):
        return np.array([1.0 - a * x[0] ** 2 + x[1], b * x[0]])

    formulas = ["1 - a*x**2 + y", "b*x"]
    f = {"formula": formulas, "function": f, "compiled": numba.njit(f)}[form]
    return pk.Problem(f, ["x", "y"], {"a": 0.1, "b": 0.3}, map=True)


@pytest.mark.parametrize("form", ["formula", "function", "compiled"])
def test_folds_and_period_doublings_of_the_henon_map(form):
    branch = pk.continuation(henon(form), "a", x0=[0.7, 0.2], span=(-1.0, 2.0))
    few = pk.ContinuationOptions(max_step=0.1 if form == "formula" else 0.3)
    exact = 1e-12 if form == "formula" else 1e-9
    for label, kind, over, at, resonance in (
        ("LP", "fold", -0.25, -1.0, "R1"),
        ("PD", "period_doubling", 0.75, 3.0, "R2"),
    ):
        (point,) = branch.special(label)
        curve = point.curve("b", (-1.5, 0.8), options=few)
        a, b = curve.points.a.values, curve.points.b.values
        assert curve.kind == kind
        assert (b.min(), b.max()) == (-1.5, 0.8)
        np.testing.assert_allclose(a, over * (1.0 - b) ** 2, rtol=0, atol=exact)
        # The multipliers of the other point of the curve at which their product -b is 1.
        (strong,) = curve.special(resonance)
        assert strong.status == "converged"
        assert [one.kind for one in curve.special_points if one is not strong] == ["end", "end"]
        np.testing.assert_allclose((strong["a"], strong["b"]), (at, -1.0), atol=1e-7)


def linear():
    """The origin of a map with the trace t and the determinant d."""
    text = ["y", "t*y - d*x + x**2/3 + x**2*y/7"]
    return pk.Problem(text, ["x", "y"], {"d": 0.5, "t": 0.5}, map=True)


def test_strong_resonances_on_a_torus_curve(tmp_path):
    branch = pk.continuation(linear(), "d", x0=[0.0, 0.0], span=(0.5, 1.4))
    (point,) = branch.special("TR")
    curve = point.curve("t", (-2.5, 2.5))
    assert curve.kind == "torus"
    t = curve.points.t.values
    assert (t.min(), t.max()) == (-2.5, 2.5)
    np.testing.assert_allclose(curve.points.d, 1.0, atol=1e-12)
    np.testing.assert_allclose([curve.points.x, curve.points.y], 0.0, atol=1e-12)
    resonant = [(one.label, one["t"]) for one in curve.special_points if one.label[0] == "R"]
    assert [label for label, _ in sorted(resonant, key=lambda one: one[1])] == [
        "R2", "R3", "R4", "R1",
    ]  # fmt: skip
    np.testing.assert_allclose(sorted(at for _, at in resonant), [-2.0, -1.0, 0.0, 2.0], atol=1e-9)
    own = curve.points.isel(point=curve.points.special.values == "")
    pairs = np.where(abs(own.t) < 2.0, "torus", "neutral_saddle")
    assert own.kind_of_pair.values.tolist() == pairs.tolist()
    values = branch.special("TR")[0].eigenvalues
    np.testing.assert_allclose(abs(values), 1.0, atol=1e-12)
    curve.save(tmp_path / "curve.nc")
    assert pk.Branch.load(tmp_path / "curve.nc").points.equals(curve.points)
    lines = [line.get_label() for line in curve.plot().lines]
    plt.close("all")
    assert {"torus", "neutral saddle"} <= set(lines)


def test_the_torus_point_of_the_delayed_logistic_map():
    problem = pk.Problem(["r*x*(1 - y) + e*x", "x"], ["x", "y"], {"r": 1.5, "e": 0.0}, map=True)
    branch = pk.continuation(problem, "r", x0=[1 / 3, 1 / 3], span=(1.2, 2.5))
    (point,) = branch.special("TR")
    curve = point.curve("e", (-0.5, 0.5))
    assert curve.points.sizes["point"] > 5
    # The fixed point has y = 1 - (1 - e)/r, where the product of the multipliers is r y = 1.
    np.testing.assert_allclose(curve.points.r + curve.points.e, 2.0, atol=1e-12)
    assert [one.kind for one in curve.special_points] == ["end", "end"]


def test_a_generalized_flip():
    text = ["-(1 + p)*x + x**2/2 + s*x**3"]  # c = s + 1/4
    problem = pk.Problem(text, ["x"], {"p": -0.5, "s": 1.0}, map=True)
    (point,) = pk.continuation(problem, "p", x0=[0.0], span=(-0.5, 0.5)).special("PD")
    curve = point.curve("s", (-1.0, 1.0))
    (flip,) = curve.special("GPD")
    np.testing.assert_allclose((flip["p"], flip["s"]), (0.0, -0.25), atol=1e-9)
    assert np.ptp(curve.points.s.values) == 2.0


def test_a_fold_and_a_flip_together():
    text = ["x + p - x**2", "(s + x)*y - y**3"]
    problem = pk.Problem(text, ["x", "y"], {"p": 0.5, "s": -1.2}, map=True)
    branch = pk.continuation(problem, "p", x0=[0.5**0.5, 0.0], span=(-1.0, 0.9))
    for label in ("LP", "PD"):
        (point,) = branch.special(label)
        (together,) = point.curve("s", (-1.5, -0.5)).special("LPPD")
        np.testing.assert_allclose((together["p"], together["s"]), (0.0, -1.0), atol=1e-7)


def test_a_chenciner_point():
    turn, grow = "(cos(1)*{} - sin(1)*{})", "(1 + p + s*(x**2 + y**2))"
    text = [
        f"{turn.format('x', 'y')}*{grow}",
        f"(sin(1)*x + cos(1)*y)*{grow}",
    ]
    problem = pk.Problem(text, ["x", "y"], {"p": -0.5, "s": 0.7}, map=True)
    (point,) = pk.continuation(problem, "p", x0=[0.0, 0.0], span=(-0.5, 0.5)).special("TR")
    curve = point.curve("s", (-1.0, 1.0))
    (chenciner,) = curve.special("CH")
    np.testing.assert_allclose((chenciner["p"], chenciner["s"]), (0.0, 0.0), atol=1e-9)
    assert [one.label for one in curve.special_points] == ["EP", "CH", "EP"]


def test_points_of_flows_are_not_looked_for_on_curves_of_maps_nor_the_other_way_round():
    problem = pk.Problem(["y", "m + n*y + x**2 + x*y"], ["x", "y"], {"m": -1.0, "n": -0.5})
    fold = pk.continuation(problem, "m", x0=[1.0, 0.0], span=(-1.0, 1.0)).special("LP")[0]
    kinds = {one.kind for one in fold.curve("n", (-1.0, 1.0)).special_points}
    assert kinds == {"end", "bogdanov_takens"}


def test_fixed_points_of_an_angle_map_up_to_whole_turns():
    """Accelerator modes of the standard map: y grows by a turn each time where k sin x = 2 pi."""
    at = {"k": 7.0}
    x = np.pi - np.arcsin(2.0 * np.pi / 7.0)
    angle = {"x": 2.0 * np.pi}
    few = pk.ContinuationOptions(max_points=5)
    standard = ["x + y + k*sin(x)", "y + k*sin(x)"]
    turns = [f"{text} - 2*pi" for text in standard]
    momentum = pk.Problem(standard, ["x", "y"], at, periods=angle | {"y": 2.0 * np.pi}, map=True)
    for start in ([x, 0.0], [x + 1e-5, 0.0]):
        with pytest.raises(pk.ParameterError, match="^x0: got .* f adds 1 turn to x there: take"):
            pk.continuation(momentum, "k", x0=start, span=(6.5, 8.0), options=few)
    lifted = pk.Problem(turns, ["x", "y"], at, periods=momentum.periods, map=True)
    branch = pk.continuation(lifted, "k", x0=[x, 0.0], span=(6.5, 8.0), options=few)
    assert branch.points.sizes["point"] > 5
    np.testing.assert_allclose(branch.points.k * np.sin(branch.points.x), 2.0 * np.pi, rtol=1e-12)
    plain = pk.continuation(momentum, "k", x0=[3.1, 0.01], span=(6.5, 8.0), options=few)
    np.testing.assert_allclose(abs(plain.points.x), np.pi, rtol=1e-12)


def test_what_newtons_method_leaves_of_zero_is_no_scale():
    """Quadratic convergence ends at numbers such as 1e-52, which say nothing of a state's size."""
    standard = ["x + y + 7*sin(x)*k", "y + 7*sin(x)*k"]
    problem = pk.Problem(standard, ["x", "y"], {"k": 1.0}, map=True)
    for start in ([0.3, 2.0 * np.pi], [0.3, 1.0], [0.1, -0.4]):
        branch = pk.continuation(problem, "k", x0=start, span=(0.9, 1.1))
        assert [stop.reason for stop in branch.stops] == ["bound", "bound"]
        assert not np.any([branch.points.x, branch.points.y])
