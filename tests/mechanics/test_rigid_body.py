"""Mass moment vectors against sums over particles, recorded values and theorems on inertia."""

from __future__ import annotations

import copy
import dataclasses
import json
import pickle
from pathlib import Path

import numpy as np
import pytest
from mpmath import mpf
from witnesses import particles

from phasekit.errors import ParameterError
from phasekit.mechanics.general.body import RigidBody
from phasekit.mechanics.vectors import rotation, unit

DATA = json.loads((Path(__file__).parents[1] / "data" / "vectors.json").read_text())
RECORDED = [case for case in DATA["cases"] if case["kind"] == "moments"]
AXES = np.eye(3)


def close(got, want, tolerance=1e-13) -> None:
    want = np.array(want, dtype=float)
    assert np.shape(got) == want.shape
    assert np.abs(got - want).max() <= tolerance * np.abs(want).max(), (got, want)


def cloud(rng: np.random.Generator, n: int = 5, shape: tuple[int, ...] = ()):
    return rng.uniform(0.2, 2.0, (*shape, n)), rng.normal(size=(*shape, n, 3))


@pytest.fixture
def rng():
    return np.random.default_rng(3)


@pytest.mark.parametrize("case", RECORDED, ids=lambda case: case["id"])
def test_recorded_values(case):
    inputs, out = case["input"], case["output"]
    body, n = RigidBody.from_points(inputs["masses"], inputs["rho"]), inputs["n"]
    other = body.shifted(inputs["rhoO_vector_O_to_O1"])
    center = body.centroidal()
    found = {
        "M": body.mass,
        "rhoC": body.center,
        "I_O": body.inertia,
        "S_n": body.linear_moment(n),
        "J_n": body.inertia_moment(n),
        "D_n": body.deviation_moment(n),
        "J_axial": body.axial_moment(n),
        "J_polar": body.polar_moment(),
        "spherical": body.spherical_moment(n),
        "deviatoric": body.deviatoric_moment(n),
        "S_n_O1": other.linear_moment(n),
        "J_n_O1": other.inertia_moment(n),
        "D_n_O1": other.deviation_moment(n),
        "J_n_C": center.inertia_moment(n),
        "D_n_C": center.deviation_moment(n),
    }
    assert set(found) == set(out)
    for name, want in out.items():
        close(found[name], want)


@pytest.mark.slow
def test_moments_and_rates_are_those_of_particles(rng):
    """Axes at rest, carried by another rotation, and fixed in the body."""
    for _ in range(6):
        masses, points = cloud(rng)
        machine = particles.Machine(masses, points, *rng.normal(size=(2, 3)), rng.normal())
        motion = machine.motion(rng.normal(size=4), rng.normal(size=4))
        w1, w2 = (float(x.d().now) for x in (motion.phi1, motion.phi2))
        n1, n2 = (np.array(particles.now(n), dtype=float) for n in (motion.n1, motion.n2))
        omega = w1 * n1 + w2 * n2
        body = RigidBody.from_points(
            masses, np.array([particles.now(x) for x in motion.rho], dtype=float)
        )
        own = particles.times(1 / particles.norm(particles.now(motion.rho[0])), motion.rho[0])
        for n, turn in ((motion.n1, 0 * n1), (motion.n2, w1 * n1), (own, omega)):
            axis = np.array(particles.now(n), dtype=float)
            close(body.linear_moment(axis), particles.now(motion.S(n)))
            close(body.inertia_moment(axis), particles.now(motion.J(n)))
            close(body.deviation_moment(axis), particles.now(motion.D(n)))
            close(
                body.linear_moment_rate(axis, omega, turn), particles.now(particles.d(motion.S(n)))
            )
            close(
                body.inertia_moment_rate(axis, omega, turn), particles.now(particles.d(motion.J(n)))
            )
            close(
                body.deviation_moment_rate(axis, omega, turn),
                particles.now(particles.d(motion.D(n))),
            )


def test_axial_moment_is_the_sum_of_squared_distances(rng):
    masses, points = cloud(rng)
    n = rng.normal(size=3)
    along = points @ n / np.linalg.norm(n)
    want = masses @ ((points**2).sum(axis=1) - along**2)
    close(RigidBody.from_points(masses, points).axial_moment(n), want)


def test_polar_spherical_and_deviatoric_parts(rng):
    masses, points = cloud(rng)
    body, n = RigidBody.from_points(masses, points), rng.normal(size=3)
    close(body.polar_moment(), masses @ (points**2).sum(axis=1))
    close(sum(body.axial_moment(x) for x in AXES), 2 * body.polar_moment())
    close(body.spherical_moment(n) + body.deviatoric_moment(n), body.inertia_moment(n))
    traces = [float(x @ body.deviatoric_moment(x)) for x in AXES]
    assert abs(sum(traces)) <= 1e-15 * body.polar_moment()
    close(
        body.deviation_moment(n),
        body.deviatoric_moment(n) - unit(n) * (unit(n) @ body.deviatoric_moment(n)),
    )


