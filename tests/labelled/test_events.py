"""Events: zeros of the user's own functions, at places that closed forms give."""

import pickle
from dataclasses import replace

import matplotlib
import numpy as np
import pytest

import phasekit as pk
from phasekit.bifurcation.continuation.points import event
from phasekit.bifurcation.special_points import KINDS
from phasekit.labelled.continuation.branch import Branch

CUBIC = pk.Problem("mu + x - x**3", "x", {"mu": -1.0})
FOLD = 2.0 / np.sqrt(27.0)


def traced(events, stop=None, **options):
    given = pk.ContinuationOptions(**options) if options else None
    return pk.continuation(
        CUBIC, "mu", x0=[-1.3], span=(-1, 1), events=events, stop=stop, options=given
    )


def threshold(x, mu):
    return 1e9 * (x[0] - 0.4)


def test_events_lie_where_they_must():
    branch = traced(
        {
            "half": "x + 1/2",
            "level": "mu - 0.3",
            "tiny": "1e-9*(x - 0.25)",
            "large": "1e9*(x - 0.25)",
            "code": threshold,
            "cubic": "(x - 0.2)**3",
            "narrow": "1 - 2*exp(-((x - 0.123)/1e-4)**2)",
            "edge": "mu - 1",
        }
    )
    wanted = {
        "half": [-0.5], "tiny": [0.25], "large": [0.25], "code": [0.4], "cubic": [0.2],
        "narrow": [0.123 - 1e-4 * np.sqrt(np.log(2.0)), 0.123 + 1e-4 * np.sqrt(np.log(2.0))],
        "level": np.sort(np.roots([1.0, 0.0, -1.0, -0.3]).real),
        "edge": np.roots([1.0, 0.0, -1.0, -1.0])[:1].real,
    }  # fmt: skip
    assert {s.name for s in branch.special("UZ")} == set(wanted)
    for name, places in wanted.items():
        found = branch.special(name)
        assert [s.status for s in found] == ["converged"] * len(places), name
        at = [s.x.item() for s in found]
        # A triple zero of rounded numbers is known to the third root of rounding.
        np.testing.assert_allclose(at, places, rtol=0, atol=1e-5 if name == "cubic" else 1e-15)
        np.testing.assert_allclose([s["mu"] for s in found], [x**3 - x for x in at], atol=1e-15)
    assert branch.messages == ()
    assert set(branch.to_dataset().special_name.values) == {"", *wanted}


def test_events_at_a_fold_and_double_zeros():
    events = {"fold": "x + sqrt(3)/3", "turn": "mu - 2*sqrt(3)/9", "touch": "(x - 0.2)**2"}
    with pytest.raises(pk.ParameterError, match="no kind or label of special points"):
        traced(events)
    branch = traced({"at fold": events["fold"], "turn": events["turn"], "touch": events["touch"]})
    (first, _) = branch.special("LP")
    (same,) = branch.special("at fold")
    assert abs(same.x.item() - first.x.item()) < 1e-15
    double, simple = branch.special("turn")
    assert "double zero" in double.message
    assert not simple.message
    # Along the curve mu - mu_fold has rounding up to its root away.
    assert abs(double.x.item() + np.sqrt(1.0 / 3.0)) < 2e-8
    assert abs(simple.x.item() - 2.0 * np.sqrt(1.0 / 3.0)) < 1e-15
    (touch,) = branch.special("touch")
    assert abs(touch.x.item() - 0.2) < 1e-8
    assert [s.kind for s in branch.special_points].count("fold") == 2


def test_zeros_where_unknowns_vanish_and_at_kinks():
    problem = pk.Problem("mu - x**2", "x", {"mu": 1.0})
    events = {"third": "x**3", "wave": "sin(4*x)", "kink": "Abs(x - 0.2)", "begin": "mu - 1"}
    branch = pk.continuation(problem, "mu", x0=[1.0], span=(-1, 1.4), events=events)
    found = {name: branch.special(name) for name in events}
    assert [len(points) for points in found.values()] == [1, 3, 1, 2]
    assert {s.status for points in found.values() for s in points} == {"converged"}
    assert abs(found["third"][0].x.item()) < 1e-5
    wave = np.array([s.x.item() for s in found["wave"]])
    np.testing.assert_allclose(np.sort(wave), np.array([-1, 0, 1]) * np.pi / 4, atol=1e-15)
    assert abs(found["kink"][0].x.item() - 0.2) < 1e-15
    np.testing.assert_allclose(np.sort([s.x.item() for s in found["begin"]]), [-1, 1], atol=1e-15)


def test_what_is_no_zero_is_said_or_left_out():
    branch = traced({"pole": "1/(x - 0.77)", "near": "(x - 0.2)**2 + 1e-7", "all": "x**3 - x - mu"})
    assert branch.special("UZ") == ()
    pole, still = branch.messages
    assert "'pole' changes its sign without a zero at mu = -0.31" in pole
    assert "'all' is zero all along the curve" in still


