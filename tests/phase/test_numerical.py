"""The numerical path, held against closed forms that it shares no code with."""

import mpmath
import numpy as np
import pytest
import sympy as sp
from scipy.special import ellipk, ellipkm1

from phasekit.errors import (
    ConvergenceError,
    EquilibriumKind,
    Loop,
    OrbitKind,
    ParameterError,
    Topology,
)
from phasekit.phase.exact import flow as closed_flow
from phasekit.phase.exact import orbits as closed_orbits
from phasekit.phase.exact import phase_space as closed
from phasekit.phase.numerical import functions, quadrature
from phasekit.phase.numerical.collocation import follow, integrate
from phasekit.phase.numerical.differences import survey
from phasekit.phase.numerical.formula import Shape, make_formula
from phasekit.phase.numerical.systems import make_systems
from phasekit.phase.numerical.turning_points import find_end

CENTER, SADDLE, DEGENERATE = (
    EquilibriumKind.CENTER,
    EquilibriumKind.SADDLE,
    EquilibriumKind.DEGENERATE,
)
TURN = 2.0 * np.pi
DISK = make_formula("-B*cos(q) + A/2*cos(q)^2 - C*sin(q)", "q", ("A", "B", "C"), TURN, None)
DOUBLE = make_formula("x^4/4 - x^2/2", "x", (), None, None)
HARD = make_formula("x^2/2 + x^4/4", "x", (), None, None)
CUBIC = make_formula("x^2/2 - x^3/3", "x", (), None, None)
MORSE = make_formula("D*(1 - exp(-a*x))^2", "x", ("a", "D"), None, (-1.0, 30.0))


def line(expression, interval=None, names=()):
    return make_formula(expression, "x", names, None, interval)


def circle(expression, names=()):
    return make_formula(expression, "x", names, TURN, None)


def systems(n, seed=7):
    """Coefficients of the rotor's potential, with states."""
    rng = np.random.default_rng(seed)
    return (*rng.uniform(-2.0, 2.0, (3, n)), rng.uniform(-4.0, 4.0, n), rng.uniform(-2.0, 2.0, n))


# --------------------------------------------------------------------- formulas


@pytest.mark.parametrize(
    "text",
    [
        "x^3/3 - x^4/4",
        "p*x^5 - 2.5*x^2*exp(-p*x) + sqrt(1 + x^2)",
        "cos(3*x)*sin(x)^2/p - log(2 + cos(p))*x",
        "(x - p)^8 + (x - p)^6*x^3",
        "0.3333333333333333*x^2 + 0.1234567890123456*x",
    ],
)
def test_array_functions_are_the_formula_and_its_derivatives(text):
    formula = line(text, names=("p",))
    x, p = sp.symbols("x p", real=True)
    expression = sp.parse_expr(text.replace("^", "**"), local_dict={"x": x, "p": p})
    for order, function in enumerate((formula.values, formula.slopes, formula.bends)):
        exact = sp.lambdify((x, p), sp.diff(expression, x, order), modules="mpmath")
        for at in (-1.37, 0.61, 2.83):
            with mpmath.workdps(30):
                want = exact(mpmath.mpf(at), mpmath.mpf(0.77))
            assert float(function(at, 0.77)) == pytest.approx(float(want), rel=2e-14)


def test_shapes_are_told_apart():
    assert DISK.shape is Shape.FOURIER
    assert DOUBLE.shape is Shape.POLYNOMIAL
    assert MORSE.shape is Shape.GENERAL
    assert circle("cos(x + p)*cos(3*x)^3", ("p",)).shape is Shape.FOURIER
    assert circle("exp(cos(x))").shape is Shape.GENERAL
    assert circle("sin(x)/(2 + cos(x))^2").shape is Shape.GENERAL
    assert make_formula("cos(pi*y)", "y", (), 2.0, None).shape is Shape.FOURIER


def test_coefficients_of_a_fourier_sum():
    A, B, C = 1.3, 0.7, -0.4
    c0, c1, c2 = DISK.slope_coefficients((A, B, C))
    # V' = B sin q - (A/2) sin 2q - C cos q
    np.testing.assert_allclose([c0, c1, c2], [0.0, (-C - 1j * B) / 2, 1j * A / 4], atol=1e-16)


