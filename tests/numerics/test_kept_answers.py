"""What is kept of formulas: that it is what SymPy finds, and that it holds for what it was of."""

import ctypes
import functools
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
import sympy

import phasekit as pk
from phasekit.bifurcation.continuation import fields
from phasekit.bifurcation.continuation.fields import SymbolicField
from phasekit.laws import kept_formulas
from phasekit.laws.smoothness import any_jumps
from phasekit.motion import rates
from phasekit.numerics import kept, kept_answers

FORMULAS = {
    "cubic": (["mu + x - x**3"], ("x",), ("mu",)),
    "neuron": (["v - v^3/3 - w + current", "0.08*(v + 0.7 - 0.8*w)"], ("v", "w"), ("current",)),
    "functions": (["a*sin(x)*exp(-y/3) - tanh(x*y)", "log(1 + x^2) - y^1.5/a"], ("x", "y"), ("a",)),
    "branches": (
        ["Piecewise((x, x < a), (x^2, True)) - sign(y)", "Abs(y) - Max(x, a)"],
        ("x", "y"),
        ("a",),
    ),
}
PACKAGE = Path(pk.__file__).parent


@pytest.fixture
def asked(monkeypatch, tmp_path):
    """Keep answers as in a process without SymPy, in a folder of their own."""
    monkeypatch.setenv("PHASEKIT_CACHE_DIR", str(tmp_path))
    monkeypatch.setattr(kept_formulas, "is_kept", lambda: True)
    monkeypatch.setattr(rates, "is_kept", lambda: True)
    monkeypatch.setattr(kept_answers, "_found", 0)
    for compiled in (fields.first_of, fields._second, fields._third, fields._terms):
        compiled.cache_clear()  # what was compiled before is not kept
    return tmp_path / "phasekit-kernels"


def stated(formulas, states, names, definitions=None, read=None):
    """Return formulas as a problem has them; those that are kept are read by what is given."""
    problem = pk.Problem(formulas, states, dict.fromkeys(names, 0.7), definitions=definitions)
    found = problem.own_field.formulas
    assert isinstance(found, kept_formulas.KeptFormulas)
    return found if read is None else kept_formulas.KeptFormulas(found.stated, read)


def never():
    raise AssertionError("formulas were read")


def filled(address, count, *arrays):
    """Return the numbers that machine code leaves."""
    out, pointer = np.full(count, 7.0), ctypes.POINTER(ctypes.c_double)
    function = ctypes.CFUNCTYPE(None, *[pointer] * 4)(address)
    function(*(x.ctypes.data_as(pointer) for x in (*arrays, out)))
    return out.tobytes()


@pytest.mark.parametrize("name", FORMULAS)
def test_kept_code_has_the_bits_of_the_expressions(asked, name):
    formulas, states, names = FORMULAS[name]
    first = stated(*FORMULAS[name])
    again = stated(*FORMULAS[name], read=never)
    n, m, rng = len(states), len(states) + 1, np.random.default_rng(3)
    x, p, z = rng.uniform(0.2, 1.4, m), rng.uniform(0.2, 1.4, 2), rng.uniform(-1.0, 1.0, 3 * m)
    orders = {"first": n * (1 + m), "second": n * (1 + 2 * m), "third": n}
    found = []
    for source in (first, again, first.expressions):
        field = SymbolicField(source, states, (*names, "b"))
        jumps = any_jumps(source, states)
        code = [filled(getattr(field, one)((0,)), count, x, p, z) for one, count in orders.items()]
        values = field.values(x[None], p, (0,)).tobytes()
        found.append((jumps, code, values))
    assert found[0] == found[1] == found[2]
    assert found[0][0] == (name == "branches")
    assert len(list(asked.glob("formulas-*"))) == 6
    symbols = sympy.symbols([*states, *names])
    value = sympy.lambdify(symbols, [sympy.sympify(f.replace("^", "**")) for f in formulas])
    np.testing.assert_allclose(np.frombuffer(found[1][2]), value(*x), rtol=1e-13)


def test_another_law_of_the_same_text_is_another_question(asked):
    states = ("x",)
    known = stated(["a*x"], states, ("a",), {"a2": "a*3"})
    for changed in (
        (["a*x"], states, ("a",)), (["x*a"], states, ("a",), {"a2": "a*3"}),
        (["a*x"], states, ("a", "c"), {"a2": "a*3"}), (["a*x"], states, ("a",), {"a2": "a*4"}),
    ):  # fmt: skip
        other = stated(*changed)
        assert other.stated != known.stated
        with pytest.raises(AssertionError, match="formulas were read"):
            kept_formulas.KeptFormulas([*other.stated, "unknown"], never)
    assert stated(["a*x"], states, ("a",), {"a2": "a*3"}) is known


def test_wrong_formulas_are_refused_in_the_same_words_and_not_kept(asked, monkeypatch):
    wrong = [["mu + y"], ["gamma(x)"], ["x/0"], ["foo(x)"], ["(x"], ["x < 1"]]

    def words(f):
        with pytest.raises(pk.ParameterError) as caught:
            pk.Problem(f, "x", {"mu": 1.0})
        return str(caught.value)

    found = [words(f) for f in wrong]
    assert not asked.exists()
    monkeypatch.setattr(kept_formulas, "is_kept", lambda: False)
    assert found == [words(f) for f in wrong]


