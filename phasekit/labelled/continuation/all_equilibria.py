"""All equilibria of problems: by algebra in one unknown, in a window, or as many as are found."""

from __future__ import annotations

import functools
import itertools
from typing import Any

import numpy as np

from phasekit.arrays import Array
from phasekit.bifurcation.continuation.options import ContinuationOptions
from phasekit.errors import warn
from phasekit.laws.trigonometric import Trigonometric
from phasekit.systems.problem import Problem
from phasekit.systems.problem_parts import equilibrium_curve
from phasekit.systems.rests import corners, states_of_cells
from phasekit.systems.system import System

SPREAD = 33
#: Values where f is code, which is asked at many states of each.
FEW = 5
#: Half the sizes of the boxes about the start of a problem that says nothing of its states, and
#: how many starts of Newton's method are tried in each.
HALVES, STARTS = (1.0, 10.0, 100.0), 32
#: Within which two ends of Newton's method are one: of the size of a state; that beside the
#: largest one, or the smallest box of starts, below which it is rounding; and in further steps of
#: the method, which come slowly to zeros of an order up to this.
SAME, NOTHING, ORDER = 1e-6, 1e-9, 4.0


def values_between(
    problem: Problem, parameter: str, span: tuple[float, float], system: System | None
) -> Array | None:
    """Values of a parameter in a span, between all critical values that are known.

    None where all equilibria are found neither by algebra nor in a window.
    """
    if system is None and not solvable(problem) and not has_window(problem):
        return None
    low, high = span
    marks = {low, high, *_critical(system, parameter, span)}
    ordered = np.array(sorted(value for value in marks if low <= value <= high))
    middles = 0.5 * (ordered[1:] + ordered[:-1])
    number = SPREAD if problem.kind == "symbolic" else FEW
    spread = low + (high - low) * (np.arange(number) + 0.5) / number
    return np.concatenate([middles, spread])


def solvable(problem: Problem) -> bool:
    """Whether all equilibria of the equations alone are found by algebra."""
    return len(problem.state) == 1 and problem.kind == "symbolic" and _form(problem) is not None


def has_window(problem: Problem) -> bool:
    """Whether it is said of all states of a law without a clock where they are looked for."""
    names = problem.window.keys() | problem.periods.keys()
    return problem.time is None and not problem.blocks and set(problem.state) <= names


def equilibria_at(
    problem: Problem, parameter: str, values: Array, system: System | None
) -> list[tuple[float, Array]]:
    """All equilibria at values of a parameter, as (value, state); of an angle in one turn."""
    if system is not None or solvable(problem):
        rest = np.zeros(len(problem.state) - 1)
        found = _coordinates_at(problem, parameter, values, system)
        return [(at, np.append(x, rest)) for at, x in found]
    cells = [problem.replace(**{parameter: float(at)}) for at in values]
    states = states_of_cells(cells, *corners(problem, None))
    reasons = {float(at): why for at, (_, why) in zip(values, states, strict=True)}
    doubts = [reasons[at] for at in sorted(reasons)]
    # At one value among others equilibria may meet. Of functions nothing is ever proved.
    doubted = all(doubts) if len(doubts) == 1 else any(map(all, itertools.pairwise(doubts)))
    if problem.kind == "symbolic" and doubted:
        warn(
            f"there may be other equilibria at {sum(map(bool, doubts))} of {len(doubts)} values of "
            f"{parameter} from which branches begin: {next(filter(None, doubts))}",
            RuntimeWarning,
        )
    return [(float(at), x) for at, (xs, _) in zip(values, states, strict=True) for x in xs]


def equilibria_near(problem: Problem, parameter: str, span: tuple[float, float]) -> list[Array]:
    """Equilibria about the start of a problem of formulas that says nothing of its states."""
    curve = equilibrium_curve(problem, parameter, span, ContinuationOptions())
    n = curve.n
    fixed = np.zeros(curve.size)
    fixed[n] = 1.0
    middle = np.array([problem.start.get(name, 0.0) for name in problem.state])
    own = problem.parameters[parameter]
    # Multiples of irrational numbers fill a box evenly.
    evenly = np.outer(np.arange(1, STARTS + 1), np.sqrt(_primes(n))) % 1.0
    ends = list[tuple[Array, Array]]()
    for half in HALVES:
        for start in middle + half * (2.0 * evenly - 1.0):
            point = curve.refine(np.append(start, own), fixed, iterations=30)
            x = point.u[:n]
            if point.converged and np.all(np.abs(x - middle) <= half):
                step = np.linalg.lstsq(point.slopes[:, :n], point.residual[:n], rcond=None)[0]
                ends.append((x, ORDER * np.abs(step)))
    size = np.max(np.abs([x - middle for x, _ in ends]), axis=0) if ends else np.zeros(n)
    apart = SAME * np.maximum(size, NOTHING * max(np.max(size), HALVES[0]))
    found = list[tuple[Array, Array]]()
    for x, off in ends:
        if not any(np.all(np.abs(x - y) <= apart + off + more) for y, more in found):
            found.append((x, off))
    return [x for x, _ in found]


