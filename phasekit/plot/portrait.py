"""Phase portrait of one system on the cylinder."""

from __future__ import annotations

from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import to_hex
from numpy.typing import ArrayLike, NDArray

from phasekit.labelled.arguments import bad, one_of, reals
from phasekit.labelled.potential_system import Potential
from phasekit.plot import potential, strokes, style
from phasekit.plot.landscape import Arc, Landscape, Level
from phasekit.plot.terrain import Terrain

FloatArray = NDArray[np.float64]

# What level curves can be colored by, and the words at the color bar.
COLORED = {
    "period": "period (s)",
    "frequency": "frequency (rad/s)",
    "action": "action (rad$^2$/s)",
}


def phase_portrait(
    system: Any,
    *,
    energies: ArrayLike | None = None,
    orbits: ArrayLike | None = None,
    color_by: str | None = None,
    angles: style.Angles = "rad",
    legend: bool = True,
    ax: Axes | None = None,
) -> Axes:
    r"""Draw the phase portrait of one system on the cylinder.

    Level curves of the energy integral :math:`h = \dot\varphi^2/2 + V(\varphi)` lie below, solid
    where they close and dotted where they run round the cylinder; separatrices lie on top; centers
    and saddles are marked, and the lobes of a figure-eight are filled. The left and right edges are
    the same line of the cylinder.

    Parameters
    ----------
    system
        A system whose parameters are scalars; a `Potential` on a line or a circle as well.
    energies : float or sequence of float, optional
        Energies (s^-2) of the level curves. Left out, they are chosen evenly in speed between the
        centers and saddles and above them. An empty list draws none; an energy below the least
        potential has no curve.
    orbits : array_like, optional
        Initial conditions (phi0, dphi0) in rad and rad/s, one pair or an array of pairs; the level
        curve through each is drawn over the others and its start is marked.
    color_by : {"period", "frequency", "action"}, optional
        Color the level curves by what their orbits have, on a logarithmic scale with a color bar;
        gray if left out. The period of a rotation is the time of one turn. Levels that are not
        given lie twice as close.
    angles : {"rad", "deg"}
        Unit of the angle on both axes.
    legend : bool
        Whether to explain lines and markers under the axes.
    ax : matplotlib.axes.Axes, optional
        Where to draw; a new figure if left out. A given figure without layout engine gets the
        constrained one, unless `legend` is False.

    Returns
    -------
    matplotlib.axes.Axes

    Raises
    ------
    ParameterError
        If an argument is unusable.

    Notes
    -----
    The level curves are [Veljovic2015] eq. (14); the figure-eight is the homoclinic orbit of its
    Section 4 and encloses the trigger of coupled singularities (center, saddle, center).

    Examples
    --------
    >>> import phasekit as pk
    >>> ax = pk.plot.phase_portrait(pk.Reduced(lam=0.4, psi=0.1))
    >>> ax.get_xlabel()
    '$\\varphi$ (rad)'
    """
    if color_by is not None:
        one_of("color_by", color_by, tuple(COLORED))
    if isinstance(system, Potential):
        return _of_potential(system, energies, orbits, color_by, angles, legend, ax)
    land = Landscape.of(system)
    factor = style.angle_factor(angles)
    dense = energies is None and color_by is not None
    chosen = land.levels(1.0 / 12.0) if dense else levels_of(land, energies)
    starts = starts_of(land, orbits)
    axes = style.axes_for(ax, legend=legend, width=6.4 if color_by is None else 6.8)

    curves = [(level[0], arc) for level in chosen for arc in strokes.level_arcs(land, level)]
    colors = _colors(axes, land, curves, color_by)
    for (energy, arc), color in zip(curves, colors, strict=True):
        strokes.draw_level(axes, land, energy, arc, factor, color)
    handles = strokes.draw_separatrices(axes, land, factor)
    handles += strokes.draw_points(axes, land, factor, on_potential=False)
    handles += [
        strokes.draw_orbit(axes, land, start, number, factor) for number, start in enumerate(starts)
    ]

    given = [energy for energy, _ in chosen] if energies is not None else []
    reach = factor * _reach(land, [*given, *(land.energy(*start) for start in starts)])
    style.circle_axis(axes, "x", angles)
    axes.set_ylim(-reach, reach)
    axes.set_xlabel(rf"$\varphi$ ({style.angle_unit(angles)})")
    axes.set_ylabel(rf"$\dot\varphi$ ({style.angle_unit(angles)}/s)")
    if legend:
        style.legend_below(axes, handles)
    return axes


