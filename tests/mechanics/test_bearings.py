"""Bearing forces of the disk against recorded values, engines, particles and balances."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from mpmath import mp, mpf
from witnesses import particles
from witnesses.disk_forces import Disk, Motion

from phasekit.mechanics.bearings import bearing_forces, fixed_bearing_forces
from phasekit.mechanics.disk import disk_coefficients
from phasekit.mechanics.general.body import RigidBody
from phasekit.mechanics.general.rotation import CoupledRotation
from phasekit.mechanics.rotators import rotators
from phasekit.numerics import launch
from phasekit.phase.exact.flow import flow

DATA = Path(__file__).parents[1] / "data"
CASES = [
    case
    for case in json.loads((DATA / "vectors.json").read_text())["cases"]
    if case["kind"] == "disk_bearings"
]
ENGINES = json.loads((DATA / "mujoco.json").read_text())["cases"]
UP, EAST = (0.0, 0.0, 1.0), (1.0, 0.0, 0.0)
DISK = {
    "beta": 0.7,
    "e": 0.03,
    "a": 0.05,
    "r": 0.21,
    "omega1": 12.5,
    "m": 2.0,
    "g": 9.81,
    "half_span": 0.15,
}
STATES = {"phi": np.linspace(-3.0, 3.3, 12), "dphi": np.linspace(-7.0, 9.0, 12)}
RHO = 0.4


def close(got, want, tolerance=1e-12, scale=None) -> None:
    """Compare within a part of the wanted array's size, or of a scale."""
    got, want = np.asarray(got, float), np.asarray(want, float)
    assert got.shape == want.shape
    scale = np.abs(want).max() if scale is None else scale
    assert (np.abs(got - want) <= tolerance * scale).all(), (got, want)


def light(disk: dict) -> tuple:
    """Arguments of `fixed_bearing_forces` before the place of B1."""
    return tuple(value for name, value in disk.items() if name != "half_span")


def random_disks(n: int, seed: int = 41) -> dict[str, np.ndarray]:
    rng = np.random.default_rng(seed)
    return {
        "beta": rng.uniform(0, np.pi, n),
        "e": 10 ** rng.uniform(-3, 0, n),
        "a": rng.normal(size=n),
        "r": 10 ** rng.uniform(-2, 0, n),
        "omega1": rng.choice([-1, 1], n) * 10 ** rng.uniform(-1, 2, n),
        "m": 10 ** rng.uniform(-1, 1, n),
        "g": rng.choice([9.80665, 1.6, 0.0, -9.80665], n),
        "half_span": 10 ** rng.uniform(-2, 0, n),
    }


def disk_axes(phi) -> np.ndarray:
    """Rows u2, v2, n2 in the carrier's axes."""
    s, c = np.sin(phi), np.cos(phi)
    z = 0 * s
    rows = [[z, c, s], [z, -s, c], [z + 1, z, z]]
    return np.moveaxis(np.array(rows), (0, 1), (-2, -1))


def turned(axes, vectors):
    """Components along axes of vectors that have one more axis, of bearings."""
    return np.einsum("...ij,...bj->...bi", axes, vectors)


# --- recorded values ---------------------------------------------------------------------------


