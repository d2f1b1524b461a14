"""`atlas`: all bifurcations of equilibria in a rectangle of two parameters."""

from __future__ import annotations

import functools
import itertools
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt
import xarray as xr

from phasekit.arrays import Array
from phasekit.cells.schema import dataset_attrs
from phasekit.errors import ParameterError, warn
from phasekit.inputs import call_checked
from phasekit.labelled.continuation.atlas_curves import KINDS_OF_CURVES, CurveSearch, polyline
from phasekit.labelled.continuation.atlas_cycles import (
    KINDS_OF_CYCLES,
    SMALL,
    CycleSearch,
    called,
    cycle_line,
    cycles_in,
    ends_of,
    orbit_sizes,
    ranges_of,
    within,
)
from phasekit.labelled.continuation.atlas_tables import html_of, tables_of, text_of
from phasekit.labelled.continuation.branch import Branch
from phasekit.labelled.continuation.branch_points import attrs_of
from phasekit.labelled.continuation.checks import check_parameter, check_span
from phasekit.labelled.continuation.special_point import SpecialPoint
from phasekit.labelled.pictures import picture
from phasekit.labels.arguments import bad, flag, numeric, unknown
from phasekit.labels.grid import LABEL_DTYPE, variable
from phasekit.numerics.interrupts import hold, keeps, may_end
from phasekit.numerics.waits import notice, stage
from phasekit.pickles import Stamped
from phasekit.systems.plane_regions import FINE, Regions, RegionSearch
from phasekit.systems.problem import Problem, as_problem
from phasekit.systems.rests import corners, window_of
from phasekit.systems.smooth import refuse_jumps

if TYPE_CHECKING:
    import pandas as pd


#: Cuts of the rectangle along each parameter, and places on each at which branches begin.
CUTS = 5
#: How often curves are looked for where something may change that no curve explains.
ROUNDS = 4
#: Places through which they are looked for each time.
PLACES = 6
#: Parts of the rectangle and of the window within which points of one kind are the same.
SAME = 1e-6, 1e-4


