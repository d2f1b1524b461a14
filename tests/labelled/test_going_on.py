"""Branches that are cut, by a key, a wish or a bound, are kept and go on as if they never were."""

import contextlib
import importlib
import re
import signal
import sys
import warnings

import numpy as np
import pytest

import phasekit as pk
from phasekit.bifurcation.continuation.curve_walk import CurveWalk
from phasekit.numerics import interrupts

SWALLOW = ["mu + l*x - x**3"]


class Stopped:
    """A right-hand side that somebody stops at a call."""

    def __init__(self, f, call):
        self.f, self.left = f, call

    def __call__(self, x, **p):
        self.left -= 1
        if self.left == 0:
            raise KeyboardInterrupt
        return self.f(x, **p)


def cusp(x, mu, l):  # noqa: E741
    return [mu + l * x[0] - x[0] ** 3]


def brusselator(x, b):
    return [1.0 - (b + 1.0) * x[0] + x[0] ** 2 * x[1], b * x[0] - x[0] ** 2 * x[1]]


def points_of(branch, *names):
    return np.array([branch.points[name].values for name in names])


@pytest.mark.parametrize("part", [0.15, 0.37, 0.7])
def test_what_was_followed_is_kept_and_goes_on_to_the_last_bit(part):
    f = Stopped(cusp, 0)
    problem = pk.Problem(f, "x", {"mu": -1.0, "l": 1.0})
    whole = pk.continuation(problem, "mu", x0=[-1.3], span=(-1.2, 1.2))
    f.left = int(-part * f.left)
    with pytest.warns(RuntimeWarning, match=r"is not complete, .*interrupted.*extend\(\)"):
        part = pk.continuation(problem, "mu", x0=[-1.3], span=(-1.2, 1.2))
    assert "interrupted" in {stop.reason for stop in part.stops}
    assert len(part.points.point) <= len(whole.points.point)
    longer = part.extend()
    assert [stop.reason for stop in longer.stops] == ["bound", "bound"]
    assert len(longer.special("fold")) == 2
    np.testing.assert_array_equal(points_of(longer, "mu", "x"), points_of(whole, "mu", "x"))


@pytest.mark.slow
def test_an_interrupted_branch_is_saved(tmp_path):
    problem = pk.Problem(Stopped(cusp, 700), "x", {"mu": -1.0, "l": 1.0})
    with pytest.warns(RuntimeWarning, match="interrupted"):
        part = pk.continuation(problem, "mu", x0=[-1.3], span=(-1.2, 1.2))
    part.save(tmp_path / "part.nc")
    again = pk.Branch.load(tmp_path / "part.nc", problem=problem)
    assert [stop.reason for stop in again.stops] == [stop.reason for stop in part.stops]
    np.testing.assert_array_equal(points_of(again.extend(), "mu"), points_of(part.extend(), "mu"))


class Pressed:
    """Ctrl-C at the entry of a function of a number, of those after `hold`, or before it."""

    def __init__(self, number, begun=False):
        self.number, self.count, self.begun = number, 0, begun

    def __enter__(self):  # noqa: D105
        self.before = signal.signal(signal.SIGINT, signal.default_int_handler)
        sys.setprofile(self)
        return self

    def __exit__(self, *_):  # noqa: D105
        sys.setprofile(None)
        signal.signal(signal.SIGINT, self.before)

    def __call__(self, frame, event, arg):
        if event == "call":
            self.count += self.begun
            if self.count == self.number:
                sys.setprofile(None)
                signal.raise_signal(signal.SIGINT)
        elif event == "return" and frame.f_code is interrupts.hold.__code__:
            self.begun = True


AB = pk.Problem(
    ["-x + p*(1 - x)*exp(y)", "-y + 14*p*(1 - x)*exp(y) - b*y"], ("x", "y"), {"p": 0.05, "b": 2.0}
)


def equilibria():
    return pk.continuation(AB, "p", x0=[0.0, 0.0], span=(0.01, 0.3), record={"sum": "x + y"})


