"""The disk on a support that turns freely: two degrees of freedom, and their reduction to one.

Coordinates are phi1, the angle of the support about the vertical axis n1, and phi, that of the disk
about its shaft n2. The support's angle does not occur in the energies, so without a torque on the
support the momentum p about n1 is constant, and phi moves alone in the amended potential.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from phasekit.arrays import Array
from phasekit.errors import EquilibriumKind
from phasekit.mechanics.disk import disk_eccentricity, disk_inertia
from phasekit.mechanics.vectors import floats

#: Halvings after which a bracket of at most one turn has shrunk to the rounding of its ends.
HALVINGS = 64
#: A value is taken as zero below this multiple of the rounding unit and of its largest terms,
#: the residual of a root of a polynomial below that multiple, which eigenvalues leave behind.
ROUNDING = 32 * np.finfo(float).eps
RESIDUAL = 1e4 * np.finfo(float).eps


class TwoDegrees(NamedTuple):
    """What the equations of motion need of the machine: numbers, or arrays that broadcast."""

    rest: Any
    """Part of the inertia about n1 that does not depend on phi, kg m^2."""
    tilt: Any
    """Part of the inertia about n1 that goes with cos^2 phi, kg m^2."""
    m: Any
    """Mass, kg."""
    a: Any
    """Distance between the axes, m."""
    offset: Any
    """Distance e sin beta of the mass center from the shaft, m."""
    Jn: Any
    """Moment of inertia about the shaft, kg m^2."""
    Jvn: Any
    """Deviation moment of the shaft, kg m^2."""
    weight: Any
    """Largest torque m g e sin beta of the weight about the shaft, N m."""


def two_degrees(
    beta: npt.ArrayLike,
    e: npt.ArrayLike,
    a: npt.ArrayLike,
    r: npt.ArrayLike,
    m: npt.ArrayLike,
    carrier_inertia: npt.ArrayLike,
    g: npt.ArrayLike = 9.80665,
) -> TwoDegrees:
    """Constants of the machine of two degrees of freedom.

    >>> machine = two_degrees(0.3, 0.1, 0.05, 0.1, 2.0, 0.01)
    >>> round(float(machine.rest), 9)
    0.033253356
    """
    e, a, m, g = (value[()] for value in floats(e=e, a=a, m=m, g=g))
    angle, radius, own = floats(beta=beta, r=r, carrier_inertia=carrier_inertia)
    # Exactly 0 at the double nearest to pi/2: a disk square to its shaft.
    cos = np.where(angle == np.pi / 2, 0.0, np.cos(angle))[()]
    ju, _, jn, _ = disk_inertia(m, r, e, beta)
    sin = disk_eccentricity(1.0, beta)[()]
    J = 0.25 * m * np.square(radius)[()]
    rest = own + J + m * (e * cos) ** 2
    weight = m * g * e * sin
    return TwoDegrees(rest[()], J * cos**2, m, a, e * sin, jn[()], ju[()] * sin * cos, weight)


def support_inertia(machine: TwoDegrees, phi: Any) -> tuple[Any, Any, Any]:
    """Inertia M11 about n1 and its first and second derivative by phi, kg m^2.

    M11 = Jc + m (a + e sin beta sin phi)^2 + m e^2 cos^2 beta + J (1 + cos^2 beta cos^2 phi),
    J = m r^2/4: a sum of squares, equal to Jc + m a^2 + 2 m a e sin beta sin phi + Ju sin^2 phi
    + Jv cos^2 phi.
    """
    s, c = np.sin(phi), np.cos(phi)
    m11 = machine.rest + machine.tilt * c**2 + machine.m * (machine.a + machine.offset * s) ** 2
    arm, difference = _variation(machine)
    return m11, 2.0 * c * (arm + difference * s), 2.0 * (difference * (c - s) * (c + s) - arm * s)


def _variation(machine: TwoDegrees) -> tuple[Any, Any]:
    """Coefficients m a e sin beta and Ju - Jv: M11' = 2 cos phi (arm + difference sin phi)."""
    product = machine.m * machine.offset
    return product * machine.a, product * machine.offset - machine.tilt


def mass_matrix(machine: TwoDegrees, phi: Any) -> Array:
    """Matrix [[M11, M12], [M12, M22]] of 2 T = M11 omega1^2 + 2 M12 omega1 phi' + M22 phi'^2.

    M11 as `support_inertia`, M12 = Jvn cos phi, M22 = Jn, kg m^2; the matrix is on the last axes.
    """
    m11, m12, m22 = np.broadcast_arrays(
        support_inertia(machine, phi)[0], machine.Jvn * np.cos(phi), machine.Jn
    )
    return np.stack([np.stack([m11, m12], -1), np.stack([m12, m22], -1)], -2)


