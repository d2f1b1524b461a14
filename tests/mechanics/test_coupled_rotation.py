"""Momentum, rotators and bearing reactions against particles, recorded values and symmetries."""

from __future__ import annotations

import copy
import json
import pickle
from pathlib import Path

import numpy as np
import pytest
from mpmath import mp, mpf
from witnesses import particles

from phasekit.errors import ParameterError
from phasekit.mechanics.general.body import RigidBody
from phasekit.mechanics.general.rotation import CoupledRotation
from phasekit.mechanics.vectors import rotation, unit

DATA = Path(__file__).parents[1] / "data"
VECTORS = json.loads((DATA / "vectors.json").read_text())["cases"]
MUJOCO = json.loads((DATA / "mujoco.json").read_text())
ROTATORS = ("R01", "R011", "R022", "R012", "R1", "R2", "R12", "R12c")
ACROSS_2 = ("R022", "R2", "R12c")
UP, EAST = (0.0, 0.0, 1.0), (1.0, 0.0, 0.0)
ANGLES = ("phi1", "omega1", "domega1", "phi2", "omega2", "domega2")


def recorded(*kinds):
    cases = [case for case in VECTORS if case["kind"] in kinds]
    return pytest.mark.parametrize("case", cases, ids=lambda case: case["id"])


def close(got, want, tolerance=1e-12, scale=None) -> None:
    """Compare within a part of the wanted vector's size, or of a scale."""
    want = np.array(want, dtype=float)
    assert np.shape(got) == want.shape
    assert np.isfinite(want).all()
    scale = np.abs(want).max() if scale is None else scale
    assert np.abs(np.array(got, dtype=float) - want).max() <= tolerance * scale, (got, want)


class Trial:
    """A random body, axes at any angle, a motion, a weight; the machine and its particles."""

    def __init__(self, seed: int, free: bool = False):
        rng = np.random.default_rng(seed)
        self.masses, self.points = rng.uniform(0.2, 2.0, 5), rng.normal(size=(5, 3))
        self.n1, self.n2, self.G = rng.normal(size=(3, 3))
        self.a, self.s_A, self.s_B, self.rho = rng.normal(size=4)
        self.phi1, self.phi2 = rng.normal(size=(2, 4))
        self.body = RigidBody.from_points(self.masses, self.points)
        self.machine = CoupledRotation(self.body, n1=self.n1, n2=self.n2, a=self.a)
        self.particles = particles.Machine(self.masses, self.points, self.n1, self.n2, self.a)
        if free:
            self.phi2[2] = float(
                self.particles.free_motion(self.phi1, self.phi2, self.G).phi2.d().d().now
            )
        self.motion = self.particles.motion(self.phi1, self.phi2)
        self.state = self.machine.at(*self.phi1[:3], *self.phi2[:3])


@pytest.fixture(params=range(6))
def trial(request):
    return Trial(request.param)


# --- recorded values ---------------------------------------------------------------------------


def everything(state) -> dict[str, np.ndarray]:
    return {
        "M": state.body.mass,
        "n1": state.n1,
        "n2": state.n2,
        "r0": state.r0,
        "rhoC": state.rho_C,
        "I_O2": state.body.inertia,
        "S_n1": state.linear_moment_1,
        "S_n2": state.linear_moment_2,
        "J_n1": state.inertia_moment_1,
        "J_n2": state.inertia_moment_2,
        "D_n1": state.deviation_moment_1,
        "D_n2": state.deviation_moment_2,
        "K": state.linear_momentum,
        "dK": state.linear_momentum_rate,
        "L_O1": state.angular_momentum,
        "dL_O1": state.angular_momentum_rate,
        "M_O2": state.moment_about_O2,
        "T": state.kinetic_energy,
        "dT": state.kinetic_energy_rate,
        "N12": 0.5 * state.coupling_vector,
        **state.rotators,
        **{f"abs_{name}": size for name, size in state.intensities.items() if name != "R12"},
    }


@recorded("momentum", "body_bearings")
def test_recorded_values(case):
    x, out = case["input"], dict(case["output"])
    body = RigidBody.from_points(x["masses"], x["rho0"])
    machine = CoupledRotation(body, n1=x["n1"], n2=x["n20"], a=x["a"])
    motion = [x["phi1"], x["w1"], x["dw1"], x["phi2"], x["w2"], x.get("dw2", 0.0)]
    state, found = machine.at(*motion), {}
    if case["kind"] == "body_bearings":
        G = x["G"]
        found["dw2"] = state.free_acceleration(G)
        state = machine.at(*motion[:5], found["dw2"])
        found["FA2"], found["FB2"] = state.self_bearings(G, x["sA"], x["sB"])
        found["FA1"], found["FB1"] = state.fixed_bearings(G, x["rhoB1"])
        found["M1_drive"] = state.drive_torque(G)
        assert out.pop("tau2") == 0
        assert abs(state.self_torque(G)) <= 1e-14 * np.abs(out["M_O2"]).max()
        weight_power = out.pop("power_gravity")
        close(state.kinetic_energy_rate - state.power(G), weight_power, 1e-12, abs(out["dT"]))
    found |= everything(state)
    assert set(found) == set(out)
    for name, want in out.items():
        if want is None:
            assert np.isnan(found[name]).all()
        else:
            close(found[name], want)


