"""Sections and events of many motions of equations, against closed forms and SciPy."""

from __future__ import annotations

import numpy as np
import pytest
import xarray as xr
from scipy.integrate import solve_ivp

import phasekit as pk

LORENZ = {"x": "s*(y - x)", "y": "x*(r - z) - y", "z": "x*y - b*z"}
AT = {"s": 10.0, "r": 28.0, "b": 8.0 / 3.0}
CIRCLE = pk.Problem({"x": "y", "y": "-w^2*x"}, parameters={"w": [1.0, 2.0]})


def test_a_section_of_lorenz_is_that_of_scipy():
    starts = np.array([[1.0, 1.0, 20.0], [-3.0, 2.0, 25.0]])
    ds = pk.poincare_section(
        pk.Problem(LORENZ, parameters=AT), dict(zip("xyz", starts.T, strict=True)),
        section="z = r - 1", duration=6.0, direction=-1, rtol=1e-12,
    )  # fmt: skip
    assert ds.section_x.dims == ("point", "crossing")

    def plane(_, x):
        return x[2] - 27.0

    plane.direction = -1

    def f(_, x):
        return [10 * (x[1] - x[0]), x[0] * (28 - x[2]) - x[1], x[0] * x[1] - 8 * x[2] / 3]

    for k, start in enumerate(starts):
        truth = solve_ivp(f, (0, 6), start, method="DOP853", rtol=1e-13, atol=1e-13, events=plane)
        number = len(truth.t_events[0])
        assert ds.n_crossings[k] == number > 3
        own = ds.isel(point=k, crossing=slice(number))
        np.testing.assert_allclose(own.section_time, truth.t_events[0], atol=1e-8)
        np.testing.assert_allclose(own.section_x, truth.y_events[0][:, 0], atol=1e-6)
        np.testing.assert_allclose(own.section_z, 27.0, rtol=1e-14)
        assert np.isnan(ds.section_x[k, number:]).all()


@pytest.mark.parametrize(
    "section", [("x", 0.3), {"x": 0.3}, "x = 0.3", "x - 0.3", "(x - 0.3)*exp(y)"]
)
def test_sections_of_circles(section):
    """Of x = cos(w t) in all spellings, in cells of parameters and states."""
    radius = xr.DataArray([1.0, 2.0], dims="radius")
    ds = pk.poincare_section(CIRCLE, {"x": radius, "y": 0.0}, section=section, n=4, direction=1)
    assert ds.section_time.dims == ("w", "radius", "crossing")
    turns = 2.0 * np.pi * np.arange(1, 5)
    for i, w in enumerate((1.0, 2.0)):
        for j, r in enumerate((1.0, 2.0)):
            own = ds.isel(w=i, radius=j)
            wanted = (turns - np.arccos(0.3 / r)) / w
            np.testing.assert_allclose(own.section_time, wanted, rtol=1e-9)
            np.testing.assert_allclose(own.section_y, w * np.sqrt(r**2 - 0.09), rtol=1e-8)


def test_an_angle_is_met_whole_periods_off():
    """A steady turn meets its angle once a turn, one way; never in the middle."""
    turn = pk.Problem({"phi": "w", "r": "-r"}, parameters={"w": 3.0}, periods={"phi": 4.0})
    for level in (1.0, -3.0, 2.0):
        ds = pk.poincare_section(turn, [0.5, 1.0], section=("phi", level), duration=10.0)
        first = (np.mod(level, 4.0) - 0.5) / 3.0
        np.testing.assert_allclose(ds.section_time, first + 4.0 / 3.0 * np.arange(len(ds.crossing)))
        assert len(ds.crossing) == int((10.0 - first) / (4.0 / 3.0)) + 1
        assert set(ds.section_phi.values.tolist()) == {2.0 - np.mod(2.0 - level, 4.0)}
    with pytest.warns(RuntimeWarning, match="1 of 1 motions do not meet the section"):
        pk.poincare_section(turn, [0.5, 1.0], section=("phi", 1.0), duration=5.0, direction=-1)


def test_a_perturbed_system_has_sections_of_many_motions():
    damped = pk.Perturbed(pk.Coefficients(0.0, 1.0, 0.0), damping=0.1)
    ds = pk.poincare_section(damped, [0.0, 0.4], 1.0, duration=20.0, section=0.0)
    for k, start in enumerate((0.0, 0.4)):
        one = pk.poincare_section(damped, start, 1.0, duration=20.0, section=0.0)
        number = ds.n_crossings[k].item()
        assert number == one.sizes["crossing"]
        np.testing.assert_allclose(ds.section_dphi[k, :number], one.section_dphi, rtol=1e-8)
        np.testing.assert_allclose(ds.section_time[k, :number], one.section_time, rtol=1e-8)
    assert ds.section_dphi.attrs["units"] == one.section_dphi.attrs["units"]
    turns = pk.poincare_section(damped, 0.0, 1.0, section="dphi = 0", n=2, direction=0)
    np.testing.assert_allclose(turns.section_dphi, 0.0, atol=1e-15)
    swings = pk.poincare_section(pk.Pendulum(length=9.80665), 0.2, [0.5, 1.0], section=0.0, n=3)
    np.testing.assert_allclose(swings.section_dphi.std("crossing"), 0.0, atol=1e-9)


