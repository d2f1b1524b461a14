"""Hodographs of rotators: the curves that their tips draw."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, Literal

import numpy as np
import xarray as xr
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from numpy.typing import ArrayLike

from phasekit.arrays import Array
from phasekit.errors import Loop, ParameterError
from phasekit.inputs import call_checked
from phasekit.labelled.energy import gradient
from phasekit.labelled.loads import is_disk, rotators
from phasekit.labels.arguments import bad, flag, unknown
from phasekit.laws.trigonometric import Trigonometric
from phasekit.mechanics.rotators import ROTATORS
from phasekit.phase.exact.potential import gradient as slope
from phasekit.phase.level_curves import Arc
from phasekit.plot.parts import labels, strokes, style
from phasekit.plot.parts.circle import Circle
from phasekit.plot.parts.units import Units
from phasekit.plot.phase_portrait import levels_of, starts_of
from phasekit.plot.time_history import TIME, motions_of
from phasekit.systems.levels import curves_of
from phasekit.systems.system import as_system

Plane = tuple[str, str]

CARRIER_AXES = ("u01", "v01", "n1")
AXIS_SYMBOLS = {"u01": "$u_{01}$", "v01": "$v_{01}$", "n1": "$n_1$"}
# The plane in which a rotator turns; that of R022 turns with the disk, and is named by None.
PLANES: dict[str, Plane | None] = {
    **dict.fromkeys(ROTATORS, ("u01", "v01")),
    "R022": None,
    "R2": ("v01", "n1"),
    "R12c": ("v01", "n1"),
}


@call_checked
def hodograph(
    system: Any,
    rotator: str = "R022",
    *,
    energies: ArrayLike | None = None,
    orbits: ArrayLike | None = None,
    plane: Sequence[str] | None = None,
    angles: style.Angles = "rad",
    units: Mapping[str, str] | None = None,
    legend: bool = True,
    ax: Axes | None = None,
) -> Axes:
    r"""Draw the hodograph of a rotator: the curve of its tip along orbits or motions.

    The rotator R022 of the self-rotation is drawn in axes that turn with the disk: tangential
    :math:`u = \ddot\varphi`, radial :math:`v = \dot\varphi^2`. Its hodograph is the same for both
    directions of :math:`\dot\varphi`, equilibria are at the origin, and those of two energies are
    the same curve at different heights, cut off at :math:`v = 0`. Both axes have one scale, so
    that lengths and angles are those of the vectors.

    Parameters
    ----------
    system
        A system whose parameters are scalars; for other rotators than R022 a disk. Or a Dataset:
        motions over time, as `flow` and `separatrix_motion` return, or their rotators, as
        `rotators` returns.
    rotator : str
        Name of the rotator: R01, R011, R022, R012, R1, R2, R12, R12c.
    energies : float or sequence of float, optional
        Energies (s^-2) of the orbits. If neither energies nor orbits are given, those of a phase
        portrait are drawn, with the separatrices.
    orbits : array_like, optional
        Initial conditions (phi0, dphi0) in rad and rad/s, one pair or an array of pairs.
    plane : pair of {"u01", "v01", "n1"}, optional
        Axes of the carrier on which the rotator is projected; left out, the plane in which it
        turns.
    angles : {"rad", "deg"}
        Unit in which angles are shown in the legend.
    units : mapping of str to str, optional
        Units in which quantities and parameters are shown, by name: ``{"rotator": "deg/s2"}``.

    Raises
    ------
    ParameterError
        If an argument is unusable, or there are more motions than can be told apart.

    Notes
    -----
    [HedrihVeljovic2011] Figures 6, 7 and 9, eq. (6.11), corrected: :math:`v` has no factor
    :math:`\Omega^2`.

    Examples
    --------
    >>> import phasekit as pk
    >>> ax = pk.plot.hodograph(pk.Reduced(lam=0.4, psi=0.1), orbits=(0.3, 0.0))
    >>> ax.get_ylabel()
    '$\\dot\\varphi^2$, radial (s$^{-2}$)'
    """
    if not isinstance(rotator, str) or rotator not in ROTATORS:
        raise unknown("rotator", rotator, ROTATORS)
    flag("legend", legend)
    shown = Units.from_arguments(angles, units)
    pair = _plane_of(rotator, plane)
    if isinstance(system, xr.Dataset):
        system, shown = Units.of_dataset(system, angles, units)
        if energies is not None or orbits is not None:
            name = "energies" if energies is not None else "orbits"
            raise ParameterError(f"{name}: got one beside motions, wants None: motions are orbits")
        curves = _along_motions(system, rotator, pair, shown)
        axes = style.axes_for(ax, legend=legend and len(curves) > 1)
        handles = _draw_motions(axes, curves)
    else:
        tip = _Tip(system, rotator, pair, shown)
        axes = style.axes_for(ax, legend=legend)
        handles = _draw_levels(axes, tip, energies, orbits)
    axes.set_aspect("equal", adjustable="datalim")
    style.few_ticks(axes)
    for which, texts in _words(rotator, pair).items():
        room, unit = style.letters(axes, which), shown.text("rotator", "s-2")
        axes.set(**{f"{which}label": labels.fitting(room, unit, *texts)})
    if legend:
        style.legend_below(axes, handles)
    return axes


def _stroke(ax: Axes, u: Array, v: Array, **look: Any) -> list[Any]:
    """Draw a curve; one that is a point, as of R01, as a dot on axes that reach to the origin."""
    if u.size == 0 or np.ptp(u) != 0.0 or np.ptp(v) != 0.0:
        return ax.plot(u, v, **look)
    ax.update_datalim([(0.0, 0.0)])
    return ax.plot(u, v, marker="o", **look)


def _plane_of(rotator: str, plane: Sequence[str] | None) -> Plane | None:
    if plane is None:
        return PLANES[rotator]
    names = list(plane) if isinstance(plane, Sequence) and not isinstance(plane, str) else []
    known = all(isinstance(name, str) and name in CARRIER_AXES for name in names)
    if len(names) != 2 or not known or names[0] == names[1]:
        raise bad("plane", plane, f"a pair of {', '.join(CARRIER_AXES)}")
    return names[0], names[1]


def _words(rotator: str, plane: Plane | None) -> dict[Literal["x", "y"], tuple[str, str]]:
    """Return what stands at both axes, at length and in short."""
    if plane is None:
        across, up = r"$\ddot\varphi$", r"$\dot\varphi^2$"
        return {"x": (f"{across}, tangential", across), "y": (f"{up}, radial", up)}
    across, up = (AXIS_SYMBOLS[name] for name in plane)
    return {"x": (f"{rotator} along {across}", across), "y": (f"{rotator} along {up}", up)}


class _Tip:
    """Where the tip of a rotator of one system lies at given states."""

    def __init__(self, system: Any, rotator: str, plane: Plane | None, shown: Units) -> None:
        self.system = as_system(system, rung=Trigonometric, what="a hodograph")
        self.land = curves_of(self.system)
        self.rotator, self.plane = rotator, plane
        self.units, self.scale = shown, shown.scale("rotator", "s-2")
        self.disk = None if plane is None else _disk(system)

    def __call__(self, phi: Array, speed: Array) -> tuple[Array, Array]:
        if self.plane is None or self.disk is None:
            pull = slope(*self.system.coefficients(), phi)
            return -self.scale * pull, self.scale * speed**2
        tips = rotators(self.disk, phi, speed).rotator.sel(rotator_name=self.rotator)
        first, second = (tips.sel(carrier_axis=n).values * self.scale for n in self.plane)
        return first, second

    def branches(self, energy: float, arc: Arc, turning: bool) -> list[Any]:
        """Return the curves of a level over an arc."""
        if self.plane is not None and not turning:
            return [self(*self.land.curve(arc, energy, whole=True))]
        phi, speed = self.land.curve(arc, energy)
        return [self(phi, sign * speed) for sign in ((1.0,) if self.plane is None else (1.0, -1.0))]


def _draw_levels(
    ax: Axes, tip: _Tip, energies: ArrayLike | None, orbits: ArrayLike | None
) -> list[Artist]:
    """Draw the hodographs of levels, of separatrices where nothing is asked for, of orbits."""
    land = tip.land
    starts = [] if orbits is None else starts_of(land, orbits)
    chosen = [] if energies is None else levels_of(land, energies)
    if energies is None and orbits is None:
        chosen = land.levels()
    for level in chosen:
        for arc in land.arcs(*level):
            look = strokes.level_look(land, arc)
            for u, v in tip.branches(level[0], arc, land.turns(arc)):
                _stroke(ax, u, v, zorder=1, **look)
    handles = _draw_separatrices(ax, tip) if energies is None and orbits is None else []
    for number, start in enumerate(starts):
        handles += _draw_orbit(ax, tip, start, number)
    if tip.plane is None and land.answers.phi.size:
        handles += ax.plot(0.0, 0.0, zorder=5, **style.ORIGIN)
    return handles


def _draw_separatrices(ax: Axes, tip: _Tip) -> list[Artist]:
    handles: dict[Loop, Artist] = {}
    for energy, arc, loop in tip.land.separatrices:
        for u, v in tip.branches(energy, arc, loop == Loop.WINDING):
            (handles[loop],) = _stroke(ax, u, v, zorder=3, **style.inked(strokes.LOOPS[loop]))
    return list(handles.values())


def _draw_orbit(ax: Axes, tip: _Tip, start: tuple[float, float], number: int) -> list[Artist]:
    land, look = tip.land, strokes.orbit_look(number)
    for energy, arc in land.orbit_levels(*start):
        if arc == land.window:
            phi, speed = land.curve(arc, energy)
            curves: list[Any] = [tip(phi, speed if start[1] >= 0.0 else -speed)]
        else:
            curves = tip.branches(energy, arc, False)
        for u, v in curves:
            _stroke(ax, u, v, zorder=4, **look)
    u, v = tip(np.array([start[0]]), np.array([start[1]]))
    scale = (tip.units.scale("phi", "rad"), tip.units.scale("dphi", "s-1"))
    name = strokes.start_name(Circle(), start, scale)
    (handle,) = ax.plot(u, v, zorder=6, label=name, **strokes.START, **look)
    return [handle]


def _along_motions(
    dataset: xr.Dataset, rotator: str, plane: Plane | None, shown: Units
) -> dict[str, tuple[Array, Array]]:
    """Return the curves of one motion or several, under what tells each from the others."""
    telling = "motion_phi" if "motion_phi" in dataset else "hodograph_u"
    if telling not in dataset or TIME not in dataset[telling].dims:
        raise ParameterError(
            "system: got a Dataset without motions along the dim 'time', wants a system, motions "
            "over time, such as pk.flow returns, or their rotators (pk.rotators)"
        )
    names = motions_of(dataset[telling], TIME, shown)
    pair = _components(dataset, rotator, plane)
    others = [dim for dim in dataset[telling].dims if dim != TIME]
    scale = shown.scale("rotator", "s-2")
    flat = [array.transpose(*others, TIME).values.reshape(len(names), -1) for array in pair]
    flat = [scale * values for values in flat]
    return dict(zip(names, zip(*flat, strict=True), strict=True))


def _components(
    dataset: xr.Dataset, rotator: str, plane: Plane | None
) -> tuple[xr.DataArray, xr.DataArray]:
    """Return both components of the rotator along motions, or out of rotators."""
    if plane is None and "hodograph_u" in dataset:
        return dataset["hodograph_u"], dataset["hodograph_v"]
    if "rotator" not in dataset:
        system = labels.system_of(dataset, "system", "pk.rotators")
        if plane is None:
            pull = gradient(system, dataset["motion_phi"]).potential_gradient
            return -pull, dataset["motion_dphi"] ** 2
        dataset = rotators(_disk(system), dataset)
    tips = dataset["rotator"].sel(rotator_name=rotator)
    first, second = (tips.sel(carrier_axis=name) for name in plane or CARRIER_AXES[1:])
    return first, second


def _disk(system: Any) -> Any:
    disk = as_system(system)
    if not is_disk(disk):
        raise bad("system", system, "a GyroRotorDisk, for a rotator along the carrier's axes")
    return disk


def _draw_motions(ax: Axes, curves: dict[str, tuple[Array, Array]]) -> list[Artist]:
    handles: list[Artist] = []
    for number, (name, (u, v)) in enumerate(curves.items()):
        look = strokes.orbit_look(number) if len(curves) > 1 else style.MOTION
        handles += _stroke(ax, u, v, label=name, **look)
    return handles if len(curves) > 1 else []
