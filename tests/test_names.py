"""Wrong guesses are answered with the right name."""

import ast
import contextlib
import dataclasses
import enum
import functools
import inspect
import re
from pathlib import Path

import numpy as np
import pytest

import phasekit as pk
from phasekit.spellings import ARGUMENTS, NAMES, OPTIONS, TERMS, argument_meant

DISK = pk.GyroRotorDisk(beta=0.7, e=0.05, a=0.02, r=0.2, omega1=30.0)
PROBLEM = pk.Problem("mu - x**2", state="x", parameters={"mu": 1.0})


@pytest.mark.parametrize(
    ("guess", "name"),
    [
        ("phase_portrait", "pk.plot.phase_portrait"),
        ("bifurcation_diagram", "pk.plot.bifurcation_diagram"),
        ("simulate", "pk.flow"),
        ("limit_cycle", "pk.periodic_orbit"),
        ("fixed_points", "pk.equilibria"),
    ],
)
def test_names_of_other_programs_lead_to_those_of_phasekit(guess, name):
    with pytest.raises(AttributeError, match=f"has no attribute '{guess}'; use '{name}'"):
        getattr(pk, guess)


def test_every_name_that_is_recommended_exists():
    guesses = [guess for _, others in NAMES for guess in others.split()]
    assert len(guesses) > 250
    assert len(guesses) == len(set(guesses))
    assert not set(guesses) & set(pk.__all__)
    for target, _ in NAMES:
        place = pk
        for part in target.split("(")[0].split("."):
            place = getattr(place, part)
        assert callable(place) or target in ("deg", "rpm", "units")
    rights = {
        right
        for right, _ in re.findall(
            r"\.(special\w*)(\(|$)", "\n".join(target for target, _ in NAMES)
        )
    }
    assert all(hasattr(pk.Branch, right) for right in rights)
    assert hasattr(pk.SpecialPoint, "curve")


@pytest.mark.parametrize(
    ("function", "guess", "name"),
    [
        (pk.continuation, "range", "span"),
        (pk.continuation, "bounds", "span"),
        (pk.continuation, "u0", "x0"),
        (pk.continuation, "ds", "options"),
        (pk.Problem, "params", "parameters"),
        (pk.Problem, "states", "state"),
        (pk.equilibria, "bounds", "box"),
        (pk.sweep, "n_jobs", "workers"),
        (pk.flow, "tspan", "t"),
        (pk.lyapunov, "T", "duration"),
        (pk.plot.phase_portrait, "xlim", "window"),
        (pk.orbit_diagram, "range", "values"),
        (pk.SpecialPoint.curve, "range", "span"),
        (pk.ContinuationOptions, "max_pionts", "max_points"),
        (pk.plot.branch, "axis", "ax"),
        (pk.periodic_orbit, "T", "period"),
        (pk.escape_rate, "well", "center"),
        (pk.explore, "sliders", "ranges"),
        (pk.grid, "bc", "boundary"),
    ],
)
def test_arguments_of_other_programs_lead_to_those_of_phasekit(function, guess, name):
    expected = list(inspect.signature(function).parameters)
    assert argument_meant(guess, expected) == name


def test_what_belongs_elsewhere_is_said():
    """Options of continuation, terms of a system, axes of maps, parts of other arguments."""
    assert {*OPTIONS, "certify"} == set(inspect.signature(pk.ContinuationOptions).parameters)
    assert set(TERMS) < set(inspect.signature(pk.Perturbed).parameters)
    flow = pk.Problem({"x": "y", "y": "a - x - y"}, parameters={"a": 1.0})
    wrong = [
        (lambda: pk.continuation(flow, "a", detect=()), r"pk.ContinuationOptions\(detect=...\)"),
        (lambda: pk.continuation(flow, "a", ds=0.1), r"ContinuationOptions\(initial_step=...\)"),
        (lambda: pk.escape_rate(flow, temperature=0.1), r"pk.Perturbed\(system, kT=...\)"),
        (lambda: pk.explore(flow, params={}), r"by system.replace\(...\)"),
        (lambda: pk.sweep(flow, a=[1.0], n_jobs=2), "n_jobs: is no axis; did you mean 'workers'"),
        (lambda: pk.lyapunov(flow, [0, 0], T=9.0), "'T'; did you mean 'duration'"),
        (lambda: pk.poincare_section(flow, [0, 0], plane="x"), "'section'; .* instead of plane="),
        (lambda: pk.flow(flow, [0, 0], [1.0], events=["x"]), r"events: got \['x'\], wants"),
        (lambda: pk.basins(flow, grid={"x": 5, "y": [0, 1]}), r"grid\['x'\]: got 5, wants a 1-D"),
        (lambda: pk.connection(flow, [0, 0], [1, 1]), r"free: got \[1, 1\], wants one or more"),
        (lambda: pk.Perturbed(pk.Pendulum(length=1.0), friction=1.0), "did you mean 'damping'"),
        (lambda: pk.plot.branch("rest"), "branches: got 'rest', wants a Branch"),
    ]
    for call, message in wrong:
        with pytest.raises(pk.ParameterError, match=message):
            call()
    with pytest.raises(AttributeError, match=r'use .save\("page.html"\)'):
        pk.explore(flow, window={"x": (-1, 1), "y": (-1, 1)}).show()


