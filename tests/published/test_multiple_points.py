"""Branch points of every corank, degenerate points, and points where nothing may be lost."""

from __future__ import annotations

import math

import numba
import numpy as np
import pytest

import phasekit as pk

D3 = ("l*x + x**2 - y**2 - x*(x**2 + y**2)", "l*y - 2*x*y - y*(x**2 + y**2)")
D4 = ("l*x - x**3 - 2*x*y**2", "l*y - y**3 - 2*x**2*y")


def problem(f, state, parameters):
    return pk.Problem(list(f), state=tuple(state), parameters=parameters)


def inner(branch):
    return [point for point in branch.special_points if point.kind != "end"]


def d3(form):
    def f(s, l):  # noqa: E741
        x, y = s[0], s[1]
        r = x * x + y * y
        return np.array([l * x + x * x - y * y - x * r, l * y - 2 * x * y - y * r])

    made = {"symbolic": list(D3), "python": f, "compiled": numba.njit(f)}[form]
    return pk.Problem(made, state=("x", "y"), parameters={"l": -1.0})


@pytest.mark.parametrize("form", ["symbolic", "python", "compiled"])
def test_triangle(form):
    """D3: three lines l = -r + r^2 cross the trivial state, turned by 120 degrees."""
    branch = pk.continuation(d3(form), "l", x0=[0.0, 0.0], span=(-1.0, 1.0))
    (point,) = inner(branch)
    assert (point.kind, point.corank, point.status) == ("branch_point", 2, "converged")
    assert abs(point["l"]) < 1e-12
    assert point.directions.shape == (3, 3)
    angles = []
    for i in range(3):
        side = point.switch(direction=i)
        x, y, p = (side.points[name].values for name in ("x", "y", "l"))
        angle = math.atan2(y[-1], x[-1])
        r = x * math.cos(angle) + y * math.sin(angle)
        assert np.abs(y * math.cos(angle) - x * math.sin(angle)).max() < 1e-9
        sign = 1.0 if math.cos(3 * angle) > 0.0 else -1.0
        assert np.abs(p - (r**2 - sign * r)).max() < 1e-9
        assert len(side.special("LP")) == 1
        assert len(side.special("BP")) == 1
        angles.append(angle % math.pi)
    np.testing.assert_allclose(np.diff(sorted(angles)), math.pi / 3, atol=1e-9)


@pytest.mark.parametrize("form", ["symbolic", "python"])
def test_triangle_from_its_side(form):
    """Two real eigenvalues pass zero in opposite directions: no Hopf point."""
    start = [0.5 * (1.0 + math.sqrt(5.0)), 0.0]
    branch = pk.continuation(d3(form).replace(l=1.0), "l", x0=start, span=(-1.0, 1.1))
    found = {point.kind: point for point in inner(branch)}
    assert sorted(found) == ["branch_point", "fold"]
    point = found["branch_point"]
    assert (point.corank, point.status, len(point.directions)) == (2, "converged", 3)
    assert np.abs(point.x).max() < 1e-9
    assert abs(found["fold"]["l"] + 0.25) < 1e-12


def test_square():
    """D4: the parameter turns on four lines."""
    branch = pk.continuation(problem(D4, "xy", {"l": -1.0}), "l", x0=[0, 0], span=(-1.0, 1.0))
    (point,) = inner(branch)
    assert (point.kind, point.corank, point.status) == ("branch_point", 2, "converged")
    angles = np.sort(np.arctan2(point.directions[:, 1], point.directions[:, 0]) % math.pi)
    angles = np.sort(np.where(angles > math.pi - 1e-6, 0.0, angles))
    np.testing.assert_allclose(angles, math.pi / 4 * np.arange(4), atol=1e-9)
    for i in range(4):
        side = point.switch(direction=i)
        (again,) = inner(side)
        assert (again.kind, again.corank) == ("branch_point", 2)
        assert side.points.l.values[[0, -1]].tolist() == [1.0, 1.0]


def cells(count, coupling=0.3):
    names = [f"x{i}" for i in range(count)]
    mean = f"{coupling}/{count}*({'+'.join(names)})"
    texts = [f"(l - {coupling})*{x} + {x}**2 - {x}**3 + {mean}" for x in names]
    return problem(texts, names, {"l": -0.5})


@pytest.mark.parametrize("count", [3, 4])
def test_equal_cells(count):
    """All parts that sum to zero are critical together at l = 0.3: 2^(N - 1) - 1 lines cross."""
    branch = pk.continuation(cells(count), "l", x0=np.zeros(count), span=(-0.5, 1.0))
    one, *_, point = inner(branch)
    assert one.kind == "transcritical"
    assert (point.kind, point.corank, point.status) == ("branch_point", count - 1, "converged")
    assert abs(point["l"] - 0.3) < 1e-12
    assert len(point.directions) == 2 ** (count - 1) - 1
    ds = branch.to_dataset()
    assert ds.special_corank.values.tolist() == [p.corank for p in branch.special_points]


