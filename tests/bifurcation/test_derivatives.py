"""Derivatives of functions that are given as code: what is claimed of them is true."""

from __future__ import annotations

import mpmath
import numba
import numpy as np
import pytest

import phasekit as pk
from phasekit.bifurcation.continuation.curve import Curve
from phasekit.bifurcation.continuation.derivatives import Derivatives
from phasekit.bifurcation.continuation.kernels.defining import EQUILIBRIUM


def derivatives(f, x, parameters, scale=None, jac=None):
    """The forms of a function at a state, the first parameter free."""
    x = np.array(x, float)
    problem = pk.Problem(
        f, state=tuple(f"x{i}" for i in range(len(x))), parameters=parameters, jac=jac
    )
    m = len(x) + 1
    scale = np.maximum(np.abs(x), 1e-3) if scale is None else np.array(scale, float)
    curve = Curve(
        problem.field,
        EQUILIBRIUM,
        np.array(list(parameters.values())),
        (0,),
        np.append(scale, 1.0),
        np.zeros(m),
        np.full(m, -np.inf),
        np.full(m, np.inf),
        pk.ContinuationOptions(),
    )
    return Derivatives(curve, np.append(x, curve.par[0]))


SHAPES = {
    "tanh": (np.tanh, mpmath.tanh),
    "bell": (lambda x: np.exp(-x * x) + x, lambda x: mpmath.exp(-x * x) + x),
    "cubic": (lambda x: x**3 - x, lambda x: x**3 - x),
    "wave": (lambda x: np.sin(3 * x) * x, lambda x: mpmath.sin(3 * x) * x),
}


@pytest.mark.parametrize("far", [0.5, 100.0, 300.0, 3e4, 1e6])
@pytest.mark.parametrize("shape", SHAPES)
def test_narrow_functions_far_from_zero(shape, far):
    """Width 1 at |x| up to 1e6: errors are within what is claimed, and small."""
    f, exact = SHAPES[shape]
    with mpmath.workdps(60):
        at = mpmath.mpf(0.375)
        wanted = [float(mpmath.diff(exact, at, k)) for k in (1, 2, 3)]
    d = derivatives(lambda x, p: [f(x[0] - far) - p], [far + 0.375], {"p": 0.0})
    e = np.ones(1)
    found = (d.first(e), d.second(e, e), d.third(e, e, e))
    for one, value, most in zip(found, wanted, (1e-13, 1e-11, 1e-9), strict=True):
        # What rounding far + t hides grows with |x|.
        assert one.error[0] <= most * max(1.0, far) * max(10.0, 10.0 * abs(value))
        assert abs(one.value[0] - value) <= one.error[0] + 1e-15 * abs(value) * max(1.0, far)
    assert abs(d.slopes[0, 0] - wanted[0]) <= 1e-10 * max(1.0, far) ** 0.5 * abs(wanted[0])


