"""What begins at points of codimension two, against systems in which it is known exactly."""

import re

import numpy as np
import pytest
import sympy as sp
from scipy.integrate import solve_ivp
from scipy.interpolate import CubicSpline
from scipy.optimize import brentq

import phasekit as pk

ROTATING = ("{rate}*x - {turn}*y", "{rate}*y + {turn}*x")


def bautin():
    """R' = r (m + b r^2 - r^4): cycles fold where m = -b^2/4."""
    rate = "(m + b*(x**2 + y**2) - (x**2 + y**2)**2)"
    return pk.Problem(
        [f"{rate}*x - y", f"{rate}*y + x"], ("x", "y"), {"m": -0.5, "b": -0.5},
    )  # fmt: skip


def special(problem, parameter, start, second, kind, label):
    """The first point of a kind on the curve of the first fold or Hopf point of a branch."""
    branch = pk.continuation(problem, parameter, x0=start, span=(-1.0, 1.0))
    return branch.special(kind)[0].curve(second, (-1.0, 1.0)).special(label)[0]


@pytest.mark.slow
def test_cycles_fold_from_generalized_hopf_points():
    point = special(bautin(), "m", [0.0, 0.0], "b", "H", "GH")
    curve = point.switch()
    assert curve.kind == "fold_of_cycles"
    np.testing.assert_allclose(curve.points.m, -(curve.points.b**2) / 4, atol=1e-12)
    assert float(curve.points.b.min()) < 1e-2  # and it shrinks to the point
    assert curve.stops[0].reason == "hopf"
    with pytest.raises(pk.ParameterError, match=r"kind: got 'hopf', wants 'fold_of_cycles'"):
        point.switch("hopf")
    with pytest.raises(pk.ParameterError, match="direction"):
        point.switch(direction=1)


def test_bogdanov_takens_points_lead_from_folds_to_hopf_curves_and_back():
    """X' = y, y' = m + n y + x^2 + x y: folds m = 0, Hopf points m = -n^2, n > 0."""
    system = pk.Problem(["y", "m + n*y + x**2 + x*y"], ("x", "y"), {"m": -1.0, "n": 0.5})
    point = special(system, "m", [1.0, 0.0], "n", "LP", "BT")
    assert point.normal_form == pytest.approx({"a": 1.0, "b": 1.0}, rel=1e-12)
    hopf = point.switch()
    assert hopf.kind == "hopf"
    np.testing.assert_allclose(hopf.points.m, -(hopf.points.n**2), atol=1e-12)
    (back,) = hopf.special("BT")
    fold = back.switch()
    assert fold.kind == "fold"
    np.testing.assert_allclose(fold.points.m, 0.0, atol=1e-12)


def tau(e):
    """Of u'' = -4 + u^2 + e u' (u + tau), where its homoclinic orbit is, to order e^4."""
    return 10 / 7 + 288 / 2401 * e**2


def disguised(a, b, rates, mixed):
    """X' = y, y' = m + n y + a x^2 + b x y, with m, n functions of M, N, and more states."""
    x, y, u, M, N = sp.symbols("x y u M N")
    m, n = (M + 2 * N + M**2 - M * N, N - M + 3 * N**2) if mixed else (M, N)
    slopes = {x: y, y: m + n * y + a * x**2 + b * x * y}
    back = {x: u, y: y}
    for i, rate in enumerate(rates):  # w = x y + what decays or grows; u = x + w + ...
        w = sp.Symbol(f"w{i}")
        slopes[w] = rate * (w - x * y) + y * y + x * slopes[y]
        back[x] -= w
    slopes[u] = slopes[x] + sum(slopes[w] for w in list(slopes)[2:])
    f = {
        str(one): sp.expand(slope.subs(back, simultaneous=True))
        for one, slope in slopes.items()
        if one != x
    }
    m0 = -0.2 * np.sign(a)
    values = {"M": (np.sqrt(1 + 4 * m0) - 1) / 2 if mixed else m0, "N": 0.0}
    system = pk.Problem(f, parameters=values)
    state = dict.fromkeys(system.state, 0.0) | {"u": np.sqrt(0.2 / abs(a))}
    return system, state, sp.lambdify((M, N), (m, n))


@pytest.mark.slow
@pytest.mark.parametrize(
    ("a", "b", "rates", "mixed"),
    [
        (1, 1, (), False), (2, -1, (), True), (-1, 2, (-1,), True), (1, 1, (2,), True),
        (-2, -1, (-1, 3), False),
    ],
)  # fmt: skip
def test_homoclinic_orbits_begin_at_bogdanov_takens_points(a, b, rates, mixed):
    """M = -4 r^4/a, n = tau(e) r^2 b/a with e = r b/a: on both sides, in any disguise."""
    system, start, original = disguised(a, b, rates, mixed)
    point = special(system, "M", start, "N", "LP", "BT")
    curve = point.switch("homoclinic", options=pk.ContinuationOptions(max_points=15))
    assert curve.kind == "connection"
    m, n = original(curve.points.M.values, curve.points.N.values)
    r = (-a * m / 4) ** 0.25
    e = r * b / a
    far = np.abs(e) > 0.03  # nearer to the point the ends say less
    assert np.ptp(np.abs(e[far])) > 0.01
    assert np.all(np.abs(n / r**2 * a / b - tau(e))[far] < 6e-3 * e[far] ** 4 + 1e-7)


