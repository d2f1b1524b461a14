"""Poincare sections, labelled: the states in which motions pass a value, or meet a formula."""

from __future__ import annotations

from typing import Any

import numpy as np
import xarray as xr

from phasekit.cells.request import equations_for
from phasekit.cells.schema import dataset_attrs, input_attrs
from phasekit.inputs import is_real, refuse_call
from phasekit.labelled.crossings import sections_through
from phasekit.labelled.motion import checked_tolerances, refuse_noise
from phasekit.labels.arguments import bad, number, state_arguments, whole
from phasekit.labels.coordinates import LABELS
from phasekit.labels.grid import variable
from phasekit.laws.ladder import Map, Routhian
from phasekit.motion.equation_rates import pointwise
from phasekit.motion.method import circle, unit_of
from phasekit.motion.sections import Section, passages
from phasekit.motion.steps import InitialValue
from phasekit.systems.perturbed import Perturbed
from phasekit.systems.system import as_system, single
from phasekit.table.quantities import ROWS


@state_arguments
def poincare_section(
    system: Any,
    phi0: Any = None,
    dphi0: Any = None,
    *,
    section: Any,
    duration: float | None = None,
    n: int | None = None,
    x0: Any = None,
    direction: int = 1,
    rtol: float | None = None,
    atol: float | None = None,
    **states: Any,
) -> xr.Dataset:
    """States at which motions cross a section, from time 0 on.

    Parameters
    ----------
    system : system, Perturbed, FreeGyroRotor or Problem
        Any flow. `stroboscopic` gives the states once a period of a drive.
    section : float, (str, float), str or sympy expression
        The angle of the section in rad, full turns aside; or a state with its value, such as
        ``("z", 27.0)``; or a formula of states, parameters and time: ``"z = r - 1"``, or
        ``"x + 2*y - 1"``, which vanishes there.
    duration : float, optional
        Time to follow the motions, s.
    n : int, optional
        In place of a duration, or besides: crossings after which a motion ends.
    x0 : mapping, sequence or xarray.DataArray, optional
        States at t = 0 of a `Problem`, as in `flow`; ``poincare_section(problem, x0, ...)`` does
        as well. Each may be an array.
    direction : {1, -1, 0}
        Crossings at which the coordinate, or the formula, rises, falls, or both.
    rtol, atol : float, optional
        Error of a step that is allowed, relative and absolute; default 1e-10 and 1e-12.
    **states
        The states of a `Problem` by name, in place of `x0`; what `FreeGyroRotor.poincare` takes
        besides.

    Returns
    -------
    xarray.Dataset
        On the dim ``crossing``: ``section_time`` in s, ``section_phi`` in rad in (-pi, pi],
        ``section_dphi`` in s^-1; of a `Problem` ``section_`` and the name of each state, angles
        within half a period of 0; of a `FreeGyroRotor` what its `poincare` gives. Arrays of states
        and parameters span further dims; there ``n_crossings`` says how many a motion has, and
        others are NaN.

    Raises
    ------
    ConvergenceError
        If the integrator cannot reach the end of a single motion with the accuracy asked for.

    Notes
    -----
    The points of the motions with ``phi = section`` ([GuckenheimerHolmes1983] section 1.5). Motions
    are integrated by DOP853 ([HairerNorsettWanner1993]), many in compiled code on all cores; each
    step is looked at in parts, and where the formula turns towards zero, so that two crossings in
    one step are not lost. A crossing is a zero on the interpolant of a step. The state at t = 0 is
    none. A RuntimeWarning counts the motions that do not meet the section.

    Examples
    --------
    >>> import phasekit as pk
    >>> pendulum = pk.Perturbed(pk.Coefficients(0.0, 1.0, 0.0), damping=0.1)
    >>> pk.poincare_section(pendulum, 0.0, 1.0, duration=20.0, section=0.0).section_dphi.round(3)
    <xarray.DataArray 'section_dphi' (crossing: 3)> Size: 24B
    array([0.724, 0.527, 0.384])...
    >>> lorenz = pk.Problem(
    ...     {"x": "10*(y - x)", "y": "x*(r - z) - y", "z": "x*y - 8*z/3"}, parameters={"r": 28.0}
    ... )
    >>> ds = pk.poincare_section(lorenz, {"x": [1, 2], "y": 1, "z": 20}, section="z = r - 1", n=50)
    >>> ds.section_x.dims
    ('point', 'crossing')
    """
    wants = "a time in s, > 0"
    found: Any = as_system(system)
    law = equations_for(found, "motion")
    if isinstance(law, Map):
        raise bad("system", system, "a flow x' = f(x): a map has no sections")
    if duration is None and n is None:
        raise bad("duration", duration, f"{wants}, or a number of crossings n=")
    if duration is not None:
        duration = number("duration", duration, wants, found.unit_of("time"))
        if not duration > 0.0:
            raise bad("duration", duration, wants)
    if n is not None:
        n = whole("n", n, "a number of crossings >= 1", 1)
    senses = "1 (rising), -1 (falling) or 0 (both)"
    direction = whole("direction", direction, senses, -1)
    if direction > 1:
        raise bad("direction", direction, senses)
    tolerances = checked_tolerances(rtol, atol)
    if issubclass(found.rung, Routhian) and hasattr(found, "poincare"):
        if duration is None or n is not None:
            raise bad("n", n, "None, and a duration, for a FreeGyroRotor")
        arguments = {**states, "direction": direction, **tolerances}
        ds: xr.Dataset = found.poincare(
            phi0, _needed(dphi0), duration, section=section, **arguments
        )
        return ds
    how = {"section": section, "duration": duration, "n": n, "direction": direction}
    if law is not None:
        given = [phi0, dphi0] if x0 is None and dphi0 is not None else phi0
        start = given if x0 is None else x0
        return sections_through(found, law, start, states, tolerances=tolerances, **how)
    refuse_call(poincare_section, states)
    if x0 is not None:
        raise bad("x0", x0, "nothing for a system whose state is phi0, dphi0")
    if phi0 is None:
        raise bad("phi0", None, "the angle at t = 0, in rad")
    alone = all(isinstance(value, float) for value in found.parameters.values())
    if n is None and alone and not np.ndim(phi0) and not np.ndim(dphi0) and is_real(section):
        return _of_system(found, phi0, dphi0, duration, section, direction, tolerances)
    return _of_many(found, phi0, _needed(dphi0), tolerances, **how)


