"""All zeros of formulas in a box, for numbers and for intervals of parameters."""

import numpy as np
import pytest
import scipy.special
import sympy as sp

from phasekit.numerics.intervals import bisection
from phasekit.numerics.intervals.zeros import zeros_in_box, zeros_of_cells

x, y, z, mu, nu = sp.symbols("x y z mu nu", real=True)
LORENZ = [10 * (y - x), x * (mu - z) - y, x * y - sp.Rational(8, 3) * z]

#: Boxes that the search by arrays of NumPy visited, before it was compiled.
VISITED = [
    ([x**4 / 4 - 2 * x**2 + x / 7], [x], {}, 53),
    ([sp.sin(3 * x) - x / 5 + sp.exp(-(x**2))], [x], {}, 49),
    ([x**2 + y**2 - 4, x * y - 1], [x, y], {}, 71),
    ([x * (1 - x - 2 * y / (x + 5)), y * (sp.tanh(x) - sp.Rational(1, 2)) - y**3], [x, y], {}, 113),
    (LORENZ, [x, y, z], {mu: 28.0}, 241),
    ([x - sp.sin(y), y - sp.cos(z), z - x * y], [x, y, z], {}, 75),
]


@pytest.mark.parametrize(("f", "states", "values", "most"), VISITED)
def test_no_more_boxes_are_visited_than_before(f, states, values, most):
    reach = 50.0 if f is LORENZ else 4.1
    found = zeros_in_box(f, states, values, [-reach] * len(states), [reach + 0.3] * len(states))
    assert found.visited <= most
    for row in found.zeros:
        at = {**values, **dict(zip(states, map(sp.Float, row), strict=True))}
        assert all(abs(g.subs(at)) < 1e-12 for g in f)


def test_zeros_of_all_values_of_parameters_lie_in_their_boxes():
    """They are sqrt(nu) and mu/sqrt(nu), with both signs."""
    f = [x**2 - nu, x * y - mu]
    found = zeros_in_box(f, [x, y], {mu: (0.9, 1.1), nu: (1.9, 2.2)}, [-5, -5], [5, 5])
    assert found.complete
    assert len(found.zeros) == 2
    for m in (0.9, 1.0, 1.1):
        for n in (1.9, 2.05, 2.2):
            for (low, high), sign in zip(zip(*found.boxes, strict=True), (-1.0, 1.0), strict=True):
                root = sign * np.array([np.sqrt(n), m / np.sqrt(n)])
                assert np.all((root > low - 1e-15) & (root < high + 1e-15))
    np.testing.assert_allclose(found.zeros[1], [np.sqrt(2.05), 1.0 / np.sqrt(2.05)], rtol=1e-15)


def test_a_fold_among_the_values_leaves_its_place_open():
    found = zeros_in_box([x**2 - mu], [x], {mu: (-0.01, 0.04)}, [-2.0], [2.0])
    assert not found.complete
    assert not len(found.zeros)
    low, high = found.undecided
    assert low.min() <= -0.2
    assert 0.2 <= high.max() < 0.25
    apart = zeros_in_box([x**2 - mu], [x], {mu: (0.016, 0.03)}, [-2.0], [2.0])
    assert apart.complete
    assert len(apart.zeros) == 2


def test_a_zero_that_leaves_the_box_is_not_counted_for_all_values():
    f = [x - mu, y]
    found = zeros_in_box(f, [x, y], {mu: (0.9, 1.1)}, [-1.0, -1.0], [1.0, 1.0])
    assert not found.complete
    assert not len(found.zeros)
    assert found.undecided[1].max() >= 1.1
    outside = zeros_in_box(f, [x, y], {mu: (1.2, 1.3)}, [-1.0, -1.0], [1.0, 1.0])
    assert outside.complete
    assert not len(outside.zeros)


def test_pitchfork_values_beside_the_point():
    """One zero below it, three above, and nothing said where it is among the values."""
    f, box = [mu * x - x**3], ([-3.0], [3.0])
    counts = [
        (len(found.zeros), found.complete)
        for found in (
            zeros_in_box(f, [x], {mu: values}, *box)
            for values in ((-2.0, -0.1), (0.38, 0.42), (-0.1, 0.1))
        )
    ]
    assert counts == [(1, True), (3, True), (0, False)]


