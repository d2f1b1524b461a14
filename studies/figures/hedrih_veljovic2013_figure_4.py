r"""
HedrihVeljovic2013, figure 4: axial kinetic force of the bearing A2, for several e
==================================================================================

(19) names the rotators of other moments: its curves jump where :math:`\cos\varphi_2` changes
sign. The correct force falls and rises with :math:`\cos\varphi_2` on the two ways round.

Left (19) as printed, with the rotators of the deviation moments and without r0; right phasekit's.
Parameters: ``hedrih_veljovic.py``, beta = 45 deg, a = 50 mm; e is the family. None is the paper's.

Run: ``python studies/figures/hedrih_veljovic2013_figure_4.py [PICTURE]``
"""

from __future__ import annotations

import numpy as np
from hedrih_veljovic import Array, draw, explain, over_e, panels, save

import phasekit as pk


def printed(disk: pk.GyroRotorDisk, phi: Array, dphi: Array) -> Array:
    """Return |S_n1| (R1, n2) + |S_n2| (R21, n2), (19) without weight, which has no part here."""
    R = pk.rotators(disk, phi, dphi).rotator.sel(carrier_axis="u01")
    sb, cb = np.sin(disk.beta), np.cos(disk.beta)
    S_n1 = disk.m * disk.e * np.hypot(cb, sb * np.sin(phi))
    S_n2 = disk.m * disk.e * sb
    R1, R21 = (R.sel(rotator_name=name).values for name in ("R1", "R012"))
    return S_n1 * R1 + S_n2 * R21


def right(disk: pk.GyroRotorDisk, phi: Array, dphi: Array) -> Array:
    return pk.bearing_forces(disk, phi, dphi).force_axial.values


def main() -> None:
    """Draw both; print the greatest forces."""
    figure, axes = panels()
    draw(axes[0], over_e(), printed, right, "axial force at A2 (N)")
    axes[0, 0].set(title="as printed, (19)", ylabel=r"$F_{A2,n_2}^{kin}$ on the rotor (N)")
    axes[0, 1].set_title("correct")
    explain(axes[0, 1])
    save(figure, r"$\beta = \pi/4$, $a$ = 50 mm")


if __name__ == "__main__":
    main()
