"""All equilibria of a system, step by step.

Each step does the arithmetic of one column ``i`` of a block: a flat work array ``w`` with one
quantity a row, whose rows start at the offsets named below. Steps are run over all columns of a
block, which LLVM turns into vector code; a single system is a block of one column.
"""

from __future__ import annotations

import math

import numpy as np

from phasekit.errors import EquilibriumKind
from phasekit.numerics.compile import Array, Outputs, inline
from phasekit.numerics.elementary import PI, PI_LOW, angle_quadrant, power_of_two_scale
from phasekit.phase.exact.kernels.astroid import discriminant, fold_margin
from phasekit.phase.exact.kernels.roots import inner_root, outer_root

BLOCK = 128

# Order of the equilibria.
LOWER_CENTER, LOWER_SADDLE, UPPER_CENTER, UPPER_SADDLE = range(4)

# Rows of a system: coefficients as given, the reduced system (A, B, C >= 0, scaled to [0, 4)),
# its unit, discriminant, fold margin, cube roots of B and C, number of equilibria.
A0, B0, C0, A, B, C, UNIT, DELTA, MARGIN, ROOT_B, ROOT_C, COUNT = range(0, 12 * BLOCK, BLOCK)
# Rows of a point, four of each: |cos|, |sin| and |V''| in the reduced system; then results.
X, Y, SLOPE, KIND, PHI, ENERGY, CURVATURE, FREQUENCY, EXPONENT = range(
    12 * BLOCK, 48 * BLOCK, 4 * BLOCK
)
SYSTEM_ROWS = 12
SIZE = 48 * BLOCK

# Values of COUNT that are not a number of equilibria.
INVALID = -1.0
UNDECIDED = -2.0

LARGEST = 1.7976931348623157e308

ABSENT = int(EquilibriumKind.ABSENT)
CENTER = int(EquilibriumKind.CENTER)
SADDLE = int(EquilibriumKind.SADDLE)
DEGENERATE = int(EquilibriumKind.DEGENERATE)


@inline
def reduce(i: int, w: Array) -> None:
    """The equivalent system with A, B, C >= 0, scaled by a power of two.

    phi -> pi/2 - phi turns A < 0 into -A > 0 and exchanges B and C; phi -> -phi and
    phi -> pi - phi flip the signs of C and B.
    """
    a = abs(w[A0 + i])
    b = abs(w[B0 + i])
    c = abs(w[C0 + i])
    negative = w[A0 + i] < 0.0
    size = a if a > b else b
    scale = power_of_two_scale(size if size > c else c)
    w[A + i] = a * scale
    w[B + i] = (c if negative else b) * scale
    w[C + i] = (b if negative else c) * scale
    w[UNIT + i] = 1.0 / scale


@inline
def discriminate(i: int, w: Array) -> None:
    """Delta of the reduced system; NaN where only exact arithmetic can decide its sign."""
    delta, decided = discriminant(w[A + i], w[B + i], w[C + i])
    w[DELTA + i] = delta if decided else math.nan


@inline
def count(i: int, w: Array) -> None:
    """Number of equilibria and the fold margin; a fold's pair and a cusp's triple count once.

    A coefficient that is lost in the scaling (a ratio beyond 1e308) leaves the sign undecided.
    """
    a0 = w[A0 + i]
    b0 = w[B0 + i]
    c0 = w[C0 + i]
    delta = w[DELTA + i]
    flat = w[B + i] == 0.0 or w[C + i] == 0.0
    lost = flat and delta == 0.0 and b0 != 0.0 and c0 != 0.0
    number = 4.0 if delta < 0.0 else (3.0 if delta == 0.0 and not flat else 2.0)
    number = UNDECIDED if lost or delta != delta else number
    number = 0.0 if a0 == 0.0 and b0 == 0.0 and c0 == 0.0 else number
    valid = abs(a0) <= LARGEST and abs(b0) <= LARGEST and abs(c0) <= LARGEST
    w[COUNT + i] = number if valid else INVALID
    margin, root_b, root_c = fold_margin(w[A + i], w[B + i], w[C + i], delta)
    w[MARGIN + i] = margin
    w[ROOT_B + i] = root_b
    w[ROOT_C + i] = root_c


@inline
def find_outer(j: int, i: int, w: Array) -> None:
    """The global minimum (quadrant 1 of the reduced system) or maximum (quadrant 3)."""
    center = j == LOWER_CENTER
    swap = BLOCK if center else 0  # rows B and C are neighbours
    root = w[ROOT_B + swap + i]
    s, f, slope = outer_root(w[A + i], w[B + swap + i], w[C - swap + i], root)
    p = j * BLOCK + i
    w[X + p] = f if center else s
    w[Y + p] = s if center else f
    w[SLOPE + p] = slope


