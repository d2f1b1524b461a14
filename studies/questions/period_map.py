r"""
How long does every orbit take?
===============================

Map of the period over the phase plane.

Every point of the plane is a state, and its color is the period of the orbit through it. The period
grows without bound towards the separatrices, but only logarithmically.

Answer. For :math:`\lambda = 0.4` and :math:`\psi = 0.1` at :math:`\Omega = 1` 1/s, small
oscillations take 6.36 s about the lower center and 7.59 s about the upper one. An orbit round both
takes at least 11.77 s.

Run: ``python studies/questions/period_map.py [PICTURE]``
"""

from __future__ import annotations

import sys

import matplotlib.pyplot as plt
import numpy as np
import xarray as xr
from matplotlib.colors import LogNorm

import phasekit as pk
from phasekit.plot import phase_portrait

SYSTEM = pk.Reduced(lam=0.4, psi=0.1)
CENTERS = ("lower_center", "upper_center")


def main() -> None:
    """Draw the map with its separatrices; print the least periods of the oscillations."""
    phi = xr.DataArray(np.linspace(-np.pi, np.pi, 901), dims="across")
    dphi = xr.DataArray(np.linspace(-2.0, 2.0, 701), dims="up")
    period = pk.orbits(SYSTEM, phi, dphi).period.transpose("up", "across")

    figure, ax = plt.subplots(figsize=(8, 6), layout="constrained")
    low, high = float(period.min()), 30.0
    mesh = ax.pcolormesh(
        phi,
        dphi,
        np.minimum(period, high),
        norm=LogNorm(low, high),
        cmap="viridis",
        rasterized=True,
    )
    bar = figure.colorbar(mesh, ax=ax, extend="max", label="period (s)")
    ticks = [3, 4, 5, 7, 10, 15, 20, 30]
    bar.set_ticks(ticks, labels=[str(tick) for tick in ticks])
    bar.minorticks_off()
    phase_portrait(SYSTEM, energies=[], ax=ax)
    ax.set_ylim(-2.0, 2.0)
    ax.set_title(r"$\lambda = 0.4$, $\psi = 0.1$, $\Omega^2 = 1$ s$^{-2}$", fontsize="medium")

    for center in CENTERS:
        natural = pk.equilibria(SYSTEM).natural_frequency.sel(equilibrium=center)
        print(f"small oscillations about the {center}: {2 * np.pi / float(natural):.6f} s")
    outer = pk.orbit_families(SYSTEM).period.sel(family="outer")
    print(f"round both centers: at least {float(outer.min()):.6f} s")
    path = sys.argv[1] if len(sys.argv) > 1 else "period_map.png"
    figure.savefig(path, dpi=150)
    print(f"wrote {path}")


if __name__ == "__main__":
    main()
