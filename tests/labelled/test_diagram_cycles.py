"""Diagrams with the periodic orbits that begin on them."""

from __future__ import annotations

import warnings

import numpy as np
import pytest

import phasekit as pk
from phasekit.labelled.continuation.all_equilibria import equilibria_at, equilibria_near

#: r' = mu r + b r^3 - r^5: cycles from mu = 0 to a fold at mu = -1/4 and back.
QUINTIC = pk.Problem(
    [
        "(mu + (x*x + y*y) - (x*x + y*y)**2)*x - 2*y",
        "(mu + (x*x + y*y) - (x*x + y*y)**2)*y + 2*x",
    ],
    ("x", "y"), {"mu": -0.5},
)  # fmt: skip


def test_cycles_of_a_hopf_point_follow_the_equilibria():
    rest, cycles = pk.diagram(QUINTIC, "mu", x0=[0.0, 0.0], span=(-0.5, 0.3))
    assert [point.label for point in rest.special_points] == ["EP", "H", "EP"]
    (fold,) = cycles.special("LPC")
    assert fold["mu"] == pytest.approx(-0.25, abs=1e-9)
    assert len(pk.diagram(QUINTIC, "mu", x0=[0.0, 0.0], span=(-0.5, 0.3), cycles=False)) == 1
    with pytest.raises(pk.ParameterError, match="cycles"):
        pk.diagram(QUINTIC, "mu", x0=[0.0, 0.0], span=(-0.5, 0.3), cycles="all")


def test_a_hopf_point_next_to_the_end_of_a_family_begins_its_own():
    """r^2 = 12 (mu + 1/2) mu (mu - c): cycles between two Hopf points, and from the third on."""
    r = "(12*(mu + 1/2)*mu*(mu - c) - x*x - y*y)"
    problem = pk.Problem([f"{r}*x - y", f"{r}*y + x"], ("x", "y"), {"mu": -0.7, "c": 0.01})
    rest, arc, last = pk.diagram(problem, "mu", x0=[0.0, 0.0], span=(-0.7, 0.3))
    assert [point["mu"] for point in rest.special("H")] == pytest.approx([-0.5, 0.0, 0.01])
    assert {stop.reason for stop in arc.stops} == {"hopf"}
    assert [stop.reason for stop in last.stops] == ["hopf", "bound"]


def test_starts_that_lead_nowhere_are_said():
    with pytest.warns(RuntimeWarning, match="no branch: .*x = 1e[+]300"):
        found = pk.diagram(QUINTIC, "mu", x0=[[0, 0], [1e300, 3]], span=(-0.5, 0.3), cycles=False)
    assert len(found) == 1


@pytest.mark.parametrize("s", [1e-9, 1.0])
def test_equilibria_are_told_apart_on_their_own_scale(s):
    far = pk.Problem(["mu*s*s - x*x", "x - y"], ("x", "y"), {"mu": 1.0, "s": s})
    found = equilibria_near(far, "mu", (0.5, 1.5))
    assert sorted(x[0] / s for x in found) == pytest.approx([-1.0, 1.0], rel=1e-6)


@pytest.mark.parametrize("f", ["exp(x) - 1 + mu", "mu - x^2", "mu - x^3"])
def test_an_equilibrium_at_zero_comes_once(f):
    """All ends of Newton's method are rounding of zero, or come to it slowly."""
    (x,) = equilibria_near(pk.Problem(f, "x", {"mu": 0.0}), "mu", (-0.5, 0.5))
    assert abs(x[0]) < 1e-4


def test_doublings_of_a_map_to_a_depth():
    logistic = pk.Problem("r*x*(1 - x)", "x", {"r": 2.5}, map=True)
    for depth, wanted in ((0, 1), (1, 2), (2, 3)):
        found = pk.diagram(logistic, "r", x0=[0.6], span=(1.5, 3.6), depth=depth)
        doublings = {round(p["r"], 9) for one in found for p in one.special("period_doubling")}
        exact = [3.0, 1.0 + np.sqrt(6.0), 3.544090359552]
        assert sorted(doublings)[:wanted] == pytest.approx(exact[:wanted], abs=1e-8)


def test_what_ends_for_its_number_of_points_is_said():
    few = pk.ContinuationOptions(max_points=25)
    with pytest.warns(RuntimeWarning, match="beyond on this family of periodic orbits from .*mu="):
        pk.diagram(QUINTIC, "mu", x0=[0.0, 0.0], span=(-0.5, 0.3), options=few)


