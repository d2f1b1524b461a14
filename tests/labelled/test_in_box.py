"""All equilibria in a box: proved for formulas, searched and said so for code."""

import math
import warnings

import numpy as np
import pytest
import sympy as sp

import phasekit as pk
from phasekit.errors import FlowEquilibriumKind as KIND


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


@pytest.mark.slow
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
    with pytest.warns(UserWarning, match=r"may be others.*a multiple equilibrium.*x in \(-?\d"):
        ds = pk.equilibria(problem, box={"x": (-3, 3)})
    np.testing.assert_allclose(ds.x, [[1.0]], rtol=1e-15)
    assert not ds.complete.item()


@pytest.mark.slow
def test_code_is_searched_and_that_is_said():
    def f(x, mu):
        return np.array([mu - x[0] ** 2, x[0] - x[1]])

    problem = pk.Problem(f, ["x", "y"], {"mu": 4.0})
    with pytest.warns(UserWarning, match="f is code, so 256 starts"):
        ds = pk.equilibria(problem, box={"x": (-5, 5), "y": (-5, 5)})
    np.testing.assert_allclose(ds.x, [[-2, -2], [2, 2]], rtol=1e-12)
    assert not ds.complete.item()


@pytest.mark.parametrize("f", [lambda x: np.maximum(x, 0.0) - 0.5, "max(x, 0) - 0.5"])
def test_no_equilibrium_is_where_f_is_flat_and_not_zero(f):
    """A step by derivatives that vanish is none, however far f is from zero."""
    with pytest.warns(UserWarning, match="256 starts of Newton's method"):
        ds = pk.equilibria(pk.Problem(f, "x"), box={"x": (-2, 2)})
    np.testing.assert_allclose(ds.x, [[0.5]], rtol=1e-15)


@pytest.mark.parametrize("width", [1e-6, 1e-9, 1e-10])
def test_a_steep_function_rests_where_it_is_zero_alone(width):
    """Dry friction holds at rest for v = 0 alone, however slowly it lets creep what is beside."""

    def f(s):
        return [s[1], -s[0] - 0.2 * math.tanh(s[1] / width)]

    steep = pk.Problem(f, ("x", "v"), window={"x": (-2, 2), "v": (-2, 2)})
    with pytest.warns(UserWarning, match="f is code, so 256 starts"):
        ds = pk.equilibria(steep)
    np.testing.assert_allclose(ds.x, [[0.0, 0.0]], atol=1e-3 * width)
    np.testing.assert_allclose(ds.eigenvalue[0, 1].real, -0.2 / width, rtol=1e-6)


def test_a_function_that_changes_within_less_than_differences_see_is_refused():
    def f(s):
        return [s[1], -s[0] - 0.2 * math.tanh(s[1] / 1e-12)]

    def slopes(s):
        return [[0.0, 1.0], [-1.0, -2e11 / math.cosh(min(abs(s[1]) / 1e-12, 300.0)) ** 2]]

    window = {"x": (-2, 2), "v": (-2, 2)}
    with pytest.raises(pk.ParameterError, match=r"changes within 4e-08 of v = 0 .* jac="):
        pk.equilibria(pk.Problem(f, ("x", "v"), window=window))
    with pytest.warns(UserWarning, match="f is code, so 256 starts"):
        ds = pk.equilibria(pk.Problem(f, ("x", "v"), jac=slopes, window=window))
    np.testing.assert_allclose(ds.x, [[0.0, 0.0]], atol=1e-15)
    np.testing.assert_allclose(ds.eigenvalue[0, 1].real, -2e11, rtol=1e-9)


#: Functions of which rounding leaves too little: zeros of the first five are one, or are none.
ROUNDED = {
    "flat": lambda s: [(1e10 + s[0] ** 3) - 1e10],
    "steps": lambda s: [(1e12 + s[0]) - 1e12],
    "cubic": lambda s: [s[0] ** 3 - 3 * s[0] ** 2 + 3 * s[0] - 1],
    "seventh": lambda s: [float(np.polyval(np.poly([1.0] * 7), s[0]))],
    "cosine": lambda s: [1 - math.cos(1e-3 * s[0])],
    "underflow": lambda s: [math.exp(-1 / s[0] ** 2) if s[0] else 0.0],
    "slope": lambda s: [(1e8 + s[0]) - 1e8],  # its zero is known, its derivative is not
    "row": lambda s: [s[0] - s[1], (1e10 + s[1] ** 3) - 1e10],
    "combined": lambda s: [s[0] - s[1], s[0] - s[1] + (1e10 + s[1] ** 3) - 1e10],
}


@pytest.mark.slow
@pytest.mark.parametrize("kind", ROUNDED)
def test_zeros_of_rounding_are_refused_as_such(kind):
    n = 2 if kind in ("row", "combined") else 1
    window = {name: (-3, 3) for name in "xy"[:n]}
    problem = pk.Problem(ROUNDED[kind], tuple("xy"[:n]), window=window)
    with pytest.raises(pk.ParameterError, match=r"values go in steps of about .* as rounding"):
        pk.equilibria(problem)


