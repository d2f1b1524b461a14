"""Basins of 10^6 states over 100 periods of driven oscillators, beside integrators of others.

Run with ``pytest tests/benchmarks/bench_motion.py -s``; the tables are printed, beside times over
those that phasekit takes for the same error, interpolated between its tolerances. A part of the
states is followed and the time extrapolated; the error is the median over the sample after ten
periods, against a tolerance of 1e-14. Times are CPU times of one thread, the least of three. heyoka
is optional.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from importlib.util import find_spec
from typing import Any

import numba
import numpy as np
import pytest
from scipy.integrate import solve_ivp

import phasekit as pk
from phasekit.motion.strobe import Steps, strobe

SAMPLE, FEW, PERIODS, WHOLE = 2_000, 6, 100, 1_000_000
PERIOD = 2.0 * math.pi
WELL = pk.Potential("x^4/4 - x^2/2", "x")
DUFFING = pk.Perturbed(WELL, damping=0.15, forcing=pk.Harmonic(0.2, 1.0))
EIGHT = pk.Coefficients(1.0, 0.35, 0.12)
DISK = pk.Perturbed(EIGHT, damping=0.1, forcing=pk.Harmonic(0.3, 1.0))
STATES = np.random.default_rng(0).uniform(-2.2, 2.2, (SAMPLE, 2))
HEYOKA = find_spec("heyoka") is not None

Run = Callable[[np.ndarray, int], np.ndarray]


def duffing(x: Any, v: Any, cos: Any, sin: Any, t: Any) -> Any:
    return x - x**3 - 0.15 * v + 0.2 * cos(t)


def disk(x: Any, v: Any, cos: Any, sin: Any, t: Any) -> Any:
    return (cos(x) - 0.35) * sin(x) + 0.12 * cos(x) - 0.1 * v + 0.3 * cos(t)


def ours(system: pk.Perturbed, tolerance: float, series: bool = True) -> Run:
    law = system.law
    values = law.values(*system.parameters.values())

    def run(states: np.ndarray, periods: int) -> np.ndarray:
        steps = Steps(tolerance, tolerance, series)
        found = strobe(law, values, states, PERIOD, 1, periods, steps=steps, threads=1)
        return found.states[:, 0]

    return run


def scipy_loop(force: Any) -> Run:
    def rates(t: float, x: np.ndarray) -> list[float]:
        return [x[1], force(x[0], x[1], math.cos, math.sin, t)]

    def run(states: np.ndarray, periods: int) -> np.ndarray:
        ends = [
            solve_ivp(rates, (0.0, periods * PERIOD), x, "DOP853", rtol=1e-10, atol=1e-10).y[:, -1]
            for x in states
        ]
        return np.array(ends)

    return run


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


def heyoka_batches(force: Any, tolerance: float) -> Run:
    import heyoka as hy

    x, v = hy.make_vars("x", "v")
    law = [(x, v), (v, force(x, v, hy.cos, hy.sin, hy.time))]
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


def cost(run: Run, count: int, best: np.ndarray) -> tuple[float, float]:
    """Hours for all states, and error."""
    run(STATES[:8], 1)
    error = float(np.median(np.abs(run(STATES[:count], 10) - best[:count]).max(axis=1)))
    seconds = []
    for _ in range(3 if count > FEW else 1):
        start = time.process_time()
        run(STATES[:count], PERIODS)
        seconds.append(time.process_time() - start)
    return min(seconds) / count * WHOLE / 3600.0, error


@pytest.mark.parametrize(("system", "force"), [(DUFFING, duffing), (DISK, disk)])
def test_basins_of_a_million_states(system: pk.Perturbed, force: Any) -> None:
    best = ours(system, 1e-14)(STATES, 10)
    tolerances = (1e-6, 1e-8, 1e-10, 1e-12)
    rows: list[tuple[str, Run, int]] = [
        *((f"phasekit, {tol:g}", ours(system, tol), SAMPLE) for tol in tolerances),
        ("phasekit, DOP853, 1e-10", ours(system, 1e-10, series=False), SAMPLE // 4),
        ("solve_ivp DOP853, 1e-10", scipy_loop(force), FEW),
    ]
    if force is duffing:
        rows += [(f"numba RK4, {n} steps", rk4(n), SAMPLE // 10) for n in (100, 1000)]
    if HEYOKA:
        rows += [(f"heyoka, {t:g}", heyoka_batches(force, t), SAMPLE) for t in tolerances]
    title = f"{force.__name__}, 10^6 states over 100 periods"
    print(f"\n{title:42}{'hours':>8}{'error':>9}{'times':>8}")
    known = []
    for name, run, count in rows:
        hours, error = cost(run, count, best)
        known += [(math.log(error), hours)] if len(known) < len(tolerances) else []
        times = hours / float(np.interp(math.log(error), *zip(*known[::-1], strict=True)))
        print(f"{name:42}{hours:8.4f}{error:9.1e}{times:8.1f}")
        assert error < 1e-3
