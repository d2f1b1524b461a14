"""Periods and frequencies of whole portraits: pendulum formulas, array functions, walls."""

import matplotlib.pyplot as plt
import numpy as np
import pytest
from scipy.special import ellipe, ellipk

import phasekit as pk
from phasekit.phase.exact.orbits import orbits_at_energy
from phasekit.plot.parts import style

EIGHT = pk.Coefficients(3.7, 1.3, 0.4)
WINDING = pk.Coefficients(1.1, 2.3, 0.6)
HETEROCLINIC = pk.Coefficients(-4.1, 0.9, 0.0)
FOLD = pk.Coefficients(125.0, 27.0, 64.0)
PENDULUM = pk.Pendulum(length=0.7, g=9.81)
SYSTEMS = {
    "eight": EIGHT,
    "winding": WINDING,
    "heteroclinic": HETEROCLINIC,
    "fold": FOLD,
    "pendulum": PENDULUM,
    "disk": pk.GyroRotorDisk(beta=1.4, e=0.05, a=0.012, r=0.2, omega1=31.4),
}
DRAW = (pk.plot.period_energy, pk.plot.frequency_action)
CURVES = {look["label"]: family for family, look in style.FAMILIES.items()} | {
    "oscillation": "lower_well"
}


def curves(ax):
    """The drawn families by name."""
    return {CURVES[line.get_label()]: line for line in ax.lines if line.get_label() in CURVES}


def walls(ax):
    return {
        line.get_label(): line.get_xdata()[0]
        for line in ax.lines
        if line.get_label().startswith("energy of")
    }


def dots(ax):
    (line,) = [line for line in ax.lines if line.get_marker() == "o"]
    return line.get_data()


@pytest.mark.slow
@pytest.mark.parametrize("draw", DRAW)
@pytest.mark.parametrize("name", SYSTEMS)
def test_returns_the_given_axes_with_a_curve_for_each_family(draw, name, ax):
    assert draw(SYSTEMS[name], ax=ax) is ax
    families = pk.orbit_families(SYSTEMS[name])
    present = {
        str(f) for f in families.family.values if families.period.sel(family=f).notnull().any()
    }
    assert set(curves(ax)) == present
    ax.figure.canvas.draw()
    assert ax.get_legend().get_window_extent().y1 < ax.get_window_extent().y0


def test_the_period_of_a_pendulum():
    ax = pk.plot.period_energy(PENDULUM)
    rate = np.sqrt(9.81 / 0.7)
    h, period = curves(ax)["lower_well"].get_data()
    m = 0.5 * (1.0 + h / rate**2)
    inside = (m > 1e-6) & (m < 0.999)
    np.testing.assert_allclose(period[inside], 4 * ellipk(m[inside]) / rate, rtol=1e-10)
    h, period = curves(ax)["rotation"].get_data()
    m = 2.0 / (1.0 + h / rate**2)
    outside = m < 0.999
    np.testing.assert_allclose(
        period[outside], 2 * np.sqrt(m[outside]) * ellipk(m[outside]) / rate, rtol=1e-10
    )


def test_the_frequency_of_a_pendulum():
    ax = pk.plot.frequency_action(PENDULUM)
    rate = np.sqrt(9.81 / 0.7)
    J, frequency = curves(ax)["lower_well"].get_data()
    m = np.linspace(1e-6, 0.99, 300)
    action = 8 / np.pi * rate * (ellipe(m) - (1 - m) * ellipk(m))
    expected = np.pi * rate / (2 * ellipk(m))
    np.testing.assert_allclose(np.interp(action, J, frequency), expected, rtol=1e-3)
    assert J[0] == 0.0
    assert frequency[0] == pytest.approx(rate, rel=1e-14)
    assert frequency[-1] == 0.0
    assert J[-1] == pytest.approx(8 / np.pi * rate, rel=1e-6)


def test_curves_are_those_of_the_array_function():
    ax = pk.plot.period_energy(EIGHT)
    for family, center in (("lower_well", 0), ("upper_well", 1)):
        h, period = (values[1:150] for values in curves(ax)[family].get_data())
        expected = orbits_at_energy(*EIGHT.coefficients(), h, center).period
        np.testing.assert_allclose(period, expected, rtol=1e-8)


