"""A center followed while parameters change slowly, against known hysteresis and small steps."""

import numpy as np
import pytest
import xarray as xr
from witnesses.variants import some

import phasekit as pk

MAGNET = pk.StonerWohlfarth(K=1.0, h_x=0.0, h_y=0.0)
FIELD = np.concatenate([np.linspace(3, -3, 25), np.linspace(-3, 3, 25)])
DISK = pk.GyroRotorDisk(beta=40 * pk.deg, e=0.05, a=0.024, r=0.2, omega1=300 * pk.rpm)


def loop(psi, field=FIELD):
    return pk.quasi_static(MAGNET, h_x=field * np.cos(psi), h_y=field * np.sin(psi))


@pytest.mark.parametrize("degrees", [0.001, 10, 30, 45, 60, 89.9])
def test_the_switching_field_of_stoner_and_wohlfarth(degrees):
    psi = np.radians(degrees)
    ds = loop(psi)
    wanted = 2.0 * (np.cos(psi) ** (2 / 3) + np.sin(psi) ** (2 / 3)) ** -1.5
    switched = ds.jump_h_x * np.cos(psi) + ds.jump_h_y * np.sin(psi)
    np.testing.assert_allclose(switched, [-wanted, wanted], rtol=1e-14)
    assert int(ds.jumped.sum()) == 2
    # Folds of the critical field across, at the field along: exactly those.
    for k in range(2):
        at = MAGNET.replace(h_y=ds.jump_h_y.values[k])
        fold = pk.critical(at, "h_x").critical_fold.sel(fold="minus").item()
        assert fold == pytest.approx(abs(ds.jump_h_x.values[k]), rel=1e-12)
    # The loop is odd in the field.
    np.testing.assert_allclose(np.cos(ds.phi[:25] - psi), -np.cos(ds.phi[25:] - psi), atol=1e-12)


def test_the_remanence_of_random_orientations_is_a_half():
    cosines, weights = np.polynomial.legendre.leggauss(8)
    psis = np.arccos(0.5 * (1.0 + cosines))
    down = np.linspace(4.0, 0.0, 9)
    remanent = [float(np.cos(loop(psi, down).phi[-1] - psi)) for psi in psis]
    assert 0.5 * np.dot(weights, remanent) == pytest.approx(0.5, abs=1e-13)


def test_jumps_lose_the_area_of_the_loop():
    field = np.concatenate([np.linspace(3, -3, 2001), np.linspace(-3, 3, 2001)])
    for psi in (0.3, 1.0):
        ds = loop(psi, field)
        along = np.cos(ds.phi.values - psi)
        area = -np.sum(0.5 * (along[1:] + along[:-1]) * np.diff(field))
        assert float(ds.jump_loss.sum()) == pytest.approx(area, rel=1e-3)


def relaxed(system, phi0):
    """The rest to which a damped motion goes, by steps along -V' alone."""
    from scipy.integrate import solve_ivp

    A, B, C = system.coefficients()

    def slope(t, phi):
        return A * np.sin(phi) * np.cos(phi) - B * np.sin(phi) + C * np.cos(phi)

    return solve_ivp(slope, (0.0, 60.0), [phi0], rtol=1e-9, atol=1e-11).y[0, -1]


@pytest.mark.parametrize("seed", some(range(4), 3))
def test_it_is_where_an_overdamped_motion_goes(seed):
    rng = np.random.default_rng(seed)
    path = 2.5 * rng.standard_normal((3, 9))
    path[0] = np.abs(path[0]) if seed % 2 else -np.abs(path[0])
    # Fine steps between the corners, of which `quasi_static` sees the corners alone.
    ds = pk.quasi_static(pk.Coefficients(1.0, 1.0, 1.0), A=path[0], B=path[1], C=path[2])
    phi = ds.phi.values[0]
    for k in range(path.shape[1]):
        for share in np.linspace(0.0, 1.0, 25)[1:] if k else [1.0]:
            corner = path[:, k] if not k else path[:, k - 1] * (1 - share) + path[:, k] * share
            phi = relaxed(pk.Coefficients(*corner), phi)
        off = np.angle(np.exp(1j * (phi - ds.phi.values[k])))
        assert abs(off) < 1e-5, k


def test_steps_do_not_matter():
    fine = np.linspace(0.01, 1.5, 200)
    whole, few = (
        pk.quasi_static(DISK, beta=values, phi0=3.0) for values in (fine, fine[[0, 90, 199]])
    )
    xr.testing.assert_identical(
        few.phi.drop_vars("step"), whole.phi[[0, 90, 199]].drop_vars("step")
    )
    np.testing.assert_array_equal(few.jump_beta, whole.jump_beta)
    fold = pk.critical(DISK, "beta").critical_fold.sel(fold="minus")
    np.testing.assert_allclose(whole.jump_beta, [fold], rtol=1e-14)
    before, after = whole.phi.values[whole.jump_step.item() - 1 : whole.jump_step.item() + 1]
    assert np.cos(before) < 0 < np.cos(after)
    assert whole.jump_loss.item() > 0


