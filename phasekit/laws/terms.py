"""Terms of a law: what is added to a potential, as formulas.

``x'' + V'(x; p(t)) = -d x' - q |x'| x' + N + sum F cos(nu t + phase) + E(x) omega'(t)``, with
parameters ``p(t) = p + P cos(nu t + phase)`` or ``p + rate t``. Each term says by which parameters
it is known, which force it is, and how it makes parameters of the potential vary.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any, ClassVar

from phasekit.laws.ladder import Trait

#: The fields of a harmonic.
HARMONIC = ("amplitude", "frequency", "phase")


def forcing_names(number: int) -> tuple[str, ...]:
    """Names of the parameters of the harmonic of a number, from 0, of the forcing."""
    prefix = "forcing" if number == 0 else f"forcing{number + 1}"
    return tuple(f"{prefix}_{part}" for part in HARMONIC)


def modulation_names(parameter: str) -> tuple[str, ...]:
    """Names of the parameters of the harmonic of a modulated parameter."""
    return tuple(f"modulation_{parameter}_{part}" for part in HARMONIC)


def drift_name(parameter: str) -> str:
    """Name of the rate at which a parameter drifts."""
    return f"drift_{parameter}"


@dataclass(frozen=True)
class Instant:
    """A state at a time, in symbols, at which a term is a formula."""

    #: Coordinate, rate and time.
    x: Any
    v: Any
    t: Any
    #: The symbol of a parameter of a name.
    parameter: Callable[[str], Any]
    #: The absolute value of the rate.
    size: Callable[[], Any]
    #: A prescribed function of time and its slope.
    prescribed: tuple[Any, Any] = (0, 0)
    #: The value of a function of one's own, by the number of the call.
    coded: Callable[[Any], Any] | None = None


@dataclass(frozen=True)
class Term:
    """What is added to a law."""

    #: Its parameters.
    names: tuple[str, ...] = ()
    #: The parameter of the base that it makes vary with time.
    varies: str | None = None

    #: What it brings into a law.
    trait: ClassVar[Any] = Trait.DRIVEN
    #: Its own states, and the formulas or functions of their rates.
    states: ClassVar[Any] = ()
    rates: ClassVar[Any] = ()

    def force(self, at: Instant) -> Any:
        """The force per unit of inertia."""
        return 0

    def moved(self, value: Any, at: Instant) -> Any:
        """The parameter that varies, of the value that it has without."""
        return value

    def change(self, at: Instant) -> Any:
        """The slope in time of the parameter that varies."""
        return 0


class Torque(Term):
    """A constant torque, its one parameter."""

    trait = Trait.TORQUED

    def force(self, at: Instant) -> Any:
        """The torque itself."""
        return at.parameter(self.names[0])


class Damping(Term):
    """Linear damping by one parameter."""

    trait = Trait.DAMPED

    def force(self, at: Instant) -> Any:
        """In proportion to the rate, against it."""
        return -at.parameter(self.names[0]) * at.v


class Drag(Term):
    """Quadratic damping by one parameter, with a kink where the rate changes its sign."""

    trait = Trait.DAMPED

    def force(self, at: Instant) -> Any:
        """In proportion to the square of the rate, against it."""
        return -at.parameter(self.names[0]) * at.size() * at.v


class Noise(Term):
    """White noise of a thermal energy; a motion is followed without it."""

    trait = Trait.NOISY


class Forcing(Term):
    """A torque that is a harmonic: its amplitude, frequency and phase."""

    def force(self, at: Instant) -> Any:
        """The harmonic."""
        return _harmonic(self.names, at)


class Modulation(Term):
    """A harmonic that is added to a parameter: its amplitude, frequency and phase."""

    def moved(self, value: Any, at: Instant) -> Any:
        """The harmonic added."""
        return value + _harmonic(self.names, at)

    def change(self, at: Instant) -> Any:
        """The slope of the harmonic."""
        import sympy as sp

        amplitude, frequency, phase = map(at.parameter, self.names)
        return -amplitude * frequency * sp.sin(frequency * at.t + phase)


class Drift(Term):
    """A constant rate, its one parameter, at which a parameter changes."""

    def moved(self, value: Any, at: Instant) -> Any:
        """The drift since t = 0 added."""
        return value + at.parameter(self.names[0]) * at.t

    def change(self, at: Instant) -> Any:
        """The rate."""
        return at.parameter(self.names[0])


@dataclass(frozen=True)
class Prescribed(Term):
    """A function or a table of time in place of a parameter."""

    function: Any = field(default=None, compare=False)

    def moved(self, value: Any, at: Instant) -> Any:
        """The function in its place."""
        return at.prescribed[0]

    def change(self, at: Instant) -> Any:
        """Its slope."""
        return at.prescribed[1]


#: The terms that every perturbed law has, whatever their values.
STANDARD = (
    Torque(("torque",)),
    Damping(("damping",)),
    Drag(("quadratic",)),
    Noise(("kT",)),
)


#: Symbols of coordinate, rate and time in formulas of one's own, whatever they are called.
PLACES = ("(x)", "(v)", "(t)")


@dataclass(frozen=True)
class Own(Term):
    """A force of one's own, with states of its own or none."""

    #: A formula of the symbols of `PLACES`, of parameters and states; or a function ``f(t, x, v,
    #: **parameters and states)``.
    force_law: Any = 0
    #: What it brings into a law.
    trait: Trait = Trait.OWN  # type: ignore[misc]
    #: Its own states.
    states: tuple[str, ...] = ()  # type: ignore[misc]
    #: Formulas or functions of their rates.
    rates: tuple[Any, ...] = ()  # type: ignore[misc]
    #: The period in time, a formula of the parameters.
    period: Any = None
    #: Parameters with their least and greatest values.
    domains: tuple[tuple[str, float, float], ...] = ()

    def force(self, at: Instant) -> Any:
        """The formula there, or what stands for the function."""
        return self.value(self.force_law, at)

    def value(self, law: Any, at: Instant) -> Any:
        """The value of a formula, or what stands for that of a function."""
        from phasekit.laws.formulas import symbols_of

        if callable(law) and not hasattr(law, "free_symbols"):
            assert at.coded is not None
            return at.coded((law, (*self.names, *self.states)))
        import sympy as sp

        own = symbols_of(PLACES)
        places = dict(zip(own.values(), (at.x, at.v, at.t), strict=True))
        size = sp.Abs(own["(v)"])
        if size in law.atoms(sp.Abs):
            places[size] = at.size()
        rest = law.free_symbols - set(own.values())
        places |= {symbol: at.parameter(symbol.name) for symbol in sorted(rest, key=str)}
        return law.xreplace(places)


def _harmonic(names: tuple[str, ...], at: Instant) -> Any:
    import sympy as sp

    amplitude, frequency, phase = map(at.parameter, names)
    return amplitude * sp.cos(frequency * at.t + phase)


@dataclass(frozen=True)
class Rate:
    """A parameter that is an angular velocity of the frame, and the torque of its change.

    Attributes
    ----------
    parameter : str
        Its name.
    euler : callable
        Of the parameters by name: (E0, Es, Ec) of ``E = E0 + Es sin phi + Ec cos phi``.
    """

    parameter: str
    euler: Callable[[Mapping[str, Any]], tuple[Any, Any, Any]]
    #: The class that states it, and under which name.
    stated: tuple[type, str] | None = field(default=None, init=False, compare=False, repr=False)

    def __set_name__(self, owner: type, name: str) -> None:
        """Remember which class states it."""
        object.__setattr__(self, "stated", (owner, name))

    def __reduce__(self) -> tuple[Any, ...]:
        """Travel by the name of the class, whose function may be a lambda."""
        if self.stated is not None:
            return getattr, self.stated
        return Rate, (self.parameter, self.euler)
