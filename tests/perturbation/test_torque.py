"""Constant torques: equilibria under them, critical and retrapping torques."""

import numpy as np
import pytest
import xarray as xr

import phasekit as pk
from phasekit.phase.exact.under_torque import equilibria_under, numbers_under

RNG = np.random.default_rng(3)


def cells(n):
    A, B, C, N = (xr.DataArray(x, dims="cell") for x in RNG.normal(size=(4, n)))
    return pk.Coefficients(A, B, C), 0.6 * N


@pytest.mark.slow
def test_equilibria_under_torque_are_all_there():
    base, torque = cells(400)
    ds = pk.equilibria(pk.Perturbed(base, torque=torque))
    A, B, C, N = (x.values[:, None] for x in (*base, torque))
    x = np.linspace(-np.pi, np.pi, 20001)
    slope = (B - A * np.cos(x)) * np.sin(x) - C * np.cos(x) - N
    want = ((slope[:, 1:] * slope[:, :-1]) < 0.0).sum(axis=1)
    assert ds.n_equilibria.values.tolist() == want.tolist()
    assert {0, 2, 4} == set(want)
    phi = ds.phi.values
    assert np.isfinite(phi).sum() == want.sum()
    assert np.nanmax(abs((B - A * np.cos(phi)) * np.sin(phi) - C * np.cos(phi) - N)) < 1e-14
    centers = ds.kind.values == pk.EquilibriumKind.CENTER
    assert np.array_equal(centers, ds.curvature.values > 0.0)


def test_equilibria_next_to_three_merged_ones_are_counted():
    """V' = A sin phi (1 - cos phi) takes each torque below 3 sqrt(3)/4 A twice, others never."""
    A = -(10.0 ** RNG.uniform(-2, 3, 300))
    part = RNG.uniform(-2.0, 2.0, 300)
    want = np.where(abs(part) < np.sqrt(27.0) / 4.0, 2, 0)
    arrays = A, A, np.zeros(300), A * part
    assert numbers_under(*arrays, np.full(300, 2, np.int8)).tolist() == want.tolist()
    assert equilibria_under(*arrays).n_equilibria.tolist() == want.tolist()


def test_labels_are_those_without_torque():
    base, _ = cells(300)
    still = pk.equilibria(base)
    same = pk.equilibria(pk.Perturbed(base))
    for name in same:
        assert np.array_equal(still[name], same[name], equal_nan=True)
    bent = pk.equilibria(pk.Perturbed(base, torque=1e-9))
    assert np.array_equal(np.isnan(bent.phi), np.isnan(still.phi))
    assert np.nanmax(abs(np.exp(1j * bent.phi) - np.exp(1j * still.phi))) < 1e-5


def test_critical_torques_are_the_extremes():
    base, _ = cells(300)
    ds = pk.critical_torque(base)
    A, B, C = (x.values[:, None, None] for x in base)

    def slope(x):
        return (B - A * np.cos(x)) * np.sin(x) - C * np.cos(x)

    extremes = ds.critical_torque.values
    assert slope(ds.critical_phi.values[:, None])[:, 0] == pytest.approx(extremes, abs=1e-14)
    all_values = slope(np.linspace(-np.pi, np.pi, 4001))[:, 0]
    assert (all_values.max(axis=1) <= extremes[:, 1] + 1e-14).all()
    assert (all_values.min(axis=1) >= extremes[:, 0] - 1e-14).all()
    assert all_values.max(axis=1) == pytest.approx(extremes[:, 1], abs=1e-5)
    for factor, number in ((0.999999, 2), (1.000001, 0)):
        torque = factor * ds.critical_torque.sel(direction="plus", drop=True)
        found = pk.equilibria(pk.Perturbed(base, torque=torque)).n_equilibria
        assert (found == number).all()


def test_the_diode():
    """Two harmonics rectify a third at the most, at A = 1, B = C = 1/sqrt(2)."""
    minus, plus = pk.critical_torque(pk.Coefficients(1.0, 0.5**0.5, 0.5**0.5)).critical_torque
    assert (plus + minus) / (plus - minus) == pytest.approx(1 / 3, rel=1e-14)
    free = pk.critical_torque(pk.Coefficients(0.0, 0.0, 0.0))
    assert free.critical_torque.values.tolist() == [0.0, 0.0]


def test_extremes_of_any_potential():
    """Of exp(cos x) at cos x = (sqrt 5 - 1)/2; of a double well at its inflections, or the ends."""
    golden = 0.5 * (5.0**0.5 - 1.0)
    top = (1.0 - golden**2) ** 0.5 * np.exp(golden)
    found = pk.critical_torque(pk.Potential("s*exp(cos(x))", "x", {"s": [1.0, -2.0]}, "2*pi"))
    assert found.critical_complete.all()
    error = abs(
        found.critical_torque
        - xr.DataArray([[-top, top], [-2 * top, 2 * top]], dims=found.critical_torque.dims)
    )
    assert (error <= found.critical_torque_error).all()
    assert found.critical_torque_error.max() < 1e-14
    error = abs(abs(found.critical_phi) - np.arccos(golden))
    assert (error <= found.critical_phi_error + 3e-16).all()
    well = pk.Potential("x^4/4 - x^2/2", "x", interval=(-1.0, 1.2))
    found = pk.critical_torque(well)
    assert found.critical_torque.values == pytest.approx([-(12.0**0.5) / 9.0, 0.528], rel=1e-15)
    assert found.critical_phi.values == pytest.approx([3.0**-0.5, 1.2], rel=1e-15)
    with pytest.warns(RuntimeWarning, match="in 1 of 1 systems it is not proved"):
        found = pk.critical_torque(pk.Potential("besselj(0.5, x)", "x", interval=(0.5, 6.0)))
    assert not found.critical_complete
    # Without ends an odd power has no bound, an even one on one side, and a line is one.
    lines = {"x^4/4 - x^2/2": (-np.inf, np.inf), "x - x^3/3": (-np.inf, 1.0), "2*x": (2.0, 2.0)}
    for line, ends in lines.items():
        found = pk.critical_torque(pk.Perturbed(pk.Potential(line, "x"), torque=0.1, damping=0.2))
        assert tuple(found.critical_torque.values) == ends


def test_beyond_the_critical_torque_there_is_no_equilibrium():
    pendulum = pk.Pendulum(length=1.0, g=1.0)
    assert pk.equilibria(pk.Perturbed(pendulum, torque=1.5)).n_equilibria == 0
    on = pk.equilibria(pk.Perturbed(pendulum, torque=1.0))
    assert on.n_equilibria == 1
    assert on.kind.max() == pk.EquilibriumKind.DEGENERATE


def test_retrapping():
    damped = pk.Perturbed(pk.Pendulum(length=1.0, g=1.0), damping=0.1)
    found = pk.retrapping_torque(damped).retrapping_torque.values
    assert found == pytest.approx([-0.4 / np.pi, 0.4 / np.pi], rel=1e-14)
    # over both arcs of a cycle, as next to it
    at = [pk.Perturbed(pk.Coefficients(1.0, B, 0.3), damping=0.1) for B in (0.0, 1e-9)]
    left, right = (pk.retrapping_torque(p).retrapping_torque.values for p in at)
    assert left == pytest.approx(right, rel=1e-6)