def test_every_argument_that_is_recommended_exists():
    functions = [getattr(pk, name) for name in pk.__all__ if name not in ("plot", "extend")]
    functions += [getattr(pk.plot, name) for name in pk.plot.__all__]
    functions = [one for one in functions if callable(one)]
    taken = set()
    for function in functions:
        with contextlib.suppress(ValueError):  # of exceptions
            taken |= set(inspect.signature(function).parameters)
    assert set(ARGUMENTS) <= taken
    for right, others in ARGUMENTS.items():
        assert right not in others
        assert len(others) == len(set(others))


def test_every_call_says_what_its_arguments_are():
    """Of functions, pictures and classes alike."""
    wrong = {name: getattr(pk, name) for name in pk.__all__}
    wrong |= {f"plot.{name}": getattr(pk.plot, name) for name in pk.plot.__all__}
    for name, thing in wrong.items():
        made = inspect.isclass(thing) and not issubclass(thing, (enum.Enum, Exception))
        results = (pk.SpecialPoint, pk.Branch, pk.Atlas, pk.System)
        if inspect.isfunction(thing) or (made and not issubclass(thing, results)):
            with pytest.raises(pk.ParameterError) as error:
                thing(nonsense_=1)
            assert "nonsense_" in str(error.value) or "missing" in str(error.value), name


@pytest.mark.parametrize(
    ("formula", "message"),
    [
        ("np.sin(x) + mu", r"np\.sin at character 1; write sin\(\.\.\.\)"),
        ("mu + math.cos(x)", r"math\.cos at character 6; write cos\(\.\.\.\)"),
        ("np.pi*x + mu", r"np\.pi at character 1; write pi$"),
        ("mu*x.real", r"x\.real at character 4; write real$"),
        ("mu - x.^3", r"'\.' at character 7; write \^$"),
        (r"\frac{x}{mu}", r"'.*' at character 1; LaTeX is not read$"),
        ("dx/dt = mu - x", r"'=' at character 7; write the right-hand side alone"),
        ("2x*(mu - x)", r"'x' at character 2 where an operator belongs; a product is written"),
        ("x*(1 - 2(x - mu))", r"'\(' at character 9 where an operator .*; a product is written"),
        ("mu*x)", r"'\)' at character 5 where an operator belongs$"),
    ],
)
def test_what_other_languages_write_is_answered_by_what_to_write(formula, message):
    with pytest.raises(pk.ParameterError, match=message):
        pk.Problem(formula, state="x", parameters={"mu": 1.0})


@pytest.mark.parametrize(("word", "other"), [("lambda", "lam"), ("class", "class_")])
def test_a_keyword_of_python_is_answered_by_another_name(word, other):
    message = f"{word} is a keyword of Python: use {other}$"
    with pytest.raises(pk.ParameterError, match=message):
        pk.Problem(lambda x, **p: x, state="x", parameters={word: 1.0})
    with pytest.raises(pk.ParameterError, match=message):
        pk.Problem(f"{word} - x", state="x", parameters={"mu": 1.0})
    with pytest.raises(pk.ParameterError, match=message):
        pk.Potential("k*cos(x)", "x", {"k": 1.0, word: 1.0})


@pytest.mark.parametrize(
    ("thing", "name"),
    [
        (DISK, "beta"),
        (PROBLEM, "mu"),
        (pk.Perturbed(DISK, damping=0.1), "damping"),
        (pk.Potential("a*cos(x)", "x", {"a": 1.0}), "a"),
        (pk.Coefficients(1.0, 2.0, 3.0), "A"),
        (pk.Pendulum(length=1.0), "length"),
    ],
    ids=lambda thing: thing if isinstance(thing, str) else type(thing).__name__,
)
def test_a_frozen_system_says_what_to_write(thing, name):
    with pytest.raises(AttributeError, match=rf"frozen; use \.replace\({name}=\.\.\.\)"):
        setattr(thing, name, 3.0)
    if dataclasses.is_dataclass(thing):
        with pytest.raises(AttributeError):
            delattr(thing, name)


@pytest.mark.parametrize(
    ("word", "name"),
    [
        ("folds", "fold"),
        ("Fold", "fold"),
        ("limit point", "fold"),
        ("saddle-node", "fold"),
        ("lp", "LP"),
        ("Neimark-Sacker", "torus"),
        ("period doublings", "period_doubling"),
        ("hopf_point", "hopf"),
        ("crossings", "crossing"),
    ],
)
def test_words_for_special_points_are_answered_by_their_kinds(word, name):
    branch = pk.continuation(PROBLEM, "mu", x0=[1.0], span=(-1, 1), events={"crossing": "x - 1/2"})
    assert len(branch.special("fold")) == len(branch.special("LP")) == 1
    message = rf"wants a kind of special points, .*; did you mean '{name}'\?"
    with pytest.raises(pk.ParameterError, match=message):
        branch.special(word)


