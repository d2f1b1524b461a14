"""Coefficients of every system up to a common factor, as polynomials in its parameters.

Equilibria depend on the ratios of A, B and C only. Without their common denominator N they are
polynomials in each parameter, and in half-angle tangents of an angle. The same formulas take
floats, complex numbers (whose imaginary part carries derivatives), arrays and fractions.
"""

from __future__ import annotations

import cmath
import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from fractions import Fraction
from typing import Any

import numpy as np

#: Sine, cosine and radius of an angle, up to a common factor.
Turn = tuple[Any, Any, Any]
Values = Mapping[str, Any]
#: A polynomial of the parameters; the angle among them is given as a `Turn`.
Factor = Callable[[Values], Any]


@dataclass(frozen=True)
class Zero:
    """A factor with which B, C or both vanish."""

    factor: Factor
    of_B: bool = False
    of_C: bool = False


@dataclass(frozen=True)
class Form:
    """One kind of system.

    ``products`` gives A N, B N, C N and N > 0; ``sign_changes`` are the factors with which A
    changes sign, ``zeros`` those with which B or C vanishes and A need not.
    """

    products: Callable[[Values], tuple[Any, Any, Any, Any]]
    sign_changes: tuple[Factor, ...] = ()
    zeros: tuple[Zero, ...] = ()
    angle: str | None = None
    middle: float = 0.0  # of the angle's range, from which the half-angle is measured

    def turned(self, values: Values) -> dict[str, Any]:
        """Return the values with the angle as a `Turn`."""
        turned = dict(values)
        if self.angle is not None:
            turned[self.angle] = turn(values[self.angle])
        return turned

    def __call__(self, values: Values) -> tuple[Any, Any, Any, Any]:
        """A N, B N, C N and N at plain values."""
        return self.products(self.turned(values))

    def half_angle(self, tangent: Any) -> Turn:
        """Return the `Turn` of ``middle + 2 atan(tangent)``, without division."""
        sine, cosine = 2 * tangent, 1 - tangent * tangent
        radius = 1 + tangent * tangent
        return (cosine, -sine, radius) if self.middle else (sine, cosine, radius)


def turn(angle: Any) -> Turn:
    """Sine, cosine and radius 1 of an angle; the sine of the double nearest to pi is 0."""
    if isinstance(angle, complex):
        return cmath.sin(angle), cmath.cos(angle), 1.0
    if isinstance(angle, np.ndarray):
        return np.where(angle == np.pi, 0.0, np.sin(angle)), np.cos(angle), 1.0
    return 0.0 if angle == math.pi else math.sin(angle), math.cos(angle), 1.0


def exact(values: Values) -> dict[str, Any]:
    """Return turned values as fractions."""
    return {
        name: tuple(map(Fraction, value)) if isinstance(value, tuple) else Fraction(value)
        for name, value in values.items()
    }


def named(name: str) -> Factor:
    """Return the factor that is one parameter."""
    return lambda values: values[name]


def _disk(v: Values) -> tuple[Any, Any, Any, Any]:
    sine, cosine, radius = v["beta"]
    offset, reach = 2 * v["e"] * sine, v["r"] * cosine
    omega_sq = v["omega1"] * v["omega1"]
    return (
        omega_sq * (offset - reach) * (offset + reach),
        2 * v["g"] * offset * radius,
        2 * omega_sq * v["a"] * offset * radius,
        offset * offset + v["r"] * v["r"] * (radius * radius + sine * sine),
    )


def _particle(v: Values) -> tuple[Any, Any, Any, Any]:
    sine, cosine, radius = v["tilt"]
    omega_sq = v["omega"] * v["omega"]
    return (
        v["radius"] * omega_sq * cosine * cosine,
        _particle_B(v) * radius,
        omega_sq * v["offset"] * radius * radius,
        v["radius"] * radius * radius,
    )


def _particle_B(v: Values) -> Any:
    sine, cosine, _ = v["tilt"]
    return v["g"] * cosine + v["omega"] * v["omega"] * v["normal_offset"] * sine


#: The forms by the names of the systems.
FORMS: dict[str, Form] = {
    "GyroRotorDisk": Form(
        _disk,
        (
            lambda v: 2 * v["e"] * v["beta"][0] - v["r"] * v["beta"][1],
            lambda v: 2 * v["e"] * v["beta"][0] + v["r"] * v["beta"][1],
        ),
        (
            Zero(named("a"), of_C=True),
            Zero(named("g"), of_B=True),
            Zero(named("e"), of_B=True, of_C=True),
            Zero(lambda v: v["beta"][0], of_B=True, of_C=True),
        ),
        "beta",
        math.pi / 2,
    ),
    "Reduced": Form(
        lambda v: (v["Omega_sq"], v["lam"] * v["Omega_sq"], v["psi"] * v["Omega_sq"], 1),
        (named("Omega_sq"),),
        (Zero(named("lam"), of_B=True), Zero(named("psi"), of_C=True)),
    ),
    "Coefficients": Form(
        lambda v: (v["A"], v["B"], v["C"], 1),
        (named("A"),),
        (Zero(named("B"), of_B=True), Zero(named("C"), of_C=True)),
    ),
    "ParticleOnCircle": Form(
        _particle,
        (),
        (Zero(_particle_B, of_B=True), Zero(named("offset"), of_C=True)),
        "tilt",
    ),
    "Pendulum": Form(lambda v: (0 * v["g"], v["g"], 0 * v["g"], v["length"])),
    "StonerWohlfarth": Form(
        lambda v: (-2 * v["K"], v["h_x"], v["h_y"], 1),
        (named("K"),),
        (Zero(named("h_x"), of_B=True), Zero(named("h_y"), of_C=True)),
    ),
}
