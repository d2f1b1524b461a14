"""Two degrees of freedom: derived from point masses, reduced, and known in closed form.

The derivation starts from four point masses m/4 at r/sqrt(2) from the disk's center on two
perpendicular diameters, from the two rotations, and from a support with an inertia of its own.
"""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
import sympy as sp
from mpmath import mp, mpf

from phasekit.errors import EquilibriumKind
from phasekit.mechanics import two_degrees as machines
from phasekit.mechanics.disk import disk_inertia
from phasekit.mechanics.two_degrees import (
    amended_potential,
    effective_inertia,
    mass_matrix,
    relative_equilibria,
    support_inertia,
    two_degrees,
)

CASES = json.loads((Path(__file__).parents[1] / "data" / "mujoco.json").read_text())["free_cases"]
NAMES = ("beta", "e", "a", "r", "m", "carrier_inertia", "g")
CENTER, SADDLE, DEGENERATE = (
    EquilibriumKind.CENTER,
    EquilibriumKind.SADDLE,
    EquilibriumKind.DEGENERATE,
)


class Derived:
    """Lagrange's equations of the point masses, in symbols."""

    def __init__(self) -> None:
        parameters = sp.symbols("beta e a r m Jc g", real=True)
        beta, e, a, r, m, Jc, g = parameters
        phi1, phi, omega1, dphi = velocities = sp.symbols("phi1 phi omega1 dphi", real=True)
        turn1, turn2 = sp.rot_ccw_axis3(phi1), sp.rot_ccw_axis1(phi)
        first = sp.Matrix([sp.cos(beta), 0, -sp.sin(beta)])
        second = sp.Matrix([0, 1, 0])
        kinetic, potential = Jc * omega1**2 / 2, sp.Integer(0)
        for diameter in (first, second):
            for reach in (r / sp.sqrt(2), -r / sp.sqrt(2)):
                place = turn1 * (sp.Matrix([0, a, 0]) + turn2 * (e * first + reach * diameter))
                velocity = place.diff(phi1) * omega1 + place.diff(phi) * dphi
                kinetic += m / 8 * velocity.dot(velocity)
                potential += m / 4 * g * place[2]
        q, v = (phi1, phi), (omega1, dphi)
        momenta = [kinetic.diff(x) for x in v]
        self.mass = sp.Matrix(2, 2, lambda i, j: momenta[i].diff(v[j]))
        self.bias = sp.Matrix(
            [
                sum(p.diff(x) * y for x, y in zip(q, v, strict=True))
                - (kinetic - potential).diff(x)
                for p, x in zip(momenta, q, strict=True)
            ]
        )
        self.angles, self.parameters = (beta, phi1, phi), parameters
        given = (*parameters, *velocities)
        results = [self.mass, self.bias, kinetic + potential, momenta[0]]
        self.numbers = sp.lambdify(given, results, "mpmath", cse=True)

    def is_zero(self, expression: sp.Expr) -> bool:
        """Whether a polynomial in sines and cosines of the angles vanishes identically."""
        for angle in self.angles:
            sin, cos = sp.Symbol("s"), sp.Symbol("c")
            expression = sp.expand(expression).subs({sp.sin(angle): sin, sp.cos(angle): cos})
            expression = sp.rem(sp.expand(expression), sin**2 + cos**2 - 1, sin)
            expression = expression.subs({sin: sp.sin(angle), cos: sp.cos(angle)})
        return sp.expand(expression) == 0


@pytest.fixture(scope="module")
def derived() -> Derived:
    return Derived()


def random_machines(n: int, seed: int = 3) -> list[tuple[float, ...]]:
    """Draw machines, the axes intersecting and the support without inertia in some of them."""
    rng = np.random.default_rng(seed)
    rows = np.column_stack(
        [
            rng.uniform(0, np.pi, n),
            10 ** rng.uniform(-2, 0, n),
            rng.choice([0, 1, -1], n) * 10 ** rng.uniform(-2, 0, n),
            10 ** rng.uniform(-2, 0, n),
            rng.uniform(0.5, 5, n),
            rng.choice([0, 1, 1], n) * 10 ** rng.uniform(-3, 1, n),
            rng.choice([9.80665, 1.6, -9.80665, 0.0], n),
        ]
    )
    return [tuple(map(float, row)) for row in rows]