@pytest.mark.parametrize("case", CASES, ids=lambda case: case["id"])
def test_recorded_values(case):
    x, want = case["input"], case["output"]
    disk = {name: x[name] for name in ("beta", "e", "a", "r")}
    disk |= {"omega1": x["w1"], "m": x["m"], "g": x["g"], "half_span": x["l"]}
    state = {"phi": x["phi2"], "dphi": x["w2"], "domega1": x["dw1"]}
    got = bearing_forces(*disk.values(), **state)
    for i, name in enumerate(("FA2", "FB2")):
        close(got.force[i], want[name])
        close(got.force_kinetic[i], want[f"{name}_kin"])
        close(got.force_weight[i], want[f"{name}_weight"])
        close(np.hypot(*got.force_kinetic[i, :2]), want[f"{name}N2_kin"])
        close(got.force_magnitude[i], np.linalg.norm(want[name]))
    close(got.force_axial, want["FA2n2_kin"])
    close(got.force_kinetic[0, 2], want["FA2n2_kin"])
    assert got.force[1, 2] == got.force_weight[0, 2] == 0
    close(got.deviation_couple, np.linalg.norm(want["couple_kin_O2"]))
    # terms of the torque cancel
    terms = want["Ju"] * (abs(want["phiddot"]) + (abs(x["w1"]) + abs(x["w2"])) ** 2)
    terms += x["m"] * (abs(x["a"]) + x["e"]) ** 2 * (abs(x["dw1"]) + abs(x["w1"] * x["w2"]))
    close(got.drive_torque, want["M1_drive"], 1e-13, max(terms, abs(want["M1_drive"])))
    power = got.drive_torque * x["w1"]
    close(power, want["dT"] - want["power_gravity"], 1e-13, terms * abs(x["w1"]))
    fixed = fixed_bearing_forces(*light(disk), x["rhoB1"], **state)
    for i, name in enumerate(("FA1", "FB1")):
        close(fixed.fixed_force[i], want[name])
        close(fixed.fixed_force_kinetic[i], want[f"{name}_kin"])
    couple = np.cross([0, 0, x["rhoB1"]], fixed.fixed_force_kinetic[1])
    close(couple, want["Mdev1_kin"])


@pytest.mark.parametrize("case", ENGINES, ids=lambda case: case["tag"])
def test_engines_for_multibody_dynamics(case):
    """Triples there are (v01, u01, n1) and (-v2, u2, n2), and A2 sits at -half_span."""
    x, out = case["inputs"], case["outputs"]
    m, half_span, phi, a, e = x["m"], x["l"], x["phi"], x["a"], x["e"]
    disk = (x["beta"], e, a, x["r"], x["omega1"], m, x["g"])
    w1, w2 = abs(x["omega1"]), abs(x["phidot"])
    turning = (w1 + w2) ** 2 + abs(out["phiddot"])
    force = m * (abs(a) * w1**2 + e * turning + x["g"])
    moment = m * (x["r"] ** 2 + 2 * e**2) * turning + m * e * (abs(a) * w1**2 + x["g"])
    at_bearing, about_O1 = force + moment / half_span, moment + abs(a) * force

    got = bearing_forces(*disk, half_span, phi, x["phidot"], carrier=True).force
    axes = disk_axes(phi)

    def engine(v):  # (v01, u01, n1)
        return np.array([v[1], v[0], v[2]])

    def engine_disk(v):  # (u02 = -v2, u2, n2)
        u, inward, along = axes @ v
        return np.array([-inward, u, along])

    total = got.sum(axis=0)
    close(engine(total), out["F_O2_carrier"], 1e-11, force)
    close(engine_disk(total), out["F_O2_disk"], 1e-11, force)
    moment_O2 = half_span * np.cross(EAST, got[0] - got[1])
    close(engine(moment_O2), out["M_O2_carrier"], 1e-11, moment)
    close(engine_disk(moment_O2), out["M_O2_disk"], 1e-11, moment)
    # the axial force goes to the other place; across the shaft the two places swap
    axial = np.array([got[0, 0], 0.0, 0.0])
    at_minus, at_plus = got[1] + axial, got[0] - axial
    for ours, name in ((at_minus, "F_A2"), (at_plus, "F_B2")):
        close(engine(ours), out[f"{name}_carrier"], 1e-11, at_bearing)
        close(engine_disk(ours), out[f"{name}_disk"], 1e-11, at_bearing)

    torque = bearing_forces(*disk, half_span, phi, x["phidot"]).drive_torque
    close(torque, out["drive_torque"], 1e-11, about_O1)
    close(torque, out["M_O1_carrier"][2], 1e-11, about_O1)
    for rho in (0.3, -0.7):
        fixed = fixed_bearing_forces(*disk, rho, phi, x["phidot"]).fixed_force
        scale = force + about_O1 / abs(rho)
        close(engine(fixed.sum(axis=0)), out["F_O1_carrier"], 1e-11, scale)
        about = np.cross([0, 0, rho], fixed[1]) + [0, 0, float(torque)]
        close(engine(about), out["M_O1_carrier"], 1e-11, about_O1 + abs(rho) * force)