def accelerations(
    machine: TwoDegrees, phi: Any, dphi: Any, omega1: Any, torque1: Any = 0.0, torque2: Any = 0.0
) -> tuple[Any, Any]:
    """Accelerations omega1' and phi'', rad/s^2.

    They solve
    M11 omega1' + M12 phi'' + M11' omega1 phi' + M12' phi'^2 = Q1,
    M12 omega1' + M22 phi'' - M11' omega1^2/2 + V' = Q2,
    with V = -m g e sin beta cos phi, Q1 on the support and Q2 on the disk by its shaft, N m.

    With omega1 prescribed the second equation is [Veljovic2015] (11) with the corrected factor of
    its right side, and with the product of inertia that multiplies omega1' and is missing there.
    [HedrihVeljovic2013] (2) is short of the driving torque Q1.
    """
    s, c = np.sin(phi), np.cos(phi)
    m11, slope, _ = support_inertia(machine, phi)
    m12, m22 = machine.Jvn * c, machine.Jn
    right1 = torque1 - slope * omega1 * dphi + machine.Jvn * s * dphi**2
    right2 = torque2 + 0.5 * slope * omega1**2 - machine.weight * s
    determinant = m11 * m22 - m12**2
    return (
        (m22 * right1 - m12 * right2) / determinant,
        (m11 * right2 - m12 * right1) / determinant,
    )


def energy(machine: TwoDegrees, phi: Any, dphi: Any, omega1: Any) -> Any:
    """Kinetic and potential energy of disk and support, J; the weight's is 0 at phi = pi/2."""
    m11, m12 = support_inertia(machine, phi)[0], machine.Jvn * np.cos(phi)
    kinetic = 0.5 * m11 * omega1**2 + m12 * omega1 * dphi + 0.5 * machine.Jn * dphi**2
    return kinetic - machine.weight * np.cos(phi)


def angular_momentum(machine: TwoDegrees, phi: Any, dphi: Any, omega1: Any) -> Any:
    """Momentum p = M11 omega1 + M12 phi' about n1, kg m^2/s; its rate is the torque Q1."""
    return support_inertia(machine, phi)[0] * omega1 + machine.Jvn * np.cos(phi) * dphi


def support_velocity(machine: TwoDegrees, p: Any, phi: Any, dphi: Any) -> Any:
    """Angular velocity omega1 = (p - M12 phi')/M11 of the support at the momentum p, rad/s."""
    return (p - machine.Jvn * np.cos(phi) * dphi) / support_inertia(machine, phi)[0]


def effective_inertia(machine: TwoDegrees, phi: Any) -> Any:
    """Inertia M22 - M12^2/M11 of phi alone, kg m^2: energy = it phi'^2/2 + amended potential."""
    return machine.Jn - (machine.Jvn * np.cos(phi)) ** 2 / support_inertia(machine, phi)[0]


def amended_potential(machine: TwoDegrees, p: Any, phi: Any) -> tuple[Any, Any, Any]:
    """Amended potential V + p^2/(2 M11) and its first and second derivative by phi, J."""
    m11, slope, bend = support_inertia(machine, phi)
    s, c = np.sin(phi), np.cos(phi)
    half = 0.5 * p**2 / m11
    steep = slope / m11
    return (
        half - machine.weight * c,
        machine.weight * s - half * steep,
        machine.weight * c + half * (2.0 * steep**2 - bend / m11),
    )


class RelativeEquilibria(NamedTuple):
    """Steady rotations of one machine at one momentum: the disk stands, the support turns evenly.

    In the order of phi. Empty where no torque acts on the disk at any angle.
    """

    phi: Array
    """Angle in (-pi, pi], rad."""
    kind: npt.NDArray[np.int8]
    """`EquilibriumKind` of the amended potential."""
    energy: Array
    """Energy, J."""
    curvature: Array
    """Second derivative of the amended potential, J; exactly 0 where degenerate."""
    frequency: Array
    """Of small oscillations of phi about centers at the same momentum, rad/s; else NaN."""
    omega1: Array
    """Angular velocity p/M11 of the support, rad/s."""


def relative_equilibria(machine: TwoDegrees, p: float, torque: float = 0.0) -> RelativeEquilibria:
    """All equilibria of the amended potential, with their types.

    The equation M11^2 (V' - torque) = p^2 M11'/2 is a polynomial of degree 10 in exp(i phi). The
    zeros of its derivative, from the eigenvalues of a companion pencil, cut the circle into arcs on
    which it is monotone; bisection finds the root of each arc on whose ends its signs differ. An
    extremum that is zero within rounding is a degenerate equilibrium.

    >>> machine = two_degrees(0.3, 0.02, 0.002, 0.1, 2.0, 0.01)
    >>> [relative_equilibria(machine, p).phi.size for p in (0.0, 0.1, 0.3)]
    [2, 2, 4]
    """
    simple, rising, merged = _zeros(machine, p, torque)
    phi = np.concatenate([simple, merged])
    phi = np.pi - np.mod(np.pi - phi, 2.0 * np.pi)  # to (-pi, pi]
    kind = np.full(phi.size, EquilibriumKind.DEGENERATE, np.int8)
    kind[: simple.size] = np.where(rising, EquilibriumKind.CENTER, EquilibriumKind.SADDLE)
    order = np.argsort(phi)
    phi, kind = phi[order], kind[order]
    potential, _, curvature = amended_potential(machine, p, phi)
    potential = potential - torque * phi
    curvature = np.where(kind == EquilibriumKind.DEGENERATE, 0.0, curvature)
    center = kind == EquilibriumKind.CENTER
    ratio = np.where(center, np.maximum(curvature, 0.0), np.nan) / effective_inertia(machine, phi)
    omega1 = p / support_inertia(machine, phi)[0]
    return RelativeEquilibria(phi, kind, potential, curvature, np.sqrt(ratio), omega1)