@dataclass(frozen=True, eq=False, repr=False)
class Atlas(Stamped):
    """Curves in a rectangle of two parameters, and the regions between them; made by `atlas`.

    Attributes
    ----------
    problem : Problem
        What it is an atlas of.
    names : (str, str)
        The two parameters.
    span, window : dict
        Their ranges, and those of the states.
    curves : tuple of Branch
        Curves of folds, Hopf points and branch points, and those on which an equilibrium lies on
        the edge of the window (of kind event), each once; where cycles were asked for, behind them
        curves of cycles (of kind fold_of_cycles, period_doubling, torus, connection).
    messages : tuple of str
        What was not found, or is not proved.
    not_followed : tuple of str
        Which curves of cycles were not followed, or not to their end, and in which regions the
        number of limit cycles is in doubt; and why.

    Examples
    --------
    >>> import phasekit as pk
    >>> cusp = pk.Problem("mu + l*x - x^3", "x", {"mu": 0.0, "l": 0.0}, window={"x": (-3, 3)})
    >>> found = pk.atlas(cusp, "mu", "l", span={"mu": (-1, 1), "l": (-1, 2)})
    >>> [curve.kind for curve in found.curves], [point.kind for point in found.special_points]
    (['fold'], ['cusp'])
    >>> found.counts(mu=[0.0, 0.0], l=[-0.5, 1.0]).n_equilibria.values.tolist()
    [1, 3]
    >>> found.to_dataset().curve_kind.values.tolist(), len(found.lines())
    (['fold'], 1)
    >>> ax = found.plot()
    """

    problem: Problem
    names: tuple[str, str]
    span: Mapping[str, tuple[float, float]]
    window: Mapping[str, tuple[float, float]]
    curves: tuple[Branch, ...]
    messages: tuple[str, ...]
    not_followed: tuple[str, ...]
    _counts: RegionSearch
    _regions: Regions
    _n_cycles: npt.NDArray[np.int64]

    @functools.cached_property
    def special_points(self) -> tuple[SpecialPoint[Branch], ...]:
        """Points of codimension two, each once though two curves meet there."""
        return points_of(self.curves, self.problem, self.span, self.window)

    @functools.cached_property
    def ends(self) -> tuple[tuple[SpecialPoint[Any] | None, ...], ...]:
        """Of each of ``curves`` the points at which a curve of cycles begins and ends; or None."""
        sizes = np.array([high - low for low, high in self.span.values()])
        return tuple(
            tuple(ends_of(curve, self.special_points, self.names, sizes))
            if curve.kind in KINDS_OF_CYCLES else (None, None)
            for curve in self.curves
        )  # fmt: skip

    @functools.cached_property
    def narrow_regions(self) -> tuple[dict[str, float], ...]:
        """Numbers of equilibria in regions that no cell fits in: one point of each such pair.

        Both parameters, ``n_equilibria`` and ``n_stable``, as far as these are proved there. They
        are looked for at one place in each block of 4 x 4 cells in which two curves pass each
        other: an empty result proves nothing.
        """
        rows = zip(*(part.tolist() for part in self._counts.narrow(self._regions)), strict=True)
        names = (*self.names, "n_equilibria", "n_stable")
        return tuple(dict(zip(names, [*place, *numbers], strict=True)) for place, numbers in rows)

    @property
    def complete(self) -> dict[str, bool]:
        """Whether each number is proved off the curves: of equilibria, and of stable ones."""
        found = self._regions
        return {
            "n_equilibria": not found.why and not found.far(found.open_equilibria).any()
            and not bool((found.n_equilibria < 0).any()),
            "n_stable": not found.why_stable and not found.far(found.open_stable).any()
            and not bool((found.n_stable < 0).any()),
        }  # fmt: skip

    def counts(self, **parameters: Any) -> xr.Dataset:
        """The numbers of equilibria at points of the plane.

        Those of a point whose cell is proved are those of its region; near curves, and where
        nothing is proved, equilibria are counted at the point itself.

        Parameters
        ----------
        **parameters : float or array_like
            Both parameters by name, of one shape.

        Returns
        -------
        xarray.Dataset
            On ``place``: ``n_equilibria``, ``n_stable``, ``region`` (-1 in cells that a curve
            crosses) and ``complete``, whether the first number is proved.

        Raises
        ------
        ParameterError
            If a parameter is missing or unknown, or a point lies outside of the rectangle.
        """
        for name in parameters:
            if name not in self.names:
                raise unknown("parameter of the atlas", name, self.names)
        columns = []
        for name in self.names:
            if name not in parameters:
                raise bad(name, None, "one number or several")
            low, high = self.span[name]
            values = np.atleast_1d(numeric(name, parameters[name], None, "numbers"))
            if values.ndim != 1 or not np.all((values >= low) & (values <= high)):
                raise bad(name, parameters[name], f"numbers from {low:.9g} to {high:.9g}")
            columns.append(values)
        if columns[0].shape != columns[1].shape:
            raise bad(self.names[1], columns[1].shape, f"as many as of {self.names[0]}")
        places = np.stack(columns, axis=1)
        found = self._regions
        i, j = self._counts.cells(places).T
        region = found.region[i, j]
        numbers = np.stack([found.n_equilibria[region], found.n_stable[region]], axis=1)
        sure = (region >= 0) & ~found.open_equilibria[i, j] & ~found.open_stable[i, j]
        sure &= (numbers >= 0).all(axis=1) & (not found.why) & (not found.why_stable)
        proved = sure.copy()
        if not sure.all():
            numbers[~sure], proved[~sure] = self._counts.counted(places[~sure])
        dim = ("place",)
        return xr.Dataset(
            {
                "n_equilibria": variable(dim, numbers[:, 0], {"long_name": "number of equilibria"}),
                "n_stable": variable(dim, numbers[:, 1], {"long_name": "number of stable ones"}),
                "region": variable(dim, region, {"long_name": "number of the region"}),
                "complete": variable(
                    dim, proved, {"long_name": "whether the number of equilibria is proved"}
                ),
            },
            {
                name: variable(dim, column, attrs_of(self.problem, name))
                for name, column in zip(self.names, columns, strict=True)
            },
        )

    def to_dataset(self) -> xr.Dataset:
        """Curves, points of codimension two, regions and cells as one Dataset.

        Returns
        -------
        xarray.Dataset
            Both parameters and the states on (``curve``, ``point``), shorter curves end in NaN, and
            of curves of cycles the states are NaN; ``curve_kind``, ``curve_begins`` and
            ``curve_ends``, the label of the point there or the reason; on ``special_point``
            ``special_kind``, ``special_label`` and where they are; on ``region``
            ``region_n_equilibria``, ``region_n_stable`` (-1 where parts of a region disagree),
            ``region_n_cycles`` (-1 where cycles were not counted, or their number is in doubt), a
            point well inside and how far (``region_reach``); on ``narrow`` the
            ``narrow_regions``; on (``cell_<first>``, ``cell_<second>``) the ``region``, -1 where a
            curve crosses the cell, ``n_equilibria_open`` and ``n_stable_open``, where a change is
            not excluded though no curve is there. ``complete`` on ``number``.
        """
        free = (*self.names, *self.problem.state)
        most = max((ranges_of(curve).sizes["point"] for curve in self.curves), default=0)
        table = np.full((len(free), len(self.curves), most), np.nan)
        for k, curve in enumerate(self.curves):
            points = ranges_of(curve)
            for row, name in enumerate(free):
                if name in points:
                    table[row, k, : points.sizes["point"]] = points[name].values
        found, specials = self._regions, self.special_points
        data: dict[str, Any] = {
            name: variable(("curve", "point"), table[row], attrs_of(self.problem, name))
            for row, name in enumerate(free)
        }
        labels = np.array(
            [(called(curve), *self._named(curve)) for curve in self.curves], LABEL_DTYPE
        ).reshape(-1, 3)
        for name, column in zip(("kind", "begins", "ends"), labels.T, strict=True):
            data[f"curve_{name}"] = variable(("curve",), column)
        for what in ("kind", "label"):
            words = np.array([getattr(point, what) for point in specials], LABEL_DTYPE)
            data[f"special_{what}"] = variable(("special_point",), words)
        for name in free:
            values = np.array([point[name] for point in specials], float)
            data[f"special_{name}"] = variable(("special_point",), values)
        data["region_n_equilibria"] = variable(("region",), found.n_equilibria)
        data["region_n_stable"] = variable(("region",), found.n_stable)
        data["region_n_cycles"] = variable(
            ("region",), self._n_cycles, {"long_name": "number of limit cycles, not proved"}
        )
        data["region_reach"] = variable(("region",), found.reach)
        for k, name in enumerate(self.names):
            data[f"region_{name}"] = variable(("region",), found.place[:, k])
        for name in (*self.names, "n_equilibria", "n_stable"):
            values = np.array([row[name] for row in self.narrow_regions])
            data[f"narrow_{name}"] = variable(("narrow",), values)
        cells = tuple(f"cell_{name}" for name in self.names)
        data["cell_region"] = variable(cells, found.region)
        data["n_equilibria_open"] = variable(cells, found.open_equilibria)
        data["n_stable_open"] = variable(cells, found.open_stable)
        complete = self.complete
        data["complete"] = variable(("number",), np.array(list(complete.values())))
        coords = {"number": variable(("number",), np.array(list(complete), LABEL_DTYPE))}
        for k, name in enumerate(cells):
            middles = (
                self._counts.start[k]
                + (np.arange(self._counts.side) + 0.5) * (self._counts.step[k])
            )
            coords[name] = variable((name,), middles)
        attrs = {**dataset_attrs(self.problem), "x": self.names[0], "y": self.names[1]}
        attrs["messages"] = "; ".join(self.messages)
        attrs["not_followed"] = "; ".join(self.not_followed)
        return xr.Dataset(data, coords, attrs)

    def lines(self) -> list[list[Array]]:
        """The curves in the plane, each as runs of points closer than cells.

        Returns
        -------
        list of list of ndarray
            Of each of ``curves``: runs of shape (points, 2); of a Hopf curve without its neutral
            saddles; of a curve of cycles up to the points at which it begins and ends.
        """
        return [
            lines_of(curve, self.names, FINE * self._counts.step, ends)
            for curve, ends in zip(self.curves, self.ends, strict=True)
        ]

    def table(self, of: str = "special_points") -> pd.DataFrame:
        """The special points, the curves or the regions, a row each, for reading.

        Parameters
        ----------
        of : {"special_points", "curves", "regions"}
            What has a row. Regions with the same numbers share one.

        Returns
        -------
        pandas.DataFrame
            Of special points label and kind, parameters and states; of curves kind, the label of
            the point or the reason at both ends, and the ranges of the parameters; of regions
            ``n_equilibria``, ``n_stable`` and, where they were counted, ``n_cycles`` (NA where a
            number is not known), how many regions and what share of the plane, and a place in one.

        Raises
        ------
        ParameterError
            If there is no such table.

        Examples
        --------
        >>> import phasekit as pk
        >>> cusp = pk.Problem("mu + l*x - x^3", "x", {"mu": 0.0, "l": 0.0}, window={"x": (-3, 3)})
        >>> found = pk.atlas(cusp, "mu", "l", span={"mu": (-1, 1), "l": (-1, 2)})
        >>> found.table("regions")[["n_equilibria", "n_stable", "regions"]].values.tolist()
        [[1, 1, 1], [3, 2, 1]]
        """
        tables = tables_of(self)
        if not isinstance(of, str) or of not in tables:
            raise unknown("of: table", of, tables)
        return tables[of]

    def plot(self, ax: Any = None, **keywords: Any) -> Any:
        """Draw the curves, the regions and the points of codimension two.

        Parameters
        ----------
        ax : matplotlib.axes.Axes, optional
            Where to draw; a new figure if left out.
        **keywords
            What `phasekit.plot.atlas` takes.

        Returns
        -------
        matplotlib.axes.Axes
        """
        return picture("atlas")(self, ax=ax, **keywords)

    def __repr__(self) -> str:
        """Write the curves, the points, the regions, and what is proved."""
        return text_of(self)

    def _repr_html_(self) -> str:
        """Write the same for a notebook, in tables."""
        return html_of(self)

    def _named(self, curve: Branch, *, where: bool = False) -> tuple[str, str]:
        """What a curve begins and ends at: the label of a point, or a reason; and where."""
        names = []
        (own,) = (k for k, one in enumerate(self.curves) if one is curve)
        for i, end in zip((0, -1), self.ends[own], strict=True):
            text = curve.stops[i].reason if end is None else end.label
            there = ranges_of(curve).isel(point=i) if end is None else end
            at = ", ".join(f"{name} = {float(there[name]):.6g}" for name in self.names)
            names.append(f"{text} ({at})" if where else text)
        return names[0], names[1]


