"""Piecewise polynomials of degree m on a mesh, and the Gauss points at which they meet x' = T f.

Time s runs from 0 to 1 over a period. In each interval of the mesh a polynomial is given by its
values at m + 1 even places, the first and last of which it shares with its neighbours
([AscherMattheijRussell1995] chapter 5; [Doedel1991]). At the ends of intervals solutions have the
order 2m, elsewhere m + 1.
"""

from __future__ import annotations

import functools
from dataclasses import dataclass, replace

import numpy as np

from phasekit.arrays import Array
from phasekit.cycles import along

FINE = 65  # places of an interval among which extremes are looked for


@dataclass(frozen=True, eq=False)
class Scheme:
    """Collocation with m Gauss points an interval."""

    m: int  # degree
    nodes: Array  # shape (m,): Gauss points and weights on (0, 1)
    weights: Array
    #: Shape (m, m + 1): from the values at even places to those, and to derivatives, at Gauss
    #: points.
    value: Array
    slope: Array
    #: Shape (m + 1,): from the values at even places to the m-th derivative, which is constant.
    high: Array
    side: float  # sign of the determinant of the slopes by all places but the first
    places: Array  # shape (m + 1,): the even places, on [0, 1]
    #: Shape (FINE, m + 1): from the values at even places to those on a fine grid of the interval.
    fine: Array


@functools.cache
def scheme(m: int) -> Scheme:
    """The scheme of a degree."""
    nodes, weights = np.polynomial.legendre.leggauss(m)
    nodes = 0.5 * (nodes + 1.0)
    value, slope = basis(m, nodes)
    places = np.arange(m + 1.0)
    high = np.array([float(m) ** m / np.prod((p - places)[places != p]) for p in places])
    high *= float(np.prod(np.arange(1.0, m + 1.0)))
    side = float(np.sign(np.linalg.det(slope[:, 1:])))
    fine, _ = basis(m, np.linspace(0.0, 1.0, FINE))
    return Scheme(m, nodes, 0.5 * weights, value, slope, high, side, places / m, fine)


@functools.cache
def damped(m: int) -> Scheme:
    """The scheme at Radau's points, the last of which is an interval's end.

    At ends it has the order 2m - 1. What decays much faster than an interval it takes to zero,
    where Gauss points leave almost all of its size.
    """
    nodes = np.polynomial.legendre.legroots([*[0.0] * (m - 1), -1.0, 1.0])
    nodes = 0.5 * (np.sort(nodes.real) + 1.0)
    value, slope = basis(m, nodes)
    side = float(np.sign(np.linalg.det(slope[:, 1:])))
    return replace(scheme(m), nodes=nodes, value=value, slope=slope, side=side)


def basis(m: int, at: Array) -> tuple[Array, Array]:
    """Lagrange polynomials of even places on [0, 1] and their derivatives, at some places."""
    places = np.arange(m + 1.0) / m
    at = np.asarray(at, dtype=float)
    value = np.ones((len(at), m + 1))
    slope = np.zeros((len(at), m + 1))
    for k in range(m + 1):
        others = [j for j in range(m + 1) if j != k]
        for j in others:
            value[:, k] *= (at - places[j]) / (places[k] - places[j])
            part = np.ones(len(at)) / (places[k] - places[j])
            for i in others:
                if i != j:
                    part *= (at - places[i]) / (places[k] - places[i])
            slope[:, k] += part
    return value, slope


@functools.cache
def integrals(m: int) -> tuple[Array, Array]:
    """From values at Gauss points to integrals from 0 up to these, and up to the even places."""
    nodes = scheme(m).nodes
    whole = [
        np.polynomial.Polynomial.fromroots(np.delete(nodes, k))
        / np.prod(node - np.delete(nodes, k))
        for k, node in enumerate(nodes)
    ]
    found = [one.integ(lbnd=0.0) for one in whole]
    places = np.arange(m + 1.0) / m
    return (
        np.stack([one(nodes) for one in found], axis=1),
        np.stack([one(places) for one in found], axis=1),
    )


