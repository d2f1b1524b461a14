r"""
Can two different wells have the same period?
=============================================

Yes: at equal energy the periods always agree, to all digits, in every system with two wells.

One well is deeper and wider than the other, so orbits of equal energy enclose different areas.
Their periods are nevertheless equal. The period is 2 pi times the derivative of the action with
respect to the energy, so the actions differ by a constant: :math:`2|C|/\sqrt{A}` for A > 0.

Run: ``python studies/questions/equal_periods_of_two_wells.py [PICTURE]``
"""

from __future__ import annotations

import sys

import matplotlib.pyplot as plt
import numpy as np

import phasekit as pk
from phasekit.plot import period_energy, potential_well

SYSTEM = pk.Coefficients(A=1.3, B=0.2, C=0.15)
ENERGY = 0.25
WELLS = {"lower_well": "lower_center", "upper_well": "upper_center"}

FAMILIES = {
    "lower_well": {"color": "#0072B2", "linestyle": "-", "linewidth": 2.4, "label": "lower well"},
    "upper_well": {"color": "#E69F00", "linestyle": (0, (4, 3)), "label": "upper well"},
}


def main() -> None:
    """Draw the wells, their common periods and their actions; print both at one energy."""
    figure = plt.figure(figsize=(12, 5.5), layout="constrained")
    panels = figure.subplot_mosaic([["well", "period"], ["well", "action"]])
    rim = float(pk.separatrices(SYSTEM).saddle_energy.sel(saddle="lower"))

    potential_well(SYSTEM, energies=[], ax=panels["well"])
    period_energy(SYSTEM, energy_max=1.2, legend=False, ax=panels["period"])
    families, points = pk.orbit_families(SYSTEM), pk.equilibria(SYSTEM)
    keys, actions = [], []
    for family, center in WELLS.items():
        look = FAMILIES[family]
        orbit = pk.orbits(SYSTEM, energy=ENERGY, center=center)
        actions.append(float(orbit.action))
        turns = [float(orbit.phi_min), float(orbit.phi_max)]
        keys += panels["well"].plot(turns, [ENERGY, ENERGY], zorder=4, **look)
        one = families.sel(family=family)
        bottom = float(points.energy.sel(equilibrium=center))
        panels["action"].plot([bottom, *one.energy_level], [0.0, *one.action], **look)
        panels["action"].plot(ENERGY, actions[-1], "o", color=look["color"])
        print(
            f"{family} at h = {ENERGY} 1/s^2: period {float(orbit.period):.12f} s, "
            f"action {actions[-1]:.6f} rad^2/s"
        )
    apart = 2.0 * abs(SYSTEM.C) / np.sqrt(SYSTEM.A)
    print(f"the actions differ by {actions[0] - actions[1]:.9f} rad^2/s, 2C/sqrt(A) = {apart:.9f}")
    panels["period"].plot(ENERGY, orbit.period, "ko", zorder=6)
    for name in ("period", "action"):
        panels[name].set_xlim(-0.2, rim + 0.02)
        panels[name].axvline(ENERGY, color="gray", linewidth=0.8, zorder=0)
    panels["period"].set(ylim=(4.0, 14.0), xlabel="", title="one period for both wells")
    panels["period"].tick_params(labelbottom=False)
    panels["action"].axvline(rim, zorder=1, color="#D55E00", ls=(0, (5, 2)), lw=1.2)
    panels["action"].set_ylim(bottom=0.0)
    panels["action"].set(xlabel="energy $h$ (s$^{-2}$)", ylabel="action $J$ (rad$^2$/s)")
    panels["action"].set_title(r"two actions, $2C/\sqrt{A}$ apart")
    panels["well"].set_title(f"orbits of energy {ENERGY} s$^{{-2}}$ in either well")
    panels["well"].legend(handles=keys, loc="upper center", ncols=2, frameon=False)
    path = sys.argv[1] if len(sys.argv) > 1 else "equal_periods_of_two_wells.png"
    figure.savefig(path, dpi=150)
    print(f"wrote {path}")


if __name__ == "__main__":
    main()
