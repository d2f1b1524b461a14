"""Multipliers that meet, or pass the unit circle together: a torus is named for complex pairs."""

import numpy as np
import pytest

import phasekit as pk

KINDS = {1: ("cycle_branch_point", "branch_point"), -1: ("period_doubling",)}
ENTRIES = ("a", "b", "c", "d")


def named(branch):
    return [one for one in branch.special_points if one.kind != "end"]


def jordan(seed, eigenvalue):
    """A 2 x 2 matrix with one double eigenvalue that has one eigenvector."""
    turn = np.random.default_rng(seed).normal(size=(2, 2))
    return turn @ np.array([[eigenvalue, 1.0], [0.0, eigenvalue]]) @ np.linalg.inv(turn)


@pytest.fixture(scope="module")
def across():
    """Z' = (p + x + M) z across the unit circle, along which x has the mean zero, and its orbit."""
    radius = "(1 - x**2 - y**2)"
    problem = pk.Problem(
        [f"x*{radius} - y", f"y*{radius} + x", "(p + x + a)*z + b*w", "(p + x + d)*w + c*z"],
        ("x", "y", "z", "w"), {"p": -0.03, **dict.fromkeys(ENTRIES, 0.0)},
    )  # fmt: skip
    orbit = pk.periodic_orbit(problem, [1.0, 0.0, 0.0, 0.0])

    def family(matrix):
        own = problem.replace(**dict(zip(ENTRIES, np.ravel(matrix).tolist(), strict=True)))
        return pk.continuation(own, "p", orbit=orbit, span=(-0.05, 0.05))

    return family


@pytest.mark.parametrize("seed", range(8))
def test_double_real_multipliers_of_cycles_are_no_torus(across, seed):
    found = named(across(jordan(seed, 0.0)))
    assert len(found) == 1
    assert (found[0].kind, found[0].status) == ("cycle_branch_point", "guess")
    assert "2 multipliers pass the unit circle together" in found[0].message
    low, high = found[0].interval
    assert low <= 0.0 <= high


def test_two_real_multipliers_at_once_are_no_torus(across):
    (found,) = named(across(np.zeros((2, 2))))
    assert (found.kind, found.status) == ("cycle_branch_point", "guess")
    assert found["p"] == pytest.approx(0.0, abs=1e-10)


@pytest.mark.parametrize("rate", [0.01, 0.02])
def test_neutral_saddles_are_nothing(across, rate):
    """Both multipliers are real, and their product passes 1."""
    assert named(across(np.diag([0.2 + rate, -0.2 - rate]))) == []


@pytest.mark.parametrize("angle", [1e-5, 1e-3, 0.1])
def test_complex_pairs_are_a_torus_however_close(across, angle):
    (found,) = named(across([[0.0, -angle], [angle, 0.0]]))
    assert (found.kind, found.status) == ("torus", "converged")
    assert found["p"] == pytest.approx(0.0, abs=1e-11)
    assert found.normal_form["angle"] == pytest.approx(2 * np.pi * angle, rel=1e-6)


@pytest.mark.parametrize("other", ["saddle", "pair"])
def test_pairs_beside_what_crosses_at_the_same_place(other):
    """The sign of the product of all 1 - mu_i mu_j stays."""
    radius = "(1 - x**2 - y**2)"
    more = {
        "saddle": ["(0.2 + p)*z", "(-0.2 + p)*w"], "pair": ["p*z - 0.21*w", "p*w + 0.21*z"],
    }[other]  # fmt: skip
    problem = pk.Problem(
        [f"x*{radius} - y", f"y*{radius} + x", *more, "p*u - 0.3*v - u**3", "p*v + 0.3*u - v**3"],
        ("x", "y", "z", "w", "u", "v"), {"p": -0.03},
    )  # fmt: skip
    orbit = pk.periodic_orbit(problem, [1.0, 0.0, 0.0, 0.0, 0.0, 0.0])
    (found,) = named(pk.continuation(problem, "p", orbit=orbit, span=(-0.05, 0.05)))
    assert (found.kind, found.status) == ("torus", "converged")
    assert found["p"] == pytest.approx(0.0, abs=1e-11)
    if other == "saddle":
        assert found.normal_form["angle"] == pytest.approx(0.6 * np.pi, abs=1e-9)
        # u + i v is sqrt(2) xi e^(i omega t), and u' = -u^3, v' = -v^3 take 3/4 |u + i v|^3.
        assert found.normal_form["d"] == pytest.approx(-1.5, rel=1e-6)
    else:
        assert "2 pairs of multipliers" in found.message


@pytest.mark.parametrize("seed", range(8))
@pytest.mark.parametrize("sign", [1, -1])
def test_double_real_multipliers_of_maps_are_no_torus(seed, sign):
    (a, b), (c, d) = jordan(seed, sign).tolist()
    problem = pk.Problem(
        ["(a + s*p)*x + b*y", "(d + s*p)*y + c*x"], ("x", "y"),
        {"p": -0.03, "a": a, "b": b, "c": c, "d": d, "s": float(sign)}, map=True,
    )  # fmt: skip
    found = named(pk.continuation(problem, "p", x0=[0.0, 0.0], span=(-0.05, 0.05)))
    assert len(found) == 1
    assert found[0].kind in KINDS[sign]
    assert found[0].status == "guess"
    low, high = found[0].interval
    assert low <= 0.0 <= high


@pytest.mark.parametrize("angle", [1e-5, 0.3, np.pi - 1e-5])
def test_complex_pairs_of_maps_are_a_torus(angle):
    c, s = np.cos(angle), np.sin(angle)
    problem = pk.Problem(
        ["(1 + p)*(c*x - s*y)", "(1 + p)*(c*y + s*x)"], ("x", "y"), {"p": -0.03, "c": c, "s": s},
        map=True,
    )  # fmt: skip
    (found,) = named(pk.continuation(problem, "p", x0=[0.0, 0.0], span=(-0.05, 0.05)))
    assert (found.kind, found.status) == ("torus", "converged")
    assert found.normal_form["angle"] == pytest.approx(angle, rel=1e-6)
