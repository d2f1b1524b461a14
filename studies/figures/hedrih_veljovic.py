"""What the figures of [HedrihVeljovic2013] and [HedrihVeljovic2011] have in common.

The papers give no number for any figure: no mass, radius, eccentricity, angle, distance, span,
angular velocity or initial state. The rotor below was chosen so that the terms of the formulas are
of one size; it starts so fast that it turns over, and so passes every angle. The figures are
therefore the papers' in kind, not in number.

The printed formulas stand here, or in the study of their figure, as they are printed;
docs/errata.md says what is wrong with each. The correct curves are phasekit's.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence

import matplotlib.pyplot as plt
import numpy as np
import picture
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from numpy.typing import NDArray

import phasekit as pk

Array = NDArray[np.float64]
Formula = Callable[[pk.GyroRotorDisk, Array, Array], Array]

DISK = pk.GyroRotorDisk(
    beta=np.pi / 4, e=0.02, a=0.05, r=0.1, omega1=20.0, m=2.0, half_span=0.1, g=9.81
)
START = (0.0, 30.0)
E_MM = (5, 10, 20, 40)
ASSUMED = (
    r"Chosen here, for the paper gives no number: $m$ = 2 kg, $r$ = 100 mm, $\ell$ = 100 mm, "
    r"$\omega_1$ = 20 1/s, $g$ = 9.81 m/s$^2$," + "\n"
    r"start $\varphi_{20} = 0$, $\dot\varphi_{20}$ = 30 1/s"
)


def over_e(disk: pk.GyroRotorDisk = DISK) -> dict[str, pk.GyroRotorDisk]:
    """Return disks that differ by their eccentricity, by name."""
    return {f"$e$ = {e} mm": disk.replace(e=1e-3 * e) for e in E_MM}


def one_turn(disk: pk.GyroRotorDisk) -> tuple[Array, Array]:
    """Return phi over one turn and |phi'| of the motion from the start; NaN where it cannot be."""
    phi = np.linspace(-np.pi, np.pi, 721)
    energy = float(pk.energy(disk, *START).energy_integral)
    return phi, pk.phase_velocity(disk, phi, energy).phase_velocity.values


def acceleration(disk: pk.GyroRotorDisk, phi: Array) -> Array:
    """Return phi'' of the free motion."""
    return -pk.gradient(disk, phi).potential_gradient.values


def across(disk: pk.GyroRotorDisk, phi: Array, dphi: Array, bearing: str) -> Array:
    """Return the size of the kinetic force of a bearing across the shaft."""
    force = pk.bearing_forces(disk, phi, dphi).force_kinetic.sel(bearing=bearing)
    return np.hypot(force.sel(disk_axis="u2"), force.sel(disk_axis="v2")).values


def printed_kinetic(disk: pk.GyroRotorDisk, phi: Array, dphi: Array, bearing: str) -> Array:
    """Return the kinetic force along u2 and v2 as printed: (27) at A2, (26) at B2."""
    s, c = np.sin(phi), np.cos(phi)
    sb, cb = np.sin(disk.beta), np.cos(disk.beta)
    Ju, Jv, Jn, Jvn = disk.inertia()
    k, w1, w2 = 0.5 / disk.half_span, disk.omega1, dphi
    half, arm = 0.5 * disk.m * w1**2, disk.e * disk.a / disk.half_span * cb
    if bearing == "A2":
        F1 = k * (Jvn * w2 * c + Jn * w2) * w1
        F2 = -k * (Ju - Jv) * w1 * w2
        F3 = half * (disk.a + disk.e * sb * c - 2.0 * arm)
        F4 = 0.5 * disk.m * disk.e * sb + k * Jvn
    else:
        F1 = k * (Jvn * w1 * c - Jn * w2) * w1
        F2 = k * (Ju - Jv) * w1 * w2
        F3 = half * (disk.a + disk.e * sb * c + 2.0 * arm)
        F4 = 0.5 * disk.m * disk.e * sb - k * Jvn
    along_u2 = F1 * s + F2 * s - F3 * c + F4 * acceleration(disk, phi)
    along_v2 = F1 * c - F2 * c + F3 * s + F4 * w2**2
    return np.array([along_u2, along_v2])


def draw(
    axes: Sequence[Axes],
    family: Mapping[str, pk.GyroRotorDisk],
    printed: Formula,
    right: Formula,
    what: str,
) -> None:
    """Draw a family of curves twice: as printed, and as it is; print the greatest values."""
    colors = plt.colormaps["viridis"](np.linspace(0.0, 0.85, len(family)))
    for (name, disk), color in zip(family.items(), colors, strict=True):
        phi, speed = one_turn(disk)
        greatest = []
        for ax, formula in zip(axes, (printed, right), strict=True):
            ways = {"-": formula(disk, phi, speed), (0, (4, 2)): formula(disk, phi, -speed)}
            same = np.allclose(*ways.values(), equal_nan=True)
            for dash, values in list(ways.items())[: 1 if same else 2]:
                label = name if dash == "-" else None
                ax.plot(phi, values, color=color, linestyle=dash, linewidth=1.6, label=label)
            greatest.append(np.nanmax(np.abs(list(ways.values()))))
        plain = name.replace("$", "").replace("\\", "").replace("^circ", " deg")
        print(f"{what}, {plain}: at most {greatest[1]:.4g}, as printed {greatest[0]:.4g}")
    for ax in axes:
        circle_axis(ax)


def circle_axis(ax: Axes) -> None:
    """Show the whole circle, with ticks at quarter turns."""
    ticks = [r"$-\pi$", r"$-\pi/2$", "0", r"$\pi/2$", r"$\pi$"]
    ax.set_xticks(np.linspace(-np.pi, np.pi, 5), ticks)
    ax.set_xlim(-np.pi, np.pi)


def explain(ax: Axes, *, two_ways: bool = True, title: str | None = None) -> None:
    """Put the family's names and the meaning of the dashes beside a panel."""
    handles = [line for line in ax.lines if not line.get_label().startswith("_")]
    if two_ways:
        gray = {"color": "gray", "linewidth": 1.6}
        handles.append(Line2D([], [], label=r"$\dot\varphi_2 > 0$", **gray))
        handles.append(Line2D([], [], label=r"$\dot\varphi_2 < 0$", linestyle=(0, (4, 2)), **gray))
    ax.legend(
        handles=handles, loc="center left", bbox_to_anchor=(1.01, 0.5), frameon=False, title=title
    )


def panels(
    rows: int = 1, *, sharey: bool | str = "row", height: float = 4.6
) -> tuple[Figure, NDArray]:
    """Return a figure with two columns, "as printed" and "correct"."""
    figure, axes = plt.subplots(
        rows,
        2,
        figsize=(11, height),
        sharex=True,
        sharey=sharey,
        layout="constrained",
        squeeze=False,
    )
    for ax in axes[-1]:
        ax.set_xlabel(r"$\varphi_2$ (rad)")
    return figure, axes


def save(figure: Figure, given: str) -> None:
    """Write what is assumed under the picture, and save it: by default in the working folder."""
    figure.supxlabel(f"{ASSUMED}, {given}", fontsize="small")
    picture.save(figure)
