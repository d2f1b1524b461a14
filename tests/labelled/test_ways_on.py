"""What is wrong is answered with the way to what was meant."""

import copy
import pickle
import pkgutil
import re
import warnings

import numpy as np
import pytest

import phasekit as pk
from phasekit.spellings import KINDS, MEMBERS, NAMES

LINE = pk.Problem({"x": "mu - x^2"}, parameters={"mu": 1.0})
NERVE = pk.Problem(
    {"v": "v - v^3/3 - w + I", "w": "0.08*(v + 0.7 - 0.8*w)"},
    parameters={"I": 0.0},
    window={"v": (-2.5, 2.5), "w": (-1, 2)},
)
LORENZ = pk.Problem(
    {"x": "s*(y - x)", "y": "x*(r - z) - y", "z": "x*y - b*z"},
    parameters={"s": 10.0, "r": 28.0, "b": 8 / 3},
)
LOGISTIC = pk.Problem({"x": "r*x*(1 - x)"}, parameters={"r": 3.2}, map=True)
PENDULUM = pk.Pendulum(length=1.0)
DISK = pk.GyroRotorDisk(beta=0.7, e=0.05, a=0.024, r=0.2, omega1=31.4)
BRANCH = pk.continuation(LINE, "mu", x0=[1.0], span=(-1, 2))
REST = pk.continuation(NERVE, "I", span=(0, 1))
(HOPF,) = REST.special("hopf")
FEW = pk.ContinuationOptions(max_points=4)
CYCLES = HOPF.switch(options=FEW)
CUSP = pk.Problem({"x": "mu + a*x - x^3"}, parameters={"mu": -1.0, "a": 1.0})
FOLDS = pk.continuation(CUSP, "mu", x0=[-1.3], span=(-1, 1)).special("LP")[0].curve("a", (0.5, 2))
FOUND = pk.equilibria(DISK)