# --- other ways to the same --------------------------------------------------------------------


@pytest.mark.parametrize("free", [True, False])
def test_general_bodies(free):
    """Any disk and state, a support that gathers speed, a motor."""
    n = 300
    disk, rng = random_disks(n), np.random.default_rng(5)
    phi, dphi = rng.uniform(-4, 4, n), rng.normal(size=n) * 10
    domega1, ddphi = rng.normal(size=n) * 20, rng.normal(size=n) * 50
    rho = rng.normal(size=n)
    body = RigidBody.disk(disk["m"], disk["r"], disk["e"], disk["beta"])
    machine = CoupledRotation(body, n1=UP, n2=EAST, a=disk["a"])
    motion = {"omega1": disk["omega1"], "domega1": domega1, "phi2": phi, "omega2": dphi}
    none, G = np.zeros(3), np.stack([0 * phi, 0 * phi, -disk["m"] * disk["g"]], axis=-1)
    if free:
        ddphi = machine.at(**motion).free_acceleration(G)
    state = machine.at(**motion, domega2=ddphi)
    s = disk["half_span"]
    given = (phi, dphi, None if free else ddphi, domega1)
    got = bearing_forces(*disk.values(), *given, carrier=True)
    fixed = fixed_bearing_forces(*light(disk), rho, *given)

    def same(found, pair, tolerance=1e-11):
        want = np.stack(pair, axis=-2)
        size = np.abs(want).max(axis=(-2, -1), keepdims=True)
        assert (np.abs(found - want) <= tolerance * size).all()

    same(got.force, state.self_bearings(G, s, -s))
    same(got.force_kinetic, state.self_bearings(none, s, -s))
    same(got.force_weight, machine.at(phi2=phi).self_bearings(G, s, -s))
    same(fixed.fixed_force, state.fixed_bearings(G, rho))
    same(fixed.fixed_force_kinetic, state.fixed_bearings(none, rho))
    same(fixed.fixed_force_weight, machine.at(phi2=phi).fixed_bearings(G, rho))
    kinetic = np.stack(state.self_bearings(none, s, -s), axis=-2)
    np.testing.assert_allclose(got.force_axial, kinetic[:, 0, 0], rtol=1e-9)
    couple = s[:, None] * np.cross(EAST, kinetic[:, 0] - kinetic[:, 1])
    np.testing.assert_allclose(got.deviation_couple, np.linalg.norm(couple, axis=-1), rtol=1e-9)
    torque = state.drive_torque(G)
    size = np.linalg.norm(state.angular_momentum_rate, axis=-1)
    assert np.max(np.abs(got.drive_torque - torque) / size) < 1e-11


EDGES = [
    {},
    {"e": 0.0},
    {"r": 0.0},
    {"beta": 0.0},
    {"beta": np.pi / 2},
    {"beta": np.pi},
    {"beta": 2.4},
    {"a": 0.0},
    {"a": -0.3},
    {"g": 0.0},
    {"g": -9.81},
    {"omega1": 0.0},
    {"omega1": -7.0},
    {"e": 0.0, "beta": np.pi / 2},
    {"e": 0.0, "a": 0.0},
    {"beta": 1e-9},
    {"beta": 1e-200},
    {"half_span": 1e-6},
    {"m": 1e-9},
]


