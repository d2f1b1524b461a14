"""Every quantity ends in bounded time, whatever the parameters.

Their magnitudes are log-uniform over all doubles, subnormal ones included, with both signs. A
larger run, which shows what each group takes, is
``PHASEKIT_EXTREME=3000 pytest -s tests/properties/test_bounded.py``.
"""

import os
import time

import numpy as np
import pytest
import xarray as xr

import phasekit as pk
from phasekit.cells.request import passes_of
from phasekit.labels.coordinates import STATES
from phasekit.loads import functions
from phasekit.table.quantities import ROWS, TABLE

CELLS = int(os.environ.get("PHASEKIT_EXTREME", "6"))
SPECIAL = [0.0, -0.0, 1e16, 1e300, -1e300, 1.7e308, 5e-324, np.inf, -np.inf, np.nan]
DISK = pk.GyroRotorDisk(beta=0.3, e=0.01, a=0.02, r=0.2, omega1=2.5, m=1.5, half_span=0.1)
GENERAL = pk.Coefficients(A=1.0, B=0.3, C=0.2)


def extreme(rng, n):
    power = np.where(rng.random(n) < 0.4, rng.uniform(-3, 3, n), rng.uniform(-320, 308, n))
    x = rng.choice([-1.0, 1.0], n) * 10.0**power
    return np.where(rng.random(n) < 0.1, rng.choice(SPECIAL, n), x)


def swept(system, group, rng):
    """Sweep all parameters and the states that a group needs, cell by cell."""
    axes = {p.name: xr.DataArray(extreme(rng, CELLS), dims="cell") for p in system.declared}
    for one in passes_of(system, [row for row in ROWS.values() if row.group == group]):
        for name in one.inputs:
            if name in STATES:
                axes[name] = xr.DataArray(extreme(rng, CELLS), dims="cell")
    return pk.sweep(system, axes, of=group)


GROUPS = dict.fromkeys(
    row.group for row in pk.quantities().values() if TABLE.offers(DISK.standing, row.group)
)
LOADS = [group for group in GROUPS if "forces" in group or "rotators" in group]


@pytest.mark.parametrize(
    ("system", "groups"),
    [(DISK, list(GROUPS)), (GENERAL, [group for group in GROUPS if group not in LOADS])],
    ids=["disk", "coefficients"],
)
def test_every_group_ends(system, groups):
    rng = np.random.default_rng(20250211)
    assert len(groups) >= 10
    for group in groups:
        began = time.perf_counter()
        ds = swept(system, group, rng)
        assert all(array.sizes["cell"] == CELLS for array in ds.data_vars.values())
        assert ds.data_vars
        if "PHASEKIT_EXTREME" in os.environ:
            took = time.perf_counter() - began
            print(f"{type(system).__name__:14} {group:22} {took:6.2f} s", flush=True)


@pytest.mark.parametrize(
    "changed", [{"g": 1e300}, {"m": 1e300}, {"e": 1e100}, {"half_span": 1e-300}]
)
def test_loads_that_overflow_are_sampled_once(changed, monkeypatch):
    """More samples cannot settle what is infinite."""
    sampled = []
    whole = functions._sampled

    def counted(table, start, period, *rest):
        sampled.append(period.size)
        return whole(table, start, period, *rest)

    monkeypatch.setattr(functions, "_sampled", counted)
    disk = {"beta": 0.7, "e": 0.05, "a": 0.024, "r": 0.2, "omega1": 31.4, "m": 2.0, "g": 9.81}
    disk = {**disk, "half_span": 0.2, **changed}
    over = functions.orbit_forces(*disk.values(), [0.5, 1.0], [1.0, -2.0])
    assert not np.isfinite(over.mean).any()
    assert sum(sampled) == 2
