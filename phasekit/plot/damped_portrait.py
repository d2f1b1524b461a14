"""Phase portrait of a damped system: stable and unstable manifolds of its saddles."""

from __future__ import annotations

from typing import Any

import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.lines import Line2D
from numpy.typing import ArrayLike, NDArray

from phasekit.errors import EquilibriumKind
from phasekit.labelled.driven import perturbed_of
from phasekit.labelled.motion import flow
from phasekit.labelled.phase_space import equilibria
from phasekit.labels.arguments import bad
from phasekit.plot.parts import strokes, style
from phasekit.plot.parts.circle import Circle
from phasekit.plot.phase_portrait import starts_of_pairs
from phasekit.systems.as_system import single
from phasekit.systems.perturbed import Perturbed

FloatArray = NDArray[np.float64]

STABLE: style.Look = {"color": style.BLUE, "linestyle": "-", "linewidth": 1.6}
UNSTABLE: style.Look = {"color": style.VERMILLION, "linestyle": "-", "linewidth": 1.6}
#: Distance from a saddle at which its manifolds begin, in rad.
NEAR = 1e-6
#: How often the motion near a saddle grows by e along its manifolds.
GROWTHS = 60
#: Samples of the time of each growth.
SAMPLES = 100


def damped_portrait(
    perturbed: Any,
    *,
    orbits: ArrayLike | None = None,
    angles: style.Angles = "rad",
    legend: bool = True,
    ax: Axes | None = None,
) -> Axes:
    r"""Draw rests and saddles of a damped system, and the manifolds of its saddles.

    The stable manifold of a saddle is what comes to it, and so the border between what falls to
    either side; the unstable manifold leads from it to where motions come to rest, or run round.

    Parameters
    ----------
    perturbed : Perturbed
        One system with damping and perhaps a torque; nothing in it varies with time.
    orbits : array_like, optional
        Initial conditions (phi0, dphi0) in rad and rad/s, one pair or an array of pairs: motions
        that are drawn as well.
    angles : {"rad", "deg"}
        Unit of the angle on both axes.
    legend : bool
        Whether to explain lines and markers under the axes.
    ax : matplotlib.axes.Axes, optional
        Where to draw; a new figure if left out.

    Returns
    -------
    matplotlib.axes.Axes

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
    system = perturbed_of(perturbed)
    _refuse_varying(system)
    single(system)
    factor = style.angle_factor(angles)
    period = system.system.law.period  # type: ignore[attr-defined]
    circle = Circle(-np.pi if period is None else -0.5 * period, period)
    points = _points(system)
    saddles = points[points[:, 1] == EquilibriumKind.SADDLE]
    if not len(saddles):
        raise bad("perturbed", system, "a system with a saddle", "its torque may be too large")
    starts = starts_of_pairs(orbits)
    axes = style.axes_for(ax, legend=legend)
    reach = 0.0
    for phi, _, exponent in saddles:
        for stable in (False, True):
            for side in (1.0, -1.0):
                x, v = _manifold(system, phi, exponent, stable=stable, side=side, period=period)
                if not stable:  # backwards in time speeds grow without end
                    reach = max(reach, 1.6 * float(np.nanmax(np.abs(v))))
                across, up = circle.unrolled(x, v)
                axes.plot(across * factor, up * factor, **(STABLE if stable else UNSTABLE))
    for number, (phi, dphi) in enumerate(starts):
        motion = flow(system, phi, dphi, np.linspace(0.0, _duration(system, saddles), 4001))
        pair = motion.motion_phi.values, motion.motion_dphi.values
        across, up = circle.unrolled(*pair)
        axes.plot(across * factor, up * factor, **strokes.orbit_look(number))
        reach = max(reach, 1.1 * abs(dphi))
    handles: list[Artist] = [
        Line2D([], [], label="stable manifold", **STABLE),
        Line2D([], [], label="unstable manifold", **UNSTABLE),
    ]
    for kind in (EquilibriumKind.CENTER, EquilibriumKind.SADDLE):
        look = {**style.POINTS[kind], "linestyle": "none"}
        if kind is EquilibriumKind.CENTER:
            look["label"] = _name_of_centers(system)
        own = points[points[:, 1] == kind, 0]
        if own.size:
            across = circle.points(own, np.zeros(own.size))[0]
            handles += axes.plot(across * factor, np.zeros(across.size), zorder=4, **look)
    axes.set_ylim(-reach * factor, reach * factor)
    if period is not None and abs(period - 2.0 * np.pi) < 1e-12:
        style.circle_axis(axes, "x", angles)
    unit = style.angle_unit(angles) if period is not None else ""
    axes.set_xlabel(rf"$\varphi$ ({unit})" if unit else "$x$")
    axes.set_ylabel(rf"$\dot\varphi$ ({unit}/s)" if unit else r"$\dot x$")
    if legend:
        style.legend_below(axes, handles)
    return axes


def _refuse_varying(system: Perturbed) -> None:
    if system.forcing or system.modulation or system.drift or system.omega1 is not None:
        hint = "for one that varies draw pk.plot.poincare_section(pk.stroboscopic(...))"
        raise bad("perturbed", system, "a system that does not vary with time", hint)


def _name_of_centers(system: Perturbed) -> str:
    damped = system.damping + system.quadratic
    return "rest" if damped > 0.0 else "driven away" if damped < 0.0 else "center"


def _points(system: Perturbed) -> FloatArray:
    """Equilibria: angle, kind and exponent, a row each."""
    found = equilibria(system)
    table = np.stack([found.phi, found.kind, found.exponent], axis=-1).astype(float)
    return np.asarray(table[np.isfinite(table[:, 0])])


def _manifold(
    system: Perturbed,
    phi: float,
    exponent: float,
    *,
    stable: bool,
    side: float,
    period: float | None,
) -> tuple[FloatArray, FloatArray]:
    """One branch of a manifold of a saddle, away from it."""
    damping = float(system.damping)
    root = np.sqrt(exponent**2 + 0.25 * damping**2)
    rate = -0.5 * damping + (-root if stable else root)
    length = NEAR * (1.0 if period is None else period / (2.0 * np.pi))
    times = np.linspace(0.0, 1.0 / rate, SAMPLES + 1)
    x, v = np.array([phi + side * length]), np.array([side * length * rate])
    farthest = np.inf if period is None else 0.5 * period  # steps that still show a curve
    # By parts: against damping speeds, and with them turns and work, grow exponentially.
    for _ in range(GROWTHS):
        motion = flow(system, x[-1], v[-1], times)
        x = np.append(x, motion.motion_phi.values[1:])
        v = np.append(v, motion.motion_dphi.values[1:])
        shown = np.abs(np.diff(x)) < farthest
        if not shown.all():
            end = 1 + int(np.argmin(shown))
            return x[:end], v[:end]
    return x, v


def _duration(system: Perturbed, saddles: FloatArray) -> float:
    slow = max(abs(float(system.damping)), 0.02)
    return float(min(8.0 / slow, 400.0 / np.nanmin(saddles[:, 2])))
