"""Errata of the papers: momentum, its rate and the reactions, for any body and any axes.

Printed and right forms are built from the same mass moment vectors, so that only what is in
question differs between them; the particles of ``errata`` decide.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from witnesses import particles
from witnesses.errata import (
    HOLDS,
    UP,
    Formula,
    Machine,
    cross,
    decide,
    deviation,
    machines,
    norm,
    unit,
)

from phasekit.mechanics.general.body import RigidBody
from phasekit.mechanics.general.rotation import CoupledRotation

H11, H13, V15 = "HedrihVeljovic2011", "HedrihVeljovic2013", "Veljovic2015"
GENERAL = machines()
B1 = 0.8  # place of the second fixed bearing on n1


def orthogonal(x: Machine) -> Machine:
    """Return the machine with both axes at right angles."""
    n2 = unit(x.n2 - x.n1 * (x.n1 @ x.n2))
    return x.replace(n2=n2, r0=norm(x.r0) * unit(cross(x.n1, n2)))


ORTHOGONAL = [orthogonal(x) for x in GENERAL]


def phasekit(x: Machine) -> Any:
    """Return phasekit's state of the same machine."""
    body = RigidBody.from_points(x.masses, x.points)
    a = float(x.r0 @ unit(cross(x.n1, x.n2)))
    motion = {"omega1": x.w1, "domega1": x.dw1, "omega2": x.w2, "domega2": x.dw2}
    return CoupledRotation(body, n1=x.n1, n2=x.n2, a=a).at(**motion)


def rotator(n: np.ndarray, b: np.ndarray, w: float, dw: float) -> np.ndarray:
    """Return the rotator with the base vector b; 0 where b is, since only |b| R has a meaning."""
    return dw * unit(b) + w**2 * cross(n, unit(b)) if norm(b) else 0 * b


def coupling(x: Machine) -> np.ndarray:
    return cross(x.n1, x.J(x.n2)) + cross(x.n2, x.J(x.n1)) + x.J(cross(x.n1, x.n2))


def printed_coupling(x: Machine) -> np.ndarray:
    return 2 * cross(x.n1, x.J(x.n2))


def chi(x: Machine) -> np.ndarray:
    """Return the part of dL/dt in which the distance of the axes stands linearly."""
    S1, S2 = x.S(x.n1), x.S(x.n2)
    return (
        x.dw1 * (x.M * cross(x.C, cross(x.n1, x.r0)) + cross(x.r0, S1))
        + x.dw2 * cross(x.r0, S2)
        - x.w1**2 * x.M * (x.n1 @ x.C) * cross(x.n1, x.r0)
        + x.w2**2 * cross(x.r0, cross(x.n2, S2))
        + 2 * x.w1 * x.w2 * cross(x.r0, cross(x.n1, S2))
    )


def dL(
    x: Machine,
    coupled: Callable[[Machine], np.ndarray] = coupling,
    transport: Callable[[Machine], np.ndarray] = chi,
) -> np.ndarray:
    """Return [HedrihVeljovic2011] (3.7) with the coupling and chi12 that are given."""
    D1, D2 = x.D(x.n1), x.D(x.n2)
    return (
        transport(x)
        + x.dw1 * x.n1 * (x.r0 @ x.r0) * x.M
        + x.w1 * x.w2 * coupled(x)
        + x.dw1 * (x.n1 @ x.J(x.n1)) * x.n1
        + x.dw2 * (x.n2 @ x.J(x.n2)) * x.n2
        + norm(D1) * rotator(x.n1, D1, x.w1, x.dw1)
        + norm(D2) * rotator(x.n2, D2, x.w2, x.dw2)
    )


def printed_chi(x: Machine) -> np.ndarray:
    """Return chi12 with the printed coupling of the transport."""
    S1, S2 = x.S(x.n1), x.S(x.n2)
    printed = cross(x.r0, cross(x.n1, S2)) + cross(x.r0, cross(x.n2, S1))
    return chi(x) + x.w1 * x.w2 * (printed - 2 * cross(x.r0, cross(x.n1, S2)))


