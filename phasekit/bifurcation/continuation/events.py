"""Where something happens on a path of equilibria: brackets of one special point each."""

from __future__ import annotations

import functools
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, fields, replace
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from phasekit.arrays import Array
from phasekit.bifurcation.continuation.crowds import (
    Steps,
    crowded,
    doubtful,
    doubtful_of_all,
    falls,
    paces_of,
    places,
)
from phasekit.bifurcation.continuation.curve import Curve
from phasekit.bifurcation.continuation.kernels import scan
from phasekit.bifurcation.continuation.kernels.defining import REGULAR
from phasekit.bifurcation.continuation.path import Path, Sample, Slopes, between, sharpened
from phasekit.bifurcation.continuation.spectrum import (
    Tests,
    is_neutral,
    largest,
    orientation,
    said_of,
    test_functions,
    unstable_of,
)

DEPTH = 10
TOUCH = 1e-3  # part of its values at the ends to which a determinant falls that touches zero
#: Where a test function is looked at within a step: so often at lowest points of parabolas; no
#: nearer to each other, in steps.
GOLDEN, PARABOLAS, NARROW = 0.5 * (5.0**0.5 - 1.0), 12, 1e-9
ON_END = 1e-5  # part of its value a little before at which a test function of an end is zero
FLAT = 1e-13  # a tangent's part along the parameter without a sign: at a cusp it touches zero
MEET = 4  # halvings that tell where real eigenvalues meet
#: How often a step that was halved so often is parted between two crossings, and how far apart
#: these are at least, in steps.
PARTED, APART = 4, 1e-4
#: Part of the distance to the nearest of others, beside a point on which Newton's method fails.
BESIDE = 1e-3
TESTS = ("fold", "branch", "pair", "flip")
#: What the compiled look, of so few states, says of these.
CHANGES = {"fold": scan.BITS[0], "branch": scan.BITS[1], "pair": scan.BITS[scan.PAIR]}
FEW = 8
#: A spectrum whose sums of two are larger, beside its size, is no mirror image; where it is seen.
MIRRORED, THIRDS = 1e-5, 3


@dataclass(frozen=True)
class Bracket:
    """Two points of the path between which test functions change sign.

    ``jump`` is by how much the number of unstable eigenvalues changes between them.
    """

    a: Sample
    b: Sample
    changes: frozenset[str]
    jump: int
    index: int = 0  # of the path's point before it
    neutral: bool = False  # pairs stay on the axis
    both: int = 0  # eigenvalues that surely cross either way, where they cannot be parted


Told = tuple[list[Bracket], npt.NDArray[np.complex128], tuple[str, ...]]


def brackets_of_all(paths: Sequence[tuple[Curve, Path]]) -> list[Told]:
    """All brackets of each path, in order, the eigenvalues of f_x at its points, and doubts.

    The curves differ in their parameters and scales.
    """
    looks = [_looked(*one) for one in paths]
    both = zip(paths, looks, strict=True)
    crowded = [(curve, path, look.crowds) for (curve, path), look in both if look is not None]
    doubts = iter(_in_doubt(crowded))
    return [
        _brackets(*one) if look is None else _brackets_of_look(*one, look, next(doubts))
        for one, look in zip(paths, looks, strict=True)
    ]


def _pairs_of(curve: Curve) -> bool:
    """Whether pairs are looked for that cross the axis."""
    return bool({"hopf", "neutral_saddle"} & set(curve.detect)) and curve.n > 1