# --------------------------------------------------------------------- equilibria


def test_equilibria_of_the_rotor():
    A, B, C, *_ = systems(1500)
    got, want = functions.equilibria(DISK, A, B, C), closed.equilibria(A, B, C)
    np.testing.assert_array_equal(got.n_equilibria, want.n_equilibria)
    order = np.argsort(want.phi, axis=1)
    sort = lambda field: np.take_along_axis(field, order, axis=1)  # noqa: E731
    conditioned = 1.0 + (np.abs(A) + np.abs(B) + np.abs(C))[:, None] / np.abs(sort(want.curvature))
    error = np.abs(got.phi - sort(want.phi)) / conditioned
    assert np.nanmax(error) < 4e-15
    np.testing.assert_array_equal(got.kind, sort(want.kind))
    np.testing.assert_allclose(got.energy, sort(want.energy), rtol=1e-12, atol=2e-15)


def test_polynomials_of_known_roots():
    rng = np.random.default_rng(11)
    x = sp.Symbol("x", real=True)
    for _ in range(12):
        roots = np.sort(rng.choice(np.arange(-12, 13), size=6, replace=False)) / 4
        # Two pairs of complex roots beside the real ones.
        slope = sp.prod([x - sp.Rational(r) for r in roots]) * ((x - 1) ** 2 + 2) * (x**2 + 3)
        formula = make_formula(sp.integrate(sp.expand(slope), x), "x", (), None, None)
        got = functions.equilibria(formula)
        np.testing.assert_allclose(got.phi, roots, atol=1e-11)
        assert got.kind.tolist() == [SADDLE, CENTER] * 3


def test_fourier_sums_of_many_harmonics():
    rng = np.random.default_rng(5)
    grid = np.linspace(-np.pi, np.pi, 200_001)
    for _ in range(4):
        terms = [
            f"{a:.6f}*cos({k}*x) + {b:.6f}*sin({k}*x)"
            for k, (a, b) in enumerate(rng.normal(size=(9, 2)), start=1)
        ]
        formula = circle("+".join(terms))
        slope = formula.slopes(grid)
        cells = np.flatnonzero(slope[:-1] * slope[1:] < 0.0)
        got = functions.equilibria(formula)
        assert got.n_equilibria == cells.size
        assert np.all((got.phi >= grid[cells]) & (got.phi <= grid[cells + 1]))
        assert (got.kind == CENTER).sum() == (got.kind == SADDLE).sum()


@pytest.mark.parametrize(
    ("text", "interval"),
    [
        ("cos(10*x) + x^2/50", (-10.0, 10.0)),
        ("sin(x^2)", (0.3, 8.0)),
        ("exp(-x)*x^3", (-1.0, 20.0)),
    ],
)
def test_any_function_on_an_interval(text, interval):
    formula = line(text, interval)
    grid = np.linspace(*interval, 400_001) + 1e-7
    slope = formula.slopes(grid)
    cells = np.flatnonzero(slope[:-1] * slope[1:] < 0.0)
    got = functions.equilibria(formula)
    simple = got.phi[got.kind != DEGENERATE]
    assert simple.size == cells.size
    assert np.all((simple >= grid[cells]) & (simple <= grid[cells + 1]))


@pytest.mark.parametrize(
    ("formula", "at", "kinds"),
    [
        (line("x^4/4"), [0.0], [DEGENERATE]),
        (line("x^3/3"), [0.0], [DEGENERATE]),
        (line("(x - 2)^3*(x + 1)/7"), [-0.25, 2.0], [CENTER, DEGENERATE]),
        (line("x^4/4 - x^2/2 - 2/(3*sqrt(3))*x"), [-1 / 3**0.5, 2 / 3**0.5], [DEGENERATE, CENTER]),
        (circle("-cos(x) + cos(x)^2/2"), [0.0, np.pi], [DEGENERATE, SADDLE]),
        (circle("sin(x)^3"), [-np.pi / 2, 0.0, np.pi / 2, np.pi],
         [CENTER, DEGENERATE, SADDLE, DEGENERATE]),
        (line("exp(-x^4)", (-3.0, 2.5)), [0.0], [DEGENERATE]),
    ],
)  # fmt: skip
def test_equilibria_that_have_merged_are_one(formula, at, kinds):
    got = functions.equilibria(formula)
    np.testing.assert_allclose(got.phi, at, atol=1e-5)
    assert got.kind.tolist() == kinds
    assert np.all(got.curvature[got.kind == DEGENERATE] == 0.0)


