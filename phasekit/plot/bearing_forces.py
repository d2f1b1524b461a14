"""Bearing forces over the angle or over time."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
import xarray as xr
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.lines import Line2D
from numpy.typing import ArrayLike

from phasekit.arrays import Array
from phasekit.errors import OrbitKind, ParameterError
from phasekit.inputs import call_checked
from phasekit.labelled.loads import FRAMES
from phasekit.labelled.loads import bearing_forces as forces_of
from phasekit.labelled.motion import flow
from phasekit.labelled.orbits import orbits
from phasekit.labels.arguments import bad, named
from phasekit.phase.level_curves import LevelCurves
from phasekit.plot.parts import labels, style
from phasekit.plot.parts.circle import Circle
from phasekit.plot.parts.units import Units
from phasekit.plot.phase_portrait import starts_of
from phasekit.plot.time_history import TIME
from phasekit.systems.levels import curves_of

Frame = Literal["disk", "carrier"]

BEARINGS = ("A2", "B2")
AXES = {"disk": ("u2", "v2", "n2"), "carrier": ("u01", "v01", "n1")}
SYMBOLS = {"u2": "u_2", "v2": "v_2", "n2": "n_2", "u01": "u_{01}", "v01": "v_{01}", "n1": "n_1"}
PARTS = {
    "force": ("force of the bearing on the rotor", "force"),
    "force_kinetic": ("kinetic part of the force on the rotor", "kinetic force"),
    "force_weight": ("weight part of the force on the rotor", "weight force"),
}
STATE = ("state_phi", "state_dphi")


@call_checked
def bearing_forces(
    disk: Any,
    *,
    orbit: ArrayLike | None = None,
    x: str = "phi",
    bearing: str | None = None,
    components: str | Sequence[str] | None = None,
    part: str = "force",
    frame: Frame = "disk",
    angles: style.Angles = "rad",
    units: Mapping[str, str] | None = None,
    cut: float | None = None,
    legend: bool = True,
    ax: Axes | None = None,
) -> Axes:
    r"""Draw the forces in the bearings of the self-rotation shaft over the angle or over time.

    Over the angle, an orbit that swings passes each angle twice: triangles on the curves tell the
    way forth (:math:`\dot\varphi > 0`) from the way back.

    Parameters
    ----------
    disk : GyroRotorDisk or xarray.Dataset
        A disk whose parameters are scalars, with ``m`` and ``half_span``, and its orbit; or one
        motion over time, as `flow`, `separatrix_motion` return; or what `bearing_forces` returns
        for it.
    orbit : pair of float, optional
        Initial conditions (phi0, dphi0) in rad and rad/s, needed with a disk.
    x : {"phi", "time"}
        What to draw over: the angle, or the time, for a disk over one period of the orbit.
    bearing : {"A2", "B2"}, optional
        The bearing; both if left out.
    components : str or sequence of str, optional
        ``"magnitude"``, and axes of the frame: u2, v2, n2, or u01, v01, n1. Left out: the magnitude
        of two bearings; magnitude and components of one, for B2 across the shaft.
    part : {"force", "force_kinetic", "force_weight"}
        The force, or its kinetic part (the papers' kinetic pressure, reversed) or weight part.
    frame : {"disk", "carrier"}
        Axes of the components, which turn with the disk or with the carrier only.

    Raises
    ------
    ParameterError
        If an argument is unusable, there is more than one motion, or ``x="time"`` is asked of a
        disk for an orbit that tends to a saddle.

    Notes
    -----
    [HedrihVeljovic2013] Figures 4 to 8, eq. (22) to (27), corrected. `bearing_forces` of the
    package says where the bearings are and what the axes are.

    Examples
    --------
    >>> import phasekit as pk
    >>> disk = pk.GyroRotorDisk(
    ...     beta=1.0, e=0.01, a=0.1, r=0.1, omega1=30.0, m=2.0, half_span=0.1
    ... )
    >>> ax = pk.plot.bearing_forces(disk, orbit=(0.5, 0.0), angles="deg")
    >>> ax.get_ylabel()
    'force of the bearing on the rotor (N)'
    """
    if isinstance(disk, xr.Dataset):
        disk, shown = Units.of_dataset(disk, angles, units)
    else:
        shown = Units.from_arguments(angles, units)
    over_time = _choice("x", x, ("phi", "time")) == "time"
    if over_time and cut is not None:
        raise bad("cut", cut, "None, for the time is not on a circle")
    circle = Circle.cut_at(cut, shown.scale("phi", "rad"))
    _choice("part", part, PARTS)
    loads, phi, runs = _loads(disk, orbit, over_time, _choice("frame", frame, FRAMES))
    lines = _lines(loads[part], bearing, components, shown.scale(part, "N"))
    axes = style.axes_for(ax, legend=legend)

    factor, pace = shown.scale("phi", "rad"), shown.scale(TIME, "s")
    handles: list[Artist] = []
    for line in lines:
        handles.append(Line2D([], [], label=line.name, **line.look))
        if over_time:
            axes.plot(loads[TIME].values * pace, line.values, **line.look)
        else:
            for run in runs:
                _draw_run(axes, phi[run], line.values[run], line.look, factor, circle)
    if over_time:
        times = loads[TIME].values * pace
        axes.set_xlim(float(np.min(times)), float(np.max(times)))
        axes.set_xlabel(f"$t$ ({shown.text(TIME, 's')})")
    else:
        handles += _directions(runs, phi)
        style.circle_axis(axes, "x", shown, circle)
        axes.set_xlabel(rf"$\varphi$ ({shown.text('phi', 'rad')})")
    unit, room = shown.text(part, "N"), style.letters(axes, "y")
    axes.set_ylabel(labels.fitting(room, unit, *PARTS[part]))
    _reach(axes, lines)
    if legend:
        style.legend_below(axes, handles)
    return axes


def _choice(argument: str, value: object, names: Any) -> str:
    if not isinstance(value, str) or value not in names:
        raise bad(argument, value, f"one of {', '.join(names)}")
    return value


# ------------------------------------------------------------------------------ what is drawn


def _loads(
    disk: Any, orbit: ArrayLike | None, over_time: bool, frame: str
) -> tuple[xr.Dataset, Array, list[slice]]:
    """Return forces along a curve, its angles, and the parts in which it has one direction."""
    if isinstance(disk, xr.Dataset):
        if orbit is not None:
            raise bad("orbit", orbit, "None beside a motion, which is one")
        return _along_motion(disk, frame)
    land = curves_of(disk)
    if orbit is None:
        raise bad("orbit", None, "initial conditions (phi0, dphi0) in rad and rad/s")
    starts = starts_of(land, orbit)
    if len(starts) != 1:
        raise bad("orbit", orbit, "one pair (phi0, dphi0)")
    phi0, dphi0 = starts[0]
    if over_time:
        period = float(orbits(disk, phi0, dphi0).period)
        if not np.isfinite(period):
            raise ParameterError(
                f"x: got 'time' for the orbit through ({phi0:g}, {dphi0:g}), which takes for ever; "
                "give a motion: pk.flow(disk, phi0, dphi0, times)"
            )
        return _along_motion(flow(disk, phi0, dphi0, np.linspace(0.0, period, 721)), frame)
    phi, dphi, runs = _states(disk, land, phi0, dphi0)
    return forces_of(disk, phi, dphi, frame=frame), phi, runs


def _states(
    disk: Any, land: LevelCurves, phi0: float, dphi0: float
) -> tuple[Array, Array, list[slice]]:
    """Return the states of an orbit, forth and back if it swings."""
    kind = orbits(disk, phi0, dphi0).orbit_kind
    energy = land.energy(phi0, dphi0)
    arcs = land.arcs(energy, phi0)
    if int(kind) == OrbitKind.EQUILIBRIUM or not arcs:
        return np.array([phi0]), np.array([dphi0]), [slice(0, 1)]
    rotates = arcs[0] == land.window
    phi, speed = land.curve(arcs[0], energy, whole=not rotates)
    if rotates:
        way = slice(None) if dphi0 >= 0.0 else slice(None, None, -1)
        return phi[way], float(np.copysign(1.0, dphi0)) * speed[way], [slice(0, phi.size)]
    half = phi.size // 2
    return phi, speed, [slice(0, half), slice(half, phi.size)]


def _along_motion(dataset: xr.Dataset, frame: str) -> tuple[xr.Dataset, Array, list[slice]]:
    """Return the forces along one motion; cut where it turns back, and at the ends."""
    given = "force" in dataset
    names = STATE if given else ("motion_phi", "motion_dphi")
    if any(name not in dataset or dataset[name].dims != (TIME,) for name in names):
        got = dict(dataset.sizes) or "no dims"
        raise ParameterError(
            f"disk: got a Dataset with {got}, wants a disk, one motion along the dim 'time', such "
            "as pk.flow returns for one state, or pk.bearing_forces of it"
        )
    labels.monotone(dataset[TIME], "time")
    phi, dphi = (np.asarray(dataset[name].values, dtype=float) for name in names)
    if not given:
        system: Any = labels.system_of(dataset, "disk", "pk.bearing_forces")
        dataset = forces_of(system, dataset, frame=frame)
    forth = np.diff(phi) >= 0.0
    ends = [0, *(np.flatnonzero(forth[1:] != forth[:-1]) + 1).tolist(), phi.size - 1]
    # Runs share their ends, so that the curve has no gaps.
    runs = [slice(i, j + 1) for i, j in zip(ends[:-1], ends[1:], strict=True)]
    return dataset, phi, runs


@dataclass(frozen=True)
class _Line:
    name: str
    positive: bool
    values: Array
    look: style.Look


def _lines(
    force: xr.DataArray, bearing: str | None, components: str | Sequence[str] | None, scale: float
) -> list[_Line]:
    """Return the lines to draw: names, values along the curve, looks."""
    frame = next(name for name in FRAMES if f"{name}_axis" in force.dims)
    axis, offered = f"{frame}_axis", ("magnitude", *AXES[frame])
    bearings = BEARINGS if bearing is None else (_choice("bearing", bearing, BEARINGS),)
    if components is None:
        # B2 takes no force along the shaft.
        along = "n2" if frame == "disk" else "u01"
        some = [name for name in offered if bearing == "A2" or name != along]
        components = "magnitude" if bearing is None else some
    names = [components] if isinstance(components, str) else components
    if not isinstance(names, Sequence) or not names:
        raise bad("components", components, f"some of {', '.join(offered)}")
    for name in names:
        named("component", name, offered)
    lines = []
    for i, which in enumerate(bearings):
        for k, name in enumerate(names):
            one = force.sel(bearing=which)
            size = name == "magnitude"
            values = (one**2).sum(axis, skipna=False) ** 0.5 if size else one.sel({axis: name})
            symbol = f"F_{{{which[0]}2}}" if size else f"F_{{{which[0]}2,{SYMBOLS[name]}}}"
            text = f"$|{symbol}|$" if size else f"${symbol}$"
            # The color tells bearings, if there are two; the dashes tell components, if several.
            color = style.LOAD_COLORS[i if len(bearings) > 1 else k]
            dash = style.ORBIT_DASHES[k if len(names) > 1 else i]
            look = {"color": color, "linestyle": dash, "linewidth": 1.8}
            lines.append(_Line(text, size, np.asarray(values.values, dtype=float) * scale, look))
    return lines


def _reach(ax: Axes, lines: list[_Line]) -> None:
    """Show magnitudes from 0 on, and all lines clear of the frame."""
    values = np.concatenate([line.values[np.isfinite(line.values)] for line in lines])
    if values.size and all(line.positive for line in lines):
        ax.set_ylim(0.0, 1.08 * float(values.max()) or 1.0)
    elif values.size:
        middle, half = 0.5 * (values.max() + values.min()), 0.54 * float(np.ptp(values))
        half = half or abs(float(middle)) or 1.0
        ax.set_ylim(middle - half, middle + half)


# ------------------------------------------------------------------------------ strokes


def _draw_run(
    ax: Axes,
    phi: Array,
    values: Array,
    look: style.Look,
    factor: float,
    circle: Circle,
) -> None:
    """Draw one way over the circle, with triangles that point along it."""
    if float(np.ptp(phi)) == 0.0:  # at rest
        x, y = circle.points(phi[:1], values[:1])
        ax.plot(x * factor, y, "o", color=look["color"], clip_on=False)
        return
    x, y = _on_circle(phi, values, circle)
    ax.plot(x * factor, y, **look)
    marker = ">" if phi[-1] > phi[0] else "<"
    there = np.linspace(0.0, 1.0, 8)[1:-1:2] if marker == ">" else np.linspace(0.0, 1.0, 8)[2:-1:2]
    order = np.argsort(phi)
    low, high = float(np.min(phi)), float(np.max(phi))
    if high - low > 2.0 * np.pi:  # several turns: mark one
        low, high = high - 2.0 * np.pi, high
    places = low + (high - low) * there
    heights = np.interp(places, phi[order], values[order])
    color = look["color"]
    ax.plot(circle.home(places) * factor, heights, marker, color=color, markersize=5.5)


def _on_circle(phi: Array, values: Array, circle: Circle) -> tuple[Array, Array]:
    """Return a curve on the circle, broken where it passes the cut."""
    turn = np.round((phi - circle.low) / (2.0 * np.pi) - 0.5)
    pieces: list[tuple[Array, Array]] = []
    for k in np.arange(turn.min(), turn.max() + 1.0):
        near = np.flatnonzero(turn == k)
        if near.size:
            # One point more on either side; the axes clip what lies outside.
            part = slice(max(near[0] - 1, 0), near[-1] + 2)
            pieces.append((phi[part] - 2.0 * np.pi * k, values[part]))
    gap = np.array([np.nan])
    x = np.concatenate([piece for part in pieces for piece in (part[0], gap)])
    y = np.concatenate([piece for part in pieces for piece in (part[1], gap)])
    return x[:-1], y[:-1]


def _directions(runs: list[slice], phi: Array) -> list[Artist]:
    """Return what explains the triangles, where both directions occur."""
    ways = {bool(phi[run][-1] > phi[run][0]) for run in runs if float(np.ptp(phi[run])) > 0.0}
    if len(ways) < 2:
        return []
    look: style.Look = {"color": style.GRAY, "linestyle": "none", "markersize": 5.5}
    return [
        Line2D([], [], marker=">", label=r"$\dot\varphi > 0$", **look),
        Line2D([], [], marker="<", label=r"$\dot\varphi < 0$", **look),
    ]
