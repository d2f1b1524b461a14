"""Models of reactions: equations written anew, conserved amounts, and what is refused."""

from fractions import Fraction
from pathlib import Path

import numpy as np
import pytest
import sympy as sp
from scipy.integrate import solve_ivp

import phasekit as pk
from phasekit.systems.conserved import conserved_sums, dependent_places

FILE = Path(__file__).parents[1] / "data" / "sbml" / "relay.xml"


def evaluate(problem, formula, **changes):
    values = {**problem.parameters, **problem.start, **changes}
    return float(formula.subs({sp.Symbol(n, real=True): v for n, v in values.items()}))


@pytest.mark.slow
def test_a_file_of_sbml():
    """Amounts 2 [A] + 2 N are conserved; A is a concentration in a cell of 2, N an amount."""
    pytest.importorskip("libsbml")
    problem = pk.Problem.from_sbml(FILE)
    assert problem.state == ("A", "w")
    assert problem.parameters["total_A"] == 2 * 3 + 2 * 8
    assert problem.words["total_A"]["long_name"] == "conserved amount A + 2 N"
    assert problem.parameters["lambda_"] == 1.5
    start = (3 + 8) / 2
    assert dict(problem.start) == {"A": 3.0, "w": start / 1.5}
    for a in (0.5, 2.0, 10.5):
        n = (22 - 2 * a) / 2
        forth, back = 2 * 4 * a**2 / (1 + a**2) * 0.5, 0.7 * (n if n > 1 else 1)
        rates = [evaluate(problem, f, A=a, w=0.3) for f in problem.f]
        assert rates == pytest.approx([(-2 * forth + 2 * back) / 2, 1.5 * (a + n) / 2 - 0.3])
        assert evaluate(problem, problem.observables["N"], A=a) == pytest.approx(n)
        assert evaluate(problem, problem.observables["mean"], A=a) == pytest.approx((a + n) / 2)


def test_an_enzyme_in_antimony(tmp_path):
    pytest.importorskip("antimony")
    text = """
        E + S -> ES; on*E*S
        ES -> E + S; off*ES
        ES -> E + P; k*ES
        E = 1; S = 10; ES = 0; P = 0; on = 1; off = 0.5; k = 0.3
    """
    problem = pk.Problem.from_antimony(text)
    assert problem.state == ("E", "S")
    assert {n: v for n, v in problem.parameters.items() if "total" in n} == {
        "total_E": 1.0, "total_S": 10.0
    }  # fmt: skip

    def rates(t, x):
        E, S, ES, _ = x
        bind, part, make = E * S, 0.5 * ES, 0.3 * ES
        return [-bind + part + make, -bind + part, bind - part - make, make]

    t = np.linspace(0.0, 20.0, 5)
    own = solve_ivp(rates, (0, 20), [1, 10, 0, 0], t_eval=t, rtol=1e-11, atol=1e-12)
    ds = pk.flow(problem, t=t)
    for name, x in zip(("E", "S", "ES", "P"), own.y, strict=True):
        np.testing.assert_allclose(ds[f"motion_{name}"], x, atol=1e-8)
    (tmp_path / "enzyme.ant").write_text(text)
    assert pk.Problem.from_antimony(tmp_path / "enzyme.ant") == problem
    assert pk.Problem.from_antimony(str(tmp_path / "enzyme.ant")) == problem


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("A -> ; k*A\nk = 1; A = 1\nat (A > 1): A = 2", "events, at which values jump"),
        ("A -> ; k*delay(A, 1)\nk = 1; A = 1", "a delay in the rate of"),
        ("A -> ; k*floor(A)\nk = 1; A = 1", "floor, which jumps"),
        ("A -> ; k*A\nA = 1", "no value for k"),
        ("k = 1", "nothing that changes"),
        ("A -> B", "got"),
        ("A ->> ; ; x", "got no Antimony"),
        ("", "wants a model in Antimony"),
    ],
)
def test_what_is_no_flow_is_refused(text, said):
    pytest.importorskip("antimony")
    with pytest.raises(pk.ParameterError) as error:
        pk.Problem.from_antimony(text)
    assert said in str(error.value)


def test_values_that_are_not_given(tmp_path):
    pytest.importorskip("antimony")
    with pytest.warns(RuntimeWarning, match="no initial values of B"):
        problem = pk.Problem.from_antimony("A -> B; k*A\nB -> ; k*B\nA = 1; k = 2")
    assert problem.start["B"] == 0.0
    (tmp_path / "bad.xml").write_text("<sbml>")
    with pytest.raises(pk.ParameterError, match=r"bad.xml, line \d: got no valid SBML"):
        pk.Problem.from_sbml(tmp_path / "bad.xml")


def test_a_missing_library_is_named(monkeypatch):
    import sys

    monkeypatch.setitem(sys.modules, "libsbml", None)
    with pytest.raises(pk.ParameterError, match=r"pip install 'phasekit\[sbml\]'"):
        pk.Problem.from_sbml(FILE)


def test_conserved_sums_are_a_basis():
    """Of random stoichiometries: as many as the rank says, each exactly conserved."""
    rng = np.random.default_rng(1)
    for _ in range(40):
        n, m, kept = rng.integers(2, 7), rng.integers(1, 7), rng.integers(0, 3)
        matrix = rng.integers(-2, 3, (n, m)) * (rng.uniform(size=(n, m)) < 0.6)
        for _ in range(kept):  # rows that repeat others
            matrix[rng.integers(n)] = -matrix[rng.integers(n)]
        sums = conserved_sums([[Fraction(int(x)) for x in row] for row in matrix])
        rank = sp.Matrix(matrix.tolist()).rank()
        assert len(sums) == n - rank
        if sums:
            g = sp.Matrix([[sp.Rational(x.numerator, x.denominator) for x in row] for row in sums])
            assert g.rank() == n - rank
            assert (g * sp.Matrix(matrix.tolist())).is_zero_matrix
            assert g[:, dependent_places(sums)].det() != 0


def test_a_cascade_has_sums_of_its_moieties():
    """Of two kinases with a common phosphatase: enzymes free and bound, without differences."""
    species = "A AP E EA F FA B BP AB"
    reactions = ["A+E>EA", "EA>A+E", "EA>AP+E", "AP+F>FA", "FA>A+F", "B+AP>AB", "AB>BP+AP", "BP>B"]
    names = species.split()
    matrix = [[0] * len(reactions) for _ in names]
    for k, text in enumerate(reactions):
        for sign, side in zip((-1, 1), text.split(">"), strict=True):
            for name in side.split("+"):
                matrix[names.index(name)][k] += sign
    sums = conserved_sums(matrix)
    said = {frozenset(n for n, x in zip(names, row, strict=True) if x) for row in sums}
    assert said == {
        frozenset(("E", "EA")), frozenset(("F", "FA")), frozenset(("B", "BP", "AB")),
        frozenset(("A", "AP", "EA", "FA", "AB")),
    }  # fmt: skip
    assert all(x in (0, 1) for row in sums for x in row)