@call_checked
@keeps
def atlas(
    problem: Any,
    x: str,
    y: str,
    *,
    span: Mapping[str, Any],
    window: Mapping[str, Any] | None = None,
    cycles: bool = False,
) -> Atlas:
    """All bifurcations of equilibria in a rectangle of two parameters, from a box alone.

    Where asked for, the curves of cycles that begin at these, too.

    Parameters
    ----------
    problem : Problem or system
        A flow without forcing, whose other parameters are numbers.
    x, y : str
        The two parameters.
    span : mapping of str to (float, float)
        Lowest and highest value of each.
    window : mapping of str to (float, float), optional
        Where equilibria are looked for, by state; by default the problem's own, and of angles the
        whole turn.
    cycles : bool, default False
        Whether curves of cycles are followed, too: those that begin at points of codimension two,
        and those that a few families from Hopf points meet.

    Returns
    -------
    Atlas
        Curves of folds, Hopf points and branch points, and of equilibria on the edge of the window,
        each once; points of codimension two; the regions between the curves with their numbers of
        equilibria and of stable ones.

    Warns
    -----
    RuntimeWarning
        If it is not proved that no curve of equilibria is missing, or a curve of cycles was not
        followed. Ctrl-C while cycles are followed or counted keeps what is there, and is said so.

    Notes
    -----
    All equilibria at places along cuts of the rectangle are found by interval arithmetic and
    followed; the curves through their special points are followed once each, and those that pass
    through points of codimension two.

    Then the rectangle is divided into 128 x 128 cells. In boxes of states and parameters it is
    excluded by interval arithmetic that an equilibrium merges with another one (the determinant of
    the derivatives vanishes), lies on the edge of the window, or loses stability (a coefficient of
    the characteristic polynomial or a determinant of Hurwitz passes zero)
    [MooreKearfottCloud2009]. Over each connected part of the rest both numbers are constant, and
    counted once. Cells where a change is not excluded and no curve is near are looked through by
    more cuts. What is left is hatched in the picture. Within three cells of a curve another one may
    hide. `Atlas.complete` says what is proved otherwise.

    Of cycles nothing is proved. Curves of folds of cycles begin at generalized Hopf points, of
    homoclinic orbits at Bogdanov-Takens points, of tori at zero-Hopf and Hopf-Hopf points. Families
    of cycles from Hopf points on the cuts between the borders, and one at least from each Hopf
    curve, meet others: folds, period doublings, tori, homoclinic orbits. Each of these curves is
    followed once; `Atlas.not_followed` says which were not. Cycles of twice the period, and those
    that hang together with no Hopf point, are not looked for. Well inside each region of a planar
    flow all limit cycles in the window are counted, as by `periodic_orbits`.

    Examples
    --------
    >>> import phasekit as pk
    >>> cusp = pk.Problem("mu + l*x - x^3", "x", {"mu": 0.0, "l": 0.0}, window={"x": (-3, 3)})
    >>> found = pk.atlas(cusp, "mu", "l", span={"mu": (-1, 1), "l": (-1, 2)})
    >>> [point.label for point in found.special_points], found.complete
    (['CP'], {'n_equilibria': True, 'n_stable': True})
    """
    problem, names, spans, low, high = _checked(problem, x, y, span, window)
    flag("cycles", cycles)
    with notice(f"looking for all bifurcations in {x} and {y}"):
        search = CurveSearch(problem, names, spans, low, high)
        try:
            counts, found = _regions(search)
        except KeyboardInterrupt:
            raise KeyboardInterrupt(
                f"the atlas in {x} and {y} was interrupted before it knew its regions; its "
                f"{len(search.curves)} curves are lost"
            ) from None
        hold()
        corner = zip(low.tolist(), high.tolist(), strict=True)
        asked = dict(zip(problem.state, corner, strict=True))
        orbits = CycleSearch(
            problem, names, spans, dict(zip(asked, high - low, strict=True)),
            points_of(search.curves, problem, spans, asked),
            [line for kind, line in search.lines(FINE / 8 * counts.step) if kind == "fold"],
        )  # fmt: skip
        lost = ""
        try:
            if cycles:
                orbits.from_points()
                search.cut_hopf_curves()
                orbits.from_families(search.hopf)
        except KeyboardInterrupt:
            lost = (
                "it was interrupted while curves of cycles were followed: others are missing, and "
                "n_cycles is -1 all over"
            )
    curves = sorted([*search.curves, *orbits.curves], key=_order)
    made = Atlas(
        problem, names, spans, asked, tuple(curves), tuple(_messages(found, search)),
        tuple(orbits.not_followed(points_of(curves, problem, spans, asked))), counts, found,
        np.full(len(found.place), -1),
    )  # fmt: skip
    texts = [*made.messages]
    if count := len(made.not_followed):
        texts.append(
            f"in {count} place{'s'[: count != 1]} curves of cycles were not followed on: "
            "Atlas.not_followed says why"
        )
    if cycles and not lost:
        try:
            with notice(f"counting cycles between curves in {x} and {y}"), may_end():
                made, doubts = _with_cycles(made, orbits, low, high)
        except KeyboardInterrupt:
            lost = "it was interrupted while cycles were counted: n_cycles is -1 all over"
        else:
            if doubts:
                texts.append(
                    f"in {doubts} region{'s'[: doubts != 1]} the number of limit cycles is in "
                    "doubt: Atlas.not_followed says why"
                )
    if lost:
        made = replace(made, not_followed=(*made.not_followed, lost))
        texts.append(f"{lost}; atlas() again begins anew")
    if texts:
        warn(f"atlas: {'; '.join(texts)}", RuntimeWarning)
    return made


