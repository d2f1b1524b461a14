"""All curves of a formula in a rectangle, against curves that are known and a fine grid."""

import contourpy
import numpy as np
import pytest
import sympy as sp

from phasekit.numerics.intervals.curves import closed_curves, factors, zero_curves

x, y, h = sp.symbols("x y h", real=True)
BOX = ([-2.0, -1.9], [2.1, 2.0])


def is_closed(line):
    return bool(np.all(line[0] == line[-1]))


#: Formula, closed curves and open ones in the rectangle.
KNOWN = {
    "circles and a line": ((x**2 + y**2 - 1) * (x - y) * ((x - 1) ** 2 + y**2 - sp.Rational(1, 9)),
                           2, 1),
    "two ovals": ((x**2 + y**2) ** 2 - 2 * (x**2 - y**2) + sp.Rational(1, 20), 2, 0),
    "one oval": ((x**2 + y**2) ** 2 - 2 * (x**2 - y**2) - sp.Rational(1, 20), 1, 0),
    "grid of ovals": (sp.cos(4 * x) + sp.cos(4 * y) - sp.Rational(3, 2), 9, 0),
    "a tiny circle": ((x - sp.Rational(3, 10)) ** 2 + (y - sp.Rational(1, 7)) ** 2
                      - sp.Rational(1, 10**8), 1, 0),
    "arcs of a hyperbola": (x * y - sp.Rational(1, 1000), 0, 2),
    "an isolated pole": (1 / x - y, 0, 2),
    "poles": (sp.tan(x) - y, 0, 2),
    "a logarithm": (sp.log(1 + x) - y, 0, 1),
    "nothing": (x**2 + y**2 + sp.exp(x * y), 0, 0),
}  # fmt: skip


@pytest.mark.slow
@pytest.mark.parametrize("name", KNOWN)
def test_known_curves_are_all_found(name):
    f, closed, open_ = KNOWN[name]
    found = zero_curves(f, (x, y), {}, *BOX)
    assert found.complete
    assert sum(map(is_closed, found.lines)) == closed
    assert len(found.lines) == closed + open_
    value = sp.lambdify((x, y), f)
    slope = sp.lambdify((x, y), sp.sqrt(f.diff(x) ** 2 + f.diff(y) ** 2))
    for line in found.lines:
        inside = np.all((line >= BOX[0]) & (line <= BOX[1]))
        assert inside
        with np.errstate(all="ignore"):
            off = np.abs(value(*line.T) / slope(*line.T))
        assert np.nanmax(off) < 1e-13
        if not is_closed(line):  # it ends at the edge
            away = np.abs(line[[0, -1]][:, None] - np.array(BOX)).min(axis=(1, 2))
            assert np.all(away == 0.0)


def test_points_lie_close_together_and_those_of_a_circle_go_round_it():
    (line,) = zero_curves(x**2 + y**2 - 1, (x, y), {}, *BOX, resolution=128).lines
    steps = np.linalg.norm(np.diff(line, axis=0), axis=1)
    assert steps.max() < 4.1 / 90  # the diagonal of a box
    turned = np.unwrap(np.arctan2(line[:, 1], line[:, 0]))
    assert abs(turned[-1] - turned[0]) == pytest.approx(2 * np.pi)


def test_curves_on_the_edge_belong_to_the_rectangle():
    found = zero_curves(x * (1 - x - y), (x, y), {}, [0.0, 0.0], [1.0, 1.0])
    assert found.complete
    axis, line = found.lines
    np.testing.assert_array_equal(axis[:, 0], 0.0)
    assert sorted(axis[[0, -1], 1]) == [0.0, 1.0]
    np.testing.assert_allclose(sorted(line[[0, -1], 0]), [0.0, 1.0], atol=1e-15)


@pytest.mark.parametrize(
    ("f", "where"),
    [
        (y**2 - x**2 * (x + 1), [0.0, 0.0]),  # a node, which has no factors
        (y**2 - x**3, [0.0, 0.0]),  # a cusp
        (x**2 + (y - 1) ** 2, [0.0, 1.0]),  # a point
        (x * (1 - x) - x * y / (x + 1), [-1.0, 0.0]),  # where the denominator vanishes as well
        (sp.sqrt(x) - y, [0.0, 0.0]),  # the end of a domain
    ],
    ids=str,
)
def test_what_is_not_regular_is_named(f, where):
    found = zero_curves(f, (x, y), {}, *BOX)
    assert not found.complete
    low, high = found.undecided
    assert np.all(low.min(axis=0) <= where)
    assert np.all(high.max(axis=0) >= where)
    assert np.all(high.max(axis=0) - low.min(axis=0) < 0.1)


@pytest.mark.slow
def test_a_formula_that_vanishes_everywhere_leaves_all_undecided():
    nothing = sp.cos(x) ** 2 + sp.sin(x) ** 2 - 1
    low, high = zero_curves(nothing, (x, y), {}, *BOX).undecided
    assert np.all(low.min(axis=0) <= BOX[0])
    assert np.all(high.max(axis=0) >= BOX[1])


def test_formulas_are_taken_apart():
    above, below = factors(x * (1 - x) - x * y / (x + h), (x, y))
    assert x in above
    assert len(above) == 2
    assert below == [h + x]
    assert sp.expand(sp.prod(above) + (x * (1 - x) * (x + h) - x * y)) == 0
    above, _ = factors(sp.Float(0.1) * (x - y) ** 2 * sp.exp(x), (x, y))
    assert set(above) == {x - y, sp.exp(x)}


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(8))
def test_random_curves_are_those_of_a_fine_grid(seed):
    """Each line of a grid lies on one that was found, and none of these is missed by it."""
    rng = np.random.default_rng(seed)
    powers = [(i, j) for i in range(4) for j in range(4 - i)]
    numbers = rng.integers(-9, 10, len(powers)).tolist()
    f = sum(c * x**i * y**j for c, (i, j) in zip(numbers, powers, strict=True)) / 8
    f += sp.Rational(int(rng.integers(1, 9)), 4) * sp.sin(2 * x + y)
    found = zero_curves(f, (x, y), {}, *BOX)
    assert found.complete
    axes = [np.linspace(a, b, 801) for a, b in zip(*BOX, strict=True)]
    grid = sp.lambdify((x, y), f)(*np.meshgrid(*axes))
    lines = contourpy.contour_generator(*axes, grid).lines(0.0)
    assert len(lines) == len(found.lines)
    for line in lines:
        near = [
            np.min(np.linalg.norm(own[:, None] - line[len(line) // 2], axis=2))
            for own in found.lines
        ]
        assert min(near) < 4.1 / 200


@pytest.mark.parametrize(
    ("center", "number"),
    # Inside, on the edge from within, beyond it by less than is proved, and plainly beyond it.
    [(0, 1), (1, 1), (1 + sp.Rational(1, 10**12), 1), (sp.Rational(3, 2), 0), (4, 0)],
)
def test_a_closed_curve_is_left_out_only_where_it_surely_leaves(center, number):
    circle = (x - center) ** 2 + y**2 - 1
    assert closed_curves(circle, (x, y), np.array([-2.0, -2.0]), np.array([2.0, 2.0])) == number
