"""Equilibria and separatrices of systems: the steps of the latter, and drivers of all steps.

Each driver fills cells ``start`` to ``stop`` of the output arrays, block after block. A count of
``UNDECIDED`` asks for the discriminant from exact arithmetic, which a second call takes as
``exact`` (empty: none).

Steps of separatrices continue the block of ``equilibria``, in closed form. At a saddle of the
reduced system let x, y be |cos|, |sin|, k^2 = -V'', mu = B/x, X = sqrt(A) x and Y = sqrt(A) y.
Then A - mu = k^2 + Y^2 at the lower saddle (a figure-eight, mu > 0), and m = -mu > 0 at the upper
one (loops that wind round the cylinder). In u = tan((phi - phi_s)/2) the level of the saddle is
u'^2 = u^2 (k^2 - 2 S u - P u^2) with S = -A x y, P = mu - A y^2, and S^2 + P k^2 = mu (A - mu):
these forms do not cancel.
"""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt

from phasekit.arrays import Array
from phasekit.errors import Loop, Topology
from phasekit.numerics.compile import Outputs, compose, inline, vector_kernel
from phasekit.numerics.elementary import PI, angle_half, angle_quadrant, atanh, wrap
from phasekit.phase.exact.kernels import equilibria as eq

# The root finders are specialised to these, which must be globals here to count as literals.
from phasekit.phase.exact.kernels.equilibria import (
    LOWER_CENTER,
    LOWER_SADDLE,
    UPPER_CENTER,
    UPPER_SADDLE,
)

BLOCK = eq.BLOCK
LOWER = eq.LOWER_SADDLE * BLOCK
UPPER = eq.UPPER_SADDLE * BLOCK

# Rows after those of the equilibria: of the reduced system, the angles from the lower saddle to
# the ends of its small and its big lobe, their areas, and the area under a winding loop.
SMALL_OFFSET, BIG_OFFSET, SMALL_AREA, BIG_AREA, WINDING = range(eq.SIZE, eq.SIZE + 5 * BLOCK, BLOCK)
# Then the results, two rows each (lower, upper saddle).
LOOP, SADDLE_PHI, SADDLE_ENERGY, SADDLE_EXPONENT, WINDING_AREA = range(
    eq.SIZE + 5 * BLOCK, eq.SIZE + 15 * BLOCK, 2 * BLOCK
)
LEFT_OFFSET, RIGHT_OFFSET, LEFT_PHI, RIGHT_PHI, LEFT_AREA, RIGHT_AREA = range(
    eq.SIZE + 15 * BLOCK, eq.SIZE + 27 * BLOCK, 2 * BLOCK
)
SHAPE = eq.SIZE + 27 * BLOCK
SIZE = eq.SIZE + 28 * BLOCK

ABSENT, LOBES, WINDS, ARCS = (
    int(code) for code in (Loop.ABSENT, Loop.LOBES, Loop.WINDING, Loop.HETEROCLINIC)
)
NOT_COMPUTED, NONE, WINDING_ONLY, FIGURE_EIGHT, HETEROCLINIC = (
    int(code)
    for code in (
        Topology.NOT_COMPUTED,
        Topology.NONE,
        Topology.WINDING,
        Topology.FIGURE_EIGHT,
        Topology.HETEROCLINIC,
    )
)

# 1 - 2 s/3 - (1 - s) atanh(sqrt s)/sqrt s = s^2 (TAIL[0] + TAIL[1] s + ...)
TERMS = 24
TAIL = tuple(2.0 / ((2 * n + 5) * (2 * n + 3)) for n in range(TERMS))
SERIES = 0.2


@inline
def tail(s: float) -> float:
    """(1 - 2 s/3 - (1 - s) atanh(sqrt s)/sqrt s) / s^2 for |s| <= SERIES."""
    value = TAIL[TERMS - 1]
    for n in range(TERMS - 2, -1, -1):
        value = value * s + TAIL[n]
    return value


