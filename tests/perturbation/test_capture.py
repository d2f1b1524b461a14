"""Capture: fluxes and probabilities, and ensembles on demand."""

import os

import numpy as np
import pytest
from witnesses import braked, drifting

import phasekit as pk

ORBITS = int(os.environ.get("PHASEKIT_ENSEMBLES", "0"))
EIGHT = pk.Coefficients(1.0, 0.35, 0.12)


def odds(perturbed, **options):
    ds = pk.capture(perturbed, **options)
    found = ds.capture_probability.values
    assert found.sum(axis=-1) == pytest.approx(1.0)
    return found


def test_damping_alone_shares_by_areas():
    damped = pk.Perturbed(EIGHT, damping=0.003)
    assert odds(damped) == pytest.approx([0.280550, 0.719450, 0.0], abs=1e-6)
    areas = pk.separatrices(EIGHT).lobe_area.sel(saddle="lower").values
    assert areas == pytest.approx([0.963911, 2.471876], abs=1e-6)
    flux = pk.capture(damped).capture_flux.values
    assert flux == pytest.approx([*(0.003 * areas), 0.0])


def test_nothing_is_captured_without_damping_or_by_driving():
    assert odds(pk.Perturbed(EIGHT)).tolist() == [0.0, 0.0, 1.0]
    assert odds(pk.Perturbed(EIGHT, damping=-0.1)).tolist() == [0.0, 0.0, 1.0]
    assert odds(pk.Perturbed(EIGHT), start="rotation").tolist() == [0.0, 0.0, 1.0]


@pytest.mark.parametrize("rate", [0.002, -0.002, 0.0004])
def test_drift_changes_the_shares(rate):
    step = 1e-6
    areas = [pk.separatrices(EIGHT.replace(B=0.35 + s * step)).lobe_area.values[0] for s in (1, -1)]
    theta = 0.003 * pk.separatrices(EIGHT).lobe_area.values[0]
    theta = theta + rate * (areas[0] - areas[1]) / (2 * step)
    found = pk.capture(pk.Perturbed(EIGHT, damping=0.003, drift={"B": rate}))
    assert found.capture_flux.values[:2] == pytest.approx(theta, abs=1e-9)
    kept = np.maximum(theta, 0.0)
    want = [*(kept / kept.sum()), 0.0] if theta.sum() > 0.0 else [0.0, 0.0, 1.0]
    assert found.capture_probability.values == pytest.approx(want, abs=1e-7)


def test_capture_from_rotation():
    """2/(1 + 2 N w/(damping S)), at most 1, with both branches in S."""
    pendulum = pk.Pendulum(length=1.0, g=1.0)
    for torque in (0.02, 0.05, -0.05, 0.001):
        found = odds(pk.Perturbed(pendulum, damping=0.01, torque=torque), start="rotation")
        want = min(1.0, 2 / (1 + 2 * abs(torque) * 2 * np.pi / (0.01 * 16)))
        assert 1.0 - found[2] == pytest.approx(want, rel=1e-12)
        assert found[1 if torque > 0.0 else 0] == 0.0
    both = odds(pk.Perturbed(EIGHT, damping=0.01, torque=0.02), start="rotation")
    assert both[0] / both[1] == pytest.approx(0.280550 / 0.719450, abs=1e-5)


#: Systems with a single well, with two in an eight, and with two equal ones a half turn apart.
ROTATORS = {
    "pendulum": pk.Pendulum(length=1.0, g=1.0),
    "eight": EIGHT,
    "spin_orbit": pk.SpinOrbit(mean_motion=1.0, asymmetry=0.3, strength=1.0),
    "junction": pk.JosephsonJunction(plasma_frequency=1.0, second_harmonic=0.4, flux=0.7),
}


