"""Equilibria against recorded values, the exact oracle, and systems whose answer is known."""

from __future__ import annotations

import numpy as np
import pytest
from mpmath import mpf
from properties.strategies import FAMILIES
from witnesses import oracle

from phasekit.errors import EquilibriumKind, ParameterError
from phasekit.phase.exact.phase_space import equilibria

UNIT = 2.0**-53
LC, LS, UC, US = range(4)
CODES = {"center": EquilibriumKind.CENTER, "saddle": EquilibriumKind.SADDLE}
KINDS = {"cusp": "degenerate", "fold": "degenerate"}
RECORDED = oracle.cases("equilibria")


def code(kind: str) -> int:
    return int(CODES.get(kind, EquilibriumKind.DEGENERATE))


def angle_tolerance(A: float, B: float, C: float, phi) -> float:
    """Return 2e-15 + min(4 u kappa, 2e-14), next to a cusp 1e-12.

    Next to a cusp: within 0.02 of a multiple of pi/2 where kappa is in the saturated range.
    """
    conditioned = 4 * UNIT * float(min(oracle.kappa(A, B, C, phi), mpf(10) ** 30))
    if conditioned > 2e-14 and abs(np.sin(2 * float(phi))) < 0.04:
        return 1e-12
    return 2e-15 + min(conditioned, 2e-14)


def check(A: float, B: float, C: float, name: str = "") -> None:
    """Compare everything with the oracle, label by label."""
    points, want = equilibria(A, B, C), oracle.labelled(A, B, C)
    system = (name, A, B, C)
    assert points.n_equilibria == len(want), system
    scale = abs(A) + abs(B) + abs(C)
    for k, label in enumerate(oracle.LABELS):
        if label not in want:
            assert points.kind[k] == EquilibriumKind.ABSENT, (*system, label)
            assert np.isnan(points.phi[k]), (*system, label)
            continue
        point = want[label]
        assert points.kind[k] == code(point.kind), (*system, label)
        within = angle_tolerance(A, B, C, point.phi)
        off = oracle.apart(float(points.phi[k]), point.phi)
        assert off <= within, (*system, label, float(off), within)
        third = abs(B) + 2 * abs(A) + abs(C)
        off = abs(mpf(float(points.curvature[k])) - point.curvature)
        assert off <= 8 * UNIT * scale + third * within, (*system, label, float(off))
        off = abs(mpf(float(points.energy[k])) - point.energy)
        assert off <= 8 * UNIT * scale, (*system, label, float(off))
    margin = oracle.fold_margin(A, B, C)
    got = mpf(float(points.fold_margin))
    assert got == margin or abs(got - margin) <= mpf("1e-13") * abs(margin), (*system, got)


@pytest.mark.parametrize("case", RECORDED, ids=lambda case: case["id"])
def test_recorded_values(case):
    A, B, C = (float(case["in"][name]) for name in "ABC")
    points, out = equilibria(A, B, C), case["out"]
    assert points.n_equilibria == out["n"]
    present = np.flatnonzero(points.kind != EquilibriumKind.ABSENT)
    assert present.size == out["n"]
    matched = set()
    for want in out["equilibria"]:
        distance = [float(oracle.apart(points.phi[k], want["phi"])) for k in present]
        k = present[int(np.argmin(distance))]
        matched.add(int(k))
        assert min(distance) <= angle_tolerance(A, B, C, mpf(want["phi"]))
        assert points.kind[k] == code(want["type"])
        slot = {"fold": LS, "cusp_center": LC, "cusp_saddle": US}.get(want["type"])
        assert slot is None or slot == k
        scale = abs(A) + abs(B) + abs(C)
        assert abs(mpf(float(points.energy[k])) - mpf(want["V"])) <= 8 * UNIT * scale
    assert len(matched) == out["n"]
    distance = mpf(out["fold_distance"])
    if out["discriminant_sign"] == 0:
        assert points.fold_margin == 0
    elif A == 0:
        assert points.fold_margin == -np.inf
    else:
        assert abs(mpf(float(points.fold_margin)) + distance) <= mpf("1e-13") * abs(distance)
    check(A, B, C)


@pytest.mark.slow
@pytest.mark.parametrize("family", FAMILIES)
def test_against_exact_arithmetic(family):
    rng = np.random.default_rng(23)
    for A, B, C in np.array(FAMILIES[family](rng, 25)).T:
        check(float(A), float(B), float(C), family)


@pytest.mark.parametrize("A", [2.0, -2.0])
@pytest.mark.parametrize("u", [1e-3, 1e-6, 1e-9, 1e-12, 1e-15])
def test_next_to_a_fold_on_either_side(A, u):
    """No kappa here: next to a fold it is 1/sqrt(u), but for exact A, B, C angles keep 2e-14."""
    for theta in (0.2, 0.7, 1.4):
        for side in (-1, 1):
            size = abs(A) * (1 + side * u)
            check(A, -size * np.cos(theta) ** 3, size * np.sin(theta) ** 3)


