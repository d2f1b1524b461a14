"""The published numbers against 60 digits: a wrong digit in either would show."""

from __future__ import annotations

import os

import mpmath as mp
import numpy as np
import pytest
from published import reference
from published.systems import HOPF, SYSTEMS
from scipy.optimize import root

ALL = os.environ.get("PHASEKIT_PUBLISHED") == "all"


@pytest.mark.parametrize("name", SYSTEMS)
def test_published_values(name):
    system = SYSTEMS[name]
    found = reference.specials(system)
    for kind, wanted in system.published.items():
        values = reference.parameters_of(found, kind)
        assert len(values) == len(wanted), (kind, values)
        np.testing.assert_allclose(values, sorted(wanted), rtol=0, atol=system.digits)


@pytest.mark.parametrize("name", SYSTEMS)
def test_the_start_is_on_the_curve(name):
    """What a solver makes of x0 is an equilibrium that the explicit curves contain."""
    system = SYSTEMS[name]
    f = system.python()
    solution = root(lambda x: f(x, **system.parameters), system.x0, tol=1e-12).x
    assert np.max(np.abs(f(solution, **system.parameters))) < 1e-9
    wanted = np.array([*solution, system.parameters[system.parameter]])
    distances = []
    for curve in system.curves:
        on = reference.OnCurve(system, curve)
        with np.errstate(all="ignore"):
            along = on.in_doubles(np.linspace(curve.low, curve.high, 20_001))
        off = np.abs(np.array(along[: on.n + 1]).T - wanted) / (1e-9 + np.abs(wanted).max())
        distances.append(np.nanmin(off.max(axis=1)))
    assert min(distances) < 5e-3


#: By hand: [Kuznetsov2004] 5.4; and r' = -r^3 with r = sqrt(2) |z|.
GROWTH = {"adaptive control": -0.3, "two Hopf points a hair apart": -2.0}


@pytest.mark.parametrize("name", GROWTH if ALL else ["adaptive control"])
def test_first_lyapunov_coefficient(name):
    """From the periodic orbit itself, against closed forms; the stored ones were found so."""
    growth = GROWTH[name]
    hopf = [one for one in reference.specials(SYSTEMS[name]) if one.kind == HOPF]
    stored = reference.stored("hopf_points")[name]
    assert abs(reference.growth(SYSTEMS[name], hopf[0]) - mp.mpf(growth)) < 1e-15
    assert abs(stored[0][2] - growth) < 1e-15
    for one, (parameter, omega, _) in zip(hopf, stored, strict=True):
        assert abs(one.parameter - parameter) < 1e-14
        assert abs(one.omega - omega) < 1e-14


@pytest.mark.parametrize(
    "name", reference.FOLD_CURVES if ALL else ["A -> B reaction", "cusp", "stirred tank"]
)
def test_points_on_fold_curves(name):
    """The stored ones are found again."""
    found, wanted = reference.fold_curves([name])[name], reference.stored("fold_curves")[name]
    assert [one[0] for one in found] == [one[0] for one in wanted]
    np.testing.assert_allclose(
        [one[1:] for one in found], [one[1:] for one in wanted], rtol=1e-14, atol=1e-14
    )


def test_cusp_of_the_reaction():
    """p1 = e^-2, p3 = 5/2."""
    (cusp,) = (
        one for one in reference.stored("fold_curves")["A -> B reaction"] if one[0] == "cusp"
    )
    np.testing.assert_allclose(cusp[1:], [np.exp(-2), 2.5], rtol=1e-15)
