"""Double-double arithmetic against exact fractions and mpmath with 60 digits."""

from __future__ import annotations

from fractions import Fraction

import numpy as np
import pytest
from mpmath import mp, mpf

from phasekit.numerics import double_double as dd

COUNT = 1000
LOW = 2.0**-104  # what the bounds of the docstrings are given in


@pytest.fixture
def rng():
    return np.random.default_rng(106)


@pytest.fixture(autouse=True)
def digits():
    with mp.workdps(60):
        yield


def numbers(rng, count=COUNT, span=100):
    """Double-doubles of both signs and many sizes, the low part at most half a unit of the high."""
    high = rng.choice([-1.0, 1.0], count) * 2.0 ** rng.uniform(-span, span, count)
    low = high * rng.uniform(-1, 1, count) * 2.0 ** -rng.choice([53, 54, 60, 80], count)
    return [dd.two_sum(float(x), float(y)) for x, y in zip(high, low, strict=True)]


def fraction(x):
    return Fraction(float(x[0])) + Fraction(float(x[1]))


def exact(x):
    return mpf(float(x[0])) + mpf(float(x[1]))


def test_two_sum_and_two_product_are_exact(rng):
    # The product's low part is not subnormal.
    for (a, _), (b, _) in zip(numbers(rng), numbers(rng), strict=True):
        assert fraction(dd.two_sum(a, b)) == Fraction(a) + Fraction(b)
        assert fraction(dd.two_product(a, b)) == Fraction(a) * Fraction(b)
        near = float(np.nextafter(-a, np.inf))
        assert fraction(dd.two_sum(a, near)) == Fraction(a) + Fraction(near)


def test_sum(rng):
    """3 * 2^-104 relative, also where all leading digits cancel."""
    for x, y in zip(numbers(rng, span=60), numbers(rng, span=60), strict=True):
        close = dd.two_sum(-x[0], x[1] + 1e-17 * y[0] / abs(y[0]) * abs(x[0]))
        for z in (y, close):
            got, want = fraction(dd.dd_add(*x, *z)), fraction(x) + fraction(z)
            assert abs(got - want) <= 3 * Fraction(LOW) * abs(want), (x, z)


def test_product(rng):
    """8 * 2^-104 relative."""
    for x, y in zip(numbers(rng), numbers(rng), strict=True):
        got, want = fraction(dd.dd_multiply(*x, *y)), fraction(x) * fraction(y)
        assert abs(got - want) <= 8 * Fraction(LOW) * abs(want), (x, y)


def test_square_root(rng):
    """2^-102 relative."""
    for x in numbers(rng):
        h, low = (x[0], x[1]) if x[0] > 0 else (-x[0], -x[1])
        root = fraction(dd.dd_sqrt(h, low))
        want = fraction((h, low))
        # root = sqrt(want) (1 + e) has the square want (1 + 2 e).
        assert abs(root * root - want) <= 2 * Fraction(4 * LOW) * want, x
    assert dd.dd_sqrt(0.0, 0.0) == (0.0, 0.0)
    assert dd.dd_sqrt(4.0, 0.0) == (2.0, 0.0)


ANGLES = [0.0, 1e-300, 1e-20, 1e-8, np.pi / 64, np.pi / 4, 1.0, np.pi / 2, np.pi, 2 * np.pi, 355.0]
# Multiples of pi/2 that doubles come close to.
ANGLES += [11.0, 22.0, 52174.0, 573204.0, 51819.0, 37362253.0, 99999999.0]


def angles(rng, most):
    found = np.concatenate([rng.uniform(-4, 4, 400), 10.0 ** rng.uniform(-18, np.log10(most), 400)])
    steps = np.arange(-130, 131) * np.pi / 32  # the table's own angles
    return [*ANGLES, *(-x for x in ANGLES), *map(float, found), *map(float, steps)]


def test_cosine_and_sine(rng):
    """1e-31 absolute; of an angle far below 1 also relative, for its sine."""
    for phi in angles(rng, 9e7):
        ch, cl, sh, sl = dd.dd_cos_sin(phi)
        cosine, sine = mp.cos_sin(mpf(phi))
        turns = 1 + abs(phi) / 1e4
        assert abs(exact((ch, cl)) - cosine) <= 1e-31 * turns, phi
        assert abs(exact((sh, sl)) - sine) <= 1e-31 * min(1.0, 2 * abs(phi)) * turns, phi


def test_cosine_and_sine_of_huge_angles():
    """Beyond 1e8 plain doubles."""
    for phi in (1e8, 1.5e8, 1e12, -1e20, 1.7976931348623157e308):
        ch, cl, sh, sl = dd.dd_cos_sin(phi)
        with mp.workdps(400):
            cosine, sine = mp.cos_sin(mpf(phi))
        assert cl == sl == 0.0
        assert abs(ch - cosine) <= 2.0**-53
        assert abs(sh - sine) <= 2.0**-53


def test_reduced_angle(rng):
    """The turns taken off are whole, and what remains is right to 1e-31."""
    for phi in [*angles(rng, 5e16), 4.9e16, -4.9e16]:
        for low in (0.0, phi * 2.0**-54):
            h, rest, turns = dd.reduce_angle(phi, low)
            assert turns == np.rint(turns)
            want = mpf(phi) + mpf(low) - mpf(float(turns)) * 2 * mp.pi
            assert abs(exact((h, rest)) - want) <= 1e-31, (phi, low)
            # A quotient of very many turns is itself rounded.
            most = np.pi * (1 + 1e-15) if abs(phi) < 1e15 else 2 * np.pi
            assert abs(h) <= most + abs(low)


def test_reduced_angle_without_digits():
    """Beyond 5e16 any point of the circle will do; infinity must not spread."""
    for phi in (5e16, -1e17, 1e300):
        h, rest, turns = dd.reduce_angle(phi, 0.0)
        assert 0 <= h <= 2 * np.pi
        assert rest == 0
        assert abs(turns * 2 * np.pi / phi - 1) < 1e-15
    h, rest, _ = dd.reduce_angle(float("inf"), 0.0)
    assert h == rest == 0
