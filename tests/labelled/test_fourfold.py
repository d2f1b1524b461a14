"""Folds of orbits of four times the period from resonances 1:4, against exact half-lines."""

import cmath
import math

import numpy as np
import pytest
from scipy.optimize import fsolve

import phasekit as pk


def half_lines(A):
    """Of folds of w' = eps w + A w |w|^2 + w*^3: eps = -t (A + z), |z| = 1, Re z* (A + z) = 0."""
    turn, apart = cmath.phase(A), math.acos(-1.0 / abs(A))
    lines = [-(A + cmath.exp(1j * (turn + side * apart))) for side in (1, -1)]
    return [line / abs(line) for line in lines]


def compare(curves, A, reach):
    """Each curve of folds lies on a half-line of its own, from the resonance on."""
    assert len(curves) == 2
    seen = set()
    for curve in curves:
        eps = curve.points.e1.values + 1j * curve.points.e2.values
        lines = half_lines(A)
        along = [eps * line.conjugate() for line in lines]
        which = int(np.argmin([abs(one.imag).max() for one in along]))
        seen.add(which)
        np.testing.assert_allclose(along[which].imag, 0.0, atol=1e-12)
        assert along[which].real.min() > 0.0
        assert along[which].real.min() < 1e-4
        assert along[which].real.max() > reach
        assert sorted(stop.reason for stop in curve.stops) == ["bound", "resonance_4"]
    assert seen == {0, 1}


def cycle_at_resonance(A):
    """Of z = exp(i t/4) w, about the forced motion x = s cos t."""
    z = "(x - s*cos(t))"
    square = f"({z}^2 + y^2)"
    re, im = f"({z}^3 - 3*{z}*y^2)", f"(y^3 - 3*{z}^2*y)"
    law = [
        f"-y/4 + e1*{z} - e2*y + (a*{z} - b*y)*{square} + cos(t)*{re} - sin(t)*{im} - s*sin(t)",
        f"{z}/4 + e1*y + e2*{z} + (a*y + b*{z})*{square} + cos(t)*{im} + sin(t)*{re}",
    ]
    values = {"e1": -0.05, "e2": 0.02, "a": A.real, "b": A.imag, "s": 0.3}
    problem = pk.Problem(law, ("x", "y"), values, time="t", period=2 * np.pi)
    orbit = pk.periodic_orbit(problem, [0.3, 0.0])
    family = pk.continuation(problem, "e1", orbit=orbit, span=(-0.1, 0.1))
    (point,) = family.special("TR")[0].curve("e2", (-0.05, 0.05)).special("R4")
    return point


@pytest.mark.slow
def test_fourfold_cycles_fold_on_half_lines():
    A = -1.2 + 0.1j
    point = cycle_at_resonance(A)
    curves = [point.switch(direction=k) for k in (0, 1)]
    compare(curves, A, 0.02)
    for curve in curves:
        assert curve.kind == "fold_of_cycles"
        np.testing.assert_allclose(curve.points.period, 8.0 * np.pi, rtol=1e-12)
    with pytest.raises(pk.ParameterError, match="direction: got 2, wants 0 or 1"):
        point.switch(direction=2)
    with pytest.raises(pk.ParameterError, match="kind: got 'torus', wants 'fold_of_cycles'"):
        point.switch("torus")


def test_fourfold_cycles_all_around_do_not_fold():
    point = cycle_at_resonance(0.3 - 0.6j)
    with pytest.raises(pk.ParameterError, match=r"saddles, surround it .*\|a \+ i b\| = 0.6708"):
        point.switch()


def map_at_resonance(A):
    """W -> i (w + eps w + A w |w|^2 + w*^3) with w = z + i y, x = z + y^2/3."""
    z = "(x - y^2/3)"
    square = f"({z}^2 + y^2)"
    re = f"({z} + e1*{z} - e2*y + (a*{z} - b*y)*{square} + {z}^3 - 3*{z}*y^2)"
    im = f"(y + e1*y + e2*{z} + (a*y + b*{z})*{square} - 3*{z}^2*y + y^3)"
    values = {"e1": -0.2, "e2": 0.1, "a": A.real, "b": A.imag}
    problem = pk.Problem([f"-{im} + {re}^2/3", re], ("x", "y"), values, map=True)
    rest = pk.continuation(problem, "e1", x0=[0.0, 0.0], span=(-0.5, 0.3))
    (point,) = rest.special("TR")[0].curve("e2", (-0.2, 0.2)).special("R4")
    return point


@pytest.mark.slow
@pytest.mark.parametrize("A", [0.3 - 1.6j, 1.05 + 0j])
def test_orbits_of_period_four_fold_on_half_lines(A):
    point = map_at_resonance(A)
    curves = [point.switch(direction=k) for k in (0, 1)]
    compare(curves, A, 0.05)
    for curve in curves:
        assert curve.kind == "fold"
        assert curve.problem == point.branch.problem.iterated(4)
    with pytest.raises(pk.ParameterError, match="kind: got 'torus', wants 'fold'"):
        point.switch("torus")


@pytest.mark.slow
def test_orbits_of_period_four_all_around_do_not_fold():
    point = map_at_resonance(0.3 - 0.5j)
    assert math.hypot(*point.normal_form.values()) == pytest.approx(0.34**0.5, rel=1e-9)
    with pytest.raises(pk.ParameterError, match=r"do not fold: \|a \+ i b\| = 0.5831"):
        point.switch()


def test_folds_of_period_four_solve_their_equations():
    """Of (x, y) -> (y, t y - d x + x^2/3 + x^2 y/7), by Newton's method on four steps of it."""

    def four(x, d, t):
        M = np.eye(2)
        for _ in range(4):
            slopes = [[0.0, 1.0], [-d + 2 * x[0] / 3 + 2 * x[0] * x[1] / 7, t + x[0] ** 2 / 7]]
            M = np.array(slopes) @ M
            x = np.array([x[1], t * x[1] - d * x[0] + x[0] ** 2 / 3 + x[0] ** 2 * x[1] / 7])
        return x, M

    text = ["y", "t*y - d*x + x**2/3 + x**2*y/7"]
    problem = pk.Problem(text, ["x", "y"], {"d": 0.5, "t": 0.2}, map=True)
    rest = pk.continuation(problem, "d", x0=[0.0, 0.0], span=(0.5, 1.4))
    (point,) = rest.special("TR")[0].curve("t", (-0.3, 0.3)).special("R4")
    near = pk.ContinuationOptions(bounds={"d": (0.9, 1.2)})
    for direction in (0, 1):
        points = point.switch(direction=direction, options=near).points
        for i in np.flatnonzero(abs(points.t.values) > 0.01)[::4]:
            x, y, d, t = (float(points[name][i]) for name in ("x", "y", "d", "t"))

            def missed(z, t=t):
                end, M = four(z[:2], z[2], t)
                return [*(end - z[:2]), np.linalg.det(M - np.eye(2))]

            found = fsolve(missed, [1.001 * x, 1.001 * y, d + 1e-5], xtol=1e-13)
            np.testing.assert_allclose(found, [x, y, d], rtol=1e-10)
        assert np.ptp(points.t.values) > 0.01