def test_shifting_the_pole(rng):
    masses, points = cloud(rng)
    body, step, n = RigidBody.from_points(masses, points), rng.normal(size=3), rng.normal(size=3)
    moved, want = body.shifted(step), RigidBody.from_points(masses, points - step)
    close(moved.center, want.center)
    close(moved.inertia, want.inertia)
    close(moved.shifted(-step).inertia, body.inertia)
    # Huygens and Steiner
    center = body.centroidal()
    assert np.abs(center.center).max() == 0.0
    distance = np.linalg.norm(np.cross(unit(n), body.center))
    close(body.axial_moment(n), center.axial_moment(n) + body.mass * distance**2)
    close(center.inertia, RigidBody.from_points(masses, points - body.center).inertia)


def test_a_distant_pole_costs_no_digits_on_the_way_there(rng):
    masses, points = cloud(rng)
    step = np.array([1e6, -2e6, 3e6])
    far = RigidBody.from_points(masses, points).shifted(step)
    close(far.inertia, RigidBody.from_points(masses, points - step).inertia)


@pytest.mark.parametrize("mirror", [False, True])
def test_rotation_and_mirror_image(rng, mirror):
    masses, points = cloud(rng)
    turn = rotation(unit(rng.normal(size=3)), 1.1) @ np.diag([-1.0 if mirror else 1.0, 1.0, 1.0])
    got = RigidBody.from_points(masses, points).rotated(turn)
    want = RigidBody.from_points(masses, points @ turn.T)
    close(got.center, want.center)
    close(got.inertia, want.inertia)


@pytest.mark.parametrize("beta", [0.0, 1e-9, 0.3, 1.2, np.pi / 2, 2.5, np.pi])
@pytest.mark.parametrize(("e", "r"), [(0.1, 0.2), (0.0, 0.2), (0.1, 0.0), (3.0, 1e-5)])
def test_disk_is_its_four_particles(beta, e, r):
    body = RigidBody.disk(2.5, r, e, beta)
    masses, points = particles.disk_particles(2.5, r, e, beta)
    center = particles.plus(*(particles.times(mpf(1) / 4, x) for x in points))
    inertia = [
        particles.plus(
            *(
                particles.times(m, particles.cross(x, particles.cross(particles.exact(n), x)))
                for m, x in zip(masses, points, strict=True)
            )
        )
        for n in AXES
    ]
    # The double next to pi stands for pi itself.
    assert np.abs(body.center - np.array(center, dtype=float)).max() <= 2e-16 * e
    assert np.abs(body.inertia - np.array(inertia, dtype=float)).max() <= 5e-16 * 2.5 * (
        e**2 + r**2
    )
    if beta == np.pi:
        assert body.center.tolist() == [-e, 0, 0]


def test_direction_is_of_any_length(rng):
    masses, points = cloud(rng)
    body, n = RigidBody.from_points(masses, points), rng.normal(size=3)
    for size in (1e-300, 7.0, 1e300):
        close(body.inertia_moment(size * n), body.inertia_moment(n), 1e-15)
        close(body.linear_moment(size * n), body.linear_moment(n), 1e-15)


def test_batches_equal_loops(rng):
    masses, points = cloud(rng, shape=(2, 1))
    n, omega, axis = rng.normal(size=(3, 3, 3))
    body = RigidBody.from_points(masses, points)
    assert body.shape == (2, 1)
    calls = {
        "linear_moment": (n,),
        "inertia_moment": (n,),
        "deviation_moment": (n,),
        "axial_moment": (n,),
        "spherical_moment": (n,),
        "deviatoric_moment": (n,),
        "linear_moment_rate": (n, omega, axis),
        "inertia_moment_rate": (n, omega, axis),
        "deviation_moment_rate": (n, omega, axis),
    }
    moved = body.shifted(omega)
    assert moved.shape == (2, 3)
    assert body.polar_moment().shape == (2, 1)
    turns = rotation(unit(n), 0.7)
    for i in range(2):
        one = RigidBody.from_points(masses[i, 0], points[i, 0])
        close(one.inertia, body.inertia[i, 0], 1e-15)
        assert one == RigidBody(body.mass[i, 0], body.center[i, 0], body.inertia[i, 0])
        for k in range(3):
            for name, arguments in calls.items():
                got = getattr(body, name)(*arguments)[i, k]
                want = getattr(one, name)(*(x[k] for x in arguments))
                close(got, want, 1e-15)
            close(moved.inertia[i, k], one.shifted(omega[k]).inertia, 1e-15)
            close(body.rotated(turns).inertia[i, k], one.rotated(turns[k]).inertia, 1e-15)
    disks = RigidBody.disk(2.0, np.array([0.1, 0.2]), np.array([[0.1], [0.0], [0.3]]), 0.4)
    assert disks.shape == (3, 2)
    close(disks.inertia[2, 1], RigidBody.disk(2.0, 0.2, 0.3, 0.4).inertia, 1e-15)


