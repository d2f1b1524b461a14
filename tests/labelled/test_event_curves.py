"""Events followed in two parameters, against curves in closed form."""

import json
import pickle
import shutil

import matplotlib.pyplot as plt
import numba
import numpy as np
import pytest

import phasekit as pk
from phasekit.labelled.continuation.branch import Branch

SPAN = (-1.0, 2.0)


def plain(x, mu, l):  # noqa: E741
    return [mu + l * x[0] - x[0] ** 3]


@numba.njit
def compiled(x, mu, l):  # noqa: E741
    return np.array([mu + l * x[0] - x[0] ** 3])


def tilted(x, mu, l):  # noqa: E741
    return x[0] - 0.1 + l * mu / 10.0


def point_on(f, event, **more):
    problem = pk.Problem(f, "x", {"mu": -1.0, "l": 1.0})
    branch = pk.continuation(problem, "mu", x0=[-1.3], span=(-1, 1), events={"e": event, **more})
    return branch.special("e")[0]


@pytest.mark.parametrize("event", ["x - 0.1 + l*mu/10", tilted])
@pytest.mark.parametrize("f", ["mu + l*x - x**3", plain, compiled])
def test_a_curve_solves_the_equations_and_the_event(f, event):
    curve = point_on(f, event).curve("l", SPAN)
    x, mu, l = (curve.points[name].values for name in ("x", "mu", "l"))  # noqa: E741
    assert curve.kind == "event"
    assert curve.free == ("mu", "l")
    assert [stop.reason for stop in curve.stops] == ["bound", "bound"]
    assert (l[0], l[-1]) == SPAN
    assert len(l) > 10
    np.testing.assert_allclose(x, 0.1 - l * mu / 10.0, atol=1e-13)
    np.testing.assert_allclose(mu, x**3 - l * x, atol=1e-13)
    away = curve.points.special.values == ""
    unstable = curve.points.n_unstable.values
    np.testing.assert_array_equal(unstable[away], (l > 3.0 * x**2)[away])
    (fold,) = curve.special("LP")
    assert fold.status == "converged"
    np.testing.assert_allclose(fold["l"], 3.0 * fold.x.item() ** 2, rtol=1e-9)


def test_a_curve_knows_its_other_events_and_is_kept(tmp_path):
    point = point_on("mu + l*x - x**3", tilted, other="l + 1/2")
    curve = point.curve("l", SPAN)
    assert [s["l"] for s in curve.special("other")] == [-0.5]
    assert curve.messages == ()
    assert "points of the event 'e'" in repr(curve)
    assert pickle.loads(pickle.dumps(curve)) == curve
    options = pk.ContinuationOptions(max_points=5)
    with pytest.warns(RuntimeWarning, match="max_points"):
        short = point.curve("l", SPAN, options=options)
    assert short.extend(500).points.identical(curve.points)
    curve.save(tmp_path / "e.zarr")
    with pytest.raises(pk.ParameterError, match=r"looks for e by functions"):
        Branch.load(tmp_path / "e.zarr")
    loaded = Branch.load(tmp_path / "e.zarr", events={"e": tilted})
    assert loaded == curve
    assert loaded.to_dataset().identical(curve.to_dataset())
    plt.close(curve.plot().figure)


@pytest.fixture(scope="module")
def stored(tmp_path_factory):
    """The file of a curve, to be damaged in copies."""
    path = tmp_path_factory.mktemp("stored") / "e.nc"
    point_on("mu + l*x - x**3", "x - 0.1").curve("l", SPAN).save(path)
    return path


@pytest.mark.parametrize(
    "held",
    [{}, {"e": "x -"}, {"e": "y"}, {"e": "x", "f": "x"}, [], None, {"e": 3}, {"x" * 999: "x"}],
)
def test_a_stored_curve_with_another_event_is_damaged(tmp_path, stored, held):
    h5py = pytest.importorskip("h5py")
    path = shutil.copy(stored, tmp_path)
    with h5py.File(path, "r+") as file:
        spec = json.loads(file.attrs["branch"])
        file.attrs["branch"] = json.dumps(spec | {"held": held})
    with pytest.raises(pk.StoreError, match="is damaged"):
        Branch.load(path)


def test_an_event_may_hold_the_first_parameter_alone():
    curve = point_on("mu + l*x - x**3", "mu - 0.3").curve("l", SPAN)
    x, l = curve.points.x.values, curve.points.l.values  # noqa: E741
    assert set(curve.points.mu.values) == {0.3}
    np.testing.assert_allclose(l, x**2 - 0.3 / x, atol=1e-13)
    assert {stop.message for stop in curve.stops} == {"l met its upper bound 2"}
    (fold,) = curve.special("LP")  # 27 mu^2 = 4 l^3
    np.testing.assert_allclose(fold["l"], (27.0 * 0.09 / 4.0) ** (1.0 / 3.0), rtol=1e-9)


