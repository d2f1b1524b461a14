"""Reference values for the tests, by ways that the kernels do not take.

Equilibria: exact integer arithmetic. With t = tan(phi/2), V' = 0 is an integer quartic; Sturm
chains isolate its real roots, bisection with integers refines them. Neither the discriminant nor
the location theorem nor floating point takes part. Separatrices: quadrature of the speed, with
turning points by bracketing of h - V. The disk: four point masses, which are equimomental to it.
Critical values: root finding on the fold condition of these coefficients.

Results are mpmath numbers. Importing this raises mpmath's precision for the whole run, because
mpmath rounds every operation, also a subtraction in a test, to the precision in force.
"""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import dataclass
from fractions import Fraction
from math import gcd
from pathlib import Path
from typing import Any

from mpmath import mp, mpf

DPS = 50
mp.dps = DPS
LABELS = ("lower_center", "lower_saddle", "upper_center", "upper_saddle")
SADDLES = ("lower", "upper")
SIDES = ("left", "right")
Poly = list[int]  # integer coefficients, highest degree first


def cases(kind: str) -> list[dict[str, Any]]:
    """Return the cases of one kind from tests/data/dynamics.json."""
    path = Path(__file__).parents[1] / "data" / "dynamics.json"
    return [case for case in json.loads(path.read_text())["cases"] if case["kind"] == kind]


def integers(*values: float) -> list[int]:
    """Return integers in the exact ratio of the given doubles."""
    ratios = [Fraction(float(value)) for value in values]
    scale = max(ratio.denominator for ratio in ratios)  # powers of two, so the largest is the lcm
    return [int(ratio * scale) for ratio in ratios]


def sign(x: Any) -> int:
    """Return the sign of a number."""
    return int(x > 0) - int(x < 0)


def delta_sign(A: float, B: float, C: float) -> int:
    """Return the exact sign of Delta = (B^2 + C^2 - A^2)^3 + 27 A^2 B^2 C^2."""
    a, b, c = (n * n for n in integers(A, B, C))
    return sign((b + c - a) ** 3 + 27 * a * b * c)


def count(A: float, B: float, C: float) -> int:
    """Return the number of distinct equilibria from the exact sign of Delta."""
    if A == B == C == 0:
        return 0
    # On the astroid its cusps are where B C = 0.
    return {-1: 4, 0: 2 if B == 0 or C == 0 else 3, 1: 2}[delta_sign(A, B, C)]


# --- integer polynomials ---------------------------------------------------------------------


