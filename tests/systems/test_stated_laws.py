"""A class that declares its parameters as fields and states a potential, rates or a step."""

import inspect
import pickle

import numpy as np
import pytest

import phasekit as pk
from phasekit.systems.system import MODELS

SPRING = "-9.81*cos(theta) - spin^2*sin(theta)^2/2 + k*(sqrt(5/4 - cos(theta)) - free)^2/2"


class Hoop(pk.System):
    """Bead on a rotating hoop, held by a spring."""

    spin = pk.parameter("s-1", "angular velocity of the hoop")
    k = pk.parameter("s-2", "stiffness over mass", positive=True)
    free = pk.parameter("1", "natural length over radius", default=0.5, low=0.0, high=1.5)
    coordinate = pk.angle("theta")
    potential = SPRING


class Nerve(pk.System):
    """FitzHugh and Nagumo."""

    current = pk.parameter("1", "applied current", default=0.5)
    eps = pk.parameter("1", "ratio of time scales", default=0.08)
    rates = {"v": "v - v^3/3 - w + current", "w": "eps*(v + 0.7 - 0.8*w)"}
    states = {"v": ("mV", "voltage"), "w": ("1", "recovery")}
    window = {"v": (-3, 3), "w": (-2, 3)}


class Turning(pk.System):
    """An angle that is driven, by a function."""

    drive = pk.parameter("s-1", "rate of the drive", default=0.5)
    states = "theta"
    periods = {"theta": 2 * np.pi}

    @staticmethod
    def rates(x, drive):
        return drive - np.sin(x)


class Logistic(pk.System):
    """Growth that is bounded."""

    r = pk.parameter("1", "growth", default=2.8, low=0.0, high=4.0)
    step = {"x": "r*x*(1 - x)"}


OWN = [MODELS.pop(kind.__name__) for kind in (Hoop, Nerve, Turning, Logistic)]


@pytest.fixture(autouse=True)
def registered(monkeypatch):
    """The classes are known by their names here, and not to other tests."""
    for kind in OWN:
        monkeypatch.setitem(MODELS, kind.__name__, kind)


HOOP = Hoop(spin=6.0, k=10.0)
SAME = pk.Potential(SPRING, "theta", {"spin": 6.0, "k": 10.0, "free": 0.5}, period="2*pi")
STATE = (0.3, 0.5)


@pytest.mark.slow
@pytest.mark.parametrize(
    "function",
    [
        lambda s: pk.equilibria(s),
        lambda s: pk.separatrices(s),
        lambda s: pk.orbits(s, *STATE),
        lambda s: pk.flow(s, *STATE, np.linspace(0.0, 2.0, 5)),
        lambda s: pk.energy(s, *STATE),
        lambda s: pk.sweep(s, spin=[1.0, 4.0, 7.0]),
        lambda s: pk.capture(pk.Perturbed(s, damping=0.01, torque=0.1)),
    ],
)
def test_a_named_potential_is_answered_as_the_formula(function):
    got, want = function(HOOP), function(SAME)
    got = got if hasattr(got, "data_vars") else got.to_dataset(name="value")
    want = want if hasattr(want, "data_vars") else want.to_dataset(name="value")
    assert len(want.data_vars)
    assert set(got.data_vars) == set(want.data_vars)
    for name in want.data_vars:
        np.testing.assert_array_equal(got[name].values, want[name].values)


@pytest.mark.slow
def test_a_named_potential_has_units_and_comes_back(tmp_path):
    ds = pk.sweep(HOOP, spin=[1.0, 7.0], k=[5.0, 10.0])
    assert ds.spin.attrs == {"long_name": "angular velocity of the hoop", "units": "s-1"}
    assert ds.isel(spin=1, k=0).phasekit.system() == HOOP.replace(spin=7.0, k=5.0)
    stored = pk.sweep(HOOP, spin=[1.0, 7.0], of="equilibria", store=tmp_path / "map.zarr")
    assert pk.open_map(tmp_path / "map.zarr").isel(spin=0).phasekit.system() == Hoop(spin=1, k=10)
    np.testing.assert_array_equal(stored.phi, ds.phi.sel(k=10.0))
    assert pickle.loads(pickle.dumps(HOOP)) == HOOP != HOOP.replace(free=0.4)
    rpm = HOOP.replace(spin=pk.equilibria(HOOP).spin * 0 + 6.0)
    assert pk.equilibria(rpm).n_equilibria.item() == 4
    branch = pk.continuation(HOOP, "spin", x0=0.0, span=(0.0, 9.0))
    (fork,) = branch.special("pitchfork")
    # At the fork V'' vanishes at 0: 9.81 - spin^2 + k (1 - free/s)/2 with s = 1/2.
    assert fork["spin"] == pytest.approx(np.sqrt(9.81 + 5.0 * (1.0 - 0.5 / 0.5)), rel=1e-12)
    assert pk.plot.phase_portrait(HOOP).lines


