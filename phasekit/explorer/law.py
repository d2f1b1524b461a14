"""A system's law as JavaScript: printed from the law that the library itself computes with."""

from __future__ import annotations

from typing import Any

from phasekit.explorer import javascript
from phasekit.laws.trigonometric import Trigonometric
from phasekit.mechanics import disk_states
from phasekit.phase.numerical.formula import Shape
from phasekit.systems.system import System
from phasekit.table.loads import BORNE


def law_of(system: System) -> str:
    r"""Write a system's law as a JavaScript object.

    Of a trigonometric system its coefficients of the parameters, of any other potential V, V' and
    V''; parameters are numbered as they are declared.

    >>> import phasekit as pk
    >>> print(law_of(pk.Pendulum(length=1.0)).replace("\n", " "))
    {kind: "trigonometric", products: (p) => { return [0, p[1], 0, p[0]]; }, loads: null}
    """
    law = system.law
    return _trigonometric(system, law) if isinstance(law, Trigonometric) else _potential(law)


def is_machine(system: System) -> bool:
    """Whether a system has all that the forces at its bearings need."""
    return set(BORNE) <= {parameter.name for parameter in system.declared}


def _trigonometric(system: System, law: Trigonometric) -> str:
    import sympy as sp

    names: dict[Any, str] = {}
    values: dict[str, Any] = {}
    for i, parameter in enumerate(system.declared):
        symbol = sp.Symbol(parameter.name, real=True)
        names[symbol] = f"p[{i}]"
        values[parameter.name] = symbol
        if parameter.name in law.angles:
            values[parameter.name] = turn = _turn(parameter.name)
            names[turn[0]], names[turn[1]] = f"sine(p[{i}])", f"cosine(p[{i}])"
    products = [sp.sympify(part) for part in law.products(values)]
    text = javascript.function(products, names, "p")
    loads = _loads(values, names, law) if is_machine(system) else "null"
    return f'{{kind: "trigonometric",\nproducts: {text},\nloads: {loads}}}'


def _turn(name: str) -> tuple[Any, Any, Any]:
    import sympy as sp

    return sp.Symbol(f"sin_{name}", real=True), sp.Symbol(f"cos_{name}", real=True), sp.Integer(1)


class _Machine:
    """The table of `phasekit.mechanics.disk_states` with symbols for numbers."""

    def __init__(self, rows: dict[int, Any]) -> None:
        self.rows = rows

    def __getitem__(self, key: tuple[int, int]) -> Any:
        return self.rows[key[0]]


def _loads(values: dict[str, Any], names: dict[Any, str], law: Trigonometric) -> str:
    """Forces at both bearings of the shaft, (u, v) of A2 and B2 and along n2, in free motion."""
    import sympy as sp

    s, c, dphi = sp.symbols("s c dphi", real=True)
    (sine, cosine, _), e, a, r, omega1, m, g, span = (values[name] for name in BORNE)
    A, B, C, scale = law.products(values)
    ju, thin = m * (r * r / 4 + e * e), m * r * r / 4
    table: Any = _Machine(
        {
            disk_states.A: A / scale,
            disk_states.B: B / scale,
            disk_states.C: C / scale,
            disk_states.MIXING: sp.Integer(0),
            disk_states.OMEGA: omega1,
            disk_states.ARM: a,
            disk_states.ACROSS: e * sine,
            disk_states.ALONG: e * cosine,
            disk_states.JU: ju,
            disk_states.JV: thin + ju * cosine * cosine,
            disk_states.JN: thin + ju * sine * sine,
            disk_states.JVN: ju * sine * cosine,
            disk_states.MASS: m,
            disk_states.WEIGHT: m * g,
            disk_states.SPAN: span,
        }
    )
    zero: Any = sp.Integer(0)
    ddphi = disk_states.acceleration(0, s, c, zero, table)
    half_u, half_v, couple_u, couple_v, axial = disk_states.pair(0, s, c, dphi, ddphi, zero, table)
    parts = []
    for sign in (1, -1):
        hold = m * g / 2 * (1 + sign * e * cosine / span)
        parts += [half_u + sign * couple_u + hold * s, half_v + sign * couple_v + hold * c]
    known = {**names, s: "Math.sin(phi)", c: "Math.cos(phi)", dphi: "dphi"}
    return javascript.function([*parts, axial], known, "p, phi, dphi")


def _potential(formula: Any) -> str:
    import sympy as sp

    x = sp.Symbol(formula.coordinate, real=True)
    symbols = {symbol.name: symbol for symbol in formula.expression.free_symbols}
    x = symbols.get(formula.coordinate, x)
    names = {x: "x"}
    for i, name in enumerate(formula.names):
        names[symbols.get(name, sp.Symbol(name, real=True))] = f"p[{i}]"
    slope = sp.diff(formula.expression, x)
    parts = {
        "potential": formula.expression,
        "slope": slope,
        "bend": sp.diff(slope, x),
    }
    lines = [
        f"{name}: {javascript.function([part], names, 'x, p')}" for name, part in parts.items()
    ]
    powers = "null"
    if formula.shape is Shape.POLYNOMIAL:
        coefficients = sp.Poly(sp.expand(slope), x).all_coeffs()[::-1]
        text = javascript.function([*coefficients, sp.Integer(0)], names, "p")
        powers = text  # the zero at its end makes it a list always
    ends = formula.interval or (-float("inf"), float("inf"))
    lines += [
        f"powers: {powers}",
        f"joints: [{', '.join(joints(formula.expression, x, names))}]",
        f"period: {'null' if formula.period is None else javascript.number(formula.period)}",
        f"ends: [{javascript.number(ends[0])}, {javascript.number(ends[1])}]",
        "loads: null",
    ]
    return '{kind: "potential",\n' + ",\n".join(lines) + "}"


def joints(expression: Any, x: Any, names: dict[Any, str]) -> list[str]:
    """Write functions that vanish where a formula goes over to another branch.

    >>> import sympy
    >>> x = sympy.Symbol("x", real=True)
    >>> joints(abs(x - 1) + x**2, x, {x: "x"})
    ['(x, p) => { return (-1)+x; }']
    """
    import sympy as sp

    found = []
    for part in sp.preorder_traversal(expression):
        if isinstance(part, (sp.Abs, sp.sign, sp.Heaviside)):
            found.append(part.args[0])
        elif isinstance(part, (sp.Max, sp.Min)):
            found += [one - part.args[0] for one in part.args[1:]]
            found += [one - part.args[1] for one in part.args[2:]]
        elif part.is_Relational:
            found.append(part.lhs - part.rhs)
    moving = [part for part in dict.fromkeys(found) if part.has(x)]
    return sorted(javascript.function([part], names, "x, p") for part in moving)