def test_what_is_kept_holds_for_its_sources_alone(asked, monkeypatch, tmp_path):
    source = tmp_path / "source.py"
    source.write_text("1")
    monkeypatch.setattr(kept_answers, "_sources", lambda: {str(source)})
    answers = iter("abc")
    find = lambda: (next(answers), ())  # noqa: E731
    ask = lambda: kept_answers.kept_answer(["x"], find)[0]  # noqa: E731
    assert [ask(), ask()] == ["a", "a"]
    source.write_text("22")
    assert [ask(), ask()] == ["b", "b"]
    (file,) = asked.iterdir()
    file.write_bytes(file.read_bytes()[:-2])
    assert ask() == "c"


def test_all_that_finds_answers_is_among_the_sources(asked, monkeypatch):
    """The files whose functions run while answers are found, but those of the compiler."""
    used = set()

    def note(frame, event, _):
        if event == "call" and frame.f_code.co_name != "<module>":
            used.add(frame.f_code.co_filename)

    def watched(find, *arguments):
        sys.setprofile(note)
        try:
            return find(*arguments)
        finally:
            sys.setprofile(None)

    first = stated(*FORMULAS["branches"])
    field = SymbolicField(first, ("x", "y"), ("a",))
    watched(first._read)
    watched(any_jumps, first.expressions, ("x", "y"))
    for find in (field.first, field.second, field.third):
        watched(find, (0,))
    driven = pk.Perturbed(pk.Pendulum(length=9.81), damping=0.2, forcing=pk.Harmonic(0.5, 0.7)).law
    values = {name: np.array(0.3 * (name != "quadratic")) for name in driven.names}
    monkeypatch.setattr(rates, "_compile", functools.partial(watched, rates._compile))
    rates.rates_of(driven, values, 1, 12)
    ours = {Path(one) for one in used if one.startswith(str(PACKAGE))}
    ours = {one for one in ours if "compiler" not in one.parts}
    assert PACKAGE / "laws" / "nodes.py" in ours
    assert PACKAGE / "motion" / "kernels" / "taylor.py" in ours
    assert ours <= {Path(one) for one in kept_answers._sources()}


def test_only_a_process_that_imported_sympy_to_find_answers_keeps_more(monkeypatch):
    def is_kept_after(found):
        monkeypatch.setattr(kept_answers, "_found", found)
        return kept_answers.is_kept()

    assert "sympy" in sys.modules
    assert [is_kept_after(n) for n in (0, 1, 63, 64)] == [False, True, True, False]
    with sympy.evaluate(False):
        assert not is_kept_after(1)
    monkeypatch.delitem(sys.modules, "sympy")
    assert is_kept_after(0)


def test_the_oldest_are_dropped(asked):
    asked.mkdir()
    for i in range(5):
        path = asked / f"formulas-{i}.kernel"
        path.touch()
        os.utime(path, ns=(10**9 * (10 - i), 10**9 * (10 - i)))
    (asked / "other-1.kernel").touch()
    kept.drop_oldest("formulas", 3)
    left = sorted(path.name for path in asked.iterdir())
    assert left == [f"formulas-{i}.kernel" for i in range(3)] + ["other-1.kernel"]


PROGRAM = """
import sys
import numpy as np
import phasekit as pk

problem = pk.Problem(['mu + x - x**3'], ('x',), {'mu': 0.0})
branch = pk.continuation(problem, 'mu', x0=[-1.5], span=(-2.0, 2.0))
fold = branch.special("fold")[0].parameters["mu"]
disk = pk.GyroRotorDisk(beta=1.0, e=0.05, a=0.012, r=0.2, omega1=31.4)
motion = pk.flow(pk.Perturbed(disk, damping=0.5), 1.0, 0.2, np.linspace(0, 5, 101))
driven = pk.Perturbed(pk.Pendulum(length=9.81), damping=0.2, forcing=pk.Harmonic(0.5, 0.7))
assert driven.law.own_frequencies({}) == []
import phasekit.labelled.continuation.cycle_start

known = {'sympy', 'scipy'} & set(sys.modules) or {'none'}
print(*known, fold.hex(), *(float(x).hex() for x in motion.motion_phi.values.ravel()))
print(problem, problem == pk.Problem(['x*1 + mu - x**3'], ('x',), {'mu': 0.0}))
"""


@pytest.mark.slow
def test_other_processes_need_neither_sympy_nor_scipy_and_find_the_same_bits(tmp_path):
    environment = {**os.environ, "PHASEKIT_CACHE_DIR": str(tmp_path)}
    runs = [
        subprocess.run(
            [sys.executable, "-c", PROGRAM], capture_output=True, text=True, env=environment,
            check=True,
        ).stdout.splitlines()
        for _ in range(2)
    ]  # fmt: skip
    assert [run[0].split()[0] for run in runs] == ["sympy", "none"]
    assert len({tuple(run[0].split()[1:]) for run in runs}) == 1
    assert abs(float.fromhex(runs[0][0].split()[1]) - 2.0 / 3.0**1.5) < 1e-9
    assert runs[0][1] == runs[1][1] == "Problem(x' = mu - x**3 + x; mu=0.0) True"


def test_a_forced_law_has_its_least_period(asked):
    f = ["y", "cos(2*w*t) - x"]
    problem = pk.Problem(f, ("x", "y"), {"w": 1.0}, time="t", period="2*pi/w")
    assert isinstance(problem.own_field.formulas, kept_formulas.KeptFormulas)
    assert problem.period == sympy.pi / sympy.Symbol("w", real=True)
