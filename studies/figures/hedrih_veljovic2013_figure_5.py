"""
HedrihVeljovic2013, figure 5: kinetic force of A2 across the shaft, for several e
=================================================================================

As printed, (27) has its peak at another angle: five of its eight terms are wrong.

Left the size of (27) as printed, right phasekit's.
Parameters: ``hedrih_veljovic.py``, beta = 45 deg, a = 50 mm; e is the family. None is the paper's.

Run: ``python studies/figures/hedrih_veljovic2013_figure_5.py [PICTURE]``
"""

from __future__ import annotations

import numpy as np
from hedrih_veljovic import across, draw, explain, over_e, panels, printed_kinetic, save


def main() -> None:
    """Draw both; print the greatest forces."""
    figure, axes = panels()
    draw(
        axes[0],
        over_e(),
        lambda *state: np.hypot(*printed_kinetic(*state, "A2")),
        lambda *state: across(*state, "A2"),
        "kinetic force at A2 (N)",
    )
    axes[0, 0].set(title="as printed, (27)", ylabel=r"$|F_{A2}^{kin}|$ across $n_2$ (N)")
    axes[0, 0].set_ylim(bottom=0.0)
    axes[0, 1].set_title("correct")
    explain(axes[0, 1])
    save(figure, r"$\beta = \pi/4$, $a$ = 50 mm")


if __name__ == "__main__":
    main()
