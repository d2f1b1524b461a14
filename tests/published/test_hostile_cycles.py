"""Periodic orbits of systems with exact values, of all sizes and speeds, and of stiff ones."""

from __future__ import annotations

import functools
import os

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import phasekit as pk

PATHS = int(os.environ.get("PHASEKIT_PATHS", "5"))
LARGEST = 4 if PATHS > 100 else 3


@functools.cache
def normal_form(n):
    """A Hopf normal form with decaying directions, in any coordinates; its matrices as parameters.

    r' = w r (m - a r^2), theta' = w (1 + b r^2), z' = w k z with m = (l - p)/s, X = c + M (x, z).
    """
    names = ["x", "y", "z", "q"][:n]
    z = ["(" + " + ".join(f"b{i}{j}*({names[j]} - c{j})" for j in range(n)) + ")" for i in range(n)]
    square = f"({z[0]}**2 + {z[1]}**2)"
    rate, turn = f"((l - p)/s - a*{square})", f"(1 + b*{square})"
    d = [f"w*({z[0]}*{rate} - {z[1]}*{turn})", f"w*({z[1]}*{rate} + {z[0]}*{turn})"]
    d += [f"w*k{i}*{z[i]}" for i in range(2, n)]
    f = [" + ".join(f"m{i}{j}*{d[j]}" for j in range(n)) for i in range(n)]
    values = dict.fromkeys(("l", "p", "s", "w", "a", "b", *(f"k{i}" for i in range(2, n))), 1.0)
    values |= {f"c{j}": 0.0 for j in range(n)}
    values |= {f"{k}{i}{j}": float(i == j) for k in "bm" for i in range(n) for j in range(n)}
    return pk.Problem(f, names, values)


@pytest.mark.parametrize("seed", range(PATHS))
def test_normal_forms_in_any_coordinates(seed):
    rng = np.random.default_rng(seed)
    n = int(rng.integers(2, LARGEST + 1))
    w, b, a = 10.0 ** rng.uniform(-3, 3), rng.uniform(-0.6, 2.0), rng.uniform(0.6, 3.0)
    side = rng.choice([-1.0, 1.0])
    k = rng.uniform(0.05, 1.0, n - 2) * rng.choice([-1.0, 1.0], n - 2)
    P = np.linalg.qr(rng.standard_normal((n, n)))[0] * rng.uniform(0.3, 3.0, n)
    P = P @ np.linalg.qr(rng.standard_normal((n, n)))[0]
    sizes = 10.0 ** (rng.uniform(-6, 4) + rng.uniform(-2, 2, n))
    c = sizes * rng.uniform(-3, 3, n)
    s = 10.0 ** rng.uniform(-6, 6)
    p = s * rng.choice([0.0, 1.0, -3.0])
    M, B = sizes[:, None] * P, np.linalg.inv(P) / sizes
    low, high = sorted((p - 0.3 * side * s, p + 0.6 * side * s))
    values = {"l": low, "p": p, "s": s, "w": w, "a": side * a, "b": b}
    values |= {f"k{i}": k[i - 2] for i in range(2, n)} | {f"c{j}": c[j] for j in range(n)}
    values |= {f"m{i}{j}": M[i, j] for i in range(n) for j in range(n)}
    values |= {f"b{i}{j}": B[i, j] for i in range(n) for j in range(n)}
    problem = normal_form(n).replace(**{name: float(v) for name, v in values.items()})
    (hopf,) = pk.continuation(problem, "l", x0=c, span=(low, high)).special("H")
    branch = hopf.switch()
    assert [stop.reason for stop in branch.stops] == ["hopf", "bound"]
    assert [one.kind for one in branch.special_points] == ["end", "end"]
    points = branch.points
    assert points.sizes["point"] > 5
    r = np.sqrt(np.maximum((points.l.values - p) / s / (side * a), 0.0))
    speed = 1.0 + b * r**2
    assert np.allclose(points.period.values * w * speed, 2 * np.pi, rtol=1e-9)
    for i, name in enumerate(problem.state):
        exact = r * sizes[i] * np.hypot(P[i, 0], P[i, 1])
        half = 0.5 * (points[f"{name}_max"] - points[f"{name}_min"]).values
        assert np.max(np.abs(half - exact)) < 1e-6 * np.max(exact)
    logs = [-4 * np.pi * side * a * r**2 / speed, 0.0 * r, *(2 * np.pi * q / speed for q in k)]
    exact = np.sort(np.exp(np.array(logs)).T, axis=1)[:, ::-1]
    assert (points.n_unstable.values[exact[:, 0] < 1e12] >= 0).all()
    known = (points.n_unstable.values >= 0) & (exact[:, 0] < 1e12)
    found = points.multiplier.values[known]
    assert known.sum() > 5
    gaps = np.abs(found - exact[known]) / np.maximum(exact[known], 1e-12)
    assert np.max(gaps) < 1e-6
    unstable = (side < 0) + int(np.sum(k > 0))
    assert (points.n_unstable.values[known][1:] == unstable).all()


