"""States far round a circle: as much as their doubles say, and no less."""

import mpmath
import numpy as np
import pytest

import phasekit as pk
from phasekit.phase.numerical import functions
from phasekit.phase.numerical.circle import wrapped
from phasekit.phase.numerical.formula import make_formula

PERIODS = {
    "2*pi": (2.0 * np.pi, lambda: 2 * mpmath.pi),
    "pi": (np.pi, lambda: +mpmath.pi),
    "2*pi/7": (2.0 * np.pi / 7.0, lambda: 2 * mpmath.pi / 7),
    "40*pi": (40.0 * np.pi, lambda: 40 * mpmath.pi),
    "0.1": (0.1, lambda: mpmath.mpf(0.1)),
    "3": (3.0, lambda: mpmath.mpf(3)),
}


@pytest.mark.parametrize("name", PERIODS)
def test_whole_turns_are_taken_away_without_rounding(name):
    period, exact = PERIODS[name]
    rng = np.random.default_rng(3)
    x = rng.choice([-1.0, 1.0], 40) * 10.0 ** rng.uniform(0.0, 29.0, 40)
    home, turns = wrapped(x, period)
    assert np.isfinite(home).all()
    with mpmath.workdps(80):
        T = exact()
        for one, got, away in zip(x, home, turns, strict=True):
            want = mpmath.mpf(one) - T * mpmath.nint(mpmath.mpf(one) / T)
            assert abs(got - want) <= 1e-15 * abs(want) + 1e-25 * T
            assert away == one - got
    assert np.isnan(wrapped(np.array([1e300, -np.inf]), period)[0]).all()


def pendulum(x, v):
    """The period of -cos x through a state, by elliptic integrals."""
    with mpmath.workdps(60):
        m = (mpmath.mpf(v) ** 2 / 2 - mpmath.cos(mpmath.mpf(x)) + 1) / 2
        if m < 1:
            return 4 * mpmath.ellipk(m)
        return 2 * mpmath.ellipk(1 / m) / mpmath.sqrt(m)


def test_periods_far_round_the_circle_are_as_good_as_they_say():
    formula = make_formula("-cos(x)", "x", (), 2.0 * np.pi, None)
    rng = np.random.default_rng(5)
    x = rng.choice([-1.0, 1.0], 60) * 10.0 ** rng.uniform(1.0, 13.0, 60)
    v = rng.uniform(-2.5, 2.5, 60)
    got = functions.orbits(formula, x, v)
    want = [pendulum(*state) for state in zip(x, v, strict=True)]
    off = [float(abs(t - w)) for t, w in zip(got.period, want, strict=True)]
    assert np.isfinite(got.period).all()
    assert np.all(off <= got.period_error)
    assert np.all(got.period_error <= 1e-11 * got.period)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("text", "period"),
    [("-exp(cos(x))", 2.0 * np.pi), ("-exp(cos(4*x))", 0.5 * np.pi), ("tanh(cos(2*pi*x/3))", 3.0)],
)
def test_orbits_of_any_function_are_the_same_far_round_the_circle(text, period):
    formula = make_formula(text, "x", (), period, None)
    rng = np.random.default_rng(7)
    x = rng.choice([-1.0, 1.0], 20) * 10.0 ** rng.uniform(2.0, 10.0, 20)
    v = rng.uniform(-0.8, 0.8, 20)
    with mpmath.workdps(50):
        T = mpmath.pi * round(period / np.pi * 2) / 2 if period != 3.0 else mpmath.mpf(3)
        home = [float(mpmath.mpf(u) - T * mpmath.nint(mpmath.mpf(u) / T)) for u in x]
    far, near = (functions.orbits(formula, u, v) for u in (x, np.array(home)))
    known = np.isfinite(near.period)
    assert known.sum() >= 10
    assert far.orbit_kind.tolist() == near.orbit_kind.tolist()
    off = np.abs(far.period - near.period)[known]
    assert np.all(off <= (far.period_error + near.period_error)[known])


@pytest.mark.slow
def test_motions_far_round_the_circle_start_where_they_are():
    formula = make_formula("-cos(x)", "x", (), 2.0 * np.pi, None)
    rng = np.random.default_rng(6)
    x = rng.choice([-1.0, 1.0], 6) * 10.0 ** rng.uniform(3.0, 10.0, 6)
    v = rng.uniform(-2.5, 2.5, 6)
    got = functions.flow_with_errors(formula, x, v, 2.0)
    assert np.all(got.motion_dphi_error < 1e-12)
    with mpmath.workdps(25):
        for k in range(6):
            solved = mpmath.odefun(
                lambda _, y: [y[1], -mpmath.sin(y[0])], 0, [mpmath.mpf(x[k]), mpmath.mpf(v[k])]
            )
            place, speed = solved(2)
            assert abs(place - got.motion_phi[k]) <= got.motion_phi_error[k]
            assert abs(speed - got.motion_dphi[k]) <= got.motion_dphi_error[k]


@pytest.mark.parametrize("abc", [(1.0, 0.35, 0.12), (0.0, 1.0, 0.0), (-2.0, 0.3, 0.5), (1, 0, 0.2)])
@pytest.mark.parametrize("size", [1e6, 1e12, 1e15, 5e15])
def test_orbits_far_round_the_circle_are_those_of_the_angle_on_its_turn(abc, size):
    rng = np.random.default_rng(int(np.log10(size)))
    far, rate = np.round(rng.uniform(0.5, 1.0, 40) * size), rng.uniform(0.0, 2.2, 40)
    with mpmath.workdps(50):
        turns = [mpmath.nint(mpmath.mpf(one) / (2 * mpmath.pi)) for one in far]
        near = [
            float(mpmath.mpf(one) - 2 * mpmath.pi * n) for one, n in zip(far, turns, strict=True)
        ]
    system = pk.Coefficients(*abc)
    found, true = pk.orbits(system, far, rate), pk.orbits(system, near, rate)
    for name in ("orbit_kind", "period", "action", "amplitude", "orbit_energy"):
        one, other = (ds[name].values for ds in (found, true))
        np.testing.assert_allclose(one, other, rtol=1e-9, atol=1e-13, err_msg=name)
    low, high = (found[name].values for name in ("phi_min", "phi_max"))
    swings = np.isfinite(low)
    assert ((low <= far) & (far <= high))[swings].all()
