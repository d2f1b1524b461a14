"""Normal forms at folds of cycles, beside exact ones and what multipliers say."""

from __future__ import annotations

import numpy as np
import pytest

import phasekit as pk

REACTION = pk.Problem(
    ["-u1 + p1*(1 - u1)*exp(u2)", "-u2 + p1*14*(1 - u1)*exp(u2) - 3*u2"], ("u1", "u2"), {"p1": 0.17}
)


@pytest.mark.parametrize(("p2", "k", "scale"), [(1.0, 0.0, 1.0), (1.0, 0.7, 5.0), (0.6, -0.4, 0.3)])
def test_a_fold_in_closed_form(p2, k, scale):
    # R' = R (p1 + p2 R^2 - R^4) folds at R^2 = p2/2, p1 = -p2^2/4; v = e_R has the length 1, so
    # b = dR'/dp1 = R, a = (6 p2 R - 20 R^3)/2 = -2 p2 R, however the period changes with R.
    rate, turn = "(p1 + p2*(x**2 + y**2) - (x**2 + y**2)**2)", f"(1 + {k}*(x**2 + y**2))"
    system = pk.Problem(
        [f"x*{rate} - y*{turn}", f"y*{rate} + x*{turn}"], ("x", "y"), {"p1": -(p2**2) / 5, "p2": p2}
    )
    r = np.sqrt(p2 / 2 * (1 + np.sqrt(0.2)))
    family = pk.continuation(
        system, "p1", orbit=pk.periodic_orbit(system, [r, 0.0]), span=(-(p2**2) / 3, 0.0),
        options=pk.ContinuationOptions(scales={"x": scale}),
    )  # fmt: skip
    (fold,) = family.special("LPC")
    size = np.sqrt(p2 / 2)
    assert fold["p1"] == pytest.approx(-(p2**2) / 4, rel=1e-12)
    assert fold.normal_form["b"] == pytest.approx(size, rel=1e-10)
    assert abs(fold.normal_form["a"]) == pytest.approx(2 * p2 * size, rel=1e-10)
    assert fold.normal_form["a"] * fold.normal_form["b"] == pytest.approx(-p2 * p2, rel=1e-10)


@pytest.mark.parametrize("intervals", [25, 30, 45])
def test_folds_on_meshes_that_were_asked_for(intervals):
    """A fixed mesh makes the trivial multiplier as wrong as itself, and hides no fold."""
    rest = pk.continuation(REACTION, "p1", x0=[0.45, 1.6], span=(0.15, 0.25))
    (hopf,) = (one for one in rest.special("H") if one["p1"] < 0.2)
    family = hopf.switch(options=pk.ContinuationOptions(intervals=intervals))
    assert (family.points.n_intervals == intervals).all()
    (fold,) = family.special("LPC")
    near = family.points.isel(point=fold.index)
    # The digits of a mesh of 1e-8; errors of parameters go with twice the order of states'.
    assert fold["p1"] == pytest.approx(0.16169612889773752, abs=float(near.mesh_error) ** 1.5)
    assert fold["period"] == pytest.approx(7.1137549299655785, rel=float(near.mesh_error))
    unstable = family.points.n_unstable.values
    assert np.all(unstable[: fold.index][unstable[: fold.index] >= 0] == 1)
    assert np.all(unstable[fold.index + 1 :] <= 0)


def folded(scales):
    options = pk.ContinuationOptions(scales=scales)
    orbit = pk.periodic_orbit(REACTION, [0.9, 3.0], 5.0)
    family = pk.continuation(REACTION, "p1", orbit=orbit, span=(0.15, 0.3), options=options)
    (fold,) = family.special("LPC")
    assert fold["p1"] == pytest.approx(0.161696128898, rel=1e-10)
    return fold


@pytest.mark.slow
def test_the_normal_form_of_a_fold_does_not_depend_on_the_scales():
    """By which phases of orbits are compared, so that tangents have other parts along the flow."""
    fold, other = folded({}), folded({"u1": 100.0})
    for name in "ab":
        assert abs(other.normal_form[name]) == pytest.approx(abs(fold.normal_form[name]), rel=1e-8)


def test_the_normal_form_of_a_fold_beside_multipliers():
    # xi' = b mu + a xi^2 rests at xi^2 = -b mu/a, where mu(T) = exp(2 a xi T). With half the
    # difference of both sides, what is of second order falls out: its square is -4 a b mu.
    fold = folded({})
    form, branch = fold.normal_form, fold.branch
    found = []
    for distance in (2.4e-6, 6e-7):
        rates = []
        for side in (-1, 1):
            orbit = pk.periodic_orbit(
                REACTION.replace(p1=fold["p1"] + distance), branch.orbit(fold.index + side)
            )
            values = orbit.multiplier.values
            other = values[np.argmax(np.abs(values - 1.0))].real
            rates.append(np.log(other) / float(orbit.period))
        assert rates[0] * rates[1] < 0.0
        found.append((rates[0] - rates[1]) ** 2 / (-16.0 * distance))
    limit = found[1] + (found[1] - found[0]) / 3.0
    assert form["a"] * form["b"] == pytest.approx(limit, rel=1e-4)
