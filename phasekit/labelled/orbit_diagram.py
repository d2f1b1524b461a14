"""Orbit diagrams: what motions do in the end, value by value of a parameter."""

from __future__ import annotations

import warnings
from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt
import xarray as xr

from phasekit.arrays import Array
from phasekit.cells.formulas_along import asked_formulas, split_extreme
from phasekit.cells.schema import dataset_attrs, input_attrs
from phasekit.errors import warn
from phasekit.labelled.crossings import section_of
from phasekit.labelled.flows import start_state
from phasekit.labels.arguments import bad, call_checked, flag, list_names, numeric, unknown, whole
from phasekit.labels.grid import variable
from phasekit.laws.equations import Equations
from phasekit.laws.formulas import symbols_of
from phasekit.laws.ladder import Map
from phasekit.motion import flows
from phasekit.motion.crossings import NEVER, Crossing
from phasekit.motion.flow import ATOL, RTOL
from phasekit.motion.pace import pace_of, units_of
from phasekit.motion.samples import maxima, rate_along, samples
from phasekit.motion.strobe import common_period
from phasekit.numerics.waits import notice, stage
from phasekit.systems.problem import as_problem
from phasekit.systems.system import as_system

#: Part of the window by which a motion that rests is displaced before the next value.
NUDGE = 1e-7
SECTION, MAXIMA = "section", "maxima"


@call_checked
def orbit_diagram(
    system: Any,
    parameter: str,
    values: Any,
    x0: Any = None,
    *,
    of: Any = "section",
    n: int = 200,
    skip: int = 1000,
    from_last: bool = True,
) -> xr.Dataset:
    """What motions do after transients, for many values of a parameter.

    Parameters
    ----------
    system : Problem, Perturbed, or system that states rates or a step
        A map or a flow; one system.
    parameter : str
        The parameter that changes.
    values : 1-D array_like
        Its values, in the order in which they are taken: up, down, or both.
    x0 : mapping or sequence, optional
        State at the first value; by default the system's `start`, or next to the middle of the
        window, where symmetric laws have motions of their own.
    of : {"section", "maxima"} or a section
        What is kept: of a map each iterate, of a forced flow its state once a period
        (``"section"``); of a flow each maximum of each state along the motion (``"maxima"``), or
        the maxima (minima) of a formula, ``"max(x*y)"``, with the states there; or the states at
        which it crosses a section upwards, given as for `poincare_section`: ``"z = r - 1"``,
        ``("y", 0.0)``, ``"x + 2*y - 1"``.
    n : int, default 200
        States to keep at each value.
    skip : int, default 1000
        Iterations, periods, maxima or crossings before them.
    from_last : bool, default True
        Whether each value begins where the one before it ended, so that a branch is followed and
        hysteresis shows; else all begin at `x0`.

    Returns
    -------
    xarray.Dataset
        ``sample_`` and the name of each state on (parameter, ``sample``); before them
        ``sample_max(x*y)`` where maxima of a formula were asked for, whose units are unknown, "",
        where something in it has units. NaN where a motion left for infinity, or was not seen so
        often in its section, which a RuntimeWarning says; after infinity the next value begins at
        `x0` again. A motion that comes to rest has its state as maxima; a state that has an eighth
        of the maxima of another, or none, has NaN for the rest.

    Raises
    ------
    ParameterError
        If an argument is unusable, or the system does not fit what is to be kept.

    Notes
    -----
    The bifurcation diagram of [GuckenheimerHolmes1983] section 6.3 shows attractors; it does not
    find unstable orbits, which `continuation` follows. A motion rests where no state goes further
    than 1e-8 of its size in a quarter of the fastest turn; before the next value it is displaced
    by 1e-7, so that it leaves a rest which has lost its stability.

    Examples
    --------
    >>> import numpy as np
    >>> import phasekit as pk
    >>> logistic = pk.Problem("r*x*(1 - x)", "x", {"r": 3.0}, map=True, window={"x": (0, 1)})
    >>> ds = pk.orbit_diagram(logistic, "r", [2.8, 3.2, 3.5], n=64)
    >>> [len(np.unique(row.round(9))) for row in ds.sample_x.values]
    [1, 2, 4]
    >>> cycle = pk.Problem({"x": "m*x - y - x*(x^2 + y^2)", "y": "x + m*y - y*(x^2 + y^2)"},
    ...                    parameters={"m": 0.0}, window={"x": (-2, 2), "y": (-2, 2)})
    >>> ds = pk.orbit_diagram(cycle, "m", [0.25, 1.0], of="maxima", n=3, skip=40)
    >>> ds.sample_x[:, 0].values.round(6).tolist()
    [0.5, 1.0]
    """
    found = as_system(system)
    found = found if found.standing.traits is None else as_problem(found)
    law = found.own_equations
    if law is None:
        raise bad("system", found, "a map, or a flow with states of its own, or a Perturbed one")
    kept = _kept(law, of, getattr(found, "observables", {}))
    problem = as_problem(found)
    if not isinstance(parameter, str) or parameter not in law.names:
        raise unknown("parameter of the problem", parameter, law.names)
    array = np.atleast_1d(np.asarray(numeric("values", values, None)))
    if not np.isfinite(array).all():
        raise bad("values", values, "finite numbers")
    n = whole("n", n, "a number of states >= 1")
    skip = whole("skip", skip, "a number of states before them >= 0", 0)
    flag("from_last", from_last)
    start = start_state(law, x0)
    fixed = {name: float(problem.parameters[name]) for name in law.names}
    with notice(f"following {array.size:,} values of {parameter}"):
        followed = Followed(law, kept, fixed, parameter, n, skip)
        seen = _samples(followed, array, start, from_last=from_last)
    _tell(seen, array.size)
    columns = {name: seen.states[..., i] for i, name in enumerate(law.states)}
    units = {name: law.units.get(name, "1") for name in law.states}
    if kept.formula is not None:
        columns = {
            of: _values_of(kept.formula, law, {**fixed, parameter: array}, columns),
            **columns,
        }
        units[of] = law.units_along(kept.formula)
    data = {
        f"sample_{name}": variable(
            (parameter, "sample"), values,
            {"long_name": kept.words(name), "units": units[name]},
        )
        for name, values in columns.items()
    }  # fmt: skip
    coords = {
        parameter: variable((parameter,), array, input_attrs(found, parameter)),
        "sample": variable(
            ("sample",), np.arange(skip, skip + n), {"long_name": f"number of the {kept.each}"}
        ),
        **{
            name: variable((), value, input_attrs(found, name))
            for name, value in fixed.items()
            if name != parameter
        },
    }
    return xr.Dataset(data, coords, dataset_attrs(found))


