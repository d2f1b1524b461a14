"""Peak, mean and rms over separatrix loops of the bearing forces, or of the rotators.

A loop is followed by its angle, not by time: on it the motion takes for ever, and almost all of
that next to the saddle. The angle runs over double-exponential nodes, which crowd at both ends as
the square roots there need it, and is measured from the nearer end, so that phi' keeps its digits.
"""

from __future__ import annotations

import math

import numpy as np

from phasekit.arrays import Array, Codes, Index
from phasekit.errors import Loop
from phasekit.loads.arcs import (
    ARC,
    AT_FIRST,
    AT_LAST,
    BEYOND,
    COS_FIRST,
    COS_LAST,
    DELTA,
    FIRST,
    MEASURES,
    SIGN,
    SIN_FIRST,
    SIN_LAST,
    STEEP,
    SUMS,
    WINDS,
    halved,
    measures,
    square_speed_from_saddle,
    state,
)
from phasekit.mechanics.disk_states import OMEGA, A, B, C, acceleration
from phasekit.numerics.compile import Outputs, inline, kernel, routine

NAN = np.nan
TWO_PI = 2.0 * math.pi
LOBES, WINDING, HETEROCLINIC = int(Loop.LOBES), int(Loop.WINDING), int(Loop.HETEROCLINIC)

# Double-exponential nodes: the first level, then those between them, level by level.
STEP = 1.0 / 5.0
REACH = 17  # nodes of the first level on either side of the middle: 1e-19 of the arc from its end
LEVELS = 4
TOLERANCE = 1e-8  # of mean square and mean, from level to level
SAMPLED = 3  # levels that are searched for peaks
SAMPLES = REACH * 2**SAMPLED + 1  # their nodes, in order along the arc
CANDIDATES = 5  # highest samples that are refined to peaks
WORTH = 0.8  # of the highest peak so far: lower samples are not refined
REFINEMENTS = 24
APART = 0.02  # of the arc: nearer local maxima are one
BRANCHES = 2
DIP = 0.2  # of the mean: what falls lower almost has a kink


def _nodes() -> tuple[Array, Array]:
    """Distances of the nodes from the nearer end of a unit arc, and weights.

    Those from the last end are negative. Level after level, each in its order along the arc; a
    level's weights are for its own step.
    """
    distances, weights = [], []
    for level in range(LEVELS):
        step = STEP / 2**level
        q = np.arange(-(REACH << level), (REACH << level) + 1)
        t = step * (q if level == 0 else q[q % 2 != 0])
        stretch = 0.5 * math.pi * np.sinh(t)
        distances.append(np.where(t > 0, -0.5, 0.5) * np.exp(-np.abs(stretch)) / np.cosh(stretch))
        with np.errstate(over="ignore"):  # where the weight is 0
            weights.append(step * 0.25 * math.pi * np.cosh(t) / np.cosh(stretch) ** 2)
    return np.concatenate(distances), np.concatenate(weights)


DISTANCE, WEIGHTS = _nodes()


@kernel
def at_states(
    table: Array,
    index: Index,
    phi: Array,
    dphi: Array,
    rotators: bool,
    start: int,
    stop: int,
    out: Outputs,
) -> None:
    """The two measures at states of the free motion."""
    for i in range(start, stop):
        k = index[i]
        s, c = math.sin(phi[i]), math.cos(phi[i])
        ddphi = acceleration(k, s, c, 0.0, table)
        out[0][i, 0], out[0][i, 1] = measures(k, s, c, dphi[i], ddphi, rotators, table)


@inline
def node(distance: float) -> float:
    """Place of a node on the unit arc."""
    return distance if distance > 0.0 else 1.0 + distance


