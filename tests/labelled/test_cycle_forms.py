"""Special points of cycles and of their curves: as formulas, functions, compiled, with jac=."""

from __future__ import annotations

import re

import numba
import numpy as np
import pytest
import sympy
from witnesses.variants import some

import phasekit as pk
from phasekit.cycles import events

#: Few points, each as sharp as by default.
FEW = pk.ContinuationOptions(degree=7, intervals=8, initial_step=0.2, max_step=0.5)
FORMS = ("formula", "function", "compiled", "jac")


def problem(form, equations, state, parameters, **more):
    """A problem of equations in the form that is asked for."""
    if form == "formula":
        return pk.Problem(equations, state, parameters, **more)
    names = [*parameters, *([more["time"]] if "time" in more else [])]
    lines = [f"def f(_x, {', '.join(names)}):"]
    lines += [f"    {name} = _x[{i}]" for i, name in enumerate(state)]
    lines += [f"    return np.array([{', '.join(equations)}])"]
    space = {"np": np, "sin": np.sin, "cos": np.cos, "sqrt": np.sqrt}
    exec("\n".join(lines), space)
    f = space["f"]
    if form == "compiled":
        return pk.Problem(numba.njit(f), state, parameters, **more)
    if form == "function":
        return pk.Problem(f, state, parameters, **more)
    symbols = {name: sympy.Symbol(name, real=True) for name in [*state, *names]}
    matrix = sympy.Matrix([sympy.sympify(e, locals=symbols) for e in equations])
    slopes = sympy.lambdify(
        list(symbols.values()), matrix.jacobian([symbols[name] for name in state]), "numpy"
    )
    return pk.Problem(f, state, parameters, jac=lambda x, **p: slopes(*x, **p), **more)


def twisted(rate, cos, sin):
    """Formulas of xi' = xi rate(xi^2), eta' = -0.4 eta; (a, b) is (xi, eta) turned by t/2."""
    square = f"(a**2*(1 + {cos})/2 + b**2*(1 - {cos})/2 + a*b*{sin})"
    xx, xy, yy = f"(1 + {cos})/2", f"{sin}/2", f"(1 - {cos})/2"
    grow = f"({rate.replace('SQUARE', square)})"
    return [
        f"{grow}*({xx}*a + {xy}*b) - 0.4*({yy}*a - {xy}*b) - b/2",
        f"{grow}*({xy}*a + {yy}*b) - 0.4*(-{xy}*a + {xx}*b) + a/2",
    ]


def clocked(rate):
    """The same of an autonomous system, in which u and v are cos t and sin t."""
    circle = ["u*(1 - u**2 - v**2) - v", "v*(1 - u**2 - v**2) + u"]
    return [*circle, *twisted(rate, "u", "v")]


def special(branch):
    return [one for one in branch.special_points if one.kind != "end"]


@pytest.mark.parametrize("form", some(FORMS, 2))
def test_generalized_flips(form):
    """Xi' = (mu - p^2/2) xi + (p - 0.3) xi^3 across a cycle."""
    system = problem(
        form, clocked("mu - p**2/2 + (p - 3/10)*SQUARE"), ("u", "v", "a", "b"),
        {"mu": 0.0, "p": 0.2},
    )  # fmt: skip
    orbit = pk.periodic_orbit(system, [1.0, 0.0, 0.0, 0.0], options=FEW)
    branch = pk.continuation(system, "mu", orbit=orbit, span=(0.0, 0.04), options=FEW)
    (point,) = special(branch)
    assert (point.kind, point.status, point.message) == ("period_doubling", "converged", "")
    assert point["mu"] == pytest.approx(0.02, abs=1e-12)
    assert point.normal_form["c"] == pytest.approx(-0.1, rel=1e-9)
    (hard,) = special(point.curve("p", (0.19, 0.31)))
    assert (hard.kind, hard.status) == ("generalized_flip", "converged")
    assert hard["p"] == pytest.approx(0.3, abs=1e-9)
    assert hard["mu"] == pytest.approx(0.045, abs=1e-9)


def test_noise_of_a_state_at_rest_is_no_motion():
    """The simulation leaves 1e-7 of a state that is at rest on the cycle."""
    unit = "sqrt(x**2 + y**2)"
    a, b = twisted("mu - p**2/2 + (p - 3/10)*SQUARE", f"(x/{unit})", f"(y/{unit})")
    a, b = (re.sub(r"\bb\b", "z", re.sub(r"\ba\b", f"({unit} - 1)", e)) for e in (a, b))
    equations = [f"x/{unit}*({a}) - y", f"y/{unit}*({a}) + x", b]
    system = problem("function", equations, ("x", "y", "z"), {"mu": -0.1, "p": 0.1})
    orbit = pk.periodic_orbit(system, [1.0, 0.0, 0.0])
    assert float(orbit.period) == pytest.approx(2 * np.pi, rel=1e-10)
    assert np.min(orbit.multiplier.values.real) < -0.5  # it is the one that doubles


