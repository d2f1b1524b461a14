"""`Problem`: any smooth system x' = f(x, parameters) that equilibria can be continued of."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from types import MappingProxyType
from typing import Any, Self

import numpy as np
import numpy.typing as npt

from phasekit.bifurcation.continuation.code_fields import CompiledField
from phasekit.bifurcation.continuation.fields import Field, SymbolicField
from phasekit.labels.arguments import bad, flag, reals, unknown, whole
from phasekit.labels.equality import equal
from phasekit.laws.formulas import symbols_of
from phasekit.laws.ladder import Routhian
from phasekit.laws.perturbed import PerturbedConservative
from phasekit.systems.maps import iterated
from phasekit.systems.moving_problem import moving_formulas, moving_words
from phasekit.systems.perturbed_problem import formulas_of, words_of
from phasekit.systems.problem_parts import (
    angles_of,
    clock_of,
    jet_of,
    make_field,
    names_of,
    refuse_of_maps,
    values_of,
    words_checked,
    written,
)
from phasekit.systems.problem_sources import ProblemSources
from phasekit.systems.system import MODELS, Model

FloatArray = npt.NDArray[np.float64]


class Problem(ProblemSources):
    """A smooth system ``x' = f(x, **parameters)`` with states and parameters by name.

    Parameters
    ----------
    f : callable, str, sympy.Expr, or sequence or mapping of formulas
        The right-hand side. A callable is called as ``f(x, **parameters)`` with a 1-D array x and
        returns as many numbers (a single number for one state); it may raise an ArithmeticError
        or ValueError, or return NaN, where it is not defined. A function compiled by
        ``numba.njit`` is stepped in compiled code. Formulas (strings in Python's syntax, or sympy
        expressions), one a state or by its name, are turned into machine code, with exact
        derivatives.
    state : str or sequence of str
        Names of the states; of one state the name alone.
    parameters : mapping of str to float
        The parameters and their values.
    jac : callable, optional
        ``jac(x, **parameters)``, the matrix of derivatives of f by x, for a Python function.
        Without it derivatives are central differences.
    periods : mapping of str to float, optional
        States that are angles, with their periods: points that differ by a period are the same.
    time : str, optional
        Of a forced system, the name of time: a symbol in formulas, an argument like a parameter of
        a function.
    period : str, sympy.Expr or float, optional
        The period of f in time, a number or a formula of the parameters; it comes with `time`.
    conservative : bool, default False
        Whether the system conserves energy: x'' = -V'(x) as (x, x'), or, with one state, f is the
        force -V'(x). Equilibria are then centers and saddles, not stable or unstable.
    map : bool, default False
        Whether f is a map ``x -> f(x, **parameters)``, whose fixed points are continued.

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
        "_field", "_own", "conservative", "f", "jac", "map", "parameters", "period", "periods",
        "state", "system", "time", "words",
    )  # fmt: skip

    f: Any
    jac: Callable[..., Any] | None
    state: tuple[str, ...]
    parameters: Mapping[str, float]
    periods: Mapping[str, float]
    time: str | None
    period: Any
    conservative: bool
    map: bool
    system: Model | None
    words: Mapping[str, Mapping[str, str]]  # long_name and units, of what a system made
    _field: Field
    _own: Field  # f itself, where that of a map is f(x) - x

    def __init__(
        self,
        f: Any,
        state: str | Sequence[str],
        parameters: Mapping[str, float],
        jac: Callable[..., Any] | None = None,
        *,
        periods: Mapping[str, float] | None = None,
        time: str | None = None,
        period: Any = None,
        conservative: bool = False,
        map: bool = False,  # noqa: A002 - the field's word
    ) -> None:
        states = names_of("state", (state,) if isinstance(state, str) else state)
        values = values_of("parameters", parameters)
        for name in values:
            if name in states:
                raise bad("parameters", list(values), f"names that are no states; {name!r} is one")
        angles = angles_of(periods, states)
        flag("conservative", conservative)
        flag("map", map)
        refuse_of_maps(map, conservative=conservative or None, time=time, period=period)
        if jac is not None and not callable(jac):
            raise bad("jac", jac, "a function jac(x, **parameters), or None")
        if conservative and len(states) > 1 and len(states) % 2:
            raise bad("conservative", True, "one state (the force) or pairs of states")
        clock = clock_of(time, period, states, values)
        if clock is not None and conservative:
            raise bad("conservative", True, "False with time: a forced system has no energy")
        self._set("time", time)
        self._set("period", clock)
        self._set("state", states)
        self._set("parameters", MappingProxyType(values))
        self._set("periods", MappingProxyType(angles))
        self._set("conservative", bool(conservative))
        self._set("map", bool(map))
        self._set("jac", jac)
        self._set("system", None)
        self._set("words", MappingProxyType({}))
        names = (*values, *self._times())
        own, kept = make_field(f, jac, states, names)
        field = make_field(kept, jac, states, names, discrete=True)[0] if map else own
        self._set("f", kept)
        self._set("_field", field)
        self._set("_own", own)

    def _times(self) -> tuple[str, ...]:
        """The name of time, if f depends on it."""
        return () if self.time is None else (self.time,)

    def _set(self, name: str, value: Any) -> None:
        object.__setattr__(self, name, value)

    def __setattr__(self, name: str, value: Any) -> None:
        """Refuse: a problem is frozen."""
        raise AttributeError(f"a Problem is frozen; use .replace({name}=...) for a parameter")

    def __reduce__(self) -> tuple[Any, ...]:
        """Copies and pickles are made from the arguments; f must allow it, as a lambda does not."""
        arguments = (self.f, self.state, dict(self.parameters), self.jac, dict(self.periods))
        more = {name: getattr(self, name) for name in ("conservative", "time", "period", "map")}
        words = {name: dict(one) for name, one in self.words.items()}
        return _made, (type(self), *arguments, more, self.system, words)

    @property
    def field(self) -> Field:
        """What the stepping code takes."""
        return self._field

    @property
    def kind(self) -> str:
        """How f was given: "symbolic", "compiled" or "python"."""
        if isinstance(self._field, SymbolicField):
            return "symbolic"
        return "compiled" if isinstance(self._field, CompiledField) else "python"

    def replace(self, **changes: float) -> Self:
        """Return a copy with some parameters changed, given by name.

        Parameters
        ----------
        **changes : float
            New values, by the parameters' names.

        Returns
        -------
        Problem
            This one stays as it is.

        Raises
        ------
        ParameterError
            If a name is not one of the parameters, or a value is no number.
        """
        values = dict(self.parameters)
        for name, value in changes.items():
            if name not in values:
                raise unknown("parameter of the problem", name, values)
            values[name] = values_of("parameters", {name: value})[name]
        copy = object.__new__(type(self))
        for slot in self.__slots__:
            copy._set(slot, getattr(self, slot))
        copy._set("parameters", MappingProxyType(values))
        if self.system is not None:
            copy._set("system", self.system.replace(**changes))
        return copy

    def described(self, words: Mapping[str, Mapping[str, str]]) -> Self:
        """Return a copy whose states and parameters have words, which branches and axes show.

        Parameters
        ----------
        words : mapping of str to mapping
            For a state or parameter its ``long_name`` and ``units``; others have none.

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
        copy._set("words", words_checked(words, (*self.state, *self.parameters)))
        return copy

    def __call__(self, x: npt.ArrayLike, **changes: float) -> FloatArray:
        """Value of f at a state (and, of a forced system, a time), with some parameters changed."""
        at = changes.pop(self.time, 0.0) if self.time is not None else 0.0
        problem = self.replace(**changes) if changes else self
        return problem.derivatives(x, at)[0]

    def iterated(self, times: int) -> Problem:
        """The map applied so many times, whose fixed points are orbits of that period of this map.

        Parameters
        ----------
        times : int
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
        times = whole("times", times, "a whole number >= 1")
        if not self.map:
            raise bad("problem", self, "a map, to be applied several times")
        symbols = symbols_of(self.state) if self.kind == "symbolic" else None
        f, jac = iterated(self.f, self.jac, symbols, times)
        return Problem(f, self.state, self.parameters, jac, periods=self.periods, map=True)

    @property
    def forcing_period(self) -> float:
        """The period of f in time; infinite if f does not depend on it."""
        if self.period is None:
            return np.inf
        symbols = symbols_of(self.parameters)
        return float(self.period.subs({symbols[k]: v for k, v in self.parameters.items()}))

    def derivatives(self, x: npt.ArrayLike, time: float = 0.0) -> tuple[FloatArray, FloatArray]:
        """Value of f and its matrix of derivatives by the states, at a time if f depends on it.

        Parameters
        ----------
        x : array_like, shape (n,)
            The state.
        time : float, default 0.0
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
        n = len(self.state)
        wants = f"{n} numbers: {', '.join(self.state)}"
        x = np.atleast_1d(reals("x", x, wants))
        if x.shape != (n,):
            raise bad("x", x, wants)
        par = np.array([*self.parameters.values(), *(time for _ in self._times())])
        return jet_of(self._own, par, x)

    def __eq__(self, other: object) -> bool:
        """Whether it has the same equations and values; functions are equal to themselves."""
        if type(self) is not type(other):
            return NotImplemented
        slots = (name for name in Problem.__slots__ if not name.startswith("_"))
        return all(equal(getattr(self, name), getattr(other, name)) for name in slots)

    def __hash__(self) -> int:
        """Hash of states, parameters and their values."""
        return hash((self.state, frozenset(self.parameters.items())))

    def __repr__(self) -> str:
        """Write the equations, if they are formulas, and the parameters."""
        return f"Problem({written(self)})"


def _made(
    kind: type[Problem], f: Any, state: Any, parameters: Any, jac: Any, periods: Any,
    more: Any, system: Any, words: Mapping[str, Mapping[str, str]] = MappingProxyType({}),
) -> Problem:  # fmt: skip
    """The problem of its arguments, for copies and pickles."""
    more = more if isinstance(more, dict) else {"conservative": more}
    problem = kind(f, state, parameters, jac, periods=periods, **more)
    problem._set("system", system)
    return problem.described(words)


def as_problem(problem: Any, *, moving: bool = False) -> Problem:
    """Return the problem that an argument is: a Problem, or a system.

    Of a `Perturbed` system the states are the angle and its rate; forced, it depends on time. So
    they are of a `FreeGyroRotor`, at its momentum, and of a ``moving`` system in a potential.

    Raises
    ------
    ParameterError
        If it is neither.
    """
    if isinstance(problem, Problem):
        return problem
    if isinstance(problem, Model) and issubclass(problem.rung, PerturbedConservative):
        f, states, values, keywords = formulas_of(problem)
        return Problem(f, states, values, **keywords).described(words_of(problem, states, values))
    if isinstance(problem, Model) and (moving or issubclass(problem.rung, Routhian)):
        f, states, values, keywords = moving_formulas(problem)
        made = Problem(f, states, values, **keywords)
        return made.described(moving_words(problem, states, list(values)))
    if isinstance(problem, Model):
        return Problem.from_system(problem)
    convert = getattr(problem, "as_problem", None)
    if callable(convert):
        made = convert()
        if isinstance(made, Problem):
            return made
    hint = "pk.Problem(f, state=..., parameters=...) makes one" if callable(problem) else ""
    raise bad("problem", problem, f"a Problem or a system ({', '.join(MODELS)})", hint)
