"""
HedrihVeljovic2013, figure 8: kinetic force of B2 across the shaft, for several e
=================================================================================

Left the size of (26) as printed, right phasekit's. The captions of Figures 7 and 8 are alike, but
for "without intersection" in that of 8; so here the axes meet in 7, and do not in 8.
Parameters: ``hedrih_veljovic.py``, beta = 45 deg, a = 50 mm: the axes do not meet; e is the
family. None is the paper's.

Run: ``python studies/figures/hedrih_veljovic2013_figure_8.py [PICTURE]``
"""

from __future__ import annotations

import numpy as np
from hedrih_veljovic import DISK, across, draw, explain, over_e, panels, printed_kinetic, save


def main() -> None:
    """Draw both; print the greatest forces."""
    figure, axes = panels()
    draw(
        axes[0],
        over_e(DISK.replace(a=0.05)),
        lambda *state: np.hypot(*printed_kinetic(*state, "B2")),
        lambda *state: across(*state, "B2"),
        "kinetic force at B2 (N)",
    )
    axes[0, 0].set(title="as printed, (26)", ylabel=r"$|F_{B2}^{kin}|$ across $n_2$ (N)")
    axes[0, 0].set_ylim(bottom=0.0)
    axes[0, 1].set_title("correct")
    explain(axes[0, 1])
    save(figure, r"$\beta = \pi/4$, $a$ = 50 mm")


if __name__ == "__main__":
    main()
