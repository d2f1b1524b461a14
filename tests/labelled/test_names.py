"""Names: of states in every function, of the coordinate of any potential, of turning points."""

import inspect

import numpy as np
import pytest
import xarray as xr

import phasekit as pk
from phasekit.spellings import DEPRECATED

SYSTEM = pk.Coefficients(4.0, 1.0, 0.5)
DISK = pk.GyroRotorDisk(beta=0.7, e=0.05, a=0.024, r=0.2, omega1=30.0, m=2.0, half_span=0.15)
WELL = pk.Potential("x^4/4 - x^2/2", "x")
STATES = ({"phi": 0.5, "dphi": 0.2}, {"phi0": 0.5, "dphi0": 0.2}, {"state_phi": 0.5, "dphi": 0.2})


@pytest.mark.parametrize(
    "function", [pk.orbits, pk.energy, pk.action_angle], ids=lambda f: f.__name__
)
@pytest.mark.parametrize("state", STATES, ids=lambda s: "-".join(s))
def test_a_state_may_have_any_of_its_names(function, state):
    xr.testing.assert_identical(function(SYSTEM, **state), function(SYSTEM, 0.5, 0.2))


@pytest.mark.parametrize("state", STATES, ids=lambda s: "-".join(s))
def test_motions_and_loads_take_them_too(state):
    times = [0.0, 0.5]
    xr.testing.assert_identical(pk.flow(SYSTEM, **state, t=times), pk.flow(SYSTEM, 0.5, 0.2, times))
    for function in (pk.rotators, pk.bearing_forces):
        xr.testing.assert_identical(function(DISK, **state), function(DISK, 0.5, 0.2))
    ds = pk.equilibria(DISK)
    xr.testing.assert_identical(
        ds.phasekit.bearing_forces("orbit", **state),
        ds.phasekit.bearing_forces("orbit", phi0=0.5, dphi0=0.2),
    )


def test_sweeps_take_what_the_functions_take():
    wanted = pk.sweep(SYSTEM, A=[3.0, 4.0], state_phi=0.5, state_dphi=0.2, of="orbits")
    for state in STATES:
        xr.testing.assert_identical(pk.sweep(SYSTEM, A=[3.0, 4.0], **state, of="orbits"), wanted)
    wanted = pk.sweep(SYSTEM, A=[3.0], state_phi=0.5, state_dphi=0.2, time=[1.0, 2.0], of="motion")
    found = pk.sweep(SYSTEM, A=[3.0], phi0=0.5, dphi0=0.2, t=[1.0, 2.0], of="motion")
    xr.testing.assert_identical(found, wanted)
    with pytest.raises(pk.ParameterError, match="phi: got it besides state_phi, wants it once"):
        pk.sweep(SYSTEM, A=[3.0], state_phi=0.5, phi=0.4, state_dphi=0.2, of="orbits")
    with pytest.raises(pk.ParameterError, match="'phi' is unknown"):
        pk.sweep(SYSTEM, A=[3.0], phi=0.5)


def test_the_coordinate_of_a_potential_may_name_the_state():
    xr.testing.assert_identical(pk.orbits(WELL, x=0.5, dx=0.1), pk.orbits(WELL, 0.5, 0.1))
    xr.testing.assert_identical(pk.flow(WELL, x=0.5, dx=0.1, t=1.0), pk.flow(WELL, 0.5, 0.1, 1.0))
    assert pk.potential(WELL, x=1.0).potential.item() == -0.25


def test_a_state_is_given_once():
    with pytest.raises(pk.ParameterError, match="phi: got it besides phi0, wants it once"):
        pk.orbits(SYSTEM, phi0=0.5, phi=0.4, dphi0=0.2)
    with pytest.raises(TypeError, match="multiple values"):
        pk.energy(SYSTEM, 0.5, 0.2, phi0=0.4)
    with pytest.raises(TypeError, match="unexpected keyword argument 'phy'"):
        pk.energy(SYSTEM, phy=0.5, dphi=0.2)


