"""One curve through tubes about the chords of its points, against curves in closed form."""

import numpy as np
import pytest
import sympy as sp

import phasekit as pk
from phasekit.laws.formulas import symbols_of
from phasekit.numerics.intervals.tubes import tubes_about
from phasekit.numerics.intervals.zeros import System

x, y, mu = sp.symbols("x y mu", real=True)


def helix(t):
    return np.stack([np.cos(t), np.sin(t), t], axis=-1)


def tubes(system, points):
    return tubes_about(system, points[:-1], points[1:])


def complete(found):
    """Whether one curve passes all tubes."""
    return found.proved.all() and found.joined.all()


def first_around(found, points):
    """The first tube in which a zero at each point is on the curve; -1 where there is none."""
    count, n = found.middle.shape
    around = [
        found.hold(np.tile(u, (count, 1)), np.zeros((count, n, 0)), np.zeros((count, 0)))
        for u in points
    ]
    return np.array([np.argmax(inside) if inside.any() else -1 for inside in around])


HELIX = System([x - sp.cos(mu), y - sp.sin(mu)], [x, y, mu], {})


@pytest.mark.parametrize("n", [12, 60])
def test_a_curve_lies_within_the_radii_and_is_joined(n):
    t = np.linspace(-3.0, 3.0, n)
    found = tubes(HELIX, helix(t))
    assert complete(found)
    inside = 0.5 * (t[:-1] + t[1:])
    for part in (0.02, 0.4, 0.73):
        u = helix(t[:-1] + part * np.diff(t)) - found.middle
        away = np.abs(np.einsum("ki,kij->kj", u, found.across))
        assert np.all(away <= found.radius)
    np.testing.assert_array_equal(first_around(found, helix(inside)), np.arange(n - 1))
    # The distance of an arc from its chord, which falls by the square of its length.
    sagitta = 1.0 - np.cos(0.5 * np.diff(t))
    assert np.all(found.radius.max(axis=1) >= sagitta)
    assert np.all(found.radius.max(axis=1) < 8.0 * sagitta)
    assert first_around(found, [[9.0, 9.0, 0.0]]).tolist() == [-1]


def test_points_off_the_curve_are_proved_to_be_near_it():
    t = np.linspace(0.0, 2.0, 30)
    found = tubes(HELIX, helix(t) + 1e-4 * np.random.default_rng(0).normal(size=(30, 3)))
    assert complete(found)


def test_chords_that_are_too_long_are_not_proved():
    found = tubes(HELIX, helix(np.array([0.0, 0.3, 0.6, 4.0, 4.3])))
    assert found.proved.tolist() == [True, True, False, True]
    assert found.joined.tolist() == [True, False, False]


def test_a_fold_is_passed_and_a_branch_point_is_not():
    t = np.linspace(-1.0, 1.0, 25)
    fold = tubes(System([mu - x**2], [x, mu], {}), np.stack([t, t**2], axis=1))
    assert complete(fold)
    trivial = np.stack([0.0 * t, t], axis=1)
    pitchfork = tubes(System([mu * x - x**3], [x, mu], {}), trivial)
    assert not pitchfork.proved[11:13].any()
    assert pitchfork.proved[:10].all()
    assert pitchfork.proved[14:].all()


def test_a_jump_between_branches_is_seen():
    """Points of two branches that the chord between them does not follow."""
    system = System([(x - mu) * (x + mu) - sp.Rational(1, 400)], [x, mu], {})
    m = np.linspace(-1.0, 1.0, 161)
    hyperbola = np.sqrt(m**2 + 0.0025)
    assert complete(tubes(system, np.stack([hyperbola, m], axis=1)))
    crossed = np.where(m < -0.001, hyperbola, -hyperbola)
    found = tubes(system, np.stack([crossed, m], axis=1))
    assert not complete(found)
    assert np.flatnonzero(~found.proved).tolist() == [79]


def test_intervals_of_parameters_are_proved_for_all_their_values():
    nu = sp.Symbol("nu", real=True)
    t = np.linspace(-1.0, 1.0, 25)
    system = System([mu - nu * x**2], [x, mu], {nu: (0.99, 1.01)})
    found = tubes(system, np.stack([t, t**2], axis=1))
    assert complete(found)
    for k in (0.99, 1.01):
        u = np.stack([t, k * t**2], axis=1)[1:-1]
        assert np.all(first_around(found, u) >= 0)


def test_a_branch_of_the_continuation_is_one_curve():
    problem = pk.Problem(["mu*x - x^3 + 1/10 - y", "x - 2*y + sin(x)/3"], ("x", "y"), {"mu": 1.0})
    branch = pk.continuation(problem, "mu", x0=[0.9, 0.6], span=(-1.0, 2.0))
    ds = branch.to_dataset()
    points = np.column_stack([ds[name].values for name in ("x", "y", "mu")])
    symbols = symbols_of(["x", "y", "mu"])
    found = tubes(System(problem.f, list(symbols.values()), {}), points)
    assert complete(found)
    assert len(found.proved) > 10
