"""One orbit over 1,000 periods, and the periods and actions of 10^6 orbits, beside their rivals.

Run with ``pytest tests/benchmarks/bench_orbits.py``; the tables are printed. Ratios within one run
are what carries over between machines. The rivals stand in ``rivals_orbits``; heyoka is optional.
Times are CPU times of one thread; only the row with the default number of threads is wall time.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from importlib.util import find_spec
from typing import Any

import mpmath as mp
import numpy as np
import pytest
from benchmarks import rivals_orbits as rivals
from scipy.optimize import brentq

from phasekit.phase.exact.flow import flow
from phasekit.phase.exact.orbits import orbits

Orbits = tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray, np.ndarray]
Row = tuple[float, np.ndarray, np.ndarray | None]

EIGHT = (1.3, 0.2, 0.15)
GAP = 1e-6
PERIODS, OUTPUTS = 1_000, 2_001
HEYOKA = find_spec("heyoka") is not None


def cost(
    run: Callable[[], Any], repeats: int = 3, clock: Callable[[], float] = time.thread_time
) -> tuple[float, Any]:
    """Least time of a few runs, and the result."""
    times = []
    for _ in range(repeats):
        start = clock()
        result = run()
        times.append(clock() - start)
    return min(times), result


# One orbit --------------------------------------------------------------------


def start_in_the_well(below: Callable[[float], float]) -> tuple[rivals.Orbit, float]:
    """An orbit in the right well of the figure-eight, and how far below its saddle it stands.

    ``below`` gives that distance in energy from the depth of the well.
    """
    bottom = brentq(lambda phi: rivals.slope(*EIGHT, phi), 0.5, 2.5, xtol=1e-15)
    saddle = brentq(lambda phi: rivals.slope(*EIGHT, phi), -0.5, 0.5, xtol=1e-15)
    top = float(rivals.potential(*EIGHT, saddle))
    phi0 = bottom + 0.3
    energy = top - below(top - float(rivals.potential(*EIGHT, bottom)))
    dphi0 = float(np.sqrt(2.0 * (energy - rivals.potential(*EIGHT, phi0))))
    orbit = (*EIGHT, phi0, dphi0)
    return orbit, top - float(rivals.potential(*EIGHT, phi0)) - 0.5 * dphi0 * dphi0


def sample_times(period: float) -> np.ndarray:
    """Outputs at all phases of the motion, none at a turn or half a period from the start."""
    return (np.arange(OUTPUTS) + np.sqrt(2.0) - 1.0) * (PERIODS / OUTPUTS) * period


@pytest.mark.parametrize("name", ["halfway up the well", f"{GAP:g} below the separatrix"])
def test_one_orbit_over_a_thousand_periods(name: str, capsys: pytest.CaptureFixture[str]) -> None:
    near = name.endswith("separatrix")
    orbit, gap = start_in_the_well(lambda depth: GAP if near else 0.5 * depth)
    with mp.workdps(50):
        period = float(rivals.exact_period(orbit))
    t = sample_times(period)
    halves = 2.0 * t / period
    clearance = 0.5 * float(np.min(np.abs(halves - np.round(halves))))
    truth = rivals.exact_motion(orbit, t)

    flow(*orbit, t, threads=1)
    rows: dict[str, tuple[float, np.ndarray] | None] = {
        "phasekit flow, 1 thread": cost(lambda: flow(*orbit, t, threads=1).motion_phi, 20),
        "closed form with scipy.special.ellipj": cost(
            lambda: rivals.motion_by_ellipj(orbit, t), 20
        ),
        "heyoka, compiled": None,
        "SciPy DOP853, rtol 2.3e-14": cost(lambda: rivals.motion_by_dop853(orbit, t), 1),
    }
    if HEYOKA:
        motion = rivals.heyoka_motion(orbit)
        rows["heyoka, compiled"] = cost(lambda: motion(t), 5)
    base = next(iter(rows.values()))[0]
    with capsys.disabled():
        print(f"\n\none orbit {name}: {OUTPUTS} outputs over {PERIODS} periods")
        print(f"A, B, C, phi0, dphi0 = {', '.join(f'{float(value)!r}' for value in orbit)}")
        print(f"h_s - h = {gap:.4g}, T = {period:.6g}")
        print(f"no output nearer than {clearance:.1e} T to a multiple of T/2")
        print("method                                      ms   x phasekit   max error of phi")
        for method, row in rows.items():
            if row is None:
                print(f"{method:36}   not installed")
                continue
            error = float(np.max(np.abs(np.remainder(row[1] - truth + np.pi, 2.0 * np.pi) - np.pi)))
            print(f"{method:37} {row[0] * 1e3:8.3g} {row[0] / base:12.1f} {error:18.1e}")
        print("errors: at all outputs, from Taylor series of 50 digits and the exact period")


# Many orbits ------------------------------------------------------------------


def random_orbits(size: int, *, rest: bool) -> Orbits:
    """Systems with A of both signs; orbits of all kinds, or starting at rest (all librations)."""
    rng = np.random.default_rng(2015)
    a, b, c = rng.normal(size=(3, size))
    phi0 = rng.uniform(-np.pi, np.pi, size)
    return a, b, c, phi0, np.zeros(size) if rest else rng.normal(size=size)


def exact_periods(systems: Orbits) -> np.ndarray:
    with mp.workdps(50):
        return np.array([float(rivals.exact_period(one)) for one in zip(*systems, strict=True)])


def spread(values: np.ndarray | None, wanted: np.ndarray) -> str:
    """Median and largest relative deviation."""
    if values is None:
        return f"{'':8} {'':8}"
    size = min(values.size, wanted.size)
    off = np.abs(values[:size] / wanted[:size] - 1.0)
    return f"{np.median(off):8.0e} {np.max(off):8.0e}"


@pytest.mark.parametrize("rest", [False, True], ids=["moving", "at rest"])
def test_periods_and_actions_of_a_million_orbits(
    rest: bool, capsys: pytest.CaptureFixture[str]
) -> None:
    size, some, few, checked = 1_000_000, 20_000, 20, 200
    systems = random_orbits(size, rest=rest)

    def first(count: int) -> Orbits:
        return tuple(values[:count] for values in systems)

    def row(
        run: Callable[..., rivals.Periods],
        count: int,
        repeats: int = 3,
        clock: Callable[[], float] = time.thread_time,
    ) -> Row:
        spent, found = cost(lambda: run(*first(count)), repeats, clock)
        return spent / count, *found

    def phasekit(threads: int | None) -> Callable[..., rivals.Periods]:
        def run(*start: np.ndarray) -> rivals.Periods:
            found = orbits(*start, threads=threads)
            return found.period, found.action

        return run

    phasekit(1)(*first(few))
    rows: dict[str, Row | None] = {
        "phasekit orbits, 1 thread": row(phasekit(1), size),
        "phasekit orbits, default threads": row(phasekit(None), size, 3, time.perf_counter),
        "NumPy cubic, elliprf: periods alone": row(rivals.periods_by_elliprf, size),
    }
    if rest:
        rows["the same, elliprj, elliprd: actions"] = row(rivals.actions_by_elliprj, size, 1)
    rows[f"heyoka batches, on {some}"] = None
    if HEYOKA:
        rows[f"heyoka batches, on {some}"] = row(rivals.heyoka_periods(rest=rest), some)
    rows[f"SciPy DOP853 with events, on {few}"] = row(
        lambda *start: rivals.periods_by_dop853(*start, rest=rest), few, 1
    )
    truth = exact_periods(first(checked))
    base, period, action = next(iter(rows.values()))
    with capsys.disabled():
        what = "librations from rest" if rest else "librations and rotations"
        print(f"\n\nperiods and actions of {size} orbits: {what}")
        print(f"{'':64}relative deviation, median and largest")
        print(f"{'method':36} {'us/orbit':>8}  x phasekit", end="")
        print(f"  {'T, 50 digits':>17} {'T, phasekit':>17} {'J, phasekit':>17}")
        for method, one in rows.items():
            if one is None:
                print(f"{method:35}   not installed")
                continue
            print(
                f"{method:36} {one[0] * 1e6:8.3g} {one[0] / base:11.1f}  "
                f"{spread(one[1], truth)} {spread(one[1], period)} {spread(one[2], action)}"
            )
        print(f"50 digits: the first {checked} orbits (or as many as the method was given)")
