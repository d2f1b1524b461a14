"""The law of a perturbed motion as machine code: rates of eight states at once.

The code takes the state (coordinate, rate, and tangent vectors), the time with what is prescribed
of it, and parameters: the coefficients (A, B, C) where they do not vary, else the parameters of
the potential, then damping and drive.
"""

from __future__ import annotations

import functools
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from phasekit.arrays import Array
from phasekit.errors import ParameterError
from phasekit.laws.ladder import Conservative, Routhian, Routhians
from phasekit.laws.perturbed import PerturbedLaw
from phasekit.laws.terms import STANDARD, Drag, Forcing, Instant
from phasekit.laws.trigonometric import Trigonometric
from phasekit.numerics.kept_answers import Answer, is_kept, kept_answer
from phasekit.numerics.slopes import jacobian

#: Which array of the code an entry is in.
_STATE, _PARAMETER, _TIME = 0, 1, 2
#: Terms that hold nothing but the names of their parameters.
PLAIN = (*map(type, STANDARD), Forcing)


@dataclass(frozen=True)
class Rates:
    """Machine code of a law, and what it takes."""

    address: int
    names: tuple[str, ...]
    """Its parameters: names of the law's, of its coefficients, or of the torque of omega'."""
    kink: int
    """Place of the sign of the rate among the parameters; -1 without quadratic damping."""
    series: int
    """Machine code of steps by Taylor series; 0: none is asked for, or the law has none."""
    room: int
    """Coefficients of a step."""

    @property
    def steps(self) -> tuple[int, int, int | None]:
        """What the kernels take of it: one or other machine code for the steps.

        Without an address they are compiled without the Runge-Kutta method.
        """
        return self.series, self.room, None if self.series else self.address


def rates_of(
    law: PerturbedLaw,
    values: Mapping[str, Array],
    tangents: int = 0,
    order: int = 0,
) -> tuple[Rates, Array]:
    """Return the machine code of a law, and its parameters, of shape (parameters, cells)."""
    quadratic = bool(np.any(np.asarray(values["quadratic"]) != 0.0))
    same: Any = _Same(law.base)
    one = replace(law, base=same, names=(), unit="")
    code = _compiled(one, quadratic, tangents, order)
    known: dict[str, Any] = dict(values)
    if {"A", "B", "C"} <= set(code.names) and isinstance(law.base, Trigonometric):
        inputs = {name: np.asarray(values[name], float) for name in law.inputs}
        with np.errstate(all="ignore"):
            known.update(zip("ABC", law.base.coefficients(inputs), strict=True))
    if _EULER[0] in code.names:
        euler = law.euler({name: np.asarray(value, float) for name, value in values.items()})
        known.update(zip(_EULER, euler, strict=True))
    elif isinstance(law.base, Routhians):
        known.update({f"({n})": x for n, x in law.base.constants_of(values).items()})
    known["(sign)"] = 0.0
    columns = [np.atleast_1d(np.asarray(known[name], float)) for name in code.names]
    return code, np.stack(np.broadcast_arrays(*columns))


def order_of(rtol: float) -> int:
    """Order of Taylor series that takes least time, as measured; even, to be one of few.

    Examples
    --------
    >>> [order_of(rtol) for rtol in (1e-4, 1e-10, 1e-14)]
    [10, 16, 20]
    """
    return 2 * round(0.5 * (4.5 - 0.5 * float(np.log(rtol))))


#: Names that no parameter has, of what is computed of them.
_EULER = ("(euler_0)", "(euler_s)", "(euler_c)")


@dataclass(frozen=True, eq=False)
class _Same:
    """A law of a potential, of which there is one for equal formulas."""

    base: Conservative | Routhian

    def __eq__(self, other: object) -> bool:
        return isinstance(other, _Same) and self.base is other.base

    def __hash__(self) -> int:
        return id(self.base)


