"""Resonances of orbits with a drive, simulated: with actions by quadrature and motions by SciPy.

Orbits start at the resonant action all round; those next to the unstable one travel to the far side
of the resonance, so that the greatest excursion of the action is its half-width, which grows as
the root of the drive: of two drives, one of them four times the other, both have to be met.
"""

import os

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.optimize import brentq

import phasekit as pk

ORBITS = 12
NODES = np.polynomial.legendre.leggauss(200)
PENDULUM, EIGHT = (0.0, 1.0, 0.0), (1.0, 0.35, 0.12)
#: Coefficients, family, an angle inside the orbits (None: they rotate), order, frequency, what
#: varies, and the least of two amplitudes.
CASES = [
    (PENDULUM, "lower_well", 0.0, 2, 1.7, "B", 2e-3),
    (PENDULUM, "forward", None, 1, 2.5, "forcing", 2e-3),
    (EIGHT, "upper_well", "upper_center", 2, 1.0, "forcing", 1e-4),
    (EIGHT, "backward", None, 2, 3.4, "C", 2e-3),
]
if os.environ.get("PHASEKIT_ENSEMBLES"):
    CASES += [
        (PENDULUM, "lower_well", 0.0, 1, 0.8, "forcing", 6e-4),
        (EIGHT, "lower_well", "lower_center", 1, 0.75, "forcing", 1e-4),
        (EIGHT, "outer", "lower_center", 1, 0.4, "forcing", 2e-5),
    ]


def potential(abc, x):
    A, B, C = abc
    return -B * np.cos(x) + A / 2 * np.cos(x) ** 2 - C * np.sin(x)


def slope(abc, x):
    A, B, C = abc
    return B * np.sin(x) - A * np.sin(x) * np.cos(x) - C * np.cos(x)


def ends(abc, energy, center, family):
    """Turning points of the orbit round a center."""
    if center is None:
        return -np.pi, np.pi
    reach = np.linspace(0.0, (2.0 if family == "outer" else 1.0) * np.pi, 4001)
    found = []
    for sign in (-1.0, 1.0):
        below = potential(abc, center + sign * reach) < energy
        # Round both wells the last crossing counts, round one the first.
        step = below[:-1] & ~below[1:]
        i = np.flatnonzero(step)[-1 if family == "outer" else 0]
        at = brentq(lambda y, s=sign: potential(abc, center + s * y) - energy, *reach[[i, i + 1]])
        found.append(center + sign * at)
    return tuple(found)


def action(abc, energy, center, family):
    low, high = ends(abc, energy, center, family)
    middle, half = 0.5 * (low + high), 0.5 * (high - low)

    x, w = NODES
    height = 2.0 * (energy - potential(abc, middle + half * np.sin(0.5 * np.pi * x)))
    speed = np.sqrt(np.maximum(height, 0.0)) * np.cos(0.5 * np.pi * x)
    area = 0.5 * np.pi * half * (w @ speed)
    return area / (2.0 * np.pi if center is None else np.pi)


def motion(abc, start, times, drive=None):
    """States at times, of shape (2, orbits, times)."""
    start = np.asarray(start, float)

    def rates(t, y):
        x, v = y.reshape(2, -1)
        force = -slope(abc, x) + (drive(t, x) if drive else 0.0)
        return np.concatenate([v, force])

    found = solve_ivp(
        rates, (0.0, times[-1]), start.reshape(-1), "DOP853", times, rtol=1e-9, atol=1e-11
    )
    assert found.success
    return found.y.reshape(2, -1, len(times))


@pytest.mark.slow
@pytest.mark.parametrize(("abc", "family", "center", "n", "nu", "varies", "amplitude"), CASES)
def test_width_and_action(abc, family, center, n, nu, varies, amplitude):
    base = pk.Coefficients(*abc)
    if isinstance(center, str):
        center = pk.equilibria(base).phi.sel(equilibrium=center).item()
    heights = potential(abc, np.linspace(-np.pi, np.pi, 721))
    saddle = pk.separatrices(base).saddle_energy.min().item()
    low, high = {
        "lower_well": (potential(abc, center or 0.0), saddle),
        "upper_well": (potential(abc, center or 0.0), saddle),
        "outer": (saddle, heights.max()),
    }.get(family, (heights.max(), heights.max() + 10.0))
    inside = np.array([low + 1e-6 * (high - low), high - 1e-6 * (high - low)])
    ratios = []
    for size in (4.0 * amplitude, amplitude):
        harmonic = pk.Harmonic(size, nu)
        drive = {"forcing": harmonic} if varies == "forcing" else {"modulation": {varies: harmonic}}
        ds = pk.resonances(pk.Perturbed(base, **drive), n=[n], family=family)
        J, width = ds.resonance_action.item(), ds.resonance_width.item()
        h = brentq(lambda e, J=J: action(abc, e, center, family) - J, *inside, xtol=1e-14)
        reach = 1.6 * nu / n * width
        grid = np.clip(np.linspace(h - reach, h + reach, 61), *inside)
        actions = np.array([action(abc, e, center, family) for e in grid])
        if center is None:
            x, sense = 0.0, (1.0 if family == "forward" else -1.0)
        else:
            x, sense = ends(abc, h, center, family)[1] - 1e-9, 0.0
        v = sense * np.sqrt(2.0 * (h - potential(abc, x)))
        period = n * 2.0 * np.pi / nu
        round_ = motion(abc, [[x], [v]], np.linspace(0.0, period, ORBITS + 1))[:, 0]
        assert round_[0, -1] - x == pytest.approx(sense * 2.0 * np.pi, abs=1e-5)  # n Omega = nu

        def torque(t, y, size=size):
            wave = size * np.cos(nu * t)
            return wave * {"forcing": 1.0, "B": -np.sin(y), "C": np.cos(y)}[varies]

        # Half as long again as one round at the middle of the resonance takes.
        pace = 0.5 * n * width * abs(twist(abc, h, center, family, 1e-3 * (h - low)))
        times = np.arange(0.0, 1.5 * 2.0 * np.pi / pace, 2.0 * np.pi / nu)
        assert times.size > 25
        x, v = motion(abc, round_[:, :-1], times, torque)
        seen = np.interp(0.5 * v * v + potential(abc, x), grid, actions)
        ratios.append(np.abs(seen - J).max() / width)
    assert ratios == pytest.approx([1.0, 1.0], abs=0.04)


def twist(abc, h, center, family, step):
    """Derivative of Omega by J, by differences of the action: Omega = dh/dJ."""
    J = [action(abc, h + s * step, center, family) for s in (-2, -1, 0, 1, 2)]
    first = (J[0] - 8 * J[1] + 8 * J[3] - J[4]) / (12 * step)
    second = (-J[0] + 16 * J[1] - 30 * J[2] + 16 * J[3] - J[4]) / (12 * step**2)
    return -second / first**3
