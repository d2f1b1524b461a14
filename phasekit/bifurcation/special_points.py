"""The registry of special points: one entry a kind, read by the engines, files, pictures, docs.

A kind that has no entry cannot be: a special point of it is refused where it is made. Labels are
the field's ([Kuznetsov2004]; the names that AUTO and MatCont use).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Literal, Protocol, TypeVar

#: What `detect=` asks for.
Group = Literal["fold", "branch_point", "hopf", "neutral_saddle"]
#: Curves in two parameters: of equilibria, of periodic orbits.
Curve = Literal[
    "fold",
    "branch_point",
    "hopf",
    "fold_of_cycles",
    "period_doubling",
    "torus",
    "cycle_branch_point",
    "event",
]


@dataclass(frozen=True)
class PointKind:
    """A kind of special point: what it is called, what it means, how it is found and drawn."""

    name: str
    label: str
    meaning: str
    #: The function whose sign changes along a branch, and the equations that are solved then.
    test: str
    system: str
    #: Coefficients of its normal form.
    normal_form: tuple[str, ...] = ()
    #: matplotlib's marker, its size, and the color inside, by its name in the palette.
    marker: str = ""
    size: float = 7.0
    face: str = "white"
    #: What has to be detected for it to be looked for; None: whatever is.
    detected: Group | None = "branch_point"
    #: The curve of its kind in two parameters.
    curve: Curve | None = None
    found_by: tuple[str, ...] = ("continuation",)
    #: How many eigenvalues or multipliers cross; None: as many as f_x has null vectors there.
    crossing: int | None = None


KINDS: dict[str, PointKind] = {}


def register(kind: PointKind) -> PointKind:
    """Add a kind.

    Raises
    ------
    ValueError
        If its name is taken.

    Examples
    --------
    >>> register(KINDS["fold"])
    Traceback (most recent call last):
    ValueError: the special point 'fold' is registered already
    """
    if kind.name in KINDS:
        raise ValueError(f"the special point {kind.name!r} is registered already")
    KINDS[kind.name] = kind
    return kind


class PointTest(Protocol):
    """A function along what is followed, whose zeros are special points of a kind."""

    @property
    def kind(self) -> str:
        """Of the registry."""

    @property
    def along(self) -> int | str:
        """Along what it is looked for: equilibria, a curve of a kind, cycles, a curve of these."""


TESTS: list[PointTest] = []
T = TypeVar("T", bound=PointTest)


def look_for(test: T) -> T:
    """Look for the zeros of one more function along branches, curves or families.

    Raises
    ------
    ValueError
        If its kind is not registered.
    """
    if test.kind not in KINDS:
        raise ValueError(f"no special point is a {test.kind!r}")
    TESTS.append(test)
    return test


def functions_along(along: int | str) -> list[Any]:
    """The functions that are looked for along something."""
    return [test for test in TESTS if test.along == along]


def looked_for(along: int | str) -> tuple[str, ...]:
    """Kinds that are looked for along something by a function of theirs."""
    return tuple(dict.fromkeys(test.kind for test in functions_along(along)))


BOTH = ("continuation", "branches")
EXACT = ("branches",)

for _kind in (
    PointKind(
        "fold", "LP", "two equilibria merge and vanish: the branch turns back in the parameter",
        "part of the tangent along the parameter", "f = 0, f_x v = 0, |v| = 1",
        ("a", "b"), "s", 7, "YELLOW", "fold", "fold", BOTH,
    ),
    PointKind(
        "branch_point", "BP", "branches cross; their kind of crossing is not decided",
        "determinant of f_u, bordered by the tangent", "f + b w = 0, w f_u = 0, |w| = 1",
        (), "X", 8, "PURPLE", "branch_point", "branch_point", BOTH,
    ),
    PointKind(
        "pitchfork", "BP", "three equilibria merge into one, on two branches that cross",
        "as of a branch point", "as of a branch point",
        ("c", "d"), "^", 8, "PURPLE", "branch_point", "branch_point", BOTH,
    ),
    PointKind(
        "transcritical", "BP", "two branches cross and exchange their types",
        "as of a branch point", "as of a branch point",
        ("a", "d"), "X", 8, "GREEN", "branch_point", "branch_point", BOTH,
    ),
    PointKind(
        "hopf", "H", "a pair of eigenvalues crosses the imaginary axis; periodic orbits begin",
        "real part of the complex pair next to the axis", "f = 0, (f_x^2 + k) v = 0, |v| = 1",
        ("l1", "omega", "d"), "o", 7, "GREEN", "hopf", "hopf", crossing=2,
    ),
    PointKind(
        "neutral_saddle", "NS",
        "two real eigenvalues sum to zero: no bifurcation, only next to one",
        "sum of two real eigenvalues", "as of a Hopf point, with k < 0",
        (), "D", 6, "white", "neutral_saddle", "hopf",
    ),
    PointKind(
        "cusp", "CP", "two folds meet: three equilibria merge into one",
        "quadratic coefficient of the fold", "fold, and the coefficient is zero",
        ("c",), "*", 12, "ORANGE", None, None, BOTH,
    ),
    PointKind(
        "bogdanov_takens", "BT", "a double eigenvalue zero: a fold and a Hopf curve meet",
        "w v of the fold; k of the Hopf point", "fold, and w v = 0; Hopf point, and k = 0",
        ("a", "b"), "P", 9, "SKY", "hopf",
    ),
    PointKind(
        "generalized_hopf", "GH", "the first Lyapunov coefficient of a Hopf point is zero",
        "first Lyapunov coefficient", "Hopf point, and l1 = 0",
        ("l2", "omega"), "h", 9, "SKY", None,
    ),
    PointKind(
        "zero_hopf", "ZH", "an eigenvalue zero beside a pair on the imaginary axis",
        "determinant of f_x along a Hopf curve, real part of a pair along folds",
        "Hopf point and fold", ("b", "c", "d", "e", "theta", "omega"), "X", 9, "SKY", None,
    ),
    PointKind(
        "hopf_hopf", "HH", "two pairs of eigenvalues on the imaginary axis",
        "real part of another pair along a Hopf curve", "Hopf point, and another pair",
        ("p11", "p12", "p21", "p22", "theta", "delta", "omega1", "omega2"), "v", 8, "SKY", None,
    ),
    PointKind(
        "fold_of_cycles", "LPC", "two periodic orbits merge and vanish",
        "derivative of the characteristic polynomial of the multipliers at 1",
        "the orbit, and a multiplier 1 beside the trivial one", ("a", "b"), "s", 7, "white", None,
        "fold_of_cycles", crossing=1,
    ),
    PointKind(
        "period_doubling", "PD", "a multiplier passes -1; orbits of twice the period begin",
        "determinant of M + 1", "the orbit, and a multiplier -1", ("c",), "d", 8, "ORANGE",
        "branch_point",
        "period_doubling", crossing=1,
    ),
    PointKind(
        "torus", "TR", "a pair of multipliers passes the unit circle; a torus begins",
        "bialternate product of M less 1, real pairs apart",
        "the orbit, and a pair of multipliers on the circle", ("d", "angle"), "o", 7, "SKY",
        "hopf", "torus", crossing=2,
    ),
    PointKind(
        "resonance_1", "R1", "two multipliers of a map or cycle are 1; fold and torus curve meet",
        "w v of the fold; angle of the pair", "fold, and w v = 0; torus point, and the angle is 0",
        ("a", "b"), "P", 9, "GREEN", None,
    ),
    PointKind(
        "resonance_2", "R2", "two multipliers of a map or cycle are -1; flip and torus curve meet",
        "w v of the period doubling; angle of the pair",
        "period doubling, and w v = 0; torus point, and the angle is half a turn",
        ("c", "d"), "P", 9, "ORANGE", None,
    ),
    PointKind(
        "resonance_3", "R3", "a pair of multipliers of a map or cycle at a third of a turn",
        "angle of the pair", "torus point, and the angle is a third of a turn",
        ("a",), "^", 8, "SKY", None,
    ),
    PointKind(
        "resonance_4", "R4", "a pair of multipliers of a map or cycle at a quarter of a turn",
        "angle of the pair", "torus point, and the angle is a quarter of a turn",
        ("a", "b"), "s", 8, "SKY", None,
    ),
    PointKind(
        "fold_flip", "LPPD", "multipliers 1 and -1 of a map or cycle together",
        "product of 1 + mu along folds, of mu - 1 along period doublings",
        "fold and period doubling", ("a", "b", "e"), "X", 9, "ORANGE", None,
    ),
    PointKind(
        "generalized_flip", "GPD", "c of a period doubling of a map or cycle is zero",
        "c of the period doubling", "period doubling, and c = 0", ("e",), "h", 9, "ORANGE", None,
    ),
    PointKind(
        "chenciner", "CH", "the coefficient d of a torus point of a map or cycle is zero",
        "d of the torus point", "torus point, and d = 0", ("e", "angle"), "H", 9, "GREEN", None,
    ),
    PointKind(
        "cycle_branch_point", "BPC", "families of periodic orbits cross",
        "determinant of the collocation equations, bordered", "as of a fold of cycles, with one "
        "null vector more", ("d", "a", "c"), "^", 8, "white", None, "cycle_branch_point",
        crossing=1,
    ),
    PointKind(
        "neutral_saddle_loop", "NSS",
        "the leading eigenvalues of a connection, both real, sum to zero",
        "sum of the leading eigenvalues", "the connection, and that is zero",
        (), "p", 8, "YELLOW", None, crossing=0,
    ),
    PointKind(
        "neutral_saddle_focus_loop", "NSF",
        "the leading real parts of a connection, one of a pair, sum to zero",
        "sum of the leading real parts", "the connection, and that is zero",
        (), "p", 8, "SKY", None, crossing=0,
    ),
    PointKind(
        "double_leading_stable", "DRS",
        "the two leading stable eigenvalues of a connection meet",
        "square of their difference", "the connection, and that is zero",
        (), "<", 8, "SKY", None, crossing=0,
    ),
    PointKind(
        "double_leading_unstable", "DRU",
        "the two leading unstable eigenvalues of a connection meet",
        "square of their difference", "the connection, and that is zero",
        (), ">", 8, "SKY", None, crossing=0,
    ),
    PointKind(
        "neutrally_divergent_stable", "NDS",
        "the sum of a leading stable pair and the leading unstable one is zero",
        "that sum", "the connection, and that is zero",
        (), "<", 8, "YELLOW", None, crossing=0,
    ),
    PointKind(
        "neutrally_divergent_unstable", "NDU",
        "the sum of a leading unstable pair and the leading stable one is zero",
        "that sum", "the connection, and that is zero",
        (), ">", 8, "YELLOW", None, crossing=0,
    ),
    PointKind(
        "orbit_flip_stable", "OFS",
        "a connection arrives along another direction than the leading one",
        "part of its end along the leading eigenvector", "the connection, and that is zero",
        (), "<", 8, "GREEN", None, crossing=0,
    ),
    PointKind(
        "orbit_flip_unstable", "OFU",
        "a connection leaves along another direction than the leading one",
        "part of its beginning along the leading eigenvector", "the connection, and that is zero",
        (), ">", 8, "GREEN", None, crossing=0,
    ),
    PointKind(
        "inclination_flip_stable", "IFS",
        "the stable manifold of a connection comes to its source along the leading stable one",
        "part of the normal at its beginning along the leading stable eigenvector",
        "the connection, and that is zero",
        (), "<", 8, "VERMILLION", None, crossing=0,
    ),
    PointKind(
        "inclination_flip_unstable", "IFU",
        "the unstable manifold of a connection comes to its target along the leading unstable one",
        "part of the normal at its end along the leading unstable eigenvector",
        "the connection, and that is zero",
        (), ">", 8, "VERMILLION", None, crossing=0,
    ),
    PointKind(
        "no_force", "NF", "A = B = C = 0: every angle is an equilibrium",
        "exact zeros of A, B and C", "A = B = C = 0", (), "o", 6, "white", None, None, EXACT,
    ),
    PointKind(
        "event", "UZ", "a function of the user is zero", "the function itself",
        "the curve, and the function is zero", (), "v", 8, "YELLOW", None, "event",
    ),
    PointKind(
        "end", "EP", "the end of the branch; its message says why", "", "",
        detected=None, found_by=BOTH,
    ),
):  # fmt: skip
    register(_kind)
