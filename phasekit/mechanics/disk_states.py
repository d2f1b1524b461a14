"""Vector rotators and bearing forces of the disk, state by state.

What depends on the body alone stands in the rows of a table, a column for each body, which NumPy
fills (``phasekit.mechanics.disk_table``); ``index`` says which body a state belongs to. Frames:
carrier (u01, v01, n1), bearings (u2, v2, n2), which turns with the disk; s and c are sine and
cosine of phi.
"""

from __future__ import annotations

import math

import numpy as np

from phasekit.arrays import Array, Index
from phasekit.numerics.compile import Outputs, inline, kernel

# Rows of the table.
A, B, C = 0, 1, 2  # coefficients of the equation of motion
MIXING = 3  # of omega1' cos phi in that equation
OMEGA = 4  # omega1
ARM = 5  # a
ACROSS, ALONG = 6, 7  # of the mass center from O2: e sin beta from the shaft, e cos beta along it
SIN, COS = 8, 9  # of beta
JU, JV, JN, JVN = 10, 11, 12, 13
MASS, WEIGHT = 14, 15  # m, m g
SPAN = 16  # half the distance between the bearings
SIZE = 17

NAN = np.nan


@inline
def acceleration(k: int, s: float, c: float, domega: float, table: Array) -> float:
    """Acceleration phi'' of the free motion."""
    force = -table[B, k] * s + (table[A, k] * s + table[C, k]) * c
    return force - table[MIXING, k] * domega * c


@inline
def jerk(k: int, s: float, c: float, dphi: float, domega: float, table: Array) -> float:
    """Rate of change of phi'' along the free motion, for constant omega1'."""
    a, b, cc = table[A, k], table[B, k], table[C, k]
    along = dphi * (-b * c + a * (c - s) * (c + s) - cc * s + table[MIXING, k] * domega * s)
    omega = table[OMEGA, k]
    if domega == 0.0:
        return along
    return along + 2.0 * domega / omega * (a * s + cc) * c if omega != 0.0 else along


@inline
def turn_rate(dphi: float, ddphi: float, dddphi: float) -> float:
    """Rate of the angle of a rotator against its base vector, 0/0 at rest.

    The state is scaled by its larger rate, so that nothing overflows or vanishes.
    """
    unit = max(abs(dphi), math.sqrt(abs(ddphi)))
    v = dphi / unit
    w = ddphi / unit / unit
    return unit * v * (2.0 * w * w - v * (dddphi / unit / unit / unit)) / (w * w + v * v * v * v)


@inline
def put(
    i: int,
    row: int,
    base: tuple[float, float, float],
    turned: tuple[float, float, float],
    d: float,
    q: float,
    out: Outputs,
) -> None:
    """Write d along a base vector and q along that vector turned, both of the same length."""
    rotator, intensity = out[0], out[1]
    unit = max(abs(base[0]), abs(base[1]), abs(base[2]))  # squares would vanish below 1e-154
    size = NAN
    if unit > 0.0:
        x, y, z = base[0] / unit, base[1] / unit, base[2] / unit
        size = unit * math.sqrt(x * x + y * y + z * z)
    known = size > 0.0
    du = d / size
    qv = q / size
    rotator[i, row, 0] = 0.0 + du * base[0] + qv * turned[0]
    rotator[i, row, 1] = 0.0 + du * base[1] + qv * turned[1]
    rotator[i, row, 2] = 0.0 + du * base[2] + qv * turned[2]
    intensity[i, row] = math.sqrt(d * d + q * q) if known else NAN


@inline
def put_about_n1(i: int, row: int, x: float, y: float, d: float, q: float, out: Outputs) -> None:
    """Write a rotator with the base vector (x, y, 0), which n1 turns to (-y, x, 0)."""
    put(i, row, (x, y, 0.0), (-y, x, 0.0), d, q, out)


@inline
def put_about_n2(i: int, row: int, y: float, z: float, d: float, q: float, out: Outputs) -> None:
    """Write a rotator with the base vector (0, y, z), which n2 turns to (0, -z, y)."""
    put(i, row, (0.0, y, z), (0.0, -z, y), d, q, out)


