r"""
Veljovic2015, figure 4: potential well and phase portrait at beta = 0.01 pi
===========================================================================

The two saddles differ in energy by :math:`9\cdot 10^{-5}` s\ :sup:`-2`: the separatrix of the
lower one is a figure-eight, and that of the upper one winds round it so closely that the two lie
on one line.


Run: ``python studies/figures/veljovic2015_figure_4.py [PICTURE]``
"""

from __future__ import annotations

import matplotlib.pyplot as plt
import numpy as np
from veljovic2015 import DISK, save

import phasekit as pk
from phasekit.plot import potential_well


def main() -> None:
    """Draw well and portrait over one angle axis; print the equilibria."""
    figure, axes = plt.subplots(2, 1, figsize=(8, 7), sharex=True, layout="constrained")
    potential_well(DISK, ax=axes)
    axes[0].set_title(r"$\beta = 0.01\,\pi$", fontsize="medium")
    points = pk.equilibria(DISK)
    for label in points.equilibrium.values:
        point = points.sel(equilibrium=label)
        if np.isfinite(point.phi):
            phi, energy = float(point.phi), float(point.energy)
            print(f"{label:13} phi = {phi:+.6f} rad, V = {energy:+.6f} 1/s^2")
    loops = pk.separatrices(DISK)
    print(f"figure-eight: {bool(loops.figure_eight)}")
    save(figure, r"$\beta = 0.01\,\pi$; the initial conditions are not printed")


if __name__ == "__main__":
    main()
