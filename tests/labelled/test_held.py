"""Branches along which quantities keep their values or formulas hold, against closed forms."""

import numpy as np
import pytest

import phasekit as pk

CUSP = pk.Problem("mu + a*x - x**3", "x", {"mu": 0.0, "a": 1.0})
RATE = "(m + b*(x**2 + y**2) - (x**2 + y**2)**2)"
TURN = "(w + c*(x**2 + y**2))"
#: A circle of radius r with m + b r^2 = r^4, passed in 2 pi/(w + c r^2).
CIRCLE = pk.Problem(
    [f"{RATE}*x - {TURN}*y", f"{RATE}*y + {TURN}*x"], ("x", "y"),
    {"m": 0.5, "b": 0.5, "w": 1.0, "c": 0.25},
)  # fmt: skip


def values(branch, *names):
    """Columns of a branch of more than a few points, which end at bounds on both sides."""
    assert branch.points.sizes["point"] > 8
    assert [stop.reason for stop in branch.stops] == ["bound", "bound"]
    return [branch.points[name].values for name in names]


def of_equilibria(held, **options):
    return pk.continuation(CUSP, ("mu", "a"), x0=[1.0], span=(-1.0, 1.0), **held, **options)


def of_cycles(parameter, **held):
    orbit = pk.periodic_orbit(CIRCLE, [1.0, 0.0])
    return pk.continuation(CIRCLE, parameter, orbit=orbit, span=(0.1, 1.0), **held)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("held", "zero"),
    [
        ({"fix": "x"}, lambda x, mu, a: x - 1),
        ({"fix": ["x*a + 2*mu"]}, lambda x, mu, a: x * a + 2 * mu - 1),
        ({"constraints": "x^2 + mu - a/2"}, lambda x, mu, a: x**2 + mu - a / 2),
        ({"constraints": [lambda x, mu, a: np.exp(x[0]) - 2 * a - mu]},
         lambda x, mu, a: np.exp(x) - 2 * a - mu),
    ],
)  # fmt: skip
def test_equilibria_along_which_something_holds(held, zero):
    x, mu, a = values(of_equilibria(held), "x", "mu", "a")
    np.testing.assert_allclose(mu + a * x - x**3, 0.0, atol=1e-11)
    np.testing.assert_allclose(zero(x, mu, a), 0.0, atol=1e-11)


@pytest.mark.slow
def test_special_points_are_those_of_the_equilibria(tmp_path):
    """Of x^2 + mu = a/2 those with a = 3 x^2 are at x = -1/4 and 0."""
    branch = of_equilibria({"constraints": "x^2 + mu - a/2"}, events={"third": "x - 1/3"})
    folds = branch.special("fold")
    np.testing.assert_allclose([point.x[0] for point in folds], [-0.25, 0.0], atol=1e-12)
    np.testing.assert_allclose([point["mu"] for point in folds], [1 / 32, 0.0], atol=1e-12)
    (third,) = branch.special("third")
    assert third.x[0] == pytest.approx(1 / 3, abs=1e-12)
    branch.save(tmp_path / "held.nc")
    again = pk.Branch.load(tmp_path / "held.nc")
    assert again == branch
    assert again.extend(bounds={"mu": (-1.5, 1.5)}).points.mu.max() > 1.4


@pytest.mark.slow
def test_what_is_held_may_be_longer_than_a_name(tmp_path):
    factor = "(2 + sin(x)*cos(mu)*exp(-a^2) + cos(x)*sin(mu)*exp(-a^2) + cos(a)*cos(x)*cos(mu))"
    branch = of_equilibria({"constraints": f"(x^2 + mu - a/2)*{factor}"})
    assert branch.special("fold")[0].x[0] == pytest.approx(-0.25, abs=1e-9)
    branch.save(tmp_path / "held.zarr")
    assert pk.Branch.load(tmp_path / "held.zarr") == branch


