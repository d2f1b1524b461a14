"""Terms of one's own: forces that are added to a system, each a value or a class."""

from __future__ import annotations

import functools
import inspect
import math
import random
from collections.abc import Callable, Hashable, Mapping, Sequence
from types import MappingProxyType
from typing import Any, ClassVar, Self, dataclass_transform

import numpy as np

from phasekit.bifurcation.continuation.fields import refuse_uncompiled
from phasekit.errors import ParameterError
from phasekit.labels.arguments import NumberLike, bad, brief, call_checked, number, numeric
from phasekit.labels.equality import equal
from phasekit.laws.formulas import symbols_of, take_formula, write_formula
from phasekit.laws.ladder import Trait
from phasekit.laws.smoothness import is_jump, roughness
from phasekit.laws.terms import PLACES, Own
from phasekit.systems.parameter import Parameter, parameter
from phasekit.systems.problem_parts import names_of
from phasekit.systems.statement import refuse_name
from phasekit.systems.value import Declared
from phasekit.systems.waves import period_in_time

#: Every class of terms by its name, as maps store it.
TERMS: dict[str, type[Term]] = {}
#: States at which a function is asked whether it depends on time.
TRIED = 16
#: Intervals of the coordinate and the rate in which a function is searched for a jump, their ends.
INTERVALS, ENDS = 64, (-3.1, 3.3)
#: Names that neither parameters nor states of a term can have.
OWN_NAMES = ("t", "phi", "dphi")


