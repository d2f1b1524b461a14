"""Jumps of formulas, at borders that lie anywhere."""

import pytest
import sympy as sp

from phasekit.laws.smoothness import jumps

a, x, y = sp.symbols("a x y", real=True)


@pytest.mark.parametrize(
    ("formula", "jumping"),
    [  # a factor has a value far from 1 alone, or below 0; or the border has no zero along x
        (sp.Heaviside(x - 10) * sp.sqrt(y - 5), True),
        (sp.sign(x) * sp.log(y - 20), True),
        (sp.Piecewise((sp.sqrt(-y), x < 0), (2 * sp.sqrt(-y), True)), True),
        (sp.sign(sp.exp(y) - a * x) * sp.sqrt(-x - 2), True),
        (sp.Piecewise((x * sp.sqrt(-y - 3), x < 0), (x**2, True)), False),
        (sp.Abs(x) * x * sp.log(y - 20), False),
        (sp.sign(x**2 + y**2 + 1), False),
    ],
)
def test_a_jump_is_seen_wherever_the_formula_has_a_value(formula, jumping):
    assert jumps(formula, (x, y)) is jumping