@pytest.mark.parametrize(
    ("name", "ratio"),
    [
        ("pendulum", 3.0),
        ("pendulum", -6.0),
        ("eight", 3.0),
        ("spin_orbit", -2.0),
        ("junction", 4.0),
    ],
)
def test_rotations_that_are_braked(name, ratio):
    """Orbits from a band of speeds: captured, or on backwards, in the shares of the formula."""
    system = ROTATORS[name]
    number, damping = max(ORBITS, 300), 0.0005 if ORBITS else 0.002
    torque = -ratio * damping
    A, B, C = map(float, system.coefficients())
    sep, points = pk.separatrices(system), pk.equilibria(system)
    top, bottom = sep.saddle_energy.max().item(), points.energy.min().item()
    fast = np.sqrt(2.0 * (top - bottom))
    rng = np.random.default_rng(1)
    speeds = fast * rng.uniform(1.15, 1.35, number)
    phases = rng.uniform(0.0, 2.0 * np.pi, number)
    longest = 2.0 * fast / abs(torque) + 3.0 / damping
    inside = top - 0.1 * (top - bottom)
    found, at = braked.fates(
        (A, B, C), torque, damping, speeds, phases, longest, 0.05 / fast * 2.0, inside, 1.2 * fast
    )
    assert (found != 0).mean() > 0.99
    share = odds(pk.Perturbed(system, damping=damping, torque=torque), start="rotation")
    want = 1.0 - share[2]
    assert 0.1 < want < 0.9
    error = np.sqrt(want * (1.0 - want) / number)
    assert abs((found == 1).mean() - want) < 3.0 * error + 4.0 * damping
    if sep.topology == pk.Topology.HETEROCLINIC:  # each well has ends of its own
        phi = np.sort(sep.saddle_phi.values)
        saddle, length = sep.saddle_phi.values[0], phi[1] - phi[0]
        right = np.mod(at[found == 1] - saddle, 2.0 * np.pi) < length
        half = share[1] / want
        assert abs(right.mean() - half) < 4.0 * np.sqrt(half * (1.0 - half) / right.size)


def test_mercury():
    mercury = pk.SpinOrbit.resonance(1.5, eccentricity=0.206, asymmetry=1e-4)
    tides = mercury.tides(1.5, eccentricity=0.206, rate=1e-9)
    found = odds(pk.Perturbed(mercury, **tides), start="rotation")
    assert 1.0 - found[2] == pytest.approx(0.0707, abs=2e-4)
    assert found[0] == pytest.approx(found[1])


def test_where_there_is_no_eight():
    alone = pk.capture(pk.Perturbed(pk.Pendulum(length=1.0), damping=0.1))
    assert np.isnan(alone.capture_probability).all()
    with pytest.raises(pk.ParameterError, match="start: got 'inside', wants one of"):
        pk.capture(pk.Perturbed(EIGHT), start="inside")


@pytest.mark.skipif(not ORBITS, reason="slow: PHASEKIT_ENSEMBLES=6000 runs so many orbits")
@pytest.mark.parametrize("abc", [(1.0, 0.35, 0.12), (-1.0, 0.2, 0.3)])
@pytest.mark.parametrize("rate", [0.0, 0.0001, -0.0001, 0.0005])
def test_ensembles(abc, rate):
    """Orbits from a band of actions outside the eight, by leapfrog with exact damping."""
    delta, step, rng = 0.001, 0.02, np.random.default_rng(1)
    A, B, C = abc
    system = pk.Coefficients(*abc)
    sep = pk.separatrices(system).sel(saddle="lower")
    rise = pk.separatrices(system).saddle_energy.diff("saddle").item()
    phi = np.full(ORBITS, sep.saddle_phi.item())
    dphi = np.sqrt(2 * rise * rng.uniform(0.1, 0.3, ORBITS))
    where, t, b = np.zeros(ORBITS, int), 0.0, B
    met = np.full(ORBITS, np.nan)
    for i in range(int(6.0 / delta / step)):
        dphi -= 0.5 * step * ((b - A * np.cos(phi)) * np.sin(phi) - C * np.cos(phi))
        phi += 0.5 * step * dphi
        dphi *= np.exp(-delta * step)
        phi += 0.5 * step * dphi
        t += step
        b = B + rate * t
        dphi -= 0.5 * step * ((b - A * np.cos(phi)) * np.sin(phi) - C * np.cos(phi))
        if i % 500 == 0:
            now = pk.separatrices(pk.Coefficients(A, b, C)).sel(saddle="lower")
            V = -b * np.cos(phi) + 0.5 * A * np.cos(phi) ** 2 - C * np.sin(phi)
            if now.loop != pk.Loop.LOBES:
                break
            inside = 0.5 * dphi**2 + V < now.saddle_energy.item() - 1e-3
            offset = np.mod(phi - now.saddle_phi.item() + np.pi, 2 * np.pi) - np.pi
            new = (where == 0) & inside
            where, met = np.where(new, np.where(offset > 0, 2, 1), where), np.where(new, b, met)
            if (where > 0).all():
                break
    caught = where > 0
    start = pk.Perturbed(system, damping=delta, drift={"B": rate})
    if odds(start)[2] == 1.0:
        assert not caught.any()
        return
    assert caught.mean() > 0.99
    # The parameter has drifted until the orbits come to the separatrix.
    on = pk.Perturbed(pk.Coefficients(A, met[caught], C), damping=delta, drift={"B": rate})
    want = odds(on)[:, 1].mean()
    right = (where[caught] == 2).mean()
    assert abs(right - want) <= 3 * np.sqrt(want * (1 - want) / ORBITS)


