"""Force polygon of one bearing, in the plane that is square to the shaft."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Literal

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.lines import Line2D
from matplotlib.patches import FancyArrowPatch

from phasekit.arrays import Array
from phasekit.errors import ParameterError
from phasekit.inputs import call_checked
from phasekit.labelled.loads import bearing_forces
from phasekit.labels.arguments import bad
from phasekit.plot.parts import labels, style
from phasekit.plot.parts.units import Units

BEARINGS = ("A2", "B2")
# What the papers' components are due to, with the directions that they have.
SIDES = {
    "F21": "along $w_1$",
    "F22": "along $w_2$",
    "F23": "along $w_3$",
    "F24": "along $R_{022}$",
    "weight": "weight",
}
AXES: dict[Literal["x", "y"], tuple[str, str]] = {
    "x": ("along $u_2$, tangential", "$u_2$"),
    "y": ("along $v_2$, radial, inward", "$v_2$"),
}
# An arrow this short (inches) is named in the legend only.
SHORT = 0.4


@call_checked
def force_polygon(
    disk: Any,
    phi: float,
    dphi: float,
    *,
    bearing: str = "A2",
    units: Mapping[str, str] | None = None,
    legend: bool = True,
    ax: Axes | None = None,
) -> Axes:
    r"""Draw the parts of a bearing's force on the rotor head to tail, and their resultant.

    The plane is square to the shaft; its axes turn with the disk: :math:`u_2` is tangential,
    :math:`v_2` points inward, from the mass center's side to the shaft. The parts are the papers'
    components of the kinetic force, along :math:`w_1 = n_1` (up),
    :math:`w_2 = \sin\varphi\,u_2 - \cos\varphi\,v_2`, :math:`w_3 = -v_{01}` and the rotator
    :math:`R_{022}`, and the weight part. The axial force stands out of this plane.

    Parameters
    ----------
    disk : GyroRotorDisk
        A disk whose parameters are scalars, with ``m`` and ``half_span``.
    phi, dphi : float
        The state: angle in rad, angular velocity in s^-1. The shaft turns freely in its bearings.
    bearing : {"A2", "B2"}
        The bearing.
    units : mapping of str to str, optional
        Units in which quantities and parameters are shown, by name: ``{"force": "kN"}``.
    legend : bool
        Whether to name the parts and their sizes under the axes.
        A given figure without layout engine gets the constrained one then.

    Notes
    -----
    [HedrihVeljovic2013] (26) to (28) and the components after them, corrected.

    Examples
    --------
    >>> import phasekit as pk
    >>> disk = pk.GyroRotorDisk(
    ...     beta=1.0, e=0.01, a=0.1, r=0.1, omega1=30.0, m=2.0, half_span=0.1
    ... )
    >>> ax = pk.plot.force_polygon(disk, 0.5, 2.0, bearing="B2")
    >>> ax.get_xlabel()
    'along $u_2$, tangential (N)'
    """
    if not isinstance(bearing, str) or bearing not in BEARINGS:
        raise bad("bearing", bearing, f"one of {', '.join(BEARINGS)}")
    shown = Units.from_arguments("rad", units)
    scale, unit = shown.scale("force", "N"), shown.text("force", "N")
    loads = bearing_forces(disk, phi, dphi).sel(bearing=bearing)
    if loads.sizes.keys() - {"disk_axis", "component"}:
        raise ParameterError(
            f"disk, phi, dphi: got {dict(loads.sizes)}, wants one disk in one state"
        )
    total = np.asarray(loads.force.values[:2], dtype=float)
    speed = float(loads.state_dphi) ** 2 if abs(float(loads.state_dphi)) < 1e150 else np.inf
    if not np.isfinite([*total, speed]).all():
        raise bad("disk", disk, "a state whose forces are finite")
    angle = float(loads.state_phi)
    weight = loads.force_weight.values[:2]
    parts = _parts(loads.force_component.values, weight, angle, speed, disk)
    axes = style.axes_for(ax, legend=legend)

    parts = {name: side * scale for name, side in parts.items()}
    total = total * scale
    corners = np.concatenate([[np.zeros(2)], np.cumsum(list(parts.values()), axis=0)])
    span = float(np.ptp(corners, axis=0).max()) or 1.0
    sizes = [float(np.hypot(*side)) for side in (*parts.values(), total)]
    handles: list[Artist] = []
    for (name, side), look in zip(parts.items(), style.POLYGON, strict=True):
        start = corners[len(handles)]
        handles.append(_arrow(axes, start, start + side, name, SIDES[name], look, span))
    handles.append(_arrow(axes, np.zeros(2), total, "F", "sum", style.inked(style.RESULTANT), span))

    axes.update_datalim(corners)
    axes.margins(0.1)
    axes.autoscale_view()
    axes.set_aspect("equal", adjustable="datalim")
    style.few_ticks(axes)
    for which, texts in AXES.items():
        axes.set(**{f"{which}label": labels.fitting(style.letters(axes, which), unit, *texts)})
    axes.set_title(f"bearing {bearing[0]}$_2$", fontsize="medium")
    if legend:
        names: dict[str, str] = {}
        for handle, size in zip(handles, sizes, strict=True):
            name = str(handle.get_label())
            value = f": {size:.4g} {unit}"
            handle.set_label(name + value)
            names[name + value] = name.split(",")[0] + value
        style.legend_below(axes, handles, names)
    return axes


def _parts(
    components: Array, weight: Array, phi: float, speed: float, disk: Any
) -> dict[str, Array]:
    """Return the parts of the force in the plane (u2, v2), in the order of the polygon.

    `speed` is the square of the angular velocity.
    """
    s, c = np.sin(phi), np.cos(phi)
    A, B, C = disk.coefficients()
    rotator = np.array([-((B - A * c) * s - C * c), speed])
    length = float(np.hypot(*rotator))
    directions = [
        np.array([s, c]),
        np.array([s, -c]),
        np.array([-c, s]),
        rotator / length if length > 0.0 else np.zeros(2),
    ]
    # A component of no size may have no direction either.
    sides = [np.nan_to_num(x) * w for x, w in zip(components, directions, strict=True)]
    return dict(zip(SIDES, [*sides, np.asarray(weight, dtype=float)], strict=True))


def _arrow(
    ax: Axes,
    start: Array,
    end: Array,
    name: str,
    along: str,
    look: style.Look,
    span: float,
) -> Artist:
    """Draw one side of the polygon; return what explains it."""
    size = float(np.hypot(*(end - start)))
    arrow = FancyArrowPatch(
        (start[0], start[1]),
        (end[0], end[1]),
        arrowstyle="-|>",
        mutation_scale=14.0,
        shrinkA=0.0,
        shrinkB=0.0,
        **look,
    )
    ax.add_patch(arrow)
    symbol = f"$F_{{{name[1:]}}}$" if name[1:].isdigit() else {"F": "$F$"}.get(name, name)
    if size * min(style.inches(ax)) > SHORT * span:
        across, up = (start[1] - end[1]) / size, (end[0] - start[0]) / size
        x, y = 0.5 * (start + end)
        ax.annotate(
            symbol,
            (x, y),
            xytext=(4.0 * across, 4.0 * up),
            textcoords="offset points",
            color=look["color"],
            ha="center" if abs(across) < 0.3 else "left" if across > 0.0 else "right",
            va="center" if abs(up) < 0.3 else "bottom" if up > 0.0 else "top",
            fontsize="small",
            path_effects=style.halo(plt.rcParams["axes.facecolor"], 2.5),
        )
    meaning = "" if name == "weight" else f", {along}"
    key = {name: look[name] for name in ("color", "linestyle", "linewidth")}
    return Line2D([], [], label=f"{symbol}{meaning}", **key)
