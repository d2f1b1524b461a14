"""Hodographs of R022: as printed, v = Omega^2 phi'^2, next to the correct v = phi'^2."""

from __future__ import annotations

import matplotlib.pyplot as plt
import numpy as np
import picture
import xarray as xr

import phasekit as pk
from phasekit.plot import hodograph


def draw(systems: pk.Reduced | pk.GyroRotorDisk, start: tuple[float, float], assumed: str) -> None:
    """Draw the motions from one start; print how far they reach. All systems have one Omega^2."""
    period = float(pk.orbits(systems, *start).period.max())
    motions = pk.flow(systems, *start, np.linspace(0.0, 1.02 * period, 1201))
    figure, (left, right) = plt.subplots(1, 2, figsize=(11, 5.6), layout="constrained")
    hodograph(motions, legend=False, ax=right)
    Omega_sq = float(xr.DataArray(systems.coefficients().A).max())
    for line in right.lines:
        line.set_linestyle("-")  # dashes would fill up where a swing comes back
        u, v = line.get_data()
        left.plot(u, Omega_sq * v, color=line.get_color(), linewidth=line.get_linewidth())
        name = (
            line.get_label().replace("$", "").replace("\\", "").replace("\N{NO-BREAK SPACE}", " ")
        )
        print(f"{name}: phi'^2 at most {v.max():.4g} 1/s^2, as printed {Omega_sq * v.max():.4g}")
    left.set_aspect("equal", adjustable="datalim")
    left.set(title="as printed, (6.11)", xlabel=right.get_xlabel())
    left.set_ylabel(r"$\Omega^2\dot\varphi^2$, as printed")
    right.set_title("correct")
    right.legend(loc="center left", bbox_to_anchor=(1.01, 0.5), frameon=False)
    figure.supxlabel(f"Chosen here, for the paper gives no number: {assumed}", fontsize="small")
    picture.save(figure)
