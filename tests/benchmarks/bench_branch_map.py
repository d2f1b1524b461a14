"""A map of branches beside a loop of single calls in the same run: the A -> B reaction, n = 2.

Run with ``pytest tests/benchmarks/bench_branch_map.py``; the table is printed. Times are CPU times
of one process, the least of a few runs. The loop follows one branch a cell from one start, and
proves nothing; the map looks for all equilibria at both ends of the span by boxes, follows what is
not there yet, and finds where two of them are stable.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

import phasekit as pk

SPAN = (0.0, 0.2)
P2, P3 = np.linspace(8, 20, 12), np.linspace(0.5, 3.5, 12)
REACTION = pk.Problem(
    {"x": "-x + p1*(1 - x)*exp(y)", "y": "-y + p1*p2*(1 - x)*exp(y) - p3*y"},
    parameters={"p1": 0.0, "p2": 14.0, "p3": 2.0},
    window={"x": (0, 1), "y": (0, 8)},
)


def least(run: Callable[[], Any], repeats: int = 3) -> tuple[float, Any]:
    """Least CPU time of a few runs, and the result."""
    run()
    times = []
    for _ in range(repeats):
        start = time.process_time()
        result = run()
        times.append(time.process_time() - start)
    return min(times), result


def loop() -> list[Any]:
    """Special points of single branches."""
    return [
        pk.continuation(REACTION.replace(p2=p2, p3=p3), "p1", x0=[0, 0], span=SPAN).special_points
        for p2 in P2
        for p3 in P3
    ]


def test_map_beside_single_branches(capsys: pytest.CaptureFixture[str]) -> None:
    """Milliseconds a cell, and the ratio; the special points are the same."""
    rows = {"loop of continuation": least(loop)}
    for name, of in {
        "special_points": ["special_points"], "and hysteresis": ["special_points", "hysteresis"]
    }.items():  # fmt: skip
        rows[name] = least(
            lambda of=of: pk.sweep(REACTION, p2=P2, p3=P3, along=("p1", SPAN), of=of)
        )
    each, cells = rows["loop of continuation"], P2.size * P3.size
    own = rows["special_points"][1].special_p1.values.reshape(cells, -1)
    for found, values in zip(each[1], own, strict=True):
        wanted = sorted(point["p1"] for point in found if point.kind != "end")
        np.testing.assert_allclose(values[: len(wanted)], wanted, rtol=1e-12)
    with capsys.disabled():
        print(f"\n\n{cells} cells{'':14} ms a cell   loop/map")
        for name, (seconds, _) in rows.items():
            print(f"{name:24} {seconds / cells * 1e3:9.2f} {each[0] / seconds:10.2f}")
