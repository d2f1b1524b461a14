"""What a user would write today for the motion, the periods and the actions, one function each.

The system is phi'' = -V'(phi) with V = -B cos(phi) + (A/2) cos(phi)^2 - C sin(phi). The period of a
rotation is that of one turn; the action is J = (1/2 pi) times the integral of phi'^2 over a period.
heyoka is imported only by the functions that need it.
"""

from __future__ import annotations

from collections.abc import Callable
from math import cos, pi, sin
from typing import Any

import mpmath as mp
import numpy as np
from scipy.integrate import solve_ivp
from scipy.optimize import brentq
from scipy.special import ellipj, elliprd, elliprf, elliprj

Array = np.ndarray
Orbit = tuple[float, float, float, float, float]
Periods = tuple[Array, Array | None]

FAR = 1e6
"""A time that no period of the benchmarks reaches."""


def potential(a: Any, b: Any, c: Any, phi: Any) -> Any:
    return (0.5 * a * np.cos(phi) - b) * np.cos(phi) - c * np.sin(phi)


def slope(a: Any, b: Any, c: Any, phi: Any) -> Any:
    return (b - a * np.cos(phi)) * np.sin(phi) - c * np.cos(phi)


def curvature(a: Any, b: Any, c: Any, phi: Any) -> Any:
    return b * np.cos(phi) - a * np.cos(2.0 * phi) + c * np.sin(phi)


# Fifty digits -----------------------------------------------------------------


def exact_period(orbit: Orbit) -> mp.mpf:
    """Period in mpmath's precision, from the cubic resolvent and R_F."""
    a, b, c, phi, dphi = (mp.mpf(float(value)) for value in orbit)
    v = -b * mp.cos(phi) + a * mp.cos(phi) ** 2 / 2 - c * mp.sin(phi)
    s = (a / 4 - dphi**2 / 2 - v) / 3
    g2 = a**2 / 16 - (b**2 + c**2) / 4 + 3 * s**2
    g3 = s * (a**2 + 2 * (b**2 + c**2)) / 16 - a * (b**2 - c**2) / 32 - s**3
    roots = mp.polyroots([4, 0, -g2, -g3], maxsteps=400, extraprec=4 * mp.mp.prec)
    roots.sort(key=lambda root: (mp.im(root) != 0, -mp.re(root)))
    e1 = mp.re(roots[0])
    return 2 * mp.re(mp.elliprf(0, e1 - roots[1], e1 - roots[2]))


def _taylor(a: mp.mpf, b: mp.mpf, c: mp.mpf, phi: mp.mpf, dphi: mp.mpf, order: int) -> list[mp.mpf]:
    """Taylor coefficients of phi(t)."""
    x, sin, cos = [phi, dphi], [mp.sin(phi)], [mp.cos(phi)]
    for n in range(order - 1):
        push = [a * value for value in cos]
        push[0] -= b
        force = mp.fdot(sin, reversed(push)) + c * cos[n]
        x.append(force / ((n + 1) * (n + 2)))
        rates = [(j + 1) * x[j + 1] for j in range(n + 1)]
        grown = mp.fdot(rates, reversed(cos)) / (n + 1)
        cos.append(-mp.fdot(rates, reversed(sin)) / (n + 1))
        sin.append(grown)
    return x


def exact_motion(orbit: Orbit, t: Array, digits: int = 50) -> Array:
    """The angle of a libration at the times given, rounded from a Taylor series of 50 digits.

    The times, taken as exact numbers, are reduced modulo the period; one period is then covered by
    steps of order 60, and every time is read off the polynomial of its step.
    """
    with mp.workdps(digits + 15):
        a, b, c, phi, dphi = (mp.mpf(float(value)) for value in orbit)
        period = exact_period(orbit)
        rest = [mp.fmod(mp.mpf(float(value)), period) for value in t]
        queue = sorted(range(len(rest)), key=lambda j: rest[j])
        angles = np.empty(len(rest))
        now, order, done = mp.mpf(0), 60, 0
        while done < len(queue):
            x = _taylor(a, b, c, phi, dphi, order)
            radius = min(mp.root(1 / abs(x[n]), n) for n in (order - 1, order) if x[n])
            step = radius * mp.mpf(10) ** (-mp.mpf(digits + 3) / order)
            series = x[::-1]
            while done < len(queue) and rest[queue[done]] <= now + step:
                angles[queue[done]] = float(mp.polyval(series, rest[queue[done]] - now))
                done += 1
            phi, dphi = mp.polyval(series, step, derivative=True)
            now += step
        return angles


