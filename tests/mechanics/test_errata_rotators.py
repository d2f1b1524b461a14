"""Errata of the papers: vector rotators of the disk, their angles and angular velocities.

A rotator is a part of the rate of momentum over the size of its mass moment, so the particles give
it with one of the two rotations at rest; the coupled ones are what the rotations together add.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from witnesses.errata import (
    ACROSS,
    ALONG,
    HOLDS,
    UP,
    Disk,
    Formula,
    cross,
    decide,
    deviation,
    disks,
    norm,
    unit,
)

from phasekit.mechanics.general.body import RigidBody
from phasekit.mechanics.general.rotation import CoupledRotation
from phasekit.mechanics.rotators import ROTATORS, rotators

H11, H13 = "HedrihVeljovic2011", "HedrihVeljovic2013"
GENERAL = disks()
EVEN = disks(dw1=0.0)  # the carrier turns evenly
FREE = [d.free() for d in EVEN]


def phasekit(d: Disk, *, free: bool = False) -> Any:
    ddphi = None if free else d.dw2
    return rotators(d.beta, d.e, d.a, d.r, d.w1, d.g, d.phi, d.w2, ddphi, d.dw1)


def of_phasekit(name: str) -> Any:
    return lambda d: phasekit(d).rotator[ROTATORS.index(name)]


# --- the particles' word -------------------------------------------------------------------------


def R01(d: Disk) -> np.ndarray:
    """All particles at O2."""
    x = d.machine.replace(points=np.zeros((4, 3)))
    return x.dK / (x.M * abs(d.a))


def R011(d: Disk) -> np.ndarray:
    """Axes that intersect, the carrier turns alone."""
    x = d.machine.replace(r0=0 * UP, w2=0.0, dw2=0.0)
    return x.dK / (x.M * norm(cross(UP, x.C)))


def R022(d: Disk) -> np.ndarray:
    """The carrier at rest."""
    x = d.machine.replace(w1=0.0, dw1=0.0)
    return x.dK / (x.M * norm(cross(ALONG, x.C)))


def R012(d: Disk) -> np.ndarray:
    x = d.machine
    return x.mixed("dK") / (x.M * norm(cross(UP, cross(ALONG, x.C))))


def R1(d: Disk) -> np.ndarray:
    x = d.machine.replace(r0=0 * UP, w2=0.0, dw2=0.0)
    return across(x.M2, UP) / norm(across(x.J(UP), UP))


def R2(d: Disk) -> np.ndarray:
    x = d.machine.replace(r0=0 * UP, w1=0.0, dw1=0.0)
    return across(x.M2, ALONG) / norm(across(x.J(ALONG), ALONG))


def across(v: np.ndarray, n: np.ndarray) -> np.ndarray:
    return v - n * (n @ v)


# --- printed -------------------------------------------------------------------------------------


def printed_R1(d: Disk) -> np.ndarray:
    """Return R1 of [HedrihVeljovic2011] (5.1)."""
    _, c, sb, cb = d.trig
    u = d.dw1 * cb + d.w1**2 * sb * c
    v = -d.dw1 * sb * c + d.w1**2 * cb
    return (u * ALONG + v * ACROSS) / np.hypot(cb, sb * c)


def right_R1(d: Disk) -> np.ndarray:
    s, c, _, _ = d.trig
    Ju, Jv, _, Jvn = d.inertia()
    Q = (Ju - Jv) * s
    u, v = d.dw1 * Jvn - d.w1**2 * Q, d.dw1 * Q + d.w1**2 * Jvn
    return np.sign(c) * (u * ALONG + v * ACROSS) / np.hypot(Jvn, Q)


def printed_R1_even(d: Disk) -> np.ndarray:
    """Return R1 of [HedrihVeljovic2013] (15)."""
    _, c, sb, cb = d.trig
    return -(d.w1**2) * (sb * c * ALONG + cb * ACROSS) / np.hypot(cb, sb * c)


def printed_R011(d: Disk) -> np.ndarray:
    s, _, sb, cb = d.trig
    v = d.dw1 * cb - d.w1**2 * sb * s
    u = -(d.dw1 * sb * s + d.w1**2 * cb)
    return (u * ALONG + v * ACROSS) / np.hypot(cb, sb * s)


def printed_center(d: Disk) -> np.ndarray:
    """Return the mass center of [HedrihVeljovic2011] section 5."""
    s, c, sb, cb = d.trig
    return d.e * np.array([cb, -sb * c, sb * s])


def right_center(d: Disk) -> np.ndarray:
    s, c, sb, cb = d.trig
    return d.e * np.array([cb, sb * s, -sb * c])


def center_of_phasekit(d: Disk) -> np.ndarray:
    body = RigidBody.disk(m=d.m, r=d.r, e=d.e, beta=d.beta)
    return CoupledRotation(body, n1=UP, n2=ALONG, a=d.a).at(phi2=d.phi).rho_C


def line(v: np.ndarray) -> np.ndarray:
    """Return a direction without its sign."""
    return np.outer(unit(v), unit(v))


def base_of_phasekit(name: str) -> Any:
    """Return the direction of a rotator's base vector: the rotator of a start from rest."""
    return lambda d: line(of_phasekit(name)(d.replace(w1=0.0, w2=0.0, dw1=1.0, dw2=1.0)))


