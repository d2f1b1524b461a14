"""Planar systems as a textbook has them: limit cycles, sections, portraits.

Run with ``pytest tests/benchmarks/bench_planar.py -s``; CPU times of the second call of a process.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Any

import matplotlib.pyplot as plt
import numpy as np
from scipy.integrate import solve_ivp

import phasekit as pk

SYSTEMS = {
    "van der Pol": pk.Problem(
        {"x": "y", "y": "mu*(1 - x^2)*y - x"}, parameters={"mu": 1.0},
        window={"x": (-4, 4), "y": (-6, 6)},
    ),
    "three circles": pk.Problem(
        {
            v: f"{turn} + {v}*(1 - r2)*(4 - r2)*(9 - r2)/100"
            for v, turn in (("x", "-y"), ("y", "x"))
        },
        definitions={"r2": "x^2 + y^2"}, window={"x": (-4, 4), "y": (-4, 4)},
    ),
    "FitzHugh-Nagumo": pk.Problem(
        {"v": "v - v^3/3 - w + I", "w": "eps*(v + a - b*w)"},
        parameters={"I": 0.325, "eps": 0.08, "a": 0.7, "b": 0.8},
        window={"v": (-2.5, 2.5), "w": (-1.0, 2.0)},
    ),
    "the same, stiff": pk.Problem(
        {"v": "v - v^3/3 - w + I", "w": "eps*(v + a - b*w)"},
        parameters={"I": 0.5, "eps": 0.001, "a": 0.7, "b": 0.8},
        window={"v": (-2.5, 2.5), "w": (-1.0, 2.0)},
    ),
    "driven pendulum": pk.Problem(
        {"phi": "w", "w": "I - al*w - sin(phi)"}, parameters={"al": 0.1, "I": 0.5},
        periods={"phi": 2.0 * np.pi}, window={"w": (-8, 8)},
    ),
    "double well": pk.Problem(
        {"x": "v", "v": "x - x^3 - d*v"}, parameters={"d": 0.2},
        window={"x": (-2, 2), "v": (-2, 2)},
    ),
}  # fmt: skip


def spent(function: Callable[[], Any]) -> float:
    """CPU seconds of the second call."""
    function()
    begun = time.process_time()
    function()
    return time.process_time() - begun


def test_cycles_and_portraits():
    print("\n                     cycles    portrait  (CPU s)")
    for name, system in SYSTEMS.items():
        cycles = spent(lambda system=system: pk.periodic_orbits(system))
        portrait = spent(lambda system=system: pk.plot.phase_portrait(system).figure.canvas.draw())
        plt.close("all")
        print(f"{name:18} {cycles:8.3f} {portrait:10.3f}")


def test_sections_beside_scipy():
    """Lorenz's section z = r - 1 over 50 units of time, from a thousand states."""
    lorenz = pk.Problem(
        {"x": "10*(y - x)", "y": "x*(28 - z) - y", "z": "x*y - 8*z/3"}
    )  # fmt: skip
    states = np.random.default_rng(0).uniform([-10, -10, 10], [10, 10, 40], (1000, 3))
    start = dict(zip("xyz", states.T, strict=True))
    how = {"section": "z - 27", "duration": 50.0, "direction": -1}
    ours = spent(lambda: pk.poincare_section(lorenz, start, **how)) / 1000

    def f(_, x):
        return [10 * (x[1] - x[0]), x[0] * (28 - x[2]) - x[1], x[0] * x[1] - 8 * x[2] / 3]

    def plane(_, x):
        return x[2] - 27.0

    def scipys():
        for start in states[:3]:
            solve_ivp(f, (0, 50), start, method="DOP853", rtol=1e-10, atol=1e-12, events=plane)

    theirs = spent(scipys) / 3
    print(f"\nsections: {1e3 * ours:.2f} ms a motion, SciPy {theirs / ours:.0f} times as long")