def _regions(search: CurveSearch) -> tuple[RegionSearch, Regions]:
    """Find all curves of equilibria, and the regions between them."""
    problem, names, spans = search.problem, search.names, search.span
    for along, other in (names, names[::-1]):
        for k, value in enumerate(np.linspace(*spans[other], CUTS)):
            stage(f"cut {k + 1} of {CUTS} along {along}, {len(search.curves)} curves")
            search.cut(along, float(value), np.linspace(*spans[along], CUTS))
    counts = RegionSearch(
        problem, names, spans, search.low, search.high, search.faces, search.lines
    )
    for _ in range(ROUNDS):
        stage(f"what may change between {len(search.curves)} curves")
        found = counts.regions()
        places = counts.missing(found)
        before = len(search.curves)
        for place in places[:PLACES]:
            for k, along in enumerate(names):
                search.cut(along, float(place[1 - k]), [float(place[k])])
        if len(search.curves) == before:
            return counts, found
    return counts, counts.regions()


def _with_cycles(made: Atlas, orbits: CycleSearch, low: Array, high: Array) -> tuple[Atlas, int]:
    """The atlas with its numbers of cycles, and how many of these are in doubt."""
    more = [
        line for curve, lines in zip(made.curves, made.lines(), strict=True)
        if curve.kind in KINDS_OF_CYCLES for line in lines
    ]  # fmt: skip
    found = made._counts.divided(made._regions, more)
    inner = found.inner
    seen = [
        (inner[tuple(made._counts.cells(places).T)], inside)
        for places, inside in (within(one, made.names, made.window) for one in orbits.families)
    ]
    number, doubts = cycles_in(made.problem, made.names, found, low, high, seen)
    not_followed = (*made.not_followed, *doubts)
    made = replace(made, _regions=found, _n_cycles=number, not_followed=not_followed)
    return made, len(doubts)