def brackets(x: Machine) -> np.ndarray:
    """Return chi12 with the brackets of (3.6) as they are expanded there."""
    n1, n2, r0, C = x.n1, x.n2, x.r0, x.C
    product = (
        cross(r0, cross(n1, cross(n2, C)))
        + cross(cross(n2, C), cross(n1, r0))
        + cross(r0, n1) * (C @ n2)
        - cross(r0, C) * (n1 @ n2)
        + n2 * (C @ cross(n1, r0))
        - C * (n2 @ cross(n1, r0))
        + cross(r0, n2) * (n1 @ C)
        - cross(r0, C) * (n1 @ n2)
    )
    return chi(x) + x.w1 * x.w2 * (x.M * product - 2 * cross(r0, cross(n1, x.S(n2))))


def dK(x: Machine, *, R01: bool = True) -> np.ndarray:
    """Return dK/dt in rotators, [HedrihVeljovic2011] (3.5); [HedrihVeljovic2013] (8) lacks R01."""
    S1, S2, arm = x.S(x.n1), x.S(x.n2), cross(x.n1, x.r0)
    return (
        R01 * x.M * norm(arm) * rotator(x.n1, arm, x.w1, x.dw1)
        + norm(S1) * rotator(x.n1, S1, x.w1, x.dw1)
        + norm(S2) * rotator(x.n2, S2, x.w2, x.dw2)
        + 2 * x.w1 * x.w2 * cross(x.n1, S2)
    )


def fixed_B(x: Machine, coupled: Callable[[Machine], np.ndarray] = coupling) -> np.ndarray:
    """Return the kinetic reaction of the bearing at B1, [HedrihVeljovic2013] (9)."""
    return cross(dL(x, coupled), x.n1) / B1


def kinetic(x: Machine) -> np.ndarray:
    """Return the kinetic reactions of the fixed bearings and the torque, by Newton and Euler."""
    return x.replace(gravity=0 * UP).reactions(1, 0.0, B1)


def deviation_couple(x: Machine) -> np.ndarray:
    """Return M_dev1 of [HedrihVeljovic2013] (10) with the right coupling, but as incomplete."""
    D1, D2 = x.D(x.n1), x.D(x.n2)
    R2 = rotator(x.n2, D2, x.w2, x.dw2)
    return (
        norm(D1) * rotator(x.n1, D1, x.w1, x.dw1)
        + norm(D2) * across(x, R2)
        + x.w1 * x.w2 * across(x, coupling(x))
        + across(x, chi(x))
    )


def across(x: Machine, v: np.ndarray) -> np.ndarray:
    """Return the part at right angles to n1."""
    return cross(x.n1, cross(v, x.n1))


def right_deviation_couple(x: Machine) -> np.ndarray:
    return deviation_couple(x) + x.dw2 * (x.n2 @ x.J(x.n2)) * across(x, x.n2)


def printed_deviation_couple(x: Machine) -> np.ndarray:
    printed = printed_coupling(x) - across(x, coupling(x))
    return right_deviation_couple(x) + x.w1 * x.w2 * printed


def relabelled(x: Machine, *, as_printed: bool) -> np.ndarray:
    """Return dL/dt by [Veljovic2015] (5): rotators of S, or of D as printed, on the moments S."""
    S1, S2, arm = x.S(x.n1), x.S(x.n2), cross(x.n1, x.r0)
    first, second = (x.D(x.n1), x.D(x.n2)) if as_printed else (S1, S2)
    R01 = rotator(x.n1, arm, x.w1, x.dw1)
    transport = (
        x.M * norm(arm) * cross(x.C, R01)
        + norm(S1) * cross(x.r0, rotator(x.n1, first, x.w1, x.dw1))
        + norm(S2) * cross(x.r0, rotator(x.n2, second, x.w2, x.dw2))
        + 2 * x.w1 * x.w2 * cross(x.r0, cross(x.n1, S2))
    )
    return dL(x, transport=lambda _: transport)


def about_O1(x: Machine) -> np.ndarray:
    """Return the left side of [Veljovic2015] (7), (8): the body as if it turned about O1."""
    y = x.replace(points=x.points + x.r0)
    J1, J2 = y.J(x.n1), y.J(x.n2)
    return (
        x.dw1 * J1
        + x.w1**2 * cross(x.n1, J1)
        + x.dw2 * J2
        + x.w2**2 * cross(x.n2, J2)
        + x.w1 * x.w2 * coupling(y)
    )


