"""Floquet multipliers of periodic orbits in the complex plane."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from matplotlib.axes import Axes

from phasekit.inputs import call_checked
from phasekit.labelled.continuation.cycle_branch import CycleBranch
from phasekit.labels.arguments import bad
from phasekit.plot.parts import labels, style
from phasekit.plot.parts.units import Units


@call_checked
def multipliers(
    branch: Any,
    *,
    units: Mapping[str, str] | None = None,
    ax: Axes | None = None,
) -> Axes:
    r"""Draw the Floquet multipliers along a family of periodic orbits, with the unit circle.

    An orbit is stable while they lie inside: at a fold of cycles one leaves through 1, at a period
    doubling through -1, at a torus bifurcation a pair through the circle elsewhere. The color says
    where along the parameter.

    Parameters
    ----------
    branch : CycleBranch
        What `continuation` returns with ``orbit=``, or `.switch` at a Hopf point.
    units : mapping of str to str, optional
        Unit of the parameter in the color bar, by its name. Multipliers are pure numbers.

    Notes
    -----
    Without forcing one multiplier is always 1; it is drawn as well. Where most multipliers are
    small, a few that are more than ten times as large lie outside the picture.

    Examples
    --------
    >>> import phasekit as pk
    >>> oscillator = pk.Problem(["y", "mu*(1 - x**2)*y - x"], ("x", "y"), {"mu": 0.5})
    >>> orbit = pk.periodic_orbit(oscillator, [2.0, 0.0])
    >>> family = pk.continuation(oscillator, "mu", orbit=orbit, span=(0.1, 0.5))
    >>> ax = pk.plot.multipliers(family)
    >>> ax.get_xlabel(), ax.get_aspect()
    ('real part of the multipliers', 1.0)
    """
    if not isinstance(branch, CycleBranch):
        raise bad("branch", branch, "a branch of periodic orbits: pk.continuation(..., orbit=...)")
    points = branch.points
    along = points[branch.free[0]]
    held = {str(along.name): str(along.attrs.get("units", ""))}
    shown = Units.from_arguments("rad", units, held)
    values, _ = shown.shown(along)
    found = points["multiplier"].transpose("point", "multiplier").values
    axes = style.axes_for(ax, legend=False)
    figure = axes.get_figure(root=True)
    if ax is None and figure is not None:
        figure.set_layout_engine("compressed")  # for Axes of a fixed aspect
    turn = np.linspace(0.0, 2.0 * np.pi, 361)
    axes.plot(np.cos(turn), np.sin(turn), color=style.GRAY, linewidth=1.2)
    color = np.repeat(values, found.shape[1])
    dots = axes.scatter(
        found.real.ravel(), found.imag.ravel(), c=color, s=12.0, cmap=style.lines(), zorder=3
    )
    reach = _reach(np.abs(found))
    axes.set_aspect("equal")
    axes.set_xlim(-reach, reach)
    axes.set_ylim(-reach, reach)
    bar = axes.figure.colorbar(dots, ax=axes)
    bar.set_label(labels.label(along, shown, style.letters(axes, "y")))
    axes.set_xlabel("real part of the multipliers")
    axes.set_ylabel("imaginary part")
    return axes


def _reach(sizes: np.ndarray[Any, np.dtype[np.float64]]) -> float:
    """Half the width: the circle, and the multipliers but for a few that are far out."""
    sizes = sizes[np.isfinite(sizes)]
    if not sizes.size:
        return 1.15
    return 1.15 * max(1.0, min(float(sizes.max()), 10.0 * float(np.median(sizes)) + 1.0))
