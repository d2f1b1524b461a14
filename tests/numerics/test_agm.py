"""The arithmetic-geometric mean and its motion, against mpmath's elliptic functions (40 digits).

psi' = sqrt(a^2 cos(psi)^2 + b^2 sin(psi)^2) from psi = 0 is Jacobi's amplitude of a t, with the
complementary modulus b/a; for b > a, the same seen from psi = pi/2.
"""

from __future__ import annotations

import numpy as np
import pytest
from mpmath import mp, mpf
from witnesses import oracle

from phasekit.numerics.agm import STEPS, amplitude, halve, phase

UNIT = 2.0**-53
RATIOS = [1e-12, 1e-9, 3e-5, 0.01, 0.3, 0.9, 1 - 1e-9, 1.0, 1 + 1e-6, 1.5, 40.0, 1e4, 1e8, 1e12]
# Phases of all quadrants, close to the axes too.
PHASES = [0.0, 1e-9, 1e-3, 0.1, 0.7, 1.3, 1.57, np.pi / 2, 1.58, 2.5, 3.1415, np.pi]
PHASES += [-x for x in PHASES[1:]]


class Mean:
    """The means of a and b, with what mpmath says of them."""

    def __init__(self, a: float, b: float) -> None:
        self.w = np.zeros(2 * STEPS)
        self.n = halve(a, b, 0, self.w)
        self.mean = self.w[self.n]
        self.a, self.b = mpf(a), mpf(b)
        self.exact = mp.agm(self.a, self.b)
        small, large = sorted((self.a, self.b))
        self.swapped = self.a < self.b
        self.large, self.m = large, 1 - (small / large) ** 2
        self.quarter = mp.ellipk(self.m)  # large times the time from psi = 0 to pi/2

    def state(self, angle):
        """Exact sine, cosine and Delta at a phase."""
        shifted = mp.pi / 2 - angle if self.swapped else angle
        u = shifted * 2 / mp.pi * self.quarter
        sn, cn, dn = (mp.ellipfun(name, u, m=self.m) for name in ("sn", "cn", "dn"))
        return (cn, sn, dn * self.large) if self.swapped else (sn, cn, dn * self.large)

    def phase(self, psi):
        """Exact phase at psi."""
        if self.swapped:
            psi = mp.pi / 2 - psi
        turned = mp.ellipf(psi, self.m) / self.quarter * mp.pi / 2
        return mp.pi / 2 - turned if self.swapped else turned


def off(got, want) -> float:
    """Relative error in units of 2^-53."""
    if abs(want) < mpf(10) ** -60:  # zero
        return float(abs(got)) / UNIT
    return float(abs(mpf(float(got)) / want - 1)) / UNIT


@pytest.fixture(autouse=True)
def digits():
    with mp.workdps(70):  # what 1 - m = 1e-24 leaves of them is more than 40
        yield


@pytest.mark.parametrize("ratio", [*RATIOS, 1e-300, 1e-150, 1e150])
@pytest.mark.parametrize("scale", [1.0, 3.7, 1e-5])
def test_mean(ratio, scale):
    got = Mean(scale, scale * ratio)
    assert off(got.mean, got.exact) <= 4
    assert got.n <= 13
    # What `amplitude` starts from: both means equal.
    assert got.w[STEPS + got.n] == pytest.approx(got.mean, rel=4 * UNIT)


@pytest.mark.parametrize("ratio", RATIOS)
def test_amplitude(ratio):
    """The error is that of sine and cosine as they are given, times the condition number.

    Relative changes of sin(psi) and cos(psi) with those of the phase's sine and cosine are at
    most the quarter period, which grows with the logarithm of the ratio.
    """
    means = Mean(1.3, 1.3 * ratio)
    bound = 6 + 6 * float(means.quarter)
    for angle in PHASES:
        sine, cosine = float(np.sin(angle)), float(np.cos(angle))
        got = amplitude(sine, cosine, 0, means.n, means.w)
        want = means.state(mp.atan2(mpf(sine), mpf(cosine)))
        for name, x, exact in zip(("sin", "cos", "Delta"), got, want, strict=True):
            assert off(x, exact) <= bound, (ratio, angle, name, off(x, exact))


@pytest.mark.parametrize("ratio", RATIOS)
def test_phase(ratio):
    """Relative error, also next to 0; next to +-pi/2 and pi the absolute one is as small."""
    means = Mean(0.7, 0.7 * ratio)
    for psi in PHASES:
        sine, cosine = float(np.sin(psi)), float(np.cos(psi))
        got = phase(sine, cosine, 0, means.n, means.w)
        want = means.phase(mp.atan2(mpf(sine), mpf(cosine)))
        assert off(got, want) <= 10, (ratio, psi, off(got, want))


@pytest.mark.parametrize("ratio", [*RATIOS, 1e-140, 1e140])
def test_phase_and_amplitude_are_inverse(ratio):
    w = np.zeros(2 * STEPS)
    n = halve(1.0, ratio, 0, w)
    bound = (10 + 10 * abs(np.log(ratio))) * UNIT
    for angle in PHASES:
        sine, cosine, _ = amplitude(float(np.sin(angle)), float(np.cos(angle)), 0, n, w)
        assert abs(phase(sine, cosine, 0, n, w) - angle) <= bound * max(abs(angle), 1e-300), angle


@pytest.mark.parametrize("ratio", RATIOS)
def test_motion_is_solved(ratio):
    """Along the phase, sin(psi)' = cos(psi) Delta: central differences of mpmath's own arithmetic.

    The functions run on mpmath numbers as well, where differences keep enough digits.
    """
    w = [mpf(0)] * (2 * STEPS)
    a, b = mpf(1), mpf(ratio)
    n = 0
    w[0], w[STEPS] = a, b
    while n < STEPS - 1 and abs(a - b) > mpf(10) ** -45 * a:
        a, b = (a + b) / 2, mp.sqrt(a * b)
        n += 1
        w[n], w[STEPS + n] = a, b
    step = mpf(10) ** -12 * min(mpf(1), mpf(ratio), 1 / mpf(ratio))
    for angle in (0.2, 1.4, -2.2):
        around = []
        for x in (angle - step, angle, angle + step):
            cosine, sine = mp.cos_sin(x)
            around.append(amplitude(sine, cosine, 0, n, w))
        rate = (around[2][0] - around[0][0]) / (2 * step) * w[n]
        exact = around[1][1] * around[1][2]
        assert abs(rate - exact) <= mpf(10) ** -15 * (abs(exact) + w[n] * abs(around[1][0]))
        square = (1 * around[1][1]) ** 2 + (mpf(ratio) * around[1][0]) ** 2
        assert abs(around[1][2] ** 2 / square - 1) < mpf(10) ** -30


def test_digits_of_the_reference_itself():
    """Gauss's own number: 1/agm(1, sqrt 2) = 0.8346268416740731862814..."""
    assert abs(1 / Mean(1.0, 2.0**0.5).exact - mpf("0.83462684167407318628142973")) < 1e-16
    assert oracle.DPS >= 40
