"""Errata of the papers: the disk's equation of motion, its coefficients and its energy."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from witnesses.errata import (
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
)

import phasekit as pk
from phasekit.mechanics.bearings import bearing_forces
from phasekit.mechanics.disk import disk_coefficients, disk_eccentricity, disk_mixing

H11, H13, V15 = "HedrihVeljovic2011", "HedrihVeljovic2013", "Veljovic2015"
DRIVEN = disks()
EVEN = disks(dw1=0.0)  # the carrier turns evenly
FREE = [d.free() for d in EVEN]
CENTERED = disks(dw1=0.0, e=0.0)
ONE_AXIS = [d.replace(a=0.0) for d in EVEN]
HALF = [d.replace(e=d.r / 2) for d in EVEN]
SQUARE = disks(beta=np.pi / 2)


def phasekit(d: Disk) -> tuple[float, float, float]:
    """Return A, B, C."""
    A, B, C = disk_coefficients(d.beta, d.e, d.a, d.r, d.w1, d.g)
    return float(A), float(B), float(C)


def right_acceleration(d: Disk) -> float:
    """Return phi'' of the free motion by phasekit's coefficients."""
    A, B, C = phasekit(d)
    s, c, _, _ = d.trig
    return -B * s + A * s * c + C * c - float(disk_mixing(d.r, d.e, d.beta)) * d.dw1 * c


def acceleration(d: Disk) -> float:
    return d.free().dw2


def epsilon(d: Disk) -> float:
    return 1 + 4 * (d.e / d.r) ** 2


def spread(d: Disk, about: np.ndarray | None = None) -> float:
    """Return Ju - Jv at O2 or at another pole."""
    Ju, Jv, _, _ = d.inertia(about)
    return Ju - Jv


def printed_psi(d: Disk) -> float:
    """Return psi of [Veljovic2015] (13), [HedrihVeljovic2013] (13), [HedrihVeljovic2011] (6.3)."""
    _, _, sb, _ = d.trig
    return 2 * d.e * d.a * sb / (d.e * d.r * (epsilon(d) * sb**2 - 1))


def written_psi(d: Disk) -> float:
    _, _, sb, _ = d.trig
    eps = epsilon(d)
    return (eps - 1) * d.a * sb / (d.e * (eps * sb**2 - 1))


def written_lambda(d: Disk) -> float:
    _, _, sb, _ = d.trig
    eps = epsilon(d)
    return d.g * (eps - 1) * sb / (d.e * d.w1**2 * (eps * sb**2 - 1))


def written_square(d: Disk) -> float:
    """Return Omega^2."""
    _, _, sb, _ = d.trig
    eps = epsilon(d)
    return d.w1**2 * (eps * sb**2 - 1) / (eps * sb**2 + 1)


def in_papers_terms(d: Disk, *, psi: float, sign: int) -> float:
    s, c, _, _ = d.trig
    A, B, _ = d.coefficients()
    return -A * (B / A - c) * s + sign * A * psi * c


def moments(d: Disk, *, factor: float = 1.0, mixed: bool = True) -> float:
    """Return phi'' by [Veljovic2015] (11), the last term times a factor; mixed with J_u1n1."""
    s, c, sb, _ = d.trig
    Ju, Jv, Jn, Jvn = d.inertia()
    weight = d.m * d.g * d.e * sb * s
    carried = factor * d.m * d.e * d.a * d.w1**2 * sb * c
    return (carried - weight + (Ju - Jv) * d.w1**2 * s * c - mixed * d.dw1 * Jvn * c) / Jn


def route(d: Disk) -> float:
    """Return phi'' of (n2, dL_O1/dt) = (n2, [r_C, G]), the route of section 6."""
    x = d.machine.replace(dw2=0.0)
    y = x.replace(dw2=1.0)
    rest = ALONG @ (x.dL - cross(x.r0 + x.C, x.G))
    return float(-rest / (ALONG @ (y.dL - x.dL)))


def energy(d: Disk) -> float:
    """Return h of [Veljovic2015]; printed is twice that."""
    A, B, C = d.coefficients()
    s, c, _, _ = d.trig
    return (d.w2**2 - 2 * B * c - A * s * s - 2 * C * s) / 2


def potential(d: Disk) -> float:
    """Return E_p of [Veljovic2015] (15)."""
    A, B, C = d.coefficients()
    s, c, _, _ = d.trig
    return A / 2 * (c * c - 1) - B * c - C * s


