"""Fixed points of maps: special points at places that closed forms give."""

import pickle
from functools import partial

import matplotlib
import mpmath
import numba
import numpy as np
import pytest

import phasekit as pk
from phasekit.labelled.continuation.branch import Branch

LOGISTIC = pk.Problem("r*x*(1 - x)", "x", {"r": 2.0}, map=True)
HENON = pk.Problem(["1 - a*x**2 + y", "b*x"], ("x", "y"), {"a": 0.1, "b": 0.3}, map=True)
DELAYED = pk.Problem(["r*x*(1 - y)", "x"], ("x", "y"), {"r": 1.5}, map=True)


def logistic(x, r):
    return r * x * (1.0 - x)


@numba.njit
def compiled(x, r):
    return np.array([r * x[0] * (1.0 - x[0])])


FORMS = {
    "formula": LOGISTIC,
    "python": pk.Problem(logistic, "x", {"r": 2.0}, map=True),
    "jac": pk.Problem(
        logistic, "x", {"r": 2.0}, lambda x, r: np.array([[r * (1.0 - 2.0 * x[0])]]), map=True
    ),
    "compiled": pk.Problem(compiled, "x", {"r": 2.0}, map=True),
}


@pytest.mark.slow
@pytest.mark.parametrize("form", list(FORMS))
def test_the_logistic_map(form):
    problem = FORMS[form]
    np.testing.assert_allclose(problem([0.25]), [0.375])
    np.testing.assert_allclose(problem.derivatives([0.25])[1], [[1.0]], rtol=1e-9)
    branch = pk.continuation(problem, "r", x0=[0.5], span=(0.5, 4))
    (crossing,) = branch.special("transcritical")
    (doubling,) = branch.special("PD")
    assert not len(doubling.directions)
    assert [crossing.status, doubling.status] == ["converged", "converged"]
    assert abs(crossing["r"] - 1.0) < 1e-9
    assert abs(doubling["r"] - 3.0) < (1e-15 if form == "formula" else 1e-9)
    assert abs(doubling.eigenvalues[0] + 1.0) < 1e-8
    # (f o f)''' = -12 c where f' = -1: -3 f''^2 - 2 f''' = -108.
    assert abs(doubling.normal_form["c"] - 9.0) < 1e-5
    r, x, unstable = (branch.points[name].values for name in ("r", "x", "n_unstable"))
    own = np.abs(r * (1.0 - 2.0 * x)) > 1.0 + 1e-5
    sure = np.abs(np.abs(r * (1.0 - 2.0 * x)) - 1.0) > 1e-5
    np.testing.assert_array_equal(unstable[sure], own[sure])
    assert np.sum(sure) > 40


def test_orbits_of_period_two_and_four():
    (doubling,) = pk.continuation(LOGISTIC, "r", x0=[0.5], span=(1.5, 3.6)).special("PD")
    twice = doubling.switch()
    assert twice.problem.map
    (begin,) = twice.special("pitchfork")
    # Two routes to one coefficient: the pitchfork of f o f has -2 c.
    assert abs(begin.normal_form["c"] + 2.0 * doubling.normal_form["c"]) < 1e-9
    r, x = twice.points.r.values, twice.points.x.values
    gap = np.abs(r**2 * x**2 - r * (r + 1.0) * x + r + 1.0)  # orbits of period 2 proper
    assert np.max(gap) < 1e-12
    seconds = twice.special("PD")
    np.testing.assert_allclose([s["r"] for s in seconds], [1.0 + np.sqrt(6.0)], rtol=1e-15)
    (third,) = seconds[0].switch().special("PD")[:1]
    assert abs(third["r"] - 3.5440903595519229) < 1e-13  # the root of a polynomial of degree 12


def test_the_henon_map():
    branch = pk.continuation(HENON, "a", x0=[0.9, 0.3], span=(-0.2, 1.0))
    ((fold,), (doubling,)) = branch.special("LP"), branch.special("PD")
    b = 0.3
    assert abs(fold["a"] + (1.0 - b) ** 2 / 4.0) < 1e-15
    assert abs(doubling["a"] - 3.0 * (1.0 - b) ** 2 / 4.0) < 1e-15
    np.testing.assert_allclose(np.sort(fold.eigenvalues.real), [-b, 1.0], atol=1e-9)
    np.testing.assert_allclose(np.sort(doubling.eigenvalues.real), [-1.0, b], atol=1e-14)
    curve = fold.curve("b", (0.0, 0.5))
    b = curve.points.b.values
    np.testing.assert_allclose(curve.points.a.values, -((1.0 - b) ** 2) / 4.0, atol=1e-14)
    two = doubling.switch().points
    a, x, y = (two[name].values for name in ("a", "x", "y"))
    other = 1.0 - a * x**2 + y
    assert np.max(np.abs(1.0 - a * other**2 + 0.3 * x - x)) < 1e-12
    assert np.max(np.abs(other - x)) > 0.3