def test_both_wells_lie_on_one_curve():
    ax = pk.plot.period_energy(EIGHT)
    lower, upper = (curves(ax)[name] for name in ("lower_well", "upper_well"))
    h, period = (values[1:120] for values in upper.get_data())
    np.testing.assert_allclose(np.interp(h, *lower.get_data()), period, rtol=1e-3)
    assert lower.get_linestyle() == "-" != upper.get_linestyle()
    assert lower.get_linewidth() > upper.get_linewidth()


def test_walls_stand_at_the_saddles_and_dots_at_the_centers():
    ax = pk.plot.period_energy(EIGHT)
    loops, points = pk.separatrices(EIGHT), pk.equilibria(EIGHT)
    assert walls(ax) == {
        f"energy of the {saddle} saddle": loops.saddle_energy.sel(saddle=saddle).item()
        for saddle in ("lower", "upper")
    }
    x, y = dots(ax)
    centers = points.sel(equilibrium=["lower_center", "upper_center"])
    np.testing.assert_array_equal(x, centers.energy)
    np.testing.assert_allclose(y, 2 * np.pi / centers.natural_frequency)
    x, y = dots(pk.plot.frequency_action(EIGHT))
    np.testing.assert_array_equal(x, 0.0)
    np.testing.assert_array_equal(y, centers.natural_frequency)


@pytest.mark.parametrize("name", ["eight", "winding", "heteroclinic", "pendulum"])
def test_walls_are_drawn_out_of_the_picture(name):
    ax = pk.plot.period_energy(SYSTEMS[name])
    top = ax.get_ylim()[1]
    heights = walls(ax).values()
    for family, line in curves(ax).items():
        h, period = line.get_data()
        if family != "rotation":
            assert period[-1] > top
            assert min(abs(h[-1] - wall) for wall in heights) < 1e-8 * np.ptp(h)
        if family in ("outer", "rotation"):
            assert period[0] > top
        # No step can be seen: where neighbors are far apart, the curve is flat or upright.
        across, up = np.diff(h) / np.ptp(ax.get_xlim()), abs(np.diff(np.minimum(period, top))) / top
        assert np.minimum(across, up).max() < 0.01
        assert across.max() < 0.03


def test_every_family_ends_at_its_separatrix_action():
    ax = pk.plot.frequency_action(EIGHT)
    loops = pk.separatrices(EIGHT)
    lobes = loops.lobe_area.sel(saddle="lower").values / (2 * np.pi)
    winding = loops.winding_area.sel(saddle="upper").item() / (2 * np.pi)
    drawn = curves(ax)
    ends = {name: line.get_xdata()[[0, -1]] for name, line in drawn.items()}
    wells = sorted([ends["lower_well"][1], ends["upper_well"][1]])
    np.testing.assert_allclose(wells, np.sort(lobes), rtol=1e-6)
    np.testing.assert_allclose(ends["outer"], [lobes.sum(), 2 * winding], rtol=1e-6)
    np.testing.assert_allclose(ends["rotation"][0], winding, rtol=1e-6)
    for name, line in drawn.items():
        y = line.get_ydata()
        assert (y[0] == 0.0) == (name in ("outer", "rotation"))
        assert (y[-1] == 0.0) == (name != "rotation")


def test_one_well_is_not_called_lower():
    ax = pk.plot.period_energy(WINDING)
    texts = [text.get_text() for text in ax.get_legend().get_texts()]
    assert texts == ["oscillation", "rotation", "energy of the saddle", "small oscillations"]


def test_the_period_is_infinite_at_a_degenerate_point():
    points = pk.equilibria(FOLD)
    level = points.energy.sel(equilibrium="lower_saddle").item()
    ax = pk.plot.period_energy(FOLD)
    assert walls(ax)["energy of the degenerate point"] == level
    h, period = curves(ax)["lower_well"].get_data()
    assert (np.diff(h) >= 0.0).all()
    assert period[h == level].item() > ax.get_ylim()[1]
    _, frequency = curves(pk.plot.frequency_action(FOLD))["lower_well"].get_data()
    assert frequency[1:-1].min() == 0.0