def test_no_homoclinic_orbits_begin_where_the_normal_form_is_degenerate():
    """Of b = 0, where all of them are at n = 0, and of parameters that do not unfold the point."""
    point = special(disguised(1, 0, (), False)[0], "M", {"u": 0.2**0.5, "y": 0}, "N", "LP", "BT")
    with pytest.raises(pk.ParameterError, match="b = 0 of the normal form"):
        point.switch("homoclinic")


@pytest.mark.slow
def test_a_curve_that_begins_at_its_point_ends_there():
    """Of A -> B -> C: however small the first loop, its end is the point and takes few points."""
    reaction = pk.Problem(
        {"x": "-x + D*(1 - x)*exp(y)", "y": "-y + 14*D*(1 - x)*exp(y) - s*y"},
        parameters={"D": 0.1, "s": 2.0}, window={"x": (0, 1), "y": (0, 14)},
    )  # fmt: skip
    fold = pk.continuation(reaction, "D", x0=[0, 0], span=(0.0, 0.4)).special("LP")[0]
    (point,) = fold.curve("s", (1.0, 4.0)).special("BT")
    options = pk.ContinuationOptions(directions="backward", max_points=60)
    curve = point.switch("homoclinic", options=options)
    assert curve.stops[0].reason == "bogdanov_takens"
    located = re.findall(r"[Ds] = ([^ ,;]+)", curve.stops[0].message)[:2]
    np.testing.assert_allclose(np.array(located, float), [point["D"], point["s"]], rtol=1e-9)
    np.testing.assert_allclose(
        [float(curve.points[name][0]) for name in ("D", "s")], [point["D"], point["s"]], rtol=1e-3
    )


@pytest.mark.slow
def test_curves_of_homoclinic_orbits_end_at_bogdanov_takens_points():
    """And beside it they are where the constants of the series say."""
    system, start, _ = disguised(1, 1, (), False)
    curve = special(system, "M", start, "N", "LP", "BT").switch("homoclinic")
    assert [stop.reason for stop in curve.stops] == ["bogdanov_takens", "bound"]
    e = (-curve.points.M.values / 4) ** 0.25
    assert e.min() < 0.02
    located = re.findall(r"[MN] = ([^ ,;]+)", curve.stops[0].message.split(" point at ")[1])
    np.testing.assert_allclose(np.array(located[:2], float), 0.0, atol=1e-12)
    at = CubicSpline(e, curve.points.N.values / e**2)
    assert at(0.1) == pytest.approx(1.42977039512, abs=1e-9)
    assert at(0.3) == pytest.approx(1.43932162451, abs=1e-9)


def zero_hopf(sign):
    """Xi' = m + xi^2 + sign |w|^2, w' = (n + 1.3 i + 0.8 xi + xi^2) w: tori n = 0, m > 0."""
    rate = "(n + 4/5*z + z**2)"
    return pk.Problem(
        [f"m + z**2 + ({sign})*(x**2 + y**2)", f"{rate}*x - 13/10*y", f"{rate}*y + 13/10*x"],
        ("z", "x", "y"), {"m": -0.5, "n": 0.3},
    )  # fmt: skip


@pytest.mark.slow
def test_zero_hopf_points_lead_to_hopf_curves_and_tori():
    point = special(zero_hopf(-1), "m", [-(0.5**0.5), 0.0, 0.0], "n", "LP", "ZH")
    hopf = point.switch("hopf")
    n, z = hopf.points.n, hopf.points.z
    np.testing.assert_allclose(n + 0.8 * z + z**2, 0.0, atol=1e-12)
    tori = point.switch("torus", options=pk.ContinuationOptions(bounds={"m": (-1.0, 1.0)}))
    assert tori.kind == "torus"
    np.testing.assert_allclose(tori.points.n, 0.0, atol=1e-9)
    assert float(tori.points.m.min()) > 0.0


def test_zero_hopf_points_of_other_signs_have_no_tori():
    point = special(zero_hopf(1), "m", [-(0.5**0.5), 0.0, 0.0], "n", "LP", "ZH")
    with pytest.raises(pk.ParameterError, match="no torus begins here: c d = "):
        point.switch("torus")