def test_no_probability_is_negative():
    B, rate = np.linspace(0.2, 0.45, 301), [-0.001, 0.0, 0.001]
    p = pk.Perturbed(EIGHT.replace(B=B), damping=0.003, drift={"C": rate}, torque=-0.01)
    for start in ("outside", "rotation"):
        share = odds(p, start=start)
        assert share.shape == (301, 3, 3)
        assert (share >= 0.0).all()
        if start == "outside":
            assert np.isin(share[..., 2], [0.0, 1.0]).all()


DISK = pk.GyroRotorDisk(beta=1.2, e=0.05, a=0.004, r=0.1, omega1=24.0)
#: System, what drifts, at which rate in units of the damping and of its own value.
DRIFTS = [
    (EIGHT, "C", 1.0),
    (EIGHT, "C", -1.0),
    (pk.Coefficients(1.0, -0.2, 0.15), "C", -0.7),
    (pk.Coefficients(1.0, 0.4, -0.1), "C", 0.5),
    (DISK, "omega1", 0.1),
    (DISK, "omega1", -0.1),
    (DISK, "omega1", 0.3),
]


@pytest.mark.parametrize(("system", "name", "ratio"), DRIFTS if ORBITS else DRIFTS[1:5:3])
def test_ensembles_while_a_parameter_drifts(system, name, ratio):
    """The shares at the values that the parameter has when the orbits come to the separatrix."""
    number, small = max(ORBITS, 400), 0.0005 if ORBITS else 0.002
    value = getattr(system, name)
    size = pk.separatrices(system).saddle_exponent.sel(saddle="lower").item()
    damping = small * size
    rate = ratio * damping * value
    last = 1.2 / damping
    grid = np.linspace(0.0, last, 401)
    on = system.replace(**{name: value + rate * grid})
    there = pk.separatrices(on)
    loops = there.sel(saddle="lower")
    eights = (loops.loop == pk.Loop.LOBES).values
    assert eights[:40].all()
    grid = grid[: eights.size if eights.all() else int(np.argmin(eights))]
    coefficients = np.array([np.broadcast_to(x, 401) for x in on.coefficients()])[:, : grid.size]
    quadratics = np.polynomial.polynomial.polyfit(grid / last, coefficients.T, 2).T
    quadratics /= last ** np.arange(3)
    euler = -rate * kappa(system) if name == "omega1" else 0.0
    rise = float(there.saddle_energy.sel(saddle="upper")[0] - loops.saddle_energy[0])
    bottom = pk.equilibria(system).energy.min().item()
    rng = np.random.default_rng(7)
    above = rng.uniform(0.1, 0.3, number) * min(rise, float(loops.saddle_energy[0]) - bottom)
    where, met = drifting.fates(
        quadratics, euler, damping, np.full(number, float(loops.saddle_phi[0])),
        np.sqrt(2.0 * above) * rng.choice([-1.0, 1.0], number), 0.02 / size, grid,
        loops.saddle_phi.values, loops.saddle_energy.values, 1e-3 * rise,
    )  # fmt: skip
    caught = where > 0
    assert caught.mean() > 0.98
    reached = system.replace(**{name: value + rate * met[caught]})
    share = odds(pk.Perturbed(reached, damping=damping, drift={name: rate}))
    assert (share[:, 2] == 0.0).all()
    want = share[:, 1].mean()
    right = (where[caught] == 2).mean()
    assert 0.02 < want < 0.98
    extra = 0.0 if ORBITS else 4.0 * small
    assert abs(right - want) <= 3.0 * np.sqrt(want * (1.0 - want) / number) + extra


#: System, what drifts, at which rate in units of the damping and of its own value; torque over
#: damping and exponent.
BRAKED = [
    (pk.Coefficients(0.0, 1.0, 0.0), "B", 0.4, -6.0),
    (pk.Coefficients(0.0, 1.0, 0.0), "B", -0.4, -4.0),
    (EIGHT, "A", -0.5, -3.0),
    (EIGHT, "B", 0.5, -3.0),
    (DISK, "omega1", 0.5, -4.0),
    (DISK, "omega1", -0.1, -4.0),
]