@pytest.mark.slow
@pytest.mark.parametrize("held", ["x - 2*mu", lambda x, mu, a: x[0] - 2 * mu])
@pytest.mark.parametrize("parameter", [("mu", "a"), ("a", "mu")])
def test_branches_that_cross_along_what_is_held_are_marked(held, parameter):
    """Of x = 2 mu both mu = 0 and a = x^2 - 1/2 are equilibria: they cross at a = -1/2."""
    problem = CUSP.replace(mu=0.5, a=0.5)
    branch = pk.continuation(problem, parameter, x0=[1.0], span=(-1.0, 1.0), constraints=held)
    (point,) = branch.special("branch_point")
    np.testing.assert_allclose([*point.x, point["mu"], point["a"]], [0, 0, -0.5], atol=1e-9)
    assert "cross here, the equilibria around them do not" in point.message
    straight = pk.continuation(
        CUSP.replace(a=0.3), ("a", "mu"), x0=[0.0], span=(-1.0, 1.0), constraints=held
    )
    (point,) = straight.special("branch_point")
    assert point["a"] == pytest.approx(-0.5, abs=1e-9)
    assert [stop.reason for stop in straight.stops] == ["bound", "bound"]


def test_no_crossing_is_marked_where_the_determinant_keeps_its_sign():
    """Of x = 2 mu + 1/10 the curve a = x^2 - 1/2 + 1/(20 x) has two parts that do not meet."""
    problem = CUSP.replace(mu=0.45, a=0.55)
    branch = pk.continuation(
        problem, ("mu", "a"), x0=[1.0], span=(-1.0, 1.0), constraints="x - 2*mu - 1/10"
    )
    assert len(branch.special("branch_point")) == 0


def test_special_points_of_what_is_held_are_places_to_start_at():
    """Of m' = m - r^2, moved by c, Hopf points; along c = 1/10 they are those of the equilibria."""
    hopf = pk.Problem(
        ["m*x - y - x*(x^2 + y^2) + c", "x + m*y - y*(x^2 + y^2)"], ["x", "y"],
        {"m": -0.5, "c": 0.1},
    )  # fmt: skip
    held = pk.continuation(hopf, ("m", "c"), x0=[0, 0.1], span=(-1, 1), constraints="c - 1/10")
    (point,) = held.special("hopf")
    for leave in (point.switch, lambda: point.curve("c", (-1, 1))):
        with pytest.raises(pk.ParameterError, match=r"point: got 'hopf', .*fix=.*places only"):
            leave()
    again = pk.continuation(held.problem.replace(**point.parameters), "m", x0=point.x, span=(-1, 1))
    assert again.special("hopf")[0]["m"] == pytest.approx(point["m"], abs=1e-9)


def test_fixed_points_of_a_map_keep_their_place():
    logistic = pk.Problem("r*x*(1 - x) + c", "x", {"r": 2.0, "c": 0.0}, map=True)
    branch = pk.continuation(logistic, ("r", "c"), x0=[0.5], span=(1.0, 3.5), fix="x")
    r, c = values(branch, "r", "c")
    np.testing.assert_allclose(c, 0.5 - r / 4, atol=1e-12)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("parameter", "held", "exact"),
    [
        (("m", "b"), {"fix": "x_max"}, lambda m, b: (1.0, 2 * np.pi / 1.25, b - (1 - m))),
        (("m", "c"), {"fix": "period"},
         lambda m, c: ((r := (0.25 + (m + 0.0625) ** 0.5) ** 0.5), 2 * np.pi / 1.25,
                       c * r**2 - 0.25)),
        (("m", "c"), {"constraints": "period - 5 - m"},
         lambda m, c: ((r := (0.25 + (m + 0.0625) ** 0.5) ** 0.5), 5 + m,
                       2 * np.pi / (1 + c * r**2) - 5 - m)),
        (("m", "b", "w"), {"fix": ["y_min", "period"]},
         lambda m, b, w: (1.0, 2 * np.pi / 1.25, np.abs(b - (1 - m)) + np.abs(w - 1.0))),
        (("m", "b", "w"), {"fix": "period", "constraints": "x_max^2*b - m"},
         lambda m, b, w: ((m / b) ** 0.5, 2 * np.pi / 1.25,
                          np.abs(2 * m - (m / b) ** 2) + np.abs(w + m / b / 4 - 1.25))),
        (("m", "b"), {"constraints": "mean(x^2 + m*y^4) - 1/2 - 3*m/8"},
         lambda m, b: (1.0, 2 * np.pi / 1.25, b - (1 - m))),
        (("m", "b", "w"), {"fix": ["mean(abs(x)^3)", "period*mean(exp(y))"]},
         lambda m, b, w: (1.0, 2 * np.pi / 1.25, np.abs(b - (1 - m)) + np.abs(w - 1.0))),
    ],
)  # fmt: skip
def test_circles_along_which_numbers_hold(parameter, held, exact):
    branch = of_cycles(parameter, **held)
    radius, period, zero = exact(*values(branch, *parameter))
    for name in ("x_max", "y_max"):
        np.testing.assert_allclose(branch.points[name], radius, atol=1e-9)
    np.testing.assert_allclose(branch.points.period, period, rtol=1e-10)
    np.testing.assert_allclose(zero, 0.0, atol=1e-9)
    multiplier = np.exp(period * (2 * branch.points.b if "b" in parameter else 1.0) * radius**2)
    if "b" in parameter:  # of r' = r (m + b r^2 - r^4)
        multiplier = np.exp(period * (2 * branch.points.b * radius**2 - 4 * radius**4))
        np.testing.assert_allclose(branch.points.multiplier[:, 1].real, multiplier, atol=1e-7)