def printed_D1(d: Disk) -> np.ndarray:
    """Return the direction of D_n1 in [HedrihVeljovic2011] (5.2)."""
    _, c, sb, cb = d.trig
    return np.array([cb, -sb * c, 0.0])


def right_D1(d: Disk) -> np.ndarray:
    s, c, _, _ = d.trig
    Ju, Jv, _, Jvn = d.inertia()
    return c * np.array([Jvn, (Ju - Jv) * s, 0.0])


def tangent(v: np.ndarray) -> float:
    return float(v[1] / v[0])


def printed_tangent(d: Disk) -> float:
    """Return tg of the angle of R1, [HedrihVeljovic2011] (5.3)."""
    _, c, sb, cb = d.trig
    T, k = d.dw1 / d.w1**2, sb / cb * c
    return (1 - T * k) / (T + k)


def right_tangent(d: Disk) -> float:
    s, _, _, _ = d.trig
    Ju, Jv, _, Jvn = d.inertia()
    T, K = d.dw1 / d.w1**2, (Ju - Jv) * s / Jvn
    return (T * K + 1) / (T - K)


def gamma_rate(w: float, dw: float, ddw: float) -> float:
    """Return the rate of atan2(w^2, dw) by a complex step, exact to rounding."""
    h = 1e-30j
    return float(np.imag(np.arctan((w + dw * h) ** 2 / (dw + ddw * h))) / 1e-30)


JERK = 1.7


def printed_gamma_rate(w: float, dw: float, ddw: float) -> float:
    return w * (2 * dw - w * ddw) / (dw**2 + w**4)


def right_gamma_rate(w: float, dw: float, ddw: float) -> float:
    return w * (2 * dw**2 - w * ddw) / (dw**2 + w**4)


def lead_of_phasekit(d: Disk, name: str, omega: float) -> float:
    """Return the rate of a rotator relative to its base vector, which turns evenly here."""
    body = RigidBody.disk(m=d.m, r=d.r, e=d.e, beta=d.beta)
    motion = {"omega1": d.w1, "domega1": d.dw1, "omega2": d.w2, "domega2": d.dw2}
    state = CoupledRotation(body, n1=UP, n2=ALONG, a=d.a).at(phi2=d.phi, **motion)
    return state.angular_velocities(JERK, JERK)[name] - omega


def azimuth_rate(d: Disk) -> float:
    """Return the angular velocity of the horizontal direction O2C, by the particles."""
    x = d.machine.replace(r0=0 * UP)
    velocity = x.K / x.M
    return float(cross(x.C, velocity)[2] / (x.C[0] ** 2 + x.C[1] ** 2))