@pytest.mark.parametrize("gap", [1e-3, 1e-6, 1e-9, 1e-11])
def test_pairs_next_to_a_fold_are_two(gap):
    """x^3/3 - gap^2 x has its equilibria at +-gap."""
    got = functions.equilibria(line("x^3/3 - s*x", names=("s",)), gap * gap)
    np.testing.assert_allclose(got.phi, [-gap, gap], rtol=1e-13)


def test_leading_coefficients_that_vanish():
    formula = line("a*x^6 + x^4/4 - b*x^2/2", names=("a", "b"))
    got = functions.equilibria(formula, [0.0, 1e-30, 0.0, np.nan], [1.0, 1.0, -1.0, 1.0])
    assert got.n_equilibria.tolist() == [3, 3, 1, -1]
    np.testing.assert_allclose(got.phi[:2], [[-1.0, 0.0, 1.0]] * 2, atol=1e-15)


def test_without_force_there_is_no_isolated_equilibrium():
    assert functions.equilibria(DISK, 0.0, 0.0, 0.0).n_equilibria == 0
    assert functions.equilibria(line("3 + 0*x")).n_equilibria == 0
    assert functions.equilibria(line("2*x")).n_equilibria == 0


@pytest.mark.parametrize(
    ("text", "interval"),
    [("1/x", (-1.0, 1.5)), ("sqrt(x)", (-1.0, 2.0)), ("tan(x)", (0.0, 3.0)), ("sin(1/x)", (-1, 1))],
)
def test_functions_that_are_not_smooth_are_refused(text, interval):
    with pytest.raises(ConvergenceError, match="not smooth"):
        functions.equilibria(line(text, interval))


# --------------------------------------------------------------------- separatrices


def test_separatrices_of_the_rotor():
    A, B, C, *_ = systems(300)
    got, want = functions.separatrices(DISK, A, B, C), closed.separatrices(A, B, C)
    np.testing.assert_array_equal(got.topology, want.topology)
    np.testing.assert_array_equal(got.figure_eight, want.figure_eight)
    order = np.argsort(want.saddle_phi, axis=1)
    for name in want._fields[2:]:
        field = getattr(want, name)
        shape = order if field.ndim == 2 else order[..., None]
        field = np.take_along_axis(field, shape, axis=1)
        np.testing.assert_allclose(getattr(got, name), field, rtol=1e-11, atol=1e-13, err_msg=name)


def test_figure_eight_of_the_double_well():
    loops = functions.separatrices(DOUBLE)
    assert loops.topology == Topology.FIGURE_EIGHT
    assert loops.loop.tolist() == [Loop.LOBES]
    np.testing.assert_allclose(loops.turning_phi, [[-(2**0.5), 2**0.5]], rtol=1e-15)
    np.testing.assert_allclose(loops.lobe_area, [[4 / 3, 4 / 3]], rtol=1e-14)


def test_loop_of_the_cubic_closes_on_one_side():
    loops = functions.separatrices(CUBIC)
    assert loops.topology == Topology.HOMOCLINIC
    assert loops.loop.tolist() == [Loop.LOBE]
    np.testing.assert_allclose(loops.turning_phi, [[-0.5, np.inf]], rtol=1e-15)
    np.testing.assert_allclose(loops.lobe_area, [[1.2, np.inf]], rtol=1e-14)


def test_saddles_of_equal_energy_are_joined():
    loops = functions.separatrices(line("x^2/2 - x^4/4"))
    assert loops.topology == Topology.HETEROCLINIC
    np.testing.assert_array_equal(loops.turning_phi, [[-np.inf, 1.0], [-1.0, np.inf]])
    np.testing.assert_allclose(loops.lobe_area[[0, 1], [1, 0]], 4 * 2**0.5 / 3, rtol=1e-14)
    cos2 = functions.separatrices(circle("-cos(2*x)"))
    np.testing.assert_allclose(cos2.lobe_area, 8.0, rtol=1e-14)


