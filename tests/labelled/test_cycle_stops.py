"""Families of periodic orbits that end where they are told to, and events on their curves."""

from __future__ import annotations

import pickle

import numpy as np
import pytest

import phasekit as pk

#: Radius sqrt(l), period 2 pi/(1 + l).
TURNING = pk.Problem(
    ["x*(l - x**2 - y**2) - y*(1 + x**2 + y**2)", "y*(l - x**2 - y**2) + x*(1 + x**2 + y**2)"],
    ("x", "y"), {"l": 0.5},
)  # fmt: skip
#: Squares of radii with p1 + p2 r - r^2 = 0: they fold at p1 = -p2^2/4, r = p2/2.
RATE = "(p1 + p2*(x**2 + y**2) - (x**2 + y**2)**2)"
FOLDING = pk.Problem(
    [f"x*{RATE} - 2*y", f"y*{RATE} + 2*x"], ("x", "y"), {"p1": -0.1, "p2": 1.0}
)  # fmt: skip
ORBIT = {
    "turning": lambda: pk.periodic_orbit(TURNING, [0.7, 0.0]),
    "folding": lambda: pk.periodic_orbit(FOLDING, [0.9, 0.0]),
}


def beyond(x, l):  # noqa: E741
    return l > 1.3


def level(x, l, period):  # noqa: E741
    return period - np.pi


def turning(stop, **more):
    more = {"events": {"wide": "l - 0.81", "low": "l - 0.25"}} | more
    return pk.continuation(
        TURNING, "l", orbit=ORBIT["turning"](), span=(0.1, 2.0), stop=stop, **more
    )


@pytest.mark.parametrize(
    ("stop", "reasons", "ends"),
    [
        ("wide", ("bound", "wide"), (0.1, 0.81)),
        (["low", "wide"], ("low", "wide"), (0.25, 0.81)),
        ("UZ", ("UZ", "UZ"), (0.25, 0.81)),
        (level, ("bound", "level"), (0.1, 1.0)),
        (beyond, ("bound", "beyond"), (0.1, 1.3)),
        (["low", beyond], ("low", "beyond"), (0.25, 1.3)),
        ("LPC", ("bound", "bound"), (0.1, 2.0)),
    ],
)
def test_families_end_where_they_are_to(stop, reasons, ends):
    branch = turning(stop)
    assert tuple(one.reason for one in branch.stops) == reasons
    points = branch.points
    assert np.allclose(points.l[[0, -1]], ends, atol=1e-13)
    assert points.sizes["point"] > 3
    assert np.all(np.diff(points.l) > 0.0)
    for side, reason in zip((0, -1), reasons, strict=True):
        assert branch.special_points[side].kind == "end"
        assert branch.special_points[side].index % points.sizes["point"] == (
            side % points.sizes["point"]
        )
        assert str(points.special[side].values) == ("EP" if reason == "bound" else "UZ")
        assert reason == "bound" or repr(reason) in branch.stops[side].message
    assert [s.index for s in branch.special_points] == sorted(
        s.index for s in branch.special_points
    )
    if "bound" not in reasons:
        longer = branch.extend()
        assert [one.reason for one in longer.stops] == ["bound", "bound"]
        whole = turning(None)
        for name in ("l", "period"):
            values = (one.points[name].values[one.points.special == ""] for one in (longer, whole))
            np.testing.assert_array_equal(*values)


@pytest.mark.parametrize("stop", ["LPC", "fold_of_cycles", ["torus", "LPC"]])
def test_families_end_at_special_points(stop):
    branch = pk.continuation(FOLDING, "p1", orbit=ORBIT["folding"](), span=(-0.4, 0.2), stop=stop)
    reasons = {one.reason for one in branch.stops}
    name = stop if isinstance(stop, str) else "LPC"
    assert reasons == {"bound", name}
    side = -1 if branch.stops[1].reason == name else 0
    assert float(branch.points.p1[side]) == pytest.approx(-0.25, abs=1e-14)
    assert str(branch.points.special[side].values) == "LPC"
    (fold,) = branch.special("LPC")
    assert fold.index % branch.points.sizes["point"] == side % branch.points.sizes["point"]
    # One that begins there goes on.
    here = FOLDING.replace(p1=fold["p1"])
    again = pk.continuation(here, "p1", orbit=fold.orbit, span=(-0.4, 0.2), stop=stop)
    assert {one.reason for one in again.stops} <= {"bound", "hopf"}