def shift(x: Machine, center: np.ndarray, *, coupled: bool) -> np.ndarray:
    """Return the term of [Veljovic2015] (7) that r0 adds: O2 does not turn with the body."""
    arm = cross(x.n2, x.r0)
    rate = x.dw2 * arm + x.w2**2 * cross(x.n2, arm)
    if coupled:
        rate = rate + 2 * x.w1 * x.w2 * cross(x.n1, arm)
    return x.M * cross(center, rate)


def R01_shift(x: Machine) -> np.ndarray:
    """Return the right side that is printed in [Veljovic2015] (8)."""
    R01 = rotator(x.n1, cross(x.n1, x.r0), x.w1, x.dw1)
    return norm(cross(x.n2, x.r0)) * x.M * cross(x.C, R01)


def along_n1(x: Machine, coupled: np.ndarray) -> float:
    """Return (10) of [Veljovic2015] times n1, for axes that intersect at right angles."""
    D2 = x.D(x.n2)
    R2 = rotator(x.n2, D2, x.w2, x.dw2)
    return float(
        x.dw1 * (x.n1 @ x.J(x.n1)) + norm(D2) * (R2 @ x.n1) + 2 * x.w1 * x.w2 * (coupled @ x.n1)
    )


def along_n2(x: Machine, coupled: np.ndarray) -> float:
    D1 = x.D(x.n1)
    R1 = rotator(x.n1, D1, x.w1, x.dw1)
    return float(
        x.dw2 * (x.n2 @ x.J(x.n2)) + norm(D1) * (R1 @ x.n2) + 2 * x.w1 * x.w2 * (coupled @ x.n2)
    )


def transferred(x: Machine, sign: int) -> np.ndarray:
    """Return J about O2 from that about O1, [HedrihVeljovic2011] (2.3), by a reading of rho_O."""
    y = x.replace(points=x.points + x.r0)
    shift = sign * x.r0
    return (
        y.J(x.n1)
        + cross(shift, y.S(x.n1))
        + x.M * cross(y.C, cross(x.n1, shift))
        + x.M * cross(shift, cross(x.n1, shift))
    )


def moments(x: Machine, *, torque: bool) -> np.ndarray:
    """Return the moments about O1 of weight, of the reactions and, if wanted, of the drive."""
    found = x.reactions(1, 0.0, B1)
    return (
        cross(x.r0 + x.C, x.G) + B1 * cross(x.n1, found[3:6]) + (found[6] * x.n1 if torque else 0)
    )


def with_drive(x: Machine) -> np.ndarray:
    state = phasekit(x)
    drive = state.drive_torque(x.G) * x.n1
    return cross(x.r0 + x.C, x.G) + B1 * cross(x.n1, state.fixed_bearings(x.G, B1).F_B1) + drive


def dL_with_rotators_of_S(x: Machine) -> np.ndarray:
    D1, D2 = x.D(x.n1), x.D(x.n2)
    return dL(x) + sum(
        norm(D) * (rotator(n, x.S(n), w, dw) - rotator(n, D, w, dw))
        for n, D, w, dw in ((x.n1, D1, x.w1, x.dw1), (x.n2, D2, x.w2, x.dw2))
    )


INTERSECTING = [x.replace(r0=0 * UP) for x in ORTHOGONAL]


def first(x: Machine) -> np.ndarray:
    """Return R011: what is left of dK/dt when the carrier turns alone and the axes intersect."""
    return x.replace(w2=0.0, dw2=0.0, r0=0 * UP).dK / (x.M * norm(cross(x.n1, x.C)))


