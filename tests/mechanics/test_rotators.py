"""Rotators of the disk against recorded values, particles, general bodies and symmetries."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from mpmath import mp, mpf
from witnesses import particles

from phasekit.mechanics.disk import disk_coefficients
from phasekit.mechanics.general.body import RigidBody
from phasekit.mechanics.general.rotation import CoupledRotation
from phasekit.mechanics.rotators import ROTATORS, rotators
from phasekit.numerics import launch
from phasekit.phase.exact.flow import flow

DATA = Path(__file__).parents[1] / "data"
CASES = [
    case
    for case in json.loads((DATA / "vectors.json").read_text())["cases"]
    if case["kind"] == "disk_rotators"
]
DISK = {"beta": 0.7, "e": 0.03, "a": 0.05, "r": 0.21, "omega1": 12.5, "g": 9.81}
STATES = {"phi": np.linspace(-3.0, 3.3, 12), "dphi": np.linspace(-7.0, 9.0, 12)}
UP, EAST = (0.0, 0.0, 1.0), (1.0, 0.0, 0.0)
NUMBER = {name: i for i, name in enumerate(ROTATORS)}


def close(got, want, tolerance=1e-12, scale=None) -> None:
    """Compare within a part of the wanted array's size, or of a scale."""
    got, want = np.asarray(got, float), np.asarray(want, float)
    assert got.shape == want.shape
    scale = np.abs(want).max() if scale is None else scale
    assert (np.abs(got - want) <= tolerance * scale).all(), (got, want)


def random_disks(n: int, seed: int = 41) -> dict[str, np.ndarray]:
    rng = np.random.default_rng(seed)
    return {
        "beta": rng.uniform(0, np.pi, n),
        "e": 10 ** rng.uniform(-3, 0, n),
        "a": rng.normal(size=n),
        "r": 10 ** rng.uniform(-2, 0, n),
        "omega1": rng.choice([-1, 1], n) * 10 ** rng.uniform(-1, 2, n),
        "g": rng.choice([9.80665, 1.6, 0.0, -9.80665], n),
    }


# --- recorded values ---------------------------------------------------------------------------


@pytest.mark.parametrize("case", CASES, ids=lambda case: case["id"])
def test_recorded_values(case):
    x, want = case["input"], case["output"]
    disk = (*(x[name] for name in ("beta", "e", "a", "r")), x["w1"], x["g"])
    got = rotators(*disk, x["phi2"], want["phidot"])
    size = abs(want["A"]) + abs(want["B"]) + abs(want["C"])
    for i, name in enumerate(ROTATORS):
        vector, intensity = want[f"{name}_u01v01n1"], want[f"abs_{name}"]
        if vector is None:
            assert np.isnan(got.rotator[i]).all()
            assert np.isnan(got.rotator_intensity[i])
        else:
            close(got.rotator[i], vector)
            close(got.rotator_intensity[i], intensity)
    close(got.gamma2, want["gamma2"])
    # the jerk is a sum with cancellation
    jerk = 2 * size * abs(want["phidot"])
    denominator = want["abs_R022"] ** 2
    wide = abs(want["phidot"]) * (2 * size**2 + abs(want["phidot"]) * jerk) / denominator
    close(got.gamma2_rate, want["gamma2_dot"], 1e-13, wide)
    close([got.hodograph_u, got.hodograph_v], want["hodograph_uv"])
    if want["R2_u2v2n2"] is not None:
        u2, v2, n2 = disk_axes(x["phi2"])
        for name in ("R022", "R2"):
            own = np.stack([u2, v2, n2]) @ got.rotator[NUMBER[name]]
            close(own, want[f"{name}_u2v2n2"])


def disk_axes(phi):
    s, c = np.sin(phi), np.cos(phi)
    return np.array([0.0, c, s]), np.array([0.0, -s, c]), np.array([1.0, 0.0, 0.0])


# --- other ways to the same --------------------------------------------------------------------


