"""Orbits under a constant torque, against integrations in time and quadratures in many digits."""

import mpmath
import numpy as np
import pytest
from scipy.integrate import quad, solve_ivp

import phasekit as pk

KIND = pk.OrbitKind
PENDULUM = pk.Perturbed(pk.Pendulum(length=1.0, g=1.0), torque=0.1)


def integrated(A, B, C, N, start, until):
    """States along the motion, and where it turns: times and angles."""
    found = solve_ivp(
        lambda _, y: [y[1], C * np.cos(y[0]) - (B - A * np.cos(y[0])) * np.sin(y[0]) + N],
        (0.0, until), start, events=lambda _, y: y[1], rtol=1e-11, atol=1e-12, method="DOP853",
    )  # fmt: skip
    return found.y, found.t_events[0], np.reshape(found.y_events[0], (-1, 2))[:, 0]


@pytest.mark.slow
def test_orbits_against_integration():
    rng = np.random.default_rng(0)
    n = 14
    A, B, C, N = rng.normal(size=(4, n)) * np.array([[1.0], [1.0], [1.0], [0.4]])
    phi, dphi = rng.uniform(-4.0, 4.0, n), 1.2 * rng.normal(size=n)
    librating = running = 0
    for i in range(n):
        system = pk.Perturbed(pk.Coefficients(A[i], B[i], C[i]), torque=N[i])
        orbit = pk.orbits(system, phi[i], dphi[i])
        forth, times, places = integrated(A[i], B[i], C[i], N[i], [phi[i], dphi[i]], 50.0)
        if orbit.orbit_kind == KIND.LIBRATION:
            assert times[2] - times[0] == pytest.approx(orbit.period.item(), rel=1e-8)
            assert sorted(places[:2]) == pytest.approx(
                [orbit.phi_min.item(), orbit.phi_max.item()], abs=1e-8
            )
            assert orbit.gain_per_turn == 0.0
            librating += 1
            continue
        assert orbit.orbit_kind == KIND.RUNNING
        back, _, before = integrated(A[i], B[i], C[i], N[i], [phi[i], -dphi[i]], 50.0)
        (turned,) = [*places, *before]
        ends = [orbit.phi_min.item(), orbit.phi_max.item()]
        assert ends == pytest.approx([turned, np.inf] if N[i] > 0 else [-np.inf, turned], abs=1e-7)
        assert np.isnan([orbit.period, orbit.frequency, orbit.action]).all()
        # the energy, less what stands in the potential, grows from turn to turn
        assert orbit.gain_per_turn.item() == pytest.approx(2 * np.pi * abs(N[i]))
        far = forth if abs(forth[0, -1]) > abs(back[0, -1]) else back
        assert np.sign(far[1, -1]) == np.sign(N[i])
        running += 1
    assert librating > 3
    assert running > 3


@pytest.mark.slow
@pytest.mark.parametrize(("gap", "rel"), [(-1e-3, 1e-13), (-1e-20, 1e-12)])
def test_periods_next_to_a_separatrix(gap, rel):
    found = pk.orbits(PENDULUM, gap=gap, side="left")
    with mpmath.workdps(80):
        N = mpmath.mpf(0.1)
        bottom, top = mpmath.asin(N), mpmath.pi - mpmath.asin(N)
        U = lambda x: -mpmath.cos(x) - N * x  # noqa: E731
        h = U(top) + mpmath.mpf(gap)
        slope = lambda x: mpmath.sin(x) - N  # noqa: E731
        low = mpmath.findroot(
            lambda x: U(x) - h, pk.separatrices(PENDULUM).turning_phi.values[1, 0]
        )
        first = top - mpmath.sqrt(-2 * mpmath.mpf(gap) / mpmath.cos(mpmath.asin(N)))
        high = mpmath.findroot(lambda x: (U(x) - h) / slope(x), first)
        speed = lambda x: mpmath.sqrt(2 * max(h - U(x), mpmath.mpf(10) ** -90))  # noqa: E731
        parts = [low, bottom, *(top - 4.0**-k * (top - bottom) for k in range(1, 17)), high]
        parts = [x for x in parts if x < high] + [high]
        want = 2 * mpmath.quad(lambda x: 1 / speed(x), parts)
    assert found.period.item() == pytest.approx(float(want), rel=rel)
    assert abs(found.period.item() - float(want)) < max(10 * found.period_error.item(), 1e-12)


