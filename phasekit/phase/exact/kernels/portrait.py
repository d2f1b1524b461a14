"""Drivers over many states: orbits of initial conditions, one cell after the other.

``index`` says which system a cell belongs to; neighbors that share one load it once.
"""

from __future__ import annotations

import math

import numpy as np

from phasekit.arrays import Array, Index
from phasekit.numerics.compile import Outputs, inline, kernel
from phasekit.numerics.double_double import TWO_PI
from phasekit.phase.exact.kernels import action_angle as aa
from phasekit.phase.exact.kernels import equilibria as eq
from phasekit.phase.exact.kernels import levels as lv
from phasekit.phase.exact.kernels import motion as mo
from phasekit.phase.exact.kernels import orbits as ob
from phasekit.phase.exact.kernels import system as sy
from phasekit.phase.exact.kernels.magnify import enter

#: Systems in a row: their coefficients, then phi and V'' of the equilibria of each.
Systems = tuple[Array, Array, Array, Array, Array]
PHI, CURVATURE = 3, 4


@inline
def load_system(i: int, systems: Systems, w: Array) -> bool:
    """System i with its equilibria; whether it has a force."""
    a, b, c, phi, curvature = systems
    valid = sy.load(a[i], b[i], c[i], w)
    for j in range(4):
        sy.load_point(j, phi[i, j], curvature[i, j], w)
    return valid


@inline
def write_orbit(k: int, code: int, energy: float, w: Array, out: Outputs) -> None:
    """Results of cell k."""
    kind, orbit_energy, period, frequency, action, phi_min, phi_max, amplitude = out
    known = w[lv.MODE] != lv.INVALID
    kind[k] = code if known else lv.NOT_COMPUTED
    orbit_energy[k] = energy if known else math.nan
    period[k] = TWO_PI / w[ob.OMEGA]
    frequency[k] = w[ob.OMEGA]
    action[k] = w[ob.ACTION]
    phi_min[k] = w[ob.PHI_MIN]
    phi_max[k] = w[ob.PHI_MAX]
    amplitude[k] = w[ob.AMPLITUDE]


@kernel
def orbits(
    systems: Systems, index: Index, phi0: Array, dphi0: Array, start: int, stop: int, out: Outputs
) -> None:
    """Orbits through states."""
    w = np.zeros(ob.SIZE)
    w[lv.DOUBLE_TO] = lv.SOME
    last = np.int64(-1)
    valid = False
    for k in range(start, stop):
        i = index[k]
        if i != last:
            valid = load_system(i, systems, w)
            last = i
        code = enter(phi0[k], dphi0[k], valid, w)
        last = i if w[sy.ZOOM] == 1.0 else np.int64(-1)
        ob.shape(w)
        ob.finish(w)
        write_orbit(k, code, w[lv.ENERGY], w, out)


@kernel
def levels(
    systems: Systems,
    energy: Array,
    index: Index,
    level: Array,
    point: Array,
    side: Array,
    gaps: bool,
    start: int,
    stop: int,
    out: Outputs,
) -> None:
    """Orbits at energies round a center; or at gaps above a saddle, in the well on one side."""
    phi, curvature = systems[PHI], systems[CURVATURE]
    w = np.zeros(ob.SIZE)
    w[lv.DOUBLE_TO] = lv.SOME
    last = np.int64(-1)
    valid = False
    for k in range(start, stop):
        i = index[k]
        if i != last:
            valid = load_system(i, systems, w)
            last = i
        if gaps:
            j = eq.LOWER_SADDLE if point[k] == 0.0 else eq.UPPER_SADDLE
            center = lv.neighbor(j, side[k] > 0.0, w)
            gap = level[k]
            slack = 0.0
        else:
            j = eq.LOWER_CENTER if point[k] == 0.0 else eq.UPPER_CENTER
            center = j
            gap = level[k] - energy[i, j]
            slack = 4.0 * sy.ROUNDING * (abs(level[k]) + abs(energy[i, j]))
        present = valid and phi[i, j] == phi[i, j]
        if gaps and j == eq.LOWER_SADDLE and curvature[i, j] == 0.0:
            present = False  # a fold's pair is no saddle
        code = lv.classify_level(j, gap, center, slack, present, w)
        ob.shape(w)
        ob.finish(w)
        write_orbit(k, code, gap + energy[i, j], w, out)


