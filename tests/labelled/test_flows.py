"""Motions of systems with states of their own, against SciPy's integrators and by hand."""

from __future__ import annotations

import pickle

import numba
import numpy as np
import pytest
import xarray as xr
from scipy.integrate import solve_ivp

import phasekit as pk

NEURON = {"v": "v - v**3/3 - w + I", "w": "eps*(v + a - b*w)"}
VALUES = {"I": 0.5, "eps": 0.08, "a": 0.7, "b": 0.8}
LORENZ = ["s*(y - x)", "x*(r - z) - y", "x*y - b*z"]
AT = {"s": 10.0, "r": 28.0, "b": 8.0 / 3.0}
HENON = {"x": "1 - a*x^2 + y", "y": "b*x"}


def neuron(**changes):
    return pk.Problem(NEURON, parameters={**VALUES, **changes})


def scipys(f, x0, t, **how):
    how = {"method": "DOP853", "rtol": 1e-13, "atol": 1e-13, **how}
    return solve_ivp(f, (0.0, t[-1]), x0, t_eval=t, **how).y


def test_motions_are_those_of_scipy():
    t = np.linspace(0.0, 60.0, 121)
    for current in (0.0, 0.5):
        ds = pk.flow(neuron(I=current), [-1.0, -0.5], t)

        def f(_, x, current=current):
            return [x[0] - x[0] ** 3 / 3 - x[1] + current, 0.08 * (x[0] + 0.7 - 0.8 * x[1])]

        truth = scipys(f, [-1.0, -0.5], t)
        np.testing.assert_allclose(ds.motion_v, truth[0], atol=1e-8)
        np.testing.assert_allclose(ds.motion_w, truth[1], atol=1e-8)
        assert np.ptp(ds.motion_v.values) > 0.1


def test_cells_are_parameters_and_states_and_times():
    system = neuron(I=[0.0, 0.3, 0.5], b=xr.DataArray([0.7, 0.8], dims="kind"))
    t = [5.0, 0.0, -1.0]
    ds = pk.flow(system, {"v": [-1.0, 0.2], "w": 0.1}, t)
    assert ds.motion_v.dims == ("I", "kind", "point", "time")
    assert ds.motion_v.shape == (3, 2, 2, 3)
    one = pk.flow(neuron(I=0.3, b=0.7), v=0.2, w=0.1, t=5.0)
    own = ds.isel(I=1, kind=0, point=1, time=0)
    assert own.motion_v.item() == one.motion_v.item()
    assert own.motion_w.item() == one.motion_w.item()
    np.testing.assert_array_equal(ds.motion_v.isel(time=1).isel(point=1), 0.2)
    back = ds.isel(I=2, kind=1).phasekit.system()
    assert back == neuron(I=0.5, b=0.8)


@numba.njit
def njit_lorenz(x, s, r, b):
    return np.array([s * (x[1] - x[0]), x[0] * (r - x[2]) - x[1], x[0] * x[1] - b * x[2]])


def plain_lorenz(x, s, r, b):
    return [s * (x[1] - x[0]), x[0] * (r - x[2]) - x[1], x[0] * x[1] - b * x[2]]


@pytest.mark.slow
def test_formulas_and_functions_move_alike():
    names = ("x", "y", "z")
    t, start = [0.5, 2.0], [1.0, 1.0, 1.0]
    found = [
        pk.flow(pk.Problem(f, names, AT), start, t) for f in (LORENZ, njit_lorenz, plain_lorenz)
    ]
    truth = scipys(lambda _, x: plain_lorenz(x, *AT.values()), start, t)
    for ds in found:
        for name, row in zip(names, truth, strict=True):
            np.testing.assert_allclose(ds[f"motion_{name}"], row, rtol=1e-8)


def test_named_classes_move_with_units():
    class Decay(pk.System):
        rate = pk.parameter("s-1", "rate of the decay", positive=True)
        states = {"n": ("mol", "amount")}
        rates = {"n": "-rate*n"}

    ds = pk.flow(Decay(rate=[0.5, 2.0]), n=3.0, t=[0.0, 1.0, 2.0])
    wanted = 3.0 * np.exp(-np.outer([0.5, 2.0], [0.0, 1.0, 2.0]))
    np.testing.assert_allclose(ds.motion_n, wanted, rtol=1e-9)
    assert ds.motion_n.attrs["units"] == "mol"
    assert ds.motion_n.dims == ("rate", "time")


