"""Branches of periodic orbits as users meet them."""

from __future__ import annotations

import pickle

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.special import ellipk, mathieu_a, mathieu_b

import phasekit as pk

BRUSSELATOR = ["1 - (b + 1)*x + x**2*y", "b*x - x**2*y"]
WOBBLE = [
    "x*(1 - x**2 - y**2) - 2*y",
    "y*(1 - x**2 - y**2) + 2*x",
    "z*(l + x**2 + y**2 - 1) - z**3",
]


def brusselator(b=2.2):
    return pk.Problem(BRUSSELATOR, ("x", "y"), {"b": b})


@pytest.fixture(scope="module")
def cycles():
    rest = pk.continuation(brusselator(1.5), "b", x0=[1.0, 1.5], span=(1, 3))
    return rest.special("H")[0].switch()


def duffing(**changes):
    values = {"d": 0.1, "F": 0.3, "w": 1.4} | changes
    return pk.Problem(
        ["v", "F*cos(w*t) - d*v - x - x**3"], ("x", "v"), values, time="t", period="2*pi/w"
    )


def test_points_have_their_names(cycles):
    points = cycles.points
    count = points.sizes["point"]
    for name in (
        "b", "period", "n_unstable", "trivial_error", "liouville_error", "mesh_error", "winding",
        "n_intervals", "x_min", "x_max", "x_mean", "y_min", "y_max", "y_mean",
    ):  # fmt: skip
        assert points[name].shape == (count,)
        assert np.isfinite(points[name]).all()
    assert points.multiplier.dims == ("point", "multiplier")
    assert np.iscomplexobj(points.multiplier)
    assert cycles.kind == "cycle"
    assert isinstance(cycles, pk.Branch)
    assert (points.n_unstable == 0).all()
    assert (points.winding == 0).all()
    assert (points.trivial_error < 1e-8).all()
    assert (points.liouville_error < 1e-9).all()
    assert cycles.stops[0].reason == "hopf"
    assert cycles.stops[1].reason == "bound"
    assert cycles.points.b[-1] == 3.0


def test_orbit_solves_the_equations(cycles):
    orbit = cycles.orbit(-1)
    b = float(orbit.b)

    def f(t, u):
        return [1 - (b + 1) * u[0] + u[0] ** 2 * u[1], b * u[0] - u[0] ** 2 * u[1]]

    start = [float(orbit.x[0]), float(orbit.y[0])]
    at = orbit.time.values
    assert at[0] == 0.0
    assert np.isclose(at[-1], float(orbit.period), rtol=1e-15)
    motion = solve_ivp(f, (0, at[-1]), start, method="DOP853", t_eval=at, rtol=1e-12, atol=1e-13)
    assert np.max(np.abs(motion.y[0] - orbit.x.values)) < 1e-7
    assert float(orbit.x_max) >= float(orbit.x.max())
    divergence = -(b + 1) + 2 * orbit.x * orbit.y - orbit.x**2
    product = np.prod(orbit.multiplier.values).real
    assert np.isclose(product, np.exp(divergence.integrate("time")), rtol=1e-3)


@pytest.mark.slow
def test_forms_of_the_problem_agree():
    numba = pytest.importorskip("numba")
    exact = pk.periodic_orbit(brusselator(), [1.0, 1.0])

    def f(x, b):
        return np.array([1 - (b + 1) * x[0] + x[0] ** 2 * x[1], b * x[0] - x[0] ** 2 * x[1]])

    def by_state(x, b):
        return f(x, b) if x[0] > -1e9 else f(x, b)  # no arrays of states

    for one in (f, numba.njit(f), by_state):
        found = pk.periodic_orbit(pk.Problem(one, ("x", "y"), {"b": 2.2}), [1.0, 1.0])
        assert np.isclose(found.period, exact.period, rtol=1e-11)
        assert np.allclose(found.multiplier.values, exact.multiplier.values, atol=1e-8)