def proved():
    return pk.continuation(
        pk.Problem(SWALLOW, "x", {"mu": -1.0, "l": 1.0}), "mu", x0=[-1.3], span=(-1.0, 0.5),
        certify=True,
    )  # fmt: skip


def ended():
    options = pk.ContinuationOptions(directions="forward")
    return pk.continuation(AB, "p", x0=[0.0, 0.0], span=(0.01, 0.3), stop="hopf", options=options)


def hopf_curve():
    return HOPF.curve("b", (1.9, 2.1))


def family():
    return HOPF.switch(options=pk.ContinuationOptions(max_points=8))


def longer():
    return SHORT.extend(1000)


HOPF = equilibria().special("hopf")[0]
SHORT = pk.continuation(
    AB, "p", x0=[0.0, 0.0], span=(0.01, 0.3), options=pk.ContinuationOptions(max_points=9)
).extend(2)


# One that comes where Python ends a generator is written down, and raised again later.
@pytest.mark.filterwarnings("ignore::pytest.PytestUnraisableExceptionWarning")
@pytest.mark.parametrize(
    "call",
    [
        equilibria, ended, longer,
        *(pytest.param(call, marks=pytest.mark.slow) for call in (proved, hopf_curve, family)),
    ],
)  # fmt: skip
def test_ctrl_c_keeps_what_was_followed_wherever_it_comes(call):
    """But before there is anything; and what is left is followed as if nobody had asked."""
    counts = []
    for _ in range(6):  # what is kept from call to call is there after a few
        with Pressed(None) as whole:
            expected = call()
        counts.append(whole.count)
    places = np.linspace(1, min(counts) - 20, 9).astype(int)
    reached = cut = 0
    for number in places:
        with warnings.catch_warnings(record=True) as said, Pressed(number) as pressed:
            warnings.simplefilter("always")
            part = call()
        if pressed.count < number:  # it was shorter than the first time
            continue
        reached += 1
        assert re.search("interrupted|Ctrl-C", " ".join(str(one.message) for one in said))
        if "interrupted" in {stop.reason for stop in part.stops}:
            cut += 1
            part = part.extend(8 if call is family else 1000)
        if call is not family:
            names = [*part.free, *part.problem_state]
            np.testing.assert_array_equal(points_of(part, *names), points_of(expected, *names))
            assert [one.kind for one in part.special_points] == [
                one.kind for one in expected.special_points
            ]
    assert reached >= 7
    assert cut >= (1 if call is proved else 3)
    with Pressed(20, begun=True), pytest.raises(KeyboardInterrupt):
        call()


def test_the_second_ctrl_c_ends_at_once():
    """Where the first one waits for an end at which nothing is lost."""
    seen = []

    @interrupts.keeps
    def work():
        interrupts.hold()
        signal.raise_signal(signal.SIGINT)
        seen.append("went on")
        signal.raise_signal(signal.SIGINT)
        seen.append("never")

    with pytest.raises(KeyboardInterrupt):
        work()
    assert seen == ["went on"]


@pytest.mark.parametrize("depth", [1, 2])
def test_ctrl_c_as_a_call_begins_or_ends_leaves_nothing_of_it(depth):
    """Before and behind each function that it asks, as where the handler is set and put back."""
    call = work = interrupts.keeps(interrupts.hold)
    if depth == 2:
        call = interrupts.keeps(work)
    before, places = signal.getsignal(signal.SIGINT), []

    def press(frame, event, _):
        if work.__code__ in (frame.f_code, frame.f_back.f_code):
            places.append(event)
            if len(places) == number:
                sys.setprofile(None)
                signal.raise_signal(signal.SIGINT)

    try:
        for number in range(1, 99):
            signal.signal(signal.SIGINT, signal.default_int_handler)
            places.clear()
            sys.setprofile(press)
            with contextlib.suppress(KeyboardInterrupt), warnings.catch_warnings():
                warnings.simplefilter("ignore")
                call()
            sys.setprofile(None)
            assert interrupts._under_way() == []
            assert signal.getsignal(signal.SIGINT) is signal.default_int_handler
            if len(places) < number:
                break
    finally:
        signal.signal(signal.SIGINT, before)
    assert 20 < number < 98


