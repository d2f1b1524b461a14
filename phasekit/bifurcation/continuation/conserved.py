"""What f conserves, where equilibria are not isolated: sums of states, or of simple functions."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np

from phasekit.arrays import Array

MANY = 50  # states up to which sums of them are looked for
FEW = 8  # and of their squares, products and logarithms
RANGE = 0.3  # of the states, by which they are varied
ROUNDING = 1e-11  # of a sum, beside its terms
DIGITS = 9  # of a coefficient
NEAR = 1e-3  # distance, on scaled axes, of equilibria that are compared
ZERO = 1e-6  # entries of a gradient that are no more, beside the largest
DOUBT = 1e-6  # least singular value below which units are looked at, beside the largest
ROUNDS = 8  # in which rows and columns are made alike
SETTLED = 1e-8  # of a step, on scaled axes
BIG = 1e100  # for the slope of a logarithm at zero
STEPS = 8  # of Newton's method


@np.errstate(all="ignore")
def not_isolated(curve: Any, u: Array, where: str) -> str:
    """What is said where a curve ends because equilibria are not isolated; nothing if they are."""
    what, instead = "equilibria are", "write one of its equations as {} - total, with"
    if curve.discrete:
        what, instead = "fixed points are", "leave a state out, which follows from {} = total, with"
    kept, fixed = conserved(curve, u), False
    gradient = "" if kept else _gradient(curve, u)
    if gradient:
        kept, fixed = _by_functions(curve, u)
    if not (kept or gradient):
        return ""
    end = f"{what} {NOT_ISOLATED} {where}"
    if not kept:
        return (
            f"{end}, nor near it: f_x is singular at each, as where f conserves a quantity, whose "
            f"gradient there is along {gradient}; a fixed value of it in place of an equation "
            "would tell them apart"
        )
    for_all = (
        "" if not fixed else f" at {curve.field.parameters[curve.active[0]]} = {u[curve.n]:.9g}"
    )
    instead = instead.format(kept[0])
    return f"f conserves {' and '.join(kept)}{for_all}: {end}; {instead} a parameter total"


#: What tells such an end from others.
NOT_ISOLATED = "not isolated at"


def conserved(curve: Any, u: Array) -> list[str]:
    """Sums of states, with factors, that f never changes, in words."""
    if not 1 < curve.n <= MANY:
        return []
    points = _around(curve, u, 4 * curve.n + 8, all_=True)
    return [_written(row, curve.field.states) for row in _sums(curve.values(points))]


def _by_functions(curve: Any, u: Array) -> tuple[list[str], bool]:
    """Sums of simple functions of states that f never changes; whether only at this parameter."""
    if not 1 < curve.n <= FEW:
        return [], False
    functions = list(_functions(curve.field.states))
    for some, all_ in ((functions, True), (functions[: curve.n], False), (functions, False)):
        names = [name for name, _, _ in some]
        points = _around(curve, u, 2 * len(names) + 8, all_=all_)
        x, change = points[:, : curve.n], curve.values(points)
        with np.errstate(all="ignore"):
            columns = [
                value(x + change) - value(x) if curve.discrete else rate(x, change)
                for _, value, rate in some
            ]
        states = np.tile(u[: curve.n], (curve.n, 1))
        with np.errstate(all="ignore"):  # the rates of these functions along each state
            ways = np.array([rate(states, np.diag(curve.scale[: curve.n])) for *_, rate in some])
        ways = np.nan_to_num(ways, posinf=BIG, neginf=-BIG)
        kept = [
            _written(row, names)
            for row in _sums(np.column_stack(columns))
            if np.any(np.abs(row @ ways) > ZERO * (np.abs(row) @ np.abs(ways)))
        ]
        if kept:
            return kept, not all_
    return [], False


def _functions(states: tuple[str, ...]) -> Iterator[tuple[str, Any, Any]]:
    """Simple functions of states: names, values at points, and rates where the states change."""
    n = len(states)
    for i in range(n):
        yield states[i], lambda x, i=i: x[:, i], lambda x, f, i=i: f[:, i]
    for i in range(n):
        for j in range(i, n):
            name = f"{states[i]}^2" if i == j else f"{states[i]}*{states[j]}"
            yield (
                name,
                lambda x, i=i, j=j: x[:, i] * x[:, j],
                lambda x, f, i=i, j=j: x[:, i] * f[:, j] + x[:, j] * f[:, i],
            )
    for i in range(n):
        yield (
            f"log({states[i]})",
            lambda x, i=i: np.log(np.abs(x[:, i])),
            lambda x, f, i=i: f[:, i] / x[:, i],
        )


def _around(curve: Any, u: Array, count: int, *, all_: bool) -> Array:
    """Points around one, in all unknowns or in the states alone."""
    spread = np.random.default_rng(1).uniform(-1.0, 1.0, (count, curve.m))
    if not all_:
        spread[:, curve.n :] = 0.0
    reach = RANGE * np.maximum(np.abs(u[: curve.m]), curve.scale[: curve.m])
    return np.asarray(u[: curve.m] + spread * reach)


def _sums(values: Array) -> list[Array]:
    """Factors of columns whose sums vanish in each row."""
    count = values.shape[1]
    values = values[np.isfinite(values).all(axis=1)]
    if len(values) < 1.5 * count:
        return []
    sizes = np.max(np.abs(values), axis=0)
    sizes[sizes == 0.0] = 1.0
    _, found, rows = np.linalg.svd(values / sizes)
    return list(_reduced(rows[found <= ROUNDING * found[0]], sizes))


def _written(row: Array, names: Any) -> str:
    """A sum with factors, in words."""
    terms = [
        f"{'-' if c < 0.0 else '+'} {'' if abs(c) == 1.0 else f'{abs(c):.6g}*'}{name}"
        for c, name in zip(row.tolist(), names, strict=True)
        if c
    ]
    return " ".join(terms).removeprefix("+ ").replace("- ", "-", terms[0][0] == "-")


def _reduced(basis: Array, sizes: Array) -> Iterator[Array]:
    """Rows that span the same, each with a first entry of 1 where all others have none.

    Those given are in units of ``sizes``, those returned are not.
    """
    basis = basis.copy()
    done = 0
    for j in range(basis.shape[1]):
        if done == len(basis):
            break
        k = done + int(np.argmax(np.abs(basis[done:, j])))
        if abs(basis[k, j]) <= 1e-9 * np.max(np.abs(basis[done:])):
            continue
        basis[[done, k]] = basis[[k, done]]
        basis[done] /= basis[done, j]
        others = np.arange(len(basis)) != done
        basis[others] -= np.outer(basis[others, j], basis[done])
        done += 1
    for row in basis:
        row[np.abs(row) <= 1e-9 * np.max(np.abs(row))] = 0.0
        row = row / sizes
        row = row / row[np.flatnonzero(row)[0]]
        yield np.array([float(f"{c:.{DIGITS}g}") for c in row])


def _gradient(curve: Any, u: Array) -> str:
    """The left null vector of f_u, where equilibria are not isolated, in words."""
    n, m = curve.n, curve.m
    if n < 2 or not deficient(curve, u):
        return ""
    slopes, scale = curve.evaluate(u)[1], curve.scale[:m]
    rows, columns = _units(curve, u, slopes)
    left, sizes, _ = np.linalg.svd(slopes * columns * rows[:, None])
    rank = int(np.sum(sizes > _error(curve) * sizes[0]))
    spread = np.random.default_rng(2).uniform(-1.0, 1.0, (3, m))
    for one in spread:
        near = _beside(curve, u[:m] + NEAR * one * scale, rows, columns, rank)
        if near is None or not deficient(curve, near):
            return ""
    states = ", ".join(curve.field.states)
    found = []
    for vector in (left[:, rank:] * rows[:, None]).T:
        vector = vector / vector[np.argmax(np.abs(vector) * scale[:n])]
        vector[np.abs(vector) * scale[:n] <= ZERO * np.max(np.abs(vector) * scale[:n])] = 0.0
        found.append(f"({states}) = ({', '.join(f'{c:.6g}' for c in vector)})")
    return " and ".join(found)


@np.errstate(all="ignore")
def deficient(curve: Any, u: Array, slopes: Array | None = None) -> bool:
    """Whether f_u has no full rank at a point, in whatever units."""
    slopes = curve.evaluate(u)[1] if slopes is None else slopes
    if curve.n > MANY or not np.isfinite(slopes).all():
        return False
    scaled = slopes * curve.scale[: curve.m]
    rows = np.max(np.abs(scaled), axis=1, keepdims=True)
    sizes = np.linalg.svd(scaled / np.where(rows > 0.0, rows, 1.0), compute_uv=False)
    if sizes[-1] > DOUBT * sizes[0]:
        return False  # without second derivatives, which take long
    rows, columns = _units(curve, u, slopes)
    scaled = slopes * columns * rows[:, None]
    if not np.isfinite(scaled).all():
        return False
    sizes = np.linalg.svd(scaled, compute_uv=False)
    return bool(sizes[-1] <= _error(curve) * sizes[0])


def _error(curve: Any) -> float:
    """What a singular value of derivatives is known to, beside the largest."""
    return 1e2 * float(curve.field.accuracy)


def _units(curve: Any, u: Array, slopes: Array) -> tuple[Array, Array]:
    """Factors of equations and unknowns with which the largest terms of all are about one.

    An entry, or an unknown, may vanish from all first derivatives.
    """
    scale = curve.scale[: curve.m]
    sizes = np.abs(slopes * scale) + np.nan_to_num(np.abs(curve.bend(u, scale) * scale))
    rows, columns = np.ones(curve.n), np.ones(curve.m)
    for _ in range(ROUNDS):
        here = sizes * columns * rows[:, None]
        for factors, axis in ((rows, 1), (columns, 0)):
            most = np.max(here, axis=axis)
            factors /= np.sqrt(np.where(most > 0.0, most, 1.0))
    return rows, columns * scale


def _beside(curve: Any, u: Array, rows: Array, columns: Array, rank: int) -> Array | None:
    """The equilibrium next to a point, in all unknowns, by Newton's method of least changes."""
    for _ in range(STEPS):
        value, slopes = curve.evaluate(u)
        scaled = slopes * columns * rows[:, None]
        if not (np.isfinite(scaled).all() and np.isfinite(value).all()):
            return None
        left, sizes, right = np.linalg.svd(scaled)
        step = right[:rank].T @ (left[:, :rank].T @ (-value * rows) / sizes[:rank])
        u = u + step * columns
        if np.max(np.abs(step)) <= 1e-12:
            break
    left_over = np.max(np.abs(curve.evaluate(u)[0] * rows))
    return np.asarray(u) if max(np.max(np.abs(step)), left_over) <= SETTLED else None
