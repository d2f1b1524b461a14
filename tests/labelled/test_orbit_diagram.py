"""Orbit diagrams, against orbits known in closed form and iterations by hand."""

from __future__ import annotations

import numpy as np
import pytest

import phasekit as pk
from phasekit.cells.equations import table_of

LOGISTIC = pk.Problem("r*x*(1 - x)", "x", {"r": 3.0}, map=True, window={"x": (0.0, 1.0)})


@pytest.mark.slow
def test_the_logistic_map_doubles_where_it_should():
    """Period 1 below 3, 2 below 1 + sqrt 6, 4 below 3.5440903596, 3 from 1 + 2 sqrt 2 on."""
    r = np.array([2.9, 3.2, 3.44, 3.46, 3.5440, 3.5442, 1.0 + 2.0 * np.sqrt(2.0) + 0.003])
    ds = pk.orbit_diagram(LOGISTIC, "r", r, n=96, skip=400_000)
    counts = [len(np.unique(row.round(6))) for row in ds.sample_x.values]
    assert counts == [1, 2, 2, 4, 4, 8, 3]
    np.testing.assert_allclose(ds.sample_x[0], 1.0 - 1.0 / 2.9, rtol=1e-12)
    root = np.sqrt((3.2 + 1.0) * (3.2 - 3.0))
    pair = [(3.2 + 1.0 - root) / 6.4, (3.2 + 1.0 + root) / 6.4]
    np.testing.assert_allclose(np.unique(ds.sample_x[1].values.round(12)), pair, rtol=1e-11)
    assert ds.sample.values[0] == 400_000
    assert ds.isel(r=1).phasekit.system() == LOGISTIC.replace(r=3.2)


def test_each_value_begins_where_the_last_ended_or_at_the_start():
    cubic = pk.Problem("x + 0.1*(mu + x - x^3)", "x", {"mu": 0.0}, map=True)
    mu = np.concatenate([np.linspace(-0.6, 0.6, 25), np.linspace(0.6, -0.6, 25)])
    ds = pk.orbit_diagram(cubic, "mu", mu, -1.0, n=2, skip=2_000)
    fold = 2.0 / (3.0 * np.sqrt(3.0))
    x = ds.sample_x.values[:, -1]
    up, down = x[:25], x[25:][::-1]
    inside = np.abs(mu[:25]) < fold
    assert (up[inside] < 0.0).all()  # the lower branch up to its fold
    assert (down[inside] > 0.0).all()
    np.testing.assert_allclose(mu + x - x**3, 0.0, atol=1e-9)
    alone = pk.orbit_diagram(cubic, "mu", mu, -1.0, n=2, skip=2_000, from_last=False)
    assert (alone.sample_x.values[:25][inside] < 0.0).all()
    np.testing.assert_array_equal(alone.sample_x[:25], alone.sample_x[25:][::-1])


def test_a_forced_flow_is_seen_once_a_period():
    linear = pk.Problem(
        {"x": "v", "v": "-x - d*v + cos(w*t)"}, parameters={"d": 0.5, "w": 1.0}, time="t",
        period="2*pi/w",
    )  # fmt: skip
    w = np.array([0.5, 1.0, 2.0])
    ds = pk.orbit_diagram(linear, "w", w, [0.0, 0.0], n=3, skip=40)
    response = 1.0 / (1.0 - w**2 + 0.5j * w)
    np.testing.assert_allclose(ds.sample_x, np.tile(response.real[:, None], 3), atol=1e-8)
    np.testing.assert_allclose(
        ds.sample_v, np.tile((1j * w * response).real[:, None], 3), atol=1e-8
    )


