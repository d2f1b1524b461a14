"""Events on damped and driven motions, labelled."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
import xarray as xr

from phasekit.labels.arguments import bad
from phasekit.labels.grid import LABEL_DTYPE, variable
from phasekit.motion.flow import pointwise
from phasekit.motion.integrate import integrate
from phasekit.motion.method import unit_of
from phasekit.motion.prescribed import span
from phasekit.motion.steps import InitialValue
from phasekit.systems.driven_rotor import event_of
from phasekit.systems.system import System, single

ARGUMENTS = ("t", "phi", "dphi")


def with_events(
    ds: xr.Dataset, system: System, events: Any, tolerances: Mapping[str, Any]
) -> xr.Dataset:
    """Add the events on one motion, and end it where they say so.

    Raises
    ------
    ParameterError
        If there are several motions, or an event is unusable.
    ConvergenceError
        If the integrator cannot reach the last time.
    """
    named = events if isinstance(events, Mapping) else {"event": events}
    watched = {name: event_of(name, event, ARGUMENTS) for name, event in named.items()}
    law: Any
    law, parameters = single(system)
    if ds.state_phi.ndim or ds.state_dphi.ndim:
        raise bad("events", list(named), "nothing, or one motion: a single state")
    values = law.values(*parameters.values())
    found: list[tuple[str, float, float, float]] = []
    phi, dphi = ds.motion_phi.values.copy(), ds.motion_dphi.values.copy()
    for stop in span(ds.time.values):
        if stop == 0.0:
            continue
        rates = pointwise(law, values, min(stop, 0.0), max(stop, 0.0))
        start = (ds.state_phi.item(), ds.state_dphi.item())
        problem = InitialValue(rates, start, **tolerances, unit=unit_of(law))
        motion = integrate(problem, stop, watched)
        own = list(zip(*motion.events[:2], *motion.events.state, strict=True))
        found = own[::-1] if stop < 0.0 else found + [e for e in own if e[1] > 0.0 or not found]
        beyond = np.sign(stop) * (ds.time.values - motion.times[-1]) > 0.0
        phi[beyond], dphi[beyond] = np.nan, np.nan
    data = {"motion_phi": phi, "motion_dphi": dphi}
    ds = ds.assign({name: ds[name].copy(data=array) for name, array in data.items()})
    names = np.array([name for name, *_ in found], LABEL_DTYPE)
    ds["event_name"] = variable(("event",), names, {"long_name": "name of the event"})
    columns = np.reshape([row[1:] for row in found], (-1, 3)).T
    attrs = ({**ds.time.attrs, "long_name": "time"}, ds.motion_phi.attrs, ds.motion_dphi.attrs)
    for name, array, own_attrs in zip(("time", "phi", "dphi"), columns, attrs, strict=True):
        words = {**own_attrs, "long_name": f"{own_attrs['long_name']} at the event"}
        ds[f"event_{name}"] = variable(("event",), array, {**words, "equation": "event = 0"})
    return ds
