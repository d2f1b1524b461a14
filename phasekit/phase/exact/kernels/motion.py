"""Where a state is after any time: closed forms, so no error grows with the number of steps.

Only the phase w t grows. Its frequency w is computed in double-double arithmetic from the cubic

    mu^3 + 2 (h - A) mu^2 + (B^2 + C^2 - A (2 h - A)) mu - A B^2 = 0

of the energy h, whose roots are those of `shape` plus mu, and the phase is
reduced in it. On a separatrix z = cot((phi - phi_s)/2) obeys z'' = k^2 z - S2.
"""

from __future__ import annotations

import math

import numpy as np

from phasekit.arrays import Array
from phasekit.numerics.agm import phase
from phasekit.numerics.compile import inline, routine
from phasekit.numerics.double_double import (
    TWO_PI,
    TWO_PI_LOW,
    dd_add,
    dd_cos_sin,
    dd_multiply,
    dd_sqrt,
    reduce_angle,
    two_product,
    two_sum,
)
from phasekit.numerics.elementary import PI, angle_half
from phasekit.phase.exact.kernels.action import SIZE
from phasekit.phase.exact.kernels.levels import (
    ANGLE,
    ASYMPTOTE,
    DIRECTION,
    FREE,
    GAP,
    HARMONIC,
    INVALID,
    MODE,
    RATE,
    REFERENCE,
    REST,
    START,
    SWING,
    TURN,
    TURNS,
)
from phasekit.phase.exact.kernels.locate import locate
from phasekit.phase.exact.kernels.shape import (
    FIRST,
    HIGH,
    LEVELS,
    LOW,
    MEANS,
    PHI_S,
    PHI_S_LOW,
    RATIO,
    REST_R,
    S2,
    SECOND,
    SIGMA,
    SIGMA_LOW,
    SKEW,
    SLOPE,
    SPAN,
    TAU,
    X0,
    Y_PRODUCT,
    Z_APART,
    Z_HIGH,
    Z_LOW,
    M,
    N,
    P,
    U,
    refer,
)
from phasekit.phase.exact.kernels.system import CURVATURE, PHI, UNIT, A, B, C, potential_dd

# Rows after those of an orbit: phase at the start and frequency (high and low parts), whole turns
# from the local angle to the state's; coefficients of exp(kt) and exp(-kt) in z.
PHASE, PHASE_LOW, OMEGA_HIGH, OMEGA_LOW, BASE, RISE, FALL = range(SIZE, SIZE + 7)
MOTION_SIZE = SIZE + 7

# Gaps to a saddle, squares of the lesser mean and products y1 y2 below these are known better than
# what follows from the energy in double-double arithmetic.
GAP_FROM = 1e-15
PRODUCT_FROM = 3e-8
# Beyond this phase a double does not say where on the orbit the motion is.
LONGEST = 1e16


@routine
def frequency_dd(w: Array) -> tuple[float, float]:
    """Frequency of a libration or rotation as a double-double."""
    a = w[A]
    b = w[B]
    c = w[C]
    ch, cl, sh, sl = dd_cos_sin(w[START])
    eh, el = potential_dd(a, b, c, ch, cl, sh, sl)
    ph, pl = two_product(w[RATE], w[RATE])
    eh, el = dd_add(2.0 * eh, 2.0 * el, ph, pl)  # 2 h
    c2h, c2l = dd_add(eh, el, -2.0 * a, 0.0)
    c1h, c1l = dd_add(eh, el, -a, 0.0)
    c1h, c1l = dd_multiply(c1h, c1l, -a, 0.0)
    ph, pl = two_product(b, b)
    c0h, c0l = dd_multiply(ph, pl, -a, 0.0)
    c1h, c1l = dd_add(c1h, c1l, ph, pl)
    ph, pl = two_product(c, c)
    c1h, c1l = dd_add(c1h, c1l, ph, pl)
    mh, ml = two_sum(w[M] if a >= 0.0 else w[M] + a, w[X0])
    for _ in range(3):
        ph, pl = dd_add(mh, ml, c2h, c2l)
        ph, pl = dd_multiply(ph, pl, mh, ml)
        ph, pl = dd_add(ph, pl, c1h, c1l)
        ph, pl = dd_multiply(ph, pl, mh, ml)
        ph, pl = dd_add(ph, pl, c0h, c0l)
        mh, ml = dd_add(mh, ml, -ph / w[Y_PRODUCT], 0.0)
    # y1 y2 is the slope of the cubic, y1 + y2 = -c2 - 3 mu.
    th, tl = dd_multiply(mh, ml, 3.0, 0.0)
    sh, sl = dd_add(-c2h, -c2l, -th, -tl)
    th, tl = dd_add(th, tl, 2.0 * c2h, 2.0 * c2l)
    th, tl = dd_multiply(th, tl, mh, ml)
    ph, pl = dd_add(th, tl, c1h, c1l)
    gh, gl = dd_sqrt(ph, pl)
    ah, al = dd_add(sh, sl, 2.0 * gh, 2.0 * gl)
    ah, al = dd_sqrt(0.25 * ah, 0.25 * al)
    gh, gl = dd_sqrt(gh, gl)
    for _ in range(12):
        close = abs(ah - gh) <= 1e-8 * ah
        th, tl = dd_add(ah, al, gh, gl)
        ph, pl = dd_multiply(ah, al, gh, gl)
        ah, al = 0.5 * th, 0.5 * tl
        gh, gl = dd_sqrt(ph, pl)
        if close:
            break
    th, tl = dd_add(ah, al, gh, gl)
    return 0.5 * th, 0.5 * tl