def four_numbers(slopes, second):
    """The cubic coefficient of a planar map by g20, g11, g02 ([Kuznetsov2004] (4.26))."""
    values, vectors = np.linalg.eig(slopes)
    k = int(np.argmax(values.imag))
    mu, q = values[k], vectors[:, k]
    values, vectors = np.linalg.eig(slopes.T)
    p = vectors[:, int(np.argmin(values.imag))]
    p = p / np.conj(np.vdot(p, q))
    bar = np.conj(q)
    g20, g11, g02 = (np.vdot(p, second(*pair)) for pair in ((q, q), (q, bar), (bar, bar)))
    lead = (1.0 - 2.0 * mu) * np.conj(mu) ** 2 / (2.0 * (1.0 - mu)) * g20 * g11
    return -np.real(lead) - abs(g11) ** 2 / 2.0 - abs(g02) ** 2 / 4.0


def test_the_delayed_logistic_map():
    branch = pk.continuation(DELAYED, "r", x0=[0.3, 0.3], span=(0.5, 3.0))
    (torus,) = branch.special("TR")
    assert (torus.kind, torus.status) == ("torus", "converged")
    assert abs(torus["r"] - 2.0) < 1e-15
    assert abs(torus.normal_form["angle"] - np.pi / 3.0) < 1e-15
    wanted = four_numbers(
        np.array([[1.0, -1.0], [1.0, 0.0]]),
        lambda a, b: np.array([-2.0 * (a[0] * b[1] + a[1] * b[0]), 0.0]),
    )
    assert abs(torus.normal_form["d"] - wanted) < 1e-14
    assert wanted < 0.0
    inside = branch.points.r.values < 2.0 - 1e-6
    beyond = branch.points.r.values > 2.0 + 1e-6
    assert set(branch.points.n_unstable.values[beyond]) == {2}
    assert set(branch.points.n_unstable.values[inside & (branch.points.r.values > 1.01)]) == {0}
    with pytest.raises(pk.ParameterError, match="a branch point"):
        torus.switch()
    with pytest.raises(pk.ParameterError, match="parameter: got 'r', wants another"):
        torus.curve("r", (0, 1))


def test_strong_resonances_say_so():
    # A rotation by a third of a turn at p = 0, with a quadratic term.
    c, s = -0.5, float(np.sqrt(0.75))
    problem = pk.Problem(
        [f"(1 + p)*({c}*x - {s!r}*y) + x**2", f"(1 + p)*({s!r}*x + {c}*y)"],
        ("x", "y"), {"p": -0.5}, map=True,
    )  # fmt: skip
    (torus,) = pk.continuation(problem, "p", x0=[0, 0], span=(-0.6, 0.4)).special("TR")
    assert abs(torus["p"]) < 1e-14
    assert np.isnan(torus.normal_form["d"])
    assert "a third of a turn" in torus.message


@pytest.mark.parametrize("scales", [(1.0, 1.0, 1.0), (1e-6, 1e3, 1e6)])
def test_a_map_of_three_states_in_any_units(scales):
    """Of x -> y, y -> z, z -> M + B x + C y - z^2 multipliers are roots of a cubic."""
    a, b, c = scales
    problem = pk.Problem(
        [f"{a!r}*y/{b!r}", f"{b!r}*z/{c!r}", f"{c!r}*(M + B*x/{a!r} + C*y/{b!r} - (z/{c!r})**2)"],
        ("x", "y", "z"), {"M": 0.0, "B": 0.3, "C": 0.2}, map=True,
    )  # fmt: skip
    branch = pk.continuation(problem, "M", x0=[0, 0, 0], span=(-0.2, 3.0))
    for special in branch.special_points:
        if special.kind == "end":
            continue
        s = special.x[2] / c
        assert abs(special["M"] + 0.5 * s - s - s**2) < 1e-12
        own = np.roots([1.0, 2.0 * s, -0.2, -0.3])
        test = {
            "fold": lambda mu: np.min(np.abs(mu - 1.0)),
            "period_doubling": lambda mu: np.min(np.abs(mu + 1.0)),
            "torus": lambda mu: np.min(np.abs(np.abs(mu[mu.imag != 0.0]) - 1.0)),
        }
        assert test[special.kind](own) < 1e-12
    kinds = [s.kind for s in branch.special_points]
    # mu = 1: s = -1/4; mu = -1: 2 s = 1.1.
    assert kinds.count("fold") == 1
    assert kinds.count("period_doubling") == 1