def _of_many(
    system: Any, phi0: Any, dphi0: Any, tolerances: dict[str, Any], *, section: Any, **how: Any
) -> xr.Dataset:
    """Sections of many motions of a system of one coordinate, by its equations."""
    moved = system if system.standing.traits is not None else Perturbed(system)
    refuse_noise(moved)
    level = section
    if is_real(section):
        level = ("phi", number("section", section, units=system.unit_of("state_phi")))
    start = {"phi": phi0, "dphi": dphi0}
    other = {system.coordinate or "phi": "phi"}
    ds = sections_through(
        moved, moved.equations(), start, {}, section=level, tolerances=tolerances, other=other,
        **how,
    )  # fmt: skip
    for name in ("section_time", "section_phi", "section_dphi"):
        row = ROWS[name]
        words = moved.law.words(name, row.units, row.long_name)
        ds[name].attrs |= {**row.attrs, **words, "equation": ds[name].attrs["equation"]}
    ds.attrs = dataset_attrs(system)
    return ds.drop_vars([name for name in moved.parameters if name not in system.parameters])


def _needed(dphi0: Any) -> Any:
    if dphi0 is None:
        raise bad("dphi0", None, "the angular velocity at t = 0, in s^-1")
    return dphi0


def _of_system(
    system: Any,
    phi0: float,
    dphi0: float | None,
    duration: Any,
    section: float,
    direction: int,
    tolerances: dict[str, Any],
) -> xr.Dataset:
    perturbed = system
    if system.standing.traits is None:
        perturbed = Perturbed(system)
    refuse_noise(perturbed)
    level = number("section", section, "a finite number", system.unit_of("state_phi"))
    state = (
        number("phi0", phi0, units=system.unit_of("state_phi")),
        number("dphi0", _needed(dphi0), units=system.unit_of("state_dphi")),
    )
    _, parameters = single(system)
    law = perturbed.law
    rates = pointwise(law, law.values(*perturbed.parameters.values()), duration)
    turn = circle(law)
    found = passages(
        InitialValue(rates, state, **tolerances, unit=unit_of(law)),
        duration, 0, level, period=turn or None, direction=direction,
    )  # fmt: skip
    if turn:
        # Of what rounding leaves next to the cut, some would stand at either side of it.
        found.state[0] = 0.5 * turn - np.mod(0.5 * turn - level, turn)
    names = ("section_time", "section_phi", "section_dphi")
    data = {}
    for name, values in zip(names, (found.time, *found.state), strict=True):
        row = ROWS[name]
        attrs = {**row.attrs, **law.words(name, row.units, row.long_name)}
        data[name] = variable(("crossing",), values, {**attrs, "equation": "phi = section"})
    coords = {
        name: variable((), value, input_attrs(system, name)) for name, value in parameters.items()
    }
    return xr.Dataset(data, {**coords, "crossing": _numbers(found)}, dataset_attrs(system))


def _numbers(found: Section) -> xr.Variable:
    return variable(("crossing",), np.arange(found.time.size), {"long_name": LABELS["crossing"][1]})
