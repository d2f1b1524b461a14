"""What a constant in V, and rounding of V, do to orbits: nothing, and no more than is said."""

import warnings

import mpmath
import numpy as np
import pytest
import sympy as sp
from scipy.special import ellipkm1
from witnesses.variants import some

import phasekit as pk
from phasekit.errors import Loop, OrbitKind
from phasekit.phase.numerical import functions
from phasekit.phase.numerical.constants import constant, reduced
from phasekit.phase.numerical.formula import make_formula

TEXT = "-0.35*cos(x) + cos(x)^2/2 - 0.12*sin(x)"
CLOSED = pk.Coefficients(1.0, 0.35, 0.12)
CONSTANTS = (5.0, -1000.0, 1e6)
FAMILIES = {"well_3": "lower_well", "well_1": "upper_well", "wells_1_3": "outer"}


def system(c=0.0, torque=None):
    """The potential of the closed form and a constant."""
    found = pk.Potential(f"{TEXT} + c", "x", {"c": c}, period="2*pi")
    return found if torque is None else pk.Perturbed(found, torque=torque)


def height(x):
    """V of the closed form, with all digits."""
    a, b = mpmath.mpf(0.35), mpmath.mpf(0.12)
    return -a * mpmath.cos(x) + mpmath.cos(x) ** 2 / 2 - b * mpmath.sin(x)


def saddle(which="lower"):
    a, b = mpmath.mpf(0.35), mpmath.mpf(0.12)
    slope = lambda x: a * mpmath.sin(x) - mpmath.sin(x) * mpmath.cos(x) - b * mpmath.cos(x)  # noqa: E731
    return mpmath.findroot(slope, {"lower": -0.19, "upper": -3.05}[which])


