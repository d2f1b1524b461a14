"""Laws that are stated as they are: the rates of any number of states, or the step of a map."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, fields
from typing import Any, ClassVar

from phasekit.laws.ladder import Flow, Map
from phasekit.laws.smoothness import any_jumps


@dataclass(frozen=True)
class Equations:
    """Equations of states by name."""

    is_stated: ClassVar[bool] = True

    #: Names of the states.
    states: tuple[str, ...]
    #: Names of the parameters, in the order of the values.
    names: tuple[str, ...]
    #: Formulas of real symbols, one a state, or a function ``f(x, **parameters)``.
    f: Any
    #: States that are angles, with their periods.
    periods: Mapping[str, float] = field(default_factory=dict, hash=False)
    #: What f calls the time, if it depends on it.
    time: str | None = None
    #: Where to look for what the states do; the widths are what errors are measured by.
    window: Mapping[str, tuple[float, float]] = field(default_factory=dict, hash=False)
    #: Units of states, of parameters and of ``time``, where they are known.
    units: Mapping[str, str] = field(default_factory=dict, hash=False)
    #: How often a map is applied in each step.
    times: int = 1
    #: The period of f in time, a formula of the parameters.
    period: Any = None
    #: Where motions begin unless something else is said, of states of which this is known.
    start: Mapping[str, float] = field(default_factory=dict, hash=False)
    #: Of states with noise its amplitude s, a formula of the parameters: dx = f dt + s dW.
    noise: Mapping[str, Any] = field(default_factory=dict, hash=False)
    #: Of fields of states the sparse derivatives of f, a function of states and parameters.
    slopes: Any = None

    def __reduce__(self) -> tuple[Any, ...]:
        """Worker processes take it with plain mappings."""
        given = (getattr(self, one.name) for one in fields(self))
        return type(self), tuple(dict(x) if isinstance(x, Mapping) else x for x in given)

    @property
    def kind(self) -> str:
        """How f was given: "symbolic", "compiled" or "python"."""
        if isinstance(self.f, tuple):
            return "symbolic"
        return "compiled" if hasattr(self.f, "signatures") else "python"

    @property
    def jumps(self) -> bool:
        """Whether formulas jump as states change, where motions may stick."""
        return self.kind == "symbolic" and any_jumps(self.f, self.states)

    def units_along(self, formula: Any) -> str:
        """Units of a formula: "1" where nothing in it has any, else "", unknown, but of one symbol.

        >>> import sympy as sp
        >>> x, v, a = sp.symbols("x v a")
        >>> law = Rates(("x", "v"), ("a",), None, units={"x": "m", "v": "m s-1"})
        >>> law.units_along(x), law.units_along(x * v), law.units_along(a**2)
        ('m', '', '1')
        """
        named = {
            symbol: self.units.get("time" if str(symbol) == self.time else str(symbol), "1")
            for symbol in getattr(formula, "free_symbols", ())
        }
        return named.get(formula) or ("1" if set(named.values()) <= {"1"} else "")


class Rates(Equations, Flow):
    """A flow ``x' = f(x; p)``, or ``x' = f(t, x; p)``."""


class Step(Equations, Map):
    """A map ``x -> f(x; p)``."""

    called: ClassVar[str] = "a map x -> f(x; p)"