def test_what_a_wish_ended_is_followed_from_there_behind_a_file(tmp_path, monkeypatch):
    """Ctrl-C came as its special points were looked for: its last state stands beyond them."""
    expected = ended()
    with monkeypatch.context() as change:
        change.setattr(CurveWalk, "search", lambda *_: signal.raise_signal(signal.SIGINT))
        with pytest.warns(RuntimeWarning, match="while special points were looked for"):
            part = ended()
    part.save(tmp_path / "part.nc")
    stored = pk.Branch.load(tmp_path / "part.nc")
    assert [stop.reason for stop in stored.stops] == ["start", "interrupted"]
    for one in (part.extend(1000), stored.extend(1000)):
        assert one.stops == expected.stops
        np.testing.assert_array_equal(points_of(one, "p", "x"), points_of(expected, "p", "x"))


@pytest.mark.parametrize("fails", [False, True])
def test_a_ctrl_c_that_another_package_swallows_is_not_lost(fails):
    @interrupts.keeps
    def work():
        interrupts.hold()
        try:
            with interrupts.may_end(), contextlib.suppress(ZeroDivisionError):
                ask()
        except KeyboardInterrupt:
            return "heard"
        return "lost"

    def ask():
        with interrupts.may_end():
            try:
                signal.raise_signal(signal.SIGINT)
            except KeyboardInterrupt:  # as where an object is thrown away
                _ = 1 / (not fails)

    before = signal.getsignal(signal.SIGINT)
    assert work() == "heard"
    assert signal.getsignal(signal.SIGINT) is before


TAKENS = pk.Problem(
    ["y", "mu + nu*x + x^2 - x*y"], ("x", "y"), {"mu": 0.0, "nu": 0.0},
    window={"x": (-3, 3), "y": (-3, 3)},
)  # fmt: skip
WHERE = {
    "equilibria": ("labelled.continuation.atlas_curves", "lies_on", 5, "curves are lost"),
    "an inner walk": ("bifurcation.continuation.walk", "hold", 9, "curves are lost"),
    "curves of cycles": ("cycles.trace", "advance", 9, "and n_cycles is -1 all over"),
    "cycles": ("labelled.continuation.atlas_cycles", "most_cycles", 1, "n_cycles is -1 all over"),
}


@pytest.mark.slow
@pytest.mark.parametrize("where", WHERE)
def test_ctrl_c_ends_an_atlas_and_says_what_is_lost(where, monkeypatch):
    module, name, number, says = WHERE[where]
    module = importlib.import_module(f"phasekit.{module}")
    function, calls = getattr(module, name), []

    def pressed(*args, **keywords):
        calls.append(name)
        if len(calls) == number:
            signal.raise_signal(signal.SIGINT)
        return function(*args, **keywords)

    monkeypatch.setattr(module, name, pressed)
    asked = {"span": {"mu": (-0.5, 0.5), "nu": (-1, 1)}, "cycles": True}
    if "lost" in says:
        with pytest.raises(KeyboardInterrupt, match=says):
            pk.atlas(TAKENS, "mu", "nu", **asked)
        assert number <= len(calls) < number + 40  # it did not go on
        return
    with pytest.warns(RuntimeWarning, match=says):
        found = pk.atlas(TAKENS, "mu", "nu", **asked)
    assert says in found.not_followed[-1]
    assert [curve.kind for curve in found.curves][:2] == ["fold", "hopf"]
    assert [point.label for point in found.special_points] == ["BT"]
    assert found.table("regions").n_equilibria.tolist().count(2) >= 1


