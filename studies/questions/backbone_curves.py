r"""
How does the frequency of the disk change with its amplitude?
=============================================================

Backbone curves: frequency against amplitude, for skew angles on either side of the fold at
:math:`\beta = 0.3664\pi`.

Below the fold the disk can swing about two centers, and both families of swings end at the saddle
between them. At the fold the upper center and the lower saddle disappear; the swings about the
lower center then reach the top.

Answer. The frequency always falls with the amplitude. For :math:`\beta = 0.01\pi` it falls from
2.52 rad/s at rest to zero at 90 degrees; for :math:`\pi/2` from 0.75 rad/s to zero at 180 degrees.
The script prints all numbers.

Run: ``python studies/questions/backbone_curves.py [PICTURE]``
"""

from __future__ import annotations

import sys

import matplotlib.pyplot as plt
import numpy as np
import xarray as xr

import phasekit as pk

DISK = pk.GyroRotorDisk(beta=0.01 * np.pi, e=1.153e-3, a=2e-3, r=0.2, omega1=2.518, g=9.81)

BETAS = {
    "0.01": 0.01,
    "0.1": 0.1,
    "0.218": 0.218,
    "1/3": 1 / 3,
    "0.36": 0.36,
    "0.38": 0.38,
    "0.42": 0.42,
    "1/2": 0.5,
}
CENTERS = {"lower_center": "left", "upper_center": "right"}


def main() -> None:
    """Draw a curve for each beta about each center; print the critical value and the ends."""
    figure, axes = plt.subplots(1, 2, figsize=(11, 5.2), sharey=True, layout="constrained")
    critical = pk.critical(DISK, "beta").critical_fold
    fold = float(critical.dropna("fold").item())
    print(f"fold at beta = {fold:.6f} rad = {fold / np.pi:.4f} pi")
    step = xr.DataArray(np.linspace(0.0, 1.0, 401)[1:-1], dims="step")
    colors = plt.colormaps["viridis"](np.linspace(0.0, 0.9, len(BETAS)))
    for (name, share), color in zip(BETAS.items(), colors, strict=True):
        disk = DISK.replace(beta=share * np.pi)
        points, loops = pk.equilibria(disk), pk.separatrices(disk)
        rim = float(loops.saddle_energy.min())
        for ax, (center, side) in zip(axes, CENTERS.items(), strict=True):
            depth = rim - points.energy.sel(equilibrium=center)
            if np.isnan(depth):
                continue
            # Even in amplitude at the center, and ever closer to the separatrix.
            orbits = pk.orbits(disk, gap=-depth * (1.0 - step**2) ** 4, side=side)
            amplitude = np.degrees(orbits.phi_max - orbits.phi_min) / 2.0
            natural = float(points.natural_frequency.sel(equilibrium=center))
            ax.plot(
                [0.0, *amplitude.values, float(amplitude[-1])],
                [natural, *orbits.frequency.values, 0.0],
                color=color,
                linestyle="-" if share * np.pi < fold else (0, (5, 2)),
                label=rf"$\beta$ = {name} $\pi$",
            )
            print(
                f"beta = {name:5} pi, {center}: {natural:.4f} 1/s at rest, "
                f"0 at an amplitude of {float(amplitude[-1]):.1f} deg"
            )
    for ax, title in zip(axes, ("about the lower center", "about the upper center"), strict=True):
        ax.set(xlim=(0.0, 180.0), xlabel="amplitude (°)", title=title)
        ax.set_xticks(range(0, 181, 45))
    axes[0].set_ylim(bottom=0.0)
    axes[0].set_ylabel(r"frequency $\omega$ (rad/s)")
    axes[1].legend(
        frameon=False,
        fontsize="small",
        handles=axes[0].lines,
        title=rf"dashed: beyond the fold at {fold / np.pi:.4f} $\pi$",
        title_fontsize="small",
        alignment="left",
        loc="upper right",
    )
    path = sys.argv[1] if len(sys.argv) > 1 else "backbone_curves.png"
    figure.savefig(path, dpi=150)
    print(f"wrote {path}")


if __name__ == "__main__":
    main()