#: Calls as a new user types them, and what the answer has to name.
PROVOKED = [
    # attributes of results
    (lambda: BRANCH.folds, 'branch.special("fold")'),
    (lambda: BRANCH.torus, 'branch.special("torus")'),
    (lambda: BRANCH.branch_points, 'branch.special("branch_point")'),
    (lambda: BRANCH.hopf_points, 'branch.special("hopf")'),
    (lambda: BRANCH.neimark_sacker, 'branch.special("torus")'),
    (lambda: BRANCH.bifurcations, "branch.special_points"),
    (lambda: BRANCH.eigenvalues, "branch.points.n_unstable"),
    (lambda: BRANCH.stability, "branch.points.n_unstable"),
    (lambda: BRANCH.data, "branch.points"),
    (lambda: BRANCH.mu, "branch.points.mu"),
    (lambda: BRANCH.x, "branch.points.x"),
    (lambda: BRANCH.to_pandas(), "branch.to_dataframe()"),
    (lambda: BRANCH.parameters, "branch.problem.parameters"),
    (lambda: BRANCH.switch(), "branch.special(...)[0].switch()"),
    (lambda: CYCLES.period, "branch.points.period"),
    (lambda: CYCLES.T, "branch.points.period"),
    (lambda: CYCLES.floquet_multipliers, "branch.points.multiplier"),
    (lambda: CYCLES.amplitude, "extremes"),
    (lambda: HOPF.u, "point.x"),
    (lambda: HOPF.v, 'point["v"]'),
    (lambda: HOPF.I, 'point["I"]'),
    (lambda: HOPF.l1, 'point.normal_form["l1"]'),
    (lambda: HOPF.omega, 'point.normal_form["omega"]'),
    (lambda: HOPF.first_lyapunov, 'point.normal_form["l1"]'),
    (lambda: HOPF.type, "point.kind"),
    (lambda: HOPF.params, "point.parameters"),
    (lambda: FOUND.phasekit.portrait(), "pk.plot.phase_portrait"),
    (lambda: FOUND.phasekit.plot.branch(), "pk.plot.branch"),
    # attributes of systems
    (lambda: NERVE.equilibria(), "pk.equilibria"),
    (lambda: NERVE.simulate(), "pk.flow"),
    (lambda: NERVE.plot(), "pk.plot.phase_portrait(system)"),
    (lambda: NERVE.phase_portrait(), "pk.plot.phase_portrait"),
    (lambda: NERVE.I, 'system.parameters["I"]'),
    (lambda: NERVE.v, "v is a state"),
    (lambda: NERVE.rhs, "problem.f"),
    (lambda: DISK.equilibria, "pk.equilibria"),
    (lambda: DISK.fixed_points(), "pk.equilibria"),
    (lambda: pk.Perturbed(PENDULUM, damping=0.1).basins, "pk.basins"),
    (lambda: DISK.theta, "its parameters are beta, e, a, r, omega1"),
    (lambda: DISK.A, "system.coefficients().A"),
    (lambda: pk.Problem.from_file("neuron.ode"), "from_ode, from_potential, from_sbml"),
    (lambda: pk.Branch.open("branch.zarr"), "there are load"),
    # brackets
    (lambda: BRANCH["fold"], 'branch.special("fold")'),
    (lambda: BRANCH["x"], "branch.points.x"),
    (lambda: NERVE["I"], 'system.parameters["I"]'),
    (
        lambda: REST.special("hopf")[5],
        "I from 0 to 1>: got [5], there are 1",
    ),
    (lambda: REST.special("fold")[0], "got [0], there are none"),
    (lambda: pk.Branch(), "made by pk.continuation"),
    # functions and pictures
    (lambda: pk.simulate, "pk.flow"),
    (lambda: pk.branch, "pk.continuation"),
    (lambda: pk.plot.cobweb, "pk.plot.orbit_diagram"),
    (lambda: pk.plot.portrait, "phase_portrait"),
    (lambda: FOUND.phasekit.plot(), "wants the name of a picture; there are bearing_forces, "),
    (lambda: pk.units.Nm, "phasekit.units has no 'Nm'; there are cm, deg, gram"),
    (lambda: pk.equilibria({"x": "x - x^3"}), "got {'x': 'x - x^3'}, wants one of"),
    (lambda: BRANCH.special("HB"), "did you mean 'hopf'"),
    (lambda: BRANCH.special("Saddle-Node"), "did you mean 'fold'"),
    (lambda: BRANCH.special(), "special() missing a required argument: 'label'"),
    # arguments
    (lambda: pk.plot.phase_portrait(LORENZ), "window={'x': (low, high)}"),
    (lambda: pk.equilibria("x-x^3"), "pk.Problem({'x': 'x-x^3'}"),
    (lambda: pk.continuation("x-x^3", "p", span=(0, 1)), "pk.Problem({'x': 'x-x^3'}"),
    (lambda: pk.equilibria(lambda x: x), "pk.Problem(f, state="),
    (lambda: pk.Problem("x-x^3"), "pk.Problem({'x': "),
    (lambda: pk.Problem({"x": "m - x^2"}, m=1.0), "parameters={'m': ...}"),
    (lambda: pk.equilibria(NERVE, I=0.5), "system.replace(I=...)"),
    (lambda: pk.equilibria(NERVE, v=0.0), "box={'v': ...}"),
    (lambda: pk.equilibria(NERVE, box=(0, 1)), "box={'v': (-1, 1), ...}"),
    (lambda: pk.flow(NERVE, v=0.5, w=0, t=1.0, I=0.5), "system.replace(I=...)"),
    (lambda: pk.continuation(NERVE, "v", span=(0, 1)), "v is a state"),
    (lambda: pk.continuation(NERVE, I=(0, 1)), "parameter='I'"),
    (lambda: pk.continuation(NERVE, "I", span=(0, 1), u0=[0, 0]), "did you mean 'x0'"),
    (lambda: pk.continuation(NERVE, "I", span=(0, 1), options={"ds": 1}), "ContinuationOptions(**"),
    (lambda: pk.ContinuationOptions(ds=0.1), "did you mean 'initial_step'"),
    (lambda: pk.orbit_diagram(LOGISTIC, r=[3, 4]), "parameter='r'"),
    (lambda: pk.lyapunov(LORENZ), "x, y, z as well; and duration"),
    (lambda: pk.sweep(LORENZ, r=[20, 28], of="lyapunov"), "duration=; states at the start, x=, y="),
    (lambda: pk.sweep(LORENZ, of="lyapunov"), "duration=; states at the start, x=, y="),
    (lambda: pk.orbits(PENDULUM, theta=1.0), "did you mean 'phi0'"),
    (lambda: pk.phase_response(LINE, [1.0]), "pk.periodic_orbit(system"),
    (lambda: NERVE(0.5, 0.0), "its arguments are x, changes"),
    (lambda: HOPF.curve("I"), "its arguments are parameter, span, options"),
    (lambda: HOPF.switch(direction=3), "0: one family begins"),
    (lambda: pk.continuation(NERVE, "I", span="0:1"), "two numbers (low, high)"),
    (lambda: pk.GyroRotorDisk(1.0, 0.05, 0.012, 0.2, 3.0), "are given by name: beta, e, a, r"),
    (lambda: pk.Coefficients(1.0, 2.0, 3.0, 4.0), "its parameters are A, B, C"),
    (lambda: pk.open_map(__file__), "no netCDF-4"),
]


@pytest.mark.parametrize(("call", "words"), PROVOKED, ids=[words for _, words in PROVOKED])
def test_what_a_new_user_types_is_answered_by_the_way_on(call, words):
    with pytest.raises(
        (pk.ParameterError, AttributeError, TypeError, IndexError, pk.StoreError)
    ) as caught:
        call()
    assert words in str(caught.value)


