"""How a class states its law: by a potential of its coordinate, by rates, or by the step of a map.

Of the trigonometric law the class states products (`phasekit.laws.trigonometric`).
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from types import FunctionType
from typing import TYPE_CHECKING, Any, ClassVar

from phasekit.errors import ParameterError
from phasekit.inputs import call_checked
from phasekit.labels.arguments import bad
from phasekit.labels.coordinates import LABELS, STATES
from phasekit.laws.ladder import Conservative, Flow, Law, Map, Routhian
from phasekit.systems import potential_parts as parts
from phasekit.systems.parameter import Parameter
from phasekit.table.numerical import NUMERICAL_ROWS
from phasekit.table.quantities import ROWS

if TYPE_CHECKING:
    from phasekit.phase.numerical.formula import Formula

#: Names that parameters cannot have, because results have them.
TAKEN = {*LABELS, *STATES, "point"}
TAKEN |= {row.name for rows in NUMERICAL_ROWS.values() for row in rows}

#: What a class may state of its law, and what belongs to it.
LAWS = ("products", "potential", "rates", "step")
#: Names that neither parameters nor states can have, because a class or a call has them.
RESERVED = {*LAWS, "coordinate", "states", "periods", "window", "period", "time", "replace"}


@dataclass(frozen=True)
class Coordinate:
    """The coordinate of a potential: its name, and the circle or interval on which it lies."""

    name: str
    period: float | None = None
    interval: tuple[float, float] | None = None


@call_checked
def angle(name: str = "phi") -> Coordinate:
    """Declare the coordinate of a system's potential: an angle in rad.

    Parameters
    ----------
    name : str
        Its name in the formula.

    Returns
    -------
    Coordinate
        For ``coordinate`` of a `System`.

    Raises
    ------
    ParameterError
        If it is no name.

    Examples
    --------
    >>> import phasekit as pk
    >>> class Needle(pk.System):
    ...     field = pk.parameter("s-2", "torque of the field over the moment of inertia")
    ...     coordinate = pk.angle("theta")
    ...     potential = "-field*cos(theta)"
    >>> pk.equilibria(Needle(field=2.0)).n_equilibria.item()
    2
    """
    return coordinate(name, period="2*pi")


@call_checked
def coordinate(
    name: str = "x",
    *,
    period: float | str | None = None,
    interval: Sequence[float] | None = None,
) -> Coordinate:
    """Declare the coordinate of a system's potential, a number without a unit.

    Parameters
    ----------
    name : str
        Its name in the formula.
    period : float or str, optional
        Length of the circle on which it lies, such as ``"2*pi"``; None for a line.
    interval : (float, float), optional
        The part of a line where equilibria are looked for; needed if V is not a polynomial.

    Returns
    -------
    Coordinate
        For ``coordinate`` of a `System`.

    Examples
    --------
    >>> import phasekit as pk
    >>> class DoubleWell(pk.System):
    ...     mu = pk.parameter("s-2", "stiffness at 0, negative")
    ...     coordinate = pk.coordinate("x")
    ...     potential = "x^4/4 - mu*x^2/2"
    >>> pk.equilibria(DoubleWell(mu=4.0)).phi.values.tolist()
    [-2.0, 0.0, 2.0]
    """
    return Coordinate(
        parts.name("coordinate", name), parts.period(period), parts.interval(interval, period)
    )


class Stated:
    """A law as a class states it."""

    rung: ClassVar[type[Law]]
    #: The parameters on which it depends.
    inputs: tuple[str, ...]
    #: What the class has of it, by name.
    kept: Mapping[str, Any]
    #: What messages say of a system that a function cannot take.
    answered_by: ClassVar[str] = ""

    def check(self, system: Any) -> None:
        """Refuse parameters with which it is no law."""

    def law(self) -> Law:
        """The law as a function of the parameters."""
        raise NotImplementedError


class StatedPotential(Stated):
    """``x'' = -V'(x)`` by the formula of V."""

    rung: ClassVar[type[Law]] = Conservative

    def __init__(self, title: str, formula: Any, where: Any, declared: Sequence[Parameter]) -> None:
        from phasekit.phase.numerical.formula import make_formula

        if not isinstance(where, Coordinate):
            raise bad(f"coordinate of {title}", where, "pk.angle(name) or pk.coordinate(name)")
        names = tuple(p.name for p in declared if not p.optional)
        if where.name in names:
            raise bad(f"parameter of {title}", where.name, "a name other than the coordinate's")
        self._formula: Formula = make_formula(
            parts.expression(formula), where.name, names, where.period, where.interval
        )
        self.inputs = names
        self.kept = {
            "coordinate": where.name, "period": where.period, "interval": where.interval
        }  # fmt: skip

    def check(self, system: Any) -> None:
        """Refuse a potential that does not close on its circle."""
        from phasekit.phase.numerical.formula import check_period

        check_period(self._formula, [system.parameters[name] for name in self.inputs])

    def law(self) -> Law:
        """The formula."""
        return self._formula


