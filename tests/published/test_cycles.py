"""Periodic orbits of published systems: periods, multipliers, special points, ends.

Values with a source are held at the precision that the source gives; those that are marked as
refined come from an independent collocation code (m = 5 and 6, the number of intervals doubled)
and are held at 1e-8.
"""

from __future__ import annotations

import os

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import phasekit as pk
from phasekit.cycles import trace
from phasekit.cycles.cycles import MOST

ALL = os.environ.get("PHASEKIT_PUBLISHED") == "all"
more = pytest.mark.skipif(not ALL, reason="longer; PHASEKIT_PUBLISHED=all runs it")
REFINED = 1e-8


def close(value, reference, tolerance=REFINED):
    return abs(float(value) - reference) <= tolerance * abs(reference)


def reaction(p1, p2, p3):
    """A -> B in a stirred tank, the demo ab of AUTO-07p."""
    return pk.Problem(
        ["-u1 + p1*(1 - u1)*exp(u2)", "-u2 + p1*p2*(1 - u1)*exp(u2) - p3*u2"],
        ("u1", "u2"), {"p1": p1, "p2": p2, "p3": p3},
    )  # fmt: skip


def lorenz(rho):
    return pk.Problem(
        ["s*(y - x)", "rho*x - y - x*z", "x*y - b*z"],
        ("x", "y", "z"), {"s": 10.0, "rho": rho, "b": 8 / 3},
    )  # fmt: skip


def roessler(c):
    return pk.Problem(
        ["-y - z", "x + a*y", "b + z*(x - c)"], ("x", "y", "z"), {"a": 0.2, "b": 0.2, "c": c}
    )


def van_der_pol(mu):
    return pk.Problem(["y", "mu*(1 - x**2)*y - x"], ("x", "y"), {"mu": mu})


def rotation(al, I):  # noqa: E741
    """A pendulum that rotates under a torque."""
    return pk.Problem(
        ["v", "I - al*v - sin(phi)"], ("phi", "v"), {"al": al, "I": I}, periods={"phi": 2 * np.pi}
    )


def checked(branch):
    """What holds of every branch of periodic orbits."""
    points = branch.points
    assert points.sizes["point"] == len(branch.path) > 2
    known = points.n_unstable.values >= 0
    assert np.all(points.residual < 1e-9)
    assert np.all(points.trivial_error.values[known] < 1e-5)
    assert np.all(points.liouville_error.values[known] < 1e-5)
    assert np.all(points.mesh_error < 1e-7)
    for one in branch.special_points:
        assert one.status == "converged", one
    places = [s["period"] + 1j * s[branch.parameter] for s in branch.special_points
              if s.kind != "end"]  # fmt: skip
    gaps = np.abs(np.subtract.outer(places, places))[np.triu_indices(len(places), 1)]
    assert np.all(gaps > 1e-6)  # no special point twice
    return branch


@pytest.mark.parametrize(
    ("mu", "period"), [(1.0, 6.66328685932), (2.0, 7.62987447967), (5.0, 11.61223066771)]
)
def test_van_der_pol(mu, period):
    # Amore, arXiv 2111.12198; refined.
    assert close(pk.periodic_orbit(van_der_pol(mu), [2.0, 0.0]).period, period)


def test_lure_doubles():
    # MatCont's manual: PD at 0.6303020, T = 6.364071.
    feedback = pk.Problem(
        ["y", "z", "-al*z - be*y - x + x**2"], ("x", "y", "z"), {"al": 1.2, "be": 1.0}
    )
    rest = pk.continuation(feedback, "al", x0=[0.0, 0.0, 0.0], span=(0.55, 1.5))
    cycles = checked(rest.special("H")[0].switch())
    (doubling,) = cycles.special("PD")
    assert close(doubling["al"], 0.63030200616)
    assert close(doubling["period"], 6.36407133944)
    assert abs(doubling.eigenvalues[2] + 0.01811) < 1e-5
    assert cycles.stops[0].reason == "hopf"


