"""What kernels call is compiled once for each signature, and stays an ordinary function."""

from collections import Counter

import numpy as np
import pytest
from numba import njit
from numba.core import event

from phasekit.numerics.compile import OPTIONS, compose, inline, routine
from phasekit.numerics.native import twin


@routine
def cube(x):
    return x * x * x


@inline
def shifted(x, by):
    return cube(x) + by


def _halved(w):
    for i in range(w.size):
        w[i] *= 0.5


@twin(_halved)
def halved(w):
    w *= 0.5


@compose
def both(x, w):
    w[0] = cube(x) + shifted(x, 3)


@pytest.fixture
def compiled():
    """Count what is compiled, by name."""
    times = Counter()

    class Listener(event.Listener):
        def on_start(self, started):
            times[started.data["dispatcher"].py_func.__name__] += 1

        def on_end(self, ended):
            pass

    listener = Listener()
    event.register("numba:compile", listener)
    yield times
    event.unregister("numba:compile", listener)


def test_each_is_compiled_once_however_it_is_called(compiled):
    """Called in a kernel, in what is inlined there, and in what is pasted there."""

    def kernel(x, w):
        both(x, w)
        w[1] = shifted(x, 3) + cube(x)
        halved(w)

    results = []
    for function in (kernel, njit(nogil=True, **OPTIONS)(kernel), njit(**OPTIONS)(kernel)):
        w = np.ones(3)
        function(1.7, w)
        results.append(w.tolist())
    assert results[0] == results[1] == results[2]
    assert results[0][2] == 0.5
    assert compiled["kernel"] == 2
    assert [compiled[name] for name in ("cube", "shifted", "_halved")] == [1, 1, 1]


def test_integers_that_are_written_out_are_constants_inside(compiled):
    @njit(**OPTIONS)
    def kernel(x, n):
        return shifted(x, 1) + shifted(x, 2) + shifted(x, n)

    assert kernel(2.0, 5) == 32.0
    assert compiled["shifted"] == 3
    assert compiled["cube"] <= 1