# One orbit --------------------------------------------------------------------


def motion_by_dop853(orbit: Orbit, t: Array) -> Array:
    """SciPy's solve_ivp with DOP853, at the tightest relative tolerance that it accepts."""
    a, b, c, phi, dphi = orbit

    def rhs(_: float, y: Array) -> tuple[float, float]:
        s, k = sin(y[0]), cos(y[0])
        return y[1], (a * k - b) * s + c * k

    done = solve_ivp(
        rhs, (0.0, t[-1]), (phi, dphi), method="DOP853", t_eval=t, rtol=2.3e-14, atol=1e-16
    )
    return done.y[0]


def heyoka_motion(orbit: Orbit) -> Callable[[Array], Array]:
    """The scalar Taylor integrator of heyoka, default tolerance, compiled: times -> angles."""
    import heyoka as hy

    a, b, c, phi, dphi = orbit
    x, v = hy.make_vars("x", "v")
    force = (a * hy.cos(x) - b) * hy.sin(x) + c * hy.cos(x)
    integrator = hy.taylor_adaptive([(x, v), (v, force)], [phi, dphi])

    def run(t: Array) -> Array:
        integrator.time = 0.0
        integrator.state[:] = phi, dphi
        return integrator.propagate_grid(t)[-1][1:, 0]

    return lambda t: run(np.concatenate(([0.0], t)))


def motion_by_ellipj(orbit: Orbit, t: Array) -> Array:
    """A libration in closed form, in plain double: Weierstrass' function by SciPy's ellipj.

    From a turning point p, tan((phi - p)/2) = -(V'(p)/4) / (wp(t) + V''(p)/12).
    """
    a, b, c, phi0, dphi0 = orbit
    h = potential(a, b, c, phi0) + 0.5 * dphi0 * dphi0
    side = 1.0 if dphi0 >= 0.0 else -1.0
    ahead = phi0 + side * np.linspace(0.0, 2.0 * np.pi, 1001)
    stop = int(np.argmax(potential(a, b, c, ahead) > h))
    turn = brentq(lambda phi: potential(a, b, c, phi) - h, ahead[stop - 1], ahead[stop], xtol=1e-15)
    v1, v2 = slope(a, b, c, turn), curvature(a, b, c, turn)
    e1, e2, e3 = cubic_roots(*(np.array(value) for value in (a, b, c, h)))
    start = -v2 / 12.0 - 0.25 * v1 / np.tan(0.5 * (phi0 - turn))
    until = elliprf(start - e1, start - e2, start - e3).real
    if abs(e2.imag) > 0.0:
        scale = np.sqrt(np.sqrt(abs((e1 - e2) * (e1 - e3))))
        m = 0.5 - 0.75 * e1 / scale**2
        cn = ellipj(2.0 * scale * (t - until), m)[1]
        wp = e1 + scale**2 * (1.0 + cn) / (1.0 - cn)
    else:
        sn = ellipj(np.sqrt(e1 - e3.real) * (t - until), ((e2 - e3) / (e1 - e3)).real)[0]
        wp = e3.real + (e1 - e3.real) / (sn * sn)
    return turn - 2.0 * np.arctan2(0.25 * v1, wp + v2 / 12.0)


# Many orbits ------------------------------------------------------------------


def invariants(a: Array, b: Array, c: Array, h: Array) -> tuple[Array, Array]:
    """The invariants g2 and g3 of the curve that an orbit of energy h follows."""
    s = (0.25 * a - h) / 3.0
    g2 = a * a / 16.0 - 0.25 * (b * b + c * c) + 3.0 * s * s
    g3 = s * (a * a + 2.0 * (b * b + c * c)) / 16.0 - a * (b * b - c * c) / 32.0 - s**3
    return g2, g3