def _brackets(curve: Curve, path: Path) -> Told:
    """The same of one path, by all its test functions."""
    pairs, saddles = _pairs_of(curve), "neutral_saddle" in curve.detect
    conservative = curve.conservative
    tests, crowds = _all_tests(curve, path, pairs=pairs, saddles=saddles, look=not conservative)
    neutral = conservative or is_neutral(curve, tests.eigenvalues)
    messages: tuple[str, ...] = ()
    if neutral:
        if pairs and not conservative:
            messages = said_of(curve, tests.eigenvalues)
        unstable = unstable_of(curve, tests.eigenvalues, neutral=True)
        tests = replace(tests, pair=np.ones(path.count), unstable=unstable)
        pairs = False
    eigenvalues = tests.eigenvalues
    keep = _regular(tests)
    tests = Tests(*(getattr(tests, f.name)[keep] for f in fields(tests)))
    seek = _Seek(curve, pairs, neutral, saddles)
    found: list[Bracket] = []
    sample = functools.cache(functools.partial(seek.sample, path, keep, tests))
    doubts: set[int] = set()
    if not neutral and len(keep) > 1:
        if crowds is None:
            slopes = path.slopes[keep]
            within = _crowds(curve, path.u[keep], path.tangent[keep], slopes, tests.eigenvalues)
        else:
            within = np.logical_or.reduceat(crowds, keep[:-1])
        doubts = set(np.flatnonzero(within).tolist())
    for i in sorted(doubts | set(seek.interesting(tests))):
        for bracket in seek.explore(sample(i), sample(i + 1), DEPTH, force=True, crowd=i in doubts):
            found.append(replace(bracket, index=int(keep[i]), neutral=neutral))
    for i in np.flatnonzero(np.diff(keep) > 1).tolist():  # on a point left out there may be one
        a, b = (Sample(path.u[k], path.tangent[k], path.slopes[k]) for k in keep[i] + [0, 1])
        found.append(Bracket(a, b, frozenset({"touch"}), 0, int(keep[i])))
    if not path.closed and len(keep) > 1:
        found += _on_ends(curve, path, keep, tests, found)
    return found, eigenvalues, messages


class _Look(NamedTuple):
    """What compiled code sees of a path."""

    table: Array
    steps: npt.NDArray[np.int64]

    @property
    def crowds(self) -> npt.NDArray[np.intp]:
        """Steps in which more may cross than test functions tell."""
        return np.flatnonzero(self.steps[:, scan.CROWDED])


