"""First calls in fresh processes, with an empty cache of compiled kernels and with a full one.

Run with ``pytest tests/benchmarks/bench_first.py``; the table is printed. Each line runs in a
process of its own and counts its CPU seconds above those of a process that only imports NumPy and
xarray (where something is drawn, matplotlib too, and one empty figure is saved; of an njit
function, numba), timed next to it. The seconds are split by what was done: importing, compiling
(with kept kernels that are read), computing, drawing. What another process compiles in the
background is a column of its own.
``pytest tests/benchmarks/bench_first.py -k basins`` runs some lines, and ``PHASEKIT_FIRST=3``
takes the least of three runs.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path

import pytest

RUNS = int(os.environ.get("PHASEKIT_FIRST", "1"))
#: Most runs until nothing new is kept.
MOST = 4


@dataclass(frozen=True)
class Line:
    """A first call: what is computed, then drawn, and the seconds that it may take."""

    compute: str
    draw: str = ""
    cold: float = 1.5
    warm: float = 0.4


DISK = "disk = pk.GyroRotorDisk(beta=84*pk.deg, e=0.05, a=0.012, r=0.2, omega1=300*pk.rpm)\n"
BRANCH = (
    "branch = pk.continuation(problem, 'mu', x0=[-1.5], span=(-2.0, 2.0)); branch.special_points"
)
PLAIN = "def f(x, mu): return np.array([mu + x[0] - x[0]**3])\n"
NEURON = """neuron = pk.Problem(
    {"v": "v - v**3/3 - w + current", "w": "0.08*(v + 0.7 - 0.8*w)"},
    parameters={"current": 0.5}, window={"v": (-2.5, 2.5), "w": (-1.0, 2.0)})
"""
DAMPED = "damped = pk.Perturbed(pk.Pendulum(length=9.81), damping=0.1)\n"
DRIVEN = """driven = pk.Perturbed(
    pk.Pendulum(length=9.81), damping=0.2, forcing=pk.Harmonic(0.5, 0.7))
"""

LINES = {
    "one disk: equilibria": Line(DISK + "pk.equilibria(disk)", cold=0.5),
    "one disk: portrait, drawn": Line(DISK, "pk.plot.phase_portrait(disk, angles='deg')", 0.5),
    "map of 10^4 cells, drawn": Line(
        DISK + "ds = pk.sweep(disk, beta=np.linspace(0, 1.5, 100), a=np.linspace(-.06, .06, 100))",
        "pk.plot.parameter_map(ds, 'topology')",
    ),
    "branch of a formula, drawn": Line(
        "problem = pk.Problem(['mu + x - x**3'], ('x',), {'mu': 0.0})\n" + BRANCH,
        "pk.plot.branch(branch)",
    ),
    "branch of a plain function": Line(
        PLAIN + "problem = pk.Problem(f, ('x',), {'mu': 0.0})\n" + BRANCH, warm=0.6
    ),
    "branch of an njit function": Line(
        "from numba import njit\n@njit\n" + PLAIN
        + "problem = pk.Problem(f, ('x',), {'mu': 0.0})\n" + BRANCH, warm=0.6,
    ),
    "family of cycles": Line(
        NEURON + "rest = pk.continuation(neuron, 'current', x0=[-1.2, -0.6], span=(0.0, 2.0))\n"
        "cycles = rest.special('hopf')[0].switch(); cycles.special_points", cold=3.0, warm=0.8,
    ),
    "capture": Line(DAMPED + "pk.capture(damped)"),
    "melnikov": Line(DRIVEN + "pk.melnikov(driven)"),
    "flow of a damped rotor": Line(
        DISK + "pk.flow(pk.Perturbed(disk, damping=0.5), 1.0, 0.2, np.linspace(0, 5, 101))"
    ),
    "basins 100 x 100": Line(
        DRIVEN + "pk.basins(driven, phi=np.linspace(-3, 3, 100), dphi=np.linspace(-2, 2, 100))",
        cold=2.5, warm=1.0,
    ),
    "Lyapunov exponents": Line(
        DRIVEN + "pk.lyapunov(driven, 0.1, 0.0, duration=500.0)", cold=2.5, warm=1.0
    ),
    "planar portrait, drawn": Line(
        NEURON, "pk.plot.phase_portrait(neuron, orbits=(0.5, 0.0))", cold=2.5, warm=1.0
    ),
}  # fmt: skip

#: What a line is measured above.
BARE = "import numpy, xarray\n"
FIGURE = BARE + "import matplotlib.pyplot as plt; plt.figure(); plt.savefig(out)\n"

#: Measures a process from inside. Each moment counts for the innermost of what goes on; imports and
#: compilation are known by the functions of Python and numba that do them.
PROGRAM = """
import builtins, contextlib, json, os, resource, sys, time

