"""Stable and unstable manifolds of the saddles of a flow or a map, labelled."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
import xarray as xr

from phasekit.arrays import Array
from phasekit.cells.schema import dataset_attrs
from phasekit.errors import FlowEquilibriumKind, warn
from phasekit.labelled.flows import states_of
from phasekit.labelled.in_box import dataset_of as equilibria_dataset
from phasekit.labelled.periodic_orbits import all_round, cycles_of
from phasekit.labels.arguments import bad, call_checked, list_names, number, whole
from phasekit.labels.grid import LABEL_DTYPE, make_grid, variable
from phasekit.laws.ladder import Map, Trait
from phasekit.motion.equation_rates import slopes_at
from phasekit.motion.limit_cycles import Cycle
from phasekit.motion.manifold import Goal, Start, Strand, goals, strands
from phasekit.motion.map_manifold import Half, Iterates, Leg, Motions, fixed_points, strand_of
from phasekit.motion.method import whole_turns
from phasekit.motion.strobe import common_period
from phasekit.numerics.waits import notice
from phasekit.systems.problem import Problem, as_problem
from phasekit.systems.rests import Equilibria, corners, equilibria_of, kind_of, window_of
from phasekit.systems.smooth import refuse_jumps
from phasekit.systems.system import as_system

#: Relative error of a step by default.
RTOL = 1e-9
#: Starts of Newton's method for the periodic motions of a forced flow.
STARTS = 512
#: Size of a multiplier next to which a map has no inverse.
SINGULAR = 1e-9
#: Distance of a state that stands for an equilibrium, in widths of the window.
NEAR = 0.01
#: Part of the length asked for, from which on it counts as reached.
ENOUGH = 0.99


@call_checked
def manifolds(
    system: Any,
    equilibrium: Any = None,
    *,
    window: Any = None,
    length: float = 20.0,
    rtol: float = RTOL,
    n: int | None = None,
) -> xr.Dataset:
    """One-dimensional stable and unstable manifolds of the saddles of a flow or a map.

    Parameters
    ----------
    system : Problem, Perturbed, or system that states rates
        One flow of any number of states, or one map. A forced flow is seen once a period, from
        t = 0.
    equilibrium : int, or mapping, sequence or xarray.DataArray, optional
        Number of the equilibrium, as `equilibria` has it, or a state next to it, within a hundredth
        of the window; by default all that have such manifolds. Of a map that of the fixed point, of
        a forced flow that of the state on its periodic motion.
    window : mapping of str to (float, float), optional
        Where to look for equilibria, and where manifolds end; by default the system's. Angles may
        be left out: all round. A manifold of a map may leave the window and come back, so it needs
        a wide one.
    length : float, default 20
        Greatest length of each half, in widths of the window.
    rtol : float, default 1e-9
        Error of a step that is allowed, relative. Points lie about as near to the manifold, in
        widths of the window. Of forced flows it is 1e-12, and maps have no such error.
    n : int, optional
        Of a map or a forced flow: iterations, or periods of the forcing, after which a point comes
        back to itself; by default 1.

    Returns
    -------
    xarray.Dataset
        On ``manifold``: ``manifold_stable``, ``manifold_from`` (number of the equilibrium),
        ``manifold_end`` (window, equilibrium, length, lost); and where its motions come in the end,
        a stable one's backward in time: ``manifold_to`` (number of the equilibrium, or -1) and
        ``manifold_cycle`` (number of the limit cycle, as `periodic_orbits` has it, or -1). On
        (``manifold``, ``point``): ``arclength`` in widths of the window, and ``manifold_`` with
        the name of each state; shorter ones end in NaN. Beside them the equilibria: ``x``,
        ``kind``, ``eigenvalue``. Of maps and forced flows ``manifold_cycle`` is -1, and
        ``manifold_to`` is -1 where the manifold itself comes to no fixed point.

    Raises
    ------
    ParameterError
        If the system is neither, or an argument is unusable.

    Notes
    -----
    Each half begins 1e-6 of the window from the equilibrium, in the direction of the one unstable
    (or stable) eigenvector, from which the manifold differs there by the square of that; it is
    followed by DOP853 in compiled code ([Kuznetsov2004] section 2.2). Points are at most 1/200 of
    the window apart. Limit cycles are looked for in planar flows.

    Of a map, a half begins with a short piece of the parabola that the manifold is next to the
    fixed point; the rest are images of it, or preimages next to one another by Newton's method.
    Where points part by 1/200 of the window, or the curve turns by more than 0.2, points are put
    in on the first piece, so that each is as exact as all. A manifold with a negative multiplier is
    followed by the iterate of twice as many steps. Where a map has no preimage next to the one
    before, a stable manifold ends as lost, though it may have other parts. A half ends short of its
    length, which is said, where it has too many points or rounding parts them. Periodic motions of
    forced flows are looked for from 512 states, so that there may be others, which is said.

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
    problem, times = _one_of(system, n)
    refuse_jumps(problem)
    for name, value, wants in (
        ("length", length, "a length > 0, in widths of the window"),
        ("rtol", rtol, "a number from 1e-13 to 1e-3"),
    ):
        given = number(name, value, wants)
        if not given > 0.0 or (name == "rtol" and not 1e-13 <= given <= 1e-3):
            raise bad(name, value, wants)
    low, high = corners(problem, window_of(system, window), "window")
    with notice("following manifolds"):
        legs = None if times is None else Legs(problem, low, high, times)
        rests = equilibria_of(problem, low, high) if legs is None else legs.rests()
        chosen = range(len(rests.x))
        if equilibrium is not None:
            which = _chosen(problem, equilibrium, rests.x, low, high)
            chosen = range(which, which + 1)
        if legs is None:
            found = manifolds_of(problem, low, high, rests, chosen, float(length), float(rtol))
        else:
            found = legs.manifolds(rests, chosen, float(length))
    if equilibrium is not None and not found.strands:
        wants = "a saddle with one unstable or one stable eigenvalue, which is real"
        raise bad("equilibrium", equilibrium, wants)
    tell_missing("manifolds", problem, rests, found, length)
    return _dataset(problem, low, high, rests, found)