@dataclass_transform(kw_only_default=True, frozen_default=True, field_specifiers=(parameter,))
class Term(Declared):
    """A force, or torque, of one's own that is added to a system, per unit of inertia.

    A value, ``pk.Term("-mu*tanh(dphi/width)", {"mu": 0.3, "width": 0.01})``, or a class whose
    parameters are fields and which states ``force``. `Perturbed` takes it as ``terms=``.

    Parameters
    ----------
    force : str, sympy.Expr, or callable
        A formula of the coordinate and its rate (``phi`` and ``dphi``, or as the system calls
        them), the time ``t``, the parameters and states of the term, and the system's own
        parameters; or a function ``force(t, phi, dphi, **parameters)``, which takes states by name
        as well.
    parameters : mapping of str to float, 1-D array_like or xarray.DataArray, optional
        Values of the parameters by name. They sweep like those of the system.
    states : mapping of str to str, sympy.Expr or callable, optional
        States of its own, such as the speed of a motor, with formulas of their rates, or functions
        that are called like `force`.
    start : mapping of str to float, optional
        Their values at t = 0, unless a motion is told others.
    period : str, sympy.Expr or float, optional
        The period in time of what depends on it; found where time enters by sines and cosines.

    Raises
    ------
    ParameterError
        If an argument is unusable.

    See Also
    --------
    Perturbed : how terms act, and what is answered of a system with them.

    Examples
    --------
    >>> import phasekit as pk
    >>> pendulum = pk.Pendulum(length=1.0, g=1.0)
    >>> friction = pk.Term("-mu*tanh(dphi/width)", {"mu": 0.1, "width": 0.01})
    >>> slowed = pk.Perturbed(pendulum, terms=friction)
    >>> pk.flow(slowed, 1.0, 0.0, 200.0).motion_dphi.round(6).item()
    -0.0

    As a class, of a motor whose torque falls with its speed:

    >>> class Motor(pk.Term):
    ...     torque0 = pk.parameter("s-2", "torque at rest over inertia")
    ...     idle = pk.parameter("s-1", "speed without load", positive=True)
    ...     force = "torque0*(1 - dphi/idle)"
    >>> driven = pk.Perturbed(pendulum, terms=[Motor(torque0=0.2, idle=3.0)])
    >>> driven.replace(idle=4.0).terms
    (Motor(torque0=0.2, idle=4.0),)
    """

    kind_of_value: ClassVar[str] = "term"

    force: Any = None
    states: Mapping[str, Any] = MappingProxyType({})
    start: Mapping[str, float] = MappingProxyType({})
    period: Any = None

    @classmethod
    def _states_itself(cls) -> bool:
        """Whether the body of the class declares parameters or states a force."""
        return super()._states_itself() or "force" in vars(cls)

    def __init_subclass__(cls, **keywords: Any) -> None:
        """Read what the class states, refuse what is none, and register it."""
        super().__init_subclass__(**keywords)
        if not cls._states_itself():
            return
        if cls.force is None:
            raise bad(
                cls.__name__, [p.name for p in cls.declared], "a force: a formula or function"
            )
        title, names = cls.__name__, [p.name for p in cls.declared]
        force = vars(cls).get("force")
        if force is not None:
            cls.force = staticmethod(_law(f"force of {title}", force)) if callable(force) else force
        _check(title, cls, names)
        cls.__init__ = Declared.__init__  # type: ignore[method-assign]
        TERMS[title] = cls

    @functools.partial(call_checked, name="Term")
    def __init__(
        self,
        force: Any,
        parameters: Mapping[str, NumberLike] | None = None,
        *,
        states: Mapping[str, Any] | None = None,
        start: Mapping[str, float] | None = None,
        period: Any = None,
    ) -> None:
        for name, value, example in (
            ("parameters", parameters, "values, {'mu': 0.3}"),
            ("states", states, "rates, {'w': '-w'}"),
            ("start", start, "values, {'w': 0.0}"),
        ):
            if value is not None and not isinstance(value, Mapping):
                raise bad(name, value, f"a mapping of names to {example}")
        given = dict(parameters or {})
        if given:
            names_of("parameters", given)
        for name in given:
            refuse_name("parameters", name)
        declared = tuple(
            Parameter(
                name=name, units=getattr(value, "attrs", {}).get("units", "1"),
                long_name=f"parameter {name} of a term",
            )
            for name, value in given.items()
        )  # fmt: skip
        kept = {p.name: p.check(numeric(p.name, given[p.name], None)) for p in declared}
        own = {"force": force, "states": dict(states or {}), "start": dict(start or {}),
               "period": period, "declared": declared, **kept}  # fmt: skip
        for name, value in own.items():
            object.__setattr__(self, name, value)
        _check("Term", self, list(given))

    # ------------------------------------------------------------------ as a value

    @property
    def identity(self) -> tuple[Any, ...]:
        """What it is beside the values of its parameters."""
        return (
            type(self), tuple(p.name for p in self.declared), self.force, dict(self.states),
            dict(self.start), self.period,
        )  # fmt: skip

    @property
    def is_anonymous(self) -> bool:
        """Whether it is a value of no class of its own."""
        return type(self) is Term

    @property
    def arguments(self) -> dict[str, Any]:
        """The keyword arguments that rebuild it."""
        if not self.is_anonymous:
            return super().arguments
        more = {"force": self.force, "parameters": self.parameters, "period": self.period}
        return {**more, "states": dict(self.states), "start": dict(self.start)}

    def replace(self, **changes: Any) -> Self:
        """Return a copy with some parameters changed."""
        if not self.is_anonymous:
            return super().replace(**changes)
        names = {p.name for p in self.declared}
        values = {k: v for k, v in changes.items() if k in names}
        made = {**self.arguments, **{k: v for k, v in changes.items() if k not in names}}
        return type(self)(**{**made, "parameters": {**self.parameters, **values}})

    def __reduce__(self) -> tuple[Any, ...]:
        """Travel as the call that makes it."""
        return _rebuilt, (type(self), self.arguments)

    def __eq__(self, other: object) -> bool:
        """Whether it is the same force with equal parameters; NaN equals NaN."""
        if not isinstance(other, Term) or not equal(self.identity, other.identity):
            return NotImplemented if not isinstance(other, Term) else False
        return bool(super().__eq__(other))

    def __hash__(self) -> int:
        """Hash of names and values; one that holds DataArrays has none."""
        return hash((super().__hash__(), self.identity[1]))

    def __repr__(self) -> str:
        """Write the call that makes it, long arrays by their ends."""
        if not self.is_anonymous:
            return super().__repr__()
        words = [_named(self.force)]
        if self.parameters:
            shown = ", ".join(f"{k!r}: {brief(v)}" for k, v in self.parameters.items())
            words.append(f"{{{shown}}}")
        if self.states:
            rates = ", ".join(f"{name!r}: {_named(rate)}" for name, rate in self.states.items())
            words.append(f"states={{{rates}}}")
        return f"Term({', '.join(words)})"

    @property
    def specification(self) -> dict[str, Any] | None:
        """What files store of it beside its parameters' values; None where it is a function."""
        names = list(self.parameters)
        if not self.is_anonymous:
            return {"class": type(self).__name__, "parameters": names}
        texts = [self.force, *self.states.values()]
        if any(map(_is_function, texts)):
            return None
        return {
            "force": _text(self.force),
            "parameters": names,
            "states": {name: _text(rate) for name, rate in self.states.items()},
            "start": dict(self.start),
            "period": None if self.period is None else _text(self.period),
        }