@pytest.mark.parametrize("form", some(FORMS[1:], 2))
def test_coefficients_of_states_far_from_zero(form):
    """By a thousand times what they move by, in an f that is no polynomial."""
    equations = clocked("mu - p**2/2 + (p - 3/10)*sin(SQUARE)")
    equations = [re.sub(r"\b([uvab])\b", r"(\1 - 1000)", e) for e in equations]
    system = problem(form, equations, ("u", "v", "a", "b"), {"mu": 0.0, "p": 0.1})
    orbit = pk.periodic_orbit(system, [1001.0, 1000.0, 1000.0, 1000.0], 2 * np.pi)
    (point,) = special(pk.continuation(system, "mu", orbit=orbit, span=(-0.05, 0.05)))
    assert point["mu"] == pytest.approx(0.005, abs=1e-10)
    assert point.normal_form["c"] == pytest.approx(-0.2, rel=1e-7)


@pytest.mark.parametrize("width", [1e-2, 1e3])
@pytest.mark.parametrize("form", ["formula", "compiled"])
def test_coefficients_of_a_state_at_rest(form, width):
    """It has no size of its own, and f may bend within less, or more, than 1."""
    system = problem(
        form, twisted(f"mu - p**2/2 + (p - 3/10)*sin(SQUARE/{width}**2)", "cos(t)", "sin(t)"),
        ("a", "b"), {"mu": 0.0, "p": 0.1}, time="t", period="2*pi",
    )  # fmt: skip
    orbit = pk.periodic_orbit(system, [0.0, 0.0])
    (point,) = special(pk.continuation(system, "mu", orbit=orbit, span=(-0.05, 0.05)))
    assert point.normal_form["c"] == pytest.approx(-0.2 / width**2, rel=1e-6)
    (hard,) = special(point.curve("p", (0.05, 0.4)))
    assert (hard.kind, hard.status) == ("generalized_flip", "converged")
    assert hard["p"] == pytest.approx(0.3, abs=1e-7)


def test_a_coefficient_that_is_not_known_is_said_to_be():
    """Of an f that is rounded to hundred-thousandths."""
    exact = problem(
        "function", twisted("mu - p**2/2 + (p - 3/10)*SQUARE", "cos(t)", "sin(t)"), ("a", "b"),
        {"mu": 0.0, "p": 0.1}, time="t", period="2*pi",
    )  # fmt: skip

    def f(x, mu, p, t):
        return np.round(exact.field.function(x, mu=mu, p=p, t=t), 5)

    system = pk.Problem(f, ("a", "b"), {"mu": 0.0, "p": 0.1}, time="t", period="2*pi")
    orbit = pk.periodic_orbit(system, [0.0, 0.0])
    branch = pk.continuation(system, "mu", orbit=orbit, span=(-0.05, 0.05))
    (point,) = special(branch)
    assert np.isnan(point.normal_form["c"])
    assert point.message.startswith("c not known: ")


def test_tori_in_other_units():
    """Zeta' = (mu - p^2/2 + i w) zeta + (p - 0.3 + i) zeta |zeta|^2, all states in millionths."""
    grow, turn = "(mu - p**2/2 + (p - 3/10)*(u**2 + v**2))", "(0.21 + u**2 + v**2)"
    radius = "(1 - x**2 - y**2)"
    equations = [f"x*{radius} - y", f"y*{radius} + x", f"{grow}*u - {turn}*v",
                 f"{grow}*v + {turn}*u"]  # fmt: skip
    equations = [re.sub(r"\b([xyuv])\b", r"(1e6*\1)", e) for e in equations]
    system = problem(
        "compiled", [f"1e-6*({e})" for e in equations], ("x", "y", "u", "v"), {"mu": 0.0, "p": 0.2}
    )
    orbit = pk.periodic_orbit(system, [1e-6, 0.0, 0.0, 0.0], options=FEW)
    branch = pk.continuation(system, "mu", orbit=orbit, span=(0.0, 0.04), options=FEW)
    (point,) = special(branch)
    assert point.normal_form["d"] == pytest.approx(-0.2e12, rel=1e-8)
    assert point.normal_form["d_imag"] == pytest.approx(2e12, rel=1e-8)
    (hard,) = special(point.curve("p", (0.2, 0.31)))
    assert (hard.kind, hard.status) == ("chenciner", "converged")
    assert hard["p"] == pytest.approx(0.3, abs=1e-8)
    steep = pk.ContinuationOptions(degree=7, intervals=8, turn=1e-9, max_turn=1e-9)
    stuck = point.curve("p", (0.1, 0.4), options=steep)
    assert [stop.reason for stop in stuck.stops] == ["stuck", "stuck"]
    assert "period = 6.28318531, mu = 0.0" in stuck.stops[0].message