def test_a_map_is_iterated():
    henon = pk.Problem(HENON, parameters={"a": 1.4, "b": 0.3}, map=True)
    counts = [3, 0, 50, 1]
    ds = pk.flow(henon, [[0.1, 0.2], [0.0, 0.1]], counts)
    for point, start in enumerate(((0.1, 0.0), (0.2, 0.1))):
        x, y = start
        orbit = [(x, y)]
        for _ in range(50):
            x, y = 1.0 - 1.4 * x * x + y, 0.3 * x
            orbit.append((x, y))
        got = np.stack([ds.motion_x[point], ds.motion_y[point]], axis=-1)
        np.testing.assert_allclose(got, [orbit[k] for k in counts], rtol=1e-6)
    assert ds.time.attrs["units"] == "1"
    with pytest.warns(RuntimeWarning, match="no whole numbers"):
        assert np.isnan(pk.flow(henon, [0.0, 0.0], 1.5).motion_x)


def test_a_forced_system_moves_in_time():
    duffing = pk.Problem(
        {"x": "v", "v": "F*cos(w*t) - d*v - x - x**3"},
        parameters={"d": 0.1, "F": 0.3, "w": 1.3}, time="t", period="2*pi/w",
    )  # fmt: skip
    t = np.linspace(0.0, 20.0, 11)
    truth = scipys(
        lambda t, x: [x[1], 0.3 * np.cos(1.3 * t) - 0.1 * x[1] - x[0] - x[0] ** 3], [0.1, 0.0], t
    )
    np.testing.assert_allclose(pk.flow(duffing, [0.1, 0.0], t).motion_x, truth[0], atol=1e-8)


def test_stiff_motions_take_an_implicit_method():
    """Robertson's reactions over 11 decades; Hairer and Wanner's values at t = 40 and 4e11."""
    robertson = pk.Problem(
        {
            "a": "-k1*a + k3*b*c", "b": "k1*a - k3*b*c - k2*b^2", "c": "k2*b^2",
        },
        parameters={"k1": 0.04, "k2": 3e7, "k3": 1e4},
    )  # fmt: skip
    ds = pk.flow(robertson, [1.0, 0.0, 0.0], [40.0, 4e6], rtol=1e-8, atol=1e-14)
    np.testing.assert_allclose(ds.motion_a[0], 0.7158270688, rtol=1e-6)
    total = ds.motion_a + ds.motion_b + ds.motion_c
    np.testing.assert_allclose(total, 1.0, rtol=1e-6)
    assert 0.0 < ds.motion_a[1] < 0.01


def test_small_and_large_numbers_move_as_well():
    """In any units the same digits."""
    t = np.linspace(0.0, 10.0, 5)
    wanted = pk.flow(neuron(), [-1.0, -0.5], t).motion_v
    for size in (1e-12, 1e9):
        scaled = pk.Problem(
            {"v": f"v - v**3/3/{size**2!r} - w + I", "w": f"eps*(v + a*{size!r} - b*w)"},
            parameters={**VALUES, "I": 0.5 * size},
            window={"v": (-2.5 * size, 2.5 * size), "w": (-size, 2.0 * size)},
        )
        found = pk.flow(scaled, [-size, -0.5 * size], t).motion_v
        np.testing.assert_allclose(found / size, wanted, rtol=1e-7)


def test_events_of_formulas_and_functions():
    circle = pk.Problem({"x": "y", "y": "-w^2*x"}, parameters={"w": 2.0})

    def right(t, x):
        return x[1]

    right.terminal, right.direction = 2, -1
    ds = pk.flow(circle, [0.0, 1.0], [0.0, 10.0], events={"turn": right, "half": "x - 1/4"})
    turns = ds.event_time.values[ds.event_name.values == "turn"]
    np.testing.assert_allclose(turns, [np.pi / 4, np.pi / 4 + np.pi], atol=1e-9)
    halves = ds.event_time.values[ds.event_name.values == "half"]
    np.testing.assert_allclose(np.sin(2.0 * halves) / 2.0, 0.25, atol=1e-9)
    assert len(halves) == 3
    np.testing.assert_allclose(ds.event_x.values[ds.event_name.values == "half"], 0.25, atol=1e-9)
    assert np.isnan(ds.motion_x[1])