@functools.lru_cache(maxsize=128)
def _compiled(law: Any, quadratic: bool, tangents: int, order: int) -> Rates:
    """Machine code of a law, whose base is known as the `_Same`: kept, or made now."""
    question = _stated(law)
    if question is None or not is_kept():
        return _compile(law, quadratic, tangents, order)

    def find() -> Answer:
        code = _compile(law, quadratic, tangents, order)
        addresses = (code.address, code.series)[: 2 if code.series else 1]
        return [code.names, code.kink, code.room], addresses

    value, addresses = kept_answer([question, quadratic, tangents, order], find)
    names, kink, room = value
    return Rates(addresses[0], tuple(names), kink, (*addresses, 0)[1], room)


def _stated(law: Any) -> list[Any] | None:
    """All that the code of a law depends on, where that is the coefficients and plain terms."""
    if not isinstance(law.base.base, Trigonometric) or law.varying:
        return None
    if any(type(term) not in PLAIN for term in law.terms):
        return None
    return ["rates", law.inputs, [[type(term).__name__, term.names] for term in law.terms]]


def _compile(law: Any, quadratic: bool, tangents: int, order: int) -> Rates:
    import sympy as sp

    from phasekit.numerics.lanes import compile_lanes

    base = law.base.base
    x, v, t, w, dw = (sp.Symbol(f"_{name}", real=True) for name in "xvtwd")
    used: dict[str, Any] = {}

    def parameter(name: str) -> Any:
        return used.setdefault(name, sp.Symbol(f"_p{len(used)}", real=True))

    at = Instant(x, v, t, parameter, lambda: parameter("(sign)") * v, (w, dw))
    if isinstance(base, Trigonometric) and not law.varying:
        A, B, C = map(parameter, "ABC")
        slope = (B - A * sp.cos(x)) * sp.sin(x) - C * sp.cos(x)
    elif isinstance(base, Routhians):
        constants = {base.coordinate: x, **{n: parameter(f"({n})") for n in base.constants}}
        slope = 0
    else:
        symbols = {name: law.parameter_at(name, at) for name in law.inputs}
        assert isinstance(base, Conservative)
        slope = base.gradient_formula({**symbols, base.coordinate: x})
    smooth = tuple({type(term) for term in law.terms} - {Drag})
    force = law.force(at, smooth) - slope + law.euler_formula(at, _EULER)
    if quadratic:
        force += law.force(at, (Drag,))
    kink = list(used).index("(sign)") if "(sign)" in used else -1
    if isinstance(base, Routhians):
        force = base.acceleration_formula(constants, v, force)
    expressions = [v, force]
    places = {x: (_STATE, 0), v: (_STATE, 1), t: (_TIME, 0), w: (_TIME, 1), dw: (_TIME, 2)}
    (slopes,), pairs = jacobian([force], [x, v]), [(x, v)]
    for i in range(tangents):
        pair = sp.symbols(f"_u{i} _w{i}", real=True)
        pairs.append(pair)
        expressions += [pair[1], slopes[0] * pair[0] + slopes[1] * pair[1]]
        places.update({symbol: (_STATE, 2 + 2 * i + j) for j, symbol in enumerate(pair)})
    places.update({symbol: (_PARAMETER, i) for i, symbol in enumerate(used.values())})
    try:
        address = compile_lanes(expressions, places)
    except ParameterError as error:
        raise ParameterError(f"system: {error}") from None
    series = room = 0
    if order and kink < 0 and law.prescribed is None:
        parameters = {symbol: i for i, symbol in enumerate(used.values())}
        series = series_of(order, t, pairs, expressions[1::2], parameters)
        room = len(pairs) * (order + 1)
    return Rates(address, tuple(used), kink, series, room)


def series_of(
    order: int,
    time: Any,
    chains: Sequence[tuple[Any, ...]],
    forces: Sequence[Any],
    parameters: Mapping[Any, int],
    width: int = 1,
) -> int:
    """Machine code of steps by series, of a law that has them; 0 of others."""
    from phasekit.motion.kernels.taylor import Law, compile_steps
    from phasekit.numerics.series import has_series

    varying = {time, *(symbol for chain in chains for symbol in chain)}
    if not all(has_series(force, varying) for force in forces):
        return 0
    return compile_steps(Law(time, chains, forces, parameters, width), order)
