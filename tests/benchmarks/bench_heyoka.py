"""Motions of Lorenz's system beside heyoka's: CPU seconds in one run, and errors of both.

``HEYOKA_PYTHON=... pytest tests/benchmarks/bench_heyoka.py`` names a Python that has heyoka.
Without it heyoka is looked for here, and the benchmark is skipped where it is not.
"""

import json
import os
import subprocess
import sys
import time

import numpy as np
import pytest

import phasekit as pk

MOTIONS, LAST = 10_000, 10.0
RIVAL = f"""
import json, time
import numpy as np
import heyoka as hy

x, y, z = hy.make_vars("x", "y", "z")
eqs = [(x, 10.0*(y - x)), (y, x*(28.0 - z) - y), (z, x*y - 8.0/3.0*z)]
count, last = {MOTIONS}, {LAST}
size = hy.recommended_simd_size()
start = 1.0 + np.arange(count)/count
ta = hy.taylor_adaptive_batch(eqs, np.ones((3, size)), tol=1e-10)
def run(many):
    found = np.empty((many, 3))
    for k in range(0, many, size):
        ta.set_time(0.0)
        ta.state[:] = 1.0
        ta.state[0] = start[k : k + size]
        ta.propagate_until(last)
        found[k : k + size] = ta.state.T
    return found
run(100*size)
begun = time.process_time()
found = run(count)
print(json.dumps([time.process_time() - begun, size, found[:: count // 8].tolist()]))
"""


def test_lorenz(capsys):
    python = os.environ.get("HEYOKA_PYTHON", sys.executable)
    run = subprocess.run([python, "-c", RIVAL], capture_output=True, text=True, check=False)
    if run.returncode:
        pytest.skip("no heyoka here: HEYOKA_PYTHON names a Python that has it")
    seconds, size, states = json.loads(run.stdout)
    lorenz = pk.Problem(
        {"x": "s*(y - x)", "y": "x*(r - z) - y", "z": "x*y - b*z"},
        parameters={"s": 10.0, "r": 28.0, "b": 8 / 3},
    )
    starts = 1.0 + np.arange(MOTIONS) / MOTIONS

    def own(x):
        return pk.flow(lorenz, x=x, y=np.ones(len(x)), z=np.ones(len(x)), t=[LAST])

    own(starts[:200])
    begun = time.process_time()
    ds = own(starts)
    mine = time.process_time() - begun
    few = slice(None, None, MOTIONS // 8)
    exact = pk.flow(
        lorenz, x=starts[few], y=np.ones(8), z=np.ones(8), t=[LAST], rtol=1e-14, atol=1e-14
    )
    with capsys.disabled():
        print(f"\n{MOTIONS} motions to t = {LAST:g} at a tolerance of 1e-10, CPU seconds")
        for name, spent, x in (
            ("phasekit", mine, ds.motion_x.values[few, 0]),
            (f"heyoka ({size} at once)", seconds, np.array(states)[:, 0]),
        ):
            off = np.abs(x - exact.motion_x.values[:, 0]).max()
            print(f"{name:24} {spent:8.3f} s   error {off:.1e}")
        print(f"heyoka / phasekit: {seconds / mine:.2f}")