def test_what_runs_away_is_announced_and_begins_anew():
    with pytest.warns(RuntimeWarning, match="at 1 of 3 values"):
        ds = pk.orbit_diagram(LOGISTIC, "r", [3.2, 5.0, 3.2], n=2)
    assert np.isnan(ds.sample_x[1]).all()
    np.testing.assert_allclose(np.sort(ds.sample_x[2]), np.sort(ds.sample_x[0]), rtol=1e-9)


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: pk.orbit_diagram(LOGISTIC, "q", [1.0]), "'q' is unknown"),
        (lambda: pk.orbit_diagram(LOGISTIC, "r", [np.inf]), "values: .* finite numbers"),
        (lambda: pk.orbit_diagram(LOGISTIC, "r", [3.0], n=0), "n: got 0"),
        (lambda: pk.orbit_diagram(LOGISTIC, "r", [3.0], [0.1, 0.2]), "x0"),
        (lambda: pk.orbit_diagram(pk.Problem("x", "x", map=True), "r", [3.0]), "'r' is unknown"),
        (
            lambda: pk.orbit_diagram(pk.Problem("-a*x", "x", {"a": 1.0}), "a", [3.0]),
            "of: got .section",
        ),
        (lambda: pk.orbit_diagram(pk.Pendulum(length=1.0), "g", [3.0]), "a map, or a flow"),
    ],
)
def test_what_is_wrong_is_said(call, message):
    with pytest.raises(pk.ParameterError, match=message):
        call()


HOPF = pk.Problem(
    {"x": "m*x - 2*y - x*(x^2 + y^2)", "y": "2*x + m*y - y*(x^2 + y^2)"}, parameters={"m": 0.0},
    window={"x": (-2, 2), "y": (-2, 2)},
)  # fmt: skip


@pytest.mark.slow
@pytest.mark.parametrize("from_last", [True, False])
def test_maxima_are_radii_of_circles_and_rests_before(from_last):
    m = np.array([-0.5, -0.1, 0.25, 1.0, 0.25, -0.1])
    ds = pk.orbit_diagram(HOPF, "m", m, [0.3, 0.1], of="maxima", n=3, skip=80, from_last=from_last)
    radius = np.sqrt(np.maximum(m, 0.0))
    for name in ("x", "y"):
        np.testing.assert_allclose(ds[f"sample_{name}"], np.tile(radius[:, None], 3), atol=1e-7)
    assert ds.sample_x.attrs["long_name"] == "maxima of x"


def test_maxima_of_a_formula_are_seen():
    flow = pk.Problem(
        {"x": "m*x - 2*y - x*(x^2 + y^2)", "y": "2*x + m*y - y*(x^2 + y^2)"},
        parameters={"m": 1.0}, window={"x": (-2, 2), "y": (-2, 2)},
        observables={"square": "x^2 + y^2"},
    )  # fmt: skip
    radius = np.array([0.5, 1.0, 1.5])
    ds = pk.orbit_diagram(flow, "m", radius**2, [0.1, 0.0], of="max(x*y/square)", n=4, skip=40)
    np.testing.assert_allclose(ds["sample_max(x*y/square)"], 0.5, rtol=1e-9)
    ds = pk.orbit_diagram(flow, "m", radius**2, [0.1, 0.0], of="min(x*y*m)", n=4, skip=40)
    least = ds["sample_min(x*y*m)"]
    np.testing.assert_allclose(least, np.tile(-0.5 * radius**4, (4, 1)).T, rtol=1e-8)
    np.testing.assert_allclose(ds.sample_x, -ds.sample_y, rtol=1e-7)
    assert least.attrs["long_name"] == "minima of x*y*m"
    assert ds.sample_x.attrs["long_name"] == "x at minima of x*y*m"
    ax = pk.plot.orbit_diagram(ds)
    assert ax.get_ylabel() == "minima of x*y*m"


def turning(x, m):
    r = m - x[0] ** 2 - x[1] ** 2
    return np.array([r * x[0] - 2 * x[1], 2 * x[0] + r * x[1]])


@pytest.mark.slow
@pytest.mark.parametrize("f", [turning, "njit"])
def test_maxima_of_functions_are_seen(f):
    f = pytest.importorskip("numba").njit(turning) if f == "njit" else f
    flow = pk.Problem(f, ("x", "y"), {"m": 1.0}, window={"x": (-2, 2), "y": (-2, 2)})
    ds = pk.orbit_diagram(flow, "m", [0.25], [0.5, 0.0], of="maxima", n=2, skip=1)
    np.testing.assert_allclose(ds.sample_x, [[0.5, 0.5]], atol=1e-9)
    np.testing.assert_allclose(ds.sample_y, [[0.5, 0.5]], atol=1e-9)
    ds = pk.orbit_diagram(flow, "m", [0.25], [0.5, 0.0], of="max(x*y)", n=2, skip=1)
    np.testing.assert_allclose(ds["sample_max(x*y)"], [[0.125, 0.125]], atol=1e-9)