def test_a_condition_of_a_bifurcation_is_one_all_along():
    (point, *_) = pk.continuation(
        pk.Problem("mu + l*x - x**3", "x", {"mu": -1.0, "l": 1.0}), "mu", x0=[-1.3], span=(-1, 1),
        events={"slope": "l - 3*x^2"},
    ).special("slope")  # fmt: skip
    curve = point.curve("l", SPAN)
    np.testing.assert_allclose(curve.points.mu, -2.0 * curve.points.x**3, atol=1e-13)
    assert curve.special("LP") == ()
    assert [m for m in curve.messages if "eigenvalue of f_x is zero all along" in m]


def test_hopf_points_lie_on_a_curve_of_two_states():
    problem = pk.Problem(
        ["a - (b + 1)*x + x**2*y", "b*x - x**2*y"], ("x", "y"), {"b": 1.5, "a": 1.0}
    )
    branch = pk.continuation(
        problem, "b", x0=[1, 1.5], span=(1, 6), events={"y3": "y - 3", "product": "x*y^2*a - 4"}
    )
    curve = branch.special("y3")[0].curve("a", (0.2, 3.0))  # x = a, y = b/a
    np.testing.assert_allclose(curve.points.b, 3.0 * curve.points.a, rtol=1e-13)
    found = [s["a"] for s in curve.special("H")]  # b = 1 + a^2
    np.testing.assert_allclose(found, [1.5 - np.sqrt(1.25), 1.5 + np.sqrt(1.25)], rtol=1e-9)
    (meeting,) = curve.special("product")
    np.testing.assert_allclose([meeting["b"], meeting["a"]], [2.0, 2.0 / 3.0], rtol=1e-12)


def test_the_curve_of_an_event_of_a_map_has_its_points():
    henon = pk.Problem(["1 - a*x**2 + y", "b*x"], ("x", "y"), {"a": 0.1, "b": 0.3}, map=True)
    fixed = pk.continuation(henon, "a", x0=[0.9, 0.3], span=(-0.2, 1.0), events={"e": "x - 0.8"})
    curve = fixed.special("e")[0].curve("b", (-2.0, 0.9))
    a, b = curve.points.a.values, curve.points.b.values
    np.testing.assert_allclose(a, (0.2 + 0.8 * b) / 0.64, atol=1e-13)
    found = {s.label: s["b"] for s in curve.special_points if s.kind != "end"}
    # trace -1.6 a, determinant -b: 1 - tr + det = 0, 1 + tr + det = 0, det = 1
    expected = {"LP": -1.5, "TR": -1.0, "PD": 1.0 / 6.0}
    assert found == pytest.approx(expected, rel=1e-9)


def test_an_event_of_an_angle_is_followed_through_its_turns():
    turning = pk.Problem("w - mu - l", "w", {"mu": 0.0, "l": 0.0}, periods={"w": 2 * np.pi})
    branch = pk.continuation(turning, "mu", span=(-1, 9), events={"sum": "sin(w) - l/4 - 1/2"})
    curve = branch.special("sum")[1].curve("l", (-5.9, 1.9))
    w, l = curve.points.w.values, curve.points.l.values  # noqa: E741
    np.testing.assert_allclose(np.sin(w), l / 4.0 + 0.5, atol=1e-13)
    np.testing.assert_allclose(np.sin(curve.points.mu + l), np.sin(w), atol=1e-13)


def test_what_has_no_curve_is_refused():
    point = point_on("mu + l*x - x**3", "(x - 0.2)**2")
    with pytest.raises(pk.ConvergenceError, match="its function touches zero"):
        point.curve("l", SPAN)
    point = point_on("mu + l*x - x**3", "x - 0.2")
    curve = point.curve("l", SPAN)
    with pytest.raises(pk.ParameterError, match="a point of a branch of equilibria"):
        curve.special("LP")[0].curve("l", SPAN)
    with pytest.raises(pk.ParameterError, match="another one than that of the branch"):
        point.curve("mu", SPAN)
    problem = pk.Problem("mu + l*x - x**3", "x", {"mu": -1.0, "l": 1.0})
    stopped = pk.continuation(
        problem,
        "mu",
        x0=[-1.3],
        span=(-1, 1),
        stop=lambda x, mu, l: x[0] > 0.2,  # noqa: E741
    )
    (end,) = stopped.special("UZ")
    with pytest.raises(pk.ParameterError, match="says yes or no"):
        end.curve("l", SPAN)