@pytest.mark.parametrize("free", [True, False])
def test_general_bodies(free):
    """Any disk and state, a support that gathers speed, a motor."""
    n = 300
    disk, rng = random_disks(n), np.random.default_rng(5)
    phi, dphi = rng.uniform(-4, 4, n), rng.normal(size=n) * 10
    domega1 = rng.normal(size=n) * 20
    ddphi = rng.normal(size=n) * 50
    body = RigidBody.disk(1.0, disk["r"], disk["e"], disk["beta"])
    machine = CoupledRotation(body, n1=UP, n2=EAST, a=disk["a"])
    motion = {"omega1": disk["omega1"], "domega1": domega1, "phi2": phi, "omega2": dphi}
    if free:
        G = np.stack([0 * phi, 0 * phi, -disk["g"]], axis=-1)
        ddphi = machine.at(**motion).free_acceleration(G)
    state = machine.at(**motion, domega2=ddphi)
    got = rotators(*disk.values(), phi, dphi, None if free else ddphi, domega1)
    for i, name in enumerate(ROTATORS):
        want = state.rotators[name]
        size = np.abs(want).max(axis=-1, keepdims=True)
        assert np.isfinite(want).all()
        # the direction of D_n1 and the free acceleration are differences
        assert np.max(np.abs(got.rotator[:, i] - want) / size) < 1e-9, name
        np.testing.assert_allclose(
            got.rotator_intensity[:, i], state.intensities[name], rtol=1e-9, err_msg=name
        )
    np.testing.assert_allclose(got.gamma2, np.arctan2(dphi**2, ddphi), rtol=1e-9)
    np.testing.assert_array_equal(got.hodograph_v, dphi**2)
    np.testing.assert_allclose(got.hodograph_u, ddphi, rtol=1e-9)
    assert np.isnan(got.gamma2_rate).all() == (not free)


@pytest.mark.slow
@pytest.mark.parametrize("beta", [0.0, 0.4, np.pi / 2, 2.5, np.pi])
@pytest.mark.parametrize("a", [0.3, -0.2, 0.0])
def test_particles(beta, a):
    """Base vectors as sums over four particles, in fifty digits; the zero ones are undefined."""
    m, r, e, g = 1.0, 0.2, 0.1, 9.81
    w1, d1, phi, w2, d2 = 3.0, -2.0, 0.6, -5.0, 7.0
    machine = particles.Machine(*particles.disk_particles(m, r, e, beta), UP, EAST, a)
    now = machine.motion([0, w1, d1], [phi, w2, d2])
    n1, n2 = now.n1, now.n2
    J1, J2 = now.J(n1), now.J(n2)
    cross, plus, times = particles.cross, particles.plus, particles.times
    dJ1, dJ2 = particles.d(J1), particles.d(J2)
    # what omega1 omega2 multiplies in d(omega1 J_n1 + omega2 J_n2)/dt, less the parts of one motion
    own = [machine.motion([0, x, 0], [phi, y, 0]) for x, y in ((1, 1), (1, 0), (0, 1))]
    both, first, second = (
        particles.now(particles.d(plus(times(z.phi1.d(), z.J(z.n1)), times(z.phi2.d(), z.J(z.n2)))))
        for z in own
    )
    coupling = particles.minus(both, plus(first, second))
    assert len(dJ1) == len(dJ2) == 3
    bases = {
        "R01": (1, cross(n1, now.r0)),
        "R011": (1, now.S(n1)),
        "R022": (2, now.S(n2)),
        "R012": (0, cross(n1, now.S(n2))),
        "R1": (1, now.D(n1)),
        "R2": (2, now.D(n2)),
        "R12": (0, cross(n1, J2)),
        "R12c": (0, coupling),
    }
    got = rotators(beta, e, a, r, w1, g, phi, w2, d2, d1)
    for name, (axis, base) in bases.items():
        b = [mpf(getattr(x, "now", x)) for x in base]
        i = NUMBER[name]
        if particles.norm(b) < mpf("1e-16"):  # sin(pi) and cos(pi/2) of the doubles
            assert np.isnan(got.rotator[i]).all(), name
            assert np.isnan(got.rotator_intensity[i]), name
            continue
        u = particles.unit(b)
        n = particles.now(n1 if axis == 1 else n2)
        w, dw = (w1, d1) if axis == 1 else (w2, d2)
        want = plus(times(dw, u), times(w * w, cross(n, u))) if axis else times(2 * w1 * w2, u)
        close(got.rotator[i], want)
        close(got.rotator_intensity[i], particles.norm(want))


def test_the_rate_of_momentum_is_their_sum():
    """dK/dt = M |r0| R01 + |S_n1| R011 + |S_n2| R022 + |[n1, S_n2]| R012, by particles."""
    x = DISK | {"m": 2.0}
    phi, w2, d2, d1 = 0.6, -5.0, 7.0, 3.0
    points = particles.disk_particles(x["m"], x["r"], x["e"], x["beta"])
    machine = particles.Machine(*points, UP, EAST, x["a"])
    now = machine.motion([0, x["omega1"], d1], [phi, w2, d2])
    got = rotators(*DISK.values(), phi, w2, d2, d1).rotator
    sizes = [
        x["m"] * abs(x["a"]),
        particles.norm(particles.now(now.S(now.n1))),
        particles.norm(particles.now(now.S(now.n2))),
        particles.norm(particles.now(particles.cross(now.n1, now.S(now.n2)))),
    ]
    found = sum(float(size) * got[i] for i, size in enumerate(sizes))
    close(found, now.dK)


