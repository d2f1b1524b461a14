"""Systems that conserve something: what is said where equilibria are no points of one branch."""

import numpy as np
import pytest

import phasekit as pk

VOLTERRA = ["a*x - 0.3*x*y", "-0.7*y + 0.9*x*y"]
CENTER = [0.7 / 0.9, 1.1 / 0.3]


def traced(f, states, x0, *, map=False, span=(0.5, 2.0), a=1.1):  # noqa: A002
    problem = pk.Problem(f, states, {"a": a}, map=map)
    return pk.continuation(problem, "a", x0=x0, span=span)


def of_centers(branch):
    return [m for m in branch.messages if "stays on the imaginary axis" in m]


def predators(x, a):
    return [
        a * x[0] - 0.3 * x[0] * x[1],
        -0.7 * x[1] + 0.9 * x[0] * x[1],
        -0.8 * x[2] + x[0] * x[1],
    ]


@pytest.mark.parametrize(
    ("f", "states", "x0"),
    [
        (VOLTERRA, "xy", CENTER),
        ([f"1e9*({one})" for one in VOLTERRA], "xy", CENTER),
        ([*VOLTERRA, "-1e6*z + x*y"], "xyz", [*CENTER, 0.0]),
        (predators, "xyz", [*CENTER, 3.0]),
        (["y", "-a*sin(x) + x*y"], "xy", [0.0, 0.0]),  # reversible
    ],
)
def test_centers_all_along_are_no_hopf_points(f, states, x0):
    branch = traced(f, list(states), x0)
    assert [s.kind for s in branch.special_points] == ["end", "end"]
    assert set(branch.points.n_unstable.values) == {0}
    assert len(of_centers(branch)) == 1


def test_a_pair_that_crosses_beside_a_center_is_found_once():
    growth = "(a - 1.2)"
    more = [f"{growth}*z - w - z^3", f"z + {growth}*w"]
    branch = traced([*VOLTERRA, *more], list("xyzw"), [*CENTER, 0.0, 0.0])
    (hopf,) = [s for s in branch.special_points if s.kind != "end"]
    assert (hopf.kind, hopf["a"]) == ("hopf", pytest.approx(1.2, abs=1e-12))
    a, unstable = branch.points.a.values, branch.points.n_unstable.values
    away = np.abs(a - 1.2) > 1e-9
    np.testing.assert_array_equal(unstable[away], 2 * (a > 1.2)[away])


@pytest.mark.parametrize("more", [[], ["z/2 + x"], ["z/2 + x", "-w/3"]])
def test_centers_of_maps_are_no_torus_points(more):
    states = list("xyzw")[: 2 + len(more)]
    x0 = [0.14, 0.14, 0.28, 0.0][: len(states)]
    branch = traced(["y", "a - x - y^2", *more], states, x0, map=True, span=(-0.5, 2.0), a=0.3)
    assert [s.kind for s in branch.special_points] == ["end", "end"]
    assert set(branch.points.n_unstable.values) == {0}
    (message,) = branch.messages
    assert "stays on the unit circle" in message


@pytest.mark.parametrize("damping", [1e-6, 1e-3])
def test_weak_damping_still_has_its_hopf_point(damping):
    branch = traced(["y", f"-x + {damping}*(a - 1)*y - x^3", "-1e3*z"], list("xyz"), [0, 0, 0])
    (hopf,) = branch.special("H")
    assert hopf["a"] == pytest.approx(1.0, abs=1e-8)
    assert of_centers(branch) == []


def epidemic(x, a):
    new, lost, back = 0.1 * x[0] * x[1], a * x[1], 0.05 * x[2]
    return [x[0] - new + back, x[1] + new - lost, x[2] + lost - back]


@pytest.mark.parametrize(
    "f", [["s - s*i/10 + r/20", "i + s*i/10 - a*i", "r + a*i - r/20"], epidemic]
)
def test_a_sum_that_a_map_conserves_is_named(f):
    branch = traced(f, ["s", "i", "r"], [0.5, 1.0, 1.0], map=True, span=(0.01, 0.09), a=0.05)
    assert {stop.reason for stop in branch.stops} == {"stuck"}
    message = branch.stops[1].message
    assert message.startswith("f conserves s + i + r: fixed points are not isolated at")
    assert "s + i + r = total" in message
    assert [s.kind for s in branch.special_points] == ["end", "end"]


@pytest.mark.parametrize(
    ("f", "states", "x0", "kept"),
    [
        (["x*y*a", "-x^2*a"], "xy", [0.0, 1.0], "x^2 + y^2"),
        (["y*z/2", "-2*x*z*a", "x*y"], "xyz", [1.0, 0.0, 0.0], "x^2 - 0.5*z^2"),
        (["x*y*a", "-2*x*y*a"], "xy", [0.5, 0.0], "x + 0.5*y"),
        (["a*x - 1e-12*y", "-1e12*(a*x - 1e-12*y)"], "xy", [1.0, 1.1e12], "x + 1e-12*y"),
        (["x*y", "-y*(1 + x^2)*(a/1.1)"], "xy", [0.5, 0.0], "y + 0.5*x^2 + log(x) at a = 1.1"),
    ],
)
def test_quantities_that_flows_conserve_are_named(f, states, x0, kept):
    branch = traced(f, list(states), x0)
    assert [stop.reason for stop in branch.stops] == ["stuck", "stuck"]
    message = branch.stops[1].message
    assert message.startswith(f"f conserves {kept}: equilibria are not isolated at")
    assert [s.kind for s in branch.special_points] == ["end", "end"]


def test_a_quantity_without_a_name_is_told_by_its_gradient():
    branch = traced(["y*exp(x)", "-y*a"], ["x", "y"], [0.5, 0.0])  # conserves y - a exp(-x)
    message = branch.stops[1].message
    assert message.startswith("equilibria are not isolated at x = 0.5, y = 0, a = 1.1")
    slope = 1.1 * np.exp(-0.5)
    assert f"(x, y) = ({slope:.6g}, 1)" in message
    assert "f conserves a quantity" in message


@pytest.mark.parametrize(
    ("f", "x0"), [(["a*x - 1.1*x - x^2", "-y"], [0, 0]), (["a*x - 1.1*x - x^3", "x - y"], [0, 0])]
)
def test_a_start_on_a_branch_point_is_no_family(f, x0):
    branch = traced(f, ["x", "y"], x0)
    assert [stop.reason for stop in branch.stops] == ["bound", "bound"]
    (point,) = branch.special("BP")
    assert point["a"] == pytest.approx(1.1, abs=1e-12)
    assert [stop.reason for stop in point.switch().stops] != ["stuck", "stuck"]
