"""Equilibria followed in one parameter and folds followed in two, beside a bare NumPy loop.

Run with ``pytest tests/benchmarks/bench_continuation.py``; the tables are printed. Ratios within
one run are what carries over between machines: the unit is the loop over ``numpy.roots`` of the
map's benchmark, one system a turn. CPU times of one thread.

Time per point is the slope between a short and a long run of the same curve, so that start-up is
excluded; start-up (of the first run in a process, which compiles, and of later ones) has its own
columns. The long run has its special points located as well.
"""

from __future__ import annotations

import functools
import time
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from benchmarks import rivals_continuation as rivals
from benchmarks.bench_map import by_roots, random_systems
from published import bratu, compare
from published.systems import SYSTEMS

import phasekit as pk

DISK = {"e": 0.0115, "a": 0.02, "r": 0.21, "omega1": 2.5, "g": 9.80665}

# CPU time a point and a system of the numpy.roots loop, in us, as measured elsewhere on one
# machine: 8.6 and 18.7 for AUTO-07p's executable, 1000/10.9 for the loop.
LOOP_ELSEWHERE = 1000.0 / 10.9
ELSEWHERE = {
    "equilibria": {
        "AUTO-07p, executable, measured elsewhere": 8.6,
        "AUTO-07p through Python, measured elsewhere": 60.0,
        "PyCoBi, measured elsewhere": 70.0,
        "PyDSTool, measured elsewhere": 9900.0,
        "NumPy loop, measured elsewhere": 232.0,
    },
    "folds": {
        "AUTO-07p, executable, measured elsewhere": 18.7,
        "PyDSTool, measured elsewhere": 44000.0,
    },
}


def cpu(run: Callable[[], Any], repeats: int = 3) -> tuple[float, Any]:
    """Least CPU time of a few runs, and the result."""
    times = []
    for _ in range(repeats):
        start = time.thread_time()
        result = run()
        times.append(time.thread_time() - start)
    return min(times), result


def loop_over_roots(systems: int = 2_000) -> float:
    """CPU time a system of the loop that the ratios refer to."""
    few = random_systems(systems)
    return cpu(lambda: [by_roots(*one) for one in zip(*few, strict=True)])[0] / systems


def per_point(run: Callable[..., Any], short: int = 100, long: int = 1000) -> list[float]:
    """First call, later start-up, time a point, the same without special points, points (s)."""
    first, _ = cpu(lambda: run(short, True), 1)
    slopes = []
    for detect in (True, False):
        few, small = cpu(functools.partial(run, short, detect), 5)
        many, large = cpu(functools.partial(run, long, detect), 5)
        points = [one.points.sizes["point"] for one in (small, large)]
        slopes.append((many - few) / (points[1] - points[0]))
        if detect:
            start = few - slopes[0] * points[0]
    return [first, start, *slopes, points[1]]


def report(
    capsys: pytest.CaptureFixture[str], title: str, rows: dict[str, list[float]], what: str
) -> None:
    """Print a table; the last rows are figures from elsewhere, by their ratio to the loop there."""
    loop = loop_over_roots()
    with capsys.disabled():
        print(f"\n\n{title}; numpy.roots loop of the map: {loop * 1e6:.1f} us a system")
        print(f"{'':44} {'us/point':>9} {'steps alone':>12} {'points':>7}", end="")
        print(f" {'loop/point':>11} {'first, s':>9} {'start-up, ms':>13}")
        for name, (first, start, slope, bare, points) in rows.items():
            print(f"{name:44} {slope * 1e6:9.3g} {bare * 1e6:12.3g} {points:7d}", end="")
            print(f" {loop / slope:11.3g} {first:9.2g} {start * 1e3:13.3g}")
        for name, us in ELSEWHERE[what].items():
            print(f"{name:44} {us:9.3g} {'':12} {1000:7d} {LOOP_ELSEWHERE / us:11.3g}")


def options(points: int, detect: bool, **more: Any) -> pk.ContinuationOptions:
    """Steps of a thousandth of the span, in one direction."""
    if not detect:
        more["detect"] = ()
    return pk.ContinuationOptions(
        max_step=1e-3, initial_step=1e-3, max_points=points, directions="forward", **more
    )


class Barest:
    """The barest loop along the same curve, with a result of the same shape."""

    def __init__(self, f: Callable[..., Any], start: Any, step: float, points: int, detect: bool):
        del detect
        rivals.barest_loop(f, np.array(start, float), step, points)
        self.points = self
        self.sizes = {"point": points}


def disk_problem(form: str) -> Any:
    """The disk as a system, or its equilibrium condition as a plain function of (phi, beta)."""
    if form == "system":
        return pk.GyroRotorDisk(beta=0.02, **DISK)
    force = rivals.disk_force(**DISK)
    return pk.Problem(
        lambda x, beta: force((x[0], beta)), state=("phi",), parameters={"beta": 0.02}
    )


SYSTEMS_TIMED = ("cusp", "A -> B reaction", "CO oxidation, k = 0.4", "neural mass")