@pytest.mark.slow
@pytest.mark.parametrize(
    ("stop", "reason", "x"),
    [
        ("half", "half", -0.5),
        ("fold", "fold", -np.sqrt(1.0 / 3.0)),
        ("LP", "LP", -np.sqrt(1.0 / 3.0)),
        (lambda x, mu: x[0] - 0.1, "stop", 0.1),
        (lambda x, **p: x[0] > 0.1, "stop", 0.1),
        (["level", "half"], "level", np.sort(np.roots([1.0, 0.0, -1.0, -0.3]).real)[0]),
    ],
)
def test_a_branch_ends_where_it_is_to(stop, reason, x):
    branch = traced({"half": "x + 1/2", "level": "mu - 0.3"}, stop)
    assert branch.stops[0].reason == "bound"
    assert branch.stops[1].reason == reason
    assert reason in branch.stops[1].message
    assert abs(branch.points.x.values[-1] - x) < 1e-15
    assert branch.points.special.values[-1] in ("UZ", "LP")
    assert branch.special_points[-1].kind == "end"
    assert branch.points.sizes["point"] > 5
    assert np.all(np.diff(branch.points.x) > 0.0)
    whole = traced({"half": "x + 1/2", "level": "mu - 0.3"}, None)
    longer = branch.extend()  # to the next one, if there is one
    plain, kept = (one.points.x.values[one.points.special == ""] for one in (longer, whole))
    assert np.sum(branch.points.special == "") < len(plain)
    np.testing.assert_array_equal(plain, kept[: len(plain)])


def test_both_ways_may_end_and_the_start_does_not():
    branch = pk.continuation(
        CUBIC.replace(mu=0.0), "mu", x0=[0.0], span=(-1, 1), stop=["LP", "zero"],
        events={"zero": "x"},
    )  # fmt: skip
    assert [stop.reason for stop in branch.stops] == ["LP", "LP"]
    np.testing.assert_allclose(np.sort(branch.points.mu.values[[0, -1]]), [-FOLD, FOLD], atol=1e-15)
    (zero,) = branch.special("zero")
    assert zero.x.item() == 0.0


@pytest.mark.slow
def test_branches_with_events_are_saved_pickled_extended_and_drawn(tmp_path):
    branch = traced({"half": "x + 1/2", "code": threshold}, "code")
    again = pickle.loads(pickle.dumps(branch))
    assert again.points.identical(branch.points)
    short = traced({"half": "x + 1/2", "code": threshold}, "code", max_points=7)
    assert short.stops[1].reason == "max_points"
    assert short.extend(500).points.identical(branch.points)
    branch.save(tmp_path / "b.nc")
    with pytest.raises(pk.ParameterError, match=r"code by functions.*load\(path, events="):
        Branch.load(tmp_path / "b.nc")
    loaded = Branch.load(tmp_path / "b.nc", events={"code": threshold})
    assert loaded.points.identical(branch.points)
    assert loaded.to_dataset().identical(branch.to_dataset())
    assert [s.name for s in loaded.special("UZ")] == ["half", "code"]
    ax = branch.plot()
    assert {"half", "code"} <= {text.get_text() for text in ax.texts}
    matplotlib.pyplot.close(ax.figure)


def test_events_on_curves_in_two_parameters_and_on_angles():
    problem = pk.Problem("mu + l*x - x**3", "x", {"mu": -1.0, "l": 1.0})
    branch = pk.continuation(problem, "mu", x0=[-1.3], span=(-1, 1), events={"x = 1/4": "x - 1/4"})
    curve = branch.special("LP")[0].curve("l", (-1, 1))
    (point,) = curve.special("x = 1/4")  # folds: l = 3 x^2, mu = -2 x^3
    found = [point.x.item(), point["l"], point["mu"]]
    np.testing.assert_allclose(found, [0.25, 0.1875, -0.03125], atol=1e-15)
    turning = pk.Problem("w - mu", "w", {"mu": 0.0}, periods={"w": 2 * np.pi})
    turns = pk.continuation(turning, "mu", span=(-1, 9), events={"one": "w - 1", "far": "w - 4"})
    np.testing.assert_allclose([s["mu"] for s in turns.special("one")], [1, 1 + 2 * np.pi])
    assert turns.special("far") == ()  # angles are shown up to pi


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"events": ["x"]}, "events: got .* wants a mapping"),
        ({"events": {"": "x"}}, "events: got ''"),
        ({"events": {"UZ": "x"}}, "no kind or label"),
        ({"events": {"a": "y + 1"}}, r"events\['a'\].*unknown symbol y"),
        ({"events": {"a": "__import__('os')"}}, r"events\['a'\]"),
        ({"events": {"a": "2"}}, "depends on the states"),
        ({"events": {"a": 3}}, "a formula, or a function"),
        ({"events": {"a": lambda x: 1.0}}, r"events\['a'\].*arguments"),
        ({"events": {"a": lambda x, mu: x[:0]}}, "one real number"),
        ({"events": {"a": lambda x, mu: x[0] > 1}}, "yes or no"),
        ({"events": {"a": lambda x, mu: x[7]}}, "IndexError"),
        ({"stop": "nothing"}, "stop: event or special point 'nothing' is unknown"),
        ({"stop": 3}, "stop: got 3"),
        ({"stop": []}, r"stop: got \[\]"),
        ({"stop": "end"}, "is unknown"),
        (
            {"stop": "hopf", "options": pk.ContinuationOptions(detect=("fold",))},
            "stop: got 'hopf', wants what is looked for",
        ),
    ],
)
def test_events_that_are_refused(arguments, message):
    with pytest.raises(pk.ParameterError, match=message):
        pk.continuation(CUBIC, "mu", x0=[-1.3], span=(-1, 1), **arguments)


