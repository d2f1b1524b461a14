"""A rotor on a free support with damping and drive about its shaft, against its full equations."""

import os

import numpy as np
import pytest
from scipy.integrate import quad
from scipy.optimize import brentq
from witnesses import free_support

import phasekit as pk
from phasekit.perturbation import kept_momentum
from phasekit.systems.as_equations import formulas_of

ORBITS = int(os.environ.get("PHASEKIT_ENSEMBLES", "0"))
DISK = pk.GyroRotorDisk(beta=1.0, e=0.1, a=0.01, r=0.1, omega1=15.0, m=2.0)
ROTOR = pk.FreeGyroRotor(DISK, carrier_inertia=0.02)
P = ROTOR.angular_momentum(0.0, 0.0)
KIND = pk.EquilibriumKind


def push(perturbed):
    """The torque on the shaft over the inertia, written once more."""
    drive = [harmonic.values for harmonic in perturbed.forcing]

    def torque(t, phi, dphi):
        force = perturbed.torque - perturbed.damping * dphi
        force -= perturbed.quadratic * abs(dphi) * dphi
        return force + sum(F * np.cos(nu * t + at) for F, nu, at in drive)

    return torque


DRIVEN = {
    "all": pk.Perturbed(
        ROTOR, damping=0.3, quadratic=0.1, torque=2.0,
        forcing=[pk.Harmonic(1.5, 2.0, 0.3), pk.Harmonic(0.5, 3.1)],
    ),
    "momentum": pk.Perturbed(
        ROTOR.replace(momentum=-0.8), damping=0.2, forcing=pk.Harmonic(3.0, 9.0)
    ),
    "torque": pk.Perturbed(ROTOR.replace(a=-0.05, beta=0.4), torque=-1.0),
}  # fmt: skip


@pytest.mark.parametrize("name", DRIVEN)
@pytest.mark.parametrize("last", [4.0, -1.0])
def test_motions_are_those_of_the_whole_machine(name, last):
    perturbed, t = DRIVEN[name], np.linspace(0.0, last, 9)
    own = perturbed.system
    momentum = own.momentum if own.momentum is not None else own.angular_momentum(0.0, 0.0)
    ds = pk.flow(perturbed, 0.5, 1.0, t)
    want = free_support.integrate(own, momentum, push(perturbed), (0.5, 1.0), t).y
    assert ds.motion_phi.shape == (9,)
    assert np.abs(ds.motion_phi - want[0]).max() < 1e-7
    assert np.abs(ds.motion_dphi - want[2]).max() < 1e-6
    # the support follows, at the momentum that stays
    support = own.amended(momentum).omega1(ds.motion_phi.values, ds.motion_dphi.values)
    assert np.abs(support - want[1]).max() < 1e-6


def test_the_shaft_of_mujoco_is_damped_alike():
    engine = pytest.importorskip("witnesses.mujoco_mechanism", exc_type=ImportError)
    d = DISK
    body = engine.Mechanism(d.beta, d.e, d.a, d.r, d.m, d.g, ROTOR.carrier_inertia)
    perturbed, size = DRIVEN["all"], free_support.inertia(ROTOR)
    torque = push(perturbed)
    for phi, dphi, t in ((0.3, 2.0, 0.1), (-2.0, -1.5, 1.0), (1.2, 7.0, 0.0)):
        omega = free_support.speed(ROTOR, P, phi, dphi)
        ahead, back = (
            pk.flow(perturbed.replace(**shifted(perturbed, t)), phi, dphi, s * 1e-4)
            for s in (1, -1)
        )
        bend = (ahead.motion_dphi - back.motion_dphi).item() / 2e-4
        want = body.accelerations(0.0, phi, omega, dphi, 0.0, size * torque(t, phi, dphi))[1]
        assert bend == pytest.approx(want, rel=1e-5)


def shifted(perturbed, t):
    """Phases of the forcing from a time on."""
    names = ("forcing_phase", "forcing2_phase")
    return {n: h.phase + h.frequency * t for n, h in zip(names, perturbed.forcing, strict=True)}


