"""Normal forms at points of codimension two: exact ones in other coordinates, and 50 digits."""

from fractions import Fraction
from functools import cache
from math import factorial

import mpmath as mp
import numpy as np
import pytest

import phasekit as pk
from phasekit.bifurcation.continuation.curve import Curve
from phasekit.bifurcation.continuation.derivatives import Derivatives
from phasekit.bifurcation.continuation.kernels.defining import EQUILIBRIUM
from phasekit.bifurcation.continuation.points import (
    bogdanov_takens,
    cusp,
    generalized_hopf,
    hopf_hopf,
    of_maps,
    zero_hopf,
)
from tests.witnesses import power_series as series

NAMES = ("x", "y", "z", "u", "v")


def changed(f, seed, order, stable, discrete=False):
    """Equations f of series in other coordinates, with so many decaying states that they drive.

    Also the change of coordinates to first order.
    """
    rng = np.random.default_rng(seed)
    count = len(f)
    n = count + stable
    w = series.variables(n, order, Fraction(1))

    def random(scale):
        return Fraction(int(rng.integers(-8, 9)), scale)

    whole = [one.at(w[:count]) for one in f]
    for j in range(stable):
        # What decays feels the others, and is felt by nobody before coordinates are changed.
        drive = sum((random(8) * w[i] * w[k] for i in range(count) for k in range(count)), w[0] * 0)
        whole.append((Fraction(1, 3) if discrete else -1) * w[count + j] + drive)
    bent = []
    for i in range(n):
        terms = w[i]
        for total in (2, 3):
            every = series._powers(n, total)
            for place in rng.choice(len(every), min(3, len(every)), replace=False):
                terms = terms + w[0].of({every[place]: random(4**total)})
        bent.append(terms)
    found = series.pushed(whole, bent, discrete)
    while True:
        linear = np.array([[random(4) for _ in range(n)] for _ in range(n)])
        if abs(np.linalg.det(linear.astype(float))) > 0.5:
            break
    inverse = _inverse(linear)
    old = [sum((inverse[i][k] * w[k] for k in range(n)), w[0] * 0) for i in range(n)]
    moved = [one.at(old) for one in found]
    return [
        sum((linear[i][k] * moved[k] for k in range(n)), w[0] * 0) for i in range(n)
    ], linear.astype(float)


def _inverse(matrix):
    n = len(matrix)
    rows = [list(matrix[i]) + [Fraction(int(i == j)) for j in range(n)] for i in range(n)]
    for i in range(n):
        pivot = next(k for k in range(i, n) if rows[k][i] != 0)
        rows[i], rows[pivot] = rows[pivot], rows[i]
        rows[i] = [one / rows[i][i] for one in rows[i]]
        for k in range(n):
            if k != i:
                rows[k] = [a - rows[k][i] * b for a, b in zip(rows[k], rows[i], strict=True)]
    return [row[n:] for row in rows]


def derivatives(f, plain, discrete=False):
    """The derivatives at zero of equations that are series, as formulas or as a function."""
    n = len(f)
    names = NAMES[:n]
    if plain:
        powers = sorted({k for one in f for k in one.terms})
        exponents = np.array(powers)
        factors = np.array([[float(one.terms.get(k, 0)) for k in powers] for one in f])

        def right(x, a):
            return factors @ np.multiply.reduce(x**exponents, axis=1)

        problem = pk.Problem(right, names, {"a": 0.0}, map=discrete)
    else:
        formulas = [
            " + ".join(
                f"({v!s})*" + "*".join(f"{name}**{e}" for name, e in zip(names, k, strict=True))
                for k, v in one.terms.items()
            )
            for one in f
        ]
        problem = pk.Problem(formulas, names, {"a": 0.0}, map=discrete)
    ones, far = np.ones(n + 1), np.full(n + 1, np.inf)
    curve = Curve(
        problem.field, EQUILIBRIUM, np.zeros(1), (0,), ones, 0.0 * ones, -far, far,
        pk.ContinuationOptions(), discrete=discrete,
    )  # fmt: skip
    return Derivatives(curve, np.zeros(n + 1))


def polynomial(count, order, terms):
    w = series.variables(count, order, Fraction(1))
    total = w[0] * 0
    for power, value in terms.items():
        total = total + w[0].of({power: Fraction(value)})
    return total