def term_of(spec: Mapping[str, Any], values: Mapping[str, Any]) -> Term:
    """Make a term again of what files stored of it, and of values of its parameters."""
    own = {name: values[name] for name in spec["parameters"]}
    if "class" not in spec:
        more = {name: spec[name] for name in ("force", "states", "start", "period")}
        return Term(**more, parameters=own)
    if spec["class"] not in TERMS:
        raise ParameterError(
            f"ds: got a map of a system with the term {spec['class']}, wants one of "
            f"{', '.join(TERMS) or 'a known class'}; import the module that defines it first"
        )
    return TERMS[spec["class"]](**own)


def law_of(term: Term, base: Any, argument: str) -> Own:
    """The term of a law, added to a system."""
    x = base.coordinate or "phi"
    own = [p.name for p in term.declared if getattr(term, p.name) is not None]
    symbols = symbols_of([*base.formula_inputs(), *own, *term.states])
    places = list(symbols_of(PLACES).values())
    for names in (("phi", "dphi", "t"), (x, f"d{x}", "t")):
        symbols |= dict(zip(names, places, strict=True))
    declare = "declare it in parameters"
    laws = [
        law if _is_function(law) else take_formula(law, symbols, where, declare)
        for where, law in (
            (argument, term.force),
            *((f"{argument}: states[{name!r}]", rate) for name, rate in term.states.items()),
        )
    ]
    formulas = [law for law in laws if not _is_function(law)]
    moving = [*places, *(symbols[name] for name in term.states)]
    trait = Trait.OWN if len(formulas) == len(laws) else Trait.OWN | Trait.CODED
    trait |= Trait.STATEFUL if term.states else Trait(0)
    for formula in formulas:
        refuse_uncompiled(formula, set(moving), argument)
        trait |= roughness(formula, moving)
    driven = any(places[2] in formula.free_symbols for formula in formulas)
    for law in laws:
        if _is_function(law):
            seen = _seen if isinstance(law, Hashable) else _seen.__wrapped__
            varies, jumps = seen(law, tuple(_values(term).items()), tuple(term.states))
            driven |= varies
            trait |= Trait.JUMPING if jumps else Trait(0)
    period = _period(term, formulas, places[2], symbols_of(own), argument)
    if driven or term.period is not None:
        trait |= Trait.DRIVEN
    return Own(
        tuple(own), force_law=laws[0], trait=trait, states=tuple(term.states),
        rates=tuple(laws[1:]), period=period,
        domains=tuple((p.name, p.least, p.high) for p in term.declared if p.name in own),
    )  # fmt: skip


def _values(term: Term) -> dict[str, float]:
    """Each parameter at its value of the largest size, since a term may vanish at others."""
    arrays = {name: np.ravel(np.asarray(x, float)) for name, x in term.parameters.items()}
    return {
        name: float(x[np.argmax(np.nan_to_num(np.abs(x), nan=-1.0))]) for name, x in arrays.items()
    }


@functools.lru_cache(maxsize=256)
def _seen(
    function: Callable[..., Any], values: tuple[tuple[str, float], ...], states: tuple[str, ...]
) -> tuple[bool, bool]:
    """Whether a function is seen to depend on time, and to jump."""

    def checked(*args: float, **named: float) -> float:
        found = function(*args, **named)
        if found is None or isinstance(found, str) or np.size(found) != 1:
            raise TypeError(f"returns {found!r:.80}")
        return float(found)

    try:
        return _varies(checked, dict(values), states), _jumps(checked, dict(values), states)
    except TypeError as error:
        name = getattr(function, "__name__", repr(function))
        raise ParameterError(
            f"force: got the function {name}, wants one that takes numbers and returns one: {error}"
        ) from None


