"""Branches of formulas that are proved: one curve between neighbouring points, folds, Hopf points.

What is proved holds for the formulas and the doubles that stand for parameters, exactly. Between
neighbouring points tubes hold one curve and no other zero (`phasekit.numerics.intervals.tubes`);
where a tube fails it is tried in halves. Special points are boxes that hold exactly one solution of
the equations that define them, whose derivatives are not singular there:

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
import numpy.typing as npt

from phasekit.numerics.intervals.krawczyk import UNIT, inverses
from phasekit.numerics.intervals.program import NoRule
from phasekit.numerics.intervals.tubes import FRAME, Tubes, tubes_about
from phasekit.numerics.intervals.zeros import System, enclosures
from phasekit.numerics.later import later

if TYPE_CHECKING:
    import sympy as sp
else:
    sp = later("sympy")

Array = npt.NDArray[np.float64]
Flags = npt.NDArray[np.bool_]

#: How often a chord is halved, and chords at a time beside points of the branch.
HALVINGS, CHORDS = 12, 4
#: Newton steps that take a middle to the curve.
STEPS = 4
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
    """What is proved of a special point.

    Attributes
    ----------
    certified : bool
    low, high : array
        Bounds of the states, the parameter, and of omega, sigma or the angle if there is one; NaN
        where nothing is known.
    reason : str
        Why it is not proved, or what is not.
    """

    certified: bool
    low: Array
    high: Array
    reason: str


class Certificate(NamedTuple):
    """What is proved of a branch.

    Attributes
    ----------
    stretches : array of bool, shape (points - 1,)
        Whether one curve goes from each point to the next, and no other passes its tube.
    reasons : list of str
        Why not, in words.
    radius : array, shape (points - 1, unknowns)
        How far the curve may be from the chords of the stretch; NaN where nothing is known.
    errors : array, shape (points, unknowns)
        How far each point may be from the curve; NaN where nothing is known.
    specials : list of Enclosure
    """

    stretches: Flags
    reasons: list[str]
    radius: Array
    errors: Array
    specials: list[Enclosure]


def certificate(
    equations: Equations, points: Array, scale: Array, marks: Sequence[Mark]
) -> Certificate:
    """What is proved of a branch through some points.

    Parameters
    ----------
    equations : Equations
    points : array, shape (points, states + 1)
        States and parameter in order along the branch, special points among them.
    scale : array, shape (states + 1,)
        Their sizes.
    marks : sequence of Mark

    Raises
    ------
    NoRule
        If formulas hold a function of which no bounds are known.
    """
    units: Array = np.exp2(np.round(np.log2(scale))).astype(float)
    unknowns = (*equations.states, equations.parameter)
    values = {s: v for s, v in equations.values.items() if s != equations.parameter}
    system = System(equations.zero(), unknowns, values, units)
    crossings = {mark.place: mark.kind for mark in marks if mark.kind in CROSSINGS}
    chain = _chain(system, points / units)
    leaves = chain.tubes
    stretches, reasons = _stretches(chain, points, units, crossings)
    radius = np.full((len(points) - 1, len(units)), np.nan)
    sizes = np.einsum("kij,kj->ki", np.abs(leaves.across), leaves.radius) * (1.0 + FRAME) * units
    for k in np.flatnonzero(stretches):
        radius[k] = np.max(sizes[chain.owner == k], axis=0, initial=0.0)
    errors = _errors(system, chain, len(points), units)
    specials = _specials(equations, chain, marks, errors, units)
    return Certificate(stretches, reasons, radius, errors, specials)


# ------------------------------------------------------------------------- stretches


class _Chain(NamedTuple):
    """Tubes in order along a branch, and to which stretches they belong."""

    tubes: Tubes
    owner: npt.NDArray[np.int64]
    joined: Flags
    """Whether each and the next hold the same curve."""


def _chain(system: System, u: Array) -> _Chain:
    """Tubes from point to point, of halves where those of wholes fail."""
    start, end = u[:-1], u[1:]
    owner = np.arange(len(start))
    place = owner.astype(float)
    length = np.linalg.norm(end - start, axis=1)
    long = length > 64.0 * UNIT * np.linalg.norm(np.abs(end) + np.abs(start), axis=1)
    start, end, owner, place = start[long], end[long], owner[long], place[long]
    parts: list[tuple[Tubes, Any, Array]] = []
    for level in range(HALVINGS + 1):
        found = tubes_about(system, start, end)
        done = found.proved.copy()
        middle, near = _middles(system, start, end)
        last = level == HALVINGS or 2 * np.sum(~done) > CHORDS * (len(u) + 16)
        done |= ~near | last
        parts.append((found.rows(done), owner[done], place[done]))
        rest = ~done
        if not rest.any():
            break
        step = 0.5 ** (level + 1)
        start, middle, end = start[rest], middle[rest], end[rest]
        start, end = np.concatenate([start, middle]), np.concatenate([middle, end])
        place = np.concatenate([place[rest], place[rest] + step])
        owner = np.tile(owner[rest], 2)
    order = np.argsort(np.concatenate([part[2] for part in parts]), kind="stable")
    arrays = zip(*(part[0] for part in parts), strict=True)
    whole = Tubes(*(np.concatenate(array)[order] for array in arrays))
    return _Chain(whole, np.concatenate([part[1] for part in parts])[order], whole.joined)


def _middles(system: System, start: Array, end: Array) -> tuple[Array, Flags]:
    """Points of the curve half way, across chords, and whether they were found near these."""
    chord, base = end - start, 0.5 * start + 0.5 * end
    u, size = base.copy(), np.linalg.norm(chord, axis=1)
    rows = np.empty((len(u), system.n, system.n))
    with np.errstate(all="ignore"):
        rows[:, -1] = chord / size[:, None]
        for _ in range(STEPS):
            f, slopes, _ = system(u, u)
            rows[:, :-1] = 0.5 * slopes[0] + 0.5 * slopes[1]
            gap = np.sum((u - base) * rows[:, -1], axis=1)
            value = np.concatenate([0.5 * f[0] + 0.5 * f[1], gap[:, None]], axis=1)
            inverse, usable = inverses(rows)
            u = u - np.einsum("kij,kj->ki", inverse, value)
        near = usable & (np.linalg.norm(u - base, axis=1) < 0.5 * size)
    return u, near


def _stretches(
    chain: _Chain, points: Array, units: Array, crossings: Mapping[int, str]
) -> tuple[Flags, list[str]]:
    """Which stretches are proved, and why others are not."""
    count = len(points) - 1
    stretches, reasons = np.ones(count, dtype=bool), [""] * count
    proved, owner = chain.tubes.proved, chain.owner
    for k in np.unique(owner[~proved]):
        stretches[k] = False
        open_ = (owner == k) & ~proved
        ends = chain.tubes.middle[open_, -1, None] + 0.5 * chain.tubes.chord[open_, -1:] * [-1, 1]
        where = f"between {ends.min() * units[-1]:.9g} and {ends.max() * units[-1]:.9g}"
        kinds = [crossings[i] for i in (k, k + 1) if i in crossings]
        if kinds:
            what = kinds[0].replace("_", " ")
            reasons[k] = f"{where}: branches meet in the {what}, which no tube passes"
        elif not chain.tubes.defined[open_].all():
            reasons[k] = f"{where}: f or a derivative may have a pole or be undefined"
        else:
            reasons[k] = (
                f"{where}: other branches may be nearer than intervals can tell, or derivatives "
                "vanish together"
            )
    apart = np.flatnonzero(proved[:-1] & proved[1:] & ~chain.joined)
    for k in owner[apart + 1]:
        if stretches[k]:
            stretches[k], reasons[k] = False, "its curve may not be that of the stretch before"
    # Points that are the same but for rounding are on the curve on both sides, or on neither.
    for k in np.setdiff1d(np.arange(count), owner):
        before = stretches[k - 1] if k else stretches[k + 1] if k + 1 < count else False
        stretches[k], reasons[k] = before, "" if before else reasons[k - 1] if k else ""
    return stretches, reasons


def _errors(system: System, chain: _Chain, count: int, units: Array) -> Array:
    """How far points may be from the curve, in planes across the chords that end there."""
    errors = np.full((count, len(units)), np.nan)
    tubes, owner = chain.tubes, chain.owner
    last = np.append(owner[1:] != owner[:-1], True) & tubes.proved
    size = np.einsum("kij,kj->ki", np.abs(tubes.across), tubes.tip) * (1.0 + FRAME) * units
    errors[owner[last] + 1] = size[last]
    first = np.append(True, owner[1:] != owner[:-1]) & tubes.proved
    first[first] = np.isnan(errors[owner[first], 0])
    if first.any():
        there = tubes.rows(first)
        back = tubes_about(system, there.end, there.end - there.chord)
        size = np.einsum("kij,kj->ki", np.abs(back.across), back.tip) * (1.0 + FRAME) * units
        size += 2.0 * UNIT * (np.abs(there.end) + np.abs(there.chord)) * units
        errors[owner[first]] = np.where(back.proved[:, None], size, np.nan)
    return errors


# ------------------------------------------------------------------------- special points


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


def _specials(
    equations: Equations, chain: _Chain, marks: Sequence[Mark], errors: Array, units: Array
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
        return Enclosure(known, mark.u - error, mark.u + error, reason)
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
    equations: Equations, kind: str, marks: Sequence[Mark], chain: _Chain, units: Array
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
        reason = ""
        if kind == "hopf" and not (low[i, n + 1] > 0.0 or high[i, n + 1] < 0.0):
            reason = "omega may be 0"
        box = slice(0, n + 1)
        on = _on(chain, mark.place, low[i, box] / units, high[i, box] / units)
        if not on:
            reason = "no tube holds it: whether it is on this branch is not proved"
        bad = reason == "omega may be 0"
        found.append(Enclosure(not bad, low[i, :shown], high[i, :shown], reason))
    return found


def _on(chain: _Chain, index: int, low: Array, high: Array) -> bool:
    """Whether a box of a zero lies in a tube next to a point, so that it is on the curve."""
    near = (chain.owner == index - 1) | (chain.owner == index)
    tubes = chain.tubes.rows(near)
    count = len(tubes.middle)
    center, radius = 0.5 * low + 0.5 * high, 0.5 * (high - low) * (1.0 + 4.0 * UNIT)
    axes = np.broadcast_to(np.eye(len(low)), (count, len(low), len(low)))
    held = tubes.hold(
        np.broadcast_to(center, (count, len(low))), axes, np.broadcast_to(radius, (count, len(low)))
    )
    return bool(held.any())


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


def missing_rule(equations: Equations) -> str | None:
    """The name of a function of which no bounds are known."""
    try:
        System(equations.zero(), (*equations.states, equations.parameter), dict(equations.values))
    except NoRule as missing:
        return str(missing)
    return None