def tolerance(plain, order):
    return {2: 1e-9, 3: 1e-7, 5: 1e-4}[order] if plain else 1e-11


SLOW = pytest.param(True, marks=pytest.mark.slow)
PLAIN = pytest.mark.parametrize("plain", [False, SLOW])
SEEDS = pytest.mark.parametrize("seed", [1, pytest.param(2, marks=pytest.mark.slow)])


@pytest.mark.parametrize("plain", [False, True])
@SEEDS
def test_cusps(seed, plain):
    f, change = changed([polynomial(1, 3, {(3,): Fraction(-3, 4)})], seed, 3, stable=1)
    form, words = cusp.normal_form(derivatives(f, plain))
    size = np.linalg.norm(change[:, 0])
    assert form["c"] == pytest.approx(-0.75 / size**2, rel=tolerance(plain, 3))
    assert words == ""


@PLAIN
@SEEDS
def test_bogdanov_takens_points(seed, plain):
    """w0' = w1, w1' = a w0^2 + b w0 w1 in any coordinates, w0 and w1 multiplied by one number."""
    law = [
        polynomial(2, 2, {(0, 1): 1}),
        polynomial(2, 2, {(2, 0): Fraction(2, 3), (1, 1): Fraction(-5, 4)}),
    ]
    f, change = changed(law, seed, 2, stable=2)
    form, words = bogdanov_takens.normal_form(derivatives(f, plain))
    # q0 is the image of the first unit vector, of length 1 and with its largest entry positive.
    q = change[:, 0]
    factor = np.sign(q[np.argmax(np.abs(q))]) / np.linalg.norm(q)
    assert form["a"] == pytest.approx(2 / 3 * factor, rel=tolerance(plain, 2))
    assert form["b"] == pytest.approx(-5 / 4 * factor, rel=tolerance(plain, 2))
    assert words == ""


def rotating(count, j, omega, order, radial, turning=None):
    """X' and y' of w' = (i omega + radial + i turning) w, w = x + i y; series of all variables."""
    w = series.variables(count, order, Fraction(1))
    turn = Fraction(omega) + (w[0] * 0 if turning is None else turning)
    x, y = w[j], w[j + 1]
    return [radial * x - turn * y, turn * x + radial * y]


@PLAIN
@SEEDS
def test_generalized_hopf_points(seed, plain):
    """W' = (1.3 i + (3 i/2) |w|^2 - (5/8) |w|^4) w: l2 = -5/8 over 1.3, by the unit of w."""
    w = series.variables(2, 5, Fraction(1))
    square = w[0] ** 2 + w[1] ** 2
    law = rotating(2, 0, Fraction(13, 10), 5, Fraction(-5, 8) * square**2, Fraction(3, 2) * square)
    f, change = changed(law, seed, 5, stable=1)
    form, _ = generalized_hopf.normal_form(derivatives(f, plain))
    size = np.linalg.norm(change[:, 0] - 1j * change[:, 1]) / 2.0  # of what w is multiplied by
    assert form["omega"] == pytest.approx(1.3, rel=1e-10)
    assert form["l2"] == pytest.approx(-0.625 / 1.3 / size**4, rel=tolerance(plain, 5))


@PLAIN
@SEEDS
def test_zero_hopf_points(seed, plain):
    """Xi' = b xi^2 + c |w|^2, w' = (i omega + (d + i/3) xi + e xi^2) w."""
    b, c, d, e = Fraction(3, 4), Fraction(-1, 2), Fraction(2, 5), Fraction(5, 3)
    w = series.variables(3, 3, Fraction(1))
    xi, square = w[0], w[1] ** 2 + w[2] ** 2
    pair = rotating(3, 1, Fraction(6, 5), 3, d * xi + e * xi**2, Fraction(1, 3) * xi)
    f, change = changed([b * xi**2 + c * square, *pair], seed, 3, stable=1)
    form, _ = zero_hopf.normal_form(derivatives(f, plain))
    q = change[:, 0]
    one = np.sign(q[np.argmax(np.abs(q))]) / np.linalg.norm(q)
    two = 2.0 / np.linalg.norm(change[:, 1] - 1j * change[:, 2])
    wanted = {
        "b": b * one, "c": c * two**2 / one, "d": d * one, "e": e * one**2, "theta": d / b,
        "omega": 1.2,
    }  # fmt: skip
    assert form == pytest.approx({k: float(v) for k, v in wanted.items()}, rel=tolerance(plain, 3))


