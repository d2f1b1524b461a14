"""Derivatives of special points against differences of solutions in 50 digits."""

from __future__ import annotations

import mpmath as mp
import numpy as np
import pytest
import sympy as sp
from published import compare, reference
from published.systems import SYSTEMS
from witnesses.variants import some

import phasekit as pk

AB = pk.Problem(
    ["-x + p1*(1 - x)*exp(y)", "-y + p1*p2*(1 - x)*exp(y) - p3*y"],
    ("x", "y"), {"p1": 0.0, "p2": 14.0, "p3": 2.0},
)  # fmt: skip
CO = pk.Problem(
    [
        "2*q1*(1 - x - y - s)^2 - 2*q5*x^2 - q3*x*y",
        "q2*(1 - x - y - s) - q6*y - q3*x*y",
        "q4*(1 - x - y - s) - k*q4*s",
    ],
    ("x", "y", "s"),
    {"q1": 2.5, "q2": 1.0, "q3": 10.0, "q4": 0.0675, "q5": 1.0, "q6": 0.1, "k": 0.4},
)


def moved(f, states, values, kind, u, free, name):
    """Differences of (x, free parameter, frequency) by a parameter, solved for in 50 digits."""
    symbols = {one: sp.Symbol(one) for one in (*states, *values)}
    x = [symbols[one] for one in states]
    rates = sp.Matrix(
        [sp.sympify(one.replace("^", "**"), locals=symbols, rational=True) for one in f]
    )
    J = rates.jacobian(x)
    given = [symbols[one] for one in values if one != free]
    both = sp.lambdify([*x, symbols[free], *given], [list(rates), J], "mpmath")

    def solution(value):
        par = [mp.mpf(values[one]) if one != name else value for one in values if one != free]

        def system(*u):
            rate, matrix = both(*u, *par)
            c = reference.coefficients(mp.matrix(matrix))
            return [*rate, c[-1] if kind == "fold" else reference.hurwitz(c)]

        root = mp.findroot(system, [mp.mpf(one) for one in u], tol=1e-80)
        found = list(root)
        if kind == "hopf":
            lam = mp.eig(mp.matrix(both(*found, *par)[1]), left=False, right=False)
            found.append(max((mp.im(one) for one in lam), key=abs))
            found[-1] = abs(found[-1])
        return found

    with mp.workdps(50):
        at, h = mp.mpf(values[name]), mp.mpf(10) ** -15
        pair = zip(solution(at + h), solution(at - h), strict=True)
        return np.array([float((a - b) / (2 * h)) for a, b in pair])


def compared(problem, f, point):
    """Largest difference of the derivatives of a point from those in 50 digits."""
    found, worst = point.sensitivity, 0.0
    free = point.branch.parameter
    for name in found.parameter.values:
        assert found.reason.sel(parameter=name).item() == ""
        wanted = moved(
            f,
            problem.state,
            dict(point.parameters),
            point.kind,
            [*point.x, point[free]],
            free,
            name,
        )
        got = found.sel(parameter=name)
        have = [*got.d_state.values, got.d_free.item()]
        if point.kind == "hopf":
            have.append(got.d_coefficient.sel(coefficient="omega").item())
        worst = max(worst, float(np.max(np.abs(have - wanted) / np.maximum(1.0, np.abs(wanted)))))
    return worst


NAMES = ("FitzHugh-Nagumo", "Lorenz-84", "Bazykin", "Selkov", "Roessler")


@pytest.mark.parametrize("name", some([*NAMES, "Morris-Lecar"], 2))
def test_published_points(name):
    system = SYSTEMS[name]
    branch = compare.follow(system)
    points = [*branch.special("fold"), *branch.special("hopf")]
    assert points
    assert max(compared(branch.problem, system.equations, one) for one in points) < 1e-8


@pytest.mark.parametrize(
    ("problem", "free", "x0", "span"),
    [(AB, "p1", [0.0, 0.0], (0.0, 0.4)), (CO, "q2", [0.001, 0.001, 0.7], (0.5, 2.0))],
)
def test_published_problems(problem, free, x0, span):
    branch = pk.continuation(problem, free, x0=x0, span=span)
    points = [*branch.special("fold"), *branch.special("hopf")]
    assert points
    f = [str(one) for one in problem.f]
    assert max(compared(problem, f, one) for one in points) < 1e-8


