"""A map of 10^6 systems, side by side with what a user would write today.

Run with ``pytest tests/benchmarks/bench_map.py``; the tables are printed. Ratios within one run are
what carries over between machines. The methods give, for each system, the number of equilibria,
their angles, V'' and V, and where a figure-eight turns (the batched one only its energy);
phasekit gives frequencies, exponents and areas as well.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from fractions import Fraction

import numpy as np
import pytest
from scipy.optimize import brentq

from phasekit.phase.exact.kernels import phase_space as kernels
from phasekit.phase.exact.phase_space import LOOPS, POINTS, phase_space

Coefficients = tuple[np.ndarray, np.ndarray, np.ndarray]
GRID = np.linspace(-np.pi, np.pi, 201)


def describe(a: float, b: float, c: float, phi: np.ndarray) -> int:
    """What a user does with the angles of one system: kinds, energies, figure-eight; the count."""
    cos, sin = np.cos(phi), np.sin(phi)
    curvature = b * cos - a * (cos * cos - sin * sin) + c * sin
    energy = -b * cos + 0.5 * a * cos * cos - c * sin
    saddles = np.flatnonzero(curvature < 0.0)
    if saddles.size == 2:
        low = saddles[np.argmin(energy[saddles])]
        reach = np.cos(2.0 * phi[low]) + 2.0 * curvature[low] / a
        if abs(reach) <= 1.0:
            _ = -phi[low] + np.arccos(reach), -phi[low] - np.arccos(reach)
    return phi.size


def by_roots(a: float, b: float, c: float) -> int:
    """Quartic in tan(phi/2) by numpy.roots."""
    t = np.roots([c, 2.0 * (b + a), 0.0, 2.0 * (b - a), -c])
    return describe(a, b, c, 2.0 * np.arctan(t[np.abs(t.imag) < 1e-8].real))


def by_brentq(a: float, b: float, c: float) -> int:
    """Sign changes on a grid of 200 cells, refined by SciPy's brentq."""

    def force(phi: float) -> float:
        return (b - a * np.cos(phi)) * np.sin(phi) - c * np.cos(phi)

    values = (b - a * np.cos(GRID)) * np.sin(GRID) - c * np.cos(GRID)
    cells = np.flatnonzero(values[:-1] * values[1:] < 0.0)
    return describe(a, b, c, np.array([brentq(force, GRID[j], GRID[j + 1]) for j in cells]))


def by_eigvals(a: np.ndarray, b: np.ndarray, c: np.ndarray) -> np.ndarray:
    """Batched companion matrices of the quartic in exp(i phi), then two Newton steps; counts."""
    w = b - 1j * c
    companion = np.zeros((a.size, 4, 4), complex)
    companion[:, 1, 0] = companion[:, 2, 1] = companion[:, 3, 2] = 1.0
    companion[:, 0, 3] = 1.0
    companion[:, 1, 3] = -2.0 * np.conj(w) / a
    companion[:, 3, 3] = 2.0 * w / a
    z = np.linalg.eigvals(companion)
    real = np.abs(np.abs(z) - 1.0) < 1e-8
    phi = np.where(real, np.angle(z), np.nan)
    a, b, c = a[:, None], b[:, None], c[:, None]
    for _ in range(2):
        cos, sin = np.cos(phi), np.sin(phi)
        slope = b * cos - a * (cos * cos - sin * sin) + c * sin
        phi = phi - ((b - a * cos) * sin - c * cos) / slope
    cos, sin = np.cos(phi), np.sin(phi)
    curvature = b * cos - a * (cos * cos - sin * sin) + c * sin
    energy = -b * cos + 0.5 * a * cos * cos - c * sin
    low = np.nanmin(np.where(curvature < 0.0, energy, np.inf), axis=1)
    _ = np.arccos(np.clip(low, -1.0, 1.0))
    return real.sum(axis=1)


