"""Bifurcation sets in a plane of two parameters, labelled."""

from __future__ import annotations

from typing import Any

import numpy as np
import xarray as xr

from phasekit.bifurcation.along import Loci, loci_in
from phasekit.bifurcation.curves import Cusp
from phasekit.cells.request import with_words
from phasekit.cells.schema import dataset_attrs, input_attrs, own_names
from phasekit.errors import ParameterError
from phasekit.inputs import call_checked
from phasekit.labelled.atlas import limits, resting, tell_missing
from phasekit.labels.arguments import unknown
from phasekit.labels.grid import LABEL_DTYPE, variable
from phasekit.laws.trigonometric import Trigonometric
from phasekit.systems.system import System
from phasekit.table.quantities import ROWS
from phasekit.table.row import FROM_MOTION

#: What each kind of curve is.
CURVES = {
    "fold": "a saddle and a center merge: V' = V'' = 0, |B|^(2/3) + |C|^(2/3) = |A|^(2/3)",
    "pitchfork": "three equilibria merge, by a symmetry of the whole plane: V'' = 0 at one that "
    "rests; |A| = |B| + |C|, where B or C is zero",
    "transcritical": "an equilibrium crosses one that rests in the whole plane, which is V'' = 0",
    "sign_change": "A = 0",
    "equal_saddles": "both saddles, or two neighbors, have the same energy (heteroclinic): A > 0 "
    "and B = 0, or A < 0 and C = 0, inside the fold",
    "equal_centers": "both centers, or two neighbors, have the same energy: A > 0 and C = 0, or "
    "A < 0 and B = 0, inside the fold",
    "window_exit": "an equilibrium leaves at an end of the interval: V' = 0 there",
}


@call_checked
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
        A single system in a potential; its own values of the two parameters are not used. Of a
        `Perturbed` system the constant torque counts, and nothing else.
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
        NaN. On ``curve``: ``curve_kind`` (fold, pitchfork, transcritical, sign_change,
        equal_saddles, equal_centers, window_exit), ``merging`` (which equilibria merge), with
        coefficients (A, B, C) ``sign_of_A`` (-1: the side A < 0, 1: A > 0, 0: A = 0), and
        ``closed``. On ``cusp``: ``cusp_<x>``, ``cusp_<y>``, ``cusp_phi``,
        ``cusp_like`` (center: two centers and a saddle become a center; saddle: two saddles and a
        center become a saddle) and ``cusp_cubic``, the coefficient of the normal form. On
        ``region``: a point ``region_<x>``, ``region_<y>`` inside each region, its
        ``region_count`` of equilibria and the distance ``region_reach`` to its border, in units
        of the plane. ``complete`` says whether it is proved that no curve is missing at which the
        number of equilibria changes.

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

    Of any other potential, or under a torque, no such curve is missing where ``complete`` is True:
    each reaches an edge of the plane, or has a cusp or a point where x is extreme along it, and all
    of these are proved by interval arithmetic [MooreKearfottCloud2009]. Where an equilibrium rests
    in the whole plane and others merge right beside it, it is not proved. Curves of equal energies
    are those of neighbors, found on a grid of 25 x 25 points.

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
    system, law, values = resting(system, x, what="bifurcation_set", called="x: parameter")
    if not isinstance(y, str) or y not in values:
        what = f"y: parameter of bifurcation_set for {type(system).__name__}"
        raise unknown(what, y, values)
    if x == y:
        raise ParameterError(f"y: got {y!r}, wants a parameter that is not on x")
    box = limits(system, x, "xlim", xlim), limits(system, y, "ylim", ylim)
    found = loci_in(law, values, (x, y), box)
    tell_missing("bifurcation_set", f"{x} and {y}", found.missing)
    return _dataset(system, (x, y), box, found)


