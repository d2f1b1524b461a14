"""Manifolds of saddles and nullclines, against closed forms and SciPy."""

from __future__ import annotations

import matplotlib.pyplot as plt
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


@pytest.mark.slow
def test_where_they_go_is_where_motions_go():
    damped = pk.Problem({"x": "v", "v": "x - x^3 - d*v"}, parameters={"d": 0.2}, window=BOX)
    ds = pk.manifolds(damped)
    falls = ~ds.manifold_stable.values
    beside = pk.manifolds(damped, {"v": 0.0, "x": 0.01})  # the equilibrium by a state next to it
    assert beside.identical(pk.manifolds(damped, 1))
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


@pytest.mark.slow
def test_manifolds_round_a_cylinder_come_to_a_rotation():
    """Of a driven pendulum one half comes to rest, the other goes round for ever."""
    system = pk.Problem(
        {"phi": "w", "w": "I - al*w - sin(phi)"}, parameters={"al": 0.1, "I": 0.5},
        periods={"phi": 2.0 * np.pi}, window={"w": (-8.0, 8.0)},
    )  # fmt: skip
    ds = pk.manifolds(system)
    out = np.flatnonzero(~ds.manifold_stable.values)
    goals = {(int(ds.manifold_to[k]), int(ds.manifold_cycle[k])) for k in out}
    rest = int(np.flatnonzero(ds.kind.values == pk.FlowEquilibriumKind.STABLE_FOCUS)[0])
    assert goals == {(rest, -1), (-1, 0)}
    round_ = out[int(np.argmax(ds.manifold_cycle.values[out]))]
    phi, w = strand(ds, round_)
    cycle = pk.periodic_orbits(system)
    assert np.ptp(phi) > 10.0 * 2.0 * np.pi
    assert cycle.w_min - 0.1 < w[-1] < cycle.w_max
    # Without damping and drive the separatrix w^2 = 2 (1 + cos phi) leads to the next saddle.
    free = pk.Problem(
        {"phi": "w", "w": "-sin(phi)"}, periods={"phi": 2.0 * np.pi}, window={"w": (-3.0, 3.0)}
    )
    ends = pk.manifolds(free, rtol=1e-11)
    saddle = int(np.flatnonzero(ends.kind.values == pk.FlowEquilibriumKind.SADDLE)[0])
    assert (ends.manifold_to.values == saddle).all()
    for k in range(4):
        phi, w = strand(ends, k)
        np.testing.assert_allclose(w**2, 2.0 * (1.0 + np.cos(phi)), atol=1e-9)
        assert np.ptp(phi) == pytest.approx(2.0 * np.pi, abs=1e-4)
        # Its length in widths, by the trapezoidal rule on a fine grid.
        s = np.linspace(-np.pi, np.pi, 200_001)
        speed = np.hypot(1.0 / (2.0 * np.pi), np.sin(s / 2.0) / 6.0)
        length = float(np.sum(0.5 * (speed[1:] + speed[:-1]) * np.diff(s)))
        assert ends.arclength[k].max().item() == pytest.approx(length, abs=2e-5)


def round_both_foci():
    """A saddle whose unstable manifold winds onto a cycle round both foci."""
    return pk.Problem(
        {"x": "y", "y": "x - x^3 + (a - x^2)*y"}, parameters={"a": 1.5},
        window={"x": (-3.0, 3.0), "y": (-5.0, 5.0)},
    )  # fmt: skip


@pytest.mark.slow
def test_a_cycle_is_where_a_manifold_comes():
    system = round_both_foci()
    cycles = pk.periodic_orbits(system)
    assert cycles.n_unstable.values.tolist() == [0]
    ds = pk.manifolds(system)
    out = ~ds.manifold_stable.values
    assert ds.manifold_cycle.values[out].tolist() == [0, 0]
    assert (ds.manifold_to.values[out] == -1).all()


