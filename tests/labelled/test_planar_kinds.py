"""Kinds of the equilibria of random planar polynomial systems, against exact arithmetic."""

from fractions import Fraction

import numpy as np
import xarray as xr

import phasekit as pk

KIND = pk.FlowEquilibriumKind


def exact_kind(trace, product):
    """The kind by trace and determinant; None where it is on a border."""
    if product < 0:
        return KIND.SADDLE
    bend = trace**2 - 4 * product
    if trace == 0 or bend == 0:
        return None
    kinds = (
        (KIND.UNSTABLE_FOCUS, KIND.STABLE_FOCUS)
        if bend < 0
        else (KIND.UNSTABLE_NODE, KIND.STABLE_NODE)
    )
    return kinds[trace < 0]


def test_random_planar_systems_have_the_kinds_of_exact_arithmetic():
    """Both rates mix (x - a)(y - b) and (x - c)(y - d)(1 + x^2): rest at (a, d) and (c, b)."""
    values = np.random.default_rng(5).integers(-12, 13, (120, 8))
    a, b, c, d, p, q, r, s = values.T
    values = values[(a != c) & (b != d) & (p * s != q * r)]
    assert len(values) > 100
    eighths = {
        name: xr.DataArray(values[:, i] / 8.0, dims="system") for i, name in enumerate("abcdpqrs")
    }
    first, second = "(x - a)*(y - b)", "(x - c)*(y - d)*(1 + x^2)"
    ds = pk.equilibria(
        pk.Problem(
            {"x": f"p*{first} + q*{second}", "y": f"r*{first} + s*{second}"},
            parameters=eighths,
            window={"x": (-2, 2), "y": (-2, 2)},
        )
    )
    np.testing.assert_array_equal(ds.n_equilibria, 2)
    assert ds.complete.all()
    seen = set()
    for k, row in enumerate(values):
        a, b, c, d, p, q, r, s = (Fraction(int(one), 8) for one in row)
        for x, y in ((a, d), (c, b)):
            grows = 1 + x**2
            u, v = (y - b, x - a), ((y - d) * grows, (x - c) * grows)
            slopes = [[m * u[i] + n * v[i] for i in (0, 1)] for m, n in ((p, q), (r, s))]
            trace = slopes[0][0] + slopes[1][1]
            product = slopes[0][0] * slopes[1][1] - slopes[0][1] * slopes[1][0]
            off = np.abs(ds.x.values[k] - [float(x), float(y)]).max(axis=1)
            here = int(np.argmin(off))
            assert off[here] < 1e-12
            kind = exact_kind(trace, product)
            if kind is not None:
                assert KIND(int(ds.kind[k, here])) is kind
                seen.add(kind)
    assert len(seen) == 5
