"""Fourier transforms along separatrices of (A, B, C), in closed form.

On the separatrix of a saddle let theta = phi - phi_s, u = tan(theta/2) = k^2/w. Then
``e^{i theta} = (w + i k^2)/(w - i k^2)``, with S = (A/2) sin 2 phi_s and
``D = S^2 + (B cos phi_s + C sin phi_s) k^2``:

- lobes, D > 0: ``w = S + sqrt(D) cosh kt``;
- winding, D < 0: ``w = S - sqrt(-D) sinh kt``;
- arcs to a saddle as high, D = 0: ``w = S + R e^{-kt}``, R = |S + i k^2|,

which leave the saddle to the right. All have the period 2 pi i/k in time, so that residues in one
strip give the integrals ``T_m`` of ``theta' e^{i m theta} e^{i nu t}``. The poles w = i k^2 have
``w' = k q`` with ``q^2 = -k^2 A e^{2 i phi_s}``. To the left: S -> -S and theta -> -theta.
"""

from __future__ import annotations

import cmath
import math
from typing import Any

import numpy as np
import numpy.typing as npt

from phasekit.arrays import Array, Complex
from phasekit.errors import Loop
from phasekit.numerics.compile import Outputs, inline, kernel
from phasekit.numerics.elementary import hypot
from phasekit.numerics.launch import launch

PI = math.pi
LOBES, WINDING, ARCS = int(Loop.LOBES), int(Loop.WINDING), int(Loop.HETEROCLINIC)
#: Frequencies over the exponent from which exponentials are split off before they overflow.
LARGE = 50.0
#: Below this the numerator of the double pole is summed as a series, which does not cancel.
SMALL = 1.0
TERMS = 14


@inline
def discriminant(A: float, B: float, C: float, phi: float, k2: float) -> float:
    """D = mu (A - mu), mu = B/cos phi_s, in the form that does not cancel."""
    cosine, sine = math.cos(phi), math.sin(phi)
    if A >= 0.0:
        mu = B / cosine if abs(cosine) > 1e-3 else A * cosine * cosine - k2
        return mu * (k2 + A * sine * sine)
    mu = C / sine if abs(sine) > 1e-3 else -A * sine * sine - k2
    return mu * (k2 - A * cosine * cosine)


@inline
def over_sinh(n: float, z: complex) -> tuple[complex, complex]:
    """Sinh z/sinh(pi n) and cosh z/sinh(pi n), |Re z| <= pi n; times pi n where n is 0."""
    if n == 0.0:
        return z, complex(1.0)
    if n < LARGE:
        below = math.sinh(PI * n)
        return cmath.sinh(z) / below, cmath.cosh(z) / below
    up, down = cmath.exp(z - PI * n), cmath.exp(-z - PI * n)
    return up - down, up + down


@inline
def double_pole(n: float, zeta: complex, sine: complex, cosine: complex) -> complex:
    """(cosh zeta sin n zeta - n sinh zeta cos n zeta)/sinh^3 zeta, over n where n is 0.

    ``sine`` and ``cosine`` are those of n zeta, or both times one factor, which the result has
    too.
    """
    sinh = cmath.sinh(zeta)
    cube = sinh * sinh * sinh
    if abs(zeta) * max(n, 1.0) > SMALL:
        if n == 0.0:
            return (zeta * cmath.cosh(zeta) - sinh) / cube
        return (cmath.cosh(zeta) * sine - n * sinh * cosine) / cube
    # (n^2 + 1) sum (-1)^(j+1) zeta^(2j+1)/(2j+1)! Im (n + i)^(2j), over n where n is 0
    power = complex(1.0)
    total = complex(0.0)
    factor = complex(1.0)  # zeta^(2j-2)/(2j+1)! with its sign
    for j in range(1, TERMS):
        power = power * complex(n, 1.0) * complex(n, 1.0)
        factor = factor * (complex(1.0 / 6.0) if j == 1 else -zeta * zeta / (2 * j * (2 * j + 1)))
        # Im (n + i)^(2j) over n: 2j (-1)^(j-1) at n = 0
        rise = 2.0 * j * (1.0 if j % 2 == 1 else -1.0) if n == 0.0 else power.imag
        total = total + factor * rise
    ratio = zeta / sinh if abs(zeta) > 0.0 else complex(1.0)
    return (n * n + 1.0) * total * (ratio * ratio * ratio)


