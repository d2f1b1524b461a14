"""`BoundaryProblem`: equations on [0, 1] with conditions at both ends and on integrals."""

from __future__ import annotations

import functools
import re
from collections.abc import Mapping, Sequence
from typing import Any, ClassVar, NoReturn, Self

import numpy as np

from phasekit.bifurcation.continuation.functions import Formula
from phasekit.cycles.bounded import (
    Condition,
    EndFormulas,
    EndFunction,
    IntegralFormulas,
    IntegralFunction,
)
from phasekit.errors import ParameterError
from phasekit.labels.arguments import bad, call_checked
from phasekit.labels.equality import equal
from phasekit.laws.formulas import write_formula
from phasekit.systems.problem import Problem
from phasekit.systems.problem_parts import expressions_of, written
from phasekit.systems.system import MODELS

ENDS = ("_at_0", "_at_1")  # what follows a state's name at both ends


class _Elsewhere:
    """A way to a `Problem` that says nothing of conditions."""

    def __get__(self, instance: Any, owner: Any = None) -> NoReturn:
        raise AttributeError(
            "a BoundaryProblem is made of equations and conditions; models are read as a Problem, "
            "whose f and parameters it takes"
        )


class BoundaryProblem(Problem):
    """Equations ``x' = f(x, **parameters)`` on [0, 1] with conditions at both ends.

    Parameters
    ----------
    f : mapping, sequence of formulas or callable
        The right-hand side, as of `Problem`: ``{"u": "v", "v": "-lam*exp(u)"}``. It does not know
        the time s, which runs from 0 to 1; a state ``{"s": "1"}`` with the condition ``"s(0)"``
        does. On another stretch of time multiply f by its length, which may be a parameter.
    conditions : sequence of str, or callable
        What vanishes at the ends: formulas of ``u(0)``, ``u(1)`` for each state u, and parameters;
        or a function ``conditions(x0, x1, **parameters)`` of the states at both ends that returns
        as many numbers as there are conditions.
    integrals : sequence of str, or callable, optional
        What vanishes on average over [0, 1]: formulas of states and parameters (``"u - c"`` says
        that the mean of u is c), or a function ``integrals(x, **parameters)`` of one state that
        returns as many numbers as there are such conditions.
    parameters : mapping of str to float
        The parameters and their values. Of n states with b conditions and k integrals ``b + k - n +
        1`` of them are free along a branch.
    state : str or sequence of str, optional
        Names of the states; formulas by name need none.
    jac : callable, optional
        Derivatives of an f that is a Python function.
    start : mapping of str to float, optional
        A constant solution to start from, unless something else is said.
    definitions, functions : mapping, optional
        Names for formulas, and functions by their form, as of `Problem`.

    Raises
    ------
    ParameterError
        If an argument is unusable, or there are fewer conditions than states.

    Notes
    -----
    `continuation` follows solutions by collocation, the same as that of periodic orbits
    ([AscherMattheijRussell1995] chapters 1 and 5; [Doedel1991]), with folds and branch points.

    Examples
    --------
    >>> import phasekit as pk
    >>> bratu = pk.BoundaryProblem(
    ...     {"u": "v", "v": "-lam*exp(u)"}, ["u(0)", "u(1)"], parameters={"lam": 0.0}
    ... )
    >>> branch = pk.continuation(bratu, "lam", span=(0, 4), stop="fold")
    >>> (fold,) = branch.special("fold")
    >>> round(fold["lam"], 11)
    3.51383071913
    >>> bratu.freed
    1
    """

    __slots__ = ("conditions", "ends", "integrals", "means")

    bounded: ClassVar[bool] = True
    answered_by: ClassVar[str] = "pk.continuation takes a BoundaryProblem"

    conditions: Any
    integrals: Any
    ends: Condition
    means: Condition

    @functools.partial(call_checked, name="BoundaryProblem")
    def __init__(
        self,
        f: Any,
        conditions: Any,
        integrals: Any = (),
        parameters: Mapping[str, Any] | None = None,
        *,
        state: str | Sequence[str] | None = None,
        jac: Any = None,
        start: Mapping[str, float] | None = None,
        definitions: Mapping[str, Any] | None = None,
        functions: Mapping[str, Any] | None = None,
    ) -> None:
        super().__init__(
            f, state, parameters, jac, start=start, definitions=definitions, functions=functions
        )
        names, x = tuple(self.parameters), self.state
        both = tuple(name + end for end in ENDS for name in x)
        if taken := [name for name in both if name in (*names, *x)]:
            raise bad("state", taken, f"names that do not end in {' or '.join(ENDS)}")
        at = np.array([self.start.get(name, 0.0) for name in x])
        if callable(conditions):
            kept: Any = conditions
            count = _returned("conditions", conditions, (at, at), self.parameters)
            ends: Condition = EndFunction(conditions, count, names)
        else:
            kept = _texts("conditions", conditions)
            texts = [_with_ends(one, x) for one in kept]
            found = expressions_of(
                texts, [*both, *names], "conditions", both, definitions, functions
            )
            kept = tuple(kept)
            if definitions or functions:
                kept = tuple(_without_ends(write_formula(one), x) for one in found)
            ends = EndFormulas(tuple(Formula(one, both, names) for one in found))
        if callable(integrals):
            means: Condition = IntegralFunction(
                integrals, _returned("integrals", integrals, (at,), self.parameters), names
            )
            whole: Any = integrals
        else:
            given = _texts("integrals", integrals)
            found = expressions_of(given, [*x, *names], "integrals", x, definitions, functions)
            means = IntegralFormulas(tuple(Formula(one, x, names) for one in found))
            whole = tuple(write_formula(one) for one in found)
        for name, value in (
            ("conditions", kept), ("integrals", whole), ("ends", ends), ("means", means),
        ):  # fmt: skip
            self._set(name, value)
        if self.freed < 1:
            raise bad(
                "conditions", ends.count + means.count,
                f"at least {len(x)} conditions and integrals together, as many as states",
            )  # fmt: skip
        if self.freed > len(names):
            raise bad(
                "conditions", ends.count + means.count,
                f"at most {len(x) + len(names) - 1}: each beyond {len(x) - 1} frees one of "
                f"{len(names)} parameters",
            )  # fmt: skip

    @property
    def freed(self) -> int:
        """How many parameters are free along a branch."""
        return self.ends.count + self.means.count - len(self.state) + 1

    def specification(self, *, values: bool = True) -> dict[str, Any]:
        """What is needed to make the problem again, as plain values; None for what is code.

        Parameters
        ----------
        values : bool, default True
            Whether the values of the parameters are a part of it, or their names alone.

        Returns
        -------
        dict
            As of `Problem`, with ``conditions`` and ``integrals``.
        """
        spec = super().specification(values=values)
        for name in ("conditions", "integrals"):
            one = getattr(self, name)
            spec[name] = None if callable(one) else list(one)
        if spec["conditions"] is None or spec["integrals"] is None:
            spec["f"] = None
        return spec

    @classmethod
    def from_specification(cls, spec: Mapping[str, Any]) -> Self | None:
        """Make a problem of what `specification` gave; None where a part of it was code.

        Parameters
        ----------
        spec : mapping
            What `specification` returned.

        Returns
        -------
        BoundaryProblem or None

        Raises
        ------
        ParameterError
            If it is nothing of the kind.
        """
        if not isinstance(spec, Mapping) or not {"conditions", "integrals"} <= spec.keys():
            raise bad("spec", spec, "what BoundaryProblem.specification returns")
        plain = Problem.from_specification(spec)
        if plain is None:
            return None
        return cls(
            list(plain.f), spec["conditions"], spec["integrals"], plain.parameters,
            state=plain.state, start=dict(plain.start),
        ).described(plain.words)  # fmt: skip

    from_potential = from_system = from_ode = from_sbml = from_antimony = _Elsewhere()
    mechanical = _Elsewhere()

    def __reduce__(self) -> tuple[Any, ...]:
        """Copies and pickles are made from the arguments; functions must allow it."""
        arguments = (self.f, self.conditions, self.integrals, dict(self.parameters))
        more = {"state": self.state, "jac": self.jac, "start": dict(self.start)}
        return _restored, (type(self), arguments, more, {n: dict(w) for n, w in self.words.items()})

    def __eq__(self, other: object) -> bool:
        """Whether it has the same equations, conditions and values."""
        same = super().__eq__(other)
        if same is not True or not isinstance(other, BoundaryProblem):
            return same
        return all(equal(getattr(self, n), getattr(other, n)) for n in ("conditions", "integrals"))

    def __hash__(self) -> int:
        """Hash of states, parameters and their values."""
        return super().__hash__()

    def __repr__(self) -> str:
        """Write the equations, the conditions and the parameters."""
        parts = [written(self)]
        for name, empty in (("conditions", False), ("integrals", True)):
            one = getattr(self, name)
            if callable(one):
                parts.append(f"{name} {getattr(one, '__name__', 'by a function')}")
            elif one or not empty:
                parts.append(f"{name} {', '.join(one)}")
        return f"BoundaryProblem({'; '.join(parts)})"