@pytest.mark.slow
@pytest.mark.parametrize("form", ["python", "compiled", "jac"])
def test_forms_of_several_directions(form):
    """Polarisation against the exact tensors of a polynomial of three unknowns."""

    def f(x, p):
        a, b = x[0], x[1]
        return np.array([a * a * b + p * b * b - a, p * a * b * b - b**3 + p * p])

    def jac(x, p):
        a, b = x
        return [[2 * a * b - 1, a * a + 2 * p * b], [p * b * b, 2 * p * a * b - 3 * b * b]]

    made = numba.njit(f) if form == "compiled" else f
    d = derivatives(made, [0.7, -1.2], {"p": 0.4}, jac=jac if form == "jac" else None)
    a, b, p = 0.7, -1.2, 0.4
    hessian = np.array(
        [
            [[2 * b, 2 * a, 0], [2 * a, 2 * p, 2 * b], [0, 2 * b, 0]],
            [[0, 2 * p * b, b * b], [2 * p * b, 2 * p * a - 6 * b, 2 * a * b],
             [b * b, 2 * a * b, 2]],
        ]
    )  # fmt: skip
    third = np.zeros((2, 3, 3, 3))
    for i, place, value in (
        (0, (0, 0, 1), 2.0), (0, (1, 1, 2), 2.0), (1, (0, 1, 1), 2 * p), (1, (0, 1, 2), 2 * b),
        (1, (1, 1, 2), 2 * a), (1, (1, 1, 1), -6.0),
    ):  # fmt: skip
        for order in ((0, 1, 2), (0, 2, 1), (1, 0, 2), (1, 2, 0), (2, 0, 1), (2, 1, 0)):
            third[(i, *(place[k] for k in order))] = value
    rng = np.random.default_rng(0)
    for _ in range(5):
        u, v, w = rng.normal(size=(3, 3)) + 1j * rng.normal(size=(3, 3))
        for one, two in ((u, v), (u, u), (u, u.conj()), (u[:2], v[:2])):
            n = len(one)
            got = d.second(one, two)
            want = np.einsum("ijk,j,k->i", hessian[:, :n, :n], one, two)
            assert np.all(np.abs(got.value - want) <= got.error + 1e-14)
            assert np.max(got.error) < 1e-11
        for three in ((u, v, w), (u, u, u.conj()), (u.real, u.real, v.real), (v.real,) * 3):
            got = d.third(*three)
            want = np.einsum("ijkl,j,k,l->i", third, *three)
            assert np.all(np.abs(got.value - want) <= got.error + 1e-13)
            assert np.max(got.error) < 1e-9


def test_kinks_and_noise_are_not_known():
    """Where f has no second derivative, or hides it, the error says so."""
    e = np.ones(1)
    kink = derivatives(lambda x, p: [abs(x[0]) - p], [0.0], {"p": 0.0}, scale=[1.0])
    assert not kink.second(e, e).has_digits()
    rough = derivatives(
        lambda x, p: [x[0] ** 2 + 1e-5 * np.sin(1e17 * x[0]) - p], [0.7], {"p": 0.0}
    )
    second = rough.second(e, e)
    assert abs(second.value[0] - 2.0) <= second.error[0]
    assert not rough.third(e, e, e).has_digits()


def test_few_calls():
    """Forms of a Hopf point of four states take hundreds of calls, not tens of thousands."""
    calls = 0

    def f(x, p):
        nonlocal calls
        calls += 1
        return np.array([x[1] * x[2] - p, x[0] * np.sin(x[3]), x[2] ** 3 - x[0], x[3] * x[1]])

    d = derivatives(f, [0.3, -0.4, 0.7, 1.1], {"p": 0.2})
    rng = np.random.default_rng(1)
    q = rng.normal(size=4) + 1j * rng.normal(size=4)
    calls = 0
    d.third(q, q, q.conj())
    h = d.second(q, q.conj()).value.real
    d.second(q, h)
    d.second(q.conj(), d.second(q, q).value)
    assert 0 < calls < 1500


@pytest.mark.slow
def test_hopf_point_of_a_narrow_function():
    """The same first Lyapunov coefficient and place as by formulas, at |x| of 100 and 300."""

    def narrow(far):
        def f(s, mu):
            a = np.tanh(s[0] - far)
            return np.array([mu * a - s[1] - a**3, a])

        return f

    for far in (100.0, 300.0):
        t = f"tanh(x - {far})"
        options = {"x0": [far + 0.01, 0.01], "span": (-1.0, 1.0)}
        exact = pk.Problem([f"mu*{t} - y - {t}**3", t], ("x", "y"), {"mu": -0.5})
        (wanted,) = pk.continuation(exact, "mu", **options).special("H")
        for form in (lambda f: f, numba.njit):
            problem = pk.Problem(form(narrow(far)), ("x", "y"), {"mu": -0.5})
            (point,) = pk.continuation(problem, "mu", **options).special("H")
            assert point.status == "converged"
            assert abs(point["mu"]) < 1e-11
            assert abs(point["x"] - far) < 1e-9
            assert abs(point.normal_form["l1"] - wanted.normal_form["l1"]) < 1e-6
