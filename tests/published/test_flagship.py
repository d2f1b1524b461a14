"""Continuation of the disk's equilibria against the closed forms and the complete atlas.

The suite follows a few dozen random parameter paths. A larger run::

    PHASEKIT_PATHS=1000 pytest tests/published/test_flagship.py
"""

from __future__ import annotations

import functools
import os

import numpy as np
import pytest
from published.compare import kind_of, state_of

import phasekit as pk

PATHS = int(os.environ.get("PHASEKIT_PATHS", "20"))
PARAMETERS = ("beta", "e", "a", "omega1")


def random_disk(rng, **fixed):
    values = {
        "beta": rng.uniform(0.05, np.pi / 2 - 0.05),
        "e": 10 ** rng.uniform(-2.5, -0.5),
        "a": rng.choice([-1, 1]) * 10 ** rng.uniform(-3, -0.5),
        "r": 10 ** rng.uniform(-1.5, 0),
        "omega1": rng.choice([-1, 1]) * 10 ** rng.uniform(0, 1.7),
    }
    return pk.GyroRotorDisk(**{k: float(v) for k, v in (values | fixed).items()})


def folds_of(disk, parameter):
    """The closed form: positive values, in order."""
    values = pk.critical(disk, parameter).critical_fold.values
    return np.sort(values[np.isfinite(values) & (values > 0.0)])


def span_of(parameter, folds):
    """A span round the folds, on the positive side."""
    if parameter == "beta":
        return 0.2 * folds[0], 0.5 * (folds[-1] + np.pi / 2)
    return 0.5 * folds[0], 2.0 * folds[-1]


def four_at(disk, parameter, span, folds):
    """A value of the parameter between the folds and ends where there are four equilibria."""
    edges = np.array([span[0], *folds, span[1]])
    for value in 0.5 * (edges[1:] + edges[:-1]):
        if pk.equilibria(disk.replace(**{parameter: value})).n_equilibria == 4:
            yield float(value)


@pytest.mark.parametrize("parameter", PARAMETERS)
def test_folds_agree_with_the_closed_form(parameter):
    """1e-12 of the value."""
    rng = np.random.default_rng(PARAMETERS.index(parameter))
    seen = 0
    for _ in range(PATHS):
        disk = random_disk(rng)
        folds = folds_of(disk, parameter)
        if not folds.size or folds[-1] > 1e3 or (parameter == "beta" and folds[-1] > 1.5):
            continue
        span = span_of(parameter, folds)
        met = set()
        for value in four_at(disk, parameter, span, folds):
            at = disk.replace(**{parameter: value})
            branch = pk.continuation(at, parameter, x0="lower_saddle", span=span)
            for one in branch.special_points:
                if kind_of(one) == "end":
                    continue
                assert kind_of(one) == "fold", (disk, one)
                assert one.status == "converged"
                off = np.abs(one.parameters[parameter] / folds - 1.0)
                assert off.min() < 1e-12, (disk, one, folds)
                met.add(int(off.argmin()))
        assert met == set(range(folds.size)), (disk, folds, met)
        seen += len(met)
    assert seen >= PATHS // 4


# --- every branch of the atlas ---------------------------------------------------------------


def random_path(seed):
    """A disk, one of its parameters and a span of it; some with a = 0, or across a = 0."""
    rng = np.random.default_rng([2015, seed])
    parameter = PARAMETERS[seed % 4]
    fixed = {"a": 0.0} if rng.random() < 0.15 and parameter != "a" else {}
    disk = random_disk(rng, **fixed)
    if parameter == "beta":
        span = np.sort(rng.uniform(0.0, np.pi, 2))
    elif parameter == "e":
        span = 10 ** np.sort(rng.uniform(-3.0, 0.0, 2))
    else:
        reach = {"a": 10 ** rng.uniform(-3, -0.5), "omega1": 10 ** rng.uniform(0.3, 1.7)}[parameter]
        span = np.sort(rng.uniform(-reach, reach, 2))
    low, high = float(span[0]), float(span[1])
    middle = rng.uniform(low, high)
    return disk.replace(**{parameter: middle}), parameter, (low, high)


@functools.lru_cache(maxsize=64)
def diagram(seed):
    disk, parameter, span = random_path(seed)
    return pk.diagram(disk, parameter, span=span)


def coefficients_along(disk, parameter, values):
    return tuple(np.asarray(x) for x in disk.replace(**{parameter: values}).coefficients())


def gap_to(branches, parameter, span, phi, value):
    """Distance of points of the atlas from the nearest point that was followed, on scaled axes."""
    points = np.concatenate(
        [np.stack([b.points.phi.values, b.points[parameter].values]) for b in branches], axis=1
    )
    angle = np.abs(np.remainder(phi[:, None] - points[0] + np.pi, 2 * np.pi) - np.pi)
    off = np.abs(value[:, None] - points[1]) / (span[1] - span[0])
    return np.min(np.maximum(angle, off), axis=1)


