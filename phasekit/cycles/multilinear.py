"""Second and third derivatives of f along functions of an orbit, at all of its Gauss points.

Where f_x is known they are differences of f_x along lines. Of a function that is given alone they
are taken from its own values: differences of differences would see no more of it than the inner
ones do. Both take the steps that suit f, and know about how far they may be off.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from phasekit.arrays import Array
from phasekit.bifurcation.continuation.derivatives import Derivatives, Estimate
from phasekit.cycles import lines

VARIANTS = 4  # of derivatives: the best, and others that differ by the errors
BESIDE = 2.0**-6  # of the sizes of the unknowns, where rounding is looked at
STILL = 1e-9  # motion beside the sizes of the states that is none
CLOSER = 0.25  # first steps along parameters, beside their spans and those along states


class OfMatrices:
    """Of the matrices f_x beside an orbit, as functions of what is added to it: (dx, dy).

    Variants but the first are what the steps before the best say.
    """

    def __init__(
        self, matrices: Callable[[Array, Array], Array], at: Callable[[Array], Array],
        scale: Array, width: Array,
    ) -> None:  # fmt: skip
        self.matrices, self.at, self.scale, self.width = matrices, at, scale, width
        self.middle = matrices(np.zeros(1), np.zeros(1))
        self._along: dict[bytes, lines.Derivatives] = {}

    def second(self, v: Array, dy: Array, u: Array, variant: int) -> Array:
        """The derivative of f_x along (v, dy), times u."""
        found = self._derived(v, dy)
        return self._times(found.other_first if variant else found.first, u)

    def third(self, v: Array, u: Array, variant: int) -> Array:
        """The second derivative of f_x along v, times u."""
        found = self._derived(v, np.zeros(1))
        return self._times(found.other_second if variant else found.second, u)

    def _times(self, matrices: Array, u: Array) -> Array:
        return np.asarray(np.einsum("kij,kj->ki", matrices, self.at(u)))

    def _derived(self, v: Array, dy: Array) -> lines.Derivatives:
        key = v.tobytes() + dy.tobytes() * bool(np.any(dy))
        if key not in self._along:
            sizes = np.abs(v) / self.scale, np.abs(dy[1:]) / self.width[: len(dy) - 1] / CLOSER
            length = max(float(np.max(one, initial=0.0)) for one in sizes)
            self._along[key] = lines.along_line(
                lambda k: self.matrices(k * v, k * dy), self.middle,
                lines.REACH / length if length > 0.0 else 1.0, self.scale,
            )  # fmt: skip
        return self._along[key]


class OfValues:
    """Of f alone, as a function of the unknowns of all points (rows).

    Variants but the first are off by the errors, to one side or the other.
    """

    def __init__(
        self, values: Callable[[Array], Array], wide: Callable[[Array, Array], Array], u: Array,
        sizes: Array, slopes: Array,
    ) -> None:  # fmt: skip
        self.wide, self.shape = wide, slopes.shape[:2]
        whole: Any = _Whole(values, u, sizes, slopes)
        self.derivatives = Derivatives(whole, u.ravel())
        n = slopes.shape[1]
        if np.any(np.ptp(u[:, :n], axis=0) > STILL * sizes[:n]):
            # It has sizes, unlike a state at rest, for which wider steps are tried.
            self.derivatives.widest = 1
        else:
            # At rest terms may vanish, and with them their rounding: it is looked at beside it.
            beside = u + BESIDE * sizes * np.random.default_rng(6).choice([-1.0, 1.0], u.shape)
            noise = Derivatives(whole, beside.ravel()).noise().reshape(self.shape)
            self.derivatives.doubt(np.tile(np.max(noise, axis=0), len(u)))
        self.sides = np.random.default_rng(5).choice([-1.0, 1.0], (VARIANTS, *self.shape))

    def second(self, v: Array, dy: Array, u: Array, variant: int) -> Array:
        """The second derivative of f along (v, dy) and along u."""
        a, b = self.wide(v, dy).ravel(), self.wide(u, np.zeros(1)).ravel()
        return self._form(self.derivatives.second(a, b), variant)

    def third(self, v: Array, u: Array, variant: int) -> Array:
        """C(v, v, u)."""
        a, b = (self.wide(one, np.zeros(1)).ravel() for one in (v, u))
        return self._form(self.derivatives.third(a, a, b), variant)

    def _form(self, found: Estimate, variant: int) -> Array:
        value = np.asarray(found.value).reshape(self.shape)
        if variant == 0:
            return value
        return np.asarray(value + self.sides[variant] * np.reshape(found.error, self.shape))


@dataclass(frozen=True, eq=False)
class _Whole:
    """All points of an orbit as one point of a function of them all, as `Derivatives` takes it."""

    function: Callable[[Array], Array]
    points: Array
    sizes: Array
    blocks: Array
    #: Derivatives are differences.
    exact, steps = False, 1

    @property
    def m(self) -> int:
        """Number of unknowns of all points."""
        return self.points.size

    @property
    def n(self) -> int:
        """Number of values of all points."""
        count, n, _ = self.blocks.shape
        return int(count * n)

    @property
    def scale(self) -> Array:
        """Sizes of the unknowns."""
        return np.tile(self.sizes, len(self.points))

    @property
    def field(self) -> _Whole:
        """Itself, which knows no derivatives."""
        return self

    par, active = np.empty(0), ()

    def slopes_along(self, par: Array, active: tuple[int, ...], u: Array, z: Array) -> None:
        """Nothing is known without differences of f."""

    def evaluate(self, u: Array) -> tuple[Array, Any]:
        """Values and derivatives, those of each point by its own unknowns alone."""
        from scipy.sparse import bsr_array

        count, n, wide = self.blocks.shape
        places = np.arange(count + 1)
        matrix = bsr_array(
            (self.blocks, places[:-1], places), shape=(count * n, count * wide), blocksize=(n, wide)
        )
        return self.values(u[None])[0], matrix

    def values(self, u: Array) -> Array:
        """Values at many u, the rows."""
        return np.stack([self.function(row.reshape(self.points.shape)).ravel() for row in u])
