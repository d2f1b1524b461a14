"""Melnikov's function against the simulated splitting of the manifolds."""

import os

import numpy as np
import pytest
from witnesses import splitting

import phasekit as pk
from phasekit.mechanics.disk import disk_mixing

MORE = int(os.environ.get("PHASEKIT_ENSEMBLES", "0"))
EIGHT = pk.Coefficients(1.0, 0.35, 0.12)
SIDES = {"left": -1, "right": 1}


def simulated(system, force, nu, saddle, side):
    A, B, C = system.coefficients()
    sep = pk.separatrices(system).sel(saddle=saddle)
    return splitting.coefficient(
        force,
        lambda x: (B - A * np.cos(x)) * np.sin(x) - C * np.cos(x),
        lambda x: -B * np.cos(x) + 0.5 * A * np.cos(x) ** 2 - C * np.sin(x),
        sep.saddle_phi.item(),
        sep.saddle_exponent.item(),
        nu,
        side=SIDES[side],
        winds=sep.loop.item() == pk.Loop.WINDING,
    )


def predicted(perturbed, saddle, side):
    ds = pk.melnikov(perturbed).sel(saddle=saddle, side=side)
    return ds.melnikov_amplitude.item() * np.exp(1j * ds.melnikov_phase.item())


def compare(perturbed, force, nu, saddle, side, bound):
    want = simulated(perturbed.system, force, nu, saddle, side)
    got = predicted(perturbed, saddle, side)
    assert abs(got) > 0.0
    assert abs(abs(want) / abs(got) - 1.0) < bound
    assert abs(want / got - 1.0) < 30 * bound  # the phase, whose error is of first order


@pytest.mark.slow
@pytest.mark.parametrize(
    ("saddle", "side"), [("lower", "left"), ("lower", "right"), ("upper", "right")]
)
def test_torque(saddle, side):
    eps = 2e-4
    driven = pk.Perturbed(EIGHT, forcing=pk.Harmonic(eps, 1.0))
    compare(driven, lambda t, x: eps * np.cos(t), 1.0, saddle, side, 1e-4)


@pytest.mark.slow
@pytest.mark.parametrize(("saddle", "side"), [("lower", "right"), ("lower", "left")])
def test_modulated_support(saddle, side):
    """With the torque of omega1', without which the amplitude would be another."""
    disk = pk.GyroRotorDisk(beta=1.2, e=0.05, a=0.004, r=0.1, omega1=24.0)
    A, B, C = disk.coefficients()
    size, nu, w = 24.0 * 2e-5, 9.0, 24.0
    kappa = float(disk_mixing(0.1, 0.05, 1.2))
    driven = pk.Perturbed(disk, modulation={"omega1": pk.Harmonic(size, nu)})

    def force(t, x):
        now = w + size * np.cos(nu * t)
        more = (now / w) ** 2 - 1.0
        pull = more * (A * np.sin(x) * np.cos(x) + C * np.cos(x))
        return pull + size * nu * np.sin(nu * t) * kappa * np.cos(x)

    compare(driven, force, nu, saddle, side, 1e-4)
    bare = pk.Perturbed(pk.Coefficients(A, B, C), modulation={
        "A": pk.Harmonic(2 * A * size / w, nu), "C": pk.Harmonic(2 * C * size / w, nu)
    })  # fmt: skip
    lost = abs(predicted(bare, saddle, side)) / abs(predicted(driven, saddle, side))
    assert abs(lost - 1.0) > 0.02


@pytest.mark.skipif(not MORE, reason="slow: PHASEKIT_ENSEMBLES=1 runs it")
@pytest.mark.parametrize("eps", [1e-3, 1e-4])
@pytest.mark.parametrize("nu", [0.4, 1.7])
@pytest.mark.parametrize("abc", [(1.0, 0.35, 0.12), (-1.0, 0.2, 0.5), (0.3, 1.0, 0.2)])
def test_amplitudes_agree_as_the_drive_vanishes(abc, nu, eps):
    system = pk.Coefficients(*abc)
    driven = pk.Perturbed(system, forcing=pk.Harmonic(eps, nu))
    loops = pk.separatrices(system)
    for saddle in ("lower", "upper"):
        if loops.loop.sel(saddle=saddle) != pk.Loop.ABSENT:
            compare(driven, lambda t, x: eps * np.cos(nu * t), nu, saddle, "right", 10 * eps)
