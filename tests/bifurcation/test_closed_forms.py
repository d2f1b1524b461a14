"""Normal forms against derivatives of the potential taken by sympy and mpmath."""

from __future__ import annotations

import mpmath
import numpy as np
import pytest
import sympy

from phasekit.bifurcation.exact.critical import critical_disk
from phasekit.bifurcation.exact.normal_forms import (
    cubic_coefficient,
    fold_angle,
    normal_form,
    quadratic_coefficient,
)
from phasekit.systems.registry import models

LAWS = {name: model.trigonometric() for name, model in models().items() if model.rung.derived}

A, B, C, PHI = sympy.symbols("A B C phi")
V = -B * sympy.cos(PHI) + A / 2 * sympy.cos(PHI) ** 2 - C * sympy.sin(PHI)


@pytest.mark.parametrize("seed", range(8))
def test_a_fold_by_symbolic_derivatives(seed):
    rng = np.random.default_rng(seed)
    a, theta = rng.choice([-1, 1]) * rng.uniform(0.1, 5), rng.uniform(-np.pi, np.pi)
    b, c = a * np.cos(theta) ** 3, -a * np.sin(theta) ** 3
    phi = float(fold_angle(a, b, c))
    assert np.cos(phi - theta) == pytest.approx(1.0, abs=1e-14)
    at = {A: a, B: b, C: c, PHI: phi}
    for order in (1, 2):
        assert float(sympy.diff(V, PHI, order).subs(at)) == pytest.approx(0.0, abs=1e-14)
    third = float(-sympy.diff(V, PHI, 3).subs(at) / 2)
    assert float(quadratic_coefficient(a, phi)) == pytest.approx(third, abs=1e-14)
    fourth = float(-sympy.diff(V, PHI, 4).subs(at) / 6)
    assert float(cubic_coefficient(a, phi)) == pytest.approx(fourth, abs=1e-14)


def test_angles_at_cusps():
    for b, c, phi in ((1, 0, 0), (-1, 0, np.pi), (0, 1, -np.pi / 2), (0, -1, np.pi / 2)):
        assert float(fold_angle(1.0, b, c)) == phi
        assert np.cos(float(fold_angle(-1.0, -b, -c)) - phi) == 1.0


@pytest.mark.parametrize("parameter", ["beta", "e"])
@pytest.mark.parametrize("side", [0, 1])
def test_unfolding_of_a_disk_by_numerical_derivatives(parameter, side):
    disk = {"beta": 1.2, "e": 0.05, "a": 0.012, "r": 0.2, "omega1": 31.4, "g": 9.80665}
    value = float(critical_disk(parameter, **disk)[side])
    disk[parameter] = value
    phi = float(fold_angle(*(float(x) for x in LAWS["GyroRotorDisk"](disk)[:3])))

    def slope(p):
        # [Veljovic2015] (12), the disk's formulas written out once more
        v = {name: mpmath.mpf(x) for name, x in {**disk, parameter: p}.items()}
        s, c = mpmath.sin(v["beta"]), mpmath.cos(v["beta"])
        n = 4 * v["e"] ** 2 * s**2 + v["r"] ** 2 * (1 + s**2)
        a = v["omega1"] ** 2 * (4 * v["e"] ** 2 * s**2 - v["r"] ** 2 * c**2) / n
        b = 4 * v["g"] * v["e"] * s / n
        c_ = 4 * v["omega1"] ** 2 * v["a"] * v["e"] * s / n
        return b * mpmath.sin(phi) - a * mpmath.sin(phi) * mpmath.cos(phi) - c_ * mpmath.cos(phi)

    with mpmath.workdps(40):
        want = -float(mpmath.diff(slope, mpmath.mpf(value)))
    got = normal_form(LAWS["GyroRotorDisk"], disk, parameter, phi, "fold")
    assert got.unfolding == pytest.approx(want, rel=1e-11)


def test_a_pitchfork_by_hand():
    """With A = 1 and C = 0: x'' = (1 - B) x - x^3/2 at B = 1."""
    values = {"A": 1.0, "B": 1.0, "C": 0.0}
    got = normal_form(LAWS["Coefficients"], values, "B", 0.0, "pitchfork")
    assert got == (-1.0, 0.0, -0.5)


@pytest.mark.parametrize("name", sorted(LAWS))
def test_forms_are_the_coefficients_of_the_models(name):
    rng = np.random.default_rng(7)
    model = models()[name]
    for _ in range(20):
        values = {}
        for p in model.declared:
            if p.name in model.formula_inputs():
                low, high = max(p.low, -3.0), min(p.high, 3.0)
                values[p.name] = float(rng.uniform(max(low, 0.01 if p.positive else low), high))
        *products, scale = LAWS[name](values)
        want = model.valid_coefficients({k: np.array(v) for k, v in values.items()})
        assert scale > 0
        for product, x in zip(products, want, strict=True):
            assert product / scale == pytest.approx(float(x), rel=1e-12, abs=1e-13)