@pytest.mark.slow
def test_extended_branches_are_those_never_interrupted(tmp_path):
    orbit = pk.periodic_orbit(brusselator(), [1.0, 1.0])

    def speed(x, b):
        return b * x[0]

    def follow(**options):
        return pk.continuation(
            brusselator(), "b", orbit=orbit, span=(2.1, 2.6), record={"speed": speed},
            options=pk.ContinuationOptions(**options),
        )  # fmt: skip

    whole, short = follow(), follow(max_points=3)
    assert [stop.reason for stop in short.stops] == ["max_points", "max_points"]
    for suffix in ("nc", "zarr"):
        short.save(tmp_path / f"short.{suffix}")
        loaded = pk.Branch.load(tmp_path / f"short.{suffix}", record={"speed": speed})
        assert loaded.points.identical(short.points)
        again = loaded.extend(2).extend(500)
        assert again.points.identical(whole.points)
        assert again.orbit(2).identical(whole.orbit(2))
    assert np.allclose(whole.points.speed_max, whole.points.b * whole.points.x_max, rtol=1e-12)
    again_without_record = pk.continuation(
        brusselator(), "b", orbit=orbit, span=(2.1, 2.6),
        options=pk.ContinuationOptions(max_points=2),
    )  # fmt: skip
    copy = pickle.loads(pickle.dumps(again_without_record.special_points[0]))
    assert copy.kind == "end"
    with pytest.raises(pk.ParameterError, match="extend"):
        whole.extend()


@pytest.mark.slow
def test_branches_that_say_nothing_of_the_point_behind_go_on(cycles, tmp_path):
    """Those saved by earlier versions: the next step goes along the tangent alone."""
    options = pk.ContinuationOptions(max_points=6, directions="forward")
    short = pk.continuation(
        brusselator(2.2), "b", orbit=pk.periodic_orbit(brusselator(2.2), [1.0, 2.0], 6.4),
        span=(1.5, 3.0), options=options,
    )  # fmt: skip
    one = short.extend()
    (state,) = (track.state for track in short.tracks if track is not None)
    assert state.behind is not None
    object.__setattr__(state, "behind", None)
    short.save(tmp_path / "short.nc")
    two = pk.Branch.load(tmp_path / "short.nc").extend()
    assert one.points.sizes == two.points.sizes
    assert one.points.sizes["point"] > 3
    assert np.allclose(one.points.period, two.points.period, rtol=1e-10)


def test_branch_points_and_switching():
    system = pk.Problem(WOBBLE, ("x", "y", "z"), {"l": -0.5})
    orbit = pk.periodic_orbit(system, [1.0, 0.0, 0.0])
    branch = pk.continuation(system, "l", orbit=orbit, span=(-0.5, 0.5))
    (crossing,) = [s for s in branch.special_points if s.kind != "end"]
    assert crossing.kind == "cycle_branch_point"
    assert crossing.label == "BPC"
    assert abs(crossing["l"]) < 1e-10
    other = crossing.switch()
    # On it z^2 = l, on both sides.
    assert np.allclose(other.points.z_max**2, other.points.l, atol=1e-8)
    assert other.points.z_max.values[0] * other.points.z_max.values[-1] < 0.0
    assert [s.kind for s in other.special_points] == ["end", "end"]


@pytest.mark.slow
def test_tori_and_their_curve():
    rate = "l*z - z**3/3 - (x**2 + y**2)*(1 + g*z)"
    system = pk.Problem(
        ["(z - 0.7)*x - d*y", "d*x + (z - 0.7)*y", f"0.6 + {rate}"], ("x", "y", "z"),
        {"l": 0.3, "d": 3.5, "g": 0.25},
    )  # fmt: skip
    rest = pk.continuation(system, "l", x0=[0.0, 0.0, 1.0], span=(-1.0, 1.0))
    branch = rest.special("H")[0].switch()
    (torus,) = branch.special("TR")
    # In r and z it is a Hopf point, whose coefficient omega l1 is that of the torus.
    flat = pk.Problem(
        ["(z - 0.7)*r", "0.6 + l*z - z**3/3 - r**2*(1 + g*z)"], ("r", "z"), {"l": 0.3, "g": 0.25}
    )
    (hopf,) = pk.continuation(flat, "l", x0=[0.7, 0.7], span=(0.0, 1.0)).special("H")
    assert abs(torus["l"] - hopf["l"]) < 1e-11
    expected = hopf.normal_form["l1"] * hopf.normal_form["omega"]
    assert np.isclose(torus.normal_form["d"], expected, rtol=1e-8)
    curve = torus.curve("g", (0.2, 0.3))
    assert curve.kind == "torus"
    assert curve.points.sizes["point"] > 3
    # Trace of the planar system: l - z^2 - r^2 g = 0 with r^2 = (.6 + l z - z^3/3)/(1 + g z).
    z = 0.7
    r2 = (0.6 + curve.points.l * z - z**3 / 3) / (1 + curve.points.g * z)
    assert np.allclose(curve.points.l - z**2 - r2 * curve.points.g, 0.0, atol=1e-9)
    assert np.allclose(np.abs(curve.points.multiplier), 1.0, atol=1e-8)


