"""Potential well of one system, over its phase portrait."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from numpy.typing import ArrayLike

from phasekit.errors import Loop
from phasekit.labelled.potential_system import Potential
from phasekit.plot import potential, strokes, style
from phasekit.plot.landscape import Arc, Landscape, Level, is_turn
from phasekit.plot.portrait import levels_of, phase_portrait, starts_of
from phasekit.plot.terrain import Terrain


def potential_well(
    system: Any,
    *,
    energies: ArrayLike | None = None,
    orbits: ArrayLike | None = None,
    angles: style.Angles = "rad",
    legend: bool = True,
    ax: Axes | Sequence[Axes] | None = None,
) -> Axes | tuple[Axes, Axes]:
    r"""Draw the potential well, and under it the phase portrait with the same angle axis.

    The levels of the portrait stand in the well as horizontal chords, the energies of the saddles
    in the lines of their separatrices.

    Parameters
    ----------
    system
        A system whose parameters are scalars.
    energies, orbits, angles, legend
        As in :func:`phase_portrait`.
    ax : Axes or pair of Axes, optional
        One Axes takes the well alone, a pair takes the well and the portrait; a new figure with two
        panels if left out.

    Returns
    -------
    Axes or tuple of two Axes
        The given Axes; (well, portrait) if there are two.

    Raises
    ------
    ParameterError
        If an argument is unusable.

    Notes
    -----
    The layout is that of Fig. 4 of [Veljovic2015]. The potential is
    :math:`V = -B\cos\varphi + \tfrac{A}{2}\cos^2\varphi - C\sin\varphi`, eq. (15) there plus the
    constant :math:`A/2`.

    Examples
    --------
    >>> import phasekit as pk
    >>> well, portrait = pk.plot.potential_well(pk.Reduced(lam=0.4, psi=0.1))
    >>> well.get_xlim() == portrait.get_xlim()
    True
    """
    land = Terrain.of(system) if isinstance(system, Potential) else Landscape.of(system)
    factor = style.angle_factor(angles)
    chosen, starts = levels_of(land, energies), starts_of(land, orbits)
    if isinstance(land, Terrain):
        potential.scale_of(land, angles)
    panels = _panels(ax)
    well = panels[0]
    if isinstance(land, Terrain):
        potential.draw_well(well, land, chosen, starts, factor)
    else:
        _draw_well(well, land, chosen, starts, angles)
    if len(panels) == 1:
        return well
    well.set_xlabel("")
    well.tick_params(labelbottom=False)
    portrait = phase_portrait(
        system, energies=energies, orbits=orbits, angles=angles, legend=legend, ax=panels[1]
    )
    return well, portrait


def _draw_well(
    well: Axes,
    land: Landscape,
    chosen: list[Level],
    starts: list[tuple[float, float]],
    angles: style.Angles,
) -> None:
    factor = style.angle_factor(angles)
    phi = np.linspace(-np.pi, np.pi, 721)
    height = land.potential(phi)
    _draw_chords(well, land, chosen, starts, factor)
    well.plot(phi * factor, height, color=style.BLACK, linewidth=1.8, zorder=3)
    strokes.draw_points(well, land, factor, on_potential=True)
    low, high = float(height.min()), float(height.max())
    span = high - low if high > low else 1.0
    # A fast rotation lies far above the well; following it would flatten what is to be seen.
    tallest = min(max([high, *(land.energy(*start) for start in starts)]), high + 1.5 * span)
    well.set_ylim(low - 0.1 * span, tallest + 0.2 * span)
    style.circle_axis(well, "x", angles)
    well.set_ylabel("$V$ (s$^{-2}$)")
    well.set_xlabel(rf"$\varphi$ ({style.angle_unit(angles)})")


def _panels(ax: Any) -> list[Axes]:
    if ax is None:
        figure = style.new_figure(6.4, 7.2)
        return list(figure.subplots(2, 1, sharex=True, height_ratios=(1.0, 1.5)))
    if isinstance(ax, np.ndarray) and ax.ndim == 1:
        ax = ax.tolist()
    if isinstance(ax, Sequence) and len(ax) == 2:
        return [style.check_axes(panel) for panel in ax]
    return [style.check_axes(ax, "ax (or each of a pair)")]


def _draw_chords(
    ax: Axes,
    land: Landscape,
    chosen: list[Level],
    starts: list[tuple[float, float]],
    factor: float,
) -> None:
    """Draw every energy over the arcs where it is reached: levels, saddles, orbits."""

    def chord(energy: float, arcs: list[Arc], zorder: float, look: style.Look) -> None:
        for arc in arcs:
            x, y = strokes.round_the_cylinder(np.array(arc), np.full(2, energy))
            ax.plot(x * factor, y, zorder=zorder, **look)

    for level in chosen:
        arcs = strokes.level_arcs(land, level)
        turning = bool(arcs) and is_turn(arcs[0])
        chord(level[0], arcs, 1, style.ROTATION if turning else style.LEVEL)
    looks = {Loop.LOBES: style.EIGHT, Loop.WINDING: style.WINDING, Loop.HETEROCLINIC: style.CYCLE}
    for saddle in (1, 0):
        loop = land.separatrices.loop[saddle]
        if loop == Loop.ABSENT:
            continue
        energy = float(land.separatrices.saddle_energy[saddle])
        chord(energy, land.basins(energy), 2 + 0.5 * saddle, looks[Loop(int(loop))])
        if loop == Loop.LOBES:
            for side in (0, 1):
                phi, _ = land.lobe(saddle, side)
                for turn in strokes.turns_in_sight(phi):
                    x = (phi + turn) * factor
                    ax.fill_between(x, land.potential(phi), energy, zorder=0.5, **style.EIGHT_FILL)
    for number, (phi0, speed0) in enumerate(starts):
        energy = land.energy(phi0, speed0)
        arc = land.basin_of(energy, phi0)
        chord(energy, [] if arc is None else [arc], 4, strokes.orbit_look(number))