@inline
def root_of(a: float) -> complex:
    """Root of a real number."""
    size = math.sqrt(abs(a))
    return complex(size, 0.0) if a >= 0.0 else complex(0.0, size)


@inline
def of_lobe(S: float, k2: float, D: float, q: complex, n: float) -> tuple[complex, ...]:
    """T_0 over -nu where n is 0, and the transforms of e^{i m theta} - 1, m = 1, 2, of a lobe."""
    k, root = math.sqrt(k2), math.sqrt(D)
    q = q if q.imag > 0.0 else -q
    x = math.asinh(hypot(k2, q.real) / root)
    y = math.atan2(q.imag, S)  # pi - Y
    plain = over_sinh(n, complex(n * y, 0.0))[0] if n > 0.0 else complex(y / PI)
    moved, even = over_sinh(n, complex(n * y, n * x) if n > 0.0 else complex(y, x))
    unit = 1.0 if n > 0.0 else 1.0 / PI
    first = -4.0 * PI * k * unit * moved / q
    g = complex(-S, k2)
    order = n if n > 0.0 else 1.0
    pole = 2j * PI * unit * (1j * order * even / (k * q * q) - g * moved / (k * q * q * q))
    return -4j * PI * math.sin(n * x) * plain, first, 2.0 * first - 4.0 * k2 * k2 * pole


@inline
def of_winding(S: float, k2: float, D: float, q: complex, n: float) -> tuple[complex, ...]:
    """T_0, and the transforms of e^{i m theta} - 1 at nu and at -nu, m = 1, 2, of a winding."""
    k, E = math.sqrt(k2), math.sqrt(-D)
    Q = q if q.real > 0.0 else -q
    sinh = 1j * Q / E
    x = math.asinh(math.copysign(hypot(sinh.real, S / E), sinh.real if sinh.real else S))
    delta = math.atan2(sinh.imag, k2 / E)
    zeta = complex(x, delta)
    ratio = zeta / sinh if abs(zeta) > 1e-8 else complex(1.0)
    if n == 0.0:
        first = -4.0 * k / E * ratio
        second = 2.0 * first + 4.0 * k2 * k2 * 2.0 / (k * E * E) * double_pole(0.0, zeta, 0j, 0j)
        return complex(2.0 * PI), first, first, second, second
    if n < LARGE:
        damp = math.exp(-0.5 * PI * n)
        sine, cosine = damp * cmath.sin(n * zeta), damp * cmath.cos(n * zeta)
    else:
        up, down = cmath.exp(n * (1j * zeta - 0.5 * PI)), cmath.exp(n * (-1j * zeta - 0.5 * PI))
        sine, cosine = (up - down) / 2j, 0.5 * (up + down)
    over = -2.0 / math.expm1(-2.0 * PI * n)  # e^{pi n}/sinh pi n
    if abs(zeta) * max(n, 1.0) <= 1e-8:
        lead = complex(-4.0 * PI * k * over * n * math.exp(-0.5 * PI * n) / E)
    else:
        lead = -4.0 * PI * k * over * sine / (E * sinh)
    if abs(zeta) * max(n, 1.0) > SMALL:
        double = double_pole(n, zeta, sine, cosine)
    else:
        double = math.exp(-0.5 * PI * n) * double_pole(n, zeta, sine, cosine)
    pole = -2.0 * PI * over * double / (k * E * E)
    back = lead, 2.0 * lead - 4.0 * k2 * k2 * pole
    small = math.exp(-PI * n)
    big = over_sinh(n, complex(n * (0.5 * PI + delta)))[0]
    less = over_sinh(n, complex(n * (0.5 * PI - delta)))[0]
    turn = cmath.exp(1j * n * x)
    plain = 2.0 * PI * (turn * big + less / turn)
    return plain, small * back[0], back[0], small * back[1], back[1]


