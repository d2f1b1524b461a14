"""Constant torques: equilibria under them, the greatest that one can hold, the least that turns.

The extremes of V' are zeros of V'', which is V' of another system: with phi = theta + pi/4,
``V''(phi; A, B, C) = V'(theta; -2 A, (C - B)/sqrt 2, -(B + C)/sqrt 2)``. Between two neighboring
ones V' is monotone, so that it takes each value once or not at all.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from phasekit.errors import EquilibriumKind, Loop
from phasekit.laws.perturbed import PerturbedTrigonometric
from phasekit.perturbation.melnikov import cubes, refuse_prescribed, side_areas
from phasekit.phase.exact.equilibria import Equilibria, equilibria
from phasekit.phase.exact.potential import curvature, gradient, potential
from phasekit.phase.exact.separatrices import separatrices

Array = npt.NDArray[np.float64]

HALVINGS = 64
ROUNDINGS = 4.0 * 2.0**-52


class CriticalTorque(NamedTuple):
    """Least and greatest V'; the last axis is the direction (minus, plus)."""

    critical_torque: Array
    critical_phi: Array


def inflections(A: npt.ArrayLike, B: npt.ArrayLike, C: npt.ArrayLike) -> Array:
    """Zeros of V'' in ascending order on a last axis of length 4, NaN where there are fewer.

    Examples
    --------
    >>> inflections(0.0, 1.0, 0.0).round(6).tolist()
    [-1.570796, 1.570796, nan, nan]
    """
    A, B, C = (np.asarray(x, float) for x in (A, B, C))
    half = np.sqrt(0.5)
    theta = equilibria(-2.0 * A, (C - B) * half, -(B + C) * half).phi
    phi = theta + 0.25 * np.pi
    return np.sort(np.where(phi > np.pi, phi - 2.0 * np.pi, phi), axis=-1)


def critical_torque(A: npt.ArrayLike, B: npt.ArrayLike, C: npt.ArrayLike) -> CriticalTorque:
    """Least and greatest constant torque under which an equilibrium exists.

    Parameters
    ----------
    A, B, C : array_like
        Coefficients in 1/s^2; they broadcast.

    Returns
    -------
    CriticalTorque
        Signed torques, and the angles where the equilibria merge; 0 and NaN without force.

    Examples
    --------
    >>> critical_torque(0.0, 2.0, 0.0).critical_torque.tolist()
    [-2.0, 2.0]
    """
    A, B, C = (np.asarray(x, float)[..., None] for x in (A, B, C))
    at = inflections(A[..., 0], B[..., 0], C[..., 0])
    with np.errstate(all="ignore"):
        slope = np.where(np.isnan(at), np.nan, gradient(A, B, C, at))
        known = np.isfinite(slope).any(axis=-1, keepdims=True)
        low = np.where(known, np.where(np.isnan(slope), np.inf, slope), 0.0)
        high = np.where(known, np.where(np.isnan(slope), -np.inf, slope), 0.0)
    ends = [
        np.take_along_axis(slope, which[..., None], -1)[..., 0]
        for which in (low.argmin(-1), high.argmax(-1))
    ]
    places = [
        np.take_along_axis(at, which[..., None], -1)[..., 0]
        for which in (low.argmin(-1), high.argmax(-1))
    ]
    free = ((A == 0.0) & (B == 0.0) & (C == 0.0))[..., 0]
    torque = np.stack(np.broadcast_arrays(*(np.where(free, 0.0, end) for end in ends)), axis=-1)
    return CriticalTorque(torque, np.stack(places, axis=-1))


def critical_of_perturbed(
    law: PerturbedTrigonometric, *parameters: npt.ArrayLike
) -> CriticalTorque:
    """The same for a perturbed system, whose own torque does not count."""
    return critical_torque(*law.coefficients(law.values(*parameters)))


def retrapping_torque(law: PerturbedTrigonometric, *parameters: npt.ArrayLike) -> Array:
    """Least torque that keeps a rotation going, at small damping; directions minus and plus."""
    refuse_prescribed(law, "retrapping_torque")
    values = law.values(*parameters)
    A, B, C = law.coefficients(values)
    loops = separatrices(A, B, C)
    area, cube = side_areas(loops)[..., 1, :], cubes(A, loops)[..., 1, :]
    arcs = loops.loop[..., 1, None] == Loop.HETEROCLINIC  # both of them make the turn
    area, cube = (np.where(arcs, x.sum(-1, keepdims=True), x) for x in (area, cube))
    damping, quadratic = (values[name][..., None] for name in ("damping", "quadratic"))
    loss = damping * area + quadratic * cube
    return np.asarray(np.array([-1.0, 1.0]) * loss / (2.0 * np.pi))


def torqued_equilibria(law: PerturbedTrigonometric, *parameters: npt.ArrayLike) -> Equilibria:
    """All equilibria under a constant torque, labelled as those that they are without one."""
    values = law.values(*parameters)
    A, B, C = law.coefficients(values)
    torque = values["torque"]
    shape = np.broadcast_shapes(*map(np.shape, values.values()))
    A, B, C, N = (np.array(np.broadcast_to(x, shape)).reshape(-1) for x in (A, B, C, torque))
    found = equilibria_under(A, B, C, N)
    return Equilibria._make(x.reshape(shape + x.shape[1:]) for x in found)