def test_fields_broadcast():
    body = RigidBody([1.0, 2.0], [0.0, 0.0, 0.1], np.eye(3))
    assert body.shape == (2,)
    assert body.center.shape == (2, 3)
    assert body.inertia.shape == (2, 3, 3)


def test_value_semantics(rng):
    masses, points = cloud(rng)
    body, same = (RigidBody.from_points(masses, points) for _ in range(2))
    assert body == same
    assert hash(body) == hash(same)
    assert body != body.shifted([0.0, 0.0, 1e-3])
    assert body != "body"
    zeros = RigidBody(1.0, [0.0, 0.0, 0.0], np.eye(3)), RigidBody(1.0, [-0.0, 0.0, 0.0], np.eye(3))
    assert zeros[0] == zeros[1]
    assert hash(zeros[0]) == hash(zeros[1])
    batch = RigidBody([1.0, np.nan], [0.0, 0.0, 0.1], np.eye(3))
    assert batch == RigidBody([1.0, -7.0], [0.0, 0.0, 0.1], np.eye(3))
    assert hash(batch) == hash(RigidBody([1.0, -7.0], [0.0, 0.0, 0.1], np.eye(3)))
    for other in (pickle.loads(pickle.dumps(batch)), copy.deepcopy(batch)):
        assert other == batch
        with pytest.raises(ValueError, match="read-only"):
            other.center[0] = 0
    with pytest.raises(dataclasses.FrozenInstanceError):
        body.mass = 2.0
    for array in (body.center, body.inertia, batch.mass):
        with pytest.raises(ValueError, match="read-only"):
            array[0] = 0
    given = np.eye(3)
    kept = RigidBody(1.0, [0, 0, 0], given)
    given[0, 0] = 5
    assert kept.inertia[0, 0] == 1


def test_repr(rng):
    assert repr(RigidBody([1.0, 3.0], [0, 0, 0.1], np.eye(3))) == (
        "RigidBody(<batch of shape (2,), mass 1 to 3>)"
    )
    assert repr(RigidBody([-1.0, np.nan], [0, 0, 0.1], np.eye(3))) == (
        "RigidBody(<batch of shape (2,), none valid>)"
    )


POINT = (1.0, (0.0, 0.0, 0.0), np.eye(3))
LOPSIDED = [[1, 0.1, 0], [0, 1, 0], [0, 0, 1]]
BAD = [
    ("mass", 0, 0.0),
    ("mass", 0, -1.0),
    ("mass", 0, np.nan),
    ("mass", 0, "heavy"),
    ("mass", 0, None),
    ("mass", 0, True),
    ("mass", 0, 1j),
    ("center", 1, 0.1),
    ("center", 1, (0.1, 0.2)),
    ("center", 1, (0.1, 0.2, np.inf)),
    ("center", 1, ((0.1, 0.2), (0.1,))),
    ("inertia", 1, (5.0, 0.0, 0.0)),  # farther from the pole than the inertia allows
    ("inertia", 2, np.ones(3)),
    ("inertia", 2, LOPSIDED),
    ("inertia", 2, np.diag([1.0, 2.0, 3.01])),
    ("inertia", 2, np.diag([1.0, 1.0, -1.0])),
    ("inertia", 2, np.diag([1.0, np.nan, 1.0])),
]


@pytest.mark.parametrize(("name", "place", "value"), BAD, ids=str)
def test_what_is_not_a_body_is_refused(name, place, value):
    fields = [*POINT]
    fields[place] = value
    with pytest.raises(ParameterError, match=rf"^{name}: got .*, wants "):
        RigidBody(*fields)


def test_bodies_at_the_limit_of_the_possible():
    """Flat bodies, rods and particles, turned and far from the pole, up to rounding."""
    rng = np.random.default_rng(5)
    for principal in ([1, 2, 3], [0, 1, 1], [0, 0, 0]):
        for _ in range(20):
            turn = rotation(unit(rng.normal(size=3)), rng.normal())
            inertia = turn @ np.diag(principal).astype(float) @ turn.T
            body = RigidBody(2.0, np.zeros(3), inertia).shifted(rng.normal(size=3) * 100)
            again = RigidBody(body.mass, body.center, body.inertia)
            assert again.mass == 2.0


