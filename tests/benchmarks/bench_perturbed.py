"""Melnikov's function over maps."""

import numpy as np
import pytest

import phasekit as pk

DRIVEN = pk.Perturbed(pk.Coefficients(1.0, 0.35, 0.12), damping=0.1, forcing=pk.Harmonic(1.0, 1.0))


@pytest.mark.parametrize("side", [100, 1000])
def test_map_of_thresholds(benchmark, side):
    axes = {"B": np.linspace(0.05, 0.9, side), "forcing_frequency": np.linspace(0.1, 4.0, side)}
    pk.sweep(DRIVEN, {name: x[:70] for name, x in axes.items()}, of="melnikov")  # compiled
    ds = benchmark.pedantic(pk.sweep, (DRIVEN, axes), {"of": "melnikov"}, rounds=2)
    assert np.isfinite(ds.chaos_threshold.sel(saddle="upper")).all()
