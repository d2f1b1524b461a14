"""`CycleBranch`: a traced family of periodic orbits with its special points."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, Self, cast

import numpy as np
import xarray as xr

from phasekit.bifurcation.continuation.periodic.point import Point
from phasekit.bifurcation.continuation.walk import Found
from phasekit.inputs import is_whole
from phasekit.labelled.continuation.branch import Branch, Place, Record
from phasekit.labelled.continuation.checks import check_bounds, check_span
from phasekit.labelled.continuation.cycle_points import (
    Orbits,
    clock_code,
    orbit_dataset,
    points_of,
)
from phasekit.labelled.continuation.cycle_special import CyclePoint, cycle_point
from phasekit.labels.arguments import bad
from phasekit.systems.problem import Problem


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

    @staticmethod
    def _tabulated(
        problem: Problem, walker: Any, found: Found, record: Record
    ) -> tuple[Callable[[], xr.Dataset], list[Place]]:
        return points_of(problem, walker.curve, found, record)

    @property
    def path(self) -> tuple[Point, ...]:
        """The orbits, special points in their places."""
        return cast(Orbits, self._table).points

    def _special_point(self, found: Any, index: int, eigenvalues: Any) -> CyclePoint[Self]:
        return cycle_point(self.problem, self.curve, found, eigenvalues, index, self)

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
        label = str(self._points["special"].values[at])
        return orbit_dataset(self.problem, self.curve, self.path[at], label)

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

    @staticmethod
    def _code(problem: Problem, curve: Mapping[str, Any]) -> dict[str, Any]:
        return {"field": problem.field, "clock": clock_code(problem, curve["active"])}

    @property
    def _numbers(self) -> tuple[str, ...]:
        return ("period",) if self.curve.closes else ()

    def _notes(self) -> list[str]:
        unknown = int(np.sum(self._points["n_unstable"].values < 0)) if self.curve.closes else 0
        failed = f"multipliers fail their checks at {unknown} points: no detection there"
        return [*([failed] if unknown else []), *super()._notes()]