@pytest.mark.slow
@pytest.mark.parametrize("call", [450])
def test_families_are_kept_and_go_on(call):
    f = Stopped(brusselator, 0)
    problem = pk.Problem(f, ("x", "y"), {"b": 1.5})
    hopf = pk.continuation(problem, "b", x0=[1.0, 1.5], span=(1.0, 2.5)).special("H")[0]
    options = pk.ContinuationOptions(intervals=12)
    whole = hopf.switch(options=options)
    f.left = call
    with pytest.warns(RuntimeWarning, match=r"interrupted.*extend\(\)"):
        part = hopf.switch(options=options)
    assert 1 <= len(part.path) <= len(whole.path)
    longer = part.extend()
    assert [stop.reason for stop in longer.stops] == [stop.reason for stop in whole.stops]
    np.testing.assert_array_equal(points_of(longer, "b", "period"), points_of(whole, "b", "period"))


def test_a_diagram_keeps_the_branches_that_it_has():
    def transcritical(x, mu):
        return [mu * x[0] - x[0] ** 2]

    f = Stopped(transcritical, 0)
    problem = pk.Problem(f, "x", {"mu": -1.0}, lambda x, mu: [[mu - 2.0 * x[0]]])
    whole = pk.diagram(problem, "mu", x0=[0.0], span=(-1.0, 0.5))
    assert len(whole) == 2
    f.left, calls = 0, -f.left
    first = pk.continuation(problem, "mu", x0=[0.0], span=(-1.0, 0.5))
    f.left = (calls - f.left) // 2  # in the second branch
    with pytest.warns(RuntimeWarning, match="interrupted"):
        part = pk.diagram(problem, "mu", x0=[0.0], span=(-1.0, 0.5))
    assert len(part) == 2
    np.testing.assert_array_equal(points_of(part[0], "mu"), points_of(first, "mu"))
    np.testing.assert_array_equal(points_of(part[1].extend(), "x"), points_of(whole[1], "x"))


@pytest.mark.parametrize("count", [1, 2, 3])
def test_a_branch_ends_at_the_point_of_a_number(count):
    """Folds of x' = mu - sin x, at mu = +-1 in turn."""
    problem = pk.Problem("mu - sin(x)", "x", {"mu": 0.0})
    options = pk.ContinuationOptions(directions="forward", max_step=0.3)
    asked = {"x0": [0.0], "span": (-2.0, 2.0), "options": options}
    branch = pk.continuation(problem, "mu", stop=("fold", count), **asked)
    folds = [0.5 * np.pi + np.pi * k for k in range(count)]
    np.testing.assert_allclose([p["x"] for p in branch.special("fold")], folds, atol=1e-9)
    assert branch.stops[1].reason == "fold"
    more = branch.extend()
    folds = [0.5 * np.pi + np.pi * k for k in range(2 * count)]
    np.testing.assert_allclose([p["x"] for p in more.special("fold")], folds, atol=1e-9)
    assert more.stops[1].reason == "fold"


def test_pairs_beside_names_and_wrong_numbers():
    problem = pk.Problem("mu - sin(x)", "x", {"mu": 0.0})
    asked = {"x0": [0.0], "span": (-2.0, 2.0)}
    options = pk.ContinuationOptions(directions="forward", max_step=0.3)
    branch = pk.continuation(
        problem, "mu", stop=[("fold", 3), "far"], events={"far": "x - 5"}, options=options, **asked
    )
    assert branch.stops[1].reason == "far"
    assert len(branch.special("fold")) == 2
    for wrong in (("fold", 0), ("fold", 1.5), ("fold", None), ("nothing", 2)):
        with pytest.raises(pk.ParameterError, match="stop"):
            pk.continuation(problem, "mu", stop=wrong, **asked)