def test_many_equal_cells_say_that_there_may_be_more():
    branch = pk.continuation(cells(12), "l", x0=np.zeros(12), span=(-0.5, 0.5))
    _, point = branch.special("BP")
    assert (point.corank, point.status) == (11, "converged")
    assert len(point.directions) > 40
    assert "may be more" in point.message


def multiplicities(highest):
    """Blocks of k equal cells without coupling, critical at l = k: corank k there.

    In each block x' = (l - k) x + x^2 - (next x)^2/2 - x^3: the trivial state has the eigenvalue
    l - k with multiplicity k.
    """
    texts, names = [], []
    for k in range(1, highest + 1):
        own = [f"x{k}_{i}" for i in range(k)]
        names += own
        for i, x in enumerate(own):
            other = own[(i + 1) % k]
            texts.append(f"(l - {k})*{x} + {x}**2 - {other}**2/3 - {x}**3")
    return problem(texts, names, {"l": 0.0})


def test_multiplicities_of_one_to_four():
    made = multiplicities(4)
    branch = pk.continuation(made, "l", x0=np.zeros(10), span=(0.0, 4.5))
    points = branch.special("BP")
    assert [point.corank for point in points] == [1, 2, 3, 4]
    np.testing.assert_allclose([point["l"] for point in points], [1, 2, 3, 4], atol=1e-12)
    assert all(point.status == "converged" for point in points)
    assert branch.points.n_unstable.values[-1] == 10
    assert not branch.special("H")


def test_gradient_system_has_no_hopf_point():
    """V = -l (x^2 + y^2 + z^2)/2 + xyz + (x^4 + y^4 + z^4)/4, in even and in odd units."""
    for a, b in ((1.0, 1.0), (1e-5, 1e4)):
        x, y, z = "x", f"(y/{a})", f"(z/{b})"
        texts = (
            f"l*{x} - {y}*{z} - {x}**3",
            f"{a}*(l*{y} - {x}*{z} - {y}**3)",
            f"{b}*(l*{z} - {x}*{y} - {z}**3)",
        )
        branch = pk.continuation(
            problem(texts, "xyz", {"l": -1.0}), "l", x0=[0, 0, 0], span=(-1.0, 1.0),
            options=pk.ContinuationOptions(scales={"y": a, "z": b}),
        )  # fmt: skip
        (point,) = inner(branch)
        assert (point.kind, point.corank, point.status) == ("branch_point", 3, "converged")


def test_textbook_fold_with_a_decaying_state():
    branch = pk.continuation(
        problem(["l - x**2", "-y"], "xy", {"l": 1.0}), "l", x0=[1, 0], span=(-1.0, 2.0)
    )
    (fold,) = branch.special("LP")
    assert (fold.status, fold.corank) == ("converged", 1)
    assert abs(fold["l"]) < 1e-14
    assert fold.normal_form["a"] * fold.normal_form["b"] == pytest.approx(-1.0)


def test_curve_of_the_textbook_fold():
    made = problem(["l - x**2 + m*x", "-y"], "xy", {"l": 1.0, "m": 0.0})
    branch = pk.continuation(made, "l", x0=[1, 0], span=(-1.0, 2.0))
    curve = branch.special("LP")[0].curve("m", (-1.0, 1.0))
    assert np.abs(curve.points.l + 0.25 * curve.points.m**2).max() < 1e-12
    assert (curve.points.m.min(), curve.points.m.max()) == (-1.0, 1.0)


def test_four_branches_through_a_point():
    branch = pk.continuation(
        problem(["x*(x - l)*(x + l)*(x - 2*l)"], "x", {"l": -1.0}), "l", x0=[0], span=(-1.0, 1.0)
    )
    (point,) = inner(branch)
    assert point.kind == "branch_point"
    assert "4 branches" in point.message
    slopes = np.sort(point.directions[:, 0] / point.directions[:, 1])
    np.testing.assert_allclose(slopes, [-1.0, 1.0, 2.0], atol=1e-6)
    for i in range(3):
        points = point.switch(direction=i).points
        gap = [np.abs(points.x - k * points.l).max() for k in (-1, 1, 2)]
        assert min(gap) < 1e-9


