"""Curves of branch points of periodic orbits, where they are known exactly."""

import numpy as np
import pytest

import phasekit as pk

FEW = pk.ContinuationOptions(max_points=2, directions="forward")
RADIUS, TURN = "(1 - x**2 - y**2 + e*{z})", "(w + k*{z})"


def on_a_circle(z, rate, **values):
    """A cycle whose radius and speed follow z, of which u is a function, with a rate of its own."""
    x = f"(x*{RADIUS} - y*{TURN})".format(z=z)
    y = f"y*{RADIUS} + x*{TURN}".format(z=z)
    values = {"e": 0.7, "w": 2.0, "k": 0.4, "g": 0.5, **values}
    return pk.Problem([x, y, rate.format(z=z, x=x)], ("x", "y", "u"), values)


def crossing(problem, parameter, x0, span):
    orbit = pk.periodic_orbit(problem, x0)
    (point,) = pk.continuation(problem, parameter, orbit=orbit, span=span).special("BPC")
    return point


def ends(curve, name):
    assert [stop.reason for stop in curve.stops] == ["bound", "bound"]
    return sorted(curve.points[name].values[[0, -1]])


@pytest.mark.slow
def test_branch_points_that_a_symmetry_keeps_form_curves_in_two_parameters(tmp_path):
    """On u = 0 the mean growth of u is m - h^2: that of (m - h^2)(1 + g x) over x = cos."""
    rate = "{z}*(m - h^2)*(1 + g*x) - {z}^3*(1 + x^2/2) + h*{z}^2*x"
    problem = on_a_circle("u", rate, m=-0.3, h=0.2)
    point = crossing(problem, "m", [1.0, 0.0, 0.0], (-0.3, 0.4))
    curve = point.curve("h", (-0.3, 0.5))
    assert curve.kind == "cycle_branch_point"
    assert curve.free == ("m", "h")
    assert ends(curve, "h") == pytest.approx([-0.3, 0.5], abs=1e-12)
    np.testing.assert_allclose(curve.points.m, curve.points.h**2, atol=1e-12)
    np.testing.assert_allclose(curve.points.u_max, 0.0, atol=1e-12)
    assert (curve.points.n_unstable == 0).all()
    curve.save(tmp_path / "curve.nc")
    loaded = pk.CycleBranch.load(tmp_path / "curve.nc")
    assert loaded == curve
    assert float(loaded.extend(bounds={"h": (-0.3, 0.6)}).points.h.max()) == 0.6


@pytest.mark.slow
def test_others_form_curves_in_three_parameters(tmp_path):
    """Of a + m z - z^3 + c m, z = u - x/3, families cross at z = -c, m = 3 c^2, a = -c^3."""
    rate = "(a + m*{z} - {z}^3 + c*m)*(1 + g*x) + {x}/3"
    problem = on_a_circle("(u - x/3)", rate, m=0.4, a=-0.125, c=0.5)
    radius = np.sqrt(1 - 0.7 / 2)
    point = crossing(problem, "m", [radius, 0.0, radius / 3 - 0.5], (-0.2, 1.5))
    assert point["m"] == pytest.approx(0.75, abs=1e-9)
    curve = point.curve(["a", "c"], [(-1.0, 1.0), (-0.2, 0.6)])
    assert curve.free == ("m", "a", "c")
    assert ends(curve, "c") == pytest.approx([-0.2, 0.6], abs=1e-12)
    m, a, c = (curve.points[name].values for name in ("m", "a", "c"))
    np.testing.assert_allclose(m, 3 * c**2, atol=1e-12)
    np.testing.assert_allclose(a, -(c**3), atol=1e-12)
    np.testing.assert_allclose(curve.points.x_max, np.sqrt(1 - 0.7 * c), rtol=1e-8)
    np.testing.assert_allclose(curve.points.period, 2 * np.pi / (2 - 0.4 * c), rtol=1e-12)
    curve.save(tmp_path / "curve.nc")
    assert pk.CycleBranch.load(tmp_path / "curve.nc") == curve
    with pytest.raises(pk.ConvergenceError, match=r"destroys .*curve\(\[second, third\]"):
        point.curve("a", (-1.0, 1.0))
    for given, span, says in (
        (["a", "m"], [(-1, 1), (0, 1)], "another one than that of the branch"),
        (["a", "c", "e"], [(-1, 1)] * 3, "one name, or of a branch point two"),
        (["a", "c"], (-1, 1), "span: "),
    ):
        with pytest.raises(pk.ParameterError, match=says):
            point.curve(given, span)


def forced(x, t, w, a, c):
    z = x[0] - 0.3 * np.cos(w * t)
    return [a + (w - 1) * z - z**3 + c * (w - 1) - 0.3 * w * np.sin(w * t)]


@pytest.mark.slow
@pytest.mark.parametrize("plain", [False, True])
def test_those_of_forced_systems_know_how_the_period_goes(plain):
    """The same with m = w - 1 and z = u - 0.3 cos(w t), followed in the frequency itself."""
    z = "(u - 0.3*cos(w*t))"
    rate = f"a + (w - 1)*{z} - {z}^3 + c*(w - 1) - 0.3*w*sin(w*t)"
    problem = pk.Problem(
        forced if plain else [rate], "u", {"w": 1.5, "a": -0.125, "c": 0.5},
        time="t", period="2*pi/w",
    )  # fmt: skip
    orbit = pk.periodic_orbit(problem, [-0.2])
    branch = pk.continuation(problem, "w", orbit=orbit, span=(1.4, 2.0))
    (point,) = branch.special("BPC")
    more = ["a", "c"], [(-1.0, 1.0), (-0.3, 0.6)]
    if plain:
        with pytest.warns(RuntimeWarning, match="max_points"):
            curve = point.curve(*more, options=FEW)
    else:
        curve = point.curve(*more)
        assert ends(curve, "c") == pytest.approx([-0.3, 0.6], abs=1e-12)
    w, a, c = (curve.points[name].values for name in ("w", "a", "c"))
    assert np.ptp(c) > 1e-4
    np.testing.assert_allclose(w - 1, 3 * c**2, atol=1e-10)
    np.testing.assert_allclose(a, -(c**3), atol=1e-10)
