"""Hopf-Hopf points: where a second pair becomes imaginary along a Hopf curve."""

import matplotlib
import numpy as np
import pytest

import phasekit as pk

#: Two oscillators, of which one is at its Hopf point at a = 0, the other at b = a + 1/5.
OMEGA = 2.7
STATES = ("x", "y", "z", "w")


def oscillators(change):
    """The linear part in other coordinates, with a cubic term on each state in its own units."""
    inverse = np.linalg.inv(change)
    a, b, c = np.zeros((3, 4, 4))
    a[:2, :2] = a[2:, 2:] = np.eye(2)
    b[2:, 2:] = -np.eye(2)
    c[:2, :2] = [[0.0, -1.0], [1.0, 0.0]]
    c[2:, 2:] = [[0.2, -OMEGA], [OMEGA, 0.2]]
    parts = [change @ part @ inverse for part in (a, b, c)]
    sizes = np.max(np.abs(change), axis=1)
    formulas = []
    for i in range(4):
        terms = [
            f"({float(parts[0][i, j])!r}*a + {float(parts[1][i, j])!r}*b + "
            f"{float(parts[2][i, j])!r})*{STATES[j]}"
            for j in range(4)
        ]
        formulas.append(
            " + ".join(terms) + f" - {float(sizes[i])!r}*({STATES[i]}/{float(sizes[i])!r})**3"
        )
    return pk.Problem(formulas, STATES, {"a": -0.5, "b": 0.5})


@pytest.mark.slow
@pytest.mark.parametrize("seed", [None, 1])
def test_both_hopf_curves_meet_where_they_must(seed):
    change = np.eye(4)
    if seed is not None:
        rng = np.random.default_rng(seed)
        sizes = 10.0 ** rng.permutation([-6.0, -2.0, 3.0, 6.0])
        change = sizes[:, None] * rng.standard_normal((4, 4))
    problem = oscillators(change)
    rest = pk.continuation(problem, "a", x0=np.zeros(4), span=(-1, 1))
    hopfs = rest.special("H")
    np.testing.assert_allclose([h["a"] for h in hopfs], [0.0, 0.3], atol=1e-13)
    for hopf in hopfs:
        curve = hopf.curve("b", (-1, 1))
        (point,) = curve.special("HH")
        assert point.kind == "hopf_hopf"
        assert point.status == "converged"
        assert abs(point["a"]) < 1e-13
        assert abs(point["b"] - 0.2) < 1e-13
        imaginary = np.sort(np.abs(point.eigenvalues.imag))
        np.testing.assert_allclose(imaginary, [1.0, 1.0, OMEGA, OMEGA], rtol=1e-12)
        assert [s.label for s in curve.special_points] == ["EP", "HH", "EP"]
    ax = curve.plot()
    assert "HH" in [text.get_text() for text in ax.texts]
    matplotlib.pyplot.close(ax.figure)


def test_two_real_eigenvalues_that_cancel_are_no_second_pair():
    problem = pk.Problem(
        ["a*x - y - x**3", "x + a*y - y**3", "(b + 1/2)*z - z**3", "-w - w**3"],
        STATES, {"a": -0.5, "b": 0.0},
    )  # fmt: skip
    rest = pk.continuation(problem, "a", x0=np.zeros(4), span=(-1, 1))
    (hopf,) = rest.special("H")
    curve = hopf.curve("b", (-1, 1))  # at b = 1/2 two real eigenvalues are 1 and -1
    assert curve.special("HH") == ()
    (zero,) = curve.special("ZH")
    assert abs(zero["b"] + 0.5) < 1e-14