@pytest.mark.parametrize("torque", [0.0, 3.0, -1.5, 200.0])
def test_equilibria_under_a_torque_are_steady_rotations(torque):
    ds = pk.equilibria(pk.Perturbed(ROTOR, damping=0.1, torque=torque))
    size, const = free_support.inertia(ROTOR), free_support.constants(ROTOR)

    def bend(phi):
        return free_support.rates(
            const, phi, free_support.speed(ROTOR, P, phi, 0.0), 0.0, size * torque
        )

    grid = np.linspace(-np.pi, np.pi, 4001)
    values = [bend(x)[1] for x in grid]
    places = np.flatnonzero(np.diff(np.sign(values)))
    want = [brentq(lambda x: bend(x)[1], grid[i], grid[i + 1], xtol=1e-14) for i in places]
    assert len(want) == {0.0: 4, 3.0: 2, -1.5: 4, 200.0: 0}[torque]
    assert ds.phi.values == pytest.approx(want, abs=1e-10)
    assert ds.n_equilibria == len(want)
    rising = [values[i] < 0.0 for i in places]
    assert (ds.kind == KIND.SADDLE).values.tolist() == rising
    for phi, kind, rate in zip(want, ds.kind.values, ds.natural_frequency.values, strict=True):
        slope = (bend(phi + 1e-5)[1] - bend(phi - 1e-5)[1]) / 2e-5
        if kind == KIND.CENTER:  # at rest, where the momentum fixes the support's speed
            assert rate == pytest.approx(np.sqrt(-slope), rel=1e-6)
    if not torque:
        same = pk.equilibria(ROTOR)
        for variable in ("phi", "energy", "curvature", "exponent"):
            assert np.array_equal(ds[variable], same[variable], equal_nan=True)
            assert ds[variable].attrs == same[variable].attrs


def test_energies():
    phi, dphi = np.array([0.3, -1.0, 4.0]), np.array([0.5, -3.0, 2.0])
    support = ROTOR.amended(P).omega1(phi, dphi)
    whole = ROTOR.energy(phi, dphi, support)
    free = pk.energy(ROTOR, phi, dphi).energy_integral
    assert free.units == "J"
    assert free.values == pytest.approx(whole, rel=1e-13)
    tilted = pk.Perturbed(ROTOR, torque=2.0)
    work = 2.0 * free_support.inertia(ROTOR)
    assert pk.energy(tilted, phi, dphi).energy_integral.values == pytest.approx(whole - work * phi)
    level = pk.energy(tilted, phi, dphi).energy_integral.values
    back = pk.phase_velocity(tilted, phi, level).phase_velocity
    assert back.values == pytest.approx(abs(dphi), rel=1e-12)
    amended = ROTOR.amended(P)
    assert pk.potential(ROTOR, phi).potential.values == pytest.approx(amended.potential(phi))
    slope = pk.gradient(tilted, phi).potential_gradient.values
    assert slope == pytest.approx(amended.gradient(phi) - work)
    assert pk.curvature(tilted, phi).potential_curvature.values == pytest.approx(
        amended.curvature(phi)
    )
    moved = pk.flow(tilted, 0.3, 0.5, [1.0, 5.0])
    kept = pk.energy(tilted, moved.motion_phi, moved.motion_dphi).energy_integral
    assert kept.values == pytest.approx(level[0], rel=1e-9)
    with pytest.raises(pk.ParameterError, match="perturbed.system has none"):
        pk.energy(tilted.replace(damping=0.1), phi, dphi)


def velocity(phi, level):
    """Angular velocity of the disk on a level of the energy, at the momentum."""
    amended = ROTOR.amended(P)
    return np.sqrt(
        max(2.0 * (level - amended.potential(phi)) / amended.effective_inertia(phi), 0.0)
    )


