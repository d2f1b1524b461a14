"""Families of periodic orbits at a Hopf point: one, or those of several pairs at once.

Of k pairs at one frequency, with a the coordinates on their eigenvectors, small orbits
x = 2 Re(a exp(i (omega + sigma) t)) solve the reduced equations ([GolubitskyStewartSchaeffer1988])

    s D a - i sigma a + N(a, a, a*) = 0,   s = p - p0,

with D the rates at which the matrix grows, and N the cubic terms on the center manifold; of k = 1
N is omega l1 and its imaginary part. Rays of isolated solutions are families. Of pairs at several
frequencies each has its own, but where a multiple of it is another one.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from phasekit.arrays import Array, Complex
from phasekit.bifurcation.continuation import normal_form as forms
from phasekit.bifurcation.continuation.curve import Curve

CRITICAL = 1e-6  # real part beside the largest eigenvalue of pairs that are on the axis
STILL = 1e-9  # speed beside that of others of a pair that stays on the axis
INDEPENDENT = 1e-6  # product of left and right null vectors from which on there is a full set
MULTIPLES = (2, 3)  # of a frequency at which another pair takes part in the reduced equations
REGULAR = 1e-5  # singular value from which on a solution of the reduced equations is isolated
STEPS = 40  # of Newton's method
STARTS = 60  # directions to start from, for each pair


@dataclass(frozen=True)
class Family:
    """A family of small orbits: frequency, x = 2 Re(a v exp(i t)), changes of p and omega."""

    omega: float
    vector: Complex
    bend: tuple[float, float]  # by what p and omega change with the square of the amplitude a


def critical_pairs(values: Complex) -> npt.NDArray[np.intp]:
    """Places of the eigenvalues on the upper half of the imaginary axis, the nearest first."""
    above = np.flatnonzero(values.imag > 0.0)
    above = above[np.argsort(np.abs(values.real[above]))]
    size = float(np.max(np.abs(values), initial=0.0))
    return above[np.abs(values.real[above]) <= CRITICAL * size]


def families(curve: Curve, u: Array) -> tuple[list[Family], tuple[str, ...]]:
    """All isolated families at a Hopf point with several pairs; of others what is to be said."""
    d = forms.Derivatives(curve, u)
    n = curve.n
    scale = curve.scale[:n]
    A = d.slopes[:, :n] * scale / scale[:, None]
    values = np.linalg.eigvals(A).astype(complex)
    omegas = np.sort(values.imag[critical_pairs(values)])
    size = float(np.max(np.abs(values)))
    groups = np.split(omegas, np.flatnonzero(np.diff(omegas) > CRITICAL * size) + 1)
    found: list[Family] = []
    said: list[str] = []
    for group in groups:
        omega, count = float(np.mean(group)), len(group)
        resonant = [k for k in MULTIPLES if np.any(np.abs(omegas - k * omega) <= CRITICAL * size)]
        if resonant:
            said.append(
                f"the families of omega = {omega:.9g} are not told: {resonant[0]} omega is the "
                "frequency of another pair"
            )
            continue
        own, why = _of_one_frequency(d, A, scale, omega, count)
        found += own
        said += [f"omega = {omega:.9g}: {why}"] if why else []
    return found, tuple(said)


def _of_one_frequency(
    d: forms.Derivatives, A: Array, scale: Array, omega: float, count: int
) -> tuple[list[Family], str]:
    """The families of the pairs at one frequency, and what is to be said of them."""
    left, sizes, right = np.linalg.svd(A - 1j * omega * np.eye(len(A)))
    q = np.conj(right[len(A) - count :]).T
    p = np.conj(left[:, len(A) - count :]).T
    product = p @ q
    least = float(np.linalg.svd(product, compute_uv=False)[-1])
    if least < INDEPENDENT or sizes[len(A) - count] > CRITICAL * max(sizes[0], omega):
        return [], "the pairs have fewer eigenvectors than there are of them"
    q, p = q * scale[:, None], np.asarray(np.linalg.solve(product, p) / scale, dtype=complex)
    motion = forms.motion(d)
    D = np.stack([p @ d.second(one, motion).value for one in q.T], axis=1)
    if np.max(np.abs(np.linalg.eigvals(D).real)) <= STILL * np.linalg.norm(A):
        return [], "the pair stays on the imaginary axis when the parameter moves"
    N = _cubic(d, q, p, omega)
    rays, loose = _rays(D, N)
    made = [Family(omega, q @ a, (s, sigma)) for a, s, sigma in rays]
    why = "there are families that are not isolated, which are not followed" if loose else ""
    return made, why


def _cubic(d: forms.Derivatives, q: Complex, p: Complex, omega: float) -> Complex:
    """N(a, b, c*) on the eigenvectors, symmetric in a and b; what errors make of zeros is none."""
    n, k = q.shape
    A = d.slopes[:, :n]
    shifted = 2j * omega * np.eye(n) - A
    found = np.empty((k, k, k, k), dtype=complex)
    for c in range(k):
        bar = np.conj(q[:, c])
        still = [np.linalg.solve(A, d.second(one, bar).value) for one in q.T]
        for a in range(k):
            for b in range(a + 1):
                double = np.linalg.solve(shifted, d.second(q[:, a], q[:, b]).value)
                terms = (
                    d.third(q[:, a], q[:, b], bar), d.second(bar, double),
                    -1.0 * d.second(q[:, a], still[b]), -1.0 * d.second(q[:, b], still[a]),
                )  # fmt: skip
                total = p @ sum(one.value for one in terms)
                slack = sum(4.0 * one.error + forms.ROUNDED * np.abs(one.value) for one in terms)
                total[np.abs(total) <= np.abs(p) @ slack] = 0.0
                found[:, a, b, c] = found[:, b, a, c] = 0.5 * total
    return found


def _rays(D: Complex, N: Complex) -> tuple[list[tuple[Complex, float, float]], bool]:
    """Isolated solutions (a, s, sigma) with |a| = 1, one for all phases; and whether others are."""
    k = len(D)
    rate, size = float(np.max(np.abs(D))), float(np.max(np.abs(N)))
    size = size or 1.0
    D, N = D / rate, N / size
    a = _starts(k)
    z = np.hstack([a.real, a.imag, np.zeros((len(a), 2))])
    value, jacobian = _system(D, N, z)
    for i in range(len(z)):  # the best s and sigma of each start
        z[i, 2 * k :] = -np.linalg.lstsq(jacobian[i, :-1, 2 * k :], value[i, :-1], rcond=None)[0]
    for _ in range(STEPS):
        value, jacobian = _system(D, N, z)
        # The shortest step: phases are free.
        step = (np.linalg.pinv(jacobian, rcond=1e-12) @ value[:, :, None])[:, :, 0]
        length = np.linalg.norm(step, axis=1, keepdims=True)
        z -= step * np.minimum(1.0, 0.5 / np.maximum(length, 1e-300))
    value, jacobian = _system(D, N, z)
    z = z[np.max(np.abs(value), axis=1) < 1e-11]
    _, jacobian = _system(D, N, z)
    regular = np.linalg.svd(jacobian, compute_uv=False)[:, -1] > REGULAR
    found: list[tuple[Complex, float, float]] = []
    for one in z[regular]:
        a = one[:k] + 1j * one[k : 2 * k]
        a = a / np.linalg.norm(a)
        if all(abs(np.vdot(a, other)) < 1.0 - 1e-8 for other, _, _ in found):
            s, sigma = one[2 * k :] * size / (rate, 1.0)
            found.append((a, float(s), float(sigma)))
    return found, not bool(regular.all())


def _system(D: Complex, N: Complex, z: Array) -> tuple[Array, Array]:
    """The reduced equations with |a| = 1 of many (Re a, Im a, s, sigma), and their derivatives."""
    k = len(D)
    a, s, sigma = z[:, :k] + 1j * z[:, k : 2 * k], z[:, 2 * k, None], z[:, 2 * k + 1, None]
    bar = np.conj(a)
    linear = s[:, :, None] * D - 1j * sigma[:, :, None] * np.eye(k)
    once = 2.0 * np.einsum("jabc,sb,sc->sja", N, a, bar)
    twice = np.einsum("jabc,sa,sb->sjc", N, a, a)
    grown, turned = a @ D.T, -1j * a
    value = (linear @ a[:, :, None])[:, :, 0] + 0.5 * (once @ a[:, :, None])[:, :, 0]
    by_real, by_imaginary = linear + once + twice, 1j * (linear + once - twice)
    matrix = np.concatenate([by_real, by_imaginary, grown[:, :, None], turned[:, :, None]], axis=2)
    row = np.concatenate([a.real, a.imag, np.zeros((len(z), 2))], axis=1)[:, None]
    norm = 0.5 * (np.sum(np.abs(a) ** 2, axis=1, keepdims=True) - 1.0)
    values = np.concatenate([value.real, value.imag, norm], axis=1)
    return values, np.concatenate([matrix.real, matrix.imag, row], axis=1)


def _starts(k: int) -> Complex:
    """Directions to start from: along the axes, and many at random."""
    generator = np.random.default_rng(0)
    many = generator.normal(size=(STARTS * (k - 1), k)) + 1j * generator.normal(
        size=(STARTS * (k - 1), k)
    )
    starts = np.concatenate([np.eye(k, dtype=complex), many])
    return np.asarray(starts / np.linalg.norm(starts, axis=1, keepdims=True))
