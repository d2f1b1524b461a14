"""Boundary value problems: closed forms, AUTO's demos, and what is refused."""

from __future__ import annotations

import pickle
from pathlib import Path

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.optimize import brentq, fsolve

import phasekit as pk

FOLD = 3.513830719125161  # 8 / sinh(x)^2 at x tanh(x) = 1
SHORT = pk.ContinuationOptions(max_points=30)


def bratu() -> pk.BoundaryProblem:
    law = {"u": "v", "v": "-lam*exp(u)"}
    return pk.BoundaryProblem(law, ["u(0)", "u(1)"], parameters={"lam": 0.0})


def test_bratu_folds_where_its_closed_form_does() -> None:
    x = brentq(lambda x: x * np.tanh(x) - 1.0, 1.0, 1.5, xtol=1e-15)
    assert 8.0 / np.sinh(x) ** 2 == pytest.approx(FOLD, rel=1e-14)
    branch = pk.continuation(bratu(), "lam", span=(0, 4), events={"high": "u_max - 4"}, stop="high")
    (fold,) = branch.special("LP")
    assert fold["lam"] == pytest.approx(FOLD, abs=1e-12)
    assert not branch.special("BP")
    # exp(u_max/2) = cosh(t), lam = 8 t^2 / cosh(t)^2
    t = np.arccosh(np.exp(branch.points.u_max / 2))
    np.testing.assert_allclose(branch.points.lam, 8 * (t / np.cosh(t)) ** 2, atol=1e-9)
    assert branch.kind == "boundary"
    assert branch.orbit(3).u.values[[0, -1]].tolist() == pytest.approx([0, 0], abs=1e-15)


def test_functions_are_formulas() -> None:
    def rate(x, lam):
        return [x[1], -lam * np.exp(x[0])]

    problem = pk.BoundaryProblem(
        rate,
        lambda x0, x1, lam: [x0[0], x1[0]],
        lambda x, lam: [],
        {"lam": 0.0},
        state=("u", "v"),
    )
    branch = pk.continuation(problem, "lam", span=(0, 4), stop="fold")
    assert branch.special("fold")[0]["lam"] == pytest.approx(FOLD, abs=1e-10)


@pytest.mark.slow
def test_eigenvalues_are_branch_points() -> None:
    """AUTO's demos bvp and lin: u'' = -(pi p)^2 u + u^2 branches at whole p."""
    law = {"u": "v", "v": "-(p*pi)^2*u + k*u^2"}
    values = {"p": 0.0, "mean": 0.0, "k": 1.0}
    problem = pk.BoundaryProblem(law, ["u(0)", "u(1)"], ["u - mean"], values)
    branch = pk.continuation(problem, ("p", "mean"), span=(0, 3.5))
    points = branch.special("BP")
    np.testing.assert_allclose([point["p"] for point in points], [1, 2, 3], atol=1e-9)
    with pytest.warns(RuntimeWarning, match="max_points"):
        other = points[1].switch(options=SHORT)
    assert float(other.points.u_max.max()) > 0.3
    np.testing.assert_allclose(other.points["mean"], other.points.u_mean, atol=1e-9)
    linear = problem.replace(k=0.0)
    branch = pk.continuation(linear, ("p", "mean"), span=(0, 1.5))
    (point,) = branch.special("BP")
    assert point["p"] == pytest.approx(1.0, abs=1e-9)


def test_integrals_free_parameters() -> None:
    """AUTO's demo int: one condition and one integral on two states."""
    law = {"u": "v", "v": "-lam*exp(u)"}
    values = {"lam": 0.0, "gap": 0.0, "mean": 0.3}
    problem = pk.BoundaryProblem(law, ["u(0) - u(1) - gap"], ["u - mean"], values)
    assert problem.freed == 1
    with pytest.warns(RuntimeWarning, match="max_points"):
        branch = pk.continuation(problem, "gap", x0=[0.3, 0.0], span=(0, 2), options=SHORT)
    orbit, gap = branch.orbit(-1), float(branch.points.gap[-1])
    # With lam = 0 the orbit is a straight line, of this slope and through the mean in the middle.
    np.testing.assert_allclose([orbit.u[0], orbit.v[0]], [0.3 + gap / 2, -gap], atol=1e-12)


