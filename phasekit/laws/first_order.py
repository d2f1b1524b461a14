"""A law with terms as first-order equations: formulas, or a function where a term is one."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from fractions import Fraction
from typing import Any

from phasekit.laws.equations import Rates
from phasekit.laws.formulas import symbols_of
from phasekit.laws.ladder import Trait
from phasekit.laws.perturbed import PerturbedLaw
from phasekit.laws.terms import Instant

#: Names of the parts of the torque of a frame whose angular velocity varies.
_EULER = ("(euler_0)", "(euler_s)", "(euler_c)")
#: Greatest whole number in the ratio of two frequencies that have a common period.
WHOLE = 64


def first_order(
    law: PerturbedLaw,
    names: tuple[str, str],
    values: Mapping[str, float],
    **more: Any,
) -> Rates:
    """The equations of coordinate, rate and own states, under these names of the first two."""
    rates = FirstOrder(law, names)
    clock = rates.time if rates.is_driven else None
    formulas = rates.formulas()
    f: Any = tuple(formulas) if not rates.calls else rates
    turn = law.base.period
    return Rates(
        rates.states, law.names, f, {} if turn is None else {names[0]: turn}, clock,
        period=None if clock is None else period_of(law, values), **more,
    )  # fmt: skip


@dataclass(eq=False)
class FirstOrder:
    """The right-hand side of a law with terms; called, where it has no formulas."""

    law: PerturbedLaw
    names: tuple[str, str]
    #: Functions of the terms, and the names of what they take beside time, coordinate and rate.
    calls: list[tuple[Any, tuple[str, ...]]] = field(default_factory=list, init=False)
    _compiled: Any = field(default=None, init=False)

    @property
    def states(self) -> tuple[str, ...]:
        """Names of all states."""
        return (*self.names, *self.law.states)

    @property
    def is_driven(self) -> bool:
        """Whether it depends on time."""
        return bool(self.law.varying) or any(Trait.DRIVEN in t.trait for t in self.law.terms)

    @property
    def time(self) -> str:
        """What the time is called."""
        taken = {*self.states, *self.law.names}
        return next(name for name in ("t", "time", "_t") if name not in taken)

    def formulas(self) -> list[Any]:
        """The rates of all states, with symbols in place of functions."""
        import sympy as sp

        law = self.law
        of = symbols_of([*self.states, *law.names, self.time])
        x, v = (of[name] for name in self.names)
        self.calls = []

        def coded(call: Any) -> Any:
            if call not in self.calls:
                self.calls.append(call)
            return sp.Symbol(f"(f{self.calls.index(call)})", real=True)

        euler = {}
        if law.rate is not None and law.rate.parameter in law.varying:
            euler = dict(zip(_EULER, law.euler(of), strict=True))
        at = Instant(x, v, of[self.time], lambda n: euler[n] if n in euler else of[n],
                     lambda: sp.Abs(v), coded=coded)  # fmt: skip
        push = law.force(at) + law.euler_formula(at, _EULER)
        used = {name: law.parameter_at(name, at) for name in law.inputs}
        acceleration = law.base.acceleration_formula({**used, law.base.coordinate: x}, v, push)
        own = [term.value(rate, at) for term in law.own for rate in term.rates]
        return [v, acceleration, *own]

    def __call__(self, x: Any, **values: Any) -> list[float]:
        """The rates at a state, of parameters by name and the time."""
        if self._compiled is None:
            self._compiled = self._function()
        function, names, time = self._compiled
        known = {**values, **dict(zip(self.states, map(float, x), strict=True))}
        t = float(known.get(time, 0.0))
        place = [known[name] for name in self.names]
        found = [float(call(t, *place, **{n: known[n] for n in more})) for call, more in self.calls]
        given = [known.get(name, 0.0) for name in names]  # what is not given does not enter
        return [float(rate) for rate in function(*given, t, *found)]

    def _function(self) -> tuple[Callable[..., Any], list[str], str]:
        import sympy as sp

        formulas, names = self.formulas(), [*self.states, *self.law.names]
        calls = [sp.Symbol(f"(f{i})", real=True) for i in range(len(self.calls))]
        used = [*symbols_of([*names, self.time]).values(), *calls]
        dummies = [sp.Dummy() for _ in used]
        swap = dict(zip(used, dummies, strict=True))
        function = sp.lambdify(dummies, [sp.sympify(f).xreplace(swap) for f in formulas], "numpy")
        return function, names, self.time

    def __eq__(self, other: object) -> bool:
        """Whether it is the same law under the same names."""
        if not isinstance(other, FirstOrder):
            return NotImplemented
        return (self.law, self.names) == (other.law, other.names)

    def __hash__(self) -> int:
        """Hash of the law and the names."""
        return hash((self.law, self.names))

    def __getstate__(self) -> tuple[Any, ...]:
        """Travel as what it is made of; the function is made anew."""
        return self.law, self.names, self.calls

    def __setstate__(self, state: tuple[Any, ...]) -> None:
        """Restore it."""
        self.law, self.names, self.calls = state
        self._compiled = None


def period_of(law: PerturbedLaw, values: Mapping[str, float]) -> Any:
    """The common period of all that varies with time, as a formula; None where there is none."""
    import sympy as sp

    found = law.frequencies()
    if not found:
        return None
    of = symbols_of(law.names)
    numbers = {of[name]: value for name, value in values.items() if name in of}
    ratios = [ratio_of(float((one / found[0]).subs(numbers))) for one in found]
    if any(ratio is None for ratio in ratios):
        return None
    turns = math.lcm(*(ratio.denominator for ratio in ratios if ratio is not None))
    return 2 * turns * sp.pi / found[0]


def ratio_of(ratio: float) -> Fraction | None:
    """A ratio as a fraction of small whole numbers; None where it is none."""
    near = Fraction(ratio).limit_denominator(WHOLE) if math.isfinite(ratio) else Fraction(0)
    return near if near > 0 and abs(ratio - near) <= 1e-12 * ratio else None
