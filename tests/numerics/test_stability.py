"""How many eigenvalues are unstable over boxes, against eigenvalues and exact arithmetic."""

import numpy as np
import pytest
import sympy as sp

from phasekit.numerics.intervals.stability import UnstableCount
from phasekit.numerics.intervals.zeros import zeros_in_box

x, y, z, mu = sp.symbols("x y z mu", real=True)
LORENZ = [10 * (y - x), x * (mu - z) - y, x * y - sp.Rational(8, 3) * z]


@pytest.mark.parametrize("discrete", [False, True])
@pytest.mark.parametrize("n", [1, 2, 3, 4])
def test_counts_at_points_are_those_of_eigenvalues(n, discrete):
    states, entries = sp.symbols(f"x0:{n}", real=True), sp.symbols(f"p0:{n * n}", real=True)
    f = [sum(entries[i * n + j] * states[j] for j in range(n)) for i in range(n)]
    matrices = 1.2 * np.random.default_rng(n).normal(size=(60, n, n))
    columns = [(column, column) for column in matrices.reshape(60, -1).T]
    got = UnstableCount(f, states, entries, discrete)(*[(0.0, 0.0)] * n, *columns)
    found = np.linalg.eigvals(matrices)
    unstable = np.abs(found) > 1.0 if discrete else found.real > 0.0
    np.testing.assert_array_equal(got, unstable.sum(axis=1))


@pytest.mark.parametrize("discrete", [False, True])
def test_counts_over_boxes_hold_in_all_of_them(discrete):
    """And where eigenvalues pass the axis, or the circle, nothing is said."""
    rng = np.random.default_rng(8)
    states, entries = sp.symbols("x0:3", real=True), sp.symbols("p0:9", real=True)
    f = [sum(entries[3 * i + j] * states[j] for j in range(3)) for i in range(3)]
    middle, half = rng.normal(size=(80, 9)), 10.0 ** rng.uniform(-3, -0.5, (80, 1))
    low, high = middle - half, middle + half
    boxes = list(zip(low.T, high.T, strict=True))
    got = UnstableCount(f, states, entries, discrete)(*[(0.0, 0.0)] * 3, *boxes)
    inside = low + rng.random((200, 80, 9)) * (high - low)
    found = np.linalg.eigvals(inside.reshape(200, 80, 3, 3))
    unstable = np.abs(found) > 1.0 if discrete else found.real > 0.0
    counts = unstable.sum(axis=2)
    known = got >= 0
    assert 30 < known.sum() < 80
    assert np.all(counts[:, known] == got[known])
    assert np.all(got[np.ptp(counts, axis=0) > 0] == -1)


def test_equilibria_of_lorenz_for_intervals_of_rho():
    """A pitchfork at 1, a Hopf bifurcation at 470/19 = 24.7368."""
    count = UnstableCount(LORENZ, [x, y, z], [mu])
    want = {(0.2, 0.4): [0], (20.0, 20.1): [0, 1, 0], (30.0, 30.1): [2, 1, 2]}
    for values, numbers in want.items():
        found = zeros_in_box(
            LORENZ, [x, y, z], {mu: values}, [-12.0, -12.0, -1.0], [12.5, 12.0, 31.0]
        )
        assert found.complete
        low, high = found.boxes
        rho = (np.full(len(low), values[0]), np.full(len(low), values[1]))
        assert count(*zip(low.T, high.T, strict=True), rho).tolist() == numbers
    root = sp.sqrt(sp.Rational(8, 3) * (sp.Rational(470, 19) - 1))
    at = [(float(root), float(root))] * 2 + [(float(sp.Rational(451, 19)),) * 2]
    assert count(*at, (24.7, 24.8)) == -1


def test_a_saddle_is_one_whatever_its_trace_is():
    f = [mu * x + 2 * y, 3 * x]
    count = UnstableCount(f, [x, y], [mu])
    assert count((0.0, 0.0), (0.0, 0.0), (-1.0, 1.0)) == 1
    assert UnstableCount([mu * x - y, x], [x, y], [mu])((0.0, 0.0), (0.0, 0.0), (-1.0, 1.0)) == -1
