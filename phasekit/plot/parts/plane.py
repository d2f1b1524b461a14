"""The plane of states (phi, dphi): its units, its circle, its axes."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from matplotlib.axes import Axes

from phasekit.labels.arguments import bad
from phasekit.plot.parts import labels
from phasekit.plot.parts.circle import Circle
from phasekit.plot.parts.units import Units, coordinate_symbol


@dataclass(frozen=True)
class StatePlane:
    """How a coordinate and its rate are shown."""

    #: Units of the picture.
    units: Units
    #: Whether the coordinate is an angle in rad.
    on_angle: bool
    #: Circle on which the coordinate is shown; or its line.
    circle: Circle
    #: Name of the coordinate that is no angle.
    coordinate: str = "x"

    @classmethod
    def from_arguments(
        cls, units: Units, period: float | None, cut: Any, *, on_angle: bool, coordinate: Any = None
    ) -> StatePlane:
        """Check `angles` and `cut` of a picture against its coordinate."""
        if units.angles != "rad" and not on_angle:
            wants = "'rad' for a coordinate that is not an angle of period 2 pi"
            raise bad("angles", units.angles, wants)
        if period is None and cut is not None:
            raise bad("cut", cut, "None, for the coordinate is not on a circle")
        stretch = units.scale("phi", "rad") if on_angle else 1.0
        circle = Circle(period=None) if period is None else Circle.cut_at(cut, stretch, period)
        return cls(units, on_angle, circle, str(coordinate or "x"))

    @property
    def scale(self) -> tuple[float, float]:
        """What the coordinate and its rate are multiplied by to be shown."""
        if not self.on_angle:
            return 1.0, 1.0
        return self.units.scale("phi", "rad"), self.units.scale("dphi", "s-1")

    def name_axes(self, ax: Axes) -> None:
        """Write symbols and units on both axes."""
        symbol = coordinate_symbol("phi" if self.on_angle else self.coordinate)
        units = (self.units.text("phi", "rad"), self.units.text("dphi", "s-1"))
        across, up = units if self.on_angle else ("", "")
        dotted = symbol if symbol.startswith("\\") else f" {symbol}"  # \varphi needs no space
        ax.set_xlabel(labels.with_unit(f"${symbol}$", across))
        ax.set_ylabel(labels.with_unit(rf"$\dot{dotted}$", up))
