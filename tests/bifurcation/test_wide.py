"""Linear algebra along orbits by LAPACK and by sparse matrices is that of the kernels."""

from __future__ import annotations

import functools
from dataclasses import replace

import numpy as np
import pytest

import phasekit as pk
from phasekit.cycles import collocation, kernels, leading, multipliers, wide


@pytest.mark.parametrize("forced", [False, True], ids=["autonomous", "forced"])
@pytest.mark.parametrize(
    ("n", "m", "count", "band"),
    [(30, 4, 5, 0), (30, 4, 5, 2), (3, 3, 1, 0), (2, 4, 7, 0), (1, 5, 8, 0)],
    ids=["dense", "sparse", "few", "fewer", "one"],
)
def test_elimination(monkeypatch, forced, n, m, count, band):
    """Condensed equations, signs of determinants, residuals and solutions."""
    monkeypatch.setattr(wide, "LONG", 10)
    monkeypatch.setattr(wide, "WIDE", 1)
    rng = np.random.default_rng(1 + band)
    q = 3
    c, extra = collocation.scheme(m), q - 1 + forced
    mesh = np.sort(np.concatenate([[0.0, 1.0], rng.uniform(size=count - 1)]))
    jets = rng.normal(size=(count * m, n * (1 + n + extra)))
    if band:
        places = np.arange(n)
        slopes = jets[:, n:].reshape(count * m, n, n + extra)
        slopes[:, :, :n] *= np.abs(places[:, None] - places) < band
    x, y = rng.normal(size=(count * m + 1, n)), rng.uniform(0.5, 1.5, size=q)
    W, V = np.empty((2, count, m * n, n + q + 1))
    common = jets, forced, mesh, c.nodes, c.weights, c.value, c.slope, c.side, np.ones(n), x, y
    np.testing.assert_allclose(wide.condense(*common, V), kernels.condense(*common, W), rtol=1e-11)
    np.testing.assert_allclose(V, W, atol=1e-11 * np.max(np.abs(W)))
    rows, rows_y = rng.normal(size=(q, *x.shape)), rng.normal(size=(q, q))
    sides, gap = rng.normal(size=q), rng.normal(size=n)
    sigma = np.where(rng.uniform(size=n) < 0.5, -1.0, 1.0)
    found = []
    for solve in (wide.solve, kernels.solve):
        dx, dy = np.empty((2, *x.shape)), np.empty((2, q))
        sign = solve(W, rows, rows_y, sides, gap, sigma, m, dx, dy)
        found.append((sign, dx, dy))
    assert abs(found[0][0]) == 1.0
    assert found[0][0] == found[1][0]
    for one, other in zip(found[0][1:], found[1][1:], strict=True):
        np.testing.assert_allclose(one, other, atol=1e-9 * np.max(np.abs(other)))


@pytest.mark.slow
@pytest.mark.parametrize("time", [None, "t"], ids=["autonomous", "forced"])
def test_newton(monkeypatch, time):
    """Orbits of few states are the same with what is made for many."""
    if time is None:
        problem = pk.Problem(["y", "mu*(1 - x^2)*y - x"], ("x", "y"), {"mu": 1.0})
    else:
        problem = pk.Problem(
            ["y", "F*cos(w*t) - 0.2*y - x - x^3"], ("x", "y"), {"w": 1.2, "F": 0.3},
            time="t", period="2*pi/w",
        )  # fmt: skip
    found = []
    for most in (1, 24):
        monkeypatch.setattr(wide, "WIDE", most)
        monkeypatch.setattr(multipliers, "WIDE", most)
        orbit = pk.periodic_orbit(problem, [2.0, 0.0], settle=60.0)
        found.append((float(orbit.period), float(orbit.x_max), orbit.multiplier.values))
    for one, other in zip(*found, strict=True):
        np.testing.assert_allclose(one, other, rtol=1e-8)


def test_singular_and_undefined_equations():
    """What cannot be solved is said as the kernels do."""
    n, q, m, count = 30, 2, 4, 3
    c, mesh = collocation.scheme(m), np.linspace(0.0, 1.0, count + 1)
    x, y = np.ones((count * m + 1, n)), np.ones(q)
    jets = np.zeros((count * m, n * (2 + n)))
    W = np.empty((count, m * n, n + q + 1))
    common = c.nodes, c.weights, c.value, c.slope, c.side, np.ones(n), x, y, W
    assert wide.condense(jets, False, mesh, *common)[0] != 0.0
    zero = np.zeros((q, *x.shape))
    dx, dy = np.empty((2, *x.shape)), np.empty((2, q))
    nothing = np.zeros(q)
    sign = wide.solve(W, zero, np.zeros((q, q)), nothing, np.zeros(n), np.ones(n), m, dx, dy)
    assert sign == 0.0
    jets[3, 5] = np.nan
    assert wide.condense(jets, False, mesh, *common)[0] == 0.0


