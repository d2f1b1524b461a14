"""Whole-process times: import, and from a fresh process to the first result.

Run with ``pytest tests/benchmarks/bench_start.py``; the table is printed.
"""

from __future__ import annotations

import os
import subprocess
import sys
import time
from pathlib import Path

import pytest

IMPORT = "import phasekit"
ARRAY = "from phasekit.phase.exact.phase_space import equilibria; equilibria(1.0, 0.3, 0.2)"
LABELLED = (
    "import phasekit as pk;"
    "pk.equilibria(pk.GyroRotorDisk(beta=0.3, e=0.1, a=0.05, r=0.1, omega1=10.0))"
)
LARGE = (
    "import numpy as np; from phasekit.phase.exact.phase_space import phase_space;"
    "phase_space(*np.random.default_rng(0).normal(size=(3, 1_000_000)))"
)


def seconds(code: str, cache: Path, repeats: int = 3) -> float:
    """Least wall time of a fresh interpreter that runs the code."""
    environment = {**os.environ, "PHASEKIT_CACHE_DIR": str(cache)}
    times = []
    for _ in range(repeats):
        start = time.perf_counter()
        subprocess.run([sys.executable, "-c", code], check=True, env=environment)
        times.append(time.perf_counter() - start)
    return min(times)


def test_time_to_the_first_result(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    bare = seconds("pass", tmp_path)
    rows = {
        "import phasekit, beyond a bare interpreter": seconds(IMPORT, tmp_path, 5) - bare,
        "array function, cold cache": seconds(ARRAY, tmp_path / "arrays", 1),
        "array function, warm cache": seconds(ARRAY, tmp_path / "arrays"),
        "one labelled disk, cold cache": seconds(LABELLED, tmp_path / "labelled", 1),
        "one labelled disk, warm cache": seconds(LABELLED, tmp_path / "labelled"),
        "map of 10^6 systems, cold cache": seconds(LARGE, tmp_path / "large", 1),
        "map of 10^6 systems, warm cache": seconds(LARGE, tmp_path / "large"),
    }
    with capsys.disabled():
        print("\n")
        for name, value in rows.items():
            print(f"{name:44} {value:8.3f} s")