@pytest.mark.slow
@pytest.mark.parametrize(
    ("system", "name", "ratio", "brake"), BRAKED if ORBITS else BRAKED[:2] + BRAKED[4:]
)
def test_rotations_that_are_braked_while_a_parameter_drifts(system, name, ratio, brake):
    """Captured in the share of the formula at the values when they come to the separatrix."""
    number, small = max(ORBITS, 400), 0.0005 if ORBITS else 0.002
    value = getattr(system, name)
    loops = pk.separatrices(system)
    size = loops.saddle_exponent.sel(saddle="upper").item()
    damping = small * size
    rate, torque = ratio * damping * value, brake * damping * size
    points = pk.equilibria(system)
    depth = float(points.energy.max() - points.energy.min())
    fast = np.sqrt(2.0 * depth)
    last = 2.5 * fast / abs(torque) + 3.0 / damping
    if ratio < 0.0:
        last = min(last, 0.8 / damping / -ratio)
    grid = np.linspace(0.0, last, 401)
    on = system.replace(**{name: value + rate * grid})
    coefficients = np.array([np.broadcast_to(x, 401) for x in on.coefficients()])
    quadratics = np.polynomial.polynomial.polyfit(grid / last, coefficients.T, 2).T
    quadratics /= last ** np.arange(3)
    energy = pk.separatrices(on).saddle_energy.sel(saddle="upper").values
    euler = -rate * kappa(system) if name == "omega1" else 0.0
    rng = np.random.default_rng(5)
    found, met = drifting.braked(
        quadratics, euler, torque, damping, rng.uniform(0.0, 2.0 * np.pi, number),
        fast * rng.uniform(1.15, 1.35, number), 0.02 / size, grid, energy, 0.1 * depth, 1.2 * fast,
    )  # fmt: skip
    assert (found != 0).mean() > 0.99
    reached = system.replace(**{name: value + rate * met[found != 0]})
    share = odds(
        pk.Perturbed(reached, damping=damping, torque=torque, drift={name: rate}), start="rotation"
    )
    want = (1.0 - share[:, 2]).mean()
    assert 0.1 < want < 0.9
    still = 1.0 - odds(pk.Perturbed(system, damping=damping, torque=torque), start="rotation")[2]
    caught = (found[found != 0] == 1).mean()
    error = np.sqrt(want * (1.0 - want) / number)
    assert abs(caught - want) <= 3.0 * error + (0.0 if ORBITS else 4.0 * small)
    assert abs(want - still) > 0.01  # the drift shows


def test_a_cell_that_shrinks_faster_than_damping_fills_it_catches_none():
    pendulum = pk.Coefficients(0.0, 1.0, 0.0)
    slow, fast = (
        pk.Perturbed(pendulum, damping=0.01, torque=-0.05, drift={"B": rate})
        for rate in (-0.015, -0.025)  # dS/dt = S B'/(2 B)
    )
    assert 0.0 < 1.0 - odds(slow, start="rotation")[2] < 1.0
    assert odds(fast, start="rotation").tolist() == [0.0, 0.0, 1.0]
    grows = pk.Perturbed(pendulum, drift={"B": 0.01})  # without damping and torque: into the well
    assert odds(grows, start="rotation")[2] == 0.0
    assert odds(grows.replace(drift_B=-0.01), start="rotation")[2] == 1.0


@pytest.mark.parametrize("rate", [0.2, -0.2])
def test_the_inertial_torque_of_a_frame_brakes(rate):
    """A ring whose speed changes pushes as a constant torque does, so it says what is braked."""
    ring = pk.ParticleOnCircle(radius=1.0, omega=2.0, tilt=0.7, offset=0.0, normal_offset=0.0)
    E0 = ring.frame_rate.euler(ring.parameters)[0]
    damped = {"damping": 0.05, "drift": {"omega": rate}}
    drifted = odds(pk.Perturbed(ring, **damped), start="rotation")
    assert abs(E0) > 0.1
    assert drifted.sum() == pytest.approx(1.0)
    other = pk.Perturbed(ring, **damped, torque=-2.0 * E0 * rate)  # brakes the other sense as much
    assert odds(other, start="rotation")[2] == pytest.approx(drifted[2], abs=1e-9)