@pytest.mark.parametrize(
    ("f", "place"),
    [
        (lambda s: [(1e5 + s[0]) - 1e5, -s[1]], [0.0, 0.0]),  # what rounding leaves is enough
        (lambda s: [1 - s[0] - 1e-12 * s[1], s[1] - 1], [1.0, 1.0]),  # y hardly moves the first
        (lambda s: [s[0] - s[1], s[1] ** 2], [0.0, 0.0]),
        (lambda s: [s[1], 1e9 * (1 - math.cos(s[0]))], [0.0, 0.0]),
        (lambda s: [s[0] * 1e-300, s[1] * 1e100], [0.0, 0.0]),
        (lambda s: [s[1] - 0.3 * s[0], 0.3 * s[0] - s[1]], None),  # a line of equilibria
        (lambda s: [max(s[0] - 1, 0.0), -s[1]], None),
    ],
)
@pytest.mark.slow
def test_zeros_that_rounding_leaves_known_are_given(f, place):
    problem = pk.Problem(f, ("x", "y"), window={"x": (-3, 3), "y": (-3, 3)})
    with pytest.warns(UserWarning, match="f is code, so 256 starts"):
        ds = pk.equilibria(problem)
    if place:
        np.testing.assert_allclose(ds.x, [place], atol=6e-8)
    else:
        assert ds.sizes["equilibrium"] > 20


@pytest.mark.parametrize("time", [None, "t"])
def test_a_value_of_a_function_is_one_call_of_it(time):
    calls = []

    def f(x, mu, **more):
        calls.append(x.tolist())
        return [mu - x[0] ** 2 + more.get("t", 0.0), x[0] - x[1]]

    forced = {} if time is None else {"time": time, "period": 1.0}
    problem = pk.Problem(f, ["x", "y"], {"mu": 4.0}, **forced)
    calls.clear()
    at = {} if time is None else {time: 0.25}
    assert problem([3, 1.0], mu=5.0, **at).tolist() == [-4.0 + sum(at.values()), 2.0]
    assert calls == [[3.0, 1.0]]
    with pytest.raises(pk.ParameterError, match="^x: got"):
        problem([3.0])


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


PLANAR = {
    "center": ([[0.0, 1.0], [-4.0, 0.0]], "DEGENERATE"),  # of the linear part alone
    "saddle": ([[1.0, 2.0], [0.0, -3.0]], "SADDLE"),
    "stable node": ([[-1.0, 1.0], [0.0, -1.0]], "STABLE_NODE"),  # a double eigenvalue
    "unstable node": ([[2.0, 1.0], [0.0, 1.0]], "UNSTABLE_NODE"),
    "stable focus": ([[-0.01, 1.0], [-1.0, -0.01]], "STABLE_FOCUS"),
    "unstable focus": ([[0.3, 1.0], [-1.0, 0.3]], "UNSTABLE_FOCUS"),
}


@pytest.mark.slow
@pytest.mark.parametrize("size", [1e-9, 1.0, 1e12])
@pytest.mark.parametrize("kind", PLANAR)
def test_kinds_follow_from_the_linear_part(kind, size):
    """In any unit of time."""
    (a, b), (c, d) = np.array(PLANAR[kind][0]) * size
    formulas = [f"{a!r}*x + {b!r}*y - x**3*{size!r}", f"{c!r}*x + {d!r}*y"]
    problem = pk.Problem([f.replace("np.float64", "") for f in formulas], ["x", "y"], {})
    ds = pk.equilibria(problem, box={"x": (-0.3, 0.31), "y": (-0.3, 0.31)})
    at = int(np.argmin(np.abs(ds.x).sum("state").values))
    assert pk.FlowEquilibriumKind(ds.kind.values[at]).name == PLANAR[kind][1]


def test_cells_of_arrays_have_equilibria_of_their_own():
    fold = pk.Problem("mu - x^2", "x", {"mu": [-1.0, 0.25, 1.0, np.nan]}, window={"x": (-2, 2)})
    ds = pk.equilibria(fold)
    assert ds.n_equilibria.dims == ("mu",)
    assert ds.n_equilibria.values.tolist() == [0, 2, 2, -1]
    np.testing.assert_array_equal(ds.x[1, :, 0], [-0.5, 0.5])
    assert ds.kind.values.tolist() == [[0, 0], [5, 4], [5, 4], [0, 0]]
    assert ds.complete.values.tolist() == [True, True, True, False]
    assert ds.isel(mu=2).phasekit.system() == fold.replace(mu=1.0)


