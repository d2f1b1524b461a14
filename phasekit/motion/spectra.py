"""Spectra of motions: amplitudes and phases, densities, and harmonics of a known period."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from phasekit.arrays import Array, Complex


class Lines(NamedTuple):
    """Amplitudes and phases of cosines, ``x = sum a cos(w t + p)``, on a last axis."""

    amplitude: Array
    phase: Array


def lines_of(coefficients: Complex) -> Lines:
    """Amplitudes and phases of complex amplitudes; the first is of a constant."""
    amplitude = np.abs(coefficients)
    phase = np.where(amplitude > 0.0, np.angle(coefficients), 0.0)
    phase = np.where(np.isnan(amplitude), np.nan, phase)
    return Lines(amplitude, phase)


def amplitudes(x: Array, t: Array, window: Array) -> tuple[Array, Complex]:
    """Angular frequencies and complex amplitudes of samples at even times, on the last axis.

    A cosine of a frequency on the grid has its own amplitude and phase, whatever the window, unless
    another is as near as the window is wide.
    """
    n, step = x.shape[-1], (t[-1] - t[0]) / (t.size - 1)
    mean = x.mean(axis=-1, keepdims=True)
    found = np.fft.rfft((x - mean) * window, axis=-1) / window.sum()
    frequency = 2.0 * np.pi * np.fft.rfftfreq(n, step)
    found[..., 1:] *= 2.0
    if n % 2 == 0:
        found[..., -1] *= 0.5
    found = found * np.exp(-1j * frequency * t[0])
    found[..., 0] = mean[..., 0]
    return frequency, found


def density(x: Array, step: float, window: Array) -> tuple[Array, Array, int]:
    """Angular frequencies, the one-sided density whose integral is the variance, and the parts.

    The samples are cut into parts as long as the window, which overlap by half; the density is the
    mean over them ([Welch1967]).
    """
    size = window.size
    hop = max(size // 2, 1)
    count = 1 + (x.shape[-1] - size) // hop
    x = x - x.mean(axis=-1, keepdims=True)
    total = np.zeros((*x.shape[:-1], size // 2 + 1))
    for k in range(count):
        part = x[..., k * hop : k * hop + size]
        total += np.abs(np.fft.rfft(part * window, axis=-1)) ** 2
    scale = step / (np.pi * (window**2).sum())  # per radian; of both sides together
    total *= scale / count
    total[..., 0] *= 0.5
    if size % 2 == 0:
        total[..., -1] *= 0.5
    return np.asarray(2.0 * np.pi * np.fft.rfftfreq(size, step)), total, int(count)


def effective_parts(count: int, window: Array) -> float:
    """Number of independent parts that as many which overlap by half are worth [Welch1967]."""
    hop = max(window.size // 2, 1)
    alike = (window[:-hop] * window[hop:]).sum() / (window**2).sum() if count > 1 else 0.0
    return float(count / (1.0 + 2.0 * alike**2 * (count - 1) / count))


def harmonics(x: Array, t: Array, period: float, most: int) -> tuple[Complex, float]:
    """Complex amplitudes of the harmonics 0 to `most` of a period, and the size of the rest.

    The least squares of samples at any times: exact of a sum of these harmonics. The rest is the
    root of the mean square of what no harmonic is.
    """
    angles = 2.0 * np.pi * np.outer(t, np.arange(most + 1)) / period
    columns = np.hstack([np.cos(angles), -np.sin(angles[:, 1:])])
    solution = np.linalg.lstsq(columns, x, rcond=None)[0]
    found = solution[: most + 1].astype(complex)
    found[1:] += 1j * solution[most + 1 :]
    rest = x - columns @ solution
    return found, float(np.sqrt(np.mean(rest**2)))


def window_of(name: str, size: int) -> Array:
    """A window by its name, periodic: hann, hamming, blackman, flattop or none."""
    terms = {
        "none": (1.0,),
        "hann": (0.5, 0.5),
        "hamming": (0.54, 0.46),
        "blackman": (0.42, 0.5, 0.08),
        "flattop": (0.21557895, 0.41663158, 0.277263158, 0.083578947, 0.006947368),
    }[name]
    angle = 2.0 * np.pi * np.arange(size) / size
    return (
        np.asarray(sum((-1) ** k * a * np.cos(k * angle) for k, a in enumerate(terms)), float)
        + 0.0 * angle
    )