def carrier_frame(state) -> np.ndarray:
    """Rows u01, v01, n1."""
    return np.stack([state.n2, np.cross(state.n1, state.n2), state.n1])


def disk_frame(state, phi: float) -> np.ndarray:
    """Rows u2, v2, n2: tangential, inward, along the shaft."""
    u01, v01, n1 = carrier_frame(state)
    sin, cos = np.sin(phi), np.cos(phi)
    return np.stack([cos * v01 + sin * n1, cos * n1 - sin * v01, u01])


@recorded("disk_bearings")
def test_recorded_bearings_of_the_disk(case):
    x, out = case["input"], dict(case["output"])
    m, half_span, phi = x["m"], x["l"], x["phi2"]
    machine = CoupledRotation(
        RigidBody.disk(m, x["r"], x["e"], x["beta"]), n1=UP, n2=EAST, a=x["a"]
    )
    G, none = np.array([0.0, 0.0, -m * x["g"]]), np.zeros(3)
    motion = [x["phi1"], x["w1"], x["dw1"], phi, x["w2"]]
    ddphi = machine.at(*motion).free_acceleration(G)
    close(ddphi, out["phiddot"], scale=abs(out["phiddot"]) + abs(x["w1"] ** 2))
    state, rest = machine.at(*motion, ddphi), machine.at(phi1=x["phi1"], phi2=phi)
    carrier, disk = carrier_frame(state), disk_frame(state, phi)
    F_A, F_B = state.self_bearings(G, half_span, -half_span)
    kin_A, kin_B = state.self_bearings(none, half_span, -half_span)
    weight_A, weight_B = rest.self_bearings(G, half_span, -half_span)
    F_A1, F_B1 = state.fixed_bearings(G, x["rhoB1"])
    kin_A1, kin_B1 = state.fixed_bearings(none, x["rhoB1"])
    assert out["tau2"] == 0
    found = {
        "FA2": disk @ F_A,
        "FB2": disk @ F_B,
        "FA2_kin": disk @ kin_A,
        "FB2_kin": disk @ kin_B,
        "FA2_weight": disk @ weight_A,
        "FB2_weight": disk @ weight_B,
        "static_torque": rest.self_torque(G),
        "couple_kin_O2": disk @ np.cross(half_span * state.n2, kin_A - kin_B),
        "FA2N2_kin": np.linalg.norm((disk @ kin_A)[:2]),
        "FB2N2_kin": np.linalg.norm((disk @ kin_B)[:2]),
        "FA2n2_kin": (disk @ kin_A)[2],
        "FA1": carrier @ F_A1,
        "FB1": carrier @ F_B1,
        "FA1_kin": carrier @ kin_A1,
        "FB1_kin": carrier @ kin_B1,
        "Mdev1_kin": carrier @ np.cross(x["rhoB1"] * state.n1, kin_B1),
        "M1_drive": state.drive_torque(G),
        "T": state.kinetic_energy,
        "dT": state.kinetic_energy_rate,
        "power_gravity": state.kinetic_energy_rate - state.power(G),
    }
    parameters = {"J", "eps", "Jn", "Ju", "Jv", "Jvn", "A", "B", "C", "phiddot", "tau2"}
    assert set(found) == set(out) - parameters
    # Components and differences, within the size of what they are of.
    scale = {
        "power_gravity": abs(out["dT"]) + abs(out["power_gravity"]),
        "static_torque": m * x["g"] * x["r"],
        "FA2n2_kin": np.linalg.norm(out["FA2_kin"]),
    }
    for name, got in found.items():
        close(got, out[name], scale=scale.get(name))


@recorded("disk_rotators")
def test_recorded_rotators_of_the_disk(case):
    x, out = case["input"], case["output"]
    body = RigidBody.disk(x["m"], x["r"], x["e"], x["beta"])
    machine = CoupledRotation(body, n1=UP, n2=EAST, a=x["a"])
    state = machine.at(
        phi1=x["phi1"],
        omega1=x["w1"],
        phi2=x["phi2"],
        omega2=out["phidot"],
        domega2=out["phiddot"],
    )
    G = [0.0, 0.0, -x["m"] * x["g"]]
    scale = abs(out["A"]) + abs(out["B"]) + abs(out["C"])
    close(state.free_acceleration(G), out["phiddot"], scale=scale)
    for name in ROTATORS:
        close(carrier_frame(state) @ state.rotators[name], out[f"{name}_u01v01n1"])
        close(state.intensities[name], out[f"abs_{name}"])
    rates = state.angular_velocities(ddomega2=out["phidddot"])
    close(rates["R01"], x["w1"])
    for name in ("R022", "R2"):
        close(rates[name], out["phidot"] + out["gamma2_dot"])
    close(rates["R011"], out["az_rate_R011"])  # the carrier's turning included


