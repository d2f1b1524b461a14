"""What was raised as other libraries word it says which argument it was, and what is wanted."""

import errno
import math
import warnings
from pathlib import Path

import numpy as np
import pytest
import xarray as xr

import phasekit as pk
from phasekit.errors import ArgumentError
from phasekit.inputs import describe
from phasekit.mechanics.general.body import RigidBody

DISK = pk.GyroRotorDisk(beta=0.3, e=0.0115, a=0.02, r=0.21, omega1=2.5, m=2.0, half_span=0.1)
DURATIONS = [
    np.timedelta64(3, "s"), np.timedelta64(3, "ns"), np.timedelta64("NaT", "s"),
    np.datetime64("2020-01-01"), np.array([1, 2], "m8[s]"), np.array(5, "m8[ns]"),
]  # fmt: skip


@pytest.mark.slow
@pytest.mark.parametrize("made", [pk.equilibria, pk.separatrices])
@pytest.mark.parametrize("of", ["bearing_forces", "rotators"])
@pytest.mark.parametrize("argument", ["phi0", "dphi0"])
@pytest.mark.parametrize("selected", [False, True])
def test_states_on_a_dim_of_the_map_take_its_labels_or_are_refused_by_name(
    made, of, argument, selected
):
    ds = made(DISK)
    dim = "equilibrium" if made is pk.equilibria else "saddle"
    labels = ds[dim].values
    values = np.linspace(0.1, 0.4, labels.size)
    given = {"phi0": 0.2, "dphi0": 0.3}

    def loads(state):
        found = ds.isel({dim: 0}) if selected else ds
        return getattr(found.phasekit, of)(on="orbit", **{**given, argument: state})

    labelled = loads(xr.DataArray(values, {dim: labels}, dim))
    name = next(iter(labelled))
    assert labelled[name].size > 1
    assert np.isfinite(labelled[name].values).any()
    plain = xr.DataArray(values, dims=dim)
    if selected:
        with pytest.raises(pk.ParameterError, match=f"^{argument}: got .* labels along {dim}"):
            loads(plain)
    else:
        xr.testing.assert_equal(loads(plain), labelled)
        turned = loads(xr.DataArray(values[::-1], {dim: labels[::-1]}, dim))
        np.testing.assert_array_equal(turned[name].values, labelled[name].values)
    for wrong in (
        xr.DataArray(np.append(values, 0.5), dims=dim),
        xr.DataArray(values, {dim: [f"{label}?" for label in labels]}, dim),
    ):
        with pytest.raises(pk.ParameterError, match=f"^{argument}: got .* labels along {dim}"):
            loads(wrong)


def test_describing_an_object_asks_it_for_no_words_of_its_own():
    class Raises:
        def __getattr__(self, name):
            raise RuntimeError(name) if name == "_in_errors" else AttributeError(name)

    assert describe(Raises()) == "an object of type Raises"


@pytest.mark.parametrize("value", DURATIONS, ids=repr)
def test_durations_and_dates_are_no_numbers_and_named_as_what_they_are(value, tmp_path):
    said = describe(value)
    assert "date" in said or "duration" in said
    reduced = pk.Reduced(0.3, 0.1)
    calls = [
        lambda: pk.Reduced(value, 0.1),
        lambda: pk.flow(reduced, 0.1, 0.0, value),
        lambda: pk.Potential(value, "x"),
        lambda: pk.Perturbed(reduced, damping=value),
        lambda: pk.branches(reduced, "lam", (0.0, value)),
        lambda: pk.sweep(reduced, lam=[0.1, 0.2], store=tmp_path / "a.zarr", chunks=value),
        lambda: pk.sweep(reduced, lam=[0.1, 0.2], store=tmp_path / "b.zarr", chunks={"lam": value}),
        lambda: pk.sweep(reduced, lam=[0.1, 0.2], store=tmp_path / "c.zarr", workers=value),
    ]
    for call in calls:
        with pytest.raises(pk.ParameterError, match="got"):
            call()


@pytest.mark.parametrize("code", [errno.EROFS, errno.EACCES, errno.ENOSPC, errno.EIO])
def test_a_page_that_cannot_be_written_says_so(monkeypatch, tmp_path, code):
    page = pk.explore(pk.Pendulum(length=0.5))

    def fail(self, *args, **kwargs):
        raise OSError(code, "it is so", str(self))

    monkeypatch.setattr(Path, "write_text", fail)
    with pytest.raises(pk.StoreError, match=r"^path: .*pendulum\.html cannot be written: it is so"):
        page.save(tmp_path / "pendulum.html")


@pytest.mark.parametrize(
    ("args", "keywords", "said"),
    [
        ((), {"nonsense": 1}, "unexpected keyword argument 'nonsense'"),
        ((1.0,), {"centre": 0}, "'centre'; did you mean 'center'"),
        ((1.0,), {}, "missing a required argument: 'center'"),
        ((1, 2, 3, 4), {}, "too many positional arguments"),
        ((1.0,), {"mass": 1}, "multiple values for argument 'mass'"),
    ],
)
def test_a_body_names_its_arguments(args, keywords, said):
    with pytest.raises(ArgumentError) as caught:
        RigidBody(*args, **keywords)
    assert said in str(caught.value)
    assert str(caught.value).endswith("its arguments are mass, center, inertia")


