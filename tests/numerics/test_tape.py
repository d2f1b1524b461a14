"""Tapes: formulas, their derivatives and code against sympy and mpmath."""

import ctypes
import itertools

import mpmath
import numpy as np
import pytest
import sympy as sp

from phasekit.errors import ParameterError
from phasekit.numerics import tape_code
from phasekit.numerics.tape import Tape
from phasekit.numerics.tape_formulas import write

X, Y, A = sp.symbols("x y a", real=True)
PLACES = {X: (0, 0), Y: (0, 1), A: (1, 0)}
POINTER = ctypes.POINTER(ctypes.c_double)
EXPRESSIONS = [
    X * Y / (1 + X**2) + A * X - Y**3 / 7,
    sp.sqrt(X**2 + Y**2 + 1) * sp.exp(-A * X) + sp.log(2 + X * X) * Y ** sp.Rational(3, 2),
    X**A + A**Y + (X + Y) ** 2.5 - 3 * X**-2 + X ** sp.Rational(-1, 2) * (-Y) + 2**X,
    sp.sin(X) * sp.cos(Y) * sp.tan(A * X) + sp.asin(X / 9) + sp.acos(Y / 8) * sp.atan(X * Y),
    sp.sinh(X) * sp.cosh(Y) + sp.tanh(X - A * Y) ** 3 + sp.asinh(X) + sp.acosh(2 + Y) * X,
    sp.atanh(X / 10) + sp.erf(X) * sp.erfc(A * Y) + sp.atan2(Y, A * X) * X + sp.gamma(A) * Y**2,
    ((X + 1) ** 5 * (Y + 2) ** 7 * (X * Y + A)) ** 2 / (1 + (X * Y) ** 4),
    sp.exp(sp.sin(X * sp.cos(Y * sp.exp(A * X)))) * sp.pi / -A,
    sp.Abs(X - Y) * X**2 + sp.Max(X, Y, A / 4) * Y - sp.Min(X * Y, 1.5) ** 2 + sp.sign(X - A) * Y,
    sp.Piecewise((sp.sqrt(X - 1) * Y, X > 1), (X**2 * Y, (X < 0.5) & (Y > 0.1)), (A * Y**3, True)),
    sp.Piecewise((X**3, sp.Or(X > 5, X <= Y)), (Y, sp.Eq(A, 2)), (sp.log(Y) * X, True)),
    sp.Integer(3),
]  # fmt: skip


def called(tape, entries, count, x, a, z=()):
    """What the code of entries gives; memory that is not cleared would show."""
    address = tape_code.compile_tape(tape, entries, count)
    out = np.full(count, 7.0)
    arrays = [np.array([*given, 0.0]) for given in (x, a, z)]
    function = ctypes.CFUNCTYPE(None, *[POINTER] * 4)(address)
    function(*(one.ctypes.data_as(POINTER) for one in (*arrays, out)))
    return out


def exactly(expression, x, y, a):
    with mpmath.workdps(30):
        expression = expression.replace(sp.DiracDelta, lambda *_: sp.S.Zero)
        found = sp.lambdify([X, Y, A], expression, "mpmath")(*map(mpmath.mpf, (x, y, a)))
        return float(found)