class StatedRouthian(StatedPotential):
    """``M x'' + M' x'^2/2 + V' = 0`` by the formulas of V and of the inertia M."""

    rung: ClassVar[type[Law]] = Routhian

    def __init__(
        self, title: str, formula: Any, inertia: str, where: Any, declared: Sequence[Parameter]
    ) -> None:
        from phasekit.phase.numerical.formula import make_formula
        from phasekit.phase.numerical.inertial import Inertial

        super().__init__(title, formula, where, declared)
        if where.period is None:
            hint = "on a line state the rates of the coordinate and its velocity as formulas"
            wants = "one on a circle, beside an inertia: pk.angle(name)"
            raise bad(f"coordinate of {title}", where, wants, hint)
        mass = make_formula(
            parts.expression(inertia), where.name, self.inputs, where.period, where.interval
        )
        self._law = Inertial(self._formula, mass)

    def check(self, system: Any) -> None:
        """Refuse what does not close on its circle, and an inertia that is not positive."""
        from phasekit.phase.numerical.formula import check_period

        super().check(system)
        values = [system.parameters[name] for name in self.inputs]
        check_period(self._law.mass, values)
        if all(isinstance(value, float) for value in values):
            place, least = self._law.least(dict(zip(self.inputs, values, strict=True)))
            if not least > 0.0:
                raise ParameterError(
                    f"inertia: got {self._law.mass.text} = {least:.6g} at "
                    f"{self._law.coordinate} = {place:.6g}, wants one > 0 everywhere"
                )

    def law(self) -> Law:
        """The formulas."""
        return self._law


class StatedRates(Stated):
    """``x' = f(x)`` by formulas of the states, or by a function; of a map ``x -> f(x)``."""

    rung: ClassVar[type[Law]] = Flow
    answered_by: ClassVar[str] = (
        "pk.continuation, pk.diagram, pk.equilibria, pk.flow, pk.lyapunov, pk.periodic_orbit and "
        "pk.poincare_section take it"
    )

    def __init__(
        self, title: str, f: Any, own: Mapping[str, Any], declared: Sequence[Parameter]
    ) -> None:
        # Only here: continuation takes long to load.
        from phasekit.systems.problem_parts import angles_of, make_field, names_of, window_of

        given = own.get("states", tuple(f) if isinstance(f, Mapping) else None)
        if given is None:
            raise bad(f"states of {title}", None, "the names of the states, beside a function")
        given = (given,) if isinstance(given, str) else given
        self.states = names_of(f"states of {title}", given)
        self.inputs = tuple(p.name for p in declared if not p.optional)
        for name in self.states:
            refuse_name(f"state of {title}", name)
            if name in self.inputs:
                raise bad(f"parameter of {title}", name, "a name that is no state's")
        self.periods = angles_of(own.get("periods"), self.states)
        self.window = window_of(f"window of {title}", own.get("window"), self.states)
        self.words = _words(title, given) if isinstance(given, Mapping) else {}
        self.map = issubclass(self.rung, Map)
        self.kept = {"states": self.states, "periods": self.periods, "window": self.window}
        _, self.f = make_field(f, None, self.states, self.inputs)

    def law(self) -> Law:
        """The equations."""
        from phasekit.laws.equations import Rates, Step

        kind = Step if self.map else Rates
        units = {name: words["units"] for name, words in self.words.items()}
        return kind(self.states, self.inputs, self.f, self.periods, None, self.window, units)


class StatedStep(StatedRates):
    """A map by formulas of the states, or by a function."""

    rung: ClassVar[type[Law]] = Map
    answered_by: ClassVar[str] = (
        "pk.continuation, pk.diagram, pk.equilibria, pk.flow and pk.lyapunov take it"
    )


def stated(cls: type, declared: Sequence[Parameter]) -> Stated | None:
    """The law that the body of a class states beside products; None where it states none."""
    own, title = vars(cls), cls.__name__
    given = [name for name in LAWS if name in own]
    if isinstance(own.get("potential"), FunctionType):  # a method
        given.remove("potential")
    if len(given) > 1:
        raise ParameterError(f"{title}: got {' and '.join(given)}, wants one law")
    inertia = own.get("inertia")
    if isinstance(inertia, str) and given != ["potential"]:
        raise bad(f"inertia of {title}", inertia, "a potential beside it")
    if not given or given == ["products"]:
        return None
    (name,) = given
    law = own[name].__func__ if isinstance(own[name], staticmethod) else own[name]
    if name == "potential" and isinstance(inertia, str):
        return StatedRouthian(title, law, inertia, own.get("coordinate"), declared)
    if name == "potential":
        return StatedPotential(title, law, own.get("coordinate"), declared)
    kinds: dict[str, Callable[..., Stated]] = {"rates": StatedRates, "step": StatedStep}
    return kinds[name](title, law, own, declared)


def refuse_name(what: str, name: str) -> None:
    """Refuse a name that a class, a call or a result has."""
    if name in RESERVED or name in TAKEN or name in ROWS:  # rows may have been added
        raise bad(what, name, f"another name, because a system or its results have {name!r}")


def _words(title: str, given: Mapping[str, Any]) -> dict[str, dict[str, str]]:
    """Units and long names of states."""
    kept = {}
    for name, words in given.items():
        if not isinstance(words, tuple) or [type(word) for word in words] != [str, str]:
            raise bad(f"states[{name!r}] of {title}", words, "(units, meaning), two texts")
        kept[name] = {"units": words[0], "long_name": words[1]}
    return kept