def test_the_coordinate_names_the_start_of_a_motion():
    want = pk.flow(WELL, 0.5, 0.1, 1.0)
    xr.testing.assert_identical(pk.flow(WELL, x0=0.5, dx0=0.1, t=1.0), want)
    xr.testing.assert_identical(pk.flow(WELL, state_x=0.5, state_dx=0.1, t=1.0), want)
    driven = pk.Perturbed(WELL, damping=0.1, forcing=pk.Harmonic(0.1, 1.0))
    found = pk.stroboscopic(driven, x0=0.5, dx0=0.1, n=2)
    xr.testing.assert_identical(found, pk.stroboscopic(driven, 0.5, 0.1, n=2))
    with pytest.raises(pk.ParameterError, match="x0: got it besides phi0"):
        pk.flow(WELL, 0.5, x0=0.5, phi0=0.1, dx0=0.1, t=1.0)


DRIVEN = pk.Perturbed(SYSTEM, damping=0.1, forcing=pk.Harmonic(0.1, 1.0))


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (
            lambda: pk.flow(SYSTEM, 0.1, 0.0, times=[1.0]),
            r"flow\(\) got .* 'times'; did you mean 't'",
        ),
        (lambda: pk.flow(SYSTEM, 0.1, 0.0), "flow.*missing a required argument: 't'; its arg"),
        (
            lambda: pk.flow(SYSTEM, 0.1, 0.0, 1.0, 2.0),
            "too many positional arguments; x0= and those",
        ),
        (lambda: pk.orbits(SYSTEM, energi=1.0), "did you mean 'energy'"),
        (lambda: pk.orbit_families(SYSTEM, energymax=1.0), "did you mean 'energy_max'"),
        (lambda: pk.escape_rate(DRIVEN, centre="lower_center"), "did you mean 'center'"),
        (lambda: pk.capture(DRIVEN, "rotation"), "capture.*arguments are system, start"),
        (lambda: pk.melnikov(DRIVEN, saddle="lower"), "'saddle'; its arguments are system$"),
        (lambda: pk.resonances(DRIVEN), "resonances.*missing a required.* argument: 'n'"),
        (lambda: pk.stroboscopic(DRIVEN, 0.1, 0.0), "stroboscopic.*'n'"),
        (lambda: pk.lyapunov(DRIVEN, 0.1, 0.0, t=3.0), "lyapunov.*'t'; did you mean 'duration'"),
        (lambda: pk.basins(DRIVEN, phis=[0.1], dphi=[0.0]), "did you mean 'phi'"),
        (lambda: pk.run_up(SYSTEM), "run_up.*missing"),
        (lambda: pk.equilibria(), "equilibria.*'system'"),
        (lambda: pk.separatrix_motion(SYSTEM, time=[1.0]), "separatrix_motion.*'time'"),
    ],
)
def test_a_call_that_does_not_fit_says_how(call, message):
    with pytest.raises(pk.ParameterError, match=message) as caught:
        call()
    assert isinstance(caught.value, TypeError)  # as Python's own


def test_the_amplitude_is_half_the_way_between_the_turning_points():
    # Released from rest at 0.5 a pendulum swings as far to the other side.
    swing = pk.orbits(pk.Pendulum(length=1.0), [0.5, 3.0, 0.0, 0.0], [0.0, 0.0, 0.0, 9.0])
    np.testing.assert_allclose(swing.amplitude, [0.5, 3.0, 0.0, np.nan], rtol=1e-15)
    assert swing.amplitude.attrs["units"] == "rad"
    # x^4/4 - x^2/2 = h < 0: x^2 = 1 +- sqrt(1 + 4 h)
    h = -0.15
    low, high = np.sqrt(1 + np.array([-1, 1]) * np.sqrt(1 + 4 * h))
    found = pk.orbits(WELL, energy=h)
    assert found.amplitude.item() == pytest.approx((high - low) / 2, rel=1e-14)
    assert found.amplitude.attrs["units"] == "1"
    xr.testing.assert_equal(found.amplitude, (found.phi_max - found.phi_min) / 2)
    assert "amplitude" in pk.quantities().groups["orbits"]