@inline
def phase_at(angle: float, rate: float, w: Array) -> float:
    """Phase in [-pi, pi] of a libration or rotation at an angle, passed with this rate."""
    half = 0.5 * (angle - w[SIGMA])
    if w[MODE] == SWING and w[SIGMA_LOW] != 0.0:
        half, _, _ = reduce_angle(angle - w[SIGMA], -w[SIGMA_LOW])
        half *= 0.5
    x = np.float64(math.cos(half))
    y = np.float64(math.sin(half))
    skew = w[SKEW]
    if w[MODE] == TURN:
        near = w[U] * x - y
        reach = skew * (w[U] * x + y)
        far = w[U] * x + y + reach
        less = 2.0 * y + reach
        half = 0.5 * ((angle - w[PHI_S]) - w[PHI_S_LOW])
        c = np.float64(math.cos(half))
        s = np.float64(math.sin(half))
        if abs(s) < 0.05:  # next to the saddle, where the offset from it has more digits
            near = w[REST_R] * c - w[Z_HIGH] * s
            far = w[RATIO] * (w[Z_LOW] * s - w[TAU] * c)
            less = far - near
        square = near * near + far * far
        sine = 2.0 * near * far / square
        cosine = -less * (near + far) / square
        return phase(sine, cosine, MEANS, int(w[LEVELS]), w)
    if x < 0.0:
        x = -x
        y = -y
    # Sines of half the angles to the turning points, but for a common factor: next to the
    # reference from the offset from it, which has more digits there.
    half = 0.5 * ((angle - w[PHI_S]) - w[PHI_S_LOW])
    c = np.float64(math.cos(half))
    s = np.float64(math.sin(half))
    if abs(s) > 0.05:
        high = max(w[U] * x - y, 0.0)
        low = max(w[U] * x + y, 0.0)
        cosine = 2.0 * y - skew * low if skew < 0.5 else w[RATIO] * low - high
        size = w[U] * x + abs(y)
        square = 1.0 + w[U] * w[U]
    else:
        if c < 0.0:  # the angle is a turn away from the reference
            c = -c
            s = -s
        to_high = np.sqrt(1.0 + w[Z_HIGH] * w[Z_HIGH])
        to_low = np.sqrt(1.0 + w[Z_LOW] * w[Z_LOW])
        high = abs(c - w[Z_HIGH] * s) / to_high
        low = abs(c - w[Z_LOW] * s) / to_low
        cosine = w[RATIO] * low - high
        if w[GAP] > 0.0 and skew < 0.5:  # where the reference is amid the orbit that cancels
            tilt = w[Z_APART] * w[TAU] / (to_low * to_high)
            shift = w[Z_LOW] / to_low - w[Z_HIGH] / to_high
            if w[Z_LOW] * w[Z_HIGH] > 0.0:
                shift = -tilt / (w[Z_LOW] * to_high + w[Z_HIGH] * to_low)
            cosine = c * tilt / (to_low + to_high) - s * shift - skew * low
        size = 1.0
        square = 1.0
    # Close to a turning point the rate knows the distance better, through the other factor.
    r = w[REST_R]
    tilt = w[TAU] * s * c
    rest = c * c + tilt + r * s * s
    slack = c * c + abs(tilt) + abs(r) * s * s + abs(w[TAU] * c) + 2.0 * abs(r * s)
    if min(high, low) * slack < 0.25 * abs(rest) * size:
        common = square * rate * rate / (2.0 * abs(w[GAP] * w[SPAN] * rest))
        if high < low:
            high = common / low
        else:
            low = common / high
        cosine = w[RATIO] * low - high
    low *= w[RATIO]
    both = low + high
    sine = 2.0 * np.sqrt(low * high) / both if both > 0.0 else 0.0
    cosine = cosine / both if both > 0.0 else 1.0
    return phase(sine if rate < 0.0 else -sine, cosine, MEANS, int(w[LEVELS]), w)


