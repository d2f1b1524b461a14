"""Systems to try: random ones and those where floating point is known to break."""

from __future__ import annotations

import os
from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
System = tuple[Array, Array, Array]


def number_of_systems() -> int:
    """Return how many systems the property tests try; PHASEKIT_SYSTEMS overrides it."""
    return int(os.environ.get("PHASEKIT_SYSTEMS", "20000"))


def signs(rng: np.random.Generator, n: int) -> Array:
    return rng.choice([-1.0, 1.0], n)


def distances(rng: np.random.Generator, n: int) -> Array:
    """Return relative distances from 1e-15 to 1e-1 with both signs."""
    return signs(rng, n) * 10.0 ** rng.uniform(-15, -1, n)


def scales(rng: np.random.Generator, n: int) -> Array:
    return 10.0 ** rng.uniform(-3, 3, n)


def generic(rng: np.random.Generator, n: int) -> System:
    """Within a factor of 10 of each other."""
    A, B, C = (signs(rng, n) * 10.0 ** rng.uniform(-0.5, 0.5, n) for _ in range(3))
    return A, B, C


def inside(rng: np.random.Generator, n: int) -> System:
    """Four equilibria."""
    A = signs(rng, n) * scales(rng, n)
    theta, size = rng.uniform(0, np.pi / 2, n), rng.uniform(0.01, 0.99, n)
    B = signs(rng, n) * np.abs(A) * size * np.cos(theta) ** 3
    C = signs(rng, n) * np.abs(A) * size * np.sin(theta) ** 3
    return A, B, C


def ratios(rng: np.random.Generator, n: int) -> System:
    """Forty orders of magnitude between the coefficients."""
    A, B, C = (signs(rng, n) * 10.0 ** rng.uniform(-20, 20, n) for _ in range(3))
    return A, B, C


def near_folds(rng: np.random.Generator, n: int) -> System:
    """At 1e-15 to 1e-1 from the fold curve, on either side; a third of them towards its cusps."""
    A = signs(rng, n) * scales(rng, n)
    theta = rng.uniform(0.05, np.pi / 2 - 0.05, n)
    towards = 10.0 ** rng.uniform(-8, -1, n)
    theta = np.choose(rng.integers(0, 6, n) % 3, [theta, theta, towards])
    theta = np.where(rng.random(n) < 0.5, theta, np.pi / 2 - theta)
    size = np.abs(A) * (1 + distances(rng, n))
    B, C = np.abs(np.cos(theta)) ** 3 * size, np.abs(np.sin(theta)) ** 3 * size
    return A, signs(rng, n) * B, signs(rng, n) * C


def near_cusps(rng: np.random.Generator, n: int) -> System:
    """At 1e-15 to 1e-1 from a cusp in both directions, and inside the tongue at it."""
    A = signs(rng, n) * scales(rng, n)
    eta = distances(rng, n)
    large = np.abs(A) * (1 + eta)
    # The tongue of four equilibria is |small| < (2/3 |eta|)^(3/2).
    tongue = (2 / 3 * np.abs(eta)) ** 1.5 * rng.uniform(0, 2, n)
    small = np.abs(A) * np.where(rng.random(n) < 0.5, tongue, np.abs(distances(rng, n)))
    small *= rng.random(n) > 0.1
    swap = rng.random(n) < 0.5
    B, C = np.where(swap, small, large), np.where(swap, large, small)
    return A, signs(rng, n) * B, signs(rng, n) * C


def zeros(rng: np.random.Generator, n: int) -> System:
    """One or two coefficients are zero, of either sign."""
    system = np.array(inside(rng, n))
    system[0] *= 10.0 ** rng.uniform(-1, 1, n)
    columns = np.arange(n)
    for chance in (1.0, 0.3):
        hit = rng.random(n) < chance
        system[rng.integers(0, 3, n)[hit], columns[hit]] = 0.0
    system[:, np.all(system == 0, axis=0)] = np.array([[1.0], [0.0], [0.0]])
    system *= signs(rng, n)  # gives -0.0 too
    return system[0], system[1], system[2]


def tiny(rng: np.random.Generator, n: int) -> System:
    """One coefficient is 1e-1 to 1e-15 or about 1e-300 of the others."""
    system = np.array(inside(rng, n))
    system[0] *= 10.0 ** rng.uniform(-1, 1, n)
    small = np.where(rng.random(n) < 0.8, distances(rng, n), 10.0 ** rng.uniform(-305, -290, n))
    system[rng.integers(0, 3, n), np.arange(n)] *= small
    return system[0], system[1], system[2]


def exact_folds(rng: np.random.Generator, n: int) -> System:
    """Cubes of Pythagorean triples with a common factor: Delta = 0 exactly."""
    k, m = rng.integers(1, 120, n), rng.integers(1, 120, n)
    k, m = np.maximum(k, m) + (k == m), np.minimum(k, m)
    legs = np.stack([np.abs(k**2 - m**2), 2 * k * m])
    swap = rng.integers(0, 2, n)
    A = (k**2 + m**2).astype(float) ** 3  # below 2^53
    B = legs[swap, np.arange(n)].astype(float) ** 3
    C = legs[1 - swap, np.arange(n)].astype(float) ** 3
    factor = 2.0 ** rng.integers(-60, 60, n)
    return signs(rng, n) * A * factor, signs(rng, n) * B * factor, signs(rng, n) * C * factor


def next_to_exact_folds(rng: np.random.Generator, n: int) -> System:
    """One unit in the last place of one coefficient off an exact fold."""
    system = np.array(exact_folds(rng, n))
    which, columns = rng.integers(0, 3, n), np.arange(n)
    moved = np.nextafter(system[which, columns], signs(rng, n) * np.inf)
    system[which, columns] = moved
    return system[0], system[1], system[2]


def exact_cusps(rng: np.random.Generator, n: int) -> System:
    """|B| = |A| and C = 0, or |C| = |A| and B = 0."""
    A = signs(rng, n) * scales(rng, n)
    swap = rng.random(n) < 0.5
    large, none = signs(rng, n) * A, signs(rng, n) * 0.0
    return A, np.where(swap, none, large), np.where(swap, large, none)


def next_to_exact_cusps(rng: np.random.Generator, n: int) -> System:
    """At most one unit off |B| = |A|, and C of any size down to the smallest double; or swapped."""
    A = signs(rng, n) * scales(rng, n)
    towards = rng.choice([-np.inf, np.inf, np.nan], n)
    large = np.abs(A)
    large = np.where(np.isnan(towards), large, np.nextafter(large, np.nan_to_num(towards)))
    small = np.maximum(np.abs(A) * 10.0 ** rng.uniform(-323, -1, n), 5e-324)
    swap = rng.random(n) < 0.5
    B, C = np.where(swap, small, large), np.where(swap, large, small)
    return A, signs(rng, n) * B, signs(rng, n) * C


FAMILIES: dict[str, Callable[[np.random.Generator, int], System]] = {
    family.__name__: family
    for family in (
        generic,
        inside,
        ratios,
        near_folds,
        near_cusps,
        zeros,
        tiny,
        exact_folds,
        next_to_exact_folds,
        exact_cusps,
        next_to_exact_cusps,
    )
}


def systems(n: int, seed: int = 20240917) -> System:
    """Return n systems, as many of each family."""
    rng = np.random.default_rng(seed)
    share = -(-n // len(FAMILIES))
    A, B, C = np.concatenate([np.array(f(rng, share)) for f in FAMILIES.values()], axis=1)
    order = rng.permutation(A.size)[:n]  # blocks of a kernel get mixed company
    return A[order], B[order], C[order]
