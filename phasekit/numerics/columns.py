"""Columns of derivatives of a plain function of many states, several by one difference.

What depends on what is seen where states are moved one by one, beside a point and farther off:
values that stay the same to the last bit do not depend. Dependence that shows only elsewhere is
found at each point, where the columns must give the difference along one direction more.
"""

from __future__ import annotations

import warnings
from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from phasekit.arrays import Array
from phasekit.numerics.differences import EPSILON
from phasekit.numerics.later import later
from phasekit.numerics.patterns import groups_of

if TYPE_CHECKING:
    import scipy.sparse as sp
else:
    sp = later("scipy.sparse")

Value = Callable[[Array], Array]

MANY = 40  # states from which on it is worth while
LESS = 0.5  # of the columns, of which there are groups at most
OFFS = (0.1, 1.0)  # of the sizes of states, by which places are off the point
MOVED = 0.25  # of a size, by which a state is moved
RIGHT = 1e-7  # of what all columns give together, by which they may miss the one direction
TERMS = 64.0 * EPSILON  # of the terms of f: rounding of its values


@dataclass(frozen=True)
class Groups:
    """Groups of columns that share no row."""

    pattern: sp.csc_array
    group: npt.NDArray[np.int64]  # of each column

    @property
    def count(self) -> int:
        """How many there are."""
        return int(self.group.max(initial=-1)) + 1

    def line(self, value: Value, x: Array, number: int, sizes: Array) -> Callable[[float], Array]:
        """F along the states of a group, each in units of its size."""
        along = np.where(self.group == number, sizes, 0.0)
        return lambda h: value(x + h * along)

    def full(self, slopes: Array, sizes: Array) -> Array:
        """The columns, of the slopes along groups (columns)."""
        n = len(self.group)
        column = np.repeat(np.arange(n), np.diff(self.pattern.indptr))
        row = self.pattern.indices
        found = np.zeros((n, n))
        found[row, column] = slopes[row, self.group[column]] / sizes[column]
        return found


def groups_at(value: Value, x: Array, sizes: Array) -> Groups | None:
    """The groups of columns of a function beside a point; None where there are too many."""
    n = len(x)
    generator = np.random.default_rng(n)
    seen = np.zeros((n, n), dtype=bool)
    places = 0
    with np.errstate(all="ignore"), warnings.catch_warnings():
        warnings.simplefilter("ignore")
        for off in OFFS:
            place = x + off * sizes * generator.uniform(-1.0, 1.0, n)
            here = value(place)
            if not np.isfinite(here).all():
                continue
            if not np.array_equal(value(place), here):  # it is not a function of x alone
                return None
            places += 1
            for j in range(n):
                moved = place.copy()
                moved[j] += MOVED * sizes[j]
                seen[:, j] |= value(moved) != here
    if not places:
        return None
    pattern = sp.csc_array(seen)
    found = Groups(pattern, groups_of(pattern))
    return found if found.count <= LESS * n else None


def are_all(value: Value, x: Array, middle: Array, slopes: Array, steps: Array) -> bool:
    """Whether columns give what a difference along all states together says."""
    along = steps * _mixed(len(x))
    ahead, behind = value(x + along), value(x - along)
    sizes = np.abs(slopes)
    terms = sizes @ np.abs(x) + np.abs(middle)
    off = np.abs(0.5 * (ahead - behind) - slopes @ along)
    return bool(np.all(off <= RIGHT * (sizes @ np.abs(along)) + TERMS * terms))


def _mixed(n: int) -> Array:
    """Parts of a direction, by chance: none is small, and no few cancel."""
    generator = np.random.default_rng(n + 1)
    parts: Array = generator.uniform(0.5, 1.0, n) * generator.choice([-1.0, 1.0], n)
    return parts
