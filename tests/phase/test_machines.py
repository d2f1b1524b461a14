"""A free rotor at its momentum, along arc length: against quadrature and integration in time."""

import numpy as np
import pytest
from scipy.integrate import quad

import phasekit as pk

DISK = pk.GyroRotorDisk(beta=1.0, e=0.1, a=0.01, r=0.1, omega1=15.0, m=2.0)
ROTOR = pk.FreeGyroRotor(DISK, 0.02)
MOMENTUM = ROTOR.angular_momentum(0.0, 0.0)
AT = ROTOR.amended(MOMENTUM)


def over(low, high, level, weight):
    """Integral of a weight over an arc between two turning points, by SciPy."""
    middle, half = 0.5 * (low + high), 0.5 * (high - low)

    def integrand(theta):
        phi = middle + half * np.sin(theta)
        return half * np.cos(theta) * weight(phi, AT.phase_velocity(phi, level))

    return quad(integrand, -0.5 * np.pi, 0.5 * np.pi, epsabs=1e-13, epsrel=1e-12)[0]


def momentum_of(phi, speed):
    return AT.effective_inertia(phi) * speed


@pytest.mark.parametrize("state", [(0.3, 0.5), (1.2, 12.0)])
def test_orbits_are_those_of_quadrature(state):
    ds = pk.orbits(ROTOR, *state)
    low, high, level = (ds[name].item() for name in ("phi_min", "phi_max", "orbit_energy"))
    energy = 0.5 * AT.effective_inertia(state[0]) * state[1] ** 2 + AT.potential(state[0])
    assert level == pytest.approx(energy, rel=1e-14)
    assert [AT.potential(low), AT.potential(high)] == pytest.approx([level] * 2, rel=1e-13)
    period = 2.0 * over(low, high, level, lambda phi, v: 1.0 / v)
    assert ds.period.item() == pytest.approx(period, rel=1e-9)
    action = over(low, high, level, momentum_of) / np.pi
    assert ds.action.item() == pytest.approx(action, rel=1e-10)
    assert ds.action.units == "kg m2 s-1"
    after = pk.flow(ROTOR, *state, ds.period.item())
    assert after.motion_phi.item() == pytest.approx(state[0], abs=1e-8)


def test_rotations_gain_a_turn_in_a_period():
    ds = pk.orbits(ROTOR, 1.5, 40.0)
    assert ds.orbit_kind == pk.OrbitKind.ROTATION
    after = pk.flow(ROTOR, 1.5, 40.0, ds.period.item())
    assert after.motion_phi.item() == pytest.approx(1.5 + 2.0 * np.pi, abs=1e-8)


def test_separatrices_are_on_the_levels_of_the_saddles():
    ds = pk.separatrices(ROTOR)
    rests = pk.equilibria(ROTOR)
    saddles = rests.phi.values[rests.kind.values == pk.EquilibriumKind.SADDLE]
    np.testing.assert_allclose(ds.saddle_phi, saddles, atol=1e-13)
    assert ds.figure_eight
    eight = ds.isel(saddle=1)
    level, start = eight.saddle_energy.item(), eight.saddle_phi.item()
    assert level == pytest.approx(AT.potential(start), rel=1e-14)
    for side in ("left", "right"):
        lobe = eight.sel(side=side)
        end = start + lobe.turning_offset.item()
        assert AT.potential(end) == pytest.approx(level, rel=1e-12)
        area = 2.0 * over(*sorted((start, end)), level, momentum_of)
        assert lobe.lobe_area.item() == pytest.approx(area, rel=1e-9)
    high = ds.saddle_energy[0].item()
    winding = quad(lambda x: momentum_of(x, AT.phase_velocity(x, high)), -np.pi, np.pi,
                   points=[ds.saddle_phi[0].item()], epsabs=1e-10)[0]  # fmt: skip
    assert ds.winding_area[0].item() == pytest.approx(winding, rel=1e-7)


def test_motion_on_a_separatrix_is_that_in_time():
    ds = pk.separatrix_motion(ROTOR, [0.0, 0.3], saddle=1, side="right")
    start = [ds[f"motion_{name}"][0].item() for name in ("phi", "dphi")]
    after = pk.flow(ROTOR, *start, 0.3)
    for name in ("phi", "dphi"):
        assert after[f"motion_{name}"].item() == pytest.approx(
            ds[f"motion_{name}"][1].item(), abs=1e-9
        )


