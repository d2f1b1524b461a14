"""Common real zeros of two polynomials in two unknowns, by exact elimination.

Both resultants are isolated in rational arithmetic, each root is refined to more than 40 digits,
and the pairs at which both polynomials vanish are told from the others by what is left of them.
"""

from __future__ import annotations

import mpmath
import sympy as sp

DIGITS = 50
ZERO, CLEAR = mpmath.mpf(10) ** -30, mpmath.mpf(10) ** -20  # of the sum of all terms' sizes


def real_roots(poly: sp.Poly, box: float) -> list[mpmath.mpf]:
    """The real roots of a polynomial in (-box, box), once each."""
    if poly.degree() < 1:
        return []
    free = poly.sqf_part()
    eps = sp.Rational(1, 10**DIGITS)
    found = []
    for low, high in free.intervals(inf=-sp.Rational(box), sup=sp.Rational(box), sqf=True):
        if low != high:
            low, high = free.refine_root(low, high, eps=eps)
        with mpmath.workdps(2 * DIGITS):
            found.append(mpmath.mpf((low + high).p) / (2 * (low + high).q))
    return found


def common_zeros(
    f: sp.Expr, g: sp.Expr, x: sp.Symbol, p: sp.Symbol, box: float
) -> list[tuple[float, float]] | None:
    """All real (x, p) in the box with f = g = 0; None where they vanish on a curve together."""
    first, second = (sp.Poly(one, x, p, domain="QQ") for one in (f, g))
    if first.gcd(second).total_degree() > 0:
        return None
    values = real_roots(first.resultant(second), box)
    swapped = [one.reorder(p, x) for one in (first, second)]
    states = real_roots(swapped[0].resultant(swapped[1]), box) if values else []
    with mpmath.workdps(2 * DIGITS):
        both = []
        for v in values:
            for u in states:
                left = max(_part(one, u, v) for one in (first, second))
                assert not ZERO < left < CLEAR, (u, v, left)
                if left <= ZERO:
                    both.append((float(u), float(v)))
    return both


def _part(poly: sp.Poly, u: mpmath.mpf, v: mpmath.mpf) -> mpmath.mpf:
    """What is left of a polynomial beside the sizes of its terms."""
    terms = [mpmath.mpf(c.p) / c.q * u**i * v**j for (i, j), c in poly.terms()]
    size = mpmath.fsum(terms, absolute=True)
    return abs(mpmath.fsum(terms)) / size if size else size