@pytest.mark.slow
def test_cycles_of_lorenz_end_in_homoclinic_orbits():
    lorenz = pk.Problem(
        ["s*(y - x)", "r*x - y - x*z", "x*y - b*z"], ("x", "y", "z"),
        {"s": 10.0, "r": 0.5, "b": 8.0 / 3.0},
    )  # fmt: skip
    found = pk.diagram(lorenz, "r", x0=[0.0, 0.0, 0.0], span=(0.5, 30.0))
    families = [one for one in found if isinstance(one, pk.CycleBranch)]
    ends = [one for one in found if isinstance(one, pk.ConnectionBranch)]
    both = [one for one in families if "hopf" in {stop.reason for stop in one.stops}]
    assert len(both) == 2
    assert len(ends) == 2  # an orbit, and its mirror image
    left, right = (one.orbit(0).x.values for one in ends)
    assert np.sign(left[np.argmax(abs(left))]) == -np.sign(right[np.argmax(abs(right))])
    for one in ends:
        assert one.points.r[0].item() == pytest.approx(13.92655740752, abs=1e-7)
    names = {text.get_text() for text in pk.plot.branch(found).get_legend().get_texts()}
    assert "connection, max and min" in names
    assert not any(name.startswith("stable cycle") for name in names)


def test_equilibria_are_found_without_a_guess():
    """Predator and prey of Rosenzweig and MacArthur: extinct, prey alone, both.

    Both live from K = x = m/(a (e - m h)) on, where the two last ones cross; the Hopf point stands
    where the hump of the prey's nullcline does, at x = (K - 1/(a h))/2.
    """
    a, h, e, m = 3.0, 1.0, 0.8, 0.3
    food = pk.Problem(
        {"x": "x*(1 - x/K) - a*x*y/(1 + h*a*x)", "y": "e*a*x*y/(1 + h*a*x) - m*y"},
        parameters={"K": 1.0, "a": a, "h": h, "e": e, "m": m},
    )
    found = pk.diagram(food, "K", span=(0.1, 3.0))
    x = m / (a * (e - m * h))
    assert len(found) == 4  # with one family
    crossings = [point["K"] for branch in found for point in branch.special("BP")]
    assert crossings == pytest.approx([x, x], rel=1e-10)
    (hopf,) = (point["K"] for branch in found for point in branch.special("H"))
    assert hopf == pytest.approx(2.0 * x + 1.0 / (a * h), rel=1e-10)


def test_a_window_is_searched_along_the_whole_span():
    """x^2 + mu^2 = 1/25 is a branch by itself, which does not reach mu = -1."""
    isola = pk.Problem(
        {"x": "x^2 + mu^2 - 1/25", "y": "x - y"}, parameters={"mu": -1.0},
        window={"x": (-1, 1), "y": (-1, 1)},
    )  # fmt: skip
    (branch,) = pk.diagram(isola, "mu", span=(-1.0, 1.0))
    assert [stop.reason for stop in branch.stops] == ["closed", "closed"]
    folds = sorted(point["mu"] for point in branch.special("LP"))
    assert folds == pytest.approx([-0.2, 0.2], abs=1e-12)


def test_a_family_between_two_hopf_points_comes_once():
    """Where it ends, the orbit that is left is small beside the other Hopf point."""
    neuron = pk.Problem(
        {
            "V": "(I - 2*(V + 60) - 8*w*(V + 84) - 2.2*(1 + tanh((V + 1.2)/18))*(V - 120))/20",
            "w": "0.04*((1 + tanh((V - 2)/30))/2 - w)*cosh((V - 2)/60)",
        },
        parameters={"I": 0.0},
    )
    branch, family = pk.diagram(neuron, "I", span=(0.0, 300.0))
    assert [stop.reason for stop in family.stops] == ["hopf", "hopf"]
    assert len(branch.special("H")) == 2
    assert len(family.special("LPC")) == 2


def test_a_family_comes_once_where_angles_are_told_whole_turns_apart():
    """One Hopf point is at phi = 2.95, the other at 3.25 - 2 pi."""
    push = "-sin(phi - 3.1 - mu/2) + (0.09 - mu^2 - 2*v^2)*v"
    rotor = pk.Problem({"phi": "v", "v": push}, parameters={"mu": -0.4}, periods={"phi": 2 * np.pi})
    branch, family = pk.diagram(rotor, "mu", x0=[2.9, 0.0], span=(-0.4, 0.4))
    assert [stop.reason for stop in family.stops] == ["hopf", "hopf"]
    assert len(branch.special("H")) == 2


@pytest.mark.parametrize(("x", "said"), [("mu*x - x^3", False), ("x^2", True)])
def test_equilibria_that_are_not_proved_all_along_are_said(x, said):
    """Those of the first meet at one value, those of the second are double everywhere."""
    law = pk.Problem(
        {"x": x, "y": "x - y"}, parameters={"mu": 0.5}, window={"x": (-2, 2), "y": (-2, 2)}
    )
    values = np.linspace(-1.0, 1.0, 9)
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        equilibria_at(law, "mu", values, None)
    assert any("may be other equilibria" in str(one.message) for one in caught) == said


@pytest.mark.parametrize(("x", "said"), [("mu - x", False), ("x^2", True)])
def test_doubt_at_one_value_alone_is_said(x, said):
    law = pk.Problem(
        {"x": x, "y": "x - y"}, parameters={"mu": 0.5}, window={"x": (-2, 2), "y": (-2, 2)}
    )
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        equilibria_at(law, "mu", np.array([0.5]), None)
    assert any("at 1 of 1 values of mu" in str(one.message) for one in caught) == said
