"""Phase portraits: what is drawn lies where the equations put it, and looks as promised."""

import matplotlib.pyplot as plt
import numpy as np
import pytest
from matplotlib.colors import to_rgba
from witnesses.variants import some

import phasekit as pk
from phasekit.plot.parts import style

EIGHT = pk.Coefficients(3.7, 1.3, 0.4)
NEGATIVE = pk.Coefficients(-4.1, 0.9, 0.35)
WINDING = pk.Coefficients(1.1, 2.3, 0.6)
HETEROCLINIC = pk.Coefficients(-4.1, 0.9, 0.0)
FORCELESS = pk.Coefficients(0.0, 0.0, 0.0)
FOLD = pk.Coefficients(125.0, 27.0, 64.0)  # 25 = 9 + 16
SYSTEMS = {
    "eight": EIGHT,
    "negative": NEGATIVE,
    "winding": WINDING,
    "heteroclinic": HETEROCLINIC,
    "fold": FOLD,
    "disk": pk.GyroRotorDisk(beta=1.4, e=0.05, a=0.012, r=0.2, omega1=31.4),
    "disk, A < 0": pk.GyroRotorDisk(beta=0.3, e=0.0115, a=-0.02, r=0.21, omega1=2.5),
    "reduced": pk.Reduced(0.4, -0.1, 2.3),
    "particle": pk.ParticleOnCircle(radius=0.3, omega=9.0, offset=0.02),
    "pendulum": pk.Pendulum(length=0.7),
    "magnet": pk.StonerWohlfarth(K=2.1, h_x=0.3, h_y=0.4),
}


def lines(ax, **look):
    return [line for line in ax.lines if all(getattr(line, f"get_{k}")() == look[k] for k in look)]


def labelled(ax, label):
    return [line for line in ax.lines if line.get_label() == label]


def looks_like(ax, look):
    """Lines with the color, dashes and width of a style."""
    (model,) = plt.figure().add_subplot().plot([0, 1], [0, 1], **look)
    return [
        line
        for line in ax.lines
        if to_rgba(line.get_color()) == to_rgba(model.get_color())
        and line._unscaled_dash_pattern == model._unscaled_dash_pattern
        and line.get_linewidth() == model.get_linewidth()
    ]


def energy(system, phi, dphi):
    A, B, C = system.coefficients()
    return 0.5 * dphi**2 - B * np.cos(phi) + 0.5 * A * np.cos(phi) ** 2 - C * np.sin(phi)


def energies_along(system, line):
    phi, dphi = line.get_data()
    h = energy(system, phi, dphi)
    return h[np.isfinite(h)]


def shoelace(polygon):
    x, y = polygon.get_xy().T
    return 0.5 * abs(np.sum(x * np.roll(y, -1) - y * np.roll(x, -1)))


@pytest.mark.slow
@pytest.mark.parametrize("name", SYSTEMS)
def test_returns_the_given_axes_and_draws_the_equilibria(name, ax):
    system = SYSTEMS[name]
    assert pk.plot.phase_portrait(system, ax=ax) is ax
    ds = pk.equilibria(system)
    for kind, label in ((1, "center"), (2, "saddle"), (3, "degenerate")):
        expected = np.sort(ds.phi.values[ds.kind.values == kind])
        marks = labelled(ax, label)
        drawn = np.concatenate([mark.get_xdata() for mark in marks] or [np.empty(0)])
        assert (np.abs(drawn) < np.pi + 0.03).all()
        inside = np.sort(drawn[(drawn > -np.pi) & (drawn <= np.pi)])
        np.testing.assert_allclose(inside, expected, rtol=1e-14)
        copies = drawn[(drawn <= -np.pi) | (drawn > np.pi)]
        near = expected[np.abs(expected) > np.pi - 0.02]
        np.testing.assert_allclose(np.sort(np.cos(copies)), np.sort(np.cos(near)), atol=1e-14)
        assert all(not np.any(mark.get_ydata()) for mark in marks)
        assert all(mark.get_marker() == style.POINTS[kind]["marker"] for mark in marks)