ERRATA = [
    Formula(
        H11,
        "(3.6)",
        "coupling of the J",
        printed=lambda x: dL(x, printed_coupling),
        right=lambda x: phasekit(x).angular_momentum_rate,
        written=dL,
        oracle=lambda x: x.dL,
        states=GENERAL,
    ),
    Formula(
        H11,
        "(3.6)",
        "brackets",
        printed=lambda x: dL(x, transport=brackets),
        right=lambda x: phasekit(x).angular_momentum_rate,
        written=dL,
        oracle=lambda x: x.dL,
        states=GENERAL,
    ),
    Formula(
        H11,
        "(3.7)",
        "in orthogonal axes",
        printed=lambda x: dL(x, printed_coupling),
        right=lambda x: phasekit(x).angular_momentum_rate,
        written=dL,
        oracle=lambda x: x.dL,
        states=ORTHOGONAL,
    ),
    Formula(
        H11,
        "(3.8)",
        "coupling of the transport",
        printed=lambda x: dL(x, transport=printed_chi),
        right=lambda x: phasekit(x).angular_momentum_rate,
        written=dL,
        oracle=lambda x: x.dL,
        states=GENERAL,
        right_at=INTERSECTING,
    ),
    Formula(
        H11,
        "(4.10)",
        "as the coupling of dL/dt",
        printed=lambda x: x.w1 * x.w2 * printed_coupling(x),
        right=lambda x: x.w1 * x.w2 * phasekit(x).coupling_vector,
        written=lambda x: x.w1 * x.w2 * coupling(x),
        oracle=lambda x: x.mixed("M2"),
        states=GENERAL + ORTHOGONAL,
    ),
    Formula(
        H11,
        "(2.3)",
        "with the vector from O1 to O",
        printed=lambda x: transferred(x, 1),
        right=lambda x: (
            RigidBody.from_points(x.masses, x.points + x.r0).shifted(x.r0).inertia_moment(x.n1)
        ),
        written=lambda x: transferred(x, -1),
        oracle=lambda x: x.J(x.n1),
        states=GENERAL,
    ),
    Formula(
        H13,
        "(2)",
        "coupling",
        printed=lambda x: dL(x, printed_coupling),
        right=lambda x: phasekit(x).angular_momentum_rate,
        written=dL,
        oracle=lambda x: x.dL,
        states=ORTHOGONAL,
    ),
    Formula(
        H13,
        "(2)",
        "without the torque of the drive",
        printed=lambda x: moments(x, torque=False),
        right=with_drive,
        written=lambda x: moments(x, torque=True),
        oracle=lambda x: x.dL,
        states=GENERAL,
    ),
    Formula(
        H13,
        "(3)",
        "intensity of R011",
        printed=lambda x: (
            norm(rotator(x.n1, x.S(x.n1), x.w1, x.dw1))
            * norm(x.S(x.n1))
            / norm(x.S(x.n1) + x.M * cross(x.n1, x.r0))
        ),
        right=lambda x: phasekit(x).intensities["R011"],
        written=lambda x: norm(rotator(x.n1, x.S(x.n1), x.w1, x.dw1)),
        oracle=lambda x: norm(first(x)),
        states=GENERAL,
        right_at=INTERSECTING,
    ),
    Formula(
        H13,
        "(8)",
        "",
        printed=lambda x: -kinetic(x)[3:6] + dK(x, R01=False),
        right=lambda x: phasekit(x).fixed_bearings(0 * UP, B1).F_A1,
        written=lambda x: -fixed_B(x) + dK(x),
        oracle=lambda x: kinetic(x)[:3],
        states=GENERAL,
    ),
    Formula(
        H13,
        "(9)",
        "",
        printed=lambda x: fixed_B(x, printed_coupling),
        right=lambda x: phasekit(x).fixed_bearings(0 * UP, B1).F_B1,
        written=fixed_B,
        oracle=lambda x: kinetic(x)[3:6],
        states=GENERAL + ORTHOGONAL,
    ),
    Formula(
        H13,
        "(10)",
        "coupling",
        printed=printed_deviation_couple,
        right=lambda x: B1 * cross(x.n1, phasekit(x).fixed_bearings(0 * UP, B1).F_B1),
        written=right_deviation_couple,
        oracle=lambda x: B1 * cross(x.n1, kinetic(x)[3:6]),
        states=GENERAL + ORTHOGONAL,
    ),
    Formula(
        H13,
        "(10)",
        "without the angular acceleration about n2",
        printed=deviation_couple,
        right=lambda x: B1 * cross(x.n1, phasekit(x).fixed_bearings(0 * UP, B1).F_B1),
        written=right_deviation_couple,
        oracle=lambda x: B1 * cross(x.n1, kinetic(x)[3:6]),
        states=GENERAL + ORTHOGONAL,
    ),
    Formula(
        H13,
        "section 6",
        "(2) times n2 as the equation of motion",
        printed=lambda x: float(x.n2 @ (x.dL - cross(x.r0 + x.C, x.G))),
        right=lambda x: phasekit(x).self_torque(x.G),
        written=lambda x: x.n2 @ (x.M2 - cross(x.C, x.G)),
        oracle=lambda x: float(x.reactions(2, 0.7, -0.7)[6]),
        states=GENERAL + ORTHOGONAL,
        right_at=[x.replace(r0=0 * UP) for x in GENERAL],
    ),
    Formula(
        V15,
        "(5)",
        "rotators of D on the moments S",
        printed=lambda x: relabelled(x, as_printed=True),
        right=lambda x: phasekit(x).angular_momentum_rate,
        written=lambda x: relabelled(x, as_printed=False),
        oracle=lambda x: x.dL,
        states=GENERAL,
        right_at=INTERSECTING,
    ),
    *(
        Formula(
            V15,
            "(7)",
            f"center from O2, sign {sign:+d}",
            printed=lambda x, sign=sign: about_O1(x) - sign * shift(x, x.C, coupled=True),
            right=lambda x: phasekit(x).angular_momentum_rate,
            written=lambda x: about_O1(x) - shift(x, x.r0 + x.C, coupled=True),
            oracle=lambda x: x.dL,
            states=GENERAL,
            right_at=INTERSECTING,
        )
        for sign in (1, -1)
    ),
    *(
        Formula(
            V15,
            "(7)",
            f"without the mixed term, sign {sign:+d}",
            printed=lambda x, sign=sign: about_O1(x) - sign * shift(x, x.r0 + x.C, coupled=False),
            right=lambda x: phasekit(x).angular_momentum_rate,
            written=lambda x: about_O1(x) - shift(x, x.r0 + x.C, coupled=True),
            oracle=lambda x: x.dL,
            states=GENERAL,
            right_at=[*INTERSECTING, *(ORTHOGONAL if sign == 1 else [])],
        )
        for sign in (1, -1)
    ),
    *(
        Formula(
            V15,
            "(8)",
            f"R01, sign {sign:+d}",
            printed=lambda x, sign=sign: about_O1(x) - sign * R01_shift(x),
            right=lambda x: phasekit(x).angular_momentum_rate,
            written=lambda x: about_O1(x) - shift(x, x.r0 + x.C, coupled=True),
            oracle=lambda x: x.dL,
            states=GENERAL + ORTHOGONAL,
            right_at=INTERSECTING,
        )
        for sign in (1, -1)
    ),
    Formula(
        V15,
        "(9)",
        "intensity of R10",
        printed=lambda x: np.hypot(x.dw2, x.w2**2),
        right=lambda x: phasekit(x).intensities["R011"],
        written=lambda x: np.hypot(x.dw1, x.w1**2),
        oracle=lambda x: norm(first(x)),
        states=GENERAL,
    ),
    Formula(
        V15,
        "(9)",
        "rotators of S in (8)",
        printed=lambda x: dL_with_rotators_of_S(x),
        right=lambda x: phasekit(x).angular_momentum_rate,
        written=dL,
        oracle=lambda x: x.dL,
        states=GENERAL,
    ),
    Formula(
        V15,
        "(10)",
        "along n1",
        printed=lambda x: along_n1(x, cross(x.n1, x.J(x.n2))),
        right=lambda x: x.n1 @ phasekit(x).moment_about_O2,
        written=lambda x: along_n1(x, x.n1 * (cross(x.n1, x.n2) @ x.J(x.n1))),
        oracle=lambda x: float(x.n1 @ x.M2),
        states=INTERSECTING,
    ),
    Formula(
        V15,
        "(10)",
        "along n2",
        printed=lambda x: along_n2(x, cross(x.n1, x.J(x.n2))),
        right=lambda x: x.n2 @ phasekit(x).moment_about_O2,
        written=lambda x: along_n2(x, 0 * UP),
        oracle=lambda x: float(x.n2 @ x.M2),
        states=INTERSECTING,
    ),
]


