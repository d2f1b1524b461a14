"""Power series in several variables, and equations reduced to center manifolds with them.

Nothing of this is shared with the package: numbers are mpmath's or fractions, functions are put
into one another as polynomials, and no derivative is ever taken.
"""

from __future__ import annotations

from itertools import product
from math import factorial

import mpmath as mp


class Series:
    """A polynomial up to an order, of exponents and numbers."""

    def __init__(self, terms, count, order):
        self.terms = {k: v for k, v in terms.items() if sum(k) <= order and v != 0}
        self.count, self.order = count, order

    def of(self, terms):
        return Series(terms, self.count, self.order)

    def _both(self, other):
        if isinstance(other, Series):
            return other
        return self.of({(0,) * self.count: other})

    def __add__(self, other):
        """The sum."""
        other = self._both(other)
        terms = dict(self.terms)
        for k, v in other.terms.items():
            terms[k] = terms.get(k, 0) + v
        return self.of(terms)

    __radd__ = __add__

    def __neg__(self):
        """The negative."""
        return self.of({k: -v for k, v in self.terms.items()})

    def __sub__(self, other):
        """The difference."""
        return self + (-self._both(other))

    def __rsub__(self, other):
        """The difference from a number."""
        return self._both(other) - self

    def __mul__(self, other):
        """The product."""
        other = self._both(other)
        terms = {}
        for (a, x), (b, y) in product(self.terms.items(), other.terms.items()):
            if sum(a) + sum(b) <= self.order:
                k = tuple(i + j for i, j in zip(a, b, strict=True))
                terms[k] = terms.get(k, 0) + x * y
        return self.of(terms)

    __rmul__ = __mul__

    def __pow__(self, times):
        """A whole power."""
        found = self._both(1)
        for _ in range(times):
            found = found * self
        return found

    def constant(self):
        return self.terms.get((0,) * self.count, 0)

    def __truediv__(self, other):
        """The quotient."""
        if not isinstance(other, Series):
            return self * (1 / other)
        c = other.constant()
        rest = 1 - other * (1 / c)
        found = power = self._both(1)
        for _ in range(self.order):
            power = power * rest
            found = found + power
        return self * found * (1 / c)

    def __rtruediv__(self, other):
        """The quotient of a number."""
        return self._both(other) / self

    def exp(self):
        c = self.constant()
        rest, power = self - c, self._both(1)
        found = power
        for k in range(1, self.order + 1):
            power = power * rest
            found = found + power * (mp.mpf(1) / factorial(k))
        return found * mp.exp(c)

    def at(self, given):
        """The series with others in place of its variables."""
        total = given[0] * 0
        for k, v in self.terms.items():
            term = given[0]._both(v)
            for one, times in zip(given, k, strict=True):
                term = term * one**times
            total = total + term
        return total

    def derivative(self, j):
        terms = {}
        for k, v in self.terms.items():
            if k[j]:
                terms[tuple(e - (i == j) for i, e in enumerate(k))] = v * k[j]
        return self.of(terms)


def variables(count, order, one=1):
    """The variables themselves."""
    return [
        Series({tuple(int(i == j) for i in range(count)): one}, count, order) for j in range(count)
    ]


def pushed(f, change, discrete=False):
    """The equations x' = F(x) that w' = f(w) becomes with x = T(w), T'(0) = 1: the series of F.

    F(T(w)) = T'(w) f(w), of maps T(f(w)), power by power.
    """
    count = len(f)
    right = []
    for one in change:
        total = one.at(f) if discrete else one * 0
        for j in range(0 if discrete else count):
            total = total + one.derivative(j) * f[j]
        right.append(total)
    found = [one * 0 for one in f]
    for order in range(1, f[0].order + 1):
        images = [one.at(change) for one in found]
        for i in range(count):
            left = right[i] - images[i]
            found[i] = found[i] + left.of({k: v for k, v in left.terms.items() if sum(k) == order})
    return found


def reduced(f, x, values, right, left, order, keeps, discrete=False):
    """Coefficients of G in x = H(w), w' = G(w) (w -> G(w)): {(coordinate, power): number}.

    ``keeps(j, power)`` says which are kept. f takes and gives lists of numbers or series; values
    are the critical eigenvalues, right and left their vectors with left_j right_j = 1.
    """
    n, count = len(x), len(values)
    w = variables(count, order)
    h = [sum((right[j][i] * w[j] for j in range(count)), w[0] * 0) for i in range(n)]
    g = [values[j] * w[j] for j in range(count)]
    matrix = jacobian(f, x)
    for total in range(2, order + 1):
        image = f([x[i] + h[i] for i in range(n)])
        if discrete:
            moved = [one.at(g) for one in h]
            image = [image[i] - x[i] for i in range(n)]
        else:
            moved = [
                sum((h[i].derivative(j) * g[j] for j in range(count)), w[0] * 0) for i in range(n)
            ]
        defect = [a - b for a, b in zip(image, moved, strict=True)]
        for power in _powers(count, total):
            own = mp.mpf(1) if discrete else mp.mpf(0)
            for value, k in zip(values, power, strict=True):
                own = own * value**k if discrete else own + value * k
            columns = [j for j in range(count) if keeps(j, power)]
            m = n + len(columns)
            square, rest = mp.zeros(m, m), mp.zeros(m, 1)
            for i in range(n):
                rest[i] = defect[i].terms.get(power, 0)
                for k in range(n):
                    square[i, k] = (own if i == k else 0) - matrix[i, k]
                for c, j in enumerate(columns):
                    square[i, n + c] = right[j][i]
                    square[n + c, i] = left[j][i]
            found = mp.lu_solve(square, rest)
            for i in range(n):
                h[i] = h[i] + w[0].of({power: found[i]})
            for c, j in enumerate(columns):
                g[j] = g[j] + w[0].of({power: found[n + c]})
    return {(j, k): v for j in range(count) for k, v in g[j].terms.items() if sum(k) > 1}


def jacobian(f, x):
    """The derivatives of f at x."""
    n = len(x)
    w = variables(n, 1)
    image = f([x[i] + w[i] for i in range(n)])
    units = [tuple(int(i == j) for i in range(n)) for j in range(n)]
    matrix = mp.zeros(n, n)
    for i in range(n):
        for j in range(n):
            matrix[i, j] = image[i].terms.get(units[j], mp.mpf(0))
    return matrix


def eigenvectors(matrix, value):
    """Right and left vector of the eigenvalue next to a number: |q| = 1, p q = 1; and itself."""
    values, right = mp.eig(matrix)
    k = min(range(len(values)), key=lambda i: abs(values[i] - value))
    q = [right[i, k] for i in range(matrix.rows)]
    size = mp.sqrt(sum(abs(one) ** 2 for one in q))
    q = [one / size for one in q]
    others, left = mp.eig(matrix.T)
    k2 = min(range(len(others)), key=lambda i: abs(others[i] - values[k]))
    p = [left[i, k2] for i in range(matrix.rows)]
    product_ = sum(a * b for a, b in zip(p, q, strict=True))
    return q, [one / product_ for one in p], values[k]


def _powers(count, total):
    if count == 1:
        return [(total,)]
    return [(k, *rest) for k in range(total + 1) for rest in _powers(count - 1, total - k)]