def test_labels():
    ax = pk.plot.period_energy(EIGHT)
    assert (ax.get_xlabel(), ax.get_ylabel()) == ("energy $h$ (s$^{-2}$)", "period $T$ (s)")
    ax = pk.plot.frequency_action(EIGHT)
    assert ax.get_xlabel() == "action $J$ (rad$^2$/s)"
    assert ax.get_ylabel() == r"frequency $\omega$ (rad/s)"


@pytest.mark.parametrize("draw", DRAW)
def test_number_and_greatest_energy(draw):
    ax = draw(EIGHT, 40, energy_max=20.0)
    rotation = curves(ax)["rotation"].get_xdata()
    assert 40 <= rotation.size <= 41
    short = curves(draw(EIGHT, 40))["rotation"].get_xdata()
    assert rotation[-1] > short[-1]
    assert "rotation" not in curves(draw(EIGHT, energy_max=0.0))


@pytest.mark.slow
@pytest.mark.parametrize("draw", DRAW)
@pytest.mark.parametrize("scale", [1e-100, 1e100])
def test_the_picture_does_not_depend_on_the_scale(draw, scale):
    plain, scaled = draw(EIGHT), draw(pk.Coefficients(*(scale * c for c in EIGHT)))
    ratio = np.divide(scaled.get_ylim()[1], plain.get_ylim()[1])
    expected = scale**-0.5 if draw is pk.plot.period_energy else scale**0.5
    assert ratio == pytest.approx(expected, rel=1e-9)
    scaled.figure.canvas.draw()


@pytest.mark.parametrize("draw", DRAW)
@pytest.mark.parametrize(
    ("system", "options", "message"),
    [
        (None, {}, "^system: got"),
        (pk.Reduced([0.1, 0.2], 0.3), {}, "^system: got array parameters"),
        (pk.Coefficients(0.0, 0.0, 0.0), {}, "^system: got .* a force"),
        (EIGHT, {"n": 0}, "^n: got"),
        (EIGHT, {"energy_max": "high"}, "^energy_max: got"),
        (EIGHT, {"ax": plt}, "^ax: got"),
    ],
)
def test_wrong_arguments_are_named(draw, system, options, message):
    with pytest.raises(pk.ParameterError, match=message):
        draw(system, **options)
    assert not plt.get_fignums()


@pytest.mark.parametrize("draw", DRAW)
def test_no_legend(draw):
    assert draw(EIGHT, legend=False).get_legend() is None


@pytest.mark.parametrize("draw", DRAW)
@pytest.mark.parametrize("system", [(1.0, 1.0, 0.0), (-1.0, 1.0, 0.0), (1.0, 0.0, 1.0)])
def test_cusps_are_drawn(draw, system):
    """At a center-like cusp there are no small oscillations to begin with."""
    _, ax = plt.subplots()
    draw(pk.Coefficients(*system), 20, ax=ax, legend=False)
    assert len([line for line in ax.lines if len(line.get_xdata()) > 10]) == 2
    assert np.isfinite([*ax.get_xlim(), *ax.get_ylim()]).all()


@pytest.mark.slow
@pytest.mark.parametrize("draw", [pk.plot.period_energy, pk.plot.frequency_action])
def test_families_of_any_potential(draw):
    well = pk.Potential("x^4/4 - x^2/2 + x/10", "x")
    ax = draw(well, 20)
    names = [text.get_text() for text in ax.get_legend().get_texts()]
    assert {"well 0", "well 2", "wells 0, 2", "small oscillations"} <= set(names)
    ds = pk.orbit_families(well, 20)
    x, y = ("energy_level", "period") if draw is pk.plot.period_energy else ("action", "frequency")
    lines = {line.get_label(): line for line in ax.lines}
    for label, family in (("well 0", "well_0"), ("wells 0, 2", "wells_0_2")):
        first = 1
        np.testing.assert_allclose(
            lines[label].get_xdata()[first : first + 20], ds[x].sel(family=family)
        )
        np.testing.assert_allclose(
            lines[label].get_ydata()[first : first + 20], ds[y].sel(family=family)
        )
