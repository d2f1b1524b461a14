"""Manifolds of saddles and nullclines, against closed forms and SciPy."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import phasekit as pk

BOX = {"x": (-2.0, 2.0), "v": (-2.0, 2.0)}


def strand(ds, k):
    own = ds.isel(manifold=k)
    there = np.isfinite(own.arclength.values)
    return [own[f"manifold_{name}"].values[there] for name in ds.state.values]


@pytest.mark.parametrize("size", [1.0, 1e-7])
def test_the_loops_of_a_double_well_have_its_energy(size):
    """Without damping both manifolds are the figure-eight v^2 = x^2 - x^4/2, in any unit."""
    well = pk.Problem(
        {"x": "v", "v": f"x - x^3/{size**2!r}"},
        window={"x": (-2 * size, 2 * size), "v": (-2 * size, 2 * size)},
    )
    ds = pk.manifolds(well, length=3.0)
    assert ds.sizes["manifold"] == 4
    assert sorted(ds.manifold_stable.values.tolist()) == [False, False, True, True]
    for k in range(4):
        x, v = (one / size for one in strand(ds, k))
        assert len(x) > 100
        np.testing.assert_allclose(v**2, x**2 - x**4 / 2.0, atol=2e-8)
        assert np.ptp(x) > 1.3


def test_a_linear_saddle_has_its_eigenvectors():
    ds = pk.manifolds(pk.Problem({"x": "x + v", "v": "3*x - v"}, window=BOX))
    slopes = {False: 1.0, True: -3.0}
    for k, stable in enumerate(ds.manifold_stable.values.tolist()):
        x, v = strand(ds, k)
        np.testing.assert_allclose(v, slopes[stable] * x, atol=1e-6)
        assert ds.manifold_end.values[k] == "window"


def test_where_they_go_is_where_motions_go():
    damped = pk.Problem({"x": "v", "v": "x - x^3 - d*v"}, parameters={"d": 0.2}, window=BOX)
    ds = pk.manifolds(damped)
    falls = ~ds.manifold_stable.values
    assert set(ds.manifold_to.values[falls].tolist()) == {0, 2}
    assert (ds.manifold_to.values[~falls] == -1).all()
    one = int(np.flatnonzero(falls)[0])
    x, v = strand(ds, one)

    def f(_, y):
        return [y[1], y[0] - y[0] ** 3 - 0.2 * y[1]]

    # A point of it, followed by SciPy, comes past the later ones.
    path = solve_ivp(f, (0.0, 60.0), [x[60], v[60]], method="DOP853", rtol=1e-11, atol=1e-12,
                     max_step=0.01).y  # fmt: skip
    for k in range(80, min(len(x), 400), 40):
        assert np.hypot(path[0] - x[k], path[1] - v[k]).min() < 1e-2
    chosen = pk.manifolds(damped, 1, window=BOX)
    assert (chosen.manifold_from.values == 1).all()


def test_three_states_have_the_lines_alone():
    lorenz = pk.Problem(
        ["10*(y - x)", "x*(28 - z) - y", "x*y - 8*z/3"], ("x", "y", "z"),
        window={"x": (-30, 30), "y": (-30, 30), "z": (-5, 60)},
    )  # fmt: skip
    ds = pk.manifolds(lorenz, 1, length=5.0)
    assert not ds.manifold_stable.values.any()  # the stable one is a surface
    assert ds.sizes["manifold"] == 2
    one, two = (np.array(strand(ds, k)) for k in (0, 1))
    # The symmetry of x and y, at equal lengths.
    at = np.linspace(0.0, 1.0, 50)
    lengths = [ds.arclength[k].values[: part.shape[1]] for k, part in enumerate((one, two))]
    for row in (0, 1):
        left, right = (np.interp(at, s, p[row]) for s, p in zip(lengths, (one, two), strict=True))
        np.testing.assert_allclose(left, -right, atol=0.02)
        assert np.ptp(left) > 10.0


def test_nullclines_are_where_the_rates_vanish():
    system = pk.Problem(
        {"v": "v - v^3/3 - w + I", "w": "v + a - b*w"},
        parameters={"I": 0.5, "a": 0.7, "b": 0.8}, window={"v": (-2.5, 2.5), "w": (-1, 2)},
    )  # fmt: skip
    ds = pk.nullclines(system)
    assert ds.nullcline_of.values.tolist() == ["v", "w"]
    for k, rate in enumerate((lambda v, w: v - v**3 / 3 - w + 0.5, lambda v, w: v + 0.7 - 0.8 * w)):
        v, w = ds.nullcline_v[k].values, ds.nullcline_w[k].values
        there = np.isfinite(v)
        assert there.sum() > 200
        assert np.abs(rate(v[there], w[there])).max() < 1e-12
    assert ds.attrs["complete"] == "no"
    circles = pk.Problem({"x": "x^2 + y^2 - 1", "y": "1"}, window={"x": (-2, 2), "y": (-2, 2)})
    ds = pk.nullclines(circles)
    np.testing.assert_allclose(np.hypot(ds.nullcline_x, ds.nullcline_y), 1.0, rtol=1e-12)


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: pk.manifolds(pk.Pendulum(length=1.0)), "a flow x' = f"),
        (lambda: pk.manifolds(pk.Problem("x^2", "x", {}, map=True)), "a flow x' = f"),
        (lambda: pk.manifolds(pk.Problem({"x": "v", "v": "-x"})), "box"),
        (lambda: pk.manifolds(pk.Problem({"x": "v", "v": "-x"}, window=BOX), 0), "equilibrium: "),
        (lambda: pk.manifolds(pk.Problem({"x": "v", "v": "x"}, window=BOX), 3), "equilibrium: got"),
        (lambda: pk.nullclines(pk.Problem("x", "x", {}, window={"x": (0, 1)})), "of two states"),
        (lambda: pk.nullclines(pk.Problem({"x": "v", "v": "x"}, window=BOX), resolution=3), "res"),
        (
            lambda: pk.plot.phase_portrait(pk.Problem("x", "x", {}, window={"x": (0, 1)})),
            "a flow of two states",
        ),
        (
            lambda: pk.plot.phase_portrait(
                pk.Problem({"x": "v", "v": "x"}, window=BOX), energies=[1.0]
            ),
            "energies: .* no energy",
        ),
        (lambda: pk.plot.phase_portrait(pk.Pendulum(length=1.0), window=BOX), "window: got"),
    ],
)
def test_what_is_wrong_is_said(call, message):
    with pytest.raises(pk.ParameterError, match=message):
        call()


def test_the_portrait_shows_what_there_is():
    damped = pk.Problem({"x": "v", "v": "x - x^3 - d*v"}, parameters={"d": 0.2}, window=BOX)
    ax = pk.plot.phase_portrait(damped, orbits=[(1.5, 0.0)], duration=20.0)
    texts = [text.get_text() for text in (ax.get_legend() or ax.figure.legends[0]).get_texts()]
    for one in ("stable manifold", "unstable manifold", "saddle", "stable focus"):
        assert any(one.startswith(text.split()[0]) for text in texts), (one, texts)
    assert ax.get_xlim() == (-2.0, 2.0)
    assert ax.get_xlabel() == "$x$"
    marks = [line for line in ax.lines if line.get_marker() == "o"]
    np.testing.assert_allclose(sorted(marks[0].get_xdata()), [-1.0, 1.0], atol=1e-12)
