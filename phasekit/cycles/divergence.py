"""Orbits with one multiplier besides that of the flow: its logarithm is an integral.

Of orbits in the plane, and of forced systems with one state, the multiplier across the orbit is
exp(int tr f_x dt), and so is the critical function of a fold up to time t. Nothing cancels in that.
Equations for the function are singular by as much as it grows: along canards and other stiff
orbits by many powers of ten.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from phasekit.arrays import Array
from phasekit.cycles import collocation, lines
from phasekit.cycles.cycles import Cycles, Orbit
from phasekit.cycles.linear import Linear
from phasekit.cycles.multilinear import CLOSER


def single(cycles: Cycles) -> bool:
    """Whether orbits have one multiplier besides that of the flow."""
    return cycles.own == (1 if cycles.forced else 2)


@dataclass(frozen=True, eq=False)
class Across:
    """The critical function across an orbit, at all Gauss points, on scaled axes.

    It is size e with a unit normal e. With xi along it, dtau/dt = 1 + alpha size xi + ....
    """

    line: Linear
    e: Array
    A: Array
    trace: Array
    alpha: Array
    #: Logarithms of sizes, less those of the speed, whose largest is `top`.
    log: Array
    speed: Array
    top: float
    #: The logarithm of the multiplier, which is taken out: the function closes.
    total: float
    #: Whether the flow has a direction all along, above what rounding of states changes it by.
    moving: bool

    @property
    def size(self) -> Array:
        """Sizes of the function, the largest being 1."""
        return np.asarray(np.exp(self.log - self.top) / self.speed)

    @property
    def growth(self) -> float:
        """Logarithm of the largest beside the smallest size."""
        return float(np.ptp(self.log - np.log(self.speed)))

    def mean(self, values: Array) -> float:
        """Mean over the period of values at Gauss points."""
        return float(self.line.weights @ values)


def across(line: Linear) -> Across:
    """The function across an orbit."""
    cycles, orbit, n = line.cycles, line.orbit, line.n
    f = line.f / cycles.scale
    A = line.A * cycles.scale / cycles.scale[:, None]
    trace = np.trace(A, axis1=1, axis2=2) * orbit.y[0]
    total = float(line.weights @ trace)
    log, _ = _summed(orbit, trace - total, line.m)
    e, speed = _normal(f, cycles.forced)
    alpha, moving = np.zeros(len(f)), True
    with np.errstate(all="ignore"):  # where the flow rests
        if n == 2:
            sizes = np.abs(line.values(orbit.x) / cycles.scale)
            rounding = lines.EPSILON * np.max(np.einsum("kij,kj->ki", np.abs(A), sizes), axis=1)
            moving = bool(np.all(speed > rounding))
            # Areas grow with the trace, and what is along the flow grows with the speed.
            u = f / speed[:, None]
            turned = np.einsum("ki,kij,kj->k", u, A, e) + np.einsum("ki,kij,kj->k", e, A, u)
            alpha = turned / speed
        top = float(np.max(log - np.log(speed)))
    return Across(line, e, A, trace - total, alpha, log, speed, top, total, moving)


def _normal(f: Array, forced: bool) -> tuple[Array, Array]:
    """Unit normals of the flow, and its speed; of one state that is forced 1."""
    if forced:
        return np.ones((len(f), 1)), np.ones(len(f))
    speed = np.sqrt(np.sum(f * f, axis=1))
    with np.errstate(all="ignore"):  # where an orbit shrinks to an equilibrium there is none
        return np.stack([-f[:, 1], f[:, 0]], axis=1) / speed[:, None], speed


def _summed(orbit: Orbit, values: Array, m: int) -> tuple[Array, Array]:
    """Integrals from 0 of values at Gauss points, up to these and up to all places."""
    inner, outer = collocation.integrals(m)
    h, parts = np.diff(orbit.mesh)[:, None], values.reshape(-1, m)
    whole = np.cumsum(h[:, 0] * (parts @ collocation.scheme(m).weights))
    begin = np.concatenate([[0.0], whole[:-1]])[:, None]
    places = (begin + h * (parts @ outer.T))[:, :m].ravel()
    return (begin + h * (parts @ inner.T)).ravel(), np.append(places, whole[-1])


def function(it: Across, weigh: Array) -> tuple[Array, Array, float]:
    """The critical function at Gauss points, at all places, and the rate at which phases shift.

    That is the same all along. The function is on the side of e and has no part along the flow,
    states being divided by ``weigh``.
    """
    line, scale = it.line, it.line.cycles.scale
    orbit, cycles = line.orbit, line.cycles
    _, log = _summed(orbit, it.trace, line.m)
    times = collocation.times(orbit.mesh, line.m)
    f = cycles.jets.at_mesh(times, orbit.x, orbit.y, 1, cycles.sizes)
    f = np.concatenate([f, f[:1]])
    e, speed = _normal(f / scale, cycles.forced)
    v = it.size[:, None] * it.e * scale
    with np.errstate(all="ignore"):
        wide = (np.exp(log - it.top) / speed)[:, None] * e * scale
    rate = 0.0
    if not cycles.forced:
        shift = it.size * it.alpha * orbit.y[0]
        rate = it.mean(shift)
        near, far = _summed(orbit, shift - rate, line.m)
        off = v + near[:, None] * line.f
        part = it.mean(np.sum(off * line.f / weigh**2, axis=1))
        part /= it.mean(np.sum((line.f / weigh) ** 2, axis=1))
        v = off - part * line.f
        wide = wide + (far - part)[:, None] * f
    return v, wide, rate / float(orbit.y[0])


def fold_form(it: Across, dx: Array, stretch: float) -> dict[str, float]:
    """The coefficients a and b of a fold (see `normal_forms.at_fold`)."""
    line = it.line
    scale, e, size = line.cycles.scale, it.e, it.size
    rate = np.einsum("ki,kij,kj->k", e, it.A, e)
    terms = 0.5 * size * _bend(it), -size * it.alpha * rate
    a = it.mean(terms[0] + terms[1])
    b = it.mean(np.sum(e * (line.by_parameter(stretch) / scale), axis=1) / size)
    v, _, _ = function(it, np.ones(line.n))
    whole = float(np.sqrt(it.mean(np.sum(v * v, axis=1))))
    # A function has one side of the flow all along.
    side = 1.0 if it.mean(np.sum(e * line.values(dx) / scale, axis=1)) >= 0.0 else -1.0
    line.size = sum(it.mean(np.abs(one)) for one in terms) / whole
    return {"a": side * a / whole, "b": side * b * whole}


def _bend(it: Across) -> Array:
    """The part along e of the second derivative of f along e, at all Gauss points."""
    line, scale, e = it.line, it.line.cycles.scale, it.e
    found = np.zeros(len(e))
    along = [np.tile(one * scale, (len(line.orbit.x), 1)) for one in np.eye(line.n)]
    for j in range(line.n):
        for k in range(j, line.n):
            part = np.sum(e * (line.second(along[j], along[k]) / scale), axis=1)
            found += (1.0 if j == k else 2.0) * part * e[:, j] * e[:, k]
    return found


def gradient(cycles: Cycles, orbit: Orbit, jets: Array) -> tuple[float, Array, Array]:
    """The logarithm of the multiplier, and its derivatives by all places and by y."""
    n, m, mesh = cycles.n, cycles.m, orbit.mesh
    weights = np.outer(np.diff(mesh), collocation.scheme(m).weights).ravel()
    period = float(orbit.y[0])

    def traces(x: Array, y: Array) -> Array:
        found = cycles.jets(mesh, x, y, m, cycles.sizes)
        return np.asarray(np.trace(_slopes(found, n), axis1=1, axis2=2)[:, None])

    A = _slopes(jets, n)
    exact = cycles.jets.exact
    trace = np.trace(A, axis1=1, axis2=2)
    size = np.abs(np.diagonal(A, axis1=1, axis2=2)).sum(axis=1)
    noise = np.array([np.max(size) * (lines.EPSILON if exact else lines.DIFFERENCED)])
    by_x = np.empty((len(A), n))
    for k, one in enumerate(np.eye(n)):
        by_x[:, k] = lines.slope_along(
            lambda h, one=one: traces(orbit.x + h * one, orbit.y),  # type: ignore[misc]
            lines.REACH * float(cycles.scale[k]), noise,
        )[:, 0]  # fmt: skip
    by_y = np.zeros(len(orbit.y))
    by_y[0] = float(weights @ trace)
    for k, one in enumerate(np.eye(len(orbit.y))):
        if k == 0 and not cycles.forced:
            continue
        step = lines.REACH * CLOSER * (period if k == 0 else float(cycles.width[k - 1]))
        by_y[k] += period * float(weights @ lines.slope_along(
            lambda h, one=one: traces(orbit.x, orbit.y + h * one), step, noise,  # type: ignore[misc]
        )[:, 0])  # fmt: skip
    row = collocation.functional(mesh, (period * by_x).reshape(-1, m, n), m)
    return period * float(weights @ trace), row, by_y


def _slopes(jets: Array, n: int) -> Array:
    """The matrices f_x."""
    return np.asarray(jets[:, n:].reshape(len(jets), n, -1)[:, :, :n])