def test_units_of_a_formula_are_not_said_to_be_none():
    spring = pk.Problem({"x": "v", "v": "-k*x"}, parameters={"k": 1.0}).described(
        {"x": {"units": "m"}, "v": {"units": "m s-1"}, "k": {"units": "s-2"}}
    )
    ds = pk.orbit_diagram(spring, "k", [1.0], [1.0, 0.0], of="max(x*v)", n=1, skip=0)
    assert ds["sample_max(x*v)"].attrs["units"] == ""
    assert ds.sample_v.attrs["units"] == "m s-1"
    assert pk.plot.orbit_diagram(ds).get_ylabel() == "maxima of x*v"
    for of, units in (("max(x*v)", ""), ("max(x)", "m"), ("max(k^2)", "")):
        assert table_of(spring, spring.own_equations, of).rows[of].units == units
    assert table_of(HOPF, HOPF.own_equations, "max(x*y)").rows["max(x*y)"].units == "1"


def test_a_section_of_a_flow_is_crossed_upwards():
    m = np.array([0.25, 1.0])
    ds = pk.orbit_diagram(HOPF, "m", m, [0.3, 0.1], of="y = m/4", n=2, skip=60)
    np.testing.assert_allclose(ds.sample_y, np.tile(m[:, None] / 4, 2), atol=1e-12)
    np.testing.assert_allclose(ds.sample_x[:, 0], np.sqrt(m - m**2 / 16), rtol=1e-8)
    assert "y - " in ds.sample_x.attrs["long_name"] or "m/4" in ds.sample_x.attrs["long_name"]
    with pytest.warns(RuntimeWarning, match="at 1 of 2 values motions come to rest beside"):
        ds = pk.orbit_diagram(HOPF, "m", [-0.5, 0.25], [0.3, 0.1], of=("y", 0.1), n=2, skip=10)
    assert np.isnan(ds.sample_x[0]).all()


def test_maxima_of_a_driven_oscillator_are_those_of_its_response():
    linear = pk.Problem(
        {"x": "v", "v": "-x - d*v + cos(w*t)"}, parameters={"d": 0.5, "w": 1.0}, time="t",
        period="2*pi/w",
    )  # fmt: skip
    w = np.array([0.5, 2.0])
    ds = pk.orbit_diagram(linear, "w", w, [0.0, 0.0], of="maxima", n=2, skip=40)
    size = np.abs(1.0 / (1.0 - w**2 + 0.5j * w))
    np.testing.assert_allclose(ds.sample_x, np.tile(size[:, None], 2), rtol=1e-7)
    np.testing.assert_allclose(ds.sample_v, np.tile((w * size)[:, None], 2), rtol=1e-7)


@pytest.mark.slow
def test_an_angle_is_seen_each_turn_and_has_no_maxima():
    turning = pk.Problem({"q": "s + sin(q)/2", "r": "1 - r"}, parameters={"s": 1.0},
                         periods={"q": 2 * np.pi})  # fmt: skip
    with pytest.warns(RuntimeWarning, match="motions were not seen so often"):
        ds = pk.orbit_diagram(turning, "s", [1.0], [0.0, 0.2], of="maxima", n=2, skip=3)
    assert np.isnan(ds.sample_q).all()
    ds = pk.orbit_diagram(turning, "s", [1.0, 2.0], [0.0, 0.2], of=("q", 1.0), n=2, skip=3)
    np.testing.assert_allclose(np.mod(ds.sample_q, 2 * np.pi), 1.0, atol=1e-9)


@pytest.mark.parametrize(
    ("system", "of", "message"),
    [
        (LOGISTIC, "maxima", "of: got 'maxima', wants 'section' for a map"),
        (HOPF, "section", "of: got 'section'.*'maxima', or a section"),
        (HOPF, "z = 0", "of|section"),
        (HOPF, 3.0, "section: got 3.0"),
        (HOPF, "max(x*y)_error", r"of: got 'max\(x\*y\)_error', wants max\(...\) or min"),
        (HOPF, "mean(x*y)", r"of: got 'mean\(x\*y\)', wants max\(...\) or min"),
    ],
)
def test_what_is_kept_has_to_fit_the_system(system, of, message):
    parameter = next(iter(system.parameters))
    with pytest.raises(pk.ParameterError, match=message):
        pk.orbit_diagram(system, parameter, [1.0], of=of)
