"""`CycleBranch`: a traced family of periodic orbits with its special points."""

from __future__ import annotations

import functools
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, ClassVar, cast

import numpy as np
import xarray as xr

from phasekit.bifurcation.continuation.walk import Found, Stop
from phasekit.cycles.point import Point
from phasekit.errors import ConvergenceError
from phasekit.inputs import is_whole
from phasekit.labelled.continuation.branch import Branch, Place, Record
from phasekit.labelled.continuation.branch_points import announced
from phasekit.labelled.continuation.checks import check_bounds, check_span
from phasekit.labelled.continuation.cycle_points import (
    CyclePoint,
    Orbits,
    orbit_dataset,
    parameters_at,
    points_of,
)
from phasekit.labelled.continuation.onward import onward
from phasekit.labelled.continuation.special_point import SpecialPoint
from phasekit.labels.arguments import bad
from phasekit.numerics.interrupts import keeps
from phasekit.numerics.waits import notice
from phasekit.systems.cycle_families import clock_code
from phasekit.systems.problem import Problem

GUESSES = 5  # orbits at an end of a family from which its homoclinic orbit is looked for


@dataclass(frozen=True)
class HomoclinicEnd(Stop):
    """The end of a family at an orbit that takes infinite time.

    Attributes
    ----------
    branch : CycleBranch
        The family.
    side : int
        0 at its first point, -1 at its last one.
    """

    branch: CycleBranch = field(compare=False, repr=False)
    side: int = field(compare=False, repr=False)

    def connection(self, **keywords: Any) -> ConnectionBranch:
        """The homoclinic orbit itself.

        Parameters
        ----------
        **keywords
            What `connection` takes besides the problem, the orbit and the free parameter.

        Returns
        -------
        ConnectionBranch
        """
        branch, last = self.branch, len(self.branch.path) - 1
        keywords = {"free": branch.parameter, **keywords}
        failure: ConvergenceError | None = None
        for step in range(min(GUESSES, last)):  # Newton's method may fail from the longest orbit
            place = step if self.side == 0 else last - step
            value = float(branch.path[place].orbit.y[1])
            problem = branch.problem.replace(**{branch.parameter: value})
            try:
                found: ConnectionBranch = onward("connection")(
                    problem, branch.orbit(place), **keywords
                )
            except ConvergenceError as error:
                failure = failure or error
                continue
            if step == 0 or self._is_nearer(found, value):
                return found
        assert failure is not None
        raise failure

    def _is_nearer(self, found: ConnectionBranch, value: float) -> bool:
        """Whether a connection lies not farther from the end than the orbit that led to it."""
        at = found.problem.parameters[self.branch.parameter]
        own = float(self.branch.path[0 if self.side == 0 else -1].orbit.y[1])
        return bool(abs(at - own) <= abs(value - own))


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
        max_points, stuck, start, period_doubling; of curves resonance_1, _2 and _4) and
        ``message``.
    messages : tuple of str
        What holds of the family as a whole: that its parameter never moves, that a coefficient is
        zero all along a curve.
    kind : str
        cycle, or fold_of_cycles, period_doubling, torus, cycle_branch_point: a curve in two
        parameters, or three.

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

    _guides: ClassVar[tuple[str, ...]] = ("cycles", "branch")
    _point: ClassVar[type[SpecialPoint[Any]]] = CyclePoint
    way: ClassVar[str] = "orbit"

    def __post_init__(self) -> None:
        """Let ends at homoclinic orbits lead on to these."""
        stops = (
            HomoclinicEnd(stop.reason, stop.message, self, side)
            if stop.reason == "homoclinic" and self.kind == "cycle"
            else stop
            for stop, side in zip(self.stops, (0, -1), strict=True)
        )
        object.__setattr__(self, "stops", tuple(stops))

    @staticmethod
    def _tabulated(
        problem: Problem, walker: Any, found: Found, record: Record
    ) -> tuple[Callable[[], xr.Dataset], list[Place]]:
        return points_of(problem, walker.curve, found, record)

    @property
    def problem_state(self) -> tuple[str, ...]:
        """The states, or the fields of states."""
        fields = tuple(block.name for block in self.problem.blocks)
        return fields or super().problem_state

    @property
    def path(self) -> tuple[Point, ...]:
        """The orbits, special points in their places."""
        return cast(Orbits, self._table).points

    @functools.cached_property
    def _ranges(self) -> xr.Dataset:
        """Of the points what is known at once."""
        return cast(Orbits, self._table).ranges()

    def _values(self, special: Any) -> tuple[Any, dict[str, float]]:
        orbit = special.point.orbit
        return orbit.x[0], parameters_at(self.problem, self.walker.curve, orbit)

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
        label = cast(Orbits, self._table).labels[at]
        return orbit_dataset(self.problem, self.walker.curve, self.path[at], label)

    def _wider(
        self, span: Sequence[float] | None, bounds: Mapping[str, Sequence[float]] | None
    ) -> dict[str, Any]:
        rest = dict(check_bounds(bounds))
        period = rest.pop("period", None)
        wider = super()._wider(span, rest)
        if period is not None:
            options = self.walker.curve.options
            own = options.bounds.get("period", (-np.inf, np.inf))
            low, high = check_span(period, None, "bounds['period']")
            if low > own[0] or high < own[1]:
                raise bad("bounds['period']", period, f"a range that holds {own}")
            wider["options"] = replace(options, bounds={**options.bounds, "period": (low, high)})
        return wider

    @staticmethod
    def _code(problem: Problem, curve: Mapping[str, Any]) -> dict[str, Any]:
        return {"field": problem.field, "clock": clock_code(problem, curve["active"])}

    @property
    def _numbers(self) -> tuple[str, ...]:
        return ("period",) if self.walker.curve.closes else ()

    def _notes(self) -> list[str]:
        unknown = (
            int(np.sum(self._points["n_unstable"].values < 0)) if self.walker.curve.closes else 0
        )
        failed = f"multipliers fail their checks at {unknown} points: no detection there"
        return [*([failed] if unknown else []), *super()._notes()]


