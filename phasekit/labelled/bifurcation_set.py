"""Bifurcation sets in a plane of two parameters, labelled."""

from __future__ import annotations

from typing import Any

import numpy as np
import xarray as xr

from phasekit.bifurcation.exact.bifurcation_set import Cusp, Piece, loci
from phasekit.bifurcation.exact.normal_forms import cubic_coefficient, quadratic_coefficient
from phasekit.bifurcation.exact.plane import Plane, regions
from phasekit.cells.schema import dataset_attrs, input_attrs
from phasekit.errors import ParameterError
from phasekit.labelled.atlas import limits, single
from phasekit.labels.arguments import unknown
from phasekit.labels.grid import LABEL_DTYPE, variable
from phasekit.systems.system import System
from phasekit.table.row import FROM_MOTION

#: What each kind of curve is.
CURVES = {
    "fold": "lower saddle and upper center merge: |B|^(2/3) + |C|^(2/3) = |A|^(2/3)",
    "pitchfork": "three equilibria merge, as B or C is zero in the whole plane: |A| = |B| + |C|",
    "sign_change": "A = 0",
    "equal_saddles": "both saddles have the same energy (heteroclinic cycle): A > 0 and B = 0, or "
    "A < 0 and C = 0, inside the fold",
    "equal_centers": "both centers have the same energy: A > 0 and C = 0, or A < 0 and B = 0, "
    "inside the fold",
}


def bifurcation_set(
    system: Any,
    x: str,
    y: str,
    *,
    xlim: tuple[float, float],
    ylim: tuple[float, float],
) -> xr.Dataset:
    """Fold, sign-change and equal-energy curves in a plane of two parameters.

    Parameters
    ----------
    system : system
        A single system; its own values of the two parameters are not used.
    x, y : str
        Two different parameters on which the equilibria depend.
    xlim, ylim : (float, float)
        The part of the plane, in the parameters' units.

    Returns
    -------
    xarray.Dataset
        Curves on (``curve``, ``point``), in order along each: both parameters (coordinates),
        ``phi`` (angle of the merged equilibria, on folds and pitchforks, continuous) and
        ``quadratic`` (coefficient of the fold's normal form, 0 at cusps); shorter curves end in
        NaN. On ``curve``: ``curve_kind`` (fold, pitchfork, sign_change, equal_saddles,
        equal_centers), ``merging`` (which equilibria merge), ``sign_of_A`` (-1: the side A < 0,
        1: A > 0, 0: A = 0) and ``closed``. On ``cusp``: ``cusp_<x>``, ``cusp_<y>``, ``cusp_phi``,
        ``cusp_like`` (center: two centers and a saddle become a center; saddle: two saddles and a
        center become a saddle) and ``cusp_cubic``, the coefficient of the normal form. On
        ``region``: a point ``region_<x>``, ``region_<y>`` inside each region, its
        ``region_count`` of equilibria and the distance ``region_reach`` to its border, in units
        of the plane.

    Raises
    ------
    ParameterError
        If the system is not a single one, a parameter is unknown, or limits leave its domain.

    Notes
    -----
    On the fold the merged pair has ``A cos^3 phi = B`` and ``A sin^3 phi = -C``
    (``V' = V'' = 0`` with V' of [Veljovic2015] (12)); the curve is traced in both parameters and
    phi, where it is smooth, and so runs on through its cusps. Inside the fold set four equilibria
    exist, outside lower center and upper saddle only. Vertices solve the equations to rounding in
    units of the plane; cusps and ends on its edges are vertices. Curves are found from all their
    crossings with a net of 52 lines, by exact arithmetic: one that lies between them, closed and
    smaller than 1/20 of the plane, may be missing; narrow the limits to see it.

    The normal form at a fold is ``x'' = ... + quadratic x^2``, at a cusp ``x'' = ... + cubic x^3``,
    with ``quadratic = -V'''/2`` and ``cubic = -V''''/6`` and x the angle from the merged point
    ([Kuznetsov2004] sections 3.3 and 8.2).

    If B or C vanishes in the whole plane (a disk with a = 0), equilibria merge three at a time:
    there are pitchforks instead of folds, and every system with ``A < 0`` and C = 0, or ``A > 0``
    and B = 0, inside them has saddles of the same energy; no curve says that.

    Examples
    --------
    >>> import phasekit as pk
    >>> from phasekit.labelled.bifurcation_set import bifurcation_set
    >>> reduced = pk.Reduced(lam=0.0, psi=0.0)
    >>> ds = bifurcation_set(reduced, "lam", "psi", xlim=(-1.5, 1.5), ylim=(-1.5, 1.5))
    >>> ds.curve_kind.values.tolist()
    ['fold', 'equal_saddles', 'equal_centers']
    >>> astroid = ds.isel(curve=0)
    >>> gap = abs(astroid.lam) ** (2 / 3) + abs(astroid.psi) ** (2 / 3) - 1
    >>> bool((abs(gap) < 1e-12).all()), bool(astroid.closed), ds.sizes["cusp"]
    (True, True, 4)
    """
    system, values = single(system, x, y)
    formula = system.formula_inputs()
    for argument, name in (("x", x), ("y", y)):
        if not isinstance(name, str) or name not in formula:
            what = f"{argument}: parameter of bifurcation_set for {type(system).__name__}"
            raise unknown(what, name, formula)
    if x == y:
        raise ParameterError(f"y: got {y!r}, wants a parameter that is not on x")
    box = limits(system, x, "xlim", xlim), limits(system, y, "ylim", ylim)
    plane = Plane(system.trigonometric(), values, (x, y), box)
    pieces, cusps = loci(plane)
    return _dataset(system, plane, pieces, cusps)


