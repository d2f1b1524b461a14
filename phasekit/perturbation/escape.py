"""Escape out of wells by thermal noise, at any damping.

Transition-state theory with the exact integral over the well in place of its harmonic value, times
Kramers' factor for recrossing at the saddle, times the factor of Mel'nikov and Meshkov for what is
short of energy at low damping. That holds for high barriers. At low damping the energy diffuses,
and its mean first passage is known for any barrier, by the exact actions and periods; the ratio of
both corrects the rate, with the weight 1/(1 + D^1.5), D the loss of a round over kT.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from phasekit.errors import EscapeRegime, Loop
from phasekit.laws.perturbed import PerturbedTrigonometric
from phasekit.phase.exact.orbits import energy_rises, orbits_at_energy
from phasekit.phase.exact.potential import potential
from phasekit.phase.exact.separatrices import phase_space

Array = npt.NDArray[np.float64]

NODES, WEIGHTS = (np.asarray(x) for x in np.polynomial.legendre.leggauss(16))
#: Panels of a quarter turn, finer towards its end, where the logarithm is steep at low damping.
QUARTER = 0.5 * np.pi * np.append(1.0 - 0.5 ** np.arange(24), 1.0)
#: Panels of a well, finer towards the center, which a cold particle does not leave.
OUTWARDS = np.append(0.0, 0.5 ** np.arange(12, -1, -1))
#: Panels of the energies of a well, finer towards the saddle's, where periods grow.
UPWARDS = np.concatenate([np.linspace(0.0, 1.0, 25)[:-1], 1.0 - 0.5 ** np.arange(6, 20) / 4, [1.0]])
#: Loss of a round over kT below which the diffusion of the energy limits the escape.
FEW = 1.0
#: Barriers over kT below which a rate means nothing.
LOWEST = 2.0


class Escape(NamedTuple):
    """Escape; the last axes are saddle and side."""

    escape_rate: Array
    barrier: Array
    escape_regime: npt.NDArray[np.int8]
    escape_error: Array


def panels(edges: Array) -> tuple[Array, Array]:
    """Nodes and weights of Gauss's rule on all panels.

    >>> x, w = panels(np.array([0.0, 0.3, 1.0]))
    >>> round(float(np.sum(w * x**3)), 12)
    0.25
    """
    half = 0.5 * np.diff(edges)[:, None]
    middle = 0.5 * (edges[:-1] + edges[1:])[:, None]
    return (middle + half * NODES).reshape(-1), (half * WEIGHTS).reshape(-1)


def depopulation(D: npt.ArrayLike) -> Array:
    """The factor Y(D) of Mel'nikov and Meshkov, D the loss of a round over kT; D for D -> 0.

    ``Y = exp[(1/pi) int_0^inf ln(1 - exp(-D (s^2 + 1/4))) ds/(s^2 + 1/4)]``.

    Examples
    --------
    >>> depopulation([1e-9, 1.0, 100.0]).round(6).tolist()
    [0.0, 0.421463, 1.0]
    """
    theta, weight = panels(QUARTER)
    with np.errstate(all="ignore"):
        steep = np.asarray(D, float)[..., None] / (4.0 * np.cos(theta) ** 2)
        return np.asarray(np.exp(2.0 / np.pi * (np.log(-np.expm1(-steep)) @ weight)))


def escape_rate(
    law: PerturbedTrigonometric, *parameters: npt.ArrayLike, center: int | None = None
) -> Escape:
    """Rates of escape from the well of a center (0 lower, 1 upper)."""
    values = law.values(*parameters)
    shape = np.broadcast_shapes(*map(np.shape, values.values()))
    A, B, C, damping, kT, torque = (
        np.array(np.broadcast_to(x, shape), float).reshape(-1)
        for x in (*law.coefficients(values), *(values[n] for n in ("damping", "kT", "torque")))
    )
    # Without noise or friction nothing is thermal, and under a torque wells are others.
    usable = (damping > 0.0) & (kT > 0.0) & (torque == 0.0) & (values_of(values, shape) == 0.0)
    kT = np.where(usable, kT, np.nan)
    number = 0 if center is None else center
    points, loops = phase_space(A, B, C)
    rises = energy_rises(A, B, C)
    own = points.phi[:, 2 * number]
    lower, upper = loops.saddle_phi[:, 0], loops.saddle_phi[:, 1]
    turn = 2.0 * np.pi
    right = np.mod(own - lower, turn) < np.mod(upper - lower, turn)
    cells = np.arange(len(A))
    side = np.where(right, 1, 0)
    start = np.where(right, lower, upper)
    end = start + np.mod(np.where(right, upper, lower) - start, turn)
    at = start + np.mod(own - start, turn)
    arcs = loops.loop[:, 0] == Loop.HETEROCLINIC
    k = loops.saddle_exponent
    well = _well(A, B, C, at, start, end, kT)
    rate = np.full((len(A), 2, 2), np.nan)
    barrier, error = rate.copy(), rate.copy()
    regime = np.full(rate.shape, EscapeRegime.ABSENT, np.int8)
    # Over the lower saddle into the other lobe, out of which it may come back at once.
    loss, beyond = (damping * loops.lobe_area[cells, 0, which] / kT for which in (side, 1 - side))
    first = _transition(kT, rises[:, number], well)
    share = loss * beyond / (loss + beyond)
    factor = depopulation(loss) * depopulation(beyond) / depopulation(loss + beyond)
    # An arc to a saddle as high: half the area, and nothing that comes back.
    share, factor = (
        np.where(arcs, x, y) for x, y in ((0.5 * loss, share), (depopulation(0.5 * loss), factor))
    )
    time = _passage(A, B, C, number, rises[:, number], damping, kT)
    back = np.where(arcs, 0.5, beyond / (loss + beyond))
    found = _combined(
        first, share, factor, back / time, rises[:, number], kT, loss, damping, k[:, 0]
    )
    for place, value in zip((rate, barrier, regime, error), found, strict=True):
        place[cells, 0, side] = value
    mirror = arcs & np.isfinite(rate[cells, 0, side])
    # Over the winding saddle: out of one well, or out of both together.
    both = np.isfinite(lower)
    whole = _well(A, B, C, upper + np.mod(points.phi[:, 0] - upper, turn), upper, upper + turn, kT)
    height = rises[:, 3]  # from the lower center, in which a cold particle is
    loss = damping * loops.winding_area[:, 1] / kT
    second = _transition(kT, height, whole)
    time = np.where(both, np.nan, _passage(A, B, C, 0, height, damping, kT))
    found = _combined(
        second, loss, depopulation(loss), 0.5 / time, height, kT, 2.0 * loss, damping, k[:, 1]
    )
    for which in (0, 1):
        for place, value in zip((rate, barrier, regime, error), found, strict=True):
            place[:, 1, which] = value
    for place in (rate, barrier, regime, error):  # two saddles of one energy, one at each end
        place[mirror, 1] = np.nan if place.dtype.kind == "f" else EscapeRegime.ABSENT
        place[cells[mirror], 1, 1 - side[mirror]] = place[cells[mirror], 0, side[mirror]]
    none = np.isnan(points.phi[:, 2 * number])
    for place in (rate, barrier, error):
        place[none] = np.nan
    regime[none] = EscapeRegime.ABSENT
    regime[points.n_equilibria < 0] = EscapeRegime.NOT_COMPUTED
    return Escape._make(x.reshape(shape + (2, 2)) for x in (rate, barrier, regime, error))


def values_of(values: dict[str, Any], shape: tuple[int, ...]) -> Array:
    """What else moves the particle, for which the rates do not hold."""
    drive = [abs(x) for n, x in values.items() if n.endswith("_amplitude") or n == "quadratic"]
    drive += [abs(x) for n, x in values.items() if n.startswith("drift_")]
    return np.array(np.broadcast_to(sum(drive), shape), float).reshape(-1)


def _well(A: Array, B: Array, C: Array, at: Array, start: Array, end: Array, kT: Array) -> Array:
    """Integral of exp(-(V - V_c)/kT) over a well, from both ends to the center."""
    x, weight = panels(OUTWARDS)
    a, b, c, t, place = (v[:, None] for v in (A, B, C, kT, at))
    bottom = potential(A, B, C, at)[:, None]
    total = np.zeros(len(A))
    for side in (start, end):
        phi = place + (side[:, None] - place) * x
        level = np.exp((bottom - potential(a, b, c, phi)) / t)
        total = total + np.abs(side - at) * (level @ weight)
    return np.asarray(total)


def _transition(kT: Array, height: Array, well: Array) -> Array:
    with np.errstate(all="ignore"):
        return np.asarray(np.sqrt(kT / (2.0 * np.pi)) * np.exp(-height / kT) / well)


def _recrossing(damping: Array, k: Array) -> Array:
    with np.errstate(all="ignore"):
        half = 0.5 * damping / k
        return np.asarray(1.0 / (np.sqrt(1.0 + half * half) + half))


def _passage(
    A: Array, B: Array, C: Array, center: int, height: Array, damping: Array, kT: Array
) -> Array:
    """Mean time in which the energy, diffusing, first comes to the saddle's."""
    x, weight = panels(UPWARDS)
    polynomials = np.polynomial.legendre.legvander(NODES, 15)
    powers = [np.polynomial.legendre.legint(np.eye(16)[i], lbnd=-1) for i in range(16)]
    upto = np.stack([np.polynomial.legendre.legval(NODES, p) for p in powers], 1)
    within = upto @ np.linalg.inv(polynomials)  # integrals from the panel's start to each node
    half = 0.5 * np.diff(UPWARDS)
    bottom = potential(A, B, C, _center(A, B, C, center))
    out = np.full(len(A), np.nan)
    cells = np.flatnonzero(np.isfinite(height) & np.isfinite(kT))
    for part in np.array_split(cells, max(1, len(cells) // 512 + 1)):
        if not part.size:
            continue
        h, t = height[part, None], kT[part, None]
        excess = h * x
        orbit = orbits_at_energy(
            A[part, None], B[part, None], C[part, None], bottom[part, None] + excess, center
        )
        flow = orbit.period * np.exp(-excess / t)
        by_panel = flow.reshape(len(part), -1, 16)
        sums = (by_panel @ WEIGHTS) * half
        before = np.cumsum(sums, axis=1) - sums
        inner = (before[..., None] + half[:, None] * (by_panel @ within.T)).reshape(len(part), -1)
        with np.errstate(all="ignore"):
            top = inner * np.exp((excess - h) / t) / (2.0 * np.pi * orbit.action)
            scale = h[:, 0] ** 2 * np.exp(h[:, 0] / t[:, 0]) / (damping[part] * t[:, 0])
        out[part] = scale * (top @ weight)
    return out


def _center(A: Array, B: Array, C: Array, center: int) -> Array:
    return np.asarray(phase_space(A, B, C)[0].phi[:, 2 * center])


def _combined(
    first: Array, share: Array, factor: Array, diffusing: Array, height: Array, kT: Array,
    loss: Array, damping: Array, k: Array,
) -> tuple[Array, Array, Any, Array]:  # fmt: skip
    """Rate, barrier, regime and relative error."""
    with np.errstate(all="ignore"):
        # Both in the limit of low damping: 1 for a high barrier.
        ratio = diffusing / (first * share)
        known = np.isfinite(ratio)
        weight = 1.0 / (1.0 + loss**1.5)
        rate = first * _recrossing(damping, k) * factor
        rate = rate * np.where(known, ratio, 1.0) ** weight
        low = kT / height
        error = low * (0.15 + np.where(known, 0.5, 2.0) * weight)
    sure = np.isfinite(rate) & (height > LOWEST * kT)
    regime = np.select(
        [~sure, loss < FEW, damping > 2.0 * k],
        [EscapeRegime.NOT_COMPUTED, EscapeRegime.ENERGY_DIFFUSION, EscapeRegime.SPATIAL_DIFFUSION],
        EscapeRegime.TURNOVER,
    )
    regime = np.where(np.isnan(height), EscapeRegime.ABSENT, regime).astype(np.int8)
    return np.where(sure, rate, np.nan), height, regime, np.where(sure, error, np.nan)
