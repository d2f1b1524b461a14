"""Kinds of special points that users add: along branches, curves, families and their curves."""

import matplotlib.pyplot as plt
import numpy as np
import pytest

import phasekit as pk
from phasekit.bifurcation import special_points
from phasekit.extend import (
    EQUILIBRIUM,
    FOLD,
    CurveTest,
    OrbitTest,
    PointKind,
    add_point_kind,
    add_point_test,
)

#: Of orbits with r^2 = l and the period 2 pi/(1 + l).
TURNING = pk.Problem(
    ["x*(l - x**2 - y**2) - y*(1 + x**2 + y**2)", "y*(l - x**2 - y**2) + x*(1 + x**2 + y**2)"],
    ("x", "y"), {"l": 0.3},
)  # fmt: skip
#: Of orbits with p1 + p2 r^2 - r^4 = 0, which fold at p1 = -p2^2/4.
RATE = "(p1 + p2*(x**2 + y**2) - (x**2 + y**2)**2)"
FOLDING = pk.Problem(
    [f"x*{RATE} - 2*y", f"y*{RATE} + 2*x"], ("x", "y"), {"p1": -0.1, "p2": 1.0}
)  # fmt: skip
CUSP = pk.Problem("mu + l*x - x**3", "x", {"mu": -1.0, "l": 1.0})


def branch(**more):
    return pk.continuation(CUSP, "mu", x0=[-1.3], span=(-1.0, 1.0), **more)


def cycles(**more):
    orbit = pk.periodic_orbit(TURNING, [0.5, 0.0])
    return pk.continuation(TURNING, "l", orbit=orbit, span=(0.2, 0.9), **more)


def along_folds_of_cycles():
    orbit = pk.periodic_orbit(FOLDING, [0.9, 0.0])
    family = pk.continuation(FOLDING, "p1", orbit=orbit, span=(-0.5, 0.5))
    return family.special("LPC")[0].curve("p2", (0.5, 2.0))


#: A test, what is followed, and what holds at its points, each known in closed form.
CASES = {
    "equilibria": (  # f_x = 1 - 3 x^2 = -2 at x = 1 and -1
        CurveTest("own", EQUILIBRIUM, lambda curve, u, slopes: slopes[:, 0, 0] + 2.0),
        branch, "mu", [0.0, 0.0],
    ),
    "folds": (  # mu = -2 x^3, l = 3 x^2
        CurveTest("own", FOLD, lambda curve, u, slopes: u[:, 0] - 0.5),
        lambda: branch().special("LP")[0].curve("l", (-1.0, 2.0)), "l", [0.75],
    ),
    "cycles": (
        OrbitTest("own", "cycle", lambda family, point: point.orbit.y[0] - 2.0 * np.pi / 1.5),
        cycles, "l", [0.5],
    ),
    "folds of cycles": (
        OrbitTest("own", "fold_of_cycles", lambda family, point: point.orbit.y[2] - 1.2),
        along_folds_of_cycles, "p1", [-0.36],
    ),
}  # fmt: skip


@pytest.fixture(autouse=True)
def registries(monkeypatch):
    """A kind of one's own, which is forgotten afterwards."""
    monkeypatch.setattr(special_points, "TESTS", list(special_points.TESTS))
    add_point_kind(PointKind("own", "OWN", "a condition of one's own", "", "", marker="p"))
    yield
    del special_points.KINDS["own"]
    plt.close("all")


@pytest.mark.parametrize("case", CASES)
def test_a_kind_of_ones_own_is_found_kept_and_drawn(case, tmp_path):
    test, follow, name, at = CASES[case]
    plain = follow()
    add_point_test(test)
    found = follow()
    own = found.special("OWN")
    assert [s.status for s in own] == ["converged"] * len(at)
    np.testing.assert_allclose(sorted(s[name] for s in own), at, atol=1e-9)
    others = [s.kind for s in found.special_points if s.kind != "own"]
    assert others == [s.kind for s in plain.special_points]
    assert "OWN own at" in repr(found)
    found.save(tmp_path / "found.nc")
    assert pk.Branch.load(tmp_path / "found.nc") == found
    assert found.plot() is not None


@pytest.mark.parametrize(("case", "last"), [("equilibria", [0.0]), ("cycles", [0.5])])
def test_a_branch_ends_at_a_kind_of_ones_own_and_goes_on(case, last):
    test, follow, name, at = CASES[case]
    with pytest.raises(pk.ParameterError, match="stop: event or special point"):
        follow(stop="own")
    add_point_test(test)
    ended = follow(stop="own")
    assert "own" in [stop.reason for stop in ended.stops]
    np.testing.assert_allclose([s[name] for s in ended.special("own")], last, atol=1e-9)
    longer = ended.extend()
    np.testing.assert_allclose(sorted(s[name] for s in longer.special("own")), at, atol=1e-9)


def test_a_test_of_no_kind_is_refused():
    with pytest.raises(ValueError, match="no special point is a 'other'"):
        add_point_test(CurveTest("other", FOLD, lambda curve, u, slopes: u[:, 0]))