@pytest.mark.slow
@pytest.mark.parametrize("change", EDGES, ids=str)
@pytest.mark.parametrize("dphi", [0.0, -5.0])
def test_particles(change, dphi):
    """Special disks: raw equations of Newton and Euler in fifty digits."""
    x = {**DISK, **change}
    m, half = x["m"], x["half_span"]
    # the doubles nearest to pi/2 and pi stand for these
    points = particles.disk_particles(m, x["r"], x["e"], x["beta"])
    machine = particles.Machine(*points, UP, EAST, x["a"])
    G, phi, d1 = (0, 0, -m * x["g"]), 0.6, 3.0
    for d2 in (None, 11.0):
        if d2 is None:
            now = machine.free_motion([0, x["omega1"], d1], [phi, dphi, 0], G)
        else:
            now = machine.motion([0, x["omega1"], d1], [phi, dphi, d2])
        F_A, F_B, _ = now.self_bearings(G, half, -half)
        K_A, K_B, _ = now.self_bearings((0, 0, 0), half, -half)
        got = bearing_forces(*x.values(), phi, dphi, d2, d1, carrier=True)
        close(got.force, [F_A, F_B])
        close(got.force_kinetic, [K_A, K_B])
        F_A1, F_B1, M1 = now.fixed_bearings(G, RHO)
        K_A1, K_B1, _ = now.fixed_bearings((0, 0, 0), RHO)
        fixed = fixed_bearing_forces(*light(x), RHO, phi, dphi, d2, d1)
        close(fixed.fixed_force, [F_A1, F_B1])
        close(fixed.fixed_force_kinetic, [K_A1, K_B1])
        terms = particles.norm(now.dL) + x["m"] * (0.3 * d1 + x["omega1"] ** 2) / 50
        close(got.drive_torque, M1, 1e-12, float(terms))


def test_the_numpy_particles_of_the_tests_agree_with_the_exact_ones():
    """`disk_forces`, on which tests of curves rest, and `particles`."""
    disk = Disk(**DISK)
    machine = particles.Machine(
        *particles.disk_particles(2.0, 0.21, 0.03, 0.7), UP, EAST, DISK["a"]
    )
    G = (0, 0, -2.0 * 9.81)
    now = machine.free_motion([0, 12.5, 3.0], [0.6, -5.0, 0], G)
    d2 = disk.free(0.6, -5.0, 3.0)
    close(d2, now.phi2.d().d().now)
    state = Motion(0.6, -5.0, d2, 3.0)
    close(disk.bearings(state), now.self_bearings(G, 0.15, -0.15)[:2])
    close(disk.fixed_bearings(state, RHO), now.fixed_bearings(G, RHO)[:2])
    close(disk.drive_torque(state), now.fixed_bearings(G, RHO)[2])
    height = particles.plus(particles.now(now.r0), particles.now(now.rho_C))[2]
    close(disk.energy(0.6, -5.0), now.T + 2.0 * 9.81 * height)


# --- balances ----------------------------------------------------------------------------------


def test_the_bearings_hold_the_change_of_momentum():
    """The momentum by particles, its rate by differences, at varying omega1."""
    x, phi, dphi, d1 = DISK, 0.6, -5.0, 3.0
    points = particles.disk_particles(x["m"], x["r"], x["e"], x["beta"])
    machine = particles.Machine(*points, UP, EAST, x["a"])
    d2 = 4.0
    step = mpf("1e-15")

    def momentum(t):
        first = [x["omega1"] * t + d1 * t * t / 2, x["omega1"] + d1 * t, d1]
        second = [phi + dphi * t + d2 * t * t / 2, dphi + d2 * t, d2]
        now = machine.motion(first, second)
        return particles.now(now.K), particles.now(now.L)

    later, before = momentum(step), momentum(-step)
    dK, dL = (
        [float((p - q) / (2 * step)) for p, q in zip(*pair, strict=True)]
        for pair in zip(later, before, strict=True)
    )
    weight = np.array([0, 0, -x["m"] * x["g"]])
    got = bearing_forces(*x.values(), phi, dphi, d2, d1, carrier=True)
    close(got.force.sum(axis=0), dK - weight)
    fixed = fixed_bearing_forces(*light(x), RHO, phi, dphi, d2, d1)
    close(fixed.fixed_force.sum(axis=0), dK - weight)
    s, c = np.sin(phi), np.cos(phi)
    e_n, e_r = x["e"] * np.cos(x["beta"]), x["e"] * np.sin(x["beta"])
    center = np.array([e_n, x["a"] + e_r * s, -e_r * c])
    about = np.cross([0, 0, RHO], fixed.fixed_force[1]) + [0, 0, float(got.drive_torque)]
    close(about, dL - np.cross(center, weight))


