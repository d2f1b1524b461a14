"""How many limit cycles a planar flow has at most in a rectangle, proved: Dulac-Cherkas functions.

If k psi div f + f.grad psi > 0 all over a rectangle, for some k < 0, then psi rises wherever a
motion crosses psi = 0, so no cycle does, and the divergence of |psi|^(1/k) f has one sign wherever
psi is not 0. By Green's theorem what lies between a cycle and the next ones inside of it then holds
a whole component of psi = 0, a closed curve, and no two cycles have the same: there are at most as
many cycles as closed curves psi = 0 ([Cherkas1997]). A constant psi is Bendixson's criterion.

The condition is linear in psi: linear programming finds polynomials that meet it at points, and
interval arithmetic tells whether one meets it everywhere.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from phasekit.arrays import Array
from phasekit.numerics.intervals.bounds import Bounds
from phasekit.numerics.intervals.curves import closed_curves
from phasekit.numerics.later import later
from phasekit.numerics.slopes import slope

if TYPE_CHECKING:
    import sympy as sp
else:
    sp = later("sympy")


#: Degrees of psi, each with the factors k that are tried.
TRIED: dict[int, tuple[float, ...]] = {4: (-1.0, -2.0, -0.5), 6: (-1.0, -2.0, -0.5), 8: (-1.0,)}
#: Greatest degree that is tried where no cycle was found.
FOR_NONE = 6
#: Points along a side at which the condition is asked for first, and at which it is looked at then.
ASKED, LOOKED = 20, 121
#: How often points are added at which it is not met, and how many at a time.
ROUNDS, ADDED = 6, 60
#: What must be left everywhere of the least value at the points that were asked for.
LEFT = 0.2
#: Least value that is worth a proof, and steps after which a linear program is given up.
WORTH, STEPS = 1e-6, 500
#: Bits of the coefficients of psi.
BITS = 40
#: Boxes beyond which a sign is not proved.
MOST_BOXES = 1 << 16


class Psi(NamedTuple):
    """A polynomial of the states in units of the rectangle, and its exponent."""

    factor: float
    coefficients: Array
    """Of Chebyshev polynomials of both, with the degrees as indices."""


class Rectangle(NamedTuple):
    """A planar flow in a rectangle, with rational numbers in place of doubles."""

    f: tuple[Any, Any]
    variables: tuple[Any, Any]
    low: Array
    high: Array

    @property
    def half(self) -> Array:
        """Half of its sides."""
        return 0.5 * (self.high - self.low)

    @property
    def divergence(self) -> Any:
        """The sum of the derivatives of each component by its own state."""
        return sp.Add(*map(slope, self.f, self.variables))

    def is_defined(self) -> bool:
        """Whether f is proved to have a value everywhere."""
        return self.is_positive(sp.S.One, smooth=False)

    def diverges(self) -> bool:
        """Whether the divergence is proved to have one sign, and f a value, everywhere."""
        return self.is_positive(self.divergence) or self.is_positive(-self.divergence)

    def is_positive(self, e: Any, *, smooth: bool = True) -> bool:
        """Whether a formula is proved to be positive, and f defined, everywhere.

        NoRule is raised of a function without bounds.
        """
        slopes = [slope(e, x) if smooth else sp.S.Zero for x in self.variables]
        bounds = Bounds([e, *slopes, *self.f], self.variables)
        low, high = self.low[None], self.high[None]
        while len(low):
            found, undefined = bounds(*((low[:, i], high[:, i]) for i in (0, 1)))
            least = np.array([one[0] for one in found[:3]])
            most = np.array([one[1] for one in found[:3]])
            middle = 0.5 * (low + high)
            at, _ = bounds.first(1)(*((middle[:, i], middle[:, i]) for i in (0, 1)))
            with np.errstate(all="ignore"):
                # e(m) + e'(X) (X - m), rounded outward.
                half = np.maximum(high - middle, middle - low) * (1.0 + 1e-15)
                steep = np.maximum(np.abs(least[1:]), np.abs(most[1:]))
                sway = np.sum(steep.T * half, axis=1) * (1.0 + 1e-15)
                positive = (least[0] > 0.0) | ((at[0][0] - sway > 0.0) & smooth)
            if np.any((at[0][1] <= 0.0) & ~undefined):
                return False
            rest = undefined | ~positive
            low, high = _quartered(low[rest], high[rest])
            if len(low) > MOST_BOXES:
                return False
        return True

    def rates(self, places: Array) -> tuple[Array, Array]:
        """F in units of the half rectangle, and the divergence, at points."""
        bounds = Bounds([*self.f, self.divergence], self.variables)
        x = 0.5 * (self.low + self.high) + self.half * places
        found, _ = bounds(*((x[:, i], x[:, i]) for i in (0, 1)))
        with np.errstate(all="ignore"):
            values = np.stack([0.5 * (a + b) for a, b in found], axis=1)
        return values[:, :2] / self.half, values[:, 2]

    def condition(self, psi: Psi) -> tuple[Any, Any]:
        """The formula that has to be positive, and psi itself."""
        middle, half = (
            [sp.Rational(x) for x in ends.tolist()]
            for ends in (0.5 * (self.low + self.high), self.half)
        )
        scaled = [(x - m) / h for x, m, h in zip(self.variables, middle, half, strict=True)]
        powers = _powers(psi.coefficients)
        value = _horner(powers, *scaled)
        slopes = [_horner(_derivative(powers, axis), *scaled) / half[axis] for axis in (0, 1)]
        along = sp.Add(*(f * one for f, one in zip(self.f, slopes, strict=True)))
        return sp.Rational(psi.factor) * self.divergence * value + along, value


def most_limit_cycles(plane: Rectangle, found: int) -> float:
    """How many limit cycles lie in a rectangle at most; infinite where nothing is proved.

    The search ends at so many as were found. NoRule is raised of a function without bounds.
    """
    most = np.inf
    for psi in _candidates(plane, found):
        condition, value = plane.condition(psi)
        if not plane.is_positive(condition):
            continue
        number = closed_curves(value, plane.variables, plane.low, plane.high)
        most = most if number is None else min(most, number)
        if most <= found:
            break
    return most


def rectangle(
    f: Sequence[Any], variables: Sequence[Any], values: Mapping[Any, float], low: Array, high: Array
) -> Rectangle:
    """A planar flow with the values of its parameters in it."""
    numbers = {symbol: sp.Rational(float(value)) for symbol, value in values.items()}
    one, two = (
        sp.sympify(e).xreplace({x: sp.Rational(x) for x in e.atoms(sp.Float)}).xreplace(numbers)
        for e in f
    )
    return Rectangle((one, two), (variables[0], variables[1]), low, high)


def _quartered(low: Array, high: Array) -> tuple[Array, Array]:
    middle = 0.5 * (low + high)
    parts = [
        (np.stack([a[:, 0], b[:, 1]], 1), np.stack([c[:, 0], d[:, 1]], 1))
        for a, c in ((low, middle), (middle, high))
        for b, d in ((low, middle), (middle, high))
    ]
    return np.concatenate([part[0] for part in parts]), np.concatenate([part[1] for part in parts])


# ------------------------------------------------------------------------- candidates


def _candidates(plane: Rectangle, found: int) -> Iterator[Psi]:
    """Functions that meet the condition at many points, simple ones first."""
    for degree, factors in TRIED.items():
        if not found and degree > FOR_NONE:
            return
        rows = _Rows(plane, degree)
        if not rows.usable:
            return
        # Of one sign it has no closed curve.
        pairs = [(k, 0) for k in factors] if found else [(factors[0], sign) for sign in (1, -1, 0)]
        for factor, sign in pairs:
            coefficients = rows.solved(factor, sign)
            if coefficients is not None:
                yield Psi(factor, coefficients)


class _Rows:
    """The condition at points, for psi of some degree."""

    def __init__(self, plane: Rectangle, degree: int) -> None:
        nodes = np.cos(np.pi * (np.arange(ASKED) + 0.5) / ASKED)
        even = np.linspace(-1.0, 1.0, LOOKED)
        self.places = np.concatenate([_grid(nodes), _grid(even)])
        self.asked = np.arange(ASKED**2)
        rates, self.divergence = plane.rates(self.places)
        self.usable = bool(np.isfinite(rates).all() and np.isfinite(self.divergence).all())
        self.degree = degree
        self.pairs = [(i, j) for i in range(degree + 1) for j in range(degree + 1 - i)]
        first, second = np.array(self.pairs).T
        one, two = (np.polynomial.chebyshev.chebvander(x, degree) for x in self.places.T)
        # The derivatives of Chebyshev polynomials in these.
        by = np.stack(
            [
                np.append(np.polynomial.chebyshev.chebder(unit), np.zeros(1 + (k == 0)))[
                    : degree + 1
                ]
                for k, unit in enumerate(np.eye(degree + 1))
            ],
            axis=1,
        )
        self.value = one[:, first] * two[:, second]
        self.along = (
            rates[:, :1] * (one @ by)[:, first] * two[:, second]
            + rates[:, 1:] * one[:, first] * (two @ by)[:, second]
        )
        self.size = np.hypot(*rates.T) + np.abs(self.divergence)
        self.size[self.size == 0.0] = 1.0

    def solved(self, factor: float, sign: int) -> Array | None:
        """Coefficients with which the least value is greatest; None where it is not positive."""
        from scipy.optimize import linprog

        whole = (factor * self.divergence[:, None] * self.value + self.along) / self.size[:, None]
        n, asked = len(self.pairs), self.asked
        for _ in range(ROUNDS):
            rows = [whole[asked]]
            if sign:
                rows.append(sign * self.value[asked])
            together = np.concatenate(rows)
            best = linprog(
                np.append(np.zeros(n), -1.0),
                A_ub=np.column_stack([-together, np.ones(len(together))]),
                b_ub=np.zeros(len(together)),
                bounds=[(-1.0, 1.0)] * n + [(None, None)],
                method="highs",
                options={"maxiter": STEPS},
            )
            if best.status or not best.x[-1] > WORTH:
                return None
            values = whole @ best.x[:-1]
            if values.min() > LEFT * best.x[-1]:
                found = np.zeros((self.degree + 1, self.degree + 1))
                found[tuple(np.array(self.pairs).T)] = best.x[:-1]
                return found
            asked = np.concatenate([asked, np.argsort(values)[:ADDED]])
        return None


def _grid(x: Array) -> Array:
    return np.stack(np.meshgrid(x, x, indexing="ij"), axis=-1).reshape(-1, 2)


# ------------------------------------------------------------------------- polynomials


def _powers(coefficients: Array) -> list[list[Any]]:
    """Rational coefficients of powers, by those of Chebyshev polynomials."""
    powers = np.zeros_like(coefficients)
    for k, row in enumerate(coefficients):
        own = np.polynomial.chebyshev.cheb2poly(row)
        powers[k, : len(own)] = own
    for k, column in enumerate(powers.T.copy()):
        own = np.polynomial.chebyshev.cheb2poly(column)
        powers[:, k] = 0.0
        powers[: len(own), k] = own
    scale = 2**BITS / np.max(np.abs(powers))
    return [[sp.Integer(round(x * scale)) for x in row] for row in powers.tolist()]


def _derivative(powers: list[list[Any]], axis: int) -> list[list[Any]]:
    if axis == 0:
        return [[k * c for c in row] for k, row in enumerate(powers)][1:]
    return [[k * c for k, c in enumerate(row)][1:] for row in powers]


def _horner(powers: list[list[Any]], x: Any, y: Any) -> Any:
    """A polynomial of two, as products of sums."""
    rows = []
    for row in powers:
        own = sp.S.Zero
        for c in reversed(row):
            own = own * y + c
        rows.append(own)
    value = sp.S.Zero
    for row in reversed(rows):
        value = value * x + row
    return value