def test_pendulum_and_inverted_parabola():
    pendulum = functions.separatrices(circle("-cos(x)"))
    assert pendulum.topology == Topology.WINDING
    np.testing.assert_allclose(pendulum.winding_area, [8.0], rtol=1e-14)
    hill = functions.separatrices(line("-x^2"))
    assert hill.topology == Topology.UNBOUNDED
    assert hill.loop.tolist() == [Loop.UNBOUNDED]


def test_a_degenerate_maximum_is_a_saddle_and_an_inflection_is_none():
    assert functions.separatrices(line("-x^4/4")).saddle_exponent.tolist() == [0.0]
    assert functions.separatrices(line("x^3/3")).saddle_phi.size == 0


# --------------------------------------------------------------------- orbits


@pytest.mark.slow
def test_orbits_of_the_rotor():
    A, B, C, phi, dphi = systems(600)
    dphi[::3] = 0.0
    got, want = functions.orbits(DISK, A, B, C, phi, dphi), closed_orbits.orbits(A, B, C, phi, dphi)
    np.testing.assert_array_equal(got.orbit_kind, want.orbit_kind)
    for name, worst in (
        ("period", 5e-12),
        ("action", 5e-12),
        ("phi_min", 1e-11),
        ("phi_max", 1e-11),
    ):
        error = np.abs(getattr(got, name) / getattr(want, name) - 1.0)
        np.testing.assert_array_equal(np.isnan(getattr(got, name)), np.isnan(getattr(want, name)))
        assert np.nanmax(error) < worst
        assert np.nanquantile(error, 0.99) < 3e-13


@pytest.mark.slow
def test_orbits_by_energy_of_the_rotor():
    A, B, C, *_ = systems(200)
    points = closed.equilibria(A, B, C)
    for share in (0.02, 0.6, 0.97, 1.4, 4.0):
        energy = points.energy[:, 0] + share * (points.energy[:, 3] - points.energy[:, 0])
        want = closed_orbits.orbits_at_energy(A, B, C, energy, 0)
        got = functions.orbits_at_energy(DISK, A, B, C, energy)
        np.testing.assert_array_equal(got.orbit_kind, want.orbit_kind)
        error = np.abs(got.period / want.period - 1.0)
        assert np.quantile(error, 0.98) < 1e-12
        assert np.max(error) < 1e-10


def test_hardening_oscillator():
    amplitude = np.array([1.4613010536, 1e-8, 0.3, 20.0])
    got = functions.orbits(HARD, amplitude, 0.0)
    stiff = 1.0 + 0.5 * amplitude**2
    want = 4.0 * ellipk(-0.5 * amplitude**2 / stiff) / np.sqrt(stiff)
    np.testing.assert_allclose(got.period, want, rtol=2e-14)
    assert got.period[0] == pytest.approx(TURN / 1.6, rel=1e-10)
    np.testing.assert_allclose(got.phi_min, -amplitude, rtol=1e-15)


@pytest.mark.parametrize("side", [0, 1])
def test_double_well_next_to_its_figure_eight(side):
    """T = 2 K(m)/(a/sqrt 2) with 1 - m = b^2/a^2 and turning points b < a."""
    gap = -np.array([0.2, 0.05, 1e-4, 1e-8, 1e-12, 1e-20, 1e-30])
    got = functions.orbits_at_gap(DOUBLE, gap, saddle=0, side=side)
    root = np.sqrt(1.0 + 4.0 * gap)
    outer, inner = 1.0 + root, -4.0 * gap / (1.0 + root)
    np.testing.assert_allclose(
        got.period, 2 * ellipkm1(inner / outer) / np.sqrt(outer / 2), rtol=1e-13
    )
    near, far = np.sqrt(inner), np.sqrt(outer)
    np.testing.assert_allclose(got.phi_max if side else -got.phi_min, far, rtol=1e-14)
    np.testing.assert_allclose(got.phi_min if side else -got.phi_max, near, rtol=1e-13)


