r"""
Veljovic2015, figure 3: the potential for several skew angles beta
==================================================================

With growing :math:`\beta` the well at the top becomes shallow and vanishes.

The curves are E_p of equation (15), which is V - A/2. The start is at rest at phi = pi as the
caption says (the text has pi/2); the level of that start is drawn for each beta.

Run: ``python studies/figures/veljovic2015_figure_3.py [PICTURE]``
"""

from __future__ import annotations

import matplotlib.pyplot as plt
import numpy as np
from veljovic2015 import DISK, save

import phasekit as pk

BETAS = {"0.01": 0.01, "0.1": 0.1, "0.218": 0.218, "1/3": 1 / 3, "0.42": 0.42, "1/2": 0.5}


def main() -> None:
    """Draw the curves, mark their extrema, and print where these are."""
    figure, ax = plt.subplots(figsize=(8, 5.5), layout="constrained")
    phi = np.linspace(-np.pi, np.pi, 721)
    colors = plt.colormaps["viridis"](np.linspace(0.0, 0.9, len(BETAS)))
    for (name, share), color in zip(BETAS.items(), colors, strict=True):
        disk = DISK.replace(beta=share * np.pi)
        A, _, _ = disk.coefficients()
        shift = -0.5 * A
        curve = pk.potential(disk, phi).potential + shift
        ax.plot(phi, curve, color=color, label=rf"$\beta$ = {name} $\pi$")
        points = pk.equilibria(disk)
        level = float(pk.potential(disk, np.pi).potential) + shift
        ax.plot(np.pi, level, "s", color=color, clip_on=False, markersize=5)
        for label, marker in (("center", "o"), ("saddle", "D")):
            mask = points.kind == int(pk.EquilibriumKind[label.upper()])
            here = points.where(mask, drop=True)
            face = color if label == "center" else "white"
            ax.plot(here.phi, here.energy + shift, marker, color=color, mfc=face, clip_on=False)
        angles = ", ".join(f"{value:+.4f}" for value in points.phi.values if np.isfinite(value))
        print(f"beta = {name:5} pi: equilibria at {angles} rad")
    ax.set_xlim(-np.pi, np.pi)
    ax.set_xticks(np.pi * np.arange(-2, 3) / 2, [r"$-\pi$", r"$-\pi/2$", "0", r"$\pi/2$", r"$\pi$"])
    ax.set_xlabel(r"$\varphi$ (rad)")
    ax.set_ylabel(r"$E_p = V - A/2$ (s$^{-2}$)")
    ax.set_title(
        "Potential energy analogue: centers ●, saddles ◇, start at rest ■", fontsize="medium"
    )
    ax.legend(ncols=1, loc="center left", bbox_to_anchor=(1.01, 0.5), frameon=False)
    save(figure, r"start $\varphi_0 = \pi$, $\dot\varphi_0 = 0$ (caption)")


if __name__ == "__main__":
    main()
