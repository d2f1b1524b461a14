"""Fold values of any law against the closed forms of the disk, and against counts of equilibria."""

from __future__ import annotations

import numpy as np
import pytest

import phasekit as pk
from phasekit.bifurcation.exact.critical import critical_disk
from phasekit.bifurcation.exact.fold_values import fold_values


def random_disk(rng):
    return {
        "beta": rng.uniform(0, np.pi),
        "e": 10 ** rng.uniform(-4, 0),
        "a": float(rng.choice([0.0, 1.0], p=[0.2, 0.8]) * rng.normal() * 10 ** rng.uniform(-6, 0)),
        "r": 10 ** rng.uniform(-4, 0),
        "omega1": 10 ** rng.uniform(-1, 3),
        "g": 9.80665 * float(rng.choice([1.0, 0.0, -1.0], p=[0.8, 0.1, 0.1])),
    }


@pytest.mark.slow
@pytest.mark.parametrize("parameter", ["beta", "e", "a", "omega1"])
def test_the_disk_in_closed_form(parameter):
    rng = np.random.default_rng(5)
    law = pk.GyroRotorDisk.trigonometric()
    compared = 0
    for _ in range(40):
        disk = random_disk(rng)
        got = np.array(fold_values(law, parameter, disk))
        want = np.array(critical_disk(parameter, **disk))
        assert np.array_equal(np.isnan(got), np.isnan(want)), disk
        compared += int(np.isfinite(want).sum())
        np.testing.assert_allclose(got, want, rtol=1e-12, atol=1e-15)
    assert compared > 15


def test_the_magnet_by_hand():
    """Inside the astroid |h_x|^(2/3) + |h_y|^(2/3) = (2 |K|)^(2/3) there are four equilibria."""
    magnet = pk.StonerWohlfarth(K=1.0, h_x=0.3, h_y=0.2)
    ds = pk.critical(magnet, "h_x")
    want = (2 ** (2 / 3) - 0.2 ** (2 / 3)) ** 1.5
    assert ds.critical_fold.sel(fold="minus").item() == pytest.approx(want, rel=1e-14)
    assert np.isnan(ds.critical_fold.sel(fold="plus").item())
    assert ds.critical_fold.attrs["units"] == "s-2"
    K = pk.critical(magnet, "K")
    want = 0.5 * (0.3 ** (2 / 3) + 0.2 ** (2 / 3)) ** 1.5
    assert K.critical_fold.sel(fold="minus").item() == pytest.approx(want, rel=1e-14)
    assert K.critical_sign_change.item() == 0.0


@pytest.mark.slow
@pytest.mark.parametrize("name", pk.ParticleOnCircle.trigonometric().parameters)
def test_the_count_changes_at_the_particles_folds(name):
    rng = np.random.default_rng(11)
    seen = 0
    for _ in range(8):
        values = {
            "radius": rng.uniform(0.05, 0.2), "omega": rng.uniform(8, 30),
            "tilt": rng.uniform(-0.5, 0.5), "offset": rng.normal() * 0.02,
            "normal_offset": rng.normal() * 0.05, "g": 9.81,
        }  # fmt: skip
        particle = pk.ParticleOnCircle(**values)
        for fold in pk.critical(particle, name).critical_fold.values:
            if not np.isfinite(fold):
                continue
            seen += 1
            at = particle.replace(**{name: fold})
            assert abs(pk.equilibria(at).fold_margin.item()) < 1e-11
            sides = [particle.replace(**{name: fold * x}) for x in (1 - 1e-9, 1 + 1e-9)]
            counts = {pk.equilibria(side).n_equilibria.item() for side in sides}
            assert counts == {2, 4}
    assert seen > 2


def test_arrays_keep_their_dims_and_tiny_values_their_digits():
    fields = pk.StonerWohlfarth(K=[1.0, np.nan, 1e-9], h_x=0.3, h_y=[0.0, 1e-12])
    fold = pk.critical(fields, "h_x").critical_fold
    assert fold.dims == ("K", "h_y", "fold")
    minus = fold.sel(fold="minus").values
    K, h_y = np.array([[1.0], [np.nan], [1e-9]]), np.array([[0.0, 1e-12]])
    want = ((2 * K) ** (2 / 3) - h_y ** (2 / 3)) ** 1.5
    np.testing.assert_allclose(minus, want, rtol=1e-13)