def test_period_is_the_derivative_of_the_area():
    """d(2 pi J)/dh = T, and J of the separatrix is its lobe's area."""
    step, energy = 1e-5, np.array([-0.9, -0.5, 0.3])
    high, low = (pk.orbits(PENDULUM, energy=energy + s * step).action for s in (1, -1))
    period = pk.orbits(PENDULUM, energy=energy).period
    assert (np.pi * (high - low) / step).values == pytest.approx(period.values, rel=1e-8)
    area = pk.separatrices(PENDULUM).lobe_area.sel(saddle="upper", side="left").item()
    last = pk.orbits(PENDULUM, gap=-1e-14, side="left").action.item()
    assert 2 * np.pi * last == pytest.approx(area, rel=1e-10)
    action = quad(
        lambda x: np.sqrt(max(0.0, 2 * (np.cos(x) + 0.1 * x - 0.5))),
        *(pk.orbits(PENDULUM, energy=-0.5)[name].item() for name in ("phi_min", "phi_max")),
        epsabs=1e-12,
    )[0] / np.pi  # fmt: skip
    assert pk.orbits(PENDULUM, energy=-0.5).action.item() == pytest.approx(action, rel=1e-7)


def test_a_turn_on_the_orbit_is_the_same():
    here, there = (pk.orbits(PENDULUM, 0.5 + x, 0.3) for x in (0.0, 4 * np.pi))
    assert there.period.item() == pytest.approx(here.period.item(), rel=1e-13)
    assert (there.phi_min - here.phi_min).item() == pytest.approx(4 * np.pi)
    assert (there.orbit_energy - here.orbit_energy).item() == pytest.approx(-0.4 * np.pi)
    assert there.orbit_energy == pk.energy(PENDULUM, 0.5 + 4 * np.pi, 0.3).energy_integral


def test_without_torque_it_is_the_exact_orbit():
    level = pk.orbits(pk.Pendulum(length=1.0, g=1.0), [0.5, 0.5, 0.0], [0.1, 3.0, 0.0])
    found = pk.orbits(PENDULUM.replace(torque=0.0), [0.5, 0.5, 0.0], [0.1, 3.0, 0.0])
    assert level.orbit_kind.values.tolist() == [KIND.LIBRATION, KIND.ROTATION, KIND.EQUILIBRIUM]
    for name in level.data_vars:
        assert np.array_equal(found[name], level[name], equal_nan=True), name
    swept = pk.sweep(PENDULUM, torque=[0.0, 0.1, 1.5], of=["equilibria"])
    both = pk.orbits(PENDULUM.replace(torque=swept.torque), 0.5, 3.0)
    assert both.orbit_kind.values.tolist() == [KIND.ROTATION, KIND.RUNNING, KIND.RUNNING]


@pytest.mark.parametrize("torque", [1e-16, -1e-16, 1e-300])
def test_next_to_no_torque_what_rotates_runs(torque):
    orbit = pk.orbits(PENDULUM.replace(torque=torque), 0.5, 5.0)
    assert orbit.orbit_kind == KIND.RUNNING
    end = orbit.phi_min if torque > 0 else orbit.phi_max
    # the height that is gained since the turning point is the kinetic energy
    assert abs(end.item()) == pytest.approx(12.5 / abs(torque), rel=0.2)


@pytest.mark.slow
@pytest.mark.parametrize("torque", [0.0, 0.1, -0.1])
def test_separatrix_motion(torque):
    """Along the lobe: the energy is the saddle's, the ends come to it at its exponent."""
    system = pk.Perturbed(pk.Coefficients(1.0, 0.35, 0.12), torque=torque)
    sep = pk.separatrices(system).sel(saddle="lower")
    t = np.array([-40.0, -3.0, 0.0, 1.0, 30.0])
    for side in ("left", "right"):
        motion = pk.separatrix_motion(system, t, side=side)
        phi, dphi = motion.motion_phi.values, motion.motion_dphi.values
        assert phi[2] == pytest.approx(
            (sep.saddle_phi + sep.turning_offset.sel(side=side)).item(), abs=1e-12
        )
        energy = pk.energy(system, phi, dphi).energy_integral.values
        assert energy == pytest.approx(np.full(5, sep.saddle_energy.item()), abs=1e-13)
        later = pk.flow(system, phi[1], dphi[1], [4.0])
        assert later.motion_phi.item() == pytest.approx(phi[3], abs=1e-8)
        decay = abs(dphi[[0, 4]]) / np.exp(-sep.saddle_exponent.item() * np.array([40.0, 30.0]))
        assert decay[0] == pytest.approx(decay[1], rel=1e-7)
    if torque:
        away = pk.separatrix_motion(
            system, t, saddle="upper", side="right" if torque > 0 else "left"
        )
        assert np.isnan(away.motion_phi).all()