def lines_of(curve: Branch, names: tuple[str, str], steps: Array, ends: Any) -> list[Array]:
    """A curve in the plane, as runs of points closer than steps, up to its ends."""
    if curve.kind in KINDS_OF_CYCLES:
        return [cycle_line(curve, names, steps, ends)]
    return polyline(curve, names, steps)


def points_of(
    curves: Iterable[Branch], problem: Problem, span: Mapping[str, tuple[float, float]],
    window: Mapping[str, tuple[float, float]],
) -> tuple[SpecialPoint[Any], ...]:  # fmt: skip
    """Points of codimension two of curves, each once though two curves meet there."""
    found: list[SpecialPoint[Any]] = []
    near = [
        part * (high - low)
        for part, ends in zip(SAME, (span, window), strict=True) for low, high in ends.values()
    ]  # fmt: skip
    turn = np.array([0.0, 0.0, *(problem.periods.get(x, 0.0) for x in window)])
    places: list[Array] = []
    for curve in curves:
        if curve.kind == "event":
            continue
        for point in curve.special_points:
            if point.kind in ("end", "event"):
                continue
            # Where orbits have shrunk to an equilibrium any of their tests vanishes.
            # Those of cycles that are guessed are no points of an atlas: `not_followed` says so.
            small = point.way == "orbit" and orbit_sizes(curve)[point.index] < SMALL
            if small or (point.way == "orbit" and point.status != "converged"):
                continue
            there = ranges_of(curve).isel(point=point.index) if point.way == "orbit" else point
            states = [f"{x}_max" if point.way == "orbit" else x for x in window]
            at = np.array([float(there[name]) for name in (*span, *states)])
            gaps = [
                at - other
                for one, other in zip(found, places, strict=True) if one.kind == point.kind
            ]  # fmt: skip
            gaps = [gap - turn * np.rint(gap / np.where(turn > 0.0, turn, 1.0)) for gap in gaps]
            if not any(np.all(np.abs(gap) < near) for gap in gaps):
                found.append(point)
                places.append(at)
    return tuple(found)