def cubic_roots(a: Array, b: Array, c: Array, h: Array) -> tuple[Array, Array, Array]:
    """Roots of 4 e^3 - g2 e - g3: the largest real one, then two that are real or a pair."""
    g2, g3 = invariants(a, b, c, h)
    inner = g3 * g3 / 64.0 - g2**3 / 1728.0
    real = inner <= 0.0
    size = np.sqrt(np.where(real, g2, 0.0) / 3.0)
    ratio = np.divide(g3, size**3, out=np.ones_like(g3), where=size > 0.0)
    third = np.arccos(np.clip(ratio, -1.0, 1.0)) / 3.0
    u = np.cbrt(g3 / 8.0 + np.copysign(np.sqrt(np.where(real, 0.0, inner)), g3))
    v = np.divide(g2, 12.0 * u, out=np.zeros_like(g2), where=u != 0.0)
    e1 = np.where(real, size * np.cos(third), u + v)
    pair = -0.5 * (u + v) + 1j * (np.sqrt(0.75) * (u - v))
    e2 = np.where(real, size * np.cos(third - 2.0 * np.pi / 3.0), pair)
    e3 = np.where(real, size * np.cos(third + 2.0 * np.pi / 3.0), pair.conj())
    return e1, e2, e3


def periods_by_elliprf(a: Array, b: Array, c: Array, phi0: Array, dphi0: Array) -> Periods:
    """Periods alone, of librations and rotations, in plain double: vectorized cubic, then R_F."""
    h = potential(a, b, c, phi0) + 0.5 * dphi0 * dphi0
    e1, e2, e3 = cubic_roots(a, b, c, h)
    return 2.0 * elliprf(0.0, e1 - e2, e1 - e3).real, None


def actions_by_elliprj(a: Array, b: Array, c: Array, phi0: Array, dphi0: Array) -> Periods:
    """Periods and actions of orbits that start at rest, in plain double: R_F, R_D and R_J.

    The integral of V over a period follows from those of exp(i phi) and exp(2 i phi), rational in
    Weierstrass' function of the time from a turning point. The initial velocity is taken as zero.
    """
    w = b - 1j * c
    h = potential(a, b, c, phi0)
    v1, v2 = slope(a, b, c, phi0), curvature(a, b, c, phi0)
    e1, e2, e3 = cubic_roots(a, b, c, h)
    g2, _ = invariants(a, b, c, h)
    period = 2.0 * elliprf(0.0, e1 - e2, e1 - e3).real
    pole = -(v2 / 3.0 + 1j * v1) / 4.0
    n1 = elliprj(0.0, e1 - e2, e1 - e3, e1 - pole) / 6.0
    two_eta = -e3 * period - (2.0 / 3.0) * (e1 - e3) * (e2 - e3) * elliprd(0.0, e1 - e2, e1 - e3)
    turn = np.exp(1j * phi0)
    once = period - 2j * v1 * n1
    twice = period - 4j * v1 * n1
    rest = 2.0 * (two_eta + pole * period) + (6.0 * pole * pole - 0.5 * g2) * 4.0 * n1
    mean = -w * turn * once + 0.25 * a * (period + turn * turn * twice) - rest
    return period, (h * period - mean.real) / np.pi


def _facing_right(c: Array, phi0: Array, dphi0: Array) -> tuple[Array, Array, Array]:
    """The same orbits, those that start leftward being mirrored in phi = 0."""
    side = np.where(dphi0 < 0.0, -1.0, 1.0)
    return side * c, side * phi0, side * dphi0


def periods_by_dop853(
    a: Array, b: Array, c: Array, phi0: Array, dphi0: Array, *, rest: bool
) -> Periods:
    """solve_ivp with DOP853 and terminal events, the action as a third variable; orbit by orbit.

    With ``rest``, the orbits start at rest and are followed to the next turn, half a period;
    otherwise until they pass their initial angle, or that angle one turn on, the same way again.
    """
    found = np.full((2, a.size), np.nan)
    c, phi0, dphi0 = _facing_right(c, phi0, dphi0)
    for n in range(a.size):
        found[:, n] = _period_by_dop853(*(float(x[n]) for x in (a, b, c, phi0, dphi0)), rest)
    return found[0], found[1]