def written_azimuth_rate(d: Disk) -> float:
    s, c, sb, cb = d.trig
    return d.w1 + cb * sb * c * d.w2 / (cb**2 + sb**2 * s**2)


def rate_of_phasekit(d: Disk) -> float:
    return lead_of_phasekit(d, "R011", 0.0) - right_gamma_rate(d.w1, d.dw1, JERK)


# --- along the motion of the disk, omega1 constant -----------------------------------------------


def reduced(d: Disk) -> tuple[float, float, float]:
    A, B, C = d.coefficients()
    return A, B / A, C / A


def acceleration(d: Disk) -> float:
    """Return phi'' as the papers write it, Omega^2 [-(lambda - cos) sin + psi cos]."""
    s, c, _, _ = d.trig
    A, lam, psi = reduced(d)
    return A * (-(lam - c) * s + psi * c)


def jerk(d: Disk) -> float:
    A, B, C = d.coefficients()
    s, c, _, _ = d.trig
    return (-B * c + A * (c * c - s * s) - C * s) * d.w2


def printed_along(d: Disk, *, base: np.ndarray) -> np.ndarray:
    """Return [HedrihVeljovic2013] (18), with Omega^2 before the square of the velocity."""
    A, _, _ = reduced(d)
    return acceleration(d) * base + A * d.w2**2 * cross(ALONG, base)


def printed_gamma2_rate(d: Disk) -> float:
    """Return [HedrihVeljovic2011] (6.12) as far as it is printed: without psi."""
    s, c, _, _ = d.trig
    A, lam, _ = reduced(d)
    f, v = A * (lam - c) * s, d.w2**2
    return d.w2 * (2 * f**2 + A * (lam * c - np.cos(2 * d.phi)) * v) / (f**2 + v**2)


def written_gamma2_rate(d: Disk) -> float:
    s, c, _, _ = d.trig
    A, lam, psi = reduced(d)
    f, v = A * ((lam - c) * s - psi * c), d.w2**2
    slope = A * (lam * c - np.cos(2 * d.phi) + psi * s)
    return d.w2 * (2 * f**2 + slope * v) / (f**2 + v**2)


def below(d: Disk) -> bool:
    """Tell whether the mass center is below the shaft."""
    return bool(np.cos(d.phi) > 0)


