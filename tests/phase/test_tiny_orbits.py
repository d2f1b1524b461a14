"""Orbits next to phi = 0 as small as doubles are, against closed forms and mpmath."""

import mpmath as mp
import numpy as np
import pytest

from phasekit.errors import OrbitKind
from phasekit.phase.exact.action_angle import action_angle, state_of
from phasekit.phase.exact.flow import flow
from phasekit.phase.exact.orbits import orbits, orbits_at_gap

LIBRATION, ROTATION = OrbitKind.LIBRATION, OrbitKind.ROTATION
AMPLITUDES = np.array([1e-20, 1e-60, 1e-72, 1e-73, 1e-77, 1e-90, 1e-120, 1e-200, 1e-300])


def quartic():
    """Period times amplitude, and action over its cube, of phi'' = -phi^3/2."""
    with mp.workdps(30):
        return (
            float(8 * mp.ellipk(-1)),
            float(mp.quad(lambda u: mp.sqrt(1 - u**4), [0, 0.9, 1]) / mp.pi),
        )


def swing(u):
    """x(u) and x'(u) of x'' = -x^3/2 from rest at 1."""
    x = mp.ellipfun("cn", u / mp.sqrt(2), m=mp.mpf(1) / 2)
    root = mp.sqrt((1 - x**4) / 4)
    return float(x), float(-root if mp.sin(2 * mp.pi * u / quartic()[0]) > 0 else root)


@pytest.mark.parametrize("unit", [1.0, 7e150, 3e-150])
def test_librations_next_to_a_cusp(unit):
    """One unit of time for each size of the force, so A goes with its square."""
    a = AMPLITUDES[AMPLITUDES > 1e-150] if unit != 1.0 else AMPLITUDES
    period, action = quartic()
    for phi, dphi in ((a, 0.0 * a), (-a, 0.0 * a), (0.0 * a, 0.5 * a * a * np.sqrt(unit))):
        keep = (np.abs(phi) > 0.0) | (np.abs(dphi) > 1e-290)  # denormals have few digits
        got = orbits(unit, unit, 0.0, phi[keep], dphi[keep])
        a_ = a[keep]
        assert keep.sum() >= 5
        assert np.all(got.orbit_kind == LIBRATION)
        np.testing.assert_allclose(got.period * a_ * np.sqrt(unit), period, rtol=4e-15)
        np.testing.assert_allclose(got.phi_min, -a_, rtol=4e-15)
        np.testing.assert_allclose(got.phi_max, a_, rtol=4e-15)
        whole = a_ > 1e-90
        expected = action * a_[whole] ** 3 * np.sqrt(unit)
        np.testing.assert_allclose(got.action[whole], expected, rtol=4e-14)
        np.testing.assert_allclose(got.orbit_energy, -0.5 * unit)


@pytest.mark.parametrize("a", [1e-10, 1e-50, 1e-80, 1e-140])
def test_motion_and_angle_next_to_a_cusp(a):
    u = np.array([0.0, 1.3, 4.0, 9.1, 33.3])
    got = flow(1.0, 1.0, 0.0, a, 0.0, u / a)
    x, v = np.transpose([swing(part) for part in u])
    np.testing.assert_allclose(got.motion_phi, a * x, rtol=0.0, atol=1e-14 * a)
    np.testing.assert_allclose(got.motion_dphi, a * a * v, rtol=0.0, atol=1e-14 * a * a)
    angles = action_angle(1.0, 1.0, 0.0, got.motion_phi, got.motion_dphi)
    phase = np.mod(2.0 * np.pi * u / quartic()[0], 2.0 * np.pi)
    np.testing.assert_allclose(angles.angle, phase, atol=1e-13)
    np.testing.assert_allclose(angles.frequency, 2.0 * np.pi * a / quartic()[0], rtol=1e-14)
    # The action goes with the cube of the frequency.
    np.testing.assert_allclose(
        angles.twist * 3.0 * quartic()[1] * a**2 / (angles.frequency / a), 1.0
    )