@pytest.mark.parametrize("case", MUJOCO["cases"], ids=lambda case: case["tag"])
def test_engines_for_multibody_dynamics(case):
    x, out = case["inputs"], case["outputs"]
    m, half_span, phi = x["m"], x["l"], x["phi"]
    body = RigidBody.disk(m, x["r"], x["e"], x["beta"])
    machine = CoupledRotation(body, n1=UP, n2=EAST, a=x["a"])
    motion = {"phi1": 0.4, "omega1": x["omega1"], "phi2": phi, "omega2": x["phidot"]}
    G = np.array([0.0, 0.0, -m * x["g"]])
    ddphi = machine.at(**motion).free_acceleration(G)
    state = machine.at(**motion, domega2=ddphi)

    # Sums of absolute terms
    w1, w2 = abs(x["omega1"]), abs(x["phidot"])
    turning = (w1 + w2) ** 2 + abs(out["phiddot"])
    force = m * (abs(x["a"]) * w1**2 + x["e"] * turning + x["g"])
    moment = 2 * body.polar_moment() * turning + m * x["e"] * (abs(x["a"]) * w1**2 + x["g"])
    bearing, about_O1 = force + moment / half_span, moment + abs(x["a"]) * force

    def same(name, got, scale):
        close(got, out[name], 1e-11, scale)

    u01, v01, n1 = carrier_frame(state)
    u2, v2, n2 = disk_frame(state, phi)
    carrier, disk = np.stack([v01, u01, n1]), np.stack([-v2, u2, n2])
    F_A, F_B = state.self_bearings(G, -half_span, half_span)
    couple = state.moment_about_O2 - np.cross(state.rho_C, G)
    axial = body.axial_moment(EAST)
    same("phiddot", ddphi, moment / axial)
    same("drive_torque", state.drive_torque(G), about_O1)
    same("C_from_O1_carrier", carrier @ (state.r0 + state.rho_C), abs(x["a"]) + x["e"])
    supports = state.linear_momentum_rate - G
    for frame, rows in (("carrier", carrier), ("disk", disk)):
        same(f"F_O2_{frame}", rows @ supports, force)
        same(f"M_O2_{frame}", rows @ couple, moment)
        same(f"F_A2_{frame}", rows @ F_A, bearing)
        same(f"F_B2_{frame}", rows @ F_B, bearing)
    F_A1, F_B1 = state.fixed_bearings(G, 0.7)
    same("F_O1_carrier", carrier @ (F_A1 + F_B1), force + about_O1 / 0.7)
    ground = np.cross(0.7 * n1, F_B1) + state.drive_torque(G) * n1
    same("M_O1_carrier", carrier @ ground, force + about_O1)


# --- particles ---------------------------------------------------------------------------------


def test_the_particles_jets_are_derivatives():
    """High-order differences of K and L, and of the positions that they come from."""
    trial = Trial(11)
    for name in ("K", "L"):
        for k in range(3):

            def momentum(t, name=name, k=k):
                return getattr(trial_at(trial, t), name)[k].now

            want = getattr(trial.motion, "d" + name)[k]
            assert abs(mp.diff(momentum, 0, h=mpf("1e-20")) - want) <= mpf("1e-18") * (
                1 + abs(want)
            )

    def center(t):
        motion = trial_at(trial, t)
        return motion.r0[0].now + motion.rho_C[0].now

    want = trial.motion.K[0].now / trial.motion.M
    assert abs(mp.diff(center, 0, h=mpf("1e-20")) - want) <= mpf("1e-18") * (1 + abs(want))


@recorded("momentum", "body_bearings")
def test_the_particles_agree_with_the_recorded_values(case):
    x, out = case["input"], case["output"]
    machine = particles.Machine(x["masses"], x["rho0"], x["n1"], x["n20"], x["a"])
    phi1, phi2 = [x["phi1"], x["w1"], x["dw1"]], [x["phi2"], x["w2"], x.get("dw2", 0)]
    motion = machine.motion(phi1, phi2)
    if case["kind"] == "body_bearings":
        motion = machine.free_motion(phi1, phi2, x["G"])
        F_A, F_B, couple = motion.self_bearings(x["G"], x["sA"], x["sB"])
        close(F_A, out["FA2"])
        close(F_B, out["FB2"])
        assert abs(couple) < 1e-40
        F_A, F_B, couple = motion.fixed_bearings(x["G"], x["rhoB1"])
        close(F_A, out["FA1"])
        close(F_B, out["FB1"])
        close(couple, out["M1_drive"])
        close(motion.power_of_weight(x["G"]), out["power_gravity"])
    close(particles.now(motion.K), out["K"])
    close(particles.now(motion.L), out["L_O1"])
    for name, want in (("dK", "dK"), ("dL", "dL_O1"), ("M_O2", "M_O2"), ("T", "T"), ("dT", "dT")):
        close(getattr(motion, name), out[want])
    close(particles.now(motion.J(motion.n2)), out["J_n2"])


def trial_at(trial, t):
    """Motion of the particles at another time, along the same cubic polynomials."""
    moved = []
    for phi in (trial.phi1, trial.phi2):
        x, w, dw, ddw = particles.exact(phi)
        angle = x + w * t + dw * t**2 / 2 + ddw * t**3 / 6
        moved.append([angle, w + dw * t + ddw * t**2 / 2, dw + ddw * t, ddw])
    return trial.particles.motion(*moved)


