"""All equilibria in a box: proved for formulas, searched and said so for code."""

import math
import warnings

import numpy as np
import pytest
import sympy as sp

import phasekit as pk


def lorenz(**parameters):
    values = {"sigma": 10.0, "rho": 28.0, "beta": 8 / 3, **parameters}
    f = ["sigma*(y - x)", "x*(rho - z) - y", "x*y - beta*z"]
    return pk.Problem(f, ["x", "y", "z"], values)


CUBE = {"x": (-50, 50), "y": (-50, 50), "z": (-50, 50)}


def test_the_three_of_lorenz():
    ds = pk.equilibria(lorenz(), box=CUBE)
    w = math.sqrt(8 / 3 * 27)
    np.testing.assert_allclose(ds.x, [[-w, -w, 27], [0, 0, 0], [w, w, 27]], rtol=1e-15, atol=1e-14)
    assert ds.complete.item()
    assert ds.n_unstable.values.tolist() == [2, 1, 2]
    assert ds.rho.item() == 28.0


def test_one_on_a_face_and_none_beyond_it():
    problem = pk.Problem(["x - 1", "y*(y - 2)"], ["x", "y"], {})
    ds = pk.equilibria(problem, box={"x": (-1, 1), "y": (0, 1)})
    np.testing.assert_array_equal(ds.x, [[1.0, 0.0]])
    assert ds.complete.item()
    assert pk.equilibria(problem, box={"x": (-1, 0.999), "y": (-1, 3)}).n_equilibria == 0


def test_an_angle_is_looked_for_in_one_turn():
    problem = pk.Problem(
        ["v", "-sin(q)"], ["q", "v"], {}, periods={"q": 2 * math.pi}, conservative=True
    )
    ds = pk.equilibria(problem, box={"v": (-1, 1)})
    assert ds.n_equilibria == 2  # the top stands on both ends of the turn, and is one
    assert ds.complete.item()


@pytest.mark.parametrize("seed", range(20))
def test_random_polynomials_against_elimination(seed):
    """The witness: a Groebner basis, whose last polynomial's roots SymPy isolates exactly."""
    rng = np.random.default_rng(seed)
    x, y = sp.symbols("x y")
    powers = [(i, j) for i in range(3) for j in range(3) if i + j <= 2]
    f = [
        sum(int(c) * x**i * y**j for c, (i, j) in zip(row, powers, strict=True))
        for row in rng.integers(-9, 10, (2, 6))
    ]
    basis = sp.groebner(f, x, y, order="lex").exprs
    assert basis[-1].free_symbols == {y}  # none of these seeds is degenerate
    expected = 0
    for root in sp.Poly(basis[-1], y).real_roots(multiple=False):
        value = root[0].evalf(40)
        rest = [sp.Poly(g.subs(y, value), x) for g in f]
        near = {round(float(sp.re(r)), 9)
                for r in (rest[0] if rest[0].degree() > 0 else rest[1]).nroots(n=30, maxsteps=200)
                if abs(sp.im(r)) < 1e-12
                and all(abs(sp.N(g.eval(r))) < 1e-9 * (1 + abs(r)) ** 4 for g in rest)
                and abs(r) < 10}  # fmt: skip
        expected += len(near) * bool(abs(value) < 10)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        ds = pk.equilibria(pk.Problem(f, ["x", "y"], {}), box={"x": (-10, 10), "y": (-10, 10)})
    if ds.complete.item():
        assert ds.n_equilibria.item() == expected
    else:
        assert ds.n_equilibria.item() <= expected
    for row in ds.x.values:
        at = dict(zip((x, y), row, strict=True))
        for g in f:
            terms = [abs(term.subs(at)) for term in sp.Add.make_args(g)]
            assert abs(g.subs(at)) <= 1e-14 * sum(terms)


@pytest.mark.parametrize("low", [1e9, -3e12, 1e14])
def test_a_box_of_few_doubles_ends(low):
    """Far from 0 a box of width 1 is not cut more often than there are doubles in it."""
    problem = pk.Problem("(x - c)**2", "x", {"c": low + 0.5})
    with pytest.warns(UserWarning, match="may be others"):
        ds = pk.equilibria(problem, box={"x": (low, low + 1.0)})
    assert not ds.complete.item()
    simple = pk.equilibria(pk.Problem("x - c", "x", {"c": low + 0.5}), box={"x": (low, low + 1.0)})
    np.testing.assert_array_equal(simple.x, [[low + 0.5]])
    assert simple.complete.item()


def test_a_double_zero_is_said_to_be_open():
    problem = pk.Problem("x**2*(x - 1)", "x", {})
    with pytest.warns(UserWarning, match=r"may be others.*multiple one.*x in \(-?\d"):
        ds = pk.equilibria(problem, box={"x": (-3, 3)})
    np.testing.assert_allclose(ds.x, [[1.0]], rtol=1e-15)
    assert not ds.complete.item()


def test_code_is_searched_and_that_is_said():
    def f(x, mu):
        return np.array([mu - x[0] ** 2, x[0] - x[1]])

    problem = pk.Problem(f, ["x", "y"], {"mu": 4.0})
    with pytest.warns(UserWarning, match="f is code, so 256 starts"):
        ds = pk.equilibria(problem, box={"x": (-5, 5), "y": (-5, 5)})
    np.testing.assert_allclose(ds.x, [[-2, -2], [2, 2]], rtol=1e-12)
    assert not ds.complete.item()


@pytest.mark.parametrize(
    ("box", "message"),
    [
        (None, r"box: got None, wants \(low, high\) of every state; 'x' has none"),
        ({"x": (0, 1), "u": (0, 1)}, "box: state 'u' is unknown"),
        ({"x": (1, 0), "y": (0, 1), "z": (0, 1)}, r"box\['x'\]: got .*, wants two finite"),
        ({"x": (0, math.inf), "y": (0, 1), "z": (0, 1)}, r"box\['x'\]: got .*, wants two finite"),
        (3, "box: got 3, wants a mapping"),
    ],
)
def test_bad_boxes(box, message):
    with pytest.raises(pk.ParameterError, match=message):
        pk.equilibria(lorenz(), box=box)


def test_a_system_takes_no_box():
    with pytest.raises(pk.ParameterError, match="box: got .*, wants None"):
        pk.equilibria(pk.Pendulum(length=1.0), box={"phi": (0, 1)})
