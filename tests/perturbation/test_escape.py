"""Escape by noise: the value of simulated paths, and the limits of Kramers."""

import os

import mpmath
import numpy as np
import pytest
import xarray as xr
from witnesses import langevin

import phasekit as pk
from phasekit.perturbation.depopulation import depopulation, two_rims

EIGHT = pk.Coefficients(1.0, 0.35, 0.0)
ABC = np.array([[1.0, 0.35, 0.12], [-1.0, 0.2, 0.3], [0.4, 1.0, 0.2], [1.0, -0.3, -0.2]]).T
MORE = int(os.environ.get("PHASEKIT_ENSEMBLES", "0"))


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


#: Loss over kT; rate and standard error of 2,400 paths from core to core in the eight, kT = .04.
PATHS = [(0.3, 6.37e-5, 0.19e-5), (1.0, 1.820e-4, 0.053e-4), (3.0, 3.95e-4, 0.12e-4),
         (10.0, 5.87e-4, 0.17e-4)]  # fmt: skip


@pytest.mark.parametrize(("loss", "simulated", "error"), PATHS)
def test_turnover(loss, simulated, error):
    """Where the bracket is wide: within three standard errors, and within its own error."""
    area = pk.separatrices(EIGHT).lobe_area.sel(saddle="lower", side="right").item()
    at = rates(EIGHT, loss * 0.04 / area, 0.04).sel(saddle="lower", side="right")
    assert abs(at.escape_rate.item() - simulated) < 3.0 * error
    off = abs(at.escape_rate.item() / simulated - 1.0)
    assert off - 2.0 * error / simulated < at.escape_error.item() < 0.3


#: Bias, damping, side; rate and standard error of 1,500 paths from the washboard's well at a
#: barrier of 6 kT to the next one.
WASHBOARD = [
    (0.4, 1.0, "left", 2.09e-4, 0.07e-4),
    (0.4, 0.1, "left", 2.98e-4, 0.10e-4),
    (0.05, 0.1, "left", 2.81e-4, 0.10e-4),
    (0.05, 0.1, "right", 0.67e-4, 0.05e-4),
]


@pytest.mark.parametrize(("bias", "damping", "side", "simulated", "error"), WASHBOARD)
def test_washboard(bias, damping, side, simulated, error):
    """Over either end of a tilted well; downhill the well lies left of its saddle."""
    barrier = 2.0 * (np.sqrt(1.0 - bias * bias) - bias * np.arccos(bias))
    junction = pk.JosephsonJunction(plasma_frequency=1.0)
    at = pk.escape_rate(pk.Perturbed(junction, damping=damping, torque=bias, kT=barrier / 6.0))
    found = at.sel(saddle="upper", side=side)
    assert abs(found.escape_rate.item() - simulated) < 3.0 * error
    assert 0.0 < found.escape_error.item() < 0.2


def test_two_ends_of_a_well():
    """Y(D) over each of equal ends, Y(2 D) over one alone."""
    D = np.array([0.01, 0.3, 2.0, 50.0])
    low, high = two_rims(D, 0.0)
    assert low == pytest.approx(depopulation(D), rel=1e-14)
    assert np.array_equal(low, high)
    near, far = (two_rims(D[1:], x)[0] for x in (1e-9, 29.9))
    assert near == pytest.approx(depopulation(D[1:]), rel=1e-7)
    assert far == pytest.approx(depopulation(2.0 * D[1:]), rel=1e-9)
    # Each end by itself: the higher the other one, the less is lost there.
    apart = np.linspace(0.0, 6.0, 13)
    low, high = two_rims(1.0, apart)
    assert (np.diff(low) > 0.0).all()
    assert (np.diff(high) < 0.0).all()
    tiny, small = (two_rims(d, apart * d**0.5)[0] / depopulation(2.0 * d) for d in (0.001, 0.01))
    assert tiny[1:] == pytest.approx(small[1:], rel=1e-12)  # distances count by the step


def test_far_rims_take_no_memory():
    """Next to no damping the energies between two rims are more steps than there is room for."""
    for D in (1e-12, 1e-300, 5e-324):
        low, high = two_rims(D, 1.0)
        assert low == pytest.approx(2.0 * D, rel=1e-3)
        assert high == 0.0
    tilted = pk.Perturbed(EIGHT, torque=0.05, damping=[1e-60, 1e-12], kT=0.04)
    over = pk.escape_rate(tilted).sel(saddle="lower", side="right").escape_rate.values
    assert over[0] * 1e48 == pytest.approx(over[1], rel=1e-5, abs=0.0)