@inline
def of_arc(S: float, k2: float, n: float) -> tuple[complex, ...]:
    """T_0, T_1, T_-1, T_2 and T_-2 of an arc to a saddle as high."""
    y = math.atan2(k2, S)  # pi - Psi
    if n == 0.0:
        plain, fall, rise = 2.0 * y, 1.0 / PI, 1.0 / PI
    else:
        plain = 2.0 * PI * over_sinh(n, complex(n * y))[0].real
        over = -2.0 / math.expm1(-2.0 * PI * n)
        fall, rise = n * over * math.exp(-n * (PI + y)), n * over * math.exp(-n * (PI - y))
    g = complex(-S, k2)
    c = g.conjugate()
    k4 = k2 * k2
    return (
        complex(plain),
        -2.0 * PI * k2 / g * fall,
        -2.0 * PI * k2 / c * rise,
        -2.0 * PI * (k2 / g - 1j * k4 * (1.0 + 1j * n) / (g * g)) * fall,
        -2.0 * PI * (k2 / c + 1j * k4 * (1.0 + 1j * n) / (c * c)) * rise,
    )


@inline
def moments(
    loop: int, side: int, A: float, S: float, k2: float, D: float, phi: float, n: float
) -> tuple[complex, complex, complex, complex, complex]:
    """T_0, T_1, T_-1, T_2, T_-2 on one side of a saddle, from ``theta = 0``."""
    way = 1.0 if side == 1 else -1.0
    k = math.sqrt(k2)
    q = 1j * k * root_of(A) * cmath.exp(1j * way * phi)
    if loop == LOBES:
        plain, first, second = of_lobe(way * S, k2, D, q, n)
        t1, t2 = -n * k * first, -0.5 * n * k * second
        m1, m2 = -t1.conjugate(), -t2.conjugate()
    elif loop == WINDING:
        plain, first, back, second, twice = of_winding(way * S, k2, D, q, n)
        t1, t2 = -n * k * first, -0.5 * n * k * second
        m1, m2 = n * k * back.conjugate(), 0.5 * n * k * twice.conjugate()
        shift = cmath.exp(-1j * n * math.asinh(way * S / math.sqrt(-D)))  # t = 0 at theta = pi
        plain, t1, m1, t2, m2 = shift * plain, shift * t1, shift * m1, shift * t2, shift * m2
    else:
        plain, t1, m1, t2, m2 = of_arc(way * S, k2, n)
    if side == 1:
        return plain, t1, m1, t2, m2
    return -plain, -m1, -t1, -m2, -t2


@inline
def means(
    loop: int, side: int, A: float, S: float, k2: float, D: float, phi: float
) -> tuple[complex, complex]:
    """Integrals of ``e^{i m theta} - 1`` over time, m = 1, 2; NaN between two saddles."""
    way = 1.0 if side == 1 else -1.0
    q = 1j * math.sqrt(k2) * root_of(A) * cmath.exp(1j * way * phi)
    first, second = complex(math.nan), complex(math.nan)
    if loop == LOBES:
        _, first, second = of_lobe(way * S, k2, D, q, 0.0)
    elif loop == WINDING:
        _, first, _, second, _ = of_winding(way * S, k2, D, q, 0.0)
    if side == 1:
        return first, second
    return first.conjugate(), second.conjugate()


#: Loops of separatrices, two a system: A, B, C of the systems, then phi, k and loop of saddles.
Loops = tuple[Array, Array, Array, Array, Array, Array]


@kernel
def kernel_transforms(
    loops: Loops, nu: Array, g0: Complex, gs: Complex, gc: Complex, g2: Complex,
    start: int, stop: int, out: Outputs,
) -> None:  # fmt: skip
    """Integrals of phi' (g0 + gs sin phi + gc cos phi + g2 sin 2 phi) e^{i nu t}."""
    A, B, C, phi, k, loop = loops
    (result,) = out
    for i in range(start, stop):
        for j in range(2):
            what, k2, at = int(loop[i, j]), k[i, j] * k[i, j], phi[i, j]
            usable = what != 0 and k2 > 0.0 and nu[i] >= 0.0
            D = discriminant(A[i], B[i], C[i], at, k2) if usable else math.nan
            usable = usable and (what != LOBES or D > 0.0) and (what != WINDING or D < 0.0)
            for side in range(2):
                result[i, j, side] = complex(math.nan, math.nan)
                if usable:
                    S = 0.5 * A[i] * math.sin(2.0 * at)
                    t0, t1, m1, t2, m2 = moments(what, side, A[i], S, k2, D, at, nu[i] / k[i, j])
                    e1 = cmath.exp(1j * at)
                    e2 = e1 * e1
                    sine = (e1 * t1 - m1 / e1) / 2j
                    cosine = 0.5 * (e1 * t1 + m1 / e1)
                    double = (e2 * t2 - m2 / e2) / 2j
                    result[i, j, side] = g0[i] * t0 + gs[i] * sine + gc[i] * cosine + g2[i] * double


