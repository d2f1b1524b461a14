"""Maps that are applied many times, with their derivatives by the chain rule, step by step.

Each function here is compiled as one that other code calls by its address, with what it needs in
two arrays before the usual four: whole numbers, whose places are below, and scales. The functions
of one step, which it calls by their addresses, are those of a `Field`.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from phasekit.numerics.differences import bend, jet, spare_size
from phasekit.numerics.native import call
from phasekit.numerics.pointers import carray

#: Places of whole numbers: the code of one step, how it comes, states, unknowns, times that it is
#: applied, parameters, whether the identity is taken off, and the places of free parameters.
FIRST, SECOND, THIRD, MODE, STATES, UNKNOWNS, TIMES, PARAMETERS, LESS, ACTIVE = range(10)


def first(numbers: Any, scales: Any, x: Any, p: Any, z: Any, out: Any) -> None:
    """A map applied many times and its derivatives: the products of those of one step."""
    head = carray(numbers, (ACTIVE,))
    n, m = head[STATES], head[UNKNOWNS]
    u, par = carray(x, (m,)), carray(p, (head[PARAMETERS],))
    found = carray(out, (n + n * m,))
    w = np.empty(m + n + n * m)
    for i in range(m):
        w[i] = u[i]
    slopes = np.zeros((n, m))
    for i in range(n):
        slopes[i, i] = 1.0
    for _ in range(head[TIMES]):
        call(head[FIRST], w, 0, par, 0, m)
        after = np.empty((n, m))
        for i in range(n):
            w[i] = w[m + i]
            row = m + n + i * m
            for j in range(m):
                total = w[row + j] if j >= n else 0.0
                for k in range(n):
                    total += w[row + k] * slopes[k, j]
                after[i, j] = total
        slopes = after
    less = 1.0 if head[LESS] != 0 else 0.0
    for i in range(n):
        found[i] = w[i] - less * u[i]
        for j in range(m):
            found[n + i * m + j] = slopes[i, j] - (less if i == j else 0.0)


def second(numbers: Any, scales: Any, x: Any, p: Any, z: Any, out: Any) -> None:
    """As `first`, and then the derivatives of those along z."""
    head = carray(numbers, (ACTIVE,))
    n, m = head[STATES], head[UNKNOWNS]
    u, par, along = carray(x, (m,)), carray(p, (head[PARAMETERS],)), carray(z, (m,))
    found = carray(out, (n + 2 * n * m,))
    base = 2 * m
    w = np.empty(base + n + 2 * n * m)
    # The derivatives of all unknowns by all unknowns: parameters stay as they are.
    slopes, bent = np.zeros((m, m)), np.zeros((n, m))
    for i in range(m):
        w[i] = u[i]
        w[m + i] = along[i]
        slopes[i, i] = 1.0
    for _ in range(head[TIMES]):
        call(head[SECOND], w, 0, par, m, base)
        after, bent_after, z_after = np.zeros((m, m)), np.zeros((n, m)), np.zeros(n)
        for i in range(n):
            w[i] = w[base + i]
            row = base + n + i * m
            curved = row + n * m
            for j in range(m):
                for k in range(m):
                    after[i, j] += w[row + k] * slopes[k, j]
                    bent_after[i, j] += w[curved + k] * slopes[k, j]
                for k in range(n):
                    bent_after[i, j] += w[row + k] * bent[k, j]
                z_after[i] += w[row + j] * w[m + j]
        for i in range(n):
            w[m + i] = z_after[i]
        for i in range(n, m):
            after[i, i] = 1.0
        slopes, bent = after, bent_after
    less = 1.0 if head[LESS] != 0 else 0.0
    for i in range(n):
        found[i] = w[i] - less * u[i]
        for j in range(m):
            found[n + i * m + j] = slopes[i, j] - (less if i == j else 0.0)
            found[n + n * m + i * m + j] = bent[i, j]


def third(numbers: Any, scales: Any, x: Any, p: Any, z: Any, out: Any) -> None:
    """The third derivative along the three directions that z holds."""
    head = carray(numbers, (ACTIVE,))
    n, m = head[STATES], head[UNKNOWNS]
    u, par, along = carray(x, (m,)), carray(p, (head[PARAMETERS],)), carray(z, (3 * m,))
    found = carray(out, (n,))
    base = 4 * m
    w = np.empty(base + n + 2 * n * m)
    for i in range(m):
        w[i] = u[i]
    for i in range(3 * m):
        w[m + i] = along[i]
    # The second derivatives along the others of each direction, and the third.
    pairs, triple = np.zeros((3, n)), np.zeros(n)
    for _ in range(head[TIMES]):
        call(head[THIRD], w, 0, par, m, base)
        turned, pairs_after, z_after = np.zeros(n), np.zeros((3, n)), np.zeros((3, n))
        for i in range(n):
            turned[i] = w[base + i]
        for q in range(3):
            own, other, rest = m + q * m, m + (q + 1) % 3 * m, (q + 2) % 3
            call(head[SECOND], w, 0, par, own, base)
            for i in range(n):
                row = base + n + i * m
                curved = row + n * m
                for k in range(n):
                    turned[i] += w[curved + k] * pairs[q, k]
                    pairs_after[q, i] += w[row + k] * pairs[q, k]
                    if q == 0:
                        turned[i] += w[row + k] * triple[k]
                for k in range(m):
                    z_after[q, i] += w[row + k] * w[own + k]
                    # The pair without `rest` is that of q and the other one.
                    pairs_after[rest, i] += w[curved + k] * w[other + k]
        for i in range(n):
            w[i] = w[base + i]
            for q in range(3):
                w[m + q * m + i] = z_after[q, i]
        pairs, triple = pairs_after, turned
    for i in range(n):
        found[i] = triple[i]


def differenced(numbers: Any, scales: Any, x: Any, p: Any, z: Any, out: Any) -> None:
    """One step of a function that is given alone, and its derivatives by differences."""
    head = carray(numbers, (ACTIVE,))
    n, m = head[STATES], head[UNKNOWNS]
    active = carray(numbers, (ACTIVE + m - n,))[ACTIVE:]
    u, par = carray(x, (m,)), carray(p, (head[PARAMETERS],))
    sizes, found = carray(scales, (m,)), carray(out, (n + n * m,))
    place = 2 * m
    w = np.empty(place + n + n * m + spare_size(n, m))
    for i in range(m):
        w[i] = u[i]
        w[m + i] = sizes[i]
    jet(head[FIRST], head[MODE], n, w, 0, par, active, m, place, place + n + n * m)
    for i in range(n + n * m):
        found[i] = w[place + i]


def differenced_twice(numbers: Any, scales: Any, x: Any, p: Any, z: Any, out: Any) -> None:
    """As `differenced`, and then the derivatives of those along z."""
    head = carray(numbers, (ACTIVE,))
    n, m = head[STATES], head[UNKNOWNS]
    active = carray(numbers, (ACTIVE + m - n,))[ACTIVE:]
    u, par, along = carray(x, (m,)), carray(p, (head[PARAMETERS],)), carray(z, (m,))
    sizes, found = carray(scales, (m,)), carray(out, (n + 2 * n * m,))
    place = 3 * m
    count = n + 2 * n * m
    w = np.empty(place + count + spare_size(n, m))
    for i in range(m):
        w[i] = u[i]
        w[m + i] = sizes[i]
        w[2 * m + i] = along[i]
    jet(head[FIRST], head[MODE], n, w, 0, par, active, m, place, place + count)
    bend(head[FIRST], head[FIRST], head[MODE], n, w, 0, par, active, m, 2 * m, place, place + count)
    for i in range(count):
        found[i] = w[place + i]