@pytest.mark.parametrize("expression", EXPRESSIONS)
def test_values_and_derivatives_to_third_order(expression):
    tape = Tape(PLACES)
    u = [tape.argument(0, j) for j in range(2)]
    (value,) = write(tape, [expression])
    gradient = tape.gradient(value, u)
    entries, wanted = {0: value}, {0: expression}
    for j, slope in gradient.items():
        entries[1 + j] = slope
    # Along z, then its gradient; along a second and a third direction.
    z = [[tape.argument(2, 2 * k + j) for j in range(2)] for k in range(3)]
    (along,) = tape.tangent([value], dict(zip(u, z[0], strict=True)))
    entries |= {3 + j: slope for j, slope in tape.gradient(along, u).items()}
    third = along
    for k in (1, 2):
        (third,) = tape.tangent([third], dict(zip(u, z[k], strict=True)))
    entries[5] = third
    directions = [[0.3, -1.1], [0.8, 0.4], [-0.6, 0.9]]
    (p, q, r) = directions
    wanted |= {1 + j: expression.diff(v) for j, v in enumerate((X, Y))}
    first = p[0] * wanted[1] + p[1] * wanted[2]
    wanted |= {3 + j: first.diff(v) for j, v in enumerate((X, Y))}
    second = q[0] * wanted[3] + q[1] * wanted[4]
    wanted[5] = r[0] * second.diff(X) + r[1] * second.diff(Y)
    for x, y, a in ((0.7, 1.9, 1.3), (1.4, 0.4, 0.6), (0.4, 0.6, 2.0)):
        found = called(tape, entries, 6, (x, y), (a,), itertools.chain(*directions))
        exact = [exactly(wanted[i], x, y, a) for i in range(6)]
        np.testing.assert_allclose(found, exact, rtol=2e-12, atol=1e-14 * np.max(np.abs(exact)))


def test_what_cannot_be_differentiated_says_so():
    tape = Tape(PLACES)
    (value,) = write(tape, [sp.gamma(X)])
    with pytest.raises(ParameterError, match="tgamma, whose derivative has no machine code"):
        tape.gradient(value, [tape.argument(0, 0)])
    with pytest.raises(ParameterError, match="f: got the function besselj"):
        write(tape, [sp.besselj(0, X)])


def long_sum(terms):
    return sp.Add(*(sp.sin(X / (k + 2) + Y * k) * X**k / (k + 1) for k in range(terms)))


def test_derivatives_of_long_formulas_grow_as_these(monkeypatch):
    monkeypatch.setattr(tape_code, "PIECE", 50)  # many pieces, which hand on what they need
    lengths = []
    for terms in (25, 50, 100):
        tape = Tape(PLACES)
        u = [tape.argument(0, j) for j in range(2)]
        (value,) = write(tape, [long_sum(terms)])
        third = [value]
        for k in range(3):
            z = [tape.argument(2, 2 * k + j) for j in range(2)]
            third = tape.tangent(third, dict(zip(u, z, strict=True)))
        entries = {0: value, 4: third[0], 5: tape.magnitude(value)}
        entries |= {1 + j: slope for j, slope in tape.gradient(value, u).items()}
        lengths.append(len(tape.needed(entries.values())))
        found = called(tape, entries, 6, (0.8, 0.3), (), (1.0, 0.0) * 3)
        x, y, k = mpmath.mpf(0.8), mpmath.mpf(0.3), range(terms)

        def f(x, k=k, y=y):
            return sum(mpmath.sin(x / (i + 2) + y * i) * x**i / (i + 1) for i in k)

        with mpmath.workdps(30):
            wanted = [f(x), mpmath.diff(f, x), mpmath.diff(f, x, 3)]
        np.testing.assert_allclose(found[[0, 1, 4]], np.array(wanted, dtype=float), rtol=1e-12)
        assert found[3] == 0.0  # is cleared
        assert found[5] > abs(found[0])
    assert lengths[2] - lengths[1] < 2.2 * (lengths[1] - lengths[0])
    assert lengths[1] < 2.2 * lengths[0]


def test_what_is_equal_is_written_once_and_deep_formulas_are_read():
    tape = Tape(PLACES)
    two = write(tape, [sp.sin(X + Y) ** 2, sp.sin(Y + X) ** 2])
    assert two[0] == two[1]
    deep = X
    for _ in range(3000):
        deep = sp.sin(deep, evaluate=False)
    (value,) = write(tape, [deep])
    (slope,) = tape.gradient(value, [tape.argument(0, 0)]).values()
    found = called(tape, {0: value, 1: slope}, 2, (0.5, 0.0), ())
    x, rise = 0.5, 1.0
    for _ in range(3000):
        x, rise = np.sin(x), rise * np.cos(x)
    np.testing.assert_allclose(found, [x, rise], rtol=1e-11)
