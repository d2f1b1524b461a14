"""Conservative systems with periods, actions and areas in closed form."""

from __future__ import annotations

import mpmath as mp
import numpy as np
import pytest

import phasekit as pk

HARDENING = pk.Potential("x**2/2 + x**4/4", "x")
DOUBLE = pk.Potential("x**4/4 - x**2/2", "x")
CUBIC = pk.Potential("x**2/2 - x**3/3", "x")
MORSE = pk.Potential("D*(1 - exp(-x))**2", "x", {"D": 2.0}, interval=(-2.0, 60.0))
PENDULUM = pk.Potential("-cos(q)", "q", period=2 * np.pi)


def hardening_period(amplitude):
    """4 K(m)/sqrt(1 + a^2), m = a^2/(2 (1 + a^2)): x = a cn."""
    with mp.workdps(30):
        a2 = mp.mpf(amplitude) ** 2
        return 4 * mp.ellipk(a2 / (2 * (1 + a2))) / mp.sqrt(1 + a2)


def test_hardening_oscillator():
    """The published orbit: T = 2 pi/1.6 at amplitude 1.4613010536."""
    assert abs(hardening_period(1.4613010536) - 2 * mp.pi / mp.mpf("1.6")) < 1e-9
    amplitudes = np.array([1e-3, 0.1, 1.0, 1.4613010536, 5.0, 100.0])
    ds = pk.orbits(HARDENING, amplitudes, np.zeros(6))
    wanted = [float(hardening_period(a)) for a in amplitudes]
    np.testing.assert_allclose(ds.period, wanted, rtol=1e-12)
    np.testing.assert_allclose(ds.phi_max, amplitudes, rtol=1e-14)
    np.testing.assert_allclose(ds.phi_min, -amplitudes, rtol=1e-13)


def test_double_well():
    """The figure-eight at energy 0: x = sqrt(2) sech t, lobe area 4/3."""
    ds = pk.separatrices(DOUBLE)
    assert ds.figure_eight
    assert abs(float(ds.saddle_energy[0])) < 1e-15
    assert abs(float(ds.saddle_exponent[0]) - 1.0) < 1e-14
    np.testing.assert_allclose(ds.lobe_area, 4 / 3, rtol=1e-12)
    np.testing.assert_allclose(ds.turning_phi, [[-np.sqrt(2), np.sqrt(2)]], rtol=1e-14)
    t = np.linspace(-6.0, 6.0, 25)
    for side, sign in (("right", 1.0), ("left", -1.0)):
        motion = pk.separatrix_motion(DOUBLE, t, side=side)
        np.testing.assert_allclose(motion.motion_phi, sign * np.sqrt(2) / np.cosh(t), atol=1e-9)


@pytest.mark.parametrize("mu", [1e-3, 0.5, 1.0, 40.0])
def test_double_well_of_any_depth(mu):
    """By scaling x = sqrt(mu) y, t = s/sqrt(mu): area 4/3 mu^(3/2)."""
    well = pk.Potential("x**4/4 - mu*x**2/2", "x", {"mu": mu})
    np.testing.assert_allclose(pk.separatrices(well).lobe_area, 4 / 3 * mu**1.5, rtol=1e-12)


def test_cubic_potential():
    """The loop of x^2/2 - x^3/3 at energy 1/6 turns at -1/2; its area is 6/5."""
    ds = pk.separatrices(CUBIC)
    area = ds.lobe_area.values[np.isfinite(ds.lobe_area.values)]
    np.testing.assert_allclose(area, [6 / 5], rtol=1e-12)
    turn = ds.turning_phi.values[np.isfinite(ds.turning_phi.values)]
    np.testing.assert_allclose(turn, [-0.5], rtol=1e-14)


@pytest.mark.parametrize("energy", [1e-4, 0.5, 1.0, 1.9, 1.9999])
def test_morse(energy):
    """[LandauLifshitz1976] 12: frequency sqrt(2 (D - E)), action sqrt(2 D) - sqrt(2 (D - E))."""
    ds = pk.orbits(MORSE, 0.0, float(np.sqrt(2 * energy)))
    rest = np.sqrt(2 * (2.0 - energy))
    np.testing.assert_allclose(ds.frequency, rest, rtol=1e-10)
    np.testing.assert_allclose(ds.action, 2.0 - rest, rtol=1e-9)


@pytest.mark.parametrize("angle", [1e-3, 1.0, 3.0, 3.14159])
def test_pendulum(angle):
    """4 K(sin^2(angle/2)); separatrix area 16 for both arcs together."""
    with mp.workdps(30):
        wanted = float(4 * mp.ellipk(mp.sin(mp.mpf(angle) / 2) ** 2))
    np.testing.assert_allclose(pk.orbits(PENDULUM, angle, 0.0).period, wanted, rtol=1e-9)
    np.testing.assert_allclose(pk.separatrices(PENDULUM).winding_area, [8.0], rtol=1e-12)


def test_equilibria_of_a_conservative_problem_are_centers_and_saddles():
    """X'' = -V'(x) as a planar Problem; never stable or unstable, never a Hopf point."""
    problem = pk.Problem.from_potential("x**4/4 - mu*x**2/2", "x", {"mu": -1.0})
    branch = pk.continuation(problem, "mu", x0=[0.0, 0.0], span=(-1.0, 1.0))
    assert [one.kind for one in branch.special_points if one.kind != "end"] == ["pitchfork"]
    assert "n_unstable" not in branch.points
    mu, kind = branch.points.mu.values, branch.points["kind"].values
    assert (kind[mu < -1e-6] == pk.EquilibriumKind.CENTER).all()
    assert (kind[mu > 1e-6] == pk.EquilibriumKind.SADDLE).all()
