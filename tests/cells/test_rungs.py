"""What two rungs of the ladder of laws both compute, compared: each is the witness of the other."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import sympy
import xarray as xr

import phasekit as pk
from phasekit.cells import evaluate, request
from phasekit.cells.request import passes_of
from phasekit.cells.states import at_states, pass_from
from phasekit.laws.ladder import Conservative, Flow, Law, Routhian
from phasekit.laws.perturbed import PerturbedConservative, PerturbedTrigonometric
from phasekit.laws.trigonometric import Trigonometric
from phasekit.systems.registry import models
from phasekit.table.quantities import ROWS, TABLE
from phasekit.table.row import Pass, Quantity

SYSTEMS = (
    pk.Coefficients(1.0, 0.35, 0.12),
    pk.GyroRotorDisk(beta=0.7, e=0.05, a=0.024, r=0.2, omega1=31.4),
    pk.StonerWohlfarth(K=1.0, h_x=0.3, h_y=0.2),
    pk.Pendulum(length=0.5, g=10.0),
)
STATES = {
    "state_phi": [0.3, -1.2, 2.5], "state_dphi": [0.1, 0.0, -4.0], "state_energy": [1.0, 2.0, 3.0],
    "state_gap": [-0.01, 0.02, 0.3], "state_excess": [0.0, 0.01, 0.3], "time": [0.0, 0.7, 5.0],
}  # fmt: skip
CHOICES = {"center": None, "saddle": None, "side": "right"}
#: Each way on which two rungs compute the same: groups, what they start from, what a call says.
SHARED = sorted(
    {
        (one.groups, tuple(x for x in one.inputs if x in STATES), one.options)
        for one in TABLE.passes
        if one.of is Conservative
    }
    & {
        (one.groups, tuple(x for x in one.inputs if x in STATES), one.options)
        for one in TABLE.passes
        if one.of is Trigonometric
    }
)


def as_potential(system):
    """The same law one rung lower: any potential."""
    law = system.trigonometric()
    symbols = {name: sympy.Symbol(name, real=True) for name in law.domains}
    A, B, C = law.formulas(symbols)
    phi = sympy.Symbol("phi", real=True)
    V = -B * sympy.cos(phi) + A / 2 * sympy.cos(phi) ** 2 - C * sympy.sin(phi)
    values = {name: system.parameters[name] for name in law.parameters}
    V = V.subs({symbols[name]: sympy.Float(value, 17) for name, value in values.items()})
    return pk.Potential(V, "phi", {}, period=2 * np.pi)


def test_every_rung_below_is_reached():
    assert len(SHARED) >= 12
    groups = {group for groups, _, _ in SHARED for group in groups}
    assert {"equilibria", "separatrices", "orbits", "motion", "potential", "near_center"} <= groups


@pytest.mark.parametrize("system", SYSTEMS, ids=lambda s: type(s).__name__)
@pytest.mark.parametrize("way", SHARED, ids=lambda w: "-".join((*w[0], *w[1])))
def test_the_rungs_agree(system, way):
    groups, needed, options = way
    rows = [row for row in ROWS.values() if row.group in groups]
    # By which labels are put in order.
    places = [ROWS["phi"]] if groups == ("near_center",) else []
    states = {name: (name, STATES[name]) for name in needed}
    results = []
    for one in (system, as_potential(system)):
        if options:
            chosen = {name: CHOICES[name] for name in options}
            passes = (pass_from(one, groups[0], needed[-1], **chosen)[0],)
        else:
            passes = passes_of(one, [*places, *rows])
        results.append(in_order(at_states(one, [*places, *rows], states, passes)))
    exact, numerical = results
    names = [row.name for row in rows if row.of is Law]
    assert names
    for name in names:
        a, b = (ds[name].values.astype(float) for ds in results)
        assert a.shape == b.shape, name
        if ROWS[name].units == "rad":
            a, b = (np.exp(1j * x) for x in (a, b))
        np.testing.assert_allclose(b, a, rtol=2e-11, atol=2e-11, err_msg=name)
    assert exact.sizes == numerical.sizes


def in_order(ds):
    """Label dims without names, in the order of the angle; absent labels left out."""
    for dim, name in (("equilibrium", "phi"), ("saddle", "saddle_phi")):
        if dim in ds.dims and name in ds:
            order = np.argsort(ds[name].values)
            order = order[np.isfinite(ds[name].values[order])]
            ds = ds.isel({dim: order}).drop_vars(dim)
    return ds


def test_a_quantity_of_a_higher_rung_is_refused_below():
    potential = as_potential(SYSTEMS[0])
    with pytest.raises(pk.ParameterError, match=r"wants a system with coefficients \(A, B, C\)"):
        pk.state_of(potential, 0.1, 0.2, "outer")
    assert "fold_margin" not in pk.equilibria(potential)


def test_rungs_are_the_only_thing_that_systems_are_asked_for():
    rungs = {model.rung for model in models().values()}
    driven = {PerturbedTrigonometric, PerturbedConservative}
    assert rungs <= {Trigonometric, Conservative, Routhian, Flow} | driven
    assert isinstance(pk.equilibria(SYSTEMS[1]), xr.Dataset)


def barrier(saddle_energy, energy):
    return np.nanmax(saddle_energy, axis=-1) - np.nanmin(energy, axis=-1)


def test_what_a_row_starts_from_is_that_of_the_same_rung(monkeypatch):
    """A torque changes energies: what is computed from them is computed from these."""
    row = Quantity("barrier", "barrier", (), "float64", "s-2", "barrier", "h_s - V", "-")
    twice = replace(row, name="twice", group="twice")
    monkeypatch.setattr(TABLE, "rows", {**ROWS, "barrier": row, "twice": twice})
    lines = (
        Pass(barrier, ("saddle_energy", "energy"), ("barrier",), of=Law),
        Pass(lambda barrier: 2.0 * barrier, ("barrier",), ("twice",), of=Law),
    )
    monkeypatch.setattr(TABLE, "passes", (*TABLE.passes, *lines))
    monkeypatch.setattr(request, "ROWS", TABLE.rows)
    monkeypatch.setattr(evaluate, "ROWS", TABLE.rows)
    tilted = pk.Perturbed(pk.Coefficients(4.0, 1.0, 0.5), torque=0.2)
    as_formula = pk.Potential(
        "-cos(q) + a*cos(q)^2/2 - sin(q)/2", "q", {"a": 4.0}, period=2 * np.pi
    )  # fmt: skip
    A = np.array([4.0, 4.4, 4.8])
    of = [row, twice]
    for system, axis in ((tilted, "A"), (pk.Perturbed(as_formula, torque=0.2), "a")):
        swept = system.replace(**{axis: A})
        known = pk.equilibria(swept).merge(pk.separatrices(swept), compat="override")
        wanted = known.saddle_energy.max("saddle") - known.energy.min("equilibrium")
        found = evaluate.evaluate(swept, of)
        np.testing.assert_allclose(found.barrier, wanted, rtol=1e-13)
        np.testing.assert_array_equal(found.twice, 2.0 * found.barrier)
    chunked = xr.DataArray(A, dims="A").chunk({"A": 2})
    lazy = evaluate.evaluate(tilted.replace(A=chunked), of)
    assert lazy.barrier.chunks is not None
    first = pk.separatrices(tilted).saddle_energy.max() - pk.equilibria(tilted).energy.min()
    np.testing.assert_allclose(lazy.barrier[0], first, rtol=1e-13)
    with pytest.raises(pk.ParameterError, match="without damping and drive .* for separatrices"):
        evaluate.evaluate(tilted.replace(damping=0.1), of)