def test_motions_without_end_are_announced():
    bursts = pk.Problem("x^2", "x")
    with pytest.warns(RuntimeWarning, match="run to infinity"):
        ds = pk.flow(bursts, 1.0, [0.5, 2.0])
    np.testing.assert_allclose(ds.motion_x[0], 2.0, rtol=1e-9)
    assert np.isnan(ds.motion_x[1])


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda p: pk.flow(p, [0.0, 0.0]), "t: got None, wants times"),
        (lambda p: pk.flow(p, [0.0], 1.0), "x0: .* a value for each of v, w"),
        (lambda p: pk.flow(p, {"v": 0.0}, 1.0), "x0: .* a value for w as well"),
        (lambda p: pk.flow(p, {"v": 0.0, "u": 0.0}, 1.0), "x0: state 'u' is unknown"),
        (lambda p: pk.flow(p, v=0.0, u=1.0, t=1.0), "state 'u' is unknown"),
        (lambda p: pk.flow(p, [0.0, 0.0], 1.0, method="euler"), "method"),
        (lambda p: pk.flow(p, [0.0, 0.0], 1.0, events="q"), r"events\['event'\]"),
        (lambda p: pk.Problem(NEURON, parameters=VALUES, window={"u": (0, 1)}), "window: state"),
        (lambda p: pk.Problem(NEURON, parameters=VALUES, window={"v": (1, 0)}), r"window\['v'\]"),
        (
            lambda p: pk.continuation(neuron(I=[0.0, 1.0]), "a", x0=[0.0, 0.0], span=(0, 1)),
            r"parameters\['I'\]",
        ),
        (lambda p: pk.Problem("x - x^3", "x", conservative=True).replace(), None),
    ],
)
def test_what_is_wrong_is_said_before_any_work(call, message):
    if message is None:
        with pytest.raises(pk.ParameterError, match="states a force alone"):
            pk.flow(call(neuron()), 0.1, 1.0)
        return
    with pytest.raises(pk.ParameterError, match=message):
        call(neuron())


@pytest.mark.parametrize("given", [None, [1.0, 2.0], "x"])
def test_a_function_that_returns_no_rates_is_refused(given):
    with pytest.raises(pk.ParameterError, match="f: returned .*, wants 1 numbers"):
        pk.flow(pk.Problem(lambda x: given, "x"), 1.0, [0.0, 1.0])


@pytest.mark.parametrize("discrete", [True, False])
def test_what_a_function_raises_is_said(discrete):
    problem = pk.Problem(lambda x: x[3], "x", map=discrete)
    with pytest.warns(RuntimeWarning, match="2 of 2 motions .* f raised IndexError: index 3"):
        ds = pk.flow(problem, [1.0, 2.0], [0.0, 1.0])
    np.testing.assert_array_equal(ds.motion_x, [[1.0, np.nan], [2.0, np.nan]])


def test_units_of_parameters_travel():
    attrs = {"units": "kg", "long_name": "capacity"}
    capacity = xr.DataArray([500.0, 3000.0], dims="load", attrs={**attrs, "units": "g"})
    growth = pk.Problem({"N": "r*N*(1 - N/K)"}, parameters={"r": 1.0, "K": capacity})
    for ds in (pk.flow(growth, 1.0, [0.0, 1.0]), pk.equilibria(growth, {"N": (-0.1, 4.0)})):
        assert ds.K.attrs == attrs
        np.testing.assert_array_equal(ds.K, [0.5, 3.0])


def test_arrays_travel_and_compare():
    system = neuron(I=[0.0, 1.0])
    again = pickle.loads(pickle.dumps(system))
    assert again == system
    assert system != neuron(I=[0.0, 2.0])
    assert again.window == system.window
    assert "I=[0.0, 1.0]" in repr(system)


def test_a_forced_motion_is_seen_once_a_period():
    """The same as of the same equation as a perturbed potential."""
    f = {"x": "v", "v": "F*cos(w*t) - d*v + x - x**3"}
    values = {"d": 0.25, "F": 0.3, "w": [1.0, 1.3]}
    duffing = pk.Problem(f, parameters=values, time="t", period="2*pi/w")
    ds = pk.stroboscopic(duffing, [0.4, -0.1], n=5, skip=3)
    assert ds.section_x.dims == ("w", "crossing")
    well = pk.Perturbed(
        pk.Potential("x^4/4 - x^2/2", "x"), damping=0.25, forcing=pk.Harmonic(0.3, [1.0, 1.3])
    )
    same = pk.stroboscopic(well, 0.4, -0.1, n=5, skip=3)
    np.testing.assert_allclose(ds.section_x, same.section_phi, atol=1e-7)
    np.testing.assert_allclose(ds.section_v, same.section_dphi, atol=1e-7)
    np.testing.assert_allclose(ds.section_time, same.section_time)
    with pytest.raises(pk.ParameterError, match="period: got None"):
        pk.stroboscopic(neuron(), [0.0, 0.0], n=3)


def test_states_may_be_called_as_those_of_the_rotor():
    pendulum = pk.Problem({"phi": "w", "w": "-sin(phi)"}, periods={"phi": 2.0 * np.pi})
    by_name = pk.flow(pendulum, phi=0.1, w=0.0, t=1.0)
    assert by_name.motion_phi.item() == pk.flow(pendulum, [0.1, 0.0], 1.0).motion_phi.item()
    exact = pk.flow(pk.Coefficients(0.0, 1.0, 0.0), 0.1, 0.0, 1.0)
    np.testing.assert_allclose(by_name.motion_phi, exact.motion_phi, rtol=1e-9)
