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
from phasekit.labels.arguments import bad, flag, number, unknown
from phasekit.plot.parts import labels, style
from phasekit.plot.parts.strands import relative_gap
from phasekit.systems.identity import model_name
from phasekit.systems.registry import model_named

# The values along x and along y, as shown.
Grid = tuple[NDArray[Any], NDArray[Any]]

COUNT_NAMES = {-1: "not valid", 0: "none", 2: "2", 3: "3, on a fold", 4: "4"}


def parameter_map(
    dataset: xr.Dataset,
    variable: str = "topology",
    *,
    x: str | None = None,
    y: str | None = None,
    angles: style.Angles = "rad",
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
    variable : str
        The quantity to draw.
    x, y : str, optional
        The parameters on the axes; left out, the first two that are swept, in their order.
    angles : {"rad", "deg"}
        Unit in which angles are shown.
    log : bool
        Whether numbers have a logarithmic scale of colors; those that are not positive are absent.
    legend : bool
        Whether to explain the curves under the axes.
    ax : matplotlib.axes.Axes, optional
        Where to draw; a new figure if left out. The color bar takes its room from it. A given
        figure without layout engine gets the constrained one, unless `legend` is False.
    **sel
        Labels or values along the other dims, such as ``equilibrium="lower_saddle"`` or
        ``omega1=2.5``; of numbers the nearest is taken.

    Returns
    -------
    matplotlib.axes.Axes

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
    style.angle_factor(angles)
    flag("log", log)
    ds = labels.dataset(dataset, "dataset", ())
    if not isinstance(variable, str) or variable not in ds.data_vars:
        raise unknown("variable", variable, map(str, ds.data_vars))
    chosen = _select(ds, variable, sel)
    field = chosen[variable]
    across, up = _axes_of(field, x, y)
    field = field.transpose(up.dims[0], across.dims[0])
    axes = style.axes_for(ax, legend=legend, width=6.8)

    grid = labels.shown(across, angles)[0], labels.shown(up, angles)[0]
    handles = _draw_field(axes, grid, field, angles, _named(ds[variable], sel), log)
    handles += _draw_curves(axes, grid, chosen, across, up)
    axes.set_xlabel(labels.label(across, angles, style.letters(axes, "x")))
    axes.set_ylabel(labels.label(up, angles, style.letters(axes, "y")))
    if legend:
        style.legend_below(axes, handles)
    return axes


def _select(ds: xr.Dataset, variable: str, sel: Mapping[str, Any]) -> xr.Dataset:
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
    return ", ".join(names).replace("_", " ")


def _axes_of(
    field: xr.DataArray, x: str | None, y: str | None
) -> tuple[xr.DataArray, xr.DataArray]:
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
    ax: Axes, grid: Grid, field: xr.DataArray, angles: style.Angles, selected: str, log: bool
) -> list[Artist]:
    """Draw the cells and the color bar: codes by name, numbers on a scale."""
    text = labels.label(field, angles, style.letters(ax, "y"), selected)
    if field.dtype.kind in "iub":
        return _draw_codes(ax, grid, field, text)
    return _draw_values(ax, grid, labels.shown(field, angles)[0], text, log)


def _draw_codes(ax: Axes, grid: Grid, field: xr.DataArray, text: str) -> list[Artist]:
    """Draw integers and booleans, one color each; the colors of a code never change."""
    names, colors = _code_book(field)
    present = [int(code) for code in np.unique(field.values.astype(int))]
    index = np.searchsorted(present, field.values.astype(int))
    palette = ListedColormap([colors.get(code, style.GRAY) for code in present])
    norm = BoundaryNorm(np.arange(len(present) + 1) - 0.5, len(present))
    mesh = ax.pcolormesh(*grid, index, cmap=palette, norm=norm, shading="nearest", rasterized=True)
    bar = ax.figure.colorbar(mesh, ax=ax, ticks=range(len(present)), label=text)
    words = [names.get(code, str(code)) for code in present]
    upright = max(map(len, words)) <= 3
    bar.ax.set_yticklabels(words, rotation=0 if upright else 90, va="center")
    bar.ax.tick_params(which="both", length=0)
    return []


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
        norm = LogNorm(*(style.log_limits([10.0**low, 10.0**high]) or (None, None)))
    ax.set_facecolor(style.NOTHING)
    mesh = ax.pcolormesh(
        *grid, values, cmap=style.SEQUENTIAL, norm=norm, shading="nearest", rasterized=True
    )
    bar = ax.figure.colorbar(mesh, ax=ax, label=text, extend=extend)
    if isinstance(norm, LogNorm):
        style.log_ticks(bar)
    absent = np.ma.getmaskarray(values).any()
    return [Patch(facecolor=style.NOTHING, edgecolor=style.GRAY, label="absent")] if absent else []


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
        ax.contour(
            *grid,
            np.ma.masked_invalid(values),
            levels=[0.0],
            colors=[look["color"]],
            linestyles=[look["linestyle"]],
            linewidths=[look["linewidth"]],
        )
        handles.append(Line2D([], [], **look))
    return handles


def _coefficient_A(ds: xr.Dataset) -> xr.DataArray | None:
    """Return A over the map, or None if the Dataset cannot rebuild its model."""
    try:
        A = model_named("ds", model_name(ds)).from_dataset(ds).coefficients().A
    except ParameterError:
        return None
    return A if isinstance(A, xr.DataArray) else None
