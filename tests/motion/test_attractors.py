"""Attractors of systems that do not vary, and how surely cells are assigned: other integrators."""

import warnings

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from witnesses.variants import some

import phasekit as pk

PENDULUM = pk.Coefficients(0.0, 1.0, 0.0)
WELL = pk.Potential("x^4/4 - x^2/2", "x")
KIND = pk.AttractorKind


def quietly(system, phi, dphi, **how):
    with warnings.catch_warnings():
        warnings.filterwarnings("ignore", "basin: .* too coarse", RuntimeWarning)
        return pk.basins(system, phi=phi, dphi=dphi, **how)


def speed(ds, row=-1):
    """Mean speed on an attractor, in rad per unit of time."""
    return 2.0 * np.pi * ds.attractor_rotation.values[row] / float(ds.attrs["period"])


@pytest.mark.parametrize("damping", [1e-3, 0.1, 1.0])
@pytest.mark.parametrize("torque", [-1.5, 1.01, 3.0])
def test_above_the_critical_torque_there_is_one_rotation(damping, torque):
    ds = quietly(
        pk.Perturbed(PENDULUM, damping=damping, torque=torque),
        np.linspace(-3.0, 3.0, 6), np.linspace(-4.0, 4.0, 6),
    )  # fmt: skip
    assert ds.attractor_kind.values.tolist() == [KIND.ROTATION]
    assert ds.basin_fraction.values.tolist() == [1.0]
    # Power: torque times speed is damping times the mean square of the speed.
    assert np.sign(speed(ds)) == np.sign(torque)
    period = 2.0 * np.pi / abs(speed(ds))
    # The one multiplier that is not 1 is the contraction of areas in a turn.
    multiplier = ds.attractor_multiplier.item()
    assert multiplier == pytest.approx(np.exp(-damping * period), rel=1e-7, abs=1e-12)


def test_an_overdamped_rotation_by_its_closed_form():
    # phi' = (N - sin phi)/d: mean speed sqrt(N^2 - 1)/d, up to 1/d^2.
    for damping in (1e2, 1e3):
        ds = pk.attractors(
            pk.Perturbed(PENDULUM, damping=damping, torque=1.5), phi=[0.0, 2.0], dphi=[0.0, 1.0]
        )
        assert ds.attractor_kind.values.tolist() == [KIND.ROTATION]
        assert speed(ds) == pytest.approx(1.25**0.5 / damping, rel=3.0 / damping**2 + 1e-6)


def fates(force, damping, states, time):
    """Where motions of x'' = force(x) - damping x' are, by SciPy."""

    def rates(_, x):
        return [x[1], force(x[0]) - damping * x[1]]

    return np.array([
        solve_ivp(rates, (0.0, time), x, "DOP853", rtol=1e-9, atol=1e-10).y[:, -1] for x in states
    ])  # fmt: skip


def test_what_one_cell_alone_comes_to_is_found():
    """The search passes it over; another integrator says where it comes to rest."""
    driven = pk.Perturbed(pk.Coefficients(0.0, 1.0, 0.0), damping=0.1, torque=0.9)
    phi, dphi = np.linspace(-3.0, 3.0, 21), np.linspace(-3.0, 20.0, 21)
    found = pk.basins(driven, phi=phi, dphi=dphi)
    assert found.attractor_kind.values.tolist() == [
        pk.AttractorKind.EQUILIBRIUM, pk.AttractorKind.ROTATION,
    ]  # fmt: skip
    assert np.argwhere(found.basin.values == 0).tolist() == [[19, 2]]
    assert found.basin_fraction.values == pytest.approx([1 / 441, 440 / 441], rel=1e-14)
    end = solve_ivp(
        lambda t, x: [x[1], 0.9 - 0.1 * x[1] - np.sin(x[0])], (0.0, 300.0), [phi[19], dphi[2]],
        rtol=1e-9,
    ).y[:, -1]  # fmt: skip
    assert end == pytest.approx([np.arcsin(0.9), 0.0], abs=1e-5)
    assert found.attractor_phi.values[0, 0] == pytest.approx(np.arcsin(0.9))


