"""
HedrihVeljovic2013, figure 9: couple of the kinetic forces of both bearings
===========================================================================

Left the size of l [n2, F_A - F_B] of (26) and (27) as printed, right phasekit's, for several e.
Parameters: ``hedrih_veljovic.py``, beta = 45 deg, a = 50 mm; e is the family. None is the paper's.

Run: ``python studies/figures/hedrih_veljovic2013_figure_9.py [PICTURE]``
"""

from __future__ import annotations

import numpy as np
from hedrih_veljovic import Array, draw, explain, over_e, panels, printed_kinetic, save

import phasekit as pk


def printed(disk: pk.GyroRotorDisk, phi: Array, dphi: Array) -> Array:
    apart = printed_kinetic(disk, phi, dphi, "A2") - printed_kinetic(disk, phi, dphi, "B2")
    return disk.half_span * np.hypot(*apart)


def right(disk: pk.GyroRotorDisk, phi: Array, dphi: Array) -> Array:
    return pk.bearing_forces(disk, phi, dphi).deviation_couple.values


def main() -> None:
    """Draw both; print the greatest couples."""
    figure, axes = panels()
    draw(axes[0], over_e(), printed, right, "deviation couple (N m)")
    axes[0, 0].set(title="as printed, from (26) and (27)", ylabel=r"$|M_{dev2}|$ (N m)")
    axes[0, 0].set_ylim(bottom=0.0)
    axes[0, 1].set_title("correct")
    explain(axes[0, 1])
    save(figure, r"$\beta = \pi/4$, $a$ = 50 mm")


if __name__ == "__main__":
    main()
