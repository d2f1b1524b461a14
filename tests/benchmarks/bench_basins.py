"""Basins beside a loop of SciPy's DOP853, and a map of Lyapunov exponents: CPU time in one run.

Run with ``pytest tests/benchmarks/bench_basins.py -s``. SciPy follows some of the states at the
same tolerance, for as long as it took until they were caught, and is counted for all of them.
"""

from __future__ import annotations

import os
import time
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import phasekit as pk

pytestmark = pytest.mark.filterwarnings("ignore:basin. :RuntimeWarning")
SOME = 60
PLACES = np.exp(2j * np.pi * np.arange(3) / 3)


def magnets() -> Any:
    """Three magnets under a pendulum."""
    terms = [f"/sqrt((x - ({m.real!r}))^2 + (y - ({m.imag!r}))^2 + d^2)^3" for m in PLACES.tolist()]
    pull = {
        v: " ".join(f"- ({v} - ({getattr(m, part)!r})){t}"
                    for m, t in zip(PLACES.tolist(), terms, strict=True))
        for v, part in (("x", "real"), ("y", "imag"))
    }  # fmt: skip
    return pk.Problem(
        {"x": "u", "y": "v", "u": f"-w^2*x - a*u {pull['x']}", "v": f"-w^2*y - a*v {pull['y']}"},
        parameters={"w": 0.8, "a": 0.2, "d": 0.2},
    )


def drawn(t: float, s: Any) -> Any:
    """The same by hand."""
    z, w = s[0] + 1j * s[1], s[2] + 1j * s[3]
    force = -0.64 * z - 0.2 * w
    for m in PLACES:
        force -= (z - m) / (abs(z - m) ** 2 + 0.04) ** 1.5
    return [s[2], s[3], force.real, force.imag]


def duffing() -> Any:
    """A driven well."""
    return pk.Problem(
        {"x": "v", "v": "x - x^3 - d*v + F*cos(w*t)"},
        parameters={"d": 0.15, "F": 0.1, "w": 1.0}, time="t", period="2*pi/w",
    )  # fmt: skip


def driven(t: float, s: Any) -> Any:
    """The same by hand."""
    return [s[1], s[0] - s[0] ** 3 - 0.15 * s[1] + 0.1 * np.cos(t)]


def cpu(call: Callable[[], Any]) -> tuple[float, Any]:
    """CPU seconds of a call, those of its workers among them, and what it returned."""
    begun = sum(os.times()[:4])
    found = call()
    return sum(os.times()[:4]) - begun, found


@pytest.mark.parametrize("name", ["Duffing", "magnets"])
def test_basins(name, capsys):
    axis = np.linspace(-2.0, 2.0, 201)
    if name == "Duffing":
        law, rates, grid, more = duffing(), driven, {"x": axis, "v": axis}, {}
    else:
        law, rates, grid = magnets(), drawn, {"x": axis, "y": axis}
        more = {"fixed": {"u": 0.0, "v": 0.0}}
    few = {key: values[::20] for key, values in grid.items()}
    pk.basins(law, few, **more)
    seconds, ds = cpu(lambda: pk.basins(law, grid, **more))
    times = ds.basin_time.values
    chosen = np.random.default_rng(0).permutation(np.argwhere(np.isfinite(times)))[:SOME]

    def loop():
        for i, j in chosen:
            start = [axis[i], axis[j], *([0.0, 0.0] if more else [])]
            solve_ivp(rates, (0.0, times[i, j]), start, "DOP853", rtol=1e-10, atol=1e-12)

    other = cpu(loop)[0] * times.size / SOME
    with capsys.disabled():
        print(f"\n{name}: 201 x 201 states {seconds:.2f} s, SciPy {other:.0f} s, ratio "
              f"{other / seconds:.0f}; shares {ds.basin_fraction.values.round(4)}")  # fmt: skip


def test_exponents_over_two_parameters(capsys, tmp_path):
    """100 x 100 exponents of the driven well over 200 periods, on all cores, with a bar."""
    law = duffing()
    axes = {"F": np.linspace(0.05, 0.5, 100), "w": np.linspace(0.6, 1.4, 100)}
    how = {"of": "lyapunov", "x": 0.5, "v": 0.0, "duration": 1000.0}
    pk.sweep(law, F=axes["F"][:2], w=axes["w"][:2], **how)
    begun = time.perf_counter()
    seconds, ds = cpu(lambda: pk.sweep(law, axes, progress=True, **how))
    waited = time.perf_counter() - begun
    chaos = (ds.lyapunov_exponent[..., 0] > 3 * ds.lyapunov_error[..., 0]).mean().item()
    with capsys.disabled():
        print(f"\n100 x 100 exponents to t = 1000: {waited:.1f} s on the clock, {seconds:.1f} s of "
              f"CPU; {chaos:.3f} of them surely positive")  # fmt: skip
