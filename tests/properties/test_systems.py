"""Properties of the equilibria that hold for every system.

The suite tries 20,000 random and adversarial systems (properties/strategies.py). A larger run::

    PHASEKIT_SYSTEMS=1000000 pytest tests/properties/test_systems.py
"""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest
from properties.extended import derivatives
from properties.strategies import number_of_systems, systems
from witnesses import oracle

from phasekit.errors import EquilibriumKind
from phasekit.phase.exact.phase_space import equilibria

CENTER, SADDLE = int(EquilibriumKind.CENTER), int(EquilibriumKind.SADDLE)
ABSENT, DEGENERATE = int(EquilibriumKind.ABSENT), int(EquilibriumKind.DEGENERATE)
UNIT = 2.0**-53
LC, LS, UC, US = range(4)
LABELS = oracle.LABELS


def tolerance(A, B, C, phi):
    """Return the bound on the error of an angle, from the exact derivatives at it.

    2e-15 + min(4 u kappa, 2e-14); next to a cusp 1e-12. Next to a cusp means here that the angle is
    within 0.02 of a multiple of pi/2 and the condition number kappa is in the saturated range.
    """
    with np.errstate(divide="ignore", invalid="ignore"):
        first, second, size = derivatives(A, B, C, phi)
        kappa = np.where(second == 0, np.inf, 1 + size / np.abs(second))
        bound = 2e-15 + np.minimum(4 * UNIT * kappa, 2e-14)
        cusp = (np.abs(np.sin(2 * phi)) < 0.04) & (4 * UNIT * kappa > 2e-14)
    return np.where(cusp, 1e-12, bound)


def normalised(A, B, C):
    """Scale by powers of two, so that sizes are near 1 and Delta keeps its sign."""
    shift = -np.frexp(np.max(np.abs([A, B, C]), axis=0))[1]
    return tuple(np.ldexp(x, shift)[..., None] for x in (A, B, C))


@pytest.fixture(scope="module")
def tried():
    A, B, C = systems(number_of_systems())
    counts = np.array([oracle.count(*x) for x in zip(A, B, C, strict=True)])
    return SimpleNamespace(A=A, B=B, C=C, counts=counts, points=equilibria(A, B, C))


def failing(tried, bad):
    """Show the first systems that fail, exactly, and how many do."""
    bad = bad.reshape(tried.counts.size, -1).any(axis=1)
    where = np.flatnonzero(bad)
    first = [(float(tried.A[i]), float(tried.B[i]), float(tried.C[i])) for i in where[:5]]
    return f"{where.size} systems fail, first (A, B, C): {first}"


def test_systems_cover_every_count(tried):
    number, times = np.unique(tried.counts, return_counts=True)
    assert list(number) == [2, 3, 4]
    assert times.min() > 0.05 * tried.counts.size


def test_count_is_that_of_exact_rational_arithmetic(tried):
    bad = tried.points.n_equilibria != tried.counts
    assert not bad.any(), failing(tried, bad)
    bad = np.sum(tried.points.kind != ABSENT, axis=-1) != tried.counts
    assert not bad.any(), failing(tried, bad)


def test_labels_present_are_those_that_the_count_allows(tried):
    size = np.maximum(np.abs(tried.B), np.abs(tried.C))
    fold = tried.counts == 3
    cusp = ((tried.B == 0) | (tried.C == 0)) & (size == np.abs(tried.A))
    # A cusp is like a center on the B axis for A > 0 and on the C axis for A < 0.
    like_center = (tried.C == 0) == (tried.A > 0)
    four = tried.counts == 4
    want = np.empty_like(tried.points.kind)
    want[:, LC] = np.where(cusp & like_center, DEGENERATE, CENTER)
    want[:, LS] = np.select([fold, four], [DEGENERATE, SADDLE], ABSENT)
    want[:, UC] = np.where(four, CENTER, ABSENT)
    want[:, US] = np.where(cusp & ~like_center, DEGENERATE, SADDLE)
    bad = tried.points.kind != want
    assert not bad.any(), failing(tried, bad)