@pytest.mark.parametrize("start", [(0.3, 4.0), (-2.0, 0.5), (1.0, -19.0)])
def test_power_of_the_drive(start):
    """Torque times omega1 is the rate of T + V along the motion in closed form."""
    x = DISK
    abc = disk_coefficients(*(x[name] for name in ("beta", "e", "a", "r", "omega1", "g")))
    step = 1e-3
    phi, dphi = flow(*abc, *start, 0.2 + step * np.arange(-4, 5))
    energy = Disk(**x).energy(phi, dphi)
    weights = np.array([3, -32, 168, -672, 0, 672, -168, 32, -3]) / 840
    torque = bearing_forces(*x.values(), phi[4], dphi[4]).drive_torque
    np.testing.assert_allclose(torque * x["omega1"], weights @ energy / step, rtol=1e-9, atol=1e-9)


def test_power_of_the_drive_at_varying_speed():
    """T + V by particles in fifty digits, omega1 and phi as polynomials of time."""
    x, phi, dphi, d1 = DISK, 0.6, -5.0, -8.0
    points = particles.disk_particles(x["m"], x["r"], x["e"], x["beta"])
    machine = particles.Machine(*points, UP, EAST, x["a"])
    G = (0, 0, -x["m"] * x["g"])
    now = machine.free_motion([0, x["omega1"], d1], [phi, dphi, 0], G)
    torque = bearing_forces(*x.values(), phi, dphi, domega1=d1).drive_torque
    close(torque * x["omega1"], now.dT - now.power_of_weight(G))


def test_a_motor_takes_part_in_the_power():
    """With phi'' given, both torques together: (T + V)' = M1 omega1 + Q2 phi'."""
    x, phi, dphi, d2, d1 = DISK, 0.6, -5.0, 30.0, -8.0
    points = particles.disk_particles(x["m"], x["r"], x["e"], x["beta"])
    G = (0, 0, -x["m"] * x["g"])
    now = particles.Machine(*points, UP, EAST, x["a"]).motion([0, 12.5, d1], [phi, dphi, d2])
    torque = bearing_forces(*x.values(), phi, dphi, d2, d1).drive_torque
    both = torque * x["omega1"] + float(now.self_torque(G)) * dphi
    close(both, now.dT - now.power_of_weight(G))


# --- parts, components, frames -----------------------------------------------------------------


def test_parts_add_up():
    got = bearing_forces(*DISK.values(), **STATES, domega1=3.0)
    np.testing.assert_allclose(got.force, got.force_kinetic + got.force_weight, rtol=1e-13)
    np.testing.assert_allclose(got.force_magnitude, np.linalg.norm(got.force, axis=-1), rtol=1e-14)
    np.testing.assert_array_equal(got.force_axial, got.force[:, 0, 2])
    assert (got.force[:, 1, 2] == 0).all()
    total = got.force_weight.sum(axis=1)
    np.testing.assert_allclose(np.linalg.norm(total, axis=-1), DISK["m"] * DISK["g"], rtol=1e-14)
    rest = bearing_forces(*{**DISK, "omega1": 0.0}.values(), STATES["phi"], 0.0, 0.0)
    np.testing.assert_allclose(rest.force_weight, rest.force, atol=1e-13)
    fixed = fixed_bearing_forces(*light(DISK), RHO, **STATES, domega1=3.0)
    np.testing.assert_allclose(
        fixed.fixed_force, fixed.fixed_force_kinetic + fixed.fixed_force_weight, atol=1e-11
    )