def fold_curve(problem, parameter, second, span, **held):
    """The curve through the first fold, which ends at bounds on both sides."""
    branch = pk.continuation(problem, parameter, span=(0, 20), stop="fold", **held)
    curve = branch.special("fold")[0].curve(second, span)
    assert [stop.reason for stop in curve.stops] == ["bound", "bound"]
    assert curve.kind == "fold"
    assert curve.points.sizes["point"] > 9
    np.testing.assert_allclose(sorted(curve.points[second].values[[0, -1]]), span, rtol=1e-12)
    return curve


STEEP = {"u": "v", "v": "-(lam + c)*exp(k*u)"}
PLAIN = pk.BoundaryProblem(STEEP, ["u(0)", "u(1)"], parameters={"lam": 0.0, "c": 0.0, "k": 1.0})
FREED = pk.BoundaryProblem(
    {"u": "v", "v": "-lam*exp(k*u)"}, ["u(0)", "u(1)"], ["u - c"], {"lam": 0.0, "c": 0.0, "k": 1.0}
)
CODED = pk.BoundaryProblem(
    lambda x, lam, k: [x[1], -lam * np.exp(k * x[0])],
    lambda x0, x1, lam, k: [x0[0] * (1 + x0[1] ** 2), np.sin(x1[0])],
    lambda x, lam, k: [], {"lam": 0.0, "k": 1.0}, state=("u", "v"),
)  # fmt: skip


@pytest.mark.slow
@pytest.mark.parametrize(
    ("problem", "parameter", "held"),
    [
        (FREED, ("lam", "c"), {}),
        (PLAIN, ("lam", "c"), {"constraints": "c - lam*mean(k*u)"}),
        (CODED, "lam", {}),
    ],
)
def test_folds_form_curves(problem, parameter, held):
    """With k u as state k is a factor of lam, and of c where that is held."""
    curve = fold_curve(problem, parameter, "k", (0.5, 2.0), **held)
    points, rate = curve.points, curve.points.lam * curve.points.k
    assert np.ptp(rate.values) < 1e-12
    if held:
        np.testing.assert_allclose(points.c * points.k, rate * points.k * points.u_mean, atol=1e-12)
    else:
        np.testing.assert_allclose(rate, FOLD, atol=1e-12)
    if not callable(problem.conditions):
        assert pickle.loads(pickle.dumps(curve)) == curve


@pytest.mark.slow
def test_folds_with_an_integral_are_those_of_the_solution_in_closed_form(tmp_path):
    """AUTO's demo int: u = log(2 a^2/lam) - 2 log cosh(a (s - c)), whose two equations fold."""
    problem = pk.BoundaryProblem(
        {"u": "v", "v": "-lam*exp(u)"}, ["u(0) - u(1) - gap"], ["u - mean"],
        {"lam": 0.0, "gap": 0.0, "mean": 0.0},
    )  # fmt: skip
    curve = fold_curve(problem, "lam", "gap", (-3.0, 3.0))
    assert float(curve.points.lam.max()) == pytest.approx(11.9238, abs=1e-4)
    s, weights = (np.polynomial.legendre.leggauss(40)[k] / 2 for k in (0, 1))
    for i in range(0, len(curve.path), 3):
        orbit = curve.orbit(i)
        u, v, lam, gap = (float(orbit[name].values.flat[0]) for name in ("u", "v", "lam", "gap"))
        a = np.sqrt(v**2 / 4 + lam * np.exp(u) / 2)
        c = np.arctanh(v / 2 / a) / a
        ends, at = np.tanh([a * (1 - c), a * c]), s + 0.5 - c
        slopes = [
            [2 * (1 - c) * ends[0] - 2 * c * ends[1], -2 * a * (ends[0] + ends[1])],
            [2 / a - weights @ (2 * at * np.tanh(a * at)), gap],
        ]
        assert abs(np.linalg.det(slopes)) < 1e-10
    curve.save(tmp_path / "folds.nc")
    loaded = pk.CycleBranch.load(tmp_path / "folds.nc")
    assert loaded == curve
    assert loaded.extend(bounds={"gap": (-3.5, 3.0)}).points.gap.min() == -3.5