def _primes(n: int) -> Array:
    from sympy import prime

    return np.array([float(prime(i + 1)) for i in range(n)])


def _coordinates_at(
    problem: Problem, parameter: str, values: Array, system: System | None
) -> list[tuple[float, float]]:
    if system is not None:
        from phasekit.labelled.phase_space import equilibria

        phi = equilibria(system.replace(**{parameter: values})).phi.transpose(
            parameter, "equilibrium"
        )
        pairs = zip(values.tolist(), phi.values, strict=True)
        return [(at, float(x)) for at, row in pairs for x in row if np.isfinite(x)]
    return [(at, x) for at in values.tolist() for x in _roots(problem, {parameter: at})]


def _roots(problem: Problem, changes: dict[str, float]) -> list[float]:
    form = _form(problem)
    assert form is not None
    kind, coefficients = form
    at = dict(problem.parameters) | changes
    numbers = [complex(c.subs({s: at[str(s)] for s in c.free_symbols})) for c in coefficients]
    values = np.array(numbers)
    if not np.isfinite(values).all() or not np.any(np.abs(values) > 0.0):
        return []
    roots = np.roots(np.trim_zeros(values, "f"))
    if kind == "polynomial":
        size = np.maximum(np.abs(roots), 1.0)
        return [float(r.real) for r, s in zip(roots, size, strict=True) if abs(r.imag) < 1e-5 * s]
    on_circle = roots[np.abs(np.abs(roots) - 1.0) < 1e-5]
    return [float(angle) for angle in np.angle(on_circle)]


def _critical(system: System | None, parameter: str, span: tuple[float, float]) -> list[float]:
    """Values of a system's parameter at which equilibria meet: all of them, by exact arithmetic."""
    if system is None or not issubclass(system.rung, Trigonometric):
        return []
    declared = {p.name: p for p in system.declared}
    if (
        parameter not in system.formula_inputs()
        or not declared[parameter].valid(np.array(span)).all()
    ):
        return []
    from phasekit.labelled.atlas import branches

    ds = branches(system, parameter, span)
    return [float(value) for value in ds.special_value.values if np.isfinite(value)]


def _form(problem: Problem) -> tuple[str, tuple[Any, ...]] | None:
    field: Any = problem.field  # of a map f(x) - x
    return _form_of(field.expressions[0], problem.state[0], bool(problem.periods), _period(problem))


def _period(problem: Problem) -> float:
    return float(problem.periods.get(problem.state[0], 0.0))


@functools.lru_cache(maxsize=64)
def _form_of(
    expression: Any, state: str, on_circle: bool, period: float
) -> tuple[str, tuple[Any, ...]] | None:
    """Coefficients, highest first, of f as a polynomial of x or of exp(i x), the period 2 pi."""
    import sympy

    x = sympy.Symbol(state, real=True)
    if not on_circle:
        numerator = sympy.fraction(sympy.together(expression))[0]
        if not numerator.is_polynomial(x):
            return None
        return "polynomial", tuple(sympy.Poly(numerator, x).all_coeffs())
    if abs(period - 2.0 * np.pi) > 1e-12:
        return None
    z = sympy.Symbol("z_")
    numerator = sympy.fraction(sympy.together(expression))[0]
    turned = sympy.expand_trig(sympy.expand(numerator)).rewrite(sympy.exp)
    turned = sympy.expand(turned.subs(x, -sympy.I * sympy.log(z)))
    turned = sympy.powsimp(sympy.expand(turned))
    numerator = sympy.fraction(sympy.together(turned))[0]
    if not numerator.is_polynomial(z):
        return None
    return "fourier", tuple(sympy.Poly(numerator, z).all_coeffs())