# --- the angle's rate --------------------------------------------------------------------------


@pytest.mark.parametrize("start", [(0.3, 4.0), (-2.0, 0.5), (1.0, -9.0), (3.0, 0.0)])
def test_rate_of_the_angle_along_the_motion(start):
    """Sixth-order differences of atan2(phi'^2, phi'') along the motion in closed form."""
    abc = disk_coefficients(*DISK.values())
    step = 3e-4
    t = step * np.arange(-3, 4)
    phi, dphi = flow(*abc, *start, 0.1 + t)
    path = rotators(*DISK.values(), phi, dphi)
    weights = np.array([-1, 9, -45, 0, 45, -9, 1]) / 60
    rate = weights @ np.unwrap(path.gamma2) / step
    np.testing.assert_allclose(path.gamma2_rate[3], rate, rtol=1e-8, atol=1e-8)


@pytest.mark.slow
@pytest.mark.parametrize("domega1", [0.0, 4.0, -30.0])
@pytest.mark.parametrize("omega1", [12.5, -3.0, 0.0])
def test_rate_of_the_angle_while_the_support_gathers_speed(omega1, domega1):
    """Derivatives of the coefficients come from particles; fifty digits."""
    x = {**DISK, "omega1": omega1}
    phi, dphi = 0.8, 5.0
    points = particles.disk_particles(1, x["r"], x["e"], x["beta"])
    machine = particles.Machine(*points, UP, EAST, x["a"])

    def acceleration(omega, angle, rate):
        now = machine.free_motion([0, omega, domega1], [angle, rate, 0], (0, 0, -x["g"]))
        return now.phi2.d().d().now

    d2 = acceleration(mpf(omega1), mpf(phi), mpf(dphi))
    step = mpf("1e-12")

    def at(k):
        t = k * step
        return acceleration(omega1 + domega1 * t, phi + dphi * t + d2 * t * t / 2, dphi + d2 * t)

    d3 = (at(1) - at(-1)) / (2 * step)
    want = dphi * (2 * d2 * d2 - dphi * d3) / (d2 * d2 + mpf(dphi) ** 4)
    got = rotators(*x.values(), phi, dphi, domega1=domega1)
    close(got.gamma2_rate, want)
    close(got.hodograph_u, d2)


def test_rate_of_the_angle_of_slow_and_fast_motions():
    """Rates of any size: nothing overflows, nothing vanishes; none at rest in an equilibrium."""
    abc = disk_coefficients(*DISK.values())
    dphi = 10.0 ** np.arange(-150, 151, 25)
    got = rotators(*DISK.values(), 0.4, dphi)
    d2 = float(got.hodograph_u[0])
    _, _, rate = (mpf(x) for x in (0, 0, 0))
    for one, found in zip(dphi, got.gamma2_rate, strict=True):
        v, (A, B, C) = mpf(one), (mpf(float(x)) for x in abc)
        s, c = mp.sin(mpf(0.4)), mp.cos(mpf(0.4))
        force = -B * s + A * s * c + C * c
        jerk = v * (-B * c + A * (c * c - s * s) - C * s)
        rate = v * (2 * force**2 - v * jerk) / (force**2 + v**4)
        assert abs(found / rate - 1) < 1e-11, one
    assert np.isfinite(d2)
    assert np.isnan(rotators(0.0, 0.1, 0.0, 0.2, 0.0, 9.81, 0.3, 0.0).gamma2_rate)


# --- special disks and states ------------------------------------------------------------------


UNDEFINED = [
    ({"e": 0.0}, {"R011", "R022", "R012"}),
    ({"e": 0.0, "beta": np.pi / 2}, {"R011", "R022", "R012", "R1", "R2"}),
    ({"e": 0.0, "beta": 0.0}, {"R011", "R022", "R012", "R2"}),
    ({"beta": 0.0}, {"R022", "R012", "R2"}),
    ({"beta": np.pi}, {"R022", "R012", "R2"}),
    ({"beta": np.pi / 2}, {"R2"}),
    ({"a": 0.0}, {"R01"}),
    ({"a": -0.0}, {"R01"}),
    ({"r": 0.0}, set()),
    ({"omega1": 0.0}, set()),
    ({"g": 0.0}, set()),
]


