"""Motions over time: the lines are the motions, in the units that the labels say."""

import functools

import matplotlib.pyplot as plt
import numpy as np
import pytest
import xarray as xr

import phasekit as pk

SYSTEM = pk.Coefficients(3.7, 1.3, 0.4)
TIMES = np.linspace(0.0, 12.0, 241)


@functools.cache
def one():
    """A motion."""
    return pk.flow(SYSTEM, 1.8, 0.2, TIMES)


@functools.cache
def several():
    """Motions from three states."""
    return pk.flow(SYSTEM, [1.8, 1.8, 0.2], [0.0, 1.0, 2.4], TIMES)


def legend_texts(ax):
    return [text.get_text() for text in ax.get_legend().get_texts()]


def ticks(ax):
    ax.figure.canvas.draw()
    return [tick.get_text() for tick in ax.get_yticklabels()]


def test_one_motion_is_one_line_without_legend(ax):
    assert pk.plot.time_history(one(), ax=ax) is ax
    (line,) = ax.lines
    np.testing.assert_array_equal(line.get_xdata(), TIMES)
    np.testing.assert_array_equal(line.get_ydata(), one().motion_phi)
    assert ax.get_legend() is None
    assert ax.get_xlim() == (0.0, 12.0)
    assert ax.get_xlabel() == "$t$ (s)"
    assert ax.get_ylabel() == r"$\varphi$ (rad)"


def test_a_small_oscillation_is_a_cosine():
    pendulum = pk.Pendulum(length=9.81, g=9.81)
    ax = pk.plot.time_history(pk.flow(pendulum, 1e-6, 0.0, TIMES))
    np.testing.assert_allclose(ax.lines[0].get_ydata(), 1e-6 * np.cos(TIMES), atol=1e-15)


def test_the_angular_velocity():
    ax = pk.plot.time_history(one(), "motion_dphi")
    np.testing.assert_array_equal(ax.lines[0].get_ydata(), one().motion_dphi)
    assert ax.get_ylabel() == r"$\dot\varphi$ (rad/s)"


@pytest.mark.parametrize(("variable", "unit"), [("motion_phi", "°"), ("motion_dphi", "°/s")])
def test_degrees(variable, unit):
    ax = pk.plot.time_history(one(), variable, angles="deg")
    np.testing.assert_allclose(ax.lines[0].get_ydata(), np.degrees(one()[variable]))
    assert ax.get_ylabel().endswith(f"({unit})")


def test_several_motions_are_told_by_what_differs():
    ax = pk.plot.time_history(several())
    assert legend_texts(ax) == [
        "$\\varphi_0$ = 1.8\xa0rad, $\\dot\\varphi_0$ = 0\xa0rad/s",
        "$\\varphi_0$ = 1.8\xa0rad, $\\dot\\varphi_0$ = 1\xa0rad/s",
        "$\\varphi_0$ = 0.2\xa0rad, $\\dot\\varphi_0$ = 2.4\xa0rad/s",
    ]
    for line, motion in zip(ax.lines, several().motion_phi, strict=True):
        np.testing.assert_array_equal(line.get_ydata(), motion)
    looks = {(line.get_color(), str(line.get_linestyle())) for line in ax.lines}
    assert len(looks) == 3
    ax.figure.canvas.draw()
    assert ax.get_legend().get_window_extent().y1 < ax.get_window_extent().y0
    assert pk.plot.time_history(several(), legend=False).get_legend() is None


def test_motions_of_several_systems_are_told_by_the_parameter():
    disk = pk.GyroRotorDisk(beta=[0.1, 1.4], e=0.05, a=0.012, r=0.2, omega1=31.4)
    ds = pk.flow(disk, 0.3, 0.0, np.linspace(0.0, 1.0, 51))
    assert legend_texts(pk.plot.time_history(ds)) == [
        "$\\beta$ = 0.1\xa0rad",
        "$\\beta$ = 1.4\xa0rad",
    ]
    assert legend_texts(pk.plot.time_history(ds, angles="deg"))[0] == "$\\beta$ = 5.73°"


def test_all_combinations_of_two_dims():
    phi = xr.DataArray([0.5, 1.0], dims="p")
    dphi = xr.DataArray([0.0, 1.0, 3.0], dims="q")
    ds = pk.flow(SYSTEM, phi, dphi, xr.DataArray(TIMES, dims="t"))
    ax = pk.plot.time_history(ds, "motion_dphi")
    np.testing.assert_array_equal(
        [line.get_ydata() for line in ax.lines],
        ds.motion_dphi.transpose("p", "q", "t").values.reshape(6, -1),
    )
    assert len(set(legend_texts(ax))) == 6


