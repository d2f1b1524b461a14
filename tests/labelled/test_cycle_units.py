"""Families of periodic orbits in other units: the same ones, with their numbers scaled."""

from __future__ import annotations

import functools

import numpy as np
import pytest
from scipy.special import ellipk
from witnesses.variants import some

import phasekit as pk

UNITS = {
    "states, small": (1e-9, 1e-9, 1.0, 1.0),
    "states, large": (1e9, 1e9, 1.0, 1.0),
    "time, short": (1.0, 1.0, 1e-9, 1.0),
    "time, long": (1.0, 1.0, 1e9, 1.0),
    "parameter, small": (1.0, 1.0, 1.0, 1e-9),
    "parameter, large": (1.0, 1.0, 1.0, 1e9),
    "each another": (1e9, 1.0, 1e-9, 1e9),
}


@functools.cache
def reaction(a, b, t, q):
    """The family of the reaction with u1 in units of 1/a, u2 of 1/b, time of 1/t, p1 of 1/q."""
    u, v, p = f"(u1/{a!r})", f"(u2/{b!r})", f"(p1/{q!r})"
    problem = pk.Problem(
        [
            f"{a / t!r}*(-{u} + {p}*(1 - {u})*exp({v}))",
            f"{b / t!r}*(-{v} + {p}*14*(1 - {u})*exp({v}) - 3*{v})",
        ],
        ("u1", "u2"), {"p1": 0.1 * q},
    )  # fmt: skip
    rest = pk.continuation(problem, "p1", x0=[0.1 * a, 0.5 * b], span=(0.05 * q, 0.5 * q))
    return rest.special("H")[0].switch()


@pytest.mark.parametrize("units", some(UNITS.values(), 2), ids=some(UNITS, 2))
def test_the_reaction_in_other_units(units):
    a, b, t, q = units
    one, other = reaction(1.0, 1.0, 1.0, 1.0), reaction(*units)
    assert [stop.reason for stop in other.stops] == ["hopf", "hopf"]
    assert [s.kind for s in other.special_points] == ["end", "fold_of_cycles", "end"]
    assert other.points.sizes["point"] == one.points.sizes["point"] > 3
    for name, unit in (("p1", q), ("period", t), ("u1_max", a), ("u2_mean", b)):
        assert np.allclose(other.points[name] / unit, one.points[name], rtol=1e-8, atol=0.0)
    (fold,), (same,) = one.special("LPC"), other.special("LPC")
    assert same["p1"] / q == pytest.approx(fold["p1"], rel=1e-12)
    assert same["p1"] / q == pytest.approx(0.161696128898, rel=1e-11)
    assert same["period"] / t == pytest.approx(fold["period"], rel=1e-9)
    if a == b:  # a length of both states
        assert abs(same.normal_form["a"]) * a * t == pytest.approx(
            abs(fold.normal_form["a"]), rel=1e-7
        )
        assert abs(same.normal_form["b"]) * t * q / a == pytest.approx(
            abs(fold.normal_form["b"]), rel=1e-7
        )


@pytest.mark.parametrize("t", [1e-6, 1e6])
def test_a_forced_function_in_other_units_of_time(t):
    """Its derivative by time is a difference over a part of the period."""

    def duffing(x, d, w, F, s):
        return [x[1] / t, (F * np.cos(w * s) - d * x[1] - x[0] - x[0] ** 3) / t]

    problem = pk.Problem(
        duffing, ("x", "v"), {"w": 0.9 / t, "d": 0.04, "F": 0.015}, time="s", period="2*pi/w"
    )
    options = pk.ContinuationOptions(intervals=20, max_step=0.2)
    rest = pk.periodic_orbit(problem, [0.0, 0.0], options=options)
    response = pk.continuation(problem, "w", orbit=rest, span=(0.9 / t, 1.2 / t), options=options)
    folds = [fold["w"] * t for fold in response.special("LPC")]
    assert len(folds) == 2
    assert np.allclose(sorted(folds), [1.043913708797, 1.049262399236], rtol=1e-8, atol=0.0)