@inline
def find_inner(j: int, i: int, w: Array) -> None:
    """The upper center or the lower saddle (quadrant 4), where they exist."""
    center = j == UPPER_CENTER
    swap = BLOCK if center else 0
    margin = w[MARGIN + i] if w[MARGIN + i] > 0.0 else 0.0
    s, f, slope = inner_root(
        w[A + i],
        w[B + swap + i],
        w[C - swap + i],
        w[ROOT_B + swap + i],
        w[ROOT_C - swap + i],
        margin,
    )
    p = j * BLOCK + i
    w[X + p] = f if center else s
    w[Y + p] = s if center else f
    w[SLOPE + p] = slope


@inline
def classify(j: int, i: int, w: Array) -> None:
    """The kind of point j; of the points that merge only one is kept."""
    number = w[COUNT + i]
    along_b = w[B + i]
    along_c = w[C + i]
    outer = j == LOWER_CENTER or j == UPPER_SADDLE
    axis = along_c if j == LOWER_CENTER else along_b
    cusp = outer and number == 2.0 and w[DELTA + i] == 0.0 and axis == 0.0
    fold = j == LOWER_SADDLE and number == 3.0
    present = number == 4.0 or (outer and number >= 2.0) or fold
    kind = CENTER if j == LOWER_CENTER or j == UPPER_CENTER else SADDLE
    kind = DEGENERATE if cusp or fold else kind
    w[KIND + j * BLOCK + i] = kind if present else ABSENT


@inline
def put_back(j: int, i: int, w: Array) -> None:
    """Angle and energy of point j, back in the frame that was given; NaN where absent."""
    p = j * BLOCK + i
    x = w[X + p]
    y = w[Y + p]
    a0 = w[A0 + i]
    b0 = w[B0 + i]
    c0 = w[C0 + i]
    # Quadrants 1, 4, 4, 3 in the reduced system.
    right = -1.0 if j == UPPER_SADDLE else 1.0
    above = 1.0 if j == LOWER_CENTER else -1.0
    swapped = a0 < 0.0
    cosine = y if swapped else x
    sine = x if swapped else y
    side = (above if swapped else right) * (-1.0 if b0 < 0.0 else 1.0)
    half = (right if swapped else above) * (-1.0 if c0 < 0.0 else 1.0)
    # An angle of exactly pi is +pi; one that only rounds to -pi stays there.
    half = 1.0 if sine == 0.0 and c0 == 0.0 else half
    phi = angle_quadrant(sine, cosine)
    phi = (PI - phi) + PI_LOW if side < 0.0 else phi
    x = side * cosine
    energy = (0.5 * a0 * x - b0) * x - c0 * (half * sine)
    # Twins are level to the last bit.
    saddle = j == LOWER_SADDLE or j == UPPER_SADDLE
    upright = saddle != swapped
    twins = w[COUNT + i] == 4.0 and (b0 if upright else c0) == 0.0
    share = (c0 if upright else b0) / a0
    level = 0.5 * a0 + 0.5 * c0 * share if upright else -0.5 * b0 * share
    energy = level if twins else energy
    present = w[KIND + p] != ABSENT
    w[PHI + p] = half * phi + 0.0 if present else math.nan
    w[ENERGY + p] = energy if present else math.nan


@inline
def measure(j: int, i: int, w: Array) -> None:
    """V'' and its square root at point j, in the units that were given; NaN where absent."""
    p = j * BLOCK + i
    kind = w[KIND + p]
    slope = w[SLOPE + p] * w[UNIT + i]
    slope = 0.0 if kind == DEGENERATE else slope
    rate = np.sqrt(slope)
    center = j == LOWER_CENTER or j == UPPER_CENTER
    curvature = slope if center else 0.0 - slope
    w[CURVATURE + p] = math.nan if kind == ABSENT else curvature
    w[FREQUENCY + p] = rate if kind == CENTER else math.nan
    w[EXPONENT + p] = rate if kind == SADDLE else math.nan


@inline
def leave_out(j: int, i: int, w: Array) -> None:
    """Mark point j as absent without computing it."""
    p = j * BLOCK + i
    w[PHI + p] = math.nan
    w[ENERGY + p] = math.nan
    w[CURVATURE + p] = math.nan
    w[FREQUENCY + p] = math.nan
    w[EXPONENT + p] = math.nan


@inline
def write(i: int, k: int, w: Array, out: Outputs) -> None:
    """Column i becomes cell k of the output arrays."""
    phi, kind, energy, curvature, natural_frequency, exponent, n_equilibria, margin = out
    for j in range(4):
        p = j * BLOCK + i
        phi[k, j] = w[PHI + p]
        kind[k, j] = np.int8(w[KIND + p])
        energy[k, j] = w[ENERGY + p]
        curvature[k, j] = w[CURVATURE + p]
        natural_frequency[k, j] = w[FREQUENCY + p]
        exponent[k, j] = w[EXPONENT + p]
    n_equilibria[k] = np.int8(w[COUNT + i])
    present = w[COUNT + i] > 0.0
    margin[k] = w[MARGIN + i] if present else math.nan