def test_a_double_zero_is_no_hopf_point():
    branch = pk.continuation(
        problem(["y", "b + x**2 + x*y"], "xy", {"b": -1.0}), "b", x0=[1, 0], span=(-1.0, 1.0)
    )
    (fold,) = inner(branch)
    assert (fold.kind, fold.status) == ("fold", "converged")
    assert "Bogdanov-Takens" in fold.message


def test_one_fast_rate_hides_no_branch_point():
    texts = ["l*x - x**3", "-y + x**2", "-z", "-1e5*(w - x)"]
    branch = pk.continuation(
        problem(texts, "xyzw", {"l": -1.0}), "l", x0=np.zeros(4), span=(-1.0, 0.9)
    )
    (point,) = branch.special("BP")
    assert (point.kind, point.status) == ("pitchfork", "converged")
    assert abs(point["l"]) < 1e-12


def test_equal_oscillators_cross_together():
    """Three equal oscillators with all-to-all coupling: two pairs cross at mu = 0.3."""
    texts, names = [], []
    for i in range(3):
        x, y = f"x{i}", f"y{i}"
        names += [x, y]
        spread = "+".join(f"(x{j} - {x})" for j in range(3))
        other = "+".join(f"(y{j} - {y})" for j in range(3))
        texts += [
            f"mu*{x} - 2*{y} + 0.1*({spread}) - {x}**3",
            f"2*{x} + mu*{y} + 0.1*({other}) - {y}**3",
        ]
    branch = pk.continuation(
        problem(texts, names, {"mu": -0.5}), "mu", x0=np.zeros(6), span=(-0.5, 0.5)
    )
    one, two = branch.special("H")
    assert (one.status, two.status) == ("converged", "converged")
    assert abs(one["mu"]) < 1e-12
    assert abs(two["mu"] - 0.3) < 1e-9
    assert two.normal_form["omega"] == pytest.approx(2.0)
    assert math.isnan(two.normal_form["l1"])
    assert "2 pairs" in two.message


@pytest.mark.parametrize("end", ["low", "high"])
def test_a_branch_point_on_the_end_of_the_span(end):
    low, high = (0.0, 1.0) if end == "low" else (-1.0, 0.0)
    start = high if end == "low" else low
    branch = pk.continuation(
        problem(["l*x - x**2", "-y + x"], "xy", {"l": start}), "l", x0=[0, 0], span=(low, high)
    )
    (point,) = branch.special("BP")
    assert (point.kind, point.status) == ("transcritical", "converged")
    assert abs(point["l"]) < 1e-9


@pytest.mark.parametrize("unit", [(1e-12, 1.0, 1.0), (1e6, 1e-6, 1.0), (1.0, 1e12, 1e-12),
                                  (1e-3, 1.0, 1e12)])  # fmt: skip
def test_units_change_no_verdict(unit):
    """The triangle with a decaying state in other units of state, parameter and f, and shifted."""
    s, p, f = (repr(value) for value in unit)
    x, y, z = f"(x/{s} - 2)", f"(y/{s} + 3)", f"(z/{s})"
    l = f"(l/{p} - 1)"  # noqa: E741
    texts = [
        f"{f}*{s}*({l}*{x} + {x}**2 - {y}**2 - {x}*({x}**2 + {y}**2))",
        f"{f}*{s}*({l}*{y} - 2*{x}*{y} - {y}*({x}**2 + {y}**2))",
        f"{f}*{s}*(-2*{z} + {x}*{y})",
    ]
    scale, width = unit[0], unit[1]
    branch = pk.continuation(
        problem(texts, "xyz", {"l": 0.0}), "l",
        x0=[2 * scale, -3 * scale, 0.0], span=(0.0, 2.1 * width),
        options=pk.ContinuationOptions(scales={"x": scale, "y": scale, "z": scale}),
    )  # fmt: skip
    found = [(point.kind, point.corank, point.status) for point in branch.special("BP")]
    assert found == [("branch_point", 2, "converged")]
    (point,) = branch.special("BP")
    assert point["l"] / width == pytest.approx(1.0, abs=1e-9)
    assert len(point.directions) == 3


def test_switch_checks_the_direction():
    (point,) = pk.continuation(d3("symbolic"), "l", x0=[0, 0], span=(-1, 1)).special("BP")
    for wrong in (3, -1, 0.5, True, None):
        with pytest.raises(pk.ParameterError, match=r"direction: .* from 0 to 2"):
            point.switch(direction=wrong)
    with pytest.raises(pk.ParameterError, match="corank 2"):
        point.curve("l", (-1.0, 1.0))


def test_a_diagram_follows_all_directions():
    found = pk.diagram(d3("symbolic"), "l", x0=[[0.0, 0.0]], span=(-1.0, 1.0))
    assert len(found) == 4
