"""Boxes that hold exactly one special point of a branch of formulas.

What is solved are the equations that define a point, whose derivatives are not singular there:

    fold             f = 0, f_x v = 0, l v = 1
    hopf             f = 0, f_x v = -omega w, f_x w = omega v, l v = 1, l w = 0
    neutral_saddle   f = 0, f_x v = sigma v, f_x w = -sigma w, l v = 1, m w = 1
    period_doubling  f = x, f_x v = -v, l v = 1
    torus            f = x, f_x v = c v - s w, f_x w = s v + c w, l v = 1, l w = 0, c^2 + s^2 = 1

([Govaerts2000] chapter 4, [Kuznetsov2004] 10.2). Thus a fold is quadratic, and a pair of
eigenvalues passes the imaginary axis with a speed that is not zero.
"""

from __future__ import annotations

import functools
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from phasekit.arrays import Array
from phasekit.numerics.intervals.tube_chains import Chain, on_curve
from phasekit.numerics.intervals.zeros import System, enclosures
from phasekit.numerics.later import later

if TYPE_CHECKING:
    import sympy as sp
else:
    sp = later("sympy")


#: Kinds at which branches meet.
CROSSINGS = ("branch_point", "pitchfork", "transcritical")


@dataclass(frozen=True)
class Equations:
    """Formulas of a branch: f, its states and its parameter as symbols, the others as numbers."""

    f: tuple[Any, ...]
    states: tuple[Any, ...]
    parameter: Any
    values: Mapping[Any, float]
    discrete: bool

    def zero(self) -> tuple[Any, ...]:
        """What vanishes along the branch, its numbers exact."""
        return _zero(self.f, self.states, self.discrete)


@functools.lru_cache(maxsize=64)
def _zero(f: tuple[Any, ...], states: tuple[Any, ...], discrete: bool) -> tuple[Any, ...]:
    exact = [row.xreplace({x: sp.Rational(x) for x in row.atoms(sp.Float)}) for row in f]
    return tuple(row - x for row, x in zip(exact, states, strict=True)) if discrete else (*exact,)


class Mark(NamedTuple):
    """A special point to be proved: its kind, its unknowns, and which of the points it is."""

    kind: str
    u: Array
    place: int


class Enclosure(NamedTuple):
    """What is proved of a special point."""

    certified: bool
    #: Bounds of the states, the parameter, and of omega, sigma or the angle if there is one; NaN
    #: where nothing is known.
    low: Array
    high: Array
    reason: str  # why it is not proved, or what is not


class _Kind(NamedTuple):
    """Equations of a kind of special point: formulas and their unknowns, and numbers that fix v."""

    equations: tuple[Any, ...]
    unknowns: tuple[Any, ...]
    numbers: tuple[Any, ...]


@functools.lru_cache(maxsize=128)
def _kind(kind: str, zero: tuple[Any, ...], states: tuple[Any, ...], parameter: Any) -> _Kind:
    """The equations of a kind, of f(x) - x for those of maps."""
    n = len(states)
    slopes = [[row.diff(x) for x in states] for row in zero]
    v, w, a, b = (sp.symbols(f"{name}0:{n}", cls=sp.Dummy, real=True) for name in "vwlm")

    def times(vector: Sequence[Any]) -> list[Any]:
        return [
            sp.Add(*(s * one for s, one in zip(row, vector, strict=True) if s != 0))
            for row in slopes
        ]

    def dot(first: Sequence[Any], second: Sequence[Any]) -> Any:
        return sp.Add(*(x * y for x, y in zip(first, second, strict=True)))

    def rows(vector: Sequence[Any], terms: Sequence[Any]) -> list[Any]:
        return [row + term for row, term in zip(times(vector), terms, strict=True)]

    s, c = sp.Dummy("s", real=True), sp.Dummy("c", real=True)
    if kind == "fold":
        return _Kind((*zero, *times(v), dot(a, v) - 1), (*states, parameter, *v), a)
    if kind == "period_doubling":
        doubled = rows(v, [2 * one for one in v])
        return _Kind((*zero, *doubled, dot(a, v) - 1), (*states, parameter, *v), a)
    unknowns = (*states, parameter, s, *v, *w)
    if kind == "hopf":
        both = rows(v, [s * one for one in w]) + rows(w, [-s * one for one in v])
        return _Kind((*zero, *both, dot(a, v) - 1, dot(a, w)), unknowns, a)
    if kind == "neutral_saddle":
        both = rows(v, [-s * one for one in v]) + rows(w, [s * one for one in w])
        return _Kind((*zero, *both, dot(a, v) - 1, dot(b, w) - 1), unknowns, (*a, *b))
    both = rows(v, [(1 - c) * x + s * y for x, y in zip(v, w, strict=True)])
    both += rows(w, [(1 - c) * y - s * x for x, y in zip(v, w, strict=True)])
    last = (dot(a, v) - 1, dot(a, w), c**2 + s**2 - 1)
    return _Kind((*zero, *both, *last), (*states, parameter, s, c, *v, *w), a)


#: Kinds whose equations are solved.
ENCLOSED = ("fold", "hopf", "neutral_saddle", "period_doubling", "torus")


def enclosures_of(
    equations: Equations, chain: Chain, marks: Sequence[Mark], errors: Array, units: Array
) -> list[Enclosure]:
    """What is proved of special points, all of a kind at once."""
    found: dict[int, Enclosure] = {}
    for kind in ENCLOSED:
        places = [i for i, mark in enumerate(marks) if mark.kind == kind]
        if places:
            some = [marks[i] for i in places]
            found |= zip(places, _of_kind(equations, kind, some, chain, units), strict=True)
    for i, mark in enumerate(marks):
        if i not in found:
            found[i] = _other(mark, errors)
    return [found[i] for i in range(len(marks))]


