"""`CycleBranch`: a traced family of periodic orbits with its special points."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields, replace
from functools import partial
from os import PathLike
from types import MappingProxyType
from typing import Any, Self, cast

import numpy as np
import xarray as xr

from phasekit.bifurcation.continuation.curve import Stop
from phasekit.bifurcation.continuation.periodic.cycle_walk import CycleWalk, in_order
from phasekit.bifurcation.continuation.periodic.cycles import Cycles
from phasekit.bifurcation.continuation.periodic.events import find
from phasekit.bifurcation.continuation.periodic.family import Found, Tracks, join
from phasekit.bifurcation.continuation.periodic.point import Point
from phasekit.bifurcation.continuation.periodic.vertical import said_of
from phasekit.bifurcation.continuation.specials import NOT_SEARCHED
from phasekit.bifurcation.continuation.stops import SEARCHED
from phasekit.bifurcation.continuation.walk import Walker, cut, go_on
from phasekit.bifurcation.special_points import KINDS
from phasekit.inputs import is_whole
from phasekit.labelled.continuation.branch import Branch
from phasekit.labelled.continuation.branch_points import made_with
from phasekit.labelled.continuation.checks import check_bounds, check_span
from phasekit.labelled.continuation.cycle_points import clock_code, orbit_dataset, points_of
from phasekit.labelled.continuation.cycle_special import CyclePoint, cycle_point
from phasekit.labelled.continuation.onward import onward
from phasekit.labels.arguments import bad
from phasekit.systems.problem import Problem

NO_START = Stop("start", "the start; this direction was not requested")


@dataclass(frozen=True, eq=False, repr=False)
class CycleBranch(Branch):
    """A family of periodic orbits, with its special points.

    Made by `continuation` from an orbit, and by `SpecialPoint.switch` at Hopf points, period
    doublings and branch points of cycles.

    Attributes
    ----------
    points : xarray.Dataset
        On the dim ``point``, in order along the family: the free parameters by name, ``period``,
        ``multiplier`` (complex, on the dim ``multiplier``, largest first), ``n_unstable``, for
        each state x ``x_min``, ``x_max`` and ``x_mean``, ``winding``, the checks
        ``trivial_error``, ``liouville_error``, ``mesh_error`` and ``residual``, ``n_intervals``,
        ``arclength``, ``special``, ``step``, ``newton_steps``. Of a recorded q also ``q_min``,
        ``q_max`` and ``q_mean``.
    special_points : tuple of SpecialPoint
        In order along the family: fold_of_cycles (LPC), period_doubling (PD), torus (TR),
        cycle_branch_point (BPC), event (UZ) and end (EP); along curves of folds cusp (CP) and
        resonance_1 (R1), along those of tori resonance_1 to resonance_4.
    stops : tuple of Stop
        Why the family ends, on both sides: ``reason`` (bound, hopf, homoclinic, unbounded, closed,
        max_points, stuck, start, period_doubling; of curves of tori resonance_1, resonance_2) and
        ``message``.
    messages : tuple of str
        What holds of the family as a whole: that its parameter never moves, that a coefficient is
        zero all along a curve.
    kind : str
        cycle, or fold_of_cycles, period_doubling, torus: a curve in two parameters.

    Notes
    -----
    Points solve ``dx/ds = T f(x, p)``, ``x(1) = x(0)``, by collocation ([Doedel1991],
    [AscherMattheijRussell1995] chapter 5), with multipliers by [Lust2001]; coefficients of normal
    forms are those of [Iooss1988], computed as in [KuznetsovEtAl2005].

    Examples
    --------
    >>> import phasekit as pk
    >>> brusselator = pk.Problem(
    ...     ["1 - (b + 1)*x + x**2*y", "b*x - x**2*y"], ("x", "y"), {"b": 1.5}
    ... )
    >>> rest = pk.continuation(brusselator, "b", x0=[1.0, 1.5], span=(1, 3))
    >>> (hopf,) = rest.special("H")
    >>> cycles = hopf.switch()
    >>> [stop.reason for stop in cycles.stops]
    ['hopf', 'bound']
    >>> round(float(cycles.points.period[-1]), 6)
    7.15692
    >>> cycles.orbit(-1).sizes["time"] > 100
    True
    """

    curve: Cycles  # type: ignore[assignment]
    start: Point  # type: ignore[assignment]
    tracks: Tracks  # type: ignore[assignment]
    path: tuple[Point, ...] = ()
    origin: Stop = NO_START

    def orbit(self, i: int) -> xr.Dataset:
        """The orbit of a point over time, with its numbers as scalars.

        Parameters
        ----------
        i : int
            The place of the point; negative ones count from the end.

        Returns
        -------
        xarray.Dataset
            The states on ``time``, and the numbers of the point; what `periodic_orbit` returns.

        Raises
        ------
        ParameterError
            If there is no such point, or the problem is not known.
        """
        count = len(self.path)
        at = i if is_whole(i) else count
        if not -count <= at < count:
            raise bad("i", i, f"a whole number from {-count} to {count - 1}")
        cycles, problem = self.known()
        label = str(self._points["special"].values[at])
        return orbit_dataset(problem, cycles, self.path[at], label)

    def known(self) -> tuple[Cycles, Problem]:  # type: ignore[override]
        """The family and the problem.

        Returns
        -------
        tuple of (Cycles, Problem)
        """
        return self.curve, self.problem

    def to_dataset(self) -> xr.Dataset:
        """The points, and the special points on the dim ``special_point``.

        Returns
        -------
        xarray.Dataset
            As `Branch.to_dataset`, with ``special_period``.
        """
        ds = super().to_dataset()
        if self.curve.closes:
            ds["special_period"] = (
                "special_point", np.array([s["period"] for s in self.special_points]),
            )  # fmt: skip
        return ds

    def _bounded(self) -> list[str]:
        return list(self.free)

    def _walker(self, **changes: Any) -> Walker:
        return CycleWalk(self.curve.replace(**changes))

    def _wider(
        self, span: Sequence[float] | None, bounds: Mapping[str, Sequence[float]] | None
    ) -> dict[str, Any]:
        rest = dict(check_bounds(bounds))
        period = rest.pop("period", None)
        wider = super()._wider(span, rest)
        if period is not None:
            options = self.curve.options
            own = options.bounds.get("period", (-np.inf, np.inf))
            low, high = check_span(period, None, "bounds['period']")
            if low > own[0] or high < own[1]:
                raise bad("bounds['period']", period, f"a range that holds {own}")
            wider["options"] = replace(options, bounds={**options.bounds, "period": (low, high)})
        return wider

    def _longer(self, count: int, bounds: Mapping[str, Any]) -> Self:
        cycles, problem = self.known()
        cycles = cycles.replace(**bounds)
        made = go_on(CycleWalk(cycles), self.start, self.tracks, count)
        longer = make_cycles(problem, cycles, self.start, made, self.record, self.origin, self.kind)
        return cast(Self, longer)

    def save(self, path: str | PathLike[str], *, overwrite: bool = False) -> None:
        """Save everything, to be loaded and extended exactly.

        Parameters
        ----------
        path : path
            A name that ends in ``.zarr`` or ``.nc``.
        overwrite : bool, default False
            Whether a branch that is there already may be replaced.

        Raises
        ------
        ParameterError
            If the name ends otherwise, or the problem is not known.
        StoreError
            If there is something under that name.
        """
        onward("cycles.save")(self, path, overwrite)

    def __reduce__(self) -> tuple[Any, ...]:
        """Copies and pickles are made again of what was traced, as when a branch is loaded."""
        cycles, problem = self.known()
        skip = ("field", "clock")
        kept = {f.name: getattr(cycles, f.name) for f in fields(cycles) if f.name not in skip}
        return _again, (
            type(cycles), problem, kept, self.start, self.tracks, dict(self.record), self.origin,
            self.kind,
        )  # fmt: skip

    def __repr__(self) -> str:
        """Write what it is, its range, its special points and why it ends."""
        names = (*self.free, "period") if self.curve.closes else self.free
        u = {name: self._points[name].values for name in names}
        ranges = ", ".join(f"{n} from {v.min():.6g} to {v.max():.6g}" for n, v in u.items())
        whole = {"cycle": "periodic orbits", "boundary": "solutions"}
        of = whole.get(self.kind, f"{self.kind} points")
        lines = [f"<Branch of {of}: {len(self.path)} points, {ranges}"]
        shown = [s for s in self.special_points if s.kind != "end"]
        lines += [f"  {special!r}" for special in shown[:20]]
        lines += [f"  ... {len(shown) - 20} more"] if len(shown) > 20 else []
        unknown = 0
        if self.curve.closes:
            unknown = int(np.sum(self._points["n_unstable"].values < 0))
        if unknown:
            lines.append(f"  multipliers fail their checks at {unknown} points: no detection there")
        lines += [
            f"  {name}: {stop.reason}, {stop.message}"
            for name, stop in zip(("first", "last"), self.stops, strict=True)
        ]
        lines += [f"  {message}" for message in self.messages]
        return "\n".join(lines) + ">"


def make_cycles(
    problem: Problem,
    cycles: Cycles,
    start: Point,
    tracks: Tracks,
    record: Mapping[str, Any],
    origin: Stop = NO_START,
    kind: str = "cycle",
) -> CycleBranch:
    """A branch of what was traced: special points are looked for, quantities recorded."""
    path = join(start, tracks, origin)
    try:
        special, zeros = find(cycles, path)
    except KeyboardInterrupt:  # what was followed is kept
        backward, forward = (
            None if track is None else replace(track, stop=SEARCHED) for track in tracks
        )
        tracks = (backward, forward)
        path, special, zeros = join(start, tracks, origin), [], NOT_SEARCHED
    path, special = cut(CycleWalk(cycles), start, path, in_order(special))
    found = in_order([*special, *_ends(path)])
    points, labels, places = list(path.points), [""] * len(path.points), []
    shift = 0
    for one in found:
        if one.kind == "end":
            places.append(0 if one.index < 0 else len(points) - 1)
            continue
        place = one.index + 1 + shift
        points.insert(place, one.point)
        labels.insert(place, KINDS[one.kind].label)
        places.append(place)
        shift += 1
    places = [len(points) - 1 if one.kind == "end" and one.index >= 0 else p
              for one, p in zip(found, places, strict=True)]  # fmt: skip
    for one, place in zip(found, places, strict=True):
        if one.kind == "end" and not labels[place]:
            labels[place] = KINDS["end"].label
    names = tuple(cycles.field.parameters[i] for i in cycles.active)
    branch = CycleBranch(
        problem, names, cycles.field.states, cycles, start, tracks,
        made_with(partial(points_of, problem, cycles, points, labels, record), record), (),
        path.stops, kind,
        MappingProxyType(dict(record)), (*zeros, *said_of(cycles, path)), tuple(points), origin,
    )  # fmt: skip
    made: tuple[CyclePoint[CycleBranch], ...] = tuple(
        cycle_point(problem, cycles, one, place, branch)
        for one, place in zip(found, places, strict=True)
    )
    object.__setattr__(branch, "special_points", made)
    return branch


def _ends(path: Any) -> list[Found]:
    if path.stops[1].reason == "closed":
        return []
    ends = []
    points = [path.points[-k] if one is None else one.point for k, one in enumerate(path.ends)]
    for index, point, stop in (
        (-2, points[0], path.stops[0]), (len(path.points), points[1], path.stops[1]),
    ):  # fmt: skip
        at = float(point.orbit.y[1])
        ends.append(Found("end", point, index, (at, at), "converged", stop.message, {}))
    return ends


def _again(
    form: type[Cycles], problem: Problem, kept: Mapping[str, Any], start: Point, tracks: Tracks,
    record: Any, origin: Stop, kind: str,
) -> CycleBranch:  # fmt: skip
    cycles = form(field=problem.field, clock=clock_code(problem, kept["active"]), **kept)
    return make_cycles(problem, cycles, start, tracks, record, origin, kind)