def test_a_bound_that_is_moved_lets_a_branch_go_on():
    problem = pk.Problem(SWALLOW, "x", {"mu": -1.0, "l": 1.0})
    branch = pk.continuation(problem, "mu", x0=[-1.3], span=(-1.0, 0.3))
    assert [stop.reason for stop in branch.stops] == ["bound", "bound"]
    with pytest.raises(pk.ParameterError, match="wider span"):
        branch.extend()
    with pytest.raises(pk.ParameterError, match=r"span: .*a range that holds -1 to 0.3"):
        branch.extend(span=(-0.5, 0.5))
    longer = branch.extend(span=(-1.0, 2.0))
    assert longer.points.mu.values[-1] == 2.0
    assert longer.points.mu.values[0] == -1.0
    mu = 2.0 / 27.0**0.5
    np.testing.assert_allclose([p["mu"] for p in longer.special("fold")], [mu, -mu], atol=1e-12)
    count = len(branch.points.point) - 1
    np.testing.assert_array_equal(
        points_of(longer, "x")[:, :count], points_of(branch, "x")[:, :count]
    )
    options = pk.ContinuationOptions(bounds={"x": (-2.0, 0.0)})
    short = pk.continuation(problem, "mu", x0=[-1.3], span=(-1.0, 0.9), options=options)
    assert short.points.x.values[-1] == 0.0
    assert short.extend(bounds={"x": (-2.0, 5.0)}).points.mu.values[-1] == 0.9
    with pytest.raises(pk.ParameterError, match="state or parameter"):
        short.extend(bounds={"y": (-2.0, 5.0)})


def test_a_bound_of_a_family_is_moved():
    problem = pk.Problem(["y", "mu*(1 - x**2)*y - x"], ("x", "y"), {"mu": 1.0})
    orbit = pk.periodic_orbit(problem, [2.0, 0.0])
    branch = pk.continuation(problem, "mu", orbit=orbit, span=(0.8, 1.2))
    longer = branch.extend(span=(0.8, 1.5))
    assert longer.points.mu.values[-1] == 1.5
    assert longer.points.mu.values[0] == 0.8
    far = pk.continuation(problem, "mu", orbit=orbit, span=(0.8, 1.5))
    np.testing.assert_allclose(longer.points.period[-1], far.points.period[-1], rtol=1e-9)


@pytest.mark.parametrize("raised", [ValueError, KeyError, RuntimeError, AssertionError])
def test_a_function_may_raise_whatever_it_wants_where_it_has_no_value(raised):
    def f(x, p):
        if x[0] < 0.2:
            raise raised("too low")
        return [p - x[0]]

    problem = pk.Problem(f, "x", {"p": 1.0})
    branch = pk.continuation(problem, "p", x0=[1.0], span=(-1.0, 2.0))
    assert branch.stops[0].reason == "not_finite"
    assert f"it raised {raised.__name__}: " in branch.stops[0].message
    assert "too low" in branch.stops[0].message
    assert branch.points.x.values[0] == pytest.approx(0.2, abs=1e-4)
    assert branch.points.x.values[-1] == 2.0
    with pytest.raises((pk.ParameterError, pk.ConvergenceError), match="too low"):
        pk.continuation(problem, "p", x0=[0.1], span=(-1.0, 2.0))


def test_events_and_records_may_raise_as_well():
    def q(x, p):
        if p < 0.5:
            raise KeyError("q")
        return p - 0.7

    problem = pk.Problem(lambda x, p: [p - x[0]], "x", {"p": 1.0})
    branch = pk.continuation(problem, "p", x0=[1.0], span=(0.0, 2.0), events={"q": q})
    assert [round(p["p"], 12) for p in branch.special("q")] == [0.7]
    with pytest.warns(RuntimeWarning, match=r"record\['q'\]: raised KeyError at \d+ of \d+ points"):
        branch = pk.continuation(problem, "p", x0=[1.0], span=(0.0, 2.0), record={"q": q})
    p = branch.points.p.values
    np.testing.assert_array_equal(np.isnan(branch.points.q.values), p < 0.5)
    np.testing.assert_array_equal(branch.points.q.values[p >= 0.5], p[p >= 0.5] - 0.7)


@pytest.mark.slow
def test_cycles_whose_function_raises():
    def ring(x, mu):
        r = x[0] ** 2 + x[1] ** 2
        if r > 0.3:
            raise RuntimeError("too far")
        return [mu * x[0] - x[1] - x[0] * r, x[0] + mu * x[1] - x[1] * r]

    problem = pk.Problem(ring, ("x", "y"), {"mu": -0.5})
    hopf = pk.continuation(problem, "mu", x0=[0.0, 0.0], span=(-1.0, 1.0)).special("H")[0]
    cycles = hopf.switch(options=pk.ContinuationOptions(intervals=12))
    assert cycles.points.mu.values[-1] == pytest.approx(0.3, abs=0.01)
    assert "it raised RuntimeError: too far" in cycles.stops[1].message
    with pytest.raises(pk.ConvergenceError, match="x0"):
        pk.periodic_orbit(problem.replace(mu=0.2), [3.0, 0.0])


