"""The elementary functions against mpmath and NumPy."""

from __future__ import annotations

import mpmath
import numpy as np
import pytest
from numba import njit

from phasekit.numerics import elementary


def vectorised(function):
    """Run a scalar kernel function over arrays."""

    @njit
    def loop(x, y, out):
        for i in range(x.size):
            out[i] = function(x[i], y[i])

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
    got = vectorised(njit(lambda x, _: elementary.cbrt(x)))(x, x)
    with mpmath.workdps(40):
        errors = relative_errors(got, [mpmath.cbrt(mpmath.mpf(v)) for v in x])
    assert errors.max() < 6.0  # three units in the last place
    assert np.median(errors) < 1.0


def test_cbrt_of_zero_is_zero():
    zero = np.zeros(1)
    assert vectorised(njit(lambda x, _: elementary.cbrt(x)))(zero, zero)[0] == 0.0


def test_angles_are_those_of_atan2(rng):
    y = np.concatenate([rng.uniform(0, 2, 1000), 10.0 ** rng.uniform(-300, 0, 1000)])
    x = np.concatenate([rng.uniform(-2, 2, 1000), rng.normal(size=1000)])
    with mpmath.workdps(40):
        half = relative_errors(
            vectorised(elementary.angle_half)(y, x),
            [mpmath.atan2(b, a) for a, b in zip(x, y, strict=True)],
        )
        quadrant = relative_errors(
            vectorised(elementary.angle_quadrant)(y, abs(x)),
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
    got = vectorised(elementary.atanh)(np.array([float(v) for v in z]), rests)
    with mpmath.workdps(40):
        assert relative_errors(got, exact).max() < 8.0


def test_scale_brings_every_size_next_to_one(rng):
    x = np.concatenate([10.0 ** rng.uniform(-307, 307, 500), [1.0, 1.5, 5e-324, 1.7e308]])
    scale = vectorised(njit(lambda x, _: elementary.power_of_two_scale(x)))(x, x)
    assert np.all(np.frexp(scale)[0] == 0.5)
    normal = (x > 1e-300) & (x < 8e307)
    assert np.all((x * scale)[normal] >= 1.0)
    assert np.all((x * scale) < 4.0)


def test_wrap_stays_in_the_half_open_circle(rng):
    angle = rng.uniform(-3 * np.pi, 3 * np.pi, 2000)
    got = vectorised(njit(lambda a, _: elementary.wrap(a)))(angle, angle)
    assert np.all((got > -np.pi) & (got <= np.pi))
    np.testing.assert_allclose(np.exp(1j * got), np.exp(1j * angle), atol=1e-15)
    assert elementary.wrap(np.pi) == np.pi