def work(d: Disk, phi: float) -> float:
    """Return the square of the velocity at phi on the orbit through d, by quadrature of phi''."""
    nodes, weights = np.polynomial.legendre.leggauss(24)
    half = (phi - d.phi) / 2
    at = [d.replace(phi=d.phi + half * (1 + x)).free().dw2 for x in nodes]
    return d.w2**2 + 2 * half * float(weights @ at)


def printed_first_integral(d: Disk, phi: float) -> float:
    """Return [HedrihVeljovic2013] (14), [HedrihVeljovic2011] (6.4)."""
    A, B, C = d.coefficients()

    def term(x: float) -> float:
        return B * np.cos(x) - A * np.cos(x) ** 2 / 2 + C * np.sin(x)

    return d.w2**2 + 2 * term(phi) - 2 * term(d.phi)


def drive(d: Disk) -> float:
    """Return the power of the drive by phasekit."""
    args = (d.beta, d.e, d.a, d.r, d.w1, d.m, d.g, d.l, d.phi, d.w2, d.dw2, d.dw1)
    return float(bearing_forces(*args).drive_torque) * d.w1


ACCELERATION: dict[str, Any] = {"right": right_acceleration, "oracle": acceleration}
PSI: dict[str, Any] = {
    "right": lambda d: phasekit(d)[2] / phasekit(d)[0],
    "oracle": lambda d: d.coefficients()[2] / d.coefficients()[0],
    "written": written_psi,
}
ERRATA = [
    *(
        Formula(
            paper,
            number,
            "sign of psi",
            printed=lambda d: in_papers_terms(d, psi=written_psi(d), sign=-1),
            **ACCELERATION,
            states=EVEN,
            right_at=ONE_AXIS,
            written=lambda d: in_papers_terms(d, psi=written_psi(d), sign=1),
        )
        for paper, number in ((H11, "(6.1)"), (H13, "(11)"))
    ),
    *(
        formula
        for paper, number in ((H11, "(6.2)"), (H13, "(12)"))
        for formula in (
            Formula(
                paper,
                number,
                "Omega^2 at the mass center",
                printed=lambda d: d.w1**2 * spread(d, d.machine.C) / d.inertia(d.machine.C)[2],
                right=lambda d: phasekit(d)[0],
                oracle=lambda d: d.coefficients()[0],
                states=EVEN,
                right_at=CENTERED,
                written=lambda d: d.w1**2 * spread(d) / d.inertia()[2],
            ),
            Formula(
                paper,
                number,
                "lambda at the mass center",
                printed=lambda d: (
                    d.m * d.g * d.e * np.sin(d.beta) / (d.w1**2 * spread(d, d.machine.C))
                ),
                right=lambda d: phasekit(d)[1] / phasekit(d)[0],
                oracle=lambda d: d.coefficients()[1] / d.coefficients()[0],
                states=EVEN,
                written=lambda d: d.m * d.g * d.e * np.sin(d.beta) / (d.w1**2 * spread(d)),
            ),
            Formula(
                paper,
                number,
                "factor of psi",
                printed=lambda d: 2 * d.m * d.e * d.a * np.sin(d.beta) / spread(d),
                **PSI,
                states=EVEN,
            ),
        )
    ),
    *(
        Formula(paper, number, "psi", printed=printed_psi, **PSI, states=EVEN, right_at=HALF)
        for paper, number in ((H11, "(6.3)"), (H13, "(13)"), (V15, "(13)"))
    ),
    *(
        Formula(
            paper,
            section,
            "e as the distance from the shaft",
            printed=lambda d: written_lambda(d.replace(e=d.e * np.sin(d.beta))),
            right=lambda d: phasekit(d)[1] / phasekit(d)[0],
            oracle=lambda d: d.coefficients()[1] / d.coefficients()[0],
            states=EVEN,
            written=written_lambda,
        )
        for paper, section in ((H11, "section 3"), (H13, "section 2"), (V15, "section 2"))
    ),
    *(
        Formula(
            paper,
            number,
            "as the energy",
            printed=lambda d: 0.0,
            right=drive,
            oracle=lambda d: d.machine.power,
            states=FREE,
        )
        for paper, number in ((H11, "(6.4)"), (H13, "(14)"))
    ),
    Formula(
        H13,
        "section 6",
        "(2) times n2",
        printed=route,
        **ACCELERATION,
        states=EVEN,
        right_at=ONE_AXIS,
    ),
    Formula(
        V15,
        "(11)",
        "factor 2",
        printed=lambda d: moments(d, factor=2.0),
        **ACCELERATION,
        states=EVEN,
        right_at=ONE_AXIS,
        written=moments,
    ),
    Formula(
        V15,
        "(11)",
        "J_u1n1 zero, with a carrier that does not turn evenly",
        printed=lambda d: moments(d, mixed=False),
        **ACCELERATION,
        states=DRIVEN,
        right_at=[*EVEN, *SQUARE],
        written=moments,
    ),
    Formula(
        V15,
        "section 4",
        "h",
        printed=lambda d: 2 * energy(d),
        right=lambda d: (
            pk.energy(pk.Coefficients(*phasekit(d)), d.phi, d.w2).energy_integral.item()
            - phasekit(d)[0] / 2
        ),
        oracle=lambda d: work(d, 0.0) / 2 - d.coefficients()[1],
        states=FREE,
        written=energy,
    ),
]


