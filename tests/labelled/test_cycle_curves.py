"""Special points on curves of folds and tori of cycles, at exact places."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

import phasekit as pk
from phasekit.cycles.events import turns_back


@pytest.mark.parametrize("forced", [False, True])
def test_two_folds_of_cycles_meet_in_a_cusp(forced, tmp_path):
    # With q = x^2 + y^2 - 1 the orbits have p1 + p2 q - q^3 = 0; forced, x = q + cos t.
    if forced:
        q = "(x - cos(t))"
        system = pk.Problem(
            [f"p1 + p2*{q} - {q}**3 - sin(t)"], "x", {"p1": -0.3, "p2": 0.5}, time="t",
            period="2*pi",
        )  # fmt: skip
    else:
        q = "(x**2 + y**2 - 1)"
        rate = f"(p1 + p2*{q} - {q}**3)"
        system = pk.Problem(
            [f"x*{rate} - y*(1 + p2*{q}/3)", f"y*{rate} + x*(1 + p2*{q}/3)"], ("x", "y"),
            {"p1": -0.3, "p2": 0.5},
        )  # fmt: skip
    orbit = pk.periodic_orbit(system, [0.1] if forced else [0.3, 0.0])
    branch = pk.continuation(system, "p1", orbit=orbit, span=(-0.5, 0.5))
    fold, _ = branch.special("LPC")
    curve = fold.curve("p2", (-0.5, 1.0))
    # Both folds, on both sides of the cusp.
    assert curve.points.sizes["point"] > 10
    assert np.allclose(27 * curve.points.p1**2, 4 * curve.points.p2**3, atol=1e-10)
    assert float(curve.points.p1[0] * curve.points.p1[-1]) < 0.0
    (cusp,) = curve.special("CP")
    assert [s.kind for s in curve.special_points] == ["end", "cusp", "end"]
    assert cusp.status == "converged"
    assert abs(cusp["p1"]) < 1e-10
    assert abs(cusp["p2"]) < 1e-7
    curve.save(tmp_path / "curve.nc")
    again = pk.Branch.load(tmp_path / "curve.nc")
    assert again.points.identical(curve.points)
    assert again.special("CP")[0]["p2"] == cusp["p2"]


@pytest.mark.slow
def test_a_cusp_of_cycles_beyond_a_degenerate_bautin_point_is_one_point_alone():
    """With q = x^2 + y^2 and p + r q - 3 q^2 / 2 + q^3 = 0 its derivatives vanish at q = 1/2."""
    q = "(x**2 + y**2)"
    rate = f"(p + r*{q} - 3*{q}**2/2 + {q}**3)"
    system = pk.Problem(
        [f"x*{rate} - y", f"y*{rate} + x"], ("x", "y"), {"p": 0.048, "r": 0.5},
    )  # fmt: skip
    orbit = pk.periodic_orbit(system, [np.sqrt(0.8), 0.0], period=2 * np.pi)
    fold, _ = pk.continuation(system, "p", orbit=orbit, span=(-2.0, 2.0)).special("LPC")
    curve = fold.curve("r", (-10.0, 2.0))
    assert [s.kind for s in curve.special_points] == ["end", "cusp", "end"]
    (cusp,) = curve.special("CP")
    assert cusp.status == "converged"
    assert abs(cusp["p"] + 0.125) < 1e-10
    assert abs(cusp["r"] - 0.75) < 1e-10


def test_strong_resonances_of_tori():
    # It turns at the rate d, and in r and z it is at a Hopf point whatever d is.
    rate = "l*z - z**3/3 - (x**2 + y**2)*(1 + z/4)"
    system = pk.Problem(
        ["(z - 0.7)*x - d*y", "d*x + (z - 0.7)*y", f"0.6 + {rate}"], ("x", "y", "z"),
        {"l": 0.3, "d": 3.5},
    )  # fmt: skip
    flat = pk.Problem(
        ["(z - 0.7)*r", "0.6 + l*z - z**3/3 - r**2*(1 + z/4)"], ("r", "z"), {"l": 0.3}
    )
    (hopf,) = pk.continuation(flat, "l", x0=[0.7, 0.7], span=(0.0, 1.0)).special("H")
    omega = hopf.normal_form["omega"]
    rest = pk.continuation(system, "l", x0=[0.0, 0.0, 1.0], span=(-1.0, 1.0))
    (torus,) = rest.special("H")[0].switch().special("TR")
    curve = torus.curve("d", (2.0, 6.0))
    assert curve.points.sizes["point"] > 10
    assert np.allclose(curve.points.l, hopf["l"], atol=1e-10)
    # The symmetry lets the multipliers pass each other at -1, where the equations are singular.
    assert [s.label for s in curve.special_points] == ["EP", "R3", "R2", "R3", "R4", "EP"]
    at = [s["d"] / omega for s in curve.special_points[1:-1]]
    assert np.allclose(at[0::2] + at[3:], [1.5, 3.0, 4.0], rtol=1e-9)
    status = [s.status for s in curve.special_points[1:-1]]
    assert status == ["converged", "guess", "converged", "converged"]
    assert 1.9 < at[1] < 2.1
    (quarter,) = curve.special("R4")
    assert quarter.eigenvalues.shape == (3,)
    assert np.allclose(np.sort(quarter.eigenvalues.imag), [-1.0, 0.0, 1.0], atol=1e-8)


def test_curves_of_folds_and_tori_meet_at_a_resonance():
    """A forced system, of which x - cos t and y stand next to a Bogdanov-Takens point."""
    u = "(x - cos(t))"
    system = pk.Problem(
        ["y - sin(t)", f"p1 + p2*{u} + {u}**2 - {u}*y"], ("x", "y"), {"p1": 0.0005, "p2": -0.05},
        time="t", period="2*pi",
    )  # fmt: skip
    orbit = pk.periodic_orbit(system, [1.0, 0.0], period=2 * np.pi)
    branch = pk.continuation(system, "p1", orbit=orbit, span=(-0.01, 0.01))
    (torus,), (fold,) = branch.special("TR"), branch.special("LPC")
    # Tori at p1 = 0, of angles 2 pi sqrt(-p2); folds at 4 p1 = p2^2.
    tori = torus.curve("p2", (-0.2, 0.1))
    assert {stop.reason for stop in tori.stops} == {"bound", "resonance_1"}
    assert sorted(s.label for s in tori.special_points) == ["EP", "EP", "R1", "R3", "R4"]
    assert tori.points.sizes["point"] > 10
    assert np.allclose(tori.points.p1, 0.0, atol=1e-10)
    assert np.isclose(float(tori.points.p2.min()), -0.2, rtol=1e-12)
    places = {"R1": 0.0, "R3": -1 / 9, "R4": -1 / 16}
    for label, p2 in places.items():
        assert abs(tori.special(label)[0]["p2"] - p2) < 1e-9
    folds = fold.curve("p2", (-0.2, 0.1))
    assert folds.points.sizes["point"] > 10
    assert np.allclose(4 * folds.points.p1, folds.points.p2**2, atol=1e-10)
    assert [s.label for s in folds.special_points] == ["EP", "R1", "EP"]
    (meeting,) = folds.special("R1")
    assert abs(meeting["p2"]) < 1e-8
    assert abs(meeting["p1"]) < 1e-8


def test_a_curve_of_tori_ends_where_the_multipliers_meet_at_minus_one():
    """An equilibrium seen from axes that turn by half a turn a period."""
    c, s = "cos(t/2)", "sin(t/2)"
    u, v = f"({c}*x + {s}*y)", f"({c}*y - {s}*x)"
    f = f"(p1*{u} + p2*{v} - {u}**3 - {u}**2*{v})"
    system = pk.Problem(
        [f"-y/2 + {c}*{v} - {s}*{f}", f"x/2 + {s}*{v} + {c}*{f}"], ("x", "y"),
        {"p2": -0.02, "p1": -0.05}, time="t", period="2*pi",
    )  # fmt: skip
    orbit = pk.periodic_orbit(system, [0.0, 0.0], period=2 * np.pi)
    (torus,) = pk.continuation(system, "p2", orbit=orbit, span=(-0.1, 0.1)).special("TR")
    curve = torus.curve("p1", (-0.1, 0.1))
    assert curve.points.sizes["point"] > 10
    assert np.allclose(curve.points.p2, 0.0, atol=1e-10)
    assert {stop.reason for stop in curve.stops} == {"bound", "resonance_2"}
    assert sorted(s.label for s in curve.special_points) == ["EP", "EP", "R2", "R3", "R4"]
    # Their angle is pi - 2 pi sqrt(-p1).
    for label, p1 in {"R2": 0.0, "R3": -1 / 36, "R4": -1 / 16}.items():
        assert abs(curve.special(label)[0]["p1"] - p1) < 1e-9


@pytest.mark.parametrize(("way", "turns"), [((-1.0, -2.0), True), ((1.0, 0.5), False)])
def test_parameters_turn_back_at_cusps(way, turns):
    """On both sides they go along one line, in units of their own."""
    cycles = SimpleNamespace(width=np.array([1e3, 1.0, 1e-3]))
    a, b = (
        SimpleNamespace(dy=np.array([9.0, *(cycles.width[:2] * p), 1.0])) for p in ((0.1, 0.2), way)
    )
    assert turns_back(cycles, a, b) == turns