@pytest.mark.parametrize(
    ("p2", "period", "largest"),
    [
        (14.0, 2.220341890455, (0.99538767, 6.88001)),
        (15.0, 1.726366510853, None),
        (16.0, 1.231621670242, None),
    ],
)
def test_reaction(p2, period, largest):
    # AUTO-07p's log: 2.22034, 1.72637, 1.23162.
    orbit = pk.periodic_orbit(reaction(0.25, p2, 3.0), [0.9, 3.0])
    assert close(orbit.period, period)
    if largest is not None:
        assert abs(float(orbit.u1_max) - largest[0]) < 1e-8
        assert abs(float(orbit.u2_max) - largest[1]) < 1e-5


def test_reaction_from_hopf_to_hopf():
    rest = pk.continuation(reaction(0.1, 14.0, 3.0), "p1", x0=[0.1, 0.7], span=(0.0, 0.5))
    first, last = rest.special("H")
    cycles = checked(first.switch())
    (fold,) = cycles.special("LPC")
    assert close(fold["p1"], 0.161696128898)
    assert close(fold["period"], 7.113755, 1e-6)
    assert [stop.reason for stop in cycles.stops] == ["hopf", "hopf"]
    # It ends at the other Hopf point, and is not traced back from there.
    assert abs(float(cycles.points.p1[-1]) - last["p1"]) < 1e-5
    assert close(cycles.points.period[-1], 2 * np.pi / last.normal_form["omega"], 1e-4)
    assert not cycles.special("PD")
    assert not cycles.special("BPC")


def test_reaction_towards_a_homoclinic_orbit():
    rest = pk.continuation(reaction(0.1, 14.0, 2.0), "p1", x0=[0.1, 0.7], span=(0.0, 0.4))
    cycles = checked(rest.special("H")[0].switch())
    assert cycles.stops[1].reason == "homoclinic"
    assert abs(float(cycles.points.p1[-1]) - 0.105507070040) < 1e-10
    assert not [s for s in cycles.special_points if s.kind != "end"]  # no folds of rounding


def test_lorenz():
    rest = pk.continuation(lorenz(23.0), "rho", x0=[7.7, 7.7, 22.0], span=(10.0, 30.0))
    cycles = checked(rest.special("H")[0].switch())
    assert cycles.stops[1].reason == "homoclinic"
    assert abs(float(cycles.points.rho[-1]) - 13.9265574075) < 1e-9
    assert [s.kind for s in cycles.special_points] == ["end", "end"]
    i = int(np.argmin(np.abs(cycles.points.rho.values - 20.0)))
    for rho, period in ((24.06, 0.677093562987), (20.0, 0.876552253492), (16.0, 1.302497474229)):
        i = int(np.argmin(np.abs(cycles.points.rho.values - rho)))
        at = pk.periodic_orbit(lorenz(rho), cycles.orbit(i))
        assert close(at.period, period)


def test_lorenz_orbit_of_two_turns():
    # Viswanath 2003, 14 digits.
    orbit = pk.periodic_orbit(
        lorenz(28.0), [-13.763610682134, -19.578751942452, 27.0], period=1.5587
    )
    assert close(orbit.period, 1.55865221071615, 1e-13)
    assert close(orbit.multiplier.values[0].real, 4.71294727)


def test_roessler_orbits():
    # ChaosBook: 5.88108845586, -2.403953527.
    orbit = pk.periodic_orbit(roessler(5.7), [-8.0, -2.0, 0.03], period=5.88)
    assert close(orbit.period, 5.881088455554)
    assert abs(orbit.multiplier.values[0] + 2.403953527) < 1e-8


