"""Random planar flows whose homoclinic orbits are algebraic curves, known exactly.

A curve ``F = u v + cubic + quartic = 0`` has a node at 0, and a loop in a quadrant where the ray at
every angle meets it. All fields with ``P F_u + Q F_v = K F`` leave it invariant: the Hamiltonian
``(F_v, -F_u) g``, ``F (a, b)`` and those of linear algebra, whose cofactor K does not vanish at the
node, so that the saddle is not neutral. The loop is an orbit where nothing rests on it. A change of
coordinates and of the units of time hides it; p turns the field and breaks the loop, q changes the
field beside it, and its eigenvalues, so that at p = 0 it stays for all q.

Run as a script it looks for all of 500 of them: ``python tests/labelled/algebraic_loops.py``.
"""

from __future__ import annotations

import sys
import time
from collections import Counter
from typing import NamedTuple

import numpy as np
import xarray as xr
from numpy.polynomial import polynomial

import phasekit as pk

ANGLES = 4001


class Loop(NamedTuple):
    """A flow with its orbit at p = 0."""

    problem: pk.Problem
    saddle: np.ndarray
    time: np.ndarray
    states: np.ndarray
    neutral: float  # q at which the saddle is
    ratio: float  # of its eigenvalues at q = 0
    curve: np.ndarray  # F of the states, beside the sum of its parts

    def off(self, orbit: xr.Dataset) -> float:
        """By how much an orbit is off the curve."""
        return float(np.max(np.abs(polynomial.polyval2d(orbit.x, orbit.y, self.curve))))

    def guess(self, random: np.random.Generator, off: float) -> xr.Dataset:
        """The orbit, moved by a smooth part of its size."""
        size = np.ptp(self.states, axis=0)
        s = np.linalg.norm(np.diff(self.states / size, axis=0), axis=1)
        s = np.append(0.0, np.cumsum(s) / np.sum(s))
        moved = self.states.copy()
        for k in (1, 2, 3):
            moved += off * size * random.standard_normal(2) * np.sin(np.pi * k * s)[:, None] / k
        return xr.Dataset(
            {"x": ("time", moved[:, 0]), "y": ("time", moved[:, 1])}, {"time": self.time}
        )


def _polynomial(random: np.random.Generator, degree: int, least: int = 0) -> np.ndarray:
    """Coefficients ``[i, j]`` of ``u^i v^j``."""
    found = np.zeros((degree + 1, degree + 1))
    for i, j in _powers(degree, least):
        found[i, j] = random.standard_normal()
    return found


def _powers(degree: int, least: int = 0) -> list[tuple[int, int]]:
    return [(i, k - i) for k in range(least, degree + 1) for i in range(k + 1)]


def _product(f: np.ndarray, g: np.ndarray) -> np.ndarray:
    size = len(f) + len(g) - 1
    found = np.zeros((size, size))
    for i, j in zip(*np.nonzero(f), strict=True):
        found[i : i + len(g), j : j + len(g)] += f[i, j] * g
    return found


def _sum(*parts: np.ndarray) -> np.ndarray:
    size = max(len(one) for one in parts)
    return sum(np.pad(one, ((0, size - len(one)),) * 2) for one in parts)


def _composed(f: np.ndarray, u: np.ndarray, v: np.ndarray) -> np.ndarray:
    """Coefficients of f of polynomials u and v."""
    found = np.zeros((1, 1))
    for row in f[::-1]:
        inner = np.zeros((1, 1))
        for value in row[::-1]:
            inner = _sum(_product(inner, v), np.array([[value]]))
        found = _sum(_product(found, u), inner)
    return found


