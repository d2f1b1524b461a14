"""A body of particles that is carried round two axes: mechanics by definition, in mpmath.

A quantity that varies in time is a `Jet`, the first coefficients of its Taylor series, on which
sums, products, sines and cosines act exactly. Positions follow from the two rotations, everything
else from sums over particles and from `d()`; forces from a linear system of the six equations of
Newton and Euler. No formula of phasekit or of the papers takes part.

    machine = Machine(masses, points, n1, n2, a)        # points from O2 at phi1 = phi2 = 0
    motion = machine.motion([phi1, w1, dw1, ddw1], [phi2, w2, dw2, ddw2])
    motion.L, motion.dL, motion.self_bearings(G, s_A, s_B), ...

Vectors are lists of three. Importing this raises mpmath's precision for the whole run.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

from mpmath import factorial, lu_solve, matrix, mp, mpf

DPS = 50
mp.dps = max(mp.dps, DPS)


class Jet:
    """Taylor coefficients of a function of time, up to the order to which they are known."""

    def __init__(self, coefficients: Sequence[Any]):
        self.c = [mpf(x) for x in coefficients]

    @classmethod
    def of_derivatives(cls, values: Sequence[Any]) -> Jet:
        """Make the jet of a function from its value and derivatives."""
        return cls([mpf(x) / factorial(k) for k, x in enumerate(values)])

    def d(self) -> Jet:
        """Return the time derivative."""
        return Jet([k * x for k, x in enumerate(self.c)][1:])

    @property
    def now(self) -> mpf:
        return self.c[0]

    def __add__(self, other: Any) -> Jet:
        """Sum; known to the lower of the two orders."""
        if not isinstance(other, Jet):
            return Jet([self.c[0] + other, *self.c[1:]])
        return Jet([x + y for x, y in zip(self.c, other.c, strict=False)])

    def __mul__(self, other: Any) -> Jet:
        """Product, by Cauchy."""
        if not isinstance(other, Jet):
            return Jet([x * other for x in self.c])
        known = min(len(self.c), len(other.c))
        return Jet([sum(self.c[j] * other.c[k - j] for j in range(k + 1)) for k in range(known)])

    __radd__, __rmul__ = __add__, __mul__

    def __neg__(self) -> Jet:
        """Negative."""
        return self * -1

    def __sub__(self, other: Any) -> Jet:
        """Difference."""
        return self + -other

    def __rsub__(self, other: Any) -> Jet:
        """Difference from a number."""
        return -self + other


def sin_cos(angle: Jet) -> tuple[Jet, Jet]:
    """Return sine and cosine of a jet, from sin' = cos angle' and cos' = -sin angle'."""
    s, c = [mp.sin(angle.now)], [mp.cos(angle.now)]
    rate = angle.d().c
    for k in range(1, len(angle.c)):
        s.append(sum(rate[j] * c[k - 1 - j] for j in range(k)) / k)
        c.append(-sum(rate[j] * s[k - 1 - j] for j in range(k)) / k)
    return Jet(s), Jet(c)


# --- vectors, of numbers or of jets ------------------------------------------------------------


def dot(x: Sequence[Any], y: Sequence[Any]) -> Any:
    return x[0] * y[0] + x[1] * y[1] + x[2] * y[2]


def cross(x: Sequence[Any], y: Sequence[Any]) -> list[Any]:
    return [x[1] * y[2] - x[2] * y[1], x[2] * y[0] - x[0] * y[2], x[0] * y[1] - x[1] * y[0]]


def plus(*vectors: Sequence[Any]) -> list[Any]:
    return [sum(parts[1:], parts[0]) for parts in zip(*vectors, strict=True)]


def times(number: Any, x: Sequence[Any]) -> list[Any]:
    return [number * part for part in x]


def minus(x: Sequence[Any], y: Sequence[Any]) -> list[Any]:
    return plus(x, times(-1, y))


def norm(x: Sequence[Any]) -> mpf:
    return mp.sqrt(dot(x, x))


def unit(x: Sequence[Any]) -> list[Any]:
    return times(1 / norm(x), x)


def d(x: Sequence[Jet]) -> list[Jet]:
    """Time derivative of a vector."""
    return [part.d() for part in x]


def now(x: Sequence[Jet]) -> list[mpf]:
    return [part.now for part in x]


def exact(values: Any) -> Any:
    """Turn numbers in nested lists or arrays into mpf that equal them."""
    return [exact(x) for x in values] if hasattr(values, "__len__") else mpf(values)


def rotated(n: Sequence[mpf], sine: Any, cosine: Any, x: Sequence[Any]) -> list[Any]:
    """Turn x about the unit vector n, right-handed."""
    along = times(dot(n, x), n)
    return plus(along, times(cosine, minus(x, along)), times(sine, cross(n, x)))


def disk_particles(m: Any, r: Any, e: Any, beta: Any) -> tuple[list[mpf], list[list[mpf]]]:
    """Return four particles with mass, center and inertia of the thin disk, in (u01, v01, n1).

    They lie at r/sqrt(2) from the center, on the diameter through O2 and on the one across it.
    """
    m, r, e, beta = exact([m, r, e, beta])
    first, second = [mp.cos(beta), mpf(0), -mp.sin(beta)], [mpf(0), mpf(1), mpf(0)]
    reach = r / mp.sqrt(2)
    points = [
        plus(times(e, first), times(side, diameter))
        for diameter in (first, second)
        for side in (reach, -reach)
    ]
    return [m / 4] * 4, points


class Machine:
    """Particles at phi1 = phi2 = 0 from O2, and the axes there (directions of any length)."""

    def __init__(self, masses: Any, points: Any, n1: Any, n2: Any, a: Any):
        self.masses, self.points = exact(masses), exact(points)
        self.n1, self.n2, self.a = unit(exact(n1)), unit(exact(n2)), mpf(a)
        self.r0 = times(self.a, unit(cross(self.n1, self.n2)))

    def motion(self, phi1: Sequence[Any], phi2: Sequence[Any]) -> Motion:
        """Return the motion by the angles and their derivatives, at least two, at one time."""
        return Motion(self, Jet.of_derivatives(phi1), Jet.of_derivatives(phi2))

    def free_motion(self, phi1: Sequence[Any], phi2: Sequence[Any], G: Any) -> Motion:
        """Return the motion with the second derivative of phi2 for which no couple is needed."""
        couples = [self.motion(phi1, [*phi2[:2], x]).self_torque(G) for x in (0, 1)]
        return self.motion(phi1, [*phi2[:2], couples[0] / (couples[0] - couples[1])])


class Motion:
    """Jets n1, n2, r0, rho (of each particle), K, L, ...; numbers dK, dL, M_O2, T, dT, forces."""

    def __init__(self, machine: Machine, phi1: Jet, phi2: Jet):
        self.masses, self.M = machine.masses, sum(machine.masses)
        first, second = sin_cos(phi1), sin_cos(phi2)
        zero = phi1 * 0 + phi2 * 0

        def carried(x: Sequence[Any]) -> list[Jet]:
            return [part + zero for part in rotated(machine.n1, *first, x)]

        self.phi1, self.phi2 = phi1, phi2
        self.n1 = [zero + part for part in machine.n1]
        self.n2, self.r0 = carried(machine.n2), carried(machine.r0)
        self.rho = [carried(rotated(machine.n2, *second, x)) for x in machine.points]
        self.rho_C = times(1 / self.M, self.sum(lambda m, x: times(m, x)))

        r = [plus(self.r0, x) for x in self.rho]
        v = [d(x) for x in r]
        self.K = plus(*(times(m, y) for m, y in zip(self.masses, v, strict=True)))
        self.L = plus(*(times(m, cross(x, y)) for m, x, y in zip(self.masses, r, v, strict=True)))
        moments = zip(self.masses, self.rho, v, strict=True)
        self.M_O2 = now(plus(*(times(m, cross(x, d(y))) for m, x, y in moments)))
        energy = sum(m * dot(y, y) for m, y in zip(self.masses, v, strict=True)) * mpf(0.5)
        self.T, self.dT = energy.now, energy.d().now
        self.dK, self.dL = now(d(self.K)), now(d(self.L))

    def sum(self, of: Callable[[mpf, list[Jet]], list[Jet]]) -> list[Jet]:
        """Sum a function of mass and position from O2 over the particles."""
        return plus(*(of(m, x) for m, x in zip(self.masses, self.rho, strict=True)))

    def S(self, n: Sequence[Jet]) -> list[Jet]:
        """Linear mass moment vector."""
        return self.sum(lambda m, x: times(m, cross(n, x)))

    def J(self, n: Sequence[Jet]) -> list[Jet]:
        """Mass inertia moment vector."""
        return self.sum(lambda m, x: times(m, cross(x, cross(n, x))))

    def D(self, n: Sequence[Jet]) -> list[Jet]:
        """Deviation moment vector."""
        return cross(n, cross(self.J(n), n))

    def power_of_weight(self, G: Any) -> mpf:
        """Rate of work of the weight; with the opposite sign, of potential energy."""
        return dot(exact(G), now(d(plus(self.r0, self.rho_C))))

    def self_bearings(self, G: Any, s_A: Any, s_B: Any) -> tuple[list[mpf], list[mpf], mpf]:
        """F_A2, F_B2 and the couple about n2, by Newton and Euler for the body about O2."""
        n, weight = now(self.n2), exact(G)
        moment = minus(self.M_O2, cross(now(self.rho_C), weight))
        return reactions(n, s_A, s_B, minus(self.dK, weight), moment)

    def self_torque(self, G: Any) -> mpf:
        return self.self_bearings(G, 1, -1)[2]

    def fixed_bearings(self, G: Any, rho_B1: Any) -> tuple[list[mpf], list[mpf], mpf]:
        """F_A1, F_B1 and the couple about n1, by Newton and Euler for all about O1."""
        n, weight = now(self.n1), exact(G)
        moment = minus(self.dL, cross(now(plus(self.r0, self.rho_C)), weight))
        return reactions(n, 0, rho_B1, minus(self.dK, weight), moment)


def reactions(
    n: list[mpf], s_A: Any, s_B: Any, force: list[mpf], moment: list[mpf]
) -> tuple[list[mpf], list[mpf], mpf]:
    """Solve for three components at A, two across n at B and a couple about n."""
    s_A, s_B = exact([s_A, s_B])
    axes = [[mpf(i == k) for k in range(3)] for i in range(3)]
    first = unit(cross(n, axes[min(range(3), key=lambda k: abs(n[k]))]))
    across = [first, cross(n, first)]
    columns = [[*x, *cross(times(s_A, n), x)] for x in axes]
    columns += [[*x, *cross(times(s_B, n), x)] for x in across]
    columns += [[mpf(0)] * 3 + n]
    x = lu_solve(matrix(columns).T, matrix([*force, *moment]))
    return [x[0], x[1], x[2]], plus(times(x[3], across[0]), times(x[4], across[1])), x[5]