@kernel
def rotators(
    table: Array,
    index: Index,
    phi: Array,
    dphi: Array,
    ddphi: Array,
    domega1: Array,
    free: bool,
    start: int,
    stop: int,
    out: Outputs,
) -> None:
    """The eight rotators in the carrier frame, the angle of R022 and its rate, the hodograph."""
    gamma, gamma_rate, hodograph_u, hodograph_v = out[2], out[3], out[4], out[5]
    still = (0.0, 0.0, 0.0)
    for i in range(start, stop):
        k = index[i]
        s, c = math.sin(phi[i]), math.cos(phi[i])
        d1 = domega1[i]
        d2 = acceleration(k, s, c, d1, table) if free else ddphi[i]
        w1, w2 = table[OMEGA, k], dphi[i]
        q1, q2 = w1 * w1, w2 * w2
        across, along = table[ACROSS, k], table[ALONG, k]
        jn, jvn = table[JN, k], table[JVN, k]
        skew = table[JU, k] - table[JV, k]
        put_about_n1(i, 0, -table[ARM, k], 0.0, d1, q1, out)  # R01: [n1, r0]
        put_about_n1(i, 1, -across * s, along, d1, q1, out)  # R011: S_n1
        put_about_n2(i, 2, across * c, across * s, d2, q2, out)  # R022: S_n2
        put(i, 3, (-across * c, 0.0, 0.0), still, 2.0 * w1 * w2, 0.0, out)  # R012: [n1, S_n2]
        put_about_n1(i, 4, c * jvn, c * skew * s, d1, q1, out)  # R1: D_n1
        put_about_n2(i, 5, -jvn * s, jvn * c, d2, q2, out)  # R2: D_n2
        put(i, 6, (jvn * s, jn, 0.0), still, 2.0 * w1 * w2, 0.0, out)  # R12: [n1, J_n2]
        coupling = (0.0, jn + skew * (c - s) * (c + s), 2.0 * skew * s * c)
        put(i, 7, coupling, still, 2.0 * w1 * w2, 0.0, out)  # R12c: the vector C12
        gamma[i] = math.atan2(q2, d2)
        gamma_rate[i] = turn_rate(w2, d2, jerk(k, s, c, w2, d1, table)) if free else NAN
        hodograph_u[i] = d2
        hodograph_v[i] = q2 + 0.0 * w1  # NaN where there is no body


@inline
def pair(
    k: int, s: float, c: float, dphi: float, ddphi: float, domega: float, table: Array
) -> tuple[float, float, float, float, float]:
    """Inertial forces at the bearings of the shaft: what both share, how they differ, along n2.

    (u, v) of (F_A2 + F_B2)/2, (u, v) of (F_A2 - F_B2)/2, and the axial force, which A2 takes.
    """
    w = table[OMEGA, k]
    m = table[MASS, k]
    across, along, arm = table[ACROSS, k], table[ALONG, k], table[ARM, k]
    jvn, jn, skew = table[JVN, k], table[JN, k], table[JU, k] - table[JV, k]
    q = dphi * dphi
    # along w1 = n1 = (s, c), w2 = (s, -c), w3 = -v01 = (-c, s)
    third = 0.5 * m * (w * w * (arm + across * s) - domega * along)
    half_u = 0.5 * m * across * ddphi - third * c
    half_v = 0.5 * m * across * q + third * s
    first = -(jvn * w * c + jn * dphi) * w
    second = skew * w * dphi
    third = m * arm * along * w * w
    lever = 0.5 / table[SPAN, k]
    couple_u = lever * (jvn * ddphi + (first + second) * s - third * c + domega * table[JV, k] * c)
    couple_v = lever * (
        jvn * q + (first - second) * c + third * s - domega * (table[JU, k] * s + m * arm * across)
    )
    axial = 0.0 - m * (w * w * along + 2.0 * w * dphi * across * c + domega * (arm + across * s))
    return half_u, half_v, couple_u, couple_v, axial


@inline
def drive(
    k: int, s: float, c: float, dphi: float, ddphi: float, domega: float, table: Array
) -> float:
    """Torque about n1 that keeps the support at its speed."""
    m, arm, across = table[MASS, k], table[ARM, k], table[ACROSS, k]
    ju, jv = table[JU, k], table[JV, k]
    about = m * arm * (arm + 2.0 * across * s) + ju * s * s + jv * c * c
    coupling = 2.0 * c * (m * arm * across + (ju - jv) * s)
    inertial = table[JVN, k] * (ddphi * c - dphi * dphi * s)
    return domega * about + table[OMEGA, k] * dphi * coupling + inertial