def test_melnikov_along_the_loops_of_the_whole_machine():
    nu = 6.0
    perturbed = pk.Perturbed(
        ROTOR, damping=0.3, quadratic=0.05, torque=0.2, forcing=pk.Harmonic(1.0, nu, 0.4)
    )
    ds = pk.melnikov(perturbed)
    assert (ds.melnikov_mean.units, ds.chaos_threshold.units) == ("J", "s-2")
    points = pk.equilibria(ROTOR)
    upper, middle = points.phi.values[points.kind == KIND.SADDLE]
    size = free_support.inertia(ROTOR)
    for saddle, phi in ((0, upper), (1, middle)):
        level = ROTOR.amended(P).potential(phi)
        for side, way in ((0, -1.0), (1, 1.0)):
            end = phi + way * 2.0 * np.pi  # winding
            begun = phi + way * np.pi
            if saddle == 1:
                far = phi + way * np.linspace(1e-3, 3.0, 3000)
                below = np.array([level - ROTOR.amended(P).potential(x) for x in far])
                i = int(np.flatnonzero(below < 0.0)[0])
                end = begun = brentq(
                    lambda x, h=level: h - ROTOR.amended(P).potential(x),
                    far[i - 1],
                    far[i],
                    xtol=1e-14,
                )
            passes = 2.0 if saddle == 1 else 1.0
            ends = sorted((phi, end))
            sweep = [
                quad(lambda x, n=n, h=level: velocity(x, h) ** n, *ends, limit=400)[0]
                for n in (1, 2)
            ]
            mean = -0.3 * passes * sweep[0] - 0.05 * passes * sweep[1]
            mean += 0.2 * (end - phi if saddle == 0 else 0.0)
            found = ds.isel(saddle=saddle, side=side)
            assert found.melnikov_mean.item() == pytest.approx(size * mean, rel=1e-7)
            # the loop itself, by the full equations from its middle on, both ways
            start = (begun, way * velocity(begun, level) if saddle == 0 else 0.0)
            exponent = points.exponent.values[points.kind == KIND.SADDLE][saddle]
            total = 0.0
            for last in (1.0, -1.0):
                t = last * np.linspace(0.0, 11.0 / exponent, 4001)
                moved = free_support.integrate(ROTOR, P, lambda *_: 0.0, start, t).y
                total += last * np.trapezoid(moved[2] * np.exp(1j * nu * t), t)
            total *= np.exp(0.4j) * size
            if saddle == 1:  # time 0 is at the turning point
                assert found.melnikov_phase.item() == pytest.approx(np.angle(total), abs=2e-4)
            assert found.melnikov_amplitude.item() == pytest.approx(abs(total), rel=2e-4)
            assert found.chaos_threshold.item() == pytest.approx(
                size * abs(mean) / abs(total), rel=2e-4
            )
            assert found.turnstile_area.item() == pytest.approx(2.0 * abs(total) / nu, rel=2e-4)


def test_a_heavy_support_turns_evenly():
    still = pk.Perturbed(DISK, damping=0.1, forcing=pk.Harmonic(1.0, 5.0))
    heavy = pk.Perturbed(
        pk.FreeGyroRotor(DISK, carrier_inertia=1e6), damping=0.1, forcing=pk.Harmonic(1.0, 5.0)
    )
    found, want = (
        pk.melnikov(heavy).chaos_threshold.values,
        pk.melnikov(still).chaos_threshold.values,
    )
    assert np.isfinite(want).all()
    assert np.sort(found.ravel()) == pytest.approx(np.sort(want.ravel()), rel=1e-5)
    plain = (one.replace(forcing_amplitude=0.0) for one in (heavy, still))
    a, b = (pk.capture(one).capture_probability.values for one in plain)
    assert a == pytest.approx(b, abs=1e-5)
    assert 0.0 < b[0] < 1.0
    t = np.linspace(0.0, 3.0, 4)
    moved = [pk.flow(one, 0.3, 0.1, t).motion_phi.values for one in (heavy, still)]
    assert moved[0] == pytest.approx(moved[1], abs=1e-4)


def test_capture_of_the_whole_machine():
    rotor = ROTOR.replace(omega1=18.0)
    momentum = rotor.angular_momentum(0.0, 0.0)
    number, damping = max(ORBITS, 300), 0.01 if ORBITS else 0.05
    points = pk.equilibria(rotor)
    middle = int(
        np.flatnonzero(points.kind == KIND.SADDLE)[
            points.energy.values[points.kind == KIND.SADDLE].argmin()
        ]
    )
    saddle, level = points.phi.values[middle], points.energy.values[middle]
    top, bottom = points.energy.values.max(), points.energy.values.min()
    rng = np.random.default_rng(3)
    above = rng.uniform(0.1, 0.3, number) * (level - bottom)
    assert top - level > above.max()
    inertia = rotor.amended(momentum).effective_inertia(saddle)
    v = np.sqrt(2.0 * above / inertia) * rng.choice([-1.0, 1.0], number)
    found = free_support.fates(
        free_support.constants(rotor), momentum, damping, np.full(number, saddle), v, 0.004,
        40.0 / damping, saddle, level - 1e-3 * (level - bottom),
    )  # fmt: skip
    assert (found > 0).mean() == 1.0
    share = pk.capture(pk.Perturbed(rotor, damping=damping)).capture_probability.values
    assert share.sum() == pytest.approx(1.0)
    assert 0.1 < share[1] < 0.9
    error = np.sqrt(share[1] * share[0] / number)
    assert abs((found == 2).mean() - share[1]) < 3.0 * error + (0.0 if ORBITS else 0.02)


