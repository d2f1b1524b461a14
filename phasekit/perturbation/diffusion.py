"""What escape is made of: integrals over a well and over its rim, and the diffusing energy."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from phasekit.arrays import Array
from phasekit.numerics.contract import contract
from phasekit.perturbation.depopulation import NODES, WEIGHTS, panels

#: Panels of a well, finer towards the center, which a cold particle does not leave; or of a rim.
OUTWARDS = np.append(0.0, 0.5 ** np.arange(12, -1, -1))
#: Panels of the energies of a well, finer at its center and at the saddle, where periods grow.
UPWARDS = np.concatenate([[0.0], 0.5 ** np.arange(12, 0, -1), 1.0 - 0.5 ** np.arange(2, 20), [1.0]])
#: Panels of an orbit.
ROUND = np.linspace(-0.5 * np.pi, 0.5 * np.pi, 4)
HALVINGS = 40
TURN = 2.0 * np.pi
#: Cells at a time, for memory.
CELLS = 128


def configuration(
    depth: Callable[[Array], Array], rise: Array, at: Array, start: Array, end: Array, kT: Array
) -> Array:
    """Integral of exp(-(V - V_c)/kT) over a well, from both ends to the center.

    The depth is the energy of a saddle, by `rise` above the center, less the potential.
    """
    x, weight = panels(OUTWARDS)
    total = np.zeros(len(at))
    for side in (start, end):
        phi = at[:, None] + (side - at)[:, None] * x
        level = np.exp((depth(phi) - rise[:, None]) / kT[:, None])
        total = total + np.abs(side - at) * contract(level, weight)
    return np.asarray(total)


def spatial_exponent(
    depth: Callable[[Array], Array], left: Array, right: Array, kT: Array
) -> Array:
    """Exponent with which Kramers' rate at strong damping is exact at a finite barrier.

    ``sqrt(2 pi kT)/int exp((V - V_s)/kT)`` over the rim, from the center on one side to that on
    the other, by the depth below a saddle at distances from it: k where kT -> 0.
    """
    x, weight = panels(OUTWARDS)
    total = np.zeros(kT.shape)
    for way, length in ((-1.0, left), (1.0, right)):
        level = np.exp(-depth(way * length[..., None] * x) / kT[..., None])
        total = total + length * contract(level, weight)
    with np.errstate(all="ignore"):
        return np.asarray(np.sqrt(2.0 * np.pi * kT) / total)


def transition(kT: Array, well: Array) -> Array:
    """Rate of transition-state theory with the integral over the well, times exp(height/kT)."""
    with np.errstate(all="ignore"):
        return np.asarray(np.sqrt(kT / (2.0 * np.pi)) / well)


def passage(action: Callable[[Any, Array], Array], height: Array, damping: Array, kT: Array) -> Any:
    """Mean time in which the energy, diffusing, first comes to the saddle's, over exp(height/kT).

    ``1/(damping kT) int dE exp(E/kT)/S(E) int_0^E T(E') exp(-E'/kT) dE'`` with S' = T; the action
    S of cells at parts of the height is given.
    """
    x, weight = panels(UPWARDS)
    polynomials = np.polynomial.legendre.legvander(NODES, 15)
    powers = [np.polynomial.legendre.legint(np.eye(16)[i], lbnd=-1) for i in range(16)]
    upto = np.stack([np.polynomial.legendre.legval(NODES, p) for p in powers], 1)
    within = upto @ np.linalg.inv(polynomials)  # integrals from the panel's start to each node
    half = 0.5 * np.diff(UPWARDS)
    out = np.full(len(height), np.nan)
    cells = np.flatnonzero(np.isfinite(height) & np.isfinite(kT) & (height > 0.0))
    for start in range(0, len(cells), CELLS):
        part = cells[start : start + CELLS]
        cold = (height[part] / kT[part])[:, None]
        S = action(part, x)
        flow = S * np.exp(-cold * x)
        by_panel = flow.reshape(len(part), -1, 16)
        sums = contract(by_panel, WEIGHTS) * half
        before = np.cumsum(sums, axis=1) - sums
        inner = (before[..., None] + half[:, None] * contract(by_panel, within)).reshape(
            len(part), -1
        )
        with np.errstate(all="ignore"):
            top = (flow + cold * inner) * np.exp(cold * (x - 1.0)) / S
            scale = height[part] / (damping[part] * kT[part])
        out[part] = scale * contract(top, weight)
    return out


def action_in_well(
    depth: Callable[[Array], Array], slope: Callable[[Array], Array], rise: Array,
    center: Array, ends: tuple[Array, Array], x: Array,
) -> Array:  # fmt: skip
    """Area inside the orbits of a well, at parts x of the height of its lower saddle.

    By the depth below that saddle and the slope of the potential at coordinates; the ends may lie
    higher.
    """
    lost = rise[:, None] * (1.0 - x)
    turns = []
    for end in ends:
        low, high = center[:, None] + 0.0 * x, end[:, None] + 0.0 * x
        at = 0.5 * (low + high)
        for _ in range(HALVINGS):
            left = depth(at) - lost
            low, high = np.where(left > 0.0, at, low), np.where(left > 0.0, high, at)
            with np.errstate(all="ignore"):
                step = at + left / slope(at)
            inside = (step - low) * (step - high) < 0.0
            before, at = at, np.where(inside, step, 0.5 * (low + high))
            if not (np.abs(at - before) > 2.0**-52 * np.abs(at)).any():
                break
        turns.append(at)
    tau, weight = panels(ROUND)
    middle, half = 0.5 * (turns[0] + turns[1]), 0.5 * (turns[1] - turns[0])
    square = depth(middle[..., None] + half[..., None] * np.sin(tau)) - lost[..., None]
    speed = np.sqrt(np.maximum(2.0 * square, 0.0))
    return np.asarray(2.0 * np.abs(half) * contract(speed, weight * np.cos(tau)))


def marks_of(phi: Array, saddle: Array, way: float) -> Array:
    """Distances from the saddles to the equilibria on one side: center, saddle, center, saddle.

    The last one is the next of the same saddle; infinite where there are no others.
    """
    own = np.arange(4) == np.array([[1], [3]])
    far = np.mod(way * (phi[:, None, :] - saddle[..., None]), TURN)
    far = np.where(own, TURN, np.where(np.isnan(far), np.inf, far))
    return np.sort(far, axis=-1)