def trimmed(p: Poly) -> Poly:
    """Drop leading zeros and the common factor."""
    while p and p[0] == 0:
        p = p[1:]
    factor = gcd(*p) if p else 1
    return [c // factor for c in p]


def remainder(p: Poly, q: Poly) -> Poly:
    """Return p mod q times a positive factor."""
    p = list(p)
    while len(p) >= len(q):
        lead = p[0] * sign(q[0])
        p = [abs(q[0]) * c for c in p]
        for i, c in enumerate(q):
            p[i] -= lead * c
        p = p[1:]
    return trimmed(p)


def chain(p: Poly) -> list[Poly]:
    """Return the Sturm chain of p; its last member is gcd(p, p')."""
    n = len(p) - 1
    members = [p, trimmed([c * (n - i) for i, c in enumerate(p[:-1])])]
    while members[-1]:
        members.append([-c for c in remainder(members[-2], members[-1])])
    return members[:-1]


def quotient(p: Poly, q: Poly) -> Poly:
    """Return p / q for a divisor q, up to a positive factor."""
    rest, out = [Fraction(c) for c in p], []
    for _ in range(len(p) - len(q) + 1):
        out.append(rest[0] / q[0])
        rest = [r - out[-1] * (q[i] if i < len(q) else 0) for i, r in enumerate(rest)][1:]
    scale = 1
    for c in out:
        scale *= c.denominator // gcd(scale, c.denominator)
    return trimmed([int(c * scale) for c in out])


def sign_at(p: Poly, k: int, n: int) -> int:
    """Return the sign of p(k / 2^n)."""
    value = 0
    for i, c in enumerate(p):
        value = value * k + (c << (n * i))
    return sign(value)


def variations(members: list[Poly], k: int, n: int) -> int:
    """Return the sign variations of a chain at k / 2^n."""
    signs = [s for s in (sign_at(p, k, n) for p in members) if s]
    return sum(x != y for x, y in zip(signs, signs[1:], strict=False))


@dataclass(frozen=True)
class Root:
    """A root to 2^-bits; exact where it is this very number; slope is the sign of p' at it."""

    t: mpf
    multiplicity: int
    exact: bool
    slope: int


def unit_roots(p: Poly, bits: int) -> list[Root]:
    """Return the distinct roots of p in [-1, 1]."""
    common = chain(p)[-1]
    plain = quotient(p, common)  # the same roots, all simple
    members = chain(plain) if len(plain) > 1 else [plain]
    found: list[tuple[int, int]] = []  # exact or isolated roots as (numerator, exponent)
    if sign_at(plain, -1, 0) == 0:
        found.append((-1, 0))
    work = [(-1, 1, 0)]  # half-open (lo, hi] over 2^n
    while work:
        lo, hi, n = work.pop()
        number = variations(members, lo, n) - variations(members, hi, n)
        if number == 0:
            continue
        if number > 1:
            work += [(2 * lo, lo + hi, n + 1), (lo + hi, 2 * hi, n + 1)]
            continue
        first = sign_at(plain, lo, n)
        while n < bits and sign_at(plain, hi, n) != 0:
            lo, hi, n = 2 * lo, 2 * hi, n + 1
            middle = (lo + hi) // 2
            if first == 0:  # lo is a root of its own, outside of the half-open interval
                left = variations(members, lo, n) > variations(members, middle, n)
            else:
                left = sign_at(plain, middle, n) != first
            if left:
                hi = middle
            else:
                lo, first = middle, sign_at(plain, middle, n)
        found.append((hi, n))
    out = []
    for k, n in found:  # in ((k - 2) / 2^n, k / 2^n]
        multiplicity, derived = 1, common
        while len(derived) > 1:  # the gcd has the root with one multiplicity less
            members = chain(derived)
            if variations(members, k - 2, n) == variations(members, k, n):
                break
            multiplicity, derived = multiplicity + 1, members[-1]
        beyond, exact = sign_at(p, k, n), sign_at(plain, k, n) == 0
        if exact:
            beyond = sign_at([c * (len(p) - 1 - i) for i, c in enumerate(p[:-1])], k, n)
        out.append(Root(mpf(k) / mpf(2) ** n, multiplicity, exact, beyond))
    return out


# --- equilibria ------------------------------------------------------------------------------


def potential(A: Any, B: Any, C: Any, phi: Any) -> mpf:
    """V."""
    cos, sin = mp.cos_sin(mpf(phi))
    return -mpf(B) * cos + mpf(A) / 2 * cos**2 - mpf(C) * sin


def gradient(A: Any, B: Any, C: Any, phi: Any) -> mpf:
    """V'."""
    cos, sin = mp.cos_sin(mpf(phi))
    return mpf(B) * sin - mpf(A) * sin * cos - mpf(C) * cos


def curvature(A: Any, B: Any, C: Any, phi: Any) -> mpf:
    """V''."""
    cos, sin = mp.cos_sin(mpf(phi))
    return mpf(B) * cos - mpf(A) * (cos**2 - sin**2) + mpf(C) * sin


def fourth_derivative(A: Any, B: Any, C: Any, phi: Any) -> mpf:
    """V''''."""
    cos, sin = mp.cos_sin(mpf(phi))
    return 4 * mpf(A) * (cos**2 - sin**2) - mpf(B) * cos - mpf(C) * sin


def kappa(A: Any, B: Any, C: Any, phi: Any) -> mpf:
    """Condition number of the angle of an equilibrium against relative errors of A, B, C."""
    cos, sin = mp.cos_sin(mpf(phi))
    curved = abs(curvature(A, B, C, phi))
    if curved == 0:
        return mp.inf
    return 1 + (abs(B * sin) + abs(A * sin * cos) + abs(C * cos)) / curved


def wrapped(phi: Any) -> mpf:
    """Return the angle in (-pi, pi]."""
    phi = mpf(phi)
    return phi - 2 * mp.pi * mp.ceil((phi - mp.pi) / (2 * mp.pi))


def apart(x: Any, y: Any) -> mpf:
    """Return the distance of two angles on the circle."""
    with mp.workdps(DPS):
        return abs(wrapped(mpf(x) - mpf(y)))


@dataclass(frozen=True)
class Equilibrium:
    """One equilibrium; kind is center, saddle, fold, cusp_center or cusp_saddle."""

    phi: mpf
    kind: str
    energy: mpf
    curvature: mpf


def equilibria(A: float, B: float, C: float, bits: int = 300) -> list[Equilibrium]:
    """Return all equilibria, by phi in (-pi, pi]."""
    a, b, c = integers(A, B, C)
    if a == b == c == 0:
        return []
    # V' (1 + t^2)^2 with t = tan(phi/2); with 1/t the coefficients stand in reverse
    quartic = [c, 2 * (b + a), 0, 2 * (b - a), -c]
    out = []
    with mp.workdps(max(DPS, bits // 3)):
        # |phi| <= pi/2 by t, the other half of the circle by 1/t, so that pi is an inner point
        near = [(2 * mp.atan(root.t), 1, root) for root in unit_roots(trimmed(quartic), bits)]
        far = [
            (wrapped(mp.pi - 2 * mp.atan(root.t)), -1, root)
            for root in unit_roots(trimmed(quartic[::-1]), bits)
            if not (root.exact and abs(root.t) == 1)
        ]
        for phi, direction, root in near + far:
            if root.multiplicity == 1:
                kind = "center" if root.slope * direction > 0 else "saddle"
            elif root.multiplicity == 2:
                kind = "fold"
            else:
                kind = "cusp_center" if fourth_derivative(A, B, C, phi) > 0 else "cusp_saddle"
            curved = curvature(A, B, C, phi) if root.multiplicity == 1 else mpf(0)
            out.append(Equilibrium(phi, kind, potential(A, B, C, phi), curved))
    return sorted(out, key=lambda point: point.phi)


def labelled(A: float, B: float, C: float) -> dict[str, Equilibrium]:
    """Return the equilibria by their labels: by energy, ties as the limit B, C -> 0+."""
    points = equilibria(A, B, C)
    with mp.workdps(100):
        scale = abs(mpf(A)) + abs(mpf(B)) + abs(mpf(C))
        towards = (1 if B >= 0 else -1, 1 if C >= 0 else -1)

        def order(x: Equilibrium, y: Equilibrium) -> bool:
            """Tell whether x is the lower one."""
            if abs(x.energy - y.energy) > scale * mpf(10) ** -80:
                return bool(x.energy < y.energy)
            # Mirror images: to first order in the small coefficient the energies differ by this.
            pull = [towards[0] * mp.cos(p.phi) + towards[1] * mp.sin(p.phi) for p in (x, y)]
            return bool(pull[0] > pull[1])

        out: dict[str, Equilibrium] = {}
        names = {
            "center": ("lower_center", "upper_center"),
            "saddle": ("lower_saddle", "upper_saddle"),
        }
        for kind, (lower, upper) in names.items():
            same = [point for point in points if point.kind == kind]
            if len(same) == 2:
                first = order(*same)
                out[lower], out[upper] = same if first else same[::-1]
            elif same:
                out[lower if kind == "center" else upper] = same[0]
        place = {"fold": 1, "cusp_center": 0, "cusp_saddle": 3}
        for point in points:
            if point.kind in place:
                out[LABELS[place[point.kind]]] = point
    return out


def fold_margin(A: float, B: float, C: float) -> mpf:
    """Return 1 - (|B/A|^(2/3) + |C/A|^(2/3))^(3/2), exactly 0 where Delta = 0."""
    with mp.workdps(200):
        if A == 0:
            return mp.nan if B == C == 0 else -mp.inf
        if delta_sign(A, B, C) == 0:
            return mpf(0)
        parts = [mp.cbrt(abs(mpf(x) / mpf(A))) ** 2 for x in (B, C)]
        return 1 - mp.sqrt(sum(parts)) ** 3


# --- separatrices ----------------------------------------------------------------------------


@dataclass(frozen=True)
class Saddle:
    """A saddle with what its separatrix does; pairs are (left, right)."""

    phi: mpf
    energy: mpf
    exponent: mpf
    loop: str  # lobes, winding, heteroclinic
    winding_area: mpf | None
    turning_offset: tuple[mpf, mpf] | None
    lobe_area: tuple[mpf, mpf] | None


def area(A: float, B: float, C: float, energy: mpf, nodes: list[mpf]) -> mpf:
    """Return the integral of |phi'| over consecutive intervals."""

    def speed(phi: mpf) -> mpf:
        # Rounding next to the ends may make the kinetic energy negative; its weight is nil there.
        return mp.sqrt(max(2 * (energy - potential(A, B, C, phi)), mpf(0)))

    value, error = mp.quad(speed, nodes, error=True, maxdegree=12)
    if not error <= mpf(10) ** -22 * value:
        message = f"quadrature failed for {A!r}, {B!r}, {C!r}: {error}"
        raise ArithmeticError(message)
    return value


def kinetic(A: float, B: float, C: float, s: Equilibrium) -> Callable[[mpf], mpf]:
    """Return the kinetic energy on the level of a saddle by the angle from it."""
    return lambda x: s.energy - potential(A, B, C, s.phi + x)


def bracketed(f: Callable[[mpf], mpf], x0: mpf, x1: mpf) -> mpf:
    """Return the root of f between x0 and x1, where its signs differ (Chandrupatla's method)."""
    f0, f1 = f(x0), f(x1)
    if sign(f0) == sign(f1):
        message = f"no change of sign between {x0} and {x1}"
        raise ArithmeticError(message)
    step = mpf("0.5")
    while True:
        x = x1 + step * (x0 - x1)
        fx = f(x)
        if sign(fx) == sign(f1):
            x2, f2 = x1, f1
        else:
            x2, f2, x0, f0 = x0, f0, x1, f1
        x1, f1 = x, fx
        best = x1 if abs(f1) < abs(f0) else x0
        least = mpf(10) ** (5 - mp.dps) * abs(best) / abs(x0 - x1)
        if fx == 0 or least > mpf("0.5"):
            return best
        # Inverse quadratic interpolation where it is safe, else bisection.
        xi, eta = (x1 - x0) / (x2 - x0), (f1 - f0) / (f2 - f0)
        step = mpf("0.5")
        if eta**2 < xi and (1 - eta) ** 2 < 1 - xi:
            step = f1 / (f0 - f1) * f2 / (f0 - f2)
            step += (x2 - x1) / (x0 - x1) * f1 / (f2 - f1) * f0 / (f2 - f0)
        step = min(max(step, least), 1 - least)


def separatrices(A: float, B: float, C: float) -> dict[str, Saddle]:
    """Return the saddles ("lower", "upper") with their loops; a fold's pair is left out."""
    for dps in (40, 60):
        try:
            return loops(A, B, C, dps)
        except ArithmeticError:  # small lobes and equal energies ask for more digits
            continue
    return loops(A, B, C, 90)


def loops(A: float, B: float, C: float, dps: int) -> dict[str, Saddle]:
    """Return the saddles with their loops, by this many digits."""
    by_label = labelled(A, B, C)
    ring = sorted((p for p in by_label.values() if p.kind != "fold"), key=lambda p: p.phi)
    saddles = {
        label.removesuffix("_saddle"): point
        for label, point in by_label.items()
        if point.kind in ("saddle", "cusp_saddle")
    }
    out = {}
    with mp.workdps(dps):
        turn = 2 * mp.pi
        equal = len(saddles) == 2 and (B if A > 0 else C) == 0
        for name, s in saddles.items():
            others = sorted((p.phi - s.phi) % turn for p in ring if p is not s)
            winding = offsets = areas = None
            if equal:
                gap = (saddles["upper" if name == "lower" else "lower"].phi - s.phi) % turn
                offsets = (gap - turn, gap)
                loop = "heteroclinic"
            elif name == "upper":
                loop = "winding"
                winding = area(A, B, C, s.energy, [s.phi + x for x in (0, *others, turn)])
            else:
                loop = "lobes"
                # Round the circle: this saddle, a center, the upper saddle, the other center.
                right, peak, left = others
                offsets = tuple(
                    bracketed(kinetic(A, B, C, s), lo, hi)
                    for lo, hi in ((peak - turn, left - turn), (right, peak))
                )
            if offsets is not None:
                spans = [[o - turn for o in others] + [mpf(0)], [mpf(0), *others]]
                left_nodes = [offsets[0]] + [x for x in spans[0] if x > offsets[0]]
                right_nodes = [x for x in spans[1] if x < offsets[1]] + [offsets[1]]
                areas = (
                    2 * area(A, B, C, s.energy, [s.phi + x for x in left_nodes]),
                    2 * area(A, B, C, s.energy, [s.phi + x for x in right_nodes]),
                )
            exponent = mp.sqrt(-s.curvature)
            out[name] = Saddle(s.phi, s.energy, exponent, loop, winding, offsets, areas)
    return out


# --- the disk as four point masses -----------------------------------------------------------


@dataclass(frozen=True)
class Disk:
    """Coefficients of the equation, of omega1' cos(phi), and inertia at O2 of a disk."""

    A: mpf
    B: mpf
    C: mpf
    mixing: mpf
    Ju: mpf
    Jv: mpf
    Jn: mpf
    Jvn: mpf


def disk(beta: Any, e: Any, a: Any, r: Any, omega1: Any, g: Any, m: Any = 1) -> Disk:
    """Build the disk from masses m/4 at r/sqrt(2) from its center on two diameters."""
    with mp.workdps(2 * DPS):  # A cancels where eps sin^2 beta = 1
        beta, e, a, r, omega1, g, m = (mpf(x) for x in (beta, e, a, r, omega1, g, m))
        reach = r / mp.sqrt(2)
        cos, sin = mp.cos_sin(beta)
        # (along the shaft, radial, tangential); the first diameter passes through O2
        masses = [((e + x) * cos, (e + x) * sin, y) for x, y in ((reach, 0), (-reach, 0))]
        masses += [(e * cos, e * sin, y) for y in (reach, -reach)]
        Jn = sum(q * q + w * w for _, q, w in masses) * m / 4
        mixed = sum(p * q for p, q, _ in masses) * m / 4

        def effective(cos: int, sin: int) -> mpf:
            """Potential less half omega1^2 times the moment about the vertical axis, over Jn."""
            height = sum(w * sin - q * cos for _, q, w in masses)
            moment = sum(p * p + (a + q * sin + w * cos) ** 2 for p, q, w in masses)
            return (g * height - omega1**2 * moment / 2) * m / 4 / Jn

        down, out, up, back = (effective(*x) for x in ((1, 0), (0, 1), (-1, 0), (0, -1)))
        return Disk(
            A=down + up - out - back,
            B=(up - down) / 2,
            C=(back - out) / 2,
            mixing=mixed / Jn,
            Ju=sum(p * p + q * q for p, q, _ in masses) * m / 4,
            Jv=sum(p * p + w * w for p, _, w in masses) * m / 4,
            Jn=Jn,
            Jvn=mixed,
        )


# --- critical values -------------------------------------------------------------------------


def signed_root(f: Callable[[mpf], mpf], grid: list[mpf]) -> mpf | None:
    """Return the root of f at its one change of sign on the grid."""
    values = [sign(f(x)) for x in grid]
    if 0 in values:
        return grid[values.index(0)]
    changes = [i for i, (x, y) in enumerate(zip(values, values[1:], strict=False)) if x != y]
    if len(changes) > 1:
        message = f"{len(changes)} changes of sign"
        raise ArithmeticError(message)
    return bracketed(f, grid[changes[0]], grid[changes[0] + 1]) if changes else None


def two_thirds(x: mpf) -> mpf:
    """Return |x|^(2/3) with the sign of x."""
    return mp.cbrt(abs(x)) ** 2 * sign(x)


def critical(
    coefficients: Callable[[mpf], tuple[mpf, mpf, mpf]], top: Any = None
) -> dict[str, mpf | None]:
    """Return the positive parameters of the folds (A < 0, A > 0) and of A = 0."""
    with mp.workdps(DPS):
        grid = [mpf(10) ** x for x in range(-24, 25)]
        if top is not None:
            grid = [x for x in grid if x < mpf("0.05")] + [top * x / 40 for x in range(2, 41)]

        table = {x: coefficients(x) for x in grid}

        def gap(x: mpf, side: int) -> mpf:
            A, B, C = table[x] if x in table else coefficients(x)
            return two_thirds(side * A) - two_thirds(abs(B)) - two_thirds(abs(C))

        return {
            "minus": signed_root(lambda x: gap(x, -1), grid),
            "plus": signed_root(lambda x: gap(x, 1), grid),
            "sign_change": signed_root(lambda x: (table.get(x) or coefficients(x))[0], grid),
        }


def critical_disk(parameter: str, **values: Any) -> dict[str, mpf | None]:
    """Critical values of beta (up to pi/2), e, a or omega1, the others as given."""

    def coefficients(x: mpf) -> tuple[mpf, mpf, mpf]:
        built = disk(**{**values, parameter: x})
        return built.A, built.B, built.C

    with mp.workdps(2 * DPS):
        return critical(coefficients, mp.pi / 2 if parameter == "beta" else None)


def critical_reduced(parameter: str, A: Any, B: Any, C: Any) -> dict[str, mpf | None]:
    """Critical values of lam = B/A or psi = C/A, the other one as given."""
    unit = sign(A)
    with mp.workdps(2 * DPS):
        other = abs((mpf(C) if parameter == "lam" else mpf(B)) / mpf(A))
        return critical(lambda x: (mpf(unit), x, other))


def sensitivity(f: Callable[..., mpf | None], **values: Any) -> mpf:
    """Return 1 + sum |x df/dx| / |f|: relative change of f by relative changes of its inputs."""
    with mp.workdps(DPS):
        base, total, step = f(**values), mpf(1), mpf(10) ** -18
        for name, x in values.items():
            shifted = f(**{**values, name: mpf(x) * (1 + step)})
            if base is None or shifted is None:
                return mp.inf
            total += abs(shifted - base) / step / abs(base)
        return total
