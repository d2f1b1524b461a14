"""Where what is of first order in damping and drive holds, and how far it is off.

Small is what a motion loses in one round of the separatrix, beside the area S of the round times
the exponent k of its saddle: of the order of the depth of the wells. Linear damping d makes d/k of
it.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

from phasekit.errors import Validity
from phasekit.laws.perturbed import PerturbedLaw

Array = npt.NDArray[np.float64]
Codes = npt.NDArray[np.int8]

#: Part of S k from which on a loss is not small.
WEAK = 1.0
#: The same of thresholds, which are in proportion to the damping: with 2 k nothing swings.
OVERDAMPED = 2.0
#: Error of the odds of capture over ``rate (1 + log(1/rate))``, as simulated motions have it.
SPREAD = 0.25


def rates(loss: Array, area: Any, exponent: Any) -> Array:
    """Losses of a round beside S k; the last axes are saddle and side."""
    with np.errstate(all="ignore"):
        return np.asarray(np.abs(loss) / (area * np.asarray(exponent)[..., None]))


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
    exponent: Any = None,
    forced: bool = False,
    noisy: bool = False,
    most: float = WEAK,
) -> Codes:
    """Whether a result of first order holds, cell by cell.

    ``rate`` is the loss beside S k, NaN without a separatrix; ``held`` whether the torque leaves
    equilibria; ``exponent`` that of the saddle, beside which damping is small; ``forced`` and
    ``noisy`` whether a drive and noise matter; ``most`` the greatest rate.
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
