"""Thresholds of irregular motion: published values, limits, maps, and other potentials."""

import numpy as np
import pytest
import xarray as xr

import phasekit as pk

EIGHT = pk.Coefficients(1.0, 0.35, 0.12)
DRIVE = {
    "damping": 0.1,
    "quadratic": 0.2,
    "torque": 0.03,
    "forcing": pk.Harmonic(0.3, 0.8, 0.2),
    "modulation": {"A": pk.Harmonic(0.2, 1.3, 0.1)},
    "drift": {"B": 0.02},
}


def test_the_eight():
    ds = pk.melnikov(pk.Perturbed(EIGHT, damping=1.0, forcing=pk.Harmonic(1.0, 1.0)))
    lower = ds.sel(saddle="lower")
    amplitude, threshold = lower.melnikov_amplitude.values, lower.chaos_threshold.values
    # mpmath, 30 digits
    assert amplitude == pytest.approx([1.1830743423629, 2.20842849973056], rel=1e-13)
    assert threshold == pytest.approx([0.814751185, 1.119291703], abs=1e-9)
    assert lower.melnikov_mean.values == pytest.approx([-0.963911, -2.471876], abs=1e-6)
    assert lower.turnstile_area.values == pytest.approx(2 * amplitude, rel=1e-14)


def test_the_pendulum():
    ds = pk.melnikov(
        pk.Perturbed(pk.Pendulum(length=1.0, g=4.0), damping=0.3, forcing=pk.Harmonic(1.0, 2.0))
    )
    # 8 k damping over 2 pi/cosh(pi nu/2k) at nu = k = 2
    want = 8 * 2 * 0.3 / (2 * np.pi / np.cosh(np.pi / 2))
    assert ds.chaos_threshold.sel(saddle="upper").values == pytest.approx([want, want], rel=1e-13)
    assert want / (2 * 0.3) == pytest.approx(3.194785264, abs=1e-9)


def test_duffing():
    nu = np.array([0.5, 1.0, 2.0])
    well = pk.Perturbed(
        pk.Potential("x^4/4 - x^2/2", "x"), damping=1.0, forcing=pk.Harmonic(1.0, nu)
    )
    threshold = pk.melnikov(well).chaos_threshold
    assert threshold.dims == ("forcing_frequency", "saddle", "side")
    want = 4 * np.cosh(np.pi * nu / 2) / (3 * np.sqrt(2) * np.pi * nu)
    assert threshold.values[:, 0, 0] == pytest.approx(want, rel=1e-9)
    assert threshold.values[:, 0, 1] == pytest.approx(want, rel=1e-9)
    assert want[1] == pytest.approx(0.753018108, abs=1e-9)


@pytest.mark.slow
def test_any_potential_agrees_with_the_closed_form():
    text = "-B*cos(q) + A/2*cos(q)^2 - C*sin(q)"
    V = pk.Potential(text, "q", {"A": 1.0, "B": 0.35, "C": 0.12}, period="2*pi")
    exact, numerical = (
        pk.melnikov(pk.Perturbed(EIGHT, **DRIVE)),
        pk.melnikov(pk.Perturbed(V, **DRIVE)),
    )
    for name in exact:
        left, right = exact[name].values, numerical[name].values[::-1]  # by energy; by angle
        assert np.array_equal(np.isnan(left), np.isnan(right))
        assert np.isfinite(left).all() or name == "melnikov_phase"  # of several harmonics
        rtol = 1e-3 if name == "chaos_threshold_error" else 1e-8  # an estimate needs few digits
        assert np.allclose(left, right, rtol=rtol, equal_nan=True)
    assert np.isfinite(exact.chaos_threshold).all()


def test_nothing_said_without_damping_or_drive():
    still = pk.melnikov(pk.Perturbed(EIGHT))
    assert (still.melnikov_mean.sel(saddle="lower") == 0.0).all()
    assert (still.melnikov_amplitude == 0.0).all()
    assert np.isnan(still.chaos_threshold).all()
    assert np.isnan(still.melnikov_phase).all()
    undamped = pk.melnikov(pk.Perturbed(EIGHT, forcing=pk.Harmonic(0.1, 1.0)))
    assert np.isnan(undamped.chaos_threshold).all()
    assert (undamped.melnikov_amplitude > 0.0).all()
    absent = pk.melnikov(pk.Perturbed(pk.Pendulum(length=1.0), damping=0.1))
    assert np.isnan(absent.melnikov_mean.sel(saddle="lower")).all()


def test_damping_torque_and_drift_in_the_mean():
    sep = pk.separatrices(EIGHT)
    mean = pk.melnikov(pk.Perturbed(EIGHT, damping=-0.2)).melnikov_mean
    assert mean.sel(saddle="lower").values == pytest.approx(0.2 * sep.lobe_area.values[0])
    winds = pk.melnikov(pk.Perturbed(EIGHT, torque=0.1)).melnikov_mean.sel(saddle="upper")
    assert winds.values == pytest.approx([-0.2 * np.pi, 0.2 * np.pi])
    # int |phi'|^3 dt is that of 2 (h - V) over the angle
    h = sep.saddle_energy.values
    start = sep.saddle_phi.sel(saddle="lower").item()
    phi = start + np.linspace(0.0, sep.turning_offset.values[0, 1], 200001)
    V = -0.35 * np.cos(phi) + 0.5 * np.cos(phi) ** 2 - 0.12 * np.sin(phi)
    cubes = pk.melnikov(pk.Perturbed(EIGHT, quadratic=1.0)).melnikov_mean
    want = -4 * np.trapezoid(h[0] - V, phi)
    assert cubes.sel(saddle="lower", side="right").item() == pytest.approx(want, rel=1e-8)
    assert cubes.sel(saddle="upper", side="left").item() == pytest.approx(
        -4 * np.pi * (h[1] - 0.25), rel=1e-13
    )


