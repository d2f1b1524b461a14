"""Periodic orbits followed in one parameter, beside a bare NumPy loop.

Run with ``pytest tests/benchmarks/bench_cycles.py -s``. CPU time a point of one thread, as the
slope between a short and a long run, with special points located; ratios to the loop over
``numpy.roots`` of the map's benchmark are what carries over between machines. `bench_auto` has
whole branches beside AUTO-07p.
"""

from __future__ import annotations

import numpy as np
import pytest
from benchmarks.bench_continuation import cpu, loop_over_roots

import phasekit as pk

REACTION = ["-u1 + p1*(1 - u1)*exp(u2)", "-u2 + p1*14*(1 - u1)*exp(u2) - 3*u2"]
LORENZ = ["10*(y - x)", "rho*x - y - x*z", "x*y - 8*z/3"]


def _lorenz(x, rho):
    return np.array(
        [10 * (x[1] - x[0]), rho * x[0] - x[1] - x[0] * x[2], x[0] * x[1] - 8 * x[2] / 3]
    )


def _reaction():
    problem = pk.Problem(REACTION, ("u1", "u2"), {"p1": 0.25})
    return problem, "p1", pk.periodic_orbit(problem, [0.9, 3.0], 2.22), (0.2, 0.33), 25


def _orbit_of_lorenz():
    problem = pk.Problem(LORENZ, ("x", "y", "z"), {"rho": 23.0})
    rest = pk.continuation(problem, "rho", x0=[7.7, 7.7, 22.0], span=(14.0, 30.0))
    branch = rest.special("H")[0].switch()
    return branch.orbit(int(np.argmin(np.abs(branch.points.rho.values - 16.0))))


def _flow(f):
    problem = pk.Problem(f, ("x", "y", "z"), {"rho": 16.0})
    return problem, "rho", _orbit_of_lorenz(), (10.0, 30.0), 80


@pytest.mark.parametrize("name", ["reaction", "lorenz", "lorenz, Python"])
def test_time_a_point(name, capsys):
    problem, parameter, orbit, span, intervals = (
        _reaction() if name == "reaction" else _flow(LORENZ if name == "lorenz" else _lorenz)
    )

    def follow(points):
        options = pk.ContinuationOptions(
            intervals=intervals, max_points=points, max_step=0.01, directions="forward"
        )
        return pk.continuation(problem, parameter, orbit=orbit, span=span, options=options)

    follow(5)
    (few, short), (many, long) = (cpu(lambda k=k: follow(k)) for k in (5, 45))
    counts = [one.points.sizes["point"] for one in (short, long)]
    assert counts[1] > counts[0]
    each = (many - few) / (counts[1] - counts[0])
    unit = loop_over_roots()
    with capsys.disabled():
        print(f"\n{name}: {1e3 * each:.3f} ms a point, {each / unit:.1f} systems of the loop")