@pytest.mark.parametrize("torque", [-0.006, 0.004])
def test_a_turn_on_one_level_is_both_its_arcs(torque):
    """Wells of unequal size between saddles of one energy: 2/(1 + 2 N w/(damping S)), S of both."""
    system = pk.Coefficients(1.0, 0.0, 0.4)
    loops = pk.separatrices(system)
    assert loops.topology == pk.Topology.HETEROCLINIC
    areas = loops.lobe_area.sel(saddle="lower").values
    assert abs(areas[0] - areas[1]) > 0.5
    damping = 0.002
    want = 2.0 / (1.0 + 2.0 * abs(torque) * 2.0 * np.pi / (damping * areas.sum()))
    formula = pk.Potential("cos(phi)^2/2 - 0.4*sin(phi)", "phi", period="2*pi")
    for one in (system, formula):
        found = odds(pk.Perturbed(one, damping=damping, torque=torque), start="rotation")
        assert 1.0 - found[2] == pytest.approx(want, rel=1e-9)
    assert 0.1 < want < 0.9


def kappa(disk):
    """Euler's torque of omega1' is -kappa cos phi."""
    s, c, r, e = np.sin(disk.beta), np.cos(disk.beta), disk.r, disk.e
    return (r * r + 4 * e * e) * s * c / (4 * e * e * s * s + r * r * (1 + s * s))


@pytest.mark.parametrize(("k", "start"), [(1e-9, "rotation"), (1e9, "outside")])
def test_a_constant_in_the_potential_does_not_matter(k, start):
    """Both saddles stand at V = 0, or at the constant; the wells between them differ in size."""
    x = np.linspace(0.0, np.pi, 4001)
    areas = [
        2.0 * np.trapezoid(np.sqrt(2.0 * k * np.sin(x) ** 2 * (1.0 + s * np.sin(x))), x)
        for s in (-0.3, 0.3)
    ]
    damping, torque = 0.01 * k**0.5, 0.02 * k
    values = {"k": k, "c": k * np.array([0.0, 1.0, -3.0, 1e3])}
    text = "-k*sin(x)^2*(1 + 0.3*sin(x)) + c"
    slope = pk.Perturbed(
        pk.Potential(text, "x", values, period="2*pi"), damping=damping, torque=torque
    )
    inside = damping * sum(areas)
    arriving = 0.5 * inside + 2.0 * np.pi * torque
    assert inside < arriving
    ds = pk.capture(slope, start=start)
    assert ds.capture_flux.shape == (4, 3)
    flux = ds.capture_flux.values
    assert flux[:, :2].sum(axis=1) == pytest.approx(np.full(4, inside), rel=1e-5)
    share = ds.capture_probability.values
    caught = inside / arriving  # nothing is outside but rotation
    want = [caught * areas[0] / sum(areas), caught * areas[1] / sum(areas), 1.0 - caught]
    assert share == pytest.approx(np.tile(want, (4, 1)), abs=1e-5)


@pytest.mark.parametrize("start", ["outside", "rotation"])
def test_two_wells_on_one_level_share_alike_by_formula_and_by_coefficients(start):
    perturbed = [
        pk.Perturbed(one, damping=0.002, torque=0.004)
        for one in (
            pk.Coefficients(1.0, 0.0, 0.4),
            pk.Potential("cos(phi)^2/2 - 0.4*sin(phi)", "phi", period="2*pi"),
        )
    ]
    closed, numerical = (odds(one, start=start) for one in perturbed)
    assert abs(closed[0] - closed[1]) > 0.1
    assert sorted(numerical[:2]) == pytest.approx(sorted(closed[:2]), rel=1e-9)
    assert numerical[2] == pytest.approx(closed[2], rel=1e-9, abs=1e-12)


@pytest.mark.slow
def test_of_three_wells_left_and_right_are_not_all():
    """From rotation it may fall into the third one, which two shares would hide."""
    text = "cos(x) + 0.5*cos(2*x) + 0.7*cos(3*x) + 0.1*sin(x)"
    three = pk.Potential(text, "x", period="2*pi")
    assert int((pk.equilibria(three).kind == pk.EquilibriumKind.CENTER).sum()) == 3
    found = pk.capture(pk.Perturbed(three, damping=0.01), start="rotation")
    assert np.isnan(found.capture_probability).all()
    assert np.isnan(found.capture_flux).all()
    outside = pk.capture(pk.Perturbed(three, damping=0.01)).capture_probability.values
    assert outside.sum() == pytest.approx(1.0)