def test_a_compiled_function_of_the_wrong_shape_is_refused():
    f = numba.njit(lambda x, mu: mu * x[0])
    system = pk.Problem(f, ("x", "y"), {"mu": 1.0})
    with pytest.raises(pk.ParameterError, match="index 2 numbers of what it returns"):
        pk.periodic_orbit(system, [1.0, 0.0])


def test_a_generalized_flip_beside_integrals_along_the_variational_equation():
    """X'' + d x' + (a - 2 q cos 2t) x + (k + l cos 2t) x^3 = 0, in which x = 0 doubles.

    Its map over a period is odd, so that c vanishes with the part of its cubic term along the
    critical left vector: k I_1 + l I_2 = 0, from runs of SciPy's DOP853.
    """
    from scipy.integrate import solve_ivp
    from scipy.optimize import brentq

    d, q, l = 0.2, 1.0, 0.5  # noqa: E741

    def run(a, start, more=False):
        def f(t, z):
            spring = a - 2.0 * q * np.cos(2.0 * t)
            rows = [z[1], -spring * z[0] - d * z[1]]
            for k, load in enumerate((1.0, np.cos(2.0 * t)) if more else ()):
                x, v = z[2 + 2 * k], z[3 + 2 * k]
                rows += [v, -spring * x - d * v - load * z[0] ** 3]
            return rows

        z = np.append(start, np.zeros(4 * more))
        return solve_ivp(f, (0.0, np.pi), z, method="DOP853", rtol=1e-13, atol=1e-15).y[:, -1]

    def monodromy(a):
        return np.column_stack([run(a, one) for one in np.eye(2)])

    a = brentq(lambda a: np.linalg.det(monodromy(a) + np.eye(2)), -0.2, 0.0, xtol=1e-14)
    _, _, right = np.linalg.svd(monodromy(a) + np.eye(2))
    left = np.linalg.svd(monodromy(a).T + np.eye(2))[2][-1]
    whole = run(a, right[-1], more=True)
    expected = -l * (left @ whole[4:]) / (left @ whole[2:4])

    system = problem(
        "formula", ["v", "-(a - 2*cos(2*t))*x - 0.2*v - (k + 0.5*cos(2*t))*x**3"], ("x", "v"),
        {"a": 0.0, "k": expected + 0.03}, time="t", period="pi",
    )  # fmt: skip
    orbit = pk.periodic_orbit(system, [0.0, 0.0])
    (point,) = pk.continuation(system, "a", orbit=orbit, span=(-0.2, 0.1)).special("PD")
    assert point["a"] == pytest.approx(a, abs=1e-10)
    (hard,) = special(point.curve("k", (expected - 0.1, expected + 0.1)))
    assert (hard.kind, hard.status) == ("generalized_flip", "converged")
    assert hard["k"] == pytest.approx(expected, abs=1e-8)


def test_normal_forms_are_made_when_they_are_asked_for(monkeypatch):
    """Of r' = r (p + r^2 - r^4), with a fold of cycles at p = -1/4, and once."""
    made, original = [], events.coefficients
    monkeypatch.setattr(events, "coefficients", lambda *args: made.append(1) or original(*args))
    growth = "(p + x^2 + y^2 - (x^2 + y^2)^2)"
    system = problem(
        "formula", [f"x*{growth} - y", f"y*{growth} + x"], ("x", "y"), {"p": -1.0}
    )  # fmt: skip
    family = pk.continuation(system, "p", x0=[0, 0], span=(-1, 0.5)).special("H")[0].switch()
    assert family.points.sizes["point"] > 5
    assert made == []
    for _ in range(2):
        (fold,) = family.special("LPC")
        assert fold["p"] == pytest.approx(-0.25, abs=1e-10)
        assert np.isfinite(list(fold.normal_form.values())).all()
        assert fold.normal_form
    assert made == [1]
