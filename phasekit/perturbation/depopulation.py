"""How far a well is short of particles near its rim at low damping, by the losses of its swings.

[MelnikovMeshkov1986]: over one swing through the well the energy changes by a Gaussian step of mean
-D and variance 2 D, D the loss over kT. What comes to the rim with more energy than it has is gone.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from phasekit.arrays import Array
from phasekit.numerics.contract import contract

NODES, WEIGHTS = (np.asarray(x) for x in np.polynomial.legendre.leggauss(16))
#: Panels of a quarter turn, finer towards its end, where the logarithm is steep at low damping.
QUARTER = 0.5 * np.pi * np.append(1.0 - 0.5 ** np.arange(24), 1.0)
#: Energies over kT below the rim from which on the well is in equilibrium, and differences of two
#: rims from which on all leave over the lower one.
DEEP, FAR = 24.0, 30.0
#: Losses between which the equations are solved; below, distances count by the size of a step.
LEAST, MOST = 0.05, 200.0


def panels(edges: Array) -> tuple[Array, Array]:
    """Nodes and weights of Gauss's rule on all panels.

    >>> x, w = panels(np.array([0.0, 0.3, 1.0]))
    >>> round(float(np.sum(w * x**3)), 12)
    0.25
    """
    half = 0.5 * np.diff(edges)[:, None]
    middle = 0.5 * (edges[:-1] + edges[1:])[:, None]
    return (middle + half * NODES).reshape(-1), (half * WEIGHTS).reshape(-1)


def depopulation(D: npt.ArrayLike) -> Array:
    """The factor Y(D) of Mel'nikov and Meshkov, D the loss of a round over kT; D for D -> 0.

    ``Y = exp[(1/pi) int_0^inf ln(1 - exp(-D (s^2 + 1/4))) ds/(s^2 + 1/4)]``.
    """
    theta, weight = panels(QUARTER)
    with np.errstate(all="ignore"):
        steep = np.asarray(D, float)[..., None] / (4.0 * np.cos(theta) ** 2)
        return np.asarray(np.exp(2.0 / np.pi * contract(np.log(-np.expm1(-steep)), weight)))


def two_rims(D: npt.ArrayLike, apart: npt.ArrayLike) -> tuple[Array, Array]:
    """Factors of the escape over the lower and the higher rim of a well.

    D is the loss of half a round over kT, and the rims' energies are so far apart, in kT. Y(D) both
    where they are equal; over the lower one Y(2 D) where they are far apart.
    """
    D, apart = np.broadcast_arrays(np.asarray(D, float), np.asarray(apart, float))
    low, high = depopulation(2.0 * D), np.zeros(D.shape)
    for at in np.ndindex(D.shape):
        one, gap = float(D[at]), float(apart[at])
        if gap == 0.0:
            low[at] = high[at] = depopulation(one)
        elif np.isfinite(one) and one > 0.0:
            loss = min(max(one, LEAST), MOST)
            with np.errstate(over="ignore"):
                steps = gap * np.sqrt(max(1.0, LEAST / one))
            if 0.0 < steps < FAR:  # else there is not even memory for all energies in between
                scale = low[at] / depopulation(2.0 * loss)
                low[at], high[at] = (scale * x for x in _solved(loss, float(steps)))
    unknown = ~np.isfinite(D + apart)
    return np.where(unknown, np.nan, low), np.where(unknown, np.nan, high)


def _solved(D: float, apart: float) -> tuple[float, float]:
    """The two coupled equations of Wiener and Hopf, by Nystroem's method.

    What arrives at either rim, over its equilibrium value: 1 deep in the well.
    """
    from scipy.special import erfc

    width = np.sqrt(2.0 * D)
    depth = DEEP + D + 8.0 * width
    x, w = panels(np.linspace(-depth, 0.0, int(np.ceil(depth / (3.0 * width))) + 1))
    more = panels(np.linspace(0.0, apart, int(np.ceil(apart / (3.0 * width))) + 1))
    y, v = np.concatenate([x, more[0]]), np.concatenate([w, more[1]])

    def step(to: Array, start: Array) -> Array:
        kernel = np.exp(-((to[:, None] - start - D) ** 2) / (4.0 * D))
        return np.asarray(kernel / np.sqrt(4.0 * np.pi * D))

    def deep(to: Array) -> Array:
        return np.asarray(0.5 * erfc((to + depth - D) / (2.0 * np.sqrt(D))))

    there, back = step(y, x) * w, step(x, y) * v
    lower = np.linalg.solve(np.eye(len(x)) - back @ there, back @ deep(y) + deep(x))
    higher = there @ lower + deep(y)

    def over(rim: float, at: Array, weight: Array, value: Array) -> float:
        # Of what starts its swing at these energies, that which arrives above the rim.
        part = 0.5 * erfc((rim - at + D) / (2.0 * np.sqrt(D)))
        return float(np.sum(weight * value * np.exp(rim - at) * part))

    return over(0.0, y, v, higher), over(apart, x, w, lower)