def test_a_rate_that_is_not_known_is_none():
    """Over the higher end of a well whose lower one holds nothing back."""
    shallow = pk.Coefficients(1.1432336266295944, -0.019878981274646115, 0.4325042444657452)
    tilted = pk.Perturbed(shallow, torque=0.2649666843134663, damping=0.1, kT=0.02)
    found = pk.escape_rate(tilted, center="upper_center")
    high = found.sel(saddle="lower", side="right")
    assert high.barrier > 25.0 * 0.02
    assert np.isnan([high.escape_rate, high.escape_error]).all()
    assert high.escape_regime == pk.EscapeRegime.NOT_COMPUTED


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
    for changes in ({"kT": 0.0}, {"damping": 0.0}, {"quadratic": 0.1}, {"kT": 0.2}):
        ds = pk.escape_rate(pk.Perturbed(EIGHT, **{"damping": 0.5, "kT": 0.04, **changes}))
        assert np.isnan(ds.escape_rate.sel(saddle="lower")).all()
    alone = rates(pk.Pendulum(length=1.0, g=1.0), 0.1, 0.2)
    assert np.isfinite(alone.escape_rate.sel(saddle="upper")).all()
    lower = alone.sel(saddle="lower")
    assert np.isnan(lower.escape_rate).all()
    assert np.isnan(lower.barrier).all()
    assert (lower.escape_regime == pk.EscapeRegime.ABSENT).all()
    with pytest.raises(pk.ParameterError, match="center: got 'middle', wants one of"):
        rates(EIGHT, 0.1, 0.04, center="middle")


def test_a_vanishing_torque():
    system = pk.Coefficients(*(xr.DataArray(x, dims="cell") for x in ABC))
    for center, damping in (("lower_center", 0.2), ("upper_center", 2.0)):
        level, bent = (
            pk.escape_rate(pk.Perturbed(system, damping=damping, kT=0.03, torque=N), center=center)
            for N in (0.0, 1e-9)
        )
        assert np.isfinite(level.escape_rate).sum() >= 4
        for name in ("escape_rate", "barrier", "escape_error"):
            left, right = level[name].values, bent[name].values
            assert np.array_equal(np.isnan(left), np.isnan(right))
            assert np.allclose(left, right, rtol=1e-5, atol=0.0, equal_nan=True)
        assert np.array_equal(level.escape_regime, bent.escape_regime)


def test_the_washboard_in_the_limits_of_kramers():
    """Barrier 2 (sqrt(1 - i^2) - i arccos i); strong damping by the exact double integral."""
    junction = pk.JosephsonJunction(plasma_frequency=1.0)
    for i in (0.1, 0.5, 0.95):
        barrier = 2.0 * (np.sqrt(1.0 - i * i) - i * np.arccos(i))
        omega = (1.0 - i * i) ** 0.25
        shunt = junction.shunt(stewart_mccumber=1.0, bias=i, gamma=barrier / 40.0)
        at = pk.escape_rate(pk.Perturbed(junction, **shunt)).sel(saddle="upper", side="left")
        assert at.barrier.item() == pytest.approx(barrier, rel=1e-11)
        kramers = np.hypot(omega, 0.5) - 0.5
        want = kramers * np.exp(-40.0) / (2.0 * np.pi)
        assert at.escape_rate.item() == pytest.approx(want, rel=0.015)
        kT, damping = barrier / 8.0, 300.0
        hot = pk.Perturbed(junction, damping=damping, torque=i, kT=kT)
        at = pk.escape_rate(hot).sel(saddle="upper", side="left")
        # from the saddle before to the next, and from center to center over the saddle
        low, top = np.arcsin(i), np.pi - np.arcsin(i)
        x, y = (
            np.linspace(*ends, 100001) for ends in ((top - 2 * np.pi, top), (low, low + 2 * np.pi))
        )
        inner, outer = (
            np.trapezoid(np.exp(sign * (np.cos(z) + i * z - np.cos(low) - i * low) / kT), z)
            for sign, z in ((1.0, x), (-1.0, y))
        )
        assert at.escape_rate.item() == pytest.approx(kT / damping / (inner * outer), rel=1e-4)
        assert at.escape_regime == pk.EscapeRegime.SPATIAL_DIFFUSION
    there, mirrored = (
        pk.escape_rate(pk.Perturbed(junction, damping=0.3, torque=N, kT=0.05)).escape_rate.values[1]
        for N in (0.5, -0.5)
    )
    assert mirrored[1] == pytest.approx(there[0], rel=1e-9)