EDGES = {
    "sqrt": (lambda x, p: [p - np.sqrt(x[0])], 1.0, 1.0, lambda p: p**2, 0.0),
    "log": (lambda x, p: [p - np.log(x[0])], 1.0, 0.0, np.exp, -30.0),
    "beyond": (lambda x, p: [p - np.sqrt(1.0 - x[0])], 0.0, 1.0, lambda p: 1.0 - p**2, 0.0),
    "small": (lambda x, p: [p - np.log(1e9 * x[0])], 1e-9, 0.0, lambda p: 1e-9 * np.exp(p), -30.0),
    "both": (lambda x, p: [p - np.arcsin(x[0])], 0.0, 0.0, np.sin, -0.5 * np.pi),
}


@pytest.mark.parametrize("compiled", [False, pytest.param(True, marks=pytest.mark.slow)])
@pytest.mark.parametrize("name", EDGES)
def test_branches_reach_the_edge_of_a_domain(name, compiled):
    """Differences take shorter steps there: no step is in units that the edge knows nothing of."""
    f, x0, p0, exact, end = EDGES[name]
    if compiled:
        numba = pytest.importorskip("numba")
        body = numba.njit(f)
        f = numba.njit(lambda x, p: np.array(body(x, p)))
    with np.errstate(all="ignore"):
        branch = pk.continuation(
            pk.Problem(f, "x", {"p": p0}), "p", x0=[x0], span=(-30.0, p0 + 0.5)
        )
    p, x = branch.points.p.values, branch.points.x.values
    assert 20 < len(p) < 400
    assert p[0] == pytest.approx(end, abs=1e-4)
    np.testing.assert_allclose(x, exact(p), rtol=1e-9, atol=1e-9 * abs(x0 - exact(end)))
    assert branch.stops[0].reason in ("bound", "not_finite"), branch.stops[0].message


@pytest.mark.slow
@pytest.mark.parametrize(
    ("f", "kept"),
    [
        (["-k*x + y", "k*x - y", "0*k - z"], "x + y"),
        (["-k*x**2 + y", "2*(k*x**2 - y)", "-z"], "x + 0.5*y"),
        (["k*z*x - y", "1 - y*k", "k*z*x - y"], "x - z"),
        (["-k*x*y", "k*x*y - 3*y", "3*y"], "x + y + z"),
    ],
)
def test_what_f_conserves_is_named(f, kept):
    names = ("x", "y", "z")
    start = {"x - z": [1.0, 1.0, 1.0], "x + y + z": [1.0, 0.0, 0.3]}.get(kept, [1.0, 1.0, 0.0])
    branch = pk.continuation(pk.Problem(f, names, {"k": 1.0}), "k", x0=start, span=(0.1, 3.0))
    assert {stop.reason for stop in branch.stops} == {"stuck"}
    assert f"f conserves {kept}: " in branch.stops[1].message


def test_a_state_without_a_limit_is_no_bound_of_the_users():
    problem = pk.Problem("p*x - 1", "x", {"p": 1.0})
    branch = pk.continuation(problem, "p", x0=[1.0], span=(-1.0, 2.0))
    assert "grows without end" in branch.stops[0].message
    assert "its upper bound" not in branch.stops[0].message
    options = pk.ContinuationOptions(bounds={"x": (-5.0, 5.0)})
    branch = pk.continuation(problem, "p", x0=[1.0], span=(-1.0, 2.0), options=options)
    assert branch.stops[0].message == "x met its upper bound 5"