@pytest.mark.slow
def test_branches_of_cycles_with_what_they_hold_are_stored(tmp_path):
    long = " + ".join(f"{k}*mean(x*y*(x^{k} + y^{k}))" for k in (2, 4, 6))  # more than a name takes
    branch = of_cycles(("m", "b", "w"), fix=[f"mean(x^2 + y^4) + {long}", "period"])
    branch.save(tmp_path / "held.nc")
    again = pk.CycleBranch.load(tmp_path / "held.nc")
    assert again == branch
    m, b = values(again.extend(bounds={"m": (0.05, 1.0)}), "m", "b")
    assert m.min() == 0.05
    np.testing.assert_allclose(b, 1 - m, atol=1e-9)


@pytest.mark.parametrize(
    "held", [{"fix": "u_max"}, {"constraints": "mean(u + v^2 + lam*v) - mean(v*v) - 1/10"}]
)
def test_solutions_along_which_a_number_holds(held):
    """U = -2 log(cosh(t (s - 1/2))/cosh(t/2))/k, of which k lam cosh(t/2)^-2 is 2 t^2."""
    bratu = pk.BoundaryProblem(
        {"u": "v", "v": "-lam*exp(k*u)"}, ["u(0)", "u(1)"], parameters={"lam": 1.0, "k": 1.0}
    )
    branch = pk.continuation(bratu, ("lam", "k"), span=(0.9, 1.1), **held)
    lam, k, top, mean = values(branch, "lam", "k", "u_max", "u_mean")
    assert np.ptp(top if "fix" in held else mean) < 1e-11
    half = np.arccosh(np.exp(k * top / 2))
    np.testing.assert_allclose(k * lam * np.exp(k * top), 8 * half**2, rtol=1e-8)
    with pytest.raises(pk.ParameterError, match="none of the period, which is 1 throughout"):
        pk.continuation(bratu, ("lam", "k"), span=(0.9, 1.1), fix="period")


@pytest.mark.parametrize(
    ("held", "says"),
    [
        ({"parameter": "mu", "fix": "x"}, "parameter: got 'mu', wants 2 different parameters"),
        ({"fix": "y"}, "fix: got the unknown symbol y"),
        ({"fix": ["x"], "constraints": "x - a"}, "one of them of equilibria"),
        ({"fix": []}, "fix: got"),
        ({"constraints": "2"}, "constraints: got '2'"),
        ({"constraints": lambda x, **p: x[0] > 0}, "says yes or no"),
        ({"fix": "x", "certify": True}, "certify"),
        ({"fix": lambda x, **p: 1 / 0}, "fix: got .*it raised ZeroDivisionError: division by zero"),
        ({"constraints": lambda x, **p: [][1] if x[0] else 0.0}, "raised IndexError"),
        ({"constraints": "1/(x - 1)"}, "constraints: got .*a value at the start"),
        ({"fix": "x", "span": [(-1, 1), (-2, 2), (0, 1)]}, r"span: got .*at most 2 spans.*mu, a"),
        ({"fix": "x", "span": [(-1, 1), (0,)]}, r"span: got \(0,\), wants two numbers"),
        ({"fix": "x", "span": [(-1, 1), 3]}, "span: got 3, wants two numbers"),
    ],
)  # fmt: skip
def test_what_cannot_be_held_is_refused(held, says):
    with pytest.raises(pk.ParameterError, match=says):
        pk.continuation(
            CUSP, **{"parameter": ("mu", "a"), "x0": [1.0], "span": (-1.0, 1.0), **held}
        )