@pytest.mark.slow
def test_fold_curve_of_the_normal_form(tmp_path):
    rate = "(p1 + p2*(x**2 + y**2) - (x**2 + y**2)**2)"
    system = pk.Problem([f"x*{rate} - y", f"y*{rate} + x"], ("x", "y"), {"p1": -0.5, "p2": 1.0})
    rest = pk.continuation(system, "p1", x0=[0.0, 0.0], span=(-0.5, 0.5))
    (fold,) = rest.special("H")[0].switch().special("LPC")
    # r' = b (p1 - p0) + a (r - r0)^2 with r0^2 = p2/2.
    assert np.isclose(fold.normal_form["a"], -np.sqrt(2.0), rtol=1e-9)
    assert np.isclose(fold.normal_form["b"], np.sqrt(0.5), rtol=1e-9)
    curve = fold.curve("p2", (0.5, 1.5))
    assert np.allclose(curve.points.p1, -(curve.points.p2**2) / 4, atol=1e-12)
    curve.save(tmp_path / "curve.nc")
    assert pk.Branch.load(tmp_path / "curve.nc").points.identical(curve.points)


@pytest.mark.parametrize(("span", "end"), [((1.0, 1.2), 0), ((0.9, 1.0), -1)])
def test_a_branch_that_starts_on_its_bound_has_its_start_once(span, end):
    system = pk.Problem(["y", "mu*(1 - x**2)*y - x"], ("x", "y"), {"mu": 1.0})
    orbit = pk.periodic_orbit(system, [2.0, 0.0])
    branch = pk.continuation(system, "mu", orbit=orbit, span=span)
    assert branch.points.sizes["point"] > 3
    assert np.all(np.diff(branch.points.arclength) > 0.0)
    assert float(branch.points.mu[end]) == 1.0
    assert [stop.reason for stop in branch.stops] == ["bound", "bound"]
    assert [one.index for one in branch.special_points] == [0, branch.points.sizes["point"] - 1]


def test_isola_closes():
    rate = "(0.04 - (x**2 + y**2 - 1)**2 - p**2)"
    system = pk.Problem([f"3*x*{rate} - y", f"3*y*{rate} + x"], ("x", "y"), {"p": 0.0})
    orbit = pk.periodic_orbit(system, [np.sqrt(1.2), 0.0], period=6.28)
    branch = pk.continuation(system, "p", orbit=orbit, span=(-1, 1))
    assert branch.closed
    assert np.allclose(sorted(s["p"] for s in branch.special("LPC")), [-0.2, 0.2], atol=1e-12)
    assert np.all(np.diff(branch.points.arclength) > 0.0)


def test_mathieu():
    q = 1.3
    for order, value in ((1, mathieu_a(1, q)), (1, mathieu_b(1, q)), (2, mathieu_b(2, q))):
        system = pk.Problem(
            ["v", "-(a - 2*q*cos(2*t))*x"], ("x", "v"), {"a": float(value), "q": q}, time="t",
            period="pi",
        )  # fmt: skip
        orbit = pk.periodic_orbit(system, [0.0, 0.0])
        sign = -1.0 if order % 2 else 1.0
        assert np.allclose(orbit.multiplier.values, sign, atol=1e-4)  # defective: a square root
        assert np.isclose(np.sum(orbit.multiplier.values).real, 2 * sign, rtol=1e-11)