@routine
def refine(
    k: int,
    arc: Array,
    branch: int,
    measure: int,
    rotators: bool,
    left: float,
    middle: float,
    right: float,
    table: Array,
) -> tuple[float, float, float]:
    """Highest value between two places, its angle and angular velocity.

    By parabolas through three points, and every third time by a step into the larger part.
    """
    x = np.array([left, middle, right])
    y, phis, speeds = np.zeros(3), np.zeros(3), np.zeros(3)
    for n in range(3 + REFINEMENTS):
        new = x[n] if n < 3 else x[1]
        if n >= 3:
            d1, d2 = x[1] - x[0], x[2] - x[1]
            g1, g2 = (y[1] - y[0]) * d2, (y[1] - y[2]) * d1
            if g1 + g2 > 0.0:
                new = x[1] + 0.5 * (g1 * d2 - g2 * d1) / (g1 + g2)
            lost = not (x[0] < new < x[2]) or abs(new - x[1]) < 1e-9 * (x[2] - x[0])
            if n % 3 == 2 or lost:
                new = x[1] + 0.4 * d2 if d2 > d1 else x[1] - 0.4 * d1
        phi, dphi = state(k, arc, new if new < 0.5 else new - 1.0, table)
        dphi = -dphi if branch == 1 else dphi
        s, c = math.sin(phi), math.cos(phi)
        ddphi = acceleration(k, s, c, 0.0, table)
        both = measures(k, s, c, dphi, ddphi, rotators, table)
        value = both[0] if measure == 0 else both[1]
        at = n
        if n >= 3 and value > y[1]:
            other = 0 if new > x[1] else 2  # the old middle becomes an end
            x[other], y[other], phis[other], speeds[other] = x[1], y[1], phis[1], speeds[1]
            at = 1
        elif n >= 3:
            at = 2 if new > x[1] else 0
        x[at], y[at], phis[at], speeds[at] = new, value, phi, dphi
    best = 1
    for n in (0, 2):
        if y[n] > y[best]:
            best = n
    return y[best], phis[best], speeds[best]


@routine
def raise_peak(
    k: int,
    arc: Array,
    measure: int,
    rotators: bool,
    distance: Array,
    samples: Array,
    best: Array,
    table: Array,
) -> None:
    """Set value, angle and angular velocity of the peak to those on this arc if it is higher."""
    taken = np.full(CANDIDATES, -1.0)
    for n in range(CANDIDATES):
        branch, at, highest = -1, 0, -1.0
        for b in range(BRANCHES):
            for q in range(SAMPLES):
                value = samples[b, measure, q]
                lower = (q > 0 and samples[b, measure, q - 1] > value) or (
                    q < SAMPLES - 1 and samples[b, measure, q + 1] > value
                )
                if value > highest and not lower:
                    apart = True
                    for one in range(n):
                        if abs(2 * b + distance[q] - taken[one]) < APART:
                            apart = False
                    if apart:
                        branch, at, highest = b, q, value
        if branch < 0 or highest < WORTH * best[0]:
            return
        taken[n] = 2 * branch + distance[at]
        left = distance[at - 1] if at > 0 else 0.0
        right = distance[at + 1] if at < SAMPLES - 1 else 1.0
        value, phi, dphi = refine(
            k, arc, branch, measure, rotators, left, distance[at], right, table
        )
        if value > best[0]:
            best[0], best[1], best[2] = value, phi, dphi


@routine
def dips(samples: Array, measure: int, branches: int, sums: Array) -> bool:
    """Whether a measure almost vanishes between the ends of an arc."""
    low = DIP * sums[2 * measure] / branches
    for b in range(branches):
        y = samples[b, measure]
        for q in range(1, SAMPLES - 1):
            if y[q] < low and y[q] < y[q - 1] and y[q] < y[q + 1]:
                return True
    return False


