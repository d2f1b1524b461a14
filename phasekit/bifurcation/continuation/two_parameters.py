"""Curves of folds, Hopf and branch points in two parameters, and the special points on them."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from phasekit.bifurcation.continuation import normal_form as forms
from phasekit.bifurcation.continuation.curve import Curve
from phasekit.bifurcation.continuation.kernels.defining import BRANCH, FOLD, HOPF
from phasekit.bifurcation.continuation.path import Path, Sample, between, bracket_root
from phasekit.bifurcation.continuation.placed import Placed, unique
from phasekit.bifurcation.continuation.points.special import (
    CONVERGED,
    GUESS,
    Special,
    extended,
)
from phasekit.bifurcation.continuation.spectrum import eigenvalues_of, pair_function
from phasekit.bifurcation.continuation.units import force_sizes

Array = npt.NDArray[np.float64]

GOLDEN = 18  # halvings, nearly, of a step in which a test function may touch zero


def two_parameter_curve(curve: Curve, special: Special, kind: int) -> tuple[Curve, Sample] | None:
    """The curve through a special point with one more free parameter, and the point on it.

    ``curve`` has both parameters free; None where the curve has no tangent there.
    """
    n, m = curve.n, curve.m
    assert special.extra is not None
    extra, aux = special.extra, None
    if kind == HOPF:
        extra, aux = extra[: n + 1], extra[n + 1 :]
    u = np.concatenate([special.u[: n + 1], [curve.par[curve.active[1]]], extra])
    made = extended(curve, kind, u, extra, aux)
    # One of the two parameters is held: that one for which the square system is regular.
    best = None
    for i in (n + 1, n):
        row = np.zeros(made.size)
        row[i] = 1.0
        point = made.refine(u, row)
        if point.converged and made.length(point.u - u) < 1e-3:
            slopes = point.tangent
            if best is None or abs(slopes[i]) / made.scale[i] > best[0]:
                best = (abs(slopes[i]) / made.scale[i], point)
    if best is None:
        return None
    point = best[1]
    if kind == BRANCH:
        # Points of this curve are branch points only where f itself vanishes, not f + b w.
        sizes = force_sizes(curve, u)
        most = 1e-6 / float(np.max(np.abs(point.u[m : m + n]) / sizes))
        if abs(point.tangent[-1]) > most * made.length(point.tangent):
            return None
        low, high = made.low.copy(), made.high.copy()
        low[-1], high[-1] = -most, most
        made = made.replace(low=low, high=high)
    t = point.tangent / made.length(point.tangent)
    lead = t[n + 1] if abs(t[n + 1]) > 1e-9 * made.scale[n + 1] else t[n]
    t = -t if lead < 0.0 else t
    return made, Sample(point.u, t, point.slopes[:, :m])


@dataclass(frozen=True)
class _Test:
    """A test function of points of a curve (arrays of them), and the kind of its zeros."""

    kind: str
    values: Callable[[Array, Array], Array]

    def value(self, s: Sample) -> float:
        """The test function at one point."""
        return float(self.values(s.u[None], s.slopes[None])[0])


def find_on(curve: Curve, path: Path) -> list[Placed]:
    """Cusp, Bogdanov-Takens, zero-Hopf, generalized Hopf and double Hopf points of a curve."""
    found: list[Placed] = []
    m = curve.m
    for test in _tests(curve):
        values = test.values(path.u, path.slopes[:])
        for i in _interesting(values):
            for a, b in _changes(curve, path, values, i, test):
                special = _locate(curve, a, b, test)
                if special is not None:
                    chord = path.u[i + 1] - path.u[i]
                    ahead = (curve.weight * chord)[:m]
                    gap = np.dot(ahead, special.u - path.u[i, :m])
                    square = np.dot(ahead, chord[:m])
                    found.append(Placed(i, float(gap / square), special))
    return _without_echoes(curve, unique(curve, path, found))


def _interesting(values: Array) -> list[int]:
    """Intervals in which the sign changes, or whose neighbours on both sides are farther from 0."""
    sign, size = np.sign(values), np.abs(values)
    finite = np.isfinite(values)
    change = (sign[1:] != sign[:-1]) & finite[1:] & finite[:-1]
    before = np.append(np.inf, size[:-2])
    after = np.append(size[2:], np.inf)
    dip = (before > size[:-1]) & (after > size[1:]) & finite[1:] & finite[:-1]
    return [int(i) for i in np.flatnonzero(change | dip)]


def _changes(
    curve: Curve, path: Path, values: Array, i: int, test: _Test
) -> list[tuple[Sample, Sample]]:
    """Where a test function changes its sign from one point to the next, or dips to it between."""
    a, b = (Sample(path.u[k], path.tangent[k], path.slopes[k]) for k in (i, i + 1))
    if np.sign(values[i]) != np.sign(values[i + 1]):
        return [(a, b)]
    sign = np.sign(values[i])

    def height(s: float) -> float:
        sample = between(curve, a, b, s)
        return np.inf if sample is None else sign * test.value(sample)

    # Golden section, to where the sign is another or the function is lowest.
    low, high = 0.0, 1.0
    ratio = 0.5 * (np.sqrt(5.0) - 1.0)
    one, two = 1.0 - ratio, ratio
    at_one, at_two = height(one), height(two)
    for _ in range(GOLDEN):
        if min(at_one, at_two) < 0.0:
            middle = between(curve, a, b, one if at_one < at_two else two)
            return [] if middle is None else [(a, middle), (middle, b)]
        if at_one < at_two:
            high, two, at_two = two, one, at_one
            one = high - ratio * (high - low)
            at_one = height(one)
        else:
            low, one, at_one = one, two, at_two
            two = low + ratio * (high - low)
            at_two = height(two)
    return []


def _left(curve: Curve, u: Array, slopes: Array) -> tuple[Array, Array]:
    """Left and right null vectors of f_x at points of a fold curve; both move smoothly along it.

    The adjugate of f_x is smooth and a multiple of v p; so p is the adjugate's transpose on v.
    """
    n, m = curve.n, curve.m
    scale = curve.scale[:n]
    v = u[:, m : m + n] / scale
    scaled = slopes[:, :, :n] * scale
    rows = np.max(np.abs(slopes * curve.scale[:m]), axis=2)
    # Each row by the same number at all points, so that nothing jumps.
    rows = np.max(rows, axis=0)
    scaled = scaled / np.where(rows > 0.0, rows, 1.0)[:, None]
    return np.einsum("kij,ki->kj", _adjugate(scaled), v) / np.where(rows > 0.0, rows, 1.0), v


def _adjugate(matrix: Array) -> Array:
    """Adjugates of singular matrices."""
    n = matrix.shape[-1]
    if n == 1:
        return np.ones_like(matrix)
    if n == 2:
        a, b, c, d = (matrix[:, i, j] for i in (0, 1) for j in (0, 1))
        return np.stack([np.stack([d, -b], -1), np.stack([-c, a], -1)], -2)
    left, values, right = np.linalg.svd(matrix)
    sign = np.linalg.det(left) * np.linalg.det(right)
    size = np.exp(np.mean(np.log(np.maximum(values[:, :-1], 1e-300)), axis=1))
    return np.asarray((sign * size)[:, None, None] * right[:, -1, :, None] * left[:, None, :, -1])


def _tests(curve: Curve) -> list[_Test]:
    n, m = curve.n, curve.m
    if curve.kind == FOLD:
        tests = [_Test("cusp", lambda u, slopes: _cusp(curve, u, slopes))]
        if curve.discrete:  # what f(x) - x has besides is no point of the map
            return tests
        if n > 1:
            tests.append(_Test("bogdanov_takens", lambda u, slopes: _zero(curve, u, slopes)))
        if n > 2:
            tests.append(_Test("zero_hopf", lambda u, slopes: _rest(slopes)))
        return tests
    if curve.kind == HOPF:
        tests = [
            _Test("bogdanov_takens", lambda u, slopes: u[:, m + n]),
            _Test("generalized_hopf", lambda u, slopes: _lyapunov(curve, u, slopes)),
        ]
        if n > 2:
            tests.append(_Test("zero_hopf", lambda u, slopes: np.linalg.det(slopes[:, :, :n])))
        if n > 3:
            tests.append(_Test("hopf_hopf", lambda u, slopes: _others(curve, u, slopes)))
        return tests
    return []


def _cusp(curve: Curve, u: Array, slopes: Array) -> Array:
    n, m = curve.n, curve.m
    p, _ = _left(curve, u, slopes)
    v = u[:, m : m + n]
    z = np.zeros((len(u), m))
    z[:, :n] = v
    bent = curve.bend_all(u, z)[:, :, :n]
    return np.asarray(np.einsum("ki,kij,kj->k", p, bent, v))


def _zero(curve: Curve, u: Array, slopes: Array) -> Array:
    p, v = _left(curve, u, slopes)
    return np.asarray(np.sum(p * v * curve.scale[: curve.n], axis=1))


def _rest(slopes: Array) -> Array:
    """The pair function of all eigenvalues but the one that is zero."""
    values = eigenvalues_of(slopes)
    place = np.argmin(np.abs(values), axis=1)
    keep = np.arange(values.shape[1]) != place[:, None]
    return pair_function(values[keep].reshape(len(values), -1))


def _without_pair(curve: Curve, u: Array, slopes: Array) -> npt.NDArray[np.complex128]:
    """All eigenvalues, on scaled axes, but the pair of the Hopf point, at each point."""
    n, m = curve.n, curve.m
    scale = curve.scale[:n]
    values = eigenvalues_of(slopes[:, :, :n] * scale / scale[:, None])
    root = np.sqrt(u[:, m + n].astype(complex))[:, None]  # i omega, or r of r and -r
    for one in (1j * root, -1j * root):
        place = np.argmin(np.abs(values - one), axis=1)
        keep = np.arange(values.shape[1]) != place[:, None]
        values = values[keep].reshape(len(values), -1)
    return values


def _others(curve: Curve, u: Array, slopes: Array) -> Array:
    """The pair function of all eigenvalues but the pair of the Hopf point."""
    return pair_function(_without_pair(curve, u, slopes))


def _other_pair(curve: Curve, s: Sample) -> bool:
    """Whether the two others whose sum vanishes are conjugate."""
    values = _without_pair(curve, s.u[None], s.slopes[None])[0]
    above = values[values.imag > 0.0]
    least = np.min(np.abs(2.0 * above.real), initial=np.inf)
    return bool(least <= abs(float(pair_function(values))) * (1.0 + 1e-9))


def _lyapunov(curve: Curve, u: Array, slopes: Array) -> Array:
    n, m = curve.n, curve.m
    size = np.max(np.abs(slopes[:, :, :n]), axis=(1, 2))
    found = np.full(len(u), np.nan)
    for i in np.flatnonzero(u[:, m + n] > 1e-8 * np.maximum(1e-300, size**2)):
        d = forms.Derivatives(curve, u[i])
        found[i] = forms.hopf(d, float(np.sqrt(u[i, m + n])))["l1"]
    return found


def _locate(curve: Curve, a: Sample, b: Sample, test: _Test) -> Special | None:
    n, m = curve.n, curve.m
    best, _, _ = bracket_root(curve, a, b, test.value, steps=60, width=1e-15)
    value = abs(test.value(best))
    size = max(abs(test.value(a)), abs(test.value(b)))
    if test.kind == "zero_hopf" and curve.kind == FOLD:
        rest = eigenvalues_of(best.slopes)
        rest = np.delete(rest, np.argmin(np.abs(rest)))
        if not np.any(rest.imag != 0.0):
            return None  # two real eigenvalues: a neutral saddle with a zero eigenvalue
    if test.kind == "zero_hopf" and curve.kind == HOPF and not best.u[m + n] > 0.0:
        return None
    if test.kind == "hopf_hopf" and not (best.u[m + n] > 0.0 and _other_pair(curve, best)):
        return None
    # A test function that jumps instead of passing zero is no point.
    if not value <= 1e-3 * size:
        return None
    ends = float(min(a.u[n], b.u[n])), float(max(a.u[n], b.u[n]))
    residual = max(value, float(np.max(np.abs(curve.at(best.u)[0]))))
    sharp = value <= max(1e-6, 1e2 * curve.field.accuracy) * size
    return Special(
        test.kind, best.u[: curve.m], ends, residual, CONVERGED if sharp else GUESS,
        "" if sharp else "the test function was not brought to zero", tangent=best.tangent,
        extra=best.u[m:],
    )  # fmt: skip


def _without_echoes(curve: Curve, placed: list[Placed]) -> list[Placed]:
    """Leave out what other test functions show of a Bogdanov-Takens point."""
    takens = [one.special.u for one in placed if one.special.kind == "bogdanov_takens"]
    kept = []
    for one in placed:
        near = any(_distance(curve, one.special.u, u) < 1e-5 for u in takens)
        if one.special.kind != "bogdanov_takens" and near:
            continue
        kept.append(one)
    return kept


def _distance(curve: Curve, a: Array, b: Array) -> float:
    m = curve.m
    return float(np.sqrt(np.sum(((a[:m] - b[:m]) / curve.scale[:m]) ** 2)))