RIGHT_AS_PRINTED: list[tuple[str, Callable[[Machine], Any], Callable[[Machine], Any]]] = [
    (f"{H11}-(2.1)", lambda x: x.M * cross(x.n1, x.C), lambda x: x.S(x.n1)),
    (
        f"{H11}-(2.4)",
        lambda x: x.replace(points=x.points - x.C).J(x.n1) + x.M * cross(x.C, cross(x.n1, x.C)),
        lambda x: x.J(x.n1),
    ),
    (f"{H11}-(2.6)", lambda x: cross(cross(x.n1, x.J(x.n1)), x.n1), lambda x: x.D(x.n1)),
    (
        f"{H11}-(3.2), {V15}-(1)",
        lambda x: x.M * cross(x.w1 * x.n1, x.r0) + x.w1 * x.S(x.n1) + x.w2 * x.S(x.n2),
        lambda x: x.K,
    ),
    (
        f"{H11}-(3.3), {V15}-(2)",
        lambda x: (
            x.w1 * x.n1 * (x.r0 @ x.r0) * x.M
            + x.w1 * x.M * cross(x.C, cross(x.n1, x.r0))
            + cross(x.r0, x.w1 * x.S(x.n1) + x.w2 * x.S(x.n2))
            + x.w1 * x.J(x.n1)
            + x.w2 * x.J(x.n2)
        ),
        lambda x: x.L,
    ),
    (
        f"{H11}-(3.4)",
        lambda x: (
            x.M * (x.dw1 * cross(x.n1, x.r0) + x.w1**2 * cross(x.n1, cross(x.n1, x.r0)))
            + x.dw1 * x.S(x.n1)
            + x.w1**2 * cross(x.n1, x.S(x.n1))
            + x.dw2 * x.S(x.n2)
            + x.w2**2 * cross(x.n2, x.S(x.n2))
            + 2 * x.w1 * x.w2 * cross(x.n1, x.S(x.n2))
        ),
        lambda x: x.dK,
    ),
    (f"{H11}-(3.5), {V15}-(3)", dK, lambda x: x.dK),
]