def test_multipliers_of_many_states():
    """Multipliers of a product that is known, largest first, and the size of their product."""
    rng = np.random.default_rng(3)
    n, count = 40, 10
    logs = np.linspace(0.1, -1.5, n)
    frames = [np.linalg.qr(rng.normal(size=(n, n)))[0] for _ in range(count)]
    G = np.array(
        [
            frames[(j + 1) % count] @ np.diag(np.exp(logs)) @ frames[j].T
            for j in range(count)
        ]
    )  # fmt: skip
    values, log = multipliers.multipliers(G)
    np.testing.assert_allclose(np.abs(values), np.exp(count * logs), rtol=1e-8)
    assert abs(log - count * logs.sum()) < 1e-9 * abs(log)
    broken = G.copy()
    broken[2, 0, 0] = np.nan
    assert np.isnan(multipliers.multipliers(broken)[0]).all()


def test_leading_multipliers_of_very_many_states():
    """Those of a product that is known: a multiple one, a pair, and the small ones no more."""
    rng = np.random.default_rng(4)
    n, count = 130, 12
    turn = 1.05 * np.array([[np.cos(0.4), -np.sin(0.4)], [np.sin(0.4), np.cos(0.4)]])
    whole = np.diag(np.concatenate([[-1.2, 0.7, 0.7, 0.0, 0.0], 0.5 * 0.8 ** np.arange(n - 5)]))
    whole[3:5, 3:5] = turn
    frames = [rng.normal(size=(n, n)) / np.sqrt(n) + 2.0 * np.eye(n) for _ in range(count)]
    steps = [np.eye(n)] * (count - 1) + [whole]
    G = np.array([
        frames[(j + 1) % count] @ steps[j] @ np.linalg.inv(frames[j]) for j in range(count)
    ])  # fmt: skip
    values, log = multipliers.multipliers(G)
    exact = np.array(sorted(np.linalg.eigvals(whole), key=abs, reverse=True))
    large = np.abs(exact) > leading.INSIDE
    assert 0 < np.sum(large) < large.size
    for one in exact[large]:
        assert np.min(np.abs(values - one)) < 1e-7
    np.testing.assert_allclose(np.abs(values[large]), np.abs(exact[large]), rtol=1e-7)
    assert np.all(np.abs(values[~large]) < leading.INSIDE)
    assert log == pytest.approx(np.sum(np.log(np.abs(exact))), rel=1e-7)
    assert not multipliers.hidden(G, values, 1e-12).any()
    assert leading.leading(lambda Q: np.full_like(Q, np.nan), n) is None


@pytest.mark.parametrize("n", [20, 61])
@pytest.mark.parametrize("size", [0.0, 0.9])
def test_solutions_and_signs_of_matrices_that_are_only_applied(n, size):
    """Few or all eigenvalues are away from 1, as of fast decays or of waves."""
    from phasekit.cycles.sparse import solved

    for seed in range(6):
        rng = np.random.default_rng(seed)
        matrix = np.eye(n) + size * rng.normal(size=(n, n)) / np.sqrt(n)
        matrix += rng.normal(size=(n, 3)) @ rng.normal(size=(3, n)) / np.sqrt(n)
        sides = rng.normal(size=(n, 3))
        found, sign = solved(lambda z, matrix=matrix: matrix @ z, sides)
        np.testing.assert_allclose(matrix @ found, sides[:, :2], atol=1e-8)
        assert sign == np.linalg.slogdet(matrix)[0]