@pytest.mark.slow
def test_cusps_on_curves_of_folds() -> None:
    """U'' = -lam exp(u/(1 + e u)) from its top M falls to 0 in a time T(M): T' = T'' = 0 there."""

    def bends(z: np.ndarray) -> list[float]:
        top, e = z

        def rate(t: float, x: np.ndarray) -> list[float]:
            u, w, u1, w1, u2, w2 = x  # with derivatives by M
            d = 1 + e * u
            f = np.exp(u / d)
            f1, f2 = f / d**2, f / d**4 - 2 * e * f / d**3
            return [w, -f, w1, -f1 * u1, w2, -f1 * u2 - f2 * u1**2]

        def down(t: float, x: np.ndarray) -> float:
            return float(x[0])

        down.terminal = True
        x = [top, 0.0, 1.0, 0.0, 0.0, 0.0]
        made = solve_ivp(rate, (0, 9), x, "DOP853", events=down, rtol=1e-12, atol=1e-12)
        u, w, u1, w1, u2, _ = made.y_events[0][0]
        first = -u1 / w
        force = -np.exp(u / (1 + e * u))
        return [first, -(u2 + 2 * w1 * first + force * first**2) / w]

    top, e = fsolve(bends, [5.0, 0.24], xtol=1e-12)
    assert e == pytest.approx(0.24578, abs=1e-5)  # the transition of thermal ignition in a slab
    problem = pk.BoundaryProblem(
        {"u": "v", "v": "-lam*exp(u/(1 + e*u))"}, ["u(0)", "u(1)"], ["u - mean"],
        {"lam": 0.0, "mean": 0.0, "e": 0.2},
    )  # fmt: skip
    branch = pk.continuation(problem, ("lam", "mean"), span=(0, 6), stop="fold")
    curve = branch.special("fold")[0].curve("e", (0.15, 0.3))
    (cusp,) = curve.special("CP")
    assert cusp.status == "converged"
    assert cusp["e"] == pytest.approx(e, abs=1e-9)
    assert float(cusp.orbit.u_max) == pytest.approx(top, abs=1e-5)


@pytest.mark.slow
def test_the_cusp_of_a_cubic_in_a_condition() -> None:
    condition = ["p + q*u(0) - u(0)^3 + 2*(u(1) - u(0))", "u(1) - u(0)"]
    problem = pk.BoundaryProblem(
        {"u": "v", "v": "0*u"}, condition, parameters={"p": -1.0, "q": 1.0}
    )
    branch = pk.continuation(problem, "p", x0=[-1.3, 0.0], span=(-1, 1), stop="fold")
    curve = branch.special("fold")[0].curve("q", (-1.0, 1.5))
    np.testing.assert_allclose(27 * curve.points.p**2, 4 * curve.points.q**3, atol=1e-12)
    (cusp,) = curve.special("CP")
    assert [cusp["p"], cusp["q"]] == pytest.approx([0.0, 0.0], abs=1e-9)


def by_hand(fields, slopes, unknown: dict, length: float, **values: float) -> pk.BoundaryProblem:
    """A heteroclinic orbit of a planar system: at both ends an eigenvector of an equilibrium."""
    conditions = ["x0^2 + y0^2 - 1", "x1^2 + y1^2 - 1"]
    for k in (0, 1):
        at = (f"(u({k}) - e{k}*x{k})", f"(v({k}) - e{k}*y{k})")
        conditions += [field(*at) for field in fields]
        for row, own in zip(slopes(*at), ("x", "y"), strict=True):
            conditions.append(f"({row[0]})*x{k} + ({row[1]})*y{k} - m{k}*{own}{k}")
    law = {name: f"{length}*({field('u', 'v')})" for name, field in zip("uv", fields, strict=True)}
    return pk.BoundaryProblem(law, conditions, ["u - 1/2"], {**values, **unknown})