def test_values_are_there_where_kinds_are(tried):
    points, kind = tried.points, tried.points.kind
    for name in ("phi", "energy", "curvature"):
        bad = np.isnan(getattr(points, name)) != (kind == ABSENT)
        assert not bad.any(), (name, failing(tried, bad))
    # -np.pi is a double just above -pi
    bad = np.abs(points.phi) > np.pi
    assert not bad.any(), failing(tried, bad)
    for name, own, square in (
        ("natural_frequency", CENTER, points.curvature),
        ("exponent", SADDLE, -points.curvature),
    ):
        got = getattr(points, name)
        here = kind == own
        with np.errstate(invalid="ignore"):
            bad = here & ~(np.abs(got - np.sqrt(square)) <= 4 * UNIT * got)
        assert not bad.any(), (name, failing(tried, bad))
        bad = ~here & ~np.isnan(got) & ~((kind == DEGENERATE) & (got == 0))
        assert not bad.any(), (name, failing(tried, bad))


def test_kinds_alternate_round_the_circle(tried):
    points = tried.points
    plain = (points.kind != DEGENERATE).all(axis=1)
    for number in (2, 4):
        rows = np.flatnonzero(plain & (tried.counts == number))
        order = np.argsort(points.phi[rows], axis=1)[:, :number]  # NaN comes last
        phi = np.take_along_axis(points.phi[rows], order, axis=1)
        kind = np.take_along_axis(points.kind[rows], order, axis=1)
        gap = np.diff(phi, axis=1, append=phi[:, :1] + 2 * np.pi)
        alternate = (kind != np.roll(kind, -1, axis=1)).all(axis=1)
        # Inside a cusp's tongue a pair may be closer than doubles can tell; then the pair must be
        # of both kinds, and so must the rest.
        close = np.argmin(gap, axis=1)[:, None]
        columns = np.arange(number)[None, :]
        in_pair = (columns == close) | (columns == (close + 1) % number)
        centers = kind == CENTER
        paired = ((centers & in_pair).sum(axis=1) == 1) & (centers.sum(axis=1) == number // 2)
        resolved = gap.min(axis=1) > 2e-12
        bad = np.zeros(tried.counts.size, bool)
        bad[rows] = np.where(resolved, ~alternate, ~paired)
        assert not bad.any(), failing(tried, bad)
        assert resolved.mean() > 0.95


def test_indices_add_up_to_nothing(tried):
    points = tried.points
    A, B, C = (x[:, None] for x in (tried.A, tried.B, tried.C))
    phi = np.nan_to_num(points.phi)
    fourth = 4 * A * np.cos(2 * phi) - B * np.cos(phi) - C * np.sin(phi)
    index = np.select([points.kind == CENTER, points.kind == SADDLE], [1, -1], 0)
    cusp = (points.kind == DEGENERATE) & (tried.counts == 2)[:, None]
    index = np.where(cusp, np.sign(fourth), index)
    bad = index.sum(axis=1) != 0
    assert not bad.any(), failing(tried, bad)
    assert cusp.any()


def test_sign_of_curvature_is_that_of_the_kind(tried):
    A, B, C = normalised(tried.A, tried.B, tried.C)
    phi, kind = np.nan_to_num(tried.points.phi), tried.points.kind
    _, second, _ = derivatives(A, B, C, phi)
    third = np.abs(B) + 2 * np.abs(A) + np.abs(C)
    sure = np.abs(second) > 2 * third * tolerance(A, B, C, phi)
    bad = sure & np.isin(kind, (CENTER, SADDLE)) & (np.where(second > 0, CENTER, SADDLE) != kind)
    bad |= sure & (kind == DEGENERATE)
    assert not bad.any(), failing(tried, bad)
    assert sure[np.isin(kind, (CENTER, SADDLE))].mean() > 0.9


def test_residuals_are_at_rounding_level(tried):
    """An angle within its tolerance has |V'| <= |V''| tol + max |V'''| tol^2 / 2.

    With tol = 2e-15 + 4 u kappa the first term is 2e-15 |V''| + 4 u (|V''| + the sizes of the three
    terms of V'); the second one counts only next to cusps.
    """
    A, B, C = normalised(tried.A, tried.B, tried.C)
    phi = np.nan_to_num(tried.points.phi)
    first, second, _ = derivatives(A, B, C, phi)
    within = tolerance(A, B, C, phi)
    bound = np.abs(second) * within + (np.abs(B) + 2 * np.abs(A) + np.abs(C)) * within**2 / 2
    bound += 1e-30  # V' itself
    bad = (tried.points.kind != ABSENT) & ~(np.abs(first) <= bound)
    assert not bad.any(), failing(tried, bad)
    assert np.median(bound) < 3e-15


def test_energy_and_curvature_are_those_of_the_angle(tried):
    A, B, C = normalised(tried.A, tried.B, tried.C)
    shift = -np.frexp(np.max(np.abs([tried.A, tried.B, tried.C]), axis=0))[1][:, None]
    phi, present = np.nan_to_num(tried.points.phi), tried.points.kind != ABSENT
    _, second, _ = derivatives(A, B, C, phi)
    scale = np.abs(A) + np.abs(B) + np.abs(C)
    third = np.abs(B) + 2 * np.abs(A) + np.abs(C)
    curvature = np.ldexp(tried.points.curvature, shift)
    off = np.abs(curvature - second)
    bad = present & ~(off <= 8 * UNIT * scale + third * tolerance(A, B, C, phi))
    assert not bad.any(), failing(tried, bad)
    want = -B * np.cos(phi) + A / 2 * np.cos(phi) ** 2 - C * np.sin(phi)
    energy = np.ldexp(tried.points.energy, shift)
    bad = present & ~(np.abs(energy - want) <= 16 * UNIT * scale)
    assert not bad.any(), failing(tried, bad)


def test_labels_are_ordered_by_energy(tried):
    energy = tried.points.energy
    scale = np.abs(tried.A) + np.abs(tried.B) + np.abs(tried.C)
    for lower, upper in ((LC, UC), (LS, US), (LC, LS), (UC, LS), (LC, US)):
        bad = energy[:, lower] - energy[:, upper] > 16 * UNIT * scale
        assert not bad.any(), (LABELS[lower], LABELS[upper], failing(tried, bad))


def test_margin_has_the_sign_of_minus_delta(tried):
    degenerate = (tried.points.kind == DEGENERATE).any(axis=1)
    want = np.select([tried.counts == 4, degenerate], [1, 0], -1)
    bad = ~(np.sign(tried.points.fold_margin) == want)
    assert not bad.any(), failing(tried, bad)
    size = np.maximum(np.abs(tried.B), np.abs(tried.C))
    bad = np.isneginf(tried.points.fold_margin) != (tried.A == 0)
    bad &= (tried.A == 0) | (size / 1e300 < np.abs(tried.A))  # the quotient is a double
    assert not bad.any(), failing(tried, bad)


SYMMETRIES = {
    # name: image of (A, B, C), image of an angle, the coefficient that must not be 0 (ties)
    "phi to -phi": (lambda A, B, C: (A, B, -C), np.negative, 2),
    "phi to pi - phi": (lambda A, B, C: (A, -B, C), lambda phi: np.pi - phi, 1),
    "phi to pi/2 - phi": (lambda A, B, C: (-A, C, B), lambda phi: np.pi / 2 - phi, None),
    "other units of time": (lambda A, B, C: (A / 4, B / 4, C / 4), np.positive, None),
}


@pytest.mark.parametrize("name", SYMMETRIES)
def test_symmetries_hold_label_by_label(tried, name):
    image, turned, tie = SYMMETRIES[name]
    system = (tried.A, tried.B, tried.C)
    points, mirrored = tried.points, equilibria(*image(*system))
    use = np.ones(tried.A.size, bool) if tie is None else system[tie] != 0
    use &= np.min(np.abs(system), axis=0, where=np.not_equal(system, 0), initial=1) > 1e-300
    assert use.mean() > 0.5
    bad = (points.n_equilibria != mirrored.n_equilibria) & use
    assert not bad.any(), failing(tried, bad)
    bad = (points.kind != mirrored.kind) & use[:, None]
    assert not bad.any(), failing(tried, bad)
    within = 2 * tolerance(*normalised(*system), np.nan_to_num(points.phi)) + 4 * UNIT
    away = np.abs(np.remainder(mirrored.phi - turned(points.phi) + np.pi, 2 * np.pi) - np.pi)
    bad = use[:, None] & (points.kind != ABSENT) & ~(away <= within)
    assert not bad.any(), failing(tried, bad)
    # V -> V - A/2 where A changes its sign; energies are measured in 1/time^2
    A, B, C = (x[:, None] for x in system)
    shift = A / 2 if name == "phi to pi/2 - phi" else 0
    factor = 0.25 if name == "other units of time" else 1.0
    bound = 32 * UNIT * factor * (np.abs(A) + np.abs(B) + np.abs(C))
    for got, want in (
        (mirrored.energy, factor * (points.energy - shift)),
        (mirrored.curvature, factor * points.curvature),
    ):
        slack = bound if got is mirrored.energy else bound + within * bound / UNIT / 16
        bad = use[:, None] & (points.kind != ABSENT) & ~(np.abs(got - want) <= slack)
        assert not bad.any(), failing(tried, bad)


def test_parts_of_an_array_give_the_same_bits(tried):
    """A cell does not depend on the array that it stands in, nor on its place in it."""
    whole = tried.points

    def same(got, want):
        if want.dtype.kind == "i":
            return np.array_equal(got, want)
        there = ~np.isnan(want)
        return np.array_equal(np.isnan(got), ~there) and (
            np.asarray(got)[there].tobytes() == want[there].tobytes()
        )

    size = tried.A.size
    for start, stop in ((0, 1), (1, 256), (3, 260), (100, 101), (size // 3, size)):
        part = equilibria(tried.A[start:stop], tried.B[start:stop], tried.C[start:stop])
        for name in whole._fields:
            assert same(getattr(part, name), getattr(whole, name)[start:stop]), (name, start)
    for i in range(0, size, max(1, size // 500)):
        one = equilibria(float(tried.A[i]), float(tried.B[i]), float(tried.C[i]))
        for name in whole._fields:
            row = failing(tried, np.arange(size) == i)
            assert same(getattr(one, name), getattr(whole, name)[i]), (name, row)


def test_labels_are_continuous_along_paths():
    """Along paths with B, C > 0 an equilibrium keeps its label.

    A step that changes V' by at most d moves a root of slope V'' by at most 2 d / |V''| as long as
    d M <= V''^2 / 8 with |V'''| <= M (Newton-Kantorovich), and a label is there as long as its
    root. Elsewhere, next to folds and cusps, the bound is that of a triple root.
    """
    rng = np.random.default_rng(11)
    paths, legs, steps = max(8, number_of_systems() // 1000), 5, 2000
    knots = rng.uniform(-1, 1, (paths, legs + 1, 3))
    knots[:, :, 1:] = 10.0 ** rng.uniform(-3, 0.2, (paths, legs + 1, 2))
    knots[: paths // 4, :, 0] = np.abs(knots[: paths // 4, :, 0])  # a quarter stays at A > 0
    at = np.linspace(0, legs, steps, endpoint=False)
    leg, part = at.astype(int), (at % 1)[:, None]
    A, B, C = np.moveaxis(knots[:, leg] * (1 - part) + knots[:, leg + 1] * part, -1, 0)
    points = equilibria(A, B, C)
    before, after = (slice(None), slice(None, -1)), (slice(None), slice(1, None))
    change = np.abs(np.diff(A)) / 2 + np.hypot(np.diff(B), np.diff(C))
    size = np.max(np.abs([A, B, C]), axis=0)
    third = 2 * np.abs(A) + np.abs(B) + np.abs(C) + 4 * change.max()
    safely, steps_made = 0, 0
    for k, label in enumerate(LABELS):
        phi, kind = points.phi[..., k], points.kind[..., k]
        moved = np.abs(np.remainder(np.diff(phi) + np.pi, 2 * np.pi) - np.pi)
        for near, far in ((before, after), (after, before)):
            slope = np.abs(points.curvature[..., k][near])
            with np.errstate(divide="ignore"):
                safe = (kind[near] != ABSENT) & (change * third[near] <= slope**2 / 8)
                bad = safe & ~(moved <= 2 * change / slope + 1e-12)
            bad |= safe & (kind[near] != kind[far])
            assert not bad.any(), (label, A[near][bad][:3], B[near][bad][:3], C[near][bad][:3])
            safely += safe.sum()
        both = (kind[before] != ABSENT) & (kind[after] != ABSENT)
        bad = both & ~(moved <= 4 * np.cbrt(change / size[before]))
        assert not bad.any(), (label, A[before][bad][:3], B[before][bad][:3], C[before][bad][:3])
        steps_made += both.sum()
    assert safely > 1.8 * steps_made  # nearly everywhere the sharp bound applies, both ways
    assert 0.1 < (points.kind[..., LS] != ABSENT).mean() < 0.9  # paths go through folds