def test_thresholds_scale_and_do_not_depend_on_the_amplitude():
    def at(amplitude):
        drive = pk.Harmonic(amplitude, 1.0)
        return pk.melnikov(pk.Perturbed(EIGHT, damping=0.3, forcing=drive)).chaos_threshold

    assert np.array_equal(at(0.0), at(2.0))
    two = [pk.Harmonic(2.0, 1.0), pk.Harmonic(1.0, 1.0, np.pi)]  # together one of amplitude 1
    both = pk.melnikov(pk.Perturbed(EIGHT, damping=0.3, forcing=two))
    assert both.chaos_threshold.values == pytest.approx(2 * at(1.0).values, rel=1e-13)


def test_quiet_frequencies():
    driven = pk.Perturbed(EIGHT, damping=0.1, forcing=pk.Harmonic(1.0, 1.0))
    quiet = pk.quiet_frequencies(driven, n=3).quiet_frequency
    assert quiet.dims == ("saddle", "side", "order")
    assert np.isnan(quiet.sel(saddle="upper")).all()
    lobes = quiet.sel(saddle="lower", side="right").values
    assert lobes == pytest.approx(lobes[0] * np.arange(1, 4))
    ds = pk.melnikov(driven.replace(forcing_frequency=lobes))
    assert ds.melnikov_amplitude.sel(saddle="lower").max() < 1e-13
    assert (ds.chaos_threshold.sel(saddle="lower") > 1e12).all()


def test_maps_follow(tmp_path):
    driven = pk.Perturbed(
        pk.GyroRotorDisk(beta=1.2, e=0.05, a=0.004, r=0.1, omega1=24.0),
        damping=0.2,
        modulation={"omega1": pk.Harmonic(0.3, 9.0)},
    )
    axes = {"beta": [0.6, 1.2], "modulation_omega1_frequency": [5.0, 9.0, 14.0]}
    ds = pk.sweep(driven, axes, of="melnikov", store=tmp_path / "map.zarr")
    assert ds.chaos_threshold.dims[:2] == tuple(axes)
    one = ds.isel(beta=1, modulation_omega1_frequency=1)
    assert one.phasekit.system() == driven
    alone = pk.melnikov(driven)
    assert alone.chaos_threshold.attrs["units"] == "s-1"
    for name in alone:
        assert np.array_equal(one[name], alone[name], equal_nan=True)
    again = pk.sweep(driven, axes, of=["melnikov", "capture"], store=tmp_path / "map.zarr")
    assert np.all(again.capture_validity == pk.Validity.FORCED)
    assert np.all(np.isnan(again.capture_probability))


def test_invalid_cells_do_not_stop_a_map():
    driven = pk.Perturbed(EIGHT, damping=0.1, forcing=pk.Harmonic(1.0, 1.0))
    ds = pk.sweep(driven, forcing_frequency=[-1.0, np.nan, 1.0], of="melnikov")
    known = np.isfinite(ds.chaos_threshold.sel(saddle="lower", side="left").values)
    assert known.tolist() == [False, False, True]
    lazy = driven.replace(damping=xr.DataArray([0.1, 0.2], dims="run").chunk(1))
    assert np.isfinite(pk.melnikov(lazy).chaos_threshold.compute()).all()


def test_refusals():
    disk = pk.GyroRotorDisk(beta=1.2, e=0.05, a=0.004, r=0.1, omega1=24.0)
    with pytest.raises(pk.ParameterError, match="omega1: got .*closed form; use modulation"):
        pk.melnikov(pk.Perturbed(disk, omega1=np.sin))
    with pytest.raises(pk.ParameterError, match=r"wants a perturbed system"):
        pk.melnikov(disk)
    with pytest.raises(pk.ParameterError, match="n: got 0"):
        pk.quiet_frequencies(pk.Perturbed(EIGHT), n=0)
    with pytest.raises(pk.ParameterError, match="perturbed.system has"):
        pk.separatrices(pk.Perturbed(EIGHT, damping=0.1))


@pytest.mark.slow
@pytest.mark.parametrize("sense", [1.0, -1.0])
def test_at_the_critical_torque_itself_there_is_no_saddle(sense):
    """At -sin(phi) + 1 = 0 the saddle and the centre are one."""
    for base in (pk.Coefficients(0.0, 1.0, 0.0), pk.Potential("-cos(q)", "q", period="2*pi")):
        driven = pk.Perturbed(base, damping=0.1, torque=sense, forcing=pk.Harmonic(0.1, 1.0))
        found = pk.melnikov(driven).isel(saddle=-1)
        assert np.isnan(found.chaos_threshold.values).all()
        assert (found.threshold_validity.values == pk.Validity.NO_EQUILIBRIUM).all()
