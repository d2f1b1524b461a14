"""Normal forms where families of periodic orbits cross, and of folds of forced systems."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.optimize import minimize_scalar

import phasekit as pk

#: A cycle of radius 1 whose radius and speed follow z, with an equation for z of its own.
RADIUS = "(1 - x**2 - y**2 + e*z)"
TURN = "(w + k*z)"
VALUES = {"mu": -0.3, "e": 0.7, "w": 2.0, "k": 0.4, "g": 0.5, "q": 0.6, "p": 0.3}
TRANSCRITICAL = "z*mu*(1 + g*x) - z**2*(1 + q*x**2)"
PITCHFORK = "z*mu*(1 + g*x) - z**3*(1 + q*x**2) + p*z**2*x"


def polar(rate, **changes):
    """On z = 0 is a cycle for every mu. Means over x = cos leave of z its normal form.

    The critical function is (e cos/2, e sin/2, 1), less its size; z changes speed, too.
    """
    return pk.Problem(
        [f"x*{RADIUS} - y*{TURN}", f"y*{RADIUS} + x*{TURN}", rate], ("x", "y", "z"),
        VALUES | changes,
    )  # fmt: skip


def branch_of(rate, x0, **changes):
    system = polar(rate, **changes)
    orbit = pk.periodic_orbit(system, x0)
    return pk.continuation(system, "mu", orbit=orbit, span=(-0.3, 0.4))


@pytest.mark.parametrize(("rate", "name", "power"), [(TRANSCRITICAL, "a", 1), (PITCHFORK, "c", 2)])
@pytest.mark.parametrize("other", [False, True])
def test_normal_forms_known_in_closed_form(rate, name, power, other):
    start = {"x0": [1.0, 0.0, 0.5], "mu": 0.25} if other else {"x0": [1.0, 0.0, 0.0]}
    branch = branch_of(rate, **start)
    (point,) = [s for s in branch.special_points if s.kind != "end"]
    assert (point.kind, point.status) == ("cycle_branch_point", "converged")
    assert abs(point["mu"]) < 1e-12
    size = 1.0 / np.sqrt(1.0 + 0.25 * VALUES["e"] ** 2)
    mean = 1.0 + 0.5 * VALUES["q"]
    # Along z = mu/(1 + q/2) + ... the growth of what departs from it is -mu.
    growth = -1.0 if other and name == "a" else 1.0
    assert set(point.normal_form) == {"d", name}
    assert np.isclose(point.normal_form["d"], growth, rtol=1e-9)
    assert np.isclose(point.normal_form[name], -mean * size**power, rtol=1e-9)


def growth_beside(branch, point, forced):
    """The critical exponent along a branch, over the parameter's distance from a point."""
    points, name = branch.points, branch.parameter
    apart = points[name].values - point[name]
    near = np.flatnonzero((np.abs(apart) < 0.01 * abs(point[name])) & (apart != 0.0))
    assert len(near) > 8
    mu = points.multiplier.values[near]
    order = np.argsort(np.abs(mu - 1.0), axis=1)[:, 0 if forced else 1]
    critical = mu[np.arange(len(near)), order].real
    rates = np.log(critical) / points.period.values[near] / apart[near]
    return np.polyfit(apart[near], rates, 4)[-1]


def test_the_symmetric_cycle_of_lorenz_loses_its_symmetry():
    """Asymmetric cycles, simulated and laid over their mirror images, are as far as c says."""
    lorenz = pk.Problem(
        ["10*(y - x)", "rho*x - y - x*z", "x*y - 8*z/3"], ("x", "y", "z"), {"rho": 317.0}
    )
    orbit = pk.periodic_orbit(lorenz, [10.0, 10.0, 300.0], settle=60.0)
    options = pk.ContinuationOptions(max_step=0.02)
    branch = pk.continuation(lorenz, "rho", orbit=orbit, span=(309.0, 317.0), options=options)
    (point,) = branch.special("BPC")
    form = point.normal_form
    assert np.isclose(form["d"], growth_beside(branch, point, False), rtol=1e-5)

    def f(t, x, rho):
        return [10.0 * (x[1] - x[0]), rho * x[0] - x[1] - x[0] * x[2], x[0] * x[1] - 8 * x[2] / 3]

    options = pk.ContinuationOptions(max_step=1e-3, max_points=9)
    other = point.switch(options=options)
    found = []
    for i in (0, 2, 4):
        one = other.orbit(i)
        period, rho = float(one.period), float(one.rho)
        start = [float(one[name][0]) for name in lorenz.state]
        motion = solve_ivp(
            f, (0.0, 2 * period), start, args=(rho,), rtol=1e-11, atol=1e-11, dense_output=True,
            method="DOP853",
        ).sol  # fmt: skip
        at = np.linspace(0.0, period, 400, endpoint=False)
        x, mirror = motion(at), np.diag([-1.0, -1.0, 1.0])

        def apart(shift, x=x, mirror=mirror, motion=motion, at=at):
            return np.mean(np.sum((x - mirror @ motion(at + shift)) ** 2, axis=0))

        least = minimize_scalar(
            apart, bounds=(0.45 * period, 0.55 * period), method="bounded",
            options={"xatol": 1e-11},
        ).fun  # fmt: skip
        found.append((rho - point["rho"], least / 4.0))
    rho, square = np.array(found).T
    slope = np.polyfit(rho, square / rho, 1)[-1]
    assert np.isclose(slope, -form["d"] / form["c"], rtol=1e-4)


