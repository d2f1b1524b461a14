"""What happens to equilibria as parameters change, on whatever rung of the ladder of laws.

The trigonometric law answers by exact arithmetic; any other potential, and a potential under a
constant torque, by boxes. One system, plain arrays.
"""

from __future__ import annotations

import functools
from collections.abc import Mapping
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np

from phasekit.arrays import Array
from phasekit.bifurcation.curves import Curve, Cusp, Locus, Meeting, NormalForm
from phasekit.bifurcation.exact import atlas as closed
from phasekit.bifurcation.exact import bifurcation_set as closed_loci
from phasekit.bifurcation.exact import plane as closed_plane
from phasekit.bifurcation.exact.line import Path
from phasekit.bifurcation.exact.meetings import join_all, survey
from phasekit.bifurcation.numerical import bifurcation_set as boxes_loci
from phasekit.bifurcation.numerical import plane as boxes_plane
from phasekit.bifurcation.numerical.atlas import Atlas
from phasekit.bifurcation.numerical.mergers import mergers
from phasekit.bifurcation.numerical.steady import steady_line
from phasekit.bifurcation.surface import Force
from phasekit.errors import ParameterError
from phasekit.laws.ladder import Conservative, Law, Routhian
from phasekit.laws.perturbed import PerturbedLaw
from phasekit.laws.trigonometric import Trigonometric
from phasekit.mechanics.at_momentum import Machines
from phasekit.mechanics.two_degrees import support_inertia
from phasekit.phase.exact.potential import curvature, gradient
from phasekit.phase.numerical.inertial import Inertial

Values = Mapping[str, float]
Span = tuple[float, float]
Names = tuple[str, str]
Limits = tuple[Span, Span]


class Along(NamedTuple):
    """All curves of equilibria over a span, their special points, and why there may be others."""

    curves: list[Curve]
    meetings: list[Meeting]
    missing: str


class Points(NamedTuple):
    """Where equilibria merge or cross: value, coordinate, kind, and error of the value."""

    found: list[tuple[float, float, str, float]]
    missing: str


class Loci(NamedTuple):
    """Curves in a plane, their cusps, points (x, y, number, reach) in its regions, what is open."""

    curves: list[Locus]
    cusps: list[Cusp]
    regions: list[tuple[float, float, int, float]]
    missing: str


@functools.singledispatch
def branches_along(law: Law, values: Values, parameter: str, span: Span) -> Along:
    """All curves of equilibria over a span of one parameter; `values` are those of the others."""
    raise TypeError(law)


@functools.singledispatch
def mergers_along(law: Law, values: Values, parameter: str, span: Span) -> Points:
    """Where equilibria merge or cross over a span of one parameter, in order."""
    raise TypeError(law)


@functools.singledispatch
def loci_in(law: Law, values: Values, names: Names, limits: Limits) -> Loci:
    """All curves in a plane of two parameters at which equilibria change."""
    raise TypeError(law)


class View(NamedTuple):
    """V' and V'' over a plane of two parameters, and where the coordinate lies."""

    force: Force
    ends: tuple[float, float]
    period: float | None


@functools.singledispatch
def view_of(law: Law, values: Values, names: Names, limits: Limits) -> View:
    """What a picture of all equilibria over a plane needs."""
    raise TypeError(law)


@view_of.register
def _(law: Trigonometric, values: Values, names: Names, limits: Limits) -> View:
    def force(x: Array, y: Array, phi: Array) -> tuple[Array, Array]:
        full = {name: np.full(x.shape, value) for name, value in values.items()}
        with np.errstate(all="ignore"):
            A, B, C = law.coefficients({**full, names[0]: x, names[1]: y})
        size = np.hypot(np.hypot(A, B), C)  # squares of large ones overflow
        scale = np.divide(1.0, size, out=np.zeros_like(size), where=size > 0.0)
        return gradient(A, B, C, phi) * scale, curvature(A, B, C, phi) * scale

    return View(force, (-0.5 * law.period, 0.5 * law.period), law.period)


