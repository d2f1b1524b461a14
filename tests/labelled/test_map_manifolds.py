"""Manifolds of fixed points of maps, and of flows seen once a period."""

import matplotlib.pyplot as plt
import mpmath as mp
import numpy as np
import pytest
from scipy.integrate import solve_ivp

import phasekit as pk
from phasekit.labelled.manifolds import Legs
from phasekit.motion import map_manifold


def strand(ds, k):
    """The states of a half, of shape (points, states)."""
    names = ds.state.values.tolist()
    return np.stack([ds[f"manifold_{n}"][k].dropna("point").values for n in names], axis=-1)


def henon(**more):
    return pk.Problem(
        {"x": "1 - a*x^2 + y", "y": "b*x"}, parameters={"a": 1.4, "b": 0.3}, map=True,
        window={"x": (-2, 2), "y": (-2, 2)}, **more,
    )  # fmt: skip


def series_of_henon(x0, multiplier, terms=70):
    """Coefficients of W with W(multiplier s) = f(W(s)), by equal powers of s."""
    a, b = mp.mpf("1.4"), mp.mpf("0.3")
    x = [x0, mp.mpf(1)]
    for n in range(2, terms):
        grows = multiplier**n
        product = mp.fsum(x[i] * x[n - i] for i in range(1, n))
        x.append(-a * product / (grows + 2 * a * x0 - b / grows))
    return x, [b * one / multiplier**n for n, one in enumerate(x)]


def away_from_series(point, series, places, curve):
    """Distance of a point from the curve of a series, next to the nearest of its places."""
    at = mp.mpf(places[np.argmin(np.linalg.norm(curve - point, axis=1))])
    x, y = (list(reversed(one)) for one in series)
    p, q = map(mp.mpf, point.tolist())
    for _ in range(8):  # the foot of the perpendicular, by Newton's method without curvature
        (u, du), (v, dv) = (mp.polyval(one, at, derivative=True) for one in (x, y))
        at -= ((u - p) * du + (v - q) * dv) / (du**2 + dv**2)
    return float(mp.hypot(mp.polyval(x, at) - p, mp.polyval(y, at) - q))


