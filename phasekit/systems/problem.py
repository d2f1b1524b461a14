"""`Problem`: any smooth system x' = f(x, parameters) that equilibria can be continued of."""

from __future__ import annotations

import functools
import json
import math
import re
from collections.abc import Mapping, Sequence
from types import MappingProxyType
from typing import Any, ClassVar, NoReturn, Self

import numpy as np
import numpy.typing as npt

from phasekit.arrays import Array
from phasekit.bifurcation.continuation.code_fields import CompiledField, PythonField
from phasekit.bifurcation.continuation.fields import Field, SymbolicField
from phasekit.bifurcation.continuation.iterated_field import MOST, IteratedField
from phasekit.labels.arguments import (
    Value,
    bad,
    call_checked,
    flag,
    list_names,
    reals,
    same,
    unknown,
    whole,
)
from phasekit.labels.equality import equal
from phasekit.laws.equations import Rates, Step
from phasekit.laws.formulas import symbols_of
from phasekit.laws.kept_formulas import read
from phasekit.laws.ladder import Conservative, Flow, Law, Map, Routhian
from phasekit.systems.as_equations import formulas_of, moving_formulas, words_of
from phasekit.systems.blocks import Block, blocks_of, coordinates_of, states_of
from phasekit.systems.grid import axes_of
from phasekit.systems.grid_rates import GridSlopes, rates_on_grid
from phasekit.systems.problem_parts import (
    DEFINITION,
    OfInstance,
    angles_of,
    arrays_of,
    by_name,
    clock_of,
    declared_of,
    is_blocks,
    jet_of,
    make_field,
    names_of,
    noise_of,
    observables_of,
    problem_of_dataset,
    refuse_arrays,
    refuse_of_fields,
    refuse_of_maps,
    start_of,
    window_of,
    words_checked,
    written,
)
from phasekit.systems.problem_sources import ProblemSources
from phasekit.systems.statement import StatedRates
from phasekit.systems.system import MODELS, System, way_to_problem
from phasekit.systems.waves import least_period


