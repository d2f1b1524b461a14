"""Phase portrait of a damped system: stable and unstable manifolds of its saddles."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.lines import Line2D
from numpy.typing import ArrayLike

from phasekit.arrays import Array
from phasekit.errors import EquilibriumKind
from phasekit.labelled.driven import perturbed_of
from phasekit.labelled.motion import flow
from phasekit.labelled.phase_space import equilibria
from phasekit.labels.arguments import bad, call_checked
from phasekit.plot.parts import strokes, style
from phasekit.plot.parts.circle import TURN
from phasekit.plot.parts.plane import StatePlane
from phasekit.plot.parts.units import Units
from phasekit.systems.perturbed import Perturbed
from phasekit.systems.system import single

#: Distance from a saddle at which its manifolds begin, in rad.
NEAR = 1e-6
#: How often the motion near a saddle grows by e along a part of its manifolds, and their parts.
GROWTHS, PARTS = 3, 20
#: Samples of the time of each growth.
SAMPLES = 100


@call_checked
def damped_portrait(
    system: Any,
    *,
    orbits: ArrayLike | None = None,
    angles: style.Angles = "rad",
    units: Mapping[str, str] | None = None,
    cut: float | None = None,
    legend: bool = True,
    ax: Axes | None = None,
) -> Axes:
    r"""Draw the equilibria of a damped system and the manifolds of its saddles.

    The stable manifold of a saddle is what comes to it, and so the border between what falls to
    either side; the unstable manifold leads from it to where motions come to rest, or run round.

    Parameters
    ----------
    system : Perturbed
        One system with damping and perhaps a torque; nothing in it varies with time.
    orbits : array_like, optional
        Initial conditions (phi0, dphi0) in rad and rad/s, one pair or an array of pairs: motions
        that are drawn as well.
    units : mapping of str to str, optional
        Units in which quantities are shown, by name: ``{"phi": "deg", "dphi": "rpm"}``.

    Raises
    ------
    ParameterError
        If the system varies with time, or has no saddle, or an argument is unusable.

    Examples
    --------
    >>> import phasekit as pk
    >>> damped = pk.Perturbed(pk.Coefficients(1.0, 0.35, 0.12), damping=0.1)
    >>> ax = pk.plot.damped_portrait(damped)
    >>> len(ax.get_lines())
    10
    """
    system = perturbed_of(system)
    _refuse_varying(system)
    single(system)
    law: Any = system.system.law
    period = law.period
    on_angle = period is not None and abs(period - TURN) < 1e-12
    plane = StatePlane.from_arguments(
        Units.from_arguments(angles, units),
        period,
        cut,
        on_angle=on_angle,
        coordinate=law.coordinate,
    )
    circle, (stretch, pace) = plane.circle, plane.scale
    points = _points(system)
    saddles = points[points[:, 1] == EquilibriumKind.SADDLE]
    if not len(saddles):
        raise bad("perturbed", system, "a system with a saddle", "its torque may be too large")
    starts = [] if orbits is None else strokes.starts_of_pairs(orbits)
    axes = style.axes_for(ax, legend=legend)
    curves = [*_manifolds(system, saddles, period), *_orbits(system, saddles, starts)]
    # Of one kind of manifold the speeds may grow without end: backwards in time, where damped.
    fastest = [
        max(float(np.nanmax(np.abs(v))) for _, v, look in curves if look is kind)
        for kind in (style.STABLE, style.UNSTABLE)
    ]
    reach = max([1.6 * min(fastest), *(1.1 * abs(dphi) for _, dphi in starts)])
    for x, v, look in curves:
        seen = np.abs(v) <= 1.3 * reach
        across, up = circle.unrolled(np.where(seen, x, np.nan), np.where(seen, v, np.nan))
        axes.plot(across * stretch, up * pace, **look)
    handles: list[Artist] = [
        Line2D([], [], label="stable manifold", **style.STABLE),
        Line2D([], [], label="unstable manifold", **style.UNSTABLE),
    ]
    for number, (phi, dphi) in enumerate(starts):
        look, where = strokes.orbit_look(number), float(circle.home(phi))
        look = {**look, **strokes.START}
        axes.plot([where * stretch], [dphi * pace], zorder=6, **{**look, "linestyle": "none"})
        text = f"from ({where * stretch:.4g}, {dphi * pace:.4g})".replace("-", "\N{MINUS SIGN}")
        handles.append(Line2D([], [], label=text, **look))
    for kind in (EquilibriumKind.CENTER, EquilibriumKind.SADDLE):
        look = {**style.POINTS[kind], "linestyle": "none"}
        if kind is EquilibriumKind.CENTER:
            look["label"] = _name_of_centers(system)
        own = points[points[:, 1] == kind, 0]
        if own.size:
            across = circle.points(own, np.zeros(own.size))[0]
            handles += axes.plot(
                across * stretch, np.zeros(across.size), zorder=5, clip_on=False, **look
            )
    axes.set_ylim(-reach * pace, reach * pace)
    if on_angle:
        style.circle_axis(axes, "x", plane.units, circle)
    elif period is not None:
        axes.set_xlim(*circle.ends)
    plane.name_axes(axes)
    if legend:
        style.legend_below(axes, handles, style.MANIFOLDS)
    return axes


def _refuse_varying(system: Perturbed) -> None:
    if system.forcing or system.modulation or system.drift or system.omega1 is not None:
        hint = "for one that varies draw pk.plot.poincare_section(pk.stroboscopic(...))"
        raise bad("perturbed", system, "a system that does not vary with time", hint)


def _name_of_centers(system: Perturbed) -> str:
    damped = system.damping + system.quadratic
    return "rest" if damped > 0.0 else "driven away" if damped < 0.0 else "center"


def _points(system: Perturbed) -> Array:
    """Equilibria: angle, kind and exponent, a row each."""
    found = equilibria(system)
    table = np.stack([found.phi, found.kind, found.exponent], axis=-1).astype(float)
    return np.asarray(table[np.isfinite(table[:, 0])])


def _manifolds(
    system: Perturbed, saddles: Array, period: float | None
) -> list[tuple[Array, Array, style.Look]]:
    """Branches of the manifolds of all saddles, with their looks."""
    return [
        (*_manifold(system, phi, exponent, stable=stable, side=side, period=period), look)
        for phi, _, exponent in saddles
        for stable, look in ((False, style.UNSTABLE), (True, style.STABLE))
        for side in (1.0, -1.0)
    ]


def _orbits(
    system: Perturbed, saddles: Array, starts: list[strokes.State]
) -> list[tuple[Array, Array, style.Look]]:
    """Motions from the starts, with their looks."""
    times = np.linspace(0.0, _duration(system, saddles), 4001)
    motions = [flow(system, *start, times) for start in starts]
    return [
        (motion.motion_phi.values, motion.motion_dphi.values, strokes.orbit_look(number))
        for number, motion in enumerate(motions)
    ]


def _manifold(
    system: Perturbed,
    phi: float,
    exponent: float,
    *,
    stable: bool,
    side: float,
    period: float | None,
) -> tuple[Array, Array]:
    """One branch of a manifold of a saddle, away from it."""
    damping = float(system.damping)
    root = np.sqrt(exponent**2 + 0.25 * damping**2)
    rate = -0.5 * damping + (-root if stable else root)
    length = NEAR * (1.0 if period is None else period / TURN)
    times = np.linspace(0.0, GROWTHS / rate, GROWTHS * SAMPLES + 1)
    x, v = np.array([phi + side * length]), np.array([side * length * rate])
    farthest = np.inf if period is None else 0.5 * period  # steps that still show a curve
    # By parts: against damping speeds, and with them turns and work, grow exponentially.
    for _ in range(PARTS):
        motion = flow(system, x[-1], v[-1], times)
        x = np.append(x, motion.motion_phi.values[1:])
        v = np.append(v, motion.motion_dphi.values[1:])
        shown = np.abs(np.diff(x)) < farthest
        if not shown.all():
            end = 1 + int(np.argmin(shown))
            return x[:end], v[:end]
    return x, v


def _duration(system: Perturbed, saddles: Array) -> float:
    slow = max(abs(float(system.damping)), 0.02)
    return float(min(8.0 / slow, 400.0 / np.nanmin(saddles[:, 2])))
