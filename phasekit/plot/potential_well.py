"""Potential well of one system, over its phase portrait."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from numpy.typing import ArrayLike

from phasekit.errors import Loop
from phasekit.inputs import call_checked
from phasekit.phase.level_curves import Arc
from phasekit.plot.parts import labels, strokes, style
from phasekit.plot.phase_portrait import Picture, Shown, phase_portrait


@call_checked
def potential_well(
    system: Any,
    *,
    energies: ArrayLike | None = None,
    orbits: ArrayLike | None = None,
    angles: style.Angles = "rad",
    units: Mapping[str, str] | None = None,
    cut: float | None = None,
    legend: bool = True,
    ax: Axes | Sequence[Axes] | None = None,
) -> Axes | tuple[Axes, Axes]:
    r"""Draw the potential well, and the phase portrait below it on the same axis.

    The levels of the portrait stand in the well as horizontal chords, the energies of the saddles
    in the lines of their separatrices.

    Parameters
    ----------
    system
        As in :func:`phase_portrait`.
    energies, orbits, angles, units, cut, legend
        As in :func:`phase_portrait`.
    ax : Axes or pair of Axes, optional
        One Axes takes the well alone, a pair takes the well and the portrait; a new figure with two
        panels if left out.

    Returns
    -------
    Axes or tuple of two Axes
        The given Axes; (well, portrait) if there are two.

    Notes
    -----
    The layout is that of Fig. 4 of [Veljovic2015]. The potential is
    :math:`V = -B\cos\varphi + \tfrac{A}{2}\cos^2\varphi - C\sin\varphi`, eq. (15) there plus the
    constant :math:`A/2`; of a machine on a free support it is the amended one, in J.

    Examples
    --------
    >>> import phasekit as pk
    >>> well, portrait = pk.plot.potential_well(pk.Reduced(lam=0.4, psi=0.1))
    >>> well.get_xlim() == portrait.get_xlim()
    True
    """
    shown = Shown(angles, units, cut)
    picture = Picture.from_arguments(system, energies, orbits, shown)
    well, *others = _panels(ax)
    _draw_well(well, picture)
    if not others:
        return well
    well.set_xlabel("")
    well.tick_params(labelbottom=False)
    portrait = phase_portrait(
        system,
        energies=energies,
        orbits=orbits,
        angles=angles,
        units=units,
        cut=cut,
        legend=legend,
        ax=others[0],
    )
    return well, portrait


def _draw_well(well: Axes, picture: Picture) -> None:
    land, scale = picture.land, picture.scale
    rise = picture.units.scale("potential", land.answers.units)
    x = np.linspace(*land.window, 1201)
    height = land.answers.potential(x)
    _draw_chords(well, picture)
    curve = style.inked({"color": style.BLACK, "linewidth": 1.8})
    well.plot(x * scale[0], height * rise, zorder=3, **curve)
    strokes.Strokes(well, land, picture.circle, (scale[0], rise)).points(on_potential=True)
    # Where V falls without bound, or is steep at the window's ends, show what has a structure.
    marks = np.append(land.answers.energy, land.summit)
    span = float(np.ptp(marks)) or float(np.ptp(height)) or 1.0
    low = max(float(height.min()), float(marks.min()) - 0.2 * span)
    high = min(float(height.max()), float(marks.max()) + 0.8 * span)
    # A fast rotation lies far above the well; following it would flatten what is to be seen.
    reached = max([high, *(land.energy(*start) for start in picture.starts)])
    top = min(reached, high + 1.5 * span) + 0.2 * span
    well.set_ylim((low - 0.1 * span) * rise, top * rise)
    picture.coordinate_axis(well)
    known = land.answers
    symbol = "V" if known.momentum is None else f"V_{{{known.momentum[0]}}}"
    well.set_ylabel(labels.with_unit(f"${symbol}$", picture.units.text("potential", known.units)))


def _panels(ax: Any) -> list[Axes]:
    if ax is None:
        figure = style.new_figure(1.5)
        return list(figure.subplots(2, 1, sharex=True, height_ratios=(1.0, 1.5)))
    if isinstance(ax, np.ndarray) and ax.ndim == 1:
        ax = ax.tolist()
    if isinstance(ax, Sequence) and len(ax) == 2:
        return [style.check_axes(panel) for panel in ax]
    return [style.check_axes(ax, "ax (or each of a pair)")]


def _draw_chords(ax: Axes, picture: Picture) -> None:
    """Draw every energy over the arcs where it is reached: levels, saddles, orbits."""
    land, (stretch, _) = picture.land, picture.scale
    rise = picture.units.scale("potential", land.answers.units)
    circle = picture.circle

    def chord(energy: float, arc: Arc, zorder: float, look: style.Look) -> None:
        x, y = circle.unrolled(np.array(arc), np.full(2, energy * rise))
        ax.plot(x * stretch, y, zorder=zorder, **look)

    for level in picture.levels:
        for arc in land.arcs(*level):
            chord(level[0], arc, 1, strokes.level_look(land, arc))
    for energy, arc, loop in land.separatrices:
        chord(energy, arc, 2.5 if loop == Loop.WINDING else 2.0, style.inked(strokes.LOOPS[loop]))
        if loop == Loop.LOBES:
            phi, _ = land.curve(arc, energy)
            height = land.answers.potential(phi) * rise
            for turn in circle.turns(phi):
                x = (phi + turn) * stretch
                ax.fill_between(x, height, energy * rise, zorder=0.5, **style.EIGHT_FILL)
    for number, start in enumerate(picture.starts):
        for energy, arc in land.orbit_levels(*start):
            chord(energy, arc, 4, strokes.orbit_look(number))