@pytest.mark.slow
def test_families_are_what_was_saved(tmp_path):
    problem = pk.Problem(["1 - (b + 1)*x + x**2*y", "b*x - x**2*y"], ("x", "y"), {"b": 1.5})
    hopf = pk.continuation(problem, "b", x0=[1.0, 1.5], span=(1, 3)).special("H")[0]
    cycles = hopf.switch()
    longer = cycles.extend(span=(1.0, 3.5))
    for branch, end in ((cycles, "nc"), (longer, "zarr")):
        branch.save(tmp_path / f"branch.{end}")
        assert pk.Branch.load(tmp_path / f"branch.{end}") == branch
    assert cycles != longer


def test_a_doubled_orbit_that_is_whole_does_not_go_on():
    """It ends where its two points meet again: beyond, it would run back along the other one."""
    problem = pk.Problem("-(1.5 - r**2)*x + x**3", "x", {"r": -1.2}, map=True)
    fixed = pk.continuation(problem, "r", x0=[0.0], span=(-1.3, 1.3))
    two = fixed.special("PD")[0].switch()
    assert "another period doubling" in two.stops[1].message
    with pytest.raises(pk.ParameterError, match="extend"):
        two.extend()


def test_curves_in_two_parameters_go_on():
    problem = pk.Problem(SWALLOW, "x", {"mu": -1.0, "l": 1.0})
    fold = pk.continuation(problem, "mu", x0=[-1.3], span=(-1.0, 1.0)).special("LP")[0]
    curve = fold.curve("l", (-1.0, 2.0))
    with pytest.raises(pk.ParameterError, match="other reasons"):
        curve.extend()
    with pytest.raises(pk.ParameterError, match="bounds= of mu and l"):
        curve.extend(span=(-1.0, 3.0))
    longer = curve.extend(bounds={"l": (-1.0, 3.0)})
    mu, l = points_of(longer, "mu", "l")  # noqa: E741
    assert l.max() == 3.0
    assert [point.kind for point in longer.special_points] == ["end", "cusp", "end"]
    np.testing.assert_allclose(27.0 * mu**2, 4.0 * l**3, atol=1e-9)


@pytest.mark.slow
@pytest.mark.parametrize("part", [0.2, 0.5, 0.8])
def test_interrupted_curves_in_two_parameters_go_on(part):
    f = Stopped(cusp, 0)
    problem = pk.Problem(f, "x", {"mu": -1.0, "l": 1.0})
    fold = pk.continuation(problem, "mu", x0=[-1.3], span=(-1.0, 1.0)).special("LP")[0]
    f.left = 0
    whole = fold.curve("l", (-1.0, 2.0))
    f.left = int(-part * f.left)
    with pytest.warns(RuntimeWarning, match="interrupted"):
        cut = fold.curve("l", (-1.0, 2.0))
    f.left = 0
    np.testing.assert_array_equal(points_of(cut.extend(), "mu", "l"), points_of(whole, "mu", "l"))


def test_a_key_behind_the_walk_costs_nothing():
    """Residuals at the ends, and what is recorded, are asked for when all points are there."""
    f = Stopped(lambda x, mu: [mu * x[0] - x[0] ** 3 + 0.1], 0)
    problem, asked = pk.Problem(f, "x", {"mu": -1.0}), {"x0": [-0.1], "span": (-1.2, 1.0)}
    whole = pk.continuation(problem, "mu", **asked)
    calls = -f.left
    for left in (1, 5, 16, 40):
        f.left = calls - left
        with pytest.warns(RuntimeWarning, match="interrupted"):
            part = pk.continuation(problem, "mu", **asked)
        np.testing.assert_array_equal(points_of(part.extend(), "mu"), points_of(whole, "mu"))
    f.left = 0
    record = {"q": Stopped(lambda x, mu: x[0] + mu, 4)}
    with pytest.warns(RuntimeWarning, match="interrupted"):
        part = pk.continuation(problem, "mu", record=record, **asked)
    np.testing.assert_array_equal(points_of(part, "mu", "x"), points_of(whole, "mu", "x"))
    np.testing.assert_array_equal(part.points.q, part.points.x + part.points.mu)