def test_equilibria(capsys: pytest.CaptureFixture[str]) -> None:
    """About a thousand points of one branch; most steps are as long as they may be."""
    rows: dict[str, list[float]] = {}
    for form, start in (("system", "lower_center"), ("function", [1.45])):
        problem = disk_problem(form)

        def disk(points: int, detect: bool, problem: Any = problem, start: Any = start) -> Any:
            return pk.continuation(
                problem, "beta", x0=start, span=(0.02, 1.5), options=options(points, detect)
            )

        rows[f"phasekit, disk in beta, {form}"] = per_point(disk)
    force = rivals.disk_force(**DISK)
    rows["barest NumPy loop, disk in beta"] = per_point(
        functools.partial(Barest, force, (1.45, 0.02), 1.8e-3)
    )
    for name in SYSTEMS_TIMED:
        system = SYSTEMS[name]
        for form in compare.FORMS:
            problem = compare.problem(system, form)

            def run(points: int, detect: bool, problem: Any = problem, system: Any = system) -> Any:
                return pk.continuation(
                    problem,
                    system.parameter,
                    x0=list(system.x0),
                    span=system.span,
                    options=options(points, detect, bounds=dict(system.bounds)),
                )

            rows[f"phasekit, {name}, {form}"] = per_point(run)
        rows[f"barest NumPy loop, {name}"] = per_point(barest(system))
    report(capsys, "equilibria", rows, "equilibria")


def barest(system: Any) -> Callable[..., Any]:
    """The barest loop on the Python form of a system."""
    f, values = system.python(), dict(system.parameters)

    def of_both(u: np.ndarray) -> Any:
        values[system.parameter] = u[-1]
        return f(u[:-1], **values)

    start = pk.continuation(
        compare.problem(system, "symbolic"),
        system.parameter,
        x0=list(system.x0),
        span=system.span,
        options=pk.ContinuationOptions(max_points=1),
    ).start.u
    return functools.partial(Barest, of_both, start, 1e-3)


def test_fold_curves(capsys: pytest.CaptureFixture[str]) -> None:
    """Steps of a thousandth of the spans of both parameters."""
    rows: dict[str, list[float]] = {}
    disk = pk.GyroRotorDisk(beta=0.02, **DISK)
    fold = pk.continuation(disk, "beta", x0="lower_saddle", span=(0.02, 1.5)).special("fold")[0]
    rows["phasekit, disk in (beta, a), system"] = per_point(
        lambda points, detect: fold.curve("a", (-0.05, 0.05), options=options(points, detect))
    )
    for name, second, span in (
        ("cusp", "l", (-1.0, 2.0)),
        ("A -> B reaction", "p3", (0.5, 4.0)),
        ("CO oxidation, k = 0.4", "k", (0.1, 2.0)),
    ):
        for form in compare.FORMS:
            point = compare.follow(SYSTEMS[name], form).special("fold")[0]

            def run(
                points: int,
                detect: bool,
                point: Any = point,
                second: str = second,
                span: Any = span,
            ) -> Any:
                return point.curve(second, span, options=options(points, detect))

            rows[f"phasekit, {name}, {form}"] = per_point(run)
    report(capsys, "fold curves", rows, "folds")


def test_many_states(capsys: pytest.CaptureFixture[str]) -> None:
    """Time a point of Bratu's equation on n nodes, beside the barest loop with the same steps."""
    with capsys.disabled():
        print(f"\n\n{'Bratu, n':>10} {'us/point':>10} {'loop, us':>10} {'ratio':>6}")
        for n, points in ((10, 300), (100, 60), (400, 20)):
            problem = pk.Problem(
                bratu.bratu, [f"u{i}" for i in range(n)], {"c": 0.0}, jac=bratu.bratu_jacobian
            )

            def run(count: int, problem: Any = problem, n: int = n) -> Any:
                steps = pk.ContinuationOptions(
                    max_step=2e-3, initial_step=2e-3, max_points=count, directions="forward",
                    detect=(),
                )  # fmt: skip
                return pk.continuation(problem, "c", x0=np.zeros(n), span=(0, 4), options=steps)

            def both(u: np.ndarray) -> np.ndarray:
                return bratu.bratu(u[:-1], c=u[-1])

            def slopes(u: np.ndarray) -> np.ndarray:
                step = 6e-6
                ahead, behind = (bratu.bratu(u[:-1], c=u[-1] + k * step) for k in (1, -1))
                by_c = (ahead - behind) / (2.0 * step)
                return np.column_stack([bratu.bratu_jacobian(u[:-1], c=u[-1]), by_c])

            short = cpu(functools.partial(run, 5))[0]
            ours = (cpu(functools.partial(run, points))[0] - short) / (points - 5)
            loop = functools.partial(
                rivals.barest_loop, both, np.zeros(n + 1), 8e-3, points, slopes
            )
            bare = cpu(loop)[0] / points
            print(f"{n:10d} {ours * 1e6:10.4g} {bare * 1e6:10.4g} {ours / bare:6.2f}")