@pytest.mark.slow
def test_mass_matrix_is_that_of_the_point_masses(derived):
    """Both the form of the notes and the sum of squares that is computed."""
    beta, e, a, r, m, Jc, _ = derived.parameters
    phi = derived.angles[2]
    s, c, sb, cb = sp.sin(phi), sp.cos(phi), sp.sin(beta), sp.cos(beta)
    J, ju = m * r**2 / 4, m * r**2 / 4 + m * e**2
    jv, jn, jvn = J + ju * cb**2, J + ju * sb**2, ju * sb * cb
    papers = Jc + m * a**2 + 2 * m * a * e * sb * s + ju * s**2 + jv * c**2
    squares = Jc + m * (a + e * sb * s) ** 2 + m * e**2 * cb**2 + J * (1 + cb**2 * c**2)
    assert derived.is_zero(derived.mass[0, 0] - papers)
    assert derived.is_zero(derived.mass[0, 0] - squares)
    assert derived.is_zero(derived.mass[0, 1] - jvn * c)
    assert derived.is_zero(derived.mass[1, 1] - jn)


@pytest.mark.slow
def test_everything_agrees_with_the_point_masses_in_numbers(derived):
    rng = np.random.default_rng(4)
    for row in random_machines(60):
        machine = two_degrees(*row)
        phi1, phi, omega1, dphi = (float(x) for x in rng.normal(size=4) * [2, 2, 8, 8])
        torques = rng.normal(size=2) * 5
        with mp.workdps(40):
            numbers = [mpf(x) for x in (*row, phi1, phi, omega1, dphi)]
            mass, bias, energy, momentum = derived.numbers(*numbers)
            right = [mpf(float(q)) - x for q, x in zip(torques, bias, strict=True)]
            want = mp.lu_solve(mass, mp.matrix(right))
            want, mass, bias = (np.array(x.tolist(), float) for x in (want, mass, bias))
        got = machines.accelerations(machine, phi, dphi, omega1, *torques)
        scale = np.abs(np.linalg.inv(mass)) @ (np.abs(bias[:, 0]) + np.abs(torques))
        scale += np.abs(want).max() * np.linalg.cond(mass)
        assert np.all(np.abs(np.array(got) - want[:, 0]) <= 1e-14 * scale), row
        assert np.abs(mass_matrix(machine, phi) - mass).max() <= 2e-15 * np.abs(mass).max(), row
        state = (phi, dphi, omega1)
        speeds = np.array([omega1, dphi])
        twice = np.abs(speeds) @ np.abs(mass) @ np.abs(speeds)
        close = abs(machines.energy(machine, *state) - float(energy))
        assert close <= 2e-15 * (twice + abs(machine.weight))
        close = abs(machines.angular_momentum(machine, *state) - float(momentum))
        assert close <= 2e-15 * (np.abs(mass) @ np.abs(speeds))[0]


@pytest.mark.parametrize("case", CASES, ids=lambda case: f"Jc={case['inputs']['Jc']:.3g}")
def test_recorded_accelerations(case):
    given, want = case["inputs"], case["outputs"]
    machine = two_degrees(*(given["Jc" if n == "carrier_inertia" else n] for n in NAMES))
    mass = mass_matrix(machine, given["phi"])
    assert np.allclose(mass, want["mass_matrix"], rtol=0, atol=1e-14 * mass.max())
    state = (given["phi"], given["phidot"], given["omega1"])
    got = machines.accelerations(machine, *state)
    wanted = want["omega1dot"], want["phiddot"]
    # scaled by the terms of the equations, of which accelerations are small differences
    terms = np.abs(mass) @ np.abs(wanted) + np.abs(want["bias"])
    assert np.all(np.abs(mass @ (np.array(got) - wanted)) <= 1e-11 * terms)
    assert np.all(np.abs(mass @ got + want["bias"]) <= 1e-11 * terms)