@pytest.mark.slow
@pytest.mark.parametrize("part", [0.2, 0.5, 0.8, 0.99])
def test_a_diagram_keeps_its_branches_whenever_a_key_comes(part):
    f = Stopped(lambda x, mu: [x[0] * (mu - x[0])], 0)
    problem = pk.Problem(f, "x", {"mu": -1.0}, lambda x, mu: [[mu - 2.0 * x[0]]])
    asked = {"x0": [[0.0], [-1.0]], "span": (-1.0, 0.5)}
    pk.diagram(problem, "mu", **asked)
    f.left = int(-part * f.left)
    with pytest.warns(RuntimeWarning, match="interrupted"):
        kept = pk.diagram(problem, "mu", **asked)
    assert kept
    for branch in kept:
        x, mu = points_of(branch, "x", "mu")
        np.testing.assert_allclose(x * (mu - x), 0.0, atol=1e-9)


@pytest.mark.parametrize("kind", ["LP", "H"])
@pytest.mark.parametrize("points", [4, 2000])
def test_curves_in_two_parameters_go_on_behind_bounds(kind, points):
    """Folds l = 3 x^2, mu = -2 x^3; Hopf points mu = l^2."""
    formulas = {
        "LP": ["mu + l*x - x**3"],
        "H": [
            "(mu - l**2)*x - y - x*(x**2 + y**2)",
            "x + (mu - l**2)*y - y*(x**2 + y**2)",
        ],
    }[kind]
    names = ("x", "y")[: len(formulas)]
    problem = pk.Problem(formulas, names, {"mu": -1.0, "l": 1.0})
    x0 = [-1.3] if kind == "LP" else [0.0, 0.0]
    point = pk.continuation(problem, "mu", x0=x0, span=(-1.0, 2.0)).special(kind)[0]
    options = pk.ContinuationOptions(max_points=points, directions="forward")
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", RuntimeWarning)
        curve = point.curve("l", (0.5, 1.5), options=options)
        longer = curve.extend(2000, bounds={"l": (0.5, 1.8)})
    assert longer.points.l.values[-1] == 1.8
    assert len(longer.points.point) > len(curve.points.point)
    mu, l, x = points_of(longer, "mu", "l", "x")  # noqa: E741
    np.testing.assert_allclose(mu, -2.0 * x**3 if kind == "LP" else l**2, atol=1e-9)
    np.testing.assert_allclose(l, 3.0 * x**2 if kind == "LP" else l, atol=1e-9)
    with pytest.raises(pk.ParameterError, match="bound"):
        longer.extend()


def test_an_end_tells_of_no_exception_that_came_elsewhere():
    def f(x, p):
        if x[0] > 3.0:
            raise ValueError("far")
        return [np.nan if p < 0.5 else p - x[0]]

    problem = pk.Problem(f, "x", {"p": 1.0})
    branch = pk.continuation(problem, "p", x0=[1.0], span=(0.0, 4.0))
    assert [stop.reason for stop in branch.stops] == ["not_finite", "not_finite"]
    assert "raised" not in branch.stops[0].message
    assert branch.stops[1].message.endswith(": it raised ValueError: far")
    with pytest.raises(pk.ConvergenceError, match="not finite") as caught:
        pk.continuation(problem.replace(p=0.4), "p", x0=[1.0], span=(0.0, 4.0))
    assert "raised" not in str(caught.value)


def test_an_interrupt_where_no_family_is_followed_keeps_what_was(monkeypatch):
    def stopped(point, *_, **__):
        raise KeyboardInterrupt

    normal = pk.Problem(
        ["a*x - y - x*(x^2 + y^2)", "x + a*y - y*(x^2 + y^2)"], ("x", "y"), {"a": -0.5}
    )
    monkeypatch.setattr("phasekit.labelled.continuation.diagram._switched", stopped)
    with pytest.warns(RuntimeWarning, match="interrupted behind 1 branches and 0 families"):
        (branch,) = pk.diagram(normal, "a", x0=[0, 0], span=(-1, 1))
    assert len(branch.special("hopf")) == 1
