"""Problems from XPPAUT's files ([Ermentrout2002]): equations, parameters, starts and windows."""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any, NamedTuple

from phasekit.errors import ParameterError
from phasekit.labels.arguments import bad
from phasekit.laws.formulas import is_name, read_formula
from phasekit.laws.xppaut import parser
from phasekit.systems.ode_file import Statement, refuse, statements
from phasekit.systems.waves import period_in_time

#: What the time is called in .ode files.
TIME = "t"
_NUMBER = re.compile(r"[-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?")
_NAMES = re.compile(r"[a-z_]\w*")
#: Names that are never those of a file.
OWN = ("pi", TIME)


class OdeFile(NamedTuple):
    """What an .ode file says."""

    problem: Any
    options: dict[str, str]
    """Its options (``@``) by name, in small letters."""


def read_ode(path: Any, make: Callable[..., Any]) -> OdeFile:
    """Read an .ode file; `make` is `Problem`."""
    try:
        place = Path(path)
        text = place.read_text(encoding="utf-8", errors="replace")
    except (TypeError, ValueError, OSError) as error:
        why = getattr(error, "strerror", None) or str(error)
        raise bad("path", path, "the path of an .ode file", why) from None
    found = list(statements(text, place.name))
    return _Reader(found, place.name).file(make)