@inline
def at_phase(high: float, low: float, w: Array) -> tuple[float, float, float]:
    """Whole turns in a phase, and the local angle and the angular velocity at the rest of it."""
    angle, rest, turns = reduce_angle(high, low)
    sine = np.float64(math.sin(angle))
    cosine = np.float64(math.cos(angle))
    sine += rest * cosine
    if sine == 0.0 and angle < 0.0:
        sine = np.float64(-1e-300)  # half a turn back, not ahead
    local, rate = locate(sine, cosine - rest * sine, w)
    return turns, local, rate


@routine
def begin(w: Array) -> None:
    """Prepare the motion through the state of an orbit whose shape is known."""
    mode = w[MODE]
    if mode == SWING or mode == TURN:
        w[PHASE] = phase_at(w[ANGLE], w[RATE], w)
        # The lower turning point is at the phase pi, not at the double next to it.
        w[PHASE_LOW] = 0.5 * TWO_PI_LOW * np.sign(w[PHASE]) if abs(w[PHASE]) == PI else 0.0
        turns, local, _ = at_phase(w[PHASE], w[PHASE_LOW], w)
        back = np.rint((w[ANGLE] - local) / TWO_PI)
        w[BASE] = w[TURNS] + back
        if mode == TURN:
            w[BASE] -= turns
        elif back == -1.0 and w[Z_HIGH] < 0.0:  # it starts at the far end, next to the reference
            w[HIGH] = w[PHI_S] + (w[PHI_S_LOW] - 2.0 * angle_half(1.0, -w[Z_HIGH]))
            w[LOW] -= TWO_PI
            w[SIGMA] -= TWO_PI
            w[BASE] += 1.0
        w[OMEGA_HIGH] = w[MEANS + int(w[LEVELS])]
        w[OMEGA_LOW] = 0.0
        apart = min(w[FIRST], w[SECOND])
        known = apart * apart > GAP_FROM and (abs(w[GAP]) > GAP_FROM or w[SLOPE] > 0.0)
        if known and w[Y_PRODUCT] > PRODUCT_FROM:
            w[OMEGA_HIGH], w[OMEGA_LOW] = frequency_dd(w)
    elif mode == HARMONIC:
        j = int(w[REFERENCE])
        w[PHI_S] = w[PHI + j]
        w[OMEGA_HIGH] = np.sqrt(w[CURVATURE + j])
        w[BASE] = w[TURNS] + np.rint((w[ANGLE] - w[PHI_S]) / TWO_PI)
    elif mode == ASYMPTOTE:
        begin_asymptote(w)


@inline
def begin_asymptote(w: Array) -> None:
    """Coefficients of z = S2/k^2 + rise exp(kt) + fall exp(-kt); k = 0: z and z' at the start."""
    half = 0.5 * (w[ANGLE] - w[PHI_S])
    x = np.float64(math.cos(half))
    y = np.float64(math.sin(half))
    if y < 0.0:
        x = -x
        y = -y
    w[BASE] = w[TURNS] + np.rint((w[ANGLE] - w[PHI_S] - 2.0 * math.atan2(y, x)) / TWO_PI)
    z = x / y
    rate = -0.5 * w[RATE] / (y * y)
    k2 = -w[SLOPE]
    if not y > 1e-150:
        w[MODE] = REST
    elif k2 > 0.0:
        k = np.sqrt(k2)
        middle = z - w[S2] / k2
        rise = 0.5 * (middle + rate / k)
        fall = 0.5 * (middle - rate / k)
        # Their product is known exactly: what is small comes from what is large.
        product = 0.25 * w[M] * w[N] / (k2 * k2)
        if abs(rise) > abs(fall):
            fall = product / rise
        else:
            rise = product / fall if fall != 0.0 else 0.0
        w[RISE] = rise
        w[FALL] = fall
    else:
        w[RISE] = z
        w[FALL] = rate