def test_double_well_above_its_figure_eight():
    gap = np.array([3.0, 0.1, 1e-4, 1e-8, 1e-12, 1e-20])
    got = functions.orbits_at_gap(DOUBLE, gap)
    # x = a cn: frequency^2 = sqrt(1 + 4 h), 1 - m = (w2 - 1)/(2 w2)
    square = np.sqrt(1.0 + 4.0 * gap)
    rest = 4.0 * gap / (1.0 + square) / (2.0 * square)
    np.testing.assert_allclose(got.period, 4 * ellipkm1(rest) / np.sqrt(square), rtol=2e-14)


def test_pendulum_on_both_sides_of_its_separatrix():
    formula = circle("-cos(x)")
    gap = np.array([1e-1, 1e-6, 1e-12, 1e-18])
    outside = functions.orbits_at_gap(formula, gap, saddle=0)
    k = 2.0 / (2.0 + gap)
    np.testing.assert_allclose(
        outside.period, 2 * np.sqrt(k) * ellipkm1(gap / (2 + gap)), rtol=2e-14
    )
    assert (outside.orbit_kind == OrbitKind.ROTATION).all()
    inside = functions.orbits_at_gap(formula, -gap, saddle=0)
    np.testing.assert_allclose(inside.period, 4 * ellipkm1(gap / 2), rtol=2e-14)


def test_morse_oscillator():
    a, D = 1.3, 2.7
    energy = D * np.array([1e-12, 1e-3, 0.3, 0.9, 0.999])
    got = functions.orbits_at_energy(MORSE, a, D, energy)
    share = energy / D
    error = got.period / (TURN / (a * np.sqrt(2 * (D - energy)))) - 1.0
    assert np.all(np.abs(error) * (1 - share) < 2e-15)  # the rounding of the energy
    action = np.sqrt(2 * D) / a * share / (1 + np.sqrt(1 - share))
    np.testing.assert_allclose(got.action, action, rtol=2e-13)
    high = functions.orbits_at_energy(MORSE, a, D, [D, 1.2 * D])
    assert (high.orbit_kind == OrbitKind.UNBOUNDED).all()
    assert np.isinf(high.period).all()


def test_cubic_outside_its_loop_is_unbounded():
    got = functions.orbits(CUBIC, [0.5, 1.5, 0.0, 1.0, -0.5], [0.0, 0.0, 1.0, 0.0, 0.0])
    assert got.orbit_kind.tolist() == [
        OrbitKind.LIBRATION,
        OrbitKind.UNBOUNDED,
        OrbitKind.UNBOUNDED,
        OrbitKind.EQUILIBRIUM,
        OrbitKind.ASYMPTOTIC,
    ]
    np.testing.assert_allclose(got.phi_max[[1, 2, 4]], [np.inf, np.inf, 1.0])
    assert got.phi_min[1] == 1.5


def test_action_is_the_integral_of_the_period():
    """dJ/dE = T/(2 pi), in each of several wells of a sum of harmonics."""
    formula = circle("-cos(x) + 0.4*sin(3*x) + 0.2*cos(4*x)")
    points = functions.equilibria(formula)
    nodes, weights = np.polynomial.legendre.leggauss(30)
    for center in np.flatnonzero(points.kind == CENTER):
        rim = min(points.energy[(center + s) % points.phi.size] for s in (-1, 1))
        low, high = points.energy[center] + np.array([0.1, 0.7]) * (rim - points.energy[center])
        ends = functions.orbits_at_energy(formula, [low, high], center=int(center)).action
        energy = 0.5 * (low + high) + 0.5 * (high - low) * nodes
        period = functions.orbits_at_energy(formula, energy, center=int(center)).period
        assert ends[1] - ends[0] == pytest.approx(
            0.5 * (high - low) * np.sum(weights * period) / TURN, rel=1e-12
        )


# --------------------------------------------------------------------- motion


def test_flow_of_the_rotor():
    A, B, C, phi, dphi = systems(200)
    t = np.array([-17.3, 0.0, 2.9, 31.1])
    columns = [x[:, None] for x in (A, B, C, phi, dphi)]
    got, want = functions.flow(DISK, *columns, t), closed_flow.flow(*columns, t)
    for mine, theirs in zip(got, want, strict=True):
        error = np.abs(mine - theirs)
        assert np.quantile(error, 0.5) < 2e-14
        assert np.quantile(error, 0.98) < 1e-12  # next to separatrices rounding grows
        assert np.max(error) < 1e-9