def _chosen(problem: Problem, given: Any, rests: Array, low: Array, high: Array) -> int:
    """The number of an equilibrium that is given by that, or by a state next to it."""
    wants = f"a value for each of {list_names(problem.state)}"
    try:
        single = np.ndim(given) == 0
    except ValueError:  # of lists of different lengths
        raise bad("equilibrium", given, wants) from None
    if isinstance(given, (int, np.integer)) or (single and not len(rests)):
        wants = f"a number of an equilibrium, below {len(rests)}"
        if (which := whole("equilibrium", given, wants, 0)) >= len(rests):
            raise bad("equilibrium", given, wants)
        return which
    parts = states_of(problem.own_equations, given, {}, argument="equilibrium").items()
    state = np.array([number(f"equilibrium[{name!r}]", value) for name, (_, value) in parts])
    turns = all_round(problem, low, high)
    away = rests - state
    away -= whole_turns(away, turns)
    apart = np.max(np.abs(away) / np.where(turns > 0.0, turns, high - low), axis=1)
    wants = f"a number, or a state within {NEAR:g} of the window of an equilibrium"
    if not np.min(apart, initial=np.inf) <= NEAR:
        places = ", ".join(str([float(f"{v:.6g}") for v in x]) for x in rests[:6])
        raise bad("equilibrium", given, wants, f"they are at {places}" if len(rests) else "")
    return int(np.argmin(apart))


def tell_missing(
    caller: str, problem: Problem, rests: Equilibria, found: Manifolds, length: float
) -> None:
    """Warn of points that may be missing, and of manifolds that end before their length."""
    if rests.why:
        what = "equilibria" if not problem.map and problem.time is None else "fixed points"
        warn(f"{caller}: there may be other {what}: {rests.why}")
    count = len(found.strands)
    lost = sum(one.end == "lost" for one in found.strands)
    if lost:
        warn(
            f"{caller}: {lost} of {count} halves of manifolds end where they run to infinity, f "
            "has no value or, of a map, no image or preimage next to those of the points before",
            RuntimeWarning,
        )
    short = sum(
        one.end == "length" and one.arclength[-1] < ENOUGH * length for one in found.strands
    )
    if short:
        warn(
            f"{caller}: {short} of {count} halves of manifolds end for their number of points, or "
            f"where rounding parts these, before they are {float(length):g} widths of the window "
            "long",
            RuntimeWarning,
        )


def _one_of(system: Any, n: int | None) -> tuple[Problem, int | None]:
    """The equations of a flow, or of a map or forced flow and after how many legs points return."""
    found = as_system(system)
    law = found.own_equations
    traits = found.standing.traits
    forced = traits is not None and Trait.DRIVEN in traits
    if not (isinstance(law, Map) or forced or (law is not None and law.time is not None)):
        if n is not None:
            raise bad("n", n, "None for a flow without forcing")
        return flow_of(found), None
    times = 1 if n is None else whole("n", n, "a whole number >= 1")
    return as_problem(found), times


def flow_of(system: Any) -> Problem:
    """The equations of one flow without forcing."""
    found = as_system(system)
    law = found.own_equations
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