def test_cusp_and_its_folds_in_closed_form():
    """Folds of mu + l x - x^3 at mu = -2 x^3, l = 3 x^2; a = -3 x, b = 1."""
    cusp = pk.Problem("mu + l*x - x**3", state="x", parameters={"mu": -1.0, "l": 0.75})
    for fold in pk.continuation(cusp, "mu", x0=[-1.3], span=(-1, 1)).special("LP"):
        found, x = fold.sensitivity.sel(parameter="l"), fold["x"]
        np.testing.assert_allclose(found.d_free, [-x], rtol=1e-12)
        np.testing.assert_allclose(found.d_state, [1.0 / (6.0 * x)], rtol=1e-12)
        np.testing.assert_allclose(found.d_coefficient, [-0.5 / x, 0.0], atol=1e-10)


def test_tables_of_points_share_no_numbers():
    cusp = pk.Problem("mu + l*x - x**3", state="x", parameters={"mu": -1.0, "l": 0.75})
    one, other = pk.continuation(cusp, "mu", x0=[-1.3], span=(-1, 1)).special("LP")
    for name, values in one.sensitivity.items():
        before = other.sensitivity[name].values.tolist()
        values[:] = "lost" if values.dtype == object else np.nan
        assert other.sensitivity[name].values.tolist() == before
    with pytest.raises(ValueError, match="read-only"):
        one.sensitivity.state_units.values[:] = "m"


def test_bogdanov_takens_in_closed_form():
    """Folds of x' = y, y' = b1 + b2 x + x^2 - x y at b1 = b2^2/4; Hopf points at b1 = 0, x = 0."""
    problem = pk.Problem(["y", "b1 + b2*x + x**2 - x*y"], ("x", "y"), {"b1": -1.0, "b2": -0.8})
    branch = pk.continuation(problem, "b1", x0=[-0.67, 0.0], span=(-1, 1))
    (fold,), (hopf,) = branch.special("LP"), branch.special("H")
    found = fold.sensitivity.sel(parameter="b2")
    np.testing.assert_allclose(found.d_free, [-0.4], rtol=1e-12)
    np.testing.assert_allclose(found.d_state, [-0.5, 0.0], atol=1e-13)
    found = hopf.sensitivity.sel(parameter="b2")
    np.testing.assert_allclose([*found.d_free, *found.d_state], 0.0, atol=1e-13)
    omega = found.d_coefficient.sel(coefficient="omega")
    np.testing.assert_allclose(omega, -0.5 / np.sqrt(0.8), rtol=1e-10)


def test_branch_point_lost_and_kept():
    problem = pk.Problem("l*x - x**3 + c*(x - l) + e", "x", {"l": -1.0, "c": 0.0, "e": 0.0})
    (point,) = pk.continuation(problem, "l", x0=[0.0], span=(-1, 1)).special("BP")
    found = point.sensitivity
    assert "destroys" in found.reason.sel(parameter="e").item()
    assert np.isnan(found.d_free.sel(parameter="e"))
    even = pk.Problem("(l + c)*x - x**3", "x", {"l": -1.0, "c": 0.0})
    (point,) = pk.continuation(even, "l", x0=[0.0], span=(-1, 1)).special("BP")
    found = point.sensitivity
    assert found.d_free.item() == pytest.approx(-1.0, abs=1e-12)
    assert found.reason.item() == ""
    assert all("not computed" in one for one in found.coefficient_reason.values.ravel())


def test_points_of_codimension_two():
    """Cusp of l + m x + s x^2 - x^3 moved by s: x = s/3, m = -s^2/3, l = s^3/27."""
    problem = pk.Problem("l + m*x + s*x**2 - x**3", "x", {"l": -1.0, "m": 1.0, "s": 0.3})
    fold = pk.continuation(problem, "l", x0=[-1.0], span=(-2, 2)).special("LP")[0]
    (point,) = fold.curve("m", (-1.0, 2.0)).special("CP")
    found = point.sensitivity.sel(parameter="s")
    np.testing.assert_allclose(found.d_state, [1.0 / 3.0], rtol=1e-9)
    np.testing.assert_allclose(found.d_free, [0.01, -0.2], rtol=1e-9)