def _restored(
    kind: type[BoundaryProblem], arguments: tuple[Any, ...], more: Mapping[str, Any], words: Any
) -> BoundaryProblem:
    return kind(*arguments, **more).described(words)


def _texts(argument: str, given: Any) -> list[str]:
    """Formulas as text."""
    wants = "formulas as text, or a function"
    if isinstance(given, str):
        given = [given]
    if not isinstance(given, (list, tuple)):
        raise bad(argument, given, wants)
    for one in given:
        if not isinstance(one, str):
            raise bad(argument, one, wants)
    return list(given)


def _with_ends(text: str, states: Sequence[str]) -> str:
    """A formula with names in the place of u(0) and u(1)."""

    def name_of(match: re.Match[str]) -> str:
        name, at = match[1], match[2].strip()
        if name not in states:
            return match[0]
        if at not in ("0", "1"):
            raise bad("conditions", match[0], f"{name}(0) or {name}(1)")
        return name + ENDS[int(at)]

    found = re.sub(r"(?<![\w.])([^\W\d]\w*)\s*\(([^()]*)\)", name_of, text)
    for state in states:
        if re.search(rf"(?<![\w.]){re.escape(state)}(?!\w)", found):
            raise bad("conditions", text, f"{state}(0) or {state}(1) in place of {state}")
    return found


def _without_ends(text: str, states: Sequence[str]) -> str:
    """What `_with_ends` made, as it was."""
    for state in states:
        for k, end in enumerate(ENDS):
            text = re.sub(rf"(?<![\w.]){re.escape(state + end)}(?!\w)", f"{state}({k})", text)
    return text


def _returned(argument: str, function: Any, x: tuple[Any, ...], values: Mapping[str, float]) -> int:
    """How many numbers a function of the user's returns."""
    try:
        with np.errstate(all="ignore"):
            found = np.asarray(function(*(one.copy() for one in x), **values))
    except (ArithmeticError, ValueError) as error:
        raise ParameterError(
            f"{argument}: raised {type(error).__name__} at the start: {error}; start= gives another"
        ) from error
    except Exception as error:
        form = "x0, x1" if len(x) == 2 else "x"
        raise ParameterError(
            f"{argument}: raised {type(error).__name__} at the start: {error}; wants a function "
            f"{argument}({form}, **parameters)"
        ) from error
    if found.dtype.kind not in "biuf" or found.ndim > 1:
        raise bad(argument, found, "numbers to be returned, in one row")
    return int(found.size)


MODELS["BoundaryProblem"] = BoundaryProblem