def test_a_python_function_has_the_same_sections():
    def f(x, w):
        return [x[1], -(w**2) * x[0]]

    plain = pk.Problem(f, ("x", "y"), {"w": 2.0})
    ds = pk.poincare_section(plain, {"x": [1.0, 2.0], "y": 0.0}, section="x + y = 0.3", n=3)
    same = pk.poincare_section(
        CIRCLE.replace(w=2.0), {"x": [1.0, 2.0], "y": 0.0}, section="x + y = 0.3", n=3
    )
    np.testing.assert_allclose(ds.section_time, same.section_time, rtol=1e-8)


def test_what_does_not_come_to_a_section_is_counted():
    with pytest.warns(RuntimeWarning, match="2 of 4 motions meet the section less than 2 times"):
        ds = pk.poincare_section(
            CIRCLE, {"x": [1.0, 2.0], "y": 0.0}, section="x = 1.5", n=2, duration=20.0
        )
    assert ds.n_crossings.values.tolist() == [[0, 2], [0, 2]]
    bursts = pk.Problem({"x": "x^2 + 1"})
    with pytest.warns(RuntimeWarning) as told:
        pk.poincare_section(bursts, [0.0], section="x = -1", duration=9.0)
    assert any("run to infinity" in str(one.message) for one in told)


def test_events_of_cells_end_motions_each_at_its_own():
    """Of x = r cos(w t): down through 0.5 the second time."""
    half = pk.Event("x - 1/2", terminal=2, direction=-1)
    t = np.linspace(0.0, 10.0, 101)
    ds = pk.flow(CIRCLE, {"x": [1.0, 2.0], "y": 0.0}, t, events={"half": half, "top": "y"})
    for i, w in enumerate((1.0, 2.0)):
        for j, r in enumerate((1.0, 2.0)):
            own = ds.isel(w=i, point=j)
            times = own.event_time.values[own.event_name.values == "half"]
            wanted = (np.arccos(0.5 / r) + 2.0 * np.pi * np.arange(2)) / w
            np.testing.assert_allclose(times, wanted, rtol=1e-9)
            tops = own.event_time.values[own.event_name.values == "top"]
            np.testing.assert_allclose(tops, np.pi / w * np.arange(3), atol=1e-9)
            np.testing.assert_array_equal(np.isnan(own.motion_x), t > wanted[-1])
            assert own.n_events == 5
    back = pk.flow(CIRCLE.replace(w=1.0), [1.0, 0.0], [-4.0, 2.0], events={"zero": "x"})
    np.testing.assert_allclose(back.event_time, [-np.pi / 2, np.pi / 2], rtol=1e-9)
    timed = pk.flow(CIRCLE.replace(w=1.0), [1.0, 0.0], [3.0], events={"noon": "t - 1"})
    np.testing.assert_allclose(timed.event_x, np.cos(1.0), rtol=1e-9)


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda s: s(section="x = 0"), "duration: got None, wants a time .* or a number"),
        (lambda s: s(section=("q", 0.0), n=1), "section: state 'q' is unknown"),
        (lambda s: s(section="q - 1", n=1), "section: got the unknown symbol q"),
        (lambda s: s(section="w - 1", n=1), "section: got 'w - 1', wants a state"),
        (lambda s: s(section=0.3, n=1), "section: got 0.3, wants a state with its value"),
        (lambda s: s(section="np.sin(x)", n=1), r"section: .*sin\(x\)"),
        (lambda s: s(section="x", n=0), "n: got 0"),
        (lambda s: s(section="x", n=1, direction=2), "direction: got 2"),
        (lambda s: s(section="x", duration=-1.0), "duration: got -1"),
        (
            lambda s: pk.flow(CIRCLE, [1.0, 0.0], 1.0, events={"half": "q"}),
            r"events\['half'\]: got the unknown symbol q",
        ),
        (lambda s: pk.flow(CIRCLE, [1.0, 0.0], 1.0, events={3: "x"}), "names that are strings"),
    ],
)
def test_what_is_wrong_is_said_before_any_work(call, message):
    with pytest.raises(pk.ParameterError, match=message):
        call(lambda **how: pk.poincare_section(CIRCLE, [1.0, 0.0], **how))