@pytest.mark.slow
def test_manifolds_of_henon_are_the_parametrised_curves():
    ds = pk.manifolds(henon(), length=2.0)
    assert ds.sizes["manifold"] == 8
    tested = 0
    with mp.workdps(60):
        a, b = mp.mpf("1.4"), mp.mpf("0.3")
        for k in range(8):
            sign = -1 if float(ds.x.values[int(ds.manifold_from[k]), 0]) < 0.0 else 1
            x0 = (b - 1 + sign * mp.sqrt((1 - b) ** 2 + 4 * a)) / (2 * a)
            root = mp.sqrt((a * x0) ** 2 + b)
            both = sorted((-a * x0 - root, -a * x0 + root), key=abs)
            series = series_of_henon(x0, both[0 if ds.manifold_stable[k] else 1])
            x, y = (np.array([float(one) for one in coefficients]) for coefficients in series)
            places = np.linspace(-1.6, 1.6, 6_401)
            curve = np.stack([np.polyval(x[::-1], places), np.polyval(y[::-1], places)], axis=-1)
            points = strand(ds, k)
            near = points[ds.arclength[k].dropna("point").values < 0.2]
            for point in near[1 :: max(len(near) // 5, 1)]:
                assert away_from_series(point, series, places, curve) < 1e-10
                tested += 1
    assert tested > 35


def test_points_are_close_and_a_later_piece_is_the_image_of_an_earlier_one():
    ds = pk.manifolds(henon(), 1, length=6.0)
    out = np.flatnonzero(~ds.manifold_stable.values)
    assert ds.manifold_end.values[out].tolist() == ["length", "length"]
    halves = [strand(ds, k) for k in out]
    for k, x in zip(out, halves, strict=True):
        steps = np.linalg.norm(np.diff(x, axis=0) / 4.0, axis=1)
        assert steps.max() <= 1.0 / 200.0
        s = ds.arclength[k].dropna("point").values
        assert np.all(np.diff(s) >= 0.0)
        assert s[-1] == pytest.approx(steps.sum(), rel=1e-3)
        assert 6.0 <= s[-1] < 6.01
    # The multiplier is negative: the image of one half is the other.
    image = np.stack(
        [1.0 - 1.4 * halves[0][:, 0] ** 2 + halves[0][:, 1], 0.3 * halves[0][:, 0]], -1
    )
    for point in image[200:1000:100]:
        assert np.linalg.norm((halves[1] - point) / 4.0, axis=1).min() < 1.0 / 300.0


@pytest.mark.slow
def test_an_integrable_map_keeps_to_its_level_curve():
    """McMillan's map has the integral x^2 + y^2 + x^2 y^2 - 2 m x y, 0 on both loops."""
    ds = pk.manifolds(
        pk.Problem({"x": "y", "y": "-x + 2*m*y/(1 + y^2)"}, parameters={"m": 1.5}, map=True,
                   window={"x": (-2, 2), "y": (-2, 2)})
    )  # fmt: skip
    assert ds.sizes["manifold"] == 4
    origin = int(ds.manifold_from[0])
    np.testing.assert_allclose(ds.x.values[origin], 0.0, atol=1e-12)
    assert ds.manifold_end.values.tolist() == ["equilibrium"] * 4
    assert ds.manifold_to.values.tolist() == [origin] * 4
    for k in range(4):
        x, y = strand(ds, k).T
        assert len(x) > 100
        assert np.ptp(x) > 0.7
        np.testing.assert_allclose(x**2 + y**2 + (x * y) ** 2 - 3.0 * x * y, 0.0, atol=1e-12)


@pytest.mark.parametrize("size", [1.0, 1e-6, 1e5])
def test_a_bent_linear_saddle_has_bent_axes(size):
    """(u, v, w) -> (-2 u, v/2, w/4) seen in x = u, y = v + u^2, z = w + u v: any unit."""
    s = repr(size)
    x, y, z = "x", f"(y - x^2/{s})", f"(z - x*(y - x^2/{s})/{s})"
    u, v, w = f"(-2*{x})", f"({y}/2)", f"({z}/4)"
    bent = pk.Problem(
        {"x": u, "y": f"{v} + {u}^2/{s}", "z": f"{w} + {u}*{v}/{s}"}, map=True,
        window={name: (-2.0 * size, 2.0 * size) for name in "xyz"},
    )  # fmt: skip
    ds = pk.manifolds(bent)
    assert ds.manifold_stable.values.tolist() == [False, False]
    assert ds.manifold_end.values.tolist() == ["window", "window"]
    sides = []
    for k in range(2):
        x, y, z = strand(ds, k).T / size
        np.testing.assert_allclose(y, x**2, atol=1e-10)
        np.testing.assert_allclose(z, 0.0, atol=1e-10)
        assert np.abs(y).max() == pytest.approx(2.0, abs=0.1)
        sides.append(np.sign(x[-1]))
    assert sorted(sides) == [-1.0, 1.0]


@pytest.mark.slow
def test_a_map_without_an_inverse_follows_its_preimages_up_to_the_fold():
    """The stable manifold of (x, y) -> (x/2 + y^2, 2 y) is the x axis; where x folds it is lost."""
    flat = pk.Problem({"x": "x/2 + y^2", "y": "2*y"}, map=True,
                      window={"x": (-1, 1), "y": (-1, 1)})  # fmt: skip
    ds = pk.manifolds(flat)
    for k in np.flatnonzero(ds.manifold_stable.values):
        np.testing.assert_allclose(strand(ds, k)[:, 1], 0.0, atol=1e-12)
        assert ds.manifold_end.values[k] == "window"
    for k in np.flatnonzero(~ds.manifold_stable.values):
        x, y = strand(ds, k).T  # x = c y^2 with 4 c = c/2 + 1
        np.testing.assert_allclose(x, y**2 / 3.5, atol=1e-11)
    folds = pk.Problem({"x": "x/2 - x^2", "y": "2*y"}, map=True,
                       window={"x": (-1, 1), "y": (-1, 1)})  # fmt: skip
    with pytest.warns(RuntimeWarning, match="halves of manifolds end where"):
        ds = pk.manifolds(folds)
    with pytest.warns(RuntimeWarning, match="phase_portrait: 1 of 4 halves of manifolds end where"):
        pk.plot.phase_portrait(folds, legend=False)
    plt.close()
    here = np.linalg.norm(ds.x.values, axis=1) < 1e-12
    own = ds.manifold_stable.values & here[ds.manifold_from.values]
    assert own.sum() == 2
    # x/2 - x^2 is greatest at x = 1/4: beyond there is no preimage next to it.
    right = next(k for k in np.flatnonzero(own) if strand(ds, k)[-1, 0] > 0.0)
    assert ds.manifold_end.values[right] == "lost"
    assert strand(ds, right)[-1, 0] == pytest.approx(0.25, abs=1e-3)


@pytest.mark.slow
def test_points_of_period_two_and_angles():
    ds = pk.manifolds(henon(), n=2, length=0.1)
    np.testing.assert_allclose(ds.x, pk.equilibria(henon(), n=2).x)
    assert ds.sizes["equilibrium"] == 4
    assert set(ds.manifold_from.values.tolist()) == {0, 1, 2, 3}
    # Chirikov's map and its inverse are conjugate by (q, p) -> (-q, p + K sin q).
    chirikov = pk.Problem(
        {"q": "q + p + K*sin(q)", "p": "p + K*sin(q)"}, parameters={"K": 0.9}, map=True,
        periods={"q": 2.0 * np.pi}, window={"p": (-3, 3)},
    )  # fmt: skip
    ds = pk.manifolds(chirikov, length=2.5)
    saddle = int(np.flatnonzero(np.hypot(*(ds.x.values.T)) < 1e-9)[0])
    halves = [
        [strand(ds, k) for k in np.flatnonzero((ds.manifold_from == saddle).values
                                               & (ds.manifold_stable == stable).values)]
        for stable in (False, True)
    ]  # fmt: skip
    assert [len(one) for one in halves] == [2, 2]
    tested = 0
    for x in halves[0]:
        q, p = x[20:600:20].T
        mirrored = np.stack([-q, p + 0.9 * np.sin(q)], axis=-1)
        for point in mirrored:
            away = [np.linalg.norm((y - point) / (2.0 * np.pi), axis=1).min() for y in halves[1]]
            assert min(away) < 1.0 / 300.0
            tested += 1
    assert tested > 20
    assert max(np.ptp(x[:, 0]) for x in halves[0]) > 2.0 * np.pi


@pytest.fixture(scope="module")
def duffing():
    return pk.Problem(
        {"x": "v", "v": "x - x^3 - d*v + F*cos(w*t)"}, time="t", period="2*pi/w",
        parameters={"d": 0.25, "F": 0.2, "w": 1.0}, window={"x": (-2, 2), "v": (-2, 2)},
    )  # fmt: skip


@pytest.mark.slow
def test_pieces_of_a_strongly_contracting_map_join():
    """It is u' = 3 u, v' = -v/50 with x = u + y^2, y = v + u^2."""
    u, v = "(x - y^2)", "(y - (x - y^2)^2)"
    y = f"(9*{u}^2 - {v}/50)"
    system = pk.Problem({"x": f"3*{u} + {y}^2", "y": y}, map=True,
                        window={"x": (-0.4, 0.4), "y": (-0.4, 0.4)})  # fmt: skip
    ds = pk.manifolds(system, length=0.4)
    (saddle,) = np.flatnonzero(np.abs(ds.x.values).max(axis=1) < 1e-9)
    halves = np.flatnonzero(ds.manifold_from.values == saddle)
    assert len(halves) == 4
    for k in halves:
        points = strand(ds, k)
        assert np.linalg.norm(np.diff(points, axis=0), axis=1).max() < 0.8 / 200.0 * 1.01
        x, y = points.T
        u = x - y**2
        assert np.abs(u if ds.manifold_stable[k] else y - u**2).max() < 1e-8
        assert ds.arclength[k].max() > 0.35


@pytest.mark.slow  # hundreds of motions for a period, and more for each point
def test_a_forced_flow_is_seen_once_a_period(duffing):
    def after(x, periods):
        def f(t, y):
            return [y[1], y[0] - y[0] ** 3 - 0.25 * y[1] + 0.2 * np.cos(t)]

        span = (0.0, 2.0 * np.pi * periods)
        return solve_ivp(f, span, x, method="DOP853", rtol=1e-12, atol=1e-13).y[:, -1]

    with pytest.warns(UserWarning, match="starts of Newton's method"):
        ds = pk.manifolds(duffing, length=0.4)
    saddles = np.flatnonzero(ds.kind.values == pk.FlowEquilibriumKind.SADDLE)
    assert saddles.size >= 1
    for k in saddles:
        grown = abs(ds.eigenvalue.values[k, 0])
        np.testing.assert_allclose(after(ds.x.values[k], 1), ds.x.values[k], atol=1e-10 * grown)
    middle = int(saddles[np.argmin(np.abs(ds.x.values[saddles, 0]))])
    product = np.prod(ds.eigenvalue.values[middle])
    assert product.real == pytest.approx(np.exp(-0.25 * 2.0 * np.pi), rel=1e-8)
    for k in np.flatnonzero(ds.manifold_from.values == middle):
        points = strand(ds, k)
        sense = -1.0 if ds.manifold_stable[k] else 1.0
        inner = np.linalg.norm(points - points[0], axis=1)
        # The manifold goes to itself: an image lies on the chord between neighbours.
        grown = inner * np.abs(ds.eigenvalue.values[middle, 0 if sense > 0.0 else 1]) ** sense
        chosen = np.flatnonzero((grown > 0.05) & (grown < 1.2))[:2]
        assert chosen.size
        for i in chosen:
            image = after(points[i], sense)
            row = np.linalg.norm(points - image, axis=1)
            j = int(np.argmin(row))
            near = points[max(j - 3, 0) : j + 4] - image
            way = near[-1] - near[0]
            off = np.abs(near[:, 0] * way[1] - near[:, 1] * way[0]) / np.linalg.norm(way)
            assert off.min() < 2e-5
        # Back by so many periods, a point comes to the saddle.
        far = points[min(len(points) - 1, 60)]
        assert np.linalg.norm(after(far, -2.0 * sense) - points[0]) < 2e-2


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: pk.manifolds(henon(), 5), "equilibrium: got 5"),
        (lambda: pk.manifolds(henon(), n=0), "n: got 0"),
        (
            lambda: pk.manifolds(
                pk.Problem({"x": "v", "v": "x"}, window={"x": (-1, 1), "v": (-1, 1)}), n=2
            ),
            "n: got 2, wants None for a flow",
        ),
        (
            lambda: pk.manifolds(
                pk.Problem({"x": "v", "v": "x + cos(t)"}, time="t",
                           window={"x": (-1, 1), "v": (-1, 1)})
            ),
            "a forced flow with a period",
        ),
    ],
)  # fmt: skip
def test_what_is_wrong_is_said(call, message):
    with pytest.raises(pk.ParameterError, match=message):
        call()


