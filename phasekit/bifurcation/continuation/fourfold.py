"""Orbits of four times the period beside a resonance 1:4, and where they fold.

By the normal form w' = eps w + A w |w|^2 + w*^3 ([Kuznetsov2004] 9.5.4) those of amplitude rho and
phase phi are at eps = -rho^2 (A + exp(-4 i phi)): on a circle in the plane of the parameters, whose
center is as far from the resonance as |A| of its radii. From outside it two half-lines touch it, on
which the orbits fold; around the resonance inside it there is one orbit everywhere, a saddle.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from phasekit.arrays import Array
from phasekit.bifurcation.continuation.curve import Curve

COUNT = 8  # phases at which the circle is asked for
SIZES = (0.05, 0.02, 0.1, 0.2)  # amplitudes, on scaled axes
BENT = 0.1  # part of the circle by which the places may be off it
SURE = 3.0  # times its error by which the resonance has to be inside or outside
MOST, FLAT = 30, 1e-12  # Newton steps, and the last of them on scaled axes


@dataclass(frozen=True)
class Circle:
    """Where orbits of one amplitude are, as their phase turns: an ellipse about the resonance."""

    middle: Array  # shape (2,): of the parameters, less those of the resonance
    cosine: Array
    sine: Array
    #: How far the middle is from the resonance, beside the radius: |A| of the normal form.
    size: float
    off: float  # how far places are off it, beside its radius

    def parameters_at(self, angle: float) -> Array:
        """Where orbits of a phase of a quarter of this angle are."""
        return np.asarray(self.middle + np.cos(angle) * self.cosine + np.sin(angle) * self.sine)

    @property
    def folds(self) -> tuple[float, float]:
        """The angles at which half-lines from the resonance touch it."""
        x, y = self._middle
        turn, apart = np.arctan2(y, x), np.arccos(-1.0 / self.size)
        return float(turn + apart), float(turn - apart)

    @property
    def _middle(self) -> Array:
        axes = np.stack([self.cosine, self.sine], axis=1)
        return np.asarray(np.linalg.solve(axes, self.middle))


def circle_of(places: Array) -> Circle | None:
    """The circle through places at even angles, shape (angle, 2); None if they are on a line."""
    waves = np.fft.fft(places, axis=0) / len(places)
    cosine, sine = 2.0 * waves[1].real, -2.0 * waves[1].imag
    if not abs(np.linalg.det([cosine, sine])) > 0.0:
        return None
    found = Circle(waves[0].real, cosine, sine, 0.0, 0.0)
    angles = 2.0 * np.pi * np.arange(len(places)) / len(places)
    gaps = places - [found.parameters_at(angle) for angle in angles]
    radii = np.linalg.solve(np.stack([cosine, sine], axis=1), gaps.T)
    off = float(np.max(np.abs(radii)))
    return Circle(found.middle, cosine, sine, float(np.linalg.norm(found._middle)), off)


def circle_beside(orbit_at: Callable[[float, float], Array | None]) -> tuple[Circle, float] | None:
    """The circle that tells where orbits fold, and its amplitude; None if none does.

    ``orbit_at`` gives the parameters of an orbit by amplitude and phase, less those of the
    resonance, on scaled axes.
    """
    for size in SIZES:
        circle, half = (_circle_of(orbit_at, part * size) for part in (1.0, 0.5))
        if circle is None or half is None or circle.off > BENT:
            continue
        # Other terms of the normal form move the circle, too, with the square of the amplitude.
        error = circle.off + abs(circle.size - half.size)
        if abs(circle.size - 1.0) > SURE * error:
            return circle, size
    return None


def _circle_of(orbit_at: Callable[[float, float], Array | None], size: float) -> Circle | None:
    """The circle of orbits of an amplitude."""
    places = [orbit_at(size, 0.5 * np.pi * k / COUNT) for k in range(COUNT)]
    if any(place is None for place in places):
        return None
    return circle_of(np.array(places))


class FourfoldPoints:
    """Orbits of period 4 of a map beside a resonance 1:4 of its fixed points.

    Unknowns are its four points and both parameters. What is held is the part of its first harmonic
    along the critical direction, which other terms of the normal form leave alone.
    """

    def __init__(self, curve: Curve, u: Array) -> None:
        n, self.curve, self.u = curve.n, curve, u
        scale = curve.scale[:n]
        A = curve.linear(curve.evaluate(u)[1]) * scale / scale[:, None]
        values, vectors = np.linalg.eig(A)
        self.q = vectors[:, np.argmin(np.abs(values - 1j))]
        values, vectors = np.linalg.eig(A.T)
        left = vectors[:, np.argmin(np.abs(values - 1j))]
        self.p = left / (left @ self.q)

    def orbit(self, size: float, phase: float) -> Array | None:
        """Its four points and the parameters, of an amplitude and a phase; None if none is found.

        The points are the first rows, the parameters the last one.
        """
        n, scale = self.curve.n, self.curve.scale
        turns = 1j ** np.arange(4)
        middle, par = self.u[:n], self.u[n : n + 2].copy()
        target = size * np.exp(1j * phase)
        x = middle + scale[:n] * np.real(target * turns[:, None] * self.q)
        rows = (self.p / scale[:n] / turns[:, None] / 4.0).ravel()
        for _ in range(MOST):
            J, r = np.zeros((4 * n + 2, 4 * n + 2)), np.zeros(4 * n + 2)
            for k in range(4):
                here, after = slice(k * n, (k + 1) * n), (k + 1) % 4
                f, slopes = self.curve.evaluate(np.concatenate([x[k], par]))
                r[here] = f + x[k] - x[after]
                J[here, here] = self.curve.linear(slopes)
                J[here, after * n : (after + 1) * n] -= np.eye(n)
                J[here, 4 * n :] = slopes[:, n:]
            off = rows @ (x - middle).ravel() - target
            J[-2, : 4 * n], J[-1, : 4 * n], r[-2:] = rows.real, rows.imag, (off.real, off.imag)
            if not (np.isfinite(J).all() and np.isfinite(r).all()):
                return None
            try:
                step = np.linalg.solve(J, -r)
            except np.linalg.LinAlgError:
                return None
            x, par = x + step[: 4 * n].reshape(4, n), par + step[4 * n :]
            parts = np.abs(step) / np.append(np.tile(scale[:n], 4), scale[n : n + 2])
            if not np.max(parts) < 1e3:
                return None
            if np.max(parts) < FLAT:
                return np.append(x.ravel(), par)
        return None

    def parameters_at(self, size: float, phase: float) -> Array | None:
        """Where it is, less the parameters of the resonance, on scaled axes."""
        found, n = self.orbit(size, phase), self.curve.n
        if found is None:
            return None
        return np.asarray((found[-2:] - self.u[n : n + 2]) / self.curve.scale[n : n + 2])
