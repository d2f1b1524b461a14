"""Branches of many states: Hopf points by default, neutral saddles where they are asked for."""

import itertools

import numpy as np
import pytest

import phasekit as pk


def blocks(n, seed):
    """A system with known eigenvalues along x = 0, in mixed coordinates.

    Pairs mu - m +- i w, simple ones mu - c, and a pair that is complex below mu = 0.1 and real
    above; each with a cubic term.
    """
    rng = np.random.default_rng(seed)
    pairs = np.sort(rng.choice(np.arange(-9, 10), 2, replace=False)) / 10 + 0.013
    turns = rng.uniform(0.5, 3.0, 2)
    simple = rng.choice(np.arange(-9, 10), 3, replace=False) / 10 + 0.037
    simple = np.concatenate([simple, -rng.uniform(-9.0, -3.0, n - 9)])
    mix = np.eye(n) + 0.3 * rng.standard_normal((n, n)) / np.sqrt(n)
    back = np.linalg.inv(mix)

    def matrix(mu):
        a = np.zeros((n, n))
        for i, (m, w) in enumerate(zip(pairs, turns, strict=True)):
            a[2 * i : 2 * i + 2, 2 * i : 2 * i + 2] = [[mu - m, -w], [w, mu - m]]
        a[4:6, 4:6] = [[2.0, 1.0], [mu - 0.1, 2.0]]
        a[range(6, n), range(6, n)] = [*(mu - simple[:3]), *(mu - simple[3:])]
        return a

    def f(x, mu):
        y = back @ x
        return mix @ (matrix(mu) @ y - y**3)

    def jac(x, mu):
        y = back @ x
        return mix @ (matrix(mu) - np.diag(3.0 * y**2)) @ back

    return f, jac, pairs, matrix


def branch(n, seed, **options):
    f, jac, pairs, matrix = blocks(n, seed)
    problem = pk.Problem(f, [f"x{i}" for i in range(n)], {"mu": -0.99}, jac)
    found = pk.continuation(
        problem, "mu", span=(-1.0, 1.0), options=pk.ContinuationOptions(**options)
    )
    return found, pairs, matrix


@pytest.mark.parametrize(("n", "seed"), list(itertools.product((11, 16), (1, 2, 3))))
def test_hopf_points_of_many_states_are_found_without_neutral_saddles(n, seed):
    found, pairs, _ = branch(n, seed)
    at = [point["mu"] for point in found.special("hopf")]
    assert len(at) == len(pairs) == 2
    assert np.allclose(np.sort(at), pairs, atol=1e-9)
    assert found.special("neutral_saddle") == ()
    assert len(found.special("BP")) == 3
    assert any("neutral_saddle" in message for message in found.messages)


def test_neutral_saddles_of_many_states_are_found_where_asked_for():
    detect = ("hopf", "neutral_saddle")
    found, pairs, matrix = branch(12, 1, detect=detect)
    saddles = [point["mu"] for point in found.special("neutral_saddle")]
    assert len(saddles) > 0
    for mu in saddles:
        values = np.linalg.eigvals(matrix(mu))
        real = values[values.imag == 0.0].real
        assert min(abs(a + b) for a, b in itertools.combinations(real, 2)) < 1e-7
    assert np.allclose(np.sort([p["mu"] for p in found.special("hopf")]), pairs, atol=1e-9)
    assert not any("neutral_saddle" in message for message in found.messages)


def test_neutral_saddles_of_few_states_come_with_hopf_points():
    problem = pk.Problem(["mu*x - x**3", "-y"], ["x", "y"], {"mu": -0.5})
    found = pk.continuation(problem, "mu", span=(-1.0, 2.0))
    assert [round(p["mu"], 9) for p in found.special("NS")] == [1.0]
    assert found.messages == ()