def equilibria_under(A: Array, B: Array, C: Array, N: Array) -> Equilibria:
    """Equilibria of cells in a row, some of them under a torque."""
    points = equilibria(A, B, C)
    fields = [np.array(x) for x in points]
    cells = np.flatnonzero((N != 0.0) | np.isnan(N))
    if cells.size:
        bent = _under_torque(A[cells], B[cells], C[cells], N[cells], points.phi[cells])
        invalid = (points.n_equilibria[cells] < 0) | np.isnan(N[cells])
        bent = bent._replace(n_equilibria=np.where(invalid, -1, bent.n_equilibria))
        parts: tuple[Any, ...] = bent
        for field, one in zip(fields, parts, strict=True):
            field[cells] = one
    return Equilibria._make(fields)


def _under_torque(A: Array, B: Array, C: Array, N: Array, still: Array) -> Equilibria:
    """Equilibria of cells in a row, where V' = N; `still` are those of N = 0."""
    ends = inflections(A, B, C)
    number = np.isfinite(ends).sum(axis=-1)
    following = np.where(
        np.arange(4) == np.maximum(number, 1)[:, None] - 1,
        ends[:, :1] + 2.0 * np.pi,
        np.concatenate([ends[:, 1:], ends[:, :1]], axis=1),
    )
    a, b, c, n = (x[:, None] for x in (A, B, C, N))
    low, high = ends, following
    at_low, at_high = gradient(a, b, c, low) - n, gradient(a, b, c, high) - n
    crossed = np.sign(at_low) * np.sign(at_high) < 0.0  # their product may underflow
    # A torque at an end of what V' takes, within rounding, merges both neighbors there.
    size = np.abs(a) + np.abs(b) + np.abs(c) + np.abs(n)
    touches = np.abs(at_low) <= ROUNDINGS * size
    rises = at_high > at_low
    x = 0.5 * (low + high)
    for _ in range(HALVINGS):
        value = gradient(a, b, c, x) - n
        above = (value > 0.0) == rises
        low, high = np.where(above, low, x), np.where(above, x, high)
        step = x - value / curvature(a, b, c, x)
        x = np.where((step > low) & (step < high), step, 0.5 * (low + high))
    after = np.roll(touches, -1, axis=1)
    last = np.arange(4) == number[:, None] - 1
    after = np.where(last, touches[:, :1], after)
    there = crossed & ~touches & ~after & np.isfinite(x)
    phi = np.where(x > np.pi, x - 2.0 * np.pi, x)
    return _labelled((A, B, C, N), ends, following, phi, there, touches, rises, still)


def _labelled(
    system: tuple[Array, ...], start: Array, stop: Array, phi: Array, there: Any, touches: Any,
    rises: Any, still: Array,
) -> Equilibria:  # fmt: skip
    """Put the equilibrium of each arc where the arc's own at torque 0 stands."""
    A, B, C, N = system
    cells = np.arange(len(A))
    slot = np.full(phi.shape, -1)
    turn = 2.0 * np.pi
    for label in range(4):
        own = still[:, label, None]
        inside = np.mod(own - start, turn) < (stop - start)
        inside &= (rises == (label % 2 == 0)) & (slot < 0)
        found = inside.any(axis=1)
        slot[cells[found], inside.argmax(axis=1)[found]] = label
    for kind in (0, 1):  # arcs that hold none at torque 0 take the labels that are left
        order = (0, 2) if kind == 0 else (3, 1)
        for arc in range(4):
            open_ = (slot[:, arc] < 0) & np.isfinite(phi[:, arc]) & (rises[:, arc] == (kind == 0))
            for label in order:
                free = open_ & ~(slot == label).any(axis=1)
                slot[cells[free], arc] = label
                open_ &= ~free
    out = np.full((len(A), 4), np.nan)
    kinds = np.zeros((len(A), 4), np.int8)
    for arc in range(4):
        good = there[:, arc] & (slot[:, arc] >= 0)
        rows, labels = cells[good], slot[good, arc]
        out[rows, labels] = phi[good, arc]
        kinds[rows, labels] = np.where(
            labels % 2 == 0, EquilibriumKind.CENTER, EquilibriumKind.SADDLE
        )
        merged = touches[:, arc] & (slot[:, arc] >= 0)  # stands once, in the place of the saddle
        pair = np.where(rises[:, arc], (arc - 1) % 4, arc)
        last = np.isfinite(start).sum(axis=1) - 1
        pair = np.where(rises[:, arc] & (arc == 0), last, pair)
        rows = cells[merged]
        labels = slot[rows, pair[merged]]
        out[rows, labels] = start[merged, arc]
        kinds[rows, labels] = EquilibriumKind.DEGENERATE
    a, b, c, n = (x[:, None] for x in (A, B, C, N))
    with np.errstate(all="ignore"):
        bend = np.where(kinds == EquilibriumKind.DEGENERATE, 0.0, curvature(a, b, c, out))
        bend = np.where(np.isnan(out), np.nan, bend)
        energy = potential(a, b, c, out) - n * out
        frequency = np.sqrt(np.where(kinds == EquilibriumKind.CENTER, bend, np.nan))
        exponent = np.sqrt(np.where(kinds == EquilibriumKind.SADDLE, -bend, np.nan))
    count = (kinds > 0).sum(axis=1).astype(np.int8)
    margin = np.full(len(A), np.nan)
    return Equilibria(out, kinds, energy, bend, frequency, exponent, count, margin)
