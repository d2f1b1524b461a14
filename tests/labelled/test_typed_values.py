"""Numbers as text, with units, as the command line takes them."""

import math

import numpy as np
import pytest

import phasekit as pk

DISK = dict(e=0.001153, a=0.024, r=0.2, omega1=31.0)


@pytest.mark.parametrize(
    ("text", "value"),
    [
        ("40deg", 40 * pk.deg),
        (" 40 ° ", 40 * pk.deg),
        ("pi/4", math.pi / 4),
        ("3*pi/8", 3 * math.pi / 8),
        ("2pi/7", 2 * math.pi / 7),
        ("π/3", math.pi / 3),
        ("0,7", 0.7),
        ("0,5deg", 0.5 * pk.deg),
        ("7e-1 rad", 0.7),
    ],
)
def test_an_angle_as_people_write_it(text, value):
    disk = pk.GyroRotorDisk(beta=text, **DISK)
    assert disk.beta == value
    assert disk == pk.GyroRotorDisk(beta=value, **DISK)


def test_lengths_and_speeds_and_lists():
    disk = pk.GyroRotorDisk(beta="40deg", e="1.153mm", a="24 mm", r="20cm", omega1="300rpm")
    assert (disk.e, disk.a, disk.r, disk.omega1) == (0.001153, 0.024, 0.2, 300 * pk.rpm)
    ds = pk.sweep(disk, beta=["10deg", 0.3, "pi/4"])
    np.testing.assert_array_equal(ds.beta, [10 * pk.deg, 0.3, math.pi / 4])
    folds = pk.branches(disk, "beta", ("10deg", "80deg")).special_value
    assert folds.min() == 10 * pk.deg
    motion = pk.flow(disk, "30deg", 0.0, [0.0])
    assert motion.state_phi.item() == 30 * pk.deg
    problem = pk.Problem("mu - x^2", state="x", parameters={"mu": "0,7"})
    assert problem.parameters == {"mu": 0.7}


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("30mm", "beta: got '30mm', wants a number in rad or deg"),
        ("1,234", "beta: got '1,234', wants 1234 or 1.234"),
        ("1e400", "and a finite one"),
        ("forty", "beta: got 'forty', wants a real number"),
        ("", "beta: got '', wants a real number"),
        ("200deg", "wants a number from 0 to 3.14159 in radians$"),
    ],
)
def test_what_is_no_angle_is_refused(text, message):
    with pytest.raises(pk.ParameterError, match=message):
        pk.GyroRotorDisk(beta=text, **DISK)


LORENZ = pk.Problem(
    {"x": "s*(y - x)", "y": "r*x - y - x*z", "z": "x*y - b*z"},
    parameters={"s": 10.0, "r": 28.0, "b": 8 / 3},
)
DRIVEN = pk.Perturbed(pk.Pendulum(length=1.0), damping=0.1, forcing=pk.Harmonic(0.1, 1.0))


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (
            lambda: pk.sweep(LORENZ, of="lyapunov", r=[20.0, 28.0]),
            "^duration, x, y, z: got None, wants a time, duration=; states .* z=",
        ),
        (
            lambda: pk.sweep(DRIVEN, of="lyapunov", length=[1.0, 2.0]),
            "^state_phi, state_dphi, time: got nothing, wants values for lyapunov",
        ),
        (lambda: pk.sweep(LORENZ, of="period", r=[20.0]), "^x, y, z: .* z=, for period; states"),
        (lambda: pk.flow(LORENZ, [1, 1, 1], tmax=10.0), "'tmax'; did you mean 't'"),
        (lambda: pk.flow(LORENZ, [1, 1, 1]), "t: got None, wants times"),
        (lambda: pk.flow(LORENZ, [1, 1, 1], t=1.0, w=2.0), "state 'w' is unknown"),
    ],
)
def test_all_that_is_missing_is_named_at_once(call, message):
    with pytest.raises(pk.ParameterError, match=message):
        call()