def test_momentum_and_its_rate(trial):
    state, motion = trial.state, trial.motion
    close(state.linear_momentum, particles.now(motion.K))
    close(state.angular_momentum, particles.now(motion.L))
    close(state.linear_momentum_rate, motion.dK)
    close(state.angular_momentum_rate, motion.dL)
    close(state.moment_about_O2, motion.M_O2)
    close(state.kinetic_energy, motion.T)
    close(state.kinetic_energy_rate, motion.dT)
    close(state.r0, particles.now(motion.r0))
    close(state.rho_C, particles.now(motion.rho_C))


def test_reactions(trial):
    state, motion, G = trial.state, trial.motion, trial.G
    F_A, F_B, couple = motion.self_bearings(G, trial.s_A, trial.s_B)
    got = state.self_bearings(G, trial.s_A, trial.s_B)
    close(got.F_A2, F_A)
    close(got.F_B2, F_B)
    close(state.self_torque(G), couple)
    F_A, F_B, couple = motion.fixed_bearings(G, trial.rho)
    got = state.fixed_bearings(G, trial.rho)
    close(got.F_A1, F_A)
    close(got.F_B1, F_B)
    close(state.drive_torque(G), couple)


def test_newton_and_euler_are_satisfied(trial):
    state, G = trial.state, trial.G
    F_A, F_B = state.self_bearings(G, trial.s_A, trial.s_B)
    scale = np.abs(F_A).max() + np.abs(F_B).max() + np.abs(G).max()
    close(F_A + F_B + G - state.linear_momentum_rate, np.zeros(3), 1e-14, scale)
    assert abs(F_B @ state.n2) <= 1e-15 * scale
    n2 = state.n2
    moment = np.cross(trial.s_A * n2, F_A) + np.cross(trial.s_B * n2, F_B)
    moment += np.cross(state.rho_C, G) + state.self_torque(G) * n2
    reach = 1 + abs(trial.s_A) + abs(trial.s_B) + np.linalg.norm(state.r0 + state.rho_C)
    close(moment - state.moment_about_O2, np.zeros(3), 1e-14, scale * reach)

    F_A, F_B = state.fixed_bearings(G, trial.rho)
    scale = np.abs(F_A).max() + np.abs(F_B).max() + np.abs(G).max()
    close(F_A + F_B + G - state.linear_momentum_rate, np.zeros(3), 1e-14, scale)
    moment = np.cross(trial.rho * state.n1, F_B) + state.drive_torque(G) * state.n1
    moment += np.cross(state.r0 + state.rho_C, G)
    close(moment - state.angular_momentum_rate, np.zeros(3), 1e-14, scale * reach)


@pytest.mark.parametrize("seed", range(20, 24))
def test_the_drive_pays_for_energy_in_free_motion(seed):
    trial = Trial(seed, free=True)
    state, motion, G = trial.state, trial.motion, trial.G
    close(state.free_acceleration(G), trial.phi2[2], 1e-12)
    energy_rate = motion.dT - motion.power_of_weight(G)
    close(state.power(G), energy_rate, 1e-12, abs(motion.dT) + abs(motion.power_of_weight(G)))
    assert abs(state.self_torque(G)) <= 1e-13 * np.abs(state.moment_about_O2).max()


def test_a_motor_on_the_shaft(trial):
    """The acceleration does not depend on the one that the state has; both drives pay."""
    G, torque = trial.G, 0.7
    domega2 = trial.state.free_acceleration(G, torque)
    state = trial.machine.at(*trial.phi1[:3], *trial.phi2[:2], domega2)
    close(state.self_torque(G), torque, 1e-12, np.abs(state.moment_about_O2).max())
    close(state.free_acceleration(G, torque), domega2)
    velocity = state.linear_momentum / state.body.mass
    power = state.power(G) + torque * trial.phi2[1] + G @ velocity
    close(power, state.kinetic_energy_rate, 1e-12, abs(state.power(G)) + 1)


# --- rotators ----------------------------------------------------------------------------------


def base_jets(motion) -> dict[str, list]:
    """Base vectors by their definitions, as functions of time; of R12c apart from it."""
    cross, n1, n2 = particles.cross, motion.n1, motion.n2
    return {
        "R01": cross(n1, motion.r0),
        "R011": motion.S(n1),
        "R022": motion.S(n2),
        "R012": cross(n1, motion.S(n2)),
        "R1": motion.D(n1),
        "R2": motion.D(n2),
        "R12": cross(n1, motion.J(n2)),
    }


def rotator_jets(motion) -> dict[str, list]:
    """Rotators times the lengths of their base vectors."""
    found = {}
    for name, base in base_jets(motion).items():
        index = 2 if name in ACROSS_2 else 1
        n, phi = getattr(motion, f"n{index}"), getattr(motion, f"phi{index}")
        omega = phi.d()
        if name in ("R012", "R12"):
            spin = motion.phi1.d() * motion.phi2.d() * 2
            found[name] = particles.times(spin, base)
        else:
            swung = particles.times(omega * omega, particles.cross(n, base))
            found[name] = particles.plus(particles.times(omega.d(), base), swung)
    return found


