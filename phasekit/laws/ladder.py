"""The ladder of laws: each rung is a set of equations, and a method belongs to a rung.

A law says by its rung what can be computed of it; the table of quantities names for each rung what
computes it, and the most special line that fits answers.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any, ClassVar


class Law:
    """Anything that moves: ``x' = f(t, x; p)``."""

    #: What messages call a system with such a law.
    called: ClassVar[str] = "a system"
    #: What is computed of the parameters before anything else, and may be asked for by name.
    derived: ClassVar[tuple[str, ...]] = ()
    #: Whether equilibria have names, so that all cells have the same; else they are numbered.
    labels_fixed: ClassVar[bool] = False
    #: Which center or saddle is meant where none is named.
    default: ClassVar[Mapping[str, str]] = {"center": "the lowest", "saddle": "the lowest"}

    @property
    def may_be_incomplete(self) -> bool:
        """Whether equilibria may be missed, which results then say."""
        return False

    @property
    def unbounded_function(self) -> str | None:
        """Name of a function in it of which no bounds are known, so that nothing is proved."""
        return None

    def check_searchable(self) -> None:
        """Refuse to look for equilibria where they cannot all be found.

        Raises
        ------
        ParameterError
        """

    def words(self, name: str, units: str, long_name: str) -> Mapping[str, str]:
        """What is said of a quantity of this law alone: equation, source, units, long_name."""
        return {}


class Flow(Law):
    """Rates of any number of states: ``x' = f(t, x; p)``."""

    called: ClassVar[str] = "a flow x' = f(t, x; p)"


class Map(Law):
    """A map ``x -> f(x; p)``."""

    called: ClassVar[str] = "a map"


class Routhian(Flow):
    """One degree of freedom left by constant momenta, with an inertia M: M(x) x'^2/2 + V(x)."""

    called: ClassVar[str] = "a system at constant momenta"
    #: Name of the coordinate, and its period.
    coordinate: str
    period: float
    #: The momentum that is constant: its name, value and unit.
    momentum: tuple[str, float, str]

    def potential(self, x: Any) -> tuple[Any, Any, Any]:
        """V and its first two derivatives."""
        raise NotImplementedError

    def inertia(self, x: Any) -> tuple[Any, Any]:
        """M > 0 and its derivative."""
        raise NotImplementedError

    def equilibria(self) -> Any:
        """phi, kind, energy and curvature of all equilibria, in the order of phi."""
        raise NotImplementedError

    def acceleration_formula(self, symbols: Mapping[str, Any], rate: Any, push: Any) -> Any:
        """The acceleration as a sympy expression; push is a torque over the inertia of x alone."""
        raise NotImplementedError


class Conservative(Flow):
    """One degree of freedom in a potential: ``x'' = -V'(x; p)``."""

    called: ClassVar[str] = "a system in a potential"
    #: Name of the coordinate, and its period on a circle.
    coordinate: str
    period: float | None
    #: The potential for print.
    text: str

    def gradient_formula(self, symbols: Mapping[str, Any]) -> Any:
        """V' as a sympy expression of real symbols: of the coordinate and the parameters."""
        raise NotImplementedError

    def acceleration_formula(self, symbols: Mapping[str, Any], rate: Any, push: Any) -> Any:
        """The acceleration as a sympy expression; push is a force over the inertia."""
        return push - self.gradient_formula(symbols)


def is_turn(period: float | None) -> bool:
    """Whether a coordinate of a period is an angle in rad."""
    return period is not None and math.isclose(period, 2.0 * math.pi, rel_tol=1e-12)


class Lawful:
    """What has a law: systems, and what motion at constant momenta is."""

    __slots__ = ()

    #: The rung of its law, which says what can be computed of it.
    rung: ClassVar[type[Law]] = Law

    @property
    def law(self) -> Law:
        """The law, and what follows from it."""
        raise NotImplementedError

    @property
    def parameters(self) -> dict[str, Any]:
        """The parameters of the law by name."""
        raise NotImplementedError
