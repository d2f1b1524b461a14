"""The elementary functions against mpmath and NumPy."""

from __future__ import annotations

import mpmath
import numpy as np
import pytest

from phasekit.numerics import elementary
from phasekit.numerics.compile import kernel


@kernel
def cbrt(x, y, out):
    for i in range(x.size):
        out[i] = elementary.cbrt(x[i])


@kernel
def angle_half(y, x, out):
    for i in range(x.size):
        out[i] = elementary.angle_half(y[i], x[i])


@kernel
def angle_quadrant(y, x, out):
    for i in range(x.size):
        out[i] = elementary.angle_quadrant(y[i], x[i])


@kernel
def atanh(z, rest, out):
    for i in range(z.size):
        out[i] = elementary.atanh(z[i], rest[i])


@kernel
def power_of_two_scale(x, y, out):
    for i in range(x.size):
        out[i] = elementary.power_of_two_scale(x[i])


@kernel
def wrap(x, y, out):
    for i in range(x.size):
        out[i] = elementary.wrap(x[i])


@kernel
def hypot(x, y, out):
    for i in range(x.size):
        out[i] = elementary.hypot(x[i], y[i])


def vectorised(loop):
    """Run a kernel over arrays."""

    def run(x, y):
        out = np.empty(x.size)
        loop(x, y, out)
        return out

    return run


def relative_errors(got, exact):
    """Errors in units of 2^-53, relative."""
    return np.array([abs(mpmath.mpf(g) / e - 1) * 2**53 for g, e in zip(got, exact, strict=True)])


@pytest.fixture
def rng():
    return np.random.default_rng(53)


def test_cbrt_is_accurate_over_the_whole_range_below_4(rng):
    x = np.concatenate([rng.uniform(0, 4, 500), 10.0 ** rng.uniform(-323, 0.6, 1500), [5e-324]])
    got = vectorised(cbrt)(x, x)
    with mpmath.workdps(40):
        errors = relative_errors(got, [mpmath.cbrt(mpmath.mpf(v)) for v in x])
    assert errors.max() < 6.0  # three units in the last place
    assert np.median(errors) < 1.0


def test_cbrt_of_zero_is_zero():
    zero = np.zeros(1)
    assert vectorised(cbrt)(zero, zero)[0] == 0.0


def test_angles_are_those_of_atan2(rng):
    y = np.concatenate([rng.uniform(0, 2, 1000), 10.0 ** rng.uniform(-300, 0, 1000)])
    x = np.concatenate([rng.uniform(-2, 2, 1000), rng.normal(size=1000)])
    with mpmath.workdps(40):
        half = relative_errors(
            vectorised(angle_half)(y, x),
            [mpmath.atan2(b, a) for a, b in zip(x, y, strict=True)],
        )
        quadrant = relative_errors(
            vectorised(angle_quadrant)(y, abs(x)),
            [mpmath.atan2(b, a) for a, b in zip(abs(x), y, strict=True)],
        )
    assert half.max() < 6.0
    assert quadrant.max() < 6.0


@pytest.mark.parametrize(
    ("y", "x", "angle"),
    [(0.0, 1.0, 0.0), (1.0, 0.0, np.pi / 2), (0.0, -1.0, np.pi), (1.0, 1.0, np.pi / 4)],
)
def test_angles_on_the_axes_are_exact(y, x, angle):
    assert elementary.angle_half(y, x) == angle


def test_atanh_keeps_its_digits_at_both_ends(rng):
    small = 10.0 ** rng.uniform(-300, 0, 1000) * 0.99
    rest = 10.0 ** rng.uniform(-300, -1, 1000)
    with mpmath.workdps(400):
        z = [mpmath.mpf(v) for v in small] + [mpmath.sqrt(1 - mpmath.mpf(v)) for v in rest]
        rests = np.append([float(1 - v * v) for v in z[:1000]], rest)
        exact = [mpmath.atanh(v) for v in z]
    got = vectorised(atanh)(np.array([float(v) for v in z]), rests)
    with mpmath.workdps(40):
        assert relative_errors(got, exact).max() < 8.0


def test_scale_brings_every_size_next_to_one(rng):
    x = np.concatenate([10.0 ** rng.uniform(-307, 307, 500), [1.0, 1.5, 5e-324, 1.7e308]])
    scale = vectorised(power_of_two_scale)(x, x)
    assert np.all(np.frexp(scale)[0] == 0.5)
    normal = (x > 1e-300) & (x < 8e307)
    assert np.all((x * scale)[normal] >= 1.0)
    assert np.all((x * scale) < 4.0)


def test_wrap_stays_in_the_half_open_circle(rng):
    angle = rng.uniform(-3 * np.pi, 3 * np.pi, 2000)
    got = vectorised(wrap)(angle, angle)
    assert np.all((got > -np.pi) & (got <= np.pi))
    np.testing.assert_allclose(np.exp(1j * got), np.exp(1j * angle), atol=1e-15)
    assert elementary.wrap(np.pi) == np.pi


def test_lengths_neither_overflow_nor_vanish(rng):
    x, y = (10.0 ** rng.uniform(-300, 300, 2000) * rng.choice([-1.0, 1.0], 2000) for _ in "xy")
    y[::2] = x[::2] * rng.uniform(-2, 2, 1000)
    got = vectorised(hypot)(x, y)
    with mpmath.workdps(40):
        exact = [mpmath.hypot(float(a), float(b)) for a, b in zip(x, y, strict=True)]
        assert relative_errors(got, exact).max() < 4.0
    ends = [(0.0, 0.0, 0.0), (np.inf, 1.0, np.inf), (-3.0, 4.0, 5.0)]
    for a, b, length in ends:
        assert elementary.hypot(a, b) == elementary.hypot(b, a) == length
    assert np.isnan(elementary.hypot(np.nan, 1.0))
    assert np.isnan(elementary.hypot(1.0, np.nan))