def coupled_moment(machine, phi1, phi2) -> list:
    """C12 from M_O2, which is quadratic in the angular velocities, by the definition."""
    parts = [
        machine.motion([phi1, w1, 0], [phi2, w2, 0]).M_O2 for w1, w2 in ((1, 1), (1, 0), (0, 1))
    ]
    return particles.minus(parts[0], particles.plus(*parts[1:]))


def test_rotators_by_definition(trial):
    bases = base_jets(trial.motion)
    for name, jet in rotator_jets(trial.motion).items():
        size = particles.norm(particles.now(bases[name]))
        want = particles.times(1 / size, particles.now(jet))
        close(trial.state.rotators[name], want)
        close(trial.state.intensities[name], particles.norm(want))


def test_coupling_vector_is_the_coupled_part_of_the_moment(trial):
    want = coupled_moment(trial.particles, trial.phi1[0], trial.phi2[0])
    close(trial.state.coupling_vector, want)
    spin = 2 * trial.phi1[1] * trial.phi2[1]
    close(trial.state.rotators["R12c"], particles.times(spin, particles.unit(want)))
    close(trial.state.intensities["R12c"], abs(spin))
    assert abs(trial.state.coupling_vector @ trial.state.n2) <= 1e-15 * float(particles.norm(want))


def test_rates_are_sums_of_rotators(trial):
    state, R = trial.state, trial.state.rotators
    norm, cross = np.linalg.norm, np.cross
    mass, S_2 = state.body.mass, state.linear_moment_2
    dK = mass * abs(trial.a) * R["R01"] + norm(state.linear_moment_1) * R["R011"]
    dK += norm(S_2) * R["R022"] + norm(cross(state.n1, S_2)) * R["R012"]
    close(dK, trial.motion.dK)
    moment = mass * abs(trial.a) * cross(state.rho_C, R["R01"])
    for axis, n in ((1, state.n1), (2, state.n2)):
        axial = trial.phi1[2] if axis == 1 else trial.phi2[2]
        deviation = getattr(state, f"deviation_moment_{axis}")
        moment += axial * state.body.axial_moment(n) * n + norm(deviation) * R[f"R{axis}"]
    moment += 0.5 * norm(state.coupling_vector) * R["R12c"]
    close(moment, trial.motion.M_O2)


@pytest.mark.slow
def test_angular_velocities_of_the_rotators(trial):
    """From the rate of change of each rotator, by jets."""
    got = trial.state.angular_velocities(trial.phi1[3], trial.phi2[3])
    assert tuple(got) == ROTATORS
    motion, cross, dot = trial.motion, particles.cross, particles.dot
    n1, n2 = particles.now(motion.n1), particles.now(motion.n2)
    for name, jet in rotator_jets(motion).items():
        R, rate = particles.now(jet), particles.now(particles.d(jet))
        n = n2 if name in ACROSS_2 else n1
        if name in ACROSS_2:  # relative to the carrier
            carried = particles.times(motion.phi1.d().now, cross(n1, R))
            rate = particles.minus(rate, carried)
        close(got[name], dot(n, cross(R, rate)) / dot(R, R))

    def coupling(t):
        later = trial_at(trial, t)
        return coupled_moment(trial.particles, later.phi1.now, later.phi2.now)

    C = coupling(0)
    step = mpf("1e-15")
    rate = particles.times(1 / (2 * step), particles.minus(coupling(step), coupling(-step)))
    rate = particles.minus(rate, particles.times(motion.phi1.d().now, cross(n1, C)))
    close(got["R12c"], dot(n2, cross(C, rate)) / dot(C, C))


def test_default_rates_are_without_third_derivatives(trial):
    got = trial.state.angular_velocities()
    want = trial.state.angular_velocities(0.0, 0.0)
    assert got == want


def undefined(state) -> set[str]:
    sets = []
    for found in (state.rotators, state.intensities, state.angular_velocities()):
        assert tuple(found) == ROTATORS
        sets.append({name for name, x in found.items() if np.isnan(x).any()})
        assert all(np.isnan(found[name]).all() for name in sets[-1])
    assert sets[0] == sets[1] == sets[2]
    return sets[0]


def test_rotators_without_base_vector_are_nan():
    motion = {"phi1": 0.7, "omega1": 2.0, "domega1": 0.3, "phi2": 1.1, "omega2": -1.5, "domega2": 1}
    rng = np.random.default_rng(9)
    disk = RigidBody.disk(2.0, 0.1, 0.05, 0.4)

    def of(body, a=0.1, **changes):
        return undefined(CoupledRotation(body, n1=UP, n2=EAST, a=a).at(**{**motion, **changes}))

    assert of(disk) == set()
    assert of(disk, a=0.0) == {"R01"}
    assert of(disk, a=-1e-300) == set()
    linear = {"R011", "R022", "R012"}
    assert of(RigidBody.disk(2.0, 0.1, 0.0, 0.4)) == linear
    assert of(RigidBody.disk(2.0, 0.1, 0.05, 0.0)) == {"R022", "R012", "R2"}
    # The center at the height of the shaft: S_n2 is along n1, D_n1 vanishes.
    assert of(disk, phi2=np.pi / 2) == {"R012", "R1"}
    # A ball at O2, turned by rounding angles: no deviation, no linear moment.
    turns = rotation(unit(rng.normal(size=(20, 3))), rng.normal(size=20))
    for turn in turns:
        ball = RigidBody(3.0, np.zeros(3), np.eye(3)).rotated(turn)
        assert of(ball, phi1=rng.normal(), phi2=rng.normal()) == linear | {"R1", "R2"}
        assert of(ball.shifted([-2.0, 0, 0])) == {"R022", "R012", "R1", "R2"}