@pytest.mark.slow
def test_rates_are_a_problem_with_words_and_a_window():
    same = pk.Problem(Nerve.rates, ("v", "w"), {"current": 0.5, "eps": 0.08})
    found = pk.equilibria(Nerve())
    want = pk.equilibria(same, box={"v": (-3, 3), "w": (-2, 3)})
    assert found.n_equilibria.item() == 1
    np.testing.assert_array_equal(found.x, want.x)
    narrow = pk.equilibria(Nerve(), box={"v": (0, 3)})
    assert narrow.n_equilibria.item() == 0
    assert narrow.box_low.values.tolist() == [0.0, -2.0]
    branch = pk.continuation(Nerve(), "current", x0=found.x.values[0], span=(0.0, 2.0))
    edge = np.sqrt(1.0 - 0.8 * 0.08)  # where the trace vanishes
    places = [point["v"] for point in branch.special("hopf")]
    np.testing.assert_allclose(places, [-edge, edge], rtol=1e-10)
    assert branch.problem.words["v"] == {"units": "mV", "long_name": "voltage"}
    assert branch.problem.words["current"]["long_name"] == "applied current"
    orbits = branch.special("hopf")[0].switch()
    assert len(orbits.points.period) > 3
    assert len(pk.diagram(Nerve(), "current", span=(0.0, 2.0))) >= 1


def test_rates_may_be_a_function_and_a_step_is_a_map():
    branch = pk.continuation(Turning(), "drive", x0=np.arcsin(0.5), span=(0.0, 2.0))
    (fold,) = branch.special("fold")
    assert (fold["theta"], fold["drive"]) == pytest.approx((np.pi / 2, 1.0), rel=1e-7)
    branch = pk.continuation(Logistic(), "r", x0=1.0 - 1 / 2.8, span=(2.0, 3.9))
    (doubling,) = branch.special("period_doubling")
    assert doubling["r"] == pytest.approx(3.0, rel=1e-12)


@pytest.mark.parametrize(
    "call",
    [
        lambda s: pk.orbits(s, *STATE),
        lambda s: pk.separatrices(s),
        lambda s: pk.sweep(s, **{s.declared[0].name: [0.1, 0.2]}, of="capture"),
        lambda s: pk.basins(s, phi=[0.0, 1.0], dphi=[0.0, 1.0]),
        lambda s: pk.attractors(s, phi=[0.0, 1.0], dphi=[0.0, 1.0]),
        lambda s: pk.Perturbed(s, damping=0.1),
        lambda s: pk.critical(s, s.declared[0].name),
        lambda s: pk.branches(s, s.declared[0].name, (0.0, 1.0)),
        lambda s: pk.rotators(s, *STATE),
        lambda s: s.coefficients(),
        lambda s: s.reduced(),
    ],
)
@pytest.mark.parametrize("system", [Nerve(), Logistic()], ids=["flow", "map"])
def test_what_needs_a_potential_says_so(call, system):
    with pytest.raises(
        pk.ParameterError, match=r"^((system|perturbed|disk|phi)?: ?got|of: .*capture)"
    ):
        call(system)


def test_arrays_of_parameters_are_refused_by_continuation():
    with pytest.raises(pk.ParameterError, match="current: got .*, wants a single number"):
        pk.continuation(Nerve(current=[0.1, 0.2]), "current", x0=[0, 0], span=(0, 1))


def test_the_call_is_that_of_the_fields():
    assert str(inspect.signature(Hoop)) == "(*, spin, k, free=0.5)"
    assert str(inspect.signature(pk.Reduced)) == "(lam, psi, Omega_sq=1.0)"
    assert repr(HOOP) == "Hoop(spin=6.0, k=10.0, free=0.5)"
    for arguments, message in (
        ({"spin": 1.0}, "missing a required argument: 'k'; its parameters are spin, k, free"),
        ({"spin": 1.0, "k": 1.0, "stiff": 2.0}, "stiff"),
        ({"spin": 1.0, "k": -1.0}, "k: got -1.0, wants a number > 0 in s-2"),
        ({"spin": 1.0, "k": 1.0, "free": 2.0}, "free: got 2.0, wants a number from 0 to 1.5"),
        ({"spin": "fast", "k": 1.0}, "spin: got 'fast'"),
    ):
        with pytest.raises(pk.ParameterError, match=message):
            Hoop(**arguments)
    with pytest.raises(pk.ParameterError, match="too many positional arguments"):
        Hoop(1.0, 2.0)
    for change in (lambda: setattr(HOOP, "k", 2.0), lambda: delattr(HOOP, "k")):
        with pytest.raises(AttributeError, match="frozen"):
            change()


def test_a_law_without_parameters():
    class Free(pk.System):
        """What is left to itself."""

        rates = {"x": "-x"}
        window = {"x": (-1, 1)}

    del MODELS["Free"]
    assert str(inspect.signature(Free)) == "()"
    assert pk.equilibria(Free()).x.values.tolist() == [[0.0]]
    with pytest.raises(pk.ParameterError, match="parameter of Free 'a' is unknown"):
        Free(a=1.0)
    with pytest.raises(pk.ParameterError, match="System: wants a class of your own"):
        pk.System()


