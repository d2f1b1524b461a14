"""The compiled kernels and the same code interpreted give the same bits, wherever a cell stands."""

from __future__ import annotations

import numpy as np
import pytest

from phasekit.phase.exact.kernels import phase_space as kernels
from phasekit.phase.exact.phase_space import LOOPS, POINTS

NOTHING = np.empty(0)


def systems(size):
    """Random systems of both signs, with every special case among them."""
    rng = np.random.default_rng(1729)
    a, b, c = rng.normal(size=(3, size)) * 10.0 ** rng.uniform(-20, 20, (3, size))
    b[: size // 2] = a[: size // 2] * rng.uniform(-1, 1, size // 2)
    c[: size // 2] = a[: size // 2] * rng.uniform(-1, 1, size // 2)
    special = [0.0, -0.0, 1.0, -1.0, 27.0, 64.0, 125.0, 1e300, 5e-324, np.nan, np.inf, -np.inf]
    for array in (a, b, c):
        array[-size // 3 :] = rng.choice(special, size // 3)
    return a, b, c


def allocate(size, shapes):
    return tuple(np.empty((size, *tail), dtype) for tail, dtype in shapes)


def run(function, a, b, c, pieces=1):
    points = allocate(a.size, POINTS)
    loops = allocate(a.size, LOOPS)
    edges = np.linspace(0, a.size, pieces + 1).astype(int)
    with np.errstate(all="ignore"):
        for start, stop in zip(edges[:-1], edges[1:], strict=True):
            function(a, b, c, NOTHING, start, stop, points, loops)
    return points + loops


def assert_same_bits(left, right):
    for one, other in zip(left, right, strict=True):
        assert one.dtype == other.dtype
        assert np.array_equal(one, other, equal_nan=one.dtype.kind == "f")


def test_compiled_and_interpreted_agree_to_the_last_bit():
    abc = systems(600)
    assert_same_bits(run(kernels.phase_space, *abc), run(kernels.phase_space.py_func, *abc))


@pytest.mark.parametrize("pieces", [2, 7, 101])
def test_a_cell_does_not_depend_on_where_it_is_computed(pieces):
    abc = systems(3000)
    assert_same_bits(run(kernels.phase_space, *abc), run(kernels.phase_space, *abc, pieces))


def test_equilibria_alone_are_those_of_the_whole_pass():
    a, b, c = systems(3000)
    points = allocate(a.size, POINTS)
    kernels.equilibria(a, b, c, NOTHING, 0, a.size, points)
    assert_same_bits(points, run(kernels.phase_space, a, b, c)[: len(points)])