def _zeros(
    machine: TwoDegrees, p: float, torque: float
) -> tuple[Array, npt.NDArray[np.bool_], Array]:
    """Zeros of `_condition`: the simple ones, whether it rises there, and the merged ones."""
    ends = _extrema(machine, p, torque)
    value, rounding = _condition(machine, p, torque, ends)
    sign = np.where(np.abs(value) <= rounding, 0, np.sign(value))
    if not sign.any():
        return np.empty(0), np.empty(0, bool), np.empty(0)
    # Start behind an extremum that is not zero, so that no row of zeros runs round the end.
    first = int(np.flatnonzero(sign)[0])
    ends, sign = np.roll(ends, -first), np.roll(sign, -first)
    ends = np.append(np.where(ends < ends[0], ends + 2.0 * np.pi, ends), ends[0] + 2.0 * np.pi)
    sign = np.append(sign, sign[0])

    # Neighboring zero extrema are one merged point if the condition vanishes between them too.
    middle, rounding = _condition(machine, p, torque, 0.5 * (ends[1:] + ends[:-1]))
    joined = np.append(False, (sign[1:] == 0) & (sign[:-1] == 0) & (np.abs(middle) <= rounding))
    merged = ends[(sign == 0) & ~joined]

    crossing = sign[1:] * sign[:-1] < 0
    low, high, rising = ends[:-1][crossing], ends[1:][crossing], sign[1:][crossing] > 0
    for _ in range(HALVINGS):
        half = 0.5 * (low + high)
        beyond = (_condition(machine, p, torque, half)[0] > 0) == rising
        low, high = np.where(beyond, low, half), np.where(beyond, half, high)
    simple = 0.5 * (low + high)
    # A particle over n1 on a support without inertia: M11 = 0 there, where nothing can stand.
    largest = machine.rest + machine.tilt + machine.m * (abs(machine.a) + machine.offset) ** 2
    inert = support_inertia(machine, simple)[0] > ROUNDING * largest
    return simple[inert], rising[inert], merged


def _condition(machine: TwoDegrees, p: float, torque: float, phi: Array) -> tuple[Array, Array]:
    """Amended gradient times M11^2, and what may be its rounding."""
    m11, slope, _ = support_inertia(machine, phi)
    value = m11**2 * (machine.weight * np.sin(phi) - torque) - 0.5 * p**2 * slope
    arm, difference = _variation(machine)
    terms = m11**2 * (abs(machine.weight) + abs(torque)) + p**2 * (abs(arm) + abs(difference))
    return value, ROUNDING * terms


def _extrema(machine: TwoDegrees, p: float, torque: float) -> Array:
    """Zeros in [0, 2 pi) of the derivative of `_condition`, in order."""
    # Coefficients of exp(i k phi), k = -d...d; a product of functions is a convolution.
    sin, cos, one = np.array([0.5j, 0.0, -0.5j]), np.array([0.5, 0.0, 0.5]), np.eye(1, 5, 2)[0]
    arm, difference = _variation(machine)
    m11 = (machine.rest + machine.tilt + machine.m * machine.a**2) * one
    m11 = m11 + difference * np.convolve(sin, sin) + 2.0 * arm * np.pad(sin, 1)
    slope = 2.0 * arm * np.pad(cos, 1) + 2.0 * difference * np.convolve(sin, cos)
    square = np.convolve(m11, m11)
    series = machine.weight * np.convolve(square, sin) - torque * np.pad(square, 1)
    series = 1j * np.arange(-5, 6) * (series - 0.5 * p**2 * np.pad(slope, 3))

    largest = np.abs(series).max()
    if largest == 0.0:
        return np.empty(0)
    series = series / largest
    # Where coefficients of high order are small, the pencil keeps its accuracy and the companion
    # matrix itself does not: alpha/beta are the zeros, infinite ones included.
    right, left = np.eye(10, dtype=complex), np.eye(10, k=-1, dtype=complex)
    right[0, 0], left[0] = series[-1], -series[-2::-1]
    from scipy.linalg import eigvals

    alpha, beta = eigvals(left, right, homogeneous_eigvals=True)
    angles = np.sort(np.mod(np.angle(alpha * np.conj(beta)), 2.0 * np.pi))
    # Zeros off the unit circle are none of the real function.
    powers = np.exp(1j * np.multiply.outer(angles, np.arange(-5, 6)))
    real: Array = angles[np.abs(powers @ series) <= RESIDUAL]
    return real
