r"""
HedrihVeljovic2011, figure 8: angular velocity of the rotator R022 for several a
================================================================================

(6.12), as far as it is printed, lacks :math:`\psi`: the curves of all distances :math:`a` all but
coincide.

The velocity is relative to the disk. Left (6.12) as far as it is printed: without psi, which is
right for a = 0 only; right phasekit's.
Parameters: ``hedrih_veljovic.py``, e = 20 mm,
beta = 45 deg; a is the family. None of these numbers is
the paper's.

Run: ``python studies/figures/hedrih_veljovic2011_figure_8.py [PICTURE]``
"""

from __future__ import annotations

import numpy as np
from hedrih_veljovic import DISK, Array, draw, explain, panels, save

import phasekit as pk

FAMILY = {f"$a$ = {mm} mm": DISK.replace(a=1e-3 * mm) for mm in (0, 20, 50, 100)}


def printed(disk: pk.GyroRotorDisk, phi: Array, dphi: Array) -> Array:
    """Return (6.12), in which the terms with psi are missing."""
    A, B, _ = disk.coefficients()
    f = (B - A * np.cos(phi)) * np.sin(phi)
    slope = B * np.cos(phi) - A * np.cos(2.0 * phi)
    return dphi * (2.0 * f**2 + slope * dphi**2) / (f**2 + dphi**4)


def right(disk: pk.GyroRotorDisk, phi: Array, dphi: Array) -> Array:
    return pk.rotators(disk, phi, dphi).gamma2_rate.values


def main() -> None:
    """Draw both; print the greatest velocities."""
    figure, axes = panels()
    draw(axes[0], FAMILY, printed, right, "angular velocity of R022 (1/s)")
    axes[0, 0].set(title=r"as printed, (6.12)", ylabel=r"$\dot\gamma_2$ (1/s)")
    axes[0, 1].set_title("correct")
    explain(axes[0, 1])
    save(figure, r"$\beta = \pi/4$, $e$ = 20 mm")


if __name__ == "__main__":
    main()