def test_energy_and_its_derivatives():
    system = pk.Perturbed(pk.Coefficients(1.0, 0.35, 0.12), torque=[0.0, 0.2, np.nan])
    with pytest.warns(pk.InvalidCellsWarning):
        pk.equilibria(system)
    x, step = 7.3, 1e-5
    height = pk.potential(system, [x - step, x, x + step]).potential
    base = pk.potential(pk.Coefficients(1.0, 0.35, 0.12), x).potential.item()
    assert height.isel(point=1).values == pytest.approx([base, base - 0.2 * x, np.nan], nan_ok=True)
    slope = (height.isel(point=2) - height.isel(point=0)).values / (2 * step)
    found = pk.gradient(system, x).potential_gradient.values
    assert found == pytest.approx(slope, rel=1e-9, nan_ok=True)
    energy = pk.energy(system, x, 2.0).energy_integral
    assert energy.values == pytest.approx([base + 2.0, base - 0.2 * x + 2.0, np.nan], nan_ok=True)
    speed = pk.phase_velocity(system, x, energy).phase_velocity
    assert speed.values == pytest.approx([2.0, 2.0, np.nan], nan_ok=True)
    assert (
        pk.curvature(system, x).potential_curvature[1]
        == pk.curvature(pk.Coefficients(1.0, 0.35, 0.12), x).potential_curvature.item()
    )
    assert "torque" in height.equation


@pytest.mark.slow
def test_angle_variable_grows_evenly():
    t = np.linspace(0.0, 5.0, 7)
    motion = pk.flow(PENDULUM, 0.8, 0.1, t, rtol=1e-13, atol=1e-14)
    found = pk.action_angle(PENDULUM, motion.motion_phi.values, motion.motion_dphi.values)
    grown = np.unwrap(found.angle.values)
    assert grown - grown[0] == pytest.approx(found.frequency.values[0] * t, abs=1e-8)
    assert (found.angle_error < 1e-8).all()
    assert np.isnan(pk.action_angle(PENDULUM, 0.0, 3.0).angle)


@pytest.mark.parametrize("abc", [(-1.0, 0.3, 0.0), (1.0, 0.0, 0.2), (1.0, 0.0, 0.0)])
@pytest.mark.parametrize("torque", [1e-300, 1e-16, -1e-16, 1e-9, 1e-3])
def test_equal_saddles_part_by_the_torque(abc, torque):
    """The one that lies ahead is lower by the torque times their distance: never an eight."""
    ds = pk.separatrices(pk.Perturbed(pk.Coefficients(*abc), torque=torque))
    assert ds.topology == pk.Topology.HOMOCLINIC
    assert (ds.loop == pk.Loop.LOBE).all()
    away = ds.turning_offset.sel(side="right" if torque > 0 else "left")
    assert np.isinf(away).all()


@pytest.mark.slow
def test_saddles_that_the_torque_makes_equal():
    """As high within rounding: joined, both with the area of the arc between them."""
    system = pk.Coefficients(1.0, 0.35, 0.12)
    low, high = -0.25, -0.2
    for _ in range(12):
        torques = np.linspace(low, high, 33)
        energy = pk.separatrices(pk.Perturbed(system, torque=torques)).saddle_energy.values
        i = int(np.argmax(energy[:, 0] < energy[:, 1]))  # the first
        assert i > 0
        low, high = torques[i - 1], torques[i]
    at, above, below = (
        pk.separatrices(pk.Perturbed(system, torque=x)) for x in (low, low + 1e-9, low - 1e-9)
    )
    topologies = [ds.topology.item() for ds in (below, at, above)]
    kinds = pk.Topology
    assert topologies == [kinds.HOMOCLINIC, kinds.HETEROCLINIC, kinds.FIGURE_EIGHT]
    assert (at.loop == pk.Loop.HETEROCLINIC).all()
    lower, upper = (at.sel(saddle=name) for name in ("lower", "upper"))
    arc = upper.saddle_phi.item() - lower.saddle_phi.item()
    assert lower.turning_offset.sel(side="left").item() == pytest.approx(arc, abs=1e-12)
    assert upper.turning_offset.sel(side="right").item() == pytest.approx(-arc, abs=1e-12)
    area = lower.lobe_area.sel(side="left").item()
    assert upper.lobe_area.sel(side="right").item() == pytest.approx(area, rel=1e-11)
    assert above.lobe_area.sel(saddle="lower", side="left").item() == pytest.approx(area, rel=1e-6)
    end = below.lobe_area.sel(saddle="upper", side="right").item()
    assert end == pytest.approx(area, rel=1e-6)
