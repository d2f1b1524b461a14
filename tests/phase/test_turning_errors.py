"""Turning points lie within their errors: flat tails, neighbors of saddles, any size of doubles."""

import mpmath
import numpy as np
import pytest
from witnesses.variants import some

import phasekit as pk
from phasekit.errors import OrbitKind
from phasekit.phase.numerical import functions
from phasekit.phase.numerical.formula import make_formula

#: Formula, interval, V of mpmath, its wells: where orbits start, at rest, and from -> to.
TAILS = {
    "sech": ("-1/cosh(x)^2", (-40.0, 40.0), lambda x: -1 / mpmath.cosh(x) ** 2, (0.5, 19.0)),
    "gauss": ("-exp(-x^2)", (-9.0, 9.0), lambda x: -mpmath.exp(-(x**2)), (0.1, 6.1)),
    "lorentz": ("-1/(1 + x^2)", (-1e4, 1e4), lambda x: -1 / (1 + x**2), (0.1, 5e3)),
    "offset": ("1e6 + x^2/2 + x^4/4", None, lambda x: x**2 / 2 + x**4 / 4, (1e-8, 1e3)),
    "duffing": ("x^4/4 - x^2/2", None, lambda x: x**4 / 4 - x**2 / 2, (1.5, 30.0)),
}


def crossing(V, x):
    """The point on the other side of a well that is even, by V alone: not by its symmetry."""
    with mpmath.workdps(50):
        h, low, high = V(mpmath.mpf(x)), mpmath.mpf(-2 * x), mpmath.mpf(-x) / 2
        for _ in range(160):
            middle = (low + high) / 2
            low, high = (middle, high) if V(middle) > h else (low, middle)
        return low


@pytest.mark.parametrize("name", TAILS)
def test_turning_points_lie_within_their_errors(name):
    text, interval, V, (least, most) = TAILS[name]
    formula = make_formula(text, "x", (), None, interval)
    rng = np.random.default_rng(3)
    start = np.exp(rng.uniform(np.log(least), np.log(most), 40))
    got = functions.orbits(formula, start, 0.0)
    known = got.orbit_kind == OrbitKind.LIBRATION
    assert known.sum() > 30
    assert np.isfinite(got.phi_min_error[known]).sum() > 30
    for x, low, off in zip(start, got.phi_min, got.phi_min_error, strict=True):
        assert off > 0.0
        if np.isfinite(off):
            assert abs(mpmath.mpf(low) - crossing(V, x)) <= off
    np.testing.assert_array_equal(got.phi_max[known], start[known])
    assert (got.phi_max_error[known & (got.phi_min_error < 0.01)] == 0.0).all()


def test_errors_are_small_where_v_is_steep():
    formula = make_formula("x^4/4 - x^2/2", "x", (), None, None)
    got = functions.orbits(formula, np.array([0.3, 0.7, 1.2, 3.0, 50.0]), 0.1)
    assert (got.phi_min_error < 1e-13 * (1.0 + np.abs(got.phi_min))).all()
    assert (got.phi_max_error < 1e-13 * (1.0 + np.abs(got.phi_max))).all()


@pytest.mark.parametrize("gap", [1e-4, 1e-9, 1e-13, 1e-15])
def test_next_to_a_saddle(gap):
    """A pendulum from a state of nearly the energy of its saddle: cos(phi) = 1 - v^2/2 turns."""
    formula = make_formula("-cos(x)", "x", (), 2.0 * np.pi, None)
    speed = np.sqrt(4.0 - 2.0 * gap)
    got = functions.orbits(formula, 0.0, speed)
    assert got.orbit_kind in (OrbitKind.LIBRATION, OrbitKind.ASYMPTOTIC)
    with mpmath.workdps(50):
        want = mpmath.acos(1 - mpmath.mpf(float(speed)) ** 2 / 2)
        assert abs(want - float(got.phi_max)) <= got.phi_max_error
        assert abs(want + float(got.phi_min)) <= got.phi_min_error
    assert got.phi_max_error < 1e-6