def test_families_with_stops_are_kept(tmp_path):
    branch = turning(["low", beyond])
    again = pickle.loads(pickle.dumps(branch))
    assert again.points.identical(branch.points)
    options = pk.ContinuationOptions(max_points=3)
    short = turning(["low", beyond], options=options)
    assert {one.reason for one in short.stops} == {"max_points"}
    assert short.extend(500).points.identical(branch.points)
    branch.save(tmp_path / "branch.nc")
    with pytest.raises(pk.ParameterError, match="events: the branch looks for beyond"):
        pk.Branch.load(tmp_path / "branch.nc")
    loaded = pk.Branch.load(tmp_path / "branch.nc", events={"beyond": beyond})
    assert loaded.points.identical(branch.points)
    assert loaded.stops == branch.stops
    assert [s.name for s in loaded.special_points] == [s.name for s in branch.special_points]


def test_events_on_curves_in_two_parameters():
    events = {"level": "p2 - 6/5", "wide": "x_max - 4/5", "own": own}
    branch = pk.continuation(
        FOLDING, "p1", orbit=ORBIT["folding"](), span=(-0.4, 0.2), events=events, stop="LPC"
    )
    (fold,) = branch.special("LPC")
    curve = fold.curve("p2", (0.5, 1.5))
    places = {"level": 1.2, "wide": 1.28, "own": 0.9}
    found = curve.special("UZ")
    assert sorted(one.name for one in found) == sorted(places)
    for one in found:
        rough = 1e-8 if one.name == "wide" else 1e-12
        assert abs(one["p2"] - places[one.name]) < rough
        assert abs(one["p1"] + one["p2"] ** 2 / 4) < 1e-12
        assert str(curve.points.special[one.index].values) == "UZ"
    assert [stop.reason for stop in curve.stops] == ["bound", "bound"]  # stops are the family's


def own(x, p1, p2):
    return p2 - 0.9 + 0.0 * x[0, 0]


def test_a_family_of_one_period_ends_at_events_alone():
    form = pk.Problem(
        ["x*(l - x**2 - y**2) - y*(k + x**2 + y**2)", "y*(l - x**2 - y**2) + x*(k + x**2 + y**2)"],
        ("x", "y"), {"l": 0.5, "k": 1.0},
    )  # fmt: skip
    orbit = pk.periodic_orbit(form, [0.7, 0.0])
    more = {"orbit": orbit, "span": (0.3, 0.9), "fix": "period", "events": {"slow": "k - 4/5"}}
    branch = pk.continuation(form, ("l", "k"), stop="slow", **more)
    # k + l keeps its value.
    assert "slow" in [one.reason for one in branch.stops]
    (slow,) = branch.special("slow")
    assert slow["l"] == pytest.approx(0.7, abs=1e-12)
    with pytest.raises(pk.ParameterError, match="'LPC' is unknown"):
        pk.continuation(form, ("l", "k"), stop="LPC", **more)


@pytest.mark.parametrize(
    ("stop", "words"),
    [
        ("nothing", "stop: event or special point 'nothing' is unknown"),
        ("hopf", "'hopf' is unknown"),
        (3, "stop: got 3"),
        ([], r"stop: got \[\]"),
        (lambda x: 1.0, "stop"),
        (lambda x, **p: x[0], "stop: failed at the first orbit"),
    ],
)
def test_stops_that_are_refused(stop, words):
    with pytest.raises(pk.ParameterError, match=words):
        turning(stop)


def test_events_that_say_yes_or_no_are_no_events():
    with pytest.raises(pk.ParameterError, match="yes or no"):
        turning(None, events={"beyond": beyond})