def test_attractors_are_the_lower_steady_rotations():
    rotor = ROTOR.replace(omega1=18.0)
    damped, momentum = pk.Perturbed(rotor, damping=1.0), rotor.angular_momentum(0.0, 0.0)
    box = {"phi": np.linspace(-3.0, 3.0, 9), "dphi": np.linspace(-4.0, 4.0, 5)}
    ds = pk.basins(damped, **box)
    points = pk.equilibria(rotor)
    centers = points.phi.values[points.kind == KIND.CENTER]
    assert centers.size == 2
    assert ds.attractor_phi.values[:, 0] == pytest.approx(centers, abs=1e-8)
    assert ds.basin_fraction.sum() == pytest.approx(1.0)
    for i, j in ((0, 0), (4, 2), (7, 4), (2, 2)):
        start = (box["phi"][i], box["dphi"][j])
        ends = free_support.integrate(rotor, momentum, push(damped), start, np.array([0.0, 40.0])).y
        off = np.abs(np.angle(np.exp(1j * (ends[0, -1] - centers))))
        assert off.min() < 1e-6
        assert ds.basin.values[i, j] == off.argmin()


def test_states_once_a_period_and_exponents():
    driven = pk.Perturbed(ROTOR, damping=0.5, forcing=pk.Harmonic(4.0, 7.0))
    t = 2.0 * np.pi / 7.0 * np.arange(4)
    ds = pk.stroboscopic(driven, 0.4, 0.2, n=4)
    want = free_support.integrate(ROTOR, P, push(driven), (0.4, 0.2), t).y
    assert ds.section_dphi.values == pytest.approx(want[2], abs=1e-7)
    settled = pk.lyapunov(driven.replace(forcing_amplitude=0.0), 0.73, 0.0, duration=40.0)
    center = pk.equilibria(ROTOR).sel(equilibrium=3)
    # at rest areas shrink by damping over the part of the inertia that is left
    amended = ROTOR.amended(P)
    left = amended.effective_inertia(center.phi.item()) / free_support.inertia(ROTOR)
    assert settled.lyapunov_sum.item() == pytest.approx(-0.5 / left, rel=1e-4)


def test_maps_and_back(tmp_path):
    driven = pk.Perturbed(ROTOR, damping=0.1, forcing=pk.Harmonic(1.0, 5.0))
    momenta, dampings = [0.3, 0.6], [0.1, 0.2]
    ds = pk.sweep(
        driven, momentum=momenta, damping=dampings, of=["melnikov", "capture", "equilibria"]
    )
    for i, j in ((0, 1), (1, 0)):
        one = driven.replace(momentum=momenta[i], damping=dampings[j])
        cell = ds.isel(momentum=i, damping=j)
        assert cell.phasekit.system() == one
        found = cell.chaos_threshold.values[: pk.melnikov(one).saddle.size]
        assert np.array_equal(found, pk.melnikov(one).chaos_threshold, equal_nan=True)
    ds.to_netcdf(tmp_path / "map.nc", engine="h5netcdf")
    assert (
        pk.open_map(tmp_path / "map.nc")
        .isel(momentum=0, damping=0)
        .phasekit.system()
        .system.momentum
        == 0.3
    )
    several = pk.sweep(driven, beta=[0.5, np.nan, 4.0], of="melnikov")
    assert np.isfinite(several.melnikov_mean.isel(beta=0, saddle=0)).all()
    assert np.isnan(several.melnikov_mean.isel(beta=[1, 2])).all()