def test_roessler_orbit_of_three_turns():
    """From one period of samples, against a shooting by another integrator."""

    def f(t, x):
        return [-x[1] - x[2], x[0] + 0.2 * x[1], 0.2 + x[2] * (x[0] - 5.7)]

    # ChaosBook: 17.5157912663, of which eight digits agree with this shooting; -2.341923.
    guess, at = 17.5157912663, np.linspace(0.0, 17.5157912663, 400)
    samples = solve_ivp(
        f, (0, guess), [-5.39165954, 6.63283758, 0.02015118], "DOP853", t_eval=at, rtol=1e-10,
        atol=1e-12,
    ).y.T  # fmt: skip
    orbit = pk.periodic_orbit(roessler(5.7), samples, period=guess)
    assert close(orbit.period, guess, 2e-8)
    assert close(orbit.period, 17.51579107033588, 1e-11)
    assert abs(orbit.multiplier.values[0] + 2.34192350364) < 1e-8
    assert int(orbit.n_unstable) == 1
    start = [float(orbit[name][0]) for name in "xyz"]
    end = solve_ivp(f, (0, float(orbit.period)), start, "DOP853", rtol=1e-12, atol=1e-13).y[:, -1]
    assert np.allclose(end, start, atol=1e-7)


def test_roessler_doubles():
    start = pk.periodic_orbit(roessler(2.0), [2.0, 2.0, 0.03], settle=100.0)
    first = checked(pk.continuation(roessler(2.0), "c", orbit=start, span=(2.0, 6.0)))
    (one,) = first.special("PD")
    assert close(one["c"], 2.832445027862)
    assert close(one["period"], 5.769820, 1e-6)
    second = checked(one.switch())
    (two,) = second.special("PD")
    assert close(two["c"], 3.83735816841)
    assert [stop.reason for stop in second.stops] == ["period_doubling", "bound"]
    if ALL:
        third = checked(two.switch())
        (three,) = third.special("PD")
        assert 3.4 < (two["c"] - one["c"]) / (three["c"] - two["c"]) < 5.0  # towards 4.669
    # ChaosBook.
    i = int(np.argmin(np.abs(second.points.c.values - 5.7)))
    at = pk.periodic_orbit(roessler(5.7), second.orbit(i))
    assert close(at.period, 11.7586260717)
    assert abs(at.multiplier.values[0] + 3.512006980) < 1e-8


def test_hardening_duffing():
    duffing = pk.Problem(
        ["v", "F*cos(w*t) - d*v - x - x**3"], ("x", "v"), {"d": 0.04, "F": 0.015, "w": 0.9},
        time="t", period="2*pi/w",
    )  # fmt: skip
    response = checked(
        pk.continuation(duffing, "w", orbit=pk.periodic_orbit(duffing, [0.0, 0.0]), span=(0.9, 1.2))
    )
    folds = [fold["w"] for fold in response.special("LPC")]
    assert len(folds) == 2
    assert close(folds[0], 1.049262399236)
    assert close(folds[1], 1.043913708797)
    # Multipliers by Liouville: exp(-d T).
    product = np.prod(response.points.multiplier.values, axis=1)
    assert np.allclose(product, np.exp(-0.04 * response.points.period.values), rtol=1e-9)
    # The orbit of a point solves the equations.
    orbit = response.orbit(10)
    w = float(orbit.w)

    def f(t, x):
        return [x[1], 0.015 * np.cos(w * t) - 0.04 * x[1] - x[0] - x[0] ** 3]

    start = [float(orbit.x[0]), float(orbit.v[0])]
    motion = solve_ivp(
        f, (0, float(orbit.period)), start, t_eval=orbit.time.values, rtol=1e-12, atol=1e-14
    )
    assert np.max(np.abs(motion.y[0] - orbit.x.values)) < 1e-8