@pytest.mark.parametrize(("damping", "torque", "unit"), some([
    (0.3, -0.6, 1e9), (0.1, 0.5, 1.0), (0.15, 0.3, 1e-9),
], 2))  # fmt: skip
def test_rest_and_rotation_share_the_states_as_another_integrator_says(damping, torque, unit):
    system = pk.Perturbed(
        pk.Coefficients(0.0, unit**2, 0.0), damping=damping * unit, torque=torque * unit**2
    )
    phi, dphi = np.linspace(-3.0, 3.0, 7), np.linspace(-3.1, 3.0, 8)
    ds = quietly(system, phi, dphi * unit)
    assert ds.attractor_kind.values.tolist() == [KIND.EQUILIBRIUM, KIND.ROTATION]
    assert ds.attractor_phi.values[0, 0] == pytest.approx(np.arcsin(torque), abs=1e-12)
    states = np.stack(np.meshgrid(phi, dphi, indexing="ij"), -1).reshape(-1, 2)
    ends = fates(lambda x: torque - np.sin(x), damping, states, 8.0 / damping)
    turns = (np.abs(ends[:, 1]) > 0.5).reshape(ds.basin.shape)
    assert 0 < turns.sum() < turns.size
    assert ds.basin_decided.values.all()
    assert np.array_equal(ds.basin.values == 1, turns)


@pytest.mark.parametrize("damping", [1e2, 1e4, 1e5])
def test_strong_damping_ends_in_the_nearest_well_whatever_the_time(damping):
    ds = quietly(pk.Perturbed(WELL, damping=damping), [-1.0, 0.5, 1.0], [-0.5, 0.0, 0.5])
    assert ds.attractor_kind.values.tolist() == [KIND.EQUILIBRIUM] * 2
    assert ds.basin.values.tolist() == [[0] * 3, [1] * 3, [1] * 3]
    assert ds.attractor_exponent.values == pytest.approx([-2.0 / damping] * 2, rel=1e-3)
    tilted = quietly(
        pk.Perturbed(PENDULUM, damping=damping, torque=0.9), np.linspace(-3.0, 3.0, 9), [-1.0, 1.0]
    )
    assert tilted.attractor_phi.values[:, 0] == pytest.approx([np.arcsin(0.9)])
    assert tilted.basin_fraction.values.tolist() == [1.0]


@pytest.mark.parametrize("length", [1.0, 1e-6])
@pytest.mark.parametrize("power", [4, 6])
def test_degenerate_rest_attracts(power, length):
    well = pk.Potential(f"x^{power}/({power}*l^{power - 2})", "x", {"l": length})
    axis = length * np.linspace(-1.0, 1.0, 6)
    ds = pk.basins(pk.Perturbed(well, damping=0.2), phi=axis, dphi=axis)
    assert ds.attractor_kind.values.tolist() == [KIND.EQUILIBRIUM]
    assert abs(ds.attractor_phi.values.item()) < 1e-9 * length
    assert ds.attractor_multiplier.item() == pytest.approx(1.0, abs=1e-9)
    assert ds.basin_fraction.values.tolist() == [1.0]


@pytest.mark.parametrize("rtol", [1e-8, 1e-11])
def test_cells_that_another_integration_assigns_otherwise_are_marked(rtol):
    driven = pk.Perturbed(WELL, damping=0.15, forcing=pk.Harmonic(0.2, 1.0))
    axis = -2.2 + 4.4 * (np.arange(40) + 0.5) / 40
    ds = quietly(driven, axis, axis, rtol=rtol)
    states = np.stack(np.meshgrid(axis, axis, indexing="ij"), -1).reshape(-1, 2)
    fine = pk.stroboscopic(driven, *states.T, n=1, skip=160, rtol=1e-13, atol=1e-14)
    points = ds.attractor_phi.values[:, 0]
    other = np.abs(fine.section_phi.values - points).argmin(-1).reshape(ds.basin.shape)
    assert other.shape == ds.basin.shape
    differ = other != ds.basin.values
    decided = ds.basin_decided.values
    assert differ.sum() > 5
    assert not (differ & decided).any()
    assert decided.mean() > 0.5
    error = ds.basin_fraction_error.values
    assert (np.abs(ds.basin_fraction.values - 0.5) < 3.0 * error).all()
    assert (error < 0.02).all()


@pytest.mark.slow
def test_a_turn_and_the_speeds_of_its_levels_are_searched_by_default():
    """The swing from the top is 2 w at the bottom; a portrait shows 1.42 times that."""
    pendulum = pk.Perturbed(pk.Pendulum(length=1.0, g=4.0), damping=0.4)
    ds = pk.basins(pendulum)
    assert ds.basin.shape == (100, 100)
    np.testing.assert_allclose(ds.state_phi, np.pi * (np.arange(1, 200, 2) / 100 - 1))
    assert ds.state_dphi.max().item() == pytest.approx(1.42 * 4.0 * 0.99)
    assert ds.basin_fraction.values.tolist() == [1.0]
    ds = pk.attractors(pendulum, dphi=[0.0, 1.0])
    np.testing.assert_allclose(ds.attractor_phi, [[0.0]], atol=1e-9)
    own = pk.Perturbed(pendulum.system, damping=0.4, terms=pk.Term("-b*dphi^3", {"b": 0.1}))
    np.testing.assert_allclose(pk.attractors(own).attractor_phi, [[0.0]], atol=1e-9)