def times(mesh: Array, m: int) -> Array:
    """The times of all places of a mesh."""
    out = np.empty((len(mesh) - 1) * m + 1)
    along.times(mesh, m, out)
    return out


def pieces(x: Array, m: int) -> Array:
    """Values by interval, shape (intervals, m + 1, ...); neighbours share one."""
    count = (len(x) - 1) // m
    return np.asarray(x[np.arange(count)[:, None] * m + np.arange(m + 1)])


def gathered(parts: Array, m: int) -> Array:
    """Sums over intervals of what they say of their places: the transpose of `pieces`."""
    count = len(parts)
    out = np.zeros((count * m + 1, *parts.shape[2:]))
    out[:-1] = parts[:, :m].reshape(count * m, *parts.shape[2:])
    out[m::m] += parts[:, m]
    return out


def interpolate(mesh: Array, x: Array, m: int, at: Array) -> Array:
    """Values of a piecewise polynomial at times in [0, 1], in ascending order."""
    out = np.empty((len(at), x.shape[1]))
    along.interpolate(mesh, np.ascontiguousarray(x), scheme(m).places, at, out)
    return out


def at_gauss(x: Array, m: int, c: Scheme | None = None) -> Array:
    """Values at all Gauss points, or those of a scheme, shape (intervals, m, states)."""
    return np.asarray((scheme(m) if c is None else c).value @ pieces(x, m))


def slopes_at_gauss(mesh: Array, x: Array, m: int) -> Array:
    """Derivatives by s at all Gauss points."""
    return np.asarray((scheme(m).slope @ pieces(x, m)) / np.diff(mesh)[:, None, None])


def functional(mesh: Array, values: Array, m: int) -> Array:
    """The row r with sum(r * x) = integral of values . x ds, of values at Gauss points."""
    c = scheme(m)
    weighted = values * (np.diff(mesh)[:, None] * c.weights)[..., None]
    return gathered(c.value.T @ weighted, m)


def mean(mesh: Array, x: Array, m: int) -> Array:
    """Integral over a period."""
    c, out = scheme(m), np.empty(x.shape[1])
    along.mean(mesh, np.ascontiguousarray(x), c.weights, c.value, out)
    return out


def extremes(x: Array, m: int) -> tuple[Array, Array]:
    """Least and largest values of each column of a piecewise polynomial."""
    low, high = np.empty((2, x.shape[1]))
    along.extremes(np.ascontiguousarray(x), scheme(m).fine, m, low, high)
    return low, high


def ranges(mesh: Array, x: Array, m: int) -> list[list[float]]:
    """Least, largest and mean values of each column."""
    c, out = scheme(m), np.empty((3, x.shape[1]))
    along.fill_ranges(mesh, np.ascontiguousarray(x), c.fine, c.weights, c.value, out)
    rows: list[list[float]] = out.tolist()
    return rows


def highest(mesh: Array, x: Array, m: int, scale: Array, closure: Array) -> Array:
    """Size of the derivative of order m + 1 on each interval, on scaled axes.

    The m-th derivative is constant on intervals; its jumps, over the distances of their middles,
    are the next one, with which the error goes. ``closure`` multiplies states after a period.
    """
    out = np.empty(len(mesh) - 1)
    along.highest(mesh, x, scheme(m).high, scale, closure, out)
    return out


@functools.cache
def factor(m: int) -> float:
    """Largest of the polynomials whose error it is: x^(m+1) h^(m+1) times this is the error.

    The error of collocation at interior places is the integral of the product over Gauss points.
    """
    nodes = scheme(m).nodes
    inside = np.polynomial.Polynomial.fromroots(nodes).integ(lbnd=0.0)
    sizes = np.abs(inside(np.linspace(0.0, 1.0, 201)))
    factorial = float(np.prod(np.arange(1.0, m + 1.0)))
    return float(np.max(sizes)) / factorial


def even(mesh: Array, x: Array, m: int, scale: Array, count: int, closure: Array) -> Array:
    """A mesh of so many intervals over which the error is spread evenly."""
    new = np.empty(count + 1)
    along.even(mesh, x, scheme(m).high, scale, closure, new)
    return new