@pytest.mark.parametrize(
    ("al", "ratio"), [(0.05, 1.272451724), (0.1, 1.270088598), (0.2, 1.260641222)]
)
def test_rotations_of_a_damped_pendulum(al, ratio):
    system = rotation(al, 0.5)
    orbit = pk.periodic_orbit(system, [0.0, 0.5 / al])
    assert int(orbit.winding) == 1
    if al == 0.1:
        assert close(orbit.period, 1.257644285820)
    branch = checked(pk.continuation(system, "I", orbit=orbit, span=(0.01, 1.0)))
    assert branch.stops[0].reason == "homoclinic"
    assert abs(float(branch.points.I[0]) / al - ratio) < 2e-9
    points = branch.points.isel(point=branch.points.n_unstable.values >= 0)
    values = points.multiplier.values
    other = np.where(
        np.abs(values[:, 0] - 1) < np.abs(values[:, 1] - 1), values[:, 1], values[:, 0]
    )
    assert len(other) > 10
    assert np.allclose(other, np.exp(-al * points.period.values), rtol=1e-6)


def test_rotations_end_on_a_saddle_node(monkeypatch):
    system = rotation(1.0, 1.0)
    sizes, original = [0], trace.passages

    def passages(*given):
        mesh = original(*given)
        sizes.append(0 if mesh is None else len(mesh) - 1)
        return mesh

    monkeypatch.setattr(trace, "passages", passages)
    branch = pk.continuation(
        system, "al", orbit=pk.periodic_orbit(system, [0.0, 1.0]), span=(1.0, 1.5)
    )
    assert branch.stops[1].reason == "homoclinic"
    assert close(branch.points.al[-1], 1.1930459188)
    assert 1000 < max(sizes) < 2 * MOST  # though next to the node they would take millions


def test_normal_form_with_a_fold():
    # r = R^2: p1 + p2 r - r^2 = 0; d(r')/dr = 2 r (p2 - 2 r), so mu = exp(4 pi r (p2 - 2 r)).
    rate = "(p1 + p2*(x**2 + y**2) - (x**2 + y**2)**2)"
    system = pk.Problem([f"x*{rate} - y", f"y*{rate} + x"], ("x", "y"), {"p1": -0.5, "p2": 1.0})
    rest = pk.continuation(system, "p1", x0=[0.0, 0.0], span=(-0.5, 0.5))
    cycles = checked(rest.special("H")[0].switch())
    (fold,) = cycles.special("LPC")
    assert abs(fold["p1"] + 0.25) < 1e-13
    r = cycles.points.x_max.values**2
    assert np.allclose(cycles.points.p1, r**2 - r, atol=1e-8)
    exact = np.exp(4 * np.pi * r * (1 - 2 * r))
    gaps = np.min(np.abs(cycles.points.multiplier.values - exact[:, None]), axis=1)
    assert np.max(gaps / np.maximum(exact, 1.0)) < 1e-8
    assert np.allclose(cycles.points.period, 2 * np.pi, rtol=1e-12)


@more
def test_normal_forms_at_random():
    rng = np.random.default_rng(5)
    for _ in range(1000):
        w, a, b = rng.uniform(0.5, 3.0), rng.uniform(0.2, 3.0), rng.uniform(-2.0, 2.0)
        rate, turn = "(l - a*(x**2 + y**2))", "(w + b*(x**2 + y**2))"
        system = pk.Problem(
            [f"x*{rate} - y*{turn}", f"y*{rate} + x*{turn}"], ("x", "y"),
            {"l": -0.3, "w": w, "a": a, "b": b},
        )  # fmt: skip
        rest = pk.continuation(system, "l", x0=[0.0, 0.0], span=(-0.3, 0.6))
        points = rest.special("H")[0].switch().points
        r = points.l.values / a
        speed = w + b * r
        known = speed > 0.05
        assert np.allclose(points.period.values[known], 2 * np.pi / speed[known], rtol=1e-9)


@more
def test_canard():
    canard = pk.Problem(["e*(a - y)", "x + y - y**3/3"], ("x", "y"), {"e": 0.01, "a": 1.2})
    rest = pk.continuation(canard, "a", x0=[-0.6, 1.2], span=(0.9, 1.3))
    cycles = rest.special("H")[0].switch()
    steep = (cycles.points.period > 150) & (cycles.points.period < 200)
    assert int(steep.sum()) > 0
    assert np.all(np.abs(cycles.points.a.values[steep.values] - 0.99874045125) < 1e-8)