class Problem(ProblemSources, System):
    """A smooth system ``x' = f(x, **parameters)`` with states and parameters by name.

    Parameters
    ----------
    f : callable, str, sympy.Expr, or sequence or mapping of formulas
        The right-hand side. A callable is called as ``f(x, **parameters)`` with a 1-D array x and
        returns as many numbers (a single number for one state). Where it is not defined it may
        return NaN or raise an exception, which the end of a branch names. A function compiled by
        ``numba.njit`` is stepped in compiled code. Formulas (strings in Python's syntax, or sympy
        expressions), one a state or by its name, are turned into machine code, with exact
        derivatives.
    state : str, sequence of str, int, or sequence of (str, int), optional
        Names of the states; of one state the name alone. Formulas by name need none. Of many
        states of a function their number, or names of fields with the number of states of each,
        which come one after the other: ``[("u", 5000), ("v", 5000)]``. Branches are then arrays
        over the places of the states, and derivatives are sparse matrices.
    parameters : mapping of str to float, 1-D array_like or xarray.DataArray, optional
        The parameters and their values. Arrays span the cells of maps and motions, as in other
        systems; what follows one system, as `continuation` does, takes numbers.
    jac : callable, sparse matrix or LinearOperator, optional
        ``jac(x, **parameters)``, the matrix of derivatives of f by x, for a Python function.
        Without it derivatives are central differences. Of fields of states it returns a sparse
        matrix, or is one: of numbers if f is linear in x, or of booleans that say which entries
        are not zero, so that few differences take them all. A LinearOperator serves up to 2,000
        states.
    periods : mapping of str to float, optional
        States that are angles, with their periods: points that differ by a period are the same.
    time : str, optional
        Of a forced system, the name of time: a symbol in formulas, an argument like a parameter of
        a function.
    period : str, sympy.Expr or float, optional
        A period of f in time, a number or a formula of the parameters; ``period`` is the least one
        as far as circular functions in formulas show it. With `time` alone f repeats itself never;
        motions can be followed then, and periodic orbits cannot.
    conservative : bool, default False
        Whether the system conserves energy: x'' = -V'(x) as (x, x'), or, with one state, f is the
        force -V'(x). Equilibria are then centers and saddles, not stable or unstable.
    map : bool, default False
        Whether f is a map ``x -> f(x, **parameters)``, whose fixed points are continued.
    window : mapping of str to (float, float), optional
        Ranges of the states: where equilibria are looked for and what pictures show, unless
        something else is said. Errors of motions are measured by their widths.
    definitions : mapping of str to str or sympy.Expr, optional
        Names for formulas, to be used in formulas and in later definitions.
    functions : mapping of str to str or sympy.Expr, optional
        Functions by their form, ``{"s(x)": "1/(1 + exp(-x))"}``.
    start : mapping of str to float, optional
        States at t = 0 by name: where motions begin, and branches look for an equilibrium first,
        unless something else is said.
    observables : mapping of str to str or sympy.Expr, optional
        Formulas of the states, the parameters and the time by name, of which motions give the
        values beside those of the states.
    noise : mapping of str to float, str or sympy.Expr, optional
        White noise of states: its amplitude s, a number or a formula of the parameters, in
        ``dx = f dt + s dW``. `flow` with ``paths=`` and `first_passage` follow it; all else is
        answered without noise.
    grid : axis or sequence of axes, optional
        What `pk.grid` made: f then maps fields to formulas that may hold the coordinates and the
        derivatives ``lap(u)``, ``dx(u)`` and ``dxx(u)`` along an axis x, of fields, of formulas and
        of derivatives. Beyond an end where fields have a value inner second derivatives are 0.
    coords : mapping of str to 1-D array_like or xarray.DataArray, optional
        Coordinates of the places of fields of states, by dim: a field lies on the dim with as many
        values as it has states, or on all dims if it has as many as their product.

    Raises
    ------
    ParameterError
        If an argument is unusable.

    Notes
    -----
    ``x' = f(x, p)``, or ``x' = f(x, t, p)`` with f of a period in t ([Kuznetsov2004] chapter 1). f
    has to be smooth along what is followed. Formulas hold numbers, names, ``+ - * /``, powers and
    elementary functions; they are read by a parser of phasekit's own and never run.

    Examples
    --------
    >>> import phasekit as pk
    >>> from phasekit.systems.problem import Problem
    >>> cusp = Problem("mu + l*x - x**3", state="x", parameters={"mu": -1.0, "l": 1.0})
    >>> cusp
    Problem(x' = l*x + mu - x**3; mu=-1.0, l=1.0)
    >>> float(cusp([2.0])[0])
    -7.0
    >>> value, slope = cusp.replace(l=2.0).derivatives([2.0])
    >>> value.item(), slope.item()
    (-5.0, -10.0)
    >>> Problem.from_specification(cusp.specification())
    Problem(x' = l*x + mu - x**3; mu=-1.0, l=1.0)
    >>> duffing = Problem(
    ...     ["v", "F*cos(w*t) - d*v - x - x**3"], ("x", "v"), {"d": 0.04, "F": 0.015, "w": 1.0},
    ...     time="t", period="2*pi/w",
    ... )
    >>> duffing([0.0, 0.0], t=0.0).tolist(), round(duffing.replace(w=2.0).forcing_period, 9)
    ([0.0, 0.015], 3.141592654)
    >>> Problem.from_system(pk.Pendulum(length=0.5))
    Problem(phi' = -V'(phi) of Pendulum(length=0.5, g=9.80665))
    """

    __slots__ = (
        "_f", "_own", "_values", "blocks", "conservative", "coords", "field", "jac", "map", "noise",
        "observables", "period", "periods", "start", "state", "system", "time", "times", "window",
        "words",
    )  # fmt: skip

    #: Whether there are conditions at both ends of a stretch of time.
    bounded: ClassVar[bool] = False
    _guides: ClassVar[tuple[str, ...]] = ("problem", "system")
    rung: ClassVar[Any] = OfInstance(lambda problem: Map if problem.map else Flow, Flow)
    declared: ClassVar[Any] = OfInstance(declared_of, ())

    _f: Any  # f, or formulas that are not read yet
    jac: Any
    state: tuple[str, ...]
    blocks: tuple[Block, ...]  # fields of states; none where states have names
    coords: Mapping[str, Any]  # coordinates of their places
    window: Mapping[str, tuple[float, float]]
    start: Mapping[str, float]
    observables: Mapping[str, Any]
    noise: Mapping[str, Any]
    periods: Mapping[str, float]
    time: str | None
    period: Any
    conservative: bool
    map: bool
    times: int  # that a map is applied: f is one step
    system: System | None
    words: Mapping[str, Mapping[str, str]]  # long_name and units, of what a system made
    _values: dict[str, Value]
    field: Field  # what the stepping code takes
    _own: Field  # f itself, where that of a map is f(x) - x

    @functools.partial(call_checked, name="Problem")
    def __init__(
        self,
        f: Any,
        state: str | Sequence[str] | int | Sequence[tuple[str, int]] | None = None,
        parameters: Mapping[str, Any] | None = None,
        jac: Any = None,
        *,
        periods: Mapping[str, float] | None = None,
        time: str | None = None,
        period: Any = None,
        conservative: bool = False,
        map: bool = False,  # noqa: A002 - the field's word
        window: Mapping[str, tuple[float, float]] | None = None,
        definitions: Mapping[str, Any] | None = None,
        functions: Mapping[str, Any] | None = None,
        start: Mapping[str, float] | None = None,
        observables: Mapping[str, Any] | None = None,
        noise: Mapping[str, Any] | None = None,
        grid: Any = None,
        coords: Mapping[str, Any] | None = None,
    ) -> None:
        f = by_name(f) if isinstance(f, Mapping) else f
        state, parameters, periods, time = (
            by_name(one) for one in (state, parameters, periods, time)
        )
        window, start, noise = (by_name(one) for one in (window, start, noise))
        definitions, observables = (by_name(one) for one in (definitions, observables))
        if grid is not None:
            axes = axes_of(grid)
            for argument, value in (("state", state), ("jac", jac)):
                if value is not None:
                    raise bad(argument, value, "None with a grid, on which formulas name fields")
            names = tuple({} if parameters is None else parameters)
            f = rates_on_grid(f, axes, names, definitions, functions)
            state, jac = f.state, GridSlopes(f)
            coords = f.coordinates
            definitions = functions = None
        places = {} if coords is None else coordinates_of(coords)
        blocks = blocks_of(state, places) if is_blocks(state) else ()
        if places and not blocks:
            raise bad("coords", list(places), "None beside states that have names")
        if blocks:
            refuse_of_fields(conservative=conservative, map=map, time=time, noise=noise)
            state = states_of(blocks)
        if state is None:
            if not isinstance(f, Mapping):
                wants = "the names of the states, beside an f that has no names"
                raise bad("state", None, wants, "equations as pk.Problem({'x': 'm - x^2'}, ...) do")
            if not f:
                raise bad("f", "{}", "equations", "as in pk.Problem({'x': 'm - x^2'}, ...)")
            state = tuple(f)
        if isinstance(state, Mapping):
            raise bad("state", state, "names", "values of parameters are given as parameters={...}")
        states = names_of("state", (state,) if isinstance(state, str) else state)
        named = (*states, *(block.name for block in blocks), *places)
        values = arrays_of("parameters", {} if parameters is None else parameters)
        for name in values:
            if name in named:
                raise bad("parameters", list(values), f"names that are no states; {name!r} is one")
        angles = angles_of(periods, states)
        flag("conservative", conservative)
        flag("map", map)
        if map:
            refuse_of_maps(
                conservative=conservative or None, time=time, period=period, noise=noise or None
            )
        if jac is not None and not callable(jac) and not blocks:
            raise bad("jac", jac, "a function jac(x, **parameters), or None")
        if conservative and len(states) > 1 and len(states) % 2:
            raise bad("conservative", True, "one state (the force) or pairs of states")
        # The first of arrays stands for all.
        first = {name: float(np.ravel(value)[0]) for name, value in values.items()}
        clock = clock_of(time, period, states, first)
        if time is not None and conservative:
            raise bad("conservative", True, "False with time: a forced system has no energy")
        mappings: dict[str, Any] = {
            "coords": places, "periods": angles, "words": {},
            "window": window_of("window", window, states), "start": start_of(start, states),
        }  # fmt: skip
        names = (*values, *([] if time is None else [time]))
        own, kept = make_field(
            f, jac, states, names, definitions=definitions, functions=functions,
            sparse=bool(blocks), later=not map,
        )  # fmt: skip
        field = make_field(kept, jac, states, names, discrete=True)[0] if map else own
        if clock is not None:
            clock = least_period(clock, read(kept), time)
        mappings["observables"] = observables_of(observables, states, names, definitions, functions)
        mappings["noise"] = noise_of(noise, states, values)
        for name, value in {
            "_f": kept, "jac": jac, "state": states, "blocks": blocks, "_values": values,
            "time": time, "period": clock, "times": 1, "map": bool(map),
            "conservative": bool(conservative), "system": None, "field": field, "_own": own,
            **{name: MappingProxyType(one) for name, one in mappings.items()},
        }.items():  # fmt: skip
            object.__setattr__(self, name, value)

    #: What messages say where a Problem cannot be taken.
    answered_by: ClassVar[str] = (
        "pk.continuation, pk.diagram, pk.equilibria, pk.flow, pk.sweep, pk.basins, pk.lyapunov, "
        "pk.periodic_orbit, pk.plot.phase_portrait and others take a Problem"
    )

    def _set(self, name: str, value: Any) -> None:
        object.__setattr__(self, name, value)

    @property
    def f(self) -> Any:
        """The right-hand side: a tuple of expressions, or a function."""
        return read(self._f)

    @property
    def parameters(self) -> dict[str, Any]:
        """The parameters by name."""
        return dict(self._values)

    @property
    def law(self) -> Law:
        """The equations."""
        kind = Step if self.map else Rates
        named = {name: self.unit_of(name) for name in (*self.state, *self._values, "time")}
        units = {name: unit for name, unit in named.items() if unit is not None}
        field: Any = self.field
        slopes = field.matrix if self.blocks and self.jac is not None else None
        return kind(
            self.state, tuple(self._values), self.f, self.periods, self.time, self.window,
            units, self.times, self.period, self.start, self.noise, slopes,
        )  # fmt: skip

    def formula_inputs(self) -> tuple[str, ...]:  # type: ignore[override]
        """Names of the parameters: all of them."""
        return tuple(self._values)

    @classmethod
    def in_domain(cls, name: str, value: Array) -> Array:
        """Values of a parameter: none is refused."""
        return value

    def unit_of(self, name: str) -> str | None:
        """Unit of a state, a parameter or the time, where it is known.

        That of the time is s where units of states or parameters have seconds, and it has no name.
        """
        named = self.words.get((self.time or name) if name == "time" else name, {}).get("units")
        if name != "time" or named is not None:
            return None if named is None else str(named)
        units = (one.get("units", "") for one in self.words.values())
        return "s" if any(re.search(r"\bs(-?\d+)?\b", unit) for unit in units) else None

    @property
    def definition(self) -> dict[str, str]:
        """What maps store beside the parameters' values."""
        return {DEFINITION: json.dumps(self.specification(values=False))}

    @classmethod
    def from_dataset(cls, ds: Any) -> Self:
        """Rebuild the problem from a map, or from any selection of it.

        Raises
        ------
        ParameterError
            If the map was made with another model, a parameter's coordinate is gone, or f was a
            function, of which a map holds no formulas.
        """
        made: Self = problem_of_dataset(cls, ds)
        return made

    def __str__(self) -> str:
        """Write the equations and parameters."""
        return repr(self)

    def __setattr__(self, name: str, value: Any) -> NoReturn:
        """Refuse: a problem is frozen."""
        raise AttributeError(f"a Problem is frozen; use .replace({name}=...) for a parameter")

    def __reduce__(self) -> tuple[Any, ...]:
        """Copies and pickles are made from the arguments; f must allow it, as a lambda does not."""
        state = [(block.name, block.size) for block in self.blocks] or self.state
        arguments = (self.f, state, dict(self.parameters), self.jac, dict(self.periods))
        more = {name: getattr(self, name) for name in ("conservative", "time", "period", "map")}
        more |= {
            name: dict(getattr(self, name)) for name in ("window", "start", "observables", "noise")
        }
        more["times"] = self.times
        more["coords"] = dict(self.coords) or None
        words = {name: dict(one) for name, one in self.words.items()}
        return _restored, (type(self), *arguments, more, self.system, words)

    @property
    def kind(self) -> str:
        """How f was given: "symbolic", "compiled" or "python"."""
        if isinstance(self.own_field, SymbolicField):
            return "symbolic"
        return "compiled" if isinstance(self.own_field, CompiledField) else "python"

    @property
    def own_field(self) -> Any:
        """The field of f itself: of an iterated map that of one step."""
        return getattr(self._own, "base", self._own)

    def replace(self, **changes: Any) -> Self:
        """Return a copy with some parameters changed, given by name."""
        values = dict(self.parameters)
        for name, value in changes.items():
            if name not in values:
                raise unknown("parameter of the problem", name, values)
            plain = type(value) is float and math.isfinite(value)
            values[name] = value if plain else arrays_of("parameters", {name: value})[name]
        copy = object.__new__(type(self))
        for slot in (
            slot for kind in type(self).__mro__ for slot in getattr(kind, "__slots__", ())
        ):
            copy._set(slot, getattr(self, slot))
        copy._set("_values", values)
        if self.system is not None:
            copy._set("system", self.system.replace(**changes))
        return copy

    def described(self, words: Mapping[str, Mapping[str, str]]) -> Self:
        """Return a copy with long names and units of states and parameters, for branches and plots.

        Parameters
        ----------
        words : mapping of str to mapping
            For a state, a parameter or the time its ``long_name`` and ``units``; others have none.

        Returns
        -------
        Problem

        Raises
        ------
        ParameterError
            If a name is neither a state nor a parameter, or its words are no strings.

        Examples
        --------
        >>> fall = Problem("g", "v", {"g": 9.81})
        >>> fall.described({"v": {"long_name": "speed", "units": "m s-1"}}).words["v"]["units"]
        'm s-1'
        """
        copy = self.replace()
        blocks = (block.name for block in self.blocks)
        names = (*self.state, *blocks, *self.parameters, self.time or "time")
        copy._set("words", words_checked(words, names))
        return copy

    @functools.partial(call_checked, name="problem")
    def __call__(self, x: npt.ArrayLike, **changes: float) -> Array:
        """Value of f at a state (and, of a forced system, a time), with some parameters changed."""
        at = changes.pop(self.time, 0.0) if self.time is not None else 0.0
        problem = self.replace(**changes) if changes else self
        if not isinstance(problem._own, PythonField):
            return problem.derivatives(x, at)[0]
        x, par = problem._point(x, at)  # its derivatives would take as many calls of it again
        with np.errstate(all="ignore"):
            return np.asarray(problem._own.values(x[None], par, ())[0])

    @functools.partial(call_checked, name="iterated")
    def iterated(self, n: int) -> Problem:
        """The n-th iterate of the map: its fixed points are the periodic orbits of period n.

        Parameters
        ----------
        n : int
            How often, >= 1.

        Returns
        -------
        Problem

        Raises
        ------
        ParameterError
            If this is no map, or the number is none.

        Examples
        --------
        >>> logistic = Problem("r*x*(1 - x)", "x", {"r": 3.2}, map=True)
        >>> logistic.iterated(2)([0.5]).round(6).tolist()
        [0.512]
        """
        n = whole("n", n, "a whole number >= 1")
        if not self.map:
            raise bad("problem", self, "a map, to be applied several times")
        total = n * self.times
        if total > MOST:
            raise bad("n", n, f"a whole number from 1 to {MOST // self.times}")
        copy = self.replace()
        if total > 1:
            copy._set("times", total)
            copy._set("_own", IteratedField(self.own_field, total))
            copy._set("field", IteratedField(self.own_field, total, less=True))
        return copy

    @property
    def forcing_period(self) -> float:
        """The period of f in time; infinite if f does not depend on it."""
        if self.period is None:
            return np.inf
        refuse_arrays(self)
        symbols = symbols_of(self.parameters)
        return float(self.period.subs({symbols[k]: v for k, v in self.parameters.items()}))

    @functools.partial(call_checked, name="derivatives")
    def derivatives(self, x: npt.ArrayLike, t: float = 0.0) -> tuple[Array, Array]:
        """Value of f and its Jacobian matrix, at a time if f depends on it.

        Parameters
        ----------
        x : array_like, shape (n,)
            The state.
        t : float, default 0.0
            Of a forced system.

        Returns
        -------
        value : ndarray, shape (n,)
            f.
        derivatives : ndarray, shape (n, n)
            ``df_i/dx_j``.

        Raises
        ------
        ParameterError
            If x is not a number for each state.
        """
        x, par = self._point(x, t)
        return jet_of(self._own, par, x)

    def _point(self, x: npt.ArrayLike, t: float) -> tuple[Array, Array]:
        """A state that is given, and the parameters of the field at a time."""
        n = len(self.state)
        wants = f"{n} numbers: {list_names(self.state)}"
        x = np.atleast_1d(reals("x", x, wants))
        if x.shape != (n,):
            raise bad("x", x, wants)
        refuse_arrays(self)
        return x, np.array([*self.parameters.values(), *([] if self.time is None else [t])])

    def __eq__(self, other: object) -> bool:
        """Whether it has the same equations and values; functions are equal to themselves."""
        if type(self) is not type(other):
            return NotImplemented
        slots = ("f", *(n for n in Problem.__slots__ if n[0] != "_" and n != "field"))
        if not all(equal(getattr(self, name), getattr(other, name)) for name in slots):
            return False
        mine, other_ = self._values, getattr(other, "_values", {})
        return list(mine) == list(other_) and all(same(mine[n], other_[n]) for n in mine)

    def __hash__(self) -> int:
        """Hash of states, parameters and their values."""
        values = ((n, v if isinstance(v, float) else str(v)) for n, v in self._values.items())
        return hash((self.state, frozenset(values)))

    @property
    def _in_errors(self) -> str:
        """What it is, for errors that want another kind."""
        n = len(self.state)
        more = " that depends on time" if self.time is not None else ""
        more += " by a function" if callable(self.f) else ""
        return f"a {'map' if self.map else 'flow'} of {n} state{'s' * (n != 1)}{more}"

    def __repr__(self) -> str:
        """Write the equations, if they are formulas, and the parameters."""
        return f"Problem({written(self)})"