def test_the_ikeda_map():
    t = "(0.4 - 6/(1 + x**2 + y**2))"
    problem = pk.Problem(
        [f"1 + u*(x*cos{t} - y*sin{t})", f"u*(x*sin{t} + y*cos{t})"], ("x", "y"), {"u": 0.2},
        map=True,
    )  # fmt: skip
    branch = pk.continuation(problem, "u", x0=[1.0, 0.0], span=(0.0, 0.9))
    found = [s for s in branch.special_points if s.kind != "end"]
    assert len(found) >= 1
    with mpmath.workdps(40):
        for special in found:
            x, y, u = (mpmath.mpf(special[name]) for name in ("x", "y", "u"))

            def f(i, x, y, u=u):
                turn = mpmath.mpf("0.4") - 6 / (1 + x * x + y * y)
                z = 1 + u * (x + 1j * y) * mpmath.expj(turn)
                return z.real if i == 0 else z.imag

            rows = [[mpmath.diff(partial(f, i), (x, y), order) for order in ((1, 0), (0, 1))]
                    for i in (0, 1)]  # fmt: skip
            trace, det = rows[0][0] + rows[1][1], mpmath.det(mpmath.matrix(rows))
            value = {"fold": 1 - trace + det, "period_doubling": 1 + trace + det, "torus": det - 1}
            assert abs(value[special.kind]) < 1e-12
            assert max(abs(f(0, x, y) - x), abs(f(1, x, y) - y)) < 1e-14


def test_area_preserving_maps_have_no_torus_from_rounding():
    problem = pk.Problem(
        ["x + y + k*sin(x)", "y + k*sin(x)"], ("x", "y"), {"k": -1.0}, map=True,
    )  # fmt: skip
    branch = pk.continuation(problem, "k", x0=[0.0, 0.0], span=(-5.0, 1.0))
    assert branch.special("TR") == ()
    (doubling,) = branch.special("PD")  # trace 2 + k = -2
    assert abs(doubling["k"] + 4.0) < 1e-7
    k = branch.points.k.values
    elliptic = (k > -4.0 + 1e-3) & (k < -1e-3)
    assert np.sum(elliptic) > 10
    assert set(branch.points.n_unstable.values[elliptic]) == {0}


@pytest.mark.slow
def test_maps_are_saved_pickled_drawn_and_have_events(tmp_path):
    branch = pk.continuation(
        DELAYED, "r", x0=[0.3, 0.3], span=(0.5, 3.0), events={"third": "x - 1/3"}, stop="TR"
    )
    assert branch.stops[1].reason == "TR"
    (third,) = branch.special("third")
    assert abs(third["r"] - 1.5) < 1e-15
    assert pickle.loads(pickle.dumps(branch)).points.identical(branch.points)
    branch.save(tmp_path / "b.nc")
    loaded = Branch.load(tmp_path / "b.nc")
    assert loaded.problem.map
    assert loaded.points.identical(branch.points)
    assert "fixed points" in repr(loaded)
    ax = branch.plot()
    assert "TR" in [text.get_text() for text in ax.texts]
    matplotlib.pyplot.close(ax.figure)


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: pk.Problem("x", "x", {"a": 1.0}, map=1), "map: got 1"),
        (lambda: pk.Problem("x", "x", {"a": 1.0}, map=True, conservative=True), "conservative"),
        (lambda: pk.Problem("x", "x", {"a": 1.0}, map=True, time="t", period=1.0), "time: got 't'"),
        (lambda: pk.Problem("x", "x", {"a": 1.0}, map=True, period=1.0), "period: got 1.0"),
        (lambda: pk.periodic_orbit(HENON, [0.1, 0.1]), "wants a flow"),
        (lambda: pk.continuation(HENON, "a", orbit=1, span=(0, 1)), "orbit: got 1, wants None"),
        (lambda: pk.poincare_section(LOGISTIC, [0.1], duration=1.0, section="x"), "wants a flow"),
        (lambda: pk.continuation(LOGISTIC, "r", x0=[0.5], span=(1, 4), stop="H"), "stop: event"),
        (lambda: LOGISTIC.iterated(0), "n: got 0"),
        (lambda: pk.Problem("x**2", "x", {"a": 1.0}).iterated(2), "wants a map"),
    ],
)
def test_what_makes_no_sense_of_maps_is_refused(call, message):
    with pytest.raises(pk.ParameterError, match=message):
        call()