def test_spaces_that_no_memory_holds_are_refused(monkeypatch):
    """Of solutions, and of matrices that would be formed, before they are."""
    from phasekit.cycles.sparse import solved

    n, asked = 400, []
    turn = np.exp(1j * np.linspace(0.0, 6.0, n // 2))

    def times(z):
        asked.append(z.shape[1])
        u = turn[:, None] * (z[::2] + 1j * z[1::2])
        return np.stack([u.real, u.imag], axis=1).reshape(z.shape)

    monkeypatch.setattr("phasekit.numerics.memory.available_memory", lambda: 10**6)
    monkeypatch.setattr("phasekit.numerics.memory.ALWAYS", 0)
    sides = np.random.default_rng(2).normal(size=(n, 3))
    with pytest.raises(pk.ParameterError, match="state: got 400, .* columns of all of them"):
        solved(times, sides)
    assert 5 < len(asked) < 40
    del asked[:]
    ways = leading.Carried(times, times, times)
    monkeypatch.setattr(leading, "PASSES", 1)
    with pytest.raises(pk.ParameterError, match="400 columns of all of them"):
        leading.carried_multipliers(ways, np.ones(n), n)
    assert max(asked) < n // 2


def test_sparse_equations_are_those_of_full_matrices():
    """What is applied and never formed: solutions, signs, and products of all intervals."""
    import scipy.sparse as sp

    from phasekit.cycles.sparse import Condensed, Slopes

    rng = np.random.default_rng(5)
    n, q, m, count = 30, 2, 3, 4
    c, mesh = collocation.scheme(m), np.sort([0.0, 0.2, 0.45, 0.8, 1.0])
    jets = rng.normal(size=(count * m, n * (2 + n)))
    slopes = jets[:, n:].reshape(count * m, n, n + 1)
    slopes[:, :, :n] *= np.abs(np.subtract.outer(np.arange(n), np.arange(n))) < 2
    few = Slopes(jets[:, :n], [sp.csc_array(one[:, :n]) for one in slopes], slopes[:, :, n:])
    x, y, scale = rng.normal(size=(count * m + 1, n)), np.array([0.7, 0.3]), np.ones(n)
    common = False, mesh, c.nodes, c.weights, c.value, c.slope, c.side, scale, x, y
    W, V = np.empty((count, m * n, n + q + 1)), Condensed()
    # The full divergence may be that of the discrete equations.
    assert wide.condense(few, *common, V)[:3] == pytest.approx(wide.condense(jets, *common, W)[:3])
    product = np.linalg.multi_dot(W[::-1, (m - 1) * n :, :n])
    columns = rng.normal(size=(n, 5))
    np.testing.assert_allclose(V.carried(columns), product @ columns, atol=1e-11)
    np.testing.assert_allclose(V.carried_back(columns), product.T @ columns, atol=1e-11)
    rows, rows_y = rng.normal(size=(q, *x.shape)), rng.normal(size=(q, q))
    right, gap = rng.normal(size=q), rng.normal(size=n)
    found = []
    for one in (W, V):
        dx, dy = np.empty((2, *x.shape)), np.empty((2, q))
        sign = wide.solve(one, rows, rows_y, right, gap, np.ones(n), m, dx, dy)
        found.append((sign, dx, dy))
    assert found[0][0] == found[1][0] != 0.0
    for one, other in zip(found[0][1:], found[1][1:], strict=True):
        np.testing.assert_allclose(one, other, atol=1e-8 * np.max(np.abs(one)))


def ways_of(known, stiff, error, growth=0.0, n=60):
    """One matrix by two schemes, off by ``error``; only its own leaves stiff decays, and growth."""
    rng = np.random.default_rng(8)
    frame = rng.normal(size=(n, n)) / np.sqrt(n) + 2.0 * np.eye(n)
    rows, k = np.linalg.inv(frame), len(known)
    own, damped = np.zeros((n, n)), np.zeros((n, n))
    own[:k, :k] = damped[:k, :k] = known
    own[k:, k:], own[-1, -1] = stiff * np.eye(n - k), growth
    damped[:k] += error * rng.normal(size=(k, n))
    own, damped = frame @ own @ rows, frame @ damped @ rows
    ways = leading.Carried(lambda z: damped @ z, lambda z: damped.T @ z, lambda z: own @ z)
    return ways, frame[:, 0]


def test_multipliers_of_a_scheme_that_damps_are_those_of_the_other_one():
    """To the square of how far both are apart; the orbit's own by itself, at folds as well."""
    for slope in (0.9, 1.0):  # of a fold another one is 1, and not a vector of its own
        known = np.diag([1.0, slope, -0.8, 0.3, 0.3, 0.02])
        known[0, 1], known[3:5, 3:5] = 1.0, [[0.3, -0.4], [0.4, 0.3]]
        exact = sorted(np.linalg.eigvals(known), key=abs, reverse=True)
        for error in (1e-4, 1e-6):
            ways, flow = ways_of(known, -0.97, error)
            values, trivial = leading.carried_multipliers(ways, flow, len(flow))
            assert values[:6] == pytest.approx(exact, abs=1e3 * error**2 + 1e-12)
            assert trivial < 1e3 * error**2 + 1e-12
            assert not values[6:].any()
            apart = np.abs(leading.leading(ways.damped, len(flow))[:6] - exact)
            assert np.max(apart) > 0.1 * error


def test_growth_that_a_scheme_damps_hides_multipliers():
    """A direction that grows faster than intervals resolve, which passes for a decay in one."""
    known = np.diag([1.0, 0.5, -0.3])
    for growth in (-0.99, 1.001, 1.3, -40.0, 1e30):
        ways, flow = ways_of(known, 0.9, 1e-6, growth)
        values, _ = leading.carried_multipliers(ways, flow, len(flow))
        assert np.isfinite(values).all() == (abs(growth) < 1.0)
    for growth in (0.99, 1.002):  # among decays of all rates, which nearly keep their sizes
        own = np.append(known.diagonal(), np.append(1.0 - np.geomspace(1e-4, 0.9, 60), growth))
        damped = np.where(np.arange(len(own)) < 3, own, 0.0)[:, None]
        ways = leading.Carried(damped.__mul__, damped.__mul__, own[:, None].__mul__)
        values, _ = leading.carried_multipliers(ways, np.eye(len(own))[0], len(own))
        assert np.isfinite(values).all() == (growth < 1.0)
    own, damped = np.diag([1.0, 2.0, *8 * [0.0]]), np.diag([1.0, 1.7, *8 * [0.0]])
    ways = leading.Carried(lambda z: damped @ z, lambda z: damped.T @ z, lambda z: own @ z)
    values, _ = leading.carried_multipliers(ways, np.eye(10)[0], 10)
    assert np.isnan(values[-1])
    assert values[0] == pytest.approx(1.0)


@pytest.mark.parametrize("forced", [False, True], ids=["autonomous", "forced"])
def test_fast_decays_of_named_states_are_multipliers_of_no_size(forced):
    """Gauss points leave almost all of the size of what decays in no time."""
    if forced:
        rates = {"u": "v", "v": "-u - 0.1*v + F*cos(w*t)"}
        given = {"parameters": {"F": 0.1, "w": 0.5}, "time": "t", "period": "2*pi/w"}
        period, known = 4.0 * np.pi, np.roots([1.0, 0.1, 1.0])
    else:
        rates = {"u": "u*(1 - u^2 - v^2) - v", "v": "v*(1 - u^2 - v^2) + u"}
        given, period, known = {"parameters": {"a": 0.0}}, 2.0 * np.pi, np.array([0.0, -2.0])
    rates |= {f"w{k}": f"-{k + 1}e5*(w{k} - u)" for k in range(24)}
    turn = np.linspace(0.0, 2.0 * np.pi, 33)[:, None]
    samples = np.hstack([np.cos(turn), np.sin(turn), np.cos(turn) * np.ones(24)])
    orbit = pk.periodic_orbit(pk.Problem(rates, **given), samples, period=period)
    exact = np.exp(period * known)
    found = orbit.multiplier.values
    for one in exact[np.abs(exact) > leading.INSIDE]:
        assert np.min(np.abs(found[:2] - one)) < 1e-7
    assert not found[2:].any()
    assert int(orbit.n_unstable) == 0


def test_growth_on_a_part_of_an_orbit_is_seen_whatever_decays_on_others():
    """It multiplies by 1.001 there; what decays ten times slower elsewhere takes more away."""
    import scipy.sparse as sp

    step = sp.csc_array(np.diag([*np.full(29, -1e4), 1e5]))
    slower = sp.csc_array(np.diag([*np.full(29, -1e4), -1e4]))
    lengths = np.array([0.5, 0.5])
    assert leading.some_grow([slower, step], lengths)
    assert not leading.some_grow([slower, slower], lengths)
    ways, flow = ways_of(np.diag([1.0, 0.5, -0.3]), 0.9, 1e-6)
    hidden = replace(ways, grows=functools.partial(leading.some_grow, [slower, step], lengths))
    for one in (ways, hidden):
        values, _ = leading.carried_multipliers(one, flow, len(flow))
        assert np.isnan(values).all() == (one is hidden)


def test_fast_rates_are_known_to_decay_where_their_numerical_range_says_so():
    """Diffusion, across fields too; neither growth nor waves, nor what may grow for a while."""
    import scipy.sparse as sp

    n, lengths = 40, np.array([0.5])
    along = 1e4 * sp.diags_array(
        [np.ones(n - 1), -2.0 * np.ones(n), np.ones(n - 1)], offsets=[-1, 0, 1]
    )
    first, scale = sp.eye_array(n, k=1) - sp.eye_array(n, k=-1), np.geomspace(1.0, 1e6, 2 * n)

    def decays(one, other, local):
        whole = sp.block_array([[one, other], [-other, one]]) + local * sp.eye_array(2 * n)
        whole = sp.csc_array(sp.diags_array(scale) @ whole @ sp.diags_array(1.0 / scale))
        rates = np.linalg.eigvals(whole.toarray())
        slow = rates[np.abs(rates) > 20.0].real > -1.0
        found = leading.fast_ones_decay([whole], lengths, scale)
        assert not (found and slow.any())
        return found

    assert decays(along, 0.5 * along, 4.0)
    assert decays(along, 0.0 * along, -100.0)
    assert not decays(along, 0.0 * along, 1e6)
    assert not decays(0.0 * along, along, 0.1)
    assert not decays(along, 1e5 * first, 1.0)
