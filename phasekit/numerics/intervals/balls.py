"""Ball arithmetic of any precision, by FLINT ([Johansson2017]): digits that doubles do not have.

FLINT's precision belongs to the whole process. So all that depends on it here is one call of C
(`at_precision`): it sets the precision, computes, and puts back what it found, while the
interpreter runs nothing else. No other thread sees the precision, and none can change it meanwhile.
"""

from __future__ import annotations

import functools
import operator
from collections import deque
from collections.abc import Callable, Iterable, Sequence
from functools import partial
from itertools import repeat
from typing import TYPE_CHECKING, Any, TypeAlias

import flint
import numpy as np
from flint import acb, arb

from phasekit.arrays import Array
from phasekit.numerics.intervals.program import ELEMENTARY, NoRule, Program, RealReader
from phasekit.numerics.later import later

if TYPE_CHECKING:
    import sympy as sp
else:
    sp = later("sympy")

#: Balls of an entry, one for each point.
Balls: TypeAlias = list[Any]

#: Bits with which constants are known before they are rounded to doubles.
BITS = 128


def at_precision(bits: int, steps: Sequence[Callable[[], Any]]) -> None:
    """Run functions of C at a precision, in one call, so that no other thread comes between."""
    context: Any = flint.ctx
    before: list[int] = []
    change = partial(setattr, context, "prec")
    back: Any = map(change, before)  # looks for its argument when it is run
    call: Any = operator.call
    try:
        deque(
            map(
                call,
                (
                    partial(before.extend, map(getattr, (context,), ("prec",))),
                    partial(change, bits),
                    *steps,
                    partial(deque(maxlen=0).extend, back),
                ),
            ),
            maxlen=0,
        )
    except BaseException:
        if before:
            context.prec = before[0]
        raise


# ------------------------------------------------------------------------- functions

#: What is computed of the balls of an entry, given as lists that are filled when it is run.
Chain: TypeAlias = Callable[..., Iterable[Any]]
_ONE, _THREE = arb(1), arb(3)


def _method(name: str, *after: Any) -> Chain:
    """A method of balls, with the arguments that come after."""
    return lambda x: map(getattr(arb, name), x, *map(repeat, after))


def _of_order(name: str, order: int) -> Chain:
    return _method(name, arb(order))


def _second_sinc(x: Balls) -> Iterable[Any]:
    """sin(x)/x^2 - cos(x)/x = x/3 0F1(5/2; -x^2/4)."""
    scaled = map(operator.mul, map(operator.mul, x, x), repeat(arb(-0.25)))
    series = map(arb.hypgeom_0f1, scaled, repeat(arb(2.5)))
    return map(operator.truediv, map(operator.mul, x, series), repeat(_THREE))


FUNCTIONS: dict[str, Chain] = {
    **{name: _method(name) for name in ELEMENTARY if name != "Abs"},
    "Abs": lambda x: map(abs, x),
    "Si": _method("si"),
    "Ci": _method("ci"),
    "Ei": _method("ei"),
    "SphericalJ0": _method("sinc"),
    "SphericalJ1": _second_sinc,
    "fresnels": _method("fresnel_s"),
    "fresnelc": _method("fresnel_c"),
    "gamma": _method("gamma"),
    "loggamma": lambda x: map(arb.log, map(abs, map(arb.gamma, x))),
    "airyai": _method("airy_ai"),
    "airybi": _method("airy_bi"),
    "airyaiprime": _method("airy_ai", 1),
    "airybiprime": _method("airy_bi", 1),
    "erfi": _method("erfi"),
    "erfinv": _method("erfinv"),
    "LambertW": _method("lambertw"),
}
#: Functions of a whole order and one argument.
OF_AN_ORDER: dict[str, Callable[[int], Chain]] = {
    **{f"bessel{kind}": partial(_of_order, f"bessel_{kind}") for kind in "jyik"},
    "polygamma": lambda order: (
        lambda x: map(
            operator.attrgetter("real"), map(acb.polygamma, map(acb, x), repeat(acb(order)))
        )
    ),
}
NAMES = frozenset({*FUNCTIONS, *OF_AN_ORDER})


@functools.cache
def chain(name: str, order: int | None = None) -> Chain:
    """A function by its name and order."""
    return FUNCTIONS[name] if order is None else OF_AN_ORDER[name](order)


# ------------------------------------------------------------------------- numbers

_CONSTANTS = {"Pi": arb.pi, "Exp1": arb.const_e, "EulerGamma": arb.const_euler,
              "Catalan": arb.const_catalan}  # fmt: skip


class _ConstantReader(RealReader):
    """Reads what numbers are made of."""

    def is_number(self, e: Any) -> bool:
        return bool(e.is_Rational or e.is_Float or type(e).__name__ in _CONSTANTS)