@pytest.mark.slow
def test_a_circle_that_is_gone_round_several_times():
    """Its cells are alike: the shares are those of one, and all cells together turn."""
    eight = "cos(x)^2/2 - 0.35*cos(x) - 0.12*sin(x)"
    for text in (eight, "-cos(x) + 0.2*sin(2*x)"):
        single = text != eight
        found = []
        for turns in (1, 3):
            circle = pk.Potential(text, "x", period=f"{2 * turns}*pi")
            damped = pk.Perturbed(circle, damping=0.01, torque=0.02)
            ds = pk.capture(damped, start="rotation")
            assert ds.capture_probability.sum() == pytest.approx(1.0)
            found.append((ds.capture_probability.values, ds.capture_flux.values / turns))
        outside = pk.capture(damped).capture_probability.values  # round it three times
        assert np.isnan(outside).all() == single
        for one, other in zip(*found, strict=True):
            assert one == pytest.approx(other, rel=1e-9)
        assert 0.1 < found[0][0][2] < 0.9
        assert (found[0][0][1] == 0.0) == single


def test_on_a_line_nothing_rotates():
    """Saddles on one level: the arcs on both sides of the middle one make no turn."""
    line = pk.Potential("cos(3*x)", "x", interval=(-2.4, 2.4))
    assert (pk.separatrices(line).loop == pk.Loop.HETEROCLINIC).sum() == 3
    found = pk.capture(pk.Perturbed(line, damping=0.01), start="rotation")
    assert found.capture_flux.size == 3
    assert np.isnan(found.capture_flux).all()
    assert np.isnan(found.capture_probability).all()


@pytest.mark.parametrize("torque", [1e-12, -1e-12, 1e-3, -1e-3, 0.0])
def test_however_small_the_torque_its_sense_tells_what_it_brakes(torque):
    formula = pk.Potential("-cos(phi) + 0.2*sin(phi)", "phi", period="2*pi")
    for one in (pk.Coefficients(0.0, 1.0, -0.2), formula):
        found = odds(pk.Perturbed(one, damping=0.01, torque=torque), start="rotation")
        left, right = (found[0], found[1]) if torque > 0.0 else (found[1], found[0])
        assert left > 0.9
        assert right == 0.0


@pytest.mark.parametrize("wells", [2, 3, 4])
@pytest.mark.parametrize("ratio", [0.0, 2.0])
def test_equal_wells_take_what_integrated_rotations_leave_there(wells, ratio):
    """V = cos(k x), v' = -V' - d v - N: wells share alike, by leapfrog with exact damping."""
    damping, step, rng = 0.007, 0.05, np.random.default_rng(wells)
    x, v = rng.uniform(0.0, 2.0 * np.pi, 600), rng.uniform(2.3, 2.7, 600)
    lose = np.exp(-damping * step)
    for _ in range(6000):
        v += 0.5 * step * (wells * np.sin(wells * x) - ratio * damping)
        x += 0.5 * step * v
        v *= lose
        x += 0.5 * step * v
        v += 0.5 * step * (wells * np.sin(wells * x) - ratio * damping)
    energy = 0.5 * v * v + np.cos(wells * x)
    kept = energy < 0.95
    assert (kept | (v < 0.0)).all()
    circle = pk.Potential(f"cos({wells}*x)", "x", period="2*pi")
    damped = pk.Perturbed(circle, damping=damping, torque=-ratio * damping)
    found = odds(damped, start="rotation")
    assert 1.0 - found[2] == pytest.approx(kept.mean(), abs=0.05)
    if wells > 2:  # any of them counts as the well ahead
        assert found[0] == 0.0
        assert np.isnan(pk.capture(damped).capture_probability).all()
        return
    side = np.floor(np.mod(x[kept], 2.0 * np.pi) / np.pi)
    assert side.mean() == pytest.approx(0.5, abs=0.08)
    assert found[0] == pytest.approx(found[1], rel=1e-9)
    assert odds(damped) == pytest.approx(found, rel=1e-12)  # outside both wells is rotation
    closed = pk.Perturbed(pk.Coefficients(1.0, 0.0, 0.4), damping=damping, torque=-ratio * damping)
    assert odds(closed) == pytest.approx(odds(closed, start="rotation"), rel=1e-12)
