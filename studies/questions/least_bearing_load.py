r"""
Which skew angle gives the lowest bearing load?
===============================================

The lowest peak load of the bearings over :math:`\beta` and :math:`e`, and the effect of crossing
the fold.

A disk of 2 kg turns on a carrier at 300 rpm. The "peak load" is the largest force in either
bearing along the winding separatrix, in both directions. It bounds the load of every libration.
This is checked here on a grid, not proved.

Answer. Without eccentricity the load is lowest for a disk perpendicular to its shaft (e = 0, beta
= 90 deg), because the rotor is balanced. Up to about e = 16 mm a perpendicular disk remains the
best, or within 0.3 % of the best. With more eccentricity a skew of 6 to 12 deg is better and
lowers the peak load by up to a tenth. From about 75 mm on, the lowest load is at the other end,
with the shaft in the plane of the disk (beta near 0).

Crossing the fold does not change the worst libration: the upper saddle takes no part in the fold,
and the peak load is continuous there. A rotor at rest is affected: its upper center disappears,
the rotor swings down, and its bearings carry a peak load of up to several times the load at rest.
The script prints all numbers.

Run: ``python studies/questions/least_bearing_load.py [PICTURE]``
"""

from __future__ import annotations

import sys

import matplotlib.pyplot as plt
import numpy as np
import xarray as xr

import phasekit as pk
from phasekit.plot import bearing_load_map

# Okabe and Ito's colors, which the color-blind can tell apart.
BLACK, BLUE, GREEN, ORANGE, VERMILLION = "#000000", "#0072B2", "#009E73", "#E69F00", "#D55E00"

ROTOR = pk.GyroRotorDisk(
    beta=70 * pk.deg, e=0.06, a=0.024, r=0.2, omega1=300 * pk.rpm, m=2.0, half_span=0.2
)
BETA = np.linspace(2.0, 90.0, 45) * pk.deg
E = np.linspace(0.002, 0.1, 25)
BOTH = ("side", "bearing")


def worst(ds: xr.Dataset) -> xr.DataArray:
    """Return the greatest force in either bearing over the winding separatrix."""
    return ds.peak_force.sel(saddle="upper").max(BOTH)


def excess_inside(ds: xr.Dataset) -> float:
    """Return the greatest load of any state inside the winding separatrix, over the peak on it."""
    some = ds.isel(beta=slice(None, None, 11), e=slice(None, None, 6))
    disk = some.phasekit.system()
    phi = xr.DataArray(np.linspace(-np.pi, np.pi, 181), dims="at")
    top = some.saddle_energy.sel(saddle="upper", drop=True).drop_attrs()
    speed = np.sqrt(2.0 * np.maximum(top - pk.potential(disk, phi).potential.drop_attrs(), 0.0))
    share = xr.DataArray(np.linspace(-1.0, 1.0, 9), dims="share")
    force = pk.bearing_forces(disk, phi, share * speed).force_magnitude
    return float((force.max(["at", "share", "bearing"]) / worst(some)).max())


def print_least(ds: xr.Dataset) -> xr.DataArray:
    """Print where the peak load is least for given e; return the best beta for each e."""
    load = worst(ds)
    best = load.idxmin("beta")
    for e in (0.002, 0.02, 0.04, 0.06, 0.08, 0.1):
        one = load.sel(e=e, method="nearest")
        at, least, square = float(best.sel(e=e, method="nearest")), float(one.min()), one[-1]
        print(
            f"e = {float(one.e) * 1e3:5.1f} mm: least peak load {least:6.1f} N at beta = "
            f"{at / pk.deg:4.1f} deg; {float(square):6.1f} N at 90 deg, at worst {one.max():.1f} N"
        )
    return best