def test_fixed_points_of_maps_and_their_iterates():
    logistic = pk.Problem("r*x*(1 - x)", "x", {"r": 3.2}, map=True, window={"x": (-0.1, 1.1)})
    ds = pk.equilibria(logistic)
    np.testing.assert_allclose(ds.x[:, 0], [0.0, 1.0 - 1.0 / 3.2], atol=1e-15)
    np.testing.assert_allclose(ds.eigenvalue[:, 0], [3.2, 2.0 - 3.2], rtol=1e-12)
    assert ds.complete
    assert ds.n_unstable.values.tolist() == [1, 1]
    twice = pk.equilibria(logistic, n=2)
    root = math.sqrt((3.2 + 1.0) * (3.2 - 3.0))
    pair = [(3.2 + 1.0 - root) / 6.4, (3.2 + 1.0 + root) / 6.4]
    np.testing.assert_allclose(twice.x[:, 0], sorted([0.0, 1.0 - 1.0 / 3.2, *pair]), atol=1e-14)
    # Multiplier 4 + 2 r - r^2 of the orbit of period two.
    stable = twice.eigenvalue.values[twice.n_unstable.values == 0]
    np.testing.assert_allclose(stable.ravel(), 4.0 + 6.4 - 3.2**2, rtol=1e-9)


def test_a_forced_system_has_no_equilibria():
    forced = pk.Problem("-x + cos(t)", "x", {}, time="t", period="2*pi", window={"x": (-2, 2)})
    with pytest.raises(pk.ParameterError, match="without forcing"):
        pk.equilibria(forced)


@pytest.mark.slow
def test_many_cells_at_once_have_the_equilibria_of_a_closed_form():
    # Equilibria (0, 0), (A, 0), (1, 0) on the edge of the window, and (m, (m - A)(1 - m)) in it.
    m, A = np.linspace(0.3, 0.95, 27), np.linspace(0.02, 0.3, 19)
    prey = pk.Problem(
        {"n": "n*(n - A)*(1 - n) - n*p", "p": "p*(n - m)"},
        parameters={"m": 0.6, "A": 0.1},
        window={"n": (0.0, 1.1), "p": (0.0, 0.4)},
    )
    with pytest.warns(RuntimeWarning, match="in 1 of 513 systems"):
        found = pk.sweep(prey, m=m, A=A, of=["equilibria"])
    stable = 1 + (m[:, None] > 0.5 * (1.0 + A)).astype(int)
    np.testing.assert_array_equal(found.n_stable, stable)
    # Where m = A two of them are one, of which nothing is proved.
    double = m[:, None] == A
    assert double.sum() == 1
    np.testing.assert_array_equal(found.complete, ~double)
    np.testing.assert_array_equal(found.n_equilibria.values[~double], 4)
    x = found.x.transpose("m", "A", "equilibrium", "state").values
    live = np.argmax(np.where(np.isnan(x[..., 1]), -1.0, x[..., 1]), axis=-1)
    top = np.take_along_axis(x, live[..., None, None], axis=2)[:, :, 0]
    want = np.stack(np.broadcast_arrays(m[:, None], (m[:, None] - A) * (1.0 - m[:, None])), axis=-1)
    np.testing.assert_allclose(top[~double], want[~double], atol=1e-14)


@pytest.mark.slow
def test_a_cell_full_of_equilibria_leaves_those_of_other_cells_proved():
    # At mu = 0 all of the line x = y is at rest.
    law = pk.Problem({"x": "y - x + mu*x", "y": "x - y + mu*(y - 1)"}, parameters={"mu": 0.0})
    box = {"x": (-1.0, 1.2), "y": (-1.0, 1.3)}
    mu = np.array([-0.5, 0.0, 0.5, 1.0])
    with pytest.warns(UserWarning, match="in 1 of 4 systems"):
        found = pk.equilibria(law.replace(mu=mu), box=box)
    assert found.complete.values.tolist() == [True, False, True, True]
    for place in (0, 2, 3):
        k = mu[place]
        want = np.linalg.solve([[k - 1.0, 1.0], [1.0, k - 1.0]], [0.0, k])
        inside = bool(np.all((want >= -1.0) & (want <= [1.2, 1.3])))
        assert found.n_equilibria.values[place] == inside
        if inside:
            np.testing.assert_allclose(found.x.values[place, 0], want, atol=1e-14)


@pytest.mark.parametrize("s", [1e-9, 1.0, 1e9])
def test_kinds_do_not_hang_on_the_units_of_states(s):
    """A damped oscillator and a saddle, x in units of s."""
    cube = f"x^3/({s}^2)"
    well = pk.Problem([f"{s}*v", f"(x - {cube})/{s} - 0.01*v"], ["x", "v"], {})
    ds = pk.equilibria(well, box={"x": (-2 * s, 2 * s), "v": (-2, 2)})
    assert ds.n_unstable.values.tolist() == [0, 1, 0]
    focus, saddle = KIND.STABLE_FOCUS, KIND.SADDLE
    assert ds.kind.values.tolist() == [focus, saddle, focus]