def test_a_run_up_of_a_particle_bifurcates_like_a_governor():
    ball = pk.ParticleOnCircle(radius=0.5, omega=1.0, g=10.0)
    omega = np.linspace(1.0, 9.0, 17)
    ds = pk.quasi_static(ball, omega=omega)
    outwards = np.arccos(np.minimum(1.0, 10.0 / (omega**2 * 0.5)))
    np.testing.assert_allclose(ds.phi, outwards, atol=1e-7)
    assert ds.sizes["jump"] == 0
    offset = pk.quasi_static(ball.replace(offset=0.01), omega=omega)
    np.testing.assert_array_less(0.0, offset.phi.values)


def test_where_it_starts():
    inside = MAGNET.replace(h_y=0.3)
    starts = [-3.0, -1.0, 0.5, 1.5, 2.0, 3.1, 7.0]
    for phi0 in starts:
        ds = pk.quasi_static(inside, h_x=[0.2, 0.25], phi0=phi0)
        rest = relaxed(inside.replace(h_x=0.2), phi0)
        assert abs(np.angle(np.exp(1j * (rest - ds.phi.values[0])))) < 1e-6, phi0
    eq = pk.equilibria(inside.replace(h_x=0.2)).phi
    kept = pk.quasi_static(inside, h_x=[0.2, 0.25], phi0=eq.sel(equilibrium="upper_center").item())
    assert kept.phi.values[0] == eq.sel(equilibrium="upper_center")
    with pytest.raises(pk.ParameterError, match="phi0: got .*it is no center"):
        pk.quasi_static(inside, h_x=[0.2, 0.25], phi0=eq.sel(equilibrium="upper_saddle").item())


def test_steps_on_a_fold():
    for field in (-2.0, -2.0 * (1 + 1e-15), -2.0 * (1 - 1e-15)):
        ds = pk.quasi_static(MAGNET, h_x=[1.0, field, -3.0])
        assert ds.sizes["jump"] == 1
        np.testing.assert_allclose(np.cos(ds.phi.values[2]), -1.0)
        assert np.isfinite(ds.phi).all()
        assert ds.jumped.values[1] == (np.cos(ds.phi.values[1]) < 0)


def test_it_gives_its_systems_back_and_takes_units():
    ds = pk.quasi_static(DISK, omega1=xr.DataArray([20.0, 300.0], dims="t", attrs={"units": "rpm"}))
    assert ds.isel(step=1).phasekit.system() == DISK
    shown = ds.phasekit.to(omega1="rpm", phi="deg")
    assert shown.isel(step=1).phasekit.system() == DISK
    eq = pk.equilibria(DISK)
    np.testing.assert_array_equal(ds.phi[1], eq.phi[0])
    np.testing.assert_array_equal(ds.energy[1], eq.energy[0])
    np.testing.assert_array_equal(ds.natural_frequency[1], eq.natural_frequency[0])


def test_without_force_the_center_is_lost():
    with pytest.warns(RuntimeWarning, match="no force before step 1"):
        ds = pk.quasi_static(pk.Pendulum(length=1.0), g=[1.0, -1.0, 1.0])
    np.testing.assert_array_equal(ds.phi, [0.0, np.nan, np.nan])


@pytest.mark.parametrize(
    ("call", "message"),
    [
        ({}, "path: got None, wants values of a parameter"),
        ({"path": [1.0]}, "path: got .*wants a mapping"),
        ({"h_z": [1.0]}, "'h_z' is unknown; did you mean 'h_"),
        ({"h_x": [1.0, 2.0], "h_y": [1.0]}, "path: .*2 values of h_x, 1 values of h_y"),
        ({"h_x": 1.0}, "path: got {'h_x': 1.0}, wants a 1-D array of at least one parameter"),
        ({"h_x": [1.0, np.nan]}, "h_x: got .*wants a 1-D array"),
        ({"h_x": [1.0], "phi0": "up"}, "phi0: got 'up', wants an angle"),
        ({"path": {"h_x": [1.0]}, "h_x": [1.0]}, "h_x: got it in path and as a keyword"),
    ],
)
def test_what_cannot_be_followed(call, message):
    with pytest.raises(pk.ParameterError, match=message):
        pk.quasi_static(MAGNET, **call)


@pytest.mark.slow
def test_an_angle_may_change_with_others():
    """Along such lines there are no polynomials: the numerical rung answers, as along corners."""
    ds = pk.quasi_static(DISK, beta=[0.2, 0.9, 0.9], a=[0.0, 0.02, 0.05])
    assert ds.complete
    at = DISK.replace(beta=0.9, a=0.05)
    assert np.isclose(pk.equilibria(at).phi, ds.phi[2], rtol=0.0, atol=1e-12).any()


def test_other_systems_are_refused():
    with pytest.raises(pk.ParameterError, match="e: got .*wants one number"):
        pk.quasi_static(DISK.replace(e=[0.1, 0.2]), a=[0.0, 0.1])
    with pytest.raises(pk.ParameterError, match="beta: got .*each value a number from 0 to 3.14"):
        pk.quasi_static(DISK, beta=[0.1, 40.0])
