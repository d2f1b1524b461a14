"""
HedrihVeljovic2011, figure 7: hodograph of the rotator R022 for several a
=========================================================================

Left (6.11) as printed, v = Omega^2 phi'^2; right v = phi'^2. The disk: beta = 80 deg, e = 50 mm,
r = 100 mm, omega1 = 5 1/s, g = 9.81 m/s^2, start at rest at phi20 = 75 deg: none of these
numbers is the paper's.

Run: ``python studies/figures/hedrih_veljovic2011_figure_7.py [PICTURE]``
"""

from __future__ import annotations

from hedrih_veljovic_hodographs import draw

import phasekit as pk


def main() -> None:
    """Draw the family; print how far the hodographs reach."""
    draw(
        pk.GyroRotorDisk(
            beta=80 * pk.deg, e=0.05, a=[0.0, 0.1, 0.2, 0.3], r=0.1, omega1=5.0, g=9.81
        ),
        (75 * pk.deg, 0.0),
        r"$\beta$ = 80°, $e$ = 50 mm, $r$ = 100 mm, $\omega_1$ = 5 1/s, "
        r"$g$ = 9.81 m/s$^2$, start at rest at $\varphi_{20}$ = 75°",
    )


if __name__ == "__main__":
    main()
