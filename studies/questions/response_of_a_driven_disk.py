"""
Where does a driven disk jump?
==============================

The response of a damped disk to a periodic torque, over the frequency of the torque.

The disk swings about its lower center. The torque is too strong for a linear theory: the response
curve leans to lower frequencies and folds, and between the folds two motions are stable. While the
frequency slowly increases or decreases, the disk jumps at one of the folds.

Answer. The disk jumps at 0.89 and at 0.87 of the frequency of small oscillations. Between these
frequencies the amplitude depends on the history. The script prints all numbers.

Run: ``python studies/questions/response_of_a_driven_disk.py [PICTURE]``
"""

from __future__ import annotations

import sys

import matplotlib.pyplot as plt
import numpy as np

import phasekit as pk

DISK = pk.GyroRotorDisk(beta=0.6, e=0.01, a=0.02, r=0.1, omega1=4.0, m=2.0, half_span=0.1)
DAMPING, FORCE = 0.1, 0.09  # over the natural frequency, and over its square


def main() -> None:
    """Print the folds of the response and draw it beside its multipliers."""
    rest = pk.equilibria(DISK).sel(equilibrium="lower_center")
    natural, phi = rest.natural_frequency.item(), rest.phi.item()
    print(f"frequency of small oscillations: {natural:.6f} 1/s")
    driven = pk.Perturbed(
        DISK,
        damping=DAMPING * natural,
        forcing=pk.Harmonic(FORCE * natural**2, 0.5 * natural),
    )
    swing = pk.periodic_orbit(driven, [phi, 0.0], settle=20.0 / (DAMPING * natural))
    span = (0.4 * natural, 1.6 * natural)
    response = pk.continuation(driven, "forcing_frequency", orbit=swing, span=span)
    for fold in response.special("LPC"):
        at = fold["forcing_frequency"]
        print(f"jump at {at:.8f} 1/s, {at / natural:.4f} of the frequency of small oscillations")
    points = response.points
    amplitude = np.degrees(points.phi_max - points.phi_min) / 2.0
    peak = int(np.argmax(amplitude.values))
    print(
        f"largest amplitude: {float(amplitude[peak]):.2f} deg at "
        f"{float(points.forcing_frequency[peak]) / natural:.4f} of it"
    )
    product = points["multiplier"].values.prod(axis=1).real
    off = np.abs(product / np.exp(-driven.damping * points.period.values) - 1.0).max()
    print(f"product of the multipliers: exp(-damping T) to {off:.0e}")
    figure, axes = plt.subplots(1, 2, figsize=(12, 5.0), layout="constrained")
    pk.plot.branch(response, y="phi_max", ax=axes[0])
    axes[0].set(xlabel="frequency of the torque (1/s)", ylabel="greatest angle (rad)")
    pk.plot.multipliers(response, ax=axes[1])
    path = sys.argv[1] if len(sys.argv) > 1 else "response_of_a_driven_disk.png"
    figure.savefig(path, dpi=100)
    print(f"wrote {path}")


if __name__ == "__main__":
    main()
