"""Floquet multipliers of a periodic orbit, without forming the product that they belong to."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from phasekit.bifurcation.continuation.periodic import along

Array = npt.NDArray[np.float64]
Complex = npt.NDArray[np.complex128]

APART = 1e-14  # entries below the diagonal blocks that are rounding
ROUNDED = 1e-11  # the same between multipliers of unlike size, whose relative error they are
PASSES = 12
ALIKE = 0.7  # difference of logarithms of multipliers that orthogonal iteration need not part


def multipliers(G: Array) -> tuple[Complex, float]:
    """Eigenvalues of G_N ... G_1, largest first, and the logarithm of the size of their product.

    The product is brought to block triangular form by orthogonal iteration, each of whose blocks
    holds multipliers of like size: so small ones are as accurate, relative to themselves, as
    large ones.
    """
    n = G.shape[1]
    Q, R, log, turn = np.eye(n), np.empty((n, n)), np.empty(n), np.empty((n, n))
    G = np.ascontiguousarray(G)
    if not np.isfinite(G).all():
        return np.full(n, np.nan, dtype=complex), np.nan
    for _ in range(PASSES // 2):
        along.triangular(G, 2, Q, R, log, turn)
        apart = log[:-1] - log[1:]
        below = [float(np.abs(turn[i:, :i]).max()) for i in range(1, n)]
        cuts = [i + 1 for i in range(n - 1) if below[i] <= (ROUNDED if apart[i] > ALIKE else APART)]
        if all(i + 1 in cuts or abs(apart[i]) <= ALIKE for i in range(n - 1)):
            break
        if not np.isfinite(log).all():
            break
    values, logs = [], 0.0
    edges = [0, *cuts, n]
    for first, last in zip(edges[:-1], edges[1:], strict=True):
        here = slice(first, last)
        top = float(np.max(log[here]))
        block = turn[here, here] @ (np.exp(log[here] - top)[:, None] * R[here, here])
        if not np.isfinite(block).all():
            return np.full(n, np.nan, dtype=complex), np.nan
        found = block[0] if last - first == 1 else np.linalg.eigvals(block)
        with np.errstate(all="ignore"):
            values.append(np.asarray(found, dtype=complex) * np.exp(top))
            # Of the values found: the triangle's own would be right even where they are not.
            logs += float(np.sum(np.log(np.abs(found)))) + (last - first) * top
    whole = np.concatenate(values)
    return whole[np.argsort(-np.abs(whole), kind="stable")], logs


def along_flow(G: Array, f: Array) -> tuple[float, float]:
    """The multiplier that belongs to f along the orbit, and how far f is carried off itself.

    Each matrix takes f to f at the next interval, so it is a product of numbers that are near 1:
    as accurate as the orbit, where that of the whole product drowns in the rounding of others.
    """
    after = np.roll(f, -1, axis=0)
    carried = np.einsum("jik,jk->ji", G, f)
    with np.errstate(all="ignore"):
        square = np.einsum("ji,ji->j", after, after)
        part = np.einsum("ji,ji->j", after, carried) / square
        off = np.sqrt(np.einsum("ji->j", (carried - part[:, None] * after) ** 2) / square)
        return float(np.prod(part)), float(np.max(off))


def across(G: Array, f: Array) -> Array:
    """The part of each matrix across a direction that it takes to the next one, as it does f."""
    frames = np.linalg.qr(f[:, :, None], mode="complete")[0][:, :, 1:]
    after = np.roll(frames, -1, axis=0)
    return np.asarray(np.swapaxes(after, 1, 2) @ G @ frames)