@pytest.mark.slow  # integrates in Python
def test_manifolds_of_a_python_function_are_those_of_formulas():
    system = round_both_foci()
    ds = pk.manifolds(system)
    out = ~ds.manifold_stable.values

    def rates(x, a):
        return [x[1], x[0] - x[0] ** 3 + (a - x[0] ** 2) * x[1]]

    plain = pk.Problem(rates, ("x", "y"), {"a": 1.5}, window={"x": (-1.5, 1.5), "y": (-2.0, 2.0)})
    with pytest.warns(UserWarning, match="there may be other equilibria"):
        same = pk.manifolds(plain, 1, length=1.5)
    for k in range(2):
        x, y = strand(ds, int(np.flatnonzero(out)[k]))
        u, v = strand(same, k)
        number = min(len(x), len(u)) // 2
        assert number > 10
        there = [np.hypot(x - a, y - b).min() for a, b in zip(u[:number], v[:number], strict=True)]
        assert max(there) < 0.06  # as far as points are apart


def test_a_damped_system_has_manifolds():
    damped = pk.Perturbed(pk.Pendulum(length=9.80665), damping=0.3)
    ds = pk.manifolds(damped, window={"dphi": (-3.0, 3.0)})
    falls = ~ds.manifold_stable.values
    assert (ds.manifold_end.values[falls] == "equilibrium").all()
    same = pk.Problem(
        {"phi": "w", "w": "-sin(phi) - 0.3*w"}, periods={"phi": 2.0 * np.pi},
        window={"w": (-3.0, 3.0)},
    )  # fmt: skip
    other = pk.manifolds(same)
    # The last points lie within a step of the edge of the window.
    np.testing.assert_allclose(ds.arclength.max("point"), other.arclength.max("point"), rtol=5e-3)


@pytest.mark.slow
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
    assert ds.complete.item()
    assert ds.attrs["complete"] == "yes"
    window = {"x": (-2, 2), "y": (-2, 2)}
    circles = pk.Problem({"x": "x^2 + y^2 - 1", "y": "1"}, window=window)
    ds = pk.nullclines(circles)
    assert ds.complete.item()
    np.testing.assert_allclose(np.hypot(ds.nullcline_x, ds.nullcline_y), 1.0, rtol=1e-12)
    with np.errstate(all="raise"):
        code = pk.Problem(lambda x: np.array([x[0] ** 2 + x[1] ** 2 - 1, 1.0]), ("x", "y"), {},
                          window=window)  # fmt: skip
    ds = pk.nullclines(code)
    assert "a grid" in ds.complete.attrs["reason"]
    np.testing.assert_allclose(np.hypot(ds.nullcline_x, ds.nullcline_y), 1.0, rtol=1e-12)


@pytest.mark.slow
def test_nullclines_that_cross_are_told_apart_and_what_is_open_is_named():
    window = {"n": (0.0, 2.0), "p": (0.0, 2.0)}
    competing = pk.Problem({"n": "n*(3 - 2*n - p)", "p": "p*(2 - n - p)"}, window=window)
    ds = pk.nullclines(competing)
    assert ds.nullcline_of.values.tolist() == ["n", "n", "p", "p"]
    assert ds.complete.item()
    axis = ds.isel(curve=0)
    np.testing.assert_array_equal(axis.nullcline_n.dropna("point"), 0.0)
    assert {float(axis.nullcline_p.min()), float(axis.nullcline_p.max())} == {0.0, 2.0}
    node = pk.Problem({"n": "p^2 - (n - 1)^2*n", "p": "p"}, window={"n": (0, 2), "p": (-1, 1)})
    found = pk.nullclines(node).complete
    assert not found.item()
    assert "undecided within n in (" in found.attrs["reason"]
    kinked = pk.Problem({"n": "Max(n, p) - 1", "p": "p - n"}, window=window)
    assert "no bounds are known for Max" in pk.nullclines(kinked).complete.attrs["reason"]


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: pk.manifolds(pk.Pendulum(length=1.0)), "a flow x' = f"),
        (lambda: pk.manifolds(pk.Problem({"x": "v", "v": "-x"})), "window: "),
        (lambda: pk.manifolds(pk.Problem({"x": "v", "v": "-x"}, window=BOX), rtol=1.0), "rtol: "),
        (lambda: pk.manifolds(pk.Problem({"x": "v", "v": "-x"}, window=BOX), 0), "equilibrium: "),
        (lambda: pk.manifolds(pk.Problem({"x": "v", "v": "x"}, window=BOX), 3), "equilibrium: got"),
        (lambda: pk.manifolds(pk.Problem({"x": "v", "v": "x"}, window=BOX), [1, [2]]), "a value"),
        (lambda: pk.manifolds(pk.Problem({"x": "v", "v": "x"}, window=BOX), [1, 0]), "they are at"),
        (lambda: pk.manifolds(pk.Problem({"x": "v", "v": "x"}, window=BOX), {"x": 0}), "for v as"),
        (lambda: pk.nullclines(pk.Problem("x", "x", {}, window={"x": (0, 1)})), "of two states"),
        (lambda: pk.nullclines(pk.Problem({"x": "v", "v": "x"}, window=BOX), resolution=3), "res"),
        (
            lambda: pk.plot.phase_portrait(pk.Problem("x", "x", {}, window={"x": (0, 1)})),
            "a flow or a map of two states or more",
        ),
        (
            lambda: pk.plot.phase_portrait(
                pk.Problem({"x": "v", "v": "x"}, window=BOX), plane="xv"
            ),
            "plane: .* two of the states x, v",
        ),
        (
            lambda: pk.plot.phase_portrait(
                pk.Problem({"x": "v", "v": "x"}, window=BOX), plane=("x", "q")
            ),
            "plane: state 'q' is unknown",
        ),
        (
            lambda: pk.plot.phase_portrait(
                pk.Problem({"x": "v", "v": "x"}, window=BOX), orbits=[1]
            ),
            "orbits: .* states",
        ),
        (lambda: pk.plot.phase_portrait(pk.Pendulum(length=1.0), cycles=True), "cycles: got"),
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