def _slopes(f: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    return tuple(
        np.pad(polynomial.polyder(f, axis=k), [(0, int(k == 0)), (0, int(k == 1))]) for k in (0, 1)
    )


def _formula(f: np.ndarray) -> str:
    parts = [f"{f[i, j]!r}*x**{i}*y**{j}" for i, j in zip(*np.nonzero(f), strict=True)]
    return "(" + " + ".join(one.replace("np.float64(", "").replace(")", "") for one in parts) + ")"


def _radii(parts: list[np.ndarray]) -> np.ndarray | None:
    """The least positive root r of ``parts[0] + parts[1] r + ...`` at every angle."""
    found = np.empty(len(parts[0]))
    for i, row in enumerate(np.stack(parts[::-1], axis=1)):
        roots = np.roots(row)
        roots = roots.real[(np.abs(roots.imag) < 1e-12 * np.abs(roots)) & (roots.real > 0.0)]
        if not len(roots):
            return None
        found[i] = roots.min()
    jump = np.max(np.abs(np.diff(found))) > 0.2 * np.max(found)
    return None if jump or found.max() > 30.0 else found


def _tangent(F: np.ndarray, degree: int) -> list[tuple[np.ndarray, np.ndarray, float]]:
    """Fields along F = 0, and their cofactor at the node."""
    field, factor, size = _powers(degree, 1), _powers(degree - 1), 2 * degree + 1
    slopes = _slopes(F)

    def column(f: np.ndarray, i: int, j: int) -> np.ndarray:
        moved = np.zeros((size, size))
        moved[i : i + len(f), j : j + len(f)] = f
        return moved.ravel()

    columns = [column(one, *power) for one in slopes for power in field]
    columns += [column(-F, *power) for power in factor]
    _, sizes, vectors = np.linalg.svd(np.stack(columns, axis=1))
    found = []
    for row in vectors[int(np.sum(sizes > 1e-10 * sizes[0])) :]:
        parts = np.zeros((2, degree + 1, degree + 1))
        for k in (0, 1):
            for power, value in zip(field, row[k * len(field) :], strict=False):
                parts[k][power] = value
        found.append((parts[0], parts[1], float(row[2 * len(field)])))
    return found


def random_loop(random: np.random.Generator) -> Loop:
    """A flow of the class."""
    while True:
        found = _tried(random)
        if found is not None:
            return found


def _tried(random: np.random.Generator) -> Loop | None:
    degree = int(random.choice([3, 3, 4]))
    F = _polynomial(random, degree, 3)
    F[1, 1] = 1.0
    quadrant = int(random.integers(4))
    angle = np.pi / 2 * (quadrant + np.sin(np.linspace(0, np.pi / 2, ANGLES + 2)[1:-1]) ** 2)
    c, s = np.cos(angle), np.sin(angle)
    r = _radii([sum(F[i, k - i] * c**i * s ** (k - i) for i in range(k + 1))
                for k in range(2, degree + 1)])  # fmt: skip
    if r is None:
        return None
    u, v = r * c, r * s
    tangent = [one for one in _tangent(F, degree) if abs(one[2]) > 1e-6]
    if not tangent:
        return None
    slopes = _slopes(F)
    size = float(np.max(r))
    g = np.zeros((3, 3))
    g[0, 0] = 1.0
    g[2, 0], g[0, 2] = random.uniform(0, 0.5, 2) / size**2
    a, b, a2, b2 = (_polynomial(random, 1) for _ in range(4))

    def some() -> list[np.ndarray]:
        weights = random.standard_normal(len(tangent))
        return [sum(w * one[k] for w, one in zip(weights, tangent, strict=True)) for k in (0, 1)]

    def along(field: list[np.ndarray]) -> np.ndarray:
        """Speed along the curve, times the size of the slopes."""
        P, Q, Fu, Fv = (polynomial.polyval2d(u, v, one) for one in (*field, *slopes))
        return P * Fv - Q * Fu

    N, N2 = some(), some()
    speed = along([slopes[1], -slopes[0]])
    share = [np.max(np.abs(along(one) / speed)) for one in (N, N2)]
    by = random.uniform(-0.9, 0.9) / share[0]
    fields = [
        _sum(_product(g, slopes[1]), _product(F, a), by * N[0]),
        _sum(-_product(g, slopes[0]), _product(F, b), by * N[1]),
    ]
    own = along(fields) / speed
    if np.min(own) < 0.05:
        return None  # something rests on the loop, or nearly so
    by2 = random.uniform(0.3, 0.7) * np.min(own) / share[1]
    second = [_sum(by2 * one, _product(F, w)) for one, w in zip(N2, (a2, b2), strict=True)]
    A = [np.array([[f[1, 0], f[0, 1]] for f in one]) for one in (fields, second)]
    for at in (-1.0, 0.0, 1.0):
        values = np.linalg.eigvals(A[0] + at * A[1])
        if np.iscomplexobj(values) or not 0.05 < -values.min() / values.max() < 20.0:
            return None
    values = np.linalg.eigvals(A[0])
    rate = [polynomial.polyval2d(u, v, one) for one in fields]
    turning = (u * rate[1] - v * rate[0]) / r**2
    t = np.diff(angle) * (1 / turning[1:] + 1 / turning[:-1]) / 2
    t = np.concatenate([[0], np.cumsum(t)])
    if t[-1] < 0:
        t, u, v = t[::-1] - t[-1], u[::-1], v[::-1]
    # u = w0, v = w1 + shear w0^2; w = M (x - x0).
    unit, clock = 10.0 ** random.uniform(-2, 2), 10.0 ** random.uniform(-1, 1)
    shear = random.choice([0.0, 0.0, random.uniform(-0.3, 0.3) / size])
    one, other = (np.linalg.qr(random.standard_normal((2, 2)))[0] for _ in range(2))
    M = one @ np.diag([1.0, random.uniform(0.3, 1)]) @ other / unit
    x0 = random.standard_normal(2) * unit * size * random.choice([0.0, 1.0])
    w = [np.array([[-row @ x0, row[1]], [row[0], 0.0]]) for row in M]
    w[1] = _sum(w[1], shear * _product(w[0], w[0]))
    inverse = np.linalg.inv(M)

    def disguised(field: list[np.ndarray]) -> list[str]:
        bent = [field[0], _sum(field[1], -2 * shear * np.pad(field[0], ((1, 0), (0, 1))))]
        now = [_composed(_sum(*(clock * k * one for k, one in zip(row, bent, strict=True))), *w)
               for row in inverse]  # fmt: skip
        return [_formula(one) for one in now]

    first, more = disguised(fields), disguised(second)
    whole = [f"({one} + q*{other})" for one, other in zip(first, more, strict=True)]
    problem = pk.Problem(
        {"x": f"{whole[0]} - p*{whole[1]}", "y": f"{whole[1]} + p*{whole[0]}"},
        parameters={"p": 0.0, "q": 0.0},
    )
    states = x0 + np.stack([u, v - shear * u**2], axis=1) @ inverse.T
    sizes = sum(np.abs(F[i, j]) * size ** (i + j) for i, j in _powers(degree))
    neutral = float(-np.trace(A[0]) / np.trace(A[1]))
    ratio = float(-values.min() / values.max())
    return Loop(problem, x0, t / clock, states, neutral, ratio, _composed(F, *w) / sizes)


def main(count: int = 500, first: int = 0) -> None:
    """Prints how many are found from guesses and manifolds, and how many curves are right."""
    counts: Counter[str] = Counter()
    for seed in range(first, first + count):
        random = np.random.default_rng(seed)
        loop = random_loop(random)
        said = [f"{seed} ratio {loop.ratio:.3g}"]
        for start in ("guess", "manifold"):
            began = time.process_time()
            p = float(random.choice([-1, 1]) * 10 ** random.uniform(-3, -1.3))
            problem = loop.problem.replace(p=p)
            orbit = (loop.saddle, loop.saddle) if start == "manifold" else loop.guess(random, 0.02)
            try:
                branch = pk.connection(problem, orbit, free="p")
            except (pk.ConvergenceError, pk.ParameterError) as error:
                counts[f"{start}: announced"] += 1
                said.append(f"{start} p={p:.4g} ANNOUNCED {error}")
                continue
            at, spent = float(branch.points.p[0]), time.process_time() - began
            right, off = abs(at) < max(1e-9, 10 * _bound(branch)), loop.off(branch.orbit(0))
            word = "WRONG" if not right else "found" if off < 1e-6 else "another"
            counts[f"{start}: {word}"] += 1
            said.append(f"{start} {word} {at:.1e} off {off:.1e} {spent:.2f} s")
            if start == "manifold" or word != "found":
                continue
            began = time.process_time()
            try:
                curve = branch.curve("q", (-1.0, 1.0))
            except pk.ConvergenceError as error:
                counts["curve: announced"] += 1
                said.append(f"curve ANNOUNCED {error}")
                continue
            worst, reasons = (
                float(np.abs(curve.points.p).max()),
                [one.reason for one in curve.stops],
            )
            ended = reasons == ["bound", "bound"]
            word = "WRONG" if worst > 1e-8 else "followed" if ended else "stopped"
            neutral = [one["q"] for one in curve.special("NSS")]
            exact = [loop.neutral] if abs(loop.neutral) < 1.0 else []
            same = len(neutral) == len(exact) and np.allclose(neutral, exact, atol=1e-6)
            counts[f"curve: {word}"] += 1
            counts[f"neutral: {'right' if same else 'WRONG' if ended else 'not met'}"] += 1
            said.append(
                f"curve {word} {worst:.1e} {reasons} {len(curve.points.p)} points in "
                f"{time.process_time() - began:.2f} s, NSS {neutral}, exact {exact}"
            )
        print("; ".join(said), flush=True)
    print(dict(sorted(counts.items())))


def _bound(branch) -> float:
    return abs(float(branch.points.truncation_error[0])) + abs(float(branch.points.mesh_error[0]))


if __name__ == "__main__":
    main(*map(int, sys.argv[1:]))