def exact_count(a: float, b: float, c: float) -> int:
    """Number of equilibria from the discriminant in rational arithmetic (none degenerate here)."""
    a2, b2, c2 = (Fraction(float(value)) ** 2 for value in (a, b, c))
    return 4 if (b2 + c2 - a2) ** 3 + 27 * a2 * b2 * c2 < 0 else 2


def random_systems(size: int) -> Coefficients:
    rng = np.random.default_rng(2015)
    a, b, c = rng.normal(size=(3, size))
    return a, b, c


def systems_next_to_folds_and_cusps(size: int) -> Coefficients:
    rng = np.random.default_rng(2013)
    half = size // 2
    theta = np.append(rng.uniform(0.05, 1.5, half), 10.0 ** rng.uniform(-5, -2, size - half))
    off = 1.0 + rng.choice([-1.0, 1.0], size) * 10.0 ** rng.uniform(-14, -8, size)
    return np.ones(size), np.cos(theta) ** 3 * off, np.sin(theta) ** 3 * off


def seconds(run: Callable[[], object], repeats: int = 3) -> float:
    """Least wall time of a few runs."""
    times = []
    for _ in range(repeats):
        start = time.perf_counter()
        run()
        times.append(time.perf_counter() - start)
    return min(times)


def allocate(size: int) -> tuple[tuple[np.ndarray, ...], ...]:
    return tuple(
        tuple(np.zeros((size, *tail), dtype) for tail, dtype in group) for group in (POINTS, LOOPS)
    )


def test_map_of_a_million_systems(capsys: pytest.CaptureFixture[str]) -> None:
    size, sample = 1_000_000, 2_000
    systems = random_systems(size)
    few = tuple(values[:sample] for values in systems)
    some = tuple(values[:100_000] for values in systems)
    points, loops = allocate(size)
    none = np.empty(0)

    def blocks() -> None:
        kernels.equilibria(*systems, none, 0, size, points)

    def both() -> None:
        kernels.phase_space(*systems, none, 0, size, points, loops)

    first = seconds(lambda: phase_space(*systems, threads=1), 1)
    blocks()
    per_system = {
        "brentq over a grid of 200 cells": seconds(
            lambda: [by_brentq(*one) for one in zip(*few, strict=True)], 1
        )
        / sample,
        "loop over numpy.roots": seconds(lambda: [by_roots(*one) for one in zip(*few, strict=True)])
        / sample,
        "batched numpy.linalg.eigvals": seconds(lambda: by_eigvals(*some)) / some[0].size,
        "phasekit kernel, equilibria": seconds(blocks) / size,
        "phasekit kernel, with separatrices": seconds(both) / size,
        "phasekit arrays, 1 thread": seconds(lambda: phase_space(*systems, threads=1)) / size,
        "phasekit arrays, 2 threads": seconds(lambda: phase_space(*systems, threads=2)) / size,
    }
    near = systems_next_to_folds_and_cusps(1_000)
    truth = np.array([exact_count(*one) for one in zip(*near, strict=True)])
    wrong = {
        "brentq over a grid of 200 cells": [by_brentq(*one) for one in zip(*near, strict=True)],
        "loop over numpy.roots": [by_roots(*one) for one in zip(*near, strict=True)],
        "batched numpy.linalg.eigvals": by_eigvals(*near),
        "phasekit arrays, 1 thread": phase_space(*near)[0].n_equilibria,
    }
    base = per_system["loop over numpy.roots"]
    with capsys.disabled():
        print("\n\nmethod                               us/system   x roots loop   wrong counts")
        for name, value in per_system.items():
            errors = f"{int(np.sum(np.asarray(wrong[name]) != truth))}" if name in wrong else ""
            print(f"{name:36} {value * 1e6:9.3f} {base / value:14.1f} {errors:>14}")
        print(f"wrong counts: among {truth.size} systems next to folds and cusps")
        print(f"first large map of a process, kernels cached or not: {first:.1f} s")
    assert np.array_equal(phase_space(*near)[0].n_equilibria, truth)