def test_orbits_that_may_not_turn():
    """Rotations have no turning points; where V is flat to rounding nobody knows."""
    formula = make_formula("-cos(x)", "x", (), 2.0 * np.pi, None)
    assert np.isnan(functions.orbits(formula, 0.0, 3.0).phi_min_error)
    tail = make_formula("-1/cosh(x)^2", "x", (), None, (-40.0, 40.0))
    unseen = functions.orbits(tail, 25.0, 0.0)
    assert unseen.phi_min_error == unseen.period_error == np.inf
    assert np.isnan([unseen.period, unseen.frequency]).all()
    away = functions.orbits(tail, 0.0, 2.0)  # it leaves the interval
    assert (away.phi_min_error, away.period, away.period_error) == (0.0, np.inf, 0.0)


@pytest.mark.parametrize("power", [4, 6, 8])
@pytest.mark.parametrize(
    "exponent", some([-200, -160, -100, -60, -30, 30, 60, 77, 100, 160][::-1], 3)
)
def test_powers_of_any_size_are_right_or_refused(power, exponent):
    formula = make_formula(f"x^{power}", "x", (), None, None)
    size = 1.3 * 10.0**exponent
    rest, still = functions.orbits(formula, size, 0.0), functions.orbits(formula, 0.0, size)
    if abs(power * exponent) < 250:
        assert rest.orbit_kind == still.orbit_kind == OrbitKind.LIBRATION
    with mpmath.workdps(30):
        quarter = mpmath.beta(mpmath.mpf(1) / power, mpmath.mpf(1) / 2) / power
        for got, a in (
            (rest, mpmath.mpf(size)),
            (still, (mpmath.mpf(size) ** 2 / 2) ** (mpmath.mpf(1) / power)),
        ):
            if got.orbit_kind == OrbitKind.NOT_COMPUTED:
                assert np.isnan([got.period, got.phi_min, got.phi_min_error]).all()
                continue
            assert got.orbit_kind == OrbitKind.LIBRATION
            want = 4 * quarter / mpmath.sqrt(2 * a**power) * a
            assert np.isnan(got.period) or abs(got.period / want - 1) < 1e-11
            assert abs(got.phi_max - a) <= got.phi_max_error + 1e-15 * a
            assert abs(got.phi_min + a) <= got.phi_min_error


@pytest.mark.parametrize("torque", [0.0, 0.3, -0.8])
def test_turning_points_of_pendulums_have_errors_under_a_torque(torque):
    """In closed form they need none: they are right to a few units in the last place."""
    system = pk.Pendulum(length=1.0, g=1.0)
    if torque:
        system = pk.Perturbed(system, torque=torque)
    rng = np.random.default_rng(4)
    with mpmath.workdps(40):
        bottom = mpmath.asin(mpmath.mpf(torque))
        side = 1 if torque >= 0.0 else -1
        saddle = side * mpmath.pi - bottom

        def V(x):
            return -mpmath.cos(x) - mpmath.mpf(torque) * x

        gaps = 10.0 ** -np.arange(1.0, 14.0)
        x = float(bottom) + rng.uniform(-0.3, 0.3, gaps.size)
        fall = [V(saddle) - V(mpmath.mpf(a)) for a in x]
        v = np.array([float(mpmath.sqrt(2 * (f - g))) for f, g in zip(fall, gaps, strict=True)])
        got = pk.orbits(system, x, v)
        assert ("phi_max_error" in got) == bool(torque)
        end = got.phi_max if side > 0 else got.phi_min
        error = np.full(x.size, 1e-14)
        if torque:
            error = (got.phi_max_error if side > 0 else got.phi_min_error).values
            assert np.all(error < 1e-13 / np.sqrt(gaps))
        known = got.orbit_kind.values == OrbitKind.LIBRATION
        assert known.sum() > 10
        for a, b, turn, most in zip(*(q[known] for q in (x, v, end.values, error)), strict=True):
            h = mpmath.mpf(b) ** 2 / 2 + V(mpmath.mpf(a))
            low, high = bottom, saddle
            for _ in range(130):
                middle = (low + high) / 2
                low, high = (middle, high) if V(middle) < h else (low, middle)
            assert abs(mpmath.mpf(float(turn)) - low) <= most
