"""Special points on a path of many states: where signs change, one point each."""

from __future__ import annotations

import itertools
from dataclasses import replace

import numpy as np
import numpy.typing as npt

from phasekit.bifurcation.continuation.large.curve import LargeCurve
from phasekit.bifurcation.continuation.large.hopf import hopf_points
from phasekit.bifurcation.continuation.large.path import LargePath
from phasekit.bifurcation.continuation.large.singular import branch_point, fold
from phasekit.bifurcation.continuation.locate import FLAT
from phasekit.bifurcation.continuation.placed import Placed
from phasekit.bifurcation.continuation.points.special import Special
from phasekit.numerics.rightmost import Spectrum, spectrum_at
from phasekit.numerics.waits import stage

Array = npt.NDArray[np.float64]

ALONG, SIDE, POSITIVE = range(3)


def find(curve: LargeCurve, path: LargePath) -> tuple[LargePath, list[Placed], tuple[str, ...]]:
    """A path that knows how many eigenvalues grow, its special points, and what is not certain."""
    detect = curve.detect
    if not detect:
        return path, [], ()
    with np.errstate(all="ignore"):
        return _find(curve, path, detect)


def _find(
    curve: LargeCurve, path: LargePath, detect: tuple[str, ...]
) -> tuple[LargePath, list[Placed], tuple[str, ...]]:
    tests = path.tests
    lost = np.isfinite(tests[:, SIDE]) & (tests[:, POSITIVE] < 0.0)
    spectra = spectra_of(curve, path) if "hopf" in detect and lost.any() else []
    placed: list[Placed] = []
    messages: list[str] = []
    rest: list[tuple[int, str]] = []  # of zeros that cross, those that are not found, and where
    if "neutral_saddle" in detect:
        messages.append("neutral saddles are not looked for, of fields of states")
    if spectra:
        tests = tests.copy()
        tests[:, POSITIVE] = [one.positive for one in spectra]
        path = replace(path, tests=tests)
        missing = sum(not one.complete for one in spectra)
        if missing:
            messages.append(
                f"at {missing} of {path.count} points not all eigenvalues right of the axis are "
                "known: n_unstable is -1 there, and Hopf points next to them may be missing"
            )
    stage(f"looking for special points on {path.count:,} points")
    own = np.flatnonzero(np.isfinite(tests[:, SIDE]))  # on a branch point it starts at nothing is
    for i, j in itertools.pairwise(own.tolist()):
        a, b = tests[i], tests[j]
        crosses, turns = a[SIDE] * b[SIDE] < 0.0, a[ALONG] * b[ALONG] <= 0.0 and a[ALONG] != 0.0
        jump = int(abs(b[POSITIVE] - a[POSITIVE])) if min(a[POSITIVE], b[POSITIVE]) >= 0 else 0
        found: list[Special] = []
        if crosses and "branch_point" in detect:
            found.append(branch_point(curve, path.u[i], path.u[j]))
        elif turns and not crosses and "fold" in detect and _moves(curve, path, i, j):
            found.append(fold(curve, path.u[i], path.u[j]))
        left = jump - len(found)
        if spectra and min(a[POSITIVE], b[POSITIVE]) >= 0:
            pairs, more = hopf_points(curve, path.u[i], path.u[j], (spectra[i], spectra[j]))
            left = int(abs(b[POSITIVE] - a[POSITIVE] - 2 * more)) - len(found)
            found += pairs
        at = f"{curve.free} between {path.u[i, curve.n]:.9g} and {path.u[j, curve.n]:.9g}"
        rest.append((left, at))
        for one in found:
            if j > i + 1:  # it is the start itself
                placed.append(Placed(i, 1.0, one))
            else:
                placed.append(placement(curve, path, i, one))
    messages += _unfound(rest)
    placed.sort(key=lambda one: (one.index, one.along))
    return path, placed, tuple(messages)


def _unfound(rest: list[tuple[int, str]]) -> list[str]:
    """What is said of zeros that cross and are not found.

    One that was found where none crosses is that of the next step: it is on a point, but for
    rounding.
    """
    counts = [count for count, _ in rest]
    for k, j in itertools.product(range(len(counts)), (-1, 1)):
        if 0 <= k + j < len(counts) and counts[k] < 0 < counts[k + j]:
            same = min(-counts[k], counts[k + j])
            counts[k], counts[k + j] = counts[k] + same, counts[k + j] - same
    return [
        f"{count} more eigenvalues cross zero together at {at}: not refined"
        for count, (_, at) in zip(counts, rest, strict=True) if count > 0
    ]  # fmt: skip


def spectra_of(curve: LargeCurve, path: LargePath) -> list[Spectrum]:
    """Eigenvalues right of the axis and next to it, at all points of a path."""
    found = []
    for k, u in enumerate(path.u):
        stage(f"eigenvalues of {k:,} of {path.count:,} points")
        matrix, _ = curve.derivatives(u)
        found.append(spectrum_at(matrix, curve.scale[: curve.n]))
    return found


def _moves(curve: LargeCurve, path: LargePath, i: int, j: int) -> bool:
    """Whether the parameter moves between two points by more than rounding."""
    ends = path.u[[i, j], curve.n]
    along = np.max(np.abs(path.tests[[i, j], ALONG]))
    return bool(along >= FLAT and np.ptp(ends) > FLAT * np.max(np.abs(ends)))


def placement(curve: LargeCurve, path: LargePath, i: int, special: Special) -> Placed:
    """Where between two points of the path a special point stands."""
    chord, gap = path.u[i + 1] - path.u[i], special.u - path.u[i]
    square = float(curve.weight @ chord**2)
    return Placed(i, float(curve.weight @ (chord * gap)) / square if square else 0.0, special)
