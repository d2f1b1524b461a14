"""Errors of motions on and next to separatrices, against integration with 25 digits."""

import mpmath
import numpy as np
import pytest
from witnesses.variants import some

from phasekit.phase.numerical import functions
from phasekit.phase.numerical.formula import make_formula

SYSTEMS = {
    "well": ("x^4/4 - x^2/2", None, lambda x: x - x**3, lambda x: x**2 / 2 - x**4 / 4),
    "pendulum": ("-cos(x)", 2.0 * np.pi, lambda x: -mpmath.sin(x), lambda x: 1 + mpmath.cos(x)),
}


@pytest.mark.slow
@pytest.mark.parametrize("name", SYSTEMS)
@pytest.mark.parametrize("off", some([-1e-10, 0.0], 2))
def test_errors_hold_what_saddles_make_of_rounding(name, off):
    text, period, force, fall = SYSTEMS[name]
    formula = make_formula(text, "x", (), period, None)
    x, v = 0.9, float(mpmath.sqrt(2 * fall(mpmath.mpf(0.9)))) * (1.0 + off)
    time = np.array([0.7, 6.0, 14.0, 21.0, 29.0])
    got = functions.flow_with_errors(formula, x, v, time)
    with mpmath.workdps(25):
        solved = mpmath.odefun(lambda _, y: [y[1], force(y[0])], 0, [mpmath.mpf(x), mpmath.mpf(v)])
        want = [solved(t) for t in time]
    assert np.isfinite(got.motion_phi_error).all()
    for k, (place, speed) in enumerate(want):
        assert abs(place - got.motion_phi[k]) <= got.motion_phi_error[k]
        assert abs(speed - got.motion_dphi[k]) <= got.motion_dphi_error[k]
    # No more than neighboring doubles part by, with some to spare.
    assert np.all(got.motion_phi_error[:3] <= 1e-13 * np.exp(time[:3]))


def well(x, _, t):
    """From rest at x, above the well of x^4/4 - x^2/2: by the elliptic functions dn and cn."""
    m = 2 * (x * x - 1) / (x * x)
    if m < 1:
        return x * mpmath.ellipfun("dn", x * t / mpmath.sqrt(2), m=m)
    return x * mpmath.ellipfun("cn", x * mpmath.sqrt(m / 2) * t, m=1 / m)


def pendulum(_, v, t):
    """From the bottom: sin(x/2) = (v/2) sn(t); its rotations by quarters of their periods."""
    if v < 2:
        return 2 * mpmath.asin(v / 2 * mpmath.ellipfun("sn", t, m=v * v / 4))
    m, u = 4 / (v * v), v * t / 2
    turns = mpmath.nint(u / (2 * mpmath.ellipk(m)))
    sine = mpmath.ellipfun("sn", u - 2 * turns * mpmath.ellipk(m), m=m)
    return 2 * (mpmath.asin(sine) + turns * mpmath.pi)


def cubic(x, _, t):
    """From rest at the lower end of x^2/2 - x^3/3: by sn^2 between two roots of V = h."""
    middle, product = (mpmath.mpf(3) / 2 - x) / 2, x * x - mpmath.mpf(3) / 2 * x
    root = mpmath.sqrt(middle * middle - product)
    low, high = middle - root, middle + root
    sine = mpmath.ellipfun("sn", mpmath.sqrt((high - x) / 6) * t, m=(low - x) / (high - x))
    return x + (low - x) * sine * sine


def morse(x, _, t):
    """From rest at the inner end of (1 - exp(-x))^2."""
    root = mpmath.exp(-x) - 1
    rest = 1 - root * root
    return mpmath.log((1 - root * mpmath.cos(mpmath.sqrt(2 * rest) * t)) / rest)


def sech(_, v, t):
    """From the bottom of -1/cosh(x)^2: sinh(x) is a sine."""
    pace = mpmath.sqrt(2 - v * v)
    return mpmath.asinh(v / pace * mpmath.sin(pace * t))


