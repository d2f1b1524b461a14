"""Results travel: to copies, files and worker processes, and are equal to what was sent."""

from __future__ import annotations

import copy
import enum
import pickle
import subprocess
import sys
from pathlib import Path

import numba
import numpy as np
import pytest

import phasekit as pk
from phasekit.pickles import Stamped

SHORT = pk.ContinuationOptions(max_points=12, directions="forward")
BRUSSELATOR = pk.Problem(["1 - (b + 1)*x + x**2*y", "b*x - x**2*y"], ("x", "y"), {"b": 1.5})


def cubic(x, mu):
    return mu + x - x**3


@numba.njit
def compiled(x, mu):
    return np.array([mu + x[0] - x[0] ** 3])


def size(x, mu):
    return x[0] ** 2


def fold_branch(f):
    problem = pk.Problem(f, "x", {"mu": -1.0})
    return pk.continuation(problem, "mu", x0=[-1.3], span=(-1, 1), record={"size": size})


def of_formulas():
    return fold_branch("mu + x - x**3")


def of_python():
    return fold_branch(cubic)


def of_compiled():
    return fold_branch(compiled)


def of_a_system():
    magnet = pk.StonerWohlfarth(K=-2.0, h_x=1.0, h_y=0.5)
    return pk.continuation(magnet, "h_x", x0="upper_center", span=(0.1, 4.0))


def of_a_map():
    logistic = pk.Problem("r*x*(1 - x)", "x", {"r": 2.5}, map=True)
    return pk.continuation(logistic, "r", x0=[0.6], span=(2, 3.5)).special("PD")[0].switch()


def of_two_parameters():
    cusp = pk.Problem("mu + l*x - x**3", "x", {"mu": -1.0, "l": 1.0})
    branch = pk.continuation(cusp, "mu", x0=[-1.3], span=(-1, 1))
    return branch.special("LP")[0].curve("l", (-1.0, 2.0))


def of_cycles():
    rest = pk.continuation(BRUSSELATOR, "b", x0=[1.0, 1.5], span=(1, 3))
    return rest.special("H")[0].switch(options=SHORT)


BRANCHES = (
    of_formulas, of_python, of_compiled, of_a_system, of_a_map, of_two_parameters, of_cycles
)  # fmt: skip


def travelled(thing):
    return pickle.loads(pickle.dumps(thing))


@pytest.fixture(scope="module")
def elsewhere():
    """What another process computes, by name."""
    folder, module = str(Path(__file__).parents[len(__name__.split(".")) - 1]), __name__
    text = (
        f"import pickle, sys; sys.path.insert(0, {folder!r}); import {module} as made; "
        "found = {make.__name__: make() for make in made.BRANCHES}; "
        "sys.stdout.buffer.write(pickle.dumps(found))"
    )
    done = subprocess.run([sys.executable, "-c", text], capture_output=True, check=True)
    return pickle.loads(done.stdout)


@pytest.mark.parametrize("make", BRANCHES, ids=lambda make: make.__name__)
def test_a_branch_is_equal_wherever_it_was_traced(make, elsewhere, tmp_path):
    branch = make()
    point = branch.special_points[0]
    branch.save(tmp_path / "branch.nc")
    given = {} if branch.problem.kind == "symbolic" else {"problem": branch.problem}
    record = {"record": {"size": size}} if "size" in branch.points else {}
    loaded = pk.Branch.load(tmp_path / "branch.nc", **given, **record)
    others = (
        make(), elsewhere[make.__name__], travelled(branch), copy.copy(branch),
        copy.deepcopy(branch), loaded,
    )  # fmt: skip
    for other in others:
        assert other == branch
        assert not other != branch
        assert hash(other) == hash(branch)
        assert other is not branch
        assert other.special_points[0] == point
        assert hash(other.special_points[0]) == hash(point)
        assert other.problem == branch.problem
        assert hash(other.problem) == hash(branch.problem)
    assert travelled(point) == point
    assert travelled(elsewhere[make.__name__]) == branch


def test_what_differs_is_not_equal():
    branch = of_formulas()
    others = [of_cycles(), of_a_map(), fold_branch(cubic), 1.0, "mu"]
    problem = branch.problem
    others += [
        pk.continuation(problem, "mu", x0=[-1.3], span=(-1, 1)),  # nothing recorded
        pk.continuation(problem, "mu", x0=[-1.3], span=(-1, 1), record={"size": cubic}),
        pk.continuation(problem, "mu", x0=[-1.3], span=(-1, 0.9), record={"size": size}),
        pk.continuation(problem, "mu", x0=[-1.3], span=(-1, 1), record={"size": size},
                        options=SHORT),
    ]  # fmt: skip
    assert all(branch != other for other in others)
    one, two = branch.special("LP")
    assert one != two
    assert one != one.special
    assert branch.special_points[0] != others[1].special_points[0]
    changed = [
        problem.replace(mu=0.5), problem.described({"mu": {"units": "N"}}), "mu + x - x**3",
        pk.Problem("mu + x - x**3", "x", {"mu": -1.0}, map=True),
        pk.Problem("mu + x - x**3", "x", {"mu": -1.0}, conservative=True),
        pk.Problem("mu + x - x**3", "x", {"mu": -1.0}, periods={"x": 1.0}),
        pk.Problem("mu - x - x**3", "x", {"mu": -1.0}), pk.Problem(cubic, "x", {"mu": -1.0}),
    ]  # fmt: skip
    assert all(problem != other for other in changed)
    assert problem == pk.Problem("x - x**3 + mu", ["x"], {"mu": -1})