@PLAIN
@SEEDS
def test_hopf_hopf_points(seed, plain):
    p11, p12, p21, p22 = Fraction(-2, 3), Fraction(1, 2), Fraction(5, 4), Fraction(-3, 7)
    w = series.variables(4, 3, Fraction(1))
    one, two = w[0] ** 2 + w[1] ** 2, w[2] ** 2 + w[3] ** 2
    law = [
        *rotating(4, 0, Fraction(14, 5), 3, p11 * one + p12 * two, one - two),
        *rotating(4, 2, Fraction(11, 10), 3, p21 * one + p22 * two, two * Fraction(1, 4)),
    ]
    f, change = changed(law, seed, 3, stable=0 if plain else 1)
    form, words = hopf_hopf.normal_form(derivatives(f, plain))
    a, b = (2.0 / np.linalg.norm(change[:, j] - 1j * change[:, j + 1]) for j in (0, 2))
    wanted = {
        "p11": p11 * a**2, "p12": p12 * b**2, "p21": p21 * a**2, "p22": p22 * b**2,
        "theta": p12 / p22, "delta": p21 / p11, "omega1": 2.8, "omega2": 1.1,
    }  # fmt: skip
    assert form == pytest.approx({k: float(v) for k, v in wanted.items()}, rel=tolerance(plain, 3))
    assert words == ""


def form_of_map(kind, law, seed, order):
    """The normal form of a map that is a law in other coordinates, and the first of these."""
    f, change = changed(law, seed, order, stable=1, discrete=True)
    (form,) = {test.form for test in of_maps.TESTS if test.kind == kind}
    return form(derivatives(f, plain=False, discrete=True))[0], change


@SEEDS
def test_flips_and_fold_flips_of_maps(seed):
    law = [polynomial(1, 5, {(1,): -1, (5,): Fraction(3, 5)})]
    form, change = form_of_map("generalized_flip", law, seed, 5)
    assert form["e"] == pytest.approx(0.6 / np.linalg.norm(change[:, 0]) ** 4, rel=1e-10)
    law = [
        polynomial(2, 2, {(1, 0): 1, (2, 0): Fraction(2, 3), (0, 2): Fraction(-1, 4)}),
        polynomial(2, 2, {(0, 1): -1, (1, 1): Fraction(5, 3)}),
    ]
    form, change = form_of_map("fold_flip", law, seed, 2)
    q = change[:, 0]
    one, two = np.sign(q[np.argmax(np.abs(q))]) / np.linalg.norm(q), np.linalg.norm(change[:, 1])
    wanted = {"a": 2 / 3 * one, "b": -0.25 / one / two**2, "e": 5 / 3 * one}
    assert form == pytest.approx(wanted, rel=1e-11)


@SEEDS
@pytest.mark.parametrize("sign", [1, -1])
def test_double_multipliers_of_maps(sign, seed):
    """w0 -> w0 + w1, w1 -> w1 + a w0^2 + b w0 w1; -w0 + w1, -w1 + c w0^3 + d w0^2 w1."""
    a, b = Fraction(2, 3), Fraction(-5, 4)
    whole = {(2, 0): a, (1, 1): b} if sign == 1 else {(3, 0): a, (2, 1): b}
    order = 1 + (sign == 1) + 2 * (sign == -1)
    law = [polynomial(2, order, {(1, 0): sign, (0, 1): 1}),
           polynomial(2, order, {(0, 1): sign, **whole})]  # fmt: skip
    form, change = form_of_map("resonance_1" if sign == 1 else "resonance_2", law, seed, order)
    q = change[:, 0]
    factor = np.sign(q[np.argmax(np.abs(q))]) / np.linalg.norm(q)
    factor = factor if sign == 1 else factor**2
    found = tuple(form.values())
    assert found == pytest.approx((float(a) * factor, float(b) * factor), rel=1e-10)