@pytest.mark.parametrize("n", [1, 2, 3])
def test_cells_one_by_one_are_cells_side_by_side(monkeypatch, n):
    """Compiled code leaves the search by generations nothing, or all; also of double zeros."""
    rng = np.random.default_rng(n)
    states = sp.symbols(f"x0:{n}", real=True)
    f = [
        sp.sin(a) + nu * a * b - mu * a**2 + sp.exp(b) / 4 - sp.Rational(k + 1, 3)
        for k, (a, b) in enumerate(zip(states, (*states[1:], states[0]), strict=True))
    ]
    if n < 3:
        f[-1] = (states[-1] - mu) * (states[-1] - nu)
    values = {one: np.append(rng.uniform(-1, 1, 7), 0.5) for one in (mu, nu)}
    corners = np.full(n, -2.0), np.full(n, 2.0)
    cells = zeros_of_cells(f, states, values, *corners)
    monkeypatch.setattr(bisection, "FEW", 0)
    others = zeros_of_cells(f, states, values, *corners)
    assert [own.complete for own in cells] == [True] * 7 + [n == 3]
    assert sum(len(own.zeros) for own in cells) >= 4
    function = sp.lambdify([states, mu, nu], f)
    for own, other, *at in zip(cells, others, *values.values(), strict=True):
        assert (own.complete, own.visited) == (other.complete, other.visited)
        np.testing.assert_allclose(own.zeros, other.zeros, rtol=1e-13, atol=1e-14)
        assert all(np.max(np.abs(function(x, *at))) < 1e-13 for x in own.zeros)


@pytest.mark.parametrize("c", [-1.0, 0.01, 0.2, 0.36, 0.4])
def test_a_box_may_reach_beyond_where_a_formula_is_defined(c):
    """Zeros of log x = c x are -W(-c)/c, those of sqrt(x + 1) = x^2 of a polynomial."""
    found = zeros_in_box([sp.log(x) - c * x], [x], {}, [-3.0], [900.0])
    values = [scipy.special.lambertw(-c, k) for k in (0, -1)]
    expected = sorted({-w.real / c for w in values if w.imag == 0.0})
    assert found.complete
    assert found.zeros[:, 0] == pytest.approx(expected, rel=1e-12)
    beyond = zeros_in_box([sp.sqrt(x + 1) - x**2 - y, y], [x, y], {}, [-4, -3], [4, 3])
    roots = np.roots([1.0, 0.0, 0.0, -1.0, -1.0])
    assert beyond.complete
    assert np.sort(beyond.zeros[:, 0]) == pytest.approx(
        np.sort(roots[np.abs(roots.imag) < 1e-12].real), abs=1e-12
    )


def test_a_zero_where_a_domain_ends_stays_undecided():
    """sqrt(y) = x^2, x = y holds (1, 1), and (0, 0) where no slope is."""
    found = zeros_in_box([x - y, sp.sqrt(y) - x**2], [x, y], {}, [-2, -2], [2, 2])
    assert not found.complete
    assert found.zeros.tolist() == [[pytest.approx(1.0), pytest.approx(1.0)]]
    low, high = found.undecided
    assert np.all((low <= 1e-6) & (high >= -1e-6))


@pytest.mark.parametrize("first", ["-4*x - 1/2", "3*x", "x/3 + 1/7", "sin(x) + x"])
@pytest.mark.parametrize("swapped", [False, True])
def test_a_state_that_is_known_at_once_leaves_the_others_their_digits(first, swapped):
    """Its box is a few doubles wide, in which each step of Newton's method is a long one."""
    symbols = [x, y, z]
    decided = sp.sympify(first, {"x": x})
    f = [decided, x**2 / 3 + 4 * x * y + y**2 / 3 + 4 * y / 3 - 1, z**3 + z - 1 - x * y]
    order = [2, 1, 0] if swapped else [0, 1, 2]
    found = zeros_in_box([f[i] for i in order], [symbols[i] for i in order], {}, [-5] * 3, [5] * 3)
    at = float(sp.nsolve(decided, x, 0))
    want = []
    for one in np.roots([1 / 3, 4 * at + 4 / 3, at**2 / 3 - 1]):
        third = np.roots([1.0, 0.0, 1.0, -1.0 - at * one])
        want.append([at, one, third[np.argmin(np.abs(third.imag))].real])
    got = found.zeros[:, order]
    assert found.complete
    got, want = got[np.argsort(got[:, 1])], sorted(want, key=lambda row: row[1])
    np.testing.assert_allclose(got, want, rtol=1e-13, atol=1e-15)
