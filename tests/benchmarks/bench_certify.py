"""What a proof of a branch costs, in CPU time beside the branch itself, on all published systems.

Run with ``pytest tests/benchmarks/bench_certify.py``; the table is printed. A proof takes at most
30 times the branch, with its points and special points.
"""

from __future__ import annotations

import time
from typing import Any

import pytest
from published import compare
from published.systems import SYSTEMS

MOST = 30.0


def cpu(name: str, certify: bool, repeats: int = 3) -> tuple[float, Any]:
    """Least CPU time of a few runs in s, and the branch."""
    times = []
    for _ in range(repeats):
        start = time.process_time()
        branch = compare.follow(SYSTEMS[name], certify=certify)
        _ = branch.points, branch.special_points
        times.append(time.process_time() - start)
    return min(times), branch


def test_proofs_beside_branches(capsys: pytest.CaptureFixture[str]) -> None:
    """Each system is followed with and without a proof, in turn."""
    rows = {}
    for name in SYSTEMS:
        first = time.process_time()
        compare.follow(SYSTEMS[name], certify=True)
        first = time.process_time() - first
        bare, _ = cpu(name, False)
        whole, branch = cpu(name, True)
        share = branch.points.certified_onward.values[:-1].mean()
        rows[name] = (bare, (whole - bare) / bare, first, share)
    with capsys.disabled():
        print(f"\n\n{'':36}{'branch, ms':>11}{'proof/branch':>14}{'first, ms':>11}{'proved':>8}")
        for name, (bare, ratio, first, share) in rows.items():
            print(f"{name:36}{bare * 1e3:11.1f}{ratio:14.1f}{first * 1e3:11.0f}{share:8.3f}")
    assert max(ratio for _, ratio, _, _ in rows.values()) <= MOST
