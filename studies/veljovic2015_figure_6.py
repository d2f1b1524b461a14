"""Figure 6 of [Veljovic2015]: several starts at four skew angles, and the speeds that turn over.

The paper names the initial speeds 1.54 1/s (beta = pi/3) and 2.53 1/s (beta = 0.01 pi) as giving
progressive motion; with the rotor below they are the thresholds of a start at phi = 0.
Run: python studies/veljovic2015_figure_6.py [PICTURE]
"""

from __future__ import annotations

import matplotlib.pyplot as plt
import numpy as np
from veljovic2015 import DISK, save, threshold

from phasekit.plot import phase_portrait

PANELS = {"a": ("0.218", 0.218), "b": ("1/3", 1 / 3), "c": ("0.1", 0.1), "d": ("0.01", 0.01)}
SHARES = (0.35, 0.75, 1.1)


def main() -> None:
    """Draw the four portraits with starts below and above the threshold; print the thresholds."""
    figure, axes = plt.subplots(2, 2, figsize=(11, 8.5), sharex=True, layout="constrained")
    common = {}
    for (letter, (name, share)), ax in zip(PANELS.items(), axes.flat, strict=True):
        disk = DISK.replace(beta=share * np.pi)
        limit = threshold(disk, 0.0)
        starts = [(0.0, factor * limit) for factor in SHARES]
        phase_portrait(disk, energies=[], orbits=starts, ax=ax)
        legend = ax.get_legend()
        keys = {key.get_label(): key for key in legend.legend_handles}
        legend.remove()
        own = [key for name, key in keys.items() if name.startswith("from")]
        ax.legend(handles=own, loc="lower center", ncols=3, frameon=False, fontsize="small")
        common |= {name: key for name, key in keys.items() if not name.startswith("from")}
        ax.set_title(
            rf"({letter}) $\beta$ = {name} $\pi$: turns over above {limit:.4f} 1/s",
            fontsize="medium",
        )
        print(
            f"({letter}) beta = {name:5} pi: progressive motion above {limit:.4f} 1/s from phi = 0"
        )
    for ax in axes[0]:
        ax.set_xlabel("")
    figure.legend(handles=common.values(), loc="outside upper center", ncols=4, frameon=False)
    save(figure, r"$\beta$ of each panel; starts at $\varphi_0 = 0$ are chosen here")


if __name__ == "__main__":
    main()
