"""The disk on a free support from Lagrange's equations in four states, under torques on its shaft.

Written in the moments of inertia of the equations of motion, and integrated by SciPy, or by a
Runge-Kutta method of order four for many motions; nothing is shared with the reduction to one
degree of freedom.
"""

import math

import numba
import numpy as np
from scipy.integrate import solve_ivp


def constants(rotor):
    """J, eps J, m, a, s, cos(beta), e, g, Jc of a machine."""
    d = rotor.disk
    s, c = np.sin(d.beta), np.cos(d.beta)
    J = d.m * d.r**2 / 4
    return np.array([J, J + d.m * d.e**2, d.m, d.a, s, c, d.e, d.g, rotor.carrier_inertia])


@numba.njit
def rates(const, phi, omega, dphi, torque2):
    """Accelerations of support and disk, by Cramer's rule."""
    J, eps, m, a, s, cb, e, g, Jc = const
    sine, cosine = math.sin(phi), math.cos(phi)
    inertia = J + eps * s * s
    mixed = eps * s * cb * cosine
    support = Jc + m * a * a + eps + (J - eps * s * s) * cosine**2 + 2 * m * a * e * s * sine
    slope = -2 * (J - eps * s * s) * cosine * sine + 2 * m * a * e * s * cosine
    # d/dt (support omega + mixed dphi) = 0
    first = -slope * dphi * omega + eps * s * cb * sine * dphi * dphi
    second = torque2 + 0.5 * slope * omega * omega - m * g * e * s * sine
    det = support * inertia - mixed * mixed
    return (inertia * first - mixed * second) / det, (support * second - mixed * first) / det


def inertia(rotor):
    """Moment of inertia about the shaft."""
    J, eps, _, _, s, *_ = constants(rotor)
    return J + eps * s * s


def speed(rotor, momentum, phi, dphi):
    """Angular velocity of the support at a momentum."""
    J, eps, m, a, s, cb, e, _, Jc = constants(rotor)
    sine, cosine = np.sin(phi), np.cos(phi)
    support = Jc + m * a * a + eps + (J - eps * s * s) * cosine**2 + 2 * m * a * e * s * sine
    return (momentum - eps * s * cb * cosine * dphi) / support


def integrate(rotor, momentum, push, start, times, **options):
    """States (phi, omega1, phi') at times, under a torque ``push(t, phi, dphi)`` over the inertia.

    The third part of the solution is `solve_ivp`'s own.
    """
    const, size = constants(rotor), inertia(rotor)

    def law(t, y):
        phi, omega, dphi = y
        return [dphi, *rates(const, phi, omega, dphi, size * push(t, phi, dphi))]

    state = [start[0], speed(rotor, momentum, *start), start[1]]
    options = {"method": "DOP853", "rtol": 1e-12, "atol": 1e-13, **options}
    return solve_ivp(law, (times[0], times[-1]), state, t_eval=times, **options)


@numba.njit
def fates(const, momentum, damping, phi, dphi, step, longest, saddle, level):
    """Lobe (1 left, 2 right) into which each motion falls that damping leads inwards; 0: none.

    It is there once its energy is below `level`, and left or right by its angle from the saddle.
    """
    J, eps, m, a, s, cb, e, g, Jc = const
    size = J + eps * s * s
    found = np.zeros(phi.size, np.int64)
    for i in range(phi.size):
        x, v = phi[i], dphi[i]
        cosine = math.cos(x)
        support = Jc + m * a * a + eps + (J - eps * s * s) * cosine**2
        support += 2 * m * a * e * s * math.sin(x)
        w = (momentum - eps * s * cb * cosine * v) / support
        for number in range(int(longest / step)):
            a1, b1 = rates(const, x, w, v, -damping * size * v)
            x2, w2, v2 = x + 0.5 * step * v, w + 0.5 * step * a1, v + 0.5 * step * b1
            a2, b2 = rates(const, x2, w2, v2, -damping * size * v2)
            x3, w3, v3 = x + 0.5 * step * v2, w + 0.5 * step * a2, v + 0.5 * step * b2
            a3, b3 = rates(const, x3, w3, v3, -damping * size * v3)
            x4, w4, v4 = x + step * v3, w + step * a3, v + step * b3
            a4, b4 = rates(const, x4, w4, v4, -damping * size * v4)
            x += step / 6 * (v + 2 * v2 + 2 * v3 + v4)
            w += step / 6 * (a1 + 2 * a2 + 2 * a3 + a4)
            v += step / 6 * (b1 + 2 * b2 + 2 * b3 + b4)
            if number % 20 == 0:
                sine, cosine = math.sin(x), math.cos(x)
                support = Jc + m * a * a + eps + (J - eps * s * s) * cosine**2
                support += 2 * m * a * e * s * sine
                kinetic = 0.5 * support * w * w + eps * s * cb * cosine * w * v + 0.5 * size * v * v
                if kinetic - m * g * e * s * cosine < level:
                    offset = (x - saddle + math.pi) % (2.0 * math.pi) - math.pi
                    found[i] = 2 if offset > 0.0 else 1
                    break
    return found