class Kept(NamedTuple):
    """What is kept of motions."""

    each: str
    watched: tuple[Any, ...] = ()
    picks: tuple[int, ...] = ()
    equation: str = ""
    formula: Any = None
    """Whose maxima or minima they are, a sympy expression."""

    def words(self, name: str) -> str:
        """What the samples of a state are."""
        if self.formula is not None:
            kind, text = f"{self.each[:-2]}a", self.equation
            return f"{name} at {kind} of {text}" if name.isidentifier() else f"{kind} of {text}"
        if self.each == "maximum":
            return f"maxima of {name}"
        return f"{name} where {self.equation}" if self.equation else f"{name} after transients"


def _values_of(
    formula: Any, law: Equations, parameters: Mapping[str, Any], states: Mapping[str, Array]
) -> Array:
    """Values of a formula at states on (values, samples)."""
    import sympy as sp

    symbols = symbols_of([*law.states, *law.names])
    function = sp.lambdify(list(symbols.values()), formula, ["scipy", "numpy"])
    given = [np.reshape(parameters[name], (-1, 1)) for name in law.names]
    with np.errstate(all="ignore"):
        return np.asarray(function(*states.values(), *given) + 0.0 * states[law.states[0]])


def _extremes(law: Equations, of: str, observables: Mapping[str, Any]) -> Kept | None:
    """The maxima or minima of a formula along motions, where these are asked for."""
    part = split_extreme(of)
    if part is None:
        return None
    if part[0] not in ("max", "min") or of != "".join(part):
        raise bad("of", of, "max(...) or min(...) of a formula", "or 'maxima', or a section")
    (formula,) = asked_formulas(of, law, observables).values()
    symbols = symbols_of(law.states)
    if law.time is not None and symbols_of([law.time])[law.time] in formula.free_symbols:
        raise bad("of", of, f"a formula of the states, without {law.time}")
    if formula.free_symbols.isdisjoint(symbols.values()):
        raise bad("of", of, f"a formula of the states {list_names(law.states)}")
    each, sense = ("maximum", -1) if part[0] == "max" else ("minimum", 1)
    picks = (0,) * len(law.states)
    return Kept(
        each, (Crossing(rate_along(law, formula), sense),), picks, part[1][1:-1].strip(), formula
    )


