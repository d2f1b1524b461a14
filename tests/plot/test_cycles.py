"""Branches of periodic orbits, drawn."""

from __future__ import annotations

import numpy as np
import pytest

import phasekit as pk


def test_largest_and_least_values_with_stability(ax):
    rate = "(p + x**2 + y**2 - (x**2 + y**2)**2)"
    system = pk.Problem([f"x*{rate} - y", f"y*{rate} + x"], ("x", "y"), {"p": -0.5})
    rest = pk.continuation(system, "p", x0=[0.0, 0.0], span=(-0.5, 0.5))
    cycles = rest.special("H")[0].switch()
    assert pk.plot.branch([rest, cycles], ax=ax) is ax
    drawn = [line for line in ax.lines if len(line.get_xdata()) > 3]
    values = np.concatenate([line.get_ydata() for line in drawn])
    assert np.isclose(np.nanmax(values), float(cycles.points.x_max.max()))
    assert np.isclose(np.nanmin(values), float(cycles.points.x_min.min()))
    labels = [text.get_text() for text in ax.get_legend().get_texts()]
    assert {"stable", "unstable", "LPC"} <= set(labels)
    ax.clear()
    cycles.plot(ax=ax, y="period")
    assert ax.get_ylabel() == "period of the orbit"


def test_multipliers_are_shown_beside_the_unit_circle(ax):
    pendulum = pk.Perturbed(pk.Pendulum(length=1.0, g=1.0), damping=0.1, torque=0.5)
    orbit = pk.periodic_orbit(pendulum, [0.0, 5.0])
    family = pk.continuation(pendulum, "torque", orbit=orbit, span=(0.4, 0.8))
    assert pk.plot.multipliers(family, ax=ax) is ax
    (dots,) = (one for one in ax.collections if len(one.get_offsets()))
    x, y = dots.get_offsets().T
    found = family.points["multiplier"].values
    assert np.array_equal(x + 1j * y, found.ravel())
    assert np.array_equal(dots.get_array(), np.repeat(family.points.torque.values, 2))
    (circle,) = ax.lines
    np.testing.assert_allclose(np.hypot(*circle.get_data()), 1.0, rtol=1e-15)
    assert ax.get_aspect() == 1.0
    low, high = ax.get_xlim()
    assert low <= -1.0 < x.max() <= high
    with pytest.raises(pk.ParameterError, match="^branch: got"):
        pk.plot.multipliers(orbit)


def test_one_family_alone(ax):
    system = pk.Problem(["y", "mu*(1 - x**2)*y - x"], ("x", "y"), {"mu": 0.5})
    few = pk.ContinuationOptions(max_points=3, intervals=10)
    orbit = pk.periodic_orbit(system, [2.0, 0.0], options=few)
    cycles = pk.continuation(system, "mu", orbit=orbit, span=(0.4, 0.6), options=few)
    cycles.plot(ax=ax)
    values = np.concatenate([line.get_ydata() for line in ax.lines])
    assert np.isclose(np.nanmax(values), float(cycles.points.x_max.max()))