@pytest.mark.slow
def test_the_portrait_shows_what_there_is():
    damped = pk.Problem({"x": "v", "v": "x - x^3 - d*v"}, parameters={"d": 0.2}, window=BOX)
    ax = pk.plot.phase_portrait(damped, orbits=[(1.5, 0.0)], duration=20.0)
    texts = [text.get_text() for text in (ax.get_legend() or ax.figure.legends[0]).get_texts()]
    assert {"stable manifold", "unstable manifold", "saddle", "stable focus"} <= set(texts)
    assert "limit cycle" not in texts
    assert ax.get_xlim() == (-2.0, 2.0)
    assert ax.get_xlabel() == "$x$"
    marks = [line for line in ax.lines if line.get_marker() == "o"]
    np.testing.assert_allclose(sorted(marks[0].get_xdata()), [-1.0, 1.0], atol=1e-12)


@pytest.mark.slow
def test_the_portrait_shows_limit_cycles_by_stability():
    nerve = pk.Problem(
        {"v": "v - v^3/3 - w + I", "w": "eps*(v + a - b*w)"},
        parameters={"I": 0.325, "eps": 0.08, "a": 0.7, "b": 0.8},
        window={"v": (-2.5, 2.5), "w": (-1.0, 2.0)},
    )  # fmt: skip
    ax = pk.plot.phase_portrait(nerve)
    looks = {t.get_text(): h for t, h in zip(
        ax.get_legend().get_texts(), ax.get_legend().legend_handles, strict=True)}  # fmt: skip
    assert looks["limit cycle"].get_linestyle() == "-"
    assert looks["unstable limit cycle"].get_linestyle() != "-"
    cycles = pk.periodic_orbits(nerve)
    thick = [line for line in ax.lines if line.get_linewidth() == 2.4]
    assert len(thick) == 2
    for line in thick:
        kind = 0 if line.get_linestyle() == "-" else 1
        own = cycles.isel(cycle=int(np.flatnonzero(cycles.n_unstable.values == kind)[0]))
        assert np.nanmax(line.get_xdata()) == pytest.approx(own.v_max.item(), abs=1e-3)
    plain = pk.plot.phase_portrait(nerve, cycles=False)
    assert not [line for line in plain.lines if line.get_linewidth() == 2.4]


