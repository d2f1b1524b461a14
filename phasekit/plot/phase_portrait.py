"""Phase portrait of one system on the cylinder or the plane."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import to_hex
from numpy.typing import ArrayLike

from phasekit.inputs import call_checked
from phasekit.labels.arguments import bad, flag, one_of
from phasekit.laws.ladder import Lawful, Trait
from phasekit.phase.level_curves import Arc, Level, LevelCurves
from phasekit.plot.parts import color_bar, labels, strokes, style
from phasekit.plot.parts.circle import Circle
from phasekit.plot.parts.units import Units, coordinate_symbol, printed
from phasekit.systems.levels import curves_of, window_of_damped
from phasekit.systems.problem import Problem, as_problem
from phasekit.systems.system import as_system

# What level curves can be colored by, with its unit by that of V.
COLORED = {
    "period": dict.fromkeys(("s-2", "J", ""), "s"),
    "frequency": dict.fromkeys(("s-2", "J", ""), "rad/s"),
    "action": {"s-2": "rad2/s", "J": "J s", "": ""},
}


@call_checked
def phase_portrait(
    system: Any,
    *,
    energies: ArrayLike | None = None,
    orbits: ArrayLike | None = None,
    color_by: str | None = None,
    angles: style.Angles = "rad",
    units: Mapping[str, str] | None = None,
    cut: float | None = None,
    window: Any = None,
    duration: float | None = None,
    plane: Any = None,
    cycles: bool | None = None,
    basins: bool = False,
    legend: bool = True,
    ax: Axes | None = None,
) -> Axes:
    r"""Draw the phase portrait of one system on the cylinder, or of any flow.

    Level curves of the energy integral :math:`h = \dot\varphi^2/2 + V(\varphi)` lie below, solid
    where they close and dotted where they run round the cylinder; separatrices lie on top; centers
    and saddles are marked, and the lobes of a figure-eight are filled. The left and right edges are
    the same line of the cylinder. Of a machine on a free support the levels are those of
    :math:`M\dot\varphi^2/2 + V_p(\varphi)`, in J, at one angular momentum :math:`p`.

    Of a `Problem` of two states, a system that states its rates, or one with damping: the direction
    of the flow, the nullclines, the equilibria by kind, the stable and unstable manifolds of
    saddles, and all limit cycles, dashed where unstable, in a window. Of more states the
    equilibria, manifolds and chosen motions, projected to a plane of two states. Of a map, or a
    forced flow seen once a period, the fixed points by kind, the manifolds of saddles, and iterates
    of chosen states.

    Parameters
    ----------
    system
        A system whose parameters are scalars; a `Potential` on a line or a circle as well; one
        under a constant torque, ``pk.Perturbed(system, torque=...)``, whose levels are those of one
        turn, on which what runs on comes back higher, or lower, each time; a
        `FreeGyroRotor` at a momentum, ``rotor.amended(p)``, or by itself at the momentum that it
        has when the disk hangs at rest and the support turns at the disk's omega1.
    energies : float or sequence of float, optional
        Energies (s^-2, or J) of the level curves. Left out, they are chosen evenly in speed between
        the centers and saddles and above them. An empty list draws none; an energy below the least
        potential has no curve.
    orbits : array_like, or mapping, optional
        Initial conditions (phi0, dphi0) in rad and rad/s, one pair or an array of pairs; the level
        curve through each is drawn over the others and its start is marked. Of a flow states of
        one number each, or mappings by name, from which motions are drawn, or iterates.
    color_by : {"period", "frequency", "action"}, optional
        Color the level curves by what their orbits have, on a logarithmic scale with a color bar;
        gray if left out. The period of a rotation is the time of one turn. Levels that are not
        given lie twice as close.
    angles : {"rad", "deg"}
        Unit of the angle on both axes; of a flow that of states which are angles all round.
    window : mapping of str to (float, float), optional
        Of a flow or a map: the part of the plane, by state; by default the system's window.
    duration : float, optional
        Of a flow: the time for which the motions of `orbits` are drawn; of a map how many iterates
        (1000), or periods of the forcing.
    plane : (str, str), optional
        Of a flow or a map: the two states to draw; by default the first two.
    cycles : bool, optional
        Of a planar flow: whether to look for limit cycles; by default unless f is a Python
        function, of which that takes long. Of a map they are not.
    basins : bool, default False
        Of a flow or a map of two states: whether to shade the basins of attractors.

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
    >>> predator = pk.Problem(
    ...     {"n": "n*(1 - n) - n*p/(n + 0.3)", "p": "p*(n/(n + 0.3) - 0.5)"},
    ...     window={"n": (-0.05, 1.2), "p": (-0.05, 0.8)},
    ... )
    >>> ax = pk.plot.phase_portrait(predator, orbits=(0.6, 0.1))
    """
    flag("basins", basins)
    found = system if isinstance(system, Lawful) else as_system(system)
    traits = getattr(getattr(found, "standing", None), "traits", None)
    loses = traits is not None and traits not in Trait.TORQUED
    if loses or found.own_equations is not None:
        own = "nothing for a flow, which "
        refused = {
            "energies": (energies, f"{own}has no energy"),
            "color_by": (color_by, f"{own}has no energy"),
            "units": (units, f"{own}is drawn in its own units; angles='deg' turns angles"),
            "cut": (cut, f"{own}is cut where its window says"),
        }
        for name, (value, wants) in refused.items():
            if value is not None:
                raise bad(name, value, wants)
        problem = _drawable(found)
        if loses:
            window = window_of_damped(found, problem, window)
        if problem.map or problem.time is not None:
            from phasekit.plot.parts.map_portrait import map_portrait as portrait
        else:
            from phasekit.plot.parts.flow_portrait import flow_portrait as portrait
        return portrait(
            problem, window=window, plane=plane, orbits=orbits, duration=duration, cycles=cycles,
            shade=basins, angles=angles, legend=legend, ax=ax,
        )  # fmt: skip
    given = {"window": window, "duration": duration, "plane": plane, "cycles": cycles}
    for name, value in {**given, "basins": basins or None}.items():
        if value is not None:
            raise bad(name, value, "nothing for a system in a potential")
    if color_by is not None:
        one_of("color_by", color_by, tuple(COLORED))
    shown = Shown(angles, units, cut)
    picture = Picture.from_arguments(
        system, energies, orbits, shown, 2.0 if color_by is not None else 1.0
    )
    axes = style.axes_for(ax, legend=legend)
    land, scale = picture.land, picture.scale
    drawn = strokes.Strokes(axes, land, picture.circle, scale)
    curves = [(level[0], arc) for level in picture.levels for arc in land.arcs(*level)]
    colors = _colors(axes, picture, curves, color_by) if color_by else [None] * len(curves)
    for (energy, arc), color in zip(curves, colors, strict=True):
        drawn.level(energy, arc, zorder=1, **strokes.level_look(land, arc, color))
    handles = [*drawn.separatrices(), *drawn.points()]
    handles += [drawn.orbit(start, number) for number, start in enumerate(picture.starts)]
    reach = scale[1] * picture.reach(given=energies is not None)
    axes.set_ylim(-reach, reach)
    picture.coordinate_axis(axes)
    name = picture.symbol
    name = name if name[1:].isalpha() else f"{{{name}}}"  # \varphi needs no braces
    unit = picture.units.text(*picture.rate)
    axes.set_ylabel(rf"$\dot{name}$" + (f" ({unit})" if unit else ""))
    if legend:
        style.legend_below(axes, handles)
    return axes


def _drawable(system: Any) -> Problem:
    """The equations of a flow or a map that can be drawn."""
    problem = as_problem(system)
    if len(problem.state) < 2:
        hint = "draw pk.flow(...) with pk.plot.time_history"
        if problem.map:
            hint = "a map of one state has pk.plot.orbit_diagram and pk.explore"
        raise bad("system", problem, "a flow or a map of two states or more", hint)
    return problem


@dataclass(frozen=True)
class Shown:
    """How a picture is asked to show its coordinate: the arguments of these names."""

    angles: style.Angles
    units: Mapping[str, str] | None
    cut: float | None


@dataclass(frozen=True)
class Picture:
    """What portrait and well show of a system: its level curves, levels, orbits, axis."""

    land: LevelCurves
    levels: list[Level]
    starts: list[strokes.State]
    units: Units
    #: Name of the coordinate's rate, and the unit in which it is held.
    rate: tuple[str, str]
    #: The coordinate for print.
    symbol: str
    #: What the coordinate and its rate are multiplied by to be shown.
    scale: strokes.Scale
    #: The circle on which the coordinate is shown; or its line.
    circle: Circle

    @classmethod
    def from_arguments(
        cls,
        system: Any,
        energies: ArrayLike | None,
        orbits: ArrayLike | None,
        shown: Shown,
        density: float = 1.0,
    ) -> Picture:
        """Check the arguments of a picture."""
        land = curves_of(system)
        known = land.answers
        place = known.coordinate, "rad" if known.is_angle else ""
        rate = f"d{known.coordinate}", "rad/s" if known.is_angle else ""
        units = Units.from_arguments(shown.angles, shown.units, dict((place, rate)))
        if units.angles != "rad" and not known.is_angle:
            wants = "'rad' for a coordinate that is not an angle of period 2 pi"
            raise bad("angles", shown.angles, wants)
        scale = units.scale(*place), units.scale(*rate)
        if shown.cut is not None:
            if known.turn is None:
                raise bad("cut", shown.cut, "None, for the coordinate is not on a circle")
            low = Circle.cut_at(shown.cut, scale[0], known.turn).low
            land = LevelCurves.from_answers(
                known if known.cut_at is None else known.cut_at(low), low
            )
        chosen = (
            land.levels(1.0 / (6.0 * density)) if energies is None else levels_of(land, energies)
        )
        starts = [] if orbits is None else starts_of(land, orbits)
        if known.cut_at is not None and known.turn is not None:  # though the picture is of a line
            turn = Circle(land.window[0], known.turn)
            starts = [(float(turn.home(x)), v) for x, v in starts]
        symbol = coordinate_symbol(known.coordinate)
        circle = Circle(land.window[0], known.period)
        return cls(land, chosen, starts, units, rate, symbol, scale, circle)

    def reach(self, *, given: bool) -> float:
        """Return the greatest speed to show: past the separatrices, and past what was asked for."""
        land = self.land
        levels = [energy for energy, _ in self.levels]
        asked = [*(levels if given else []), *(land.energy(*start) for start in self.starts)]
        own = 1.42 * land.fastest(land.summit)
        if not land.answers.phi.size:
            own = 1.17 * land.fastest(max(levels, default=land.floor))
        return max(own, 1.08 * land.fastest(max(asked, default=land.floor))) or 1.0

    def coordinate_axis(self, ax: Axes) -> None:
        """Show the coordinate on the x axis, under its name, and the momentum that is constant."""
        known = self.land.answers
        text = f"${self.symbol}$"
        if known.is_angle:
            name = known.coordinate
            style.circle_axis(ax, "x", self.units, Circle(self.land.window[0]), name)
            text += f" ({self.units.text(name, 'rad')})"
        else:
            ax.set_xlim(*(self.scale[0] * end for end in self.land.window))
        if known.momentum is not None:
            name, value, unit = known.momentum
            number = f"{value:.4g}".replace("-", "\N{MINUS SIGN}")
            text += f", at ${name}$ = {number} {printed(unit)}"
            text = labels.wrap(text, style.letters(ax, "x"))
        ax.set_xlabel(text)


def _colors(
    ax: Axes, picture: Picture, curves: list[tuple[float, Arc]], color_by: str
) -> list[str | None]:
    """Return the color of each level curve, and draw the color bar."""
    land = picture.land
    values = np.array([land.orbit(arc, energy, color_by) for energy, arc in curves])
    held = COLORED[color_by][land.answers.units]
    values = values * picture.units.scale(color_by, held)
    limits = color_bar.log_limits(values)
    if limits is None:
        return [None] * len(curves)
    text = labels.with_unit(color_by, picture.units.text(color_by, held))
    mappable = color_bar.log_bar(ax, limits, text)
    colors = mappable.to_rgba(np.minimum(values, limits[1]))
    return [None if np.isnan(v) else to_hex(c) for v, c in zip(values, colors, strict=True)]


def levels_of(land: LevelCurves, energies: ArrayLike) -> list[Level]:
    """Return the levels that are asked for."""
    unit = {"s-2": "s^-2"}.get(land.answers.units, land.answers.units or "the unit of V")
    array = strokes.finite(energies, "energies", unit)
    if array.ndim > 1:
        raise bad("energies", energies, f"a number or a 1-D list of numbers, in {unit}")
    levels: list[Level] = [(float(energy), None) for energy in array.ravel()]
    for energy, _ in levels:
        if not _has_speed(land, energy):
            raise bad("energies", energy, "energies whose speeds are finite")
    return levels


def starts_of(land: LevelCurves, orbits: ArrayLike) -> list[strokes.State]:
    """Return initial conditions as pairs of floats."""
    starts = strokes.starts_of_pairs(orbits)
    for start in starts:
        if not _has_speed(land, land.energy(*start)):
            raise bad("orbits", start, "pairs (phi0, dphi0) whose energies are finite")
    return starts


def _has_speed(land: LevelCurves, energy: float) -> bool:
    """Return whether the greatest speed on a level is a number."""
    return bool(np.isfinite(2.0 * (energy - land.floor)))