def test_the_unfolding_of_a_cusp_has_one_shape():
    """All have one motion in phi = C^(1/3) x and t = C^(-1/3) u: x'' = 1 - x^3/2."""
    c = np.array([1e-21, 1e-60, 1e-120, 1e-210, 1e-300])
    size = np.array([float(mp.cbrt(mp.mpf(x))) for x in c])
    got = orbits(1.0, 1.0, c, 0.0, 0.0)
    assert np.all(got.orbit_kind == LIBRATION)
    with mp.workdps(30):  # x'^2/2 = x - x^4/8, with x = 2 sin^2 from 0 to 2

        def slow(angle):
            sine = mp.sin(angle) ** 2
            return mp.sqrt(1 + sine + sine**2)

        period = 4 * mp.quad(lambda angle: 1 / slow(angle), [0, mp.pi / 2])
        action = (
            mp.quad(
                lambda angle: 8 * (mp.sin(angle) * mp.cos(angle)) ** 2 * slow(angle), [0, mp.pi / 2]
            )
            / mp.pi
        )
    np.testing.assert_allclose(got.period * size, float(period), rtol=2e-12)
    np.testing.assert_allclose(got.phi_max / size, 2.0, rtol=1e-14)
    np.testing.assert_allclose(got.action / c, float(action), rtol=2e-12)
    t = np.array([0.0, 1.0, 2.5])
    x = np.array([flow(1.0, 1.0, *args, 0.0, 0.0, t / s).motion_phi / s
                  for args, s in zip(c[:, None], size, strict=True)])  # fmt: skip
    np.testing.assert_allclose(x, np.broadcast_to(x[0], x.shape), rtol=1e-13, atol=1e-13)


@pytest.mark.parametrize(("A", "B"), [(0.0, 1.0), (1.0, 2.0), (-1.0, 0.5), (-2.0, -1.0)])
def test_small_oscillations(A, B):
    a = np.array([1e-100, 1e-150, 1e-162, 1e-170, 1e-308])
    omega = np.sqrt(B - A)
    got = orbits(A, B, 0.0, 0.6 * a, -0.8 * a * omega)
    assert np.all(got.orbit_kind == LIBRATION)
    np.testing.assert_allclose(got.period, 2.0 * np.pi / omega, rtol=1e-15)
    np.testing.assert_allclose(got.phi_max, a, rtol=2e-15)
    np.testing.assert_allclose(got.action[:2], 0.5 * omega * a[:2] ** 2, rtol=2e-15)
    t = np.array([0.0, 0.7, 11.0])
    for size in a:
        motion = flow(A, B, 0.0, 0.6 * size, -0.8 * size * omega, t)
        x = 0.6 * np.cos(omega * t) - 0.8 * np.sin(omega * t)
        np.testing.assert_allclose(motion.motion_phi / size, x, atol=1e-14)


# ------------------------------------------------------------------------------ saddles at 0


@pytest.mark.parametrize("v", [1e-6, 1e-12, 1e-20, 1e-100, 1e-150])
def test_next_to_an_upright_pendulum(v):
    """The state is well conditioned, as the saddle is at 0 exactly."""
    rising = orbits(0.0, -1.0, 0.0, [v, 0.0], [0.0, v])
    assert rising.orbit_kind.tolist() == [LIBRATION, ROTATION]
    with mp.workdps(400):
        small = mp.mpf(v) / 2
        m = mp.cos(small) ** 2
        k = mp.sqrt(1 + small**2)
        quarter = mp.ellipk(m), mp.ellipk(1 / k**2)
        want = [float(4 * quarter[0]), float(2 * quarter[1] / k)]
        np.testing.assert_allclose(rising.period, want, rtol=4e-15)
        soon = flow(0.0, -1.0, 0.0, [v, 0.0], [0.0, v], 1.0)
        np.testing.assert_allclose(soon.motion_phi / v, [np.cosh(1.0), np.sinh(1.0)], rtol=1e-11)
        near = mp.log(8 / mp.mpf(v))
        for part in (0.9, 1.0, 1.02):
            t = float(near * part)
            swings = mp.pi + 2 * mp.asin(
                mp.sqrt(m) * mp.ellipfun("sn", mp.mpf(t) - quarter[0], m=m)
            )
            u = k * mp.mpf(t) - quarter[1]
            turns = mp.pi + 2 * mp.atan2(*(mp.ellipfun(f, u, m=1 / k**2) for f in ("sn", "cn")))
            got = flow(0.0, -1.0, 0.0, [v, 0.0], [0.0, v], t).motion_phi
            np.testing.assert_allclose(got, [float(swings), float(turns)], atol=1e-15 * t + 4e-16)


