"""Bounds of the number of limit cycles, against flows whose cycles are known."""

import numpy as np
import pytest
import sympy as sp

from phasekit.numerics.intervals.dulac import most_limit_cycles, rectangle

x, y = sp.symbols("x y", real=True)


def with_circles(squares, powers, turn, bend):
    """A flow whose cycles are circles of these radii, squared, bent by y -> y + bend x^2."""
    place = sp.expand(y - bend * x**2)
    size = x**2 + place**2
    rate = sp.prod([((s - size) / (1 + s)) ** k for s, k in zip(squares, powers, strict=True)])
    first = -turn * place + x * rate
    return [first, turn * x + place * rate + 2 * bend * x * first]


@pytest.mark.slow
def test_bounds_are_never_below_the_number_of_cycles():
    rng = np.random.default_rng(3)
    exact = 0
    for n in (0, 1, 1, 2, 2, 3):
        squares = [sp.Rational(s) for s in np.sort(rng.uniform(0.3, 5.0, n))]
        bend = sp.Rational(rng.uniform(-0.3, 0.3))
        f = with_circles(squares, [1] * n, sp.Rational(rng.uniform(0.5, 2.0)), bend)
        ends = np.array([2.7, 2.7 + 7.3 * abs(float(bend))])
        most = most_limit_cycles(rectangle(f, (x, y), {}, -ends, ends), n)
        assert most >= n
        exact += most == n
    assert exact >= 4


@pytest.mark.slow
def test_cycles_close_to_each_other_and_double_ones_are_never_excluded():
    near = sp.Rational(1, 10**6)
    for squares, powers in (((1, 1 + near), (1, 1)), ((1,), (2,)), ((near,), (1,))):
        f = with_circles(squares, powers, 1, 0)
        ends = np.array([2.0, 2.1])
        assert most_limit_cycles(rectangle(f, (x, y), {}, -ends, ends), 0) >= len(squares)
    center = rectangle([y, -x], (x, y), {}, np.array([-2.0, -2.0]), np.array([2.0, 2.1]))
    assert not center.diverges()
    assert np.isinf(most_limit_cycles(center, 0))


def test_a_flow_with_a_hole_is_not_bounded():
    hole = [y / (x**2 + y**2) + x, -x / (x**2 + y**2) + y]
    plane = rectangle(hole, (x, y), {}, np.array([-1.0, -1.0]), np.array([1.0, 1.1]))
    assert not plane.is_defined()
    assert not plane.diverges()
    assert np.isinf(most_limit_cycles(plane, 0))
