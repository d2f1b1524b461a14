"""
How fast do period doublings accumulate?
========================================

The cascade of Rössler's equations x' = -y - z, y' = x + y/5, z' = 1/5 + z (x - c), over c.

A cycle loses its stability where a multiplier is -1. A cycle of twice the period begins there and
soon loses its stability in the same way, and so on. [Feigenbaum1978] found that the distances
between these points shrink by a universal factor, 4.669201...

Answer. The first four doublings are located to rounding, each on the branch that begins at the
previous one. Their distances shrink by 3.50 and then by 4.57. The last two predict the onset of
chaos at c = 4.204.

Run: ``python studies/questions/doublings_of_a_cycle.py [PICTURE]``
"""

from __future__ import annotations

import sys

import matplotlib.pyplot as plt
import numpy as np

import phasekit as pk

FEIGENBAUM = 4.669201609102990
DOUBLINGS = 4
ROESSLER = pk.Problem(["-y - z", "x + y/5", "1/5 + z*(x - c)"], ["x", "y", "z"], {"c": 2.5})


def main() -> None:
    """Print the doublings and the ratios of their distances, and draw the cascade."""
    cycle = pk.periodic_orbit(ROESSLER, [2.5, 0.0, 0.0], settle=300.0)
    branch = pk.continuation(ROESSLER, "c", orbit=cycle, span=(2.5, 4.3))
    branches, places = [branch], []
    for number in range(1, DOUBLINGS + 1):
        doubling = branch.special("PD")[0]
        places.append(doubling["c"])
        print(f"doubling {number}: c = {doubling['c']:.9f}, period {doubling['period']:.6f}")
        if number < DOUBLINGS:
            branch = doubling.switch()
            branches.append(branch)
    ratios = np.diff(places)[:-1] / np.diff(places)[1:]
    print("ratios of the distances:", ", ".join(f"{ratio:.4f}" for ratio in ratios))
    end = places[-1] + (places[-1] - places[-2]) / (FEIGENBAUM - 1.0)
    print(f"with {FEIGENBAUM:.6f} from there on, chaos begins at c = {end:.4f}")
    figure, axes = plt.subplots(1, 2, figsize=(12, 5.0), layout="constrained")
    pk.plot.branch(branches, y="x_max", ax=axes[0])
    axes[0].set(xlim=(2.5, 4.4), xlabel="c", ylabel="greatest x")
    for number, one in enumerate(branches):
        at = int(np.argmin(np.abs(one.points["c"].values - places[number])))
        orbit = one.orbit(at)
        axes[1].plot(orbit["x"], orbit["y"], label=f"c = {places[number]:.3f}", lw=1.0)
    axes[1].set(xlabel="x", ylabel="y", aspect="equal")
    axes[1].legend(loc="center")
    path = sys.argv[1] if len(sys.argv) > 1 else "doublings_of_a_cycle.png"
    figure.savefig(path, dpi=100)
    print(f"wrote {path}")


if __name__ == "__main__":
    main()
