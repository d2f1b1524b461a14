"""Events along families of periodic orbits: zeros of numbers of whole orbits, at exact places."""

from __future__ import annotations

import pickle

import matplotlib
import numpy as np
import pytest

import phasekit as pk
from phasekit.errors import ParameterError

RATE = "(p + x**2 + y**2 - (x**2 + y**2)**2)"
FORM = pk.Problem(
    [f"x*{RATE} - 2*y", f"y*{RATE} + 2*x"], ("x", "y"), {"p": -0.1}
)  # fmt: skip
TURNING = pk.Problem(
    ["x*(l - x**2 - y**2) - y*(1 + x**2 + y**2)", "y*(l - x**2 - y**2) + x*(1 + x**2 + y**2)"],
    ("x", "y"), {"l": 0.5},
)  # fmt: skip


def peak(x, l):  # noqa: E741
    return x[0, 0] ** 2 + x[1, 0] ** 2 - 0.49


def own(x, l, period):  # noqa: E741
    return period * (1 + l) - 2 * np.pi + l - 1.5


def family(events, **more):
    orbit = pk.periodic_orbit(TURNING, [0.7, 0.0])
    return pk.continuation(TURNING, "l", orbit=orbit, span=(0.1, 2.0), events=events, **more)


def test_events_lie_where_they_must():
    branch = family(
        {"level": "l - 0.81", "long": "period - pi", "wide": "x_max - 1.2", "mean": "x_min + l",
         "own": own}
    )  # fmt: skip
    # The amplitude is sqrt(l), the period 2 pi/(1 + l).
    places = {"level": 0.81, "long": 1.0, "wide": 1.44, "mean": 1.0, "own": 1.5}
    found = branch.special("UZ")
    assert {one.name: one.label for one in found} == dict.fromkeys(places, "UZ")
    assert len(found) == len(places)
    for one in found:
        assert one.status == "converged"
        assert one.corank == 0
        rough = 1e-8 if one.name in ("wide", "mean") else 1e-13  # extremes lie between places
        assert abs(one["l"] - places[one.name]) < rough, one.name
        low, high = one.interval
        assert low <= one["l"] <= high
        assert str(branch.points.special.values[one.index]) == "UZ"
        assert int(branch.points.n_unstable[one.index]) == 0
    assert branch.special("level")[0].orbit.period == branch.special("level")[0].period
    assert [one.kind for one in branch.special_points].count("end") == 2
    assert set(branch.to_dataset().special_name.values) == {"", *places}


def test_an_event_on_both_sides_of_a_fold():
    # r = R^2: p = r^2 - r, so p = -0.2499 at r = (1 -+ 0.02)/2, next to the fold at -1/4.
    orbit = pk.periodic_orbit(FORM, [0.9, 0.0])
    branch = pk.continuation(
        FORM, "p", orbit=orbit, span=(-0.4, 0.2), events={"near": "p + 0.2499"}
    )
    assert len(branch.special("LPC")) == 1
    one, two = branch.special("near")
    kinds = [s.label for s in branch.special_points if s.kind != "end"]
    assert kinds == ["UZ", "LPC", "UZ"]
    r = np.sort([float(s.orbit.x_max) ** 2 for s in (one, two)])
    np.testing.assert_allclose(r, [0.49, 0.51], atol=1e-6)
    assert abs(one["p"] + 0.2499) < 1e-14


def test_events_are_kept_by_all_that_goes_on(tmp_path):
    branch = family({"level": "l - 0.81", "peak": peak}, options=pk.ContinuationOptions(
        max_points=2, max_step=0.05))  # fmt: skip
    longer = branch.extend(30)
    assert len(longer.special("UZ")) == 2 > len(branch.special("UZ"))
    assert abs(longer.special("peak")[0]["l"] - 0.49) < 1e-6
    copy = pickle.loads(pickle.dumps(longer))
    longer.save(tmp_path / "branch.nc")
    with pytest.raises(ParameterError, match="events: the branch looks for peak by functions"):
        pk.Branch.load(tmp_path / "branch.nc")
    again = pk.Branch.load(tmp_path / "branch.nc", events={"peak": peak})
    for other in (copy, again):
        assert [one.name for one in other.special("UZ")] == ["peak", "level"]
        assert other.points.identical(longer.points)
    assert again.special("level")[0]["l"] == longer.special("level")[0]["l"]
    matplotlib.use("Agg")
    ax = pk.plot.branch(longer)
    assert "level" in " ".join(text.get_text() for text in ax.figure.findobj(matplotlib.text.Text))


def test_events_hold_on_doubled_orbits():
    flow = pk.Problem(
        ["-y - z", "x + 0.2*y", "0.2 + z*(x - c)"], ("x", "y", "z"), {"c": 2.5}
    )  # fmt: skip
    orbit = pk.periodic_orbit(flow, [2.0, 2.0, 0.03], settle=100.0)
    first = pk.continuation(flow, "c", orbit=orbit, span=(2.5, 3.2), events={"three": "c - 3"})
    (doubling,) = first.special("PD")
    second = doubling.switch()
    (three,) = second.special("three")
    assert abs(three["c"] - 3.0) < 1e-13
    assert second.points.period.min() > 11.0


@pytest.mark.parametrize(
    ("events", "words"),
    [
        ({"a": "x - 1"}, "x_max"),
        ({"a": "3"}, "depends on the orbit"),
        ({"a": lambda x, **p: x[0]}, "one number"),
        ({"a": lambda x, **p: None}, "one number"),
        ({"a": lambda x: 1.0}, "events"),
        ({"PD": "l - 1"}, "no kind or label"),
        ({"a": 3}, "a formula, or a function"),
        (["a"], "mapping"),
    ],
)
def test_bad_events(events, words):
    with pytest.raises(ParameterError, match="events") as caught:
        family(events)
    assert words in str(caught.value)


def test_events_of_conservative_families():
    swing = pk.Problem(
        ["v", "-k*sin(x)"], ("x", "v"), {"k": 1.0}, conservative=True
    )  # fmt: skip
    orbit = pk.periodic_orbit(swing, [1.0, 0.0])
    branch = pk.continuation(
        swing, "period", orbit=orbit, span=(6.3, 9.0), events={"wide": "x_max - 2"}
    )
    (wide,) = branch.special("wide")
    from scipy.special import ellipk

    assert abs(wide.period - 4.0 * ellipk(np.sin(1.0) ** 2)) < 1e-8
