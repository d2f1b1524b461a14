"""What damping takes along a motion is what the energy loses."""

import numpy as np
import pytest

import phasekit as pk

SYSTEMS = [
    pk.Pendulum(length=1.0, g=1.0),
    pk.Coefficients(1.0, 0.35, 0.12),
    pk.Potential("-x**2/2 + x**4/4", "x"),
]
NODES, WEIGHTS = np.polynomial.legendre.leggauss(24)


@pytest.mark.slow
@pytest.mark.parametrize("system", SYSTEMS, ids=lambda one: type(one).__name__)
@pytest.mark.parametrize(
    ("damping", "quadratic", "torque"),
    [(0.0, 0.3, 0.0), (0.1, 0.3, 0.0), (-0.05, 0.1, 0.07), (0.0, -0.05, -0.1)],
)
def test_energy_is_lost_to_damping(system, damping, quadratic, torque):
    perturbed = pk.Perturbed(system, damping=damping, quadratic=quadratic, torque=torque)
    fine = {"rtol": 1e-13, "atol": 1e-14}
    rests = pk.flow(perturbed, 0.4, 1.3, [12.0], events={"rest": lambda t, x, v: v}, **fine)
    ends = np.concatenate([[0.0], rests.event_time.values, [12.0]])
    inner = [np.linspace(a, b, 6)[:-1] for a, b in zip(ends[:-1], ends[1:], strict=True)]
    ends = np.concatenate([*inner, [12.0]])
    half = 0.5 * np.diff(ends)[:, None]
    times = (0.5 * (ends[1:] + ends[:-1])[:, None] + half * NODES).reshape(-1)
    motion = pk.flow(perturbed, 0.4, 1.3, np.append(times, 12.0), **fine)
    phi, dphi = motion.motion_phi.values, motion.motion_dphi.values
    v = dphi[:-1]
    power = (torque - damping * v - quadratic * np.abs(v) * v) * v
    gained = np.sum((half * WEIGHTS).reshape(-1) * power)
    start, end = (
        pk.energy(system, x, rate).energy_integral.item()
        for x, rate in ((0.4, 1.3), (phi[-1], dphi[-1]))
    )
    assert abs(gained) > 1e-2
    assert end - start == pytest.approx(gained, abs=1e-10)