@pytest.mark.slow
def test_hopf_hopf_points_lead_to_the_other_hopf_curve_and_to_two_curves_of_tori():
    """Radii r' = r (a - r^2 + s^2/2), s' = s (b - 7/10 r^2 - 6/5 s^2): b = 7/10 a, a = -5/12 b."""
    one = "(a - (x**2 + y**2) + (u**2 + v**2)/2)"
    two = "(b - 7/10*(x**2 + y**2) - 6/5*(u**2 + v**2))"
    system = pk.Problem(
        [f"{one}*x - 27/10*y", f"{one}*y + 27/10*x", f"{two}*u - v", f"{two}*v + u"],
        ("x", "y", "u", "v"), {"a": -0.5, "b": -0.2},
    )  # fmt: skip
    point = special(system, "a", np.zeros(4), "b", "H", "HH")
    other = point.switch("hopf", options=pk.ContinuationOptions(bounds={"a": (-1.0, 1.0)}))
    np.testing.assert_allclose(other.points.b, 0.0, atol=1e-12)
    assert float(other.points.a.max() - other.points.a.min()) == pytest.approx(2.0, abs=1e-6)
    tori = point.switch("torus")
    np.testing.assert_allclose(tori.points.b, 0.7 * tori.points.a, atol=1e-9)
    assert float(tori.points.a.min()) > 0.0
    tori = point.switch("torus", direction=1)
    np.testing.assert_allclose(tori.points.a, -5 / 12 * tori.points.b, atol=1e-9)
    assert float(tori.points.b.min()) > 0.0


@pytest.mark.slow
def test_points_at_which_nothing_is_followed_say_what_begins():
    cusp = pk.Problem("mu + l*x - x**3", state="x", parameters={"mu": -1.0, "l": 0.5})
    point = special(cusp, "mu", [-1.3], "l", "LP", "CP")
    with pytest.raises(pk.ParameterError, match="two folds that meet there"):
        point.switch()
    with pytest.raises(pk.ParameterError, match="kind: got 'hopf', wants None"):
        pk.continuation(cusp, "mu", x0=[-1.3], span=(-1.0, 1.0)).special("LP")[0].switch("hopf")
    henon = pk.Problem(["1 - a*x**2 + y", "b*x"], ("x", "y"), {"a": -0.1, "b": 0.3}, map=True)
    flips = pk.continuation(henon, "a", x0=[0.9, 0.3], span=(-0.5, 1.0)).special("PD")[0]
    (point,) = flips.curve("b", (-1.5, 0.8)).special("R2")
    with pytest.raises(pk.ParameterError, match="resonance_2"):
        point.switch()


def at_rest(k):
    """Equilibria of the oxidation of CO over q2."""
    values = {"q2": 0.6, "q1": 2.5, "q3": 10.0, "q4": 0.0675, "q5": 1.0, "q6": 0.1, "k": k}
    z = "(1 - x - y - s)"
    oxidation = pk.Problem(
        [f"2*q1*{z}**2 - 2*q5*x**2 - q3*x*y", f"q2*{z} - q6*y - q3*x*y", f"q4*({z} - k*s)"],
        ("x", "y", "s"), values,
    )  # fmt: skip
    return pk.continuation(oxidation, "q2", x0=[0.07, 0.2, 0.5], span=(0.5, 2.0))


@pytest.mark.slow
def test_homoclinic_orbits_begin_where_one_coefficient_is_small():
    """Of the oxidation of CO, a is 40 and 25 times smaller than b; families end on the curve."""
    rest = at_rest(0.4)
    one, other = rest.special("LP")[0].curve("k", (0.1, 2.0)).special("BT")
    few = pk.ContinuationOptions(max_points=3)
    assert other.switch("homoclinic", options=few).kind == "connection"
    few = pk.ContinuationOptions(max_points=45, directions="backward")
    curve = one.switch("homoclinic", options=few)
    q2, k = (float(curve.points[name][np.argmin(curve.points.k.values)]) for name in ("q2", "k"))
    assert k < 0.69
    there = at_rest(k)
    hopf = min(there.special("H"), key=lambda hopf: abs(hopf["q2"] - q2))
    family = hopf.switch()
    assert family.stops[1].reason == "homoclinic"
    assert float(family.points.q2[-1]) == pytest.approx(q2, abs=1e-9)


