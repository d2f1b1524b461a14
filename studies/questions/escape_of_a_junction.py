"""
When does a Josephson junction switch?
======================================

The bias current at which a ramp switches a junction to the voltage state, for several dampings and
temperatures.

The phase of a junction rests in a well of a washboard potential that the bias current tilts. Noise
lifts the phase over the barrier before the well disappears. While the current is ramped, the
probability of still resting decreases at the escape rate of each current. At the median, half of
the ramps have switched.

Answer. With a noise of 0.01 of the Josephson energy, a quality of 10 and a ramp of 1e-6 of the
critical current per inverse plasma frequency, half of the junctions have switched at 0.886 of the
critical current. With a tenth of the noise it is 0.978. Of simulated phases, 1,000 at each of two
currents escape at the rate in closed form, within their errors of a tenth.

Run: ``python studies/questions/escape_of_a_junction.py [PICTURE]``
"""

from __future__ import annotations

import sys

import matplotlib.pyplot as plt
import numpy as np

import phasekit as pk

JUNCTION = pk.JosephsonJunction(plasma_frequency=1.0)
QUALITY, RAMP = 10.0, 1e-6
BIAS = np.linspace(0.3, 0.995, 100)
NOISES = (0.001, 0.01, 0.03)
PATHS, STEP = 1000, 0.1


def escape(bias: np.ndarray, noise: float) -> tuple[np.ndarray, np.ndarray]:
    """Return rate and relative error of the escape downhill."""
    tilted = pk.Perturbed(JUNCTION, damping=1.0 / QUALITY, torque=bias, kT=noise)
    ds = pk.escape_rate(tilted).sel(saddle="upper", side="left")
    return ds.escape_rate.values, ds.escape_error.values


def simulated(bias: float, noise: float, time: float) -> tuple[float, float]:
    """Return the rate at which simulated phases come to the next well, and its error."""
    rng = np.random.default_rng(1)
    keep = np.exp(-STEP / QUALITY)
    kick = np.sqrt(noise * (1.0 - keep * keep))
    rest = np.arcsin(bias)
    phi, dphi = np.full(PATHS, rest), rng.normal(0.0, np.sqrt(noise), PATHS)
    left, begin, lived = 0, 40.0, 0.0
    for i in range(int(time / STEP)):
        dphi += 0.5 * STEP * (bias - np.sin(phi))
        phi += 0.5 * STEP * dphi
        dphi = keep * dphi + kick * rng.normal(size=phi.size)
        phi += 0.5 * STEP * dphi
        dphi += 0.5 * STEP * (bias - np.sin(phi))
        stays = phi < rest + 2.0 * np.pi
        if i * STEP > begin:
            left += int((~stays).sum())
            lived += STEP * phi.size
        phi, dphi = phi[stays], dphi[stays]
    return left / lived, np.sqrt(left) / lived


def main() -> None:
    """Print and draw rates of escape, and the share of ramps that have switched."""
    figure, axes = plt.subplots(1, 2, figsize=(12, 4.8), layout="constrained")
    for noise in NOISES:
        rate, error = escape(BIAS, noise)
        known = np.isfinite(rate)
        (line,) = axes[0].semilogy(BIAS[known], rate[known], label=f"noise {noise}")
        low, high = (rate * np.exp(sign * error) for sign in (-1.0, 1.0))
        axes[0].fill_between(BIAS, low, high, where=known, alpha=0.3, color=line.get_color())
        # Where the barrier is less than 2 kT, and no rate is said, all have switched.
        steps = np.diff(BIAS) * 0.5 * (rate[1:] + rate[:-1]) / RAMP
        switched = 1.0 - np.exp(-np.cumsum(steps))
        good = np.isfinite(switched)
        axes[1].plot(BIAS[1:][good], switched[good], color=line.get_color())
        median = np.interp(0.5, switched[good], BIAS[1:][good])
        print(f"noise {noise}: half of the ramps have switched at {median:.3f}")
    for bias, noise in ((0.8, 0.03), (0.9, 0.01)):
        rate, error = (x[0] for x in escape(np.array([bias]), noise))
        found, spread = simulated(bias, noise, 500.0)
        label = "simulated" if noise == 0.01 else None
        axes[0].errorbar([bias], [found], [spread], fmt="ko", markersize=4, label=label)
        print(
            f"bias {bias}, noise {noise}: rate {rate:.3e} (error {error:.2f}), "
            f"simulated {found:.3e} +- {spread:.1e}"
        )
    axes[0].set_xlabel("bias current over the critical one")
    axes[0].set_ylabel("rate of escape over the plasma frequency")
    axes[0].set_ylim(1e-12, 1.0)
    axes[0].legend(frameon=False)
    axes[1].set_xlabel("bias current over the critical one")
    axes[1].set_ylabel("share of the ramps that have switched")
    path = sys.argv[1] if len(sys.argv) > 1 else "escape_of_a_junction.png"
    figure.savefig(path, dpi=150)
    print(f"wrote {path}")


if __name__ == "__main__":
    main()