def test_critical_values_in_the_parameters_of_the_analogues():
    # The astroid |h_x|^(2/3) + |h_y|^(2/3) = (2 K)^(2/3)
    magnet = pk.StonerWohlfarth(K=1.0, h_x=0.0, h_y=0.5)
    field = (2.0 ** (2 / 3) - 0.5 ** (2 / 3)) ** 1.5
    found = pk.critical(magnet, "h_x").critical_fold.sel(fold="minus").item()
    assert found == pytest.approx(field, rel=1e-14)
    found = pk.critical(magnet, "K").critical_fold
    assert found.attrs["parameter"] == "K"


@pytest.mark.slow
def test_calls_by_the_first_argument_s_old_name_go_on_working():
    start = {"phi0": 0.1, "dphi0": 0.0}
    for function, more in ((pk.stroboscopic, {"n": 2}), (pk.lyapunov, {"duration": 3.0})):
        with pytest.warns(DeprecationWarning, match=r"\(system=\.\.\.\)"):
            old = function(perturbed=DRIVEN, **start, **more)
        assert old.identical(function(DRIVEN, **start, **more))
    with pytest.warns(DeprecationWarning, match=r"lyapunov\(time=.* is now lyapunov\(duration="):
        pk.lyapunov(DRIVEN, **start, time=3.0)
    with pytest.raises(pk.ParameterError, match="time: got it besides duration"):
        pk.lyapunov(DRIVEN, **start, time=3.0, duration=2.0)
    with pytest.warns(DeprecationWarning, match=r"melnikov\(perturbed=.* is now melnikov\(system="):
        assert pk.melnikov(perturbed=DRIVEN).identical(pk.melnikov(DRIVEN))


@pytest.mark.slow
def test_old_spellings_of_problems_and_pictures_go_on_working():
    logistic = pk.Problem("r*x*(1 - x)", "x", {"r": 3.2}, map=True)
    forced = pk.Problem("cos(w*t) - x", "x", {"w": 2.0}, time="t", period="2*pi/w")
    with pytest.warns(DeprecationWarning, match=r"iterated\(times=\.\.\.\) is now iterated\(n="):
        assert logistic.iterated(times=2) == logistic.iterated(2)
    with pytest.warns(DeprecationWarning, match=r"derivatives\(time=.* is now derivatives\(t="):
        value, _ = forced.derivatives([0.5], time=0.3)
    assert value == pytest.approx(np.cos(0.6) - 0.5, rel=1e-15)
    damped = pk.Perturbed(pk.Coefficients(1.0, 0.35, 0.12), damping=0.1)
    with pytest.warns(DeprecationWarning, match=r"damped_portrait\(perturbed=.*\(system="):
        pk.plot.damped_portrait(perturbed=damped)
    planar = pk.Problem(["y", "-x - y"], ("x", "y"), {}, window={"x": (-1, 1), "y": (-1, 1)})
    with pytest.warns(DeprecationWarning, match=r"nullclines\(what=.* is now nullclines\(system="):
        pk.plot.nullclines(what=planar)
    branch = pk.continuation(pk.Problem("mu - x", "x", {"mu": 0.0}), "mu", span=(-1, 1))
    with pytest.warns(DeprecationWarning, match=r"Branch.known\(\) is now \(Branch.curve, "):
        assert branch.known() == (branch.curve, branch.problem)


def test_no_old_spelling_is_one_of_now():
    for name, spellings in DEPRECATED.items():
        homes = (pk.plot, pk.Problem) if name in ("nullclines",) else (pk, pk.plot, pk.Problem)
        function = next(getattr(home, name) for home in homes if hasattr(home, name))
        names = inspect.signature(function).parameters
        assert spellings.keys().isdisjoint(names)
        assert names.keys() >= set(spellings.values())