def quiet(function, *args, **keywords):
    """Call what may say that some values are not known."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", RuntimeWarning)
        return function(*args, **keywords)


@pytest.mark.parametrize(
    ("text", "names", "values", "part"),
    [
        ("x^2/2 + 5", (), (), 5.0),
        ("cos(x) + c", ("c",), (7.0,), 7.0),
        ("k*(x^2 + c) + 3*(x + d)", ("k", "c", "d"), (2.0, 5.0, 4.0), 22.0),
        ("(1 - exp(-x))^2", (), (), 0.0),
        ("3 + 0*x", (), (), 3.0),
    ],
)
def test_what_does_not_depend_on_the_coordinate_is_taken_out(text, names, values, part):
    formula = make_formula(text, "x", names, None, None)
    x = np.array([-0.7, 0.3, 1.9])
    assert constant(formula, values) == part
    rest = reduced(formula)
    np.testing.assert_allclose(rest.values(x, *values) + part, formula.values(x, *values))
    np.testing.assert_array_equal(rest.slopes(x, *values), formula.slopes(x, *values))


@pytest.mark.parametrize("c", some(CONSTANTS[::-1], 3))
def test_a_constant_is_in_no_result_but_energies(c):
    plain, other = system(), system(c)
    x, dx = [0.4, 1.2, 2.9, -1.1, 0.3], [0.3, -0.8, 1.9, 0.02, 1e-3]
    calls = [
        (pk.equilibria, (), ("phi", "curvature", "kind", "complete"), ("energy",)),
        (pk.separatrices, (), ("lobe_area", "loop", "turning_phi", "lobe_area_error"),
         ("saddle_energy",)),
        (pk.orbits, (x, dx), ("period", "action", "phi_max", "period_error", "orbit_kind"),
         ("orbit_energy",)),
        (pk.action_angle, (x, dx), ("angle", "action", "angle_error"), ()),
        (pk.flow, (x, dx, [3.0, 40.0]), ("motion_phi", "motion_dphi", "motion_phi_error"), ()),
        (pk.orbit_families, (20,), ("period", "action", "period_error"), ("energy_level",)),
    ]  # fmt: skip
    for function, arguments, same, moved in calls:
        one, two = (function(s, *arguments) for s in (plain, other))
        for name in same:
            assert np.isfinite(one[name]).any()
            np.testing.assert_array_equal(two[name], one[name], err_msg=name)
        for name in moved:
            assert np.isfinite(one[name]).any()
            rounding = 4.0 * np.spacing(abs(c))
            np.testing.assert_allclose(two[name] - c, one[name], rtol=0.0, atol=rounding)


@pytest.mark.parametrize(
    ("which", "place"), [("lower", None), ("lower", 0.4), ("lower", 7.5), ("upper", -1.3)]
)
def test_no_period_next_to_a_saddle_is_further_off_than_it_says(which, place):
    """States whose energies are known to 40 digits, against the closed form by the gap."""
    rng = np.random.default_rng(8)
    excess = rng.choice([-1.0, 1.0], 200) * 10.0 ** rng.uniform(-14.0, -2.0, 200)
    plain = system(1000.0)
    x = pk.equilibria(plain).phi.values[3] if place is None else place
    with mpmath.workdps(40):
        top, here = height(saddle(which)), height(mpmath.mpf(float(x)))
        v = np.array([float(mpmath.sqrt(2 * (top + mpmath.mpf(e) - here))) for e in excess])
        gaps = np.array([float(mpmath.mpf(w) ** 2 / 2 + here - top) for w in v])
    want = quiet(pk.orbits, CLOSED, gap=gaps, saddle=which, side="right")
    got = quiet(pk.orbits, plain, x, v)
    known = np.isfinite(got.period.values)
    # No digit is lost that the energy has; what it does not have is not told.
    assert known[np.abs(gaps) > 1e-8].all()
    assert not known[np.abs(gaps) < 1e-11].any()
    asymptotic = got.orbit_kind.values == OrbitKind.ASYMPTOTIC
    for name in ("period", "action"):
        value, error = got[name].values, got[f"{name}_error"].values
        known = np.isfinite(value)
        assert known.sum() > 90
        assert (np.abs(value - want[name].values) <= error)[known].all()
        assert (error <= 1e-8 * value)[known].all()
        assert (error > 0.0)[~asymptotic].all()


@pytest.mark.parametrize("c", [0.0, 1000.0, 1e6])
def test_energies_that_are_given_lose_what_the_constant_takes(c):
    top = pk.equilibria(CLOSED).energy.sel(equilibrium="lower_saddle").item()
    levels = c + top - 10.0 ** np.linspace(-1.0, -12.0, 40)
    with mpmath.workdps(40):
        exact = height(saddle())
        gaps = np.array([float(mpmath.mpf(h) - mpmath.mpf(c) - exact) for h in levels])
    below = gaps < 0.0
    want = pk.orbits(CLOSED, gap=gaps[below], saddle="lower", side="right").period.values
    got = quiet(pk.orbits, system(c), energy=levels[below])
    known = np.isfinite(got.period.values)
    assert known.sum() >= 5
    assert (np.abs(got.period.values - want) <= got.period_error.values)[known].all()
    assert c < 1.0 or not known.all()


@pytest.mark.parametrize("torque", [None, 0.05])
def test_families_keep_their_digits_beside_a_constant(torque):
    closed = CLOSED if torque is None else pk.Perturbed(CLOSED, torque=torque)
    want = pk.orbit_families(closed, 60)
    for c in (0.0, 5.0):
        got = pk.orbit_families(system(c, torque), 60)
        for name, other in FAMILIES.items():
            one, two = got.sel(family=name), want.sel(family=other)
            np.testing.assert_allclose(one.energy_level - c, two.energy_level, atol=2e-15)
            error = one.period_error.values
            if torque is not None:  # a quadrature as well
                error = error + two.period_error.values
            assert (error < 1e-9).all()
            assert (np.abs(one.period.values - two.period.values) <= error).all()


QUARTIC = "({0})^4/4 - ({0})^2/2"


def quartic_period(gap):
    """Of ``u^4/4 - u^2/2`` below its saddle: 2 K(m)/(a/sqrt 2), 1 - m = b^2/a^2, ends b < a."""
    root = mpmath.sqrt(1 + 4 * gap)
    outer, inner = 1 + root, -4 * gap / (1 + root)
    return float(2.0 * ellipkm1(float(inner / outer)) / mpmath.sqrt(outer / 2))


@pytest.mark.parametrize(
    ("text", "shift", "scale", "level"),
    [
        (QUARTIC.format("x"), 0.0, 1.0, 1.0),
        (QUARTIC.format("x - 1000"), 1000.0, 1.0, 1.0),
        (QUARTIC.format("x - 1000") + " + 1e6", 1000.0, 1.0, 1.0),
        (QUARTIC.format("-x"), 0.0, -1.0, 1.0),
        (QUARTIC.format("x/2^20"), 0.0, 2.0**20, 1.0),
        (QUARTIC.format("2^20*x"), 0.0, 2.0**-20, 1.0),
        (f"2^-40*({QUARTIC.format('x')})", 0.0, 1.0, 2.0**-40),
        (f"2^40*({QUARTIC.format('x')})", 0.0, 1.0, 2.0**40),
        # Terms that cancel: what is left of V has few digits.
        ("x^4/4 - 30*x^3 + 2699*x^2/2 - 26970*x", 30.0, 1.0, 1.0),
        ("((x - 1000)^2 + 30)^2/4 - 31*(x - 1000)^2/2", 1000.0, 1.0, 1.0),
    ],
)
def test_coordinates_and_scales_change_no_more_than_is_said(text, shift, scale, level):
    rng = np.random.default_rng(5)
    formula = make_formula(text, "x", (), None, None)
    points = functions.equilibria(formula)
    assert points.n_equilibria == 3
    assert points.complete
    u = np.round(rng.uniform(0.3, 1.1, 60) * 2**20) / 2**20
    gap = -(10.0 ** rng.uniform(-12.0, -2.0, 60))
    speed = np.sqrt(np.maximum(2.0 * (gap + u**2 / 2 - u**4 / 4), 0.0))
    x, v = shift + scale * u, np.sqrt(level) * speed
    assert np.array_equal((x - shift) / scale, u)
    with mpmath.workdps(40):
        exact = [mpmath.mpf(b) ** 2 / 2 + mpmath.mpf(a) ** 4 / 4 - mpmath.mpf(a) ** 2 / 2
                 for a, b in zip(u, speed, strict=True)]  # fmt: skip
        want = np.array([quartic_period(e) for e in exact]) * abs(scale) / np.sqrt(level)
    got = functions.orbits(formula, x, v)
    known = np.isfinite(got.period)
    assert known.sum() >= 5
    assert (np.abs(got.period - want) <= got.period_error)[known].all()
    assert (got.period_error <= 1e-8 * got.period)[known].all()


@pytest.mark.parametrize("turns", [160, -500, 20_000])
def test_motions_far_round_the_circle_are_as_good_as_they_say(turns):
    """The same motions where the phase is taken away at once, and where it stays in the cosine."""
    shift = 2**-10 * round(2**10 * 2.0 * np.pi * turns)
    near = make_formula("-cos(x) + 0.6*cos(2*x) + 0.1*sin(x)", "x", (), 2.0 * np.pi, None)
    text = "-cos(x - s) + 0.6*cos(2*(x - s)) + 0.1*sin(x - s)"
    far = make_formula(text, "x", ("s",), 2.0 * np.pi, None)
    rng = np.random.default_rng(2)
    x, v = np.round(np.stack([rng.uniform(-1.5, 1.5, 12), rng.normal(size=12)]) * 2**20) / 2**20
    time = 10.0 ** rng.uniform(-1.0, 1.5, 12)
    one = functions.flow_with_errors(near, x, v, time)
    two = functions.flow_with_errors(far, shift, x + shift, v, time)
    off = two.motion_phi - shift - one.motion_phi
    last = np.spacing(abs(shift))
    assert np.isfinite(off).all()
    assert (np.abs(off) <= one.motion_phi_error + two.motion_phi_error + last).all()
    off = np.abs(two.motion_dphi - one.motion_dphi)
    assert (off <= one.motion_dphi_error + two.motion_dphi_error).all()
    assert (two.motion_dphi_error < 1e-6).all()


@pytest.mark.parametrize("shift", [0, 30, 100, 200, 300])
def test_areas_are_no_further_off_than_they_say_where_terms_cancel(shift):
    """Between the saddles of -(u^2 - 1)^2/4, multiplied out about another place: 4 sqrt(2)/3."""
    x = sp.Symbol("x", real=True)
    text = sp.expand(-(((x - shift) ** 2 - 1) ** 2) / 4)
    found = functions.separatrices(make_formula(text, "x", (), None, None))
    np.testing.assert_array_equal(found.loop, [Loop.HETEROCLINIC] * 2)
    area, error = found.lobe_area[0, 1], found.lobe_area_error[0, 1]
    assert abs(area - 4.0 * 2.0**0.5 / 3.0) <= error <= 1e-7 or np.isnan(area)
    assert np.isfinite(area) or shift > 100