MODELS["Problem"] = Problem


def _restored(
    kind: type[Problem], f: Any, state: Any, parameters: Any, jac: Any, periods: Any,
    more: Any, system: Any, words: Mapping[str, Mapping[str, str]] = MappingProxyType({}),
) -> Problem:  # fmt: skip
    """The problem of its arguments, for copies and pickles."""
    more = dict(more) if isinstance(more, dict) else {"conservative": more}
    times = more.pop("times", 1)
    problem = kind(f, state, parameters, jac, periods=periods, **more)
    problem._set("system", system)
    problem = problem.iterated(times) if times > 1 else problem
    return problem.described(words)


def system_of(given: Any, problem: Problem) -> System | None:
    """The system that was given or that made a problem, where its equilibria can be computed."""
    if not isinstance(given, System) or isinstance(given, Problem):
        return problem.system
    return problem.system if isinstance(given.stated, StatedRates) else given


def as_problem(problem: Any, *, moving: bool = False, arrays: bool = False) -> Problem:
    """Return the problem that an argument is: a Problem, or a system.

    Of a `Perturbed` system the states are the angle and its rate; forced, it depends on time. So
    they are of a `FreeGyroRotor`, at its momentum, and of a ``moving`` system in a potential.
    Parameters are numbers, or of equations also ``arrays``.
    """
    if isinstance(problem, Problem):
        return problem if arrays else refuse_arrays(problem)
    terms = isinstance(problem, System) and problem.standing.traits is not None
    in_time = (Conservative, Routhian) if moving else Routhian
    if terms or (isinstance(problem, System) and issubclass(problem.rung, in_time)):
        found = formulas_of(problem, arrays=arrays) if terms else moving_formulas(problem)
        f, states, values, keywords = found
        law: Any = problem.law
        period = law.base.period if terms else law.period
        made = Problem(f, states, values, **keywords)
        return made.described(words_of(problem, states, values, period))
    if isinstance(problem, System):
        return Problem.from_system(problem, arrays=arrays)
    convert = getattr(problem, "as_problem", None)
    if callable(convert):
        made = convert()
        if isinstance(made, Problem):
            return made
    hint = way_to_problem(problem)
    raise bad("problem", problem, f"a Problem or a system ({', '.join(MODELS)})", hint)
