"""Rates of escape from what is known of a way out: factors, corrections, bracket, regime.

Both factors, for low and for strong damping, hold for high barriers. In the limit of low damping
the energy diffuses, and its mean first passage is known for any barrier: it says by how much the
losses of a round are to be corrected there. In that of strong damping the angle diffuses: that
corrects the exponent of the saddle. Each correction enters in so far as the rate follows the
damping, by the logarithmic derivative of its factor, and the rates with all and with nothing of it
are the bracket.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from phasekit.arrays import Array
from phasekit.errors import EscapeRegime
from phasekit.perturbation.depopulation import depopulation

#: Loss of a round over kT below which the diffusion of the energy limits the escape.
FEW = 1.0
#: Barriers over kT below which a rate means nothing.
LOWEST = 2.0
#: Relative errors from which on it does not either.
WORST = 1.0
#: Step of the logarithmic derivative.
STEP = 0.02
#: Corrections of losses, in kT over the barrier, of wells that hold a saddle: as of single ones.
UNKNOWN = 2.0


class Escape(NamedTuple):
    """Escape; the last axes are saddle and side."""

    escape_rate: Array
    barrier: Array
    escape_regime: npt.NDArray[np.int8]
    escape_error: Array


@dataclass(frozen=True)
class Heat:
    """What is thermal in some cells: damping and kT (NaN where nothing is)."""

    damping: Array
    kT: Array

    def take(self, part: Any) -> Heat:
        """That of some cells."""
        return Heat(self.damping[part], self.kT[part])


def empty(cells: int, saddles: int) -> Escape:
    """Nothing, to be filled."""
    shape = (cells, saddles, 2)
    lost = [np.full(shape, np.nan) for _ in range(3)]
    regime = np.full(shape, EscapeRegime.ABSENT, np.int8)
    return Escape(lost[0], lost[1], regime, lost[2])


@dataclass(frozen=True)
class Exit:
    """A way out of wells.

    Attributes
    ----------
    factor : callable
        What is short at low damping, of a scale of the losses and of the power to which their
        corrections enter.
    known : ndarray
        Whether the corrections are.
    height, loss, k, spatial : ndarray
        Barrier, loss of a round over kT, exponent of the saddle, and that of strong damping.
    """

    factor: Callable[[float, float], Array]
    known: Any
    height: Array
    loss: Array
    k: Array
    spatial: Array


def returning(loss: Array, beyond: Array) -> Array:
    """The factor of a saddle between two wells, out of the other of which it may come back."""
    with np.errstate(all="ignore"):
        return depopulation(loss) * depopulation(beyond) / depopulation(loss + beyond)


def combined(cells: Heat, first: Array, way: Exit) -> tuple[Array, Array, Any, Array]:
    """Rate, barrier, regime and relative error."""
    kT, damping, height = cells.kT, cells.damping, way.height
    with np.errstate(all="ignore"):
        low = kT / height
        plain = way.factor(1.0, 0.0)
        up, down = way.factor(1.0 + STEP, 0.0), way.factor(1.0 / (1.0 + STEP), 0.0)
        order = np.clip(np.log(up / down) / (2.0 * np.log1p(STEP)), 0.0, 1.0)
        span = np.where(way.known, np.log(way.factor(1.0, 1.0) / plain), 0.0)
        half = 0.5 * damping / way.k
        follows = half / np.sqrt(1.0 + half * half)
        recrossing = np.arcsinh(half)
        wide = np.arcsinh(0.5 * damping / way.spatial) - recrossing
        rate = first * plain * np.exp(order * span - recrossing - follows * wide - height / kT)
        error = np.maximum(order, 1.0 - order) * np.abs(span) + 0.25 * low * low
        error = error + np.maximum(follows, 1.0 - follows) * np.abs(wide)
        error = np.where(way.known, error, error + UNKNOWN * low * order)
    sure = np.isfinite(rate) & (height > LOWEST * kT) & ~(error > WORST)
    regime = np.select(
        [~sure, way.loss < FEW, damping > 2.0 * way.k],
        [EscapeRegime.NOT_COMPUTED, EscapeRegime.ENERGY_DIFFUSION, EscapeRegime.SPATIAL_DIFFUSION],
        EscapeRegime.TURNOVER,
    )
    regime = np.where(np.isnan(height), EscapeRegime.ABSENT, regime).astype(np.int8)
    return np.where(sure, rate, np.nan), height, regime, np.where(sure, error, np.nan)


def scatter(out: Escape, found: tuple[Any, ...], row: Any, saddle: Any, side: Any) -> None:
    """Put what is found for some cells where its saddle and side stand."""
    fields: tuple[Any, ...] = out
    for field, value in zip(fields, found, strict=True):
        field[row, saddle, side] = value


def masked(out: Escape, absent: Any, invalid: Any) -> Escape:
    """Without the wells that are not there."""
    for field in (out.escape_rate, out.barrier, out.escape_error):
        field[absent] = np.nan
    out.escape_regime[absent] = EscapeRegime.ABSENT
    out.escape_regime[invalid] = EscapeRegime.NOT_COMPUTED
    return out
