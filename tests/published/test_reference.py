"""The published numbers against 60 digits: a wrong digit in either would show."""

from __future__ import annotations

import os

import mpmath as mp
import numpy as np
import pytest
from published import reference
from published.systems import HOPF, SYSTEMS

ALL = os.environ.get("PHASEKIT_PUBLISHED") == "all"


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