ERRATA = [
    Formula(
        H11,
        "(4.1)",
        "index of R022",
        printed=lambda d: d.dw1 * d.v02 - d.w1**2 * d.u02,
        right=of_phasekit("R022"),
        oracle=R022,
        states=GENERAL,
        written=lambda d: d.dw2 * d.v02 - d.w2**2 * d.u02,
    ),
    *(
        Formula(
            paper,
            number,
            "index of R022",
            printed=lambda d: d.dw2 * d.v02 - d.w1**2 * d.u02,
            right=of_phasekit("R022"),
            oracle=R022,
            states=EVEN,
            written=lambda d: d.dw2 * d.v02 - d.w2**2 * d.u02,
        )
        for paper, number in ((H11, "(5.1)"), (H11, "(6.6)"), (H13, "(15)"))
    ),
    Formula(
        H11,
        "(4.3)",
        "arctan",
        printed=lambda d: np.arctan(d.w2**2 / d.dw2),
        right=lambda d: phasekit(d).gamma2,
        oracle=lambda d: np.arctan2(-(R022(d) @ d.u02), R022(d) @ d.v02),
        states=[d for d in GENERAL if d.dw2 < 0],
        right_at=[d for d in GENERAL if d.dw2 > 0],
        written=lambda d: np.arctan2(d.w2**2, d.dw2),
    ),
    *(
        Formula(
            paper,
            number,
            name,
            printed=lambda d, w=w, dw=dw: printed_gamma_rate(getattr(d, w), getattr(d, dw), JERK),
            right=lambda d, name=name, w=w: lead_of_phasekit(
                d, name, {"R01": d.w1, "R022": d.w2}[name]
            ),
            oracle=lambda d, w=w, dw=dw: gamma_rate(getattr(d, w), getattr(d, dw), JERK),
            states=GENERAL,
            written=lambda d, w=w, dw=dw: right_gamma_rate(getattr(d, w), getattr(d, dw), JERK),
        )
        for paper, number in ((H11, "(4.4)"), (H13, "(6)"))
        for name, w, dw in (("R01", "w1", "dw1"), ("R022", "w2", "dw2"))
    ),
    *(
        Formula(
            paper,
            number,
            "intensity of R012",
            printed=lambda d: 2 * d.w1 * d.w2,
            right=lambda d: phasekit(d).rotator_intensity[ROTATORS.index("R012")],
            oracle=lambda d: norm(R012(d)),
            states=[d for d in GENERAL if d.w1 * d.w2 < 0],
            right_at=[d for d in GENERAL if d.w1 * d.w2 > 0],
            written=lambda d: 2 * abs(d.w1 * d.w2),
        )
        for paper, number in ((H11, "(4.5)"), (H13, "(4)"))
    ),
    *(
        Formula(
            paper,
            number,
            "with a carrier that turns backward",
            printed=lambda d: 2 * d.w1 * np.sqrt(d.w2**2),
            right=lambda d: phasekit(d).rotator_intensity[ROTATORS.index("R012")],
            oracle=lambda d: norm(R012(d)),
            states=[d for d in EVEN if d.w1 < 0],
            right_at=[d for d in EVEN if d.w1 > 0],
        )
        for paper, number in ((H11, "(6.7)"), (H13, "(16)"))
    ),
    Formula(
        H11,
        "(4.6)",
        "index of R2",
        printed=lambda d: d.dw1 * -d.u02 - d.w1**2 * d.v02,
        right=of_phasekit("R2"),
        oracle=R2,
        states=GENERAL,
        written=lambda d: d.dw2 * -d.u02 - d.w2**2 * d.v02,
    ),
    Formula(
        H11,
        "section 5",
        "mass center",
        printed=printed_center,
        right=center_of_phasekit,
        oracle=lambda d: d.machine.C,
        states=GENERAL,
        written=right_center,
    ),
    Formula(
        H11,
        "section 5",
        "mass center in R011 of (5.1)",
        printed=lambda d: -(d.w1**2) * unit(across(printed_center(d), UP)),
        right=of_phasekit("R011"),
        oracle=R011,
        states=EVEN,
        written=lambda d: -(d.w1**2) * unit(across(right_center(d), UP)),
    ),
    *(
        Formula(
            paper,
            number,
            "R012 over the whole turn",
            printed=lambda d: -2 * d.w1 * d.w2 * ALONG,
            right=of_phasekit("R012"),
            oracle=R012,
            states=[d for d in GENERAL if not below(d)],
            right_at=[d for d in GENERAL if below(d)],
            written=lambda d: -2 * d.w1 * d.w2 * np.sign(np.cos(d.phi)) * ALONG,
        )
        for paper, number in ((H11, "(5.1)"), (H11, "(6.6)"), (H13, "(15)"))
    ),
    Formula(
        H11,
        "(5.1)",
        "R1",
        printed=printed_R1,
        right=of_phasekit("R1"),
        oracle=R1,
        states=GENERAL,
        written=right_R1,
    ),
    *(
        Formula(
            paper,
            number,
            f"R1, {word}",
            printed=lambda d, sign=sign: sign * printed_R1_even(d),
            right=of_phasekit("R1"),
            oracle=R1,
            states=EVEN,
            written=right_R1,
        )
        for paper, number in ((H11, "(6.6)"), (H13, "(15)"))
        for word, sign in (("as printed", 1), ("turned round", -1))
    ),
    Formula(
        H11,
        "(5.1)",
        "R2",
        printed=lambda d: d.dw2 * d.v02 - d.w1**2 * d.u02,
        right=of_phasekit("R2"),
        oracle=R2,
        states=GENERAL,
        written=lambda d: -d.dw2 * d.u02 - d.w2**2 * d.v02,
    ),
    *(
        Formula(
            paper,
            number,
            "R2",
            printed=lambda d: d.dw2 * d.v02 - d.w2**2 * d.u02,
            right=of_phasekit("R2"),
            oracle=R2,
            states=GENERAL,
            written=lambda d: -d.dw2 * d.u02 - d.w2**2 * d.v02,
        )
        for paper, number in ((H11, "(6.6)"), (H13, "(15)"))
    ),
    *(
        Formula(
            paper,
            number,
            "R01",
            printed=lambda d: d.w1**2 * ACROSS,
            right=of_phasekit("R01"),
            oracle=R01,
            states=[d for d in EVEN if d.a > 0],
            right_at=[d for d in EVEN if d.a < 0],
            written=lambda d: -(d.w1**2) * np.sign(d.a) * ACROSS,
        )
        for paper, number in ((H11, "(6.6)"), (H13, "(15)"))
    ),
    Formula(
        H11,
        "(5.2)",
        "direction of D_n1",
        printed=lambda d: line(printed_D1(d)),
        right=base_of_phasekit("R1"),
        oracle=lambda d: line(d.machine.D(UP)),
        states=GENERAL,
        written=lambda d: line(right_D1(d)),
    ),
    Formula(
        H11,
        "(5.2)",
        "direction of D_n2",
        printed=lambda d: line(d.v02),
        right=base_of_phasekit("R2"),
        oracle=lambda d: line(d.machine.D(ALONG)),
        states=GENERAL,
        written=lambda d: line(d.u02),
    ),
    Formula(
        H11,
        "(5.3)",
        "tg gamma1",
        printed=lambda d: d.dw1 / d.w1**2,
        right=lambda d: from_base(d, of_phasekit("R011")(d)),
        oracle=lambda d: from_base(d, R011(d)),
        states=GENERAL,
        written=lambda d: d.w1**2 / d.dw1,
    ),
    Formula(
        H11,
        "(5.3)",
        "angle of R1",
        printed=printed_tangent,
        right=lambda d: tangent(of_phasekit("R1")(d)),
        oracle=lambda d: tangent(R1(d)),
        states=GENERAL,
        written=right_tangent,
    ),
    Formula(
        H11,
        "(5.4)",
        "angle of R1",
        printed=printed_tangent,
        right=lambda d: tangent(of_phasekit("R1")(d)),
        oracle=lambda d: tangent(R1(d)),
        states=EVEN,
        written=lambda d: -d.inertia()[3] / ((d.inertia()[0] - d.inertia()[1]) * np.sin(d.phi)),
    ),
    Formula(
        H13,
        "section 6",
        "angular velocity of R011",
        printed=lambda d: d.w1,
        right=rate_of_phasekit,
        oracle=azimuth_rate,
        states=EVEN,
        written=written_azimuth_rate,
    ),
    *(
        Formula(
            paper,
            number,
            "intensity of R022",
            printed=lambda d: reduced(d)[0] * np.hypot(acceleration(d) / reduced(d)[0], d.w2**2),
            right=lambda d: phasekit(d, free=True).rotator_intensity[ROTATORS.index("R022")],
            oracle=lambda d: norm(R022(d)),
            states=FREE,
            written=lambda d: np.hypot(acceleration(d), d.w2**2),
        )
        for paper, number in ((H11, "(6.8)"), (H13, "(17)"))
    ),
    *(
        Formula(
            paper,
            number,
            "normal part of R022",
            printed=lambda d: printed_along(d, base=d.v02),
            right=lambda d: phasekit(d, free=True).rotator[ROTATORS.index("R022")],
            oracle=R022,
            states=FREE,
            written=lambda d: acceleration(d) * d.v02 + d.w2**2 * cross(ALONG, d.v02),
        )
        for paper, number in ((H11, "(6.9)"), (H13, "(18)"))
    ),
    *(
        Formula(
            paper,
            number,
            "normal part of R2",
            printed=lambda d: printed_along(d, base=-d.u02),
            right=lambda d: phasekit(d, free=True).rotator[ROTATORS.index("R2")],
            oracle=R2,
            states=FREE,
            written=lambda d: acceleration(d) * -d.u02 + d.w2**2 * cross(ALONG, -d.u02),
        )
        for paper, number in ((H11, "(6.10)"), (H13, "(18)"))
    ),
    Formula(
        H11,
        "(6.11)",
        "",
        printed=lambda d: np.array([acceleration(d), reduced(d)[0] * d.w2**2]),
        right=lambda d: np.array(phasekit(d, free=True)[-2:]),
        oracle=lambda d: np.array([R022(d) @ d.v02, R022(d) @ -d.u02]),
        states=FREE,
        written=lambda d: np.array([acceleration(d), d.w2**2]),
    ),
    Formula(
        H11,
        "(6.12)",
        "without psi",
        printed=printed_gamma2_rate,
        right=lambda d: phasekit(d, free=True).gamma2_rate,
        oracle=lambda d: gamma_rate(d.w2, d.dw2, jerk(d)),
        states=FREE,
        right_at=[d.replace(a=0.0).free() for d in EVEN],
        written=written_gamma2_rate,
    ),
]


