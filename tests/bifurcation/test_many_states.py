"""Branches of many states: Hopf points by default, neutral saddles where they are asked for."""

import itertools
import warnings

import numpy as np
import pytest
from witnesses.variants import some

import phasekit as pk
from phasekit.bifurcation.continuation.code_fields import PythonField
from phasekit.bifurcation.continuation.kernels import defining
from phasekit.numerics import differences, marks


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


@pytest.mark.parametrize(("n", "seed"), some(itertools.product((11, 16), (1, 2, 3)), 3))
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


def bratu(n, *, jac=False):
    """Bratu's equation by differences, and how often f is called."""
    h2, calls = (n + 1.0) ** 2, [0]
    laplace = h2 * (np.diag(np.ones(n - 1), 1) + np.diag(np.ones(n - 1), -1) - 2.0 * np.eye(n))

    def f(u, lam):
        calls[0] += 1
        return laplace @ u + lam * np.exp(u)

    slopes = (lambda u, lam: laplace + np.diag(lam * np.exp(u))) if jac else None
    return pk.Problem(f, [f"u{i}" for i in range(n)], {"lam": 0.0}, slopes), calls


def test_a_point_of_many_states_takes_a_few_differences():
    n, called, folds = 40, [], []
    problem, calls = bratu(n)
    options = {"directions": "forward"}
    for most in (60, 80):
        calls[0] = 0
        branch = pk.continuation(
            problem, "lam", x0=np.zeros(n), span=(0.0, 4.0),
            options=pk.ContinuationOptions(max_points=most, **options),
        )  # fmt: skip
        called.append(calls[0])
        folds.append(branch.special("LP")[0]["lam"])
    # Matrices of single central differences are 2 (n + 1) calls each.
    assert (called[1] - called[0]) / 20 < 2 * (n + 1)
    exact = pk.continuation(bratu(n, jac=True)[0], "lam", x0=np.zeros(n), span=(0.0, 4.0),
                            options=pk.ContinuationOptions(max_points=80, **options))  # fmt: skip
    assert folds == pytest.approx([exact.special("LP")[0]["lam"]] * 2, rel=1e-10)


@pytest.mark.parametrize("sharp", [False, True])
@pytest.mark.parametrize("first", [0.3, 7.0])
def test_columns_together_miss_no_dependence_that_shows_elsewhere_only(sharp, first):
    """The last rate depends on the first state beyond 5 alone, which no place beside 0 shows."""
    n, calls = 60, [0]

    def f(x, r):
        calls[0] += 1
        y = r * x - x**3
        y[1:] += x[:-1] ** 2
        y[-1] += 0.01 * max(x[0] - 5.0, 0.0)
        return y

    field = PythonField(f, None, [f"x{i}" for i in range(n)], ["r"])
    par, out = np.array([0.5]), np.empty(n + n * (n + 1))
    x = np.linspace(-0.4, 0.4, n)
    with np.errstate(all="ignore"):
        field.first((0,), sharp=sharp)(np.append(x, 0.5), par, x, out)  # what depends is seen
        x[0] = first
        calls[0] = 0
        field.first((0,), sharp=sharp)(np.append(x, 0.5), par, x, out)
    exact = np.diag(0.5 - 3.0 * x**2) + np.diag(2.0 * x[:-1], -1)
    exact[-1, 0] = 0.01 * (first > 5.0)
    np.testing.assert_allclose(out[n:].reshape(n, n + 1)[:, :n], exact, rtol=1e-7, atol=1e-8)
    assert (calls[0] < n) == (first < 5.0)


def test_a_branch_to_the_ends_of_numbers_leaks_no_warnings():
    n = 12
    names = [f"u{i}" for i in range(n)]
    beside = [0, *names, 0]
    f = [
        f"{(n + 1) ** 2}*({beside[i]} - 2*{x} + {beside[i + 2]}) + lam*exp({x})"
        for i, x in enumerate(names)
    ]
    with warnings.catch_warnings():
        warnings.filterwarnings("error", ".* encountered in ", RuntimeWarning)
        warnings.filterwarnings("ignore", "the branch in", RuntimeWarning)
        branch = pk.continuation(
            pk.Problem(f, names, {"lam": 0.0}), "lam", x0=np.zeros(n), span=(0.0, 4.0)
        )
    assert float(branch.points.lam[-1]) < 1e-200
    assert float(branch.points.residual.max()) < 1e-3


def test_factors_nearby_know_the_sign_of_a_matrix_unless_an_eigenvalue_crosses():
    """One next to zero, in a direction that neither the tangent nor the step has a part of."""
    import scipy.sparse as sp

    from phasekit.bifurcation.continuation.large import curve
    from phasekit.numerics.factors import Bordered, Factors

    rng, n = np.random.default_rng(3), 60
    frame = np.linalg.qr(rng.normal(size=(n, n)))[0]
    slope, row = frame[:, :2] @ np.ones(2), np.append(frame[:, :2] @ np.ones(2), 1.0)
    sizes = -np.geomspace(1.0, 1e4, n)
    for end, moved in ((1.1e-5, 1e-3), (2e-5, 0.0), (-1e-5, 1e-3), (0.3, 1e-2), (-0.3, 1e-2)):
        matrices = []
        for value, part in ((1e-5, 0.0), (end, moved)):
            rates = np.append(sizes[:-1] * (1.0 + part), value)
            matrices.append((frame * rates) @ frame.T)
        near = Bordered(Factors(sp.csc_array(matrices[0])), slope, row[:n], 1.0)
        whole = [np.block([[one, slope[:, None]], [row[None]]]) for one in matrices]
        same = np.linalg.det(whole[0]) * np.linalg.det(whole[1]) > 0.0
        assert same == (end > 0.0)
        found = curve._has_sign(near, sp.csc_array(matrices[1]), slope, row)  # noqa: SLF001
        assert not found or same
        assert found or end != 1.1e-5


@pytest.mark.parametrize("free", [1, 2, 3])
@pytest.mark.parametrize("kind", ["FOLD", "HOPF", "BRANCH", "FLIP", "TORUS"])
def test_defining_systems_of_many_states_by_arrays_are_those_of_loops(kind, free):
    rng, n = np.random.default_rng(5), 9
    m, kind = n + free, getattr(defining, kind)
    size, rows, _, head, *_, g, jac = defining.places(kind, n, free)[:9]
    tensor = rng.normal(size=(n, m, m))

    def first(u, par, z, out):
        out[:n] = tensor @ u[:m] @ u[:m]
        out[n : n + n * m] = ((tensor + tensor.swapaxes(1, 2)) @ u[:m]).ravel()

    def second(u, par, z, out):
        first(u, par, z, out)
        out[n + n * m : n + 2 * n * m] = ((tensor + tensor.swapaxes(1, 2)) @ z[:m]).ravel()

    w = rng.normal(size=defining.work_size(kind, n, free))
    w[defining.SCALE * size : (defining.SCALE + 1) * size] = rng.uniform(0.1, 10.0, size)
    given = first, second, differences.DERIVED, kind, n, np.zeros(3), np.arange(free)
    found = [w.copy(), w.copy()]
    for way, work in zip((defining.evaluate, marks.mark_of(defining.evaluate).body), found,
                         strict=True):  # fmt: skip
        way(*given, work, head)
    np.testing.assert_allclose(found[0][g : g + rows], found[1][g : g + rows], rtol=1e-12)
    np.testing.assert_allclose(*(one[jac : jac + rows * size] for one in found), rtol=1e-12,
                               atol=1e-12)  # fmt: skip
