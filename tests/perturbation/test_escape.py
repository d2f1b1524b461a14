"""Escape by noise: the value of simulated paths, and the limits of Kramers."""

import mpmath
import numpy as np
import pytest

import phasekit as pk
from phasekit.perturbation.depopulation import depopulation, two_rims

EIGHT = pk.Coefficients(1.0, 0.35, 0.0)


def rates(system, damping, kT, **options):
    return pk.escape_rate(pk.Perturbed(system, damping=damping, kT=kT), **options)


def test_factor_of_low_damping():
    def exact(D):
        integrand = lambda s: mpmath.log1p(-mpmath.exp(-D * (s * s + 0.25))) / (s * s + 0.25)  # noqa: E731
        return mpmath.exp(mpmath.quad(integrand, [0, 1, 5, 20, mpmath.inf]) / mpmath.pi)

    for D in (0.1, 1.0, 5.0):
        assert depopulation(D) == pytest.approx(float(exact(D)), rel=1e-9)
    assert depopulation(1e-9) == pytest.approx(1e-9, rel=1e-4)
    assert depopulation(1e3) == 1.0


def test_simulated_paths():
    """1,500 Langevin paths: 5.32(14)e-4; the formula of a high barrier is 19 % high at 0.02."""
    at = [rates(EIGHT, damping, 0.04).sel(saddle="lower", side="right") for damping in (0.5, 0.02)]
    assert at[0].escape_rate.item() == pytest.approx(5.34e-4, rel=0.005)
    assert at[1].escape_rate.item() == pytest.approx(1.91e-4 / 1.19, rel=0.03)
    assert [x.escape_regime.item() for x in at] == [
        pk.EscapeRegime.TURNOVER, pk.EscapeRegime.ENERGY_DIFFUSION
    ]  # fmt: skip
    assert at[0].barrier.item() == pytest.approx(0.21125, rel=1e-13)
    assert 0.0 < at[0].escape_error.item() < at[1].escape_error.item() < 0.2


def test_kramers_in_the_limit_of_a_high_barrier():
    kT, damping = 0.002, 20.0
    ds = rates(EIGHT, damping, kT).sel(saddle="lower", side="right")
    k, w0 = np.sqrt(0.65), np.sqrt(1 - 0.35**2)
    kramers = (np.sqrt(k * k + damping**2 / 4) - damping / 2) / k * w0 / (2 * np.pi)
    want = kramers * np.exp(-0.21125 / kT)
    assert ds.escape_rate.item() == pytest.approx(want, rel=0.02)
    assert ds.escape_regime == pk.EscapeRegime.SPATIAL_DIFFUSION
    slow = [rates(EIGHT, d, kT).escape_rate.values[0, 1] for d in (1e-6, 2e-6)]
    assert slow[1] == pytest.approx(2 * slow[0], rel=1e-2)


def test_the_two_wells_balance():
    """In equilibrium as many come as go: rates are in the ratio of the wells' integrals."""
    uneven, kT = pk.Coefficients(1.0, 0.35, 0.1), 0.03
    there = {c: rates(uneven, 0.8, kT, center=c) for c in ("lower_center", "upper_center")}
    sides = {c: ds.escape_rate.sel(saddle="lower").dropna("side") for c, ds in there.items()}
    assert [x.side.item() for x in sides.values()] == ["right", "left"]
    sep = pk.separatrices(uneven).saddle_phi.values
    ends = [(sep[0], sep[1] % (2 * np.pi)), (sep[1] % (2 * np.pi) - 2 * np.pi, sep[0])]
    held = []
    for low, high in ends:
        x = np.linspace(low, high, 200001)
        V = -0.35 * np.cos(x) + 0.5 * np.cos(x) ** 2 - 0.1 * np.sin(x)
        held.append(np.trapezoid(np.exp(-V / kT), x))
    ratio = sides["lower_center"].item() / sides["upper_center"].item()
    assert ratio == pytest.approx(held[1] / held[0], rel=2e-3)


def test_nothing_said_where_rates_mean_nothing():
    for changes in ({"kT": 0.0}, {"damping": 0.0}, {"torque": 0.1}, {"kT": 0.2}):
        ds = pk.escape_rate(pk.Perturbed(EIGHT, **{"damping": 0.5, "kT": 0.04, **changes}))
        assert np.isnan(ds.escape_rate.sel(saddle="lower")).all()
    alone = rates(pk.Pendulum(length=1.0, g=1.0), 0.1, 0.2)
    assert np.isfinite(alone.escape_rate.sel(saddle="upper")).all()
    assert np.isnan(alone.escape_rate.sel(saddle="lower")).all()
    with pytest.raises(pk.ParameterError, match="center: got 'middle', wants one of"):
        rates(EIGHT, 0.1, 0.04, center="middle")