def turned(c, other, power, parts):
    """A flow z' = c z |z|^2 + other z*^power for a part of 1, then a turn by that part.

    The series of the flow are those of Lie: z + t v + t^2 (v' v)/2 + ....
    """
    w = series.variables(2, 3)
    z, bar = w[0] + 1j * w[1], w[0] - 1j * w[1]
    v = c * z * z * bar + other * bar**power

    def parted(one, k):
        return one.of({p: getattr(complex(x), k) for p, x in one.terms.items()})

    field = [parted(v, "real"), parted(v, "imag")]
    flow, term = [w[0], w[1]], list(field)
    for k in (1, 2, 3):
        flow = [a + b * (parts**-k / factorial(k)) for a, b in zip(flow, term, strict=True)]
        term = [sum((one.derivative(j) * field[j] for j in range(2)), w[0] * 0) for one in term]
    angle = 2.0 * np.pi / parts
    cos, sin = np.cos(angle), np.sin(angle)
    return [flow[0] * cos - flow[1] * sin, flow[0] * sin + flow[1] * cos]


@SEEDS
def test_third_and_quarter_turns_of_maps(seed):
    c, d = -0.7 + 0.4j, 1.1 - 0.3j
    form, _ = form_of_map("resonance_3", turned(c, d, 2, 3), seed, 3)
    assert form["a"] == pytest.approx(c.real / abs(d) ** 2, rel=1e-9)
    form, _ = form_of_map("resonance_4", turned(c, d, 3, 4), seed, 3)
    assert form == pytest.approx({"a": c.real / abs(d), "b": c.imag / abs(d)}, rel=1e-9)


@SEEDS
def test_chenciner_points_of_maps(seed):
    """Z -> (1 + i s/3 - r/2) mu z with s = |z|^2, r = s^2."""
    w = series.variables(2, 5, Fraction(1))
    s = w[0] ** 2 + w[1] ** 2
    grow, twist = 1 - s**2 * Fraction(1, 2), s * Fraction(1, 3)
    x, y = grow * w[0] - twist * w[1], grow * w[1] + twist * w[0]
    law = [Fraction(3, 5) * x - Fraction(4, 5) * y, Fraction(4, 5) * x + Fraction(3, 5) * y]
    form, change = form_of_map("chenciner", law, seed, 5)
    unit = 2.0 / np.linalg.norm(change[:, 0] - 1j * change[:, 1])
    wanted = {"e": (-0.5 + 0.5 / 9.0) * unit**4, "angle": np.arctan2(4.0, 3.0)}
    assert form == pytest.approx(wanted, rel=1e-9)


def follow(equations, states, values, free, start, spans):
    """The points of codimension two on all curves of folds and Hopf points of a branch."""
    problem = pk.Problem(equations, states, values)
    branch = pk.continuation(problem, free[0], x0=start, span=spans[0])
    found = {}
    for point in branch.special_points:
        if point.kind in ("fold", "hopf"):
            for one in point.curve(free[1], spans[1]).special_points:
                if one.normal_form:
                    place = one.kind, *(f"{one[name]:.8g}" for name in free)
                    found[place] = one
    return found


def exactly(f, point, free, values, conditions):
    """A point to 50 digits: states and parameters, on its defining equations by secants."""
    n = len(point.x)
    start = [mp.mpf(float(v)) for v in (*point.x, *(point[name] for name in free))]

    def law(u):
        given = {k: mp.mpf(v) for k, v in values.items()}
        given.update(zip(free, u[n:], strict=True))
        return lambda x: f(x, given)

    def equations(*u):
        at = law(u)
        return [*at(list(u[:n])), *conditions(at, list(u[:n]))]

    u = mp.matrix(start)
    h = mp.mpf(10) ** -30
    for _ in range(5):  # Newton's method, with differences that leave 30 digits of each step
        value = mp.matrix(equations(*u))
        matrix = mp.zeros(n + 2, n + 2)
        for j in range(n + 2):
            moved = u.copy()
            moved[j] += h
            matrix[:, j] = (mp.matrix(equations(*moved)) - value) / h
        u = u - mp.lu_solve(matrix, value)
        if mp.norm(value) < mp.mpf(10) ** -45:
            break
    return law(list(u)), list(u[:n]), list(u[n:])


def hopf_form(at, x, omega, order):
    """Coefficients of w |w|^2 and of w |w|^4."""
    matrix = series.jacobian(at, x)
    q, p, value = series.eigenvectors(matrix, 1j * omega)
    right = [q, [mp.conj(one) for one in q]]
    left = [p, [mp.conj(one) for one in p]]
    g = series.reduced(
        at, x, [value, mp.conj(value)], right, left, order,
        lambda j, k: k[j] - k[1 - j] == 1,
    )  # fmt: skip
    return value, g