@inline
def turn(i: int, w: Array) -> None:
    """Angles from the lower saddle to the turning points of its two lobes."""
    a = w[eq.A + i]
    b = w[eq.B + i]
    x = w[eq.X + LOWER + i]
    y = w[eq.Y + LOWER + i]
    k2 = w[eq.SLOPE + LOWER + i]
    mu = b / x if b > 0.0 else 0.0
    reach = np.sqrt(mu) * np.sqrt(k2 + a * y * y) + a * x * y
    big = 2.0 * angle_half(reach, mu - a * y * y)
    w[SMALL_OFFSET + i] = 2.0 * angle_quadrant(k2, reach)
    w[BIG_OFFSET + i] = big if reach > 0.0 else PI


@inline
def measure_lobes(i: int, w: Array) -> None:
    """Areas of the lower saddle's lobes (of the arcs to the partner, where B = 0).

    small = (4 k/A) [X^2 E(k^2/X^2) + Y^2 E(-k^2/Y^2)], E(s) = 1 - 2 s/3 - (1 - s)
    atanh(sqrt s)/sqrt s, both terms positive; big = small + 4 pi C/sqrt A.
    """
    a = w[eq.A + i]
    x = w[eq.X + LOWER + i]
    y = w[eq.Y + LOWER + i]
    k2 = w[eq.SLOPE + LOWER + i]
    k = np.sqrt(k2)
    root = np.sqrt(a)
    x2 = a * x * x
    y2 = a * y * y
    mu = w[eq.B + i] / x
    near = k2 / x2
    area = mu * (root * x / k) * atanh(k / (root * x), mu / x2) if mu > 0.0 else 0.0
    along = near * k2 * tail(near) if near <= SERIES else x2 - (2.0 / 3.0) * k2 - area
    near = k2 / y2
    area = (y2 + k2) * (root * y / k) * angle_quadrant(k, root * y)
    across = near * k2 * tail(-near) if near <= SERIES else y2 + (2.0 / 3.0) * k2 - area
    unit = np.sqrt(w[eq.UNIT + i])
    small = 4.0 * k / a * (along + across)
    w[SMALL_AREA + i] = small * unit
    w[BIG_AREA + i] = (small + 4.0 * PI * w[eq.C + i] / root) * unit


@inline
def measure_winding(i: int, w: Array) -> None:
    """Area under one winding loop, the integral of |phi'| over the circle.

    4 k + (4/sqrt A) [B atanh(X/k) + C atan(Y/k)] with k^2 - X^2 = m; regular at A = 0.
    """
    b = w[eq.B + i]
    c = w[eq.C + i]
    s = w[eq.X + UPPER + i]
    f = w[eq.Y + UPPER + i]
    k2 = w[eq.SLOPE + UPPER + i]
    k = np.sqrt(k2)
    root = np.sqrt(w[eq.A + i])
    x = root * s / k
    y = root * f
    # atanh(z)/z and atan(z)/z, 1 at z = 0
    along = atanh(x, b / (s * k2)) / x if x > 0.0 else 1.0
    across = angle_quadrant(y, k) / y if y > 0.0 else 1.0 / k
    area = 4.0 * k + 4.0 * c * f * across
    area += 4.0 * b * s / k * along if b > 0.0 else 0.0
    w[WINDING + i] = area * np.sqrt(w[eq.UNIT + i])


@inline
def shape(i: int, w: Array) -> None:
    """Topology of the portrait, and what the loop of each saddle does."""
    number = w[eq.COUNT + i]
    b0 = w[eq.B0 + i]
    c0 = w[eq.C0 + i]
    level = (c0 if w[eq.A0 + i] < 0.0 else b0) == 0.0
    four = HETEROCLINIC if level else FIGURE_EIGHT
    some = WINDING_ONLY if number > 0.0 else NONE
    few = some if number >= 0.0 else NOT_COMPUTED
    w[SHAPE + i] = four if number == 4.0 else few
    lobes = ARCS if level else LOBES
    w[LOOP + i] = lobes if number == 4.0 else ABSENT
    upper = ARCS if level and number == 4.0 else WINDS
    w[LOOP + BLOCK + i] = upper if number > 0.0 else ABSENT


