"""Poincare sections, labelled: the states in which a motion passes a value of its coordinate."""

from __future__ import annotations

from typing import Any

import numpy as np
import xarray as xr

from phasekit.cells.schema import dataset_attrs, input_attrs
from phasekit.labelled.flows import states_of
from phasekit.labelled.motion import checked_tolerances, refuse_noise
from phasekit.labels.arguments import (
    FloatArray,
    bad,
    call_checked,
    number,
    whole,
)
from phasekit.labels.coordinates import LABELS
from phasekit.labels.grid import variable
from phasekit.laws.equations import Equations, equations_of
from phasekit.laws.ladder import Map, Routhian
from phasekit.laws.perturbed import PerturbedConservative
from phasekit.motion.equation_rates import pointwise as pointwise_of
from phasekit.motion.flow import pointwise
from phasekit.motion.method import circle, unit_of
from phasekit.motion.sections import Section, passages
from phasekit.motion.steps import InitialValue
from phasekit.systems.perturbed import Perturbed
from phasekit.systems.system import as_system, single
from phasekit.table.quantities import ROWS


@call_checked
def poincare_section(
    system: Any,
    phi0: Any,
    dphi0: float | None = None,
    *,
    duration: float,
    section: Any,
    direction: int = 1,
    rtol: float | None = None,
    atol: float | None = None,
    **arguments: Any,
) -> xr.Dataset:
    """States at which a motion crosses a section, from time 0 on.

    Parameters
    ----------
    system : system, Perturbed, FreeGyroRotor or Problem
        One system. `stroboscopic` gives the states once a period of a drive.
    phi0, dphi0 : float
        State at t = 0: angle in rad, angular velocity in s^-1; of a `Problem` ``phi0`` is the
        sequence of its states, and ``dphi0`` None.
    duration : float
        Time to follow the motion, s.
    section : float or (str, float)
        The angle of the section in rad, full turns aside; of a `Problem` the name of a state with
        its value.
    direction : {1, -1, 0}
        Passages in which the coordinate rises, falls, or both.
    rtol, atol : float, optional
        Error of a step that is allowed, relative and absolute; default 1e-10 and 1e-12.
    **arguments
        What `FreeGyroRotor.poincare` takes besides.

    Returns
    -------
    xarray.Dataset
        On the dim ``crossing``: ``section_time`` in s, ``section_phi`` in rad in (-pi, pi],
        ``section_dphi`` in s^-1; of a `Problem` ``section_`` and the name of each state; of a
        `FreeGyroRotor` what its `poincare` gives.

    Raises
    ------
    ParameterError
        If an argument is unusable.
    ConvergenceError
        If the integrator cannot reach the end with the accuracy asked for.

    Notes
    -----
    The points of the motion with ``phi = section`` ([GuckenheimerHolmes1983] section 1.5). The
    motion is integrated by DOP853 ([HairerNorsettWanner1993]); each step is cut where the
    coordinate turns, so that two passages in one step are not lost, and a passage is a root of the
    step's interpolant. The state at t = 0 is none.

    Examples
    --------
    >>> import phasekit as pk
    >>> pendulum = pk.Perturbed(pk.Coefficients(0.0, 1.0, 0.0), damping=0.1)
    >>> pk.poincare_section(pendulum, 0.0, 1.0, duration=20.0, section=0.0).section_dphi.round(3)
    <xarray.DataArray 'section_dphi' (crossing: 3)> Size: 24B
    array([0.724, 0.527, 0.384])...
    """
    wants = "a time in s, > 0"
    found: Any = as_system(system)
    law = equations_of(found)
    if isinstance(law, Map):
        raise bad("system", system, "a flow x' = f(x): a map has no sections")
    duration = number("duration", duration, wants, "s")
    if not duration > 0.0:
        raise bad("duration", duration, wants)
    senses = "1 (rising), -1 (falling) or 0 (both)"
    direction = whole("direction", direction, senses, -1)
    if direction > 1:
        raise bad("direction", direction, senses)
    tolerances = checked_tolerances(rtol, atol)
    if issubclass(found.rung, Routhian):
        arguments |= {"direction": direction, **tolerances}
        ds: xr.Dataset = found.poincare(
            phi0, _needed(dphi0), duration, section=section, **arguments
        )
        return ds
    if arguments:
        raise bad(*next(iter(arguments.items())), "nothing, except of a FreeGyroRotor")
    if law is not None:
        return _of_equations(found, law, phi0, duration, section, direction, tolerances)
    return _of_system(found, phi0, dphi0, duration, section, direction, tolerances)


def _needed(dphi0: float | None) -> float:
    if dphi0 is None:
        raise bad("dphi0", None, "the angular velocity at t = 0, in s^-1")
    return dphi0


def _of_system(
    system: Any,
    phi0: float,
    dphi0: float | None,
    duration: float,
    section: float,
    direction: int,
    tolerances: dict[str, Any],
) -> xr.Dataset:
    perturbed = system
    if not issubclass(system.rung, PerturbedConservative):
        perturbed = Perturbed(system)
    refuse_noise(perturbed)
    level = number("section", section, "a finite number", system.unit_of("state_phi"))
    state = (
        number("phi0", phi0, units=system.unit_of("state_phi")),
        number("dphi0", _needed(dphi0), units=system.unit_of("state_dphi")),
    )
    _, parameters = single(system)
    law = perturbed.law
    rates = pointwise(law, law.values(*perturbed.parameters.values()), 0.0, duration)
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


def _of_equations(
    system: Any,
    law: Equations,
    x0: Any,
    duration: float,
    section: Any,
    direction: int,
    tolerances: dict[str, Any],
) -> xr.Dataset:
    wants = f"one of the states {', '.join(law.states)} with a value: ('{law.states[0]}', 0.)"
    if not isinstance(section, tuple) or len(section) != 2 or section[0] not in law.states:
        raise bad("section", section, wants)
    level = number("section", section[1], wants)
    given = [value for _, value in states_of(law, x0, {}).values()]
    start: FloatArray = np.array([number("x0", value) for value in given])
    _, values = single(system)
    found = passages(
        InitialValue(pointwise_of(law, values), list(start), **tolerances, unit=np.inf),
        duration, law.states.index(section[0]), level,
        period=law.periods.get(section[0]), direction=direction,
    )  # fmt: skip
    equation = f"{section[0]} = {level!r}"
    attrs = {"long_name": "time of the crossing", "units": "1", "equation": equation}
    data = {"section_time": variable(("crossing",), found.time, attrs)}
    for name, column in zip(law.states, found.state, strict=True):
        attrs = {
            "long_name": f"{name} in the section", "units": law.units.get(name, "1"),
            "equation": equation,
        }  # fmt: skip
        data[f"section_{name}"] = variable(("crossing",), column, attrs)
    coords = {name: variable((), values[name], input_attrs(system, name)) for name in law.names}
    return xr.Dataset(data, {**coords, "crossing": _numbers(found)}, dataset_attrs(system))
