"""Splitting of stable and unstable manifolds, simulated: shares no code with Melnikov's function.

Motions start on the local manifolds of the perturbed saddle, far back and far ahead in time, and
meet on a section at a prescribed time; their energies differ there by Melnikov's function.
"""

from __future__ import annotations

import cmath
import math

import numpy as np
from scipy.integrate import solve_ivp

AWAY = 1e-5
TOLERANCE = {"method": "DOP853", "rtol": 1e-13, "atol": 1e-15}


def coefficient(force, gradient, level, saddle, k, nu, *, side, winds):
    """Complex amplitude Z of the splitting ``Re(Z e^{i nu t0})`` for ``force(t, phi)``.

    The force, harmonic in time and small, is added to ``phi'' = -gradient(phi)``; ``level`` is the
    potential.
    """
    phases = 2.0 * np.pi * np.arange(4) / (4 * nu)
    found = [
        _height(force, gradient, level, saddle, k, nu, t0, side, winds, unstable=True)
        - _height(force, gradient, level, saddle, k, nu, t0, side, winds, unstable=False)
        for t0 in phases
    ]
    return 0.5 * np.sum(np.array(found) * np.exp(-1j * nu * phases))


def _height(force, gradient, level, saddle, k, nu, t0, side, winds, *, unstable):
    """Energy on the section at the time t0, of the motion on a manifold that meets it then."""
    way = 1.0 if unstable else -1.0
    # On the section phi' = 0, or half a turn from the saddle.
    start = saddle if unstable or not winds else saddle + side * 2.0 * math.pi
    leaves = side if unstable or not winds else -side
    middle = saddle + side * math.pi
    quarter = 0.5 * math.pi / nu
    answer = complex(force(0.0, saddle), -force(quarter, saddle))
    answer /= -(k * k + nu * nu)  # of the saddle, to first order

    def meets(begin):
        at = answer * cmath.exp(1j * nu * begin)
        moving = 1j * nu * at
        state = [start + at.real + leaves * AWAY, moving.real + way * leaves * k * AWAY]

        def section(t, y):
            if winds:
                return y[0] - middle
            # Next to the saddle the drive alone may turn the motion for a while.
            return y[1] * leaves * way if abs(y[0] - saddle) > 0.05 else 1.0

        section.terminal = True
        section.direction = 0 if winds else -1
        run = solve_ivp(
            lambda t, y: (y[1], -gradient(y[0]) + force(t, y[0])),
            (begin, begin + way * 60.0 / k),
            state,
            events=section,
            **TOLERANCE,
        )
        phi, dphi = run.y_events[0][0]
        return run.t_events[0][0], 0.5 * dphi**2 + level(phi)

    begin = t0 - way * 15.0 / k
    for _ in range(8):
        met, height = meets(begin)
        if abs(met - t0) < 1e-10:
            break
        begin += t0 - met
    return height
