"""Lyapunov exponents of systems with states of their own, against published and exact values."""

from __future__ import annotations

import numba
import numpy as np
import pytest

import phasekit as pk

AT = {"s": 10.0, "r": 28.0, "b": 8.0 / 3.0}


@pytest.mark.slow
def test_those_of_lorenz():
    """0.9056, 0, -14.5723 in Sprott's Chaos and Time-Series Analysis; the sum is the divergence."""
    f = ["s*(y - x)", "x*(r - z) - y", "x*y - b*z"]
    lorenz = pk.Problem(f, ["x", "y", "z"], AT)
    ds = pk.lyapunov(lorenz, [1.0, 1.0, 1.0], duration=2000.0)
    off = ds.lyapunov_exponent - [0.9056, 0.0, -14.5723]
    assert (abs(off) < 4.0 * ds.lyapunov_error).all()
    assert (ds.lyapunov_error < 0.02).all()
    assert ds.lyapunov_sum.item() == pytest.approx(-41.0 / 3.0, abs=1e-10)
    assert ds.lyapunov_dimension.item() == pytest.approx(2.0622, abs=0.002)
    two = pk.lyapunov(lorenz, [1.0, 1.0, 1.0], duration=500.0, count=2)
    assert two.sizes["exponent"] == 2
    assert np.isnan(two.lyapunov_sum)


@numba.njit
def njit_henon(x, a, b):
    return np.array([1.0 - a * x[0] ** 2 + x[1], b * x[0]])


def plain_henon(x, a, b):
    return [1.0 - a * x[0] ** 2 + x[1], b * x[0]]


@pytest.mark.slow
@pytest.mark.parametrize(
    ("f", "n", "error"),
    [
        ({"x": "1 - a*x^2 + y", "y": "b*x"}, 200_000, 1e-9),
        (njit_henon, 200_000, 1e-7),
        (plain_henon, 2_000, 1e-7),
    ],
)
def test_those_of_henon_of_formulas_and_functions(f, n, error):
    henon = pk.Problem(f, ("x", "y"), {"a": 1.4, "b": 0.3}, map=True)
    ds = pk.lyapunov(henon, [0.1, 0.1], n=n)
    assert ds.lyapunov_sum.item() == pytest.approx(np.log(0.3), abs=error)
    assert abs(ds.lyapunov_exponent[0] - 0.4192) < 4.0 * ds.lyapunov_error[0] + 1e-4


def test_exact_ones_of_maps():
    """Ln 2 of the logistic map at 4; of the cat map ln of (3 + sqrt 5)/2; of a cycle's product."""
    logistic = pk.Problem("r*x*(1 - x)", "x", {"r": [4.0, 3.2]}, map=True)
    ds = pk.lyapunov(logistic, x=0.3, n=100_000)
    assert ds.lyapunov_exponent.dims == ("r", "exponent")
    assert abs(ds.lyapunov_exponent[0, 0] - np.log(2.0)) < 4.0 * ds.lyapunov_error[0, 0] + 1e-4
    cycle = 0.5 * np.log(abs(4.0 + 6.4 - 3.2**2))
    np.testing.assert_allclose(ds.lyapunov_exponent[1, 0], cycle, rtol=1e-9)
    cat = pk.Problem({"x": "2*x + y", "y": "x + y"}, map=True)
    # A linear map: its orbit from 0 stays there, and vectors grow by the eigenvalues.
    grown = np.log(0.5 * (3.0 + np.sqrt(5.0)))
    ds = pk.lyapunov(cat, [0.0, 0.0], n=[1_000, 4_000])
    np.testing.assert_allclose(ds.lyapunov_exponent[0], [grown, -grown], atol=2e-3)
    np.testing.assert_allclose(ds.lyapunov_exponent[1], [grown, -grown], atol=1e-9)
    squares = pk.Problem("x^2", "x", {}, map=True)
    assert pk.lyapunov(squares, 0.0, n=100).lyapunov_exponent.item() == -np.inf


def test_those_of_linear_flows_are_the_real_parts():
    rng = np.random.default_rng(3)
    A = rng.normal(size=(4, 4))
    names = ("p", "q", "r", "s")
    rows = [
        " + ".join(f"({a!r})*{n}" for a, n in zip(row, names, strict=True)) for row in A.tolist()
    ]
    ds = pk.lyapunov(pk.Problem(rows, names), [0.0] * 4, duration=400.0)
    wanted = np.sort(np.linalg.eigvals(A).real)[::-1]
    np.testing.assert_allclose(ds.lyapunov_exponent, wanted, atol=0.02)
    np.testing.assert_allclose(ds.lyapunov_sum, np.trace(A), rtol=1e-9)


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda p, m: pk.lyapunov(p, [0.1, 0.1]), "duration: got None"),
        (lambda p, m: pk.lyapunov(p, [0.1, 0.1], n=1000), "n: got 1000, wants None, but duration"),
        (lambda p, m: pk.lyapunov(m, [0.1, 0.1], duration=9.0), "duration: .* but n= for a map"),
        (lambda p, m: pk.lyapunov(m, [0.1, 0.1], n=10), "n: got 10"),
        (lambda p, m: pk.lyapunov(p, [0.1, 0.1], duration=-1.0), "duration: got -1"),
        (lambda p, m: pk.lyapunov(p, [0.1, 0.1], duration=9.0, count=3), "count: got 3"),
        (lambda p, m: pk.lyapunov(p, [0.1], duration=9.0), "x0"),
    ],
)
def test_what_is_wrong_is_said(call, message):
    flow = pk.Problem({"x": "y", "y": "-x - y"})
    henon = pk.Problem({"x": "1 - 1.4*x^2 + y", "y": "0.3*x"}, map=True)
    with pytest.raises(pk.ParameterError, match=message):
        call(flow, henon)


def test_maps_that_wind_angles_up_keep_their_digits():
    """The unfolded angle of 2 x doubles its errors, and has no digit left after 53 steps."""
    cat = pk.Problem({"x": "2*x + y", "y": "x + y"}, map=True, periods={"x": 1.0, "y": 1.0})
    ds = pk.lyapunov(cat, [0.1, 0.2], n=5_000)
    root = np.log((3.0 + np.sqrt(5.0)) / 2.0)
    np.testing.assert_allclose(ds.lyapunov_exponent, [root, -root], atol=1e-10)
    halves = pk.Problem({"x": "2*x"}, map=True, periods={"x": 64.0})
    orbit = pk.flow(halves, [1.0], np.arange(9.0)).motion_x.values
    assert orbit.tolist() == [1.0, 2.0, 4.0, 8.0, 16.0, 32.0, 0.0, 0.0, 0.0]
    # What winds no turns up goes on continuously.
    turning = pk.Problem({"x": "x + 0.3 + 0.1*sin(2*pi*x)"}, map=True, periods={"x": 1.0})
    orbit = pk.flow(turning, [0.0], np.arange(200.0)).motion_x.values
    assert orbit[-1] > 50.0


@pytest.mark.slow
def test_motions_whose_steps_are_too_short_for_their_time_are_told_early():
    # What decays in 1e-6 bounds the steps; the motion runs to infinity besides, at t = 10.
    fast = pk.Problem(["x^2", "-1e6*(y - x)"], ("x", "y"))
    with pytest.warns(RuntimeWarning, match="take more than 10000000 steps"):
        ds = pk.lyapunov(fast, [0.1, 0.1], duration=100.0)
    assert np.isnan(ds.lyapunov_exponent.values).all()