@pytest.mark.slow
def test_more_states_are_projected():
    lorenz = pk.Problem(
        ["10*(y - x)", "x*(28 - z) - y", "x*y - 8*z/3"], ("x", "y", "z"),
        window={"x": (-25, 25), "y": (-30, 30), "z": (0, 50)},
    )  # fmt: skip
    start = {"x": 1.0, "y": 1.0, "z": 20.0}
    ax = pk.plot.phase_portrait(lorenz, plane=("x", "z"), orbits=start, duration=5.0)
    assert (ax.get_xlabel(), ax.get_ylabel()) == ("$x$", "$z$")
    texts = [text.get_text() for text in ax.get_legend().get_texts()]
    assert texts[-1] == "saddle"
    assert "from (1, 1, 20)" in texts
    motion = pk.flow(lorenz, start, np.linspace(0.0, 5.0, 6_001))
    drawn = [line for line in ax.lines if line.get_xdata().size == 6_001]
    np.testing.assert_array_equal(drawn[0].get_ydata(), motion.motion_z)
    with pytest.raises(pk.ParameterError, match="basins: got True"):
        pk.plot.phase_portrait(lorenz, basins=True)


@pytest.mark.slow
def test_a_damped_system_is_drawn_past_its_separatrices():
    damped = pk.Perturbed(pk.Coefficients(1.0, 0.35, 0.12), damping=0.1)
    ax = pk.plot.phase_portrait(damped)
    saddle = float(pk.separatrices(pk.Coefficients(1.0, 0.35, 0.12)).saddle_energy.max())
    rest = float(pk.equilibria(pk.Coefficients(1.0, 0.35, 0.12)).energy.min())
    assert ax.get_ylim()[1] > np.sqrt(2.0 * (saddle - rest))
    assert ax.get_ylabel() == r"$\dot\varphi$ (s$^{-1}$)"
    texts = [text.get_text() for text in ax.get_legend().get_texts()]
    assert r"$\ddot\varphi = 0$" in texts


@pytest.mark.slow
def test_an_angle_is_drawn_all_round():
    pendulum = pk.Problem(
        {"phi": "w", "w": "1/2 - w/10 - sin(phi)"}, periods={"phi": 2.0 * np.pi},
        window={"w": (-8.0, 8.0)},
    )  # fmt: skip
    ax = pk.plot.phase_portrait(pendulum, orbits=[(0.0, 6.0)], duration=6.0)
    assert ax.get_xlim() == (-np.pi, np.pi)
    (cycle,) = (line for line in ax.lines if line.get_linewidth() == 2.4)
    seen = cycle.get_xdata()[np.isfinite(cycle.get_xdata())]
    assert seen.min() <= -np.pi
    assert seen.max() >= np.pi


@pytest.mark.slow
def test_a_map_is_drawn_with_the_manifolds_of_its_saddles():
    henon = pk.Problem(
        {"x": "1 - a*x^2 + y", "y": "b*x"}, parameters={"a": 1.4, "b": 0.3}, map=True,
        window={"x": (-2, 2), "y": (-1, 1)},
    )  # fmt: skip
    ax = pk.plot.phase_portrait(henon, orbits=(0.1, 0.1), duration=40)
    names = [text.get_text() for text in ax.get_legend().get_texts()]
    assert names == ["stable manifold", "unstable manifold", "from (0.1, 0.1)", "saddle"]
    lines = [line.get_xydata() for line in ax.lines]
    saddles = lines[-1]
    root = np.sqrt(0.7**2 + 4 * 1.4)
    np.testing.assert_allclose(np.sort(saddles[:, 0]), (-0.7 - np.array([root, -root])) / 2.8)
    x, y = 0.1, 0.1
    for point in next(line for line in lines if len(line) == 41):
        assert point == pytest.approx((x, y), abs=1e-9)
        x, y = 1 - 1.4 * x**2 + y, 0.3 * x
    curves = [line for line in lines if len(line) > 60]
    assert len(curves) == 8
    plt.close(ax.figure)
    with pytest.raises(pk.ParameterError, match="orbit_diagram"):
        pk.plot.phase_portrait(pk.Problem("r*x*(1 - x)", "x", {"r": 3.0}, map=True))
    with pytest.raises(pk.ParameterError, match="cycles: got True"):
        pk.plot.phase_portrait(henon, cycles=True)