def print_fold(row: xr.Dataset) -> dict[float, tuple[float, float]]:
    """Print what crossing each fold does; return loads before and after by the beta of the fold."""
    jumps = {}
    for fold in pk.critical(ROTOR, "beta").critical_fold.values:
        # Within 1e-7 rad of the fold, on the side where the upper center exists.
        sides = [pk.equilibria(ROTOR.replace(beta=fold + d)) for d in (-1e-7, 1e-7)]
        step = 1e-7 if int(sides[1].n_equilibria) == 4 else -1e-7
        phi = float(sides[step > 0].phi.sel(equilibrium="upper_center"))
        near, beyond = (ROTOR.replace(beta=fold + x) for x in (step, -step))
        rest = float(pk.bearing_forces(near, phi, 0.0).force_magnitude.max())
        swing = pk.equilibria(beyond).phasekit.bearing_forces(on="orbit", phi0=phi, dphi0=0.0)
        peak = float(swing.peak_force.max())
        ends = pk.sweep(ROTOR, beta=[near.beta, beyond.beta], of="separatrix_forces")
        winding = worst(ends).values
        jumps[float(fold)] = (rest, peak)
        print(
            f"fold at beta = {fold / pk.deg:.2f} deg: at rest in the upper center {rest:.1f} N; "
            f"beyond the fold it swings, at most {peak:.1f} N ({peak / rest:.2f} times); "
            f"worst swing {winding[0]:.1f} N before, {winding[1]:.1f} N after"
        )
    return jumps


def draw_row(ax: plt.Axes, row: xr.Dataset, jumps: dict[float, tuple[float, float]]) -> None:
    """Draw the loads over beta at one e, and what crossing the folds does."""
    beta = row.beta / pk.deg
    rest = row.equilibrium_force_magnitude.max("bearing")
    swings = row.peak_force.max(BOTH)
    ax.plot(beta, swings.sel(saddle="upper"), color=BLACK, ls=(0, (6, 2)), label="worst swing")
    ax.plot(
        beta, swings.sel(saddle="lower"), color=VERMILLION, label="worst swing in a well of two"
    )
    ax.plot(
        beta, rest.sel(equilibrium="lower_center"), color=BLUE, label="at rest in the lower center"
    )
    ax.plot(
        beta,
        rest.sel(equilibrium="upper_center"),
        color=ORANGE,
        ls=(0, (4, 1.5)),
        lw=2.2,
        label="at rest in the upper center",
    )
    for fold, (before, after) in jumps.items():
        x = fold / pk.deg
        ax.axvline(x, color="gray", lw=0.8, zorder=0)
        ax.annotate(
            "",
            (x, after),
            (x, before),
            arrowprops={"arrowstyle": "-|>", "color": GREEN, "lw": 2.0, "shrinkA": 0, "shrinkB": 0},
        )
    ax.plot([], [], color=GREEN, lw=2.0, marker="^", label="across the fold, from the upper center")
    ax.set(xlim=(float(beta[0]), 90.0), xlabel=r"$\beta$ (°)", ylabel="force in the bearing (N)")
    ax.set_ylim(bottom=0.0)
    ax.set_title(f"$e$ = {1e3 * float(row.e):.0f} mm", fontsize="medium")
    ax.legend(frameon=False, fontsize="small", loc="lower left")


def main() -> None:
    """Map the peak load, follow one row across the folds, draw both and print the answer."""
    parts = ("equilibria", "separatrices", "separatrix_forces", "equilibrium_forces")
    ds = pk.sweep(ROTOR, beta=BETA, e=E, of=parts)
    print(f"inside the separatrix: at most {excess_inside(ds):.6f} of the peak load on it")
    best = print_least(ds)
    row = pk.sweep(ROTOR, beta=np.linspace(2.0, 90.0, 89) * pk.deg, of=parts)
    jumps = print_fold(row)

    figure, (left, right) = plt.subplots(1, 2, figsize=(13, 6.2), layout="constrained")
    bearing_load_map(ds, saddle="upper", x="beta", y="e", angles="deg", ax=left)
    left.plot(
        best / pk.deg, best.e, "o", color="white", mec=BLACK, ms=4.5, label="least for this e"
    )
    left.axhline(float(ROTOR.e), color="white", lw=0.8, ls=":")
    left.set_title("peak load of the worst swing; dots: least for this $e$", fontsize="medium")
    draw_row(right, row, jumps)
    figure.supxlabel(
        r"$a$ = 24 mm, $r$ = 200 mm, $\omega_1$ = 300 rpm, $m$ = 2 kg, $\ell$ = 200 mm; "
        "swings below turning over, larger of both bearings",
        fontsize="small",
    )
    path = sys.argv[1] if len(sys.argv) > 1 else "least_bearing_load.png"
    figure.savefig(path, dpi=150)
    print(f"wrote {path}")


if __name__ == "__main__":
    main()
