"""Rotators and bearing forces of 10^6 states, and peaks on the separatrices of 10^5 disks.

Run with ``pytest tests/benchmarks/bench_machine.py``; the tables are printed. Ratios within one run
are what carries over between machines. Times are CPU times of one thread; rows with more threads
are wall times. The rivals are plain vectorised NumPy: the same formulas for the states, and for the
peaks samples of each loop in time or in the angle.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

import phasekit as pk
from phasekit.loads.functions import separatrix_forces
from phasekit.mechanics.bearings import bearing_forces
from phasekit.mechanics.disk import disk_coefficients, disk_inertia
from phasekit.mechanics.rotators import rotators
from phasekit.phase.exact.flow import separatrix_motion
from phasekit.phase.exact.phase_space import separatrices

Disk = dict[str, Any]

STATES = 1_000_000
CELLS = (250, 400)
ONE: Disk = {
    "beta": 0.7,
    "e": 0.05,
    "a": 0.024,
    "r": 0.2,
    "omega1": 31.4,
    "m": 2.0,
    "g": 9.81,
    "half_span": 0.2,
}


def cost(
    run: Callable[[], Any], repeats: int = 3, clock: Callable[[], float] = time.thread_time
) -> tuple[float, Any]:
    """Least time of a few runs, and the result."""
    times = []
    for _ in range(repeats):
        start = clock()
        result = run()
        times.append(clock() - start)
    return min(times), result


def cold(disk: Disk) -> tuple[Any, ...]:
    """The parameters on which rotators and coefficients depend."""
    return tuple(disk[name] for name in ("beta", "e", "a", "r", "omega1", "g"))


# The same arithmetic in NumPy --------------------------------------------------------------------


def numpy_rotators(disk: Disk, phi: np.ndarray, dphi: np.ndarray) -> dict[str, np.ndarray]:
    """The eight rotators and what belongs to them, as the kernel gives them."""
    s, c = np.sin(phi), np.cos(phi)
    A, B, C = disk_coefficients(*cold(disk))
    w1 = disk["omega1"]
    d2 = -B * s + (A * s + C) * c
    d3 = dphi * (-B * c + A * (c - s) * (c + s) - C * s)
    q1, q2 = w1 * w1, dphi * dphi
    along, across = disk["e"] * np.cos(disk["beta"]), disk["e"] * np.sin(disk["beta"])
    ju, jv, jn, jvn = disk_inertia(1.0, disk["r"], disk["e"], disk["beta"])
    skew = ju - jv
    rotator = np.empty((phi.size, 8, 3))

    def about_n1(i: int, x: Any, y: Any) -> None:
        size = np.sqrt(x * x + y * y)
        rotator[:, i] = np.stack(np.broadcast_arrays(-q1 * y / size, q1 * x / size, 0.0 * s), -1)

    def about_n2(i: int, y: Any, z: Any) -> None:
        size = np.sqrt(y * y + z * z)
        turned = (0.0 * s, (d2 * y - q2 * z) / size, (d2 * z + q2 * y) / size)
        rotator[:, i] = np.stack(turned, -1)

    def coupled(i: int, *base: Any) -> None:
        vector = np.stack(np.broadcast_arrays(*base), -1)
        size = np.sqrt((vector * vector).sum(axis=-1))
        rotator[:, i] = (2.0 * w1 * dphi / size)[:, None] * vector

    about_n1(0, -disk["a"], 0.0)
    about_n1(1, -across * s, along)
    about_n2(2, across * c, across * s)
    coupled(3, -across * c, 0.0, 0.0)
    about_n1(4, c * jvn, c * skew * s)
    about_n2(5, -jvn * s, jvn * c)
    coupled(6, jvn * s, jn, 0.0)
    coupled(7, 0.0, jn + skew * (c - s) * (c + s), 2.0 * skew * s * c)
    return {
        "rotator": rotator,
        "rotator_intensity": np.sqrt((rotator * rotator).sum(axis=-1)),
        "gamma2": np.arctan2(q2, d2),
        "gamma2_rate": dphi * (2.0 * d2 * d2 - dphi * d3) / (d2 * d2 + q2 * q2),
        "hodograph_u": d2,
        "hodograph_v": q2,
    }


def numpy_bearing_forces(disk: Disk, phi: np.ndarray, dphi: np.ndarray) -> dict[str, np.ndarray]:
    """Forces in both bearings and what belongs to them, as the kernel gives them."""
    s, c = np.sin(phi), np.cos(phi)
    A, B, C = disk_coefficients(*cold(disk))
    m, g, l, w, a = (disk[name] for name in ("m", "g", "half_span", "omega1", "a"))  # noqa: E741
    along, across = disk["e"] * np.cos(disk["beta"]), disk["e"] * np.sin(disk["beta"])
    ju, jv, jn, jvn = disk_inertia(m, disk["r"], disk["e"], disk["beta"])
    skew = ju - jv
    d2, q = -B * s + (A * s + C) * c, dphi * dphi
    third = 0.5 * m * w * w * (a + across * s)
    half_u, half_v = 0.5 * m * across * d2 - third * c, 0.5 * m * across * q + third * s
    first, second = -(jvn * w * c + jn * dphi) * w, skew * w * dphi
    third = m * a * along * w * w
    couple_u = (jvn * d2 + (first + second) * s - third * c) / (2.0 * l)
    couple_v = (jvn * q + (first - second) * c + third * s) / (2.0 * l)
    axial = -m * (w * w * along + 2.0 * w * dphi * across * c)
    kinetic, weight = np.zeros((2, phi.size, 2, 3))
    component = np.empty((phi.size, 2, 4))
    for j, sign in enumerate((1.0, -1.0)):
        kinetic[:, j, 0], kinetic[:, j, 1] = half_u + sign * couple_u, half_v + sign * couple_v
        hold = 0.5 * m * g * (1.0 + sign * along / l)
        weight[:, j, 0], weight[:, j, 1] = hold * s, hold * c
        component[:, j, 0] = sign * first / (2.0 * l)
        component[:, j, 1] = sign * second / (2.0 * l)
        component[:, j, 2] = 0.5 * m * w * w * (a + across * s + sign * a / l * along)
        turning = np.sqrt(d2 * d2 + q * q)
        component[:, j, 3] = (0.5 * m * across + sign * jvn / (2.0 * l)) * turning
    kinetic[:, 0, 2] = axial
    force = kinetic + weight
    coupling = 2.0 * c * (m * a * across + skew * s)
    return {
        "force": force,
        "force_kinetic": kinetic,
        "force_weight": weight,
        "force_magnitude": np.sqrt((force * force).sum(axis=-1)),
        "force_axial": axial,
        "deviation_couple": 2.0 * l * np.sqrt(couple_u * couple_u + couple_v * couple_v),
        "drive_torque": w * dphi * coupling + jvn * (d2 * c - q * s),
        "force_component": component,
    }


def disks(each: bool) -> Disk:
    """One disk, or one for each state."""
    if not each:
        return ONE
    rng = np.random.default_rng(2013)
    spread = {name: value * rng.uniform(0.5, 1.5, STATES) for name, value in ONE.items()}
    return spread | {"g": np.full(STATES, 9.81)}


@pytest.mark.parametrize("each", [False, True], ids=["one disk", "a disk for each state"])
def test_rotators_and_bearing_forces_of_a_million_states(
    each: bool, capsys: pytest.CaptureFixture[str]
) -> None:
    rng = np.random.default_rng(2011)
    disk = disks(each)
    phi, dphi = rng.uniform(-np.pi, np.pi, STATES), 20.0 * rng.normal(size=STATES)
    heavy = tuple(disk[name] for name in ("beta", "e", "a", "r", "omega1", "m", "g", "half_span"))
    kernels: dict[str, Callable[[int], Any]] = {
        "rotators": lambda threads: rotators(*cold(disk), phi, dphi, threads=threads),
        "bearing forces": lambda threads: bearing_forces(*heavy, phi, dphi, threads=threads),
    }
    rivals = {"rotators": numpy_rotators, "bearing forces": numpy_bearing_forces}
    lines = []
    for name, kernel in kernels.items():
        kernel(1)  # compiled
        mine, found = cost(lambda kernel=kernel: kernel(1))
        both, _ = cost(lambda kernel=kernel: kernel(2), clock=time.perf_counter)
        plain, wanted = cost(lambda name=name: rivals[name](disk, phi, dphi))
        lines += [
            (f"phasekit {name}, 1 thread", mine, 1.0),
            (f"phasekit {name}, 2 threads", both, both / mine),
            (f"NumPy, {name}", plain, plain / mine),
        ]
        for field, values in wanted.items():
            got = getattr(found, field)
            size = np.abs(values).reshape(STATES, -1).max(axis=1)
            off = np.abs(got - values).reshape(STATES, -1).max(axis=1) / size
            if field == "gamma2_rate":  # a difference in the jerk
                assert np.median(off) < 1e-15
            else:
                assert off.max() < 1e-9, (field, off.max())
    with capsys.disabled():
        kind = "a disk for each" if each else "of one disk"
        print(f"\n\n{STATES} states, {kind}")
        print("method                                 ns/state   x phasekit")
        for text, spent, ratio in lines:
            print(f"{text:38} {spent / STATES * 1e9:8.0f} {ratio:12.2f}")


# Peaks on separatrices ---------------------------------------------------------------------------


def grid() -> tuple[np.ndarray, np.ndarray]:
    return np.linspace(0.05, 1.5, CELLS[0]), np.linspace(-0.1, 0.1, CELLS[1])


def peaks_by_angle(beta: np.ndarray, a: np.ndarray, samples: int) -> np.ndarray:
    """Peaks by samples even in the angle, speeds from differences of the potential."""
    disk = ONE | {"beta": beta, "a": a}
    A, B, C = disk_coefficients(*cold(disk))
    loops = separatrices(A, B, C, threads=1)
    peak = np.full((beta.size, 2, 2, 2), np.nan)
    part = np.linspace(0.0, 1.0, samples)
    for cell, j, side in np.argwhere((loops.loop > 0)[:, :, None].repeat(2, axis=2)):
        saddle, winding = loops.saddle_phi[cell, j], loops.loop[cell, j] == pk.Loop.WINDING
        way = (2 * side - 1) * 2 * np.pi if winding else loops.turning_offset[cell, j, side]
        phi = saddle + way * part

        def V(x: Any, k: int = cell) -> Any:
            return -B[k] * np.cos(x) + 0.5 * A[k] * np.cos(x) ** 2 - C[k] * np.sin(x)

        speed = np.sign(way) * np.sqrt(np.maximum(2.0 * (V(saddle) - V(phi)), 0.0))
        one = ONE | {"beta": beta[cell], "a": a[cell]}
        ways = (speed,) if winding else (speed, -speed)
        sizes = [numpy_bearing_forces(one, phi, v)["force_magnitude"] for v in ways]
        peak[cell, j, side] = np.max(sizes, axis=(0, 1))
    return peak


def peaks_by_time(beta: np.ndarray, a: np.ndarray, samples: int) -> np.ndarray:
    """Peaks by samples even in time of the motion in closed form, 12/k before and after."""
    disk = ONE | {"beta": beta, "a": a}
    A, B, C = disk_coefficients(*cold(disk))
    loops = separatrices(A, B, C, threads=1)
    peak = np.full((beta.size, 2, 2, 2), np.nan)
    for cell, j, side in np.argwhere((loops.loop > 0)[:, :, None].repeat(2, axis=2)):
        t = np.linspace(-12.0, 12.0, samples) / loops.saddle_exponent[cell, j]
        there = separatrix_motion(A[cell], B[cell], C[cell], t, j, side, threads=1)
        one = ONE | {"beta": beta[cell], "a": a[cell]}
        sizes = numpy_bearing_forces(one, there.motion_phi, there.motion_dphi)["force_magnitude"]
        peak[cell, j, side] = sizes.max(axis=0)
    return peak


def test_peaks_on_the_separatrices_of_a_map(capsys: pytest.CaptureFixture[str]) -> None:
    beta, a = grid()
    size = beta.size * a.size
    full = [np.ravel(x) for x in np.broadcast_arrays(beta[:, None], a)]
    heavy = tuple((ONE | {"beta": full[0], "a": full[1]}).values())
    loops = separatrices(*disk_coefficients(*cold(ONE | {"beta": full[0], "a": full[1]})))
    where = (loops.saddle_phi, loops.saddle_exponent, loops.turning_offset, loops.loop)
    disk = pk.GyroRotorDisk(**ONE)

    separatrix_forces(*heavy, *where, threads=1)
    kernel, found = cost(lambda: separatrix_forces(*heavy, *where, threads=1), 1)
    threads, _ = cost(lambda: separatrix_forces(*heavy, *where, threads=2), 1, time.perf_counter)
    swept, ds = cost(
        lambda: pk.sweep(disk, beta=beta, a=a, of="separatrix_forces", progress=False),
        1,
        time.perf_counter,
    )
    assert np.array_equal(
        ds.peak_force.values.reshape(found.peak.shape), found.peak, equal_nan=True
    )
    rows = [
        ("phasekit, loops known, 1 thread", kernel / size, 0.0),
        ("the same, 2 threads", threads / size, 0.0),
        ("pk.sweep from the parameters on", swept / size, 0.0),
    ]
    some = np.random.default_rng(4).choice(size, 200, replace=False)
    few = tuple(x[some] for x in full)
    separatrix_motion(*disk_coefficients(*cold(ONE)), np.zeros(5_000))  # compiled
    for text, rival in (("in the angle", peaks_by_angle), ("in time", peaks_by_time)):
        for samples in (200, 2000):
            spent, peak = cost(lambda rival=rival, n=samples: rival(*few, n), 1)
            mine = found.peak[some]
            both = (loops.loop[some] != pk.Loop.HETEROCLINIC)[:, :, None, None] & (mine > 0)
            low = 1.0 - peak[both] / mine[both]
            assert low.min() > -1e-9
            if rival is peaks_by_angle:
                assert low.max() < (0.2 if samples == 200 else 0.02)
            rows.append((f"{samples} samples even {text}", spent / some.size, float(low.max())))
    with capsys.disabled():
        print(
            f"\n\npeaks on the separatrices of {size} disks ({int((loops.loop > 0).sum())} saddles)"
        )
        print(
            "method                                  us/disk   x phasekit   peaks too low by up to"
        )
        for text, spent, low in rows:
            print(f"{text:38} {spent * 1e6:8.1f} {spent / rows[0][1]:12.1f} {low:16.1e}")
