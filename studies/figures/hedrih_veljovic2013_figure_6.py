r"""
HedrihVeljovic2013, figure 6: kinetic force of B2 "in the direction of R2", for several beta
============================================================================================

The factor :math:`\Omega^2` that (17) has before :math:`\dot\varphi_2^2` makes the intensity, and
with it the force, greater by tens to hundreds, and puts the curves of the family in another
order: note the scales.

Above the intensity ``|R2| = |R022|``: (17) as printed has Omega^2 before phi'^2. Below the
force ``|F_B24| |R022|``; F_B24 is printed right. That this is what the figure shows is a reading.
Left and right have different scales.
Parameters: ``hedrih_veljovic.py``, e = 20 mm, a = 50 mm; beta is the family. None is the paper's.

Run: ``python studies/figures/hedrih_veljovic2013_figure_6.py [PICTURE]``
"""

from __future__ import annotations

import numpy as np
from hedrih_veljovic import DISK, Array, acceleration, draw, explain, panels, save

import phasekit as pk

FAMILY = {rf"$\beta$ = {deg}$^\circ$": DISK.replace(beta=deg * pk.deg) for deg in (15, 30, 45, 60)}


def printed(disk: pk.GyroRotorDisk, phi: Array, dphi: Array) -> Array:
    """Return Omega^2 sqrt([(lambda - c) s - psi c]^2 + [phi'^2]^2), (17)."""
    return np.hypot(acceleration(disk, phi), disk.coefficients().A * dphi**2)


def right(disk: pk.GyroRotorDisk, phi: Array, dphi: Array) -> Array:
    return pk.rotators(disk, phi, dphi).rotator_intensity.sel(rotator_name="R2").values


def lead(disk: pk.GyroRotorDisk) -> float:
    """Return |F_B24|."""
    Jvn = disk.inertia().Jvn
    return abs(0.5 * disk.m * disk.e * np.sin(disk.beta) - 0.5 * Jvn / disk.half_span)


def force(disk: pk.GyroRotorDisk, phi: Array, dphi: Array) -> Array:
    components = pk.bearing_forces(disk, phi, dphi).force_component
    return np.abs(components.sel(bearing="B2", component="F24").values)


def main() -> None:
    """Draw intensities and forces; print the greatest."""
    figure, axes = panels(2, sharey=False, height=7.5)
    draw(axes[0], FAMILY, printed, right, "intensity of R2 (1/s^2)")
    draw(
        axes[1],
        FAMILY,
        lambda disk, *state: lead(disk) * printed(disk, *state),
        force,
        "kinetic force at B2 along R022 (N)",
    )
    axes[0, 0].set(title="as printed, (17)", ylabel=r"$|R_2|$ (s$^{-2}$)")
    axes[1, 0].set(ylabel=r"$|F_{B24}|\,|R_{022}|$ (N)")
    axes[0, 1].set_title("correct")
    explain(axes[0, 1], two_ways=False)
    save(figure, r"$e$ = 20 mm, $a$ = 50 mm")


if __name__ == "__main__":
    main()
