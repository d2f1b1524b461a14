"""Right-hand sides that jump: refused where they have no answer, said where they hold a motion."""

import re

import numpy as np
import pytest
import sympy as sp

import phasekit as pk
from phasekit.laws.smoothness import jumps

WINDOW = {"x": (-3, 3), "v": (-3, 3)}
DRY = pk.Problem({"x": "v", "v": "-x - mu*sign(v)"}, parameters={"mu": 0.3}, window=WINDOW)
#: A relay that drives: its cycle crosses the jump.
RELAY = pk.Problem({"x": "v", "v": "k*sign(v) - v/10 - x"}, parameters={"k": 0.5}, window=WINDOW)


def relay(x, k, d):
    """The same, as a function."""
    return [x[1], k * np.sign(x[1]) - d * x[1] - x[0]]


CODED = pk.Problem(relay, ("x", "v"), {"k": -0.3, "d": 0.0}, window=WINDOW)


@pytest.mark.parametrize(
    "call",
    [
        lambda: pk.equilibria(DRY),
        lambda: pk.sweep(DRY, of="equilibria", mu=[0.1, 0.2])["x"].load(),
        lambda: pk.continuation(DRY, "mu", x0=[0, 0], span=(0, 1)),
        lambda: pk.diagram(DRY.replace(mu=0.0), "mu", span=(0, 1)),
        lambda: pk.periodic_orbit(RELAY, [1.0, 0.0]),
        lambda: pk.periodic_orbits(RELAY),
        lambda: pk.manifolds(RELAY),
        lambda: pk.connection(RELAY, ([0, 0], [1, 0]), free="k"),
        lambda: pk.equilibria(pk.Problem("m - Heaviside(x)", "x", {"m": 0.5}), {"x": (-1, 1)}),
        lambda: pk.equilibria(CODED),
        lambda: pk.continuation(CODED, "k", x0=[0, 0], span=(-1, 1)),
        lambda: pk.periodic_orbit(CODED.replace(k=0.5, d=0.1), [1.0, 0.0]),
        lambda: pk.periodic_orbit(CODED, [1.0, 0.0]),
    ],
)
def test_no_equilibria_branches_and_cycles_are_given_of_what_jumps(call):
    with pytest.raises(pk.ParameterError, match=r"f: got .*jumps.*tanh\(v/width\)"):
        call()


def test_what_does_not_jump_at_its_parameters_is_taken():
    assert pk.equilibria(DRY.replace(mu=0.0)).x.values.tolist() == [[0.0, 0.0]]
    bent = pk.Problem("m - x*Abs(x) - Max(x, 0)", "x", {"m": 0.75}, window={"x": (-3, 3)})
    with pytest.warns(UserWarning, match="no bounds are known for Max"):
        np.testing.assert_allclose(pk.equilibria(bent).x.values, [[0.5]], rtol=1e-12)
    in_time = pk.Problem("sign(sin(t)) - x", "x", {"k": 1.0}, time="t", period="2*pi")
    # x = 1 - (1 + tanh(pi/2)) exp(-t) of half a period, exactly.
    found = pk.flow(in_time, [-np.tanh(np.pi / 2)], [np.pi]).motion_x.item()
    np.testing.assert_allclose(found, np.tanh(np.pi / 2), rtol=1e-9)


@pytest.mark.parametrize("method", [None, "radau"])
@pytest.mark.parametrize(
    ("f", "why"),
    [
        ("-x + 1e12*Heaviside(t - 1)", "the law jumps in time where they end"),
        (lambda x, t: [-x[0] + 1e12 * (t > 1.0)], "the law jumps in time where they end"),
        (lambda x, t: [-x[0] if t <= 1.0 else np.nan], "the law has no value where they end$"),
        (lambda x, t: [-x[0] + 1 / (1 - t) ** 2], "steps become too short: they run to infinity"),
    ],
)
def test_motions_that_end_at_a_jump_in_time_say_so(f, why, method):
    with pytest.warns(RuntimeWarning, match=f"because .*{why}"):
        ds = pk.flow(pk.Problem(f, "x", time="t"), [0.5], [0.5, 2.0], method=method)
    assert np.isfinite(ds.motion_x.values).tolist() == [True, False]