def _period_by_dop853(
    a: float, b: float, c: float, phi0: float, dphi0: float, rest: bool
) -> tuple[float, float]:
    def rhs(_: float, y: Array) -> tuple[float, float, float]:
        s, k = sin(y[0]), cos(y[0])
        return y[1], (a * k - b) * s + c * k, y[1] * y[1] / (2.0 * pi)

    def turn(t: float, y: Array) -> float:
        return y[1] if t > 0.0 else -slope(a, b, c, phi0)

    def back(t: float, y: Array) -> float:
        return y[0] - phi0 if t > 0.0 else 1.0

    def around(t: float, y: Array) -> float:
        return y[0] - phi0 - 2.0 * pi

    for event in (turn, back, around):
        event.terminal = True  # type: ignore[attr-defined]
        event.direction = 0.0 if event is turn else 1.0  # type: ignore[attr-defined]
    events = [turn] if rest else [back, around]
    start = (phi0, dphi0, 0.0)
    done = solve_ivp(
        rhs, (0.0, FAR), start, method="DOP853", events=events, rtol=2.3e-14, atol=1e-16
    )
    share = 2.0 if rest else 1.0
    return share * done.t[-1], share * done.y[2, -1]


def heyoka_periods(*, rest: bool) -> Callable[[Array, Array, Array, Array, Array], Periods]:
    """The batch integrator of heyoka, default tolerance, compiled: orbits -> periods, actions.

    As many orbits as the SIMD registers hold go side by side, the action as a third variable. A
    terminal event ends an orbit; its callback stores the result and puts the next orbit in the same
    lane, so that no lane waits. Sections as in ``periods_by_dop853``.
    """
    import heyoka as hy

    lanes = hy.recommended_simd_size()
    x, v, action = hy.make_vars("x", "v", "action")
    force = (hy.par[0] * hy.cos(x) - hy.par[1]) * hy.sin(x) + hy.par[2] * hy.cos(x)
    motion = [(x, v), (v, force), (action, v * v / (2.0 * pi))]
    share = 2.0 if rest else 1.0
    orbits = np.empty((5, 0))
    found = np.empty((2, 0))
    lane_of = np.full(lanes, -1)
    since = np.zeros((2, lanes))
    queue = {"next": 0, "done": 0}

    def load(lane: int) -> None:
        n = queue["next"]
        if n == orbits.shape[1]:
            lane_of[lane] = -1
            return
        queue["next"] = n + 1
        lane_of[lane] = n
        pars[:, lane] = orbits[: len(pars), n]
        state[:, lane] = orbits[3, n], orbits[4, n], 0.0

    def arrived(integrator: Any, sign: int, lane: int) -> bool:
        n = lane_of[lane]
        if n < 0:
            return True
        high, low = (part[lane] for part in integrator.dtime)
        elapsed = (high - since[0, lane]) + (low - since[1, lane])
        if elapsed < 1e-7:  # The start of the orbit is on its section as well.
            return True
        found[:, n] = share * elapsed, share * state[2, lane]
        since[:, lane] = high, low
        load(lane)
        queue["done"] += 1
        return queue["done"] < orbits.shape[1]

    def event(section: Any, direction: Any) -> Any:
        return hy.t_event_batch(section, callback=arrived, direction=direction)

    either, up = hy.event_direction.any, hy.event_direction.positive
    back = x - hy.par[3]
    integrator = hy.taylor_adaptive_batch(
        motion,
        np.zeros((3, lanes)),
        t_events=[event(v, either)] if rest else [event(back, up), event(back - 2.0 * pi, up)],
    )
    pars, state = integrator.pars, integrator.state

    def run(a: Array, b: Array, c: Array, phi0: Array, dphi0: Array) -> Periods:
        nonlocal orbits, found
        c, phi0, dphi0 = _facing_right(c, phi0, dphi0)
        orbits = np.stack((a, b, c, phi0, dphi0))
        found = np.full((2, a.size), np.nan)
        queue.update(next=0, done=0)
        since[:] = 0.0
        integrator.set_time(0.0)
        integrator.reset_cooldowns()
        for lane in range(lanes):
            load(lane)
        integrator.propagate_until(FAR)
        return found[0], found[1]

    return run