@pytest.mark.parametrize("beta", [0.7, 2.2, np.pi / 2])
@pytest.mark.parametrize("ddphi", [None, 17.0])
def test_components_add_up_to_the_kinetic_force(beta, ddphi):
    """F_21 n1 + F_22 w2 - F_23 v01 + F_24 unit(R022), the rest of the force being axial."""
    x = {**DISK, "beta": beta}
    got = bearing_forces(*x.values(), **STATES, ddphi=ddphi, carrier=True)
    cold = tuple(x[name] for name in ("beta", "e", "a", "r", "omega1", "g"))
    R022 = rotators(*cold, **STATES, ddphi=ddphi).rotator[:, 2]
    own = R022 / np.linalg.norm(R022, axis=-1, keepdims=True)
    phi = STATES["phi"]
    zero = 0 * phi
    w1 = np.stack([zero, zero, zero + 1], axis=-1)
    w2 = np.stack([zero, np.sin(2 * phi), -np.cos(2 * phi)], axis=-1)
    w3 = np.stack([zero, zero - 1, zero], axis=-1)
    # each is a vector across the shaft, the same in its own frame
    axes = disk_axes(phi)
    s, c = np.sin(phi), np.cos(phi)
    np.testing.assert_allclose(
        np.einsum("nij,nj->ni", axes, w2), np.stack([s, -c, zero], -1), atol=1e-15
    )
    F = got.force_component
    found = sum(F[:, :, [i]] * w[:, None, :] for i, w in enumerate((w1, w2, w3, own)))
    across = got.force_kinetic * [0, 1, 1]
    np.testing.assert_allclose(found, across, atol=1e-13 * np.abs(across).max())


def test_frames():
    """The carrier's components are those along the disk's axes, turned."""
    for change in ({}, {"a": -0.2, "beta": 2.5}):
        x = {**DISK, **change}
        one = bearing_forces(*x.values(), **STATES, domega1=3.0)
        other = bearing_forces(*x.values(), **STATES, domega1=3.0, carrier=True)
        axes = disk_axes(STATES["phi"])
        for name in ("force", "force_kinetic", "force_weight"):
            want = turned(axes, getattr(other, name))
            np.testing.assert_allclose(getattr(one, name), want, atol=1e-12 * np.abs(want).max())
        for name in set(one._fields) - {"force", "force_kinetic", "force_weight"}:
            np.testing.assert_array_equal(getattr(one, name), getattr(other, name))


def test_deviation_couple():
    for state in (STATES, {"phi": 0.3, "dphi": 0.0}):
        got = bearing_forces(*DISK.values(), **state, carrier=True)
        kinetic = got.force_kinetic
        couple = DISK["half_span"] * np.cross(EAST, kinetic[..., 0, :] - kinetic[..., 1, :])
        np.testing.assert_allclose(
            got.deviation_couple, np.linalg.norm(couple, axis=-1), rtol=1e-13
        )
    # it does not depend on where the bearings stand
    far = bearing_forces(*{**DISK, "half_span": 3.0}.values(), **STATES)
    near = bearing_forces(*DISK.values(), **STATES)
    np.testing.assert_allclose(far.deviation_couple, near.deviation_couple, rtol=1e-13)


def test_forces_are_proportional_to_the_mass():
    one = bearing_forces(*DISK.values(), **STATES)
    eight = bearing_forces(*{**DISK, "m": 16.0}.values(), **STATES)
    for x, y in zip(one, eight, strict=True):
        np.testing.assert_array_equal(8.0 * x, y)


# --- symmetries --------------------------------------------------------------------------------


