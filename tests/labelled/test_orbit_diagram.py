"""Orbit diagrams, against orbits known in closed form and iterations by hand."""

from __future__ import annotations

import numpy as np
import pytest

import phasekit as pk

LOGISTIC = pk.Problem("r*x*(1 - x)", "x", {"r": 3.0}, map=True, window={"x": (0.0, 1.0)})


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
        (lambda: pk.orbit_diagram(pk.Problem("-a*x", "x", {"a": 1.0}), "a", [3.0]), "a map, or"),
        (lambda: pk.orbit_diagram(pk.Pendulum(length=1.0), "g", [3.0]), "a map, or a flow"),
    ],
)
def test_what_is_wrong_is_said(call, message):
    with pytest.raises(pk.ParameterError, match=message):
        call()