@pytest.mark.parametrize(("parameter", "span"), [("F", (2.05, 2.25)), ("w", (0.89, 0.94))])
def test_the_symmetric_response_of_duffing_loses_its_symmetry(parameter, span):
    values = {"d": 0.2, "F": 2.2, "w": 0.9}
    formulas = ["v", "F*cos(w*t) - d*v - x - x**3"]
    system = pk.Problem(formulas, ("x", "v"), values, time="t", period="2*pi/w")
    sampled = pk.periodic_orbit(system, [1.47, 0.26])
    options = pk.ContinuationOptions(max_step=0.02)
    branch = pk.continuation(system, parameter, orbit=sampled, span=span, options=options)
    (point,) = branch.special("BPC")
    form = point.normal_form
    assert np.isclose(form["d"], growth_beside(branch, point, True), rtol=1e-5)
    other = point.switch(options=pk.ContinuationOptions(max_step=2e-3, max_points=9))
    found = []
    for i in (0, 2, 4):
        one = other.orbit(i)
        period, p = float(one.period), float(one[parameter])
        force, w = (p, values["w"]) if parameter == "F" else (values["F"], p)
        at = np.linspace(0.0, period, 401)
        x = solve_ivp(
            lambda t, x, force=force, w=w: [
                x[1], force * np.cos(w * t) - values["d"] * x[1] - x[0] - x[0] ** 3
            ],
            (0.0, period), [float(one.x[0]), float(one.v[0])], rtol=1e-11, atol=1e-11, t_eval=at,
            method="DOP853",
        ).y[:, :-1]  # fmt: skip
        # The mirror image is half a period later.
        square = np.mean(np.sum((x + np.roll(x, 200, axis=1)) ** 2, axis=0)) / 4.0
        found.append((p - point[parameter], square))
    p, square = np.array(found).T
    slope = np.polyfit(p, square / p, 1)[-1]
    assert np.isclose(slope, -form["d"] / form["c"], rtol=1e-4)


@pytest.mark.parametrize("parameter", ["w", "F"])
def test_folds_of_forced_systems_with_the_forcing_as_parameter(parameter):
    """Next to a fold the critical exponent is the root of -4 a b (p - p0)."""
    system = pk.Problem(
        ["v", "F*cos(w*t) - d*v - x - x**3"], ("x", "v"), {"d": 0.04, "F": 0.015, "w": 1.046},
        time="t", period="2*pi/w",
    )  # fmt: skip
    orbit = pk.periodic_orbit(system, [0.0, 0.0], settle=300.0)
    span = (1.04, 1.06) if parameter == "w" else (0.01, 0.03)
    branch = pk.continuation(system, parameter, orbit=orbit, span=span)
    folds = branch.special("LPC")
    assert len(folds) == 2
    for fold in folds:
        near = system.replace(**{parameter: fold[parameter]})
        options = pk.ContinuationOptions(max_step=2e-4, max_points=12)
        around = pk.continuation(near, parameter, orbit=fold.orbit, span=span, options=options)
        points = around.points
        mu = points.multiplier.values
        critical = mu[np.arange(len(mu)), np.argmin(np.abs(mu - 1.0), axis=1)].real
        square = (np.log(critical) / points.period.values) ** 2
        slope = np.polyfit(points[parameter].values - fold[parameter], square, 1)[0]
        form = fold.normal_form
        assert np.isclose(slope, -4.0 * form["a"] * form["b"], rtol=1e-2)