@kernel
def rises(systems: Systems, start: int, stop: int, out: Outputs) -> None:
    """Energies: depths of the lower and the upper well, from saddle to saddle, from end to end."""
    phi, curvature = systems[PHI], systems[CURVATURE]
    w = np.zeros(ob.SIZE)
    for i in range(start, stop):
        out[0][i] = math.nan
        if load_system(i, systems, w):
            double = phi[i, eq.LOWER_SADDLE] == phi[i, eq.LOWER_SADDLE]
            double = double and curvature[i, eq.LOWER_SADDLE] < 0.0  # a fold's pair is no saddle
            rim = eq.LOWER_SADDLE if double else eq.UPPER_SADDLE
            unit = w[sy.UNIT]
            whole = sy.energy_between(eq.LOWER_CENTER, eq.UPPER_SADDLE, w) / unit / unit
            out[0][i, 0] = sy.energy_between(eq.LOWER_CENTER, rim, w) / unit / unit
            if double:
                out[0][i, 1] = sy.energy_between(eq.UPPER_CENTER, rim, w) / unit / unit
                out[0][i, 2] = sy.energy_between(rim, eq.UPPER_SADDLE, w) / unit / unit
            out[0][i, 3] = whole


@kernel
def flow(
    systems: Systems,
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
    w[lv.DOUBLE_TO] = lv.ALL
    system = np.int64(-1)
    last = np.int64(-1)
    valid = False
    for k in range(start, stop):
        j = state[k]
        if j != last:
            i = index[j]
            if i != system:
                valid = load_system(i, systems, w)
                system = i
            enter(phi0[j], dphi0[j], valid, w)
            system = i if w[sy.ZOOM] == 1.0 else np.int64(-1)
            ob.shape(w)
            mo.begin(w)
            last = j
        local, rate = mo.after(t[k], w)
        motion_phi[k] = ob.reduced(local, w)
        motion_dphi[k] = rate * w[sy.ZOOM]


@kernel
def action_angle(
    systems: Systems,
    index: Index,
    phi0: Array,
    dphi0: Array,
    start: int,
    stop: int,
    out: Outputs,
    angles: Outputs,
) -> None:
    """Orbits through states, with their family, the angle on them and the twist."""
    family, angle, twist = angles
    w = np.zeros(ob.SIZE)
    w[lv.DOUBLE_TO] = lv.SOME
    last = np.int64(-1)
    valid = False
    for k in range(start, stop):
        i = index[k]
        if i != last:
            valid = load_system(i, systems, w)
            last = i
        code = enter(phi0[k], dphi0[k], valid, w)
        last = i if w[sy.ZOOM] == 1.0 else np.int64(-1)
        ob.shape(w)
        ob.finish(w)
        write_orbit(k, code, w[lv.ENERGY], w, out)
        family[k] = aa.family(w)
        angle[k] = aa.angle(w)
        twist[k] = aa.twist(w)
        if w[lv.MODE] == lv.SWING or w[lv.MODE] == lv.TURN:
            twist[k] = twist[k] / w[sy.ZOOM] / w[sy.ZOOM]


@kernel
def state_of(
    systems: Systems,
    index: Index,
    family: Array,
    action: Array,
    angle: Array,
    start: int,
    stop: int,
    out: Outputs,
) -> None:
    """States of given action and angle; a family that has no such orbit is given as NaN."""
    state_phi, state_dphi = out
    w = np.zeros(ob.SIZE)
    w[lv.DOUBLE_TO] = lv.SOME
    last = np.int64(-1)
    valid = False
    for k in range(start, stop):
        i = index[k]
        if i != last:
            valid = load_system(i, systems, w)
            last = i
        w[lv.MODE] = lv.INVALID
        if (valid or w[sy.A] == 0.0) and family[k] == family[k]:
            aa.find_action(int(family[k]), action[k], w)
        state_phi[k], state_dphi[k] = aa.state_at(angle[k], w)


@kernel
def separatrix_motion(
    systems: Systems,
    index: Index,
    saddle: Array,
    side: Array,
    t: Array,
    start: int,
    stop: int,
    out: Outputs,
) -> None:
    """Motion on the separatrix that leaves a saddle on one side; NaN where it is absent."""
    motion_phi, motion_dphi = out
    phi, curvature = systems[PHI], systems[CURVATURE]
    w = np.zeros(mo.MOTION_SIZE)
    w[lv.DOUBLE_TO] = lv.SOME
    last = np.int64(-1)
    valid = False
    for k in range(start, stop):
        i = index[k]
        if i != last:
            valid = load_system(i, systems, w)
            last = i
        j = eq.LOWER_SADDLE if saddle[k] == 0.0 else eq.UPPER_SADDLE
        if saddle[k] < 0.0 and phi[i, eq.UPPER_CENTER] == phi[i, eq.UPPER_CENTER]:
            j = eq.LOWER_SADDLE
        w[lv.MODE] = lv.INVALID
        if (
            valid
            and phi[i, j] == phi[i, j]
            and not (j == eq.LOWER_SADDLE and curvature[i, j] == 0.0)
        ):
            mo.begin_separatrix(j, side[k] > 0.0, w)
        motion_phi[k], motion_dphi[k] = mo.after(t[k], w)
