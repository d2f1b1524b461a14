"""Functions of multipliers whose products no number holds have one scale, and the sign."""

from types import SimpleNamespace

import numpy as np
import pytest
from mpmath import mp

from phasekit.cycles import criteria


def of(multipliers):
    return SimpleNamespace(multipliers=np.array(multipliers, complex))


@pytest.mark.parametrize("exponent", [3, 60, 150, 200])
@pytest.mark.parametrize("forced", [False, True])
def test_determinants_have_the_sign_of_sums_in_many_digits(exponent, forced):
    rng = np.random.default_rng(3)
    whole = []
    for _ in range(20):
        size = 10.0 ** rng.uniform(-3, exponent, 3)
        mu = [1.0, *(size * rng.choice([-1, 1], 3)).tolist(), rng.normal()]
        with mp.workdps(900):
            rest = [1 - mp.mpf(one) for one in mu]
            terms = [mp.fprod(rest[:i] + rest[i + 1 :]) for i in range(len(rest))]
            exact = mp.fprod(rest) if forced else mp.fsum(terms)
            sign, fits = int(mp.sign(exact)), abs(exact) < criteria.LARGEST
        found = criteria.determinant_whole(of(mu), forced)
        assert np.isfinite(found)
        assert np.sign(criteria.determinant(of(mu), forced)) == sign == np.sign(found)
        if fits:
            assert found == pytest.approx(float(exact), rel=1e-12)
        whole.append(abs(found))
    assert max(whole) <= criteria.LARGEST
    assert (max(whole) == criteria.LARGEST) == (exponent > 100 and not forced)


def test_those_of_doublings_as_well():
    for last in (-1.5, -0.5):
        found = criteria.doubling_whole(of([1e200, 1e200, last]), False)
        assert found == np.copysign(criteria.LARGEST, 1.0 + last)
    assert criteria.doubling_whole(of([2.0, -0.5 + 1j, -0.5 - 1j]), False) == pytest.approx(3.75)


@pytest.mark.parametrize("forced", [False, True])
def test_what_errors_hide_has_no_sign(forced):
    for mu in ([1.0, 0.5, np.nan], [1.0, 1e200, 1e200, np.nan]):
        assert np.isnan(criteria.determinant_whole(of(mu), forced))
        assert np.isnan(criteria.doubling_whole(of(mu), forced))
