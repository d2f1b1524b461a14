"""Homoclinic orbits beside a Bogdanov-Takens point, to leading order in their size."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from phasekit.bifurcation.continuation import normal_form as forms
from phasekit.bifurcation.continuation.curve import Curve
from phasekit.bifurcation.continuation.derivatives import Derivatives
from phasekit.bifurcation.continuation.points.bogdanov_takens import chain
from phasekit.cycles import collocation
from phasekit.cycles.cycles import Orbit

Array = npt.NDArray[np.float64]

REACH, PIECES = 4.0, 40  # time to both sides of the orbit's middle, in its own unit; pieces


class SmallLoop(NamedTuple):
    """An orbit that leaves a saddle and comes back to it.

    Attributes
    ----------
    orbit : Orbit
        With the time and both parameters.
    rest : ndarray
        The saddle.
    held : ndarray
        By how much b1 of the normal form moves with the time and the parameters.
    """

    orbit: Orbit
    rest: Array
    held: Array


class SmallLoops:
    """Homoclinic orbits of all sizes beside a Bogdanov-Takens point.

    On the center manifold ``x = x0 + w0 q0 + w1 q1 + b2 h + ...``, ``w0' = w1, w1' = b1 + b2 w1 +
    a w0^2 + b w0 w1``, over the parameters ``p0 + b2 k + b2^2 k2/2 + b1 k1``. In the units ``w0 =
    (r^2/a) u``, time ``s = r t``, ``e = r b/a`` this is ``u'' = b1 a/r^4 + u^2 + e u' (u + tau)``
    with ``b2 = tau r^2 b/a``; at ``b1 = -4 r^4/a`` the orbit is ``u = 2 - 6 sech^2 s - (72/7) e
    sech^2 s tanh s log cosh s`` and ``tau = 10/7 + (288/2401) e^2``, to these orders
    ([KuznetsovEtAl2014]). The vectors h, k, k1 and k2 are those with which b1 and b2 have the
    factors above, and no others are linear in them.

    Raises
    ------
    numpy.linalg.LinAlgError
        If both parameters do not unfold the point.
    """

    def __init__(self, curve: Curve, u: Array) -> None:
        self.n, self.u, self.scale = curve.n, u[: curve.m].copy(), curve.scale[: curve.n]
        d, n = Derivatives(curve, u), curve.n
        A, J = d.slopes[:, :n], d.slopes[:, n:]
        self.q0, self.q1, p0, p1 = chain(d, A)
        self.a = 0.5 * float(d.second(self.q0, self.q0).dot(p1).value)
        self.b = float(
            d.second(self.q0, self.q1).dot(p1).value + d.second(self.q0, self.q0).dot(p0).value
        )
        # Along k the equilibrium stays double to first order: p1 J k = 0, A h + J k = 0.
        push = p1 @ J
        across = push * curve.scale[n : curve.m] ** 2
        if not np.any(push):
            raise np.linalg.LinAlgError("the parameters do not move the point")
        self.k1 = across / float(push @ across)
        way = np.array([-push[1], push[0]])
        border = forms.solve_off(A, J @ way, self.q0, p1)
        column = np.concatenate([-border, way])
        zero = np.concatenate([self.q0, np.zeros(2)])
        # w0 b2: p1 B(q0, (h, k)) = 0; w1 b2: p1 B(q1, (h, k)) + p0 B(q0, (h, k)) = 1.
        matrix = np.empty((2, 2))
        for i, one in enumerate((column, zero)):
            bent = d.second(self.q0, one)
            matrix[0, i] = bent.dot(p1).value
            matrix[1, i] = d.second(self.q1, one).dot(p1).value + bent.dot(p0).value
        parts = np.linalg.solve(matrix, np.array([0.0, 1.0]))
        whole = parts[0] * column + parts[1] * zero
        self.h, self.k = whole[:n], whole[n:]
        self.k2 = -float(d.second(whole, whole).dot(p1).value) * self.k1
        if not np.isfinite([*self.k, *self.k1, *self.k2]).all():
            raise np.linalg.LinAlgError("the parameters do not unfold the point")

    @property
    def unit(self) -> float:
        """Size on scaled axes of an orbit over the square of r."""
        return 6.0 / abs(self.a) * float(np.max(np.abs(self.q0) / self.scale))

    def of_size(self, size: float, m: int) -> SmallLoop:
        """The orbit of a size on scaled axes, or one of a small e, in pieces of degree m."""
        r = math.sqrt(size) * min(self.unit**-0.5, abs(self.a / self.b))
        e = r * self.b / self.a
        b2 = (10.0 / 7.0 + 288.0 / 2401.0 * e**2) * r**2 * self.b / self.a
        b1 = -4.0 * r**4 / self.a
        p = self.u[self.n :] + b2 * self.k + 0.5 * b2**2 * self.k2 + b1 * self.k1
        mesh = np.linspace(0.0, 1.0, PIECES + 1)
        s = REACH * (2.0 * collocation.times(mesh, m) - 1.0)
        hump, slope, log = 1.0 / np.cosh(s) ** 2, np.tanh(s), np.log(np.cosh(s))
        u = 2.0 - 6.0 * hump - 72.0 / 7.0 * e * hump * slope * log
        v = 12.0 * hump * slope - 72.0 / 7.0 * e * hump * ((hump - 2.0 * slope**2) * log + slope**2)
        w0, w1 = r**2 / self.a * u, r**3 / self.a * v
        middle = self.u[: self.n] + b2 * self.h
        x = middle + np.outer(w0, self.q0) + np.outer(w1, self.q1)
        rest = middle + 2.0 * r**2 / self.a * self.q0
        by2, by1 = np.linalg.inv(np.stack([self.k, self.k1], axis=1))
        held = np.append(0.0, by1 - b2 * float(by1 @ self.k2) * by2)
        return SmallLoop(Orbit(mesh, x, np.array([2.0 * REACH / r, *p])), rest, held)
