"""How many eigenvalues are unstable, proved for whole boxes of states and parameters.

The characteristic polynomial's coefficients a_0, ..., a_n and Hurwitz determinants D_1, ..., D_n
are formulas of the entries of the derivatives. At a point the number of eigenvalues with positive
real part is that of the changes of sign in a_0, D_1, D_2/D_1, ..., D_(n-1)/D_(n-2), a_n. It is the
same all over a box in which no eigenvalue passes the imaginary axis: a_n and D_(n-1) do not vanish
there ([Gantmacher1959] XV). Of a map the unit circle is taken to that axis first.
"""

from __future__ import annotations

import functools
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from phasekit.numerics.intervals.bounds import Bounds, Interval
from phasekit.numerics.later import later
from phasekit.numerics.slopes import jacobian

if TYPE_CHECKING:
    import sympy as sp
else:
    sp = later("sympy")

#: Number of states up to which determinants are written as formulas.
MOST = 4


class UnstableCount:
    """Number of unstable eigenvalues over boxes.

    Parameters
    ----------
    f, states : sequence of sympy expressions and symbols
        As many states as formulas, at most `MOST`.
    parameters : sequence of sympy symbols
    discrete : bool
        Whether f is a map, whose multipliers beyond the unit circle are counted.

    Raises
    ------
    NoRule
        If the derivatives hold a function of which no bounds are known.

    Examples
    --------
    >>> x, v, d = sp.symbols("x v d", real=True)
    >>> count = UnstableCount([v, -x - d * v], [x, v], [d])
    >>> count((0.0, 0.0), (0.0, 0.0), (np.array([-0.3, 0.1, -0.1]), np.array([-0.1, 2.0, 0.1])))
    array([ 2,  0, -1])
    """

    def __init__(
        self,
        f: Sequence[Any],
        states: Sequence[Any],
        parameters: Sequence[Any] = (),
        discrete: bool = False,
    ) -> None:
        formulas = hurwitz_determinants(tuple(f), tuple(states), discrete)
        self._bounds = Bounds(formulas, [*states, *parameters])

    def __call__(self, *boxes: Interval) -> npt.NDArray[np.int64]:
        """Return the number in each box, -1 where it may change; intervals as `Bounds` takes."""
        over, beyond = self._signs(boxes)
        with np.errstate(invalid="ignore"):
            middles = [0.5 * (np.asarray(a) + np.asarray(b)) for a, b in boxes]
        at, away = self._signs([(x, x) for x in middles])
        n = len(at) - 1
        before = np.concatenate([np.ones_like(at[:1]), np.ones_like(at[:1]), at[1:n]])[:n]
        ratios = np.concatenate([at[:n] * before, at[n:]])
        count = np.sum(ratios[1:] * ratios[:-1] < 0, axis=0)
        # A multiplier passes -1 where the first coefficient vanishes.
        sure = np.all(at != 0, axis=0) & (over[0] * over[-1] != 0) & ~beyond & ~away
        if n > 1:
            sure &= over[-2] != 0
        if n == 2:  # a saddle is one whatever its trace is
            saddle = (over[-1] * over[0] < 0) & ~beyond
            count, sure = np.where(saddle, 1, count), sure | saddle
        return np.asarray(np.where(sure, count, -1), dtype=np.int64)

    def _signs(
        self, boxes: Sequence[Interval]
    ) -> tuple[npt.NDArray[np.int64], npt.NDArray[np.bool_]]:
        found, undefined = self._bounds(*boxes)
        signs = [np.where(a > 0.0, 1, np.where(b < 0.0, -1, 0)) for a, b in found]
        return np.stack(signs), undefined


def hurwitz_determinants(
    f: tuple[Any, ...], states: tuple[Any, ...], discrete: bool = False
) -> tuple[Any, ...]:
    """The first coefficient of the characteristic polynomial, D_1 to D_(n-1), the last one."""
    coefficients, inner = _hurwitz(f, states, discrete)
    return coefficients[0], *inner, coefficients[-1]


def stability_signs(f: tuple[Any, ...], states: tuple[Any, ...]) -> tuple[Any, ...]:
    """What is positive of an equilibrium if, and only if, it is stable; the determinant first.

    Where one is negative it is unstable. With the determinant the number of equilibria changes.
    """
    coefficients, inner = _hurwitz(f, states, False)
    return coefficients[-1], *coefficients[1:-1], *inner[1:]


@functools.lru_cache(maxsize=64)
def _hurwitz(
    f: tuple[Any, ...], states: tuple[Any, ...], discrete: bool
) -> tuple[tuple[Any, ...], tuple[Any, ...]]:
    """The coefficients of the characteristic polynomial, the highest first; D_1 to D_(n-1)."""
    n = len(states)
    if n > MOST:
        raise ValueError(f"{n} states")
    z = sp.Dummy("z")
    slopes = sp.Matrix(jacobian(f, states))
    entries = sp.Matrix(n, n, lambda i, j: sp.Dummy(f"a{i}{j}"))
    own = sp.symbols(f"c0:{n + 1}", cls=sp.Dummy)
    values = dict(zip(own, entries.charpoly(z).all_coeffs(), strict=True))
    coefficients = list(own)
    if discrete:
        # With z = (1 + w)/(1 - w) the inside of the circle is the left half of the plane.
        turned = sum(c * (1 + z) ** (n - k) * (1 - z) ** k for k, c in enumerate(own))
        turned = sp.expand(turned)
        coefficients = [turned.coeff(z, k) for k in range(n, -1, -1)]

    def entry(i: int, j: int) -> Any:
        k = 2 * j - i
        return coefficients[k] if 0 <= k <= n else sp.Integer(0)

    matrix = sp.Matrix(n, n, lambda i, j: entry(i + 1, j + 1))
    inner = [matrix[:k, :k].det(method="berkowitz") for k in range(1, n)]
    own_slopes = dict(zip(entries, slopes, strict=True))
    every = [e.xreplace(values).xreplace(own_slopes) for e in (*coefficients, *inner)]
    return tuple(every[: n + 1]), tuple(every[n + 1 :])