def _order(curve: Branch) -> int:
    return (*KINDS_OF_CURVES, *KINDS_OF_CYCLES).index(curve.kind)


def _messages(found: Regions, search: CurveSearch) -> list[str]:
    """What is not proved, and what was not found."""
    messages: list[str] = []
    for what, why, cells, numbers in (
        ("equilibria", found.why, found.open_equilibria, found.n_equilibria),
        ("stable equilibria", found.why_stable, found.open_stable, found.n_stable),
    ):
        if why:
            messages.append(f"the number of {what} is not proved: {why}")
            continue
        part = found.far(cells).mean()
        if part:
            messages.append(f"the number of {what} is not proved in {part:.2%} of the plane")
        if (numbers < 0).any():
            messages.append(f"a curve at which the number of {what} changes is missing")
    # What was not found does not matter where it is proved that nothing is missing.
    return [*dict.fromkeys(search.missed), *messages] if messages else []


def _checked(
    problem: Any, x: Any, y: Any, span: Any, window: Any
) -> tuple[Problem, tuple[str, str], dict[str, tuple[float, float]], Array, Array]:
    """What `atlas` takes, before any work."""
    given, problem = problem, as_problem(problem)
    if problem.map or problem.time is not None or problem.bounded:
        raise bad("problem", problem, "a flow without forcing")
    names = check_parameter(problem, x, "x: parameter"), check_parameter(problem, y, "y: parameter")
    refuse_jumps(problem, names)
    if x == y:
        raise bad("y", y, "another parameter than x")
    if not isinstance(span, Mapping):
        raise bad("span", span, f"a mapping: (low, high) of {x} and of {y}")
    for name in span:
        if name not in names:
            raise unknown("span: parameter", name, names)
    spans = {}
    system = problem.system
    for name in names:
        if name not in span:
            raise bad("span", span, f"(low, high) of {x} and of {y}")
        argument = f"span[{name!r}]"
        unit = None if system is None else system.unit_of(name)
        spans[name] = check_span(span[name], unit, argument)
        for declared in () if system is None else system.declared:
            if declared.name == name and not all(map(declared.valid, spans[name])):
                raise bad(argument, spans[name], f"values of {name}, each {declared.wants}")
    for values in itertools.product(*(np.linspace(*spans[name], CUTS) for name in names)):
        try:
            problem.replace(**dict(zip(names, map(float, values), strict=True)))
        except ParameterError as error:
            raise bad("span", span, f"values at which the system is there: {error}") from error
    asked = window_of(given, window)
    if window is None and asked is not None:  # at rest the rate is no state
        asked = {name: ends for name, ends in asked.items() if name in problem.state}
    low, high = corners(problem, asked, "window")
    return problem, names, spans, low, high