@pytest.mark.slow
@pytest.mark.parametrize("formula", ERRATA, ids=str)
def test_printed_form_fails_and_the_right_one_holds(formula):
    decide(formula)


@pytest.mark.parametrize(
    ("printed", "oracle"),
    [row[1:] for row in RIGHT_AS_PRINTED],
    ids=[x[0] for x in RIGHT_AS_PRINTED],
)
def test_right_as_printed(printed, oracle):
    for x in GENERAL:
        assert deviation(printed(x), oracle(x)) < HOLDS


def test_terms_of_chi12_that_are_zero():
    """[HedrihVeljovic2011] (3.8) prints four terms that always vanish, and two that cancel."""
    for x in GENERAL:
        n1, n2, r0, C = x.n1, x.n2, x.r0, x.C
        S1 = x.S(n1)
        zero = [
            cross(n1, cross(r0, S1)),
            cross(n2, cross(r0, x.S(n2))),
            cross(C, n1) * (r0 @ n2),
            cross(C, n2) * (r0 @ n1),
            n1 * (r0 @ S1) + n1 * (C @ cross(n1, r0)) * x.M,
        ]
        assert np.allclose(zero, 0, atol=1e-13)


def test_coupling_vector_in_its_three_forms():
    for x in GENERAL:
        across = cross(x.n1, x.n2)
        polar = float(x.masses @ np.sum(x.points**2, axis=1))
        stretch = (x.masses * (x.points @ across)) @ x.points
        want = x.mixed("M2") / (x.w1 * x.w2)
        assert deviation(2 * (cross(x.n2, x.J(x.n1)) + polar * across), want) < HOLDS
        assert deviation(2 * (cross(x.n1, x.J(x.n2)) - stretch), want) < HOLDS


def test_particles_agree_with_exact_derivatives():
    """The oracle of these tests in doubles against the one that differentiates positions."""
    for x in GENERAL:
        a = x.r0 @ unit(cross(x.n1, x.n2))
        exact = particles.Machine(x.masses, x.points, x.n1, x.n2, a)
        motion = exact.motion([0, x.w1, x.dw1], [0, x.w2, x.dw2])
        for got, want in (
            (x.K, particles.now(motion.K)),
            (x.L, particles.now(motion.L)),
            (x.dK, motion.dK),
            (x.dL, motion.dL),
            (x.M2, motion.M_O2),
            (x.reactions(1, 0.0, B1), flat(motion.fixed_bearings(x.G, B1))),
            (x.reactions(2, 0.7, -0.4), flat(motion.self_bearings(x.G, 0.7, -0.4))),
        ):
            assert deviation(got, np.array(want, dtype=float)) < 1e-13


def flat(found: Any) -> list[Any]:
    at_A, at_B, couple = found
    return [*at_A, *at_B, couple]
