"""Portraits and wells of any potential, on a line and on a circle."""

import matplotlib.pyplot as plt
import numpy as np
import pytest

import phasekit as pk
from phasekit.plot.parts import style
from phasekit.plot.phase_portrait import curves_of
from phasekit.systems.potential import Potential

WELL = Potential("x^4/4 - x^2/2", "x")
CUBIC = Potential("x^2/2 - x^3/3", "x")
ANGLE = Potential("-cos(q) + 0.6*cos(2*q) - 0.3*sin(q)", "q", period=2 * np.pi)
MORSE = Potential("2*(1 - exp(-x))^2", "x", interval=(-1.0, 6.0))


def drawn(ax, look):
    return [
        line
        for line in ax.get_lines()
        if line.get_color() == look["color"]
        and line.get_linewidth() == look["linewidth"]
        and len(line.get_xdata()) > 2
    ]


@pytest.mark.parametrize("system", [WELL, CUBIC, ANGLE, MORSE])
def test_every_curve_lies_on_a_level(system):
    ax = pk.plot.phase_portrait(system)
    energies = pk.separatrices(system).saddle_energy.values
    for look in (style.LEVEL, style.ROTATION, style.EIGHT):
        for line in drawn(ax, look):
            x, v = np.asarray(line.get_xdata()), np.asarray(line.get_ydata())
            h = 0.5 * v**2 + system.potential(x)
            np.testing.assert_allclose(h, h[0], atol=1e-9 * (1 + abs(h[0])))
            if look is style.EIGHT:
                assert np.min(np.abs(energies - h[0])) < 1e-9
    assert drawn(ax, style.LEVEL)


def test_the_lobes_of_an_eight_are_filled():
    ax = pk.plot.phase_portrait(WELL)
    areas = []
    for patch in ax.patches:
        x, y = patch.get_xy().T
        areas.append(abs(0.5 * np.sum(x[:-1] * np.diff(y) - y[:-1] * np.diff(x))))
    np.testing.assert_allclose(areas, 4 / 3, rtol=1e-3)
    assert not pk.plot.phase_portrait(CUBIC).patches


def test_names_and_window_of_a_line():
    well, portrait = pk.plot.potential_well(MORSE)
    assert portrait.get_xlim() == well.get_xlim() == (-1.0, 6.0)
    assert portrait.get_xlabel() == "$x$"
    assert well.get_xlabel() == ""


def test_an_angle_may_be_shown_in_degrees():
    ax = pk.plot.phase_portrait(ANGLE, angles="deg")
    assert ax.get_xlim() == (-180.0, 180.0)
    assert "°" in ax.get_xlabel()


def test_levels_orbits_and_colors():
    ax = pk.plot.phase_portrait(
        WELL, energies=[-0.1, 0.2], orbits=[[1.2, 0.0], [0.0, 1.0]], color_by="period"
    )
    assert len(ax.figure.axes) == 2  # with the color bar
    texts = [text.get_text() for text in ax.get_legend().get_texts()]
    assert {"figure-eight", "center", "saddle", "from (1.2, 0)", "from (0, 1)"} == set(texts)


def test_one_panel_may_be_given():
    _, ax = plt.subplots()
    assert pk.plot.potential_well(CUBIC, ax=ax, energies=[], orbits=[0.2, 0.1]) is ax
    assert ax.get_xlabel() == "$x$"


def test_diagram_of_a_map():
    mu = np.linspace(-1.0, 2.0, 31)
    ds = pk.sweep(Potential("x^4/4 - mu*x^2/2", "x", {"mu": 1.0}), mu=mu, of="equilibria")
    ax = pk.plot.bifurcation_diagram(ds)
    points = {line.get_label(): line.get_xydata() for line in ax.get_lines()}
    x, y = points["center"].T
    np.testing.assert_allclose(y**2, np.where(x > 0, x, 0.0), atol=1e-14)
    assert len(x) == 10 + 2 * 20
    assert np.all(points["saddle"][:, 0] > 0)
    np.testing.assert_allclose(points["degenerate"], [[0.0, 0.0]], atol=1e-5)


# Turning points of the double well at the energy -0.1
INNER, OUTER = np.sqrt(1.0 + np.array([-1.0, 1.0]) * np.sqrt(0.6))


def test_arcs_are_where_the_potential_is_lower():
    land = curves_of(WELL)
    np.testing.assert_allclose(land.arcs(-0.1), [(-OUTER, -INNER), (INNER, OUTER)], rtol=1e-14)
    np.testing.assert_allclose(land.arcs(0.0), [(-(2**0.5), 0.0), (0.0, 2**0.5)], atol=1e-15)
    assert land.arcs(-1.0) == []


@pytest.mark.parametrize(
    ("system", "options", "message"),
    [
        (WELL, {"angles": "deg"}, "^angles: got 'deg'"),
        (WELL, {"energies": "many"}, "^energies: got"),
        (Potential("cos(x)", "x"), {}, "^interval: got None"),
        (Potential("k*x^2", "x", {"k": [1.0, 2.0]}), {}, "wants a single system"),
    ],
)
def test_what_cannot_be_drawn_is_refused(system, options, message):
    for draw in (pk.plot.phase_portrait, pk.plot.potential_well):
        with pytest.raises(pk.ParameterError, match=message):
            draw(system, **options)
    assert not plt.get_fignums()