def test_what_travelled_goes_on(elsewhere):
    long, short = of_cycles(), elsewhere["of_cycles"]
    assert short.extend(5) == long.extend(5)
    fold = elsewhere["of_formulas"].special("LP")[0]
    assert len(fold.branch.plot().lines)
    assert len({fold, of_formulas().special("LP")[0]}) == 1
    assert len({long, short, long.extend(5)}) == 2


def test_what_travels_does_not_change():
    for branch in (of_formulas(), of_cycles()):
        point = branch.special_points[0]
        for array in (point.x, point.eigenvalues, branch.points.special.values):
            with pytest.raises(ValueError, match="read-only"):
                array[0] = array[0]
        for mapping in (point.parameters, point.normal_form):
            with pytest.raises(TypeError, match="does not support item assignment"):
                mapping["mu"] = 3.0
    disk = pk.GyroRotorDisk(beta=0.7, e=0.05, a=0.024, r=0.2, omega1=30.0)
    driven = pk.Perturbed(disk, modulation={"omega1": pk.Harmonic(0.1, 2.0)}, drift={"e": 0.1})
    for mapping in (driven.modulation, driven.drift):
        with pytest.raises(TypeError, match="does not support item assignment"):
            mapping["e"] = 3.0
    assert travelled(driven) == driven
    assert "modulation={'omega1'" in repr(driven)


def test_pages_and_motion_at_a_momentum_are_equal_by_value():
    disk = pk.GyroRotorDisk(beta=1.0, e=0.1, a=0.01, r=0.1, omega1=15.0, m=2.0)
    rotor, pendulum = pk.FreeGyroRotor(disk, 0.02), pk.Pendulum(length=0.5)
    for one, again, other in (
        (rotor.amended(0.5), rotor.amended(0.5), rotor.amended(0.6)),
        (pk.explore(pendulum), pk.explore(pendulum), pk.explore(pendulum.replace(length=1.0))),
    ):
        for same in (again, travelled(one), copy.copy(one), copy.deepcopy(one)):
            assert same == one
            assert hash(same) == hash(one)
        assert other != one
        assert one != 1.0


@pytest.mark.parametrize(
    "thing", [pk.Pendulum(length=1.0), pk.Coefficients(1.0, 2.0, 3.0), pk.Term("-dphi"),
              BRUSSELATOR, pk.Potential("k*x^2", "x", {"k": 1.0}), pk.Harmonic(0.1, 2.0),
              pk.ContinuationOptions(max_points=9), pk.Event(size),
              pk.RigidBody(1.0, np.zeros(3), np.eye(3))], ids=lambda x: type(x).__name__
)  # fmt: skip
def test_pickles_of_another_version_are_refused(thing):
    data = pickle.dumps(thing)
    assert pickle.loads(data) == thing
    other = data.replace(pk.__version__.encode(), b"9" * len(pk.__version__))
    with pytest.raises(pk.StoreError, match=r"got one of phasekit 9+, wants one of \d"):
        pickle.loads(other)
    # Before names are looked for that this version may not have.
    gone = other.replace(type(thing).__module__.encode(), b"x" * len(type(thing).__module__))
    with pytest.raises(pk.StoreError, match="got one of phasekit 9+"):
        pickle.loads(gone)


def test_every_public_class_carries_the_version_in_its_pickles():
    classes = [getattr(pk, name) for name in pk.__all__ if isinstance(getattr(pk, name), type)]
    own = [one for one in classes if not issubclass(one, (enum.Enum, Exception))]
    assert len(own) > 20
    for one in own:
        assert one.__reduce_ex__ is Stamped.__reduce_ex__, one


@pytest.mark.parametrize(
    "thing", [
        pk.Problem(lambda x, mu: mu - x, "x", {"mu": 1.0}), pk.Term(lambda t, phi, dphi: -dphi),
        pk.Event(lambda t, x: x[0]),
        pk.Perturbed(pk.Pendulum(length=1.0), terms=pk.Term(lambda t, phi, dphi: phi)),
    ], ids=lambda x: type(x).__name__,
)  # fmt: skip
def test_functions_without_a_name_are_refused_by_pickles_alone(thing):
    with pytest.raises(pk.ParameterError, match=r"pickle: got a \w+ of the function <lambda>"):
        pickle.dumps(thing)
    assert type(copy.copy(thing)) is type(copy.deepcopy(thing)) is type(thing)
    by_code = pytest.importorskip("cloudpickle")
    assert type(pickle.loads(by_code.dumps(thing))) is type(thing)