def test_mirror_along_the_shaft():
    """With beta -> pi - beta and omega1 -> -omega1: u01 changes its sign, the bearings swap.

    The one that takes the axial force stays at +half_span.
    """
    mirrored = {**DISK, "beta": np.pi - DISK["beta"], "omega1": -DISK["omega1"]}
    one = bearing_forces(*DISK.values(), **STATES, domega1=3.0, carrier=True)
    other = bearing_forces(*mirrored.values(), **STATES, domega1=-3.0, carrier=True)
    size = np.abs(one.force).max()
    np.testing.assert_allclose(other.force_axial, -one.force_axial, atol=1e-12 * size)
    across = one.force[:, ::-1, 1:]
    np.testing.assert_allclose(other.force[:, :, 1:], across, atol=1e-12 * size)
    np.testing.assert_allclose(other.drive_torque, -one.drive_torque, atol=1e-12 * size)
    fixed = fixed_bearing_forces(*light(DISK), RHO, **STATES, domega1=3.0).fixed_force
    seen = fixed_bearing_forces(*light(mirrored), RHO, **STATES, domega1=-3.0).fixed_force
    np.testing.assert_allclose(seen, fixed * [-1, 1, 1], atol=1e-12 * np.abs(fixed).max())


def test_mirror_in_the_horizontal_plane():
    """With phi -> pi - phi, phi' -> -phi', g -> -g: n1 changes its sign, the rest stays."""
    mirrored = {**DISK, "g": -DISK["g"]}
    upside = (np.pi - STATES["phi"], -STATES["dphi"])
    one = bearing_forces(*DISK.values(), **STATES, domega1=3.0, carrier=True)
    other = bearing_forces(*mirrored.values(), *upside, domega1=3.0, carrier=True)
    size = np.abs(one.force).max()
    np.testing.assert_allclose(other.force, one.force * [1, 1, -1], atol=1e-12 * size)
    np.testing.assert_allclose(other.drive_torque, one.drive_torque, atol=1e-12 * size)


def test_sign_of_a():
    """With a -> -a: half a turn of the shaft about n1 with beta -> pi - beta and phi -> -phi."""
    turned_ = {**DISK, "a": -DISK["a"], "beta": np.pi - DISK["beta"]}
    one = bearing_forces(*DISK.values(), **STATES, domega1=3.0, carrier=True)
    other = bearing_forces(
        *turned_.values(), -STATES["phi"], -STATES["dphi"], domega1=3.0, carrier=True
    )
    size = np.abs(one.force).max()
    np.testing.assert_allclose(other.force_axial, -one.force_axial, atol=1e-12 * size)
    np.testing.assert_allclose(
        other.force[:, ::-1, 1:], one.force[:, :, 1:] * [-1, 1], atol=1e-12 * size
    )
    np.testing.assert_allclose(other.drive_torque, one.drive_torque, atol=1e-12 * size)


def test_time_reversed():
    one = bearing_forces(*DISK.values(), **STATES, domega1=3.0)
    other = bearing_forces(
        *{**DISK, "omega1": -DISK["omega1"]}.values(), STATES["phi"], -STATES["dphi"], domega1=3.0
    )
    for x, y in zip(one, other, strict=True):
        np.testing.assert_array_equal(x, y)


# --- arrays ------------------------------------------------------------------------------------


def test_arguments_broadcast():
    beta, span = np.array([0.2, 0.9, -1.0])[:, None, None], np.array([0.1, 0.0])[:, None]
    phi = np.linspace(0, 3, 5)
    got = bearing_forces(beta, 0.03, 0.05, 0.2, 5.0, 2.0, 9.81, span, phi, 2.0)
    assert got.force.shape == (3, 2, 5, 2, 3)
    assert got.force_magnitude.shape == (3, 2, 5, 2)
    assert got.force_component.shape == (3, 2, 5, 2, 4)
    assert got.force_axial.shape == got.deviation_couple.shape == (3, 2, 5)
    one = bearing_forces(0.9, 0.03, 0.05, 0.2, 5.0, 2.0, 9.81, 0.1, phi[3], 2.0)
    for whole, single in zip(got, one, strict=True):
        np.testing.assert_array_equal(whole[1, 0, 3], single)
        assert np.isnan(whole[2]).all()  # not a body
        assert np.isnan(whole[:, 1]).all()  # no distance between the bearings