def from_base(d: Disk, rotator: np.ndarray) -> float:
    """Return tg of the angle from the base vector [n1, O2C] to a rotator about n1."""
    base = cross(UP, d.machine.C)
    return float((rotator @ cross(UP, base)) / (rotator @ base))


@pytest.mark.slow
@pytest.mark.parametrize("formula", ERRATA, ids=str)
def test_printed_form_fails_and_the_right_one_holds(formula):
    decide(formula)


def test_direction_of_D1_is_right_for_another_angle():
    """(5.2) and (5.1) are those of a centered disk, with beta from the normal and phi from n1."""
    for d in disks(e=0.0):
        other = d.replace(beta=np.pi / 2 - d.beta, phi=d.phi - np.pi / 2)
        assert deviation(line(printed_D1(other)), line(d.machine.D(UP))) < HOLDS


def test_printed_mass_center_turns_backward():
    """About n2; with the right one a growing angle turns the disk right-handed."""
    for d in GENERAL:
        step = d.replace(phi=d.phi + 1e-3)
        assert cross(printed_center(d), printed_center(step)) @ ALONG < 0
        assert cross(right_center(d), right_center(step)) @ ALONG > 0


RIGHT_AS_PRINTED = [
    (f"{H11}-(5.1) R011", printed_R011, R011, GENERAL),
    (f"{H11}-(6.6) R011, {H13}-(15)", printed_R011, R011, EVEN),
    (f"{H11}-(4.2)", lambda d: np.hypot(d.dw1, d.w1**2), lambda d: norm(R011(d)), GENERAL),
    (f"{H11}-(4.7)", lambda d: np.hypot(d.dw2, d.w2**2), lambda d: norm(R2(d)), GENERAL),
    (
        f"{H11}-(4.9)",
        lambda d: right_gamma_rate(d.w2, d.dw2, JERK),
        lambda d: gamma_rate(d.w2, d.dw2, JERK),
        GENERAL,
    ),
    (
        f"{H11}-(5.3) angle of R011",
        lambda d: (
            (d.dw1 / d.w1**2 - np.tan(d.beta) * np.sin(d.phi))
            / (1 + d.dw1 / d.w1**2 * np.tan(d.beta) * np.sin(d.phi))
        ),
        lambda d: -tangent(R011(d)),
        GENERAL,
    ),
    (
        f"{H11}-(5.4) angle of R011",
        lambda d: -np.tan(d.beta) * np.sin(d.phi),
        lambda d: -tangent(R011(d)),
        EVEN,
    ),
]


@pytest.mark.parametrize(
    ("printed", "oracle", "states"),
    [row[1:] for row in RIGHT_AS_PRINTED],
    ids=[row[0] for row in RIGHT_AS_PRINTED],
)
def test_right_as_printed(printed, oracle, states):
    for d in states:
        assert deviation(printed(d), oracle(d)) < HOLDS
