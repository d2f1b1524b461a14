"""Stable and unstable manifolds of the saddles of a flow, labelled."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt
import xarray as xr

from phasekit.cells.schema import dataset_attrs
from phasekit.errors import FlowEquilibriumKind, warn
from phasekit.labelled.in_box import dataset_of as equilibria_dataset
from phasekit.labelled.periodic_orbits import all_round, cycles_of
from phasekit.labels.arguments import bad, call_checked, number, whole
from phasekit.labels.grid import LABEL_DTYPE, make_grid, variable
from phasekit.laws.equations import equations_of
from phasekit.laws.ladder import Map
from phasekit.motion.equation_rates import slopes_at
from phasekit.motion.limit_cycles import Cycle
from phasekit.motion.manifold import Goal, Start, Strand, goals, strands
from phasekit.numerics.waits import notice
from phasekit.systems.problem import Problem, as_problem
from phasekit.systems.rests import Equilibria, corners, equilibria_of, kind_of, window_of
from phasekit.systems.system import as_system

Array = npt.NDArray[np.float64]

#: Relative error of a step by default.
RTOL = 1e-9


@call_checked
def manifolds(
    system: Any,
    equilibrium: int | None = None,
    *,
    window: Any = None,
    length: float = 20.0,
    rtol: float = RTOL,
) -> xr.Dataset:
    """One-dimensional stable and unstable manifolds of the saddles of a flow.

    Parameters
    ----------
    system : Problem, Perturbed, or system that states rates
        One flow without forcing, of any number of states.
    equilibrium : int, optional
        Number of the equilibrium, as `equilibria` has it; by default all that have such manifolds.
    window : mapping of str to (float, float), optional
        Where to look for equilibria, and where manifolds end; by default the system's. Angles may
        be left out: all round.
    length : float, default 20
        Greatest length of each half, in widths of the window.
    rtol : float, default 1e-9
        Error of a step that is allowed, relative. Points lie about as near to the manifold, in
        widths of the window.

    Returns
    -------
    xarray.Dataset
        On ``manifold``: ``manifold_stable``, ``manifold_from`` (number of the equilibrium),
        ``manifold_end`` (window, equilibrium, length, lost); and where its motions come in the end,
        a stable one's backward in time: ``manifold_to`` (number of the equilibrium, or -1) and
        ``manifold_cycle`` (number of the limit cycle, as `periodic_orbits` has it, or -1). On
        (``manifold``, ``point``): ``arclength`` in widths of the window, and ``manifold_`` with
        the name of each state; shorter ones end in NaN. Beside them the equilibria: ``x``,
        ``kind``, ``eigenvalue``.

    Raises
    ------
    ParameterError
        If the system is no such flow, or an argument is unusable.

    Notes
    -----
    Each half begins 1e-6 of the window from the equilibrium, in the direction of the one unstable
    (or stable) eigenvector, from which the manifold differs there by the square of that; it is
    followed by DOP853 in compiled code ([Kuznetsov2004] section 2.2). Points are at most 1/200 of
    the window apart. Limit cycles are looked for in planar flows.

    Examples
    --------
    >>> import phasekit as pk
    >>> duffing = pk.Problem(
    ...     {"x": "v", "v": "x - x^3 - d*v"}, parameters={"d": 0.2},
    ...     window={"x": (-2, 2), "v": (-2, 2)},
    ... )
    >>> found = pk.manifolds(duffing)
    >>> found.manifold_end.values[~found.manifold_stable.values].tolist()  # both fall into wells
    ['equilibrium', 'equilibrium']
    """
    problem = flow_of(system)
    for name, value, wants in (
        ("length", length, "a length > 0, in widths of the window"),
        ("rtol", rtol, "a number from 1e-13 to 1e-3"),
    ):
        given = number(name, value, wants)
        if not given > 0.0 or (name == "rtol" and not 1e-13 <= given <= 1e-3):
            raise bad(name, value, wants)
    low, high = corners(problem, window_of(system, window), "window")
    with notice("following manifolds"):
        rests = equilibria_of(problem, low, high)
        if rests.why:
            warn(f"manifolds: there may be other equilibria: {rests.why}")
        chosen = range(len(rests.x))
        if equilibrium is not None:
            wants = f"a number of an equilibrium, below {len(chosen)}"
            if (which := whole("equilibrium", equilibrium, wants, 0)) >= len(chosen):
                raise bad("equilibrium", equilibrium, wants)
            chosen = range(which, which + 1)
        found = manifolds_of(problem, low, high, rests, chosen, float(length), float(rtol))
    if equilibrium is not None and not found.strands:
        wants = "an equilibrium with one unstable or one stable eigenvalue, which is real"
        raise bad("equilibrium", equilibrium, wants)
    lost = sum(one.end == "lost" for one in found.strands)
    if lost:
        warn(
            f"manifolds: {lost} of {len(found.strands)} halves end where they run to infinity or "
            "the rates have no value",
            RuntimeWarning,
        )
    return _dataset(problem, low, high, rests, found)


def flow_of(system: Any) -> Problem:
    """The equations of one flow without forcing.

    Raises
    ------
    ParameterError
        If it is none.
    """
    found = as_system(system)
    law = equations_of(found)
    wants = "a flow x' = f(x) without forcing, such as a pk.Problem"
    if isinstance(law, Map) or (law is not None and law.time is not None):
        raise bad("system", found, wants)
    if law is None and found.standing.traits is None:
        raise bad("system", found, wants, "pk.separatrices has those of a potential")
    problem = as_problem(found)
    if problem.time is not None or problem.conservative and len(problem.state) == 1:
        raise bad("system", found, wants)
    return problem


class Manifolds(NamedTuple):
    """Halves of manifolds, where each begins, and where its motions come."""

    starts: list[Start]
    strands: list[Strand]
    goals: list[Goal]


def manifolds_of(
    problem: Problem, low: Array, high: Array, rests: Equilibria, chosen: Sequence[int],
    length: float, rtol: float = RTOL, cycles: Sequence[Cycle] | None = None,
) -> Manifolds:  # fmt: skip
    """Manifolds of some equilibria; limit cycles are looked for where they are not given."""
    law: Any = problem.law
    values = {name: float(problem.parameters[name]) for name in law.names}
    turns = all_round(problem, low, high)
    widths = np.where(turns > 0.0, turns, high - low)
    starts = [
        Start(k, side * direction, -1.0 if stable else 1.0)
        for k in chosen
        for stable, direction in _directions(law, values, rests.x[k], problem, widths)
        for side in (1.0, -1.0)
    ]
    found = strands(law, values, starts, (low, high), turns, rests.x, length, rtol)
    open_ = [k for k, one in enumerate(found) if one.end == "length"]
    if open_ and cycles is None and len(problem.state) == 2:
        cycles = cycles_of(problem, low, high, rests.x).cycles
    curves = [(cycle.state, cycle.period) for cycle in cycles or ()]
    ends = [(found[k].x[-1], starts[k].sense) for k in open_]
    ended = goals(law, values, ends, turns, widths, rests.x, curves, rtol)
    reached = [Goal(one.reached, -1) for one in found]
    for k, goal in zip(open_, ended, strict=True):
        reached[k] = goal
    return Manifolds(starts, found, reached)


def _directions(law: Any, values: Any, x: Any, problem: Any, width: Any) -> list[tuple[bool, Any]]:
    """The one stable and the one unstable direction of a saddle, in widths of the window."""
    slopes = slopes_at(law, values, x) * width / width[:, None]
    if len(x) < 2 or not np.isfinite(slopes).all():
        return []
    *_, kind = kind_of(slopes, discrete=False, conservative=problem.conservative, error=1e-9)
    if kind != FlowEquilibriumKind.SADDLE:
        return []
    found, vectors = np.linalg.eig(slopes)
    directions = []
    for stable, those in ((False, found.real > 0.0), (True, found.real < 0.0)):
        if those.sum() == 1:
            directions.append((stable, np.real(vectors[:, np.argmax(those)])))
    return directions


def _dataset(
    problem: Problem, low: Array, high: Array, rests: Equilibria, found: Manifolds
) -> xr.Dataset:
    states = problem.state
    most = max((len(one.x) for one in found.strands), default=0)
    table = np.full((len(found.strands), most, len(states) + 1), np.nan)
    for row, one in zip(table, found.strands, strict=True):
        row[: len(one.x), 0] = one.arclength
        row[: len(one.x), 1:] = one.x
    on, along = ("manifold",), ("manifold", "point")
    columns: dict[str, tuple[Any, Any, str]] = {
        "manifold_stable": (
            [one.sense < 0.0 for one in found.starts], bool,
            "whether motions on it come to the equilibrium",
        ),
        "manifold_from": (
            [one.rest for one in found.starts], np.int64,
            "number of the equilibrium to which it belongs",
        ),
        "manifold_end": ([one.end for one in found.strands], LABEL_DTYPE, "why it ends"),
        "manifold_to": (
            [one.rest for one in found.goals], np.int64,
            "number of the equilibrium to which its motions come, or -1",
        ),
        "manifold_cycle": (
            [one.cycle for one in found.goals], np.int64,
            "number of the limit cycle to which its motions come, or -1",
        ),
    }  # fmt: skip
    data = {
        name: variable(on, np.array(values, kind), {"long_name": text})
        for name, (values, kind, text) in columns.items()
    }
    data["arclength"] = variable(
        along, table[..., 0], {"long_name": "length in widths of the window", "units": "1"}
    )
    for i, name in enumerate(states):
        attrs = {"long_name": f"{name} on the manifold", "units": problem.unit_of(name) or "1"}
        data[f"manifold_{name}"] = variable(along, table[..., 1 + i], attrs)
    kept = equilibria_dataset(problem, make_grid(problem.parameters), [rests], low, high)
    kept = kept[["x", "kind", "eigenvalue", "n_unstable", "n_equilibria", "complete"]]
    return kept.assign(data).assign_attrs(dataset_attrs(problem))