@inline
def after(t: float, w: Array) -> tuple[float, float]:
    """Angle and angular velocity at the time t."""
    mode = w[MODE]
    unit = w[UNIT]
    if mode == INVALID or not abs(t) < math.inf:
        return math.nan, math.nan
    if mode == REST:
        return w[START], 0.0
    if mode == FREE:
        return w[START] + w[RATE] / unit * t, w[RATE] / unit
    time = t / unit
    if mode == HARMONIC:
        omega = w[OMEGA_HIGH]
        x = (w[ANGLE] - w[PHI_S]) - (w[BASE] - w[TURNS]) * TWO_PI
        v = w[RATE]
        angle, _, _ = reduce_angle(omega * time, 0.0)
        sine = math.sin(angle)
        cosine = math.cos(angle)
        x, v = x * cosine + v / omega * sine, v * cosine - x * omega * sine
        return (w[PHI_S] + x) + w[BASE] * TWO_PI, v / unit
    if mode == ASYMPTOTE:
        return approach(time, w)
    # The phase, reduced with all its digits.
    sense = w[DIRECTION] if mode == TURN else 1.0
    high = sense * w[OMEGA_HIGH] * time
    low = 0.0
    if abs(high) < LONGEST:
        high, low = two_product(w[OMEGA_HIGH], sense * time)
        low += w[OMEGA_LOW] * (sense * time)
        high, low = dd_add(high, low, w[PHASE], w[PHASE_LOW])
    turns, local, rate = at_phase(high, low, w)
    if mode == SWING:
        return local + w[BASE] * TWO_PI, rate / unit + 0.0  # not -0
    turns += w[BASE]
    return (local + turns * TWO_PI_LOW) + turns * TWO_PI, sense * rate / unit


@inline
def approach(time: float, w: Array) -> tuple[float, float]:
    """Angle and angular velocity on a separatrix."""
    k2 = -w[SLOPE]
    if k2 > 0.0:
        k = np.sqrt(k2)
        power = min(max(k * time, -700.0), 700.0)
        rise = w[RISE] * math.exp(power)
        fall = w[FALL] * math.exp(-power)
        z = w[S2] / k2 + rise + fall
        slope = k * (rise - fall)
    else:
        z = w[RISE] + (w[FALL] - 0.5 * w[S2] * time) * time
        slope = w[FALL] - w[S2] * time
    # 2 arccot(z), and its derivative without overflow.
    rate = -2.0 * slope / (1.0 + z * z) if abs(z) < 1e150 else 0.0
    angle = w[PHI_S] + 2.0 * math.atan2(1.0, z)
    return angle + w[BASE] * TWO_PI, rate / w[UNIT] + 0.0  # not -0


@routine
def begin_separatrix(j: int, right: bool, w: Array) -> None:
    """Prepare the motion that leaves saddle j on one side, with t = 0 at its middle.

    That is the turning point of a lobe, the offset pi of a winding loop, and half of the way to
    the partner of a heteroclinic arc.
    """
    w[MODE] = ASYMPTOTE
    w[REFERENCE] = j
    refer(w)
    w[START] = w[PHI_S]
    w[BASE] = 0.0 if right else -1.0
    sign = 1.0 if right else -1.0
    k2 = -w[SLOPE]
    d = w[M] * w[N]
    if k2 == 0.0:  # a cusp: z falls at a constant rate
        w[RISE] = 0.0
        w[FALL] = -sign * np.sqrt(max(-w[P], 0.0))
        return
    middle = w[S2] / k2
    if d > 0.0:
        w[RISE] = 0.5 * sign * np.sqrt(d) / k2
        w[FALL] = w[RISE]
    elif d < 0.0:
        # z = middle - c sinh(k (t + t0)) vanishes at t = 0; exp(k t0) from sinh(k t0).
        c = np.sqrt(-d) / k2
        sinh = sign * middle / c
        grow = abs(sinh) + np.sqrt(sinh * sinh + 1.0)
        grow = grow if sinh >= 0.0 else 1.0 / grow
        w[RISE] = -0.5 * sign * c * grow
        w[FALL] = 0.5 * sign * c / grow
    else:
        # z = middle + c exp(-k t), with the partner at z = middle.
        whole = math.atan2(1.0, middle) if right else math.atan2(1.0, middle) - 0.5 * TWO_PI
        half = 0.5 * whole
        w[RISE] = 0.0
        w[FALL] = math.cos(half) / math.sin(half) - middle