def test_moments_of_inertia_are_those_of_the_disk():
    for row in random_machines(10):
        beta, e, a, r, m, Jc, _ = row
        ju, jv, jn, jvn = disk_inertia(m, r, e, beta)
        machine = two_degrees(*row)
        assert np.isclose(support_inertia(machine, 0.0)[0], Jc + m * a**2 + jv, rtol=1e-14)
        out = Jc + m * a**2 + 2 * m * a * e * np.sin(beta) + ju
        assert np.isclose(support_inertia(machine, np.pi / 2)[0], out, rtol=1e-13)
        assert np.allclose(mass_matrix(machine, 0.0)[1], [jvn, jn], rtol=1e-14)


def test_derivatives_by_complex_steps():
    step, phi = 1e-30, np.linspace(-4, 4, 41)
    for row in random_machines(20):
        machine = two_degrees(*row)
        for function in (
            lambda x, machine=machine: support_inertia(machine, x),
            lambda x, machine=machine: amended_potential(machine, 0.7, x),
        ):
            values = function(phi)
            slopes = [x.imag / step for x in function(phi + 1j * step)]
            for slope, derivative in ((slopes[0], values[1]), (slopes[1], values[2])):
                assert np.allclose(slope, derivative, rtol=1e-12, atol=1e-13 * np.ptp(derivative))


def test_momentum_gives_the_velocity_of_the_support_back_and_splits_the_energy():
    rng = np.random.default_rng(6)
    phi, dphi, omega1 = rng.normal(size=(3, 50)) * [[2], [5], [5]]
    for row in random_machines(10):
        machine = two_degrees(*row)
        p = machines.angular_momentum(machine, phi, dphi, omega1)
        scale = 1 + np.abs(dphi) * abs(machine.Jvn) / support_inertia(machine, phi)[0]
        back = machines.support_velocity(machine, p, phi, dphi)
        assert np.all(np.abs(back - omega1) <= 1e-14 * (np.abs(omega1) + scale))
        split = 0.5 * effective_inertia(machine, phi) * dphi**2
        split = split + amended_potential(machine, p, phi)[0]
        energy = machines.energy(machine, phi, dphi, omega1)
        terms = 0.5 * machine.Jn * dphi**2 + 0.5 * p**2 / support_inertia(machine, phi)[0]
        assert np.all(np.abs(split - energy) <= 1e-13 * (terms + abs(machine.weight) + 1))


# Equilibria. (beta, e, a, r, m, Jc), and p: six of them
SIX = [
    ((1.595, 0.583, -0.317, 0.01, 2.0, 0.0), 0.02387676625534868),
    ((2.968, 0.13, 0.0, 0.68, 2.0, 0.0), 0.6704466117689001),
    ((2.891, 0.01, 0.027, 0.39, 2.0, 0.0), 0.11164856607075646),
]
# and fast ones, whose polynomials have small coefficients of high order
FAST = [
    ((1.464089519562017, 0.0506, 0.0, 0.467, 1.412e-3, 1303.2721806, -1.6), 9607670.685602633),
    ((1e-06, 0.2728621738528037, -1.0903e-4, 0.01289, 9.647, 0.0), -11110.081640976976),
    ((np.pi / 2 + 1e-7, 0.137491, 0.0, 1697.758, 492.0859, 32851181.67), 1758848549310.763),
]