def test_fronts_of_nagumo_by_hand() -> None:
    """AUTO's demo nag: c = sqrt(2) (1/2 - a) exactly."""
    length, root = 50.0, np.sqrt(0.5)

    def exact(s: float) -> tuple[float, float]:
        e = np.exp(length * (s - 0.5) * root)
        return e / (1 + e), root * e / (1 + e) ** 2

    size = 1 / np.sqrt(1 + root**2)
    e = float(np.hypot(*exact(0.0)))
    unknown = {
        "e0": e, "x0": size, "y0": root * size, "m0": root,
        "e1": e, "x1": -size, "y1": root * size, "m1": -root,
    }  # fmt: skip
    problem = by_hand(
        (lambda u, v: v, lambda u, v: f"c*{v} - {u}*(1 - {u})*({u} - a)"),
        lambda u, v: [(0, 1), (f"-(1 - {u})*({u} - a) + {u}*({u} - a) - {u}*(1 - {u})", "c")],
        unknown, length, a=0.5, c=0.0,
    )  # fmt: skip
    assert problem.freed == 10
    branch = pk.continuation(problem, ("a", "c", *unknown), x0=exact, span=(0.1, 0.9))
    assert branch.stops[1].reason == "bound"
    np.testing.assert_allclose(branch.points.c, np.sqrt(2) * (0.5 - branch.points.a), atol=1e-11)


@pytest.mark.slow
def test_sharp_wave_by_hand() -> None:
    """AUTO's demo stw: from the exact wave of speed 1, held against shooting."""
    length = 60.0

    def exact(s: float) -> tuple[float, float]:
        e = np.exp(length * (s - 0.5))
        return 1 / (1 + e), -0.5 * e / (1 + e)

    e, r = 0.5 * np.sqrt(5.0) / (1 + np.exp(0.5 * length)), np.sqrt(5.0)
    unknown = {
        "e0": e, "x0": -2 / r, "y0": -1 / r, "m0": 1.0,
        "e1": e, "x1": 1.0, "y1": 0.0, "m1": -1.0,
    }  # fmt: skip
    unknown |= {"x1": exact(1.0)[0] / e, "y1": (exact(1.0)[1] + 0.5) / e}
    size = np.hypot(unknown["x1"], unknown["y1"])
    unknown |= {"x1": unknown["x1"] / size, "y1": unknown["y1"] / size, "e1": e * size}
    a, b, c = "(2*{u} + p*{u}^2)", "(2*(1 - p) + p*{u})", "({u} - {u}^2)"
    da, db, dc = "(2 + 2*p*{u})", "p", "(1 - 2*{u})"

    def law(u: str, v: str) -> str:
        return f"-c*{v} - {b.format(u=u)}*{v}^2 - {c.format(u=u)}"

    problem = by_hand(
        (lambda u, v: f"{a.format(u=u)}*{v}", law),
        lambda u, v: [
            (f"{da.format(u=u)}*{v}", a.format(u=u)),
            (f"-{db}*{v}^2 - {dc.format(u=u)}", f"-c - 2*{b.format(u=u)}*{v}"),
        ],
        unknown, length, p=0.0, c=1.0,
    )  # fmt: skip
    branch = pk.continuation(problem, ("p", "c", *unknown), x0=exact, span=(0.0, 0.5))
    assert branch.stops[1].reason == "bound", branch
    p = 0.5

    def passed(c: float) -> float:
        """By how much the unstable manifold of (1, 0) passes the equilibrium (0, -c) at u = 0."""

        def rate(t: float, x: np.ndarray) -> list[float]:
            u, v = x
            return [(2 * u + p * u**2) * v, -c * v - (2 * (1 - p) + p * u) * v**2 - u + u**2]

        values, vectors = np.linalg.eig(np.array([[0.0, 2 + p], [1.0, -c]]))
        way = vectors[:, np.argmax(values)]
        way *= -np.sign(way[0])

        def up(t: float, x: np.ndarray) -> float:
            return float(x[1] + 0.1 * c)

        def down(t: float, x: np.ndarray) -> float:
            return float(x[1] + 3.0 * c)

        up.terminal = down.terminal = True
        up.direction, down.direction = 1.0, -1.0
        start, both = np.array([1, 0]) + 1e-7 * way, (up, down)
        made = solve_ivp(rate, (0, 300), start, events=both, rtol=1e-11, atol=1e-14)
        return float(made.y[1, -1] + c / (2 * (1 - p)))

    speed = float(branch.points.c[-1])
    assert passed(speed - 1e-8) * passed(speed + 1e-8) < 0.0