def test_invalid_bodies_of_a_batch_are_nan():
    bodies = RigidBody(
        [1.0, -1.0, 1.0, 1.0, 1.0],
        [[0, 0, 0], [0, 0, 0], [0, np.inf, 0], [0, 0, 0], [0, 0, 0]],
        [np.eye(3), np.eye(3), np.eye(3), LOPSIDED, np.diag([1.0, 1.0, 9.0])],
    )
    n = [0.0, 0.0, 2.0]
    found = (bodies.mass, bodies.axial_moment(n), bodies.inertia_moment(n)[:, 2])
    for got in found:
        assert np.array_equal(got, [1, np.nan, np.nan, np.nan, np.nan], equal_nan=True)
    axes = bodies.linear_moment([[0, 0, 1], [0, 0, 0], [np.nan, 0, 1], [1, 0, 0], [1, 0, 0]])
    assert np.isfinite(axes[:, 0]).tolist() == [True, False, False, False, False]
    clouds = RigidBody.from_points([[1, 1], [0, 0], [-1, 2]], [[1, 0, 0], [0, 1, 0]])
    assert np.array_equal(clouds.mass, [2, np.nan, np.nan], equal_nan=True)
    disks = RigidBody.disk(1.0, [0.1, -0.1, 0.1], 0.1, [0.3, 0.3, 4.0])
    assert np.isfinite(disks.mass).tolist() == [True, False, False]
    turned = disks.rotated([np.eye(3), np.eye(3), np.eye(3)]).rotated(
        [np.eye(3), np.ones((3, 3)), np.eye(3)]
    )
    assert np.isfinite(turned.mass).tolist() == [True, False, False]


CALLS = [
    ("n", lambda body: body.linear_moment([0, 0, 0])),
    ("n", lambda body: body.axial_moment([1, 2])),
    ("n", lambda body: body.inertia_moment([1, 2, np.nan])),
    ("angular_velocity", lambda body: body.linear_moment_rate([0, 0, 1], 3.0)),
    ("axis_velocity", lambda body: body.inertia_moment_rate([0, 0, 1], [0, 0, 1], "x")),
    ("vector", lambda body: body.shifted(0.1)),
    ("matrix", lambda body: body.rotated(np.ones((3, 3)))),
    ("matrix", lambda body: body.rotated(np.eye(2))),
    ("masses", lambda body: body.from_points([1.0], [[0, 0, 1], [0, 1, 0]])),
    ("masses", lambda body: body.from_points(1.0, [[0, 0, 1]])),
    ("masses", lambda body: body.from_points([1.0, -0.5], [[0, 0, 1], [0, 1, 0]])),
    ("masses", lambda body: body.from_points([0.0], [[0, 0, 1]])),
    ("positions", lambda body: body.from_points([1.0], [0, 0, 1])),
    ("positions", lambda body: body.from_points([1.0], [[0, 0, np.nan]])),
    ("positions", lambda body: body.from_points([], np.empty((0, 3)))),
    ("m", lambda body: body.disk(0.0, 0.1, 0.1, 0.3)),
    ("r", lambda body: body.disk(1.0, -0.1, 0.1, 0.3)),
    ("e", lambda body: body.disk(1.0, 0.1, -0.1, 0.3)),
    ("beta", lambda body: body.disk(1.0, 0.1, 0.1, 30)),
    ("beta", lambda body: body.disk(1.0, 0.1, 0.1, np.nan)),
]


@pytest.mark.parametrize(("name", "call"), CALLS)
def test_unusable_arguments_are_named(name, call):
    with pytest.raises(ParameterError, match=rf"^{name}: got .*, wants "):
        call(RigidBody(*POINT))


def test_shapes_that_do_not_broadcast_are_named():
    with pytest.raises(ParameterError, match=r"mass \(2,\), center \(3,\): got batch shapes"):
        RigidBody([1.0, 2.0], np.zeros((3, 3)), np.eye(3))
    with pytest.raises(ParameterError, match=r"m \(2,\), e \(3,\)"):
        RigidBody.disk([1.0, 2.0], 0.1, [0.1, 0.2, 0.3], 0.4)
    pair = RigidBody([1.0, 2.0], np.zeros(3), np.eye(3))
    with pytest.raises(ParameterError, match=r"body \(2,\), vector \(3,\)"):
        pair.shifted(np.zeros((3, 3)))
    with pytest.raises(ParameterError, match=r"body \(2,\), n \(3,\)"):
        pair.linear_moment(np.eye(3))
    with pytest.raises(ParameterError, match=r"body \(2,\), angular_velocity \(3,\)"):
        pair.inertia_moment_rate([0, 0, 1], np.eye(3))