def test_brackets_are_those_of_tuples_where_there_are_any():
    found = REST.special("hopf")
    assert found[0] == found[-1]
    assert found[:1] == (HOPF,)
    assert copy.copy(found) == tuple(found)
    assert pk.Coefficients(1.0, 2.0, 3.0)[1] == 2.0
    assert tuple(pk.Coefficients(1.0, 2.0, 3.0)) == (1.0, 2.0, 3.0)
    for one in (BRANCH, NERVE, HOPF):
        with pytest.raises(TypeError, match="not iterable"):
            iter(one)


def test_what_is_named_as_the_way_on_is_there():
    things = {"branch": BRANCH, "cycles": CYCLES, "point": HOPF, "system": DISK}
    things["page"] = pk.explore(DISK)
    things |= {"problem": NERVE, "pictures": FOUND.phasekit.plot, "dataset": FOUND.phasekit}
    assert set(MEMBERS) == set(things)
    for name, rows in MEMBERS.items():
        assert name in things[name]._guides
        guesses = [guess for _, others in rows for guess in others.split()]
        assert len(guesses) == len(set(guesses)), name
        for right, others in rows:
            start = re.match(r"(branch|point|system|problem|pk|ds\.phasekit)\.(\w+)", right)
            thing = pk if start and start[1] == "pk" else things[name]
            assert start is None or hasattr(thing, start[2]), right
            for guess in others.split():
                assert not hasattr(things[name], guess), (name, guess)
    for word, kind in KINDS.items():
        with pytest.raises(pk.ParameterError, match=f"did you mean '{kind}'"):
            BRANCH.special(word)


@pytest.mark.parametrize("right", [right for right, _ in NAMES])
def test_every_name_of_other_programs_is_answered_by_its_row(right):
    rooms = {one.name for one in pkgutil.iter_modules(pk.__path__)}
    for guess in dict(NAMES)[right].split():
        assert guess not in rooms  # which are there as soon as they are used
        with pytest.raises(AttributeError) as caught:
            getattr(pk, guess)
        assert str(caught.value).endswith(f"use 'pk.{right}'")


@pytest.mark.parametrize("thing", [NERVE, DISK, PENDULUM, BRANCH, HOPF, FOUND.phasekit])
def test_unknown_attributes_are_refused_plainly(thing):
    """Where nothing is near it says what there is; what machines ask for has no hint."""
    for name in ("qqqqqq", "_qqqqqq", "__array_interface__"):
        assert not hasattr(thing, name)
        said = "$" if name.startswith("_") else "; (its parameters are|there are) "
        with pytest.raises(AttributeError, match=f"no attribute '{name}'{said}") as caught:
            getattr(thing, name)
        assert str(pickle.loads(pickle.dumps(caught.value))) == str(caught.value)
    if isinstance(thing, pk.System):
        assert copy.deepcopy(thing) == thing
        half = object.__new__(type(thing))
        with pytest.raises(AttributeError) as caught:
            half.equilibria  # noqa: B018
        assert "no attribute 'equilibria'" in str(caught.value)


def invalid_cells():
    return pk.sweep(PENDULUM, length=[-1.0, -2.0, 1.0])


#: Calls that warn, from as many floors.
WARNINGS = [
    lambda: pk.continuation(LINE, "mu", x0=[1.0], span=(-1, 2), options=FEW),
    lambda: pk.continuation(LINE, "mu", x0=[1.0], span=(-1, 2), options=FEW).extend(1),
    lambda: HOPF.switch(options=FEW),
    invalid_cells,
    lambda: pk.flow(pk.Problem({"x": "x^2"}, parameters={}), [1.0], t=[0.0, 9.0]),
    lambda: pk.lyapunov(LORENZ, [1.0, 1.0, 1.0], time=1.0),
    lambda: BRANCH.known(),
]


@pytest.mark.slow
@pytest.mark.parametrize("call", WARNINGS)
def test_warnings_point_at_the_line_that_was_typed(call):
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        call()
    assert caught
    assert {one.filename for one in caught} == {__file__}
    first = call.__code__.co_firstlineno
    assert {one.lineno - first for one in caught} <= {0, 1}


@pytest.mark.parametrize("branch", [BRANCH, REST, CYCLES, FOLDS])
def test_frames_of_branches_have_a_row_a_point(branch):
    frame, points = branch.to_dataframe(), branch.points
    assert list(frame.index) == list(range(points.sizes["point"]))
    for name in (*branch.free, *(name for name in branch.problem_state if name in points)):
        np.testing.assert_array_equal(frame[name], points[name])
    beside = {"multiplier", "tangent"} & {*points.variables}
    assert beside
    for name in beside:
        (dim,) = {*points[name].dims} - {"point"}
        columns = [one for one in frame if one.startswith(f"{name} ")]
        assert len(columns) == points.sizes[dim]
        np.testing.assert_array_equal(frame[columns], points[name].transpose("point", dim))