@pytest.mark.slow
def test_solutions_are_kept_and_copied(tmp_path: Path) -> None:
    problem = bratu()
    assert pickle.loads(pickle.dumps(problem)) == problem
    assert problem.replace(lam=1.0) != problem
    assert pk.BoundaryProblem.from_specification(problem.specification()) == problem
    with pytest.warns(RuntimeWarning, match="max_points"):
        branch = pk.continuation(problem, "lam", span=(0, 4), options=SHORT)
    branch.save(tmp_path / "a.nc")
    loaded = pk.Branch.load(tmp_path / "a.nc")
    assert loaded == branch
    assert pickle.loads(pickle.dumps(branch)) == branch
    with pytest.warns(RuntimeWarning, match="max_points"):
        assert loaded.extend(5) == branch.extend(5)


@pytest.mark.parametrize(
    ("conditions", "message"),
    [
        (["u", "u(1)"], r"u\(0\) or u\(1\) in place of u"),
        (["u(2)", "u(1)"], r"got 'u\(2\)', wants u\(0\) or u\(1\)"),
        (["u(0)"], "at least 2 conditions"),
        (["u(0)", "u(1)", "v(0)"], "at most 2"),
        (3, "formulas as text, or a function"),
        (lambda x0: [1.0, 2.0], r"wants a function conditions\(x0, x1, \*\*parameters\)"),
    ],
)
def test_bad_conditions_are_refused(conditions: object, message: str) -> None:
    with pytest.raises(pk.ParameterError, match=message):
        pk.BoundaryProblem({"u": "v", "v": "-lam*exp(u)"}, conditions, parameters={"lam": 0.0})


@pytest.mark.parametrize("stop", ["fold", "branch_point"])
def test_what_stands_where_a_branch_ends_is_kept(stop: str) -> None:
    """Bratu's u of complex values turns where its real part does: a fold and a branch point."""
    law = {"u": "v", "w": "z", "v": "-p*exp(u)*cos(w)", "z": "-p*exp(u)*sin(w)"}
    problem = pk.BoundaryProblem(law, ["u(0)", "u(1)", "w(0)", "w(1)"], parameters={"p": 0.0})
    branch = pk.continuation(problem, "p", span=(0, 4), stop=stop)
    kinds = [one.kind for one in branch.special_points]
    assert sorted(kinds[1:-1]) == ["branch_point", "fold"]
    places = [one["p"] for one in branch.special_points[1:]]
    np.testing.assert_allclose(places, 3.513830719125161, rtol=1e-9)
    assert branch.stops[1].reason == stop


def test_what_does_not_fit_is_refused() -> None:
    problem = bratu()
    with pytest.raises(pk.ParameterError, match="parameter: got"):
        pk.continuation(problem, ("lam", "lam"), span=(0, 4))
    with pytest.raises(pk.ParameterError, match="x0: got"):
        pk.continuation(problem, "lam", x0=[1.0, 2.0, 3.0], span=(0, 4))
    with pytest.raises(pk.ParameterError, match="what is held 1 more"):
        pk.continuation(problem, "lam", fix="u_max", span=(0, 4))
    with pytest.raises(pk.ConvergenceError, match="no solution was found"):
        pk.continuation(problem.replace(lam=3.9), "lam", span=(0, 4))
    with pytest.raises(pk.ConvergenceError, match="no solution was found from the guess at lam"):
        pk.continuation(PLAIN, ("lam", "c"), span=(0, 4), constraints="mean(u^2) - c*lam")
    fold, end = pk.continuation(problem, "lam", span=(0, 4), stop="fold").special_points[-2:]
    with pytest.raises(pk.ParameterError, match="another one than that of the branch"):
        fold.curve("lam", (0, 4))
    with pytest.raises(pk.ParameterError, match="wants fold"):
        end.curve("lam", (0, 4))
