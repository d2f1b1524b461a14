"""
How strong a drive makes the motion of a damped disk irregular?
===============================================================

The threshold of [Melnikov1963] over the skew angle and the frequency of a periodic torque.

Damping splits the separatrix of the disk into two curves: motions leave the saddle on one and
reach it on the other. A torque makes both curves oscillate. Above a threshold they cross, and then
they cross infinitely often. Which well a motion reaches then depends on every digit of its start.
The threshold has a closed form in the parameters of the disk. The study compares it with the two
curves, integrated from the saddle.

Answer. The threshold is lowest, seven times the damping, next to the fold of the equilibria, where
the wells are shallow. On two lines of quiet frequencies no torque makes the curves cross, and next
to these lines the threshold rises steeply. Integrated curves begin to cross within 2e-5 of the
threshold. The script prints all numbers.

Run: ``python studies/questions/threshold_of_irregular_motion.py [PICTURE]``
"""

from __future__ import annotations

import sys

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.colors import LogNorm
from scipy.integrate import solve_ivp

import phasekit as pk

DISK = pk.GyroRotorDisk(beta=0.6, e=0.05, a=0.024, r=0.2, omega1=300 * pk.rpm)
DAMPING = 0.03  # 1/s
BETA = np.linspace(10.0, 48.0, 77) * pk.deg
FREQUENCY = np.geomspace(2.0, 80.0, 80)
TRIED = [(20.0, 20.0), (35.0, 10.0), (45.0, 12.0)]  # deg, 1/s
PHASES = 12


def threshold(beta: object, nu: object) -> object:
    """Amplitude of the torque, over the inertia, at which the curves of the right lobe cross."""
    driven = pk.Perturbed(DISK.replace(beta=beta), damping=DAMPING, forcing=pk.Harmonic(1.0, nu))
    return pk.melnikov(driven).chaos_threshold.sel(saddle="lower", side="right")


def crossings(disk: object, size: float, nu: float, *, leaving: bool) -> tuple[float, complex]:
    """Energy at which one of the two curves turns back: its mean, and how it waves with time."""
    A, B, C = disk.coefficients()
    loop = pk.separatrices(disk).sel(saddle="lower")
    saddle, k = loop.saddle_phi.item(), loop.saddle_exponent.item()
    rate = np.hypot(k, 0.5 * DAMPING) - (0.5 if leaving else -0.5) * DAMPING
    rate = rate if leaving else -rate
    # The saddle moves with the torque, to first order like this.
    response = size / complex(-(nu**2) - k**2, DAMPING * nu)

    def motion(t: float, x: np.ndarray) -> list[float]:
        s, c = np.sin(x[0]), np.cos(x[0])
        return [x[1], (A * c - B) * s + C * c - DAMPING * x[1] + size * np.cos(nu * t)]

    def turned(t: float, x: np.ndarray) -> float:
        """Velocity, once the saddle is left behind."""
        return x[1] if x[0] - saddle > 0.1 else rate

    turned.terminal = True
    near, times, levels = 1e-5, [], []
    for start in np.arange(PHASES) * 2.0 * np.pi / (nu * PHASES):
        saddle_now = response * np.exp(1j * nu * start)
        x = [
            saddle + near + saddle_now.real,
            near * rate + (1j * nu * saddle_now).real,
        ]
        until = start + (80.0 if leaving else -80.0) / k
        found = solve_ivp(motion, (start, until), x, events=turned, rtol=1e-11, atol=1e-13)
        phi = found.y_events[0][0, 0]
        times.append(found.t_events[0][0])
        levels.append(-B * np.cos(phi) + 0.5 * A * np.cos(phi) ** 2 - C * np.sin(phi))
    angle = nu * np.array(times)
    waves = np.stack([np.ones(PHASES), np.cos(angle), np.sin(angle)], axis=1)
    mean, cosine, sine = np.linalg.lstsq(waves, np.array(levels), rcond=None)[0]
    return mean, complex(cosine, sine)


def main() -> None:
    """Print the thresholds where they are simulated, and draw the map."""
    exact = threshold(BETA, FREQUENCY)
    worst = 0.0
    for beta, nu in TRIED:
        disk = DISK.replace(beta=beta * pk.deg)
        expected = threshold(beta * pk.deg, nu).item()
        (up, wave), (down, other) = (
            crossings(disk, expected, nu, leaving=way) for way in (True, False)
        )
        seen = expected * abs(up - down) / abs(wave - other)
        worst = max(worst, abs(seen / expected - 1.0))
        print(f"beta = {beta:g} deg, {nu:g} 1/s: threshold {expected:.6f} 1/s2, seen {seen:.6f}")
    print(f"largest difference: {worst:.1e}")
    least = exact.where(np.isfinite(exact)).min().item()
    print(f"least threshold: {least:.4f} 1/s2 = {least / DAMPING:.3f} of the damping in 1/s")
    figure, axis = plt.subplots(figsize=(8, 5.0), layout="constrained")
    values = exact.transpose("forcing_frequency", "beta").values
    drawn = axis.pcolormesh(
        BETA / pk.deg, FREQUENCY, values, norm=LogNorm(vmax=50.0), rasterized=True
    )
    axis.plot(*np.transpose(TRIED), "o", mfc="white", mec="black", label="simulated")
    axis.set(xlabel=r"$\beta$ (°)", ylabel="frequency of the torque (s$^{-1}$)", yscale="log")
    marks = [2, 5, 10, 20, 50]
    axis.set_yticks(marks, labels=map(str, marks))
    axis.set_yticks([], minor=True)
    axis.legend(loc="upper left")
    label = "threshold of the torque, over the inertia (s$^{-2}$)"
    figure.colorbar(drawn, label=label, extend="max")
    path = sys.argv[1] if len(sys.argv) > 1 else "threshold_of_irregular_motion.png"
    figure.savefig(path, dpi=100)
    print(f"wrote {path}")


if __name__ == "__main__":
    main()