def test_pendulum():
    """A = 0: a center at atan2(C, B), a saddle opposite to it, at distance infinity of a fold."""
    for turned in np.linspace(-3, 3, 13):
        B, C = 2.5 * np.cos(turned), 2.5 * np.sin(turned)
        points = equilibria(0.0, B, C)
        assert list(points.kind) == [1, 0, 0, 2]
        assert abs(points.phi[LC] - turned) < 2e-15
        assert oracle.apart(points.phi[US], turned + np.pi) < 2e-15
        assert abs(points.energy[US] - 2.5) < 2e-15
        assert abs(points.natural_frequency[LC] - np.sqrt(2.5)) < 1e-15
        assert abs(points.exponent[US] - np.sqrt(2.5)) < 1e-15
        assert points.fold_margin == -np.inf
        assert points.n_equilibria == 2


TIES = {
    # Where symmetry makes energies equal, labels are those of the limit B, C -> 0+.
    (3.0, 0.0, 0.0): (np.pi / 2, 0.0, -np.pi / 2, np.pi),
    (-3.0, 0.0, 0.0): (0.0, np.pi / 2, np.pi, -np.pi / 2),
    (2.0, 0.0, 1.0): (np.pi / 2, -np.pi / 6, -np.pi / 2, -5 * np.pi / 6),
    (2.0, 0.0, -1.0): (-np.pi / 2, np.pi / 6, np.pi / 2, 5 * np.pi / 6),
    (2.0, 1.0, 0.0): (np.pi / 3, 0.0, -np.pi / 3, np.pi),
    (2.0, -1.0, 0.0): (2 * np.pi / 3, np.pi, -2 * np.pi / 3, 0.0),
    (-2.0, 1.0, 0.0): (0.0, 2 * np.pi / 3, np.pi, -2 * np.pi / 3),
    (-2.0, -1.0, 0.0): (np.pi, np.pi / 3, 0.0, -np.pi / 3),
    (-2.0, 0.0, 1.0): (np.pi / 6, np.pi / 2, 5 * np.pi / 6, -np.pi / 2),
    (-2.0, 0.0, -1.0): (-np.pi / 6, -np.pi / 2, -5 * np.pi / 6, np.pi / 2),
}


@pytest.mark.parametrize("system", TIES)
@pytest.mark.parametrize("zero", [0.0, -0.0])
def test_ties_are_the_limit_of_small_positive_coefficients(system, zero):
    A, B, C = (x if x else zero for x in system)
    points = equilibria(A, B, C)
    assert list(points.kind) == [1, 2, 1, 2]
    assert np.all(np.abs(points.phi - TIES[system]) < 1e-15)  # pi is +pi
    nearby = equilibria(A, B or 1e-18, C or 1e-18).phi
    assert max(oracle.apart(x, y) for x, y in zip(points.phi, nearby, strict=True)) < 1e-15
    check(A, B, C)


DEGENERATE = {
    # Kinds by label, and the degenerate angle, which is known exactly.
    (125.0, 27.0, 64.0): ([1, 3, 0, 2], -np.arctan2(4, 3)),
    (125.0, -27.0, 64.0): ([1, 3, 0, 2], np.arctan2(4, 3) - np.pi),
    (125.0, 27.0, -64.0): ([1, 3, 0, 2], np.arctan2(4, 3)),
    (125.0, -27.0, -64.0): ([1, 3, 0, 2], np.pi - np.arctan2(4, 3)),
    (-125.0, 27.0, 64.0): ([1, 3, 0, 2], np.pi / 2 + np.arctan2(3, 4)),
    (-125.0, 64.0, -27.0): ([1, 3, 0, 2], -np.pi / 2 - np.arctan2(4, 3)),
    (1.0, 1.0, 0.0): ([3, 0, 0, 2], 0.0),
    (1.0, -1.0, 0.0): ([3, 0, 0, 2], np.pi),
    (-1.0, 0.0, 1.0): ([3, 0, 0, 2], np.pi / 2),
    (-1.0, 0.0, -1.0): ([3, 0, 0, 2], -np.pi / 2),
    (1.0, 0.0, 1.0): ([1, 0, 0, 3], -np.pi / 2),
    (1.0, 0.0, -1.0): ([1, 0, 0, 3], np.pi / 2),
    (-1.0, 1.0, 0.0): ([1, 0, 0, 3], np.pi),
    (-1.0, -1.0, 0.0): ([1, 0, 0, 3], 0.0),
}