@view_of.register(Conservative)
@view_of.register(PerturbedLaw)
def _(law: Any, values: Values, names: Names, limits: Limits) -> View:
    line = steady_line(law, values, dict(zip(names, limits, strict=True)))
    plane = boxes_plane.Plane(line.formula, line.still, names, limits)
    return View(plane.force, plane.extent, line.formula.period)


@branches_along.register
def _(law: Trigonometric, values: Values, parameter: str, span: Span) -> Along:
    fixed = {name: value for name, value in values.items() if name != parameter}

    def coefficients(at: Any) -> Any:
        full = {name: np.full_like(at, value) for name, value in fixed.items()}
        with np.errstate(all="ignore"):
            return law.coefficients({**full, parameter: at})

    return Along(*closed.atlas(Path(law, values, parameter, span), coefficients), "")


@mergers_along.register
def _(law: Trigonometric, values: Values, parameter: str, span: Span) -> Points:
    path = Path(law, values, parameter, span)
    found = join_all(path, *survey(path)).meetings
    exact = [m for m in found if m.kind not in ("no_force", "end")]
    return Points([(m.at, m.phi, m.kind, float(np.spacing(abs(m.at)))) for m in exact], "")


@loci_in.register
def _(law: Trigonometric, values: Values, names: Names, limits: Limits) -> Loci:
    plane = closed_plane.Plane(law, values, names, limits)
    return Loci(*closed_loci.loci(plane), closed_plane.regions(plane), "")


@loci_in.register
def _(law: Routhian, values: Values, names: Names, limits: Limits) -> Loci:
    raise ParameterError(
        f"system: got {law.called}, wants one in a potential for a bifurcation set; pk.critical "
        "has its folds along one parameter, and a fold of pk.continuation its .curve in two"
    )


@loci_in.register(Conservative)
@loci_in.register(PerturbedLaw)
def _(law: Any, values: Values, names: Names, limits: Limits) -> Loci:
    line = steady_line(law, values, dict(zip(names, limits, strict=True)))
    plane = boxes_plane.Plane(line.formula, line.still, names, limits)
    pieces, cusps, missing = boxes_loci.loci(plane)
    return Loci(pieces, cusps, boxes_loci.regions(plane, pieces), missing)


@branches_along.register
def _(law: Machines, values: Values, parameter: str, span: Span) -> Along:
    """Those of a function with the same equilibria, with the energies of the amended potential."""
    atlas = Atlas.from_line(steady_line(law, values, {parameter: span}))

    def amended(at: Any, phi: Any) -> tuple[Any, Any, Any]:
        one = law.with_values({**values, parameter: np.asarray(at)})
        height, _, bend = one.potential(phi)
        return height, bend, support_inertia(one.machine, phi)[0] ** 2

    curves, meetings = [], []
    for curve in atlas.curves():
        height, bend, _ = amended(curve.vertices.at, curve.vertices.phi)
        curves.append(
            replace(curve, vertices=curve.vertices._replace(energy=height, curvature=bend))
        )
    for point in atlas.joints.meetings:
        weight = float(amended(point.at, point.phi)[2])
        form = NormalForm(*(part / weight for part in point.normal_form))
        meetings.append(point._replace(normal_form=form))
    return Along(curves, meetings, atlas.missing)


@branches_along.register(Conservative)
@branches_along.register(Inertial)
@branches_along.register(PerturbedLaw)
def _(law: Any, values: Values, parameter: str, span: Span) -> Along:
    atlas = Atlas.from_line(steady_line(law, values, {parameter: span}))
    found = atlas.curves()
    return Along(found, atlas.joints.meetings, atlas.missing)


@mergers_along.register(Conservative)
@mergers_along.register(Routhian)
@mergers_along.register(PerturbedLaw)
def _(law: Any, values: Values, parameter: str, span: Span) -> Points:
    found, missing = mergers(steady_line(law, values, {parameter: span}))
    inside = [m for m in found if m.kind != "exit"]
    return Points([(m.at, m.x, m.kind, m.error) for m in inside], missing)
