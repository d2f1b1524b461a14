"""What is wrong is answered with the way to what was meant."""

import pytest

import phasekit as pk

LINE = pk.Problem({"x": "mu - x^2"}, parameters={"mu": 1.0})
BRANCH = pk.continuation(LINE, "mu", x0=[1.0], span=(-1, 2))


@pytest.mark.parametrize(
    ("name", "words"),
    [
        ("folds", 'branch.special("fold")'),
        ("hopf", 'branch.special("hopf")'),
        ("hopf_points", 'branch.special("hopf")'),
        ("eigenvalues", "each of branch.special_points has eigenvalues"),
        ("stability", "branch.points.n_unstable"),
        ("data", "branch.points"),
        ("nothing", "no attribute 'nothing'"),
    ],
)
def test_a_branch_says_where_its_values_are(name, words):
    with pytest.raises(AttributeError) as caught:
        getattr(BRANCH, name)
    assert words in str(caught.value)


def test_the_response_of_a_phase_asks_for_an_orbit():
    with pytest.raises(pk.ParameterError, match=r"orbit: got .*pk\.periodic_orbit\(system"):
        pk.phase_response(LINE, [1.0])


@pytest.mark.parametrize("function", [pk.equilibria, pk.flow], ids=lambda f: f.__name__)
def test_a_function_is_told_what_makes_a_system_of_it(function):
    with pytest.raises(pk.ParameterError, match=r"function, wants .*pk\.Problem\(f, state="):
        function(lambda x: x)