def test_exponents_of_motions_that_end_say_why():
    late = pk.Problem(lambda x, t: [-x[0] + 1e12 * (t > 1.0)], "x", time="t")
    with pytest.warns(RuntimeWarning, match="lyapunov_exponent: .* the law jumps in time"):
        assert np.isnan(pk.lyapunov(late, [0.5], duration=9.0).lyapunov_exponent).all()


X, Y = sp.symbols("x y", real=True)


@pytest.mark.parametrize(
    ("formula", "jumping"),
    [
        ("Piecewise((-1, x < -1), (1, x > 1), (x, True))", False),  # pieces that do not meet differ
        ("Piecewise((x, (x > -1) & (x < 1)), (-1, x < -1), (1, True))", False),
        ("x*Heaviside(x - 1) + Heaviside(1 - x)*x**3", False),
        ("Ei(x)*abs(x)*sign(x) + abs(airyai(y)) + fresnelc(x)", False),
        ("1/Piecewise((1, abs(x) < 1e-6), ((exp(x) - 1)/x, True))", False),
        ("abs(x)/x", True),
        ("Piecewise((0, x < -1), (1, x > 1), (x, True))", True),
        ("Heaviside(1 - x) - airyai(x)", True),
        ("Piecewise((1, (x > 0) & (y < -5)), (0, True))", True),
    ],
)
def test_a_jump_is_one_however_it_is_written(formula, jumping):
    assert jumps(sp.sympify(formula, {"x": X, "y": Y}), (X, Y)) is jumping


def test_a_tank_runs_empty_through_a_hole():
    tank = pk.Problem("-2*sign(h)*sqrt(abs(h))", "h", window={"h": (-3, 3)})
    np.testing.assert_allclose(pk.flow(tank, [4.0], [0.5, 1.5]).motion_h, [2.25, 0.25], rtol=1e-9)


@pytest.mark.slow
@pytest.mark.parametrize("problem", [DRY, CODED])
def test_a_motion_that_sticks_ends_and_says_so(problem):
    # It swings about -mu, and is held from t = pi on, at x = 0.1.
    with pytest.warns(RuntimeWarning, match=r"where the law jumps.*smooth it: tanh\(v/width\)"):
        found = pk.flow(problem, [-0.7, 0.0], [1.0, 9.0])
    np.testing.assert_allclose(found.motion_x[0], -0.3 - 0.4 * np.cos(1.0), rtol=1e-9)
    assert np.isnan(found.motion_x[1])


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore:poincare_section")
@pytest.mark.parametrize(
    "follow",
    [
        lambda: pk.lyapunov(DRY, [1.0, 0.0], duration=40.0),
        lambda: pk.poincare_section(DRY, [1.0, 0.0], section="x", duration=100.0),
        lambda: pk.poincare_section(DRY, [1.0, 0.0], section="x", n=3),
    ],
)
def test_motions_that_stick_are_said_to_stick(follow):
    # They neither run to infinity nor are they damped strongly.
    with pytest.warns(RuntimeWarning, match=r"1 of 1 motions .* where the law jumps: dry friction"):
        follow()


def test_basins_ask_once_what_is_round_a_rest_on_a_jump(monkeypatch):
    monkeypatch.setattr("phasekit.motion.method.MOST_JUMPING", 2000)
    axis = np.linspace(-1.0, 1.0, 3)
    with pytest.warns(RuntimeWarning, match="where the law jumps and may hold them") as told:
        ds = pk.basins(DRY, grid={"x": axis, "v": axis})
    assert int(re.search(r"(\d+) of the motions", str(told[0].message))[1]) < 100
    assert not ds.basin_decided.values.any()


@pytest.mark.parametrize("unit", ["1e-12", "1", "1e12"])
def test_units_decide_no_jump(unit):
    assert jumps(sp.sympify(f"{unit}*(x - sign(x))").subs(sp.Symbol("x"), X), (X,))
    smooth = f"{unit}*(x*abs(x) + Piecewise((0, x < 1), ((x - 1)**2, True)))"
    assert not jumps(sp.sympify(smooth).subs(sp.Symbol("x"), X), (X,))