def test_motions_that_nothing_tells_are_numbered():
    sides = [pk.separatrix_motion(SYSTEM, TIMES, side=side) for side in ("left", "right")]
    ax = pk.plot.time_history(xr.concat(sides, "side"))
    assert legend_texts(ax) == ["side 0", "side 1"]
    named = xr.concat(sides, xr.DataArray(["left", "right"], dims="side", name="side"))
    assert legend_texts(pk.plot.time_history(named)) == ["side left", "side right"]


def test_a_separatrix_tends_to_its_saddle():
    times = np.linspace(-15.0, 15.0, 301)
    ax = pk.plot.time_history(pk.separatrix_motion(SYSTEM, times))
    saddle = pk.separatrices(SYSTEM).saddle_phi.sel(saddle="lower").item()
    np.testing.assert_allclose(ax.lines[0].get_ydata()[[0, -1]], saddle, atol=1e-6)


def test_wide_angles_have_ticks_at_quarter_turns():
    turning = pk.flow(SYSTEM, 1.8, 5.0, TIMES)
    ax = pk.plot.time_history(turning)
    assert ax.lines[0].get_ydata()[-1] > 4 * np.pi  # not wrapped
    assert all(r"\pi" in text or text == "0" for text in ticks(ax))
    steps = np.diff(pk.plot.time_history(turning, angles="deg").get_yticks()) / 90.0
    np.testing.assert_allclose(steps, np.round(steps))
    assert len(ax.get_yticks()) <= 12
    assert not any(r"\pi" in text for text in ticks(pk.plot.time_history(one())))


@pytest.mark.parametrize("turns", [1e2, 1e4, 1e7])
def test_many_turns_have_few_ticks(turns):
    times = np.linspace(0.0, 1.0, 11)
    ax = pk.plot.time_history(pk.flow(SYSTEM, 0.0, 2 * np.pi * turns, times))
    low, high = ax.get_ylim()
    assert 3 <= sum(low <= tick <= high for tick in ax.get_yticks()) <= 9


def test_any_number_along_time_can_be_drawn():
    ds = one().assign(
        height=one().motion_phi.copy(data=-np.cos(one().motion_phi)).assign_attrs(units="m")
    )
    ax = pk.plot.time_history(ds, "height")
    np.testing.assert_array_equal(ax.lines[0].get_ydata(), ds.height)
    assert "(m)" in ax.get_ylabel()


def test_falling_times():
    ax = pk.plot.time_history(pk.flow(SYSTEM, 1.8, 0.2, -TIMES))
    assert ax.get_xlim() == (-12.0, 0.0)


@pytest.mark.parametrize(
    ("dataset", "message"),
    [
        (lambda: None, "^dataset: got .*pk.flow"),
        (lambda: SYSTEM, "^dataset: got .*pk.flow"),
        (lambda: pk.equilibria(SYSTEM), "^dataset: got .*pk.flow"),
        (lambda: pk.flow(SYSTEM, 1.8, 0.2, 3.0), "^dataset: got .*pk.flow"),
        (lambda: pk.flow(SYSTEM, 1.8, 0.2, [3.0]), "^time: got .*at least two"),
        (lambda: pk.flow(SYSTEM, 1.8, 0.2, [3.0, 1.0, 2.0]), "^time: got .*order"),
        (
            lambda: pk.flow(SYSTEM, np.zeros(21), 0.2, TIMES),
            r"^dataset: got 21 motions \(point: 21\)",
        ),
        (lambda: several().isel(point=[]), r"^dataset: got 0 motions"),
    ],
)
def test_a_wrong_dataset_is_named(dataset, message):
    given = dataset()
    with pytest.raises(pk.ParameterError, match=message):
        pk.plot.time_history(given)
    assert not plt.get_fignums()


@pytest.mark.parametrize(
    ("argument", "value"), [("variable", "phi"), ("angles", "turns"), ("ax", "left")]
)
def test_wrong_arguments_are_named(argument, value):
    with pytest.raises(pk.ParameterError, match=f"^{argument}"):
        pk.plot.time_history(one(), **{argument: value})


def test_twenty_motions_can_be_told_apart():
    ax = pk.plot.time_history(pk.flow(SYSTEM, np.linspace(0.0, 3.0, 20), 0.0, TIMES))
    assert len({(line.get_color(), str(line._unscaled_dash_pattern)) for line in ax.lines}) == 20