def test_rotators_at_rest_are_zero_and_do_not_turn():
    trial = Trial(3)
    state = trial.machine.at(phi1=0.3, phi2=0.4, omega1=0.0, omega2=2.0)
    for name in ROTATORS:
        zero = name not in ("R022", "R2")
        assert (np.abs(state.rotators[name]).max() == 0) == zero
        assert (state.intensities[name] == 0) == zero
        assert np.isnan(state.angular_velocities()[name]) == zero
    close(state.angular_velocities()["R2"], 2.0)


# --- symmetries --------------------------------------------------------------------------------


def test_mirror_images(trial):
    """In a mirror all rotations and the sign of a are reversed, and axial vectors as well."""
    normal = unit(np.random.default_rng(0).normal(size=3))
    Q = np.eye(3) - 2 * np.outer(normal, normal)
    machine = CoupledRotation(trial.body.rotated(Q), n1=Q @ trial.n1, n2=Q @ trial.n2, a=-trial.a)
    state, image = trial.state, machine.at(*-trial.phi1[:3], *-trial.phi2[:3])
    G = trial.G
    close(image.r0, Q @ state.r0)
    close(image.linear_momentum, Q @ state.linear_momentum)
    close(image.linear_momentum_rate, Q @ state.linear_momentum_rate)
    close(image.angular_momentum, -Q @ state.angular_momentum)
    close(image.angular_momentum_rate, -Q @ state.angular_momentum_rate)
    close(image.kinetic_energy, state.kinetic_energy)
    close(image.kinetic_energy_rate, state.kinetic_energy_rate)
    close(image.drive_torque(Q @ G), -state.drive_torque(G))
    close(image.power(Q @ G), state.power(G))
    close(image.free_acceleration(Q @ G), -state.free_acceleration(G))
    for got, want in (
        (image.self_bearings(Q @ G, 0.3, -0.2), state.self_bearings(G, 0.3, -0.2)),
        (image.fixed_bearings(Q @ G, 0.3), state.fixed_bearings(G, 0.3)),
    ):
        close(got[0], Q @ want[0])
        close(got[1], Q @ want[1])
    for name in ROTATORS:
        sign = -1 if name in ("R1", "R2", "R12", "R12c") else 1
        close(image.rotators[name], sign * Q @ state.rotators[name])


@pytest.mark.slow
@pytest.mark.parametrize("axis", [1, 2])
def test_the_sense_of_an_axis_is_a_convention(trial, axis):
    """Reversing n1 or n2, its angle and a gives the same motion."""
    n1, n2, phi1, phi2 = trial.n1, trial.n2, trial.phi1[:3], trial.phi2[:3]
    if axis == 1:
        n1, phi1 = -n1, -phi1
    else:
        n2, phi2 = -n2, -phi2
    other = CoupledRotation(trial.body, n1=n1, n2=n2, a=-trial.a).at(*phi1, *phi2)
    for name, want in everything(trial.state).items():
        # Axes and what belongs to them are reversed; R of the other vectors is not.
        if name in ("K", "dK", "L_O1", "dL_O1", "M_O2", "T", "dT", "r0", "rhoC", "I_O2"):
            close(everything(other)[name], want)
    sides = (0.3, -0.2) if axis == 1 else (-0.3, 0.2)
    for got, want in zip(
        other.self_bearings(trial.G, *sides),
        trial.state.self_bearings(trial.G, 0.3, -0.2),
        strict=True,
    ):
        close(got, want)
    close(other.power(trial.G), trial.state.power(trial.G))
    for name in ROTATORS:
        close(other.rotators[name], trial.state.rotators[name])


def disk_state(beta, a, **motion):
    return CoupledRotation(RigidBody.disk(2.0, 0.2, 0.1, beta), n1=UP, n2=EAST, a=a).at(**motion)


MOTION = {"phi1": 0.4, "omega1": 3.0, "domega1": 0.7, "phi2": 1.2, "omega2": -2.0, "domega2": 5.0}
G_DISK = np.array([0.0, 0.0, -2.0 * 9.81])


def test_disk_of_the_supplementary_angle_is_a_mirror_image():
    """Beta -> pi - beta: mirrored along the shaft; the carrier turns the other way."""
    beta, a = 0.7, 0.3
    state = disk_state(beta, a, **MOTION)
    back = {name: -x for name, x in MOTION.items() if name in ("phi1", "omega1", "domega1")}
    image = disk_state(np.pi - beta, a, **{**MOTION, **back})
    Q = np.diag([-1.0, 1.0, 1.0])
    close(image.linear_momentum_rate, Q @ state.linear_momentum_rate)
    close(image.free_acceleration(G_DISK), state.free_acceleration(G_DISK))
    got, want = image.self_bearings(G_DISK, -0.3, 0.2), state.self_bearings(G_DISK, 0.3, -0.2)
    close(got.F_A2, Q @ want.F_A2)
    close(got.F_B2, Q @ want.F_B2)


