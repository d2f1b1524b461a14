"""Branches of equilibria of the published systems: every special point, and no other.

Every form of every system is tried by ``PHASEKIT_PUBLISHED=all pytest tests/published``; otherwise
the compiled and the Python form are tried on some systems.
"""

from __future__ import annotations

import functools

import numpy as np
import pytest
from published import compare, reference
from published.compare import kind_of
from published.systems import FOLD, HOPF, NEUTRAL, SYSTEMS
from scipy.optimize import root
from witnesses.variants import ALL, some

SOME = (
    "cusp",
    "A -> B reaction",
    "Lorenz, convection",
    "CO oxidation, k = 0.4",
    "CO oxidation, k = 1.0",
    "two cells of Bratu, unequal",
)


@functools.cache
def wanted(name: str) -> list[reference.Special]:
    return reference.specials(SYSTEMS[name])


@functools.cache
def branch(name: str, form: str = "symbolic"):
    return compare.follow(SYSTEMS[name], form)


@functools.cache
def on_curve(name: str) -> reference.OnCurve:
    (curve,) = SYSTEMS[name].curves
    return reference.OnCurve(SYSTEMS[name], curve)


@pytest.mark.parametrize("name", SYSTEMS)
def test_published_values(name):
    """Against 60 digits: a wrong digit in either would show."""
    system = SYSTEMS[name]
    for kind, printed in system.published.items():
        values = reference.parameters_of(wanted(name), kind)
        assert len(values) == len(printed), (kind, values)
        np.testing.assert_allclose(values, sorted(printed), rtol=0, atol=system.digits)


@pytest.mark.parametrize("name", SYSTEMS)
def test_the_start_is_on_the_curve(name):
    """What a solver makes of x0 is an equilibrium that the explicit curves contain."""
    system = SYSTEMS[name]
    f = system.python()
    solution = root(lambda x: f(x, **system.parameters), system.x0, tol=1e-12).x
    assert np.max(np.abs(f(solution, **system.parameters))) < 1e-9
    begins = np.array([*solution, system.parameters[system.parameter]])
    on = on_curve(name)
    with np.errstate(all="ignore"):
        along = on.in_doubles(np.linspace(on.low, on.high, 20_001))
    off = np.abs(np.array(along[: on.n + 1]).T - begins) / (1e-9 + np.abs(begins).max())
    assert np.nanmin(off.max(axis=1)) < 5e-3


@pytest.mark.parametrize("name", SYSTEMS)
def test_special_points(name):
    """The text wants 1e-8; exact derivatives give 1e-11."""
    system = SYSTEMS[name]
    compare.compare(branch(name).special_points, wanted(name), system.parameter, 1e-11)


@pytest.mark.parametrize("name", some(SYSTEMS, 3))
def test_every_fold_and_hopf_point_is_proved(name):
    """The values in 60 digits, of decimals as doubles, lie inside the bounds."""
    system = SYSTEMS[name]
    found = compare.follow(system, certify=True)
    inexact = any(float(v) != round(v * 2**40) / 2**40 for v in system.parameters.values())
    wanted_ = wanted(name)
    assert found.points.certified_onward.values[:-1].mean() > 0.9
    splits = name != "two cells of Bratu, unequal"  # a branch that leaves a subspace of its own
    assert all(point.certified == splits for point in found.special("BP"))
    for point in found.special_points:
        if kind_of(point) not in (FOLD, HOPF, NEUTRAL):
            continue
        assert point.certified, point
        assert point.doubt == "", point
        at = [point[key] for key in (*system.state, system.parameter)]
        nearest = min(
            (one for one in wanted_ if one.kind == kind_of(point)),
            key=lambda one, at=at: max(
                abs(float(x) - y) for x, y in zip((*one.state, one.parameter), at, strict=True)
            ),
        )
        values = {system.parameter: nearest.parameter}
        values |= zip(system.state, nearest.state, strict=True)
        if kind_of(point) == HOPF:
            values["omega"] = nearest.omega
        for key, value in values.items():
            low, high = point.enclosure[key]
            assert high - low <= 1e-9 * max(abs(low), abs(high), 1e-3), (key, low, high)
            room = 1e-11 * max(abs(low), abs(high)) if inexact else 0.0
            assert low - room <= value <= high + room, (key, low, value, high)


