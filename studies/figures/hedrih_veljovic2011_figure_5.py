r"""
HedrihVeljovic2011, figure 5: intensity of R022, which is that of R2, over the angle
====================================================================================

(6.8) as printed is greater by about :math:`\Omega^2`, which depends on :math:`e` and
:math:`\beta`.

Left (6.8) as printed, with Omega^2 before phi'^2; right phasekit's; the scales differ.
Families over e, beta, a, psi.
Parameters: ``hedrih_veljovic.py``, e = 20 mm,
beta = 45 deg, a = 50 mm where they are not the family.
No parameter of the disk changes psi alone: there Omega^2 = 4 1/s^2, lambda = 0.4 and the start
phi20 = 0, phi20' = 5 1/s. None of these numbers is the paper's.

Run: ``python studies/figures/hedrih_veljovic2011_figure_5.py [PICTURE]``
"""

from __future__ import annotations

import matplotlib.pyplot as plt
import numpy as np
from hedrih_veljovic import (
    DISK,
    Array,
    acceleration,
    circle_axis,
    draw,
    explain,
    over_e,
    panels,
    save,
)

import phasekit as pk

FAMILIES = {
    "e": over_e(),
    "beta": {rf"$\beta$ = {d}$^\circ$": DISK.replace(beta=d * pk.deg) for d in (15, 30, 45, 60)},
    "a": {f"$a$ = {mm} mm": DISK.replace(a=1e-3 * mm) for mm in (0, 20, 50, 100)},
}
PSI, OMEGA_SQ, SPEED = (0.0, 0.2, 0.5, 1.0), 4.0, 5.0


def printed(disk: pk.GyroRotorDisk, phi: Array, dphi: Array) -> Array:
    """Return Omega^2 sqrt([(lambda - c) s - psi c]^2 + [phi'^2]^2), (6.8)."""
    return np.hypot(acceleration(disk, phi), disk.coefficients().A * dphi**2)


def right(disk: pk.GyroRotorDisk, phi: Array, dphi: Array) -> Array:
    return pk.rotators(disk, phi, dphi).rotator_intensity.sel(rotator_name="R022").values


def main() -> None:
    """Draw the families; print the greatest intensities."""
    figure, axes = panels(4, sharey=False, height=13.0)
    for row, family in zip(axes, FAMILIES.values(), strict=False):
        draw(row, family, printed, right, "intensity of R022 (1/s^2)")
    phi = np.linspace(-np.pi, np.pi, 721)
    colors = plt.colormaps["viridis"](np.linspace(0.0, 0.85, len(PSI)))
    for psi, color in zip(PSI, colors, strict=True):
        system = pk.Reduced(lam=0.4, psi=psi, Omega_sq=OMEGA_SQ)
        energy = float(pk.energy(system, 0.0, SPEED).energy_integral)
        v = pk.phase_velocity(system, phi, energy).phase_velocity.values ** 2
        u = -pk.gradient(system, phi).potential_gradient.values
        for ax, factor in zip(axes[3], (OMEGA_SQ, 1.0), strict=True):
            ax.plot(phi, np.hypot(u, factor * v), color=color, label=rf"$\psi$ = {psi}")
            circle_axis(ax)
    for row in axes:
        row[0].set_ylabel(r"$|R_{022}|$ (s$^{-2}$)")
        explain(row[1], two_ways=False)
    axes[0, 0].set_title("as printed, (6.8)")
    axes[0, 1].set_title("correct")
    save(
        figure,
        r"$e$ = 20 mm, $\beta = \pi/4$, $a$ = 50 mm where not the family;"
        "\n"
        r"last row: $\Omega^2$ = 4 1/s$^2$, $\lambda$ = 0.4, $\dot\varphi_{20}$ = 5 1/s",
    )


if __name__ == "__main__":
    main()