def _dataset(system: System, names: tuple[str, str], box: Any, found: Loci) -> xr.Dataset:
    (x, y), pieces = names, found.curves
    about = {name: input_attrs(system, name) for name in names}
    exact = system.standing.is_within(Trigonometric)
    (angle,) = with_words(system, [ROWS["phi"]])
    curves = ("curve", "point")
    data = {
        "phi": variable(
            curves,
            _table([piece.phi for piece in pieces]),
            {
                "long_name": f"{'angle' * exact or 'coordinate'} of the merged equilibria",
                "units": angle.units,
                "equation": "A cos(phi)^3 = B, A sin(phi)^3 = -C" if exact else "V' = V'' = 0",
                "source": angle.source,
            },
        ),
        "quadratic": variable(
            curves,
            _table([piece.quadratic for piece in pieces]),
            {
                "long_name": "coefficient of x^2 in the normal form of the fold",
                "units": "s-2",
                "equation": "-V'''/2" + " = -(3/2) A sin(phi) cos(phi)" * exact,
                "source": angle.source,
            },
        ),
        "curve_kind": _text("curve", [p.kind for p in pieces], "kind of the curve"),
        "merging": _text("curve", [p.merging for p in pieces], "equilibria that merge"),
        "closed": variable(
            ("curve",),
            np.array([p.closed for p in pieces], bool),
            {"long_name": "whether the curve is closed"},
        ),
        **_cusps(names, found.cusps, about, angle.units, exact),
        **_regions(names, found.regions, about),
        "complete": variable(
            (), not found.missing and not exact, {"long_name": "whether no curve can be missing"}
        ),
    }
    if exact:
        data["sign_of_A"] = variable(
            ("curve",),
            np.array([p.sign_of_A for p in pieces], np.int8),
            {"long_name": "sign of A on the curve"},
        )
    coords = {
        x: variable(curves, _table([p.x for p in pieces]), about[x]),
        y: variable(curves, _table([p.y for p in pieces]), about[y]),
    }
    for name, value in system.parameters.items():
        if name not in names and name not in data:
            coords[name] = variable((), value, input_attrs(system, name))
    ends = {"xlim": list(box[0]), "ylim": list(box[1])}
    attrs = {**dataset_attrs(system), "x": x, "y": y, **ends}
    coords |= own_names(system.coordinate or "phi", {**data, **coords})
    return xr.Dataset(data, coords=coords, attrs=attrs)


def _table(rows: list[Any]) -> Any:
    """Rows of different lengths in one array, filled up with NaN."""
    table = np.full((len(rows), max((len(row) for row in rows), default=0)), np.nan)
    for line, row in zip(table, rows, strict=True):
        line[: len(row)] = row
    return table


def _text(dim: str, values: list[str], long_name: str) -> xr.Variable:
    return variable((dim,), np.array(values, LABEL_DTYPE), {"long_name": long_name})


def _cusps(
    names: tuple[str, str], cusps: list[Cusp], about: Any, units: str, exact: bool
) -> dict[str, xr.Variable]:
    columns = ("x", "y", "phi", "cubic")
    x, y, phi, cubic = (np.array([getattr(c, n) for c in cusps], float) for n in columns)
    dim, angle = ("cusp",), "angle" if units == "rad" else "coordinate"
    return {
        f"cusp_{names[0]}": variable(dim, x, about[names[0]]),
        f"cusp_{names[1]}": variable(dim, y, about[names[1]]),
        "cusp_phi": variable(dim, phi, {"long_name": f"{angle} of the cusp point", "units": units}),
        "cusp_like": _text("cusp", [c.like for c in cusps], "what the merged equilibria become"),
        "cusp_cubic": variable(
            dim,
            cubic,
            {
                "long_name": "coefficient of x^3 in the normal form of the cusp",
                "units": "s-2",
                "equation": "-V''''/6" + " = -(1/2) A cos(2 phi)" * exact,
                "source": FROM_MOTION if exact else "",
            },
        ),
    }


def _regions(
    names: tuple[str, str], found: list[tuple[float, float, int, float]], about: Any
) -> dict[str, xr.Variable]:
    x, y, count, reach = np.array(found, float).reshape(-1, 4).T
    dim = ("region",)
    return {
        f"region_{names[0]}": variable(dim, x, about[names[0]]),
        f"region_{names[1]}": variable(dim, y, about[names[1]]),
        "region_count": variable(
            dim, count.astype(np.int8), {"long_name": "number of equilibria in the region"}
        ),
        "region_reach": variable(
            dim, reach, {"long_name": "distance from the border in units of the plane"}
        ),
    }
