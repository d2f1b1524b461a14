"""Whole branches beside AUTO-07p in the same run: equilibria, and periodic orbits on one mesh.

Run with ``AUTO_DIR=... pytest tests/benchmarks/bench_auto.py``; skipped without a built AUTO-07p.
Both follow the same branches from the same Hopf points to the same bounds, with 25 intervals of
degree 4, and look for folds, branch points, period doublings and tori; both compute all multipliers
at every point. Times are CPU times, the least of a few runs. Those of AUTO-07p are of its process,
which writes its files; phasekit's end with the labelled branch. The start of each is a run of one
point. Steps are as long as each takes them by default or in its demos.
"""

from __future__ import annotations

import time
import warnings
from collections.abc import Callable
from typing import Any

import pytest
from benchmarks.rivals_auto import Auto, Run

import phasekit as pk

MESH = {"intervals": 25, "degree": 4}
SYSTEMS: dict[str, dict[str, Any]] = {
    "A -> B reaction, n = 2": {
        "f": ["-u1 + p1*(1 - u1)*exp(u2)", "-u2 + p1*14*(1 - u1)*exp(u2) - 3*u2"],
        "states": ("u1", "u2"), "parameter": "p1", "x0": [0.0, 0.0], "span": (0.0, 0.25),
        "fortran": [
            "F(1) = -U(1) + PAR(1)*(1 - U(1))*EXP(U(2))",
            "F(2) = -U(2) + PAR(1)*14*(1 - U(1))*EXP(U(2)) - 3*U(2)",
        ],
        "start": ["PAR(1) = 0", "U(1) = 0", "U(2) = 0"],
    },
    "Roessler's equations, n = 3": {
        "f": ["-y - z", "x + a*y", "2 + z*(x - 4)"],
        "states": ("x", "y", "z"), "parameter": "a", "x0": [0.0, -0.5, 0.5], "span": (0.0, 0.38),
        "fortran": [
            "F(1) = -U(2) - U(3)",
            "F(2) = U(1) + PAR(1)*U(2)",
            "F(3) = 2 + U(3)*(U(1) - 4)",
        ],
        "start": ["PAR(1) = 0", "U(1) = 0", "U(2) = -0.5D0", "U(3) = 0.5D0"],
    },
    "Langford's equations, n = 3": {
        "f": [
            "(z - 7/10)*x - 7*y/2", "7*x/2 + (z - 7/10)*y",
            "3/5 + r*z - z**3/3 - (x**2 + y**2)*(1 + z/4) + z*x**3/10",
        ],
        "states": ("x", "y", "z"), "parameter": "r", "x0": [0.0, 0.0, 0.5458], "span": (-1.0, 2.0),
        "fortran": [
            "F(1) = (U(3) - 0.7D0)*U(1) - 3.5D0*U(2)",
            "F(2) = 3.5D0*U(1) + (U(3) - 0.7D0)*U(2)",
            "F(3) = 0.6D0 + PAR(1)*U(3) - U(3)**3/3 &",
            "  - (U(1)**2 + U(2)**2)*(1 + U(3)/4) + U(3)*U(1)**3/10",
        ],
        "start": ["PAR(1) = -1", "U(1) = 0", "U(2) = 0", "U(3) = 0.54580192D0"],
    },
}  # fmt: skip


def least(run: Callable[[], Any], repeats: int = 25) -> Run:
    """Least CPU time of a few runs of ours."""
    times = []
    for _ in range(repeats):
        start = time.process_time()
        branch = run()
        points = branch.points  # which are labelled when they are asked for
        times.append(time.process_time() - start)
    special = [one.label for one in branch.special_points if one.kind != "end"]
    return Run(min(times), points.sizes["point"], special)


def options(points: int, **more: Any) -> pk.ContinuationOptions:
    """Defaults but for the number of points."""
    return pk.ContinuationOptions(max_points=points, directions="forward", **more)


def report(capsys: pytest.CaptureFixture[str], title: str, rows: dict[str, list[Run]]) -> None:
    """Print whole branches and points of both, and their ratios."""
    with capsys.disabled():
        print(f"\n\n{title}")
        print(
            f"{'':10} {'points':>7} {'whole, ms':>10} {'start, ms':>10} {'ms a point':>11}  found"
        )
        each, whole = {}, {}
        for name, (long, start) in rows.items():
            whole[name] = long.seconds - start.seconds
            each[name] = whole[name] / (long.points - start.points)
            print(f"{name:10} {long.points:7d} {long.seconds * 1e3:10.2f}", end="")
            print(f" {start.seconds * 1e3:10.2f} {each[name] * 1e3:11.3f}  {long.special}")
        a, b = rows["AUTO-07p"][0].seconds, rows["phasekit"][0].seconds
        print(f"AUTO-07p/phasekit: whole {a / b:.2f}", end="")
        print(f", without starts {whole['AUTO-07p'] / whole['phasekit']:.2f}", end="")
        print(f", a point {each['AUTO-07p'] / each['phasekit']:.2f}")


@pytest.mark.parametrize("name", SYSTEMS)
@pytest.mark.filterwarnings("ignore:the branch in")  # of runs of one point
def test_beside_auto(name: str, capsys: pytest.CaptureFixture[str], tmp_path: Any) -> None:
    """Equilibria up to the bound, and the periodic orbits from their first Hopf point."""
    system = SYSTEMS[name]
    auto = Auto(tmp_path, system["fortran"], system["start"], len(system["states"]))
    low, high = system["span"]
    bound = {"UZSTOP": {1: [low, high]}}
    problem = pk.Problem(system["f"], system["states"], {system["parameter"]: low})

    def rest(points: int) -> Any:
        return pk.continuation(
            problem, system["parameter"], x0=system["x0"], span=system["span"],
            options=options(points),
        )  # fmt: skip

    equilibria = {"IPS": 1, "IRS": 0, "ICP": [1], "ISP": 1, "DSMAX": 0.05} | bound
    start = auto.run(**equilibria, NMX=1)
    rows = {"AUTO-07p": [auto.run(**equilibria, NMX=1000), start]}
    label = auto.keep()["HB"]
    with warnings.catch_warnings():
        branch = rest(1000)
        rows["phasekit"] = [least(lambda: rest(1000), 30), least(lambda: rest(1), 30)]
    assert "HB" in rows["AUTO-07p"][0].special
    report(capsys, f"{name}: equilibria", rows)

    hopf = branch.special("H")[0]
    cycles = {"IPS": 2, "IRS": label, "ICP": [1, 11], "ISP": 2, "DSMAX": 0.5} | bound

    def family(points: int) -> Any:
        return hopf.switch(options=options(points, **MESH))

    start = auto.run(**cycles, NMX=1)
    rows = {"AUTO-07p": [auto.run(**cycles, NMX=1000), start]}
    family(1000)
    rows["phasekit"] = [least(lambda: family(1000)), least(lambda: family(1))]
    report(capsys, f"{name}: periodic orbits, 25 intervals of degree 4", rows)