@kernel
def bearings(
    table: Array,
    index: Index,
    phi: Array,
    dphi: Array,
    ddphi: Array,
    domega1: Array,
    free: bool,
    carrier: bool,
    start: int,
    stop: int,
    out: Outputs,
) -> None:
    """Forces on the disk at the bearings of its shaft, in the bearings' frame or the carrier's."""
    force, kinetic, weight, magnitude, axial, couple, torque, component = out
    for i in range(start, stop):
        k = index[i]
        s, c = math.sin(phi[i]), math.cos(phi[i])
        w2, d1 = dphi[i], domega1[i]
        d2 = acceleration(k, s, c, d1, table) if free else ddphi[i]
        half_u, half_v, couple_u, couple_v, along_n2 = pair(k, s, c, w2, d2, d1, table)
        span, mass, w1 = table[SPAN, k], table[MASS, k], table[OMEGA, k]
        across, along, jvn = table[ACROSS, k], table[ALONG, k], table[JVN, k]
        lever = 0.5 / span
        for j in range(2):
            sign = 1.0 - 2.0 * j  # A2 at +half_span, B2 at -half_span
            u, v = half_u + sign * couple_u, half_v + sign * couple_v
            n = along_n2 if j == 0 else abs(0.0 * along_n2)
            hold = 0.5 * table[WEIGHT, k] * (1.0 + sign * along / span)
            none = abs(0.0 * hold * s)  # NaN where there is no body or state
            if carrier:  # u01, v01, n1
                v01, n1 = c * u - s * v, s * u + c * v
                kinetic[i, j, 0], kinetic[i, j, 1], kinetic[i, j, 2] = n, v01, n1
                weight[i, j, 0], weight[i, j, 1], weight[i, j, 2] = none, none, hold
                force[i, j, 0], force[i, j, 1], force[i, j, 2] = n, v01, n1 + hold
            else:  # u2, v2, n2
                kinetic[i, j, 0], kinetic[i, j, 1], kinetic[i, j, 2] = u, v, n
                weight[i, j, 0], weight[i, j, 1] = hold * s, hold * c
                weight[i, j, 2] = none
                force[i, j, 0], force[i, j, 1] = u + hold * s, v + hold * c
                force[i, j, 2] = n
            total_u, total_v = u + hold * s, v + hold * c
            magnitude[i, j] = math.sqrt(total_u * total_u + total_v * total_v + n * n)
            skew = table[JU, k] - table[JV, k]
            component[i, j, 0] = -sign * lever * (jvn * w1 * c + table[JN, k] * w2) * w1
            component[i, j, 1] = sign * lever * skew * w1 * w2
            arm = table[ARM, k]
            radial = arm + across * s + sign * arm / span * along
            component[i, j, 2] = 0.5 * mass * w1 * w1 * radial
            turning = math.sqrt(d2 * d2 + w2 * w2 * w2 * w2)
            component[i, j, 3] = (0.5 * mass * across + sign * lever * jvn) * turning
        axial[i] = along_n2
        couple[i] = 2.0 * span * math.sqrt(couple_u * couple_u + couple_v * couple_v)
        torque[i] = drive(k, s, c, w2, d2, d1, table)


@kernel
def fixed_bearings(
    table: Array,
    index: Index,
    phi: Array,
    dphi: Array,
    ddphi: Array,
    domega1: Array,
    span: Array,
    free: bool,
    start: int,
    stop: int,
    out: Outputs,
) -> None:
    """Forces on the rotor at the bearings of the fixed shaft, in the carrier frame."""
    force, kinetic, weight = out
    for i in range(start, stop):
        k = index[i]
        s, c = math.sin(phi[i]), math.cos(phi[i])
        w1, w2, d1 = table[OMEGA, k], dphi[i], domega1[i]
        own = acceleration(k, s, c, d1, table)
        d2 = own if free else ddphi[i]
        m, arm, heavy = table[MASS, k], table[ARM, k], table[WEIGHT, k]
        across, along = table[ACROSS, k], table[ALONG, k]
        skew, jvn, jn = table[JU, k] - table[JV, k], table[JVN, k], table[JN, k]
        reach = arm + across * s
        # rate of momentum
        f_u01 = -m * (w1 * w1 * along + 2.0 * w1 * w2 * across * c + d1 * reach)
        f_v01 = m * (across * (d2 * c - w2 * w2 * s) + d1 * along - w1 * w1 * reach)
        f_n1 = m * across * (d2 * s + w2 * w2 * c)
        # rate of angular momentum about O1, square to n1; about n2 all but the motor's torque
        # is what the equation of motion balances, weight included
        l_v01 = w1 * w2 * (jn + skew * (c - s) * (c + s))
        l_v01 += jvn * ((w1 - w2) * (w1 + w2) * c - d2 * s)
        l_v01 += d1 * c * (skew * s + m * arm * across)
        l_u01 = arm * f_n1 + jn * (d2 - own) - heavy * across * s
        lever = 1.0 / span[i]
        kin_u, kin_v = lever * l_v01, -lever * l_u01
        stat_u, stat_v = -lever * heavy * along, -lever * heavy * reach
        none = abs(0.0 * stat_u * s)  # NaN where there is no body, bearing or state
        kinetic[i, 1, 0], kinetic[i, 1, 1], kinetic[i, 1, 2] = kin_u, kin_v, none
        weight[i, 1, 0], weight[i, 1, 1], weight[i, 1, 2] = stat_u, stat_v, none
        force[i, 1, 0], force[i, 1, 1], force[i, 1, 2] = kin_u + stat_u, kin_v + stat_v, none
        kinetic[i, 0, 0], kinetic[i, 0, 1], kinetic[i, 0, 2] = (
            f_u01 - kin_u,
            f_v01 - kin_v,
            f_n1 + none,
        )
        weight[i, 0, 0], weight[i, 0, 1], weight[i, 0, 2] = -stat_u, -stat_v, heavy + none
        for j in range(3):
            force[i, 0, j] = kinetic[i, 0, j] + weight[i, 0, j]
