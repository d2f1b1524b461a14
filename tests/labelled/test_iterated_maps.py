"""Maps applied many times: the cascade of period doublings, derivatives of long orbits."""

import pickle

import mpmath
import numba
import numpy as np
import pytest
from witnesses.variants import some

import phasekit as pk
from phasekit.bifurcation.continuation.curve import Curve
from phasekit.bifurcation.continuation.derivatives import Derivatives
from phasekit.bifurcation.continuation.kernels.defining import EQUILIBRIUM
from phasekit.bifurcation.continuation.options import ContinuationOptions
from phasekit.labelled.continuation.branch import Branch


def logistic(x, r):
    return r * x * (1.0 - x)


@numba.njit
def compiled(x, r):
    return np.array([r * x[0] * (1.0 - x[0])])


FORMS = {
    "formula": ("r*x*(1 - x)", None),
    "python": (logistic, None),
    "jac": (logistic, lambda x, r: np.array([[r * (1.0 - 2.0 * x[0])]])),
    "compiled": (compiled, None),
}
#: Of the logistic map (OEIS A086181 and A091517, and mpmath for the others).
DOUBLINGS = (3.0, 1.0 + 6.0**0.5, 3.5440903595519228536, 3.5644072660954325977)


def orbit_of(times, x, r):
    """The orbit of the logistic map and the first three derivatives of its last point, exactly."""
    x, r = mpmath.mpf(x), mpmath.mpf(r)
    one, two, three = mpmath.mpf(1), mpmath.mpf(0), mpmath.mpf(0)
    for _ in range(times):
        slope, bend = r * (1 - 2 * x), -2 * r
        one, two, three = (
            slope * one,
            slope * two + bend * one**2,
            slope * three + 3 * bend * one * two,
        )
        x = r * x * (1 - x)
    return x, one, two, three


def doubling_of(times, x, r):
    """Where an orbit of the logistic map doubles, in many digits."""
    with mpmath.workdps(40):

        def both(x, r):
            end, one, _, _ = orbit_of(times, x, r)
            return end - x, one + 1

        return mpmath.findroot(both, (mpmath.mpf(float(x)), mpmath.mpf(float(r))))[1]


@pytest.mark.parametrize("form", some(["formula", "python", "jac"], 2))
def test_the_cascade_of_period_doublings(form):
    cascade(form)


@pytest.mark.slow  # kernels for compiled functions
def test_the_cascade_of_a_compiled_map():
    cascade("compiled")


def cascade(form):
    f, jac = FORMS[form]
    branch = pk.continuation(
        pk.Problem(f, "x", {"r": 2.0}, jac, map=True), "r", x0=[0.5], span=(1.5, 3.567)
    )
    for level, wanted in enumerate(DOUBLINGS):
        assert branch.problem.times == 2**level
        (point,) = branch.special("PD")
        assert point.status == "converged"
        assert abs(point["r"] - wanted) < (1e-12 if form in ("formula", "jac") else 1e-11)
        assert abs(doubling_of(2**level, point.x[0], point["r"]) - wanted) < 1e-15
        # The coefficient of the doubling: f''^2/4 + f'''/6 of the iterate.
        with mpmath.workdps(30):
            _, _, two, three = orbit_of(2**level, point.x[0], point["r"])
            coefficient = float(two**2 / 4 + three / 6)
        assert abs(point.normal_form["c"] / coefficient - 1.0) < 1e-8
        assert branch.messages == ()
        branch = point.switch()
    assert branch.problem.times == 16


def curve_of(problem, active, u):
    m = len(u)
    return Curve(
        problem.field, EQUILIBRIUM, np.array(list(problem.parameters.values())), active,
        np.ones(m), np.zeros(m), np.full(m, -np.inf), np.full(m, np.inf), ContinuationOptions(),
        discrete=True,
    )  # fmt: skip


HENON = ("1 - a*x**2 + y", "b*x")


def henon(x, a, b):
    return [1.0 - a * x[0] ** 2 + x[1], b * x[0]]


