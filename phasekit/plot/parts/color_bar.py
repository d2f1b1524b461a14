"""Color bars with a logarithmic scale."""

from __future__ import annotations

from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.colorbar import Colorbar
from matplotlib.colors import LogNorm
from matplotlib.ticker import FixedLocator, FuncFormatter, MaxNLocator, NullLocator

from phasekit.plot.parts import style


def log_limits(values: Any) -> tuple[float, float] | None:
    """Return the least and the greatest of the finite values > 0, None where there are none."""
    finite = np.asarray(values)[np.isfinite(values) & (np.asarray(values) > 0.0)]
    if not finite.size:
        return None
    low, high = float(finite.min()), float(finite.max())
    return (low, high) if high > 1.02 * low else (low / 1.1, high * 1.1)


def log_bar(ax: Axes, limits: tuple[float, float], text: str) -> ScalarMappable:
    """Draw a color bar with round numbers, also where a logarithmic scale spans little."""
    mappable = ScalarMappable(LogNorm(*limits), style.lines())
    log_ticks(ax.figure.colorbar(mappable, ax=ax, label=text))
    return mappable


def log_ticks(bar: Colorbar) -> None:
    """Put round numbers along a color bar with a logarithmic scale."""
    bar.ax.yaxis.set_major_locator(FixedLocator(round_numbers(*bar.mappable.get_clim())))
    bar.ax.yaxis.set_minor_locator(NullLocator())
    bar.ax.yaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:.4g}"))


def round_numbers(low: float, high: float) -> list[float]:
    """Return round numbers from `low` to `high` for a logarithmic scale.

    >>> round_numbers(1.8, 33.0), round_numbers(1.8, 3.3)
    ([2.0, 5.0, 10.0, 20.0], [2.0, 2.5, 3.0])
    """
    if high < 5.0 * low:
        ticks = list(MaxNLocator(6, steps=[1, 2, 5, 10]).tick_values(low, high))
    else:
        digits = (1, 2, 5) if high < 5e3 * low else (1,)
        powers = range(int(np.floor(np.log10(low))), int(np.floor(np.log10(high))) + 1)
        ticks = [float(f"{digit}e{power}") for power in powers for digit in digits]
    inside = [float(tick) for tick in ticks if low <= tick <= high]
    return inside[:: -(-len(inside) // 9)] if inside else [low, high]