#: Formula, period, interval, motion, where it is at rest or else is fast on the separatrix, sides.
CLOSED = {
    "well": ("x^4/4 - x^2/2", None, None, well, (np.sqrt(2.0), None), (-1, 1)),
    "pendulum": ("-cos(x)", 2.0 * np.pi, None, pendulum, (None, 2.0), (-1, 1)),
    "cubic": ("x^2/2 - x^3/3", None, None, cubic, (-0.5, None), (-1,)),
    "morse": ("(1 - exp(-x))^2", None, (-5.0, 100.0), morse, (-np.log(2.0), None), (-1,)),
    "sech": ("-1/cosh(x)^2", None, (-60.0, 60.0), sech, (None, np.sqrt(2.0)), (-1,)),
}
GAPS = (1e-2, 1e-5, 1e-8, 1e-12)


@pytest.mark.slow
@pytest.mark.parametrize("name", some(CLOSED, 2))
def test_errors_are_about_as_large_as_what_is_off(name):
    """Never too small, and in most places within the spread that rounding itself has."""
    text, period, interval, motion, (place, speed), sides = CLOSED[name]
    formula = make_formula(text, "x", (), period, interval)
    rng = np.random.default_rng(8)
    over = []
    for gap, side in ((gap, side) for gap in GAPS for side in sides):
        near = (place or speed) * (1.0 + side * gap * rng.uniform(0.5, 2.0, 4))
        still = np.zeros(4)
        x, v = (still, near) if place is None else (near, still)
        round_ = functions.orbits(formula, x, v).period
        round_ = np.where(round_ < 500.0, round_, 25.0)
        time = round_ * rng.uniform(0.05, 2.2, (6, 1)) * rng.choice([-1.0, 1.0])
        got = functions.flow_with_errors(formula, x, v, time)
        off = np.empty(time.shape)
        with mpmath.workdps(40):
            for at in np.ndindex(time.shape):
                exact = motion(*(mpmath.mpf(a) for a in (x[at[1]], v[at[1]], time[at])))
                off[at] = float(abs(exact - mpmath.mpf(float(got.motion_phi[at]))))
        assert np.all(off <= got.motion_phi_error), (gap, side)
        over.append(np.median(got.motion_phi_error, axis=1) / np.max(off, axis=1))
    over = np.concatenate(over)
    # Rounding adds up by luck, which differs from one processor's mathematics to the next: what is
    # off may be a tenth of what it may come to, and here it is, with some to spare.
    assert np.median(over) < 20.0
    assert np.quantile(over, 0.9) < 40.0


def lobe(t, center=0):
    return center + mpmath.sqrt(2) / mpmath.cosh(t)


def over_the_top(t):
    return mpmath.pi + 4 * mpmath.atan(mpmath.exp(t))


def dip(t):
    return 1 - mpmath.mpf(3) / 2 * mpmath.sech(t / 2) ** 2


#: Formula, period, side, motion on the separatrix, by how much its errors are too large at most.
LEVELS = {
    "lobe": ("x^4/4 - x^2/2", None, 1, lobe, 40.0),
    "lobe elsewhere": ("(x - 3)^4/4 - (x - 3)^2/2", None, 1, lambda t: lobe(t, 3), 200.0),
    "pendulum": (
        "-cos(x)",
        2 * np.pi,
        1,
        lambda t: mpmath.pi + 4 * mpmath.atan(mpmath.exp(t)),
        90.0,
    ),
    "kink": ("x^2/2 - x^4/4", None, 1, lambda t: mpmath.tanh(t / mpmath.sqrt(2)), 60.0),
    "cubic": (
        "x^2/2 - x^3/3",
        None,
        0,
        lambda t: 1 - mpmath.mpf(3) / 2 * mpmath.sech(t / 2) ** 2,
        90.0,
    ),
}


@pytest.mark.slow
@pytest.mark.parametrize("name", LEVELS)
def test_errors_on_separatrices_stay_small_next_to_saddles(name):
    text, period, side, motion, most = LEVELS[name]
    formula = make_formula(text, "x", (), period, None)
    time = np.linspace(-40.0, 40.0, 33)
    got = functions.separatrix_motion_with_errors(formula, time, side=side)
    with mpmath.workdps(40):
        exact = [(motion(t), mpmath.diff(motion, t)) for t in map(mpmath.mpf, time)]
    for x, v, off, late, (place, speed) in zip(*got, exact, strict=True):
        assert abs(x - place) <= off
        assert abs(v - speed) <= late
    assert np.all(got.motion_phi_error <= most * 2.0**-53 * (1.0 + np.abs(got.motion_phi)))