@pytest.mark.parametrize(
    ("change", "undefined"), UNDEFINED, ids=[str(change) for change, _ in UNDEFINED]
)
def test_undefined_rotators(change, undefined):
    got = rotators(*{**DISK, **change}.values(), **STATES)
    for i, name in enumerate(ROTATORS):
        assert np.isnan(got.rotator[:, i]).all() == (name in undefined), name
        assert np.isnan(got.rotator_intensity[:, i]).all() == (name in undefined), name
        assert np.isfinite(got.rotator[:, i]).all() == (name not in undefined), name
    length = np.linalg.norm(got.rotator, axis=-1)
    np.testing.assert_allclose(length, got.rotator_intensity, rtol=1e-14)


@pytest.mark.parametrize("beta", [1e-80, 1e-150, 1e-160, 1e-200])
def test_tiny_base_vectors_have_a_direction(beta):
    got = rotators(*{**DISK, "beta": beta}.values(), 0.5, 2.0)
    length = np.linalg.norm(got.rotator, axis=-1)
    np.testing.assert_allclose(length, got.rotator_intensity, rtol=1e-14)
    np.testing.assert_allclose(got.rotator[NUMBER["R012"]], (-50.0, 0.0, 0.0), atol=1e-13)


def test_at_rest_only_the_support_turns():
    got = rotators(*DISK.values(), STATES["phi"], 0.0, 0.0)
    assert (
        got.rotator_intensity[:, [NUMBER[n] for n in ("R022", "R2", "R012", "R12c")]] == 0
    ).all()
    about_n1 = [NUMBER[name] for name in ("R01", "R011", "R1")]
    np.testing.assert_allclose(got.rotator_intensity[:, about_n1], 12.5**2, rtol=1e-15)
    none = rotators(*{**DISK, "omega1": 0.0}.values(), **STATES)
    assert (none.rotator_intensity[:, about_n1] == 0).all()
    assert (none.rotator_intensity[:, [NUMBER["R012"], NUMBER["R12"]]] == 0).all()


def test_relations():
    got = rotators(*DISK.values(), **STATES, domega1=3.0)
    R = {name: got.rotator[:, i] for name, i in NUMBER.items()}
    # [R2, n2] = R022 for 0 < beta < pi/2; both across n2
    np.testing.assert_allclose(np.cross(R["R2"], EAST), R["R022"], atol=1e-12)
    assert (R["R022"][:, 0] == 0).all()
    for name in ("R01", "R011", "R1"):
        assert (R[name][:, 2] == 0).all()
    # hodograph: components along (u2, v2)
    for phi, vector, u, v in zip(
        STATES["phi"], R["R022"], got.hodograph_u, got.hodograph_v, strict=True
    ):
        u2, v2, _ = disk_axes(phi)
        np.testing.assert_allclose([u2 @ vector, v2 @ vector], [u, v], atol=1e-12)
    np.testing.assert_allclose(np.tan(got.gamma2), got.hodograph_v / got.hodograph_u, rtol=1e-12)


# --- symmetries --------------------------------------------------------------------------------


def test_mirror_in_the_plane_of_the_axes():
    """With phi -> pi - phi and g -> -g: the mirror in the horizontal plane."""
    d2, d1 = 7.0, 3.0
    one = rotators(*DISK.values(), **STATES, ddphi=d2, domega1=d1)
    other = rotators(
        *{**DISK, "g": -DISK["g"]}.values(), np.pi - STATES["phi"], -STATES["dphi"], -d2, d1
    )
    np.testing.assert_allclose(other.rotator_intensity, one.rotator_intensity, rtol=1e-13)
    for name in ("R01", "R011", "R022", "R012"):  # polar vectors
        np.testing.assert_allclose(
            other.rotator[:, NUMBER[name]],
            one.rotator[:, NUMBER[name]] * [1, 1, -1],
            atol=1e-12 * 200,
            err_msg=name,
        )


def test_sign_of_a_turns_only_the_first():
    one = rotators(*DISK.values(), **STATES, ddphi=2.0, domega1=3.0)
    other = rotators(*{**DISK, "a": -DISK["a"]}.values(), **STATES, ddphi=2.0, domega1=3.0)
    np.testing.assert_array_equal(other.rotator[:, 0], -one.rotator[:, 0])
    np.testing.assert_array_equal(other.rotator[:, 1:], one.rotator[:, 1:])