compute, draw, out = sys.argv[1:]
began = time.process_time()
spent, doing = {}, [("start", began)]


@contextlib.contextmanager
def counted(what):
    now = time.process_time()
    spent[doing[-1][0]] = spent.get(doing[-1][0], 0.0) + now - doing[-1][1]
    doing.append((what, now))
    try:
        yield
    finally:
        now = time.process_time()
        spent[what] = spent.get(what, 0.0) + now - doing.pop()[1]
        doing[-1] = (doing[-1][0], now)


def counting(owner, name, what):
    function = getattr(owner, name)

    def measured(*args, **kwargs):
        if doing[-1][0] == what:
            return function(*args, **kwargs)
        with counted(what):
            return function(*args, **kwargs)

    setattr(owner, name, measured)


import importlib._bootstrap as finder

counting(finder, "_find_and_load", "importing")
found = finder._find_and_load


def compilers():
    from numba.core import dispatcher

    counting(dispatcher.Dispatcher, "compile", "compiling")


def later(name, import_):
    module = found(name, import_)
    if name == "numba" and not hasattr(sys, "_counted"):
        sys._counted = True
        compilers()
    elif name == "llvmlite.binding.executionengine":
        counting(module, "create_mcjit_compiler", "compiling")
        counting(module.ExecutionEngine, "finalize_object", "compiling")
    return module


finder._find_and_load = later
space = {"out": out}
with counted("importing"):
    exec("import numpy as np, phasekit as pk", space)
with counted("computing"):
    exec(compute, space)
if draw:
    with counted("drawing"):
        exec(draw + "\\nimport matplotlib.pyplot as plt; plt.savefig(out)", space)
spent["start"] = began
for what in ("SELF", "CHILDREN"):
    used = resource.getrusage(getattr(resource, "RUSAGE_" + what))
    spent[what] = used.ru_utime + used.ru_stime
print(json.dumps(spent))
"""


def process(code: list[str], cache: Path) -> str:
    """Run Python with a folder for compiled kernels; return what it printed."""
    environment = {**os.environ, "PHASEKIT_CACHE_DIR": str(cache), "MPLBACKEND": "Agg"}
    for name in ("PYTEST_CURRENT_TEST", "PYTHONDONTWRITEBYTECODE"):  # as after an installation
        environment.pop(name, None)
    done = subprocess.run(
        [sys.executable, "-c", *code], capture_output=True, text=True, env=environment, cwd=cache
    )
    assert done.returncode == 0, done.stderr
    return done.stdout


def bare(line: Line, cache: Path) -> float:
    """CPU seconds of a process with the imports alone, numba's too where the line begins so."""
    used = "\nimport os; print(sum(os.times()[:2]))"
    own = line.compute.partition("\n")[0] if line.compute.startswith("from numba") else ""
    code = f"out = {str(cache / 'bare.png')!r}\n" + (FIGURE if line.draw else BARE) + own + used
    return min(float(process([code], cache)) for _ in range(2))


def split(line: Line, cache: Path) -> dict[str, float]:
    """CPU seconds of a line, by what was done."""
    printed = process([PROGRAM, line.compute, line.draw, str(cache / "first.png")], cache)
    return json.loads(printed.splitlines()[-1])


def files(cache: Path) -> set[tuple[Path, int]]:
    """What is in a folder for compiled kernels, with sizes."""
    return {(path, path.stat().st_size) for path in cache.rglob("*") if path.is_file()}


PARTS = ("importing", "compiling", "computing", "drawing")
_TITLE = []


@pytest.mark.parametrize("name", LINES)
def test_first_call(name: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    line = LINES[name]
    if not _TITLE:
        _TITLE.append("said")
        with capsys.disabled():
            columns = " ".join(f"{part:>9}" for part in PARTS)
            print(f"\n\n{'CPU s above the imports':28} {'kernels':7} {'above':>6} "
                  f"{'wanted':>6} {columns} {'behind':>7}")  # fmt: skip
    base = bare(line, tmp_path)
    cache = tmp_path
    for state, wanted in (("empty", line.cold), ("kept", line.warm)):
        runs = []
        if state == "kept":  # what pays is compiled when it is met again, or behind
            for _ in range(MOST):
                before = files(cache)
                split(line, cache)
                if files(cache) == before:
                    break
        for i in range(RUNS):
            if state == "empty":
                cache = tmp_path / f"cache{i}"
                cache.mkdir()
            runs.append(split(line, cache))
        best = min(runs, key=lambda run: run["SELF"])
        above = best["SELF"] - base
        parts = " ".join(f"{best.get(part, 0.0):9.2f}" for part in PARTS)
        with capsys.disabled():
            print(f"{name:28} {state:7} {above:6.2f} {wanted:6.1f} {parts} "
                  f"{best['CHILDREN']:7.2f}")  # fmt: skip
