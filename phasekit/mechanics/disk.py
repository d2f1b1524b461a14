"""The skew, eccentric disk: coefficients of its equation of motion and its inertia."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

from phasekit.arrays import Array
from phasekit.laws.trigonometric import Values, turn
from phasekit.mechanics.vectors import broadcast, floats


def disk_products(v: Values) -> tuple[Any, Any, Any, Any]:
    """A N, B N, C N and N = 4 e^2 s^2 + r^2 (1 + s^2) of a disk, s = sin beta.

    The law of the disk ([Veljovic2015] (12), (13), corrected) in its length form, which is regular
    where the papers' lambda and psi are not; see `phasekit.laws.trigonometric` for what it takes.
    """
    sine, cosine, radius = v["beta"]
    offset, reach = 2 * v["e"] * sine, v["r"] * cosine
    omega_sq = v["omega1"] * v["omega1"]
    return (
        omega_sq * ((offset - reach) * (offset + reach)),
        2 * v["g"] * offset * radius,
        2 * omega_sq * v["a"] * offset * radius,
        offset * offset + v["r"] * v["r"] * (radius * radius + sine * sine),
    )


def disk_coefficients(
    beta: npt.ArrayLike,
    e: npt.ArrayLike,
    a: npt.ArrayLike,
    r: npt.ArrayLike,
    omega1: npt.ArrayLike,
    g: npt.ArrayLike = 9.80665,
) -> tuple[Array, Array, Array]:
    """Coefficients A, B, C of phi'' + B sin phi - A sin phi cos phi - C cos phi = 0, 1/s^2.

    With s = sin beta and N = 4 e^2 s^2 + r^2 (1 + s^2),
    A = omega1^2 (2 e s - r cos beta)(2 e s + r cos beta)/N, B = 4 g e s/N,
    C = 4 omega1^2 a e s/N: the length form, regular where the papers' lambda and psi are not.

    NaN where the disk is not a body: beta in [0, pi], e and r >= 0.

    [Veljovic2015] (12), (13) with Omega^2 = A, lambda = B/A, psi = C/A; the printed psi of (13)
    is wrong (it is (eps - 1) a sin beta/(e (eps sin^2 beta - 1))), and the papers' "eccentricity"
    e is the distance to the pole: the distance to the shaft is e sin beta.

    >>> [round(float(x), 6) for x in disk_coefficients(0.3, 0.1, 0.05, 0.1, 10.0)]
    [-39.21169, 80.688856, 41.139867]
    """
    beta, e, a, r, omega1, g = broadcast(beta=beta, e=e, a=a, r=r, omega1=omega1, g=g)
    with np.errstate(all="ignore"):
        values = {"beta": turn(beta), "e": e, "a": a, "r": r, "omega1": omega1, "g": g}
        *products, inertia = disk_products(values)
        legal = (beta >= 0.0) & (beta <= np.pi) & (e >= 0.0) & (r >= 0.0) & (inertia > 0.0)
        legal &= np.isfinite(inertia + a + omega1 + g)
        inertia = np.where(legal, inertia, np.nan)
        A, B, C = (product / inertia for product in products)
    return A, B, C


def disk_mixing(r: npt.ArrayLike, e: npt.ArrayLike, beta: npt.ArrayLike) -> Array:
    """Coefficient kappa of the term kappa omega1'(t) cos phi that a varying support speed adds.

    kappa = (r^2 + 4 e^2) sin beta cos beta/N, dimensionless; it is missing from [Veljovic2015]
    (11), where the product of inertia J_u1n1 is taken as zero.

    >>> round(float(disk_mixing(0.1, 0.1, 0.3)), 6)
    0.98256
    """
    r, e, beta = floats(r=r, e=e, beta=beta)
    with np.errstate(all="ignore"):
        return np.asarray(mixing(r, e, turn(beta)[0], np.cos(beta)))


def mixing(r: Any, e: Any, sine: Any, cosine: Any) -> Any:
    """The same of sine and cosine of beta: numbers, arrays or symbols."""
    inertia = 4.0 * e * e * sine * sine + r * r * (1.0 + sine * sine)
    return (r * r + 4.0 * e * e) * sine * cosine / inertia


def disk_eccentricity(e: npt.ArrayLike, beta: npt.ArrayLike) -> Array:
    """Distance e sin beta of the disk's center from the shaft, m.

    The length of the papers' vector of eccentricity; their formulas mean e, the distance from
    the pole ([Veljovic2015] (13)).

    >>> float(disk_eccentricity(0.1, np.pi))
    0.0
    """
    e, beta = floats(e=e, beta=beta)
    with np.errstate(all="ignore"):
        return np.asarray(e * turn(beta)[0])


def disk_inertia(
    m: npt.ArrayLike, r: npt.ArrayLike, e: npt.ArrayLike, beta: npt.ArrayLike
) -> tuple[Array, Array, Array, Array]:
    """Moments of inertia (Ju, Jv, Jn, Jvn) of the disk at the pole O2, kg m^2.

    With J = m r^2/4 and eps = 1 + 4 e^2/r^2: Ju = J eps, Jv = J (1 + eps cos^2 beta),
    Jn = J (1 + eps sin^2 beta), Jvn = J eps sin beta cos beta, in the frame (u2, v2, n2) with u2
    tangential, v2 radial inward and n2 along the shaft ([Veljovic2015] before (12)).

    >>> [round(float(x), 6) for x in disk_inertia(2.0, 0.1, 0.1, 0.3)]
    [0.025, 0.027817, 0.007183, 0.007058]
    """
    m, r, e, beta = floats(m=m, r=r, e=e, beta=beta)
    with np.errstate(all="ignore"):
        s, c = turn(beta)[0], np.cos(beta)
        ju = m * (0.25 * r * r + e * e)
        j = 0.25 * m * r * r
        return ju, j + ju * c * c, j + ju * s * s, ju * s * c
