"""Basins of 10^6 states over 100 periods of a driven oscillator, beside integrators of others.

Run with ``pytest tests/benchmarks/bench_motion.py -s``; the table is printed. A part of the states
is followed and the time extrapolated; the error is the median over the sample after ten periods,
against a tolerance of 1e-14. Times are CPU times of one thread. heyoka is optional.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from importlib.util import find_spec
from typing import Any

import numba
import numpy as np
from scipy.integrate import solve_ivp

import phasekit as pk
from phasekit.motion.strobe import strobe

SAMPLE, FEW, PERIODS, WHOLE = 2_000, 6, 100, 1_000_000
PERIOD = 2.0 * math.pi
WELL = pk.Potential("x^4/4 - x^2/2", "x")
DRIVEN = pk.Perturbed(WELL, damping=0.15, forcing=pk.Harmonic(0.2, 1.0))
STATES = np.random.default_rng(0).uniform(-2.2, 2.2, (SAMPLE, 2))
HEYOKA = find_spec("heyoka") is not None

Run = Callable[[np.ndarray, int], np.ndarray]


def ours(tolerance: float) -> Run:
    law = DRIVEN.law
    values = law.values(*DRIVEN.parameters.values())

    def run(states: np.ndarray, periods: int) -> np.ndarray:
        how: dict[str, Any] = {"rtol": tolerance, "atol": tolerance, "threads": 1}
        return strobe(law, values, states, PERIOD, 1, periods, **how).states[:, 0]

    return run


def scipy_loop(states: np.ndarray, periods: int) -> np.ndarray:
    def rates(t: float, x: np.ndarray) -> list[float]:
        return [x[1], x[0] - x[0] ** 3 - 0.15 * x[1] + 0.2 * math.cos(t)]

    ends = [
        solve_ivp(rates, (0.0, periods * PERIOD), x, "DOP853", rtol=1e-10, atol=1e-10).y[:, -1]
        for x in states
    ]
    return np.array(ends)


@numba.njit(cache=True)
def _rk4(states: np.ndarray, periods: int, steps: int) -> np.ndarray:
    out = np.empty_like(states)
    h = 2.0 * math.pi / steps
    for i in range(states.shape[0]):
        x, v = states[i]
        for n in range(periods * steps):
            t = n * h
            f0, f1, f2 = 0.2 * math.cos(t), 0.2 * math.cos(t + 0.5 * h), 0.2 * math.cos(t + h)
            a1 = x - x**3 - 0.15 * v + f0
            x2, v2 = x + 0.5 * h * v, v + 0.5 * h * a1
            a2 = x2 - x2**3 - 0.15 * v2 + f1
            x3, v3 = x + 0.5 * h * v2, v + 0.5 * h * a2
            a3 = x3 - x3**3 - 0.15 * v3 + f1
            x4, v4 = x + h * v3, v + h * a3
            a4 = x4 - x4**3 - 0.15 * v4 + f2
            x += h / 6.0 * (v + 2.0 * v2 + 2.0 * v3 + v4)
            v += h / 6.0 * (a1 + 2.0 * a2 + 2.0 * a3 + a4)
        out[i] = x, v
    return out


def rk4(steps: int) -> Run:
    return lambda states, periods: _rk4(states, periods, steps)


def heyoka_batches(tolerance: float) -> Run:
    import heyoka as hy

    x, v = hy.make_vars("x", "v")
    law = [(x, v), (v, x - x**3 - 0.15 * v + 0.2 * hy.cos(hy.time))]
    size = hy.recommended_simd_size()
    integrator = hy.taylor_adaptive_batch(law, np.zeros((2, size)), tol=tolerance)

    def run(states: np.ndarray, periods: int) -> np.ndarray:
        out = np.empty_like(states)
        for i in range(0, len(states), size):
            some = states[i : i + size]
            integrator.set_time(0.0)
            integrator.state[:, : len(some)] = some.T
            integrator.propagate_until(periods * PERIOD)
            out[i : i + size] = integrator.state[:, : len(some)].T
        return out

    return run


def test_basins_of_a_million_states() -> None:
    best = ours(1e-14)(STATES, 10)
    rows: list[tuple[str, Run, int]] = [
        *((f"phasekit, {tol:g}", ours(tol), SAMPLE) for tol in (1e-6, 1e-8, 1e-10)),
        ("solve_ivp DOP853, 1e-10", scipy_loop, FEW),
        *((f"numba RK4, {steps} steps", rk4(steps), SAMPLE // 10) for steps in (100, 1000)),
    ]
    if HEYOKA:
        rows += [(f"heyoka, {t:g}", heyoka_batches(t), SAMPLE) for t in (1e-6, 1e-8, 1e-10)]
    print(f"\n{'10^6 states over 100 periods':32}{'hours':>10}{'error, 10 periods':>20}")
    for name, run, count in rows:
        run(STATES[:8], 1)
        error = float(np.median(np.abs(run(STATES[:count], 10) - best[:count]).max(axis=1)))
        start = time.process_time()
        run(STATES[:count], PERIODS)
        hours = (time.process_time() - start) / count * WHOLE / 3600.0
        print(f"{name:32}{hours:10.4f}{error:20.1e}")
        assert error < 1e-3