def test_what_does_not_hold_nearby_is_announced():
    with pytest.raises(pk.ConvergenceError, match=r"no equilibrium with x\*\*2 \+ 100 = 0"):
        of_equilibria({"constraints": "x^2 + 100"})
    with pytest.raises(pk.ConvergenceError, match="no periodic orbit was found with"):
        of_cycles(("m", "b"), constraints="x_max^2 + 1")
    with pytest.raises(pk.ParameterError, match="a formula of numbers of the orbit"):
        of_cycles(("m", "b"), constraints=lambda x, **p: 0.0)


def test_cycles_of_a_forced_system_keep_their_extremes_and_no_period():
    """Those of x' = b - x + a cos t reach b + a/sqrt(2)."""
    forced = pk.Problem(
        "b - x + a*cos(t)", "x", {"a": 1.0, "b": 0.5}, time="t", period=2 * np.pi
    )  # fmt: skip
    orbit = pk.periodic_orbit(forced, [0.0])
    branch = pk.continuation(forced, ("a", "b"), orbit=orbit, span=(0.5, 2.0), fix="x_max")
    a, b = values(branch, "a", "b")
    np.testing.assert_allclose(b, 0.5 + (1 - a) / 2**0.5, atol=1e-8)
    with pytest.raises(
        pk.ParameterError, match="fix: got 'x_max/period', wants none of the period"
    ):
        pk.continuation(forced, ("a", "b"), orbit=orbit, span=(0.5, 2.0), fix="x_max/period")


DRIVEN = pk.Problem(
    "b - x + a*cos(w*t)", "x", {"a": 1.0, "b": 0.5, "w": 1.0}, time="t", period="2*pi/w"
)  # fmt: skip


def test_means_of_a_forced_system_know_its_time():
    """The mean of x cos(w t) is a/(1 + w^2)/2 in x' = b - x + a cos(w t)."""
    orbit = pk.periodic_orbit(DRIVEN, [0.0])
    held = {"constraints": "mean(x*cos(w*t)) - 1/4"}
    branch = pk.continuation(DRIVEN, ("w", "a"), orbit=orbit, span=(0.5, 2.0), **held)
    w, a = values(branch, "w", "a")
    np.testing.assert_allclose(a, (1 + w**2) / 2, rtol=1e-12)
    events = {"fifth": "mean(x*cos(w*t)) - 1/5"}
    branch = pk.continuation(DRIVEN, "w", orbit=orbit, span=(0.5, 2.0), events=events)
    (point,) = branch.special("fifth")
    assert point["w"] == pytest.approx(1.5**0.5, rel=1e-12)


@pytest.mark.parametrize(
    ("formula", "says"),
    [
        ("mean(x_max)", "unknown symbol x_max.*a mean wants x, a, b, w, t"),
        ("1 - mean((x + 1)", "its end at character 17 where a closing parenthesis belongs"),
        ("mean(x, a)", "',' at character 2 where an operator belongs"),
        ("mean(2) - 1", "a formula that depends on the orbit or the parameters"),
        ("mean - a", r"unknown symbol mean.*and mean\(formula of states\)"),
    ],
)  # fmt: skip
def test_means_of_no_formula_of_states_are_refused(formula, says):
    orbit = pk.periodic_orbit(DRIVEN, [0.0])
    with pytest.raises(pk.ParameterError, match=says):
        pk.continuation(DRIVEN, ("w", "a"), orbit=orbit, span=(0.5, 2.0), constraints=formula)