@pytest.mark.parametrize("a", [1e-3, 1e-8, 1e-20, 1e-60, 1e-70, 1e-100, 1e-150])
def test_next_to_a_cusp_that_is_a_saddle(a):
    got = orbits(-1.0, -1.0, 0.0, [a, 0.0], [0.0, a * a])
    assert got.orbit_kind.tolist() == [LIBRATION, ROTATION]
    period = quartic()[0]
    np.testing.assert_allclose(got.period * a, [period, 0.5 * period], rtol=3.0 * a + 4e-15)
    np.testing.assert_allclose(got.action, [2.0, 1.0], rtol=2.0 * a + 4e-15)


def test_flow_begins_where_it_starts():
    for system in ((-1, -1, -1), (-1, -1, 1), (1, -1, 1), (1, -1, -1), (-1, 1, 1), (1, 1, 1)):
        for k in 10.0 ** -np.arange(10.0, 310.0, 10.0):
            got = flow(*np.multiply(system, (1.0, 1.0, k)), 0.0, 0.0, 0.0)
            assert abs(got.motion_phi) < 4e-16
            assert abs(got.motion_dphi) < 1e-100 or k > 1e-60


def test_what_underflows_is_on_the_separatrix_or_not_computed():
    """Not taken for a larger orbit."""
    beside = orbits(0.0, -1.0, 0.0, [1e-160, 0.0, 1e-300], [0.0, 1e-200, 0.0])
    assert np.all(beside.orbit_kind == OrbitKind.ASYMPTOTIC)
    for states in (
        orbits_at_gap(-1.0, -1.0, 0.0, [-1e-300, 1e-300]),
        orbits_at_gap(0.0, -1.0, 0.0, [-1e-320, 1e-320]),
    ):
        assert np.all(states.orbit_kind == OrbitKind.NOT_COMPUTED)
        for values in states[1:]:
            assert np.all(np.isnan(values))
    assert np.isnan(state_of(1.0, 1.0, 0.0, 1e-260, 0.3, 1).phi)


def test_the_unfolding_of_a_saddle_has_one_shape():
    """From rest at 0: t = |C|^(-1/3) u."""
    c = np.array([1e-21, 1e-60, 1e-150, 1e-200, 1e-250, 1e-300])
    size = np.array([float(mp.cbrt(mp.mpf(x))) for x in c])
    for sign in (1.0, -1.0):
        got = orbits(-1.0, -1.0, sign * c, 0.0, 0.0)
        assert np.all(got.orbit_kind == LIBRATION)
        with mp.workdps(30):  # x'^2/2 = x + x^4/8, from 0 to infinity and back to -2
            whole = mp.quad(lambda s: 2 / mp.sqrt(2 + s**6 / 4), [0, 1, 2, 8, 64, mp.inf])

            def slowness(s):
                x = 2 + s * s
                return 4 / mp.sqrt(x * (x * x + 2 * x + 4))

            whole += mp.quad(slowness, [0, 1, 2, 8, 64, mp.inf])
        np.testing.assert_allclose(got.period * size, 2 * float(whole), rtol=1e-12)
        np.testing.assert_allclose(got.action, 2.0, rtol=1e-6)
        far = np.where(sign > 0, got.phi_max, -got.phi_min)
        np.testing.assert_allclose(far, 2.0 * np.pi, atol=5e-7)
