"""Where what is of first order in damping and drive holds, and how far it is off.

Small is what a motion loses in one round of the separatrix, beside the area S of the round times
the exponent k of its saddle: of the order of the depth of the wells. Linear damping d makes d/k of
it.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import numpy.typing as npt

from phasekit.arrays import Array, Codes
from phasekit.errors import Loop, Validity
from phasekit.laws.perturbed import PerturbedLaw

#: Part of S k from which on a loss is not small.
WEAK = 1.0
#: The same of thresholds, which are in proportion to the damping: with 2 k nothing swings.
OVERDAMPED = 2.0
#: Error of the odds of capture over ``rate (1 + log(1/rate))``, as simulated motions have it.
SPREAD = 0.25
#: Relative change of an area by a torque, over the work of the torque across it beside S k.
TILT = 3.0
#: Error of the mean along what winds, beside S k, over the cubes of its parts beside that.
CUBIC = 1.2
#: Relative change of a loop by a swing, over k/S times its square, as integrated manifolds have it.
ROUND = 1.5
#: Part of the loss of a lobe that turns with a slow drive, as integrated manifolds have it.
SLOW = 0.8
#: Relative change of the response of a lobe, over that of its area by a torque times its slope, as
#: integrated manifolds have it.
RESPONSE = 0.4
#: Relative change of a threshold by a torque, or a drive, up to which it holds.
WITHIN = 0.25


def rates(loss: Array, area: Any, exponent: Any) -> Array:
    """Losses of a round beside S k; the last axes are saddle and side."""
    with np.errstate(all="ignore"):
        return np.asarray(np.abs(loss) / (area * np.asarray(exponent)[..., None]))


def tilts(torque: Any, loops: Any, period: float) -> tuple[Array, Array]:
    """Relative changes by a torque of the areas of lobes, and of what winds: each the greatest."""
    k = np.asarray(loops.saddle_exponent)[..., None]
    push = TILT * np.abs(np.asarray(torque))[..., None, None]
    with np.errstate(all="ignore"):
        lobes = push * np.abs(loops.turning_offset) / (loops.lobe_area * k)
        winding = push * period / (loops.winding_area[..., None] * k)
    return greatest(lobes, (-2, -1)), greatest(winding, (-2, -1))


def tilting(probability: Array, tilt: tuple[Array, Array]) -> Array:
    """Greatest change of odds (left, right, none) by such changes of areas."""
    lobes, winding = (np.where(np.isnan(x), 0.0, x) for x in tilt)
    left, right = probability[..., 0], probability[..., 1]
    both = left + right
    with np.errstate(all="ignore"):
        parted = np.where(both > 0.0, 2.0 * left * right / both, 0.0) * lobes
    return np.asarray(parted + both * winding)


def tilt_share(torque: Any, ways: tuple[Any, Any], mean: Array, size: Any) -> Array:
    """Relative change of a threshold by what a torque does to a loop; the size is S k.

    The ways are the angle by which a loop leads on, and how far it reaches. A lobe changes its
    area; on what winds the torque's work is exact, and what remains is of third order in all parts.
    """
    on, reach = ways
    with np.errstate(all="ignore"):
        work, all_ = torque * on / size, mean / size
        rest = np.abs(all_ - work)
        cubes = np.maximum(np.abs(work) ** 3 + rest**3, np.abs(all_) ** 3)
        winding = CUBIC * (cubes / np.abs(all_) - rest**2)
        change = np.where(on == 0.0, TILT * np.abs(torque * reach) / size, winding)
    return np.asarray(np.where(torque == 0.0, 0.0, change))


def bend(third: Any, fourth: Any, exponent: Any) -> Array:
    """Relative change of k by a swing, over its square, from derivatives of V at the saddle."""
    with np.errstate(all="ignore"):
        return np.asarray(np.abs(fourth + (third / exponent) ** 2) / (8.0 * exponent**2))


def drive_share(
    drives: Sequence[tuple[Any, ...]], mean: Array, area: Any, exponent: Any, lobes: Any,
    sharp: Any, tilt: Any,
) -> Array:  # fmt: skip
    """Relative error of a threshold, for the drive at it is not weak, and a torque tilts the loop.

    Of each drive: the amplitude at the threshold, per unit of it the greatest force, the frequency,
    the response ``|Z|`` and ``|nu dZ/dnu|``. A motion swings by ``a/(nu^2 + k^2)``. In the mean
    over it the potential is ``V + a^2 V''/(4 (nu^2 + k^2)^2)``, which changes k by the square of
    the swing times what is sharp, and the loop by about k/S times that; the
    response by as much times its slope. A slow drive moves the loss in a lobe with it, out of
    phase. What a torque changes of a lobe changes its response, too.
    """
    swing, turned, slopes = (np.zeros(np.shape(mean)) for _ in range(3))
    with np.errstate(all="ignore"):
        for amplitude, force, frequency, response, slope in drives:
            spread = 1.0 + (frequency / exponent) ** 2
            driven = np.asarray(amplitude != 0.0)
            swung = amplitude * force / (exponent**2 * spread)
            moved = amplitude * slope / np.abs(mean)
            late = SLOW * amplitude * response / (area * frequency * spread)
            swing = swing + np.where(driven, swung, 0.0)
            slopes = slopes + np.where(driven, moved, 0.0)
            turned = turned + np.where(driven & lobes, late, 0.0)
        changed = swing**2 * np.maximum(ROUND * exponent / area, sharp)
        driven_share = changed * (1.0 + slopes) + np.hypot(1.0, turned) - 1.0
        responds = np.where(lobes, np.hypot(1.0, RESPONSE * slopes), 1.0)
        return np.asarray(np.hypot(driven_share, tilt * responds))


def saddles_held(loop: Any, count: Any, still: Any) -> npt.NDArray[np.bool_]:
    """Which saddles a torque leaves, by the numbers of equilibria with it and without.

    One that winds is there as long as there are two, which merge at the critical torque, or as
    many as without a torque; one of lobes while no well is gone.
    """
    winds = np.isin(loop, (Loop.WINDING, Loop.HETEROCLINIC))
    count, still = (np.asarray(x)[..., None] for x in (count, still))
    level = (count > 0) & (count >= still)
    return np.asarray(np.where(winds, (count > 1) | level, level))


def greatest(values: Array, axis: Any) -> Array:
    """The greatest of those that there are; NaN where there are none."""
    there = np.isfinite(values)
    most = np.where(there, values, -np.inf).max(axis=axis, initial=-np.inf)
    return np.asarray(np.where(there.any(axis=axis), most, np.nan))


def error(rate: Array) -> Array:
    """Estimated error of odds that are of first order in a rate: O(rate log rate)."""
    with np.errstate(all="ignore"):
        part = SPREAD * rate * (1.0 + np.log(1.0 / np.minimum(rate, 1.0)))
    return np.asarray(np.where(rate == 0.0, 0.0, part))


def validity(
    law: PerturbedLaw,
    values: dict[str, Any],
    rate: Array,
    held: Any = True,
    *,
    tilted: Any = False,
    exponent: Any = None,
    forced: bool = False,
    noisy: bool = False,
    most: float = WEAK,
) -> Codes:
    """Whether a result of first order holds, cell by cell.

    ``rate`` is the loss beside S k, NaN without a separatrix; ``held`` whether the torque leaves
    its equilibria, ``tilted`` whether it changes too much; ``exponent`` that of the saddle, beside
    which damping is small; ``forced`` and ``noisy`` whether a drive and noise matter; ``most`` the
    greatest rate.
    """
    shape = np.broadcast_shapes(np.shape(rate), *(np.shape(x) for x in values.values()))
    code = np.full(shape, Validity.HOLDS, np.int8)
    strong = rate > most
    if exponent is not None:
        with np.errstate(all="ignore"):
            strong = strong | (np.abs(values["damping"]) > most * exponent)
    driven = np.zeros(shape, bool)
    for amplitude, *_ in law.forcing(values) if forced else ():
        driven |= np.asarray(amplitude) != 0.0
    if forced and law.modulated:
        driven[...] = True
    for bad, meaning in (
        (np.asarray(tilted), Validity.TILTED),
        (strong, Validity.NOT_WEAK),
        (driven, Validity.FORCED),
        ((values["kT"] != 0.0) if noisy else np.zeros(shape, bool), Validity.NOISY),
        (~np.asarray(held), Validity.NO_EQUILIBRIUM),
        (np.isnan(rate), Validity.ABSENT),
    ):
        code = np.where(np.broadcast_to(bad, shape), np.int8(meaning), code)
    invalid = np.zeros(shape, bool)
    for value in values.values():
        invalid |= np.isnan(np.asarray(value, float))
    return np.asarray(np.where(invalid, np.int8(Validity.NOT_COMPUTED), code), np.int8)
