"""Capture at a separatrix: where motions go that are slowly led to it, by the fluxes of phase.

Energies on arrival are spread evenly over what one round loses, so that probabilities are ratios
of the rates at which areas lose phase, ``damping S + dS/dt``: minus the mean of Melnikov's
function.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from phasekit.arrays import Array
from phasekit.errors import Loop, Validity
from phasekit.laws.perturbed import PerturbedLaw
from phasekit.perturbation import melnikov as closed
from phasekit.perturbation import quadrature
from phasekit.perturbation.validity import error, greatest, rates, tilting, tilts, validity
from phasekit.phase.exact.phase_space import phase_space
from phasekit.phase.numerical import functions

#: Energies of saddles that differ by less, relative to those of all equilibria, are one.
LEVEL = 16.0 * 2.0**-52


class Capture(NamedTuple):
    """Capture; the last axis is the region (left, right, none)."""

    capture_flux: Array
    capture_probability: Array
    capture_error: Array
    capture_validity: npt.NDArray[np.int8]


def energy_size(points: Any) -> Array:
    """Greatest energy of an equilibrium without its sign, a constant in V included."""
    energies = np.abs(np.where(points.kind > 0, points.energy, 0.0))
    return np.asarray(energies.max(axis=-1, initial=0.0))


def capture(law: PerturbedLaw, *parameters: npt.ArrayLike, rotation: bool = False) -> Capture:
    """Capture in the potential of (A, B, C): into the lobes of the lower saddle."""
    closed.refuse_prescribed(law, "capture")
    values = law.values(*parameters)
    points, loops = phase_space(*law.coefficients(values))
    loss = -closed.means(law, values, loops)
    # Between two saddles of one energy a region ends in an arc of each, one there and one back.
    joined = loops.loop[..., :1] == Loop.HETEROCLINIC
    lobes = loss[..., 0, :] + np.where(joined, loss[..., 1, ::-1], 0.0)
    winding = loss[..., 1, :] + np.where(joined, loss[..., 0, :], 0.0)  # a turn is both arcs
    push = winding[..., 0] - winding[..., 1]
    push = np.where(np.abs(push) > LEVEL * np.abs(winding).max(axis=-1), push, 0.0)
    single = np.isnan(loops.saddle_phi[..., 0])
    found = regions(lobes, winding, single, push if rotation else None)
    turns = rotation | joined[..., 0]  # there nothing lies outside both wells but rotation
    if not rotation and np.any(joined):
        found = instead(joined, regions(lobes, winding, single, push), found)
    still = points.n_equilibria
    count, still = closed.counts(*law.coefficients(values), values["torque"], still)
    rate = greatest(rates(loss, closed.side_areas(loops), loops.saddle_exponent), (-2, -1))
    tilt = tilts(values["torque"], loops, 2.0 * np.pi)
    return weak(found, law, values, rate, (count, still), loops.saddle_exponent, tilt, turns)


def weak(
    found: tuple[Array, Array], law: PerturbedLaw, values: dict[str, Any], rate: Array,
    counts: tuple[Any, Any], exponents: Any, tilt: tuple[Array, Array], turns: Any,
) -> Capture:  # fmt: skip
    """Odds where damping and drive are weak and nothing else decides; NaN elsewhere.

    ``counts`` are the numbers of equilibria under the torque and without it, ``exponents`` those
    of the saddles, ``tilt`` how the torque changes areas of lobes and of what winds, which matters
    where a motion turns on.
    """
    count, still = counts
    held, exponent = (count > 0) & (count >= still), greatest(exponents, -1)
    tilt = tilt[0], np.where(turns, tilt[1], 0.0)
    flux, probability = found
    rate = np.where(np.isnan(probability).any(axis=-1), np.nan, rate)
    code = validity(law, values, rate, held, exponent=exponent, forced=True, noisy=True)
    good = (code == Validity.HOLDS)[..., None]
    doubt = np.minimum(error(rate) + tilting(probability, tilt), 1.0)
    doubt = np.where(good[..., 0], doubt, np.nan)
    flux, probability = (np.where(good, x, np.nan) for x in (flux, probability))
    return Capture(flux, probability, doubt, code)


def capture_numerical(
    law: PerturbedLaw, *parameters: npt.ArrayLike, rotation: bool = False
) -> Capture:
    """Capture in any potential: lobes of the lowest saddle that has two, loops of the highest."""
    values = law.values(*parameters)
    formula: Any = law.base
    points, loops = functions.phase_space(formula, *(values[name] for name in formula.names))
    loss = -quadrature.melnikov(law, *parameters).melnikov_mean
    circle = formula.period is not None
    push = values["torque"]
    flux, share, turns = of_loops(loops, loss, energy_size(points), push, rotation, circle=circle)
    rate = greatest(rates(loss, closed.side_areas(loops), loops.saddle_exponent), (-2, -1))
    tilt = tilts(values["torque"], loops, formula.period or np.nan)
    counts = quadrature.counts(law, values)
    found = flux, share
    return weak(found, law, values, rate, counts, loops.saddle_exponent, tilt, turns)


def of_loops(
    loops: Any, loss: Array, size: Array, push: Array, rotation: bool, *, circle: bool = True
) -> tuple[Array, Array, Any]:
    """Fluxes and probabilities by the losses of numbered saddles on each side, and what turned.

    Energies are of a size that rounding is measured by; of a push see `regions`.
    """
    if not loss.shape[-2]:
        nothing = np.full((*loss.shape[:-2], 2), np.nan)
        return *regions(nothing, nothing, np.zeros(loss.shape[:-2], bool), None), False
    height, loop = (np.broadcast_to(x, loss.shape[:-1]) for x in (loops.saddle_energy, loops.loop))
    wells = (loop != Loop.ABSENT).sum(axis=-1)  # on a circle as many as saddles
    near = LEVEL * np.broadcast_to(size, loss.shape[:-2])[..., None]
    eights = loop == Loop.LOBES
    lowest = np.where(eights, height, np.inf).min(-1, keepdims=True)
    eights = eights & (height <= lowest + near)
    first = np.take_along_axis(loss, eights.argmax(-1)[..., None, None], -2)[..., 0, :]
    lobes = np.where(eights.any(-1, keepdims=True), first, np.nan)
    arcs = turning_arcs(loops, size, loss.shape[:-1]) & circle
    number = arcs.sum(axis=-1)
    winding = np.where(number[..., None] > 0, total(loss, arcs), np.nan)
    if rotation:  # left and right are all that is there if each arc holds an eight
        each = (wells == 2 * number) & (eights.sum(axis=-1) == number)
        each &= (loop == Loop.LOBES).sum(axis=-1) == number
        lobes = np.where(each[..., None], total(loss, eights), np.nan)
    pair = (number == 2) & (wells == 2)
    if pair.any():  # both wells end in an arc of each saddle, there and back
        two = np.argsort(~arcs, axis=-1, kind="stable")[..., :2, None]
        one, other = np.moveaxis(np.take_along_axis(loss, two, -2), -2, 0)
        lobes = np.where(pair[..., None], one + other[..., ::-1], lobes)
    turned = regions(lobes, winding, (wells == number) & ~pair, push)
    if rotation:
        return *turned, True
    return *instead(pair[..., None], turned, regions(lobes, winding, False, None)), pair


def instead(where: Any, these: tuple[Array, Array], others: tuple[Array, Array]) -> Any:
    """These fluxes and probabilities at some places, the others elsewhere."""
    return tuple(np.where(where, *both) for both in zip(these, others, strict=True))


def turning_arcs(loops: Any, size: Array, shape: tuple[int, ...]) -> Any:
    """Saddles of the highest level that winds: a turn on it is an arc of each."""
    height, loop = (np.broadcast_to(x, shape) for x in (loops.saddle_energy, loops.loop))
    near = LEVEL * np.broadcast_to(size, shape[:-1])[..., None]
    winds = np.isin(loop, (Loop.WINDING, Loop.HETEROCLINIC))
    top = np.where(winds, height, -np.inf).max(-1, keepdims=True, initial=-np.inf)
    return winds & (height >= top - near)


def total(loss: Array, saddles: Any) -> Array:
    """What is lost at some saddles together."""
    return np.asarray(np.where(saddles[..., None], loss, 0.0).sum(axis=-2))


def regions(lobes: Array, winding: Array, single: Any, push: Array | None) -> tuple[Array, Array]:
    """Fluxes and probabilities from the losses of the lobes and of both winding branches.

    A push forward brakes what comes from rotation backward; without any it comes forward. None: it
    comes from outside the lobes. Where a single well is, there are no lobes.
    """
    if push is None:
        flux = np.concatenate([lobes, np.zeros((*lobes.shape[:-1], 1))], axis=-1)
        flux[np.isnan(lobes).any(axis=-1)] = np.nan
        flux[..., 2] -= np.minimum(lobes.sum(axis=-1), 0.0)
        return flux, _shares(lobes)
    with np.errstate(all="ignore"):
        forward = np.broadcast_to(~(push > 0.0), winding.shape[:-1])
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
    return flux, probability


def _shares(lobes: Array) -> Array:
    """Probabilities of left, right and none from outside, by the losses of both lobes."""
    total = lobes.sum(axis=-1, keepdims=True)
    kept = np.maximum(lobes, 0.0)
    with np.errstate(all="ignore"):
        parts = np.where(total > 0.0, kept / kept.sum(axis=-1, keepdims=True), 0.0)
    none = np.where(total > 0.0, 0.0, 1.0)  # not 1 less the parts, whose rounding may be negative
    return np.where(np.isnan(total), np.nan, np.concatenate([parts, none], axis=-1))
