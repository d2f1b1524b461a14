"""Capture at a separatrix: where motions go that are slowly led to it, by the fluxes of phase.

Energies on arrival are spread evenly over what one round loses, so that probabilities are ratios
of the rates at which areas lose phase, ``damping S + dS/dt``: minus the mean of Melnikov's
function.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from phasekit.errors import EquilibriumKind, Loop
from phasekit.laws.perturbed import PerturbedConservative, PerturbedTrigonometric
from phasekit.perturbation import melnikov as closed
from phasekit.perturbation import quadrature
from phasekit.phase.exact.separatrices import separatrices
from phasekit.phase.numerical import functions

Array = npt.NDArray[np.float64]


#: Energies of saddles that differ by less, relative to those of all equilibria, are one.
LEVEL = 16.0 * 2.0**-52


class Capture(NamedTuple):
    """Capture; the last axis is the region (left, right, none)."""

    capture_flux: Array
    capture_probability: Array


class Landscape(NamedTuple):
    """What of the potentials, one a cell, tells levels from rounding and wells from others."""

    wells: Any
    energy_size: Any
    """Greatest energy of an equilibrium without its sign, a constant in V included."""

    @classmethod
    def of(cls, points: Any) -> Landscape:
        """From the equilibria."""
        size = np.abs(np.where(points.kind > 0, points.energy, 0.0)).max(axis=-1, initial=0.0)
        return cls((points.kind == EquilibriumKind.CENTER).sum(axis=-1), size)


def capture(
    law: PerturbedTrigonometric, *parameters: npt.ArrayLike, rotation: bool = False
) -> Capture:
    """Capture in the potential of (A, B, C): into the lobes of the lower saddle."""
    closed.refuse_prescribed(law, "capture")
    values = law.values(*parameters)
    loops = separatrices(*law.coefficients(values))
    loss = -closed.means(law, values, loops)
    # Between two saddles of one energy a region ends in an arc of each, one there and one back.
    joined = loops.loop[..., :1] == Loop.HETEROCLINIC
    lobes = loss[..., 0, :] + np.where(joined, loss[..., 1, ::-1], 0.0)
    winding = loss[..., 1, :] + np.where(joined, loss[..., 0, :], 0.0)  # a turn is both arcs
    return regions(lobes, winding, np.isnan(loops.saddle_phi[..., 0]), rotation)


def capture_numerical(
    law: PerturbedConservative, *parameters: npt.ArrayLike, rotation: bool = False
) -> Capture:
    """Capture in any potential: lobes of the lowest saddle that has two, loops of the highest."""
    values = law.values(*parameters)
    formula: Any = law.base
    points, loops = functions.phase_space(formula, *(values[name] for name in formula.names))
    loss = -quadrature.melnikov(law, *parameters).melnikov_mean
    circle = formula.period is not None
    return of_loops(loops, loss, Landscape.of(points), rotation=rotation, circle=circle)


def of_loops(
    loops: Any, loss: Array, ground: Landscape, *, rotation: bool, circle: bool = True
) -> Capture:
    """Capture by the separatrices of numbered saddles, and what they lose on each side."""
    if not loss.shape[-2]:
        nothing = np.full((*loss.shape[:-2], 2), np.nan)
        return regions(nothing, nothing, np.zeros(loss.shape[:-2], bool), rotation)
    height, loop = (np.broadcast_to(x, loss.shape[:-1]) for x in (loops.saddle_energy, loops.loop))
    wells, size = (np.broadcast_to(x, loss.shape[:-2]) for x in ground)
    lowest = np.where(loop == Loop.LOBES, height, np.inf)
    at = lowest.argmin(-1)[..., None]
    found = np.isfinite(np.take_along_axis(lowest, at, -1))
    lobes = np.where(found, np.take_along_axis(loss, at[..., None], -2)[..., 0, :], np.nan)
    winds = np.isin(loop, (Loop.WINDING, Loop.HETEROCLINIC)) & circle
    highest = np.where(winds, height, -np.inf)
    top = highest.max(-1, keepdims=True)
    # A turn on a level of several saddles is an arc of each.
    arcs = winds & (top - highest <= LEVEL * size[..., None])
    winding = np.where(arcs[..., None], loss, 0.0).sum(axis=-2)
    winding = np.where(arcs.any(-1, keepdims=True), winding, np.nan)
    number = arcs.sum(axis=-1)
    if loss.shape[-2] > 1:  # two wells end in an arc of both their saddles, there and back
        pair = np.argsort(~arcs, axis=-1, kind="stable")[..., :2, None]
        one, other = np.moveaxis(np.take_along_axis(loss, pair, -2), -2, 0)
        two = ((number == 2) & (wells == 2))[..., None]
        lobes = np.where(two, one + other[..., ::-1], lobes)
    if rotation:  # of three wells or more two would be no answer
        winding = np.where((wells <= 2)[..., None], winding, np.nan)
    return regions(lobes, winding, wells == 1, rotation)


def regions(lobes: Array, winding: Array, single: Any, rotation: bool) -> Capture:
    """Fluxes and probabilities from the losses of the lobes and of both winding branches.

    Where a single well is, there are no lobes.
    """
    if not rotation:
        flux = np.concatenate([lobes, np.zeros((*lobes.shape[:-1], 1))], axis=-1)
        flux[np.isnan(lobes).any(axis=-1)] = np.nan
        flux[..., 2] -= np.minimum(lobes.sum(axis=-1), 0.0)
        return Capture(flux, _shares(lobes))
    with np.errstate(all="ignore"):
        # What is braked loses more; forward where nothing tells, within rounding.
        forward = ~(winding[..., 0] - winding[..., 1] > 1e-9 * np.abs(winding).max(axis=-1))
        arriving = np.where(forward, winding[..., 1], winding[..., 0])
        inside = winding.sum(axis=-1)
        share = np.where(arriving > 0.0, np.clip(inside / arriving, 0.0, 1.0), 0.0)
    share = np.where(np.isnan(arriving), np.nan, share)
    side = np.stack([np.where(forward, 0.0, 1.0), np.where(forward, 1.0, 0.0)], axis=-1)
    shares = _shares(lobes)
    single = np.broadcast_to(single, share.shape)
    parts = np.where(single[..., None], side, shares[..., :2])
    held = np.where(single, 1.0, 1.0 - shares[..., 2])
    none = 1.0 - share * held
    probability = np.concatenate([parts * share[..., None], none[..., None]], axis=-1)
    flux = probability * np.maximum(arriving, 0.0)[..., None]
    return Capture(flux, probability)


def _shares(lobes: Array) -> Array:
    """Probabilities of left, right and none from outside, by the losses of both lobes."""
    total = lobes.sum(axis=-1, keepdims=True)
    kept = np.maximum(lobes, 0.0)
    with np.errstate(all="ignore"):
        parts = np.where(total > 0.0, kept / kept.sum(axis=-1, keepdims=True), 0.0)
    none = np.where(total > 0.0, 0.0, 1.0)  # not 1 less the parts, whose rounding may be negative
    return np.where(np.isnan(total), np.nan, np.concatenate([parts, none], axis=-1))
