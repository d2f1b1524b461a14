"""Curves of cycle bifurcations along which a coefficient is zero everywhere: linear systems, bent.

A linear system in other coordinates has derivatives of all orders, and coefficients of zero.
"""

import numpy as np
import pytest

import phasekit as pk

RADIUS = "(1 - x**2 - y**2)"


def coefficients(curve):
    return [one for one in curve.special_points if one.kind in ("generalized_flip", "chenciner")]


def lines(curve):
    return [message for message in curve.messages if "zero all along" in message]


def swing(bend, force, h="0"):
    """A swing, x'' + d x' + (a - 2 q cos 2t) x = force + h x^3, with y = x' + bend x^2."""
    v = f"(y - {bend}*x**2)"
    return pk.Problem(
        [v, f"-(a - 2*q*cos(2*t))*x - d*{v} + 2*{bend}*x*{v} + {force} + {h}*x**3"], ("x", "y"),
        {"a": 0.5, "q": 1.0, "d": 0.2, "h": 0.0}, time="t", period="pi",
    )  # fmt: skip


def doublings(problem, second, span, at=-1):
    orbit = pk.periodic_orbit(problem, [0.0, 0.0])
    branch = pk.continuation(problem, "a", orbit=orbit, span=(0.0, 3.0))
    return branch.special("PD")[at].curve(second, span)


@pytest.mark.parametrize(
    ("bend", "force"), [("0", "0"), ("0.3", "0"), ("1", "0.1"), ("0.4", "sin(2*t)/5 + 0.1")]
)
def test_doublings_of_linear_systems_are_not_generalized(bend, force):
    curve = doublings(swing(bend, force), "q", (0.6, 1.4))
    assert curve.points.sizes["point"] > 10
    assert coefficients(curve) == []
    (message,) = lines(curve)
    assert "coefficient c" in message
    assert "generalized flip" in message
    assert message in repr(curve)


@pytest.mark.slow
def test_doublings_of_a_function_are_not_generalized():
    def f(x, t, a, q, d):
        v = x[1] - x[0] ** 2 / 3
        return [v, -(a - 2 * q * np.cos(2 * t)) * x[0] - d * v + 2 * x[0] * v / 3]

    problem = pk.Problem(
        f, ("x", "y"), {"a": 0.5, "q": 1.0, "d": 0.2}, time="t", period="pi"
    )  # fmt: skip
    curve = doublings(problem, "q", (0.9, 1.1))
    assert curve.points.sizes["point"] > 3
    assert coefficients(curve) == []
    assert len(lines(curve)) == 1


@pytest.mark.parametrize("bend", ["0.3", "1"])
def test_a_coefficient_that_passes_zero_is_found(bend):
    """Of h x^3 alone c is h times a number, of one sign."""
    curve = doublings(swing(bend, "0", "h"), "h", (-0.3, 0.5))
    (found,) = coefficients(curve)
    assert (found.kind, found.status) == ("generalized_flip", "converged")
    assert found["h"] == pytest.approx(0.0, abs=1e-8)
    assert lines(curve) == []


def torus(bend, cubic):
    """(u, v)' = ((mu - k x), w + y/3) turned, with U = u + bend v^2/2, across a cycle."""
    u = f"(U - {bend}*V**2/2)"
    du = f"((mu - k*x)*{u} - (w + y/3)*V + {cubic}*{u}*({u}**2 + V**2))"
    dv = f"((mu - k*x)*V + (w + y/3)*{u} + {cubic}*V*({u}**2 + V**2))"
    problem = pk.Problem(
        [f"x*{RADIUS} - y", f"y*{RADIUS} + x", f"{du} + {bend}*V*{dv}", dv], ("x", "y", "U", "V"),
        {"mu": -0.1, "w": 0.21, "k": 0.3, "h": 0.2},
    )  # fmt: skip
    orbit = pk.periodic_orbit(problem, [1.0, 0.0, 0.0, 0.0])
    (point,) = pk.continuation(problem, "mu", orbit=orbit, span=(-0.2, 0.2)).special("TR")
    return point


@pytest.mark.parametrize("bend", ["0", "0.7"])
def test_tori_of_linear_systems_have_no_chenciner_points(bend):
    curve = torus(bend, "0").curve("k", (0.1, 0.45))
    assert curve.points.sizes["point"] > 10
    assert coefficients(curve) == []
    (message,) = lines(curve)
    assert "coefficient d" in message
    assert "chenciner" in message


def test_tori_turn_hard_where_d_passes_zero():
    curve = torus("0.7", "h").curve("h", (-0.3, 0.4))
    (found,) = coefficients(curve)
    assert (found.kind, found.status) == ("chenciner", "converged")
    assert found["h"] == pytest.approx(0.0, abs=1e-8)
    assert lines(curve) == []