@functools.lru_cache(maxsize=4096)
def constant(value: Any, bits: int = BITS) -> Any:
    """The ball of an expression without symbols.

    NoRule is raised of what is no finite real number.
    """
    found: Balls = []
    if value.is_Float:
        value = sp.Rational(value)  # what it is, not what it is written as
    if value.is_Rational:
        fraction = map(operator.truediv, [arb(int(value.p))], [arb(int(value.q))])
        at_precision(bits, [partial(found.extend, fraction)])
    elif (make := _CONSTANTS.get(type(value).__name__)) is not None:
        at_precision(bits, [partial(found.extend, map(operator.call, [make]))])
    else:
        reader = _ConstantReader((), NAMES)
        whole = value.expand(func=True)  # the golden ratio
        reader.program.outputs = [reader.read(whole)]
        (found,) = run(reader.program, [], bits)
    if not found[0].is_finite():
        raise NoRule(str(value))
    return found[0]


def _root(exponent: Any, bits: int) -> Chain:
    """A real power of what is not negative."""
    if exponent.is_Rational and exponent.p > 0 and exponent.q <= 64:
        p, q = int(exponent.p), int(exponent.q)
        return lambda x: map(operator.pow, map(arb.root, x, repeat(q)), repeat(p))
    return lambda x: map(operator.pow, x, repeat(constant(exponent, bits)))


def _power(n: int) -> Chain:
    if n > 0:
        return lambda x: map(operator.pow, x, repeat(n))
    return lambda x: map(operator.truediv, repeat(_ONE), map(operator.pow, x, repeat(-n)))


_JOINS: dict[str, Chain] = {
    "add": partial(map, operator.add),
    "multiply": partial(map, operator.mul),
    "negative": partial(map, operator.neg),
}


def run(program: Program, inputs: Sequence[Balls], bits: int) -> list[Balls]:
    """Results of a program at points, the balls of each input in one list."""
    count = len(inputs[0]) if inputs else 1
    entries, steps = list(inputs), []
    for name, places, own in program.operations:
        if name == "number":
            entries.append([constant(own, bits)] * count)
            continue
        arguments = [entries[place] for place in places]
        values: Iterable[Any]
        if name in _JOINS:
            values = _JOINS[name](*arguments)
        elif name == "power":
            values = _power(own)(*arguments)
        elif name == "root":
            values = _root(own, bits)(*arguments)
        else:
            values = chain(name, own)(*arguments)
        out: Balls = []
        steps.append(partial(out.extend, values))
        entries.append(out)
    at_precision(bits, steps)
    return [entries[place] for place in program.outputs]


# ------------------------------------------------------------------------- doubles


def balls(low: Array, high: Array) -> Balls:
    """Balls that hold intervals of doubles; of points exactly these."""
    middle = np.where(low == high, low, 0.5 * low + 0.5 * high)
    radius = np.maximum(high - middle, middle - low) * (1.0 + 2.0**-50)
    return list(map(arb, middle.tolist(), radius.tolist()))


def ends(values: Balls) -> tuple[Array, Array]:
    """Doubles that hold balls; infinite where these are not finite."""
    low: Balls = []
    high: Balls = []
    at_precision(
        53,
        [
            partial(low.extend, map(arb.lower, values)),
            partial(high.extend, map(arb.upper, values)),
        ],
    )
    found = []
    for balls_, away in ((low, -np.inf), (high, np.inf)):
        end = np.array(list(map(float, balls_)))
        end[np.isnan(end)] = away
        # Doubles next to 0, and beyond the largest, are rounded to the nearest.
        coarse = (np.abs(end) < 1e-307) | (end == -away)
        found.append(np.where(coarse, np.nextafter(end, away), end))
    return found[0], found[1]


def enclose(function: Chain, low: Array, high: Array, bits: int = 64) -> tuple[Array, Array]:
    """Bounds of a function over finite intervals; infinite where nothing is known."""
    found: Balls = []
    given = balls(low, high)
    at_precision(bits, [partial(found.extend, function(given))])
    return ends(found)


def double_doubles(values: Balls, bits: int) -> tuple[Array, Array, Array]:
    """The middles of balls as sums of two doubles, and how far the balls reach from these."""
    first = list(map(float, values))
    rest: Balls = []
    exact = list(map(arb, first))
    at_precision(bits, [partial(rest.extend, map(operator.sub, values, exact))])
    second = list(map(float, rest))
    away: Balls = []
    below = list(map(arb, second))
    at_precision(bits, [partial(away.extend, map(abs, map(operator.sub, rest, below)))])
    return np.array(first), np.array(second), ends(away)[1]
