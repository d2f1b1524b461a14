"""
HedrihVeljovic2011, figure 9: hodograph of the rotator R022 for several lambda
==============================================================================

Left (6.11) as printed, v = Omega^2 phi'^2; right v = phi'^2. Omega^2 = 4 1/s^2, psi = 0.1,
start at phi20 = 0 with phi20' = 2.5 1/s: none of these numbers is the paper's.

Run: ``python studies/figures/hedrih_veljovic2011_figure_9.py [PICTURE]``
"""

from __future__ import annotations

from hedrih_veljovic_hodographs import draw

import phasekit as pk


def main() -> None:
    """Draw the family; print how far the hodographs reach."""
    draw(
        pk.Reduced(lam=[0.2, 0.6, 1.0, 1.4], psi=0.1, Omega_sq=4.0),
        (0.0, 2.5),
        r"$\Omega^2$ = 4 1/s$^2$, $\psi$ = 0.1, "
        r"start $\varphi_{20}$ = 0, $\dot\varphi_{20}$ = 2.5 1/s",
    )


if __name__ == "__main__":
    main()
