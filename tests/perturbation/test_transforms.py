"""Transforms along separatrices, against sums over the motion in closed form and over time."""

import numpy as np
import pytest

from phasekit.perturbation.harmonics import reach
from phasekit.perturbation.transforms import area_rates, kernel_transforms, transforms
from phasekit.phase.exact.flow import separatrix_motion
from phasekit.phase.exact.phase_space import separatrices

CASES = [
    (1.0, 0.35, 0.12), (-1.0, 0.35, 0.12), (1.0, -0.35, 0.12), (1.0, 0.35, -0.12),
    (0.5, 1.0, 0.3), (0.0, 1.0, 0.0), (0.0, 0.3, -0.4), (1.0, 0.0, 0.3), (-1.0, 0.4, 0.0),
    (1e-6, 1.0, 0.2), (-0.3, 2.0, 1e-9), (1.2, 0.9, 1e-4), (1.0, 0.62, 0.12), (1.0, 1e-7, 0.3),
]  # fmt: skip
WEIGHTS = np.array([0.7, -0.4, 1.1, 0.5])


@pytest.mark.slow
@pytest.mark.parametrize("abc", CASES)
def test_integrals_over_time(abc):
    loops = separatrices(*abc)
    found = 0
    for j in np.flatnonzero(loops.loop):
        k = loops.saddle_exponent[j]
        t = np.linspace(-45.0 / k, 45.0 / k, 12001)
        for side in (0, 1):
            phi, v = separatrix_motion(*abc, t, saddle=j, side=side)[:2]
            g = np.array([np.ones_like(phi), np.sin(phi), np.cos(phi), np.sin(2 * phi)])
            for nu in (1e-3, 0.3, 1.0, 4.0):
                want = np.sum(v * (WEIGHTS @ g) * np.exp(1j * nu * t)) * (t[1] - t[0])
                at = (loops.saddle_phi, loops.saddle_exponent, loops.loop)
                got = transforms(*abc, *at, nu, *WEIGHTS)[j, side]
                assert abs(got - want) < 1e-10
                found += 1
    assert found >= 8


@pytest.mark.parametrize("abc", CASES[:-1])  # the last one is as near to a cycle as a step
def test_rates_of_areas(abc):
    loops = separatrices(*abc)
    at = (loops.saddle_phi, loops.saddle_exponent, loops.loop)
    step = 1e-6
    for way in np.eye(3):
        got = area_rates(*abc, *at, *way)
        ends = [separatrices(*(np.array(abc) + s * step * way)) for s in (1, -1)]
        lobe, winding = (
            (getattr(ends[0], n) - getattr(ends[1], n)) / (2 * step)
            for n in ("lobe_area", "winding_area")
        )
        for j in np.flatnonzero(loops.loop):
            if loops.loop[j] == 3:
                assert np.isnan(got[j]).all()
            elif all(end.loop[j] == loops.loop[j] for end in ends):
                want = lobe[j] if loops.loop[j] == 1 else winding[j]
                assert got[j] == pytest.approx(want, abs=2e-7, rel=2e-7)


def test_fast_drives_neither_overflow_nor_vanish_too_soon():
    """Against the residue that is nearest to the real axis, at 200 times the exponent."""
    loops = separatrices(0.0, 1.0, 0.0)
    at = (loops.saddle_phi, loops.saddle_exponent, loops.loop)
    for nu in (20.0, 49.9, 50.1, 200.0):
        got = transforms(0.0, 1.0, 0.0, *at, nu, 1.0, 0.0, 0.0, 0.0)[1, 1]
        assert got.real == pytest.approx(4 * np.pi * np.exp(-np.pi * nu / 2), rel=1e-12)
    assert np.isfinite(transforms(0.0, 1.0, 0.0, *at, 1e5, 1.0, 1.0, 1.0, 1.0)[1]).all()


@pytest.mark.slow
def test_compiled_and_interpreted_kernels_agree():
    rng = np.random.default_rng(5)
    A, B, C = rng.normal(size=(3, 40))
    loops = separatrices(A, B, C)
    arrays = (A, B, C, loops.saddle_phi, loops.saddle_exponent, loops.loop.astype(float))
    weights = [np.full(40, w, complex) for w in WEIGHTS]
    out = [np.empty((40, 2, 2), complex) for _ in range(2)]
    kernel_transforms(arrays, np.full(40, 0.8), *weights, 0, 40, (out[0],))
    with np.errstate(all="ignore"):
        kernel_transforms.py_func(arrays, np.full(40, 0.8), *weights, 0, 40, (out[1],))
    assert np.isfinite(out[0]).sum() >= 80
    assert np.array_equal(np.isnan(out[0]), np.isnan(out[1]))
    assert np.nanmax(np.abs(out[0] - out[1])) < 1e-13


@pytest.mark.slow
def test_sums_of_harmonics():
    rng = np.random.default_rng(2)
    Z = rng.normal(size=(6, 2)) + 1j * rng.normal(size=(6, 2))
    nu = np.broadcast_to([0.8, 1.3], (6, 2))
    sign = np.array([1.0, -1.0] * 3)
    greatest, area = reach(Z, nu, sign)
    t = np.linspace(0.0, 2 * np.pi / 0.1, 400001)
    values = (Z[:, :1] * np.exp(0.8j * t) + Z[:, 1:] * np.exp(1.3j * t)).real
    assert greatest == pytest.approx((sign[:, None] * values).max(axis=1), rel=1e-8)
    want = np.maximum(values, 0.0)[:, :-1].sum(axis=1) * (t[1] - t[0])
    assert area == pytest.approx(want, rel=1e-6)
    never = np.broadcast_to([1.0, np.sqrt(2.0)], (6, 2))
    greatest, area = reach(Z, never, sign)
    assert greatest == pytest.approx(np.abs(Z).sum(axis=1), rel=1e-14)
    assert np.isnan(area).all()