@pytest.mark.slow
@pytest.mark.parametrize("error", [KeyError, RuntimeError, ZeroDivisionError, None])
def test_equilibria_of_a_function_without_values(error):
    def nowhere(x, mu):
        if error is not None:
            raise error("so it is")
        return np.array([np.nan, x[0]])

    def partly(x, mu):
        if x[0] > 0.5:
            raise RuntimeError("beyond the edge")
        return np.array([x[0] - 0.25, x[1] - mu])

    how = {"state": ("x", "y"), "parameters": {"mu": 0.5}, "window": {"x": (0, 1), "y": (0, 1)}}
    with pytest.raises(pk.ParameterError, match="^f: got no finite value at any of .* states"):
        pk.equilibria(pk.Problem(nowhere, **how))
    with pytest.warns(UserWarning, match="f is code, so 256 starts.*RuntimeError: beyond the edge"):
        found = pk.equilibria(pk.Problem(partly, **how))
    np.testing.assert_allclose(found.x.values, [[0.25, 0.5]])


@pytest.mark.parametrize("law", [["sqrt(x - 5) - y", "x"], lambda u: [math.sqrt(u[0] - 5), u[0]]])
def test_an_orbit_is_not_looked_for_where_the_law_has_no_value(law):
    problem = pk.Problem(law, state=["x", "y"])
    with pytest.raises(pk.ConvergenceError, match=r"x0: f has no value at \[0\.5, 0\.25\]"):
        pk.periodic_orbit(problem, [0.5, 0.25])


@pytest.mark.parametrize(
    "ask",
    [
        lambda p, grid: pk.attractors(p, grid=grid),
        lambda p, grid: pk.basins(p, grid=grid),
        lambda p, grid: pk.edge_state(p, [-1.0, 0.0], [1.0, 0.0]),
    ],
)
def test_a_drive_without_a_period_has_no_attractors_once_a_period(ask):
    driven = pk.Problem(
        {"x": "v", "v": "-d*v + x - x^3 + A*cos(w*t)"}, time="t",
        parameters={"d": 1.0, "A": 0.1, "w": 0.1},
    )  # fmt: skip
    with pytest.raises(pk.ParameterError, match=r"problem: got .*period=\.\.\.\) says one"):
        ask(driven, {"x": [0.0, 1.0], "v": [0.0]})


def edge(rate, raised):
    def law(x, mu):
        if x[0] > mu:
            raise raised
        return np.array([rate * x[0]])

    return law


def without_a_value(rate):
    return lambda x, mu: rate * x if x[0] <= mu else [np.nan]


def quick(f):
    return [f, "-1e6*(y - x)"]


@pytest.mark.slow
@pytest.mark.parametrize(
    ("f", "said", "map", "code"),
    [
        ("mu + sqrt(-x)/1000", "end where the law has no value:", False, [-1, -1]),
        ("-sqrt(x) - mu/10", "end where the law has no value:", False, [-1, -1]),
        ("3*x + sqrt(1.5 - x)/1000", "end where the law has no value:", True, [-2, -1]),
        (quick("mu + sqrt(-x)/1000"), "end where the law has no value:", False, [-1, -1]),
        (quick("-sqrt(x) - mu/10"), "end where the law has no value:", False, [-1, -1]),
        (quick("x + x^3"), None, False, [-2, -2]),
        (quick("(2 + x)^40"), None, False, [-2, -2]),
        (without_a_value(1.0), "end where the law has no value:", False, [-2, -1]),
        (without_a_value(3.0), "end where the law has no value:", True, [-2, -1]),
        (lambda x, mu: np.exp(x), None, False, [-2, -2]),
        (lambda x, mu: x**2 - x**3 - 9.0 * x, None, True, [-2, -2]),
        (edge(1.0, KeyError("mu")), "no value, where f raised KeyError: 'mu':", False, [-2, -1]),
        ("exp(x)", None, False, [-2, -2]),
        ("x^2 - x^3 - 9*x", None, True, [-2, -2]),
        (edge(3.0, OverflowError("math range error")), None, True, [-2, -2]),
    ],
)
def test_motions_that_end_where_the_law_has_no_value_do_not_run_to_infinity(f, said, map, code):
    states = ("x", "y")[: len(f) if isinstance(f, list) else 1]
    law = pk.Problem(f, states, {"mu": 1.0}, window=dict.fromkeys(states, (-1, 1)), map=map)
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        found = pk.basins(law, {"x": [-0.9, 0.8]} | ({"y": [0.0]} if "y" in states else {}))
    messages = [str(w.message) for w in caught if "end where" in str(w.message)]
    assert found.basin.values.ravel().tolist() == code
    assert not messages if said is None else said in messages[0]


def test_a_damped_motion_that_leaves_where_its_potential_is_real_does_not_run_to_infinity():
    slope = pk.Potential("(phi + 1)^1.5 + phi/10", "phi", interval=(-0.9, 1.0))
    with pytest.warns(RuntimeWarning, match="end where the law has no value:"):
        found = pk.basins(pk.Perturbed(slope, damping=0.5), {"phi": [0.5, 0.8], "dphi": [0.0]})
    assert (found.basin == -1).all()