def _jumps(
    function: Callable[..., float], values: Mapping[str, float], names: Sequence[str]
) -> bool:
    """Whether a function is seen to jump, as dry friction does where the rate changes sign."""
    states = dict.fromkeys(names, 0.7)

    def along(place: int, x: float) -> float:
        return function(0.4, *((x, 0.6), (0.6, x))[place], **values, **states)

    nodes = np.linspace(*ENDS, INTERVALS + 1).tolist()
    for place in (0, 1):
        line = functools.partial(along, place)
        try:
            heights = list(map(line, nodes))
            ends = zip(nodes, nodes[1:], heights, heights[1:], strict=False)
            if any(is_jump(line, *one) for one in ends):
                return True
        except (ArithmeticError, ValueError):
            continue
    return False


def _varies(
    function: Callable[..., float], values: Mapping[str, float], names: Sequence[str]
) -> bool:
    """Whether a function is seen to depend on time, at a few states."""
    chance = random.Random(1)
    for _ in range(TRIED):
        state = {name: chance.uniform(-2.0, 2.0) for name in names}
        at = [chance.uniform(-2.0, 2.0) for _ in range(2)]
        try:
            now, later = (
                function(t, *at, **values, **state)
                for t in (chance.uniform(0.0, 1.0), chance.uniform(1.0, 9.0))
            )
        except (ArithmeticError, ValueError):
            continue
        if now != later and not (math.isnan(now) and math.isnan(later)):
            return True
    return False


def _period(term: Term, formulas: Sequence[Any], t: Any, own: Any, argument: str) -> Any:
    if term.period is None:
        return period_in_time(formulas, t)
    if isinstance(term.period, (int, float)):
        import sympy as sp

        return sp.Float(number(f"{argument}: period", term.period), 17)
    return take_formula(term.period, own, f"{argument}: period", "declare it in parameters")


def _rebuilt(kind: type[Term], arguments: dict[str, Any]) -> Term:
    return kind(**arguments)


def _is_function(law: Any) -> bool:
    return callable(law) and not hasattr(law, "free_symbols")


def _law(argument: str, law: Any) -> Any:
    """A formula or a function, which may be one of a class."""
    return law.__func__ if isinstance(law, staticmethod) else law


def _named(law: Any) -> str:
    return getattr(law, "__name__", repr(law)) if _is_function(law) else repr(str(law))


def _text(law: Any) -> Any:
    return write_formula(law) if hasattr(law, "free_symbols") else law


def _check(title: str, term: Any, names: Sequence[str]) -> None:
    """Refuse a force, states or names that are none."""
    wants = "a formula, or a function (t, phi, dphi, **parameters)"
    for argument in ("states", "start"):
        if not isinstance(getattr(term, argument), Mapping):
            raise bad(argument, getattr(term, argument), "a mapping by the names of states")
    states = list(term.states)
    if states:
        names_of(f"states of {title}", states)
    for name in (*names, *states):
        refuse_name(f"states of {title}" if name in states else f"parameter of {title}", name)
        if name in OWN_NAMES or (name in states and name in names):
            raise bad(
                f"{title}: name", name, "a name that is not taken by time, state or parameter"
            )
    for name, value in term.start.items():
        if name not in states:
            raise bad("start", name, f"a state of the term: {', '.join(states) or 'it has none'}")
        number(f"start[{name!r}]", value, "a finite number", None)
    for argument, law in (
        ("force", term.force),
        *((f"states[{n!r}]", term.states[n]) for n in states),
    ):
        if not (
            isinstance(law, (str, int, float)) or hasattr(law, "free_symbols") or callable(law)
        ):
            raise bad(argument, law, wants)
        if _is_function(law):
            _check_call(argument, law, (*names, *states))


def _check_call(argument: str, function: Callable[..., Any], names: Sequence[str]) -> None:
    try:
        signature = inspect.signature(function)
    except (TypeError, ValueError):
        return
    try:
        signature.bind(0.0, 0.0, 0.0, **dict.fromkeys(names, 0.0))
    except TypeError as error:
        call = ", ".join(["t", "phi", "dphi", *(f"{name}=..." for name in names)])
        raise ParameterError(
            f"{argument}: got a function with the arguments {signature}, wants one to be called "
            f"as {argument}({call}): {error}"
        ) from None
