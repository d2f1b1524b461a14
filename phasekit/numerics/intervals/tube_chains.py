"""Tubes in order along a branch: which stretches hold one curve, and what lies in them."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from phasekit.arrays import Array, Flags
from phasekit.numerics.intervals.krawczyk import UNIT, inverses
from phasekit.numerics.intervals.tubes import Tubes, tubes_about
from phasekit.numerics.intervals.zeros import System

#: How often a chord is halved, and chords at a time beside points of the branch.
HALVINGS, CHORDS = 12, 12
#: Newton steps that take a middle to the curve.
STEPS = 4


class Chain(NamedTuple):
    """Tubes in order along a branch, and to which stretches they belong."""

    tubes: Tubes
    owner: npt.NDArray[np.int64]
    joined: Flags
    """Whether each and the next hold the same curve."""


def chain_of(system: System, u: Array, clear: Callable[[Tubes], Flags] | None = None) -> Chain:
    """Tubes from point to point, of halves where those of wholes fail, or are not clear."""
    start, end = u[:-1], u[1:]
    owner = np.arange(len(start))
    place = owner.astype(float)
    length = np.linalg.norm(end - start, axis=1)
    long = length > 64.0 * UNIT * np.linalg.norm(np.abs(end) + np.abs(start), axis=1)
    start, end, owner, place = start[long], end[long], owner[long], place[long]
    parts: list[tuple[Tubes, Any, Array]] = []
    for level in range(HALVINGS + 1):
        found = tubes_about(system, start, end)
        if clear is not None:
            found = found._replace(proved=found.proved & clear(found))
        done = found.proved.copy()
        middle, near = _middles(system, start, end)
        last = level == HALVINGS or 2 * np.sum(~done) > CHORDS * (len(u) + 16)
        done |= ~near | last
        parts.append((found.rows(done), owner[done], place[done]))
        rest = ~done
        if not rest.any():
            break
        step = 0.5 ** (level + 1)
        start, middle, end = start[rest], middle[rest], end[rest]
        start, end = np.concatenate([start, middle]), np.concatenate([middle, end])
        place = np.concatenate([place[rest], place[rest] + step])
        owner = np.tile(owner[rest], 2)
    order = np.argsort(np.concatenate([part[2] for part in parts]), kind="stable")
    arrays = zip(*(part[0] for part in parts), strict=True)
    whole = Tubes(*(np.concatenate(array)[order] for array in arrays))
    # Of two that are not joined the one that is known less well is not used.
    apart = np.flatnonzero(whole.proved[:-1] & whole.proved[1:] & ~whole.joined)
    if apart.size:
        with np.errstate(all="ignore"):
            wide = np.linalg.norm(whole.tip, axis=1) / np.linalg.norm(whole.chord, axis=1)
        whole.proved[np.where(wide[apart] > wide[apart + 1], apart, apart + 1)] = False
    return Chain(whole, np.concatenate([part[1] for part in parts])[order], whole.joined)


def _middles(system: System, start: Array, end: Array) -> tuple[Array, Flags]:
    """Points of the curve half way, across chords, and whether they were found near these."""
    chord, base = end - start, 0.5 * start + 0.5 * end
    u, size = base.copy(), np.linalg.norm(chord, axis=1)
    rows = np.empty((len(u), system.n, system.n))
    with np.errstate(all="ignore"):
        rows[:, -1] = chord / size[:, None]
        for _ in range(STEPS):
            f, slopes, _ = system(u, u)
            rows[:, :-1] = 0.5 * slopes[0] + 0.5 * slopes[1]
            gap = np.sum((u - base) * rows[:, -1], axis=1)
            value = np.concatenate([0.5 * f[0] + 0.5 * f[1], gap[:, None]], axis=1)
            inverse, usable = inverses(rows)
            u = u - np.einsum("kij,kj->ki", inverse, value)
        near = usable & (np.linalg.norm(u - base, axis=1) < 0.5 * size)
    return u, near


def on_curve(chain: Chain, index: int, low: Array, high: Array) -> bool:
    """Whether a box of a zero lies in a tube next to a point, so that it is on the curve."""
    near = (chain.owner == index - 1) | (chain.owner == index)
    return held(chain._replace(tubes=chain.tubes.rows(near)), low, high)


def held(chain: Chain, low: Array, high: Array) -> bool:
    """Whether a box of a zero lies in a tube, so that it is on the curve."""
    tubes = chain.tubes
    count = len(tubes.middle)
    center, radius = 0.5 * low + 0.5 * high, 0.5 * (high - low) * (1.0 + 4.0 * UNIT)
    axes = np.broadcast_to(np.eye(len(low)), (count, len(low), len(low)))
    inside = tubes.hold(
        np.broadcast_to(center, (count, len(low))), axes, np.broadcast_to(radius, (count, len(low)))
    )
    return bool(inside.any())
