"""The atlas of equilibria along one parameter, labelled."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
import xarray as xr

from phasekit.bifurcation.along import Along, branches_along
from phasekit.bifurcation.curves import Curve, Meeting
from phasekit.bifurcation.special_points import KINDS
from phasekit.cells.request import with_words
from phasekit.cells.schema import dataset_attrs, input_attrs, own_names
from phasekit.errors import EquilibriumKind, warn
from phasekit.inputs import call_checked
from phasekit.labels.arguments import bad, pair, unknown
from phasekit.labels.coordinates import LABELS
from phasekit.labels.grid import LABEL_DTYPE, variable
from phasekit.laws.ladder import PERTURBED, Conservative, Law, Routhian, Standing
from phasekit.laws.trigonometric import Trigonometric
from phasekit.systems.system import System, as_system
from phasekit.systems.system import single as single_law
from phasekit.table.quantities import ROWS
from phasekit.table.row import FROM_MOTION

PROVED = (
    "complete: every equilibrium for every value of the parameter in the span lies on one of the "
    "curves; where they merge is proved by interval arithmetic in boxes of coordinate and "
    "parameter, and how many there are between these values"
)
COMPLETE = (
    "complete: every equilibrium for every value of the parameter in the span lies on one of the "
    "curves; all mergers are found by exact arithmetic, those closer together than 1e-15 of the "
    "span as one"
)


@call_checked
def branches(system: Any, parameter: str, span: tuple[float, float]) -> xr.Dataset:
    """The complete atlas of equilibria along one parameter: all branches, all special points.

    Parameters
    ----------
    system : system
        A single system in a potential; its own value of the parameter is not used. Of a
        `Perturbed` system the constant torque counts, and nothing else.
    parameter : str
        A parameter on which the equilibria depend: beta, e, a, omega1, r or g of a
        `GyroRotorDisk`, lam, psi or Omega_sq of a `Reduced`, one of a `Potential`, torque of a
        `Perturbed` system, and so on.
    span : (float, float)
        First and last value of the parameter, in its unit.

    Returns
    -------
    xarray.Dataset
        On (``branch``, ``point``), in order along each branch: the parameter (a coordinate),
        ``phi`` in rad, continuous along the branch, ``kind`` (`EquilibriumKind`), ``label`` (which
        of the labels of `equilibria` the point has), ``energy`` and ``curvature`` in s^-2; shorter
        branches end in NaN, kind absent and label -1. On ``branch``: ``closed``. On ``special``:
        ``special_kind`` (fold, pitchfork, transcritical, branch_point, cusp, no_force, end),
        ``special_label`` (LP, BP, CP, NF, EP), ``special_value`` of the parameter,
        ``special_phi``, the coefficients ``unfolding``, ``quadratic`` and ``cubic`` of the normal
        form, and ``on_branch`` (``special``, ``branch``). ``complete`` says whether it is proved
        that there are no other branches; where it is not, a RuntimeWarning says why. Labels of a
        `Potential` are numbers from left to right.

    Raises
    ------
    ParameterError
        If the system is not a single one, has no such parameter, or the span leaves its domain.

    Notes
    -----
    The atlas is complete. A, B and C are, up to a common factor, polynomials of the parameter (for
    an angle: of the tangent of its half); the values where equilibria merge are the real roots of
    ``(B^2 + C^2 - A^2)^3 + 27 A^2 B^2 C^2``, all of which are found by exact arithmetic
    [Basu2006]. Between them each label is one smooth arc, because its bracket holds exactly one
    root of ``V'``. A branch goes on through a fold, where the parameter turns back, and through a
    pitchfork, where two branches cross; it ends with the span, or where A = B = C = 0.

    Those of any other potential, or under a torque, are proved by interval arithmetic: all zeros of
    ``V' = V'' = 0`` in the plane of coordinate and parameter [MooreKearfottCloud2009], and of
    ``V'/(x - x0)`` and its slope next to an equilibrium x0 that does not move, by symmetry or else.
    A merger of more than two equilibria without such a symmetry is not decided: it is marked as
    what the branches next to it do, and ``complete`` is False. On an interval branches end where
    they leave it, on a line where they go to infinity.

    The normal form at a special point, with ``x = phi - phi*`` and ``mu = p - p*``: at a fold
    ``x'' = unfolding mu + quadratic x^2``, at a pitchfork ``x'' = unfolding mu x + cubic x^3``, at
    a cusp ``x'' = unfolding mu + cubic x^3``; quadratic is ``-V'''/2`` and cubic ``-V''''/6``
    ([Kuznetsov2004] sections 3.3, 7.4, 8.2).

    Examples
    --------
    >>> import phasekit as pk
    >>> from phasekit.labelled.atlas import branches
    >>> ds = branches(pk.Reduced(lam=0.0, psi=0.0), "lam", (0.0, 1.5))
    >>> ds.sizes["branch"], ds.special_label.values[ds.special_kind != "end"].tolist()
    (3, ['BP'])
    >>> ds.special_value.values[0].round(12).item(), ds.cubic.values[0].item()
    (1.0, -0.5)
    """
    system, law, values = resting(system, parameter, what="branches")
    low, high = limits(system, parameter, "span", span)
    found = branches_along(law, values, parameter, (low, high))
    tell_missing("branches", parameter, found.missing)
    return _dataset(system, parameter, found)


def resting(
    system: Any, *names: Any, what: str, called: str = "parameter"
) -> tuple[System, Law, dict[str, float]]:
    """Return a single system in a potential, its law, and what its equilibria depend on.

    Where `names` are lam and psi, the reduced form of a system that has no such parameters.
    """
    found = as_system(system)
    if found.standing.is_within(Trigonometric):
        found, values = single(found, *names)
        law: Law = found.trigonometric()
    else:
        perturbed = found.standing.is_within(Standing(Conservative, PERTURBED))
        kept = found.standing.is_within(Routhian)
        if not perturbed and not kept and not found.standing.is_within(Conservative):
            raise bad("system", found, Conservative.called, "pk.continuation follows any other")
        law, every = single_law(found)
        law.check_searchable()
        law = found.law_of_parameters if kept else law
        own = [*found.formula_inputs(), *(["torque"] if perturbed else [])]
        values = {name: every[name] for name in own if name in every}
        if kept and "momentum" in values:  # on which alone the speed of the support depends
            del values["omega1"]
    for name in names:
        if not isinstance(name, str) or name not in values:
            raise unknown(f"{called} of {what} for {type(found).__name__}", name, values)
    return found, law, values


def tell_missing(what: str, parameter: str, missing: str, where: str = "") -> None:
    """Say where it is not proved that there are no others."""
    if missing:
        warn(
            f"{what}: there may be others than these{where}, because {missing} along {parameter}; "
            "`complete` is False",
            RuntimeWarning,
        )


def single(system: Any, *names: Any) -> tuple[System, dict[str, float]]:
    """Return a system and its parameters, all numbers, that enter the coefficients.

    Where `names` are lam and psi, the reduced form of a system that has no such parameters.
    """
    system = as_system(system)
    own = system.formula_inputs()
    reduced = all(isinstance(name, str) and name in ("lam", "psi") for name in names)
    if reduced and not all(name in own for name in names):
        system = system.reduced()
    if not issubclass(system.rung, Trigonometric):
        hint = "pk.continuation follows the equilibria of any other"
        raise bad("system", system, Trigonometric.called, hint)
    values: dict[str, float] = {}
    for name in system.formula_inputs():
        value = system.parameters[name]
        if not isinstance(value, float):
            raise bad(name, value, "one number", "select one cell: ds.isel(...).phasekit.system()")
        values[name] = value
    return system, values


def limits(system: System, parameter: str, argument: str, span: Any) -> tuple[float, float]:
    """Return the two ends of a span in rising order."""
    (declared,) = (p for p in system.declared if p.name == parameter)
    wants = f"two different values of {parameter}, each {declared.wants}"
    low, high = pair(argument, span, wants, declared.units)
    if not (declared.valid(low) and declared.valid(high)) or low == high:
        raise bad(argument, (low, high), wants)
    return min(low, high), max(low, high)


def _dataset(system: System, parameter: str, found: Along) -> xr.Dataset:
    curves, meetings = found.curves, found.meetings
    dims = ("branch", "point")
    names = ("phi", "label", "kind", "energy", "curvature")
    fill = {"label": -1, "kind": int(EquilibriumKind.ABSENT)}
    named = system.standing.is_within(Trigonometric)
    dtypes = {"label": np.int8 if named else np.int16, "kind": np.int8}
    size = max((curve.vertices.at.size for curve in curves), default=0)

    def table(name: str) -> Any:
        array = np.full((len(curves), size), fill.get(name, np.nan), dtypes.get(name, np.float64))
        for row, curve in zip(array, curves, strict=True):
            column = getattr(curve.vertices, name)
            row[: column.size] = column
        return array

    about = {
        row.name: row.attrs for row in with_words(system, [ROWS[n] for n in names if n != "label"])
    }
    about["label"] = _LABEL if named else {"long_name": "number of the equilibrium"}
    data = {name: variable(dims, table(name), about[name]) for name in names}
    closed = np.array([curve.closed for curve in curves], bool)
    data["closed"] = variable(("branch",), closed, {"long_name": "whether the branch is closed"})
    attrs = input_attrs(system, parameter)
    units = about["phi"]["units"], about["curvature"]["units"]
    data.update(_special(attrs, units, named, curves, meetings))
    data["complete"] = variable(
        (), not found.missing, {"long_name": "whether these are proved to be all branches"}
    )
    coords = {
        parameter: variable(dims, table("at"), attrs),
        "branch": variable(("branch",), np.arange(len(curves)), {"long_name": "branch"}),
    }
    for name, value in system.parameters.items():
        if name != parameter and name not in data:  # where drag is quadratic, no normal form is
            coords[name] = variable((), value, input_attrs(system, name))
    complete = COMPLETE if named else PROVED
    complete = f"not complete: {found.missing}" if found.missing else complete
    attributes = {**dataset_attrs(system), "parameter": parameter, "completeness": complete}
    coords |= own_names(system.coordinate or "phi", {**data, **coords})
    return xr.Dataset(data, coords=coords, attrs=attributes)


def _special(
    attrs: Mapping[str, str], both: tuple[str, str], exact: bool, curves: list[Curve],
    meetings: list[Meeting],
) -> dict[str, xr.Variable]:  # fmt: skip
    units, bend = both  # of coordinates and of curvatures
    dims = ("special",)
    kinds = [meeting.kind for meeting in meetings]
    on_branch = np.zeros((len(meetings), len(curves)), bool)
    for j, curve in enumerate(curves):
        on_branch[list(curve.meetings), j] = True
    values = {
        "special_value": ([m.at for m in meetings], {**attrs}),
        "special_phi": (
            [m.phi for m in meetings],
            {
                "long_name": f"{'angle' if units == 'rad' else 'coordinate'} of the special point",
                "units": units,
            },
        ),
        "unfolding": (
            [m.normal_form.unfolding for m in meetings],
            {
                "long_name": "coefficient of the parameter in the normal form",
                "equation": "-dV'/dp (fold, cusp) or -dV''/dp (pitchfork)",
                "source": FROM_MOTION,
            },
        ),
        "quadratic": (
            [m.normal_form.quadratic for m in meetings],
            {
                "long_name": "coefficient of x^2 in the normal form",
                "units": bend,
                "equation": "-V'''/2" + " = -(3/2) A sin(phi) cos(phi)" * exact,
                "source": FROM_MOTION,
            },
        ),
        "cubic": (
            [m.normal_form.cubic for m in meetings],
            {
                "long_name": "coefficient of x^3 in the normal form",
                "units": bend,
                "equation": "-V''''/6" + " = -(1/2) A cos(2 phi)" * exact,
                "source": FROM_MOTION,
            },
        ),
    }
    data = {
        "special_kind": variable(
            dims, np.array(kinds, LABEL_DTYPE), {"long_name": "kind of the special point"}
        ),
        "special_label": variable(
            dims,
            np.array([KINDS[kind].label for kind in kinds], LABEL_DTYPE),
            {"long_name": "label of the special point"},
        ),
    }
    for name, (column, about) in values.items():
        data[name] = variable(dims, np.array(column, float), about)
    data["on_branch"] = variable(
        (*dims, "branch"), on_branch, {"long_name": "whether the point lies on the branch"}
    )
    return data


_LABEL = {
    "long_name": "label of the equilibrium",
    "flag_values": np.arange(-1, 4, dtype=np.int8),
    "flag_meanings": " ".join(("absent", *LABELS["equilibrium"][0])),
}