def test_disk_on_the_other_side_of_the_vertical_axis():
    """A -> -a, with beta -> pi - beta and phi -> -phi: half a turn about the vertical axis."""
    beta, a = 0.7, 0.3
    state = disk_state(beta, -a, **MOTION)
    back = {name: -x for name, x in MOTION.items() if name in ("phi2", "omega2", "domega2")}
    other = disk_state(np.pi - beta, a, **{**MOTION, **back, "phi1": MOTION["phi1"] + np.pi})
    close(other.linear_momentum, state.linear_momentum)
    close(other.angular_momentum_rate, state.angular_momentum_rate)
    close(other.drive_torque(G_DISK), state.drive_torque(G_DISK))
    close(other.free_acceleration(G_DISK), -state.free_acceleration(G_DISK))
    got, want = other.self_bearings(G_DISK, -0.3, 0.2), state.self_bearings(G_DISK, 0.3, -0.2)
    close(got.F_A2, want.F_A2)
    close(got.F_B2, want.F_B2)


# --- batches, values, errors -------------------------------------------------------------------


def answers(state, G) -> dict[str, np.ndarray]:
    F_A2, F_B2 = state.self_bearings(G, 0.3, -0.2)
    F_A1, F_B1 = state.fixed_bearings(G, 0.5)
    return {
        **everything(state),
        **{f"rate_{name}": x for name, x in state.angular_velocities(0.3, -0.2).items()},
        "omega": state.angular_velocity,
        "F_A2": F_A2,
        "F_B2": F_B2,
        "F_A1": F_A1,
        "F_B1": F_B1,
        "drive": state.drive_torque(G),
        "power": state.power(G),
        "self": state.self_torque(G),
        "free": state.free_acceleration(G, 0.1),
    }


def test_batches_equal_loops():
    rng = np.random.default_rng(4)
    masses, points = rng.uniform(0.2, 2.0, (2, 1, 4)), rng.normal(size=(2, 1, 4, 3))
    n1, n2 = rng.normal(size=(2, 3)), rng.normal(size=3)
    n1, a = n1[:1], rng.normal(size=(2, 1))
    motion, G = rng.normal(size=(6, 3)), rng.normal(size=(3, 3))
    machine = CoupledRotation(RigidBody.from_points(masses, points), n1=n1, n2=n2, a=a)
    assert machine.shape == (2, 1)
    state = machine.at(*motion)
    assert state.shape == (2, 3)
    found = answers(state, G)
    for i in range(2):
        body = RigidBody.from_points(masses[i, 0], points[i, 0])
        one = CoupledRotation(body, n1=n1[0], n2=n2, a=a[i, 0])
        for k in range(3):
            for name, want in answers(one.at(*motion[:, k]), G[k]).items():
                full = np.broadcast_to(found[name], (2, 3, *np.shape(want)))
                close(full[i, k], want, 1e-13)


def test_results_of_a_single_state_are_single():
    trial = Trial(0)
    state = trial.state
    for name in ("kinetic_energy", "kinetic_energy_rate"):
        assert isinstance(getattr(state, name), float)
    assert isinstance(state.drive_torque(trial.G), float)
    assert isinstance(state.power(trial.G), float)
    assert isinstance(state.self_torque(trial.G), float)
    assert isinstance(state.free_acceleration(trial.G), float)
    for numbers in (state.intensities, state.angular_velocities()):
        assert all(isinstance(x, float) for x in numbers.values())


def test_invalid_members_of_a_batch_are_nan():
    trial = Trial(0)
    good = [True, False, False, False, False, True]
    machine = CoupledRotation(
        trial.body,
        n1=[trial.n1, [0, 0, 0], trial.n2, trial.n1, trial.n1, trial.n1],
        n2=trial.n2,
        a=[trial.a, 1, 1, np.nan, 1, trial.a],
    )
    state = machine.at(*trial.phi1[:3], trial.phi2[0], [1, 1, 1, 1, np.inf, 1])
    for name in ("linear_momentum_rate", "angular_momentum_rate"):
        assert np.isfinite(getattr(state, name)).all(axis=-1).tolist() == good
    assert np.isfinite(state.kinetic_energy).tolist() == good
    assert np.isfinite(state.free_acceleration(trial.G)).tolist() == good
    F_A, F_B = trial.state.self_bearings(trial.G, [0.1, 0.2], 0.2)
    assert np.isfinite([F_A, F_B]).all(axis=-1).tolist() == [[True, False]] * 2
    F_A, F_B = trial.state.fixed_bearings(trial.G, [0.1, 0.0])
    assert np.isfinite([F_A, F_B]).all(axis=-1).tolist() == [[True, False]] * 2