@pytest.mark.parametrize("seed", range(PATHS))
def test_every_branch_of_the_atlas_is_found(seed):
    disk, parameter, span = random_path(seed)
    atlas = pk.branches(disk, parameter, span)
    found = diagram(seed)
    phi, value = atlas.phi.values.ravel(), atlas[parameter].values.ravel()
    there = np.isfinite(phi)
    gaps = gap_to(found, parameter, span, phi[there], value[there])
    assert gaps.max() < 0.2, (disk, parameter, span, float(gaps.max()))
    wanted = atlas.special_kind.values
    for kind in ("fold", "pitchfork"):
        values = atlas.special_value.values[wanted == kind]
        angles = atlas.special_phi.values[wanted == kind]
        points = [one for b in found for one in b.special_points if one.kind == kind]
        for p, x in zip(values, angles, strict=True):
            off = [
                abs(one.parameters[parameter] - p) / (span[1] - span[0])
                + abs(np.remainder(state_of(one)[0] - x + np.pi, 2 * np.pi) - np.pi)
                for one in points
            ]
            assert off, (kind, p, x, disk, parameter, span)
            assert min(off) < 1e-7, (kind, p, x, disk, parameter, span, min(off))


@pytest.mark.parametrize("seed", range(PATHS))
def test_every_point_is_an_equilibrium(seed):
    """V' of the disk's coefficients vanishes, far below the tolerance of a step, 1e-11."""
    disk, parameter, _ = random_path(seed)
    for branch in diagram(seed):
        A, B, C = coefficients_along(disk, parameter, branch.points[parameter].values)
        phi = branch.points.phi.values
        force = (B - A * np.cos(phi)) * np.sin(phi) - C * np.cos(phi)
        assert np.abs(force / (np.abs(A) + np.abs(B) + np.abs(C))).max() < 1e-12


@pytest.mark.parametrize("seed", range(PATHS))
def test_no_branch_is_found_twice(seed):
    """At any value of the parameter the branches are met as often as there are equilibria."""
    disk, parameter, span = random_path(seed)
    for value in np.random.default_rng(seed).uniform(*span, 20):
        wanted = int(pk.equilibria(disk.replace(**{parameter: float(value)})).n_equilibria)
        values = [branch.points[parameter].values for branch in diagram(seed)]
        met = sum(int(np.sum((p[1:] > value) != (p[:-1] > value))) for p in values)
        assert met == wanted, (disk, parameter, span, value)


# --- the pitchfork at a = 0 ------------------------------------------------------------------

SYMMETRIC = pk.GyroRotorDisk(beta=0.3, e=0.05, a=0.0, r=0.2, omega1=10.0)


@functools.cache
def pitchforks(parameter):
    """|A| = B at a = 0: the closed form, in order."""
    return folds_of(SYMMETRIC, parameter)


@pytest.mark.parametrize("parameter", ["beta", "e", "omega1"])
def test_the_pitchfork_is_found_from_all_sides(parameter):
    """From the trivial branches phi = 0 and pi, and from each side branch."""
    values = pitchforks(parameter)
    assert values.size
    span = span_of(parameter, values)
    starts = np.linspace(*span, 12)[1:-1]
    met = {}
    for value in starts:
        disk = SYMMETRIC.replace(**{parameter: float(value)})
        there = pk.equilibria(disk)
        for label in there.equilibrium.values:
            if not np.isfinite(there.phi.sel(equilibrium=label)):
                continue
            trivial = abs(np.sin(float(there.phi.sel(equilibrium=label)))) < 1e-12
            branch = pk.continuation(disk, parameter, x0=str(label), span=span)
            for one in branch.special_points:
                if kind_of(one) == "end":
                    continue
                assert one.kind == "pitchfork", (disk, label, one)
                off = np.abs(one.parameters[parameter] / values - 1.0)
                assert off.min() < 1e-12, (disk, label, one, values)
                assert abs(np.sin(state_of(one)[0])) < 1e-10
                side = (
                    "trivial" if trivial else "up" if np.sin(branch.points.phi[0]) > 0 else "down"
                )
                met.setdefault(int(off.argmin()), set()).add(side)
                other = one.switch()
                assert len(other.points.phi) > 3
    for i in range(values.size):
        assert met[i] >= {"trivial", "up"} or met[i] >= {"trivial", "down"}, met


def test_the_pitchfork_unfolds():
    """Along a at fixed beta the curve crosses a = 0 without a special point on the trivial side."""
    disk = SYMMETRIC.replace(beta=float(pitchforks("beta")[0]) * 0.9)
    folds = folds_of(disk, "a")
    for label in ("lower_center", "upper_saddle", "lower_saddle", "upper_center"):
        there = pk.equilibria(disk).phi.sel(equilibrium=label)
        if np.isfinite(there):
            branch = pk.continuation(disk, "a", x0=label, span=(-3 * folds[0], 3 * folds[0]))
            for one in branch.special_points:
                if kind_of(one) == "end":
                    continue
                assert kind_of(one) == "fold"
                assert abs(abs(one.parameters["a"]) / folds[0] - 1.0) < 1e-12
