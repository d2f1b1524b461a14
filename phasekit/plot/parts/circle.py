"""The circle of an angle as pictures show it: cut open, and what lies on the cut at both ends.

Curves are drawn in unwrapped angle and repeated a turn to either side, so that nothing is torn at
the cut; the axes clip what lies outside.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.ticker import FixedLocator, FuncFormatter, MultipleLocator

from phasekit.arrays import Array
from phasekit.labels.arguments import bad, number
from phasekit.plot.parts.units import Units

TURN = 2.0 * np.pi
#: A marker this near to the cut (in turns) is clipped by it, and so stands on its other side too.
SEAM = 0.02 / TURN


@dataclass(frozen=True)
class Circle:
    """A circle that is cut open."""

    #: Where it is cut: what is shown goes from here on for one turn.
    low: float = -np.pi
    #: One turn; None of a line, which is shown as it is.
    period: float | None = TURN

    @classmethod
    def cut_at(cls, cut: Any, scale: float, period: float = TURN) -> Circle:
        """Return the circle cut at `cut`, in the unit in which the angle is shown."""
        if cut is None:
            return cls(-0.5 * period, period)
        wants = "a finite number, in the unit in which the angle is shown"
        place = number("cut", cut, wants) / scale
        return cls((place + 0.5 * period) % period - 0.5 * period, period)

    @classmethod
    def of_axis(cls, values: xr.DataArray, units: Units, cut: Any) -> Circle | None:
        """Return the circle of an axis along which the angle phi is drawn; None of another axis."""
        name, held = str(values.name), str(values.attrs.get("units", ""))
        if name == "phi" and held == "rad":
            return cls.cut_at(cut, units.scale(name, held))
        if cut is not None:
            raise bad("cut", cut, f"None, for {name} is not drawn on a circle")
        return None

    @property
    def ends(self) -> tuple[float, float]:
        """Both sides of the cut."""
        return self.low, self.low + (self.period or np.inf)

    def turns(self, x: Array) -> list[float]:
        """Return the shifts with which a curve is seen; none but 0 on a line."""
        if self.period is None:
            return [0.0]
        low, high = self.ends
        first = int(np.ceil((low - np.nanmax(x)) / self.period))
        last = int(np.floor((high - np.nanmin(x)) / self.period))
        return [turn * self.period for turn in range(first, last + 1)]

    def unrolled(self, x: Array, other: Array) -> tuple[Array, Array]:
        """Join the copies of a curve that are seen into one broken line."""
        if not np.isfinite(x).any():
            return x, other
        gap = np.array([np.nan])
        turns = self.turns(x)
        across = np.concatenate([part for turn in turns for part in (x + turn, gap)])
        up = np.concatenate([part for _ in turns for part in (other, gap)])
        return across[:-1], up[:-1]

    def home(self, x: Any) -> Any:
        """Return where places are seen."""
        if self.period is None:
            return x
        low, high = self.ends
        # What is there already is not rounded once more.
        return np.where((x > low) & (x <= high), x, high - (high - x) % self.period)[()]

    def points(self, x: Array, other: Array) -> tuple[Array, Array]:
        """Return points where they are seen, those on the cut at both of its sides."""
        x = np.asarray(self.home(x))
        if self.period is None:
            return x, other
        low, high = self.ends
        again = [
            (x[side] + turn, other[side])
            for side, turn in (
                (x - low < SEAM * self.period, self.period),
                (high - x < SEAM * self.period, -self.period),
            )
        ]
        return (
            np.concatenate([x, *(copy[0] for copy in again)]),
            np.concatenate([other, *(copy[1] for copy in again)]),
        )


def circle_axis(
    ax: Axes,
    which: Literal["x", "y"],
    units: Units,
    circle: Circle | None = None,
    name: str = "phi",
) -> None:
    """Show the whole circle on one axis, with ticks at multiples of a quarter turn."""
    factor = units.scale(name, "rad")
    low, high = (circle or Circle()).ends
    axis = ax.xaxis if which == "x" else ax.yaxis
    axis.set_major_locator(FixedLocator([quarter * factor for quarter in quarters(low, high)]))
    axis.set_minor_locator(MultipleLocator(np.pi / 8 * factor))
    if factor == 1.0:
        axis.set_major_formatter(FuncFormatter(multiple_of_pi))
    ax.set(**{f"{which}lim": (low * factor, high * factor)})


def quarters(low: float, high: float) -> list[float]:
    """Return the multiples of a quarter turn from `low` to `high`."""
    slack = 1e-9
    first = int(np.ceil(low / (np.pi / 2) - slack))
    last = int(np.floor(high / (np.pi / 2) + slack))
    return [k * (np.pi / 2) for k in range(first, last + 1)]


def unwrapped_axis(ax: Axes, which: Literal["x", "y"], units: Units, name: str = "phi") -> None:
    """Put ticks at quarter turns or multiples of them, where an axis spans half a turn or more."""
    factor = units.scale(name, "rad")
    axis = ax.xaxis if which == "x" else ax.yaxis
    low, high = sorted(ax.get_xlim() if which == "x" else ax.get_ylim())
    spanned = (high - low) / factor / (np.pi / 2)
    if spanned < 2.0 or not np.isfinite(spanned):
        return
    steps = [1.0, 2.0, *(float(f"{digit}e{power}") for power in range(16) for digit in (4, 8, 20))]
    step = next((step for step in steps if spanned <= 8.0 * step), spanned / 8.0)
    axis.set_major_locator(MultipleLocator(step * np.pi / 2 * factor))
    if factor == 1.0:
        axis.set_major_formatter(FuncFormatter(multiple_of_pi))


def multiple_of_pi(value: float, _position: object = None) -> str:
    """Write an angle as a multiple of pi/2."""
    halves = round(value / (np.pi / 2))
    if halves == 0:
        return "0"
    sign = "-" if halves < 0 else ""
    whole, odd = divmod(abs(halves), 2)
    if odd:
        top = "" if abs(halves) == 1 else f"{abs(halves)}"
        return rf"${sign}{top}\pi/2$"
    return rf"${sign}{'' if whole == 1 else whole}\pi$"