class _Reader:
    """Names of a file, and what they stand for; letters are not told apart by case."""

    def __init__(self, found: list[Statement], file: str) -> None:
        import sympy as sp

        self.name = file
        self.of_kind: dict[str, list[Statement]] = {}
        for one in found:
            self.of_kind.setdefault(one.kind, []).append(one)
        rates, steps = self.of_kind.get("rate", []), self.of_kind.get("step", [])
        if rates and steps:
            refuse(steps[0].where, f"the step of {steps[0].name}", "rates alone, or steps alone")
        self.equations = rates or steps
        if not self.equations:
            raise ParameterError(f"{file}: got no equation, wants one such as x'=-x")
        options = [pair for one in self.of_kind.get("options", []) for pair in _pairs(one, "")]
        self.folds = [value for name, value, _ in options if name.lower() == "fold"]
        self.options = {name.lower(): value for name, value, _ in options}
        self.discrete = bool(steps) or self.options.get("meth", "").lower().startswith("discrete")
        self.spelled: dict[str, str] = {}
        self.states = [self.declare(one.name, one.where) for one in self.equations]
        self.parameters: dict[str, float] = {}
        for one in self.of_kind.get("par", []):
            for name, value, where in _pairs(one, "0"):
                self.parameters[self.declare(name, where)] = _number(name, value, where)
        #: What names stand for, by small letters.
        self.known: dict[str, Any] = {
            low: sp.Symbol(name, real=True) for low, name in self.spelled.items()
        }
        self.known[TIME] = sp.Symbol(TIME, real=True)
        #: Wiener processes by name, and where they are declared.
        self.wieners = {
            name.lower(): where
            for one in self.of_kind.get("wiener", [])
            for name, _, where in _pairs(one, "0")
        }
        for name, where in self.wieners.items():
            if name in self.known:
                refuse(where, f"{name} once more", "a name that is not taken")
            self.known[name] = sp.Symbol(name, real=True)
        self.waiting = {
            one.name.lower(): one
            for kind in ("derived", "fixed", "function")
            for one in self.of_kind.get(kind, [])
        }
        for one in self.of_kind.get("number", []):
            for name, value, where in _pairs(one, "0"):
                number = sp.Float(_number(name, value, where))
                self.known[name.lower()] = number if number % 1 else sp.Integer(int(number))
        for low, one in self.waiting.items():
            if low in self.known:
                refuse(one.where, f"{one.name} once more", "a name that is not taken")

    def declare(self, name: str, where: str) -> str:
        """The name of a state or parameter as it is spelled where it is declared."""
        low = name.lower()
        if low in self.spelled or low in OWN:
            refuse(where, f"{name} once more", "a name that is not taken")
        self.spelled[low] = name if is_name(name) else f"{name.strip('_')}_"
        return self.spelled[low]

    def state(self, name: str, where: str) -> str:
        """A state by its name in any letters."""
        found = self.spelled.get(name.lower())
        if found not in self.states:
            refuse(where, f"a start of {name}, which is no state", ", ".join(self.states))
        return str(found)

    # ------------------------------------------------------------------ formulas

    def formula(self, text: str, where: str, own: Mapping[str, Any] | None = None) -> Any:
        """A formula of states, parameters and time, what names stand for put in."""
        own = own or {}
        for name in dict.fromkeys(_NAMES.findall(text.lower())):
            if name in self.waiting and name not in own:
                self.resolve(name)
        known = {**self.known, **own}

        def shift(name: str, by: int) -> str:
            found = self.shifted(name, by)
            if found in self.waiting:
                self.resolve(found)
            known[found] = self.known[found]
            return found

        return read_formula(text, known, where, read=parser(shift))

    def resolve(self, name: str) -> None:
        """Read what a name stands for: a formula or a function."""
        import sympy as sp

        one = self.waiting.pop(name)
        self.known.pop(name, None)
        variables = {a.lower(): sp.Dummy(a, real=True) for a in one.arguments}
        if f"{name}(" in re.sub(r"\s", "", one.text.lower()) or (
            not variables and name in _NAMES.findall(one.text.lower())
        ):
            refuse(one.where, f"{one.name} in its own formula", "one of other names")
        found = self.formula(one.text, one.where, variables)
        self.known[name] = sp.Lambda(tuple(variables.values()), found) if variables else found

    def shifted(self, name: str, by: int) -> str:
        """The state, or fixed quantity, so many places after another."""
        for kind in ("fixed", "rate", "step"):
            lows = [one.name.lower() for one in self.of_kind.get(kind, [])]
            if name in lows and 0 <= lows.index(name) + by < len(lows):
                return lows[lows.index(name) + by]
        raise ParameterError(f"{self.name}: got shift({name}, {by}), wants a state and a place")

    # ------------------------------------------------------------------ the problem

    def file(self, make: Callable[..., Any]) -> OdeFile:
        """The problem, and the options."""
        import sympy as sp

        t = self.known[TIME]
        f = [self.formula(one.text, one.where) for one in self.equations]
        f, noise = self.noise(f)
        observables = {}
        for one in self.of_kind.get("aux", []):
            name, equals, text = one.text.partition("=")
            if not equals:
                refuse(one.where, repr(one.text), "a name and a formula, such as aux e=x^2/2")
            observables[re.sub(r"\W", "_", name.strip())] = self.formula(text, one.where)
        for name in list(self.waiting):  # what nothing uses may still be wrong
            if name in self.waiting:
                self.resolve(name)
        more: dict[str, Any] = {}
        if any(t in one.free_symbols for one in f):
            more["time"] = TIME
            period = period_in_time(f, t)
            values = {
                self.known[low]: self.parameters[name]
                for low, name in self.spelled.items()
                if name in self.parameters
            }
            if period is not None:
                length = period.subs(values)
                negative = length.is_number and length < 0
                period = -period if negative else period
                more["period"] = period if _is_positive(sp.Abs(length)) else None
        problem = make(
            f, self.states, self.parameters, map=self.discrete, start=self.starts(),
            window=self.window(), periods=self.periods(), observables=observables,
            noise=noise, **more,
        )  # fmt: skip
        return OdeFile(problem, self.options)

    def noise(self, f: list[Any]) -> tuple[list[Any], dict[str, Any] | None]:
        """The equations without their Wiener processes, and the amplitudes of these."""
        amplitudes: dict[str, Any] = {}
        parameters = {self.known[low] for low, n in self.spelled.items() if n in self.parameters}
        for name, where in self.wieners.items():
            symbol = self.known[name]
            rates = [i for i, one in enumerate(f) if symbol in one.free_symbols]
            if self.discrete and rates:
                refuse(where, f"{name}, noise in a map", "a map without noise")
            if len(rates) > 1:
                names = ", ".join(self.states[i] for i in rates)
                refuse(where, f"{name} in the rates of {names}", "a process of its own for each")
            for i in rates:
                size = f[i].diff(symbol)
                if size.free_symbols - parameters:
                    refuse(where, f"{name} times {size}", "noise times a formula of parameters")
                if self.states[i] in amplitudes:
                    refuse(where, f"{name} in the rate of {self.states[i]}", "one process there")
                amplitudes[self.states[i]] = size
                f = [*f[:i], f[i].subs(symbol, 0), *f[i + 1 :]]
        return f, amplitudes or None

    def starts(self) -> dict[str, float]:
        """States at the start; those of which nothing is said begin at 0."""
        found = dict.fromkeys(self.states, 0.0)
        for one in self.of_kind.get("init", []):
            for name, value, where in _pairs(one, "0"):
                found[self.state(name, where)] = _number(name, value, where)
        values = {self.known[low]: self.parameters.get(name) for low, name in self.spelled.items()}
        for one in self.of_kind.get("start", []):
            formula = self.formula(one.text, one.where)
            number = formula.subs({s: v for s, v in values.items() if v is not None})
            if not number.is_number or not number.is_finite:
                refuse(one.where, f"a start {one.text!r}", "a number, or a formula of parameters")
            found[self.state(one.name, one.where)] = float(number)
        return found

    def window(self) -> dict[str, tuple[float, float]]:
        """Ranges of states that are axes of the first picture."""
        found = {}
        for axis in "xy":
            name = self.options.get(f"{axis}p") or self.options.get(f"{axis}plot") or ""
            state = self.spelled.get(name.lower())
            ends = [self.options.get(f"{axis}{end}", "") for end in ("lo", "hi")]
            if state in self.states and all(map(_NUMBER.fullmatch, ends)):
                low, high = map(float, ends)
                if low < high:
                    found[str(state)] = (low, high)
        return found

    def periods(self) -> dict[str, float]:
        """Periods of states that XPPAUT folds."""
        length = self.options.get("tor_per", repr(2.0 * math.pi))
        period = float(length) if _NUMBER.fullmatch(length) else 2.0 * math.pi
        turn = 2.0 * math.pi if abs(period - 2.0 * math.pi) < 1e-4 else period
        names = [self.spelled.get(name.lower()) for name in self.folds]
        return {str(name): turn for name in names if name in self.states}


def _is_positive(number: Any) -> bool:
    """Whether a number is one, and > 0."""
    try:
        return 0.0 < float(number) < math.inf
    except TypeError:
        return False


def _pairs(one: Statement, default: str) -> list[tuple[str, str, str]]:
    """Names with the text of their values, and where they stand."""
    found = []
    for part in re.split(r"[,\s]+", re.sub(r"\s*=\s*", "=", one.text).strip()):
        name, equals, value = part.partition("=")
        if name and (equals or default):
            found.append((name, value if equals else default, one.where))
    return found


def _number(name: str, text: str, where: str) -> float:
    """A number as it is written; no formula, of which XPPAUT reads the beginning alone."""
    if not _NUMBER.fullmatch(text):
        refuse(where, f"{name}={text}", "a number; write a formula as a line of its own, !name=...")
    return float(text)
