"""Branches between their points, proved: one curve of zeros in a tube about each chord.

F maps N unknowns to N - 1 equations; its zeros near a regular point are a curve. About the chord
from one point of it to the next, u = c + s d + T w, the columns of T across. With Y close to the
inverse of F'(c) T and J the derivatives over the whole tube, the operator

    K(W) = -Y F(c) - Y J d s + (I - Y J T) W

holds all zeros w of each s with |w| <= W: where it lies inside W there is exactly one for each s,
so one smooth curve through the tube: [MooreKearfottCloud2009] 8.2, with s as a parameter. Two
tubes hold one curve if the zero of the first next to their common point lies in the second, where a
zero is alone. Unknowns may be measured in units of their own.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np

from phasekit.arrays import Array, Flags
from phasekit.numerics.intervals.krawczyk import UNIT, inverses
from phasekit.numerics.intervals.zeros import System

#: How much further than its chord a tube goes at either end at least, in parts of the chord.
BEYOND = 1e-3
#: How often a tube is widened until it holds its image, and once it does, and by how much then.
TRIES, WIDENINGS, WIDER = 12, 2, 4.0
#: Part of what an image was beside its tube, above which widening is given up.
STUCK = 0.97
#: What frames of chords are off by, beside one.
FRAME = 1e-14


class Tubes(NamedTuple):
    """Tubes about chords, each of its own."""

    middle: Array
    """c, of shape (chords, N)."""
    chord: Array
    """d, of shape (chords, N)."""
    across: Array
    """T, of shape (chords, N, N - 1)."""
    beyond: Array
    """How much further the tube goes at either end, in parts of the chord, of shape (chords,)."""
    end: Array
    """Where the chords end, of shape (chords, N)."""
    tip: Array
    """How far the curve may be from there across, of shape (chords, N - 1)."""
    radius: Array
    """How far the curve may be from the chord across, of shape (chords, N - 1)."""
    alone: Array
    """How far across there is no other zero."""
    proved: Flags
    """Whether each tube holds one curve."""
    defined: Flags
    """Whether formulas and derivatives are known to be defined all over it."""

    @property
    def joined(self) -> Flags:
        """Whether it is the same curve in each tube and the next, of shape (chords - 1,)."""
        return joined(self.rows(slice(None, -1)), self.rows(slice(1, None)))

    def rows(self, which: Any) -> Tubes:
        """Some of them."""
        return Tubes(*(array[which] for array in self))

    @property
    def reach(self) -> Array:
        """How far from its middle each tube goes, of shape (chords, N)."""
        size = np.einsum("kij,kj->ki", np.abs(self.across), self.radius)
        whole = (0.5 + self.beyond)[:, None] * np.abs(self.chord) + size
        return whole * (1.0 + FRAME) + 4.0 * UNIT * np.abs(self.middle)

    def hold(self, center: Array, axes: Array, radius: Array) -> Flags:
        """Whether what lies so far from centers along axes is in the tube of the same row.

        Zeros there are on the curve. Axes are of shape (chords, N, m), lengths (chords, m).
        """
        with np.errstate(all="ignore"):
            return self._hold(center, axes, radius)

    def _hold(self, center: Array, axes: Array, radius: Array) -> Flags:
        size = np.linalg.norm(self.chord, axis=1)
        u = center - self.middle
        lengths = np.einsum("kij,kj->ki", np.abs(axes), radius)
        blur = FRAME * np.linalg.norm(np.abs(u) + lengths, axis=1) + 4.0 * UNIT * np.linalg.norm(
            np.abs(center) + np.abs(self.middle), axis=1
        )
        turned = np.einsum("kij,kil->kjl", self.across, axes)
        w = np.abs(np.einsum("ki,kij->kj", u, self.across)) + blur[:, None]
        w += np.einsum("kjl,kl->kj", np.abs(turned), radius)
        d = self.chord / size[:, None]
        s = np.abs(np.sum(u * d, axis=1)) + blur
        s += np.einsum("kl,kl->k", np.abs(np.einsum("ki,kil->kl", d, axes)), radius)
        inside: Flags = s <= (0.5 + 0.999 * self.beyond) * size
        return inside & np.all(w <= self.alone, axis=1) & self.proved


def joined(first: Tubes, then: Tubes) -> Flags:
    """Whether tubes hold the same curve as those of the same rows that begin where they end."""
    return then.hold(first.end, first.across, first.tip) & first.proved


def tubes_about(system: System, start: Array, end: Array) -> Tubes:
    """Prove that curves of zeros pass through tubes about chords, each of its own.

    The system has N - 1 formulas of N unknowns, and parameters that may be intervals; starts and
    ends, of shape (chords, N), are points next to each other along a curve.
    """
    with np.errstate(all="ignore"):  # what is not finite is not proved
        return _tubes_about(system, start, end)


def _tubes_about(system: System, start: Array, end: Array) -> Tubes:
    chord, middle = end - start, 0.5 * start + 0.5 * end
    across = _complements(chord)
    slopes, undefined = system(middle, middle)[1:]
    inverse, usable = inverses((0.5 * (slopes[0] + slopes[1])) @ across)
    usable &= ~undefined
    operator = _Operator(system, chord, across, inverse, usable)
    # Where the curve is at the end of a chord is found by itself: that is known far better.
    floors = _floors(end, chord)
    at_end = operator.about(end, np.zeros(len(chord)))
    _, tip, held = _held(at_end, floors, floors)
    tip = np.where(held[:, None], np.minimum(tip, at_end(tip)), tip)  # an image of the image
    floors = _floors(middle, chord)
    beyond = np.fmax(BEYOND, np.linalg.norm(tip, axis=1) / np.linalg.norm(chord, axis=1))
    beyond = np.where(beyond < 1.0, beyond, BEYOND)
    whole = operator.about(middle, 0.5 + beyond)
    # Zeros of a tube lie in its image: the tube may be wider than where the curve can be.
    alone, radius, proved = _held(whole, WIDER**3 * (tip + floors), floors)
    proved &= held
    for _ in range(WIDENINGS):
        wider = alone * WIDER
        holds = np.all(whole(wider) < wider, axis=1) & proved
        alone = np.where(holds[:, None], wider, alone)
        if not holds.any():
            break
    half = (0.5 + beyond)[:, None] * np.abs(chord)
    _, _, away = system(middle - half, middle + half)
    return Tubes(
        middle, chord, across, beyond, end, tip, radius, alone, proved, ~(away | undefined),
    )  # fmt: skip


class _Operator(NamedTuple):
    """The operator K of tubes."""

    system: System
    chord: Array
    across: Array
    inverse: Array
    usable: Flags

    def about(self, base: Array, parts: Array) -> Callable[[Array], Array]:
        """How far K(W) reaches, about points and so far along the chords, in parts of these."""
        system, chord, across, inverse, _ = self
        # A sum of N products is off by N rounded units at most, of the products' sizes.
        rounding = UNIT * (2 * system.n + 8)
        size, reach = np.abs(inverse), parts[:, None] * (1.0 + 1e-15)
        with np.errstate(all="ignore"):
            (least, most), _, outside = system(base, base)
            blur = 0.5 * (most - least) + rounding * np.maximum(np.abs(least), np.abs(most))
            value = np.abs(np.einsum("kij,kj->ki", inverse, 0.5 * (least + most)))
            value += np.einsum("kij,kj->ki", size, blur)

        def image(w: Array) -> Array:
            with np.errstate(all="ignore"):
                half = np.abs(chord) * reach + np.einsum("kij,kj->ki", np.abs(across), w)
                half = half * (1.0 + rounding) + 4.0 * UNIT * np.abs(base)
                _, (low, high), away = system(base - half, base + half)
                center = 0.5 * (low + high)
                wide = 0.5 * (high - low) + 2.0 * rounding * np.abs(center)
                inner = np.einsum("kij,kj->ki", center, chord)
                along = np.abs(np.einsum("kij,kj->ki", inverse, inner))
                spread = np.einsum("kij,kj->ki", wide, np.abs(chord))
                along += np.einsum("kij,kj->ki", size, spread + rounding * np.abs(inner))
                off = np.abs(np.eye(system.m) - inverse @ (center @ across))
                off += size @ (wide @ np.abs(across)) + rounding * np.eye(system.m)
                found = value + reach * along + np.einsum("kij,kj->ki", off, w)
                found *= 1.0 + 4.0 * rounding
            found[away | outside | ~self.usable] = np.inf
            return np.asarray(np.where(np.isfinite(found), found, np.inf))

        return image


def _floors(base: Array, chord: Array) -> Array:
    """What rounding leaves of radii."""
    floor = 8.0 * UNIT * np.linalg.norm(np.abs(base) + np.abs(chord), axis=1)
    return np.repeat(floor[:, None], base.shape[1] - 1, axis=1)


def _held(
    image: Callable[[Array], Array], least: Array, floor: Array
) -> tuple[Array, Array, Flags]:
    """Radii that hold their images, the images, and whether these were found."""
    radius, proved = least.copy(), np.zeros(len(floor), dtype=bool)
    found, ratio = np.full_like(radius, np.inf), np.full(len(floor), np.inf)
    for _ in range(TRIES):
        found = image(radius)
        proved = np.all(found < radius, axis=1)
        finite = np.isfinite(found).all(axis=1)
        before, ratio = ratio, np.max(found / radius, axis=1, initial=0.0)
        if (proved | ~finite | (ratio > STUCK * before)).all():
            break
        grows = (finite & ~proved)[:, None]
        radius = np.where(grows, np.maximum(radius, 1.2 * found + floor), radius)
    return radius, found, proved


def _complements(chord: Array) -> Array:
    """Orthonormal columns across directions."""
    n = chord.shape[1]
    matrices = np.broadcast_to(np.eye(n), (len(chord), n, n)).copy()
    matrices[:, :, 0] = chord
    # The largest entry of a direction is left out of the unit vectors beside it.
    largest = np.argmax(np.abs(chord), axis=1)
    for k in range(n - 1):
        column = np.where(k >= largest, k + 1, k)
        matrices[:, :, k + 1] = np.eye(n)[column]
    return np.asarray(np.linalg.qr(matrices)[0][:, :, 1:])