@pytest.mark.slow
@pytest.mark.parametrize("name", SYSTEMS)
def test_every_curve_lies_on_a_level(name):
    system = SYSTEMS[name]
    ax = pk.plot.phase_portrait(system)
    scale = max(map(abs, system.coefficients()))
    curves = [line for line in ax.lines if line.get_marker() == "None"]
    assert len(curves) >= 6
    for line in curves:
        assert np.ptp(energies_along(system, line)) < 1e-12 * scale


@pytest.mark.slow
@pytest.mark.parametrize("name", SYSTEMS)
def test_separatrices_lie_on_the_saddles_levels(name):
    system = SYSTEMS[name]
    ax = pk.plot.phase_portrait(system)
    ds = pk.separatrices(system)
    saddles = ds.saddle_energy.dropna("saddle").values
    drawn = [
        energies_along(system, line)[0]
        for look in (style.EIGHT, style.WINDING, style.CYCLE)
        for line in looks_like(ax, look)
    ]
    for h in saddles:
        assert min(abs(np.array(drawn) - h)) < 1e-12 * max(map(abs, system.coefficients()))


@pytest.mark.parametrize("system", [EIGHT, NEGATIVE, pk.Coefficients(3.7, -1.3, 0.4)])
def test_the_fill_of_an_eight_has_the_area_of_its_lobes(system):
    ax = pk.plot.phase_portrait(system)
    areas = pk.separatrices(system).lobe_area.sel(saddle="lower").values
    # A lobe that lies across the seam is drawn once on either side.
    drawn = {round(shoelace(patch), 6) for patch in ax.patches}
    assert len(drawn) == 2
    for area in areas:
        assert min(abs(np.array(list(drawn)) / area - 1.0)) < 2e-4
    assert all(patch.get_facecolor()[3] < 0.5 for patch in ax.patches)


@pytest.mark.parametrize(
    ("system", "look", "count"),
    [
        (EIGHT, style.EIGHT, 2),
        (EIGHT, style.WINDING, 1),
        (WINDING, style.WINDING, 1),
        (HETEROCLINIC, style.CYCLE, 2),
        (FOLD, style.DEGENERATE, 1),
        (FORCELESS, style.REST, 1),
    ],
)
def test_separatrices_look_as_promised(system, look, count):
    ax = pk.plot.phase_portrait(system)
    assert len(labelled(ax, look["label"])) == count == len(looks_like(ax, look))
    assert look["label"] in [text.get_text() for text in ax.get_legend().get_texts()]


@pytest.mark.parametrize("system", [WINDING, HETEROCLINIC, FORCELESS, FOLD])
def test_only_an_eight_is_filled(system):
    assert not pk.plot.phase_portrait(system).patches


def test_separatrices_lie_over_levels_and_under_points():
    ax = pk.plot.phase_portrait(EIGHT)
    level = max(line.get_zorder() for line in looks_like(ax, style.LEVEL))
    (winding,) = looks_like(ax, style.WINDING)
    assert level < winding.get_zorder() < labelled(ax, "center")[0].get_zorder()


def test_axes_show_the_whole_cylinder(ax):
    pk.plot.phase_portrait(EIGHT, ax=ax)
    assert ax.get_xlim() == (-np.pi, np.pi)
    np.testing.assert_allclose(ax.get_xticks(), np.arange(-2, 3) * np.pi / 2)
    ax.figure.canvas.draw()
    texts = [tick.get_text() for tick in ax.get_xticklabels()]
    assert texts == [r"$-\pi$", r"$-\pi/2$", "0", r"$\pi/2$", r"$\pi$"]
    assert ax.get_ylabel() == r"$\dot\varphi$ (rad/s)"
    low, high = ax.get_ylim()
    assert low == -high


def test_degrees_stretch_both_axes():
    rad, deg = (pk.plot.phase_portrait(EIGHT, angles=unit) for unit in ("rad", "deg"))
    assert deg.get_xlim() == (-180.0, 180.0)
    assert deg.get_xlabel() == r"$\varphi$ (°)"
    assert deg.get_ylabel() == r"$\dot\varphi$ (°/s)"
    for one, other in zip(rad.lines, deg.lines, strict=True):
        np.testing.assert_allclose(np.rad2deg(one.get_ydata()), other.get_ydata())