def _dataset(system: System, plane: Plane, pieces: list[Piece], cusps: list[Cusp]) -> xr.Dataset:
    x, y = plane.names
    about = {name: input_attrs(system, name) for name in plane.names}
    values = {name: np.full(1, value) for name, value in plane.values.items()}

    def A(at_x: Any, at_y: Any) -> Any:
        full = {name: np.full(np.shape(at_x), value[0]) for name, value in values.items()}
        return type(system).valid_coefficients({**full, x: at_x, y: at_y})[0]

    quadratic = [
        quadratic_coefficient(A(piece.x, piece.y), piece.phi)
        if piece.kind == "fold"
        else np.full(piece.x.size, np.nan)
        for piece in pieces
    ]
    curves = ("curve", "point")
    data = {
        "phi": variable(
            curves,
            _table([piece.phi for piece in pieces]),
            {
                "long_name": "angle of the merged equilibria",
                "units": "rad",
                "equation": "A cos(phi)^3 = B, A sin(phi)^3 = -C",
                "source": FROM_MOTION,
            },
        ),
        "quadratic": variable(
            curves,
            _table(quadratic),
            {
                "long_name": "coefficient of x^2 in the normal form of the fold",
                "units": "s-2",
                "equation": "-V'''/2 = -(3/2) A sin(phi) cos(phi)",
                "source": FROM_MOTION,
            },
        ),
        "curve_kind": _text("curve", [p.kind for p in pieces], "kind of the curve"),
        "merging": _text("curve", [_merging(p) for p in pieces], "equilibria that merge"),
        "sign_of_A": variable(
            ("curve",),
            np.array([p.sign_of_A for p in pieces], np.int8),
            {"long_name": "sign of A on the curve"},
        ),
        "closed": variable(
            ("curve",),
            np.array([p.closed for p in pieces], bool),
            {"long_name": "whether the curve is closed"},
        ),
        **_cusps(plane, cusps, about, A),
        **_regions(plane, about),
    }
    coords = {
        x: variable(curves, _table([p.x for p in pieces]), about[x]),
        y: variable(curves, _table([p.y for p in pieces]), about[y]),
    }
    for name, value in system.parameters.items():
        if name not in plane.names:
            coords[name] = variable((), value, input_attrs(system, name))
    box = {"xlim": list(plane.limits[0]), "ylim": list(plane.limits[1])}
    attrs = {**dataset_attrs(system), "x": x, "y": y, **box}
    return xr.Dataset(data, coords=coords, attrs=attrs)


def _table(rows: list[Any]) -> Any:
    """Rows of different lengths in one array, filled up with NaN."""
    table = np.full((len(rows), max((len(row) for row in rows), default=0)), np.nan)
    for line, row in zip(table, rows, strict=True):
        line[: len(row)] = row
    return table


def _text(dim: str, values: list[str], long_name: str) -> xr.Variable:
    return variable((dim,), np.array(values, LABEL_DTYPE), {"long_name": long_name})


def _merging(piece: Piece) -> str:
    if piece.kind == "fold":
        return "lower_saddle upper_center"
    if piece.kind != "pitchfork":
        return ""
    along_B = abs(np.cos(piece.phi[0])) > 0.5
    if along_B == (piece.sign_of_A > 0):
        return "lower_center lower_saddle upper_center"
    return "lower_saddle upper_center upper_saddle"


def _cusps(plane: Plane, cusps: list[Cusp], about: Any, A: Any) -> dict[str, xr.Variable]:
    x, y, phi = (np.array([getattr(c, n) for c in cusps], float) for n in ("x", "y", "phi"))
    cubic = cubic_coefficient(A(x, y), phi)
    dim = ("cusp",)
    return {
        f"cusp_{plane.names[0]}": variable(dim, x, about[plane.names[0]]),
        f"cusp_{plane.names[1]}": variable(dim, y, about[plane.names[1]]),
        "cusp_phi": variable(dim, phi, {"long_name": "angle of the cusp point", "units": "rad"}),
        "cusp_like": _text("cusp", [c.like for c in cusps], "what the merged equilibria become"),
        "cusp_cubic": variable(
            dim,
            cubic,
            {
                "long_name": "coefficient of x^3 in the normal form of the cusp",
                "units": "s-2",
                "equation": "-V''''/6 = -(1/2) A cos(2 phi)",
                "source": FROM_MOTION,
            },
        ),
    }


def _regions(plane: Plane, about: Any) -> dict[str, xr.Variable]:
    found = regions(plane)
    x, y, count, reach = (np.array(column) for column in zip(*found, strict=True))
    dim = ("region",)
    return {
        f"region_{plane.names[0]}": variable(dim, x, about[plane.names[0]]),
        f"region_{plane.names[1]}": variable(dim, y, about[plane.names[1]]),
        "region_count": variable(
            dim, count.astype(np.int8), {"long_name": "number of equilibria in the region"}
        ),
        "region_reach": variable(
            dim, reach, {"long_name": "distance from the border in units of the plane"}
        ),
    }
