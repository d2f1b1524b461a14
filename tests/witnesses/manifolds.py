"""Whether manifolds of a driven saddle meet, by integration: shares no code with the kit.

Both are followed as curves in the map from one period of the drive to the next.
"""

from __future__ import annotations

import numpy as np
from scipy.integrate import solve_ivp
from scipy.optimize import fsolve

#: Distance from the saddle's orbit at which motions start.
AWAY = 1e-4
#: Places beyond which motions are not followed.
FAR = 16.0


def meet(force, slope, ends, damping, drive, nu):
    """Whether the manifolds of ``x'' = force(x) - damping x' + drive cos(nu t)`` meet.

    Each end is a saddle, the sense of time, and the side to which its manifold leaves.
    """
    curves = [_curve(force, slope, end, damping, drive, nu) for end in ends]
    for at in [curve[0] for curve in curves]:
        curves = [np.where(np.hypot(*(c - at).T)[:, None] < 3e-3, np.nan, c) for c in curves]
    return _cross(*curves)


def _orbit(force, saddle, damping, drive, nu, n=32):
    """Fourier coefficients of the saddle's orbit, and their orders times i."""
    k, t = 1j * np.fft.fftfreq(n, 1.0 / n), np.arange(n) * 2.0 * np.pi / n
    x = np.full(n, float(saddle))
    for part in np.linspace(0.0, drive, 6)[1:]:

        def off(x, part=part):
            moved = np.fft.ifft((nu * nu * k * k + damping * nu * k) * np.fft.fft(x)).real
            return moved - force(x) - part * np.cos(t)

        x = fsolve(off, x, xtol=1e-11)
        assert np.abs(off(x)).max() < 1e-7
    return np.fft.fft(x) / n, k


def _curve(force, slope, end, damping, drive, nu):
    """States at whole periods of motions that left at all phases, in a row along the manifold."""
    saddle, sense, side = end
    modes, k = _orbit(force, saddle, damping, drive, nu)
    rate = 0.5 * (sense * np.sqrt(damping**2 + 4.0 * slope(saddle)) - damping)
    period = 2.0 * np.pi / nu
    number = 64  # of starts in a period
    waves = np.exp(np.outer(np.arange(number) * 2.0 * np.pi / number, k))
    start = np.array([(waves @ modes).real, (waves @ (nu * k * modes)).real])
    start = start + AWAY * side * np.array([[1.0], [rate]])
    turns = int(np.ceil((np.log(1.0 / AWAY) + 2.5) / abs(rate) / period)) + 2
    begun = np.arange(number) * period / number

    def go(t, y):
        x, v = y.reshape(2, -1)
        pull = np.where(np.abs(x) < FAR, force(x), 0.0)
        return np.concatenate([v, pull - damping * v + drive * np.cos(nu * (begun + t))])

    t = sense * np.arange(turns * number + 1) * period / number
    run = solve_ivp(go, (0.0, t[-1]), start.reshape(-1), t_eval=t, rtol=1e-7, atol=1e-9)
    x, v = run.y.reshape(2, number, -1)
    j = np.arange(number)
    if sense > 0:  # from the latest start on
        rows = [(j[::-1], n * number - j[::-1]) for n in range(1, turns + 1)]
    else:
        rows = [(j, n * number + j) for n in range(turns - 1)]
    at, when = (np.concatenate(part) for part in zip(*rows, strict=True))
    curve = np.stack([x[at, when], v[at, when]], axis=1)
    return np.where((np.abs(curve[:, :1]) < FAR), curve, np.nan)


def _cross(one, other):
    """Whether lines through points cross; long pieces, of which nothing is known, do not."""
    a, b = one[:-1, None], one[1:, None]
    c, d = other[None, :-1], other[None, 1:]

    def turn(p, q, r):
        return (q[..., 0] - p[..., 0]) * (r[..., 1] - p[..., 1]) - (q[..., 1] - p[..., 1]) * (
            r[..., 0] - p[..., 0]
        )

    short = (np.hypot(*np.moveaxis(b - a, -1, 0)) < 0.6) & (
        np.hypot(*np.moveaxis(d - c, -1, 0)) < 0.6
    )
    apart = (turn(a, b, c) * turn(a, b, d) < 0.0) & (turn(c, d, a) * turn(c, d, b) < 0.0)
    return bool((apart & short).any())
