"""Interval arithmetic against ball arithmetic of many more digits, which shares no code with it."""

import sys
import threading
from functools import partial

import flint
import numpy as np
import pytest
import sympy as sp
from flint import acb, arb

from phasekit.numerics.intervals import balls
from phasekit.numerics.intervals.bounds import Bounds, Evaluator
from phasekit.numerics.intervals.kernel import evaluate
from phasekit.numerics.intervals.plane import Regions
from phasekit.numerics.intervals.program import ELEMENTARY, NoRule, real_program

X, Y = sp.symbols("x y", real=True)
#: Where functions are tried: on a part of the line, and what is beyond it.
RANGES = {
    "log": (1e-3, 9.0), "asin": (-1.0, 1.0), "acos": (-1.0, 1.0), "acosh": (1.0, 30.0),
    "atanh": (-0.999, 0.999), "tan": (-1.5, 1.5), "exp": (-300.0, 300.0), "erfc": (-5.0, 26.0),
    "sinh": (-300.0, 300.0), "cosh": (-300.0, 300.0), "sech": (-300.0, 300.0),
}  # fmt: skip


def exactly(function, places):
    """Balls of a function at doubles, with 200 bits."""
    with flint.ctx.workprec(200):
        return [function(arb(x)) for x in places]


@pytest.mark.parametrize("name", ELEMENTARY)
def test_elementary_functions_lie_within_their_bounds(name):
    """At the ends and inside; and of points the bounds are as narrow as they can be."""
    rng = np.random.default_rng(len(name))
    start, stop = RANGES.get(name, (-30.0, 30.0))
    low = rng.uniform(start, stop, 300)
    high = np.minimum(low + 10.0 ** rng.uniform(-9, 0.7, low.size), stop)
    high[:100] = low[:100]
    bounds = Bounds([getattr(sp, name)(X, evaluate=False)], [X])
    ((least, most),), undefined = bounds((low, high))
    assert not undefined.any()
    function = abs if name == "Abs" else partial(getattr(arb, name))
    for part in (0.0, 0.37, 1.0):
        places = np.minimum(low + part * (high - low), high)
        for i, value in enumerate(exactly(function, places.tolist())):
            assert not (value < least[i])
            assert not (value > most[i])
    size = np.maximum(np.abs(least), np.abs(most))[:100]
    ulps = 270.0 if name == "erfc" else 40.0 if name == "sech" else 20.0
    assert np.all((most - least)[:100] <= ulps * np.spacing(size))


@pytest.mark.parametrize(
    "formula",
    [X * Y - X / Y, X**2 * Y**3, (X + Y) ** -2, sp.sqrt(X) * Y ** sp.Rational(-1, 3), X**Y,
     sp.pi * X - sp.exp(1) * Y / 3, (X - Y) ** 4 * sp.GoldenRatio, Y ** sp.Rational(5, 2)],
    ids=str,
)  # fmt: skip
def test_arithmetic_lies_within_its_bounds(formula):
    rng = np.random.default_rng(5)
    low = rng.uniform(0.1, 3.0, (2, 200))
    high = low + 10.0 ** rng.uniform(-12, 0.5, low.shape)
    ((least, most),), undefined = Bounds([formula], [X, Y])(*zip(low, high, strict=True))
    inside = low + rng.random(low.shape) * (high - low)
    program = real_program([formula], [X, Y], balls.NAMES)
    (values,) = balls.run(program, [balls.balls(x, x) for x in inside], 200)
    for value, a, b, bad in zip(values, least, most, undefined, strict=True):
        assert bad or arb(a) <= value <= arb(b)
    assert undefined.sum() in (0, *range(40))


def test_even_powers_and_edges_of_domains_are_bounded_by_cases():
    def bounds_of(formula, low, high):
        ((a, b),), bad = Bounds([formula], [X])((np.array([low]), np.array([high])))
        return a.item(), b.item(), bad.item()

    assert bounds_of(X**2, -1.0, 2.0)[0] == 0.0
    assert bounds_of(X**4, -3.0, 1.0)[0] == 0.0
    low, high, _ = bounds_of(X**3, -1.0, 2.0)
    assert -1.0000001 < low <= -1.0
    assert 8.0 <= high < 8.0000001
    assert bounds_of(sp.sqrt(X), 0.0, 4.0)[2] is False
    assert bounds_of(sp.sqrt(X), -1e-9, 4.0)[2] is True
    assert bounds_of(sp.log(X), 0.0, 1.0)[:1] == (-np.inf,)
    assert bounds_of(1 / X, 0.0, 2.0)[0] == pytest.approx(0.5)
    assert bounds_of(1 / X, -1.0, 2.0) == (-np.inf, np.inf, True)
    low, high, _ = bounds_of(sp.tanh(X), -10.0, 10.0)
    assert -1.0 <= low < -0.999999995
    assert 0.999999995 < high <= 1.0
    assert bounds_of(sp.cos(X), -1.0, 2.5)[1] == 1.0
    assert bounds_of(sp.cos(X), 1e17, 1e17)[:2] == (-1.0, 1.0)