CO = (
    [
        "2*q1*(1 - x - y - s)**2 - 2*q5*x**2 - q3*x*y", "q2*(1 - x - y - s) - q6*y - q3*x*y",
        "q4*((1 - x - y - s) - k*s)",
    ],
    ("x", "y", "s"),
    {"q2": 0.6, "q1": 2.5, "q3": 10.0, "q4": 0.0675, "q5": 1.0, "q6": 0.1, "k": 0.4},
    ("q2", "k"), (0.07, 0.2, 0.5), ((0.5, 2.0), (0.1, 2.0)),
)  # fmt: skip
LORENZ = (
    ["-y**2 - z**2 - a*x + a*F - g*u**2", "x*y - x*z - y + G", "x*y + x*z - z", "-d*u + g*u*x + T"],
    ("x", "y", "z", "u"), {"a": 0.25, "G": 0.25, "d": 1.04, "g": 0.987, "F": 1.762, "T": 0.04},
    ("F", "T"), (2.97, -0.039, 0.058, -0.021), ((0.0, 3.0), (-0.1, 0.1)),
)  # fmt: skip
BAZYKIN = (
    ["x - x*y/(1 + al*x) - ep*x**2", "-ga*y + x*y/(1 + al*x) - de*y**2"], ("x", "y"),
    {"de": 0.3, "al": 0.3, "ga": 1.0, "ep": 0.01}, ("de", "al"), (2.87, 1.8),
    ((0.0, 0.6), (0.001, 1.5)),
)  # fmt: skip


@cache
def points_of_lorenz():
    """Those on the curves of Lorenz' system, once for all tests."""
    return follow(*LORENZ)


@cache
def points_of_co():
    """Those on the curves of the oxidation of CO."""
    return follow(*CO)


def printed(found, kind, count, digits=1e-6, **form):
    """As many different points of a kind, one of which has these coefficients, up to both signs."""
    points = [one for place, one in found.items() if place[0] == kind]
    assert len(points) == count
    near = [
        one
        for one in points
        if all(abs(abs(one.normal_form[k]) / abs(v) - 1.0) < digits for k, v in form.items())
    ]
    assert near


@pytest.mark.slow
def test_published_values():
    """What MatCont and BifurcationKit.jl print."""
    found = points_of_co()
    printed(found, "bogdanov_takens", 2, a=-4.822563e-02, b=-1.937632e00)
    printed(found, "bogdanov_takens", 2, a=-8.378442e-02, b=-2.136280e00)
    printed(found, "cusp", 1, c=3.627844e-01, digits=2e-5)
    printed(points_of_lorenz(), "bogdanov_takens", 2, a=0.2144233509, b=0.6065145508)
    printed(follow(*BAZYKIN), "bogdanov_takens", 3, a=0.03945309, b=-0.05253878)


def co(x, p):
    z = 1 - x[0] - x[1] - x[2]
    return [
        2 * p["q1"] * z**2 - 2 * p["q5"] * x[0] ** 2 - p["q3"] * x[0] * x[1],
        p["q2"] * z - p["q6"] * x[1] - p["q3"] * x[0] * x[1],
        p["q4"] * (z - p["k"] * x[2]),
    ]


def lorenz(w, p):
    x, y, z, u = w
    return [
        -y * y - z * z - p["a"] * x + p["a"] * p["F"] - p["g"] * u * u,
        x * y - x * z - y + p["G"], x * y + x * z - z, -p["d"] * u + p["g"] * u * x + p["T"],
    ]  # fmt: skip


@pytest.mark.slow
@pytest.mark.parametrize(
    ("system", "law", "points"), [(CO, co, points_of_co), (LORENZ, lorenz, points_of_lorenz)]
)
def test_fifty_digits_of_generalized_hopf_points(system, law, points):
    """l2 at a point that is polished to 50 digits, by series that are put into one another."""
    _, _, values, free, _, _ = system
    point = next(one for one in points().values() if one.kind == "generalized_hopf")
    omega = point.normal_form["omega"]
    with mp.workdps(50):

        def conditions(at, x):
            value, g = hopf_form(at, x, omega, 3)
            return [mp.re(value), mp.re(g[0, (2, 1)])]

        at, x, _ = exactly(law, point, free, values, conditions)
        value, g = hopf_form(at, x, omega, 5)
        wanted = float(mp.re(g[0, (3, 2)]) / mp.im(value))
    assert point.normal_form["l2"] == pytest.approx(wanted, rel=1e-9)


