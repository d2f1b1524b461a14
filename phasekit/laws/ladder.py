"""The ladder of laws: each rung is a set of equations, and a method belongs to a rung.

A law is a base, which stands on a rung, and the terms that are added to it. The rung and the traits
of the terms say what can be computed of it; the table of quantities names for each rung, and for
the traits that it bears, what computes it, and the most special line that fits answers.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from enum import Flag, auto
from typing import Any, ClassVar


class Law:
    """Anything that moves: ``x' = f(t, x; p)``."""

    #: What messages call a system with such a law.
    called: ClassVar[str] = "a system"
    #: What is computed of the parameters before anything else, and may be asked for by name.
    derived: ClassVar[tuple[str, ...]] = ()
    #: Whether equilibria have names, so that all cells have the same; else they are numbered.
    labels_fixed: ClassVar[bool] = False
    #: Whether it is equations of states by name.
    is_stated: ClassVar[bool] = False
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
        """Refuse to look for equilibria where they cannot all be found."""

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

    called: ClassVar[str] = "a system whose inertia changes with its coordinate"
    #: Name of the coordinate, and its period.
    coordinate: str
    period: float
    #: The momentum that is constant: its name, value and unit; None of a law that knows of none.
    momentum: tuple[str, float, str] | None
    #: The inertia over which terms are: that of the coordinate with all others held.
    own_inertia: Any

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


class Routhians(Routhian):
    """Such systems by their parameters, which may be arrays."""

    #: All parameters, in order, and what is computed of them, on which alone the motion depends.
    names: tuple[str, ...]
    constants: tuple[str, ...]

    def values(self, *arrays: Any) -> dict[str, Any]:
        """Values of the parameters by name, NaN where they leave their domain."""
        raise NotImplementedError

    def constants_of(self, values: Mapping[str, Any]) -> dict[str, Any]:
        """The constants of the parameters, by name."""
        raise NotImplementedError

    def alone(self, constants: tuple[float, ...]) -> Routhian:
        """The system of some constants."""
        raise NotImplementedError

    def with_values(self, values: Mapping[str, Any]) -> Routhian:
        """The systems of some values."""
        raise NotImplementedError

    def resting(self, values: Mapping[str, Any], torque: Any = None) -> Any:
        """Columns of all equilibria, under a torque over the inertia of the coordinate alone."""
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


class Trait(Flag):
    """What the terms of a law bring into it; without `DRIVEN` it is steady."""

    #: A constant torque: V falls by a constant a turn.
    TORQUED = auto()
    #: What takes energy from the motion, or gives it where it is negative.
    DAMPED = auto()
    #: What varies with time.
    DRIVEN = auto()
    #: White noise.
    NOISY = auto()
    #: A formula of one's own.
    OWN = auto()
    #: A kink of a force of one's own, along which it is continuous.
    KINKED = auto()
    #: A jump of a force of one's own.
    JUMPING = auto()
    #: A force of one's own that is a function, of which no formula is known.
    CODED = auto()
    #: States of their own.
    STATEFUL = auto()


#: The traits of damping, torque, drive and noise together; with smooth formulas; all.
PERTURBED = Trait.TORQUED | Trait.DAMPED | Trait.DRIVEN | Trait.NOISY
FORMULAS = PERTURBED | Trait.OWN | Trait.KINKED
ANY = ~Trait(0)


@dataclass(frozen=True)
class Standing:
    """Where a law stands: the rung of its base, and the traits of its terms.

    >>> pushed = Standing(Conservative, Trait.TORQUED)
    >>> pushed.is_within(Standing(Flow, PERTURBED)), pushed.is_within(Conservative)
    (True, False)
    >>> Standing(Conservative).is_within(Flow), Standing(Flow).is_within(Conservative)
    (True, False)
    """

    rung: type[Law]
    traits: Trait | None = None
    """None of a base alone; of a base with terms none need act."""

    @classmethod
    def from_rung(cls, rung: type[Law] | Standing) -> Standing:
        """A rung as where a base alone stands."""
        return rung if isinstance(rung, Standing) else cls(rung)

    def is_within(self, where: type[Law] | Standing) -> bool:
        """Whether the base is on a rung, or a more special one, and bears no other traits.

        What takes a base alone takes no terms, but what needs no more than a `Law` takes any, and
        what needs a `Flow`, which a law with terms is as well.
        """
        wanted = Standing.from_rung(where)
        rung, traits = wanted.rung, wanted.traits
        if traits is None and self.traits is not None:
            return rung is Law or rung is Flow
        if traits is not None and (self.traits is None or self.traits not in traits):
            return False
        return issubclass(self.rung, rung)

    @property
    def depth(self) -> tuple[int, int]:
        """How special it is: by the rung, then by how few traits it has."""
        few = 0 if self.traits is None else -1 - len(self.traits)
        return len(self.rung.__mro__), few

    @property
    def called(self) -> str:
        """What messages call a system with such a law."""
        if self.traits is None:
            return self.rung.called
        exact, alone = self.rung.labels_fixed, self.traits == Trait.TORQUED
        if alone:
            of = " with coefficients (A, B, C)" if exact else ""
            return f"a system{of} under a constant torque alone, pk.Perturbed(system, torque=)"
        if issubclass(self.rung, Routhian):
            return "a perturbed system at a constant momentum"
        if exact:
            of = " with coefficients (A, B, C)"
            return f"a perturbed system{of}, pk.Perturbed(system, damping=...)"
        return "a perturbed system, pk.Perturbed(system, damping=..., forcing=...)"


class Lawful:
    """What has a law: systems, and what motion at constant momenta is."""

    __slots__ = ()

    #: The rung of its law, which says what can be computed of it; `Flow` of a base with terms.
    rung: ClassVar[type[Law]] = Law

    @property
    def standing(self) -> Standing:
        """Where its law stands: the rung of the base, and the traits of the terms."""
        return Standing(self.rung)

    @property
    def law(self) -> Law:
        """The law, and what follows from it."""
        raise NotImplementedError

    @property
    def own_equations(self) -> Any:
        """The law of a system that states its rates or step, `Equations`; None of others."""
        law = self.law if issubclass(self.rung, (Flow, Map)) else None
        return law if law is not None and law.is_stated else None

    @property
    def parameters(self) -> dict[str, Any]:
        """The parameters of the law by name."""
        raise NotImplementedError