@pytest.mark.parametrize("momentum", [None, 0.4])
def test_its_equations_as_a_problem(momentum):
    rotor = ROTOR.replace(momentum=momentum)
    perturbed = pk.Perturbed(rotor, damping=0.5, quadratic=0.2, torque=0.3)
    (_, force), states, values, keywords = formulas_of(perturbed)
    assert keywords["periods"] == {"phi": 2.0 * np.pi}
    kept = P if momentum is None else momentum
    for phi, dphi in ((0.3, 2.0), (-2.0, -1.5)):
        at = {**values, **dict(zip(states, (phi, dphi), strict=True))}
        found = float(force.subs({symbol: at[str(symbol)] for symbol in force.free_symbols}))
        omega = free_support.speed(rotor, kept, phi, dphi)
        torque = free_support.inertia(rotor) * push(perturbed)(0.0, phi, dphi)
        const = free_support.constants(rotor)
        want = free_support.rates(const, phi, omega, dphi, torque)[1]
        assert found == pytest.approx(want, rel=1e-12)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"drift": {"momentum": 0.1}}, "drift: got .*, wants nothing, of a FreeGyroRotor"),
        ({"modulation": {"omega1": pk.Harmonic(1.0, 1.0)}}, "at a momentum that stays"),
        ({"omega1": np.sin}, "torques on the support"),
    ],
)
def test_what_would_change_the_momentum_is_refused(arguments, message):
    with pytest.raises(pk.ParameterError, match=message):
        pk.Perturbed(ROTOR, **arguments)


def test_what_is_not_known_of_it_says_so():
    driven = pk.Perturbed(ROTOR, damping=0.1, forcing=pk.Harmonic(1.0, 5.0))
    for function in (pk.separatrices, pk.retrapping_torque, pk.escape_rate, pk.critical_torque):
        with pytest.raises(pk.ParameterError, match="system: got Perturbed"):
            function(driven)


def test_a_degenerate_equilibrium_does_not_stop_a_map():
    """Above pi the amended potential has its maximum until the momentum bends it into a well."""
    disk = pk.GyroRotorDisk(beta=0.5, e=0.01, a=0.0, r=0.3, omega1=1.0, m=2.0)
    rotor = pk.FreeGyroRotor(disk, carrier_inertia=0.5)
    offset = disk.e * np.sin(disk.beta)
    bend = disk.m * offset**2 - 0.25 * disk.m * disk.r**2 * np.cos(disk.beta) ** 2
    support = rotor.mass_matrix(np.pi)[0, 0]
    merged = support * np.sqrt(disk.m * disk.g * offset / -bend)
    kinds = pk.equilibria(rotor.replace(momentum=merged)).kind.values
    assert kinds.tolist() == [KIND.CENTER, KIND.DEGENERATE]
    driven = pk.Perturbed(rotor, damping=0.1, forcing=pk.Harmonic(1.0, 2.0))
    one = pk.melnikov(driven.replace(momentum=merged))
    assert one.melnikov_mean.shape == (1, 2)
    assert np.isnan(one.melnikov_mean).all()  # the motion there is slower than any exponential
    assert np.isnan(pk.capture(driven.replace(momentum=merged)).capture_probability).all()
    momenta = np.array([0.9, 1.0, 1.1]) * merged
    ds = pk.sweep(driven, momentum=momenta, of="melnikov")
    known = np.isfinite(ds.melnikov_mean).any(dim="side").sum(dim="saddle")
    assert known.values.tolist() == [1, 0, 2]


def test_cells_are_computed_in_parts(monkeypatch):
    """Whatever the order of their machines, which most parts share."""
    rotor = ROTOR.replace(momentum=0.4)
    driven = pk.Perturbed(rotor, damping=0.3, forcing=pk.Harmonic(1.5, 6.0))
    values = driven.parameters | {
        "momentum": np.array([0.7, 0.2, 0.7, 0.2, 0.7]),
        "damping": np.array([[0.1], [0.3]]),
    }
    inputs = [values[name] for name in driven.law.names]
    whole = [*kept_momentum.melnikov(driven.law, *inputs)]
    whole += kept_momentum.capture(driven.law, *inputs)
    monkeypatch.setattr(kept_momentum, "CELLS", 3)
    parts = [*kept_momentum.melnikov(driven.law, *inputs)]
    parts += kept_momentum.capture(driven.law, *inputs)
    assert len(parts) == 11
    for one, other in zip(whole, parts, strict=True):
        assert one.shape[:2] == (2, 5)
        assert np.array_equal(one, other, equal_nan=True)
    assert whole[0][1, :, 0] == pytest.approx(3.0 * whole[0][0, :, 0], nan_ok=True)
    assert np.isfinite(whole[0][:, :, 0]).all()