@pytest.mark.slow
def test_fifty_digits_of_a_cusp():
    point = next(one for one in points_of_co().values() if one.kind == "cusp")
    with mp.workdps(50):

        def cubic(at, x):
            q, p, value = series.eigenvectors(series.jacobian(at, x), 0)
            q = [mp.sign(one.real) * abs(one) for one in q]
            p = [mp.sign(one.real) * abs(one) for one in p]
            return value, series.reduced(at, x, [value], [q], [p], 3, lambda j, k: True)

        def conditions(at, x):
            value, g = cubic(at, x)
            return [mp.re(value), mp.re(g[0, (2,)])]

        at, x, u = exactly(co, point, ("q2", "k"), CO[2], conditions)
        wanted = float(mp.re(cubic(at, x)[1][0, (3,)]))
    assert point.normal_form["c"] == pytest.approx(wanted, rel=1e-9)
    assert [point["q2"], point["k"]] == pytest.approx([float(v) for v in u], rel=1e-12)


@pytest.mark.slow
def test_fifty_digits_of_zero_hopf_and_hopf_hopf_points():
    _, _, values, free, _, _ = LORENZ
    found = points_of_lorenz()
    zero = next(one for one in found.values() if one.kind == "zero_hopf")
    double = next(one for one in found.values() if one.kind == "hopf_hopf")
    one, two = double.normal_form["omega1"], double.normal_form["omega2"]
    with mp.workdps(50):

        def both(at, x):
            matrix = series.jacobian(at, x)
            return [mp.re(series.eigenvectors(matrix, 1j * w)[2]) for w in (one, two)]

        at, x, _ = exactly(lorenz, double, free, values, both)
        matrix = series.jacobian(at, x)
        right, left, numbers = [], [], []
        for w in (one, two):
            q, p, value = series.eigenvectors(matrix, 1j * w)
            for bar in (lambda z: z, mp.conj):
                right.append([bar(z) for z in q])
                left.append([bar(z) for z in p])
                numbers.append(bar(value))
        g = series.reduced(
            at, x, numbers, right, left, 3,
            lambda j, k: [k[0] - k[1], k[2] - k[3]] == [[1, 0], [-1, 0], [0, 1], [0, -1]][j],
        )  # fmt: skip
        wanted = {
            "p11": g[0, (2, 1, 0, 0)], "p12": g[0, (1, 0, 1, 1)], "p21": g[2, (1, 1, 1, 0)],
            "p22": g[2, (0, 0, 2, 1)],
        }  # fmt: skip
        wanted = {k: float(mp.re(v)) for k, v in wanted.items()}

        def singular(at, x):
            matrix = series.jacobian(at, x)
            return [mp.det(matrix), mp.re(series.eigenvectors(matrix, 1j * omega)[2])]

        omega = zero.normal_form["omega"]
        at, x, _ = exactly(lorenz, zero, free, values, singular)
        matrix = series.jacobian(at, x)
        q, p, _ = series.eigenvectors(matrix, 0)
        lead = max(q, key=abs)
        turn = abs(lead) / lead
        q, p = [z * turn for z in q], [z / turn for z in p]
        w, v, value = series.eigenvectors(matrix, 1j * omega)
        g = series.reduced(
            at, x, [mp.mpf(0), value, mp.conj(value)],
            [q, w, [mp.conj(z) for z in w]], [p, v, [mp.conj(z) for z in v]], 3,
            lambda j, k: k[1] - k[2] == [0, 1, -1][j],
        )  # fmt: skip
        b, c, d = (mp.re(g[j, k]) for j, k in ((0, (2, 0, 0)), (0, (0, 1, 1)), (1, (1, 1, 0))))
    for name, value in wanted.items():
        assert double.normal_form[name] == pytest.approx(value, rel=1e-9)
    got = {k: zero.normal_form[k] for k in ("b", "c", "d")}
    assert got == pytest.approx({"b": float(b), "c": float(c), "d": float(d)}, rel=1e-8)