def test_unknown_points_say_why():
    cusp = pk.Problem("mu + l*x - x**3", state="x", parameters={"mu": -1.0, "l": 0.75})
    branch = pk.continuation(cusp, "mu", x0=[-1.3], span=(-1, 1))
    found = branch.special("EP")[0].sensitivity
    assert "no equation" in found.reason.item()
    assert np.isnan(found.d_state).all()


def test_period_doubling_of_a_map():
    """The map r x (1 - x) + s doubles where r (1 - 2 x) = -1."""
    logistic = pk.Problem("r*x*(1 - x) + s", "x", {"r": 2.0, "s": 0.0}, map=True)
    (point,) = pk.continuation(logistic, "r", x0=[0.5], span=(1.5, 3.5)).special("PD")
    found = point.sensitivity.sel(parameter="s")
    # F = r x (1 - x) + s - x, G = r (1 - 2 x) + 1 at r = 3, x = 2/3.
    J = np.array([[-2.0, 2.0 / 9.0], [-6.0, -1.0 / 3.0]])
    wanted = -np.linalg.solve(J, [1.0, 0.0])
    np.testing.assert_allclose([*found.d_state, *found.d_free], wanted, rtol=1e-12)


#: r' = mu r + b r^3 - r^5, theta' = w + c r^2: cycles fold at mu = -b^2/4, r^2 = b/2.
QUINTIC = pk.Problem(
    [
        "(mu + b*(x*x + y*y) - (x*x + y*y)**2)*x - (w + c*(x*x + y*y))*y",
        "(mu + b*(x*x + y*y) - (x*x + y*y)**2)*y + (w + c*(x*x + y*y))*x",
    ],
    ("x", "y"), {"mu": -0.5, "b": 1.0, "w": 2.0, "c": 0.3},
)  # fmt: skip


def test_fold_of_cycles_in_closed_form():
    rest = pk.continuation(QUINTIC, "mu", x0=[0.0, 0.0], span=(-0.5, 0.3))
    (fold,) = rest.special("H")[0].switch().special("LPC")
    found = fold.sensitivity
    assert list(found.parameter.values) == ["b", "w", "c"]
    assert all(one == "" for one in found.reason.values)
    np.testing.assert_allclose(found.d_free[0], [-0.5, 0.0, 0.0], atol=1e-9)
    period = 2.0 * np.pi / 2.15
    slope = -(period**2) / (2.0 * np.pi) * np.array([0.15, 1.0, 0.5])
    np.testing.assert_allclose(found.d_period, slope, rtol=1e-8)
    rise = found.d_number.sel(number="x_max")
    np.testing.assert_allclose(rise, [0.25 / np.sqrt(0.5), 0.0, 0.0], atol=1e-8)


def test_events_of_cycles_in_closed_form():
    """Where the period is that of r^2 = 0.7: mu = r^4 - b r^2, w + c r^2 fixed."""
    flow = QUINTIC.replace(mu=0.2)
    start = pk.periodic_orbit(flow, [1.08, 0.0], settle=30.0)
    target = 2.0 * np.pi / (2.0 + 0.3 * 0.7)
    family = pk.continuation(
        flow, "mu", orbit=start, span=(-0.5, 0.6), events={"long": f"period - {target!r}"}
    )
    found = family.special("long")[0].sensitivity
    # d r^2 = -(dw + r^2 dc)/c, mu = r^4 - b r^2.
    square = np.array([0.0, -1.0, -0.7]) / 0.3
    wanted = (2.0 * 0.7 - 1.0) * square - np.array([0.7, 0.0, 0.0])
    np.testing.assert_allclose(found.d_free[0], wanted, rtol=1e-7, atol=1e-7)
    np.testing.assert_allclose(found.d_period, 0.0, atol=1e-8)


def doubling(**changes):
    """The first period doubling of Roessler's cycles."""
    flow = pk.Problem(
        ["-y - z", "x + a*y", "b + z*(x - c)"], ("x", "y", "z"),
        {"a": 0.2, "b": 0.2, "c": 2.5, **changes},
    )  # fmt: skip
    orbit = pk.periodic_orbit(flow, [2.0, 2.0, 0.03], settle=100.0)
    return pk.continuation(flow, "c", orbit=orbit, span=(2.4, 3.2)).special("PD")[0]