@inline
def describe(j: int, i: int, w: Array) -> None:
    """Angle, energy, exponent and winding area of saddle j (0 lower, 1 upper)."""
    p = (UPPER if j == 1 else LOWER) + i
    q = j * BLOCK + i
    loop = w[LOOP + q]
    present = loop != ABSENT
    exponent = w[eq.EXPONENT + p]
    exponent = 0.0 if w[eq.KIND + p] == eq.DEGENERATE else exponent
    phi = w[eq.PHI + p]
    energy = w[eq.ENERGY + p]
    area = w[WINDING + i]
    w[SADDLE_PHI + q] = phi if present else math.nan
    w[SADDLE_ENERGY + q] = energy if present else math.nan
    w[SADDLE_EXPONENT + q] = exponent if present else math.nan
    w[WINDING_AREA + q] = area if loop == WINDS else math.nan


@inline
def arrange(j: int, i: int, w: Array) -> None:
    """The two sides of saddle j in the frame that was given; sides swap with every reflection.

    In the reduced system the lower saddle has its small lobe on the left, and the upper one, where
    arcs join them, on the right.
    """
    q = j * BLOCK + i
    loop = w[LOOP + q]
    phi = w[SADDLE_PHI + q]
    partner = w[SADDLE_PHI + BLOCK - j * BLOCK + i]
    small = w[SMALL_OFFSET + i]
    big = w[BIG_OFFSET + i]
    small_area = w[SMALL_AREA + i]
    big_area = w[BIG_AREA + i]
    mirrored = (w[eq.A0 + i] < 0.0) != ((w[eq.B0 + i] < 0.0) != (w[eq.C0 + i] < 0.0))
    swap = mirrored if j == 0 else not mirrored
    closed = loop == LOBES or loop == ARCS
    left = -(big if swap else small)
    right = small if swap else big
    left_area = big_area if swap else small_area
    right_area = small_area if swap else big_area
    left_phi = partner if loop == ARCS else wrap(phi + left)
    right_phi = partner if loop == ARCS else wrap(phi + right)
    w[LEFT_OFFSET + q] = left if closed else math.nan
    w[RIGHT_OFFSET + q] = right if closed else math.nan
    w[LEFT_PHI + q] = left_phi if closed else math.nan
    w[RIGHT_PHI + q] = right_phi if closed else math.nan
    w[LEFT_AREA + q] = left_area if closed else math.nan
    w[RIGHT_AREA + q] = right_area if closed else math.nan


@inline
def leave_out(j: int, i: int, w: Array) -> None:
    """Mark the sides of saddle j as open."""
    q = j * BLOCK + i
    w[LEFT_OFFSET + q] = math.nan
    w[RIGHT_OFFSET + q] = math.nan
    w[LEFT_PHI + q] = math.nan
    w[RIGHT_PHI + q] = math.nan
    w[LEFT_AREA + q] = math.nan
    w[RIGHT_AREA + q] = math.nan


@inline
def write(i: int, k: int, w: Array, out: Outputs) -> None:
    """Column i becomes cell k of the output arrays."""
    topology, figure_eight, phi, energy, exponent, loop, winding, offset, turning, area = out
    topology[k] = np.int8(w[SHAPE + i])
    figure_eight[k] = w[SHAPE + i] == FIGURE_EIGHT
    for j in range(2):
        q = j * BLOCK + i
        phi[k, j] = w[SADDLE_PHI + q]
        energy[k, j] = w[SADDLE_ENERGY + q]
        exponent[k, j] = w[SADDLE_EXPONENT + q]
        loop[k, j] = np.int8(w[LOOP + q])
        winding[k, j] = w[WINDING_AREA + q]
        offset[k, j, 0] = w[LEFT_OFFSET + q]
        offset[k, j, 1] = w[RIGHT_OFFSET + q]
        turning[k, j, 0] = w[LEFT_PHI + q]
        turning[k, j, 1] = w[RIGHT_PHI + q]
        area[k, j, 0] = w[LEFT_AREA + q]
        area[k, j, 1] = w[RIGHT_AREA + q]