def test_cycles_of_fitzhugh_and_nagumo_pass_their_canards():
    """They explode where the parameter stands still to twelve digits, twice, by symmetry."""
    nerve = pk.Problem(
        ["v - v**3/3 - w + I", "e*(v + 0.7 - 0.8*w)"], ("v", "w"), {"I": 0.0, "e": 0.08}
    )
    rest = pk.continuation(nerve, "I", x0=[-1.2, -0.6], span=(0, 2))
    branch = rest.special("H")[0].switch()
    assert [stop.reason for stop in branch.stops] == ["hopf", "hopf"]
    one, two = (fold["I"] for fold in branch.special("LPC"))
    assert abs(one + two - 1.75) < 1e-10
    assert abs(one - 0.3241785225) < 1e-9
    assert len(branch.special_points) == 4
    assert (branch.points.n_unstable >= 0).all()
    assert set(branch.points.n_unstable.values) == {0, 1}


def test_a_relaxation_oscillator_is_found_and_followed():
    stiff = pk.Problem(["y", "mu*(1 - x**2)*y - x"], ("x", "y"), {"mu": 50.0})
    orbit = pk.periodic_orbit(stiff, [2.0, 0.0])
    assert int(orbit.n_unstable) == 0

    def f(t, x):
        return [x[1], 50.0 * (1 - x[0] ** 2) * x[1] - x[0]]

    def by_state(t, x):
        return [[0.0, 1.0], [-100.0 * x[0] * x[1] - 1.0, 50.0 * (1 - x[0] ** 2)]]

    def downwards(t, x):
        return x[1] if t > 1.0 else -1.0

    downwards.direction = -1.0
    run = solve_ivp(
        f, (0.0, 200.0), [2.0, 0.0], "LSODA", jac=by_state, events=downwards, rtol=1e-9,
        atol=1e-12,
    )  # fmt: skip
    tops = run.t_events[0][run.y_events[0][:, 0] > 0]
    assert len(tops) >= 2
    assert np.isclose(float(orbit.period), tops[-1] - tops[-2], rtol=1e-7)


@pytest.mark.parametrize(("size", "speed"), [(1e-9, 1e6), (1e6, 1e-6)])
def test_sizes_and_speeds_do_not_matter(size, speed):
    system = pk.Problem(
        ["w*(s - (b + 1)*x + x**2*y/s**2)", "w*(b*x - x**2*y/s**2)"], ("x", "y"),
        {"b": 3.0, "s": size, "w": speed},
    )  # fmt: skip
    orbit = pk.periodic_orbit(system, [size, size])
    assert np.isclose(float(orbit.period) * speed, 7.15691992118, rtol=1e-11)
    assert int(orbit.n_unstable) == 0


