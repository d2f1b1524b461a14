"""The potential well over the portrait: shared angles, chords where the motion is possible."""

import matplotlib.pyplot as plt
import numpy as np
import pytest

import phasekit as pk
from phasekit.plot.parts import style

EIGHT = pk.Coefficients(3.7, 1.3, 0.4)
NEGATIVE = pk.Coefficients(-4.1, 0.9, 0.35)


def potential(system, phi):
    A, B, C = system.coefficients()
    return -B * np.cos(phi) + 0.5 * A * np.cos(phi) ** 2 - C * np.sin(phi)


def test_two_panels_share_the_angle():
    well, portrait = pk.plot.potential_well(EIGHT)
    assert well.figure is portrait.figure
    assert well.get_shared_x_axes().joined(well, portrait)
    well.figure.canvas.draw()
    assert well.get_position().y0 > portrait.get_position().y1
    assert well.get_position().x0 == pytest.approx(portrait.get_position().x0)
    assert well.get_ylabel() == "$V$ (s$^{-2}$)"


@pytest.mark.parametrize("system", [EIGHT, NEGATIVE, pk.Pendulum(length=0.7)])
def test_the_curve_is_the_potential_and_the_points_lie_on_it(system):
    well, _ = pk.plot.potential_well(system)
    (curve,) = [line for line in well.lines if len(line.get_xdata()) > 500]
    np.testing.assert_allclose(curve.get_ydata(), potential(system, curve.get_xdata()), atol=1e-12)
    marks = [line for line in well.lines if line.get_label() in ("center", "saddle")]
    for mark in marks:
        np.testing.assert_allclose(mark.get_ydata(), potential(system, mark.get_xdata()), atol=1e-9)
    assert sum(mark.get_xdata().size for mark in marks) >= 2


@pytest.mark.parametrize("system", [EIGHT, NEGATIVE])
def test_chords_end_on_the_potential(system):
    well, _ = pk.plot.potential_well(system, legend=False)
    chords = [
        line for line in well.lines if np.nanmax(line.get_xdata()) < 9 and line.get_zorder() == 1
    ]
    assert len(chords) > 4
    for chord in chords:
        ends = chord.get_xdata()[np.isfinite(chord.get_xdata())]
        if np.ptp(ends) < 2 * np.pi - 1e-9:
            height = chord.get_ydata()[0]
            np.testing.assert_allclose(potential(system, ends), height, atol=1e-9)


def test_the_lobes_are_filled_in_the_well():
    well, _ = pk.plot.potential_well(EIGHT)
    assert len(well.collections) >= 2
    well, _ = pk.plot.potential_well(pk.Pendulum(length=0.7))
    assert not well.collections


def test_given_axes(ax):
    assert pk.plot.potential_well(EIGHT, ax=ax) is ax
    assert ax.get_xlabel() == r"$\varphi$ (rad)"
    pair = plt.figure().subplots(2)
    well, portrait = pk.plot.potential_well(EIGHT, ax=pair)
    assert well is pair[0]
    assert portrait is pair[1]
    assert portrait.lines


def test_a_fast_orbit_does_not_flatten_the_well():
    calm, _ = pk.plot.potential_well(EIGHT)
    wild, portrait = pk.plot.potential_well(EIGHT, orbits=(0.0, 300.0))
    assert np.ptp(wild.get_ylim()) < 3 * np.ptp(calm.get_ylim())
    assert portrait.get_ylim()[1] > 300.0


def test_degrees():
    well, portrait = pk.plot.potential_well(EIGHT, angles="deg")
    assert well.get_xlim() == portrait.get_xlim() == (-180.0, 180.0)


def test_no_force_is_a_flat_line():
    well, portrait = pk.plot.potential_well(pk.Coefficients(0.0, 0.0, 0.0))
    assert style.REST["label"] in [line.get_label() for line in portrait.lines]
    low, high = well.get_ylim()
    assert low < 0.0 < high


@pytest.mark.parametrize("wrong", [3, "top", [1, 2], (None, None), {}])
def test_wrong_axes_are_named(wrong):
    with pytest.raises(pk.ParameterError, match=r"^ax\b.*: got"):
        pk.plot.potential_well(EIGHT, ax=wrong)