@pytest.mark.slow
@pytest.mark.parametrize("name", ["a", "b"])
def test_doubling_of_roessler_moves_as_its_solutions_do(name):
    point, h = doubling(), 1e-4
    up, down = (doubling(**{name: 0.2 + s * h}) for s in (1.0, -1.0))
    found = point.sensitivity.sel(parameter=name)
    for number, column in (("c", found.d_free.item()), ("period", found.d_period.item())):
        assert column == pytest.approx((up[number] - down[number]) / (2.0 * h), rel=2e-6)


def test_torus_point_of_a_map():
    """The delayed map r x (1 - y) + s z at its fixed point: det J = 1, tr J = 1 at s = 0."""
    problem = pk.Problem(["r*x*(1 - y) + s", "x"], ("x", "y"), {"r": 1.8, "s": 0.0}, map=True)
    branch = pk.continuation(problem, "r", x0=[0.44, 0.44], span=(1.5, 2.3))
    (point,) = branch.special("torus")
    found = point.sensitivity.sel(parameter="s")
    # F = r x (1 - x) + s - x, G = det J - 1 = r x - 1 at r = 2, x = 1/2.
    J = np.array([[-1.0, 0.25], [2.0, 0.5]])
    wanted = -np.linalg.solve(J, [1.0, 0.0])
    np.testing.assert_allclose([*found.d_state, *found.d_free], wanted[[0, 0, 1]], rtol=1e-11)


def test_merging_equilibria_of_a_trigonometric_law():
    """V' = B sin x - A sin x cos x - C cos x: |B|^(2/3) + |C|^(2/3) = |A|^(2/3) where it folds."""
    problem = pk.Problem(
        "-(B*sin(x) - A*sin(x)*cos(x) - C*cos(x))", "x", {"A": 1.0, "B": 0.1, "C": 0.2}
    )
    exact = pk.critical(pk.Coefficients(A=1.0, B=0.1, C=0.2), "B", (0.05, 2.0))
    (merger,) = exact.critical_fold.values[np.isfinite(exact.critical_fold.values)]
    assert merger == pytest.approx((1.0 - 0.2 ** (2 / 3)) ** 1.5, rel=1e-12)
    phi = float(exact.critical_fold_phi.values[0])
    for start in (phi + 0.3, phi - 0.3):
        branch = pk.continuation(problem.replace(B=merger - 0.05), "B", x0=[start], span=(0.05, 2))
        points = [one for one in branch.special("LP") if abs(one["B"] - merger) < 1e-9]
        if points:
            break
    found = points[0].sensitivity
    for name in ("A", "C"):
        h = 1e-4
        values = {"A": 1.0, "C": 0.2}
        ends = [
            pk.critical(pk.Coefficients(B=0.1, **{**values, name: values[name] + s * h}),
            "B", (0.05, 2.0)).critical_fold.values[0] for s in (-2, -1, 1, 2)
        ]  # fmt: skip
        wanted = (ends[0] - 8 * ends[1] + 8 * ends[2] - ends[3]) / (12 * h)
        assert found.d_free.sel(parameter=name).item() == pytest.approx(wanted, rel=1e-9)
    b, c = merger ** (1 / 3), 0.2 ** (1 / 3)
    assert found.d_free.sel(parameter="C").item() == pytest.approx(-b / c, rel=1e-12)
    assert found.d_free.sel(parameter="A").item() == pytest.approx(b, rel=1e-12)


@pytest.mark.parametrize("more", [{}, {"z": "-z + x*y"}])
def test_coefficients_of_a_hopf_point_in_closed_form(more):
    """The normal form itself: l1 = -2 s/w, omega = w, d = 1 at p = c."""
    growth = "(p - c - s*(x^2 + y^2))"
    f = {"x": f"{growth}*x - w*y", "y": f"{growth}*y + w*x", **more}
    problem = pk.Problem(f, parameters={"p": 0.0, "c": 0.4, "s": 0.7, "w": 1.3})
    (point,) = pk.continuation(problem, "p", x0=np.zeros(len(f)), span=(0.0, 1.0)).special("H")
    s, w = 0.7, 1.3
    assert point.normal_form["l1"] == pytest.approx(-2.0 * s / w, rel=1e-12)
    wanted = {"l1": [0.0, -2.0 / w, 2.0 * s / w**2], "omega": [0.0, 0.0, 1.0], "d": [0.0] * 3}
    found = point.sensitivity.d_coefficient
    for name, slopes in wanted.items():
        np.testing.assert_allclose(found.sel(coefficient=name), slopes, rtol=0.0, atol=1e-9)
