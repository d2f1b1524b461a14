"""Drivers over many states: orbits of initial conditions, one cell after the other.

``index`` says which system a cell belongs to; neighbors that share one load it once.
"""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt

from phasekit.kernels import levels as lv
from phasekit.kernels import motion as mo
from phasekit.kernels import orbits as ob
from phasekit.kernels.compile import Array, Outputs, inline, kernel

Index = npt.NDArray[np.int64]


@inline
def load_system(
    i: int, a: Array, b: Array, c: Array, phi: Array, curvature: Array, w: Array
) -> bool:
    """System i with its equilibria; whether it has a force."""
    valid = lv.load(a[i], b[i], c[i], w)
    for j in range(4):
        lv.load_point(j, phi[i, j], curvature[i, j], w)
    return valid


@kernel
def orbits(
    a: Array,
    b: Array,
    c: Array,
    phi: Array,
    curvature: Array,
    index: Index,
    phi0: Array,
    dphi0: Array,
    start: int,
    stop: int,
    out: Outputs,
) -> None:
    """Orbits through states."""
    kind, energy, period, frequency, action, phi_min, phi_max = out
    w = np.zeros(ob.SIZE)
    last = np.int64(-1)
    valid = False
    for k in range(start, stop):
        i = index[k]
        if i != last:
            valid = load_system(i, a, b, c, phi, curvature, w)
            last = i
        code = lv.classify(phi0[k], dphi0[k], valid, w)
        ob.shape(w)
        ob.finish(w)
        x = np.float64(math.cos(w[lv.ANGLE]))
        y = np.float64(math.sin(w[lv.ANGLE]))
        kind[k] = code
        energy[k] = 0.5 * dphi0[k] * dphi0[k] + (0.5 * a[i] * x - b[i]) * x - c[i] * y
        period[k] = lv.TWO_PI / w[ob.OMEGA]
        frequency[k] = w[ob.OMEGA]
        action[k] = w[ob.ACTION]
        phi_min[k] = w[ob.PHI_MIN]
        phi_max[k] = w[ob.PHI_MAX]


@kernel
def flow(
    a: Array,
    b: Array,
    c: Array,
    phi: Array,
    curvature: Array,
    index: Index,
    phi0: Array,
    dphi0: Array,
    state: Index,
    t: Array,
    start: int,
    stop: int,
    out: Outputs,
) -> None:
    """States after times; ``state`` says which state a time belongs to, ``index`` its system."""
    motion_phi, motion_dphi = out
    w = np.zeros(mo.MOTION_SIZE)
    system = np.int64(-1)
    last = np.int64(-1)
    valid = False
    for k in range(start, stop):
        j = state[k]
        if j != last:
            i = index[j]
            if i != system:
                valid = load_system(i, a, b, c, phi, curvature, w)
                system = i
            lv.classify(phi0[j], dphi0[j], valid, w)
            ob.shape(w)
            mo.begin(w)
            last = j
        motion_phi[k], motion_dphi[k] = mo.after(t[k], w)