def test_interpreted_rules_give_the_bits_of_compiled_ones():
    text = "sin(x)*exp(-x**2) + tanh(x)/cosh(3*x)**2 + (x**2 + 1/10)**(3/4) - erf(x)*atan(x)**3"
    program = real_program([sp.sympify(text, {"x": X})], [X], frozenset(ELEMENTARY))
    code = Evaluator(program)
    found = []
    for function in (evaluate, evaluate.py_func):
        low, high = np.zeros((2, 9, 1 + len(program.operations)))
        low[:, 0] = np.linspace(-3.0, 3.0, 9)
        high[:, 0] = low[:, 0] + 0.1
        arrays = low, high, np.zeros(9, dtype=np.int8)
        with np.errstate(all="ignore"):
            function(code._code, code._numbers, 4.0, 0, len(code._code), 0, 9, arrays)
        found.append(np.stack(arrays[:2]))
    np.testing.assert_array_equal(*found)


def test_unknown_functions_are_named():
    with pytest.raises(NoRule, match="Piecewise"):
        Bounds([sp.Piecewise((X, X > 0), (0, True))], [X])
    with pytest.raises(NoRule, match="besselj"):
        Bounds([sp.besselj(sp.Rational(1, 2), X, evaluate=False)], [X])
    with pytest.raises(NoRule, match="y"):
        Bounds([X + Y], [X])


@pytest.mark.parametrize(
    "name", ["exp", "sin", "cosh", "tan", "tanh", "sech", "log", "asin", "acos", "asinh", "acosh",
             "atanh", "atan", "erf", "erfc"]
)  # fmt: skip
def test_rectangles_hold_what_balls_find_in_the_plane(name):
    rng = np.random.default_rng(len(name))
    function = getattr(sp, name)(X if name != "log" else 3 + X, evaluate=False)
    low, width = rng.uniform(-2.0, 2.0, 60), 10.0 ** rng.uniform(-3, 0.3, 60)
    height = rng.uniform(1e-3, 1.0, 60)
    largest = Regions(function, X).largest((low, low + width), (-height, height))
    usable = np.flatnonzero(np.isfinite(largest))
    assert usable.size > {"acosh": 5, "asin": 15, "acos": 15, "atanh": 15}.get(name, 40)
    with flint.ctx.workprec(120):
        for i in usable:
            for part, turn in ((0.0, 1.0), (0.4, -1.0), (1.0, 0.6), (0.5, 0.0)):
                z = acb(low[i] + part * width[i], turn * height[i])
                z = z + 3 if name == "log" else z
                value = getattr(acb, name)(z)
                assert abs(value) <= arb(largest[i]) * (1 + arb(1e-12))


# --------------------------------------------------------------------- precision


def test_no_precision_is_left_changed_and_none_from_outside_counts():
    """Other threads change the precision all the time, and see no other than their own."""
    x = np.linspace(0.5, 20.0, 40)
    program = real_program([sp.besselj(0, X) * sp.exp(X) - sp.pi], [X], balls.NAMES)

    def found():
        (values,) = balls.run(program, [balls.balls(x, x)], 150)
        return np.array([balls.double_doubles(values, 150), [*balls.ends(values), x]])

    want, wrong, over = found(), [], threading.Event()

    def disturb():
        context = flint.ctx
        while not over.is_set():
            for bits in (20, 77, 300):
                with context.workprec(bits):
                    if context.prec != bits:
                        wrong.append(context.prec)

    before, pause = flint.ctx.prec, sys.getswitchinterval()
    other = threading.Thread(target=disturb)
    sys.setswitchinterval(1e-6)
    try:
        other.start()
        for _ in range(60):
            np.testing.assert_array_equal(found(), want)
    finally:
        sys.setswitchinterval(pause)
        over.set()
        other.join()
    assert wrong == []
    assert flint.ctx.prec == before


def test_the_precision_is_put_back_when_something_goes_wrong():
    before = flint.ctx.prec
    with pytest.raises(ZeroDivisionError):
        balls.at_precision(99, [partial(divmod, 1, 0)])
    assert flint.ctx.prec == before


def test_constants_are_what_they_are():
    one = sp.Rational(1, 3)
    named = [sp.GoldenRatio, sp.Catalan, sp.EulerGamma, sp.pi / 7, sp.exp(one), sp.log(one)]
    for value in (*named, sp.besselj(0, 2), sp.Float(0.1), sp.Integer(10) ** 30 + 1, sp.sqrt(2)):
        ball = balls.constant(value)
        with flint.ctx.workprec(300):
            exact = arb(str(sp.N(sp.Rational(value) if value.is_Float else value, 60)))
            assert abs(ball - exact) <= abs(exact) * arb(2) ** -120
    with pytest.raises(NoRule):
        balls.constant(sp.log(-one) * sp.I)