def test_a_driven_disk_doubles_its_period_and_its_peak_load_is_recorded():
    disk = pk.GyroRotorDisk(beta=0.6, e=0.01, a=0.02, r=0.1, omega1=4.0, m=2.0, half_span=0.1)
    A, B, C = disk.coefficients()
    rest = pk.equilibria(disk).sel(equilibrium="lower_center")
    phi, natural = rest.phi.item(), rest.natural_frequency.item()
    damping, w = 0.2 * natural, 0.8 * natural
    driven = pk.Perturbed(disk, damping=damping, forcing=pk.Harmonic(0.5 * natural**2, w))

    def load(x, t, forcing_amplitude, **p):
        force = A * np.sin(x[0]) * np.cos(x[0]) - B * np.sin(x[0]) + C * np.cos(x[0])
        ddphi = force - damping * x[1] + forcing_amplitude * np.cos(w * t)
        return pk.bearing_forces(disk, *x, ddphi=ddphi).force_magnitude.max("bearing")

    orbit = pk.periodic_orbit(driven, [phi, 0.0], settle=60.0 / natural)
    branch = pk.continuation(
        driven, "forcing_amplitude", orbit=orbit, span=(10.0, 29.0), record={"load": load}
    )
    (doubling,) = branch.special("PD")
    assert doubling.status == "converged"
    # The multiplier -1, by another integrator.
    force, one = doubling["forcing_amplitude"], doubling.orbit

    def f(t, z):
        x, v = z[:2]
        sin, cos = np.sin(x), np.cos(x)
        bend = A * (cos**2 - sin**2) - B * cos - C * sin
        ddphi = A * sin * cos - B * sin + C * cos - damping * v + force * np.cos(w * t)
        u = z[2:].reshape(2, 2)
        return [v, ddphi, *u[1], *(bend * u[0] - damping * u[1])]

    start = [one.phi.values[0], one.dphi.values[0], 1, 0, 0, 1]
    end = solve_ivp(f, (0, 2 * np.pi / w), start, "DOP853", rtol=1e-12, atol=1e-12).y[:, -1]
    assert np.allclose(end[:2], start[:2], atol=1e-8)
    assert np.min(np.abs(np.linalg.eigvals(end[2:].reshape(2, 2)) + 1.0)) < 1e-7
    doubled = doubling.switch()
    assert doubled.stops[0].reason == "period_doubling"
    assert doubled.points.sizes["point"] > 5
    assert np.allclose(doubled.points.period, 4 * np.pi / w, rtol=1e-12)
    i = len(branch.path) // 2
    at = branch.orbit(i)
    states = np.stack([at.phi.values, at.dphi.values])
    peak = load(states, at.time.values, float(at.forcing_amplitude)).max().item()
    assert np.isclose(branch.points.load_max[i], peak, rtol=2e-4)
    assert float(branch.points.load_max[i]) >= peak


def test_a_state_that_rests_does_not_hide_a_homoclinic_orbit():
    """Periodic orbits next to a Bogdanov-Takens point, beside a state that stays zero."""
    system = pk.Problem(["y", "a + b*y + x**2 + x*y", "-z"], ("x", "y", "z"), {"a": -1.0, "b": 0.9})
    (hopf,) = pk.continuation(system, "b", x0=[-1.0, 0.0, 0.0], span=(0.3, 2.0)).special("H")
    branch = hopf.switch()
    assert [stop.reason for stop in branch.stops] == ["hopf", "homoclinic"]
    assert abs(float(branch.points.b[-1]) - 0.74344426632) < 1e-9


def test_a_family_that_begins_at_its_fold_holds_it():
    square = "(x**2 + y**2)"
    problem = pk.Problem(
        [f"x*(m + {square} - {square}**2) - y", f"y*(m + {square} - {square}**2) + x"],
        ("x", "y"), {"m": -0.1},
    )  # fmt: skip
    orbit = pk.periodic_orbit(problem, [1.0, 0.0])
    (fold,) = pk.continuation(problem, "m", orbit=orbit, span=(-0.5, 0.5)).special("LPC")
    begin = problem.replace(m=fold["m"])
    again = pk.continuation(begin, "m", orbit=fold.orbit, span=(-0.5, 0.5))
    (same,) = again.special("LPC")
    assert abs(same["m"] + 0.25) < 1e-10


@pytest.mark.parametrize("rest", [[1e-5, 2.0], [-3.0, 1e-7]])
def test_a_state_that_rests_next_to_zero_swings_all_the_same(rest):
    problem = normal_form(2).replace(c0=rest[0], c1=rest[1], l=-0.3, p=0.0, a=0.5)
    (hopf,) = pk.continuation(problem, "l", x0=rest, span=(-0.3, 0.6)).special("H")
    branch = hopf.switch()
    assert [stop.reason for stop in branch.stops] == ["hopf", "bound"]
    half = 0.5 * (branch.points.x_max - branch.points.x_min)
    assert np.allclose(half, np.sqrt(np.maximum(branch.points.l, 0.0) / 0.5), rtol=1e-7, atol=1e-9)
    assert 10 < branch.points.sizes["point"] < 100
