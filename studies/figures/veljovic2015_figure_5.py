"""
Veljovic2015, figure 5: one start, several skew angles beta
===========================================================

The study prints where each motion turns.

Each curve is the level through phi0 = pi/4, dphi0 = pi/12 1/s.

Run: ``python studies/figures/veljovic2015_figure_5.py [PICTURE]``
"""

from __future__ import annotations

import matplotlib.pyplot as plt
import numpy as np
from veljovic2015 import DISK, save

import phasekit as pk

BETAS = {"0.01": 0.01, "0.1": 0.1, "0.218": 0.218, "1/3": 1 / 3, "0.42": 0.42, "1/2": 0.5}
START = (np.pi / 4, np.pi / 12)


def main() -> None:
    """Draw the level of the start for each beta, and print where it turns."""
    figure, ax = plt.subplots(figsize=(8, 5.5), layout="constrained")
    phi = np.linspace(-np.pi, np.pi, 20001)
    colors = plt.colormaps["viridis"](np.linspace(0.0, 0.9, len(BETAS)))
    for (name, share), color in zip(BETAS.items(), colors, strict=True):
        disk = DISK.replace(beta=share * np.pi)
        energy = float(pk.energy(disk, *START).energy_integral)
        speed = pk.phase_velocity(disk, phi, energy).phase_velocity.values
        # The level may have a part in the other well as well: keep the one that holds the start.
        walls = phi[np.isnan(speed)]
        low = walls[walls < START[0]].max(initial=-np.pi)
        high = walls[walls > START[0]].min(initial=np.pi)
        part = (phi > low) & (phi < high)
        x, y = phi[part], speed[part]
        ax.plot(
            np.concatenate([x, x[::-1], x[:1]]),
            np.concatenate([y, -y[::-1], y[:1]]),
            color=color,
            label=rf"$\beta$ = {name} $\pi$",
        )
        eight = bool(pk.separatrices(disk).figure_eight)
        print(
            f"beta = {name:5} pi: phi from {x.min():+.4f} to {x.max():+.4f} rad, "
            f"{'figure-eight' if eight else 'no figure-eight'} in the portrait"
        )
    ax.plot(*START, "k*", markersize=11, label="start")
    ax.set_xlim(-np.pi, np.pi)
    ax.set_xticks(np.pi * np.arange(-2, 3) / 2, [r"$-\pi$", r"$-\pi/2$", "0", r"$\pi/2$", r"$\pi$"])
    ax.set_xlabel(r"$\varphi$ (rad)")
    ax.set_ylabel(r"$\dot\varphi$ (rad/s)")
    ax.legend(loc="center left", bbox_to_anchor=(1.01, 0.5), frameon=False)
    save(figure, r"$\varphi_0 = \pi/4$, $\dot\varphi_0 = \pi/12$ rad/s")


if __name__ == "__main__":
    main()