@pytest.mark.parametrize("system", DEGENERATE)
@pytest.mark.parametrize("factor", [1.0, 27.0, 2.0**-300, 2.0**300])
def test_degenerate_points_are_told_apart_exactly(system, factor):
    A, B, C = (x * factor for x in system)
    points, (kinds, phi) = equilibria(A, B, C), DEGENERATE[system]
    assert list(points.kind) == kinds
    k = kinds.index(3)
    assert abs(points.phi[k] - phi) < 1e-15
    assert points.curvature[k] == 0
    assert points.fold_margin == 0
    assert points.n_equilibria == sum(kind != 0 for kind in kinds)
    if factor in (1.0, 27.0):
        check(A, B, C)


@pytest.mark.slow
def test_one_unit_off_a_degenerate_point_is_not_degenerate():
    for A, B, C in DEGENERATE:
        for towards in (0.0, np.inf):
            moved = float(np.nextafter(abs(A), towards)) * np.sign(A)
            points = equilibria(moved, B, C)
            assert points.n_equilibria == oracle.count(moved, B, C) == (2 if towards == 0 else 4)
            assert np.sign(points.fold_margin) == (-1 if towards == 0 else 1)
            assert EquilibriumKind.DEGENERATE not in points.kind
            check(moved, B, C)


def test_no_force_has_no_isolated_equilibrium():
    points = equilibria(0.0, -0.0, 0.0)
    assert points.n_equilibria == 0
    assert np.all(points.kind == EquilibriumKind.ABSENT)
    assert np.isnan(points.fold_margin)
    for name in ("phi", "energy", "curvature", "natural_frequency", "exponent"):
        assert np.all(np.isnan(getattr(points, name))), name


def test_wrapping_at_pi():
    """A root exactly at pi is +np.pi, one just above -pi is -np.pi."""
    assert equilibria(2.0, 1.0, 0.0).phi[US] == np.pi
    assert equilibria(2.0, 1.0, 1e-18).phi[US] == -np.pi
    assert equilibria(2.0, 1.0, -1e-18).phi[US] == np.pi
    assert equilibria(0.0, 1.0, 0.0).phi[US] == np.pi
    assert equilibria(0.0, -1.0, 1e-300).phi[LC] == np.pi
    assert equilibria(0.0, -1.0, -1e-300).phi[LC] == -np.pi
    assert equilibria(-2.0, 1.0, 0.0).phi[UC] == np.pi


def test_shapes_and_dtypes():
    A, B = np.array([[2.0], [-1.0], [0.5]]), np.array([0.3, 0.1, 0.0, 1.0])
    points = equilibria(A, B, 0.25)
    for name in ("phi", "kind", "energy", "curvature", "natural_frequency", "exponent"):
        assert getattr(points, name).shape == (3, 4, 4), name
        want = getattr(equilibria(-1.0, 0.1, 0.25), name)
        assert np.array_equal(getattr(points, name)[1, 1], want, equal_nan=True), name
    assert points.n_equilibria.shape == points.fold_margin.shape == (3, 4)
    assert points.kind.dtype == points.n_equilibria.dtype == np.int8
    assert equilibria(2, 1, 0).phi.shape == (4,)
    assert equilibria(np.float32(2), np.array(1), 0).phi.dtype == np.float64
    assert equilibria(np.empty((0, 3)), 1.0, 0.0).phi.shape == (0, 3, 4)
    column = np.linspace(-2, 2, 2000).reshape(2, 1000)
    for turned in (column.T, column[:, ::-1], column[::2, ::3]):
        points = equilibria(turned, 0.5, 0.25)
        again = equilibria(np.ascontiguousarray(turned), 0.5, 0.25)
        assert np.array_equal(points.phi, again.phi, equal_nan=True)


@pytest.mark.parametrize("bad", [np.nan, np.inf, -np.inf])
@pytest.mark.parametrize("size", [2, 300, 5000])
def test_invalid_cells_leave_the_others_untouched(bad, size):
    rng = np.random.default_rng(2)
    system = rng.normal(size=(3, size))
    whole = equilibria(*system)
    hit = np.sort(rng.choice(size, max(1, size // 7), replace=False))
    spoilt = system.copy()
    spoilt[rng.integers(0, 3, hit.size), hit] = bad
    points = equilibria(*spoilt)
    rest = np.setdiff1d(np.arange(size), hit)
    for name in points._fields:
        got, want = getattr(points, name), getattr(whole, name)
        assert np.array_equal(got[rest], want[rest], equal_nan=name[0] != "k"), name
    assert np.all(points.n_equilibria[hit] == -1)
    assert np.all(points.kind[hit] == EquilibriumKind.ABSENT)
    for name in ("phi", "energy", "curvature", "natural_frequency", "exponent", "fold_margin"):
        assert np.all(np.isnan(getattr(points, name)[hit])), name
    assert equilibria(bad, 1.0, 1.0).n_equilibria == -1


@pytest.mark.parametrize("threads", [0, -1, 1.5, "two"])
def test_wrong_numbers_of_threads_are_refused(threads):
    with pytest.raises(ParameterError, match="threads: got"):
        equilibria(1.0, 0.3, 0.2, threads=threads)