def test_area_preserving_maps_have_no_points_from_rounding():
    standard = pk.Problem(["x + y + k*sin(x)", "y + k*sin(x)"], ("x", "y"), {"k": -1.0}, map=True)
    branch = pk.continuation(standard, "k", x0=[0.0, 0.0], span=(-5.0, 1.0))
    inner = [s for s in branch.special_points if s.kind != "end"]
    assert [s.kind for s in inner] == ["period_doubling", "pitchfork"]
    assert inner[0].message == "c not known: two multipliers are -1"
    henon = pk.Problem(["1 - a*x**2 - y", "x"], ("x", "y"), {"a": 0.5}, map=True)
    branch = pk.continuation(henon, "a", x0=[0.5, 0.5], span=(-2.0, 5.0))
    inner = [s for s in branch.special_points if s.kind != "end"]
    assert [s.kind for s in inner] == ["fold", "period_doubling"]
    np.testing.assert_allclose([s["a"] for s in inner], [-1.0, 3.0], atol=1e-7)


def test_what_is_not_looked_for_is_no_other_point():
    options = pk.ContinuationOptions(detect=("fold", "branch_point"))
    branch = pk.continuation(DELAYED, "r", x0=[0.3, 0.3], span=(0.5, 3.0), options=options)
    assert [s.kind for s in branch.special_points] == ["end", "transcritical", "end"]


@pytest.mark.slow
def test_values_of_maps_are_those_of_f_to_the_last_digit():
    for f in ("1e-20*x", lambda x, a: 1e-20 * x, numba.njit(lambda x, a: np.array([1e-20 * x[0]]))):
        value, slope = pk.Problem(f, "x", {"a": 0.5}, map=True).derivatives([1.0])
        np.testing.assert_allclose([value[0], slope[0, 0]], [1e-20, 1e-20], rtol=1e-9)


@pytest.mark.parametrize(
    ("f", "jac", "message"),
    [
        (lambda x, a: None, None, "f: returned None"),
        (lambda x, a: "x", None, "f: returned x, wants numbers"),
        (lambda x, a: [a, 1.0], None, "f: returned .* of shape"),
        (lambda x, a: np.sqrt(np.array(x - 0.5, dtype=complex)), None, "f: returned complex"),
        (lambda x, a: a * x, lambda x, a: [1.0, 2.0], "jac: returned"),
        (lambda x, a: a * x, lambda x, a: None, "jac: returned None"),
    ],
)
def test_what_a_map_returns_is_checked(f, jac, message):
    with pytest.raises(pk.ParameterError, match=message):
        pk.Problem(f, "x", {"a": 0.5}, jac, map=True).derivatives([0.1])


@pytest.mark.slow
@pytest.mark.parametrize("bulge", [0.5, 0.8])
def test_orbits_between_two_period_doublings_are_followed_once(bulge):
    # x -> -(1 + m) x + x^3 with m = bulge - r^2: doublings at r = -+ sqrt(bulge), x^2 = m between.
    f = f"-(1 + {bulge} - r**2)*x + x**3"
    problem = pk.Problem(f, "x", {"r": -1.2}, map=True)
    ends = pk.continuation(problem, "r", x0=[0.0], span=(-1.3, 1.3)).special("PD")
    assert len(ends) == 2
    for point in ends:
        orbits = point.switch()
        r, x = orbits.points.r.values, orbits.points.x.values
        assert len(r) > 10
        assert np.max(np.abs(x**2 - (bulge - r**2))) < 1e-9
        assert np.all(x > -1e-9) or np.all(x < 1e-9)
        assert abs(np.ptp(r) - 2.0 * np.sqrt(bulge)) < 1e-6
        assert "another period doubling" in orbits.stops[1].message