@dataclass(frozen=True, eq=False, repr=False)
class ConnectionBranch(CycleBranch):
    """Orbits that connect equilibria: one, or a curve of them in one parameter more.

    Made by `connection`, and by ``stop.connection()`` where a family of periodic orbits ends as
    homoclinic.

    Attributes
    ----------
    points : xarray.Dataset
        On the dim ``point``: the free parameters by name; for each state x ``x_min``, ``x_max``,
        ``x_mean`` and, at the equilibria, ``x_from`` and ``x_to``; ``duration``, the time between
        the ends; ``truncation_error``, what the free parameters are off by since it is not
        infinite; ``mesh_error`` and ``residual``; ``leading_unstable`` and ``leading_stable``, real
        parts of the eigenvalues by which it leaves and arrives the slowest, with ``_imag``;
        ``saddle_value``, their sum; ``n_intervals``, ``arclength``, ``special``, ``step``.
    special_points : tuple of SpecialPoint
        NSS, NSF, DRS, DRU, NDS, NDU, OFS, OFU, IFS, IFU, and ends.
    stops : tuple of Stop
        Why a curve ends: bound, shilnikov_hopf, non_central_saddle_node, bogdanov_takens,
        max_points, stuck, closed.

    Examples
    --------
    >>> import phasekit as pk
    >>> lorenz = pk.Problem(
    ...     {"x": "s*(y - x)", "y": "r*x - y - x*z", "z": "x*y - b*z"},
    ...     parameters={"r": 13.9, "s": 10.0, "b": 8 / 3},
    ... )
    >>> loop = pk.connection(lorenz, ([0, 0, 0], [0, 0, 0]), free="r")
    >>> round(float(loop.points.r[0]), 9)
    13.926557408
    >>> curve = loop.curve("b", span=(2.5, 2.7))
    >>> [stop.reason for stop in curve.stops]
    ['bound', 'bound']
    """

    @keeps
    def curve(
        self, parameter: str, span: Sequence[float] | None = None, *, options: Any = None
    ) -> ConnectionBranch:
        """The curve of such orbits in one parameter more.

        Parameters
        ----------
        parameter : str
            The other parameter.
        span : (float, float), optional
            Its range, which holds its value; if left out ten times its size to both sides, or that
            of what moves f next to the equilibrium as the states do.
        options : ContinuationOptions, optional
            Steps, bounds, directions.

        Returns
        -------
        ConnectionBranch

        Raises
        ------
        ParameterError
            If the parameter is none, or free already.
        """
        with notice(f"following connections along {parameter}"):
            found = onward("connection.curve")(self, parameter, span, options)
        made: ConnectionBranch = announced(found)
        return made
