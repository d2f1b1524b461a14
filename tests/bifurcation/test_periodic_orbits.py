"""Parts of the collocation of periodic orbits, beside dense algebra and exact values."""

from __future__ import annotations

import mpmath as mp
import numpy as np
import pytest
from numpy.polynomial import Polynomial

import phasekit as pk
from phasekit.cycles import along, collocation, kernels
from phasekit.cycles.cycles import Cycles
from phasekit.cycles.multipliers import across, few, hidden, multipliers
from phasekit.numerics import differences


@pytest.mark.parametrize("m", [2, 4, 7])
def test_scheme_is_exact_for_polynomials(m):
    c = collocation.scheme(m)
    p = Polynomial(np.arange(1.0, m + 2.0))
    at = p(np.arange(m + 1.0) / m)
    assert np.allclose(c.value @ at, p(c.nodes), rtol=1e-12)
    assert np.allclose(c.slope @ at, p.deriv()(c.nodes), rtol=1e-11)
    assert np.isclose(c.high @ at, p.deriv(m)(0.0), rtol=1e-9)
    assert np.isclose(c.weights @ c.nodes ** (2 * m - 1), 1.0 / (2 * m), rtol=1e-13)


def test_interpolation_and_functional():
    mesh = np.array([0.0, 0.1, 0.35, 0.7, 1.0])
    at = collocation.times(mesh, 4)
    x = np.stack([at**4 - at, at**3], axis=1)
    fine = np.linspace(0.0, 1.0, 50)
    expected = np.stack([fine**4 - fine, fine**3], axis=1)
    assert np.allclose(collocation.interpolate(mesh, x, 4, fine), expected, atol=1e-14)
    row = collocation.functional(mesh, collocation.at_gauss(x, 4), 4)
    # The integral of |x|^2, which Gauss points have exactly up to degree 7; x.x has degree 8.
    exact = (1 / 9 - 2 / 6 + 1 / 3) + 1 / 7
    assert np.isclose(np.sum(row * x), exact, rtol=1e-5)


def test_derivatives_of_code_stay_within_their_work_array(monkeypatch):
    """Interpreted, an index beyond an array raises; compiled, it writes over other memory."""
    monkeypatch.setattr(along, "jet", differences._jet)

    def f(x, p, z, out):
        out[:3] = p[0] * x[1] * x[2], np.sin(x[0]) + p[1], x[0] ** 3

    c, mesh = collocation.scheme(4), np.linspace(0.0, 1.0, 3)
    x = np.random.default_rng(1).uniform(0.5, 1.5, (9, 3))
    out = np.empty((8, 18))
    along.jets.py_func(
        f, differences.SHARP, np.array([2.0, 3.0]), np.array([0, 1]), False, mesh, c.nodes,
        c.value, x, np.array([1.0, 2.0, 3.0]), np.ones(5), out,
    )  # fmt: skip
    x1, x2, x3 = collocation.at_gauss(x, 4).reshape(8, 3).T
    o, l = np.zeros(8), np.ones(8)  # noqa: E741
    rows = [[o, 2 * x3, 2 * x2, x2 * x3, o], [np.cos(x1), o, o, o, l], [3 * x1**2, o, o, o, o]]
    np.testing.assert_allclose(out[:, :3].T, [2 * x2 * x3, np.sin(x1) + 3, x1**3], rtol=1e-14)
    np.testing.assert_allclose(out[:, 3:].T, np.concatenate(rows), rtol=1e-10, atol=1e-11)


@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize("sigma", [1.0, -1.0])
def test_elimination_beside_dense_algebra(seed, sigma):
    rng = np.random.default_rng(seed)
    count, n, m, q = int(rng.integers(1, 7)), int(rng.integers(1, 4)), 3, int(rng.integers(1, 4))
    W = rng.standard_normal((count, m * n, n + q + 1))
    places = count * m + 1
    rows, rows_y = rng.standard_normal((q, places, n)), rng.standard_normal((q, q))
    right, gap = rng.standard_normal(q), rng.standard_normal(n)
    # All places and y as unknowns of one matrix.
    size = places * n + q
    A, b = np.zeros((size, size)), np.zeros(size)
    r = 0
    for j in range(count):
        for k in range(m * n):
            A[r, (j * m + 1) * n + k] = 1.0
            A[r, j * m * n : (j * m + 1) * n] -= W[j, k, :n]
            A[r, places * n :] -= W[j, k, n : n + q]
            b[r] = W[j, k, -1]
            r += 1
    for c in range(n):
        A[r, (places - 1) * n + c] += 1.0
        A[r, c] -= sigma
        b[r] = gap[c]
        r += 1
    A[r:, : places * n], A[r:, places * n :], b[r:] = rows.reshape(q, -1), rows_y, right
    expected = np.linalg.solve(A, b)
    unit = np.linalg.solve(A, np.eye(size)[-1])
    dx, dy = np.empty((2, places, n)), np.empty((2, q))
    sign = kernels.solve(W, rows, rows_y, right, gap, np.full(n, sigma), m, dx, dy)
    assert np.allclose(dx[0].ravel(), expected[:-q])
    assert np.allclose(dy[0], expected[-q:])
    assert np.allclose(dx[1].ravel(), unit[:-q])
    assert np.allclose(dy[1], unit[-q:])
    # One more interval as good as none does not change the sign of the determinant.
    if m == 3:
        more = np.zeros((1, m * n, n + q + 1))
        more[0, :, :n] = np.tile(np.eye(n), (m, 1))
        wide = np.concatenate([rows, np.zeros((q, m, n))], axis=1)
        wide[:, -1], wide[:, -1 - m] = rows[:, -1], 0.0
        dx = np.empty((2, places + m, n))
        again = kernels.solve(
            np.concatenate([W, more]), wide, rows_y, right, gap, np.full(n, sigma), m, dx, dy
        )
        assert sign == again != 0.0