@pytest.mark.slow
@pytest.mark.parametrize("scale", [1e-300, 1e-30, 1e30, 1e300])
def test_the_picture_does_not_depend_on_the_scale(scale):
    plain = pk.plot.phase_portrait(EIGHT)
    scaled = pk.plot.phase_portrait(pk.Coefficients(*(scale * c for c in EIGHT)))
    assert len(plain.lines) == len(scaled.lines)
    np.testing.assert_allclose(scaled.get_ylim(), np.sqrt(scale) * np.array(plain.get_ylim()))
    scaled.figure.canvas.draw()


def test_levels_are_spread_evenly_in_speed():
    ax = pk.plot.phase_portrait(WINDING)
    tops = sorted(np.nanmax(line.get_ydata()) for line in looks_like(ax, style.LEVEL))
    assert len(tops) == 5
    np.testing.assert_allclose(np.diff(tops), tops[0], rtol=2e-3)


def test_every_well_has_a_level_of_its_own():
    system = pk.Coefficients(1.0, 0.9, 0.005)  # two shallow wells in a deep one
    ax = pk.plot.phase_portrait(system)
    ds = pk.separatrices(system)
    levels = [line for line in looks_like(ax, style.LEVEL)]
    saddle = ds.saddle_phi.sel(saddle="lower").item()
    for offset in ds.turning_offset.sel(saddle="lower").values:
        left, right = sorted((saddle, saddle + offset))
        inside = [
            line
            for line in levels
            if left < np.nanmin(line.get_xdata()) and np.nanmax(line.get_xdata()) < right
        ]
        assert len(inside) == 1


def test_given_energies_are_the_levels_drawn():
    chosen = [-0.4, 0.9, 6.0]
    ax = pk.plot.phase_portrait(EIGHT, energies=chosen)
    drawn = {
        round(float(energies_along(EIGHT, line)[0]), 9)
        for look in (style.LEVEL, style.ROTATION)
        for line in looks_like(ax, look)
    }
    assert drawn == set(chosen)
    assert ax.get_ylim()[1] > np.sqrt(2 * (6.0 - pk.equilibria(EIGHT).energy.min().item()))


@pytest.mark.parametrize("energies", [[], -100.0])
def test_no_level_is_no_error(energies):
    ax = pk.plot.phase_portrait(EIGHT, energies=energies)
    assert not looks_like(ax, style.LEVEL)
    assert labelled(ax, "saddle")


def test_an_orbit_is_its_own_piece_of_the_level():
    starts = [(1.6, 0.05), (-1.5, 0.0), (0.2, 9.0), (0.2, -9.0)]
    ax = pk.plot.phase_portrait(EIGHT, orbits=starts)
    heads = [line for line in ax.lines if line.get_marker() == ">"]
    curves = [line for line in ax.lines if line.get_linewidth() == 1.8 and line.get_zorder() == 4]
    assert len(heads) == len(curves) == len(starts)
    for start, head, curve in zip(starts, heads, curves, strict=True):
        np.testing.assert_allclose((head.get_xdata()[0], head.get_ydata()[0]), start)
        np.testing.assert_allclose(energies_along(EIGHT, curve), energy(EIGHT, *start), rtol=1e-9)
    right, left, up, down = curves
    assert np.nanmin(right.get_xdata()) > 0.0 > np.nanmax(left.get_xdata())
    assert np.nanmin(up.get_ydata()) > 0.0 > np.nanmax(down.get_ydata())
    texts = [text.get_text() for text in ax.get_legend().get_texts()]
    assert "from (1.6, 0.05)" in texts
    assert "from (\N{MINUS SIGN}1.5, 0)" in texts


def test_one_pair_is_one_orbit_and_its_angle_is_wrapped():
    ax = pk.plot.phase_portrait(EIGHT, orbits=(1.6 + 4 * np.pi, 0.05))
    (head,) = [line for line in ax.lines if line.get_marker() == ">"]
    np.testing.assert_allclose(head.get_xdata(), 1.6)


def test_an_orbit_at_rest_is_its_start():
    phi = pk.equilibria(EIGHT).phi.sel(equilibrium="lower_center").item()
    ax = pk.plot.phase_portrait(EIGHT, orbits=(phi, 0.0))
    (head,) = [line for line in ax.lines if line.get_marker() == ">"]
    np.testing.assert_allclose(head.get_xdata(), phi)


