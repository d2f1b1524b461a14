"""Periods and frequencies of all orbits of one system."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, TypeAlias

import numpy as np
import xarray as xr
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.lines import Line2D

from phasekit.errors import EquilibriumKind
from phasekit.inputs import call_checked
from phasekit.labelled.families import orbit_families, with_families
from phasekit.labelled.phase_space import equilibria, separatrices
from phasekit.labels.arguments import FloatArray, bad
from phasekit.laws.trigonometric import Trigonometric
from phasekit.plot.parts import labels, strokes, style
from phasekit.plot.parts.units import Units
from phasekit.systems.system import single

#: Energies of saddles, with the names of their looks.
Walls: TypeAlias = list[tuple[str, float]]

# Where a family begins: the row of its center among the equilibria.
CENTERS = {"lower_well": 0, "upper_well": 2}


@call_checked
def period_energy(
    system: Any,
    n: int = 200,
    *,
    energy_max: float | None = None,
    units: Mapping[str, str] | None = None,
    legend: bool = True,
    ax: Axes | None = None,
) -> Axes:
    r"""Draw the period of all orbits against their energy.

    Each family of orbits has a curve: those in the lower and in the upper well, those round both,
    and the rotations, whose period is the time of one turn. The curves leave the centers at the
    period of small oscillations and rise without bound at the energies of the saddles, like a
    logarithm.

    Parameters
    ----------
    system
        A system whose parameters are scalars.
    n : int
        Number of orbits in each family.
    energy_max : float, optional
        Greatest energy (s^-2); left out, rotations are followed some way above the saddles.
    units : mapping of str to str, optional
        Units in which quantities and parameters are shown, by name: ``{"period": "ms"}``.

    Notes
    -----
    The energy is that of [Veljovic2015] eq. (14). Where there are two wells, their orbits of one
    energy have the same period, however different the wells are: the curves of both lie on one
    line.

    Examples
    --------
    >>> import phasekit as pk
    >>> ax = pk.plot.period_energy(pk.Reduced(lam=0.4, psi=0.1))
    >>> ax.get_xlabel()
    'energy $h$ (s$^{-2}$)'
    """
    shown = Units.from_arguments("rad", units)
    families, points, loops = _families(system, n, energy_max, shown)
    axes = style.axes_for(ax, legend=legend)

    natural, bottom = points.natural_frequency.values, points.energy.values
    with np.errstate(all="ignore"):  # of frequencies below the smallest double
        periods = shown.scale("period", "s") * 2.0 * np.pi / natural
    ends = (bottom, periods)
    walls = _saddles(loops)
    handles = _draw_families(axes, families, points, walls, ("energy_level", "period"), ends)
    handles += _draw_walls(axes, points, walls)
    handles += _draw_centers(axes, bottom, periods)

    energies = families.energy_level
    low = min([float(energies.min()), *bottom[np.isfinite(natural)]])
    high = float(energies.max())
    axes.set_xlim(low - 0.04 * (high - low), high)
    # A family too narrow to be seen must not take the height.
    seen = energies.max("level") - energies.min("level") > 0.02 * (high - low)
    middle = families.period.median("level").where(seen).values
    heights = np.array([*(1.8 * middle), *(2.0 * periods)])
    axes.set_ylim(0.0, float(np.max(heights, where=np.isfinite(heights), initial=0.0)) or None)
    axes.set_xlabel(labels.with_unit("energy $h$", shown.text("energy", "s-2")))
    axes.set_ylabel(labels.with_unit("period $T$", shown.text("period", "s")))
    if legend:
        style.legend_below(axes, handles)
    return axes


@call_checked
def frequency_action(
    system: Any,
    n: int = 200,
    *,
    energy_max: float | None = None,
    units: Mapping[str, str] | None = None,
    legend: bool = True,
    ax: Axes | None = None,
) -> Axes:
    r"""Draw the frequency of all orbits against their action.

    Each family of orbits has a curve. Those of the wells leave the axis of zero action at the
    natural frequency of the center; on a separatrix the frequency is zero. The action is the area
    inside an orbit over :math:`2\pi`, of a rotation the area under one turn.

    Parameters
    ----------
    system
        A system whose parameters are scalars.
    n : int
        Number of orbits in each family.
    energy_max : float, optional
        Greatest energy (s^-2); left out, rotations are followed some way above the saddles.
    units : mapping of str to str, optional
        Units in which quantities and parameters are shown, by name: ``{"period": "ms"}``.

    Notes
    -----
    The frequency is the derivative of the energy with respect to the action; the slope of the
    curve is the twist.

    Examples
    --------
    >>> import phasekit as pk
    >>> ax = pk.plot.frequency_action(pk.Pendulum(length=1.0))
    >>> ax.get_ylabel()
    'frequency $\\omega$ (rad/s)'
    """
    shown = Units.from_arguments("rad", units)
    families, points, loops = _families(system, n, energy_max, shown)
    natural = points.natural_frequency.values * shown.scale("frequency", "rad/s")
    axes = style.axes_for(ax, legend=legend)

    rest = np.zeros(natural.shape)
    ends = (rest, natural)
    handles = _draw_families(axes, families, points, _saddles(loops), ("action", "frequency"), ends)
    handles += _draw_centers(axes, rest, natural)
    axes.set_xlim(0.0, 1.03 * float(families.action.max()))
    axes.set_ylim(0.0, 1.05 * float(np.nanmax([float(families.frequency.max()), *natural])))
    axes.set_xlabel("action $J$ (rad$^2$/s)")
    axes.set_ylabel(labels.with_unit(r"frequency $\omega$", shown.text("frequency", "rad/s")))
    if legend:
        style.legend_below(axes, handles)
    return axes


def _families(
    system: Any, n: int, energy_max: float | None, shown: Units
) -> tuple[xr.Dataset, xr.Dataset, xr.Dataset]:
    """Return the families of orbits of one system, its equilibria and its separatrices."""
    single(system)
    model = with_families(system, "a family of orbits")
    if issubclass(model.rung, Trigonometric) and not any(model.coefficients()):
        raise bad("system", system, "a system with a force; without one nothing oscillates")
    families = orbit_families(system, n, energy_max=energy_max)
    points, loops = equilibria(system), separatrices(system)
    families = families.assign(
        energy_level=families.energy_level * shown.scale("energy", "s-2"),
        period=families.period * shown.scale("period", "s"),
        frequency=families.frequency * shown.scale("frequency", "rad/s"),
    )
    points = points.assign(energy=points.energy * shown.scale("energy", "s-2"))
    loops = loops.assign(saddle_energy=loops.saddle_energy * shown.scale("energy", "s-2"))
    return families, points, loops


def _draw_families(
    ax: Axes,
    families: xr.Dataset,
    points: xr.Dataset,
    walls: Walls,
    names: tuple[str, str],
    ends: tuple[FloatArray, FloatArray],
) -> list[Artist]:
    """Draw the curves of the families that there are, from the centers (x, y) on."""
    handles: list[Artist] = []
    for number, family in enumerate(map(str, families.family.values)):
        one = families.sel(family=family).dropna("level")
        if not one.level.size:
            continue
        look = style.FAMILIES.get(family) or _look(number, family)
        energy, across, up = (one[name].values for name in ("energy_level", *names))
        # At a separatrix: infinitely long, so higher than anything shown.
        limit = 0.0 if names[1] == "frequency" else 100.0 * float(up.max())
        for level in _degenerate(points):
            if energy[0] < level < energy[-1]:
                place = int(np.searchsorted(energy, level))
                across = np.insert(across, place, np.interp(level, energy, across))
                up = np.insert(up, place, limit)
        # The last orbits are so close to it that nothing can be seen between.
        center = _center(family)
        before, after = center is None, family != "rotation"
        if family not in style.FAMILIES:  # nothing may end the last one
            after = any(wall > energy[-1] for _, wall in walls)
        across = np.concatenate([across[:before], across, across[len(across) - after :]])
        up = np.concatenate([[limit] * before, up, [limit] * after])
        if center is not None:
            across, up = (
                np.append(end[center], values)
                for end, values in zip(ends, (across, up), strict=True)
            )
        (line,) = ax.plot(across, up, zorder=2, **look)
        handles.append(line)
    if len(handles) == 2 and families.family.values[-1] == "rotation":  # and one well
        handles[0].set_label("oscillation")
    return handles


def _degenerate(points: xr.Dataset) -> list[float]:
    """Return the energies of degenerate points."""
    merged = points.kind.values == int(EquilibriumKind.DEGENERATE)
    return [float(energy) for energy in points.energy.values[merged]]


def _look(number: int, family: str) -> style.Look:
    """Look and words of a family that is called by the numbers of its centers."""
    kind, *numbers = family.split("_")
    return {**strokes.orbit_look(number), "label": f"{kind} {', '.join(numbers)}"}


def _center(family: str) -> int | None:
    """The row of the center at which a family begins; None if it begins at a separatrix."""
    if family.startswith("well_"):
        return int(family.removeprefix("well_"))
    return CENTERS.get(family)


def _saddles(loops: xr.Dataset) -> Walls:
    """Energies of the saddles, each with the name of its look."""
    energies = loops.saddle_energy
    if energies.saddle.dtype.kind in "iu":
        found = np.unique(energies.values[np.isfinite(energies.values)]).tolist()
        return [("upper", energy) for energy in found]
    walls = [(name, float(energies.sel(saddle=name))) for name in ("lower", "upper")]
    return [wall for wall in walls if np.isfinite(wall[1])]


def _draw_walls(ax: Axes, points: xr.Dataset, walls: Walls) -> list[Artist]:
    """Draw the energies at which periods are infinite."""
    looks = {name: {**style.WALLS[name]} for name in ("lower", "upper", "degenerate")}
    numbered = [name for name, _ in walls] == ["upper"] * len(walls) and len(walls) > 1
    if numbered:
        looks["upper"]["label"] = "energies of saddles"
    handles: list[Artist] = [
        ax.axvline(energy, zorder=1, **style.inked(looks[name]))
        for name, energy in [*walls, *(("degenerate", energy) for energy in _degenerate(points))]
    ]
    if len(walls) == 1:
        handles[0].set_label("energy of the saddle")
    return handles[:1] + handles[len(walls) :] if numbered else handles


def _draw_centers(ax: Axes, x: FloatArray, y: FloatArray) -> list[Artist]:
    """Mark the small oscillations; they may lie on the edge, which must not cut the markers."""
    there = np.isfinite(y)
    look = {**style.POINTS[EquilibriumKind.CENTER], "label": "small oscillations"}
    ax.plot(x[there], y[there], linestyle="none", zorder=5, clip_on=False, **look)
    return [Line2D([], [], linestyle="none", **look)] if there.any() else []
