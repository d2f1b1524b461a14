"""Branches of a continuation are drawn as the smooth curves that they are."""

import types

import numpy as np
import pytest
import xarray as xr

import phasekit as pk
from phasekit.plot.branch import _looks, smooth

CUBIC = pk.Problem("mu + x - x**3", state="x", parameters={"mu": -1.0})
CIRCLE = pk.Problem("x**2 + mu**2 - 1", state="x", parameters={"mu": 0.0})
COARSE = pk.ContinuationOptions(max_step=0.3)


def corners(ax):
    """The angles (degrees) by which lines turn from one segment to the next, on the page."""
    found = []
    ax.figure.draw_without_rendering()  # its layout is made when it is drawn
    for line in ax.lines:
        x, y = ax.transData.transform(np.column_stack(line.get_data())).T
        if line.get_linestyle() != "None":
            way = np.diff(x) + 1j * np.diff(y)
            way = way[np.abs(way) > 0.5]  # what is shorter than a pixel is no corner
            found.append(np.degrees(np.angle(way[1:] / way[:-1])))
    return np.abs(np.concatenate(found))


@pytest.mark.parametrize(
    ("problem", "start", "residual"),
    [
        (CUBIC, -1.3, lambda mu, x: mu + x - x**3),
        (CIRCLE, 1.0, lambda mu, x: x**2 + mu**2 - 1.0),
    ],
)
def test_a_coarse_branch_is_smooth_at_its_folds(problem, start, residual):
    branch = pk.continuation(problem, "mu", x0=[start], span=(-2.0, 2.0), options=COARSE)
    assert len(branch.special("LP")) == 2
    ax = branch.plot()
    known = branch.points.sizes["point"]
    drawn = [line.get_data() for line in ax.lines if line.get_linestyle() != "None"]
    mu, x = np.concatenate([np.array(one) for one in drawn], axis=1)
    assert mu.size > 2 * known
    turned = corners(ax)
    assert turned.size > 50
    assert turned.max() < 8.0
    assert np.abs(residual(mu, x)).max() < 5e-3


def test_points_of_the_branch_are_kept():
    branch = pk.continuation(CUBIC, "mu", x0=[-1.3], span=(-2.0, 2.0), options=COARSE)
    drawn = np.concatenate([np.array(line.get_data()) for line in branch.plot().lines], axis=1).T
    known = np.column_stack([branch.points.mu.values, branch.points.x.values])
    assert len(known) > 10
    for point in known:
        assert np.abs(drawn - point).sum(axis=1).min() < 1e-14


def test_what_has_no_tangent_stays_as_it_is():
    branch = pk.continuation(
        CUBIC, "mu", x0=[-1.3], span=(-2.0, 2.0), record={"twice": lambda x, mu: 2.0 * x[0]}
    )
    ax = branch.plot(y="twice")
    drawn = [line.get_ydata().size for line in ax.lines if line.get_linestyle() != "None"]
    # Lines share the points where they change their look.
    assert sum(drawn) == branch.points.sizes["point"] + len(drawn) - 1


def test_slopes_that_contradict_the_points_are_left_out():
    x, s = np.array([0.0, 1.0]), np.array([0.0, 1.0])
    wild = np.array([50.0, -50.0])
    np.testing.assert_array_equal(smooth(x, x, s, wild, wild), (x, x))
    across, up = smooth(x, x**2, s, np.ones(2), np.array([0.0, 2.0]))
    assert across.size > 5
    np.testing.assert_allclose(up, across**2, atol=1e-14)
    np.testing.assert_array_equal(smooth(x[:0], x[:0], s[:0], x[:0], x[:0]), (x[:0], x[:0]))


def test_names_of_points_that_touch_are_one():
    system = pk.Coefficients(1.0, 0.5, 0.0)
    ax = pk.plot.branch(pk.diagram(system, "B", span=(0.1, 2.0)))
    texts = [text.get_text() for text in ax.texts]
    assert "BP" in texts
    assert len(texts) == len(set(texts))


def test_events_are_called_by_their_names():
    branch = pk.continuation(
        CUBIC, "mu", x0=[-1.3], span=(-2.0, 2.0), events={"half": "x - 1/2", "top": "x - 9/8"}
    )
    assert [one.name for one in branch.special("event")] == ["half", "top"]
    ax = branch.plot()
    assert {"half", "top", "LP"} <= {text.get_text() for text in ax.texts}
    shown = [text.get_text() for text in ax.get_legend().get_texts()]
    assert {"half", "top"} <= set(shown)


def test_what_could_not_be_counted_is_drawn_as_unknown():
    """Neither as stable nor as unstable; of rests and of cycles, whatever lies beside."""
    hopf = pk.Problem(
        {"x": "m*x - y - x*(x^2 + y^2)", "y": "x + m*y - y*(x^2 + y^2)"}, parameters={"m": -0.5}
    )
    few = pk.ContinuationOptions(max_points=5)
    rest = pk.continuation(hopf, "m", x0=[0.0, 0.0], span=(-1.0, 1.0))
    cycles = rest.special("H")[0].switch(options=few)
    for branch, word in ((rest, "stability unknown"), (cycles, "cycle, stability unknown")):
        known = {text.get_text() for text in branch.plot().get_legend().get_texts()}
        counts = branch._points["n_unstable"]
        counts = counts.copy(data=np.where(np.arange(counts.size) == 3, -1, counts.values))
        object.__setattr__(branch, "_points", branch._points.assign(n_unstable=counts))
        ax = branch.plot()
        labels = {text.get_text().removesuffix(", max and min") for text in ax.get_legend().texts}
        assert word in labels
        assert {text.removesuffix(", max and min") for text in known} <= labels
        gray = [line for line in ax.lines if line.get_color() == "#6E6E6E"]
        assert gray
        assert {tuple(line.get_xdata()[[0, -1]]) for line in gray} == {
            tuple(branch.points.m.values[3:5])
        }


@pytest.mark.parametrize(
    ("counts", "labels"),
    [
        ([-1, 0, 0, 1, -1], ["stable", "stable", "stable", "unstable", "unstable"]),
        ([0, -1, 1], ["stable", "stability unknown", "unstable"]),
        ([-1], ["stability unknown"]),
    ],
)
def test_an_end_at_a_bifurcation_looks_as_what_is_beside_it(counts, labels):
    points = xr.Dataset({"n_unstable": ("point", counts)})
    branch = types.SimpleNamespace(points=points, kind="equilibrium", stops=())
    assert [look["label"] for look in _looks(branch)] == labels
