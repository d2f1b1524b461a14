"""Reference values for orbits and motions, by ways that the kernels do not take.

Orbits: the equilibria split the circle into pieces on which V is monotone, turning points are
bracketed there, and period and action come from adaptive quadrature, where h - V is divided
exactly by its two zeros at the turning points. Motions: Taylor series with adaptive steps. No
elliptic function takes part.

Coefficients and initial values are taken as exact. Results are mpmath numbers rounded to dps
digits; as in oracle, whose import raises mpmath's precision, a test computes on with more.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import lru_cache
from typing import Any, Literal, NamedTuple

from mpmath import mp, mpf
from mpmath.calculus.quadrature import GaussLegendre
from witnesses.oracle import gradient, potential, sign

Pair = tuple[mpf, mpf]


class Orbit(NamedTuple):
    """One orbit; lo and hi are its turning angles, unwrapped round phi0, or None."""

    kind: Literal["libration", "rotation"]
    energy: mpf
    period: mpf
    action: mpf
    lo: mpf | None
    hi: mpf | None


# --- roots -----------------------------------------------------------------------------------


def root(f: Callable[[mpf], mpf], slope: Callable[[mpf], mpf], x0: mpf, x1: mpf) -> mpf:
    """Return the root of f between x0 and x1, where its signs differ (Newton with a bracket)."""
    f0, f1 = f(x0), f(x1)
    if f0 == 0 or f1 == 0:
        return x0 if f0 == 0 else x1
    if sign(f0) == sign(f1):
        message = f"no change of sign between {x0} and {x1}"
        raise ArithmeticError(message)
    least = mp.eps * max(abs(x0), abs(x1))
    x, last = (x0 + x1) / 2, abs(x1 - x0)
    while True:
        fx, down = f(x), slope(x)
        if fx == 0:
            return x
        if sign(fx) == sign(f0):
            x0 = x
        else:
            x1 = x
        # Bisect where Newton leaves the bracket or does not halve its step.
        new = x - fx / down if down != 0 else x0
        if not (min(x0, x1) < new < max(x0, x1) and 2 * abs(new - x) < last):
            new = (x0 + x1) / 2
        step, x = abs(new - x), new
        last = step
        if step <= least or abs(x1 - x0) <= least:
            return x


def polynomial_roots(p: Sequence[mpf], x0: mpf, x1: mpf) -> list[mpf]:
    """Return the roots of p, highest degree first, in [x0, x1] where its sign changes."""
    if len(p) < 2:
        return []
    slope = [c * (len(p) - 1 - i) for i, c in enumerate(p[:-1])]
    nodes = [x0, *polynomial_roots(slope, x0, x1), x1]  # p is monotone between them
    signs = [sign(mp.polyval(p, x)) for x in nodes]
    out = [x for x, s in zip(nodes, signs, strict=True) if s == 0]
    for i in range(len(nodes) - 1):
        if signs[i] * signs[i + 1] < 0:
            out.append(
                root(
                    lambda x: mp.polyval(p, x),
                    lambda x: mp.polyval(slope, x),
                    nodes[i],
                    nodes[i + 1],
                )
            )
    return sorted(set(out))


def extrema(A: mpf, B: mpf, C: mpf) -> list[mpf]:
    """Return the angles of the extrema of V; inflections may be among them."""
    sizes = [abs(x) for x in (A, B, C) if x != 0]
    if not sizes:
        return []
    # A small coefficient must not drown where the large ones cancel.
    with mp.workdps(mp.dps + int(mp.log10(max(sizes) / min(sizes)))):
        # V' (1 + t^2)^2 with t = tan(phi/2); with 1/t the coefficients stand in reverse
        quartic = [C, 2 * (B + A), mpf(0), 2 * (B - A), -C]
        near = polynomial_roots(quartic, mpf(-1), mpf(1))
        far = polynomial_roots(quartic[::-1], mpf(-1), mpf(1))
        return [2 * mp.atan(t) for t in near] + [mp.pi - 2 * mp.atan(u) for u in far if abs(u) != 1]


# --- quadrature ------------------------------------------------------------------------------


@lru_cache
def gauss(degree: int, prec: int) -> list[Pair]:
    """Return nodes and weights of the Gauss-Legendre rule with 3 2^(degree - 1) nodes."""
    return [(mpf(x), mpf(w)) for x, w in GaussLegendre(mp).calc_nodes(degree, prec)]


def integrals(f: Callable[[mpf], Pair], nodes: Sequence[mpf], dps: int, degree: int = 4) -> Pair:
    """Return the integrals of two positive functions over consecutive intervals.

    An interval is halved until the sum over its halves agrees with it to dps digits of the whole;
    the sum over the halves is what counts.
    """
    rule = gauss(degree, mp.prec)

    def over(x0: mpf, x1: mpf) -> Pair:
        """Return the integrals over one interval by one rule."""
        middle, half = (x0 + x1) / 2, (x1 - x0) / 2
        values = [(weight, f(middle + half * x)) for x, weight in rule]
        first, second = (mp.fdot((weight, y[i]) for weight, y in values) for i in (0, 1))
        return half * first, half * second

    work = [(x0, x1, over(x0, x1)) for x0, x1 in zip(nodes, nodes[1:], strict=False) if x0 < x1]
    bounds = [mpf(10) ** -dps * sum(rough[i] for _, _, rough in work) for i in (0, 1)]
    least = (nodes[-1] - nodes[0]) * mpf(10) ** -mp.dps
    total = [mpf(0), mpf(0)]
    while work:
        x0, x1, rough = work.pop()
        middle = (x0 + x1) / 2
        left, right = over(x0, middle), over(middle, x1)
        fine = [left[i] + right[i] for i in (0, 1)]
        if all(abs(fine[i] - rough[i]) <= bounds[i] for i in (0, 1)):
            total = [total[i] + fine[i] for i in (0, 1)]
        elif x1 - x0 < least:
            message = f"quadrature failed at {x0}"
            raise ArithmeticError(message)
        else:
            work += [(x0, middle, left), (middle, x1, right)]
    return total[0], total[1]


# --- orbits ----------------------------------------------------------------------------------


def orbit(A: Any, B: Any, C: Any, phi0: Any, v0: Any, *, dps: int = 30) -> Orbit:
    """Return the orbit of phi'' = -V'(phi) through (phi0, v0).

    The action is the area of the orbit over 2 pi; for a rotation, both period and area are those
    of one turn. Energies closer than 10^(-3 dps / 2) to that of an equilibrium on the way, relative
    to the coefficients, are refused: there are equilibria and separatrices.
    """
    with mp.workdps(3 * dps + 10):
        A, B, C, phi0, v0 = (mpf(x) for x in (A, B, C, phi0, v0))
        result = traced(A, B, C, phi0, v0, dps)
    with mp.workdps(dps):
        return Orbit(result.kind, *(x if x is None else +x for x in result[1:]))


def traced(A: mpf, B: mpf, C: mpf, phi0: mpf, v0: mpf, dps: int) -> Orbit:
    """Return the orbit at the precision in force, with integrals to dps digits."""
    energy = v0**2 / 2 + potential(A, B, C, phi0)
    scale = max(abs(A) + abs(B) + abs(C), v0**2 / 2)
    small = scale * mpf(10) ** (-3 * dps // 2)
    turn = 2 * mp.pi

    def kinetic(x: mpf) -> mpf:
        """Return the kinetic energy at an angle from phi0."""
        return energy - potential(A, B, C, phi0 + x)

    def slope(x: mpf) -> mpf:
        """Return its derivative."""
        return -gradient(A, B, C, phi0 + x)

    offsets = sorted((phi - phi0) % turn for phi in extrema(A, B, C))
    turning = []
    inner = {mpf(0)}
    for way in ([x - turn for x in reversed(offsets)], offsets):  # to the left, to the right
        last = mpf(0)
        for x in way:
            above = kinetic(x)
            if abs(above) <= small:
                message = f"an equilibrium or a separatrix at the energy {mp.nstr(energy, 17)}"
                raise ValueError(message)
            if above < 0:
                turning.append(root(kinetic, slope, last, x))
                break
            inner.add(x)
            last = x
    if not turning:
        if scale == 0:
            message = "no motion"
            raise ValueError(message)

        def turned(x: mpf) -> Pair:
            """Return integrands of period and action of a rotation."""
            speed = mp.sqrt(2 * kinetic(x))
            return 1 / speed, speed

        start = offsets[0] if offsets else mpf(0)
        period, area = integrals(turned, [*offsets, start + turn] if offsets else [0, turn], dps)
        return Orbit("rotation", energy, period, area / turn, None, None)

    # With theta from the middle, h - V = (cos theta - cos w) Q and Q = p + q cos theta +
    # r sin theta, which is positive; two of the five coefficients are left to check.
    middle, w = sum(turning) / 2, (turning[1] - turning[0]) / 2
    cos, sin = mp.cos_sin(phi0 + middle)
    cosw = mp.cos(w)
    q, r = A / 2 * (sin**2 - cos**2), A * sin * cos
    p = B * cos + C * sin + q * cosw
    if max(abs(C * cos - B * sin + r * cosw), abs(energy - A / 4 - q / 2 + p * cosw)) > small:
        message = f"wrong turning points {turning} from {phi0}"
        raise ArithmeticError(message)
    # With sin(theta/2) = k sin tau, k = sin(w/2), the first factor is 2 k^2 cos^2 tau.
    cosk, k = mp.cos_sin(w / 2)

    def swung(tau: mpf) -> Pair:
        """Return integrands of period and action of a libration."""
        c, s = mp.cos_sin(tau)
        c, s = c * c, k * s
        half = mp.sqrt(cosk**2 + k**2 * c)  # cos(theta/2)
        rest = mp.sqrt(p + q * (1 - 2 * s * s) + 2 * r * s * half)
        return 2 / (half * rest), c * rest / half

    nodes = [mp.asin(mp.sin((x - middle) / 2) / k) for x in sorted(inner)]
    period, area = integrals(swung, [-mp.pi / 2, *nodes, mp.pi / 2], dps)
    lo, hi = phi0 + turning[0], phi0 + turning[1]
    return Orbit("libration", energy, period, 4 * k**2 * area / mp.pi, lo, hi)


# --- motions ---------------------------------------------------------------------------------


def series(A: mpf, B: mpf, C: mpf, phi: mpf, v: mpf, order: int) -> list[mpf]:
    """Return the Taylor coefficients of the motion from (phi, v)."""
    out = [phi, v]
    rates = [v]  # j phi_j from j = 1
    cos, sin = ([x] for x in mp.cos_sin(phi))
    for n in range(order - 1):
        product = mp.fdot(sin, reversed(cos))  # of sin phi cos phi
        out.append((A * product - B * sin[n] + C * cos[n]) / ((n + 1) * (n + 2)))
        # sin' = phi' cos, cos' = -phi' sin
        up, down = mp.fdot(rates, reversed(cos)), mp.fdot(rates, reversed(sin))
        sin.append(up / (n + 1))
        cos.append(-down / (n + 1))
        rates.append((n + 2) * out[-1])
    return out


def flow_at(
    A: Any, B: Any, C: Any, phi0: Any, v0: Any, times: Sequence[Any], *, dps: int = 30
) -> list[Pair]:
    """Return (phi, phi') at increasing times, of either sign; the motion starts at time 0."""
    order = 13 * dps // 10 + 2
    found = []
    with mp.workdps(dps + 20):
        A, B, C, phi0, v0 = (mpf(x) for x in (A, B, C, phi0, v0))
        exact = [mpf(t) for t in times]
        if any(t1 < t0 for t0, t1 in zip(exact, exact[1:], strict=False)):
            message = "times do not increase"
            raise ValueError(message)
        bound = mpf(10) ** (-dps - 10)
        for way in ([t for t in reversed(exact) if t < 0], [t for t in exact if t >= 0]):
            phi, v, start, reach = phi0, v0, mpf(0), mpf(-1)
            states = []
            taylor: list[mpf] = []
            for t in way:
                while abs(t - start) > reach:
                    if taylor:
                        step = reach * sign(t)
                        phi, v = mp.polyval(taylor[::-1], step, derivative=True)
                        start += step
                    taylor = series(A, B, C, phi, v, order)
                    # The last two terms stay below the bound, also those of the speed.
                    tails = [(n, n * abs(taylor[n])) for n in (order - 1, order)]
                    steps = [mp.root(bound / tail, n) for n, tail in tails if tail > 0]
                    reach = min(steps, default=mp.inf)
                states.append(mp.polyval(taylor[::-1], t - start, derivative=True))
            found += states if not way or way[0] >= 0 else states[::-1]
    with mp.workdps(dps):
        return [(+phi, +v) for phi, v in found]


def flow(A: Any, B: Any, C: Any, phi0: Any, v0: Any, t: Any, *, dps: int = 30) -> Pair:
    """Return (phi, phi') at the time t, phi unwrapped from phi0."""
    return flow_at(A, B, C, phi0, v0, [t], dps=dps)[0]