def test_the_legend_lies_outside(ax):
    pk.plot.phase_portrait(EIGHT, ax=ax)
    ax.figure.canvas.draw()
    assert ax.get_legend().get_window_extent().y1 < ax.get_window_extent().y0
    assert pk.plot.phase_portrait(EIGHT, legend=False).get_legend() is None


@pytest.mark.slow
@pytest.mark.parametrize("rows", [1, 2])
def test_the_legend_is_not_cut_off(rows):
    figure, panels = plt.subplots(rows, 2, squeeze=False)
    for ax in panels.flat:
        pk.plot.phase_portrait(EIGHT, ax=ax, orbits=(0.3, 0.1))
    figure.canvas.draw()
    for ax in panels.flat:
        box = ax.get_legend().get_window_extent()
        assert figure.bbox.y0 <= box.y0 < box.y1 <= figure.bbox.y1


def test_a_layout_is_left_alone_where_nothing_has_to_be_placed():
    figure, ax = plt.subplots()
    pk.plot.phase_portrait(EIGHT, ax=ax, legend=False)
    assert figure.get_layout_engine() is None


def test_meaning_does_not_hang_on_color_alone():
    looks = [style.EIGHT, style.WINDING, style.CYCLE, style.LEVEL, style.ROTATION, style.DEGENERATE]
    assert len({(str(look["linestyle"]), look["linewidth"]) for look in looks}) == len(looks)
    assert len({look["marker"] for look in style.POINTS.values()}) == 3
    assert len({str(look["linestyle"]) for look in style.BRANCHES.values()}) == 2


@pytest.mark.parametrize(
    ("argument", "value"),
    [
        ("energies", "high"),
        ("energies", [1.0, np.nan]),
        ("energies", [[1.0], [2.0, 3.0]]),
        ("orbits", (1.0, 2.0, 3.0)),
        ("orbits", 1.0),
        ("orbits", [(1.0, np.inf)]),
        ("orbits", "all"),
        ("angles", "degrees"),
        ("angles", None),
        ("ax", plt),
        ("ax", "left"),
    ],
)
def test_wrong_arguments_are_named(argument, value):
    with pytest.raises(pk.ParameterError, match=rf"^{argument}\b.*: got .*wants"):
        pk.plot.phase_portrait(EIGHT, **{argument: value})


@pytest.mark.parametrize("system", [None, 3.0, (1.0, 2.0, 3.0), pk.Reduced([0.1, 0.2], 0.3)])
def test_a_wrong_system_is_named(system):
    with pytest.raises(pk.ParameterError, match="^system: got"):
        pk.plot.phase_portrait(system)


def test_a_wrong_call_draws_nothing(ax):
    with pytest.raises(pk.ParameterError):
        pk.plot.phase_portrait(EIGHT, orbits=[1.0], ax=ax)
    assert not ax.lines


@pytest.mark.parametrize("draw", [pk.plot.phase_portrait, pk.plot.potential_well])
@pytest.mark.parametrize(
    ("argument", "value"),
    [
        ("energies", 1e308),
        ("energies", [0.1, 1e308]),
        ("energies", True),
        ("energies", [[0.1, 0.2]]),
        ("energies", ["0.1"]),
        ("orbits", (1.0, 1e200)),
        ("orbits", (True, False)),
    ],
)
def test_what_cannot_be_drawn_is_refused(draw, argument, value):
    with pytest.raises(pk.ParameterError, match=f"^{argument}: got "):
        draw(EIGHT, **{argument: value})
    assert not plt.get_fignums()


def test_a_potential_beyond_the_doubles_is_refused():
    with pytest.raises(pk.ParameterError, match="^system: got "):
        pk.plot.phase_portrait(pk.Coefficients(1e308, 1e308, 0.0))
    ax = pk.plot.phase_portrait(pk.Coefficients(1e306, 1e305, 0.0), energies=1e307)
    assert np.isfinite(ax.get_ylim()).all()


