"""Turning points and areas of the separatrices, in closed form, step by step.

Continues the block of ``equilibria``. At a saddle of the reduced system let x, y be |cos|, |sin|,
k^2 = -V'', mu = B/x, X = sqrt(A) x and Y = sqrt(A) y. Then A - mu = k^2 + Y^2 at the lower saddle
(a figure-eight, mu > 0) and m = -mu > 0 at the upper one (loops that wind round the cylinder).
In u = tan((phi - phi_s)/2) the level of the saddle is u'^2 = u^2 (k^2 - 2 S u - P u^2) with
S = -A x y, P = mu - A y^2, and S^2 + P k^2 = mu (A - mu): these forms do not cancel.
"""

from __future__ import annotations

import math

import numpy as np

from phasekit.errors import Loop, Topology
from phasekit.kernels import equilibria as eq
from phasekit.kernels.compile import Array, Outputs, inline
from phasekit.kernels.elementary import PI, angle_half, angle_quadrant, wrap

# Rows after those of the equilibria: offsets from the lower saddle to the turning points of the
# small and the big lobe (positive), the lobes' areas, the area under the winding loop.
SMALL_OFFSET, BIG_OFFSET, SMALL_AREA, BIG_AREA, WINDING_AREA = range(
    eq.SIZE, eq.SIZE + 5 * eq.BLOCK, eq.BLOCK
)
SIZE = eq.SIZE + 5 * eq.BLOCK

LOWER = eq.LOWER_SADDLE * eq.BLOCK
UPPER = eq.UPPER_SADDLE * eq.BLOCK

# 1 - 2 s/3 - (1 - s) atanh(sqrt s)/sqrt s = s^2 (TAIL[0] + TAIL[1] s + ...)
TAIL = tuple(2.0 / ((2 * n + 5) * (2 * n + 3)) for n in range(30))
SERIES = 0.3


@inline
def turn(i: int, w: Array) -> None:
    """Angles from the lower saddle to the turning points of its two lobes."""
    a = w[eq.A + i]
    b = w[eq.B + i]
    x = w[eq.X + LOWER + i]
    y = w[eq.Y + LOWER + i]
    k2 = w[eq.SLOPE + LOWER + i]
    mu = b / x if b > 0.0 else 0.0
    reach = math.sqrt(mu) * math.sqrt(k2 + a * y * y) + a * x * y
    w[SMALL_OFFSET + i] = 2.0 * angle_quadrant(k2, reach)
    big = 2.0 * angle_half(reach, mu - a * y * y)
    w[BIG_OFFSET + i] = big if reach > 0.0 else PI


@inline
def tail(s: float) -> float:
    """(1 - 2 s/3 - (1 - s) atanh(sqrt s)/sqrt s) / s^2 for |s| <= SERIES."""
    value = TAIL[29]
    for n in range(28, -1, -1):
        value = value * s + TAIL[n]
    return value


@inline
def measure_lobes(i: int, w: Array) -> None:
    """Areas of the lower saddle's lobes (of the arcs to the partner, where B = 0).

    small = (4 k/A) [X^2 E(k^2/X^2) + Y^2 E(-k^2/Y^2)], E(s) = 1 - 2 s/3 - (1 - s)
    atanh(sqrt s)/sqrt s, both terms positive; big = small + 4 pi C/sqrt A.
    """
    a = w[eq.A + i]
    b = w[eq.B + i]
    x = math.sqrt(a) * w[eq.X + LOWER + i]
    y = math.sqrt(a) * w[eq.Y + LOWER + i]
    k2 = w[eq.SLOPE + LOWER + i]
    k = math.sqrt(k2)
    if k2 <= SERIES * x * x:
        along = k2 * (k2 / (x * x)) * tail(k2 / (x * x))
    else:
        along = x * x - (2.0 / 3.0) * k2
        if b > 0.0:
            mu = b / w[eq.X + LOWER + i]
            along -= mu * (x / k) * math.log((x + k) / math.sqrt(mu))
    if k2 <= SERIES * y * y:
        across = k2 * (k2 / (y * y)) * tail(-k2 / (y * y))
    else:
        across = y * y + (2.0 / 3.0) * k2 - (y * y + k2) * (y / k) * math.atan2(k, y)
    unit = math.sqrt(w[eq.UNIT + i])
    small = 4.0 * k / a * (along + across)
    w[SMALL_AREA + i] = small * unit
    w[BIG_AREA + i] = (small + 4.0 * PI * w[eq.C + i] / math.sqrt(a)) * unit


