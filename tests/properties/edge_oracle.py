"""Periods, turning points and actions next to degenerate and level equilibria, by mpmath.

All from the energy of the very doubles, in as many digits as it takes: the period from the roots of
the Weierstrass cubic, by Cardano's formula and the arithmetic-geometric mean; the turning points
from Newton's method on V = h; the action as the integral of the speed.
"""

from __future__ import annotations

from collections.abc import Sequence

from mpmath import mp, mpc, mpf

Reals = Sequence[float]


def potential(A, B, C, phi):
    cos, sin = mp.cos_sin(phi)
    return (A / 2 * cos - B) * cos - C * sin


def energy(state: Reals) -> mpf:
    A, B, C, phi, v = map(mpf, state)
    return v * v / 2 + potential(A, B, C, phi)


def roots(g2: mpf, g3: mpf) -> tuple:
    """Roots of 4 e^3 - g2 e - g3; the first is real, a complex pair comes last."""
    p, q = -g2 / 4, -g3 / 4
    inside = (q / 2) ** 2 + (p / 3) ** 3
    if inside > 0:
        u = mp.cbrt(abs(q) / 2 + mp.sqrt(inside))
        u = -u if q > 0 else u
        real, imag = u - p / (3 * u), mp.sqrt(3) / 2 * (u + p / (3 * u))
        return real, mpc(-real / 2, imag), mpc(-real / 2, -imag)
    r = mp.sqrt(-p / 3)
    third = mp.acos(max(min(-q / 2 / r**3, mpf(1)), mpf(-1))) / 3
    angles = (third - 2 * mp.pi * k / 3 for k in range(3))
    return tuple(sorted((2 * r * mp.cos(angle) for angle in angles), reverse=True))


def period(state: Reals, dps: int) -> mpf:
    with mp.workdps(dps):
        A, B, C, *_ = map(mpf, state)
        h = energy(state)
        c = (A / 4 - h) / 3
        g2 = A * A / 16 - (B * B + C * C) / 4 + 3 * c * c
        g3 = c * (A * A + 2 * B * B + 2 * C * C) / 16 - A * (B * B - C * C) / 32 - c**3
        e1, e2, e3 = roots(g2, g3)
        if isinstance(e2, mpc):
            first = mp.sqrt(e1 - e2)
            return mp.pi / mp.agm(abs(first.real), abs(first))
        return mp.pi / mp.agm(mp.sqrt(e1 - e2), mp.sqrt(e1 - e3))


def turning_point(state: Reals, near: float, dps: int) -> mpf:
    """The zero of h - V next to a double that almost is one."""
    with mp.workdps(dps):
        A, B, C, *_ = map(mpf, state)
        h, x = energy(state), mpf(float(near))
        for _ in range(100):
            cos, sin = mp.cos_sin(x)
            step = (potential(A, B, C, x) - h) / (B * sin - A * sin * cos - C * cos)
            x -= step
            if abs(step) <= mpf(10) ** -30 * abs(x):
                return x
        message = f"no turning point next to {near}"
        raise ArithmeticError(message)