def test_levels_are_colored_by_the_period_of_their_orbits():
    ax = pk.plot.phase_portrait(EIGHT, color_by="period")
    (bar,) = [other for other in ax.figure.axes if other is not ax]
    assert bar.get_ylabel() == "period (s)"
    low, high = bar.get_ylim()
    levels = [line for line in ax.lines if line.get_zorder() == 1]
    assert len(levels) > 15
    period = []
    for line in levels:
        phi, dphi = line.get_data()
        place = np.nanargmax(abs(dphi))
        period.append(pk.orbits(EIGHT, phi[place], dphi[place]).period.item())
        shade = np.log(period[-1] / low) / np.log(high / low)
        np.testing.assert_allclose(to_rgba(line.get_color()), style.LINES(shade), atol=0.02)
    np.testing.assert_allclose((low, high), (min(period), max(period)), rtol=1e-6)


@pytest.mark.parametrize(
    "quantity",
    ["period", *(pytest.param(x, marks=pytest.mark.slow) for x in ("frequency", "action"))],
)
@pytest.mark.parametrize("name", some([*SYSTEMS, "forceless"], 3))
def test_colors_for_every_system(quantity, name):
    system = SYSTEMS.get(name, FORCELESS)
    ax = pk.plot.phase_portrait(system, color_by=quantity, orbits=(0.3, 0.1))
    ax.figure.canvas.draw()
    (bar,) = [other for other in ax.figure.axes if other is not ax]
    assert quantity in bar.get_ylabel()
    assert 2 <= len(bar.get_yticks()) <= 9
    assert not looks_like(ax, style.LEVEL)
    box, picture = bar.get_tightbbox(), ax.figure.bbox
    assert box.x1 <= picture.x1
    assert ax.get_legend().get_window_extent().y0 >= picture.y0


def test_gray_is_the_look_without_colors():
    ax = pk.plot.phase_portrait(EIGHT)
    assert looks_like(ax, style.LEVEL)
    assert ax.figure.axes == [ax]
    assert len(pk.plot.phase_portrait(EIGHT, color_by="period").lines) > len(ax.lines)


def test_given_levels_are_colored_too(ax):
    pk.plot.phase_portrait(EIGHT, energies=[6.0], color_by="frequency", ax=ax)
    (up, down) = [line for line in ax.lines if line.get_zorder() == 1]
    assert up.get_color() == down.get_color()
    assert pk.plot.phase_portrait(EIGHT, energies=[], color_by="period").figure.axes[1:] == []


def test_a_level_of_infinite_period_has_the_last_color():
    energy_of_saddle = pk.separatrices(WINDING).saddle_energy.sel(saddle="upper").item()
    ax = pk.plot.phase_portrait(WINDING, energies=[0.0, energy_of_saddle], color_by="period")
    ax.figure.canvas.draw()


@pytest.mark.parametrize("wrong", ["colour", "phi_min", 1, ["period"]])
def test_a_wrong_color_is_named(wrong):
    with pytest.raises(pk.ParameterError, match="^color_by: got .*period, frequency, action"):
        pk.plot.phase_portrait(EIGHT, color_by=wrong)
    assert not plt.get_fignums()


def test_a_narrow_legend_has_two_columns_as_wide_as_the_figure():
    with plt.rc_context({"figure.figsize": (3.4, 2.6)}):
        disk = pk.GyroRotorDisk(beta=84 * pk.deg, e=0.05, a=0.012, r=0.2, omega1=31.4)
        starts = [(0.1, 0.0), (0.5, 1.0), (1.0, 2.0)]
        ax = pk.plot.phase_portrait(disk, orbits=starts, angles="deg")
    names = [text.get_text() for text in ax.get_legend().get_texts()]
    assert names[-3:] == ["from (5.73, 0)", "from (28.65, 57.3)", "from (57.3, 114.6)"]
    ax.figure.canvas.draw()
    box = ax.get_legend().get_window_extent()
    assert box.width > ax.get_window_extent().width
    assert 0 < box.x0 < box.x1 < ax.figure.bbox.width
    left = {round(text.get_window_extent().x0) for text in ax.get_legend().get_texts()}
    assert len(left) == 2
    plt.close(ax.figure)


@pytest.mark.slow
def test_equilibria_that_may_be_missing_are_announced():
    code = pk.Problem(lambda x: -x, ["x", "y", "z"], window=dict.fromkeys("xyz", (-1.0, 1.0)))
    with pytest.warns(UserWarning, match="phase_portrait: there may be other equilibria"):
        ax = pk.plot.phase_portrait(code)
    assert len(ax.lines) == 1
