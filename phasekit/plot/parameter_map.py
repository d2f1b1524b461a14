"""Map of one quantity over two swept parameters, with the fold curve."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
import xarray as xr
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.colors import BoundaryNorm, ListedColormap, LogNorm, Normalize
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from numpy.typing import NDArray

from phasekit.errors import ParameterError
from phasekit.inputs import call_checked
from phasekit.labels.arguments import bad, flag, number, unknown
from phasekit.plot.parts import color_bar, labels, style
from phasekit.plot.parts.strands import relative_gap
from phasekit.plot.parts.units import Units

# The attribute that says what has been selected before.
SELECTION = "selection"
# In Axes with less room than for so many letters, codes are keys of the legend.
ROOM_FOR_BAR = 45
# The values along x and along y, as shown.
Grid = tuple[NDArray[Any], NDArray[Any]]

#: What is drawn if nothing is named, the first of these that a map has.
FIRST = ("topology", "hysteresis_width", "n_stable", "n_fold", "n_equilibria")

COUNT_NAMES = {-1: "not valid", 0: "none", 2: "2", 3: "3, on a fold", 4: "4"}


@call_checked
def parameter_map(
    dataset: xr.Dataset,
    variable: str | None = None,
    *,
    x: str | None = None,
    y: str | None = None,
    angles: style.Angles = "rad",
    units: Mapping[str, str] | None = None,
    log: bool = False,
    legend: bool = True,
    ax: Axes | None = None,
    **sel: Any,
) -> Axes:
    r"""Draw a quantity over two swept parameters, and the fold curve over it.

    Codes, counts and yes-or-no quantities are drawn in one color each and named at the color bar,
    others in a sequential map whose lightness rises throughout. Cells without a value are gray.

    Parameters
    ----------
    dataset : xarray.Dataset
        What `sweep`, `equilibria` or `separatrices` returns over two parameters or more.
    variable : str, optional
        The quantity to draw; left out, ``topology``, or of a map of branches the first of
        ``hysteresis_width``, ``n_stable`` and other numbers of cells that it has.
    x, y : str, optional
        The parameters on the axes; left out, the first two that are swept, in their order.
    log : bool
        Whether numbers have a logarithmic scale of colors; those that are not positive are absent.
    ax : matplotlib.axes.Axes, optional
        Where to draw; a new figure if left out. The color bar takes its room from it. A given
        figure without layout engine gets the constrained one, unless `legend` is False.
    **sel
        Labels or values along the other dims, such as ``equilibrium="lower_saddle"`` or
        ``omega1=2.5``; of numbers the nearest is taken.

    Raises
    ------
    ParameterError
        If an argument is unusable, or dims other than two are left after the selection.

    Notes
    -----
    The fold curve is the zero contour of fold_margin, and the line of A = 0 that of A where the
    model can be rebuilt from the map; both are interpolated between cells.

    Examples
    --------
    >>> import numpy as np
    >>> import phasekit as pk
    >>> square = np.linspace(-1.5, 1.5, 40)
    >>> ds = pk.separatrices(pk.Reduced(lam=square, psi=square))
    >>> ax = pk.plot.parameter_map(ds, "figure_eight")
    >>> ax.get_xlabel()
    '$\\lambda$, lambda = B/A'
    """
    flag("log", log)
    ds = labels.dataset(dataset, "dataset", ())
    variable = _first(ds) if variable is None else variable
    if not isinstance(variable, str) or variable not in ds.data_vars:
        raise unknown("variable", variable, map(str, ds.data_vars))
    chosen, shown = Units.of_dataset(selected_in(ds, variable, sel), angles, units)
    field = chosen[variable]
    across, up = axes_of(field, x, y)
    field = field.transpose(up.dims[0], across.dims[0])
    axes = style.axes_for(ax, legend=legend)

    grid = labels.shown(across, shown)[0], labels.shown(up, shown)[0]
    keys = legend and style.letters(axes, "x") < ROOM_FOR_BAR
    handles = _draw_field(axes, grid, field, shown, _named(ds[variable], sel), log, keys)
    handles += _draw_curves(axes, grid, chosen, across, up)
    axes.set_xlabel(labels.label(across, shown, style.letters(axes, "x")))
    axes.set_ylabel(labels.label(up, shown, style.letters(axes, "y")))
    if legend:
        style.legend_below(axes, handles)
    return axes


def _first(ds: xr.Dataset) -> str:
    """What is drawn if nothing is named."""
    known = [name for name in FIRST if name in ds.data_vars]
    cells = [str(name) for name, one in ds.data_vars.items() if len(labels.swept(one)) == 2]
    cells.sort(key=lambda name: name.endswith("_status"))
    return next(iter([*known, *cells]), FIRST[0])


def selected_in(ds: xr.Dataset, variable: str, sel: Mapping[str, Any]) -> xr.Dataset:
    """Select along the dims that `sel` names; by nearest value where these are numbers."""
    for name, value in sel.items():
        if name not in ds[variable].dims:
            raise unknown(f"dim of {variable}", name, map(str, ds[variable].dims))
        if name not in ds.indexes:
            raise ParameterError(f"{name}: got a dim without coordinate; use ds.isel({name}=...)")
        numbers = ds[name].dtype.kind in "iuf"
        near = "nearest" if numbers else None
        if numbers:
            value = number(name, value, f"one value of {name}", ds[name].attrs.get("units", ""))
        elif not isinstance(value, str):
            raise bad(name, value, f"one of {', '.join(map(str, ds[name].values[:6]))}")
        try:
            ds = ds.sel({name: value}, method=near)
        except (KeyError, TypeError, ValueError):
            options = [str(option) for option in ds[name].values[:6]]
            raise bad(name, value, f"one of {', '.join(options)}") from None
    return ds


def _named(values: xr.DataArray, sel: Mapping[str, Any]) -> str:
    """Return the selected labels for print; selected numbers stand in the coordinates."""
    names = [str(sel[name]) for name in sel if values[name].dtype.kind not in "iuf"]
    before = str(values.attrs.get(SELECTION, ""))
    return ", ".join(filter(None, [before, *(name.replace("_", " ") for name in names)]))


def axes_of(field: xr.DataArray, x: str | None, y: str | None) -> tuple[xr.DataArray, xr.DataArray]:
    """Return what stands on both axes of a map."""
    dims = labels.swept(field)
    if len(dims) != 2:
        what = f"the dims {', '.join(dims)}" if dims else "no dims"
        known = [dim for dim in dims if field.indexes.get(dim) is not None]
        labelled = [dim for dim in known if field[dim].dtype.kind not in "iuf"]
        hint = ", ".join(f"{dim}={str(field[dim].values[0])!r}" for dim in labelled)
        hint = f"; name the label, for example {hint}" if hint else "; select with ds.sel(...)"
        raise ParameterError(
            f"variable: got {field.name} with {what}, wants two swept parameters" + hint
        )
    if x is None and y is None:
        x, y = dims
    elif x is None or y is None:
        given = x if y is None else y
        name = labels.choose_axis(field, given, "x" if y is None else "y", dims)
        rest = next(dim for dim in dims if dim not in field[name].dims)
        x, y = (name, rest) if y is None else (rest, name)
    chosen = [
        field[labels.choose_axis(field, name, argument, dims)]
        for argument, name in (("x", x), ("y", y))
    ]
    if chosen[0].dims == chosen[1].dims:
        raise ParameterError(
            f"y: got {y!r}, wants the parameter that is not on x: {', '.join(dims)}"
        )
    for argument, values in zip("xy", chosen, strict=True):
        labels.monotone(values, argument)
    return chosen[0], chosen[1]


def _draw_field(
    ax: Axes,
    grid: Grid,
    field: xr.DataArray,
    units: Units,
    selected: str,
    log: bool,
    keys: bool,
) -> list[Artist]:
    """Draw the cells and what tells their colors: codes by name, numbers on a scale."""
    text = labels.label(field, units, style.letters(ax, "y"), selected)
    if field.dtype.kind in "iub":
        if keys:
            ax.set_title(
                labels.label(field, units, style.letters(ax, "x"), selected), size="medium"
            )
        return _draw_codes(ax, grid, field, None if keys else text)
    if selected not in text.replace("\n", " "):
        ax.set_title(selected, size="medium")
    return _draw_values(ax, grid, labels.shown(field, units)[0], text, log)


def _draw_codes(ax: Axes, grid: Grid, field: xr.DataArray, text: str | None) -> list[Artist]:
    """Draw integers and booleans, one color each; the colors of a code never change.

    Their names stand at a color bar with the text, or are returned as keys of a legend.
    """
    names, colors = _code_book(field)
    present = [int(code) for code in np.unique(field.values.astype(int))]
    index = np.searchsorted(present, field.values.astype(int))
    palette = ListedColormap([colors.get(code, style.GRAY) for code in present])
    norm = BoundaryNorm(np.arange(len(present) + 1) - 0.5, len(present))
    mesh = ax.pcolormesh(*grid, index, cmap=palette, norm=norm, shading="nearest", rasterized=True)
    words = [names.get(code, str(code)) for code in present]
    if text is None:
        edge: style.Look = {"edgecolor": style.GRAY, "linewidth": 0.6}
        return [Patch(facecolor=palette(i), label=word, **edge) for i, word in enumerate(words)]
    bar = ax.figure.colorbar(mesh, ax=ax, ticks=range(len(present)))
    bar.set_label(text, labelpad=8.0)
    upright = max(map(len, words)) <= 3
    bar.ax.set_yticklabels(words, rotation=0 if upright else 90, va="center", size=_size(ax, words))
    bar.ax.tick_params(which="both", length=0)
    return []


def _size(ax: Axes, words: list[str]) -> str:
    """Return the size in which turned words do not run into each other along a color bar."""
    room = style.letters(ax, "y") / (len(words) * max(map(len, words)))
    return "medium" if room > 1.0 else "small" if room > 0.83 else "x-small"


def _code_book(field: xr.DataArray) -> tuple[Mapping[int, str], Mapping[int, str]]:
    """Return names and colors by code."""
    if field.dtype.kind == "b":
        return {0: "no", 1: "yes"}, {0: style.CODE_COLORS[0], 1: style.CODE_COLORS[1]}
    if field.name == "n_equilibria":
        return COUNT_NAMES, style.COUNT_COLORS
    meanings = str(field.attrs.get("flag_meanings", "")).split()
    codes = [int(code) for code in np.atleast_1d(field.attrs.get("flag_values", []))]
    names = {c: m.replace("_", " ") for c, m in zip(codes, meanings, strict=False)}
    if field.name == "topology":
        return names, style.TOPOLOGY_COLORS
    if field.name == "kind":
        return names, style.KIND_COLORS
    present = [int(code) for code in np.unique(field.values) if code not in codes]
    positive = [code for code in [*codes, *present] if code > 0]
    colors = {c: style.CODE_COLORS[i % len(style.CODE_COLORS)] for i, c in enumerate(positive)}
    return names, {-1: style.NOTHING, 0: style.NOTHING, **colors}


def _draw_values(ax: Axes, grid: Grid, numbers: NDArray[Any], text: str, log: bool) -> list[Artist]:
    """Draw numbers; cells without one stay gray."""
    if log:
        numbers = np.where(numbers > 0.0, numbers, np.nan)
    low, high, extend = _limits(np.log10(numbers) if log else numbers)
    finite = numbers[np.isfinite(numbers)]
    # pcolormesh would leave infinite cells out.
    shown = np.clip(numbers, finite.min(), finite.max()) if finite.size else numbers
    values = np.ma.masked_invalid(shown)
    norm = Normalize(low, high)
    if log and low is not None and high is not None:
        norm = LogNorm(*(color_bar.log_limits([10.0**low, 10.0**high]) or (None, None)))
    ax.set_facecolor(style.NOTHING)
    absent = [Patch(facecolor=style.NOTHING, edgecolor=style.GRAY, label="absent")]
    if not finite.size:  # a bar would show numbers that nothing has
        ax.set_title(text, size="medium")
        ax.set(xlim=_edges(grid[0]), ylim=_edges(grid[1]))
        return list(absent)
    mesh = ax.pcolormesh(
        *grid, values, cmap=style.SEQUENTIAL, norm=norm, shading="nearest", rasterized=True
    )
    # Numbers at the ends of a bar stand over it, which the layout does not see.
    slim: style.Look = {"shrink": 0.93, "fraction": 0.08, "pad": 0.03} if style.narrow(ax) else {}
    bar = ax.figure.colorbar(mesh, ax=ax, label=text, extend=extend, **slim)
    if isinstance(norm, LogNorm):
        color_bar.log_ticks(bar)
    return list(absent) if np.ma.getmaskarray(values).any() else []


def _edges(along: NDArray[Any]) -> tuple[float, float]:
    """Return where the outer cells of a map end."""
    ends = 1.5 * along[[0, -1]] - 0.5 * along[[1, -2]]
    return float(ends.min()), float(ends.max())


def _limits(values: NDArray[Any]) -> tuple[float | None, float | None, str]:
    """Return color limits; a pole, such as that of fold_margin, must not take all colors."""
    finite = values[np.isfinite(values)]
    if not finite.size:
        return None, None, "neither"
    low, high = (float(x) for x in np.percentile(finite, (5.0, 95.0)))
    below, above = float(finite.min()), float(finite.max())
    reach = 2.0 * (high - low) if high > low else np.inf
    cut_low = below < low - reach or bool(np.isneginf(values).any())
    cut_high = above > high + reach or bool(np.isposinf(values).any())
    extend = {(True, True): "both", (True, False): "min", (False, True): "max"}
    return (
        low if cut_low else below,
        high if cut_high else above,
        extend.get((cut_low, cut_high), "neither"),
    )


def _draw_curves(
    ax: Axes, grid: Grid, ds: xr.Dataset, across: xr.DataArray, up: xr.DataArray
) -> list[Artist]:
    """Draw the fold curve and the line A = 0, where the Dataset knows them."""
    dims = (up.dims[0], across.dims[0])
    curves: list[tuple[NDArray[Any], style.Look]] = []
    if "fold_margin" in ds and set(ds["fold_margin"].dims) == set(dims):
        margin = ds["fold_margin"].transpose(*dims).values
        curves.append((relative_gap(margin), style.FOLD_CURVE))
    sign = _coefficient_A(ds)
    if sign is not None and set(sign.dims) == set(dims):
        curves.append((sign.transpose(*dims).values, style.SIGN_CHANGE))
    handles: list[Artist] = []
    for values, look in curves:
        if not (np.nanmin(values, initial=1.0) < 0.0 < np.nanmax(values, initial=-1.0)):
            continue
        contour = ax.contour(
            *grid,
            np.ma.masked_invalid(values),
            levels=[0.0],
            colors=[look["color"]],
            linestyles=[look["linestyle"]],
            linewidths=[look["linewidth"]],
        )
        contour.set_path_effects(style.halo(width=look["linewidth"] + 1.6))
        handles.append(
            Line2D([], [], path_effects=style.halo(width=look["linewidth"] + 1.6), **look)
        )
    return handles


def _coefficient_A(ds: xr.Dataset) -> xr.DataArray | None:
    """Return A over the map, or None if the Dataset cannot rebuild its model."""
    model = labels.model_in(ds)
    try:
        A = None if model is None else model.from_dataset(ds).coefficients().A
    except ParameterError:  # a stored map may hold anything; its values are shown all the same
        return None
    return A if isinstance(A, xr.DataArray) else None