def _other(mark: Mark, errors: Array) -> Enclosure:
    """What is proved of a point that no equations are solved for."""
    error = errors[mark.place]
    if mark.kind == "end":
        known = bool(np.isfinite(error).all())
        reason = "" if known else "the stretch next to it is not proved"
        low, high = np.nextafter(mark.u - error, -np.inf), np.nextafter(mark.u + error, np.inf)
        return Enclosure(known, low, high, reason)
    nothing = np.full(len(mark.u), np.nan)
    if mark.kind in CROSSINGS:
        reason = (
            "branches meet: whether they do, or pass each other closely, no interval tells unless "
            "a symmetry or a factor of the formulas splits them"
        )
    else:
        reason = f"{mark.kind.replace('_', ' ')} points are not enclosed"
    return Enclosure(False, nothing, nothing, reason)


def _of_kind(
    equations: Equations, kind: str, marks: Sequence[Mark], chain: Chain, units: Array
) -> list[Enclosure]:
    n, count = len(equations.states), len(marks)
    form = _kind(kind, equations.zero(), equations.states, equations.parameter)
    values = {
        symbol: np.full(count, value)
        for symbol, value in equations.values.items()
        if symbol != equations.parameter
    }
    u = np.array([mark.u for mark in marks])
    start, numbers, known = _starts(equations, kind, u, units[:n])
    values |= dict(zip(form.numbers, numbers.T, strict=True))
    own = np.ones(len(form.unknowns))
    own[: n + 1] = units
    for k in range(len(form.unknowns) - n, n + 1, -n):
        own[k : k + n] = units[:n]
    system = System(form.equations, form.unknowns, values, own)
    (low, high), held = enclosures(system, start / own)
    low, high = low * own, high * own
    found = []
    for i, mark in enumerate(marks):
        shown = n + 1 + (kind in ("hopf", "neutral_saddle")) + 2 * (kind == "torus")
        if not (held[i] and known[i]):
            nothing = np.full(shown, np.nan)
            found.append(Enclosure(
                False, nothing, nothing,
                "no box about it holds exactly one: it is degenerate, or nearly so, or bounds of "
                "the formulas are too wide",
            ))  # fmt: skip
            continue
        reason, box = "", slice(0, n + 1)
        # Where omega, sigma or the sine is 0 these equations hold at folds and doublings, too.
        pair = kind in ("hopf", "neutral_saddle", "torus")
        bad = pair and not (low[i, n + 1] > 0.0 or high[i, n + 1] < 0.0)
        if bad:
            reason = "its two eigenvalues may be one, of a fold or a doubling"
        elif not on_curve(chain, mark.place, low[i, box] / units, high[i, box] / units):
            reason = "no tube holds it: whether it is on this branch is not proved"
        found.append(Enclosure(not bad, low[i, :shown], high[i, :shown], reason))
    return found


def _starts(
    equations: Equations, kind: str, u: Array, scale: Array
) -> tuple[Array, Array, list[bool]]:
    """Where equations of special points are nearly solved, and the numbers that fix vectors."""
    n = len(equations.states)
    values = {s: v for s, v in equations.values.items() if s != equations.parameter}
    unknowns = (*equations.states, equations.parameter)
    _, slopes, _ = System(equations.zero(), unknowns, values)(u, u)
    matrices = (0.5 * slopes[0] + 0.5 * slopes[1])[:, :, :n] * scale / scale[:, None]
    starts, numbers, known = [], [], []
    for point, matrix in zip(u, matrices, strict=True):
        usable = bool(np.isfinite(matrix).all())
        start, number = _start(kind, matrix if usable else np.eye(n), scale)
        starts.append(np.concatenate([point, start]))
        numbers.append(number)
        known.append(usable)
    return np.array(starts), np.array(numbers), known


def _start(kind: str, matrix: Array, scale: Array) -> tuple[Array, Array]:
    """Vectors and numbers of a special point whose scaled derivatives are those of a flow."""
    n = len(matrix)
    if kind in ("fold", "period_doubling"):
        shift = 0.0 if kind == "fold" else 2.0
        v = np.linalg.svd(matrix + shift * np.eye(n))[2][-1]
        return v * scale, v / scale
    values, vectors = np.linalg.eig(matrix)
    if kind == "neutral_saddle":
        sums = np.abs(values[:, None] + values) + np.where(np.eye(n) > 0, np.inf, 0.0)
        i, j = np.unravel_index(np.argmin(sums), sums.shape)
        i, j = (i, j) if values[i].real > values[j].real else (j, i)
        v, w = vectors[:, i].real, vectors[:, j].real
        v, w = v / np.linalg.norm(v), w / np.linalg.norm(w)
        sigma = 0.5 * (values[i] - values[j]).real
        return np.concatenate([[sigma], v * scale, w * scale]), np.append(v / scale, w / scale)
    if kind == "hopf":
        away = np.abs(values.real) / np.where(values.imag > 0.0, np.abs(values), 1e-300)
    else:
        away = np.abs(np.abs(values + 1.0) - 1.0) / np.where(values.imag > 0.0, 1.0, 1e-300)
    k = int(np.argmin(np.where(values.imag > 0.0, away, np.inf)))
    q = vectors[:, k]
    # Turned so that its parts are orthogonal.
    q = q * np.exp(-0.5j * np.angle(np.sum(q * q)))
    q = q / np.linalg.norm(q.real)
    angle = [values[k].imag] if kind == "hopf" else [values[k].imag, values[k].real + 1.0]
    return np.concatenate([angle, q.real * scale, q.imag * scale]), q.real / scale
