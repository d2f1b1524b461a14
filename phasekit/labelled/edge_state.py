"""The state on the boundary between two basins, labelled."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
import xarray as xr

from phasekit.errors import AttractorKind, warn
from phasekit.labelled.basins import attractor_rows, laid_out
from phasekit.labelled.flows import refuse_force, states_of
from phasekit.labelled.motion import checked_tolerances
from phasekit.labels.arguments import FloatArray, bad, call_checked, number
from phasekit.labels.grid import variable
from phasekit.laws.equations import Equations
from phasekit.laws.ladder import Map
from phasekit.motion.attractors import find_of
from phasekit.motion.edge import ESCAPED, Edge, edge_between, fates
from phasekit.motion.flow import RTOL
from phasekit.motion.lost import tell_open
from phasekit.motion.strobe import check_period, common_period
from phasekit.numerics.waits import notice
from phasekit.systems.problem_parts import refuse_aperiodic
from phasekit.systems.system import as_system, single
from phasekit.table.attractors import rows_of

#: States between both from which attractors are looked for.
STARTS = 33


@call_checked
def edge_state(system: Any, a: Any, b: Any, *, rtol: float | None = None) -> xr.Dataset:
    """State on the boundary between the basins of two states, to which motions along it come.

    Parameters
    ----------
    system : Problem, Perturbed, or system that states rates or a step
        One flow, forced or not, or one map.
    a, b : mapping, sequence or xarray.DataArray
        Two states that come to different attractors, or one of which runs to infinity.
    rtol : float, optional
        Error of a step that is allowed, relative to the state; default 1e-10.

    Returns
    -------
    xarray.Dataset
        On ``point``: ``edge_`` and the name of each state, a saddle, or a periodic orbit with
        one unstable multiplier; ``edge_kind`` (`AttractorKind`), ``edge_period``, ``edge_exponent``
        (its greatest rate of growth), ``edge_multiplier`` (the greatest modulus of its multipliers,
        of a flow NaN at a rest) and ``n_unstable``. On ``step``: ``track_`` and the name of each
        state, the way along the boundary. ``basin_of_a`` and ``basin_of_b``, numbers of the
        attractors, -2 for infinity; and what `attractors` gives.

    Raises
    ------
    ParameterError
        If an argument is unusable, or both states come to the same attractor, or to none.

    Warns
    -----
    RuntimeWarning
        If motions along the boundary come neither to a rest nor to a periodic orbit: the kind is
        then UNKNOWN, and the points are the last ones of the way.

    Notes
    -----
    Bisection along the flow [SkufcaYorkeEckhardt2006]: two states on both sides of the boundary are
    brought to within 1e-10 of the window, followed until they are 1e-6 apart, and brought together
    again. What they come near to is refined by Newton's method. It attracts on the boundary if it
    has one unstable direction.

    Examples
    --------
    >>> import phasekit as pk
    >>> bistable = pk.Problem(
    ...     {"x": "10*(x - x^3 - y)", "y": "x - 3*y"}, window={"x": (-2, 2), "y": (-1, 1)}
    ... )
    >>> ds = pk.edge_state(bistable, [-1.0, 0.0], [1.0, 0.2])
    >>> ds.edge_x.round(9).item(), ds.n_unstable.item()
    (0.0, 1)
    """
    found = as_system(system)
    law = found.own_equations
    if law is None and found.standing.traits is not None:
        law, a, b = found.equations(), *(_by_place(found, one) for one in (a, b))
    if law is None:
        raise bad("system", found, "a map, or a flow with states of its own or with damping")
    _, parameters = single(found)
    refuse_force(found)
    refuse_aperiodic(law, found)
    rtol = checked_tolerances(rtol, None).get("rtol", RTOL)
    ends = [_state(law, argument, given) for argument, given in (("a", a), ("b", b))]
    values = {name: np.asarray(parameters[name], float) for name in law.names}
    if law.time is not None:
        check_period("period", common_period(law, values))
    between = ends[0] + np.linspace(0.0, 1.0, STARTS)[:, None] * (ends[1] - ends[0])
    widths = np.array([np.ptp(law.window.get(name, (0.0, 0.0))) for name in law.states])
    widths = np.maximum(widths, np.abs(ends[1] - ends[0]))
    with notice("following the boundary between two basins"):
        search = find_of(law, values, between, widths, rtol)
        codes = fates(search, np.array(ends))
        for argument, code in zip("ab", codes, strict=True):
            if code == -1:
                raise bad(argument, list(a if argument == "a" else b), "a state in a basin",
                          "its motion came to no attractor")  # fmt: skip
        if codes[0] == codes[1]:
            what = "infinity" if codes[0] == ESCAPED else f"the attractor {codes[0]}"
            raise bad("b", list(ends[1]), "a state in another basin than a", f"both come to {what}")
        edge = edge_between(search, ends[0], ends[1], int(codes[0]))
    tell_open("edge_state", search.open)
    if edge.kind == AttractorKind.UNKNOWN:
        warn(
            "edge_state: motions along the boundary come neither to a rest nor to a periodic orbit "
            "within reach; it may be chaotic",
            RuntimeWarning,
        )
    ds = laid_out(found, rows_of(law), attractor_rows(law, search.result()))
    return ds.assign(_rows(law, edge, codes))


def _by_place(system: Any, given: Any) -> Any:
    """A state with the coordinate and its rate by the names that results have for them."""
    if not isinstance(given, Mapping):
        return given
    names = {system.coordinate: "phi", f"d{system.coordinate}": "dphi"}
    return {names.get(name, name): value for name, value in given.items()}


def _state(law: Equations, argument: str, given: Any) -> FloatArray:
    parts = states_of(law, given, {}, argument=argument).items()
    return np.array([number(f"{argument}[{name!r}]", value) for name, (_, value) in parts])


def _rows(law: Equations, edge: Edge, codes: Any) -> dict[str, xr.Variable]:
    rest = edge.kind == AttractorKind.EQUILIBRIUM and edge.period == 0.0
    if edge.multipliers.size and rest:
        growth, greatest = float(edge.multipliers.real.max()), np.nan
        unstable = int((edge.multipliers.real > 0.0).sum())
    elif edge.multipliers.size:
        greatest = float(np.abs(edge.multipliers).max())
        time = edge.period * (1.0 if edge.kind == AttractorKind.EQUILIBRIUM else _unit(law, edge))
        growth = float(np.log(greatest)) / time
        unstable = int((np.abs(edge.multipliers) > 1.0).sum())
    else:
        growth, greatest, unstable = np.nan, np.nan, -1
    flags = rows_of(law)["attractor_kind"].attrs
    table: dict[str, tuple[tuple[str, ...], Any, dict[str, Any]]] = {
        "edge_kind": ((), np.int8(edge.kind), {**flags, "long_name": "kind of the edge state"}),
        "edge_period": ((), edge.period, {
            "long_name": "time, iterations or periods after which it repeats itself, 0: none"}),
        "edge_exponent": ((), growth, {"long_name": "greatest rate of growth at the edge state"}),
        "edge_multiplier": ((), greatest, {"long_name": "greatest modulus of its multipliers"}),
        "n_unstable": ((), unstable, {"long_name": "unstable directions, -1: not computed"}),
        "basin_of_a": ((), int(codes[0]), {"long_name": "attractor of a, -2: infinity"}),
        "basin_of_b": ((), int(codes[1]), {"long_name": "attractor of b, -2: infinity"}),
    }  # fmt: skip
    for i, name in enumerate(law.states):
        units = {"units": law.units.get(name, "1")}
        table[f"edge_{name}"] = (
            ("point",),
            edge.points[:, i],
            {"long_name": f"{name} of the edge state", **units},
        )
        table[f"track_{name}"] = (
            ("step",),
            edge.track[:, i],
            {"long_name": f"{name} along the boundary", **units},
        )
    return {name: variable(dims, data, attrs) for name, (dims, data, attrs) in table.items()}


def _unit(law: Equations, edge: Edge) -> float:
    """Time of what a period counts."""
    return 1.0 if isinstance(law, Map) or law.time is None else edge.leg