def momenta(n: int) -> np.ndarray:
    return 10 ** np.random.default_rng(9).uniform(-3, 2, n)


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(2))
def test_no_equilibrium_is_missed_and_none_is_invented(seed):
    """Against sign changes of the gradient on a fine grid, which knows nothing of polynomials."""
    grid = np.linspace(-np.pi, np.pi, 20001)[:-1] + 1e-7
    cases = list(zip(random_machines(150, seed), momenta(150), strict=True)) + SIX + FAST
    seen = set()
    for row, p in cases:
        machine = two_degrees(*row)
        found = relative_equilibria(machine, float(p))
        gradient = amended_potential(machine, p, grid)[1]
        rises = (gradient < 0) & (np.roll(gradient, -1) > 0)
        falls = (gradient > 0) & (np.roll(gradient, -1) < 0)
        assert (found.kind == CENTER).sum() == rises.sum(), (row, p)
        assert (found.kind == SADDLE).sum() == falls.sum(), (row, p)
        assert found.phi.size == rises.sum() + falls.sum(), (row, p)
        left = grid[np.flatnonzero(rises | falls)]
        apart = np.mod(np.subtract.outer(found.phi, left) + 1e-12, 2 * np.pi)
        near = apart <= grid[1] - grid[0] + 2e-12
        assert np.all(near.sum(axis=0) == 1), (row, p)
        assert np.all(near.sum(axis=1) == 1), (row, p)
        residual = np.abs(amended_potential(machine, p, found.phi)[1])
        assert np.all(residual <= 1e-13 * (abs(machine.weight) + np.abs(gradient).max()))
        seen.add(found.phi.size)
    assert {2, 4, 6} <= seen


def test_values_at_equilibria():
    for row, p in SIX:
        machine = two_degrees(*row)
        found = relative_equilibria(machine, p)
        potential, _, curvature = amended_potential(machine, p, found.phi)
        assert np.array_equal(found.energy, potential)
        assert np.array_equal(found.kind == CENTER, curvature > 0)
        assert np.array_equal(found.omega1, p / support_inertia(machine, found.phi)[0])
        # at rest relative to the support, which turns evenly: no acceleration
        rest = machines.accelerations(machine, found.phi, 0.0, found.omega1)
        scale = machine.weight / machine.Jn + found.omega1**2
        assert np.all(np.abs(rest) <= 1e-11 * scale)
        at = np.isfinite(found.frequency)
        assert np.array_equal(at, found.kind == CENTER)
        small = found.frequency[at] ** 2 * effective_inertia(machine, found.phi[at])
        assert np.allclose(small, curvature[at], rtol=1e-14)


@pytest.mark.parametrize("angle", [0.1, 0.7, 1.3])
def test_conical_pendulum(angle):
    """A particle on a rod, the support without inertia: cos phi = g/(e omega1^2).

    It has steady rotations on both sides, each with the frequency
    omega1 sqrt(1 + 3 cos^2 phi) of its nutation; the places over and under the point of
    suspension, where M11 = 0, are none.
    """
    e, g, m = 0.4, 9.81, 1.5
    machine = two_degrees(np.pi / 2, e, 0.0, 0.0, m, 0.0, g)
    omega1 = np.sqrt(g / (e * np.cos(angle)))
    found = relative_equilibria(machine, m * (e * np.sin(angle)) ** 2 * omega1)
    assert np.allclose(found.phi, [-angle, angle], rtol=1e-13)
    assert np.array_equal(found.kind, [CENTER, CENTER])
    assert np.allclose(found.omega1, omega1, rtol=1e-13)
    assert np.allclose(found.frequency, omega1 * np.sqrt(1 + 3 * np.cos(angle) ** 2), rtol=1e-12)


def test_pitchfork_of_the_pendulum_on_a_support():
    """V_p''(0) = m g e - p^2 m e^2/Jc^2: the hanging pendulum is degenerate at p = Jc sqrt(g/e)."""
    e, g, m, Jc = 0.25, 4.0, 2.0, 0.5
    machine = two_degrees(np.pi / 2, e, 0.0, 0.0, m, Jc, g)
    critical = Jc * 4.0
    kinds = {}
    for p in (critical * (1 - 1e-6), critical, critical * (1 + 1e-6)):
        found = relative_equilibria(machine, p)
        assert found.phi[-1] == pytest.approx(np.pi, abs=1e-15)
        kinds[p] = found.kind.tolist()
        if found.phi.size == 4:
            # V_p' = 0 without its factor sin phi
            s = np.sin(found.phi[2])
            left = machine.weight * (Jc + m * e**2 * s**2) ** 2
            assert left == pytest.approx(p**2 * m * e**2 * np.cos(found.phi[2]), rel=1e-14)
    assert list(kinds.values()) == [
        [CENTER, SADDLE],
        [DEGENERATE, SADDLE],
        [CENTER, SADDLE, CENTER, SADDLE],
    ]
    merged = relative_equilibria(machine, critical)
    assert merged.phi[0] == pytest.approx(0.0, abs=1e-7)
    assert merged.curvature[0] == 0.0
    assert np.isnan(merged.frequency).all()