def test_a_branch_ends_at_the_first_of_two_events_in_one_step():
    near = {"near": "(x - 0.1)*(x - 0.1001)*(x + 0.1)*(x + 0.1001)"}
    branch = pk.continuation(
        CUBIC.replace(mu=0.0), "mu", x0=[0.0], span=(-1, 1), events=near, stop="near"
    )
    assert [stop.reason for stop in branch.stops] == ["near", "near"]
    np.testing.assert_allclose(np.sort(branch.points.x.values[[0, -1]]), [-0.1, 0.1], atol=1e-14)


@pytest.mark.slow
def test_many_zeros_at_even_distances_are_all_found():
    branch = traced({"wave": "sin(300*x)"})
    end = np.max(np.roots([1.0, 0.0, -1.0, -1.0]).real[:1])
    count = int(300 * end / np.pi)
    found = np.sort([s.x.item() for s in branch.special("wave")])
    np.testing.assert_allclose(found, np.arange(-count, count + 1) * np.pi / 300, atol=1e-14)
    assert branch.messages == ()


@pytest.mark.slow
def test_zeros_that_may_be_missing_and_values_that_are_none_are_said(monkeypatch):
    monkeypatch.setattr(event, "MOST", 16)
    branch = traced(
        {
            "fast": lambda x, mu: 2.0 + np.sin(1e8 * x[0]),
            "none": "log(x - 10)",
            "half": lambda x, mu: np.sqrt(x[0]) + 1.0,
        }
    )
    assert branch.special("UZ") == ()
    fast, none, half = branch.messages
    assert "'fast' changes so often between mu = -1 and 1 that zeros there may be missing" in fast
    assert "'none' has no value at" in none
    assert "'half' has no value at" in half


@pytest.mark.parametrize("value", [1j, None, "abc", [1.0, 2.0]])
def test_what_an_event_returns_later_is_checked(value):
    with pytest.raises(pk.ParameterError, match="events: returned"):
        traced({"e": lambda x, mu: x[0] - 0.2 if x[0] < 0 else value})


@pytest.mark.slow
def test_functions_that_are_given_again_are_checked(tmp_path):
    traced({"code": threshold}).save(tmp_path / "b.nc")
    with pytest.raises(pk.ParameterError, match=r"events\['code'\].*arguments"):
        Branch.load(tmp_path / "b.nc", events={"code": lambda x: 1.0})


@pytest.mark.parametrize(
    ("state", "parameter"),
    [("kind", "p"), ("x", "index"), ("step", "p"), ("x", "special_x"), ("arclength", "p")],
)
def test_names_that_columns_of_a_branch_have_are_refused(state, parameter):
    problem = pk.Problem([f"{parameter} - {state}**2"], [state], {parameter: 0.5})
    taken = state if state != "x" else parameter
    with pytest.raises(pk.ParameterError, match=f"^problem: got '{taken}', wants .* columns"):
        pk.continuation(problem, parameter, x0=[0.7], span=(-1, 1))


@pytest.mark.parametrize("name", ["special_x", "special_kind", "arclength", "point"])
def test_records_do_not_take_the_place_of_columns(name):
    problem = pk.Problem(["p - x**2"], ["x"], {"p": 0.5})
    with pytest.raises(pk.ParameterError, match="^record: got "):
        pk.continuation(problem, "p", x0=[0.7], span=(-1, 1), record={name: lambda x, p: 1.0})


def test_fixed_parameters_may_have_any_name():
    problem = pk.Problem(["p*kind - x**2"], ["x"], {"p": 0.5, "kind": 1.0})
    few = pk.ContinuationOptions(max_points=3)
    branch = pk.continuation(problem, "p", x0=[0.7], span=(-1, 1), options=few)
    assert branch.to_dataset().special_kind.values.tolist()[0] == "end"


def test_kinds_that_were_added_are_no_names_of_events(monkeypatch):
    kind = replace(KINDS["event"], name="swallowtail", label="SW")
    problem = pk.Problem("mu + x - x**3", "x", {"mu": -1.0})
    start = {"x0": [-1.3], "span": (-1, 1)}
    assert pk.continuation(problem, "mu", **start, events={"SW": "x"}).special("SW")
    monkeypatch.setitem(KINDS, "swallowtail", kind)
    for name in ("swallowtail", "SW"):
        with pytest.raises(pk.ParameterError, match="wants a name that is no kind or label"):
            pk.continuation(problem, "mu", **start, events={name: "x"})