def test_motion_on_separatrices_of_the_rotor():
    A, B, C, *_ = systems(100)
    t = np.array([-300.0, -4.0, 0.0, 0.7, 30.0])
    want = closed_flow.separatrix_motion(A[:, None], B[:, None], C[:, None], t)
    got = functions.separatrix_motion(DISK, A[:, None], B[:, None], C[:, None], t)
    for mine, theirs in zip(got, want, strict=True):
        np.testing.assert_allclose(mine, theirs, rtol=1e-10, atol=1e-12)


def test_homoclinic_motions_in_closed_form():
    t = np.array([-90.0, -20.0, -1.3, 0.0, 0.4, 5.0, 200.0])
    x, v = functions.separatrix_motion(DOUBLE, t)
    np.testing.assert_allclose(x, 2**0.5 / np.cosh(t), rtol=1e-13)
    np.testing.assert_allclose(v, -(2**0.5) * np.tanh(t) / np.cosh(t), rtol=1e-13)
    x, v = functions.separatrix_motion(CUBIC, t[1:-1], saddle=0, side=0)
    np.testing.assert_allclose(1 - x, 1.5 / np.cosh(t[1:-1] / 2) ** 2, rtol=1e-13, atol=1e-16)
    assert np.isnan(functions.separatrix_motion(CUBIC, 0.0, saddle=0).motion_phi)
    kink = functions.separatrix_motion(line("x^2/2 - x^4/4"), t, saddle=0)
    np.testing.assert_allclose(kink.motion_phi, np.tanh(t / 2**0.5), rtol=1e-13)


def test_flow_from_a_separatrix_comes_to_rest_at_the_saddle():
    t = np.array([-60.0, -2.0, 0.0, 3.0, 60.0])
    got = functions.flow(DOUBLE, 2**0.5, 0.0, t)
    np.testing.assert_allclose(got.motion_phi, 2**0.5 / np.cosh(t), atol=1e-15)
    back = functions.flow(circle("-cos(x)"), 7.0, -2 * np.cos(3.5), t)
    np.testing.assert_allclose(
        back.motion_phi, closed_flow.flow(0.0, 1.0, 0.0, 7.0, -2 * np.cos(3.5), t).motion_phi,
        rtol=1e-14,
    )  # fmt: skip


def test_unbounded_motion():
    t = np.array([-2.0, 0.0, 0.9, 12.0])
    x, v = functions.flow(line("-x^2/2"), 1.0, 0.0, t)
    np.testing.assert_allclose([x, v], [np.cosh(t), np.sinh(t)], rtol=1e-13)
    # x'' = 2 x^3 with x = 1/(1 - t) is at infinity at t = 1, and nowhere after.
    x, v = functions.flow(line("-x^4/2"), 1.0, 1.0, [-5.0, 0.5, 0.99, 1.01])
    np.testing.assert_allclose(x[:3], [1 / 6, 2.0, 100.0], rtol=1e-11)
    assert np.isnan(x[3])


def test_collocation_solves_a_nonlinear_equation_exactly_as_known():
    """The logistic function solves y' = y (1 - y)."""
    time = np.array([3.0, -2.5, 0.0, np.nan])
    start = np.full((4, 1), 0.3)
    got = integrate(lambda rows, y: y * (1.0 - y), start, time, np.full(4, 0.1))[0][:, 0]
    np.testing.assert_allclose(got[:3], 0.3 / (0.3 + 0.7 * np.exp(-time[:3])), rtol=2e-15)
    assert np.isnan(got[3])


def test_many_times_of_few_motions_are_reached_as_each_alone():
    rng = np.random.default_rng(5)
    owner = rng.integers(0, 3, 200)
    time = rng.uniform(-4.0, 6.0, 200)
    time[[3, 70]] = 0.0, np.nan
    time[owner == 2] = -np.abs(time[owner == 2])
    start = np.array([0.3, 0.9, -0.2])[owner][:, None]
    calls = []

    def rate(rows, y):
        calls.append(y.size)
        return y * (1.0 - y)

    step = np.full(200, 0.1)
    got = follow(rate, start, owner, time, step)[0][:, 0]
    few = sum(calls)
    calls.clear()
    alone = integrate(rate, start, time, step)[0][:, 0]
    assert 4 * few < sum(calls)
    x = start[:, 0]
    # From -0.2 the function ends, backwards, never; forwards at log 6.
    wanted = x / (x + (1.0 - x) * np.exp(-time))
    assert np.isfinite(wanted).sum() == 199
    np.testing.assert_allclose(got, wanted, rtol=5e-15)
    np.testing.assert_allclose(got, alone, rtol=5e-15)