@pytest.mark.slow
@pytest.mark.parametrize("formula", ERRATA, ids=str)
def test_printed_form_fails_and_the_right_one_holds(formula):
    decide(formula)


RIGHT_AS_PRINTED = [
    (
        f"{V15}-(12)",
        lambda d: in_papers_terms(d, psi=written_psi(d), sign=1),
        acceleration,
    ),
    (
        f"{H11}-(6.3), {H13}-(13), {V15}-(13) Omega^2 and lambda",
        lambda d: [written_square(d), written_square(d) * written_lambda(d)],
        lambda d: d.coefficients()[:2],
    ),
    (
        f"{H11}-(6.4), {H13}-(14)",
        lambda d: printed_first_integral(d, d.phi + 1.3),
        lambda d: work(d, d.phi + 1.3),
    ),
    (
        f"{V15}-(14), (15)",
        lambda d: potential(d) - potential(d.replace(phi=0.0)),
        lambda d: (work(d, 0.0) - d.w2**2) / 2,
    ),
    (
        f"{V15}-section 4 J_n2, J_v1n1",
        lambda d: [
            d.m * d.r**2 / 4 * (1 + epsilon(d) * np.sin(d.beta) ** 2),
            d.m
            * d.r**2
            / 4
            * (1 - epsilon(d) * np.sin(d.beta) ** 2)
            * np.sin(d.phi)
            * np.cos(d.phi),
        ],
        lambda d: [ALONG @ d.machine.J(ALONG), cross(ALONG, UP) @ d.machine.J(UP)],
    ),
]


@pytest.mark.parametrize(
    ("printed", "oracle"),
    [row[1:] for row in RIGHT_AS_PRINTED],
    ids=[row[0] for row in RIGHT_AS_PRINTED],
)
def test_right_as_printed(printed, oracle):
    for d in FREE:
        assert deviation(printed(d), oracle(d)) < HOLDS


def test_product_of_inertia_that_is_not_zero():
    """J_u1n1 of [Veljovic2015]: it multiplies the angular acceleration of the carrier."""
    for d in DRIVEN:
        eps, (_, c, sb, cb) = epsilon(d), d.trig
        want = ALONG @ d.machine.J(UP)
        assert deviation(d.m * d.r**2 / 4 * eps * sb * cb * c, want) < HOLDS


def test_eccentricity_is_not_e():
    """[n2, [rho_C, n2]], the papers' definition, is as long as phasekit's eccentricity."""
    for d in EVEN:
        length = norm(cross(ALONG, cross(d.machine.C, ALONG)))
        assert deviation(disk_eccentricity(d.e, d.beta), length) < HOLDS
        assert deviation(d.e, length) > 1e-2


def test_centrifugal_over_gravity():
    """psi/lambda is a omega1^2/g, whatever the disk: it shows the factor 2 at a glance."""
    for d in EVEN:
        assert deviation(written_psi(d) / written_lambda(d), d.a * d.w1**2 / d.g) < HOLDS


def test_no_eight_on_axes_that_intersect():
    """[Veljovic2015] Fig. 6 (d): with a = 0 both saddles have one energy, with a = 2 mm not."""
    disk = pk.GyroRotorDisk(beta=0.01 * np.pi, e=0.001153, a=0.0, r=0.2, omega1=2.518)
    assert pk.separatrices(disk).topology.item() == pk.Topology.HETEROCLINIC
    assert pk.separatrices(disk.replace(a=0.002)).topology.item() == pk.Topology.FIGURE_EIGHT