@pytest.mark.parametrize("form", ["formula", "python"])
def test_derivatives_of_iterates_against_many_digits(form):
    """Of a Henon map five times, by states and a parameter: jets of polynomials in mpmath."""
    f = list(HENON) if form == "formula" else henon
    problem = pk.Problem(f, ("x", "y"), {"a": 1.2, "b": 0.3}, map=True).iterated(5)
    u = np.array([0.31, 0.12, 1.1])
    curve = curve_of(problem, (0,), u)
    d = Derivatives(curve, u)
    z = np.array([[0.3, -0.7, 0.2], [1.0, 0.4, -0.5], [-0.2, 0.6, 0.9]])

    def along(order):
        with mpmath.workdps(40):

            def f(*t):
                line = zip(u, z.T, strict=True)
                x, y, a = (
                    mpmath.mpf(float(one)) + sum(s * float(k) for s, k in zip(t, way, strict=False))
                    for one, way in line
                )
                start = (x, y)
                for _ in range(5):
                    x, y = 1 - a * x**2 + y, mpmath.mpf(0.3) * x
                return x - start[0], y - start[1]

            return np.array(
                [
                    float(mpmath.diff(lambda *t, i=i: f(*t)[i], (0,) * order, (1,) * order))
                    for i in range(2)
                ]
            )

    tolerance = 1e-12 if form == "formula" else 1e-7
    for order, found in enumerate((d.slopes @ z[0], d.second(*z[:2]), d.third(*z)), start=1):
        value = found if order == 1 else found.value
        size = np.max(np.abs(along(order)))
        np.testing.assert_allclose(value, along(order), atol=tolerance * size)
        if order > 1:
            assert np.all(np.abs(value - along(order)) <= found.error + 1e-13 * size)
    bent = curve.bend(u, z[0]) @ z[1]
    np.testing.assert_allclose(bent, along(2), atol=1e-5 * np.max(np.abs(along(2))))


def test_ten_thousand_steps():
    """Of a rotation, whose products stay bounded."""
    times = 10_000
    c, s = float(np.cos(0.3)), float(np.sin(0.3))
    turn = pk.Problem(
        [f"{c!r}*x - {s!r}*y", f"{s!r}*x + {c!r}*y + e"], ("x", "y"), {"e": 0.0},
        map=True,
    ).iterated(times)  # fmt: skip
    value, slopes = turn.derivatives([1.0, 0.0])
    with mpmath.workdps(30):
        power = mpmath.mpc(c, s) ** times  # of the doubles as they are
    wanted = [[float(power.real), -float(power.imag)], [float(power.imag), float(power.real)]]
    np.testing.assert_allclose(slopes, wanted, atol=1e-11)
    np.testing.assert_allclose(value, np.array(wanted)[:, 0], atol=1e-11)
    with pytest.raises(pk.ParameterError, match="n: got 2, wants a whole number from 1 to 1"):
        turn.iterated(2)


def test_iterates_are_saved_and_copied(tmp_path):
    problem = pk.Problem("r*x*(1 - x)", "x", {"r": 3.2}, map=True).iterated(2)
    assert problem.iterated(2).times == 4
    assert problem != problem.iterated(2)
    assert "applied 2 times" in repr(problem)
    assert pickle.loads(pickle.dumps(problem)) == problem
    assert pk.Problem.from_specification(problem.specification()) == problem
    assert problem.replace(r=3.0)([0.5]) == 3.0 * 0.75 * 0.25
    branch = pk.continuation(problem, "r", x0=[0.51], span=(3.1, 3.5))
    branch.save(tmp_path / "b.nc")
    assert Branch.load(tmp_path / "b.nc").problem == problem


def test_an_exception_on_the_way_is_told():
    def edge(x, r):
        if x[0] > 0.7:
            raise ValueError("beyond the edge")
        return r * x * (1.0 - x)

    problem = pk.Problem(edge, "x", {"r": 2.0}, map=True).iterated(2)
    branch = pk.continuation(problem, "r", x0=[0.5], span=(1.5, 3.9))
    assert "beyond the edge" in branch.stops[1].message
    assert abs(branch.points.r.values[-1] - 1.0 / 0.3) < 0.05
