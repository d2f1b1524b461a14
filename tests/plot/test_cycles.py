"""Branches of periodic orbits, drawn."""

from __future__ import annotations

import numpy as np

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


def test_one_family_alone(ax):
    system = pk.Problem(["y", "mu*(1 - x**2)*y - x"], ("x", "y"), {"mu": 0.5})
    few = pk.ContinuationOptions(max_points=3, intervals=10)
    orbit = pk.periodic_orbit(system, [2.0, 0.0], options=few)
    cycles = pk.continuation(system, "mu", orbit=orbit, span=(0.4, 0.6), options=few)
    cycles.plot(ax=ax)
    values = np.concatenate([line.get_ydata() for line in ax.lines])
    assert np.isclose(np.nanmax(values), float(cycles.points.x_max.max()))