@inline
def measure_winding(i: int, w: Array) -> None:
    """Area under one winding loop, the integral of |phi'| over the circle.

    4 k + (4/sqrt A) [B atanh(X/k) + C atan(Y/k)] with k^2 - X^2 = m; regular at A = 0.
    """
    a = w[eq.A + i]
    b = w[eq.B + i]
    c = w[eq.C + i]
    s = w[eq.X + UPPER + i]
    f = w[eq.Y + UPPER + i]
    k2 = w[eq.SLOPE + UPPER + i]
    k = math.sqrt(k2)
    x = math.sqrt(a) * s
    y = math.sqrt(a) * f
    area = 4.0 * k
    if b > 0.0 and k > 0.0:
        ratio = x / k
        if ratio < 0.5:
            area += 4.0 * b * s / k * (math.atanh(ratio) / ratio if ratio > 0.0 else 1.0)
        else:
            area += 4.0 * b / math.sqrt(a) * math.log((k + x) / math.sqrt(b / s))
    if y > k:
        area += 4.0 * c / math.sqrt(a) * math.atan2(y, k)
    elif k > 0.0:
        area += 4.0 * c * f / k * (math.atan(y / k) / (y / k) if y > 0.0 else 1.0)
    w[WINDING_AREA + i] = area * math.sqrt(w[eq.UNIT + i])


@inline
def write(i: int, k: int, w: Array, out: Outputs) -> None:
    """Column i becomes cell k of the output arrays; sides swap with every reflection."""
    (
        topology,
        figure_eight,
        saddle_phi,
        saddle_energy,
        saddle_exponent,
        loop,
        winding_area,
        turning_offset,
        turning_phi,
        lobe_area,
    ) = out
    number = w[eq.COUNT + i]
    four = number == 4.0
    level = four and (w[eq.C0 + i] if w[eq.A0 + i] < 0.0 else w[eq.B0 + i]) == 0.0
    figure_eight[k] = four and not level
    shape = Topology.HETEROCLINIC if level else Topology.FIGURE_EIGHT
    shape = shape if four else Topology.WINDING
    shape = shape if number > 0.0 else Topology.NONE
    topology[k] = np.int8(shape if number >= 0.0 else Topology.NOT_COMPUTED)
    lower_loop = (Loop.HETEROCLINIC if level else Loop.LOBES) if four else Loop.ABSENT
    upper_loop = Loop.HETEROCLINIC if level else Loop.WINDING
    loop[k, 0] = np.int8(lower_loop)
    loop[k, 1] = np.int8(upper_loop if number > 0.0 else Loop.ABSENT)
    for j in range(2):
        p = (UPPER if j == 1 else LOWER) + i
        regular = w[eq.KIND + p] == eq.SADDLE
        present = regular or (j == 1 and w[eq.KIND + p] == eq.DEGENERATE)
        saddle_phi[k, j] = w[eq.PHI + p] if present else math.nan
        saddle_energy[k, j] = w[eq.ENERGY + p] if present else math.nan
        saddle_exponent[k, j] = math.sqrt(-w[eq.CURVATURE + p]) if present else math.nan
        winds = j == 1 and loop[k, j] == Loop.WINDING
        winding_area[k, j] = w[WINDING_AREA + i] if winds else math.nan
        odd = (w[eq.A0 + i] < 0.0) != ((w[eq.B0 + i] < 0.0) != (w[eq.C0 + i] < 0.0))
        partner = w[eq.PHI + (UPPER if j == 0 else LOWER) + i]
        for side in range(2):
            # In the reduced system the lower saddle's small lobe is on its left.
            small = (side == 0) != (odd != (j == 1))
            closed = (four and j == 0) or level
            offset = w[SMALL_OFFSET + i] if small else w[BIG_OFFSET + i]
            offset = -offset if side == 0 else offset
            area = w[SMALL_AREA + i] if small else w[BIG_AREA + i]
            end = partner if level else wrap(w[eq.PHI + p] + offset)
            turning_offset[k, j, side] = offset if closed else math.nan
            turning_phi[k, j, side] = end if closed else math.nan
            lobe_area[k, j, side] = area if closed else math.nan
