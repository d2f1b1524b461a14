"""The machine made of particles, and what decides an erratum of the papers.

Positions, velocities and accelerations are those of two rotations, one carried by the other;
momenta are sums over particles; reactions solve the six equations of Newton and Euler. No mass
moment vector, no rotator and no formula of the papers takes part in these, and nothing of phasekit.
All in doubles; ``particles`` does the same by exact differentiation, and a test compares the two.

Frame: fixed, and equal to the carrier's at the instant of the state. For the disk the axes are
(u01, v01, n1) = (n2, [n1, n2], up).
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np

HOLDS = 1e-10  # relative
FAILS = 1e-3
UP = np.array([0.0, 0.0, 1.0])
NOTHING = np.zeros(3)
ALONG, ACROSS = np.eye(3)[:2]  # u01 = n2 and v01 = [n1, n2] of the disk


def unit(x: Any) -> np.ndarray:
    return x / np.linalg.norm(x)


def norm(x: Any) -> float:
    return float(np.linalg.norm(x))


def cross(x: Any, y: Any) -> np.ndarray:
    """Cross product along the last axis."""
    x, y = np.broadcast_arrays(x, y)
    return np.stack(
        [
            x[..., 1] * y[..., 2] - x[..., 2] * y[..., 1],
            x[..., 2] * y[..., 0] - x[..., 0] * y[..., 2],
            x[..., 0] * y[..., 1] - x[..., 1] * y[..., 0],
        ],
        axis=-1,
    )


@dataclass(frozen=True, eq=False)
class Machine:
    """Particles about O2, carried round n1 through O1 and turning about n2 through O2."""

    masses: np.ndarray
    points: np.ndarray  # (n, 3), from O2
    n1: np.ndarray
    n2: np.ndarray
    r0: np.ndarray  # from O1 to O2
    w1: float
    dw1: float
    w2: float
    dw2: float
    gravity: np.ndarray = field(default_factory=lambda: NOTHING)

    def replace(self, **changes: Any) -> Machine:
        return dataclasses.replace(self, **changes)

    # --- motion ----------------------------------------------------------------------------------

    @cached_property
    def velocities(self) -> np.ndarray:
        return self.w1 * cross(self.n1, self.r0 + self.points) + self.w2 * cross(
            self.n2, self.points
        )

    @cached_property
    def accelerations(self) -> np.ndarray:
        """Second derivative of Rot1(t) (r0 + Rot2(t) rho), by the rule of the product."""
        carried = self.r0 + self.points
        relative = cross(self.n2, self.points)
        return (
            self.dw1 * cross(self.n1, carried)
            + self.w1**2 * cross(self.n1, cross(self.n1, carried))
            + 2 * self.w1 * self.w2 * cross(self.n1, relative)
            + self.dw2 * relative
            + self.w2**2 * cross(self.n2, relative)
        )

    # --- sums ------------------------------------------------------------------------------------

    def total(self, values: np.ndarray) -> np.ndarray:
        return self.masses @ values

    @cached_property
    def M(self) -> float:
        return float(self.masses.sum())

    @cached_property
    def G(self) -> np.ndarray:
        return self.M * self.gravity

    @cached_property
    def C(self) -> np.ndarray:
        """Mass center, from O2."""
        return self.total(self.points) / self.M

    @cached_property
    def K(self) -> np.ndarray:
        return self.total(self.velocities)

    @cached_property
    def L(self) -> np.ndarray:
        """Angular momentum about O1."""
        return self.total(cross(self.r0 + self.points, self.velocities))

    @cached_property
    def dK(self) -> np.ndarray:
        return self.total(self.accelerations)

    @cached_property
    def dL(self) -> np.ndarray:
        return self.total(cross(self.r0 + self.points, self.accelerations))

    @cached_property
    def M2(self) -> np.ndarray:
        """Moment of the inertia about O2."""
        return self.total(cross(self.points, self.accelerations))

    def at_rest(self) -> Machine:
        return self.replace(w1=0.0, w2=0.0, dw1=0.0, dw2=0.0)

    def mixed(self, name: str) -> np.ndarray:
        """Return the part of a sum that is proportional to the product of the velocities."""
        both = self.replace(dw1=0.0, dw2=0.0)
        alone = (both.replace(w1=0.0), both.replace(w2=0.0))
        return getattr(both, name) - sum(getattr(one, name) for one in alone)

    @cached_property
    def power(self) -> float:
        """Rate of kinetic and potential energy together."""
        return float(
            self.total(np.sum(self.velocities * (self.accelerations - self.gravity), axis=-1))
        )

    # --- reactions -------------------------------------------------------------------------------

    def reactions(self, shaft: int, s_A: float, s_B: float) -> np.ndarray:
        """Return forces of a spherical bearing A and a cylindrical B on the rotor, and the torque.

        The bearings stand on axis 1 (through O1) or 2 (through O2) at s_A and s_B; the torque is
        about that axis. Shape (7,): A, B, torque.
        """
        n = self.n1 if shaft == 1 else self.n2
        pole = self.r0 if shaft == 1 else NOTHING
        rate = self.dL if shaft == 1 else self.M2
        e = unit(cross(n, [0.3, -0.5, 0.7]))
        across = np.array([e, cross(n, e)])
        system = np.zeros((6, 6))
        for i, (force, s) in enumerate([(x, s_A) for x in np.eye(3)] + [(x, s_B) for x in across]):
            system[:3, i] = force
            system[3:, i] = cross(s * n, force)
        system[3:, 5] = n
        right = np.concatenate([self.dK - self.G, rate - cross(pole + self.C, self.G)])
        found = np.linalg.solve(system, right)
        return np.concatenate([found[:3], found[3:5] @ across, found[5:]])

    def free(self) -> Machine:
        """Return the state with the acceleration about n2 at which no torque acts about n2."""
        at = [self.replace(dw2=x).reactions(2, 1.0, -1.0)[6] for x in (0.0, 1.0)]
        return self.replace(dw2=-at[0] / (at[1] - at[0]))

    # --- the papers' moments, by their definitions -----------------------------------------------

    def S(self, n: np.ndarray) -> np.ndarray:
        return self.total(cross(n, self.points))

    def J(self, n: np.ndarray) -> np.ndarray:
        """Vector of the moment of inertia; for any n the tensor applied to n."""
        return self.total(cross(self.points, cross(n, self.points)))

    def D(self, n: np.ndarray) -> np.ndarray:
        return self.J(n) - n * (n @ self.J(n))


@dataclass(frozen=True)
class Disk:
    """A state of the heavy disk: parameters, angle, velocities and accelerations."""

    m: float
    beta: float
    e: float
    a: float
    r: float
    l: float  # noqa: E741 (half the distance of the bearings, as in the papers)
    g: float
    w1: float
    dw1: float
    phi: float
    w2: float
    dw2: float

    def replace(self, **changes: float) -> Disk:
        return dataclasses.replace(self, **changes)

    @property
    def trig(self) -> tuple[float, float, float, float]:
        """Sine and cosine of phi, then of beta."""
        return np.sin(self.phi), np.cos(self.phi), np.sin(self.beta), np.cos(self.beta)

    @property
    def u02(self) -> np.ndarray:
        """Radial, towards the mass center."""
        return np.array([0.0, np.sin(self.phi), -np.cos(self.phi)])

    @property
    def v02(self) -> np.ndarray:
        return np.array([0.0, np.cos(self.phi), np.sin(self.phi)])

    @property
    def frame(self) -> np.ndarray:
        """Rows u2 (tangential), v2 (radial, inward), n2: the frame of the bearings."""
        return np.array([self.v02, -self.u02, ALONG])

    @cached_property
    def machine(self) -> Machine:
        """Four particles, which have the mass, the center and the inertia of the thin disk."""
        diameter = np.cos(self.beta) * ALONG + np.sin(self.beta) * self.u02
        reach = self.r / np.sqrt(2)
        points = [
            self.e * diameter + sign * reach * x for x in (diameter, self.v02) for sign in (1, -1)
        ]
        return Machine(
            masses=np.full(4, self.m / 4),
            points=np.array(points),
            n1=UP,
            n2=ALONG,
            r0=self.a * ACROSS,
            w1=self.w1,
            dw1=self.dw1,
            w2=self.w2,
            dw2=self.dw2,
            gravity=-self.g * UP,
        )

    def free(self) -> Disk:
        """Return the state with the acceleration of the free motion."""
        return self.replace(dw2=self.machine.free().dw2)

    def inertia(self, about: np.ndarray | None = None) -> tuple[float, float, float, float]:
        """Return Ju, Jv, Jn, Jvn in the frame of the bearings, at O2 or another pole."""
        machine = self.machine
        if about is not None:
            machine = machine.replace(points=machine.points - about)
        tensor = np.array([self.frame @ machine.J(n) for n in self.frame])
        return tensor[0, 0], tensor[1, 1], tensor[2, 2], tensor[1, 2]

    def coefficients(self) -> tuple[float, float, float]:
        """Return A, B, C from the accelerations of the free motion at three angles."""
        still = self.replace(dw1=0.0, w2=0.0)
        C, minus_B, half = (still.replace(phi=x).free().dw2 for x in (0, np.pi / 2, np.pi / 4))
        return 2 * half + np.sqrt(2) * (-minus_B - C), -minus_B, C


def machines(n: int = 8) -> list[Machine]:
    """Return random bodies on random axes, which are not at right angles, in random motion."""
    rng = np.random.default_rng(1)
    found = []
    for _ in range(n):
        n1, n2 = unit(rng.normal(size=3)), unit(rng.normal(size=3))
        found.append(
            Machine(
                masses=rng.uniform(0.3, 2.0, 5),
                points=rng.normal(size=(5, 3)) + rng.normal(size=3),
                n1=n1,
                n2=n2,
                r0=rng.uniform(0.5, 1.5) * rng.choice([-1, 1]) * unit(cross(n1, n2)),
                **{name: rng.uniform(0.5, 2.0) * rng.choice([-1, 1]) for name in RATES},
                gravity=rng.normal(size=3),
            )
        )
    return found


RATES = ("w1", "dw1", "w2", "dw2")


def disks(n: int = 8, **fixed: float) -> list[Disk]:
    """Return random disks in random states, off the angles at which terms vanish."""
    rng = np.random.default_rng(13)
    found = []
    for _ in range(n):
        values = {
            "m": rng.uniform(1.0, 3.0),
            "beta": rng.uniform(0.3, 1.2),
            "e": rng.uniform(0.05, 0.3),
            "a": rng.uniform(0.05, 0.3) * rng.choice([-1, 1]),
            "r": rng.uniform(0.1, 0.4),
            "l": rng.uniform(0.2, 0.5),
            "g": 9.81,
            "phi": rng.uniform(0.2, 1.3) + rng.choice(4) * np.pi / 2,
            **{name: rng.uniform(2.0, 6.0) * rng.choice([-1, 1]) for name in RATES},
        }
        found.append(Disk(**{**values, **fixed}))
    return found


@dataclass(frozen=True)
class Formula:
    """What a paper prints, what is right, and what the particles say; all functions of a state.

    ``right`` is phasekit's own wherever phasekit has the quantity, ``written`` the formula to be
    read in place of the printed one. ``states`` are those at which the printed form fails,
    ``right_at`` special ones at which it happens to be right.
    """

    paper: str
    equation: str
    about: str
    printed: Callable[[Any], Any]
    right: Callable[[Any], Any]
    oracle: Callable[[Any], Any]
    states: Sequence[Any]
    right_at: Sequence[Any] = ()
    written: Callable[[Any], Any] | None = None

    def __str__(self) -> str:
        """Return the name of the test."""
        return f"{self.paper}-{self.equation} {self.about}".strip()


def deviation(got: Any, want: Any) -> float:
    """Return the relative distance of two numbers or vectors; 0 against 0 is no distance."""
    apart = norm(np.subtract(got, want))
    return apart / norm(want) if norm(want) else apart


def decide(formula: Formula) -> None:
    """Assert that the printed form fails at every state and that the right one holds."""
    assert len(formula.states) >= 3
    for state in formula.states:
        assert deviation(formula.printed(state), formula.oracle(state)) > FAILS, state
    for state in formula.right_at:
        assert deviation(formula.printed(state), formula.oracle(state)) < HOLDS, state
    for state in (*formula.states, *formula.right_at):
        assert deviation(formula.right(state), formula.oracle(state)) < HOLDS, state
        if formula.written:
            assert deviation(formula.written(state), formula.oracle(state)) < HOLDS, state