@pytest.mark.parametrize("form", ["compiled", "python"])
@pytest.mark.parametrize("name", SYSTEMS if ALL else SOME)
def test_special_points_of_functions(name, form):
    """Derivatives by differences give 1e-8 as well."""
    system = SYSTEMS[name]
    compare.compare(branch(name, form).special_points, wanted(name), system.parameter, 1e-8)


@pytest.mark.parametrize("name", SYSTEMS)
def test_points_are_equilibria_in_small_steps(name):
    system = SYSTEMS[name]
    points = branch(name).points
    f = system.python()
    sizes = {n: max(np.abs(points[n].values).max(), 1e-9) for n in system.state}
    for i in range(points.sizes["point"]):
        parameters = {**system.parameters, system.parameter: float(points[system.parameter][i])}
        x = [float(points[n][i]) for n in system.state]
        value = np.array(f(x, **parameters))
        # One rounding of a state changes f by its slope: a step of 1e-12 shows how much that is.
        moved = np.array(
            [f([y + 1e-12 * sizes[m] * (m == n) for m, y in zip(system.state, x, strict=True)],
               **parameters) for n in system.state]
        )  # fmt: skip
        assert (np.abs(value) <= np.abs(moved - value).max(axis=0) + 1e-13).all(), (i, x, value)
    along = np.array([points[n].values / sizes[n] for n in system.state])
    assert np.abs(np.diff(along)).max() < 0.25


@pytest.mark.parametrize("name", SYSTEMS)
def test_number_of_unstable_eigenvalues(name):
    """That of the exact Jacobian, where no eigenvalue vanishes."""
    system = SYSTEMS[name]
    points = branch(name).points
    on = on_curve(name)
    states = np.array([points[n].values for n in system.state]).T
    matrices = [
        on.in_doubles_at(list(x), p, list(on.fixed))
        for x, p in zip(states, points[system.parameter].values, strict=True)
    ]
    values = np.linalg.eigvals(np.array(matrices)).real
    clear = np.abs(values).min(axis=1) > 1e-7 * np.abs(values).max()
    assert clear.mean() > 0.5
    unstable = points.n_unstable.values
    np.testing.assert_array_equal(unstable[clear], np.sum(values > 0.0, axis=1)[clear])


@pytest.mark.parametrize("name", SYSTEMS)
def test_the_whole_curve_is_covered(name):
    """Every point of the explicit curve within the span lies next to the branch."""
    system = SYSTEMS[name]
    points = branch(name).points
    on = on_curve(name)
    with np.errstate(all="ignore"):
        along = on.in_doubles(np.linspace(on.low, on.high, 3001)[1:-1])
    explicit = np.array(along[: on.n + 1])
    low, high = system.span
    inside = (explicit[-1] >= low) & (explicit[-1] <= high)
    for x, variable in zip(explicit, system.state, strict=False):
        below, above = system.bounds.get(variable, (-np.inf, np.inf))
        inside &= (x >= below) & (x <= above)
    explicit = explicit[:, inside]
    followed = np.array([points[n].values for n in (*system.state, system.parameter)])
    scale = np.ptp(explicit, axis=1)[:, None] + 1e-9
    explicit, followed = explicit / scale, followed / scale
    gaps = [np.abs(followed - x[:, None]).max(axis=0).min() for x in explicit.T]
    assert max(gaps) < 0.1


@pytest.mark.parametrize("name", list(reference.stored("hopf_points")))
@pytest.mark.parametrize("form", ["symbolic", "python"] if ALL else ["symbolic"])
def test_first_lyapunov_coefficients(name, form):
    """Re c = l1 omega, found from the periodic orbits by the reference."""
    found = [one for one in branch(name, form).special_points if kind_of(one) == HOPF]
    found.sort(key=lambda one: one.parameters[SYSTEMS[name].parameter])
    stored = reference.stored("hopf_points")[name]
    for one, (_, omega, growth) in zip(found, stored, strict=True):
        assert one.normal_form["omega"] == pytest.approx(omega, rel=1e-9)
        got = one.normal_form["l1"] * one.normal_form["omega"]
        assert got == pytest.approx(growth, rel=1e-7 if form == "symbolic" else 1e-4)