def _looked(curve: Curve, path: Path) -> _Look | None:
    """What compiled code sees of a path of a flow; nothing where that is not sure."""
    n, m, values, pairs = curve.n, curve.m, path.eigenvalues, _pairs_of(curve)
    few = n <= FEW and path.count > 2 and not (curve.discrete or path.closed)
    wanted = "neutral_saddle" in curve.detect and not curve.conservative
    if not (few and wanted) or values is None or not isinstance(path.slopes, np.ndarray):
        return None
    table, steps = (
        np.empty((path.count, scan.COLUMNS)),
        np.zeros((path.count - 1, scan.STEPS), np.int64),
    )
    slopes = path.slopes.reshape(path.count, n * m)
    doubt = scan.scan(
        path.u, path.tangent, slopes, values.real.copy(), values.imag.copy(),
        curve.scale[:m].copy(), int(pairs), table, steps,
    )  # fmt: skip
    thirds = slice(None, None, max(1, path.count // THIRDS))
    least = np.abs(table[thirds, scan.PAIR]) / largest(values[thirds])
    if doubt or not np.isfinite(table).all() or (pairs and not np.min(least) > MIRRORED):
        return None
    return _Look(table, steps)


def _brackets_of_look(curve: Curve, path: Path, look: _Look, doubts: set[int]) -> Told:
    """Brackets of a path of which compiled code has seen all, and those in steps in doubt."""
    table, steps = look
    values, pairs = path.eigenvalues, _pairs_of(curve)
    assert values is not None
    whole = table[:, [scan.BELOW, scan.REAL, scan.UNSTABLE]].astype(np.int64)
    found, seek = [], None
    whole_path = np.arange(path.count)
    for i in sorted(doubts.union(np.flatnonzero(steps[:, scan.MARKED]).tolist())):
        if steps[i, scan.SIMPLE] and i not in doubts:
            bits = int(steps[i, scan.CHANGES])
            changes = frozenset(name for name, bit in CHANGES.items() if bits & bit)
            a, b = (Sample(path.u[k], path.tangent[k], path.slopes[k]) for k in (i, i + 1))
            found.append(Bracket(a, b, changes, int(steps[i, scan.JUMP]), i))
            continue
        if seek is None:
            seek = _Seek(curve, pairs, False, True)
            tests = Tests(
                table[:, scan.FOLD], table[:, scan.BRANCH], table[:, scan.VOLUME],
                table[:, scan.PAIR], whole[:, 0], whole[:, 1], np.ones(path.count), whole[:, 2],
                values,
            )  # fmt: skip
        a, b = (seek.sample(path, whole_path, tests, k) for k in (i, i + 1))
        found += [
            replace(one, index=i)
            for one in seek.explore(a, b, DEPTH, force=True, crowd=i in doubts)
        ]
    return found, values, ()


def _in_doubt(
    crowded: Sequence[tuple[Curve, Path, npt.NDArray[np.intp]]],
) -> list[set[int]]:
    """In which of some steps of each path more may cross than test functions tell."""
    parts = [
        _steps_of(curve, path.u, path.tangent, np.asarray(path.slopes), steps)
        for curve, path, steps in crowded if len(steps)
    ]  # fmt: skip
    found = iter(doubtful_of_all(parts))
    return [set(steps[next(found)[0]].tolist()) if len(steps) else set() for *_, steps in crowded]


def _steps_of(
    curve: Curve, u: Array, tangent: Array, slopes: Array, steps: npt.NDArray[np.intp]
) -> Steps:
    """Some of the steps between points in a row."""
    # Of functions without derivatives, those along the path would take differences of differences.
    paces = None if curve.knows_slopes else paces_of(curve, u, slopes)
    ends = np.stack([steps, steps + 1])
    given = None if paces is None else paces[ends]
    return Steps(curve, u[ends], tangent[ends], slopes[ends], given)


def _crowds(
    curve: Curve, u: Array, tangent: Array, slopes: Array, values: npt.NDArray[np.complex128]
) -> npt.NDArray[np.bool_]:
    """In which steps between points in a row more may cross the axis than test functions tell."""
    found = crowded(curve, slopes, values)
    steps = np.flatnonzero(found)
    if len(steps):
        found[steps] = doubtful(_steps_of(curve, u, tangent, slopes, steps))[0]
    return found


def _all_tests(
    curve: Curve, path: Path, *, pairs: bool, saddles: bool, look: bool
) -> tuple[Tests, npt.NDArray[np.bool_] | None]:
    """The test functions of all points.

    Of many states, whose derivatives are taken once and for some points at a time, also in which
    steps more may cross, if that is looked at.
    """
    if isinstance(path.slopes, np.ndarray):
        tests = test_functions(
            curve, path.tangent, path.slopes, path.eigenvalues,
            pairs=pairs, neutral=False, saddles=saddles,
        )  # fmt: skip
        return tests, None
    crowds = np.zeros(max(path.count - 1, 0), dtype=bool)
    parts: list[Tests] = []
    behind: tuple[Array, npt.NDArray[np.complex128]] | None = None
    for some in path.slopes.chunks():
        # Differences of many states are sharp where a sign could hang on it.
        rough = curve.kind in REGULAR and not curve.knows_slopes
        slopes = Slopes(curve, path.u[some], sharp=not rough)[:]
        values = None
        if rough:
            slopes, values = sharpened(curve, path.u[some], slopes)
        own = test_functions(
            curve, path.tangent[some], slopes, values, pairs=pairs, neutral=False, saddles=saddles
        )
        parts.append(own)
        if not look:
            continue
        first, values = some.start, own.eigenvalues
        if behind is not None:
            first -= len(behind[0])
            slopes = np.concatenate([behind[0], slopes])
            values = np.concatenate([behind[1], values])
        steps = slice(first, some.stop - 1)
        crowds[steps] |= _crowds(
            curve, path.u[first : some.stop], path.tangent[first : some.stop], slopes, values
        )
        behind = slopes[-3:], values[-3:]  # points beside a step count
    whole = (np.concatenate([getattr(one, f.name) for one in parts]) for f in fields(Tests))
    return Tests(*whole), crowds


def _on_ends(
    curve: Curve, path: Path, keep: npt.NDArray[np.int64], tests: Tests, found: list[Bracket]
) -> list[Bracket]:
    """Brackets where the path ends on a special point, whatever signs rounding gives there."""
    more = []
    for end in (0, len(keep) - 1):
        # The path may come to its end in ever smaller steps.
        gap = (path.u[keep] - path.u[keep[end]])[:, : curve.m] / curve.scale[: curve.m]
        away = np.flatnonzero(largest(gap) > 1e-3)  # in scales of the unknowns
        if not len(away):
            continue
        beside = int(away[0] if end == 0 else away[-1])
        changes = set()
        if tests.volume[end] < tests.volume[beside] + np.log(ON_END):
            changes.add("branch")
        for name in ("fold", "pair", "flip"):
            values = np.abs(getattr(tests, name))
            if values[end] < ON_END * values[beside]:
                changes.add(name)
        within = range(*sorted((end, beside)))
        known = {n for one in found if one.index in keep[within] for n in one.changes}
        if changes - known:
            a, b = (
                Sample(path.u[k], path.tangent[k], path.slopes[k])
                for k in sorted((int(keep[end]), int(keep[beside])))
            )
            index = int(keep[min(end, len(keep) - 2)])
            more.append(Bracket(a, b, frozenset(changes - known), 0, index))
    return more


def _regular(tests: Tests) -> npt.NDArray[np.int64]:
    """Points that are no branch points themselves, where signs are those of rounding errors."""
    size = tests.volume
    around = np.maximum(np.append(size[1:], -np.inf), np.insert(size[:-1], 0, -np.inf))
    regular = size > around + np.log(1e-7)
    regular[[0, -1]] = True
    return np.flatnonzero(regular | (len(size) < 3))


def nearest_is_complex(curve: Curve, tests: Tests) -> bool:
    """Whether the pair with the least sum is conjugate, so that it crosses the imaginary axis.

    Of a map, that with a product next to 1, so that it crosses the unit circle.
    """
    values = tests.eigenvalues[tests.eigenvalues.imag > 0.0]
    above = np.abs(np.abs(values) ** 2 - 1.0 if curve.discrete else 2.0 * values.real)
    return bool(np.min(above, initial=np.inf) <= abs(float(tests.pair)) * (1.0 + 1e-9))


def _complex_unstable(tests: Tests) -> int:
    """How many conjugate pairs grow."""
    values = tests.eigenvalues
    return int(np.sum((values.imag > 0.0) & (values.real > 0.0)))


class _Seek:
    def __init__(self, curve: Curve, pairs: bool, neutral: bool, saddles: bool) -> None:
        self.curve, self.pairs, self.neutral = curve, pairs, neutral
        self.saddles = saddles or curve.discrete
        #: Others are one everywhere.
        self.names = [
            name
            for name in TESTS
            if not (name == "pair" and not pairs) and not (name == "flip" and not curve.discrete)
        ]
        self.seen: dict[int, tuple[Sample, Tests]] = {}  # the sample itself keeps its id alive

    def interesting(self, tests: Tests) -> list[int]:
        """Intervals with a change, and those beside a test function that almost has one."""
        marked: set[int] = set()
        count = len(tests.fold)
        for name in self.names:
            sign = np.sign(getattr(tests, name))
            marked.update(np.flatnonzero(sign[1:] != sign[:-1]).tolist())
            if count < 3:
                continue
            left, middle, right = self.sizes(tests, name)
            near = (sign[:-2] == sign[2:]) & falls(left, middle, right)
            for i in np.flatnonzero(near):
                marked.update((int(i), int(i) + 1))
        if self.pairs or self.curve.n > 1:
            marked.update(np.flatnonzero(np.diff(tests.unstable) != 0).tolist())
        if self.pairs:
            known = (tests.below[1:] >= 0) & (tests.below[:-1] >= 0)
            marked.update(np.flatnonzero(known & (np.diff(tests.below) != 0)).tolist())
        return sorted(marked)

    @staticmethod
    def sizes(tests: Tests, name: str) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Sizes of a test function at three points in a row, in units that may differ by triple."""
        value = tests.volume if name == "branch" else np.abs(getattr(tests, name))
        three = np.stack([value[:-2], value[1:-1], value[2:]])
        if name == "branch":
            three = np.exp(three - np.max(three, axis=0))
        return three[0], three[1], three[2]

    def sample(self, path: Path, keep: npt.NDArray[np.int64], tests: Tests, i: int) -> Sample:
        """A point of the path whose test functions are known."""
        k = keep[i]
        sample = Sample(path.u[k], path.tangent[k], path.slopes[k])
        own = Tests(*(getattr(tests, f.name)[i] for f in fields(Tests)))
        self.seen[id(sample)] = (sample, own)
        return sample

    def tests(self, sample: Sample) -> Tests:
        key = id(sample)
        if key not in self.seen:
            tests = test_functions(
                self.curve, sample.tangent, sample.slopes, None, pairs=self.pairs,
                neutral=self.neutral, saddles=self.saddles,
            )  # fmt: skip
            self.seen[key] = (sample, tests)
        return self.seen[key][1]

    def value(self, name: str, unit: float) -> Callable[[Sample], float]:
        """A test function of samples; that of branch points in units of exp(unit).

        Others take longer, and are not taken for it.
        """
        curve = self.curve

        def test(sample: Sample) -> float:
            if name == "fold":
                return float(sample.tangent[curve.n] / curve.scale[curve.n])
            if name == "branch":
                sign, volume = orientation(curve, sample.tangent, sample.slopes)
                return float(np.exp(np.minimum(volume - unit, 50.0))) * float(sign)
            return float(getattr(self.tests(sample), name))

        return test

    def explore(
        self, a: Sample, b: Sample, depth: int, *, force: bool, crowd: bool
    ) -> Iterator[Bracket]:
        """Brackets between two points; the interval is halved where it holds more than one."""
        one, two = self.tests(a), self.tests(b)
        changes = {n for n in self.names if np.sign(getattr(one, n)) != np.sign(getattr(two, n))}
        jump = abs(int(two.unstable) - int(one.unstable))
        simple = len(changes & {"fold", "branch", "flip"})
        if not self.saddles and jump <= simple:  # half the number of them passed a whole one
            changes.discard("pair")
        crosses = "pair" in changes and any(nearest_is_complex(self.curve, t) for t in (one, two))
        if not self.saddles:  # two real ones that cross look the same
            crosses &= _complex_unstable(one) != _complex_unstable(two)
        explained = simple + 2 * crosses
        pairs = self._sums(one, two, depth)
        odd = (jump - simple) % 2 != 0 and bool(changes or jump)
        # Where the path turns at a pitchfork, both change at once: halving finds nothing between.
        turns = changes == {"fold", "branch"} and jump in (0, 2)
        several = jump > explained or (len(changes) > 1 and not turns) or (odd and self.curve.n > 1)
        several |= pairs > 1
        doubt, both = self._doubt(a, b) if crowd and not several else (False, 0)
        several |= doubt
        if several and depth > 0:
            middle = between(self.curve, a, b, 0.5)
            if middle is not None:
                yield from self.explore(a, middle, depth - 1, force=False, crowd=crowd)
                yield from self.explore(middle, b, depth - 1, force=False, crowd=crowd)
                return
        if several and -PARTED < depth <= 0:
            middle = self._parted(a, b)
            if middle is not None:
                yield from self.explore(a, middle, depth - 1, force=False, crowd=crowd)
                yield from self.explore(middle, b, depth - 1, force=False, crowd=crowd)
                return
        if changes or jump or both:
            yield Bracket(a, b, frozenset(changes), jump, both=both)
        elif force or doubt:
            split, low = self._dip(a, b)
            if split is None and low is not None:
                yield Bracket(a, low, frozenset({"touch"}), 0)
            elif split is not None:
                yield from self.explore(a, split, depth - 1, force=False, crowd=crowd)
                yield from self.explore(split, b, depth - 1, force=False, crowd=crowd)

    def _parted(self, a: Sample, b: Sample) -> Sample | None:
        """A point between two eigenvalues that cross, if these surely do so one after the other."""
        # Double multipliers of maps fall apart by rounding: halving alone parts them.
        if self.neutral or self.curve.n < 2 or self.curve.discrete:
            return None
        at = places(self.curve, np.array([a.slopes, b.slopes]))
        gaps = np.diff(at)
        if not len(gaps) or not gaps.max() > APART:
            return None
        k = int(np.argmax(gaps))
        return between(self.curve, a, b, float(0.5 * (at[k] + at[k + 1])))

    def _doubt(self, a: Sample, b: Sample) -> tuple[bool, int]:
        """Whether more may cross between two points than signs tell, and how many both ways."""
        if self.neutral or self.curve.n < 2:
            return False, 0
        u, tangent, slopes = (
            np.array([[getattr(one, name)] for one in (a, b)])
            for name in ("u", "tangent", "slopes")
        )
        doubt, both = doubtful(Steps(self.curve, u, tangent, slopes))
        return bool(doubt[0]), int(both[0])

    def _sums(self, one: Tests, two: Tests, depth: int) -> int:
        """How many sums of two eigenvalues change their sign, at least, as far as counts tell.

        Where real eigenvalues meet, or part, others count: then a shorter interval tells more.
        """
        if not self.pairs or min(int(one.below), int(two.below)) < 0:
            return 0
        if int(one.real) == int(two.real) or depth > DEPTH - MEET:
            return abs(int(one.below) - int(two.below))
        return 0

    def _dip(self, a: Sample, b: Sample) -> tuple[Sample | None, Sample | None]:
        """A point between with the other sign of a test function that almost vanishes, if any.

        And, if there is none, one next to which the determinant touches zero.
        """
        touch = None
        inside = functools.cache(lambda s: between(self.curve, a, b, s))
        for name in self.names:
            test = self.value(name, float(self.tests(a).volume))
            first, last = test(a), test(b)
            sign, marks = np.sign(first), [(0.0, abs(first)), (1.0, np.sign(first) * last)]
            ends = min(value for _, value in marks)
            for new in (1.0 - GOLDEN, GOLDEN, *[None] * PARABOLAS):
                s = _lowest(marks) if new is None else new
                sample = None if s is None else inside(s)
                if s is not None and sample is None:  # on a point where branches meet
                    s += BESIDE * (min((t for t, _ in marks if t > s), default=1.0) - s)
                    sample = inside(s)
                if s is None or sample is None:
                    break
                value = float(sign * test(sample))
                if value <= (-FLAT if name == "fold" else 0.0):
                    return sample, None
                if name == "branch" and value < TOUCH * ends:
                    touch = sample
                marks = sorted([*marks, (s, value)])
        return None, touch


def _lowest(marks: list[tuple[float, float]]) -> float | None:
    """Where a parabola through the least of values and those beside it is lowest; or nowhere new.

    Where it is the least itself, the middle of the longer side.
    """
    least = min(range(len(marks)), key=lambda i: marks[i][1])
    k = min(max(least, 1), len(marks) - 2)
    (x, f), (y, g), (z, h) = marks[k - 1 : k + 2]
    left, right = (y - x) * (g - h), (y - z) * (g - f)
    with np.errstate(all="ignore"):
        found = y - 0.5 * np.divide((y - x) * left - (y - z) * right, left - right)
    if k != least:  # the function falls towards an end
        return float(found) if x < found < z else None
    if not x < found < z or abs(found - y) < NARROW * (z - x):
        found = y + (1.0 - GOLDEN) * (z - y if z - y > y - x else x - y)
    return float(found) if z - x > NARROW else None
