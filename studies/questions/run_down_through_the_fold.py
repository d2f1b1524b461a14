"""
How long does a rotor stay at an equilibrium that has disappeared?
==================================================================

The delay of the fall, and the bearing forces during the fall.

A disk of 2 kg rests at its upper center while its support slows down. At the fold, omega1 = 18.99
1/s, that center merges with the lower saddle and disappears. In a quasi-static theory the rotor
falls at once. In fact it stays: a motion that is led slowly through a fold leaves late. The lag of
omega1 grows like the rate to the power 2/3 with damping, and to the power 4/5 without.

Answer. At 0.5 1/s^2 the rotor leaves 0.62 1/s below the fold, and at 0.02 1/s^2 still 0.06 1/s
below it. With weak damping the lag grows like the power 0.72, between the two. During the fall the
bearings carry 2.1 to 2.3 times their load at rest, and more if the run-down is slower. The script
prints all numbers.

Run: ``python studies/questions/run_down_through_the_fold.py [PICTURE]``
"""

from __future__ import annotations

import sys

import matplotlib.pyplot as plt
import numpy as np
import xarray as xr

import phasekit as pk

ROTOR = pk.GyroRotorDisk(
    beta=80 * pk.deg, e=0.06, a=0.012, r=0.2, omega1=22.0, m=2.0, half_span=0.2
)
RATES = (0.02, 0.04, 0.1, 0.25, 0.5)
DAMPING = 0.3
LAST = 15.0
LEFT = 0.5


def run_down(rate: float, start: float) -> xr.Dataset:
    """Motion and forces while omega1 falls at a rate, from rest in the upper center."""
    end = (ROTOR.omega1 - LAST) / rate
    near = np.linspace(0.0, end, 20_001)
    return pk.run_up(
        ROTOR, omega1=lambda t: ROTOR.omega1 - rate * t, phi0=start, dphi0=0.0, t=near,
        damping=DAMPING,
    )  # fmt: skip


def main() -> None:
    """Run the rotor down at several rates; print lags, their power, and the peak forces."""
    fold = pk.critical(ROTOR, "omega1").critical_fold.sel(fold="plus").item()
    rest = pk.equilibria(ROTOR).phi.sel(equilibrium="upper_center").item()
    merged = pk.equilibria(ROTOR.replace(omega1=fold * (1.0 + 1e-9)))
    place = merged.phi.sel(equilibrium="upper_center").item()
    at_rest = pk.bearing_forces(ROTOR.replace(omega1=fold), place, 0.0, ddphi=0.0)
    bore = at_rest.force_magnitude.max().item()
    print(f"fold at omega1 = {fold:.4f} 1/s, phi = {place:.4f}; the bearings bear {bore:.1f} N")
    figure, axes = plt.subplots(1, 2, figsize=(12, 4.8), layout="constrained")
    lags = []
    for rate in RATES:
        ds = run_down(rate, rest)
        away = np.flatnonzero(np.abs(ds.motion_phi.values - place) > LEFT)
        gone = away[ds.motion_omega1.values[away] < fold][0]
        lags.append(fold - ds.motion_omega1.values[gone])
        peak = ds.force_magnitude.max().item()
        print(
            f"rate {rate:5.2f} 1/s^2: leaves {lags[-1]:.4f} 1/s late; "
            f"peak force {peak:.1f} N, {peak / bore:.2f} times that at rest"
        )
    power = np.polyfit(np.log(RATES), np.log(lags), 1)[0]
    print(f"the lag grows like the rate to the power {power:.3f}")
    pk.plot.run_up(ds, ax=axes[0])
    axes[0].set_title(f"run down by {RATES[-1]} 1/s$^2$")
    axes[1].loglog(RATES, lags, "o", label="lag")
    for share, look in ((2 / 3, ":"), (4 / 5, "--")):
        line = lags[0] * (np.array(RATES) / RATES[0]) ** share
        axes[1].loglog(RATES, line, look, color="black", label=f"power {share:.3g}")
    axes[1].set_xlabel(r"rate $-\dot\omega_1$ (1/s$^2$)")
    axes[1].set_ylabel(r"lag of $\omega_1$ behind the fold (1/s)")
    axes[1].set_xticks(RATES, [f"{rate}" for rate in RATES])
    axes[1].set_yticks([0.05, 0.1, 0.2, 0.5], ["0.05", "0.1", "0.2", "0.5"])
    axes[1].minorticks_off()
    axes[1].legend(frameon=False)
    path = sys.argv[1] if len(sys.argv) > 1 else "run_down_through_the_fold.png"
    figure.savefig(path, dpi=150)
    print(f"wrote {path}")


if __name__ == "__main__":
    main()