def test_action_and_angle_and_back():
    phi, dphi = [0.3, 1.2, 1.5, -0.5], [0.5, 12.0, -40.0, 0.1]
    known = pk.action_angle(ROTOR, phi, dphi)
    assert known.orbit_family.values.tolist() == [8, 10, -2, 2]
    back = pk.state_of(ROTOR, known.action, known.angle, known.orbit_family)
    np.testing.assert_allclose(back.phi_of_angle, phi, atol=1e-11)
    np.testing.assert_allclose(back.dphi_of_angle, dphi, atol=1e-9)


def test_maps_over_the_momentum_and_levels():
    swept = pk.sweep(ROTOR, momentum=[MOMENTUM, 0.05], of=["equilibria", "separatrices"])
    one = pk.separatrices(ROTOR.replace(momentum=MOMENTUM))
    np.testing.assert_array_equal(
        swept.lobe_area.isel(momentum=0).dropna("saddle", how="all"),
        one.lobe_area.dropna("saddle", how="all"),
    )
    assert swept.isel(momentum=1).phasekit.system() == ROTOR.replace(momentum=0.05)
    level = pk.orbits(ROTOR, 0.3, 0.5).orbit_energy.item()
    assert pk.orbits(ROTOR, energy=level, center=3).period.item() == pytest.approx(
        pk.orbits(ROTOR, 0.3, 0.5).period.item(), rel=1e-11
    )


def test_exponents_and_sections_of_what_nothing_disturbs():
    """Neighbours part linearly: exponents fall as log(t)/t, and their sum is 0."""
    short, long = (pk.lyapunov(ROTOR, 0.3, 0.5, duration=t) for t in (40.0, 400.0))
    assert abs(long.lyapunov_exponent[0]) < 0.3 * abs(short.lyapunov_exponent[0])
    assert "damping" not in long.coords
    ds = pk.stroboscopic(ROTOR, 0.3, 0.5, n=3, period=0.1)
    moved = pk.flow(ROTOR, 0.3, 0.5, [0.0, 0.1, 0.2])
    np.testing.assert_allclose(ds.section_phi, moved.motion_phi, atol=1e-9)


def test_folds_and_branches_are_where_steady_rotations_merge():
    """Two of the roots of a polynomial appear at each critical value."""
    found = pk.critical(ROTOR, "omega1", (10.0, 20.0))
    assert found.complete
    (fold,) = found.critical_fold.values
    counts = [
        pk.equilibria(ROTOR.replace(omega1=fold * (1.0 + side))).n_equilibria.item()
        for side in (-1e-9, 1e-9)
    ]
    assert counts == [2, 4]
    ds = pk.branches(ROTOR, "carrier_inertia", (0.005, 0.05))
    assert ds.complete
    for inertia in (0.008, 0.03):
        rests = pk.equilibria(ROTOR.replace(carrier_inertia=inertia))
        known = rests.phi.values[np.isfinite(rests.phi.values)]
        places = [
            np.interp(0.0, (at - inertia)[order], phi[order])
            for at, phi in zip(ds.carrier_inertia.values, ds.phi.values, strict=True)
            for order in [np.argsort(at)]
            if np.nanmin(at) < inertia < np.nanmax(at)
        ]
        assert (
            len(known) == pk.equilibria(ROTOR.replace(carrier_inertia=inertia)).n_equilibria.item()
        )
        for place in places:
            off = np.angle(np.exp(1j * (known - place)))
            assert np.abs(off).min() < 2e-2
    (special,) = np.flatnonzero(ds.special_kind.values == "fold")
    at, phi = ds.special_value.values[special], ds.special_phi.values[special]
    here = ROTOR.replace(carrier_inertia=at)
    assert at == pytest.approx(
        pk.critical(ROTOR, "carrier_inertia", (0.005, 0.05)).critical_fold.item(), rel=1e-12
    )
    step = 1e-3
    amended = here.amended(here.angular_momentum(0.0, 0.0))
    bends = [amended.curvature(phi + side) for side in (-step, step)]
    third = (bends[1] - bends[0]) / (2.0 * step)
    assert ds.quadratic.values[special] == pytest.approx(-0.5 * third, rel=1e-5)
    row, point = np.unravel_index(np.nanargmin(abs(ds.phi.values - phi)), ds.phi.shape)
    near = ROTOR.replace(carrier_inertia=ds.carrier_inertia.values[row, point])
    height = near.amended(near.angular_momentum(0.0, 0.0)).potential(ds.phi.values[row, point])
    assert ds.energy.values[row, point] == pytest.approx(height, rel=1e-12)