def _kept(law: Equations, of: Any, observables: Mapping[str, Any]) -> Kept:
    """What is to be kept of motions."""
    plain = isinstance(of, str) and of in (SECTION, MAXIMA)
    if isinstance(law, Map):
        if not plain or of != SECTION:
            raise bad("of", of, "'section' for a map, of which each iterate is kept")
        return Kept("iteration")
    if plain and of == SECTION:
        if law.period is None:
            hint = "of a flow without forcing there are 'maxima', or a section such as 'x = 0'"
            raise bad("of", of, "another kind for a flow that is not forced", hint)
        return Kept("period")
    if plain:
        return Kept("maximum", tuple(maxima(law)), tuple(range(len(law.states))))
    if isinstance(of, str) and (kept := _extremes(law, of, observables)) is not None:
        return kept
    watched, equation = section_of(law, of, 1, 0)
    first = next(i for i, one in enumerate(watched) if one.sense != NEVER)
    return Kept("crossing", tuple(watched), (first,) * len(law.states), equation)


class Seen(NamedTuple):
    """What was seen at values."""

    states: Array
    """Of shape (values, samples, states)."""
    ends: Array
    """Last states."""
    resting: npt.NDArray[np.bool_]


class Followed(NamedTuple):
    """How motions are followed."""

    law: Equations
    kept: Kept
    fixed: dict[str, float]
    parameter: str
    n: int
    skip: int

    def seen(self, values: Array, x: Array) -> Seen:
        """What is seen at values, from a state of each."""
        law, n, skip, count = self.law, self.n, self.skip, len(values)
        own = {name: np.full(count, value) for name, value in self.fixed.items()}
        own[self.parameter] = values
        calm = np.zeros(count, bool)
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # how many are lost is said once
            if self.kept.watched:
                first = {name: value[0] for name, value in own.items()}
                widths = np.array([np.ptp(law.window.get(name, (0.0, 0.0))) for name in law.states])
                units = units_of(law, first, x, widths)
                period = common_period(law, first)
                leg = pace_of(law, first, x, units).leg if period is None else float(period)
                found = samples(
                    law, own, x, self.kept.watched, self.kept.picks, n=n, skip=skip, leg=leg,
                    units=units,
                )  # fmt: skip
                states = found.states
                if self.kept.each in ("maximum", "minimum"):
                    still = found.resting
                    states[still] = found.ends[still][:, None, :]
                return Seen(states, found.ends, found.resting)
            if isinstance(law, Map):
                times = np.broadcast_to(np.arange(skip, skip + n) * float(law.times), (count, n))
                states = flows.iterates(law, own, x, times)[0]
            else:
                given = [own[name] for name in law.names]
                parts = flows.sections(
                    law, *given, *x.T, n=n, skip=skip, period=None, rtol=RTOL, atol=ATOL
                )
                states = np.stack([parts[f"section_{name}"] for name in law.states], axis=-1)
        return Seen(states, states[:, -1], calm)


def _samples(followed: Followed, values: Array, start: Array, *, from_last: bool) -> Seen:
    if not from_last:
        return followed.seen(values, np.tile(start, (len(values), 1)))
    law, rows, x = followed.law, list[Seen](), start
    widths = np.array([np.ptp(law.window.get(name, (0.0, 0.0))) for name in law.states])
    for k in range(len(values)):
        one = followed.seen(values[k : k + 1], x[None])
        rows.append(one)
        x = one.ends[0] if np.isfinite(one.ends[0]).all() else start
        if one.resting[0]:
            x = x + NUDGE * np.where(widths > 0.0, widths, np.maximum(np.abs(x), 1.0))
        stage(f"{k + 1:,} of {len(values):,} values")
    return Seen(*(np.concatenate(parts) for parts in zip(*rows, strict=True)))


def _tell(seen: Seen, count: int) -> None:
    """Say how many motions are not seen to their end."""
    lost = ~np.isfinite(seen.ends).all(axis=1)
    rest = seen.resting & np.isnan(seen.states).any(axis=(1, 2))
    few = ~lost & ~rest & np.any(np.all(np.isnan(seen.states), axis=2), axis=1)
    for which, what in (
        (lost, "motions run to infinity"), (rest, "motions come to rest beside the section"),
        (few, "motions were not seen so often"),
    ):  # fmt: skip
        if which.any():
            warn(
                f"orbit_diagram: at {which.sum()} of {count} values {what}", RuntimeWarning,
            )  # fmt: skip
