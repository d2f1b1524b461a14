"""Which cells are interpreted, and which are compiled."""

from types import SimpleNamespace

import pytest

from phasekit.numerics import launch as module
from phasekit.numerics.launch import launch


class Kernel:
    """A kernel that records the cells it was given, and how; interpreted, a cell takes a while."""

    def __init__(self, clock, seconds):
        self.clock, self.seconds, self.calls = clock, seconds, []

    def __call__(self, start, stop):
        self.calls.append(("compiled", start, stop))

    def py_func(self, start, stop):
        self.calls.append(("interpreted", start, stop))
        self.clock.now += self.seconds * (stop - start)

    def cells(self, how):
        return [n for kind, start, stop in self.calls if kind == how for n in range(start, stop)]


@pytest.fixture
def clock(monkeypatch):
    now = SimpleNamespace(now=0.0)
    monkeypatch.setattr(module.time, "perf_counter", lambda: now.now)
    return now


def test_slow_cells_are_not_interpreted_for_long(clock):
    """A few systems may take a thousand times as long as most: 3000 of them took minutes."""
    kernel = Kernel(clock, 0.1)
    launch(kernel, (), 3000, (), None)
    interpreted, compiled = kernel.cells("interpreted"), kernel.cells("compiled")
    assert interpreted + compiled == list(range(3000))
    assert clock.now <= module.INTERPRETED_SECONDS + 0.1 * module.AT_A_TIME
    launch(kernel, (), 10, (), None)  # nor are they later on
    assert kernel.calls[-1] == ("compiled", 0, 10)


def test_quick_cells_are_interpreted(clock):
    kernel = Kernel(clock, 1e-5)
    launch(kernel, (), 3000, (), None)
    assert kernel.cells("interpreted") == list(range(3000))
    launch(kernel, (), 3000, (), None)  # too many together
    assert kernel.cells("compiled") == list(range(3000))


def test_nothing_is_run_over_no_cells(clock):
    kernel = Kernel(clock, 1.0)
    launch(kernel, (), 0, (), None)
    assert kernel.cells("interpreted") == kernel.cells("compiled") == []


@pytest.mark.parametrize(("seconds", "most"), [(1.0, 32), (0.01, 50), (1e-6, 968)])
def test_long_calls_are_cut_so_that_they_can_be_interrupted(clock, seconds, most):
    """Each cell once, and no more at a time than half a second takes."""
    cells, parts = [], []

    def kernel(start, stop):
        parts.append(stop - start)
        clock.now += seconds * (stop - start)
        cells.extend(range(start, stop))

    launch(kernel, (), 1_000, (), 1)
    assert cells == list(range(1_000))
    assert max(parts) == most