@pytest.mark.slow
@pytest.mark.parametrize("plain", [False, True])
def test_branch_points_form_curves_in_three_parameters(plain, tmp_path):
    """F = a + m x - x^3 + c m: f_m = 0 where x = -c, f_x = 0 where m = 3 c^2, so that a = -c^3."""
    values = {"m": 1.5, "a": -0.125, "c": 0.5}
    if plain:

        def f(x, m, a, c):
            return [a + m * x[0] - x[0] ** 3 + c * m, x[0] - x[1]]

        imperfect = pk.Problem(f, ("x", "y"), values)
    else:
        imperfect = pk.Problem(["a + m*x - x**3 + c*m", "x - y"], ("x", "y"), values)
    branch = pk.continuation(imperfect, "m", x0=[-0.5, -0.5], span=(-1.0, 2.0))
    (point,) = branch.special("BP")
    curve = point.curve(["a", "c"], [(-1.0, 1.0), (-0.9, 0.9)])
    assert curve.free == ("m", "a", "c")
    assert curve.kind == "branch_point"
    at = curve.points
    np.testing.assert_allclose(at.m, 3.0 * at.c**2, atol=1e-8 if plain else 1e-12)
    np.testing.assert_allclose(at.a, -(at.c**3), atol=1e-8 if plain else 1e-12)
    np.testing.assert_allclose(sorted(at.c.values[[0, -1]]), [-0.9, 0.9], atol=1e-12)
    if not plain:
        curve.save(tmp_path / "curve.nc")
        assert pk.Branch.load(tmp_path / "curve.nc") == curve
    with pytest.raises(pk.ConvergenceError, match=r"curve\(\[second, third\]"):
        point.curve("a", (-1.0, 1.0))
    with pytest.raises(pk.ParameterError, match="span: "):
        point.curve(["a", "c"], (-1.0, 1.0))
    with pytest.raises(pk.ParameterError, match="parameter: "):
        point.curve(["a", "a"], [(-1.0, 1.0), (-1.0, 1.0)])
    with pytest.raises(pk.ParameterError, match="one name, or of a branch point two"):
        point.curve(["a", "c", "m"], [(-1.0, 1.0)] * 3)


def bazykin(u, de, al):
    """Rates of a predator and its prey ([Kuznetsov2004] 8.3.5), and their slopes."""
    x, y = u
    share = 1 + al * x
    return (
        np.array([x - x * y / share - 0.01 * x**2, -y + x * y / share - de * y**2]),
        np.array(
            [[1 - y / share**2 - 0.02 * x, -x / share], [y / share**2, -1 + x / share - 2 * de * y]]
        ),
    )


def gap(de, al, saddle, focus):
    """How far apart both manifolds of a saddle cross the line to it, beyond a focus."""
    for _ in range(8):  # Newton's method
        saddle, focus = (u - np.linalg.solve(*bazykin(u, de, al)[::-1]) for u in (saddle, focus))
    line = saddle - focus
    rates, vectors = np.linalg.eig(bazykin(saddle, de, al)[1])
    crossed = []
    for sign in (1.0, -1.0):
        way = vectors[:, np.argmax(sign * rates)]
        way = -way * np.sign(way @ line)

        motion = solve_ivp(
            lambda t, u, sign=sign: sign * bazykin(u, de, al)[0], (0, 4000), saddle + 1e-7 * way,
            events=lambda t, u: (u - focus) @ [line[1], -line[0]],
            rtol=1e-11, atol=1e-12, method="DOP853",
        )  # fmt: skip
        crossed.append(next(u for u in motion.y_events[0] if (u - focus) @ line < 0))
    return float((crossed[0] - crossed[1]) @ line)


@pytest.mark.slow
@pytest.mark.parametrize(("place", "most"), [(0, 250), (1, 80)])
def test_curves_of_homoclinic_orbits_come_to_saddle_nodes_in_few_points(place, most):
    """Of Bazykin's system, along which the pulse moves in time by many times its width."""
    formulas = ["x - x*y/(1 + al*x) - x**2/100", "-y + x*y/(1 + al*x) - de*y**2"]
    system = pk.Problem(formulas, ("x", "y"), {"de": 0.3, "al": 0.3})
    rest = pk.continuation(system, "de", x0=[2.87, 1.8], span=(0.2, 0.6))
    point = rest.special("LP")[0].curve("al", (0.001, 1.5)).special("BT")[place]
    curve = point.switch("homoclinic")
    ends = {stop.reason: i for stop, i in zip(curve.stops, (0, -1), strict=True)}
    assert set(ends) == {"bogdanov_takens", "non_central_saddle_node"}
    assert curve.points.sizes["point"] < most
    there = [float(curve.points[name][ends["bogdanov_takens"]]) for name in ("de", "al")]
    np.testing.assert_allclose(there, [point["de"], point["al"]], rtol=1e-3)
    middle = curve.points.sizes["point"] // 2
    de, al = (float(curve.points[name][middle]) for name in ("de", "al"))
    orbit = curve.orbit(middle)
    saddle = np.array([float(orbit.x[0]), float(orbit.y[0])])
    focus = np.array([float(one.min() + one.max()) / 2 for one in (orbit.x, orbit.y)])
    exact = brentq(gap, de - 1e-5 * de, de + 1e-5 * de, (al, saddle, focus), xtol=1e-15)
    assert de == pytest.approx(exact, rel=1e-9)