def test_explore_names_what_it_takes():
    assert issubclass(pk.FreeGyroRotor, pk.System)  # classes are known once they are loaded
    with pytest.raises(pk.ParameterError, match="wants one of ") as caught:
        pk.explore(3)
    assert "Potential" in str(caught.value)
    for name in ("Problem", "Perturbed", "FreeGyroRotor"):
        assert re.search(rf"\b{name}\b", str(caught.value))
    assert "FreeGyroRotor" in str(caught.value)


def test_a_problem_is_answered_by_what_takes_it():
    with pytest.raises(pk.ParameterError, match="pk.periodic_orbit, .* take a Problem"):
        pk.orbits(PROBLEM, 1.0, 1.0)


#: What a function is not called: words that say neither what it returns nor what it does.
VAGUE = {
    "at", "known", "made", "noted", "of", "one", "place", "said", "some", "told", "worded",
}  # fmt: skip


@functools.cache
def functions():
    """The package's functions: file, class or nothing, and node of each; parsed once."""
    found = []
    for path in sorted(Path(pk.__file__).parent.rglob("*.py")):
        below = [(ast.parse(path.read_text(encoding="utf-8")), "")]
        while below:
            node, owner = below.pop()
            if isinstance(node, ast.FunctionDef):
                found.append((path, owner, node))
            inside = node.name if isinstance(node, ast.ClassDef) else ""
            below += [(part, inside) for part in ast.iter_child_nodes(node)
                      if not isinstance(part, ast.expr)]  # fmt: skip
    return found


def test_functions_are_named_by_what_they_return_or_do():
    assert len(functions()) > 5000
    vague = [f"{path.name}: {node.name}" for path, _, node in functions()
             if node.name.strip("_") in VAGUE]  # fmt: skip
    assert vague == ["rotation.py: at"]  # public: `CoupledRotation.at`


#: Most parameters of a function.
MOST = 12
#: Why some have more. No other may join them.
_PUBLIC = "public: its arguments are promised, and most are given by name"
_PASS = "a pass of the table, which takes a parameter of the disk an argument"
_LANES = "a kernel: machine code takes arrays side by side, and no record of them"
WIDE = {
    "phase_portrait": _PUBLIC,
    "Problem.__init__": _PUBLIC,
    "RotorMotions.poincare": _PUBLIC,
    "bearing_forces": _PASS,
    "fixed_bearing_forces": _PASS,
    "separatrix_forces": _PASS,
    **{f"kernels: {name}": _LANES for name in (
        "advance", "correct", "crossings", "growth", "heun_until", "motions", "newton", "note",
        "paths", "shorter", "strobe",
    )},
}  # fmt: skip


def test_functions_take_few_parameters():
    wide = set()
    for _, owner, node in functions():
        own = node.args
        given = [one.arg for one in (*own.posonlyargs, *own.args, *own.kwonlyargs)]
        if len(set(given) - {"self", "cls"}) > MOST:
            compiled = {ast.unparse(one) for one in node.decorator_list} & {"kernel", "routine"}
            name = f"{owner}.{node.name}" if owner else node.name
            wide.add(f"kernels: {name}" if compiled else name)
    assert wide == set(WIDE)


def test_special_points_that_are_recommended_exist():
    labels = re.findall(r"special\('(\w+)'\)", "\n".join(target for target, _ in NAMES))
    assert len(labels) > 2
    branch = pk.continuation(PROBLEM, "mu", x0=[1.0], span=(-1.0, 2.0))
    for label in labels:
        branch.special(label)
    with pytest.raises(pk.ParameterError, match="did you mean 'hopf'"):
        branch.special("HB")


class Own(pk.Problem):
    """A class of a user's, with properties that fail."""

    @property
    def mine(self):
        """Fail inside a module."""
        return np.nosuch_thing

    @property
    def deeper(self):
        """Fail inside itself."""
        return self.paramters


class OwnWell(pk.Potential):
    """A system that answers to its parameters as well."""

    mine, deeper = Own.mine, Own.deeper


@pytest.mark.parametrize(
    "thing", [Own("m*x - x^3", "x", {"m": 1.0}), OwnWell("x^4 - m*x^2", "x", {"m": 1.0})]
)
def test_a_property_that_fails_says_why_itself(thing):
    with pytest.raises(AttributeError, match="module 'numpy' has no attribute 'nosuch_thing'"):
        _ = thing.mine
    with pytest.raises(AttributeError, match="no attribute 'paramters'; did you mean 'parameters'"):
        _ = thing.deeper
    assert not hasattr(thing, "mine")