def test_functions_are_differenced_on_the_scale_of_the_window():
    """A forced flow in microns: slopes by central differences against those of the formulas."""
    s, window = 1e-6, np.full(2, 2e-6)
    formulas = {"x": "v", "v": "-0.2*v + x - x^3/1e-12 + 3e-7*cos(t)"}

    def f(x, t):
        return np.array([x[1], -0.2 * x[1] + x[0] - x[0] ** 3 / s**2 + 0.3 * s * np.cos(t)])

    laws = [pk.Problem(f, ("x", "v"), {}, time="t", period=2 * np.pi)]
    laws += [pk.Problem(formulas, time="t", period=2 * np.pi)]
    got, want = (
        Legs(law, -window, window, 1).leg().slopes(np.array([[0.3, 0.1]]) * s) for law in laws
    )
    np.testing.assert_allclose(got, want, rtol=0, atol=1e-6 * np.abs(want).max())


def test_halves_that_end_for_their_number_of_points_are_said(monkeypatch):
    monkeypatch.setattr(map_manifold, "MOST", 500)
    with pytest.warns(RuntimeWarning, match="halves of manifolds end for their number of points"):
        pk.manifolds(henon(), length=20.0)


@pytest.mark.parametrize("expanding", [3.0, 1e5])
def test_a_manifold_sees_the_fixed_point_it_comes_to_however_fast_it_leaves(expanding):
    logistic = pk.Problem(  # x/(1 - x) grows by the factor
        {"x": "G*x/(1 + (G - 1)*x)", "y": "y/5"}, parameters={"G": expanding}, map=True,
        window={"x": (-1e-6, 1.5), "y": (-0.5, 0.5)},
    )  # fmt: skip
    found = pk.manifolds(logistic, 0, length=3.0)
    np.testing.assert_allclose(found.x.values[:2], [[0.0, 0.0], [1.0, 0.0]], atol=1e-12)
    halves = ~found.manifold_stable.values
    right = np.nanmax(found.manifold_x.values, axis=1) > 0.5
    assert found.manifold_end.values[halves & right].tolist() == ["equilibrium"]
    assert found.manifold_to.values[halves & right].tolist() == [1]