@pytest.mark.parametrize("t", [1e-12, 1e9])
def test_a_conservative_family_in_other_units_of_time(t):
    well = pk.Problem([f"v/{t!r}", f"-g*sin(x)/{t!r}"], ("x", "v"), {"g": 1.0}, conservative=True)
    first = pk.periodic_orbit(well, [1.0, 0.0], 6.7 * t)
    exact = 6.699975664370451  # 4 K(sin^2(1/2))
    assert float(first.period) / t == pytest.approx(exact, rel=1e-10)
    family = pk.continuation(well, "period", orbit=first, span=(1.0 * t, 9.0 * t))
    assert [stop.reason for stop in family.stops] == ["hopf", "bound"]
    assert float(family.points.period[0]) / t == pytest.approx(2 * np.pi, rel=1e-3)
    alike = pk.continuation(well, "g", orbit=first, span=(0.9, 1.1), fix="period")
    assert [stop.reason for stop in alike.stops] == ["bound", "bound"]
    top, g = alike.points.x_max.values, alike.points.g.values
    assert len(top) > 3
    assert np.allclose(4.0 * ellipk(np.sin(top / 2) ** 2), exact * np.sqrt(g), rtol=1e-8, atol=0.0)


@pytest.mark.parametrize("t", [1.0, 1e9])
def test_energy_that_is_lost_is_noticed_in_any_units_of_time(t):
    damped = pk.Problem(
        [f"v/{t!r}", f"-(sin(x) + g*v)/{t!r}"], ("x", "v"), {"g": 1e-4}, conservative=True
    )
    with pytest.raises(pk.ConvergenceError, match="not conserved"):
        pk.periodic_orbit(damped, [1.0, 0.0], 6.7 * t)


@pytest.mark.parametrize("size", [1e-9, 1e-6, 1e6, 1e9])
@pytest.mark.parametrize("start", [2.0, 0.01])
def test_states_of_different_units(size, start):
    # Without scales: those in which the slopes of f balance.
    uneven = pk.Problem(["y/s", "(mu - x**2)*y - x*s"], ("x", "y"), {"mu": 1.0, "s": size})
    orbit = pk.periodic_orbit(uneven, [start, 0.0])
    assert float(orbit.period) == pytest.approx(6.66328685932, rel=1e-11)  # Amore
    if start == 2.0:
        cycles = pk.continuation(uneven, "mu", orbit=orbit, span=(0.5, 1.5))
        assert [stop.reason for stop in cycles.stops] == ["bound", "bound"]
        assert cycles.points.sizes["point"] > 3
        assert np.all(cycles.points.liouville_error < 1e-7)
        alike = pk.periodic_orbit(uneven.replace(mu=1.5), [2.0, 0.0])
        last = int(cycles.points.mu.argmax("point"))
        assert float(cycles.points.period[last]) == pytest.approx(float(alike.period), rel=1e-9)


def test_times_of_cycles_and_sections_have_the_unit_of_time():
    """Of states whose units are known and whose meaning is not."""
    neuron = pk.Problem(
        {"v": "v - v^3/3 - w + I", "w": "0.08*(v + 0.7 - 0.8*w)"},
        parameters={"I": 0.5},
        window={"v": (-2.5, 2.5), "w": (-1, 2)},
    )
    neuron = neuron.described({"time": {"units": "ms"}, "v": {"units": "mV"}})
    found = pk.periodic_orbits(neuron)
    section = pk.poincare_section(neuron, x0=[0.0, 0.0], section="v", n=2)
    for values in (found.period, found.period_error, found.cycle_time, section.section_time):
        assert values.attrs["units"] == "ms"
    rest = pk.continuation(neuron, "I", span=(0.0, 0.5))
    few = pk.extend.ContinuationOptions(max_points=3)
    with pytest.warns(RuntimeWarning, match="max_points = 3"):
        greatest = rest.special("hopf")[0].switch(options=few).points.v_max
    assert greatest.attrs == {"long_name": "largest v", "units": "mV"}