@compose
def count(a: Array, b: Array, c: Array, exact: Array, first: int, n: int, v: Array) -> None:
    """Reduced system and number of equilibria of n systems, in the columns of a block."""
    for i in range(n):
        v[eq.A0 + i] = a[first + i]
        v[eq.B0 + i] = b[first + i]
        v[eq.C0 + i] = c[first + i]
    for i in range(n):
        eq.reduce(i, v)
    for i in range(n):
        eq.discriminate(i, v)
    if exact.size > 0:
        for i in range(n):
            v[eq.DELTA + i] = exact[first + i]
    for i in range(n):
        eq.count(i, v)


@compose
def partition(n: int, v: Array, order: npt.NDArray[np.int64], w: Array) -> int:
    """Copy the columns of v to w, first those with inner points; their number.

    So the steps for inner points and lobes run over full vectors of systems that have them.
    ``order`` has a place more than columns: each index is written before it is known to count.
    """
    m = 0
    for i in range(n):
        order[m] = i
        m += 1 if v[eq.COUNT + i] > 2.0 else 0
    k = m
    for i in range(n):
        order[k] = i
        k += 0 if v[eq.COUNT + i] > 2.0 else 1
    for row in range(0, eq.SYSTEM_ROWS * eq.BLOCK, eq.BLOCK):
        for i in range(n):
            w[row + i] = v[row + order[i]]
    return m


@compose
def solve(n: int, m: int, w: Array) -> None:
    """Equilibria of the n systems of a block, of which the first m have inner points."""
    for i in range(n):
        eq.find_outer(LOWER_CENTER, i, w)
    for i in range(n):
        eq.find_outer(UPPER_SADDLE, i, w)
    for i in range(m):
        eq.find_inner(LOWER_SADDLE, i, w)
    for i in range(m):
        eq.find_inner(UPPER_CENTER, i, w)
    for j in range(4):
        stop = m if j == LOWER_SADDLE or j == UPPER_CENTER else n
        for i in range(n):
            eq.classify(j, i, w)
        for i in range(stop):
            eq.put_back(j, i, w)
        for i in range(stop):
            eq.measure(j, i, w)
        for i in range(stop, n):
            eq.leave_out(j, i, w)


@compose
def enclose(n: int, m: int, w: Array) -> None:
    """Separatrices of the n systems of a block, of which the first m may have lobes."""
    for i in range(m):
        turn(i, w)
    for i in range(m):
        measure_lobes(i, w)
    for i in range(n):
        measure_winding(i, w)
    for i in range(n):
        shape(i, w)
    for j in range(2):
        for i in range(n):
            describe(j, i, w)
    for j in range(2):
        for i in range(m):
            arrange(j, i, w)
        for i in range(m, n):
            leave_out(j, i, w)


@vector_kernel
def equilibria(
    a: Array, b: Array, c: Array, exact: Array, start: int, stop: int, points: Outputs
) -> None:
    """Equilibria of systems with the coefficients a, b, c."""
    v = np.zeros(eq.SYSTEM_ROWS * eq.BLOCK)
    w = np.zeros(eq.SIZE)
    order = np.zeros(eq.BLOCK + 1, np.int64)
    for first in range(start, stop, eq.BLOCK):
        n = min(eq.BLOCK, stop - first)
        count(a, b, c, exact, first, n, v)
        m = partition(n, v, order, w)
        solve(n, m, w)
        for i in range(n):
            eq.write(i, first + order[i], w, points)


@vector_kernel
def phase_space(
    a: Array,
    b: Array,
    c: Array,
    exact: Array,
    start: int,
    stop: int,
    points: Outputs,
    loops: Outputs,
) -> None:
    """Equilibria and separatrices of systems with the coefficients a, b, c."""
    v = np.zeros(eq.SYSTEM_ROWS * eq.BLOCK)
    w = np.zeros(SIZE)
    order = np.zeros(eq.BLOCK + 1, np.int64)
    for first in range(start, stop, eq.BLOCK):
        n = min(eq.BLOCK, stop - first)
        count(a, b, c, exact, first, n, v)
        m = partition(n, v, order, w)
        solve(n, m, w)
        enclose(n, m, w)
        for i in range(n):
            eq.write(i, first + order[i], w, points)
        for i in range(n):
            write(i, first + order[i], w, loops)
