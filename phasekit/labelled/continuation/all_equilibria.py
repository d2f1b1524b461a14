"""All equilibria of problems in one unknown, where algebra finds them."""

from __future__ import annotations

import functools
from typing import Any

import numpy as np
import numpy.typing as npt

from phasekit.laws.trigonometric import Trigonometric
from phasekit.systems.problem import Problem
from phasekit.systems.system import System

FloatArray = npt.NDArray[np.float64]

SPREAD = 33


def values_between(
    problem: Problem, parameter: str, span: tuple[float, float], system: System | None
) -> FloatArray | None:
    """Values of a parameter in a span, between all critical values that are known.

    None where equilibria are not found by algebra.
    """
    if system is None and not solvable(problem):
        return None
    low, high = span
    marks = {low, high, *_critical(system, parameter, span)}
    ordered = np.array(sorted(value for value in marks if low <= value <= high))
    middles = 0.5 * (ordered[1:] + ordered[:-1])
    spread = low + (high - low) * (np.arange(SPREAD) + 0.5) / SPREAD
    return np.concatenate([middles, spread])


def solvable(problem: Problem) -> bool:
    """Whether all equilibria of the equations alone are found by algebra."""
    return len(problem.state) == 1 and problem.kind == "symbolic" and _form(problem) is not None


def equilibria_at(
    problem: Problem, parameter: str, values: FloatArray, system: System | None
) -> list[tuple[float, float]]:
    """All equilibria at values of a parameter, as (value, state); of an angle in one turn."""
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
    """Coefficients, highest first, of f as a polynomial of x or of exp(2 pi i x/period)."""
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
