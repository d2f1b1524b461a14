"""Formulas whose signs say whether an equilibrium is stable.

The characteristic polynomial's coefficients a_0, ..., a_n and Hurwitz determinants D_1, ..., D_n
are formulas of the entries of the derivatives. With a_0 = 1 all eigenvalues have negative real
parts if, and only if, the others are positive ([Gantmacher1959] XV).
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from phasekit.numerics.later import later
from phasekit.numerics.slopes import jacobian

if TYPE_CHECKING:
    import sympy as sp
else:
    sp = later("sympy")

#: Number of states up to which determinants are written as formulas.
MOST = 4


def stability_signs(f: tuple[Any, ...], states: tuple[Any, ...]) -> tuple[Any, ...]:
    """What is positive of an equilibrium if, and only if, it is stable; the determinant first.

    Where one is negative it is unstable. With the determinant the number of equilibria changes.
    """
    n = len(states)
    if n > MOST:
        raise ValueError(f"{n} states")
    z = sp.Dummy("z")
    slopes = sp.Matrix(jacobian(f, states))
    entries = sp.Matrix(n, n, lambda i, j: sp.Dummy(f"a{i}{j}"))
    own = sp.symbols(f"c0:{n + 1}", cls=sp.Dummy)
    values = dict(zip(own, entries.charpoly(z).all_coeffs(), strict=True))
    coefficients = list(own)

    def entry(i: int, j: int) -> Any:
        k = 2 * j - i
        return coefficients[k] if 0 <= k <= n else sp.Integer(0)

    matrix = sp.Matrix(n, n, lambda i, j: entry(i + 1, j + 1))
    inner = [matrix[:k, :k].det(method="berkowitz") for k in range(2, n)]
    own_slopes = dict(zip(entries, slopes, strict=True))
    signs = (coefficients[-1], *coefficients[1:-1], *inner)
    return tuple(sign.xreplace(values).xreplace(own_slopes) for sign in signs)
