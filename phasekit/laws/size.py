"""How large a formula becomes when it is differentiated or multiplied out, before it is."""

from __future__ import annotations

import math
from typing import Any


def expanded_terms(expression: Any) -> int:
    """Most terms that there are at any time while powers and products are multiplied out.

    >>> from sympy.abc import x, y
    >>> expanded_terms((x + 1) * (x + 2) * (x + 3) * (x + 4))
    5
    >>> expanded_terms((x + y + 1) ** 9)
    55
    """
    most = 1

    def terms(e: Any) -> tuple[int, dict[Any, int]]:
        """Terms of an expanded node, and its degrees in what is not expanded."""
        nonlocal most
        count = 1
        degrees: dict[Any, int] = {}
        if e.is_Add or e.is_Mul:
            parts = [terms(arg) for arg in e.args]
            counts = [part[0] for part in parts]
            count = sum(counts) if e.is_Add else math.prod(counts)
            for _, found in parts:
                for symbol, n in found.items():
                    before = degrees.get(symbol, 0)
                    degrees[symbol] = max(before, n) if e.is_Add else before + n
        elif e.is_Pow and e.exp.is_Integer and e.exp > 0:
            n = int(e.exp)
            base, found = terms(e.base)
            count = math.comb(n + base - 1, n) if base < 1000 else base**n
            most = max(most, count)  # sympy makes them all before it collects them
            degrees = {symbol: n * degree for symbol, degree in found.items()}
        elif e.is_Function:
            count, degrees = 2, {e: 2}  # sin and cos are two exponentials each
        elif not e.is_number:
            degrees = {e: 1}
        count = min(count, math.prod(n + 1 for n in degrees.values()))
        most = max(most, count)
        return count, degrees

    terms(expression)
    return most


def derived_nodes(expression: Any, x: Any) -> int:
    """Nodes that the second derivative of an expression has, about.

    >>> from sympy.abc import x
    >>> derived_nodes(x**2, x) < derived_nodes((x + 1) * (x + 2) * (x + 3), x)
    True
    """
    return _nodes(expression, x, {})[2]


def _nodes(e: Any, x: Any, known: dict[Any, tuple[int, int, int]]) -> tuple[int, int, int]:
    """Nodes of an expression, its first and its second derivative."""
    if e not in known:
        parts = [_nodes(arg, x, known) for arg in e.args]
        size = 1 + sum(part[0] for part in parts)
        moving = [part for part in parts if part[1]]
        k, first, second = len(moving), sum(p[1] for p in moving), sum(p[2] for p in moving)
        if e == x:
            known[e] = 1, 1, 0
        elif not k:
            known[e] = size, 0, 0
        elif e.is_Add:
            known[e] = size, 1 + first, 1 + second
        else:
            # Of a product or function of k parts, each derivative keeps all the others.
            known[e] = size, k * size + first, k * k * size + 2 * k * first + second
    return known[e]