def _of_potential(
    system: Potential,
    energies: ArrayLike | None,
    orbits: ArrayLike | None,
    color_by: str | None,
    angles: style.Angles,
    legend: bool,
    ax: Axes | None,
) -> Axes:
    land = Terrain.of(system)
    factor = potential.scale_of(land, angles)
    dense = energies is None and color_by is not None
    chosen = land.levels(1.0 / 12.0) if dense else levels_of(land, energies)
    starts = starts_of(land, orbits)
    axes = style.axes_for(ax, legend=legend, width=6.4 if color_by is None else 6.8)
    colored = None if color_by is None else (color_by, COLORED[color_by])
    handles = potential.draw_portrait(axes, land, chosen, starts, colored, factor)
    if legend:
        style.legend_below(axes, handles)
    return axes


def _colors(
    ax: Axes, land: Landscape, curves: list[tuple[float, Arc]], color_by: str | None
) -> list[str | None]:
    """Return the color of each level curve, and draw the color bar."""
    values = np.array([land.orbit(energy, arc, color_by) for energy, arc in curves if color_by])
    limits = style.log_limits(values)
    if color_by is None or limits is None:
        return [None] * len(curves)
    mappable = style.log_bar(ax, limits, COLORED[color_by])
    return [to_hex(color) for color in mappable.to_rgba(np.minimum(values, limits[1]))]


def _reach(land: Landscape, energies: list[float]) -> float:
    """Return the greatest speed to show: past the separatrices, and past what was asked for."""
    reach = (1.42 if land.phi.size else 3.5) * land.top_speed
    highest = max(energies, default=land.floor)
    return max(reach, 1.08 * float(np.sqrt(2.0 * max(highest - land.floor, 0.0))))


def levels_of(land: Landscape | Terrain, energies: ArrayLike | None) -> list[Level]:
    """Return the levels to draw: those asked for, or a choice."""
    if energies is None:
        return land.levels()
    array = _finite(energies, "energies", "s^-2")
    if array.ndim > 1:
        raise bad("energies", energies, "a number or a 1-D list of numbers, in s^-2")
    levels: list[Level] = [(float(energy), None) for energy in array.ravel()]
    for energy, _ in levels:
        if not _has_speed(land, energy):
            raise bad("energies", energy, "energies whose speeds are finite")
    return levels


def starts_of(land: Landscape | Terrain, orbits: ArrayLike | None) -> list[tuple[float, float]]:
    """Return initial conditions as pairs of floats."""
    if orbits is None:
        return []
    pairs = _finite(orbits, "orbits", "rad and rad/s")
    if not pairs.size:
        return []
    if pairs.ndim == 1:
        pairs = pairs[np.newaxis]
    if pairs.ndim != 2 or pairs.shape[1] != 2:
        raise bad("orbits", orbits, "pairs (phi0, dphi0), of shape (2,) or (n, 2)")
    starts = [(float(phi), float(speed)) for phi, speed in pairs]
    for start in starts:
        if not _has_speed(land, land.energy(*start)):
            raise bad("orbits", start, "pairs (phi0, dphi0) whose energies are finite")
    return starts


def _has_speed(land: Landscape | Terrain, energy: float) -> bool:
    """Return whether the greatest speed on a level is a number."""
    return bool(np.isfinite(2.0 * (energy - land.floor)))


def _finite(values: ArrayLike, argument: str, unit: str) -> FloatArray:
    wants = f"finite numbers in {unit}"
    array = reals(argument, getattr(values, "values", values), wants)
    if not np.isfinite(array).all():
        raise bad(argument, values, wants)
    return array
