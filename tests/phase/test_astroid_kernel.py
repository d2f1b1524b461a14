"""The double-double discriminant against rational arithmetic, and its claim to be certain."""

from __future__ import annotations

from fractions import Fraction

import numpy as np
import pytest

from phasekit.numerics.compile import kernel
from phasekit.phase.exact.kernels.equilibria import discriminant, exact_discriminant


def exact(a, b, c):
    a2, b2, c2 = (Fraction(float(v)) ** 2 for v in (a, b, c))
    return (b2 + c2 - a2) ** 3 + 27 * a2 * b2 * c2


def systems_next_to_the_astroid(size):
    rng = np.random.default_rng(104)
    theta = 10.0 ** rng.uniform(-12, 0, size)
    theta = np.where(rng.random(size) < 0.5, theta, np.pi / 2 - theta)
    a = rng.uniform(1, 2, size)
    off = 1.0 + rng.choice([-1.0, 1.0], size) * 10.0 ** rng.uniform(-16, -1, size)
    return a, a * np.cos(theta) ** 3 * off, a * np.abs(np.sin(theta)) ** 3 * off


@kernel
def loop(a, b, c, delta, decided):
    for i in range(a.size):
        delta[i], decided[i] = discriminant(a[i], b[i], c[i])


def test_what_is_called_certain_is_right():
    a, b, c = systems_next_to_the_astroid(4000)
    delta, decided = np.empty(a.size), np.empty(a.size, bool)
    loop(a, b, c, delta, decided)
    assert decided.mean() > 0.9
    for one in np.flatnonzero(decided):
        truth = exact(a[one], b[one], c[one])
        assert abs(Fraction(delta[one]) - truth) <= abs(truth) * Fraction(1, 2**46)


@pytest.mark.parametrize("abc", [(125.0, 27.0, 64.0), (1.0, 0.125 * 27, 0.0), (2.0, 2.0, 1e-150)])
def test_exact_values_where_floating_point_gives_up(abc):
    value = exact_discriminant(*abc)
    truth = exact(*abc)
    assert (value > 0) == (truth > 0)
    assert (value == 0) == (truth == 0)


def test_exact_value_in_the_scale_of_the_kernel():
    a, b, c = 6.0, 2.5, 1.25
    assert exact_discriminant(a, b, c) == float(exact(a / 4, b / 4, c / 4))