class Legs:
    """A map, or a forced flow seen once a period, in a window."""

    def __init__(self, problem: Problem, low: Array, high: Array, times: int) -> None:
        self.problem, self.low, self.high, self.times = problem, low, high, times
        law: Any = problem.law
        self.law = law
        self.values = {name: float(problem.parameters[name]) for name in law.names}
        self.turns = all_round(problem, low, high)
        self.widths = np.where(self.turns > 0.0, self.turns, high - low)
        self.period = 1.0
        if not problem.map:
            period = common_period(
                self.law, {name: np.array(value) for name, value in self.values.items()}
            )
            if period is None or not np.isfinite(period):
                wants = "a forced flow with a period, Problem(..., time=..., period=...)"
                raise bad("system", problem, wants)
            self.period = float(period)

    def leg(self, turned: Array | None = None, count: int = 1) -> Leg:
        """So many times the legs after which a point returns, some whole turns further back."""
        turned = np.zeros(len(self.turns)) if turned is None else turned
        count *= self.times
        if self.problem.map:
            return Iterates(self.law, self.values, count, self.widths, turned)
        return Motions(self.law, self.values, count * self.period, self.widths, turned)

    def rests(self) -> Equilibria:
        """Fixed points in the window."""
        problem, n = self.problem, len(self.low)
        if problem.map:
            return equilibria_of(problem.iterated(self.times), self.low, self.high)
        from scipy.stats import qmc

        starts = self.low + qmc.Sobol(n, seed=0).random(STARTS) * (self.high - self.low)
        x, slopes = fixed_points(self.leg(), starts, self.widths, self.turns)
        inside = np.all((x >= self.low) & (x <= self.high), axis=1)
        x, slopes = x[inside], [s for s, one in zip(slopes, inside, strict=True) if one]
        kinds = [kind_of(one, discrete=True, error=1e-9) for one in slopes]
        return Equilibria(
            x,
            np.array([one[0] for one in kinds]).reshape(-1, n),
            np.array([one[1] for one in kinds], np.int64),
            np.array([one[2] for one in kinds], np.int8),
            False,
            f"{STARTS} starts of Newton's method were tried, and nothing else",
        )

    def manifolds(self, rests: Equilibria, chosen: Sequence[int], length: float) -> Manifolds:
        """Manifolds of some fixed points."""
        starts, strands_ = list[Start](), list[Strand]()
        whole_ = np.where(self.turns > 0.0, self.turns, 1.0)
        room = np.where(self.turns > 0.0, np.inf, 0.02 * self.widths)
        box = self.low - room, self.high + room
        for k in chosen:
            x, leg = rests.x[k], self.leg()
            off = leg.ahead(x[None])[0] - x
            turned = np.where(self.turns > 0.0, self.turns * np.rint(off / whole_), 0.0)
            slopes = leg.slopes(x[None])[0] * self.widths / self.widths[:, None]
            for stable, direction, multiplier in _multipliers(slopes):
                twice = 2 if multiplier < 0.0 else 1
                growth = abs(multiplier) ** (-twice if stable else twice)
                for side in (1.0, -1.0):
                    way = side * direction
                    both = self.leg(twice * turned, twice)
                    half = Half(both, x, way, growth, stable, self.widths, box)
                    starts.append(Start(k, way, -1.0 if stable else 1.0))
                    strands_.append(strand_of(half, self.turns, rests.x, length))
        return Manifolds(starts, strands_, [Goal(one.reached, -1) for one in strands_])


def _multipliers(slopes: Array) -> list[tuple[bool, Array, float]]:
    """The one unstable and the one stable direction of a fixed point, and how points part there."""
    if len(slopes) < 2 or not np.isfinite(slopes).all():
        return []
    *_, kind = kind_of(slopes, discrete=True, error=1e-9)
    if kind != FlowEquilibriumKind.SADDLE:
        return []
    found, vectors = np.linalg.eig(slopes)
    directions = list[tuple[bool, Array, float]]()
    for stable, those in ((False, np.abs(found) > 1.0), (True, np.abs(found) < 1.0)):
        which = int(np.argmax(those))
        # What has no preimages has no stable manifold that they make.
        if those.sum() == 1 and abs(found[which]) > SINGULAR:
            way = np.real(vectors[:, which])
            directions.append((stable, way / np.linalg.norm(way), float(np.real(found[which]))))
    return directions


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
    if problem.time is not None and not problem.map:
        kept.x.attrs["long_name"] = "state on the periodic motion at t = 0"
        kept.eigenvalue.attrs["long_name"] = "multiplier of it, the least stable first"
        kept.n_unstable.attrs["long_name"] = "multipliers of a size above 1"
        for name in ("x", "eigenvalue", "n_unstable", "n_equilibria", "complete"):
            del kept[name].attrs["equation"]  # of equilibria
    return kept.assign(data).assign_attrs(dataset_attrs(problem))
