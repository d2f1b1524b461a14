"""What the figures of [Veljovic2015] have in common: the rotor, and where the picture goes.

The paper prints no radius, eccentricity or support speed. The two initial speeds that it gives for
progressive motion (1.54 1/s at beta = pi/3 and 2.53 1/s at beta = 0.01 pi), read as thresholds
for a start at phi = 0, leave one family: omega1 = 2.518 1/s and e/r^2 = 0.0288 1/m. The radius
below picks one member of it; a = 2 mm is the paper's.
"""

from __future__ import annotations

import numpy as np
import picture
from matplotlib.figure import Figure

import phasekit as pk

DISK = pk.GyroRotorDisk(beta=0.01 * np.pi, e=1.153e-3, a=2e-3, r=0.2, omega1=2.518, g=9.81)
ASSUMED = (
    "Chosen here, not in the paper: r = 0.2 m, e = 1.153 mm, "
    r"$\omega_1$ = 2.518 1/s, g = 9.81 m/s$^2$"
)


def threshold(disk: pk.GyroRotorDisk, phi: float) -> float:
    """Initial speed at phi, 1/s, above which the disk turns over: sqrt(2 (max V - V(phi)))."""
    top = pk.separatrices(disk).saddle_energy.sel(saddle="upper")
    return float(np.sqrt(2.0 * (top - pk.potential(disk, phi).potential)))


def save(figure: Figure, given: str) -> None:
    """Write what is assumed under the picture, and save it: by default in the working folder."""
    figure.supxlabel(f"{ASSUMED}.\nFrom the paper: a = 2 mm; {given}.", fontsize="small")
    picture.save(figure)