@pytest.mark.parametrize("name", DISK)
@pytest.mark.parametrize("value", [np.nan, np.inf, -np.inf])
def test_what_is_not_a_body_is_nan(name, value):
    both = {**DISK, name: np.array([DISK[name], value])}
    got = bearing_forces(*both.values(), 0.3, 2.0)
    usual = bearing_forces(*DISK.values(), 0.3, 2.0)
    for whole, one in zip(got, usual, strict=True):
        np.testing.assert_array_equal(whole[0], one)
        assert np.isnan(whole[1]).all()
    if name != "half_span":
        for array in fixed_bearing_forces(*light(both), RHO, 0.3, 2.0):
            assert np.isnan(array[1]).all()


def test_places_of_the_fixed_bearing():
    rho = np.array([0.4, -0.4, 0.0, np.nan, np.inf])
    got = fixed_bearing_forces(*light(DISK), rho, 0.3, 2.0)
    across = got.fixed_force[:, 1]
    np.testing.assert_array_equal(across[0], -across[1])
    for array in got:
        assert np.isfinite(array[:2]).all()
        assert np.isnan(array[2:4]).all()


@pytest.mark.parametrize("name", ["phi", "dphi", "ddphi", "domega1"])
@pytest.mark.parametrize("value", [np.nan, np.inf, -np.inf])
def test_states_that_are_not_finite_have_no_finite_force(name, value):
    state = {"phi": 0.3, "dphi": 2.0, "ddphi": 1.0, "domega1": 1.0} | {name: value}
    with np.errstate(all="ignore"):
        got = bearing_forces(*DISK.values(), **state)
        fixed = fixed_bearing_forces(*light(DISK), RHO, **state)
    assert not np.isfinite(got.force_magnitude).any()
    assert not np.isfinite(fixed.fixed_force[1]).all()


def test_compiled_and_interpreted_agree_to_the_last_bit(monkeypatch):
    n = 150
    disk, rng = random_disks(n, 9), np.random.default_rng(3)
    phi, dphi, d1 = rng.uniform(-4, 4, n), rng.normal(size=n), rng.normal(size=n)
    for array in (*disk.values(), phi, dphi, d1):
        array[rng.integers(0, n, 4)] = rng.choice([0.0, 1e300, 5e-324, np.nan, np.inf], 4)
    found = []
    for most in (10**9, 0):
        monkeypatch.setattr(launch, "INTERPRETED_AT_MOST", most)
        monkeypatch.setattr(launch, "_interpreted", {})
        with np.errstate(all="ignore"):
            free = bearing_forces(*disk.values(), phi, dphi, domega1=d1)
            driven = bearing_forces(*disk.values(), phi, dphi, 3.0, d1, carrier=True)
            fixed = fixed_bearing_forces(*light(disk), RHO, phi, dphi, domega1=d1)
        found.append((*free, *driven, *fixed))
    for one, other in zip(*found, strict=True):
        np.testing.assert_array_equal(one, other)


def test_threads_make_the_same(monkeypatch):
    monkeypatch.setattr(launch, "THREADS_FROM", 10)
    monkeypatch.setattr(launch, "INTERPRETED_AT_MOST", 0)
    one = bearing_forces(*DISK.values(), **STATES, threads=1)
    for threads in (2, 5):
        other = bearing_forces(*DISK.values(), **STATES, threads=threads)
        for x, y in zip(one, other, strict=True):
            np.testing.assert_array_equal(x, y)


def test_forces_at_rest_of_a_particle():
    """A particle on a circle in the plane across the shaft: textbook forces."""
    m, e, a, w, g, half = 2.0, 0.3, 0.1, 4.0, 9.81, 0.2
    got = bearing_forces(np.pi / 2, e, a, 0.0, w, m, g, half, np.pi / 2, 0.0, 0.0, carrier=True)
    # at the level of the shaft, outside: half the weight and half the centripetal force each
    want = [[0.0, -0.5 * m * w * w * (a + e), 0.5 * m * g]] * 2
    np.testing.assert_allclose(got.force, want, atol=1e-14)
    assert mp.dps >= 50  # the oracle's precision was in force