def test_a_body_without_inertia_about_its_shaft_has_no_free_acceleration():
    rod = RigidBody.from_points([1.0, 2.0], [[0.1, 0, 0], [0.4, 0, 0]])
    state = CoupledRotation(rod, n1=UP, n2=EAST, a=0.1).at(omega1=2.0, phi1=0.3, phi2=0.4)
    assert np.isnan(state.free_acceleration([0, 0, -9.81]))


def test_value_semantics():
    trial = Trial(0)
    other = CoupledRotation(trial.body, n1=2 * trial.n1, n2=trial.n2, a=trial.a)
    assert other == trial.machine
    assert hash(other) == hash(trial.machine)
    assert trial.machine != CoupledRotation(trial.body, n1=trial.n1, n2=trial.n2, a=0.0)
    assert trial.machine.at(phi1=1.0) == other.at(phi1=1.0)
    assert trial.machine.at(phi1=1.0) != other.at(phi1=1.1)
    for twin in (pickle.loads(pickle.dumps(other)), copy.deepcopy(other)):
        assert twin == other
        with pytest.raises(ValueError, match="read-only"):
            twin.n1[0] = 0
    for array in (trial.machine.n1, trial.state.n1, trial.state.n2, trial.state.r0):
        with pytest.raises(ValueError, match="read-only"):
            array[0] = 0


def test_repr():
    body = RigidBody(1.0, [0, 0, 0], np.eye(3))
    machine = CoupledRotation(body, n1=(0, 0, 2), n2=(1, 0, 0), a=0.5)
    assert repr(machine) == f"CoupledRotation({body!r}, n1=[0, 0, 1], n2=[1, 0, 0], a=0.5)"
    batch = CoupledRotation(body, n1=(0, 0, 2), n2=(1, 0, 0), a=[0.5, 0.6])
    assert repr(batch) == f"CoupledRotation({body!r}, <batch of shape (2,)>)"
    assert repr(machine.at(omega1=2.0)).startswith("CoupledRotationState(")


BAD = [
    ("body", lambda x: CoupledRotation(3, n1=UP, n2=EAST, a=0.1)),
    ("n1", lambda x: CoupledRotation(x.body, n1=(0, 0, 0), n2=EAST, a=0.1)),
    ("n1", lambda x: CoupledRotation(x.body, n1="up", n2=EAST, a=0.1)),
    ("n2", lambda x: CoupledRotation(x.body, n1=UP, n2=(1, 0), a=0.1)),
    ("n2", lambda x: CoupledRotation(x.body, n1=UP, n2=(0, 0, -3), a=0.1)),
    ("n2", lambda x: CoupledRotation(x.body, n1=(1, 2, 3), n2=(0.1, 0.2, 0.3), a=0.1)),
    ("a", lambda x: CoupledRotation(x.body, n1=UP, n2=EAST, a=np.nan)),
    ("a", lambda x: CoupledRotation(x.body, n1=UP, n2=EAST, a="0.1")),
    *((name, lambda x, name=name: x.machine.at(**{name: np.inf})) for name in ANGLES),
    ("omega1", lambda x: x.machine.at(omega1=None)),
    ("G", lambda x: x.state.drive_torque(-9.81)),
    ("G", lambda x: x.state.self_torque([0, 0, np.nan])),
    ("s_A", lambda x: x.state.self_bearings(UP, "left", 0.1)),
    ("s_B", lambda x: x.state.self_bearings(UP, 0.1, 0.1)),
    ("rho_B1", lambda x: x.state.fixed_bearings(UP, 0.0)),
    ("torque", lambda x: x.state.free_acceleration(UP, np.nan)),
    ("ddomega1", lambda x: x.state.angular_velocities(np.nan)),
    ("ddomega2", lambda x: x.state.angular_velocities(ddomega2="none")),
]


@pytest.mark.parametrize(("name", "call"), BAD)
def test_unusable_arguments_are_named(name, call):
    with pytest.raises(ParameterError, match=rf"^{name}: got .*, wants "):
        call(Trial(0))


def test_parallel_axes_are_said_to_be_so():
    with pytest.raises(ParameterError, match="not parallel to n1 = "):
        CoupledRotation(RigidBody(1.0, [0, 0, 0], np.eye(3)), n1=UP, n2=(0, 0, -1), a=1)


def test_shapes_that_do_not_broadcast_are_named():
    body = RigidBody([1.0, 2.0], np.zeros(3), np.eye(3))
    with pytest.raises(ParameterError, match=r"body \(2,\), a \(3,\)"):
        CoupledRotation(body, n1=UP, n2=EAST, a=[1, 2, 3])
    machine = CoupledRotation(body, n1=UP, n2=EAST, a=0.1)
    with pytest.raises(ParameterError, match=r"machine \(2,\), phi2 \(3,\)"):
        machine.at(phi2=[1, 2, 3])
    state = machine.at()
    with pytest.raises(ParameterError, match=r"state \(2,\), G \(3,\)"):
        state.drive_torque(np.eye(3))
    with pytest.raises(ParameterError, match=r"state \(2,\), s_A \(3,\)"):
        state.self_bearings(UP, [1, 2, 3], 0.1)
    with pytest.raises(ParameterError, match=r"state \(2,\), ddomega1 \(3,\)"):
        state.angular_velocities([1, 2, 3])