def test_multipliers_of_many_scales():
    rng = np.random.default_rng(1)
    rates = np.array([3.0, 0.2, -1.0, -9.0])
    turn = [np.linalg.qr(rng.standard_normal((4, 4)))[0] for _ in range(40)]
    # A chain of changes of coordinates: the product is similar to exp(40 rates).
    G = np.array([turn[(j + 1) % 40] @ np.diag(np.exp(rates)) @ turn[j].T for j in range(40)])
    values, log = multipliers(G)
    assert np.allclose(np.log(values.real), 40 * rates, rtol=1e-12, atol=1e-12)
    assert np.all(values.imag == 0.0)
    assert np.isclose(log, 40 * rates.sum(), rtol=1e-13)


def test_multipliers_of_a_pair():
    angle = 0.3
    step = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
    values, _ = multipliers(np.array([0.9 * step] * 10))
    expected = 0.9**10 * np.exp(1j * angle * 10)
    assert np.min(np.abs(values - expected)) < 1e-14
    assert np.isclose(values[0], np.conj(values[1]))


def _matrices(kind, n, count, rng):
    """Products whose multipliers are alike, far apart, complex, or hidden by growth and decay."""
    noise = 0.05 * rng.normal(size=(count, n, n))
    if kind == "pair" and n == 2:
        angle = rng.uniform(0.0, 0.3, count)
        turn = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
        return 1.02 * np.moveaxis(turn, -1, 0) + 0.1 * noise
    rates = np.linspace(1.5, -1.0, n) if kind == "apart" else np.zeros(n)
    sides = np.where(np.arange(count) < count // 2, 1.0, -1.0) if kind == "hidden" else 1.0
    rates = rates + np.outer(sides * np.ones(count), np.array([1.0, -1.0])[:n])
    return np.exp(rates if kind in ("apart", "hidden") else 0.0 * rates)[:, :, None] * (
        np.eye(n) + noise
    )


@pytest.mark.parametrize("n", [1, 2])
def test_trace_and_determinant_give_few_multipliers(n):
    """Beside 60 digits; where errors hide what the product has, they answer nothing."""
    rng, answered = np.random.default_rng(n), {}
    for trial in range(28):
        kind = ("alike", "apart", "pair", "hidden")[trial % 4]
        G = _matrices(kind, n, int(rng.integers(4, 40)), rng)
        product, det = mp.eye(n), mp.mpf(1)
        with mp.workdps(60):
            for one in map(mp.matrix, G.tolist()):
                product = one * product
                det *= one[0, 0] if n == 1 else one[0, 0] * one[1, 1] - one[0, 1] * one[1, 0]
            exact = [product[0, 0]]
            if n == 2:
                half = (product[0, 0] + product[1, 1]) / 2
                root = mp.sqrt(mp.mpc(half**2 - det))
                largest = max(half + root, half - root, key=abs)
                exact = [largest, det / largest]
            exact = np.array([complex(one) for one in exact])
        values, log = multipliers(G)
        error, out = 10.0 ** rng.uniform(-14.0, -2.0), np.empty(5)
        known = few(G, log + error, out)
        answered[kind] = answered.get(kind, 0) + known
        if known:
            found = np.array([complex(*out[:2]), complex(*out[2:4])])[:n]
            off = np.abs(found[:, None] - exact).min(axis=0) / np.abs(exact)
            assert np.all(off < 1e-10)
            assert np.isclose(out[4], float(mp.log(abs(det))), rtol=1e-11, atol=1e-11)
            assert not hidden(G, values, error).any()
    assert answered["alike"] > 3
    assert n == 1 or answered["hidden"] < answered["alike"]


@pytest.mark.parametrize("count", [8, 9, 13])
def test_extremes_lie_anywhere_on_the_mesh(count):
    # Tops of cosines on, before and after a place that two intervals share.
    mesh = np.linspace(0.0, 1.0, count + 1)
    at = 2.0 * np.pi * collocation.times(mesh, 7)
    shifts = 2.0 * np.pi * (mesh[3] + np.linspace(-1.5, 1.5, 61) / (64.0 * count))
    low, high = collocation.extremes(np.cos(at[:, None] - shifts), 7)
    # Polynomials of degree 7 are as near as that; a parabola of three places is, too.
    assert np.max(np.abs(high - 1.0)) < 5e-8
    assert np.max(np.abs(low + 1.0)) < 5e-8


def test_the_flow_is_parted_from_what_is_across_it():
    rng = np.random.default_rng(3)
    count, n = 30, 4
    f, scale = rng.standard_normal((count, n)), 10.0 ** rng.uniform(-3, 3, n)
    after = np.roll(f, -1, axis=0)
    # Each matrix takes f to f, and a random complement to a random complement.
    basis = rng.standard_normal((count, n, n))
    basis[:, :, 0] = f
    inner = np.zeros((count, n, n))
    inner[:, 0, 0] = 1.0
    inner[:, 0, 1:] = rng.standard_normal((count, n - 1))
    inner[:, 1:, 1:] = np.eye(n - 1) + 0.3 * rng.standard_normal((count, n - 1, n - 1))
    G = np.roll(basis, -1, axis=0) @ inner @ np.linalg.inv(basis)
    assert np.allclose(np.einsum("jik,jk->ji", G, f), after)
    G *= scale[:, None] / scale
    A = np.empty((count, n - 1, n - 1))
    trivial, off = across(np.ascontiguousarray(G), f * scale, scale, A)
    assert abs(trivial - 1.0) < 1e-11
    assert off < 1e-11
    exact, found = np.eye(n - 1), np.eye(n - 1)
    for j in range(count):
        exact, found = inner[j, 1:, 1:] @ exact, A[j] @ found
    assert np.allclose(
        np.sort_complex(np.linalg.eigvals(found)), np.sort_complex(np.linalg.eigvals(exact)),
        rtol=1e-7, atol=1e-12 * np.linalg.norm(exact),
    )  # fmt: skip


@pytest.mark.parametrize("rate", [-9.0, -0.1, 3.0])
def test_errors_of_small_and_large_multipliers_are_told(monkeypatch, rate):
    """A multiplier of 1e-25, or 1e8, that is wrong in its fourth digit."""
    system = pk.Problem(
        ["x*(1 - x**2 - y**2) - y", "y*(1 - x**2 - y**2) + x", "k*z"], ("x", "y", "z"), {"k": rate}
    )
    right = pk.periodic_orbit(system, [1.0, 0.0, 0.0], 6.28)
    trace = (rate - 2.0) * 2.0 * np.pi
    assert float(right.liouville_error) < 1e-9
    assert int(right.n_unstable) == (rate > 0.0)
    own = Cycles.multipliers

    def wrong(self, W, orbit, *more):
        values, log, trivial = own(self, W, orbit, *more)
        return values, log + 1e-4, trivial

    monkeypatch.setattr(Cycles, "multipliers", wrong)
    found = pk.periodic_orbit(system, [1.0, 0.0, 0.0], 6.28)
    assert float(found.liouville_error) == pytest.approx(1e-4 / (1.0 + abs(trace)), rel=1e-3)


def test_intervals_are_divided_where_decays_need_it(monkeypatch):
    """Round a circle z decays at rates from 0 to 2 k: its multiplier is exp(-2 pi k)."""
    meshes = []

    def on_finer(self, orbit, *more, own=Cycles.on_finer):
        meshes.append(orbit.mesh)
        return own(self, orbit, *more)

    monkeypatch.setattr(Cycles, "on_finer", on_finer)
    system = pk.Problem(
        ["x*(1 - x**2 - y**2) - y", "y*(1 - x**2 - y**2) + x", "-k*(1 + x)*z"], ("x", "y", "z"),
        {"k": 4.0},
    )  # fmt: skip
    options = pk.ContinuationOptions(intervals=20)
    found = pk.periodic_orbit(system, [1.0, 0.0, 0.0], 6.28, options=options)
    assert len(meshes) == 1
    lengths = np.diff(meshes[0])
    # They are slow where x < 0, in the middle of the period.
    still = np.abs(meshes[0][:-1] + 0.5 * lengths - 0.5) < 0.15
    assert 4 <= np.sum(still) <= 8
    assert np.all(lengths[still] > 0.04)
    assert np.sum(lengths < 0.03) > 20
    exact = np.exp(-np.pi * np.array([0.0, 4.0, 8.0]))
    claimed = 3.0 * max(float(found.mesh_error), 1e-8) * (1.0 + 12.0 * np.pi)
    assert claimed < 1e-5
    assert found.multiplier.values == pytest.approx(exact, rel=claimed)