@pytest.mark.parametrize(
    ("q", "span", "known"),
    [
        (25.0, (-42.0, -38.0), ["a0", "b1"]),
        (25.0, (12.0, 13.0), ["a3", "b4"]),
        (5.0, (-7.0, 9.0), ["a0", "b1", "a1", "b2", "a2"]),
    ],
)
def test_where_multipliers_of_all_sizes_pass_the_circle(q, span, known):
    """Next to one another, and within a step over which the largest changes a millionfold."""
    system = pk.Problem(
        ["v", "-(a - 2*q*cos(2*t))*x"], ("x", "v"), {"a": span[0], "q": q}, time="t", period="pi"
    )
    orbit = pk.periodic_orbit(system, [0.0, 0.0])
    points = pk.continuation(system, "a", orbit=orbit, span=span).special_points[1:-1]
    characteristic = {"a": mathieu_a, "b": mathieu_b}
    exact = [characteristic[name[0]](int(name[1]), q) for name in known]
    assert len(points) == len(known)
    assert np.allclose([one["a"] for one in points], exact, rtol=1e-9, atol=0.0)
    assert [one.label for one in points] == ["PD" if int(n[1]) % 2 else "BPC" for n in known]
    assert all(one.status == "converged" for one in points)


def test_conservative_families():
    pendulum = pk.Problem.from_potential("-cos(x)", "x", period=2 * np.pi)
    for x, v, turns in ((1.0, 0.0, 0), (2.5, 0.3, 0), (0.0, 2.5, 1)):
        orbit = pk.periodic_orbit(pendulum, [x, v])
        exact = pk.orbits(pk.Pendulum(length=9.80665), x, v).period.item()
        assert np.isclose(float(orbit.period), exact, rtol=1e-10)
        assert int(orbit.winding) == turns
        assert abs(float(orbit.unfolding)) < 1e-12
    first = pk.periodic_orbit(pendulum, [1.0, 0.0])
    family = pk.continuation(pendulum, "period", orbit=first, span=(1.0, 12.0))
    assert [stop.reason for stop in family.stops] == ["hopf", "bound"]
    points = family.points
    assert np.max(np.abs(points.unfolding)) < 1e-12
    exact = 4.0 * ellipk(np.sin(points.x_max / 2.0) ** 2)
    assert np.allclose(points.period, exact, rtol=1e-8)
    assert [s.kind for s in family.special_points] == ["end", "end"]


def test_fixed_period():
    rate = "(l - x**2 - y**2)"
    system = pk.Problem(
        [f"x*{rate} - y*(w + x**2 + y**2)", f"y*{rate} + x*(w + x**2 + y**2)"], ("x", "y"),
        {"l": 0.5, "w": 1.0},
    )  # fmt: skip
    orbit = pk.periodic_orbit(system, [0.7, 0.0])
    branch = pk.continuation(
        system, ("l", "w"), orbit=orbit, span=[(0.2, 0.8), (0.1, 3.0)], fix="period"
    )
    assert branch.free == ("l", "w")
    assert branch.points.sizes["point"] > 5
    assert np.allclose(branch.points.l + branch.points.w, 1.5, atol=1e-9)  # speed w + r^2
    assert np.allclose(branch.points.period, 2 * np.pi / 1.5, rtol=1e-12)


def test_forced_problems():
    orbit = pk.periodic_orbit(duffing(), [0.0, 0.0])
    assert np.isclose(float(orbit.period), 2 * np.pi / 1.4, rtol=1e-15)
    assert np.isclose(np.prod(orbit.multiplier.values).real, np.exp(-0.1 * float(orbit.period)))
    with pytest.raises(pk.ParameterError, match="time"):
        pk.continuation(duffing(), "w", x0=[0.0, 0.0], span=(1, 2))
    again = pk.Problem.from_specification(duffing().specification())
    assert again.time == "t"
    assert again([0.1, 0.2], t=0.3).tolist() == duffing()([0.1, 0.2], t=0.3).tolist()