def test_a_class_inherits_parameters_and_law():
    class Heavier(Hoop):
        """The same hoop, with a parameter that the law does not know."""

        mass = pk.parameter("kg", "mass of the bead", default=None, positive=True)

    del MODELS["Heavier"]
    heavier = Heavier(spin=6.0, k=10.0)
    assert list(heavier.parameters) == ["spin", "k", "free"]
    assert heavier.replace(mass=2.0).parameters["mass"] == 2.0
    np.testing.assert_array_equal(pk.equilibria(heavier).phi, pk.equilibria(HOOP).phi)
    with pytest.raises(pk.ParameterError, match="mass: got -1.0, wants a number > 0 in kg"):
        heavier.replace(mass=-1.0)


P = pk.parameter()
X = pk.coordinate("x")


@pytest.mark.parametrize(
    ("body", "message"),
    [
        ({"a": P}, r"wants a law: products, potential, rates or step"),
        ({"a": P, "potential": "a*x^2", "rates": {"y": "a"}}, "got potential and rates, wants one"),
        ({"a": P, "potential": "a*x^2"}, "coordinate of Odd: got None, wants pk.angle"),
        ({"a": P, "potential": "a*x^2", "coordinate": "x"}, "coordinate of Odd: got 'x'"),
        ({"a": P, "potential": "b*x^2", "coordinate": X}, "b"),
        ({"a": P, "potential": "os.remove(x)", "coordinate": X}, "expression"),
        ({"x": P, "potential": "x^2", "coordinate": X}, "other than the coordinate's"),
        ({"a": P, "rates": {"y": "c*y"}}, "c"),
        ({"a": P, "rates": {"a": "a"}}, "no state's"),
        ({"a": P, "rates": {"y": "np.sin(y)"}}, "np"),
        ({"a": P, "rates": {"y": "a"}, "window": {"z": (0, 1)}}, "window of Odd: state"),
        ({"a": P, "rates": {"y": "a"}, "window": {"y": (1, 0)}}, "low < high"),
        ({"a": P, "rates": {"y": "a"}, "periods": {"y": -1.0}}, "wants a number > 0"),
        ({"a": P, "rates": {"y": "a"}, "states": {"y": "mV"}}, "two texts"),
        ({"a": P, "rates": lambda x, a: x}, "states of Odd: got None"),
        ({"a": P, "rates": {"lambda": "a"}}, "lambda"),
        *(
            ({name: pk.parameter(), "rates": {"y": "y"}}, f"{name}.*another name")
            for name in ("replace", "period", "time", "law", "phi", "energy", "parameters")
        ),
        *(
            ({"a": P, "rates": {name: "a"}}, f"{name}.*another name")
            for name in ("potential", "rates", "step", "window", "coordinate", "period", "time")
        ),
    ],
)
def test_what_is_no_law_is_refused_where_the_class_is_made(body, message):
    before = dict(MODELS)
    with pytest.raises(pk.ParameterError, match=message):
        type("Odd", (pk.System,), dict(body))
    assert before == MODELS


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"units": 3}, "units: got 3"),
        ({"long_name": None}, "long_name: got None"),
        ({"low": 2.0, "high": 1.0}, "low: got 2.0"),
        ({"low": "0"}, "low: got '0'"),
        ({"positive": 1}, "positive: got 1"),
        ({"default": -1.0, "positive": True}, "default: got -1.0, wants a number > 0"),
        ({"default": "half"}, "default: got 'half'"),
    ],
)
def test_fields_are_checked_where_they_are_declared(arguments, message):
    with pytest.raises(pk.ParameterError, match=message):
        pk.parameter(**arguments)


def test_coordinates_are_checked_where_they_are_declared():
    for make in (pk.angle, pk.coordinate):
        with pytest.raises(pk.ParameterError, match="coordinate: got '2x'"):
            make("2x")
    with pytest.raises(pk.ParameterError, match="period: got -1.0"):
        pk.coordinate("x", period=-1.0)
    with pytest.raises(pk.ParameterError, match="interval: got"):
        pk.coordinate("x", interval=(1.0, 0.0))
    assert pk.coordinate("x", interval=[-1, 2]).interval == (-1.0, 2.0)


def test_an_inertia_that_is_no_law_is_refused_and_not_left_out():
    with pytest.raises(pk.ParameterError, match="inertia of Rod: got .*a potential beside it"):

        class Rod(pk.System):
            rates = {"q": "-sin(q)"}
            inertia = "1 + cos(q)^2/2"

    with pytest.raises(pk.ParameterError, match=r"coordinate of Line: got .*; on a line state the"):

        class Line(pk.System):
            coordinate = pk.coordinate("x", interval=(-1, 1))
            potential = "x^2"
            inertia = "1 + x^2"