def test_fold():
    """Two become four as p grows; next to the fold in p a center and a saddle are close."""
    machine = two_degrees(0.3, 0.02, 0.002, 0.1, 2.0, 0.01)
    low, high = 0.1, 0.3
    for _ in range(60):
        middle = 0.5 * (low + high)
        few = relative_equilibria(machine, middle).phi.size == 2
        low, high = (middle, high) if few else (low, middle)
    for relative, gap in ((1e-12, 1e-4), (1e-8, 1e-2)):
        found = relative_equilibria(machine, high * (1 + relative))
        assert found.phi.size == 4
        assert np.diff(found.phi).min() < gap
        assert np.all(found.kind != np.roll(found.kind, 1))
    at = relative_equilibria(machine, high)
    assert at.phi.size == 3
    assert (at.kind == DEGENERATE).sum() == 1
    curvature = amended_potential(machine, high, at.phi)[2]
    assert np.abs(curvature).min() < 1e-6 * np.abs(curvature).max()


def test_pendulum_without_momentum_and_machines_without_force():
    found = relative_equilibria(two_degrees(0.7, 0.1, 0.3, 0.2, 1.0, 0.1), 0.0)
    assert np.allclose(found.phi, [0, np.pi], rtol=1e-15, atol=1e-15)
    assert np.array_equal(found.kind, [CENTER, SADDLE])
    for machine, p in (
        (two_degrees(0.7, 0.1, 0.3, 0.2, 1.0, 0.1, 0.0), 0.0),  # neither weight nor turning
        (two_degrees(0.7, 0.0, 0.3, 0.2, 1.0, 0.1), 0.0),  # balanced and at rest
        (two_degrees(np.pi / 2, 0.0, 0.3, 0.2, 1.0, 0.1), 2.0),  # a wheel: M11 is constant
    ):
        assert relative_equilibria(machine, p).phi.size == 0


@pytest.mark.parametrize("p", [1e-150, 1e-12, 1e-6, 1e6, 1e60, 1e150])
def test_extreme_momenta(p):
    """Slow: those of the pendulum. Fast: the extrema of M11, its maxima the centers."""
    row = (0.9, 0.05, 0.4, 0.1, 2.0, 0.05)
    found = relative_equilibria(two_degrees(*row), p)
    if p < 1:
        assert np.allclose(np.sin(found.phi), 0, atol=10 * p * p + 1e-15)
    else:
        ju, jv, _, _ = disk_inertia(row[4], row[3], row[1], row[0])
        arm = row[4] * row[2] * row[1] * np.sin(row[0])
        assert abs(arm) > abs(ju - jv)  # so only phi = +-pi/2
        assert np.allclose(found.phi, [-np.pi / 2, np.pi / 2], atol=1e-5)
    side = np.cos(found.phi) if p < 1 else np.sin(found.phi)
    assert np.array_equal(found.kind, np.where(side > 0, CENTER, SADDLE))
    assert sorted(found.kind) == [CENTER, SADDLE]


def test_arrays_broadcast():
    machine = two_degrees(np.array([0.3, 0.9, 1.4]), 0.1, 0.05, 0.1, 2.0, 0.01)
    phi = np.linspace(0, 6, 5)[:, None]
    for got in machines.accelerations(machine, phi, 1.0, 2.0):
        assert got.shape == (5, 3)
    one = two_degrees(0.9, 0.1, 0.05, 0.1, 2.0, 0.01)
    want = machines.accelerations(one, 3.0, 1.0, 2.0)
    got = machines.accelerations(machine, 3.0, 1.0, 2.0)
    assert [x[1] for x in got] == [float(x) for x in want]
    assert mass_matrix(machine, phi).shape == (5, 3, 2, 2)