@pytest.mark.parametrize(
    ("arguments", "word"),
    [
        ({"period": 1.0}, "time"),
        ({"time": "x", "period": 1.0}, "time"),
        ({"time": "t", "period": "2*pi/q"}, "period"),
        ({"time": "t", "period": 0.0}, "period"),
        ({"time": "t", "period": float("nan")}, "period"),
    ],
)
def test_bad_forcing(arguments, word):
    with pytest.raises(pk.ParameterError, match=word):
        pk.Problem(["y", "-x"], ("x", "y"), {"w": 1.0}, **arguments)


@pytest.mark.parametrize(
    ("x0", "arguments", "word"),
    [
        ([1.0], {}, "x0"),
        ([1.0, np.nan], {}, "x0"),
        ([1.0, 1.0], {"period": -1.0}, "period"),
        ([1.0, 1.0], {"period": True}, "period"),
        ([1.0, 1.0], {"settle": -1.0}, "settle"),
        ({"x": 1.0}, {}, "x0"),
        (np.ones((30, 2)), {}, "period"),
    ],
)
def test_bad_starts(x0, arguments, word):
    with pytest.raises(pk.ParameterError, match=word):
        pk.periodic_orbit(brusselator(), x0, **arguments)


def test_no_orbit_is_announced():
    decay = pk.Problem(["-x + y", "-y - x"], ("x", "y"), {"p": 1.0})
    with pytest.raises(pk.ConvergenceError, match="periodic orbit"):
        pk.periodic_orbit(decay, [1.0, 0.0])
    with pytest.raises(pk.ParameterError, match="orbit"):
        pk.continuation(brusselator(), "b", orbit=[1.0, 2.0], span=(1, 3))
    orbit = pk.periodic_orbit(brusselator(), [1.0, 1.0])
    with pytest.raises(pk.ParameterError, match="span"):
        pk.continuation(brusselator(), "b", orbit=orbit, span=(3, 4))


def test_samples():
    exact = pk.periodic_orbit(brusselator(), [1.0, 1.0])
    at = np.linspace(0.0, float(exact.period), 60, endpoint=False)
    samples = np.stack([exact[k].interp(time=at).values for k in ("x", "y")], axis=1)
    found = pk.periodic_orbit(brusselator(), samples, float(exact.period) * 1.01)
    assert np.isclose(found.period, exact.period, rtol=1e-11)
    found = pk.periodic_orbit(brusselator(), exact[["x", "y"]])
    assert np.isclose(found.period, exact.period, rtol=1e-11)


def test_a_forced_system_without_its_force_rests():
    driven = pk.Problem(
        ["0.4 + x**2*y - 2.2*x - x + c*cos(w*t)", "2.2*x - x**2*y"], ("x", "y"),
        {"c": 0.0, "w": 0.8}, time="t", period="2*pi/w",
    )  # fmt: skip
    rest = pk.periodic_orbit(driven, [0.4, 5.4])
    assert np.allclose([rest.x_max, rest.y_max], [0.4, 5.5], rtol=1e-12)
    assert float(rest.residual) < 1e-12  # beside the states: nothing moves
    response = pk.continuation(driven, "c", orbit=rest, span=(0.0, 0.1))
    assert response.points.sizes["point"] > 3
    assert np.all(response.points.residual < 1e-9)


def test_what_was_left_early_is_looked_at_to_its_end_where_nothing_else_is_found(monkeypatch):
    problem, turns = brusselator(), "phasekit.labelled.continuation.periodic_orbit.TURNS"
    exact = pk.periodic_orbit(problem, [1.0, 1.0])
    monkeypatch.setattr(turns, ((0.0, 20.0), (0.0, 1e5)))
    found = pk.periodic_orbit(problem, [1.0, 1.0])
    np.testing.assert_array_equal(found.period, exact.period)
    monkeypatch.setattr(turns, ((0.0, 20.0), (0.0, 30.0)))
    with pytest.raises(pk.ConvergenceError, match="at first: x0: 30 values of f do not lead"):
        pk.periodic_orbit(problem, [1.0, 1.0])