@pytest.mark.parametrize("time", [1e-15, 3e-14, 1e-9, 0.1])
def test_a_rate_that_vanishes_on_the_way_takes_no_more_steps(time):
    """Through the bottom of a well the force is all rounding."""
    calls = []

    def rate(rows, y):
        calls.append(1)
        x, v = y[..., 0], y[..., 1]
        force = 0.4 * np.sin(x) + 1.5 * np.sin(x) * np.cos(x) - 0.2 * np.cos(x)
        return np.stack([v, -force], axis=-1)

    start = np.array([[0.10533447, 1.68635812]])
    end, _ = integrate(rate, start, np.array([time]), np.array([0.065]))
    assert len(calls) < 60
    back, _ = integrate(rate, end, np.array([-time]), np.array([0.065]))
    np.testing.assert_allclose(back, start, rtol=1e-15)


def test_times_after_the_end_of_a_motion_are_not_reached():
    time = np.concatenate([np.linspace(0.0, 0.99, 30), np.linspace(1.01, 3.0, 20)])
    found, _ = follow(
        lambda rows, y: y * y, np.ones((50, 1)), np.zeros(50, dtype=int), time, np.full(50, 0.1)
    )
    found = found[:, 0]
    np.testing.assert_allclose(found[:30], 1.0 / (1.0 - time[:30]), rtol=1e-11)
    assert np.isnan(found[30:]).all()


def test_bad_formulas():
    with pytest.raises(ParameterError, match="unknown symbol k"):
        line("k*x^2")
    with pytest.raises(ParameterError, match="wants a real function"):
        line("abs(x)")
    with pytest.raises(ParameterError, match="wants a formula such as"):
        line("x^^2")


def test_arcs_are_cut_at_maxima_and_each_piece_at_the_minimum_in_it(monkeypatch):
    # V' = k (x + 2) (x + 1) x (x - 1) (x - 2)
    law = line("k*(x^6/6 - 5*x^4/4 + 2*x^2)", names=("k",))
    ground = survey(make_systems(law, (np.array([1.0, 3.0]),))[0])
    start = np.array([0.3, 0.3])
    excess = 8.0 - ground.points.energy
    kinetic = 8.0 - ground.systems.potential(start)
    left, right = (find_end(ground, start, kinetic, excess, side) for side in (-1.0, 1.0))
    low, width = start - left.offset, left.offset + right.offset
    pieces = quadrature.between(ground, low, width, excess, left, right)
    assert pieces.orbit.tolist() == [0, 0, 0, 1, 1, 1]
    for orbit, k in enumerate((1.0, 3.0)):
        powers = np.roots([k / 6.0, -1.25 * k, 2.0 * k, -8.0])  # of x^2
        (far,) = np.sqrt(powers[powers.imag == 0.0].real)
        own = pieces.orbit == orbit
        np.testing.assert_allclose(pieces.length[own], [far - 1.0, 2.0, far - 1.0], rtol=1e-12)
        np.testing.assert_allclose(pieces.cut[own], [far - 2.0, 1.0, 1.0], rtol=1e-11)
    turns = make_formula("cos(3*x)", "x", (), TURN, None)
    circle = survey(make_systems(turns, ())[0])
    round_it = quadrature.round_the_circle(circle, np.ones(circle.points.phi.shape))
    np.testing.assert_allclose(round_it.length, np.full(3, TURN / 3.0), rtol=1e-14)
    np.testing.assert_allclose(round_it.cut, np.full(3, TURN / 6.0), rtol=1e-14)
    monkeypatch.setattr(quadrature, "_ENTRIES", 1)
    again = quadrature.between(ground, low, width, excess, left, right)
    np.testing.assert_array_equal(again.cut, pieces.cut)
