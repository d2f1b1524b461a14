"""Homoclinic orbits beside a Bogdanov-Takens point, to the next order in their size."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from phasekit.arrays import Array
from phasekit.bifurcation.continuation import normal_form as forms
from phasekit.bifurcation.continuation.curve import Curve
from phasekit.bifurcation.continuation.derivatives import Derivatives
from phasekit.bifurcation.continuation.points.bogdanov_takens import chain
from phasekit.cycles import collocation
from phasekit.cycles.cycles import Orbit

REACH, PIECES = 5.0, 40  # time to both sides of the orbit's middle, in its own unit; pieces


class SmallLoop(NamedTuple):
    """An orbit that leaves a saddle and comes back to it."""

    orbit: Orbit  # with the time and both parameters
    rest: Array  # the saddle
    held: Array  # by how much b1 of the normal form moves with the time and the parameters


class SmallLoops:
    """Homoclinic orbits of all sizes beside a Bogdanov-Takens point.

    On the center manifold ``x = x0 + w0 q0 + w1 q1 + b2 h + w0^2 h20/2 + b2 w0 g + b2^2 h2/2 +
    b1 h1 + ...``, ``w0' = w1, w1' = b1 + b2 w1 + a w0^2 + b w0 w1``, over the parameters ``p0 +
    b2 k + b2^2 k2/2 + b1 k1``. What is quadratic in w0 and b2 is as large as w1 times e, like what
    e adds to the orbit; beside a small a it is larger than w1. In the units ``w0 =
    (r^2/a) u``, time ``s = r t``, ``e = r b/a`` this is ``u'' = b1 a/r^4 + u^2 + e u' (u + tau)``
    with ``b2 = tau r^2 b/a``; at ``b1 = -4 r^4/a`` an orbit is homoclinic for ``tau = 10/7 +
    (288/2401) e^2`` ([KuznetsovEtAl2014]; `_orbit`). The vectors h, k, k1 and k2 are those with
    which b1 and b2 have the factors above, and no others are linear in them; h20, g, h2 and h1
    follow order by order.
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
        square = d.second(whole, whole)
        self.k2 = -float(square.dot(p1).value) * self.k1
        self.h2 = -forms.solve_off(A, square.value + J @ self.k2, self.q0, p1)
        self.h1 = forms.solve_off(A, self.q1 - J @ self.k1, self.q0, p1)
        self.g = -forms.solve_off(A, d.second(self.q0, whole).value, self.q0, p1)
        # Its part along q0 is that for which w1' has no term w1^2.
        bent = d.second(self.q0, self.q0).value
        self.h20 = forms.solve_off(A, 2.0 * self.a * self.q1 - bent, self.q0, p1)
        along = d.second(self.q0, self.q1).dot(p0) + 0.5 * d.second(self.q1, self.q1).dot(p1)
        self.h20 += (float(along.value) - float(p0 @ self.h20)) * self.q0
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
        u, v = _orbit(REACH * (2.0 * collocation.times(mesh, m) - 1.0), e)
        w0, w1 = r**2 / self.a * u, r**3 / self.a * v
        w0, w1 = np.append(w0, 2.0 * r**2 / self.a), np.append(w1, 0.0)  # last, the saddle
        x = np.outer(w0, self.q0 + b2 * self.g) + np.outer(w1, self.q1)
        x += np.outer(0.5 * w0**2, self.h20)
        x += self.u[: self.n] + b2 * self.h + 0.5 * b2**2 * self.h2 + b1 * self.h1
        x, rest = x[:-1], x[-1]
        by2, by1 = np.linalg.inv(np.stack([self.k, self.k1], axis=1))
        held = np.append(0.0, by1 - b2 * float(by1 @ self.k2) * by2)
        return SmallLoop(Orbit(mesh, x, np.array([2.0 * REACH / r, *p])), rest, held)


def _orbit(s: Array, e: float) -> tuple[Array, Array]:
    """The homoclinic orbit of ``u'' = -4 + u^2 + e u' (u + tau)``, and its slope, to order e^2.

    As ``u = 2 - 6 A sech^2 x``, over a time of its own with ``dx/ds = w``, both are polynomials of
    ``z = tanh x``: ``w d((z - z^3) w)/dz = -2 + 3 A (1 - z^2) + e z w (2 + tau - 6 A (1 - z^2))``,
    so that ``w = 1 - (6/7) e z + e^2 (9 + 27 z^2)/98`` and ``A = 1 + (3/49) e^2``.
    """
    x = s.copy()
    for _ in range(20):
        z = np.tanh(x)
        log = np.abs(x) + np.log1p(np.exp(-2.0 * np.abs(x))) - math.log(2.0)  # of cosh x
        time = x + 6.0 / 7.0 * e * log + e**2 * (36.0 * x - 45.0 * z) / 98.0
        x = x - (time - s) / (1.0 + 6.0 / 7.0 * e * z + e**2 * (45.0 * z**2 - 9.0) / 98.0)
    z = np.tanh(x)
    w = 1.0 - 6.0 / 7.0 * e * z + e**2 * (9.0 + 27.0 * z**2) / 98.0
    hump = (1.0 + 3.0 / 49.0 * e**2) * (1.0 - z**2)
    return 2.0 - 6.0 * hump, 12.0 * hump * z * w