def test_time_reversed():
    """omega1 -> -omega1 and phi' -> -phi': accelerations stay as they are."""
    one = rotators(*DISK.values(), **STATES, domega1=3.0)
    other = rotators(
        *{**DISK, "omega1": -DISK["omega1"]}.values(), STATES["phi"], -STATES["dphi"], domega1=3.0
    )
    np.testing.assert_array_equal(other.rotator, one.rotator)
    np.testing.assert_array_equal(other.hodograph_u, one.hodograph_u)
    np.testing.assert_allclose(other.gamma2, one.gamma2, rtol=1e-15)
    np.testing.assert_allclose(other.gamma2_rate, -one.gamma2_rate, rtol=1e-12)


def test_the_other_side_of_the_shaft():
    """With beta -> pi - beta: the mirror in the plane across the shaft."""
    one = rotators(*DISK.values(), **STATES, ddphi=2.0, domega1=3.0)
    other = rotators(
        *{**DISK, "beta": np.pi - DISK["beta"], "omega1": -DISK["omega1"]}.values(),
        **STATES,
        ddphi=2.0,
        domega1=-3.0,
    )
    for name in ("R01", "R011", "R022", "R012"):
        np.testing.assert_allclose(
            other.rotator[:, NUMBER[name]],
            one.rotator[:, NUMBER[name]] * [-1, 1, 1],
            atol=1e-10,
            err_msg=name,
        )


# --- arrays ------------------------------------------------------------------------------------


def test_arguments_broadcast():
    beta, omega1 = np.array([0.2, 0.9, -1.0])[:, None, None], np.array([1.0, 2.0])[:, None]
    got = rotators(beta, 0.03, 0.05, 0.2, omega1, 9.81, np.linspace(0, 3, 5), 2.0)
    assert got.rotator.shape == (3, 2, 5, 8, 3)
    assert got.rotator_intensity.shape == (3, 2, 5, 8)
    assert got.gamma2.shape == got.gamma2_rate.shape == got.hodograph_u.shape == (3, 2, 5)
    one = rotators(0.9, 0.03, 0.05, 0.2, 2.0, 9.81, np.linspace(0, 3, 5)[3], 2.0)
    for whole, single in zip(got, one, strict=True):
        np.testing.assert_array_equal(whole[1, 1, 3], single)
        assert np.isnan(whole[2]).all()  # not a body


def test_what_is_not_finite_is_nan():
    bad = np.array([np.nan, np.inf, -np.inf, 1.0])
    for name in ("phi", "dphi"):
        state = {"phi": 0.3, "dphi": 2.0} | {name: bad}
        with np.errstate(all="ignore"):
            got = rotators(*DISK.values(), **state)
        assert np.isnan(got.rotator[:3, NUMBER["R022"]]).all() or name == "dphi"
        assert np.isfinite(got.rotator[3]).all()
        assert np.isnan(got.gamma2_rate[:3]).all()
    empty = rotators(*DISK.values(), np.empty(0), 1.0)
    assert empty.rotator.shape == (0, 8, 3)


def test_compiled_and_interpreted_agree_to_the_last_bit(monkeypatch):
    n = 120
    disk, rng = random_disks(n, 9), np.random.default_rng(3)
    phi, dphi, d1 = rng.uniform(-4, 4, n), rng.normal(size=n), rng.normal(size=n)
    for array in (*disk.values(), phi, dphi, d1):
        array[rng.integers(0, n, 4)] = rng.choice([0.0, 1e300, 5e-324, np.nan, np.inf], 4)
    found = []
    for most in (10**9, 0):
        monkeypatch.setattr(launch, "INTERPRETED_AT_MOST", most)
        monkeypatch.setattr(launch, "_interpreted", {})
        with np.errstate(all="ignore"):
            free = rotators(*disk.values(), phi, dphi, domega1=d1)
            driven = rotators(*disk.values(), phi, dphi, 3.0, d1)
        found.append((*free, *driven))
    for one, other in zip(*found, strict=True):
        np.testing.assert_array_equal(one, other)


def test_threads_and_single_cells_make_the_same(monkeypatch):
    monkeypatch.setattr(launch, "THREADS_FROM", 10)
    monkeypatch.setattr(launch, "INTERPRETED_AT_MOST", 0)
    one = rotators(*DISK.values(), **STATES, threads=1)
    for threads in (2, 5):
        for x, y in zip(one, rotators(*DISK.values(), **STATES, threads=threads), strict=True):
            np.testing.assert_array_equal(x, y)
