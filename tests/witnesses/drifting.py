"""Orbits in an eight whose coefficients change slowly: into which lobe each is captured.

Leapfrog with exact damping; coefficients are quadratics of time.
"""

import math

import numba
import numpy as np


@numba.njit
def fates(quadratics, euler, damping, phi, dphi, step, grid, saddle_phi, saddle_energy, margin):
    """Lobe (0 none, 1 left, 2 right) of each orbit, and when it was seen to be there.

    `quadratics` has a row (constant, slope, square) for A, B and C; `euler` is a torque
    ``euler cos(phi)``; saddles are given at the times `grid`, evenly spaced.
    """
    where, met = np.zeros(phi.size, np.int64), np.full(phi.size, np.nan)
    decay, width = math.exp(-damping * step), grid[1] - grid[0]
    for orbit in range(phi.size):
        x, v, t = phi[orbit], dphi[orbit], 0.0
        s, c = math.sin(x), math.cos(x)
        for number in range(int((grid[-1] - width) / step)):
            A, B, C = quadratics[:, 0] + t * (quadratics[:, 1] + t * quadratics[:, 2])
            v -= 0.5 * step * ((B - A * c) * s - (C + euler) * c)
            x += 0.5 * step * v
            v *= decay
            x += 0.5 * step * v
            t += step
            s, c = math.sin(x), math.cos(x)
            A, B, C = quadratics[:, 0] + t * (quadratics[:, 1] + t * quadratics[:, 2])
            v -= 0.5 * step * ((B - A * c) * s - (C + euler) * c)
            if number % 20 == 0:
                i = int(t / width)
                part = t / width - i
                top = saddle_energy[i] * (1.0 - part) + saddle_energy[i + 1] * part
                if 0.5 * v * v - B * c + 0.5 * A * c * c - C * s < top - margin:
                    offset = (x - saddle_phi[i] + math.pi) % (2.0 * math.pi) - math.pi
                    where[orbit], met[orbit] = (2 if offset > 0.0 else 1), t
                    break
    return where, met


@numba.njit
def braked(quadratics, euler, torque, damping, phi, dphi, step, grid, saddle_energy, margin, fast):
    """Of rotations forward: 1 once the energy is below the saddle's, -1 once backward so fast.

    0 for those that come to neither. Besides when each first turned.
    """
    found, met = np.zeros(phi.size, np.int64), np.full(phi.size, np.nan)
    decay, width = math.exp(-damping * step), grid[1] - grid[0]
    for orbit in range(phi.size):
        x, v, t = phi[orbit], dphi[orbit], 0.0
        s, c = math.sin(x), math.cos(x)
        for number in range(int((grid[-1] - width) / step)):
            A, B, C = quadratics[:, 0] + t * (quadratics[:, 1] + t * quadratics[:, 2])
            v -= 0.5 * step * ((B - A * c) * s - (C + euler) * c - torque)
            x += 0.5 * step * v
            v *= decay
            x += 0.5 * step * v
            t += step
            s, c = math.sin(x), math.cos(x)
            A, B, C = quadratics[:, 0] + t * (quadratics[:, 1] + t * quadratics[:, 2])
            v -= 0.5 * step * ((B - A * c) * s - (C + euler) * c - torque)
            if v < 0.0 and math.isnan(met[orbit]):
                met[orbit] = t
            if v < -fast:
                found[orbit] = -1
                break
            if number % 20 == 0:
                i = int(t / width)
                part = t / width - i
                top = saddle_energy[i] * (1.0 - part) + saddle_energy[i + 1] * part
                if 0.5 * v * v - B * c + 0.5 * A * c * c - C * s < top - margin:
                    found[orbit] = 1
                    break
        if math.isnan(met[orbit]):
            met[orbit] = t
    return found, met