@kernel
def kernel_rates(
    loops: Loops, dA: Array, dB: Array, dC: Array, start: int, stop: int, out: Outputs
) -> None:  # fmt: skip
    """Derivative of the area of the loops, minus the integral of V_p(phi) - V_p(phi_s)."""
    A, B, C, phi, k, loop = loops
    (result,) = out
    for i in range(start, stop):
        for j in range(2):
            what, k2, at = int(loop[i, j]), k[i, j] * k[i, j], phi[i, j]
            usable = what != 0 and k2 > 0.0
            D = discriminant(A[i], B[i], C[i], at, k2) if usable else math.nan
            usable = usable and (what != LOBES or D > 0.0) and (what != WINDING or D < 0.0)
            for side in range(2):
                result[i, j, side] = math.nan
                if usable:
                    S = 0.5 * A[i] * math.sin(2.0 * at)
                    first, second = means(what, side, A[i], S, k2, D, at)
                    e1 = cmath.exp(1j * at)
                    one, two = e1 * first, e1 * e1 * second
                    result[i, j, side] = (
                        dB[i] * one.real - 0.25 * dA[i] * two.real + dC[i] * one.imag
                    )


def _flat(shape: tuple[int, ...], *arrays: npt.ArrayLike, dtype: type = float) -> list[Array]:
    return [np.ascontiguousarray(np.broadcast_to(x, shape), dtype).reshape(-1) for x in arrays]


def _loops(shape: tuple[int, ...], A: Any, B: Any, C: Any, *saddles: Array) -> Any:
    """Loops of systems of a shape, one a row."""
    pairs = (x.reshape(-1, 2) for x in _flat((*shape, 2), *saddles))
    return *_flat(shape, A, B, C), *pairs


def transforms(
    A: npt.ArrayLike, B: npt.ArrayLike, C: npt.ArrayLike, phi: Array, k: Array,
    loop: npt.NDArray[Any], nu: npt.ArrayLike, *weights: npt.ArrayLike, threads: int | None = None,
) -> Complex:  # fmt: skip
    """Integrals of ``phi' (g0 + gs sin phi + gc cos phi + g2 sin 2 phi) e^{i nu t}``."""
    shape = np.broadcast_shapes(*map(np.shape, (A, B, C, nu, *weights)), np.shape(phi)[:-1])
    loops = _loops(shape, A, B, C, phi, k, loop)
    out: Complex = np.empty((len(loops[0]), 2, 2), complex)
    arrays = (loops, *_flat(shape, nu), *_flat(shape, *weights, dtype=complex))
    launch(kernel_transforms, arrays, len(out), ((out,),), threads)
    return out.reshape(*shape, 2, 2)


def area_rates(
    A: npt.ArrayLike, B: npt.ArrayLike, C: npt.ArrayLike, phi: Array, k: Array,
    loop: npt.NDArray[Any], dA: npt.ArrayLike, dB: npt.ArrayLike, dC: npt.ArrayLike, *,
    threads: int | None = None,
) -> Array:  # fmt: skip
    """Rates at which the areas of the loops change while the coefficients do, 1/s^2.

    Arguments as of `transforms`; dA, dB, dC are the rates of the coefficients, 1/s^3. Axes saddle
    and side last. NaN of arcs between two saddles, whose energies part.
    """
    shape = np.broadcast_shapes(*map(np.shape, (A, B, C, dA, dB, dC)), np.shape(phi)[:-1])
    loops = _loops(shape, A, B, C, phi, k, loop)
    out = np.empty((len(loops[0]), 2, 2))
    arrays = (loops, *_flat(shape, dA, dB, dC))
    launch(kernel_rates, arrays, len(out), ((out,),), threads)
    return out.reshape(*shape, 2, 2)