@routine
def over_arc(
    k: int,
    arc: Array,
    branches: int,
    rotators: bool,
    distance: Array,
    weight: Array,
    samples: Array,
    places: Array,
    best: Array,
    sums: Array,
    table: Array,
) -> None:
    """Add an arc to a loop: raise its peaks, add to the sums over the angle.

    Levels of nodes are added until the sums no longer change, or it shows that they will not.
    """
    samples[:] = -1.0
    old, new = np.zeros(SUMS), np.zeros(SUMS)
    first, scale = 0, 0.0
    last = arc[FIRST] + arc[DELTA]
    arc[SIN_FIRST], arc[COS_FIRST] = math.sin(arc[FIRST]), math.cos(arc[FIRST])
    arc[SIN_LAST], arc[COS_LAST] = math.sin(last), math.cos(last)
    settled, kinked = np.zeros(MEASURES, np.bool_), np.zeros(MEASURES, np.bool_)
    for level in range(LEVELS):
        count = 2 * REACH + 1 if level == 0 else REACH << level
        scale *= 0.5
        for n in range(SUMS):
            new[n] *= 0.5
        for q in range(first, first + count):
            phi, dphi = state(k, arc, distance[q], table)
            s, c = math.sin(phi), math.cos(phi)
            ddphi = acceleration(k, s, c, 0.0, table)
            scale += weight[q]
            for b in range(branches):
                values = measures(k, s, c, -dphi if b == 1 else dphi, ddphi, rotators, table)
                for measure in range(MEASURES):
                    value = values[0] if measure == 0 else values[1]
                    new[2 * measure] += weight[q] * value
                    new[2 * measure + 1] += weight[q] * value * value
                    if level < SAMPLED:
                        stride = 1 << (SAMPLED - 1 - level)
                        at = (q if level == 0 else 2 * (q - first) + 1) * stride
                        samples[b, measure, at] = value
                        places[at] = node(distance[q])
        first += count
        for measure in range(MEASURES):
            settled[measure] = level >= SAMPLED - 1
        for n in range(SUMS):
            close = abs(new[n] / scale - old[n]) <= TOLERANCE * new[n] / scale
            settled[n // 2] = settled[n // 2] and close
            old[n] = new[n] / scale
        if level == SAMPLED - 1:
            for measure in range(MEASURES):
                kinked[measure] = dips(samples, measure, branches, old)
        finished = level >= SAMPLED - 1
        for measure in range(MEASURES):
            finished = finished and (settled[measure] or kinked[measure])
        if finished:
            break
    for measure in range(MEASURES):
        if kinked[measure] or not settled[measure]:
            halved(k, arc, branches, measure, rotators, old, table)
    for measure in range(MEASURES):
        for power in range(2):
            sums[measure, power] += abs(arc[DELTA]) / branches * old[2 * measure + power]
        raise_peak(k, arc, measure, rotators, places, samples, best[measure], table)


@kernel
def separatrices(
    table: Array,
    index: Index,
    saddle_phi: Array,
    saddle_exponent: Array,
    turning_offset: Array,
    loop: Codes,
    distance: Array,
    weight: Array,
    rotators: bool,
    start: int,
    stop: int,
    out: Outputs,
) -> None:
    """Over each loop of each saddle: peaks of two measures, where they are, means and rms.

    A lobe, or an arc between two saddles, is run through there and back; a winding loop once, in
    the direction of its side, in two arcs where it passes over a lower saddle.
    """
    highest, mean, rms, peak_phi, peak_dphi = out
    samples, places = np.zeros((BRANCHES, MEASURES, SAMPLES)), np.zeros(SAMPLES)
    arc, best, sums = np.zeros(ARC), np.zeros((MEASURES, 3)), np.zeros((MEASURES, 2))
    for i in range(start, stop):
        k = index[i]
        for j in range(2):
            for side in range(2):
                code = loop[i, j]
                winding = code == WINDING
                delta = TWO_PI * (2 * side - 1) if winding else turning_offset[i, j, side]
                present = winding or code == LOBES or code == HETEROCLINIC
                near = saddle_phi[i, j]
                present = present and math.isfinite(table[OMEGA, k] * delta * near)
                if present:
                    best[:, 0] = -1.0
                    sums[:] = 0.0
                    arc[:] = 0.0
                    arc[FIRST], arc[DELTA] = near, delta
                    arc[WINDS] = 1.0 if winding else 0.0
                    other = turning_offset[i, j, 1 - side] if code == LOBES else delta
                    ends = math.sin(0.5 * delta) * math.sin(0.5 * other)
                    arc[BEYOND] = other - delta
                    arc[STEEP] = saddle_exponent[i, j] * saddle_exponent[i, j] / ends
                    arc[SIGN] = 1.0 if delta > 0.0 else -1.0
                    passes = saddle_phi[i, 1 - j] - near
                    arcs = 1
                    if winding and passes == passes:
                        arcs = 2
                        if passes * delta < 0.0:
                            passes += delta
                        s, c = math.sin(near), math.cos(near)
                        arc[AT_LAST] = square_speed_from_saddle(
                            passes, s, c, table[A, k], table[B, k], table[C, k]
                        )
                        arc[DELTA] = passes
                    for n in range(arcs):
                        if n == 1:
                            arc[FIRST], arc[DELTA] = near + passes, delta - passes
                            arc[AT_FIRST], arc[AT_LAST] = arc[AT_LAST], 0.0
                        over_arc(
                            k,
                            arc,
                            1 if winding else 2,
                            rotators,
                            distance,
                            weight,
                            samples,
                            places,
                            best,
                            sums,
                            table,
                        )
                for measure in range(MEASURES):
                    at = best[measure, 1]
                    at -= TWO_PI * math.ceil((at - math.pi) / TWO_PI)
                    highest[i, j, side, measure] = best[measure, 0] if present else NAN
                    peak_phi[i, j, side, measure] = at if present else NAN
                    peak_dphi[i, j, side, measure] = best[measure, 2] if present else NAN
                    over = abs(delta)
                    square = sums[measure, 1] / over
                    mean[i, j, side, measure] = sums[measure, 0] / over if present else NAN
                    rms[i, j, side, measure] = math.sqrt(square) if present else NAN
