"""Melnikov's function over maps. It prints; run it with -s."""

import time

import numpy as np
import pytest

import phasekit as pk

DRIVEN = pk.Perturbed(pk.Coefficients(1.0, 0.35, 0.12), damping=0.1, forcing=pk.Harmonic(1.0, 1.0))


@pytest.mark.parametrize("side", [100, 1000])
def test_map_of_thresholds(side):
    axes = {"B": np.linspace(0.05, 0.9, side), "forcing_frequency": np.linspace(0.1, 4.0, side)}
    pk.sweep(DRIVEN, {name: x[:70] for name, x in axes.items()}, of="melnikov")  # compiled
    start = time.perf_counter()
    ds = pk.sweep(DRIVEN, axes, of="melnikov")
    seconds = time.perf_counter() - start
    print(f"\n{side * side} cells: {seconds:.2f} s, {1e6 * seconds / side**2:.2f} us a cell")
    assert np.isfinite(ds.chaos_threshold.sel(saddle="upper")).all()