def test_cold_wells_are_left_at_the_least_rates_that_there_are():
    """Where exp(-barrier/kT) is subnormal the rate is, and nowhere NaN."""
    kT = np.geomspace(2.6e-3, 3.2e-3, 25)
    pendulum = pk.Pendulum(length=1.0, g=1.0)
    for torque in (0.0, 1e-3):
        cold = pk.Perturbed(pendulum, damping=0.1, torque=torque, kT=kT)
        rate = pk.escape_rate(cold).escape_rate.sel(saddle="upper", side="left").values
        assert np.isfinite(rate).all()
        assert (np.diff(rate) >= 0.0).all()
        assert rate[0] == 0.0 < rate[-1]


def test_any_well_in_the_limits_of_kramers():
    """A well of a cubic, open on one side; the middle one of three, over either side."""
    cubic = pk.Potential("x^2/2 - x^3/3", "x")
    kT = 1.0 / 6.0 / 40.0
    for damping in (0.5, 20.0):
        ds = pk.escape_rate(pk.Perturbed(cubic, damping=damping, kT=kT))
        at = ds.isel(saddle=0).sel(side="left")
        assert at.barrier.item() == pytest.approx(1.0 / 6.0, rel=1e-14)
        kramers = np.hypot(1.0, 0.5 * damping) - 0.5 * damping
        want = kramers * np.exp(-40.0) / (2.0 * np.pi)
        assert at.escape_rate.item() == pytest.approx(want, rel=0.03)
        assert np.isnan(ds.escape_rate.sel(side="right")).all()
    # at low damping the loss of a round of the separatrix, of area 6/5, over kT
    slow = pk.escape_rate(pk.Perturbed(cubic, damping=1e-6, kT=kT)).escape_rate.values[0, 0]
    assert slow == pytest.approx(1e-6 * 1.2 / kT * np.exp(-40.0) / (2.0 * np.pi), rel=0.06)
    three = pk.Potential("x^2*(x^2 - 1)^2*(1 + a*x)", "x", {"a": 0.01}, interval=(-9.0, 9.0))
    kT = 0.004
    points = pk.equilibria(three)
    middle = int(abs(points.phi.values).argmin())
    ds = pk.escape_rate(pk.Perturbed(three, damping=1.0, kT=kT), center=middle)
    assert np.isfinite(ds.escape_rate).sum() == 2
    heights = points.energy.values[points.kind == pk.EquilibriumKind.SADDLE]
    assert sorted(ds.barrier.values[np.isfinite(ds.barrier)])[0] == pytest.approx(heights.min())


@pytest.mark.skipif(not MORE, reason="slow: PHASEKIT_ENSEMBLES=1500 runs so many paths")
@pytest.mark.parametrize("loss", [0.3, 1.0, 3.0, 10.0])
@pytest.mark.parametrize("torque", [0.0, 0.02])
def test_ensembles(loss, torque):
    """Paths in the eight, from the core of the right well to that of the left one."""
    kT = 0.04
    tilted = pk.Perturbed(EIGHT, torque=torque)
    sep = pk.separatrices(tilted).sel(saddle="lower")
    area = sep.lobe_area.sel(side="right").item()
    at = tilted.replace(damping=loss * kT / area, kT=kT)
    points = pk.equilibria(tilted)
    right, left = (points.sel(equilibrium=f"{n}_center") for n in ("lower", "upper"))
    if right.phi < left.phi:
        right, left = left, right
    center = str(right.equilibrium.values)
    found = pk.escape_rate(at, center=center).sel(saddle="lower", side="right")
    rate = found.escape_rate.item()
    longest = 2.0 / rate
    ends = (sep.saddle_phi.item(), 9.0), (left.energy.item(), 0.0)
    times = langevin.first_times(
        1.0, 0.35, 0.0, torque, at.damping, kT, right.phi.item(), *ends, MORE, 0.06, longest, 1
    )
    (simulated, error), _ = langevin.rates(times, 0.5 / rate, longest)
    assert abs(rate - simulated) < 3.0 * error + 0.3 * found.escape_error.item() * rate
